/* pipeline/calibration/board/homography.h - homographies from a plane to its picture: fit, apply, derivatives. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CALIBRATION_BOARD_HOMOGRAPHY_H
#define SST_PIPELINE_CALIBRATION_BOARD_HOMOGRAPHY_H

#include <stdbool.h>

#include "base/base.h"

/**
 * Homography from from[i] to to[i] that minimises the weighted sum of squared distances in `to`: normalised equations
 * first (Hartley 1997), then Gauss-Newton.
 *
 * @param h       row-major, h[8] > 0 where the points are
 * @param weight  [n], or NULL: all 1
 * @return false: fewer than 4 points, most on a line, a number not finite, or some seen from behind
 */
SST_MUST_CHECK bool sst_homography_fit(double h[9], const double (*from)[2], const double (*to)[2],
                                       const double *weight, int n);

/** @return false: at or behind the horizon; out is untouched */
SST_MUST_CHECK bool sst_homography_apply(const double h[9], const double from[2], double out[2]);

/** Derivatives at a point: by = dx/du, dx/dv, dy/du, dy/dv. @return false: at or behind the horizon */
SST_MUST_CHECK bool sst_homography_slope(const double h[9], const double from[2], double by[4]);

#endif
