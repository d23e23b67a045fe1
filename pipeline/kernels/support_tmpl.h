/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/simd.h"

#define SUPPORT_LANES (SIMD_BYTES / 2)
typedef uint8_t KERNEL(support_costs) __attribute__((vector_size(SUPPORT_LANES)));

/* Cross-based support by prefix sums: along the row here, down the columns by the caller's ring of rows. A register's
 * disparities at a time, so that their prefix sums stay in the L1 cache. */
static void KERNEL(support_sum_row)(uint16_t *restrict vp, const uint16_t *restrict vp_above, uint16_t *restrict prefix,
                                    const uint8_t *restrict cost, const uint8_t *left, const uint8_t *right, size_t n,
                                    size_t nd)
{
    for (size_t d = 0; d < nd; d += SUPPORT_LANES) {
        simd_u16 sum = { 0 };

        simd_store_u16(prefix, sum);
        for (size_t x = 0; x < n; x++) {
            KERNEL(support_costs) c;

            memcpy(&c, cost + x * nd + d, sizeof(c));
            sum += __builtin_convertvector(c, simd_u16);
            simd_store_u16(prefix + (x + 1) * SUPPORT_LANES, sum);
        }
        for (size_t x = 0; x < n; x++) {
            const uint16_t *p = prefix + (x - left[x]) * SUPPORT_LANES;
            const uint16_t *q = prefix + (x + right[x] + 1) * SUPPORT_LANES;

            simd_store_u16(vp + x * nd + d, simd_load_u16(vp_above + x * nd + d) + simd_load_u16(q) - simd_load_u16(p));
        }
    }
}
#undef SUPPORT_LANES

static void KERNEL(support_mean_row)(uint8_t *restrict out, const uint16_t *const *rows, const uint8_t *up,
                                     const uint8_t *down, const uint16_t *count, size_t n, size_t nd)
{
    for (size_t x = 0; x < n; x++) {
        const uint16_t *lo = rows[down[x]] + x * nd, *hi = rows[-1 - up[x]] + x * nd;
        const uint16_t half = (uint16_t)(count[x] / 2);
        const uint16_t reciprocal = (uint16_t)(count[x] < 2 ? 0 : (65536u + count[x] - 1u) / count[x]);
        uint8_t *o = out + x * nd;

        if (count[x] < 2)
            continue;
        for (size_t d = 0; d < nd; d++) {
            const uint16_t sum = (uint16_t)(lo[d] - hi[d] + half);

            o[d] = (uint8_t)((uint32_t)sum * reciprocal >> 16);
        }
    }
}
