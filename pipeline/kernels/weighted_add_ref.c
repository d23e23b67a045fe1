/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_weighted_add_ref(const struct sst_weighted_sums *sums, const struct sst_weighted_rays *rays, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const uint32_t w = (rays->weight[x] + (1u << (SST_WEIGHTED_SHIFT - 1))) >> SST_WEIGHTED_SHIFT;

        for (int c = 0; c < rays->channels; c++) {
            sums->level[c][x] += rays->level[c][x];
            sums->weighted[c][x] += (float)(int32_t)rays->level[c][x] * (float)(int32_t)w;
        }
        sums->weight[x] += w;
        sums->count[x] = (uint16_t)(sums->count[x] + rays->count[x]);
    }
}
