/* Consistency beyond neighbours: disparities along rows against columns, and views at opposite corners. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/stats.h"
#include "pipeline/calibration/drift/drift_internal.h"

/* --- disparities along rows and columns --------------------------------------------------------------------------- */

bool drift_disparity_difference(double *out, const struct drift_link *p, const struct drift_link *q, int k)
{
    if (!p->used[k] || !q->used[k] || p->feature[k] != q->feature[k])
        return false;
    *out = -p->m[k].along / p->length + q->m[k].along / q->length;
    return true;
}

const struct drift_link *drift_other_link(const struct drift_work *w, int index)
{
    const struct drift_link *next = &w->link[index + 1];

    return index + 1 < w->links && next->a == w->link[index].a && drift_link_useful(next) ? next : NULL;
}

int drift_measure_axes(const struct drift_work *w, double *axes_px)
{
    double *v = malloc(((size_t)w->links * DRIFT_CELLS + 1) * sizeof(*v));
    int n = 0;

    if (!v)
        return -ENOMEM;
    for (int i = 0; i < w->links; i++) {
        const struct drift_link *l = &w->link[i], *other = drift_other_link(w, i);

        for (int k = 0; drift_link_useful(l) && other && k < DRIFT_CELLS; k++) {
            double difference;

            if (drift_disparity_difference(&difference, l, other, k))
                v[n++] = fabs(difference);
        }
    }
    *axes_px = n ? sst_stats_quantile(v, n, 0.5) : NAN;
    free(v);
    return 0;
}

/* --- corner to corner --------------------------------------------------------------------------------------------- */

#define DISPARITY_VAR 0.01 /* px^2 per spacing^2: with more, disparities do not predict from corner to corner */

/* A feature of a cell, and its disparity, from the better of the view's matches with neighbours. */
static bool cell_disparity(const struct drift_work *w, int view, int k, int *feature, double *d)
{
    double best = DISPARITY_VAR;

    for (int i = 0; i < w->links; i++) {
        const struct drift_link *l = &w->link[i];
        const double var = l->a == view && l->used[k] ? l->m[k].var_along / (l->length * l->length) : best;

        if (var >= best)
            continue;
        best = var;
        *d = -l->m[k].along / l->length;
        *feature = l->feature[k];
    }
    return best < DISPARITY_VAR;
}

/* Appends the magnitudes of the matches of one pair that are used. */
static int far_pair(struct drift_link *far, const struct drift_work *w, int a, int b, double *v)
{
    const struct drift_views views = { &w->view[a], &w->view[b], &far->s };
    int n = 0;

    drift_link_set(far, w, a, b);
    for (int k = 0; k < DRIFT_CELLS; k++) {
        struct drift_match *m = &far->m[k];
        double d = 0;
        int feature = 0;

        m->outcome = DRIFT_OUTSIDE;
        if (far->length <= 0 || !cell_disparity(w, a, k, &feature, &d))
            continue;
        m->dx = -d * far->length * far->s.u[0];
        m->dy = -d * far->length * far->s.u[1];
        drift_refine_match(m, &views, &w->view[a].feature[feature], 1);
    }
    drift_link_judge(far, 1);
    for (int k = 0; k < DRIFT_CELLS; k++) {
        if (far->used[k])
            v[n++] = fabs(far->m[k].across);
    }
    return n;
}

int drift_measure_corner_pairs(struct sst_drift *out, struct drift_work *w)
{
    const int rows = w->lf->rows, cols = w->lf->cols, last = rows * cols - 1;
    const int ends[2][2] = { { 0, last }, { cols - 1, last - cols + 1 } };
    struct drift_link *far = malloc(sizeof(*far));
    double v[2 * DRIFT_CELLS];
    int n = 0;

    if (!far)
        return -ENOMEM;
    for (int i = 0; i < (rows > 1 && cols > 1 ? 2 : 1); i++) {
        /* The upper view's features have the matches with neighbours. */
        if (w->view[ends[i][0]].image && w->view[ends[i][1]].image)
            n += far_pair(far, w, ends[i][0], ends[i][1], v + n);
    }
    free(far);
    out->far_matches = n;
    out->far_p95_px = n >= SST_DRIFT_LEAST_MATCHES ? sst_stats_quantile(v, n, 0.95) : NAN;
    return 0;
}
