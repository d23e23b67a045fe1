/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/blend_colour_ref.h"

void sst_blend_take_ref(uint8_t *const colour[3], float *weight, const struct sst_blend *b, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        float sum[3] = { 0, 0, 0 }, w = 0, *const one[4] = { sum, sum + 1, sum + 2, &w };
        struct sst_blend pixel = *b;

        pixel.disp = b->disp ? b->disp + x : NULL;
        pixel.label = b->label ? b->label + x : NULL;
        for (int c = 0; c < 3; c++) {
            pixel.top[c] = b->top[c] + x;
            pixel.bottom[c] = b->bottom[c] + x;
            colour[c][x] = (uint8_t)((blend_colour_ref(b, c, x) + SST_BLEND_LEVEL / 2) / SST_BLEND_LEVEL);
        }
        sst_blend_rays_ref(one, &pixel, 1, 1);
        weight[x] = w;
    }
}
