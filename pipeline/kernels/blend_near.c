/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/blend_near.h"

#include <math.h>

#define REACH_Q6 32000.0 /* 500 px: differences times `times` stay below 2^15 */
#define MOST     110.0   /* exponents that matter: sums of smaller powers are below SST_BLEND_FLOOR */
#define LIMIT    125.0   /* exponents: powers are normal floats */
#define BITS     12      /* of an exponent's fraction at most */

/* Set slope and bits for exponents up to `most`, which disparities most_q6 from the focus have: as many bits as both
 * have room for. */
static void set_slope(struct sst_blend_near *n, double most_q6, double most)
{
    for (n->bits = BITS;; n->bits--) {
        const double slope = exp2(23 + 0.5 * n->bits) * sqrt(most) / (n->times * most_q6);

        n->slope = (uint16_t)fmin(slope + 0.5, UINT16_MAX);
        if (slope <= UINT16_MAX && exp2(n->bits) * most <= 65000)
            return;
    }
}

void sst_blend_near_set(struct sst_blend_near *n, double focus_q6, double sigma_q6, double c1)
{
    const double wanted = c1 > 0 ? fmin(fmax(log2((1 - c1) / c1) + 20, 1), MOST) : MOST;
    const double reach_q6 = fmax(fmin(sigma_q6 * sqrt(2 * M_LN2 * wanted), REACH_Q6), 1);
    const double first = fmax(floor(focus_q6 - reach_q6), 0);
    const double last = fmin(ceil(focus_q6 + reach_q6), SST_BLEND_UNKNOWN - 1);
    const double most_q6 = fmax(focus_q6 - first, last - focus_q6), sigmas = most_q6 / sigma_q6;
    uint16_t exponent, mantissa;

    *n = (struct sst_blend_near){ .scale = (float)c1 };
    if (first > last)
        return;
    n->first = (uint16_t)first;
    n->last = (uint16_t)last;
    n->times = (uint16_t)fmin((INT16_MAX - 0.5) / most_q6, INT16_MAX);
    n->focus = (uint16_t)(int64_t)rint(n->times * focus_q6);
    set_slope(n, most_q6, fmin(0.5 * M_LOG2E * sigmas * sigmas, LIMIT));
    /* The power in focus, which is a little less than 1. */
    sst_blend_near_parts(&exponent, &mantissa, &(struct sst_blend_near){ .bits = n->bits }, 0);
    n->scale = (float)((1 - c1) / (double)sst_blend_near_power(exponent, mantissa));
    n->floor = (float)(c1 / (double)n->scale);
}
