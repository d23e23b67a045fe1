/* Rectification: hand-worked arrays, the disparity law on random points, the map against the exact chain. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "pipeline/lightfield/rectify/rectify.h"
#include "pipeline/lightfield/rectify/rectify_internal.h"
#include "simulators/scene/noise.h"
#include "tests/camera_project.h"
#include "tests/test.h"

#define F     1000.0
#define PITCH 50.0

static uint64_t seed = 7;

/* A perfect array: pitch 50 mm across and down, all axes parallel, camera "rr_cc". */
static struct sst_calib perfect(int rows, int cols)
{
    struct sst_calib calib;

    assert_int_equal(sst_calib_init(&calib, rows, cols), 0);
    calib.width = 640;
    calib.height = 480;
    for (int k = 0; k < rows * cols; k++) {
        struct sst_calib_camera *cam = &calib.camera[k];

        cam->known = true;
        snprintf(cam->name, sizeof(cam->name), "%02d_%02d", (k / cols) % 100, (k % cols) % 100);
        cam->fx = cam->fy = F;
        cam->cx = 319.5;
        cam->cy = 239.5;
        cam->position_mm[0] = PITCH * (k % cols - calib.reference % cols);
        cam->position_mm[1] = PITCH * (k / cols - calib.reference / cols);
    }
    return calib;
}

static void multiply(double out[9], const double a[9], const double b[9])
{
    double m[9];

    for (int i = 0; i < 9; i++)
        m[i] = a[i / 3 * 3] * b[i % 3] + a[i / 3 * 3 + 1] * b[3 + i % 3] + a[i / 3 * 3 + 2] * b[6 + i % 3];
    memcpy(out, m, sizeof(m));
}

/* Centres or cameras turned by a rotation vector: X' = R X for centres; cameras keep looking at what they looked at. */
static void turn_rig(struct sst_calib *calib, const double v[3], bool cameras_too)
{
    double m[9], back[9], minus[3] = { -v[0], -v[1], -v[2] };

    sst_rotation_from_vector(v, m);
    sst_rotation_from_vector(minus, back);
    for (int k = 0; k < calib->rows * calib->cols; k++) {
        struct sst_calib_camera *cam = &calib->camera[k];
        const double p[3] = { cam->position_mm[0], cam->position_mm[1], cam->position_mm[2] };

        for (int i = 0; i < 3; i++)
            cam->position_mm[i] = m[3 * i] * p[0] + m[3 * i + 1] * p[1] + m[3 * i + 2] * p[2];
        if (cameras_too)
            multiply(cam->rotation, cam->rotation, back);
    }
}

static struct sst_rectified plan(const struct sst_calib *calib)
{
    const struct sst_rectify_config cfg = { .plane_mm = 0 };
    struct sst_rectified to;

    assert_int_equal(sst_rectify_plan(&to, calib, &cfg), 0);
    return to;
}

/* Refused with these words. */
static void refuses(const struct sst_calib *calib, const struct sst_rectify_config *cfg, int want, const char *words)
{
    const struct sst_rectify_config plain = { .plane_mm = 0 };
    struct sst_rectified to = { .rows = 77 };
    char text[SST_LOG_MAX] = "", *before = sst_log_hold_errors(text);
    const int err = sst_rectify_plan(&to, calib, cfg ? cfg : &plain);

    sst_log_hold_errors(before);
    assert_int_equal(err, want);
    assert_contains(text, words);
    assert_int_equal(to.rows, 77);
}

#define NEAR(a, b, eps) assert_true(fabs((a) - (b)) <= (eps))

static void perfect_lattice(void **state SST_UNUSED)
{
    struct sst_calib calib = perfect(3, 4);
    const struct sst_rectified to = plan(&calib);

    assert_int_equal(to.reference, 5);
    for (int i = 0; i < 9; i++)
        NEAR(to.rotation[i], i % 4 == 0, 1e-12);
    NEAR(to.spacing_mm, 50, 1e-12);
    NEAR(to.step_mm[0], 50, 1e-12);
    NEAR(to.step_mm[1], 50, 1e-12);
    NEAR(to.skew_deg, 0, 1e-12);
    NEAR(to.out_max_mm, 0, 1e-12);
    NEAR(to.lattice_max_mm, 0, 1e-12);
    NEAR(to.focal_px, 1000, 1e-9);
    NEAR(to.cx, 319.5, 1e-9);
    NEAR(to.cy, 239.5, 1e-9);
    for (int k = 0; k < 12; k++) {
        assert_true(to.view[k].known);
        NEAR(to.view[k].bx, k % 4 - 1, 1e-12);
        NEAR(to.view[k].by, k / 4 - 1, 1e-12);
        NEAR(to.view[k].dz_mm, 0, 1e-12);
        assert_true(to.view[k].scale == 1);
    }
    sst_calib_fini(&calib);
}

/* The whole rig turned, its axes no longer the reference camera's: everything relative stays. Then the plane tilted
 * 10 degrees about x against the cameras: rectified axes follow the plane, the principal point follows the cameras
 * (1000 tan 10 deg = 176.327 px). */
static void rotated_and_tilted(void **state SST_UNUSED)
{
    const double any[3] = { 0.3, -0.5, 1.1 }, tilt[3] = { 10 * M_PI / 180, 0, 0 };
    struct sst_calib calib = perfect(3, 3);
    struct sst_rectified to;

    turn_rig(&calib, any, true);
    to = plan(&calib);
    for (int k = 0; k < 9; k++) {
        NEAR(to.view[k].bx, k % 3 - 1, 1e-12);
        NEAR(to.view[k].by, k / 3 - 1, 1e-12);
    }
    NEAR(to.cx, 319.5, 1e-9);
    for (int i = 0; i < 9; i++)
        NEAR(to.rotation[i], calib.camera[0].rotation[i], 1e-12);
    sst_calib_fini(&calib);
    calib = perfect(3, 3);
    turn_rig(&calib, tilt, false);
    to = plan(&calib);
    NEAR(to.out_max_mm, 0, 1e-12);
    NEAR(to.rotation[8], cos(10 * M_PI / 180), 1e-12);
    NEAR(to.view[0].by, -1, 1e-12);
    /* y of the lattice leans to z = sin 10; the cameras' axis is at y / z = +tan 10 in its axes. */
    NEAR(to.cy, 239.5 - 176.32698, 1e-4);
    NEAR(to.cx, 319.5, 1e-9);
    sst_calib_fini(&calib);
}

/* 3x3, the middle camera 1 mm to the right. Least squares: it moves the mean by 1/9 and no step, so its residual is
 * 8/9, the others' -1/9: RMS sqrt((64 + 8) / 81 / 9). Then 3 mm in front instead: the plane's mean by the same sum. */
static void one_camera_off(void **state SST_UNUSED)
{
    struct sst_calib calib = perfect(3, 3);
    const struct sst_rectify_config cfg = { .plane_mm = 3000, .width = 600, .height = 400, .focal_px = 900 };
    struct sst_rectified to;

    calib.camera[4].position_mm[0] = 1;
    to = plan(&calib);
    NEAR(to.lattice_max_mm, 8 / 9.0, 1e-12);
    NEAR(to.lattice_rms_mm, sqrt(72 / 81.0 / 9), 1e-12);
    NEAR(to.out_max_mm, 0, 1e-12);
    NEAR(to.view[0].bx, -51 / 50.0, 1e-12); /* from the reference, which is the one that is off */
    calib.camera[4].position_mm[0] = 0;
    calib.camera[4].position_mm[2] = 3;
    assert_int_equal(sst_rectify_plan(&to, &calib, &cfg), 0);
    NEAR(to.lattice_max_mm, 0, 1e-12);
    NEAR(to.out_max_mm, 24 / 9.0, 1e-12);
    NEAR(to.out_rms_mm, 3 * sqrt(72 / 81.0 / 9), 1e-12);
    NEAR(to.view[0].dz_mm, -3, 1e-12);
    NEAR(to.view[0].scale, 1.001, 1e-12);
    NEAR(to.view[4].scale, 1, 0);
    NEAR(to.focal_px, 900, 0);
    NEAR(to.cx, 299.5, 1e-9);
    assert_int_equal(to.height, 400);
    sst_calib_fini(&calib);
}

/* Steps 40 and 60 mm, rows leaning by 2 degrees; two holes, the middle among them, leave the fit as it is. */
static void unequal_steps_and_holes(void **state SST_UNUSED)
{
    struct sst_calib calib = perfect(3, 3);
    const double lean = 2 * M_PI / 180;
    struct sst_rectified to;

    for (int k = 0; k < 9; k++) {
        calib.camera[k].position_mm[0] = 40.0 * (k % 3) - 60 * sin(lean) * (k / 3);
        calib.camera[k].position_mm[1] = 60 * cos(lean) * (k / 3);
    }
    calib.camera[4].known = calib.camera[2].known = false;
    calib.reference = 1;
    to = plan(&calib);
    NEAR(to.step_mm[0], 40, 1e-10);
    NEAR(to.step_mm[1], 60, 1e-10);
    NEAR(to.spacing_mm, 50, 1e-10);
    NEAR(to.skew_deg, 2, 1e-10);
    NEAR(to.lattice_max_mm, 0, 1e-10);
    NEAR(to.view[0].bx, -0.8, 1e-10);
    assert_false(to.view[4].known);
    sst_calib_fini(&calib);
}

/* A single row or column: the missing direction is the cameras' own. */
static void rows_and_columns(void **state SST_UNUSED)
{
    for (int down = 0; down < 2; down++) {
        for (int n = 2; n < 5; n++) {
            struct sst_calib calib = perfect(down ? n : 1, down ? 1 : n);
            const double lean[3] = { 0, 0, 0.05 };
            struct sst_rectified to;

            turn_rig(&calib, lean, false);
            to = plan(&calib);
            NEAR(to.spacing_mm, 50, 1e-10);
            NEAR(to.step_mm[!down], 0, 0);
            NEAR(to.rotation[8], 1, 1e-12);
            NEAR(to.rotation[1], sin(0.05), 1e-12);
            for (int k = 0; k < n; k++) {
                NEAR(to.view[k].bx, down ? 0 : k - calib.reference, 1e-12);
                NEAR(to.view[k].by, down ? k - calib.reference : 0, 1e-12);
            }
            sst_calib_fini(&calib);
        }
    }
}

static void swap_cameras(struct sst_calib *calib, int a, int b)
{
    double p[3];

    memcpy(p, calib->camera[a].position_mm, sizeof(p));
    memcpy(calib->camera[a].position_mm, calib->camera[b].position_mm, sizeof(p));
    memcpy(calib->camera[b].position_mm, p, sizeof(p));
}

static void swapped_cameras_are_named(void **state SST_UNUSED)
{
    static const int grids[][4] = { { 6, 6, 8, 9 }, { 6, 6, 0, 35 }, { 2, 3, 0, 1 },  { 2, 2, 0, 1 },
                                    { 3, 3, 1, 3 }, { 1, 4, 1, 2 },  { 16, 16, 0, 1 } };

    for (size_t i = 0; i < ARRAY_LEN(grids); i++) {
        struct sst_calib calib = perfect(grids[i][0], grids[i][1]);
        const int a = grids[i][2], b = grids[i][3], cols = grids[i][1];
        char words[160];

        swap_cameras(&calib, a, b);
        for (int k = 0; k < calib.rows * calib.cols; k++) { /* mounting errors must not hide it */
            for (int j = 0; j < 3; j++)
                calib.camera[k].position_mm[j] += sst_random_in(&seed, -1, 1);
        }
        snprintf(words, sizeof(words),
                 "cameras %02d_%02d (row %d, column %d) and %02d_%02d (row %d, column %d) are swapped", a / cols,
                 a % cols, a / cols, a % cols, b / cols, b % cols, b / cols, b % cols);
        refuses(&calib, NULL, -EBADMSG, words);
        sst_calib_fini(&calib);
    }
}

static void mirrored_grids(void **state SST_UNUSED)
{
    for (int axis = 0; axis < 2; axis++) {
        const char *words = axis ? "rows run from the bottom up" : "columns run from right to left";
        struct sst_calib calib = perfect(3, 3);

        for (int k = 0; k < 9; k++)
            calib.camera[k].position_mm[axis] *= -1;
        refuses(&calib, NULL, -EBADMSG, words);
        sst_calib_fini(&calib);
        calib = perfect(axis ? 3 : 1, axis ? 1 : 3);
        for (int k = 0; k < 3; k++)
            calib.camera[k].position_mm[axis] *= -1;
        refuses(&calib, NULL, -EBADMSG, words);
        sst_calib_fini(&calib);
    }
    struct sst_calib calib = perfect(3, 3);

    for (int k = 0; k < 9; k++) {
        const double x = calib.camera[k].position_mm[0];

        calib.camera[k].position_mm[0] = calib.camera[k].position_mm[1];
        calib.camera[k].position_mm[1] = x;
    }
    refuses(&calib, NULL, -EBADMSG, "rows and columns are exchanged");
    for (int k = 0; k < 9; k++) { /* hanging upside down is fine */
        calib.camera[k].position_mm[0] = -PITCH * (k % 3 - 1);
        calib.camera[k].position_mm[1] = -PITCH * (k / 3 - 1);
    }
    NEAR(plan(&calib).rotation[0], -1, 1e-12);
    sst_calib_fini(&calib);
}

static void what_is_no_array(void **state SST_UNUSED)
{
    struct sst_calib calib = perfect(1, 1);

    refuses(&calib, NULL, -EBADMSG, "only one camera");
    sst_calib_fini(&calib);
    calib = perfect(2, 2);
    calib.camera[1].known = calib.camera[2].known = false;
    refuses(&calib, NULL, -EBADMSG, "one diagonal");
    sst_calib_fini(&calib);
    calib = perfect(2, 3);
    for (int k = 0; k < 6; k++) {
        calib.camera[k].position_mm[0] = 50.0 * k;
        calib.camera[k].position_mm[1] = 0;
    }
    refuses(&calib, NULL, -EBADMSG, "on one line");
    for (int k = 0; k < 6; k++)
        calib.camera[k].position_mm[0] = 0;
    refuses(&calib, NULL, -EBADMSG, "not form a regular grid");
    sst_calib_fini(&calib);
    calib = perfect(6, 6);
    calib.camera[20].position_mm[1] += 40;
    refuses(&calib, NULL, -EBADMSG, "camera 03_02 (row 3, column 2) is");
    calib.camera[20].position_mm[1] = (double)NAN;
    refuses(&calib, NULL, -EBADMSG, "not finite");
    calib.camera[20].known = false; /* then it does not matter */
    NEAR(plan(&calib).spacing_mm, 50, 1e-10);
    const double away[3] = { 0, 70 * M_PI / 180, 0 }, most[3] = { 0, 50 * M_PI / 180, 0 };

    sst_rotation_from_vector(away, calib.camera[3].rotation);
    refuses(&calib, NULL, -EBADMSG, "camera 00_03 (row 0, column 3) points 70 degrees away");
    for (int k = 0; k < 36; k++)
        sst_rotation_from_vector(most, calib.camera[k].rotation);
    refuses(&calib, NULL, -EBADMSG, "point 50 degrees away");
    sst_calib_fini(&calib);
}

static void bad_settings(void **state SST_UNUSED)
{
    const struct sst_rectify_config bad[] = { { .plane_mm = (double)NAN },
                                              { .focal_px = -1 },
                                              { .width = 100 },
                                              { .width = -1, .height = -1 },
                                              { .focal_px = (double)INFINITY } };
    const struct sst_rectify_config near_plane = { .plane_mm = 8 };
    struct sst_calib calib = perfect(3, 3);

    for (size_t i = 0; i < ARRAY_LEN(bad); i++)
        refuses(&calib, &bad[i], -EINVAL, "correct these");
    calib.camera[0].position_mm[2] = 10;
    refuses(&calib, &near_plane, -EINVAL, "too close to camera 00_00");
    calib.range_mm = 2000;
    struct sst_rectified to;
    assert_int_equal(sst_rectify_plan(&to, &calib, &(struct sst_rectify_config){ .plane_mm = -1 }), 0);
    NEAR(to.plane_mm, 2000, 0);
    sst_calib_fini(&calib);
}

/* An array as it is: cameras turned, lenses bent, centres in their plane, or 2 mm off it. */
static struct sst_calib real_array(int lens, double dz_mm)
{
    const double any[3] = { 0.2, 0.1, -0.3 };
    struct sst_calib calib = perfect(3, 3);

    for (int k = 0; k < 9; k++) {
        struct sst_calib_camera *cam = &calib.camera[k];
        const double v[3] = { sst_random_in(&seed, -0.02, 0.02), sst_random_in(&seed, -0.02, 0.02),
                              sst_random_in(&seed, -0.02, 0.02) };
        const double k5[5] = { -0.25, 0.12, 8e-4, -5e-4, -0.02 },
                     k8[8] = { 0.3, -0.2, 4e-4, 6e-4, 0.05, 0.5, -0.1, 0.1 };

        sst_rotation_from_vector(v, cam->rotation);
        cam->fx = sst_random_in(&seed, 590, 610); /* wide: 56 degrees, where lenses bend */
        cam->fy = sst_random_in(&seed, 590, 610);
        cam->cx = sst_random_in(&seed, 310, 330);
        cam->cy = sst_random_in(&seed, 230, 250);
        cam->lens = lens;
        memcpy(cam->k, lens == 8 ? k8 : k5, (size_t)lens * sizeof(double));
        cam->position_mm[0] += sst_random_in(&seed, -2, 2);
        cam->position_mm[1] += sst_random_in(&seed, -2, 2);
        cam->position_mm[2] += sst_random_in(&seed, -dz_mm, dz_mm);
    }
    turn_rig(&calib, any, true);
    return calib;
}

/* Where view k shows point P of rectified axes (from the reference's centre), by undoing the lens and the common
 * homography: the inverse of the chain, written the other way round. */
static void rectified_place(const struct sst_rectified *to, const struct sst_calib *calib, int k, const double P[3],
                            double out[2])
{
    const struct sst_calib_camera *cam = &calib->camera[k];
    const double *ref = calib->camera[to->reference].position_mm;
    double X[3], x, y, ray[3] = { 0, 0, 1 }, rig[3], d[3];

    for (int i = 0; i < 3; i++)
        X[i] = ref[i] + to->rotation[i] * P[0] + to->rotation[3 + i] * P[1] + to->rotation[6 + i] * P[2];
    assert_true(camera_project(cam, X, &x, &y));
    assert_true(sst_camera_undistort(cam, x, y, &ray[0], &ray[1]));
    for (int i = 0; i < 3; i++)
        rig[i] = cam->rotation[i] * ray[0] + cam->rotation[3 + i] * ray[1] + cam->rotation[6 + i];
    for (int i = 0; i < 3; i++)
        d[i] = to->rotation[3 * i] * rig[0] + to->rotation[3 * i + 1] * rig[1] + to->rotation[3 * i + 2] * rig[2];
    out[0] = to->focal_px * to->view[k].scale * d[0] / d[2] + to->cx;
    out[1] = to->focal_px * to->view[k].scale * d[1] / d[2] + to->cy;
    if (x > 0 && y > 0 && x < calib->width - 1 && y < calib->height - 1) { /* and the chain leads back */
        double raw[2];

        assert_true(sst_rectify_point(to, calib, k, out, raw));
        NEAR(raw[0], x, 1e-8);
        NEAR(raw[1], y, 1e-8);
    }
}

static void disparity_law(void **state SST_UNUSED)
{
    for (int round = 0; round < 4; round++) {
        const double plane = 1500;
        struct sst_calib calib = real_array(round % 2 ? 8 : 5, round < 2 ? 0 : 2);
        struct sst_rectified to;

        assert_int_equal(sst_rectify_plan(&to, &calib, &(struct sst_rectify_config){ .plane_mm = plane }), 0);
        if (round < 2)
            NEAR(to.out_max_mm, 0, 1e-10);
        for (int i = 0; i < 300; i++) {
            const double Z = round < 2 ? sst_random_in(&seed, 700, 20000) : plane;
            const double P[3] = { sst_random_in(&seed, -0.3, 0.3) * Z, sst_random_in(&seed, -0.25, 0.25) * Z, Z };
            const double d = to.focal_px * to.spacing_mm / Z;
            double ref[2], at[2];

            rectified_place(&to, &calib, to.reference, P, ref);
            for (int k = 0; k < 9; k++) {
                rectified_place(&to, &calib, k, P, at);
                NEAR(at[0], ref[0] - d * to.view[k].bx, 1e-9);
                NEAR(at[1], ref[1] - d * to.view[k].by, 1e-9);
            }
        }
        sst_calib_fini(&calib);
    }
}

/* Every pixel of every view against the chain; fractional rows as rays from raw frames ask for them. */
static double map_error(const struct sst_rectified *to, const struct sst_calib *calib, int view, double dx, double dy,
                        long *places)
{
    struct sst_rectify_map *map;
    int32_t *row = malloc(2 * sizeof(*row) * (size_t)to->width);
    double worst = 0;

    assert_non_null(row);
    assert_int_equal(sst_rectify_map_create(&map, to, calib, view), 0);
    for (int y = 0; y + dy <= to->height - 1; y++) {
        sst_rectify_map_row(map, dx, y + dy, to->width - 1, row);
        for (int x = 0; x < to->width - 1; x++) {
            double raw[2];
            const bool in = sst_rectify_point(to, calib, view, (const double[2]){ x + dx, y + dy }, raw);
            const bool got = row[2 * x] != INT32_MIN;

            if (in != got) { /* on the border only */
                if (in)
                    assert_true(raw[0] < 0.01 || raw[1] < 0.01 || raw[0] > calib->width - 1.01 ||
                                raw[1] > calib->height - 1.01);
                continue;
            }
            *places += in;
            if (in)
                worst = fmax(worst, hypot(row[2 * x] / 256.0 - raw[0], row[2 * x + 1] / 256.0 - raw[1]));
        }
    }
    sst_rectify_map_destroy(map);
    free(row);
    return worst;
}

static void map_is_within_its_bound(void **state SST_UNUSED)
{
    for (int lens = 5; lens <= 8; lens += 3) {
        struct sst_calib calib = real_array(lens, 2);
        struct sst_rectified to;
        long places = 0;
        double worst = 0;

        assert_int_equal(sst_rectify_plan(&to, &calib, &(struct sst_rectify_config){ .plane_mm = 1500 }), 0);
        for (int view = 0; view < 9; view += 4)
            worst = fmax(worst, map_error(&to, &calib, view, view == 4 ? 0.37 : 0, view == 4 ? 0.61 : 0, &places));
        print_message("lens %d: %ld places, worst error 1/%.0f px\n", lens, places, 1 / worst);
        assert_true(worst <= 1 / 256.0);
        assert_true(places > 640 * 480 * 2);
        sst_calib_fini(&calib);
    }
}

/* A lens that folds over within the rectified picture: places beyond the fold would be seen again, inside. With
 * k1 = -0.5 x = a (1 - a^2 / 2) turns back at a = sqrt(2 / 3) = 0.816, where x = 0.544; at a = 1.2 it is at 0.336. */
static void fold_is_not_seen_twice(void **state SST_UNUSED)
{
    struct sst_calib calib = perfect(1, 2);
    const struct sst_rectify_config cfg = { .width = 1500, .height = 400, .focal_px = 500 };
    struct sst_rectified to;
    long places = 0;
    double raw[2], worst;

    calib.camera[0].fx = calib.camera[0].fy = calib.camera[1].fx = calib.camera[1].fy = 700;
    calib.camera[0].lens = calib.camera[1].lens = 5;
    calib.camera[0].k[0] = calib.camera[1].k[0] = -0.5;
    assert_int_equal(sst_rectify_plan(&to, &calib, &cfg), 0);
    assert_true(sst_rectify_point(&to, &calib, 0, (const double[2]){ 749.5 + 500 * 0.4, 199.5 }, raw));
    NEAR(raw[0], 319.5 + 700 * 0.4 * (1 - 0.08), 1e-9);
    assert_false(sst_rectify_point(&to, &calib, 0, (const double[2]){ 749.5 + 500 * 1.2, 199.5 }, raw));
    worst = map_error(&to, &calib, 0, 0, 0, &places);
    assert_true(worst <= 1 / 256.0 && places > 100000);
    sst_calib_fini(&calib);
}

/* No lens, no turn: the map is the identity, to the last border pixel. */
static void identity_keeps_every_pixel(void **state SST_UNUSED)
{
    struct sst_calib calib = perfect(2, 2);
    const struct sst_rectified to = plan(&calib);
    struct sst_rectify_map *map;
    int32_t row[2 * 640];

    assert_int_equal(sst_rectify_map_create(&map, &to, &calib, 3), 0);
    for (int y = 0; y < 480; y++) {
        sst_rectify_map_row(map, 0, y, 640, row);
        for (int x = 0; x < 640; x++)
            assert_true(row[2 * x] == 256 * x && row[2 * x + 1] == 256 * y);
    }
    sst_rectify_map_destroy(map);
    assert_int_equal(sst_rectify_map_create(&map, &to, &calib, 4), -EINVAL);
    calib.camera[3].known = false;
    assert_int_equal(sst_rectify_map_create(&map, &to, &calib, 3), -EINVAL);
    sst_calib_fini(&calib);
}

/* --- frames put in part by part ----------------------------------------------------------------------------------- */

static void fill_random(struct sst_image *img)
{
    for (int c = 0; c < 3; c++)
        for (int y = 0; y < img->height; y++)
            for (int x = 0; x < img->width; x++)
                sst_image_row(img, c, y)[x] = (uint8_t)sst_random_in(&seed, 0, 256);
}

static void put(struct sst_sampler *s, const struct sst_image *raw, int x0, int y0, int x1, int y1)
{
    uint8_t *rgbx = malloc(4 * (size_t)(x1 - x0) * (size_t)(y1 - y0));

    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++)
            for (int c = 0; c < 4; c++)
                rgbx[4 * ((size_t)(y - y0) * (size_t)(x1 - x0) + (size_t)(x - x0)) + (size_t)c] =
                    c < 3 ? sst_image_row(raw, c, y)[x] : 255;
    sst_sampler_put(s, &(struct sst_rect){ x0, y0, x1, y1 }, rgbx, 4 * (size_t)(x1 - x0));
    free(rgbx);
}

/* All samples of a view. */
static void sample_all(const struct sst_sampler *s, struct sst_image *out)
{
    for (int y = 0; y < out->height; y++) {
        for (int x = 0; x < out->width; x += SST_SAMPLE_MAX) {
            uint8_t *const row[3] = { sst_image_row(out, 0, y) + x, sst_image_row(out, 1, y) + x,
                                      sst_image_row(out, 2, y) + x };

            sst_sampler_row(s, &(struct sst_rectified_row){ x, y, sst_min_int(SST_SAMPLE_MAX, out->width - x) }, row, NULL);
        }
    }
}

static void frames_in_parts_are_whole_frames(void **state)
{
    struct sst_calib calib = perfect(1, 2);
    struct sst_rectified to;
    struct sst_rectify_map *map;
    struct sst_image raw, want, got;

    (void)state;
    calib.camera[1].lens = 5;
    calib.camera[1].k[0] = 0.3; /* its picture ends inside the common one: taps repeat the border */
    sst_rotation_from_vector((const double[3]){ 0.01, -0.02, 0.05 }, calib.camera[1].rotation);
    to = plan(&calib);
    assert_int_equal(sst_rectify_map_create(&map, &to, &calib, 1), 0);
    assert_int_equal(sst_image_init(&raw, 640, 480), 0);
    assert_int_equal(sst_image_init(&want, to.width, to.height), 0);
    assert_int_equal(sst_image_init(&got, to.width, to.height), 0);
    for (int filter = SST_FILTER_BILINEAR; filter <= SST_FILTER_LANCZOS; filter++) {
        struct sst_sampler *parts;

        fill_random(&raw);
        assert_int_equal(sst_rectify_view(&(struct sst_rectified_view){ &want, NULL }, map, (enum sst_filter)filter, &raw), 0);
        assert_int_equal(sst_sampler_create_empty(&parts, map, (enum sst_filter)filter), 0);
        for (int y = 0; y < 480; y += 97)
            for (int x = 0; x < 640; x += 128)
                put(parts, &raw, x, y, sst_min_int(x + 128, 640), sst_min_int(y + 97, 480));
        sample_all(parts, &got);
        for (int c = 0; c < 3; c++)
            assert_memory_equal(want.plane[c], got.plane[c], want.stride * (size_t)want.height);
        sst_sampler_destroy(parts);
    }
    sst_image_fini(&got);
    sst_image_fini(&want);
    sst_image_fini(&raw);
    sst_rectify_map_destroy(map);
    sst_calib_fini(&calib);
}

/* A part of the view depends on its box alone: all else may change. */
static void boxes_hold_what_is_seen(void **state)
{
    struct sst_calib calib = perfect(1, 2);
    struct sst_rectified to;
    struct sst_rectify_map *map;
    struct sst_image one, other, a, b;

    (void)state;
    calib.camera[1].lens = 5;
    calib.camera[1].k[0] = 0.3;
    sst_rotation_from_vector((const double[3]){ 0.01, -0.02, 0.05 }, calib.camera[1].rotation);
    to = plan(&calib);
    assert_int_equal(sst_rectify_map_create(&map, &to, &calib, 1), 0);
    assert_int_equal(sst_image_init(&one, 640, 480), 0);
    assert_int_equal(sst_image_init(&other, 640, 480), 0);
    assert_int_equal(sst_image_init(&a, to.width, to.height), 0);
    assert_int_equal(sst_image_init(&b, to.width, to.height), 0);
    fill_random(&one);
    for (int i = 0; i < 8; i++) {
        const int x = i == 0 ? 0 : i == 1 ? to.width - 32 : (int)sst_random_in(&seed, 0, to.width - 32);
        const int y = i == 0 ? 0 : i == 1 ? to.height - 32 : (int)sst_random_in(&seed, 0, to.height - 32);
        const enum sst_filter filter = (enum sst_filter)(i % 3);
        int box[4];

        fill_random(&other);
        (void)sst_rectify_map_box(map, filter, &(struct sst_rect){ x, y, x + 32, y + 32 }, box, NULL);
        assert_true(box[0] >= 0 && box[1] >= 0 && box[2] <= 640 && box[3] <= 480);
        assert_true((box[2] - box[0]) * (box[3] - box[1]) < 60 * 60);
        for (int c = 0; c < 3; c++)
            for (int v = box[1]; v < box[3]; v++)
                memcpy(sst_image_row(&other, c, v) + box[0], sst_image_row(&one, c, v) + box[0],
                       (size_t)(box[2] - box[0]));
        assert_int_equal(sst_rectify_view(&(struct sst_rectified_view){ &a, NULL }, map, filter, &one), 0);
        assert_int_equal(sst_rectify_view(&(struct sst_rectified_view){ &b, NULL }, map, filter, &other), 0);
        for (int c = 0; c < 3; c++)
            for (int v = y; v < y + 32; v++)
                assert_memory_equal(sst_image_row(&a, c, v) + x, sst_image_row(&b, c, v) + x, 32);
    }
    sst_image_fini(&one);
    sst_image_fini(&other);
    sst_image_fini(&a);
    sst_image_fini(&b);
    sst_rectify_map_destroy(map);
    sst_calib_fini(&calib);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(perfect_lattice),
        cmocka_unit_test(rotated_and_tilted),
        cmocka_unit_test(one_camera_off),
        cmocka_unit_test(unequal_steps_and_holes),
        cmocka_unit_test(rows_and_columns),
        cmocka_unit_test(swapped_cameras_are_named),
        cmocka_unit_test(mirrored_grids),
        cmocka_unit_test(what_is_no_array),
        cmocka_unit_test(bad_settings),
        cmocka_unit_test(disparity_law),
        cmocka_unit_test(map_is_within_its_bound),
        cmocka_unit_test(fold_is_not_seen_twice),
        cmocka_unit_test(identity_keeps_every_pixel),
        cmocka_unit_test(frames_in_parts_are_whole_frames),
        cmocka_unit_test(boxes_hold_what_is_seen),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
