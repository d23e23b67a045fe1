/* pipeline/camera/format.h - calibrations from and to other tools' files. */
#ifndef SST_PIPELINE_CAMERA_FORMAT_H
#define SST_PIPELINE_CAMERA_FORMAT_H

#include "pipeline/camera/calib.h"

#define SST_LENS_LOSS_PX 0.05 /* largest error that a poorer lens model may bring unasked */

struct sst_calib_format_config {
    int rows, cols;    /* reading: the grid, where the source has none; 0: not given */
    int width, height; /* reading: size of the frames, where the source has none; 0: not given */
    double unit_mm;    /* reading: unit of the source's lengths; 0: the format's */
    bool lossy;        /* writing: also when a lens fits the format's model no better than SST_LENS_LOSS_PX */
    bool force;        /* writing: replace an earlier folder */
};

/**
 * One format. What is read ends in the axes of the reference camera and in mm. Writing tells nothing of what the format
 * has no word for: `lost` says it.
 *
 * read  @return 0, -ENOENT, -EBADMSG, -EINVAL (a grid or size that does not fit), -ENOMEM; logged
 * write: of a calibration without a fault
 *       @return 0, -EINVAL (more cameras than the format takes), -EBADMSG (a lens that its model cannot follow),
 * -EEXIST, or what outputs return; logged
 */
struct sst_calib_format {
    const char *name;  /* "kalibr" */
    const char *files; /* what it is on disk */
    const char *lost;  /* what of a calibration it cannot hold; "" nothing */
    int (*read)(struct sst_calib *out, const char *path, const struct sst_calib_format_config *cfg); /* or NULL */
    int (*write)(const struct sst_calib *calib, const char *path, const struct sst_calib_format_config *cfg);
};

/** By name; NULL and logged where there is none. */
const struct sst_calib_format *sst_calib_format_find(const char *name);

/** The format of a file or folder, by its content. NULL and logged: it cannot be read, or is none of ours. */
const struct sst_calib_format *sst_calib_format_of(const char *path);

/** The format that a name for an output suggests: *.json multical, *camchain*.yaml Kalibr, *.cameramodel mrcal, *.yml
 *  and folders OpenCV, other *.yaml ours. NULL and logged: none. */
const struct sst_calib_format *sst_calib_format_for(const char *path);

/** The readers for texts in memory. */
SST_MUST_CHECK int sst_kalibr_parse(struct sst_calib *out, const char *text, size_t size, const char *name,
                                    const struct sst_calib_format_config *cfg);
SST_MUST_CHECK int sst_multical_parse(struct sst_calib *out, const char *text, size_t size, const char *name,
                                      const struct sst_calib_format_config *cfg);
/** A file of one camera. */
SST_MUST_CHECK int sst_opencv_parse(struct sst_calib *out, const char *text, size_t size, const char *name,
                                    const struct sst_calib_format_config *cfg);

/**
 * The lens with fewer coefficients that is nearest over the picture: least squares in pixels with focal lengths and
 * centre kept, on a grid of rays that reaches the picture's edges. A lens that needs no more is kept as it is.
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
