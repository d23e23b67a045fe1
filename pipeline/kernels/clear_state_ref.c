/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_clear_state_ref(uint8_t *state, const uint8_t *const removed[3], const uint16_t *disp, int bins, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        int near = 0;

        for (int row = 0; row < 3; row++)
            near |= *(removed[row] + x - 1) | removed[row][x] | removed[row][x + 1];
        state[x] = removed[1][x] || disp[x] >= bins ? SST_CLEAR_REMOVED : near ? SST_CLEAR_BESIDE : SST_CLEAR_KEPT;
    }
}
