/* Background level of the integrated scores of a place, for boxes of several sizes on every plane: a twig that often
 * exceeds the model of its cells raises it there. A box above it by many standard deviations is a candidate. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/live/hidden/hidden_internal.h"

#define FOLLOW_S 60.0 /* the usual level follows within this time */
#define FIRST    4    /* sets, of which the level is not known well enough for candidates */
#define FARTHEST                                                                                                       \
    2 /* planes: the farthest surface, of which gaps show parts that were not seen before, and all beyond */
#define WAIT_MOST_S 10.0 /* that one set stands for */
#define CLIP        4.0  /* standard deviations that count at most for it */
#define SPREAD_MIN  3.0
#define LEVEL_MIN   20.0
#define AROUND      2    /* widths on each side that a box is compared with */
#define START       2.0  /* standard deviations of a candidate */
#define LEAVES      0.36 /* part of the excess among the leaves that is subtracted from the excess behind them */

static const struct {
    int cols, rows;
} box_size[HIDDEN_BOXES] = { { 3, 7 }, { 5, 12 }, { 8, 20 }, { 15, 10 } };

int hidden_usual_init(struct hidden_usual *u, int cols, int rows)
{
    const size_t blocks = (size_t)cols * (size_t)rows, all = HIDDEN_BOXES * HIDDEN_PLANES * blocks;

    *u = (struct hidden_usual){ .cols = cols, .rows = rows };
    u->level = sst_mem_alloc(HIDDEN_PLANES * blocks, sizeof(*u->level));
    u->over = sst_mem_alloc(HIDDEN_PLANES * blocks, sizeof(*u->over));
    u->spread = sst_mem_alloc(all, sizeof(*u->spread));
    u->excess = sst_mem_alloc(all, sizeof(*u->excess));
    u->sums = sst_mem_alloc(HIDDEN_PLANES * (size_t)(cols + 1) * (size_t)(rows + 1), sizeof(*u->sums));
    u->best = sst_mem_alloc(blocks, sizeof(*u->best));
    u->best_box = sst_mem_alloc(blocks, 1);
    u->best_plane = sst_mem_alloc(blocks, 1);
    return u->level && u->over && u->spread && u->excess && u->sums && u->best && u->best_box && u->best_plane
               ? 0
               : -ENOMEM;
}

void hidden_usual_fini(struct hidden_usual *u)
{
    sst_mem_free(u->level);
    sst_mem_free(u->over);
    sst_mem_free(u->spread);
    sst_mem_free(u->excess);
    sst_mem_free(u->sums);
    sst_mem_free(u->best);
    sst_mem_free(u->best_box);
    sst_mem_free(u->best_plane);
    *u = (struct hidden_usual){ 0 };
}

void hidden_usual_reset(struct hidden_usual *u)
{
    u->age_s = 0;
    u->t_ns = 0;
    u->sets = 0;
}

void hidden_usual_wait(struct hidden_usual *u, int64_t t_ns)
{
    u->age_s += u->t_ns ? sst_clamp_double((double)(t_ns - u->t_ns) * 1e-9, 0, WAIT_MOST_S) : 0;
    u->t_ns = t_ns;
}

static size_t place(const struct hidden_usual *u, int box, int plane, int y)
{
    return (((size_t)box * HIDDEN_PLANES + (size_t)plane) * (size_t)u->rows + (size_t)y) * (size_t)u->cols;
}

static float *sums_of(const struct hidden_usual *u, int plane)
{
    return u->sums + (size_t)plane * (size_t)(u->cols + 1) * (size_t)(u->rows + 1);
}

static void sum_up(const struct hidden_usual *u, int plane)
{
    const float *over = u->over + (size_t)plane * (size_t)u->cols * (size_t)u->rows;
    float *sums = sums_of(u, plane);
    const int w = u->cols + 1;

    memset(sums, 0, (size_t)w * sizeof(*sums));
    for (int y = 0; y < u->rows; y++) {
        float row = 0;

        sums[(y + 1) * w] = 0;
        for (int x = 0; x < u->cols; x++) {
            row += over[y * u->cols + x];
            sums[(y + 1) * w + x + 1] = sums[y * w + x + 1] + row;
        }
    }
}

/* A box moved along a row, with its surroundings: rows of sums above and below both. */
struct row {
    const float *top, *end, *around_top, *around_end;
    int width, height, around; /* blocks; rows of its surroundings */
};

/* Excess of a box over its surroundings, blocks x0..x1-1. */
static inline float excess_at(const struct row *r, int x, int x0, int x1)
{
    const float area = (float)(r->width * r->height);
    const float in = r->end[x + r->width] - r->end[x] - r->top[x + r->width] + r->top[x];
    const float all = r->around_end[x1] - r->around_end[x0] - r->around_top[x1] + r->around_top[x0];
    const float around = (all - in) / ((float)((x1 - x0) * r->around) - area);

    return in / area - (around > 0 ? around : 0);
}

/* Excess of all places of a row; in the middle of it nothing around a box is cut off. */
static void measure_row(const struct row *r, int cols, float *restrict excess)
{
    const int beside = AROUND * r->width, last = cols - r->width, middle = last - beside;
    int x = 0;

    for (; x <= last && x < beside; x++)
        excess[x] = excess_at(r, x, 0, sst_min_int(x + r->width + beside, cols));
    for (; x <= middle; x++)
        excess[x] = excess_at(r, x, x - beside, x + r->width + beside);
    for (; x <= last; x++)
        excess[x] = excess_at(r, x, x - beside, cols);
}

static inline void follow_spread(float *spread, float over, float rate)
{
    const float most = (float)(CLIP * CLIP) * (*spread + (float)(SPREAD_MIN * SPREAD_MIN));

    *spread += rate * ((over * over > most ? most : over * over) - *spread);
}

struct job {
    struct hidden_usual *u;
    const struct hidden_planes *p;
    const struct hidden_kept *kept;
    float rate;
};

/* Excess of all places of a box on a plane over the background level, less that of the surroundings: gusts raise both.
 */
static void follow_box(const struct job *j, int box, int plane)
{
    const struct hidden_usual *u = j->u;
    const int keeps = j->kept->keeps;
    const int bw = box_size[box].cols, bh = box_size[box].rows, w = u->cols + 1;
    const float *sums = sums_of(u, plane);

    for (int y = 0; y + bh <= u->rows; y++) {
        const int y0 = sst_max_int(y - bh / 4, 0), y1 = sst_min_int(y + bh + bh / 4, u->rows);
        const struct row r = { sums + y * w, sums + (y + bh) * w, sums + y0 * w, sums + y1 * w, bw, bh, y1 - y0 };
        float *excess = u->excess + place(u, box, plane, y), *spread = u->spread + place(u, box, plane, y);

        measure_row(&r, u->cols, excess);
        for (int x = 0; x + bw <= u->cols && !keeps; x++)
            follow_spread(&spread[x], excess[x], j->rate);
        for (int x = 0; x + bw <= u->cols && keeps; x++) {
            const struct sst_rect at = { x, y, x + bw, y + bh };

            if (!hidden_overlaps(&at, j->kept->keep, keeps))
                follow_spread(&spread[x], excess[x], j->rate);
        }
    }
}

/* Excess of the blocks of a plane over their background level, which follows. */
static void follow_level(const struct job *j, int plane)
{
    const struct hidden_usual *u = j->u;
    const float *mean = j->p->mean + (size_t)plane * (size_t)u->cols * (size_t)u->rows;
    const int keeps = j->kept->keeps;

    for (int y = 0; y < u->rows; y++) {
        float *level = u->level + ((size_t)plane * (size_t)u->rows + (size_t)y) * (size_t)u->cols;
        float *over = u->over + ((size_t)plane * (size_t)u->rows + (size_t)y) * (size_t)u->cols;
        const float *now = mean + (size_t)y * (size_t)u->cols;

        for (int x = 0; x < u->cols; x++) {
            const struct sst_rect r = { x, y, x + 1, y + 1 };
            const float most = 2 * level[x] + (float)LEVEL_MIN;

            over[x] = now[x] - level[x];
            if (!keeps || !hidden_overlaps(&r, j->kept->keep, keeps))
                level[x] += j->rate * (over[x] > most ? most : over[x]);
        }
    }
}

static int follow_plane(void *arg, int plane, int worker SST_UNUSED)
{
    const struct job *j = arg;

    follow_level(j, plane);
    sum_up(j->u, plane);
    for (int box = 0; box < HIDDEN_BOXES; box++)
        follow_box(j, box, plane);
    return 0;
}

/* A place counts, by its excess, if the excess is largest behind the leaves; the farthest surface does not count. */
static void judge_box(const struct hidden_usual *u, const struct hidden_planes *p, int box, int y)
{
    const int bw = box_size[box].cols, bh = box_size[box].rows;

    for (int x = 0; x + bw <= u->cols; x++) {
        const size_t middle = (size_t)(y + bh / 2) * (size_t)u->cols + (size_t)(x + bw / 2);
        float behind = 0, leaves = 0, z;
        const struct sst_rect r = { x, y, x + bw, y + bh };
        int plane = 0;

        for (int i = 0; i < p->count; i++) {
            const float e = u->excess[place(u, box, i, y) + (size_t)x];

            /* A value no larger than both changes neither. */
            if (!(e > behind) && !(e > leaves))
                continue;
            if ((i < FARTHEST && p->count > 1) || !hidden_planes_is_behind(p, i, &r)) {
                leaves = e > leaves ? e : leaves;
            } else if (e > behind) {
                behind = e;
                plane = i;
            }
        }
        if (!(behind > leaves))
            continue;
        z = (behind - (float)LEAVES * leaves) /
            sqrtf(u->spread[place(u, box, plane, y) + (size_t)x] + (float)(SPREAD_MIN * SPREAD_MIN));
        if (z > u->best[middle]) {
            u->best[middle] = z;
            u->best_box[middle] = (uint8_t)box;
            u->best_plane[middle] = (uint8_t)plane;
        }
    }
}

/* All boxes with their middle in a row of blocks. */
static int judge_row(void *arg, int row, int worker SST_UNUSED)
{
    const struct job *j = arg;

    memset(j->u->best + (size_t)row * (size_t)j->u->cols, 0, (size_t)j->u->cols * sizeof(*j->u->best));
    for (int box = 0; box < HIDDEN_BOXES; box++) {
        const int bh = box_size[box].rows, y = row - bh / 2;

        if (y >= 0 && y + bh <= j->u->rows)
            judge_box(j->u, j->p, box, y);
    }
    return 0;
}

/* Best remaining place, which is then cleared with all that overlap it. @return false: none */
static bool next_best(struct hidden_usual *u, struct hidden_candidate *c)
{
    const int blocks = u->cols * u->rows;
    int at = 0, bw, bh;

    for (int i = 1; i < blocks; i++)
        at = u->best[i] > u->best[at] ? i : at;
    if (u->best[at] < (float)START)
        return false;
    bw = box_size[u->best_box[at]].cols;
    bh = box_size[u->best_box[at]].rows;
    *c = (struct hidden_candidate){ .box = u->best_box[at], .plane = u->best_plane[at], .z = u->best[at] };
    c->at.x0 = at % u->cols - bw / 2;
    c->at.y0 = at / u->cols - bh / 2;
    c->at.x1 = c->at.x0 + bw;
    c->at.y1 = c->at.y0 + bh;
    for (int y = sst_max_int(c->at.y0 - bh / 2, 0); y < sst_min_int(c->at.y1 + bh / 2, u->rows); y++)
        for (int x = sst_max_int(c->at.x0 - bw / 2, 0); x < sst_min_int(c->at.x1 + bw / 2, u->cols); x++)
            u->best[y * u->cols + x] = 0;
    return true;
}

int hidden_usual_follow(struct hidden_usual *u, const struct hidden_planes *p, const struct hidden_kept *kept,
                        int threads, struct hidden_candidate out[SST_HIDDEN_THINGS])
{
    const int64_t t_ns = kept->t_ns;
    const double dt_s = u->t_ns ? sst_clamp_double((double)(t_ns - u->t_ns) * 1e-9, 0, WAIT_MOST_S) : 0;
    struct job j = { u, p, kept, 1 };
    int n = 0;

    u->age_s += dt_s;
    if (u->t_ns) /* the start counts little */
        j.rate = (float)fmin(dt_s / fmin(u->age_s / 2, FOLLOW_S), 1);
    u->t_ns = t_ns;
    if (j.rate >= 1) {
        memset(u->level, 0, HIDDEN_PLANES * (size_t)u->cols * (size_t)u->rows * sizeof(*u->level));
        memset(u->spread, 0, HIDDEN_BOXES * HIDDEN_PLANES * (size_t)u->cols * (size_t)u->rows * sizeof(*u->spread));
    }
    if (sst_parallel_for(p->count, threads, follow_plane, &j) || sst_parallel_for(u->rows, threads, judge_row, &j))
        return 0; /* neither fails */
    u->sets = sst_min_int(u->sets + 1, FIRST + 1);
    while (u->sets > FIRST && n < SST_HIDDEN_THINGS && next_best(u, &out[n]))
        n++;
    return n;
}
