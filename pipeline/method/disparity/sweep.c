/*
 * Surfaces that the first pass missed (design.md, 5.7). Where gaps are small everywhere, no window holds more of what
 * is behind than of what is in front, and no map has the surface behind. In a few views, sparse pixels that their own
 * disparity does not explain are tested at all disparities. Those that one disparity alone explains are points in
 * space: seen from each view, the disparities where points gather are its candidates.
 */
#include "pipeline/method/disparity/visible_pass.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define STRIDE      4  /* pixels between samples, in units */
#define DISTINCT    15 /* how much the cheapest disparity costs less than those that are not next to it, at least, ... */
#define WEIGHT_MOST 100       /* ... and by how much it counts at most */
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

/* Cost of all levels for one pixel. */
static void cost_of_levels(uint16_t *cost, const struct sst_hypothesis_test *t, int x, int y,
                           const struct sst_sweep_plan *p)
{
    for (int from = 0; from < p->levels; from += SST_HYPOTHESES) {
        const uint8_t count = (uint8_t)sst_max_int(2, sst_min_int(SST_HYPOTHESES, p->levels - from));
        uint16_t hypothesis[SST_HYPOTHESES];

        for (int i = 0; i < SST_HYPOTHESES; i++)
            hypothesis[i] = (uint16_t)((from + i) * p->level);
        sst_kernels_get()->hypothesis_cost_row(cost + from, hypothesis, &count, t, x, y, 1);
    }
}

/* The level that alone explains a pixel. @return its weight, 0: there is none */
static int find_distinct(const uint16_t *cost, const struct sst_sweep_plan *p, int *level)
{
    int best = 0, next = SST_HYPOTHESIS_FAR;

    for (int l = 1; l < p->levels; l++)
        best = cost[l] < cost[best] ? l : best;
    for (int l = 0; l < p->levels; l++)
        next = abs(l - best) > p->apart && cost[l] < next ? cost[l] : next;
    *level = best;
    return next - cost[best] < p->distinct ? 0 : sst_min_int(next - cost[best], p->weight_most);
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

int sst_sweep_view(struct sst_sweep *out, const struct sst_sweep_plan *plan, const struct sst_hypothesis_test *test,
                   const struct sst_map_u16 *disp, const struct sst_map_u8 *seen)
{
    struct sst_hypothesis_test all = *test;
    uint16_t cost[SST_SWEEP_LEVELS + SST_HYPOTHESES];
    const int stride = plan->stride;

    all.settled = 0;
    out->count = 0;
    out->point = sst_mem_alloc_raw((size_t)(disp->width / stride + 1) * (size_t)(disp->height / stride + 1),
                                   sizeof(*out->point));
    if (!out->point)
        return -ENOMEM;
    for (int y = stride / 2; y < disp->height; y += stride) {
        for (int x = stride / 2; x < disp->width; x += stride) {
            const uint16_t own = sst_map_u16_row(disp, y)[x];
            int best, weight;

            if ((seen && seen->data && !sst_map_u8_row(seen, y)[x]) ||
                (own != SST_DISP_NONE && is_explained(test, x, y, own)))
                continue;
            cost_of_levels(cost, &all, x, y, plan);
            weight = find_distinct(cost, plan, &best);
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

/* --- the step: items are sweeps ----------------------------------------------------------------------------------- */

static bool is_sweep(const void *job, int i)
{
    return i < ((const struct visible_pass *)job)->sweeps.count;
}

static int sweep_job(void *job, int i, int worker SST_UNUSED)
{
    struct visible_pass *p = job;
    const struct sst_visible_view *v = &p->in->view[p->swept[i]];
    struct sst_hypothesis_test test;
    int nearest[SST_HYPOTHESIS_VIEWS];

    if (p->in->cancel && *p->in->cancel)
        return -ECANCELED;
    visible_set_test(&test, p, p->swept[i], nearest);
    sst_mem_free(p->sweeps.sweep[i].point);
    return sst_sweep_view(&p->sweeps.sweep[i], &p->sweeps.plan, &test, v->disp, v->seen);
}

/* Points of the words that `sweep_points` leaves. */
static int take_points(struct sst_sweep *out, const uint32_t *words, int columns, int rows, int stride)
{
    sst_mem_free(out->point);
    out->count = 0;
    out->point = sst_mem_alloc_raw((size_t)columns * (size_t)rows + 1, sizeof(*out->point));
    for (int i = 0; out->point && i < columns * rows; i++) {
        const int x = i % columns * stride + stride / 2, y = i / columns * stride + stride / 2;

        if (words[i])
            out->point[out->count++] =
                (struct sst_sweep_point){ (uint16_t)x, (uint16_t)y, (uint16_t)words[i], (uint16_t)(words[i] >> 16) };
    }
    return out->point ? 0 : -ENOMEM;
}

static void sweep_on_device(struct sst_run *r, void *job, int i)
{
    enum { VIEWS, FOUND };
    struct visible_pass *p = job;
    const struct sst_sweep_plan *plan = &p->sweeps.plan;
    const int columns = sst_gpu_sweep_samples(plan->width, plan->stride);
    const int rows = sst_gpu_sweep_samples(plan->height, plan->stride);
    const size_t n = (size_t)columns * (size_t)rows;
    struct visible_tests t;
    struct sst_gpu_sweep push;
    const struct sst_gpu_range found = sst_run_scratch(r, FOUND, n * sizeof(uint32_t));
    const uint32_t *words;

    visible_load(&t, r, p, p->swept[i], VIEWS);
    push = (struct sst_gpu_sweep){ t.push,      plan->stride,   plan->level,      plan->levels,
                                   plan->apart, plan->distinct, plan->weight_most };
    sst_run_dispatch(
        r, SST_GPU_SWEEP_POINTS, &push, (const uint32_t[]){ (uint32_t)columns, (uint32_t)rows, 1 },
        (const struct sst_gpu_range[]){ t.views, t.pixels, sst_run_plane(r, SST_PLANE_BEFORE, p->swept[i]), found },
        SST_GPU_SWEEP_POINTS_BUFFERS);
    words = sst_run_fetch(r, found, n);
    if (words)
        sst_run_fail(r, take_points(&p->sweeps.sweep[i], words, columns, rows, plan->stride));
}

static void swept_points(void *job, int i, struct sst_share_maps *out)
{
    struct sst_sweep *s = &((struct visible_pass *)job)->sweeps.sweep[i];

    sst_share_add_list(out, &s->point, &s->count, sizeof(*s->point));
}

static void *sweep_sample(uint32_t seed)
{
    return visible_sample(seed);
}

const struct sst_step disparity_sweep_step = { .name = "sweep",
                                               .stages = 1U << SST_DISPARITY_STAGE_SURFACES,
                                               .wants = is_sweep,
                                               .source = visible_pass_source,
                                               .derive = visible_derive,
                                               .cpu = sweep_job,
                                               .device = sweep_on_device,
                                               .writes = swept_points,
                                               .sample = sweep_sample,
                                               .sample_free = visible_sample_free };

int visible_sweep(struct visible_pass *p, struct sst_runner_user *user)
{
    const struct sst_run_options how = { p->in->share, p->threads, 1, p->in->cancel };
    const int count = p->sweeps.count;
    int err = sst_run(user, &disparity_sweep_step, p, count, &how);
    size_t at = 0;

    for (int i = 0; i < count; i++)
        p->points += err ? 0 : p->sweeps.sweep[i].count;
    p->point = err ? NULL : sst_mem_alloc_raw(p->points + 1, sizeof(*p->point));
    for (int i = 0; p->point && i < count; i++) {
        for (size_t k = 0; k < p->sweeps.sweep[i].count; k++) {
            const struct sst_sweep_point *from = &p->sweeps.sweep[i].point[k];

            p->point[at++] =
                (struct sst_gpu_sweep_point){ from->x | (uint32_t)from->y << 16,
                                              from->level | (uint32_t)from->weight << 8 | (uint32_t)i << 16 };
        }
    }
    return err || p->point ? err : -ENOMEM;
}
