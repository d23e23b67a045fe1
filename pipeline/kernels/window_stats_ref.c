/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"
#include "pipeline/kernels/root_inverse.h"

static int32_t across(const int32_t *column)
{
    int32_t sum = 0;

    for (int i = 0; i < SST_WINDOW; i++)
        sum += column[i];
    return sum;
}

void sst_window_stats_ref(float *mean, float *inverse, const struct sst_window_sums *in, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const float m = (float)across(in->sum + x) * (1.0f / (SST_WINDOW_AREA * SST_LEVEL_ONE));
        const float square =
            (float)across(in->squares + x) * (1.0f / (SST_WINDOW_AREA * SST_LEVEL_ONE * SST_LEVEL_ONE));
        const float v = square - m * m;
        const uint8_t *a = in->seen[0], *b = in->seen[1];
        const int seen = !a || (a[x] & a[x + SST_WINDOW - 1] & b[x] & b[x + SST_WINDOW - 1]);

        mean[x] = m;
        inverse[x] = seen ? sst_root_inverse((v > 0 ? v : 0) + in->floor) : 0;
    }
}
