#include "pipeline/kernels/kernels.h"

void sst_disp_span_ref(uint16_t span[2], const uint16_t *disp, int end, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        if (disp[x] < span[0])
            span[0] = disp[x];
        if (disp[x] < end && disp[x] > span[1])
            span[1] = disp[x];
    }
}
