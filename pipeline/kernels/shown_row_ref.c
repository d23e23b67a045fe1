/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>

#include "pipeline/kernels/kernels.h"

static int disp_of(uint64_t ray)
{
    return (int)(ray >> SST_RAY_DISP & 0xFFFF);
}

static int moved(const struct sst_shown *s, int axis, int d)
{
    return s->whole[axis] + ((s->part[axis] + d * s->step[axis]) >> 16);
}

static bool alike(const struct sst_shown *s, uint64_t a, uint64_t b)
{
    bool yes = abs(disp_of(a) - disp_of(b)) <= s->same;

    for (int bits = 0; bits < SST_RAY_LABEL; bits += 8)
        yes &= abs((int)(a >> bits & 0xFF) - (int)(b >> bits & 0xFF)) <= s->similar;
    return yes;
}

void sst_shown_row_ref(int32_t *at, uint8_t *label, const struct sst_shown *s, const uint64_t *own, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const int d = disp_of(own[i]), x = (int)(own[i] >> SST_RAY_COLUMN) + moved(s, 0, d), y = s->y + moved(s, 1, d);
        uint64_t there;

        at[i] = -1;
        label[i] = 0;
        if (x < 0 || y < 0 || x >= s->width || y >= s->height)
            continue;
        there = s->rays[(size_t)y * (size_t)s->width + (size_t)x];
        if (!alike(s, own[i], there))
            continue;
        at[i] = y << 16 | x;
        label[i] = (uint8_t)(there >> SST_RAY_LABEL);
    }
}
