/* Simulated arrays and flights over a forest (simulators/flight/): the same bytes for any number of threads, depths and
 * pictures of the true cameras, errors of the written poses. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/flight/flight.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/image/codec.h"
#include "pipeline/posed/picture.h"
#include "tests/deep_read.h"
#include "tests/folder.h"
#include "tests/test.h"

#define WIDTH  80
#define HEIGHT 64

static struct sst_flight_config small(int cols)
{
    struct sst_flight_config cfg;

    sst_flight_config_defaults(&cfg);
    cfg.width = WIDTH;
    cfg.height = HEIGHT;
    cfg.rows = 1;
    cfg.cols = cols;
    cfg.threads = 2;
    return cfg;
}

static void make(const char *name, const struct sst_flight_config *cfg, const char *folder, char path[SST_PATH_MAX],
                 struct sst_posed *posed)
{
    snprintf(path, SST_PATH_MAX, "%s", test_path("%s", folder));
    assert_int_equal(sst_flight_write(name, cfg, path, true), 0);
    assert_int_equal(sst_posed_load(posed, path), 0);
}

static double difference(const struct sst_posed *a, const char *path_a, const struct sst_posed *b, const char *path_b)
{
    struct sst_deep one, other;
    double sum = 0;

    for (int k = 0; k < a->count; k++) {
        assert_int_equal(sst_posed_picture(&one, a, path_a, k), 0);
        assert_int_equal(sst_posed_picture(&other, b, path_b, k), 0);
        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++)
                sum += abs(sst_map_u16_row(&one.plane[0], y)[x] - sst_map_u16_row(&other.plane[0], y)[x]);
        }
        sst_deep_fini(&one);
        sst_deep_fini(&other);
    }
    return sum / (a->count * WIDTH * HEIGHT);
}

static void same_bytes(void **state SST_UNUSED)
{
    struct sst_flight_config cfg = small(3);
    char one[SST_PATH_MAX], other[SST_PATH_MAX];
    struct sst_posed a, b;

    cfg.threads = 1;
    make("forest", &cfg, "forest-1", one, &a);
    cfg.threads = 4;
    make("forest", &cfg, "forest-4", other, &b);
    assert_true(difference(&a, one, &b, other) == 0);
    sst_posed_fini(&b);
    cfg.seed = 2;
    make("forest", &cfg, "forest-4", other, &b);
    assert_true(difference(&a, one, &b, other) > 5);
    sst_posed_fini(&a);
    sst_posed_fini(&b);
}

/* Without trees, a view is the picture behind them but for noise, and both depths agree. */
static void nothing_in_front(void **state SST_UNUSED)
{
    struct sst_flight_config cfg = small(1);
    char path[SST_PATH_MAX], file[SST_PATH_MAX + 32];
    struct sst_posed posed;
    struct sst_deep view, behind;
    struct sst_map_f32 depth, floor_depth;
    double worst = 0;

    cfg.cover = 0;
    make("flight", &cfg, "open", path, &posed);
    assert_int_equal(posed.bits, 16);
    assert_true(posed.geographic && posed.kelvin_scale > 0);
    assert_int_equal(sst_posed_picture(&view, &posed, path, 0), 0);
    snprintf(file, sizeof(file), "%s/truth/behind.png", path);
    assert_int_equal(deep_read(&behind, NULL, file), 0);
    snprintf(file, sizeof(file), "%s/truth/depth.pfm", path);
    assert_int_equal(sst_map_f32_read_pfm(&depth, file), 0);
    snprintf(file, sizeof(file), "%s/truth/floor.pfm", path);
    assert_int_equal(sst_map_f32_read_pfm(&floor_depth, file), 0);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            worst = fmax(worst, abs(sst_map_u16_row(&view.plane[0], y)[x] - sst_map_u16_row(&behind.plane[0], y)[x]));
            assert_true(sst_map_f32_row(&depth, y)[x] == sst_map_f32_row(&floor_depth, y)[x]);
            assert_true(sst_map_f32_row(&depth, y)[x] > 25 && sst_map_f32_row(&depth, y)[x] < 45);
        }
    }
    assert_true(worst > 0 && worst < 10); /* 0.05 K of noise are 1.25 levels */
    sst_deep_fini(&view);
    sst_deep_fini(&behind);
    sst_map_f32_fini(&depth);
    sst_map_f32_fini(&floor_depth);
    sst_posed_fini(&posed);
}

/* Angle between two rotations, degrees. */
static double turned(const double a[9], const double b[9])
{
    double between[9], v[3];

    sst_rotation_between(a, b, between);
    sst_rotation_to_vector(between, v);
    return 180 / M_PI * sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static void compass(void **state SST_UNUSED)
{
    struct sst_flight_config cfg = small(4);
    char path[SST_PATH_MAX];
    struct sst_posed right, wrong;

    make("flight", &cfg, "right", path, &right);
    cfg.turn_deg = 1;
    make("flight", &cfg, "wrong", path, &wrong);
    for (int k = 0; k < 4; k++) {
        assert_true(fabs(turned(right.view[k].camera.rotation, wrong.view[k].camera.rotation) - 1) < 1e-9);
        assert_memory_equal(right.view[k].camera.position_mm, wrong.view[k].camera.position_mm, 3 * sizeof(double));
        assert_string_equal(right.view[k].sha256, wrong.view[k].sha256);
    }
    sst_posed_fini(&wrong);
    cfg.unplaced = true;
    make("flight", &cfg, "wrong", path, &wrong);
    assert_int_equal(sst_posed_placed(&wrong), 0);
    assert_int_equal(sst_posed_placed(&right), 4);
    sst_posed_fini(&wrong);
    sst_posed_fini(&right);
}

static void moments(void **state SST_UNUSED)
{
    struct sst_flight_config cfg = small(2);
    char path[SST_PATH_MAX];
    struct sst_posed posed;

    cfg.moments = 3;
    make("forest", &cfg, "moments", path, &posed);
    assert_int_equal(posed.count, 6);
    for (int k = 0; k < 6; k++) {
        assert_int_equal(posed.view[k].moment, k / 2 + 1);
        assert_true(posed.view[k].time_s == 0.5 * (k / 2));
        assert_memory_equal(posed.view[k].camera.rotation, posed.view[k % 2].camera.rotation, 9 * sizeof(double));
    }
    sst_posed_fini(&posed);
    cfg.moments = 1000;
    snprintf(path, sizeof(path), "%s", test_path("many"));
    assert_int_not_equal(sst_flight_write("forest", &cfg, path, true), 0);
    assert_int_not_equal(sst_flight_write("jungle", &cfg, path, true), 0);
    assert_false(sst_path_exists(path));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(same_bytes),
        cmocka_unit_test(nothing_in_front),
        cmocka_unit_test(compass),
        cmocka_unit_test(moments),
    };

    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
