/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/camera/numbers.h"

#include <math.h>
#include <string.h>

#define LEAST_PIVOT 1e-14 /* of its diagonal */

bool sst_numbers_factor(double *a, int n)
{
    const size_t size = (size_t)n;
    bool definite = true;

    for (size_t i = 0; i < size; i++) {
        double *row = a + i * size;
        const double least = LEAST_PIVOT * row[i];

        for (size_t j = 0; j <= i; j++) {
            const double *other = a + j * size;
            double sum = row[j];

            for (size_t k = 0; k < j; k++)
                sum -= row[k] * other[k];
            if (j < i)
                row[j] = other[j] > 0 ? sum / other[j] : 0;
            else
                row[i] = sum > least && sum > 1e-280 && isfinite(sum) ? sqrt(sum) : 0;
        }
        definite &= row[i] > 0;
    }
    return definite;
}

void sst_numbers_substitute(const double *l, int n, double *x)
{
    const size_t size = (size_t)n;

    for (size_t i = 0; i < size; i++) {
        for (size_t k = 0; k < i; k++)
            x[i] -= l[i * size + k] * x[k];
        x[i] = l[i * size + i] > 0 ? x[i] / l[i * size + i] : 0;
    }
    for (size_t i = size; i-- > 0;) {
        for (size_t k = i + 1; k < size; k++)
            x[i] -= l[k * size + i] * x[k];
        x[i] = l[i * size + i] > 0 ? x[i] / l[i * size + i] : 0;
    }
}

bool sst_numbers_solve(double *a, double *x, int n)
{
    const bool definite = sst_numbers_factor(a, n);

    sst_numbers_substitute(a, n, x);
    return definite;
}

void sst_numbers_mul3(const double a[9], const double b[9], double out[9])
{
    double m[9];

    for (int i = 0; i < 9; i++)
        m[i] = 0 + a[i / 3 * 3] * b[i % 3] + a[i / 3 * 3 + 1] * b[3 + i % 3] + a[i / 3 * 3 + 2] * b[6 + i % 3];
    memcpy(out, m, sizeof(m));
}

void sst_numbers_apply3(const double a[9], const double v[3], double out[3])
{
    const double x = v[0], y = v[1], z = v[2];

    for (int i = 0; i < 3; i++)
        out[i] = 0 + a[3 * i] * x + a[3 * i + 1] * y + a[3 * i + 2] * z;
}
