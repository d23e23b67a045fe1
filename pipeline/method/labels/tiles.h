/* pipeline/method/labels/tiles.h - one axis cut into overlapping windows of equal length whose weights sum to 1. */
#ifndef SST_PIPELINE_METHOD_LABELS_TILES_H
#define SST_PIPELINE_METHOD_LABELS_TILES_H

#include "base/base.h"

struct sst_tiles {
    int total, length; /* samples of the axis and of each window; multiples of unit */
    int overlap;       /* samples over which one window gives way to the next; neighbours share at least these */
    int unit;          /* windows start at multiples of it */
    int count;         /* of windows */
};

/**
 * As few windows as share a quarter of their length, spread evenly from the first to the last sample; one window of the
 * whole axis where that is not longer than length.
 *
 * @param total   at least 1, a multiple of unit
 * @param length  a multiple of unit, at least 8 of them where it is less than total
 */
struct sst_tiles sst_tiles_plan(int total, int length, int unit);

/** First sample of window k. */
int sst_tiles_start(const struct sst_tiles *t, int k);

/**
 * Weight of sample i of window k, 0..1. The weights of all windows at one place of the axis sum to 1 (to the rounding
 * of floats): window k takes over from k - 1 along 3 u^2 - 2 u^3 in the middle of what they share, so that the ends of
 * a window, which see nothing beyond them, do not count.
 */
float sst_tiles_weight(const struct sst_tiles *t, int k, int i);

#endif
