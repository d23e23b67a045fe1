/* A row of tiles with skips is made in four steps.
 *
 * 1. S5: the bounds of each tile choose how the rays of each view enter its sums (skip_bounds.c).
 * 2. Of every tile, two of its 32 rows are rendered so from all views; they are final. Their sums pass through those of
 *    nested subsets of the views, a quarter and a half: two cheaper pictures of the same rows.
 * 3. S2: each tile gets the subset with the least cost + error / lambda. lambda is that of the picture with the least
 * time that keeps the budget, estimated from every LAMBDA_STEP-th row of tiles, whose rows are made before all others.
 * 4. The other rows are rendered so, in the order of exact pictures: where nothing is left out they have their bytes,
 * and the rows of step 2 differ by the rounding of sums in another order.
 *
 * If the rows for lambda promise next to no gain, the picture is exact.
 *
 * Every pixel is normalised by the weights of its own rays: where a subset has none, the exact pixel takes its place
 * (render_mend_row()).
 */
#include "pipeline/method/render/render_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/method/render/verify.h"

#define STRETCH_TILES (1024 / SKIP_TILE_WIDTH)
#define STRETCH       (STRETCH_TILES * SKIP_TILE_WIDTH) /* pixels summed together: the sums stay cached */
#define AHEAD         512                               /* pixels of a view that are read before they are needed */
#define LEVELS        3                                 /* subsets of the views: a quarter, half, all */
#define ALL           (LEVELS - 1)
/* Rows of a tile that decide, and the row of every CHECK_TILES-th tile that is compared with the exact one afterwards.
 */
#define DECIDE_ROW  7
#define DECIDE_STEP 16
#define CHECK_ROW   16
#define CHECK_TILES 8
/* The estimate is the error of few rows, and the least of several: the choice may use a part of the budget. */
#define SAFE 0.3
/* Rows of tiles from which lambda is estimated. */
#define LAMBDA_STEP  6
#define LAMBDA_FIRST 2
/* Largest error of one tile, by its rows, in budgets: what is seen is the worst tile, not the mean. */
#define TILE_MOST 3
/* Time of a ray relative to a mean one with its own weight, measured. Rays that are left out for their weight are the
 * cheapest ones: they have no exponential. */
#define COST_NONE  0.5F
#define COST_PLAIN 0.65F
#define COST_EVEN  0.8F
/* If the rows for lambda promise a larger share of the exact time, the picture is exact: decisions would cost as much.
 */
#define WORTH 0.9

_Static_assert(SKIP_TILE_WIDTH % SST_RENDER_CELL_WIDTH == 0 && SKIP_TILE_HEIGHT % SST_RENDER_CELL_HEIGHT == 0,
               "rays are verified by cells");
_Static_assert(STRETCH <= SST_BLEND_MAX, "a stretch is one call of the kernels");

/* Rays of one view in some tiles of a stretch. */
struct run {
    int k;
    int from, to; /* pixels of the stretch */
    enum skip_mode mode;
    float constant;
};

/* Working memory of a thread. */
struct skip_scratch {
    _Alignas(SST_ALIGN) float acc[4][STRETCH + 16]; /* rows begin at different places of a page, as in render.c */
    int32_t sum[3][STRETCH + 16];
    float count[STRETCH + 16];
    float total[4][STRETCH + 16];
    uint8_t picture[LEVELS][3][STRETCH];
    float (*weight)[SST_BLEND_MAX]; /* [SKIP_TILE_HEIGHT], if rays are verified */
    uint8_t support[STRETCH];
    struct skip_tile bound;
    struct sst_skip_counts counts;
    struct run *run; /* [views * STRETCH_TILES] */
};

/* One tile of the picture. */
struct tile {
    uint32_t error2[ALL]; /* of the rows that decide: squares against those of all views */
    float cost[LEVELS];   /* 1: of exact rays of all views */
    float common;
    uint8_t level;
    bool exact; /* some skip has no say */
};

struct skipper {
    const struct sst_render_plan *plan;
    struct sst_image *out;
    struct sst_map_u8 *valid;
    struct skip_weights weights; /* of plans with weights */
    bool bounded;                /* weights: the tiles' modes are those of the bounds */
    double budget2;              /* mean square of the error, grey levels */
    double lambda;               /* of the choice: error that is worth the time of an exact pixel */
    int cols, rows;
    int order[SST_MAX_VIEWS];        /* taps by level */
    int level_end[LEVELS];           /* in order */
    uint8_t level_of[SST_MAX_VIEWS]; /* by tap */
    struct tile *tile;               /* [rows][cols] */
    uint8_t *mode;                   /* [rows][cols][taps] enum skip_mode */
    float *constant;                 /* likewise */
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

/* How a view's exact rays enter the sums. */
static enum skip_mode exact_mode(const struct skipper *s)
{
    return s->plan->summed ? SKIP_PLAIN : SKIP_EXACT;
}

/* Reads ahead of the kernels, AHEAD pixels in the order of the runs: the rows of all views are too many streams for the
 * processor to follow, and short runs leave it no time. */
struct reader {
    const struct run *run;
    int runs, i, x; /* the next pixels: x of run i */
    int y, left;    /* pixels that are read beyond those that the kernels have */
    bool above;     /* the upper rows are not in the cache either */
    struct sst_blend at;
    const struct sst_blend *now;
};

static void read_ahead(struct reader *r, const struct skipper *s, int x, int used)
{
    r->left -= used;
    while (r->left < AHEAD && r->i < r->runs) {
        const struct run *run = &r->run[r->i];

        if (!r->x)
            r->now = render_read_ahead(&r->at, s->plan, &s->plan->tap[run->k], x + run->from, run->to - run->from, r->y,
                                       run->mode == SKIP_EXACT ? 0 : 1);
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

static void add_run(const struct skipper *s, struct skip_scratch *w, const struct run *run, int x, int y)
{
    const struct sst_render_plan *p = s->plan;
    const int at = run->from;
    const struct render_sink sink = { .acc = { w->acc[0] + at, w->acc[1] + at, w->acc[2] + at, w->acc[3] + at },
                                      .sum = { w->sum[0] + at, w->sum[1] + at, w->sum[2] + at },
                                      .count = w->count + at,
                                      .constant = run->constant,
                                      .plain = run->mode == SKIP_PLAIN };

    render_add_view(&sink, p, &p->tap[run->k], x + at, run->to - at, y);
}

/* Add runs 0 .. runs-1 of one row. @param jump  the row above was not rendered just before */
static void add_runs(const struct skipper *s, struct skip_scratch *w, int runs, int x, int y, bool jump)
{
    struct reader r = { .run = w->run, .runs = runs, .y = y, .above = jump };

    for (int i = 0; i < runs; i++) {
        read_ahead(&r, s, x, w->run[i].to - w->run[i].from);
        add_run(s, w, &w->run[i], x, y);
    }
}

/* Colours and weights of the n pixels from the sums; tiles from `first` on. Plain sums count by the tiles' common
 * weight, 1 in exact pictures. */
static void finish(const struct skipper *s, struct skip_scratch *w, uint8_t *const to[3], const struct tile *first,
                   int n)
{
    const bool common = s->bounded;

    for (int x = 0; x < n; x += SKIP_TILE_WIDTH) {
        const float by = common ? first[x / SKIP_TILE_WIDTH].common : 1;
        const int end = sst_min_int(x + SKIP_TILE_WIDTH, n);

        for (int c = 0; c < 3; c++) {
            for (int i = x; i < end; i++)
                w->total[c][i] = w->acc[c][i] + by * (float)w->sum[c][i];
        }
        for (int i = x; i < end; i++)
            w->total[3][i] = w->acc[3][i] + by * w->count[i];
    }
    for (int c = 0; c < 3; c++)
        sst_kernels_get()->blend_finish(to[c], w->total[c], w->total[3], (size_t)n);
}

/* --- 1, 2. rows that decide ------------------------------------------------------------------------------------------
 */

/* Runs of view k in the tiles of a stretch, as the bounds allow. Returns the new number of runs. */
static int bounded_runs(const struct skipper *s, struct run *run, int n, int k, size_t first, int tiles, int width)
{
    const size_t views = (size_t)s->plan->count;
    int begun = n;

    for (int i = 0; i < tiles; i++) {
        const size_t at = (first + (size_t)i) * views + (size_t)k;
        const enum skip_mode mode = (enum skip_mode)s->mode[at];
        const int from = i * SKIP_TILE_WIDTH, to = sst_min_int(from + SKIP_TILE_WIDTH, width);

        if (mode == SKIP_NONE)
            continue;
        if (n > begun && run[n - 1].to == from && run[n - 1].mode == mode && mode != SKIP_EVEN)
            run[n - 1].to = to;
        else
            run[n++] = (struct run){ k, from, to, mode, mode == SKIP_EVEN ? s->constant[at] : 0 };
    }
    return n;
}

/* Pictures of one row with nested subsets of the views. */
static void sum_levels(const struct skipper *s, struct skip_scratch *w, const struct tile *first, int x, int n, int y)
{
    const int tiles = (n + SKIP_TILE_WIDTH - 1) / SKIP_TILE_WIDTH;
    int at = 0;

    clear_sums(w, n);
    for (int level = s->plan->cfg.skip_views ? 0 : ALL; level < LEVELS; level++) {
        uint8_t *const to[3] = { w->picture[level][0], w->picture[level][1], w->picture[level][2] };
        int runs = 0;

        for (; at < s->level_end[level]; at++)
            runs = bounded_runs(s, w->run, runs, s->order[at], (size_t)(first - s->tile), tiles, n);
        add_runs(s, w, runs, x, y, true);
        finish(s, w, to, first, n);
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

/* One row that decides: that of all views is final. */
static void decide_row(const struct skipper *s, struct skip_scratch *w, struct tile *first, int x, int n, int y)
{
    sum_levels(s, w, first, x, n, y);
    for (int c = 0; c < 3; c++)
        memcpy(sst_image_row(s->out, c, y) + x, w->picture[ALL][c], (size_t)n);
    render_mend_row(s->plan, s->out, w->total[3], x, n, y);
    for (int i = 0; i < ALL * n; i += i % n + SKIP_TILE_WIDTH < n ? SKIP_TILE_WIDTH : n - i % n) {
        for (int c = 0; c < 3; c++)
            first[i % n / SKIP_TILE_WIDTH].error2[i / n] +=
                distance2(w->picture[i / n][c] + i % n, sst_image_row(s->out, c, y) + x + i % n,
                          sst_min_int(SKIP_TILE_WIDTH, n - i % n));
    }
}

/* Rows of the picture that a tile has. */
static int rows_of(const struct skipper *s, int row)
{
    return sst_min_int(SKIP_TILE_HEIGHT, s->out->height - row * SKIP_TILE_HEIGHT);
}

/* First row of tiles for lambda; pictures with few rows have it all the same. */
static int lambda_row(const struct skipper *s, int index)
{
    return sst_min_int(LAMBDA_FIRST, s->rows - 1) + index * LAMBDA_STEP;
}

static int lambda_rows(const struct skipper *s)
{
    return (s->rows - 1 - lambda_row(s, 0)) / LAMBDA_STEP + 1;
}

static bool for_lambda(const struct skipper *s, int row)
{
    return row >= lambda_row(s, 0) && (row - lambda_row(s, 0)) % LAMBDA_STEP == 0;
}

/* True if row y of a tile is one that decides. */
static bool decides(const struct skipper *s, int y)
{
    return s->plan->cfg.skip_views && y % DECIDE_STEP == DECIDE_ROW;
}

static int decide_rows(const struct skipper *s, int row)
{
    int n = 0;

    for (int y = 0; y < rows_of(s, row); y++)
        n += decides(s, y);
    return n;
}

static float cost_of(enum skip_mode mode)
{
    return mode == SKIP_NONE ? COST_NONE : mode == SKIP_PLAIN ? COST_PLAIN : mode == SKIP_EVEN ? COST_EVEN : 1;
}

/* Set the modes that the bounds allow in a tile, and the time of each subset. */
static void bound_tile(struct skipper *s, struct skip_scratch *w, int col, int row)
{
    const struct sst_render_plan *p = s->plan;
    const size_t index = (size_t)row * (size_t)s->cols + (size_t)col, views = (size_t)p->count;
    const int x = col * SKIP_TILE_WIDTH, y = row * SKIP_TILE_HEIGHT;
    struct tile *t = &s->tile[index];
    struct skip_tile *b = &w->bound;

    *t = (struct tile){ .common = 1 };
    if (s->weights.bounds) {
        skip_bound_tile(b, &s->weights, p, x, sst_min_int(x + SKIP_TILE_WIDTH, s->out->width), y, y + rows_of(s, row),
                        sqrt(s->budget2));
        t->exact |= b->verified;
    }
    if (s->bounded && !t->exact)
        t->common = b->common;
    for (int k = 0; k < p->count; k++) {
        const enum skip_mode mode = s->bounded && !t->exact ? b->mode[k] : exact_mode(s);

        s->mode[index * views + (size_t)k] = (uint8_t)mode;
        s->constant[index * views + (size_t)k] = mode == SKIP_EVEN ? b->constant[k] : 0;
        for (int level = s->level_of[k]; level < LEVELS; level++)
            t->cost[level] += cost_of(mode) / (float)p->count;
    }
}

static void decide_tiles(struct skipper *s, struct skip_scratch *w, int row)
{
    struct tile *first = s->tile + (size_t)row * (size_t)s->cols;

    for (int col = 0; col < s->cols; col++)
        bound_tile(s, w, col, row);
    for (int x = 0; x < s->out->width; x += STRETCH) {
        for (int y = 0; y < rows_of(s, row); y++) {
            if (decides(s, y))
                decide_row(s, w, first + x / SKIP_TILE_WIDTH, x, sst_min_int(STRETCH, s->out->width - x),
                           row * SKIP_TILE_HEIGHT + y);
        }
    }
}

static int decide_for_lambda(void *arg, int index, int worker)
{
    struct skipper *s = arg;

    decide_tiles(s, s->scratch[worker], lambda_row(s, index));
    return 0;
}

/* --- 3. choice ---------------------------------------------------------------------------------------------------- */

/* Choose for the tiles of a row; returns the sum of the squares of their errors. */
static double choose(struct skipper *s, int row, double lambda)
{
    double sum = 0;

    for (int col = 0; col < s->cols; col++) {
        const int width = sst_min_int(SKIP_TILE_WIDTH, s->out->width - col * SKIP_TILE_WIDTH);
        const int n = 3 * width * decide_rows(s, row);
        struct tile *t = &s->tile[row * s->cols + col];
        double least = (double)t->cost[ALL], error = 0;

        t->level = ALL;
        for (int level = 0; level < ALL && n && !t->exact; level++) {
            const double e = (double)t->error2[level] / n;

            if (e > TILE_MOST * s->budget2 || (double)t->cost[level] + e / lambda >= least)
                continue;
            least = (double)t->cost[level] + e / lambda;
            error = e;
            t->level = (uint8_t)level;
        }
        sum += error * width * rows_of(s, row);
    }
    return sum;
}

/* The largest lambda whose error is within the budget, to a few percent. */
static double find_lambda(struct skipper *s)
{
    const int rows = lambda_rows(s);
    double lo = log2(s->budget2) - 8, hi = log2(s->budget2) + 8;

    for (int i = 0; i < 8; i++) {
        const double middle = (lo + hi) / 2;
        double error = 0, pixels = 0;

        for (int index = 0; index < rows; index++) {
            error += choose(s, lambda_row(s, index), exp2(middle));
            pixels += (double)s->out->width * rows_of(s, lambda_row(s, index));
        }
        if (error > SAFE * s->budget2 * pixels)
            hi = middle;
        else
            lo = middle;
    }
    return exp2(lo);
}

/* Mean cost of the rows for lambda. */
static double promised(struct skipper *s)
{
    double sum = 0;

    for (int index = 0; index < lambda_rows(s); index++) {
        const struct tile *t = s->tile + lambda_row(s, index) * s->cols;

        choose(s, lambda_row(s, index), s->lambda);
        for (int col = 0; col < s->cols; col++)
            sum += (double)t[col].cost[t[col].level];
    }
    return sum / (lambda_rows(s) * s->cols);
}

/* --- 4. the picture ----------------------------------------------------------------------------------------------- */

/* Mode of view k in a tile as chosen. */
static enum skip_mode chosen_mode(const struct skipper *s, size_t index, int k)
{
    return s->level_of[k] > s->tile[index].level ? SKIP_NONE
                                                 : (enum skip_mode)s->mode[index * (size_t)s->plan->count + (size_t)k];
}

/* Runs of all views in a stretch as chosen, in the order of exact pictures; counts what is left out. */
static int chosen_runs(const struct skipper *s, struct skip_scratch *w, size_t first, int tiles, int width, int rows)
{
    int n = 0;

    for (int k = 0; k < s->plan->count; k++) {
        const int begun = n;

        for (int i = 0; i < tiles; i++) {
            const size_t index = first + (size_t)i;
            const int from = i * SKIP_TILE_WIDTH, to = sst_min_int(from + SKIP_TILE_WIDTH, width);
            const enum skip_mode mode = chosen_mode(s, index, k);
            const int64_t rays = (int64_t)(to - from) * rows;

            w->counts.rays += rays;
            w->counts.skipped += mode == SKIP_NONE ? rays : 0;
            w->counts.even += s->plan->weighted && (mode == SKIP_PLAIN || mode == SKIP_EVEN) ? rays : 0;
            if (mode == SKIP_NONE)
                continue;
            if (n > begun && w->run[n - 1].to == from && w->run[n - 1].mode == mode && mode != SKIP_EVEN)
                w->run[n - 1].to = to;
            else
                w->run[n++] =
                    (struct run){ k, from, to, mode,
                                  mode == SKIP_EVEN ? s->constant[index * (size_t)s->plan->count + (size_t)k] : 0 };
        }
    }
    return n;
}

/* Compare the row of every CHECK_TILES-th tile with the exact one. */
static void check_row(const struct skipper *s, struct skip_scratch *w, size_t first, int row, int x, int n, int y)
{
    for (int i = 0; i < n; i += SKIP_TILE_WIDTH) {
        const int col = (x + i) / SKIP_TILE_WIDTH, width = sst_min_int(SKIP_TILE_WIDTH, n - i);
        const struct tile exact = { .common = 1 };

        if ((5 * row + col) % CHECK_TILES)
            continue;
        w->counts.sampled += width;
        if (s->tile[first + (size_t)(i / SKIP_TILE_WIDTH)].exact)
            continue;
        clear_sums(w, width);
        for (int k = 0; k < s->plan->count; k++)
            add_run(s, w, &(struct run){ k, 0, width, exact_mode(s), 0 }, x + i, y);
        finish(s, w, (uint8_t *const[3]){ w->picture[0][0], w->picture[0][1], w->picture[0][2] }, &exact, width);
        for (int c = 0; c < 3; c++)
            w->counts.error2 += distance2(w->picture[0][c], sst_image_row(s->out, c, y) + x + i, width);
    }
}

/* What rays support pixels x .. x+n-1 of row y: of all views, until every pixel has one. */
static void support_row(const struct skipper *s, uint8_t *support, int x, int n, int y)
{
    const struct render_sink sink = { .support = support, .support_only = true };

    memset(support, 0, (size_t)n);
    for (int k = 0; k < s->plan->count && memchr(support, 0, (size_t)n); k++)
        render_add_view(&sink, s->plan, &s->plan->tap[k], x, n, y);
}

/* Verify the rays of exact tiles where that may change them: others are given enough weight. */
static void verify_stretch(const struct skipper *s, struct skip_scratch *w, struct sst_verifier *v, size_t first, int x,
                           int n, int top, int rows)
{
    for (int y = 0; y < rows; y++) {
        for (int i = 0; i < n; i++)
            w->weight[y][i] = s->tile[first + (size_t)(i / SKIP_TILE_WIDTH)].exact ? w->weight[y][i] : INFINITY;
    }
    for (int y = 0; y < rows; y += SST_RENDER_CELL_HEIGHT)
        sst_verify(v, s->plan, w->weight + y, x, x + n, top + y, top + sst_min_int(y + SST_RENDER_CELL_HEIGHT, rows),
                   s->out);
}

static void render_stretch(const struct skipper *s, struct skip_scratch *w, struct sst_verifier *v, int x, int n,
                           int row)
{
    const struct sst_render_plan *p = s->plan;
    const size_t first = (size_t)row * (size_t)s->cols + (size_t)(x / SKIP_TILE_WIDTH);
    const int top = row * SKIP_TILE_HEIGHT, rows = rows_of(s, row);
    const int tiles = (n + SKIP_TILE_WIDTH - 1) / SKIP_TILE_WIDTH;
    const int runs = chosen_runs(s, w, first, tiles, n, v ? rows : rows - decide_rows(s, row));

    for (int y = 0; y < rows; y++) {
        uint8_t *const to[3] = { sst_image_row(s->out, 0, top + y) + x, sst_image_row(s->out, 1, top + y) + x,
                                 sst_image_row(s->out, 2, top + y) + x };

        if (decides(s, y) && !v)
            continue; /* is there */
        clear_sums(w, n);
        add_runs(s, w, runs, x, top + y, false);
        finish(s, w, to, s->tile + first, n);
        render_mend_row(p, s->out, w->total[3], x, n, top + y);
        if (v)
            memcpy(w->weight[y], w->total[3], (size_t)n * sizeof(float));
        if (y == CHECK_ROW)
            check_row(s, w, first, row, x, n, top + y);
    }
    if (v)
        verify_stretch(s, w, v, first, x, n, top, rows);
    for (int y = 0; y < rows && (s->valid || p->cfg.unsupported == SST_UNSUPPORTED_INVALID); y++) {
        support_row(s, w->support, x, n, top + y);
        render_mark_row(p, s->out, s->valid, w->support, x, n, top + y);
    }
}

static int render_tiles(void *arg, int row, int worker)
{
    struct skipper *s = arg;

    if (!for_lambda(s, row))
        decide_tiles(s, s->scratch[worker], row);
    choose(s, row, s->lambda);
    for (int x = 0; x < s->out->width; x += STRETCH)
        render_stretch(s, s->scratch[worker], s->plan->verifier ? s->plan->verifier[worker] : NULL, x,
                       sst_min_int(STRETCH, s->out->width - x), row);
    return 0;
}

/* --- memory ------------------------------------------------------------------------------------------------------- */

static void skipper_fini(struct skipper *s)
{
    for (int i = 0; s->scratch && i < s->threads; i++) {
        if (s->scratch[i]) {
            free(s->scratch[i]->run);
            free(s->scratch[i]->weight);
        }
        sst_mem_free(s->scratch[i]);
    }
    free(s->scratch);
    free(s->tile);
    free(s->mode);
    free(s->constant);
    skip_weights_fini(&s->weights);
}

static int skipper_init(struct skipper *s, struct sst_renderer *r, const struct sst_render_plan *p)
{
    const size_t views = (size_t)p->count;
    size_t tiles;
    int err = 0;

    s->cols = (p->lf->width + SKIP_TILE_WIDTH - 1) / SKIP_TILE_WIDTH;
    s->rows = (p->lf->height + SKIP_TILE_HEIGHT - 1) / SKIP_TILE_HEIGHT;
    s->bounded = p->weighted && p->cfg.skip_tiles;
    s->budget2 = 255 * 255 * pow(10, -p->cfg.skip_error_db / 10);
    s->threads = sst_thread_count(p->cfg.threads);
    tiles = (size_t)s->cols * (size_t)s->rows;
    order_views(s);
    s->tile = calloc(tiles, sizeof(*s->tile));
    s->scratch = calloc((size_t)s->threads, sizeof(*s->scratch));
    if (!s->tile || !s->scratch)
        return -ENOMEM;
    s->mode = malloc(tiles * views);
    s->constant = malloc(tiles * views * sizeof(*s->constant));
    if (s->bounded || p->verifier) {
        const struct skip_bounds *b = skip_bounds_of(r);

        err = b ? sst_renderer_count(r) : -ENOMEM;
        err = err ? err : skip_weights_init(&s->weights, b, p, &r->histogram);
    }
    if (err || !s->mode || !s->constant)
        return -ENOMEM;
    for (int i = 0; i < s->threads; i++) {
        s->scratch[i] = sst_mem_alloc(1, sizeof(**s->scratch));
        if (s->scratch[i])
            s->scratch[i]->run = malloc(views * STRETCH_TILES * sizeof(struct run));
        if (s->scratch[i] && p->verifier)
            s->scratch[i]->weight = malloc(SKIP_TILE_HEIGHT * sizeof(*s->scratch[i]->weight));
        if (!s->scratch[i] || !s->scratch[i]->run || (p->verifier && !s->scratch[i]->weight))
            return -ENOMEM;
    }
    return 0;
}

static void count(struct sst_renderer *r, const struct skipper *s, bool worth)
{
    pthread_mutex_lock(&r->lock);
    r->skips.pictures++;
    r->skips.rays += worth ? 0 : (int64_t)s->plan->count * s->out->width * s->out->height;
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
                struct sst_map_u8 *valid, bool *worth)
{
    struct skipper s = { .plan = p, .out = out, .valid = valid };
    int err = skipper_init(&s, r, p);

    if (!err)
        err = sst_parallel_for(lambda_rows(&s), s.threads, decide_for_lambda, &s);
    if (!err) {
        s.lambda = find_lambda(&s);
        *worth = promised(&s) <= WORTH;
        if (*worth)
            err = sst_parallel_for(s.rows, s.threads, render_tiles, &s);
    }
    if (!err)
        count(r, &s, *worth);
    skipper_fini(&s);
    return err;
}
