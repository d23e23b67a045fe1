/* Cameras through drivers/grab on whatever nodes there are: a line per change of state, at the end the sums per camera
   and how many frames of each camera the machine itself may have lost because a processor did not run in time.

   grab [-o DIR] FOURCC WIDTH HEIGHT RATE_HZ SECONDS PORT...   (-o: keep the good frames of the first camera as files)
   grab -l   lists the capture nodes */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* pthread_setaffinity_np */
#include <inttypes.h>
#include <linux/videodev2.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "drivers/grab/grab.h"

enum { CPUS_MAX = 64, WAKE_MS = 10 };

/* A thread on each processor wakes every 10 ms and measures how late it is. vivid makes a frame when its own thread
   runs and skips those whose time has passed, so a processor that runs its threads late loses at most late / period
   frames of a camera, rounded up. */
struct stalls {
    pthread_t thread[CPUS_MAX];
    int threads;
    int64_t period_ns;
    atomic_bool end;
    atomic_int frames;
    atomic_int worst_ms;
};

struct run {
    struct sst_grab *grab;
    const char *dir;
    int kept;
};

static void *stalls_thread(void *arg)
{
    struct stalls *s = arg;
    int64_t last_ns = sst_clock_now_ns();

    while (!atomic_load(&s->end)) {
        int64_t now_ns, late_ns;
        int ms;

        usleep(WAKE_MS * 1000);
        now_ns = sst_clock_now_ns();
        late_ns = now_ns - last_ns - WAKE_MS * INT64_C(1000000);
        last_ns = now_ns;
        ms = (int)(late_ns / 1000000);
        if (ms > atomic_load(&s->worst_ms))
            atomic_store(&s->worst_ms, ms);
        /* vivid's thread wakes at another moment: when this one is late by half a period, vivid's can be by a whole
         * one. */
        if (late_ns > s->period_ns / 2)
            atomic_fetch_add(&s->frames, (int)(late_ns / s->period_ns) + 1);
    }
    return NULL;
}

static void stalls_start(struct stalls *s, double rate_hz)
{
    const long cpus = sysconf(_SC_NPROCESSORS_ONLN);

    s->period_ns = (int64_t)(1e9 / rate_hz);
    for (int i = 0; i < cpus && i < CPUS_MAX; i++) {
        cpu_set_t one;

        CPU_ZERO(&one);
        CPU_SET(i, &one);
        if (pthread_create(&s->thread[s->threads], NULL, stalls_thread, s))
            break;
        pthread_setaffinity_np(s->thread[s->threads++], sizeof(one), &one);
    }
}

static void stalls_end(struct stalls *s)
{
    atomic_store(&s->end, true);
    for (int i = 0; i < s->threads; i++)
        pthread_join(s->thread[i], NULL);
    printf("stalled %d frames, worst %d ms\n", atomic_load(&s->frames), atomic_load(&s->worst_ms));
}

static void keep(struct run *r, const struct sst_frame *f)
{
    char path[512];
    FILE *file;

    if (!r->dir || f->cam || f->faults & SST_FRAME_BAD)
        return;
    snprintf(path, sizeof(path), "%s/%04d", r->dir, r->kept++);
    file = fopen(path, "wb");
    if (!file || fwrite(f->data, 1, f->bytes, file) != f->bytes || fclose(file))
        printf("FAIL: %s cannot be written\n", path);
}

static void on_frame(void *arg, struct sst_frame *f)
{
    struct run *r = arg;

    keep(r, f);
    sst_grab_release(r->grab, f);
}

static void on_state(void *arg SST_UNUSED, int cam, enum sst_grab_state state, const char *why)
{
    static const char *const names[] = { "absent", "streaming", "recovering", "refused", "ready" };

    printf("%d %s: %s\n", cam, names[state], why);
    fflush(stdout);
}

static void sum(const struct run *r, int cameras)
{
    for (int i = 0; i < cameras; i++) {
        struct sst_grab_counters c;

        sst_grab_counters(r->grab, i, &c);
        printf("sum %d frames %" PRIu64 " bad %" PRIu64 " lost %" PRIu64 " flagged %" PRIu64 " structure %" PRIu64
               " backwards %" PRIu64 " frozen %" PRIu64 " gone %" PRIu64 " found %" PRIu64 " restream %" PRIu64
               " reopen %" PRIu64 "\n",
               i, c.frames, c.bad, c.lost, c.fault[0], c.fault[1] + c.fault[2] + c.fault[3] + c.fault[4] + c.fault[5],
               c.fault[6], c.fault[7], c.lost_devices, c.found_devices, c.rung[SST_GRAB_RESTREAM],
               c.rung[SST_GRAB_REOPEN]);
    }
}

static int list(void)
{
    struct sst_grab_device *devices;
    int count, err = sst_grab_list(&devices, &count);

    if (err)
        return 1;
    for (int i = 0; i < count; i++)
        printf("%s|%s|%s|%s|%s|%d\n", devices[i].node, devices[i].port, devices[i].serial, devices[i].name,
               devices[i].driver, devices[i].error);
    free(devices);
    return 0;
}

static int capture(struct run *r, const struct sst_grab_config *cfg, double seconds)
{
    const struct sst_grab_events events = { r, on_frame, on_state };
    struct stalls stalls = { 0 };
    int64_t end_ns;
    int n, err = sst_grab_open(&r->grab, cfg, &events);

    if (err) {
        printf("open %d\n", err);
        return 1;
    }
    stalls_start(&stalls, cfg->rate_hz);
    n = sst_grab_start(r->grab);
    printf("started %d\n", n);
    fflush(stdout);
    end_ns = sst_clock_now_ns() + (int64_t)(seconds * 1e9);
    while (!err && sst_clock_now_ns() < end_ns)
        err = sst_grab_poll(r->grab, 100);
    sum(r, cfg->cameras);
    stalls_end(&stalls);
    end_ns = sst_clock_now_ns();
    sst_grab_close(r->grab);
    printf("closed in %.1f s\n", (double)(sst_clock_now_ns() - end_ns) * 1e-9);
    return err || n < 0;
}

int main(int argc, char **argv)
{
    static struct sst_grab_binding binding[SST_CAMERAS_MAX];
    struct sst_grab_config cfg;
    struct run run = { 0 };
    int a = 1;

    if (argc == 2 && !strcmp(argv[1], "-l"))
        return list();
    if (argc > 2 && !strcmp(argv[1], "-o")) {
        run.dir = argv[2];
        a = 3;
    }
    if (argc < a + 6 || strlen(argv[a]) != 4)
        return 2;
    sst_grab_config_defaults(&cfg);
    cfg.fourcc = v4l2_fourcc(argv[a][0], argv[a][1], argv[a][2], argv[a][3]);
    cfg.width = atoi(argv[a + 1]);
    cfg.height = atoi(argv[a + 2]);
    cfg.rate_hz = atof(argv[a + 3]);
    cfg.check_frozen = true;
    cfg.bindings = binding;
    for (int i = a + 5; i < argc && cfg.cameras < SST_CAMERAS_MAX; i++)
        snprintf(binding[cfg.cameras++].port, SST_GRAB_NAME_MAX, "%s", argv[i]);
    return capture(&run, &cfg, atof(argv[a + 4]));
}
