/* Pictures without rays that change little (design.md, 5.5). A picture is made in tiles, each in one of several ways:
 * from a quarter of the views, from half, or from all; with the weights of the rays, or with one weight for all rays,
 * which reads no maps. A row of tiles takes two steps.
 *
 * 1. Two of the 32 rows of each tile are rendered from all views, with their weights; these rows are final. Their sums,
 *    and sums without weights, pass through the sums of nested subsets of the views: the same rows in all ways.
 * 2. The other rows of a tile are rendered in the way with the least time + error / lambda, by the rows of step 1.
 *    Where all rays count they are summed in the order of exact pictures, so that they have their bytes.
 *
 * Step 1 of every PROBE_STEP-th row of tiles comes before all else. It gives lambda, for the picture with the least
 * time within the budget; where it promises next to no gain, the picture is exact. Pictures with verified rays are
 * exact as well, since votes need all rays.
 *
 * Every pixel is normalised by the weights of its own rays: where it has none, the exact pixel takes its place
 * (render_mend_row()). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/render/render_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"

#define TILE_WIDTH    128
#define TILE_HEIGHT   32
#define STRETCH_TILES (1024 / TILE_WIDTH)
#define STRETCH       (STRETCH_TILES * TILE_WIDTH) /* pixels summed together: the sums stay cached */
#define AHEAD         512                          /* pixels of a view that are read before they are needed */
/* Rows of a tile that decide, and the row of every CHECK_TILES-th tile that is compared with the exact one at the end. */
#define DECIDE_ROW  7
#define DECIDE_STEP 16
#define CHECK_ROW   16
#define CHECK_TILES 8
/* The estimate is the error of few rows, and the least of several: the choice may use a part of the budget. */
#define SAFE 0.3
/* Largest error of one tile, by its rows, in budgets: what is seen is the worst tile, not the mean. */
#define TILE_MOST 3
/* Rows of tiles that are probed, and the share of the exact time from which on skips do not pay. */
#define PROBE_STEP  6
#define PROBE_FIRST 2
#define WORTH       0.9
/* Time of a ray without its own weight relative to one with it, measured. */
#define PLAIN_TIME 0.65

#define LEVELS 3 /* subsets of the views: a quarter, half, all */
#define WAYS   (2 * LEVELS)

/* Ways to make a tile, by time: two of each subset, without weights first. */
static int way_of(int level, bool plain)
{
    return 2 * level + !plain;
}

/* True if rows that decide are made in this way. */
static bool offered(const struct sst_render_plan *p, int way)
{
    return way & 1 ? !p->summed : p->summed || p->weighted;
}

/* Rays of one view in some tiles of a stretch. */
struct run {
    int k;
    int from, to; /* pixels of the stretch */
    bool plain;
};

/* Working memory of a thread. */
struct skip_scratch {
    _Alignas(SST_ALIGN) float acc[4][STRETCH + 16]; /* rows begin at different places of a page, as in render.c */
    int32_t sum[3][STRETCH + 16];
    float count[STRETCH + 16];
    float total[4][STRETCH + 16];
    uint8_t picture[WAYS][3][STRETCH], support[STRETCH];
    struct sst_skip_counts counts;
    struct run *run; /* [views * STRETCH_TILES] */
};

/* One tile of the picture. */
struct tile {
    uint32_t error2[WAYS]; /* of the rows that decide: squares against the exact ones */
    uint8_t way;
};

struct skipper {
    const struct sst_render_plan *plan;
    struct sst_image *out;
    struct sst_map_u8 *valid;
    double budget2;    /* mean square of the error, grey levels */
    double lambda;     /* error that is worth the time of an exact pixel */
    double time[WAYS]; /* of a pixel; 1: exact */
    int exact;         /* way of exact pictures */
    int cols, rows;
    int order[SST_MAX_VIEWS];        /* taps by level */
    int level_end[LEVELS];           /* in order */
    uint8_t level_of[SST_MAX_VIEWS]; /* by tap */
    struct tile *tile;               /* [rows][cols] */
    struct skip_scratch **scratch;   /* [threads] */
    int threads;
};

/* --- subsets of the views ----------------------------------------------------------------------------------------- */

/* Every other view of every other row, as in a staggered lattice; the rest of the chessboard; the rest. */
static int level_of(const struct sst_lightfield *lf, int view)
{
    const int row = view / lf->cols - (lf->rows - 1) / 2, col = view % lf->cols - (lf->cols - 1) / 2;

    return (row + col) & 1 ? 2 : lf->rows > 1 && lf->cols > 1 && row & 1 ? 1 : 0;
}

static void order_views(struct skipper *s)
{
    int n = 0;

    for (int level = 0; level < LEVELS; level++) {
        for (int k = 0; k < s->plan->count; k++) {
            if (level_of(s->plan->lf, s->plan->tap[k].view) != level)
                continue;
            s->level_of[k] = (uint8_t)level;
            s->order[n++] = k;
        }
        s->level_end[level] = n;
    }
}

/* --- sums --------------------------------------------------------------------------------------------------------- */

/* Of n pixels. */
static void clear_sums(struct skip_scratch *w, int n)
{
    for (int c = 0; c < 4; c++)
        memset(w->acc[c], 0, (size_t)n * sizeof(float));
    for (int c = 0; c < 3; c++)
        memset(w->sum[c], 0, (size_t)n * sizeof(int32_t));
    memset(w->count, 0, (size_t)n * sizeof(float));
}

/* Reads ahead of the kernels, AHEAD pixels in the order of the runs: the rows of all views are too many streams for the
 * processor to follow, and short runs leave it no time. */
struct reader {
    int runs, i, x; /* the next pixels: x of run i */
    int left;       /* pixels that are read ahead of the kernels */
    bool above;     /* the upper rows are not in the cache either */
    struct sst_blend at;
    const struct sst_blend *now;
};

static void read_ahead(struct reader *r, const struct skipper *s, const struct skip_scratch *w, int x, int y, int used)
{
    r->left -= used;
    while (r->left < AHEAD && r->i < r->runs) {
        const struct run *run = &w->run[r->i];

        if (!r->x)
            r->now = render_read_ahead(&r->at, s->plan, &s->plan->tap[run->k], x + run->from, run->to - run->from, y,
                                       run->plain);
        for (int c = 0; r->now && c < 3; c++) {
            __builtin_prefetch(r->now->bottom[c] + r->x, 0, 2);
            if (r->above)
                __builtin_prefetch(r->now->top[c] + r->x, 0, 2);
        }
        if (r->now && r->now->disp) {
            __builtin_prefetch(r->now->disp + r->x, 0, 2);
            __builtin_prefetch(r->now->disp + r->x + 32, 0, 2);
        }
        if (r->now && r->now->label)
            __builtin_prefetch(r->now->label + r->x, 0, 2);
        r->x += 64;
        r->left += 64;
        if (r->x >= run->to - run->from) {
            r->x = 0;
            r->i++;
        }
    }
}

/* Add runs 0 .. runs-1 of one row of a stretch. @param jump  the row above was not rendered just before */
static void add_runs(const struct skipper *s, struct skip_scratch *w, int runs, int x, int y, bool jump)
{
    struct reader r = { .runs = runs, .above = jump };

    for (int i = 0; i < runs; i++) {
        const struct run *run = &w->run[i];
        const int at = run->from;
        const struct render_sink sink = { .acc = { w->acc[0] + at, w->acc[1] + at, w->acc[2] + at, w->acc[3] + at },
                                          .sum = { w->sum[0] + at, w->sum[1] + at, w->sum[2] + at },
                                          .count = w->count + at,
                                          .plain = run->plain };

        read_ahead(&r, s, w, x, y, run->to - run->from);
        render_add_view(&sink, s->plan, &s->plan->tap[run->k], x + at, run->to - at, y);
    }
}

/* Colours of n pixels, and their weights in total[3], from the sums: a pixel has rays of one kind. */
static void finish(struct skip_scratch *w, uint8_t *const to[3], int n)
{
    for (int c = 0; c < 3; c++) {
        for (int i = 0; i < n; i++)
            w->total[c][i] = w->acc[c][i] + (float)w->sum[c][i];
    }
    for (int i = 0; i < n; i++)
        w->total[3][i] = w->acc[3][i] + w->count[i];
    for (int c = 0; c < 3; c++)
        sst_kernels_get()->blend_finish(to[c], w->total[c], w->total[3], (size_t)n);
}

/* --- 1. rows that decide ------------------------------------------------------------------------------------------ */

/* Pictures of one row with nested subsets of the views. */
static void sum_levels(const struct skipper *s, struct skip_scratch *w, int x, int n, int y, bool plain)
{
    clear_sums(w, n);
    for (int level = 0, at = 0; level < LEVELS; level++) {
        uint8_t(*to)[STRETCH] = w->picture[way_of(level, plain)];
        int runs = 0;

        for (; at < s->level_end[level]; at++)
            w->run[runs++] = (struct run){ s->order[at], 0, n, plain };
        add_runs(s, w, runs, x, y, true);
        finish(w, (uint8_t *const[3]){ to[0], to[1], to[2] }, n);
    }
}

static uint32_t distance2(const uint8_t *a, const uint8_t *b, int n)
{
    uint32_t sum = 0;

    for (int i = 0; i < n; i++) {
        const int d = a[i] - b[i];

        sum += (uint32_t)(d * d);
    }
    return sum;
}

/* One row that decides, which is final; adds its errors to the tiles from `first` on. */
static void decide_row(const struct skipper *s, struct skip_scratch *w, struct tile *first, int x, int n, int y)
{
    if (s->plan->weighted)
        sum_levels(s, w, x, n, y, true);
    sum_levels(s, w, x, n, y, s->plan->summed);
    for (int c = 0; c < 3; c++)
        memcpy(sst_image_row(s->out, c, y) + x, w->picture[s->exact][c], (size_t)n);
    render_mend_row(s->plan, s->out, w->total[3], x, n, y);
    for (int i = 0; i < n; i += TILE_WIDTH) {
        for (int way = 0; way < WAYS * 3; way++)
            first[i / TILE_WIDTH].error2[way / 3] += distance2(w->picture[way / 3][way % 3] + i,
                                                               sst_image_row(s->out, way % 3, y) + x + i,
                                                               sst_min_int(TILE_WIDTH, n - i));
    }
}

/* Rows of the picture that a tile has. */
static int rows_of(const struct skipper *s, int row)
{
    return sst_min_int(TILE_HEIGHT, s->out->height - row * TILE_HEIGHT);
}

static bool decides(int y)
{
    return y % DECIDE_STEP == DECIDE_ROW;
}

/* Render the rows that decide of a row of tiles. */
static void measure_tiles(const struct skipper *s, struct skip_scratch *w, int row)
{
    struct tile *first = s->tile + row * s->cols;

    memset(first, 0, (size_t)s->cols * sizeof(*first));
    for (int x = 0; x < s->out->width; x += STRETCH) {
        for (int y = 0; y < rows_of(s, row); y++) {
            if (decides(y))
                decide_row(s, w, first + x / TILE_WIDTH, x, sst_min_int(STRETCH, s->out->width - x),
                           row * TILE_HEIGHT + y);
        }
    }
}

/* Choose for the tiles of a row: the least time + error / lambda. @return the sum of the squares of their errors */
static double choose(const struct skipper *s, int row, double lambda)
{
    const int rows = rows_of(s, row), decided = (rows + DECIDE_STEP - 1 - DECIDE_ROW) / DECIDE_STEP;
    double sum = 0;

    for (int col = 0; col < s->cols; col++) {
        const int width = sst_min_int(TILE_WIDTH, s->out->width - col * TILE_WIDTH);
        struct tile *t = &s->tile[row * s->cols + col];
        double least = s->time[s->exact], error = 0;

        t->way = (uint8_t)s->exact;
        for (int way = 0; way < s->exact && decided; way++) {
            const double e = (double)t->error2[way] / (3 * width * decided);

            if (!offered(s->plan, way) || e > TILE_MOST * s->budget2 || s->time[way] + e / lambda >= least)
                continue;
            least = s->time[way] + e / lambda;
            error = e;
            t->way = (uint8_t)way;
        }
        sum += error * width * rows;
    }
    return sum;
}

static int probe_row(const struct skipper *s, int index)
{
    return sst_min_int(PROBE_FIRST, s->rows - 1) + index * PROBE_STEP;
}

static int probe_rows(const struct skipper *s)
{
    return (s->rows - 1 - probe_row(s, 0)) / PROBE_STEP + 1;
}

static int probe(void *arg, int index, int worker)
{
    const struct skipper *s = arg;

    measure_tiles(s, s->scratch[worker], probe_row(s, index));
    return 0;
}

/* The largest lambda with an error within the budget in the probed rows, to a few percent. */
static double find_lambda(const struct skipper *s)
{
    double lo = log2(s->budget2) - 8, hi = log2(s->budget2) + 8;

    for (int i = 0; i < 8; i++) {
        const double middle = (lo + hi) / 2;
        double error = 0, pixels = 0;

        for (int index = 0; index < probe_rows(s); index++) {
            error += choose(s, probe_row(s, index), exp2(middle));
            pixels += (double)s->out->width * rows_of(s, probe_row(s, index));
        }
        *(error > SAFE * s->budget2 * pixels ? &hi : &lo) = middle;
    }
    return exp2(lo);
}

/* True if the rows of tiles that were probed promise a gain. */
static bool pays(const struct skipper *s)
{
    double time = 0;

    for (int i = 0; i < probe_rows(s); i++) {
        choose(s, probe_row(s, i), s->lambda);
        for (int col = 0; col < s->cols; col++)
            time += s->time[s->tile[probe_row(s, i) * s->cols + col].way];
    }
    return time <= WORTH * probe_rows(s) * s->cols;
}

/* --- 2. the picture ----------------------------------------------------------------------------------------------- */

/* Runs of all views in a stretch as chosen, in the order of exact pictures; counts what is left out. */
static int chosen_runs(const struct skipper *s, struct skip_scratch *w, const struct tile *first, int width, int rows)
{
    int n = 0;

    for (int k = 0; k < s->plan->count; k++) {
        const int begun = n;

        for (int from = 0; from < width; from += TILE_WIDTH) {
            const int way = first[from / TILE_WIDTH].way, to = sst_min_int(from + TILE_WIDTH, width);
            const bool plain = !(way & 1), skipped = s->level_of[k] > way / 2;
            const int64_t rays = (int64_t)(to - from) * rows;

            w->counts.rays += rays;
            w->counts.skipped += skipped ? rays : 0;
            w->counts.even += !skipped && plain && s->plan->weighted ? rays : 0;
            if (skipped)
                continue;
            if (n > begun && w->run[n - 1].to == from && w->run[n - 1].plain == plain)
                w->run[n - 1].to = to;
            else
                w->run[n++] = (struct run){ k, from, to, plain };
        }
    }
    return n;
}

/* Compare the row of every CHECK_TILES-th tile with the exact one. */
static void check_row(const struct skipper *s, struct skip_scratch *w, int row, int x, int n, int y)
{
    uint8_t(*to)[STRETCH] = w->picture[s->exact];

    for (int i = 0; i < n; i += TILE_WIDTH) {
        const int width = sst_min_int(TILE_WIDTH, n - i);

        if ((5 * row + (x + i) / TILE_WIDTH) % CHECK_TILES)
            continue;
        clear_sums(w, width);
        for (int k = 0; k < s->plan->count; k++)
            w->run[k] = (struct run){ k, 0, width, s->plan->summed };
        add_runs(s, w, s->plan->count, x + i, y, true);
        finish(w, (uint8_t *const[3]){ to[0], to[1], to[2] }, width);
        w->counts.sampled += width;
        for (int c = 0; c < 3; c++)
            w->counts.error2 += distance2(to[c], sst_image_row(s->out, c, y) + x + i, width);
    }
}

/* What rays support pixels x .. x+n-1 of row y: of all views, until every pixel has one. */
static void mark_row(const struct skipper *s, uint8_t *support, int x, int n, int y)
{
    const struct render_sink sink = { .support = support, .support_only = true };

    memset(support, 0, (size_t)n);
    for (int k = 0; k < s->plan->count && memchr(support, 0, (size_t)n); k++)
        render_add_view(&sink, s->plan, &s->plan->tap[k], x, n, y);
    render_mark_row(s->plan, s->out, s->valid, support, x, n, y);
}

static void render_stretch(const struct skipper *s, struct skip_scratch *w, int x, int n, int row)
{
    const int top = row * TILE_HEIGHT, end = top + rows_of(s, row);
    int rows = 0, runs;

    for (int y = top; y < end; y++)
        rows += !decides(y - top);
    runs = chosen_runs(s, w, s->tile + row * s->cols + x / TILE_WIDTH, n, rows);
    for (int y = top; y < end; y++) {
        if (decides(y - top))
            continue; /* is there */
        clear_sums(w, n);
        add_runs(s, w, runs, x, y, false);
        finish(w, (uint8_t *const[3]){ sst_image_row(s->out, 0, y) + x, sst_image_row(s->out, 1, y) + x,
                                       sst_image_row(s->out, 2, y) + x }, n);
        render_mend_row(s->plan, s->out, w->total[3], x, n, y);
    }
    if (end > top + CHECK_ROW)
        check_row(s, w, row, x, n, top + CHECK_ROW);
    for (int y = top; y < end && (s->valid || s->plan->cfg.unsupported == SST_UNSUPPORTED_INVALID); y++)
        mark_row(s, w->support, x, n, y);
}

static int render_tiles(void *arg, int row, int worker)
{
    const struct skipper *s = arg;
    const int first = probe_row(s, 0);

    if (row < first || (row - first) % PROBE_STEP)
        measure_tiles(s, s->scratch[worker], row);
    choose(s, row, s->lambda);
    for (int x = 0; x < s->out->width; x += STRETCH)
        render_stretch(s, s->scratch[worker], x, sst_min_int(STRETCH, s->out->width - x), row);
    return 0;
}

/* --- memory ------------------------------------------------------------------------------------------------------- */

static void skipper_fini(struct skipper *s)
{
    for (int i = 0; s->scratch && i < s->threads; i++) {
        if (s->scratch[i])
            free(s->scratch[i]->run);
        sst_mem_free(s->scratch[i]);
    }
    free(s->scratch);
    free(s->tile);
}

static int skipper_init(struct skipper *s, const struct sst_render_plan *p)
{
    s->cols = (p->lf->width + TILE_WIDTH - 1) / TILE_WIDTH;
    s->rows = (p->lf->height + TILE_HEIGHT - 1) / TILE_HEIGHT;
    s->budget2 = 255 * 255 * pow(10, -p->cfg.skip_error_db / 10);
    s->exact = way_of(LEVELS - 1, p->summed);
    s->threads = sst_thread_count(p->cfg.threads);
    order_views(s);
    for (int way = 0; way < WAYS; way++)
        s->time[way] = (p->weighted && !(way & 1) ? PLAIN_TIME : 1) * s->level_end[way / 2] / p->count;
    s->tile = malloc((size_t)s->cols * (size_t)s->rows * sizeof(*s->tile));
    s->scratch = calloc((size_t)s->threads, sizeof(*s->scratch));
    if (!s->tile || !s->scratch)
        return -ENOMEM;
    for (int i = 0; i < s->threads; i++) {
        s->scratch[i] = sst_mem_alloc(1, sizeof(**s->scratch));
        if (s->scratch[i])
            s->scratch[i]->run = malloc((size_t)p->count * STRETCH_TILES * sizeof(struct run));
        if (!s->scratch[i] || !s->scratch[i]->run)
            return -ENOMEM;
    }
    return 0;
}

static void count(struct sst_renderer *r, const struct skipper *s, bool skipped)
{
    pthread_mutex_lock(&r->lock);
    r->skips.pictures++;
    r->skips.rays += skipped ? 0 : (int64_t)s->plan->count * s->out->width * s->out->height;
    for (int i = 0; i < s->threads; i++) {
        const struct sst_skip_counts *c = &s->scratch[i]->counts;

        r->skips.rays += c->rays;
        r->skips.skipped += c->skipped;
        r->skips.even += c->even;
        r->skips.sampled += c->sampled;
        r->skips.error2 += c->error2;
    }
    pthread_mutex_unlock(&r->lock);
}

int skip_render(struct sst_renderer *r, const struct sst_render_plan *p, struct sst_image *out,
                struct sst_map_u8 *valid, bool *done)
{
    struct skipper s = { .plan = p, .out = out, .valid = valid };
    int err = skipper_init(&s, p);

    *done = false;
    if (!err && !p->verifier)
        err = sst_parallel_for(probe_rows(&s), s.threads, probe, &s);
    if (!err && !p->verifier)
        s.lambda = find_lambda(&s);
    if (!err && !p->verifier && pays(&s)) {
        err = sst_parallel_for(s.rows, s.threads, render_tiles, &s);
        *done = !err;
    }
    if (!err)
        count(r, &s, *done);
    skipper_fini(&s);
    return err;
}
