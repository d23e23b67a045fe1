/* pipeline/kernels/exp_neg.h - exp(-t) in plain float operations that vectorise and give the same bits on every CPU. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_KERNELS_EXP_NEG_H
#define SST_PIPELINE_KERNELS_EXP_NEG_H

#include <string.h>

#include "base/base.h"

#define SST_EXP_NEG_MAX 86.0f /* exp(-86) = 4.5e-38 is the smallest result; it and its factors are normal numbers */

/**
 * exp(-t) for 0 <= t <= SST_EXP_NEG_MAX. Relative error at most 2e-7; exactly 1 for t = 0.
 *
 * The caller clamps, in a separate loop: otherwise compilers branch around the series and do not vectorise. t = k ln 2
 * - r with |r| <= ln(2)/2, exp(-t) = 2^-k exp(r). ln 2 is split so that k times its upper part is exact; the series to
 * r^7 leaves less than r^8/8! / exp(r) < 8e-9.
 */
static inline float sst_exp_neg(float t)
{
    const int k = (int)(t * 1.44269504f + 0.5f);
    const float n = (float)k;
    const float r = (n * 0.693359375f - t) + n * -2.12194440e-4f;
    const float p =
        1.0f +
        r * (1.0f +
             r * (0.5f + r * (1.0f / 6 + r * (1.0f / 24 + r * (1.0f / 120 + r * (1.0f / 720 + r * (1.0f / 5040)))))));
    const int32_t bits = (127 - k) << 23;
    float scale;

    memcpy(&scale, &bits, sizeof(scale));
    return p * scale;
}

#endif
