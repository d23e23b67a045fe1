/* Poses from pictures (pipeline/posed/solve/) of simulated flights with known truth, and of pictures that have none. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/posed/picture.h"
#include "pipeline/posed/solve/solve_internal.h"
#include "simulators/flight/flight.h"
#include "simulators/scene/noise.h"
#include "tests/folder.h"
#include "tests/small.h"
#include "tests/test.h"

#define DEG (3.14159265358979 / 180)

static void fly(const char *name, const struct sst_flight_config *cfg, struct sst_posed *posed, char path[SST_PATH_MAX])
{
    snprintf(path, SST_PATH_MAX, "%s", test_path("%s", name));
    assert_int_equal(sst_flight_write(name, cfg, path, true), 0);
    assert_int_equal(sst_posed_load(posed, path), 0);
}

static int solve(struct sst_posed *posed, const char *path, const struct sst_posed_solve_config *cfg)
{
    struct sst_posed_solved solved = { 0 };
    const int err = sst_posed_solve(posed, &path, 1, cfg, &solved);

    for (int k = 0; !err && k < posed->count; k++)
        assert_false(solved.doubtful[k]);
    if (!err)
        assert_int_equal(solved.placed, sst_posed_placed(posed));
    sst_posed_solved_fini(&solved);
    return err;
}

static void model_of(struct poses_model *m, const struct sst_posed *posed, int tracks)
{
    assert_int_equal(poses_model_init(m, posed->count, tracks), 0);
    m->focal = posed->view[0].camera.fx;
    for (int v = 0; v < posed->count; v++) {
        memcpy(m->rotation[v], posed->view[v].camera.rotation, sizeof(*m->rotation));
        memcpy(m->centre[v], posed->view[v].camera.position_mm, sizeof(*m->centre));
    }
}

/* Spots at known places: features of their middles lie there, whether pictures are rich or not. */
static void features_lie_on_spots(void **state SST_UNUSED)
{
    enum { SIDE = 320, CELLS = 15, SPOTS = CELLS * CELLS };
    static const int most[2] = { 150, 600 }; /* rich: fewer than a feature for each 250 px */
    float *level = calloc((size_t)SIDE * SIDE, sizeof(*level));
    double at[SPOTS][2];
    uint64_t seed = 3;

    assert_non_null(level);
    for (int i = 0; i < SPOTS; i++) {
        at[i][0] = 20 * (i % CELLS) + 20 + sst_random_in(&seed, -2, 2);
        at[i][1] = 20 * (i / CELLS) + 20 + sst_random_in(&seed, -2, 2);
        for (int y = (int)at[i][1] - 9; y < (int)at[i][1] + 10; y++) {
            for (int x = (int)at[i][0] - 9; x < (int)at[i][0] + 10; x++) {
                const double dx = x - at[i][0], dy = y - at[i][1];

                level[y * SIDE + x] += (float)(150 * exp(-(dx * dx + dy * dy) / (2 * 2.5 * 2.5)));
            }
        }
    }
    for (int r = 0; r < 2; r++) {
        struct cv_features f = { 0 };
        double mean[2] = { 0 };
        char why[256];
        int near = 0;

        assert_int_equal(
            cv_features_find(&f, &(struct cv_grey){ .level = level, .width = SIDE, .height = SIDE }, most[r], why), 0);
        for (int i = 0; i < f.count; i++) {
            for (int s = 0; s < SPOTS; s++) {
                const double dx = f.at[i][0] - at[s][0], dy = f.at[i][1] - at[s][1];

                if (hypot(dx, dy) < 1) {
                    near++;
                    mean[0] += dx;
                    mean[1] += dy;
                }
            }
        }
        assert_in_range(near, 100, f.count);
        assert_true(fabs(mean[0] / near) < 0.05 && fabs(mean[1] / near) < 0.05);
        free(f.at);
        free(f.descriptor);
    }
    free(level);
}

/* Points at the trees' depths, seen by the true cameras, meet in the found ones within so many px (median). */
static double reprojection(const struct sst_posed *truth, const struct sst_posed *found)
{
    enum { SIDE = 12 };
    const int most = SIDE * SIDE * 2;
    struct poses_tracks tracks = { .first = calloc((size_t)most + 1, sizeof(int)),
                                   .sight = calloc((size_t)most * truth->count, sizeof(struct poses_sight)) };
    const struct sst_calib_camera *middle = &truth->view[truth->count / 2].camera;
    struct poses_model m;
    double median;

    assert_true(tracks.first && tracks.sight);
    for (int i = 0; i < most; i++) {
        const double depth = i % 2 ? 28e3 : 38e3, x = i / 2 % SIDE, y = i / 2 / SIDE;
        const double p[3] = { ((x + 0.5) / SIDE - 0.5) * truth->width / middle->fx * depth,
                              ((y + 0.5) / SIDE - 0.5) * truth->height / middle->fx * depth, depth };
        double world[3], d[3], q[3];

        for (int k = 0; k < 3; k++)
            world[k] = middle->position_mm[k] + middle->rotation[k] * p[0] + middle->rotation[3 + k] * p[1] +
                       middle->rotation[6 + k] * p[2];
        tracks.first[tracks.tracks] = tracks.sights;
        for (int v = 0; v < truth->count; v++) {
            const struct sst_calib_camera *cam = &truth->view[v].camera;

            for (int k = 0; k < 3; k++)
                d[k] = world[k] - cam->position_mm[k];
            sst_numbers_apply3(cam->rotation, d, q);
            q[0] *= cam->fx / q[2];
            q[1] *= cam->fx / q[2];
            if (fabs(q[0]) < truth->width / 2.0 && fabs(q[1]) < truth->height / 2.0)
                tracks.sight[tracks.sights++] = (struct poses_sight){ v, tracks.tracks, q[0], q[1] };
        }
        tracks.first[++tracks.tracks] = tracks.sights;
    }
    model_of(&m, found, tracks.tracks);
    poses_triangulate(&m, &tracks);
    median = poses_median(&m, &tracks);
    poses_model_fini(&m);
    poses_tracks_fini(&tracks);
    return median;
}

static struct sst_flight_config flight_of(int width, int height, int cols)
{
    struct sst_flight_config cfg;

    sst_flight_config_defaults(&cfg);
    cfg.width = width;
    cfg.height = height;
    cfg.rows = 1;
    cfg.cols = cols;
    cfg.threads = 2;
    return cfg;
}

enum { ROD = 6 };
static const int mixed[ROD] = { 2, 0, 4, 1, 5, 3 }; /* place on the rod of each view in the order of names */

static void rename_views(struct sst_posed *posed, const int *named)
{
    struct sst_posed_view view[ROD];

    for (int k = 0; k < posed->count; k++)
        view[k] = posed->view[named[k]];
    memcpy(posed->view, view, (size_t)posed->count * sizeof(*view));
}

/* Distances of neighbours on the rod; their mean is a metre. */
static void rod_is_even(const struct sst_posed *posed, const int *named)
{
    double place[ROD][3] = { { 0 } }, sum = 0;

    for (int k = 0; k < posed->count; k++)
        memcpy(place[named[k]], posed->view[k].camera.position_mm, sizeof(*place));
    for (int k = 1; k < posed->count; k++) {
        const double gap = sqrt(pow(place[k][0] - place[k - 1][0], 2) + pow(place[k][1] - place[k - 1][1], 2) +
                                pow(place[k][2] - place[k - 1][2], 2));

        assert_true(gap > 800 && gap < 1200);
        sum += gap;
    }
    assert_true(fabs(sum / (posed->count - 1) - 1000) < 1e-6);
}

static void forest(bool twice)
{
    struct sst_flight_config cfg = flight_of(288, 288, ROD);
    struct sst_posed truth, found, again;
    char path[SST_PATH_MAX];

    fly("forest", &cfg, &truth, path);
    assert_int_equal(sst_posed_load(&found, path), 0);
    assert_int_equal(sst_posed_load(&again, path), 0);
    rename_views(&truth, mixed);
    rename_views(&found, mixed);
    rename_views(&again, mixed);
    for (int k = 0; k < truth.count; k++)
        found.view[k].camera.known = again.view[k].camera.known = false;
    assert_int_equal(solve(&found, path, &(struct sst_posed_solve_config){ .threads = 3 }), 0);
    if (twice)
        assert_int_equal(solve(&again, path, &(struct sst_posed_solve_config){ .threads = 1 }), 0);
    assert_int_equal(sst_posed_placed(&found), truth.count);
    assert_false(found.metric);
    rod_is_even(&found, mixed);
    for (int k = 0; twice && k < truth.count; k++)
        assert_memory_equal(&found.view[k].camera, &again.view[k].camera, sizeof(found.view[k].camera));
    assert_true(found.median_px < 0.2);
    assert_true(reprojection(&truth, &found) < 0.1);
    for (int k = 0; k < 3; k++)
        assert_true(found.view[0].camera.position_mm[k] == 0);
    sst_posed_fini(&truth);
    sst_posed_fini(&found);
    sst_posed_fini(&again);
}

/* A rod of cameras over a forest, named in another order: all are placed, in a unit that is not metric. */
static void forest_is_placed(void **state SST_UNUSED)
{
    forest(false);
}

/* Pictures that match about as well in the order of names as along the rod: neighbours stand next to each other on it. */
static void rod_is_measured_along(void **state SST_UNUSED)
{
    static const int named[] = { 0, 2, 4, 1, 3 };
    struct sst_flight_config cfg = flight_of(288, 288, 5);
    struct sst_posed found;
    char path[SST_PATH_MAX];

    cfg.seed = 3;
    fly("forest", &cfg, &found, path);
    rename_views(&found, named);
    for (int k = 0; k < found.count; k++)
        found.view[k].camera.known = false;
    assert_int_equal(solve(&found, path, &(struct sst_posed_solve_config){ .threads = 2 }), 0);
    rod_is_even(&found, named);
    sst_posed_fini(&found);
}

static void forest_is_placed_alike_by_any_threads(void **state SST_UNUSED)
{
    forest(true);
}

/* A flight with thermal pictures whose compass is off by a degree; so few and small ones leave up to a third of it. */
static void compass_is_corrected(void **state SST_UNUSED)
{
    struct sst_flight_config cfg = flight_of(48, 38, 8); /* the poses of every size */
    struct sst_posed truth, given;
    char path[SST_PATH_MAX];
    double worst = 0;

    fly("flight", &cfg, &truth, path);
    cfg.width = 480;
    cfg.height = 384;
    cfg.turn_deg = 1;
    fly("flight", &cfg, &given, path);
    assert_int_equal(
        solve(&given, path, &(struct sst_posed_solve_config){ .threads = 2, .refine = true, .sigma_position_mm = 5 }),
        0);
    for (int k = 0; k < truth.count; k++) {
        double between[9], v[3], yaw = 0;

        assert_true(given.view[k].camera.known);
        sst_rotation_between(given.view[k].camera.rotation, truth.view[k].camera.rotation, between);
        sst_rotation_to_vector(between, v);
        for (int i = 0; i < 3; i++)
            yaw += v[i] * (truth.view[k].camera.rotation[3 * i + 2]); /* about the world's z */
        worst = fmax(worst, fabs(yaw));
    }
    assert_true(worst < 0.33 * DEG);
    assert_true(given.metric && given.geographic == truth.geographic);
    sst_posed_fini(&truth);
    sst_posed_fini(&given);
}

/* --- pictures without poses --------------------------------------------------------------------------------------- */

enum picture {
    PICTURE_FLAT = 0,
    PICTURE_SAME = 1,
    PICTURE_OTHERS = 2, /* each of something else */
};

static void write_picture(const char *path, enum picture kind, int k)
{
    enum { SIDE = 160, BLOCK = 5 };
    uint8_t value[SIDE / BLOCK][SIDE / BLOCK];
    uint64_t seed = 77 + (kind == PICTURE_OTHERS ? (uint64_t)k : 0);
    struct sst_deep deep;

    for (int y = 0; y < SIDE / BLOCK; y++) {
        for (int x = 0; x < SIDE / BLOCK; x++)
            value[y][x] = (uint8_t)(kind == PICTURE_FLAT ? 100 : 255 * sst_random(&seed));
    }
    assert_int_equal(sst_deep_init(&deep, SIDE, SIDE, 1, 65535), 0);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++)
            sst_map_u16_row(&deep.plane[0], y)[x] = (uint16_t)(257 * value[y / BLOCK][x / BLOCK]);
    }
    assert_int_equal(sst_deep_write(&deep, path), 0);
    sst_deep_fini(&deep);
}

/* The error of pictures of a kind; the light field is as before. */
static int refused(enum picture kind, int count, const char *words)
{
    struct sst_posed posed;
    char text[SST_LOG_MAX] = "";
    const char *dir = test_path("bad");
    int err;

    assert_int_equal(sst_path_make_dir(dir), 0);
    assert_int_equal(sst_path_make_dir(test_path("bad/views")), 0);
    assert_int_equal(sst_posed_init(&posed, count), 0);
    posed.width = posed.height = 160;
    posed.channels = 1;
    posed.bits = 16;
    for (int k = 0; k < count; k++) {
        snprintf(posed.view[k].name, sizeof(posed.view[k].name), "%d.png", k);
        snprintf(posed.view[k].file, sizeof(posed.view[k].file), "%d.png", k);
        write_picture(test_path("bad/views/%d.png", k), kind, k);
    }
    sst_log_hold_errors(text);
    err = solve(&posed, dir, &(struct sst_posed_solve_config){ .threads = 2 });
    sst_log_hold_errors(NULL);
    assert_contains(text, words);
    assert_int_equal(sst_posed_placed(&posed), 0);
    sst_posed_fini(&posed);
    return err;
}

static void poses_without_evidence(void **state SST_UNUSED)
{
    assert_int_equal(refused(PICTURE_SAME, 1, "one picture alone has no pose"), -EDOM);
    assert_int_equal(refused(PICTURE_FLAT, 3, "no two pictures show the same things"), -EDOM);
    assert_int_equal(refused(PICTURE_OTHERS, 3, "no two pictures show the same things"), -EDOM);
    assert_int_equal(refused(PICTURE_SAME, 4, "show no parallax"), -EDOM);
}

enum { SIDE = 160 };

/* Blocks of random levels; the first and the last view show the same. */
static int levels_of(void *arg, int view, float **level)
{
    const struct poses_scene *scene = arg;
    enum { BLOCK = 5 };
    uint64_t seed = 50 + (uint64_t)view % (uint64_t)(scene->views - 1);

    *level = malloc(sizeof(**level) * SIDE * SIDE);
    assert_non_null(*level);
    for (int y = 0; y < SIDE; y += BLOCK) {
        for (int x = 0; x < SIDE; x += BLOCK) {
            const float value = (float)(255 * sst_random(&seed));

            for (int i = 0; i < BLOCK * BLOCK; i++)
                (*level)[(y + i / BLOCK) * SIDE + x + i % BLOCK] = value;
        }
    }
    return 0;
}

/* Given positions of some views do not keep the others from being matched far apart in order. */
static void views_without_poses_have_neighbours(void **state SST_UNUSED)
{
    enum { VIEWS = 5 };
    struct sst_posed posed;
    struct poses_scene scene = { .posed = &posed, .views = VIEWS };

    assert_int_equal(sst_posed_init(&posed, VIEWS), 0);
    posed.width = posed.height = SIDE;
    for (int k = 1; k < VIEWS - 1; k++) {
        posed.view[k].camera.known = true;
        posed.view[k].camera.position_mm[0] = 1000 * k;
    }
    scene.middle = calloc(VIEWS, sizeof(*scene.middle));
    assert_non_null(scene.middle);
    assert_int_equal(poses_scene_detect(&scene, levels_of, &scene, 2), 0);
    assert_int_equal(poses_scene_match(&scene, 2), 0);
    assert_int_equal(scene.pairs, 1);
    assert_int_equal(scene.pair[0].a, 0);
    assert_int_equal(scene.pair[0].b, VIEWS - 1);
    poses_scene_fini(&scene);
    sst_posed_fini(&posed);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(features_lie_on_spots),
        cmocka_unit_test(forest_is_placed),
        plain_test(rod_is_measured_along),
        plain_test(forest_is_placed_alike_by_any_threads),
        plain_test(compass_is_corrected),
        serial_test(poses_without_evidence),
        cmocka_unit_test(views_without_poses_have_neighbours),
    };

    if (!WITH_OPENCV) {
        printf("SKIP: built without OpenCV\n");
        return 77;
    }
    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
