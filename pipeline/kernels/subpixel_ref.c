#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "pipeline/kernels/kernels.h"

static float level(uint32_t pixel)
{
    return (float)(pixel & 255);
}

/* Interpolate the luma between four pixels. */
static float sample(const uint32_t *at, ptrdiff_t stride, float fx, float fy)
{
    const float a = level(at[0]), b = level(at[stride]);
    const float top = a + fx * (level(at[0] >> 8) - a), bottom = b + fx * (level(at[stride] >> 8) - b);

    return top + fy * (bottom - top);
}

static void fit_pixel(float *weight, float *product, int d, const struct sst_subpixel_fit *f, const int xy[2])
{
    const int x = xy[0], y = xy[1];
    const uint32_t *own = f->own.pixels + y * f->own.stride + x;
    const float gx = (level(own[1]) - level(own[-1])) * 0.5f;
    const float gy = (level(own[f->own.stride]) - level(own[-f->own.stride])) * 0.5f;
    float ss = 0, sr = 0;

    for (int k = 0; k < f->views; k++) {
        const struct sst_subpixel_view *v = &f->view[k];
        const int px = v->x + d * v->dx, py = v->y + d * v->dy, xv = x + (px >> 16), yv = y + (py >> 16);
        const uint32_t *at = v->view.pixels + yv * v->view.stride + xv;
        const float slope = gx * v->bx + gy * v->by;
        float r, w;

        if (xv < 0 || yv < 0 || xv + 1 >= f->width || yv + 1 >= f->height || (int)(at[0] >> 16) > d + f->tolerance ||
            (int)(at[v->view.stride] >> 16) > d + f->tolerance)
            continue;
        r = sample(at, v->view.stride, (float)(px & 65535) * (1 / 65536.0f), (float)(py & 65535) * (1 / 65536.0f));
        r = r * v->gain + v->offset - level(own[0]);
        w = fmaxf(1 - fabsf(r) * f->inverse_limit, 0);
        ss += w * slope * slope;
        sr += w * slope * r;
    }
    *weight = ss;
    *product = ss * ((float)d * (1 / 64.0f)) + sr;
}

void sst_subpixel_fit_row_ref(float *weight, float *product, const int32_t *disp, const struct sst_subpixel_fit *fit,
                              int y, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        weight[x] = product[x] = 0;
        if (disp[x] < SST_SUBPIXEL_NONE)
            fit_pixel(&weight[x], &product[x], disp[x], fit, (const int[]){ (int)x, y });
    }
}

static bool similar(uint32_t a, uint32_t b, int most)
{
    for (int shift = 0; shift < 24; shift += 8) {
        if (abs((int)(a >> shift & 255) - (int)(b >> shift & 255)) > most)
            return false;
    }
    return true;
}

void sst_subpixel_window_row_ref(float *weight, float *product, const struct sst_subpixel_window *w, size_t n)
{
    for (ptrdiff_t x = 0; x < (ptrdiff_t)n; x++) {
        weight[x] = product[x] = 0;
        for (int i = -2; i <= 2; i++) {
            for (int j = -2; j <= 2; j++) {
                const ptrdiff_t at = x + w->step * (i * w->stride + j);

                if (!similar(w->colour[at], w->colour[x], w->similar) || abs(w->disp[at] - w->disp[x]) > w->apart)
                    continue;
                weight[x] += w->weight[at];
                product[x] += w->product[at];
            }
        }
    }
}
