/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdbool.h>
#include <stdlib.h>

#include "pipeline/kernels/kernels.h"

static int channel(uint32_t pixel, int c)
{
    return (int)(pixel >> 8 * c & 255);
}

static bool similar(uint32_t a, uint32_t b, int most)
{
    for (int c = 0; c < 3; c++) {
        if (abs(channel(a, c) - channel(b, c)) > most)
            return false;
    }
    return true;
}

/* Colour difference between windows of 3x3 around a and b, over the pixels of a's that are similar to its middle. */
static unsigned difference(const uint32_t *a, ptrdiff_t a_stride, const uint32_t *b, ptrdiff_t b_stride, int most)
{
    unsigned sum = 0, count = 0, mean;

    for (int y = -1; y <= 1; y++) {
        for (int x = -1; x <= 1; x++) {
            const uint32_t p = a[y * a_stride + x], q = b[y * b_stride + x];

            if (!similar(p, a[0], most))
                continue;
            count++;
            for (int c = 0; c < 3; c++)
                sum += (unsigned)abs(channel(p, c) - channel(q, c));
        }
    }
    mean = sum * (65536 * 8 / count) >> 16;
    return mean < SST_HYPOTHESIS_LIMIT ? mean : SST_HYPOTHESIS_LIMIT;
}

static unsigned cost_of(const struct sst_hypothesis_test *t, int x, int y, int d)
{
    const unsigned hides = t->code[d + t->tolerance < 65534 ? d + t->tolerance : 65534];
    unsigned best[SST_HYPOTHESIS_BEST + 1], seen = 0, visible = 0, sum = 0;
    size_t found = 0;

    for (int k = 0; k < t->views; k++) {
        const struct sst_packed_view *v = &t->view[k];
        const int xv = x + ((t->x[k] + d * t->dx[k]) >> 16), yv = y + ((t->y[k] + d * t->dy[k]) >> 16);
        const uint32_t *at = v->pixels + yv * v->stride + xv;
        unsigned cost;
        size_t i;

        if (xv < 0 || yv < 0 || xv >= t->width || yv >= t->height || *at >> 24 == SST_DEPTH_OUTSIDE)
            continue;
        cost = difference(t->own.pixels + y * t->own.stride + x, t->own.stride, at, v->stride, t->similar);
        seen++;
        visible += *at >> 24 <= hides;
        sum += *at >> 24 <= hides ? cost : 0;
        for (i = found; i > 0 && best[i - 1] > cost; i--)
            best[i] = best[i - 1];
        best[i] = cost;
        found += found < SST_HYPOTHESIS_BEST;
    }
    if (seen < SST_HYPOTHESIS_BEST)
        return seen ? best[0] : SST_HYPOTHESIS_LIMIT;
    for (int i = 0; i < SST_HYPOTHESIS_BEST; i++)
        sum += best[i];
    return sum / (visible + SST_HYPOTHESIS_BEST);
}

void sst_hypothesis_cost_row_ref(uint16_t *cost, const uint16_t *hypothesis, const uint8_t *count,
                                 const struct sst_hypothesis_test *test, int x, int y, size_t n)
{
    for (size_t k = 0; k < n; k++) {
        for (size_t i = 0; i < SST_HYPOTHESES; i++) {
            const size_t at = k * SST_HYPOTHESES + i;

            cost[at] = i >= count[k] || (i && cost[at - i] < test->settled) ? SST_HYPOTHESIS_FAR
                       : count[k] == 1                                      ? 0
                                       : (uint16_t)cost_of(test, x + (int)k, y, hypothesis[at]);
        }
    }
}
