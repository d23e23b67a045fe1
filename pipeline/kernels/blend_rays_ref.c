/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/blend_colour_ref.h"

static float ray_weight(const struct sst_blend *b, size_t x)
{
    float w;

    if (!b->disp)
        return b->aperture;
    w = b->aperture * b->near.scale;
    if (b->label)
        w *= b->by->range[b->label[x]].weight[b->disp[x] >> SST_BLEND_COLUMN_SHIFT];
    return b->near.bits ? w * sst_blend_near(&b->near, b->disp[x]) : w;
}

void sst_blend_rays_ref(float *const acc[4], const struct sst_blend *b, int views, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        for (int k = 0; k < views; k++) {
            const float w = ray_weight(&b[k], x);

            for (int c = 0; c < 3; c++)
                acc[c][x] += w * (float)blend_colour_ref(&b[k], c, x);
            acc[3][x] += w;
        }
    }
}
