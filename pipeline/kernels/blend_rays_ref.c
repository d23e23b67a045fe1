#include "pipeline/kernels/exp_neg.h"
#include "pipeline/kernels/kernels.h"

void sst_blend_rays_ref(float *const acc[4], const struct sst_blend *b, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const float d = ((float)b->disp[x] - b->focus_whole_q6) - b->focus_part_q6;
        const float t = d * d * b->half_inverse_variance;
        const float known = b->one_minus_c1 * sst_exp_neg(t < SST_EXP_NEG_MAX ? t : SST_EXP_NEG_MAX) + b->c1;
        const size_t column = b->disp[x] >> SST_BLEND_COLUMN_SHIFT;
        const float w_s = b->label ? b->label_weight[b->label[x] * (size_t)SST_BLEND_COLUMNS + column] : 1.0f;
        const float w = b->aperture * w_s * (b->disp[x] == 0xFFFF ? b->unknown : known);

        for (int c = 0; c < 3; c++) {
            const float left = (float)b->top[c][x] + b->fy * (float)(b->bottom[c][x] - b->top[c][x]);
            const float right = (float)b->top[c][x + 1] + b->fy * (float)(b->bottom[c][x + 1] - b->top[c][x + 1]);

            acc[c][x] += w * (left + b->fx * (right - left));
        }
        acc[3][x] += w;
    }
}
