/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_median5_row_ref(uint16_t *out, const uint16_t *const rows[5], size_t n)
{
    for (size_t x = 0; x < n; x++) {
        uint16_t v[25];
        int count = 0;

        for (int j = 0; j < 5; j++) {
            for (int i = -2; i <= 2; i++) {
                const uint16_t value = rows[j][(ptrdiff_t)x + i];
                int at = count++;

                for (; at > 0 && v[at - 1] > value; at--)
                    v[at] = v[at - 1];
                v[at] = value;
            }
        }
        out[x] = v[12];
    }
}
