/* pipeline/calibration/board/coverage.h - what a camera has seen of the board so far, and what is still missing. */
#ifndef SST_PIPELINE_CALIBRATION_BOARD_COVERAGE_H
#define SST_PIPELINE_CALIBRATION_BOARD_COVERAGE_H

#include "pipeline/calibration/board/detect.h"

#define SST_COVERAGE_CELLS  5   /* across and down the picture */
#define SST_COVERAGE_FRAMES 15  /* that are enough */
#define SST_COVERAGE_RATIO  1.5 /* of depths that is enough */
/* Flat, towards left, right, up, down: where the board looks as it is seen in the picture; one that looks to the left
 * has its right side nearer. */
#define SST_COVERAGE_TILTS 5

/** One camera. */
struct sst_coverage {
    int frames, corners;
    int cell[SST_COVERAGE_CELLS][SST_COVERAGE_CELLS]; /* corners there */
    int tilt[SST_COVERAGE_TILTS];                     /* detections; those of less than 15 degrees are flat */
    double near_size, far_size; /* largest and smallest size of a square (a tag) in px, unforeshortened: their ratio is
                                   that of depths; 0 none */
};

/** By homography of each detection, without a calibration. @param out  [rows * cols] */
void sst_coverage_count(struct sst_coverage *out, const struct sst_detections *all);

/** Enough corners in a cell; nearest over farthest, 0 unknown. */
bool sst_coverage_cell_done(const struct sst_coverage *coverage, int row, int col);
double sst_coverage_depth_ratio(const struct sst_coverage *coverage);

/** Share 0..1 of what a calibration needs: regions, tilts, a depth ratio of 1.5, 15 frames. */
double sst_coverage_share(const struct sst_coverage *coverage);

/** What is missing, most pressing first, as one clause ("lower left, tilt to the right, nearer"); "" nothing. */
void sst_coverage_missing(const struct sst_coverage *coverage, char out[160]);

/**
 * A picture of all cameras in their grid: where corners were seen, tilts and depths, what is missing in red.
 * @param out  initialised here
 */
SST_MUST_CHECK int sst_coverage_picture(struct sst_image *out, const struct sst_detections *all,
                                        const struct sst_coverage *coverage);

#endif
