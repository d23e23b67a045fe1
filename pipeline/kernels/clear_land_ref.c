#include <math.h>

#include "pipeline/kernels/kernels.h"

void sst_clear_land_ref(uint16_t *landed, size_t stride, const struct sst_clear_view *v, int y)
{
    const uint16_t *disp = v->disp + (size_t)y * v->disp_stride;
    const uint8_t *state = v->state + (size_t)y * (size_t)v->width;

    for (int x = 0; x < v->width; x++) {
        const float q = disp[x];
        const int to_x = x + (int)floorf(q * v->x_q6 + v->x_0), to_y = y + (int)floorf(q * v->y_q6 + v->y_0);

        if (state[x] && to_x >= 0 && to_x < v->width && to_y >= 0 && to_y < v->height) {
            uint16_t *to = landed + (size_t)to_y * stride + to_x;
            const uint16_t stored = (uint16_t)(disp[x] + 1);

            *to = *to > stored ? *to : stored;
        }
    }
}
