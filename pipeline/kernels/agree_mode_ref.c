/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>

#include "pipeline/kernels/kernels.h"

static unsigned likeness(const uint8_t *a, const uint8_t *b, size_t stride)
{
    const int distance = abs(a[0] - b[0]) + abs(a[stride] - b[stride]) + abs(a[2 * stride] - b[2 * stride]);

    return distance < SST_AGREE_MODE ? (unsigned)(SST_AGREE_MODE - distance) / 2 : 0;
}

void sst_agree_mode_ref(uint8_t *const mode[3], const uint8_t *colour, const uint8_t *vote, size_t rays, size_t step,
                        size_t stride)
{
    for (size_t x = 0; x < stride; x++) {
        unsigned best = 0;

        mode[0][x] = mode[1][x] = mode[2][x] = 0;
        for (size_t j = 0; j < rays; j += step) {
            const uint8_t *a = colour + j * 3 * stride + x;
            unsigned votes = 0;

            for (size_t k = 0; k < rays; k++)
                votes += likeness(a, colour + k * 3 * stride + x, stride) * vote[k * stride + x];
            if (!vote[j * stride + x] || votes <= best)
                continue;
            best = votes;
            for (size_t c = 0; c < 3; c++)
                mode[c][x] = a[c * stride];
        }
    }
}
