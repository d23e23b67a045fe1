/* Searches of simulated forests (pipeline/posed/find/find.h): walkers that views show are found at their places, and
 * nothing else. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/find/find.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/camera/numbers.h"
#include "pipeline/posed/find/sharpen.h"
#include "simulators/flight/flight.h"
#include "tests/folder.h"
#include "tests/small.h"
#include "tests/test.h"

#define OFF_M 0.8 /* a walker's middle, and where its head and hands are on the ground's plane */

struct forest {
    char path[SST_PATH_MAX];
    struct sst_posed posed;
    json_t *truth;
    struct sst_virtual camera;
    struct sst_surface ground;
    struct sst_heights heights;
    struct sst_find_scene scene;
};

static void plant(struct forest *f, const char *name, int cols, int width, int height)
{
    struct sst_flight_config cfg;

    sst_flight_config_defaults(&cfg);
    cfg.width = width;
    cfg.height = height;
    cfg.rows = 1;
    cfg.cols = cols;
    *f = (struct forest){ 0 };
    snprintf(f->path, sizeof(f->path), "%s", test_path("%s", name));
    assert_int_equal(sst_flight_write(name, &cfg, f->path, true), 0);
    assert_int_equal(sst_posed_load(&f->posed, f->path), 0);
    f->truth = json_load_file(test_path("%s/truth/truth.json", name), 0, NULL);
    assert_non_null(f->truth);
    f->camera = sst_virtual_of_view(&f->posed, sst_posed_middle(&f->posed));
    assert_int_equal(sst_heights_read(&f->heights, test_path("%s/truth/ground.obj", name)), 0);
    assert_int_equal(sst_surface_terrain(&f->ground, &f->heights, f->posed.up), 0);
    f->camera = sst_find_camera(&f->camera, &f->ground);
    f->scene = (struct sst_find_scene){ &f->posed, f->path, &f->camera, &f->ground };
}

static void fell(struct forest *f)
{
    sst_posed_fini(&f->posed);
    sst_heights_fini(&f->heights);
    json_decref(f->truth);
}

/* The find that is at a walker's place; -1: none. */
static int find_at(const struct sst_found *found, int count, const json_t *walker)
{
    const json_t *at = json_object_get(walker, "position_m");
    const double x = json_real_value(json_array_get(at, 0)), y = json_real_value(json_array_get(at, 1));

    for (int i = 0; i < count; i++) {
        if (hypot(found[i].at_mm[0] / 1000 - x, found[i].at_mm[1] / 1000 - y) < OFF_M)
            return i;
    }
    return -1;
}

/* Walkers that `least` views show are found. @return the highest score of other finds, 0: none */
static double compare(const struct forest *f, const struct sst_finds *finds, int least, double *weakest)
{
    const struct sst_found *found = finds->found;
    const int count = finds->count;
    const json_t *walkers = json_object_get(f->truth, "walkers");
    bool is_walker[64] = { false };
    double other = 0;

    *weakest = INFINITY;
    assert_true(count <= 64);
    for (size_t i = 0; i < json_array_size(walkers); i++) {
        const json_t *w = json_array_get(walkers, i);
        const int at = find_at(found, count, w);

        if (json_integer_value(json_object_get(w, "views")) >= least) {
            assert_true(at >= 0);
            *weakest = fmin(*weakest, found[at].blob.score);
        }
        if (at >= 0)
            is_walker[at] = true;
    }
    for (int i = 0; i < count; i++)
        other = fmax(other, is_walker[i] ? 0 : found[i].blob.score);
    return other;
}

static void thermal(void **state SST_UNUSED)
{
    struct sst_find_config cfg = sst_find_defaults();
    struct sst_finds finds;
    struct forest f;
    double weakest;

    plant(&f, "flight", small_level() ? 8 : 20, 320, 256);
    assert_int_equal(sst_posed_find(&finds, &f.scene, &cfg), 0);
    assert_true(compare(&f, &finds, small_level() ? 4 : 6, &weakest) == 0);
    assert_true(isfinite(weakest) && finds.count >= (small_level() ? 1 : 3));
    assert_true(finds.hectares > 0.05 && finds.hectares < 0.3);
    for (int i = 0; i < finds.count; i++) {
        const struct sst_found *found = &finds.found[i];
        const double metre = 1 / 111000.0;

        assert_true(found->best >= 0 && found->views >= 3 && found->views <= found->seen);
        assert_true(found->size_m > 0.4 && found->size_m < 2.5);
        assert_true(fabs(found->latitude - f.posed.latitude - found->at_mm[1] / 1000 * metre) < metre);
        assert_true(fabs(found->longitude - f.posed.longitude) < 40 * metre);
    }
    sst_finds_fini(&finds);
    cfg.sign = -1; /* nothing is colder than its surroundings */
    assert_int_equal(sst_posed_find(&finds, &f.scene, &cfg), 0);
    assert_true(compare(&f, &finds, 1000, &weakest) < 6);
    sst_finds_fini(&finds);
    fell(&f);
}

/* Root of the mean square of the angles between the views' rotations and others, rad. */
static double off_by(const struct sst_posed *posed, const double (*rotation)[9])
{
    double square = 0, between[9], v[3];

    for (int k = 0; k < posed->count; k++) {
        sst_rotation_between(posed->view[k].camera.rotation, rotation[k], between);
        sst_rotation_to_vector(between, v);
        square += (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) / posed->count;
    }
    return sqrt(square);
}

/* Warm places bring rotations back by which views were turned. */
static void sharpened(void **state SST_UNUSED)
{
    const struct sst_sharpen_config cfg = { 0 };
    struct sst_sharpened result;
    double rotation[32][9], before;
    struct forest f;

    plant(&f, "flight", small_level() >= 2 ? 6 : 16, 320, 256);
    for (int k = 0; k < f.posed.count; k++) {
        double *own = f.posed.view[k].camera.rotation, turn[9];

        memcpy(rotation[k], own, sizeof(rotation[k]));
        sst_rotation_from_vector((double[]){ 0.009 * (k % 3 - 1), 0.009 * (k / 3 % 3 - 1), 0 }, turn);
        sst_numbers_mul3(turn, rotation[k], own);
    }
    before = off_by(&f.posed, rotation);
    assert_int_equal(sst_posed_sharpen(&f.posed, f.path, &cfg, &result), 0);
    assert_true(small_level() >= 2 || off_by(&f.posed, rotation) < 0.75 * before);
    assert_true(result.after >= result.before && result.moved <= f.posed.count);
    fell(&f);
}

/* Views are registered on the ground that the source names, at z = 0, although the given rotations agree on a nearer
 * and tilted plane. */
static void sharpened_on_a_known_ground(void **state SST_UNUSED)
{
    const struct sst_sharpen_config cfg = { 0 };
    const struct sst_calib_camera *middle;
    struct sst_sharpened result;
    struct forest f;

    plant(&f, "flight", small_level() >= 2 ? 6 : 8, 320, 256);
    snprintf(f.posed.source, sizeof(f.posed.source), "AOS");
    for (int k = 0; k < f.posed.count; k++) {
        double turn[9], own[9];

        memcpy(own, f.posed.view[k].camera.rotation, sizeof(own));
        sst_rotation_from_vector((double[]){ 0.009 * (k % 3 - 1), 0.009 * (k / 3 % 3 - 1), 0 }, turn);
        sst_numbers_mul3(turn, own, f.posed.view[k].camera.rotation);
    }
    middle = &f.posed.view[sst_posed_middle(&f.posed)].camera;
    const double height = 31500, along = -middle->rotation[8], lower = middle->position_mm[2] - height;
    for (int k = 0; k < f.posed.count; k++)
        f.posed.view[k].camera.position_mm[2] -= lower;
    assert_int_equal(sst_posed_sharpen(&f.posed, f.path, &cfg, &result), 0);
    assert_true(small_level() >= 2 || (result.moved > 0 && fabs(result.distance_mm * along - height) < 1));
    fell(&f);
}

static void find_colour(bool twice)
{
    struct sst_find_config cfg = sst_find_defaults();
    struct sst_finds finds, again;
    struct forest f;
    double weakest;

    plant(&f, "forest", 8, 512, 512);
    assert_int_equal(sst_posed_find(&finds, &f.scene, &cfg), 0);
    assert_true(2 * compare(&f, &finds, 5, &weakest) < weakest);
    assert_true(isfinite(weakest) && finds.count >= 2);
    if (twice) {
        cfg.threads = 1;
        assert_int_equal(sst_posed_find(&again, &f.scene, &cfg), 0);
        assert_int_equal(finds.count, again.count);
        assert_memory_equal(finds.found, again.found, (size_t)finds.count * sizeof(*finds.found));
        sst_finds_fini(&again);
    }
    sst_finds_fini(&finds);
    fell(&f);
}

static void colour(void **state SST_UNUSED)
{
    find_colour(false);
}

static void colour_alike_by_any_threads(void **state SST_UNUSED)
{
    find_colour(true);
}

static void nothing_to_search(void **state SST_UNUSED)
{
    const struct sst_find_config cfg = sst_find_defaults();
    const double up[3] = { 0, 0, 1 }, beyond[3] = { 0, 0, 1e6 };
    struct sst_surface above;
    struct sst_finds finds;
    struct forest f;

    plant(&f, "flight", 2, 64, 48);
    above = sst_surface_plane(up, beyond);
    f.scene.surface = &above;
    assert_int_equal(sst_posed_find(&finds, &f.scene, &cfg), -EINVAL);
    assert_null(finds.found);
    f.scene.surface = &f.ground;
    for (int k = 0; k < f.posed.count; k++)
        f.posed.view[k].camera.known = false;
    assert_int_equal(sst_posed_find(&finds, &f.scene, &cfg), -ENODATA);
    assert_int_equal(finds.count, 0);
    fell(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(thermal),
        thread_test(sharpened),
        cmocka_unit_test(sharpened_on_a_known_ground),
        serial_test(colour),
        plain_test(colour_alike_by_any_threads),
        cmocka_unit_test(nothing_to_search),
    };

    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
