/* Robust bundle adjustment: Levenberg and Marquardt's steps on views and lens by the Schur complement of the points. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/stats.h"
#include "base/thread.h"
#include "pipeline/posed/solve/solve_internal.h"

#define LENS_STATES 2    /* focal length in units of itself, k1 */
#define BEHIND_COST 1e4  /* squared residual, in sigmas, of a point that is not in front of its view */
#define NEAR        1e-3 /* smallest depth, in the model's unit */
#define TRIES       8    /* steps of growing damping before the adjustment ends */
#define ENOUGH      1e-7 /* relative fall of the cost that ends it */
#define PARTS       8 /* of the tracks, whose sums are added in their order: the same bytes for any number of threads */
#define PARTS_ROOM  4000000 /* numbers in the sums of all parts: the skylines of long flights are large */

/* A sight's derivatives, by rotation and centre of its view, its point, and the lens. */
struct slopes {
    double view[2][6], point[2][3], lens[2][LENS_STATES], r[2], weight;
};

/* A prior that couples centres of views: sum of part . centre[view] = value. */
struct coupling {
    int views[4];
    double part[4][3], value, sigma;
    int count;
    bool firm; /* without a robust loss */
};

/* Consecutive tracks, with their part of the normal equations. */
struct part {
    int from, to;
    struct poses_skyline sum;
    double *vector; /* [states] */
    double cost;
};

#define COUPLING_LOSS 9.0 /* squared sigmas from which on couplings give way */

struct work {
    const struct poses_adjust *how;
    const struct poses_tracks *tracks;
    struct slopes *slope;            /* [sights] */
    double (*cross)[18];             /* [sights] view by point: 6x3 */
    double (*lens_cross)[6];         /* [tracks] lens by point: 2x3 */
    double (*block)[6], (*right)[3]; /* [tracks] normal equations of a point, lower half by rows */
    double (*inverse)[6];            /* [tracks] damped */
    double *gradient, *step;         /* [states] */
    double *diagonal;                /* [states] */
    struct poses_skyline base, system;
    struct part part[PARTS];
    int parts;
    struct coupling *coupling;
    int couplings, states;
    int lens_states; /* that are adjusted: the rest of LENS_STATES has no slopes */
};

static bool project(const struct poses_model *m, const struct poses_sight *s, double q[3], double xy[2])
{
    const double *x = m->point[s->track], *c = m->centre[s->view];
    const double d[3] = { x[0] - c[0], x[1] - c[1], x[2] - c[2] };
    double a, b, scale;

    sst_numbers_apply3(m->rotation[s->view], d, q);
    if (!(q[2] > NEAR))
        return false;
    a = q[0] / q[2];
    b = q[1] / q[2];
    scale = m->focal * (1 + m->k1 * (a * a + b * b));
    xy[0] = a * scale;
    xy[1] = b * scale;
    return true;
}

void poses_residuals(const struct poses_model *model, const struct poses_tracks *tracks, double *px)
{
    double q[3], xy[2];

    for (int i = 0; i < tracks->sights; i++) {
        const struct poses_sight *s = tracks->sight + i;

        px[i] = project(model, s, q, xy) ? hypot(xy[0] - s->x, xy[1] - s->y) : (double)INFINITY;
    }
}

double poses_median(const struct poses_model *model, const struct poses_tracks *tracks)
{
    double *px = malloc((size_t)tracks->sights * sizeof(*px) + 1), median = (double)NAN;

    if (px) {
        poses_residuals(model, tracks, px);
        median = sst_stats_median(px, tracks->sights);
    }
    free(px);
    return median;
}

/* --- priors ------------------------------------------------------------------------------------------------------- */

/* Rotation vector from the prior to the model's rotation. */
static void turn_from(const double rotation[9], const double prior[9], double v[3])
{
    double between[9];

    sst_rotation_between(rotation, prior, between);
    sst_rotation_to_vector(between, v);
}

/* Information about small turns in the view's axes. */
static void turn_information(const struct poses_prior *p, double out[9])
{
    const double all = 1 / (p->sigma_angle * p->sigma_angle);
    const double more = p->sigma_axis > 0 ? 1 / (p->sigma_axis * p->sigma_axis) - all : 0;
    double axis[3];

    sst_numbers_apply3(p->rotation, p->axis, axis);
    for (int i = 0; i < 9; i++)
        out[i] = (i % 4 == 0) * all + more * axis[i / 3] * axis[i % 3];
}

/* Rows that draw linked views towards equal distances on a line; the direction is taken from the model. */
static int line_rows(const struct poses_model *m, const struct poses_adjust *how, struct coupling *row)
{
    int last = -1, begin = -1, end = -1, count = 0;
    double axis[3][3] = { { 0 } }, length = 0;

    for (int v = 0; v < m->views; v++) {
        if (how->linked[v]) {
            begin = begin < 0 ? v : begin;
            end = v;
        }
    }
    for (int i = 0; i < 3; i++)
        axis[0][i] = m->centre[end][i] - m->centre[begin][i];
    length = sqrt(axis[0][0] * axis[0][0] + axis[0][1] * axis[0][1] + axis[0][2] * axis[0][2]);
    if (end - begin < 2 || !(length > 0))
        return 0;
    for (int i = 0; i < 3; i++)
        axis[0][i] /= length;
    axis[1][fabs(axis[0][0]) < 0.7 ? 0 : 1] = 1; /* made perpendicular */
    for (int i = 0, k = fabs(axis[0][0]) < 0.7 ? 0 : 1; i < 3; i++)
        axis[1][i] -= axis[0][k] * axis[0][i];
    length = sqrt(axis[1][0] * axis[1][0] + axis[1][1] * axis[1][1] + axis[1][2] * axis[1][2]);
    for (int i = 0; i < 3; i++)
        axis[1][i] /= length;
    for (int i = 0; i < 3; i++)
        axis[2][i] = axis[0][(i + 1) % 3] * axis[1][(i + 2) % 3] - axis[0][(i + 2) % 3] * axis[1][(i + 1) % 3];
    for (int v = begin; v <= end; v++) {
        if (!how->linked[v])
            continue;
        for (int k = 0; k < 3 && last >= 0; k++) {
            const double share = (double)(v - last) / (end - begin);
            struct coupling *c = row + count++;

            *c = (struct coupling){ .count = 4, .views = { v, last, end, begin } };
            c->sigma = (k ? how->line_across : how->line_along) * sqrt(v - last);
            for (int i = 0; i < 3; i++) {
                c->part[0][i] = axis[k][i];
                c->part[1][i] = -axis[k][i];
                c->part[2][i] = -share * axis[k][i];
                c->part[3][i] = share * axis[k][i];
            }
        }
        last = v;
    }
    /* Mean distance 1, nearly exactly: the others would shrink the model. */
    row[count] =
        (struct coupling){ .count = 2, .views = { end, begin }, .value = end - begin, .sigma = 1e-3, .firm = true };
    for (int i = 0; i < 3; i++) {
        row[count].part[0][i] = axis[0][i];
        row[count].part[1][i] = -axis[0][i];
    }
    return count + 1;
}

static double coupling_residual(const struct poses_model *m, const struct coupling *c)
{
    double r = -c->value;

    for (int k = 0; k < c->count; k++) {
        for (int i = 0; i < 3; i++)
            r += c->part[k][i] * m->centre[c->views[k]][i];
    }
    return r / c->sigma;
}

static double prior_cost(const struct poses_model *m, const struct work *w)
{
    const struct poses_adjust *how = w->how;
    double cost = 0, v[3], information[9];

    for (int i = 0; i < w->couplings; i++) {
        const double r = coupling_residual(m, w->coupling + i);

        cost += w->coupling[i].firm ? r * r : COUPLING_LOSS * log1p(r * r / COUPLING_LOSS);
    }
    for (int k = 0; how->prior && k < m->views; k++) {
        const struct poses_prior *p = how->prior + k;

        if (!how->linked[k])
            continue;
        turn_from(m->rotation[k], p->rotation, v);
        turn_information(p, information);
        for (int i = 0; i < 3; i++) {
            for (int j = 0; p->sigma_angle > 0 && j < 3; j++)
                cost += information[3 * i + j] * v[i] * v[j];
            if (p->sigma_centre > 0)
                cost += pow((m->centre[k][i] - p->centre[i]) / p->sigma_centre, 2);
        }
    }
    if (how->focal_sigma > 0 && how->free_focal)
        cost += pow(log(m->focal / how->focal_prior) / how->focal_sigma, 2);
    return cost;
}

/* Input of the parts, and the model that their points move to. */
struct parts_job {
    struct work *work;
    const struct poses_model *model;
    struct poses_model *to;
    double damping;
};

static void for_parts(struct parts_job *job, sst_work_fn *fn)
{
    const int err = sst_parallel_for(job->work->parts, job->work->how->threads, fn, job);

    assert(!err); /* of nothing that the parts do */
}

static int part_cost(void *arg, int index, int worker SST_UNUSED)
{
    const struct parts_job *job = arg;
    const struct poses_tracks *tracks = job->work->tracks;
    struct part *part = job->work->part + index;
    const double s2 = job->work->how->sigma_px * job->work->how->sigma_px;
    double q[3], xy[2];

    part->cost = 0;
    for (int i = tracks->first[part->from]; i < tracks->first[part->to]; i++) {
        const struct poses_sight *s = tracks->sight + i;
        double e2 = BEHIND_COST;

        if (project(job->model, s, q, xy))
            e2 = ((xy[0] - s->x) * (xy[0] - s->x) + (xy[1] - s->y) * (xy[1] - s->y)) / s2;
        part->cost += log1p(e2);
    }
    return 0;
}

static double data_cost(const struct poses_model *m, struct work *w)
{
    struct parts_job job = { .work = w, .model = m };
    double cost = 0;

    for_parts(&job, part_cost);
    for (int i = 0; i < w->parts; i++)
        cost += w->part[i].cost;
    return cost;
}

static double cost_of(const struct poses_model *m, struct work *w)
{
    return data_cost(m, w) + prior_cost(m, w);
}

/* --- normal equations --------------------------------------------------------------------------------------------- */

/* Derivatives at one sight; weight 0: behind its view. */
static void slopes_of(struct slopes *out, const struct poses_model *m, const struct poses_sight *s,
                      const struct poses_adjust *how)
{
    const double *r = m->rotation[s->view];
    double q[3], xy[2], by[2][3], a, b, r2, scale, e2;

    memset(out, 0, sizeof(*out));
    if (!project(m, s, q, xy))
        return;
    a = q[0] / q[2];
    b = q[1] / q[2];
    r2 = a * a + b * b;
    scale = m->focal * (1 + m->k1 * r2);
    for (int i = 0; i < 2; i++) {
        const double u = i ? b : a, half = 2 * m->focal * m->k1 * u; /* by a: half * a, by b: half * b */
        const double ua = half * a + (i == 0) * scale, ub = half * b + (i == 1) * scale;

        by[i][0] = ua / q[2];
        by[i][1] = ub / q[2];
        by[i][2] = -(ua * a + ub * b) / q[2];
        out->lens[i][0] = how->free_focal ? u * scale : 0;
        out->lens[i][1] = how->free_k1 ? u * m->focal * r2 : 0;
        out->r[i] = xy[i] - (i ? s->y : s->x);
        /* q turns by w x q: derivative by w is (q x by). */
        for (int k = 0; k < 3; k++)
            out->view[i][k] = q[(k + 1) % 3] * by[i][(k + 2) % 3] - q[(k + 2) % 3] * by[i][(k + 1) % 3];
        for (int k = 0; k < 3; k++) {
            out->point[i][k] = by[i][0] * r[k] + by[i][1] * r[3 + k] + by[i][2] * r[6 + k];
            out->view[i][3 + k] = how->still ? 0 : -out->point[i][k];
        }
    }
    e2 = (out->r[0] * out->r[0] + out->r[1] * out->r[1]) / (how->sigma_px * how->sigma_px);
    out->weight = 1 / (1 + e2) / (how->sigma_px * how->sigma_px);
}

static void add_views(struct part *part, const struct slopes *o, int view)
{
    for (int i = 0; i < 6; i++) {
        double *row = part->sum.row[6 * view + i] + (ptrdiff_t)6 * view;

        for (int j = 0; j <= i; j++)
            row[j] += o->weight * (o->view[0][i] * o->view[0][j] + o->view[1][i] * o->view[1][j]);
        part->vector[6 * view + i] += o->weight * (o->view[0][i] * o->r[0] + o->view[1][i] * o->r[1]);
    }
}

static void add_lens(struct part *part, int states, const struct slopes *o, int view, int lens)
{
    for (int i = 0; i < states; i++) {
        double *row = part->sum.row[lens + i];

        for (int j = 0; j < 6; j++)
            row[6 * view + j] += o->weight * (o->lens[0][i] * o->view[0][j] + o->lens[1][i] * o->view[1][j]);
        for (int j = 0; j <= i; j++)
            row[lens + j] += o->weight * (o->lens[0][i] * o->lens[0][j] + o->lens[1][i] * o->lens[1][j]);
        part->vector[lens + i] += o->weight * (o->lens[0][i] * o->r[0] + o->lens[1][i] * o->r[1]);
    }
}

static void add_point(struct work *w, const struct slopes *o, int sight, int track)
{
    for (int i = 0, at = 0; i < 3; i++) {
        for (int j = 0; j <= i; j++, at++)
            w->block[track][at] += o->weight * (o->point[0][i] * o->point[0][j] + o->point[1][i] * o->point[1][j]);
        w->right[track][i] += o->weight * (o->point[0][i] * o->r[0] + o->point[1][i] * o->r[1]);
        for (int v = 0; v < 6; v++)
            w->cross[sight][3 * v + i] = o->weight * (o->view[0][v] * o->point[0][i] + o->view[1][v] * o->point[1][i]);
        for (int l = 0; l < w->lens_states; l++)
            w->lens_cross[track][3 * l + i] +=
                o->weight * (o->lens[0][l] * o->point[0][i] + o->lens[1][l] * o->point[1][i]);
    }
}

static void add_coupling(struct work *w, const struct poses_model *m, const struct coupling *c)
{
    const double e = coupling_residual(m, c), loss = c->firm ? 1 : 1 / (1 + e * e / COUPLING_LOSS);
    const double weight = loss / (c->sigma * c->sigma), r = loss * e / c->sigma;

    for (int a = 0; a < c->count; a++) {
        for (int i = 0; i < 3; i++) {
            const int at = 6 * c->views[a] + 3 + i;

            w->gradient[at] += c->part[a][i] * r;
            for (int b = 0; b < c->count; b++) {
                for (int j = 0; j < 3; j++) {
                    const int to = 6 * c->views[b] + 3 + j;

                    if (to <= at)
                        w->base.row[at][to] += weight * c->part[a][i] * c->part[b][j];
                }
            }
        }
    }
}

static void add_priors(struct work *w, const struct poses_model *m, int lens)
{
    const struct poses_adjust *how = w->how;

    for (int i = 0; i < w->couplings; i++)
        add_coupling(w, m, w->coupling + i);
    for (int k = 0; how->prior && k < m->views; k++) {
        const struct poses_prior *p = how->prior + k;
        double v[3], information[9];

        if (!how->linked[k])
            continue;
        turn_from(m->rotation[k], p->rotation, v);
        turn_information(p, information);
        for (int i = 0; i < 3; i++) {
            const int turn = 6 * k + i, move = turn + 3;

            for (int j = 0; p->sigma_angle > 0 && j < 3; j++) {
                if (j <= i)
                    w->base.row[turn][6 * k + j] += information[3 * i + j];
                w->gradient[turn] += information[3 * i + j] * v[j];
            }
            if (p->sigma_centre > 0) {
                w->base.row[move][move] += 1 / (p->sigma_centre * p->sigma_centre);
                w->gradient[move] += (m->centre[k][i] - p->centre[i]) / (p->sigma_centre * p->sigma_centre);
            }
        }
    }
    if (how->focal_sigma > 0 && how->free_focal) {
        const double weight = 1 / (how->focal_sigma * how->focal_sigma);

        w->base.row[lens][lens] += weight;
        w->gradient[lens] += weight * log(m->focal / how->focal_prior);
    }
}

/* Slopes of a part's sights, and their sums. */
static int linearise_part(void *arg, int index, int worker SST_UNUSED)
{
    const struct parts_job *job = arg;
    struct work *w = job->work;
    struct part *part = w->part + index;
    const size_t from = (size_t)part->from, tracks = (size_t)(part->to - part->from);
    const int lens = 6 * job->model->views;

    poses_skyline_clear(&part->sum);
    memset(part->vector, 0, (size_t)w->states * sizeof(*part->vector));
    memset(w->block + from, 0, tracks * sizeof(*w->block));
    memset(w->right + from, 0, tracks * sizeof(*w->right));
    memset(w->lens_cross + from, 0, tracks * sizeof(*w->lens_cross));
    for (int i = w->tracks->first[part->from]; i < w->tracks->first[part->to]; i++) {
        const struct poses_sight *s = w->tracks->sight + i;
        struct slopes *o = w->slope + i;

        slopes_of(o, job->model, s, w->how);
        add_views(part, o, s->view);
        add_lens(part, w->lens_states, o, s->view, lens);
        add_point(w, o, i, s->track);
    }
    return 0;
}

/* Add the parts' sums to a matrix and a vector. */
static void add_parts(const struct work *w, struct poses_skyline *sum, double *vector)
{
    for (int p = 0; p < w->parts; p++) {
        poses_skyline_add(sum, &w->part[p].sum);
        for (int i = 0; i < w->states; i++)
            vector[i] += w->part[p].vector[i];
    }
}

static void linearise(struct work *w, const struct poses_model *m)
{
    struct parts_job job = { .work = w, .model = m };

    for_parts(&job, linearise_part);
    poses_skyline_clear(&w->base);
    memset(w->gradient, 0, (size_t)w->states * sizeof(*w->gradient));
    add_parts(w, &w->base, w->gradient);
    add_priors(w, m, 6 * m->views);
    for (int i = 0; i < w->states; i++)
        w->diagonal[i] = w->base.row[i][i];
}

/* --- steps -------------------------------------------------------------------------------------------------------- */

/* Inverse of a damped symmetric 3x3 block, lower half by rows. */
static void invert_block(const double in[6], double damping, double out[6])
{
    const double tiny = 1e-12 * (in[0] + in[2] + in[5]);
    const double a = in[0] * (1 + damping) + tiny, b = in[1], c = in[2] * (1 + damping) + tiny, d = in[3], e = in[4];
    const double f = in[5] * (1 + damping) + tiny;
    const double ca = c * f - e * e, cb = d * e - b * f, cd = b * e - c * d, det = a * ca + b * cb + d * cd;

    if (!(det > 0)) { /* behind all its views: stays where it is */
        memset(out, 0, 6 * sizeof(*out));
        return;
    }
    out[0] = ca / det;
    out[1] = cb / det;
    out[2] = (a * f - d * d) / det;
    out[3] = cd / det;
    out[4] = (b * d - a * e) / det;
    out[5] = (a * c - b * b) / det;
}

/* out = v times the symmetric block. */
static void times_block(const double v[3], const double s[6], double out[3])
{
    out[0] = v[0] * s[0] + v[1] * s[1] + v[2] * s[3];
    out[1] = v[0] * s[1] + v[1] * s[2] + v[2] * s[4];
    out[2] = v[0] * s[3] + v[1] * s[4] + v[2] * s[5];
}

static double dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Subtract the elimination of a point from the blocks of its views and the lens. */
static void eliminate(struct part *part, const struct work *w, int track, int lens)
{
    const int from = w->tracks->first[track], to = w->tracks->first[track + 1];
    const double *inverse = w->inverse[track], *right = w->right[track];
    double by[6][3];

    for (int s = from; s < to; s++) {
        const int view = 6 * w->tracks->sight[s].view;

        for (int i = 0; i < 6; i++) {
            times_block(w->cross[s] + (ptrdiff_t)3 * i, inverse, by[i]);
            part->vector[view + i] -= dot3(by[i], right);
        }
        for (int o = from; o <= s; o++) { /* sights of a track ascend by view */
            const int other = 6 * w->tracks->sight[o].view;

            for (int i = 0; i < 6; i++) {
                double *row = part->sum.row[view + i] + other;

                for (int j = 0; j < (o == s ? i + 1 : 6); j++)
                    row[j] -= dot3(by[i], w->cross[o] + (ptrdiff_t)3 * j);
            }
        }
        for (int l = 0; l < w->lens_states; l++) {
            for (int i = 0; i < 6; i++)
                part->sum.row[lens + l][view + i] -= dot3(by[i], w->lens_cross[track] + (ptrdiff_t)3 * l);
        }
    }
    for (int l = 0; l < w->lens_states; l++) {
        times_block(w->lens_cross[track] + (ptrdiff_t)3 * l, inverse, by[0]);
        part->vector[lens + l] -= dot3(by[0], right);
        for (int j = 0; j <= l; j++)
            part->sum.row[lens + l][lens + j] -= dot3(by[0], w->lens_cross[track] + (ptrdiff_t)3 * j);
    }
}

static int eliminate_part(void *arg, int index, int worker SST_UNUSED)
{
    const struct parts_job *job = arg;
    struct work *w = job->work;
    struct part *part = w->part + index;

    poses_skyline_clear(&part->sum);
    memset(part->vector, 0, (size_t)w->states * sizeof(*part->vector));
    for (int t = part->from; t < part->to; t++) {
        invert_block(w->block[t], job->damping, w->inverse[t]);
        eliminate(part, w, t, w->states - LENS_STATES);
    }
    return 0;
}

/* The step of views and lens for this damping. @return false: the system is singular */
static bool solve_system(struct work *w, double damping)
{
    struct parts_job job = { .work = w, .damping = damping };

    for_parts(&job, eliminate_part);
    for (int i = 0; i < w->states; i++) {
        const int first = w->base.first[i];

        memcpy(w->system.row[i] + first, w->base.row[i] + first, (size_t)(i + 1 - first) * sizeof(double));
        w->system.row[i][i] += damping * w->diagonal[i];
        if (!(w->diagonal[i] > 0))
            w->system.row[i][i] = 1; /* not a state in this adjustment */
        w->step[i] = w->gradient[i];
    }
    add_parts(w, &w->system, w->step);
    if (!poses_skyline_factor(&w->system))
        return false;
    poses_skyline_substitute(&w->system, w->step);
    return true;
}

/* Points of a part, moved by back-substitution. */
static int move_part(void *arg, int index, int worker SST_UNUSED)
{
    const struct parts_job *job = arg;
    const struct work *w = job->work;
    const struct part *part = w->part + index;
    const int lens = 6 * job->model->views;

    for (int t = part->from; t < part->to; t++) {
        double b[3], d[3];

        memcpy(b, w->right[t], sizeof(b));
        for (int s = w->tracks->first[t]; s < w->tracks->first[t + 1]; s++) {
            const double *step = w->step + (ptrdiff_t)6 * w->tracks->sight[s].view;

            for (int i = 0; i < 6; i++) {
                for (int j = 0; j < 3; j++)
                    b[j] -= w->cross[s][3 * i + j] * step[i];
            }
        }
        for (int l = 0; l < w->lens_states; l++) {
            for (int j = 0; j < 3; j++)
                b[j] -= w->lens_cross[t][3 * l + j] * w->step[lens + l];
        }
        times_block(b, w->inverse[t], d);
        for (int j = 0; j < 3; j++)
            job->to->point[t][j] = job->model->point[t][j] - d[j];
    }
    return 0;
}

/* Moves a copy of the model by the step. */
static void move(struct poses_model *to, const struct poses_model *from, struct work *w)
{
    struct parts_job job = { .work = w, .model = from, .to = to };
    const int lens = 6 * from->views;
    double turn[9], v[3];

    for (int k = 0; k < from->views; k++) {
        for (int i = 0; i < 3; i++) {
            v[i] = -w->step[6 * k + i];
            to->centre[k][i] = from->centre[k][i] - w->step[6 * k + 3 + i];
        }
        sst_rotation_from_vector(v, turn);
        sst_numbers_mul3(turn, from->rotation[k], to->rotation[k]);
    }
    to->focal = from->focal * exp(-w->step[lens]);
    to->k1 = from->k1 - w->step[lens + 1];
    for_parts(&job, move_part);
}

static void work_fini(struct work *w)
{
    free(w->slope);
    free(w->cross);
    free(w->lens_cross);
    free(w->block);
    free(w->right);
    free(w->inverse);
    free(w->gradient);
    free(w->step);
    free(w->diagonal);
    free(w->coupling);
    for (int p = 0; p < w->parts; p++) {
        poses_skyline_fini(&w->part[p].sum);
        free(w->part[p].vector);
    }
    poses_skyline_fini(&w->base);
    poses_skyline_fini(&w->system);
}

/* Parts with about as many sights each. @param first  of the skylines */
static int parts_init(struct work *w, const int *first)
{
    const struct poses_tracks *tracks = w->tracks;
    const int most = (int)sst_clamp_double((double)PARTS_ROOM / (double)(poses_skyline_size(&w->base) + 1), 1, PARTS);
    int err = 0;

    for (int p = 0, t = 0; p < most && !err; p++) {
        struct part *part = w->part + w->parts++;

        part->from = t;
        while (t < tracks->tracks && (p == most - 1 || (int64_t)tracks->first[t] * most < (int64_t)tracks->sights * (p + 1)))
            t++;
        part->to = t;
        part->vector = malloc((size_t)w->states * sizeof(*part->vector));
        err = part->vector ? poses_skyline_init(&part->sum, first, w->states) : -ENOMEM;
    }
    return err;
}

/* First columns: views that share a track, or a prior, with this one. */
static int skylines(struct work *w, int views)
{
    int *first = malloc((size_t)w->states * sizeof(*first)), err;

    if (!first)
        return -ENOMEM;
    for (int i = 0; i < w->states; i++)
        first[i] = i < 6 * views ? i / 6 * 6 : 0;
    for (int t = 0; t < w->tracks->tracks; t++) {
        const int begin = 6 * w->tracks->sight[w->tracks->first[t]].view; /* the smallest */

        for (int s = w->tracks->first[t]; s < w->tracks->first[t + 1]; s++) {
            int *at = first + (ptrdiff_t)6 * w->tracks->sight[s].view;

            for (int i = 0; i < 6; i++)
                at[i] = sst_min_int(at[i], begin);
        }
    }
    for (int i = 0; w->how->line_along > 0 && i < 6 * views; i++)
        first[i] = 0;
    err = poses_skyline_init(&w->base, first, w->states);
    if (!err)
        err = poses_skyline_init(&w->system, first, w->states);
    if (!err)
        err = parts_init(w, first);
    free(first);
    return err;
}

static int work_init(struct work *w, const struct poses_model *m)
{
    const size_t sights = (size_t)w->tracks->sights + 1, tracks = (size_t)m->tracks + 1;

    w->states = 6 * m->views + LENS_STATES;
    w->lens_states = w->how->free_k1 ? 2 : w->how->free_focal;
    w->slope = malloc(sights * sizeof(*w->slope));
    w->cross = malloc(sights * sizeof(*w->cross));
    w->lens_cross = malloc(tracks * sizeof(*w->lens_cross));
    w->block = malloc(tracks * sizeof(*w->block));
    w->right = malloc(tracks * sizeof(*w->right));
    w->inverse = malloc(tracks * sizeof(*w->inverse));
    w->gradient = calloc((size_t)w->states, sizeof(double));
    w->step = calloc((size_t)w->states, sizeof(double));
    w->diagonal = calloc((size_t)w->states, sizeof(double));
    w->coupling = calloc((size_t)m->views * 3 + 1, sizeof(*w->coupling));
    if (!w->slope || !w->cross || !w->lens_cross || !w->block || !w->right || !w->inverse || !w->gradient || !w->step ||
        !w->diagonal || !w->coupling)
        return -ENOMEM;
    return skylines(w, m->views);
}

static void exchange(struct poses_model *a, struct poses_model *b)
{
    const struct poses_model c = *a;

    *a = *b;
    *b = c;
}

int poses_adjust(struct poses_model *model, const struct poses_tracks *tracks, const struct poses_adjust *how,
                 double *cost)
{
    struct work w = { .how = how, .tracks = tracks };
    struct poses_model next = { 0 };
    double damping = 1e-3;
    int err = work_init(&w, model);

    if (!err)
        err = poses_model_copy(&next, model);
    for (int round = 0; !err && round < how->rounds; round++) {
        double before, after = 0;
        bool better = false;

        if (how->line_along > 0)
            w.couplings = line_rows(model, how, w.coupling);
        before = cost_of(model, &w);
        linearise(&w, model);
        for (int k = 0; k < TRIES && !better; k++) {
            if (solve_system(&w, damping)) {
                move(&next, model, &w);
                after = cost_of(&next, &w);
                better = isfinite(after) && after < before;
            }
            if (!better)
                damping *= 5;
        }
        if (!better)
            break;
        exchange(model, &next);
        damping = fmax(damping / 5, 1e-9);
        if (before - after < ENOUGH * before && round > 5)
            break;
    }
    if (!err)
        *cost = data_cost(model, &w);
    poses_model_fini(&next);
    work_fini(&w);
    return err;
}
