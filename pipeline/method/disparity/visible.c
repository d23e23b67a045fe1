/*
 * The second pass (design.md, 5.7). The first one compares windows, which at a gap between leaves hold more leaf than
 * gap: its maps let thin things grow and close what is between them. Here each pixel has a few hypotheses, the surfaces
 * around it, those that other views project onto it and those that a sweep finds (around.c), and each hypothesis is
 * tested pixel by pixel against the views around, of which those count in which nothing nearer hides it. What the
 * colours cannot decide, the semi-global optimisation over the hypotheses does.
 */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/lightfield/share.h"
#include "pipeline/method/disparity/disparity_internal.h"

#define MARGIN         2  /* columns and rows around a packed view */
#define SIMILAR        24 /* levels: pixels of a window that count; in noise ... */
#define SIMILAR_MOST   40
#define SIMILAR_GAIN   3   /* ... as many more for a level of it */
#define NOISE          4.5 /* ... beyond this, which texture feigns */
#define LEVELS_RANGE   24 /* the range's share that makes a step: surfaces that are nearer to each other are one */
#define STEP_LEAST     8  /* 1/64 px */
#define STEP_MOST      96 /* 1/64 px: a pixel and a half, what checks and noise of the first pass leave */
#define P1             30 /* penalties, in the units of SST_HYPOTHESIS_LIMIT */
#define P2             300
#define CHANGE         40  /* penalty of a disparity other than the first pass's */
#define CHEAP          96  /* cost of a disparity that needs no other to be tested, if hypotheses are skipped */
#define SAMPLED_ROWS   64  /* one in this many is tested whole, to measure that */
#define EDGE_STEP      16  /* levels at which P2 is halved */
#define SWEPT          4   /* one in this many views looks for surfaces that no map has */
#define STRIP          128 /* columns that are tested together */
#define NEAREST_CODE   254
#define DISPLACED_MOST 32000 /* px */

struct packed {
    uint32_t *memory, *pixels; /* pixels: (0, 0) */
    ptrdiff_t stride;
    int similar; /* levels, by the picture's noise */
};

struct scratch;

struct pass {
    const struct sst_visible_views *in;
    int step;            /* 1/64 px */
    uint8_t *code;       /* [65536], see struct sst_hypothesis_test */
    struct packed *view; /* [in->count] */
    struct sst_map_u16 *out;
    bool *stays; /* [in->count] the device has `out` as well */
    struct sst_hypothesis_penalty penalty;
    struct scratch *scratch; /* [threads] */
    struct sst_sweep_plan plan;
    struct sst_sweep *sweep; /* [sweeps] points that views found, of all rounds */
    int *swept;              /* [sweeps] these views */
    int sweeps;
    struct counted {
        int64_t hypotheses, skipped, samples, changed; /* see struct sst_disparity_report */
    } * counted;                                       /* [in->count] */
    pthread_mutex_t lock;
    /* under lock */
    bool loaded; /* the device has all views of this round */
};

/* --- pictures ----------------------------------------------------------------------------------------------------- */

static int pack_colours(struct packed *p, const struct sst_image *img)
{
    const ptrdiff_t stride = img->width + 2 * MARGIN;

    p->memory = sst_mem_alloc_raw((size_t)stride * (size_t)(img->height + 2 * MARGIN), sizeof(*p->memory));
    if (!p->memory)
        return -ENOMEM;
    p->stride = stride;
    p->similar = sst_min_int(SIMILAR + (int)(SIMILAR_GAIN * fmax(sst_image_noise(img) - NOISE, 0)), SIMILAR_MOST);
    p->pixels = p->memory + MARGIN * stride + MARGIN;
    for (int y = -MARGIN; y < img->height + MARGIN; y++) {
        const int from = sst_clamp_int(y, 0, img->height - 1);
        const uint8_t *r = sst_image_row(img, 0, from), *g = sst_image_row(img, 1, from);
        const uint8_t *b = sst_image_row(img, 2, from);
        uint32_t *to = p->pixels + y * stride;

        for (int x = 0; x < img->width; x++)
            to[x] = r[x] | (uint32_t)g[x] << 8 | (uint32_t)b[x] << 16;
        for (int x = 1; x <= MARGIN; x++) {
            to[-x] = to[0];
            to[img->width - 1 + x] = to[img->width - 1];
        }
    }
    return 0;
}

static int pack_job(void *arg, int k, int worker SST_UNUSED)
{
    struct pass *p = arg;
    const struct sst_visible_view *v = &p->in->view[k];
    struct sst_image half = { 0 };
    int err;

    if (!v->image)
        return 0;
    if (p->in->scale == 1)
        return pack_colours(&p->view[k], v->image);
    err = sst_image_halve(&half, v->image);
    err = err ? err : pack_colours(&p->view[k], &half);
    sst_image_fini(&half);
    return err;
}

/* Write the depth codes of a view's map into its packed pixels. */
static int code_job(void *arg, int k, int worker SST_UNUSED)
{
    struct pass *p = arg;
    const struct sst_visible_view *v = &p->in->view[k];

    for (int y = 0; v->image && y < v->disp->height; y++) {
        const uint16_t *d = sst_map_u16_row(v->disp, y);
        const uint8_t *seen = v->seen && v->seen->data ? sst_map_u8_row(v->seen, y) : NULL;
        uint32_t *to = p->view[k].pixels + y * p->view[k].stride;

        for (int x = 0; x < v->disp->width; x++) {
            const uint32_t code = seen && !seen[x] ? SST_DEPTH_OUTSIDE : p->code[d[x]];

            to[x] = (to[x] & 0xFFFFFF) | code << 24;
        }
    }
    return 0;
}

static void set_codes(struct pass *p)
{
    const unsigned most = (unsigned)p->in->range * 64 + 1;

    for (unsigned d = 0; d < SST_DISP_NONE; d++)
        p->code[d] = (uint8_t)(1 + (d < most ? d : most) * (NEAREST_CODE - 1) / most);
    p->code[SST_DISP_NONE] = 0;
}

/* --- views to test against ---------------------------------------------------------------------------------------- */

int sst_visible_nearest(const struct sst_visible_views *in, int k, int most, int *nearest)
{
    const struct sst_visible_view *own = &in->view[k];
    const double reach = fabs(in->disp_min_px) + SST_DISP_NONE / SST_DISP_SCALE;
    double distance[SST_HYPOTHESIS_VIEWS];
    int n = 0;

    for (int i = 0; i < in->count; i++) {
        const struct sst_visible_view *v = &in->view[i];
        const double far = hypot(v->bx - own->bx, v->by - own->by);
        int at;

        if (i == k || !v->image || far * reach > DISPLACED_MOST || (n == most && far >= distance[n - 1]))
            continue;
        n += n < most;
        for (at = n - 1; at > 0 && distance[at - 1] > far; at--) {
            distance[at] = distance[at - 1];
            nearest[at] = nearest[at - 1];
        }
        distance[at] = far;
        nearest[at] = i;
    }
    return n;
}

enum sst_step_plane visible_colours(const struct sst_visible_views *in)
{
    return in->scale == 1 ? SST_PLANE_COLOUR : SST_PLANE_REDUCED;
}

void visible_source(const struct sst_visible_views *in, int k, struct sst_plane_source *out)
{
    const struct sst_visible_view *v = &in->view[k];

    *out = (struct sst_plane_source){
        .image = v->image, .seen = v->seen, .disp = v->disp, .confidence = v->confidence, .agreed = v->agreed
    };
}

int sst_visible_block(const struct sst_visible_views *in)
{
    size_t pixels = 0;

    for (int k = 0; k < in->count && !pixels; k++)
        pixels = in->view[k].image ? (size_t)in->view[k].disp->width * (size_t)in->view[k].disp->height : 0;
    return sst_share_block(pixels);
}

/* In 2^-16 px. */
static int32_t q16(double px)
{
    return (int32_t)floor(px * 65536 + 0.5);
}

/* @param nearest  out [SST_HYPOTHESIS_VIEWS]: the views that it is tested against */
static void set_test(struct sst_hypothesis_test *t, const struct pass *p, int k, int *nearest)
{
    const struct sst_visible_view *own = &p->in->view[k];

    *t = (struct sst_hypothesis_test){ .own = { p->view[k].pixels, p->view[k].stride },
                                       .views = sst_visible_nearest(p->in, k, SST_HYPOTHESIS_VIEWS, nearest),
                                       .width = own->disp->width,
                                       .height = own->disp->height,
                                       .code = p->code,
                                       .tolerance = p->step,
                                       .similar = p->view[k].similar,
                                       .settled = p->in->skip_hypotheses ? CHEAP : CHANGE + 1 };
    for (int i = 0; i < t->views; i++) {
        const struct packed *at = &p->view[nearest[i]];
        const double bx = p->in->view[nearest[i]].bx - own->bx, by = p->in->view[nearest[i]].by - own->by;

        t->view[i] = (struct sst_packed_view){ at->pixels, at->stride };
        t->x[i] = q16(0.5 - p->in->disp_min_px * bx);
        t->y[i] = q16(0.5 - p->in->disp_min_px * by);
        t->dx[i] = q16(-bx / 64);
        t->dy[i] = q16(-by / 64);
    }
}

/* What a device does with view k, except for the choice. */
static struct device_hypotheses device_view(const struct pass *p, int k, const struct sst_hypothesis_test *test,
                                            const int *nearest)
{
    return (struct device_hypotheses){ .in = p->in,
                                       .view = k,
                                       .test = test,
                                       .nearest = nearest,
                                       .step = p->step,
                                       .plan = &p->plan,
                                       .sweep = p->sweep,
                                       .sweeps = p->sweeps,
                                       .penalty = &p->penalty,
                                       .most = (uint32_t)p->in->range * 64 + 1,
                                       .change = CHANGE,
                                       .cheap = CHEAP };
}

/* --- surfaces that no map has ------------------------------------------------------------------------------------- */

/* @return false: the device fails, or has failed */
static bool sweep_on_device(struct pass *p, int i, const struct sst_hypothesis_test *test, const int *nearest)
{
    const struct device_hypotheses in = device_view(p, p->swept[i], test, nearest);
    bool done;

    pthread_mutex_lock(&p->lock);
    done = p->loaded && disparity_device_sweep(p->in->device, &in, &p->sweep[i]);
    p->loaded = done;
    if (!done)
        sst_disparity_device_note_stage(p->in->device, SST_DISPARITY_STAGE_SURFACES);
    pthread_mutex_unlock(&p->lock);
    return done;
}

static int sweep_job(void *arg, int i, int worker SST_UNUSED)
{
    struct pass *p = arg;
    const struct sst_visible_view *v = &p->in->view[p->swept[i]];
    struct sst_hypothesis_test test;
    int nearest[SST_HYPOTHESIS_VIEWS];

    if (p->in->cancel && *p->in->cancel)
        return -ECANCELED;
    set_test(&test, p, p->swept[i], nearest);
    if (p->in->device && sweep_on_device(p, i, &test, nearest))
        return 0;
    return sst_sweep_view(&p->sweep[i], &test, v->disp, v->seen, p->in->range * 64, p->step);
}

static void swept_points(void *arg, int i, struct sst_share_maps *out)
{
    struct pass *p = arg;

    sst_share_add_list(out, &p->sweep[i].point, &p->sweep[i].count, sizeof(*p->sweep[i].point));
}

/* Points in space from one view in SWEPT. */
static int sweep_views(struct pass *p, int threads)
{
    p->sweep = calloc((size_t)p->in->count, sizeof(*p->sweep));
    p->swept = calloc((size_t)p->in->count, sizeof(*p->swept));
    if (!p->sweep || !p->swept)
        return -ENOMEM;
    for (int k = 0; k < p->in->count; k++) {
        const struct sst_visible_view *v = &p->in->view[k];

        if (!v->image || (lround(v->bx) + 2 * lround(v->by)) % SWEPT)
            continue;
        p->sweep[p->sweeps].bx = v->bx;
        p->sweep[p->sweeps].by = v->by;
        p->swept[p->sweeps++] = k;
    }
    return sst_share_for(p->in->share, p->sweeps, threads, sweep_job, p, swept_points);
}

/* --- tests and choice ----------------------------------------------------------------------------------------------
 */

/* What a thread uses for one view after the other. */
struct scratch {
    struct hypothesis_lists lists;
    struct sst_around around;
};

/* Where colours are alike everywhere, no hypothesis is better than another by more than noise: the pixel's own one
 * stays. One that costs CHANGE or less cannot lose, and no other is tested. */
static void prefer_own(uint16_t *cost, const uint8_t *count, int n)
{
    for (int x = 0; x < n; x++) {
        for (int i = 1; i < count[x]; i++)
            cost[x * SST_HYPOTHESES + i] = (uint16_t)(cost[x * SST_HYPOTHESES + i] + CHANGE);
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

/* Count what skipping left out in row y of view k, and measure in some rows what that changes.
 * @param exact   scratch, a row
 * @param chosen  of a device, or NULL: the costs are those of the lists */
static void count_skipped(struct pass *p, int k, const struct hypothesis_lists *l,
                          const struct sst_hypothesis_test *test, int y, uint16_t *exact, const uint32_t *chosen)
{
    struct counted *counted = &p->counted[k];
    const size_t row = (size_t)y * (size_t)l->width, entries = row * SST_HYPOTHESES;
    const bool sampled = y % SAMPLED_ROWS == SAMPLED_ROWS / 2;
    struct sst_hypothesis_test whole = *test;

    whole.settled = CHANGE + 1;
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
        const bool left_out = chosen ? there >> 28 & 1 : own > CHANGE && own < CHEAP;

        counted->hypotheses += count;
        counted->skipped += count > 1 && left_out ? count - 1 : 0;
        counted->samples += sampled && count;
        counted->changed +=
            sampled && count &&
            cheapest(exact + at, count) != (chosen ? (int)(there >> 25 & 7) : cheapest(l->cost + entries + at, count));
    }
}

/* Over all views. */
static void report_skipped(const struct pass *p)
{
    struct sst_disparity_report *report = p->in->report;
    struct counted all = { 0 };

    for (int k = 0; k < p->in->count; k++) {
        all.hypotheses += p->counted[k].hypotheses;
        all.skipped += p->counted[k].skipped;
        all.samples += p->counted[k].samples;
        all.changed += p->counted[k].changed;
    }
    if (report && all.hypotheses)
        report->hypotheses_skipped = 100 * (double)all.skipped / (double)all.hypotheses;
    if (report && all.samples)
        report->hypotheses_error = 100 * (double)all.changed / (double)all.samples;
}

/* Hypotheses of a view and their costs: in strips, so that the rows of the other views that one row needs are in the
 * cache for the next. */
static void test_hypotheses(struct hypothesis_lists *l, const struct pass *p, const struct sst_around *around,
                            const struct sst_visible_view *v, const struct sst_hypothesis_test *test)
{
    const int apart = sst_max_int(p->step, 1);

    for (int left = 0; left < l->width; left += STRIP) {
        const int n = sst_min_int(STRIP, l->width - left);

        for (int y = 0; y < l->height; y++) {
            const size_t at = (size_t)y * (size_t)l->width + (size_t)left;
            uint16_t *hypothesis = l->hypothesis + at * SST_HYPOTHESES, *cost = l->cost + at * SST_HYPOTHESES;

            sst_around_list(hypothesis, l->count + at, around, v, left, y, n, apart);
            sst_kernels_get()->hypothesis_cost_row(cost, hypothesis, l->count + at, test, left, y, (size_t)n);
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

/* Costs, optimisation and choice on the CPU. */
static void choose_on_cpu(struct pass *p, int k, struct hypothesis_lists *lists, const struct sst_around *around,
                          const struct sst_hypothesis_test *test)
{
    const struct sst_visible_view *v = &p->in->view[k];

    test_hypotheses(lists, p, around, v, test);
    for (int y = 0; y < lists->height; y++) {
        if (p->in->skip_hypotheses && p->in->report)
            count_skipped(p, k, lists, test, y, lists->line[1], NULL);
        settle_row(lists, test, y);
        hypothesis_paths_along(lists, &p->penalty, &test->own, y);
    }
    hypothesis_paths_down(lists, &p->penalty, &test->own, 1);
    hypothesis_paths_down(lists, &p->penalty, &test->own, -1);
    for (int y = 0; y < lists->height; y++)
        hypothesis_choose_row(lists, y, sst_map_u16_row(&p->out[k], y), sst_map_u8_row(v->confidence, y));
}

/* The same on the device. @return false: it fails, or is not loaded */
static bool choose_on_device(struct pass *p, int k, struct hypothesis_lists *lists,
                             const struct sst_hypothesis_test *test, const int *nearest)
{
    const struct sst_visible_view *v = &p->in->view[k];
    const bool count_too = p->in->skip_hypotheses && p->in->report;
    struct device_hypotheses in = device_view(p, k, test, nearest);
    const size_t width = (size_t)lists->width;
    bool done;

    in.out = lists->chosen;
    in.list = count_too ? lists->hypothesis : NULL;
    in.first = SAMPLED_ROWS / 2;
    in.every = SAMPLED_ROWS;
    pthread_mutex_lock(&p->lock);
    done = p->loaded && disparity_device_test(p->in->device, &in);
    p->loaded = done;
    pthread_mutex_unlock(&p->lock);
    p->stays[k] = done;
    for (int y = 0; done && y < lists->height; y++) {
        const uint32_t *from = lists->chosen + (size_t)y * width;
        uint16_t *disp = sst_map_u16_row(&p->out[k], y);
        uint8_t *confidence = sst_map_u8_row(v->confidence, y);

        for (size_t x = 0; x < width; x++) {
            disp[x] = (uint16_t)from[x];
            confidence[x] = from[x] >> 24 & 1 ? (uint8_t)(from[x] >> 16) : confidence[x];
            lists->count[(size_t)y * width + x] = disp[x] == SST_DISP_NONE ? 0 : (uint8_t)(1 + (from[x] >> 29));
        }
        if (count_too)
            count_skipped(p, k, lists, test, y, lists->line[1], lists->chosen);
    }
    return done;
}

static int second_job(void *arg, int k, int worker)
{
    struct pass *p = arg;
    const struct sst_visible_view *v = &p->in->view[k];
    struct sst_around *around = &p->scratch[worker].around;
    struct hypothesis_lists *lists = &p->scratch[worker].lists;
    struct sst_hypothesis_test test;
    int nearest[SST_HYPOTHESIS_VIEWS], err;

    if (!v->image || v->carried != p->in->repair)
        return 0;
    if (p->in->cancel && *p->in->cancel)
        return -ECANCELED;
    err = sst_map_u16_init(&p->out[k], v->disp->width, v->disp->height);
    err = err ? err : hypothesis_lists_init(lists, v->disp->width, v->disp->height);
    if (!err && p->in->device && !lists->chosen) {
        lists->chosen = sst_mem_alloc_raw((size_t)lists->width * (size_t)lists->height, sizeof(*lists->chosen));
        err = lists->chosen ? 0 : -ENOMEM;
    }
    if (err)
        return err;
    set_test(&test, p, k, nearest);
    if (p->in->device && choose_on_device(p, k, lists, &test, nearest))
        return 0;
    if (p->in->device) {
        pthread_mutex_lock(&p->lock);
        disparity_device_note_untested(p->in->device);
        pthread_mutex_unlock(&p->lock);
    }
    err = sst_around_init(around, p->in, k, p->step, p->sweep, p->sweeps);
    if (!err)
        choose_on_cpu(p, k, lists, around, &test);
    return err;
}

static void second_maps(void *arg, int k, struct sst_share_maps *out)
{
    struct pass *p = arg;
    const struct sst_visible_view *v = &p->in->view[k];

    if (!v->image || v->carried != p->in->repair)
        return;
    sst_share_add_u16(out, &p->out[k]);
    sst_share_add_u8(out, v->confidence);
    sst_share_add_values(out, &p->counted[k], sizeof(p->counted[k]));
}

static void set_penalties(struct pass *p)
{
    p->penalty.near = (uint16_t)sst_max_int(p->step / 2, 1);
    for (int colour = 0; colour < 256; colour++) {
        p->penalty.p1[colour] = P1;
        p->penalty.p2[colour] = (uint16_t)sst_max_int(P2 * EDGE_STEP / (EDGE_STEP + colour), P1);
    }
}

/* All views are of one size. */
static void set_plan(struct pass *p)
{
    for (int k = 0; k < p->in->count; k++) {
        const struct sst_visible_view *v = &p->in->view[k];

        if (v->image)
            sst_sweep_plan_init(&p->plan, v->disp->width, v->disp->height, p->in->range * 64, p->step);
    }
}

static int one_round(struct pass *p, int round, int threads)
{
    const struct sst_visible_views *in = p->in;
    int err = sst_parallel_for(in->count, threads, code_job, p);

    if (!err && in->device && (round || !p->loaded)) /* the sweep has the views of the first one */
        p->loaded = disparity_device_load(in->device, in);
    if (!err && p->loaded)
        p->loaded = disparity_device_load_points(in->device, p->sweep, p->sweeps);
    err = err ? err : sst_share_for(in->share, in->count, threads, second_job, p, second_maps);
    for (int k = 0; k < in->count; k++) {
        if (!err && p->out[k].data)
            memcpy(in->view[k].disp->data, p->out[k].data, p->out[k].stride * (size_t)p->out[k].height);
        if (p->out[k].data && !p->stays[k])
            disparity_device_map_changed(in->device, k);
        p->stays[k] = false;
        sst_map_u16_fini(&p->out[k]);
    }
    return err;
}

int sst_disparity_visible(const struct sst_visible_views *in, int rounds, int threads)
{
    struct pass p = { .in = in, .step = sst_clamp_int(in->range * 64 / LEVELS_RANGE, STEP_LEAST, STEP_MOST) };
    int err = -ENOMEM;

    pthread_mutex_init(&p.lock, NULL);
    p.view = calloc((size_t)in->count, sizeof(*p.view));
    p.out = calloc((size_t)in->count, sizeof(*p.out));
    p.scratch = calloc((size_t)threads, sizeof(*p.scratch));
    p.stays = calloc((size_t)in->count, sizeof(*p.stays));
    p.counted = calloc((size_t)in->count, sizeof(*p.counted));
    p.code = sst_mem_alloc_raw(65536, 1);
    if (p.view && p.out && p.stays && p.scratch && p.counted && p.code) {
        set_codes(&p);
        set_plan(&p);
        set_penalties(&p);
        err = sst_parallel_for(in->count, threads, pack_job, &p);
        err = err ? err : sst_parallel_for(in->count, threads, code_job, &p);
        if (!err && in->device)
            p.loaded = disparity_device_load(in->device, in);
        err = err ? err : sweep_views(&p, threads);
    }
    for (int i = 0; !err && i < rounds; i++)
        err = one_round(&p, i, threads);
    if (!err)
        report_skipped(&p);
    for (int k = 0; p.view && k < in->count; k++)
        sst_mem_free(p.view[k].memory);
    for (int i = 0; i < p.sweeps; i++)
        sst_sweep_fini(&p.sweep[i]);
    for (int i = 0; p.scratch && i < threads; i++) {
        hypothesis_lists_fini(&p.scratch[i].lists);
        sst_around_fini(&p.scratch[i].around);
    }
    free(p.scratch);
    free(p.counted);
    free(p.sweep);
    free(p.swept);
    sst_mem_free(p.code);
    free(p.view);
    free(p.out);
    free(p.stays);
    pthread_mutex_destroy(&p.lock);
    return err;
}
