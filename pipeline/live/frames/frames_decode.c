/* Steps 2 and 3: decode and rectify the changed tiles. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/live/frames/frames_internal.h"

#define MOST_PARTS  8 /* of a frame that are decoded by themselves */
#define PART_TILES  4 /* tiles that can be decoded while a part is prepared */
#define BLOCKS_MOST (SST_IMAGE_MAX_SIDE / SST_LIVE_TILE * SST_LIVE_BLOCKS)

/* --- decoding ----------------------------------------------------------------------------------------------------- */

/* Split the pixels of a run of tiles into colour planes. @param pixels  of the part */
static void unpack(struct sst_image *image, const struct sst_rect *part, const uint8_t *pixels, size_t stride)
{
    const int x0 = part->x0, y0 = part->y0;

    for (int y = y0; y < part->y1; y++) {
        uint8_t *const row[3] = { sst_image_row(image, 0, y) + x0, sst_image_row(image, 1, y) + x0,
                                  sst_image_row(image, 2, y) + x0 };

        sst_kernels_get()->split_row(row, pixels + (size_t)(y - y0) * stride, (size_t)(part->x1 - x0));
    }
}

/* Copy the dirty tiles of a part that begins and ends at borders of tiles. */
static void store_part(struct sst_liveframes *f, int k, const struct decoder_part *p)
{
    const int left = p->box[0] / SST_LIVE_TILE, right = (p->box[2] + SST_LIVE_TILE - 1) / SST_LIVE_TILE;
    struct live_view *v = &f->view[k];

    for (int y0 = p->box[1]; y0 < p->box[3]; y0 += SST_LIVE_TILE) {
        const uint8_t *dirty = v->dirty + (size_t)(y0 / SST_LIVE_TILE) * (size_t)f->raw_cols;
        const int y1 = sst_min_int(y0 + SST_LIVE_TILE, p->box[3]);

        for (int col = left, end; col < right; col = end + 1) {
            const int x0 = col * SST_LIVE_TILE;
            const uint8_t *from = p->pixels + (size_t)(y0 - p->box[1]) * p->stride + 4 * (size_t)(x0 - p->box[0]);
            struct sst_rect run = { x0, y0, 0, y1 };

            for (end = col; end < right && dirty[end];)
                end++;
            run.x1 = sst_min_int(end * SST_LIVE_TILE, f->cfg->width);
            if (end == col)
                continue;
            if (v->sampler)
                sst_sampler_put(v->sampler, &run, from, p->stride);
            else
                unpack(&f->lf->views[k].image, &run, from, p->stride);
        }
    }
}

/* Bounds of the dirty tiles, px. */
static void bounds(const struct sst_liveframes *f, const struct live_view *v, int box[4])
{
    int low[2] = { f->raw_cols, f->raw_rows }, high[2] = { 0, 0 };

    for (int t = 0; t < raw_tiles(f); t++) {
        const int at[2] = { t % f->raw_cols, t / f->raw_cols };

        for (int i = 0; v->dirty[t] && i < 2; i++) {
            low[i] = sst_min_int(low[i], at[i]);
            high[i] = sst_max_int(high[i], at[i] + 1);
        }
    }
    box[0] = low[0] * SST_LIVE_TILE;
    box[1] = low[1] * SST_LIVE_TILE;
    box[2] = sst_min_int(high[0] * SST_LIVE_TILE, f->cfg->width);
    box[3] = sst_min_int(high[1] * SST_LIVE_TILE, f->cfg->height);
}

/* Rectangles of tiles, which cover the dirty ones. */
struct parts {
    int count, box[MOST_PARTS][4]; /* tiles: left, top, right, bottom */
};

/* Add a run of dirty tiles: to the rectangle that ends above it, else as a new one. @return false: too many */
static bool add_run(struct parts *p, int x0, int x1, int y)
{
    for (int i = 0; i < p->count; i++) {
        int *box = p->box[i];

        if (box[3] < y || x0 >= box[2] || x1 <= box[0])
            continue;
        box[0] = sst_min_int(box[0], x0);
        box[2] = sst_max_int(box[2], x1);
        box[3] = y + 1;
        return true;
    }
    if (p->count == MOST_PARTS)
        return false;
    memcpy(p->box[p->count++], (const int[4]){ x0, y, x1, y + 1 }, sizeof(p->box[0]));
    return true;
}

/* Parts that are cheaper to decode than everything between them. */
static bool find_parts(const struct sst_liveframes *f, const struct live_view *v, struct parts *p)
{
    int first = f->raw_rows, last = 0, area = 0;

    p->count = 0;
    for (int row = 0; row < f->raw_rows; row++) {
        const uint8_t *dirty = v->dirty + (size_t)row * (size_t)f->raw_cols;

        for (int col = 0, end; col < f->raw_cols; col = end + 1) {
            for (end = col; end < f->raw_cols && dirty[end]; end++)
                ;
            if (end == col)
                continue;
            if (!add_run(p, col, end, row))
                return false;
            first = sst_min_int(first, row);
            last = row + 1;
        }
    }
    for (int i = 0; i < p->count; i++)
        area += (p->box[i][2] - p->box[i][0] + 1) * (p->box[i][3] - p->box[i][1]) + PART_TILES;
    return area < (last - first) * f->raw_cols;
}

/* Decode the dirty tiles by parts. @return their number; or -ENOTSUP (decode the tiles between, too), -EBADMSG */
static int decode_parts(struct sst_liveframes *f, int k, struct decoder *d, struct decoder_part part[MOST_PARTS])
{
    struct live_view *v = &f->view[k];
    const struct decoder_frame frame = frame_of(f, k);
    struct parts p;
    int err = v->index.valid && find_parts(f, v, &p) ? 0 : -ENOTSUP;

    for (int i = 0; !err && i < p.count; i++) {
        part[i] = (struct decoder_part){ .box = { p.box[i][0] * SST_LIVE_TILE, p.box[i][1] * SST_LIVE_TILE,
                                                  sst_min_int(p.box[i][2] * SST_LIVE_TILE, f->cfg->width),
                                                  sst_min_int(p.box[i][3] * SST_LIVE_TILE, f->cfg->height) } };
    }
    err = err ? err : decoder_decode_parts(d, &frame, &v->index, part, p.count);
    return err ? err : p.count;
}

/* Decode the smallest rectangle that has all dirty tiles. @return 1; or as decoder_decode() */
static int decode_all(struct sst_liveframes *f, int k, struct decoder *d, struct decoder_part *part)
{
    const struct decoder_frame frame = frame_of(f, k);
    const int *box = part->box;
    int err;

    bounds(f, &f->view[k], part->box);
    err = decoder_decode(d, &frame, (struct sst_rect){ box[0], box[1], box[2], box[3] }, &part->pixels, &part->stride);
    if (err)
        return err;
    part->pixels += (size_t)box[1] * part->stride + 4 * (size_t)box[0];
    return 1;
}

static int decode(void *arg, int index, int worker)
{
    struct sst_liveframes *f = arg;
    const int k = f->list[index];
    struct live_view *v = &f->view[k];
    struct decoder *d = f->decoder[worker];
    struct decoder_part part[MOST_PARTS];
    int parts;

    if (atomic_load(&f->cancelled))
        return -ECANCELED;
    parts = decode_parts(f, k, d, part);
    if (parts < 0)
        parts = decode_all(f, k, d, part);
    if (parts == -EBADMSG) {
        frames_reject(v, d);
        return 0;
    }
    if (parts < 0)
        return parts;
    for (int i = 0; i < parts; i++)
        store_part(f, k, &part[i]);
    if (f->cfg->skip_change)
        detector_accept(&v->watch, v->dirty);
    v->decoded = v->made = true;
    return 0;
}

static int dirty_views(struct sst_liveframes *f)
{
    int n = 0;

    for (int k = 0; k < f->views; k++) {
        if (f->view[k].verdict.changed)
            f->list[n++] = k;
    }
    return n;
}

int frames_decode(struct sst_liveframes *f)
{
    return sst_parallel_for(dirty_views(f), f->threads, decode, f);
}

/* --- rectifying --------------------------------------------------------------------------------------------------- */

static bool any_dirty(const struct sst_liveframes *f, const uint8_t *dirty, const struct from *from)
{
    for (int row = from->tile[1]; row < from->tile[3]; row++) {
        if (memchr(dirty + (size_t)row * (size_t)f->raw_cols + from->tile[0], 1,
                   (size_t)(from->tile[2] - from->tile[0])))
            return true;
    }
    return false;
}

void frames_mark(const struct sst_liveframes *f, int k, const uint8_t *dirty, uint8_t *map)
{
    const struct from *from = f->view[k].from;

    if (!from) {
        memcpy(map, dirty, (size_t)raw_tiles(f));
        return;
    }
    for (int t = 0; t < f->cols * f->rows; t++)
        map[t] = any_dirty(f, dirty, &from[t]);
}

/* Changed blocks of a row of blocks. @param map  changed tiles of their row */
static void find_blocks(const struct sst_liveframes *f, const struct live_view *v, int row, const uint8_t *map,
                        uint8_t *block)
{
    for (int col = 0; col < f->cols; col++) {
        const struct from *from = v->block +
                                  (size_t)(row / SST_LIVE_BLOCKS * f->cols + col) * SST_LIVE_BLOCKS * SST_LIVE_BLOCKS +
                                  row % SST_LIVE_BLOCKS * SST_LIVE_BLOCKS;

        for (int i = 0; i < SST_LIVE_BLOCKS; i++)
            block[col * SST_LIVE_BLOCKS + i] = map[col] && any_dirty(f, v->dirty, &from[i]);
    }
}

/* Runs of changed blocks, row by row of pixels. */
static void rectify_row(struct sst_liveframes *f, int k, int row, const uint8_t *map)
{
    const int side = SST_LIVE_TILE / SST_LIVE_BLOCKS, blocks = f->cols * SST_LIVE_BLOCKS;
    const struct sst_image *image = &f->lf->views[k].image;
    const int y1 = sst_min_int((row + 1) * side, image->height);
    uint8_t block[BLOCKS_MOST];

    find_blocks(f, &f->view[k], row, map, block);
    for (int col = 0, end; col < blocks; col = end + 1) {
        for (end = col; end < blocks && block[end] && (end - col + 1) * side <= SST_SAMPLE_MAX;)
            end++;
        for (int y = row * side; end > col && y < y1; y++) {
            const int x = col * side, n = sst_min_int(end * side, image->width) - x;
            uint8_t *const out[3] = { sst_image_row(image, 0, y) + x, sst_image_row(image, 1, y) + x,
                                      sst_image_row(image, 2, y) + x };

            sst_sampler_row(f->view[k].sampler, &(struct sst_rectified_row){ x, y, n }, out, NULL);
        }
        if (end > col)
            end--;
    }
}

static int rectify(void *arg, int index, int worker SST_UNUSED)
{
    struct sst_liveframes *f = arg;
    const int k = f->list[index];
    const struct live_view *v = &f->view[k];
    uint8_t *map = f->changes->map[k];

    if (atomic_load(&f->cancelled))
        return -ECANCELED;
    frames_mark(f, k, v->dirty, map);
    for (int row = 0; v->sampler && row < f->rows * SST_LIVE_BLOCKS; row++)
        rectify_row(f, k, row, map + (size_t)(row / SST_LIVE_BLOCKS) * (size_t)f->cols);
    return 0;
}

static int decoded_views(struct sst_liveframes *f)
{
    int n = 0;

    for (int k = 0; k < f->views; k++) {
        if (f->view[k].decoded)
            f->list[n++] = k;
    }
    return n;
}

int frames_rectify(struct sst_liveframes *f)
{
    const int n = decoded_views(f);

    /* Without a calibration only changes are noted. */
    return sst_parallel_for(n, f->cfg->calibration ? f->threads : 1, rectify, f);
}

/* --- error of skipping -------------------------------------------------------------------------------------------- */

static double difference(const struct sst_liveframes *f, int k, const uint8_t *pixels, size_t stride)
{
    const struct live_view *v = &f->view[k];
    const struct sst_image *image = &f->lf->views[k].image;
    size_t kept_stride = 0;
    const uint8_t *kept = v->sampler ? sst_sampler_pixels(v->sampler, &kept_stride) : NULL;
    int64_t sum = 0, n = 0;

    for (int y = 0; y < f->cfg->height; y++) {
        const uint8_t *dirty = v->dirty + (size_t)(y / SST_LIVE_TILE) * (size_t)f->raw_cols;
        const uint8_t *now = pixels + (size_t)y * stride;

        for (int x = 0; x < f->cfg->width; x++) {
            if (dirty[x / SST_LIVE_TILE])
                continue;
            for (int c = 0; c < 3; c++) {
                const int was =
                    kept ? kept[(size_t)y * kept_stride + (size_t)(4 * x + c)] : sst_image_row(image, c, y)[x];

                sum += abs(now[4 * x + c] - was);
            }
            n += 3;
        }
    }
    return n ? (double)sum / (double)n : NAN;
}

/* Decode one view with skipped tiles, and compare. */
double frames_sample_error(struct sst_liveframes *f)
{
    const int first = (int)(f->in->set / SST_LIVE_SAMPLE_SETS % (uint64_t)f->views);

    for (int i = 0; i < f->views; i++) {
        const int k = (first + i) % f->views;
        const struct live_view *v = &f->view[k];
        const struct decoder_frame frame = frame_of(f, k);
        const uint8_t *pixels;
        size_t stride;

        if (!has_frame(f, k) || !v->made || v->refused || v->verdict.changed == raw_tiles(f))
            continue;
        if (decoder_decode(f->decoder[0], &frame, (struct sst_rect){ 0, 0, f->cfg->width, f->cfg->height }, &pixels,
                           &stride))
            return NAN;
        return difference(f, k, pixels, stride);
    }
    return NAN;
}
