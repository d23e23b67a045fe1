/* pipeline/kernels/verify_ref.h - how much of a pixel is left to votes of its rays (pipeline/method/render/verify.h),
 * and how much the votes decide: what the CPU and the references of the shaders verify_* share.
 *
 * Sums, differences and products of floats in a fixed order, quotients rounded to the nearest number: the shaders give
 * the same bits.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_KERNELS_VERIFY_REF_H
#define SST_PIPELINE_KERNELS_VERIFY_REF_H

#include <math.h>

/* Chosen by the figures in docs/design/live.md. */
#define SST_VERIFY_DOUBT            0.5F /* added to all weights, which are 0..1 ... */
#define SST_VERIFY_DOUBT_LEAST      0.3F /* ... or, where a disparity has a confidence, from this for 255 on ... */
#define SST_VERIFY_DOUBT_MOST       2.3F /* ... to this for 0 */
#define SST_VERIFY_DOUBT_STEP       ((SST_VERIFY_DOUBT_MOST - SST_VERIFY_DOUBT_LEAST) / 255)
#define SST_VERIFY_ENOUGH           0.2F  /* of a pixel's rays that the maps assign to the focus: nothing to verify */
#define SST_VERIFY_FRONT_LOW        0.25F /* of a pixel's rays that end in front: no occluder ... */
#define SST_VERIFY_FRONT_HIGH       0.5F  /* ... to certainly one */
#define SST_VERIFY_UNEXPLAINED_LOW  0.1F  /* of all views: rays that end in front, unexplained: reliable maps ... */
#define SST_VERIFY_UNEXPLAINED_HIGH 0.2F  /* ... to unreliable ones */
#define SST_VERIFY_AGREE_LOW        0.1F  /* of all votes: chance ... */
#define SST_VERIFY_AGREE_HIGH       0.2F  /* ... to certainly a surface */
#define SST_VERIFY_SCREEN_STEP      4 /* a cell is verified if, of every 4th pixel of every 4th row left to votes ... */
#define SST_VERIFY_SCREEN_SHARE     8 /* ... one in 8 has more than UNEXPLAINED_LOW */
#define SST_VERIFY_CANDIDATES       2 /* one ray in this many proposes its colour */
#define SST_VERIFY_CELL_WIDTH       64 /* px, of the cells that are verified or not */
#define SST_VERIFY_CELL_HEIGHT      8

/** 0 up to low, rising to 1 from high on. */
static inline float sst_verify_ramp(float v, float low, float high)
{
    return fminf(fmaxf((v - low) / (high - low), 0), 1);
}

/** Fraction of a pixel that the maps leave to votes. @param there, front  sums of the apertures of its rays, and of
 * those that end in front or have no disparity @param assigned  of the weights of all */
static inline float sst_verify_share(float there, float front, float assigned)
{
    if (!(there > 0))
        return 0;
    return fmaxf(1 - assigned / (SST_VERIFY_ENOUGH * there), 0) *
           sst_verify_ramp(front / there, SST_VERIFY_FRONT_LOW, SST_VERIFY_FRONT_HIGH);
}

/** Added to the weight of a ray with a confidence. */
static inline float sst_verify_doubt(float weight, float aperture, int confidence)
{
    return weight + SST_VERIFY_DOUBT_LEAST * aperture + SST_VERIFY_DOUBT_STEP * aperture * (float)(255 - confidence);
}

/** Sum over 3x3 values; the first columns are those to the left. */
static inline float sst_verify_sum3(const float *above, const float *at, const float *below)
{
    return above[0] + above[1] + above[2] + at[0] + at[1] + at[2] + below[0] + below[1] + below[2];
}

/** A level of the plain picture with that of the votes, which decide the fraction `by`. */
static inline unsigned char sst_verify_mix(float by, float sum, float weight, unsigned char plain)
{
    return (unsigned char)(by * (sum / weight) + (1 - by) * (float)plain + 0.5F);
}

#endif
