/* Frames as received: dequeued, checked, compared with the last one, counted and passed on. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "drivers/grab/grab_internal.h"
#include "drivers/grab/parts_internal.h"

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
    for (int i = 0; i < SST_GRAB_PARTS_MAX; i++)
        cam->part[i].any = false;
    stamp_begin(&cam->clock, stream_start_ns(cam->stream));
    cam->owed_ns = 0;
    cam->bad_row = cam->misfit_row = cam->eio_row = 0;
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
    const bool check = g->cfg.check_frozen && g->parts == 1; /* parts are compared on their own */
    const uint64_t hash = check ? sst_grab_hash(f->data, f->bytes) : 0;

    if (h->any) {
        f->lost_before = lost_between(h->sequence, f->sequence);
        if (check && f->bytes && hash == h->hash)
            f->faults |= SST_FRAME_FROZEN;
    }
    *h = (struct history){ true, f->sequence, hash };
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

/*
 * The driver's stamp is believed within bounds of the arrival: a single wrong one costs its frame, and stamps that are
 * wrong for seconds are of another clock: its frames are stamped by their arrival.
 */
static void judge_stamp(struct sst_grab *g, struct grab_camera *cam, struct sst_frame *f)
{
    const bool foreign = cam->clock.foreign;
    const enum stamp_fault fault = stamp_judge(&cam->clock, f->t_ns, f->arrival_ns);
    char text[SST_WHY_MAX], what[96];

    if (cam->clock.foreign && !foreign) {
        stamp_describe(what, sizeof(what), fault, f, sst_clock_wall_ns());
        snprintf(text, sizeof(text),
                 "%s: driver %s uses another clock than it reports; the time of arrival is used instead", what,
                 cam->device.driver);
        camera_remark(g, cam, text);
    } else if (!cam->clock.foreign && foreign) {
        sst_log_warning("%s: its time stamps are right again, and are used", cam->name);
        camera_remark(g, cam, "");
    }
    if (cam->clock.foreign) {
        f->t_ns = f->arrival_ns;
        f->faults |= SST_FRAME_ARRIVAL;
    } else if (fault != STAMP_RIGHT) {
        f->faults |= SST_FRAME_BACKWARDS;
    }
}

/* Bytes before the start of a JPEG that is sound from there on are left out. */
static void check_bytes(struct grab_camera *cam, struct sst_frame *f, int size[2])
{
    const size_t lead = frame_lead(f->fourcc, f->data, f->bytes);
    unsigned faults = frame_check(f, lead, size);

    if (lead && faults)
        faults = SST_FRAME_NO_SOI;
    if (lead && !faults) {
        f->data += lead;
        f->bytes -= lead;
        if (!cam->logged_lead)
            sst_log_warning("%s: its JPEGs begin after %zu bytes of something else, which are left out", cam->name,
                            lead);
        cam->logged_lead = true;
    }
    f->faults |= faults;
}

/* A frame that does not have the negotiated form: count the ones in a row with the same fault. */
static void count_misfit(struct sst_grab *g, struct grab_camera *cam, struct sst_frame *f, const int size[2],
                         uint32_t field)
{
    char what[SST_WHY_MAX];

    if (!field_fits(field)) {
        f->faults |= SST_FRAME_MARKER | SST_FRAME_UNFIT;
        snprintf(
            what, sizeof(what),
            "its driver delivers fields (%s) and not the whole (progressive) pictures that were agreed; set cameras: "
            "width and height, or another input or mode of the device",
            field_name(field));
    } else if (*cam->uncut) {
        snprintf(what, sizeof(what), "%s", cam->uncut);
    } else {
        snprintf(what, sizeof(what),
                 "its JPEGs are %dx%d, not the %dx%d that was agreed; set cameras: width and height to a size that it "
                 "delivers",
                 size[0], size[1], g->cfg.width, g->cfg.height);
    }
    cam->misfit_row = strcmp(cam->misfit, what) != 0 ? 1 : cam->misfit_row + 1;
    snprintf(cam->misfit, sizeof(cam->misfit), "%s", what);
}

static void alive(struct sst_grab *g, struct grab_camera *cam, const struct sst_frame *f)
{
    const bool good = !(f->faults & SST_FRAME_BAD & ~(unsigned)SST_FRAME_BACKWARDS); /* no rung mends stamps */
    char why[96];

    cam->heard_ns = f->arrival_ns;
    cam->owed_ns = 0;
    cam->logged_starved = false;
    cam->bad_row = good ? 0 : cam->bad_row + 1;
    if (good)
        cam->good_ns = f->arrival_ns;
    (void)ladder_step(&cam->ladder, SST_LADDER_FRAME, f->arrival_ns, true);
    if (cam->state == SST_GRAB_STREAMING || (cam->unfit && !good))
        return;
    cam->unfit = false;
    snprintf(why, sizeof(why), "streaming again after %.1f s", (double)(f->arrival_ns - cam->down_ns) * 1e-9);
    camera_set_state(g, cam, SST_GRAB_STREAMING, why);
}

static void process(struct sst_grab *g, struct grab_camera *cam, struct sst_frame *f, const struct stream_stamp *stamp)
{
    int size[2] = { 0, 0 };

    check_bytes(cam, f, size);
    if (stamp->monotonic)
        judge_stamp(g, cam, f);
    if (g->parts > 1)
        parts_make(g, cam, f);
    if (!field_fits(stamp->field) || f->faults & SST_FRAME_UNFIT)
        count_misfit(g, cam, f, size, stamp->field);
    else
        cam->misfit_row = 0;
    compare(g, cam, f);
    count(cam, f);
    log_stamp(cam, stamp);
    alive(g, cam, f);
    if (g->parts > 1)
        parts_deliver(g, cam, f);
    else
        g->events.frame(g->events.arg, f);
    if (cam->misfit_row >= BAD_ROW) {
        char why[SST_WHY_MAX];

        memcpy(why, cam->misfit, sizeof(why));
        recovery_refuse(g, cam, why);
        return;
    }
    if (cam->bad_row >= BAD_ROW && cam->heard_ns - cam->good_ns > 3 * g->cfg.stall_ms * SST_MS)
        recovery_fault(g, cam, "it delivers only damaged frames");
}

/* v4l2loopback registers a waiter only while it has no frame for it, so epoll may miss its events. If nothing is
   readable after adding it again, it is registered and wakes epoll from now on. */
static void listen_again(struct sst_grab *g, struct grab_camera *cam)
{
    struct pollfd p = { .fd = stream_fd(cam->stream), .events = POLLIN };
    int64_t now_ns;

    if (!cam->wakes) {
        recovery_disarm(g, cam);
        recovery_arm(g, cam);
    }
    now_ns = sst_clock_now_ns();
    if (poll(&p, 1, 0))
        return;
    cam->clock.empty_ns = now_ns;
    cam->wakes = true;
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
        if (cam->armed)
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
    /* No free buffer: the receiver holds all. The gap in the sequence will show the lost frames. */
    if (!cam->logged_starved)
        sst_log_warning("%s: all its %d buffers are held by the receiver, so frames are lost; release them sooner, or "
                        "raise `buffers`",
                        cam->name, g->cfg.buffers);
    cam->logged_starved = true;
    cam->heard_ns = now_ns;
    if (cam->owed_ns)
        cam->owed_ns = now_ns;
}
