/* pipeline/kernels/windows.h - contracts of the kernels that correlate windows of posed views. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_KERNELS_WINDOWS_H
#define SST_PIPELINE_KERNELS_WINDOWS_H

#include <stddef.h>
#include <stdint.h>

struct sst_warped_source;
struct sst_warped_segment;

/*
 * Windows are SST_WINDOW x SST_WINDOW pixels. Column sums hold SST_WINDOW rows and are moved on row by row; they are
 * whole numbers, so a sum depends on its rows alone and not on where it was begun. Levels lie within
 * -SST_LEVEL_MAX .. SST_LEVEL_MAX, SST_LEVEL_ONE is one standard deviation: sums of 49 products stay below 2^31.
 */
#define SST_WINDOW      7
#define SST_WINDOW_AREA (SST_WINDOW * SST_WINDOW)
#define SST_LEVEL_SHIFT 3    /* a level is 2^3 levels of a source's 16 bits, about 32768 */
#define SST_LEVEL_MAX   4096 /* 32768 >> SST_LEVEL_SHIFT */
#define SST_LEVEL_ONE   512

/**
 * Levels of a row of pixels, interpolated bilinearly in a source of one channel; `seen` becomes 1 there.
 * Places are rounded to 1/256 px, the level once.
 */
typedef void sst_level_row_fn(int16_t *level, uint8_t *seen, const struct sst_warped_source *from,
                              const struct sst_warped_segment *segment, size_t segments);

/** Column sums of levels and of their squares: row[0] is added, row[1] taken away. */
typedef void sst_window_squares_fn(int32_t *sum, int32_t *squares, const int16_t *const row[2], size_t n);

/** Column sums of products: a[0] b[0] is added, a[1] b[1] taken away. */
typedef void sst_window_products_fn(int32_t *sum, const int16_t *const a[2], const int16_t *const b[2], size_t n);

/**
 * Means and 1 / standard deviations of n windows, in standard deviations of the picture: 1 / sqrt(variance + floor)
 * with a relative error of 5e-6.
 *
 * @param inverse  0 where a window's corner is not seen
 * @param sum      [n + 6] column sums, the first of the first window; `squares` also
 * @param seen     [n + 6] of the windows' first and last row; NULL: all seen
 */
struct sst_window_sums {
    const int32_t *sum, *squares;
    const uint8_t *seen[2];
    float floor;
};
typedef void sst_window_stats_fn(float *mean, float *inverse, const struct sst_window_sums *in, size_t n);

#define SST_WINDOW_OTHERS 4

/** Windows of one row of a view and of others. */
struct sst_window_row {
    const float *mean, *inverse; /* [n] of the view */
    const float *other_mean[SST_WINDOW_OTHERS], *other_inverse[SST_WINDOW_OTHERS];
    const int32_t *products[SST_WINDOW_OTHERS]; /* [n + 6] column sums of products with the view */
    size_t others;
    float floor;
};

/**
 * The mean of the two largest correlations of each window with the others', 0 at least, where it is above `largest`.
 *
 * The floor of the variances counts as alike as far as the means are: floor (1 - |difference of means|) is added to the
 * covariance, 0 from one standard deviation of the picture on.
 */
typedef void sst_window_best_fn(float *largest, const struct sst_window_row *row, size_t n);

/** Count windows of a pair with a correlation above `enough`. @param products  [n + 6] */
struct sst_window_pair {
    const float *mean[2], *inverse[2];
    const int32_t *products;
    float enough;
};
typedef void sst_window_agree_fn(uint8_t *first, uint8_t *second, const struct sst_window_pair *pair, size_t n);

/** A view's rays in one row, `channels` 1 or 3: levels in 1/64, weights in 1/2^13; 0 with count 0 where there is none. */
#define SST_WEIGHTED_SHIFT 13
struct sst_weighted_rays {
    const uint32_t *level[3], *weight;
    const uint16_t *count;
    int channels;
};

/** Sums of a row: of levels, levels times weights, weights, and rays. Weights are rounded: tails of weights of many views
 *  would outweigh a few rays. */
struct sst_weighted_sums {
    uint32_t *level[3], *weight;
    float *weighted[3];
    uint16_t *count;
};
typedef void sst_weighted_add_fn(const struct sst_weighted_sums *sums, const struct sst_weighted_rays *rays, size_t n);

#endif
