/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
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

/* `across` is the stride or 0, `beside` 1 or 0. */
static SST_NOINLINE void KERNEL(subpixel_gradient)(float *restrict gx, float *restrict gy, float *restrict own,
                                                   const uint32_t *restrict at, ptrdiff_t stride, ptrdiff_t across,
                                                   ptrdiff_t beside)
{
    const uint32_t *restrict above = at - across, *restrict below = at + across;
    const uint32_t *restrict up = at - stride, *restrict down = at + stride;

    for (ptrdiff_t x = 0; x < SST_SUBPIXEL_BLOCK; x++) {
        const int right = (int)((above[x + 1] & 255) + 2 * (at[x + 1] & 255) + (below[x + 1] & 255));
        const int left = (int)((above[x - 1] & 255) + 2 * (at[x - 1] & 255) + (below[x - 1] & 255));
        const int lower = (int)((down[x - beside] & 255) + 2 * (down[x] & 255) + (down[x + beside] & 255));
        const int upper = (int)((up[x - beside] & 255) + 2 * (up[x] & 255) + (up[x + beside] & 255));

        own[x] = (float)(int)(at[x] & 255);
        gx[x] = (float)(right - left) * 0.125f;
        gy[x] = (float)(lower - upper) * 0.125f;
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
        KERNEL(subpixel_gradient)
        (gx, gy, own, f->own.pixels + y * f->own.stride + (ptrdiff_t)x, f->own.stride, f->across ? f->own.stride : 0,
         f->across ? 1 : 0);
        memset(ss, 0, sizeof(ss));
        memset(sr, 0, sizeof(sr));
        for (int k = 0; k < f->views; k++)
            KERNEL(subpixel_view)(ss, sr, disp + x, gx, gy, own, &f->view[k], f, (int)x, y);
        KERNEL(subpixel_finish)(weight + x, product + x, ss, sr, disp + x);
    }
}

#define SUBPIXEL_LANES ((size_t)SIMD_BYTES / 4)

/* Lanes of colours that differ by more than `similar`, a byte a channel, are not 0. */
static inline simd_s32 KERNEL(subpixel_unlike)(const uint32_t *at, simd_u8 colour, simd_u8 similar)
{
    return (simd_s32)simd_less_u8(simd_apart_u8(simd_load_u8((const uint8_t *)at), colour), similar);
}

static inline simd_u8 KERNEL(subpixel_similar)(int similar)
{
    return (simd_u8)(simd_set_s32(sst_clamp_int(similar, 0, 255) * 0x010101) | (int32_t)0xFF000000);
}

static inline simd_s32 KERNEL(subpixel_within)(simd_f32 v, float most)
{
    return (simd_s32)((simd_f32)((simd_s32)v & INT32_MAX) <= most);
}

/* Sums stay in registers; the last vector of pixels overlaps its predecessor. */
static void KERNEL(subpixel_window_row)(float *weight, float *product, const struct sst_subpixel_window *w, size_t n)
{
    const simd_u8 similar = KERNEL(subpixel_similar)(w->similar);

    if (n < SUBPIXEL_LANES || w->similar < 0) {
        sst_subpixel_window_row_ref(weight, product, w, n);
        return;
    }
    for (size_t x = 0; x < n; x += SUBPIXEL_LANES) {
        simd_f32 sum = simd_set_f32(0), products = sum, right, down;
        simd_u8 colour;
        simd_s32 disp;

        x = x < n - SUBPIXEL_LANES ? x : n - SUBPIXEL_LANES;
        colour = simd_load_u8((const uint8_t *)(w->colour + x));
        disp = simd_load_s32(w->disp + x);
        right = simd_load_f32(w->slope[0] + x);
        down = simd_load_f32(w->slope[1] + x);
        for (int i = -2; i <= 2; i++) {
            const ptrdiff_t row = (ptrdiff_t)x + i * w->stride;

            for (int j = -2; j <= 2; j++) {
                const simd_s32 unlike = KERNEL(subpixel_unlike)(w->colour + row + j, colour, similar);
                const simd_s32 step = simd_load_s32(w->disp + row + j) - disp;
                const simd_f32 off = down * (float)i + right * (float)j;
                const simd_f32 above = __builtin_convertvector(step, simd_f32) * (1 / 64.0f) - off;
                const simd_s32 counts = (simd_s32)(unlike == 0) & KERNEL(subpixel_within)(above, w->apart);
                const simd_f32 each = simd_load_f32(w->weight + row + j);

                sum += (simd_f32)((simd_s32)each & counts);
                products += (simd_f32)((simd_s32)(simd_load_f32(w->product + row + j) - each * off) & counts);
            }
        }
        simd_store_f32(weight + x, sum);
        simd_store_f32(product + x, products);
    }
}

/* Planes of one vector of pixels. */
static inline void KERNEL(subpixel_planes)(float *disp, float *right, float *down, const struct sst_subpixel_planes *p,
                                           ptrdiff_t at, simd_u8 similar)
{
    const simd_u8 colour = simd_load_u8((const uint8_t *)(p->colour + at));
    const simd_f32 here = simd_load_f32(p->disp + at), gx = simd_load_f32(right), gy = simd_load_f32(down);
    simd_f32 n = simd_set_f32(0), x = n, y = n, xx = n, xy = n, yy = n, z = n, xz = n, yz = n, each, mx, my, mz, u, v;

    for (int i = -3; i <= 3; i++) {
        const ptrdiff_t row = at + i * SST_SUBPIXEL_STEP * p->stride;
        const simd_f32 middle = here + gy * (float)(i * SST_SUBPIXEL_STEP);
        simd_f32 rn = simd_set_f32(0), rx = rn, rxx = rn, rz = rn, rxz = rn;

        for (int j = -3; j <= 3; j++) {
            const ptrdiff_t to = row + j * SST_SUBPIXEL_STEP;
            const simd_f32 above = simd_load_f32(p->disp + to) - (middle + gx * (float)(j * SST_SUBPIXEL_STEP));
            const simd_s32 unlike = KERNEL(subpixel_unlike)(p->colour + to, colour, similar);
            const simd_s32 counts = (simd_s32)(unlike == 0) & KERNEL(subpixel_within)(above, p->apart);
            const simd_f32 w = (simd_f32)((simd_s32)simd_load_f32(p->weight + to) & counts);
            const simd_f32 wz = w * above;

            rn += w;
            rz += wz;
            if (j) { /* else nothing is added */
                rx += w * (float)j;
                rxx += w * (float)(j * j);
                rxz += wz * (float)j;
            }
        }
        n += rn;
        x += rx;
        y += rn * (float)i;
        xx += rxx;
        xy += rx * (float)i;
        yy += rn * (float)(i * i);
        z += rz;
        xz += rxz;
        yz += rz * (float)i;
    }
    n += (simd_f32)((simd_s32)simd_set_f32(1) & (simd_s32)(n <= 0));
    each = 1 / n;
    mx = x * each;
    my = y * each;
    mz = z * each;
    xx = xx - x * mx + n * SST_SUBPIXEL_RIDGE;
    xy = xy - x * my;
    yy = yy - y * my + n * SST_SUBPIXEL_RIDGE;
    xz = xz - x * mz;
    yz = yz - y * mz;
    each = 1 / (xx * yy - xy * xy);
    u = (xz * yy - yz * xy) * each;
    v = (yz * xx - xz * xy) * each;
    simd_store_f32(disp, here + (mz - u * mx - v * my));
    simd_store_f32(right, gx + u * (1.0f / SST_SUBPIXEL_STEP));
    simd_store_f32(down, gy + v * (1.0f / SST_SUBPIXEL_STEP));
}

/* The slopes are in and out: the last pixels, fewer than a vector, are the reference's. */
static void KERNEL(subpixel_plane_row)(float *disp, float *const slope[2], const struct sst_subpixel_planes *p,
                                       size_t n)
{
    const simd_u8 similar = KERNEL(subpixel_similar)(p->similar);
    struct sst_subpixel_planes rest = *p;
    size_t x = 0;

    for (; p->similar >= 0 && x + SUBPIXEL_LANES <= n; x += SUBPIXEL_LANES)
        KERNEL(subpixel_planes)(disp + x, slope[0] + x, slope[1] + x, p, (ptrdiff_t)x, similar);
    rest.colour += x;
    rest.disp += x;
    rest.weight += x;
    sst_subpixel_plane_row_ref(disp + x, (float *const[]){ slope[0] + x, slope[1] + x }, &rest, n - x);
}
#undef SUBPIXEL_LANES
