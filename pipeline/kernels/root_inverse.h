/* pipeline/kernels/root_inverse.h - 1 / sqrt(v) in plain float operations that vectorise and give the same bits on every
 * CPU. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_KERNELS_ROOT_INVERSE_H
#define SST_PIPELINE_KERNELS_ROOT_INVERSE_H

#include <stdint.h>
#include <string.h>

/** 1 / sqrt(v) of a normal v > 0 within a relative error of 5e-6: a guess from the halved exponent, two steps of
 * Newton's method. */
static inline float sst_root_inverse(float v)
{
    const float half = v * 0.5f;
    int32_t bits;
    float y;

    memcpy(&bits, &v, sizeof(bits));
    bits = 0x5f375a86 - (bits >> 1);
    memcpy(&y, &bits, sizeof(y));
    y *= 1.5f - half * y * y;
    return y * (1.5f - half * y * y);
}

#endif
