/* The second pass and the carrying of maps on the dummy device: the bytes of the CPU, whatever fails where. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/log.h"
#include "tests/match_field.h"
#include "tests/second_field.h"
#include "tests/small.h"

static const unsigned surfaces = 1U << SST_DISPARITY_STAGE_SURFACES, carrying = 1U << SST_DISPARITY_STAGE_CARRY;

static struct sst_runner_user *open_device(const char *name, uint64_t memory_bytes)
{
    struct sst_runner_user *device;

    assert_int_equal(match_device_create(&device, name, memory_bytes), 0);
    return device;
}

static void test_same_bytes(void **state)
{
    struct sst_runner_user *device = open_device("dummy", 0);
    struct sst_step_report report;

    (void)state;
    for (int skip = 0; skip < 2; skip++) {
        second_compare(device, skip, &report);
        print_message("%lld dispatches, %lld bytes up\n", (long long)report.dispatches, (long long)report.upload_bytes);
        assert_int_equal(report.items[SST_DISPARITY_TESTED].device, SECOND_TESTED);
        assert_int_equal(report.items[SST_DISPARITY_TESTED].on_cpu, 0);
        assert_int_equal(report.failures, 0);
        assert_int_equal(report.stages_on_cpu, 0);
    }
    match_device_destroy(device);
}

/* Wherever the device is lost, the CPU goes on from there, and what it did is named. */
static void test_lost(void **state)
{
    unsigned seen = 0;

    (void)state;
    for (int at = 1; at < 120; at += 1 + (small_level() ? at : at / 5)) {
        struct sst_step_report report;
        struct sst_runner_user *device;
        char name[32];

        snprintf(name, sizeof(name), "dummy:known=1,lost=%d", at);
        device = open_device(name, 0);
        second_compare(device, at % 2, &report);
        print_message("%s: tested %lld, stages %x, %s\n", name, (long long)report.items[SST_DISPARITY_TESTED].device,
                      report.stages_on_cpu, report.why);
        assert_int_equal(report.items[SST_DISPARITY_TESTED].device + report.items[SST_DISPARITY_TESTED].on_cpu,
                         SECOND_TESTED);
        assert_true(report.failures > 0);
        assert_true(report.stages_on_cpu & (surfaces | carrying));
        assert_int_equal(report.stages_on_cpu & ~(surfaces | carrying), 0);
        assert_string_equal(report.why, "the device is lost");
        seen |= report.stages_on_cpu;
        match_device_destroy(device);
    }
    assert_int_equal(seen, surfaces | carrying);
}

/* A device without room is not to blame. */
static void test_small(void **state)
{
    struct sst_runner_user *device = open_device("dummy:known=1", (uint64_t)800 << 10);
    struct sst_step_report report;

    (void)state;
    second_compare(device, true, &report);
    assert_int_equal(report.items[SST_DISPARITY_TESTED].device, 0);
    assert_int_equal(report.items[SST_DISPARITY_TESTED].on_cpu, SECOND_TESTED);
    assert_int_equal(report.failures, 0);
    assert_int_equal(report.stages_on_cpu, surfaces);
    assert_string_equal(report.why, "not enough memory on the device");
    match_device_destroy(device);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        serial_test(test_same_bytes),
        serial_test(test_lost),
        cmocka_unit_test(test_small),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
