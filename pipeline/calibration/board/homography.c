/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/calibration/board/homography.h"

#include <math.h>
#include <string.h>

#include "pipeline/camera/numbers.h"

#define STEPS 4 /* of Gauss-Newton: from the algebraic solution, two already reach rounding */

/* Shift and scale after which points have mean 0 and mean squared distance 2. */
struct norm {
    double x, y, scale;
};

static bool normalise(struct norm *out, const double (*p)[2], const double *weight, int n)
{
    double sum = 0, x = 0, y = 0, square = 0;

    for (int i = 0; i < n; i++) {
        const double w = weight ? weight[i] : 1;

        sum += w;
        x += w * p[i][0];
        y += w * p[i][1];
    }
    if (!(sum > 0) || !isfinite(x) || !isfinite(y))
        return false;
    x /= sum;
    y /= sum;
    for (int i = 0; i < n; i++) {
        const double dx = p[i][0] - x, dy = p[i][1] - y;

        square += (weight ? weight[i] : 1) * (dx * dx + dy * dy);
    }
    square /= sum;
    if (!(square > 1e-200) || !isfinite(square))
        return false;
    *out = (struct norm){ x, y, sqrt(2 / square) };
    return true;
}

/* Sum of weight (row^T row) and weight (row^T right) of one equation row h = right. */
static void accumulate(double a[64], double b[8], const double row[8], double right, double weight)
{
    for (int i = 0; i < 8; i++) {
        for (int j = 0; j <= i; j++)
            a[8 * i + j] += weight * row[i] * row[j];
        b[i] += weight * row[i] * right;
    }
}

/* Pairs of points, and their normalisation. */
struct points {
    const double (*from)[2], (*to)[2];
    const double *weight; /* NULL: all 1 */
    int n;
    struct norm f, t;
};

/*
 * One round on normalised points: the two equations of a point are divided by h's denominator there, so that they
 * measure distances in the picture, and right is the residual of h. With first, h is not read: the denominators are 1
 * and all eight numbers are solved for.
 */
static bool improve(double h[9], const struct points *p, bool first)
{
    const double(*from)[2] = p->from, (*to)[2] = p->to, *weight = p->weight;
    const struct norm *f = &p->f, *t = &p->t;
    double a[64] = { 0 }, b[8] = { 0 };

    for (int i = 0; i < p->n; i++) {
        const double u = f->scale * (from[i][0] - f->x), v = f->scale * (from[i][1] - f->y);
        const double x = t->scale * (to[i][0] - t->x), y = t->scale * (to[i][1] - t->y);
        const double w = first ? 1 : h[6] * u + h[7] * v + h[8];
        double px = x, py = y, left[2] = { x, y };

        if (!(w > 1e-6))
            return false;
        if (!first) {
            px = (h[0] * u + h[1] * v + h[2]) / w;
            py = (h[3] * u + h[4] * v + h[5]) / w;
            left[0] = x - px;
            left[1] = y - py;
        }
        const double row_x[8] = { u / w, v / w, 1 / w, 0, 0, 0, -u * px / w, -v * px / w };
        const double row_y[8] = { 0, 0, 0, u / w, v / w, 1 / w, -u * py / w, -v * py / w };

        accumulate(a, b, row_x, left[0], weight ? weight[i] : 1);
        accumulate(a, b, row_y, left[1], weight ? weight[i] : 1);
    }
    if (!sst_numbers_solve(a, b, 8))
        return false;
    for (int i = 0; i < 8; i++)
        h[i] = first ? b[i] : h[i] + b[i];
    h[8] = 1;
    return true;
}

/* h of normalised points to h of the points themselves: T^-1 h F. */
static void restore(double h[9], const struct norm *f, const struct norm *t)
{
    double m[9];

    for (int i = 0; i < 3; i++) {
        m[3 * i] = h[3 * i] * f->scale;
        m[3 * i + 1] = h[3 * i + 1] * f->scale;
        m[3 * i + 2] = h[3 * i + 2] - f->scale * (h[3 * i] * f->x + h[3 * i + 1] * f->y);
    }
    for (int j = 0; j < 3; j++) {
        h[j] = m[j] / t->scale + t->x * m[6 + j];
        h[3 + j] = m[3 + j] / t->scale + t->y * m[6 + j];
        h[6 + j] = m[6 + j];
    }
}

bool sst_homography_fit(double h[9], const double (*from)[2], const double (*to)[2], const double *weight, int n)
{
    struct points p = { .from = from, .to = to, .weight = weight, .n = n };
    const struct norm *f = &p.f;
    double got[9];

    if (n < 4 || !normalise(&p.f, from, weight, n) || !normalise(&p.t, to, weight, n) || !improve(got, &p, true))
        return false;
    for (int k = 0; k < STEPS; k++) {
        if (!improve(got, &p, false))
            return false;
    }
    for (int i = 0; i < n; i++) { /* the last step has moved h once more */
        if (!(got[6] * f->scale * (from[i][0] - f->x) + got[7] * f->scale * (from[i][1] - f->y) + 1 > 1e-6))
            return false;
    }
    restore(got, &p.f, &p.t);
    for (int i = 0; i < 9; i++) {
        if (!isfinite(got[i]))
            return false;
    }
    memcpy(h, got, sizeof(got));
    return true;
}

bool sst_homography_apply(const double h[9], const double from[2], double out[2])
{
    const double w = h[6] * from[0] + h[7] * from[1] + h[8];

    if (!(w > 1e-9))
        return false;
    const double x = (h[0] * from[0] + h[1] * from[1] + h[2]) / w;
    const double y = (h[3] * from[0] + h[4] * from[1] + h[5]) / w;

    out[0] = x;
    out[1] = y;
    return true;
}

bool sst_homography_slope(const double h[9], const double from[2], double by[4])
{
    const double w = h[6] * from[0] + h[7] * from[1] + h[8];
    double at[2];

    if (!sst_homography_apply(h, from, at))
        return false;
    by[0] = (h[0] - at[0] * h[6]) / w;
    by[1] = (h[1] - at[0] * h[7]) / w;
    by[2] = (h[3] - at[1] * h[6]) / w;
    by[3] = (h[4] - at[1] * h[7]) / w;
    return true;
}
