/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_bilateral_row_ref(uint16_t *out, const uint16_t *const disp[7], const uint8_t *const luma[7],
                           const int16_t *weight, int tau, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const int centre = disp[3][x], level = luma[3][x];
        int sum = 0, total = 0, mean;

        for (int k = 0; k < 49; k++) {
            const ptrdiff_t i = (ptrdiff_t)x + k % 7 - 3;
            const int step = disp[k / 7][i] - centre, contrast = luma[k / 7][i] - level;

            if (step < -SST_BILATERAL_STEP_Q6 || step > SST_BILATERAL_STEP_Q6 || contrast <= -tau || contrast >= tau)
                continue;
            sum += weight[k] * step;
            total += weight[k];
        }
        if (centre == 65535) {
            out[x] = 65535;
            continue;
        }
        /* |sum / total| <= 96: made positive, so that the conversion rounds down. The centre always counts: total >
         * 0. */
        mean = centre - 128 + (int)((float)sum / (float)total + 128.5f);
        out[x] = (uint16_t)mean;
    }
}
