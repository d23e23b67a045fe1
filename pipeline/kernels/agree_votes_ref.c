/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_agree_votes_ref(uint8_t *vote, const uint8_t *const colour[3], const float *weight, const struct sst_voting *v,
                         size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const int bin = (colour[0][x] >> 4) << 8 | (colour[1][x] >> 4) << 4 | colour[2][x] >> 4;
        const float votes = 1.0f + v->scale * (weight[x] + v->doubt) * (float)v->rarity[bin];

        vote[x] = (uint8_t)(weight[x] < 0 ? 0 : votes < v->most ? votes : v->most);
    }
}
