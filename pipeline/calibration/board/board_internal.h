/* pipeline/calibration/board/board_internal.h - private declarations of this folder; code outside of it includes the
 * public headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CALIBRATION_BOARD_BOARD_INTERNAL_H
#define SST_PIPELINE_CALIBRATION_BOARD_BOARD_INTERNAL_H

#include <stdbool.h>

#include "pipeline/calibration/board/detect.h"
#include "pipeline/calibration/board/opencv_boards.h"
#include "pipeline/image/image.h"

/* --- corners: where two edges cross: the exact place of one point of a board, and how sharp it is. --- */

/** Surroundings of a point in board units (mm): four quadrants in two greys, u to the right, v down. */
struct saddle_place {
    double x, y;     /* expected there, px */
    double slope[4]; /* px per mm: dx/du, dx/dv, dy/du, dy/dv */
    double half_mm;  /* extent of the quadrants in u and v */
    double core_mm;  /* where |u| and |v| both exceed this, the quadrants of one diagonal contain a marker */
    int core_sign;   /* which diagonal: 1 is u v > 0, -1 the other */
    int sign;        /* 1: u v > 0 is white; -1: black */
    double reach_px; /* search radius around x, y */
};

struct saddle {
    double x, y;                      /* px */
    double angle[2];                  /* of the normals of the edges u = 0 and v = 0, rad */
    double noise_px;                  /* expected error of x and y from the fit residuals: RMS of both */
    double blur_xx, blur_xy, blur_yy; /* covariance of the point spread, px^2 */
    double contrast, left_over;       /* half grey difference, < 0 where u v > 0 is black; RMS residual; 0..255 */
};

/**
 * Least squares fit of two crossing edges, each blurred by its own width, between two greys under linearly varying
 * illumination: m(p) = (1 + g p) (L + C S), S the mean of sign(u) sign(v) under a normal distribution around p. Pattern
 * and model are symmetric under half a turn about the point, so neither the tone curve nor the shape of the blur moves
 * it. (Derived in corners.c.)
 *
 * @param largest_px  largest extent of the window from the point
 * @return false: no such point (no crossing, low contrast, too close to the border, another pattern)
 */
SST_MUST_CHECK bool saddle_refine(struct saddle *out, const struct sst_map_u8 *luma, const struct saddle_place *place,
                                  double largest_px);

/* --- detect_parts: detection steps: pyramid, markers, anchors, points. --- */

/** A detected position on the board, from which the other points are predicted. */
struct anchor {
    double board[2], px[2]; /* mm, px */
    double weight;          /* 1: refined; a marker's corner less */
};

/** State of the search in one picture. */
struct sighting {
    const struct sst_board *board;
    const struct sst_map_u8 *luma;
    bool other; /* second marker convention (board.h), or black and white exchanged */
    int anchors;
    struct anchor *anchor; /* from markers, or a chessboard's corners in order */
    bool *seen;            /* [points] */
    struct saddle *saddle; /* [points] where seen */
};

/** Image pyramid: the picture, halved down to about a thousand pixels. */
struct pyramid {
    int levels;
    const struct sst_map_u8 *level[6]; /* [0] is the picture itself */
    struct sst_map_u8 half[5];
};
/** @return 0 or -ENOMEM (nothing to free) */
SST_MUST_CHECK int pyramid_init(struct pyramid *p, const struct sst_map_u8 *luma);
void pyramid_fini(struct pyramid *p);

#define SST_MARKERS_MAX 1200

/** Read the markers in a picture, in ascending order, at most SST_MARKERS_MAX. @param touching  tags of an AprilGrid
 *  @return their number, -ENOTSUP, -ENOMEM, -EINVAL */
SST_MUST_CHECK int read_markers(struct cv_marker *read, const struct sst_map_u8 *luma, int dictionary, int border,
                                bool touching);

/**
 * Make anchors of the corners of the markers that agree on one pose of the board, if these are more than the present
 * anchors; sets other.
 *
 * @param scale  picture pixels per pixel of the level that was read
 * @return number of agreeing markers, or -ENOMEM
 */
SST_MUST_CHECK int place_markers(struct sighting *s, const struct cv_marker *read, int n, double scale);

/**
 * Read and place markers over the pyramid. @param quick  only at about a thousand pixels. @param decoded  out: number
 * of markers read. @return as both
 */
SST_MUST_CHECK int find_markers(struct sighting *s, bool quick, int *decoded);

/**
 * Find a chessboard: anchors are its corners in our order; other is set if its upper left square is white.
 * @return 1 found, 0 not, -ENOTSUP, -ENOMEM, -EINVAL
 */
SST_MUST_CHECK int find_chessboard(struct sighting *s, bool quick);

/** From anchors to points: predict, refine, continue from the points found, drop outliers. @return number of points,
 *  -ENOMEM */
SST_MUST_CHECK int find_points(struct sighting *s);

/** True if one side of the chessboard is mostly missing or continues beyond its points: it has another size. */
bool chessboard_ends_early(const struct sighting *s);
bool chessboard_goes_on(const struct sighting *s);

#endif
