/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/blend_colour_ref.h"

void sst_blend_plain_ref(int32_t *const sum[3], float *count, const struct sst_blend *b, int views, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        for (int k = 0; k < views; k++) {
            for (int c = 0; c < 3; c++)
                sum[c][x] += blend_colour_ref(&b[k], c, x);
            count[x] += 1;
        }
    }
}
