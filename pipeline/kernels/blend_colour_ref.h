/* pipeline/kernels/blend_colour_ref.h - the colours of rays, for the references of the blending kernels. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_KERNELS_BLEND_COLOUR_REF_H
#define SST_PIPELINE_KERNELS_BLEND_COLOUR_REF_H

#include "pipeline/kernels/kernels.h"

/* Colour of channel c of the ray of pixel x, in 1/SST_BLEND_LEVEL. */
static inline int32_t blend_colour_ref(const struct sst_blend *b, int c, size_t x)
{
    return b->top[c][x] * b->tap[0] + b->top[c][x + 1] * b->tap[1] + b->bottom[c][x] * b->tap[2] +
           b->bottom[c][x + 1] * b->tap[3];
}

#endif
