/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_resample_row_ref(uint16_t *const out[3], const struct sst_resample *from, const int32_t *xy_q8, size_t n)
{
    const int taps = from->taps;

    for (size_t i = 0; i < n; i++) {
        const int32_t x = xy_q8[2 * i], y = xy_q8[2 * i + 1];
        const int16_t *wx = from->weight + (x & 255) * taps, *wy = from->weight + (y & 255) * taps;
        const uint8_t *corner;

        if (x == INT32_MIN) {
            out[0][i] = out[1][i] = out[2][i] = 0;
            continue;
        }
        corner = from->pixel + ((y >> 8) + 1 - taps / 2) * (ptrdiff_t)from->stride + 4 * ((x >> 8) + 1 - taps / 2);
        for (int c = 0; c < 3; c++) {
            int32_t sum = 0;

            for (int tx = 0; tx < taps; tx++) {
                int32_t column = 0;

                for (int ty = 0; ty < taps; ty++)
                    column += wy[ty] * corner[ty * (ptrdiff_t)from->stride + 4 * tx + c];
                sum += wx[tx] * ((column + 128) >> 8);
            }
            sum = (sum + 4096) >> 13;
            out[c][i] = (uint16_t)(sum < 0 ? 0 : sum > SST_LIGHT_WHITE ? SST_LIGHT_WHITE : sum);
        }
    }
}
