/* pipeline/camera/format.h - import and export of calibrations in other tools' formats. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CAMERA_FORMAT_H
#define SST_PIPELINE_CAMERA_FORMAT_H

#include "pipeline/camera/calib.h"

#define SST_LENS_LOSS_PX 0.05 /* largest error of a simpler lens model that is accepted without asking */
#define SST_CALIB_FILE_MAX ((size_t)64 << 20) /* other tools list every picture and point beside the cameras */

struct sst_calib_format_config {
    int rows, cols;    /* reading: the grid, if the source has none; 0: not given */
    int width, height; /* reading: size of the frames, if the source has none; 0: not given */
    double unit_mm;    /* reading: unit of the source's lengths; 0: the format's */
    bool plain_names;  /* reading: names such as 04_12 are no places */
    bool lossy;        /* writing: accept lenses that the format's model misses by over SST_LENS_LOSS_PX */
    bool force;        /* writing: replace an earlier folder */
};

/**
 * One format. A calibration that was read is in the axes of the reference camera and in mm. Writing omits properties
 * that the format cannot represent: `lost` lists them.
 *
 * read  @return 0, -ENOENT, -EBADMSG, -EINVAL (a grid or size that does not fit), -ENOMEM; logged
 * write: of a calibration without a fault
 *       @return 0, -EINVAL (too many cameras for the format), -EBADMSG (a lens that its model cannot represent),
 * -EEXIST, or an output error; logged
 */
struct sst_calib_format {
    const char *name;  /* "kalibr" */
    const char *files; /* description of its files */
    const char *lost;  /* properties that it cannot represent; "": nothing is lost */
    int (*read)(struct sst_calib *out, const char *path, const struct sst_calib_format_config *cfg); /* or NULL */
    int (*write)(const struct sst_calib *calib, const char *path, const struct sst_calib_format_config *cfg);
};

/** Find a format by name. @return NULL: unknown; logged */
const struct sst_calib_format *sst_calib_format_find(const char *name);

/** The format of a file or folder, by its content. @return NULL: unreadable or unknown; logged */
const struct sst_calib_format *sst_calib_format_of(const char *path);

/** The format implied by the name of an output: *.json multical, *camchain*.yaml Kalibr, *.cameramodel mrcal, *.yml
 *  and folders OpenCV, other *.yaml ours. @return NULL: none; logged */
const struct sst_calib_format *sst_calib_format_for(const char *path);

/** Parsers for text in memory. */
SST_MUST_CHECK int sst_kalibr_parse(struct sst_calib *out, const char *text, size_t size, const char *name,
                                    const struct sst_calib_format_config *cfg);
SST_MUST_CHECK int sst_multical_parse(struct sst_calib *out, const char *text, size_t size, const char *name,
                                      const struct sst_calib_format_config *cfg);
/** A file for one camera. */
SST_MUST_CHECK int sst_opencv_parse(struct sst_calib *out, const char *text, size_t size, const char *name,
                                    const struct sst_calib_format_config *cfg);

/**
 * Fit the nearest lens with fewer coefficients: least squares in pixels with focal lengths and centre fixed, on a grid
 * of rays that reaches the picture's edges. A lens that needs no more is copied.
 *
 * @param coefficients  4 (k1 k2 p1 p2) or 5 (and k3)
 * @param worst_px      largest distance on that grid
 * @return 0, -EBADMSG (the lens folds over within the picture; not logged)
 */
SST_MUST_CHECK int sst_lens_reduce(struct sst_calib_camera *out, double *worst_px, const struct sst_calib_camera *in,
                                   int width, int height, int coefficients);

/**
 * A copy with every lens reduced. Warns of errors from 0.001 px on; refuses beyond SST_LENS_LOSS_PX,
 * naming the worst camera, unless lossy.
 * @param what  the format's name, for messages
 * @return 0, -EBADMSG (refused), -ENOMEM; logged
 */
SST_MUST_CHECK int sst_calib_reduce(struct sst_calib *out, const struct sst_calib *in, int coefficients, bool lossy,
                                    const char *what);

#endif
