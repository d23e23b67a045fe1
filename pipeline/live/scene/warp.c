#include <errno.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/live/scene/scene_internal.h"

/* Priority of a warped cell, larger is better: confirmed cells first, then those of the key nearest to the view, which
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

    err = err ? err : sst_map_u8_init(&made.maps.label, width, height);
    made.z = sst_mem_alloc((size_t)width * (size_t)height, sizeof(*made.z));
    made.strips = sst_mem_alloc(9 * STRIP_CELLS(width) + 3 * (size_t)width, sizeof(*made.strips));
    if (!err && (!made.z || !made.strips))
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
}

/* The changed tiles' cells; x0 == x1: none. */
static struct scene_rect bounds(const struct scene_composer *c, const uint8_t *dirty, int cols, int rows)
{
    struct scene_rect r = { cols, rows, 0, 0 };

    for (int y = 0; y < rows; y++) {
        for (int x = 0; x < cols; x++) {
            if (!dirty[y * cols + x])
                continue;
            r.x0 = sst_min_int(r.x0, x);
            r.x1 = sst_max_int(r.x1, x + 1);
            r.y0 = sst_min_int(r.y0, y);
            r.y1 = y + 1;
        }
    }
    if (r.x1 == 0)
        return (struct scene_rect){ 0 };
    return (struct scene_rect){ r.x0 * SST_SCENE_CELLS, r.y0 * SST_SCENE_CELLS,
                                sst_min_int(r.x1 * SST_SCENE_CELLS, c->width),
                                sst_min_int(r.y1 * SST_SCENE_CELLS, c->height) };
}

/* First and last + 1 source position along an axis from which a cell can be warped to lo .. hi-1. */
static void sources(int *first, int *end, int lo, int hi, int size, int64_t near_q6, int64_t far_q6, int64_t b_q16)
{
    const int a = scene_shift(near_q6, b_q16), b = scene_shift(far_q6, b_q16);

    *first = sst_clamp_int(lo + sst_min_int(a, b), 0, size);
    *end = sst_clamp_int(hi + sst_max_int(a, b), 0, size);
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

/* Warp the cells of a key into the rectangle. */
static void land(struct scene_composer *c, const struct sst_lightfield *lf, int view, const struct scene_key *key,
                 uint32_t rank, const struct scene_rect *r)
{
    const uint32_t base = THERE | rank << RANK_SHIFT;
    const struct scene_warp way = scene_warp(lf, key->view, view);
    const int64_t far_q6 = way.zero_q6, near_q6 = llround(lf->range_max_px * SST_DISP_SCALE) + 64;
    int x0, x1, y0, y1;

    sources(&x0, &x1, r->x0, r->x1, c->width, near_q6, far_q6, way.bx_q16);
    sources(&y0, &y1, r->y0, r->y1, c->height, near_q6, far_q6, way.by_q16);
    for (int y = y0; y < y1; y++) {
        const uint16_t *disp = sst_map_u16_row(&key->maps.disp, y);
        const uint8_t *label = sst_map_u8_row(&key->maps.label, y),
                      *confirmed = sst_map_u8_row(&key->maps.confirmed, y);

        for (int x = x0; x < x1; x++) {
            const int64_t d = way.zero_q6 + disp[x];
            const int tx = x - scene_shift(d, way.bx_q16), ty = y - scene_shift(d, way.by_q16);
            const uint32_t v = base | (confirmed[x] ? CONFIRMED : 0) | (uint32_t)disp[x] << DISP_SHIFT | label[x];
            uint32_t *at;

            if (tx < r->x0 || tx >= r->x1 || ty < r->y0 || ty >= r->y1 || disp[x] == SST_DISP_NONE)
                continue;
            at = &c->z[(size_t)ty * (size_t)c->width + (size_t)tx];
            *at = v > *at ? v : *at;
        }
    }
}

/* Collect warped cells of changed tiles, and the existing maps of the view around them. */
static void collect(struct scene_composer *c, const struct sst_view *v, const struct scene_rect *r,
                    const uint8_t *dirty, int cols, bool labels)
{
    for (int y = r->y0; y < r->y1; y++) {
        const uint8_t *tiles = dirty + y / SST_SCENE_CELLS * cols;
        const uint32_t *z = c->z + (size_t)y * (size_t)c->width;
        uint16_t *disp = sst_map_u16_row(&c->maps.disp, y);
        uint8_t *label = sst_map_u8_row(&c->maps.label, y);

        for (int x = r->x0; x < r->x1; x++) {
            if (!tiles[x / SST_SCENE_CELLS]) {
                disp[x] = sst_map_u16_row(&v->disp, 2 * y)[2 * x];
                label[x] = labels ? sst_map_u8_row(&v->label, 2 * y)[2 * x] : SST_LABEL_NONE;
            } else {
                disp[x] = z[x] ? (uint16_t)(z[x] >> DISP_SHIFT) : (uint16_t)SST_DISP_NONE;
                label[x] = (uint8_t)z[x];
            }
        }
    }
}

/* True for a single cell in a gap between cells of a nearer surface, a and b on both sides. */
static bool shows_through(int d, int a, int b)
{
    return d != (int)SST_DISP_NONE && a != (int)SST_DISP_NONE && b != (int)SST_DISP_NONE && a > d + STEP_Q6 &&
           b > d + STEP_Q6;
}

/* Close gaps of one cell: slanted surfaces get wider from view to view. */
static void close_gaps(struct scene_composer *c, const struct scene_rect *r, const uint8_t *dirty, int cols)
{
    for (int y = r->y0; y < r->y1; y++) {
        const uint8_t *tiles = dirty + y / SST_SCENE_CELLS * cols;
        uint16_t *d = sst_map_u16_row(&c->maps.disp, y);
        uint8_t *l = sst_map_u8_row(&c->maps.label, y);

        for (int x = r->x0; x < r->x1; x++) {
            if (!tiles[x / SST_SCENE_CELLS])
                continue;
            if (x > r->x0 && x + 1 < r->x1 && shows_through(d[x], d[x - 1], d[x + 1])) {
                const int from = d[x - 1] < d[x + 1] ? x - 1 : x + 1;

                l[x] = l[from];
                d[x] = d[from];
            } else if (y > r->y0 && y + 1 < r->y1) {
                const int up = sst_map_u16_row(&c->maps.disp, y - 1)[x],
                          down = sst_map_u16_row(&c->maps.disp, y + 1)[x];

                if (shows_through(d[x], up, down)) {
                    l[x] = sst_map_u8_row(&c->maps.label, up < down ? y - 1 : y + 1)[x];
                    d[x] = (uint16_t)sst_min_int(up, down);
                }
            }
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

static void fill(struct scene_composer *c, const struct scene_rect *r)
{
    const size_t n = (size_t)(r->x1 - r->x0);
    int known = -1;

    for (int y = r->y0; y < r->y1; y++) {
        if (!fill_row(sst_map_u16_row(&c->maps.disp, y), sst_map_u8_row(&c->maps.label, y), r->x0, r->x1))
            continue;
        /* Empty rows are copied from the nearest full row above; those at the top from the first one below. */
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

/* Fill a strip with cells x0-1 .. x1 of row y. */
static void fill_strip(const struct strip *to, const struct scene_composer *c, const struct sst_image *img, int x0,
                       int x1, int y)
{
    const uint8_t *a = sst_image_row(img, 1, 2 * y);
    const uint8_t *b = sst_image_row(img, 1, sst_min_int(2 * y + 1, img->height - 1));
    const uint16_t *disp = sst_map_u16_row(&c->maps.disp, y);
    const uint8_t *label = sst_map_u8_row(&c->maps.label, y);

    for (int x = x0 - 1; x <= x1; x++) {
        const int at = sst_clamp_int(x, 0, c->width - 1), left = 2 * at, right = sst_min_int(left + 1, img->width - 1);

        to->disp[x - x0] = disp[at];
        to->label[x - x0] = label[at];
        to->green4[x - x0] = (uint16_t)(a[left] + a[right] + b[left] + b[right]);
    }
}

/* Pixels of cells x0 .. x1-1 in row py, of which `cells` is the row and `other` the one next to it. */
static void enlarge(const struct enlarger *e, struct sst_view *v, const struct strip *cells, const struct strip *other,
                    int x0, int x1, int py, bool labels)
{
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
    if (labels)
        memcpy(sst_map_u8_row(&v->label, py) + 2 * x0, e->label, (size_t)n);
}

/* Upsample cells x0 .. x1-1, y0 .. y1-1: each pixel gets its own cell of the four around it, or that of another surface
 * which is more similar in colour. */
static void enlarge_tiles(const struct scene_composer *c, struct sst_view *v, int x0, int x1, int y0, int y1,
                          bool labels)
{
    const struct enlarger e = enlarger_of(c);

    for (int y = sst_max_int(y0 - 1, 0); y < sst_min_int(y0 + 1, c->height); y++)
        fill_strip(&e.row[y % 3], c, &v->image, x0, x1, y);
    for (int y = y0; y < y1; y++) {
        const int up = sst_max_int(y - 1, 0), down = sst_min_int(y + 1, c->height - 1);

        fill_strip(&e.row[down % 3], c, &v->image, x0, x1, down);
        enlarge(&e, v, &e.row[y % 3], &e.row[up % 3], x0, x1, 2 * y, labels);
        if (2 * y + 1 < v->disp.height)
            enlarge(&e, v, &e.row[y % 3], &e.row[down % 3], x0, x1, 2 * y + 1, labels);
    }
}

/* Runs of changed tiles, row by row. */
static void enlarge_changed(const struct scene_composer *c, struct sst_view *v, const uint8_t *dirty, int cols,
                            int rows, bool labels)
{
    for (int row = 0; row < rows; row++) {
        for (int col = 0, end; col < cols; col = end + 1) {
            for (end = col; end < cols && dirty[row * cols + end]; end++)
                ;
            if (end > col)
                enlarge_tiles(c, v, col * SST_SCENE_CELLS, sst_min_int(end * SST_SCENE_CELLS, c->width),
                              row * SST_SCENE_CELLS, sst_min_int((row + 1) * SST_SCENE_CELLS, c->height), labels);
        }
    }
}

void scene_compose(struct scene_composer *c, struct sst_lightfield *lf, int view, const struct scene_key *keys,
                   int count, const uint8_t *dirty, int cols, int rows, bool labels)
{
    const struct scene_rect r = bounds(c, dirty, cols, rows);
    /* With a margin, to fill and to upsample from. */
    const struct scene_rect wide = { sst_max_int(r.x0 - SST_SCENE_CELLS, 0), sst_max_int(r.y0 - 1, 0),
                                     sst_min_int(r.x1 + SST_SCENE_CELLS, c->width), sst_min_int(r.y1 + 1, c->height) };
    struct sst_view *v = &lf->views[view];

    if (r.x0 == r.x1)
        return;
    for (int y = r.y0; y < r.y1; y++)
        memset(c->z + (size_t)y * (size_t)c->width + r.x0, 0, (size_t)(r.x1 - r.x0) * sizeof(*c->z));
    for (int k = 0; k < count; k++)
        land(c, lf, view, &keys[k], rank_of(lf, view, keys, count, k), &r);
    collect(c, v, &wide, dirty, cols, labels);
    close_gaps(c, &wide, dirty, cols);
    fill(c, &wide);
    enlarge_changed(c, v, dirty, cols, rows, labels);
}
