/* tests/posed_model.h - a small model of posed pictures with known projections, by arithmetic of its own. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_POSED_MODEL_H
#define SST_TESTS_POSED_MODEL_H

#include <math.h>
#include <stdio.h>

#include "pipeline/image/codec.h"
#include "pipeline/posed/posed.h"
#include "tests/folder.h"

#define MODEL_VIEWS  8
#define MODEL_POINTS 12
#define MODEL_WIDTH  64
#define MODEL_HEIGHT 48

/* A camera: P = R (X - centre); pixel centres on integers; k1 k2 p1 p2 k3 k4 k5 k6. */
struct truth {
    double turn[3]; /* rotation vector of R */
    double R[9], centre[3];
    double fx, fy, cx, cy, k[8];
};

/* Rodrigues' formula for a vector that is not 0. */
static inline void truth_rotation(double R[9], const double v[3])
{
    const double t = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]), x = v[0] / t, y = v[1] / t, z = v[2] / t;
    const double c = cos(t), s = sin(t), u = 1 - c;

    R[0] = c + u * x * x;
    R[1] = u * x * y - s * z;
    R[2] = u * x * z + s * y;
    R[3] = u * x * y + s * z;
    R[4] = c + u * y * y;
    R[5] = u * y * z - s * x;
    R[6] = u * x * z - s * y;
    R[7] = u * y * z + s * x;
    R[8] = c + u * z * z;
}

/* t = -R centre */
static inline void truth_translation(double t[3], const struct truth *c)
{
    for (int i = 0; i < 3; i++)
        t[i] = -(c->R[3 * i] * c->centre[0] + c->R[3 * i + 1] * c->centre[1] + c->R[3 * i + 2] * c->centre[2]);
}

/* Views spread over 1.4 x 0.2 x 0.3 m, turned by up to 0.2 rad, look at points 4 to 7 m ahead. */
static inline void truth_make(struct truth view[MODEL_VIEWS], int coefficients)
{
    static const double k[8] = { -0.11, 0.02, 0.0013, -0.0007, 0.004, 0.01, -0.003, 0.001 };

    for (int i = 0; i < MODEL_VIEWS; i++) {
        struct truth *c = &view[i];

        *c = (struct truth){ .turn = { 0.05 * i - 0.2, 0.13 - 0.03 * i, 0.2 - 0.04 * (i % 3) },
                             .centre = { 0.2 * i - 0.7, 0.1 * (i % 3), 0.15 * (i % 2) },
                             .fx = 70,
                             .fy = coefficients > 2 ? 71.5 : 70,
                             .cx = 30.75,
                             .cy = 24.25 };
        truth_rotation(c->R, c->turn);
        for (int j = 0; j < coefficients; j++)
            c->k[j] = k[j];
    }
}

static inline void truth_point(double X[3], int i)
{
    X[0] = 0.9 * cos(1.7 * i);
    X[1] = 0.7 * sin(2.3 * i);
    X[2] = 4 + 0.25 * i;
}

static inline void truth_project(double px[2], const struct truth *c, const double X[3])
{
    double P[3], a, b, r, s;

    for (int i = 0; i < 3; i++)
        P[i] = c->R[3 * i] * (X[0] - c->centre[0]) + c->R[3 * i + 1] * (X[1] - c->centre[1]) +
               c->R[3 * i + 2] * (X[2] - c->centre[2]);
    a = P[0] / P[2];
    b = P[1] / P[2];
    r = a * a + b * b;
    s = (1 + c->k[0] * r + c->k[1] * r * r + c->k[4] * r * r * r) / (1 + c->k[5] * r + c->k[6] * r * r + c->k[7] * r * r * r);
    px[0] = c->fx * (a * s + 2 * c->k[2] * a * b + c->k[3] * (r + 2 * a * a)) + c->cx;
    px[1] = c->fy * (b * s + c->k[2] * (r + 2 * b * b) + 2 * c->k[3] * a * b) + c->cy;
}

/* Project by a light field's view. @param unit_mm  of X */
static inline void view_project(double px[2], const struct sst_calib_camera *c, const double X[3], double unit_mm)
{
    double P[3];

    for (int i = 0; i < 3; i++) {
        P[i] = 0;
        for (int j = 0; j < 3; j++)
            P[i] += c->rotation[3 * i + j] * (X[j] * unit_mm - c->position_mm[j]);
    }
    sst_camera_distort(c, P[0] / P[2], P[1] / P[2], &px[0], &px[1]);
}

/* Every view of the light field projects the points as the truth does. */
static inline void assert_projects(const struct sst_posed *posed, const struct truth view[MODEL_VIEWS])
{
    assert_int_equal(posed->count, MODEL_VIEWS);
    for (int k = 0; k < MODEL_VIEWS; k++) {
        assert_true(posed->view[k].camera.known);
        for (int i = 0; i < MODEL_POINTS; i++) {
            double X[3], want[2], got[2];

            truth_point(X, i);
            truth_project(want, &view[k], X);
            view_project(got, &posed->view[k].camera, X, 1000);
            if (!(hypot(want[0] - got[0], want[1] - got[1]) < 1e-6))
                fail_msg("view %d, point %d: %.9f, %.9f, not %.9f, %.9f", k, i, got[0], got[1], want[0], want[1]);
        }
    }
}

/* Name of a picture: COLMAP's text allows none with blanks at its ends. */
static inline void picture_name(char name[32], int i)
{
    snprintf(name, 32, "b\xc3\xa4um %d.png", i + 1);
}

static inline void put_picture(const char *path, int tag)
{
    struct sst_image img;

    assert_int_equal(sst_image_init(&img, MODEL_WIDTH, MODEL_HEIGHT), 0);
    for (int y = 0; y < MODEL_HEIGHT; y++) {
        for (int x = 0; x < MODEL_WIDTH; x++) {
            sst_image_row(&img, 0, y)[x] = (uint8_t)(tag * 20);
            sst_image_row(&img, 1, y)[x] = (uint8_t)(4 * x);
            sst_image_row(&img, 2, y)[x] = (uint8_t)(5 * y);
        }
    }
    assert_int_equal(sst_image_write_png(&img, path), 0);
    sst_image_fini(&img);
}

/* The pictures of the views in test_folder/DIR. */
static inline void put_pictures(const char *dir)
{
    assert_int_equal(sst_path_make_dir(test_path("%s", dir)), 0);
    for (int i = 0; i < MODEL_VIEWS; i++) {
        char name[32];

        picture_name(name, i);
        put_picture(test_path("%s/%s", dir, name), i);
    }
}

#endif
