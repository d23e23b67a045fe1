/* pipeline/lightfield/export_poses.h - cameras and the names of their pictures, written for COLMAP and nerfstudio. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIGHTFIELD_EXPORT_POSES_H
#define SST_PIPELINE_LIGHTFIELD_EXPORT_POSES_H

#include "pipeline/camera/calib.h"

#define SST_EXPORT_NAME  256 /* bytes of a picture's name, which has no blanks */
#define SST_EXPORT_VIEWS 1024

/** A point of the scene: its colour, the mean distance of its sights from its projections, and the number of sights. */
struct sst_export_point {
    double at_mm[3], error_px; /* error_px below 0: unknown */
    uint8_t rgb[3];
    int sights;
};

/** A point seen in a view, px. */
struct sst_export_sight {
    int view;
    double x, y;
};

/** The known cameras of `calib`, which may have up to SST_EXPORT_VIEWS. */
struct sst_export_cameras {
    const struct sst_calib *calib;
    const char (*name)[SST_EXPORT_NAME]; /* [rows * cols]: of a view's picture below images/ */
    bool array;                          /* the pictures were taken together, by a camera each */
    const struct sst_export_point *point; /* COLMAP: [points], with their sights in the order of the points */
    const struct sst_export_sight *sight; /* of known cameras alone */
    int points;
    bool lossy;                          /* nerfstudio: accept lenses that its model misses by over 0.05 px */
};

/**
 * A COLMAP model as text in dir/sparse/0: cameras, images, points3D, rigs and frames. COLMAP's convention:
 * the upper left pixel's centre is (0.5, 0.5); poses take points (metres) from the reference camera's axes into a
 * camera.
 * @return 0, or an output error; logged
 */
SST_MUST_CHECK int sst_export_colmap(const struct sst_export_cameras *cameras, const char *dir);

/**
 * nerfstudio's transforms.json in dir. Its convention: the upper left pixel's centre is (0.5, 0.5); matrices take
 * points (metres) from the camera (x right, y up, z back) into a world with z up, y forward (recorded in
 * applied_transform).
 * @return 0, -EBADMSG (a lens that its model cannot represent), -ENOMEM, or an output error; logged
 */
SST_MUST_CHECK int sst_export_nerfstudio(const struct sst_export_cameras *cameras, const char *dir);

#endif
