/* pipeline/camera/numbers.h - small numerics that finding boards, solving and reporting share. */
#ifndef SST_PIPELINE_CAMERA_NUMBERS_H
#define SST_PIPELINE_CAMERA_NUMBERS_H

#include <stdbool.h>

#include "base/base.h"

/** Solve the positive definite a x = b (n <= 12, a row-major, its lower half read, overwritten). @return false: a is
 *  not so, or nearly not */
SST_MUST_CHECK bool sst_solve_definite(double *a, double *b, int n);

#endif
