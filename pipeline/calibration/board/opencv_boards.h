/* pipeline/calibration/board/opencv_boards.h - plain C interface to OpenCV's boards and markers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CALIBRATION_BOARD_OPENCV_BOARDS_H
#define SST_PIPELINE_CALIBRATION_BOARD_OPENCV_BOARDS_H

#include <errno.h>

#include "pipeline/image/image.h"

SST_EXTERN_C_BEGIN

/* All return 0 or more, -ENOTSUP (libsst-opencv.so cannot be loaded; logged once), -ENOMEM or -EINVAL (rejected by
 * OpenCV). Thread: any. Corners are in px, pixel centres on integers. */

/** A marker: its corners clockwise from the upper left one of the upright marker. */
struct cv_marker {
    int id;
    float corner[4][2];
};

/** Chessboard of cols x rows inner corners, row by row. @param thorough  another, slower detector for smaller and more
 *  blurred boards. @return 1 found, 0 not */
SST_MUST_CHECK int cv_chessboard(float (*corner)[2], const struct sst_map_u8 *luma, int cols, int rows, int thorough);

/** Size of the largest chessboard of at least 3 x 3 inner corners. Slow. @return 1 found, 0 not */
SST_MUST_CHECK int cv_any_chessboard(const struct sst_map_u8 *luma, int *cols, int *rows);

/** @param dictionary  OpenCV's number. @param border  modules. @param max  capacity of out. @return their number */
SST_MUST_CHECK int cv_markers(struct cv_marker *out, int max, const struct sst_map_u8 *luma, int dictionary,
                              int border);

/** Find tags with corners that touch black squares, as on an AprilGrid. A tag may come twice. */
SST_MUST_CHECK int cv_touching_tags(struct cv_marker *out, int max, const struct sst_map_u8 *luma, int dictionary,
                                    int border);

/** Number of markers in a dictionary, and modules along a marker's inner side; 0: no such dictionary. */
SST_MUST_CHECK int cv_dictionary(int dictionary, int *modules);

/** Modules of marker id, row by row, 1 is white. @param bits  [modules * modules] @return 0 */
SST_MUST_CHECK int cv_marker_bits(uint8_t *bits, int dictionary, int id);

SST_EXTERN_C_END

#endif
