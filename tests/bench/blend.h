/* tests/bench/blend.h - the weighted sum of shifted views, written in OpenCV: remap each view, then blend. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_BENCH_BLEND_H
#define SST_TESTS_BENCH_BLEND_H

#include "base/base.h"

SST_EXTERN_C_BEGIN

#include "pipeline/method/render/render.h"

struct bench_blend; /* the views as OpenCV holds them, interleaved, and a weight of every ray; opaque */

/**
 * Copy the views of a light field, all present. What is prepared here is not part of the picture's time: for
 * see-through the weight maps, which OpenCV has no function for, come ready-made from sst_render_weights().
 *
 * @return NULL on failure, logged
 */
struct bench_blend *bench_blend_create(const struct sst_lightfield *lf, struct sst_renderer *renderer,
                                       const struct sst_render_config *cfg);
void bench_blend_destroy(struct bench_blend *b);

/** Make the picture that cfg asks for, inside b: bands of rows in parallel, each view by warpAffine (bilinear). */
void bench_blend_render(struct bench_blend *b);

/** Copy that picture. @param out  of the same size */
void bench_blend_copy(const struct bench_blend *b, struct sst_image *out);

SST_EXTERN_C_END

#endif
