/* The rig driver against the simulated drives, over TCP and over a serial line: open, home, move, stand still, stop. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "drivers/rig/rig.h"
#include "simulators/rig/drive.h"
#include "tests/test.h"

#define PATIENCE_MS 60000

struct bench {
    struct sst_sim_drive *drive;
    struct sst_rig *rig;
    struct sst_rig_config cfg;
    char link[64];
};

static char said[SST_LOG_MAX];

static void start(struct bench *b, bool serial)
{
    struct sst_sim_drive_config sim = { .tcp_port = serial ? -1 : 0, .seed = 7 };

    *b = (struct bench){ .drive = NULL };
    if (serial) {
        snprintf(b->link, sizeof(b->link), "/tmp/sst-rig-motion-%d", (int)getpid());
        sim.rtu_link = b->link;
    }
    assert_int_equal(sst_sim_drive_start(&b->drive, &sim), 0);
    sst_rig_config_defaults(&b->cfg);
    strcpy(b->cfg.profile, "sst-sim");
    if (serial)
        snprintf(b->cfg.bus, sizeof(b->cfg.bus), "rtu:%s,115200,8E1", b->link);
    else
        snprintf(b->cfg.bus, sizeof(b->cfg.bus), "tcp:127.0.0.1:%d", sst_sim_drive_tcp_port(b->drive));
    b->cfg.axes = 3;
    b->cfg.speed_mm_s = 200;
    b->cfg.accel_mm_s2 = 2000;
    b->cfg.settle_ms = 20;
    b->cfg.response_ms = 10000; /* a thread that does not run for a while is no fault of the wire */
}

static void open_and_home(struct bench *b)
{
    assert_int_equal(sst_rig_open(&b->rig, &b->cfg), 0);
    assert_false(sst_rig_homed(b->rig));
    assert_int_equal(sst_rig_home(b->rig, PATIENCE_MS), 0);
    assert_true(sst_rig_homed(b->rig));
}

static void end(struct bench *b)
{
    sst_rig_close(b->rig);
    sst_sim_drive_stop(b->drive);
}

static void expect_at(struct bench *b, int32_t x, int32_t y, int32_t z)
{
    const int32_t want[3] = { x, y, z };
    struct sst_rig_pos now;
    int32_t pose[3];

    assert_int_equal(sst_rig_position(b->rig, &now), 0);
    sst_sim_drive_pose(b->drive, sst_clock_now_ns(), pose);
    for (int a = 0; a < 3; a++) {
        assert_in_range(now.um[a] + 1000000, want[a] + 1000000 - 5, want[a] + 1000000 + 5);
        assert_in_range(pose[a] + 1000000, want[a] + 1000000 - 5, want[a] + 1000000 + 5);
    }
}

static void go(struct bench *b, int32_t x, int32_t y, int32_t z)
{
    const struct sst_rig_pos to = { { x, y, z } };

    assert_int_equal(sst_rig_move(b->rig, to), 0);
    assert_int_equal(sst_rig_wait(b->rig, PATIENCE_MS), 0);
    assert_true(sst_rig_still(b->rig));
    expect_at(b, x, y, z);
}

static void homes_and_moves(bool serial)
{
    struct bench b;
    struct sst_rig_counters c;

    start(&b, serial);
    open_and_home(&b);
    expect_at(&b, 0, 0, 0);
    go(&b, 12000, 7000, 3000);
    go(&b, 11000, 7000, 3000);
    go(&b, 11000, 7000, 3000); /* nothing to do */
    sst_rig_counters(b.rig, &c);
    assert_int_equal(c.moves, 3);
    assert_int_equal(c.timeouts + c.garbled + c.exceptions + c.lost, 0);
    end(&b);
}

static void homes_and_moves_over_tcp(void **state SST_UNUSED)
{
    homes_and_moves(false);
}

static void homes_and_moves_over_rtu(void **state SST_UNUSED)
{
    homes_and_moves(true);
}

/* While wait has not returned, the pose changes; when it has, nothing does any more. */
static void wait_ends_only_when_all_stands(void **state SST_UNUSED)
{
    struct bench b;
    int32_t first[3], later[3];
    int64_t t_ns;

    start(&b, false);
    b.cfg.settle_ms = 100;
    open_and_home(&b);
    for (int i = 1; i <= 5; i++) {
        assert_int_equal(sst_rig_move(b.rig, (struct sst_rig_pos){ { i * 4000, i * 1000, 0 } }), 0);
        assert_false(sst_rig_still(b.rig));
        assert_int_equal(sst_rig_wait(b.rig, PATIENCE_MS), 0);
        t_ns = sst_clock_now_ns();
        usleep(50000);
        for (int ms = 0; ms < 50; ms++) {
            sst_sim_drive_pose(b.drive, t_ns, first);
            sst_sim_drive_pose(b.drive, t_ns + ms * 1000000, later);
            for (int a = 0; a < 3; a++)
                assert_true(abs(first[a] - later[a]) <= 2);
        }
    }
    end(&b);
}

/* A drive with counts that run the other way round, half a um each. */
static void counts_are_scaled_and_signed(void **state SST_UNUSED)
{
    struct bench b;
    int32_t pose[3];

    start(&b, false);
    b.cfg.um_per_count[0] = 0.5;
    b.cfg.um_per_count[1] = -1;
    b.cfg.travel_min_um[1] = -300000;
    open_and_home(&b);
    assert_int_equal(sst_rig_move(b.rig, (struct sst_rig_pos){ { 3000, -2000, 0 } }), 0);
    assert_int_equal(sst_rig_wait(b.rig, PATIENCE_MS), 0);
    sst_sim_drive_pose(b.drive, sst_clock_now_ns(), pose);
    assert_in_range(pose[0], 5995, 6005);
    assert_in_range(pose[1], 1995, 2005);
    end(&b);
}

static int quietly(int r)
{
    (void)sst_log_hold_errors(NULL);
    return r;
}

static void refusals(void **state SST_UNUSED)
{
    struct bench b;
    const struct sst_rig_pos far = { { 300001, 0, 0 } }, near = { { 90000, 0, 0 } };
    int32_t before[3], after[3];
    struct sst_rig *none;

    start(&b, false);
    b.cfg.speed_mm_s = 10; /* on the way for seconds, also if we stand still in the middle */
    assert_int_equal(sst_rig_open(&b.rig, &b.cfg), 0);
    (void)sst_log_hold_errors(said);
    assert_int_equal(sst_rig_move(b.rig, near), -ENOTCONN);
    assert_int_equal(sst_rig_home(b.rig, PATIENCE_MS), 0);
    sst_sim_drive_pose(b.drive, sst_clock_now_ns(), before);
    assert_int_equal(sst_rig_move(b.rig, far), -ERANGE);
    assert_non_null(strstr(said, "outside the travel"));
    usleep(20000);
    sst_sim_drive_pose(b.drive, sst_clock_now_ns(), after);
    assert_memory_equal(before, after, sizeof(before));
    assert_int_equal(sst_rig_move(b.rig, near), 0);
    assert_int_equal(sst_rig_move(b.rig, near), -EBUSY);
    assert_int_equal(sst_rig_wait(b.rig, 100), -ETIMEDOUT);
    assert_non_null(strstr(said, "within 100 ms"));

    strcpy(b.cfg.profile, "no-such-drive");
    assert_int_equal(sst_rig_open(&none, &b.cfg), -ENOENT);
    strcpy(b.cfg.profile, "sst-sim");
    strcpy(b.cfg.bus, "tcp:127.0.0.1:1");
    assert_int_equal(sst_rig_open(&none, &b.cfg), -ECONNREFUSED);
    strcpy(b.cfg.bus, "rtu:/dev/no-such-tty,19200,8E1");
    assert_int_equal(sst_rig_open(&none, &b.cfg), -ENODEV);
    strcpy(b.cfg.bus, "rtu:/dev/ttyS0,19200,9E1");
    assert_int_equal(sst_rig_open(&none, &b.cfg), -EINVAL);
    strcpy(b.cfg.bus, "udp:nowhere");
    assert_int_equal(quietly(sst_rig_open(&none, &b.cfg)), -EINVAL);
    end(&b);
}

/* Slow to start, and told of with a delay, as by a machine that stands still: how long it has not moved is known only
 * up to when the drive was asked. */
static void a_late_reading_is_no_stall(void **state SST_UNUSED)
{
    struct bench b;
    char error[160];

    start(&b, false);
    b.cfg.axes = 1;
    b.cfg.accel_mm_s2 = 10;
    open_and_home(&b);
    assert_int_equal(sst_rig_move(b.rig, (struct sst_rig_pos){ { 2000, 0, 0 } }), 0);
    /* Of flags and position the second. */
    assert_int_equal(sst_sim_drive_fault(b.drive, "late_ms", "1200:1/2", error, sizeof(error)), 0);
    assert_int_equal(sst_rig_wait(b.rig, PATIENCE_MS), 0);
    assert_int_equal(sst_sim_drive_fault(b.drive, "late_ms", "off", error, sizeof(error)), 0);
    assert_true(sst_rig_still(b.rig));
    end(&b);
}

static struct sst_rig *to_cancel;

static void on_alarm(int sig SST_UNUSED)
{
    sst_rig_cancel(to_cancel);
}

static void cancel_stops_the_motion(void **state SST_UNUSED)
{
    struct bench b;
    int32_t pose[3], later[3];

    start(&b, false);
    b.cfg.speed_mm_s = 40; /* on the way for six seconds, also if we stand still in the middle */
    open_and_home(&b);
    to_cancel = b.rig;
    signal(SIGALRM, on_alarm);
    assert_int_equal(sst_rig_move(b.rig, (struct sst_rig_pos){ { 250000, 0, 0 } }), 0);
    ualarm(200000, 0);
    assert_int_equal(sst_rig_wait(b.rig, PATIENCE_MS), -ECANCELED);
    signal(SIGALRM, SIG_DFL);
    sst_sim_drive_pose(b.drive, sst_clock_now_ns(), pose);
    assert_in_range(pose[0], 5000, 200000);
    usleep(30000);
    sst_sim_drive_pose(b.drive, sst_clock_now_ns(), later);
    assert_in_range(later[0], pose[0] - 3, pose[0] + 3);
    assert_true(sst_rig_homed(b.rig));
    go(&b, 1000, 0, 0); /* usable as before */
    end(&b);
}

/* A rig that was homed and moved by an earlier process. */
static void a_new_connection_finds_it_homed(void **state SST_UNUSED)
{
    struct bench b;

    start(&b, false);
    open_and_home(&b);
    go(&b, 5000, 6000, 0);
    sst_rig_close(b.rig);
    assert_int_equal(sst_rig_open(&b.rig, &b.cfg), 0);
    assert_true(sst_rig_homed(b.rig));
    expect_at(&b, 5000, 6000, 0);
    go(&b, 6000, 6000, 0);
    end(&b);
}

/* libmodbus would write outside its fd_set. */
static void a_high_descriptor_is_refused(void **state SST_UNUSED)
{
    struct rlimit limit, more;
    static int fd[1100];
    struct bench b;
    int n = 0;

    assert_int_equal(getrlimit(RLIMIT_NOFILE, &limit), 0);
    more = limit;
    more.rlim_cur = limit.rlim_max < 2048 ? limit.rlim_max : 2048;
    if (more.rlim_cur < 1200 || setrlimit(RLIMIT_NOFILE, &more)) {
        print_message("the limit of open files cannot be raised to 1200\n");
        skip();
    }
    start(&b, false);
    while (n < 1100 && (n == 0 || fd[n - 1] < 1030))
        fd[n++] = dup(STDERR_FILENO);
    (void)sst_log_hold_errors(said);
    assert_int_equal(quietly(sst_rig_open(&b.rig, &b.cfg)), -EMFILE);
    while (n > 0)
        close(fd[--n]);
    assert_int_equal(sst_rig_open(&b.rig, &b.cfg), 0);
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &limit), 0);
    end(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(homes_and_moves_over_tcp),
        cmocka_unit_test(homes_and_moves_over_rtu),
        cmocka_unit_test(wait_ends_only_when_all_stands),
        cmocka_unit_test(counts_are_scaled_and_signed),
        cmocka_unit_test(refusals),
        cmocka_unit_test(a_late_reading_is_no_stall),
        cmocka_unit_test(cancel_stops_the_motion),
        cmocka_unit_test(a_new_connection_finds_it_homed),
        cmocka_unit_test(a_high_descriptor_is_refused),
    };

    if (!WITH_MODBUS) {
        puts("built without libmodbus");
        return 77;
    }
    setenv("SST_PROFILES", "config/profiles", 1);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
