/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "pipeline/kernels/kernels.h"

struct landed {
    int i; /* pixel of the block */
    unsigned landed;
};

static void bilinear(float colour[3], const struct sst_clear_view *v, float x, float y)
{
    const int x0 = (int)x, y0 = (int)y;
    const int xp = (int)((x - (float)x0) * 64 + 0.5F), yp = (int)((y - (float)y0) * 64 + 0.5F);

    for (int c = 0; c < 3 && v->plane[c]; c++) {
        const uint8_t *top = v->plane[c] + (size_t)y0 * v->stride + x0;
        const uint8_t *bottom = yp ? top + v->stride : top;
        const int right = xp != 0;
        const int upper = 64 * top[0] + xp * (top[right] - top[0]);
        const int lower = 64 * bottom[0] + xp * (bottom[right] - bottom[0]);

        colour[c] = (float)(64 * upper + yp * (lower - upper)) * (1.0F / 4096);
    }
}

/* The ray of the i-th pixel of the block sees the surface, at a place of the view. */
static bool sees(const struct sst_clear_rays *rays, int i, const struct sst_clear_view *v, unsigned level,
                 const float at[2])
{
    return level >= rays->first[i] && level <= rays->last[i] && rays->wanted[i] > 0 && at[0] >= 0 && at[1] >= 0 &&
           at[0] <= (float)(v->width - 1) && at[1] <= (float)(v->height - 1);
}

int sst_clear_take_ref(struct sst_clear_rays *rays, const struct sst_clear_view *v, const uint16_t *landed, int x,
                       int y)
{
    const int slot = rays->slots;
    int any = 0, more = 0;

    for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
        const float at[2] = { (float)(x + i) - rays->px[i] * v->bx, (float)y - rays->px[i] * v->by };
        float colour[3] = { 0, 0, 0 }, w = 0;

        if (sees(rays, i, v, landed[i] / 2, at)) {
            bilinear(colour, v, at[0], at[1]);
            w = landed[i] % 2 ? 1 : SST_CLEAR_RIM;
        }
        rays->weight[slot][i] = w;
        for (int c = 0; c < 3; c++)
            rays->colour[c][slot][i] = colour[c];
        rays->wanted[i] = (int16_t)(rays->wanted[i] - (w >= 1));
        any |= w > 0;
        more |= rays->wanted[i] > 0;
    }
    rays->slots += any;
    return more;
}
