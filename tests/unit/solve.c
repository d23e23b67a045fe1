/* Solutions of made-up arrays against their truth. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/calibration/solve/solve.h"
#include "tests/calib_truth.h"
#include "tests/camera_project.h"
#include "tests/small.h"
#include "tests/test.h"

#define assert_near(a, b, within) assert_true(fabs((double)(a) - (double)(b)) <= (within))

/* Largest distance (px) between the projections of points by solved and true cameras, both relative to the reference
 * camera. */
static double worst_px(const struct truth *t, const struct sst_solution *s)
{
    double worst = 0;

    for (int v = 0; v < t->cfg.rows * t->cfg.cols; v++) {
        if (!s->calib.camera[v].known)
            continue;
        for (int i = 0; i < 100; i++) {
            const double z = i % 2 ? 1200 : 2500, x = t->cfg.width * (0.15 + 0.7 * (i / 10) / 9.0);
            const double y = t->cfg.height * (0.15 + 0.7 * (i % 10) / 9.0);
            double a, b, X[3], seen[2][2];

            /* the same reference pixel in both worlds */
            for (int k = 0; k < 2; k++) {
                const struct sst_calib *c = k ? &s->calib : &t->calib;

                assert_true(sst_camera_undistort(&c->camera[t->calib.reference], x, y, &a, &b));
                X[0] = a * z, X[1] = b * z, X[2] = z;
                assert_true(camera_project(&c->camera[v], X, &seen[k][0], &seen[k][1]));
            }
            worst = fmax(worst, hypot(seen[0][0] - seen[1][0], seen[0][1] - seen[1][1]));
        }
    }
    return worst;
}

static void solve(struct sst_solution *s, const struct truth *t, const struct sst_solve_config *cfg)
{
    assert_int_equal(sst_solve(s, &t->all, cfg), 0);
    assert_null(sst_calib_fault(&s->calib));
    assert_int_equal(s->calib.reference, t->calib.reference);
}

static void exact_corners_give_exact_cameras(void **state)
{
    struct truth_config cfg = truth_small();
    const struct sst_solve_config how = { .lens = 5, .threads = 2 };
    struct truth t;
    struct sst_solution s;

    (void)state;
    cfg.noise_px = 0;
    truth_make(&t, &cfg);
    solve(&s, &t, &how);
    assert_true(s.rms_px < 1e-6);
    assert_int_equal(s.outliers, 0);
    assert_true(worst_px(&t, &s) < 1e-4);
    for (int f = 0; f < cfg.frames; f++) {
        for (int i = 0; i < 3; i++)
            assert_near(s.frame[f].position_mm[i], t.frame[f].position_mm[i], 1e-2);
    }
    sst_solution_fini(&s);
    truth_free(&t);
}

/* The RMS matches the noise and the number of states, and noise and warp match the truth. */
static void residuals_are_as_predicted(void **state)
{
    struct truth_config cfg = truth_defaults();
    const struct sst_solve_config how = { .lens = 5, .threads = 2 };
    struct truth t;
    struct sst_solution s;
    double expected;

    (void)state;
    cfg.rows = 2, cfg.cols = 3, cfg.frames = 30;
    cfg.warp_mm[0] = 0.8, cfg.warp_mm[1] = -0.4;
    cfg.seed = 7;
    truth_make(&t, &cfg);
    solve(&s, &t, &how);
    assert_int_equal(s.measurements, 2 * s.corners);
    assert_int_equal(s.states, 6 * 9 + 5 * 6 + 30 * 6 + 2);
    expected = sqrt(2) * 0.1 * sqrt(1 - (double)s.states / s.measurements);
    print_message("RMS %.5f px, expected %.5f px, predicted from its own noise %.5f px\n", s.rms_px, expected,
                  s.predicted_rms_px);
    assert_near(s.rms_px, expected, 0.02 * expected);
    assert_near(s.predicted_rms_px, s.rms_px, 0.02 * expected);
    assert_near(s.noise_px, 0.1, 0.003);
    assert_near(s.warp_mm[0], 0.8, 0.1);
    assert_near(s.warp_mm[1], -0.4, 0.1);
    assert_true(s.outliers <= 4);
    assert_true(worst_px(&t, &s) < 0.06);
    assert_true(s.rcond > 1e-7 && s.rcond < 1);
    assert_true(s.weakest >= 0 && s.link[s.weakest].tree && s.link[s.weakest].a < s.link[s.weakest].b);
    assert_true(s.calib.range_mm > 900 && s.calib.range_mm < 2200);
    for (int v = 0; v < 6; v++) {
        assert_true(v == t.calib.reference ? s.calib.camera[v].sigma_px == 0 : s.calib.camera[v].sigma_px > 0);
        assert_true(s.calib.camera[v].sigma_px < 0.03);
        assert_near(s.calib.camera[v].rms_px, expected, 0.05 * expected);
    }
    sst_solution_fini(&s);
    truth_free(&t);
}

/* Moved corners are found as outliers, and almost no others. */
static void outliers_are_found(void **state)
{
    struct truth_config cfg = truth_small();
    const struct sst_solve_config how = { .lens = 5, .threads = 2 };
    struct truth t;
    struct sst_solution s;
    int missed = 0, wrong = 0;

    (void)state;
    cfg.outliers = 0.025;
    truth_make(&t, &cfg);
    solve(&s, &t, &how);
    for (int i = 0; i < t.all.count; i++) {
        for (int k = 0; k < t.all.detection[i].corners; k++) {
            const double *r = s.view[i].residual[k];

            missed += t.outlier[i][k] && !s.view[i].outlier[k] && hypot(r[0], r[1]) > 1;
            wrong += !t.outlier[i][k] && s.view[i].outlier[k];
        }
    }
    assert_true(s.outliers > 50);
    assert_int_equal(missed, 0);
    assert_true(wrong <= 2);
    assert_true(worst_px(&t, &s) < 0.3);
    assert_near(s.noise_px, 0.1, 0.005);
    sst_solution_fini(&s);
    truth_free(&t);
}

/* Least squares over everything uses everything. */
static void plain_uses_all(void **state)
{
    struct truth_config cfg = truth_small();
    const struct sst_solve_config how = { .lens = 5, .plain = true, .flat = true, .threads = 2 };
    struct truth t;
    struct sst_solution s;

    (void)state;
    cfg.outliers = 0.01;
    cfg.outlier_px = 3;
    truth_make(&t, &cfg);
    solve(&s, &t, &how);
    assert_int_equal(s.outliers, 0);
    assert_near(s.warp_mm[0], 0, 0);
    assert_true(s.rms_px > 0.2); /* sqrt(2 (0.01 + 0.01 * 3)) */
    sst_solution_fini(&s);
    truth_free(&t);
}

/* The same bytes for any number of threads. */
static void threads_do_not_matter(void **state)
{
    struct truth_config cfg = truth_small();
    struct truth t;
    struct sst_solution s[3];

    (void)state;
    cfg.outliers = 0.01;
    truth_make(&t, &cfg);
    for (int k = 0; k < 3; k++) {
        const struct sst_solve_config how = { .lens = 5, .threads = 1 + k, .cross_validate = true };

        solve(&s[k], &t, &how);
    }
    for (int k = 1; k < 3; k++) {
        assert_memory_equal(s[k].calib.camera, s[0].calib.camera, 4 * sizeof(*s[0].calib.camera));
        assert_memory_equal(s[k].frame, s[0].frame, (size_t)cfg.frames * sizeof(*s[0].frame));
        assert_memory_equal(s[k].transfer_sigma, s[0].transfer_sigma, 4 * sizeof(*s[0].transfer_sigma));
        assert_memory_equal(s[k].lens_sigma, s[0].lens_sigma, 4 * sizeof(*s[0].lens_sigma));
        assert_memory_equal(&s[k].cv_px, &s[0].cv_px, sizeof(double));
        assert_memory_equal(&s[k].rcond, &s[0].rcond, sizeof(double));
    }
    for (int k = 0; k < 3; k++)
        sst_solution_fini(&s[k]);
    truth_free(&t);
}

/* Wide lenses that need the denominator get it, others do not. */
static void lens_is_chosen(void **state)
{
    const struct sst_solve_config how = { .threads = 2 };

    (void)state;
    for (int wide = 0; wide < 2; wide++) {
        struct truth_config cfg = truth_small();
        struct truth t;
        struct sst_solution s;

        cfg.frames = 30;
        if (wide) {
            cfg.focal_px = 300;
            cfg.near_mm = 350, cfg.far_mm = 900;
            cfg.lens = 8;
            memcpy(cfg.k, (double[8]){ 0.8, 0.1, 0, 0, 0.02, 1.2, 0.35, 0.05 }, sizeof(cfg.k));
            cfg.k_spread = 0;
        }
        truth_make(&t, &cfg);
        solve(&s, &t, &how);
        print_message("held out: %.4f px with 5, %.4f px with 8 coefficients\n", s.held_out_px[0], s.held_out_px[1]);
        assert_int_equal(s.lens, wide ? 8 : 5);
        assert_int_equal(s.calib.camera[3].lens, wide ? 8 : 5);
        assert_true(s.held_out_px[0] > 0.12 && s.held_out_px[1] > 0.12);
        assert_true(worst_px(&t, &s) < 0.4);
        sst_solution_fini(&s);
        truth_free(&t);
    }
}

/* Given lenses stay; four boards then suffice, and the poses are right. */
static void lenses_can_be_kept(void **state)
{
    struct truth_config cfg = truth_small();
    struct sst_solve_config how = { .threads = 2 };
    struct truth t;
    struct sst_solution s;

    (void)state;
    cfg.frames = 3;
    truth_make(&t, &cfg);
    how.lenses = &t.calib;
    solve(&s, &t, &how);
    for (int v = 0; v < 4; v++) {
        assert_memory_equal(&s.calib.camera[v].fx, &t.calib.camera[v].fx, 4 * sizeof(double));
        assert_memory_equal(s.calib.camera[v].k, t.calib.camera[v].k, sizeof(t.calib.camera[v].k));
        for (int i = 0; i < 3; i++)
            assert_near(s.calib.camera[v].position_mm[i], t.calib.camera[v].position_mm[i], 0.8);
        assert_near(s.lens_sigma[v][5][5], 0, 0);
    }
    sst_solution_fini(&s);
    t.calib.width /= 2; /* lenses of pictures of another size */
    assert_int_equal(sst_solve(&s, &t.all, &how), -EBADMSG);
    truth_free(&t);
}

/* A rig: one lens, and its positions against the drives'. */
static void rig_has_one_lens(void **state)
{
    struct truth_config cfg = truth_small();
    struct sst_solve_config how = { .lens = 5, .threads = 2 };
    struct truth t;
    struct sst_solution s;

    (void)state;
    cfg.rig = true;
    cfg.rows = cfg.cols = 3;
    cfg.frames = 8;
    cfg.drive_sigma_mm = 0.05;
    truth_make(&t, &cfg);
    solve(&s, &t, &how);
    assert_int_equal(s.states, 9 + 8 * 6 + 8 * 6 + 2);
    assert_true(s.calib.rig);
    for (int v = 1; v < 9; v++)
        assert_memory_equal(&s.calib.camera[v].fx, &s.calib.camera[0].fx, 4 * sizeof(double));
    assert_near(s.calib.camera[0].fx, t.calib.camera[0].fx, 2.5);
    assert_near(s.drive_scale, 1, 0.01);
    assert_true(s.drive_rms_mm < 0.5);
    assert_near(s.drive_skew_deg, 0, 0.5);
    assert_non_null(s.drive_residual_mm);
    sst_solution_fini(&s);

    /* few placements, the lens known from elsewhere */
    how.lenses = &t.calib;
    t.all.frames = 1;
    while (t.all.count && t.all.detection[t.all.count - 1].frame > 0)
        sst_detection_fini(&t.all.detection[--t.all.count]);
    solve(&s, &t, &how);
    assert_near(s.drive_scale, 1, 0.02);
    assert_int_equal(s.calib.camera[1].lens, 5);
    sst_solution_fini(&s);
    truth_free(&t);
}

/* Without a camera, and with 60 % of the detections, the rest is as good. */
static void parts_may_be_missing(void **state)
{
    const struct sst_solve_config how = { .lens = 5, .threads = 2 };

    (void)state;
    for (int missing = 0; missing <= 6; missing++) {
        struct truth_config cfg = truth_small();
        struct truth t;
        struct sst_solution s;
        int kept = 0;

        cfg.cols = 3;
        cfg.frames = 30;
        cfg.detections = missing == 6 ? 0.6 : 1;
        truth_make(&t, &cfg);
        for (int i = 0; i < t.all.count; i++) {
            if (t.all.detection[i].view == missing)
                sst_detection_fini(&t.all.detection[i]);
            else
                t.all.detection[kept++] = t.all.detection[i];
        }
        t.all.count = kept;
        if (missing < 6)
            t.all.camera_name[missing][0] = 0;
        assert_int_equal(sst_solve(&s, &t.all, &how), 0);
        assert_null(sst_calib_fault(&s.calib));
        for (int v = 0; v < 6; v++)
            assert_int_equal(s.calib.camera[v].known, v != missing);
        assert_near(s.rms_px, 0.139, 0.004);
        if (missing != t.calib.reference)
            assert_true(worst_px(&t, &s) < 0.5);
        else
            assert_true(s.calib.reference != missing);
        sst_solution_fini(&s);
        truth_free(&t);
    }
}

/* A corner of a tenth of the weight may be ten times as far off. */
static void weights_count(void **state)
{
    struct truth_config cfg = truth_small();
    const struct sst_solve_config how = { .lens = 5, .threads = 2 };
    struct truth t;
    struct sst_solution s;

    (void)state;
    truth_make(&t, &cfg);
    for (int i = 0; i < t.all.count; i++) {
        for (int k = 0; k < t.all.detection[i].corners; k += 3) {
            struct sst_corner *c = &t.all.detection[i].corner[k];

            c->weight = 0.1;
            c->x += test_normal(&t.state);
            c->y += test_normal(&t.state);
        }
    }
    solve(&s, &t, &how);
    assert_true(s.outliers <= 2);
    assert_true(worst_px(&t, &s) < 0.3);
    sst_solution_fini(&s);
    truth_free(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        serial_test(exact_corners_give_exact_cameras),
        serial_test(residuals_are_as_predicted),
        serial_test(outliers_are_found),
        serial_test(plain_uses_all),
        cmocka_unit_test(threads_do_not_matter),
        serial_test(lens_is_chosen),
        serial_test(lenses_can_be_kept),
        serial_test(rig_has_one_lens),
        serial_test(parts_may_be_missing),
        serial_test(weights_count),
    };

    if (!WITH_DOGLEG) {
        print_message("skipped: built without libdogleg\n");
        return 77;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
