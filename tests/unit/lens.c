/* pipeline/camera/camera.c: the lens model and its inverse, and rotations as vectors. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "pipeline/camera/calib.h"
#include "tests/camera_project.h"
#include "tests/test.h"

static struct sst_calib_camera camera(int lens, const double *k)
{
    struct sst_calib_camera cam = { .known = true,
                                    .fx = 500,
                                    .fy = 400,
                                    .cx = 320,
                                    .cy = 240,
                                    .lens = lens,
                                    .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 } };

    if (lens)
        memcpy(cam.k, k, (size_t)lens * sizeof(*k));
    return cam;
}

/* a = 0.5, b = -0.25: r2 = 0.3125. */
static void distorts_by_hand(void **state SST_UNUSED)
{
    const double k[8] = { 0.1, 0.2, 0.01, 0.02, 0.4, 0.5, 0.25, 0.125 };
    const double r2 = 0.3125, over = 1 + 0.1 * r2 + 0.2 * r2 * r2 + 0.4 * r2 * r2 * r2,
                 under = 1 + 0.5 * r2 + 0.25 * r2 * r2 + 0.125 * r2 * r2 * r2;
    const struct sst_calib_camera cam = camera(8, k);
    double x, y;

    sst_camera_distort(&cam, 0.5, -0.25, &x, &y);
    /* 2 p1 a b = -0.0025, p2 (r2 + 2 a^2) = 0.01625; p1 (r2 + 2 b^2) = 0.004375, 2 p2 a b = -0.005 */
    assert_true(fabs(x - (320 + 500 * (0.5 * over / under + 0.01375))) < 1e-10);
    assert_true(fabs(y - (240 + 400 * (-0.25 * over / under - 0.000625))) < 1e-10);
}

static void undistorts_what_it_distorts(void **state SST_UNUSED)
{
    static const double lenses[][8] = {
        { 0 },
        { -0.26, 0.09, 1e-3, -2e-4, -0.002 },
        { 0.1, -0.2, 1e-4, 2e-4, 0.05, 0.3, -0.1, 0.02 },
        { 0.4 },
    };

    for (int i = 0; i < 4 * 21 * 21; i++) {
        const struct sst_calib_camera cam = camera(8, lenses[i % 4]);
        const double a = (i / 4 % 21 - 10) * 0.06, b = (i / 84 - 10) * 0.06;
        double x, y, back[2];

        sst_camera_distort(&cam, a, b, &x, &y);
        assert_true(sst_camera_undistort(&cam, x, y, &back[0], &back[1]));
        assert_true(fabs(back[0] - a) + fabs(back[1] - b) < 1e-11);
    }
}

/* s = 1 - 0.3 r2: r s grows up to r2 = 1.11, falls, and is negative from r2 = 3.33 on, where the picture would be seen
 * turned by 180 degrees. */
static void nothing_is_seen_beyond_the_fold(void **state SST_UNUSED)
{
    const double k[5] = { -0.3 };
    const struct sst_calib_camera cam = camera(5, k);
    double x, y, a, b;

    assert_true(camera_project(&cam, (const double[]){ 1.0, 0, 1 }, &x, &y));
    assert_true(fabs(x - (320 + 500 * 0.7)) < 1e-9);
    assert_false(camera_project(&cam, (const double[]){ 1.2, 0, 1 }, &x, &y));
    assert_false(camera_project(&cam, (const double[]){ 2.5, 0, 1 }, &x, &y));
    assert_false(camera_project(&cam, (const double[]){ 0, -2.5, 1 }, &x, &y));
    assert_false(camera_project(&cam, (const double[]){ 0, 0, -1 }, &x, &y));
    assert_false(camera_project(&cam, (const double[]){ 0, 0, 0 }, &x, &y));
    assert_false(sst_camera_undistort(&cam, 320 + 500 * 0.8, 240, &a, &b)); /* r s is at most 0.703 */
    assert_false(sst_camera_undistort(&cam, 320 + 500 * 2.5, 240, &a, &b)); /* Newton begins inside out */
    assert_false(sst_camera_undistort(&cam, NAN, 240, &a, &b));
}

/* R = Rz(90), at (10, 20, 30): (10, 20, 40) is on the axis, (15, 20, 40) half a focal length down. */
static void projects_by_hand(void **state SST_UNUSED)
{
    struct sst_calib_camera cam = camera(0, NULL);
    double x, y;

    memcpy(cam.rotation, (const double[]){ 0, -1, 0, 1, 0, 0, 0, 0, 1 }, sizeof(cam.rotation));
    memcpy(cam.position_mm, (const double[]){ 10, 20, 30 }, sizeof(cam.position_mm));
    assert_true(camera_project(&cam, (const double[]){ 10, 20, 40 }, &x, &y));
    assert_true(x == 320 && y == 240);
    assert_true(camera_project(&cam, (const double[]){ 15, 20, 40 }, &x, &y));
    assert_true(fabs(x - 320) < 1e-12 && fabs(y - 440) < 1e-12);
}

static void rotations_come_back(void **state SST_UNUSED)
{
    static const double angles[] = { 0, 1e-300, 1e-9, 1e-5, 1e-4, 0.1, 1.5, 3.0, 3.1415926, 3.141592653589793 };

    for (size_t i = 0; i < ARRAY_LEN(angles); i++) {
        for (int axis = 0; axis < 26; axis++) {
            const int code = axis < 13 ? axis : axis + 1; /* all directions of a cube but none */
            const double d[3] = { code / 9 - 1, code / 3 % 3 - 1, code % 3 - 1 };
            const double n = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
            double v[3], m[9], w[3], again[9];

            for (int j = 0; j < 3; j++)
                v[j] = d[j] / n * angles[i];
            sst_rotation_from_vector(v, m);
            sst_rotation_to_vector(m, w);
            sst_rotation_from_vector(w, again);
            for (int j = 0; j < 9; j++)
                assert_true(fabs(m[j] - again[j]) < 4e-16 * 4);
            for (int j = 0; j < 3 && angles[i] < 3.14; j++)
                assert_true(fabs(w[j] - v[j]) <= 1e-14 * angles[i] + 1e-17);
        }
    }
}

/* Quarter turns about z and about x: effect on the axes of a, then of b's inverse. */
static void turns_are_told_apart(void **state SST_UNUSED)
{
    const double about_z[9] = { 0, -1, 0, 1, 0, 0, 0, 0, 1 }, about_x[9] = { 1, 0, 0, 0, 0, -1, 0, 1, 0 };
    const double both[9] = { 0, 0, -1, 1, 0, 0, 0, -1, 0 }, none[9] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 };
    double m[9];

    sst_rotation_between(about_z, about_x, m);
    assert_memory_equal(m, both, sizeof(m)); /* bit for bit: no -0 among the zeros */
    sst_rotation_between(about_z, about_z, m);
    assert_memory_equal(m, none, sizeof(m));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(distorts_by_hand),
        cmocka_unit_test(undistorts_what_it_distorts),
        cmocka_unit_test(nothing_is_seen_beyond_the_fold),
        cmocka_unit_test(projects_by_hand),
        cmocka_unit_test(rotations_come_back),
        cmocka_unit_test(turns_are_told_apart),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
