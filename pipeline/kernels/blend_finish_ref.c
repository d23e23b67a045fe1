#include "pipeline/kernels/kernels.h"

void sst_blend_finish_ref(uint8_t *out, const float *sum, const float *weight, size_t n)
{
    for (size_t x = 0; x < n; x++)
        out[x] = weight[x] < SST_BLEND_FLOOR ? 0 : (uint8_t)(sum[x] / weight[x] + 0.5f);
}
