/* pipeline/posed/solve/opencv_features.h - OpenCV's features and robust fits as plain C: no exceptions, no OpenCV
 * types. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_SOLVE_OPENCV_FEATURES_H
#define SST_PIPELINE_POSED_SOLVE_OPENCV_FEATURES_H

#include "base/base.h"

SST_EXTERN_C_BEGIN

/* All return 0, -ENOTSUP (libsst-opencv.so cannot be loaded), -ENOMEM or -EINVAL (OpenCV refused); the reason, cut to
 * one line, is in why[256]. Not logged. The same bytes for any number of threads. Thread: any. */

#define CV_DESCRIPTOR 128

/** Levels of a picture, 0 to 255, without gaps between rows. */
struct cv_grey {
    const float *level;
    int width, height;
};

/** Features of a picture: centres (px, pixel centres on integers) and RootSIFT descriptors in whole numbers up to 512,
 *  whose products sum without rounding. Both NULL: empty. */
struct cv_features {
    int count;
    float (*at)[2];
    int16_t *descriptor; /* [count][CV_DESCRIPTOR] */
};

/**
 * SIFT features of a picture whose levels are first divided by their local spread (Gaussian, 24 px): exposure, veils
 * and dark parts do not matter.
 *
 * @param most  features at most, the strongest ones
 * @param out   out; of malloc(), owned by the caller
 */
SST_MUST_CHECK int cv_features_find(struct cv_features *out, const struct cv_grey *grey, int most, char why[256]);

/** Positions of the same points in two pictures. */
struct cv_points {
    int count; /* 8 at least */
    const float (*a)[2], (*b)[2];
};

/** Mark the points that one fundamental matrix, or else one homography, explains within 1.5 px (MAGSAC). @param inlier
 * out [count], 0 or 1 */
SST_MUST_CHECK int cv_points_epipolar(const struct cv_points *points, uint8_t *inlier, char why[256]);

/**
 * Similarity that takes most points of a to b within `within_px`: b = (s -r; r s) a + t.
 *
 * @param out    out: s, r, t
 * @param share  out, of the points that it explains; 0: there is none, out is untouched
 */
SST_MUST_CHECK int cv_points_similarity(const struct cv_points *points, double within_px, double out[4], double *share,
                                        char why[256]);

SST_EXTERN_C_END

#endif
