/* tests/bench/warp.h - OpenCV's sums of pictures warped by homographies, the baseline for integrals. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_BENCH_WARP_H
#define SST_TESTS_BENCH_WARP_H

#include "base/base.h"

SST_EXTERN_C_BEGIN

#include "pipeline/image/image.h"

/** sum += picture at H of each pixel, bilinear, by warpPerspective() and add(). @param sum  [height][width] */
void bench_warp_add(int32_t *sum, int width, int height, const struct sst_map_u16 *picture, const double homography[9],
                    int threads);

SST_EXTERN_C_END

#endif
