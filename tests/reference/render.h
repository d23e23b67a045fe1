/* tests/reference/render.h - design.md, 5.4 and 5.6, written down plainly. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_REFERENCE_RENDER_H
#define SST_TESTS_REFERENCE_RENDER_H

#include "pipeline/kernels/kernels.h"
#include "tests/reference/wide.h"

/** W_d = (1 - C1) exp(-(d_f - d_r)^2 / 2 sigma^2) + C1. */
static inline wide ref_weight_depth(wide focus, wide disp, wide sigma, wide c1)
{
    const wide z = (focus - disp) / sigma;

    return (1 - c1) * expl(-z * z / 2) + c1;
}

/** W_s = (1 - C2) max(0, -(d_f - Dmin)(d_f - Dmax) / ((Dmax - Dmin) / 2)^2) + C2, a range below the quantum widened. */
static inline quad ref_weight_label(quad focus, quad lo, quad hi, quad quantum, quad c2)
{
    const quad middle = (lo + hi) / 2, half = (hi - lo > quantum ? hi - lo : quantum) / 2;
    const quad u = -(focus - (middle - half)) * (focus - (middle + half)) / (half * half);

    return (1 - c2) * (u > 0 ? u : 0) + c2;
}

/** Colour between four pixels. */
static inline wide ref_bilinear(const uint8_t *top, const uint8_t *bottom, wide fx, wide fy)
{
    return (1 - fy) * ((1 - fx) * top[0] + fx * top[1]) + fy * ((1 - fx) * bottom[0] + fx * bottom[1]);
}

/** Weighted mean of the colours of n rays, each with its agreement, in one channel. */
static inline wide ref_clear_mean(const struct sst_clear_rays *rays, const wide *agree, int channel, int i)
{
    wide sum = 0, total = 0;

    for (int k = 0; k < rays->slots; k++) {
        const wide w = (wide)rays->weight[k][i] * agree[k];

        sum += w * (wide)rays->colour[channel][k][i];
        total += w;
    }
    return total > 0 ? sum / total : 0;
}

/** Largest deviation of a ray from a colour, R + G + B. */
static inline wide ref_clear_deviation(const struct sst_clear_rays *rays, int k, int i, const wide colour[3])
{
    wide sum = 0;

    for (int c = 0; c < 3; c++)
        sum += fabsl((wide)rays->colour[c][k][i] - colour[c]);
    return sum;
}

/**
 * Colour of the rays that agree (5.6, 3), without an own camera: two steps of weights 1 / (1 + t^4).
 * @return largest deviation from the plain mean: 12 levels decide whether there are steps at all
 */
static inline wide ref_clear_blend(wide colour[3], const struct sst_clear_rays *rays, int i)
{
    static const int half_weight[2] = { 20, 10 };
    wide agree[64], most = 0;

    for (int k = 0; k < rays->slots; k++)
        agree[k] = 1;
    for (int c = 0; c < 3; c++)
        colour[c] = ref_clear_mean(rays, agree, c, i);
    for (int k = 0; k < rays->slots; k++)
        most = rays->weight[k][i] > 0 ? fmaxl(most, ref_clear_deviation(rays, k, i, colour)) : most;
    for (int step = 0; step < 2 && most > 12; step++) {
        for (int k = 0; k < rays->slots; k++) {
            const wide t = ref_clear_deviation(rays, k, i, colour) / (3 * half_weight[step]);

            agree[k] = 1 / (1 + t * t * t * t);
        }
        for (int c = 0; c < 3; c++)
            colour[c] = ref_clear_mean(rays, agree, c, i);
    }
    return most;
}

#endif
