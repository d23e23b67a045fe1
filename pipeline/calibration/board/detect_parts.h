/* pipeline/calibration/board/detect_parts.h - steps from a picture to a board's points, between the files that take them. */
#ifndef SST_PIPELINE_CALIBRATION_BOARD_DETECT_PARTS_H
#define SST_PIPELINE_CALIBRATION_BOARD_DETECT_PARTS_H

#include "pipeline/calibration/board/corners.h"
#include "pipeline/calibration/board/detect.h"
#include "pipeline/calibration/board/opencv_boards.h"

/** A place of the board that was seen: what the others are predicted from. */
struct sst_anchor {
    double board[2], px[2]; /* mm, px */
    double weight;          /* 1: refined; a marker's corner less */
};

/** All that is known of one picture while its points are sought. */
struct sst_sighting {
    const struct sst_board *board;
    const struct sst_map_u8 *luma;
    bool other; /* the other custom of marking (board.h), or black and white changed over */
    int anchors;
    struct sst_anchor *anchor; /* from markers, or a chessboard's corners in order */
    bool *seen;                /* [points] */
    struct sst_saddle *saddle; /* [points] where seen */
};

/** A picture and its halves, down to about a thousand pixels. */
struct sst_pyramid {
    int levels;
    const struct sst_map_u8 *level[6]; /* [0] is the picture itself */
    struct sst_map_u8 half[5];
};
/** @return 0 or -ENOMEM, which leaves nothing to free */
SST_MUST_CHECK int sst_pyramid_init(struct sst_pyramid *p, const struct sst_map_u8 *luma);
void sst_pyramid_fini(struct sst_pyramid *p);

#define SST_MARKERS_MAX 1200

/** Markers in a picture by ascending number, at most SST_MARKERS_MAX. @param touching  tags of an AprilGrid
 *  @return how many, -ENOTSUP, -ENOMEM, -EINVAL */
SST_MUST_CHECK int sst_read_markers(struct sst_cv_marker *read, const struct sst_map_u8 *luma, int dictionary,
                                    int border, bool touching);

/**
 * Keep as anchors the corners of the markers that agree on where the board is, where they are more than the anchors
 * already there; sets other.
 *
 * @param scale  picture pixels to a pixel of what was read
 * @return markers that agree, or -ENOMEM
 */
SST_MUST_CHECK int sst_place_markers(struct sst_sighting *s, const struct sst_cv_marker *read, int n, double scale);

/**
 * Both of these. @param quick  at most in a picture of about a thousand pixels. @param decoded  out: markers that were
 * read at all. @return as both
 */
SST_MUST_CHECK int sst_find_markers(struct sst_sighting *s, bool quick, int *decoded);

/**
 * Find a chessboard: anchors are its corners in our order, other says that its upper left square is white.
 * @return 1 found, 0 not, -ENOTSUP, -ENOMEM, -EINVAL
 */
SST_MUST_CHECK int sst_find_chessboard(struct sst_sighting *s, bool quick);

/** From the anchors to points: predict, refine, go on from what was found, drop what does not fit in. @return how many
 *  are seen, -ENOMEM */
SST_MUST_CHECK int sst_find_points(struct sst_sighting *s);

/** Is one side of the chessboard mostly unseen, or does it go on beyond its points? Then it is one of another size. */
bool sst_chessboard_ends_early(const struct sst_sighting *s);
bool sst_chessboard_goes_on(const struct sst_sighting *s);

#endif
