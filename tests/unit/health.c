/* What is wrong with the cameras' frames: told when it begins and ends, in a line for all cameras that have it, and
 * ever more seldom when it comes and goes. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include "capture/array/array_internal.h"
#include "tests/test.h"

enum { CAMERAS = 36 };

static struct health health;
static char name[CAMERAS][SST_HEALTH_NAME] = { "row 0, col 0" };

static int begin(void **state)
{
    (void)state;
    health = (struct health){ 0 };
    return 0;
}

static void stray(int cam)
{
    health_bucket(&health, &(struct sst_frame){ .cam = cam }, SST_BUCKET_STRAY);
}

/** Sets with a good frame of every camera. */
static void sets(int n)
{
    for (int i = 0; i < n; i++)
        for (int cam = 0; cam < CAMERAS; cam++)
            health_set(&health, cam);
}

static int tell(void)
{
    return health_log(&health, CAMERAS, name);
}

static void one_line_tells_of_all_cameras(void **state)
{
    (void)state;
    assert_int_equal(tell(), 0);
    for (int cam = 0; cam < CAMERAS; cam++)
        stray(cam);
    assert_int_equal(tell(), 1);
    assert_int_equal(tell(), 0);
    for (int i = 0; i < 100; i++)
        stray(i % CAMERAS);
    assert_int_equal(tell(), 0); /* it goes on */
    sets(SST_HEALTH_SETS);
    assert_int_equal(tell(), 0);
    sets(1);
    assert_int_equal(tell(), 1); /* all are well again */
    assert_int_equal(tell(), 0);
}

static void kinds_are_told_apart(void **state)
{
    const struct sst_frame cut = { .cam = 3, .faults = SST_FRAME_SHORT, .lost_before = 1 };

    (void)state;
    stray(3);
    stray(4);
    health_frame(&health, &cut);
    assert_int_equal(tell(), 3); /* stray, cut, lost */
    sets(SST_HEALTH_SETS + 1);
    stray(3);
    assert_int_equal(tell(), 4); /* three ended, and one of them has begun again */
}

/* A hiccup each minute at 10 sets a second, for a day. */
static void what_comes_and_goes_is_told_a_few_times(void **state)
{
    int lines = 0;

    (void)state;
    for (int minute = 0; minute < 24 * 60; minute++) {
        for (int cam = 0; cam < CAMERAS; cam++)
            stray(cam);
        lines += tell();
        sets(300);
        lines += tell();
        sets(300);
        lines += tell();
    }
    assert_in_range(lines, 2, 12);
    sets(SST_HEALTH_SETS_MAX + SST_HEALTH_AGAIN);
    assert_int_equal(tell(), 1); /* over in the end */
    stray(0);
    assert_int_equal(tell(), 1);
    sets(2 * SST_HEALTH_SETS_MAX + 1);
    assert_int_equal(tell(), 1);
    sets(SST_HEALTH_AGAIN + SST_HEALTH_SETS_MAX);
    stray(0); /* after so long it is new, and soon over */
    assert_int_equal(tell(), 1);
    sets(SST_HEALTH_SETS + 1);
    assert_int_equal(tell(), 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(one_line_tells_of_all_cameras, begin),
        cmocka_unit_test_setup(kinds_are_told_apart, begin),
        cmocka_unit_test_setup(what_comes_and_goes_is_told_a_few_times, begin),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
