/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_split_row_ref(uint8_t *const plane[3], const uint8_t *pixels, size_t n)
{
    uint8_t *restrict r = plane[0], *restrict g = plane[1], *restrict b = plane[2];

    for (size_t x = 0; x < n; x++) {
        r[x] = pixels[4 * x];
        g[x] = pixels[4 * x + 1];
        b[x] = pixels[4 * x + 2];
    }
}
