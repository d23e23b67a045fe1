/* guide_cells: the weights of a pixel in parallel, then eight values at a time over all cells. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/exp_neg.h"

/* Three loops with a cell count unknown at compile time: otherwise compilers unroll and then do not vectorise. */
static inline void KERNEL(guide_weights)(float *restrict w, const struct sst_guide *g, size_t x)
{
    const float r = g->pixel[0][x], green = g->pixel[1][x], b = g->pixel[2][x];
    const float *restrict across = g->across + SST_GUIDE_CELLS * x;
    const size_t cells = g->cells;
    float t[SST_GUIDE_CELLS];

    for (size_t k = 0; k < cells; k++) {
        const float dr = r - g->colour[0][k], dg = green - g->colour[1][k], db = b - g->colour[2][k];

        t[k] = (dr * dr + dg * dg + db * db) * (0.5f / (SST_GUIDE_SIGMA * SST_GUIDE_SIGMA));
    }
    for (size_t k = 0; k < cells; k++)
        t[k] = t[k] < SST_EXP_NEG_MAX ? t[k] : SST_EXP_NEG_MAX;
    for (size_t k = 0; k < cells; k++)
        w[k] = across[k] * g->down[k] * (sst_exp_neg(t[k]) + SST_GUIDE_FLOOR);
}

static inline void KERNEL(guide_mix)(float *restrict out, const float *restrict w, const struct sst_guide *g)
{
    typedef float eight __attribute__((vector_size(SST_GUIDE_VALUES * sizeof(float))));

    for (size_t v = 0; v < g->values; v += SST_GUIDE_VALUES) {
        eight sum = { 0 };

        for (size_t k = 0; k < g->cells; k++) {
            eight cell;

            memcpy(&cell, g->cell[k] + v, sizeof(cell));
            sum += w[k] * cell;
        }
        memcpy(out + v, &sum, sizeof(sum));
    }
}

/* Weights of several pixels first: those of a single pixel would be read back before the stores complete. */
static void KERNEL(guide_cells)(float *restrict out, const struct sst_guide *g, size_t n)
{
    float w[8][SST_GUIDE_CELLS];

    for (size_t x = 0; x < n; x += 8) {
        const size_t m = n - x < 8 ? n - x : 8;

        for (size_t i = 0; i < m; i++)
            KERNEL(guide_weights)(w[i], g, x + i);
        for (size_t i = 0; i < m; i++)
            KERNEL(guide_mix)(out + (x + i) * g->values, w[i], g);
    }
}
