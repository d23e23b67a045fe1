/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_cheapest_row_ref(uint8_t *first, uint8_t *second, const uint8_t *a, const uint8_t *b, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const int mean = (a[x] + b[x] + 1) >> 1, cost = mean < SST_COST_MAX ? mean : SST_COST_MAX - 1;

        if (cost < first[x]) {
            second[x] = first[x];
            first[x] = (uint8_t)cost;
        } else if (cost < second[x]) {
            second[x] = (uint8_t)cost;
        }
    }
}

void sst_cheapest_hamming_row_ref(uint8_t *first, uint8_t *second, const uint64_t *a, const uint64_t *const *b,
                                  int count, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        first[x] = second[x] = SST_COST_ABSENT;
        for (int i = 0; i < count; i++) {
            const uint8_t cost = (uint8_t)(4 * __builtin_popcountll(a[x] ^ b[i][x]));

            if (cost < first[x]) {
                second[x] = first[x];
                first[x] = cost;
            } else if (cost < second[x]) {
                second[x] = cost;
            }
        }
    }
}

void sst_cheapest_mean_row_ref(uint8_t *first, const uint8_t *second, int two, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const unsigned a = first[x], b = second[x];

        if (a == SST_COST_ABSENT)
            first[x] = SST_COST_UNSEEN;
        else if (b != SST_COST_ABSENT)
            first[x] = (uint8_t)(two ? (3 * a + b + 2) >> 2 : (a + b + 1) >> 1);
    }
}
