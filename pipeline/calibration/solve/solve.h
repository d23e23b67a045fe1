/* pipeline/calibration/solve/solve.h - solver: computes a calibration and its uncertainty from board corners. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CALIBRATION_SOLVE_SOLVE_H
#define SST_PIPELINE_CALIBRATION_SOLVE_SOLVE_H

#include "pipeline/calibration/board/detect.h"

#define SST_UNCERTAINTY_COLS 16 /* cells of the maps over the picture */
#define SST_UNCERTAINTY_ROWS 12

struct sst_solve_config {
    int lens;                       /* 5 or 8; 0: the one with the smaller error on held-out frames */
    double max_outliers;            /* fraction of corners; more is a failure; 0: 0.03 */
    bool force;                     /* solve even if checks fail: refusals become warnings */
    int *overridden;                /* counts the refusals that force turned into warnings; or NULL */
    bool plain;                     /* least squares over all corners: no robust loss, no outliers (for comparisons) */
    bool flat;                      /* the board is a plane: its warp is not solved */
    bool cross_validate;            /* also solve odd and even frames separately, and compare */
    const struct sst_calib *lenses; /* intrinsics to keep as they are (by view; a rig: of its reference), or NULL */
    int threads;
    void (*progress)(void *arg, double done);
    void *progress_arg;
};

/** A detection in the solution. */
struct sst_solve_view {
    double rms_px; /* per point, over the corners used */
    int outliers;
    double (*residual)[2]; /* [corners] measured minus predicted, px */
    bool *outlier;         /* [corners] */
};

struct sst_solve_frame {
    bool known;
    double rotation[9], position_mm[3]; /* board point p (mm, z = its warp) is at X = rotation p + position_mm */
    double rms_px;
};

/** Views a < b that see the board in the same frames. */
struct sst_solve_link {
    int a, b, frames, corners;
    bool tree; /* part of the spanning tree that began the solution */
};

struct sst_solution {
    struct sst_calib calib;
    int lens;
    double warp_mm[2];       /* board: z = warp[0] (1 - u^2) + warp[1] (1 - v^2), u and v -1..1 over its points */
    double rms_px;           /* per point over all corners used, cameras and frames: sqrt(mean(dx^2 + dy^2)) */
    double predicted_rms_px; /* expected: sqrt(2) noise sqrt(1 - states / measurements) */
    double noise_px;         /* corner noise per axis */
    int corners, outliers, states, measurements, iterations;
    double seconds, rcond;
    struct sst_solve_view *view;   /* [detections.count] */
    struct sst_solve_frame *frame; /* [detections.frames] */
    int links, weakest;            /* weakest: the link of the tree with the fewest corners; -1 none */
    struct sst_solve_link *link;
    /* One sigma of one axis (root of the mean of both axes' variances) in px, [rows * cols] cameras each; NAN where a
     * camera is unknown or the pixel is outside its picture. lens_sigma: of the pixel of a direction, with the common
     * rotation removed. transfer_sigma: of the transfer of a pixel from the reference view to this view, [0] at
     * infinity, [1] at calib.range_mm (0 for the reference itself). */
    float (*lens_sigma)[SST_UNCERTAINTY_ROWS][SST_UNCERTAINTY_COLS];
    float (*transfer_sigma)[2][SST_UNCERTAINTY_ROWS][SST_UNCERTAINTY_COLS];
    /* Cross-validation of odd against even frames with the common rotation removed, central 80 % of the picture, px:
     * largest RMS difference over the cameras, the difference expected from the uncertainties, and the camera; NAN:
     * not done. */
    double cv_px, cv_expected_px;
    int cv_camera;
    double held_out_px[2]; /* RMS per point on held-out frames with 5 and 8 coefficients; 0: not compared */
    /* For a rig with drive positions: RMS distance of the solved centres from the drives' after the best rigid fit,
     * scale (solved over drive), angle between the axes minus 90 degrees; otherwise NAN. */
    double drive_rms_mm, drive_scale, drive_skew_deg;
    double (*drive_residual_mm)[3]; /* [rows * cols] or NULL */
};

/**
 * Solve. Refuses, naming camera or frame, number and remedy: a camera without a link to the others, fewer than 4
 * frames, corners in too few regions of a picture, too little depth range or tilt to determine the focal length, more
 * outliers than allowed (with the diagnosis: a swapped pair of cameras, a camera that moved at a frame, a board of
 * another size), corners that are not finite. A camera without any detection is an error unless force, which leaves it
 * unknown.
 *
 * The reference is the light field's, or the nearest known camera where that one is unknown. calib.created_wall_ns and
 * calib.source stay empty for the caller to fill in. The same input gives the same bytes for any number of threads
 * (seconds excepted).
 *
 * @return 0, -EBADMSG (refused), -EDOM (did not converge), -ENOTSUP (no libdogleg or OpenCV in this build), -ENOMEM;
 *         logged.
 */
SST_MUST_CHECK int sst_solve(struct sst_solution *out, const struct sst_detections *all,
                             const struct sst_solve_config *cfg);
void sst_solution_fini(struct sst_solution *solution);

/** Root mean square of the finite cells of such a map; NAN: there are none, or no map. */
double sst_uncertainty_rms(const float (*map)[SST_UNCERTAINTY_COLS]);

#endif
