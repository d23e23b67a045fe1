/* drivers/trigger on the simulated GPIO chip: trains with loop-back stamps, groups, and every fault by its name. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "drivers/trigger/trigger.h"
#include "tests/quick.h"
#include "tests/sim_session.h"
#include "tests/test.h"

#define PATIENCE_MS 60000 /* for events that come on any machine, sooner or later */

static void set_fault(const char *fault)
{
    assert_int_equal(session_fault(fault), 0);
}

static struct sst_trigger_config config(int lines, const char *loopback)
{
    struct sst_trigger_config cfg;

    sst_trigger_config_defaults(&cfg);
    strcpy(cfg.chip, "sst-trigger");
    cfg.lines = lines;
    for (int i = 0; i < lines; i++)
        snprintf(cfg.line[i], sizeof(cfg.line[i]), "TRIG%d", i);
    strcpy(cfg.loopback, loopback);
    return cfg;
}

struct edges {
    _Atomic int n;
    struct sst_trigger_edge edge[256];
};

static void note(void *arg, const struct sst_trigger_edge *edge)
{
    struct edges *e = arg;

    if (e->n < 256) {
        e->edge[e->n] = *edge;
        e->n++;
    }
}

static bool wait_idle(const struct sst_trigger *t, int timeout_ms)
{
    for (int i = 0; i < timeout_ms && !sst_trigger_idle(t); i++)
        usleep(1000);
    return sst_trigger_idle(t);
}

/* 20/s: 20 edges, each stamped by the chip between the reads around the ioctl. @return number within 1 ms of their tick
 */
static int train_of_a_second(struct sst_trigger *t, struct edges *edges)
{
    const int first = edges->n;
    int near = 0;

    assert_int_equal(sst_trigger_start(t, 20, 20), 0);
    assert_true(wait_idle(t, PATIENCE_MS));
    assert_int_equal(sst_trigger_stop(t), 0);
    for (int i = first; i < edges->n; i++) {
        const struct sst_trigger_edge *e = &edges->edge[i];

        assert_int_equal((e->due_ns - edges->edge[first].due_ns) % 50000000, 0);
        assert_true(e->before_ns >= e->due_ns);
        assert_true(e->kernel_ns >= e->before_ns && e->kernel_ns <= e->after_ns);
        near += e->kernel_ns - e->due_ns < 1000000;
    }
    return near;
}

/* How many edges are on time is judged on a quiet machine only; the best of several trains counts. */
static void beats_are_kept(void **state SST_UNUSED)
{
    const struct sst_trigger_config cfg = config(6, "LOOP0");
    struct edges edges = { .n = 0 };
    struct sst_trigger_counters counters;
    struct sst_trigger *t;
    int near = 0, best = 0;

    assert_int_equal(sst_trigger_open(&t, &cfg, note, &edges), 0);
    for (int i = 0; i < (quick_is_measured() ? 12 : 1) && best < 10; i++) {
        near = train_of_a_second(t, &edges);
        best = near > best ? near : best;
        if (near < 10)
            print_message("%d of 20 ticks within 1 ms\n", near);
    }
    sst_trigger_counters(t, &counters);
    assert_int_equal(edges.n, counters.fired);
    assert_int_equal(counters.fired % 20, 0);
    assert_int_equal(counters.edges_missing, 0);
    sst_trigger_close(t);
    if (quick_is_measured())
        assert_in_range(best, 10, 20);
}

/* Two groups, 2 ms apart; the loop-back line hangs on the first one. */
static void groups_fire_one_after_the_other(void **state SST_UNUSED)
{
    struct sst_trigger_config cfg = config(4, "LOOP0");
    struct edges edges = { .n = 0 };
    struct sst_trigger *t;

    cfg.delay_us[2] = cfg.delay_us[3] = 2000;
    assert_int_equal(sst_trigger_open(&t, &cfg, note, &edges), 0);
    assert_int_equal(sst_trigger_start(t, 50, 10), 0);
    assert_true(wait_idle(t, PATIENCE_MS));
    assert_true(edges.n > 0);
    assert_true(edges.edge[0].kernel_ns >= edges.edge[0].before_ns);
    assert_int_equal(sst_trigger_fire(t), 0);
    sst_trigger_close(t);
}

static void offsets_and_names_alone_will_do(void **state SST_UNUSED)
{
    struct sst_trigger_config cfg = config(1, "");
    struct sst_trigger *t;

    cfg.chip[0] = 0;
    assert_int_equal(sst_trigger_open(&t, &cfg, NULL, NULL), 0);
    assert_int_equal(sst_trigger_fire(t), 0);
    sst_trigger_close(t);
    strcpy(cfg.chip, "sst-trigger");
    strcpy(cfg.line[0], "1");
    assert_int_equal(sst_trigger_open(&t, &cfg, NULL, NULL), 0);
    sst_trigger_close(t);
}

/* Messages of refusals. */
static int refusal(const struct sst_trigger_config *cfg, char text[SST_LOG_MAX])
{
    struct sst_trigger *t = NULL;
    char *before = sst_log_hold_errors(text);
    int err;

    text[0] = 0;
    err = sst_trigger_open(&t, cfg, NULL, NULL);
    (void)sst_log_hold_errors(before);
    sst_trigger_close(t);
    return err;
}

static void what_is_not_there_is_named(void **state SST_UNUSED)
{
    struct sst_trigger_config cfg = config(2, "LOOP0");
    char text[SST_LOG_MAX];

    strcpy(cfg.line[1], "TRIG99");
    assert_int_equal(refusal(&cfg, text), -ENODEV);
    assert_non_null(strstr(text, "TRIG99"));
    assert_non_null(strstr(text, "TRIG0"));
    strcpy(cfg.chip, "other-chip");
    assert_int_equal(refusal(&cfg, text), -ENODEV);
    assert_non_null(strstr(text, "other-chip"));
    assert_non_null(strstr(text, "\"sst-trigger\""));
    strcpy(cfg.chip, "sst-trigger");
    strcpy(cfg.line[1], "999");
    assert_int_equal(refusal(&cfg, text), -ENODEV);
    strcpy(cfg.line[1], "0"); /* the offset of TRIG0 */
    assert_int_equal(refusal(&cfg, text), -ENODEV);
    assert_non_null(strstr(text, "line \"0\" of chip /dev/gpiochip1 \"sst-trigger\" is given twice"));
    strcpy(cfg.line[1], "6"); /* the offset of LOOP0 */
    assert_int_equal(refusal(&cfg, text), -ENODEV);
    assert_non_null(strstr(text, "line \"LOOP0\""));
    cfg = config(2, "LOOP0");
    strcpy(cfg.line[1], "TRIG99");
    cfg.chip[0] = 0;
    assert_int_equal(refusal(&cfg, text), -ENODEV);
}

/* Equal adapters: the one with the lines is found; where names do not decide, its path or its device does. */
static void chips_of_one_label(void **state SST_UNUSED)
{
    static const char *const ways[] = { "/dev/gpiochip1", "/sys/bus/gpio/devices/gpiochip1", "gpiochip1" };
    struct sst_trigger_config cfg = config(2, "LOOP0");
    char text[SST_LOG_MAX];
    struct sst_trigger *t;

    set_fault("gpio.twin=1");
    assert_int_equal(sst_trigger_open(&t, &cfg, NULL, NULL), 0);
    sst_trigger_close(t);
    strcpy(cfg.line[1], "TRIG99");
    assert_int_equal(refusal(&cfg, text), -ENODEV);
    assert_non_null(strstr(text, "/dev/gpiochip0"));
    assert_non_null(strstr(text, "/dev/gpiochip1"));
    set_fault("gpio.twin=2");
    for (int by_offset = 0; by_offset < 2; by_offset++) {
        cfg = config(2, "");
        for (int i = 0; by_offset && i < 2; i++)
            snprintf(cfg.line[i], sizeof(cfg.line[i]), "%d", i);
        assert_int_equal(refusal(&cfg, text), -ENOTUNIQ);
        assert_non_null(strstr(text, "both /dev/gpiochip0 and /dev/gpiochip1"));
        for (size_t i = 0; i < ARRAY_LEN(ways); i++) {
            strcpy(cfg.chip, ways[i]);
            assert_int_equal(sst_trigger_open(&t, &cfg, NULL, NULL), 0);
            assert_int_equal(sst_trigger_fire(t), 0);
            sst_trigger_close(t);
        }
        strcpy(cfg.chip, "0000:00:1f.0"); /* the device of both */
        assert_int_equal(refusal(&cfg, text), -ENOTUNIQ);
    }
    set_fault("gpio.twin=3");
    cfg = config(1, "");
    assert_int_equal(refusal(&cfg, text), -ENODEV);
    assert_non_null(strstr(text, "has several lines \"TRIG0\""));
    set_fault("gpio.twin=0");
    strcpy(cfg.chip, "/dev/gpiochip9");
    assert_int_equal(refusal(&cfg, text), -ENODEV);
    assert_non_null(strstr(text, "label, path or device \"/dev/gpiochip9\""));
}

static void line_in_use_names_its_holder(void **state SST_UNUSED)
{
    const struct sst_trigger_config cfg = config(2, "LOOP0");
    char text[SST_LOG_MAX];
    struct sst_trigger *t;

    assert_int_equal(sst_trigger_open(&t, &cfg, NULL, NULL), 0);
    assert_int_equal(refusal(&cfg, text), -EBUSY);
    assert_non_null(strstr(text, "TRIG0"));
    assert_non_null(strstr(text, "in use by \"sst-trigger\""));
    sst_trigger_close(t);
    set_fault("gpio.busy=1");
    assert_int_equal(refusal(&cfg, text), -EBUSY);
    set_fault("gpio.busy=0");
    assert_int_equal(refusal(&cfg, text), 0);
}

static void missing_rights_are_named(void **state SST_UNUSED)
{
    const struct sst_trigger_config cfg = config(2, "LOOP0");
    char text[SST_LOG_MAX];

    set_fault("gpio.denied=1");
    assert_int_equal(refusal(&cfg, text), -EACCES);
    assert_non_null(strstr(text, "no permission"));
    assert_non_null(strstr(text, "group"));
    set_fault("gpio.denied=0");
    assert_int_equal(refusal(&cfg, text), 0);
}

static void lost_edges_are_counted(void **state SST_UNUSED)
{
    const struct sst_trigger_config cfg = config(1, "LOOP0");
    struct edges edges = { .n = 0 };
    struct sst_trigger_counters counters;
    struct sst_trigger *t;

    set_fault("gpio.lost_edges=1");
    assert_int_equal(sst_trigger_open(&t, &cfg, note, &edges), 0);
    assert_int_equal(sst_trigger_start(t, 50, 10), 0);
    assert_true(wait_idle(t, PATIENCE_MS));
    sst_trigger_counters(t, &counters);
    assert_int_equal(counters.edges_missing, counters.fired);
    assert_int_equal(edges.n, counters.fired);
    for (int i = 0; i < edges.n; i++)
        assert_int_equal(edges.edge[i].kernel_ns, 0);
    set_fault("gpio.lost_edges=0");
    assert_int_equal(sst_trigger_fire(t), 0);
    assert_true(edges.edge[edges.n - 1].kernel_ns > 0);
    sst_trigger_close(t);
}

/* The chip goes while a train runs, and comes back: the train has ended with an error, and another one can be started.
 */
static void vanished_chip_is_found_again(void **state SST_UNUSED)
{
    const struct sst_trigger_config cfg = config(6, "LOOP0");
    struct edges edges = { .n = 0 };
    struct sst_trigger_counters counters;
    struct sst_trigger *t;
    int err = -ENODEV;

    assert_int_equal(sst_trigger_open(&t, &cfg, note, &edges), 0);
    assert_int_equal(sst_trigger_start(t, 50, 0), 0);
    usleep(100000);
    set_fault("gpio.vanish=1");
    assert_true(wait_idle(t, PATIENCE_MS));
    assert_true(sst_trigger_stop(t) < 0);
    assert_int_equal(sst_trigger_start(t, 50, 5), -ENODEV);
    assert_int_equal(sst_trigger_fire(t), -ENODEV);
    set_fault("gpio.vanish=0");
    for (int i = 0; i < PATIENCE_MS / 100 && err == -ENODEV; i++) {
        usleep(100000);
        err = sst_trigger_start(t, 50, 5);
    }
    assert_int_equal(err, 0);
    assert_true(wait_idle(t, PATIENCE_MS));
    assert_int_equal(sst_trigger_stop(t), 0);
    sst_trigger_counters(t, &counters);
    assert_int_equal(counters.chip_lost, 1);
    assert_int_equal(counters.chip_found, 1);
    for (int i = 0; i < edges.n; i++)
        assert_int_equal(edges.edge[i].index, i);
    sst_trigger_close(t);
}

/* Looking without taking, for sst doctor. */
static void check_holds_nothing(void **state SST_UNUSED)
{
    struct sst_trigger_config cfg = config(6, "LOOP0");
    struct sst_trigger *t;
    char why[512];

    assert_int_equal(sst_trigger_check(&cfg, why, sizeof(why)), 0);
    assert_non_null(strstr(why, "all 7 lines"));
    assert_int_equal(sst_trigger_open(&t, &cfg, NULL, NULL), 0);
    assert_int_equal(sst_trigger_check(&cfg, why, sizeof(why)), -EBUSY);
    sst_trigger_close(t);
    strcpy(cfg.chip, "none");
    assert_int_equal(sst_trigger_check(&cfg, why, sizeof(why)), -ENODEV);
}

/* Another host fires: here another trigger of this program, with pulses that come in on LOOP0. */
static void edges_of_others_are_counted(void **state SST_UNUSED)
{
    const struct sst_trigger_config fires = config(1, "");
    struct sst_trigger_config cfg = config(0, "LOOP0");
    struct sst_trigger *other, *t;
    struct sst_trigger_counters counters;
    static struct edges edges;

    cfg.source = SST_TRIGGER_EXTERNAL;
    assert_int_equal(sst_trigger_open(&other, &fires, NULL, NULL), 0);
    assert_int_equal(sst_trigger_open(&t, &cfg, note, &edges), 0);
    assert_int_equal(sst_trigger_fire(other), 0); /* before the start: not counted */
    assert_int_equal(sst_trigger_start(t, 20, 0), 0);
    assert_int_equal(sst_trigger_start(other, 50, 30), 0); /* it does not matter how fast they come */
    for (int i = 0; i < PATIENCE_MS && edges.n < 30; i++)
        usleep(1000);
    assert_int_equal(edges.n, 30);
    for (int i = 0; i < 30; i++) {
        assert_int_equal(edges.edge[i].index, i);
        assert_true(edges.edge[i].kernel_ns > 0);
        assert_true(!i || edges.edge[i].kernel_ns > edges.edge[i - 1].kernel_ns);
    }
    sst_trigger_counters(t, &counters);
    assert_int_equal(counters.fired, 30);
    assert_false(sst_trigger_idle(t));
    assert_int_equal(sst_trigger_stop(t), 0);
    assert_int_equal(sst_trigger_start(t, 20, 5), 0);
    assert_int_equal(sst_trigger_start(other, 50, 10), 0);
    assert_true(wait_idle(t, PATIENCE_MS)); /* after 5 of them */
    assert_int_equal(edges.n, 35);
    assert_int_equal(edges.edge[34].index, 34);
    sst_trigger_close(t);
    sst_trigger_close(other);
}

static void an_input_must_be_named(void **state SST_UNUSED)
{
    struct sst_trigger_config cfg = config(0, "");
    char why[500];

    cfg.source = SST_TRIGGER_EXTERNAL;
    assert_int_equal(sst_trigger_check(&cfg, why, sizeof(why)), -EINVAL);
    assert_contains(why, "loopback");
    strcpy(cfg.loopback, "LOOP9");
    assert_int_equal(sst_trigger_check(&cfg, why, sizeof(why)), -ENODEV);
    assert_contains(why, "LOOP9");
    strcpy(cfg.loopback, "LOOP0");
    assert_int_equal(sst_trigger_check(&cfg, why, sizeof(why)), 0);
}

int main(int argc SST_UNUSED, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(beats_are_kept),
        cmocka_unit_test(groups_fire_one_after_the_other),
        cmocka_unit_test(offsets_and_names_alone_will_do),
        cmocka_unit_test(what_is_not_there_is_named),
        cmocka_unit_test(chips_of_one_label),
        cmocka_unit_test(line_in_use_names_its_holder),
        cmocka_unit_test(missing_rights_are_named),
        cmocka_unit_test(lost_edges_are_counted),
        cmocka_unit_test(vanished_chip_is_found_again),
        cmocka_unit_test(check_holds_nothing),
        cmocka_unit_test(edges_of_others_are_counted),
        cmocka_unit_test(an_input_must_be_named),
    };
    int skipped;

    if (!WITH_GPIOD) {
        puts("built without libgpiod");
        return 77;
    }
    skipped = session_enter(argv);
    if (skipped)
        return skipped;
    return cmocka_run_group_tests_name("trigger on a simulated chip", tests, NULL, NULL);
}
