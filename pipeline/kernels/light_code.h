/* pipeline/kernels/light_code.h - light times a factor, sRGB code to sRGB code, 0..255; shared by all levels. */
#ifndef SST_PIPELINE_KERNELS_LIGHT_CODE_H
#define SST_PIPELINE_KERNELS_LIGHT_CODE_H

#include <math.h>

#include "base/base.h"

/* sRGB is code = 12.92 light below SST_LIGHT_KNEE and 1.055 light^(1/2.4) - 0.055 above, here in steps of 1/255. */
#define SST_LIGHT_KNEE   10.31475f
#define SST_LIGHT_OFFSET 14.025f

/*
 * With s(v) the linear segment of sRGB extended to v's light, and p(v) = 269.025 light(v)^(1/2.4), the result is f s(v)
 * while that is below the knee, r p(v) - 14.025 above. Below the knee s(v) = v, above it p(v) = v + 14.025; the other
 * half of each is a polynomial fit for f in 1/8 .. 8: p to 0.0023, f s to 0.0009 (least maximum error).
 */
static inline float sst_light_code(float v, float f, float r)
{
    const float w = v < SST_LIGHT_KNEE ? v : v + SST_LIGHT_OFFSET, q = sqrtf(w);
    const float curve = ((0.05408126f * q - 0.6254325f) * q + 8.6891006f) * q + 1.0951992f;
    const float straight = ((-4.3761992e-05f * q + 0.0032436457f) * q + 0.0024750656f) * w * w;
    const float s = f * (v < SST_LIGHT_KNEE ? v : straight);
    const float p = r * (v < SST_LIGHT_KNEE ? curve : w) - SST_LIGHT_OFFSET;

    return s < SST_LIGHT_KNEE ? s : p;
}

#endif
