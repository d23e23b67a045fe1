/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/usb/plan.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"

#define PATH_MAX_SEGMENTS 16 /* links from a device to its root port, and its TT */
#define PAYLOAD_HEADER    12 /* UVC payload header in each packet */
#define PER_S_US          1000000
#define BLOCK_MBIT        (480.0 / 1607)

enum kind {
    HIGH_SPEED = 0,      /* bus of a controller */
    HIGH_SPEED_PORT = 1, /* root port with its own bus */
    FULL_SPEED = 2,      /* bus of a controller, or root port */
    TRANSLATOR = 3,      /* full speed behind a high-speed hub */
    SUPER_SPEED = 4,     /* link below a hub port */
};

struct place {
    enum kind kind;
    int hub, port; /* index; port of it, 0: all */
    int link_mbit; /* SuperSpeed */
};

struct segment {
    struct place place;
    struct sst_usb_segment out;
    bool tt_used;
};

/* Segments on the path of a stream, the last one nearest to the controller. */
struct route {
    struct place place[PATH_MAX_SEGMENTS];
    int n;
};

/* --- costs, in Mbit/s of the wire with overheads ------------------------------------------------------------------ */

/* USB 2.0, 5.11.3, as in Linux: bit stuffing to 7/6 of the data. */
static int64_t stuffed_bits(int bytes)
{
    return 7LL * 8 * bytes / 6;
}

/* 38 bytes of protocol, 2.083 ns a bit, 5 ns of the host, rounded up to whole us; 125 us are 480 Mbit/s. */
static double high_speed_mbit(int packet_bytes, int interval_us)
{
    const int64_t ns = (38 * 8 * 2083 + 2083 * (3 + stuffed_bits(packet_bytes))) / 1000 + 5;

    return (double)((ns + 999) / 1000) * 480 / interval_us;
}

/* 83.54 ns a bit, 7.268 us of protocol, 1 us of the host, rounded up; 1000 us are 12 Mbit/s. */
static double full_speed_mbit(int packet_bytes, int interval_us)
{
    const int64_t ns = 8354 * (31 + 10 * stuffed_bits(packet_bytes)) / 1000 + 7268 + 1000;

    return (double)((ns + 999) / 1000) * 12 / interval_us;
}

/* Intel's xHCI: 4-byte blocks, 26 more for each packet of at most 1024 bytes; 1607 blocks per 125 us are 480 Mbit/s. */
static double port_mbit(int packet_bytes, int interval_us)
{
    const int packets = (packet_bytes + 1023) / 1024, blocks = (packet_bytes + 3) / 4 + 26 * packets;

    return blocks * BLOCK_MBIT * 125 / interval_us;
}

/* Intel's xHCI, SuperSpeed: 16-byte blocks, 8 more for each packet of 1024 bytes and 32 for each burst. */
static double super_speed_mbit(int packet_bytes, int interval_us)
{
    const int packets = (packet_bytes + 1023) / 1024;
    const int blocks = (packet_bytes + 15) / 16 + 8 * packets + 32;

    return blocks * 128.0 / interval_us;
}

static double cost(const struct place *p, const struct sst_usb_alt *alt)
{
    switch (p->kind) {
    case HIGH_SPEED:
        return high_speed_mbit(alt->packet_bytes, alt->interval_us);
    case HIGH_SPEED_PORT:
        return port_mbit(alt->packet_bytes, alt->interval_us);
    case FULL_SPEED:
    case TRANSLATOR:
        return full_speed_mbit(alt->packet_bytes, alt->interval_us);
    case SUPER_SPEED:
        break;
    }
    return super_speed_mbit(alt->packet_bytes, alt->interval_us);
}

/* Cost of a stream behind a translator on the bus above: Intel counts 125 blocks for each translator in use; the EHCI
 * driver of Linux up to 188 bytes of each stream per microframe. */
static double cost_above(const struct place *p, bool tt_used, const struct sst_usb_alt *alt)
{
    if (p->kind == HIGH_SPEED_PORT)
        return tt_used ? 0 : 125 * BLOCK_MBIT;
    return high_speed_mbit(sst_min_int(alt->packet_bytes, 188), 125);
}

/* 5 Gbit/s carry 8 bits in 10, faster links 128 in 132. */
static double limit(const struct place *p)
{
    if (p->kind == FULL_SPEED || p->kind == TRANSLATOR)
        return 0.9 * 12;
    if (p->kind != SUPER_SPEED)
        return 0.8 * 480;
    return 0.9 * p->link_mbit * (p->link_mbit > 5000 ? 128.0 / 132 : 0.8);
}

/* --- routes ------------------------------------------------------------------------------------------------------- */

static int port_number(const struct sst_usb_device *d)
{
    const char *last = strrchr(d->port, '.');

    if (!last)
        last = strrchr(d->port, '-');
    return last ? atoi(last + 1) : 0;
}

static void add_place(struct route *r, struct place p)
{
    if (r->n < PATH_MAX_SEGMENTS)
        r->place[r->n++] = p;
}

/* USB allows five hubs in a row; a longer chain ends at the limit of add_place(). */
static struct route find_route(const struct sst_usb_device *devices, int device)
{
    const struct sst_usb_device *d = &devices[device];
    const bool super = d->speed_mbit >= 5000;
    bool full = d->speed_mbit < 480; /* here; high speed above a translator */
    struct route r = { .n = 0 };

    for (int hub; (hub = devices[device].parent) >= 0; device = hub) {
        const int port = port_number(&devices[device]);
        const bool root = devices[hub].parent < 0, fast_hub = devices[hub].speed_mbit >= 480;

        if (super) {
            add_place(&r, (struct place){ SUPER_SPEED, hub, port, devices[device].speed_mbit });
        } else if (full && fast_hub && !root) {
            add_place(&r, (struct place){ TRANSLATOR, hub, devices[hub].single_tt ? 0 : port, 0 });
            full = false;
        } else if (root && full) {
            add_place(&r, (struct place){ FULL_SPEED, hub, fast_hub ? port : 0, 0 });
        } else if (root && devices[hub].port_buses) {
            add_place(&r, (struct place){ HIGH_SPEED_PORT, hub, port, 0 });
        } else if (root) {
            add_place(&r, (struct place){ HIGH_SPEED, hub, 0, 0 });
        }
    }
    return r;
}

/* --- segments ----------------------------------------------------------------------------------------------------- */

static void name_segment(struct sst_usb_segment *s, const struct place *p, const struct sst_usb_device *hub)
{
    static const char *const kinds[] = { "high-speed", "high-speed", "full-speed", "", "SuperSpeed" };

    if (p->kind == TRANSLATOR && p->port)
        snprintf(s->name, sizeof(s->name), "hub %.40s port %d (TT)", hub->port, p->port);
    else if (p->kind == TRANSLATOR)
        snprintf(s->name, sizeof(s->name), "hub %.40s (TT)", hub->port);
    else if (hub->parent >= 0)
        snprintf(s->name, sizeof(s->name), "SuperSpeed link of port %.30s.%d", hub->port, p->port);
    else if (p->port)
        snprintf(s->name, sizeof(s->name), "%s port %d-%d of controller %.24s", kinds[p->kind], hub->bus, p->port,
                 hub->controller);
    else
        snprintf(s->name, sizeof(s->name), "%s bus of controller %.30s", kinds[p->kind], hub->controller);
}

static bool same_place(const struct place *a, const struct place *b)
{
    return a->kind == b->kind && a->hub == b->hub && a->port == b->port;
}

/* @return the segment at that place, created if it is new */
static struct segment *at_place(struct segment *segments, int *n, const struct place *p,
                                const struct sst_usb_device *devices)
{
    struct segment *s = segments;

    while (s < segments + *n && !same_place(&s->place, p))
        s++;
    if (s == segments + *n) {
        *s = (struct segment){ .place = *p };
        s->out.limit_mbit = limit(p);
        name_segment(&s->out, p, &devices[p->hub]);
        ++*n;
    }
    return s;
}

/* --- choosing a setting ------------------------------------------------------------------------------------------- */

/* Selection as in uvcvideo: the smallest packet that carries the maximum the camera reports. If that is unknown, the
 * camera is assumed to request its largest. */
static const struct sst_usb_alt *choose(const struct sst_usb_device *d, int64_t needed_bytes_s)
{
    const struct sst_usb_alt *best = NULL, *largest = NULL;

    for (int i = 0; i < d->alts; i++) {
        const struct sst_usb_alt *a = &d->alt[i];
        const int64_t needed = (needed_bytes_s * a->interval_us + PER_S_US - 1) / PER_S_US + PAYLOAD_HEADER;

        if (!a->isochronous)
            continue;
        if (!largest || a->packet_bytes > largest->packet_bytes)
            largest = a;
        if (a->packet_bytes >= needed && (!best || a->packet_bytes < best->packet_bytes))
            best = a;
    }
    return needed_bytes_s ? best : largest;
}

/* Assumed packet of a camera with unreadable descriptors. */
static struct sst_usb_alt worst(int speed_mbit)
{
    const int packet = speed_mbit >= 5000 ? 16 * 1024 : speed_mbit == 480 ? 3 * 1024 : 1023;

    return (struct sst_usb_alt){ -1, true, packet, speed_mbit < 480 ? 1000 : 125 };
}

static bool streams_in_bulk(const struct sst_usb_device *d)
{
    for (int i = 0; i < d->alts; i++) {
        if (d->alt[i].isochronous)
            return false;
    }
    return d->alts > 0;
}

/* --- the plan ----------------------------------------------------------------------------------------------------- */

/* Cost of the stream on a segment. */
static double added(const struct route *r, struct segment *const *segment, int i, const struct sst_usb_alt *alt)
{
    if (i > 0 && r->place[i - 1].kind == TRANSLATOR)
        return cost_above(&r->place[i], segment[i - 1]->tt_used, alt);
    return cost(&r->place[i], alt);
}

/* Segments of the streams planned so far. */
struct planning {
    const struct sst_usb_device *devices;
    struct segment *segments;
    int n;
};

/* Without `alt` the stream reserves nothing; it is refused unless `possible`. */
static void reserve(struct sst_usb_stream *stream, const struct route *r, const struct sst_usb_alt *alt, bool possible,
                    struct planning *p)
{
    struct segment *segment[PATH_MAX_SEGMENTS];
    double add[PATH_MAX_SEGMENTS], fullest = -1;

    stream->fits = possible;
    for (int i = 0; i < r->n; i++)
        segment[i] = at_place(p->segments, &p->n, &r->place[i], p->devices);
    for (int i = 0; i < r->n; i++) {
        const struct sst_usb_segment *s = &segment[i]->out;
        double load;

        add[i] = alt ? added(r, segment, i, alt) : 0;
        load = (s->reserved_mbit + add[i]) / s->limit_mbit;
        stream->fits = stream->fits && load <= 1 + 1e-9;
        if (load > fullest) {
            fullest = load;
            stream->segment = (int)(segment[i] - p->segments);
            stream->reserved_mbit = add[i];
        }
    }
    for (int i = 0; i < r->n; i++) {
        segment[i]->out.streams += stream->fits;
        segment[i]->out.refused += !stream->fits && segment[i] - p->segments == stream->segment;
        segment[i]->out.reserved_mbit += stream->fits ? add[i] : 0;
        segment[i]->tt_used = segment[i]->tt_used || (stream->fits && alt);
    }
}

static void plan_stream(struct sst_usb_stream *stream, struct planning *p)
{
    const struct sst_usb_device *d = &p->devices[stream->device];
    const struct route r = find_route(p->devices, stream->device);
    const struct sst_usb_alt *alt = choose(d, stream->needed_bytes_s), guess = worst(d->speed_mbit);
    const bool bulk = streams_in_bulk(d);

    stream->alt = alt ? alt->number : bulk ? d->alt[0].number : -1;
    stream->reserved_mbit = 0;
    stream->segment = 0;
    if (!d->alts)
        alt = &guess;
    reserve(stream, &r, alt, alt || bulk, p);
}

int sst_usb_plan(struct sst_usb_plan *out, const struct sst_usb_device *devices, int count SST_UNUSED,
                 struct sst_usb_stream *streams, int stream_count)
{
    struct segment *segments = calloc((size_t)stream_count * PATH_MAX_SEGMENTS + 1, sizeof(*segments));
    struct planning p = { devices, segments, 0 };
    struct sst_usb_plan plan = { 0 };

    plan.segments = segments ? calloc((size_t)stream_count * PATH_MAX_SEGMENTS + 1, sizeof(*plan.segments)) : NULL;
    if (!plan.segments) {
        free(segments);
        sst_log_error("planning USB bandwidth: out of memory");
        return -ENOMEM;
    }
    for (int i = 0; i < stream_count; i++) {
        plan_stream(&streams[i], &p);
        plan.refused += !streams[i].fits;
    }
    for (int i = 0; i < p.n; i++)
        plan.segments[i] = segments[i].out;
    plan.segment_count = p.n;
    free(segments);
    *out = plan;
    return 0;
}

int64_t sst_usb_format_bytes_s(uint32_t fourcc, int width, int height, double rate_hz)
{
    static const struct {
        char name[5];
        int bits;
    } raw[] = {
        { "YUYV", 16 }, { "YVYU", 16 }, { "UYVY", 16 }, { "VYUY", 16 }, { "Y16 ", 16 }, { "Y10 ", 16 },
        { "Y12 ", 16 }, { "GREY", 8 },  { "BA81", 8 },  { "GBRG", 8 },  { "GRBG", 8 },  { "RGGB", 8 },
        { "NV12", 12 }, { "NV21", 12 }, { "YU12", 12 }, { "YV12", 12 }, { "RGBP", 16 }, { "RGB3", 24 },
        { "BGR3", 24 }, { "BG16", 16 }, { "RG16", 16 }, { "GB16", 16 }, { "BYR2", 16 },
    };

    for (size_t i = 0; i < ARRAY_LEN(raw); i++) {
        const char *c = raw[i].name;
        const uint32_t code = (uint32_t)c[0] | (uint32_t)c[1] << 8 | (uint32_t)c[2] << 16 | (uint32_t)c[3] << 24;

        if (code == fourcc)
            return (int64_t)((double)width * height * raw[i].bits / 8 * rate_hz + 0.5);
    }
    return 0;
}
