/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/exp_neg.h"
#include "pipeline/kernels/kernels.h"

void sst_guide_cells_ref(float *out, const struct sst_guide *g, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        for (size_t v = 0; v < g->values; v++)
            out[x * g->values + v] = 0;
        for (size_t k = 0; k < g->cells; k++) {
            float d[3], t, w;

            for (int c = 0; c < 3; c++)
                d[c] = (float)g->pixel[c][x] - g->colour[c][k];
            t = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) * (0.5f / (SST_GUIDE_SIGMA * SST_GUIDE_SIGMA));
            w = g->across[SST_GUIDE_CELLS * x + k] * g->down[k] *
                (sst_exp_neg(t < SST_EXP_NEG_MAX ? t : SST_EXP_NEG_MAX) + SST_GUIDE_FLOOR);
            for (size_t v = 0; v < g->values; v++)
                out[x * g->values + v] += w * g->cell[k][v];
        }
    }
}
