#include "pipeline/kernels/blend_colour_ref.h"

void sst_blend_plain_ref(float *const acc[4], const struct sst_blend *b, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        for (int c = 0; c < 3; c++)
            acc[c][x] += b->aperture * (1.0f / SST_BLEND_LEVEL) * (float)blend_colour_ref(b, c, x);
        acc[3][x] += b->aperture;
    }
}
