/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/cli_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/text.h"

static bool is_camera(const struct sst_usb_device *d)
{
    return d->alts || d->node[0];
}

static void add_stream(struct cli_usb *u, int device)
{
    u->streams[u->stream_count++] = (struct sst_usb_stream){ .device = device, .needed_bytes_s = u->needed_bytes_s };
}

/* The device of a camera: of split pictures, without the part. */
static struct sst_config_camera device_of(const struct sst_config_camera *c, int parts)
{
    struct sst_config_camera d = *c;

    if (parts > 1) {
        (void)sst_grab_part_of(d.serial, c->serial);
        (void)sst_grab_part_of(d.port, c->port);
    }
    return d;
}

static bool is_chosen(const struct cli_usb *u, int device)
{
    int i = 0;

    while (i < u->stream_count && u->streams[i].device != device)
        i++;
    return i < u->stream_count;
}

/* Two devices with one serial are both included: duplicates are reported elsewhere. */
static void choose_cameras(struct cli_usb *u, const struct sst_array_config *cfg)
{
    int split[2];
    const int parts = sst_array_split(cfg, split);

    for (int b = 0; b < cfg->bound; b++) {
        const struct sst_config_camera bound = device_of(&cfg->camera[b], parts);

        for (int i = 0; i < u->count && u->stream_count < u->count; i++) {
            if (is_camera(&u->devices[i]) && cli_is_bound(&bound, u->devices[i].serial, u->devices[i].port) &&
                (parts == 1 || !is_chosen(u, i)))
                add_stream(u, i);
        }
    }
    for (int i = 0; i < u->count && !cfg->bound; i++) {
        if (is_camera(&u->devices[i]))
            add_stream(u, i);
    }
}

int cli_usb_open(struct cli_usb *u, const struct sst_array_config *cfg)
{
    int split[2], err;

    memset(u, 0, sizeof(*u));
    err = sst_usb_list(&u->devices, &u->count);
    if (err)
        return err;
    u->streams = calloc((size_t)u->count + 1, sizeof(*u->streams));
    if (!u->streams) {
        sst_log_error("listing cameras: out of memory");
        cli_usb_close(u);
        return -ENOMEM;
    }
    (void)sst_array_split(cfg, split);
    u->needed_bytes_s =
        sst_usb_format_bytes_s(cfg->fourcc, split[1] * cfg->width, split[0] * cfg->height, cfg->rate_hz);
    choose_cameras(u, cfg);
    err = sst_usb_plan(&u->plan, u->devices, u->count, u->streams, u->stream_count);
    if (err)
        cli_usb_close(u);
    return err;
}

void cli_usb_close(struct cli_usb *u)
{
    free(u->plan.segments);
    free(u->streams);
    free(u->devices);
    memset(u, 0, sizeof(*u));
}

json_t *cli_text_json(const char *text)
{
    json_t *json = json_string(text);

    return json ? json : json_string("?");
}

/* --- advice ------------------------------------------------------------------------------------------------------- */

/* Number of refused cameras if each needs this rate. -1: out of memory */
static int refused_at(const struct cli_usb *u, int64_t bytes_s)
{
    struct sst_usb_stream *streams = calloc((size_t)u->stream_count + 1, sizeof(*streams));
    struct sst_usb_plan plan;
    int refused = -1;

    for (int i = 0; streams && i < u->stream_count; i++)
        streams[i] = (struct sst_usb_stream){ .device = u->streams[i].device, .needed_bytes_s = bytes_s };
    if (streams && !sst_usb_plan(&plan, u->devices, u->count, streams, u->stream_count)) {
        refused = plan.refused;
        free(plan.segments);
    }
    free(streams);
    return refused;
}

/* Data rate of the largest setting of any camera. */
static int64_t largest_bytes_s(const struct cli_usb *u)
{
    int64_t largest = 3072 * 8000;

    for (int i = 0; i < u->stream_count; i++) {
        const struct sst_usb_device *d = &u->devices[u->streams[i].device];

        for (int k = 0; k < d->alts; k++) {
            const int64_t bytes_s = (int64_t)d->alt[k].packet_bytes * 1000000 / d->alt[k].interval_us;

            largest = bytes_s > largest ? bytes_s : largest;
        }
    }
    return largest;
}

/* Maximum rate per camera for which all fit; 0: there is none. */
static int64_t most_bytes_s(const struct cli_usb *u)
{
    int64_t low = 0, high = u->needed_bytes_s ? u->needed_bytes_s : largest_bytes_s(u);

    while (high - low > 1000) {
        const int64_t middle = low + (high - low) / 2;

        if (refused_at(u, middle))
            high = middle;
        else
            low = middle;
    }
    return low;
}

/* Find a free port of a root hub for the speed of the camera. @return its number, 0: none is free */
static int free_port(const struct cli_usb *u, int hub)
{
    for (int port = 1; port <= u->devices[hub].hub_ports; port++) {
        char name[SST_USB_TEXT_MAX];
        bool taken = false;

        snprintf(name, sizeof(name), "%d-%d", u->devices[hub].bus, port);
        for (int i = 0; i < u->count; i++)
            taken = taken || !strcmp(u->devices[i].port, name);
        if (!taken)
            return port;
    }
    return 0;
}

/* True if the stream would fit with its camera plugged in there. */
static bool fits_at(struct cli_usb *u, int stream, int hub, int port)
{
    struct sst_usb_device *d = &u->devices[u->streams[stream].device];
    const struct sst_usb_device before = *d;
    struct sst_usb_stream *streams = calloc((size_t)u->stream_count, sizeof(*streams));
    struct sst_usb_plan plan;
    bool fits = false;

    if (!streams)
        return false;
    for (int i = 0; i < u->stream_count; i++)
        streams[i] = u->streams[i];
    d->parent = hub;
    d->port_buses = u->devices[hub].port_buses;
    snprintf(d->port, sizeof(d->port), "%d-%d", u->devices[hub].bus, port);
    if (!sst_usb_plan(&plan, u->devices, u->count, streams, u->stream_count)) {
        fits = streams[stream].fits && plan.refused < u->plan.refused;
        free(plan.segments);
    }
    free(streams);
    *d = before;
    return fits;
}

static void advise_port(struct cli_usb *u, int stream, char *text, size_t size)
{
    const struct sst_usb_device *d = &u->devices[u->streams[stream].device];

    for (int hub = 0; hub < u->count; hub++) {
        const struct sst_usb_device *h = &u->devices[hub];
        const int port = h->parent < 0 && h->speed_mbit == (d->speed_mbit >= 5000 ? h->speed_mbit : 480) &&
                                 h->speed_mbit >= d->speed_mbit
                             ? free_port(u, hub)
                             : 0;

        if (port && fits_at(u, stream, hub, port)) {
            sst_text_add(text, size, "Plug %s into the free port %d-%d of controller %s. ", d->port, h->bus, port,
                         h->controller);
            return;
        }
    }
    sst_text_add(text, size,
                 "No free port of this machine has room for %s: add a controller (a card with one for each port). ",
                 d->port);
}

void cli_usb_advise(const struct cli_usb *usb, const struct sst_array_config *cfg, char *text, size_t size)
{
    struct cli_usb copy = *usb;
    const double frame_bytes = usb->needed_bytes_s ? (double)usb->needed_bytes_s / cfg->rate_hz : 0;
    int64_t most;
    int stream = 0;

    *text = 0;
    if (!usb->plan.refused)
        return;
    while (usb->streams[stream].fits)
        stream++;
    if (usb->streams[stream].alt < 0 && usb->devices[usb->streams[stream].device].alts)
        sst_text_add(text, size, "No setting of %s carries %.1f MB/s. ", usb->devices[usb->streams[stream].device].port,
                     (double)usb->needed_bytes_s / 1e6);
    else
        advise_port(&copy, stream, text, size);
    most = most_bytes_s(usb);
    if (most && frame_bytes > 0)
        sst_text_add(text, size,
                     "Or lower the rate: at %.2f/s all cameras fit (%.1f MB/s each), or a smaller size in proportion.",
                     (double)most / frame_bytes, (double)most / 1e6);
    else if (most)
        sst_text_add(
            text, size,
            "Or make each camera request at most %.1f MB/s: a smaller size or a lower rate, if this camera then "
            "requests less (many request the worst case for any picture).",
            (double)most / 1e6);
    else
        sst_text_add(text, size, "No rate is low enough for this number of cameras on these wires.");
}
