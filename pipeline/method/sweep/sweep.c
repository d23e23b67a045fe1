/*
 * The plane sweep in scene space (design.md, 5.7). Rows of bytes of all views are compared at once: at a plane, pixels
 * of a view move by one shift, so that nothing is gathered pixel by pixel. Tiles of rows bound the memory: of each
 * plane only the rows are kept that the views' rows in work show.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/sweep/sweep.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/method/sweep/sweep_internal.h"

#define BYTES     ((size_t)3 << 30)
#define APART     ((size_t)256 << 20) /* bytes of planes from which on groups take turns apart */
#define TOLERANCE 2                   /* planes that are nearer to each other are one surface */
#define CLAIMS    3                   /* views that must claim a plane at some pixel of a block, at most, ... */
#define CLAIMED   9                   /* ... or one view in this many voters, if that is fewer */
#define REPEATED  1                   /* times that the second round is repeated; in noise twice */
#define NOISE     64                  /* levels of noise that count, at most */
#define BAND      8                   /* rows of all planes that a thread computes: the views' rows stay in the cache */
/* Thresholds of the second round: where views differ little from the consensus, and where they differ much, by noise or
 * by texture that whole pixels do not align. */
static const struct {
    int cost; /* median of the first round */
    int near, most, p2;
} thresholds[2] = { { 22, 28, 60, 40 }, { 36, 40, 80, 25 } };

static int add_view(struct sweep *s, int k)
{
    const struct sst_planesweep_view *in = &s->in->view[k];
    struct sweep_view *v = &s->view[k];
    const bool masked = in->seen && in->seen->data;
    const size_t bytes = s->stride * (size_t)s->height;

    for (int c = 0; c < 3; c++) {
        v->colour[c] = sst_mem_alloc(bytes, 1);
        if (!v->colour[c])
            return -ENOMEM;
        for (int y = 0; y < s->height; y++)
            memcpy(v->colour[c] + (size_t)y * s->stride + SWEEP_PAD, sst_image_row(in->image, c, y), (size_t)s->width);
    }
    v->plane = sst_mem_alloc(bytes, 1);
    v->seen = masked ? sst_mem_alloc(bytes, 1) : NULL;
    if (!v->plane || (masked && !v->seen))
        return -ENOMEM;
    for (int y = 0; masked && y < s->height; y++) {
        const uint8_t *seen = sst_map_u8_row(in->seen, y);

        for (int x = 0; x < s->width; x++)
            v->seen[(size_t)y * s->stride + SWEEP_PAD + (size_t)x] = seen[x] ? 255 : 0;
    }
    return 0;
}

static int add_view_job(void *arg, int k, int worker SST_UNUSED)
{
    struct sweep *s = arg;
    const struct sst_planesweep_view *in = &s->in->view[k];
    int err;

    if (!in->image)
        return 0;
    err = sst_map_u16_init(in->disp, s->width, s->height);
    err = err ? err : sst_map_u8_init(in->cost, s->width, s->height);
    return err ? err : add_view(s, k);
}

/* The views that vote: each the farthest from all before it, the first one in the middle. */
static void choose_voters(struct sweep *s)
{
    const struct sst_planesweep_view *view = s->in->view;
    double middle[2] = { 0 };
    int present = 0;

    for (int k = 0; k < s->in->views; k++) {
        if (!view[k].image)
            continue;
        middle[0] += view[k].bx;
        middle[1] += view[k].by;
        present++;
    }
    for (s->voters = 0; s->voters < present && s->voters < SST_CONSENSUS_VIEWS; s->voters++) {
        double best = -1;
        int next = -1;

        for (int k = 0; k < s->in->views; k++) {
            double far = s->voters
                             ? INFINITY
                             : 1 / (1 + hypot(view[k].bx - middle[0] / present, view[k].by - middle[1] / present));
            bool votes = false;

            for (int i = 0; i < s->voters; i++) {
                votes = votes || s->voter[i] == k;
                far = fmin(far, hypot(view[k].bx - view[s->voter[i]].bx, view[k].by - view[s->voter[i]].by));
            }
            if (view[k].image && !votes && far > best) {
                best = far;
                next = k;
            }
        }
        s->voter[s->voters] = next;
    }
}

/* Turns apart: groups whose first rows lie further down in the scene take their tiles later, so that views in work show
 * rows of a plane that are near to each other, and few rows are kept. */
static void take_turns_apart(struct sweep *s)
{
    const double middle = (s->in->disp_min_px + s->in->range / 2.0) / SWEEP_TILE;
    double least = INFINITY;
    int last = 0;

    for (int pass = 0; pass < 2; pass++) {
        for (int g = 0; g < s->groups; g++) {
            double sum = 0;
            int n = 0;

            for (int k = g * s->together; k < sst_min_int((g + 1) * s->together, s->in->views); k++) {
                sum += s->in->view[k].image ? middle * s->in->view[k].by : 0;
                n += s->in->view[k].image != NULL;
            }
            if (n && !pass)
                least = fmin(least, sum / n);
            else if (n)
                s->first_turn[g] = (int)floor(sum / n - least + 0.5);
            last = sst_max_int(last, s->first_turn[g]);
        }
    }
    s->turns += last;
}

static void set_tiles(struct sweep *s, int turn)
{
    for (int k = 0; k < s->in->views; k++) {
        const int tile = turn - s->first_turn[k / s->together];

        s->view[k].top = sst_clamp_int(tile * SWEEP_TILE, 0, s->height);
        s->view[k].bottom = sst_clamp_int((tile + 1) * SWEEP_TILE, 0, s->height);
    }
}

/* Rows of a plane that the views in work show. @return false: none */
static bool shown_rows(const struct sweep *s, const struct sweep_plane *p, int *first, int *end)
{
    *first = INT32_MAX;
    *end = INT32_MIN;
    for (int k = 0; k < s->in->views; k++) {
        const struct sweep_view *v = &s->view[k];
        const int top = sst_max_int(v->top - 1, 0), bottom = sst_min_int(v->bottom + SWEEP_LOOK + 1, s->height);

        if (!s->in->view[k].image || v->top >= v->bottom)
            continue;
        *first = sst_min_int(*first, top + p->shift[k][1]);
        *end = sst_max_int(*end, bottom + p->shift[k][1]);
    }
    return *first < *end;
}

/* Rows that are kept: as many as the views of a turn show, and as are computed in one. */
static int kept_rows(struct sweep *s, const struct sweep_plane *p)
{
    int rows = 0, to = p->y0;

    for (int turn = 0; turn < s->turns; turn++) {
        const int from = to;
        int first, end;

        set_tiles(s, turn);
        if (!shown_rows(s, p, &first, &end))
            continue;
        to = sst_max_int(to, end);
        rows = sst_max_int(rows, to - sst_min_int(first, from));
    }
    return rows;
}

/* Shifts of a plane, and the area that all views cover together. @return bytes of its consensus */
static size_t place_plane(struct sweep *s, int i)
{
    const double d = s->in->disp_min_px + i * s->step / 64.0;
    struct sweep_plane *p = &s->plane[i];
    int right = INT32_MIN;

    p->x0 = p->y0 = INT32_MAX;
    for (int k = 0; k < s->in->views; k++) {
        const struct sst_planesweep_view *v = &s->in->view[k];
        const int x = (int)floor(d * v->bx + 0.5), y = (int)floor(d * v->by + 0.5);

        if (!v->image)
            continue;
        p->shift[k][0] = x;
        p->shift[k][1] = y;
        p->x0 = sst_min_int(p->x0, x);
        right = sst_max_int(right, x);
        p->y0 = sst_min_int(p->y0, y);
    }
    p->rows = kept_rows(s, p);
    p->stride = sst_mem_stride((size_t)(right - p->x0) + (size_t)s->width, 1) + SST_CONSENSUS_BLOCK;
    p->blocks = (int)(p->stride / SST_CONSENSUS_BLOCK) - 1;
    return 4 * p->stride * (size_t)p->rows;
}

static size_t place_planes(struct sweep *s)
{
    size_t bytes = 0;

    for (int i = 0; i < s->planes; i++)
        bytes += place_plane(s, i);
    return bytes;
}

static int make_planes(struct sweep *s)
{
    const size_t most = s->in->bytes ? s->in->bytes : BYTES;
    size_t bytes;

    s->plane = calloc((size_t)s->planes, sizeof(*s->plane));
    s->first_turn = calloc((size_t)s->groups, sizeof(*s->first_turn));
    if (!s->plane || !s->first_turn)
        return -ENOMEM;
    for (int i = 0; i < s->planes; i++) {
        s->plane[i].shift = calloc((size_t)s->in->views, sizeof(*s->plane[i].shift));
        if (!s->plane[i].shift)
            return -ENOMEM;
    }
    s->turns = (s->height + SWEEP_TILE - 1) / SWEEP_TILE;
    bytes = place_planes(s);
    if (bytes > APART || bytes > most) {
        take_turns_apart(s);
        bytes = place_planes(s);
    }
    if (bytes > most || s->planes > SWEEP_PLANES)
        return -E2BIG;
    for (int i = 0; i < s->planes; i++) {
        s->plane[i].consensus = sst_mem_alloc_raw(4 * s->plane[i].stride * (size_t)s->plane[i].rows, 1);
        s->plane[i].claimed = sst_mem_alloc((size_t)s->plane[i].blocks * (size_t)s->plane[i].rows, 1);
        if (!s->plane[i].consensus || !s->plane[i].claimed)
            return -ENOMEM;
    }
    return 0;
}

/* Rows of the voters at row y of a plane. @return how many have it */
static int voters_at(const struct sweep *s, const struct sweep_plane *p, int y, struct sst_consensus_view *row,
                     int *left)
{
    int n = 0;

    for (int i = 0; i < s->voters; i++) {
        const int k = s->voter[i], own = y - p->shift[k][1];
        const struct sweep_view *v = &s->view[k];
        const ptrdiff_t at = (ptrdiff_t)own * (ptrdiff_t)s->stride + SWEEP_PAD;

        if (own < 0 || own >= s->height)
            continue;
        row[n] = (struct sst_consensus_view){ { v->colour[0] + at, v->colour[1] + at, v->colour[2] + at },
                                              v->seen ? v->seen + at : s->all + SWEEP_PAD,
                                              v->plane + at };
        left[n++] = p->shift[k][0];
    }
    return n;
}

/* The consensus of row y of plane i. */
static void find_row(const struct sweep *s, int i, int y)
{
    const struct sweep_plane *p = &s->plane[i];
    const struct sst_consensus_test test = { (uint8_t)sst_max_int(i - TOLERANCE, 0), (uint8_t)(i + TOLERANCE), s->near,
                                             s->most, s->claims };
    const size_t at_row = (size_t)((y - p->y0) % p->rows);
    uint8_t *to = p->consensus + at_row * 4 * p->stride, *claimed = p->claimed + at_row * (size_t)p->blocks;
    struct sst_consensus_view row[SST_CONSENSUS_VIEWS], at[SST_CONSENSUS_VIEWS];
    int left[SST_CONSENSUS_VIEWS];
    const int rows = voters_at(s, p, y, row, left);

    for (int b = 0, x = 0; b < p->blocks; b++, x += SST_CONSENSUS_BLOCK, to += SST_CONSENSUS_BLOCK) {
        uint8_t *const out[4] = { to, to + p->stride, to + 2 * p->stride, to + 3 * p->stride };
        int n = 0;

        for (int k = 0; k < rows; k++) {
            const int own = x + p->x0 - left[k]; /* column of the view that the block begins with */

            if (own <= -SST_CONSENSUS_BLOCK || own >= s->width)
                continue;
            at[n++] =
                (struct sst_consensus_view){ { row[k].colour[0] + own, row[k].colour[1] + own, row[k].colour[2] + own },
                                             row[k].seen + own,
                                             row[k].plane + own };
        }
        if (s->again)
            claimed[b] = sst_kernels_get()->consensus_again(out, at, n, &test);
        else
            sst_kernels_get()->consensus_first(out, at, n);
    }
}

static int find_first_band(const struct sweep *s)
{
    int first = INT32_MAX;

    for (int i = 0; i < s->planes; i++)
        first = sst_min_int(first, s->plane[i].from);
    return first;
}

static int find_band(void *arg, int band, int worker SST_UNUSED)
{
    const struct sweep *s = arg;
    const int top = find_first_band(s) + band * BAND;

    if (s->in->cancel && *s->in->cancel)
        return -ECANCELED;
    for (int i = 0; i < s->planes; i++) {
        const struct sweep_plane *p = &s->plane[i];

        for (int y = sst_max_int(top, p->from); y < top + BAND && y < p->to; y++)
            find_row(s, i, y);
    }
    return 0;
}

/* The consensus of the rows that the views in work show and that are not there yet. */
static int find_consensus(struct sweep *s, bool first_turn)
{
    int last = INT32_MIN, err;

    for (int i = 0; i < s->planes; i++) {
        struct sweep_plane *p = &s->plane[i];
        int first, end;

        p->from = first_turn ? p->y0 : p->to;
        p->to = shown_rows(s, p, &first, &end) ? sst_max_int(end, p->from) : p->from;
        last = sst_max_int(last, p->to);
    }
    err = sst_parallel_for((last - find_first_band(s) + BAND - 1) / BAND, s->in->threads, find_band, s);
    return err;
}

static int sweep_round(struct sweep *s, bool again)
{
    int err = 0;

    s->again = again;
    for (int turn = 0; !err && turn < s->turns; turn++) {
        set_tiles(s, turn);
        err = find_consensus(s, !turn);
        err = err ? err : sst_parallel_for(s->groups, s->workers, sweep_maps, s);
    }
    return err;
}

/* The median cost of the first round. */
static int median_cost(const struct sweep *s)
{
    int64_t pixels = 0, below = 0;
    int cost = 0;

    for (int k = 0; k < s->in->views; k++) {
        for (int c = 0; c < 256; c++)
            pixels += s->view[k].costs[c];
    }
    for (; cost < 255; cost++) {
        for (int k = 0; k < s->in->views; k++)
            below += s->view[k].costs[cost];
        if (2 * below >= pixels)
            break;
    }
    return cost;
}

/* Thresholds of the second round by that. */
static void set_thresholds(struct sweep *s, int median)
{
    const int low = thresholds[0].cost, span = thresholds[1].cost - low;
    const int part = sst_clamp_int(median - low, 0, span);

    s->near = (uint8_t)(thresholds[0].near + (thresholds[1].near - thresholds[0].near) * part / span);
    s->most = (uint8_t)(thresholds[0].most + (thresholds[1].most - thresholds[0].most) * part / span);
    s->p2 = (uint8_t)(thresholds[0].p2 + (thresholds[1].p2 - thresholds[0].p2) * part / span);
}

/* Groups of as many views as leave no thread waiting. */
static void choose_groups(struct sweep *s)
{
    const int views = s->in->views, threads = s->in->threads;
    int least = INT32_MAX;

    for (int together = SWEEP_TOGETHER; together > 0; together--) {
        const int groups = (views + together - 1) / together, turns = (groups + threads - 1) / threads;

        if (turns * together < least) {
            least = turns * together;
            s->together = together;
            s->groups = groups;
        }
    }
    s->workers = sst_min_int(threads, s->groups);
}

/* Noise of a view, 1/256 level. */
static uint16_t noise_of(const struct sst_image *image)
{
    return (uint16_t)lround(256 * fmin(sst_image_noise(image), NOISE));
}

static int sweep_init(struct sweep *s, const struct sst_planesweep *in, int step)
{
    int err;

    *s = (struct sweep){ .in = in, .step = step };
    for (int k = 0; k < in->views; k++) {
        if (in->view[k].image) {
            s->width = in->view[k].image->width;
            s->height = in->view[k].image->height;
            s->noise = s->noise ? s->noise : noise_of(in->view[k].image);
        }
    }
    s->planes = (in->range * 64 + s->step - 1) / s->step + 1;
    s->blocks = (s->width + SST_CONSENSUS_BLOCK - 1) / SST_CONSENSUS_BLOCK;
    s->stride = sst_mem_stride((size_t)s->width, 1) + 2 * SWEEP_PAD;
    s->layer = s->stride * (size_t)s->planes;
    s->packed = (size_t)s->blocks * SST_CONSENSUS_BLOCK * (size_t)s->planes;
    s->view = calloc((size_t)in->views, sizeof(*s->view));
    s->all = sst_mem_alloc(s->stride, 1);
    if (!s->view || !s->all)
        return -ENOMEM;
    memset(s->all + SWEEP_PAD, 255, (size_t)s->width);
    choose_groups(s);
    choose_voters(s);
    s->claims = (uint8_t)sst_clamp_int(s->voters / CLAIMED, 1, CLAIMS);
    err = make_planes(s);
    err = err ? err : sst_parallel_for(in->views, in->threads, add_view_job, s);
    return err ? err : sweep_maps_init(s);
}

static void sweep_fini(struct sweep *s)
{
    sweep_maps_fini(s);
    for (int k = 0; s->view && k < s->in->views; k++) {
        for (int c = 0; c < 3; c++)
            sst_mem_free(s->view[k].colour[c]);
        sst_mem_free(s->view[k].seen);
        sst_mem_free(s->view[k].plane);
    }
    for (int i = 0; s->plane && i < s->planes; i++) {
        free(s->plane[i].shift);
        sst_mem_free(s->plane[i].consensus);
        sst_mem_free(s->plane[i].claimed);
    }
    free(s->plane);
    free(s->view);
    free(s->first_turn);
    sst_mem_free(s->all);
}

/* Rows of cells of 2x2 pixels, with a cell more on both sides. */
struct cells {
    uint16_t *disp[2], *green4[2], *out;
    uint8_t *label;
};

/* The disparities of row y of maps of half size, and four times the green of its cells. */
static void load_cells(const struct cells *c, int at, const struct sweep *s, int k, int y)
{
    const uint8_t *a = s->view[k].colour[1] + (size_t)(2 * y) * s->stride + SWEEP_PAD;
    const uint8_t *b = 2 * y + 1 < s->height ? a + s->stride : a;
    const int n = (s->width + 1) / 2, last = s->width - 1;
    uint16_t *disp = c->disp[at], *green4 = c->green4[at];

    memcpy(disp + 1, sst_map_u16_row(&s->start[k], y), (size_t)n * sizeof(*disp));
    for (int x = 0; x < n; x++) {
        const int right = sst_min_int(2 * x + 1, last);

        green4[x + 1] = (uint16_t)(a[2 * x] + a[right] + b[2 * x] + b[right]);
    }
    disp[0] = disp[1];
    green4[0] = green4[1];
    disp[n + 1] = disp[n];
    green4[n + 1] = green4[n];
}

/* Planes of row y from maps of half size: where another surface is beside, the cell of the nearest colour has it. */
static void start_row(const struct cells *c, const struct sweep *s, int k, int y)
{
    uint8_t *plane = s->view[k].plane + (size_t)y * s->stride + SWEEP_PAD;
    const int rows = s->start[k].height, beside = sst_clamp_int(y / 2 + (y % 2 ? 1 : -1), 0, rows - 1);
    const struct sst_enlarge e = { { c->disp[0] + 1, c->disp[1] + 1 },
                                   { c->green4[0] + 1, c->green4[1] + 1 },
                                   { c->label + 1, c->label + 1 },
                                   s->view[k].colour[1] + (size_t)y * s->stride + SWEEP_PAD,
                                   s->step };

    load_cells(c, 0, s, k, y / 2);
    load_cells(c, 1, s, k, beside);
    sst_kernels_get()->enlarge_row(c->out, c->label + s->width + 4, &e, (size_t)(s->width + 1) / 2);
    for (int x = 0; x < s->width; x++)
        plane[x] = (uint8_t)sst_min_int((2 * c->out[x] + s->step / 2) / s->step, s->planes - 1);
}

static int start_view(void *arg, int k, int worker SST_UNUSED)
{
    struct sweep *s = arg;
    const size_t n = (size_t)s->width + 4;
    uint16_t *memory = sst_mem_alloc(5 * n, sizeof(*memory));
    uint8_t *label = sst_mem_alloc(2 * n, 1);
    const struct cells c = { { memory, memory + n }, { memory + 2 * n, memory + 3 * n }, memory + 4 * n, label };
    const int err = memory && label ? 0 : -ENOMEM;

    for (int y = 0; !err && s->in->view[k].image && y < s->height; y++)
        start_row(&c, s, k, y);
    sst_mem_free(memory);
    sst_mem_free(label);
    return err;
}

/* Planes of view k from its map, for the next round. */
static int renew_view(void *arg, int k, int worker SST_UNUSED)
{
    struct sweep *s = arg;

    for (int y = 0; s->in->view[k].image && y < s->height; y++) {
        const uint16_t *disp = sst_map_u16_row(s->in->view[k].disp, y);
        uint8_t *plane = s->view[k].plane + (size_t)y * s->stride + SWEEP_PAD;

        for (int x = 0; x < s->width; x++)
            plane[x] = (uint8_t)sst_min_int((disp[x] + s->step / 2) / s->step, s->planes - 1);
    }
    return 0;
}

/* The second round, and where the first one was at whole size, the same from its maps. */
static int sweep_again(struct sweep *s, bool whole, int median)
{
    const int repeated = s->start || !whole ? 0 : REPEATED + (median >= thresholds[1].cost);
    int err = sweep_round(s, true);

    s->own = true;
    for (int i = 0; !err && i < repeated; i++) {
        err = sst_parallel_for(s->in->views, s->in->threads, renew_view, s);
        err = err ? err : sweep_round(s, true);
    }
    return err;
}

int sweep_run(const struct sst_planesweep *in, int step, const struct sst_map_u16 *start, bool whole, int *median)
{
    struct sweep s;
    int err = sweep_init(&s, in, step);

    s.start = start;
    s.own = start;
    if (!err && start)
        err = sst_parallel_for(in->views, in->threads, start_view, &s);
    else if (!err)
        err = sweep_round(&s, false);
    if (!err && !start)
        *median = median_cost(&s);
    if (!err)
        set_thresholds(&s, *median);
    if (!err && (whole || *median <= SWEEP_SURE))
        err = sweep_again(&s, whole, *median);
    sweep_fini(&s);
    return err;
}
