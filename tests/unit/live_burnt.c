/* pipeline/live/frames/burnt.c: which changes are text in the frames, and when they are read. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include "pipeline/live/frames/frames_internal.h"
#include "tests/test.h"

#define COLS  10
#define ROWS  8
#define TILES (COLS * ROWS)
#define VIEWS 8
#define KNOWN 10 /* changes */

struct sets {
    struct frames_burnt b;
    uint8_t changed[VIEWS][TILES];
};

static int start(void **state)
{
    static struct sets s;

    *state = &s;
    return frames_burnt_init(&s.b, COLS, ROWS);
}

static int end(void **state)
{
    frames_burnt_fini(&((struct sets *)*state)->b);
    return 0;
}

static void clear(struct sets *s)
{
    memset(s->changed, 0, sizeof(s->changed));
}

static void mark(struct sets *s, int from, int views, int col, int row)
{
    for (int k = from; k < from + views; k++)
        s->changed[k][row * COLS + col] = 1;
}

static void learn(struct sets *s, int times)
{
    const uint8_t *all[VIEWS];

    for (int k = 0; k < VIEWS; k++)
        all[k] = s->changed[k];
    for (int i = 0; i < times; i++) {
        (void)frames_burnt_read(&s->b);
        frames_burnt_learn(&s->b, all, VIEWS);
    }
}

static void text_is_left_once_it_is_known(void **state)
{
    struct sets *s = *state;

    clear(s);
    mark(s, 0, VIEWS, 3, 0);
    learn(s, KNOWN - 1);
    assert_false(frames_burnt_alone(&s->b, s->changed[0]));
    assert_int_equal(frames_burnt_leave(&s->b, s->changed[0]), 0);
    learn(s, 1);
    assert_true(frames_burnt_alone(&s->b, s->changed[0]));
    assert_int_equal(frames_burnt_leave(&s->b, s->changed[0]), 1);
    assert_int_equal(s->changed[0][3], 0);
}

static void it_is_read_in_one_set_of_four(void **state)
{
    struct sets *s = *state;

    frames_burnt_accepted(&s->b);
    for (int i = 0; i < 12; i++) {
        const bool read = frames_burnt_read(&s->b);

        assert_int_equal(read, i % 4 == 3);
        if (read)
            frames_burnt_accepted(&s->b);
    }
}

static void what_moves_between_views_is_no_text(void **state)
{
    struct sets *s = *state;

    clear(s);
    mark(s, 0, VIEWS / 2, 3, 0);
    mark(s, VIEWS / 2, VIEWS / 2, 4, 0);
    learn(s, 5 * KNOWN);
    assert_false(frames_burnt_alone(&s->b, s->changed[0]));
    assert_false(frames_burnt_alone(&s->b, s->changed[VIEWS - 1]));
}

static void it_stands_at_the_edge(void **state)
{
    struct sets *s = *state;

    for (int row = 0; row < ROWS; row++) {
        clear(s);
        mark(s, 0, VIEWS, 5, row);
        learn(s, KNOWN);
        assert_int_equal(frames_burnt_alone(&s->b, s->changed[0]), row < 2 || row >= ROWS - 2);
    }
}

static void somebody_beside_it_counts(void **state)
{
    struct sets *s = *state;

    clear(s);
    mark(s, 0, VIEWS, 1, 0);
    mark(s, 0, VIEWS, 8, 0);
    learn(s, KNOWN);
    mark(s, 0, 1, 2, 2);
    assert_false(frames_burnt_alone(&s->b, s->changed[0]));
    assert_int_equal(frames_burnt_leave(&s->b, s->changed[0]), 1);
    assert_int_equal(s->changed[0][1], 1);
    assert_int_equal(s->changed[0][8], 0);
    assert_int_equal(frames_burnt_leave(&s->b, s->changed[1]), 2);
}

static void it_is_forgotten(void **state)
{
    struct sets *s = *state;

    clear(s);
    mark(s, 0, VIEWS, 1, 7);
    learn(s, 2 * KNOWN);
    clear(s);
    learn(s, 100);
    mark(s, 0, VIEWS, 1, 7);
    assert_false(frames_burnt_alone(&s->b, s->changed[0]));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(text_is_left_once_it_is_known, start, end),
        cmocka_unit_test_setup_teardown(it_is_read_in_one_set_of_four, start, end),
        cmocka_unit_test_setup_teardown(what_moves_between_views_is_no_text, start, end),
        cmocka_unit_test_setup_teardown(it_stands_at_the_edge, start, end),
        cmocka_unit_test_setup_teardown(somebody_beside_it_counts, start, end),
        cmocka_unit_test_setup_teardown(it_is_forgotten, start, end),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
