/* Live views that a device rectifies: their raw frames stay there, and of each set only the tiles that changed are
 * uploaded. The view is made in the slot that pictures read, and what changed of it comes back, since matching and
 * warping read it on the CPU.
 *
 *      frame, changed tiles          on the device                                      image
 *      --> span --> in  --tiles-->  frame  --rectify-->  slot  --tiles-->  out  --> words -->
 *
 * Some views at a time, as buffers for tiles are only so large. In a slot that is filled like this only labels and
 * disparities are uploaded for pictures. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/thread.h"
#include "pipeline/gpu/rectify.h"
#include "pipeline/gpu/tiles.h"
#include "pipeline/method/render/render_internal.h"

#define SHARE 3 /* frames and tiles use at most a third of the memory: the rest is for pictures */
#define GROUP 8 /* views at once, at most */

/* A call, and the part of it in work. */
struct work {
    struct render_device *d;
    const struct sst_render_tiles *tiles;
    enum sst_filter filter;
    int threads, first, count; /* views of this part */
    struct part {
        int dirty, changed;       /* tiles */
        int dirty_at, changed_at; /* the first one's place among those of the part */
        int list_at;              /* its rectangles: dirty ones, then changed ones */
    } part[GROUP];
};

/* Sizes of a view and its frame. */
struct sizes {
    struct sst_rectify_tables t;
    int tile, raw_cols, raw_rows, cols, rows;
};

static struct sizes sizes_of(const struct render_device *d, const struct sst_render_tiles *of, enum sst_filter filter)
{
    struct sizes s = { .tile = d->live.tile, .cols = d->live.tile_cols, .rows = d->live.tile_rows };

    sst_rectify_map_tables(&s.t, of->map, filter);
    s.raw_cols = (s.t.raw_width + s.tile - 1) / s.tile;
    s.raw_rows = (s.t.raw_height + s.tile - 1) / s.tile;
    return s;
}

static size_t tile_pixels(const struct render_device *d)
{
    return (size_t)d->live.tile * (size_t)d->live.tile;
}

/* --- buffers ------------------------------------------------------------------------------------------------------ */

void device_drop_live(struct render_device *d)
{
    struct device_live *l = &d->followed;
    struct sst_gpu_buffer **const all[] = { &l->weights, &l->light, &l->labels, &l->tiles, &l->in, &l->out };

    for (size_t i = 0; i < ARRAY_LEN(all); i++) {
        sst_gpu_buffer_destroy(d->gpu, *all[i]);
        *all[i] = NULL;
    }
    for (int k = 0; l->view && k < d->lf->rows * d->lf->cols; k++) {
        struct device_live_view *v = &l->view[k];

        sst_gpu_buffer_destroy(d->gpu, v->frame);
        sst_gpu_buffer_destroy(d->gpu, v->places);
        sst_gpu_buffer_destroy(d->gpu, v->list);
        *v = (struct device_live_view){ NULL };
    }
    for (int i = 0; i < d->slots; i++)
        d->slot[i].followed = false;
    sst_gpu_span_destroy(d->gpu, l->span);
    l->span = NULL;
    l->group = 0;
}

static int upload_weights(struct render_device *d, const struct sst_rectify_tables *t)
{
    const size_t n = (size_t)SST_RESAMPLE_PHASES * (size_t)t->taps;
    int32_t *weight = sst_mem_keep(&d->packed, n, sizeof(*weight));
    int err = weight ? sst_gpu_buffer_create(d->gpu, &d->followed.weights, n * sizeof(*weight)) : -ENOMEM;

    for (size_t i = 0; i < n && !err; i++)
        weight[i] = t->weight[i];
    return err ? err : sst_gpu_upload(d->gpu, d->followed.weights, 0, weight, n * sizeof(*weight));
}

static size_t light_nodes(const struct sst_rectify_tables *t)
{
    return t->falloff ? (size_t)t->light_cols * (size_t)t->light_rows : 0;
}

/* The table of light, and room for the factors of a view. */
static int make_light(struct render_device *d, const struct sst_rectify_tables *t)
{
    struct device_live *l = &d->followed;
    float *light;
    int err;

    if (l->light && l->light_nodes >= light_nodes(t))
        return 0;
    sst_gpu_buffer_destroy(d->gpu, l->light);
    l->light = NULL;
    l->light_nodes = light_nodes(t);
    light = sst_mem_keep(&d->packed, SST_GPU_RECTIFY_LIGHT_FLOATS, sizeof(*light));
    err = light ? sst_gpu_buffer_create(d->gpu, &l->light,
                                        (SST_GPU_RECTIFY_LIGHT_FLOATS + 2 * l->light_nodes) * sizeof(*light))
                : -ENOMEM;
    if (err)
        return err;
    sst_gpu_rectify_light(light);
    return sst_gpu_upload(d->gpu, l->light, 0, light, SST_GPU_RECTIFY_LIGHT_FLOATS * sizeof(*light));
}

/* Buffers for the tiles of some views, and what they share. Views come first again: they may use all the memory. */
static int make_shared(struct render_device *d, const struct sizes *s)
{
    const int views = d->lf->rows * d->lf->cols, raw = s->raw_cols * s->raw_rows, tiles = s->cols * s->rows;
    const uint64_t bytes = 4 * tile_pixels(d) * (uint64_t)(raw + tiles), share = d->limit_bytes / SHARE;
    const uint64_t frames = (uint64_t)views * 4 * (uint64_t)s->t.raw_width * (uint64_t)s->t.raw_height;
    struct device_live *l = &d->followed;
    int err;

    if (l->out)
        return 0;
    l->group = sst_min_int(views, GROUP);
    while (l->group > 1 && (uint64_t)l->group * bytes > share / 2)
        l->group--;
    if (frames + (uint64_t)l->group * bytes > share)
        return -ENOMEM;
    if (d->slots)
        device_drop(d);
    l->listed = raw + tiles;
    free(l->tile);
    l->tile = calloc((size_t)(l->group * l->listed), sizeof(*l->tile));
    if (!l->view)
        l->view = calloc((size_t)views, sizeof(*l->view));
    err = l->tile && l->view ? upload_weights(d, &s->t) : -ENOMEM;
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &l->labels, device_view_pixels(d));
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &l->tiles, (size_t)(l->group * l->listed) * sizeof(*l->tile));
    if (!err)
        err = sst_gpu_span_create(d->gpu, &l->span, 4 * tile_pixels(d) * (size_t)(l->group * raw));
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &l->in, 4 * tile_pixels(d) * (size_t)(l->group * raw));
    return err ? err : sst_gpu_buffer_create(d->gpu, &l->out, 4 * tile_pixels(d) * (size_t)(l->group * tiles));
}

static int make_places(struct render_device *d, struct device_live_view *v, const struct sst_render_tiles *of,
                       const struct sst_rectify_tables *t)
{
    const size_t row = (size_t)t->cells, n = row * (size_t)t->height;
    struct sst_rectify_list list = { 0 };
    struct sst_places *places = sst_mem_keep(&d->packed, n, sizeof(*places));
    int err = places ? 0 : -ENOMEM;

    for (int y = 0; y < t->height && !err; y++)
        err = sst_rectify_map_cells(of->map, 0, y, places + (size_t)y * row, &list);
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &v->places, n * sizeof(*places));
    if (!err)
        err = sst_gpu_upload(d->gpu, v->places, 0, places, n * sizeof(*places));
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &v->list, 2 * (list.count ? list.count : 1) * sizeof(*list.xy));
    if (!err && list.count)
        err = sst_gpu_upload(d->gpu, v->list, 0, list.xy, 2 * list.count * sizeof(*list.xy));
    free(list.xy);
    return err;
}

/* What a view needs, once. */
static int make_view(struct render_device *d, const struct sst_render_tiles *of, const struct sst_rectify_tables *t)
{
    struct device_live_view *v = &d->followed.view[of->view];
    int err;

    if (v->list)
        return 0;
    err = sst_gpu_buffer_create(d->gpu, &v->frame, 4 * (size_t)t->raw_width * (size_t)t->raw_height);
    return err ? err : make_places(d, v, of, t);
}

/* The slot of a view, whose maps are uploaded with the next picture if it was not there. */
static int find_slot(struct render_device *d, int view, struct device_slot **out)
{
    struct device_slot *s = device_find_slot(d, view);
    int err;

    if (!s) {
        s = device_free_slot(d);
        if ((!s || s->view != DEVICE_NO_VIEW) && !d->full) {
            err = device_grow(d);
            if (err && (err != -ENOMEM || !d->slots))
                return err;
            s = device_free_slot(d);
        }
        *s = (struct device_slot){ .chunk = s->chunk, .index = s->index, .view = view, .maps = ~0U };
    }
    s->used = ++d->turn;
    s->followed = true;
    *out = s;
    return 0;
}

/* --- tiles -------------------------------------------------------------------------------------------------------- */

static bool wanted(const struct device_live_view *v, const uint8_t *dirty, int i)
{
    return !v->filled || dirty[i];
}

/* List what changed of the views of the part. */
static void list_tiles(struct work *w)
{
    struct device_live *l = &w->d->followed;
    const uint32_t n = (uint32_t)tile_pixels(w->d);
    int dirty = 0, changed = 0;

    for (int i = 0; i < w->count; i++) {
        const struct sst_render_tiles *of = &w->tiles[w->first + i];
        const struct sizes s = sizes_of(w->d, of, w->filter);
        const struct device_slot *slot = device_find_slot(w->d, of->view);
        struct part *p = &w->part[i];
        struct sst_gpu_rectangle *to;

        *p = (struct part){ .dirty_at = dirty, .changed_at = changed, .list_at = i * l->listed };
        to = l->tile + p->list_at;
        for (int t = 0; t < s.raw_cols * s.raw_rows; t++) {
            const int x = t % s.raw_cols * s.tile, y = t / s.raw_cols * s.tile;

            if (wanted(&l->view[of->view], of->dirty, t))
                to[p->dirty++] = (struct sst_gpu_rectangle){ (uint32_t)dirty++ * n, (uint32_t)(y * s.t.raw_width + x),
                                                             (uint32_t)sst_min_int(s.tile, s.t.raw_width - x),
                                                             (uint32_t)sst_min_int(s.tile, s.t.raw_height - y) };
        }
        to += p->dirty;
        for (int t = 0; t < s.cols * s.rows; t++) {
            const int x = t % s.cols * s.tile, y = t / s.cols * s.tile;

            if (of->changed[t])
                to[p->changed++] =
                    (struct sst_gpu_rectangle){ (uint32_t)((size_t)slot->index * device_view_pixels(w->d)) +
                                                    (uint32_t)(y * w->d->pitch + x),
                                                (uint32_t)changed++ * n, (uint32_t)sst_min_int(s.tile, s.t.width - x),
                                                (uint32_t)sst_min_int(s.tile, s.t.height - y) };
        }
    }
}

/* Write the dirty tiles of a view to the span. */
static int pack_view(void *arg, int index, int worker SST_UNUSED)
{
    const struct work *w = arg;
    const struct device_live *l = &w->d->followed;
    const struct sst_render_tiles *of = &w->tiles[w->first + index];
    const struct sizes s = sizes_of(w->d, of, w->filter);
    const struct part *p = &w->part[index];
    uint8_t *to = (uint8_t *)sst_gpu_span_data(l->span) + 4 * tile_pixels(w->d) * (size_t)p->dirty_at;

    for (int i = 0; i < p->dirty; i++, to += 4 * tile_pixels(w->d)) {
        const struct sst_gpu_rectangle *t = &l->tile[p->list_at + i];
        const size_t x = t->to % (uint32_t)s.t.raw_width, y = t->to / (uint32_t)s.t.raw_width;

        for (size_t row = 0; row < t->height; row++)
            memcpy(to + 4 * row * (size_t)s.tile, of->frame + (y + row) * of->stride + 4 * x, 4 * (size_t)t->width);
    }
    return 0;
}

/* Store the changed tiles of a view in its image. */
static int unpack_view(void *arg, int index, int worker SST_UNUSED)
{
    const struct work *w = arg;
    const struct sst_render_tiles *of = &w->tiles[w->first + index];
    const struct part *p = &w->part[index];
    const struct sst_gpu_rectangle *tile = w->d->followed.tile + p->list_at + p->dirty;
    const uint32_t *from = (const uint32_t *)w->d->followed.words.data + tile_pixels(w->d) * (size_t)p->changed_at;
    const uint32_t base = (uint32_t)((size_t)device_find_slot(w->d, of->view)->index * device_view_pixels(w->d));

    for (int i = 0; i < p->changed; i++, from += tile_pixels(w->d)) {
        const int x0 = (int)((tile[i].from - base) % (uint32_t)w->d->pitch);
        const int y0 = (int)((tile[i].from - base) / (uint32_t)w->d->pitch);

        for (int y = 0; y < (int)tile[i].height; y++) {
            const uint32_t *word = from + y * w->d->live.tile;
            uint8_t *r = sst_image_row(of->image, 0, y0 + y) + x0, *g = sst_image_row(of->image, 1, y0 + y) + x0;
            uint8_t *b = sst_image_row(of->image, 2, y0 + y) + x0;

            for (uint32_t x = 0; x < tile[i].width; x++) {
                r[x] = (uint8_t)word[x];
                g[x] = (uint8_t)(word[x] >> 8);
                b[x] = (uint8_t)(word[x] >> 16);
            }
        }
    }
    return 0;
}

/* --- dispatches --------------------------------------------------------------------------------------------------- */

static int copy_tiles(struct render_device *d, struct sst_gpu_buffer *from, struct sst_gpu_buffer *to,
                      const struct sst_gpu_tiles *push, int count)
{
    const struct sst_gpu_work work = { .shader = SST_GPU_TILES,
                                       .push = push,
                                       .buffer = { d->followed.tiles, from, to },
                                       .groups = { (uint32_t)count, 1, 1 } };

    d->report.dispatches++;
    return count ? sst_gpu_dispatch(d->gpu, &work) : 0;
}

/* The factors of light of a view, if there are any. */
static int upload_light(struct render_device *d, const struct sst_rectify_tables *t)
{
    const size_t at = SST_GPU_RECTIFY_LIGHT_FLOATS * sizeof(*t->falloff), bytes = light_nodes(t) * sizeof(*t->falloff);
    int err = bytes ? sst_gpu_upload(d->gpu, d->followed.light, at, t->falloff, bytes) : 0;

    return err || !bytes ? err : sst_gpu_upload(d->gpu, d->followed.light, at + bytes, t->falloff_root, bytes);
}

/* The rows of a view from its first changed tile to its last one. */
static int rectify(struct render_device *d, const struct device_slot *slot, const struct sizes *s,
                   const struct sst_gpu_rectangle *tile, int count)
{
    const struct device_live_view *v = &d->followed.view[slot->view];
    const struct device_chunk *c = &d->chunk[slot->chunk];
    const uint32_t first = (uint32_t)((size_t)slot->index * device_view_pixels(d));
    const int end = (int)((tile[count - 1].from - first) / (uint32_t)d->pitch) + s->tile;
    struct sst_gpu_rectify push = { .width = s->t.width,
                                    .height = s->t.height,
                                    .pitch = d->pitch,
                                    .raw_width = s->t.raw_width,
                                    .raw_height = s->t.raw_height,
                                    .taps = s->t.taps,
                                    .cell_shift = s->t.cell_shift,
                                    .cells = s->t.cells,
                                    .first = first,
                                    .flags = SST_GPU_RECTIFY_KEEP | (s->t.falloff ? SST_GPU_RECTIFY_LIT : 0U),
                                    .light_shift = s->t.light_shift,
                                    .light_cols = s->t.light_cols,
                                    .light_rows = s->t.light_rows,
                                    .top = (int)((tile[0].from - first) / (uint32_t)d->pitch) };
    const struct sst_gpu_work work = {
        .shader = SST_GPU_RECTIFY,
        .push = &push,
        .buffer = { d->followed.weights, v->frame, v->places, v->list, d->followed.light, d->followed.labels, c->valid,
                    c->pixels },
        .groups = { (uint32_t)(s->t.width + SST_GPU_RECTIFY_GROUP_WIDTH - 1) / SST_GPU_RECTIFY_GROUP_WIDTH,
                    (uint32_t)(end - push.top + SST_GPU_RECTIFY_GROUP_HEIGHT - 1) / SST_GPU_RECTIFY_GROUP_HEIGHT, 1 },
    };

    memcpy(push.gain, s->t.gain, sizeof(push.gain));
    memcpy(push.gain_root, s->t.gain_root, sizeof(push.gain_root));
    d->report.dispatches++;
    return sst_gpu_dispatch(d->gpu, &work);
}

static int send_view(struct work *w, int index)
{
    struct render_device *d = w->d;
    struct device_live *l = &d->followed;
    const struct sst_render_tiles *of = &w->tiles[w->first + index];
    const struct sizes s = sizes_of(d, of, w->filter);
    const struct device_slot *slot = device_find_slot(d, of->view);
    const struct part *p = &w->part[index];
    int err = copy_tiles(d, l->in, l->view[of->view].frame,
                         &(struct sst_gpu_tiles){ s.tile, s.t.raw_width, (uint32_t)p->list_at, 0 }, p->dirty);

    if (!err && p->changed)
        err = upload_light(d, &s.t);
    if (!err && p->changed)
        err = rectify(d, slot, &s, l->tile + p->list_at + p->dirty, p->changed);
    if (!err)
        err = copy_tiles(d, d->chunk[slot->chunk].pixels, l->out,
                         &(struct sst_gpu_tiles){ d->pitch, s.tile, (uint32_t)(p->list_at + p->dirty), 0 }, p->changed);
    return err;
}

/* Views whose slots stay there until they are done. */
static int place_part(struct work *w)
{
    int err = 0;

    for (int i = 0; i < w->count && !err; i++) {
        const struct sst_render_tiles *of = &w->tiles[w->first + i];
        const struct sizes s = sizes_of(w->d, of, w->filter);
        struct device_slot *slot;

        err = make_view(w->d, of, &s.t);
        if (!err)
            err = make_light(w->d, &s.t);
        if (!err)
            err = find_slot(w->d, of->view, &slot);
    }
    for (int i = 0; i < w->count && !err; i++)
        err = device_find_slot(w->d, w->tiles[w->first + i].view) ? 0 : -ENOMEM; /* one gave way to another */
    return err;
}

static int rectify_part(struct work *w)
{
    struct render_device *d = w->d;
    struct device_live *l = &d->followed;
    size_t in, out;
    int err = place_part(w);

    if (err)
        return err;
    list_tiles(w);
    in = 4 * tile_pixels(d) * (size_t)(w->part[w->count - 1].dirty_at + w->part[w->count - 1].dirty);
    out = 4 * tile_pixels(d) * (size_t)(w->part[w->count - 1].changed_at + w->part[w->count - 1].changed);
    if (!sst_mem_keep(&l->words, out, 1))
        return -ENOMEM;
    err = sst_parallel_for(w->count, w->threads, pack_view, w);
    if (!err)
        err = sst_gpu_upload(d->gpu, l->tiles, 0, l->tile, (size_t)(w->count * l->listed) * sizeof(*l->tile));
    if (!err && in)
        err = sst_gpu_upload_span(d->gpu, l->in, 0, l->span, 0, in);
    for (int i = 0; i < w->count && !err; i++)
        err = send_view(w, i);
    if (!err)
        err = out ? sst_gpu_download(d->gpu, l->words.data, l->out, 0, out) : sst_gpu_wait(d->gpu);
    if (!err)
        err = sst_parallel_for(w->count, w->threads, unpack_view, w);
    for (int i = 0; i < w->count && !err; i++)
        l->view[w->tiles[w->first + i].view].filled = true;
    d->report.upload_bytes += (int64_t)in;
    return err;
}

int device_rectify_tiles(struct render_device *d, const struct sst_render_tiles *tiles, int count,
                         enum sst_filter filter, int threads)
{
    struct work w = { .d = d, .tiles = tiles, .filter = filter, .threads = threads };
    int err = count ? sst_gpu_prepare(d->gpu, SST_GPU_RECTIFY) : 0;

    if (!err && count)
        err = sst_gpu_prepare(d->gpu, SST_GPU_TILES);
    for (; w.first < count && !err; w.first += w.count) {
        const struct sizes s = sizes_of(d, &tiles[w.first], filter);

        err = make_shared(d, &s);
        w.count = sst_min_int(d->followed.group, count - w.first);
        for (bool fewer = !err; fewer;) {
            err = rectify_part(&w);
            fewer = err == -ENOMEM && w.count > 1; /* other buffers leave that few slots */
            if (fewer)
                w.count /= 2;
        }
    }
    return err;
}

/* --- maps --------------------------------------------------------------------------------------------------------- */

static int upload_labels(struct render_device *d, const struct device_slot *s, int view, int top, int end)
{
    const struct sst_map_u8 *label = &d->lf->views[view].label;
    const size_t n = (size_t)(end - top) * (size_t)d->pitch;
    struct sst_gpu_rectangle *tile = d->followed.tile;
    uint8_t *memory = sst_mem_keep(&d->packed, n, 1);
    int count = 0, err;

    if (!memory)
        return -ENOMEM;
    for (int y = top; y < end; y++)
        memcpy(memory + (size_t)(y - top) * (size_t)d->pitch, sst_map_u8_row(label, y), (size_t)label->width);
    for (int y = top; y < end; y += d->live.tile) {
        for (int x = 0; x < label->width; x += d->live.tile)
            tile[count++] = (struct sst_gpu_rectangle){ (uint32_t)((y - top) * d->pitch + x),
                                                        (uint32_t)((size_t)s->index * device_view_pixels(d)) +
                                                            (uint32_t)(y * d->pitch + x),
                                                        (uint32_t)sst_min_int(d->live.tile, label->width - x),
                                                        (uint32_t)sst_min_int(d->live.tile, end - y) };
    }
    err = sst_gpu_upload(d->gpu, d->followed.labels, 0, memory, n);
    if (!err)
        err = sst_gpu_upload(d->gpu, d->followed.tiles, 0, tile, (size_t)count * sizeof(*tile));
    return err ? err
               : copy_tiles(d, d->followed.labels, d->chunk[s->chunk].pixels,
                            &(struct sst_gpu_tiles){ d->pitch, d->pitch, 0, SST_GPU_TILES_LABELS }, count);
}

int device_upload_maps(struct render_device *d, const struct device_slot *s, int view, int top, int end)
{
    const struct sst_view *v = &d->lf->views[view];
    const size_t at = (size_t)s->index * device_view_pixels(d) + (size_t)top * (size_t)d->pitch;
    const size_t n = (size_t)(end - top) * (size_t)d->pitch;
    const int64_t start_ns = sst_clock_now_ns();
    uint16_t *memory;
    int err = v->label.data ? upload_labels(d, s, view, top, end) : 0;

    if (!err && v->disp.data) {
        memory = sst_mem_keep(&d->packed, n, 2);
        if (!memory)
            return -ENOMEM;
        for (int y = top; y < end; y++)
            memcpy(memory + (size_t)(y - top) * (size_t)d->pitch, sst_map_u16_row(&v->disp, y),
                   2 * (size_t)d->lf->width);
        err = sst_gpu_upload(d->gpu, d->chunk[s->chunk].disp, 2 * at, memory, 2 * n);
    }
    d->report.upload_bytes += (int64_t)(n * ((v->label.data ? 1U : 0) + (v->disp.data ? 2U : 0)));
    d->report.upload_ns += sst_clock_now_ns() - start_ns;
    return err;
}
