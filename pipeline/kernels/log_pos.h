/* pipeline/kernels/log_pos.h - log(x) in plain float operations that vectorise and give the same bits on every CPU. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_KERNELS_LOG_POS_H
#define SST_PIPELINE_KERNELS_LOG_POS_H

#include <string.h>

#include "base/base.h"

/** 2 atanh(z) for |z| <= 1/3, to 1e-7 of its value: the series to z^13 leaves less than z^15 / 7. */
static inline float sst_atanh2(float z)
{
    const float s = z * z;

    return 2 * z *
           (1 + s * (1.0f / 3 + s * (1.0f / 5 + s * (1.0f / 7 + s * (1.0f / 9 + s * (1.0f / 11 + s * (1.0f / 13)))))));
}

/**
 * log(x) for normal x > 0. Absolute error at most 1e-7 + 1e-7 |log x|.
 *
 * x = 2^k m with m from sqrt(1/2) to sqrt(2); log m = 2 atanh((m - 1) / (m + 1)). ln 2 is split so that k times its
 * upper part is exact.
 */
static inline float sst_log_pos(float x)
{
    int32_t bits, k;
    float m;

    memcpy(&bits, &x, sizeof(bits));
    k = (bits - 0x3F3504F3) >> 23; /* the bits of sqrt(1/2) */
    bits -= k * (1 << 23);
    memcpy(&m, &bits, sizeof(m));
    return (float)k * 0.693359375f + ((float)k * -2.12194440e-4f + sst_atanh2((m - 1) / (m + 1)));
}

#endif
