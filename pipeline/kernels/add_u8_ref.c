#include "pipeline/kernels/kernels.h"

void sst_add_u8_ref(uint16_t *sum, const uint8_t *row, size_t n)
{
    for (size_t i = 0; i < n; i++)
        sum[i] = (uint16_t)(sum[i] + row[i]);
}
