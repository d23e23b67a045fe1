/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_window_agree_ref(uint8_t *first, uint8_t *second, const struct sst_window_pair *pair, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        int32_t sum = 0;
        float v;

        for (int i = 0; i < SST_WINDOW; i++)
            sum += pair->products[x + (size_t)i];
        v = (float)sum * (1.0f / (SST_WINDOW_AREA * SST_LEVEL_ONE * SST_LEVEL_ONE)) - pair->mean[0][x] * pair->mean[1][x];
        if (v * pair->inverse[0][x] * pair->inverse[1][x] > pair->enough) {
            first[x]++;
            second[x]++;
        }
    }
}
