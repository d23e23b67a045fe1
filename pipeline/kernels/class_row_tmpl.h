/* class_row: class by class over all pixels, the sums of a row in the L1 cache. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <float.h>

#include "pipeline/kernels/log_pos.h"

static inline void KERNEL(class_sums)(float *restrict rest, float *restrict h, const float *restrict p,
                                      const int32_t *restrict best, int32_t c, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const float v = best[x] == c ? 0.0f : p[x];

        rest[x] += v;
        h[x] -= v * sst_log_pos(v > FLT_MIN ? v : FLT_MIN);
    }
}

static void KERNEL(class_row)(uint8_t *restrict top, float *restrict entropy, const float *restrict p, size_t stride,
                              size_t count, size_t n)
{
    float most[SST_CLASS_ROW_MAX], rest[SST_CLASS_ROW_MAX], h[SST_CLASS_ROW_MAX];
    int32_t best[SST_CLASS_ROW_MAX];

    for (size_t x = 0; x < n; x++) {
        most[x] = p[x];
        best[x] = 0;
        rest[x] = h[x] = 0;
    }
    for (size_t c = 1; c < count; c++) {
        const float *restrict pc = p + c * stride;

        for (size_t x = 0; x < n; x++) {
            best[x] = pc[x] > most[x] ? (int32_t)c : best[x];
            most[x] = pc[x] > most[x] ? pc[x] : most[x];
        }
    }
    for (size_t x = 0; x < n; x++)
        top[x] = (uint8_t)best[x];
    if (!entropy)
        return;
    for (size_t c = 0; c < count; c++)
        KERNEL(class_sums)(rest, h, p + c * stride, best, (int32_t)c, n);
    for (size_t x = 0; x < n; x++) {
        const float r = rest[x] < 0.5f ? rest[x] : 0.0f, m = most[x] > FLT_MIN ? most[x] : FLT_MIN;
        const float sure = (1 - r) * sst_atanh2(-r / (2 - r)), unsure = most[x] * sst_log_pos(m);
        const float sum = h[x] - (rest[x] < 0.5f ? sure : unsure);

        entropy[x] = sum <= 0 ? 0 : sum;
    }
}
