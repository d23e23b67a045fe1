/* pipeline/kernels/blend_near.h - the weight of a ray by its disparity in whole numbers of 16 bits: the same bits on
 * every CPU and device, with twice as many lanes as floats have. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_KERNELS_BLEND_NEAR_H
#define SST_PIPELINE_KERNELS_BLEND_NEAR_H

#include <string.h>

#include "base/base.h"

#define SST_BLEND_UNKNOWN 65520 /* first stored disparity that means unknown */

/** W_d by stored disparity: (power + floor) scale with power = 2^-((focus - disp)^2 / (2 sigma^2 ln 2)), but for
 *  unknown disparities 0; scale alone where bits is 0. */
struct sst_blend_near {
    uint16_t first, last;  /* disparities beyond them count as these: there the power is below 2^-20 C1 */
    uint16_t times, focus; /* |times disp - focus| modulo 2^16 is below 2^15 */
    uint16_t slope;        /* y = 2 |times disp - focus| slope / 2^16, and y^2 / 2^16 is the exponent ... */
    uint16_t bits;         /* ... in 2^-bits */
    float floor, scale;
};

/** Set the weight of depth: W_d = (1 - C1) exp(-(focus - disp)^2 / (2 sigma^2)) + C1, 0 <= c1 < 1. Disparities more
 *  than 500 px from the focus weigh as at 500 px. @param focus_q6, sigma_q6  in stored units */
void sst_blend_near_set(struct sst_blend_near *n, double focus_q6, double sigma_q6, double c1);

#define SST_BLEND_POWER_1 45574 /* 2^g - 1 in 2^-16: g (POWER_1 + g (POWER_2 + g POWER_3)), within 1.1e-4; the sum */
#define SST_BLEND_POWER_2 14837 /* is 2^16 */
#define SST_BLEND_POWER_3 5125

/** Upper half of a product. */
static inline uint16_t sst_high_u16(uint16_t a, uint16_t b)
{
    return (uint16_t)((uint32_t)a * b >> 16);
}

/** Exponent and mantissa of the power of a disparity that is not unknown: bits 22.. and 7..22 of a float. */
static inline void sst_blend_near_parts(uint16_t *exponent, uint16_t *mantissa, const struct sst_blend_near *n,
                                        uint16_t disp)
{
    const uint16_t above = disp > n->first ? disp : n->first, within = above < n->last ? above : n->last;
    const uint16_t d = (uint16_t)(within * n->times - n->focus), off = (uint16_t)(d >> 15 ? -d : d);
    const uint16_t y = sst_high_u16((uint16_t)(2 * off), n->slope), e = (uint16_t)~sst_high_u16(y, y);
    const uint16_t g = (uint16_t)(e << (16 - n->bits));
    const uint16_t h = (uint16_t)(sst_high_u16(g, SST_BLEND_POWER_3) + SST_BLEND_POWER_2);

    *mantissa = sst_high_u16((uint16_t)(sst_high_u16(h, g) + SST_BLEND_POWER_1), g);
    *exponent = (uint16_t)((e >> n->bits) + 127 - (1 << (16 - n->bits)));
}

static inline float sst_blend_near_power(uint16_t exponent, uint16_t mantissa)
{
    const uint32_t bits = ((uint32_t)exponent << 16 | mantissa) << 7;
    float power;

    memcpy(&power, &bits, sizeof(power));
    return power;
}

/** W_d over `scale`, if bits is not 0. Relative error of W_d: 2.2e-3 at most, 1.4e-2 where C1 is 0
 *  (docs/measured/bounds.md). */
static inline float sst_blend_near(const struct sst_blend_near *n, uint16_t disp)
{
    uint16_t exponent, mantissa;

    if (disp >= SST_BLEND_UNKNOWN)
        return n->floor;
    sst_blend_near_parts(&exponent, &mantissa, n, disp);
    return sst_blend_near_power(exponent, mantissa) + n->floor;
}

#endif
