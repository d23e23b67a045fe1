/* pipeline/lightfield/calibrated.h - light fields with raw frames as files, rectified by a calibration. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIGHTFIELD_CALIBRATED_H
#define SST_PIPELINE_LIGHTFIELD_CALIBRATED_H

#include "base/file.h"
#include "pipeline/lightfield/rectify/rectify.h"

#define SST_CALIBRATION_FILE "calibration.yaml" /* in the folder of a calibrated light field */

/** A calibration and how to apply it. */
struct sst_use_calibration {
    struct sst_calib calib;
    char path[SST_PATH_MAX]; /* for messages */
    struct sst_rectify_config plan;
    enum sst_filter filter;
};

/** Bicubic; size and focal length of the cameras, plane at the calibration's range; calib is empty. */
void sst_use_calibration_defaults(struct sst_use_calibration *use);
/** Read the calibration. @return as sst_calib_read() */
SST_MUST_CHECK int sst_use_calibration_read(struct sst_use_calibration *use, const char *path);
void sst_use_calibration_fini(struct sst_use_calibration *use);

/**
 * Reject a calibration for another grid; mark views of cameras that it lacks absent (a warning lists them). Call it
 * before copying files.
 * @return 0, -EBADMSG (another grid, or no view is left; logged)
 */
SST_MUST_CHECK int sst_lightfield_fit_calibration(struct sst_lightfield *lf, const struct sst_use_calibration *use);

/**
 * Calibrate a light field with the width and height of its raw frames: sets calibration, rectified, filter,
 * width and height, focal length, spacing and the views' true offsets; maps must be empty.
 *
 * @return 0, -EBADMSG (size of frames, a refusal of sst_rectify_plan(), a view without any pixel), -EINVAL (use->plan),
 * -ENOMEM; logged, lf untouched
 */
SST_MUST_CHECK int sst_lightfield_calibrate(struct sst_lightfield *lf, const struct sst_use_calibration *use);

/** Replace a view's raw image by the rectified one, and set its validity mask; keeps the raw image as its `original` if
 *  lf->keeps_sources. @return 0, -EINVAL, -ENOMEM; logged */
SST_MUST_CHECK int sst_lightfield_rectify_view(struct sst_lightfield *lf, int view);

/** The pinhole camera of a rectified view: centre in mm from the reference view's, principal point moved where views converge. Where
 *  infinity is not known the views count as parallel. @return false: focal length or spacing is unknown, or the view absent */
bool sst_lightfield_camera(struct sst_calib_camera *out, const struct sst_lightfield *lf, int view);

/** Fractions 0..1: of a view's pixels that come from inside its raw frame, and of the raw frame's pixels that are used.
 */
struct sst_rectified_coverage {
    double filled, kept;
};

/** Coverage of the views of a calibrated light field, from one pixel in 256. @return 0 or -ENOMEM (logged) */
SST_MUST_CHECK int sst_lightfield_coverage(const struct sst_lightfield *lf, int threads,
                                           struct sst_rectified_coverage *worst, struct sst_rectified_coverage *mean);

struct sst_rectify_dir_config {
    const char *dir, *out;
    const struct sst_use_calibration *use; /* NULL: the light field's own, as it is */
    bool bake;                             /* write rectified PNG views and no calibration */
    bool force;
    int threads;
    void (*progress)(void *arg, double done); /* or NULL */
    void *progress_arg;
};

/**
 * Write a light field from the raw frames of another one. Its maps are left out: they belong to the old geometry.
 *
 * @param calibrated  out, as it is written but never baked; nothing is loaded
 * @return 0, -EINVAL, -ENOENT, -EBADMSG, -EEXIST, -ENOSPC, -EIO, -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_lightfield_rectify_dir(const struct sst_rectify_dir_config *cfg,
                                              struct sst_lightfield *calibrated);

#endif
