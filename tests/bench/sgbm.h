/* tests/bench/sgbm.h - OpenCV's block matching, semi-global and plain, the baseline for comparisons. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_BENCH_SGBM_H
#define SST_TESTS_BENCH_SGBM_H

#include "pipeline/image/image.h"

SST_EXTERN_C_BEGIN

enum bench_sgbm {
    BENCH_SGBM_3WAY = 0,
    BENCH_SGBM_HH = 1,
    BENCH_BM = 2, /* block matching of grey pictures, without paths */
};

/**
 * Dense disparity of the left image: the pair is padded on the left by the range (OpenCV leaves that margin unmatched
 * otherwise), holes take the smaller of their row's neighbours, then a 5x5 median.
 *
 * @param out  out, of the images' size, px
 */
int bench_sgbm(struct sst_map_f32 *out, const struct sst_image *left, const struct sst_image *right, int disparities,
               enum bench_sgbm mode, int threads);

SST_EXTERN_C_END

#endif
