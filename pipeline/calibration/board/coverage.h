/* pipeline/calibration/board/coverage.h - coverage of picture, tilts and depths by detections, per camera. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CALIBRATION_BOARD_COVERAGE_H
#define SST_PIPELINE_CALIBRATION_BOARD_COVERAGE_H

#include "pipeline/calibration/board/detect.h"

#define SST_COVERAGE_CELLS  5   /* columns and rows of the grid over a picture */
#define SST_COVERAGE_FRAMES 15  /* sufficient number */
#define SST_COVERAGE_RATIO  1.5 /* sufficient ratio of depths */
/* Flat, or facing left, right, up, down as seen in the picture; a board that faces left has its right side nearer. */
#define SST_COVERAGE_TILTS 5

/** One camera. */
struct sst_coverage {
    int frames, corners;
    int cell[SST_COVERAGE_CELLS][SST_COVERAGE_CELLS]; /* corners in each cell */
    int tilt[SST_COVERAGE_TILTS];                     /* detections by tilt; below 15 degrees is flat */
    double near_size, far_size; /* largest and smallest size of a square (a tag) in px, without foreshortening: their
                                   ratio is the ratio of depths; 0: none */
};

/** Compute it from the homography of each detection; needs no calibration. @param out  [rows * cols] */
void sst_coverage_count(struct sst_coverage *out, const struct sst_detections *all);

/** True if a cell has enough corners; ratio of the farthest to the nearest depth, 0: unknown. */
bool sst_coverage_cell_done(const struct sst_coverage *coverage, int row, int col);
double sst_coverage_depth_ratio(const struct sst_coverage *coverage);

/** Fraction 0..1 of a calibration's need: regions, tilts, a depth ratio of 1.5, 15 frames. */
double sst_coverage_share(const struct sst_coverage *coverage);

/** Missing poses, most important first, as one clause ("lower left, tilt to the right, nearer"); "": none. */
void sst_coverage_missing(const struct sst_coverage *coverage, char out[160]);

/**
 * A picture of all cameras in their grid: where corners were seen, tilts and depths, missing ones in red.
 * @param out  initialised here
 */
SST_MUST_CHECK int sst_coverage_picture(struct sst_image *out, const struct sst_detections *all,
                                        const struct sst_coverage *coverage);

#endif
