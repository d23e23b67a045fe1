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

#define RADIUS    (SST_WINDOW / 2)
#define BAND_ROWS 32
#define FLOOR     0.02f /* variance, of 1 over a picture: windows without texture do not agree */
#define ENOUGH    0.7f  /* correlation */

/* Row in work. One thread. */
struct agree_rows {
    int32_t *products;     /* [pairs][width] column sums, and */
    int32_t *sum;          /* [views][2][width]: of levels and of squares */
    float *mean, *inverse; /* [views][width] of windows; 0 without all pixels */
    uint8_t *agreeing;     /* [views][width] */
    uint8_t *whole, *most; /* [width] windows that views see; the largest number that agrees with one */
    int16_t *zero;         /* [width] */
    int *view, views;      /* [views] with pixels in the band, ... */
    bool *all;             /* [views] ... and all of it */
    int64_t pairs;         /* of windows that were compared */
};

/* Rows that column sums are moved on by: `count`, up to row y. */
struct moved {
    int y, count;
    bool lose; /* as many are lost */
};

static int pair_count(int views)
{
    return views * (views - 1) / 2;
}

static bool rows_init(struct agree_rows *r, size_t width, size_t views)
{
    r->products = sst_mem_alloc_raw(width * (size_t)pair_count((int)views), sizeof(*r->products));
    r->sum = sst_mem_alloc_raw(width * 2 * views, sizeof(*r->sum));
    r->mean = sst_mem_alloc_raw(width * 2 * views, sizeof(*r->mean));
    r->agreeing = sst_mem_alloc_raw(width * (views + 2), sizeof(*r->agreeing));
    r->zero = sst_mem_alloc(width, sizeof(*r->zero));
    r->view = calloc(views, sizeof(*r->view));
    r->all = calloc(views, sizeof(*r->all));
    if (!r->view || !r->all || !r->products || !r->sum || !r->mean || !r->agreeing || !r->zero)
        return false;
    r->inverse = r->mean + width * views;
    r->whole = r->agreeing + width * views;
    r->most = r->whole + width;
    return true;
}

static void rows_fini(struct agree_rows *r)
{
    sst_mem_free(r->products);
    sst_mem_free(r->sum);
    sst_mem_free(r->mean);
    sst_mem_free(r->agreeing);
    sst_mem_free(r->zero);
    free(r->view);
    free(r->all);
}

int agree_init(struct agree *agree, const struct sst_virtual *camera, const struct sst_surface *surface,
               const struct greys *greys, int threads)
{
    const size_t pixels = (size_t)camera->width * (size_t)camera->height, views = (size_t)greys->count;
    struct agree a = { .greys = greys, .threads = sst_thread_count(threads) };
    int err = warp_init(&a.warp, camera, surface);

    a.rows = calloc((size_t)a.threads, sizeof(*a.rows));
    a.worker = calloc((size_t)a.threads, sizeof(*a.worker));
    a.level = sst_mem_alloc_raw(pixels * views, sizeof(*a.level));
    a.seen = sst_mem_alloc_raw(pixels * views, sizeof(*a.seen));
    a.pixels = err ? NULL : calloc(views * (size_t)a.warp.bands, sizeof(*a.pixels));
    a.tally = calloc((size_t)camera->height / BAND_ROWS + 1, sizeof(*a.tally));
    if (!err && !(a.rows && a.worker && a.level && a.seen && a.pixels && a.tally))
        err = -ENOMEM;
    for (int i = 0; i < a.threads && !err; i++) {
        err = warp_rows_init(&a.rows[i], &a.warp);
        err = err || rows_init(&a.worker[i], (size_t)camera->width, views) ? err : -ENOMEM;
    }
    if (err)
        agree_fini(&a);
    else
        *agree = a;
    return err;
}

void agree_fini(struct agree *agree)
{
    for (int i = 0; agree->rows && agree->worker && i < agree->threads; i++) {
        warp_rows_fini(&agree->rows[i]);
        rows_fini(&agree->worker[i]);
    }
    free(agree->rows);
    free(agree->worker);
    free(agree->pixels);
    free(agree->tally);
    sst_mem_free(agree->level);
    sst_mem_free(agree->seen);
    warp_fini(&agree->warp);
    *agree = (struct agree){ 0 };
}

/* Levels of all views in the rows of one band of the warp. */
static int sample_band(void *arg, int band, int worker)
{
    struct agree *a = arg;
    const int width = a->warp.camera.width, height = a->warp.camera.height;
    const int count = sst_min_int(WARP_CELL, height - band * WARP_CELL);
    struct warp_rows *rows = &a->rows[worker];

    for (int k = 0; k < a->greys->count; k++) {
        const struct sst_deep *picture = &a->greys->picture[k];
        const struct sst_warped_source from = warp_source(picture);
        const struct warp_view view =
            warp_view_of(&a->warp.camera, &a->greys->camera[k], picture->width, picture->height);
        const size_t at = ((size_t)k * (size_t)height + (size_t)(band * WARP_CELL)) * (size_t)width;
        int pixels = 0;

        warp_band(rows, &a->warp, &view, band);
        for (int r = 0; r < count; r++) {
            for (int i = 0; i < rows->segments[r]; i++)
                pixels += rows->segment[r][i].n;
        }
        if (pixels < count * width) {
            memset(a->level + at, 0, (size_t)(count * width) * sizeof(*a->level));
            memset(a->seen + at, 0, (size_t)(count * width));
        }
        a->pixels[k * a->warp.bands + band] = pixels;
        for (int r = 0; r < count; r++)
            sst_kernels_get()->level_row(a->level + at + (size_t)(r * width), a->seen + at + (size_t)(r * width), &from,
                                         rows->segment[r], (size_t)rows->segments[r]);
    }
    return 0;
}

/* Views that see any pixel of rows from .. to - 1. */
static void choose_views(struct agree_rows *r, const struct agree *a, int from, int to)
{
    r->views = 0;
    for (int k = 0; k < a->greys->count; k++) {
        int pixels = 0, all = 0;

        for (int band = from / WARP_CELL; band * WARP_CELL < to; band++) {
            pixels += a->pixels[k * a->warp.bands + band];
            all += a->warp.camera.width * sst_min_int(WARP_CELL, a->warp.camera.height - band * WARP_CELL);
        }
        r->all[r->views] = pixels == all;
        r->view[r->views] = k;
        r->views += pixels > 0;
    }
}

/* Rows that column sums of a view gain and lose when they are moved to row y. @param zero  the lost row; NULL: the one
 * before the window's */
static void moved_rows(const int16_t *row[2], const struct agree *a, int view, int y, const int16_t *zero)
{
    const ptrdiff_t width = a->warp.camera.width;

    row[0] = a->level + ((ptrdiff_t)view * a->warp.camera.height + y) * width;
    row[1] = zero ? zero : row[0] - SST_WINDOW * width;
}

/* Column sums of a view, and of a pair's products. */
static void move_sums(const struct agree *a, struct agree_rows *r, int i, struct moved rows)
{
    const size_t width = (size_t)a->warp.camera.width;
    int32_t *sum = r->sum + (size_t)i * 2 * width;

    for (int y = rows.y - rows.count + 1; y <= rows.y; y++) {
        const int16_t *row[2];

        moved_rows(row, a, r->view[i], y, rows.lose ? NULL : r->zero);
        sst_kernels_get()->window_squares(sum, sum + width, row, width);
    }
}

static void move_products(int32_t *products, const struct agree *a, const struct agree_rows *r, const int pair[2],
                          struct moved rows)
{
    for (int y = rows.y - rows.count + 1; y <= rows.y; y++) {
        const int16_t *row[2], *other[2];

        moved_rows(row, a, r->view[pair[0]], y, rows.lose ? NULL : r->zero);
        moved_rows(other, a, r->view[pair[1]], y, rows.lose ? NULL : r->zero);
        sst_kernels_get()->window_products(products, row, other, (size_t)a->warp.camera.width);
    }
}

/* Windows with four seen corners. */
static void count_whole(uint8_t *restrict whole, const uint8_t *const seen[2], size_t n)
{
    const uint8_t *restrict a = seen[0], *restrict b = seen[1];

    for (size_t x = 0; x < n; x++)
        whole[x] = (uint8_t)(whole[x] + (a[x] & a[x + 2 * RADIUS] & b[x] & b[x + 2 * RADIUS]));
}

/* Means and spreads of all views' windows around the pixels of row y. */
static void measure_row(const struct agree *a, struct agree_rows *r, int y)
{
    const size_t width = (size_t)a->warp.camera.width, n = width - 2 * RADIUS;
    int all = 0;

    for (int i = 0; i < r->views; i++)
        all += r->all[i];
    memset(r->whole, all, width);
    for (int i = 0; i < r->views; i++) {
        const uint8_t *seen =
            a->seen + ((size_t)r->view[i] * (size_t)a->warp.camera.height + (size_t)(y - RADIUS)) * width;
        const int32_t *sum = r->sum + (size_t)i * 2 * width;
        struct sst_window_sums in = { sum, sum + width, { NULL, NULL }, FLOOR };

        for (size_t k = 0; k < 2 && !r->all[i]; k++)
            in.seen[k] = seen + 2 * RADIUS * width * k;
        sst_kernels_get()->window_stats(r->mean + (size_t)i * width, r->inverse + (size_t)i * width, &in, n);
        if (!r->all[i])
            count_whole(r->whole, in.seen, n);
    }
}

static bool compares(const struct agree *a, int i, int j)
{
    double apart[3];

    for (int k = 0; k < 3; k++)
        apart[k] = a->greys->camera[i].position_mm[k] - a->greys->camera[j].position_mm[k];
    return vector_length(apart) >= a->least_apart_mm;
}

/* Windows of which two views see all, with texture. */
static int64_t count_both(const float *restrict a, const float *restrict b, size_t n)
{
    int64_t sum = 0;

    for (size_t x = 0; x < n; x++)
        sum += a[x] > 0 && b[x] > 0;
    return sum;
}

/* How many other views agree with each view around the pixels of a row, after its column sums were moved on. */
static void compare_row(const struct agree *a, struct agree_rows *r, struct moved rows)
{
    const size_t width = (size_t)a->warp.camera.width;
    int32_t *products = r->products;

    for (int i = 0; i < r->views; i++)
        move_sums(a, r, i, rows);
    measure_row(a, r, rows.y - RADIUS);
    memset(r->agreeing, 0, width * (size_t)a->greys->count);
    for (int i = 0; i < r->views; i++) {
        for (int j = i + 1; j < r->views; j++, products += width) {
            const size_t at[2] = { (size_t)i * width, (size_t)j * width };
            const struct sst_window_pair pair = {
                { r->mean + at[0], r->mean + at[1] }, { r->inverse + at[0], r->inverse + at[1] }, products, ENOUGH
            };

            if (a->least_apart_mm > 0) {
                if (!compares(a, r->view[i], r->view[j]))
                    continue;
                r->pairs += count_both(pair.inverse[0], pair.inverse[1], width - 2 * RADIUS);
            }
            move_products(products, a, r, (const int[2]){ i, j }, rows);
            sst_kernels_get()->window_agree(r->agreeing + at[0], r->agreeing + at[1], &pair, width - 2 * RADIUS);
        }
    }
}

static void keep_most(uint8_t *restrict most, const uint8_t *restrict agreeing, size_t n)
{
    for (size_t x = 0; x < n; x++)
        most[x] = most[x] > agreeing[x] ? most[x] : agreeing[x];
}

static int64_t sum_row(const uint8_t *row, size_t n)
{
    int64_t sum = 0;

    for (size_t x = 0; x < n; x++)
        sum += row[x];
    return sum;
}

/* Counts of one row as a tally. */
static void add_tally(struct agree_tally *tally, int32_t *tile, const struct agree *a, const struct agree_rows *r)
{
    const size_t width = (size_t)a->warp.camera.width;
    const int least = sst_min_int(3, a->greys->count - 1); /* others that agree */
    int32_t score[UINT8_MAX + 1] = { 0 };

    memset(r->most, 0, width);
    for (int i = 0; i < r->views; i++)
        keep_most(r->most, r->agreeing + (size_t)i * width, width);
    for (int most = least; most < a->greys->count; most++) {
        const int cube = (most - least + 1) * (most - least + 1) * (most - least + 1);

        score[most] = cube * cube;
    }
    for (size_t x = 0; x + 2 * RADIUS < width; x++) {
        tally->seen += r->whole[x] > least;
        tally->four += r->most[x] >= least;
        tally->six += r->most[x] >= 5;
        tile[(x + RADIUS) / BAND_ROWS] += score[r->most[x]];
    }
    for (int i = 0; i < r->views && a->least_apart_mm > 0; i++)
        tally->agreeing += sum_row(r->agreeing + (size_t)i * width, width - 2 * RADIUS);
}

static int compare_band(void *arg, int band, int worker)
{
    struct agree *a = arg;
    const int height = a->warp.camera.height, first = sst_max_int(band * BAND_ROWS, RADIUS);
    const int end = sst_min_int((band + 1) * BAND_ROWS, height - RADIUS);
    const size_t width = (size_t)a->warp.camera.width;
    struct agree_rows *r = &a->worker[worker];
    int32_t tile[SST_IMAGE_MAX_SIDE / BAND_ROWS] = { 0 };
    struct agree_tally tally = { 0 };

    if (first < end && width > 2 * RADIUS) {
        memset(r->products, 0, width * (size_t)pair_count(a->greys->count) * sizeof(*r->products));
        memset(r->sum, 0, width * 2 * (size_t)a->greys->count * sizeof(*r->sum));
        choose_views(r, a, first - RADIUS, end + RADIUS);
        r->pairs = 0;
    }
    for (int y = first; y < end && width > 2 * RADIUS; y++) {
        compare_row(a, r, (struct moved){ y + RADIUS, y == first ? SST_WINDOW : 1, y > first });
        add_tally(&tally, tile, a, r);
    }
    for (size_t i = 0; i < ARRAY_LEN(tile); i++)
        tally.spread += sqrt(tile[i]);
    tally.pairs = first < end && width > 2 * RADIUS ? r->pairs : 0;
    tally.agreeing /= 2; /* of both views */
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
    err = err ? err : sst_parallel_for(bands, agree->threads, compare_band, agree);
    for (int i = 0; i < bands && !err; i++) {
        all.seen += agree->tally[i].seen;
        all.four += agree->tally[i].four;
        all.six += agree->tally[i].six;
        all.spread += agree->tally[i].spread;
        all.pairs += agree->tally[i].pairs;
        all.agreeing += agree->tally[i].agreeing;
    }
    if (!err)
        *out = all;
    return err;
}
