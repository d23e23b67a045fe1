/* Matching of one rectified pair. Only the left image has a cost volume: the right one's disparities, which the check
 * needs, are the minima along its diagonals. All steps work on fixed bands of rows or strips of columns, so that the
 * result does not depend on threads. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/method/disparity/stage.h"
#include "pipeline/method/network/network.h"

#define BAND        48 /* rows of a band */
#define STRIP       32 /* columns of a strip */
#define FILTER_HALO 5  /* rows beyond a band that the median (2) and the bilateral filter (3) read */
#define MOST_NETS   2
#define AGREE_Q6    64 /* both images confirm each other within a pixel */

/* What a worker needs for the band or strip in hand. */
struct worker {
    struct sst_volume band;
    struct sst_mem_kept lines, rows;
};

struct pair {
    const struct sst_disparity_config *cfg;
    const struct sst_image *image[2];
    struct sst_network *nets[MOST_NETS];
    int threads, workers;
    struct sst_descriptor desc[2];
    struct sst_neighbour right;
    struct sst_support support;
    struct sst_volume volume; /* of the whole left image */
    uint16_t *upward;         /* with 8 paths: the sums of the sweep upwards */
    struct sst_disparity_sgm_penalties penalties;
    struct worker *worker;                /* [workers] */
    struct sst_map_u16 raw[2], disp[2];   /* of both images, before and after the filters */
    struct sst_map_u8 confidence, status; /* of the left image */
};

static int bands(const struct pair *p)
{
    return (p->volume.height + BAND - 1) / BAND;
}

static int describe_job(void *arg, int index, int worker)
{
    struct pair *p = arg;
    const struct sst_disparity_config *cfg = p->cfg;
    int err = sst_descriptor_init(&p->desc[index], p->image[index], cfg->scale, cfg->cost, p->nets[worker]);

    if (!err && index == 0 && cfg->support_arm)
        err = sst_disparity_support_init(&p->support, &p->desc[0].image, cfg->support_arm, cfg->support_tau);
    if (!err && index == 1)
        err = sst_descriptor_add_phases(&p->desc[1], sst_volume_phases(&p->volume, 1, 0));
    return err;
}

/* Costs and horizontal paths of a band. Rows around it are matched as well, for the support regions to reach into. */
static int band_job(void *arg, int index, int worker)
{
    struct pair *p = arg;
    struct sst_volume *v = &p->volume, *b = &p->worker[worker].band;
    const int y0 = index * BAND, y1 = sst_min_int(y0 + BAND, v->height);
    const int rounds = p->cfg->support_arm ? p->cfg->support_before : 0, halo = rounds * p->cfg->support_arm;
    const int top = sst_max_int(y0 - halo, 0), end = sst_min_int(y1 + halo, v->height);
    const size_t row_cells = v->width_padded * v->steps_padded;
    int err;

    if (p->cfg->cancel && *p->cfg->cancel)
        return -ECANCELED;
    sst_volume_window(b, 0, top, v->width, end - top);
    sst_volume_fill(b, &p->desc[0], &p->right, 1);
    err = sst_disparity_support_aggregate(b, &p->support, rounds);
    for (int y = y0; !err && y < y1; y++) {
        uint8_t *cost = v->cost + (size_t)y * row_cells;

        memcpy(cost, b->cost + (size_t)(y - top) * row_cells, row_cells);
        err = sst_disparity_sgm_row(v, &p->desc[0].image, &p->penalties, y, &p->worker[worker].lines);
    }
    return err;
}

/* Vertical paths of a strip of columns. */
static int strip_job(void *arg, int index, int worker)
{
    struct pair *p = arg;
    const int x0 = index * STRIP;

    return sst_disparity_sgm_columns(&p->volume, &p->desc[0].image, &p->penalties, x0,
                                     sst_min_int(x0 + STRIP, p->volume.width), &p->worker[worker].lines);
}

/* One of both sweeps of 8 paths; the sums of the second one stand apart. */
static int sweep_job(void *arg, int index, int worker)
{
    struct pair *p = arg;
    struct sst_volume v = p->volume;

    if (index)
        v.sum = p->upward;
    return sst_disparity_sgm_slanted(&v, &p->desc[0].image, &p->penalties, index ? -1 : 1, index,
                                     &p->worker[worker].lines);
}

/* Whole-pixel disparities of row y of the right image: for each pixel the cheapest along its diagonal. */
static int match_right(struct pair *p, int y, struct sst_mem_kept *rows)
{
    const struct sst_volume *v = &p->volume;
    const size_t n = (size_t)v->width, nd = v->steps_padded, whole = (size_t)(v->steps - 1) / (size_t)v->divisor + 1;
    const size_t keys = n + whole;
    uint32_t *key = sst_mem_keep(rows, keys + (v->divisor > 1 ? n * nd : 0), sizeof(*key));
    const uint16_t *sum = v->sum + (size_t)y * v->width_padded * nd;
    uint16_t *out = sst_map_u16_row(&p->raw[1], y);

    if (!key)
        return -ENOMEM;
    if (v->divisor > 1) {
        uint16_t *some = (uint16_t *)(key + keys);

        for (size_t x = 0; x < n; x++) {
            for (size_t d = 0; d < whole; d++)
                some[x * nd + d] = sum[x * nd + d * (size_t)v->divisor];
        }
        sum = some;
    }
    memset(key, 0xFF, keys * sizeof(*key));
    sst_kernels_get()->winner_other_row(key, sum, nd, n, whole);
    for (int x = 0; x < v->width; x++) {
        /* Entry n - 1 - xl + d, with xl = x + disp_min + d. */
        const int64_t at = (int64_t)v->width - 1 - x - v->disp_min;

        out[x] = (uint16_t)(at < 0 || at >= (int64_t)keys || key[at] == UINT32_MAX ? SST_DISP_NONE
                                                                                   : 64 * (key[at] & 0xFFFF));
    }
    return 0;
}

static int winner_job(void *arg, int index, int worker)
{
    struct pair *p = arg;
    const int y0 = index * BAND, rows = sst_min_int(BAND, p->volume.height - y0);
    const size_t row_cells = p->volume.width_padded * p->volume.steps_padded;
    struct sst_volume v = p->volume;
    struct sst_map_u16 disp = sst_map_u16_rows(&p->raw[0], y0, rows);
    struct sst_map_u8 confidence = sst_map_u8_rows(&p->confidence, y0, rows);
    int err;

    v.height = rows;
    v.sum += (size_t)y0 * row_cells;
    v.lines = p->worker[worker].lines;
    if (p->upward) {
        const uint16_t *more = p->upward + (size_t)y0 * row_cells;

        for (size_t i = 0; i < (size_t)rows * row_cells; i++)
            v.sum[i] = (uint16_t)(v.sum[i] + more[i]);
    }
    err = sst_volume_winner(&v, false, &disp, &confidence);
    p->worker[worker].lines = v.lines;
    for (int y = y0; !err && y < y0 + rows; y++)
        err = match_right(p, y, &p->worker[worker].rows);
    return err;
}

/* Filter rows y0 .. y1-1 of one map. */
static int filter(struct pair *p, int which, int y0, int y1, struct worker *w)
{
    const struct sst_map_u16 *raw = &p->raw[which];
    const int top = sst_max_int(y0 - FILTER_HALO, 0), end = sst_min_int(y1 + FILTER_HALO, raw->height);
    const struct sst_map_u8 luma = sst_map_u8_rows(&p->desc[which].luma, top, end - top);
    struct sst_map_u16 own = { .width = raw->width, .height = end - top, .stride = raw->stride };
    int err;

    own.data = sst_mem_keep(&w->rows, (size_t)own.height, own.stride);
    if (!own.data)
        return -ENOMEM;
    memcpy(own.data, sst_map_u16_row(raw, top), (size_t)own.height * own.stride);
    err = sst_disparity_median5(&own, &w->lines);
    err = err ? err : sst_disparity_bilateral(&own, &luma, which ? 0 : p->cfg->bilateral_tau);
    if (!err)
        memcpy(sst_map_u16_row(&p->disp[which], y0), sst_map_u16_row(&own, y0 - top), (size_t)(y1 - y0) * own.stride);
    return err;
}

/* Mark the pixels of row y of the left map that the right map does not confirm within one pixel. */
static void check_row(struct pair *p, int y)
{
    const uint16_t *left = sst_map_u16_row(&p->disp[0], y), *right = sst_map_u16_row(&p->disp[1], y);
    uint8_t *status = sst_map_u8_row(&p->status, y);
    const int w = p->volume.width;

    for (int x = 0; x < w; x++) {
        const int xr = x - p->volume.disp_min - (left[x] + 32) / 64;
        const int there = xr >= 0 && xr < w ? right[xr] : (int)SST_DISP_NONE;

        status[x] = there == (int)SST_DISP_NONE || abs(there - left[x]) > AGREE_Q6 ? SST_DISPARITY_OCCLUSION
                                                                                   : SST_DISPARITY_CORRECT;
    }
}

static int filter_job(void *arg, int index, int worker)
{
    struct pair *p = arg;
    const int y0 = index * BAND, y1 = sst_min_int(y0 + BAND, p->volume.height);
    int err = filter(p, 0, y0, y1, &p->worker[worker]);

    err = err ? err : filter(p, 1, y0, y1, &p->worker[worker]);
    for (int y = y0; !err && y < y1; y++)
        check_row(p, y);
    return err;
}

static int optimise(struct pair *p)
{
    const struct sst_volume *v = &p->volume;
    int err = sst_parallel_for(bands(p), p->threads, band_job, p);

    if (err)
        return err;
    if (p->cfg->paths == 4)
        return sst_parallel_for((v->width + STRIP - 1) / STRIP, p->threads, strip_job, p);
    p->upward = sst_mem_alloc_raw(v->width_padded * (size_t)v->height * v->steps_padded, sizeof(uint16_t));
    return p->upward ? sst_parallel_for(2, p->threads, sweep_job, p) : -ENOMEM;
}

static int open_networks(struct pair *p)
{
    const int count = sst_min_int(p->threads, MOST_NETS);
    int err = 0;

    if (!(p->cfg->cost & SST_COST_MCCNN))
        return 0;
    for (int i = 0; !err && i < count; i++)
        err = sst_network_open(&p->nets[i], p->cfg->model, p->cfg->precision, p->threads / count);
    return err ? err : sst_descriptor_check_network(p->nets[0], p->cfg->model, p->volume.width, p->volume.height);
}

static int allocate(struct pair *p)
{
    const struct sst_disparity_config *cfg = p->cfg;
    const int w = (p->image[0]->width + cfg->scale - 1) / cfg->scale;
    const int h = (p->image[0]->height + cfg->scale - 1) / cfg->scale;
    const int disp_min = (int)floor(cfg->disp_min_px / cfg->scale);
    const int range = (int)ceil(cfg->disp_max_px / cfg->scale) - disp_min;
    const int divisor = sst_disparity_divisor(range), steps = range * divisor + 1;
    const int halo = cfg->support_arm * cfg->support_before;
    int err = sst_volume_init(&p->volume, w, h, disp_min, steps);

    p->volume.divisor = divisor;
    p->volume.phase_step = sst_disparity_phase_step(cfg, w, h);
    p->worker = calloc((size_t)p->workers, sizeof(*p->worker));
    if (!p->worker)
        return -ENOMEM;
    for (int i = 0; !err && i < p->workers; i++) {
        err = sst_volume_init(&p->worker[i].band, w, sst_min_int(BAND + 2 * halo, h), disp_min, steps);
        p->worker[i].band.divisor = divisor;
        p->worker[i].band.phase_step = p->volume.phase_step;
    }
    for (int i = 0; i < 2; i++) {
        err = err ? err : sst_map_u16_init(&p->raw[i], w, h);
        err = err ? err : sst_map_u16_init(&p->disp[i], w, h);
    }
    err = err ? err : sst_map_u8_init(&p->status, w, h);
    return err ? err : sst_map_u8_init(&p->confidence, w, h);
}

static void release(struct pair *p)
{
    for (int i = 0; i < 2; i++) {
        sst_descriptor_fini(&p->desc[i]);
        sst_network_close(p->nets[i]);
        sst_map_u16_fini(&p->raw[i]);
        sst_map_u16_fini(&p->disp[i]);
    }
    for (int i = 0; p->worker && i < p->workers; i++) {
        sst_volume_fini(&p->worker[i].band);
        sst_mem_kept_fini(&p->worker[i].lines);
        sst_mem_kept_fini(&p->worker[i].rows);
    }
    free(p->worker);
    sst_disparity_support_fini(&p->support);
    sst_volume_fini(&p->volume);
    sst_mem_free(p->upward);
    sst_map_u8_fini(&p->status);
    sst_map_u8_fini(&p->confidence);
}

static int match(struct pair *p)
{
    int err = allocate(p);

    err = err ? err : open_networks(p);
    err = err ? err : sst_parallel_for(2, p->threads, describe_job, p);
    if (err)
        return err;
    p->right = (struct sst_neighbour){ &p->desc[1], 1, 0 };
    sst_disparity_sgm_penalties_init(&p->penalties, p->cfg);
    err = optimise(p);
    err = err ? err : sst_parallel_for(bands(p), p->threads, winner_job, p);
    err = err ? err : sst_parallel_for(bands(p), p->threads, filter_job, p);
    /* A pixel that the right image does not confirm is hidden there more often than not: all get the background, the
     * farther of the confirmed pixels to both sides. */
    if (!err)
        sst_fill_views(&p->disp[0], &p->status, p->volume.disp_min, NULL, 0, 0, NULL);
    return err;
}

static void deliver(struct sst_map_f32 *out, const struct pair *p)
{
    const int scale = p->cfg->scale;

    for (int y = 0; y < out->height; y++) {
        const uint16_t *d = sst_map_u16_row(&p->disp[0], y / scale);
        float *to = sst_map_f32_row(out, y);

        for (int x = 0; x < out->width; x++) {
            const unsigned at = d[x / scale];

            to[x] = at == SST_DISP_NONE ? INFINITY : (float)(scale * (p->volume.disp_min + (double)at / 64.0));
        }
    }
}

int sst_disparity_pair(struct sst_map_f32 *out, const struct sst_image *left, const struct sst_image *right,
                       const struct sst_disparity_config *cfg)
{
    struct pair p = { .cfg = cfg, .image = { left, right }, .threads = sst_thread_count(cfg->threads) };
    int err;

    p.workers = p.threads;
    err = match(&p);
    err = err ? err : sst_map_f32_init(out, left->width, left->height);
    if (!err)
        deliver(out, &p);
    if (err == -ENOMEM)
        sst_log_error("not enough memory to match %d disparities at %dx%d; use a narrower range", p.volume.steps,
                      p.volume.width, p.volume.height);
    release(&p);
    return err;
}
