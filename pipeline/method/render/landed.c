/* All rays at the viewpoint of a clear picture, kept from one picture to the next.
 *
 * Of a light field that changes in tiles, only what changed tiles can reach is landed again. A ray of stored disparity
 * q moves by floor(q b + c), which is monotonic in q, so that the smallest and the largest disparity of a tile, before
 * and now, bound where its rays land. These pixels are emptied, and the rays of all tiles that may land on them are
 * sent again: the nearest one stays, so that those which land elsewhere change nothing. A pixel of the picture depends
 * on what landed on it and on the colours around the places its rays come from, which are within reach() px of those
 * rays' pixels: a tile is taken with that margin. So the bytes are those of a whole picture.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread.h"
#include "pipeline/method/render/clear_internal.h"

#define WHOLE 0.7 /* of a view's tiles: from there on, landing all of them costs less */

/* What landed rays depend on beside the pixels. */
struct key {
    const struct sst_lightfield *lf;
    uint64_t since;
    double view_bx, view_by, disp_min_px;
    int count, bins, cut_q6, coarse, remove_label, rays, tile;
    int view[SST_MAX_VIEWS];
};

/* Smallest and largest stored disparity that lands; none if first > last. Not measured: any. */
struct span {
    uint16_t first, last;
    bool measured;
};

struct landed {
    struct sst_mem_kept maps, lists; /* landed rays of all views; what the pointers below show into */
    struct sst_mem_kept levels;      /* landed_levels() */
    uint64_t id;                     /* of a series of pictures that continue each other; 0: not kept */
    uint64_t serial;                 /* of the light field */
    struct key key;
    int tile, tile_cols, tile_rows, cols, rows; /* cells: SST_RENDER_CELL_WIDTH x SST_RENDER_CELL_HEIGHT px */
    struct span *span;                          /* [views][tiles], each with its margin */
    uint64_t *change;                           /* [cells] serial of the last change */
    uint8_t *dirty;                             /* [views][cells] that changed tiles may reach */
    uint8_t *wanted;                            /* [views][tiles] to be landed again */
    bool kept;                                  /* the next picture may go on from this one */
};

struct rect {
    int x0, y0, x1, y1;
};

void landed_destroy(struct landed *l)
{
    if (!l)
        return;
    sst_mem_kept_fini(&l->maps);
    sst_mem_kept_fini(&l->lists);
    sst_mem_kept_fini(&l->levels);
    free(l);
}

/* --- rays of one view --------------------------------------------------------------------------------------------- */

/* Mark the pixels of a row that stand in front or are outside the rectified view, in the columns of a rectangle and
 * beside them; none below the view. */
static void mark_removed(const struct clear *c, const struct clear_view *v, const struct scratch *s, struct rect r,
                         int y)
{
    const int x0 = sst_max_int(r.x0 - 1, 0), x1 = sst_min_int(r.x1 + 1, c->width);
    const struct sst_view *view = v->tap->v;
    const struct sst_map_u8 *mask = c->cfg->remove ? &c->cfg->remove[v->tap->view] : NULL;
    uint8_t *removed = s->row[y % 3] + 1;

    if (y >= c->height) {
        memset(removed, 0, (size_t)c->width);
        return;
    }
    c->kernels->clear_removed(removed + x0, sst_map_u16_row(&view->disp, y) + x0, c->cut_q6, (size_t)(x1 - x0));
    for (int x = x0; x < x1 && mask && mask->data; x++)
        removed[x] |= sst_map_u8_row(mask, y)[x] != 0;
    for (int x = x0; x < x1 && c->cfg->remove_label && view->label.data; x++)
        removed[x] |= sst_map_u8_row(&view->label, y)[x] == c->cfg->remove_label;
    for (int x = x0; x < x1 && view->valid.data; x++)
        removed[x] |= !sst_map_u8_row(&view->valid, y)[x];
}

/* The rays of a rectangle of a view go to the viewpoint; the nearest one at each pixel stays. */
static void land(const struct clear *c, const struct clear_view *v, const struct scratch *s, struct rect r)
{
    const int n = r.x1 - r.x0;

    for (int i = 0; i < 3; i++)
        memset(s->row[i], 0, (size_t)c->width + 2);
    for (int y = sst_max_int(r.y0 - 1, 0); y <= r.y0; y++)
        mark_removed(c, v, s, r, y);
    for (int y = r.y0; y < r.y1; y++) {
        const uint16_t *disp = sst_map_u16_row(&v->tap->v->disp, y) + r.x0;
        const uint8_t *const removed[3] = { s->row[(y + 2) % 3] + 1 + r.x0, s->row[y % 3] + 1 + r.x0,
                                            s->row[(y + 1) % 3] + 1 + r.x0 };

        mark_removed(c, v, s, r, y + 1);
        c->kernels->clear_state(s->state, removed, disp, c->bins, (size_t)n);
        c->kernels->clear_land(v->landed, c->stride, &v->at, disp, s->state, r.x0, y, n);
    }
}

static void land_whole(const struct clear *c, const struct clear_view *v, const struct scratch *s)
{
    memset(v->landed, 0, c->stride * (size_t)c->height * sizeof(*v->landed));
    land(c, v, s, (struct rect){ 0, 0, c->width, c->height });
}

/* --- what changed ------------------------------------------------------------------------------------------------- */

/* Px around a changed one from which a ray may change the picture: removed neighbours; the four pixels of a colour;
 * half a pixel by which a ray lands off its place; and the tolerance of its surface. */
static int reach(const struct clear *c)
{
    const double off_px = (double)((SST_CLEAR_TOLERANCE + 2) << c->coarse) / SST_DISP_SCALE;
    float most = 0;

    for (int k = 0; k < c->count; k++)
        most = fmaxf(most, fmaxf(fabsf(c->view[k].at.bx), fabsf(c->view[k].at.by)));
    return 3 + (int)ceil(off_px * (double)most);
}

static struct rect rect_of(const struct clear *c, const struct landed *l, int tile, int margin)
{
    const int x = tile % l->tile_cols * l->tile, y = tile / l->tile_cols * l->tile;

    return (struct rect){ sst_max_int(x - margin, 0), sst_max_int(y - margin, 0),
                          sst_min_int(x + l->tile + margin, c->width), sst_min_int(y + l->tile + margin, c->height) };
}

static struct span span_of(const struct clear *c, const struct clear_view *v, struct rect r)
{
    const uint16_t end = (uint16_t)sst_clamp_int(sst_min_int(c->bins, c->cut_q6 + 1), 0, SST_DISP_NONE);
    uint16_t most[2] = { UINT16_MAX, 0 };

    c->kernels->disp_span(most, sst_map_u16_row(&v->tap->v->disp, r.y0) + r.x0, v->tap->v->disp.stride, end,
                          (size_t)(r.x1 - r.x0), (size_t)(r.y1 - r.y0));
    return most[0] < end ? (struct span){ most[0], most[1], true } : (struct span){ 1, 0, true };
}

/* Where most tiles change, their spans are measured when a later picture needs them. */
static struct span any_span(const struct clear *c)
{
    return (struct span){ 0, (uint16_t)sst_clamp_int(sst_min_int(c->bins - 1, c->cut_q6), 0, SST_DISP_NONE - 1),
                          false };
}

/* Where the rays of a rectangle may land; empty: nowhere in the picture. */
static struct rect reached(const struct clear *c, const struct clear_view *v, struct rect from, struct span s)
{
    const float first = s.first, last = s.last;
    const int x[2] = { (int)floorf(first * v->at.x_q6 + v->at.x_0), (int)floorf(last * v->at.x_q6 + v->at.x_0) };
    const int y[2] = { (int)floorf(first * v->at.y_q6 + v->at.y_0), (int)floorf(last * v->at.y_q6 + v->at.y_0) };
    const struct rect r = { sst_max_int(from.x0 + sst_min_int(x[0], x[1]), 0),
                            sst_max_int(from.y0 + sst_min_int(y[0], y[1]), 0),
                            sst_min_int(from.x1 + sst_max_int(x[0], x[1]), c->width),
                            sst_min_int(from.y1 + sst_max_int(y[0], y[1]), c->height) };

    return s.first <= s.last && r.x0 < r.x1 && r.y0 < r.y1 ? r : (struct rect){ 0 };
}

/* Cells that a rectangle of the picture meets. */
static struct rect cells_of(struct rect r)
{
    return (struct rect){ r.x0 / SST_RENDER_CELL_WIDTH, r.y0 / SST_RENDER_CELL_HEIGHT,
                          (r.x1 + SST_RENDER_CELL_WIDTH - 1) / SST_RENDER_CELL_WIDTH,
                          (r.y1 + SST_RENDER_CELL_HEIGHT - 1) / SST_RENDER_CELL_HEIGHT };
}

static void mark(const struct landed *l, uint8_t *dirty, struct rect r)
{
    const struct rect at = cells_of(r);

    for (int row = at.y0; row < at.y1; row++)
        memset(dirty + row * l->cols + at.x0, 1, (size_t)(at.x1 - at.x0));
}

static bool meets(const struct landed *l, const uint8_t *dirty, struct rect r)
{
    const struct rect at = cells_of(r);

    for (int row = at.y0; row < at.y1; row++) {
        if (memchr(dirty + row * l->cols + at.x0, 1, (size_t)(at.x1 - at.x0)))
            return true;
    }
    return false;
}

static bool any_around(const struct landed *l, const uint64_t *stamp, int tile)
{
    const int col = tile % l->tile_cols, row = tile / l->tile_cols;

    for (int y = sst_max_int(row - 1, 0); y <= sst_min_int(row + 1, l->tile_rows - 1); y++) {
        for (int x = sst_max_int(col - 1, 0); x <= sst_min_int(col + 1, l->tile_cols - 1); x++) {
            if (stamp[y * l->tile_cols + x] > l->serial)
                return true;
        }
    }
    return false;
}

static int count_changed(const struct landed *l, const uint64_t *stamp)
{
    int n = 0;

    for (int t = 0; t < l->tile_cols * l->tile_rows; t++)
        n += stamp[t] > l->serial;
    return n;
}

/* Most tiles of a view have changed: all of it is landed again, and may be anywhere. */
static void land_changed(const struct clear *c, int index, uint8_t *dirty, struct scratch *s)
{
    const struct landed *l = c->landed;
    const int tiles = l->tile_cols * l->tile_rows;

    memset(dirty, 1, (size_t)l->cols * (size_t)l->rows);
    for (int t = 0; t < tiles; t++)
        l->span[(size_t)index * (size_t)tiles + (size_t)t] = any_span(c);
    land_whole(c, &c->view[index], s);
}

/* Find the cells that the changed tiles of a view may reach, before and now. */
static void find_dirty(const struct clear *c, int index, const uint64_t *stamp, uint8_t *dirty)
{
    const struct landed *l = c->landed;
    const struct clear_view *v = &c->view[index];
    const int tiles = l->tile_cols * l->tile_rows, margin = reach(c);
    struct span *span = l->span + (size_t)index * (size_t)tiles;

    for (int t = 0; t < tiles; t++) {
        if (stamp[t] > l->serial)
            mark(l, dirty, reached(c, v, rect_of(c, l, t, margin), span[t]));
    }
    for (int t = 0; t < tiles; t++) {
        if (any_around(l, stamp, t) || !span[t].measured)
            span[t] = span_of(c, v, rect_of(c, l, t, margin));
        if (stamp[t] > l->serial)
            mark(l, dirty, reached(c, v, rect_of(c, l, t, margin), span[t]));
    }
}

static void empty_cells(const struct clear *c, const struct clear_view *v, const uint8_t *dirty)
{
    const struct landed *l = c->landed;

    for (int y = 0; y < c->height; y++) {
        const uint8_t *cell = dirty + (size_t)(y / SST_RENDER_CELL_HEIGHT) * (size_t)l->cols;

        for (int col = 0; col < l->cols; col++) {
            const int x = col * SST_RENDER_CELL_WIDTH, n = sst_min_int(SST_RENDER_CELL_WIDTH, c->width - x);

            if (cell[col])
                memset(v->landed + (size_t)y * c->stride + x, 0, (size_t)n * sizeof(*v->landed));
        }
    }
}

/* Land what changed in one view. */
static int update_view(void *arg, int index, int worker)
{
    const struct clear *c = arg;
    const struct landed *l = c->landed;
    const struct clear_view *v = &c->view[index];
    const int tiles = l->tile_cols * l->tile_rows;
    const struct span *span = l->span + (size_t)index * (size_t)tiles;
    const uint64_t *stamp = c->cfg->merge->kept->stamp[v->tap->view];
    uint8_t *dirty = l->dirty + (size_t)index * (size_t)l->cols * (size_t)l->rows;
    uint8_t *wanted = l->wanted + (size_t)index * (size_t)tiles;
    const int changed = count_changed(l, stamp);
    int count = 0;

    memset(dirty, 0, (size_t)l->cols * (size_t)l->rows);
    if (!changed)
        return 0;
    if (changed > WHOLE * tiles) {
        land_changed(c, index, dirty, &c->scratch[worker]);
        return 0;
    }
    find_dirty(c, index, stamp, dirty);
    for (int t = 0; t < tiles; t++)
        count += wanted[t] = meets(l, dirty, reached(c, v, rect_of(c, l, t, 0), span[t]));
    if (count > WHOLE * tiles) {
        land_whole(c, v, &c->scratch[worker]);
        return 0;
    }
    empty_cells(c, v, dirty);
    for (int t = 0, end; t < tiles; t = end) {
        struct rect r = rect_of(c, l, t, 0);

        for (end = t + 1; wanted[t] && end % l->tile_cols && wanted[end]; end++)
            r.x1 = rect_of(c, l, end, 0).x1;
        if (wanted[t])
            land(c, v, &c->scratch[worker], r);
    }
    return 0;
}

static int land_view(void *arg, int index, int worker)
{
    const struct clear *c = arg;
    const struct landed *l = c->landed;
    const int tiles = l->tile_cols * l->tile_rows, margin = reach(c);

    land_whole(c, &c->view[index], &c->scratch[worker]);
    for (int t = 0; t < tiles && l->kept; t++)
        l->span[(size_t)index * (size_t)tiles + (size_t)t] = span_of(c, &c->view[index], rect_of(c, l, t, margin));
    return 0;
}

/* --- from picture to picture -------------------------------------------------------------------------------------- */

static struct key key_of(const struct clear *c, const struct sst_render_kept *kept)
{
    struct key k;

    memset(&k, 0, sizeof(k)); /* also its padding: keys are compared as bytes */
    k.lf = c->lf;
    k.since = kept->since;
    k.view_bx = c->cfg->view_bx;
    k.view_by = c->cfg->view_by;
    k.disp_min_px = c->lf->disp_min_px;
    k.count = c->count;
    k.bins = c->bins;
    k.cut_q6 = c->cut_q6;
    k.coarse = c->coarse;
    k.remove_label = c->cfg->remove_label;
    k.rays = c->cfg->rays;
    k.tile = kept->tile;
    for (int i = 0; i < c->count; i++)
        k.view[i] = c->view[i].tap->view;
    return k;
}

/* What a picture may be continued from; NULL: what is removed may change without a new serial number, colours come from
 * raw frames, or the margin of a tile is larger than the tile. */
static struct sst_render_kept *kept_of(const struct clear *c)
{
    struct sst_render_kept *kept = c->cfg->merge ? c->cfg->merge->kept : NULL;

    if (!kept || c->cfg->remove || c->lf->images_raw || reach(c) > kept->tile)
        return NULL;
    for (int k = 0; k < c->count; k++) {
        if (c->view[k].tap->sampler || !kept->stamp[c->view[k].tap->view])
            return NULL;
    }
    return kept;
}

static struct landed *take(struct sst_renderer *r)
{
    struct landed *l;

    pthread_mutex_lock(&r->lock);
    l = r->landed;
    r->landed = NULL;
    pthread_mutex_unlock(&r->lock);
    return l ? l : calloc(1, sizeof(*l));
}

void landed_give_back(struct clear *c)
{
    struct sst_renderer *r = c->renderer;

    if (!c->landed)
        return;
    pthread_mutex_lock(&r->lock);
    if (!r->landed) {
        r->landed = c->landed;
        c->landed = NULL;
    }
    pthread_mutex_unlock(&r->lock);
    landed_destroy(c->landed);
    c->landed = NULL;
}

static int reserve(struct clear *c, const struct sst_render_kept *kept)
{
    struct landed *l = c->landed;
    const size_t view = c->stride * (size_t)c->height, views = (size_t)c->count;
    const void *before = l->maps.data;
    uint16_t *maps = sst_mem_keep(&l->maps, views, view * sizeof(*maps));
    size_t tiles, cells;
    uint8_t *list;

    l->id = l->maps.data == before ? l->id : 0;
    l->kept = kept != NULL;
    for (int k = 0; k < c->count && maps; k++)
        c->view[k].landed = maps + (size_t)k * view;
    if (!maps || !kept)
        return maps ? 0 : -ENOMEM;
    l->tile = kept->tile;
    l->tile_cols = kept->tile_cols;
    l->tile_rows = kept->tile_rows;
    l->cols = (c->width + SST_RENDER_CELL_WIDTH - 1) / SST_RENDER_CELL_WIDTH;
    l->rows = (c->height + SST_RENDER_CELL_HEIGHT - 1) / SST_RENDER_CELL_HEIGHT;
    tiles = (size_t)l->tile_cols * (size_t)l->tile_rows;
    cells = (size_t)l->cols * (size_t)l->rows;
    before = l->lists.data;
    list = sst_mem_keep(&l->lists, 1, cells * (sizeof(*l->change) + views) + views * tiles * (sizeof(*l->span) + 1));
    if (!list)
        return -ENOMEM;
    l->id = l->lists.data == before ? l->id : 0;
    l->change = (void *)list;
    l->span = (void *)(list + cells * sizeof(*l->change));
    l->wanted = (uint8_t *)(l->span + views * tiles);
    l->dirty = l->wanted + views * tiles;
    return 0;
}

/* Land all rays, as the first picture of a series if it is kept. */
static int start(struct clear *c, const struct sst_render_kept *kept)
{
    struct landed *l = c->landed;
    const int err = sst_parallel_for(c->count, c->threads, land_view, c);

    l->id = 0;
    if (err || !kept)
        return err;
    for (int i = 0; i < l->cols * l->rows; i++)
        l->change[i] = kept->serial;
    pthread_mutex_lock(&c->renderer->lock);
    l->id = ++c->renderer->series;
    pthread_mutex_unlock(&c->renderer->lock);
    l->key = key_of(c, kept);
    l->serial = kept->serial;
    return 0;
}

/* Land what changed since the last picture of the series. */
static int go_on(struct clear *c, const struct sst_render_kept *kept)
{
    struct landed *l = c->landed;
    const size_t cells = (size_t)l->cols * (size_t)l->rows;
    const int err = sst_parallel_for(c->count, c->threads, update_view, c);

    if (err) {
        l->id = 0;
        return err;
    }
    for (size_t i = 0; i < cells; i++) {
        for (int k = 0; k < c->count; k++) {
            if (l->dirty[(size_t)k * cells + i])
                l->change[i] = kept->serial;
        }
    }
    l->serial = kept->serial;
    return 0;
}

int landed_make(struct clear *c)
{
    struct sst_render_kept *kept = kept_of(c);
    struct landed *l = c->landed = take(c->renderer);
    struct key key;
    int err = l ? reserve(c, kept) : -ENOMEM;

    c->change = NULL;
    if (err)
        return err;
    if (kept)
        key = key_of(c, kept);
    if (!kept || !l->id || memcmp(&key, &l->key, sizeof(key)) || l->serial > kept->serial)
        err = start(c, kept);
    else if (l->serial < kept->serial)
        err = go_on(c, kept);
    if (err || !kept)
        return err;
    if (kept->id == l->id)
        c->change = l->change;
    kept->id = l->id;
    return 0;
}

void *landed_levels(const struct clear *c, size_t bytes)
{
    return sst_mem_keep(&c->landed->levels, bytes, 1);
}

bool landed_kept(const struct clear *c)
{
    return c->landed && c->landed->kept;
}

bool landed_colours(const struct clear *c, int x, int y)
{
    return !c->change || c->change[y / SST_RENDER_CELL_HEIGHT * c->landed->cols + x / SST_RENDER_CELL_WIDTH] >
                             c->cfg->merge->kept->coloured;
}

int64_t landed_coloured_px(const struct clear *c)
{
    int64_t n = 0;

    for (int y = 0; y < c->height; y += SST_RENDER_CELL_HEIGHT) {
        for (int x = 0; x < c->width; x += SST_RENDER_CELL_WIDTH)
            n += landed_colours(c, x, y) ? sst_min_int(c->height - y, SST_RENDER_CELL_HEIGHT) *
                                               sst_min_int(c->width - x, SST_RENDER_CELL_WIDTH)
                                         : 0;
    }
    return n;
}
