/* drivers/grab on simulated cameras: every fault that a camera can have, plugging, recovery. Runs itself in sst-sim. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <errno.h>
#include <signal.h>
#include <sys/wait.h>

#include "base/log.h"
#include "drivers/grab/grab_internal.h"
#include "tests/grab_rig.h"
#include "tests/quick.h"
#include "tests/test.h"

/* A condition may need this on a busy machine under a sanitizer; times that must be short are measured, see measured().
 */
#define PATIENCE_MS 60000
#define ATTEMPTS    5

static struct rig rig;
static char late[160]; /* why the last attempt does not count; "": it does */
/* Where the whole machine stands still for longer than a camera may: then it is asked again, as it should be. */
static const char taken_for_hung[] = "times that a healthy camera was taken for hung";

/* Also after a test that failed half-way. */
static int clean_up(void **state SST_UNUSED)
{
    if (rig.grab)
        rig_stop(&rig);
    return rig_fault_reset();
}

/*
 * On a busy machine frames come late or not at all. An attempt in which they do ends there, without a judgement on what
 * follows, and is repeated; after the last one only a run that measures time fails. scripts/run_tests.sh counts both.
 */
static void measured(void (*attempt)(void))
{
    for (int i = 0; i < ATTEMPTS; i++) {
        late[0] = 0;
        attempt();
        if (!late[0])
            return;
        print_message("attempt %d: %s\n", i + 1, late);
        assert_int_equal(clean_up(NULL), 0);
    }
    if (quick_is_measured())
        fail_msg("%s, %d times", late, ATTEMPTS);
    print_message("not judged: %s, %d times\n", late, ATTEMPTS);
}

static void too_late(const char *what, int64_t is, int64_t limit)
{
    if (is > limit && !late[0])
        snprintf(late, sizeof(late), "%s: %lld, at most %lld", what, (long long)is, (long long)limit);
}

static int open_descriptors(void)
{
    DIR *dir = opendir("/proc/self/fd");
    int n = 0;

    while (readdir(dir))
        n++;
    closedir(dir);
    return n;
}

/* Without libudev a camera has no serial and no USB port. */
static void need_usb(void)
{
    if (!WITH_UDEV) {
        print_message("built without libudev: cameras have no serials\n");
        skip();
    }
    assert_true(*rig.bindings[0].serial);
}

static struct sst_grab_counters counters(int cam)
{
    struct sst_grab_counters c;

    sst_grab_counters(rig.grab, cam, &c);
    return c;
}

/* Frames that a camera has lost. Enough buffers for a machine that stops for a second, not for a driver that does. */
static void expect_lossless(int cam)
{
    const struct sst_grab_counters c = counters(cam);
    char what[48];

    snprintf(what, sizeof(what), "frames that camera %d lost", cam);
    too_late(what, (int64_t)c.lost, 0);
    assert_int_equal(c.lost, rig.cam[cam].lost);
    assert_int_equal(c.bad, 0);
}

static void patient(int cameras)
{
    assert_int_equal(rig_config(&rig, cameras), 0);
    rig.cfg.buffers = 16;
}

/* --- tests -------------------------------------------------------------------------------------------------------- */

static bool all_have(uint64_t frames)
{
    for (int i = 0; i < rig.cfg.cameras; i++)
        if (counters(i).frames < frames)
            return false;
    return true;
}

static void stream(void)
{
    const int64_t begin_ns = sst_clock_now_ns();

    patient(36);
    assert_int_equal(rig_start(&rig), 36);
    do
        assert_int_equal(rig_run(&rig, 500), 0);
    while (!all_have(12) && sst_clock_now_ns() - begin_ns < PATIENCE_MS * RIG_MS);
    for (int i = 0; i < 36; i++)
        too_late(taken_for_hung, (int64_t)counters(i).rung[SST_GRAB_RESTREAM], 0);
    if (late[0])
        return;
    assert_true(all_have(12));
    for (int i = 0; i < 36; i++) {
        /* 10 a second, and one in the beginning */
        assert_true(counters(i).frames <= (uint64_t)((sst_clock_now_ns() - begin_ns) / (100 * RIG_MS)) + 2);
        assert_int_equal(counters(i).frames, rig.cam[i].frames);
        assert_int_equal(rig.cam[i].faults, 0);
        assert_int_equal(sst_grab_camera_state(rig.grab, i), SST_GRAB_STREAMING);
        expect_lossless(i);
    }
    rig_stop(&rig);
}

static void all_cameras_stream(void **state SST_UNUSED)
{
    measured(stream);
}

/* Again and again: no descriptor stays behind, but for the simulator's own connections. */
static void closing_leaves_nothing(void **state SST_UNUSED)
{
    int before = 0;

    for (int round = 0; round < 4; round++) {
        assert_int_equal(rig_config(&rig, 36), 0);
        assert_int_equal(rig_start(&rig), 36);
        assert_int_equal(rig_run(&rig, 150), 0);
        rig_stop(&rig);
        if (!round)
            before = open_descriptors();
    }
    assert_in_range(open_descriptors(), 3, before + 30);
}

static void stop_and_go_on(void)
{
    const pid_t child = fork();
    int ended;

    assert_true(child >= 0);
    for (int i = 0; !child && i < 20; i++) {
        usleep(30000);
        kill(getppid(), SIGSTOP);
        usleep(i == 10 ? 1500000 : 10000);
        kill(getppid(), SIGCONT);
    }
    if (!child)
        _exit(0);
    while (!waitpid(child, &ended, WNOHANG))
        assert_int_equal(rig_run(&rig, 100), 0);
    assert_int_equal(ended, 0);
}

static void stop(void)
{
    patient(4);
    rig.cfg.stall_ms = 1000;
    assert_int_equal(rig_start(&rig), 4);
    assert_int_equal(rig_run(&rig, 300), 0);
    stop_and_go_on();
    assert_int_equal(rig_run(&rig, 700), 0);
    for (int i = 0; i < 4; i++) {
        too_late(taken_for_hung, (int64_t)counters(i).rung[SST_GRAB_RESTREAM], 0);
        if (late[0])
            return;
        assert_int_equal(sst_grab_camera_state(rig.grab, i), SST_GRAB_STREAMING);
    }
    rig_stop(&rig);
}

/* Somebody stops the program and lets it go on, as a machine does that sleeps: no fault of the cameras. */
static void stopping_and_going_on_is_no_fault(void **state SST_UNUSED)
{
    measured(stop);
}

struct kind {
    const char *fault;
    unsigned any_of, none_of;
};

/* Every camera has shown its fault. */
static bool all_shown(const struct kind *kinds, int n)
{
    for (int i = 0; i < n; i++) {
        if (kinds[i].any_of && !(rig.cam[i].faults & kinds[i].any_of))
            return false;
        if (strstr(kinds[i].fault, "gap") && !counters(i).lost)
            return false;
    }
    return true;
}

/* So it is while cameras are listed: one that answers in time does so, also when we do not hear it for a while. */
static void stopping_while_cameras_are_asked_is_no_fault(void **state SST_UNUSED)
{
    struct sst_grab_device *devices;
    int count, ended;
    pid_t child;

    assert_int_equal(rig_fault("camera.%d.slow_open_ms=500", 0), 0);
    child = fork();
    assert_true(child >= 0);
    if (!child) {
        usleep(200000);
        kill(getppid(), SIGSTOP);
        usleep(2500000);
        kill(getppid(), SIGCONT);
        _exit(0);
    }
    assert_int_equal(sst_grab_list(&devices, &count), 0);
    assert_int_equal(waitpid(child, &ended, 0), child);
    assert_int_equal(rig_fault("camera.%d.slow_open_ms=0", 0), 0);
    for (int i = 0; i < count; i++)
        assert_int_equal(devices[i].error, 0);
    free(devices);
}

static void damage(void)
{
    static const struct kind kinds[] = {
        { "camera.%d.error_flag=0.5", SST_FRAME_FLAGGED, SST_FRAME_FROZEN },
        { "camera.%d.truncated=0.5", SST_FRAME_NO_EOI, SST_FRAME_NO_SOI },
        { "camera.%d.corrupt_soi=0.5", SST_FRAME_NO_SOI, SST_FRAME_NO_EOI },
        { "camera.%d.corrupt_eoi=0.5", SST_FRAME_NO_EOI, SST_FRAME_NO_SOI },
        { "camera.%d.short=0.5", SST_FRAME_NO_EOI, SST_FRAME_NO_SOI },
        { "camera.%d.backwards=0.5", SST_FRAME_BACKWARDS, SST_FRAME_NO_EOI },
        { "camera.%d.frozen=1", SST_FRAME_FROZEN, SST_FRAME_BAD },
        { "camera.%d.time_wrap=1", SST_FRAME_BACKWARDS, SST_FRAME_FLAGGED },
        { "camera.%d.sequence_wrap=1", 0, SST_FRAME_BAD },
        { "camera.%d.gap=0.3", 0, SST_FRAME_BAD },
        { "camera.%d.eio=0.2", 0, SST_FRAME_BAD },
        { "camera.%d.corrupt_mid=0", 0, SST_FRAME_BAD },
    };
    const int n = (int)ARRAY_LEN(kinds);

    patient(n);
    assert_int_equal(rig_start(&rig), n);
    for (int i = 0; i < n; i++)
        assert_int_equal(rig_fault(kinds[i].fault, i), 0);
    assert_int_equal(rig_run(&rig, 3500), 0);
    for (int ms = 0; ms < PATIENCE_MS && !all_shown(kinds, n); ms += 100)
        assert_int_equal(rig_run(&rig, 100), 0);
    for (int i = 0; i < n; i++) {
        const struct sst_grab_counters c = counters(i);

        too_late(taken_for_hung, (int64_t)(c.rung[SST_GRAB_RESTREAM] + c.rung[SST_GRAB_REOPEN]), 0);
        if (!strstr(kinds[i].fault, "gap"))
            too_late("frames lost without a gap", (int64_t)c.lost, 0);
    }
    if (late[0])
        return;
    for (int i = 0; i < n; i++) {
        const struct sst_grab_counters c = counters(i);

        if (kinds[i].any_of && !(rig.cam[i].faults & kinds[i].any_of))
            fail_msg("%s: faults 0x%x", kinds[i].fault, rig.cam[i].faults);
        if (rig.cam[i].faults & kinds[i].none_of)
            fail_msg("%s: faults 0x%x", kinds[i].fault, rig.cam[i].faults);
        assert_int_equal(c.lost, rig.cam[i].lost);
        if (strstr(kinds[i].fault, "gap"))
            assert_true(c.lost > 0);
    }
}

/* Damaged frames are counted by their faults, and cost no camera its stream. */
static void damage_is_told_by_kind(void **state SST_UNUSED)
{
    measured(damage);
}

/* Run until a rung was tried with a camera, and it streams. @return false: not within the time */
static bool brought_back(int cam, int rung)
{
    const int64_t begin_ns = sst_clock_now_ns();

    while (!counters(cam).rung[rung] || sst_grab_camera_state(rig.grab, cam) != SST_GRAB_STREAMING) {
        if (sst_clock_now_ns() - begin_ns > PATIENCE_MS * RIG_MS || sst_grab_poll(rig.grab, 20))
            return false;
    }
    return true;
}

static void climb(void)
{
    static const int stalled[] = { 2, 4, 6 }, rung[] = { SST_GRAB_RESTREAM, SST_GRAB_REOPEN, SST_GRAB_RESET };

    patient(8);
    rig.cfg.stall_ms = 1000;
    assert_int_equal(rig_start(&rig), 8);
    assert_int_equal(rig_run(&rig, 500), 0);
    assert_int_equal(rig_fault("camera.%d.stall=1", 2), 0);
    assert_int_equal(rig_fault("camera.%d.stall=2", 4), 0);
    assert_int_equal(rig_fault("camera.%d.stall=3", 6), 0);
    assert_int_equal(rig_run(&rig, 300), 0);
    for (int i = 0; i < 3; i++)
        assert_true(brought_back(stalled[i], rung[i]));
    for (int i = 0; i < 3; i++) { /* by its rung, once, and by none above it */
        const struct sst_grab_counters c = counters(stalled[i]);

        too_late(taken_for_hung, (int64_t)c.rung[rung[i]], 1);
        if (rung[i] != SST_GRAB_RESET)
            too_late(taken_for_hung, (int64_t)c.rung[rung[i] + 1], 0);
    }
    for (int i = 0; i < 8; i++) {
        if (i == 2 || i == 4 || i == 6)
            continue;
        expect_lossless(i);
        too_late(taken_for_hung, (int64_t)counters(i).rung[SST_GRAB_RESTREAM], 0);
    }
    rig_stop(&rig);
}

/* Cameras that hang until a rung of the ladder: the rung brings them back, and the others lose nothing. */
static void each_rung_brings_back_what_it_can(void **state SST_UNUSED)
{
    assert_int_equal(rig_config(&rig, 8), 0);
    need_usb();
    measured(climb);
}

static void come_back(void)
{
    char before[SST_GRAB_NAME_MAX];
    int high, low, ms;

    patient(6);
    assert_int_equal(rig_start(&rig), 6);
    /* By their nodes, which an attempt before this one may have exchanged. */
    high = strcmp(sst_grab_camera_device(rig.grab, 3)->node, sst_grab_camera_device(rig.grab, 1)->node) > 0 ? 3 : 1;
    low = 4 - high;
    strcpy(before, sst_grab_camera_device(rig.grab, high)->node);
    rig.hold_cam = high;
    for (int i = 0; i < PATIENCE_MS / 250 && !rig.held_count; i++)
        assert_int_equal(rig_run(&rig, 250), 0);
    assert_true(rig.held_count > 0);
    assert_int_equal(rig_fault("camera.%d.unplug=1", low), 0);
    assert_int_equal(rig_fault("camera.%d.unplug=1", high), 0);
    assert_true(rig_until(&rig, high, SST_GRAB_ABSENT, PATIENCE_MS) >= 0);
    assert_int_equal(rig.held[0]->data[0], 0xff); /* borrowed frames stay readable */
    assert_true(rig_until(&rig, low, SST_GRAB_ABSENT, PATIENCE_MS) >= 0);
    assert_int_equal(rig_run(&rig, 300), 0);
    assert_int_equal(rig_fault("camera.%d.unplug=0", high), 0); /* takes the lower number of the other */
    ms = rig_until(&rig, high, SST_GRAB_STREAMING, PATIENCE_MS);
    assert_true(ms >= 0);
    too_late("ms until a camera is back", ms, 2000);
    rig_release_held(&rig);
    assert_string_not_equal(before, sst_grab_camera_device(rig.grab, high)->node);
    assert_string_equal(sst_grab_camera_device(rig.grab, high)->serial, rig.bindings[high].serial);
    assert_int_equal(rig_fault("camera.%d.unplug=0", low), 0);
    assert_true(rig_until(&rig, low, SST_GRAB_STREAMING, PATIENCE_MS) >= 0);
    assert_int_equal(counters(high).lost_devices, 1);
    assert_int_equal(counters(high).found_devices, 2); /* at the start, and again */
    assert_int_equal(rig_run(&rig, 500), 0);
    expect_lossless(0);
    rig_stop(&rig);
}

/* Unplugged with frames still lent out, back under another number: the same camera, and quickly. */
static void a_camera_comes_back(void **state SST_UNUSED)
{
    assert_int_equal(rig_config(&rig, 6), 0);
    need_usb();
    measured(come_back);
}

/* A camera's refusal is logged with its reason, does not climb to a reset, and is tried again. */
static void refusals_give_their_reason(void **state SST_UNUSED)
{
    assert_int_equal(rig_config(&rig, 3), 0);
    assert_int_equal(rig_fault("camera.%d.busy=1", 0), 0);
    assert_int_equal(rig_fault("camera.%d.nospace=1", 1), 0);
    assert_int_equal(rig_start(&rig), 1);
    assert_int_equal(rig.cam[0].state, SST_GRAB_REFUSED);
    assert_non_null(strstr(rig.cam[0].why, "another program"));
    assert_int_equal(rig.cam[1].state, SST_GRAB_REFUSED);
    assert_non_null(strstr(rig.cam[1].why, "USB bandwidth"));
    assert_non_null(strstr(rig.cam[1].why, "sst plan"));
    assert_int_equal(rig_fault("camera.%d.busy=0", 0), 0);
    assert_int_equal(rig_fault("camera.%d.nospace=0", 1), 0);
    assert_true(rig_until(&rig, 0, SST_GRAB_STREAMING, PATIENCE_MS) >= 0);
    assert_true(rig_until(&rig, 1, SST_GRAB_STREAMING, PATIENCE_MS) >= 0);
    assert_int_equal(counters(0).rung[SST_GRAB_RESET] + counters(1).rung[SST_GRAB_RESET], 0);
    rig_stop(&rig);

    assert_int_equal(rig_config(&rig, 1), 0);
    rig.cfg.width += 2;
    assert_int_equal(rig_start(&rig), 0);
    assert_int_equal(rig.cam[0].state, SST_GRAB_REFUSED);
    assert_non_null(strstr(rig.cam[0].why, "nearest"));
    rig_stop(&rig);

    assert_int_equal(rig_config(&rig, 1), 0);
    rig.cfg.fourcc = 0x30313050; /* P010 */
    assert_int_equal(rig_start(&rig), 0);
    assert_non_null(strstr(rig.cam[0].why, "MJPG"));
    rig_stop(&rig);
}

static void hold(void)
{
    patient(2);
    rig.cfg.stall_ms = 1000;
    rig.cfg.rate_hz = 20;
    assert_int_equal(rig_start(&rig), 2);
    rig.hold_cam = 0;
    for (int ms = 0; ms < PATIENCE_MS && rig.held_count < rig.cfg.buffers; ms += 100)
        assert_int_equal(rig_run(&rig, 100), 0);
    assert_int_equal(rig_run(&rig, 2000), 0);
    too_late(taken_for_hung, (int64_t)counters(0).rung[SST_GRAB_RESTREAM], 0);
    if (late[0])
        return;
    assert_int_equal(rig.held_count, rig.cfg.buffers);
    rig_release_held(&rig);
    for (int ms = 0; ms < PATIENCE_MS && counters(0).frames <= (uint64_t)rig.cfg.buffers; ms += 400)
        assert_int_equal(rig_run(&rig, 400), 0);
    too_late(taken_for_hung, (int64_t)counters(0).rung[SST_GRAB_RESTREAM], 0);
    if (late[0])
        return;
    assert_true(counters(0).lost >= 10);
    assert_true(counters(0).frames > (uint64_t)rig.cfg.buffers);
    expect_lossless(1);
    rig_stop(&rig);
}

/* A receiver that keeps everything loses frames, which are counted, and harms no other camera. */
static void a_slow_receiver_is_no_fault_of_the_camera(void **state SST_UNUSED)
{
    measured(hold);
}

static void release_out_of_order(void)
{
    patient(1);
    rig.cfg.buffers = 4;
    rig.cfg.rate_hz = 20;
    assert_int_equal(rig_fault("camera.%d.libcamera=1", 0), 0);
    assert_int_equal(rig_start(&rig), 1);
    assert_string_equal(sst_grab_camera_device(rig.grab, 0)->driver, "libcamera");
    for (int round = 0; round < 3; round++) {
        rig.hold_cam = 0;
        for (int ms = 0; ms < PATIENCE_MS && rig.held_count < 3; ms += 20)
            assert_int_equal(rig_run(&rig, 20), 0);
        assert_int_equal(rig.held_count >= 3, 1);
        rig.hold_cam = -1;
        while (rig.held_count) /* the newest first */
            sst_grab_release(rig.grab, rig.held[--rig.held_count]);
        for (uint64_t more = counters(0).frames + 6, ms = 0; ms < PATIENCE_MS && counters(0).frames < more; ms += 20)
            assert_int_equal(rig_run(&rig, 20), 0);
    }
    too_late(taken_for_hung, (int64_t)counters(0).rung[SST_GRAB_RESTREAM], 0);
    if (late[0])
        return;
    assert_int_equal(counters(0).bad, 0);
    assert_int_equal(rig.cam[0].faults & (SST_FRAME_BAD | SST_FRAME_FROZEN), 0);
    rig_stop(&rig);
    assert_int_equal(rig_fault("camera.%d.libcamera=0", 0), 0);
}

/* libcamera's V4L2 layer hands out the buffer whose turn it is, not the filled one: they are queued in turn. */
static void buffers_of_libcamera_are_queued_in_turn(void **state SST_UNUSED)
{
    measured(release_out_of_order);
}

static void give_back_late(void)
{
    patient(1);
    rig.cfg.buffers = 4;
    rig.cfg.rate_hz = 2;
    rig.cfg.stall_ms = 1700; /* not a whole number of frames */
    assert_int_equal(rig_start(&rig), 1);
    rig.hold_cam = 0;
    for (int ms = 0; ms < PATIENCE_MS && rig.held_count < rig.cfg.buffers; ms += 20)
        assert_int_equal(rig_run(&rig, 20), 0);
    assert_int_equal(rig_run(&rig, 1620 - (int)((sst_clock_now_ns() - rig.cam[0].last_ns) / RIG_MS)), 0);
    rig_release_held(&rig);
    for (int ms = 0; ms < PATIENCE_MS && counters(0).frames <= (uint64_t)rig.cfg.buffers; ms += 20)
        assert_int_equal(rig_run(&rig, 20), 0);
    assert_true(counters(0).frames > (uint64_t)rig.cfg.buffers);
    too_late(taken_for_hung, (int64_t)counters(0).rung[SST_GRAB_RESTREAM], 0);
    rig_stop(&rig);
}

/* Silence counts from when the camera has a buffer again, and not from its last frame. */
static void a_camera_that_had_no_buffer_is_not_hung(void **state SST_UNUSED)
{
    measured(give_back_late);
}

static void open_slowly(void)
{
    int64_t begin_ns;

    patient(4);
    assert_int_equal(rig_start(&rig), 4);
    assert_int_equal(rig_fault("camera.%d.slow_open_ms=4000", 2), 0);
    assert_int_equal(rig_fault("camera.%d.unplug=1", 2), 0);
    assert_true(rig_until(&rig, 2, SST_GRAB_ABSENT, PATIENCE_MS) >= 0);
    assert_int_equal(rig_fault("camera.%d.unplug=0", 2), 0);
    for (int i = 0; i < 4; i++)
        rig.cam[i].longest_gap_ns = rig.cam[i].last_ns = 0;
    assert_int_equal(rig_run(&rig, 1500), 0);
    for (int i = 0; i < 4; i++)
        too_late("ms between two frames", rig.cam[i].longest_gap_ns / RIG_MS, 1000);
    expect_lossless(0);
    begin_ns = sst_clock_now_ns();
    rig_stop(&rig);
    too_late("ms until all is closed", (sst_clock_now_ns() - begin_ns) / RIG_MS, 2000);
    assert_int_equal(rig_fault("camera.%d.slow_open_ms=0", 2), 0);
}

/* A camera that takes seconds to open holds up neither the others nor the end. */
static void slowness_stays_with_its_camera(void **state SST_UNUSED)
{
    measured(open_slowly);
}

static void two_devices_of_one_serial_are_refused(void **state SST_UNUSED)
{
    char text[SST_LOG_MAX] = "";

    assert_int_equal(rig_config(&rig, 6), 0);
    need_usb();
    assert_int_equal(rig_fault("camera.%d.swap=1", 3), 0); /* SIM0004 twice */
    (void)sst_log_hold_errors(text);
    assert_int_equal(rig_start(&rig), -ENOTUNIQ);
    (void)sst_log_hold_errors(NULL);
    assert_non_null(strstr(text, "SIM0004"));
    assert_non_null(strstr(text, "port"));
    assert_int_equal(rig_fault("camera.%d.swap=0", 3), 0);
}

/* Controls are set modes first and read back; a control that did not take its value is named. */
static void controls_are_read_back(void **state SST_UNUSED)
{
    char why[SST_WHY_MAX], note[SST_WHY_MAX];
    struct sst_grab_device *devices;
    struct grab_stream *stream;
    int count;

    assert_int_equal(rig_config(&rig, 1), 0);
    assert_int_equal(sst_grab_list(&devices, &count), 0);
    rig.cfg.controls = 3;
    rig.cfg.control[0] = (struct sst_grab_control){ "exposure_time_absolute", 120 };
    rig.cfg.control[1] = (struct sst_grab_control){ "auto_exposure", 1 };
    rig.cfg.control[2] = (struct sst_grab_control){ "gain", 20 };
    assert_int_equal(stream_open(&stream, &devices[0], &rig.cfg, 0, why, note), 0);
    assert_string_equal(note, "");
    stream_close(stream);

    rig.cfg.control[2].value = 1000000;
    snprintf(rig.cfg.control[0].name, SST_GRAB_NAME_MAX, "exposure");
    assert_int_equal(stream_open(&stream, &devices[0], &rig.cfg, 0, why, note), 0);
    assert_non_null(strstr(note, "unknown control exposure"));
    assert_non_null(strstr(note, "gain cannot be 1000000"));
    stream_close(stream);

    assert_int_equal(rig_fault("camera.%d.control_stuck=1", 0), 0);
    rig.cfg.controls = 1;
    rig.cfg.control[0] = (struct sst_grab_control){ "gain", 33 };
    assert_int_equal(stream_open(&stream, &devices[0], &rig.cfg, 0, why, note), 0);
    assert_non_null(strstr(note, "gain reads back as"));
    stream_close(stream);
    assert_int_equal(rig_fault("camera.%d.control_stuck=0", 0), 0);
    free(devices);
}

int main(int argc SST_UNUSED, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(all_cameras_stream, clean_up),
        cmocka_unit_test_teardown(closing_leaves_nothing, clean_up),
        cmocka_unit_test_teardown(stopping_and_going_on_is_no_fault, clean_up),
        cmocka_unit_test_teardown(stopping_while_cameras_are_asked_is_no_fault, clean_up),
        cmocka_unit_test_teardown(damage_is_told_by_kind, clean_up),
        cmocka_unit_test_teardown(each_rung_brings_back_what_it_can, clean_up),
        cmocka_unit_test_teardown(a_camera_comes_back, clean_up),
        cmocka_unit_test_teardown(refusals_give_their_reason, clean_up),
        cmocka_unit_test_teardown(a_slow_receiver_is_no_fault_of_the_camera, clean_up),
        cmocka_unit_test_teardown(buffers_of_libcamera_are_queued_in_turn, clean_up),
        cmocka_unit_test_teardown(a_camera_that_had_no_buffer_is_not_hung, clean_up),
        cmocka_unit_test_teardown(slowness_stays_with_its_camera, clean_up),
        cmocka_unit_test_teardown(two_devices_of_one_serial_are_refused, clean_up),
        cmocka_unit_test_teardown(controls_are_read_back, clean_up),
    };

    rig_enter_session(argv, "tests/grab_world.yaml");
    return cmocka_run_group_tests(tests, NULL, NULL);
}
