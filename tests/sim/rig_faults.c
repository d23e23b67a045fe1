/* Every fault of the simulated drives during a capture: named, counted, recovered or reported in time, never a view
 * that was taken while the rig moved. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>

#include "base/log.h"
#include "tests/quick.h"
#include "tests/rig_bench.h"
#include "tests/test.h"

#define ATTEMPTS 5

static struct bench bench;
static char said[SST_LOG_MAX];

static int setup(bool serial)
{
    const int err = bench_start(&bench, serial);

    bench.cfg.rows = 1;
    bench.cfg.cols = 2;
    return err;
}

static int setup_tcp(void **state SST_UNUSED)
{
    return setup(false);
}

static int setup_rtu(void **state SST_UNUSED)
{
    return setup(true);
}

static int teardown(void **state SST_UNUSED)
{
    bench_end(&bench);
    return 0;
}

static void set_fault(const char *name, const char *value)
{
    char error[160];

    if (sst_sim_drive_fault(bench.drive, name, value, error, sizeof(error)))
        fail_msg("%s", error);
}

/* A fresh capture with a fault that begins after the first view. */
static int capture_with(const char *fault, const char *value, struct sst_scan_report *report)
{
    const int64_t start_ns = sst_clock_now_ns();
    int err;

    sst_path_remove_tree(bench.dir);
    bench.shots = 0;
    bench.moving = 0;
    bench.fault_at = 1;
    bench.fault = fault;
    bench.value = value;
    said[0] = 0;
    (void)sst_log_hold_errors(said);
    err = bench_capture(&bench, report);
    (void)sst_log_hold_errors(NULL);
    print_message(
        "%s=%s: %d, %.2f s; %d taken, %d again, %d homed; %llu timeouts, %llu garbled, %llu exceptions, %llu lost, "
        "%llu reconnects; %s\n",
        fault ? fault : "none", value ? value : "", err, (double)(sst_clock_now_ns() - start_ns) * 1e-9, report->taken,
        report->again, report->homed, (unsigned long long)report->rig.timeouts, (unsigned long long)report->rig.garbled,
        (unsigned long long)report->rig.exceptions, (unsigned long long)report->rig.lost,
        (unsigned long long)report->rig.reconnects, said);
    assert_quick(start_ns, 30000000000);
    return err;
}

static void expect_all_views(void)
{
    assert_int_equal(bench_good_views(&bench), 2);
    assert_int_equal(bench.moving, 0);
}

/* --- the wire ----------------------------------------------------------------------------------------------------- */

/* Faults that the driver mends by itself: no view is tried again, in one capture of a few at least, for a machine that
 * stands still for longer than all tries of a request causes a retry by itself. What is late is not seen to be late
 * when all stands still meanwhile: then once more, too. */
static void mended(const char *fault, const char *value, uint64_t (*count)(const struct sst_rig_counters *c))
{
    struct sst_scan_report report = { .taken = 0 };
    bool mended = false;

    for (int i = 0; i < ATTEMPTS && !mended; i++) {
        assert_int_equal(capture_with(fault, value, &report), 0);
        assert_int_equal(report.taken, 2);
        expect_all_views();
        mended = count(&report.rig) > 0 && report.again == 0;
        if (!mended)
            print_message("attempt %d: %s was not seen, or a view was tried again\n", i + 1, fault);
    }
    assert_true(mended);
    set_fault(fault, "off");
}

static uint64_t timeouts(const struct sst_rig_counters *c)
{
    return c->timeouts;
}

static uint64_t garbled(const struct sst_rig_counters *c)
{
    return c->garbled;
}

static uint64_t exceptions(const struct sst_rig_counters *c)
{
    return c->exceptions;
}

static uint64_t lost(const struct sst_rig_counters *c)
{
    return c->lost;
}

static uint64_t cut_short(const struct sst_rig_counters *c)
{
    return c->timeouts + c->garbled;
}

static uint64_t requests(const struct sst_rig_counters *c)
{
    return c->requests;
}

static void the_wire(void)
{
    mended("silence", "once", timeouts);
    mended("silence", "1/40", timeouts);
    mended("late_ms", "10:always", requests);
    mended("late_ms", "250:once", timeouts); /* its reply must not be taken for the next request's */
    mended("drop_bytes", "1/40", cut_short);
    mended("exception", "5", exceptions);
    mended("exception", "6:1/7", exceptions);
    mended("exception", "10:1/7", exceptions);
    mended("exception", "11:1/30", exceptions);
    mended("acknowledge", "always", exceptions);
    mended("busy", "4", exceptions); /* also to the stop, which is asked first while others wait */
    mended("late_ms", "450:1/23", timeouts);
    mended("disconnect", "once", lost);
}

static void the_wire_over_tcp(void **state SST_UNUSED)
{
    the_wire();
    mended("wrong_unit", "once", requests); /* the transaction number names the request of a reply */
    mended("disconnect", "1/50", lost);
}

static void the_wire_over_rtu(void **state SST_UNUSED)
{
    the_wire();
    mended("wrong_unit", "once", garbled);
    mended("noise", "once", cut_short);
    mended("bad_crc", "1/40", garbled);
}

/* The drive refuses: the motion stops, the view is tried again. */
static void exceptions_stop_and_retry(void **state SST_UNUSED)
{
    static const char *const codes[] = { "2", "4" };

    for (size_t i = 0; i < ARRAY_LEN(codes); i++) {
        struct sst_scan_report report;

        assert_int_equal(capture_with("exception", codes[i], &report), 0);
        assert_int_equal(report.again, 1);
        assert_int_equal(report.rig.exceptions, 1);
        assert_non_null(strstr(said, "exception"));
        expect_all_views();
    }
}

/* An acknowledged or a busy stop is a stop: nobody is sent to switch the drives off. */
static void a_stop_is_confirmed(void **state SST_UNUSED)
{
    static const char *const faults[][2] = { { "acknowledge", "always" }, { "busy", "6" } };

    for (size_t i = 0; i < ARRAY_LEN(faults); i++) {
        struct sst_rig *rig;

        assert_int_equal(sst_rig_open(&rig, &bench.rig_cfg), 0);
        set_fault(faults[i][0], faults[i][1]);
        assert_int_equal(sst_rig_stop(rig), 0);
        sst_rig_close(rig);
        set_fault(faults[i][0], "off");
    }
}

/* A drive that stays busy is reported as busy, and its stop as not confirmed, in time. */
static void a_busy_drive_is_given_up(void **state SST_UNUSED)
{
    const int64_t start_ns = sst_clock_now_ns();
    struct sst_rig *rig;

    bench.rig_cfg.reconnect_ms = 300;
    assert_int_equal(sst_rig_open(&rig, &bench.rig_cfg), 0);
    set_fault("busy", "always");
    said[0] = 0;
    (void)sst_log_hold_errors(said);
    assert_int_equal(sst_rig_stop(rig), -EIO);
    (void)sst_log_hold_errors(NULL);
    assert_non_null(strstr(said, "switch the drives off"));
    assert_quick(start_ns, 5000000000);
    set_fault("busy", "off");
    sst_rig_close(rig);
}

/* A motion that never ends is reported in time, and the folder goes on when it ends. */
static void a_dead_bus_ends_the_capture(void **state SST_UNUSED)
{
    struct sst_scan_report report;

    assert_int_equal(capture_with("silence", "always", &report), -ETIMEDOUT);
    assert_int_equal(report.taken, 0); /* that it stood could not be seen after the first exposure */
    assert_non_null(strstr(said, "0 of 2 views"));
    set_fault("silence", "off");
    bench.fault = NULL;
    assert_int_equal(bench_capture(&bench, &report), 0);
    assert_int_equal(report.taken, 2);
    expect_all_views();
}

/* --- the axes ----------------------------------------------------------------------------------------------------- */

static void axis_fault(const char *fault, const char *value, const char *words, struct sst_scan_report *report)
{
    assert_int_equal(capture_with(fault, value, report), 0);
    assert_int_equal(report->taken, 2);
    assert_true(report->again >= 1);
    assert_true(report->homed >= 1);
    if (!strstr(said, words))
        fail_msg("%s: no '%s' in: %s", fault, words, said);
    expect_all_views();
}

static void the_axes(void **state SST_UNUSED)
{
    struct sst_scan_report report;

    assert_int_equal(capture_with(NULL, NULL, &report), 0); /* homes */
    expect_all_views();
    axis_fault("stall", "x", "following error", &report);
    assert_int_equal(report.rig.alarms, 1);
    bench.cfg.pitch_um[0] = 3000; /* the drive tolerates 2 mm, the driver does not */
    axis_fault("stall", "x", "stalled", &report);
    assert_int_equal(report.rig.stalls, 1);
    bench.cfg.pitch_um[0] = 4000;
    axis_fault("limit", "x", "limit switch", &report);
    assert_int_equal(report.rig.limits, 1);
    axis_fault("alarm", "y:0x21", "following error", &report);
    assert_int_equal(report.rig.alarms, 1);
    axis_fault("lost_steps", "x:300", "lost steps", &report);
    assert_int_equal(report.rig.missed, 1);
    axis_fault("power_loss", "x", "lost its position", &report);
}

static void an_early_in_position_is_not_believed(void **state SST_UNUSED)
{
    struct sst_scan_report report = { .taken = 0 };

    /* Who stands still during the whole motion hears no lie: then once more. */
    for (int i = 0; i < ATTEMPTS && !report.rig.lies; i++) {
        assert_int_equal(capture_with("in_position_lies", "x:always", &report), 0);
        assert_int_equal(report.again, 0);
        expect_all_views();
        if (!report.rig.lies)
            print_message("attempt %d: no lie was heard\n", i + 1);
    }
    assert_true(report.rig.lies >= 1);
}

/* An obstacle that stays: told, stopped, not tried for ever. */
static void a_lasting_stall_ends_the_capture(void **state SST_UNUSED)
{
    struct sst_scan_report report;

    bench.cfg.attempts = 2;
    assert_int_equal(capture_with("stall", "x:always", &report), -EIO);
    bench.cfg.attempts = 3;
    set_fault("stall", "off");
    bench.fault = NULL;
    assert_int_equal(bench_capture(&bench, &report), 0);
    expect_all_views();
}

/* --- the camera --------------------------------------------------------------------------------------------------- */

static void a_missing_frame_is_tried_again(void **state SST_UNUSED)
{
    struct sst_scan_report report;

    bench.fail_shots = 2;
    assert_int_equal(capture_with(NULL, NULL, &report), 0);
    assert_int_equal(report.camera_faults, 2);
    assert_int_equal(report.again, 2);
    expect_all_views();
    bench.fail_shots = 3;
    assert_int_equal(capture_with(NULL, NULL, &report), -ETIMEDOUT);
    assert_int_equal(report.taken, 0);
}

/* Somebody pushes the rig, so to say, between the two looks at it. */
static void a_push_during_the_exposure_throws_the_frame_away(void **state SST_UNUSED)
{
    struct sst_scan_report report;

    assert_int_equal(capture_with("power_loss", "x", &report), 0);
    assert_int_equal(report.moved, 1); /* the view at the exposure of which the power went */
    expect_all_views();
}

static void fault_names_are_checked(void **state SST_UNUSED)
{
    static const char *const bad[][2] = { { "typo", "once" },    { "silence", "twice" }, { "silence", "1/0" },
                                          { "exception", "12" }, { "exception", "x" },   { "late_ms", "-5" },
                                          { "stall", "w" },      { "stall", "x:5" },     { "alarm", "x:y" },
                                          { "limit", "" } };
    char error[400];

    for (size_t i = 0; i < ARRAY_LEN(bad); i++) {
        error[0] = 0;
        assert_int_equal(sst_sim_drive_fault(bench.drive, bad[i][0], bad[i][1], error, sizeof(error)), -EINVAL);
        assert_true(error[0]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(the_wire_over_tcp, setup_tcp, teardown),
        cmocka_unit_test_setup_teardown(the_wire_over_rtu, setup_rtu, teardown),
        cmocka_unit_test_setup_teardown(exceptions_stop_and_retry, setup_tcp, teardown),
        cmocka_unit_test_setup_teardown(a_stop_is_confirmed, setup_rtu, teardown),
        cmocka_unit_test_setup_teardown(a_busy_drive_is_given_up, setup_tcp, teardown),
        cmocka_unit_test_setup_teardown(a_dead_bus_ends_the_capture, setup_tcp, teardown),
        cmocka_unit_test_setup_teardown(the_axes, setup_tcp, teardown),
        cmocka_unit_test_setup_teardown(an_early_in_position_is_not_believed, setup_tcp, teardown),
        cmocka_unit_test_setup_teardown(a_lasting_stall_ends_the_capture, setup_tcp, teardown),
        cmocka_unit_test_setup_teardown(a_missing_frame_is_tried_again, setup_tcp, teardown),
        cmocka_unit_test_setup_teardown(a_push_during_the_exposure_throws_the_frame_away, setup_tcp, teardown),
        cmocka_unit_test_setup_teardown(fault_names_are_checked, setup_tcp, teardown),
    };

    if (!WITH_MODBUS) {
        puts("built without libmodbus");
        return 77;
    }
    setenv("SST_PROFILES", "config/profiles", 1);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
