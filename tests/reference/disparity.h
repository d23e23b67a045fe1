/* tests/reference/disparity.h - design.md, 5.2 and 5.8, written down plainly. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_REFERENCE_DISPARITY_H
#define SST_TESTS_REFERENCE_DISPARITY_H

#include <stdlib.h>

#include "pipeline/kernels/kernels.h"
#include "tests/reference/wide.h"

/** Place of the minimum of the parabola through (-1, before), (0, at), (1, after), in steps; 0 where it is flat. */
static inline wide ref_parabola(int before, int at, int after)
{
    const wide curvature = (wide)before - 2 * (wide)at + after;

    return curvature > 0 ? ((wide)before - after) / (2 * curvature) : 0;
}

/** sum_q D(q) g / sum_q g over the 7x7 pixels around x, less those of other disparities or colours; 1/64 px. */
static inline wide ref_bilateral(const uint16_t *const disp[7], const uint8_t *const luma[7], const int16_t *weight,
                                 int tau, ptrdiff_t x)
{
    wide sum = 0, total = 0;

    for (int k = 0; k < 49; k++) {
        const ptrdiff_t i = x + k % 7 - 3;

        if (disp[k / 7][i] == 65535 || abs(disp[k / 7][i] - disp[3][x]) > SST_BILATERAL_STEP_Q6 ||
            abs(luma[k / 7][i] - luma[3][x]) >= tau)
            continue;
        sum += (wide)weight[k] * disp[k / 7][i];
        total += weight[k];
    }
    return sum / total;
}

/** One Gauss-Newton step's sums (5.8) for the pixel (x, y): weight and product, px. */
static inline void ref_subpixel(wide *weight, wide *product, int d, const struct sst_subpixel_fit *f, int x, int y)
{
    const uint32_t *own = f->own.pixels + y * f->own.stride + x;
    const ptrdiff_t down = f->own.stride;
    wide gx = 0, gy = 0, ss = 0, sr = 0;

    for (int i = -f->across; i <= f->across; i++) {
        const wide share = (f->across ? 2 - abs(i) : 4) / (wide)8;

        gx += share * ((wide)(own[1 + i * down] & 255) - (own[i * down - 1] & 255));
        gy += share * ((wide)(own[down + i] & 255) - (own[i - down] & 255));
    }
    for (int k = 0; k < f->views; k++) {
        const struct sst_subpixel_view *v = &f->view[k];
        const int64_t px = (int64_t)v->x + (int64_t)d * v->dx, py = (int64_t)v->y + (int64_t)d * v->dy;
        const int xv = x + (int)(px >> 16), yv = y + (int)(py >> 16);
        const wide fx = (wide)(px & 65535) / 65536, fy = (wide)(py & 65535) / 65536;
        const uint32_t *at = v->view.pixels + yv * v->view.stride + xv, *below = at + v->view.stride;
        const wide slope = gx * (wide)v->bx + gy * (wide)v->by;
        wide r, w;

        if (xv < 0 || yv < 0 || xv + 1 >= f->width || yv + 1 >= f->height || (int)(at[0] >> 16) > d + f->tolerance ||
            (int)(below[0] >> 16) > d + f->tolerance)
            continue;
        r = (1 - fy) * ((1 - fx) * (at[0] & 255) + fx * (at[0] >> 8 & 255)) +
            fy * ((1 - fx) * (below[0] & 255) + fx * (below[0] >> 8 & 255));
        r = r * (wide)v->gain + (wide)v->offset - (own[0] & 255);
        w = fmaxl(1 - fabsl(r) * (wide)f->inverse_limit, 0);
        ss += w * slope * slope;
        sr += w * slope * r;
    }
    *weight = ss;
    *product = ss * d / 64 + sr;
}

#endif
