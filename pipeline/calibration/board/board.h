/* pipeline/calibration/board/board.h - calibration boards: kinds, sizes, and the positions of their points. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CALIBRATION_BOARD_BOARD_H
#define SST_PIPELINE_CALIBRATION_BOARD_BOARD_H

#include <stdbool.h>

#include "base/base.h"

enum sst_board_kind {
    SST_BOARD_CHESSBOARD = 1,
    SST_BOARD_CHARUCO = 2,   /* dictionary DICT_4X4_50 unless another one is given */
    SST_BOARD_APRILGRID = 3, /* tags 36h11, border of 2 modules; numbered from the bottom, or the top */
};

/**
 * A board in its own axes: seen from the front, x is right, y down, z away from the viewer; mm; the origin is the first
 * point. Points are numbered row by row from the upper left: inner corners of a chessboard or ChArUco board ((cols - 1)
 * (rows - 1) points), on an AprilGrid the four corners of each tag, 4 tag + 0..3 clockwise from its upper left.
 */
struct sst_board {
    enum sst_board_kind kind;
    int cols, rows;   /* squares; AprilGrid: tags */
    double square_mm; /* side of a square; AprilGrid: of a tag */
    double marker;    /* ChArUco: side of a marker in squares; AprilGrid: gap between tags in tags */
    int dictionary;   /* ChArUco: OpenCV's number, 0 is DICT_4X4_50 */
    bool bottom_up;   /* AprilGrid: tags are numbered from the lower left, as Kalibr prints them */
};

/**
 * Read "charuco:9x7:50mm:0.7[:4x4_50]", "aprilgrid:6x6:50mm:0.3[:bottom-up]", "chessboard:10x7:25mm" (squares, not
 * inner corners; "chessboard:9x6c:25mm" counts inner corners as OpenCV does), or the path of a Kalibr target YAML.
 *
 * @return 0, -EINVAL or a file error; logged with the accepted forms.
 */
SST_MUST_CHECK int sst_board_parse(struct sst_board *out, const char *text);

/** Format a board as sst_board_parse() accepts it. */
void sst_board_format(const struct sst_board *board, char out[128]);

int sst_board_points(const struct sst_board *board);
/** Position of point id, mm. */
void sst_board_point(const struct sst_board *board, int id, double out[2]);
/** Smallest distance of neighbouring points, mm: the scale for windows and tests. */
double sst_board_pitch_mm(const struct sst_board *board);

/** A marker of a ChArUco board, a tag of an AprilGrid. */
struct sst_board_marker {
    int number;          /* in its dictionary */
    double corner[4][2]; /* mm, clockwise from the upper left corner of the upright marker */
};

/**
 * The markers, row by row from the upper left; none on a chessboard.
 *
 * Two conventions exist. ChArUco boards with an even number of rows begin with a black square, or (OpenCV before 4.6)
 * with a white one; tags of an AprilGrid are upright when numbered from the top, upside down as Kalibr prints them. The
 * detector uses whichever fits.
 *
 * @param other  use the second convention
 * @param out    [sst_board_markers()], or NULL to count
 */
int sst_board_markers(struct sst_board_marker *out, const struct sst_board *board, bool other);

/** OpenCV's dictionary number of a board's markers, and the width of their black border in modules. */
int sst_board_dictionary(const struct sst_board *board, int *border);
/** Name ("4x4_50") of a dictionary and its number of markers; NULL: no such dictionary. */
const char *sst_board_dictionary_name(int dictionary, int *markers);

#endif
