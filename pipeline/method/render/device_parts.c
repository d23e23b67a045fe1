/* Clear pictures on a device that does not hold all views and their landed rays: in bands of the picture's rows. Of
 * each view only those rows are uploaded from which rays may land in the band, with what such rays are made of.
 *
 * A ray of stored disparity q moves by floor(q b + c) rows, which is monotonic in q, so that the smallest and the
 * largest disparity bound from where rays come:
 *
 *      view                      picture
 *      top - most - BESIDE   .
 *                            .
 *                            .   top  .   rows move by least .. most
 *                            .   end  .
 *      end - least + BESIDE  .
 *
 * The colour of a ray is found less than a row from where its surface's disparity puts it, between two rows; and a ray
 * that comes from beside what is removed counts less. */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "pipeline/gpu/clear_sample.h"
#include "pipeline/method/render/render_internal.h"

#define BESIDE 3  /* rows around those from which rays land: neighbours, and pixels that colours are made of */
#define FILLED 2  /* rows of the picture, at least: holes are filled from levels of half its size */
#define FEW    16 /* rows: shorter bands upload the same rows again and again */

/* How far the rows of each view move. */
struct moves {
    int least[SST_GPU_CLEAR_VIEWS], most[SST_GPU_CLEAR_VIEWS];
};

/* Bands, and how far views reach into them. */
struct bands {
    struct moves moves;
    int rows;
    bool filled; /* the levels that fill holes are there, too */
};

/* What a band of some rows needs. */
struct needs {
    size_t view_pixels, mask_pixels, landed_pixels, pixels; /* as of struct device_parts */
    size_t levels, state;                                   /* bytes */
};

void device_drop_parts(struct render_device *d)
{
    device_destroy_chunk(d, &d->parts.rows);
    sst_gpu_buffer_destroy(d->gpu, d->parts.masks);
    sst_gpu_buffer_destroy(d->gpu, d->parts.landed);
    sst_gpu_buffer_destroy(d->gpu, d->parts.seen);
    sst_gpu_buffer_destroy(d->gpu, d->parts.out);
    sst_gpu_buffer_destroy(d->gpu, d->parts.levels);
    sst_gpu_buffer_destroy(d->gpu, d->parts.state);
    d->parts = (struct device_parts){ 0 };
}

static void find_moves(struct moves *m, const struct device_clear *c)
{
    const float largest = (float)sst_max_int(sst_min_int(c->push.bins - 1, c->push.cut_q6), 0);

    for (int k = 0; k < c->count; k++) {
        const struct sst_gpu_clear_view *v = &c->view[k];
        const int at[2] = { (int)floorf(v->y_0), (int)floorf(largest * v->y_q6 + v->y_0) };

        m->least[k] = sst_min_int(at[0], at[1]);
        m->most[k] = sst_max_int(at[0], at[1]);
    }
}

/* Rows of a view that a band has room for. */
static int rows_of(const struct render_device *d, const struct moves *m, int k, int rows)
{
    return sst_min_int(d->lf->height, rows + m->most[k] - m->least[k] + 2 * BESIDE);
}

static struct needs needs_of(const struct render_device *d, const struct device_clear *c, const struct bands *b,
                             int rows)
{
    const size_t pitch = (size_t)d->pitch;
    const int filled = sst_max_int(rows, b->filled ? FILLED : 0);
    struct needs n = { .landed_pixels = (size_t)c->count * (size_t)rows * pitch,
                       .pixels = (size_t)filled * (size_t)d->lf->width,
                       .levels = b->filled ? device_hole_bytes(d) : 0 };

    for (int k = 0; k < c->count; k++)
        n.view_pixels += (size_t)rows_of(d, &b->moves, k, rows) * pitch;
    n.state = c->push.sampled ? n.pixels * sizeof(struct sst_gpu_clear_state) : 0;
    n.mask_pixels = c->remove ? n.view_pixels : 0;
    return n;
}

static uint64_t bytes_of(const struct needs *n)
{
    return (uint64_t)n->view_pixels * DEVICE_PIXEL_BYTES + n->mask_pixels + (uint64_t)n->landed_pixels * 4 +
           (uint64_t)n->pixels * 8 + n->levels + n->state + SST_GPU_CLEAR_VIEWS * sizeof(struct sst_gpu_clear_view);
}

/* The most rows of a band that fit in this number of bytes; 0: none. */
static int fit(const struct render_device *d, const struct device_clear *c, const struct bands *b, uint64_t bytes)
{
    const uint64_t buffer = sst_gpu_get_info(d->gpu)->buffer_bytes;
    int least = 0, most = d->lf->height;

    while (least < most) {
        const int rows = (least + most + 1) / 2;
        const struct needs n = needs_of(d, c, b, rows);

        if (bytes_of(&n) <= bytes && 4 * (uint64_t)n.view_pixels <= buffer && 4 * (uint64_t)n.landed_pixels <= buffer)
            least = rows;
        else
            most = rows - 1;
    }
    return least;
}

static int create_parts(struct render_device *d, const struct needs *n)
{
    struct device_parts *p = &d->parts;
    int err = device_create_chunk(d, &p->rows, n->view_pixels, false);

    if (!err && n->mask_pixels)
        err = sst_gpu_buffer_create(d->gpu, &p->masks, n->mask_pixels);
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &p->landed, 4 * n->landed_pixels);
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &p->seen, 4 * n->pixels);
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &p->out, 4 * n->pixels);
    if (!err && n->levels)
        err = sst_gpu_buffer_create(d->gpu, &p->levels, n->levels);
    if (!err && n->state)
        err = sst_gpu_buffer_create(d->gpu, &p->state, n->state);
    if (!err && !d->clear_params)
        err = sst_gpu_buffer_create(d->gpu, &d->clear_params, SST_GPU_CLEAR_VIEWS * sizeof(struct sst_gpu_clear_view));
    if (err) {
        device_drop_parts(d);
        return err;
    }
    p->view_pixels = n->view_pixels;
    p->mask_pixels = n->mask_pixels;
    p->landed_pixels = n->landed_pixels;
    p->pixels = n->pixels;
    return 0;
}

static bool is_there(const struct device_parts *p, const struct needs *n)
{
    return p->view_pixels >= n->view_pixels && p->mask_pixels >= n->mask_pixels &&
           p->landed_pixels >= n->landed_pixels && p->pixels >= n->pixels && (p->levels || !n->levels) &&
           (p->state || !n->state);
}

/* Bands of about the same height, with what they need on the device: half of its memory, so that pictures of other
 * kinds find their views there again; all of it where that is little. @param b  in: rows at most; out: of a band */
static int make_parts(struct render_device *d, const struct device_clear *c, struct bands *b)
{
    int err = -ENOMEM;

    for (int most = b->rows; most > 0 && err == -ENOMEM; most = b->rows / 2) {
        const int bands = (d->lf->height + most - 1) / most;
        struct needs n;

        b->rows = (d->lf->height + bands - 1) / bands;
        n = needs_of(d, c, b, b->rows);
        if (is_there(&d->parts, &n))
            return 0;
        device_drop_parts(d);
        err = 0;
        if (bytes_of(&n) > sst_gpu_free_bytes(d->gpu)) {
            device_drop(d);
            err = c->push.sampled ? device_make_frames(d, c->taps) : 0;
        }
        if (!err)
            err = create_parts(d, &n);
    }
    return err;
}

/* Which rows of the views a band needs, one view behind the other. */
static void describe_band(struct device_clear *c, const struct render_device *d, const struct moves *m, int top,
                          int rows)
{
    const int height = d->lf->height;
    uint32_t first = 0;

    for (int k = 0; k < c->count; k++) {
        struct sst_gpu_clear_view *v = &c->view[k];

        v->top = sst_clamp_int(top - m->most[k] - BESIDE, 0, height);
        v->end = sst_clamp_int(top + rows - m->least[k] + BESIDE, v->top, height);
        v->first = first;
        v->flags = device_clear_flags(c, k, false);
        first += (uint32_t)((v->end - v->top) * d->pitch);
    }
    c->push.pitch = d->pitch;
    c->push.views = (uint32_t)c->count;
    c->push.top = top;
    c->push.rows = rows;
}

static int upload_mask(struct render_device *d, const struct device_clear *c, int k)
{
    const struct sst_gpu_clear_view *v = &c->view[k];
    const struct sst_map_u8 *mask = &c->remove[c->tap[k]->view];
    const size_t pitch = (size_t)d->pitch, n = (size_t)(v->end - v->top) * pitch;
    uint8_t *memory = sst_mem_keep(&d->packed, n, 1);

    if (!memory)
        return -ENOMEM;
    for (int y = v->top; y < v->end; y++)
        memcpy(memory + (size_t)(y - v->top) * pitch, sst_map_u8_row(mask, y), (size_t)mask->width);
    return sst_gpu_upload(d->gpu, d->parts.masks, v->first, memory, n);
}

static int upload_band(struct render_device *d, const struct device_clear *c)
{
    int err = sst_gpu_upload(d->gpu, d->clear_params, 0, c->view, (size_t)c->count * sizeof(c->view[0]));

    for (int k = 0; k < c->count && !err; k++) {
        const struct sst_gpu_clear_view *v = &c->view[k];
        struct device_rows rows;

        if (v->top == v->end)
            continue;
        rows = (struct device_rows){ .v = c->tap[k]->v,
                                     .top = v->top,
                                     .end = v->end,
                                     .colours = !(c->push.sampled && c->tap[k]->frame),
                                     .labels = c->push.remove_label };
        err = device_upload_rows(d, &d->parts.rows, v->first, &rows, c->threads);
        if (!err && v->flags & SST_GPU_CLEAR_MASK)
            err = upload_mask(d, c, k);
        d->report.uploads++;
    }
    return err;
}

static int render_band(struct render_device *d, const struct device_clear *c)
{
    const size_t width = (size_t)d->lf->width, n = (size_t)c->push.rows * width, at = (size_t)c->push.top * width;
    const struct device_parts *p = &d->parts;
    int err = upload_band(d, c);
    int64_t start_ns;

    if (!err)
        err = device_dispatch_clear(d, c, &p->rows, p->masks, p->landed, p->seen, p->out);
    start_ns = sst_clock_now_ns();
    if (!err)
        err = sst_gpu_download(d->gpu, (uint32_t *)d->words.data + at, p->out, 0, 4 * n);
    if (!err && c->push.merged)
        err = sst_gpu_download(d->gpu, (uint32_t *)d->weights.data + at, p->seen, 0, 4 * n);
    d->report.download_ns += sst_clock_now_ns() - start_ns;
    return err;
}

/* How high bands are, and whether there is room to fill holes. @return all of the memory is used */
static bool plan_bands(struct bands *b, const struct render_device *d, const struct device_clear *c)
{
    const int few = sst_min_int(FEW, d->lf->height);
    const uint64_t frames = c->push.sampled ? device_frames_bytes(d) : 0;
    const uint64_t limit = d->limit_bytes > frames ? d->limit_bytes - frames : 0;

    find_moves(&b->moves, c);
    b->filled = !*d->why_holes;
    b->rows = fit(d, c, b, limit / 2);
    if (b->rows >= few)
        return false;
    b->rows = fit(d, c, b, limit);
    if (b->rows)
        return true;
    b->filled = false;
    b->rows = fit(d, c, b, limit);
    return true;
}

static int render_bands(struct render_device *d, struct device_clear *c)
{
    const int height = d->lf->height;
    struct bands b;
    const bool all = plan_bands(&b, d, c);
    int err = make_parts(d, c, &b);

    for (int top = 0; top < height && !err; top += b.rows) {
        describe_band(c, d, &b.moves, top, sst_min_int(b.rows, height - top));
        err = render_band(d, c);
    }
    c->filled = !c->push.merged && b.filled;
    if (!err && c->filled)
        err = device_fill_words(d);
    d->parts.all = all;
    if (err && all)
        device_drop_parts(d);
    d->report.in_parts += !err && (b.rows < height || !c->push.sampled);
    return err;
}

int device_render_parts(struct render_device *d, struct device_clear *c)
{
    struct device_taps taps = { .count = c->count, .threads = c->threads, .rays = true };
    int err = 0;

    if (c->push.sampled) {
        memcpy(taps.tap, c->tap, (size_t)c->count * sizeof(c->tap[0]));
        c->taps = &taps;
        err = device_make_frames(d, &taps);
    }
    if (!err)
        err = render_bands(d, c);
    c->taps = NULL;
    return err;
}
