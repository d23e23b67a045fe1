#include "pipeline/kernels/exp_neg.h"
#include "pipeline/kernels/kernels.h"

void sst_blend_take_ref(uint8_t *const colour[3], float *weight, const struct sst_blend *b, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        float zero[3] = { 0, 0, 0 }, w = 0, *const one[4] = { zero, zero + 1, zero + 2, &w };
        struct sst_blend pixel = *b, plain;

        pixel.disp = b->disp + x;
        pixel.label = b->label ? b->label + x : NULL;
        for (int c = 0; c < 3; c++) {
            pixel.top[c] = b->top[c] + x;
            pixel.bottom[c] = b->bottom[c] + x;
        }
        sst_blend_rays_ref(one, &pixel, 1);
        weight[x] = w;
        plain = pixel;
        plain.aperture = 1;
        zero[0] = zero[1] = zero[2] = 0;
        sst_blend_plain_ref(one, &plain, 1);
        for (int c = 0; c < 3; c++)
            colour[c][x] = (uint8_t)(zero[c] + 0.5f);
    }
}
