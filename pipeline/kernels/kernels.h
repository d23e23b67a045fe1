/* pipeline/kernels/kernels.h - table of kernels, filled with the best variant for this CPU. It is long because the
 * contracts of all kernels stand here, one beside the other. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_KERNELS_KERNELS_H
#define SST_PIPELINE_KERNELS_KERNELS_H

#include <stdbool.h>
#include <string.h>

#include "base/base.h"
#include "pipeline/kernels/blend_near.h"
#include "pipeline/kernels/consensus.h"
#include "pipeline/kernels/conv_tiles.h"
#include "pipeline/kernels/windows.h"

/*
 * A kernel is a pure function on rows. `<name>_ref.c` is its definition: the plainest loop. `<name>_tmpl.h` is the form
 * that compilers vectorise; x86/<level>.c compiles all templates for one CPU level, arm/<level>.c those that gain from
 * it. Nothing is contracted to FMA and no sum inside a pixel is reordered, so every level gives the bytes of the
 * reference, unless a tolerance is stated here.
 */
enum sst_cpu_level {
    SST_CPU_REF = 0,  /* plain references */
    SST_CPU_BASE = 1, /* templates for the compiler's default target; on arm64 it has NEON */
#if defined(__aarch64__)
    SST_CPU_DOTPROD = 2, /* NEON with byte dot products: Cortex-A76, Neoverse N1, Apple M1 and later */
    SST_CPU_I8MM = 3,    /* ... of signed by unsigned bytes: Cortex-A510, Neoverse V1, Apple M2 and later */
#else
    SST_CPU_AVX2 = 2,
    SST_CPU_AVXVNNI = 3, /* AVX2 with byte dot products: Alder Lake, Sierra Forest, Zen 5 and later */
    SST_CPU_AVX512 = 4,  /* F, BW, DQ, VL, VPOPCNTDQ, BITALG, VBMI, VNNI: Ice Lake, Zen 4 and later */
#endif
    SST_CPU_LEVELS
};

/** One line per kernel: X(name). Its type sst_<name>_fn, contract and arguments are declared below. */
#define SST_KERNEL_LIST(X)                                                                                             \
    X(census_row)                                                                                                      \
    X(hamming_row)                                                                                                     \
    X(hamming_steps_row)                                                                                               \
    X(feature_cost_rows)                                                                                               \
    X(cheapest_hamming_row)                                                                                            \
    X(cheapest_row)                                                                                                    \
    X(cheapest_mean_row)                                                                                               \
    X(transpose_u8)                                                                                                    \
    X(support_sum_row)                                                                                                 \
    X(support_mean_row)                                                                                                \
    X(sgm_across_row)                                                                                                  \
    X(sgm_along_rows)                                                                                                  \
    X(winner_other_row)                                                                                                \
    X(winner_row)                                                                                                      \
    X(median5_row)                                                                                                     \
    X(bilateral_row)                                                                                                   \
    X(median_votes_row)                                                                                                \
    X(land_row)                                                                                                        \
    X(hypothesis_cost_row)                                                                                             \
    X(hypothesis_path_row)                                                                                             \
    X(subpixel_fit_row)                                                                                                \
    X(subpixel_plane_row)                                                                                              \
    X(subpixel_window_row)                                                                                             \
    X(blend_rays)                                                                                                      \
    X(blend_plain)                                                                                                     \
    X(blend_finish)                                                                                                    \
    X(blend_take)                                                                                                      \
    X(blend_support)                                                                                                   \
    X(clear_removed)                                                                                                   \
    X(clear_state)                                                                                                     \
    X(clear_land)                                                                                                      \
    X(clear_surface)                                                                                                   \
    X(clear_take)                                                                                                      \
    X(clear_blend)                                                                                                     \
    X(agree_votes)                                                                                                     \
    X(agree_mode)                                                                                                      \
    X(agree_near)                                                                                                      \
    X(agree_sum)                                                                                                       \
    X(cell_land)                                                                                                       \
    X(disp_span)                                                                                                       \
    X(cell_score)                                                                                                      \
    X(score_add)                                                                                                       \
    X(enlarge_row)                                                                                                     \
    X(split_row)                                                                                                       \
    X(place_row)                                                                                                       \
    X(resample_row)                                                                                                    \
    X(warped_row)                                                                                                      \
    X(level_row)                                                                                                       \
    X(window_squares)                                                                                                  \
    X(window_products)                                                                                                 \
    X(window_stats)                                                                                                    \
    X(window_best)                                                                                                     \
    X(window_agree)                                                                                                    \
    X(weighted_add)                                                                                                    \
    X(light_row)                                                                                                       \
    X(guide_cells)                                                                                                     \
    X(class_row)                                                                                                       \
    X(shown_row)                                                                                                       \
    X(conv_spread)                                                                                                     \
    X(conv_products)                                                                                                   \
    X(conv_gather)                                                                                                     \
    X(conv_finish)                                                                                                     \
    X(colour_step_row)                                                                                                 \
    X(consensus_first)                                                                                                 \
    X(consensus_again)                                                                                                 \
    X(consensus_cost_row)                                                                                              \
    X(consensus_mean_row)                                                                                              \
    X(consensus_least_row)                                                                                             \
    X(consensus_path_row)                                                                                              \
    X(consensus_choose_row)                                                                                            \
    X(correlate_places)                                                                                                \
    X(feature_products)                                                                                                \
    X(sha256_blocks)

/* --- disparity (pipeline/method/disparity/) --- */

/** Matching costs are 0 (equal) to SST_COST_MAX. */
#define SST_COST_MAX 255

/** Census 9 wide, 7 high: bit set where the neighbour is darker than the centre; 62 bits, rows top down, left to right.
 *  rows[0..6] are the rows y-3 .. y+3, each readable from -4 to n+3. */
typedef void sst_census_row_fn(uint64_t *out, const uint8_t *const rows[7], size_t n);

/** step[i] = largest difference of a colour channel of pixels a and b. */
typedef void sst_colour_step_row_fn(uint8_t *step, const uint8_t *const a[3], const uint8_t *const b[3], size_t n);

/** cost[i] = 4 * popcount(a[i] ^ b[i]), at most 248. */
typedef void sst_hamming_row_fn(uint8_t *cost, const uint64_t *a, const uint64_t *b, size_t n);

/** cost[x * nd + d] = 4 * popcount(a[x] ^ b[x - d]): n pixels, each against nd places from its own one to the left.
 *  b is readable from b - (nd - 1) on. @param nd  a multiple of 32 */
typedef void sst_hamming_steps_row_fn(uint8_t *cost, const uint64_t *a, const uint64_t *b, size_t n, size_t nd);

/**
 * Costs of a stretch of one row of feature vectors against `count` other stretches: with a and b[j] at pixel x,
 * cost[j * cost_stride + x] = clamp((SST_FEATURE_ONE^2 - <a, b[j]>) >> SST_FEATURE_SHIFT, 0, SST_FEATURE_COST_MAX).
 *
 * Vectors have unit length, in steps of 1/SST_FEATURE_ONE, plus SST_FEATURE_ZERO; a row is [16][.][4] with `stride`
 * bytes between groups of four channels (not a multiple of 4096: the groups would share the same cache lines).
 *
 * @param b  [count] stretches, may be unaligned and overlap
 * @param n  pixels, a multiple of 16
 */
typedef void sst_feature_cost_rows_fn(uint8_t *cost, size_t cost_stride, const uint8_t *a, const uint8_t *const *b,
                                      size_t count, size_t stride, size_t n);
#define SST_FEATURE_CHANNELS 64
#define SST_FEATURE_ZERO     128
#define SST_FEATURE_ONE      127
#define SST_FEATURE_SHIFT    6
#define SST_FEATURE_COST_MAX 128 /* a dot product of 0.49: costs saturate below it (docs/design/method.md) */

/** Insert the mean of two costs, rounded up and at most SST_COST_MAX - 1, into the two smallest ones so far, first <=
 *  second. a and b may be the same. */
typedef void sst_cheapest_row_fn(uint8_t *first, uint8_t *second, const uint8_t *a, const uint8_t *b, size_t n);

/** The two smallest of the costs of hamming_row against `count` other stretches, first <= second; SST_COST_ABSENT where
 * there are fewer. */
typedef void sst_cheapest_hamming_row_fn(uint8_t *first, uint8_t *second, const uint64_t *a, const uint64_t *const *b,
                                         int count, size_t n);

/** One cost from the two smallest ones, into the first: their mean, rounded up; with `two`, of two neighbours, the
 * smaller one weighs three times the other, rounded to nearest. Without a second one the first alone, without any
 * SST_COST_UNSEEN. */
typedef void sst_cheapest_mean_row_fn(uint8_t *first, const uint8_t *second, int two, size_t n);
#define SST_COST_ABSENT 255 /* costs are below it: outside the neighbour */
#define SST_COST_UNSEEN                                                                                                \
    96 /* of pixels that no neighbour sees: the same for all disparities, so that only smoothness decides */

/** out[x * out_stride + d] = in[d * in_stride + x]; nx and nd multiples of 8. */
typedef void sst_transpose_u8_fn(uint8_t *out, size_t out_stride, const uint8_t *in, size_t in_stride, size_t nx,
                                 size_t nd);

/**
 * Row sums over horizontal arms, added to the running column sums (all modulo 2^16, which is exact for differences):
 * vp[x][d] = vp_above[x][d] + sum of cost[x-l .. x+r][d], l = left[x], r = right[x].
 *
 * @param prefix  scratch [(n + 1)][nd]
 */
typedef void sst_support_sum_row_fn(uint16_t *vp, const uint16_t *vp_above, uint16_t *prefix, const uint8_t *cost,
                                    const uint8_t *left, const uint8_t *right, size_t n, size_t nd);

/**
 * Mean over the support region: out[x][d] = ((lo - hi + count / 2) * ceil(2^16 / count)) >> 16 with lo, hi the column
 * sums below and above: rows[down[x]] and rows[-1 - up[x]], rows pointing at the current row's sums. count[x] >= 2;
 * pixels with count 1 keep their cost.
 */
typedef void sst_support_mean_row_fn(uint8_t *out, const uint16_t *const *rows, const uint8_t *up, const uint8_t *down,
                                     const uint16_t *count, size_t n, size_t nd);

/**
 * One path of the semi-global optimisation that comes from another row: for every x,
 * L[x][d] = C[x][d] + min(P[d], P[d-1] + p1, P[d+1] + p1, min P + p2) - min P,  P = prev[x + dx], and sum += L.
 *
 * Rows of L are [n + 2][nd + 2 * SST_SGM_PAD]: entry x of a row starts at (x + 1) * (nd + 2 * SST_SGM_PAD) +
 * SST_SGM_PAD, its neighbours at -1 and nd hold SST_SGM_FAR, and its minimum is stored at -2; the entries -1 and n
 * describe the outside: all 0.
 *
 * @param penalty  [n] index into p1, p2 for the step into x
 * @param first    set sum instead of adding to it
 */
typedef void sst_sgm_across_row_fn(uint16_t *cur, const uint16_t *prev, uint16_t *sum, const uint8_t *cost,
                                   const uint8_t *penalty, const uint16_t *p1, const uint16_t *p2, int dx, int first,
                                   size_t n, size_t nd);
#define SST_SGM_PAD 32
#define SST_SGM_FAR 0x7FFF

/**
 * The same along rows: from left to right (dir 1) or from right to left (dir -1). Several rows at once, since each
 * pixel waits for the one before.
 *
 * @param line     [rows] rows of L, one after the other: the entry before the path's first pixel is read, that of its
 * last one holds its L afterwards, the others are undefined
 * @param stride   cells between rows of sum and of cost
 * @param penalty  [rows][penalty_stride]
 */
typedef void sst_sgm_along_rows_fn(uint16_t *line, uint16_t *sum, const uint8_t *cost, size_t stride,
                                   const uint8_t *penalty, size_t penalty_stride, const uint16_t *p1,
                                   const uint16_t *p2, int dir, int first, size_t rows, size_t n, size_t nd);
#define SST_SGM_ROWS 4 /* at once */

/**
 * Winner of each pixel's summed costs, ties to the smaller index, with the smallest sum outside its two neighbours.
 *
 * @param best    out [n], index of the winner
 * @param second  out [n], smallest sum among d with |d - best| > 1, 65535 where there is none; or NULL
 * @param sum     in [n][stride], 0..65535 each
 * @param nd      1..stride disparities count
 */
typedef void sst_winner_row_fn(uint16_t *best, uint16_t *second, const uint16_t *sum, size_t stride, size_t n,
                               size_t nd);

/** The parabola's minimum between three costs, in 1/64 steps from the middle one, which is the least; 0 where it is
 *  flat. */
static inline int sst_parabola_q6(int before, int at, int after)
{
    const int curvature = before - 2 * at + after, slope = 32 * (before - after);

    /* curvature >= |slope| / 32, and the result is within half a step. */
    if (curvature <= 0)
        return 0;
    return (slope >= 0 ? slope + curvature / 2 : slope - curvature / 2) / curvature;
}

/**
 * The other image's winners from the same sums: key[n - 1 - x + d] becomes the least of itself and of
 * sum[x][d] << 16 | d, so that a key belongs to one pixel of the other image.
 *
 * @param key  in and out [n + nd - 1]; UINT32_MAX at first
 * @param nd   1..stride disparities count
 */
typedef void sst_winner_other_row_fn(uint32_t *key, const uint16_t *sum, size_t stride, size_t n, size_t nd);

/** Median of 5x5: rows[0..4] are y-2 .. y+2, each readable from -2 to n+1. */
typedef void sst_median5_row_fn(uint16_t *out, const uint16_t *const rows[5], size_t n);

/**
 * Bilateral filter over 7x7 (see sst_disparity_bilateral()): the mean of those disparities within SST_BILATERAL_STEP_Q6
 * of the centre's whose luma differs by less than tau, weighted. Means are exact quotients of integers below 2^24,
 * rounded half up.
 *
 * @param disp, luma  rows y-3 .. y+3, each readable from -3 to n+2; a disparity of 65535 is skipped and kept, all
 *                    others are below 65535 - SST_BILATERAL_STEP_Q6
 * @param weight      [49], 0..4096 each with a sum below 2^15, weight[24] > 0
 */
typedef void sst_bilateral_row_fn(uint16_t *out, const uint16_t *const disp[7], const uint8_t *const luma[7],
                                  const int16_t *weight, int tau, size_t n);
#define SST_BILATERAL_STEP_Q6 96

/**
 * Weighted median guided by an image (Ma, He, Wei, Sun, Wu, *Constant time weighted median filtering for stereo
 * matching and beyond*, ICCV 2013), its first part: does a pixel's own disparity have the majority of the weights
 * around it? A weight is a share by the distance times sst_median_alike() of the colours.
 *
 * @param near    out: sum of the weights of disparities within SST_MEDIAN_STEP_Q6 of the pixel's own
 * @param all     out: sum of all weights, > 0; below 2^21
 * @param disp    rows y-5 .. y+5, 1/64 px, each readable from -5 to n+4
 * @param colour  R, G, B of the same rows
 */
typedef void sst_median_votes_row_fn(uint32_t *near, uint32_t *all, const uint16_t *const disp[11],
                                     const uint8_t *const colour[3][11], size_t n);

/** Another view, and where the pixels of a row land there: along one axis a disparity d moves by
 *  whole + floor((part + d step) / 2^16). */
struct sst_landing {
    int width, height; /* at most 32768, 2^28 pixels */
    int32_t whole[2];  /* across, down; magnitudes below 2^17 */
    int32_t part[2];   /* 0 .. 65535 */
    int32_t step[2];   /* magnitudes at most 32768 */
    int y;             /* the row */
    uint32_t source;   /* a bit of 16, for the row's view */
};

/**
 * Move n pixels to where they land, [height][width].
 *
 * @param nearest   in, out: the largest (disp + 1) << SST_LANDED_DISP | rank that landed; 0: nothing;
 *                  SST_LANDED_CLOSED: nothing can land, and `farthest` stays as well
 * @param farthest  in, out, or NULL: sources << 16 | the smallest disp that landed; 0xFFFF: nothing
 * @param disp      stored disparities; 0xFFFF lands nowhere
 * @param rank      or NULL: all 0
 */
typedef void sst_land_row_fn(uint32_t *nearest, uint32_t *farthest, const struct sst_landing *l, const uint16_t *disp,
                             const uint8_t *rank, size_t n);
#define SST_LANDED_DISP     8
#define SST_LANDED_CLOSED   UINT32_MAX
#define SST_LANDED_FAR      32 /* spacings between views at most, the limit of `step` */
#define SST_MEDIAN_REACH    5
#define SST_MEDIAN_SIDE     (2 * SST_MEDIAN_REACH + 1)
#define SST_MEDIAN_STEP_Q6  64
#define SST_MEDIAN_CONTRAST 120 /* of R, G and B together: from here on pixels have no weight */
#define SST_MEDIAN_SHIFT    6
#define SST_MEDIAN_BLOCK    32 /* pixels at once */

/** Shares by distance: 16 exp(-distance / 4 px). */
static const uint8_t sst_median_near[SST_MEDIAN_SIDE][SST_MEDIAN_SIDE] = {
    { 3, 3, 4, 4, 4, 5, 4, 4, 4, 3, 3 },    { 3, 4, 5, 5, 6, 6, 6, 5, 5, 4, 3 },
    { 4, 5, 6, 6, 7, 8, 7, 6, 6, 5, 4 },    { 4, 5, 6, 8, 9, 10, 9, 8, 6, 5, 4 },
    { 4, 6, 7, 9, 11, 12, 11, 9, 7, 6, 4 }, { 5, 6, 8, 10, 12, 16, 12, 10, 8, 6, 5 },
    { 4, 6, 7, 9, 11, 12, 11, 9, 7, 6, 4 }, { 4, 5, 6, 8, 9, 10, 9, 8, 6, 5, 4 },
    { 4, 5, 6, 6, 7, 8, 7, 6, 6, 5, 4 },    { 3, 4, 5, 5, 6, 6, 6, 5, 5, 4, 3 },
    { 3, 3, 4, 4, 4, 5, 4, 4, 4, 3, 3 },
};

/** Share by the colours: parabola down to SST_MEDIAN_CONTRAST, 0..225. @param contrast  sum over R, G, B, >= 0 */
static inline unsigned sst_median_alike(int contrast)
{
    const int room = contrast < SST_MEDIAN_CONTRAST ? SST_MEDIAN_CONTRAST - contrast : 0;

    return (unsigned)(room * room) >> SST_MEDIAN_SHIFT;
}

/* Second pass (design.md, 5.7): each pixel has a list of up to SST_HYPOTHESES disparities, in 1/64 px. */
#define SST_HYPOTHESES       8
#define SST_HYPOTHESIS_BEST  4     /* cheapest views that count, visible or not */
#define SST_HYPOTHESIS_LIMIT 480   /* largest cost of a view: colour difference in eighths of a level, R + G + B */
#define SST_HYPOTHESIS_FAR   12000 /* cost of unused entries: 4 * (FAR + SST_DISPARITY_MAX_PENALTY) < 2^16 */
#define SST_DEPTH_OUTSIDE    255   /* depth code of pixels that must not be matched */

/** A view whose pixels are R, G, B and a depth code from the lowest byte up. */
struct sst_packed_view {
    const uint32_t *pixels; /* pixel (0, 0); one row and column above and left, one row and two columns below and right
                               are readable */
    ptrdiff_t stride;       /* pixels */
};

#define SST_HYPOTHESIS_VIEWS 24

/** What the hypotheses of a view are tested against. A disparity d moves a pixel by (x + d dx) / 2^16 to a view,
 * rounded down: x holds the disparity of value 0 and a half. All displacements of disparities 0..65534 fit 32 bits. */
struct sst_hypothesis_test {
    struct sst_packed_view own, view[SST_HYPOTHESIS_VIEWS]; /* of the same stride */
    int32_t x[SST_HYPOTHESIS_VIEWS], y[SST_HYPOTHESIS_VIEWS], dx[SST_HYPOTHESIS_VIEWS], dy[SST_HYPOTHESIS_VIEWS];
    int views;           /* used */
    int width, height;   /* of all views */
    const uint8_t *code; /* [65536] depth code of a disparity: 1..254 and ascending; 0: unknown */
    int tolerance;       /* 1/64 px: a surface nearer by more than this hides the hypothesis */
    int similar;         /* pixels of the 3x3 window count whose channels all differ by at most this from the middle */
    unsigned settled;    /* where the first hypothesis costs less than this, no other one is tested */
};

/**
 * Costs of the hypotheses of n pixels from (x, y) on: each view's mean colour difference over the similar pixels of a
 * 3x3 window, at most SST_HYPOTHESIS_LIMIT, where the hypothesis projects to (nearest pixel). The cost is the mean over
 * the views in which nothing nearer hides the hypothesis, with the SST_HYPOTHESIS_BEST cheapest of all views added once
 * more; the cheapest alone where fewer views see it at all. Pixels with one hypothesis cost 0.
 *
 * @param cost       out [n][SST_HYPOTHESES]; unused and untested entries SST_HYPOTHESIS_FAR
 * @param hypothesis  [n][SST_HYPOTHESES]
 * @param count      [n] of them in use, 0..SST_HYPOTHESES
 */
typedef void sst_hypothesis_cost_row_fn(uint16_t *cost, const uint16_t *hypothesis, const uint8_t *count,
                                        const struct sst_hypothesis_test *test, int x, int y, size_t n);

/** Penalties of a path: 0 up to a step of `near`, p1 up to twice that, p2 beyond; by colour step. */
struct sst_hypothesis_penalty {
    uint16_t near; /* 1/64 px, at most 2^14 */
    uint16_t p1[256], p2[256];
};

/** A pixel before another one on a path. One with nothing to choose has a path of 0 and else of SST_HYPOTHESIS_FAR; its
 * first hypothesis alone is read. */
struct sst_hypothesis_before {
    const uint16_t *path, *hypothesis; /* [SST_HYPOTHESES] */
};

/** Pixels on a path. */
struct sst_hypothesis_steps {
    uint16_t *path, *sum;                       /* out; added to; [n][SST_HYPOTHESES] */
    const uint16_t *cost, *hypothesis;          /* [n][SST_HYPOTHESES] */
    const struct sst_hypothesis_before *before; /* [n]; paths of pixels that come first may be of the same call */
    const uint8_t *colour;                      /* [n] steps from the pixel before */
};

/**
 * One path of the semi-global optimisation over hypotheses: entry i of a pixel is
 * L[i] = C[i] + min over j of (P[j] + penalty(|D[i] - D'[j]|)) - min P, at most C[i] + p2, and sum += L. Hypotheses are
 * at most 2^15.
 * P and D' are the path and the hypotheses of the pixel before.
 *
 * @param step  1, or -1: all pointers are at the last pixel, which comes first
 */
typedef void sst_hypothesis_path_row_fn(const struct sst_hypothesis_steps *steps,
                                        const struct sst_hypothesis_penalty *penalty, ptrdiff_t step, size_t n);

/* Sub-pixel refinement (design.md, 5.8). */
#define SST_SUBPIXEL_VIEWS 24
#define SST_SUBPIXEL_NONE  32768 /* unknown disparity */
#define SST_SUBPIXEL_BLOCK 64    /* pixels that the kernels process together */

/** A view to compare with. Its pixels are the luma of (x, y), the luma of (x + 1, y) and, from bit 16 on, the larger
 * one of their disparities, 65535 where it is unknown. */
struct sst_subpixel_view {
    struct sst_packed_view view;
    int32_t x, y, dx, dy; /* a disparity d, 1/64 px, moves a pixel by (x + d dx) / 2^16 */
    float bx, by;         /* offset from the own view */
    float gain, offset;   /* its luma times gain plus offset is the own one's */
};

struct sst_subpixel_fit {
    struct sst_packed_view own; /* packed likewise */
    struct sst_subpixel_view view[SST_SUBPIXEL_VIEWS];
    int views;           /* used */
    int width, height;   /* of all views, at least 2 */
    int tolerance;       /* 1/64 px: a surface nearer by more than this hides the point */
    float inverse_limit; /* 1 / luma difference from which on a view does not count */
    int across;          /* 1: gradients are means over three rows or columns, weights 1, 2, 1; 0: of one */
};

/**
 * A Gauss-Newton step of the disparity for each pixel of row y: the luma difference r_k to each view that sees the
 * point (interpolated between four pixels), linear in the disparity with slope s_k = -(gradient . b_k), has weight
 * w_k = 1 - |r_k| / limit.
 * @param weight   out, sum of w_k s_k^2
 * @param product  out, weight times the disparity, px, at which sum of w_k (r_k + s_k step)^2 is least
 * @param disp     1/64 px; SST_SUBPIXEL_NONE: unknown, weight 0
 */
typedef void sst_subpixel_fit_row_fn(float *weight, float *product, const int32_t *disp,
                                     const struct sst_subpixel_fit *fit, int y, size_t n);

/** Planes of one stride, pointers to the first pixel of a row. Each pixel has a plane: its disparity and two
 * slopes. */
struct sst_subpixel_window {
    const uint32_t *colour; /* R, G, B from the lowest byte up */
    const int32_t *disp;    /* 1/64 px */
    const float *weight, *product;
    const float *slope[2]; /* px per pixel to the right, down */
    ptrdiff_t stride;
    int similar; /* channels that differ by at most this count ... */
    float apart; /* ... and disparities that are at most this far from the plane, px */
};

/** Sums over the similar pixels of a window of 5x5 pixels that lie on its middle pixel's plane: of the weights, and of
 * the products less weight times slope, so that their quotient is the disparity in the middle. 2 pixels on all sides
 * are readable. Here and in subpixel_plane_row all levels give the same bytes: no sum is split. */
typedef void sst_subpixel_window_row_fn(float *weight, float *product, const struct sst_subpixel_window *w, size_t n);

#define SST_SUBPIXEL_STEP  4                       /* pixels from one to the next of a large window, of 7x7 ... */
#define SST_SUBPIXEL_REACH (3 * SST_SUBPIXEL_STEP) /* ... which is as large as this */
#define SST_SUBPIXEL_RIDGE 0.2f                    /* variance that positions have besides: holds the slopes */

/** Planes of one stride, pointers to the first pixel of a row. */
struct sst_subpixel_planes {
    const uint32_t *colour;
    const float *disp, *weight; /* px; pixels of weight 0 do not count */
    ptrdiff_t stride;
    int similar;
    float apart;
};

/**
 * Planes through the similar pixels of large windows that lie on the middle pixel's plane: least squares, weighted.
 * SST_SUBPIXEL_REACH pixels on all sides are readable.
 * @param disp   out, px, in the middle of the window
 * @param slope  in and out, px per pixel to the right and down, [n] each
 */
typedef void sst_subpixel_plane_row_fn(float *disp, float *const slope[2], const struct sst_subpixel_planes *p,
                                       size_t n);

/* --- rendering (pipeline/method/render/) --- */

#define SST_BLEND_MAX          2048 /* pixels that one call of a blend kernel takes at most */
#define SST_BLEND_VIEWS        4    /* views that one call of a blend kernel takes at most */
#define SST_BLEND_COLUMNS      4096 /* columns of the table of label weights: stored disparity / 16, 1/4 px each */
#define SST_BLEND_COLUMN_SHIFT 4
#define SST_BLEND_FLOOR        1e-28f /* smaller weight sums are invalid */
#define SST_BLEND_TINY         1e-37f /* changes no weight sum above the floor, and keeps 0 / 0 away below it */

#define SST_BLEND_LEVEL_BITS 14
#define SST_BLEND_LEVEL      (1 << SST_BLEND_LEVEL_BITS) /* colours are levels times this, whole numbers */

/** Weights of the four pixels around a position, 0 <= fx, fy < 1, as whole numbers with sum SST_BLEND_LEVEL: colours
 * are off by less than 1/32 level. */
static inline void sst_blend_set_taps(int16_t tap[4], double fx, double fy)
{
    const int right = (int)(fx * SST_BLEND_LEVEL + 0.5), below = (int)(fy * SST_BLEND_LEVEL + 0.5);
    const int both = (int)(fx * fy * SST_BLEND_LEVEL + 0.5);

    tap[0] = (int16_t)(SST_BLEND_LEVEL - right - below + both);
    tap[1] = (int16_t)(right - both);
    tap[2] = (int16_t)(below - both);
    tap[3] = (int16_t)both;
}

#define SST_BLEND_RANGES 3

/** W_s of a label by stored disparity; in short, but for disparities of the last column: inside[i] for first[i] ..
 *  first[i] + count[i] - 1 (count[i] >= 1), else `outside`. ranges > SST_BLEND_RANGES: only `weight` has them. */
struct sst_blend_range {
    const float *weight; /* [SST_BLEND_COLUMNS], by stored disparity / 16 */
    int ranges;
    uint16_t first[SST_BLEND_RANGES], count[SST_BLEND_RANGES];
    float inside[SST_BLEND_RANGES], outside;
};

#define SST_BLEND_FEW    16   /* labels below it have entries in sst_blend_labels.index */
#define SST_BLEND_ONES   8    /* different weights in a vector of AVX2 */
#define SST_BLEND_MANY   0x80 /* no index of one */
#define SST_BLEND_RANGED 0x08 /* with the index of the weight outside of the label's ranges */

/** Weights of all labels. */
struct sst_blend_labels {
    struct sst_blend_range range[256];
    /* sst_blend_labels_few() */
    int ones; /* in use */
    float one[SST_BLEND_ONES];
    uint8_t index[SST_BLEND_FEW]; /* of `one`, by label, with SST_BLEND_RANGED; SST_BLEND_MANY: there is no place */
    int ranged;
    uint8_t label_ranged[SST_BLEND_FEW]; /* [ranged] labels with SST_BLEND_RANGED */
};

/** Give a label an index of its weight outside of its ranges. @param add  also where no label before has the weight */
static inline void sst_blend_label_index(struct sst_blend_labels *l, int label, bool add)
{
    const struct sst_blend_range *r = &l->range[label];
    int k = 0;

    while (k < l->ones && l->one[k] != r->outside)
        k++;
    if (r->ranges > SST_BLEND_RANGES || k == SST_BLEND_ONES || (k == l->ones && !add))
        return;
    l->one[k] = r->outside;
    l->index[label] = (uint8_t)(r->ranges ? k | SST_BLEND_RANGED : k);
    if (r->ranges)
        l->label_ranged[l->ranged++] = (uint8_t)label;
    l->ones = sst_max_int(l->ones, k + 1);
}

/** Set all fields after `range`. @param present  in [256], labels that are expected: four different weights of these
 *  are looked up faster than eight */
static inline void sst_blend_labels_few(struct sst_blend_labels *l, const bool *present)
{
    l->ones = l->ranged = 0;
    memset(l->index, SST_BLEND_MANY, sizeof(l->index));
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < SST_BLEND_FEW; i++) {
            if (present[i] == !pass)
                sst_blend_label_index(l, i, !pass);
        }
    }
}

/** Contribution of one view to a stretch of one output row. Pointers refer to the source pixel of the first output
 *  pixel. */
struct sst_blend {
    const uint8_t *top[3], *bottom[3]; /* R, G, B of the two source rows, n + 1 pixels readable in each */
    int16_t tap[4];                    /* sst_blend_set_taps(): of top[x], top[x + 1], bottom[x], bottom[x + 1] */
    size_t below;                      /* bytes from `bottom` to a row that is wanted soon; 0: none */
    /* not for blend_plain */
    float aperture;                    /* weight of the view */
    const uint16_t *disp;              /* nearest pixel, n of them; 0xFFFF: unknown. NULL: W_s = W_d = 1 */
    const uint8_t *label;              /* nearest pixel; NULL: W_s = 1 */
    size_t disp_below, label_below;    /* as `below` */
    const struct sst_blend_labels *by; /* W_s by label */
    struct sst_blend_near near;        /* W_d by disparity */
};

/**
 * acc[0..2] += A W_s W_d C, acc[3] += A W_s W_d (design.md, 5.4) with C bilinear, times SST_BLEND_LEVEL, of each view.
 *
 * @param acc  in and out, four rows of n; n at most SST_BLEND_MAX
 * @param b    in [views], 1..SST_BLEND_VIEWS
 */
typedef void sst_blend_rays_fn(float *const acc[4], const struct sst_blend *b, int views, size_t n);

/** sum += C, count += 1 of each view: plain refocusing. 512 views fit. @param b  in [views], 1..SST_BLEND_VIEWS */
typedef void sst_blend_plain_fn(int32_t *const sum[3], float *count, const struct sst_blend *b, int views, size_t n);

/** out = sum / SST_BLEND_LEVEL / (weight + SST_BLEND_TINY) to the nearest value. sum <= 255 SST_BLEND_LEVEL weight but
 *  for rounding. */
typedef void sst_blend_finish_fn(uint8_t *out, const float *sum, const float *weight, size_t n);

/** The rays of blend_rays one by one: colours rounded, weights A W_s W_d. n at most SST_BLEND_MAX. */
typedef void sst_blend_take_fn(uint8_t *const colour[3], float *weight, const struct sst_blend *b, size_t n);

/**
 * support = 255 where the ray's disparity is in its label's range: ends[label] = first | last << 16, stored disparities
 * both; none if first > last. Other elements keep their value.
 *
 * @param label  NULL: ends[0] for all  @param ends  in, [256]
 */
typedef void sst_blend_support_fn(uint8_t *support, const uint16_t *disp, const uint8_t *label, const uint32_t *ends,
                                  size_t n);

/*
 * The clear picture (design.md, 5.6; pipeline/method/render/clear.c): rays are sent to the viewpoint, and the pixels of
 * the picture are coloured in stretches of SST_CLEAR_BLOCK.
 */
#define SST_CLEAR_BLOCK     32
#define SST_CLEAR_TOLERANCE 48    /* levels, see below: rays of one surface */
#define SST_CLEAR_RIM       0.02F /* weight of a ray next to something removed */

/** What a view's pixel is: removed, or nothing is known; next to something removed; neither. */
enum sst_clear_state { SST_CLEAR_REMOVED = 0, SST_CLEAR_BESIDE = 1, SST_CLEAR_KEPT = 2 };

/** removed[x] = 1 where disp[x] > cut and the disparity is known (not 0xFFFF), else 0. */
typedef void sst_clear_removed_fn(uint8_t *removed, const uint16_t *disp, int cut, size_t n);

/** State of n pixels of a row: removed where removed[1] says so or disp is at least `bins`; beside it where one of the
 *  eight neighbours is. removed: the rows above, at and below, readable from -1 to n, 0 or 1. */
typedef void sst_clear_state_fn(uint8_t *state, const uint8_t *const removed[3], const uint16_t *disp, int bins,
                                size_t n);

/**
 * One view. A ray of stored disparity q goes from pixel (x, y) to (x + floor(q x_q6 + x_0), y + floor(q y_q6 + y_0)),
 * products and sums in float, |results| below 2^30. Where it lands it is stored as 2 (q >> coarse) + 2, plus 1 if its
 * pixel is kept; half of that is its level, 0: no ray.
 */
struct sst_clear_view {
    int width, height;
    const uint8_t *plane[3]; /* R, G, B, rows `stride` apart, 15 bytes readable after them; NULL: clear_take leaves
                                colours 0 */
    size_t stride;
    float bx, by; /* offset from the viewpoint, spacings */
    float x_q6, x_0, y_q6, y_0;
    int coarse; /* 0, or 1 where stored disparities reach 2^15 - 1 */
};

/**
 * Send the rays of pixels x .. x+n-1 of row y of a view that are not removed; the nearest one stays where several land,
 * kept pixels first. Those that leave the picture are dropped. Pixels beside may be stored with the value they have:
 * one thread at a time.
 *
 * @param landed  in and out, [height] rows `stride` apart
 * @param disp    in [n]  @param state  in [n]: removed where the disparity is unknown
 */
typedef void sst_clear_land_fn(uint16_t *landed, size_t stride, const struct sst_clear_view *v, const uint16_t *disp,
                               const uint8_t *state, int x, int y, int n);

/**
 * The nearest surface of each pixel that enough views confirm: those whose ray is at most SST_CLEAR_TOLERANCE behind
 * the nearest one of it, at least 2 and a quarter of the rays that arrive.
 *
 * @param surface  out [SST_CLEAR_BLOCK]: mean level of these rays; 0: there is none
 * @param landed   in [views] stretches of SST_CLEAR_BLOCK
 */
typedef void sst_clear_surface_fn(float *surface, const uint16_t *const *landed, size_t views);

/** Rays of SST_CLEAR_BLOCK pixels of a row. One slot holds at most one ray of each pixel. */
struct sst_clear_rays {
    uint16_t first[SST_CLEAR_BLOCK], last[SST_CLEAR_BLOCK]; /* levels of the surface's rays; none: 1, 0 */
    float px[SST_CLEAR_BLOCK];                              /* its disparity */
    int16_t wanted[SST_CLEAR_BLOCK];                        /* rays of full weight that are still to be taken */
    int slots;                                              /* in use */
    float (*weight)[SST_CLEAR_BLOCK];                       /* [slots]; 0: no ray */
    float (*colour[3])[SST_CLEAR_BLOCK];                    /* [slots] 0..255; 0 where there is no ray */
    float (*agree)[SST_CLEAR_BLOCK]; /* [slots], set by clear_blend: agreement of a ray with the others, 0..1 */
};

/**
 * The rays of one view that see the surface of the pixels x .. of row y, in a new slot if there are any: those that
 * landed at a level of the surface, unless the surface's exact position lies outside the view. Colours are bilinear at
 * 1/64 px. Weights are 1 (which counts as taken) or SST_CLEAR_RIM.
 *
 * @param landed  in [SST_CLEAR_BLOCK]  @return whether a pixel still wants rays
 */
typedef int sst_clear_take_fn(struct sst_clear_rays *rays, const struct sst_clear_view *v, const uint16_t *landed,
                              int x, int y);

/** Colours of the pixels of a block. */
struct sst_clear_colours {
    float colour[3][SST_CLEAR_BLOCK]; /* 0..255; 0 where there is no ray */
    float weight[SST_CLEAR_BLOCK];    /* sum of weights */
    float support[SST_CLEAR_BLOCK];   /* sum of weight times agreement */
    float own[SST_CLEAR_BLOCK];       /* share of the viewpoint's own camera in the colour, 0..1 */
};

/**
 * Mean colour of the rays that agree: from the weighted mean of all, two steps of weights 1 / (1 + t^4), t the mean
 * deviation of R, G and B in units of 20, then 10 levels; none where no ray deviates by more than 4 levels. Then slot
 * `own`, if its ray has weight 1, replaces it: wholly up to a deviation of 10 levels, fading out up to 20.
 *
 * @param own  slot of the viewpoint's own camera; -1: none, or it is not to replace the mean
 */
typedef void sst_clear_blend_fn(struct sst_clear_colours *out, const struct sst_clear_rays *rays, int own);

/*
 * Colour agreement of the rays of a pixel (pipeline/method/render/verify.h). A ray votes for its own colour and, with
 * decreasing weight, for similar ones; colour distance is the sum of the three absolute differences.
 */
#define SST_AGREE_BINS 4096 /* colours by the upper 4 bits of R, G, B */
#define SST_AGREE_MODE 48   /* largest distance at which a ray votes ... */
#define SST_AGREE_NEAR 64   /* distance from the winning colour at which a ray's weight becomes 0 */

struct sst_voting {
    const uint8_t *rarity; /* [SST_AGREE_BINS]: weight of a ray of this colour */
    float doubt;           /* added to every ray's weight, >= 0, because maps may be wrong */
    float scale, most;     /* votes for a rarity and weight of 1; maximum, 1..255 */
};

/** vote[x] = min(1 + scale (weight + doubt) rarity(colour), most), truncated to a whole number; 0 where weight < 0: no
 *  ray. */
typedef void sst_agree_votes_fn(uint8_t *vote, const uint8_t *const colour[3], const float *weight,
                                const struct sst_voting *v, size_t n);

/**
 * The colour with most votes among those of every step-th ray, ties to the first; black if there is no ray. Votes for
 * colour a: sum over rays k of floor(max(0, SST_AGREE_MODE - |a - colour_k|) / 2) vote_k.
 *
 * @param mode    out, three rows of `stride`
 * @param colour  [rays][3][stride] @param vote  [rays][stride], 0: no ray; sum of a pixel at most 65535 /
 *                (SST_AGREE_MODE / 2)
 * @param rays    at most 256  @param stride  a multiple of 64: pixels, all of which are done
 */
typedef void sst_agree_mode_fn(uint8_t *const mode[3], const uint8_t *colour, const uint8_t *vote, size_t rays,
                               size_t step, size_t stride);

/** near = max(0, SST_AGREE_NEAR - |colour - mode|) * vote for the rays of one view. */
typedef void sst_agree_near_fn(uint16_t *near, const uint8_t *const colour[3], const uint8_t *const mode[3],
                               const uint8_t *vote, size_t n);

/**
 * acc[0..2] += w colour, acc[3] += w, with w the sum of `near` over the 3x3 pixels around; 0 where vote is 0.
 *
 * @param near  rows above, at, below; n + 2 of each, the first is of the pixel to the left; sums below 2^24 are exact
 * @param n     at most SST_BLEND_MAX
 */
typedef void sst_agree_sum_fn(float *const acc[4], const uint16_t *const near[3], const uint8_t *const colour[3],
                              const uint8_t *vote, size_t n);

/* --- live maps (pipeline/live/scene/warp.c) --- */

/** How cells move to another picture of them: one of disparity d by (d + zero) b / 2^23, rounded, to the left and up.
 *  Magnitudes of zero below 2^24, of the other two below 2^23. */
struct sst_cell_way {
    int32_t zero_q6, bx_q16, by_q16;
    uint32_t rank; /* bits that all cells get */
    int width, height;
};

/**
 * Move a row of cells. The largest of those that land on one place stays; those that leave the picture are dropped.
 *
 * @param landed  in and out, [height][width]
 * @param cells   [n] the disparity in bits 8 to 23; 0: nothing is there @param x, y  of the first one
 */
typedef void sst_cell_land_fn(uint32_t *landed, const struct sst_cell_way *w, const uint32_t *cells, int x, int y,
                              int n);

/** Two rows of cells of 2x2 pixels: [0] the row of cells that contains the pixels, [1] the nearer adjacent row; n
 *  cells each, and one more on both sides. */
struct sst_enlarge {
    const uint16_t *disp[2], *green4[2]; /* green4: sum over the cell's four pixels */
    const uint8_t *label[2];
    const uint8_t *green; /* [2 n] of the pixels */
    int step_q6;          /* cells of the same label within this difference belong to one surface */
};

/**
 * Disparity and label of 2n pixels: those of the pixel's own cell, or of whichever of the three other adjacent cells on
 * another surface has a mean green nearer to the pixel's; ties in the order own, beside, other row, other row beside.
 */
typedef void sst_enlarge_row_fn(uint16_t *disp, uint8_t *label, const struct sst_enlarge *e, size_t n);

/** Planes R, G, B of n pixels of four bytes: R, G, B, and one that is ignored. */
typedef void sst_split_row_fn(uint8_t *const plane[3], const uint8_t *pixels, size_t n);

/* --- rectification (pipeline/lightfield/rectify/) --- */

#define SST_RESAMPLE_PHASES 256 /* sub-pixel positions with separate weights */
#define SST_RESAMPLE_BORDER 4   /* readable pixels on every side of a picture */

/** Positions along a row that are a cubic of the column, one for each axis: whole_q8 + c0 + k (c1 + k (c2 + k c3)). */
struct sst_places {
    int32_t whole_q8[2];
    float c[2][4];   /* 1/256 px; magnitudes of the sum below 2^22 */
    int32_t most[2]; /* 1/256 px: the last column and row of the picture; enum sst_places_kind in most[0] of a table */
};

/** Entries of a table of places that are no cubics. */
enum sst_places_kind {
    SST_PLACES_LISTED = -1, /* pairs as of sst_place_row_fn, from pair whole_q8[0] of a list on */
    SST_PLACES_NONE = -2,
};

/** n positions from k0 on, rounded to 1/256 px, ties to even. @param xy_q8  out, [2 n]; INT32_MIN outside 0 .. most */
typedef void sst_place_row_fn(int32_t *xy_q8, const struct sst_places *places, float k0, size_t n);

/** A picture to resample, and the filter: the taps of position p / 256 after pixel x are weight[p taps + i] at pixels
 *  x + 1 - taps / 2 + i; they add up to 2^14, their magnitudes to at most 2^15. Two taps are bilinear: 64 (256 - p), 64
 * p. */
struct sst_resample {
    const uint8_t *pixel;  /* (0, 0): R, G, B and an unused byte; SST_RESAMPLE_BORDER more around the picture */
    size_t stride;         /* bytes; times the height below 2^31 */
    const int16_t *weight; /* [SST_RESAMPLE_PHASES][taps] */
    int taps;              /* 2, 4 or 6 */
};

/**
 * Samples at n positions, columns first, then rows: each column is rounded to 1/64 level, the sum over columns to
 * 1/128, clamped to 0 .. 32640 (255 levels).
 *
 * @param out    three rows of n
 * @param xy_q8  [2 n] positions in 1/256 px inside the picture; INT32_MIN: none, the output is 0
 */
typedef void sst_resample_row_fn(uint16_t *const out[3], const struct sst_resample *from, const int32_t *xy_q8,
                                 size_t n);

/* --- posed views (pipeline/posed/) --- */

/** A view's picture: levels of up to 16 bits. */
struct sst_warped_source {
    const uint16_t *plane[3]; /* [channels][height][stride]; a row that ends the memory ends with its last sample */
    size_t stride;            /* samples; stride times height is below 2^31 */
    int width, height;        /* 2 .. 32767 */
    int channels;             /* 1 or 3 */
};

/** Pixels of one row, `at` the first, that see places on a line of the source: x + i dx, y + i dy in 1/65536 px, all
 *  of them within 0 .. width - 1 and 0 .. height - 1. */
struct sst_warped_segment {
    int32_t x_q16, y_q16, dx_q16, dy_q16;
    int32_t at, n;
};

/**
 * Add a view's levels, interpolated bilinearly, to the sums of a row of pixels, and 1 to their counts.
 *
 * Places are rounded to 1/256 px, the level to 1/64; 1024 views of 65535 levels fit.
 *
 * @param sum       in, out: channels rows, 1/64 level
 * @param count     in, out
 * @param segment   [segments]
 */
#define SST_WARPED_SHIFT 6
typedef void sst_warped_row_fn(uint32_t *const sum[3], uint16_t *count, const struct sst_warped_source *from,
                               const struct sst_warped_segment *segment, size_t segments);

/** out[i * n + j] = <a[i], b[j]>: products of descriptors of SST_FEATURE_PARTS parts each, from -512 to 512.
 *  @param a  [count]. @param b  [n] */
#define SST_FEATURE_PARTS 128
typedef void sst_feature_products_fn(int32_t *out, const int16_t *a, size_t count, const int16_t *b, size_t n);

#define SST_LIGHT_SHIFT 7                        /* fraction bits of samples */
#define SST_LIGHT_WHITE (255 << SST_LIGHT_SHIFT) /* largest sample; fits int16_t */

/**
 * Multiply the linear light of n samples of one colour by a factor each, sRGB code to sRGB code (IEC 61966-2-1).
 *
 * With v = value / 128, f = gain falloff[x] and its 2.4th root r, the power part of sRGB is
 * code(f light(v)) = r (v + 14.025) - 14.025, exactly; its straight part near black is f v. Within 0.02 levels of the
 * exact chain for f in 1/8 .. 8 and samples below SST_LIGHT_KEEP of white, then rounded.
 * Clipped samples stay clipped: the result is at least 255 - SST_LIGHT_KEEP (255 - v).
 *
 * @param value         [n] 0 .. SST_LIGHT_WHITE
 * @param falloff_root  [n] falloff^(1/2.4)
 */
struct sst_light {
    const uint16_t *value;
    const float *falloff, *falloff_root;
    float gain, gain_root;
};
#define SST_LIGHT_KEEP 4
typedef void sst_light_row_fn(uint8_t *out, const struct sst_light *light, size_t n);

/* --- labels (pipeline/method/labels/) --- */

#define SST_GUIDE_CELLS  16 /* at most */
#define SST_GUIDE_VALUES 8

/** Pixels of one row between the same columns and rows of a coarse grid, and the surrounding cells. */
struct sst_guide {
    size_t cells, values;               /* values of a cell: a multiple of SST_GUIDE_VALUES */
    const float *cell[SST_GUIDE_CELLS]; /* [values] each */
    float colour[3][SST_GUIDE_CELLS];   /* mean R, G, B of the image under each cell, 0..255 */
    float down[SST_GUIDE_CELLS];        /* weight of each cell by its vertical distance, > 0 */
    const float *across;                /* [n][SST_GUIDE_CELLS] weight by horizontal distance for each pixel */
    const uint8_t *pixel[3];            /* [n] R, G, B */
};
#define SST_GUIDE_SIGMA 20.0f /* levels */
#define SST_GUIDE_FLOOR 1e-3f /* minimum colour weight: a pixel unlike all cells depends on their distance only */

/**
 * Joint bilateral interpolation (Kopf et al. 2007): out[x][v] = sum over the cells of w cell[v],
 * w = across down (exp(-|pixel - colour|^2 / (2 sigma^2)) + floor); not divided by the sum of weights. The exponential
 * is sst_exp_neg(), its argument clamped to SST_EXP_NEG_MAX.
 *
 * @param out  [n][values]
 */
typedef void sst_guide_cells_fn(float *out, const struct sst_guide *g, size_t n);

/**
 * Most probable class of n pixels, ties to the smaller index, and the entropy of their distributions:
 * H = -sum over the other classes of p log p - (1 - r) log(1 - r) with r the sum of the others, so that entropies near
 * 0 keep their precision. Error at most 1e-6 + 1e-6 H for distributions that sum to 1 within a few roundings. With a
 * NaN among them the entropy is NaN, which is below no threshold; all 0: class 0, entropy 0.
 *
 * @param top      out [n]
 * @param entropy  out [n], 0 or more; or NULL
 * @param p        in [count][stride], p >= 0; n at most SST_CLASS_ROW_MAX
 */
typedef void sst_class_row_fn(uint8_t *top, float *entropy, const float *p, size_t stride, size_t count, size_t n);

/* --- labels of other views (pipeline/method/process/) --- */

/** A pixel in one number: red | green << 8 | blue << 16 | label << 24 | disparity << 32 | column << 48. */
#define SST_RAY_LABEL  24
#define SST_RAY_DISP   32
#define SST_RAY_COLUMN 48

/** Another view, and where pixels of a row of the own one lie there: along one axis a disparity d moves by
 *  whole + floor((part + d step) / 2^16). */
struct sst_shown {
    const uint64_t *rays; /* [height][width] */
    int width, height;    /* at most 32768, 2^28 pixels */
    int32_t whole[2];     /* across, down; magnitudes below 2^17 */
    int32_t part[2];      /* 0 .. 65535 */
    int32_t step[2];      /* magnitudes at most 32768 */
    int y;                /* the own row */
    int same, similar;    /* disparities and each channel of the colours differ by at most this; similar < 256 */
};

/**
 * Which pixels' surfaces another view shows: disparity and colour are alike there.
 *
 * @param at    out, [n] row << 16 | column in the other view; -1: it does not show that surface
 * @param label out, [n] the label there; 0: it does not show that surface, or has no label there
 * @param own   [n] pixels whose disparity is less than 65535
 */
typedef void sst_shown_row_fn(int32_t *at, uint8_t *label, const struct sst_shown *s, const uint64_t *own, size_t n);
#define SST_CLASS_ROW_MAX 128

/* --- live (pipeline/live/) --- */

/**
 * Extremes of stored disparities, of those of before and of `rows` rows of n more: span[0] the smallest one, span[1]
 * the largest one below `end`, 0: none.
 *
 * @param disp  rows are `stride` bytes apart
 * @param end   0 .. 0xFFFF
 */
typedef void sst_disp_span_fn(uint16_t span[2], const uint16_t *disp, size_t stride, int end, size_t n, size_t rows);

#define SST_SCORE_SLOTS 8
#define SST_SCORE_SLACK 1  /* levels, and the usual difference: do not count */
#define SST_SCORE_CAP   48 /* levels: the largest score */
#define SST_SCORE_USUAL 60 /* levels: what counts at most for the usual difference */
#define SST_SCORE_RATE  5  /* which follows by 1 / 2^rate */

/** Colours of cells: those of now, and those that each remembers; R, G, B. */
struct sst_score_cells {
    const uint8_t *now[3], *slot[SST_SCORE_SLOTS][3];
};

/**
 * Scores of n cells: the sum of the differences of three channels from the most similar colour, d, above the usual one:
 * clamp(d - floor(usual / 256) - slack, 0, cap). Then, with `learns`, usual += floor((256 min(d, 60) - usual) / 32).
 *
 * @param score  out @param usual  in, out: 1/256 level, at most 256 SST_SCORE_USUAL
 */
typedef void sst_cell_score_fn(uint8_t *score, uint16_t *usual, const struct sst_score_cells *c, int learns, size_t n);

/** sum += score, of n cells, modulo 2^16. */
typedef void sst_score_add_fn(uint16_t *sum, const uint8_t *score, size_t n);

/* --- drift check (pipeline/calibration/drift/) --- */

#define SST_CORRELATE_WIDTH  8
#define SST_CORRELATE_HEIGHT 9
#define SST_CORRELATE_SIZE   (SST_CORRELATE_WIDTH * SST_CORRELATE_HEIGHT)
#define SST_CORRELATE_NONE   (-2.0f)

/** A block of one picture, and the part of another one where it is searched. Grey values are 0 .. 255. */
struct sst_correlate {
    int16_t block[SST_CORRELATE_HEIGHT][SST_CORRELATE_WIDTH];
    int32_t sum;   /* of the block's values */
    double spread; /* SST_CORRELATE_SIZE times the sum of their squares - sum^2, above 0 */
    const int16_t *grey;
    size_t stride; /* values */
};

/** Correlation coefficients of the block with the blocks that begin at grey[at[i]]; 0 for flat ones,
 *  SST_CORRELATE_NONE where at[i] is negative. */
typedef void sst_correlate_places_fn(float *out, const struct sst_correlate *c, const int32_t *at, size_t n);

/* --- hashes --- */

/** The compression function of SHA-256 over whole blocks of 64 bytes. */
typedef void sst_sha256_blocks_fn(uint32_t state[8], const uint8_t *data, size_t blocks);
extern const uint32_t sst_sha256_constants[64];

struct sst_kernels {
#define X(name) sst_##name##_fn *name;
    SST_KERNEL_LIST(X)
#undef X
};

#define X(name) sst_##name##_fn sst_##name##_ref;
SST_KERNEL_LIST(X)
#undef X

/** The kernels for this CPU. SST_CPU=ref|base|avx2|avxvnni|avx512, on arm64 ref|neon|dotprod|i8mm, in the environment
 *  caps the level. Thread: any. */
const struct sst_kernels *sst_kernels_get(void);

/** The table of one level. @return false if this CPU or build lacks it. */
int sst_kernels_at(enum sst_cpu_level level, struct sst_kernels *out);

/** The level that sst_kernels_get() chose; its name. */
enum sst_cpu_level sst_cpu_level(void);
const char *sst_cpu_level_name(enum sst_cpu_level level);

/* Fill functions of the levels, defined by templates.h and in arm/. */
void sst_kernels_fill_base(struct sst_kernels *k);
void sst_kernels_fill_avx2(struct sst_kernels *k);
void sst_kernels_fill_avxvnni(struct sst_kernels *k);
void sst_kernels_fill_avx512(struct sst_kernels *k);
void sst_kernels_fill_dotprod(struct sst_kernels *k);
void sst_kernels_fill_i8mm(struct sst_kernels *k);

#endif
