/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_blend_support_ref(uint8_t *support, const uint16_t *disp, const uint8_t *label, const uint32_t *ends, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const uint32_t range = ends[label ? label[x] : 0];

        if (disp[x] >= (range & 0xFFFF) && disp[x] <= range >> 16)
            support[x] = 255;
    }
}
