/* pipeline/camera/numbers.h - small numerics that finding boards, solving and reporting share. */
#ifndef SST_PIPELINE_CAMERA_NUMBERS_H
#define SST_PIPELINE_CAMERA_NUMBERS_H

#include <stdbool.h>

#include "base/base.h"

/** Solve the positive definite a x = b (n <= 12, a row-major, its lower half read, overwritten). @return false: a is
 *  not so, or nearly not */
SST_MUST_CHECK bool sst_solve_definite(double *a, double *b, int n);

/** The value of rank n / 2, of an even number the upper of the middle two; v is reordered and has no NaN; 0 for n = 0.
 */
double sst_upper_median(double *v, int n);

#endif
