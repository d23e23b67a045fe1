/* The lens model and its inverse; rotations as vectors. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <string.h>

#include "pipeline/camera/calib.h"

/* The distorted (a, b), and its derivatives: by[0..3] = dx/da, dx/db, dy/da, dy/db. by may be NULL. */
static void distort_with_slope(const double k[SST_LENS_MAX], double a, double b, double out[2], double by[4])
{
    const double r2 = a * a + b * b;
    const double over = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4])), under = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
    const double s = over / under;

    out[0] = a * s + 2 * k[2] * a * b + k[3] * (r2 + 2 * a * a);
    out[1] = b * s + k[2] * (r2 + 2 * b * b) + 2 * k[3] * a * b;
    if (by) {
        /* ds/d(r2), twice: r2 grows by 2 a da + 2 b db. */
        const double d_over = k[0] + r2 * (2 * k[1] + r2 * 3 * k[4]), d_under = k[5] + r2 * (2 * k[6] + r2 * 3 * k[7]);
        const double slope = 2 * (d_over - s * d_under) / under;

        by[0] = s + a * a * slope + 2 * k[2] * b + 6 * k[3] * a;
        by[1] = a * b * slope + 2 * k[2] * a + 2 * k[3] * b;
        by[2] = by[1];
        by[3] = s + b * b * slope + 6 * k[2] * b + 2 * k[3] * a;
    }
}

/* True where the mapping is neither folded nor, still further out, inverted: there the determinant is positive
 * again. */
static bool upright(const double by[4])
{
    return by[0] * by[3] - by[1] * by[2] > 0.01 && by[0] + by[3] > 0;
}

void sst_camera_distort(const struct sst_calib_camera *cam, double a, double b, double *x, double *y)
{
    double d[2];

    distort_with_slope(cam->k, a, b, d, NULL);
    *x = cam->fx * d[0] + cam->cx;
    *y = cam->fy * d[1] + cam->cy;
}

/* Coefficients c of r2, r2^2, r2^3 where r becomes s r (1 + k1 r2), to r2^3. */
static void substitute(double c[3], double s, double k1)
{
    const double s2 = s * s, a = c[0] * s2, b = c[1] * s2 * s2;

    c[2] = c[2] * s2 * s2 * s2 + 4 * k1 * b + k1 * k1 * a;
    c[1] = b + 2 * k1 * a;
    c[0] = a;
}

void sst_camera_adjust(struct sst_calib_camera *cam, double s, double k1)
{
    double above[3] = { cam->k[0], cam->k[1], cam->k[4] };

    cam->fx *= s;
    cam->fy *= s;
    substitute(above, s, k1);
    substitute(cam->k + 5, s, k1);
    cam->k[0] = above[0] + k1;
    cam->k[1] = above[1] + k1 * above[0];
    cam->k[4] = above[2] + k1 * above[1];
    cam->k[2] *= s;
    cam->k[3] *= s;
    if (k1 != 0 && !cam->lens)
        cam->lens = 5;
}

bool sst_camera_undistort(const struct sst_calib_camera *cam, double x, double y, double *a, double *b)
{
    const double u = (x - cam->cx) / cam->fx, v = (y - cam->cy) / cam->fy;
    double at[2] = { u, v }, seen[2], by[4];

    for (int i = 0; i < 50; i++) {
        double det;

        distort_with_slope(cam->k, at[0], at[1], seen, by);
        if (!upright(by))
            return false;
        det = by[0] * by[3] - by[1] * by[2];
        if (fabs(seen[0] - u) + fabs(seen[1] - v) < 1e-12) {
            *a = at[0];
            *b = at[1];
            return true;
        }
        at[0] -= (by[3] * (seen[0] - u) - by[1] * (seen[1] - v)) / det;
        at[1] -= (by[0] * (seen[1] - v) - by[2] * (seen[0] - u)) / det;
    }
    return false;
}

/* Rodrigues: R = cos t 1 + (1 - cos t) n n^T + sin t [n]x, by series where the angle t is small. */
void sst_rotation_from_vector(const double v[3], double m[9])
{
    const double t2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2], t = sqrt(t2);
    const double s = t < 1e-4 ? 1 - t2 / 6 : sin(t) / t;                                /* sin t / t */
    const double half = t < 1e-4 ? 0.5 - t2 / 48 : sin(t / 2) / t, c = 2 * half * half; /* (1 - cos t) / t2 */
    const double x = v[0], y = v[1], z = v[2];
    const double turned[9] = { 1 - c * (y * y + z * z), c * x * y - s * z,       c * x * z + s * y,
                               c * x * y + s * z,       1 - c * (x * x + z * z), c * y * z - s * x,
                               c * x * z - s * y,       c * y * z + s * x,       1 - c * (x * x + y * y) };

    memcpy(m, turned, sizeof(turned));
}

/* By way of the quaternion, from its largest part: no cancellation at any angle. */
void sst_rotation_to_vector(const double m[9], double v[3])
{
    const double four[4] = { 1 + m[0] + m[4] + m[8], 1 + m[0] - m[4] - m[8], 1 - m[0] + m[4] - m[8],
                             1 - m[0] - m[4] + m[8] };
    double q[4], norm, f;
    int largest = 0;

    for (int i = 1; i < 4; i++) {
        if (four[i] > four[largest])
            largest = i;
    }
    switch (largest) {
    case 0:
        q[0] = four[0], q[1] = m[7] - m[5], q[2] = m[2] - m[6], q[3] = m[3] - m[1];
        break;
    case 1:
        q[0] = m[7] - m[5], q[1] = four[1], q[2] = m[1] + m[3], q[3] = m[2] + m[6];
        break;
    case 2:
        q[0] = m[2] - m[6], q[1] = m[1] + m[3], q[2] = four[2], q[3] = m[5] + m[7];
        break;
    default:
        q[0] = m[3] - m[1], q[1] = m[2] + m[6], q[2] = m[5] + m[7], q[3] = four[3];
    }
    norm = sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (q[0] < 0) { /* the same rotation, by less than half a turn */
        for (int i = 0; i < 4; i++)
            q[i] = -q[i];
    }
    f = norm > 0 ? 2 * atan2(norm, q[0]) / norm : 0;
    for (int i = 0; i < 3; i++)
        v[i] = f * q[i + 1];
}

void sst_rotation_between(const double a[9], const double b[9], double out[9])
{
    for (int i = 0; i < 9; i++) {
        const double *p = a + i / 3 * 3, *q = b + i % 3 * 3;

        out[i] = 0 + p[0] * q[0] + p[1] * q[1] + p[2] * q[2]; /* no -0 */
    }
}
