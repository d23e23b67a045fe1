/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_feature_products_ref(int32_t *out, const int16_t *a, size_t count, const int16_t *b, size_t n)
{
    for (size_t i = 0; i < count; i++) {
        for (size_t j = 0; j < n; j++) {
            int32_t sum = 0;

            for (size_t c = 0; c < SST_FEATURE_PARTS; c++)
                sum += a[i * SST_FEATURE_PARTS + c] * b[j * SST_FEATURE_PARTS + c];
            out[i * n + j] = sum;
        }
    }
}
