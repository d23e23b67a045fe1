/* pipeline/camera/calib.h - what is known of the array's cameras: lenses, poses, light; and its file, calib.yaml. */
#ifndef SST_PIPELINE_CAMERA_CALIB_H
#define SST_PIPELINE_CAMERA_CALIB_H

#include <stdbool.h>

#include "pipeline/lightfield/lightfield.h"

#define SST_LENS_MAX      8    /* distortion coefficients: 5 or 8 */
#define SST_CALIB_LARGEST 1e12 /* magnitude of any number here */

/**
 * One camera, or one pose of the camera on a rig. A point X (mm, rig axes: x right, y down, z forward; those of the
 * reference camera unless a file says otherwise) is at P = rotation (X - position_mm) in camera axes; with a = P.x /
 * P.z, b = P.y / P.z, r2 = a^2 + b^2, s = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3) it is seen
 * at x = fx (a s + 2 p1 a b + p2 (r2 + 2 a^2)) + cx,   y = fy (b s + p1 (r2 + 2 b^2) + 2 p2 a b) + cy, pixel centres on
 * integers: OpenCV's model (Brown 1966).
 */
struct sst_calib_camera {
    bool known;             /* false: the grid has a hole here */
    char name[64];          /* serial, port, folder or "rr_cc": whatever tells the user which camera it is */
    double fx, fy, cx, cy;  /* px */
    int lens;               /* number of coefficients: 0, 5 or 8 */
    double k[SST_LENS_MAX]; /* k1 k2 p1 p2 k3 k4 k5 k6, OpenCV's order; unused ones 0 */
    double rotation[9];     /* row-major */
    double position_mm[3];  /* centre of projection */
    double gain[3];         /* of linear red, green, blue; 1: as the array's mean camera */
    double falloff[3];      /* light at r2 from the principal point, over that at it: 1 + f0 r2 + f1 r2^2 + f2 r2^3,
                               r2 in squares of half the picture's diagonal */
    double rms_px;          /* of the corners that the solution used, per point (both axes); 0: unknown */
    int corners;            /* so many */
    double sigma_px;        /* expected error of carrying a pixel of the reference view over to this one at
                               range_mm: RMS over the picture; 0: unknown */
};

struct sst_calib {
    int rows, cols, width, height; /* of the cameras' frames, px */
    int reference;                 /* view whose camera the axes are: position 0, rotation 1; the light field's rule */
    bool rig;                      /* one camera at many poses: all lenses are the same */
    double range_mm;               /* working range: median depth of the boards; 0: unknown */
    int64_t created_wall_ns;       /* 0: unknown */
    char source[256];              /* what it was made from */
    char board[128];               /* the board, as sst_board_parse() reads it; "": unknown */
    double noise_px;               /* corner noise found, one axis; 0: unknown */
    struct sst_calib_camera *camera; /* [rows * cols], by view */
};

/** Empty: all cameras unknown, reference chosen by the light field's rule. @return 0, -EINVAL, -ENOMEM */
SST_MUST_CHECK int sst_calib_init(struct sst_calib *calib, int rows, int cols);
/** Deep copy into an uninitialised object. */
SST_MUST_CHECK int sst_calib_copy(struct sst_calib *out, const struct sst_calib *in);
void sst_calib_fini(struct sst_calib *calib);

/** The first thing that is wrong (not finite, not a rotation, focal length not positive ...), NULL: nothing. The text
 *  stays until the thread's next call. */
const char *sst_calib_fault(const struct sst_calib *calib);

/** The same of one known camera: a clause, constant. */
const char *sst_camera_fault(const struct sst_calib_camera *cam);

/**
 * Read or write calib.yaml (docs/formats.md). Numbers come back bit for bit; in names, what YAML cannot hold (control
 * characters, bytes that are not UTF-8) is written as "?". What has a fault is neither read nor written.
 *
 * @param name  of the text, for messages
 * @return 0, -ENOENT, -EBADMSG (all faults with file:line:column), -EINVAL (what is to be written has a fault),
 * -ENOMEM, or what outputs return; logged.
 */
SST_MUST_CHECK int sst_calib_read(struct sst_calib *calib, const char *path);
SST_MUST_CHECK int sst_calib_parse(struct sst_calib *calib, const char *text, size_t size, const char *name);
SST_MUST_CHECK int sst_calib_write(const struct sst_calib *calib, const char *path);

/* --- geometry of one camera (camera.c) ---------------------------------------------------------------------------- */

/** Lens alone: (a, b) = (P.x, P.y) / P.z to pixels. Always defined. */
void sst_camera_distort(const struct sst_calib_camera *cam, double a, double b, double *x, double *y);

/** Pixels to (a, b), Newton's method to 1e-12. @return false: no point is seen there, the lens folds over before it */
SST_MUST_CHECK bool sst_camera_undistort(const struct sst_calib_camera *cam, double x, double y, double *a, double *b);

/** Point in rig axes to pixels. @return false: not in front of the camera, or beyond where the lens folds over */
SST_MUST_CHECK bool sst_camera_project(const struct sst_calib_camera *cam, const double X[3], double *x, double *y);

/** Rotation vector (axis times angle, rad) to matrix and back; exact near 0 and near pi. */
void sst_rotation_from_vector(const double v[3], double m[9]);
void sst_rotation_to_vector(const double m[9], double v[3]);

/** a b^T: from b's axes to a's, of rotations that both come from the same ones. out is neither a nor b. */
void sst_rotation_between(const double a[9], const double b[9], double out[9]);

#endif
