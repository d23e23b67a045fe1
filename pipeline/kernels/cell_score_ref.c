/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>

#include "pipeline/kernels/kernels.h"

void sst_cell_score_ref(uint8_t *score, uint16_t *usual, const struct sst_score_cells *c, int learns, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        int least = 3 * 255, above;

        for (int i = 0; i < SST_SCORE_SLOTS; i++) {
            int d = 0;

            for (int k = 0; k < 3; k++)
                d += abs(c->now[k][x] - c->slot[i][k][x]);
            least = sst_min_int(least, d);
        }
        above = least - (usual[x] >> 8) - SST_SCORE_SLACK;
        score[x] = (uint8_t)sst_clamp_int(above, 0, SST_SCORE_CAP);
        if (learns)
            usual[x] =
                (uint16_t)(usual[x] + ((256 * sst_min_int(least, SST_SCORE_USUAL) - usual[x]) >> SST_SCORE_RATE));
    }
}
