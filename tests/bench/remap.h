/* tests/bench/remap.h - OpenCV's remap, the baseline for rectification. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_BENCH_REMAP_H
#define SST_TESTS_BENCH_REMAP_H

#include "base/base.h"

SST_EXTERN_C_BEGIN

#include "pipeline/image/image.h"
#include "pipeline/lightfield/rectify/rectify.h"

struct bench_remap; /* a picture interleaved, and places in fixed point; opaque */

/** @param x, y  in, of each output pixel its place in the picture; -1 outside @return NULL on failure */
struct bench_remap *bench_remap_create(const struct sst_image *img, const struct sst_map_f32 *x,
                                       const struct sst_map_f32 *y, enum sst_filter filter);
void bench_remap_destroy(struct bench_remap *r);

/** Make the picture, on one thread; pixels from outside are black. */
void bench_remap_run(struct bench_remap *r);

/** Copy that picture. @param out  of the maps' size */
void bench_remap_copy(const struct bench_remap *r, struct sst_image *out);

SST_EXTERN_C_END

#endif
