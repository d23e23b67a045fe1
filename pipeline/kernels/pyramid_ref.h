/* pipeline/kernels/pyramid_ref.h - one pixel of the pyramid that fills holes: pull-push, Gortler 1996.
 *
 * Sums, products and quotients of floats in a fixed order, none fused: what a device rounds as the CPU does, so that
 * the shaders hole_pull and hole_push give the same bits (quotients in whole numbers).
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_KERNELS_PYRAMID_REF_H
#define SST_PIPELINE_KERNELS_PYRAMID_REF_H

#include <math.h>

#include "base/base.h"

#define SST_PYRAMID_FULL 2 /* pixels of four that make the coarser one certain: single ones are likely to be wrong */

/** Side of the coarser level. */
static inline int sst_pyramid_half(int side)
{
    return (side + 1) / 2;
}

/** Weight 0..1 of a pixel of the picture. @param weight  255 is enough */
static inline float sst_pyramid_weight(uint8_t weight)
{
    return (float)weight / 255;
}

/** A value of the coarser level. @param sum  of up to four pixels: a colour times weight, or the weights @param weights
 *  their weights' sum @return a colour times weight, or the weight, at most 1 */
static inline float sst_pyramid_pull(float sum, float weights)
{
    return sum / fmaxf(weights, SST_PYRAMID_FULL);
}

/** The other row or column that pixel i of the finer level lies between, of `side` of the coarser one: pixels of that
 *  lie at 2 x + 1/2, and the nearer one is i / 2. */
static inline int sst_pyramid_beside(int i, int side)
{
    return sst_clamp_int(i / 2 + (i & 1 ? 1 : -1), 0, side - 1);
}

/** The coarser level between four of its pixels. @param near, far  rows: that of i / 2 and that beside it; likewise the
 *  columns, x0 and x1 */
static inline float sst_pyramid_between(float near_x0, float near_x1, float far_x0, float far_x1)
{
    return 0.75F * (0.75F * near_x0 + 0.25F * near_x1) + 0.25F * (0.75F * far_x0 + 0.25F * far_x1);
}

/** A colour of the picture mixed with what lies between. @param weight  0..1 */
static inline uint8_t sst_pyramid_mix(uint8_t colour, float weight, float between)
{
    return (uint8_t)(weight * (float)colour + (1 - weight) * between + 0.5F);
}

#endif
