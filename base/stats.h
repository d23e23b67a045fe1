/* base/stats.h - sorting, medians and quantiles of small arrays. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_STATS_H
#define SST_BASE_STATS_H

#include "base/base.h"

/** Sort ascending; NaN last. n = 0 is fine, here and below. */
void sst_stats_sort_double(double *v, int n);
void sst_stats_sort_float(float *v, int n);
void sst_stats_sort_int(int *v, int n);
void sst_stats_sort_int64(int64_t *v, int n);
void sst_stats_sort_strings(char **v, int n); /* by their bytes */

/** The value of rank n / 2, NaN last: the upper of the middle two for an even n. 0 for n = 0; v is reordered. */
double sst_stats_upper_median(double *v, int n);
float sst_stats_upper_median_float(float *v, int n);

/** The middle value, the mean of the middle two for an even n. 0 for n = 0; v is sorted. */
double sst_stats_median(double *v, int n);

/** Nearest rank: the value of rank round(share (n - 1)), halves up, NaN last. 0 for n = 0; v is reordered. */
double sst_stats_quantile(double *v, int n, double share);

/** The value of rank floor(share n), at most n - 1, NaN last. 0 for n = 0; v is reordered. */
float sst_stats_quantile_float(float *v, int n, double share);

/** Smallest value of the sorted v[0..n) that at least `percent` % (1 .. 100) of them do not exceed. 0 for n = 0. */
int64_t sst_stats_percentile(const int64_t *v, int n, int percent);

/** Solve a v' = v for the 3x3 normal equations of least squares (positive definite: no pivots). a is overwritten, v
 * becomes the solution. */
void sst_stats_solve3(double a[3][3], double v[3]);

#endif
