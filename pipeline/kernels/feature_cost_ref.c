#include "pipeline/kernels/kernels.h"

void sst_feature_cost_row_ref(uint8_t *cost, const int8_t *a, const int8_t *b, size_t stride, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        int dot = 0, c;

        for (size_t k = 0; k < 32; k++) {
            dot += a[k * stride + 2 * x] * b[k * stride + 2 * x];
            dot += a[k * stride + 2 * x + 1] * b[k * stride + 2 * x + 1];
        }
        c = (SST_FEATURE_ONE * SST_FEATURE_ONE - dot) >> SST_FEATURE_SHIFT;
        cost[x] = (uint8_t)(c < 0 ? 0 : c > SST_COST_MAX ? SST_COST_MAX : c);
    }
}
