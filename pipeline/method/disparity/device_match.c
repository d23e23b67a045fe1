/* The first pass on a device: a view's costs, their aggregation, the optimisation, winners and filters, without the
 * volume leaving it. Where memory lacks, a view is matched in bands of rows. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>

#include "pipeline/gpu/match.h"
#include "pipeline/method/disparity/device_internal.h"

#define LEAST_ROWS  16    /* of a band */
#define MOST_GROUPS 65535 /* of a dispatch, in each direction, on every device */

/* Scratch memory. */
enum {
    TILES,
    STEPS,
    TABLE,
    CENSUS, /* of the view */
    OTHER,  /* of a neighbour, in all phases that it needs */
    ARMS,
    COST,
    SUM,
    FOUND, /* winners */
    FILTERED,
    STATE,    /* of paths between bands */
    FEATURES, /* of the view: where one place is left to the plane, neighbours have it in turn */
    SCRATCH
};

/* A view to match, or rows of it. */
struct rows {
    const struct disparity_run *run;
    int view;
    const struct sst_neighbour *neighbours; /* of run->desc; no census is needed */
    int count;                              /* of neighbours, at least 1 */
    const struct sst_tiles *tiles; /* windows of disparities by tile, laid out over these rows; NULL: the whole range */
    int top, height;               /* rows */
    bool whole;                    /* all rows: winners are filtered, and stay as SST_PLANE_MAP */
    int band;                      /* rows that are matched at once at most; 0: all */
    struct sst_map_u16 *disp;      /* out: these rows */
    struct sst_map_u8 *confidence; /* likewise, or NULL */
};

/* What the steps of a match need. */
struct match {
    struct sst_run *r;
    const struct rows *in;
    const struct disparity_run *run;
    const struct sst_disparity_config *cfg;
    int width, height;           /* of the views */
    int rounds;                  /* of the aggregation */
    int band;                    /* rows that are matched at once */
    bool masks;                  /* some pixels must not be matched */
    enum sst_gpu_shader path;    /* the fastest variant of sgm_path */
    struct sst_gpu_range pixels; /* of the view */
    struct sst_gpu_range at[SCRATCH];
    struct sst_gpu_tile *tile; /* of the host */
    /* of the band in work */
    int top, rows_of;             /* its rows */
    int tiles, most_nd;           /* disparities of one at most, with padding */
    uint32_t blocks, quads, rows; /* groups that cover the volume of the largest tile */
    uint32_t inner_rows, columns; /* groups of winners, likewise */
    size_t cells;                 /* of all tiles */
};

/* Dispatch over the tiles of the band; ranges follow. */
#define OVER_TILES(m, shader, push, x, y, ...) SST_RUN_GROUPS((m)->r, shader, push, x, y, (m)->tiles, __VA_ARGS__)

static void need(struct match *m, int which, size_t count, size_t each)
{
    m->at[which] = sst_run_scratch(m->r, which, count * each);
}

static enum sst_step_plane colours_of(const struct disparity_run *run)
{
    return run->scale == 1 ? SST_PLANE_COLOUR : SST_PLANE_REDUCED;
}

/* --- bands -------------------------------------------------------------------------------------------------------- */

/* A tile with what its aggregation reaches around it. */
static struct sst_gpu_tile make_tile(struct match *m, int x0, int y0, int width, int height)
{
    const int halo = SST_TILE_HALO(m->rounds);
    struct sst_gpu_tile t = { .x0 = x0, .y0 = y0, .width = width, .height = height };

    t.left = sst_max_int(x0 - halo, 0);
    t.top = sst_max_int(y0 - halo, 0);
    t.pitch = sst_min_int(x0 + width + halo, m->width) - t.left;
    t.rows = sst_min_int(y0 + height + halo, m->height) - t.top;
    t.quad = (uint32_t)(m->cells / 4);
    return t;
}

static void add_tile(struct match *m, const struct sst_gpu_tile *t)
{
    const size_t of_row = (size_t)t->pitch * (size_t)t->nd;
    const uint32_t quads = (uint32_t)((of_row / 4 + SST_GPU_MATCH_QUADS - 1) / SST_GPU_MATCH_QUADS);
    const uint32_t blocks = sst_gpu_match_blocks(t->pitch, t->nd);
    const uint32_t columns = (uint32_t)(t->width + SST_GPU_WINNER_PIXELS - 1) / SST_GPU_WINNER_PIXELS;

    m->cells += of_row * (size_t)t->rows;
    m->most_nd = sst_max_int(m->most_nd, t->nd);
    m->quads = quads > m->quads ? quads : m->quads;
    m->blocks = blocks > m->blocks ? blocks : m->blocks;
    m->columns = columns > m->columns ? columns : m->columns;
    m->rows = (uint32_t)t->rows > m->rows ? (uint32_t)t->rows : m->rows;
    m->inner_rows = (uint32_t)t->height > m->inner_rows ? (uint32_t)t->height : m->inner_rows;
}

/* Tile number i of the band. */
static struct sst_gpu_tile tile_of(struct match *m, int i)
{
    const struct rows *in = m->in;
    const struct sst_volume *shape = &m->run->shape;
    struct sst_gpu_tile made;

    if (in->tiles) {
        const struct sst_tile *t = &in->tiles->tile[(m->top - in->top) / SST_TILE_HEIGHT * in->tiles->columns + i];

        made = make_tile(m, t->x0, t->y0, t->width, t->height);
        made.first = t->first * shape->divisor;
        made.steps = t->steps;
        made.nd = (int32_t)t->steps_padded;
    } else {
        made = make_tile(m, 0, m->top, m->width, m->rows_of);
        made.steps = shape->steps;
        made.nd = (shape->steps + 31) / 32 * 32;
    }
    return made;
}

/* Lay out the volume of rows top .. top + rows - 1. */
static void lay_out(struct match *m, int top, int rows)
{
    const struct sst_tiles *tiles = m->in->tiles;

    m->top = top;
    m->rows_of = rows;
    m->cells = 0;
    m->quads = m->blocks = m->rows = m->inner_rows = m->columns = 0;
    m->tiles = tiles ? (rows + SST_TILE_HEIGHT - 1) / SST_TILE_HEIGHT * tiles->columns : 1;
    m->most_nd = 0;
    for (int i = 0; i < m->tiles; i++) {
        m->tile[i] = tile_of(m, i);
        add_tile(m, &m->tile[i]);
    }
    if (m->tiles > MOST_GROUPS || m->quads > MOST_GROUPS || m->rows > MOST_GROUPS || m->cells / 4 > INT32_MAX)
        sst_run_fail(m->r, -ENOMEM);
}

static int bands_of(const struct match *m)
{
    return (m->in->height + m->band - 1) / m->band;
}

/* Lay out band b. */
static void place_band(struct match *m, int b)
{
    lay_out(m, m->in->top + b * m->band, sst_min_int(m->band, m->in->height - b * m->band));
}

/* --- costs -------------------------------------------------------------------------------------------------------- */

/* The census of a view in the phases of a set, each in its layer. @param layer  out [16], or NULL */
static void make_census(struct match *m, struct sst_gpu_range pixels, unsigned phases, int which, int *layer)
{
    struct sst_gpu_census push = { .width = m->width, .height = m->height };
    uint32_t layers = 0;

    for (uint32_t p = 0; p < SST_PHASES; p++) {
        if (!(phases >> p & 1))
            continue;
        push.phase[layers / 8] |= p << 4 * (layers % 8);
        if (layer)
            layer[p] = (int)layers;
        layers++;
    }
    SST_RUN_PIXELS(m->r, SST_GPU_CENSUS, &push, m->width, m->height, layers, pixels, m->at[which]);
}

static void upload_steps(struct match *m, const struct sst_neighbour *n, const int *layer)
{
    const struct sst_volume *shape = &m->run->shape;
    struct sst_volume_step at[SST_GPU_MATCH_STEPS];
    struct sst_gpu_step steps[SST_GPU_MATCH_STEPS];

    sst_volume_steps(at, shape, n->bx, n->by);
    for (int i = 0; i < shape->steps; i++)
        steps[i] = (struct sst_gpu_step){ at[i].x, at[i].y, layer[at[i].phase], at[i].near_x, at[i].near_y };
    m->at[STEPS] = sst_run_upload(m->r, STEPS, steps, (size_t)shape->steps * sizeof(*steps));
}

/* What the features of a neighbour cost, into the memory of the costs. */
static void match_features(struct match *m, int neighbour)
{
    const struct sst_gpu_features push = { m->width, m->height };
    const struct sst_gpu_range other = sst_run_plane(m->r, SST_PLANE_FEATURES, neighbour);

    OVER_TILES(m, sst_run_fastest(m->r, SST_GPU_FEATURE_COST), &push, m->blocks, m->rows, m->at[TILES], m->at[STEPS],
               m->at[FEATURES], other, m->at[COST]);
    sst_run_release(m->r, SST_PLANE_FEATURES, neighbour);
}

static uint32_t flags_of(const struct match *m, int i)
{
    const int count = m->in->count;

    return (i ? 0U : SST_GPU_MATCH_FIRST) | (i + 1 == count ? SST_GPU_MATCH_LAST : 0U) |
           (count == 2 ? SST_GPU_MATCH_TWO : 0U) | (m->masks ? SST_GPU_MATCH_MASKS : 0U) |
           (m->cfg->cost & SST_COST_MCCNN ? SST_GPU_MATCH_FEATURES : 0U) |
           (m->cfg->cost & SST_COST_CENSUS ? 0U : SST_GPU_MATCH_ALONE);
}

static void match_neighbour(struct match *m, int i)
{
    const struct sst_neighbour *n = &m->in->neighbours[i];
    const struct sst_gpu_match push = { m->width, m->height, flags_of(m, i) };
    const int neighbour = (int)(n->desc - m->run->desc);
    const struct sst_gpu_range pixels = sst_run_plane(m->r, colours_of(m->run), neighbour);
    const bool census = m->cfg->cost & SST_COST_CENSUS;
    int layer[SST_PHASES] = { 0 };

    if (census)
        make_census(m, pixels, sst_volume_phases(&m->run->shape, n->bx, n->by), OTHER, layer);
    upload_steps(m, n, layer);
    if (m->cfg->cost & SST_COST_MCCNN)
        match_features(m, neighbour);
    /* Without a census anything takes its place. */
    OVER_TILES(m, SST_GPU_MATCH_COST, &push, m->blocks, m->rows, m->at[TILES], m->at[STEPS], m->pixels, pixels,
               m->at[census ? CENSUS : STEPS], m->at[census ? OTHER : STEPS], m->at[SUM], m->at[COST]);
    sst_run_release(m->r, colours_of(m->run), neighbour);
}

/* Means over the support regions; each round needs the last one's around a tile as far as regions reach. */
static void aggregate(struct match *m)
{
    for (int left = m->rounds - 1; left >= 0; left--) {
        const int around = left * SST_SUPPORT_MAX_ARM;
        const struct sst_gpu_support sum = { m->width, m->height, around, around + SST_SUPPORT_MAX_ARM };
        const struct sst_gpu_support mean = { m->width, m->height, around, around };

        OVER_TILES(m, SST_GPU_SUPPORT_SUM, &sum, m->quads, m->rows, m->at[TILES], m->at[ARMS], m->at[COST], m->at[SUM]);
        OVER_TILES(m, SST_GPU_SUPPORT_MEAN, &mean, m->quads, m->rows, m->at[TILES], m->at[ARMS], m->at[SUM],
                   m->at[COST]);
    }
}

/* Costs of band b. */
static void fill_band(struct match *m, int b)
{
    place_band(m, b);
    m->at[TILES] = sst_run_upload(m->r, TILES, m->tile, (size_t)m->tiles * sizeof(*m->tile));
    for (int i = 0; i < m->in->count && !sst_run_failed(m->r); i++)
        match_neighbour(m, i);
    aggregate(m);
}

/* --- paths -------------------------------------------------------------------------------------------------------- */

/* Steps that any tile has: the window of one may end after the last step of the view. */
static uint32_t all_steps(const struct match *m)
{
    const int steps = m->run->shape.steps;

    return (uint32_t)(m->in->tiles ? steps + 64 : (steps + 31) / 32 * 32);
}

/* Paths of directions through the band. */
struct paths {
    int way, ways;
    bool first;      /* set the sums */
    int load, store; /* entries of the state; -1: none */
};

static void follow(struct match *m, const struct paths *p)
{
    const struct sst_tiles *tiles = m->in->tiles;
    const enum sst_gpu_shader shader = m->most_nd <= SST_GPU_SGM_SUBGROUP_STEPS ? m->path : SST_GPU_SGM_PATH;
    const struct sst_gpu_sgm push = { .width = m->width,
                                      .top = m->top,
                                      .bottom = m->top + m->rows_of,
                                      .tile_width = tiles ? SST_TILE_WIDTH : m->width,
                                      .tile_height = tiles ? SST_TILE_HEIGHT : m->rows_of,
                                      .columns = tiles ? tiles->columns : 1,
                                      .way = p->way,
                                      .ways = p->ways,
                                      .first = p->first,
                                      .load = p->load < 0 ? -1 : p->load * m->width,
                                      .store = p->store < 0 ? -1 : p->store * m->width,
                                      .all = all_steps(m) };

    SST_RUN_GROUPS(m->r, shader, &push, sst_gpu_sgm_groups(&push), p->ways, 1, m->at[TILES], m->pixels, m->at[TABLE],
                   m->at[COST], m->at[SUM], m->at[STATE]);
}

/* Directions downwards: straight, then slanted. Upwards: 3; 6 and 7. */
static const int down[] = { 2, 4, 5 };

/* State of the paths downwards at the end of each band but the last one; with 8 paths three directions. */
static void follow_down(struct match *m, int slants)
{
    for (int b = 0; b + 1 < bands_of(m); b++) {
        fill_band(m, b);
        for (int s = 0; s < slants; s++)
            follow(m, &(struct paths){ down[s], 1, true, b ? (b - 1) * slants + s : -1, b * slants + s });
    }
}

/* All paths of band b. */
static void optimise(struct match *m, int slants, int b)
{
    const int bands = bands_of(m), up = (bands - 1) * slants; /* entries of two bands, in turn */

    follow(m, &(struct paths){ 0, 1, true, -1, -1 });
    if (bands == 1) {
        follow(m, &(struct paths){ 1, 2 + 2 * slants - 1, false, -1, -1 });
        return;
    }
    follow(m, &(struct paths){ 1, 1, false, -1, -1 });
    for (int s = 0; s < slants; s++) {
        follow(m, &(struct paths){ down[s], 1, false, b ? (b - 1) * slants + s : -1, -1 });
        follow(m, &(struct paths){ down[s] + (s ? 2 : 1), 1, false, b + 1 < bands ? up + (b + 1) % 2 * slants + s : -1,
                                   b ? up + b % 2 * slants + s : -1 });
    }
}

static int slants_of(const struct match *m)
{
    return m->cfg->paths == 8 ? 3 : 1;
}

/* Match in bands of m->band rows, from the last one up: paths downwards come from a pass before that, for which the
 * costs are computed once more. @param winners  out */
static void match_bands(struct match *m, struct sst_gpu_range winners)
{
    const struct sst_gpu_winner push = { m->width, m->in->top, m->run->shape.divisor, m->cfg->raw };

    if (!m->cfg->raw)
        follow_down(m, slants_of(m));
    for (int b = bands_of(m) - 1; b >= 0; b--) {
        fill_band(m, b);
        if (!m->cfg->raw)
            optimise(m, slants_of(m), b);
        OVER_TILES(m, SST_GPU_WINNER, &push, m->inner_rows, m->columns, m->at[TILES], m->at[SUM], m->at[COST], winners);
    }
}

/* --- a view ------------------------------------------------------------------------------------------------------- */

/* Reserve all scratch memory, before planes take the rest. */
static void reserve(struct match *m)
{
    const struct rows *in = m->in;
    const size_t n = (size_t)m->width * (size_t)m->height;
    const size_t states = bands_of(m) > 1 ? (size_t)((bands_of(m) + 1) * slants_of(m)) * (size_t)m->width : 1;
    size_t cells = 0, layers = 1;

    for (int b = 0; b < bands_of(m); b++) {
        place_band(m, b);
        cells = m->cells > cells ? m->cells : cells;
    }
    for (int i = 0; i < in->count; i++) {
        const struct sst_neighbour *k = &in->neighbours[i];
        const size_t phases = (size_t)__builtin_popcount(sst_volume_phases(&m->run->shape, k->bx, k->by));

        layers = phases > layers ? phases : layers;
        m->masks = m->masks || k->desc->seen.data;
    }
    need(m, TILES, (size_t)(in->tiles ? in->tiles->columns * in->tiles->rows : 1), sizeof(*m->tile));
    need(m, STEPS, (size_t)m->run->shape.steps, sizeof(struct sst_gpu_step));
    need(m, TABLE, 256, sizeof(uint32_t));
    need(m, COST, cells, sizeof(uint8_t));
    need(m, SUM, cells, sizeof(uint16_t));
    need(m, STATE, states * (all_steps(m) + 3), sizeof(uint32_t));
    need(m, FOUND, n, sizeof(uint32_t));
    need(m, FILTERED, n, sizeof(uint32_t));
    if (m->rounds)
        need(m, ARMS, n, sizeof(uint32_t));
    if (m->cfg->cost & SST_COST_MCCNN)
        need(m, FEATURES, n, SST_FEATURE_CHANNELS);
    if (m->cfg->cost & SST_COST_CENSUS) {
        need(m, CENSUS, n, sizeof(uint64_t));
        need(m, OTHER, layers * n, sizeof(uint64_t));
    }
}

static void upload_penalties(struct match *m)
{
    struct sst_disparity_sgm_penalties penalties;
    uint32_t table[256];

    sst_disparity_sgm_penalties_init(&penalties, m->cfg);
    for (int i = 0; i < 256; i++)
        table[i] = penalties.p1[i] | (uint32_t)penalties.p2[i] << 16;
    m->at[TABLE] = sst_run_upload(m->r, TABLE, table, sizeof(table));
}

/* Inputs of all bands. @return place of the view's map */
static struct sst_gpu_range prepare(struct match *m)
{
    const struct sst_gpu_arms arms = { m->width, m->height, m->cfg->support_arm, m->cfg->support_tau };
    const int pair[] = { m->in->view, (int)(m->in->neighbours[0].desc - m->run->desc) };
    struct sst_gpu_range map = m->at[FOUND];

    upload_penalties(m);
    (void)sst_run_planes(m->r, colours_of(m->run), pair, 2);
    m->pixels = sst_run_plane(m->r, colours_of(m->run), m->in->view);
    if (m->in->whole)
        map = sst_run_output(m->r, SST_PLANE_MAP, m->in->view);
    if (m->cfg->cost & SST_COST_MCCNN) {
        sst_run_copy(m->r, m->at[FEATURES], sst_run_plane(m->r, SST_PLANE_FEATURES, m->in->view),
                     (size_t)m->width * (size_t)m->height * SST_FEATURE_CHANNELS);
        sst_run_release(m->r, SST_PLANE_FEATURES, m->in->view);
    }
    m->path = sst_run_fastest(m->r, SST_GPU_SGM_PATH);
    if (m->cfg->cost & SST_COST_CENSUS)
        make_census(m, m->pixels, 1, CENSUS, NULL);
    if (m->rounds)
        SST_RUN_PIXELS(m->r, SST_GPU_SUPPORT_ARMS, &arms, m->width, m->height, 1, m->pixels, m->at[ARMS]);
    return map;
}

static void filter(struct match *m, struct sst_gpu_range out)
{
    const bool both = m->cfg->bilateral_tau > 0;
    const struct sst_gpu_median median = { m->width, m->height, !both && m->masks };
    struct sst_gpu_bilateral bilateral = { m->width, m->height, m->cfg->bilateral_tau, m->masks, { 0 } };

    SST_RUN_PIXELS(m->r, SST_GPU_MEDIAN, &median, m->width, m->height, 1, m->at[FOUND], m->pixels,
                   both ? m->at[FILTERED] : out);
    if (!both)
        return;
    for (int i = 0; i < 16; i++)
        bilateral.weight[i] = sst_disparity_bilateral_weight(i % 4, i / 4);
    SST_RUN_PIXELS(m->r, SST_GPU_BILATERAL, &bilateral, m->width, m->height, 1, m->at[FILTERED], m->pixels, out);
}

/* Rows of the host's maps. */
static void unpack(const struct rows *in, const uint32_t *from)
{
    struct sst_map_u16 disp = *in->disp;
    struct sst_map_u8 confidence = in->confidence ? *in->confidence : (struct sst_map_u8){ 0 };

    disp.data = sst_map_u16_row(in->disp, in->top);
    disp.height = in->height;
    if (in->confidence)
        confidence.data = sst_map_u8_row(in->confidence, in->top);
    if (from)
        sst_step_map_unpack(from, &disp, in->confidence ? &confidence : NULL, NULL, NULL);
}

static void match_rows(struct sst_run *r, const struct rows *in)
{
    const struct disparity_run *run = in->run;
    const struct sst_disparity_config *cfg = run->cfg;
    const bool filtered = in->whole && !cfg->raw;
    struct match m = { .r = r, .in = in, .run = run, .cfg = cfg, .width = run->width, .height = run->height };
    struct sst_gpu_range out;

    m.masks = run->desc[in->view].seen.data;
    m.rounds = cfg->support_arm && !cfg->raw ? cfg->support_before : 0;
    m.tile = calloc((size_t)(in->tiles ? in->tiles->columns * in->tiles->rows : 1), sizeof(*m.tile));
    if (!m.tile) {
        sst_run_fail(r, -ENOMEM);
        return;
    }
    m.band = sst_run_rows(r, in->height, in->tiles ? SST_TILE_HEIGHT : LEAST_ROWS);
    m.band = in->band ? sst_min_int(in->band, m.band) : m.band;
    reserve(&m);
    out = prepare(&m);
    match_bands(&m, filtered ? m.at[FOUND] : out);
    if (filtered)
        filter(&m, out);
    unpack(in, sst_run_fetch(r, out, (size_t)m.width * (size_t)in->height));
    free(m.tile);
}

void dispatch_match(struct sst_run *r, void *job, int view)
{
    struct match_batch *b = job;
    struct disparity_run *run = b->run;
    const struct sst_coarse coarse = run->coarse ? run_coarse_view(run, view) : (struct sst_coarse){ 0 };
    struct sst_neighbour neighbours[SST_MAX_NEIGHBOURS];
    struct rows in = { .run = run,
                       .view = view,
                       .neighbours = neighbours,
                       .height = run->height,
                       .whole = true,
                       .band = b->sample ? b->sample->band : 0,
                       .disp = &run->disp[view],
                       .confidence = &run->confidence[view] };

    in.count = run_gather_neighbours(run, view, 0, run->cfg->neighbours - 1, neighbours);
    sst_run_fail(r, sst_min_int(in.count, 0));
    if (run->coarse) {
        in.tiles = &run->tiles[0];
        sst_run_fail(r, sst_tiles_init(&run->tiles[0], run->width, 0, run->height, &run->shape, &coarse));
    }
    if (sst_run_failed(r))
        return;
    if (in.tiles)
        run->searched[view] = sst_tiles_share(in.tiles);
    match_rows(r, &in);
    if (run->cfg->raw && !sst_run_failed(r)) /* no filter, which does that */
        match_forget_unseen(&run->disp[view], &run->desc[view].seen);
}

void dispatch_compare(struct sst_run *r, void *job, int item)
{
    struct windows_compared *c = job;
    struct sst_tiles *tiles = &c->run->tiles[0];
    const struct rows in = { .run = c->run,
                             .view = c->run->lf->ref_view,
                             .neighbours = c->neighbours,
                             .count = c->count,
                             .tiles = tiles,
                             .top = c->top[item / 2],
                             .height = SST_TILE_HEIGHT,
                             .disp = &c->disp[item] };

    sst_run_fail(r, windows_lay_out(c, item, tiles));
    if (!sst_run_failed(r))
        match_rows(r, &in);
}

static const char *refuses(const struct disparity_run *run)
{
    const struct sst_disparity_config *cfg = run->cfg;

    if (!cfg->joint)
        return "maps of two directions are fused";
    if (!cfg->raw && cfg->support_arm && cfg->support_after)
        return "costs are aggregated after the optimisation";
    /* As all_steps() has it. */
    if (run->shape.steps + 64 > SST_GPU_MATCH_STEPS)
        return "too many disparities";
    /* A path makes a pass for each pixel, and one for each 128 of its disparities: docs/design/gpu.md, Rules. */
    return (int64_t)sst_max_int(run->shape.width, run->shape.height) * (1 + (run->shape.steps + 64 + 127) / 128) >
                   SST_GPU_MATCH_PASSES
               ? "sides that are too long for so many disparities"
               : NULL;
}

const char *match_refuses(const void *batch)
{
    return refuses(((const struct match_batch *)batch)->run);
}

const char *compare_refuses(const void *compared)
{
    return refuses(((const struct windows_compared *)compared)->run);
}
