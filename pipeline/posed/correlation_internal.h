/* pipeline/posed/correlation_internal.h - private to surfaces: correlation of views on a surface. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_CORRELATION_INTERNAL_H
#define SST_PIPELINE_POSED_CORRELATION_INTERNAL_H

#include "pipeline/posed/surface_internal.h"

#define CORRELATION_VIEWS 16 /* at most: their sums fit 32 bits */

struct correlation_rows;

struct correlation {
    struct warp warp;
    const struct greys *greys;
    struct sst_deep *local; /* [views] levels divided by their local spread */
    struct correlation_rows *rows; /* [threads] */
    int64_t (*tally)[2];           /* [bands] of the warp: products of pairs, pairs */
    int threads;
};

/* @param greys  2 to CORRELATION_VIEWS; borrowed @return 0, -ENOMEM; not logged */
SST_MUST_CHECK int correlation_init(struct correlation *out, const struct sst_virtual *camera,
                                    const struct sst_surface *surface, const struct greys *greys, int threads);
void correlation_fini(struct correlation *c);

/*
 * Mean product of the levels of two views that see the same pixel of a surface, over all pixels and pairs. Levels are
 * differences from the local mean in local spreads, cut at 2.5: blurred foliage in front has mean 0, and a few bright
 * patches do not outweigh the rest. The same for any number of threads.
 *
 * @param out  out; 0: no pixel is seen twice @return 0
 */
SST_MUST_CHECK int correlation_on(double *out, struct correlation *c, const struct sst_surface *surface);

#endif
