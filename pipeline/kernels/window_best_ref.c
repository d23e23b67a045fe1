/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "pipeline/kernels/kernels.h"

static float across(const int32_t *column)
{
    int32_t sum = 0;

    for (int i = 0; i < SST_WINDOW; i++)
        sum += column[i];
    return (float)sum * (1.0f / (SST_WINDOW_AREA * SST_LEVEL_ONE * SST_LEVEL_ONE));
}

void sst_window_best_ref(float *largest, const struct sst_window_row *row, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        float first = 0, second = 0, both;

        for (size_t k = 0; k < row->others; k++) {
            const float mean = row->mean[x], other = row->other_mean[k][x];
            const float alike = 1.0f - fabsf(mean - other);
            const float covariance = across(row->products[k] + x) - mean * other + row->floor * (alike > 0 ? alike : 0);
            const float v = covariance * row->inverse[x] * row->other_inverse[k][x];

            second = v > first ? first : v > second ? v : second;
            first = v > first ? v : first;
        }
        both = (first + second) * 0.5f;
        largest[x] = largest[x] > both ? largest[x] : both;
    }
}
