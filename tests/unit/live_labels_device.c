/* Labels of a live scene on the dummy device against those of the CPU: of the reference view and of all views, with
 * devices that fail, come back, or are not there. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <unistd.h>

#include "base/log.h"
#include "tests/device_nets.h"
#include "tests/moving_square.h"
#include "tests/small.h"

#define SETS    24
#define VIEWS   9
#define STEP_NS INT64_C(400000000) /* the network may run in every fourth set */

static uint64_t label_bytes; /* of memory; 0: no limit */
static char model[] = "/tmp/sst-live-labels-XXXXXX";

static void write_model(void)
{
    struct ow_buf m = nets_pyramid(NULL);
    const int fd = mkstemp(model);

    ow_metadata(&m, "sst.classes", "Wall,Person,Car,Tree,Sky");
    ow_metadata(&m, "sst.size", "64x48");
    ow_metadata(&m, "sst.epsilon_h", "10");
    assert_true(fd >= 0);
    assert_int_equal(write(fd, m.p, m.n), (ssize_t)m.n);
    close(fd);
    free(m.p);
}

/* @param device  NULL: the CPU */
static void open_labelled(struct field *f, const char *device, bool skip_labels)
{
    init_field(f, 3, 3);
    f->cfg.model = model;
    f->cfg.precision = SST_PRECISION_F32;
    f->cfg.device = device;
    f->cfg.device_label_bytes = label_bytes;
    f->cfg.skip_labels = skip_labels;
    assert_int_equal(sst_livescene_open(&f->scene, &f->cfg, &f->lf), 0);
}

/* Bring a field to a set. @return runs of the network */
static int64_t step(struct field *f, int set)
{
    const struct sst_live_input in = { .t_ns = (set + 1) * STEP_NS };

    draw(f, 20 + 8 * (set % 20));
    assert_int_equal(sst_livescene_update(f->scene, &f->changes, &in, &f->report), 0);
    return f->report.label_runs;
}

/* Floats are summed in another order there: a tie may fall otherwise. */
static void expect_labels(const struct field *a, const struct field *b)
{
    int64_t other = 0, labelled = 0;

    for (int view = 0; view < VIEWS; view++) {
        const struct sst_map_u8 *p = &a->lf.views[view].label, *q = &b->lf.views[view].label;

        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++) {
                other += sst_map_u8_row(p, y)[x] != sst_map_u8_row(q, y)[x];
                labelled += sst_map_u8_row(p, y)[x] != SST_LABEL_NONE;
            }
        }
    }
    assert_true(labelled > VIEWS * WIDTH * HEIGHT / 2);
    assert_true(other * 1000 <= VIEWS * WIDTH * HEIGHT);
}

/* A scene with a device, beside one on the CPU. */
struct seen {
    struct sst_network_device_report report;
    int lost, found;
};

static struct seen follow(const char *device, bool skip_labels, int sets)
{
    struct field cpu, gpu;
    struct seen seen = { .lost = 0 };
    bool failing;
    int64_t runs = 0;

    open_labelled(&cpu, NULL, skip_labels);
    open_labelled(&gpu, device, skip_labels);
    assert_false(sst_livescene_device(cpu.scene, &seen.report));
    assert_true(sst_livescene_device(gpu.scene, &seen.report));
    failing = seen.report.step.failing;
    for (int set = 0; set < sets; set++) {
        const int64_t here = step(&cpu, set), there = step(&gpu, set);

        assert_int_equal(here, there);
        expect_labels(&cpu, &gpu);
        assert_true(sst_livescene_device(gpu.scene, &seen.report));
        runs += there;
        assert_int_equal(seen.report.runs + seen.report.on_cpu, runs);
        seen.lost += seen.report.step.failing && !failing;
        seen.found += !seen.report.step.failing && failing;
        failing = seen.report.step.failing;
    }
    assert_true(skip_labels ? runs >= sets / 4 : runs > sets);
    close_field(&cpu);
    close_field(&gpu);
    return seen;
}

static void labels_are_the_cpus(void **state SST_UNUSED)
{
    for (int all = 0; all < 2; all++) {
        const struct seen seen = follow("dummy", !all, all ? 4 : SETS);

        assert_string_equal(seen.report.step.name, "dummy");
        assert_int_equal(seen.report.on_cpu, 0);
        assert_int_equal(seen.report.step.failures, 0);
        assert_false(seen.report.step.failing);
    }
}

static bool opens_if_lost_at(long dispatch)
{
    char name[64];
    struct sst_runner_user *d;

    snprintf(name, sizeof(name), "dummy:known=1,lost=%ld", dispatch);
    if (sst_network_device_open(&d, name, 0))
        return false;
    sst_network_device_close(d);
    return true;
}

/* Dispatches of an opening's self-tests, those of a run, and of the layers' self-tests, which come with the first run.
 */
static void count_dispatches(long *opening, long *run)
{
    char text[SST_LOG_MAX];
    long most = 1, lost = 0; /* opens; does not */

    sst_log_hold_errors(text);
    while (!opens_if_lost_at(most)) {
        lost = most;
        most *= 2;
    }
    while (most - lost > 1) {
        const long at = lost + (most - lost) / 2;

        if (opens_if_lost_at(at))
            most = at;
        else
            lost = at;
    }
    sst_log_hold_errors(NULL);
    *opening = most;
    *run = (long)follow("dummy:known=1", true, 1).report.step.dispatches;
}

/* Lost again and again: every set has its labels, those of the CPU. */
static void a_device_that_fails_costs_no_labels(void **state SST_UNUSED)
{
    char name[64];
    long opening, run;
    struct seen seen;

    count_dispatches(&opening, &run);
    /* At each opening's first run or in the tests before it. */
    snprintf(name, sizeof(name), "dummy:known=1,lost=%ld", opening + run / 2);
    seen = follow(name, true, SETS);
    assert_int_equal(seen.lost, 1);
    assert_int_equal(seen.found, 0);
    assert_int_equal(seen.report.runs, 0);
    assert_true(seen.report.step.failures >= 2);
    assert_contains(seen.report.step.failure, "the device is lost");
    /* After some runs. */
    for (long k = 4; k < 12; k += 4) {
        snprintf(name, sizeof(name), "dummy:known=1,timeout=%ld", opening + k * run);
        seen = follow(name, true, 2 * SETS);
        print_message("%s: %d runs, %d on the CPU, %d failures, lost %d, found %d times\n", name, (int)seen.report.runs,
                      (int)seen.report.on_cpu, (int)seen.report.step.failures, seen.lost, seen.found);
        assert_true(seen.report.step.failures >= 1 && seen.report.runs >= 1);
        assert_int_equal(seen.report.step.failures, seen.lost);
        assert_contains(seen.report.step.failure, "does not answer");
    }
}

static void without_a_device_labels_are_the_cpus(void **state SST_UNUSED)
{
    static const char *const names[] = { "no such device", "dummy:late=1", "dummy:wrong=1" };
    static const char *const none[] = { "cpu", "auto" };
    struct sst_network_device_report report;
    struct field f;

    for (size_t i = 0; i < ARRAY_LEN(names); i++) {
        const struct seen seen = follow(names[i], true, SETS);

        assert_int_equal(seen.report.runs, 0);
        assert_true(seen.report.on_cpu > 0 && *seen.report.step.why);
        assert_true(seen.report.step.failing && *seen.report.step.failure);
        assert_true(i == 2 ? seen.report.step.failures == 1 : seen.report.step.failures >= 2);
        assert_string_equal(seen.report.step.name, names[i]);
    }
    for (size_t i = 0; i < ARRAY_LEN(none); i++) {
        open_labelled(&f, none[i], true);
        assert_int_equal(step(&f, 0), 1);
        assert_false(sst_livescene_device(f.scene, &report));
        close_field(&f);
    }
}

/* A network that does not fit is the CPU's, and the device is not to blame. */
static void memory_is_bounded(void **state SST_UNUSED)
{
    struct seen seen = follow("dummy:known=1", true, 1);

    label_bytes = (uint64_t)seen.report.memory_bytes - 1000;
    seen = follow("dummy:known=1", true, 5);
    label_bytes = 0;
    assert_int_equal(seen.report.runs, 0);
    assert_int_equal(seen.report.step.failures, 0);
    assert_contains(seen.report.step.why, "does not fit");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        serial_test(labels_are_the_cpus),
        cmocka_unit_test(a_device_that_fails_costs_no_labels),
        serial_test(without_a_device_labels_are_the_cpus),
        serial_test(memory_is_bounded),
    };
    int failed;

    if (!WITH_DNNL) {
        print_message("built without oneDNN: no network runs on a device\n");
        return 77;
    }
    setenv("VK_DRIVER_FILES", "/dev/null", 1);
    sst_log_set_level(SST_LOG_ERROR);
    write_model();
    failed = cmocka_run_group_tests(tests, NULL, NULL);
    unlink(model);
    return failed;
}
