/* pipeline/kernels/blend_colour_ref.h - the colours of rays, for the references of the blending kernels. */
#ifndef SST_PIPELINE_KERNELS_BLEND_COLOUR_REF_H
#define SST_PIPELINE_KERNELS_BLEND_COLOUR_REF_H

#include "pipeline/kernels/kernels.h"

static inline int blend_between(int v0, int v1, int f)
{
    return v0 + (((v1 - v0) * f + (1 << 14)) >> 15);
}

/* Colour of channel c of the ray of pixel x, in 1/SST_BLEND_LEVEL. */
static inline int blend_colour_ref(const struct sst_blend *b, int c, size_t x)
{
    const int fx = sst_blend_fraction(b->fx), fy = sst_blend_fraction(b->fy);
    const int left = blend_between(b->top[c][x] * SST_BLEND_LEVEL, b->bottom[c][x] * SST_BLEND_LEVEL, fy);
    const int right = blend_between(b->top[c][x + 1] * SST_BLEND_LEVEL, b->bottom[c][x + 1] * SST_BLEND_LEVEL, fy);

    return blend_between(left, right, fx);
}

#endif
