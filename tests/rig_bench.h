/* tests/rig_bench.h - simulated drives, the driver on them, and a camera that writes into each frame where it was. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_RIG_BENCH_H
#define SST_TESTS_RIG_BENCH_H

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "capture/rig/rig.h"
#include "pipeline/image/codec.h"
#include "simulators/rig/drive.h"
#include "tests/strip_read.h"

#define BENCH_WIDTH       640
#define BENCH_HEIGHT      64
#define BENCH_EXPOSURE_NS 4000000
#define BENCH_PERIOD_NS   7000000

struct bench {
    struct sst_sim_drive *drive; /* NULL: the pose comes from `shared` */
    const volatile int32_t *shared;
    struct sst_rig_config rig_cfg;
    struct sst_scan_config cfg;
    struct sst_scan_camera camera;
    char link[64], dir[64];

    /* the camera */
    uint8_t luma[BENCH_HEIGHT * BENCH_WIDTH];
    struct sst_frame frame;
    uint32_t shots;
    int moving;        /* exposures during which the true pose changed */
    int fail_shots;    /* number of shots that time out */
    uint32_t fault_at; /* with this shot the fault below is set */
    const char *fault, *value;
};

static inline void bench_pose(const struct bench *b, int64_t t_ns, int32_t pose[3])
{
    if (b->drive)
        sst_sim_drive_pose(b->drive, t_ns, pose);
    for (int i = 0; i < 3 && !b->drive; i++)
        pose[i] = b->shared[i];
}

static inline void bench_sleep_until(int64_t t_ns)
{
    const int64_t ns = t_ns - sst_clock_now_ns();
    const struct timespec t = { .tv_sec = ns / 1000000000, .tv_nsec = ns % 1000000000 };

    if (ns > 0)
        (void)nanosleep(&t, NULL);
}

static inline int bench_expose(void *arg, int64_t after_ns, int timeout_ms, struct sst_frame **frame)
{
    struct bench *b = arg;
    const int64_t t_ns = (after_ns / BENCH_PERIOD_NS + 1) * BENCH_PERIOD_NS;
    struct sst_sim_exposure e = { .t_ns = t_ns, .exposure_us = BENCH_EXPOSURE_NS / 1000, .gain = 1 };
    char error[160];
    int32_t end[3];

    (void)timeout_ms;
    b->shots++;
    if (b->fail_shots > 0) {
        b->fail_shots--;
        return -ETIMEDOUT;
    }
    bench_sleep_until(t_ns);
    bench_pose(b, t_ns, e.pose_um);
    bench_sleep_until(t_ns + BENCH_EXPOSURE_NS);
    bench_pose(b, t_ns + BENCH_EXPOSURE_NS, end);
    for (int i = 0; i < 3; i++)
        b->moving += abs(end[i] - e.pose_um[i]) > 8;
    e.trigger = b->shots;
    memset(b->luma, (int)b->shots, sizeof(b->luma));
    strip_draw(b->luma, BENCH_WIDTH, BENCH_WIDTH, &e);
    b->frame = (struct sst_frame){
        .fourcc = b->cfg.fourcc,
        .width = BENCH_WIDTH,
        .height = BENCH_HEIGHT,
        .stride = BENCH_WIDTH,
        .data = b->luma,
        .bytes = sizeof(b->luma),
        .sequence = b->shots,
        .t_ns = t_ns,
        .arrival_ns = sst_clock_now_ns(),
    };
    *frame = &b->frame;
    if (b->fault && b->shots == b->fault_at &&
        sst_sim_drive_fault(b->drive, b->fault, b->value, error, sizeof(error))) {
        fprintf(stderr, "%s\n", error);
        abort();
    }
    return 0;
}

static inline void bench_release(void *arg, struct sst_frame *frame)
{
    (void)arg;
    memset((uint8_t *)frame->data, 0xAA, 64); /* whoever reads it now has not understood */
}

static inline void bench_config(struct bench *b, const char *bus)
{
    sst_rig_config_defaults(&b->rig_cfg);
    snprintf(b->rig_cfg.bus, sizeof(b->rig_cfg.bus), "%s", bus);
    strcpy(b->rig_cfg.profile, "sst-sim");
    b->rig_cfg.speed_mm_s = 500;
    b->rig_cfg.accel_mm_s2 = 2000;
    b->rig_cfg.settle_ms = 15;
    b->rig_cfg.response_ms = 150;
    b->rig_cfg.reconnect_ms = 20000; /* a serial line is back after half a second, on a machine that is awake */
    sst_scan_config_defaults(&b->cfg);
    b->cfg.dir = b->dir;
    b->cfg.pitch_um[0] = b->cfg.pitch_um[1] = 4000;
    b->cfg.backlash_um = 300;
    for (int a = 0; a < SST_RIG_AXES; a++)
        b->cfg.origin_um[a] = 300;
    b->cfg.guard_ms = 1;
    b->cfg.home_ms = 8000;
    b->cfg.fourcc = 'G' | 'R' << 8 | 'E' << 16 | (uint32_t)'Y' << 24;
    b->cfg.width = BENCH_WIDTH;
    b->cfg.height = BENCH_HEIGHT;
    b->camera = (struct sst_scan_camera){
        .arg = b, .expose = bench_expose, .release = bench_release, .serial = "SIM0001", .port = "1-1"
    };
}

/** @return 0 or what failed, nothing left */
static inline int bench_start(struct bench *b, bool serial)
{
    struct sst_sim_drive_config sim = { .tcp_port = serial ? -1 : 0, .seed = 3 };
    char bus[128];
    int err;

    *b = (struct bench){ .drive = NULL };
    snprintf(b->link, sizeof(b->link), "/tmp/sst-rig-%d", (int)getpid());
    snprintf(b->dir, sizeof(b->dir), "/tmp/sst-rig-XXXXXX");
    if (!mkdtemp(b->dir))
        return -1;
    sim.rtu_link = serial ? b->link : NULL;
    err = sst_sim_drive_start(&b->drive, &sim);
    if (err)
        return err;
    if (serial)
        snprintf(bus, sizeof(bus), "rtu:%s,115200,8E1", b->link);
    else
        snprintf(bus, sizeof(bus), "tcp:127.0.0.1:%d", sst_sim_drive_tcp_port(b->drive));
    bench_config(b, bus);
    return 0;
}

static inline void bench_end(struct bench *b)
{
    sst_sim_drive_stop(b->drive);
    sst_path_remove_tree(b->dir);
}

/** One run of the program: open folder and rig, capture, close. */
static inline int bench_capture(struct bench *b, struct sst_scan_report *report)
{
    struct sst_scan_store *store;
    struct sst_rig *rig;
    int err = sst_scan_store_open(&store, &b->cfg);

    *report = (struct sst_scan_report){ .taken = 0 };
    if (err)
        return err;
    err = sst_rig_open(&rig, &b->rig_cfg);
    if (!err) {
        err = sst_scan_run(&(struct sst_scan){ rig, &b->rig_cfg, &b->camera, store, &b->cfg }, report);
        sst_rig_close(rig);
    }
    sst_scan_store_close(store);
    return err;
}

/** Views whose strip says that they were taken within 12 um of their pose. */
static inline int bench_good_views(const struct bench *b)
{
    int good = 0;

    for (int k = 0; k < b->cfg.rows * b->cfg.cols; k++) {
        const struct sst_rig_pos want = sst_scan_pose(&b->cfg, k);
        struct sst_map_u8 map = { 0 };
        struct sst_sim_exposure e;
        char path[128];
        bool ok;

        snprintf(path, sizeof(path), "%s/views/%02d_%02d.png", b->dir, k / b->cfg.cols, k % b->cfg.cols);
        if (!sst_path_exists(path) || sst_map_u8_read_png(&map, path))
            continue;
        ok = !strip_read(map.data, map.stride, map.width, map.height, &e);
        for (int a = 0; ok && a < b->rig_cfg.axes; a++)
            ok = abs(e.pose_um[a] - want.um[a]) <= 12;
        good += ok;
        sst_map_u8_fini(&map);
    }
    return good;
}

#endif
