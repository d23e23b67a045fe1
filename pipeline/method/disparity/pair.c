/* Matching of one rectified pair, from coarse to fine: the map at a quarter of the size leaves each tile of the cost
 * volume a short range of disparities. Only the left image has a volume: the right one's disparities, which the check
 * needs, are the minima along its diagonals. All steps work on fixed tiles and bands of rows, so that the result does
 * not depend on threads. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/method/disparity/pair_internal.h"
#include "pipeline/method/disparity/visible.h"
#include "pipeline/method/network/network.h"

#define BAND      48 /* rows of a band */
#define MOST_NETS 2
#define SPECK     121 /* pixels, the largest support region: smaller surfaces are false more often than not */
#define AGREE_Q6  48  /* both images confirm each other within it: 3/4 px */

/* What a worker needs for the tile or band in hand. */
struct worker {
    struct sst_volume tile;
    struct sst_mem_kept lines, rows;
};

struct pair {
    const struct sst_disparity_config *cfg;
    const struct sst_image *image[2];
    struct sst_network *nets[MOST_NETS];
    int threads, workers;
    int rows;    /* of the images that a row of the maps stands for: at half size all columns, every other row */
    int smaller; /* times the pixels of the maps are fewer than the input's, per side */
    struct sst_image merged[2];  /* rows merged, or empty */
    struct sst_image quarter[2]; /* a quarter of the size, or empty where there is no coarser match */
    struct sst_descriptor desc[2];
    struct sst_neighbour right;
    struct sst_support support;
    struct sst_volume shape; /* without memory: what the whole image's volume would be */
    struct sst_tiles tiles;
    struct sst_disparity_sgm_penalties penalties;
    struct worker *worker;              /* [workers] */
    struct sst_map_u16 raw[2], disp[2]; /* of both images, before and after the filters */
    struct sst_map_u8 status;           /* of the left image */
};

static int bands(const struct pair *p)
{
    return (p->shape.height + BAND - 1) / BAND;
}

/* Means of two rows each, the last odd one alone. @param out  out, initialised here */
static int merge_rows(struct sst_image *out, const struct sst_image *in)
{
    const int err = sst_image_init(out, in->width, (in->height + 1) / 2);

    for (int i = 0; !err && i < 3 * out->height; i++) {
        const int c = i / out->height, y = i % out->height;
        const uint8_t *restrict a = sst_image_row(in, c, 2 * y);
        const uint8_t *restrict b = sst_image_row(in, c, sst_min_int(2 * y + 1, in->height - 1));
        uint8_t *restrict to = sst_image_row(out, c, y);

        for (int x = 0; x < in->width; x++)
            to[x] = (uint8_t)((a[x] + b[x] + 1) >> 1);
    }
    return err;
}

static bool goes_coarser(const struct pair *p)
{
    return p->cfg->skip_ranges && sst_coarse_pays(&p->shape);
}

static int init_quarter(struct sst_image *out, const struct sst_image *in)
{
    struct sst_image half;
    int err = sst_image_halve(&half, in);

    if (err)
        return err;
    err = sst_image_halve(out, &half);
    sst_image_fini(&half);
    return err;
}

static int describe_job(void *arg, int index, int worker)
{
    struct pair *p = arg;
    const struct sst_disparity_config *cfg = p->cfg;
    const struct sst_image *img = p->rows > 1 ? &p->merged[index] : p->image[index];
    int err = p->rows > 1 ? merge_rows(&p->merged[index], p->image[index]) : 0;

    err = err ? err : sst_descriptor_init(&p->desc[index], img, 1, cfg->cost, p->nets[worker]);
    if (!err && index == 0 && cfg->support_arm)
        err = sst_disparity_support_init(&p->support, &p->desc[0].image, cfg->support_arm, cfg->support_tau, 1);
    if (!err && index == 1)
        err = sst_descriptor_add_phases(&p->desc[1], sst_volume_phases(&p->shape, 1, 0));
    return !err && goes_coarser(p) ? init_quarter(&p->quarter[index], &p->desc[index].image) : err;
}

static int support_rounds(const struct pair *p)
{
    return p->cfg->support_arm ? p->cfg->support_before : 0;
}

/* The index-th row of tiles: each thread has its part of the image, so that two seldom wait for one huge page of the
 * volume, which both would clear. */
static int apart(const struct pair *p, int index)
{
    const int parts = sst_min_int(p->workers, p->tiles.rows), part = index % parts;

    return part * (p->tiles.rows / parts) + sst_min_int(part, p->tiles.rows % parts) + index / parts;
}

/* Costs and horizontal paths of a row of tiles. */
static int row_job(void *arg, int index, int worker)
{
    struct pair *p = arg;
    const int row = apart(p, index);
    const struct sst_tile *t = &p->tiles.tile[(size_t)row * (size_t)p->tiles.columns];
    int err = p->cfg->cancel && *p->cfg->cancel ? -ECANCELED : 0;

    for (int i = 0; !err && i < p->tiles.columns; i++)
        err = sst_tiles_fill(&p->tiles, &t[i], &p->worker[worker].tile, &p->desc[0], &p->right, 1, &p->support,
                             support_rounds(p));
    return err ? err
               : sst_tiles_paths_along(&p->tiles, &p->desc[0].image, &p->penalties, row, &p->worker[worker].lines);
}

/* Vertical paths of a column of tiles. */
static int column_job(void *arg, int index, int worker)
{
    struct pair *p = arg;

    return sst_tiles_paths_down(&p->tiles, &p->desc[0].image, &p->penalties, index, &p->worker[worker].lines);
}

/* Merge the whole-pixel disparities of row y of a tile into the keys of the right image's row: for each pixel the
 * cheapest along its diagonal. @param scratch  elements: tile_keys() */
static void match_right_of(const struct pair *p, const struct sst_tile *t, int y, uint32_t *key, uint32_t *scratch)
{
    const size_t n = (size_t)t->width, divisor = (size_t)p->shape.divisor, whole = (size_t)(t->steps - 1) / divisor + 1;
    const uint16_t *sum = p->tiles.sum + sst_tile_cells(t, y);
    uint32_t *own = key + (p->shape.width - t->x0 - t->width + t->first);
    size_t stride = t->steps_padded;

    if (divisor > 1) {
        uint16_t *some = (uint16_t *)(scratch + n + whole);

        for (size_t x = 0; x < n; x++) {
            for (size_t d = 0; d < whole; d++)
                some[x * whole + d] = sum[x * stride + d * divisor];
        }
        sum = some;
        stride = whole;
    }
    memset(scratch, 0xFF, (n + whole) * sizeof(*scratch));
    sst_kernels_get()->winner_other_row(scratch, sum, stride, n, whole);
    for (size_t i = 0; i < n + whole - 1; i++) {
        const uint32_t k = scratch[i] == UINT32_MAX ? UINT32_MAX : scratch[i] + (uint32_t)t->first;

        own[i] = k < own[i] ? k : own[i];
    }
}

/* Whole-pixel disparities of row y of the right image. */
static int match_right(struct pair *p, const struct sst_tile *row, int y, struct sst_mem_kept *rows)
{
    const size_t w = (size_t)p->shape.width, range = (size_t)(p->shape.steps - 1) / (size_t)p->shape.divisor;
    const size_t keys = w + range + 1, tile_keys = SST_TILE_WIDTH * (range + 2) + range + 1;
    uint32_t *key = sst_mem_keep(rows, keys + tile_keys, sizeof(*key));
    uint16_t *out = sst_map_u16_row(&p->raw[1], y);

    if (!key)
        return -ENOMEM;
    memset(key, 0xFF, keys * sizeof(*key));
    for (int i = 0; i < p->tiles.columns; i++)
        match_right_of(p, &row[i], y, key, key + keys);
    for (int x = 0; x < p->shape.width; x++) {
        /* Entry w - 1 - xl + d, with xl = x + disp_min + d. */
        const int64_t at = (int64_t)w - 1 - x - p->shape.disp_min;

        out[x] = (uint16_t)(at < 0 || at >= (int64_t)keys || key[at] == UINT32_MAX ? SST_DISP_NONE
                                                                                   : 64 * (key[at] & 0xFFFF));
    }
    return 0;
}

static int winner_job(void *arg, int index, int worker)
{
    struct pair *p = arg;
    const struct sst_tile *t = &p->tiles.tile[(size_t)index * (size_t)p->tiles.columns];
    int err = 0;

    for (int i = 0; !err && i < p->tiles.columns; i++)
        err = sst_tiles_winner(&p->tiles, &t[i], &p->raw[0], NULL, &p->worker[worker].lines);
    for (int y = t->y0; !err && y < t->y0 + t->height; y++)
        err = match_right(p, t, y, &p->worker[worker].rows);
    return err;
}

/* Filter rows y0 .. y1-1 of one map. */
static int filter(struct pair *p, int which, int y0, int y1, struct worker *w)
{
    /* At half size the filtered right map confirms fewer of the true disparities. */
    const struct sst_smoothing in = { &p->raw[which], &p->desc[which].luma, !which || p->rows == 1,
                                      which ? 0 : p->cfg->bilateral_tau };

    return sst_disparity_smooth_rows(&p->disp[which], &in, (struct sst_rows){ y0, y1 }, &w->rows, &w->lines);
}

/* Mark the pixels of row y of the left map that the right map does not confirm within one pixel. */
static void check_row(struct pair *p, int y)
{
    const uint16_t *left = sst_map_u16_row(&p->disp[0], y), *right = sst_map_u16_row(&p->disp[1], y);
    uint8_t *status = sst_map_u8_row(&p->status, y);
    const int w = p->shape.width;

    for (int x = 0; x < w; x++) {
        const int xr = x - p->shape.disp_min - (left[x] + 32) / 64;
        const int there = xr >= 0 && xr < w ? right[xr] : (int)SST_DISP_NONE;

        status[x] = there == (int)SST_DISP_NONE || abs(there - left[x]) > AGREE_Q6 ? SST_DISPARITY_OCCLUSION
                                                                                   : SST_DISPARITY_CORRECT;
    }
}

static int filter_job(void *arg, int index, int worker)
{
    struct pair *p = arg;
    const int y0 = index * BAND, y1 = sst_min_int(y0 + BAND, p->shape.height);
    int err = filter(p, 0, y0, y1, &p->worker[worker]);

    err = err ? err : filter(p, 1, y0, y1, &p->worker[worker]);
    for (int y = y0; !err && y < y1; y++)
        check_row(p, y);
    return err;
}

static int open_networks(struct pair *p)
{
    const int count = sst_min_int(p->threads, MOST_NETS);
    int err = 0;

    if (!(p->cfg->cost & SST_COST_MCCNN))
        return 0;
    for (int i = 0; !err && i < count; i++)
        err = sst_network_open(&p->nets[i], p->cfg->model, p->cfg->precision, p->threads / count);
    for (int i = 0; !err && i < count; i++)
        sst_network_use_runner(p->nets[i], p->cfg->networks);
    return err ? err : sst_descriptor_check_network(p->nets[0], p->cfg->model, p->shape.width, p->shape.height);
}

static int allocate(struct pair *p)
{
    const int halo = 2 * SST_TILE_HALO(support_rounds(p)), w = p->shape.width, h = p->shape.height;
    int err = 0;

    p->worker = calloc((size_t)p->workers, sizeof(*p->worker));
    if (!p->worker)
        return -ENOMEM;
    for (int i = 0; !err && i < p->workers; i++) {
        err = sst_volume_init(&p->worker[i].tile, sst_min_int(SST_TILE_WIDTH + halo, w),
                              sst_min_int(SST_TILE_HEIGHT + halo, h), p->shape.disp_min, p->shape.steps);
        p->worker[i].tile.divisor = p->shape.divisor;
        p->worker[i].tile.phase_step = p->shape.phase_step;
    }
    for (int i = 0; i < 2; i++) {
        err = err ? err : sst_map_u16_init(&p->raw[i], w, h);
        err = err ? err : sst_map_u16_init(&p->disp[i], w, h);
    }
    return err ? err : sst_map_u8_init(&p->status, w, h);
}

static void release(struct pair *p)
{
    for (int i = 0; i < 2; i++) {
        sst_image_fini(&p->merged[i]);
        sst_image_fini(&p->quarter[i]);
        sst_descriptor_fini(&p->desc[i]);
        sst_network_close(p->nets[i]);
        sst_map_u16_fini(&p->raw[i]);
        sst_map_u16_fini(&p->disp[i]);
    }
    for (int i = 0; p->worker && i < p->workers; i++) {
        sst_volume_fini(&p->worker[i].tile);
        sst_mem_kept_fini(&p->worker[i].lines);
        sst_mem_kept_fini(&p->worker[i].rows);
    }
    free(p->worker);
    sst_disparity_support_fini(&p->support);
    sst_tiles_fini(&p->tiles);
    sst_map_u8_fini(&p->status);
}

static int match(struct pair *p);

/* Match at a quarter of the size. @param coarse  out, as of match(); the caller releases it */
static int match_coarse(struct pair *coarse, struct sst_disparity_config *cfg, const struct pair *p)
{
    *cfg = (struct sst_disparity_config){ .disp_min_px = floor((double)p->shape.disp_min / SST_COARSER),
                                          .cost = SST_COST_CENSUS,
                                          .paths = 4,
                                          .p1 = p->cfg->p1,
                                          .p2 = p->cfg->p2,
                                          .edge_step = p->cfg->edge_step,
                                          .scale = 1,
                                          .skip_ranges = true,
                                          .cancel = p->cfg->cancel };
    cfg->disp_max_px = ceil((p->shape.disp_min + (double)(p->shape.steps - 1) / p->shape.divisor) / SST_COARSER);
    *coarse = (struct pair){ .cfg = cfg,
                             .image = { &p->quarter[0], &p->quarter[1] },
                             .threads = p->threads,
                             .workers = p->workers,
                             .rows = 1,
                             .smaller = SST_COARSER * p->smaller };
    return match(coarse);
}

static int lay_out_tiles(struct pair *p)
{
    struct pair coarse = { 0 };
    struct sst_disparity_config cfg;
    const bool coarser = goes_coarser(p);
    int err = coarser ? match_coarse(&coarse, &cfg, p) : 0;

    if (!err)
        err = sst_tiles_init(&p->tiles, p->shape.width, 0, p->shape.height, &p->shape,
                             coarser ? &(struct sst_coarse){ &coarse.disp[0], coarse.shape.disp_min, SST_COARSER }
                                     : NULL);
    release(&coarse);
    return err;
}

/* Rows of a job. */
static struct sst_rows band_of(const struct pair *p, int index)
{
    return (struct sst_rows){ index * BAND, sst_min_int((index + 1) * BAND, p->shape.height) };
}

static int alike_job(void *arg, int index, int worker)
{
    struct pair *p = arg;

    return pair_fill_alike(&p->disp[0], &p->status, &p->desc[0].image, band_of(p, index), &p->worker[worker].rows);
}

static int median_job(void *arg, int index, int worker)
{
    struct pair *p = arg;

    return pair_guided_median(&p->raw[0], &p->disp[0], &p->desc[0].image, band_of(p, index), &p->worker[worker].rows);
}

/* Edges and holes by the image's colours. */
static int follow_colours(struct pair *p)
{
    int err = p->cfg->guided_holes ? sst_parallel_for(bands(p), p->threads, alike_job, p) : 0;

    for (int i = 0; !err && i < p->cfg->guided_rounds; i++) {
        const struct sst_map_u16 last = p->disp[0];

        err = sst_parallel_for(bands(p), p->threads, median_job, p);
        p->disp[0] = p->raw[0];
        p->raw[0] = last;
    }
    return err;
}

/* A pixel that the right image does not confirm is hidden there more often than not: all get the background, the
 * farther of the confirmed pixels to both sides. */
static int fill(struct pair *p)
{
    int err = pair_drop_specks(&p->status, &p->disp[0], SPECK / (p->smaller * p->smaller * p->rows), p->threads);

    err = err ? err
              : pair_extend_margins(&p->disp[0], &p->status, p->shape.disp_min, (p->shape.steps - 1) / p->shape.divisor,
                                    p->threads);
    if (err)
        return err;
    sst_fill_views(&p->disp[0], &p->status, &(struct sst_checked_views){ .count = 0 }, NULL);
    return 0;
}

static void set_shape(struct pair *p)
{
    const struct sst_disparity_config *cfg = p->cfg;
    const int disp_min = (int)floor(cfg->disp_min_px), range = (int)ceil(cfg->disp_max_px) - disp_min;
    /* Coarse maps need no finer steps. */
    const int divisor = p->smaller > 1 || p->rows > 1 ? 1 : sst_disparity_divisor(range);

    p->shape = (struct sst_volume){ .width = p->image[0]->width,
                                    .height = (p->image[0]->height + p->rows - 1) / p->rows,
                                    .disp_min = disp_min,
                                    .steps = range * divisor + 1,
                                    .divisor = divisor };
    p->shape.phase_step = sst_disparity_phase_step(cfg, p->shape.width, p->shape.height);
}

static int match(struct pair *p)
{
    int err;

    set_shape(p);
    err = allocate(p);
    err = err ? err : open_networks(p);
    err = err ? err : sst_parallel_for(2, p->threads, describe_job, p);
    err = err ? err : lay_out_tiles(p);
    if (err)
        return err;
    p->right = (struct sst_neighbour){ &p->desc[1], 1, 0 };
    sst_disparity_sgm_penalties_init(&p->penalties, p->cfg);
    err = sst_parallel_for(p->tiles.rows, p->threads, row_job, p);
    err = err ? err : sst_parallel_for(p->tiles.columns, p->threads, column_job, p);
    err = err ? err : sst_parallel_for(p->tiles.rows, p->threads, winner_job, p);
    err = err ? err : sst_parallel_for(bands(p), p->threads, filter_job, p);
    err = err ? err : fill(p);
    return err ? err : follow_colours(p);
}

/* A disparity between two rows of the map: the nearer row's, or between both where they are of one surface. */
static unsigned between(unsigned near, unsigned far)
{
    return near == SST_DISP_NONE || far == SST_DISP_NONE || abs((int)near - (int)far) > 64 ? near
                                                                                           : (3 * near + far + 2) / 4;
}

/* The map that the caller gets. */
struct delivery {
    struct sst_map_f32 *out;
    const struct pair *p;
};

static int deliver_job(void *arg, int index, int worker)
{
    const struct delivery *to = arg;
    const struct pair *p = to->p;
    const int y0 = index * BAND, y1 = sst_min_int(y0 + BAND, to->out->height);

    (void)worker;
    for (int y = y0; y < y1; y++) {
        const int own = y / p->rows, other = p->rows > 1 ? own + (y % 2 ? 1 : -1) : own;
        const uint16_t *near = sst_map_u16_row(&p->disp[0], own);
        const uint16_t *far = sst_map_u16_row(&p->disp[0], sst_clamp_int(other, 0, p->disp[0].height - 1));
        float *row = sst_map_f32_row(to->out, y);

        for (int x = 0; x < to->out->width; x++) {
            const unsigned at = between(near[x], far[x]);

            row[x] = at == SST_DISP_NONE ? INFINITY : (float)(p->shape.disp_min + (double)at / 64.0);
        }
    }
    return 0;
}

int pair_disparities(struct sst_map_f32 *out, const struct sst_image *left, const struct sst_image *right,
                     const struct sst_disparity_config *cfg)
{
    struct pair p = { .cfg = cfg,
                      .image = { left, right },
                      .threads = sst_thread_count(cfg->threads),
                      .rows = cfg->scale,
                      .smaller = 1 };
    int err;

    p.workers = p.threads;
    err = match(&p);
    err = err ? err : sst_map_f32_init(out, left->width, left->height);
    if (!err)
        err = sst_parallel_for((out->height + BAND - 1) / BAND, p.threads, deliver_job, &(struct delivery){ out, &p });
    if (err == -ENOMEM)
        sst_log_error("not enough memory to match %d disparities at %dx%d; use a narrower range", p.shape.steps,
                      p.shape.width, p.shape.height);
    release(&p);
    return err;
}
