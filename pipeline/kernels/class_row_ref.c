/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <float.h>

#include "pipeline/kernels/kernels.h"
#include "pipeline/kernels/log_pos.h"

static float plogp(float p)
{
    return p * sst_log_pos(p > FLT_MIN ? p : FLT_MIN);
}

void sst_class_row_ref(uint8_t *top, float *entropy, const float *p, size_t stride, size_t count, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        float rest = 0, h = 0;
        size_t best = 0;

        for (size_t c = 1; c < count; c++)
            best = p[c * stride + x] > p[best * stride + x] ? c : best;
        top[x] = (uint8_t)best;
        for (size_t c = 0; entropy && c < count; c++) {
            const float v = c == best ? 0 : p[c * stride + x];

            rest += v;
            h -= plogp(v);
        }
        if (entropy) {
            /* log(1 - r) = -2 atanh(r / (2 - r)) */
            h -= rest < 0.5f ? (1 - rest) * sst_atanh2(-rest / (2 - rest)) : plogp(p[best * stride + x]);
            entropy[x] = h <= 0 ? 0 : h; /* what is no number stays so, and is never kept */
        }
    }
}
