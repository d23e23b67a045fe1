/* Robust solution, from seeds to least squares over the inliers: a robust loss first, the hard cut last. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/log.h"
#include "pipeline/calibration/solve/solve_internal.h"

#define SOFT_ROUNDS     6
#define HARD_ROUNDS     6
#define HARD_ITERATIONS 60
#define LEAST_SIGMA_PX  1e-3 /* exact corners have no noise to scale by */
#define LOSS_SIGMA      2.4  /* Cauchy's loss at this scale loses 5 % of the precision of least squares */

int solve_soft(struct solve_problem *p, double *sigma_px)
{
    double sigma, before = INFINITY;
    int err = solve_noise(p, &sigma);

    /* The scale shrinks with the residuals: wide while poses are seeds, narrow at the end. */
    for (int round = 0; !err && round < SOFT_ROUNDS && sigma < 0.7 * before; round++) {
        const double scale = fmax(sigma, LEAST_SIGMA_PX);
        const struct solve_adjust_config cfg = { .loss_px = LOSS_SIGMA * scale,
                                                 .max_iterations = 8,
                                                 .tolerance = 0.05 * scale };
        struct solve_adjusted done;

        before = sigma;
        err = solve_adjust(p, &cfg, &done);
        err = err ? err : solve_noise(p, &sigma);
        if (!err)
            sst_log_debug("solve: loss at %.3g px: noise %.4g px, %d evaluations", cfg.loss_px, sigma,
                          done.evaluations);
    }
    if (!err)
        *sigma_px = sigma;
    return err;
}

/* Reclassify outliers. A detection that is mostly outliers is dropped as a whole. @return number of corners that
 * changed */
static int cut(struct solve_problem *p, double limit_px, double (*r)[2])
{
    int changed = 0;

    for (int i = 0; i < p->count; i++) {
        struct solve_detection *d = &p->detection[i];
        int inside = 0;

        if (!p->camera[d->view].known || !p->frame[d->frame].known)
            continue;
        solve_residuals(p, d, r);
        for (int c = 0; c < d->corners; c++)
            inside += d->corner[c].weight * hypot(r[c][0], r[c][1]) <= limit_px;
        d->used = inside >= SOLVE_MIN_CORNERS && 2 * inside >= d->corners;
        for (int c = 0; c < d->corners; c++) {
            const bool out = !d->used || !(d->corner[c].weight * hypot(r[c][0], r[c][1]) <= limit_px);

            changed += out != d->corner[c].out;
            d->corner[c].out = out;
        }
    }
    return changed;
}

int solve_hard(struct solve_problem *p, bool plain, double *sigma_px, struct solve_adjusted *out)
{
    const struct solve_adjust_config rough = { .max_iterations = HARD_ITERATIONS, .tolerance = 0.02 };
    const struct solve_adjust_config cfg = { .max_iterations = HARD_ITERATIONS, .tolerance = SOLVE_TOLERANCE };
    double(*r)[2];
    int most = 1, err = 0, evaluations = 0;

    for (int i = 0; i < p->count; i++)
        most = sst_max_int(most, p->detection[i].corners);
    r = malloc((size_t)most * sizeof(*r));
    if (!r)
        return -ENOMEM;
    for (int round = 0; !plain && !err && round < HARD_ROUNDS; round++) {
        const int changed = cut(p, SOLVE_OUTLIER_SIGMA * fmax(*sigma_px, LEAST_SIGMA_PX), r);

        if (!changed && round)
            break;
        err = solve_adjust(p, &rough, out);
        err = err ? err : solve_noise(p, sigma_px);
        evaluations += err ? 0 : out->evaluations;
        sst_log_debug("solve: %d corners changed sides; noise %.4g px", changed, *sigma_px);
    }
    err = err ? err : solve_adjust(p, &cfg, out);
    err = err ? err : solve_noise(p, sigma_px);
    if (!err)
        out->evaluations += evaluations;
    free(r);
    return err;
}
