/* The gauge: shifts that no match observes, fixed so that most cameras are undisplaced. Least absolute deviations, by
 * least squares with weights of one over the deviation (Schlossmacher 1973). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "base/stats.h"
#include "pipeline/calibration/drift/drift_internal.h"

#define GAUGE_ROUNDS 60
#define GAUGE_PX     1e-3 /* deviations below this count alike */

/* Whether the offsets of the observed shifts differ. */
static bool spread_out(const struct sst_drift_camera *cam, const struct drift_work *w)
{
    double mean[2] = { 0 }, squares = 0;
    int n[2] = { 0 };

    for (int pass = 0; pass < 2; pass++) {
        for (int c = 0; c < 2 * w->views; c++) {
            const int axis = c % 2;
            const double offset = w->offset[c / 2][axis];

            if (!cam[c / 2].known || isnan(axis ? cam[c / 2].shift_y_px : cam[c / 2].shift_x_px))
                continue;
            if (pass)
                squares += (offset - mean[axis]) * (offset - mean[axis]);
            else
                mean[axis] += (offset - mean[axis]) / ++n[axis];
        }
    }
    return squares >= DRIFT_SPREAD * (n[0] + n[1]);
}

/* Common shift and proportion of the offsets that minimise the sum of magnitudes of the observed shifts. */
static void fix_shifts(struct sst_drift_camera *cam, const struct drift_work *w)
{
    const bool proportion = spread_out(cam, w);
    double g[3] = { 0 };

    for (int round = 0; round < GAUGE_ROUNDS; round++) {
        double a[3][3] = { { 1e-9, 0, 0 }, { 0, 1e-9, 0 }, { 0, 0, 1e-9 } }, v[3] = { 0 };

        for (int c = 0; c < 2 * w->views; c++) {
            const struct sst_drift_camera *k = &cam[c / 2];
            const double shift = c % 2 ? k->shift_y_px : k->shift_x_px;
            const double row[3] = { c % 2 == 0, c % 2 == 1, proportion ? w->offset[c / 2][c % 2] : 0 };
            double weight;

            if (!k->known || isnan(shift))
                continue;
            weight = 1 / fmax(fabs(shift - row[0] * g[0] - row[1] * g[1] - row[2] * g[2]), GAUGE_PX);
            for (int i = 0; i < 3; i++) {
                v[i] += weight * row[i] * shift;
                for (int j = 0; j < 3; j++)
                    a[i][j] += weight * row[i] * row[j];
            }
        }
        sst_stats_solve3(a, v);
        memcpy(g, v, sizeof(g));
    }
    for (int c = 0; c < w->views; c++) {
        cam[c].shift_x_px -= g[0] + g[2] * w->offset[c][0];
        cam[c].shift_y_px -= g[1] + g[2] * w->offset[c][1];
    }
}

static void subtract_median(struct sst_drift_camera *cam, int views, size_t field)
{
    double v[SST_MAX_VIEWS], median;
    int n = 0;

    for (int c = 0; c < views; c++) {
        const double *p = (const double *)(const void *)((const char *)&cam[c] + field);

        if (cam[c].known && !isnan(*p))
            v[n++] = *p;
    }
    if (!n)
        return;
    median = sst_stats_quantile(v, n, 0.5);
    if (n % 2 == 0)
        median = 0.5 * (median + sst_stats_quantile(v, n, 0.5 - 0.5 / n));
    for (int c = 0; c < views; c++) {
        double *p = (double *)(void *)((char *)&cam[c] + field);

        *p -= median;
    }
}

void drift_fix_gauge(struct sst_drift_camera *camera, const struct drift_work *w)
{
    fix_shifts(camera, w);
    subtract_median(camera, w->views, offsetof(struct sst_drift_camera, roll_deg));
    subtract_median(camera, w->views, offsetof(struct sst_drift_camera, scale));
}
