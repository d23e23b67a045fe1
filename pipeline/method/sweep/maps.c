/* The maps of a view from the consensus of the planes (sweep.c): costs, their means over pixels that look alike, in the
 * second round paths along the diagonals, and the cheapest plane. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/method/sweep/sweep_internal.h"

#define ALIKE     40 /* levels: pixels around count up to this colour step */
#define FLAT      4  /* levels: in flat surfaces none around has a larger step */
#define DEARER    12 /* levels: the nearest plane costs more there, in the first round; ... */
#define FARTHER   2  /* ... elsewhere the farthest one, by one more for each level of noise */
#define P1        6  /* penalties of paths */
#define EDGE_STEP 10 /* levels: beyond it P2 is a quarter */
#define FIRST     51 /* largest cost of the first round */

enum { PLANE, BEFORE, SUM, AFTER, COST }; /* rows of a choice */

/* A view in work. */
struct mapped {
    const struct sweep *s;
    int k;
    struct sweep_view *v;
    struct sweep_scratch *own;
    struct sweep_costs *costs;
};

static size_t padded(const struct sweep *s)
{
    return s->stride - 2 * SWEEP_PAD;
}

/* Largest difference of a channel between pixels of row y and pixels dx, dy beside them; 255: not there. */
static void colour_steps(uint8_t *out, const struct mapped *m, int y, int dx, int dy)
{
    const struct sweep *s = m->s;
    const size_t at = (size_t)y * s->stride + SWEEP_PAD;
    const uint8_t *a[3], *b[3];

    if (y + dy < 0 || y + dy >= s->height) {
        memset(out, 255, padded(s));
        return;
    }
    for (int c = 0; c < 3; c++) {
        a[c] = m->v->colour[c] + at;
        b[c] = a[c] + dy * (ptrdiff_t)s->stride + dx;
    }
    sst_kernels_get()->colour_step_row(out, a, b, padded(s));
    if (dx)
        out[dx < 0 ? 0 : s->width - 1] = 255;
}

/* Costs of row y at plane i, in blocks that have it. */
static void cost_row(const struct mapped *m, int i, int y)
{
    const struct sweep *s = m->s;
    const struct sweep_plane *p = &s->plane[i];
    const uint8_t *on = sweep_lists_on(s, &m->costs->lists, y) + i * s->blocks;
    uint8_t *to = m->costs->raw[y % 3] + SWEEP_PAD + (size_t)i * s->stride;
    const size_t at = (size_t)y * s->stride + SWEEP_PAD;
    const uint8_t *own[3] = { m->v->colour[0] + at, m->v->colour[1] + at, m->v->colour[2] + at };
    const int row = (y + p->shift[m->k][1] - p->y0) % p->rows;
    const uint8_t *at_plane = p->consensus + (size_t)row * 4 * p->stride + (p->shift[m->k][0] - p->x0);

    for (int b = 0, end; b < s->blocks; b = end) {
        const size_t x = (size_t)b * SST_CONSENSUS_BLOCK;
        const uint8_t *pixels[3] = { own[0] + x, own[1] + x, own[2] + x };
        const uint8_t *consensus[4] = { at_plane + x, at_plane + p->stride + x, at_plane + 2 * p->stride + x,
                                        at_plane + 3 * p->stride + x };

        for (end = b + 1; end < s->blocks && on[end] == on[b]; end++)
            ;
        if (on[b])
            sst_kernels_get()->consensus_cost_row(to + x, pixels, consensus, s->again ? s->most : FIRST,
                                                  (size_t)(end - b) * SST_CONSENSUS_BLOCK);
    }
}

/* Costs of row y of views of one row of the array: plane by plane, since they have much of a plane's row in common. */
static void cost_rows(const struct mapped *m, int views, int y)
{
    const struct sweep *s = m->s;

    for (int i = 0; i < views; i++) {
        if (s->again && y - 3 >= m->v->top - 1 && y >= 3) /* there are costs of row y - 3 */
            sweep_lists_clear(s, &m[i].costs->lists, m[i].costs->raw[y % 3], s->most, (const int[]){ y - 3, y });
    }
    for (int plane = 0; plane < s->planes; plane++) {
        for (int i = 0; i < views; i++)
            cost_row(&m[i], plane, y);
    }
}

/* Means of the costs of row y, or in the first round the cheapest planes; m->costs->raw has its rows and the two
 * beside. */
static void mean_row(const struct mapped *m, int y)
{
    const struct sweep *s = m->s;
    const struct sst_consensus_rows rows = { m->costs->raw[(y + 2) % 3] + SWEEP_PAD,
                                             m->costs->raw[y % 3] + SWEEP_PAD,
                                             m->costs->raw[(y + 1) % 3] + SWEEP_PAD,
                                             { m->own->step[0], m->own->step[1], m->own->step[2], m->own->step[3],
                                               m->own->step[4], m->own->step[5], m->own->step[6], m->own->step[7] },
                                             ALIKE,
                                             FLAT,
                                             (uint16_t)(256 * DEARER / s->planes),
                                             (uint16_t)((256 * FARTHER + s->noise) / s->planes),
                                             sweep_lists_at(s, &m->costs->lists, y),
                                             s->planes,
                                             s->stride };
    uint8_t *const least[2] = { m->v->plane + (size_t)y * s->stride + SWEEP_PAD, m->own->choice[COST] };

    for (int i = 0, k = 0; i < 9; i++) {
        if (i != 4)
            colour_steps(m->own->step[k++], m, y, i % 3 - 1, i / 3 - 1);
    }
    if (s->again) {
        sst_kernels_get()->consensus_mean_row(m->costs->mean + (size_t)(y - m->v->top) * s->packed, &rows, padded(s));
        return;
    }
    sst_kernels_get()->consensus_least_row(least, &rows, padded(s));
    for (int x = 0; x < s->width; x++)
        m->v->costs[least[1][x]]++;
}

/* Layers of paths begin a pixel later (from the left) or earlier, so that the pixel beside it in the row before lies
 * where vectors begin. */
static uint8_t *skewed(uint8_t *path, int t)
{
    return path + (t ? -1 : 1);
}

/* Paths of row y from row y - dir; path[from] has its state. @param row  of these paths, from 0 on
 * @param mean  out, of both, packed */
static void path_row(const struct mapped *m, int y, int dir, int row, uint8_t *(*path)[2], uint8_t *(*least)[2],
                     int from, uint8_t *mean)
{
    const struct sweep *s = m->s;
    struct sst_consensus_paths p = { .cost = m->costs->mean + (size_t)(y - m->v->top) * s->packed,
                                     .step = { m->own->step[0], m->own->step[1] },
                                     .p1 = P1,
                                     .p2 = s->p2,
                                     .edge = EDGE_STEP,
                                     .p2_edge = s->p2 / 4,
                                     .mean = mean,
                                     .listed = sweep_lists_at(s, &m->costs->lists, y),
                                     .planes = s->planes,
                                     .stride = s->stride };

    for (int t = 0; t < 2; t++) {
        p.from[t] = skewed(path[from][t], t) + SWEEP_PAD;
        p.from_least[t] = least[from][t] + SWEEP_PAD;
        p.to[t] = skewed(path[!from][t], t) + SWEEP_PAD;
        p.least[t] = least[!from][t] + SWEEP_PAD;
        if (row < 2)
            memset(path[!from][t], 255, s->layer);
        else
            sweep_lists_clear(s, &m->costs->lists, skewed(path[!from][t], t), 255, (const int[]){ y - 2 * dir, y });
        colour_steps(m->own->step[t], m, y, 2 * t - 1, -dir);
    }
    sst_kernels_get()->consensus_path_row(&p, padded(s));
    for (int t = 0; t < 2; t++) { /* from beyond the edges no path comes */
        p.least[t][-1] = p.least[t][s->width] = 0;
        for (int i = 0; i < s->planes; i++)
            p.to[t][(ptrdiff_t)((size_t)i * s->stride) - 1] = p.to[t][(size_t)i * s->stride + (size_t)s->width] = 0;
    }
}

static void clear_paths(const struct sweep *s, uint8_t *path[2], uint8_t *least[2])
{
    for (int t = 0; t < 2; t++) {
        memset(path[t], 0, s->layer);
        memset(least[t], 0, s->stride);
    }
}

/* Disparities of planes, between planes by the parabola through their sums and their neighbours'. Quotients are at most
 * half a step away from 0 and at least 1/1020 from the next whole number: floats divide as whole numbers would. */
static void between_planes(uint16_t *disp, const struct sweep *s, uint8_t *const row[5])
{
    const int most = s->in->range * 64;

    for (int x = 0; x < s->width; x++) {
        const int before = row[BEFORE][x], sum = row[SUM][x], after = row[AFTER][x];
        const int curve = before - 2 * sum + after, slope = s->step * (before - after);
        const int part = (int)((float)(slope + (slope < 0 ? -curve : curve)) / (float)sst_max_int(2 * curve, 1));
        const bool fits = (before < 255) & (after < 255) & (curve > 0);
        const int d = row[PLANE][x] * s->step + (fits ? part : 0);

        disp[x] = (uint16_t)sst_clamp_int(d, 0, most);
    }
}

static void choose_row(const struct mapped *m, int y)
{
    const struct sweep *s = m->s;
    uint8_t *const *row = m->own->choice;
    const size_t at = (size_t)(y - m->v->top) * s->packed;
    const struct sst_consensus_choice choice = { .sum = { m->own->up, m->own->down + at },
                                                 .cost = m->costs->mean + at,
                                                 .listed = sweep_lists_at(s, &m->costs->lists, y),
                                                 .planes = s->planes,
                                                 .plane = row[PLANE],
                                                 .before = row[BEFORE],
                                                 .sums = row[SUM],
                                                 .after = row[AFTER],
                                                 .costs = row[COST] };
    uint16_t *disp = sst_map_u16_row(s->in->view[m->k].disp, y);

    sst_kernels_get()->consensus_choose_row(&choice, padded(s));
    between_planes(disp, s, row);
    memcpy(sst_map_u8_row(s->in->view[m->k].cost, y), row[COST], (size_t)s->width);
}

/* Mean costs of the views' rows from the tile's first one to `bottom`, in the first round the cheapest planes. */
static void mean_rows(const struct mapped *m, int views, int bottom)
{
    const struct sweep *s = m->s;

    for (int i = 0; i < views; i++) {
        sweep_lists_make(s, &m[i].costs->lists, m[i].k, bottom);
        for (int row = 0; s->again && row < 3; row++)
            memset(m[i].costs->raw[row], s->most, s->layer);
    }
    for (int y = sst_max_int(m->v->top - 1, 0) - 1; y < bottom; y++) {
        if (y + 1 < s->height)
            cost_rows(m, views, y + 1);
        for (int i = 0; i < views && y >= m->v->top; i++)
            mean_row(&m[i], y);
    }
}

/* Paths down the tile, paths up from `bottom`, below it, and the maps. */
static void optimise(const struct mapped *m, int bottom)
{
    const struct sweep *s = m->s;
    struct sweep_view *v = m->v;
    int from = 0;

    if (!v->top)
        clear_paths(s, v->path[v->row], v->least[v->row]);
    for (int y = v->top; y < v->bottom; y++) {
        path_row(m, y, 1, y - v->top, v->path, v->least, v->row, m->own->down + (size_t)(y - v->top) * s->packed);
        v->row = !v->row;
    }
    clear_paths(s, m->own->path[from], m->own->least[from]);
    for (int y = bottom - 1; y >= v->top; y--) {
        path_row(m, y, -1, bottom - 1 - y, m->own->path, m->own->least, from, m->own->up);
        from = !from;
        if (y < v->bottom)
            choose_row(m, y);
    }
}

int sweep_maps(void *arg, int group, int worker)
{
    struct sweep *s = arg;
    const int first = group * s->together, end = sst_min_int(first + s->together, s->in->views);
    struct sweep_scratch *own = &s->scratch[worker];
    struct mapped m[SWEEP_TOGETHER];
    int views = 0, bottom;

    if (s->in->cancel && *s->in->cancel)
        return -ECANCELED;
    for (int k = first; k < end; k++) {
        if (s->in->view[k].image) {
            m[views] = (struct mapped){ s, k, &s->view[k], own, &own->costs[views] };
            views++;
        }
    }
    if (!views || m->v->top >= m->v->bottom)
        return 0;
    bottom = s->again ? sst_min_int(m->v->bottom + SWEEP_LOOK, s->height) : m->v->bottom;
    mean_rows(m, views, bottom);
    for (int i = 0; s->again && i < views; i++)
        optimise(&m[i], bottom);
    return 0;
}

static int paths_init(const struct sweep *s, uint8_t *(*path)[2], uint8_t *(*least)[2])
{
    for (int i = 0; i < 4; i++) {
        path[i / 2][i % 2] = sst_mem_alloc(s->layer, 1);
        least[i / 2][i % 2] = sst_mem_alloc(s->stride, 1);
        if (!path[i / 2][i % 2] || !least[i / 2][i % 2])
            return -ENOMEM;
    }
    return 0;
}

static void paths_fini(uint8_t *(*path)[2], uint8_t *(*least)[2])
{
    for (int i = 0; i < 4; i++) {
        sst_mem_free(path[i / 2][i % 2]);
        sst_mem_free(least[i / 2][i % 2]);
    }
}

static int scratch_init(const struct sweep *s, struct sweep_scratch *w)
{
    const size_t rows = (size_t)sst_min_int(SWEEP_TILE, s->height);
    const size_t deep = (size_t)sst_min_int(SWEEP_TILE + SWEEP_LOOK, s->height);
    bool there = true;

    for (int v = 0; v < SWEEP_TOGETHER; v++) {
        for (int i = 0; i < 3; i++)
            there = (w->costs[v].raw[i] = sst_mem_alloc(s->layer, 1)) && there;
        there = (w->costs[v].mean = sst_mem_alloc_raw(s->packed, deep)) && there;
        there = !sweep_lists_init(s, &w->costs[v].lists) && there;
    }
    for (int i = 0; i < 8; i++)
        there = (w->step[i] = sst_mem_alloc(s->stride, 1)) && there;
    for (int i = 0; i < 5; i++)
        there = (w->choice[i] = sst_mem_alloc(s->stride, 1)) && there;
    there = (w->down = sst_mem_alloc_raw(s->packed, rows)) && there;
    there = (w->up = sst_mem_alloc_raw(s->packed, 1)) && there;
    return there ? paths_init(s, w->path, w->least) : -ENOMEM;
}

int sweep_maps_init(struct sweep *s)
{
    int err = 0;

    s->scratch = calloc((size_t)s->workers, sizeof(*s->scratch));
    if (!s->scratch)
        return -ENOMEM;
    for (int i = 0; !err && i < s->workers; i++)
        err = scratch_init(s, &s->scratch[i]);
    for (int k = 0; !err && k < s->in->views; k++)
        err = s->in->view[k].image ? paths_init(s, s->view[k].path, s->view[k].least) : 0;
    return err;
}

void sweep_maps_fini(struct sweep *s)
{
    for (int i = 0; s->scratch && i < s->workers; i++) {
        struct sweep_scratch *w = &s->scratch[i];

        for (int v = 0; v < SWEEP_TOGETHER; v++) {
            for (int j = 0; j < 3; j++)
                sst_mem_free(w->costs[v].raw[j]);
            sst_mem_free(w->costs[v].mean);
            sweep_lists_fini(&w->costs[v].lists);
        }
        for (int j = 0; j < 8; j++)
            sst_mem_free(w->step[j]);
        for (int j = 0; j < 5; j++)
            sst_mem_free(w->choice[j]);
        sst_mem_free(w->down);
        sst_mem_free(w->up);
        paths_fini(w->path, w->least);
    }
    for (int k = 0; s->view && k < s->in->views; k++)
        paths_fini(s->view[k].path, s->view[k].least);
    free(s->scratch);
}
