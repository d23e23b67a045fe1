/* tests/reference/geometry.h - lenses, rotations, projection and homographies (calib.h, rectification.md) plainly. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_REFERENCE_GEOMETRY_H
#define SST_TESTS_REFERENCE_GEOMETRY_H

#include "pipeline/camera/calib.h"
#include "tests/reference/wide.h"

/** OpenCV's lens model (Brown 1966): (a, b) to pixels. */
static inline void ref_distort(const struct sst_calib_camera *cam, wide a, wide b, wide *x, wide *y)
{
    const double *k = cam->k;
    const wide r2 = a * a + b * b;
    const wide s =
        (1 + k[0] * r2 + k[1] * r2 * r2 + k[4] * r2 * r2 * r2) / (1 + k[5] * r2 + k[6] * r2 * r2 + k[7] * r2 * r2 * r2);

    *x = cam->fx * (a * s + 2 * k[2] * a * b + k[3] * (r2 + 2 * a * a)) + cam->cx;
    *y = cam->fy * (b * s + k[2] * (r2 + 2 * b * b) + 2 * k[3] * a * b) + cam->cy;
}

/** rotation (X - position), divided by its depth, through the lens. */
static inline void ref_project(const struct sst_calib_camera *cam, const double X[3], wide *x, wide *y)
{
    wide p[3];

    for (int i = 0; i < 3; i++) {
        p[i] = 0;
        for (int j = 0; j < 3; j++)
            p[i] += (wide)cam->rotation[3 * i + j] * ((wide)X[j] - cam->position_mm[j]);
    }
    ref_distort(cam, p[0] / p[2], p[1] / p[2], x, y);
}

/** Rodrigues: exp([v]x) by its series in powers of [v]x, which has no special case. |v| up to a few turns. */
static inline void ref_rotation(const double v[3], wide m[9])
{
    const wide k[9] = { 0, -(wide)v[2], v[1], v[2], 0, -(wide)v[0], -(wide)v[1], v[0], 0 };
    wide term[9] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 };

    for (int i = 0; i < 9; i++)
        m[i] = term[i];
    for (int n = 1; n < 60; n++) {
        wide next[9];

        for (int i = 0; i < 9; i++) {
            next[i] = 0;
            for (int j = 0; j < 3; j++)
                next[i] += term[i / 3 * 3 + j] * k[j * 3 + i % 3];
            next[i] /= n;
        }
        for (int i = 0; i < 9; i++)
            m[i] += term[i] = next[i];
    }
}

#endif
