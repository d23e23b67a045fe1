/* Foreground: labels of moving objects before a wall, by the network's votes in a part of their cells. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "pipeline/live/scene/scene_internal.h"
#include "tests/test.h"

#define COLS   8
#define ROWS   6
#define TILES  (COLS * ROWS)
#define WIDTH  (COLS * SST_SCENE_CELLS)
#define HEIGHT (ROWS * SST_SCENE_CELLS)
#define WALL   (4 * 64)  /* disparities, 1/64 px */
#define NEAR   (12 * 64) /* of moving objects */
#define HOUSE  SST_LABEL_BUILDING
#define SIDE   30

struct bench {
    struct scene_key key;
    struct scene_candidates c;
    struct scene_foreground *foreground;
    uint8_t dirty[TILES];
};

static uint8_t *label_at(struct bench *b, int x, int y)
{
    return &sst_map_u8_row(&b->key.maps.label, y)[x];
}

static void open_bench(struct bench *b)
{
    memset(b, 0, sizeof(*b));
    b->key.view = 3;
    assert_int_equal(sst_map_u16_init(&b->key.maps.disp, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&b->key.maps.label, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&b->key.maps.confirmed, WIDTH, HEIGHT), 0);
    assert_int_equal(scene_foreground_open(&b->foreground, WIDTH, HEIGHT, COLS, ROWS), 0);
    memset(b->dirty, 1, TILES);
}

static void close_bench(struct bench *b)
{
    scene_foreground_close(b->foreground);
    sst_map_u16_fini(&b->key.maps.disp);
    sst_map_u8_fini(&b->key.maps.label);
    sst_map_u8_fini(&b->key.maps.confirmed);
}

/* A square with its left edge at `left` (none: outside) before the wall; the network calls one cell of it in `rare` a
 * pedestrian, one in three a car, and is not sure of the others. */
static void draw(struct bench *b, int left, int side, int rare)
{
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            const bool near = x >= left && x < left + side && y >= 20 && y < 20 + side;

            sst_map_u16_row(&b->key.maps.disp, y)[x] = near ? NEAR : WALL;
            sst_map_u8_row(&b->key.maps.confirmed, y)[x] = 1;
            *label_at(b, x, y) = (uint8_t)(!near                 ? HOUSE
                                           : (x + y) % rare == 0 ? SST_LABEL_PEDESTRIAN
                                           : (x + y) % 3 == 0    ? SST_LABEL_CAR
                                                                 : SST_LABEL_NONE);
        }
    }
}

static void label(struct bench *b, bool labelled)
{
    (void)scene_foreground_label(b->foreground, &b->key, &b->c, b->dirty, labelled);
}

/* Cells of the square that bear a label, and cells of the wall that are not the house. */
static void count(struct bench *b, int left, int side, uint8_t of, int *right, int *wrong)
{
    *right = *wrong = 0;
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            const bool near = x >= left && x < left + side && y >= 20 && y < 20 + side;

            *right += near && *label_at(b, x, y) == of;
            *wrong += !near && *label_at(b, x, y) != HOUSE;
        }
    }
}

static void a_thing_takes_the_label_of_most_votes(void **state SST_UNUSED)
{
    struct bench b;
    int right, wrong;

    open_bench(&b);
    draw(&b, WIDTH, SIDE, 2);
    label(&b, true);
    draw(&b, 40, SIDE, 2); /* half are votes for a pedestrian, a sixth for a car */
    label(&b, true);
    count(&b, 40, SIDE, SST_LABEL_PEDESTRIAN, &right, &wrong);
    assert_int_equal(right, SIDE * SIDE);
    assert_int_equal(wrong, 0);
    assert_true(b.c.mask[NEAR >> SST_SCENE_COLUMN_SHIFT] >> (SST_LABEL_PEDESTRIAN - 1) & 1);
    /* It moves on: one vote in seven against a car's in three does not change its label. */
    draw(&b, 50, SIDE, 7);
    label(&b, true);
    count(&b, 50, SIDE, SST_LABEL_PEDESTRIAN, &right, &wrong);
    assert_int_equal(right, SIDE * SIDE);
    assert_int_equal(wrong, 0);
    /* Nor does a set in which the network did not run; uncovered cells are the house, whatever their label was. */
    draw(&b, 60, SIDE, 7);
    for (int x = 0; x < 60; x++)
        *label_at(&b, x, 30) = SST_LABEL_CAR;
    label(&b, false);
    count(&b, 60, SIDE, SST_LABEL_PEDESTRIAN, &right, &wrong);
    assert_int_equal(right, SIDE * SIDE);
    assert_int_equal(wrong, 0);
    close_bench(&b);
}

static void what_is_too_small_or_unclear_stays_as_it_is(void **state SST_UNUSED)
{
    struct bench b;
    int right, wrong;

    open_bench(&b);
    draw(&b, WIDTH, SIDE, 2);
    label(&b, true);
    draw(&b, 40, 4, 2); /* 16 cells */
    label(&b, true);
    count(&b, 40, 4, SST_LABEL_PEDESTRIAN, &right, &wrong);
    assert_int_equal(right, 8);
    draw(&b, WIDTH, SIDE, 2);
    label(&b, true);
    draw(&b, 40, SIDE, 4); /* 225 votes each for a pedestrian and a car, 150 for neither: nobody has more than half */
    for (int y = 20; y < 20 + SIDE; y++)
        for (int x = 40; x < 40 + SIDE; x++)
            if ((x + y) % 6 == 1)
                *label_at(&b, x, y) = SST_LABEL_BICYCLIST;
    label(&b, true);
    count(&b, 40, SIDE, SST_LABEL_PEDESTRIAN, &right, &wrong);
    assert_in_range(right, 220, 230);
    count(&b, 40, SIDE, SST_LABEL_CAR, &right, &wrong);
    assert_in_range(right, 220, 230);
    close_bench(&b);
}

/* Something that the network calls a house is no house because one stands behind it. */
static void the_background_votes_less(void **state SST_UNUSED)
{
    struct bench b;
    int right, wrong;

    open_bench(&b);
    draw(&b, WIDTH, SIDE, 2);
    label(&b, true);
    draw(&b, 40, SIDE, 3);
    for (int y = 20; y < 20 + SIDE; y++)
        for (int x = 40; x < 40 + SIDE; x++)
            if (*label_at(&b, x, y) != SST_LABEL_PEDESTRIAN)
                *label_at(&b, x, y) = HOUSE; /* two of three */
    label(&b, true);
    count(&b, 40, SIDE, SST_LABEL_PEDESTRIAN, &right, &wrong);
    assert_int_equal(right, SIDE * SIDE);
    close_bench(&b);
}

static void what_stays_becomes_background(void **state SST_UNUSED)
{
    static const uint8_t none[TILES];
    struct bench b;
    int right, wrong;

    open_bench(&b);
    draw(&b, 40, SIDE, 2); /* there from the start: background, until it leaves */
    label(&b, true);
    for (int i = 0; i < 3; i++) {
        draw(&b, WIDTH, SIDE, 2);
        label(&b, true);
    }
    count(&b, WIDTH, SIDE, HOUSE, &right, &wrong);
    assert_int_equal(wrong, 0);
    draw(&b, 40, SIDE, 2); /* it comes again, and stands still for long */
    label(&b, true);
    for (int i = 0; i < 300; i++)
        scene_foreground_still(b.foreground, &b.key, none);
    draw(&b, 70, SIDE, 2); /* another one beside it at the same distance is a thing of its own */
    for (int y = 20; y < 20 + SIDE; y++)
        for (int x = 40; x < 70; x++) {
            sst_map_u16_row(&b.key.maps.disp, y)[x] = NEAR;
            *label_at(&b, x, y) = SST_LABEL_CAR;
        }
    for (int y = 20; y < 20 + SIDE; y++)
        for (int x = 70; x < 70 + SIDE; x++)
            *label_at(&b, x, y) = SST_LABEL_BICYCLIST;
    label(&b, true);
    count(&b, 40, SIDE, SST_LABEL_PEDESTRIAN, &right, &wrong);
    assert_int_equal(right, SIDE * SIDE); /* one vote for a car does not make it one */
    count(&b, 70, SIDE, SST_LABEL_BICYCLIST, &right, &wrong);
    assert_int_equal(right, SIDE * SIDE);
    close_bench(&b);
}

static void another_view_knows_nothing(void **state SST_UNUSED)
{
    struct bench b;
    int right, wrong;

    open_bench(&b);
    draw(&b, WIDTH, SIDE, 2);
    label(&b, true);
    b.key.view = 4;
    draw(&b, 40, SIDE, 2);
    label(&b, true);
    count(&b, 40, SIDE, SST_LABEL_PEDESTRIAN, &right, &wrong);
    assert_int_equal(right, SIDE * SIDE / 2); /* all is background, as the network says */
    scene_foreground_settle(b.foreground, &b.key, 0);
    scene_foreground_reset(b.foreground);
    for (int y = 0; y < HEIGHT; y++) /* nothing is known of any cell */
        memset(sst_map_u16_row(&b.key.maps.disp, y), 0xFF, WIDTH * sizeof(uint16_t));
    label(&b, true);
    count(&b, 40, SIDE, SST_LABEL_PEDESTRIAN, &right, &wrong);
    assert_int_equal(right, SIDE * SIDE / 2);
    close_bench(&b);
    scene_foreground_close(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_thing_takes_the_label_of_most_votes),
        cmocka_unit_test(what_is_too_small_or_unclear_stays_as_it_is),
        cmocka_unit_test(the_background_votes_less),
        cmocka_unit_test(what_stays_becomes_background),
        cmocka_unit_test(another_view_knows_nothing),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
