/* pipeline/calibration/board/print.h - printable boards as SVG or PNG, at true scale. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CALIBRATION_BOARD_PRINT_H
#define SST_PIPELINE_CALIBRATION_BOARD_PRINT_H

#include "pipeline/calibration/board/board.h"

/** Black rectangles on white, mm from the upper left of the sheet. */
struct sst_print {
    double width_mm, height_mm;
    double first_mm[2]; /* position of the board's first point */
    int count;
    struct {
        double x, y, width, height;
    } * rect;
};

/**
 * Lay out a board with a white margin: half a square; on an AprilGrid a gap between tags, at least one module.
 * @return 0, -ENOTSUP (markers, in a build without OpenCV; logged), -ENOMEM
 */
SST_MUST_CHECK int sst_print_board(struct sst_print *out, const struct sst_board *board);
void sst_print_fini(struct sst_print *print);

/** Write an SVG in mm. @return 0 or an output error; logged */
SST_MUST_CHECK int sst_print_write_svg(const struct sst_print *print, const char *title, const char *path);

/** Write a PNG at about `dpi` dots per inch; edges fall between dots. @return 0, -EINVAL (too large), or an output
 *  error; logged */
SST_MUST_CHECK int sst_print_write_png(const struct sst_print *print, double dpi, const char *path);

#endif
