/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
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

/* Gradient of the luma along `step`: mean of the pixel's and of its neighbours' ones across it, exact. */
static float slope_along(const uint32_t *own, ptrdiff_t step, ptrdiff_t across)
{
    const float before = level(own[step - across]) - level(own[-step - across]);
    const float here = level(own[step]) - level(own[-step]);
    const float after = level(own[step + across]) - level(own[across - step]);

    return (before + 2 * here + after) * 0.125f;
}

static void fit_pixel(float *weight, float *product, int d, const struct sst_subpixel_fit *f, const int xy[2])
{
    const int x = xy[0], y = xy[1];
    const uint32_t *own = f->own.pixels + y * f->own.stride + x;
    const float gx = slope_along(own, 1, f->across ? f->own.stride : 0);
    const float gy = slope_along(own, f->own.stride, f->across);
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
                const ptrdiff_t at = x + i * w->stride + j;
                const float off = w->slope[1][x] * (float)i + w->slope[0][x] * (float)j;

                if (!similar(w->colour[at], w->colour[x], w->similar) ||
                    fabsf((float)(w->disp[at] - w->disp[x]) * (1 / 64.0f) - off) > w->apart)
                    continue;
                weight[x] += w->weight[at];
                product[x] += w->product[at] - w->weight[at] * off;
            }
        }
    }
}

/* Sums over a window: of weights, of positions (in steps) and their products, of heights above the plane. */
struct moments {
    float n, x, y, xx, xy, yy, z, xz, yz;
};

static void add_row(struct moments *m, const struct sst_subpixel_planes *p, ptrdiff_t x, int i, const float plane[3])
{
    const ptrdiff_t row = x + i * SST_SUBPIXEL_STEP * p->stride;
    const float middle = plane[0] + plane[2] * (float)(i * SST_SUBPIXEL_STEP);
    struct moments r = { 0 };

    for (int j = -3; j <= 3; j++) {
        const ptrdiff_t at = row + j * SST_SUBPIXEL_STEP;
        const float above = p->disp[at] - (middle + plane[1] * (float)(j * SST_SUBPIXEL_STEP)), w = p->weight[at];

        if (!similar(p->colour[at], p->colour[x], p->similar) || fabsf(above) > p->apart)
            continue;
        r.n += w;
        r.x += w * (float)j;
        r.xx += w * (float)(j * j);
        r.z += w * above;
        r.xz += w * above * (float)j;
    }
    m->n += r.n;
    m->x += r.x;
    m->y += r.n * (float)i;
    m->xx += r.xx;
    m->xy += r.x * (float)i;
    m->yy += r.n * (float)(i * i);
    m->z += r.z;
    m->xz += r.xz;
    m->yz += r.z * (float)i;
}

void sst_subpixel_plane_row_ref(float *disp, float *const slope[2], const struct sst_subpixel_planes *p, size_t n)
{
    for (ptrdiff_t x = 0; x < (ptrdiff_t)n; x++) {
        const float plane[3] = { p->disp[x], slope[0][x], slope[1][x] };
        float each, mx, my, mz, xx, xy, yy, xz, yz, u, v;
        struct moments m = { 0 };

        for (int i = -3; i <= 3; i++)
            add_row(&m, p, x, i, plane);
        m.n = m.n > 0 ? m.n : 1;
        each = 1 / m.n;
        mx = m.x * each;
        my = m.y * each;
        mz = m.z * each;
        xx = m.xx - m.x * mx + m.n * SST_SUBPIXEL_RIDGE;
        xy = m.xy - m.x * my;
        yy = m.yy - m.y * my + m.n * SST_SUBPIXEL_RIDGE;
        xz = m.xz - m.x * mz;
        yz = m.yz - m.y * mz;
        each = 1 / (xx * yy - xy * xy);
        u = (xz * yy - yz * xy) * each;
        v = (yz * xx - xz * xy) * each;
        disp[x] = plane[0] + (mz - u * mx - v * my);
        slope[0][x] = plane[1] + u * (1.0f / SST_SUBPIXEL_STEP);
        slope[1][x] = plane[2] + v * (1.0f / SST_SUBPIXEL_STEP);
    }
}
