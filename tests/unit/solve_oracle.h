/* tests/unit/solve_oracle.h - OpenCV's own calibration, to compare with. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_UNIT_SOLVE_ORACLE_H
#define SST_TESTS_UNIT_SOLVE_ORACLE_H

#include "base/base.h"

SST_EXTERN_C_BEGIN

/** Inner corners of a chessboard, row by row, sub-pixel; grey 8-bit. @return 1 found, 0 not, negative: an exception */
int oracle_corners(const uint8_t *grey, int width, int height, int cols, int rows, float *xy);

/** cv::calibrateCamera with 5 coefficients: its RMS; k out [9]: fx fy cx cy k1 k2 p1 p2 k3. Negative: an exception */
double oracle_calibrate(const float *xy, int pictures, int cols, int rows, double square, int width, int height,
                        double k[9]);

/** cv::stereoCalibrate, everything optimised from both cameras' own calibration: its RMS. distance: of the centres */
double oracle_stereo(const float *left, const float *right, int pictures, int cols, int rows, double square, int width,
                     int height, double *distance);

SST_EXTERN_C_END

#endif
