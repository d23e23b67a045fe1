/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_winner_row_ref(uint16_t *best, uint16_t *second, const uint16_t *sum, size_t stride, size_t n, size_t nd)
{
    for (size_t x = 0; x < n; x++) {
        const uint16_t *s = sum + x * stride;
        size_t b = 0;
        uint16_t other = 65535;

        for (size_t d = 1; d < nd; d++) {
            if (s[d] < s[b])
                b = d;
        }
        for (size_t d = 0; second && d < nd; d++) {
            if ((d + 1 < b || d > b + 1) && s[d] < other)
                other = s[d];
        }
        best[x] = (uint16_t)b;
        if (second)
            second[x] = other;
    }
}

void sst_winner_other_row_ref(uint32_t *key, const uint16_t *sum, size_t stride, size_t n, size_t nd)
{
    for (size_t x = 0; x < n; x++) {
        for (size_t d = 0; d < nd; d++) {
            const uint32_t k = (uint32_t)sum[x * stride + d] << 16 | (uint32_t)d;

            if (k < key[n - 1 - x + d])
                key[n - 1 - x + d] = k;
        }
    }
}
