/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_blend_finish_ref(uint8_t *out, const float *sum, const float *weight, size_t n)
{
    for (size_t x = 0; x < n; x++)
        out[x] = (uint8_t)(sum[x] * (1.0f / SST_BLEND_LEVEL) / (weight[x] + SST_BLEND_TINY) + 0.5f);
}
