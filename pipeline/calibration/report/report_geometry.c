/* Figures of the array: its centres against a regular lattice, and how well neighbours agree on the board's corners. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "pipeline/calibration/report/report_internal.h"

#define PAIR_REGIONS (REPORT_ROWS * REPORT_COLS)
#define PAIR_CORNERS 20    /* of a region or pair that counts: enough to average the corners' noise out */
#define STEPS_PER_PX 1000  /* quantiles are found to 0.001 px ... */
#define STEPS        20000 /* ... up to 20 px */

static const double straight[9] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 };

/* Common axes from the rig's. */
static const double *common_rotation(const struct sst_calibration_report *report)
{
    return report->rectified ? report->rectified->rotation : straight;
}

/* --- centres ------------------------------------------------------------------------------------------------------ */

struct lattice_fit {
    double n, mean_u, mean_v, mean[3]; /* u column, v row */
    double uu, uv, vv, up[2], vp[2];
    double step[2][2]; /* of a column and a row: right, down */
};

static void fit_steps(struct lattice_fit *fit)
{
    const double det = fit->uu * fit->vv - fit->uv * fit->uv;

    for (int i = 0; i < 2; i++) {
        if (det > 1e-9 * fit->uu * fit->vv) {
            fit->step[0][i] = (fit->vv * fit->up[i] - fit->uv * fit->vp[i]) / det;
            fit->step[1][i] = (fit->uu * fit->vp[i] - fit->uv * fit->up[i]) / det;
        } else if (fit->uu > 0) { /* all in one line of the grid: its direction alone is known */
            fit->step[0][i] = fit->up[i] / fit->uu;
        } else if (fit->vv > 0) {
            fit->step[1][i] = fit->vp[i] / fit->vv;
        }
    }
}

static void fit_lattice(struct report_figures *f, int cols, const struct sst_calib *calib)
{
    struct lattice_fit fit = { 0 };

    for (int k = 0; k < f->views; k++) {
        if (!calib->camera[k].known)
            continue;
        fit.n++;
        fit.mean_u += k % cols;
        fit.mean_v += k / cols;
        for (int i = 0; i < 3; i++)
            fit.mean[i] += f->centre_mm[k][i];
    }
    if (fit.n < 1)
        return;
    fit.mean_u /= fit.n;
    fit.mean_v /= fit.n;
    for (int i = 0; i < 3; i++)
        fit.mean[i] /= fit.n;
    for (int k = 0; k < f->views; k++) {
        const double u = k % cols - fit.mean_u, v = k / cols - fit.mean_v;

        if (!calib->camera[k].known)
            continue;
        fit.uu += u * u;
        fit.uv += u * v;
        fit.vv += v * v;
        for (int i = 0; i < 2; i++) {
            fit.up[i] += u * (f->centre_mm[k][i] - fit.mean[i]);
            fit.vp[i] += v * (f->centre_mm[k][i] - fit.mean[i]);
        }
    }
    fit_steps(&fit);
    for (int k = 0; k < f->views; k++) {
        f->centre_mm[k][2] -= fit.mean[2];
        for (int i = 0; i < 2; i++)
            f->lattice_mm[k][i] = f->centre_mm[k][i] - fit.mean[i] - fit.step[0][i] * (k % cols - fit.mean_u) -
                                  fit.step[1][i] * (k / cols - fit.mean_v);
    }
}

void report_figures_centres(struct report_figures *f, const struct sst_calibration_report *report)
{
    const struct sst_calib *calib = &report->solution->calib;
    const double *r = common_rotation(report), *from = calib->camera[calib->reference].position_mm;

    for (int k = 0; k < f->views; k++) {
        const double *at = calib->camera[k].position_mm;

        for (int i = 0; i < 3; i++)
            f->centre_mm[k][i] =
                calib->camera[k].known
                    ? r[3 * i] * (at[0] - from[0]) + r[3 * i + 1] * (at[1] - from[1]) + r[3 * i + 2] * (at[2] - from[2])
                    : (double)NAN;
        f->lattice_mm[k][0] = f->lattice_mm[k][1] = (double)NAN;
    }
    fit_lattice(f, report->detections->cols, calib);
}

void report_figures_angles(const struct report_figures *f, const struct sst_calibration_report *report,
                           double *mean_deg, double *most_deg, int *most)
{
    const struct sst_calib *calib = &report->solution->calib;
    double sum = 0;
    int n = 0;

    *most = -1;
    *most_deg = *mean_deg = (double)NAN;
    for (int k = 0; k < f->views; k++) {
        double m[9], v[3], deg;

        if (!calib->camera[k].known)
            continue;
        sst_rotation_between(common_rotation(report), calib->camera[k].rotation, m);
        sst_rotation_to_vector(m, v);
        deg = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) * 180 / M_PI;
        sum += deg;
        n++;
        if (*most < 0 || deg > *most_deg) {
            *most = k;
            *most_deg = deg;
        }
    }
    if (n)
        *mean_deg = sum / n;
}

/* --- pairs -------------------------------------------------------------------------------------------------------- */

/* Residuals of one camera turned into the common picture, to first order: px there from px here. */
struct turn {
    double m[4];
};

static struct turn turn_of(const struct sst_calibration_report *report, int view)
{
    const struct sst_calib *calib = &report->solution->calib;
    const struct sst_calib_camera *c = &calib->camera[view];
    const double *r = common_rotation(report);
    const double focal = report->rectified ? report->rectified->focal_px : calib->camera[calib->reference].fx;
    const double by[2] = { focal / c->fx, focal / c->fy };
    struct turn t = { { 0 } };

    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            for (int l = 0; l < 3; l++) /* common from rig, times rig from camera */
                t.m[2 * i + j] += r[3 * i + l] * c->rotation[3 * j + l];
            t.m[2 * i + j] *= by[j];
        }
    }
    return t;
}

struct pair_sums {
    double sum[PAIR_REGIONS];
    int corners[PAIR_REGIONS];
    struct turn turn[2];
    bool vertical; /* b below a: the line between them is upright */
};

/* Across the line between the pair's centres, px of the common picture; NAN: not used. */
static double across(const struct sst_solve_view *v, int corner, const struct turn *t, bool vertical)
{
    if (!v->residual || (v->outlier && v->outlier[corner]))
        return (double)NAN;
    return vertical ? t->m[0] * v->residual[corner][0] + t->m[1] * v->residual[corner][1]
                    : t->m[2] * v->residual[corner][0] + t->m[3] * v->residual[corner][1];
}

static int region_of(const struct sst_detections *all, const struct sst_corner *c)
{
    const double x = (c->x + 0.5) / all->width * REPORT_COLS, y = (c->y + 0.5) / all->height * REPORT_ROWS;

    return (int)sst_clamp_double(y, 0, REPORT_ROWS - 1) * REPORT_COLS + (int)sst_clamp_double(x, 0, REPORT_COLS - 1);
}

/* Corners that both detections have. */
static void add_shared(struct pair_sums *p, const struct sst_calibration_report *report, int ia, int ib)
{
    const struct sst_detections *all = report->detections;
    const struct sst_detection *a = &all->detection[ia], *b = &all->detection[ib];
    int j = 0;

    for (int i = 0; i < a->corners; i++) {
        double d;
        int region;

        while (j < b->corners && b->corner[j].id < a->corner[i].id)
            j++;
        if (j >= b->corners || b->corner[j].id != a->corner[i].id)
            continue;
        d = across(&report->solution->view[ib], j, &p->turn[1], p->vertical) -
            across(&report->solution->view[ia], i, &p->turn[0], p->vertical);
        if (!isfinite(d) || !isfinite(a->corner[i].x) || !isfinite(a->corner[i].y))
            continue;
        region = region_of(all, &a->corner[i]);
        p->sum[region] += d;
        p->corners[region]++;
    }
}

/* All pairs so far, and the distribution of their regions' means. */
struct pairs {
    double sum;
    int regions, *step; /* [STEPS + 1] */
};

static void add_pair(struct report_figures *f, const struct sst_calibration_report *report, int a, int b,
                     struct pairs *pairs)
{
    struct pair_sums p = { .turn = { turn_of(report, a), turn_of(report, b) },
                           .vertical = b != a + 1 || report->detections->cols == 1 };
    double sum = 0;
    int corners = 0;

    for (int frame = 0; frame < report->detections->frames; frame++) {
        const int *at = &f->detection[(size_t)frame * (size_t)f->views];

        if (at[a] >= 0 && at[b] >= 0)
            add_shared(&p, report, at[a], at[b]);
    }
    for (int i = 0; i < PAIR_REGIONS; i++) {
        sum += p.sum[i];
        corners += p.corners[i];
        if (p.corners[i] >= PAIR_CORNERS) {
            pairs->step[(int)fmin(fabs(p.sum[i] / p.corners[i]) * STEPS_PER_PX + 0.5, STEPS)]++;
            pairs->regions++;
        }
    }
    if (corners < PAIR_CORNERS)
        return;
    sum = fabs(sum / corners);
    pairs->sum += sum;
    f->pairs++;
    if (f->pairs == 1 || sum > f->pair_max_px) {
        f->pair_max_px = sum;
        f->pair_worst[0] = a;
        f->pair_worst[1] = b;
    }
}

int report_figures_pairs(struct report_figures *f, const struct sst_calibration_report *report)
{
    const struct sst_calib *calib = &report->solution->calib;
    const int rows = report->detections->rows, cols = report->detections->cols;
    struct pairs pairs = { .step = calloc(STEPS + 1, sizeof(*pairs.step)) };
    int below = 0, at = 0;

    f->pair_mean_px = f->pair_p95_px = f->pair_max_px = (double)NAN;
    if (!pairs.step)
        return -ENOMEM;
    for (int k = 0; k < f->views; k++) {
        if (!calib->camera[k].known)
            continue;
        if (k % cols + 1 < cols && calib->camera[k + 1].known)
            add_pair(f, report, k, k + 1, &pairs);
        if (k / cols + 1 < rows && calib->camera[k + cols].known)
            add_pair(f, report, k, k + cols, &pairs);
    }
    if (f->pairs)
        f->pair_mean_px = pairs.sum / f->pairs;
    while (pairs.regions && at < STEPS && (below += pairs.step[at]) < 0.95 * pairs.regions)
        at++;
    if (pairs.regions)
        f->pair_p95_px = (double)at / STEPS_PER_PX;
    free(pairs.step);
    return 0;
}
