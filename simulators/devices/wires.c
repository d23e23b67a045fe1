/* simulators/devices/wires.c - connects trigger edges, cameras, the bus and the rig. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/devices/devices_internal.h"
#include "simulators/devices/sysfs_internal.h"
#include "simulators/devices/usb_internal.h"

#include <errno.h>
#include <linux/videodev2.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "simulators/scene/world/settings.h"

#define UVC_HEADER_BYTES 12 /* header before the picture in each packet */

/* --- bus to cameras ----------------------------------------------------------------------------------------------- */

static void works(void *arg, int cam, bool works_now)
{
    struct sim_wires *w = arg;
    const int err = w->array ? sim_array_plug(w->array, cam, works_now) : 0;

    if (err)
        sst_log_error("camera %d: cannot create its video node: %s", cam, strerror(-err));
}

static void rung(void *arg, int cam, enum sst_sim_usb_event event)
{
    struct sim_wires *w = arg;

    if (w->array)
        sim_array_rung(w->array, cam,
                       event == SST_SIM_USB_RESET          ? SST_SIM_RESET
                       : event == SST_SIM_USB_REAUTHORISED ? SST_SIM_REAUTHORISE
                                                           : SST_SIM_POWER);
}

/* --- cameras to bus ----------------------------------------------------------------------------------------------- */

/** Bandwidth of a stream; 0: as much as possible, as cameras request for compressed pictures. */
static int64_t bytes_per_second(uint32_t fourcc, int width, int height, double rate_hz)
{
    const int per_pixel = fourcc == V4L2_PIX_FMT_YUYV || fourcc == V4L2_PIX_FMT_Y16 ? 2 : 1;

    if (fourcc == V4L2_PIX_FMT_MJPEG)
        return 0;
    return (int64_t)((double)width * height * per_pixel * rate_hz) + 8000 * UVC_HEADER_BYTES;
}

static int reserve(void *arg, int cam, uint32_t fourcc, int width, int height, double rate_hz)
{
    struct sim_wires *w = arg;
    struct sst_sim_usb *usb = w->usb->usb;
    const int device = sst_sim_usb_camera(usb, cam);
    int err = sst_sim_usb_stream(usb, device, bytes_per_second(fourcc, width, height, rate_hz));

    /* A camera requests at most its largest setting; its frames then take longer. */
    if (err == -EIO)
        err = sst_sim_usb_stream(usb, device, 0);
    return err;
}

static void release(void *arg, int cam)
{
    struct sim_wires *w = arg;
    struct sst_sim_usb *usb = w->usb->usb;

    sst_sim_usb_stream_end(usb, sst_sim_usb_camera(usb, cam));
}

static void plugged(void *arg, int cam, bool present, int node)
{
    struct sim_wires *w = arg;

    if (!sim_usb_front_video(w->usb, cam, present, node))
        (void)!sim_array_plug(w->array, cam, false); /* unplugging cannot fail */
}

static void swapped(void *arg, int cam, int body)
{
    struct sim_wires *w = arg;
    struct sst_sim_usb *usb = w->usb->usb;

    sst_sim_usb_swap(usb, sst_sim_usb_camera(usb, cam), body);
}

/* --- trigger ------------------------------------------------------------------------------------------------------ */

static void edge(void *arg, int line, int64_t t_ns)
{
    struct sim_wires *w = arg;
    const uint64_t index = w->generator_hz > 0 ? w->generated : w->edges[line]++;

    if (w->cfg.options.one_trigger)
        sim_array_edge(w->array, 0, w->rows * w->cols, index, t_ns);
    else
        sim_array_edge(w->array, line * w->cols, w->cols, index, t_ns);
}

/* --- generator ----------------------------------------------------------------------------------------------------
 * Its pulses are at whole periods of CLOCK_MONOTONIC: sessions on one machine have one generator. */

static void set_generator(struct sim_wires *w)
{
    const double now = (double)sst_clock_now_ns() * 1e-9 * w->generator_hz;

    if (now - (double)w->generated > w->generator_hz) /* the simulator stood still: the generator did not */
        w->generated = (uint64_t)now;
    w->generated++;
    if (sim_timer_set(w->cfg.server, &w->generator, llround((double)w->generated * 1e9 / w->generator_hz)))
        sst_log_error("generator: out of memory for its next pulse; it stops");
}

static void generate(void *arg)
{
    struct sim_wires *w = arg;

    sim_gpio_front_pulse(w->gpio, w->generator.due_ns);
    set_generator(w);
}

/* --- rig ---------------------------------------------------------------------------------------------------------- */

static void pose(void *arg, int64_t t_ns, int32_t pose_um[3])
{
    const struct sim_wires *w = arg;

    sst_sim_drive_pose(w->rig, t_ns, pose_um);
}

/* --- open and close ----------------------------------------------------------------------------------------------- */

int sim_wires_open(struct sim_wires **out, const struct sim_wires_config *cfg)
{
    struct sim_wires *w = calloc(1, sizeof(*w));
    struct sim_usb_front_config usb = {
        .faults = cfg->faults, .layout = cfg->options.usb, .arg = w, .works = works, .rung = rung
    };
    const struct sst_sim_settings *world = sst_sim_world_settings(cfg->world);
    int err;

    if (!w)
        return -ENOMEM;
    w->cfg = *cfg;
    usb.still = world->still.present ? world->still.serial : NULL;
    w->rows = world->rows / world->split_rows; /* of devices */
    w->cols = world->cols / world->split_cols;
    usb.cameras = sst_sim_world_cameras(cfg->world);
    usb.size_count = sst_sim_world_sizes(cfg->world, &usb.sizes);
    err = sim_sysfs_open(&w->sysfs, cfg->server);
    usb.sysfs = w->sysfs;
    err = err ? err : sim_usb_front_open(&w->usb, &usb);
    if (!err && (cfg->options.rig || (usb.cameras == 1 && world->split_rows * world->split_cols == 1)))
        err = sim_rig_open(&w->rig, sim_server_dir(cfg->server), cfg->options.rig_port, world->seed);
    if (err)
        sim_wires_close(w);
    else
        *out = w;
    return err;
}

static int open_still(struct sim_wires *w)
{
    const struct sim_still_config cfg = { .world = w->cfg.world,
                                          .server = w->cfg.server,
                                          .faults = w->cfg.faults,
                                          .usb = w->usb,
                                          .truth = sim_array_log(w->array),
                                          .arg = w,
                                          .pose = pose };

    return sst_sim_world_settings(w->cfg.world)->still.present ? sim_still_open(&w->still, &cfg) : 0;
}

int sim_wires_attach(struct sim_wires *w, struct sim_array *array)
{
    const struct sim_gpio_front_config gpio = {
        .sysfs = w->sysfs,
        .faults = w->cfg.faults,
        .lines = w->cfg.options.one_trigger ? 1 : sst_min_int(w->rows, SIM_TRIGGERS_MAX),
        .seed = sst_sim_world_settings(w->cfg.world)->seed,
        .arg = w,
        .edge = edge,
    };
    int err;

    w->array = array;
    for (int cam = 0; cam < sim_array_cameras(array); cam++)
        plugged(w, cam, true, sim_array_node(array, cam));
    sim_array_set_bus(array, &(struct sim_bus){ .arg = w,
                                                .reserve = reserve,
                                                .release = release,
                                                .plugged = plugged,
                                                .swapped = swapped,
                                                .pose = w->rig ? pose : NULL });
    err = open_still(w);
    err = err ? err : sim_gpio_front_open(&w->gpio, &gpio);
    w->generator = (struct sim_timer){ .fire = generate, .arg = w };
    w->generator_hz = sst_sim_world_settings(w->cfg.world)->host.generator_hz;
    if (!err && w->generator_hz > 0)
        set_generator(w);
    return err;
}

void sim_wires_close(struct sim_wires *w)
{
    if (!w)
        return;
    w->array = NULL;
    sim_timer_stop(w->cfg.server, &w->generator);
    sim_still_close(w->still);
    sst_sim_drive_stop(w->rig);
    sim_gpio_front_close(w->gpio);
    sim_usb_front_close(w->usb);
    sim_sysfs_close(w->sysfs);
    free(w);
}
