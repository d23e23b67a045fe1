/* Photometric calibration from samples with known gains and fall-offs, and from drawn boards; then its correction. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"
#include "pipeline/calibration/photometric/photometric.h"
#include "pipeline/lightfield/rectify/rectify_internal.h"
#include "tests/random.h"
#include "tests/test.h"

#define WIDTH  640
#define HEIGHT 480
#define HALF2  (0.25 * (WIDTH * WIDTH + HEIGHT * HEIGHT))

static uint64_t seed = 1;

/* --- an array with known light ----------------------------------------------------------------------------------- */

/* Gains of a few percent, fall-offs near 1 - 0.3 r2 - 0.05 r2^2 + 0.05 r2^3. */
static struct sst_calib make_array(int rows, int cols)
{
    struct sst_calib calib;
    double sum[3] = { 0 };

    assert_int_equal(sst_calib_init(&calib, rows, cols), 0);
    calib.width = WIDTH;
    calib.height = HEIGHT;
    for (int k = 0; k < rows * cols; k++) {
        struct sst_calib_camera *c = &calib.camera[k];

        c->known = true;
        snprintf(c->name, sizeof(c->name), "cam%d", k);
        c->fx = c->fy = 700;
        c->cx = 320 + 4 * test_normal(&seed);
        c->cy = 240 + 4 * test_normal(&seed);
        for (int i = 0; i < 3; i++) {
            c->rotation[4 * i] = 1;
            c->gain[i] = 0.05 * test_normal(&seed);
            sum[i] += c->gain[i];
        }
        c->falloff[0] = -0.3 + 0.02 * test_normal(&seed);
        c->falloff[1] = -0.05 + 0.002 * test_normal(&seed);
        c->falloff[2] = 0.05;
        c->position_mm[0] = 60 * (k % cols);
        c->position_mm[1] = 60 * (k / cols);
    }
    for (int k = 0; k < rows * cols; k++) {
        for (int i = 0; i < 3; i++)
            calib.camera[k].gain[i] = exp(calib.camera[k].gain[i] - sum[i] / (rows * cols));
    }
    return calib;
}

static double falloff_of(const struct sst_calib_camera *c, double x, double y)
{
    const double r2 = ((x - c->cx) * (x - c->cx) + (y - c->cy) * (y - c->cy)) / HALF2;

    return 1 + r2 * (c->falloff[0] + r2 * (c->falloff[1] + r2 * c->falloff[2]));
}

static void add(struct sst_photometric_samples *all, struct sst_photometric_sample s)
{
    if (all->count == all->capacity) {
        all->capacity = all->capacity ? 2 * all->capacity : 1024;
        all->sample = realloc(all->sample, (size_t)all->capacity * sizeof(*all->sample));
        assert_non_null(all->sample);
    }
    all->sample[all->count++] = s;
}

/* 35 white patches at depth 1 m or so, out to the corners, moved, turned and lit differently in each frame: from one
 * side, dimmer and redder. */
static struct sst_photometric_samples see(const struct sst_calib *truth, int frames, double noise)
{
    struct sst_photometric_samples all = { 0 };

    for (int f = 0; f < frames; f++) {
        const double at[3] = { 700 * sst_random(&seed) - 360, 500 * sst_random(&seed) - 260,
                               900 + 400 * sst_random(&seed) };
        const double slant = sst_random(&seed) - 0.5,
                     side[2] = { 2 * sst_random(&seed) - 1, 2 * sst_random(&seed) - 1 };
        const double level = 0.3 + 0.4 * sst_random(&seed);

        for (int patch = 0; patch < 35; patch++) {
            const double u = (patch % 7 - 3) * 50, v = (patch / 7 - 2) * 50, z = at[2] + slant * u;
            const double lit = level * (1 + 0.4 * (side[0] * u + side[1] * v) / 180); /* to half or so across */

            for (int k = 0; k < truth->rows * truth->cols; k++) {
                const struct sst_calib_camera *c = &truth->camera[k];
                const double x = c->fx * (at[0] + u - c->position_mm[0] + 100) / z + c->cx;
                const double y = c->fy * (at[1] + v - c->position_mm[1] + 80) / z + c->cy;
                struct sst_photometric_sample s = { k, f, patch, (float)x, (float)y, { 0 } };

                if (!c->known || x < 0 || y < 0 || x > WIDTH - 1 || y > HEIGHT - 1)
                    continue;
                for (int i = 0; i < 3; i++)
                    s.linear[i] = (float)(lit * (1 - 0.1 * i) * c->gain[i] * falloff_of(c, s.x, s.y) *
                                          (1 + noise * test_normal(&seed)));
                add(&all, s);
            }
        }
    }
    return all;
}

static void reset(struct sst_calib *out, const struct sst_calib *truth)
{
    assert_int_equal(sst_calib_copy(out, truth), 0);
    for (int k = 0; k < truth->rows * truth->cols; k++) {
        for (int i = 0; i < 3; i++) {
            out->camera[k].gain[i] = 1;
            out->camera[k].falloff[i] = 0;
        }
    }
}

/* Largest relative errors of the gains and, in the corners, of the fall-off. */
static void compare(const struct sst_calib *got, const struct sst_calib *truth, double *gain, double *corner)
{
    *gain = *corner = 0;
    for (int k = 0; k < truth->rows * truth->cols; k++) {
        const struct sst_calib_camera *g = &got->camera[k], *t = &truth->camera[k];

        for (int i = 0; i < 3; i++)
            *gain = fmax(*gain, fabs(g->gain[i] / t->gain[i] - 1));
        for (int i = 0; i < 4; i++) {
            const double x = i & 1 ? WIDTH - 1 : 0, y = i & 2 ? HEIGHT - 1 : 0;

            *corner = fmax(*corner, fabs(falloff_of(g, x, y) / falloff_of(t, x, y) - 1));
        }
    }
}

static void gains_and_falloff_come_back(void **state SST_UNUSED)
{
    struct sst_calib truth = make_array(4, 4), got;
    struct sst_photometric_samples all = see(&truth, 20, 0.002);
    struct sst_photometric_report report;
    double gain, corner;

    reset(&got, &truth);
    assert_int_equal(sst_photometric_solve(&got, &all, &report), 0);
    compare(&got, &truth, &gain, &corner);
    print_message("%d samples: gains to %.3f %%, corners to %.3f %%, spread %.2f %% before, %.2f %% after\n",
                  report.samples, 100 * gain, 100 * corner, 100 * report.before, 100 * report.after);
    assert_true(gain < 0.002);
    assert_true(corner < 0.01);
    assert_int_equal(report.cameras, 16);
    assert_true(report.before > 0.03 && report.after < 0.0025);
    assert_true(report.worst_falloff > 0.28 && report.worst_falloff < 0.4);
    assert_null(sst_calib_fault(&got));
    sst_photometric_samples_fini(&all);
    sst_calib_fini(&truth);
    sst_calib_fini(&got);
}

/* A hand before the board in some pictures: 5 % of the samples are dimmed to any degree. */
static void wrong_samples_do_not_matter(void **state SST_UNUSED)
{
    struct sst_calib truth = make_array(3, 3), got;
    struct sst_photometric_samples all = see(&truth, 20, 0.003);
    struct sst_photometric_report report;
    double gain, corner;

    for (int i = 0; i < all.count; i++) {
        const double dim = sst_random(&seed) < 0.05 ? 0.2 + 0.7 * sst_random(&seed) : 1;

        for (int c = 0; c < 3; c++)
            all.sample[i].linear[c] *= (float)dim;
    }
    reset(&got, &truth);
    assert_int_equal(sst_photometric_solve(&got, &all, &report), 0);
    compare(&got, &truth, &gain, &corner);
    print_message("5 %% wrong: gains to %.3f %%, corners to %.3f %%\n", 100 * gain, 100 * corner);
    assert_true(gain < 0.005);
    assert_true(corner < 0.015);
    sst_photometric_samples_fini(&all);
    sst_calib_fini(&truth);
    sst_calib_fini(&got);
}

static void order_of_samples_does_not_matter(void **state SST_UNUSED)
{
    struct sst_calib truth = make_array(2, 3), a, b;
    struct sst_photometric_samples all = see(&truth, 6, 0.003);
    struct sst_photometric_report report;

    reset(&a, &truth);
    reset(&b, &truth);
    assert_int_equal(sst_photometric_solve(&a, &all, &report), 0);
    for (int i = all.count - 1; i > 0; i--) {
        const int k = (int)(sst_random(&seed) * (i + 1));
        const struct sst_photometric_sample s = all.sample[i];

        all.sample[i] = all.sample[k];
        all.sample[k] = s;
    }
    assert_int_equal(sst_photometric_solve(&b, &all, &report), 0);
    assert_memory_equal(a.camera, b.camera, 6 * sizeof(*a.camera));
    sst_photometric_samples_fini(&all);
    sst_calib_fini(&truth);
    sst_calib_fini(&a);
    sst_calib_fini(&b);
}

static void a_rig_has_one_falloff_and_no_gains(void **state SST_UNUSED)
{
    struct sst_calib truth = make_array(3, 3), got;
    struct sst_photometric_samples all;
    struct sst_photometric_report report;
    double gain, corner;

    truth.rig = true;
    for (int k = 0; k < 9; k++) {
        for (int i = 0; i < 3; i++)
            truth.camera[k].gain[i] = 1;
        memcpy(truth.camera[k].falloff, truth.camera[0].falloff, sizeof(truth.camera[k].falloff));
        truth.camera[k].cx = 322;
        truth.camera[k].cy = 237;
    }
    all = see(&truth, 20, 0.003);
    reset(&got, &truth);
    assert_int_equal(sst_photometric_solve(&got, &all, &report), 0);
    compare(&got, &truth, &gain, &corner);
    assert_true(gain == 0);
    assert_true(corner < 0.01);
    for (int k = 1; k < 9; k++)
        assert_memory_equal(got.camera[k].falloff, got.camera[0].falloff, sizeof(got.camera[k].falloff));
    sst_photometric_samples_fini(&all);
    sst_calib_fini(&truth);
    sst_calib_fini(&got);
}

/* One camera, none at all, values that are no light: refused, and nothing is touched. */
static void too_little_is_refused(void **state SST_UNUSED)
{
    struct sst_calib truth = make_array(1, 2), got;
    struct sst_photometric_samples all = see(&truth, 10, 0);
    struct sst_photometric_report report = { .samples = -7 };
    const int count = all.count;

    reset(&got, &truth);
    for (int i = 0; i < count; i++)
        all.sample[i].view = 0; /* no other camera sees any */
    got.camera[0].gain[1] = 1.25;
    assert_int_equal(sst_photometric_solve(&got, &all, &report), -ENODATA);
    all.count = 0;
    assert_int_equal(sst_photometric_solve(&got, &all, &report), -ENODATA);
    all.count = count;
    for (int i = 0; i < count; i++) {
        static const float bad[] = { NAN, 0, -1, INFINITY };

        all.sample[i].view = i & 1;
        all.sample[i].linear[i % 3] = bad[i / 2 % 4];
    }
    assert_int_equal(sst_photometric_solve(&got, &all, &report), -ENODATA);
    assert_int_equal(report.samples, -7);
    assert_true(got.camera[0].gain[1] == 1.25);
    sst_photometric_samples_fini(&all);
    sst_calib_fini(&truth);
    sst_calib_fini(&got);
}

/* Columns 0-1 and 2-3 never see the same place; camera 3 of the first part sees next to nothing. */
static void parts_are_even_among_themselves(void **state SST_UNUSED)
{
    struct sst_calib truth = make_array(2, 4), got;
    struct sst_photometric_samples all = see(&truth, 12, 0.001), some = { 0 };
    struct sst_photometric_report report;
    int left = 5;

    for (int i = 0; i < all.count; i++) {
        const struct sst_photometric_sample *s = &all.sample[i];
        const bool right = s->view % 4 >= 2;

        if (right == (s->frame >= 6) && (s->view != 4 || left-- > 0))
            add(&some, *s);
    }
    reset(&got, &truth);
    assert_int_equal(sst_photometric_solve(&got, &some, &report), 0);
    assert_int_equal(report.cameras, 7);
    for (int c = 0; c < 3; c++) {
        const double first = got.camera[0].gain[c] * got.camera[1].gain[c] * got.camera[5].gain[c];
        const double second =
            got.camera[2].gain[c] * got.camera[3].gain[c] * got.camera[6].gain[c] * got.camera[7].gain[c];

        assert_true(fabs(first - 1) < 1e-9);
        assert_true(fabs(second - 1) < 1e-9);
        assert_true(
            fabs(got.camera[2].gain[c] / got.camera[7].gain[c] / (truth.camera[2].gain[c] / truth.camera[7].gain[c]) -
                 1) < 0.005);
        assert_true(got.camera[4].gain[c] == 1 && got.camera[4].falloff[c] == 0);
    }
    sst_photometric_samples_fini(&all);
    sst_photometric_samples_fini(&some);
    sst_calib_fini(&truth);
    sst_calib_fini(&got);
}

/* Boards only in the middle of the pictures, with noise: the corners are not known, but the fall-off stays sane. */
static void little_knowledge_of_corners_stays_sane(void **state SST_UNUSED)
{
    struct sst_calib truth = make_array(2, 2), got;
    struct sst_photometric_samples all = see(&truth, 20, 0.02), some = { 0 };
    struct sst_photometric_report report;

    for (int i = 0; i < all.count; i++) {
        if (hypot(all.sample[i].x - 320, all.sample[i].y - 240) < 120)
            add(&some, all.sample[i]);
    }
    reset(&got, &truth);
    assert_int_equal(sst_photometric_solve(&got, &some, &report), 0);
    for (int k = 0; k < 4; k++) {
        double before = 1, up = 0, down = 0;

        for (int r = 1; r <= 400; r++) {
            const double v = falloff_of(&got.camera[k], got.camera[k].cx + r, got.camera[k].cy);

            assert_true(v > 0.12 && v < 8);
            up += fmax(0, v - before);
            down += fmax(0, before - v);
            before = v;
        }
        assert_true(fmin(up, down) < 0.011);
    }
    sst_photometric_samples_fini(&all);
    sst_photometric_samples_fini(&some);
    sst_calib_fini(&truth);
    sst_calib_fini(&got);
}

/* --- the map of factors ------------------------------------------------------------------------------------------- */

/* Factors at whole and other positions against 1 / (gain fall-off) where the exact chain leads, up to the edge of the
 * raw picture. */
static void factors_are_near_the_exact_chain(void **state SST_UNUSED)
{
    struct sst_calib calib = make_array(2, 2);
    const struct sst_rectify_config cfg = { .plane_mm = 0 };
    double worst = 0;
    int compared = 0;

    for (int k = 0; k < 4; k++) {
        calib.camera[k].lens = 5;
        calib.camera[k].k[0] = -0.15;
    }
    for (int size = 0; size < 2; size++) {
        struct sst_rectified to;
        struct gain_map *map = NULL;

        calib.camera[1].cx += 30; /* so that a border of the rectified picture is empty */
        assert_int_equal(sst_rectify_plan(&to, &calib, &cfg), 0);
        assert_int_equal(gain_map_create(&map, &to, &calib, 1), 0);
        assert_non_null(map);
        for (int i = 0; i < 400; i++) {
            const double x0 = size ? floor(600 * sst_random(&seed)) : 600 * sst_random(&seed),
                         y = (HEIGHT - 1) * sst_random(&seed);
            struct gain_factors f;
            float scratch[80];

            gain_map_row(map, &(struct sst_rectified_row){ x0, y, 40 }, scratch, &f);
            for (int n = 0; n < 40 && x0 + n <= WIDTH - 1; n++) {
                double raw[2], want;

                if (!sst_rectify_point(&to, &calib, 1, (const double[2]){ x0 + n, y }, raw))
                    continue;
                want = 1 / falloff_of(&calib.camera[1], raw[0], raw[1]);
                worst = fmax(worst, fabs(f.falloff[n] / want - 1));
                assert_true(fabs(f.falloff_root[n] / pow(want, 1 / 2.4) - 1) < 1e-3);
                compared++;
            }
            for (int c = 0; c < 3; c++)
                assert_true(fabs(f.gain[c] * calib.camera[1].gain[c] - 1) < 1e-6);
        }
        gain_map_destroy(map);
    }
    print_message("%d factors, worst error %.2g\n", compared, worst);
    assert_true(compared > 10000);
    assert_true(worst < 5e-4);
    sst_calib_fini(&calib);
}

/* Nothing to correct: no map. Light that is next to none: factors of 8, not of thousands. */
static void factors_stay_sane(void **state SST_UNUSED)
{
    struct sst_calib calib = make_array(1, 2);
    const struct sst_rectify_config cfg = { .plane_mm = 0 };
    struct sst_rectified to;
    struct gain_map *map = NULL;
    struct gain_factors f;
    float scratch[2 * WIDTH];

    assert_int_equal(sst_rectify_plan(&to, &calib, &cfg), 0);
    calib.camera[0].falloff[0] = -1.2; /* below 0 in the corners */
    calib.camera[0].falloff[1] = calib.camera[0].falloff[2] = 0;
    calib.camera[0].gain[2] = 1e-4;
    assert_int_equal(gain_map_create(&map, &to, &calib, 0), 0);
    gain_map_row(map, &(struct sst_rectified_row){ 0, 0, WIDTH }, scratch, &f);
    assert_true(f.gain[2] == 8);
    for (int i = 0; i < WIDTH; i++)
        assert_true(f.falloff[i] >= 1 && f.falloff[i] <= 8);
    gain_map_destroy(map);
    for (int i = 0; i < 3; i++) {
        calib.camera[0].falloff[i] = 0;
        calib.camera[0].gain[i] = 1;
    }
    assert_int_equal(gain_map_create(&map, &to, &calib, 0), 0);
    assert_null(map);
    sst_calib_fini(&calib);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gains_and_falloff_come_back),
        cmocka_unit_test(wrong_samples_do_not_matter),
        cmocka_unit_test(order_of_samples_does_not_matter),
        cmocka_unit_test(a_rig_has_one_falloff_and_no_gains),
        cmocka_unit_test(too_little_is_refused),
        cmocka_unit_test(parts_are_even_among_themselves),
        cmocka_unit_test(little_knowledge_of_corners_stays_sane),
        cmocka_unit_test(factors_are_near_the_exact_chain),
        cmocka_unit_test(factors_stay_sane),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
