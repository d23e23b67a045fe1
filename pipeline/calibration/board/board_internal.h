/* pipeline/calibration/board/board_internal.h - what the files of this folder share; code outside of it includes the
 * public headers. */
#ifndef SST_PIPELINE_CALIBRATION_BOARD_BOARD_INTERNAL_H
#define SST_PIPELINE_CALIBRATION_BOARD_BOARD_INTERNAL_H

#include <stdbool.h>

#include "pipeline/calibration/board/detect.h"
#include "pipeline/calibration/board/opencv_boards.h"
#include "pipeline/image/image.h"

/* --- corners: where two edges cross: the exact place of one point of a board, and how sharp it is. --- */

/**
 * What surrounds a point, in units of the board (mm): four quadrants in two greys, u to the right, v down.
 */
struct saddle_place {
    double x, y;     /* expected there, px */
    double slope[4]; /* px per mm: dx/du, dx/dv, dy/du, dy/dv */
    double half_mm;  /* the quadrants are known to reach so far in u and v */
    double core_mm;  /* where |u| and |v| both exceed this, quadrants of one diagonal hold something else */
    int core_sign;   /* which: 1 those with u v > 0, -1 the others */
    int sign;        /* 1: u v > 0 is white; -1: black */
    double reach_px; /* the point is at most so far from x, y */
};

struct saddle {
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
SST_MUST_CHECK bool saddle_refine(struct saddle *out, const struct sst_map_u8 *luma, const struct saddle_place *place,
                                  double largest_px);

/* --- detect_parts: steps from a picture to a board's points, between the files that take them. --- */

/** A place of the board that was seen: what the others are predicted from. */
struct anchor {
    double board[2], px[2]; /* mm, px */
    double weight;          /* 1: refined; a marker's corner less */
};

/** All that is known of one picture while its points are sought. */
struct sighting {
    const struct sst_board *board;
    const struct sst_map_u8 *luma;
    bool other; /* the other custom of marking (board.h), or black and white changed over */
    int anchors;
    struct anchor *anchor; /* from markers, or a chessboard's corners in order */
    bool *seen;            /* [points] */
    struct saddle *saddle; /* [points] where seen */
};

/** A picture and its halves, down to about a thousand pixels. */
struct pyramid {
    int levels;
    const struct sst_map_u8 *level[6]; /* [0] is the picture itself */
    struct sst_map_u8 half[5];
};
/** @return 0 or -ENOMEM, which leaves nothing to free */
SST_MUST_CHECK int pyramid_init(struct pyramid *p, const struct sst_map_u8 *luma);
void pyramid_fini(struct pyramid *p);

#define SST_MARKERS_MAX 1200

/** Markers in a picture by ascending number, at most SST_MARKERS_MAX. @param touching  tags of an AprilGrid
 *  @return how many, -ENOTSUP, -ENOMEM, -EINVAL */
SST_MUST_CHECK int read_markers(struct cv_marker *read, const struct sst_map_u8 *luma, int dictionary, int border,
                                bool touching);

/**
 * Keep as anchors the corners of the markers that agree on where the board is, where they are more than the anchors
 * already there; sets other.
 *
 * @param scale  picture pixels to a pixel of what was read
 * @return markers that agree, or -ENOMEM
 */
SST_MUST_CHECK int place_markers(struct sighting *s, const struct cv_marker *read, int n, double scale);

/**
 * Both of these. @param quick  at most in a picture of about a thousand pixels. @param decoded  out: markers that were
 * read at all. @return as both
 */
SST_MUST_CHECK int find_markers(struct sighting *s, bool quick, int *decoded);

/**
 * Find a chessboard: anchors are its corners in our order, other says that its upper left square is white.
 * @return 1 found, 0 not, -ENOTSUP, -ENOMEM, -EINVAL
 */
SST_MUST_CHECK int find_chessboard(struct sighting *s, bool quick);

/** From the anchors to points: predict, refine, go on from what was found, drop what does not fit in. @return how many
 *  are seen, -ENOMEM */
SST_MUST_CHECK int find_points(struct sighting *s);

/** Is one side of the chessboard mostly unseen, or does it go on beyond its points? Then it is one of another size. */
bool chessboard_ends_early(const struct sighting *s);
bool chessboard_goes_on(const struct sighting *s);

#endif
