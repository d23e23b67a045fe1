/* pipeline/camera/calib.h - calibration of an array (lenses, poses, photometry) and its file, calib.yaml. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CAMERA_CALIB_H
#define SST_PIPELINE_CAMERA_CALIB_H

#include <stdbool.h>

#include "pipeline/lightfield/lightfield.h"

#define SST_LENS_MAX      8    /* distortion coefficients: 5 or 8 */
#define SST_CALIB_LARGEST 1e12 /* largest magnitude of any number in a calibration */

/**
 * One camera, or one pose of the camera on a rig: OpenCV's model (Brown 1966), pixel centres on integers.
 *
 * A point X (mm, rig axes: x right, y down, z forward; by default the reference camera's) is at
 * P = rotation (X - position_mm) in camera axes. With a = P.x / P.z, b = P.y / P.z, r2 = a^2 + b^2 and
 * s = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3) it projects to
 *   x = fx (a s + 2 p1 a b + p2 (r2 + 2 a^2)) + cx
 *   y = fy (b s + p1 (r2 + 2 b^2) + 2 p2 a b) + cy
 */
struct sst_calib_camera {
    bool known;             /* false: the grid has a hole here */
    char name[64];          /* serial, port, folder or "rr_cc": identifies the camera to the user */
    double fx, fy, cx, cy;  /* px */
    int lens;               /* number of coefficients: 0, 5 or 8 */
    double k[SST_LENS_MAX]; /* k1 k2 p1 p2 k3 k4 k5 k6, OpenCV's order; unused ones 0 */
    double rotation[9];     /* row-major */
    double position_mm[3];  /* centre of projection */
    double gain[3];         /* of linear red, green, blue; 1: the array's mean camera */
    double falloff[3]; /* relative light 1 + f0 r2 + f1 r2^2 + f2 r2^3 at r2 from the principal point, in squared half
                          diagonals of the picture */
    double rms_px;     /* of the corners in use, per point (both axes); 0: unknown */
    int corners;       /* number of corners in use */
    double sigma_px;   /* expected error of transferring a pixel from the reference view at range_mm: RMS over the
                          picture; 0: unknown */
};

struct sst_calib {
    int rows, cols, width, height;   /* of the cameras' frames, px */
    int reference;                   /* view that defines the axes: position 0, rotation 1; as for light fields */
    bool rig;                        /* one camera at many poses: all lenses are the same */
    double range_mm;                 /* working range: median depth of the boards; 0: unknown */
    int64_t created_wall_ns;         /* 0: unknown */
    char source[256];                /* origin of the calibration */
    char board[128];                 /* the board in the syntax of sst_board_parse(); "": unknown */
    double noise_px;                 /* corner noise found, one axis; 0: unknown */
    struct sst_calib_camera *camera; /* [rows * cols], by view */
};

/** Initialise empty: all cameras unknown, reference chosen as for light fields. @return 0, -EINVAL, -ENOMEM */
SST_MUST_CHECK int sst_calib_init(struct sst_calib *calib, int rows, int cols);
/** Deep copy into an uninitialised object. */
SST_MUST_CHECK int sst_calib_copy(struct sst_calib *out, const struct sst_calib *in);
void sst_calib_fini(struct sst_calib *calib);

/** The first fault (not finite, not a rotation, focal length not positive ...), NULL: none. The text is valid until
 *  this thread's next call. */
const char *sst_calib_fault(const struct sst_calib *calib);

/** The first fault of one known camera, as a clause; the text is static. */
const char *sst_camera_fault(const struct sst_calib_camera *cam);

/**
 * Read or write calib.yaml (docs/integrate/formats.md). Numbers survive a round trip bit for bit; in names, characters
 * that YAML cannot represent (control characters, bytes that are not UTF-8) are written as "?". A calibration with a
 * fault is neither read nor written.
 *
 * @param name  of the text, for messages
 * @return 0, -ENOENT, -EBADMSG (all faults with file:line:column), -EINVAL (the calibration to write has a fault),
 * -ENOMEM, or an output error; logged.
 */
SST_MUST_CHECK int sst_calib_read(struct sst_calib *calib, const char *path);
SST_MUST_CHECK int sst_calib_parse(struct sst_calib *calib, const char *text, size_t size, const char *name);
SST_MUST_CHECK int sst_calib_write(const struct sst_calib *calib, const char *path);

/* --- geometry of one camera (camera.c) ---------------------------------------------------------------------------- */

/** Lens alone: (a, b) = (P.x, P.y) / P.z to pixels. Always defined. */
void sst_camera_distort(const struct sst_calib_camera *cam, double a, double b, double *x, double *y);

/** Put s (a, b) (1 + k1 r2) before a lens, s a factor of its focal length; terms beyond r2^3 are left out. */
void sst_camera_adjust(struct sst_calib_camera *cam, double s, double k1);

/** Pixels to (a, b), Newton's method to 1e-12. @return false: no point projects there, the lens folds over before it */
SST_MUST_CHECK bool sst_camera_undistort(const struct sst_calib_camera *cam, double x, double y, double *a, double *b);

/** Rotation vector (axis times angle, rad) to matrix and back; exact near 0 and near pi. */
void sst_rotation_from_vector(const double v[3], double m[9]);
void sst_rotation_to_vector(const double m[9], double v[3]);

/** out = a b^T: rotation from b's axes to a's, both given relative to the same axes. out must be neither a nor b. */
void sst_rotation_between(const double a[9], const double b[9], double out[9]);

#endif
