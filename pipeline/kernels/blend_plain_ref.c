#include "pipeline/kernels/kernels.h"

void sst_blend_plain_ref(float *const acc[4], const struct sst_blend *b, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        for (int c = 0; c < 3; c++) {
            const float left = (float)b->top[c][x] + b->fy * (float)(b->bottom[c][x] - b->top[c][x]);
            const float right = (float)b->top[c][x + 1] + b->fy * (float)(b->bottom[c][x + 1] - b->top[c][x + 1]);

            acc[c][x] += b->aperture * (left + b->fx * (right - left));
        }
        acc[3][x] += b->aperture;
    }
}
