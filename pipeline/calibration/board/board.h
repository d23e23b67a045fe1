/* pipeline/calibration/board/board.h - calibration boards: which points they have, and where. */
#ifndef SST_PIPELINE_CALIBRATION_BOARD_BOARD_H
#define SST_PIPELINE_CALIBRATION_BOARD_BOARD_H

#include <stdbool.h>

#include "base/base.h"

enum sst_board_kind {
    SST_BOARD_CHESSBOARD = 1,
    SST_BOARD_CHARUCO = 2,   /* dictionary DICT_4X4_50 unless another is named */
    SST_BOARD_APRILGRID = 3, /* tags 36h11, border of 2 modules, numbered as Kalibr's or row by row from the top */
};

/**
 * A board in its own axes: x right, y down as one looks at it, z away from the looker; mm; the origin is the first
 * point. Points are numbered row by row from the upper left: inner corners of a chessboard or ChArUco board
 * ((cols - 1) (rows - 1) of them), on an AprilGrid the four corners of each tag, 4 tag + 0..3 clockwise from its upper
 * left.
 */
struct sst_board {
    enum sst_board_kind kind;
    int cols, rows;   /* squares; AprilGrid: tags */
    double square_mm; /* side of a square; AprilGrid: of a tag */
    double marker;    /* ChArUco: side of a marker in squares; AprilGrid: gap between tags in tags */
    int dictionary;   /* ChArUco: OpenCV's number of it, 0 is DICT_4X4_50 */
    bool bottom_up;   /* AprilGrid: tags are numbered from the lower left, as Kalibr prints them */
};

/**
 * Read "charuco:9x7:50mm:0.7[:4x4_50]", "aprilgrid:6x6:50mm:0.3[:bottom-up]", "chessboard:10x7:25mm" (squares, not
 * inner corners; "chessboard:9x6c:25mm" counts inner corners as OpenCV does), or the path of a Kalibr target YAML.
 *
 * @return 0, -EINVAL or what reading the file returns; logged, with the forms that there are.
 */
SST_MUST_CHECK int sst_board_parse(struct sst_board *out, const char *text);

/** The text that sst_board_parse() reads. */
void sst_board_format(const struct sst_board *board, char out[128]);

int sst_board_points(const struct sst_board *board);
/** Point id, mm. */
void sst_board_point(const struct sst_board *board, int id, double out[2]);
/** Smallest distance of neighbouring points, mm: the scale for windows and tests. */
double sst_board_pitch_mm(const struct sst_board *board);

/** A marker of a ChArUco board, a tag of an AprilGrid. */
struct sst_board_marker {
    int number;          /* in its dictionary */
    double corner[4][2]; /* mm, clockwise from the one that is its upper left where the marker itself is upright */
};

/**
 * The markers, row by row from the upper left; none on a chessboard.
 *
 * Two customs exist. ChArUco boards of an even number of rows begin with a black square, or (OpenCV before 4.6) with a
 * white one; tags of an AprilGrid stand upright when numbered from the top, on their heads as Kalibr prints them. The
 * detector takes whichever fits.
 *
 * @param other  the other of both customs
 * @param out    [sst_board_markers()], or NULL to count
 */
int sst_board_markers(struct sst_board_marker *out, const struct sst_board *board, bool other);

/** Dictionary of a board's markers by OpenCV's number, and modules of their black border. */
int sst_board_dictionary(const struct sst_board *board, int *border);
/** Name ("4x4_50") of a dictionary and how many markers it has; NULL: there is none of this number. */
const char *sst_board_dictionary_name(int dictionary, int *markers);

#endif
