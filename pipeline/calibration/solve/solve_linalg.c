/* Small dense linear algebra in a fixed order of operations; the results of LAPACK depend on its threads. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <string.h>

#include "pipeline/calibration/solve/solve_internal.h"

void solve_mul3t(const double a[9], const double b[9], double out[9])
{
    double m[9];

    for (int i = 0; i < 9; i++)
        m[i] = a[i / 3] * b[i % 3] + a[3 + i / 3] * b[3 + i % 3] + a[6 + i / 3] * b[6 + i % 3];
    memcpy(out, m, sizeof(m));
}

/* 1 + (1 - cos t) / t^2 [v]x + (t - sin t) / t^3 [v]x^2. */
void solve_left_jacobian(const double v[3], double out[9])
{
    const double t2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2], t = sqrt(t2);
    const double half = t < 1e-4 ? 0.5 - t2 / 48 : sin(t / 2) / t, b = 2 * half * half;
    const double c = t < 1e-2 ? 1.0 / 6 - t2 / 120 + t2 * t2 / 5040 : (t - sin(t)) / (t2 * t);
    const double cross[9] = { 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0 };
    double square[9];

    sst_numbers_mul3(cross, cross, square);
    for (int i = 0; i < 9; i++)
        out[i] = (i % 4 == 0) + b * cross[i] + c * square[i];
}

bool solve_cholesky(double *a, int n)
{
    for (int i = 0; i < n; i++) {
        double *row = a + (size_t)i * n;

        for (int j = 0; j <= i; j++) {
            const double *other = a + (size_t)j * n;
            double part[4] = { 0 }, sum = row[j];
            int l = 0;

            for (; l + 4 <= j; l += 4) {
                for (int s = 0; s < 4; s++)
                    part[s] += row[l + s] * other[l + s];
            }
            for (; l < j; l++)
                sum -= row[l] * other[l];
            sum -= (part[0] + part[1]) + (part[2] + part[3]);
            if (j < i) {
                row[j] = sum / other[j];
            } else {
                if (!(sum > 0) || !isfinite(sum))
                    return false;
                row[i] = sqrt(sum);
            }
        }
    }
    return true;
}

/* L^-1 row by row, then its L^-T L^-1 column by column: sums run along rows. */
void solve_cholesky_inverse(double *l, int n, double *work)
{
    for (int i = 0; i < n; i++) {
        double *row = l + (size_t)i * n;
        const double pivot = 1 / row[i];

        memset(work, 0, (size_t)n * sizeof(*work));
        for (int j = 0; j < i; j++) {
            const double *done = l + (size_t)j * n;

            for (int c = 0; c <= j; c++)
                work[c] -= row[j] * done[c];
        }
        for (int c = 0; c < i; c++)
            row[c] = work[c] * pivot;
        row[i] = pivot;
    }
    /* (L^-T L^-1)[i][j] = sum over k >= max(i, j) of Li[k][i] Li[k][j]: row i is final once all k >= i are in. */
    for (int i = 0; i < n; i++) {
        memset(work, 0, (size_t)n * sizeof(*work));
        for (int k = i; k < n; k++) {
            const double *row = l + (size_t)k * n, f = row[i];

            for (int j = 0; j <= i; j++)
                work[j] += f * row[j];
        }
        memcpy(l + (size_t)i * n, work, (size_t)(i + 1) * sizeof(*work));
    }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < i; j++)
            l[(size_t)j * n + i] = l[(size_t)i * n + j];
    }
}

void solve_qr(double *a, int m, int n)
{
    double dot[SOLVE_COLS_MAX];

    for (int c = 0; c < n && c < m; c++) {
        double *top = a + (size_t)c * n, norm2 = 0, pivot, f;

        for (int i = c + 1; i < m; i++)
            norm2 += a[(size_t)i * n + c] * a[(size_t)i * n + c];
        if (!(norm2 > 0))
            continue;
        pivot = top[c] > 0 ? -sqrt(norm2 + top[c] * top[c]) : sqrt(norm2 + top[c] * top[c]);
        /* v = column - pivot e, H = 1 - v v^T / f. */
        f = pivot * (pivot - top[c]);
        top[c] -= pivot;
        for (int j = c + 1; j < n; j++)
            dot[j] = 0;
        for (int i = c; i < m; i++) {
            const double *row = a + (size_t)i * n, v = row[c];

            for (int j = c + 1; j < n; j++)
                dot[j] += v * row[j];
        }
        for (int j = c + 1; j < n; j++)
            dot[j] /= f;
        for (int i = c; i < m; i++) {
            double *row = a + (size_t)i * n;
            const double v = row[c];

            for (int j = c + 1; j < n; j++)
                row[j] -= v * dot[j];
        }
        top[c] = pivot;
        for (int i = c + 1; i < m; i++)
            a[(size_t)i * n + c] = 0;
    }
}

void solve_pose_chain(struct solve_pose *out, const struct solve_pose *second, const struct solve_pose *first)
{
    struct solve_pose both;

    sst_numbers_mul3(second->rotation, first->rotation, both.rotation);
    sst_numbers_apply3(second->rotation, first->shift, both.shift);
    for (int i = 0; i < 3; i++)
        both.shift[i] += second->shift[i];
    *out = both;
}

void solve_pose_inverse(struct solve_pose *out, const struct solve_pose *in)
{
    struct solve_pose back;

    for (int i = 0; i < 9; i++)
        back.rotation[i] = in->rotation[i % 3 * 3 + i / 3];
    sst_numbers_apply3(back.rotation, in->shift, back.shift);
    for (int i = 0; i < 3; i++)
        back.shift[i] = -back.shift[i];
    *out = back;
}
