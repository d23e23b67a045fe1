/* Interposed libc functions that read the wall clock: a session's host may have a clock of its own. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include "simulators/devices/preload/preload_internal.h"

#define NS 1000000000LL

enum { UNREAD = 0, READING = 1, NONE = 2, SHIFTED = 3 };

static atomic_int state;
static long long offset_ns, origin_ns;
static double drift_ppm;

/* Read the session's file; others see the machine's clock meanwhile. */
static void read_clock(void)
{
    char path[SIM_PATH_MAX], text[128];
    int unread = UNREAD, fd;
    ssize_t n = 0;

    if (!sim_dir() || !atomic_compare_exchange_strong(&state, &unread, READING))
        return;
    snprintf(path, sizeof(path), "%.*s/" SST_SIM_CLOCK, (int)sizeof(path) - 16, sim_dir());
    fd = sim_next()->open_(path, O_RDONLY | O_CLOEXEC);
    if (fd >= 0) {
        n = sim_next()->read_(fd, text, sizeof(text) - 1);
        (void)sim_next()->close_(fd);
    }
    text[n > 0 ? n : 0] = 0;
    atomic_store(&state,
                 n > 0 && sscanf(text, "%lld %lf %lld", &offset_ns, &drift_ppm, &origin_ns) == 3 ? SHIFTED : NONE);
}

static int read_next(clockid_t id, struct timespec *out)
{
    NEXT(int, clock_gettime, clockid_t, struct timespec *);
    return next(id, out);
}

HOOK int clock_gettime(clockid_t id, struct timespec *out)
{
    struct timespec now;
    long long t;
    int err;

    if (atomic_load_explicit(&state, memory_order_relaxed) == UNREAD) {
        const int saved = errno;

        read_clock();
        errno = saved;
    }
    err = read_next(id, out);
    if (err || (id != CLOCK_REALTIME && id != CLOCK_REALTIME_COARSE) || atomic_load(&state) != SHIFTED ||
        read_next(CLOCK_MONOTONIC, &now))
        return err;
    t = out->tv_sec * NS + out->tv_nsec + offset_ns +
        (long long)((double)(now.tv_sec * NS + now.tv_nsec - origin_ns) * drift_ppm * 1e-6);
    *out = (struct timespec){ t / NS, t % NS };
    return 0;
}

HOOK int gettimeofday(struct timeval *restrict out, void *restrict zone)
{
    struct timespec now;
    NEXT(int, gettimeofday, struct timeval *restrict, void *restrict);

    if (atomic_load(&state) != SHIFTED || clock_gettime(CLOCK_REALTIME, &now))
        return next(out, zone);
    *out = (struct timeval){ now.tv_sec, now.tv_nsec / 1000 };
    return 0;
}

HOOK time_t time(time_t *out)
{
    struct timespec now = { 0 };

    (void)clock_gettime(CLOCK_REALTIME, &now);
    if (out)
        *out = now.tv_sec;
    return now.tv_sec;
}
