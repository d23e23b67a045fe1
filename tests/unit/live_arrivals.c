/* pipeline/live/picture/arrivals.c: an object that comes in front of the surfaces of the clear picture has a box in the
 * same set, whole also when it moves on by a part of its width; objects that leave, few rays, and nearer pixels all
 * over the picture have none. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "pipeline/live/picture/picture_internal.h"
#include "tests/test.h"

#define WIDTH  320
#define HEIGHT 160
#define WALL   (4 * SST_DISP_SCALE)
#define NEAR   (10 * SST_DISP_SCALE)
#define MANY   (8 * SST_RENDER_SUPPORT) /* rays */
#define FEW    (3 * SST_RENDER_SUPPORT)
#define SET_MS 200

struct shown {
    struct sst_lightfield lf;
    struct picture_memory memory;
    struct picture_arrivals arrivals;
    struct sst_image image;
    struct sst_map_u8 weight, support, kind;
    struct sst_map_u16 surface;
    int64_t t_ms;
};

static void open_shown(struct shown *s)
{
    *s = (struct shown){ .t_ms = 1000 };
    assert_int_equal(picture_memory_init(&s->memory, WIDTH, HEIGHT), 0);
    assert_int_equal(picture_arrivals_init(&s->arrivals, &s->memory), 0);
    assert_int_equal(sst_image_init(&s->image, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&s->weight, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&s->support, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&s->kind, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u16_init(&s->surface, WIDTH, HEIGHT), 0);
}

static void close_shown(struct shown *s)
{
    picture_memory_fini(&s->memory);
    picture_arrivals_fini(&s->arrivals);
    sst_image_fini(&s->image);
    sst_map_u8_fini(&s->weight);
    sst_map_u8_fini(&s->support);
    sst_map_u8_fini(&s->kind);
    sst_map_u16_fini(&s->surface);
}

/* A surface at a place of the next set: every `step`-th column and row of it. */
static void paint(struct shown *s, const struct sst_rect *r, int step, int disp, int rays)
{
    for (int y = r->y0; y < r->y1; y += step) {
        for (int x = r->x0; x < r->x1; x += step) {
            for (int c = 0; c < 3; c++)
                sst_image_row(&s->image, c, y)[x] = (uint8_t)(disp / 4);
            sst_map_u16_row(&s->surface, y)[x] = (uint16_t)disp;
            sst_map_u8_row(&s->support, y)[x] = (uint8_t)rays;
            sst_map_u8_row(&s->weight, y)[x] = 255;
        }
    }
}

static void paint_wall(struct shown *s)
{
    paint(s, &(struct sst_rect){ 0, 0, WIDTH, HEIGHT }, 1, WALL, MANY);
}

/* @return arrivals of the set that was painted */
static int next(struct shown *s)
{
    const struct picture_merge in = { .lf = &s->lf,
                                      .t_ns = s->t_ms * 1000000,
                                      .threads = 1,
                                      .image = &s->image,
                                      .weight = &s->weight,
                                      .surface = &s->surface,
                                      .support = &s->support,
                                      .kind = &s->kind,
                                      .cut_q6 = SST_DISP_NONE };

    s->t_ms += SET_MS;
    assert_int_equal(picture_memory_merge(&s->memory, &in), 0);
    picture_arrivals_find(&s->arrivals, &s->memory, &s->lf);
    return s->arrivals.count;
}

/* @return arrivals of a set with a wall, and something before it */
static int set(struct shown *s, struct sst_rect r, int step, int rays)
{
    paint_wall(s);
    paint(s, &r, step, NEAR, rays);
    return next(s);
}

static void is_at(const struct sst_livepicture_arrival *a, int x0, int y0, int x1, int y1)
{
    assert_true(a->box[0] >= x0 - 1 && a->box[0] <= x0 + 1 && a->box[2] >= x1 - 1 && a->box[2] <= x1 + 1);
    assert_true(a->box[1] >= y0 - 1 && a->box[1] <= y0 + 1 && a->box[3] >= y1 - 1 && a->box[3] <= y1 + 1);
    assert_true(a->disp_px > 9.9 && a->disp_px < 10.1);
}

static void a_walker_has_a_box_at_once(void **state SST_UNUSED)
{
    struct shown s;

    open_shown(&s);
    paint_wall(&s);
    assert_int_equal(next(&s), 0); /* all is new: nothing came before it */
    paint_wall(&s);
    assert_int_equal(next(&s), 0);
    assert_int_equal(set(&s, (struct sst_rect){ 40, 30, 72, 130 }, 1, MANY), 1);
    is_at(&s.arrivals.at[0], 40, 30, 72, 130);
    for (int x = 50; x <= 80; x += 10) { /* a third of it is new */
        assert_int_equal(set(&s, (struct sst_rect){ x, 30, x + 32, 130 }, 1, MANY), 1);
        is_at(&s.arrivals.at[0], x, 30, x + 32, 130);
    }
    assert_int_equal(set(&s, (struct sst_rect){ 80, 30, 112, 130 }, 1, MANY), 0); /* it stands */
    paint_wall(&s);
    assert_int_equal(next(&s), 0); /* it has gone */
    close_shown(&s);
}

/* Another cut shows other surfaces, which have not come. */
static void another_picture_has_none_for_a_second(void **state SST_UNUSED)
{
    struct shown s;

    open_shown(&s);
    paint_wall(&s);
    assert_int_equal(next(&s), 0);
    picture_arrivals_rest(&s.arrivals, s.t_ms * 1000000);
    assert_int_equal(set(&s, (struct sst_rect){ 40, 30, 72, 130 }, 1, MANY), 0);
    s.t_ms += 700;
    assert_int_equal(set(&s, (struct sst_rect){ 80, 30, 112, 130 }, 1, MANY), 0);
    assert_int_equal(set(&s, (struct sst_rect){ 120, 30, 152, 130 }, 1, MANY), 1);
    picture_arrivals_rest(&s.arrivals, s.t_ms * 1000000 + INT64_C(5000000000)); /* time has gone back */
    assert_int_equal(set(&s, (struct sst_rect){ 160, 30, 192, 130 }, 1, MANY), 1);
    close_shown(&s);
}

static void two_walkers_have_two(void **state SST_UNUSED)
{
    struct shown s;

    open_shown(&s);
    paint_wall(&s);
    assert_int_equal(next(&s), 0);
    paint_wall(&s);
    paint(&s, &(struct sst_rect){ 40, 30, 72, 130 }, 1, NEAR, MANY);
    paint(&s, &(struct sst_rect){ 60, 60, 80, 140 }, 1, NEAR + 4 * SST_DISP_SCALE, MANY); /* before the other one */
    paint(&s, &(struct sst_rect){ 200, 30, 232, 130 }, 1, NEAR, MANY);
    assert_int_equal(next(&s), 3);
    close_shown(&s);
}

/* Where all rays end in leaves some agree, on a few pixels of many blocks, or with few rays. */
static void chance_has_none(void **state SST_UNUSED)
{
    struct shown s;

    open_shown(&s);
    paint_wall(&s);
    assert_int_equal(next(&s), 0);
    assert_int_equal(set(&s, (struct sst_rect){ 40, 30, 72, 130 }, 1, FEW), 0);
    assert_int_equal(set(&s, (struct sst_rect){ 40, 30, 200, 130 }, 2, MANY), 0);
    assert_int_equal(set(&s, (struct sst_rect){ 200, 30, 214, 44 }, 1, MANY), 0);   /* too small */
    assert_int_equal(set(&s, (struct sst_rect){ 0, 100, WIDTH, 130 }, 1, MANY), 0); /* too wide */
    close_shown(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_walker_has_a_box_at_once),
        cmocka_unit_test(another_picture_has_none_for_a_second),
        cmocka_unit_test(two_walkers_have_two),
        cmocka_unit_test(chance_has_none),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
