/* Pictures of GenICam cameras for sst identify. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "capture/array/capture.h"
#include "cli/identify_internal.h"

static void add(struct session *s, const struct sst_genicam_device *d, struct cli_place place)
{
    struct shot *shot = &s->shots[s->count++];

    *shot = (struct shot){ .place = place, .genicam = true };
    snprintf(shot->device.serial, sizeof(shot->device.serial), "%.63s", *d->serial ? d->serial : d->id);
    snprintf(shot->device.port, sizeof(shot->device.port), "%s", d->address);
    snprintf(shot->device.name, sizeof(shot->device.name), "%s", d->model);
}

int identify_list_genicams(struct session *s, const struct sst_array_config *cfg, const char *serial, const char *port)
{
    const bool named_one = serial || port;
    struct sst_genicam_device *devices;
    int count, left = 0, err;

    if (named_one ? s->count > 0 : !sst_array_count(cfg, SST_CONFIG_GENICAM))
        return 0; /* their search takes a second */
    err = cli_genicam_list(&devices, &count);
    for (int i = 0; i < count && s->count < SST_CAMERAS_MAX; i++) {
        const struct sst_genicam_device *d = &devices[i];
        const struct cli_place place = cli_genicam_place(cfg, d);
        const bool named =
            (!serial || !strcmp(serial, d->serial) || !strcmp(serial, d->id)) && (!port || !strcmp(port, d->address));

        if (named_one ? named : place.row >= 0)
            add(s, d, place);
        else
            left += !named_one;
    }
    if (left)
        sst_log_warning("%d GenICam cameras are not bound and may belong to somebody else: no picture of them is taken "
                        "(--serial takes one)",
                        left);
    free(devices);
    return err;
}

static void on_frame(void *arg, struct sst_frame *f)
{
    struct session *s = arg;

    identify_frame(s, f);
    sst_genicam_release(s->genicam, f);
}

static enum sst_grab_state state_of(const struct session *s, int cam)
{
    return sst_genicam_camera_state(s->genicam, cam);
}

static int poll_grab(struct session *s)
{
    struct pollfd fd = { .fd = sst_genicam_fd(s->genicam), .events = POLLIN };

    (void)poll(&fd, 1, 100);
    sst_genicam_poll(s->genicam);
    return 0;
}

/* By address where it is one: two makers may use one serial. */
static void bind(struct sst_genicam_binding *b, const struct sst_grab_device *d)
{
    *b = (struct sst_genicam_binding){ "", "" };
    if (*d->port && !d->port[strspn(d->port, "0123456789.")])
        memcpy(b->address, d->port, sizeof(b->address));
    else
        memcpy(b->id, d->serial, sizeof(b->id));
}

int identify_genicams(struct session *s, const struct sst_array_config *array)
{
    const struct sst_grab_events events = { s, on_frame, identify_state };
    struct sst_genicam_binding binding[SST_CAMERAS_MAX];
    struct sst_genicam_config cfg;
    int err;

    sst_capture_genicam_config(&cfg, array);
    cfg.cameras = 0;
    cfg.bindings = binding;
    cfg.trigger = SST_GENICAM_FREE; /* no trigger comes */
    cfg.rate_hz = array->rate_hz;
    cfg.ptp = false;
    for (int i = 0; i < s->count; i++)
        if (s->shots[i].genicam) {
            bind(&binding[cfg.cameras], &s->shots[i].device);
            s->index[cfg.cameras++] = i;
        }
    if (!cfg.cameras)
        return 0;
    err = sst_genicam_open(&s->genicam, &cfg, &events);
    if (err)
        return err;
    sst_genicam_start(s->genicam);
    err = identify_wait(s, &(struct identify_grab){ cfg.cameras, state_of, poll_grab });
    sst_genicam_close(s->genicam);
    s->genicam = NULL;
    return err;
}
