/* pipeline/calibration/solve/solve_internal.h - declarations shared by the files of the solver. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CALIBRATION_SOLVE_SOLVE_INTERNAL_H
#define SST_PIPELINE_CALIBRATION_SOLVE_SOLVE_INTERNAL_H

#include "pipeline/calibration/solve/solve.h"
#include "pipeline/camera/numbers.h"

#define SOLVE_LENS_MAX    (4 + SST_LENS_MAX)       /* fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6 */
#define SOLVE_COLS_MAX    (SOLVE_LENS_MAX + 6 + 3) /* lens, relative pose, board warp, residual */
#define SOLVE_MIN_CORNERS 6                        /* of a detection, for a pose */

/* --- small dense algebra (solve_linalg.c), all row-major ---------------------------------------------------------- */

void solve_mul3t(const double a[9], const double b[9], double out[9]); /* a^T b */
/** Left Jacobian J of the exponential: d(exp(v) p) = -[exp(v) p]x J dv. */
void solve_left_jacobian(const double v[3], double out[9]);
/** Lower Cholesky factor in place of the lower half of a[n][n]. @return false: not positive definite */
bool solve_cholesky(double *a, int n);
/** Lower Cholesky factor to the full inverse, in place; work [n]. */
void solve_cholesky_inverse(double *l, int n, double *work);
/** Householder QR in place: a[m][n] becomes its R in the first min(m, n) rows; rows beyond are garbage. */
void solve_qr(double *a, int m, int n);

/* --- the problem -------------------------------------------------------------------------------------------------- */

struct solve_pose {
    double rotation[9], shift[3]; /* p to rotation p + shift */
};

void solve_pose_chain(struct solve_pose *out, const struct solve_pose *second, const struct solve_pose *first);
void solve_pose_inverse(struct solve_pose *out, const struct solve_pose *in);

struct solve_corner {
    double p[2], bulge[2]; /* board, mm; the warp's two shapes there */
    double x, y, weight;   /* measured */
    int id;
    bool out; /* outlier */
};

struct solve_detection {
    int view, frame, corners;
    bool used; /* takes part */
    struct solve_corner *corner;
};

struct solve_camera {
    bool known;
    double lens[SOLVE_LENS_MAX];
    struct solve_pose pose; /* rig to camera */
};

struct solve_frame {
    bool known;
    struct solve_pose pose; /* board to rig */
};

struct solve_problem {
    int views, frames, count, reference, width, height;
    int lens;       /* coefficients that are solved or kept: 0, 5 or 8 */
    bool rig;       /* one lens for all views */
    bool keep_lens; /* lenses are given */
    bool keep_warp;
    bool keep_cameras; /* only boards move */
    double warp[2], warp_sigma_mm;
    int threads;
    struct solve_camera *camera;       /* [views] */
    struct solve_frame *frame;         /* [frames] */
    struct solve_detection *detection; /* [count] */
    struct solve_corner *pool;         /* all corners, or NULL where another problem owns them */
};

/** Copy cameras, frames and detections; the corners are shared. */
SST_MUST_CHECK int solve_problem_copy(struct solve_problem *out, const struct solve_problem *in);
void solve_problem_fini(struct solve_problem *p);

/* --- one detection (solve_block.c) -------------------------------------------------------------------------------- */

/** Derivatives of a pixel by the camera point and by the lens, 4 + coefficients. */
struct solve_slopes {
    double q[2][3], lens[2][SOLVE_LENS_MAX];
};

/** Camera point to pixels. Always finite: points beside and behind the camera are taken at a small depth.
 *  @param slopes  out, NULL: not needed */
void solve_see(const double *lens, int coefficients, const double q[3], double xy[2], struct solve_slopes *slopes);

/** Derivatives by a rotation of a point `at` and by a shift, dq = w x q + v, from derivatives by q. */
void solve_by_motion(const double by_point[3], const double at[3], double weight, double out[6]);

/** A camera at the origin with this lens. */
struct sst_calib_camera solve_camera_of(const double *lens);

/** Board corner to camera axes: rotation part and the point itself. */
void solve_corner_place(const struct solve_pose *board_to_camera, const struct solve_corner *c, const double warp[2],
                        double turned[3], double q[3]);

/**
 * Weighted rows of a detection that is not empty: [lens | rotation, shift of the board in front of the camera | warp |
 * residual (predicted minus measured)]; columns for lens and warp only if solved. Outliers are left out.
 *
 * @param loss_px  scale of Cauchy's loss, in the rows by its square root; 0: least squares
 * @param rows     out, [2 corners][columns]
 * @return number of rows
 */
int solve_block(const struct solve_problem *p, const struct solve_detection *d, const struct solve_pose *board,
                double loss_px, double *rows);
int solve_block_columns(const struct solve_problem *p); /* including the residual */

/** Board to camera for a detection. */
void solve_relative(const struct solve_problem *p, const struct solve_detection *d, struct solve_pose *out);
/** Residuals (predicted minus measured, px, not weighted) of all corners, outliers too. */
void solve_residuals(const struct solve_problem *p, const struct solve_detection *d, double (*out)[2]);

/* --- joint adjustment (solve_adjust.c) ---------------------------------------------------------------------------- */

/* Index of the first state of each object, -1: not a state. Lenses first, then cameras, boards, warp. */
struct solve_layout {
    int lens_size;
    int *lens, *pose; /* [views] */
    int *frame;       /* [frames] */
    int warp, states, camera_states /* before the boards' */;
    double *scale; /* [states] unit of each */
};

SST_MUST_CHECK int solve_layout_init(struct solve_layout *out, const struct solve_problem *p);
void solve_layout_fini(struct solve_layout *layout);

/* Mapping of one detection's columns to states. */
struct solve_spread {
    double camera_turn[9], across[9], rotation[9], board_turn[9]; /* Jc, [Rc tf]x, Rc, Rf's Jf in camera axes */
    int lens, pose, frame, warp;                                  /* first state, or -1 */
    int lens_columns;
    const double *scale; /* of the layout */
};

/** @param turns  rotations of camera and board since the layout's poses, at which Jc and Jf are evaluated; NULL: none
 */
void solve_spread_make(struct solve_spread *out, const struct solve_problem *p, const struct solve_layout *layout,
                       const struct solve_detection *d, const double *const turns[2]);
/** The entries of one row, columns before `from` being zero: ascending states and scaled values. @return their number
 */
int solve_spread_row(const struct solve_spread *s, const double *row, int from, int *state, double *value);

/* Priors, as rows with one entry: the board's warp, and the denominator of lenses with 8 coefficients. */
int solve_priors(const struct solve_problem *p, const struct solve_layout *layout, int *state, double *value,
                 double *residual); /* arrays of 2 + 3 views; NULL: count only */

struct solve_adjusted {
    int states, measurements, evaluations;
    double cost, rcond; /* sum of squares; of the scaled normal matrix */
    bool converged;
};

struct solve_adjust_config {
    double loss_px;
    int max_iterations;
    double tolerance; /* of the states' updates, in their units */
};

/** Minimise over everything that is not held fixed. @return 0, -ENOMEM, -EDOM (nothing to fit), -ENOTSUP */
SST_MUST_CHECK int solve_adjust(struct solve_problem *p, const struct solve_adjust_config *cfg,
                                struct solve_adjusted *out);

/** Convergence limit of the states' updates, in their units: a thousandth of a well-determined state's uncertainty. */
#define SOLVE_TOLERANCE 1e-5

/* --- initial values (solve_seed.c, solve_graph.c) ----------------------------------------------------------------- */

/* Pose of one detection from its own corners. */
struct solve_single {
    bool known;
    bool mirrored;          /* only fits a board seen from behind */
    struct solve_pose pose; /* board to camera */
    double rms_px;          /* robust: of the median residual */
};

/** Pose of a detection relative to a camera with a known lens. */
void solve_single_camera(struct solve_single *out, const struct solve_problem *p, const struct solve_detection *d,
                         const double *lens);

/**
 * Initial lenses of all cameras, each from its own detections (a rig: from all), and the pose of each detection.
 * Cameras with too few detections use the median of the others. Mirrored detections are removed from the problem.
 */
SST_MUST_CHECK int solve_seed(struct solve_problem *p, struct solve_single *single);

/** Links of all pairs of views, sorted by a then b; the spanning tree with most corners is marked. Owner: the caller
 *  frees. */
SST_MUST_CHECK int solve_links(const struct solve_problem *p, struct sst_solve_link **links, int *count);

/** Cameras and boards from detections' poses along the tree; ones not linked to the reference become unknown. */
SST_MUST_CHECK int solve_chain(struct solve_problem *p, const struct solve_single *single,
                               const struct sst_solve_link *links, int count);

/** Corner noise: median length of the weighted residuals in use over 1.1774, one axis' sigma if they are normal. */
SST_MUST_CHECK int solve_noise(const struct solve_problem *p, double *sigma_px);

/* --- the flow (solve.c, solve_robust.c) --------------------------------------------------------------------------- */

/** Points further off than this many sigma of an axis are outliers: 4 in a million for normal noise. */
#define SOLVE_OUTLIER_SIGMA 5
/** Default limit of the fraction of outliers. */
#define SOLVE_MOST_OUTLIERS 0.03

/** Fill an empty problem from corners; corners that are not finite or not on the board are refused (force: ignored). */
SST_MUST_CHECK int solve_problem_make(struct solve_problem *out, const struct sst_detections *all,
                                      const struct sst_solve_config *cfg);

/** Robust fit from a seed: all states move, no corner is dropped. sigma_px: out, estimated corner noise. */
SST_MUST_CHECK int solve_soft(struct solve_problem *p, double *sigma_px);

/** Least squares with outliers cut at k sigma until the set is stable. plain: no cut. */
SST_MUST_CHECK int solve_hard(struct solve_problem *p, bool plain, double *sigma_px, struct solve_adjusted *out);

/* State of one call of sst_solve(). */
struct solve_case {
    const struct sst_detections *all;
    const struct sst_solve_config *cfg;
    struct solve_problem p;
    struct solve_single *single; /* [all->count] */
    double sigma_px;
    struct solve_adjusted done;
    struct sst_solution s; /* the results so far */
};

/* --- uncertainty (solve_uncertainty.c) ---------------------------------------------------------------------------- */

struct solve_covariance {
    struct solve_layout layout; /* states before camera_states, then the warp */
    int size;
    double *m; /* [size][size], of the states in their own units (px, rad, mm, 1) */
};

/** Covariance of cameras and warp, boards eliminated (Schur's complement). sigma_px: of a corner of weight 1. @return
 *  0, -ENOMEM, -EDOM (the corners do not determine all states) */
SST_MUST_CHECK int solve_covariances(struct solve_covariance *out, const struct solve_problem *p, double sigma_px);
void solve_covariance_fini(struct solve_covariance *c);

/** lens_sigma of one view over the central part of the picture, with the common rotation removed. */
void solve_lens_map(const struct solve_problem *p, const struct solve_covariance *c, int view, double share,
                    float map[SST_UNCERTAINTY_ROWS][SST_UNCERTAINTY_COLS]);
/** transfer_sigma of one view; depth_mm 0: at infinity. */
void solve_transfer_map(const struct solve_problem *p, const struct solve_covariance *c, int view, double depth_mm,
                        float map[SST_UNCERTAINTY_ROWS][SST_UNCERTAINTY_COLS]);
/** Noise of a corner of weight 1 from the sum of squares, one axis. */
double solve_unit_sigma(const struct solve_adjusted *done);

/* --- refusals (solve_validate.c, solve_diagnose.c) ---------------------------------------------------------------- */

/** Log an error and return -EBADMSG; with cfg->force log a warning and return 0. */
int solve_reject(const struct sst_solve_config *cfg, const char *fmt, ...) SST_PRINTF(2, 3);
/** "camera 02_03 (row 2, column 3)" */
const char *solve_name(const struct sst_detections *all, int view, char out[128]);

/** Cameras without corners, too few frames, regions of the picture without corners. */
SST_MUST_CHECK int solve_check_corners(struct solve_case *c);
/** Detections that are mirror images, after the seeds. */
SST_MUST_CHECK int solve_check_mirrored(struct solve_case *c);
/** Cameras without a link to the reference, after the chain. */
SST_MUST_CHECK int solve_check_linked(struct solve_case *c);
/** After the robust fit: exchanged and moved cameras, boards that moved. */
SST_MUST_CHECK int solve_check_still(struct solve_case *c);
/** More outliers than allowed. */
SST_MUST_CHECK int solve_check_outliers(struct solve_case *c);
/** Poorly determined focal lengths. */
SST_MUST_CHECK int solve_check_focal(struct solve_case *c, const struct solve_covariance *cov);
/** Cameras swapped on the grid. */
SST_MUST_CHECK int solve_check_places(struct solve_case *c);

/* --- comparisons (solve_cross_validation.c) and rigs (solve_rig.c) ------------------------------------------------ */

/** Choose 5 or 8 coefficients by held-out frames; sets the problem's lens and refits its cameras. */
SST_MUST_CHECK int solve_choose_lens(struct solve_case *c);
/** Odd against even frames. */
SST_MUST_CHECK int solve_cross_validate(struct solve_case *c);
/** RMS distance (px, both axes) between two lenses over the central part, with the best rotation removed. */
double solve_lens_difference(const struct solve_problem *p, const double *a, const double *b, double share);
/** Compare the solved centres with the drives' positions. */
SST_MUST_CHECK int solve_compare_drives(struct solve_case *c);
/** Centre of a camera, rig axes. */
void solve_centre(const struct solve_camera *camera, double out[3]);

#endif
