#include "pipeline/labels/resample.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"

/* Output sample i is the sum of weight[k] * in[first + k] for k in 0 .. n-1. */
struct tap {
    int first, n;
    float *weight;
};

struct axis {
    struct tap *taps;
    float *weights;
};

struct job {
    float *out;
    int width, height;
    const struct sst_image *img;
    const double *mean, *std;
    struct axis x, y;
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
        t->weight[1] = (float)(at - t->first); /* not used where n is 1 */
    }
}

static int make_axis(struct axis *a, int from, int to)
{
    const size_t room = (size_t)(from / to) + 3; /* samples that one of the outputs can touch */

    a->taps = calloc((size_t)to, sizeof(*a->taps));
    a->weights = calloc((size_t)to * room, sizeof(*a->weights));
    if (!a->taps || !a->weights)
        return -ENOMEM;
    for (int i = 0; i < to; i++) {
        a->taps[i].weight = a->weights + (size_t)i * room;
        fill_tap(&a->taps[i], i, from, to);
    }
    return 0;
}

static void free_axis(struct axis *a)
{
    free(a->taps);
    free(a->weights);
}

/* One row of one plane: down the columns first, then along the row. */
static int resample_row(void *arg, int index, int worker)
{
    const struct job *j = arg;
    const int c = index / j->height, y = index % j->height, w = j->img->width;
    const struct tap *ty = &j->y.taps[y];
    const float scale = (float)(1 / (255 * j->std[c])), shift = (float)(j->mean[c] / j->std[c]);
    float *row = j->rows + (size_t)worker * (size_t)w, *out = j->out + (size_t)index * (size_t)j->width;

    memset(row, 0, (size_t)w * sizeof(*row));
    for (int k = 0; k < ty->n; k++) {
        const uint8_t *in = sst_image_row(j->img, c, ty->first + k);

        for (int x = 0; x < w; x++)
            row[x] += ty->weight[k] * in[x];
    }
    for (int x = 0; x < j->width; x++) {
        const struct tap *tx = &j->x.taps[x];
        float sum = 0;

        for (int k = 0; k < tx->n; k++)
            sum += tx->weight[k] * row[tx->first + k];
        out[x] = sum * scale - shift;
    }
    return 0;
}

int sst_resample(float *out, int width, int height, const struct sst_image *img, const double mean[3], const double std[3],
                 int threads)
{
    struct job job = { .out = out, .width = width, .height = height, .img = img, .mean = mean, .std = std };
    int err = make_axis(&job.x, img->width, width);

    if (!err)
        err = make_axis(&job.y, img->height, height);
    job.rows = sst_mem_alloc((size_t)sst_thread_count(threads) * (size_t)img->width, sizeof(*job.rows));
    if (!err)
        err = job.rows ? sst_parallel_for(3 * height, threads, resample_row, &job) : -ENOMEM;
    sst_mem_free(job.rows);
    free_axis(&job.x);
    free_axis(&job.y);
    return err;
}
