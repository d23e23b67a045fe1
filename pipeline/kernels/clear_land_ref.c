/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "pipeline/kernels/kernels.h"

void sst_clear_land_ref(uint16_t *landed, size_t stride, const struct sst_clear_view *v, const uint16_t *disp,
                        const uint8_t *state, int x, int y, int n)
{
    for (int i = 0; i < n; i++) {
        const float q = disp[i];
        const int to_x = x + i + (int)floorf(q * v->x_q6 + v->x_0), to_y = y + (int)floorf(q * v->y_q6 + v->y_0);

        if (state[i] && to_x >= 0 && to_x < v->width && to_y >= 0 && to_y < v->height) {
            uint16_t *to = landed + (size_t)to_y * stride + to_x;
            const uint16_t ray = (uint16_t)(2 * (disp[i] >> v->coarse) + 2 + (state[i] == SST_CLEAR_KEPT));

            *to = *to > ray ? *to : ray;
        }
    }
}
