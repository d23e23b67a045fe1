/*
 * Disparities at which the points of sweeps (sweep.c) gather in the cells of a view, which are candidates there; and
 * the plan that sweeps and candidates go by.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/method/disparity/visible.h"

#define STRIDE      4  /* pixels between samples, in units */
#define DISTINCT    15 /* least difference of costs: the cheapest disparity and the cheapest one not next to it */
#define WEIGHT_MOST 100       /* difference of costs above which the weight of a point does not grow */
#define CELL        16        /* units: candidates are found per cell, ... */
#define AROUND      2         /* ... from the points of this many cells around */
#define GATHERED    6000      /* weight that makes a candidate */
#define MAPPED      8         /* sparse pixels of a map that do not make a surface, each counted twice */
#define SHIFT_MOST  (1 << 24) /* px */

/* Lengths grow with the picture, and with it what it shows: a unit is 1 px up to 1500 px of width and height together,
 * 2 px up to 2500, and so on. */
void sst_sweep_plan_init(struct sst_sweep_plan *p, int width, int height, int range_q6, int step)
{
    const int unit = sst_max_int((width + height + 499) / 1000, 1);

    *p = (struct sst_sweep_plan){
        .width = width,
        .height = height,
        .step = step,
        .stride = STRIDE * unit,
        .cell = CELL * unit,
        .distinct = DISTINCT,
        .weight_most = WEIGHT_MOST,
        .gathered = GATHERED,
        .mapped = MAPPED,
    };
    p->level = sst_max_int(sst_max_int(step / 2, 1), (range_q6 + SST_SWEEP_LEVELS - 2) / (SST_SWEEP_LEVELS - 1));
    p->levels = range_q6 / p->level + 1;
    p->apart = sst_max_int(step / p->level, 1);
    p->peaks_apart = sst_max_int(step * 3 / 2 / p->level, 1);
    p->cols = (width + p->cell - 1) / p->cell;
    p->rows = (height + p->cell - 1) / p->cell;
}

/* For whole x, x - px >= 0 where x - whole_from(px) >= 0. A number that is whole but for rounding counts as whole. */
static int32_t whole_from(double px)
{
    return (int32_t)fmin(fmax(ceil(px - 0x1p-20), -SHIFT_MOST), SHIFT_MOST);
}

void sst_sweep_shifts(int32_t (*shift)[2], const struct sst_sweep_plan *p, double bx, double by, double disp_min_px)
{
    for (int l = 0; l < p->levels; l++) {
        const double d = disp_min_px + l * p->level / 64.0;

        shift[l][0] = whole_from(d * bx);
        shift[l][1] = whole_from(d * by);
    }
}

void sst_sweep_fini(struct sst_sweep *s)
{
    sst_mem_free(s->point);
    *s = (struct sst_sweep){ 0 };
}

/* Weights of points by cell and level, [rows][cols][levels]. */
struct gathered {
    struct sst_sweep_plan plan;
    int32_t (*shift)[2]; /* [levels] of a sweep */
    uint32_t *weight, *sum;
    uint32_t *mapped, *mapped_sum; /* sparse pixels of the view's map, likewise */
};

static size_t cell_at(const struct gathered *g, int col, int row)
{
    return ((size_t)row * (size_t)g->plan.cols + (size_t)col) * (size_t)g->plan.levels;
}

/* Points of one sweep, seen from a view at offset (bx, by) from its. */
static void gather(struct gathered *g, const struct sst_sweep *s, double bx, double by, double disp_min_px)
{
    sst_sweep_shifts(g->shift, &g->plan, bx, by, disp_min_px);
    for (size_t i = 0; i < s->count; i++) {
        const struct sst_sweep_point *p = &s->point[i];
        const int x = p->x - g->shift[p->level][0], y = p->y - g->shift[p->level][1];
        const int col = x / g->plan.cell, row = y / g->plan.cell;

        if (x >= 0 && y >= 0 && col < g->plan.cols && row < g->plan.rows)
            g->weight[cell_at(g, col, row) + p->level] += p->weight;
    }
}

/* Sparse pixels of a map. */
static void count_map(struct gathered *g, const struct sst_map_u16 *disp)
{
    const int stride = g->plan.stride, level = g->plan.level;

    for (int y = stride / 2; y < disp->height; y += stride) {
        for (int x = stride / 2; x < disp->width; x += stride) {
            const int l = (sst_map_u16_row(disp, y)[x] + level / 2) / level;

            if (l < g->plan.levels)
                g->mapped[cell_at(g, x / g->plan.cell, y / g->plan.cell) + (size_t)l]++;
        }
    }
}

/* sum = values around a cell by level; neighbouring levels count half. */
static void sum_around(uint32_t *sum, const struct gathered *g, const uint32_t *value, int col, int row)
{
    const int n = g->plan.levels;
    uint32_t before = 0;

    memset(sum, 0, (size_t)n * sizeof(*sum));
    for (int y = sst_max_int(row - AROUND, 0); y <= sst_min_int(row + AROUND, g->plan.rows - 1); y++) {
        for (int x = sst_max_int(col - AROUND, 0); x <= sst_min_int(col + AROUND, g->plan.cols - 1); x++) {
            const uint32_t *v = value + cell_at(g, x, y);

            for (int l = 0; l < n; l++)
                sum[l] += v[l];
        }
    }
    for (int l = 0; l < n; l++) {
        const uint32_t at = sum[l];

        sum[l] = before + 2 * at + (l + 1 < n ? sum[l + 1] : 0);
        before = at;
    }
}

/* The heaviest levels that are not next to each other. */
static void pick_peaks(struct sst_sweep_peak *peak, const struct gathered *g)
{
    const struct sst_sweep_plan *p = &g->plan;

    for (int i = 0; i < SST_SWEEP_PEAKS; i++) {
        int best = 0;

        for (int l = 1; l < p->levels; l++)
            best = g->sum[l] > g->sum[best] ? l : best;
        if (g->sum[best] < p->gathered)
            break;
        peak[i] = (struct sst_sweep_peak){ (uint16_t)(best * p->level), g->mapped_sum[best] <= p->mapped };
        for (int l = sst_max_int(best - p->peaks_apart, 0); l <= sst_min_int(best + p->peaks_apart, p->levels - 1); l++)
            g->sum[l] = 0;
    }
}

int sst_sweep_candidates(struct sst_sweep_candidates *out, const struct sst_sweeps *sweeps,
                         const struct sst_visible_view *view, double disp_min_px)
{
    struct gathered g = { .plan = sweeps->plan };
    const size_t cells = (size_t)g.plan.cols * (size_t)g.plan.rows, levels = (size_t)g.plan.levels;
    bool done;

    out->cell = g.plan.cell;
    out->cols = g.plan.cols;
    out->peak = sst_mem_alloc_raw(cells * SST_SWEEP_PEAKS, sizeof(*out->peak));
    g.shift = sst_mem_alloc_raw(levels, sizeof(*g.shift));
    g.weight = sst_mem_alloc(cells + 1, levels * sizeof(*g.weight)); /* the last one: the sum */
    g.mapped = sst_mem_alloc(cells + 1, levels * sizeof(*g.mapped));
    done = out->peak && g.shift && g.weight && g.mapped;
    if (done) {
        g.sum = g.weight + cells * levels;
        g.mapped_sum = g.mapped + cells * levels;
        for (int i = 0; i < sweeps->count; i++) {
            const struct sst_sweep *s = &sweeps->sweep[i];

            gather(&g, s, view->bx - s->bx, view->by - s->by, disp_min_px);
        }
        count_map(&g, view->disp);
        for (size_t i = 0; i < cells; i++) {
            struct sst_sweep_peak *peak = out->peak + i * SST_SWEEP_PEAKS;
            const int col = (int)(i % (size_t)g.plan.cols), row = (int)(i / (size_t)g.plan.cols);

            for (int k = 0; k < SST_SWEEP_PEAKS; k++)
                peak[k] = (struct sst_sweep_peak){ SST_DISP_NONE, false };
            sum_around(g.sum, &g, g.weight, col, row);
            sum_around(g.mapped_sum, &g, g.mapped, col, row);
            pick_peaks(peak, &g);
        }
    }
    sst_mem_free(g.mapped);
    sst_mem_free(g.weight);
    sst_mem_free(g.shift);
    return done ? 0 : -ENOMEM;
}

void sst_sweep_candidates_fini(struct sst_sweep_candidates *c)
{
    sst_mem_free(c->peak);
    *c = (struct sst_sweep_candidates){ 0 };
}

const struct sst_sweep_peak *sst_sweep_candidates_at(const struct sst_sweep_candidates *c, int x, int y)
{
    return c->peak + ((size_t)(y / c->cell) * (size_t)c->cols + (size_t)(x / c->cell)) * SST_SWEEP_PEAKS;
}
