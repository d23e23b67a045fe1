/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_feature_cost_rows_ref(uint8_t *cost, size_t cost_stride, const uint8_t *a, const uint8_t *const *b,
                               size_t count, size_t stride, size_t n)
{
    for (size_t j = 0; j < count; j++) {
        for (size_t x = 0; x < n; x++) {
            int dot = 0, c;

            for (size_t i = 0; i < SST_FEATURE_CHANNELS; i++) {
                const size_t at = i / 4 * stride + 4 * x + i % 4;

                dot += (a[at] - SST_FEATURE_ZERO) * (b[j][at] - SST_FEATURE_ZERO);
            }
            c = (SST_FEATURE_ONE * SST_FEATURE_ONE - dot) >> SST_FEATURE_SHIFT;
            cost[j * cost_stride + x] = (uint8_t)(c < 0 ? 0 : c > SST_FEATURE_COST_MAX ? SST_FEATURE_COST_MAX : c);
        }
    }
}
