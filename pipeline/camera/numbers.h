/* pipeline/camera/numbers.h - small numerics shared by detection, solver and report. */
#ifndef SST_PIPELINE_CAMERA_NUMBERS_H
#define SST_PIPELINE_CAMERA_NUMBERS_H

#include <stdbool.h>

#include "base/base.h"

/** Solve a x = b for positive definite a (n <= 12, row-major, the lower half is read and overwritten). @return false:
 *  a is not positive definite, or nearly singular */
SST_MUST_CHECK bool sst_numbers_solve_definite(double *a, double *b, int n);

#endif
