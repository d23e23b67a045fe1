/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/labels/labels_internal.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"

/* Output sample i is the sum of weight[k] * in[first + k] for k in 0 .. n-1. */
struct tap {
    int first, n;
    float *weight;
};

struct job {
    const struct resampled *to;
    const struct sst_image *img;
    struct tap *x, *y;
    float *rows; /* [worker][img->width] */
};

static void fill_tap(struct tap *t, int i, int from, int to)
{
    if (to < from) {
        const double a = (double)i * from / to, b = (double)(i + 1) * from / to;

        t->first = (int)a;
        t->n = sst_min_int((int)ceil(b), from) - t->first;
        for (int k = 0; k < t->n; k++)
            t->weight[k] = (float)((fmin(b, t->first + k + 1) - fmax(a, t->first + k)) / (b - a));
    } else {
        const double at = sst_clamp_double((i + 0.5) * from / to - 0.5, 0, from - 1);

        t->first = (int)at;
        t->n = t->first + 1 < from ? 2 : 1;
        t->weight[0] = t->n == 2 ? (float)(1 - (at - t->first)) : 1;
        t->weight[1] = (float)(at - t->first); /* unused if n is 1 */
    }
}

/* Largest number of input samples of one output sample. */
static size_t most_samples(int from, int to)
{
    return (size_t)(from / to) + 3;
}

static size_t axis_bytes(int from, int to)
{
    return sst_mem_stride((size_t)to, sizeof(struct tap) + most_samples(from, to) * sizeof(float));
}

/* @param at  axis_bytes() of it */
static struct tap *make_axis(void *at, int from, int to)
{
    const size_t room = most_samples(from, to);
    struct tap *taps = at;
    float *weights = (float *)(void *)(taps + to);

    for (int i = 0; i < to; i++) {
        taps[i].weight = weights + (size_t)i * room;
        fill_tap(&taps[i], i, from, to);
    }
    return taps;
}

/* One row of one plane: down the columns first, then along the row. */
static int resample_row(void *arg, int index, int worker)
{
    const struct job *j = arg;
    const struct resampled *to = j->to;
    const int c = index / to->height, y = index % to->height, w = j->img->width;
    const struct tap *ty = &j->y[y];
    float *row = j->rows + (size_t)worker * (size_t)w, *out = to->out + (size_t)index * (size_t)to->width;
    const float scale = (float)(1 / (255 * to->std[c])), shift = (float)(to->mean[c] / to->std[c]);

    memset(row, 0, (size_t)w * sizeof(*row));
    for (int k = 0; k < ty->n; k++) {
        const uint8_t *in = sst_image_row(j->img, c, ty->first + k);

        for (int x = 0; x < w; x++)
            row[x] += ty->weight[k] * in[x];
    }
    for (int x = 0; x < to->width; x++) {
        const struct tap *tx = &j->x[x];
        float sum = 0;

        for (int k = 0; k < tx->n; k++)
            sum += tx->weight[k] * row[tx->first + k];
        out[x] = sum * scale - shift;
    }
    return 0;
}

int resample_planes(const struct resampled *to, const struct sst_image *img, int threads, struct sst_mem_kept *kept)
{
    struct job job = { .to = to, .img = img };
    const size_t x_bytes = axis_bytes(img->width, to->width), y_bytes = axis_bytes(img->height, to->height);
    const size_t row_bytes = (size_t)sst_thread_count(threads) * (size_t)img->width * sizeof(*job.rows);
    uint8_t *at = sst_mem_keep(kept, x_bytes + y_bytes + row_bytes, 1);

    if (!at)
        return -ENOMEM;
    job.x = make_axis(at, img->width, to->width);
    job.y = make_axis(at + x_bytes, img->height, to->height);
    job.rows = (float *)(void *)(at + x_bytes + y_bytes);
    return sst_parallel_for(3 * to->height, threads, resample_row, &job);
}
