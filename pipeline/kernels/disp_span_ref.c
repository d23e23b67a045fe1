/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_disp_span_ref(uint16_t span[2], const uint16_t *disp, size_t stride, int end, size_t n, size_t rows)
{
    for (size_t y = 0; y < rows; y++) {
        const uint16_t *row = disp + y * (stride / sizeof(*disp));

        for (size_t x = 0; x < n; x++) {
            if (row[x] < span[0])
                span[0] = row[x];
            if (row[x] < end && row[x] > span[1])
                span[1] = row[x];
        }
    }
}
