/* Views on a device: the light field lies there in chunks, each a set of buffers with the pixels of several views.
 *
 * A picture has its views there together, in place of the least recently used ones, or it is made in bands
 * (device_band.c). Of a light field that changes, rows of tiles with a later serial number than the view's on the
 * device are uploaded again when a picture needs the view. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "base/thread.h"
#include "pipeline/gpu/rectify.h"
#include "pipeline/method/render/device_internal.h"

#define PACK_ROWS 64 /* that a thread packs at once */

size_t device_view_pixels(const struct render_runner *d)
{
    return (size_t)d->pitch * (size_t)d->lf->height;
}

/* --- chunks ------------------------------------------------------------------------------------------------------- */

static const size_t plane_bytes[DEVICE_PLANES] = { 4, 2, 1, 1 }; /* of a pixel */

static void destroy_chunk(struct render_runner *d, struct device_chunk *c)
{
    for (int i = 0; i < DEVICE_PLANES; i++)
        sst_gpu_buffer_destroy(d->gpu, c->plane[i].buffer);
}

void device_drop_views(struct render_runner *d)
{
    for (int i = 0; i < d->chunks; i++)
        destroy_chunk(d, &d->chunk[i]);
    d->chunks = d->slots = 0;
    d->full = false;
}

/* A chunk of n views, with their slots. */
static int add_chunk(struct render_runner *d, int n)
{
    const size_t pixels = (size_t)n * device_view_pixels(d);
    struct device_chunk *c = &d->chunk[d->chunks];
    int err = 0;

    *c = (struct device_chunk){ .plane = { { NULL, 0 } } };
    for (int i = 0; i < DEVICE_PLANES - !d->doubts && !err; i++)
        err = sst_gpu_buffer_create(d->gpu, &c->plane[i].buffer, plane_bytes[i] * pixels);
    if (err) {
        destroy_chunk(d, c);
        return err;
    }
    for (int i = 0; i < n; i++)
        d->slot[d->slots++] = (struct device_slot){ .chunk = d->chunks, .index = i, .view = DEVICE_NO_VIEW };
    d->chunks++;
    return 0;
}

/* Views that there is memory for. */
static int count_room(const struct render_runner *d)
{
    return (int)(sst_gpu_free_bytes(d->gpu) / ((DEVICE_PIXEL_BYTES + d->doubts) * device_view_pixels(d)));
}

/* More room: a chunk of as many views as fit, or half of them, and so on. */
static void grow(struct render_runner *d)
{
    const size_t bytes = 4 * device_view_pixels(d);
    int n = d->lf->rows * d->lf->cols - d->slots, err = -ENOMEM;

    n = (int)sst_clamp_double((double)(sst_gpu_get_info(d->gpu)->buffer_bytes / bytes), 0, n);
    n = d->chunk_views ? sst_min_int(n, d->chunk_views) : n;
    if (count_room(d) < n && d->runner)
        (void)sst_runner_make_room(d->runner, &d->user);
    n = sst_min_int(n, count_room(d));
    for (; n > 0 && err == -ENOMEM; n /= 2)
        err = add_chunk(d, n);
    d->full = err == -ENOMEM;
    sst_run_fail(d->run, d->full ? 0 : err);
}

/* --- uploads ------------------------------------------------------------------------------------------------------ */

struct packing {
    const struct sst_view *v;
    const struct device_place *to;
    unsigned parts;
    int width, pitch;
    uint8_t *plane[DEVICE_PLANES]; /* NULL: not there, or not wanted */
};

static void pack_pixels(uint32_t *to, const struct packing *p, int y)
{
    const struct sst_image *img = &p->v->image;
    const uint8_t *label = p->v->label.data && p->parts & DEVICE_LABELS ? sst_map_u8_row(&p->v->label, y) : NULL;

    if (p->parts & DEVICE_COLOURS) {
        const uint8_t *r = sst_image_row(img, 0, y), *g = sst_image_row(img, 1, y), *b = sst_image_row(img, 2, y);

        for (int x = 0; x < p->width; x++)
            to[x] = r[x] | (uint32_t)g[x] << 8 | (uint32_t)b[x] << 16;
    } else
        memset(to, 0, (size_t)p->width * sizeof(*to));
    for (int x = 0; label && x < p->width; x++)
        to[x] |= (uint32_t)label[x] << 24;
}

static int pack_rows(void *arg, int index, int worker SST_UNUSED)
{
    const struct packing *p = arg;
    const int from = p->to->top + index * PACK_ROWS, end = sst_min_int(from + PACK_ROWS, p->to->end);
    const size_t width = (size_t)p->width;

    for (int y = from; y < end; y++) {
        const size_t at = (size_t)(y - p->to->top) * (size_t)p->pitch;

        if (p->plane[DEVICE_PIXELS])
            pack_pixels((uint32_t *)(void *)p->plane[DEVICE_PIXELS] + at, p, y);
        if (p->plane[DEVICE_DISP])
            memcpy(p->plane[DEVICE_DISP] + 2 * at, sst_map_u16_row(&p->v->disp, y), 2 * width);
        if (p->plane[DEVICE_VALID])
            memcpy(p->plane[DEVICE_VALID] + at, sst_map_u8_row(&p->v->valid, y), width);
        if (p->plane[DEVICE_CONFIDENCE])
            memcpy(p->plane[DEVICE_CONFIDENCE] + at, sst_map_u8_row(&p->v->confidence, y), width);
    }
    return 0;
}

void device_upload_rows(struct render_runner *d, const struct device_place *to, const struct sst_view *v,
                        unsigned parts, int threads)
{
    const size_t n = (size_t)(to->end - to->top) * (size_t)d->pitch;
    const size_t first = (uint32_t)(to->first + (uint32_t)(to->top * d->pitch));
    const bool there[DEVICE_PLANES] = { parts, v->disp.data, v->valid.data,
                                        v->confidence.data && to->chunk->plane[DEVICE_CONFIDENCE].buffer };
    const int64_t start_ns = sst_clock_now_ns();
    uint8_t *memory = (void *)sst_run_words(d->run, (DEVICE_PIXEL_BYTES + 1) * n / sizeof(uint32_t));
    struct packing p = { .v = v, .to = to, .parts = parts, .width = d->lf->width, .pitch = d->pitch };

    if (!memory)
        return;
    for (int i = 0; i < DEVICE_PLANES; memory += plane_bytes[i++] * n)
        p.plane[i] = there[i] ? memory : NULL;
    sst_run_fail(d->run, sst_parallel_for((to->end - to->top + PACK_ROWS - 1) / PACK_ROWS, threads, pack_rows, &p));
    d->report.upload_ns += sst_clock_now_ns() - start_ns;
    for (int i = 0; i < DEVICE_PLANES; i++) {
        const struct sst_gpu_range at = { to->chunk->plane[i].buffer, plane_bytes[i] * first };

        if (p.plane[i])
            sst_run_write(d->run, at, p.plane[i], plane_bytes[i] * n);
    }
}

/* --- rows --------------------------------------------------------------------------------------------------------- */

size_t device_place_rows(const struct render_runner *d, struct device_taps *taps, const struct device_chunk *c)
{
    const int unit = SST_GPU_RECTIFY_GROUP_HEIGHT;
    size_t at = 0;

    for (int k = 0; k < taps->count; k++) {
        struct device_place *p = &taps->place[k];

        if (taps->tap[k]->frame && !taps->rays)
            p->end = sst_min_int(p->top + (p->end - p->top + unit - 1) / unit * unit, d->lf->height);
        p->chunk = c;
        p->first = (uint32_t)at - (uint32_t)(p->top * d->pitch);
        taps->wanted[k] = taps->rays || p->top < p->end;
        at += (size_t)(p->end - p->top) * (size_t)d->pitch;
    }
    return at;
}

void device_reserve_rows(struct render_runner *d, struct device_chunk *c, size_t pixels, bool confident)
{
    for (int i = 0; i < DEVICE_PLANES - !confident; i++)
        c->plane[i] = sst_run_scratch(d->run, DEVICE_SCRATCH_BAND + i, plane_bytes[i] * (pixels + 4));
}

void device_upload_placed(struct render_runner *d, const struct device_taps *taps, unsigned parts)
{
    for (int k = 0; k < taps->count && !sst_run_failed(d->run); k++) {
        const struct sst_render_tap *t = taps->tap[k];

        if (taps->place[k].top == taps->place[k].end)
            continue;
        if (t->frame && !taps->rays) {
            device_ready_frames(d, taps, k);
            device_make_rows(d, taps, k, &taps->place[k], false);
        } else {
            device_upload_rows(d, &taps->place[k], t->v, parts & ~(t->frame ? DEVICE_COLOURS : 0U), taps->threads);
            d->report.uploads++;
        }
    }
}

/* --- slots -------------------------------------------------------------------------------------------------------- */

/* Rows of the view in a slot. */
static struct device_place place_of(const struct render_runner *d, const struct device_slot *s, int top, int end)
{
    return (struct device_place){ &d->chunk[s->chunk], (uint32_t)((size_t)s->index * device_view_pixels(d)), top, end };
}

/* Which maps a view has, as bits. */
static unsigned maps_of(const struct sst_view *v)
{
    return (v->disp.data ? 1U : 0) | (v->label.data ? 2U : 0) | (v->valid.data ? 4U : 0) |
           (v->confidence.data ? 8U : 0);
}

/* Serial number of the last change in a row of tiles. */
static uint64_t row_serial(const struct sst_render_live *live, int view, int row)
{
    uint64_t last = 0;

    for (int col = 0; col < live->tile_cols; col++) {
        const uint64_t serial = live->stamp[view][row * live->tile_cols + col];

        last = serial > last ? serial : last;
    }
    return last;
}

/* Note what the view in a slot is as of. */
static void note_version(const struct render_runner *d, struct device_slot *s)
{
    s->since = *d->live.since;
    s->disp_min_px = d->lf->disp_min_px;
    s->maps = maps_of(&d->lf->views[s->view]);
    s->serial = 0;
    for (int row = 0; row < d->live.tile_rows; row++) {
        const uint64_t serial = row_serial(&d->live, s->view, row);

        s->serial = serial > s->serial ? serial : s->serial;
    }
}

/* True if rows of a view in a slot, as it was there, need not be uploaded. @param row  of tiles */
static bool is_current(const struct render_runner *d, const struct device_slot *s, int view, int row)
{
    if (s->view != view)
        return false;
    return !d->changes ||
           (s->since == *d->live.since && s->maps == maps_of(&d->lf->views[view]) &&
            !(fabs(s->disp_min_px - d->lf->disp_min_px) > 0) && row_serial(&d->live, view, row) <= s->serial);
}

/* Upload the rows of tiles of a view that the slot lacks. */
static void upload_view(struct render_runner *d, struct device_slot *s, int view, int threads)
{
    const struct device_slot was = *s;
    const int rows = d->changes ? d->live.tile_rows : 1, height = d->changes ? d->live.tile : d->lf->height;
    bool any = false;

    s->view = DEVICE_NO_VIEW; /* half a view is none */
    for (int row = 0, end; row < rows && !sst_run_failed(d->run); row = end + 1) {
        struct device_place to;

        for (end = row; end < rows && !is_current(d, &was, view, end); end++)
            ;
        if (end == row)
            continue;
        any = true;
        to = place_of(d, s, row * height, sst_min_int(end * height, d->lf->height));
        device_upload_rows(d, &to, &d->lf->views[view], DEVICE_COLOURS | DEVICE_LABELS, threads);
    }
    if (sst_run_failed(d->run))
        return;
    s->view = view;
    d->report.uploads += any;
    if (d->changes)
        note_version(d, s);
}

static struct device_slot *find_slot(const struct render_runner *d, int view, int slots)
{
    for (int i = 0; i < slots; i++) {
        if (d->slot[i].view == view)
            return &d->slot[i];
    }
    return NULL;
}

bool device_holds(const struct render_runner *d, const struct device_taps *taps, int k)
{
    const struct sst_render_tap *t = taps->tap[k];
    const struct device_slot *s = find_slot(d, t->view, taps->slots);

    return s && !(fabs(s->part_x - (taps->sampled ? t->fx : 0)) > 0) &&
           !(fabs(s->part_y - (taps->sampled ? t->fy : 0)) > 0);
}

/* A free slot, else the one that was used least recently. There is one that this item does not use. */
static struct device_slot *free_slot(struct render_runner *d, int slots)
{
    struct device_slot *oldest = NULL;

    for (int i = 0; i < slots; i++) {
        struct device_slot *s = &d->slot[i];

        if (s->view == DEVICE_NO_VIEW && s->used != d->turn)
            return s;
        if (s->used != d->turn && (!oldest || s->used < oldest->used))
            oldest = s;
    }
    return oldest;
}

static void place_view(struct render_runner *d, struct device_slot *s, const struct device_taps *taps, int k)
{
    const struct sst_render_tap *t = taps->tap[k];
    const bool mapped = s->view == t->view;

    if (!t->frame) {
        upload_view(d, s, t->view, taps->threads);
    } else if (!device_holds(d, taps, k)) {
        device_ready_frames(d, taps, k);
        s->view = DEVICE_NO_VIEW;
        device_make_rows(d, taps, k, &taps->place[k], mapped);
        if (sst_run_failed(d->run))
            return;
        s->view = t->view;
        s->part_x = taps->sampled ? t->fx : 0;
        s->part_y = taps->sampled ? t->fy : 0;
    }
}

bool device_gather(struct render_runner *d, struct device_taps *taps, bool one)
{
    int n = 0, slots = 0;

    for (int k = 0; k < taps->count; k++)
        n += taps->wanted[k];
    if (!d->slots)
        device_drop_kept(d);
    while (d->slots < sst_max_int(n, 1) && !d->full && !sst_run_failed(d->run))
        grow(d);
    while (slots < d->slots && !(one && d->slot[slots].chunk))
        slots++;
    if (slots < sst_max_int(n, 1)) /* a dispatch names buffers even where there are no rays */
        return false;
    d->held = true;
    taps->slots = slots;
    for (int k = 0; k < taps->count; k++) {
        struct device_slot *s = taps->wanted[k] ? find_slot(d, taps->tap[k]->view, slots) : NULL;

        if (s)
            s->used = d->turn;
    }
    for (int k = 0; k < taps->count && !sst_run_failed(d->run); k++) {
        struct device_slot *s = taps->wanted[k] ? find_slot(d, taps->tap[k]->view, slots) : NULL;

        taps->place[k] = k ? taps->place[k - 1] : (struct device_place){ &d->chunk[0], 0, 0, 0 };
        if (!taps->wanted[k])
            continue;
        s = s ? s : free_slot(d, slots);
        s->used = d->turn;
        taps->place[k] = place_of(d, s, 0, d->lf->height);
        place_view(d, s, taps, k);
    }
    return true;
}
