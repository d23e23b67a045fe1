/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_cell_land_ref(uint32_t *landed, const struct sst_cell_way *w, const uint32_t *cells, int x, int y, int n)
{
    for (int i = 0; i < n; i++) {
        const int64_t q = (int64_t)(cells[i] >> 8 & 0xFFFF) + w->zero_q6;
        const int64_t to_x = x + i - ((q * w->bx_q16 + (1 << 22)) >> 23);
        const int64_t to_y = y - ((q * w->by_q16 + (1 << 22)) >> 23);
        uint32_t *to = landed + to_y * w->width + to_x;

        if (!cells[i] || to_x < 0 || to_x >= w->width || to_y < 0 || to_y >= w->height)
            continue;
        if (*to < (cells[i] | w->rank))
            *to = cells[i] | w->rank;
    }
}
