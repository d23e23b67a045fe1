/* 3x3 convolutions on bytes by tiles of 4x4 results (pipeline/kernels/conv_tiles.h), where oneDNN multiplies bytes
 * without VNNI: a quarter of the products, on 16 bits, and the same sums, so the same bytes; oneDNN's pairs of products
 * saturate where values beyond their range meet the largest weights, these do not.
 *
 * Tiles of a layer with dilation d lie on d x d grids of every d-th pixel. A batch of tiles is spread, multiplied by
 * one block of output channels after the other, and finished; batches have their results apart, so threads do not
 * matter. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/method/network/plan_dnnl.h"

#define BATCH_BYTES (256 << 10) /* of spread inputs: they stay in the second cache */
#define BATCH_STEP  6           /* tiles that conv_products multiplies at once */
#define BATCH_MOST  48          /* tiles */

/* Top left result of a tile. */
struct place {
    int16_t x, y;
};

struct net_plan_tiles {
    int width, height, dilation, in, out; /* channels */
    bool is_signed;
    enum sst_conv_type type, residual;
    float residual_scale;
    bool relu, bias_first;
    int16_t *weights; /* [out / block][SST_CONV_PARTS][in / 2][block][2] */
    float *scale, *bias;
    uint8_t *zeros; /* [in] pixels outside the image */
    struct place *place;
    int tiles, batch;
};

struct job {
    const struct net_plan_tiles *t;
    const struct sst_kernels *kernels;
    const uint8_t *from;
    uint8_t *to, *scratch; /* [workers] */
    size_t scratch_bytes;  /* of a worker */
};

/* One row or column of G' g G'^T. */
static void spread_line(int16_t *out, int out_step, const int16_t *g, int step)
{
    const int even = g[0] + g[2 * step], far = g[0] + 4 * g[2 * step], odd = g[step];

    out[0] = g[0];
    out[out_step] = (int16_t)(-even - odd);
    out[2 * out_step] = (int16_t)(odd - even);
    out[3 * out_step] = (int16_t)(far + 2 * odd);
    out[4 * out_step] = (int16_t)(far - 2 * odd);
    out[5 * out_step] = g[2 * step];
}

static void spread_kernel(int16_t out[SST_CONV_PARTS], const int8_t *weights)
{
    int16_t g[9], rows[SST_CONV_TILE * 3];

    for (int i = 0; i < 9; i++)
        g[i] = weights[i];
    for (int x = 0; x < 3; x++)
        spread_line(rows + x, 3, g + x, 3);
    for (int y = 0; y < SST_CONV_TILE; y++)
        spread_line(out + y * SST_CONV_TILE, 1, rows + y * 3, 1);
}

/* Two input channels of a block of outputs at once: whole cache lines of each part. */
static void spread_weights(struct net_plan_tiles *t, const int8_t *weights)
{
    const size_t in = (size_t)t->in, part = in * SST_CONV_BLOCK, pairs = in / 2;

    for (size_t i = 0; i < (size_t)t->out / SST_CONV_BLOCK * pairs; i++) {
        const size_t block = i / pairs, c = i % pairs * 2;
        int16_t *to = t->weights + block * SST_CONV_PARTS * part + c * SST_CONV_BLOCK;
        int16_t line[SST_CONV_PARTS][SST_CONV_BLOCK][2];

        for (size_t n = 0; n < SST_CONV_BLOCK * 2; n++) {
            int16_t spread[SST_CONV_PARTS];

            spread_kernel(spread, weights + ((block * SST_CONV_BLOCK + n / 2) * in + c + n % 2) * 9);
            for (size_t k = 0; k < SST_CONV_PARTS; k++)
                line[k][n / 2][n % 2] = spread[k];
        }
        for (size_t k = 0; k < SST_CONV_PARTS; k++)
            memcpy(to + k * part, line[k], sizeof(line[k]));
    }
}

static int ceil_div(int a, int b)
{
    return (a + b - 1) / b;
}

/* List the tiles, grid by grid. @param place  NULL: only count @return their number */
static int list_tiles(const struct net_plan_tiles *t, struct place *place)
{
    const int d = t->dilation;
    int n = 0;

    for (int grid = 0; grid < d * d; grid++) {
        for (int y = grid / d; y < t->height; y += SST_CONV_OUT * d) {
            for (int x = grid % d; x < t->width; x += SST_CONV_OUT * d, n++) {
                if (place)
                    place[n] = (struct place){ (int16_t)x, (int16_t)y };
            }
        }
    }
    return n;
}

static bool has_kernels(void)
{
    return sst_cpu_level() >= SST_CPU_AVX2;
}

/* The largest sum of an output channel stays below SST_CONV_MOST. */
static bool sums_fit(const struct sst_op *op, const int8_t *weights)
{
    const size_t per = (size_t)op->group_in * 9;

    for (size_t o = 0; o < (size_t)op->channels; o++) {
        int64_t sum = 0;

        for (size_t i = 0; i < per; i++)
            sum += abs(weights[o * per + i]);
        if (sum * 255 >= SST_CONV_MOST)
            return false;
    }
    return true;
}

bool net_plan_tiles_fit(const struct net_plan *p, const struct sst_op *op, const int8_t *weights)
{
    const struct sst_shape in = p->shapes[op->in[0]];
    const int d = op->dilation[0];
    bool same = true;

    for (int axis = 0; axis < 2; axis++)
        same &= op->kernel[axis] == 3 && op->stride[axis] == 1 && op->dilation[axis] == d &&
                op->pad_before[axis] == d && op->pad_after[axis] == d;
    return has_kernels() && !net_plan_fast_int8() && same && op->group == 1 && op->group_in % SST_CONV_BLOCK == 0 &&
           op->channels % SST_CONV_BLOCK == 0 && in.w <= INT16_MAX && in.h <= INT16_MAX && sums_fit(op, weights);
}

static enum sst_conv_type type_of(dnnl_data_type_t type)
{
    switch (type) {
    case dnnl_f32:
        return SST_CONV_F32;
    case dnnl_u8:
        return SST_CONV_U8;
    case dnnl_s8:
        return SST_CONV_S8;
    default:
        return SST_CONV_NONE;
    }
}

static size_t spread_bytes(const struct net_plan_tiles *t)
{
    return sst_mem_stride((size_t)t->batch * SST_CONV_PARTS * (size_t)t->in, sizeof(int16_t));
}

static size_t scratch_bytes(const struct net_plan_tiles *t)
{
    return spread_bytes(t) + sst_mem_stride((size_t)t->batch * SST_CONV_PARTS * SST_CONV_BLOCK, sizeof(int32_t));
}

void net_plan_tiles_destroy(struct net_plan_tiles *t)
{
    if (!t)
        return;
    sst_mem_free(t->weights);
    free(t->scale);
    free(t->bias);
    free(t->zeros);
    free(t->place);
    free(t);
}

static int allocate(struct net_plan_tiles *t)
{
    t->weights = sst_mem_alloc_raw((size_t)t->in * (size_t)t->out, SST_CONV_PARTS * sizeof(*t->weights));
    t->scale = malloc((size_t)t->out * sizeof(*t->scale));
    t->bias = malloc((size_t)t->out * sizeof(*t->bias));
    t->zeros = calloc((size_t)t->in, 1);
    t->tiles = list_tiles(t, NULL);
    t->place = malloc((size_t)t->tiles * sizeof(*t->place));
    return t->weights && t->scale && t->bias && t->zeros && t->place ? 0 : -ENOMEM;
}

int net_plan_tiles_create(struct net_plan_tiles **out, struct net_plan *p, const struct sst_op *op,
                          const struct net_plan_bytes *b)
{
    const struct sst_shape shape = p->shapes[op->in[0]];
    const int fit = BATCH_BYTES / (SST_CONV_PARTS * (int)sizeof(int16_t) * op->group_in);
    struct net_plan_tiles *t = calloc(1, sizeof(*t));
    int err;

    if (!t)
        return -ENOMEM;
    *t = (struct net_plan_tiles){ .width = shape.w,
                                  .height = shape.h,
                                  .dilation = op->dilation[0],
                                  .in = op->group_in,
                                  .out = op->channels,
                                  .is_signed = b->src == dnnl_s8,
                                  .type = type_of(b->dst),
                                  .residual = op->residual ? type_of(b->sum) : SST_CONV_NONE,
                                  .residual_scale = b->sum_scale,
                                  .relu = op->relu,
                                  .bias_first = net_dnnl_scales_bias(),
                                  .batch = sst_clamp_int(fit / BATCH_STEP, 1, BATCH_MOST / BATCH_STEP) * BATCH_STEP };
    err = allocate(t);
    if (err) {
        net_plan_tiles_destroy(t);
        return err;
    }
    list_tiles(t, t->place);
    spread_weights(t, b->weights);
    memcpy(t->scale, b->scales, (size_t)t->out * sizeof(*t->scale));
    net_plan_scale_bias(op, b->scales, b->dst_scale, t->bias);
    if (scratch_bytes(t) * (size_t)sst_thread_count(p->threads) > p->scratch_bytes)
        p->scratch_bytes = scratch_bytes(t) * (size_t)sst_thread_count(p->threads);
    *out = t;
    return 0;
}

/* Spread inputs of the tiles from `first` on: [SST_CONV_PARTS][batch][in]. */
static void spread_tiles(const struct job *j, int16_t *spread, int first, int n)
{
    const struct net_plan_tiles *t = j->t;
    const size_t in = (size_t)t->in;

    for (int i = 0; i < n; i++) {
        const uint8_t *pixel[SST_CONV_PARTS];

        for (int k = 0; k < SST_CONV_PARTS; k++) {
            const int x = t->place[first + i].x + (k % SST_CONV_TILE - 1) * t->dilation;
            const int y = t->place[first + i].y + (k / SST_CONV_TILE - 1) * t->dilation;
            const bool inside = x >= 0 && y >= 0 && x < t->width && y < t->height;

            pixel[k] = inside ? j->from + ((size_t)y * (size_t)t->width + (size_t)x) * in : t->zeros;
        }
        j->kernels->conv_spread(spread + (size_t)i * in, (size_t)t->batch * in, pixel, in, t->is_signed);
    }
}

/* Results of a tile, output channels from `o` on, from its products. */
static void finish_tile(const struct job *j, const int32_t *products, int tile, size_t o)
{
    const struct net_plan_tiles *t = j->t;
    const struct sst_conv_finish f = { .scale = t->scale + o,
                                       .bias = t->bias + o,
                                       .bias_first = t->bias_first,
                                       .relu = t->relu,
                                       .type = t->type,
                                       .residual = t->residual,
                                       .residual_scale = t->residual_scale };
    const size_t bytes = t->type == SST_CONV_F32 ? sizeof(float) : 1;
    int32_t sums[SST_CONV_PIXELS * SST_CONV_BLOCK];
    void *to[SST_CONV_PIXELS];

    for (int p = 0; p < SST_CONV_PIXELS; p++) {
        const int x = t->place[tile].x + p % SST_CONV_OUT * t->dilation;
        const int y = t->place[tile].y + p / SST_CONV_OUT * t->dilation;

        to[p] = x < t->width && y < t->height
                    ? j->to + (((size_t)y * (size_t)t->width + (size_t)x) * (size_t)t->out + o) * bytes
                    : NULL;
    }
    j->kernels->conv_gather(sums, products, (size_t)t->batch * SST_CONV_BLOCK);
    j->kernels->conv_finish(to, sums, &f);
}

static int run_batch(void *arg, int index, int worker)
{
    const struct job *j = arg;
    const struct net_plan_tiles *t = j->t;
    uint8_t *scratch = j->scratch + (size_t)worker * j->scratch_bytes;
    int16_t *spread = (int16_t *)(void *)scratch;
    int32_t *products = (int32_t *)(void *)(scratch + spread_bytes(t));
    const int first = index * t->batch, n = sst_min_int(t->batch, t->tiles - first);
    const size_t in = (size_t)t->in, batch = (size_t)t->batch;

    spread_tiles(j, spread, first, n);
    for (size_t o = 0; o < (size_t)t->out; o += SST_CONV_BLOCK) {
        const int16_t *weights = t->weights + o * SST_CONV_PARTS * in;

        for (size_t k = 0; k < SST_CONV_PARTS; k++)
            j->kernels->conv_products(products + k * batch * SST_CONV_BLOCK, spread + k * batch * in,
                                      weights + k * in * SST_CONV_BLOCK, in, (size_t)n);
        for (int i = 0; i < n; i++)
            finish_tile(j, products + (size_t)i * SST_CONV_BLOCK, first + i, o);
    }
    return 0;
}

int net_plan_tiles_run(const struct net_plan_tiles *t, const void *from, void *to, void *scratch, int threads)
{
    struct job j = { .t = t,
                     .kernels = sst_kernels_get(),
                     .from = from,
                     .to = to,
                     .scratch = scratch,
                     .scratch_bytes = scratch_bytes(t) };

    return sst_parallel_for(ceil_div(t->tiles, t->batch), threads, run_batch, &j);
}
