/* drivers/trigger: ticks, steps of a pulse, clocks of edge stamps; trains of time marks; refusals of open. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "drivers/trigger/trigger.h"
#include "drivers/trigger/trigger_internal.h"
#include "tests/quick.h"
#include "tests/test.h"

static void equal_delays_change_in_one_step(void **state SST_UNUSED)
{
    const int delay_us[] = { 0, 0, 0 };
    struct pulse_step step[6];

    assert_int_equal(pulse_steps(step, delay_us, 3, 500), 2);
    assert_int_equal(step[0].at_ns, 0);
    assert_int_equal(step[0].active, 7);
    assert_int_equal(step[1].at_ns, 500000);
    assert_int_equal(step[1].active, 0);
}

/* Lines 0 and 2 rise at 100 us, line 1 at 300 us, just when the others fall: three steps. Line 3 rises at 350 us. */
static void groups_rise_and_fall_in_order_of_time(void **state SST_UNUSED)
{
    const int delay_us[] = { 100, 300, 100, 350 };
    struct pulse_step step[8];

    assert_int_equal(pulse_steps(step, delay_us, 3, 200), 3);
    assert_int_equal(step[0].at_ns, 100000);
    assert_int_equal(step[0].active, 5);
    assert_int_equal(step[1].at_ns, 300000);
    assert_int_equal(step[1].active, 2);
    assert_int_equal(step[2].at_ns, 500000);
    assert_int_equal(step[2].active, 0);

    assert_int_equal(pulse_steps(step, delay_us, 4, 200), 5);
    assert_int_equal(step[2].at_ns, 350000);
    assert_int_equal(step[2].active, 2 | 8);
    assert_int_equal(step[3].at_ns, 500000);
    assert_int_equal(step[3].active, 8);
    assert_int_equal(step[4].at_ns, 550000);
    assert_int_equal(step[4].active, 0);
}

static void all_64_lines_may_differ(void **state SST_UNUSED)
{
    int delay_us[64];
    struct pulse_step step[128];

    for (int i = 0; i < 64; i++)
        delay_us[i] = 63 - i;
    assert_int_equal(pulse_steps(step, delay_us, 64, 1000), 128);
    assert_true(step[0].active == 1ull << 63);
    assert_true(step[63].active == UINT64_MAX);
    assert_int_equal(step[127].at_ns, 1063000);
    assert_true(step[127].active == 0);
}

/* 30/s has no whole period: tick 30 is exactly one second after the start, and so is tick 30 million a million later.
 */
static void beats_do_not_drift(void **state SST_UNUSED)
{
    assert_int_equal(tick_due_ns(7, 30, 1), 7 + 33333333);
    assert_int_equal(tick_due_ns(7, 30, 2), 7 + 66666667);
    assert_int_equal(tick_due_ns(7, 30, 30), 7 + 1000000000);
    assert_true(tick_due_ns(7, 30, 30000000) == 7 + 1000000000000000);
}

/* At 10/s: 49 ms late still fires, 51 ms late is skipped, and after 1.02 s only tick 10 is near enough. */
static void late_beats_are_skipped(void **state SST_UNUSED)
{
    assert_int_equal(tick_next(1000, 10, 0, 1000), 0);
    assert_int_equal(tick_next(1000, 10, 0, 1000 + 49000000), 0);
    assert_int_equal(tick_next(1000, 10, 0, 1000 + 51000000), 1);
    assert_int_equal(tick_next(1000, 10, 0, 1000 + 1020000000), 10);
    assert_int_equal(tick_next(1000, 10, 12, 1000 + 1020000000), 12);
}

static void stamps_of_both_clocks_become_monotonic(void **state SST_UNUSED)
{
    const int64_t mono = 5000000000, real = 1700000000000000000;

    assert_true(edge_monotonic(mono - 2000, mono, real) == mono - 2000);
    assert_true(edge_monotonic(real - 2000, mono, real) == mono - 2000);
}

struct marks {
    int n;
    struct sst_trigger_edge edge[64];
};

static void note(void *arg, const struct sst_trigger_edge *edge)
{
    struct marks *m = arg;

    if (m->n < 64)
        m->edge[m->n++] = *edge;
}

static bool wait_idle(const struct sst_trigger *t, int timeout_ms)
{
    for (int i = 0; i < timeout_ms && !sst_trigger_idle(t); i++)
        usleep(1000);
    return sst_trigger_idle(t);
}

static void software_train_marks_absolute_beats(void **state SST_UNUSED)
{
    struct sst_trigger_config cfg;
    struct sst_trigger_counters counters;
    struct marks marks = { 0 };
    struct sst_trigger *t;
    int in_time = 0;

    sst_trigger_config_defaults(&cfg);
    cfg.source = SST_TRIGGER_SOFTWARE;
    assert_int_equal(sst_trigger_open(&t, &cfg, note, &marks), 0);
    assert_true(sst_trigger_idle(t));
    assert_int_equal(sst_trigger_start(t, 100, 20), 0);
    assert_true(wait_idle(t, 60000));
    sst_trigger_counters(t, &counters);
    assert_int_equal(counters.fired, 20);
    assert_int_equal(marks.n, counters.fired);
    for (int i = 0; i < marks.n; i++) {
        const int64_t from_first_ns = marks.edge[i].due_ns - marks.edge[0].due_ns;

        assert_int_equal(marks.edge[i].index, i);
        assert_int_equal(from_first_ns % 10000000, 0);
        assert_true(marks.edge[i].before_ns >= marks.edge[i].due_ns);
        in_time += marks.edge[i].before_ns <= marks.edge[i].due_ns + 5000000;
        assert_int_equal(marks.edge[i].kernel_ns, 0);
    }
    assert_true(in_time * 2 > marks.n); /* not all, where the machine is busy */
    assert_int_equal(sst_trigger_fire(t), 0);
    assert_int_equal(marks.edge[marks.n - 1].index, marks.n - 1);
    assert_int_equal(marks.n, counters.fired + 1);
    sst_trigger_close(t);
}

/* A tick that is 100 s away does not keep stop() waiting. */
static void stop_does_not_wait_for_the_beat(void **state SST_UNUSED)
{
    struct sst_trigger_config cfg;
    struct sst_trigger_counters counters = { 0 };
    struct marks marks = { 0 };
    struct sst_trigger *t;
    int64_t start_ns;

    sst_trigger_config_defaults(&cfg);
    cfg.source = SST_TRIGGER_SOFTWARE;
    assert_int_equal(sst_trigger_open(&t, &cfg, note, &marks), 0);
    assert_int_equal(sst_trigger_start(t, 0.01, 0), 0);
    assert_int_equal(sst_trigger_start(t, 100, 20), -EBUSY);
    assert_int_equal(sst_trigger_fire(t), -EBUSY);
    for (int i = 0; i < 60000 && !counters.fired; i++) {
        usleep(1000);
        sst_trigger_counters(t, &counters);
    }
    start_ns = sst_clock_now_ns();
    assert_int_equal(sst_trigger_stop(t), 0);
    assert_quick(start_ns, 1000000000);
    assert_true(sst_trigger_idle(t));
    assert_int_equal(marks.n, 1);
    assert_int_equal(sst_trigger_start(t, 0.01, 0), 0);
    sst_trigger_close(t);
}

static void slow_callback(void *arg, const struct sst_trigger_edge *edge)
{
    note(arg, edge);
    if (edge->index == 0)
        usleep(73000);
}

/* 100/s, and the first tick's receiver takes 73 ms: ticks 1 to 6 are over half a period late, 7 is fired at once. */
static void held_up_train_skips_and_keeps_the_beat(void **state SST_UNUSED)
{
    struct sst_trigger_config cfg;
    struct sst_trigger_counters counters;
    struct marks marks = { 0 };
    struct sst_trigger *t;

    sst_trigger_config_defaults(&cfg);
    cfg.source = SST_TRIGGER_SOFTWARE;
    assert_int_equal(sst_trigger_open(&t, &cfg, slow_callback, &marks), 0);
    assert_int_equal(sst_trigger_start(t, 100, 15), 0);
    assert_true(wait_idle(t, 60000));
    sst_trigger_counters(t, &counters);
    assert_true(sst_trigger_skipped(t) >= 6);
    assert_int_equal(counters.fired, 15);
    assert_true(marks.edge[1].due_ns - marks.edge[0].due_ns >= 70000000);
    assert_int_equal((marks.edge[1].due_ns - marks.edge[0].due_ns) % 10000000, 0);
    sst_trigger_close(t);
}

static void wrong_settings_are_named(void **state SST_UNUSED)
{
    struct sst_trigger_config cfg;
    struct sst_trigger *t = NULL;
    char text[SST_LOG_MAX] = "";

    (void)sst_log_hold_errors(text);
    sst_trigger_config_defaults(&cfg);
    assert_int_equal(sst_trigger_open(&t, &cfg, NULL, NULL), -EINVAL);
    assert_non_null(strstr(text, "0 lines"));
    cfg.lines = 2;
    strcpy(cfg.line[0], "A");
    strcpy(cfg.line[1], "A");
    assert_int_equal(sst_trigger_open(&t, &cfg, NULL, NULL), -EINVAL);
    assert_non_null(strstr(text, "line A is named twice"));
    strcpy(cfg.line[1], "B");
    strcpy(cfg.loopback, "B");
    assert_int_equal(sst_trigger_open(&t, &cfg, NULL, NULL), -EINVAL);
    assert_non_null(strstr(text, "line B is named twice"));
    cfg.pulse_us = 9;
    assert_int_equal(sst_trigger_open(&t, &cfg, NULL, NULL), -EINVAL);
    assert_non_null(strstr(text, "9 us"));
    cfg.pulse_us = 1000;
    cfg.delay_us[0] = -1;
    assert_int_equal(sst_trigger_open(&t, &cfg, NULL, NULL), -EINVAL);
    assert_non_null(strstr(text, "-1 us"));
    assert_null(t);
    cfg.source = SST_TRIGGER_SOFTWARE;
    assert_int_equal(sst_trigger_open(&t, &cfg, NULL, NULL), 0);
    assert_int_equal(sst_trigger_start(t, 0, 1), -EINVAL);
    assert_int_equal(sst_trigger_start(t, 1001, 1), -EINVAL);
    assert_non_null(strstr(text, "1001/s"));
    sst_trigger_close(t);
    sst_trigger_close(NULL);
    (void)sst_log_hold_errors(NULL);
}

static void free_run_has_no_edges(void **state SST_UNUSED)
{
    struct sst_trigger_config cfg;
    struct marks marks = { 0 };
    struct sst_trigger *t;

    sst_trigger_config_defaults(&cfg);
    cfg.source = SST_TRIGGER_FREE_RUN;
    assert_int_equal(sst_trigger_open(&t, &cfg, note, &marks), 0);
    assert_int_equal(sst_trigger_start(t, 10, 0), 0);
    assert_false(sst_trigger_idle(t));
    assert_int_equal(sst_trigger_stop(t), 0);
    assert_true(sst_trigger_idle(t));
    assert_int_equal(marks.n, 0);
    sst_trigger_close(t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(equal_delays_change_in_one_step),
        cmocka_unit_test(groups_rise_and_fall_in_order_of_time),
        cmocka_unit_test(all_64_lines_may_differ),
        cmocka_unit_test(beats_do_not_drift),
        cmocka_unit_test(late_beats_are_skipped),
        cmocka_unit_test(stamps_of_both_clocks_become_monotonic),
        cmocka_unit_test(software_train_marks_absolute_beats),
        cmocka_unit_test(stop_does_not_wait_for_the_beat),
        cmocka_unit_test(held_up_train_skips_and_keeps_the_beat),
        cmocka_unit_test(wrong_settings_are_named),
        cmocka_unit_test(free_run_has_no_edges),
    };

    return cmocka_run_group_tests_name("trigger", tests, NULL, NULL);
}
