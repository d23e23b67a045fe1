/* pipeline/calibration/board/corners.h - where two edges cross: the exact place of one point of a board, and how sharp it is. */
#ifndef SST_PIPELINE_CALIBRATION_BOARD_CORNERS_H
#define SST_PIPELINE_CALIBRATION_BOARD_CORNERS_H

#include <stdbool.h>

#include "pipeline/image/image.h"

/**
 * What surrounds a point, in units of the board (mm): four quadrants in two greys, u to the right, v down.
 */
struct sst_saddle_place {
    double x, y;     /* expected there, px */
    double slope[4]; /* px per mm: dx/du, dx/dv, dy/du, dy/dv */
    double half_mm;  /* the quadrants are known to reach so far in u and v */
    double core_mm;  /* where |u| and |v| both exceed this, quadrants of one diagonal hold something else */
    int core_sign;   /* which: 1 those with u v > 0, -1 the others */
    int sign;        /* 1: u v > 0 is white; -1: black */
    double reach_px; /* the point is at most so far from x, y */
};

struct sst_saddle {
    double x, y;                      /* px */
    double angle[2];                  /* of the normals of the edges u = 0 and v = 0, rad */
    double noise_px;                  /* expected error of x and y from what the fit leaves: RMS of both */
    double blur_xx, blur_xy, blur_yy; /* covariance of the point spread, px^2 */
    double contrast, left_over; /* half the difference of the greys, negative where u v > 0 is black; RMS of what the
                                   fit leaves; 0..255 */
};

/**
 * Least squares fit of two crossing edges, each blurred by its own width, between two greys under a light that changes
 * linearly: m(p) = (1 + g p) (L + C S), S the mean of sign(u) sign(v) under a normal distribution around p. The
 * pattern is the same after half a turn about the point, and so is what is fitted, whatever the tone curve or the shape
 * of the blur: these do not move the point. (Derived in corners.c.)
 *
 * @param largest_px  the window reaches at most so far from the point
 * @return false: no such point here (nothing crosses, too little contrast, too near to the border, another pattern)
 */
SST_MUST_CHECK bool sst_saddle_refine(struct sst_saddle *out, const struct sst_map_u8 *luma,
                                      const struct sst_saddle_place *place, double largest_px);

#endif
