/* The second pass on a device: pixels with depth codes, the sweep, tests of hypotheses. */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/gpu/convert.h"
#include "pipeline/gpu/sweep.h"
#include "pipeline/method/disparity/device_internal.h"
#include "pipeline/method/disparity/visible_internal.h"

_Static_assert(SST_SWEEP_LEVELS == SST_GPU_SWEEP_LEVELS && SST_SWEEP_PEAKS == SST_GPU_CELL_PEAKS &&
                   SST_AROUND_EXTREMES == 2 * SST_GPU_SURFACE_WINDOWS,
               "the layout of the shaders");

/* Scratch memory. */
enum {
    VIEWS,
    OTHERS,
    ROWS,
    PROJECTED,
    POINTS,
    SHIFTS,
    WEIGHTS,
    PEAKS,
    LIST,
    COUNTS,
    TABLE,
    COSTS,
    SUMS,
    CHOSEN,
    FOUND
};

/* Tests of view k. */
struct tests {
    struct sst_hypothesis_test test;
    struct sst_gpu_hypothesis_cost push;
    struct sst_gpu_range views, pixels; /* struct sst_gpu_hypothesis_view[]; of all views, with depth codes */
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

/* Load view k and the views that it is tested against. */
static void load_tests(struct tests *l, struct sst_run *r, const struct visible_pass *p, int k)
{
    struct sst_gpu_hypothesis_view view[SST_HYPOTHESIS_VIEWS] = { { 0 } };
    int index[1 + SST_HYPOTHESIS_VIEWS] = { k };
    const struct sst_hypothesis_test *t = &l->test;

    visible_set_test(&l->test, p, k, index + 1);
    l->pixels = sst_run_planes(r, SST_PLANE_DERIVED, index, 1 + t->views);
    for (int i = 0; i < t->views; i++)
        view[i] = (struct sst_gpu_hypothesis_view){ t->x[i], t->y[i], t->dx[i], t->dy[i],
                                                    sst_run_first(r, SST_PLANE_DERIVED, index[1 + i]) };
    l->views = sst_run_upload(r, VIEWS, view, (size_t)sst_max_int(t->views, 1) * sizeof(*view));
    l->push = (struct sst_gpu_hypothesis_cost){ .width = t->width,
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
    struct visible_pass *p = job;
    const struct sst_sweep_plan *plan = &p->sweeps.plan;
    const int columns = sst_gpu_sweep_samples(plan->width, plan->stride);
    const int rows = sst_gpu_sweep_samples(plan->height, plan->stride);
    const size_t n = (size_t)columns * (size_t)rows;
    struct tests t;
    struct sst_gpu_sweep push;
    const struct sst_gpu_range found = sst_run_scratch(r, FOUND, n * sizeof(uint32_t));
    const uint32_t *words;

    load_tests(&t, r, p, p->swept[i]);
    push = (struct sst_gpu_sweep){ t.push,      plan->stride,   plan->level,      plan->levels,
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
    const struct sst_gpu_surface_project push = { w->width, w->height };
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
    struct sst_gpu_sweep_point *point;
    size_t at = 0;

    *count = 0;
    for (int i = 0; i < sweeps->count; i++)
        *count += sweeps->sweep[i].count;
    point = (struct sst_gpu_sweep_point *)sst_run_words(w->r, (*count + 1) * sizeof(*point) / sizeof(uint32_t));
    for (int i = 0; point && i < sweeps->count; i++) {
        for (size_t k = 0; k < sweeps->sweep[i].count; k++) {
            const struct sst_sweep_point *from = &sweeps->sweep[i].point[k];

            point[at++] = (struct sst_gpu_sweep_point){ from->x | (uint32_t)from->y << 16,
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
    const uint32_t across = SST_GPU_HYPOTHESIS_PIXELS * SST_GPU_HYPOTHESIS_ACROSS;
    const struct sst_gpu_range weights = words_of(w, WEIGHTS, words);
    size_t points;
    const struct sst_gpu_range at = upload_points(w, &points);
    const struct sst_gpu_sweep_gather push = { (uint32_t)points, plan->levels, plan->cell, plan->cols, plan->rows };
    int32_t(*shift)[2] = sst_mem_alloc_raw((size_t)p->sweeps.count * levels + 1, sizeof(*shift));

    sst_run_fill(w->r, weights, 0, words, 0);
    sst_run_fail(w->r, shift ? 0 : -ENOMEM);
    for (int i = 0; shift && i < p->sweeps.count; i++)
        sst_sweep_shifts(shift + (size_t)i * levels, plan, own->bx - p->sweeps.sweep[i].bx,
                         own->by - p->sweeps.sweep[i].by, p->in->disp_min_px);
    if (shift && points)
        SST_RUN_GROUPS(w->r, SST_GPU_SWEEP_GATHER, &push, SST_GPU_HYPOTHESIS_ACROSS,
                       (push.points + across - 1) / across, 1, at,
                       sst_run_upload(w->r, SHIFTS, shift, (size_t)p->sweeps.count * levels * sizeof(*shift)), weights);
    sst_mem_free(shift);
    return weights;
}

static struct sst_gpu_range pick_peaks(const struct work *w)
{
    const struct sst_sweep_plan *plan = &w->p->sweeps.plan;
    const struct sst_gpu_sweep_peaks push = { .width = w->width,
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
    const struct sst_gpu_range peaks = words_of(w, PEAKS, (size_t)plan->cols * (size_t)plan->rows * SST_GPU_CELL_PEAKS);

    SST_RUN_GROUPS(w->r, SST_GPU_SWEEP_PEAKS, &push, plan->cols, plan->rows, 1, w->own, weights, peaks);
    return peaks;
}

static void list_surfaces(struct work *w)
{
    const struct sst_gpu_surface_rows rows = { w->width, w->height, w->p->sweeps.plan.step * 3 / 2 };
    const struct sst_gpu_surface_list list = { .width = w->width,
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
        const struct sst_gpu_hypothesis_path push = { .width = w->width,
                                                      .height = w->height,
                                                      .own = t->push.own,
                                                      .near = w->p->penalty.near,
                                                      .way = ways[i][0],
                                                      .ways = ways[i][1],
                                                      .first = !i };

        SST_RUN_GROUPS(w->r, shader, &push, push.ways,
                       (paths + SST_GPU_HYPOTHESIS_PATHS - 1) / SST_GPU_HYPOTHESIS_PATHS, 1, t->pixels, table, w->list,
                       w->counts, costs, sums);
    }
    return sums;
}

/* The chosen hypotheses as the view's map, and in words of struct sst_gpu_hypothesis_choice. */
static struct sst_gpu_range choose(const struct work *w)
{
    const struct sst_gpu_hypothesis_choice push = { (uint32_t)w->pixels };
    const struct sst_gpu_convert end = { .width = w->width, .height = w->height, .conversion = SST_GPU_FROM_CHOICE };
    const uint32_t across = SST_GPU_HYPOTHESIS_PIXELS * SST_GPU_HYPOTHESIS_ACROSS;
    const struct sst_gpu_range sums = optimise(w), chosen = words_of(w, CHOSEN, w->pixels);
    const struct sst_gpu_range map = sst_run_plane(w->r, SST_PLANE_MAP, w->k);

    SST_RUN_GROUPS(w->r, SST_GPU_HYPOTHESIS_CHOICE, &push, SST_GPU_HYPOTHESIS_ACROSS,
                   (push.pixels + across - 1) / across, 1, w->list, w->counts, sums, chosen);
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
        if (visible_counts_skipped(t->p))
            visible_count_skipped(t, y, chosen);
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
    load_tests(&w.tests, r, p, k);
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
