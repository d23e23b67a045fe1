/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_transpose_u8_ref(uint8_t *out, size_t out_stride, const uint8_t *in, size_t in_stride, size_t nx, size_t nd)
{
    for (size_t x = 0; x < nx; x++) {
        for (size_t d = 0; d < nd; d++)
            out[x * out_stride + d] = in[d * in_stride + x];
    }
}
