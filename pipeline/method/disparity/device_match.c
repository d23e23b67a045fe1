/* The first pass on a device: a view's costs, their aggregation, the optimisation, winners and filters, without the
 * volume leaving it. Views' pixels and features are uploaded once for all views that they are matched with. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "pipeline/gpu/match.h"
#include "pipeline/method/disparity/disparity_internal.h"

#define LEAST_ROWS  16                /* of a band */
#define MOST_GROUPS 65535             /* of a dispatch, in each direction: what every device has */
#define STRIP_BYTES ((size_t)1 << 20) /* of features that are uploaded at once */

/* What the steps of a match need. */
struct match {
    struct sst_disparity_device *d;
    const struct device_match *in;
    const struct sst_disparity_config *cfg;
    int width, height; /* of the views */
    int rounds;        /* of the aggregation */
    int band;          /* rows that are matched at once */
    /* of the band in work */
    int top, rows_of;             /* its rows */
    int tiles, most_nd;           /* disparities of one at most, with padding */
    enum sst_gpu_shader path;     /* the fastest variant of sgm_path */
    uint32_t blocks, quads, rows; /* groups that cover the volume of the largest tile */
    uint32_t inner_rows, columns; /* groups of winners, likewise */
    size_t cells;                 /* of all tiles */
    bool masks;                   /* some pixels must not be matched */
};

static int dispatch(struct match *m, enum sst_gpu_shader shader, const void *push, uint32_t x, uint32_t y, uint32_t z,
                    const struct sst_gpu_range *range, size_t count)
{
    struct sst_gpu_work work = { .shader = shader, .push = push, .groups = { x, y, z } };

    for (size_t i = 0; i < count; i++) {
        work.buffer[i] = range[i].buffer;
        work.offset[i] = range[i].offset;
    }
    m->d->report.dispatches++;
    return sst_gpu_dispatch(m->d->gpu, &work);
}

/* Over all pixels of a view. */
static int dispatch_plane(struct match *m, enum sst_gpu_shader shader, const void *push, uint32_t layers,
                          const struct sst_gpu_range *range, size_t count)
{
    const uint32_t x = (uint32_t)(m->width + SST_GPU_PLANE_WIDTH - 1) / SST_GPU_PLANE_WIDTH;
    const uint32_t y = (uint32_t)(m->height + SST_GPU_PLANE_HEIGHT - 1) / SST_GPU_PLANE_HEIGHT;

    return dispatch(m, shader, push, x, y, layers, range, count);
}

/* The pixels of a view on the device. */
static int need_view(struct match *m, const struct sst_descriptor *desc)
{
    const struct device_view v = { .view = (int)(desc - m->in->run->desc),
                                   .width = m->width,
                                   .height = m->height,
                                   .image = &desc->image,
                                   .seen = &desc->seen,
                                   .stays = true };
    struct sst_gpu_range found;

    m->masks = m->masks || desc->seen.data;
    return disparity_device_colours(m->d, &v, &found);
}

/* The features of a view on the device. @param stays  as of disparity_device_create_buffer() */
static int need_features(struct match *m, const struct sst_descriptor *desc, const struct device_pixels *stays)
{
    struct sst_disparity_device *d = m->d;
    struct device_pixels *p = &d->view[desc - m->in->run->desc];
    const size_t of_row = (size_t)m->width * SST_FEATURE_CHANNELS;
    const int strip = sst_clamp_int((int)(STRIP_BYTES / of_row), 1, m->height);
    uint8_t *bytes;
    int err;

    if (p->features && p->rows == m->height)
        return 0;
    if (!desc->features) /* gave way since the view was described, or were lost with the device */
        return -ENODATA;
    sst_gpu_buffer_destroy(d->gpu, p->features);
    p->features = NULL;
    bytes = (uint8_t *)sst_mem_keep(&d->words, (size_t)strip * of_row / 4, sizeof(uint32_t));
    err = bytes ? disparity_device_create_buffer(d, &p->features, (size_t)m->height * of_row, stays) : -ENOMEM;
    if (err)
        return err;
    for (int y = 0; y < m->height && !err; y += strip) {
        const size_t rows = (size_t)sst_min_int(strip, m->height - y), groups = rows * SST_GPU_FEATURE_WORDS;
        const uint8_t *from = desc->features + (size_t)y * SST_GPU_FEATURE_WORDS * desc->feature_stride;

        for (size_t i = 0; i < groups; i++)
            memcpy(bytes + 4 * i * (size_t)m->width, from + i * desc->feature_stride, 4 * (size_t)m->width);
        err = disparity_device_upload_at(d, p->features, (size_t)y * of_row, bytes, rows * of_row);
    }
    d->report.uploads++;
    if (err) {
        sst_gpu_buffer_destroy(d->gpu, p->features);
        p->features = NULL;
    }
    p->rows = m->height;
    return err;
}

static struct sst_gpu_range pixels_of(const struct match *m, const struct sst_descriptor *desc)
{
    const enum sst_step_plane plane = m->in->run->scale == 1 ? SST_PLANE_COLOUR : SST_PLANE_REDUCED;

    return disparity_device_find(m->d, plane, (int)(desc - m->in->run->desc));
}

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
    const struct device_match *in = m->in;
    const struct sst_volume *shape = &in->run->shape;
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

/* Lay out the volume of rows top .. top + rows - 1, and make room for it. */
static int place_band(struct match *m, int top, int rows)
{
    const struct device_match *in = m->in;
    const int count = in->tiles ? (rows + SST_TILE_HEIGHT - 1) / SST_TILE_HEIGHT * in->tiles->columns : 1;
    struct sst_gpu_tile *tile = calloc((size_t)count, sizeof(*tile));
    int err = tile ? 0 : -ENOMEM;

    m->top = top;
    m->rows_of = rows;
    m->cells = 0;
    m->quads = m->blocks = m->rows = m->inner_rows = m->columns = 0;
    m->tiles = count;
    m->most_nd = 0;
    for (int i = 0; i < count && !err; i++) {
        tile[i] = tile_of(m, i);
        add_tile(m, &tile[i]);
    }
    if (!err && (count > MOST_GROUPS || m->quads > MOST_GROUPS || m->rows > MOST_GROUPS || m->cells / 4 > INT32_MAX))
        err = -ENOMEM;
    err = err ? err : disparity_device_keep(m->d, KEPT_TILES, (size_t)count, sizeof(*tile));
    err = err ? err : disparity_device_upload(m->d, m->d->kept[KEPT_TILES], tile, (size_t)count * sizeof(*tile));
    err = err ? err : disparity_device_keep(m->d, KEPT_COST, m->cells, sizeof(uint8_t));
    err = err ? err : disparity_device_keep(m->d, KEPT_SUM, m->cells, sizeof(uint16_t));
    free(tile);
    return err;
}

/* The census of a view in the phases of a set, each in its layer. @param layer  out [16], or NULL */
static int make_census(struct match *m, const struct sst_descriptor *desc, unsigned phases, enum device_kept which,
                       int *layer)
{
    const size_t n = (size_t)m->width * (size_t)m->height;
    struct sst_gpu_census push = { .width = m->width, .height = m->height };
    uint32_t layers = 0;
    int err;

    for (uint32_t p = 0; p < SST_PHASES; p++) {
        if (!(phases >> p & 1))
            continue;
        push.phase[layers / 8] |= p << 4 * (layers % 8);
        if (layer)
            layer[p] = (int)layers;
        layers++;
    }
    err = disparity_device_keep(m->d, which, layers * n, sizeof(uint64_t));
    return err ? err
               : dispatch_plane(m, SST_GPU_CENSUS, &push, layers,
                                (const struct sst_gpu_range[]){ pixels_of(m, desc), W(m->d->kept[which]) }, 2);
}

static int upload_steps(struct match *m, const struct sst_neighbour *n, const int *layer)
{
    const struct sst_volume *shape = &m->in->run->shape;
    const size_t count = (size_t)shape->steps;
    struct sst_volume_step *at = calloc(count, sizeof(*at));
    struct sst_gpu_step *steps = calloc(count, sizeof(*steps));
    int err = at && steps ? disparity_device_keep(m->d, KEPT_STEPS, count, sizeof(*steps)) : -ENOMEM;

    if (!err) {
        sst_volume_steps(at, shape, n->bx, n->by);
        for (size_t i = 0; i < count; i++)
            steps[i] = (struct sst_gpu_step){ at[i].x, at[i].y, layer[at[i].phase], at[i].near_x, at[i].near_y };
        err = disparity_device_upload(m->d, m->d->kept[KEPT_STEPS], steps, count * sizeof(*steps));
    }
    free(at);
    free(steps);
    return err;
}

/* What the features of a neighbour cost, into the memory of the costs. */
static int match_features(struct match *m, const struct sst_neighbour *n)
{
    const struct sst_gpu_features push = { m->width, m->height };
    struct device_pixels *own = &m->d->view[m->in->ref - m->in->run->desc];
    const struct device_pixels *other = &m->d->view[n->desc - m->in->run->desc];
    struct sst_gpu_buffer **kept = m->d->kept;
    enum sst_gpu_shader shader;
    int err = sst_gpu_prepare_fastest(m->d->gpu, SST_GPU_FEATURE_COST, &shader);

    err = err ? err : need_features(m, m->in->ref, NULL);
    err = err ? err : need_features(m, n->desc, own);
    return err ? err
               : dispatch(m, shader, &push, m->blocks, m->rows, (uint32_t)m->tiles,
                          (const struct sst_gpu_range[]){ W(kept[KEPT_TILES]), W(kept[KEPT_STEPS]), W(own->features),
                                                          W(other->features), W(kept[KEPT_COST]) },
                          SST_GPU_FEATURE_BUFFERS);
}

static uint32_t flags_of(const struct match *m, int i)
{
    const int count = m->in->count;

    return (i ? 0U : SST_GPU_MATCH_FIRST) | (i + 1 == count ? SST_GPU_MATCH_LAST : 0U) |
           (count == 2 ? SST_GPU_MATCH_TWO : 0U) | (m->masks ? SST_GPU_MATCH_MASKS : 0U) |
           (m->cfg->cost & SST_COST_MCCNN ? SST_GPU_MATCH_FEATURES : 0U) |
           (m->cfg->cost & SST_COST_CENSUS ? 0U : SST_GPU_MATCH_ALONE);
}

static int match_neighbour(struct match *m, int i)
{
    const struct device_match *in = m->in;
    const struct sst_neighbour *n = &in->neighbours[i];
    struct sst_gpu_buffer **kept = m->d->kept;
    const struct sst_gpu_match push = { m->width, m->height, flags_of(m, i) };
    const bool census = m->cfg->cost & SST_COST_CENSUS;
    int layer[SST_PHASES] = { 0 };
    int err = census ? make_census(m, n->desc, sst_volume_phases(&in->run->shape, n->bx, n->by), KEPT_OTHER, layer) : 0;

    err = err ? err : upload_steps(m, n, layer);
    if (m->cfg->cost & SST_COST_MCCNN)
        err = err ? err : match_features(m, n);
    /* Without a census anything takes its place. */
    return err ? err
               : dispatch(m, SST_GPU_MATCH_COST, &push, m->blocks, m->rows, (uint32_t)m->tiles,
                          (const struct sst_gpu_range[]){
                              W(kept[KEPT_TILES]), W(kept[KEPT_STEPS]), pixels_of(m, in->ref), pixels_of(m, n->desc),
                              W(kept[census ? KEPT_CENSUS : KEPT_STEPS]), W(kept[census ? KEPT_OTHER : KEPT_STEPS]),
                              W(kept[KEPT_SUM]), W(kept[KEPT_COST]) },
                          SST_GPU_COST_BUFFERS);
}

static int find_arms(struct match *m)
{
    const struct sst_gpu_arms arms = { m->width, m->height, m->cfg->support_arm, m->cfg->support_tau };
    struct sst_gpu_buffer **kept = m->d->kept;
    int err = disparity_device_keep(m->d, KEPT_ARMS, (size_t)m->width * (size_t)m->height, sizeof(uint32_t));

    return err ? err
               : dispatch_plane(m, SST_GPU_SUPPORT_ARMS, &arms, 1,
                                (const struct sst_gpu_range[]){ pixels_of(m, m->in->ref), W(kept[KEPT_ARMS]) },
                                SST_GPU_ARMS_BUFFERS);
}

/* Means over the support regions; each round needs the last one's around a tile as far as regions reach. */
static int aggregate(struct match *m)
{
    struct sst_gpu_buffer **kept = m->d->kept;
    int err = 0;

    for (int left = m->rounds - 1; left >= 0 && !err; left--) {
        const int around = left * SST_SUPPORT_MAX_ARM;
        const struct sst_gpu_support sum = { m->width, m->height, around, around + SST_SUPPORT_MAX_ARM };
        const struct sst_gpu_support mean = { m->width, m->height, around, around };

        err = dispatch(m, SST_GPU_SUPPORT_SUM, &sum, m->quads, m->rows, (uint32_t)m->tiles,
                       (const struct sst_gpu_range[]){ W(kept[KEPT_TILES]), W(kept[KEPT_ARMS]), W(kept[KEPT_COST]),
                                                       W(kept[KEPT_SUM]) },
                       SST_GPU_SUPPORT_SUM_BUFFERS);
        err = err ? err
                  : dispatch(m, SST_GPU_SUPPORT_MEAN, &mean, m->quads, m->rows, (uint32_t)m->tiles,
                             (const struct sst_gpu_range[]){ W(kept[KEPT_TILES]), W(kept[KEPT_ARMS]), W(kept[KEPT_SUM]),
                                                             W(kept[KEPT_COST]) },
                             SST_GPU_SUPPORT_MEAN_BUFFERS);
    }
    return err;
}

static int upload_penalties(struct match *m)
{
    struct sst_disparity_sgm_penalties penalties;
    uint32_t table[256];
    int err = disparity_device_keep(m->d, KEPT_TABLE, 256, sizeof(*table));

    sst_disparity_sgm_penalties_init(&penalties, m->cfg);
    for (int i = 0; i < 256; i++)
        table[i] = penalties.p1[i] | (uint32_t)penalties.p2[i] << 16;
    return err ? err : disparity_device_upload(m->d, m->d->kept[KEPT_TABLE], table, sizeof(table));
}

/* Steps that any tile has: the window of one may end after the last step of the view. */
static uint32_t all_steps(const struct match *m)
{
    const int steps = m->in->run->shape.steps;

    return (uint32_t)(m->in->tiles ? steps + 64 : (steps + 31) / 32 * 32);
}

/* Paths of directions through the band. @param first  set the sums @param load, store  entries of the state; -1: none
 */
static int follow(struct match *m, int way, int ways, bool first, int load, int store)
{
    const struct device_match *in = m->in;
    struct sst_gpu_buffer **kept = m->d->kept;
    const enum sst_gpu_shader shader = m->most_nd <= SST_GPU_SGM_SUBGROUP_STEPS ? m->path : SST_GPU_SGM_PATH;
    const struct sst_gpu_sgm push = { .width = m->width,
                                      .top = m->top,
                                      .bottom = m->top + m->rows_of,
                                      .tile_width = in->tiles ? SST_TILE_WIDTH : m->width,
                                      .tile_height = in->tiles ? SST_TILE_HEIGHT : m->rows_of,
                                      .columns = in->tiles ? in->tiles->columns : 1,
                                      .way = way,
                                      .ways = ways,
                                      .first = first,
                                      .load = load < 0 ? -1 : load * m->width,
                                      .store = store < 0 ? -1 : store * m->width,
                                      .all = all_steps(m) };

    return dispatch(m, shader, &push, sst_gpu_sgm_groups(&push), (uint32_t)ways, 1,
                    (const struct sst_gpu_range[]){ W(kept[KEPT_TILES]), pixels_of(m, in->ref), W(kept[KEPT_TABLE]),
                                                    W(kept[KEPT_COST]), W(kept[KEPT_SUM]), W(kept[KEPT_STATE]) },
                    SST_GPU_SGM_BUFFERS);
}

/* Winners of the band. */
static int choose(struct match *m)
{
    const struct device_match *in = m->in;
    const struct sst_gpu_winner push = { m->width, in->top, in->run->shape.divisor, m->cfg->raw };
    struct sst_gpu_buffer **kept = m->d->kept;

    return dispatch(
        m, SST_GPU_WINNER, &push, m->inner_rows, m->columns, (uint32_t)m->tiles,
        (const struct sst_gpu_range[]){ W(kept[KEPT_TILES]), W(kept[KEPT_SUM]), W(kept[KEPT_COST]), W(kept[KEPT_MAP]) },
        SST_GPU_WINNER_BUFFERS);
}

/* Filter the winners if that is wanted. @param map  out: where they are */
static int filter(struct match *m, enum device_kept *map)
{
    const struct device_match *in = m->in;
    const size_t n = (size_t)m->width * (size_t)in->height;
    const struct sst_gpu_median median = { m->width, m->height };
    struct sst_gpu_bilateral bilateral = { m->width, m->height, m->cfg->bilateral_tau, { 0 } };
    struct sst_gpu_buffer **kept = m->d->kept;
    int err = 0;

    *map = KEPT_MAP;
    if (!in->filter || m->cfg->raw)
        return 0;
    err = disparity_device_keep(m->d, KEPT_FILTERED, n, sizeof(uint32_t));
    err = err ? err
              : dispatch_plane(m, SST_GPU_MEDIAN, &median, 1,
                               (const struct sst_gpu_range[]){ W(kept[KEPT_MAP]), W(kept[KEPT_FILTERED]) },
                               SST_GPU_MEDIAN_BUFFERS);
    *map = KEPT_FILTERED;
    if (err || m->cfg->bilateral_tau <= 0)
        return err;
    for (int i = 0; i < 16; i++)
        bilateral.weight[i] = sst_disparity_bilateral_weight(i % 4, i / 4);
    *map = KEPT_MAP;
    return dispatch_plane(
        m, SST_GPU_BILATERAL, &bilateral, 1,
        (const struct sst_gpu_range[]){ W(kept[KEPT_FILTERED]), pixels_of(m, in->ref), W(kept[KEPT_MAP]) },
        SST_GPU_BILATERAL_BUFFERS);
}

/* The map of a whole view stays. */
static int store(struct match *m, enum device_kept map)
{
    const struct sst_gpu_convert push = { .width = m->width, .height = m->height, .conversion = SST_GPU_FROM_MATCH };

    return m->in->filter ? disparity_device_store(m->d, (int)(m->in->ref - m->in->run->desc), push,
                                                  pixels_of(m, m->in->ref), m->d->kept[map])
                         : 0;
}

/* Disparities and confidences of the host's maps. */
static int fetch(struct match *m, enum device_kept map)
{
    const struct device_match *in = m->in;
    const size_t n = (size_t)m->width * (size_t)in->height;
    const int64_t start_ns = sst_clock_now_ns();
    uint32_t *words = sst_mem_keep(&m->d->words, n, sizeof(*words));
    int err = words ? sst_gpu_wait(m->d->gpu) : -ENOMEM;
    const int64_t done_ns = sst_clock_now_ns();

    err = err ? err : sst_gpu_download(m->d->gpu, words, m->d->kept[map], 0, n * sizeof(*words));
    m->d->report.wait_ns += done_ns - start_ns;
    m->d->report.download_ns += sst_clock_now_ns() - done_ns;
    for (int y = 0; !err && y < in->height; y++) {
        const uint32_t *from = words + (size_t)y * (size_t)m->width;
        uint16_t *disp = sst_map_u16_row(in->disp, in->top + y);
        uint8_t *confidence = in->confidence ? sst_map_u8_row(in->confidence, in->top + y) : NULL;

        for (int x = 0; x < m->width; x++)
            disp[x] = (uint16_t)from[x];
        for (int x = 0; confidence && x < m->width; x++)
            confidence[x] = (uint8_t)(from[x] >> 16);
    }
    return err;
}

/* Phases that one of the neighbours needs at most. */
static size_t most_layers(const struct device_match *in)
{
    int most = 1;

    for (int i = 0; i < in->count; i++) {
        const struct sst_neighbour *n = &in->neighbours[i];

        most = sst_max_int(most, __builtin_popcount(sst_volume_phases(&in->run->shape, n->bx, n->by)));
    }
    return (size_t)most;
}

/* Costs of a band. */
static int fill_band(struct match *m, int top, int rows)
{
    int err = place_band(m, top, rows);

    for (int i = 0; i < m->in->count && !err; i++)
        err = match_neighbour(m, i);
    return err || !m->rounds ? err : aggregate(m);
}

/* Rows of band b. */
static int rows_of(const struct match *m, int b)
{
    return sst_min_int(m->band, m->in->height - b * m->band);
}

/* Directions downwards: straight, then slanted. Those upwards follow: 3; 6 and 7. */
static const int down[] = { 2, 4, 5 };

/* What the paths downwards leave at the end of each band but the last one; with 8 paths three of them. */
static int follow_down(struct match *m, int slants, int bands)
{
    int err = 0;

    for (int b = 0; b + 1 < bands && !err; b++) {
        err = fill_band(m, m->in->top + b * m->band, rows_of(m, b));
        for (int s = 0; s < slants && !err; s++)
            err = follow(m, down[s], 1, true, b ? (b - 1) * slants + s : -1, b * slants + s);
    }
    return err;
}

/* All paths of a band. */
static int optimise(struct match *m, int slants, int b, int bands)
{
    const int up = (bands - 1) * slants; /* entries of two bands, in turn */
    int err = follow(m, 0, 1, true, -1, -1);

    if (bands == 1)
        return err ? err : follow(m, 1, 2 + 2 * slants - 1, false, -1, -1);
    err = err ? err : follow(m, 1, 1, false, -1, -1);
    for (int s = 0; s < slants && !err; s++) {
        err = follow(m, down[s], 1, false, b ? (b - 1) * slants + s : -1, -1);
        err = err ? err
                  : follow(m, down[s] + (s ? 2 : 1), 1, false, b + 1 < bands ? up + (b + 1) % 2 * slants + s : -1,
                           b ? up + b % 2 * slants + s : -1);
    }
    return err;
}

/* Match in bands of m->band rows, from the last one up: paths downwards come from a pass before that, for which the
 * costs are computed once more. */
static int match_bands(struct match *m)
{
    const int bands = (m->in->height + m->band - 1) / m->band, slants = m->cfg->paths == 8 ? 3 : 1;
    const size_t columns = bands > 1 ? (size_t)((bands + 1) * slants) * (size_t)m->width : 1;
    int err = disparity_device_keep(m->d, KEPT_STATE, columns * (all_steps(m) + 3), sizeof(uint32_t));

    if (!m->cfg->raw)
        err = err ? err : follow_down(m, slants, bands);
    for (int b = bands - 1; b >= 0 && !err; b--) {
        err = fill_band(m, m->in->top + b * m->band, rows_of(m, b));
        if (!m->cfg->raw)
            err = err ? err : optimise(m, slants, b, bands);
        err = err ? err : choose(m);
    }
    m->d->report.in_bands += !err && bands > 1 && m->in->filter;
    return err;
}

/* Free the volume, which is too large. */
static void drop_volume(struct sst_disparity_device *d)
{
    static const enum device_kept volume[] = { KEPT_COST, KEPT_SUM, KEPT_STATE };

    for (size_t i = 0; i < ARRAY_LEN(volume); i++) {
        sst_gpu_buffer_destroy(d->gpu, d->kept[volume[i]]);
        d->kept[volume[i]] = NULL;
        d->bytes[volume[i]] = 0;
    }
}

static int match_view(struct match *m)
{
    const struct device_match *in = m->in;
    const size_t n = (size_t)m->width * (size_t)m->height;
    const int unit = in->tiles ? SST_TILE_HEIGHT : LEAST_ROWS;
    enum device_kept map;
    int err = need_view(m, in->ref);

    err = err ? err : sst_gpu_prepare_fastest(m->d->gpu, SST_GPU_SGM_PATH, &m->path);
    for (int i = 0; i < in->count && !err; i++)
        err = need_view(m, in->neighbours[i].desc);
    err = err ? err : upload_penalties(m);
    err = err ? err : disparity_device_keep(m->d, KEPT_MAP, n, sizeof(uint32_t));
    if (m->cfg->cost & SST_COST_CENSUS) {
        err = err ? err : disparity_device_keep(m->d, KEPT_OTHER, most_layers(in) * n, sizeof(uint64_t));
        err = err ? err : make_census(m, in->ref, 1, KEPT_CENSUS, NULL);
    }
    if (!err && m->rounds)
        err = find_arms(m);
    if (err)
        return err;
    /* As few bands as fit. */
    for (m->band = in->height; (err = match_bands(m)) == -ENOMEM && m->band > unit;) {
        drop_volume(m->d);
        m->band = ((m->band + 1) / 2 + unit - 1) / unit * unit;
    }
    err = err ? err : filter(m, &map);
    err = err ? err : store(m, map);
    return err ? err : fetch(m, map);
}

bool disparity_device_match(struct sst_disparity_device *d, const struct device_match *in)
{
    const struct disparity_run *run = in->run;
    const int64_t start_ns = sst_clock_now_ns();
    struct match m = { .d = d, .in = in, .cfg = run->cfg, .width = run->width, .height = run->height };
    int err;

    if (!disparity_device_begin(d)) {
        d->report.on_cpu += in->filter;
        return false;
    }
    if (d->run != run)
        disparity_device_drop_views(d);
    d->run = run;
    m.rounds = run->cfg->support_arm && !run->cfg->raw ? run->cfg->support_before : 0;
    err = match_view(&m);
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    if (err)
        d->report.on_cpu += in->filter;
    if (err == -ENOMEM || err == -ENODATA) { /* the device is not to blame */
        const char *why = err == -ENOMEM ? sst_gpu_error(err) : "features of a view are no longer there";

        if (!*d->report.why)
            sst_log_warning("%s: %s; views are matched on the CPU", d->report.name, why);
        snprintf(d->report.why, sizeof(d->report.why), "%s", why);
    } else if (err) {
        disparity_device_fail(d, err);
    } else {
        sst_runner_succeed(d->shared);
        d->report.views += in->filter;
    }
    disparity_device_end(d);
    return !err;
}
