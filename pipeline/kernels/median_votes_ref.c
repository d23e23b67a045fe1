/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>

#include "pipeline/kernels/kernels.h"

void sst_median_votes_row_ref(uint32_t *near, uint32_t *all, const uint16_t *const disp[SST_MEDIAN_SIDE],
                              const uint8_t *const colour[3][SST_MEDIAN_SIDE], size_t n)
{
    for (size_t x = 0; x < n; x++) {
        near[x] = all[x] = 0;
        for (int j = 0; j < SST_MEDIAN_SIDE; j++) {
            for (int i = 0; i < SST_MEDIAN_SIDE; i++) {
                const ptrdiff_t at = (ptrdiff_t)x + i - SST_MEDIAN_REACH;
                int contrast = 0, step;
                unsigned w;

                for (int c = 0; c < 3; c++)
                    contrast += abs(colour[c][j][at] - colour[c][SST_MEDIAN_REACH][x]);
                step = abs(disp[j][at] - disp[SST_MEDIAN_REACH][x]);
                w = sst_median_near[j][i] * sst_median_alike(contrast);
                near[x] += step <= SST_MEDIAN_STEP_Q6 ? w : 0;
                all[x] += w;
            }
        }
    }
}
