/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

static int moved(const struct sst_landing *l, int axis, int d)
{
    return l->whole[axis] + ((l->part[axis] + d * l->step[axis]) >> 16);
}

void sst_land_row_ref(uint32_t *nearest, uint32_t *farthest, const struct sst_landing *l, const uint16_t *disp,
                      const uint8_t *rank, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const int d = disp[i];
        const uint32_t value = (uint32_t)(d + 1) << SST_LANDED_DISP | (rank ? rank[i] : 0);
        size_t to;
        int x, y;

        if (d == 65535)
            continue;
        x = (int)i + moved(l, 0, d);
        y = l->y + moved(l, 1, d);
        if (x < 0 || y < 0 || x >= l->width || y >= l->height)
            continue;
        to = (size_t)y * (size_t)l->width + (size_t)x;
        if (nearest[to] < value)
            nearest[to] = value;
        if (!farthest || nearest[to] == SST_LANDED_CLOSED)
            continue;
        if ((farthest[to] & 0xFFFF) > (uint32_t)d)
            farthest[to] = (farthest[to] & 0xFFFF0000) | (uint32_t)d;
        farthest[to] |= l->source << 16;
    }
}
