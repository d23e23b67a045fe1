/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

/* The surface of one pixel. */
static float surface_of(const uint16_t *const *landed, size_t views, size_t x)
{
    unsigned top = 0, arrived = 0;

    for (size_t k = 0; k < views; k++) {
        top = landed[k][x] / 2U > top ? landed[k][x] / 2U : top;
        arrived += landed[k][x] != 0;
    }
    while (top) {
        unsigned count = 0, sum = 0, next = 0;

        for (size_t k = 0; k < views; k++) {
            const unsigned at = landed[k][x] / 2U;

            if (at && at <= top && at + SST_CLEAR_TOLERANCE >= top) {
                count++;
                sum += at;
            }
            next = at < top && at > next ? at : next;
        }
        if (count >= 2 && 4 * count >= arrived)
            return (float)sum / (float)count;
        top = next;
    }
    return 0;
}

void sst_clear_surface_ref(float *surface, const uint16_t *const *landed, size_t views)
{
    for (size_t x = 0; x < SST_CLEAR_BLOCK; x++)
        surface[x] = surface_of(landed, views, x);
}
