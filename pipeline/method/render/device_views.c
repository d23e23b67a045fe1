/* Views on a device: the light field lies there in chunks, each a set of buffers with the pixels of several views.
 *
 * What does not fit is replaced while a picture is made, the views that were used least recently first. Of a light
 * field that changes, rows of tiles with a later serial number than the view's on the device are uploaded again when a
 * picture needs the view. */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "base/thread.h"
#include "pipeline/method/render/device_internal.h"

#define PACK_ROWS 64 /* that a thread packs at once */

size_t device_view_pixels(const struct render_device *d)
{
    return (size_t)d->pitch * (size_t)d->lf->height;
}

int device_create_chunk(struct render_device *d, struct device_chunk *c, size_t pixels, bool confident)
{
    int err;

    *c = (struct device_chunk){ NULL };
    err = sst_gpu_buffer_create(d->gpu, &c->pixels, 4 * pixels);
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &c->disp, 2 * pixels);
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &c->valid, pixels);
    if (!err && confident)
        err = sst_gpu_buffer_create(d->gpu, &c->confidence, pixels);
    if (err)
        device_destroy_chunk(d, c);
    return err;
}

void device_destroy_chunk(struct render_device *d, struct device_chunk *c)
{
    sst_gpu_buffer_destroy(d->gpu, c->pixels);
    sst_gpu_buffer_destroy(d->gpu, c->disp);
    sst_gpu_buffer_destroy(d->gpu, c->valid);
    sst_gpu_buffer_destroy(d->gpu, c->confidence);
    *c = (struct device_chunk){ NULL };
}

/* A chunk of n views, with their slots. */
static int add_chunk(struct render_device *d, int n)
{
    const int err = device_create_chunk(d, &d->chunk[d->chunks], (size_t)n * device_view_pixels(d), d->doubts);

    if (err)
        return err;
    for (int i = 0; i < n; i++)
        d->slot[d->slots++] = (struct device_slot){ .chunk = d->chunks, .index = i, .view = DEVICE_NO_VIEW };
    d->chunks++;
    return 0;
}

bool device_make_room(struct render_device *d)
{
    return d->runner && sst_runner_make_room(d->runner, &d->user);
}

/* Views that there is memory for. */
static int count_room(const struct render_device *d)
{
    return (int)(sst_gpu_free_bytes(d->gpu) / ((DEVICE_PIXEL_BYTES + d->doubts) * device_view_pixels(d)));
}

int device_grow(struct render_device *d)
{
    const size_t bytes = 4 * device_view_pixels(d);
    int n = d->lf->rows * d->lf->cols - d->slots, err = -ENOMEM;

    n = (int)sst_clamp_double((double)(sst_gpu_get_info(d->gpu)->buffer_bytes / bytes), 0, n);
    n = d->chunk_views ? sst_min_int(n, d->chunk_views) : n;
    if (count_room(d) < n)
        (void)device_make_room(d);
    n = sst_min_int(n, count_room(d));
    for (; n > 0 && err == -ENOMEM; n /= 2)
        err = add_chunk(d, n);
    d->full = err == -ENOMEM;
    return err;
}

struct packing {
    const struct sst_view *v;
    const struct device_rows *rows;
    int width, pitch;
    uint32_t *pixels;
    uint16_t *disp;
    uint8_t *valid, *confidence; /* confidence: NULL if it is not wanted */
};

static void pack_pixels(uint32_t *to, const struct packing *p, int y)
{
    const struct sst_image *img = &p->v->image;
    const uint8_t *label = p->v->label.data && p->rows->labels ? sst_map_u8_row(&p->v->label, y) : NULL;

    if (p->rows->colours) {
        const uint8_t *r = sst_image_row(img, 0, y), *g = sst_image_row(img, 1, y), *b = sst_image_row(img, 2, y);

        for (int x = 0; x < p->width; x++)
            to[x] = (uint32_t)(r[x] | g[x] << 8 | b[x] << 16) | (label ? (uint32_t)label[x] << 24 : 0);
        return;
    }
    for (int x = 0; x < p->width; x++)
        to[x] = label ? (uint32_t)label[x] << 24 : 0;
}

static int pack_rows(void *arg, int index, int worker SST_UNUSED)
{
    const struct packing *p = arg;
    const int from = p->rows->top + index * PACK_ROWS, end = sst_min_int(from + PACK_ROWS, p->rows->end);
    const size_t width = (size_t)p->width;

    for (int y = from; y < end; y++) {
        const size_t at = (size_t)(y - p->rows->top) * (size_t)p->pitch;

        if (p->pixels)
            pack_pixels(p->pixels + at, p, y);
        if (p->v->disp.data)
            memcpy(p->disp + at, sst_map_u16_row(&p->v->disp, y), 2 * width);
        if (p->v->valid.data)
            memcpy(p->valid + at, sst_map_u8_row(&p->v->valid, y), width);
        if (p->confidence)
            memcpy(p->confidence + at, sst_map_u8_row(&p->v->confidence, y), width);
    }
    return 0;
}

int device_upload_rows(struct render_device *d, const struct device_chunk *c, size_t at, const struct device_rows *rows,
                       int threads)
{
    const struct sst_view *v = rows->v;
    const size_t n = (size_t)(rows->end - rows->top) * (size_t)d->pitch;
    uint8_t *memory = sst_mem_keep(&d->packed, n, DEVICE_PIXEL_BYTES + 1);
    struct packing p = { .v = v, .rows = rows, .width = d->lf->width, .pitch = d->pitch };
    const int64_t start_ns = sst_clock_now_ns();
    int err;

    if (!memory)
        return -ENOMEM;
    p.pixels = rows->colours || rows->labels ? (uint32_t *)(void *)memory : NULL;
    p.disp = (uint16_t *)(void *)(memory + 4 * n);
    p.valid = memory + 6 * n;
    p.confidence = c->confidence && v->confidence.data ? memory + 7 * n : NULL;
    err = sst_parallel_for((rows->end - rows->top + PACK_ROWS - 1) / PACK_ROWS, threads, pack_rows, &p);
    if (!err && p.pixels)
        err = sst_gpu_upload(d->gpu, c->pixels, 4 * at, p.pixels, 4 * n);
    if (!err && v->disp.data)
        err = sst_gpu_upload(d->gpu, c->disp, 2 * at, p.disp, 2 * n);
    if (!err && v->valid.data)
        err = sst_gpu_upload(d->gpu, c->valid, at, p.valid, n);
    if (!err && p.confidence)
        err = sst_gpu_upload(d->gpu, c->confidence, at, p.confidence, n);
    if (err)
        return err;
    d->report.upload_bytes += (int64_t)(n * ((p.pixels ? 4U : 0) + (v->disp.data ? 2U : 0) + (v->valid.data ? 1U : 0) +
                                             (p.confidence ? 1U : 0)));
    d->report.upload_ns += sst_clock_now_ns() - start_ns;
    return 0;
}

/* Upload the rows top .. end-1 of a view to its slot. */
static int upload_rows(struct render_device *d, const struct device_slot *s, int view, int top, int end, int threads)
{
    const size_t at = (size_t)s->index * device_view_pixels(d) + (size_t)top * (size_t)d->pitch;

    return device_upload_rows(d, &d->chunk[s->chunk], at,
                              &(struct device_rows){ &d->lf->views[view], top, end, true, true }, threads);
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
static void note_version(const struct render_device *d, struct device_slot *s)
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

static int upload_view(struct render_device *d, struct device_slot *s, int view, int threads)
{
    int err;

    s->view = DEVICE_NO_VIEW; /* half a view is none */
    err = upload_rows(d, s, view, 0, d->lf->height, threads);
    if (err)
        return err;
    s->view = view;
    d->report.uploads++;
    if (d->changes)
        note_version(d, s);
    return 0;
}

/* Upload what changed of the view in a slot, by rows of tiles. */
static int refresh_view(struct render_device *d, struct device_slot *s, int threads)
{
    const struct sst_render_live *live = &d->live;
    const int view = s->view;
    bool any = false;
    int err = 0;

    if (!d->changes)
        return 0;
    if (s->since != *live->since || s->maps != maps_of(&d->lf->views[view]) ||
        fabs(s->disp_min_px - d->lf->disp_min_px) > 0)
        return upload_view(d, s, view, threads);
    s->view = DEVICE_NO_VIEW;
    for (int row = 0, end; row < live->tile_rows && !err; row = end + 1) {
        for (end = row; end < live->tile_rows && row_serial(live, view, end) > s->serial; end++)
            ;
        if (end == row)
            continue;
        any = true;
        err = upload_rows(d, s, view, row * live->tile, sst_min_int(end * live->tile, d->lf->height), threads);
    }
    if (err)
        return err;
    s->view = view;
    d->report.uploads += any;
    note_version(d, s);
    return 0;
}

/* Confidences of a view that is made from a frame, if they are wanted. */
static int upload_confidence(struct render_device *d, struct device_slot *s, int view)
{
    const struct sst_map_u8 *map = &d->lf->views[view].confidence;
    const size_t n = device_view_pixels(d);
    uint8_t *memory;
    int err;

    if (!d->doubts || !map->data || s->confident == view + 1)
        return 0;
    s->confident = 0;
    memory = sst_mem_keep(&d->packed, n, 1);
    if (!memory)
        return -ENOMEM;
    for (int y = 0; y < map->height; y++)
        memcpy(memory + (size_t)y * (size_t)d->pitch, sst_map_u8_row(map, y), (size_t)map->width);
    err = sst_gpu_upload(d->gpu, d->chunk[s->chunk].confidence, (size_t)s->index * n, memory, n);
    if (err)
        return err;
    s->confident = view + 1;
    d->report.upload_bytes += (int64_t)n;
    return 0;
}

int device_place_view(struct render_device *d, struct device_slot *s, const struct sst_render_tap *t, bool sampled,
                      int threads)
{
    const int view = t->view;

    if (t->frame) {
        const int err = device_place_frame(d, s, t, sampled);

        return err ? err : upload_confidence(d, s, view);
    }
    return s->view == view ? refresh_view(d, s, threads) : upload_view(d, s, view, threads);
}

struct device_slot *device_find_slot(struct render_device *d, int view)
{
    for (int i = 0; i < d->slots; i++) {
        if (d->slot[i].view == view)
            return &d->slot[i];
    }
    return NULL;
}

struct device_slot *device_free_slot(struct render_device *d)
{
    struct device_slot *oldest = NULL;

    for (int i = 0; i < d->slots; i++) {
        struct device_slot *s = &d->slot[i];

        if (s->view == DEVICE_NO_VIEW)
            return s;
        if (!s->pending && (!oldest || s->used < oldest->used))
            oldest = s;
    }
    return oldest;
}
