/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/method/disparity/stage.h"

/*
 * Costs are computed in strips of columns. With the census alone a row is compared with all neighbours at once, whose
 * part stays in the first-level cache from step to step; else BAND rows, one neighbour after the other, whose part (one
 * row per step for those above and below) then stays in the second-level cache for all rows of the band.
 */
#define BAND  16
#define STRIP 128 /* multiple of 64 */

#define FINE_RANGE_PX 24 /* steps are quarter pixels up to this range, half pixels up to twice this range */
#define FINE_PIXELS   ((size_t)1200000) /* a view is matched in quarter-pixel phases up to this many */

int sst_disparity_divisor(int range)
{
    /* Short ranges allow finer steps, and need them: the depth of such scenes spans few pixels. */
    return range <= FINE_RANGE_PX ? 4 : range <= 2 * FINE_RANGE_PX ? 2 : 1;
}

int sst_disparity_phase_step(const struct sst_disparity_config *cfg, int width, int height)
{
    /* Half pixels if the views are so large that 16 phases would need too much memory. */
    return cfg->phase_step ? cfg->phase_step : (size_t)width * (size_t)height > FINE_PIXELS ? 2 : 1;
}

static size_t padded_steps(int steps)
{
    return ((size_t)steps + 31) / 32 * 32;
}

size_t sst_volume_bytes(int width, int height, int steps)
{
    const size_t cells = ((size_t)width + 63) / 64 * 64 * (size_t)height * padded_steps(steps);

    return 3 * cells;
}

/* Where a strip lies in a neighbour at a step. */
struct reach {
    const uint64_t *census; /* of the phase */
    ptrdiff_t at;           /* of the strip's first column in row 0 */
    int top, end;           /* rows in which all of the strip lies inside; none: top == end */
    bool part;              /* only a part of it does */
};

/* Two costs of a tile, feature costs of a row of it, one row of census costs; then positions, steps and reaches. */
static size_t tile_bytes(const struct sst_volume *v)
{
    return STRIP * ((2 * BAND + 1) * v->steps_padded + 1);
}

static size_t scratch_bytes(const struct sst_volume *v)
{
    return tile_bytes(v) +
           v->steps_padded *
               (sizeof(const uint8_t *) + SST_MAX_NEIGHBOURS * (sizeof(struct sst_volume_step) + sizeof(struct reach)));
}

int sst_volume_init(struct sst_volume *v, int width, int height, int disp_min, int steps)
{
    struct sst_volume made = {
        .width = width, .height = height, .disp_min = disp_min, .steps = steps, .divisor = 1, .phase_step = 4
    };
    size_t cells;

    made.width_padded = ((size_t)width + 63) / 64 * 64;
    made.steps_padded = padded_steps(steps);
    made.pixels = made.width_padded * (size_t)height;
    cells = made.pixels * made.steps_padded;
    made.cost = sst_mem_alloc_raw(cells, 1);
    made.sum = sst_mem_alloc_raw(cells, sizeof(uint16_t));
    made.scratch = sst_mem_alloc_raw(1, scratch_bytes(&made));
    /* Allocate what sst_disparity_sgm() needs on 4 paths, so that nothing is allocated later. */
    if (!made.cost || !made.sum || !made.scratch ||
        !sst_mem_keep(&made.lines, (2 + SST_SGM_ROWS) * sst_sgm_line(&made) + (size_t)width * SST_SGM_ROWS,
                      sizeof(uint16_t))) {
        sst_volume_fini(&made);
        return -ENOMEM;
    }
    *v = made;
    return 0;
}

int sst_volume_share(struct sst_volume *out, const struct sst_volume *of)
{
    struct sst_volume made = *of;

    made.borrowed = true;
    made.lines = (struct sst_mem_kept){ 0 };
    made.scratch = sst_mem_alloc_raw(1, scratch_bytes(&made));
    if (!made.scratch)
        return -ENOMEM;
    *out = made;
    return 0;
}

void sst_volume_window(struct sst_volume *v, int x0, int y0, int width, int height)
{
    v->x0 = x0;
    v->y0 = y0;
    v->width = width;
    v->height = height;
    v->width_padded = ((size_t)width + 63) / 64 * 64;
    assert(v->width_padded * (size_t)height <= v->pixels);
}

void sst_volume_fini(struct sst_volume *v)
{
    if (!v->borrowed) {
        sst_mem_free(v->cost);
        sst_mem_free(v->sum);
    }
    sst_mem_free(v->scratch);
    sst_mem_kept_fini(&v->lines);
    *v = (struct sst_volume){ 0 };
}

/* Displacement by disparity step i into a neighbour at offset b along one axis, in quarter pixels. */
static int shift_q2(const struct sst_volume *v, int i, double b)
{
    const double d = v->disp_min + (double)i / v->divisor;

    return v->phase_step * (int)floor(-d * b * 4.0 / v->phase_step + 0.5);
}

/* Whole pixels, rounded down, and the quarters left over. */
static int whole(int q2)
{
    return (q2 - (q2 & 3)) / 4;
}

unsigned sst_volume_phases(const struct sst_volume *v, double bx, double by)
{
    unsigned phases = 0;

    for (int i = 0; i < v->steps; i++)
        phases |= 1u << (4 * (shift_q2(v, i, by) & 3) + (shift_q2(v, i, bx) & 3));
    return phases;
}

void sst_volume_steps(struct sst_volume_step *steps, const struct sst_volume *v, double bx, double by)
{
    for (int i = 0; i < v->steps; i++) {
        const int qx = shift_q2(v, i, bx), qy = shift_q2(v, i, by);
        struct sst_volume_step *s = &steps[i];

        *s = (struct sst_volume_step){ .x = whole(qx),
                                       .y = whole(qy),
                                       .phase = 4 * (qy & 3) + (qx & 3),
                                       .near_x = whole(qx + 2),
                                       .near_y = whole(qy + 2) };
        if (i > 0)
            s->place = s[-1].place + (s->near_x != s[-1].near_x || s->near_y != s[-1].near_y);
    }
}

static const uint8_t *features_at(const struct sst_descriptor *d, int x, int y)
{
    return d->features + (ptrdiff_t)y * SST_FEATURE_CHANNELS / 4 * (ptrdiff_t)d->feature_stride + 4 * (ptrdiff_t)x;
}

/* A strip of one view's columns. */
struct strip {
    const struct sst_volume *v;
    const struct sst_descriptor *ref;
    const struct sst_neighbour *neighbours; /* [count] */
    const struct sst_volume_step *steps;    /* [count][v->steps] */
    int count;
    int x0, x1;
    size_t padded;              /* x1 - x0, rounded up to 64 */
    uint8_t *first, *second;    /* [BAND][steps][padded] cheapest costs so far */
    uint8_t *features, *census; /* [place][STRIP], [STRIP]: costs of one row */
    const uint8_t **places;
    struct reach *reach; /* [step][SST_MAX_NEIGHBOURS]; NULL: neighbours are matched one by one */
};

/* The two cheapest costs so far, at a step [padded] each. */
struct cheapest {
    uint8_t *first, *second;
};

static const struct sst_volume_step *steps_to(const struct strip *s, int neighbour)
{
    return s->steps + (size_t)neighbour * (size_t)s->v->steps;
}

/* Costs of row y against every place of a neighbour's features. */
static void feature_costs(const struct strip *s, const struct sst_neighbour *n, const struct sst_volume_step *steps,
                          int y)
{
    const struct sst_volume *v = s->v;
    const int left = v->x0 + s->x0;
    const uint8_t *here = features_at(s->ref, left, y);
    int count = 0;

    for (int i = 0; i < v->steps; i++) {
        const struct sst_volume_step *at = &steps[i];
        /* What lies beside the row within its width may be read (see struct sst_descriptor); farther columns and other
         * rows are not used by any step: any features do. */
        const bool inside = y + at->near_y >= 0 && y + at->near_y < s->ref->height && abs(at->near_x) < s->ref->width;

        if (at->place == count)
            s->places[count++] = inside ? features_at(n->desc, left + at->near_x, y + at->near_y) : here;
    }
    sst_kernels_get()->feature_cost_rows(s->features, STRIP, here, s->places, (size_t)count, s->ref->feature_stride,
                                         s->padded);
}

/* Columns of the strip that lie inside at a step, x0 .. x1 - 1. */
struct columns {
    int x0, x1;
};

static struct columns columns_at(const struct strip *s, const struct sst_volume_step *at)
{
    return (struct columns){
        sst_max_int(s->x0, -s->v->x0 - sst_min_int(at->x, at->near_x)),
        sst_min_int(s->x1, s->ref->width - s->v->x0 - sst_max_int(at->x, at->near_x)),
    };
}

/* Costs of one row and step, of the census, the features or both: columns from .. to - 1 of those that lie inside.
 * @param at  costs of the first of these columns */
static void merge_costs(const struct strip *s, struct cheapest at, const uint8_t *features, int from, int to)
{
    const uint8_t *census = s->census + from, *cost = features + from;

    sst_kernels_get()->cheapest_row(at.first + from, at.second + from, s->ref->census[0] ? census : cost,
                                    s->ref->features ? cost : census, (size_t)(to - from));
}

/* The same, only where the pixel and its match are valid: black borders match each other only. Windows that reach into
 * them are still useful (docs/design/rectification.md). */
static void merge_valid(const struct strip *s, const struct sst_neighbour *n, const struct sst_volume_step *at, int y,
                        struct cheapest to)
{
    const struct columns c = columns_at(s, at);
    const int left = s->v->x0;
    const uint8_t *own = s->ref->seen.data ? sst_map_u8_row(&s->ref->seen, y) + left : NULL;
    const uint8_t *there = n->desc->seen.data ? sst_map_u8_row(&n->desc->seen, y + at->y) + left : NULL;
    const uint8_t *features = s->features + (size_t)at->place * STRIP + (c.x0 - s->x0);

    for (int from = c.x0, end; from < c.x1; from = end + 1) {
        for (end = from; end < c.x1 && (!own || own[end]) && (!there || there[end + at->x]); end++)
            ;
        if (end > from)
            merge_costs(s, to, features, from - c.x0, end - c.x0);
    }
}

/* Merge the costs of row y at a step against one neighbour into the two cheapest costs. Columns are the volume's, which
 * begins at column v->x0 of the view. */
static void match_step(const struct strip *s, const struct sst_neighbour *n, const struct sst_volume_step *at, int y,
                       struct cheapest to)
{
    const struct sst_volume *v = s->v;
    const struct sst_descriptor *ref = s->ref;
    const struct columns c = columns_at(s, at);
    const int yn = y + at->y, near_y = y + at->near_y;
    const uint8_t *features = s->features + (size_t)at->place * STRIP + (c.x0 - s->x0);

    if (yn < 0 || near_y < 0 || yn >= ref->height || near_y >= ref->height || c.x1 <= c.x0)
        return;
    if (ref->census[0])
        sst_kernels_get()->hamming_row(s->census, ref->census[0] + (size_t)y * ref->census_stride + (v->x0 + c.x0),
                                       n->desc->census[at->phase] + (size_t)yn * ref->census_stride +
                                           (v->x0 + c.x0 + at->x),
                                       (size_t)(c.x1 - c.x0));
    to.first += c.x0 - s->x0;
    to.second += c.x0 - s->x0;
    if (ref->seen.data || n->desc->seen.data)
        merge_valid(s, n, at, y, to);
    else
        merge_costs(s, to, features, 0, c.x1 - c.x0);
}

/* The same against neighbour j at all steps, [steps][padded]. */
static void match_row(const struct strip *s, int j, int y, struct cheapest to)
{
    const struct sst_volume_step *steps = steps_to(s, j);

    if (s->ref->features)
        feature_costs(s, &s->neighbours[j], steps, y);
    for (int i = 0; i < s->v->steps; i++, to.first += s->padded, to.second += s->padded)
        match_step(s, &s->neighbours[j], &steps[i], y, to);
}

/* Costs of the census alone, without masks, are compared for all neighbours at once. */
static bool census_alone(const struct strip *s)
{
    bool yes = s->ref->census[0] && !s->ref->features && !s->ref->seen.data;

    for (int j = 0; j < s->count; j++)
        yes &= !s->neighbours[j].desc->seen.data;
    return yes;
}

static void find_reach(const struct strip *s)
{
    for (int j = 0; j < s->count; j++) {
        for (int i = 0; i < s->v->steps; i++) {
            const struct sst_volume_step *at = &steps_to(s, j)[i];
            const struct columns c = columns_at(s, at);
            const bool all = c.x0 == s->x0 && c.x1 == s->x1;
            struct reach *r = &s->reach[i * SST_MAX_NEIGHBOURS + j];

            r->census = s->neighbours[j].desc->census[at->phase];
            r->at = (ptrdiff_t)at->y * (ptrdiff_t)s->ref->census_stride + (s->v->x0 + s->x0 + at->x);
            r->top = all ? sst_max_int(0, -sst_min_int(at->y, at->near_y)) : 0;
            r->end = all ? s->ref->height - sst_max_int(0, sst_max_int(at->y, at->near_y)) : 0;
            r->part = !all && c.x1 > c.x0;
        }
    }
}

/* The two cheapest costs of row y, [steps][padded] each. */
static void match_all(const struct strip *s, int y)
{
    struct cheapest to = { s->first, s->second };
    const size_t row = (size_t)y * s->ref->census_stride, width = (size_t)(s->x1 - s->x0), rest = s->padded - width;
    const uint64_t *own = s->ref->census[0] + row + (s->v->x0 + s->x0);

    for (int i = 0; i < s->v->steps; i++, to.first += s->padded, to.second += s->padded) {
        const struct reach *r = s->reach + (size_t)i * SST_MAX_NEIGHBOURS;
        const uint64_t *there[SST_MAX_NEIGHBOURS];
        bool part = false;
        int n = 0;

        for (int j = 0; j < s->count; j++) {
            if (y >= r[j].top && y < r[j].end)
                there[n++] = r[j].census + ((ptrdiff_t)row + r[j].at);
            part |= r[j].part;
        }
        sst_kernels_get()->cheapest_hamming_row(to.first, to.second, own, there, n, width);
        memset(to.first + width, SST_COST_ABSENT, rest);
        memset(to.second + width, SST_COST_ABSENT, rest);
        for (int j = 0; j < s->count && part; j++) {
            if (r[j].part)
                match_step(s, &s->neighbours[j], &steps_to(s, j)[i], y, to);
        }
    }
}

/* Of a single neighbour's census alone, without masks, the costs need no merging. */
static bool alone(const struct strip *s)
{
    return s->count == 1 && census_alone(s);
}

/* match_row() for that. */
static void match_alone(const struct strip *s, int y, uint8_t *out)
{
    const struct sst_volume *v = s->v;
    const struct sst_descriptor *ref = s->ref;

    memset(out, SST_COST_UNSEEN, s->padded * (size_t)v->steps);
    for (int i = 0; i < v->steps; i++, out += s->padded) {
        const struct sst_volume_step *at = &s->steps[i];
        const int yn = y + at->y, near_y = y + at->near_y;
        const int x0 = sst_max_int(s->x0, -v->x0 - sst_min_int(at->x, at->near_x));
        const int x1 = sst_min_int(s->x1, ref->width - v->x0 - sst_max_int(at->x, at->near_x));

        if (yn >= 0 && near_y >= 0 && yn < ref->height && near_y < ref->height && x1 > x0)
            sst_kernels_get()->hamming_row(
                out + (x0 - s->x0), ref->census[0] + (size_t)y * ref->census_stride + (v->x0 + x0),
                s->neighbours->desc->census[at->phase] + (size_t)yn * ref->census_stride + (v->x0 + x0 + at->x),
                (size_t)(x1 - x0));
    }
}

/* One cost from the two cheapest ones of row y, into the volume. */
static void store_row(const struct strip *s, uint8_t *first, const uint8_t *second, int y)
{
    const struct sst_volume *v = s->v;
    const size_t cells = s->padded * v->steps_padded, real = s->padded * (size_t)v->steps;
    uint8_t *out = v->cost + ((size_t)y * v->width_padded + (size_t)s->x0) * v->steps_padded;

    if (second)
        sst_kernels_get()->cheapest_mean_row(first, second, s->count == 2, real);
    memset(first + real, SST_COST_MAX, cells - real);
    sst_kernels_get()->transpose_u8(out, v->steps_padded, first, s->padded, s->padded, v->steps_padded);
}

/* Rows y0 .. y1-1 of a strip, one neighbour after the other. */
static void fill_tile(const struct strip *s, int y0, int y1)
{
    const size_t cells = s->padded * s->v->steps_padded;

    memset(s->first, SST_COST_ABSENT, (size_t)(y1 - y0) * cells);
    memset(s->second, SST_COST_ABSENT, (size_t)(y1 - y0) * cells);
    for (int j = 0; j < s->count; j++) {
        for (int y = y0; y < y1; y++) {
            const size_t at = (size_t)(y - y0) * cells;

            match_row(s, j, s->v->y0 + y, (struct cheapest){ s->first + at, s->second + at });
        }
    }
    for (int y = y0; y < y1; y++)
        store_row(s, s->first + (size_t)(y - y0) * cells, s->second + (size_t)(y - y0) * cells, y);
}

static void fill_strip(const struct strip *s)
{
    const struct sst_volume *v = s->v;
    const bool single = alone(s);

    if (s->reach)
        find_reach(s);
    for (int y = 0; y < v->height && (single || s->reach); y++) {
        if (single)
            match_alone(s, v->y0 + y, s->first);
        else
            match_all(s, v->y0 + y);
        store_row(s, s->first, single ? NULL : s->second, y);
    }
    for (int y = 0; y < v->height && !single && !s->reach; y += BAND)
        fill_tile(s, y, sst_min_int(y + BAND, v->height));
}

/* Are the steps pixel by pixel to the left, all within the neighbour's rows? What is half a pixel or more below or to
 * the right is nearer to other pixels, of which some lie outside. */
static bool steps_left(const struct sst_volume *v, const struct sst_descriptor *ref,
                       const struct sst_volume_step *steps)
{
    const int first = v->x0 + steps[0].x, padding = (int)v->steps_padded - 1;

    for (int i = 0; i < v->steps; i++) {
        if (steps[i].x != steps[0].x - i || steps[i].y != 0 || steps[i].phase != steps[0].phase ||
            steps[i].near_x != steps[i].x || steps[i].near_y != 0)
            return false;
    }
    return first - padding >= 0 && first + v->width <= ref->width;
}

bool sst_volume_fill_left(const struct sst_volume *v, const struct sst_descriptor *ref, const struct sst_neighbour *n,
                          uint8_t *cost, size_t row)
{
    const struct strip whole = { .v = v, .ref = ref, .neighbours = n, .count = 1 };
    const size_t steps = (size_t)v->steps, padded = v->steps_padded;
    struct sst_volume_step *step = (struct sst_volume_step *)v->scratch;

    if (!alone(&whole))
        return false;
    sst_volume_steps(step, v, n->bx, n->by);
    if (!steps_left(v, ref, step))
        return false;
    for (int y = 0; y < v->height; y++) {
        const size_t at = (size_t)(v->y0 + y) * ref->census_stride + (size_t)v->x0;
        uint8_t *out = cost + (size_t)y * row * padded;

        sst_kernels_get()->hamming_steps_row(out, ref->census[0] + at, n->desc->census[step->phase] + at + step->x,
                                             (size_t)v->width, padded);
        for (size_t x = 0; steps < padded && x < (size_t)v->width; x++)
            memset(out + x * padded + steps, SST_COST_MAX, padded - steps);
        memset(out + (size_t)v->width * padded, SST_COST_MAX, (row - (size_t)v->width) * padded);
    }
    return true;
}

void sst_volume_fill(struct sst_volume *v, const struct sst_descriptor *ref, const struct sst_neighbour *neighbours,
                     int count)
{
    const size_t tile = STRIP * BAND * v->steps_padded;
    struct strip s = { .v = v, .ref = ref, .neighbours = neighbours, .count = count, .first = v->scratch };
    struct sst_volume_step *steps;

    if (count == 1 && sst_volume_fill_left(v, ref, neighbours, v->cost, v->width_padded))
        return;
    s.second = s.first + tile;
    s.features = s.second + tile;
    s.census = s.features + STRIP * v->steps_padded;
    s.places = (const uint8_t **)(void *)(s.first + tile_bytes(v));
    s.reach = (struct reach *)(void *)(s.places + v->steps_padded);
    steps = (struct sst_volume_step *)(void *)(s.reach + SST_MAX_NEIGHBOURS * v->steps_padded);
    s.steps = steps;
    if (!census_alone(&s))
        s.reach = NULL;
    for (int i = 0; i < count; i++)
        sst_volume_steps(steps + (size_t)i * (size_t)v->steps, v, neighbours[i].bx, neighbours[i].by);
    for (s.x0 = 0; s.x0 < v->width; s.x0 += STRIP) {
        s.x1 = sst_min_int(s.x0 + STRIP, v->width);
        s.padded = ((size_t)(s.x1 - s.x0) + 63) / 64 * 64;
        fill_strip(&s);
    }
}

void sst_volume_requantise(struct sst_volume *v)
{
    const size_t pixels = v->width_padded * (size_t)v->height, nd = v->steps_padded;

    for (size_t p = 0; p < pixels; p++) {
        const uint16_t *s = v->sum + p * nd;
        uint8_t *c = v->cost + p * nd;
        uint16_t lowest = 65535;

        for (size_t d = 0; d < nd; d++)
            lowest = s[d] < lowest ? s[d] : lowest;
        for (size_t d = 0; d < nd; d++) {
            const uint16_t above = (uint16_t)(s[d] - lowest);

            c[d] = (uint8_t)(above < SST_COST_MAX ? above : SST_COST_MAX);
        }
    }
}

int sst_volume_winner(struct sst_volume *v, bool from_cost, struct sst_map_u16 *disp_q6, struct sst_map_u8 *confidence)
{
    const struct sst_kernels *k = sst_kernels_get();
    const size_t n = (size_t)v->width, nd = v->steps_padded, row_cells = v->width_padded * nd;
    uint16_t *wide = sst_mem_keep(&v->lines, (from_cost ? row_cells : 0) + 2 * n, sizeof(uint16_t)), *best, *second;

    if (!wide)
        return -ENOMEM;
    best = wide + (from_cost ? row_cells : 0); /* row_cells is a multiple of the alignment */
    second = best + n;
    for (int y = 0; y < v->height; y++) {
        const uint16_t *sum = from_cost ? wide : v->sum + (size_t)y * row_cells;
        uint16_t *disp = sst_map_u16_row(disp_q6, y);
        uint8_t *conf = confidence ? sst_map_u8_row(confidence, y) : NULL;

        for (size_t i = 0; from_cost && i < row_cells; i++)
            wide[i] = v->cost[(size_t)y * row_cells + i];
        k->winner_row(best, conf ? second : NULL, sum, nd, n, (size_t)v->steps);
        for (size_t x = 0; x < n; x++) {
            const uint16_t *s = sum + x * nd;
            const int b = best[x];
            int offset = 0;

            if (b > 0 && b + 1 < v->steps)
                offset = sst_parabola_q6(s[b - 1], s[b], s[b + 1]);
            disp[x] = (uint16_t)((b * 64 + offset + v->divisor / 2) / v->divisor);
        }
        for (size_t x = 0; conf && x < n; x++) {
            const int gap = second[x] - sum[x * nd + best[x]];

            /* Half of full confidence at a gap of 128 cost units. */
            conf[x] = (uint8_t)(gap > 0 ? 255 * gap / (gap + 128) : 0);
        }
    }
    return 0;
}
