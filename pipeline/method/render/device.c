/* Pictures on a device: the light field lies there in chunks, each a set of buffers with the pixels of several views.
 *
 * A picture is a dispatch of `blend` per run of views that share a chunk. What does not fit is replaced while the
 * picture is made, the views that were used least recently first; pictures too large for a buffer are made in bands of
 * rows. The order of the views' rays, and so the bytes, stay the same.
 *
 * Of a light field that changes, rows of tiles with a later serial number than the view's on the device are uploaded
 * again when a picture needs the view.
 *
 * A device that fails is closed. The picture in work and the next ones are then rendered on the CPU, one more after
 * each failure, twice as many each time; then the device is opened again. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/gpu/backoff.h"
#include "pipeline/gpu/blend.h"
#include "pipeline/method/render/render_internal.h"

#define PACK_ROWS   64                                  /* that a thread packs at once */
#define SUM_BYTES   20                                  /* of a pixel of the picture: four sums and the result */
#define PIXEL_BYTES 7                                   /* of a pixel of a view: colour and label, disparity, valid */
#define ROW_BYTES   (SST_BLEND_COLUMNS * sizeof(float)) /* of the table of label weights */
#define NONE        (-1)

/* Room for one view. */
struct slot {
    int chunk, index; /* index-th view of the chunk */
    int view;         /* NONE: free */
    int64_t used;     /* turn in which it was used last */
    bool pending;     /* the next dispatch reads it */
    /* of a light field that changes: what the view here is as of */
    uint64_t serial, since;
    double disp_min_px;
    unsigned maps;
};

struct chunk {
    struct sst_gpu_buffer *pixels, *disp, *valid;
};

struct render_device {
    pthread_mutex_t lock;
    const struct sst_lightfield *lf;
    char name[SST_GPU_NAME]; /* as asked for */
    struct sst_gpu_config cfg;
    int pitch; /* pixels of a row of a view on the device */
    bool changes; /* lf does, as `live` has it */
    struct sst_render_live live;
    /* under lock */
    struct sst_gpu *gpu; /* NULL: it failed, or was not opened again yet */
    struct sst_gpu_backoff backoff;
    bool given_up; /* it computes something else: not opened again */
    bool noted;    /* that a clear picture is the CPU's */
    struct sst_render_device_report report;
    /* of gpu */
    struct chunk *chunk;
    int chunks;
    struct slot *slot;
    int slots;
    bool full; /* no more chunks fit */
    int64_t turn;
    struct sst_gpu_buffer *params, *table, *sums, *out;
    struct sst_gpu_buffer *clear_params, *landed, *masks; /* of clear pictures, of this many views: */
    int clear_views;
    int rows;          /* of the picture that sums and out hold */
    size_t table_rows; /* that table holds */
    /* host memory, reused */
    struct sst_mem_kept packed, words, weights;
};

/* --- opening and failing ------------------------------------------------------------------------------------------ */

/* Free what lies on the device. */
static void drop(struct render_device *d)
{
    for (int i = 0; i < d->chunks; i++) {
        sst_gpu_buffer_destroy(d->gpu, d->chunk[i].pixels);
        sst_gpu_buffer_destroy(d->gpu, d->chunk[i].disp);
        sst_gpu_buffer_destroy(d->gpu, d->chunk[i].valid);
    }
    sst_gpu_buffer_destroy(d->gpu, d->params);
    sst_gpu_buffer_destroy(d->gpu, d->table);
    sst_gpu_buffer_destroy(d->gpu, d->sums);
    sst_gpu_buffer_destroy(d->gpu, d->out);
    sst_gpu_buffer_destroy(d->gpu, d->clear_params);
    sst_gpu_buffer_destroy(d->gpu, d->landed);
    sst_gpu_buffer_destroy(d->gpu, d->masks);
    d->params = d->table = d->sums = d->out = d->clear_params = d->landed = d->masks = NULL;
    d->clear_views = 0;
    d->chunks = d->slots = d->rows = 0;
    d->table_rows = 0;
    d->full = false;
}

static void close_gpu(struct render_device *d)
{
    if (!d->gpu)
        return;
    drop(d);
    sst_gpu_close(d->gpu);
    d->gpu = NULL;
}

static int open_gpu(struct render_device *d)
{
    int err = sst_gpu_open(&d->gpu, d->name, &d->cfg);

    if (err) {
        d->gpu = NULL;
        return err;
    }
    err = sst_gpu_prepare(d->gpu, SST_GPU_BLEND);
    if (err) {
        sst_log_error("the device `%s` cannot render: %s; choose another %s", d->name, sst_gpu_error(err),
                      d->changes ? "one" : "--device");
        close_gpu(d);
        return err;
    }
    snprintf(d->report.name, sizeof(d->report.name), "%s", sst_gpu_get_info(d->gpu)->name);
    snprintf(d->report.driver, sizeof(d->report.driver), "%s", sst_gpu_get_info(d->gpu)->driver);
    return 0;
}

/* Note that a picture is rendered on the CPU, and why. */
static void note_cpu(struct render_device *d, const char *why)
{
    d->report.on_cpu++;
    snprintf(d->report.why, sizeof(d->report.why), "%s", why);
}

/* After an error of the device: close it, and leave it alone for some pictures; for good where it computes something
 * else. @param why  "": the error's own */
static void fail(struct render_device *d, int err, const char *why)
{
    const int skipped = sst_gpu_backoff_fail(&d->backoff);

    why = *why ? why : sst_gpu_error(err);
    if (!d->changes)
        sst_log_warning("%s: %s; the picture is rendered on the CPU, and the device is opened again after %d more",
                        d->report.name, why, skipped);
    else if (!d->report.failing)
        sst_log_warning("%s: %s; live pictures are rendered on the CPU%s", d->report.name, why,
                        err == -ENOTSUP ? "" : ", and the device is tried again now and then");
    snprintf(d->report.failure, sizeof(d->report.failure), "%s", why);
    d->report.failing = true;
    d->report.failures++;
    close_gpu(d);
    d->given_up = err == -ENOTSUP;
}

static void note_success(struct render_device *d)
{
    if (d->report.failing && d->changes)
        sst_log_info("%s: live pictures are rendered on the device again", d->report.name);
    d->report.failing = false;
    d->report.pictures++;
    sst_gpu_backoff_succeed(&d->backoff);
}

/* Open the device; of a light field that changes, what errors say is kept, and the device is tried again later.
 * @return 0, -ENOENT ("auto" without a GPU), -ENOMEM; else only where the light field does not change */
static int open_first(struct render_device *d)
{
    char text[SST_LOG_MAX] = "", *before = NULL;
    int err;

    if (d->changes)
        before = sst_log_hold_errors(text);
    err = open_gpu(d);
    if (d->changes)
        sst_log_hold_errors(before);
    if (!err || !d->changes || (err == -ENOENT && !strcmp(d->name, "auto")))
        return err;
    fail(d, err, text);
    return 0;
}

/* Open a device that failed. @return false: it fails again */
static bool open_again(struct render_device *d)
{
    char text[SST_LOG_MAX] = "", *before = NULL;
    int err;

    if (d->changes)
        before = sst_log_hold_errors(text);
    err = open_gpu(d);
    if (d->changes)
        sst_log_hold_errors(before);
    if (!err)
        return true;
    fail(d, err, text);
    note_cpu(d, sst_gpu_error(err));
    return false;
}

int render_device_create(struct render_device **out, const struct sst_lightfield *lf, const char *name,
                         const struct sst_gpu_config *cfg, const struct sst_render_live *live)
{
    const size_t views = (size_t)(lf->rows * lf->cols);
    struct render_device *d = calloc(1, sizeof(*d));
    int err = d ? 0 : -ENOMEM;

    if (!err) {
        pthread_mutex_init(&d->lock, NULL);
        d->lf = lf;
        d->cfg = *cfg;
        d->changes = live;
        d->live = live ? *live : (struct sst_render_live){ 0 };
        d->pitch = (lf->width + 3) / 4 * 4;
        snprintf(d->name, sizeof(d->name), "%s", name);
        snprintf(d->report.name, sizeof(d->report.name), "%s", name);
        d->chunk = calloc(views, sizeof(*d->chunk));
        d->slot = calloc(views, sizeof(*d->slot));
        err = d->chunk && d->slot ? 0 : -ENOMEM;
    }
    if (err)
        sst_log_error("not enough memory for a device");
    else
        err = open_first(d);
    if (err) {
        render_device_destroy(d);
        return err;
    }
    *out = d;
    return 0;
}

void render_device_destroy(struct render_device *d)
{
    if (!d)
        return;
    close_gpu(d);
    sst_mem_kept_fini(&d->packed);
    sst_mem_kept_fini(&d->words);
    sst_mem_kept_fini(&d->weights);
    free(d->chunk);
    free(d->slot);
    pthread_mutex_destroy(&d->lock);
    free(d);
}

/* --- views on the device ------------------------------------------------------------------------------------------ */

static size_t view_pixels(const struct render_device *d)
{
    return (size_t)d->pitch * (size_t)d->lf->height;
}

/* Buffers of a chunk of n views. */
static int create_chunk(struct render_device *d, int n)
{
    struct chunk *c = &d->chunk[d->chunks];
    const size_t pixels = (size_t)n * view_pixels(d);
    int err;

    *c = (struct chunk){ NULL, NULL, NULL };
    err = sst_gpu_buffer_create(d->gpu, &c->pixels, 4 * pixels);
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &c->disp, 2 * pixels);
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &c->valid, pixels);
    if (err) {
        sst_gpu_buffer_destroy(d->gpu, c->pixels);
        sst_gpu_buffer_destroy(d->gpu, c->disp);
        sst_gpu_buffer_destroy(d->gpu, c->valid);
        return err;
    }
    for (int i = 0; i < n; i++)
        d->slot[d->slots++] = (struct slot){ .chunk = d->chunks, .index = i, .view = NONE };
    d->chunks++;
    return 0;
}

/* More room: a chunk of as many views as fit, or half of them, and so on. @return -ENOMEM: nothing fits */
static int grow(struct render_device *d)
{
    const size_t bytes = 4 * view_pixels(d);
    int n = d->lf->rows * d->lf->cols - d->slots, err = -ENOMEM;

    n = (int)sst_clamp_double((double)(sst_gpu_get_info(d->gpu)->buffer_bytes / bytes), 0, n);
    n = sst_min_int(n, (int)(sst_gpu_free_bytes(d->gpu) / (PIXEL_BYTES * view_pixels(d))));
    for (; n > 0 && err == -ENOMEM; n /= 2)
        err = create_chunk(d, n);
    d->full = err == -ENOMEM;
    return err;
}

struct packing {
    const struct sst_view *v;
    int pitch, top, end; /* rows */
    uint32_t *pixels;
    uint16_t *disp;
    uint8_t *valid;
};

static int pack_rows(void *arg, int index, int worker SST_UNUSED)
{
    const struct packing *p = arg;
    const struct sst_image *img = &p->v->image;
    const int from = p->top + index * PACK_ROWS, end = sst_min_int(from + PACK_ROWS, p->end);
    const size_t width = (size_t)img->width;

    for (int y = from; y < end; y++) {
        const uint8_t *r = sst_image_row(img, 0, y), *g = sst_image_row(img, 1, y), *b = sst_image_row(img, 2, y);
        const uint8_t *label = p->v->label.data ? sst_map_u8_row(&p->v->label, y) : NULL;
        const size_t at = (size_t)(y - p->top) * (size_t)p->pitch;
        uint32_t *to = p->pixels + at;

        for (size_t x = 0; x < width; x++)
            to[x] = (uint32_t)(r[x] | g[x] << 8 | b[x] << 16) | (label ? (uint32_t)label[x] << 24 : 0);
        if (p->v->disp.data)
            memcpy(p->disp + at, sst_map_u16_row(&p->v->disp, y), 2 * width);
        if (p->v->valid.data)
            memcpy(p->valid + at, sst_map_u8_row(&p->v->valid, y), width);
    }
    return 0;
}

/* Upload the rows top .. end-1 of a view. */
static int upload_rows(struct render_device *d, const struct slot *s, int view, int top, int end, int threads)
{
    const struct sst_view *v = &d->lf->views[view];
    const size_t n = (size_t)(end - top) * (size_t)d->pitch;
    const size_t at = (size_t)s->index * view_pixels(d) + (size_t)top * (size_t)d->pitch;
    uint8_t *memory = sst_mem_keep(&d->packed, n, PIXEL_BYTES);
    struct packing p = { v, d->pitch, top, end, (uint32_t *)(void *)memory, NULL, NULL };
    const struct chunk *c = &d->chunk[s->chunk];
    const int64_t start_ns = sst_clock_now_ns();
    int err;

    if (!memory)
        return -ENOMEM;
    p.disp = (uint16_t *)(void *)(memory + 4 * n);
    p.valid = memory + 6 * n;
    err = sst_parallel_for((end - top + PACK_ROWS - 1) / PACK_ROWS, threads, pack_rows, &p);
    if (!err)
        err = sst_gpu_upload(d->gpu, c->pixels, 4 * at, p.pixels, 4 * n);
    if (!err && v->disp.data)
        err = sst_gpu_upload(d->gpu, c->disp, 2 * at, p.disp, 2 * n);
    if (!err && v->valid.data)
        err = sst_gpu_upload(d->gpu, c->valid, at, p.valid, n);
    if (err)
        return err;
    d->report.upload_bytes += (int64_t)(n * (4U + (v->disp.data ? 2U : 0) + (v->valid.data ? 1U : 0)));
    d->report.upload_ns += sst_clock_now_ns() - start_ns;
    return 0;
}

/* Which maps a view has, as bits. */
static unsigned maps_of(const struct sst_view *v)
{
    return (v->disp.data ? 1U : 0) | (v->label.data ? 2U : 0) | (v->valid.data ? 4U : 0);
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
static void note_version(const struct render_device *d, struct slot *s)
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

static int upload_view(struct render_device *d, struct slot *s, int view, int threads)
{
    int err;

    s->view = NONE; /* half a view is none */
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
static int refresh_view(struct render_device *d, struct slot *s, int threads)
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
    s->view = NONE;
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

/* Have a view in a slot as it is now. */
static int place_view(struct render_device *d, struct slot *s, int view, int threads)
{
    return s->view == view ? refresh_view(d, s, threads) : upload_view(d, s, view, threads);
}

/* The slot of a view, if it is on the device. */
static struct slot *find_slot(struct render_device *d, int view)
{
    for (int i = 0; i < d->slots; i++) {
        if (d->slot[i].view == view)
            return &d->slot[i];
    }
    return NULL;
}

/* A slot that may be overwritten: a free one, else the one that was used least recently. NULL: the next dispatch reads
 * all of them */
static struct slot *free_slot(struct render_device *d)
{
    struct slot *oldest = NULL;

    for (int i = 0; i < d->slots; i++) {
        struct slot *s = &d->slot[i];

        if (s->view == NONE)
            return s;
        if (!s->pending && (!oldest || s->used < oldest->used))
            oldest = s;
    }
    return oldest;
}

/* --- pictures ----------------------------------------------------------------------------------------------------- */

/* Views whose rays the next dispatch sums. */
struct batch {
    const struct sst_render_plan *p;
    struct sst_gpu_blend push;
    int chunk;  /* that they lie in, or the last ones did */
    bool begun; /* views of the band were summed before */
    struct sst_gpu_blend_view view[SST_MAX_VIEWS];
};

static uint32_t flags_of(const struct sst_render_plan *p)
{
    return (p->weighted ? SST_GPU_BLEND_WEIGHTED : 0U) | (p->summed ? SST_GPU_BLEND_SUMMED : 0U) |
           (p->table ? SST_GPU_BLEND_BY_LABEL : 0U) | (p->verifier ? SST_GPU_BLEND_WEIGHTS : 0U);
}

static void begin_batch(struct batch *b, const struct render_device *d, const struct sst_render_plan *p)
{
    b->p = p;
    b->chunk = 0;
    b->begun = false;
    b->push = (struct sst_gpu_blend){ .width = d->lf->width,
                                      .pitch = d->pitch,
                                      .flags = flags_of(p),
                                      .focus_whole_q6 = p->blend.focus_whole_q6,
                                      .focus_part_q6 = p->blend.focus_part_q6,
                                      .scale = p->blend.scale,
                                      .c1 = p->blend.c1,
                                      .first = p->blend.first,
                                      .count = p->blend.count };
    memcpy(b->push.power, p->blend.power, sizeof(b->push.power));
}

/* Rows of a band, as many as fit: sums and results use at most a quarter of the memory. */
static int make_bands(struct render_device *d)
{
    const uint64_t row_bytes = (uint64_t)SUM_BYTES * (uint64_t)d->lf->width;
    const uint64_t quarter = sst_gpu_free_bytes(d->gpu) / 4;
    const uint64_t largest = sst_gpu_get_info(d->gpu)->buffer_bytes;
    int err;

    if (d->rows)
        return 0;
    d->rows = (int)sst_clamp_double((double)((quarter < largest ? quarter : largest) / row_bytes), 0, d->lf->height);
    if (!d->rows)
        return -ENOMEM;
    err = sst_gpu_buffer_create(d->gpu, &d->sums, (size_t)d->rows * (size_t)d->lf->width * 16);
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &d->out, (size_t)d->rows * (size_t)d->lf->width * 4);
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &d->params,
                                    256 * sizeof(struct sst_gpu_blend_label) +
                                        SST_MAX_VIEWS * sizeof(struct sst_gpu_blend_view));
    return err;
}

/* What does not depend on the views. A larger table than before comes first again: views may use all the memory. */
static int make_room(struct render_device *d, const struct sst_render_plan *p)
{
    const size_t rows = sst_render_plan_table_rows(p);
    int err;

    if (rows > d->table_rows)
        drop(d);
    err = make_bands(d);
    if (err || d->table)
        return err;
    d->table_rows = rows;
    return sst_gpu_buffer_create(d->gpu, &d->table, rows * ROW_BYTES);
}

/* The weights by label. */
static int upload_labels(struct render_device *d, const struct sst_render_plan *p)
{
    struct sst_gpu_blend_label label[256];
    int err;

    for (int i = 0; i < 256; i++) {
        const size_t row = p->table ? (size_t)(p->range[i].weight - p->table) / SST_BLEND_COLUMNS : 0;

        label[i] = (struct sst_gpu_blend_label){ (uint32_t)row, p->ends[i] };
    }
    err = sst_gpu_upload(d->gpu, d->params, 0, label, sizeof(label));
    return err || !p->table ? err
                            : sst_gpu_upload(d->gpu, d->table, 0, p->table, sst_render_plan_table_rows(p) * ROW_BYTES);
}

/* Sum the rays of the views gathered. @param last  of the band */
static int send_batch(struct render_device *d, struct batch *b, bool last)
{
    const struct chunk *c = &d->chunk[b->chunk];
    struct sst_gpu_blend push = b->push;
    const struct sst_gpu_work work = {
        .shader = SST_GPU_BLEND,
        .push = &push,
        .buffer = { d->params, c->pixels, c->disp, c->valid, d->table, d->sums, d->out },
        .groups = { (uint32_t)(push.width + SST_GPU_BLEND_GROUP_WIDTH - 1) / SST_GPU_BLEND_GROUP_WIDTH,
                    (uint32_t)(push.rows + SST_GPU_BLEND_GROUP_HEIGHT - 1) / SST_GPU_BLEND_GROUP_HEIGHT, 1 },
    };
    int err = 0;

    push.flags |= (b->begun ? 0U : SST_GPU_BLEND_FIRST) | (last ? SST_GPU_BLEND_LAST : 0U);
    if (push.views)
        err = sst_gpu_upload(d->gpu, d->params, 256 * sizeof(struct sst_gpu_blend_label), b->view,
                             push.views * sizeof(b->view[0]));
    if (!err)
        err = sst_gpu_dispatch(d->gpu, &work);
    for (int i = 0; i < d->slots; i++)
        d->slot[i].pending = false;
    b->push.views = 0;
    b->begun = true;
    d->report.dispatches++;
    return err;
}

static struct sst_gpu_blend_view describe(const struct render_device *d, const struct sst_render_tap *t,
                                          const struct slot *s)
{
    struct sst_gpu_blend_view v = { .ix = t->ix,
                                    .iy = t->iy,
                                    .nx = t->nx,
                                    .ny = t->ny,
                                    .x0 = t->x0,
                                    .x1 = t->x1,
                                    .y0 = t->y0,
                                    .y1 = t->y1,
                                    .aperture = (float)t->aperture,
                                    .first = (uint32_t)((size_t)s->index * view_pixels(d)) };
    int16_t tap[4];

    sst_blend_set_taps(tap, t->fx, t->fy);
    for (int i = 0; i < 4; i++)
        v.tap[i] = tap[i];
    v.flags = (t->fx > 0 ? SST_GPU_VIEW_RIGHT : 0U) | (t->fy > 0 ? SST_GPU_VIEW_BELOW : 0U) |
              (t->v->valid.data ? SST_GPU_VIEW_VALID : 0U) | (t->v->label.data ? SST_GPU_VIEW_LABELS : 0U);
    return v;
}

/* A slot for one more view; the batch is sent if it reads all there are. */
static int find_room(struct render_device *d, struct batch *b, struct slot **out)
{
    struct slot *s = free_slot(d);
    int err = 0;

    if ((!s || s->view != NONE) && !d->full) {
        err = grow(d);
        if (err && (err != -ENOMEM || !d->slots))
            return err;
        s = free_slot(d);
    }
    err = s ? 0 : send_batch(d, b, false);
    *out = s ? s : free_slot(d);
    return err;
}

/* Put a view on the device, where it is not there yet, and its rays into the batch. */
static int add_tap(struct render_device *d, struct batch *b, const struct sst_render_tap *t)
{
    struct slot *s = find_slot(d, t->view);
    int err = s ? 0 : find_room(d, b, &s);

    if (!err && b->push.views && b->chunk != s->chunk)
        err = send_batch(d, b, false);
    if (!err)
        err = place_view(d, s, t->view, sst_thread_count(b->p->cfg.threads));
    if (err)
        return err;
    s->used = ++d->turn;
    s->pending = true;
    b->chunk = s->chunk;
    b->view[b->push.views++] = describe(d, t, s);
    return 0;
}

static int render_band(struct render_device *d, struct batch *b, int top, int rows)
{
    const size_t n = (size_t)rows * (size_t)d->lf->width, at = (size_t)top * (size_t)d->lf->width;
    int64_t start_ns;
    int err = 0;

    b->begun = false;
    b->push.top = top;
    b->push.rows = rows;
    for (int k = 0; k < b->p->count && !err; k++) {
        const struct sst_render_tap *t = &b->p->tap[k];

        if (t->x0 < t->x1 && t->y0 < top + rows && t->y1 > top)
            err = add_tap(d, b, t);
    }
    if (!err)
        err = send_batch(d, b, true);
    if (!err)
        err = sst_gpu_wait(d->gpu);
    start_ns = sst_clock_now_ns();
    if (!err)
        err = sst_gpu_download(d->gpu, (uint32_t *)d->words.data + at, d->out, 0, 4 * n);
    if (!err && b->p->verifier)
        err = sst_gpu_download(d->gpu, (float *)d->weights.data + at, d->sums, 12 * n, 4 * n);
    d->report.download_ns += sst_clock_now_ns() - start_ns;
    return err;
}

static int render_picture(struct render_device *d, const struct sst_render_plan *p, int top, int end)
{
    const size_t n = (size_t)d->lf->width * (size_t)d->lf->height;
    struct batch b;
    int err = make_room(d, p);

    if (!err && (!sst_mem_keep(&d->words, n, 4) || (p->verifier && !sst_mem_keep(&d->weights, n, 4))))
        err = -ENOMEM;
    begin_batch(&b, d, p);
    if (!err)
        err = upload_labels(d, p);
    if (!err && !d->slots)
        err = grow(d); /* a dispatch names buffers even where no view overlaps */
    for (int y = top; y < end && !err; y += d->rows)
        err = render_band(d, &b, y, sst_min_int(d->rows, end - y));
    return err;
}

/* --- clear pictures ----------------------------------------------------------------------------------------------- */

/* Buffers of clear pictures: where rays land, and masks of what is removed where there are any. */
static int make_clear_buffers(struct render_device *d, const struct device_clear *c)
{
    int err = 0;

    if (c->count > d->clear_views) {
        sst_gpu_buffer_destroy(d->gpu, d->landed);
        sst_gpu_buffer_destroy(d->gpu, d->masks);
        d->landed = d->masks = NULL;
        d->clear_views = 0;
        err = sst_gpu_buffer_create(d->gpu, &d->landed, 4 * (size_t)c->count * view_pixels(d));
        d->clear_views = err ? 0 : c->count;
    }
    if (!err && c->remove && !d->masks)
        err = sst_gpu_buffer_create(d->gpu, &d->masks, (size_t)d->clear_views * view_pixels(d));
    if (!err && !d->clear_params)
        err = sst_gpu_buffer_create(d->gpu, &d->clear_params, SST_GPU_CLEAR_VIEWS * sizeof(c->view[0]));
    return err;
}

/* Put all views into one chunk. @return -ENOMEM: they do not fit into one, or into the memory */
static int gather_views(struct render_device *d, const struct device_clear *c)
{
    const struct slot *first = NULL;
    int err = 0;

    for (int k = 0; k < c->count && !err; k++) {
        struct slot *s = find_slot(d, c->tap[k]->view);

        if (!s && !d->slots)
            err = grow(d);
        if (!s && !err)
            s = free_slot(d);
        first = first ? first : s;
        if (!err && (!s || s->chunk != first->chunk))
            err = -ENOMEM;
        if (!err)
            err = place_view(d, s, c->tap[k]->view, c->threads);
        if (!err) {
            s->used = ++d->turn;
            s->pending = true;
        }
    }
    for (int i = 0; i < d->slots; i++)
        d->slot[i].pending = false;
    return err;
}

static int upload_masks(struct render_device *d, const struct device_clear *c)
{
    uint8_t *memory = sst_mem_keep(&d->packed, view_pixels(d), 1);
    int err = memory ? 0 : -ENOMEM;

    for (int k = 0; k < c->count && !err; k++) {
        const struct sst_map_u8 *mask = &c->remove[c->tap[k]->view];

        if (!mask->data)
            continue;
        for (int y = 0; y < mask->height; y++)
            memcpy(memory + (size_t)y * (size_t)d->pitch, sst_map_u8_row(mask, y), (size_t)mask->width);
        err = sst_gpu_upload(d->gpu, d->masks, (size_t)k * view_pixels(d), memory, view_pixels(d));
    }
    return err;
}

static void describe_clear(struct device_clear *c, struct render_device *d)
{
    for (int k = 0; k < c->count; k++) {
        const struct sst_view *v = c->tap[k]->v;

        c->view[k].first = (uint32_t)((size_t)find_slot(d, c->tap[k]->view)->index * view_pixels(d));
        c->view[k].flags = (v->valid.data ? SST_GPU_CLEAR_VALID : 0U) | (v->label.data ? SST_GPU_CLEAR_LABELS : 0U) |
                           (c->remove && c->remove[c->tap[k]->view].data ? SST_GPU_CLEAR_MASK : 0U);
    }
    c->push.pitch = d->pitch;
    c->push.views = (uint32_t)c->count;
}

/* Land all rays, and colour the pixels. */
static int dispatch_clear(struct render_device *d, const struct device_clear *c)
{
    const struct chunk *from = &d->chunk[find_slot(d, c->tap[0]->view)->chunk];
    struct sst_gpu_clear push = c->push;
    struct sst_gpu_work land = {
        .shader = SST_GPU_CLEAR_LAND,
        .push = &push,
        .buffer = { d->clear_params, from->pixels, from->disp, from->valid, d->masks ? d->masks : from->valid,
                    d->landed },
        .groups = { (uint32_t)(push.width + SST_GPU_CLEAR_GROUP_WIDTH - 1) / SST_GPU_CLEAR_GROUP_WIDTH,
                    (uint32_t)(push.height + SST_GPU_CLEAR_GROUP_HEIGHT - 1) / SST_GPU_CLEAR_GROUP_HEIGHT, push.views },
    };
    const struct sst_gpu_work blend = { .shader = SST_GPU_CLEAR_BLEND,
                                        .push = &push,
                                        .buffer = { d->clear_params, from->pixels, d->landed, d->sums, d->out },
                                        .groups = { land.groups[0], land.groups[1], 1 } };
    int err;

    push.zero = 1;
    err = sst_gpu_dispatch(d->gpu, &land);
    push.zero = 0;
    if (!err)
        err = sst_gpu_dispatch(d->gpu, &land);
    if (!err)
        err = sst_gpu_dispatch(d->gpu, &blend);
    d->report.dispatches += 3;
    return err ? err : sst_gpu_wait(d->gpu);
}

static int render_clear(struct render_device *d, struct device_clear *c)
{
    const size_t n = (size_t)d->lf->width * (size_t)d->lf->height;
    int64_t start_ns;
    int err = make_bands(d);

    if (!err && (d->rows < d->lf->height || !sst_mem_keep(&d->words, n, 4) ||
                 (c->push.merged && !sst_mem_keep(&d->weights, n, 4))))
        err = -ENOMEM;
    if (!err)
        err = make_clear_buffers(d, c);
    if (!err)
        err = gather_views(d, c);
    if (err)
        return err;
    describe_clear(c, d);
    err = sst_gpu_upload(d->gpu, d->clear_params, 0, c->view, (size_t)c->count * sizeof(c->view[0]));
    if (!err && c->remove)
        err = upload_masks(d, c);
    if (!err)
        err = dispatch_clear(d, c);
    start_ns = sst_clock_now_ns();
    if (!err)
        err = sst_gpu_download(d->gpu, d->words.data, d->out, 0, 4 * n);
    if (!err && c->push.merged)
        err = sst_gpu_download(d->gpu, d->weights.data, d->sums, 0, 4 * n);
    d->report.download_ns += sst_clock_now_ns() - start_ns;
    return err;
}

/* --- begin and end ------------------------------------------------------------------------------------------------ */

/* True if the device may be tried; else the picture is noted as one for the CPU. */
static bool may_try(struct render_device *d, const struct sst_render_tap *t)
{
    if (t->sampler) {
        note_cpu(d, "rays are sampled from raw frames");
        return false;
    }
    if (d->given_up || sst_gpu_backoff_skips(&d->backoff)) {
        d->report.on_cpu++;
        return false;
    }
    return d->gpu || open_again(d);
}

bool render_device_begin(struct render_device *d, const struct sst_render_plan *p, int top, int end,
                         const uint32_t **words, const float **weights)
{
    const int64_t start_ns = sst_clock_now_ns();
    int err;

    pthread_mutex_lock(&d->lock);
    err = may_try(d, &p->tap[0]) ? render_picture(d, p, top, end) : 1;
    if (err) {
        if (err < 0) {
            fail(d, err, "");
            note_cpu(d, sst_gpu_error(err));
        }
        pthread_mutex_unlock(&d->lock);
        return false;
    }
    note_success(d);
    d->report.verified_on_cpu += p->verifier != NULL;
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    *words = d->words.data;
    *weights = p->verifier ? d->weights.data : NULL;
    return true;
}

/* Note that a clear picture is the CPU's; live that is logged once. */
static void note_clear(struct render_device *d, int err)
{
    note_cpu(d, err == -EOVERFLOW ? "a clear picture of more views than a device takes"
                : err == -ENOMEM  ? "a clear picture needs all views in one buffer and room for their rays"
                                  : sst_gpu_error(err));
    if (d->changes && !d->noted)
        sst_log_warning("%s: %s; clear pictures are rendered on the CPU", d->report.name, d->report.why);
    d->noted = true;
}

/* The shaders of clear pictures are tested at the first one. What the device cannot hold, or computes differently, is
 * the CPU's; the device is not to blame. */
static int try_clear(struct render_device *d, struct device_clear *c)
{
    int err = c->count > SST_GPU_CLEAR_VIEWS ? -EOVERFLOW : sst_gpu_prepare(d->gpu, SST_GPU_CLEAR_LAND);

    if (!err)
        err = sst_gpu_prepare(d->gpu, SST_GPU_CLEAR_BLEND);
    if (!err)
        err = render_clear(d, c);
    if (err == -EOVERFLOW || err == -ENOTSUP || err == -ENOMEM)
        note_clear(d, err);
    else if (err) {
        fail(d, err, "");
        note_cpu(d, sst_gpu_error(err));
    }
    return err;
}

bool render_device_begin_clear(struct render_device *d, struct device_clear *c, const uint32_t **words,
                               const uint32_t **seen)
{
    const int64_t start_ns = sst_clock_now_ns();

    pthread_mutex_lock(&d->lock);
    if (!may_try(d, c->tap[0]) || try_clear(d, c)) {
        pthread_mutex_unlock(&d->lock);
        return false;
    }
    note_success(d);
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    *words = d->words.data;
    *seen = c->push.merged ? d->weights.data : NULL;
    return true;
}

void render_device_end(struct render_device *d)
{
    pthread_mutex_unlock(&d->lock);
}

void render_device_report(struct render_device *d, struct sst_render_device_report *out)
{
    pthread_mutex_lock(&d->lock);
    *out = d->report;
    out->chunks = d->chunks;
    pthread_mutex_unlock(&d->lock);
}
