#include "pipeline/kernels/blend_colour_ref.h"
#include "pipeline/kernels/exp_neg.h"

void sst_blend_rays_ref(float *const acc[4], const struct sst_blend *b, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const float d = ((float)b->disp[x] - b->focus_whole_q6) - b->focus_part_q6;
        const float t = d * d * b->half_inverse_variance;
        const float known = b->one_minus_c1 * sst_exp_neg(t < SST_EXP_NEG_MAX ? t : SST_EXP_NEG_MAX) + b->c1;
        const size_t column = b->disp[x] >> SST_BLEND_COLUMN_SHIFT;
        const float w_s = b->label ? b->label_weight[b->label[x] * (size_t)SST_BLEND_COLUMNS + column] : 1.0f;
        const float w = b->aperture * w_s * (b->disp[x] == 0xFFFF ? b->unknown : known);

        for (int c = 0; c < 3; c++)
            acc[c][x] += w * (1.0f / SST_BLEND_LEVEL) * (float)blend_colour_ref(b, c, x);
        acc[3][x] += w;
    }
}
