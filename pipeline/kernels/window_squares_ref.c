/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_window_squares_ref(int32_t *sum, int32_t *squares, const int16_t *const row[2], size_t n)
{
    for (size_t x = 0; x < n; x++) {
        sum[x] += row[0][x] - row[1][x];
        squares[x] += row[0][x] * row[0][x] - row[1][x] * row[1][x];
    }
}
