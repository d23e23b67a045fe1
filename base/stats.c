/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/stats.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* qsort() must not get NULL, which an empty array may be. */
static void sort(void *v, int n, size_t size, int (*compare)(const void *, const void *))
{
    if (n > 1)
        qsort(v, (size_t)n, size, compare);
}

/* `nan_last` orders x and y if one of them is not a number. */
#define DEFINE_SORT(name, type, nan_last)                                                                              \
    static int compare_##name(const void *a, const void *b)                                                            \
    {                                                                                                                  \
        const type x = *(const type *)a, y = *(const type *)b;                                                         \
                                                                                                                       \
        return (x > y) - (x < y) + (nan_last);                                                                         \
    }                                                                                                                  \
    void sst_stats_sort_##name(type *v, int n)                                                                         \
    {                                                                                                                  \
        sort(v, n, sizeof(*v), compare_##name);                                                                        \
    }

DEFINE_SORT(double, double, !!isnan(x) - !!isnan(y))
DEFINE_SORT(float, float, !!isnan(x) - !!isnan(y))
DEFINE_SORT(int, int, 0)
DEFINE_SORT(int64, int64_t, 0)

static int compare_string(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

void sst_stats_sort_strings(char **v, int n)
{
    sort(v, n, sizeof(*v), compare_string);
}

/* The value of a rank, NaN last, by Hoare's selection among the values that are numbers, moved to the front. */
#define DEFINE_SELECT(NAME, TYPE)                                                                                      \
    static TYPE NAME(TYPE *v, int n, int rank)                                                                         \
    {                                                                                                                  \
        int low = 0, high = -1;                                                                                        \
                                                                                                                       \
        for (int i = 0; i < n; i++) {                                                                                  \
            const TYPE value = v[i];                                                                                   \
                                                                                                                       \
            if (isnan(value))                                                                                          \
                continue;                                                                                              \
            v[i] = v[++high];                                                                                          \
            v[high] = value;                                                                                           \
        }                                                                                                              \
        if (rank > high)                                                                                               \
            return (TYPE)NAN;                                                                                          \
        while (low < high) {                                                                                           \
            const TYPE pivot = v[rank];                                                                                \
            int i = low, j = high;                                                                                     \
                                                                                                                       \
            while (i <= j) {                                                                                           \
                while (v[i] < pivot)                                                                                   \
                    i++;                                                                                               \
                while (v[j] > pivot)                                                                                   \
                    j--;                                                                                               \
                if (i <= j) {                                                                                          \
                    const TYPE t = v[i];                                                                               \
                                                                                                                       \
                    v[i++] = v[j];                                                                                     \
                    v[j--] = t;                                                                                        \
                }                                                                                                      \
            }                                                                                                          \
            if (j < rank)                                                                                              \
                low = i;                                                                                               \
            if (i > rank)                                                                                              \
                high = j;                                                                                              \
        }                                                                                                              \
        return v[rank];                                                                                                \
    }

DEFINE_SELECT(select_double, double)
DEFINE_SELECT(select_float, float)

double sst_stats_upper_median(double *v, int n)
{
    return n < 1 ? 0 : select_double(v, n, n / 2);
}

float sst_stats_upper_median_float(float *v, int n)
{
    return n < 1 ? 0 : select_float(v, n, n / 2);
}

double sst_stats_median(double *v, int n)
{
    if (n < 1)
        return 0;
    sst_stats_sort_double(v, n);
    return n % 2 ? v[n / 2] : v[n / 2 - 1] + (v[n / 2] - v[n / 2 - 1]) / 2;
}

double sst_stats_quantile(double *v, int n, double share)
{
    return n < 1 ? 0 : select_double(v, n, sst_clamp_int((int)floor(share * (n - 1) + 0.5), 0, n - 1));
}

float sst_stats_quantile_float(float *v, int n, double share)
{
    return n < 1 ? 0 : select_float(v, n, sst_clamp_int((int)(share * n), 0, n - 1));
}

int64_t sst_stats_percentile(const int64_t *v, int n, int percent)
{
    return n > 0 ? v[((int64_t)n * percent + 99) / 100 - 1] : 0;
}

void sst_stats_solve3(double a[3][3], double v[3])
{
    for (int i = 0; i < 3; i++) {
        for (int k = i + 1; k < 3; k++) {
            const double f = a[k][i] / a[i][i];

            for (int j = i; j < 3; j++)
                a[k][j] -= f * a[i][j];
            v[k] -= f * v[i];
        }
    }
    for (int i = 2; i >= 0; i--) {
        for (int j = i + 1; j < 3; j++)
            v[i] -= a[i][j] * v[j];
        v[i] /= a[i][i];
    }
}
