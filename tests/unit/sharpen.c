/* Refinement by warm places (pipeline/posed/find/sharpen.h) of drawn flights: a wrong lens is found, a right one stays.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/find/sharpen.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/camera/numbers.h"
#include "pipeline/image/deep.h"
#include "pipeline/posed/find/find_internal.h"
#include "pipeline/posed/solve/solve.h"
#include "simulators/scene/noise.h"
#include "tests/small.h"
#include "tests/test.h"

#define VIEWS  14
#define WIDTH  320
#define HEIGHT 256
#define FOCAL  264.0
#define HIGH   34500.0 /* mm */
#define MOST   48      /* warm places */

struct flight {
    struct sst_posed posed;
    struct sst_deep picture[VIEWS];
    struct sst_calib_camera lens; /* the true one */
    double rotation[VIEWS][9];    /* the true ones */
};

/* A warm place, 0.35 m in radius. */
static void warm(struct sst_deep *picture, double x, double y, double level)
{
    const double sigma = 350 * FOCAL / HIGH;

    for (int j = (int)y - 10; j <= (int)y + 10; j++) {
        for (int i = (int)x - 10; i <= (int)x + 10; i++) {
            if (i >= 0 && j >= 0 && i < WIDTH && j < HEIGHT)
                sst_map_u16_row(&picture->plane[0], j)[i] +=
                    (uint16_t)(level * exp(-0.5 * ((i - x) * (i - x) + (j - y) * (j - y)) / (sigma * sigma)));
        }
    }
}

static void draw(struct flight *f, const double (*place)[3], int places, uint64_t *random)
{
    for (int k = 0; k < VIEWS; k++) {
        struct sst_deep *picture = &f->picture[k];
        struct sst_calib_camera cam = f->lens;

        assert_int_equal(sst_deep_init(picture, WIDTH, HEIGHT, 1, UINT16_MAX), 0);
        for (int i = 0; i < WIDTH * HEIGHT; i++)
            sst_map_u16_row(&picture->plane[0], i / WIDTH)[i % WIDTH] = (uint16_t)(6000 + 20 * sst_random(random));
        for (int p = 0; p < places; p++) {
            const double *at = f->posed.view[k].camera.position_mm;
            double to[3], x, y, level = sst_random_in(random, 100, 300);

            for (int i = 0; i < 3; i++)
                to[i] = place[p][i] - at[i];
            sst_numbers_apply3(f->rotation[k], to, to);
            sst_camera_distort(&cam, to[0] / to[2], to[1] / to[2], &x, &y);
            if (sst_random(random) < 0.7 && x > -20 && y > -20 && x < WIDTH + 20 &&
                y < HEIGHT + 20) /* else hidden by leaves */
                warm(picture, x, y, level);
        }
        for (int p = 0; p < 4; p++) /* branches in the sun */
            warm(picture, sst_random_in(random, 0, WIDTH), sst_random_in(random, 0, HEIGHT), 150);
    }
}

/* A flight; given rotations are up to a third of a degree off. @param focal, k1  of the true lens, before the
 * given lens @param slope  of the ground across the line */
static void fly_over(struct flight *f, int places, double focal, double k1, double slope)
{
    uint64_t random = 7;
    double place[MOST][3] = { { 0 } };

    memset(f, 0, sizeof(*f));
    assert_int_equal(sst_posed_init(&f->posed, VIEWS), 0);
    f->posed.width = WIDTH;
    f->posed.height = HEIGHT;
    f->posed.channels = 1;
    f->posed.bits = 16;
    f->posed.metric = true;
    f->posed.up[2] = 1;
    f->posed.median_px = NAN;
    f->posed.picture = f->picture;
    snprintf(f->posed.source, sizeof(f->posed.source), "AOS, drawn"); /* the ground of this source is at z = 0 */
    for (int k = 0; k < VIEWS; k++) {
        struct sst_posed_view *v = &f->posed.view[k];
        const double down[9] = { 1, 0, 0, 0, -1, 0, 0, 0, -1 }, across = k % 2 ? 700 : -700;
        double turn[3], by[9];

        snprintf(v->name, sizeof(v->name), "%02d.png", k);
        snprintf(v->file, sizeof(v->file), "%02d.png", k);
        v->camera = (struct sst_calib_camera){ .known = true,
                                               .fx = FOCAL,
                                               .fy = FOCAL,
                                               .cx = (WIDTH - 1) / 2.0,
                                               .cy = (HEIGHT - 1) / 2.0,
                                               .position_mm = { 1700 * (k - (VIEWS - 1) / 2.0), across, HIGH },
                                               .gain = { 1, 1, 1 } };
        for (int i = 0; i < 3; i++)
            turn[i] = sst_random_in(&random, -0.006, 0.006) / (i == 2 ? 2 : 1);
        sst_rotation_from_vector(turn, by);
        memcpy(f->rotation[k], down, sizeof(down));
        sst_numbers_mul3(by, down, v->camera.rotation);
    }
    f->lens = f->posed.view[0].camera;
    sst_camera_adjust(&f->lens, focal, k1);
    for (int p = 0; p < places; p++) {
        place[p][0] = sst_random_in(&random, -24000, 24000);
        place[p][1] = sst_random_in(&random, -14000, 14000);
        place[p][2] = slope * place[p][1];
    }
    draw(f, (const double(*)[3])place, places, &random);
}

static void fly(struct flight *f, int places, double focal, double k1)
{
    fly_over(f, places, focal, k1, 0);
}

static void land(struct flight *f)
{
    for (int k = 0; k < VIEWS; k++)
        sst_deep_fini(&f->picture[k]);
    sst_posed_fini(&f->posed);
}

/* Largest distance, px, of pixels by a lens from the pixels by the true lens, up to the middles of the sides. */
static double lens_off(const struct flight *f)
{
    double most = 0;

    for (int i = 0; i < 100; i++) {
        const double a = (i % 10 - 4.5) / 4.5 * WIDTH / 2 / FOCAL, b = (i / 10 - 4.5) / 4.5 * HEIGHT / 2 / FOCAL;
        double x[2], y[2];

        if (hypot(a, b) > WIDTH / 2 / FOCAL)
            continue;
        sst_camera_distort(&f->lens, a, b, &x[0], &y[0]);
        sst_camera_distort(&f->posed.view[3].camera, a, b, &x[1], &y[1]);
        most = fmax(most, hypot(x[0] - x[1], y[0] - y[1]));
    }
    return most;
}

/* A focal length 1.5 % off and k1 = -0.1 are found, and the same lens by any number of threads. Given rotations have by
 * chance some turns that grow along the line, which look like another focal length: a part of the 1.5 % may stay. */
static void wrong_lens(void **state SST_UNUSED)
{
    struct sst_sharpen_config cfg = { .threads = 1 };
    struct sst_sharpened result, again;
    struct flight f;
    double before;

    fly(&f, MOST, 1.015, -0.1);
    before = lens_off(&f);
    assert_int_equal(sst_posed_sharpen(&f.posed, "drawn", &cfg, &result), 0);
    assert_true(result.lens_gain > 1.03);
    assert_true(fabs(result.focal - 1.015) < 0.008 && fabs(result.k1 + 0.1) < 0.02);
    assert_true(lens_off(&f) < 0.25 * before);
    land(&f);
    cfg.threads = 3;
    fly(&f, MOST, 1.015, -0.1);
    assert_int_equal(sst_posed_sharpen(&f.posed, "drawn", &cfg, &again), 0);
    assert_memory_equal(&result, &again, sizeof(result));
    land(&f);
    cfg.keep_lens = true;
    fly(&f, MOST, 1.015, -0.1);
    assert_int_equal(sst_posed_sharpen(&f.posed, "drawn", &cfg, &again), 0);
    assert_true(again.lens_gain == 0 && again.after < result.after && f.posed.view[3].camera.fx == FOCAL);
    land(&f);
}

/* The slope of the ground is found with the lens: on a level plane it would pass for turns, and for a part of k1. */
static void sloping_ground(void **state SST_UNUSED)
{
    const struct sst_sharpen_config cfg = { 0 };
    struct sst_sharpened result;
    struct flight f;

    fly_over(&f, MOST, 1, -0.1, 0.12);
    assert_int_equal(sst_posed_sharpen(&f.posed, "drawn", &cfg, &result), 0);
    assert_true(fabs(result.tilt_deg - atan(0.12) * 180 / M_PI) < 1 && fabs(result.k1 + 0.1) < 0.02);
    assert_true(fabs(result.plane.normal[1] / result.plane.normal[2] + 0.12) < 0.02);
    land(&f);
}

static void check_kept(int places)
{
    const struct sst_sharpen_config cfg = { 0 };
    struct sst_sharpened result;
    struct flight f;
    int err;

    fly(&f, places, 1, 0);
    err = sst_posed_sharpen(&f.posed, "drawn", &cfg, &result);
    assert_true(places ? err == 0 : err == 0 || err == -ENODATA);
    assert_true(result.lens_gain == 0 && result.focal == 1 && result.k1 == 0);
    assert_true(f.posed.view[3].camera.fx == FOCAL && f.posed.view[3].camera.lens == 0);
    land(&f);
}

static void right_lens(void **state SST_UNUSED)
{
    check_kept(MOST);
}

/* Two persons, or none, tell nothing of a lens. */
static void few_places(void **state SST_UNUSED)
{
    check_kept(2);
    check_kept(0);
}

/* The focal length of the user is the one that warm places refine. */
static void given_focal(void **state SST_UNUSED)
{
    const struct sst_posed_solve_config cfg = { .refine = true, .keep_lens = true, .focal_px = FOCAL * 1.01 };
    struct sst_posed_solved solved;
    struct flight f;

    fly(&f, 12, 1.01, 0); /* too few for matches */
    assert_int_equal(sst_posed_solve(&f.posed, (const char *[]){ "drawn" }, 1, &cfg, &solved), 0);
    assert_true(solved.sharper > 1 && solved.focal_px == cfg.focal_px && f.posed.view[3].camera.fx == cfg.focal_px);
    sst_posed_solved_fini(&solved);
    land(&f);
}

/* Sights of places behind a view fit nothing. */
static void behind(void **state SST_UNUSED)
{
    struct sst_calib_camera camera = { .known = true, .fx = 100, .fy = 100, .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 } };
    const double given[1][9] = { { 1, 0, 0, 0, 1, 0, 0, 0, 1 } };
    double place[1][3] = { { 0, 0, -1000 } };
    const struct lens_sight sight[1] = { { 0, 0, 1, 1, 1 } };
    struct lens_fit fit = { .views = 1,
                            .places = 1,
                            .sights = 1,
                            .camera = &camera,
                            .given = given,
                            .sigma_rad = 0.01,
                            .place_mm = place,
                            .sight = sight,
                            .normal = { 0, 0, -1 },
                            .across = { { 1, 0, 0 }, { 0, 1, 0 } },
                            .free_lens = true,
                            .focal = 1 };

    assert_int_equal(lens_fit(&fit), -EDOM);
    place[0][2] = 0; /* at the view itself */
    assert_int_equal(lens_fit(&fit), -EDOM);
    place[0][2] = 1000; /* one sight: the priors hold everything */
    assert_int_equal(lens_fit(&fit), 0);
    assert_true(fabs(fit.focal - 1) < 0.05 && fabs(fit.k1) < 0.2 && fit.median_px < 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        serial_test(wrong_lens),       cmocka_unit_test(right_lens), cmocka_unit_test(few_places),
        cmocka_unit_test(given_focal), cmocka_unit_test(behind),     cmocka_unit_test(sloping_ground),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
