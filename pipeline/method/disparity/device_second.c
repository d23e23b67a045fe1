/* The second pass on a device: pixels with depth codes, the sweep, tests of hypotheses.
 *
 * All numbers are integers, and equal those of hypothesis_cost_row, hypothesis_path_row, sst_around_init(),
 * sst_around_list(), sst_sweep_view() and sst_sweep_candidates() on every device. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/gpu/convert.h"
#include "pipeline/method/disparity/device_internal.h"
#include "pipeline/method/disparity/visible_internal.h"

/* --- constants of the shaders, in their layout (std430); maps are SST_PLANE_MAP ----------------------------------- */

/* Hypotheses of a view: SST_HYPOTHESES entries for each pixel. */

/* A view to test against, as struct sst_hypothesis_test has it. */
struct gpu_hypothesis_view {
    int32_t x, y, dx, dy;
    uint32_t first; /* its pixel (0, 0) in the buffer of pixels */
};

/* Pixels are uint32_t[height][width] by view: R, G, B and a depth code from the lowest byte up. */

/* `hypothesis_cost`: groups of 32 x 8 pixels. */
struct gpu_hypothesis_cost {
    int32_t width, height, views;
    uint32_t own;               /* the view's pixel (0, 0) */
    int32_t tolerance, similar; /* struct sst_hypothesis_test */
    uint32_t most;    /* largest disparity with a depth code of its own: code[d] = 1 + min(d, most) * 253 / most */
    uint32_t settled; /* struct sst_hypothesis_test; such pixels then have one hypothesis */
    uint32_t change;  /* added to the costs of all hypotheses but the first */
    uint32_t cheap;   /* first costs between `change` and this are marked */
};

/* `hypothesis_path`: all paths of directions way .. way + ways - 1 of sst_gpu_way(), which are straight: four a group
 * along y, a layer of groups along x a direction. */
struct gpu_hypothesis_path {
    int32_t width, height;
    uint32_t own;
    int32_t near; /* struct sst_hypothesis_penalty */
    int32_t way, ways;
    int32_t first; /* not 0: set the sums instead of adding to them; one direction */
};

#define GPU_HYPOTHESIS_PATHS 4 /* of a group */

/* `hypothesis_choice`: groups of 64 pixels, 1024 of them along x. */
struct gpu_hypothesis_choice {
    uint32_t pixels;
};

#define GPU_HYPOTHESIS_PIXELS 64   /* of a group */
#define GPU_HYPOTHESIS_ACROSS 1024 /* groups */

/* Surfaces around each pixel of a view, those that other views project onto it, the list of both and of those of the
 * sweep: groups of 32 x 8 pixels. */

#define GPU_SURFACE_WINDOWS 3 /* of 2, 6 and 16 pixels to each side */

/* `surface_rows`: windows along rows. */
struct gpu_surface_rows {
    int32_t width, height;
    int32_t step; /* a larger difference to the pixel on the right or below is a step, 1/64 px */
};

/* `surface_project`, a layer of groups per other view: where its disparities put its pixels in the view. */
struct gpu_surface_project {
    int32_t width, height;
};

/* `surface_list`: windows along columns, and each pixel's hypotheses. */
struct gpu_surface_list {
    int32_t width, height;
    int32_t apart;      /* least difference between two hypotheses, 1/64 px */
    int32_t cell, cols; /* of the peaks: pixels of a side, cells of a row */
};

/* The sweep: points in space that a view finds, and the disparities at which points gather, seen from another view. */

#define GPU_SWEEP_LEVELS 256 /* at most */
#define GPU_CELL_PEAKS   6   /* of a cell */

/* `sweep_points`: a group per sparse pixel, from half a stride on: gpu_sweep_samples() along x and y. */
struct gpu_sweep {
    struct gpu_hypothesis_cost test; /* a disparity of the pixel's own that costs less than `settled` explains it;
                                            `change` and `cheap` are not used */
    int32_t stride;                  /* pixels */
    int32_t level, levels;           /* disparities that are tested: multiples of `level`, 1/64 px */
    int32_t apart;                   /* levels: nearer ones are the same surface */
    int32_t distinct, weight_most;   /* least and largest distance to the next surface that counts */
};

/* Sparse pixels along an axis. */
static inline int gpu_sweep_samples(int size, int stride)
{
    return (size - stride / 2 + stride - 1) / stride;
}

/* `sweep_gather`: a point per invocation: groups as of `hypothesis_choice`. */
struct gpu_sweep_gather {
    uint32_t points;
    int32_t levels, cell, cols, rows; /* pixels of a cell's side; cells of the view */
};

struct gpu_sweep_point {
    uint32_t at;    /* x | y << 16 */
    uint32_t found; /* level | weight << 8 | number of the sweep << 16 */
};

/* `sweep_peaks`: a group per cell, along x and y. */
struct gpu_sweep_peaks {
    int32_t width, height;
    int32_t stride;               /* between the pixels of its map that are counted, from half of it on */
    int32_t cell, cols, rows;     /* cell: a multiple of stride */
    int32_t levels, level, apart; /* apart: levels next to a peak that are no other one */
    uint32_t gathered;            /* weight that makes a peak */
    uint32_t mapped;              /* sparse pixels of the map that do not make a surface, each counted twice */
};

_Static_assert(SST_SWEEP_LEVELS == GPU_SWEEP_LEVELS && SST_SWEEP_PEAKS == GPU_CELL_PEAKS &&
                   SST_AROUND_EXTREMES == 2 * GPU_SURFACE_WINDOWS,
               "the layout of the shaders");

/* Scratch memory. */
enum { VIEWS, OTHERS, ROWS, PROJECTED, POINTS, SHIFTS, WEIGHTS, PEAKS, LIST, COUNTS, TABLE, COSTS, SUMS, CHOSEN };

/* Tests of view k. */
struct tests {
    struct sst_hypothesis_test test;
    struct gpu_hypothesis_cost push;
    struct sst_gpu_range views, pixels; /* struct gpu_hypothesis_view[]; of all views, with depth codes */
};

void device_derive(struct sst_run *r, const struct sst_visible_views *in, int k, uint32_t conversion,
                   struct sst_gpu_range to)
{
    const struct sst_map_u16 *disp = in->view[k].disp;
    const struct sst_gpu_convert push = {
        .width = disp->width, .height = disp->height, .conversion = conversion, .value = visible_most(in)
    };
    const struct sst_gpu_range colours = sst_run_plane(r, visible_colours(in), k);
    const struct sst_gpu_range before = sst_run_plane(r, SST_PLANE_BEFORE, k);

    SST_RUN_PIXELS(r, SST_GPU_CONVERT, &push, disp->width, disp->height, 1, colours, before, before, to);
}

void visible_derive(struct sst_run *r, void *pass, int k, struct sst_gpu_range to)
{
    device_derive(r, ((const struct visible_pass *)pass)->in, k, SST_GPU_TO_HYPOTHESES, to);
}

/* Load view k and the nearest views, against which it is tested. */
static void load_tests(struct tests *l, struct sst_run *r, const struct visible_pass *p, int k, int views)
{
    struct gpu_hypothesis_view view[SST_HYPOTHESIS_VIEWS] = { { 0 } };
    int index[1 + SST_HYPOTHESIS_VIEWS] = { k };
    const struct sst_hypothesis_test *t = &l->test;

    visible_set_test(&l->test, p, k, views, index + 1);
    l->pixels = sst_run_planes(r, SST_PLANE_DERIVED, index, 1 + t->views);
    for (int i = 0; i < t->views; i++)
        view[i] = (struct gpu_hypothesis_view){ t->x[i], t->y[i], t->dx[i], t->dy[i],
                                                sst_run_first(r, SST_PLANE_DERIVED, index[1 + i]) };
    l->views = sst_run_upload(r, VIEWS, view, (size_t)sst_max_int(t->views, 1) * sizeof(*view));
    l->push = (struct gpu_hypothesis_cost){ .width = t->width,
                                            .height = t->height,
                                            .views = t->views,
                                            .own = sst_run_first(r, SST_PLANE_DERIVED, k),
                                            .tolerance = t->tolerance,
                                            .similar = t->similar,
                                            .most = visible_most(p->in),
                                            .settled = t->settled,
                                            .change = VISIBLE_CHANGE,
                                            .cheap = VISIBLE_CHEAP };
}

/* --- the sweep -----------------------------------------------------------------------------------------------------
 */

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

void dispatch_sweep(struct sst_run *r, void *job, int i)
{
    enum { FOUND = VIEWS + 1 };
    struct visible_pass *p = job;
    const struct sst_sweep_plan *plan = &p->sweeps.plan;
    const int columns = gpu_sweep_samples(plan->width, plan->stride);
    const int rows = gpu_sweep_samples(plan->height, plan->stride);
    const size_t n = (size_t)columns * (size_t)rows;
    struct tests t;
    struct gpu_sweep push;
    const struct sst_gpu_range found = sst_run_scratch(r, FOUND, n * sizeof(uint32_t));
    const uint32_t *words;

    load_tests(&t, r, p, p->swept[i], visible_sweep_views(p->in));
    push = (struct gpu_sweep){ t.push,      plan->stride,   plan->level,      plan->levels,
                               plan->apart, plan->distinct, plan->weight_most };
    SST_RUN_GROUPS(r, SST_GPU_SWEEP_POINTS, &push, columns, rows, 1, t.views, t.pixels,
                   sst_run_plane(r, SST_PLANE_BEFORE, p->swept[i]), found);
    words = sst_run_fetch(r, found, n);
    if (words)
        sst_run_fail(r, take_points(&p->sweeps.sweep[i], words, columns, rows, plan->stride));
}

/* --- tests of hypotheses ------------------------------------------------------------------------------------------ */

struct work {
    struct sst_run *r;
    const struct visible_pass *p;
    int k, width, height;
    size_t pixels;
    struct tests tests;
    struct sst_gpu_range own, list, counts; /* the view's map; hypotheses and how many */
};

static struct sst_gpu_range words_of(const struct work *w, int which, size_t words)
{
    return sst_run_scratch(w->r, which, words * sizeof(uint32_t));
}

/* Surfaces that the matched views around put into the view; its map and theirs are loaded. */
static struct sst_gpu_range project(struct work *w)
{
    const struct sst_visible_views *in = w->p->in;
    const struct sst_visible_view *own = &in->view[w->k];
    const struct gpu_surface_project push = { w->width, w->height };
    const struct sst_gpu_range projected = words_of(w, PROJECTED, 2 * w->pixels);
    struct sst_gpu_check_other other[SST_MAX_VIEWS];
    struct sst_gpu_range maps;
    int index[1 + SST_MAX_VIEWS] = { w->k }, count = 0;

    for (int i = 0; i < in->count; i++) {
        const struct sst_visible_view *v = &in->view[i];

        if (i != w->k && v->image && !v->carried &&
            fabs(v->bx - own->bx) + fabs(v->by - own->by) < sst_visible_reach(in))
            index[++count] = i;
    }
    maps = sst_run_planes(w->r, SST_PLANE_BEFORE, index, 1 + count);
    w->own = sst_run_plane(w->r, SST_PLANE_BEFORE, w->k);
    for (int i = 0; i < count; i++) {
        const struct sst_visible_view *v = &in->view[index[1 + i]];

        other[i].first = sst_run_first(w->r, SST_PLANE_BEFORE, index[1 + i]);
        sst_run_fail(w->r, sst_step_shift(&other[i].shift, sst_shift_by(v->bx - own->bx, in->disp_min_px),
                                          sst_shift_by(v->by - own->by, in->disp_min_px)));
    }
    sst_run_fill(w->r, projected, 0, w->pixels, SST_DISP_NONE);
    sst_run_fill(w->r, projected, w->pixels, w->pixels, 0);
    if (count)
        SST_RUN_PIXELS(w->r, SST_GPU_SURFACE_PROJECT, &push, w->width, w->height, (uint32_t)count,
                       sst_run_upload(w->r, OTHERS, other, (size_t)count * sizeof(*other)), maps, projected);
    return projected;
}

/* Points of all sweeps. @param count  out */
static struct sst_gpu_range upload_points(const struct work *w, size_t *count)
{
    const struct sst_sweeps *sweeps = &w->p->sweeps;
    struct gpu_sweep_point *point;
    size_t at = 0;

    *count = 0;
    for (int i = 0; i < sweeps->count; i++)
        *count += sweeps->sweep[i].count;
    point = (struct gpu_sweep_point *)sst_run_words(w->r, (*count + 1) * sizeof(*point) / sizeof(uint32_t));
    for (int i = 0; point && i < sweeps->count; i++) {
        for (size_t k = 0; k < sweeps->sweep[i].count; k++) {
            const struct sst_sweep_point *from = &sweeps->sweep[i].point[k];

            point[at++] = (struct gpu_sweep_point){ from->x | (uint32_t)from->y << 16,
                                                    from->level | (uint32_t)from->weight << 8 | (uint32_t)i << 16 };
        }
    }
    return *count ? sst_run_upload(w->r, POINTS, point, *count * sizeof(*point)) : (struct sst_gpu_range){ 0 };
}

/* The points of all sweeps, seen from the view: weights by cell and level. */
static struct sst_gpu_range gather_points(const struct work *w)
{
    const struct visible_pass *p = w->p;
    const struct sst_visible_view *own = &p->in->view[w->k];
    const struct sst_sweep_plan *plan = &p->sweeps.plan;
    const size_t levels = (size_t)plan->levels, words = (size_t)plan->cols * (size_t)plan->rows * levels;
    const uint32_t across = GPU_HYPOTHESIS_PIXELS * GPU_HYPOTHESIS_ACROSS;
    const struct sst_gpu_range weights = words_of(w, WEIGHTS, words);
    size_t points;
    const struct sst_gpu_range at = upload_points(w, &points);
    const struct gpu_sweep_gather push = { (uint32_t)points, plan->levels, plan->cell, plan->cols, plan->rows };
    int32_t(*shift)[2] = sst_mem_alloc_raw((size_t)p->sweeps.count * levels + 1, sizeof(*shift));

    sst_run_fill(w->r, weights, 0, words, 0);
    sst_run_fail(w->r, shift ? 0 : -ENOMEM);
    for (int i = 0; shift && i < p->sweeps.count; i++)
        sst_sweep_shifts(shift + (size_t)i * levels, plan, own->bx - p->sweeps.sweep[i].bx,
                         own->by - p->sweeps.sweep[i].by, p->in->disp_min_px);
    if (shift && points)
        SST_RUN_GROUPS(w->r, SST_GPU_SWEEP_GATHER, &push, GPU_HYPOTHESIS_ACROSS, (push.points + across - 1) / across, 1,
                       at, sst_run_upload(w->r, SHIFTS, shift, (size_t)p->sweeps.count * levels * sizeof(*shift)),
                       weights);
    sst_mem_free(shift);
    return weights;
}

static struct sst_gpu_range pick_peaks(const struct work *w)
{
    const struct sst_sweep_plan *plan = &w->p->sweeps.plan;
    const struct gpu_sweep_peaks push = { .width = w->width,
                                          .height = w->height,
                                          .stride = plan->stride,
                                          .cell = plan->cell,
                                          .cols = plan->cols,
                                          .rows = plan->rows,
                                          .levels = plan->levels,
                                          .level = plan->level,
                                          .apart = plan->peaks_apart,
                                          .gathered = plan->gathered,
                                          .mapped = plan->mapped };
    const struct sst_gpu_range weights = gather_points(w);
    const struct sst_gpu_range peaks = words_of(w, PEAKS, (size_t)plan->cols * (size_t)plan->rows * GPU_CELL_PEAKS);

    SST_RUN_GROUPS(w->r, SST_GPU_SWEEP_PEAKS, &push, plan->cols, plan->rows, 1, w->own, weights, peaks);
    return peaks;
}

static void list_surfaces(struct work *w)
{
    const struct gpu_surface_rows rows = { w->width, w->height, w->p->sweeps.plan.step * 3 / 2 };
    const struct gpu_surface_list list = { .width = w->width,
                                           .height = w->height,
                                           .apart = sst_max_int(w->p->sweeps.plan.step, 1),
                                           .cell = w->p->sweeps.plan.cell,
                                           .cols = w->p->sweeps.plan.cols };
    const struct sst_gpu_range windows = words_of(w, ROWS, 4 * w->pixels);
    const struct sst_gpu_range coded = sst_run_plane(w->r, SST_PLANE_DERIVED, w->k);
    const struct sst_gpu_range projected = project(w);

    SST_RUN_PIXELS(w->r, SST_GPU_SURFACE_ROWS, &rows, w->width, w->height, 1, w->own, windows);
    SST_RUN_PIXELS(w->r, SST_GPU_SURFACE_LIST, &list, w->width, w->height, 1, w->own, coded, windows, projected,
                   pick_peaks(w), w->list, w->counts);
}

/* Costs of the hypotheses and their sums over paths. */
static struct sst_gpu_range optimise(const struct work *w)
{
    static const int ways[2][2] = { { 0, 1 }, { 1, 3 } }; /* the first one, how many */
    const struct sst_gpu_range costs = words_of(w, COSTS, w->pixels * SST_HYPOTHESES / 2);
    const struct sst_gpu_range sums = words_of(w, SUMS, w->pixels * SST_HYPOTHESES);
    const struct tests *t = &w->tests;
    const uint32_t paths = (uint32_t)sst_max_int(w->width, w->height);
    const enum sst_gpu_shader shader = sst_run_fastest(w->r, SST_GPU_HYPOTHESIS_PATH);
    struct sst_gpu_range table;
    uint32_t entry[256];

    for (int i = 0; i < 256; i++)
        entry[i] = w->p->penalty.p1[i] | (uint32_t)w->p->penalty.p2[i] << 16;
    table = sst_run_upload(w->r, TABLE, entry, sizeof(entry));
    SST_RUN_PIXELS(w->r, SST_GPU_HYPOTHESIS_COST, &t->push, w->width, w->height, 1, t->views, t->pixels, w->list,
                   w->counts, costs);
    for (int i = 0; i < 2; i++) {
        const struct gpu_hypothesis_path push = { .width = w->width,
                                                  .height = w->height,
                                                  .own = t->push.own,
                                                  .near = w->p->penalty.near,
                                                  .way = ways[i][0],
                                                  .ways = ways[i][1],
                                                  .first = !i };

        SST_RUN_GROUPS(w->r, shader, &push, push.ways, (paths + GPU_HYPOTHESIS_PATHS - 1) / GPU_HYPOTHESIS_PATHS, 1,
                       t->pixels, table, w->list, w->counts, costs, sums);
    }
    return sums;
}

/* The chosen hypotheses as the view's map, and in words of struct gpu_hypothesis_choice. */
static struct sst_gpu_range choose(const struct work *w)
{
    const struct gpu_hypothesis_choice push = { (uint32_t)w->pixels };
    const struct sst_gpu_convert end = { .width = w->width, .height = w->height, .conversion = SST_GPU_FROM_CHOICE };
    const uint32_t across = GPU_HYPOTHESIS_PIXELS * GPU_HYPOTHESIS_ACROSS;
    const struct sst_gpu_range sums = optimise(w), chosen = words_of(w, CHOSEN, w->pixels);
    const struct sst_gpu_range map = sst_run_plane(w->r, SST_PLANE_MAP, w->k);

    SST_RUN_GROUPS(w->r, SST_GPU_HYPOTHESIS_CHOICE, &push, GPU_HYPOTHESIS_ACROSS, (push.pixels + across - 1) / across,
                   1, w->list, w->counts, sums, chosen);
    SST_RUN_PIXELS(w->r, SST_GPU_CONVERT, &end, w->width, w->height, 1, chosen, chosen, chosen, map);
    return chosen;
}

/* Hypotheses of the rows that are tested whole. */
static void fetch_sampled(const struct work *w, const struct visible_tested *t)
{
    const size_t row = (size_t)w->width * SST_HYPOTHESES;

    for (int y = VISIBLE_SAMPLED_ROWS / 2; y < w->height; y += VISIBLE_SAMPLED_ROWS) {
        const size_t at = (size_t)y * row;
        const uint32_t *words =
            sst_run_fetch(w->r, (struct sst_gpu_range){ w->list.buffer, at * sizeof(uint16_t) }, row / 2);

        if (words)
            memcpy(t->lists->hypothesis + at, words, row * sizeof(uint16_t));
    }
}

static void take_chosen(const struct visible_tested *t, const uint32_t *chosen)
{
    const size_t width = (size_t)t->lists->width;

    for (int y = 0; y < t->lists->height; y++) {
        const uint32_t *from = chosen + (size_t)y * width;

        for (size_t x = 0; x < width; x++)
            t->lists->count[(size_t)y * width + x] =
                (from[x] & 0xFFFF) == SST_DISP_NONE ? 0 : (uint8_t)(1 + (from[x] >> 29));
        for (size_t x = 0; visible_counts_skipped(t->p) && x < width; x += HYPOTHESIS_STRIP) {
            const size_t at = (size_t)y * width + x;
            const struct hypothesis_part part = { .hypothesis = t->lists->hypothesis + at * SST_HYPOTHESES,
                                                  .count = t->lists->count + at,
                                                  .left = (int)x,
                                                  .y = y,
                                                  .n = sst_min_int(HYPOTHESIS_STRIP, (int)(width - x)) };

            visible_count_skipped(t, &part, from + x);
        }
    }
}

void dispatch_surfaces(struct sst_run *r, void *job, int k)
{
    struct visible_pass *p = job;
    const struct sst_map_u16 *disp = p->in->view[k].disp;
    struct work w = { .r = r, .p = p, .k = k, .width = disp->width, .height = disp->height };
    struct sst_gpu_range chosen;
    const uint32_t *words;
    struct visible_tested t;

    w.pixels = (size_t)w.width * (size_t)w.height;
    load_tests(&w.tests, r, p, k, visible_views(p->in));
    w.list = words_of(&w, LIST, w.pixels * SST_HYPOTHESES / 2);
    w.counts = words_of(&w, COUNTS, w.pixels);
    list_surfaces(&w);
    chosen = choose(&w);
    sst_run_fail(r, visible_begin(&t, p, k, &p->scratch[p->threads]));
    t.test = w.tests.test;
    if (visible_counts_skipped(p) && !sst_run_failed(r))
        fetch_sampled(&w, &t);
    words = sst_run_fetch(r, chosen, w.pixels);
    if (words)
        take_chosen(&t, words);
    words = sst_run_fetch(r, sst_run_plane(r, SST_PLANE_MAP, k), w.pixels);
    if (words)
        sst_step_map_unpack(words, &p->out[k], &p->confidence[k], NULL, NULL);
}
