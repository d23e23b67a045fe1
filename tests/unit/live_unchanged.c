/* Unchanged frames: pictures equal to the last accepted one. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "config/array.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/image.h"
#include "pipeline/live/frames/unchanged.h"
#include "simulators/scene/noise.h"
#include "tests/test.h"

#define WIDTH  160
#define HEIGHT 128

/* A grey gradient with noise of a few levels, and a square of another brightness somewhere. */
static void draw(uint8_t *out, uint64_t seed, int square_x, int change)
{
    uint64_t rng = seed;

    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            const bool inside = x >= square_x && x < square_x + 40 && y >= 40 && y < 80;

            out[y * WIDTH + x] = (uint8_t)(60 + x / 2 + (inside ? change : 0) + (int)(sst_random(&rng) * 5) - 2);
        }
}

static bool same(struct sst_unchanged *s, int cam, uint64_t seed, int square_x, int change)
{
    static uint8_t picture[WIDTH * HEIGHT];

    draw(picture, seed, square_x, change);
    return sst_unchanged_same(s, cam, picture, sizeof(picture), WIDTH);
}

static struct sst_unchanged *create(int cameras)
{
    struct sst_unchanged *s = NULL;

    assert_int_equal(sst_unchanged_create(&s, cameras, sst_array_format("GREY"), WIDTH, HEIGHT), 0);
    return s;
}

static void noise_is_no_change(void **state SST_UNUSED)
{
    struct sst_unchanged *s = create(2);
    int sent = 0;

    for (uint64_t i = 1; i <= 40; i++)
        sent += !same(s, 0, i, 0, 0);
    assert_true(sent >= 1 && sent <= 4); /* the first, and pictures that settle after it */
    assert_false(same(s, 1, 1, 0, 0));   /* each camera has its own */
    sst_unchanged_destroy(s);
}

static void a_change_is_sent_and_then_it_rests(void **state SST_UNUSED)
{
    struct sst_unchanged *s = create(1);
    uint64_t seed = 1;
    int after = 0;

    while (seed < 20)
        (void)same(s, 0, seed++, 0, 0);
    assert_true(same(s, 0, seed++, 0, 0));
    assert_false(same(s, 0, seed++, 60, 40));
    for (int i = 0; i < 20; i++)
        after += !same(s, 0, seed++, 60, 40);
    assert_true(after <= 4);
    assert_false(same(s, 0, seed++, 70, 40)); /* it moves */
    sst_unchanged_destroy(s);
}

static void slow_changes_add_up(void **state SST_UNUSED)
{
    struct sst_unchanged *s = create(1);
    int sent = 0;

    for (int i = 0; i < 60; i++)
        sent += !same(s, 0, (uint64_t)i + 1, 60, i);
    assert_true(sent >= 4); /* though none of the steps is seen alone */
    sst_unchanged_destroy(s);
}

static void what_cannot_be_read_is_sent(void **state SST_UNUSED)
{
    struct sst_unchanged *s = create(1);
    uint8_t few[10] = { 0 };

    assert_false(sst_unchanged_same(s, 0, few, sizeof(few), WIDTH));
    assert_false(same(s, 0, 1, 0, 0));
    sst_unchanged_destroy(s);
    sst_unchanged_destroy(NULL);
    assert_int_equal(sst_unchanged_create(&s, 1, 0x12345678, WIDTH, HEIGHT), -EINVAL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(noise_is_no_change),
        cmocka_unit_test(a_change_is_sent_and_then_it_rests),
        cmocka_unit_test(slow_changes_add_up),
        cmocka_unit_test(what_cannot_be_read_is_sent),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
