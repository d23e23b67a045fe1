/* Refinement between pixels: a slanted surface whose maps hold quarter pixels, seen by 3x3 cameras of unlike gains. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/method/disparity/visible.h"
#include "tests/small.h"
#include "tests/test.h"

enum { W = 96, H = 64, SIDE = 3, VIEWS = SIDE * SIDE, MIN_PX = -1, FLAT = 24 };

struct scene {
    struct sst_image image[VIEWS];
    struct sst_map_u16 disp[VIEWS];
    struct sst_map_u8 confidence[VIEWS];
    struct sst_visible_view view[VIEWS];
    struct sst_visible_views all;
};

static double slope = 0.008, contrast = 1;

/* Disparity at a pixel of the middle view: a plane. The left columns have no texture. */
static double depth_at(double x)
{
    return 0.2 + slope * x;
}

static double luma_at(double x, double y)
{
    return x < FLAT ? 120 : 120 + contrast * (30 * sin(0.9 * x + 0.3 * y) + 25 * sin(0.4 * x - 0.8 * y + 1));
}

/* The point of the middle view that a pixel of another view shows: x0 - d(x0) bx = x. */
static double middle_x(double x, double bx)
{
    return (x + 0.2 * bx) / (1 - slope * bx);
}

static void draw(struct scene *s, int k)
{
    const double bx = k % SIDE - 1, by = k / SIDE - 1, gain = 1 + 0.02 * (k % 4), offset = 2 * (k % 3);

    for (int y = 0; y < H; y++) {
        for (int x = 0; x < W; x++) {
            const double x0 = middle_x(x, bx), d = depth_at(x0), y0 = y + d * by;
            const double level = gain * luma_at(x0, y0) + offset;

            for (int c = 0; c < 3; c++)
                sst_image_row(&s->image[k], c, y)[x] = (uint8_t)(level + 0.5);
            sst_map_u16_row(&s->disp[k], y)[x] = (uint16_t)(16 * (int)floor((d - MIN_PX) * 4 + 0.5));
        }
    }
}

static void scene_init(struct scene *s)
{
    *s = (struct scene){ .all = { .view = s->view, .count = VIEWS, .scale = 1, .disp_min_px = MIN_PX, .range = 3 } };
    for (int k = 0; k < VIEWS; k++) {
        assert_int_equal(sst_image_init(&s->image[k], W, H), 0);
        assert_int_equal(sst_map_u16_init(&s->disp[k], W, H), 0);
        assert_int_equal(sst_map_u8_init(&s->confidence[k], W, H), 0);
        draw(s, k);
        s->view[k] =
            (struct sst_visible_view){ &s->image[k], NULL, &s->disp[k], &s->confidence[k], k % SIDE - 1, k / SIDE - 1 };
    }
}

static void scene_fini(struct scene *s)
{
    for (int k = 0; k < VIEWS; k++) {
        sst_image_fini(&s->image[k]);
        sst_map_u16_fini(&s->disp[k]);
        sst_map_u8_fini(&s->confidence[k]);
    }
}

/* Mean error of the middle view over columns x0 .. x1-1. */
static double error_of(const struct scene *s, int x0, int x1)
{
    double sum = 0;

    for (int y = 6; y < H - 6; y++) {
        for (int x = x0; x < x1; x++)
            sum += fabs(MIN_PX + sst_map_u16_row(&s->disp[VIEWS / 2], y)[x] / 64.0 - depth_at(x));
    }
    return sum / ((H - 12) * (x1 - x0));
}

static void finds_what_lies_between_steps(void **state SST_UNUSED)
{
    struct scene s;

    scene_init(&s);
    assert_true(error_of(&s, FLAT + 6, W - 6) > 0.05);
    assert_int_equal(sst_disparity_subpixel(&s.all, 2, 8, 1), 0);
    assert_true(error_of(&s, FLAT + 6, W - 6) < 0.015);
    scene_fini(&s);
}

/* Where levels hardly differ, large windows decide: they must follow the slope. */
static void weak_texture_on_a_steep_slope(void **state SST_UNUSED)
{
    struct scene s;

    slope = 0.05;
    contrast = 0.04;
    scene_init(&s);
    s.all.range = 6;
    assert_int_equal(sst_disparity_subpixel(&s.all, 3, 8, 1), 0);
    assert_true(error_of(&s, FLAT + 10, W - 10) < 0.02);
    scene_fini(&s);
    slope = 0.008;
    contrast = 1;
}

static void flat_pixels_stay_near(void **state SST_UNUSED)
{
    struct scene s;
    double before;

    scene_init(&s);
    before = error_of(&s, 0, FLAT - 2);
    assert_int_equal(sst_disparity_subpixel(&s.all, 2, 8, 1), 0);
    assert_true(error_of(&s, 0, FLAT - 2) <= before + 0.02);
    scene_fini(&s);
}

static void same_bytes_for_any_threads(void **state SST_UNUSED)
{
    struct scene one, four;

    scene_init(&one);
    scene_init(&four);
    assert_int_equal(sst_disparity_subpixel(&one.all, 2, 8, 1), 0);
    assert_int_equal(sst_disparity_subpixel(&four.all, 2, 8, 4), 0);
    for (int k = 0; k < VIEWS; k++)
        assert_memory_equal(one.disp[k].data, four.disp[k].data, one.disp[k].stride * H);
    scene_fini(&one);
    scene_fini(&four);
}

/* Unknown pixels stay unknown, absent views are left out, and what is known is refined. */
static void unknown_pixels(void **state SST_UNUSED)
{
    struct scene s;

    scene_init(&s);
    for (int y = 20; y < 30; y++)
        memset(sst_map_u16_row(&s.disp[VIEWS / 2], y) + 40, 0xFF, 10 * sizeof(uint16_t));
    s.view[0].image = NULL;
    assert_int_equal(sst_disparity_subpixel(&s.all, 2, 8, 2), 0);
    assert_int_equal(sst_map_u16_row(&s.disp[VIEWS / 2], 25)[45], SST_DISP_NONE);
    assert_true(error_of(&s, 60, W - 6) < 0.015);
    scene_fini(&s);
}

static void smallest_views(void **state SST_UNUSED)
{
    static const int sizes[][2] = { { 1, 1 }, { 1, H }, { W, 1 }, { 2, 2 } };
    struct scene s;

    scene_init(&s);
    for (size_t i = 0; i < ARRAY_LEN(sizes); i++) {
        for (int k = 0; k < VIEWS; k++) {
            s.image[k].width = s.disp[k].width = sizes[i][0];
            s.image[k].height = s.disp[k].height = sizes[i][1];
        }
        assert_int_equal(sst_disparity_subpixel(&s.all, 2, 8, 1), 0);
    }
    scene_fini(&s);
}

static void cancelled(void **state SST_UNUSED)
{
    SST_ATOMIC(bool) cancel = true;
    struct scene s;

    scene_init(&s);
    s.all.cancel = &cancel;
    assert_int_equal(sst_disparity_subpixel(&s.all, 2, 8, 1), -ECANCELED);
    scene_fini(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(finds_what_lies_between_steps),
        cmocka_unit_test(weak_texture_on_a_steep_slope),
        cmocka_unit_test(flat_pixels_stay_near),
        thread_test(same_bytes_for_any_threads),
        cmocka_unit_test(unknown_pixels),
        cmocka_unit_test(smallest_views),
        cmocka_unit_test(cancelled),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
