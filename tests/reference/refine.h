/* tests/reference/refine.h - design.md, 5.3, written down plainly. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_REFERENCE_REFINE_H
#define SST_TESTS_REFERENCE_REFINE_H

#include <stdint.h>

#include "tests/reference/wide.h"

/** Mean and sample variance of stored disparities by their counts, in two passes. @param n  of both, at least 2 values
 */
static inline void ref_fit(quad *mean, quad *variance, const int64_t (*value_count)[2], int n)
{
    quad sum = 0, total = 0, squares = 0;

    for (int i = 0; i < n; i++) {
        sum += (quad)value_count[i][0] * value_count[i][1];
        total += value_count[i][1];
    }
    *mean = sum / total;
    for (int i = 0; i < n; i++)
        squares += (value_count[i][0] - *mean) * (value_count[i][0] - *mean) * value_count[i][1];
    *variance = squares / (total - 1);
}

/** Density of N(mean, sigma^2). */
static inline wide ref_density(wide mean, wide sigma, wide d)
{
    const wide z = (d - mean) / sigma;

    return expl(-z * z / 2) / (sigma * sqrtl(2 * acosl(-1)));
}

/** E_d = min |p - r|^2 / max |p - r|^2. */
static inline wide ref_energy_distance(uint32_t nearest2, uint32_t farthest2)
{
    return farthest2 ? (wide)nearest2 / farthest2 : 0;
}

/** E_n = -S / (S + tau n), S = <m, sum of normals>, 0 where S <= 0 or there is none. */
static inline wide ref_energy_normal(const double m[3], const double sum[3], int64_t n, double tau)
{
    const wide s = (wide)m[0] * sum[0] + (wide)m[1] * sum[1] + (wide)m[2] * sum[2];

    return n > 0 && s > 0 ? -s / (s + (wide)tau * n) : 0;
}

/** Least squares plane z = c + a (x - x0) + b (y - y0) through n points, by the normal equations. @return false: a line
 */
static inline int ref_plane(quad abc[3], const int (*xyz)[3], int n, int x0, int y0)
{
    quad mx = 0, my = 0, mz = 0, xx = 0, xy = 0, yy = 0, xz = 0, yz = 0, det;

    for (int i = 0; i < n; i++) {
        mx += (quad)xyz[i][0] / n;
        my += (quad)xyz[i][1] / n;
        mz += (quad)xyz[i][2] / n;
    }
    for (int i = 0; i < n; i++) {
        const quad x = xyz[i][0] - mx, y = xyz[i][1] - my, z = xyz[i][2] - mz;

        xx += x * x;
        xy += x * y;
        yy += y * y;
        xz += x * z;
        yz += y * z;
    }
    det = xx * yy - xy * xy;
    if (n < 3 || !(det > xx * yy * (quad)1e-6))
        return 0;
    abc[0] = (xz * yy - yz * xy) / det;
    abc[1] = (yz * xx - xz * xy) / det;
    abc[2] = mz + abc[0] * (x0 - mx) + abc[1] * (y0 - my);
    return 1;
}

#endif
