/* pipeline/method/labels/labels_internal.h - private declarations of this folder. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_LABELS_LABELS_INTERNAL_H
#define SST_PIPELINE_METHOD_LABELS_LABELS_INTERNAL_H

#include "base/base.h"
#include "base/mem.h"
#include "pipeline/image/image.h"
#include "pipeline/method/labels/labels.h"

/* --- resample: an image resized to the working size of a network, as floats. --- */

/** Planes of floats that an image becomes: (sample / 255 - mean[c]) / std[c]. */
struct resampled {
    float *out; /* [3][height][width] */
    int width, height;
    double mean[3], std[3];
};

/**
 * Resize the three planes: along an axis that shrinks, each output sample is the mean of the input samples that it
 * covers (fractions of samples at the ends included); along one that grows, bilinear with half-pixel centres. Same
 * bytes for any threads.
 *
 * @param kept  scratch
 * @return 0 or -ENOMEM (not logged)
 */
SST_MUST_CHECK int resample_planes(const struct resampled *to, const struct sst_image *img, int threads,
                                   struct sst_mem_kept *kept);

/* --- tiles: one axis cut into overlapping windows of equal length whose weights sum to 1. --- */

struct tiles {
    int total, length; /* samples of the axis and of each window; multiples of unit */
    int overlap;       /* samples of the transition between two windows; neighbours share at least these */
    int unit;          /* windows start at multiples of it */
    int count;         /* of windows */
};

/**
 * The smallest number of windows that overlap by a quarter of their length, spread evenly over the axis; one window if
 * the axis is not longer than length.
 *
 * @param total   at least 1, a multiple of unit
 * @param length  a multiple of unit, at least 8 of them where it is less than total
 */
struct tiles tiles_plan(int total, int length, int unit);

/** First sample of window k. */
int tiles_start(const struct tiles *t, int k);

/**
 * Weight of sample i of window k, 0..1. At each point of the axis the weights of all windows sum to 1 (to the rounding
 * of floats): the transition from k - 1 to k follows 3 u^2 - 2 u^3 in the middle of their overlap, so that the ends of
 * a window, which lack context, do not count.
 */
float tiles_weight(const struct tiles *t, int k, int i);

/* --- upsample: labels and entropies of every pixel from class probabilities on a coarse grid. --- */

/** Class distributions in the cells of a grid that covers the image. */
struct class_grid {
    int width, height, count;
    size_t values; /* floats of a cell: class_grid_values() */
    float *cell;   /* [height][width][values]: count probabilities, >= 0 with sum 1; the rest is used internally */
};

/** Maps of the image's size. */
struct upsampled {
    struct sst_map_u8 *label;
    struct sst_map_f32 *entropy; /* or NULL */
    float *prob;                 /* [count][height][width]; or NULL */
};

/** Scratch. Zeroed: none yet. */
struct upsample_memory {
    struct sst_mem_kept own, resample;
};

void upsample_memory_fini(struct upsample_memory *memory);

/** Floats of a cell of `count` classes: room for the sum of weights, rounded up for the kernel. */
size_t class_grid_values(int count);

/**
 * Most probable class + 1 and entropy of every pixel, from the 4x4 cells around it: each is weighted by its distance
 * (Gauss, 0.7 cells) and by the difference between the pixel's colour and the image's mean under the cell (Gauss,
 * SST_GUIDE_SIGMA). So leaves and outlines end at image edges, not between cells. If all 16 cells have the same winner
 * it wins, which saves most of the work when only the label is requested; if their entropies are small as well, the
 * pixel's is interpolated between the cells, unless probabilities are requested.
 *
 * @param grid  the free floats of its cells are set here
 * @return 0 or -ENOMEM (not logged). Same bytes for any number of threads; the same labels whatever else is requested.
 */
SST_MUST_CHECK int labels_upsample(const struct upsampled *out, struct class_grid *grid, const struct sst_image *img,
                                   int threads, struct upsample_memory *memory);

#endif
