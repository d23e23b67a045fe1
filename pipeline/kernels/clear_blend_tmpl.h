/* Colours of clear pictures from the rays of a surface (clear_blend_ref.c), in vectors of any level. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/simd.h"

#define CLEAR_LANES (SIMD_BYTES / 4)

/* Sums of colours times weights, and of the weights. */
struct KERNEL(clear_sums) {
    simd_f32 colour[3], weight;
};

static inline void KERNEL(clear_sum)(struct KERNEL(clear_sums) * sum, const struct sst_clear_rays *rays, int k, int i,
                                     simd_f32 weight)
{
    for (int c = 0; c < 3; c++)
        sum->colour[c] += weight * simd_load_f32(rays->colour[c][k] + i);
    sum->weight += weight;
}

static inline simd_f32 KERNEL(clear_pick)(simd_u32 m, simd_f32 yes, simd_f32 no)
{
    return (simd_f32)(((simd_u32)yes & m) | ((simd_u32)no & ~m));
}

static inline void KERNEL(clear_mean)(simd_f32 colour[3], const struct KERNEL(clear_sums) * sum)
{
    const simd_f32 one = simd_set_f32(1);
    const simd_f32 total = KERNEL(clear_pick)((simd_u32)(sum->weight > 0), sum->weight, one);

    for (int c = 0; c < 3; c++)
        colour[c] = sum->colour[c] / total;
}

/* Sum of the deviations of rays in R, G and B. */
static inline simd_f32 KERNEL(clear_deviation)(const struct sst_clear_rays *rays, int k, int i,
                                               const simd_f32 colour[3])
{
    simd_f32 off[3];

    for (int c = 0; c < 3; c++)
        off[c] = (simd_f32)((simd_u32)(simd_load_f32(rays->colour[c][k] + i) - colour[c]) & 0x7FFFFFFF);
    return off[0] + off[1] + off[2];
}

/* Agreement of rays by their deviations. */
static inline simd_f32 KERNEL(clear_agree)(simd_f32 off, float half_weight)
{
    const simd_f32 t = off * (1 / (3 * half_weight)), t2 = t * t;

    return 1 / (1 + t2 * t2);
}

/* Pixels where a ray differs; deviations are left in place of the rays' agreement. */
static inline simd_u32 KERNEL(clear_differ)(const struct sst_clear_rays *rays, int i, const simd_f32 colour[3])
{
    simd_u32 differ = { 0 };

    for (int k = 0; k < rays->slots; k++) {
        const simd_f32 off = KERNEL(clear_deviation)(rays, k, i, colour);

        differ |= (simd_u32)(off > 3 * 4) & (simd_u32)(simd_load_f32(rays->weight[k] + i) > 0);
        simd_store_f32(rays->agree[k] + i, off);
    }
    return differ;
}

/* The first step to the rays that agree, from their deviations, for pixels where one differs. */
static inline void KERNEL(clear_first)(const struct sst_clear_rays *rays, int i, simd_f32 colour[3], simd_u32 differ)
{
    struct KERNEL(clear_sums) sum = { 0 };
    simd_f32 next[3];

    for (int k = 0; k < rays->slots; k++) {
        const simd_f32 agree = KERNEL(clear_agree)(simd_load_f32(rays->agree[k] + i), 20);

        KERNEL(clear_sum)(&sum, rays, k, i, simd_load_f32(rays->weight[k] + i) * agree);
    }
    KERNEL(clear_mean)(next, &sum);
    for (int c = 0; c < 3; c++)
        colour[c] = KERNEL(clear_pick)(differ, next[c], colour[c]);
}

/* The second step, for pixels where a ray differs. Returns the sum of weights. */
static inline simd_f32 KERNEL(clear_second)(const struct sst_clear_rays *rays, int i, simd_f32 colour[3],
                                            simd_u32 differ)
{
    struct KERNEL(clear_sums) sum = { 0 };

    for (int k = 0; k < rays->slots; k++) {
        const simd_f32 of_ray = KERNEL(clear_agree)(KERNEL(clear_deviation)(rays, k, i, colour), 10);
        const simd_f32 agree = KERNEL(clear_pick)(differ, of_ray, simd_set_f32(1));

        simd_store_f32(rays->agree[k] + i, agree);
        KERNEL(clear_sum)(&sum, rays, k, i, simd_load_f32(rays->weight[k] + i) * agree);
    }
    KERNEL(clear_mean)(colour, &sum);
    return sum.weight;
}

/* Share of the viewpoint's own camera. */
static inline simd_f32 KERNEL(clear_own)(const struct sst_clear_rays *rays, int own, int i, const simd_f32 colour[3])
{
    const simd_f32 one = simd_set_f32(1), share = 2 - KERNEL(clear_deviation)(rays, own, i, colour) / (3 * 10);
    const simd_u32 less = (simd_u32)(share < one), seen = (simd_u32)(simd_load_f32(rays->weight[own] + i) >= one);

    return (simd_f32)((((simd_u32)share & less) | ((simd_u32)one & ~less)) & (simd_u32)(share > 0) & seen);
}

/* The colours of CLEAR_LANES pixels, the i-th and following of the block. */
static inline void KERNEL(clear_blend_lanes)(struct sst_clear_colours *out, const struct sst_clear_rays *rays, int own,
                                             int i)
{
    struct KERNEL(clear_sums) sum = { 0 };
    simd_f32 colour[3], share = { 0 }, support;
    simd_u32 differ;

    for (int k = 0; k < rays->slots; k++)
        KERNEL(clear_sum)(&sum, rays, k, i, simd_load_f32(rays->weight[k] + i));
    simd_store_f32(out->weight + i, sum.weight);
    support = sum.weight;
    KERNEL(clear_mean)(colour, &sum);
    differ = KERNEL(clear_differ)(rays, i, colour);
    if (simd_any_u32(differ)) {
        KERNEL(clear_first)(rays, i, colour, differ);
        support = KERNEL(clear_second)(rays, i, colour, differ);
    } else {
        for (int k = 0; k < rays->slots; k++)
            simd_store_f32(rays->agree[k] + i, simd_set_f32(1));
    }
    simd_store_f32(out->support + i, support);
    if (own >= 0)
        share = KERNEL(clear_own)(rays, own, i, colour);
    for (int c = 0; c < 3; c++) {
        if (own >= 0)
            colour[c] += share * (simd_load_f32(rays->colour[c][own] + i) - colour[c]);
        simd_store_f32(out->colour[c] + i, colour[c]);
    }
    simd_store_f32(out->own + i, share);
}

static void KERNEL(clear_blend)(struct sst_clear_colours *out, const struct sst_clear_rays *rays, int own)
{
    for (int i = 0; i < SST_CLEAR_BLOCK; i += CLEAR_LANES)
        KERNEL(clear_blend_lanes)(out, rays, own, i);
}
#undef CLEAR_LANES
