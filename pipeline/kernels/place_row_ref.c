/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "pipeline/kernels/kernels.h"

void sst_place_row_ref(int32_t *xy_q8, const struct sst_places *places, float k0, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const float k = k0 + (float)i;
        int32_t at[2];

        for (int axis = 0; axis < 2; axis++) {
            const float *c = places->c[axis];

            at[axis] = places->whole_q8[axis] + (int32_t)lrintf(c[0] + k * (c[1] + k * (c[2] + k * c[3])));
        }
        if (at[0] < 0 || at[0] > places->most[0] || at[1] < 0 || at[1] > places->most[1])
            at[0] = at[1] = INT32_MIN;
        xy_q8[2 * i] = at[0];
        xy_q8[2 * i + 1] = at[1];
    }
}
