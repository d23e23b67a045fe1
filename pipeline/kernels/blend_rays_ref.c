/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/blend_colour_ref.h"
#include "pipeline/kernels/exp_neg.h"

static float ray_weight(const struct sst_blend *b, size_t x)
{
    float d, w_d, w_s = 1;

    if (!b->disp)
        return b->aperture;
    d = ((float)b->disp[x] - b->focus_whole_q6) - b->focus_part_q6;
    w_d = ((uint16_t)(b->disp[x] - b->first) < b->count ? sst_exp2_neg(d * d * b->scale, b->power) : 0) + b->c1;
    if (b->label)
        w_s = b->range[b->label[x]].weight[b->disp[x] >> SST_BLEND_COLUMN_SHIFT];
    return b->aperture * w_s * w_d;
}

void sst_blend_rays_ref(float *const acc[4], const struct sst_blend *b, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const float w = ray_weight(b, x);

        for (int c = 0; c < 3; c++)
            acc[c][x] += w * (float)blend_colour_ref(b, c, x);
        acc[3][x] += w;
    }
}
