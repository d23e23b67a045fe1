/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_window_products_ref(int32_t *sum, const int16_t *const a[2], const int16_t *const b[2], size_t n)
{
    for (size_t x = 0; x < n; x++)
        sum[x] += a[0][x] * b[0][x] - a[1][x] * b[1][x];
}
