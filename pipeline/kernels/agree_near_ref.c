/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>

#include "pipeline/kernels/kernels.h"

void sst_agree_near_ref(uint16_t *near, const uint8_t *const colour[3], const uint8_t *const mode[3],
                        const uint8_t *vote, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        int distance = 0;

        for (int c = 0; c < 3; c++)
            distance += abs(colour[c][x] - mode[c][x]);
        near[x] = (uint16_t)(distance < SST_AGREE_NEAR ? (SST_AGREE_NEAR - distance) * vote[x] : 0);
    }
}
