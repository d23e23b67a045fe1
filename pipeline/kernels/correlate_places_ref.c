/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "pipeline/kernels/kernels.h"

static float correlate(const struct sst_correlate *c, const int16_t *p)
{
    int32_t sum = 0, squares = 0, product = 0, spread;

    for (int y = 0; y < SST_CORRELATE_HEIGHT; y++, p += c->stride) {
        for (int x = 0; x < SST_CORRELATE_WIDTH; x++) {
            sum += p[x];
            squares += p[x] * p[x];
            product += p[x] * c->block[y][x];
        }
    }
    spread = squares * SST_CORRELATE_SIZE - sum * sum;
    if (spread <= 0)
        return 0;
    return (float)((double)(product * SST_CORRELATE_SIZE - sum * c->sum) / sqrt(spread * c->spread));
}

void sst_correlate_places_ref(float *out, const struct sst_correlate *c, const int32_t *at, size_t n)
{
    for (size_t i = 0; i < n; i++)
        out[i] = at[i] < 0 ? SST_CORRELATE_NONE : correlate(c, c->grey + at[i]);
}
