#include "pipeline/kernels/simd.h"

/* subpixel_fit_row: blocks of SST_SUBPIXEL_BLOCK pixels, one view at a time. The last block of a row overlaps the one
 * before it. Not inlined: inside the caller compilers lose the restrict information and use the scalar path. */
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

#define SUBPIXEL_LANES ((size_t)SIMD_BYTES / 4)

/* Sums stay in registers; the last vector of pixels overlaps its predecessor. */
static void KERNEL(subpixel_window_row)(float *weight, float *product, const struct sst_subpixel_window *w, size_t n)
{
    const simd_s32 channels = simd_set_s32(sst_clamp_int(w->similar, 0, 255) * 0x010101);
    const simd_u8 similar = (simd_u8)(channels | (int32_t)0xFF000000);
    /* Differences from -apart to apart are the least numbers when `base` is added; all are below 2^29. */
    const int32_t apart = sst_clamp_int(w->apart, 0, 1 << 29), most = INT32_MIN + 2 * apart;
    const uint32_t base = (uint32_t)apart + 0x80000000;

    if (n < SUBPIXEL_LANES || w->similar < 0 || w->apart < 0) {
        sst_subpixel_window_row_ref(weight, product, w, n);
        return;
    }
    for (size_t x = 0; x < n; x += SUBPIXEL_LANES) {
        simd_f32 sum = simd_set_f32(0), products = sum;
        simd_u8 colour;
        simd_u32 disp;

        x = x < n - SUBPIXEL_LANES ? x : n - SUBPIXEL_LANES;
        colour = simd_load_u8((const uint8_t *)(w->colour + x));
        disp = (simd_u32)simd_load_s32(w->disp + x) - base;
        for (int i = -2; i <= 2; i++) {
            ptrdiff_t at = (ptrdiff_t)x + w->step * (i * w->stride - 2);

            for (int j = -2; j <= 2; j++, at += w->step) {
                const simd_u8 off = simd_apart_u8(simd_load_u8((const uint8_t *)(w->colour + at)), colour);
                const simd_s32 beyond = (simd_s32)simd_less_u8(off, similar);
                const simd_s32 step = (simd_s32)((simd_u32)simd_load_s32(w->disp + at) - disp);
                const simd_s32 counts = (simd_s32)(beyond == 0) & (simd_s32)(step <= most);

                sum += (simd_f32)((simd_s32)simd_load_f32(w->weight + at) & counts);
                products += (simd_f32)((simd_s32)simd_load_f32(w->product + at) & counts);
            }
        }
        simd_store_f32(weight + x, sum);
        simd_store_f32(product + x, products);
    }
}
#undef SUBPIXEL_LANES
