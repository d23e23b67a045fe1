#include <math.h>

#include "pipeline/kernels/kernels.h"

struct landed {
    int i; /* pixel of the block */
    unsigned landed;
};

static void bilinear(float colour[3], const struct sst_clear_view *v, float x, float y)
{
    const int x0 = (int)x, y0 = (int)y;
    const int xp = (int)((x - (float)x0) * 64 + 0.5F), yp = (int)((y - (float)y0) * 64 + 0.5F);

    for (int c = 0; c < 3 && v->plane[c]; c++) {
        const uint8_t *top = v->plane[c] + (size_t)y0 * v->stride + x0;
        const uint8_t *bottom = yp ? top + v->stride : top;
        const int right = xp != 0;
        const int upper = 64 * top[0] + xp * (top[right] - top[0]);
        const int lower = 64 * bottom[0] + xp * (bottom[right] - bottom[0]);

        colour[c] = (float)(64 * upper + yp * (lower - upper)) * (1.0F / 4096);
    }
}

/* Weight of the ray of pixel (xy[0], xy[1]), the i-th of the block. */
static float take(float colour[3], const struct sst_clear_rays *rays, const struct sst_clear_view *v, const float xy[2],
                  const struct landed *l)
{
    const int i = l->i;
    const unsigned landed = l->landed;
    const float at_x = xy[0] - rays->px[i] * v->bx, at_y = xy[1] - rays->px[i] * v->by;

    if (landed / 2 < rays->first[i] || landed / 2 > rays->last[i] || rays->wanted[i] <= 0 || !(at_x >= 0) ||
        !(at_y >= 0) || at_x > (float)(v->width - 1) || at_y > (float)(v->height - 1))
        return 0;
    bilinear(colour, v, at_x, at_y);
    return landed % 2 ? 1 : SST_CLEAR_RIM;
}

int sst_clear_take_ref(struct sst_clear_rays *rays, const struct sst_clear_view *v, const uint16_t *landed, int x,
                       int y)
{
    const int slot = rays->slots;
    int any = 0, more = 0;

    for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
        float colour[3] = { 0, 0, 0 };
        const float w =
            take(colour, rays, v, (const float[]){ (float)(x + i), (float)y }, &(struct landed){ i, landed[i] });

        rays->weight[slot][i] = w;
        for (int c = 0; c < 3; c++)
            rays->colour[c][slot][i] = colour[c];
        rays->wanted[i] = (int16_t)(rays->wanted[i] - (w >= 1));
        any |= w > 0;
        more |= rays->wanted[i] > 0;
    }
    rays->slots += any;
    return more;
}
