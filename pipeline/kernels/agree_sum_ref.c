/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_agree_sum_ref(float *const acc[4], const uint16_t *const near[3], const uint8_t *const colour[3],
                       const uint8_t *vote, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        unsigned sum = 0;
        float w;

        for (int row = 0; row < 3; row++)
            sum += (unsigned)near[row][x] + near[row][x + 1] + near[row][x + 2];
        w = vote[x] ? (float)sum : 0;
        for (int c = 0; c < 3; c++)
            acc[c][x] += w * (float)colour[c][x];
        acc[3][x] += w;
    }
}
