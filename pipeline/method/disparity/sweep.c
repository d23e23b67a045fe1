/*
 * Surfaces that the first pass missed (design.md, 5.7). Where gaps are small everywhere, no window holds more of what
 * is behind than of what is in front, and no map has the surface behind. In a few views, sparse pixels that their own
 * disparity does not explain are tested at all disparities. Those that one disparity alone explains are points in
 * space: seen from each view, the disparities where points gather are its candidates.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/method/disparity/stage.h"

#define STRIDE      4   /* pixels between samples, in units */
#define LEVELS_MOST 256 /* disparities that are tested */
#define DISTINCT    15 /* how much the cheapest disparity costs less than those that are not next to it, at least, ... */
#define WEIGHT_MOST 100  /* ... and by how much it counts at most */
#define CELL        16   /* units: candidates are found per cell, ... */
#define AROUND      2    /* ... from the points of this many cells around */
#define GATHERED    6000 /* weight that makes a candidate */
#define MAPPED      8    /* sparse pixels of a map that do not make a surface, each counted twice */

/* Lengths grow with the picture, and with it what it shows: a unit is 1 px up to 1500 px of width and height together,
 * 2 px up to 2500, and so on. */
static int unit_of(const struct sst_map_u16 *disp)
{
    return sst_max_int((disp->width + disp->height + 499) / 1000, 1);
}

int sst_sweep_level(int range_q6, int step)
{
    return sst_max_int(sst_max_int(step / 2, 1), (range_q6 + LEVELS_MOST - 2) / (LEVELS_MOST - 1));
}

/* Cost of all levels for one pixel. */
static void cost_of_levels(uint16_t *cost, const struct sst_hypothesis_test *t, int x, int y, int level, int levels)
{
    for (int from = 0; from < levels; from += SST_HYPOTHESES) {
        const uint8_t count = (uint8_t)sst_max_int(2, sst_min_int(SST_HYPOTHESES, levels - from));
        uint16_t hypothesis[SST_HYPOTHESES];

        for (int i = 0; i < SST_HYPOTHESES; i++)
            hypothesis[i] = (uint16_t)((from + i) * level);
        sst_kernels_get()->hypothesis_cost_row(cost + from, hypothesis, &count, t, x, y, 1);
    }
}

/* The level that alone explains a pixel. @return its weight, 0: there is none */
static int find_distinct(const uint16_t *cost, int levels, int apart, int *level)
{
    int best = 0, next = SST_HYPOTHESIS_FAR;

    for (int l = 1; l < levels; l++)
        best = cost[l] < cost[best] ? l : best;
    for (int l = 0; l < levels; l++)
        next = abs(l - best) > apart && cost[l] < next ? cost[l] : next;
    *level = best;
    return next - cost[best] < DISTINCT ? 0 : sst_min_int(next - cost[best], WEIGHT_MOST);
}

/* True if the pixel's own disparity explains it. */
static bool is_explained(const struct sst_hypothesis_test *t, int x, int y, uint16_t own)
{
    const uint16_t hypothesis[SST_HYPOTHESES] = { own, own };
    const uint8_t two = 2;
    uint16_t cost[SST_HYPOTHESES];

    sst_kernels_get()->hypothesis_cost_row(cost, hypothesis, &two, t, x, y, 1);
    return cost[0] < t->settled;
}

int sst_sweep_view(struct sst_sweep *out, const struct sst_hypothesis_test *test, const struct sst_map_u16 *disp,
                   const struct sst_map_u8 *seen, int range_q6, int step)
{
    const int level = sst_sweep_level(range_q6, step), levels = range_q6 / level + 1;
    const int stride = STRIDE * unit_of(disp);
    const size_t most = (size_t)(disp->width / stride + 1) * (size_t)(disp->height / stride + 1);
    struct sst_hypothesis_test all = *test;
    uint16_t cost[LEVELS_MOST + SST_HYPOTHESES];

    all.settled = 0;
    out->count = 0;
    out->point = sst_mem_alloc_raw(most, sizeof(*out->point));
    if (!out->point)
        return -ENOMEM;
    for (int y = stride / 2; y < disp->height; y += stride) {
        for (int x = stride / 2; x < disp->width; x += stride) {
            const uint16_t own = sst_map_u16_row(disp, y)[x];
            int best, weight;

            if ((seen && seen->data && !sst_map_u8_row(seen, y)[x]) ||
                (own != SST_DISP_NONE && is_explained(test, x, y, own)))
                continue;
            cost_of_levels(cost, &all, x, y, level, levels);
            weight = find_distinct(cost, levels, sst_max_int(step / level, 1), &best);
            if (weight)
                out->point[out->count++] =
                    (struct sst_sweep_point){ (uint16_t)x, (uint16_t)y, (uint16_t)best, (uint16_t)weight };
        }
    }
    return 0;
}

void sst_sweep_fini(struct sst_sweep *s)
{
    sst_mem_free(s->point);
    *s = (struct sst_sweep){ 0 };
}

/* --- candidates of a view ----------------------------------------------------------------------------------------- */

/* Weights of points by cell and level, [rows][cols][levels]. */
struct gathered {
    int cell; /* px */
    int cols, rows, levels;
    uint32_t *weight, *sum;
    uint32_t *mapped, *mapped_sum; /* sparse pixels of the view's map, likewise */
};

static size_t cell_at(const struct gathered *g, int col, int row)
{
    return ((size_t)row * (size_t)g->cols + (size_t)col) * (size_t)g->levels;
}

/* Points of one sweep, seen from a view at offset (bx, by) from its. */
static void gather(struct gathered *g, const struct sst_sweep *s, double bx, double by, double disp_min_px, int level)
{
    for (size_t i = 0; i < s->count; i++) {
        const struct sst_sweep_point *p = &s->point[i];
        const double d = disp_min_px + p->level * level / 64.0;
        const int col = (int)floor((p->x - d * bx) / g->cell), row = (int)floor((p->y - d * by) / g->cell);

        if (col >= 0 && row >= 0 && col < g->cols && row < g->rows)
            g->weight[cell_at(g, col, row) + p->level] += p->weight;
    }
}

/* Sparse pixels of a map. */
static void count_map(struct gathered *g, const struct sst_map_u16 *disp, int level)
{
    const int stride = STRIDE * g->cell / CELL;

    for (int y = stride / 2; y < disp->height; y += stride) {
        for (int x = stride / 2; x < disp->width; x += stride) {
            const int l = (sst_map_u16_row(disp, y)[x] + level / 2) / level;

            if (l < g->levels)
                g->mapped[cell_at(g, x / g->cell, y / g->cell) + (size_t)l]++;
        }
    }
}

/* sum = values around a cell by level; neighbouring levels count half. */
static void sum_around(uint32_t *sum, const struct gathered *g, const uint32_t *value, int col, int row)
{
    const int n = g->levels;
    uint32_t before = 0;

    memset(sum, 0, (size_t)n * sizeof(*sum));
    for (int y = sst_max_int(row - AROUND, 0); y <= sst_min_int(row + AROUND, g->rows - 1); y++) {
        for (int x = sst_max_int(col - AROUND, 0); x <= sst_min_int(col + AROUND, g->cols - 1); x++) {
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
static void pick_peaks(struct sst_sweep_peak *peak, const struct gathered *g, int apart, int level)
{
    for (int i = 0; i < SST_SWEEP_PEAKS; i++) {
        int best = 0;

        for (int l = 1; l < g->levels; l++)
            best = g->sum[l] > g->sum[best] ? l : best;
        if (g->sum[best] < GATHERED)
            break;
        peak[i] = (struct sst_sweep_peak){ (uint16_t)(best * level), g->mapped_sum[best] <= MAPPED };
        for (int l = sst_max_int(best - apart, 0); l <= sst_min_int(best + apart, g->levels - 1); l++)
            g->sum[l] = 0;
    }
}

int sst_sweep_candidates(struct sst_sweep_candidates *out, const struct sst_sweep *sweep, int count, double bx,
                         double by, const struct sst_map_u16 *disp, double disp_min_px, int range_q6, int step)
{
    const int level = sst_sweep_level(range_q6, step);
    const int cell = CELL * unit_of(disp);
    struct gathered g = { .cell = cell,
                          .cols = (disp->width + cell - 1) / cell,
                          .rows = (disp->height + cell - 1) / cell,
                          .levels = range_q6 / level + 1 };
    const size_t cells = (size_t)g.cols * (size_t)g.rows;

    out->cell = cell;
    out->cols = g.cols;
    out->peak = sst_mem_alloc_raw(cells * SST_SWEEP_PEAKS, sizeof(*out->peak));
    g.weight = sst_mem_alloc(cells + 1, (size_t)g.levels * sizeof(*g.weight)); /* the last one: the sum */
    g.mapped = sst_mem_alloc(cells + 1, (size_t)g.levels * sizeof(*g.mapped));
    if (out->peak && g.weight && g.mapped) {
        g.sum = g.weight + cells * (size_t)g.levels;
        g.mapped_sum = g.mapped + cells * (size_t)g.levels;
        for (int i = 0; i < count; i++)
            gather(&g, &sweep[i], bx - sweep[i].bx, by - sweep[i].by, disp_min_px, level);
        count_map(&g, disp, level);
        for (size_t i = 0; i < cells; i++) {
            struct sst_sweep_peak *peak = out->peak + i * SST_SWEEP_PEAKS;
            const int col = (int)(i % (size_t)g.cols), row = (int)(i / (size_t)g.cols);

            for (int k = 0; k < SST_SWEEP_PEAKS; k++)
                peak[k] = (struct sst_sweep_peak){ SST_DISP_NONE, false };
            sum_around(g.sum, &g, g.weight, col, row);
            sum_around(g.mapped_sum, &g, g.mapped, col, row);
            pick_peaks(peak, &g, sst_max_int(step * 3 / 2 / level, 1), level);
        }
    }
    sst_mem_free(g.mapped);
    sst_mem_free(g.weight);
    return out->peak && g.weight && g.mapped ? 0 : -ENOMEM;
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
