/* Receives frames: dequeues, checks, compares with the last one, counts and passes them on. */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "drivers/grab/grab_internal.h"

/* A camera with only damaged frames is treated as silent after this number and three times the usual patience. */
#define BAD_ROW 10

/* DQBUF may fail temporarily (EIO: "signal loss"); after this number in a row the stream is broken. */
#define EIO_ROW  8
#define EIO_WELL 100 /* frames without a failure until the next one is logged again */

/* A driver that polls as broken while it has no buffer is polled again after this time. */
#define REARM_NS (20 * SST_MS)

void receive_begin(struct sst_grab *g SST_UNUSED, struct grab_camera *cam)
{
    cam->heard_ns = cam->good_ns = sst_clock_now_ns();
    cam->history = (struct history){ 0 };
    cam->owed_ns = 0;
    cam->bad_row = cam->eio_row = 0;
    cam->wakes = false;
    cam->logged_starved = false;
}

/* Frames lost between two sequence numbers, modulo 2^32. Constant or decreasing numbers: the driver does not count. */
static uint32_t lost_between(uint32_t before, uint32_t now)
{
    const uint32_t step = now - before;

    return step == 0 || step > UINT32_MAX / 2 ? 0 : step - 1;
}

static void compare(struct sst_grab *g, struct grab_camera *cam, struct sst_frame *f)
{
    struct history *h = &cam->history;
    const uint64_t hash = g->cfg.check_frozen ? frame_hash(f->data, f->bytes) : 0;

    if (h->any) {
        f->lost_before = lost_between(h->sequence, f->sequence);
        if (f->t_ns <= h->t_ns)
            f->faults |= SST_FRAME_BACKWARDS;
        if (g->cfg.check_frozen && f->bytes && hash == h->hash)
            f->faults |= SST_FRAME_FROZEN;
    }
    *h = (struct history){ true, f->sequence, f->t_ns, hash };
}

static void count(struct grab_camera *cam, const struct sst_frame *f)
{
    struct sst_grab_counters *c = &cam->counters;

    c->frames++;
    c->bad += (f->faults & SST_FRAME_BAD) != 0;
    c->lost += f->lost_before;
    for (size_t i = 0; i < ARRAY_LEN(c->fault); i++)
        c->fault[i] += f->faults >> i & 1;
}

/* Log the meaning of the time stamps once per camera: sets are synchronised by them. */
static void log_stamp(struct grab_camera *cam, const struct stream_stamp *stamp)
{
    if (cam->logged_stamp)
        return;
    cam->logged_stamp = true;
    if (!stamp->monotonic)
        sst_log_warning("%s: driver %s does not use the monotonic clock for time stamps; the time of arrival is used "
                        "instead, which is later and irregular",
                        cam->name, cam->device.driver);
    else if (stamp->end_of_frame)
        sst_log_info("%s: time stamps of driver %s mark the end of a frame and not the start of its exposure",
                     cam->name, cam->device.driver);
}

static void alive(struct sst_grab *g, struct grab_camera *cam, const struct sst_frame *f)
{
    const bool good = !(f->faults & SST_FRAME_BAD);
    char why[96];

    cam->heard_ns = f->arrival_ns;
    cam->owed_ns = 0;
    cam->logged_starved = false;
    cam->bad_row = good ? 0 : cam->bad_row + 1;
    if (good)
        cam->good_ns = f->arrival_ns;
    (void)ladder_step(&cam->ladder, SST_LADDER_FRAME, f->arrival_ns, true);
    if (cam->state == SST_GRAB_STREAMING)
        return;
    snprintf(why, sizeof(why), "streaming again after %.1f s", (double)(f->arrival_ns - cam->down_ns) * 1e-9);
    camera_set_state(g, cam, SST_GRAB_STREAMING, why);
}

static void process(struct sst_grab *g, struct grab_camera *cam, struct sst_frame *f, const struct stream_stamp *stamp)
{
    f->faults |= sst_frame_check(f->fourcc, f->width, f->height, f->stride, f->data, f->bytes);
    compare(g, cam, f);
    count(cam, f);
    log_stamp(cam, stamp);
    alive(g, cam, f);
    g->events.frame(g->events.arg, f);
    if (cam->bad_row >= BAD_ROW && cam->heard_ns - cam->good_ns > 3 * g->cfg.stall_ms * SST_MS)
        recovery_fault(g, cam, "it delivers only damaged frames");
}

/* v4l2loopback registers a waiter only while it has no frame for it, so epoll may miss its events. If nothing is
   readable after adding it again, it is registered and wakes epoll from now on. */
static void listen_again(struct sst_grab *g, struct grab_camera *cam)
{
    struct pollfd p = { .fd = stream_fd(cam->stream), .events = POLLIN };

    recovery_disarm(g, cam);
    recovery_arm(g, cam);
    cam->wakes = !poll(&p, 1, 0);
}

static void log_eio(struct grab_camera *cam)
{
    if (!cam->eio_well)
        sst_log_warning(
            "%s: the driver fails to deliver some frames (EIO) but keeps streaming: check its cable and USB power",
            cam->name);
    cam->eio_well = EIO_WELL;
    cam->counters.io_errors++;
}

void receive_ready(struct sst_grab *g, struct grab_camera *cam, bool broken)
{
    struct stream_stamp stamp;
    struct sst_frame *frame;
    const int err = stream_dequeue(cam->stream, &frame, &stamp);
    char why[96];

    if (err == -EIO) {
        log_eio(cam);
        if (++cam->eio_row < EIO_ROW)
            return;
    }
    if (!err) {
        cam->eio_row = 0;
        cam->eio_well -= cam->eio_well > 0;
        process(g, cam, frame, &stamp);
        if (!cam->wakes && cam->armed)
            listen_again(g, cam);
    } else if (err == -ENODEV) {
        hotplug_reject(g, cam->number, true);
        recovery_lost(g, cam);
    } else if (err != -EAGAIN) {
        snprintf(why, sizeof(why), "its stream failed: %s", strerror(-err));
        recovery_fault(g, cam, why);
    } else if (broken) {
        recovery_disarm(g, cam);
        cam->rearm_ns = sst_clock_now_ns() + REARM_NS;
    }
}

/* --- silence ------------------------------------------------------------------------------------------------------ */

static int64_t patience_ns(const struct sst_grab *g)
{
    const int64_t stall = g->cfg.stall_ms * SST_MS;
    const int64_t three = g->cfg.rate_hz > 0 && !g->cfg.triggered ? (int64_t)(3e9 / g->cfg.rate_hz) : 0;

    return stall > three ? stall : three;
}

int64_t receive_due(const struct sst_grab *g, const struct grab_camera *cam)
{
    if (!cam->running || !cam->stream || cam->ladder.phase != SST_LADDER_QUIET)
        return 0;
    if (g->cfg.triggered)
        return cam->owed_ns ? cam->owed_ns + patience_ns(g) : 0;
    return cam->heard_ns + patience_ns(g);
}

void receive_silence(struct sst_grab *g, struct grab_camera *cam, int64_t now_ns)
{
    const int64_t ready_ns = stream_ready_ns(cam->stream);
    const bool refused = !ready_ns && !stream_lent(cam->stream);
    char why[96];

    if (ready_ns && now_ns - ready_ns < patience_ns(g)) { /* before, it had no free buffer */
        cam->heard_ns = ready_ns;
        if (cam->owed_ns)
            cam->owed_ns = ready_ns;
        return;
    }
    if (refused || ready_ns) {
        snprintf(why, sizeof(why), "no frame for %.1f s%s", (double)(now_ns - cam->heard_ns) * 1e-9,
                 refused ? ", and its driver accepts no buffer" : "");
        recovery_fault(g, cam, why);
        return;
    }
    /* No free buffer: the receiver holds all of them. The gap in the sequence will show the lost frames. */
    if (!cam->logged_starved)
        sst_log_warning("%s: all its %d buffers are held by the receiver, so frames are lost; release them sooner, or "
                        "raise `buffers`",
                        cam->name, g->cfg.buffers);
    cam->logged_starved = true;
    cam->heard_ns = now_ns;
    if (cam->owed_ns)
        cam->owed_ns = now_ns;
}
