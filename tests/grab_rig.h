/* tests/grab_rig.h - cameras of a simulated session under sst_grab, with what they did; for tests and benchmarks. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_GRAB_RIG_H
#define SST_TESTS_GRAB_RIG_H

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/clock.h"
#include "drivers/grab/grab.h"
#include "simulators/devices/proto.h"

#define RIG_MS INT64_C(1000000)

struct rig_camera {
    uint64_t frames, lost;
    unsigned faults;        /* all bits seen */
    int64_t last_ns;        /* arrival of the last frame */
    int64_t longest_gap_ns; /* between two frames while the camera was streaming */
    int64_t back_ns;        /* first frame after the last change to another state */
    enum sst_grab_state state;
    char why[256];
};

struct rig {
    struct sst_grab *grab;
    struct sst_grab_config cfg;
    struct sst_grab_binding bindings[SST_CAMERAS_MAX];
    struct rig_camera cam[SST_CAMERAS_MAX];
    struct sst_frame *held[SST_CAMERAS_MAX * 32];
    int held_count, hold_cam; /* this camera's frames are not given back; -1: none */
};

/** Run this program again inside a new simulated session of this world; exits with 77 where there is no simulator. */
static inline void rig_enter_session(char **argv, const char *world)
{
    const char *build = getenv("SST_BUILD");
    char path[512];
    char *args[64] = { path, (char *)(uintptr_t) "--quiet", (char *)(uintptr_t) "--world", (char *)(uintptr_t)world,
                       (char *)(uintptr_t) "--" };

    if (getenv(SST_SIM_DIR_ENV))
        return;
    snprintf(path, sizeof(path), "%s/sst-sim", build ? build : "build");
    if (access(path, X_OK)) {
        printf("%s is not built: no simulated cameras\n", path);
        exit(77);
    }
    for (int i = 0; i < 58 && argv[i]; i++)
        args[i + 5] = argv[i];
    execv(path, args);
    perror(path);
    exit(1);
}

/** Set a fault: rig_fault("camera.%d.unplug=1", 7). Quick enough to be called between two frames. @return 0 */
static inline int rig_fault(const char *fmt, int cam)
{
    struct sockaddr_un name = { .sun_family = AF_UNIX };
    struct {
        struct sst_sim_call head;
        char text[128];
    } call = { .head = { .op = SST_SIM_FAULT } };
    struct sst_sim_answer answer = { .result = -1 };
    const int fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    const int length = snprintf(call.text, sizeof(call.text), fmt, cam);

    snprintf(name.sun_path, sizeof(name.sun_path), "%s/" SST_SIM_SOCKET, getenv(SST_SIM_DIR_ENV));
    if (connect(fd, (const struct sockaddr *)&name, sizeof(name)) ||
        send(fd, &call, sizeof(call.head) + (size_t)length, MSG_NOSIGNAL) < 0 ||
        recv(fd, &answer, sizeof(answer), MSG_TRUNC) < (ssize_t)sizeof(answer))
        perror("sst-sim");
    close(fd);
    return answer.result < 0 ? -1 : 0;
}

/** Take back all faults that a test here sets. @return 0 */
static inline int rig_fault_reset(void)
{
    static const char *const names[] = { "unplug",    "eio",         "error_flag",    "gap",           "frozen",
                                         "truncated", "corrupt_soi", "corrupt_eoi",   "corrupt_mid",   "short",
                                         "stall",     "busy",        "nospace",       "sequence_wrap", "time_wrap",
                                         "backwards", "swap",        "control_stuck", "slow_open_ms",
                                         "libcamera" };
    char fault[64];
    int err = 0;

    for (size_t i = 0; !err && i < ARRAY_LEN(names); i++) {
        snprintf(fault, sizeof(fault), "camera.*.%s=0", names[i]);
        err = rig_fault(fault, 0);
    }
    return err;
}

static inline void rig_on_frame(void *arg, struct sst_frame *f)
{
    struct rig *r = arg;
    struct rig_camera *c = &r->cam[f->cam];

    c->frames++;
    c->lost += f->lost_before;
    c->faults |= f->faults;
    if (c->last_ns && f->arrival_ns - c->last_ns > c->longest_gap_ns)
        c->longest_gap_ns = f->arrival_ns - c->last_ns;
    c->last_ns = f->arrival_ns;
    if (!c->back_ns)
        c->back_ns = f->arrival_ns;
    if (f->cam == r->hold_cam)
        r->held[r->held_count++] = f;
    else
        sst_grab_release(r->grab, f);
}

static inline void rig_on_state(void *arg, int cam, enum sst_grab_state state, const char *why)
{
    struct rig_camera *c = &((struct rig *)arg)->cam[cam];

    if (state != SST_GRAB_STREAMING)
        c->last_ns = c->back_ns = 0;
    c->state = state;
    snprintf(c->why, sizeof(c->why), "%s", why);
}

/** Cameras SIM0000 ... by serial, MJPEG of the native size, running on their own. */
static inline int rig_config(struct rig *r, int cameras)
{
    struct sst_grab_device *devices;
    const int64_t begin_ns = sst_clock_now_ns();
    int count, err = sst_grab_list(&devices, &count);
    char *size;

    while (!err && count < cameras && sst_clock_now_ns() - begin_ns < 60000 * RIG_MS) { /* not all are back yet */
        free(devices);
        usleep(10000);
        err = sst_grab_list(&devices, &count);
    }
    if (err)
        return err;
    memset(r, 0, sizeof(*r));
    r->hold_cam = -1;
    sst_grab_config_defaults(&r->cfg);
    r->cfg.cameras = cameras;
    r->cfg.bindings = r->bindings;
    r->cfg.rate_hz = 10;
    r->cfg.check_frozen = true;
    /* Ports stand for cameras where this build does not learn of serials, and are in their order. */
    for (int i = 0; i < cameras && i < count; i++) {
        if (*devices[i].serial)
            snprintf(r->bindings[i].serial, sizeof(r->bindings[i].serial), "SIM%04d", i);
        else
            memcpy(r->bindings[i].port, devices[i].port, sizeof(devices[i].port));
    }
    size = count < cameras ? NULL : strstr(devices[0].formats, "MJPG ");
    if (!size || sscanf(size + 5, "%dx%d", &r->cfg.width, &r->cfg.height) != 2)
        err = -1;
    free(devices);
    return err;
}

static inline int rig_start(struct rig *r)
{
    const struct sst_grab_events events = { r, rig_on_frame, rig_on_state };
    int err = sst_grab_open(&r->grab, &r->cfg, &events);

    return err ? err : sst_grab_start(r->grab);
}

static inline int rig_run(struct rig *r, int ms)
{
    const int64_t end_ns = sst_clock_now_ns() + ms * RIG_MS;
    int err = 0;

    while (!err && sst_clock_now_ns() < end_ns)
        err = sst_grab_poll(r->grab, 20);
    return err;
}

/** Run until a camera is in a state. @return ms that took, -1: not within limit_ms */
static inline int rig_until(struct rig *r, int cam, enum sst_grab_state state, int limit_ms)
{
    const int64_t begin_ns = sst_clock_now_ns();

    while (sst_grab_camera_state(r->grab, cam) != state) {
        if (sst_clock_now_ns() - begin_ns > limit_ms * RIG_MS || sst_grab_poll(r->grab, 20))
            return -1;
    }
    return (int)((sst_clock_now_ns() - begin_ns) / RIG_MS);
}

static inline void rig_release_held(struct rig *r)
{
    while (r->held_count)
        sst_grab_release(r->grab, r->held[--r->held_count]);
    r->hold_cam = -1;
}

static inline void rig_stop(struct rig *r)
{
    rig_release_held(r);
    sst_grab_close(r->grab);
    r->grab = NULL;
}

#endif
