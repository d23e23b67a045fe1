/* Agreement of views on a surface: in each pixel, the number of views with highly correlated 7x7 pixels. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/posed/surface_internal.h"

#define RADIUS    3
#define AREA      49
#define BAND_ROWS 32
#define FLOOR     0.02f /* variance, of 1 over a picture: windows without texture do not agree */
#define ENOUGH    0.7f  /* correlation */

int agree_init(struct agree *agree, const struct sst_virtual *camera, const struct sst_surface *surface,
               const struct greys *greys, int threads)
{
    const size_t pixels = (size_t)camera->width * (size_t)camera->height, views = (size_t)greys->count;
    struct agree a = { .greys = greys, .threads = sst_thread_count(threads) };
    const size_t width = (size_t)camera->width, each = (size_t)a.threads;
    int err = warp_init(&a.warp, camera, surface);

    a.rows = calloc(each, sizeof(*a.rows));
    a.level = sst_mem_alloc_raw(pixels * views, sizeof(*a.level));
    a.mean = sst_mem_alloc_raw(pixels * views, sizeof(*a.mean));
    a.inverse = sst_mem_alloc_raw(pixels * views, sizeof(*a.inverse));
    a.seen = sst_mem_alloc_raw(pixels * views, sizeof(*a.seen));
    a.sum = sst_mem_alloc_raw(each * width, sizeof(*a.sum));
    a.count = sst_mem_alloc_raw(each * width, sizeof(*a.count));
    a.column = sst_mem_alloc_raw(each * width * views * views, sizeof(*a.column));
    a.agreeing = sst_mem_alloc_raw(each * width * views, sizeof(*a.agreeing));
    a.tally = calloc((size_t)camera->height / BAND_ROWS + 1, sizeof(*a.tally));
    if (!err &&
        !(a.rows && a.level && a.mean && a.inverse && a.seen && a.sum && a.count && a.column && a.agreeing && a.tally))
        err = -ENOMEM;
    for (int i = 0; i < a.threads && !err; i++)
        err = warp_rows_init(&a.rows[i], &a.warp);
    if (err)
        agree_fini(&a);
    else
        *agree = a;
    return err;
}

void agree_fini(struct agree *agree)
{
    for (int i = 0; agree->rows && i < agree->threads; i++)
        warp_rows_fini(&agree->rows[i]);
    free(agree->rows);
    free(agree->tally);
    sst_mem_free(agree->level);
    sst_mem_free(agree->mean);
    sst_mem_free(agree->inverse);
    sst_mem_free(agree->seen);
    sst_mem_free(agree->sum);
    sst_mem_free(agree->count);
    sst_mem_free(agree->column);
    sst_mem_free(agree->agreeing);
    warp_fini(&agree->warp);
    *agree = (struct agree){ 0 };
}

/* Levels of all views in the rows of one band of the warp, in standard deviations of each picture. */
static int sample_band(void *arg, int band, int worker)
{
    struct agree *a = arg;
    const struct sst_kernels *kernels = sst_kernels_get();
    const int width = a->warp.camera.width, height = a->warp.camera.height;
    uint32_t *sum = a->sum + (size_t)worker * (size_t)width;
    uint16_t *count = a->count + (size_t)worker * (size_t)width;
    struct warp_rows *rows = &a->rows[worker];

    for (int k = 0; k < a->greys->count; k++) {
        const struct sst_deep *picture = &a->greys->picture[k];
        const struct sst_warped_source from = warp_source(picture);
        const struct warp_view view =
            warp_view_of(&a->warp.camera, &a->greys->camera[k], picture->width, picture->height);

        warp_band(rows, &a->warp, &view, band);
        for (int r = 0; r < WARP_CELL && band * WARP_CELL + r < height; r++) {
            const size_t at = ((size_t)k * (size_t)height + (size_t)(band * WARP_CELL + r)) * (size_t)width;

            memset(sum, 0, (size_t)width * sizeof(*sum));
            memset(count, 0, (size_t)width * sizeof(*count));
            kernels->warped_row((uint32_t *const[3]){ sum }, count, &from, rows->segment[r], (size_t)rows->segments[r]);
            for (int x = 0; x < width; x++) {
                const float level = (float)(int32_t)(sum[x] - (32768u << SST_WARPED_SHIFT));

                a->level[at + (size_t)x] = count[x] ? level * (1.0f / (GREY_SPREAD << SST_WARPED_SHIFT)) : 0;
                a->seen[at + (size_t)x] = (uint8_t)count[x];
            }
        }
    }
    return 0;
}

/* out[x] = sum of in[x - RADIUS .. x + RADIUS], for RADIUS <= x < width - RADIUS. */
static void sum_across(float *restrict out, const float *restrict in, int width)
{
    for (int x = RADIUS; x < width - RADIUS; x++)
        out[x] = in[x - 3] + in[x - 2] + in[x - 1] + in[x] + in[x + 1] + in[x + 2] + in[x + 3];
}

/* Mean and 1 / standard deviation of the windows of a row, of all views; 0 where a window is not wholly seen. */
static int window_row(void *arg, int y, int worker)
{
    struct agree *a = arg;
    const int width = a->warp.camera.width, height = a->warp.camera.height;
    float *column = a->column + (size_t)worker * (size_t)width * (size_t)(a->greys->count * a->greys->count);

    for (int k = 0; k < a->greys->count; k++) {
        const size_t at = ((size_t)k * (size_t)height + (size_t)y) * (size_t)width;
        float *squares = column + width;
        uint16_t *whole = a->count + (size_t)worker * (size_t)width;
        int run = 0;

        memset(a->inverse + at, 0, (size_t)width * sizeof(*a->inverse));
        memset(a->mean + at, 0, (size_t)width * sizeof(*a->mean));
        if (y < RADIUS || y >= height - RADIUS)
            continue;
        memset(column, 0, 2 * (size_t)width * sizeof(*column));
        memset(whole, 0, (size_t)width * sizeof(*whole));
        for (int dy = -RADIUS; dy <= RADIUS; dy++) {
            const float *level = a->level + at + dy * (ptrdiff_t)width;
            const uint8_t *seen = a->seen + at + dy * (ptrdiff_t)width;

            for (int x = 0; x < width; x++) {
                column[x] += level[x];
                squares[x] += level[x] * level[x];
                whole[x] = (uint16_t)(whole[x] + seen[x]);
            }
        }
        for (int x = 0; x < width; x++) {
            float sum = 0, square = 0;

            run = whole[x] == 2 * RADIUS + 1 ? run + 1 : 0;
            if (run < 2 * RADIUS + 1)
                continue;
            for (int i = x - 2 * RADIUS; i <= x; i++) {
                sum += column[i];
                square += squares[i];
            }
            sum /= AREA;
            a->mean[at + (size_t)(x - RADIUS)] = sum;
            a->inverse[at + (size_t)(x - RADIUS)] = 1 / sqrtf(fmaxf(square / AREA - sum * sum, 0) + FLOOR);
        }
    }
    return 0;
}

/* Pixels at which the windows of two views agree, added to the counts of both. */
static void compare_row(uint8_t *restrict first, uint8_t *restrict second, const struct agree *a, const float *across,
                        const size_t at[2])
{
    const float *mean[2] = { a->mean + at[0], a->mean + at[1] };
    const float *inverse[2] = { a->inverse + at[0], a->inverse + at[1] };

    for (int x = RADIUS; x < a->warp.camera.width - RADIUS; x++) {
        const float both = across[x] * (1.0f / AREA) - mean[0][x] * mean[1][x];
        const uint8_t agrees = both * inverse[0][x] * inverse[1][x] > ENOUGH;

        first[x] = (uint8_t)(first[x] + agrees);
        second[x] = (uint8_t)(second[x] + agrees);
    }
}

/* Column sums of the products of two views, moved from row y - 1 to row y. */
static void move_column(float *restrict column, const struct agree *a, const size_t at[2], bool fresh)
{
    const int width = a->warp.camera.width;
    const ptrdiff_t reach = RADIUS * (ptrdiff_t)width;

    if (fresh) {
        memset(column, 0, (size_t)width * sizeof(*column));
        for (ptrdiff_t from = -reach; from <= reach; from += width) {
            const float *p = a->level + at[0] + from, *q = a->level + at[1] + from;

            for (int x = 0; x < width; x++)
                column[x] += p[x] * q[x];
        }
    } else {
        const float *p = a->level + at[0] + reach, *q = a->level + at[1] + reach;
        const float *old_p = a->level + at[0] - reach - width, *old_q = a->level + at[1] - reach - width;

        for (int x = 0; x < width; x++)
            column[x] += p[x] * q[x] - old_p[x] * old_q[x];
    }
}

/* Counts of one row as a tally. */
static void add_tally(struct agree_tally *tally, int32_t *tile, const struct agree *a, const uint8_t *agreeing,
                      size_t y)
{
    const size_t width = (size_t)a->warp.camera.width, plane = width * (size_t)a->warp.camera.height;
    const int least = sst_min_int(3, a->greys->count - 1); /* others that agree */

    for (size_t x = RADIUS; x + RADIUS < width; x++) {
        int seen = 0, most = 0;

        for (int k = 0; k < a->greys->count; k++) {
            seen += a->inverse[(size_t)k * plane + y * width + x] > 0;
            most = sst_max_int(most, agreeing[(size_t)k * width + x]);
        }
        tally->seen += seen > least;
        tally->four += most >= least;
        tally->six += most >= 5;
        most = most >= least ? (most - least + 1) * (most - least + 1) * (most - least + 1) : 0;
        tile[x / BAND_ROWS] += most * most;
    }
}

static int compare_band(void *arg, int band, int worker)
{
    struct agree *a = arg;
    const int n = a->greys->count;
    const size_t width = (size_t)a->warp.camera.width, height = (size_t)a->warp.camera.height;
    float *column = a->column + (size_t)worker * width * (size_t)(n * n);
    float *across = column + (size_t)(n * n - 1) * width; /* fewer than n * n - 1 pairs: the last is free */
    uint8_t *agreeing = a->agreeing + (size_t)worker * width * (size_t)n;
    const size_t first = sst_max_int(band * BAND_ROWS, RADIUS);
    int32_t tile[SST_IMAGE_MAX_SIDE / BAND_ROWS] = { 0 };
    struct agree_tally tally = { 0 };

    for (size_t y = first; y < (size_t)(band + 1) * BAND_ROWS && y + RADIUS < height; y++) {
        memset(agreeing, 0, width * (size_t)n);
        for (int i = 0, pair = 0; i < n; i++) {
            for (int j = i + 1; j < n; j++, pair++) {
                const size_t at[2] = { ((size_t)i * height + y) * width, ((size_t)j * height + y) * width };

                move_column(column + (size_t)pair * width, a, at, y == first);
                sum_across(across, column + (size_t)pair * width, (int)width);
                compare_row(agreeing + (size_t)i * width, agreeing + (size_t)j * width, a, across, at);
            }
        }
        add_tally(&tally, tile, a, agreeing, y);
    }
    for (size_t i = 0; i < ARRAY_LEN(tile); i++)
        tally.spread += sqrt(tile[i]);
    a->tally[band] = tally;
    return 0;
}

int agree_on(struct agree_tally *out, struct agree *agree, const struct sst_surface *surface)
{
    const int height = agree->warp.camera.height, bands = height / BAND_ROWS + 1;
    struct agree_tally all = { 0 };
    int err;

    warp_restart(&agree->warp, surface);
    err = sst_parallel_for(agree->warp.bands, agree->threads, sample_band, agree);
    err = err ? err : sst_parallel_for(height, agree->threads, window_row, agree);
    err = err ? err : sst_parallel_for(bands, agree->threads, compare_band, agree);
    for (int i = 0; i < bands && !err; i++) {
        all.seen += agree->tally[i].seen;
        all.four += agree->tally[i].four;
        all.six += agree->tally[i].six;
        all.spread += agree->tally[i].spread;
    }
    if (!err)
        *out = all;
    return err;
}
