/* Parts: several cameras in the picture of one device. Raw pictures are shared as views, JPEGs are cut. A lost or
 * damaged picture is lost or damaged for all its cameras. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/text.h"
#include "drivers/grab/grab_internal.h"
#include "drivers/grab/parts_internal.h"

#define MARK '#' /* between the name of a device and the number of its part */

/* --- names -------------------------------------------------------------------------------------------------------- */

int sst_grab_part_of(char device[SST_GRAB_NAME_MAX], const char *part)
{
    const char *mark = strrchr(part, MARK);
    char *end;
    const long n = mark && mark > part && mark[1] >= '1' && mark[1] <= '9' ? strtol(mark + 1, &end, 10) : 0;
    const bool named = n >= 1 && n <= SST_GRAB_PARTS_MAX && !*end;

    snprintf(device, SST_GRAB_NAME_MAX, "%.*s", named ? (int)(mark - part) : (int)strlen(part), part);
    return named ? (int)n : 0;
}

/* Names that are too long keep their ends, which say the part. */
static void name_part(char name[SST_GRAB_NAME_MAX], int part)
{
    char mark[16];
    const int n = snprintf(mark, sizeof(mark), "%c%d", MARK, part + 1);
    const size_t at = strlen(name);

    if (*name)
        memcpy(name + (at + (size_t)n < SST_GRAB_NAME_MAX ? at : SST_GRAB_NAME_MAX - 1 - (size_t)n), mark,
               (size_t)n + 1);
}

static void name_device(struct sst_grab_device *d, int part)
{
    name_part(d->serial, part);
    name_part(d->port, part);
}

int sst_grab_list_parts(struct sst_grab_device **devices, int *count, int *all, struct sst_grab_split split)
{
    const int parts = split.rows * split.cols, cameras = *count * parts;
    struct sst_grab_device *list;

    if (parts <= 1)
        return 0;
    list = calloc((size_t)(cameras + *all - *count) + 1, sizeof(*list));
    if (!list) {
        sst_log_error("no memory for a list of cameras");
        return -ENOMEM;
    }
    for (int i = 0; i < cameras; i++) {
        list[i] = (*devices)[i / parts];
        name_device(&list[i], i % parts);
    }
    memcpy(list + cameras, *devices + *count, (size_t)(*all - *count) * sizeof(*list));
    *all += cameras - *count;
    *count = cameras;
    free(*devices);
    *devices = list;
    return 0;
}

/* --- cameras and their devices ------------------------------------------------------------------------------------ */

/* The device of a binding, and the part. @return the part, from 0, or -EINVAL */
static int base_of(struct sst_grab_binding *base, const struct sst_grab_binding *b, int parts)
{
    const bool serial = *b->serial;
    int part, other = 0;

    *base = *b;
    if (parts == 1)
        return 0;
    part = sst_grab_part_of(serial ? base->serial : base->port, serial ? b->serial : b->port);
    if (serial && *b->port)
        other = sst_grab_part_of(base->port, b->port);
    return part < 1 || part > parts || (other && other != part) ? -EINVAL : part - 1;
}

static int find_device(struct sst_grab *g, const struct sst_grab_binding *base)
{
    int i = 0;

    while (i < g->cfg.cameras &&
           (strcmp(g->camera[i].binding.serial, base->serial) != 0 ||
            strcmp(g->camera[i].binding.port, base->port) != 0 || g->camera[i].binding.node != base->node))
        i++;
    return i;
}

static void add_device(struct sst_grab *g, const struct sst_grab_binding *base, int cam)
{
    struct grab_camera *d = &g->camera[g->cfg.cameras++];
    char title[sizeof(base->title)];

    d->binding = *base;
    d->number = -1;
    for (int i = 0; i < SST_GRAB_PARTS_MAX; i++)
        d->part[i].cam = -1;
    snprintf(title, sizeof(title), "camera %d", cam);
    snprintf(d->name, sizeof(d->name), "%s%s (%s %s)", *base->title ? base->title : title,
             g->parts > 1 ? " and those beside it" : "", *base->serial ? "serial" : "port",
             *base->serial ? base->serial : base->port);
}

int parts_assign(struct sst_grab *g, const struct sst_grab_config *cfg)
{
    g->cfg.cameras = 0;
    for (int i = 0; i < g->cameras; i++) {
        const struct sst_grab_binding *b = &cfg->bindings[i];
        const char *name = *b->serial ? b->serial : b->port;
        struct sst_grab_binding base;
        const int part = base_of(&base, b, g->parts);
        int device;

        if (part < 0) {
            sst_log_error("camera %d is bound to %s, which names no part of a picture of %dx%d cameras; bind it to "
                          "DEVICE#1 to DEVICE#%d, as `sst cameras` lists them",
                          i, name, cfg->split.rows, cfg->split.cols, g->parts);
            return -EINVAL;
        }
        device = find_device(g, &base);
        if (device == g->cfg.cameras)
            add_device(g, &base, i);
        g->camera[device].part[part].cam = i;
        g->place[i] = (struct grab_place){ device, part };
    }
    return 0;
}

/* --- pictures ----------------------------------------------------------------------------------------------------- */

/* Frames of the parts as views into the picture. */
static void make_views(const struct sst_grab *g, const struct sst_frame *whole)
{
    const size_t pixel = raw_pixel_bytes(whole->fourcc), row = pixel * (size_t)g->part_width;
    const size_t stride = whole->stride ? whole->stride : row * (size_t)g->cfg.split.cols;
    struct sst_frame *part = stream_parts(whole);

    for (int i = 0; i < g->parts; i++) {
        const size_t y = (size_t)(i / g->cfg.split.cols * g->part_height), x = (size_t)(i % g->cfg.split.cols);

        part[i].data = whole->data + y * stride + x * row;
        part[i].stride = stride;
        part[i].row_bytes = row;
        part[i].bytes = stride * (size_t)(g->part_height - 1) + row;
    }
}

/* @return 0, or the cutter's error */
static int cut(const struct sst_grab *g, struct grab_camera *cam, const struct sst_frame *whole)
{
    const struct sst_grab_whole in = { whole->data, whole->bytes, g->cfg.split, g->part_width, g->part_height };
    const struct sst_grab_cutter *cutter = g->cfg.cutter;
    struct sst_frame *part = stream_parts(whole);
    int err = cam->cutter ? 0 : cutter->create(&cam->cutter);

    err = err ? err : cutter->read(cam->cutter, &in, cam->uncut, sizeof(cam->uncut));
    for (int i = 0; !err && i < g->parts; i++) {
        struct sst_grab_piece piece;
        uint8_t *room;

        if (cam->part[i].cam < 0)
            continue;
        err = cutter->cut(cam->cutter, i, &piece, cam->uncut, sizeof(cam->uncut));
        if (err)
            break;
        /* Pictures of a camera are about as large as the last ones: rarely more memory is needed. */
        room = stream_part_room(whole, i, piece.bytes + piece.bytes / 4);
        err = room ? 0 : -ENOMEM;
        if (!err)
            part[i].data = memcpy(room, piece.data, piece.bytes);
        part[i].bytes = piece.bytes;
    }
    return err;
}

void parts_make(struct sst_grab *g, struct grab_camera *cam, struct sst_frame *whole)
{
    struct sst_frame *part = stream_parts(whole);
    int err;

    *cam->uncut = 0;
    for (int i = 0; i < g->parts; i++) {
        part[i] = *whole;
        part[i].width = g->part_width;
        part[i].height = g->part_height;
        part[i].row_bytes = part[i].bytes = 0;
    }
    if (whole->faults & SST_FRAME_BAD)
        return;
    if (raw_pixel_bytes(whole->fourcc)) {
        make_views(g, whole);
        return;
    }
    err = cut(g, cam, whole);
    if (err)
        whole->faults |= err == -EINVAL ? SST_FRAME_MARKER | SST_FRAME_UNFIT : SST_FRAME_MARKER;
}

/* A camera that repeats its picture, while others of its device may go on. */
static bool is_frozen(struct grab_part *p, const struct sst_frame *f)
{
    uint64_t hash = f->row_bytes ? 0 : sst_grab_hash(f->data, f->bytes);
    bool same;

    for (int y = 0; f->row_bytes && y < f->height; y++)
        hash = (hash << 7 | hash >> 57) ^ sst_grab_hash(f->data + (size_t)y * f->stride, f->row_bytes);
    same = p->any && hash == p->hash;
    p->any = true;
    p->hash = hash;
    p->frozen += same;
    return same;
}

void parts_deliver(struct sst_grab *g, struct grab_camera *cam, const struct sst_frame *whole)
{
    struct sst_frame *part = stream_parts(whole);
    const struct sst_frame now = *whole; /* its buffer may be filled again once the last part is released */
    const bool bad = now.faults & SST_FRAME_BAD;
    int bound = 0;

    for (int i = 0; i < g->parts; i++)
        bound += cam->part[i].cam >= 0;
    stream_lend_parts(whole, bound);
    for (int i = 0; i < g->parts; i++) {
        struct grab_part *p = &cam->part[i];
        struct sst_frame *f = &part[i];

        if (p->cam < 0)
            continue;
        bound--;
        f->cam = p->cam;
        f->lost_before = now.lost_before;
        f->faults = now.faults;
        f->t_ns = now.t_ns;
        if (bad)
            f->row_bytes = f->bytes = 0;
        else if (g->cfg.check_frozen && is_frozen(p, f))
            f->faults |= SST_FRAME_FROZEN;
        g->events.frame(g->events.arg, f);
        if (!bound)
            return;
    }
}

void parts_report_state(struct sst_grab *g, struct grab_camera *cam, enum sst_grab_state state, const char *why)
{
    for (int i = 0; g->events.state && i < g->parts; i++)
        if (cam->part[i].cam >= 0)
            g->events.state(g->events.arg, cam->part[i].cam, state, why);
}

/* --- queries ------------------------------------------------------------------------------------------------------ */

enum sst_grab_state sst_grab_camera_state(const struct sst_grab *g, int cam)
{
    return g->camera[g->place[cam].device].state;
}

const struct sst_grab_device *sst_grab_camera_device(const struct sst_grab *g, int cam)
{
    struct grab_camera *d = &g->camera[g->place[cam].device];
    struct grab_part *p = &d->part[g->place[cam].part];

    if (g->parts == 1)
        return &d->device;
    p->device = d->device;
    name_device(&p->device, g->place[cam].part);
    return &p->device;
}

void sst_grab_counters(const struct sst_grab *g, int cam, struct sst_grab_counters *out)
{
    const struct grab_camera *d = &g->camera[g->place[cam].device];

    *out = d->counters;
    for (int bit = 0; g->parts > 1 && bit < (int)ARRAY_LEN(out->fault); bit++)
        if (1u << bit == SST_FRAME_FROZEN)
            out->fault[bit] = d->part[g->place[cam].part].frozen;
}
