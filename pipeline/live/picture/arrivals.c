/* Arrivals in the clear picture: surfaces that have come in front of the ones before, long before any search has enough
 * evidence of a track. Blocks in which most changed pixels are nearer than before begin a region; blocks around them
 * with pixels that came lately, at the same depth, and are seen in this set are part of it, across gaps as of leaves.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/live/picture/picture_internal.h"

#define LEVEL    1 /* of votes: blocks of 8 px */
#define SHIFT    3
#define SEED     24   /* nearer pixels of a block, and most of its changed ones */
#define JOIN     8    /* pixels of a block that is part of a region */
#define GAP_X    2    /* blocks: distance of neighbours, */
#define GAP_Y    3    /* more from head to foot */
#define CAME     256  /* nearer pixels of a region, at least */
#define WIDEST   0.5  /* of the picture: chance agreement of leaves spreads */
#define NEW_MS   3000 /* that a pixel's surface has been there */
#define REST_NS  INT64_C(1000000000)
#define REACH_PX 1.25 /* of disparities about a region's, or ... */
#define REACH    0.1  /* ... this fraction of it */

int picture_arrivals_init(struct picture_arrivals *a, const struct picture_memory *m)
{
    const size_t blocks = (size_t)m->cols[LEVEL] * (size_t)m->rows[LEVEL];

    *a = (struct picture_arrivals){ .stack = malloc(blocks * sizeof(*a->stack)), .marked = malloc(blocks) };
    return a->stack && a->marked ? 0 : -ENOMEM;
}

void picture_arrivals_fini(struct picture_arrivals *a)
{
    free(a->marked);
    free(a->stack);
    *a = (struct picture_arrivals){ 0 };
}

void picture_arrivals_rest(struct picture_arrivals *a, int64_t t_ns)
{
    a->rest_ns = t_ns;
}

/* Where time goes back, as in a recording, nothing is known of the surfaces before. */
static bool is_resting(struct picture_arrivals *a, int64_t t_ns)
{
    if (a->rest_ns && (t_ns < a->rest_ns || t_ns - a->rest_ns >= REST_NS))
        a->rest_ns = 0;
    return a->rest_ns != 0;
}

struct region {
    const struct picture_memory *m;
    uint32_t now_ms;
    int from, to;       /* stored disparities */
    int x0, y0, x1, y1; /* px */
    int came;
};

/* Unmarked block with the most nearer pixels; -1: none. */
static int find_seed(const struct picture_arrivals *a, const struct picture_memory *m)
{
    const struct picture_votes *v = m->level[LEVEL];
    int best = -1;

    for (int i = 0; i < m->cols[LEVEL] * m->rows[LEVEL]; i++)
        if (!a->marked[i] && v[i].came >= SEED && 2 * v[i].came > v[i].changed &&
            (best < 0 || v[i].came > v[best].came))
            best = i;
    return best;
}

/* Extend a region by the pixels of a block that belong to it. @return false: too few do */
static bool join(struct region *r, int at)
{
    const struct picture_memory *m = r->m;
    const int x0 = at % m->cols[LEVEL] << SHIFT, y0 = at / m->cols[LEVEL] << SHIFT;
    const int x1 = sst_min_int(x0 + (1 << SHIFT), m->width), y1 = sst_min_int(y0 + (1 << SHIFT), m->height);
    int n = 0, left = x1, top = y1, right = x0, bottom = y0;

    for (int y = y0; y < y1; y++) {
        const struct picture_pixel *p = m->pixel + (size_t)y * (size_t)m->width;

        for (int x = x0; x < x1; x++) {
            if (p[x].seen_ms != r->now_ms || r->now_ms - p[x].since_ms >= NEW_MS || p[x].disp < r->from ||
                p[x].disp > r->to)
                continue;
            n++;
            left = sst_min_int(left, x);
            right = sst_max_int(right, x + 1);
            top = sst_min_int(top, y);
            bottom = sst_max_int(bottom, y + 1);
        }
    }
    if (n < JOIN)
        return false;
    r->x0 = sst_min_int(r->x0, left);
    r->y0 = sst_min_int(r->y0, top);
    r->x1 = sst_max_int(r->x1, right);
    r->y1 = sst_max_int(r->y1, bottom);
    r->came += m->level[LEVEL][at].came;
    return true;
}

static void grow(struct picture_arrivals *a, struct region *r, int seed)
{
    const struct picture_memory *m = r->m;
    const int cols = m->cols[LEVEL], rows = m->rows[LEVEL];
    int n = 0;

    a->stack[n++] = seed;
    a->marked[seed] = 1;
    join(r, seed);
    while (n) {
        const int at = a->stack[--n], col = at % cols, row = at / cols;

        for (int y = sst_max_int(row - GAP_Y, 0); y <= sst_min_int(row + GAP_Y, rows - 1); y++) {
            for (int x = sst_max_int(col - GAP_X, 0); x <= sst_min_int(col + GAP_X, cols - 1); x++) {
                const int next = y * cols + x;

                if (a->marked[next] || !join(r, next))
                    continue;
                a->marked[next] = 1;
                a->stack[n++] = next;
            }
        }
    }
}

void picture_arrivals_find(struct picture_arrivals *a, const struct picture_memory *m, const struct sst_lightfield *lf)
{
    int seed;

    memset(a->marked, 0, (size_t)m->cols[LEVEL] * (size_t)m->rows[LEVEL]);
    a->count = 0;
    if (is_resting(a, m->last_ns))
        return;
    while (a->count < SST_LIVEPICTURE_ARRIVALS && (seed = find_seed(a, m)) >= 0) {
        const struct picture_votes *v = &m->level[LEVEL][seed];
        const uint16_t disp = (uint16_t)(v->came_disp / v->came);
        const double disp_px = sst_disp_px(lf, disp), reach_px = fmax(REACH_PX, REACH * fabs(disp_px));
        struct region r = { .m = m,
                            .now_ms = (uint32_t)((m->last_ns - m->start_ns) / 1000000),
                            .from = disp - (int)(reach_px * SST_DISP_SCALE),
                            .to = disp + (int)(reach_px * SST_DISP_SCALE),
                            .x0 = m->width,
                            .y0 = m->height };

        grow(a, &r, seed);
        if (r.came >= CAME && r.x1 - r.x0 <= WIDEST * m->width)
            a->at[a->count++] = (struct sst_livepicture_arrival){ { r.x0, r.y0, r.x1, r.y1 }, disp_px };
    }
}
