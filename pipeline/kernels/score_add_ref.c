/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_score_add_ref(uint16_t *sum, const uint8_t *score, size_t n)
{
    for (size_t x = 0; x < n; x++)
        sum[x] = (uint16_t)(sum[x] + score[x]);
}
