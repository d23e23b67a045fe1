/* Recovery of cameras: opening, restart, reset and closing are decided here and carried out by jobs on their threads.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/text.h"
#include "drivers/grab/grab_internal.h"
#include "drivers/grab/parts_internal.h"
#include "drivers/usb/usb.h"

/* A job that takes longer hangs in the kernel and is abandoned. */
#define JOB_NS (15000 * SST_MS)
/* After a reset the node returns with an event; without one it is opened after this time. */
#define RESET_NS     (300 * SST_MS)
#define POWER_OFF_MS 2000

enum task {
    TASK_RESTREAM = SST_GRAB_RESTREAM,
    TASK_REOPEN = SST_GRAB_REOPEN, /* also the first opening */
    TASK_RESET = SST_GRAB_RESET,
    TASK_REAUTHORISE = SST_GRAB_REAUTHORISE,
    TASK_POWER = SST_GRAB_POWER,
    TASK_START,
    TASK_CLOSE,
};

static const char *const task_names[] = {
    "restart of its stream", "reopening", "USB reset", "USB authorisation", "port power", "start", "close"
};

struct camera_job {
    struct grab_job job;
    struct sst_grab_config cfg;
    struct sst_grab_device device;
    struct grab_stream *stream; /* in and out */
    int cam, err;
    enum task task;
    bool start;
    char why[SST_WHY_MAX], note[SST_WHY_MAX];
};

/* --- job threads -------------------------------------------------------------------------------------------------- */

static int reopen(struct camera_job *j)
{
    int err;

    stream_close(j->stream);
    j->stream = NULL;
    err = stream_open(&j->stream, &j->device, &j->cfg, j->cam, j->why, j->note);
    if (!err && j->start)
        err = stream_start(j->stream, j->why);
    return err;
}

static int reset(struct camera_job *j)
{
    int err;

    stream_close(j->stream);
    j->stream = NULL;
    err = j->task == TASK_RESET         ? sst_usb_reset(j->device.port)
          : j->task == TASK_REAUTHORISE ? sst_usb_reauthorise(j->device.port)
                                        : sst_usb_power_cycle(j->device.port, POWER_OFF_MS);
    if (err)
        snprintf(j->why, sizeof(j->why), "%s: %s", task_names[j->task], strerror(-err));
    return err;
}

static void job_run(struct grab_job *job)
{
    struct camera_job *j = (struct camera_job *)job;

    switch (j->task) {
    case TASK_RESTREAM:
        stream_stop(j->stream);
        j->err = stream_start(j->stream, j->why);
        break;
    case TASK_START:
        j->err = stream_start(j->stream, j->why);
        break;
    case TASK_REOPEN:
        j->err = reopen(j);
        break;
    case TASK_RESET:
    case TASK_REAUTHORISE:
    case TASK_POWER:
        j->err = reset(j);
        break;
    case TASK_CLOSE:
        stream_close(j->stream);
        j->stream = NULL;
        break;
    }
}

static void job_discard(struct grab_job *job)
{
    struct camera_job *j = (struct camera_job *)job;

    stream_close(j->stream);
    free(j);
}

static void job_ended(struct grab_job *job, void *owner);

static const struct grab_job job_calls = { .run = job_run, .ended = job_ended, .discard = job_discard };

/* --- polling thread ----------------------------------------------------------------------------------------------- */

void recovery_arm(struct sst_grab *g, struct grab_camera *cam)
{
    struct epoll_event e = { .events = EPOLLIN, .data = { .u64 = (uint64_t)(cam - g->camera) } };

    cam->rearm_ns = 0;
    if (cam->armed || !cam->stream || !cam->running)
        return;
    cam->armed = !epoll_ctl(g->epoll_fd, EPOLL_CTL_ADD, stream_fd(cam->stream), &e);
    if (!cam->armed)
        sst_log_error("cannot poll %s: %s", cam->name, strerror(errno));
}

void recovery_disarm(struct sst_grab *g, struct grab_camera *cam)
{
    if (cam->armed)
        (void)epoll_ctl(g->epoll_fd, EPOLL_CTL_DEL, stream_fd(cam->stream), NULL);
    cam->armed = false;
    cam->rearm_ns = 0;
}

void camera_set_state(struct sst_grab *g, struct grab_camera *cam, enum sst_grab_state state, const char *why)
{
    const bool changed = cam->state != state;

    if (!changed && !strcmp(cam->why, why))
        return;
    if (changed && state != SST_GRAB_STREAMING && (cam->state == SST_GRAB_STREAMING || !cam->down_ns))
        cam->down_ns = sst_clock_now_ns();
    if (state == SST_GRAB_REFUSED)
        sst_log_error("%s: %s", cam->name, why);
    else if (state == SST_GRAB_ABSENT || (changed && state == SST_GRAB_RECOVERING) ||
             (state == SST_GRAB_STREAMING && cam->state == SST_GRAB_RECOVERING))
        sst_log_warning("%s: %s", cam->name, why);
    else
        sst_log_info("%s: %s", cam->name, why);
    cam->state = state;
    snprintf(cam->why, sizeof(cam->why), "%s", why);
    parts_report_state(g, cam, state, state == SST_GRAB_STREAMING ? cam->remark : why);
}

void camera_remark(struct sst_grab *g, struct grab_camera *cam, const char *text)
{
    if (!strcmp(cam->remark, text))
        return;
    snprintf(cam->remark, sizeof(cam->remark), "%s", text);
    if (*text)
        sst_log_warning("%s: %s", cam->name, text);
    if (cam->state == SST_GRAB_STREAMING)
        parts_report_state(g, cam, cam->state, cam->remark);
}

static void climbed(struct sst_grab *g, struct grab_camera *cam, int rung);

static void step(struct sst_grab *g, struct grab_camera *cam, enum ladder_event event)
{
    climbed(g, cam, ladder_step(&cam->ladder, event, sst_clock_now_ns(), cam->stream && cam->running));
}

/* A close is never waited for: it hangs if the camera does. */
static void close_stream(struct sst_grab *g, struct grab_stream *stream)
{
    struct camera_job *j = calloc(1, sizeof(*j));

    stream_detach(stream);
    if (j)
        *j = (struct camera_job){ .job = job_calls, .stream = stream, .task = TASK_CLOSE };
    /* Without memory or a thread, close here and wait. */
    if (!j || jobs_start(g->jobs, &j->job)) {
        stream_close(stream);
        free(j);
    }
}

void recovery_drop(struct sst_grab *g, struct grab_camera *cam)
{
    recovery_disarm(g, cam);
    if (cam->stream)
        close_stream(g, cam->stream);
    cam->stream = NULL;
    cam->running = false;
}

/* Start a job, which then owns the camera's stream. @return 0 or -errno (the camera keeps the stream) */
static int start_job(struct sst_grab *g, struct grab_camera *cam, enum task task)
{
    struct camera_job *j = calloc(1, sizeof(*j));
    int err = -ENOMEM;

    if (j) {
        *j = (struct camera_job){ .job = job_calls,
                                  .cfg = g->cfg,
                                  .device = cam->device,
                                  .stream = cam->stream,
                                  .cam = (int)(cam - g->camera),
                                  .task = task,
                                  .start = g->started };
        if (cam->stream)
            stream_detach(cam->stream);
        recovery_disarm(g, cam);
        err = jobs_start(g->jobs, &j->job);
    }
    if (err) {
        sst_log_error("%s: no thread for the %s: %s", cam->name, task_names[task], strerror(-err));
        free(j);
        return err;
    }
    cam->stream = NULL;
    cam->running = false;
    cam->job = j;
    cam->job_end_ns = sst_clock_now_ns() + JOB_NS;
    return 0;
}

/* Carry out a rung of the ladder. */
static void climbed(struct sst_grab *g, struct grab_camera *cam, int rung)
{
    char why[SST_WHY_MAX + 64];

    if (rung < 0)
        return;
    cam->counters.rung[rung]++;
    if (rung == SST_GRAB_BACK_OFF) {
        recovery_drop(g, cam);
        if (cam->state == SST_GRAB_RECOVERING && !cam->logged_hopeless)
            sst_log_error(
                "%s: no recovery step succeeded; check its cable, hub and power: recovery is retried periodically",
                cam->name);
        cam->logged_hopeless |= cam->state == SST_GRAB_RECOVERING;
        return;
    }
    if (cam->state != SST_GRAB_REFUSED) {
        snprintf(why, sizeof(why), "%s; next: %s", cam->state == SST_GRAB_RECOVERING ? "still no frame" : cam->why,
                 task_names[rung]);
        camera_set_state(g, cam, SST_GRAB_RECOVERING, why);
    }
    if (start_job(g, cam, (enum task)rung))
        step(g, cam, SST_LADDER_FAILED);
}

void recovery_fault(struct sst_grab *g, struct grab_camera *cam, const char *why)
{
    if (cam->ladder.phase != SST_LADDER_QUIET && cam->ladder.phase != SST_LADDER_WAITING)
        return;
    camera_set_state(g, cam, SST_GRAB_RECOVERING, why);
    step(g, cam, SST_LADDER_FAULT);
}

void recovery_refuse(struct sst_grab *g, struct grab_camera *cam, const char *why)
{
    cam->unfit = true;
    camera_set_state(g, cam, SST_GRAB_REFUSED, why);
    step(g, cam, SST_LADDER_REFUSED);
}

void recovery_lost(struct sst_grab *g, struct grab_camera *cam)
{
    const bool expected = ladder_expects_loss(&cam->ladder);

    recovery_drop(g, cam);
    cam->number = -1;
    cam->open_ns = 0;
    (void)ladder_step(&cam->ladder, SST_LADDER_LOST, sst_clock_now_ns(), false);
    if (expected)
        return;
    cam->job = NULL; /* its stream is closed when it ends */
    cam->job_end_ns = 0;
    cam->counters.lost_devices++;
    camera_set_state(g, cam, SST_GRAB_ABSENT, "unplugged; it resumes when it is plugged in again");
}

static void open_now(struct sst_grab *g, struct grab_camera *cam)
{
    cam->open_ns = 0;
    if (start_job(g, cam, TASK_REOPEN))
        cam->open_ns = sst_clock_now_ns() + RESET_NS;
}

void recovery_found(struct sst_grab *g, struct grab_camera *cam, const struct grab_node *node)
{
    if (*cam->serial_seen && strcmp(cam->serial_seen, node->device.serial) != 0)
        sst_log_warning("%s: a different device is connected there now, serial %s instead of %s; if cameras were "
                        "swapped, plug them back or change the binding",
                        cam->name, *node->device.serial ? node->device.serial : "none", cam->serial_seen);
    snprintf(cam->serial_seen, sizeof(cam->serial_seen), "%s", node->device.serial);
    cam->device = node->device;
    cam->number = node->number;
    cam->ladder.usb = grab_is_usb_port(node->device.port);
    if (cam->state == SST_GRAB_ABSENT)
        cam->counters.found_devices++;
    /* A reset may still be running: then its job continues. */
    if (!cam->job)
        open_now(g, cam);
}

void recovery_start(struct sst_grab *g, struct grab_camera *cam)
{
    if (cam->stream && !cam->running && !cam->job && start_job(g, cam, TASK_START))
        step(g, cam, SST_LADDER_FAILED);
}

/* --- results of jobs ---------------------------------------------------------------------------------------------- */

static void opened(struct sst_grab *g, struct grab_camera *cam, struct camera_job *j)
{
    cam->running = j->start || j->task == TASK_START;
    snprintf(cam->device.name, sizeof(cam->device.name), "%s", j->device.name);
    snprintf(cam->device.driver, sizeof(cam->device.driver), "%s", j->device.driver);
    if (strcmp(cam->note, j->note) != 0 && j->task == TASK_REOPEN) {
        snprintf(cam->note, sizeof(cam->note), "%s", j->note);
        if (*j->note)
            sst_log_warning("%s: %s", cam->name, j->note);
    }
    if (!cam->running) {
        ladder_init(&cam->ladder, cam->ladder.patience_ns, cam->ladder.usb, cam->ladder.port_power);
        camera_set_state(g, cam, SST_GRAB_READY, "ready");
        if (g->started) /* started while it was being opened */
            recovery_start(g, cam);
        return;
    }
    receive_begin(g, cam);
    recovery_arm(g, cam);
    if (cam->ladder.phase == SST_LADDER_WORKING)
        step(g, cam, SST_LADDER_DONE);
    else
        step(g, cam, SST_LADDER_OPENED);
    if (!cam->unfit && (cam->ladder.rung < 0 || cam->state == SST_GRAB_REFUSED))
        camera_set_state(g, cam, SST_GRAB_STREAMING, "streaming");
}

static bool is_refusal(int err)
{
    return err == -EINVAL || err == -EBUSY || err == -EACCES || err == -EPERM || err == -ENOSPC || err == -ENOMEM;
}

/* A device may have several nodes, such as a colour and an infrared picture: try the next one after a refusal. */
static bool open_sibling(struct sst_grab *g, struct grab_camera *cam, struct camera_job *j)
{
    bool more;
    const struct grab_node *node = hotplug_sibling(g, cam, &more);

    if (node) {
        sst_log_info("%s: %s does not fit: %s; trying %s of the same device", cam->name, cam->device.node, j->why,
                     node->device.node);
        cam->device = node->device;
        cam->number = node->number;
        open_now(g, cam);
    } else if (more) {
        sst_text_add(j->why, sizeof(j->why), " [%s; the other video nodes of its device do not fit either]",
                     cam->device.node);
    }
    return node != NULL;
}

static void failed(struct sst_grab *g, struct grab_camera *cam, struct camera_job *j)
{
    const bool opening = j->task == TASK_REOPEN || j->task == TASK_START || j->task == TASK_RESTREAM;

    if (opening && j->err == -EINVAL && !j->stream && open_sibling(g, cam, j))
        return;
    if (opening && j->err == -ENOTTY) {
        hotplug_reject(g, cam->number, false);
        cam->number = -1;
        (void)hotplug_assign(g);
    } else if (opening && j->err == -ENODEV) {
        hotplug_reject(g, cam->number, true);
        recovery_lost(g, cam);
    } else if (opening && is_refusal(j->err)) {
        camera_set_state(g, cam, SST_GRAB_REFUSED, j->why);
        step(g, cam, SST_LADDER_REFUSED);
    } else {
        camera_set_state(g, cam, SST_GRAB_RECOVERING, j->why);
        step(g, cam, SST_LADDER_FAILED);
    }
}

static void ended(struct sst_grab *g, struct grab_camera *cam, struct camera_job *j)
{
    cam->job = NULL;
    cam->job_end_ns = 0;
    cam->stream = j->stream;
    j->stream = NULL;
    if (j->err) {
        failed(g, cam, j);
    } else if (cam->stream) {
        opened(g, cam, j);
    } else {
        step(g, cam, SST_LADDER_DONE);
        /* Open it if it is already back; otherwise the hotplug event does. */
        cam->open_ns = sst_clock_now_ns() + RESET_NS;
    }
}

static void job_ended(struct grab_job *job, void *owner)
{
    struct camera_job *j = (struct camera_job *)job;
    struct sst_grab *g = owner;
    struct grab_camera *cam = &g->camera[j->cam];

    if (cam->job == j)
        ended(g, cam, j);
    if (j->stream) /* abandoned meanwhile */
        close_stream(g, j->stream);
    free(j);
}

/* --- time --------------------------------------------------------------------------------------------------------- */

/* With triggered frames, a recovered camera has a frame due from the next trigger on. */
static int64_t ladder_due(const struct sst_grab *g, const struct grab_camera *cam)
{
    const int64_t due = cam->ladder.due_ns;

    if (!due || cam->ladder.phase != SST_LADDER_WAITING || !g->cfg.triggered || !cam->running)
        return due;
    if (!cam->owed_ns)
        return 0;
    return cam->owed_ns + g->cfg.stall_ms * SST_MS > due ? cam->owed_ns + g->cfg.stall_ms * SST_MS : due;
}

static int64_t sooner(int64_t a, int64_t b)
{
    return !a ? b : !b ? a : a < b ? a : b;
}

int64_t recovery_due(const struct sst_grab *g, const struct grab_camera *cam)
{
    return sooner(sooner(cam->job_end_ns, cam->open_ns), sooner(cam->rearm_ns, ladder_due(g, cam)));
}

void recovery_time(struct sst_grab *g, struct grab_camera *cam, int64_t now_ns)
{
    const int64_t due = ladder_due(g, cam);

    if (cam->rearm_ns && now_ns >= cam->rearm_ns)
        recovery_arm(g, cam);
    if (cam->job_end_ns && now_ns >= cam->job_end_ns) {
        sst_log_warning("%s: the %s hangs in the kernel; continuing without it", cam->name, task_names[cam->job->task]);
        cam->job = NULL;
        cam->job_end_ns = 0;
        step(g, cam, SST_LADDER_FAILED);
    }
    if (cam->open_ns && now_ns >= cam->open_ns) {
        cam->open_ns = 0;
        if (cam->number >= 0 && !cam->job && !cam->stream)
            open_now(g, cam);
    }
    if (!due || now_ns < due)
        return;
    if (cam->running && cam->stream && cam->ladder.phase == SST_LADDER_WAITING && !stream_queued(cam->stream))
        cam->ladder.due_ns =
            now_ns + g->cfg.stall_ms * SST_MS; /* the receiver holds all buffers: no frame is possible */
    else
        step(g, cam, SST_LADDER_TIME);
}
