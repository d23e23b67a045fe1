/* pipeline/calibration/solve/solve_internal.h - what the files of the solver share; nobody else includes it. */
#ifndef SST_PIPELINE_CALIBRATION_SOLVE_SOLVE_INTERNAL_H
#define SST_PIPELINE_CALIBRATION_SOLVE_SOLVE_INTERNAL_H

#include "pipeline/calibration/solve/solve.h"
#include "pipeline/camera/numbers.h"

#define SOLVE_LENS_MAX    (4 + SST_LENS_MAX)       /* fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6 */
#define SOLVE_COLS_MAX    (SOLVE_LENS_MAX + 6 + 3) /* lens, relative pose, board warp, residual */
#define SOLVE_MIN_CORNERS 6                        /* of a detection, for a pose */

/* --- small dense algebra (solve_dense.c), all row-major ---------------------------------------------------------- */

void solve_mul3(const double a[9], const double b[9], double out[9]);
void solve_mul3t(const double a[9], const double b[9], double out[9]); /* a^T b */
void solve_apply3(const double a[9], const double v[3], double out[3]);
/** Left Jacobian J of the exponential: d(exp(v) p) = -[exp(v) p]x J dv. */
void solve_left_jacobian(const double v[3], double out[9]);
/** Lower Cholesky factor in place of the lower half of a[n][n]. @return false: not positive definite */
bool solve_cholesky(double *a, int n);
/** x = (L L^T)^-1 x. */
void solve_cholesky_solve(const double *l, int n, double *x);
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
    bool row_by_row;   /* hand every corner to the sparse solver: the plain twin of the compressed rows */
    double warp[2], warp_sigma_mm;
    int threads;
    struct solve_camera *camera;       /* [views] */
    struct solve_frame *frame;         /* [frames] */
    struct solve_detection *detection; /* [count] */
    struct solve_corner *pool;         /* all corners, or NULL where another problem owns them */
};

/** Own copy of cameras, frames and detections; the corners are shared. */
SST_MUST_CHECK int solve_problem_copy(struct solve_problem *out, const struct solve_problem *in);
void solve_problem_fini(struct solve_problem *p);

/* --- one detection (solve_block.c) -------------------------------------------------------------------------------- */

/** Camera point to pixels. jq: derivatives by the point [2][3], jl: by the lens [2][4 + lens]; both or neither NULL.
 *  Always finite: points beside and behind the camera are taken at a small depth. */
void solve_see(const double *lens, int coefficients, const double q[3], double xy[2], double jq[2][3],
               double jl[2][SOLVE_LENS_MAX]);

/** A camera at the origin that has this lens. */
struct sst_calib_camera solve_camera_of(const double *lens);

/** Board corner to camera axes: rotation part and the point itself. */
void solve_corner_place(const struct solve_pose *board_to_camera, const struct solve_corner *c, const double warp[2],
                        double turned[3], double q[3]);

/**
 * Weighted rows of a detection that is not empty: [lens | turn, shift of the board before the camera | warp | residual
 * (predicted minus measured)]; with columns for a lens or warp that is solved only. Outliers are left out.
 *
 * @param loss_px  scale of Cauchy's loss, whose square root the rows carry; 0: least squares
 * @param rows     out, [2 corners][columns]
 * @return number of rows
 */
int solve_block(const struct solve_problem *p, const struct solve_detection *d, const struct solve_pose *board,
                double loss_px, double *rows);
int solve_block_columns(const struct solve_problem *p); /* with the residual */

/** Board to camera for a detection. */
void solve_relative(const struct solve_problem *p, const struct solve_detection *d, struct solve_pose *out);
/** Residuals (predicted minus measured, px, not weighted) of all corners, outliers too. */
void solve_residuals(const struct solve_problem *p, const struct solve_detection *d, double (*out)[2]);

/* --- joint adjustment (solve_adjust.c) ---------------------------------------------------------------------------- */

/* Where states begin, -1: not a state. Lenses first, then cameras, boards, warp. */
struct solve_layout {
    int lens_size;
    int *lens, *pose; /* [views] */
    int *frame;       /* [frames] */
    int warp, states, camera_states /* before the boards' */;
    double *scale; /* [states] unit of each */
};

SST_MUST_CHECK int solve_layout_init(struct solve_layout *out, const struct solve_problem *p);
void solve_layout_fini(struct solve_layout *layout);

/* How one detection's columns spread onto states. */
struct solve_spread {
    double camera_turn[9], across[9], rotation[9], board_turn[9]; /* Jc, [Rc tf]x, Rc, Rf's Jf in camera axes */
    int lens, pose, frame, warp;                                  /* first state, or -1 */
};

/** @param turn_camera, turn_board  turns since the layout's poses, of which Jc and Jf are taken; NULL: none */
void solve_spread_make(struct solve_spread *out, const struct solve_problem *p, const struct solve_layout *layout,
                       const struct solve_detection *d, const double *turn_camera, const double *turn_board);
/** The entries of one row, columns before `from` being zero: ascending states and scaled values. @return their number
 */
int solve_spread_row(const struct solve_spread *s, const struct solve_problem *p, const struct solve_layout *layout,
                     const double *row, int from, int *state, double *value);

/* Weak knowledge, as rows with one entry: the board's warp, and the denominator of lenses with 8 coefficients. */
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

/** Minimise over everything that is not kept. @return 0, -ENOMEM, -EDOM (nothing to fit), -ENOTSUP */
SST_MUST_CHECK int solve_adjust(struct solve_problem *p, const struct solve_adjust_config *cfg,
                                struct solve_adjusted *out);

/** States' updates below this, in their units: a thousandth of what a well-known state's uncertainty is. */
#define SOLVE_TOLERANCE 1e-5

/* --- where to begin (solve_seed.c, solve_graph.c) ----------------------------------------------------------------- */

/* A detection seen by its camera alone. */
struct solve_single {
    bool known;
    bool mirrored;          /* fits a board seen from behind only */
    struct solve_pose pose; /* board to camera */
    double rms_px;          /* robust: of the median residual */
};

/** Pose of a detection before a camera whose lens is known. */
void solve_single_camera(struct solve_single *out, const struct solve_problem *p, const struct solve_detection *d,
                         const double *lens);

/**
 * Lenses of all cameras, each from its own detections (a rig: from all), and each detection's pose. Cameras that know
 * too little take the median of the others'. Detections that are mirrored leave the problem.
 */
SST_MUST_CHECK int solve_seed(struct solve_problem *p, struct solve_single *single);

/** Links of all pairs of views, by a then b; the spanning tree of most corners marked. Owner: the caller frees. */
SST_MUST_CHECK int solve_links(const struct solve_problem *p, struct sst_solve_link **links, int *count);

/** Cameras and boards from detections' poses along the tree; those not linked to the reference become unknown. */
SST_MUST_CHECK int solve_chain(struct solve_problem *p, const struct solve_single *single,
                               const struct sst_solve_link *links, int count);

/** 1.1774^-1 of the median length of weighted residuals, one axis' sigma if they are normal; by all that are used. */
SST_MUST_CHECK int solve_noise(const struct solve_problem *p, double *sigma_px);

/* --- the flow (solve.c, solve_robust.c) --------------------------------------------------------------------------- */

/** Points further off than this many sigma of an axis are outliers: of normal noise 4 in a million. */
#define SOLVE_OUTLIER_SIGMA 5
/** Share of the corners that may be outliers unless the caller says otherwise. */
#define SOLVE_MOST_OUTLIERS 0.03

/** From corners to an empty problem; those that are not finite or not of the board are refused (force: left out). */
SST_MUST_CHECK int solve_problem_make(struct solve_problem *out, const struct sst_detections *all,
                                      const struct sst_solve_config *cfg);

/** Robust loss from a seed: everything moves, no corner is left out. sigma_px: corner noise that it found. */
SST_MUST_CHECK int solve_soft(struct solve_problem *p, double loss_px, double *sigma_px);

/** Least squares, outliers cut by k sigma until they stay the same. plain: none is cut. */
SST_MUST_CHECK int solve_hard(struct solve_problem *p, bool plain, double *sigma_px, struct solve_adjusted *out);

/* Everything about one call of sst_solve(). */
struct solve_case {
    const struct sst_detections *all;
    const struct sst_solve_config *cfg;
    struct solve_problem p;
    struct solve_single *single; /* [all->count] */
    struct sst_solve_link *link;
    int links;
    double sigma_px, held_out_px[2], cross_px, cross_expected_px;
    int cross_camera;
    struct solve_adjusted done;
    double (*drive_residual_mm)[3];
    double drive_rms_mm, drive_scale, drive_skew_deg;
};

/* --- uncertainty (solve_uncertainty.c) ---------------------------------------------------------------------------- */

struct solve_covariance {
    struct solve_layout layout; /* states before camera_states, then the warp */
    int size;
    double *m; /* [size][size], of the states in their own units (px, rad, mm, 1) */
};

/** Covariance of cameras and warp, boards eliminated (Schur's complement). sigma_px: of a corner of weight 1.
 *  @return 0, -ENOMEM, -EDOM (the corners leave something undetermined) */
SST_MUST_CHECK int solve_covariances(struct solve_covariance *out, const struct solve_problem *p, double sigma_px);
void solve_covariance_fini(struct solve_covariance *c);

/** lens_sigma of one view over the central share of the picture, whose shared rotation is taken out. */
void solve_lens_map(const struct solve_problem *p, const struct solve_covariance *c, int view, double share,
                    float map[SST_UNCERTAINTY_ROWS][SST_UNCERTAINTY_COLS]);
/** carry_sigma of one view; depth_mm 0: at infinity. */
void solve_carry_map(const struct solve_problem *p, const struct solve_covariance *c, int view, double depth_mm,
                     float map[SST_UNCERTAINTY_ROWS][SST_UNCERTAINTY_COLS]);
/** Root of the mean square of what is finite; 0 if nothing is. */
double solve_map_rms(float map[SST_UNCERTAINTY_ROWS][SST_UNCERTAINTY_COLS]);
/** Corner noise of weight 1 by the sum of squares, one axis. */
double solve_unit_sigma(const struct solve_adjusted *done);

/* --- refusals (solve_refuse.c, solve_explain.c) ------------------------------------------------------------------- */

/** Log an error and refuse, or where cfg->force a warning. @return -EBADMSG or 0 */
int solve_refuse(const struct sst_solve_config *cfg, const char *fmt, ...) SST_PRINTF(2, 3);
/** "camera 02_03 (row 2, column 3)" */
const char *solve_name(const struct sst_detections *all, int view, char out[128]);

/** Cameras without corners, too few frames, regions of the picture without corners. */
SST_MUST_CHECK int solve_check_corners(struct solve_case *c);
/** Detections that are mirror images, after the seeds. */
SST_MUST_CHECK int solve_check_mirrored(struct solve_case *c);
/** Cameras that nothing links to the reference, after the chain. */
SST_MUST_CHECK int solve_check_linked(struct solve_case *c);
/** After the robust fit: exchanged and moved cameras, boards that moved. */
SST_MUST_CHECK int solve_check_still(struct solve_case *c);
/** More outliers than allowed. */
SST_MUST_CHECK int solve_check_outliers(struct solve_case *c);
/** Focal lengths that are hardly known. */
SST_MUST_CHECK int solve_check_focal(struct solve_case *c, const struct solve_covariance *cov);
/** Cameras at each other's places of the grid. */
SST_MUST_CHECK int solve_check_places(struct solve_case *c);

/* --- comparisons (solve_cross.c) and rigs (solve_rig.c) ----------------------------------------------------------- */

/** 5 or 8 coefficients by frames held out; the problem's lens is set and its cameras are made to fit. */
SST_MUST_CHECK int solve_choose_lens(struct solve_case *c);
/** Odd against even frames. */
SST_MUST_CHECK int solve_cross(struct solve_case *c);
/** RMS distance (px, both axes) of what two lenses see over the central share, the best rotation taken out. */
double solve_lens_difference(const struct solve_problem *p, const double *a, const double *b, double share);
/** Solved centres against the drives'. */
SST_MUST_CHECK int solve_compare_drives(struct solve_case *c);
/** Centre of a camera, rig axes. */
void solve_centre(const struct solve_camera *camera, double out[3]);

#endif
