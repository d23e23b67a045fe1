/* pipeline/camera/numbers.h - normal equations of least squares, shared by formats, detection, solver and checks. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CAMERA_NUMBERS_H
#define SST_PIPELINE_CAMERA_NUMBERS_H

#include <stdbool.h>

#include "base/base.h"

/**
 * Cholesky's factor L of a [n][n] in place (the lower half is read and written). Unknowns whose pivot rounding has
 * eaten are left out: their pivot is 0.
 * @return false: there are such: a is not positive definite, or nearly singular
 */
bool sst_numbers_factor(double *a, int n);

/** Solve L L' x = b for such a factor. @param x  in: b; out: x, 0 where an unknown is left out */
void sst_numbers_substitute(const double *l, int n, double *x);

/** Both: a x = b. @return as sst_numbers_factor() */
bool sst_numbers_solve(double *a, double *x, int n);

/** Products of 3x3 matrices and vectors, without -0. @param out  may be an input */
void sst_numbers_mul3(const double a[9], const double b[9], double out[9]);
void sst_numbers_apply3(const double a[9], const double v[3], double out[3]);

#endif
