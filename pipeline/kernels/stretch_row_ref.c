#include "pipeline/kernels/kernels.h"

void sst_stretch_row_ref(float *out, const float *row, const int32_t *left, const float *part, size_t n)
{
    for (size_t x = 0; x < n; x++)
        out[x] = row[left[x]] + part[x] * (row[left[x] + 1] - row[left[x]]);
}
