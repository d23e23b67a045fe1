/* The array of simulated cameras: identity, plugging, trigger edges, the truth log. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/devices/camera/camera_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "simulators/scene/noise.h"

#define VIDEO_MAJOR 81

static const struct sim_fault faults[] = {
#define X(fault, name, least, greatest, help) { name, least, greatest, help },
    SIM_CAM_FAULTS(X)
#undef X
};

const struct sim_fault_scope sim_camera_faults = {
    .name = "camera", .faults = faults, .count = SST_SIM_FAULTS_OF_CAMERA, .instances = 1
};

/* --- identity ----------------------------------------------------------------------------------------------------- */

void sim_identity(const struct sst_sim_usb *usb, int cam, struct sim_identity *out)
{
    const struct sst_sim_usb_device *d = sst_sim_usb_device(usb, sst_sim_usb_camera(usb, cam));

    *out = (struct sim_identity){ .bus = d->bus };
    (void)snprintf(out->serial, sizeof(out->serial), "%.15s", d->serial);
    (void)snprintf(out->card, sizeof(out->card), "%.31s", sst_sim_usb_product(d));
    (void)snprintf(out->controller, sizeof(out->controller), "%.31s", d->controller);
    (void)snprintf(out->port, sizeof(out->port), "%.31s", d->path);
    (void)snprintf(out->bus_info, sizeof(out->bus_info), "usb-%.31s-%.24s", d->controller, strchr(d->path, '-') + 1);
}

/* --- queries of cameras ------------------------------------------------------------------------------------------- */

double sim_cam_fault(const struct sim_cam *cam, enum sim_cam_fault fault)
{
    return sim_fault_value(cam->array->cfg.faults, cam->array->scope, cam->index, (int)fault);
}

/* In (0, 1). */
static double uniform(struct sim_cam *cam)
{
    return ((double)(sst_random_u64(&cam->random) >> 12) + 0.5) * 0x1p-52;
}

bool sim_cam_chance(struct sim_cam *cam, double probability)
{
    return probability > 0 && uniform(cam) < probability;
}

/* Box and Muller 1958 */
double sim_cam_gauss(struct sim_cam *cam)
{
    const double radius = sqrt(-2 * log(uniform(cam)));

    return radius * cos(2 * 3.14159265358979323846 * uniform(cam));
}

/* The camera that is plugged in at the position of camera `cam`: another one with fault "swap". */
static int array_body(const struct sim_array *a, int cam)
{
    const int body = cam + (int)sim_fault_value(a->cfg.faults, a->scope, cam, SST_SIM_FAULT_SWAP);

    return sst_clamp_int(body, 0, a->cameras - 1);
}

int sim_cam_body(const struct sim_cam *cam)
{
    return array_body(cam->array, cam->index);
}

void sim_array_truth(struct sim_array *a, const struct sim_cam *cam, const struct sim_shot *shot, int64_t stamp_ns,
                     const char *why)
{
    const struct sst_sim_exposure *e = &shot->exposure;

    if (!a->truth)
        return;
    fprintf(a->truth, "{\"camera\":%d,\"shows\":%d,\"trigger\":%llu,\"t_ns\":%lld,\"sequence\":%u,", cam->index, e->cam,
            (unsigned long long)e->trigger, (long long)e->t_ns, shot->sequence);
    if (why)
        fprintf(a->truth, "\"lost\":\"%s\"}\n", why);
    else
        fprintf(a->truth, "\"stamp_ns\":%lld}\n", (long long)stamp_ns);
}

/* --- plugging ----------------------------------------------------------------------------------------------------- */

static int lowest_free_number(const struct sim_array *a)
{
    for (int n = 0;; n++) {
        int i = 0;

        while (i < a->cameras && !(a->cam[i].node && a->cam[i].number == n))
            i++;
        if (i == a->cameras)
            return n;
    }
}

static int appear(struct sim_array *a, struct sim_cam *cam)
{
    const int number = lowest_free_number(a);
    char path[32];
    int err;

    (void)snprintf(path, sizeof(path), "/dev/video%d", number);
    sim_cam_formats_reset(cam);
    sim_cam_controls_reset(cam);
    err = sim_node_add(a->cfg.server, &cam->node, path,
                       &(struct sim_device){ &sim_cam_ops, cam, VIDEO_MAJOR, (unsigned)number });
    if (!err)
        cam->number = number;
    return err;
}

int sim_array_plug(struct sim_array *a, int index, bool present)
{
    struct sim_cam *cam = &a->cam[index];
    int err = 0;

    if (present == (cam->node != NULL))
        return 0;
    if (present) {
        err = appear(a, cam);
    } else {
        sim_node_remove(a->cfg.server, cam->node);
        cam->node = NULL;
        sim_cam_queue_free(cam);
    }
    if (!err && a->bus.plugged)
        a->bus.plugged(a->bus.arg, index, present, cam->number);
    return err;
}

static int fault_changed(void *arg, int instance, int fault, double value)
{
    struct sim_array *a = arg;

    if (fault == SST_SIM_FAULT_UNPLUG)
        return sim_array_plug(a, instance, value == 0);
    sim_cam_fault_set(&a->cam[instance], fault, value);
    if (fault == SST_SIM_FAULT_SWAP && a->bus.swapped)
        a->bus.swapped(a->bus.arg, instance, array_body(a, instance));
    return 0;
}

void sim_array_rung(struct sim_array *a, int cam, enum sim_rung rung)
{
    const double stall = sim_cam_fault(&a->cam[cam], SST_SIM_FAULT_STALL);

    if (stall > 0 && (double)rung >= stall)
        sim_fault_reset(a->cfg.faults, a->scope, cam, SST_SIM_FAULT_STALL);
    if (rung == SST_SIM_RESET)
        sim_cam_queue_stop(&a->cam[cam], NULL);
}

/* --- open, edges, queries ----------------------------------------------------------------------------------------- */

int sim_array_open(struct sim_array **out, const struct sim_array_config *cfg)
{
    struct sim_array *a = calloc(1, sizeof(*a));
    struct sim_fault_scope scope = sim_camera_faults;
    int err = -ENOMEM;

    if (!a)
        return err;
    a->cfg = *cfg;
    a->opened_ns = sst_clock_now_ns();
    a->cameras = sst_sim_world_cameras(cfg->world);
    a->cam = calloc((size_t)a->cameras, sizeof(*a->cam));
    if (!a->cam)
        goto fail;
    if (cfg->truth && !(a->truth = fopen(cfg->truth, "we"))) {
        err = -errno;
        sst_log_error("cannot write the truth log '%s': %s", cfg->truth, strerror(-err));
        goto fail;
    }
    if (a->truth)
        setlinebuf(a->truth);
    scope.instances = a->cameras;
    scope.changed = fault_changed;
    scope.arg = a;
    a->scope = sim_faults_add(cfg->faults, &scope);
    err = sst_min_int(a->scope, 0);
    for (int i = 0; !err && i < a->cameras; i++) {
        struct sim_cam *cam = &a->cam[i];

        *cam = (struct sim_cam){ .array = a, .server = cfg->server, .world = cfg->world, .index = i };
        sim_cam_exposure_init(cam);
        err = appear(a, cam);
    }
    if (err)
        goto fail;
    *out = a;
    return 0;

fail:
    sim_array_close(a);
    return err;
}

void sim_array_close(struct sim_array *a)
{
    if (!a)
        return;
    a->bus = (struct sim_bus){ 0 };
    for (int i = 0; a->cam && i < a->cameras; i++) {
        struct sim_cam *cam = &a->cam[i];

        if (cam->node)
            sim_node_remove(a->cfg.server, cam->node);
        if (cam->array)
            sim_cam_queue_free(cam);
        free(cam->frozen);
    }
    if (a->truth && fclose(a->truth) != 0)
        sst_log_error("cannot write the truth log '%s': %s; its end is missing", a->cfg.truth, strerror(errno));
    free(a->cam);
    free(a);
}

void sim_array_set_bus(struct sim_array *a, const struct sim_bus *bus)
{
    a->bus = *bus;
}

int sim_array_cameras(const struct sim_array *a)
{
    return a->cameras;
}

int sim_array_node(const struct sim_array *a, int cam)
{
    return a->cam[cam].node ? a->cam[cam].number : -1;
}

void sim_array_edge(struct sim_array *a, int first, int count, uint64_t trigger, int64_t t_ns)
{
    for (int i = first; i < first + count && i < a->cameras; i++)
        if (a->cam[i].node)
            sim_cam_edge(&a->cam[i], trigger, t_ns);
}

FILE *sim_array_log(const struct sim_array *a)
{
    return a->truth;
}

uint64_t sim_array_frames(const struct sim_array *a)
{
    uint64_t frames = 0;

    for (int i = 0; i < a->cameras; i++)
        frames += a->cam[i].counters.frames;
    return frames;
}

json_t *sim_array_status(const struct sim_array *a)
{
    json_t *all = json_array();

    for (int i = 0; all && i < a->cameras; i++) {
        const struct sim_cam *cam = &a->cam[i];
        struct sim_identity identity;

        sim_identity(a->cfg.usb, i, &identity);
        (void)json_array_append_new(
            all, json_pack("{s:i, s:s, s:s, s:b, s:b, s:I, s:I, s:I, s:I}", "node", sim_array_node(a, i), "serial",
                           identity.serial, "port", identity.port, "streaming", cam->queue.streaming, "triggered",
                           cam->control[SST_SIM_CONTROL_TRIGGER], "exposures", (json_int_t)cam->counters.exposures,
                           "frames", (json_int_t)cam->counters.frames, "lost", (json_int_t)cam->counters.lost,
                           "overtrigger", (json_int_t)cam->counters.overtrigger));
    }
    return all;
}
