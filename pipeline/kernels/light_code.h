/* pipeline/kernels/light_code.h - light times a factor, sRGB code to sRGB code, 0..255; shared by all levels. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_KERNELS_LIGHT_CODE_H
#define SST_PIPELINE_KERNELS_LIGHT_CODE_H

#include <math.h>

#include "base/base.h"

/* sRGB is code = 12.92 light below SST_LIGHT_KNEE and 1.055 light^(1/2.4) - 0.055 above, here in steps of 1/255. */
#define SST_LIGHT_KNEE   10.31475f
#define SST_LIGHT_OFFSET 14.025f

/** s(v) and p(v) of sst_light_code(). */
static inline void sst_light_parts(float v, float *straight, float *curve)
{
    const float w = v < SST_LIGHT_KNEE ? v : v + SST_LIGHT_OFFSET, q = sqrtf(w);
    const float upper = ((0.05408126f * q - 0.6254325f) * q + 8.6891006f) * q + 1.0951992f;
    const float lower = ((-4.3761992e-05f * q + 0.0032436457f) * q + 0.0024750656f) * w * w;

    *straight = v < SST_LIGHT_KNEE ? v : lower;
    *curve = v < SST_LIGHT_KNEE ? upper : w;
}

/*
 * With s(v) the linear segment of sRGB extended to v's light, and p(v) = 269.025 light(v)^(1/2.4), the result is f s(v)
 * while that is below the knee, r p(v) - 14.025 above. Below the knee s(v) = v, above it p(v) = v + 14.025; the other
 * half of each is a polynomial fit for f in 1/8 .. 8: p to 0.0023, f s to 0.0009 (least maximum error).
 */
static inline float sst_light_code(float v, float f, float r)
{
    float straight, curve;

    sst_light_parts(v, &straight, &curve);
    straight *= f;
    return straight < SST_LIGHT_KNEE ? straight : r * curve - SST_LIGHT_OFFSET;
}

#endif
