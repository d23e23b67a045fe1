/* tests/quick.h: what stood still on several processors counts once, whether they saw it together or in turn. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "tests/quick.h"

#define MS INT64_C(1000000)

/* Before the time at which the machine was started: nothing else is noted there. */
static void saw(int beat, int64_t from_ms, int64_t to_ms)
{
    struct quick_beat *b = &quick_beat[beat];

    b->still[b->n] = (struct quick_span){ from_ms * MS - INT64_MAX / 2, to_ms * MS - INT64_MAX / 2 };
    b->n++;
}

static int64_t stood_still(int64_t from_ms, int64_t to_ms)
{
    return quick_stood_still(from_ms * MS - INT64_MAX / 2, to_ms * MS - INT64_MAX / 2) / MS;
}

static void time_is_counted_once(void **state SST_UNUSED)
{
    const int beats = quick_beats;

    quick_beats = 3; /* the processes beside this one, if so many, go on; what they note is of other times */
    assert_int_equal(stood_still(0, 1000), 0);
    saw(0, 100, 300);
    assert_int_equal(stood_still(0, 1000), 200);
    saw(1, 200, 400); /* overlaps */
    saw(2, 400, 500); /* follows at once */
    saw(1, 450, 470); /* lies in it */
    assert_int_equal(stood_still(0, 1000), 400);
    saw(2, 700, 900);
    assert_int_equal(stood_still(0, 1000), 600);
    assert_int_equal(stood_still(350, 800), 250);
    assert_int_equal(stood_still(500, 700), 0);
    assert_int_equal(stood_still(750, 760), 10);
    quick_beats = beats;
}

static void load_is_of_its_time(void **state SST_UNUSED)
{
    const long processors = sysconf(_SC_NPROCESSORS_ONLN);

    quick_beat->load[QUICK_LOADS - 1].t_ns = -1000; /* never reached in a test this short */
    quick_beat->load[QUICK_LOADS - 1].runnable = (int)processors * 6;
    quick_beat->load[QUICK_LOADS - 2].t_ns = -1001;
    quick_beat->load[QUICK_LOADS - 2].runnable = (int)processors * 2;
    quick_beat->loads = QUICK_LOADS; /* a whole round */
    assert_true(quick_load(-2000, -1) == 4);
    assert_true(quick_load(-1000, -1) == 6);
    assert_true(quick_load(-5000, -4000) == 1);
}

static void what_is_quick_passes(void **state SST_UNUSED)
{
    const int64_t start_ns = sst_clock_now_ns();

    assert_true(quick_enough(start_ns, INT64_C(60000000000)));
    assert_true(quick_slowness() >= 1);
    assert_false(quick_enough(start_ns - INT64_C(3600000000000), 1)); /* an hour is not, however busy it is */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(time_is_counted_once),
        cmocka_unit_test(load_is_of_its_time),
        cmocka_unit_test(what_is_quick_passes),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
