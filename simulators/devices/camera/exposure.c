/* Timing of exposures, and delivery of frames. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "simulators/devices/camera/camera_internal.h"

#define MS     1000000LL
#define SECOND 1000000000LL
/* A global-shutter sensor reads out before it can expose again. */
#define READOUT_NS   (8 * MS)
#define DUPLICATE_NS (MS / 2)
#define BACKWARDS_NS SECOND
#define SHORT_BYTES  32

static void deliver(void *arg);
static void free_run(void *arg);

void sim_cam_exposure_init(struct sim_cam *cam)
{
    cam->random = sst_sim_world_settings(cam->world)->seed * 0x9e3779b97f4a7c15u + (uint64_t)cam->index + 1;
    cam->free_run_timer = (struct sim_timer){ .fire = free_run, .arg = cam };
    for (int i = 0; i < SST_SIM_CAM_SHOTS; i++) {
        cam->shot[i].cam = cam;
        cam->shot[i].timer = (struct sim_timer){ .fire = deliver, .arg = &cam->shot[i] };
    }
}

/* --- exposures ---------------------------------------------------------------------------------------------------- */

static const struct sst_sim_timing *timing_of(const struct sim_cam *cam)
{
    return sst_sim_world_timing(cam->world, sim_cam_body(cam));
}

static int exposure_us(const struct sim_cam *cam)
{
    const bool manual = cam->control[SST_SIM_CONTROL_AUTO_EXPOSURE] == V4L2_EXPOSURE_MANUAL;

    return manual ? 100 * cam->control[SST_SIM_CONTROL_EXPOSURE] : sst_sim_world_settings(cam->world)->exposure_us;
}

static struct sim_shot *free_shot(struct sim_cam *cam)
{
    for (int i = 0; i < SST_SIM_CAM_SHOTS; i++)
        if (!cam->shot[i].timer.slot)
            return &cam->shot[i];
    return NULL;
}

/* Expose at `start`. The sequence counts every frame of the sensor. */
static void expose(struct sim_cam *cam, uint64_t trigger, int64_t start_ns)
{
    struct sim_shot lost = { .cam = cam }, *shot = free_shot(cam);
    const double late_ms = sim_cam_fault(cam, SST_SIM_FAULT_LATE_MS);
    const double late_p = sim_cam_fault(cam, SST_SIM_FAULT_LATE_P);
    const struct sim_bus *bus = &cam->array->bus;
    struct sim_shot *s = shot ? shot : &lost;
    int64_t due;

    s->exposure = (struct sst_sim_exposure){ .cam = sim_cam_body(cam),
                                             .trigger = trigger,
                                             .t_ns = start_ns,
                                             .exposure_us = exposure_us(cam),
                                             .gain = cam->control[SST_SIM_CONTROL_GAIN] / 100.0 };
    if (bus->pose)
        bus->pose(bus->arg, start_ns, s->exposure.pose_um);
    s->sequence = cam->sequence++;
    cam->counters.exposures++;
    cam->busy_until_ns = start_ns + s->exposure.exposure_us * 1000LL + READOUT_NS;
    due = start_ns + s->exposure.exposure_us * 1000LL + timing_of(cam)->latency_ns;
    if (late_ms > 0 && (late_p == 0 || sim_cam_chance(cam, late_p)))
        due += (int64_t)(late_ms * MS);
    if (!shot || sim_timer_set(cam->server, &s->timer, due)) {
        cam->counters.lost++;
        sim_array_truth(cam->array, cam, s, 0, "too many frames on the way");
    }
}

void sim_cam_edge(struct sim_cam *cam, uint64_t trigger, int64_t t_ns)
{
    const struct sst_sim_timing *t = timing_of(cam);
    const struct sim_shot ignored = { .cam = cam, .exposure = { .cam = sim_cam_body(cam), .trigger = trigger } };
    int64_t start;

    if (!cam->queue.streaming || !cam->control[SST_SIM_CONTROL_TRIGGER])
        return;
    start = t_ns + t->delay_ns + (int64_t)(sim_cam_gauss(cam) * (double)t->jitter_ns);
    if (start < t_ns)
        start = t_ns; /* never before its cause */
    if (start < cam->busy_until_ns) {
        cam->counters.overtrigger++;
        sim_array_truth(cam->array, cam, &ignored, 0, "still exposing or reading out");
        return;
    }
    expose(cam, trigger, start);
}

static int64_t period_ns(const struct sim_cam *cam)
{
    return SECOND * cam->interval.numerator / cam->interval.denominator;
}

static void beat_at(struct sim_cam *cam, int64_t due_ns)
{
    if (sim_timer_set(cam->server, &cam->free_run_timer, due_ns))
        sst_log_error("camera %d: out of memory for its next frame; it stops until the stream is restarted",
                      cam->index);
}

/* Free-running frame clock without timer drift; a simulator that was stopped for long does not catch up. */
static void free_run(void *arg)
{
    struct sim_cam *cam = arg;
    const int64_t period = period_ns(cam), now = sst_clock_now_ns();
    int64_t due = cam->free_run_start_ns + (int64_t)cam->free_run * period;

    expose(cam, cam->free_run, due);
    cam->free_run++;
    due += period;
    while (due + SECOND < now) {
        due += period;
        cam->free_run++;
        cam->sequence++;
    }
    beat_at(cam, due);
}

int sim_cam_start(struct sim_cam *cam)
{
    const struct sim_bus *bus = &cam->array->bus;
    int err = 0;

    if (sim_cam_fault(cam, SST_SIM_FAULT_NOSPACE) > 0)
        return -ENOSPC;
    if (bus->reserve)
        err = bus->reserve(bus->arg, cam->index, cam->format.pixelformat, (int)cam->format.width,
                           (int)cam->format.height, (double)cam->interval.denominator / cam->interval.numerator);
    if (err)
        return err;
    cam->reserved = true;
    cam->sequence = sim_cam_fault(cam, SST_SIM_FAULT_SEQUENCE_WRAP) > 0 ? (uint32_t)-8 : 0;
    cam->busy_until_ns = 0;
    cam->free_run = 0;
    sim_cam_retime(cam);
    return 0;
}

void sim_cam_retime(struct sim_cam *cam)
{
    const int64_t period = period_ns(cam), now = sst_clock_now_ns();
    int64_t phase;

    sim_timer_stop(cam->server, &cam->free_run_timer);
    if (!cam->queue.streaming || cam->control[SST_SIM_CONTROL_TRIGGER])
        return;
    /* Frames start at phase + n * period since the world began: cameras of the same rate keep their relative phase. */
    phase = cam->array->opened_ns + timing_of(cam)->phase_ns;
    cam->free_run_start_ns = phase + ((now - phase) / period + 1) * period - (int64_t)cam->free_run * period;
    beat_at(cam, cam->free_run_start_ns + (int64_t)cam->free_run * period);
}

void sim_cam_stop(struct sim_cam *cam)
{
    const struct sim_bus *bus = &cam->array->bus;

    sim_timer_stop(cam->server, &cam->free_run_timer);
    for (int i = 0; i < SST_SIM_CAM_SHOTS; i++)
        if (cam->shot[i].timer.slot) {
            sim_timer_stop(cam->server, &cam->shot[i].timer);
            cam->counters.lost++;
            sim_array_truth(cam->array, cam, &cam->shot[i], 0, "stream stopped");
        }
    if (cam->reserved && bus->release)
        bus->release(bus->arg, cam->index);
    cam->reserved = false;
}

/* --- frames ------------------------------------------------------------------------------------------------------- */

/* Time stamp of the camera's clock. */
static int64_t stamp_of(struct sim_cam *cam, int64_t t_ns)
{
    const struct sst_sim_timing *t = timing_of(cam);
    const double age = (double)(t_ns - cam->array->opened_ns);
    int64_t stamp = t_ns + t->clock_offset_ns + (int64_t)(age * t->clock_drift_ppm * 1e-6) +
                    (int64_t)(sim_cam_fault(cam, SST_SIM_FAULT_CLOCK_STEP_US) * 1000);

    if (cam->time_wrap_ns) {
        stamp += ((1LL << 31) - 2) * SECOND - cam->time_wrap_ns;
        if (stamp >= (1LL << 31) * SECOND)
            stamp -= (1LL << 32) * SECOND;
    }
    if (sim_cam_chance(cam, sim_cam_fault(cam, SST_SIM_FAULT_BACKWARDS)))
        stamp -= BACKWARDS_NS;
    if (sim_cam_fault(cam, SST_SIM_FAULT_SAME_STAMP) > 0)
        stamp = cam->same_stamp_ns = cam->same_stamp_ns ? cam->same_stamp_ns : stamp;
    return stamp;
}

/* Keep the first frame of a frozen camera, and repeat it. */
static void freeze(struct sim_cam *cam, struct sim_buffer *b)
{
    if (!cam->frozen) {
        cam->frozen = malloc(b->bytesused);
        cam->frozen_bytes = cam->frozen ? b->bytesused : 0;
        if (cam->frozen)
            memcpy(cam->frozen, b->data, b->bytesused);
    } else if (cam->frozen_bytes <= b->length) {
        memcpy(b->data, cam->frozen, cam->frozen_bytes);
        b->bytesused = (uint32_t)cam->frozen_bytes;
    }
}

/* Segments of a JPEG before its scan: the frame header says 8 lines more, Huffman tables are left out. */
static void edit_header(struct sim_buffer *b, bool enlarge, bool strip)
{
    for (uint32_t i = 2; i + 9 < b->bytesused && b->data[i] == 0xff && b->data[i + 1] != 0xda;) {
        const uint32_t length = 2u + ((uint32_t)b->data[i + 2] << 8 | b->data[i + 3]);

        if (strip && b->data[i + 1] == 0xc4 && i + length < b->bytesused) {
            memmove(b->data + i, b->data + i + length, b->bytesused - i - length);
            b->bytesused -= length;
            continue;
        }
        if (enlarge && b->data[i + 1] == 0xc0) {
            const unsigned height = ((unsigned)b->data[i + 5] << 8 | b->data[i + 6]) + 8;

            b->data[i + 5] = (uint8_t)(height >> 8);
            b->data[i + 6] = (uint8_t)height;
        }
        i += length;
    }
}

static void damage(struct sim_cam *cam, struct sim_buffer *b)
{
    const uint32_t lead = (uint32_t)sim_cam_fault(cam, SST_SIM_FAULT_LEAD);

    if (cam->format.pixelformat == V4L2_PIX_FMT_MJPEG)
        edit_header(b, sim_cam_chance(cam, sim_cam_fault(cam, SST_SIM_FAULT_OTHER_SIZE)),
                    sim_cam_chance(cam, sim_cam_fault(cam, SST_SIM_FAULT_NO_TABLES)));
    if (lead && b->bytesused + lead <= b->length) {
        memmove(b->data + lead, b->data, b->bytesused);
        memset(b->data, 0, lead);
        b->bytesused += lead;
    }
    if (sim_cam_fault(cam, SST_SIM_FAULT_FROZEN) > 0)
        freeze(cam, b);
    if (sim_cam_chance(cam, sim_cam_fault(cam, SST_SIM_FAULT_CORRUPT_SOI)) && b->bytesused >= 2)
        memset(b->data, 0, 2);
    if (sim_cam_chance(cam, sim_cam_fault(cam, SST_SIM_FAULT_CORRUPT_EOI)) && b->bytesused >= 2)
        memset(b->data + b->bytesused - 2, 0, 2);
    /* A start-of-image marker inside the coded data. */
    if (sim_cam_chance(cam, sim_cam_fault(cam, SST_SIM_FAULT_CORRUPT_MID)) && b->bytesused >= 64)
        for (int i = 0; i < 16; i++)
            b->data[b->bytesused / 2 + (uint32_t)i] = i & 1 ? 0xd8 : 0xff;
    if (sim_cam_chance(cam, sim_cam_fault(cam, SST_SIM_FAULT_TRUNCATED)))
        b->bytesused /= 2;
    if (sim_cam_chance(cam, sim_cam_fault(cam, SST_SIM_FAULT_SHORT)) && b->bytesused > SHORT_BYTES)
        b->bytesused = SHORT_BYTES;
    b->error = sim_cam_chance(cam, sim_cam_fault(cam, SST_SIM_FAULT_ERROR_FLAG));
}

/* Memory of another device: copy the frame there. */
static bool copy_to_dmabuf(const struct sim_buffer *b)
{
    return b->dmabuf < 0 || pwrite(b->dmabuf, b->data, b->bytesused, 0) == (ssize_t)b->bytesused;
}

static void fill(struct sim_cam *cam, const struct sim_shot *shot, uint32_t sequence, int64_t later_ns)
{
    struct sim_buffer *b = sim_cam_queue_next(cam);
    size_t bytes = 0;

    if (!b) {
        cam->counters.lost++;
        sim_array_truth(cam->array, cam, shot, 0, "no buffer queued");
        return;
    }
    if (sst_sim_world_frame(
            cam->world, &shot->exposure,
            (struct sst_sim_format){ cam->format.pixelformat, (int)cam->format.width, (int)cam->format.height },
            (struct sst_sim_room){ b->data, b->length }, &bytes)) {
        cam->counters.lost++;
        sim_array_truth(cam->array, cam, shot, 0, "larger than the buffer");
        return;
    }
    b->bytesused = (uint32_t)bytes;
    b->sequence = sequence;
    b->field = (uint32_t)sim_cam_fault(cam, SST_SIM_FAULT_FIELD) % 10;
    if (!b->field)
        b->field = V4L2_FIELD_NONE;
    else if (b->field == V4L2_FIELD_ALTERNATE)
        b->field = sequence & 1 ? V4L2_FIELD_BOTTOM : V4L2_FIELD_TOP;
    b->stamp_ns = stamp_of(cam, shot->exposure.t_ns) + later_ns;
    damage(cam, b);
    if (!copy_to_dmabuf(b))
        b->error = true;
    cam->counters.frames++;
    sim_array_truth(cam->array, cam, shot, b->stamp_ns, NULL);
    sim_cam_queue_done(cam);
}

static void deliver(void *arg)
{
    const struct sim_shot *shot = arg;
    struct sim_cam *cam = shot->cam;
    const char *why = NULL;

    if (sim_cam_fault(cam, SST_SIM_FAULT_STALL) > 0)
        why = "stalled";
    else if (sim_cam_chance(cam, sim_cam_fault(cam, SST_SIM_FAULT_GAP)))
        why = "gap";
    if (why) {
        cam->counters.lost++;
        sim_array_truth(cam->array, cam, shot, 0, why);
        return;
    }
    fill(cam, shot, shot->sequence, 0);
    if (sim_cam_chance(cam, sim_cam_fault(cam, SST_SIM_FAULT_DUPLICATE)))
        fill(cam, shot, cam->sequence++, DUPLICATE_NS);
}

void sim_cam_fault_set(struct sim_cam *cam, int fault, double value)
{
    if (fault == SST_SIM_FAULT_FROZEN && value == 0) {
        free(cam->frozen);
        cam->frozen = NULL;
    }
    if (fault == SST_SIM_FAULT_SEQUENCE_WRAP && value > 0)
        cam->sequence = (uint32_t)-8;
    if (fault == SST_SIM_FAULT_SAME_STAMP)
        cam->same_stamp_ns = 0;
    if (fault == SST_SIM_FAULT_TIME_WRAP)
        cam->time_wrap_ns = value > 0 ? sst_clock_now_ns() : 0;
}
