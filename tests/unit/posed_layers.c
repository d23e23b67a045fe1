/* pipeline/posed/layers.c, cells.c, weighted.c and picture.h: weights of rays do not depend on the cells that are compared,
 * sums of weighted rays, maps of weights under a lens, views that are seen at an edge. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/posed/picture.h"
#include "pipeline/posed/surface_internal.h"
#include "simulators/scene/noise.h"
#include "tests/test.h"

#define WIDTH  96
#define HEIGHT 80
#define VIEWS  4
#define FLOOR  20000.0 /* mm in front of the cameras */
#define LEAVES 15000.0
#define FOCAL  150.0

/* Random levels on a grid of `step` mm, bilinear: 0 to 1. */
static double noise(double x_mm, double y_mm, double step, uint32_t seed)
{
    const double u = x_mm / step + 4000, v = y_mm / step + 4000;
    const int i = (int)u, j = (int)v;
    double level[4];

    for (int k = 0; k < 4; k++) {
        uint64_t h = (uint64_t)(i + k % 2) << 40 ^ (uint64_t)(j + k / 2) << 16 ^ seed;

        level[k] = (double)(sst_random_u64(&h) >> 40) / (1 << 24);
    }
    return (1 - (v - j)) * ((1 - (u - i)) * level[0] + (u - i) * level[1]) +
           (v - j) * ((1 - (u - i)) * level[2] + (u - i) * level[3]);
}

static uint16_t level_at(double x_mm, double y_mm, const double centre[3])
{
    const double near = LEAVES / FLOOR;
    const double x = centre[0] + (x_mm - centre[0]) * near, y = centre[1] + (y_mm - centre[1]) * near;
    const double v = noise(x, y, 1500, 3) > 0.55 ? noise(x, y, 160, 2) : noise(x_mm, y_mm, 200, 1);

    return (uint16_t)(20000 + 25000 * v);
}

/* Views in a row over a floor with leaves, as grey pictures of mean 32768 or so. */
static void make_views(struct greys *greys)
{
    *greys = (struct greys){ .count = VIEWS, .step = 1, .width = WIDTH, .height = HEIGHT };
    greys->picture = calloc(VIEWS, sizeof(*greys->picture));
    greys->camera = calloc(VIEWS, sizeof(*greys->camera));
    assert_true(greys->picture && greys->camera);
    for (int k = 0; k < VIEWS; k++) {
        struct sst_calib_camera *cam = &greys->camera[k];

        *cam = (struct sst_calib_camera){ .known = true,
                                          .fx = FOCAL,
                                          .fy = FOCAL,
                                          .cx = (WIDTH - 1) / 2.0,
                                          .cy = (HEIGHT - 1) / 2.0,
                                          .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 },
                                          .position_mm = { 1500.0 * k, 100.0 * (k % 2), 0 } };
        assert_int_equal(sst_deep_init(&greys->picture[k], WIDTH, HEIGHT, 1, UINT16_MAX), 0);
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            const double x = cam->position_mm[0] + (i % WIDTH - cam->cx) / FOCAL * FLOOR;
            const double y = cam->position_mm[1] + (i / WIDTH - cam->cy) / FOCAL * FLOOR;

            sst_map_u16_row(&greys->picture[k].plane[0], i / WIDTH)[i % WIDTH] = level_at(x, y, cam->position_mm);
        }
    }
}

static struct sst_virtual camera_of(const struct greys *greys, int view)
{
    const struct sst_calib_camera *cam = &greys->camera[view];
    struct sst_virtual v = { WIDTH, HEIGHT, cam->fx, cam->fy, cam->cx, cam->cy, { 0 }, { 0 } };

    memcpy(v.rotation, cam->rotation, sizeof(v.rotation));
    memcpy(v.centre_mm, cam->position_mm, sizeof(v.centre_mm));
    return v;
}

static struct sst_surface plane(void)
{
    return sst_surface_plane((const double[3]){ 0, 0, -1 }, (const double[3]){ 0, 0, FLOOR });
}

/* Weights of the first view with some of its cells equal its weights with all of them there, and are 0 elsewhere. */
static void weights_do_not_depend_on_cells(void **state SST_UNUSED)
{
    int other[VIEWS][LAYER_OTHERS] = { { 1, 2, 3, -1 } };
    struct layer_cells cells[2][VIEWS] = { 0 };
    struct layers layers = { .surface = plane(), .distance_mm = FLOOR, .other = other };
    struct sst_map_u8 weight[2];
    struct sst_virtual camera;
    struct greys greys;
    int counting = 0, outside = 0;

    make_views(&greys);
    layers.greys = &greys;
    layers.step = 1 / (FOCAL * 3000);
    layers.steps = 12;
    for (int i = 0; i < 2; i++) { /* its own picture, and one to the right of it */
        camera = camera_of(&greys, 0);
        camera.centre_mm[0] += i * 5000;
        assert_int_equal(layer_cells_find(cells[i], &greys, &camera, &layers.surface, 2), 0);
        layers.seen = cells[i];
        assert_int_equal(layers_weigh(&weight[i], &layers, 0), 0);
    }
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const int cell = i / WIDTH / WARP_CELL * cells[1][0].across + i % WIDTH / WARP_CELL;
        const uint8_t all = sst_map_u8_row(&weight[0], i / WIDTH)[i % WIDTH];

        assert_true(cells[0][0].cell[cell]);
        assert_int_equal(sst_map_u8_row(&weight[1], i / WIDTH)[i % WIDTH], cells[1][0].cell[cell] ? all : 0);
        counting += all > 127 && cells[1][0].cell[cell];
        outside += !cells[1][0].cell[cell];
    }
    if (counting < 300 || outside < WIDTH * HEIGHT / 5)
        fail_msg("%d rays count, %d are outside", counting, outside);
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < VIEWS; k++)
            free(cells[i][k].cell);
        sst_map_u8_fini(&weight[i]);
    }
    greys_fini(&greys);
}

/* Views beside the virtual camera's picture have no cells; a place inside has one. */
static void cells_are_those_in_the_picture(void **state SST_UNUSED)
{
    const struct sst_surface surface = plane();
    struct layer_cells cells[VIEWS] = { 0 };
    struct sst_virtual camera;
    struct greys greys;

    make_views(&greys);
    camera = camera_of(&greys, 0);
    camera.width = camera.height = 8; /* 8 px of its middle: x and y are -4 to 3 px from the axis */
    camera.cx = camera.cy = 4;
    greys.camera[2].position_mm[0] = -40000;
    for (int i = 6; i < 9; i++)
        greys.camera[3].rotation[i] = -greys.camera[3].rotation[i];
    assert_int_equal(layer_cells_find(cells, &greys, &camera, &surface, 1), 0);
    assert_true(!cells[2].cell && !cells[3].cell && cells[0].cell && cells[1].cell);
    assert_true(cells[0].cell[40 / WARP_CELL * cells[0].across + 47 / WARP_CELL]);
    assert_false(cells[0].cell[0] || cells[0].cell[cells[0].across * cells[0].bands - 1]);
    /* The second camera, 1.5 m to the right, sees the axis of the first 11.25 px to the left of its own. */
    assert_true(cells[1].cell[40 / WARP_CELL * cells[1].across + 36 / WARP_CELL]);
    assert_false(cells[1].cell[40 / WARP_CELL * cells[1].across + 80 / WARP_CELL]);
    for (int k = 0; k < VIEWS; k++)
        free(cells[k].cell);
    greys_fini(&greys);
}

/* Equal weights give the sums of the integral, and its mean. */
static void equal_weights_give_the_integral(void **state SST_UNUSED)
{
    const struct sst_surface surface = plane();
    struct weighted_view view[VIEWS] = { 0 };
    struct sst_map_u16 map[VIEWS];
    struct sst_map_u8 weight;
    struct weighted sums;
    struct sst_integral *integral;
    struct sst_map_u16 count;
    struct sst_map_f32 mean;
    struct sst_virtual camera;
    struct greys greys;

    make_views(&greys);
    camera = camera_of(&greys, 1);
    assert_int_equal(sst_map_u8_init(&weight, WIDTH / 3, HEIGHT / 3), 0); /* smaller by 3, with a rest */
    memset(weight.data, 200, weight.stride * (size_t)weight.height);
    assert_int_equal(weighted_init(&sums, &camera, &surface, 1, 2), 0);
    assert_int_equal(sst_integral_create(&integral, &camera, &surface, 1, 1), 0);
    for (int k = 0; k < VIEWS; k++) {
        const struct sst_calib_camera *cam = &greys.camera[k];
        const struct sst_deep *picture = &greys.picture[k];

        assert_int_equal(weights_in_picture(&map[k], &weight, cam, 13), 0);
        view[k] = (struct weighted_view){ .picture = picture,
                                          .weight = &map[k],
                                          .warp = warp_view_of(&camera, cam, WIDTH, HEIGHT) };
        assert_int_equal(sst_integral_add(integral, &cam, &picture, 1), 0);
    }
    assert_int_equal(weighted_add(&sums, view, VIEWS, 3), 0);
    assert_int_equal(sst_integral_views(&count, integral), 0);
    assert_int_equal(sst_integral_means(&mean, integral, 0), 0);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const int n = sst_map_u16_row(&count, i / WIDTH)[i % WIDTH];

        assert_int_equal(sums.count[i], n);
        assert_true(sums.weight[i] == (uint32_t)n * 200);
        if (n) {
            const double want = (double)sst_map_f32_row(&mean, i / WIDTH)[i % WIDTH];

            assert_true(fabs(sums.sum[0][i] / 64.0 / n - want) < 0.01);
            assert_true(fabs((double)sums.weighted[0][i] / sums.weight[i] / 64 - want) < 0.05);
        }
    }
    sst_map_u16_fini(&count);
    sst_map_f32_fini(&mean);
    sst_integral_destroy(integral);
    weighted_fini(&sums);
    for (int k = 0; k < VIEWS; k++)
        sst_map_u16_fini(&map[k]);
    sst_map_u8_fini(&weight);
    greys_fini(&greys);
}

/* Map of weights: the border is repeated; under a lens a weight lies where the lens maps its place. */
static void weights_follow_the_lens(void **state SST_UNUSED)
{
    struct sst_calib_camera cam = { .fx = FOCAL, .fy = FOCAL, .cx = 47.5, .cy = 39.5 };
    struct sst_map_u8 weight;
    struct sst_map_u16 map;
    double x, y;

    assert_int_equal(sst_map_u8_init(&weight, WIDTH, HEIGHT), 0);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        sst_map_u8_row(&weight, i / WIDTH)[i % WIDTH] = (uint8_t)(i % WIDTH + i / WIDTH);
    assert_int_equal(weights_in_picture(&map, &weight, &cam, 20), 0);
    assert_int_equal(map.width, WIDTH + 3);
    assert_int_equal(sst_map_u16_row(&map, 0)[0], 20 * WEIGHT_ONE); /* at least */
    assert_int_equal(sst_map_u16_row(&map, 31)[51], (50 + 30) * WEIGHT_ONE);
    assert_int_equal(sst_map_u16_row(&map, HEIGHT + 2)[WIDTH + 2], (WIDTH + HEIGHT - 2) * WEIGHT_ONE);
    sst_map_u16_fini(&map);
    cam.lens = 5;
    cam.k[0] = -0.2;
    assert_int_equal(weights_in_picture(&map, &weight, &cam, 0), 0);
    for (int i = 8; i < WIDTH - 8; i += 8) {
        sst_camera_distort(&cam, (i - cam.cx) / FOCAL, (20 - cam.cy) / FOCAL, &x, &y);
        /* Weights change by 1 a pixel along both axes; the nearest pixel's is off by half of one each. */
        assert_true(fabs((double)sst_map_u16_row(&map, (int)round(y) + 1)[(int)round(x) + 1] / WEIGHT_ONE + x - round(x) +
                         y - round(y) - (i + 20)) < 0.15);
    }
    sst_map_u16_fini(&map);
    sst_map_u8_fini(&weight);
}

/* Views of a strip of the first view's picture, and beside it, that weighted rays and all rays have. */
static void compare_strip(const struct sst_posed *posed, const struct greys *greys, int left)
{
    struct sst_posed_render_config cfg = {
        .camera = camera_of(greys, 0), .surface = plane(), .threads = 1, .compare_px = WIDTH / 3
    };
    struct sst_posed_rendered all = { 0 }, weighted = { 0 };
    int err;

    cfg.camera.width = 2;
    cfg.camera.height = 20;
    cfg.camera.cx -= left;
    cfg.camera.cy -= 70;
    err = sst_posed_render(&all, posed, "", &cfg);
    cfg.method = SST_POSED_THROUGH;
    assert_int_equal(sst_posed_render(&weighted, posed, "", &cfg), err); /* -ENODATA: none sees it */
    for (int y = 0; !err && y < 20; y++)
        assert_memory_equal(sst_map_u16_row(&weighted.views, y), sst_map_u16_row(&all.views, y), 2 * sizeof(uint16_t));
    sst_posed_rendered_fini(&weighted);
    sst_posed_rendered_fini(&all);
}

/* Views of which the virtual camera sees a pixel or two are part of the picture: beyond the last whole pixel of the
 * smaller pictures, and where a lens bends a picture beyond them. */
static void edges_of_views_are_seen(void **state SST_UNUSED)
{
    struct sst_posed posed;
    struct greys greys;

    make_views(&greys);
    assert_int_equal(sst_posed_init(&posed, VIEWS), 0);
    posed.width = WIDTH;
    posed.height = HEIGHT;
    posed.channels = 1;
    posed.bits = 16;
    posed.picture = greys.picture;
    for (int lens = 0; lens <= 5; lens += 5) {
        for (int k = 0; k < VIEWS; k++) {
            posed.view[k].camera = greys.camera[k];
            posed.view[k].camera.lens = lens;
            posed.view[k].camera.k[0] = -0.4;
        }
        for (int left = -6; left < WIDTH + 30; left++)
            compare_strip(&posed, &greys, left);
    }
    posed.picture = NULL;
    sst_posed_fini(&posed);
    greys_fini(&greys);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(weights_do_not_depend_on_cells),
        cmocka_unit_test(cells_are_those_in_the_picture),
        cmocka_unit_test(equal_weights_give_the_integral),
        cmocka_unit_test(weights_follow_the_lens),
        cmocka_unit_test(edges_of_views_are_seen),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
