/* Matching on a device, on the dummy device: the bytes of the CPU, faults, what ends on the CPU. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>

#include "base/log.h"
#include "tests/match_field.h"
#include "tests/small.h"

static const unsigned check = 1U << SST_DISPARITY_STAGE_CHECK, fill = 1U << SST_DISPARITY_STAGE_FILL,
                      subpixel = 1U << SST_DISPARITY_STAGE_SUBPIXEL, background = 1U << SST_DISPARITY_STAGE_BACKGROUND;

static void test_same_bytes(void **state)
{
    static const int tested[] = { 0, 8, 16, 0, 8, 8 }; /* views whose hypotheses are, by round */
    static const char *const names[] = { "dummy", "dummy:subgroup=1,dot=1", "dummy:known=1",
                                         "dummy:known=1,subgroup=1,dot=1" };
    struct sst_step_report report;
    struct sst_disparity_config cfg;
    struct sst_lightfield lf;

    (void)state;
    match_init(&lf, 3, 3, 97, 60, 8);
    for (int i = 0; match_config(&cfg, i); i++) {
        /* Without variants of shaders, and with them. */
        assert_int_equal(match_device_create(&cfg.runner, names[sst_min_int(i, 2 + i % 2)], 0), 0);
        match_compare(&lf, &cfg, &report);
        print_message("%d: %lld views, %lld tested, %lld dispatches, %lld uploads\n", i,
                      (long long)report.items[SST_DISPARITY_MATCHED].device,
                      (long long)report.items[SST_DISPARITY_TESTED].device, (long long)report.dispatches,
                      (long long)report.uploads);
        assert_int_equal(report.items[SST_DISPARITY_TESTED].device, tested[i]);
        assert_int_equal(report.items[SST_DISPARITY_TESTED].on_cpu, 0);
        assert_int_equal(report.stages_on_cpu & ~(1U << SST_DISPARITY_STAGE_SWEEP), 0);
        assert_true(report.items[SST_DISPARITY_MATCHED].device >= 3);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu, 0);
        assert_int_equal(report.failures, 0);
        assert_true(report.uploads >= 8); /* colours, once, and maps that the dummy device does not compute */
        assert_string_equal(report.why, "");
        sst_disparity_device_report(cfg.runner, &report); /* since the last one */
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].device, 0);
        assert_string_equal(report.name, "dummy");
        match_device_destroy(cfg.runner);
    }
    sst_lightfield_fini(&lf);
}

/* A range of few pixels: steps and costs between them, refined afterwards. */
static void test_narrow(void **state)
{
    struct sst_step_report report;
    struct sst_disparity_config cfg;
    struct sst_lightfield lf;

    (void)state;
    match_init(&lf, 3, 3, 90, 41, 1.5);
    assert_true(match_config(&cfg, 2));
    cfg.disp_max_px = 3;
    assert_int_equal(match_device_create(&cfg.runner, "dummy:known=1", 0), 0);
    match_compare(&lf, &cfg, &report);
    assert_int_equal(report.items[SST_DISPARITY_MATCHED].device, 8);
    assert_int_equal(report.stages_on_cpu, 0);
    assert_string_equal(sst_disparity_stage_name(SST_DISPARITY_STAGE_SUBPIXEL), "subpixel");
    match_device_destroy(cfg.runner);
    sst_lightfield_fini(&lf);
}

/* Windows of disparities by tile, found at a quarter of the size, which is matched there as well. */
static void test_tiles(void **state)
{
    struct sst_step_report report;
    struct sst_disparity_report skipped;
    struct sst_disparity_config cfg;
    struct sst_lightfield lf;

    (void)state;
    match_init(&lf, 1, 3, 230, 192, 21);
    match_config_tiles(&cfg);
    cfg.report = &skipped;
    assert_int_equal(match_device_create(&cfg.runner, "dummy:known=1", 0), 0);
    match_compare(&lf, &cfg, &report);
    assert_true(skipped.ranges_skipped > 0);
    assert_int_equal(report.items[SST_DISPARITY_MATCHED].device, 6);
    assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu, 0);
    match_device_destroy(cfg.runner);
    sst_lightfield_fini(&lf);
}

/* What does not fit at once is matched in bands of rows, along which paths go on. */
static void test_bands(void **state)
{
    struct sst_step_report report;
    struct sst_disparity_config cfg;
    struct sst_lightfield lf;

    (void)state;
    match_init(&lf, 3, 3, 97, 60, 8);
    for (int i = 4; i < 6; i++) { /* with 8 paths and 4, the latter aggregated twice */
        assert_true(match_config(&cfg, i));
        cfg.phase_step = 2;
        cfg.rounds = 0;
        cfg.key_spacing = 1;
        assert_int_equal(match_device_create(&cfg.runner, i == 4 ? "dummy:known=1,buffer=340" : "dummy:known=1,buffer=460", 0), 0);
        match_compare(&lf, &cfg, &report);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].device, 8);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].in_bands, 8);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu, 0);
        match_device_destroy(cfg.runner);
    }
    sst_lightfield_fini(&lf);
    match_init(&lf, 1, 3, 230, 192, 21); /* rows of tiles */
    match_config_tiles(&cfg);
    assert_int_equal(match_device_create(&cfg.runner, "dummy:known=1,buffer=3900", 0), 0);
    match_compare(&lf, &cfg, &report);
    assert_int_equal(report.items[SST_DISPARITY_MATCHED].in_bands, 3);
    assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu, 0);
    match_device_destroy(cfg.runner);
    sst_lightfield_fini(&lf);
}

/* What a device fails at ends on the CPU with the same bytes; then it is opened again. */
static void test_fallback(void **state)
{
    static const struct {
        const char *fault;
        int of; /* lost, timeout: dispatches after the self-tests */
        const char *why;
        int views, failures;
    } devices[] = {
        { "lost", 1, "the device is lost", 0, 3 }, /* always at the first view: pauses of 0, 1, 3 pairs */
        { "timeout", 51, "the device does not answer", 4, 2 },
        { "memory", 2, "not enough memory on the device", 0, 0 }, /* of which less is used */
        { "buffer", 340, "not enough memory on the device", 0, 0 },
    };
    struct sst_step_report report;
    struct sst_disparity_config cfg;
    struct match_reference ref;
    struct sst_lightfield lf;
    char name[64];

    (void)state;
    match_init(&lf, 3, 3, 97, 60, 8);
    assert_true(match_config(&cfg, 2));
    cfg.rounds = cfg.subpixel_steps = 0; /* the first pass alone */
    cfg.fill = false;
    match_on_cpu(&ref, &lf, &cfg);
    for (size_t i = 0; i < ARRAY_LEN(devices); i++) {
        snprintf(name, sizeof(name), "dummy:known=1,%s=%d", devices[i].fault, devices[i].of);
        print_message("%s\n", name);
        assert_int_equal(match_device_create(&cfg.runner, name, i == 2 ? (uint64_t)1100 << 10 : 0), 0);
        match_compare_to(&ref, &lf, &cfg, &report);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].device, devices[i].views);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu, 8 - devices[i].views);
        assert_int_equal(report.failures, devices[i].failures);
        assert_string_equal(report.why, devices[i].why);
        match_device_destroy(cfg.runner);
    }
    match_reference_fini(&ref);
    sst_lightfield_fini(&lf);
}

/* Dispatches of a device that does not fail, without what comes after a step. */
static int dispatches(struct sst_lightfield *lf, int rounds, int subpixel_steps, bool filled)
{
    struct sst_step_report report;
    struct sst_disparity_config cfg;

    assert_true(match_config(&cfg, 2));
    cfg.rounds = rounds;
    cfg.subpixel_steps = subpixel_steps;
    cfg.fill = filled;
    assert_int_equal(match_device_create(&cfg.runner, "dummy:known=1", 0), 0);
    assert_int_equal(sst_disparity_lightfield(lf, &cfg, NULL, NULL), 0);
    sst_disparity_device_report(cfg.runner, &report);
    match_device_destroy(cfg.runner);
    return (int)report.dispatches;
}

/* A device that is lost in the second pass is opened again for the next round; in a later step, the CPU does the rest
 * of that step. */
static void test_fallback_later(void **state)
{
    struct {
        int after;  /* dispatches */
        int tested; /* 16 with those on the CPU */
        bool filled;
        unsigned stages;                      /* on the CPU besides those without shaders */
    } lost[] = { { 2 * 8 + 14, 8, false, 0 }, /* after the 8 views are loaded */
                 { 8 + 12, 16, true, subpixel },
                 { 4, 16, true, check }, /* the device is opened again for the filling */
                 { 8 + 20, 16, true, fill | background } };
    const unsigned all = check | fill | subpixel | background;
    struct sst_step_report report;
    struct sst_disparity_config cfg;
    struct match_reference ref;
    struct sst_lightfield lf;
    char name[64];
    int matched;

    (void)state;
    match_init(&lf, 3, 3, 97, 60, 8);
    lost[0].after += dispatches(&lf, 0, 0, false);
    lost[1].after += dispatches(&lf, 2, 0, false);
    matched = dispatches(&lf, 2, 1, false);
    lost[2].after += matched;
    lost[3].after += matched;
    for (size_t i = 0; i < ARRAY_LEN(lost); i++) {
        snprintf(name, sizeof(name), "dummy:known=1,lost=%d", lost[i].after);
        assert_true(match_config(&cfg, 2));
        cfg.fill = lost[i].filled;
        cfg.subpixel_steps = 1; /* so few dispatches that the device is not lost once more */
        assert_int_equal(match_device_create(&cfg.runner, name, 0), 0);
        if (i == 0 || lost[i].filled != lost[i - 1].filled) {
            if (i > 0)
                match_reference_fini(&ref);
            match_on_cpu(&ref, &lf, &cfg);
        }
        match_compare_to(&ref, &lf, &cfg, &report);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].device, 8);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu, 0);
        assert_int_equal(report.failures, 1);
        assert_int_equal(report.items[SST_DISPARITY_TESTED].device + report.items[SST_DISPARITY_TESTED].on_cpu, 16);
        assert_in_range(report.items[SST_DISPARITY_TESTED].device, lost[i].tested, lost[i].tested + 2);
        assert_int_equal(report.stages_on_cpu & all, lost[i].stages);
        assert_int_equal(report.stages_on_cpu >> SST_DISPARITY_STAGE_SURFACES & 1,
                         report.items[SST_DISPARITY_TESTED].on_cpu > 0);
        assert_string_equal(report.why, "the device is lost");
        match_device_destroy(cfg.runner);
    }
    match_reference_fini(&ref);
    sst_lightfield_fini(&lf);
}

/* The range of disparities, which is searched with pairs of views, at a part of their size. */
static void test_range(void **state)
{
    const struct {
        const char *name;
        bool on_cpu; /* some pair */
    } devices[] = { { "dummy:known=1", false }, { "dummy:known=1,lost=9", true } };
    const struct sst_disparity_search on_cpu = { .scale = 1, .threads = 2 };
    double want[2], got[2];
    struct sst_lightfield lf;

    (void)state;
    match_init(&lf, 1, 3, 400, 300, 8);
    assert_int_equal(sst_disparity_range(&lf, &on_cpu, &want[0], &want[1]), 0);
    for (size_t i = 0; i < ARRAY_LEN(devices); i++) {
        struct sst_disparity_search search = on_cpu;
        struct sst_step_report report;

        assert_int_equal(match_device_create(&search.runner, devices[i].name, 0), 0);
        assert_int_equal(sst_disparity_range(&lf, &search, &got[0], &got[1]), 0);
        assert_memory_equal(got, want, sizeof(want));
        sst_disparity_device_report(search.runner, &report);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].device + report.items[SST_DISPARITY_MATCHED].on_cpu,
                         4); /* of two pairs */
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu > 0, devices[i].on_cpu);
        assert_int_equal(report.stages_on_cpu >> SST_DISPARITY_STAGE_RANGE & 1, devices[i].on_cpu);
        match_device_destroy(search.runner);
    }
    sst_lightfield_fini(&lf);
}

/* Steps are compared with the CPU as the device is opened: the last result of the last one counts. */
static void test_steps_are_compared(void **state)
{
    struct sst_runner_user *device;
    char name[32], text[SST_LOG_MAX];

    (void)state;
    snprintf(name, sizeof(name), "dummy:wrong=%d", match_self_tests());
    sst_log_hold_errors(text);
    assert_int_equal(match_device_create(&device, name, 0), -ENOTSUP);
    sst_log_hold_errors(NULL);
    assert_contains(text, "cannot match");
}

/* What has no shader, devices that are not there or wrong. */
static void test_refused(void **state)
{
    struct sst_step_report report;
    struct sst_runner_user *none;
    struct sst_disparity_config cfg;
    struct sst_lightfield lf;
    char text[SST_LOG_MAX];

    (void)state;
    match_init(&lf, 3, 3, 90, 41, 4);
    assert_true(match_config(&cfg, 2));
    cfg.joint = false;
    assert_int_equal(match_device_create(&cfg.runner, "dummy:known=1", 0), 0);
    match_compare(&lf, &cfg, &report);
    assert_int_equal(report.items[SST_DISPARITY_MATCHED].device, 0);
    assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu, 8);
    assert_string_equal(report.why, "maps of two directions are fused");
    cfg.joint = true;
    cfg.support_after = 1;
    match_compare(&lf, &cfg, &report);
    assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu, 8);
    assert_string_equal(report.why, "costs are aggregated after the optimisation");
    match_device_destroy(cfg.runner);
    sst_lightfield_fini(&lf);

    assert_int_equal(match_device_create(&none, "cpu", 0), 0);
    assert_null(none);
    sst_log_hold_errors(text);
    assert_int_equal(match_device_create(&none, "no such device", 0), -ENOENT);
    assert_int_equal(match_device_create(&none, "dummy:wrong=3", 0), -ENOTSUP);
    assert_contains(text, "cannot match");
    sst_log_hold_errors(NULL);
    match_device_destroy(NULL);
}

/* A range that is too wide for the sweep: all views are matched, and have maps. */
static void test_wide(void **state SST_UNUSED)
{
    struct sst_step_report report;
    struct sst_disparity_config cfg;
    struct sst_lightfield lf;

    match_init(&lf, 3, 3, 97, 60, 8);
    assert_true(match_config(&cfg, 1));
    cfg.key_error = -1;
    cfg.disp_max_px = 90;
    cfg.memory = 1 << 16;
    assert_int_equal(match_device_create(&cfg.runner, "dummy:known=1", 0), 0);
    match_compare(&lf, &cfg, &report);
    assert_int_equal(report.stages_on_cpu >> SST_DISPARITY_STAGE_SWEEP & 1, 0);
    assert_int_equal(report.items[SST_DISPARITY_MATCHED].device, 8);
    match_device_destroy(cfg.runner);
    sst_lightfield_fini(&lf);
}

/* A sweep in scene space makes the maps of views that have texture everywhere, and of no others. */
static void test_sweep_needs_texture(void **state SST_UNUSED)
{
    struct sst_step_report report;
    struct sst_disparity_config cfg;
    struct sst_lightfield lf;

    match_init(&lf, 3, 3, 97, 60, 8);
    assert_true(match_config(&cfg, 1));
    cfg.key_error = -1;
    for (int flat = 0; flat < 2; flat++) {
        for (int k = 0; flat && k < 9; k++) {
            for (int i = 0; lf.views[k].present && i < 3 * 60; i++) {
                for (int x = 0; x < 40; x++) /* a wall, on the left */
                    sst_image_row(&lf.views[k].image, i % 3, i / 3)[x] = (uint8_t)(100 + x % 9);
            }
        }
        assert_int_equal(match_device_create(&cfg.runner, "dummy:known=1", 0), 0);
        match_compare(&lf, &cfg, &report);
        assert_int_equal(report.stages_on_cpu >> SST_DISPARITY_STAGE_SWEEP & 1, !flat);
        match_device_destroy(cfg.runner);
    }
    sst_lightfield_fini(&lf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        serial_test(test_same_bytes), cmocka_unit_test(test_narrow),    plain_test(test_sweep_needs_texture),
        cmocka_unit_test(test_wide),  serial_test(test_tiles),          serial_test(test_bands),
        serial_test(test_fallback),   serial_test(test_fallback_later), cmocka_unit_test(test_steps_are_compared),
        cmocka_unit_test(test_range), cmocka_unit_test(test_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
