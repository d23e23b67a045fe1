/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_census_row_ref(uint64_t *out, const uint8_t *const rows[7], size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const uint8_t centre = rows[3][x];
        uint64_t bits = 0;

        for (int j = 0; j < 7; j++) {
            for (int i = -4; i <= 4; i++) {
                if (j != 3 || i != 0)
                    bits = bits << 1 | (rows[j][(ptrdiff_t)x + i] < centre);
            }
        }
        out[x] = bits;
    }
}

void sst_hamming_row_ref(uint8_t *cost, const uint64_t *a, const uint64_t *b, size_t n)
{
    for (size_t x = 0; x < n; x++)
        cost[x] = (uint8_t)(4 * __builtin_popcountll(a[x] ^ b[x]));
}

void sst_hamming_steps_row_ref(uint8_t *cost, const uint64_t *a, const uint64_t *b, size_t n, size_t nd)
{
    for (size_t x = 0; x < n; x++) {
        for (size_t d = 0; d < nd; d++)
            cost[x * nd + d] = (uint8_t)(4 * __builtin_popcountll(a[x] ^ b[(ptrdiff_t)x - (ptrdiff_t)d]));
    }
}
