/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_support_sum_row_ref(uint16_t *vp, const uint16_t *vp_above, uint16_t *prefix SST_UNUSED, const uint8_t *cost,
                             const uint8_t *left, const uint8_t *right, size_t n, size_t nd)
{
    for (size_t x = 0; x < n; x++) {
        for (size_t d = 0; d < nd; d++) {
            unsigned sum = vp_above[x * nd + d];

            for (size_t i = x - left[x]; i <= x + right[x]; i++)
                sum += cost[i * nd + d];
            vp[x * nd + d] = (uint16_t)sum;
        }
    }
}

void sst_support_mean_row_ref(uint8_t *out, const uint16_t *const *rows, const uint8_t *up, const uint8_t *down,
                              const uint16_t *count, size_t n, size_t nd)
{
    for (size_t x = 0; x < n; x++) {
        const uint16_t *lo = rows[down[x]] + x * nd, *hi = rows[-1 - up[x]] + x * nd;
        const unsigned c = count[x];

        if (c < 2)
            continue;
        for (size_t d = 0; d < nd; d++) {
            const unsigned sum = (uint16_t)(lo[d] - hi[d] + c / 2);

            out[x * nd + d] = (uint8_t)(sum * ((65536 + c - 1) / c) >> 16);
        }
    }
}
