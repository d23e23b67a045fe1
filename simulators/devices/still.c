/* The still camera of a session: PTP behind usbfs, pictures of the world at the rig's pose, faults. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/devices/devices_internal.h"
#include "simulators/devices/sysfs_internal.h"
#include "simulators/devices/usb_internal.h"

#include <errno.h>
#include <linux/videodev2.h>
#include <stdlib.h>
#include <string.h>

#include <sha2.h>

#include "base/clock.h"
#include "base/log.h"
#include "simulators/devices/ptp/ptp_model.h"
#include "simulators/scene/world/settings.h"

#define MS 1000000LL

/* Behind the model's own faults. */
#define FAULT_UNPLUG SST_SIM_PTP_FAULTS
#define FAULT_PRESS  (SST_SIM_PTP_FAULTS + 1)
#define FAULTS       (SST_SIM_PTP_FAULTS + 2)

static const struct sim_fault faults[FAULTS] = {
    [SST_SIM_PTP_BUSY] = { "busy", 0, 60000, "ms for which the camera is busy, from the next capture on" },
    [SST_SIM_PTP_CARD_FULL] = { "card_full", 0, 1, "1: the card has no space" },
    [SST_SIM_PTP_BATTERY] = { "battery", 0, 100, "level of the battery in percent; 0: that of the world" },
    [SST_SIM_PTP_REFUSE] = { "refuse", 0, 1000, "number of settings that are refused" },
    [SST_SIM_PTP_CORRUPT] = { "corrupt", 0, 3,
                              "of the next file 1: the end is missing, 2: bytes are wrong, 3: the end is not sent" },
    [SST_SIM_PTP_SILENCE] = { "silence", 0, 1, "1: no answers until the camera is closed or reset" },
    [SST_SIM_PTP_DOWNLOAD] = { "unplug_download", 0, 60000, "ms for which the next download unplugs the camera" },
    [SST_SIM_PTP_NO_EVENT] = { "no_event", 0, 1000, "number of pictures that are not announced" },
    [SST_SIM_PTP_DIAL] = { "dial", 0, 10000, "somebody turns the dial: exposure time in 0.1 ms" },
    [SST_SIM_PTP_LATE_EVENT] = { "late_event", 0, 60000, "ms by which the next picture is announced late" },
    [SST_SIM_PTP_REPEAT] = { "repeat", 0, 1, "1: pictures are announced again and again until they are downloaded" },
    [FAULT_PRESS] = { "press", 0, 1, "1: somebody presses the button on the camera" },
    [FAULT_UNPLUG] = { "unplug", 0, 1, "1: away, 0: back" },
};

const struct sim_fault_scope sim_still_faults = { .name = "still", .faults = faults, .count = FAULTS };

struct sim_still {
    struct sim_still_config cfg;
    const struct sst_sim_still *settings;
    struct sst_sim_ptp *ptp;
    int scope; /* of the faults */
    struct sim_timer exposing, plugging;
    int32_t pose_um[3]; /* of the last exposure */
    int away_ms;        /* unplugged by plugging's next call; 0: plugged in by it */
    int planned;        /* faults of the world that are set */
};

/* --- pictures ----------------------------------------------------------------------------------------------------- */

static int frame(struct sim_still *s, const struct sst_sim_exposure *e, uint32_t fourcc, uint8_t *out, size_t room,
                 size_t *bytes)
{
    const struct sst_sim_settings *set = sst_sim_world_settings(s->cfg.world);

    return sst_sim_world_frame(s->cfg.world, e, (struct sst_sim_format){ fourcc, set->width, set->height },
                               (struct sst_sim_room){ out, room }, bytes);
}

static int expose(void *arg, const struct sst_sim_ptp_exposure *e, bool raw, uint8_t **data, size_t *bytes)
{
    struct sim_still *s = arg;
    struct sst_sim_exposure shot = {
        .trigger = (uint64_t)e->shot, .t_ns = e->t_ns, .exposure_us = (int)(e->time_s * 1e6), .gain = e->gain
    };
    const struct sst_sim_settings *set = sst_sim_world_settings(s->cfg.world);
    const size_t room = (size_t)set->width * (size_t)set->height * 4 + 65536;
    uint8_t *out = malloc(room);
    int err;

    if (!out)
        return -ENOMEM;
    s->cfg.pose(s->cfg.arg, e->t_ns, shot.pose_um);
    memcpy(s->pose_um, shot.pose_um, sizeof(s->pose_um));
    err = frame(s, &shot, raw ? V4L2_PIX_FMT_SRGGB8 : V4L2_PIX_FMT_MJPEG, out, room, bytes);
    if (!err && raw) {
        err = sst_sim_ptp_dng(out, set->width, set->height, data, bytes);
        free(out);
    } else if (!err) {
        *data = out;
    } else {
        free(out);
    }
    if (err)
        sst_log_error("still camera: exposure %d cannot be rendered: %s", e->shot, strerror(-err));
    return err;
}

/** A line of the truth log: contents of the camera. */
static void stored(void *arg, int shot, const char *name, const uint8_t *data, size_t bytes)
{
    struct sim_still *s = arg;
    char sha256[SHA256_DIGEST_STRING_LENGTH];

    if (!s->cfg.truth)
        return;
    fprintf(s->cfg.truth,
            "{\"still\":\"%s\",\"shot\":%d,\"pose_um\":[%d,%d,%d],\"file\":\"%s\",\"bytes\":%zu,\"sha256\":\"%s\"}\n",
            s->settings->serial, shot, s->pose_um[0], s->pose_um[1], s->pose_um[2], name, bytes,
            SHA256Data(data, bytes, sha256));
}

/* --- faults ------------------------------------------------------------------------------------------------------- */

static double fault_value(void *arg, enum sst_sim_ptp_fault fault)
{
    const struct sim_still *s = arg;

    return sim_fault_value(s->cfg.faults, s->scope, 0, (int)fault);
}

static void set_fault(struct sim_still *s, const char *name, double value)
{
    char text[64], message[256];

    (void)snprintf(text, sizeof(text), "still.%s=%g", name, value);
    if (sim_faults_set(s->cfg.faults, text, message, sizeof(message)))
        sst_log_error("%s", message);
}

/** Faults with a count happen that number of times, others once. */
static void spend(void *arg, enum sst_sim_ptp_fault fault)
{
    struct sim_still *s = arg;
    const double value = fault_value(arg, fault);

    if ((fault == SST_SIM_PTP_REFUSE || fault == SST_SIM_PTP_NO_EVENT) && value > 1)
        set_fault(s, faults[fault].name, value - 1);
    else
        sim_fault_reset(s->cfg.faults, s->scope, 0, (int)fault);
}

/** Set the world's faults that are due before the next exposure. */
static void plan(struct sim_still *s)
{
    const int next = sst_sim_ptp_shots(s->ptp) + 1;

    for (; s->planned < s->settings->faults && s->settings->fault[s->planned].shot <= next; s->planned++)
        set_fault(s, s->settings->fault[s->planned].name, s->settings->fault[s->planned].value);
}

static int check_plan(const struct sst_sim_still *settings)
{
    for (int i = 0; i < settings->faults; i++) {
        int k = 0;

        while (k < FAULTS && strcmp(faults[k].name, settings->fault[i].name) != 0)
            k++;
        if (k == FAULTS || settings->fault[i].value > faults[k].max) {
            sst_log_error("still: faults: shot %d: `%s` with value %g is no fault of the still camera; `sst-sim fault "
                          "--list` shows them as still.NAME with their ranges",
                          settings->fault[i].shot, settings->fault[i].name, settings->fault[i].value);
            return -EINVAL;
        }
        if (i && settings->fault[i].shot < settings->fault[i - 1].shot) {
            sst_log_error("still: faults: shot %d comes after shot %d; list them in order", settings->fault[i].shot,
                          settings->fault[i - 1].shot);
            return -EINVAL;
        }
    }
    return 0;
}

/* --- plugging: after the call of the program that caused it ------------------------------------------------------- */

static void plug_later(struct sim_still *s, int away_ms, int64_t due_ns)
{
    s->away_ms = away_ms;
    if (sim_timer_set(s->cfg.server, &s->plugging, due_ns))
        sst_log_error("still camera: out of memory to unplug it");
}

static void plugging(void *arg)
{
    struct sim_still *s = arg;
    const int ms = s->away_ms;

    sim_usb_front_plug(s->cfg.usb, !ms);
    if (ms)
        plug_later(s, 0, sst_clock_now_ns() + ms * MS);
}

static void unplug(void *arg, int ms)
{
    plug_later(arg, sst_max_int(ms, 1), 0);
}

/* --- pipes -------------------------------------------------------------------------------------------------------- */

static void arm(struct sim_still *s)
{
    const int64_t due_ns = sst_sim_ptp_due_ns(s->ptp);

    if (due_ns < INT64_MAX && sim_timer_set(s->cfg.server, &s->exposing, due_ns))
        sst_log_error("still camera: out of memory for its exposure");
}

static int fault_changed(void *arg, int instance SST_UNUSED, int fault, double value)
{
    struct sim_still *s = arg;

    if (fault == FAULT_UNPLUG) {
        sim_usb_front_plug(s->cfg.usb, value == 0);
    } else if (fault == FAULT_PRESS && value > 0) {
        sst_sim_ptp_press(s->ptp, sst_clock_now_ns());
        arm(s);
    }
    return 0;
}

static void exposing(void *arg)
{
    struct sim_still *s = arg;

    sst_sim_ptp_tick(s->ptp, sst_clock_now_ns());
    plan(s);
    arm(s);
    if (*sim_usb_front_port(s->cfg.usb))
        usb_file_serve(&s->cfg.usb->shown[sst_sim_usb_still(s->cfg.usb->usb)]);
}

static int pipe_request(void *arg, const uint8_t setup[8], uint8_t *data)
{
    const struct sim_still *s = arg;

    return sst_sim_ptp_request(s->ptp, setup, data);
}

static int pipe_out(void *arg, const uint8_t *data, size_t bytes)
{
    struct sim_still *s = arg;
    const int err = sst_sim_ptp_out(s->ptp, data, bytes, sst_clock_now_ns());

    arm(s);
    return err;
}

static int pipe_in(void *arg, uint8_t endpoint, uint8_t *data, size_t size)
{
    const struct sim_still *s = arg;

    if (endpoint == SST_SIM_USB_BULK_IN)
        return sst_sim_ptp_in(s->ptp, data, size);
    return endpoint == SST_SIM_USB_INTERRUPT_IN ? sst_sim_ptp_event(s->ptp, data, size) : -EPIPE;
}

static void pipe_released(void *arg)
{
    const struct sim_still *s = arg;

    sst_sim_ptp_released(s->ptp);
}

/* --- open and close ----------------------------------------------------------------------------------------------- */

static int create(struct sim_still *s)
{
    const struct sst_sim_settings *world = sst_sim_world_settings(s->cfg.world);
    const struct sst_sim_ptp_config model = {
        .serial = s->settings->serial,
        .width = world->width,
        .height = world->height,
        .exposure_us = world->exposure_us,
        .card_bytes = (int64_t)s->settings->card_mb * 1000000,
        .battery_percent = s->settings->battery_percent,
        .lag_ms = s->settings->lag_ms,
        .write_ms = s->settings->write_ms,
        .mirror_lockup = s->settings->mirror_lockup,
        .buffer = s->settings->buffer,
        .arg = s,
        .expose = expose,
        .stored = stored,
        .fault = fault_value,
        .spend = spend,
        .unplug = unplug,
    };

    return sst_sim_ptp_create(&s->ptp, &model);
}

int sim_still_open(struct sim_still **out, const struct sim_still_config *cfg)
{
    struct sim_still *s = calloc(1, sizeof(*s));
    int err;

    if (!s)
        return -ENOMEM;
    s->cfg = *cfg;
    s->settings = &sst_sim_world_settings(cfg->world)->still;
    s->exposing = (struct sim_timer){ .fire = exposing, .arg = s };
    s->plugging = (struct sim_timer){ .fire = plugging, .arg = s };
    err = check_plan(s->settings);
    err = err ? err : create(s);
    if (!err) {
        struct sim_fault_scope scope = sim_still_faults;

        scope.changed = fault_changed;
        scope.arg = s;
        s->scope = sim_faults_add(cfg->faults, &scope);
        err = sst_min_int(s->scope, 0);
    }
    if (err) {
        sim_still_close(s);
        return err;
    }
    sim_usb_front_pipes(
        cfg->usb, &(struct sim_usb_pipes){
                      .arg = s, .request = pipe_request, .out = pipe_out, .in = pipe_in, .released = pipe_released });
    plan(s);
    *out = s;
    return 0;
}

void sim_still_close(struct sim_still *s)
{
    if (!s)
        return;
    sim_timer_stop(s->cfg.server, &s->exposing);
    sim_timer_stop(s->cfg.server, &s->plugging);
    if (s->ptp)
        sim_usb_front_pipes(s->cfg.usb, &(struct sim_usb_pipes){ .arg = NULL });
    sst_sim_ptp_destroy(s->ptp);
    free(s);
}

json_t *sim_still_status(const struct sim_still *s)
{
    return json_pack("{s:s, s:s, s:i, s:i}", "serial", s->settings->serial, "port", sim_usb_front_port(s->cfg.usb),
                     "exposures", sst_sim_ptp_shots(s->ptp), "files", sst_sim_ptp_files(s->ptp));
}
