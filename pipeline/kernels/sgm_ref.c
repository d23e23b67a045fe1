/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

static unsigned min2(unsigned a, unsigned b)
{
    return a < b ? a : b;
}

struct penalties {
    unsigned p1, p2;
};

/* One pixel's L from its predecessor's. */
static void step(uint16_t *cur, const uint16_t *prev, const uint8_t *cost, struct penalties p, size_t nd)
{
    const unsigned prev_min = prev[-2];
    unsigned cur_min = SST_SGM_FAR;

    for (size_t d = 0; d < nd; d++) {
        const unsigned near = min2(prev[(ptrdiff_t)d - 1], prev[d + 1]) + p.p1;
        const unsigned best = min2(min2(prev[d], near), prev_min + p.p2);
        const unsigned l = cost[d] + best - prev_min;

        cur[d] = (uint16_t)l;
        cur_min = min2(cur_min, l);
    }
    cur[-1] = cur[nd] = SST_SGM_FAR;
    cur[-2] = (uint16_t)cur_min;
}

static void add(uint16_t *sum, const uint16_t *cur, int first, size_t nd)
{
    for (size_t d = 0; d < nd; d++)
        sum[d] = (uint16_t)(first ? cur[d] : sum[d] + cur[d]);
}

void sst_sgm_across_row_ref(uint16_t *cur, const uint16_t *prev, uint16_t *sum, const uint8_t *cost,
                            const uint8_t *penalty, const uint16_t *p1, const uint16_t *p2, int dx, int first, size_t n,
                            size_t nd)
{
    const size_t entry = nd + 2 * SST_SGM_PAD;

    for (size_t x = 0; x < n; x++) {
        uint16_t *at = cur + (x + 1) * entry + SST_SGM_PAD;

        step(at, prev + (size_t)((ptrdiff_t)x + 1 + dx) * entry + SST_SGM_PAD, cost + x * nd,
             (struct penalties){ p1[penalty[x]], p2[penalty[x]] }, nd);
        add(sum + x * nd, at, first, nd);
    }
}

void sst_sgm_along_rows_ref(uint16_t *line, uint16_t *sum, const uint8_t *cost, size_t stride, const uint8_t *penalty,
                            size_t penalty_stride, const uint16_t *p1, const uint16_t *p2, int dir, int first,
                            size_t rows, size_t n, size_t nd)
{
    const size_t entry = nd + 2 * SST_SGM_PAD;

    for (size_t r = 0; r < rows;
         r++, line += (n + 2) * entry, sum += stride, cost += stride, penalty += penalty_stride) {
        for (size_t i = 0; i < n; i++) {
            const size_t x = dir > 0 ? i : n - 1 - i;
            uint16_t *at = line + (x + 1) * entry + SST_SGM_PAD;

            step(at, line + (size_t)((ptrdiff_t)x + 1 - dir) * entry + SST_SGM_PAD, cost + x * nd,
                 (struct penalties){ p1[penalty[x]], p2[penalty[x]] }, nd);
            add(sum + x * nd, at, first, nd);
        }
    }
}
