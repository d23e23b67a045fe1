/* pipeline/camera/numbers.h - small numerics shared by detection, solver and report. */
#ifndef SST_PIPELINE_CAMERA_NUMBERS_H
#define SST_PIPELINE_CAMERA_NUMBERS_H

#include <stdbool.h>

#include "base/base.h"

/** Solve a x = b for positive definite a (n <= 12, row-major, the lower half is read and overwritten). @return false:
 *  a is not positive definite, or nearly singular */
SST_MUST_CHECK bool sst_solve_definite(double *a, double *b, int n);

/** Upper median (rank n / 2); v is reordered and has no NaN; 0 for n = 0. */
double sst_upper_median(double *v, int n);

#endif
