/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "pipeline/kernels/kernels.h"

static void mean(float colour[3], const struct sst_clear_rays *rays, int i)
{
    float sum[3] = { 0, 0, 0 }, total = 0;

    for (int k = 0; k < rays->slots; k++) {
        const float w = rays->weight[k][i] * rays->agree[k][i];

        for (int c = 0; c < 3; c++)
            sum[c] += w * rays->colour[c][k][i];
        total += w;
    }
    for (int c = 0; c < 3; c++)
        colour[c] = total > 0 ? sum[c] / total : 0;
}

/* Sum of a ray's deviations in R, G and B. */
static float deviation(const struct sst_clear_rays *rays, int k, int i, const float colour[3])
{
    return fabsf(rays->colour[0][k][i] - colour[0]) + fabsf(rays->colour[1][k][i] - colour[1]) +
           fabsf(rays->colour[2][k][i] - colour[2]);
}

static float largest_deviation(const struct sst_clear_rays *rays, int i, const float colour[3])
{
    float largest = 0;

    for (int k = 0; k < rays->slots; k++)
        if (rays->weight[k][i] > 0)
            largest = fmaxf(largest, deviation(rays, k, i, colour));
    return largest;
}

/* Colour of the rays that agree, and their agreement. */
static void blend(float colour[3], const struct sst_clear_rays *rays, int i)
{
    static const float half_weight[2] = { 20, 10 };

    for (int k = 0; k < rays->slots; k++)
        rays->agree[k][i] = 1;
    mean(colour, rays, i);
    if (largest_deviation(rays, i, colour) <= 3 * 4)
        return;
    for (int step = 0; step < 2; step++) {
        const float scale = 1 / (3 * half_weight[step]);

        for (int k = 0; k < rays->slots; k++) {
            const float t = deviation(rays, k, i, colour) * scale, t2 = t * t;

            rays->agree[k][i] = 1 / (1 + t2 * t2);
        }
        mean(colour, rays, i);
    }
}

void sst_clear_blend_ref(struct sst_clear_colours *out, const struct sst_clear_rays *rays, int own)
{
    for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
        float colour[3], share = 0, weight = 0, support = 0;

        blend(colour, rays, i);
        for (int k = 0; k < rays->slots; k++) {
            weight += rays->weight[k][i];
            support += rays->weight[k][i] * rays->agree[k][i];
        }
        if (own >= 0 && rays->weight[own][i] >= 1)
            share = fminf(fmaxf(2 - deviation(rays, own, i, colour) / (3 * 10), 0), 1);
        for (int c = 0; c < 3; c++)
            out->colour[c][i] = own >= 0 ? colour[c] + share * (rays->colour[c][own][i] - colour[c]) : colour[c];
        out->weight[i] = weight;
        out->support[i] = support;
        out->own[i] = share;
    }
}
