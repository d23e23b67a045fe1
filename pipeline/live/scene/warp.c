/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/live/scene/scene_internal.h"

/* Priority of a warped cell, larger is better: confirmed cells first, then cells of the key nearest to the view, which
 * keeps wrong foregrounds of several keys from accumulating; within one key the nearest surface. */
#define THERE      (1u << 31)
#define CONFIRMED  (1u << 30)
#define RANK_SHIFT 24
#define DISP_SHIFT 8
_Static_assert(SST_SCENE_KEYS <= 64, "ranks have 6 bits");
/* Neighbouring cells with a larger difference are on two surfaces. */
#define STEP_Q6 64
/* Cells of a row to upsample, with one more on both sides. */
#define STRIP_CELLS(width) ((size_t)(width) + 2)

int scene_composer_init(struct scene_composer *c, int width, int height)
{
    struct scene_composer made = { .width = width, .height = height };
    int err = sst_map_u16_init(&made.maps.disp, width, height);

    made.cols = (width + SST_SCENE_CELLS - 1) / SST_SCENE_CELLS;
    made.rows = (height + SST_SCENE_CELLS - 1) / SST_SCENE_CELLS;
    err = err ? err : sst_map_u8_init(&made.maps.label, width, height);
    made.z = sst_mem_alloc((size_t)width * (size_t)height, sizeof(*made.z));
    made.strips = sst_mem_alloc(9 * STRIP_CELLS(width) + 3 * (size_t)width, sizeof(*made.strips));
    made.changed = sst_mem_alloc((size_t)made.cols * (size_t)made.rows, 1);
    made.sums = sst_mem_alloc((size_t)(made.cols + 1) * (size_t)(made.rows + 1), sizeof(*made.sums));
    if (!err && (!made.z || !made.strips || !made.changed || !made.sums))
        err = -ENOMEM;
    if (err)
        scene_composer_fini(&made);
    else
        *c = made;
    return err;
}

void scene_composer_fini(struct scene_composer *c)
{
    sst_map_u16_fini(&c->maps.disp);
    sst_map_u8_fini(&c->maps.label);
    sst_mem_free(c->z);
    sst_mem_free(c->strips);
    sst_mem_free(c->changed);
    sst_mem_free(c->sums);
}

/* --- tiles -------------------------------------------------------------------------------------------------------- */

static struct scene_span tile_span(const struct sst_map_u16 *disp, int x0, int x1, int y0, int y1)
{
    uint16_t most[2] = { SST_DISP_NONE, 0 };

    sst_kernels_get()->disp_span(most, sst_map_u16_row(disp, y0) + x0, disp->stride, SST_DISP_NONE, (size_t)(x1 - x0),
                                 (size_t)(y1 - y0));
    return (struct scene_span){ most[0], most[1] };
}

/* Warped values of a row of cells: priority within a key, disparity, label; 0: nothing. */
static void pack_row(struct scene_key *key, int y)
{
    const uint16_t *disp = sst_map_u16_row(&key->maps.disp, y);
    const uint8_t *label = sst_map_u8_row(&key->maps.label, y), *confirmed = sst_map_u8_row(&key->maps.confirmed, y);
    uint32_t *to = key->packed + (size_t)y * (size_t)key->maps.disp.width;

    for (int x = 0; x < key->maps.disp.width; x++) {
        const uint32_t v = THERE | (uint32_t)confirmed[x] * CONFIRMED | (uint32_t)disp[x] << DISP_SHIFT | label[x];

        to[x] = disp[x] == SST_DISP_NONE ? 0 : v;
    }
}

void scene_measure_tiles(struct scene_key *key)
{
    const struct sst_map_u16 *disp = &key->maps.disp;
    const int cols = (disp->width + SST_SCENE_CELLS - 1) / SST_SCENE_CELLS;

    for (int y = 0; y < disp->height; y++)
        pack_row(key, y);
    for (int y = 0; y < disp->height; y += SST_SCENE_CELLS) {
        for (int x = 0; x < disp->width; x += SST_SCENE_CELLS) {
            const struct scene_span s = tile_span(disp, x, sst_min_int(x + SST_SCENE_CELLS, disp->width), y,
                                                  sst_min_int(y + SST_SCENE_CELLS, disp->height));

            key->tile[y / SST_SCENE_CELLS * cols + x / SST_SCENE_CELLS] = s;
        }
    }
}

/* Changed tiles as 0 or 1, and their sums above and to the left of each corner. @return number of changed tiles */
static int count_changed(struct scene_composer *c, const uint8_t *dirty)
{
    for (int y = 0; y < c->rows; y++) {
        const uint16_t *above = c->sums + (size_t)y * (size_t)(c->cols + 1);
        uint16_t *to = c->sums + (size_t)(y + 1) * (size_t)(c->cols + 1);
        int sum = 0;

        for (int x = 0; x < c->cols; x++) {
            c->changed[y * c->cols + x] = dirty[y * c->cols + x] != 0;
            sum += dirty[y * c->cols + x] != 0;
            to[x + 1] = (uint16_t)(above[x + 1] + sum);
        }
    }
    return c->sums[(size_t)(c->rows + 1) * (size_t)(c->cols + 1) - 1];
}

/* Does a rectangle of cells meet a changed tile? */
static bool meets_changed(const struct scene_composer *c, const struct sst_rect *r)
{
    const int x0 = sst_max_int(r->x0, 0) / SST_SCENE_CELLS, y0 = sst_max_int(r->y0, 0) / SST_SCENE_CELLS;
    const int x1 = sst_min_int((r->x1 + SST_SCENE_CELLS - 1) / SST_SCENE_CELLS, c->cols);
    const int y1 = sst_min_int((r->y1 + SST_SCENE_CELLS - 1) / SST_SCENE_CELLS, c->rows);
    const uint16_t *top = c->sums + y0 * (c->cols + 1), *end = c->sums + y1 * (c->cols + 1);

    return r->x1 > 0 && r->y1 > 0 && x0 < x1 && y0 < y1 && end[x1] - end[x0] - top[x1] + top[x0] > 0;
}

/* Rank of a key by its distance to the view: larger is nearer. Ties: the first. */
static uint32_t rank_of(const struct sst_lightfield *lf, int view, const struct scene_key *keys, int count, int k)
{
    double own = 0;
    uint32_t rank = 0;

    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < count; i++) {
            const struct sst_view *a = &lf->views[view], *b = &lf->views[keys[i].view];
            const double distance = (a->bx - b->bx) * (a->bx - b->bx) + (a->by - b->by) * (a->by - b->by);

            if (pass == 0)
                own = i == k ? distance : own;
            else
                rank += distance > own || (!(distance < own) && i > k);
        }
    }
    return rank;
}

/* --- warping ------------------------------------------------------------------------------------------------------ */

/* Where the cells of a tile with these disparities may go: shifts are monotonic in the disparity. */
static struct sst_rect landing_box(const struct sst_rect *tile, const struct scene_span *span,
                                   const struct scene_warp *way)
{
    const int ax = scene_shift(way->zero_q6 + span->far_q6, way->bx_q16);
    const int bx = scene_shift(way->zero_q6 + span->near_q6, way->bx_q16);
    const int ay = scene_shift(way->zero_q6 + span->far_q6, way->by_q16);
    const int by = scene_shift(way->zero_q6 + span->near_q6, way->by_q16);

    return (struct sst_rect){ tile->x0 - sst_max_int(ax, bx), tile->y0 - sst_max_int(ay, by),
                              tile->x1 - sst_min_int(ax, bx), tile->y1 - sst_min_int(ay, by) };
}

/* May a tile of a key reach a changed tile? */
static bool reaches_changed(const struct scene_composer *c, const struct scene_key *key, const struct scene_warp *way,
                            int col, int row)
{
    const struct scene_span *span = &key->tile[row * c->cols + col];
    const int x0 = col * SST_SCENE_CELLS, y0 = row * SST_SCENE_CELLS;
    const struct sst_rect tile = { x0, y0, sst_min_int(x0 + SST_SCENE_CELLS, c->width),
                                   sst_min_int(y0 + SST_SCENE_CELLS, c->height) };
    struct sst_rect box;

    if (span->far_q6 > span->near_q6)
        return false;
    box = landing_box(&tile, span, way);
    return meets_changed(c, &box);
}

/* Warp the tiles of a key that may reach a changed tile, in runs. */
static void land(struct scene_composer *c, const struct sst_lightfield *lf, int view, const struct scene_key *key,
                 uint32_t rank)
{
    const struct scene_warp way = scene_warp(lf, key->view, view);
    const struct sst_cell_way w = {
        (int32_t)way.zero_q6, (int32_t)way.bx_q16, (int32_t)way.by_q16, rank << RANK_SHIFT, c->width, c->height
    };

    for (int row = 0; row < c->rows; row++) {
        const int y0 = row * SST_SCENE_CELLS, y1 = sst_min_int(y0 + SST_SCENE_CELLS, c->height);

        for (int col = 0, end; col < c->cols; col = end + 1) {
            const int x0 = col * SST_SCENE_CELLS;

            for (end = col; end < c->cols && reaches_changed(c, key, &way, end, row); end++)
                ;
            for (int y = y0; y < y1 && end > col; y++)
                sst_kernels_get()->cell_land(c->z, &w, key->packed + (size_t)y * (size_t)c->width + x0, x0, y,
                                             sst_min_int(end * SST_SCENE_CELLS, c->width) - x0);
        }
    }
}

/* Collect warped cells of changed tiles, and the existing maps of the view around them. */
static void collect(struct scene_composer *c, const struct sst_view *v, const struct sst_rect *r, bool labels)
{
    for (int y = r->y0; y < r->y1; y++) {
        const uint8_t *tiles = c->changed + y / SST_SCENE_CELLS * c->cols;
        const uint32_t *z = c->z + (size_t)y * (size_t)c->width;
        const uint16_t *view_disp = sst_map_u16_row(&v->disp, 2 * y);
        const uint8_t *view_label = labels ? sst_map_u8_row(&v->label, 2 * y) : NULL;
        uint16_t *disp = sst_map_u16_row(&c->maps.disp, y);
        uint8_t *label = sst_map_u8_row(&c->maps.label, y);

        for (int x0 = r->x0, x1; x0 < r->x1; x0 = x1) {
            x1 = sst_min_int(x0 + SST_SCENE_CELLS, r->x1);
            if (tiles[x0 / SST_SCENE_CELLS]) {
                for (int x = x0; x < x1; x++) {
                    disp[x] = (uint16_t)((z[x] >> DISP_SHIFT) | (z[x] ? 0 : SST_DISP_NONE));
                    label[x] = (uint8_t)z[x];
                }
                continue;
            }
            for (int x = x0; x < x1; x++)
                disp[x] = view_disp[2 * x];
            for (int x = x0; x < x1; x++)
                label[x] = view_label ? view_label[2 * x] : SST_LABEL_NONE;
        }
    }
}

/* Cells x0-1 .. x1 of a row for upsampling; outside of the picture the border cells. */
struct strip {
    uint16_t *disp, *green4; /* of cell x0 */
    uint8_t *label;
};

/* Memory for three rows of cells and two of pixels. */
struct enlarger {
    struct strip row[3]; /* by y modulo 3 */
    uint16_t *disp;      /* [2 width] */
    uint8_t *label;
    int x0, x1;  /* cells at work */
    bool labels; /* false: only disparities */
};

static struct enlarger enlarger_of(const struct scene_composer *c)
{
    const size_t cells = STRIP_CELLS(c->width);
    uint16_t *at = c->strips;
    uint8_t *bytes = (uint8_t *)(at + 6 * cells + 2 * (size_t)c->width);
    struct enlarger e = { .disp = at + 6 * cells, .label = bytes + 3 * cells };

    for (size_t i = 0; i < 3; i++)
        e.row[i] = (struct strip){ at + 2 * i * cells + 1, at + (2 * i + 1) * cells + 1, bytes + i * cells + 1 };
    return e;
}

/* True for a single cell in a gap between cells of a nearer surface, a and b on both sides. */
static bool shows_through(int d, int a, int b)
{
    return d != (int)SST_DISP_NONE && a != (int)SST_DISP_NONE && b != (int)SST_DISP_NONE && a > d + STEP_Q6 &&
           b > d + STEP_Q6;
}

/* Close a gap of one cell. @return it was one */
static bool close_gap(struct scene_composer *c, const struct sst_rect *r, int x, int y)
{
    uint16_t *d = sst_map_u16_row(&c->maps.disp, y);
    uint8_t *l = sst_map_u8_row(&c->maps.label, y);
    int up, down;

    if (x > r->x0 && x + 1 < r->x1 && shows_through(d[x], d[x - 1], d[x + 1])) {
        const int from = d[x - 1] < d[x + 1] ? x - 1 : x + 1;

        l[x] = l[from];
        d[x] = d[from];
        return true;
    }
    if (y == r->y0 || y + 1 == r->y1)
        return false;
    up = sst_map_u16_row(&c->maps.disp, y - 1)[x];
    down = sst_map_u16_row(&c->maps.disp, y + 1)[x];
    if (!shows_through(d[x], up, down))
        return false;
    l[x] = sst_map_u8_row(&c->maps.label, up < down ? y - 1 : y + 1)[x];
    d[x] = (uint16_t)sst_min_int(up, down);
    return true;
}

/* Mark cells that lie deeper than both neighbours along the row, or than both across, which are rows without any: d
 * itself. */
static void mark_gaps(uint8_t *restrict gap, const uint16_t *restrict d, const uint16_t *restrict up,
                      const uint16_t *restrict down, int n)
{
    for (int x = 0; x < n; x++) {
        const uint16_t along = d[x - 1] < d[x + 1] ? d[x - 1] : d[x + 1], across = up[x] < down[x] ? up[x] : down[x];
        const uint16_t least = along > across ? along : across;

        gap[x] = (least > d[x]) & ((uint16_t)(least - d[x]) > STEP_Q6);
    }
}

/* Close gaps of one cell: slanted surfaces get wider from view to view. Few cells are gaps, so candidates are marked
 * first. Only a gap closed to its left can turn a cell that is not marked into one. */
static void close_gaps(struct scene_composer *c, const struct sst_rect *r)
{
    uint8_t *gap = enlarger_of(c).label; /* not needed yet */

    for (int y = r->y0; y < r->y1; y++) {
        const uint8_t *tiles = c->changed + y / SST_SCENE_CELLS * c->cols;
        const bool inside = y > r->y0 && y + 1 < r->y1;
        const uint16_t *d = sst_map_u16_row(&c->maps.disp, y);
        const uint16_t *up = inside ? sst_map_u16_row(&c->maps.disp, y - 1) : d;
        const uint16_t *down = inside ? sst_map_u16_row(&c->maps.disp, y + 1) : d;
        bool closed = false;

        memset(gap + r->x0, 0, (size_t)(r->x1 - r->x0));
        for (int x0 = r->x0, x1; x0 < r->x1; x0 = x1) {
            const int from = sst_max_int(x0, r->x0 + 1);

            x1 = sst_min_int((x0 / SST_SCENE_CELLS + 1) * SST_SCENE_CELLS, r->x1);
            if (tiles[x0 / SST_SCENE_CELLS])
                mark_gaps(gap + from, d + from, up + from, down + from, sst_min_int(x1, r->x1 - 1) - from);
        }
        /* The ends of the row have one neighbour along it. */
        gap[r->x0] = tiles[r->x0 / SST_SCENE_CELLS] != 0;
        gap[r->x1 - 1] = tiles[(r->x1 - 1) / SST_SCENE_CELLS] != 0;
        for (int x = r->x0; x < r->x1; x++) {
            if (!closed || !tiles[x / SST_SCENE_CELLS]) {
                const uint8_t *next = memchr(gap + x, 1, (size_t)(r->x1 - x));

                if (!next)
                    break;
                x = (int)(next - gap);
            }
            closed = close_gap(c, r, x, y);
        }
    }
}

/* Fill cells that no key sees from the farther of the known cells to their left and right. @return the row has any */
static bool fill_row(uint16_t *d, uint8_t *l, int x0, int x1)
{
    for (int x = x0; x < x1; x++) {
        int end = x, left, right, from;

        if (d[x] != SST_DISP_NONE)
            continue;
        while (end < x1 && d[end] == SST_DISP_NONE)
            end++;
        left = x > x0 ? d[x - 1] : (int)SST_DISP_NONE;
        right = end < x1 ? d[end] : (int)SST_DISP_NONE;
        from = left < right ? x - 1 : end; /* NONE is the largest value */
        if (left == (int)SST_DISP_NONE && right == (int)SST_DISP_NONE)
            return false;
        for (; x < end; x++) {
            d[x] = d[from];
            l[x] = l[from];
        }
    }
    return true;
}

static void fill(struct scene_composer *c, const struct sst_rect *r)
{
    const size_t n = (size_t)(r->x1 - r->x0);
    int known = -1;

    for (int y = r->y0; y < r->y1; y++) {
        if (!fill_row(sst_map_u16_row(&c->maps.disp, y), sst_map_u8_row(&c->maps.label, y), r->x0, r->x1))
            continue;
        /* Empty rows are copied from the nearest full row above, at the top from the first one below. */
        for (int j = known + 1 > r->y0 ? known + 1 : r->y0; j < y; j++) {
            const int from = known >= 0 ? known : y;

            memcpy(sst_map_u16_row(&c->maps.disp, j) + r->x0, sst_map_u16_row(&c->maps.disp, from) + r->x0,
                   n * sizeof(uint16_t));
            memcpy(sst_map_u8_row(&c->maps.label, j) + r->x0, sst_map_u8_row(&c->maps.label, from) + r->x0, n);
        }
        known = y;
    }
    for (int j = known + 1; known >= 0 && j < r->y1; j++) {
        memcpy(sst_map_u16_row(&c->maps.disp, j) + r->x0, sst_map_u16_row(&c->maps.disp, known) + r->x0,
               n * sizeof(uint16_t));
        memcpy(sst_map_u8_row(&c->maps.label, j) + r->x0, sst_map_u8_row(&c->maps.label, known) + r->x0, n);
    }
}

/* Four times the mean green of 2x2 px. */
static void sum_green(uint16_t *restrict green4, const uint8_t *restrict a, const uint8_t *restrict b, int cells)
{
    for (int x = 0; x < cells; x++)
        green4[x] = (uint16_t)(a[2 * x] + a[2 * x + 1] + b[2 * x] + b[2 * x + 1]);
}

static void copy_cell(const struct strip *to, int at, int from)
{
    to->disp[at] = to->disp[from];
    to->label[at] = to->label[from];
    to->green4[at] = to->green4[from];
}

/* Fill the strip of row y with cells x0-1 .. x1. */
static void fill_strip(const struct enlarger *e, const struct scene_composer *c, const struct sst_image *img, int y)
{
    const struct strip *to = &e->row[y % 3];
    const int x0 = e->x0, x1 = e->x1;
    const uint8_t *a = sst_image_row(img, 1, 2 * y);
    const uint8_t *b = sst_image_row(img, 1, sst_min_int(2 * y + 1, img->height - 1));
    const int from = sst_max_int(x0 - 1, 0), end = sst_min_int(x1 + 1, c->width);
    const int whole = sst_min_int(end, img->width / 2); /* half a cell is left of an odd width */

    memcpy(to->disp + (from - x0), sst_map_u16_row(&c->maps.disp, y) + from, (size_t)(end - from) * sizeof(*to->disp));
    memcpy(to->label + (from - x0), sst_map_u8_row(&c->maps.label, y) + from, (size_t)(end - from));
    sum_green(to->green4 + (from - x0), a + 2 * from, b + 2 * from, whole - from);
    if (whole < end)
        to->green4[whole - x0] = (uint16_t)(2 * (a[2 * whole] + b[2 * whole]));
    if (from == x0)
        copy_cell(to, -1, 0);
    if (end == x1)
        copy_cell(to, x1 - x0, x1 - x0 - 1);
}

/* Pixels of the cells at work in row py, of which `cells` is the row and `other` the one next to it. */
static void enlarge(const struct enlarger *e, struct sst_view *v, const struct strip *cells, const struct strip *other,
                    int py)
{
    const int x0 = e->x0, x1 = e->x1;
    const int n = sst_min_int(2 * x1, v->disp.width) - 2 * x0;
    const struct sst_enlarge rows = { { cells->disp, other->disp },
                                      { cells->green4, other->green4 },
                                      { cells->label, other->label },
                                      sst_image_row(&v->image, 1, py) + 2 * x0,
                                      STEP_Q6 };
    const uint8_t *valid = v->valid.data ? sst_map_u8_row(&v->valid, py) + 2 * x0 : NULL;

    sst_kernels_get()->enlarge_row(e->disp, e->label, &rows, (size_t)(x1 - x0));
    for (int i = 0; valid && i < n; i++) {
        e->disp[i] = valid[i] ? e->disp[i] : (uint16_t)SST_DISP_NONE;
        e->label[i] = valid[i] ? e->label[i] : SST_LABEL_NONE;
    }
    memcpy(sst_map_u16_row(&v->disp, py) + 2 * x0, e->disp, (size_t)n * sizeof(*e->disp));
    if (e->labels)
        memcpy(sst_map_u8_row(&v->label, py) + 2 * x0, e->label, (size_t)n);
}

/* Upsample a rectangle of cells: each pixel gets its own cell of the four around it, or the cell of another
 * surface that is more similar in colour. */
static void enlarge_tiles(const struct scene_composer *c, struct sst_view *v, const struct sst_rect *r, bool labels)
{
    struct enlarger e = enlarger_of(c);

    e.x0 = r->x0;
    e.x1 = r->x1;
    e.labels = labels;
    for (int y = sst_max_int(r->y0 - 1, 0); y < sst_min_int(r->y0 + 1, c->height); y++)
        fill_strip(&e, c, &v->image, y);
    for (int y = r->y0; y < r->y1; y++) {
        const int up = sst_max_int(y - 1, 0), down = sst_min_int(y + 1, c->height - 1);

        fill_strip(&e, c, &v->image, down);
        enlarge(&e, v, &e.row[y % 3], &e.row[up % 3], 2 * y);
        if (2 * y + 1 < v->disp.height)
            enlarge(&e, v, &e.row[y % 3], &e.row[down % 3], 2 * y + 1);
    }
}

/* Runs of changed tiles of a rectangle, row by row. */
static void enlarge_changed(const struct scene_composer *c, struct sst_view *v, const struct sst_rect *r, bool labels)
{
    const int right = (r->x1 + SST_SCENE_CELLS - 1) / SST_SCENE_CELLS;

    for (int y = r->y0; y < r->y1; y += SST_SCENE_CELLS) {
        const uint8_t *tiles = c->changed + y / SST_SCENE_CELLS * c->cols;

        for (int col = r->x0 / SST_SCENE_CELLS, end; col < right; col = end + 1) {
            for (end = col; end < right && tiles[end]; end++)
                ;
            if (end > col)
                enlarge_tiles(c, v,
                              &(struct sst_rect){ col * SST_SCENE_CELLS, y,
                                                  sst_min_int(end * SST_SCENE_CELLS, c->width),
                                                  sst_min_int(y + SST_SCENE_CELLS, c->height) },
                              labels);
        }
    }
}

void scene_compose(struct scene_composer *c, struct sst_lightfield *lf, int view, const struct scene_keys *keys,
                   const uint8_t *dirty)
{
    struct sst_rect rects[SST_SCENE_RECTS];
    struct sst_view *v = &lf->views[view];
    int n;

    if (!count_changed(c, dirty))
        return;
    /* With a margin of a tile, to fill and to upsample from. */
    n = scene_gather(rects, (struct scene_dirty){ c->changed, c->cols }, c->rows, c->width, c->height);
    for (int i = 0; i < n; i++) {
        for (int y = rects[i].y0; y < rects[i].y1; y++)
            memset(c->z + (size_t)y * (size_t)c->width + rects[i].x0, 0,
                   (size_t)(rects[i].x1 - rects[i].x0) * sizeof(*c->z));
    }
    for (int k = 0; k < keys->count; k++)
        land(c, lf, view, &keys->key[k], rank_of(lf, view, keys->key, keys->count, k));
    for (int i = 0; i < n; i++) {
        collect(c, v, &rects[i], keys->labels);
        close_gaps(c, &rects[i]);
        fill(c, &rects[i]);
    }
    for (int i = 0; i < n; i++)
        enlarge_changed(c, v, &rects[i], keys->labels);
}
