/* pipeline/posed/ground.c and clear.c: a forest under ten cameras in a row, drawn by the test: a textured floor, leaves
 * in front that hide most of it, thermal levels of 16 bits; the ground is found, and the clear picture shows the floor.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/file.h"
#include "pipeline/posed/ground.h"
#include "pipeline/posed/picture.h"
#include "pipeline/posed/surface_internal.h"
#include "pipeline/posed/terrain.h"
#include "pipeline/posed/utm.h"
#include "tests/folder.h"
#include "tests/small.h"
#include "tests/test.h"

#define WIDTH                                                                                                          \
    (small_level() >= 2 ? 96                                                                                           \
     : small_level()    ? 160                                                                                          \
                        : 320) /* sanitizers take 3 (address) to 90 (thread) times as long                                \
                             */
#define HEIGHT (small_level() >= 2 ? 72 : small_level() ? 120 : 240)
#define VIEWS  10
#define FLOOR  30000.0 /* mm in front of the cameras */
#define LEAVES 20000.0
#define FOCAL  400.0

/* Random levels on a grid of `step` mm, bilinear. */
static double noise(double x_mm, double y_mm, double step, uint32_t seed)
{
    const double u = x_mm / step + 4000, v = y_mm / step + 4000;
    const int i = (int)u, j = (int)v;
    double level[4];

    for (int k = 0; k < 4; k++) {
        uint32_t h = (uint32_t)(i + k % 2) * 2654435761u ^ (uint32_t)(j + k / 2) * 2246822519u ^ seed * 3266489917u;

        h = (h ^ h >> 15) * 2246822519u;
        h = (h ^ h >> 13) * 3266489917u;
        level[k] = (h >> 8) / 16777216.0;
    }
    return (1 - (v - j)) * ((1 - (u - i)) * level[0] + (u - i) * level[1]) +
           (v - j) * ((1 - (u - i)) * level[2] + (u - i) * level[3]);
}

static double floor_level(double x_mm, double y_mm)
{
    return 20000 + 1500 * noise(x_mm, y_mm, 250, 1) + 1000 * noise(x_mm, y_mm, 900, 2);
}

/* Leaves cover the places where a coarse pattern is high. */
static bool leaf(double x_mm, double y_mm, double cover)
{
    return noise(x_mm, y_mm, 700, 3) > 1 - cover;
}

static double leaf_level(double x_mm, double y_mm)
{
    return 18000 + 2500 * noise(x_mm, y_mm, 160, 4);
}

/* Crowns from 18 to 27 m leave one place of the ground free. */
static bool crown(double *level, const double c[3], double a, double b)
{
    const double far = FLOOR - c[2];

    if (hypot(c[0] + a * far - 1000, c[1] + b * far - 1000) < 700)
        return false;
    for (int i = 0; i < 24; i++) {
        const double near = 18000 + 400 * i - c[2], x = c[0] + a * near, y = c[1] + b * near;

        if (noise(x, y, 700, (uint32_t)(30 + i)) > 0.75) {
            *level = 18000 + 2500 * noise(x, y, 160, (uint32_t)(60 + i));
            return true;
        }
    }
    return false;
}

/* Pictures of the forest as a folder; the camera's axes are the world's. @param slope  of the floor along y
 * @param cover  share of the leaves; 1: crowns @param apart  distances of the views, in usual ones */
static void make_apart(struct sst_posed *posed, const char *dir, double cover, double slope, double apart)
{
    const int width = WIDTH, height = HEIGHT;
    struct sst_outdir out;
    char folder[SST_PATH_MAX], path[SST_PATH_MAX];

    assert_int_equal(sst_posed_init(posed, VIEWS), 0);
    posed->width = width;
    posed->height = height;
    posed->channels = 1;
    posed->bits = 16;
    posed->metric = true;
    snprintf(posed->source, sizeof(posed->source), "test");
    assert_int_equal(sst_outdir_open(&out, dir, true), 0);
    assert_int_equal(sst_path_join(folder, out.temporary, "views"), 0);
    assert_int_equal(mkdir(folder, 0777), 0);
    for (int k = 0; k < VIEWS; k++) {
        struct sst_posed_view *v = &posed->view[k];
        struct sst_deep deep;

        snprintf(v->name, sizeof(v->name), "v%d.tif", k);
        snprintf(v->file, sizeof(v->file), "v%d.png", k);
        v->camera = (struct sst_calib_camera){ .known = true,
                                               .fx = FOCAL,
                                               .fy = FOCAL,
                                               .cx = (width - 1) / 2.0,
                                               .cy = (height - 1) / 2.0,
                                               .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 },
                                               .position_mm = { apart * 700 * (k - 4), apart * 60 * (k % 2),
                                                                apart * 50 * (k % 3) },
                                               .gain = { 1, 1, 1 } };
        assert_int_equal(sst_deep_init(&deep, width, height, 1, 65535), 0);
        for (int i = 0; i < width * height; i++) {
            const double a = (i % width - v->camera.cx) / FOCAL, b = (i / width - v->camera.cy) / FOCAL;
            const double *c = v->camera.position_mm, near = LEAVES - c[2];
            const double far = (FLOOR + slope * c[1] - c[2]) / (1 - slope * b);
            const double x = c[0] + a * near, y = c[1] + b * near;
            double level;

            if (cover < 1)
                level = leaf(x, y, cover) ? leaf_level(x, y) : floor_level(c[0] + a * far, c[1] + b * far);
            else if (!crown(&level, c, a, b))
                level = floor_level(c[0] + a * far, c[1] + b * far);
            sst_map_u16_row(&deep.plane[0], i / width)[i % width] = (uint16_t)level;
        }
        assert_int_equal(sst_path_join(path, folder, v->file), 0);
        assert_int_equal(sst_deep_write(&deep, path), 0);
        sst_deep_fini(&deep);
    }
    assert_int_equal(sst_posed_write(posed, out.temporary), 0);
    assert_int_equal(sst_outdir_end(&out, 0), 0);
    sst_posed_fini(posed);
    assert_int_equal(sst_posed_load(posed, dir), 0);
}

static void make_forest(struct sst_posed *posed, const char *dir, double cover, double slope)
{
    make_apart(posed, dir, cover, slope, 1);
}

/* Views of a drone that hovers over ground, open or half covered with leaves 10 m above it: the ground is found, also
 * where the leaves' peak is a few pixels of parallax away and hides its own; or nothing. */
static void hovering(void **state SST_UNUSED)
{
    static const struct {
        double apart, cover;
    } set[] = { { 0.3, 0 }, { 0.2, 0 }, { 0.1, 0 }, { 0.03, 0 }, { 0.3, 0.5 }, { 0.2, 0.5 }, { 0.1, 0.5 } };
    const struct sst_ground_config none = { 0 };
    struct sst_posed posed;
    struct sst_virtual camera;
    struct sst_posed_ground ground;

    for (size_t i = 0; i < ARRAY_LEN(set); i++) {
        int err;

        make_apart(&posed, test_path("hover.lf"), set[i].cover, 0, set[i].apart);
        camera = sst_virtual_of_view(&posed, 4);
        err = sst_posed_ground(&ground, &posed, test_path("hover.lf"), &camera, &none);
        if (small_level() ? err && err != -ENODATA : err != (set[i].apart < 0.05 ? -ENODATA : 0))
            fail_msg("%.2f apart: error %d", set[i].apart, err);
        if (!small_level() && !err && fabs(ground.distance_mm - FLOOR) > 500)
            fail_msg("%.2f apart, %.1f covered: ground at %.0f mm", set[i].apart, set[i].cover, ground.distance_mm);
        sst_posed_fini(&posed);
    }
}

/* Ground of which ten views see one place through crowns of all heights. */
static void ground_is_below_dense_crowns(void **state SST_UNUSED)
{
    const struct sst_ground_config cfg = { .near_mm = 15000, .far_mm = 45000, .threads = 2 };
    struct sst_posed posed;
    struct sst_virtual camera;
    struct sst_posed_ground ground;

    if (small_level())
        skip(); /* the place has no patches in pictures of 160 px */
    make_forest(&posed, test_path("crowns.lf"), 1, 0);
    camera = sst_virtual_of_view(&posed, 4);
    assert_int_equal(sst_posed_ground(&ground, &posed, test_path("crowns.lf"), &camera, &cfg), 0);
    if (fabs(ground.distance_mm - (FLOOR - camera.centre_mm[2])) > 400 || ground.tilt_deg > 0.01)
        fail_msg("ground at %.0f mm, tilted by %.2f degrees", ground.distance_mm, ground.tilt_deg);
    sst_posed_fini(&posed);
}

static void ground_is_behind_the_leaves(void **state SST_UNUSED)
{
    const struct sst_ground_config cfg = { .near_mm = 15000, .far_mm = 40000, .threads = 2 };
    struct sst_ground_config none = { 0 };
    struct sst_posed posed;
    struct sst_virtual camera;
    struct sst_posed_ground ground;

    make_forest(&posed, test_path("forest.lf"), 0.55, 0);
    camera = sst_virtual_of_view(&posed, 4);
    assert_int_equal(sst_posed_ground(&ground, &posed, test_path("forest.lf"), &camera, &cfg), 0);
    if (fabs(ground.distance_mm - (FLOOR - camera.centre_mm[2])) > 300 || ground.tilt_deg > (small_level() ? 4 : 1))
        fail_msg("ground at %.0f mm, tilted by %.2f degrees", ground.distance_mm, ground.tilt_deg);
    /* Without limits and points: by the distances of the views. */
    assert_int_equal(sst_posed_ground(&ground, &posed, test_path("forest.lf"), &camera, &none), 0);
    if (fabs(ground.distance_mm - (FLOOR - camera.centre_mm[2])) > 300 || ground.tilt_deg > (small_level() ? 4 : 1))
        fail_msg("by default: ground at %.0f mm, tilted by %.2f degrees", ground.distance_mm, ground.tilt_deg);
    for (int k = 0; k < posed.count; k++)
        posed.view[k].camera.known = k >= 2 && k <= 6 && k % 2 == 0;
    assert_int_equal(sst_posed_ground(&ground, &posed, test_path("forest.lf"), &camera, &cfg), 0);
    /* A pixel of parallax is 0.8 m there. */
    if (ground.views != 3 || fabs(ground.distance_mm - (FLOOR - camera.centre_mm[2])) > (small_level() ? 750 : 300))
        fail_msg("by %d views: ground at %.0f mm", ground.views, ground.distance_mm);
    for (int k = 0; k < posed.count; k++)
        posed.view[k].camera.known = true;
    for (int k = 0; k < posed.count; k++)
        memcpy(posed.view[k].camera.position_mm, camera.centre_mm, sizeof(camera.centre_mm));
    assert_int_equal(sst_posed_ground(&ground, &posed, test_path("forest.lf"), &camera, &none), -EINVAL);
    sst_posed_fini(&posed);
}

/* A slope under trees: its tilt is found, which places where views happen to agree hardly tell; not in pictures of 160
 * px and less. */
static void slopes_are_found(void **state SST_UNUSED)
{
    const struct sst_ground_config cfg = { .near_mm = 15000, .far_mm = 40000, .threads = 2 };
    const double slope = 0.15;
    struct sst_posed posed;
    struct sst_virtual camera;
    struct sst_posed_ground ground, threaded;

    make_forest(&posed, test_path("slope.lf"), 0.35, slope);
    camera = sst_virtual_of_view(&posed, 4);
    assert_int_equal(sst_posed_ground(&ground, &posed, test_path("slope.lf"), &camera, &cfg), 0);
    if (!small_level() && fabs(ground.tilt_deg - atan(slope) * 180 / M_PI) > 2)
        fail_msg("tilted by %.2f degrees", ground.tilt_deg);
    for (int y = 0; y < HEIGHT; y += HEIGHT - 1) {
        const double b = (y - camera.cy) / FOCAL,
                     far = (FLOOR + slope * camera.centre_mm[1] - camera.centre_mm[2]) / (1 - slope * b);
        double ray[3], found;

        sst_virtual_ray(&camera, camera.cx, y, ray);
        found = sst_surface_meet(&ground.plane, camera.centre_mm, ray);
        if (!small_level() && fabs(found - far) > 0.01 * far)
            fail_msg("row %d: ground at %.0f mm in place of %.0f", y, found, far);
    }
    assert_int_equal(sst_posed_ground(&threaded, &posed, test_path("slope.lf"), &camera,
                                      &(struct sst_ground_config){ .near_mm = 15000, .far_mm = 40000, .threads = 1 }),
                     0);
    assert_memory_equal(threaded.plane.normal, ground.plane.normal, sizeof(ground.plane.normal));
    assert_true(threaded.distance_mm == ground.distance_mm);
    sst_posed_fini(&posed);
}

/* Terrain of UTM in the axes of a light field: each sample where its longitude and latitude are. */
static void terrain_of_utm_is_in_the_axes_of_the_light_field(void **state SST_UNUSED)
{
    const struct sst_utm utm = { 33, false };
    struct sst_posed posed = {
        .geographic = true, .latitude = 48.3, .longitude = 14.3, .altitude_m = 400, .up = { 0, 0, 1 }
    };
    struct sst_heights h = { .x_mm = 447.2e6, .y_mm = 5350.9e6, .step_x_mm = 1e6, .step_y_mm = -1e6, .epsg = 32633 };
    struct sst_surface surface;
    bool placed;

    assert_int_equal(sst_map_f32_init(&h.mm, 3, 3), 0);
    for (int i = 0; i < 9; i++)
        sst_map_f32_row(&h.mm, i / 3)[i % 3] = (float)(450000 + 1000 * i);
    assert_int_equal(sst_terrain_place(&h, &placed, &posed, NULL, "dem.tif"), 0);
    assert_true(placed && fabs(h.turn_rad) > 0.005);
    assert_int_equal(sst_surface_terrain(&surface, &h, posed.up), 0);
    for (int i = 0; i < 9; i++) {
        const double xy[2] = { 447200 + 1000 * (i % 3), 5350900 - 1000 * (i / 3) };
        const double u = h.x_mm + h.step_x_mm * (i % 3), v = h.y_mm + h.step_y_mm * (i / 3);
        double at[3], longitude, latitude;
        struct sst_earth origin, place;

        sst_utm_to_degrees(&longitude, &latitude, &utm, xy);
        sst_earth_at(&origin, posed.longitude, posed.latitude, posed.altitude_m);
        sst_earth_at(&place, longitude, latitude, 450 + i);
        sst_earth_from(&origin, &place, at);
        for (int k = 0; k < 2; k++) {
            if (fabs(surface.along[0][k] * u + surface.along[1][k] * v - at[k] * 1000) > 200)
                fail_msg("sample %d: axis %d is off by %.0f mm", i, k,
                         surface.along[0][k] * u + surface.along[1][k] * v - at[k] * 1000);
        }
        assert_true(fabs((double)sst_map_f32_row(&h.mm, i / 3)[i % 3] - at[2] * 1000) < 10);
    }
    h.x_mm = 447.2e6;
    assert_int_equal(sst_terrain_place(&h, &placed, &posed, "61N", "dem.tif"), -EINVAL);
    assert_int_equal(sst_terrain_place(&h, &placed, &posed, "10S", "dem.tif"), -EBADMSG);
    h.epsg = 31468;
    assert_int_equal(sst_terrain_place(&h, &placed, &posed, NULL, "dem.tif"), -EBADMSG);
    h.epsg = 0;
    assert_int_equal(sst_terrain_place(&h, &placed, &posed, NULL, "dem.tif"), -EBADMSG);
    posed.geographic = false;
    assert_int_equal(sst_terrain_place(&h, &placed, &posed, "33N", "dem.tif"), -EBADMSG);
    sst_heights_fini(&h);
}

/* Mean difference from the floor where the picture has rays; share of such pixels. */
static double difference(const struct sst_posed_rendered *made, const struct sst_virtual *camera, double *share)
{
    const int width = camera->width, height = camera->height;
    const double far = FLOOR - camera->centre_mm[2];
    double sum = 0;
    int n = 0;

    for (int i = 0; i < width * height; i++) {
        const double a = (i % width - camera->cx) / FOCAL, b = (i / width - camera->cy) / FOCAL;

        if (!sst_map_u16_row(&made->views, i / width)[i % width])
            continue;
        sum += fabs((double)sst_map_f32_row(&made->mean[0], i / width)[i % width] -
                    floor_level(camera->centre_mm[0] + a * far, camera->centre_mm[1] + b * far));
        n++;
    }
    *share = (double)n / (width * height);
    return n ? sum / n : INFINITY;
}

static void clear_pictures_show_the_floor(void **state SST_UNUSED)
{
    struct sst_posed_render_config cfg = { .threads = 2 };
    const int width = WIDTH, height = HEIGHT;
    double off[3], share[3];
    struct sst_posed posed;

    make_forest(&posed, test_path("clear.lf"), 0.45, 0);
    cfg.camera = sst_virtual_of_view(&posed, 4);
    cfg.surface = sst_surface_plane((const double[3]){ 0, 0, -1 }, (const double[3]){ 0, 0, FLOOR });
    for (int m = 0; m < 3; m++) {
        struct sst_posed_rendered made;

        cfg.method = (enum sst_posed_method)m;
        assert_int_equal(sst_posed_render(&made, &posed, test_path("clear.lf"), &cfg), 0);
        off[m] = difference(&made, &cfg.camera, &share[m]);
        for (int i = 0; i < width * height; i++) /* levels are dimmed there, means are of rays alone */
            assert_int_equal(isnan(sst_map_f32_row(&made.mean[0], i / width)[i % width]),
                             !sst_map_u16_row(&made.views, i / width)[i % width]);
        sst_posed_rendered_fini(&made);
    }
    /* Floor and leaves differ by 1500 levels on average, and leaves cover almost half of the rays. */
    if (!(off[1] < 0.75 * off[0] && off[2] < 0.35 * off[0] && share[2] > 0.45 && share[0] > 0.999))
        fail_msg("levels off: refocus %.0f, see-through %.0f, clear %.0f of %.2f of the pixels", off[0], off[1], off[2],
                 share[2]);
    for (int k = 2; k < VIEWS; k++)
        posed.view[k].camera.known = false;
    assert_int_equal(sst_posed_render(&(struct sst_posed_rendered){ 0 }, &posed, test_path("clear.lf"), &cfg),
                     -ENODATA);
    sst_posed_fini(&posed);
}

/* Regions up to half of a window go, larger ones, and dots at the border of the picture, stay. */
static void specks_and_dots_go(void **state SST_UNUSED)
{
    enum { SIDE = 24 };
    static const struct {
        int x, y, width, height;
        float rays, want;
    } part[] = {
        { 1, 1, 2, 4, 5, 0 },     /* a speck of 8 px, half of a window of 4x4 */
        { 5, 1, 3, 3, 5, 5 },     /* 9 px */
        { 12, 12, 12, 12, 5, 5 }, /* a surface at the border, with */
        { 14, 14, 2, 2, 0, 2 },   /* a dot, */
        { 18, 14, 3, 3, 0, 0 },   /* a hole, */
        { 14, 18, 3, 3, 0, 2 },   /* a saturated one, and */
        { 23, 20, 1, 2, 0, 0 },   /* a dot at the border */
    };
    struct sst_map_f32 rays;
    struct sst_deep levels;

    assert_int_equal(sst_map_f32_init(&rays, SIDE, SIDE), 0);
    assert_int_equal(sst_deep_init(&levels, SIDE, SIDE, 1, 255), 0);
    for (int i = 0; i < 9; i++)
        sst_map_u16_row(&levels.plane[0], 18 + i / 3)[14 + i % 3] = 230;
    for (size_t i = 0; i < ARRAY_LEN(part); i++) {
        for (int k = 0; k < part[i].width * part[i].height; k++)
            sst_map_f32_row(&rays, part[i].y + k / part[i].width)[part[i].x + k % part[i].width] = part[i].rays;
    }
    assert_int_equal(specks_remove(&rays, &levels, (const float[2]){ 0.8f, 2 }, 4), 0);
    for (size_t i = 0; i < ARRAY_LEN(part); i++) {
        const float got = sst_map_f32_row(&rays, part[i].y)[part[i].x];

        if (got != part[i].want)
            fail_msg("part %zu: %.1f rays", i, (double)got);
    }
    sst_deep_fini(&levels);
    sst_map_f32_fini(&rays);
}

/* Of views beyond a third of a picture the nearest ones, in whatever order they are stored; within it evenly. */
static void the_nearest_views_are_chosen(void **state SST_UNUSED)
{
    static const double apart_mm[] = { 900, 800, 0, 700, 30, 600, 20, 500 };
    const struct sst_virtual camera = { .width = WIDTH, .height = HEIGHT, .fx = FOCAL };
    struct sst_posed posed;
    int view[4];

    assert_int_equal(sst_posed_init(&posed, 8), 0);
    for (int k = 0; k < 8; k++)
        posed.view[k].camera = (struct sst_calib_camera){ .known = k != 4, .position_mm = { apart_mm[k] } };
    assert_int_equal(greys_choose(view, 3, &posed, &camera, 100), 3); /* within 21 mm there are two */
    assert_memory_equal(view, ((const int[]){ 2, 6, 7 }), 3 * sizeof(*view));
    assert_int_equal(greys_choose(view, 3, &posed, &camera, 1e5), 3);
    assert_memory_equal(view, ((const int[]){ 2, 7, 3 }), 3 * sizeof(*view));
    sst_posed_fini(&posed);
}

/* Sides that the kernel cannot read are refused before pictures are; grey ones of narrow strips stay wide enough. */
static void sides_are_checked(void **state SST_UNUSED)
{
    static const int size[][2] = { { 1, 100 }, { 100, 1 }, { SST_IMAGE_MAX_SIDE, 2 } };
    const struct sst_ground_config ground = { .near_mm = 15000, .far_mm = 40000 };
    struct sst_posed_render_config cfg = { .threads = 1 };
    struct sst_posed posed;

    assert_int_equal(sst_posed_init(&posed, 3), 0);
    posed.channels = 1;
    for (int k = 0; k < 3; k++)
        posed.view[k].camera =
            (struct sst_calib_camera){ .known = true, .fx = 1, .fy = 1, .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 } };
    for (size_t i = 0; i < ARRAY_LEN(size); i++) {
        posed.width = size[i][0];
        posed.height = size[i][1];
        cfg.camera = sst_virtual_of_view(&posed, 1);
        cfg.surface = sst_surface_plane((const double[3]){ 0, 0, -1 }, (const double[3]){ 0, 0, FLOOR });
        for (int m = 0; m < 3; m++) {
            cfg.method = (enum sst_posed_method)m;
            assert_int_equal(sst_posed_render(&(struct sst_posed_rendered){ 0 }, &posed, "gone", &cfg), -EBADMSG);
        }
        assert_int_equal(sst_posed_ground(&(struct sst_posed_ground){ 0 }, &posed, "gone", &cfg.camera, &ground),
                         -EBADMSG);
    }
    posed.width = 5000;
    posed.height = 15;
    assert_int_equal(greys_step(&posed, 10), 1);
    posed.height = 4000;
    assert_int_equal(greys_step(&posed, 10), 10);
    sst_posed_fini(&posed);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        serial_test(ground_is_behind_the_leaves),
        serial_test(slopes_are_found),
        cmocka_unit_test(ground_is_below_dense_crowns),
        cmocka_unit_test(terrain_of_utm_is_in_the_axes_of_the_light_field),
        cmocka_unit_test(clear_pictures_show_the_floor),
        cmocka_unit_test(hovering),
        cmocka_unit_test(specks_and_dots_go),
        cmocka_unit_test(the_nearest_views_are_chosen),
        cmocka_unit_test(sides_are_checked),
    };

    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
