/* Checks of the machine: disk, limits, clock, camera driver. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/statvfs.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/kernel_clock.h"
#include "base/text.h"
#include "capture/link/link.h"
#include "cli/cli_internal.h"
#include "cli/doctor_internal.h"
#include "pipeline/gpu/gpu.h"
#include "pipeline/method/disparity/device.h"
#include "pipeline/method/network/device.h"
#include "pipeline/method/render/device.h"
#include "pipeline/step/run.h"
#include "pipeline/step/runner.h"

#define AREA_DISK           "disk"
#define AREA_GPU            "gpu"
#define AREA_CLOCK          "clock"
#define TRY_NS              1000000000 /* of writing */
#define TRY_BYTES           (256 << 20)
#define CHUNK               (4 << 20)
#define JPEG_BYTES_PER_PX   0.25 /* of a detailed picture at high quality; half of it for plain ones */
#define QUIRK_FIX_BANDWIDTH 0x80

/* --- disk --------------------------------------------------------------------------------------------------------- */

/* Data rate of a recording of all cameras. */
static double needed_mb_s(const struct doctor *d)
{
    const struct sst_array_config *a = d->cfg;
    const double rate_hz = sst_array_sets_hz(a);
    const int64_t raw = sst_usb_format_bytes_s(a->fourcc, a->width, a->height, rate_hz);
    const double one = raw ? (double)raw : (double)a->width * a->height * JPEG_BYTES_PER_PX * rate_hz;

    return one * d->cameras / 1e6;
}

/* Write to a file without a name, so that nothing is left behind. @return MB/s, or -errno */
static double try_writing(const char *folder, double most_bytes)
{
    const int64_t start_ns = sst_clock_now_ns();
    char *chunk = malloc(CHUNK);
    int fd = open(folder, O_TMPFILE | O_WRONLY | O_CLOEXEC, 0600), err = 0;
    double bytes = 0;

    if (fd < 0)
        err = errno;
    else if (!chunk)
        err = ENOMEM;
    for (uint32_t i = 0; !err && i < CHUNK / 4; i++) /* data that a file system cannot compress */
        memcpy(chunk + 4 * (size_t)i, &(uint32_t){ i * 2654435761u }, 4);
    while (!err && bytes < most_bytes && sst_clock_now_ns() - start_ns < TRY_NS) {
        const ssize_t n = write(fd, chunk, CHUNK);

        if (n < 0 && errno != EINTR)
            err = errno;
        bytes += n > 0 ? (double)n : 0;
        if (!err && fdatasync(fd))
            err = errno;
    }
    if (fd >= 0)
        close(fd);
    free(chunk);
    return err ? -err : bytes * 1e3 / (double)(sst_clock_now_ns() - start_ns);
}

static void judge_speed(struct doctor *d, double free_bytes)
{
    const double needed = needed_mb_s(d);
    const double speed = try_writing(d->folder, free_bytes / 4 < TRY_BYTES ? free_bytes / 4 : TRY_BYTES);
    const double hours = needed > 0 ? free_bytes / 1e6 / needed / 3600 : 0;

    if (speed == -EOPNOTSUPP)
        doctor_add(d, DOCTOR_WARNING, AREA_DISK, "%s cannot be tested without leaving a file: %.1f GB are free",
                   d->folder, free_bytes / 1e9);
    else if (speed <= 0)
        doctor_add(d, DOCTOR_PROBLEM, AREA_DISK, "cannot write to %s: %s: free space, or choose another folder",
                   d->folder, strerror(speed < 0 ? (int)-speed : ENOSPC));
    else if (speed < needed)
        doctor_add(d, DOCTOR_PROBLEM, AREA_DISK,
                   "%s writes %.0f MB/s, but %d cameras deliver %.0f: use a faster disk, or lower size or rate",
                   d->folder, speed, d->cameras, needed);
    else if (speed < 1.5 * needed)
        doctor_add(
            d, DOCTOR_WARNING, AREA_DISK,
            "%s writes %.0f MB/s and %d cameras deliver %.0f: this leaves little margin for a slow moment of the disk",
            d->folder, speed, d->cameras, needed);
    else
        doctor_add(d, DOCTOR_OK, AREA_DISK, "%s writes %.0f MB/s, %d cameras deliver %.0f", d->folder, speed,
                   d->cameras, needed);
    if (needed > 0)
        doctor_add(d, hours < 1 ? DOCTOR_WARNING : DOCTOR_OK, AREA_DISK,
                   "%.1f GB are free in %s: %.1f hours of recording", free_bytes / 1e9, d->folder, hours);
}

void doctor_check_disk(struct doctor *d)
{
    struct statvfs fs;

    if (!d->folder)
        return;
    if (statvfs(d->folder, &fs)) {
        doctor_add(d, DOCTOR_PROBLEM, AREA_DISK, "folder %s: %s: create it, or choose another with -o", d->folder,
                   strerror(errno));
        return;
    }
    if (fs.f_flag & ST_RDONLY)
        doctor_add(
            d, DOCTOR_PROBLEM, AREA_DISK,
            "%s is on a file system that is mounted read-only: remount it, after checking `dmesg` for its errors",
            d->folder);
    else if (access(d->folder, W_OK | X_OK))
        doctor_add(d, DOCTOR_PROBLEM, AREA_DISK,
                   "no permission to write to %s: change its owner, or choose another with -o", d->folder);
    else if ((double)fs.f_bavail * (double)fs.f_frsize < CHUNK)
        doctor_add(d, DOCTOR_PROBLEM, AREA_DISK, "the file system of %s is full: remove old recordings", d->folder);
    else
        judge_speed(d, (double)fs.f_bavail * (double)fs.f_frsize);
}

/* --- limits ------------------------------------------------------------------------------------------------------- */

/* Trying is the only reliable test: the permission comes from root, capabilities or limits. */
static bool may_be_real_time(void)
{
    const struct sched_param wanted = { .sched_priority = 50 };
    struct sched_param before;
    const int policy = sched_getscheduler(0);

    if (policy < 0 || sched_getparam(0, &before) || sched_setscheduler(0, SCHED_FIFO, &wanted))
        return false;
    (void)sched_setscheduler(0, policy, &before);
    return true;
}

void doctor_check_limits(struct doctor *d)
{
    struct rlimit files;

    if (may_be_real_time())
        doctor_add(d, DOCTOR_OK, "limits", "real-time priority is permitted");
    else
        doctor_add(d, DOCTOR_WARNING, "limits",
                   "no permission for real-time priority: triggers may be late on a busy machine; set `@video - rtprio "
                   "60` in /etc/security/limits.d/sst.conf");
    /* One descriptor per camera (mapped buffers need none), the rest for files, timers and the bus. */
    if (!getrlimit(RLIMIT_NOFILE, &files) && files.rlim_cur < (rlim_t)(2 * d->cameras + 64))
        doctor_add(d, DOCTOR_PROBLEM, "limits",
                   "the limit of %llu open files is too low for %d cameras: `ulimit -n 1024`",
                   (unsigned long long)files.rlim_cur, d->cameras);
}

/* --- clock -------------------------------------------------------------------------------------------------------- */

/* Of several hosts: the clock names a node's first set, and may be wrong by a part of the trigger's period then. */
static void judge_hosts_clock(struct doctor *d, const struct sst_kernel_clock *clock)
{
    const double period_ms = 1e3 / sst_array_sets_hz(d->cfg), error_ms = clock->error_us / 1e3;
    const char *what = d->cfg->role == SST_CONFIG_NODE ? "node" : "head";

    if (!clock->known || !clock->synchronised)
        doctor_add(
            d, DOCTOR_PROBLEM, AREA_CLOCK,
            "no program keeps the wall clock of this %s: its sets could be named wrongly when it joins; install and "
            "enable chrony (chronyc tracking shows its state) or PTP on all hosts",
            what);
    else if (error_ms > period_ms / 10)
        doctor_add(
            d, DOCTOR_WARNING, AREA_CLOCK,
            "the wall clock of this %s may be wrong by %.1f ms, more than a tenth of the trigger's period of %.0f ms: "
            "use a nearer time server (chronyc sources) or PTP, the same for all hosts",
            what, error_ms, period_ms);
    else
        doctor_add(d, DOCTOR_OK, AREA_CLOCK,
                   "the wall clock of this %s is kept, error at most %.1f ms and probably %.3f ms, of a trigger's "
                   "period of %.0f ms%s",
                   what, error_ms, clock->estimate_us / 1e3, period_ms,
                   clock->tai_s ? "; TAI is set, as by PTP or chrony" : "");
}

void doctor_check_clock(struct doctor *d)
{
    struct sst_kernel_clock clock;
    struct timespec resolution;

    sst_kernel_clock(&clock);
    if (d->cfg->role != SST_CONFIG_SINGLE)
        judge_hosts_clock(d, &clock);
    else if (!clock.known)
        doctor_add(d, DOCTOR_WARNING, AREA_CLOCK,
                   "cannot read whether the clock is synchronised: the system refuses it");
    else if (!clock.synchronised)
        doctor_add(d, DOCTOR_WARNING, AREA_CLOCK,
                   "the wall clock is not synchronised, so the times in recordings may be "
                   "wrong: enable systemd-timesyncd or chrony");
    else
        doctor_add(d, DOCTOR_OK, AREA_CLOCK, "the wall clock is synchronised, error at most %.1f ms",
                   clock.error_us / 1e3);
    if (clock_getres(CLOCK_MONOTONIC, &resolution) || resolution.tv_sec || resolution.tv_nsec > 1000)
        doctor_add(d, DOCTOR_WARNING, AREA_CLOCK,
                   "timers have a resolution of %ld ns: boot with highres=on, or triggers are late by that much",
                   resolution.tv_nsec);
}

/* --- hosts -------------------------------------------------------------------------------------------------------- */

void doctor_check_hosts(struct doctor *d)
{
    char why[500];

    if (d->cfg->role != SST_CONFIG_SINGLE)
        doctor_add(d, sst_link_check(d->cfg, why, sizeof(why)) ? DOCTOR_PROBLEM : DOCTOR_OK, "hosts", "%s", why);
}

/* --- camera driver ------------------------------------------------------------------------------------------------ */

static long read_parameter(const char *name)
{
    char path[SST_PATH_MAX], text[32];

    snprintf(path, sizeof(path), "/sys/module/uvcvideo/parameters/%s", name);
    return *sst_file_line(text, sizeof(text), path) ? strtol(text, NULL, 0) : -1;
}

void doctor_check_uvcvideo(struct doctor *d)
{
    const long quirks = read_parameter("quirks"), drop = read_parameter("nodrop");
    const bool raw = sst_usb_format_bytes_s(d->cfg->fourcc, 1, 1, 1) > 0;

    if (quirks > 0 && quirks != 0xffffffffL && (quirks & QUIRK_FIX_BANDWIDTH) && !raw)
        doctor_add(d, DOCTOR_WARNING, "uvcvideo",
                   "quirk FIX_BANDWIDTH (0x80) is set, but has no effect on compressed "
                   "formats such as %s",
                   sst_array_format_name(d->cfg->fourcc) ? sst_array_format_name(d->cfg->fourcc) : "this one");
    else if (quirks > 0 && quirks != 0xffffffffL)
        doctor_add(d, DOCTOR_OK, "uvcvideo", "quirks 0x%lx are set for all cameras", (unsigned long)quirks);
    if (drop > 0)
        doctor_add(d, DOCTOR_OK, "uvcvideo",
                   "parameter nodrop is set: damaged frames are delivered and counted as damaged");
}

/* --- devices for `--device` --------------------------------------------------------------------------------------- */

/* Steps that a device computes otherwise than the CPU; "": none. */
static const char *refused_steps(struct sst_runner *runner)
{
    struct sst_runner_user *match = NULL;
    struct sst_runner_user *networks = NULL;
    char text[SST_LOG_MAX], *before = sst_log_hold_errors(text);
    const char *refused = sst_disparity_device_create(&match, runner)                  ? "steps of matching"
                          : WITH_DNNL && sst_network_device_open_on(&networks, runner) ? "networks"
                                                                                       : "";

    sst_network_device_close(networks);
    sst_disparity_device_destroy(match);
    (void)sst_log_hold_errors(before);
    return refused;
}

/* Compile the shaders on a device and compare their results with the references, then steps with the CPU. */
static void test_gpu(struct doctor *d, const struct sst_gpu_info *info)
{
    char runs[1024] = "", refuses[1024] = "";
    struct sst_runner *runner;
    struct sst_gpu *g;

    if (sst_runner_create_to_test(&runner, info->name)) {
        doctor_add(d, DOCTOR_WARNING, AREA_GPU, "%s cannot be opened: update its driver (%s)", info->name,
                   info->driver);
        return;
    }
    g = sst_runner_device(runner);
    for (int i = 0; i < SST_GPU_SHADERS; i++) {
        char *list;

        if (!sst_gpu_can(sst_gpu_get_info(g), (enum sst_gpu_shader)i))
            continue;
        list = sst_gpu_prepare(g, (enum sst_gpu_shader)i) ? refuses : runs;
        snprintf(list + strlen(list), sizeof(runs) - strlen(list), "%s%s", *list ? ", " : "",
                 sst_gpu_shader_name((enum sst_gpu_shader)i));
    }
    if (!*refuses)
        snprintf(refuses, sizeof(refuses), "%s", refused_steps(runner));
    for (int i = 0; i < SST_RENDER_STEPS; i++) {
        if (sst_step_check(NULL, g, &sst_render_steps[i]))
            sst_text_add(refuses, sizeof(refuses), "%s%s", *refuses ? ", " : "", sst_render_steps[i].step->name);
    }
    if (*refuses)
        doctor_add(d, DOCTOR_WARNING, AREA_GPU,
                   "%s (%s) gives wrong results for %s and is not used for them: update the driver", info->name,
                   info->driver, refuses);
    else
        doctor_add(d, DOCTOR_OK, AREA_GPU, "%s (%s) passes its tests, run again: %s%s", info->name, info->driver, runs,
                   info->kind == SST_GPU_SOFTWARE ? "; it is no GPU, and used only by name" : "");
    sst_runner_destroy(runner);
}

void doctor_check_gpu(struct doctor *d)
{
    struct sst_gpu_info info[SST_GPU_DEVICES];
    const int n = sst_gpu_list(info);

    for (int i = 0; i < n; i++)
        test_gpu(d, &info[i]);
    if (!n)
        doctor_add(d, DOCTOR_OK, AREA_GPU,
                   WITH_VULKAN ? "no Vulkan driver answers: everything runs on the CPU"
                               : "built without Vulkan: everything runs on the CPU");
}
