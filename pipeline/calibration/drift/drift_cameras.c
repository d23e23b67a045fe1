/* Camera displacements from matches: robust least squares for shift, roll and scale of every picture.
 *
 * A picture shifted by s, rolled by r and larger by q shows the point x (from the picture's centre, in units of R = its
 * RMS over the picture) displaced by  e(x) = s + r J x + q x,  J x = (-x_y, x_x): all four in px, of one
 * size. A match of a and b measures along u and across n of the line between their centres, L spacings long:
 *     across = n (e_b - e_a),     along = -d L + u (e_b - e_a),  d the disparity.
 * The part across needs no disparity. A feature matched to the right and below gives d twice; the difference ties rows
 * and columns to each other, which the parts across alone leave independent.
 *
 * Gauge freedoms, which no match determines: a common s, and s = c * offset (another d for all). Their sums are set to
 * 0 in the equations, so that sigmas are relative to the array; then the gauge is fixed by least absolute deviations
 * (drift_gauge.c), so that a few cameras that are far off do not bias the others. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/stats.h"
#include "pipeline/calibration/drift/drift_internal.h"
#include "pipeline/camera/numbers.h"

#define STATES       4     /* s.x, s.y, r, q of a camera */
#define HUBER        1.5   /* in sigmas, first rounds */
#define TUKEY        4.685 /* in the others */
#define ROUNDS_HUBER 5
#define ROUNDS_OPEN  3
#define ROUNDS_TUKEY 8
#define LOOSE_PX     2.0  /* a priori sigma of every state */
#define PRESUMED_PX  0.05 /* per spacing: a priori agreement of neighbouring rows and columns at best */
#define UNSEEN_PX    0.7  /* a state with a larger sigma was not seen */
#define TIE_PX       1e-3 /* sigma of the gauge constraints */

struct observation {
    int link; /* pair whose `across` this observes; -1: none */
    int cams;
    int cam[3];
    double part[3][STATES];
    double value, sigma;
};

struct system {
    const struct drift_work *w;
    double radius;    /* R, px */
    double centre[2]; /* px */
    int n;            /* states */
    int count;        /* observations that are matches, the first ones */
    double inflation; /* of the variances that the normal equations give */
    int presumed;     /* observations that are not, after the matches */
    struct observation *o;
    bool *open;                 /* [n] unobservable states: out of all sums and not reported */
    double *normal, *right, *x; /* [n][n] lower half, then its factor; [n]; [n] */
    double *sort;               /* [count] */
    bool seen[SST_MAX_VIEWS];   /* cameras that take part */
};

/* A direction, and the factor of its derivatives. */
struct direction {
    const double *axis; /* [2] */
    double f;
};

/* Derivatives by the states of the displacement at a point, along a direction. */
static void add_part(struct observation *o, const struct system *s, int cam, const double at[2], struct direction d)
{
    const double *axis = d.axis, f = d.f;
    const double x = (at[0] - s->centre[0]) / s->radius, y = (at[1] - s->centre[1]) / s->radius;
    int i = 0;

    while (i < o->cams && o->cam[i] != cam)
        i++;
    o->cam[i] = cam;
    o->cams = sst_max_int(o->cams, i + 1);
    o->part[i][0] += f * axis[0];
    o->part[i][1] += f * axis[1];
    o->part[i][2] += f * (axis[1] * x - axis[0] * y);
    o->part[i][3] += f * (axis[0] * x + axis[1] * y);
}

static void add_match(struct observation *o, const struct system *s, const struct drift_link *l, int k, struct direction d)
{
    const struct drift_feature *p = &s->w->view[l->a].feature[l->feature[k]];
    const double at_a[2] = { p->x, p->y }, at_b[2] = { p->x + l->m[k].dx, p->y + l->m[k].dy };

    add_part(o, s, l->b, at_b, d);
    add_part(o, s, l->a, at_a, (struct direction){ d.axis, -d.f });
}

/* Disparity along p less that along q, which begin at the same view. */
static struct observation two_disparities(const struct system *s, const struct drift_link *p,
                                          const struct drift_link *q, int k, double difference)
{
    struct observation o = { .link = -1, .value = difference };

    o.sigma = sqrt(p->m[k].var_along / (p->length * p->length) + q->m[k].var_along / (q->length * q->length));
    add_match(&o, s, p, k, (struct direction){ p->s.u, -1 / p->length });
    add_match(&o, s, q, k, (struct direction){ q->s.u, 1 / q->length });
    return o;
}

/* A pair observes shifts across it; rolls and scales in any case. */
static void mark_observed(struct system *s, const struct drift_link *l)
{
    const int across = fabs(l->s.n[0]) > fabs(l->s.n[1]) ? 0 : 1;

    for (int i = 0; i < 2; i++) {
        const int cam = i ? l->b : l->a;

        s->seen[cam] = true;
        s->open[cam * STATES + across] = s->open[cam * STATES + 2] = s->open[cam * STATES + 3] = false;
    }
}

/* Pairs with few matches count too: their figures are not reported, but the cameras use them. */
static void observe(struct system *s)
{
    for (int i = 0; i < s->w->links; i++) {
        const struct drift_link *l = &s->w->link[i], *other = drift_other_link(s->w, i);

        if (!drift_link_useful(l))
            continue;
        for (int k = 0; k < DRIFT_CELLS; k++) {
            struct observation o = { .link = i, .value = l->m[k].across, .sigma = sqrt(l->m[k].var_across) };
            double difference;

            if (!l->used[k])
                continue;
            add_match(&o, s, l, k, (struct direction){ l->s.n, 1 });
            s->o[s->count++] = o;
            mark_observed(s, l);
            if (other && drift_disparity_difference(&difference, l, other, k))
                s->o[s->count++] = two_disparities(s, l, other, k, difference);
        }
    }
}

/* How far neighbours are apart where it is measured, across the line between them: robust sigma. 0 if few cameras are
 * off. */
static double apart_px(struct system *s)
{
    int n = 0;

    for (int i = 0; i < s->w->links; i++) {
        if (drift_link_useful(&s->w->link[i]))
            s->sort[n++] = fabs(s->w->link[i].median_px);
    }
    return n ? 1.4826 * sst_stats_quantile(s->sort, n, 0.5) : 0;
}

/* A priori, rows and columns agree, as well as neighbours do across the line between them: where no feature was matched
 * both ways, nothing else ties them. Weighted robustly like matches, so that a camera that is off is not held back. */
static void presume(struct system *s)
{
    static const double origin[2] = { 0 };
    const double sigma = fmax(PRESUMED_PX, apart_px(s));

    for (int i = 0; i + 1 < s->w->links; i++) {
        const struct drift_link *p = &s->w->link[i], *q = p + 1;
        struct observation *o = &s->o[s->count + s->presumed];

        if (q->a != p->a || !s->seen[p->a] || !s->seen[p->b] || !s->seen[q->b] || p->length <= 0 || q->length <= 0)
            continue;
        *o = (struct observation){ .sigma = sigma };
        add_part(o, s, p->b, origin, (struct direction){ p->s.u, -1 / p->length });
        add_part(o, s, p->a, origin, (struct direction){ p->s.u, 1 / p->length });
        add_part(o, s, q->b, origin, (struct direction){ q->s.u, 1 / q->length });
        add_part(o, s, q->a, origin, (struct direction){ q->s.u, -1 / q->length });
        /* Of the shifts alone. */
        for (int k = 0; k < o->cams; k++)
            o->part[k][2] = o->part[k][3] = 0;
        s->presumed++;
    }
}

static double residual(const struct system *s, const struct observation *o)
{
    double r = o->value;

    for (int i = 0; i < o->cams; i++) {
        for (int j = 0; j < STATES; j++)
            r -= o->part[i][j] * s->x[o->cam[i] * STATES + j];
    }
    return r;
}

/* --- normal equations --------------------------------------------------------------------------------------------- */

/* Of the lower half, a block for two cameras at a time. */
static void add_observation(struct system *s, const struct observation *o, double weight)
{
    for (int i = 0; i < o->cams; i++) {
        for (int j = 0; j < o->cams; j++) {
            double *block = s->normal + (size_t)o->cam[i] * STATES * (size_t)s->n + (size_t)o->cam[j] * STATES;

            if (o->cam[j] > o->cam[i])
                continue;
            for (int row = 0; row < STATES; row++, block += s->n) {
                const double f = weight * o->part[i][row];

                for (int col = 0; col < STATES; col++) /* with the part above the diagonal, which nothing reads */
                    block[col] += f * o->part[j][col];
            }
        }
        for (int row = 0; row < STATES; row++)
            s->right[o->cam[i] * STATES + row] += weight * o->part[i][row] * o->value;
    }
}

/* (sum of part[i] x[i])^2 / TIE_PX^2 */
static void tie(struct system *s, const double *part)
{
    for (int i = 0; i < s->n; i++) {
        for (int j = 0; j <= i; j++)
            s->normal[(size_t)i * (size_t)s->n + (size_t)j] += part[i] * part[j] / (TIE_PX * TIE_PX);
    }
}

static void tie_all(struct system *s, double *part)
{
    double mean[2] = { 0 }, spread = 0;
    int n[2] = { 0 };

    for (int j = 0; j < STATES; j++) {
        for (int i = 0; i < s->n; i++)
            part[i] = !s->open[i] && i % STATES == j;
        tie(s, part);
    }
    for (int i = 0; i < s->n; i++) {
        const int axis = i % STATES;

        if (axis >= 2 || s->open[i])
            continue;
        n[axis]++;
        mean[axis] += (s->w->offset[i / STATES][axis] - mean[axis]) / n[axis];
    }
    for (int i = 0; i < s->n; i++) {
        const int axis = i % STATES;

        part[i] = axis >= 2 || s->open[i] ? 0 : s->w->offset[i / STATES][axis] - mean[axis];
        spread += part[i] * part[i];
    }
    if (spread >= DRIFT_SPREAD * (n[0] + n[1]))
        tie(s, part);
}

/* Robust scale of the residuals in their own sigmas. */
static double scale_of(struct system *s)
{
    for (int i = 0; i < s->count; i++)
        s->sort[i] = fabs(residual(s, &s->o[i])) / s->o[i].sigma;
    return fmax(1.4826 * sst_stats_quantile(s->sort, s->count, 0.5), 0.1);
}

static double robust_weight(double t, bool tukey)
{
    if (!tukey)
        return t <= HUBER ? 1 : HUBER / t;
    t /= TUKEY;
    return t >= 1 ? 0 : (1 - t * t) * (1 - t * t);
}

/* One round of reweighted least squares; the factor that stays gives the sigmas. */
static void iterate(struct system *s, double *part, bool tukey)
{
    const double scale = scale_of(s);

    memset(s->normal, 0, (size_t)s->n * (size_t)s->n * sizeof(*s->normal));
    memset(s->right, 0, (size_t)s->n * sizeof(*s->right));
    for (int i = 0; i < s->n; i++)
        s->normal[(size_t)i * (size_t)s->n + (size_t)i] = 1 / (LOOSE_PX * LOOSE_PX);
    for (int i = 0; i < s->count + s->presumed; i++) {
        const struct observation *o = &s->o[i];
        const double sigma = i < s->count ? scale * o->sigma : o->sigma, t = fabs(residual(s, o)) / sigma;

        add_observation(s, o, robust_weight(t, tukey) / (sigma * sigma));
    }
    tie_all(s, part);
    (void)sst_numbers_factor(s->normal, s->n); /* positive definite by the a priori sigmas */
    sst_numbers_substitute(s->normal, s->n, s->right);
    memcpy(s->x, s->right, (size_t)s->n * sizeof(*s->x));
}

/* --- figures of each camera -------------------------------------------------------------------------------------- */

/* States and covariance of one camera; unobserved ones are NAN. */
static void read_camera(struct sst_drift_camera *cam, const struct system *s, int c, double *column,
                        double cov[STATES][STATES])
{
    double state[STATES];

    for (int j = 0; j < STATES; j++) {
        memset(column, 0, (size_t)s->n * sizeof(*column));
        column[c * STATES + j] = 1;
        sst_numbers_substitute(s->normal, s->n, column);
        for (int i = 0; i < STATES; i++)
            cov[j][i] = s->inflation * column[c * STATES + i];
        state[j] = s->open[c * STATES + j] ? NAN : s->x[c * STATES + j];
    }
    cam->known = !isnan(state[0]) || !isnan(state[1]);
    cam->shift_x_px = state[0];
    cam->shift_y_px = state[1];
    cam->roll_deg = state[2] / s->radius * (180 / M_PI);
    cam->scale = state[3] / s->radius;
    cam->roll_sigma_deg = sqrt(fmax(cov[2][2], 0)) / s->radius * (180 / M_PI);
    cam->scale_sigma = sqrt(fmax(cov[3][3], 0)) / s->radius;
    for (int j = 0; j < 2; j++) {
        if (!isnan(state[j]))
            cam->sigma_px = fmax(cam->sigma_px, sqrt(fmax(cov[j][j], 0)));
    }
}

/* All states as one displacement, and its sigma. */
static void sum_up(struct sst_drift_camera *cam, const struct system *s, double cov[STATES][STATES])
{
    const double state[STATES] = { cam->shift_x_px, cam->shift_y_px, cam->roll_deg * (M_PI / 180) * s->radius,
                                   cam->scale * s->radius };
    double squares = 0, variance = 0;

    for (int i = 0; i < STATES; i++) {
        for (int j = 0; j < STATES; j++) {
            if (!isnan(state[i]) && !isnan(state[j]))
                variance += state[i] * cov[i][j] * state[j];
        }
        squares += isnan(state[i]) ? 0 : state[i] * state[i];
    }
    cam->off_px = sqrt(squares);
    cam->off_sigma_px = squares > 0 ? sqrt(fmax(variance, 0) / squares) : cam->sigma_px;
}

static int report(struct sst_drift_camera *cam, const struct system *s, double *column)
{
    const int views = s->w->views;
    double(*cov)[STATES][STATES] = calloc((size_t)views, sizeof(*cov));

    if (!cov)
        return -ENOMEM;
    for (int c = 0; c < views; c++)
        read_camera(&cam[c], s, c, column, cov[c]);
    drift_fix_gauge(cam, s->w);
    for (int c = 0; c < views; c++) {
        if (cam[c].known)
            sum_up(&cam[c], s, cov[c]);
    }
    free(cov);
    return 0;
}

/* Robust weights make the normal equations too confident where many matches are poor: the ratio of the variance of an
 * M-estimate to theirs (Huber 1981, 7.6), with psi(t) = t w(t), for the states there are. */
static double inflation_of(struct system *s)
{
    const double scale = scale_of(s);
    double psi2 = 0, slope = 0, weights = 0, n = s->count, free = n;

    for (int i = 0; i < s->count; i++) {
        const double t = fabs(residual(s, &s->o[i])) / (scale * s->o[i].sigma), u = t * t / (TUKEY * TUKEY);
        const double w = robust_weight(t, true);

        psi2 += t * t * w * w;
        slope += u < 1 ? (1 - u) * (1 - 5 * u) : 0;
        weights += w;
    }
    for (int i = 0; i < s->n; i++)
        free -= !s->open[i];
    slope = fmax(slope, 0.1 * n); /* far from any normal distribution: no better estimate */
    return fmax(weights / n * psi2 / fmax(free, 1) / (slope * slope / (n * n)), 1);
}

/* Set contradiction_px and rough_px: deviations of a pair's matches from the displacements' prediction, and from
 * the next match. Sorted by link and cell. */
static void measure_contradiction(struct sst_drift *out, struct system *s)
{
    double apart[2 * SST_MAX_VIEWS], rough[2 * SST_MAX_VIEWS], steps[DRIFT_CELLS];
    int pairs = 0;

    for (int i = 0; i < s->count;) {
        const int link = s->o[i].link;
        int n = 0;

        for (; i < s->count && (s->o[i].link == link || s->o[i].link < 0); i++) {
            if (s->o[i].link < 0)
                continue;
            s->sort[n] = residual(s, &s->o[i]);
            if (n)
                steps[n - 1] = fabs(s->sort[n] - s->sort[n - 1]) * M_SQRT1_2;
            n++;
        }
        for (int k = 0; k < n; k++)
            s->sort[k] = fabs(s->sort[k]);
        apart[pairs] = 1.4826 * sst_stats_median(s->sort, n);
        rough[pairs++] = n > 1 ? 1.4826 * sst_stats_median(steps, n - 1) : 0;
    }
    out->contradiction_px = sst_stats_quantile(apart, pairs, 0.9);
    out->rough_px = sst_stats_quantile(rough, pairs, 0.9);
}

/* Leave out the unobservable states, and solve for the others. */
static void leave_open(struct system *s, double *part)
{
    for (int i = 0; i < s->n; i++) {
        memset(part, 0, (size_t)s->n * sizeof(*part));
        part[i] = 1;
        sst_numbers_substitute(s->normal, s->n, part);
        s->right[i] = part[i];
    }
    for (int i = 0; i < s->n; i++)
        s->open[i] = s->open[i] || s->right[i] > UNSEEN_PX * UNSEEN_PX;
    for (int i = 0; i < ROUNDS_OPEN; i++)
        iterate(s, part, true);
}

int drift_solve_cameras(struct sst_drift *out, const struct drift_work *w)
{
    const size_t most = (size_t)w->links * (2 * DRIFT_CELLS + 1) + 1, n = (size_t)w->views * STATES;
    const double width = w->lf->width, height = w->lf->height;
    struct system s = { .w = w,
                        .radius = sqrt((width * width + height * height) / 12),
                        .centre = { 0.5 * (width - 1), 0.5 * (height - 1) },
                        .n = (int)n };
    double *part = calloc(n, sizeof(*part));
    int err = -ENOMEM;

    s.o = malloc(most * sizeof(*s.o));
    s.sort = malloc(most * sizeof(*s.sort));
    s.normal = calloc(n * n, sizeof(*s.normal));
    s.right = calloc(n, sizeof(*s.right));
    s.x = calloc(n, sizeof(*s.x));
    s.open = calloc(n, sizeof(*s.open));
    if (part && s.o && s.sort && s.normal && s.right && s.x && s.open) {
        err = 0;
        for (size_t i = 0; i < n; i++)
            s.open[i] = true;
        observe(&s);
        presume(&s);
        for (int i = 0; s.count && i < ROUNDS_HUBER + ROUNDS_TUKEY; i++)
            iterate(&s, part, i >= ROUNDS_HUBER);
        if (s.count) {
            leave_open(&s, part);
            s.inflation = inflation_of(&s);
            measure_contradiction(out, &s);
            err = report(out->camera, &s, part);
        }
    }
    free(part);
    free(s.o);
    free(s.sort);
    free(s.normal);
    free(s.right);
    free(s.x);
    free(s.open);
    return err;
}
