/* subpixel_fit_row, subpixel_window_row: blocks of SST_SUBPIXEL_BLOCK pixels, one view or one pixel of the window at a
 * time. The last block of a row overlaps the one before it. Not inlined: inside the caller compilers lose the restrict
 * information and use the scalar path. */
static SST_NOINLINE void KERNEL(subpixel_view)(float *restrict ss, float *restrict sr, const int32_t *restrict disp,
                                               const float *restrict gx, const float *restrict gy,
                                               const float *restrict own, const struct sst_subpixel_view *v,
                                               const struct sst_subpixel_fit *f, int x0, int y)
{
    const uint32_t *restrict top = v->view.pixels, *restrict bottom = v->view.pixels + v->view.stride;
    const int stride = (int)v->view.stride, across = f->width - 1, down = f->height - 1;
    const int x_q16 = v->x, y_q16 = v->y, dx = v->dx, dy = v->dy, tolerance = f->tolerance;
    const float bx = v->bx, by = v->by, gain = v->gain, offset = v->offset, inverse = f->inverse_limit;

    for (int x = 0; x < SST_SUBPIXEL_BLOCK; x++) {
        const int d = disp[x] & (SST_SUBPIXEL_NONE - 1), px = x_q16 + d * dx, py = y_q16 + d * dy;
        const int xv = x0 + x + (px >> 16), yv = y + (py >> 16);
        const int inside = (xv >= 0) & (yv >= 0) & (xv < across) & (yv < down);
        const int xc = sst_clamp_int(xv, 0, across), yc = sst_clamp_int(yv, 0, down - 1), at = yc * stride + xc;
        const uint32_t a = top[at], b = bottom[at];
        const int front = d + tolerance, hides = ((int)(a >> 16) > front) | ((int)(b >> 16) > front);
        const float fx = (float)(px & 65535) * (1 / 65536.0f), fy = (float)(py & 65535) * (1 / 65536.0f);
        const float a0 = (float)(int)(a & 255), a1 = (float)(int)(a >> 8 & 255);
        const float b0 = (float)(int)(b & 255), b1 = (float)(int)(b >> 8 & 255);
        const float above = a0 + fx * (a1 - a0), below = b0 + fx * (b1 - b0);
        const float r = (above + fy * (below - above)) * gain + offset - own[x];
        const float slope = gx[x] * bx + gy[x] * by, left = 1 - fabsf(r) * inverse;
        const float w = inside & !hides ? (left > 0 ? left : 0) : 0;

        ss[x] += w * slope * slope;
        sr[x] += w * slope * r;
    }
}

static SST_NOINLINE void KERNEL(subpixel_gradient)(float *restrict gx, float *restrict gy, float *restrict own,
                                                   const uint32_t *restrict at, ptrdiff_t stride)
{
    for (int x = 0; x < SST_SUBPIXEL_BLOCK; x++) {
        own[x] = (float)(int)(at[x] & 255);
        gx[x] = ((float)(int)(at[x + 1] & 255) - (float)(int)(at[x - 1] & 255)) * 0.5f;
        gy[x] = ((float)(int)(at[x + stride] & 255) - (float)(int)(at[x - stride] & 255)) * 0.5f;
    }
}

static SST_NOINLINE void KERNEL(subpixel_finish)(float *restrict weight, float *restrict product,
                                                 const float *restrict ss, const float *restrict sr,
                                                 const int32_t *restrict disp)
{
    for (int x = 0; x < SST_SUBPIXEL_BLOCK; x++) {
        const float known = disp[x] < SST_SUBPIXEL_NONE ? 1 : 0;

        weight[x] = ss[x] * known;
        product[x] = (ss[x] * ((float)disp[x] * (1 / 64.0f)) + sr[x]) * known;
    }
}

static void KERNEL(subpixel_fit_row)(float *weight, float *product, const int32_t *disp,
                                     const struct sst_subpixel_fit *f, int y, size_t n)
{
    float gx[SST_SUBPIXEL_BLOCK], gy[SST_SUBPIXEL_BLOCK], own[SST_SUBPIXEL_BLOCK];
    float ss[SST_SUBPIXEL_BLOCK], sr[SST_SUBPIXEL_BLOCK];

    if (n < SST_SUBPIXEL_BLOCK) {
        sst_subpixel_fit_row_ref(weight, product, disp, f, y, n);
        return;
    }
    for (size_t x = 0; x < n; x += SST_SUBPIXEL_BLOCK) {
        x = x < n - SST_SUBPIXEL_BLOCK ? x : n - SST_SUBPIXEL_BLOCK;
        KERNEL(subpixel_gradient)(gx, gy, own, f->own.pixels + y * f->own.stride + (ptrdiff_t)x, f->own.stride);
        memset(ss, 0, sizeof(ss));
        memset(sr, 0, sizeof(sr));
        for (int k = 0; k < f->views; k++)
            KERNEL(subpixel_view)(ss, sr, disp + x, gx, gy, own, &f->view[k], f, (int)x, y);
        KERNEL(subpixel_finish)(weight + x, product + x, ss, sr, disp + x);
    }
}

#if defined(__aarch64__)
#include "pipeline/kernels/arm/subpixel_tmpl.h"
#else
static SST_NOINLINE void KERNEL(subpixel_tap)(float *restrict weight, float *restrict product,
                                              const struct sst_subpixel_window *w, ptrdiff_t x, ptrdiff_t move)
{
    const uint32_t *restrict a = w->colour + x, *restrict b = w->colour + x + move;
    const int32_t *restrict da = w->disp + x, *restrict db = w->disp + x + move;
    const float *restrict from_weight = w->weight + x + move, *restrict from_product = w->product + x + move;
    const int similar = w->similar, apart = w->apart;

    for (int i = 0; i < SST_SUBPIXEL_BLOCK; i++) {
        const int red = (int)(a[i] & 255) - (int)(b[i] & 255), green = (int)(a[i] >> 8 & 255) - (int)(b[i] >> 8 & 255);
        const int blue = (int)(a[i] >> 16 & 255) - (int)(b[i] >> 16 & 255), step = da[i] - db[i];
        const int counts = (red <= similar) & (red >= -similar) & (green <= similar) & (green >= -similar) &
                           (blue <= similar) & (blue >= -similar) & (step <= apart) & (step >= -apart);
        const float more = from_weight[i], more_product = from_product[i];

        weight[i] += counts ? more : 0;
        product[i] += counts ? more_product : 0;
    }
}

static void KERNEL(subpixel_window_row)(float *weight, float *product, const struct sst_subpixel_window *w, size_t n)
{
    if (n < SST_SUBPIXEL_BLOCK) {
        sst_subpixel_window_row_ref(weight, product, w, n);
        return;
    }
    for (size_t x = 0; x < n; x += SST_SUBPIXEL_BLOCK) {
        x = x < n - SST_SUBPIXEL_BLOCK ? x : n - SST_SUBPIXEL_BLOCK;
        memset(weight + x, 0, SST_SUBPIXEL_BLOCK * sizeof(*weight));
        memset(product + x, 0, SST_SUBPIXEL_BLOCK * sizeof(*product));
        for (int i = -2; i <= 2; i++) {
            for (int j = -2; j <= 2; j++)
                KERNEL(subpixel_tap)(weight + x, product + x, w, (ptrdiff_t)x, w->step * (i * w->stride + j));
        }
    }
}
#endif
