/* pipeline/posed/integral.c and surface.c: a drawn world of one textured surface under ten tilted cameras with lenses;
 * the integral on the surface is its texture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "pipeline/posed/integral.h"
#include "tests/render_views.h"
#include "tests/small.h"
#include "tests/test.h"

#define WIDTH  160
#define HEIGHT 120
#define VIEWS  10
#define GROUND 20000.0 /* mm below the cameras */

/* Texture of a place, levels 1000 to 61000: waves of 1.5 and 1.1 m, 15 and 11 px and more. */
static double texture(double x_mm, double y_mm, int channel)
{
    return 31000 + 15000 * sin(x_mm / 1500 * 2 * M_PI + channel) + 15000 * cos((y_mm + 0.3 * x_mm) / 1100 * 2 * M_PI);
}

/* Heights of the terrain above z = 0, mm: hills of 1 m, 9 m wide. */
static double hill(double x_mm, double y_mm)
{
    return 1000 * sin(x_mm / 9000 * 2 * M_PI) * cos(y_mm / 7000 * 2 * M_PI);
}

/* The world: z upwards, cameras look down. Where a ray from the camera's centre meets the surface. */
enum world { FLAT, TILTED, TERRAIN };

static double height_at(enum world world, double x, double y)
{
    return world == TILTED ? 0.2 * x - 0.1 * y : world == TERRAIN ? hill(x, y) : 0;
}

static void meet(enum world world, const double from[3], const double ray[3], double at[3])
{
    double lo = 0, hi = 2 * GROUND / -ray[2];

    for (int i = 0; i < 60; i++) {
        const double t = (lo + hi) / 2;

        for (int k = 0; k < 3; k++)
            at[k] = from[k] + t * ray[k];
        *(at[2] > height_at(world, at[0], at[1]) ? &lo : &hi) = t;
    }
}

/* Ten cameras in a row, half a metre apart, heights and tilts unequal, with a lens each. */
static struct sst_calib_camera camera(int k)
{
    struct sst_calib_camera cam = { .known = true,
                                    .fx = 200,
                                    .fy = 201,
                                    .cx = 80.3,
                                    .cy = 59.1,
                                    .lens = 5,
                                    .k = { -0.05 - 0.01 * k, 0.02, 0.001, -0.0005, 0 },
                                    .position_mm = { 500.0 * (k - 4), 40.0 * (k % 3), GROUND + 100.0 * (k % 4) } };
    const double turn[3] = { 0.03 * sin(k), 0.02 * cos(2 * k), 0.05 * sin(3 * k) };
    const double down[9] = { 1, 0, 0, 0, -1, 0, 0, 0, -1 };
    double tilt[9];

    sst_rotation_from_vector(turn, tilt);
    for (int i = 0; i < 9; i++) {
        for (int m = 0; m < 3; m++)
            cam.rotation[i] += tilt[i / 3 * 3 + m] * down[m * 3 + i % 3];
    }
    return cam;
}

static void draw(struct sst_deep *out, enum world world, const struct sst_calib_camera *cam, int channels)
{
    assert_int_equal(sst_deep_init(out, WIDTH, HEIGHT, channels, 65535), 0);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double a, b, ray[3], at[3];

        assert_true(sst_camera_undistort(cam, i % WIDTH, i / WIDTH, &a, &b));
        for (int k = 0; k < 3; k++)
            ray[k] = cam->rotation[k] * a + cam->rotation[3 + k] * b + cam->rotation[6 + k];
        meet(world, cam->position_mm, ray, at);
        for (int c = 0; c < channels; c++)
            sst_map_u16_row(&out->plane[c], i / WIDTH)[i % WIDTH] = (uint16_t)lround(texture(at[0], at[1], c));
    }
}

struct scene {
    struct sst_calib_camera camera[VIEWS];
    struct sst_deep picture[VIEWS];
    const struct sst_calib_camera *cameras[VIEWS];
    const struct sst_deep *pictures[VIEWS];
    struct sst_virtual from; /* of view 4 */
};

static void make_scene(struct scene *s, enum world world, int channels)
{
    struct sst_posed posed = { .width = WIDTH, .height = HEIGHT };

    for (int k = 0; k < VIEWS; k++) {
        s->camera[k] = camera(k);
        draw(&s->picture[k], world, &s->camera[k], channels);
        s->cameras[k] = &s->camera[k];
        s->pictures[k] = &s->picture[k];
    }
    posed.view = &(struct sst_posed_view){ .camera = s->camera[4] };
    s->from = sst_virtual_of_view(&posed, 0);
}

static void free_scene(struct scene *s)
{
    for (int k = 0; k < VIEWS; k++)
        sst_deep_fini(&s->picture[k]);
}

static struct sst_surface flat(double tilt_x, double tilt_y)
{
    return sst_surface_plane((const double[3]){ -tilt_x, -tilt_y, 1 }, (const double[3]){ 0, 0, 0 });
}

/* The largest difference from the texture where at least `least` views see the surface. */
static double worst(const struct scene *s, enum world world, const struct sst_surface *surface, int least)
{
    struct sst_integral *integral;
    struct sst_map_f32 mean;
    struct sst_map_u16 views;
    double most = 0;
    int seen = 0;

    assert_int_equal(sst_integral_create(&integral, &s->from, surface, s->picture[0].channels, 2), 0);
    assert_int_equal(sst_integral_add(integral, s->cameras, s->pictures, VIEWS), 0);
    assert_int_equal(sst_integral_views(&views, integral), 0);
    for (int c = 0; c < s->picture[0].channels; c++) {
        assert_int_equal(sst_integral_means(&mean, integral, c), 0);
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            const int x = i % WIDTH, y = i / WIDTH, n = sst_map_u16_row(&views, y)[x];
            double ray[3], at[3];

            assert_int_equal(n == 0, isnan(sst_map_f32_row(&mean, y)[x]));
            if (n < least)
                continue;
            sst_virtual_ray(&s->from, x, y, ray);
            meet(world, s->from.centre_mm, ray, at);
            most = fmax(most, fabs((double)sst_map_f32_row(&mean, y)[x] - texture(at[0], at[1], c)));
            seen++;
        }
        sst_map_f32_fini(&mean);
    }
    assert_true(seen > WIDTH * HEIGHT / 2);
    sst_map_u16_fini(&views);
    sst_integral_destroy(integral);
    return most;
}

/* Bilinear interpolation of waves of 11 and 15 px errs by at most 15000 (pi / 11)^2 / 2 and (pi / 15)^2 / 2; of the
 * mean over views with other phases, less. 0.05 px of the steepest slope are 0.05 2 pi 15000 / 11. */
#define ERROR                                                                                                          \
    (15000 * (M_PI / 11 * M_PI / 11 + M_PI / 15 * M_PI / 15) / 2 + 0.05 * 2 * M_PI * 15000 * (1 / 11.0 + 1 / 15.0))

static void planes_show_their_texture(void **state SST_UNUSED)
{
    struct scene s;
    struct sst_surface surface = flat(0, 0), wrong;

    make_scene(&s, FLAT, 3);
    assert_true(worst(&s, FLAT, &surface, 1) < ERROR);
    wrong = sst_surface_moved(&surface, 1000);
    assert_true(worst(&s, FLAT, &wrong, 5) > 3 * ERROR);
    free_scene(&s);
    surface = flat(0.2, -0.1);
    make_scene(&s, TILTED, 1);
    assert_true(worst(&s, TILTED, &surface, 1) < ERROR);
    free_scene(&s);
}

static void make_hills(struct sst_heights *heights)
{
    *heights = (struct sst_heights){ -20000, 15000, 100, -100, { 0 } };
    assert_int_equal(sst_map_f32_init(&heights->mm, 400, 300), 0);
    for (int i = 0; i < 400 * 300; i++)
        sst_map_f32_row(&heights->mm, i / 400)[i % 400] =
            (float)hill(-20000 + 100.0 * (i % 400), 15000 - 100.0 * (i / 400));
}

static void terrain_shows_its_texture(void **state SST_UNUSED)
{
    const double up[3] = { 0, 0, 1 };
    struct sst_heights heights;
    struct sst_surface surface;
    struct scene s;

    make_hills(&heights);
    assert_int_equal(sst_surface_terrain(&surface, &heights, up), 0);
    make_scene(&s, TERRAIN, 1);
    assert_true(worst(&s, TERRAIN, &surface, 1) < ERROR);
    free_scene(&s);
    sst_map_f32_fini(&heights.mm);
}

static void rays_meet_surfaces(void **state SST_UNUSED)
{
    const double origin[3] = { 0, 0, 5000 }, down[3] = { 0.3, 0.2, -1 }, up[3] = { 0, 0, 1 }, level[3] = { 1, 0, 0 };
    struct sst_heights heights;
    struct sst_surface surface = flat(0, 0), moved = sst_surface_moved(&surface, 1000);
    double t;

    assert_near(sst_surface_meet(&surface, origin, down), 5000, 1e-9);
    assert_near(sst_surface_meet(&moved, origin, down), 4000, 1e-9);
    assert_true(isinf(sst_surface_meet(&surface, origin, up)));
    assert_true(isinf(sst_surface_meet(&surface, origin, level)));
    assert_false(sst_surface_plane_of(&surface, (const double[3][3]){ { 0 }, { 1, 1, 1 }, { 2, 2, 2 } }, origin));
    assert_true(
        sst_surface_plane_of(&surface, (const double[3][3]){ { 0 }, { 1000, 0, 0 }, { 0, 1000, 100 } }, origin));
    assert_true(surface.normal[2] > 0.9);
    assert_near(sst_surface_meet(&surface, origin, (const double[3]){ 0, 1, -1 }), 5000 / 1.1, 1e-6);
    make_hills(&heights);
    assert_int_equal(sst_surface_terrain(&surface, &heights, up), 0);
    t = sst_surface_meet(&surface, origin, down);
    assert_near(5000 - t, hill(0.3 * t, 0.2 * t), 3); /* mm: hills are bilinear between samples */
    moved = sst_surface_moved(&surface, -2000);
    t = sst_surface_meet(&moved, origin, down);
    assert_near(5000 - t, hill(0.3 * t, 0.2 * t) - 2000, 3);
    assert_true(isinf(sst_surface_meet(&surface, (const double[3]){ 90000, 0, 5000 }, (const double[3]){ 0, 0, -1 })));
    for (int i = 0; i < 400 * 300; i++)
        sst_map_f32_row(&heights.mm, i / 400)[i % 400] = i % 400 < 200 ? NAN : 0;
    assert_int_equal(sst_surface_terrain(&surface, &heights, up), 0);
    assert_true(isinf(sst_surface_meet(&surface, (const double[3]){ -3000, 0, 5000 }, (const double[3]){ 0, 0, -1 })));
    assert_near(sst_surface_meet(&surface, (const double[3]){ 3000, 0, 5000 }, (const double[3]){ 0, 0, -1 }), 5000,
                1e-3);
    for (int i = 0; i < 400 * 300; i++)
        sst_map_f32_row(&heights.mm, i / 400)[i % 400] = NAN;
    assert_int_equal(sst_surface_terrain(&surface, &heights, up), -EINVAL);
    sst_map_f32_fini(&heights.mm);
}

static int total_views(const struct scene *s, const struct sst_surface *surface)
{
    struct sst_integral *integral;
    struct sst_map_u16 views;
    int total = 0;

    assert_int_equal(sst_integral_create(&integral, &s->from, surface, 1, 1), 0);
    assert_int_equal(sst_integral_add(integral, s->cameras, s->pictures, VIEWS), 0);
    assert_int_equal(sst_integral_views(&views, integral), 0);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        total += sst_map_u16_row(&views, i / WIDTH)[i % WIDTH];
    sst_map_u16_fini(&views);
    sst_integral_destroy(integral);
    return total;
}

/* A view that looks away, a surface behind all, beside all, or through a camera. */
static void views_that_see_nothing(void **state SST_UNUSED)
{
    struct sst_surface surface = flat(0, 0);
    struct sst_heights heights;
    struct scene s;
    int all;

    make_scene(&s, FLAT, 1);
    all = total_views(&s, &surface);
    for (int i = 0; i < 6; i++)
        s.camera[7].rotation[3 + i] = -s.camera[7].rotation[3 + i];
    assert_true(total_views(&s, &surface) < all);
    assert_true(total_views(&s, &surface) > all * 8 / 10);
    surface = sst_surface_moved(&surface, 3 * GROUND);
    assert_int_equal(total_views(&s, &surface), 0);
    make_hills(&heights);
    heights.x_mm += 1e6;
    assert_int_equal(sst_surface_terrain(&surface, &heights, (const double[3]){ 0, 0, 1 }), 0);
    assert_int_equal(total_views(&s, &surface), 0);
    sst_map_f32_fini(&heights.mm);
    surface = sst_surface_plane((const double[3]){ 1, 0, 0.1 }, s.camera[4].position_mm);
    assert_int_equal(total_views(&s, &surface), 0);
    free_scene(&s);
}

/* One view without a lens from its own place is its picture, every pixel. */
static void one_view_is_itself(void **state SST_UNUSED)
{
    const struct sst_surface surface = flat(0.1, 0.3);
    struct sst_posed posed = { .width = WIDTH, .height = HEIGHT };
    struct sst_calib_camera cam = camera(3);
    const struct sst_calib_camera *cams[1] = { &cam };
    struct sst_integral *integral;
    struct sst_deep picture, out;
    struct sst_virtual from;

    cam.lens = 0;
    memset(cam.k, 0, sizeof(cam.k));
    posed.view = &(struct sst_posed_view){ .camera = cam };
    from = sst_virtual_of_view(&posed, 0);
    draw(&picture, FLAT, &cam, 3);
    assert_int_equal(sst_integral_create(&integral, &from, &surface, 3, 1), 0);
    assert_int_equal(sst_integral_add(integral, cams, (const struct sst_deep *const[]){ &picture }, 1), 0);
    assert_int_equal(sst_integral_levels(&out, integral), 0);
    for (int i = 0; i < 3 * HEIGHT; i++)
        assert_memory_equal(sst_map_u16_row(&out.plane[i / HEIGHT], i % HEIGHT),
                            sst_map_u16_row(&picture.plane[i / HEIGHT], i % HEIGHT), WIDTH * sizeof(uint16_t));
    sst_integral_destroy(integral);
    sst_deep_fini(&picture);
    sst_deep_fini(&out);
}

static void threads_give_the_same_bytes(void **state SST_UNUSED)
{
    const struct sst_surface surface = flat(0.05, 0.02);
    struct sst_deep out[3];
    struct scene s;

    make_scene(&s, FLAT, 1);
    for (int t = 0; t < 3; t++) {
        struct sst_integral *integral;

        assert_int_equal(sst_integral_create(&integral, &s.from, &surface, 1, (const int[]){ 1, 3, 8 }[t]), 0);
        for (int k = 0; k < VIEWS; k++) { /* in another order */
            const int view = t == 1 ? VIEWS - 1 - k : k;

            assert_int_equal(sst_integral_add(integral, s.cameras + view, s.pictures + view, 1), 0);
        }
        assert_int_equal(sst_integral_levels(&out[t], integral), 0);
        sst_integral_destroy(integral);
    }
    for (int y = 0; y < 2 * HEIGHT; y++)
        assert_memory_equal(sst_map_u16_row(&out[0].plane[0], y % HEIGHT),
                            sst_map_u16_row(&out[1 + y / HEIGHT].plane[0], y % HEIGHT), WIDTH * sizeof(uint16_t));
    for (int t = 0; t < 3; t++)
        sst_deep_fini(&out[t]);
    free_scene(&s);
}

/* 3x3 views on a lattice 100 mm apart, 50 px of focal length: at 1.3 px per spacing the lattice's renderer and the
 * integral on the plane at 50 * 100 / 1.3 mm agree within half a level and its rounding. */
static void lattice_equals_its_renderer(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(1.3);
    const struct sst_surface surface =
        sst_surface_plane((const double[3]){ 0, 0, -1 }, (const double[3]){ 0, 0, 50 * 100 / 1.3 });
    struct sst_calib_camera camera[9];
    struct sst_deep picture[9];
    struct sst_lightfield lf;
    struct sst_image want;
    struct sst_integral *integral;
    struct sst_map_f32 mean;
    struct sst_virtual from = { 41, 29, 50, 50, 20, 14, { 1, 0, 0, 0, 1, 0, 0, 0, 1 }, { 0, 0, 0 } };

    make_random(&lf);
    cfg.method = SST_RENDER_REFOCUS;
    assert_int_equal(render(&lf, &cfg, &want, NULL), 0);
    assert_int_equal(sst_integral_create(&integral, &from, &surface, 3, 1), 0);
    for (int k = 0; k < 9; k++) {
        const struct sst_calib_camera *cams[1] = { &camera[k] };
        const struct sst_deep *pictures[1] = { &picture[k] };

        if (!lf.views[k].present)
            continue;
        camera[k] = (struct sst_calib_camera){ .known = true, .fx = 50, .fy = 50, .cx = 20, .cy = 14 };
        memcpy(camera[k].rotation, from.rotation, sizeof(from.rotation));
        camera[k].position_mm[0] = 100 * lf.views[k].bx;
        camera[k].position_mm[1] = 100 * lf.views[k].by;
        assert_int_equal(sst_deep_init(&picture[k], 41, 29, 3, 255), 0);
        for (int i = 0; i < 3 * 41 * 29; i++)
            sst_map_u16_row(&picture[k].plane[i % 3], i / 3 / 41)[i / 3 % 41] =
                sst_image_row(&lf.views[k].image, i % 3, i / 3 / 41)[i / 3 % 41];
        assert_int_equal(sst_integral_add(integral, cams, pictures, 1), 0);
        sst_deep_fini(&picture[k]);
    }
    for (int c = 0; c < 3; c++) {
        assert_int_equal(sst_integral_means(&mean, integral, c), 0);
        for (int y = 2; y < 27; y++) {
            for (int x = 2; x < 39; x++)
                assert_near((double)sst_map_f32_row(&mean, y)[x], sst_image_row(&want, c, y)[x], 1);
        }
        sst_map_f32_fini(&mean);
    }
    sst_integral_destroy(integral);
    sst_image_fini(&want);
    free_views(&lf);
}

static void refuses_other_pictures(void **state SST_UNUSED)
{
    const struct sst_surface surface = flat(0, 0);
    struct sst_posed posed = { .count = 1, .view = &(struct sst_posed_view){ .camera = { .known = false } } };
    struct sst_integral *integral;
    struct scene s;

    make_scene(&s, FLAT, 1);
    assert_int_equal(sst_integral_create(&integral, &s.from, &surface, 2, 1), -EINVAL);
    assert_int_equal(sst_integral_create(&integral, &s.from, &surface, 3, 1), 0);
    assert_int_equal(sst_integral_add(integral, s.cameras, s.pictures, 1), -EINVAL);
    assert_int_equal(sst_integral_add_all(integral, &posed, "nowhere"), -ENODATA);
    sst_integral_destroy(integral);
    sst_integral_destroy(NULL);
    free_scene(&s);
}

/* Places that are kept give the bytes of computed ones, set after set. */
static void kept_places_give_the_same_bytes(void **state SST_UNUSED)
{
    static const int view[VIEWS] = { 0, 1, 2, 3, 4, 5, 6, 7, 8, 9 };
    const struct sst_surface surface = flat(0.2, -0.1);
    struct sst_posed posed = { .count = VIEWS, .width = WIDTH, .height = HEIGHT };
    struct sst_posed_view views[VIEWS] = { 0 };
    struct sst_integral_places *places;
    struct sst_integral *integral[2];
    struct scene s;

    make_scene(&s, TILTED, 3);
    for (int k = 0; k < VIEWS; k++)
        views[k].camera = s.camera[k];
    posed.view = views;
    assert_int_equal(sst_integral_places_create(&places, &s.from, &surface, &posed, 2), 0);
    for (int i = 0; i < 2; i++)
        assert_int_equal(sst_integral_create(&integral[i], &s.from, &surface, 3, 1 + i), 0);
    for (int set = 0; set < 2; set++) {
        struct sst_deep got, want;

        for (int i = 0; i < 2; i++)
            sst_integral_restart(integral[i], NULL);
        assert_int_equal(sst_integral_add(integral[0], s.cameras + set, s.pictures + set, VIEWS - set), 0);
        assert_int_equal(sst_integral_add_at(integral[1], places, view + set, s.pictures + set, VIEWS - set), 0);
        assert_int_equal(sst_integral_levels(&want, integral[0]), 0);
        assert_int_equal(sst_integral_levels(&got, integral[1]), 0);
        for (int c = 0; c < 3; c++) {
            for (int y = 0; y < HEIGHT; y++)
                assert_memory_equal(sst_map_u16_row(&got.plane[c], y), sst_map_u16_row(&want.plane[c], y), WIDTH * 2);
        }
        sst_deep_fini(&got);
        sst_deep_fini(&want);
    }
    sst_integral_places_destroy(places);
    sst_integral_places_destroy(NULL);
    for (int i = 0; i < 2; i++)
        sst_integral_destroy(integral[i]);
    free_scene(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(planes_show_their_texture),   cmocka_unit_test(terrain_shows_its_texture),
        cmocka_unit_test(rays_meet_surfaces),          cmocka_unit_test(views_that_see_nothing),
        cmocka_unit_test(one_view_is_itself),          thread_test(threads_give_the_same_bytes),
        cmocka_unit_test(lattice_equals_its_renderer), cmocka_unit_test(refuses_other_pictures),
        cmocka_unit_test(kept_places_give_the_same_bytes),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
