/*
 * Tests of hypotheses, a round of the second pass (visible.c): each pixel has a few hypotheses, the surfaces around it,
 * surfaces projected from other views and surfaces of the sweep (around.c); their costs, the optimisation over
 * them (hypotheses.c) and the choice.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/gpu/convert.h"
#include "pipeline/gpu/surfaces.h"
#include "pipeline/method/disparity/visible_internal.h"

#define SAMPLED_ROWS       64  /* one in this many is tested whole, to measure what skipped hypotheses change */
#define STRIP              128 /* columns that are tested together */

_Static_assert(SST_SWEEP_LEVELS == SST_GPU_SWEEP_LEVELS && SST_SWEEP_PEAKS == SST_GPU_CELL_PEAKS &&
                   SST_AROUND_EXTREMES == 2 * SST_GPU_SURFACE_WINDOWS,
               "the layout of the shaders");

/* A view in work. */
struct tested {
    struct visible_pass *p;
    int k;
    const struct sst_visible_view *view;
    struct hypothesis_lists *lists;
    struct sst_around *around;
    struct sst_hypothesis_test test;
};

static bool counts_skipped(const struct visible_pass *p)
{
    return p->in->skip_hypotheses && p->in->report;
}

/* Where colours are alike everywhere, no hypothesis is better than another by more than noise: the pixel's own one
 * stays. One that costs VISIBLE_CHANGE or less cannot lose, and no other is tested. */
static void prefer_own(uint16_t *cost, const uint8_t *count, int n)
{
    for (int x = 0; x < n; x++) {
        for (int i = 1; i < count[x]; i++)
            cost[x * SST_HYPOTHESES + i] = (uint16_t)(cost[x * SST_HYPOTHESES + i] + VISIBLE_CHANGE);
    }
}

/* Best hypothesis of a pixel by its costs alone. */
static int cheapest(const uint16_t *cost, int count)
{
    int best = 0;

    for (int i = 1; i < count; i++)
        best = cost[i] < cost[best] ? i : best;
    return best;
}

/* Count hypotheses that skipping left out in row y, and measure in some rows what that changes.
 * @param chosen  of a device, or NULL: the costs of the lists */
static void count_skipped(const struct tested *t, int y, const uint32_t *chosen)
{
    struct visible_counted *counted = &t->p->counted[t->k];
    const struct hypothesis_lists *l = t->lists;
    const size_t row = (size_t)y * (size_t)l->width, entries = row * SST_HYPOTHESES;
    const bool sampled = y % SAMPLED_ROWS == SAMPLED_ROWS / 2;
    struct sst_hypothesis_test whole = t->test;
    uint16_t *exact = l->line[1];

    whole.settled = VISIBLE_CHANGE + 1;
    if (sampled) {
        sst_kernels_get()->hypothesis_cost_row(exact, l->hypothesis + entries, l->count + row, &whole, 0, y,
                                               (size_t)l->width);
        prefer_own(exact, l->count + row, l->width);
    }
    for (int x = 0; x < l->width; x++) {
        const int count = l->count[row + (size_t)x];
        const size_t at = (size_t)x * SST_HYPOTHESES;
        const uint32_t there = chosen ? chosen[row + (size_t)x] : 0;
        const uint16_t own = l->cost[entries + at];
        const bool left_out = chosen ? there >> 28 & 1 : own > VISIBLE_CHANGE && own < VISIBLE_CHEAP;

        counted->hypotheses += count;
        counted->skipped += count > 1 && left_out ? count - 1 : 0;
        counted->samples += sampled && count;
        counted->changed +=
            sampled && count &&
            cheapest(exact + at, count) != (chosen ? (int)(there >> 25 & 7) : cheapest(l->cost + entries + at, count));
    }
}

/* Hypotheses of a view and their costs: in strips, so that the rows of the other views that one row needs are in the
 * cache for the next. */
static void test_hypotheses(const struct tested *t)
{
    struct hypothesis_lists *l = t->lists;

    for (int left = 0; left < l->width; left += STRIP) {
        const int n = sst_min_int(STRIP, l->width - left);

        for (int y = 0; y < l->height; y++) {
            const size_t at = (size_t)y * (size_t)l->width + (size_t)left;
            uint16_t *hypothesis = l->hypothesis + at * SST_HYPOTHESES, *cost = l->cost + at * SST_HYPOTHESES;

            sst_around_list(hypothesis, l->count + at, t->around, t->view, &(struct sst_around_part){ left, y, n });
            sst_kernels_get()->hypothesis_cost_row(cost, hypothesis, l->count + at, &t->test, left, y, (size_t)n);
            prefer_own(cost, l->count + at, n);
        }
    }
}

/* Where no other hypothesis was tested, the pixel's own disparity is the only one. */
static void settle_row(struct hypothesis_lists *l, const struct sst_hypothesis_test *test, int y)
{
    const size_t row = (size_t)y * (size_t)l->width;

    for (size_t x = row; x < row + (size_t)l->width; x++)
        l->count[x] = l->count[x] > 1 && l->cost[x * SST_HYPOTHESES] < test->settled ? 1 : l->count[x];
}

/* Costs, optimisation and choice. */
static void choose(const struct tested *t)
{
    struct visible_pass *p = t->p;
    struct hypothesis_lists *lists = t->lists;

    test_hypotheses(t);
    for (int y = 0; y < lists->height; y++) {
        if (counts_skipped(p))
            count_skipped(t, y, NULL);
        settle_row(lists, &t->test, y);
        hypothesis_paths_along(lists, &p->penalty, &t->test.own, y);
    }
    hypothesis_paths_down(lists, &p->penalty, &t->test.own, 1);
    hypothesis_paths_down(lists, &p->penalty, &t->test.own, -1);
    for (int y = 0; y < lists->height; y++)
        hypothesis_choose_row(lists, y, sst_map_u16_row(&p->out[t->k], y), sst_map_u8_row(&p->confidence[t->k], y));
}

/* Maps of view k, with the confidences that it has, and scratch. */
static int begin_view(struct tested *t, struct visible_pass *p, int k, struct visible_scratch *scratch)
{
    const struct sst_visible_view *v = &p->in->view[k];
    int err;

    *t = (struct tested){ p, k, v, &scratch->lists, &scratch->around, { .views = 0 } };
    p->counted[k] = (struct visible_counted){ 0 };
    sst_map_u16_fini(&p->out[k]);
    sst_map_u8_fini(&p->confidence[k]);
    err = sst_map_u16_init(&p->out[k], v->disp->width, v->disp->height);
    err = err ? err : sst_map_u8_init(&p->confidence[k], v->disp->width, v->disp->height);
    err = err ? err : hypothesis_lists_init(t->lists, v->disp->width, v->disp->height);
    for (int y = 0; !err && y < v->disp->height; y++)
        memcpy(sst_map_u8_row(&p->confidence[k], y), sst_map_u8_row(v->confidence, y), (size_t)v->disp->width);
    return err;
}

static bool tests(const void *job, int k)
{
    const struct visible_pass *p = job;

    return p->in->view[k].image && p->in->view[k].carried == p->in->repair;
}

static int test_view(void *job, int k, int worker)
{
    struct visible_pass *p = job;
    struct tested t;
    int nearest[SST_HYPOTHESIS_VIEWS], err;

    if (p->in->cancel && *p->in->cancel)
        return -ECANCELED;
    err = begin_view(&t, p, k, &p->scratch[worker]);
    if (p->tested[k] == VISIBLE_UNTESTED)
        p->tested[k] = VISIBLE_ON_CPU;
    err = err ? err : sst_around_init(t.around, p->in, k, &p->sweeps);
    if (err)
        return err;
    visible_set_test(&t.test, p, k, nearest);
    choose(&t);
    return 0;
}

static void tested_maps(void *arg, int k, struct sst_share_maps *out)
{
    struct visible_pass *p = arg;

    sst_share_add_u16(out, &p->out[k]);
    sst_share_add_u8(out, &p->confidence[k]);
    sst_share_add_values(out, &p->counted[k], sizeof(p->counted[k]));
}

/* --- on a device -------------------------------------------------------------------------------------------------- */

enum { VIEWS, OTHERS, ROWS, PROJECTED, POINTS, SHIFTS, WEIGHTS, PEAKS, LIST, COUNTS, TABLE, COSTS, SUMS, CHOSEN };

struct work {
    struct sst_run *r;
    const struct visible_pass *p;
    int k, width, height;
    size_t pixels;
    struct visible_tests tests;
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

        if (i != w->k && v->image && !v->carried && fabs(v->bx - own->bx) + fabs(v->by - own->by) < sst_visible_reach(in))
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

/* The points of all sweeps, seen from the view: weights by cell and level. */
static struct sst_gpu_range gather_points(const struct work *w)
{
    const struct visible_pass *p = w->p;
    const struct sst_visible_view *own = &p->in->view[w->k];
    const struct sst_sweep_plan *plan = &p->sweeps.plan;
    const struct sst_gpu_sweep_gather push = { (uint32_t)p->points, plan->levels, plan->cell, plan->cols, plan->rows };
    const size_t levels = (size_t)plan->levels, words = (size_t)plan->cols * (size_t)plan->rows * levels;
    const uint32_t across = SST_GPU_HYPOTHESIS_PIXELS * SST_GPU_HYPOTHESIS_ACROSS;
    const struct sst_gpu_range weights = words_of(w, WEIGHTS, words);
    int32_t(*shift)[2] = sst_mem_alloc_raw((size_t)p->sweeps.count * levels + 1, sizeof(*shift));

    sst_run_fill(w->r, weights, 0, words, 0);
    sst_run_fail(w->r, shift ? 0 : -ENOMEM);
    for (int i = 0; shift && i < p->sweeps.count; i++)
        sst_sweep_shifts(shift + (size_t)i * levels, plan, own->bx - p->sweeps.sweep[i].bx,
                         own->by - p->sweeps.sweep[i].by, p->in->disp_min_px);
    if (shift && p->points)
        SST_RUN_GROUPS(w->r, SST_GPU_SWEEP_GATHER, &push, SST_GPU_HYPOTHESIS_ACROSS,
                       (push.points + across - 1) / across, 1,
                       sst_run_upload(w->r, POINTS, p->point, p->points * sizeof(*p->point)),
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
    const struct visible_tests *t = &w->tests;
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
static struct sst_gpu_range choose_on_device(const struct work *w)
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
static void fetch_sampled(const struct work *w, const struct tested *t)
{
    const size_t row = (size_t)w->width * SST_HYPOTHESES;

    for (int y = SAMPLED_ROWS / 2; y < w->height; y += SAMPLED_ROWS) {
        const size_t at = (size_t)y * row;
        const uint32_t *words =
            sst_run_fetch(w->r, (struct sst_gpu_range){ w->list.buffer, at * sizeof(uint16_t) }, row / 2);

        if (words)
            memcpy(t->lists->hypothesis + at, words, row * sizeof(uint16_t));
    }
}

static void take_chosen(const struct tested *t, const uint32_t *chosen)
{
    const size_t width = (size_t)t->lists->width;

    for (int y = 0; y < t->lists->height; y++) {
        const uint32_t *from = chosen + (size_t)y * width;

        for (size_t x = 0; x < width; x++)
            t->lists->count[(size_t)y * width + x] =
                (from[x] & 0xFFFF) == SST_DISP_NONE ? 0 : (uint8_t)(1 + (from[x] >> 29));
        if (counts_skipped(t->p))
            count_skipped(t, y, chosen);
    }
}

static void test_on_device(struct sst_run *r, void *job, int k)
{
    struct visible_pass *p = job;
    const struct sst_map_u16 *disp = p->in->view[k].disp;
    struct work w = { .r = r, .p = p, .k = k, .width = disp->width, .height = disp->height };
    struct sst_gpu_range chosen;
    const uint32_t *words;
    struct tested t;

    w.pixels = (size_t)w.width * (size_t)w.height;
    visible_load(&w.tests, r, p, k, VIEWS);
    w.list = words_of(&w, LIST, w.pixels * SST_HYPOTHESES / 2);
    w.counts = words_of(&w, COUNTS, w.pixels);
    list_surfaces(&w);
    chosen = choose_on_device(&w);
    sst_run_fail(r, begin_view(&t, p, k, &p->scratch[p->threads]));
    t.test = w.tests.test;
    if (counts_skipped(p) && !sst_run_failed(r))
        fetch_sampled(&w, &t);
    words = sst_run_fetch(r, chosen, w.pixels);
    if (words)
        take_chosen(&t, words);
    words = sst_run_fetch(r, sst_run_plane(r, SST_PLANE_MAP, k), w.pixels);
    if (!words)
        return;
    sst_step_map_unpack(words, &p->out[k], &p->confidence[k], NULL, NULL);
    p->tested[k] = VISIBLE_ON_DEVICE;
}

static void *surfaces_sample(uint32_t seed)
{
    struct visible_pass *p = visible_sample(seed);

    if (!p || !visible_sweep(p, NULL))
        return p;
    visible_sample_free(p);
    return NULL;
}

const struct sst_step disparity_surfaces_step = { .name = "surfaces",
                                                  .stages = 1U << SST_DISPARITY_STAGE_SURFACES,
                                                  .wants = tests,
                                                  .source = visible_pass_source,
                                                  .derive = visible_derive,
                                                  .cpu = test_view,
                                                  .device = test_on_device,
                                                  .writes = tested_maps,
                                                  .changes = 1U << SST_PLANE_MAP,
                                                  .sample = surfaces_sample,
                                                  .sample_free = visible_sample_free };

int visible_test(struct visible_pass *p, struct sst_runner_user *user)
{
    const struct sst_run_options how = { p->in->share, p->threads, 1, p->in->cancel };

    return sst_run(user, &disparity_surfaces_step, p, p->in->count, &how);
}
