/* opencv_features.cc is in a part of its own, libsst-opencv.so. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>

#include "base/plugin.h"
#include "pipeline/posed/solve/opencv_features.h"

#define LOAD(function) sst_plugin_symbol("opencv", function, why)

int cv_features_find(struct cv_features *out, const struct cv_grey *grey, int most, char why[256])
{
    SST_PLUGIN_CALL(LOAD, cv_features_find, out, grey, most, why);
}

int cv_points_epipolar(const struct cv_points *points, uint8_t *inlier, char why[256])
{
    SST_PLUGIN_CALL(LOAD, cv_points_epipolar, points, inlier, why);
}

int cv_points_similarity(const struct cv_points *points, double within_px, double out[4], double *share, char why[256])
{
    SST_PLUGIN_CALL(LOAD, cv_points_similarity, points, within_px, out, share, why);
}
