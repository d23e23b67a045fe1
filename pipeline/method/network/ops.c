/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/network/network_internal.h"

#include <math.h>

#include "base/thread.h"

#define TILE 16 /* pixels or channels per tile */

struct job {
    const struct net_tensor *dst, *src;
    const struct net_tap *taps;
    const struct sst_op *op;
    int8_t *bytes; /* of normalisation to bytes */
    float factor;
};

static size_t offset(const struct net_tensor *t, int c, int y, int x)
{
    return (((size_t)(c / t->block) * (size_t)t->h + (size_t)y) * (size_t)t->w + (size_t)x) * (size_t)t->block +
           (size_t)(c % t->block);
}

/* Channels including the padding of the last block. */
static int padded_channels(const struct net_tensor *t)
{
    return (t->c + t->block - 1) / t->block * t->block;
}

/* --- resize --------------------------------------------------------------------------------------- */

static double source_position(enum sst_resize_mode mode, double scale, int from, int to, int i)
{
    switch (mode) {
    case SST_RESIZE_ALIGN_CORNERS:
        return to > 1 ? (double)i * (from - 1) / (to - 1) : 0;
    case SST_RESIZE_ASYMMETRIC:
        return i / scale;
    case SST_RESIZE_PYTORCH:
        if (to == 1)
            return 0;
        break;
    case SST_RESIZE_HALF_PIXEL:
        break;
    }
    return (i + 0.5) / scale - 0.5;
}

static void axis_taps(struct net_tap *taps, enum sst_resize_mode mode, double scale, int from, int to)
{
    for (int i = 0; i < to; i++) {
        const double at = sst_clamp_double(source_position(mode, scale, from, to, i), 0, from - 1);
        const int lo = sst_min_int((int)at, from - 1);

        taps[i] = (struct net_tap){ lo, sst_min_int(lo + 1, from - 1), (float)(at - lo) };
    }
}

void resize_taps(struct net_tap *taps, const struct sst_op *op, struct sst_shape in, struct sst_shape out)
{
    const double scale_y = op->scale[0] > 0 ? op->scale[0] : (double)out.h / in.h;
    const double scale_x = op->scale[1] > 0 ? op->scale[1] : (double)out.w / in.w;

    axis_taps(taps, op->mode, scale_y, in.h, out.h);
    axis_taps(taps + out.h, op->mode, scale_x, in.w, out.w);
}

static int resize_row(void *arg, int y, int worker SST_UNUSED)
{
    const struct job *j = arg;
    const struct net_tensor *dst = j->dst, *src = j->src;
    const struct net_tap ty = j->taps[y];
    const int b = src->block;

    for (int c = 0; c < padded_channels(src); c += b) {
        const float *top = src->data + offset(src, c, ty.lo, 0), *bottom = src->data + offset(src, c, ty.hi, 0);
        const int lanes = dst->block == b ? b : sst_min_int(b, dst->c - c);
        const size_t step = dst->block == b ? 1 : (size_t)dst->h * (size_t)dst->w;

        for (int x = 0; x < dst->w; x++) {
            const struct net_tap tx = j->taps[dst->h + x];
            const float *tl = top + (size_t)tx.lo * b, *tr = top + (size_t)tx.hi * b;
            const float *bl = bottom + (size_t)tx.lo * b, *br = bottom + (size_t)tx.hi * b;
            float *out = dst->data + offset(dst, c, y, x);

            for (int l = 0; l < lanes; l++) {
                const float t = tl[l] + tx.part * (tr[l] - tl[l]), u = bl[l] + tx.part * (br[l] - bl[l]);

                out[l * step] = t + ty.part * (u - t);
            }
        }
    }
    return 0;
}

int op_resize(const struct net_tensor *dst, const struct net_tensor *src, const struct net_tap *taps, int threads)
{
    struct job job = { .dst = dst, .src = src, .taps = taps };

    return sst_parallel_for(dst->h, threads, resize_row, &job);
}

/* --- adaptive pool -------------------------------------------------------------------------------- */

static void mean_of_bin(const struct job *j, int c0, int lanes, int oy, int ox)
{
    const struct net_tensor *dst = j->dst, *src = j->src;
    const int y0 = (int)((int64_t)oy * src->h / dst->h), x0 = (int)((int64_t)ox * src->w / dst->w);
    const int y1 = (int)(((int64_t)(oy + 1) * src->h + dst->h - 1) / dst->h);
    const int x1 = (int)(((int64_t)(ox + 1) * src->w + dst->w - 1) / dst->w);
    const double n = (double)(y1 - y0) * (x1 - x0);
    double sum[TILE] = { 0 };

    for (int y = y0; y < y1; y++) {
        const float *row = src->data + offset(src, c0, y, x0);

        for (int x = x0; x < x1; x++, row += src->block) {
            for (int l = 0; l < lanes; l++)
                sum[l] += row[l];
        }
    }
    for (int l = 0; l < lanes; l++) {
        if (c0 + l < dst->c || dst->block > 1)
            dst->data[offset(dst, c0 + l, oy, ox)] = (float)(sum[l] / n);
    }
}

/* A group is up to TILE adjacent channels. */
static int pool_group(void *arg, int group, int worker SST_UNUSED)
{
    const struct job *j = arg;
    const int width = sst_min_int(j->src->block, TILE);
    const int lanes = sst_min_int(width, padded_channels(j->src) - group * width);

    for (int y = 0; y < j->dst->h; y++) {
        for (int x = 0; x < j->dst->w; x++)
            mean_of_bin(j, group * width, lanes, y, x);
    }
    return 0;
}

int op_adaptive_pool(const struct net_tensor *dst, const struct net_tensor *src, int threads)
{
    const int width = sst_min_int(src->block, TILE);
    struct job job = { .dst = dst, .src = src };

    return sst_parallel_for((padded_channels(src) + width - 1) / width, threads, pool_group, &job);
}

/* --- softmax and normalisation: tiles of TILE pixels of a row, all channels ----------------------- */

static void load_tile(float (*tile)[TILE], const struct net_tensor *t, int y, int x, int n)
{
    for (int c = 0; c < t->c; c++) {
        const float *p = t->data + offset(t, c, y, x);

        for (int i = 0; i < n; i++)
            tile[c][i] = p[(size_t)i * t->block];
        for (int i = n; i < TILE; i++)
            tile[c][i] = 0;
    }
}

static void store_tile(const struct net_tensor *t, int y, int x, int n, float (*tile)[TILE])
{
    for (int c = 0; c < padded_channels(t); c++) {
        float *p = t->data + offset(t, c, y, x);

        for (int i = 0; i < n; i++)
            p[(size_t)i * t->block] = c < t->c ? tile[c][i] : 0;
    }
}

static void softmax_tile(float (*tile)[TILE], int channels)
{
    float max[TILE], sum[TILE] = { 0 };

    for (int i = 0; i < TILE; i++)
        max[i] = tile[0][i];
    for (int c = 1; c < channels; c++) {
        for (int i = 0; i < TILE; i++)
            max[i] = tile[c][i] > max[i] ? tile[c][i] : max[i];
    }
    for (int c = 0; c < channels; c++) {
        for (int i = 0; i < TILE; i++) {
            tile[c][i] = expf(tile[c][i] - max[i]);
            sum[i] += tile[c][i];
        }
    }
    for (int c = 0; c < channels; c++) {
        for (int i = 0; i < TILE; i++)
            tile[c][i] /= sum[i];
    }
}

static double length_of(double sum, const struct sst_op *op)
{
    return fmax(sqrt(fmax(sum + op->norm_in_add, op->norm_in_min)) + op->norm_add, op->norm_min);
}

static void normalize_tile(float (*tile)[TILE], int channels, const struct sst_op *op)
{
    double scale[TILE] = { 0 };

    for (int c = 0; c < channels; c++) {
        for (int i = 0; i < TILE; i++)
            scale[i] += (double)tile[c][i] * tile[c][i];
    }
    for (int i = 0; i < TILE; i++) {
        const double length = length_of(scale[i], op);

        scale[i] = length > 0 ? 1 / length : 0;
    }
    for (int c = 0; c < channels; c++) {
        for (int i = 0; i < TILE; i++)
            tile[c][i] = (float)(tile[c][i] * scale[i]);
    }
}

static int tile_row(void *arg, int y, int worker SST_UNUSED)
{
    const struct job *j = arg;
    float tile[SST_OP_MAX_CHANNELS][TILE];

    for (int x = 0; x < j->dst->w; x += TILE) {
        const int n = sst_min_int(TILE, j->dst->w - x);

        load_tile(tile, j->src, y, x, n);
        if (j->op)
            normalize_tile(tile, j->src->c, j->op);
        else
            softmax_tile(tile, j->src->c);
        store_tile(j->dst, y, x, n, tile);
    }
    return 0;
}

int op_softmax(const struct net_tensor *dst, const struct net_tensor *src, int threads)
{
    struct job job = { .dst = dst, .src = src };

    return sst_parallel_for(dst->h, threads, tile_row, &job);
}

int op_normalize(const struct net_tensor *dst, const struct net_tensor *src, const struct sst_op *op, int threads)
{
    struct job job = { .dst = dst, .src = src, .op = op };

    return sst_parallel_for(dst->h, threads, tile_row, &job);
}

/* Sum of squares of n numbers, in eight lanes; in double where float would overflow or underflow. */
static double sum_of_squares(const float *x, int n)
{
    float lanes[8] = { 0 };
    double sum = 0;
    int i = 0;

    for (; i + 8 <= n; i += 8) {
        for (int l = 0; l < 8; l++)
            lanes[l] += x[i + l] * x[i + l];
    }
    for (int l = 0; l < 8; l++)
        sum += (double)lanes[l];
    if (!(sum > 1e-20 && sum < 1e30)) {
        sum = 0;
        i = 0;
    }
    for (; i < n; i++)
        sum += (double)x[i] * (double)x[i];
    return sum;
}

/* Runs on vectors: `restrict`, as bytes may lie anywhere. */
static void to_bytes(int8_t *restrict out, const float *restrict in, float scale, int n)
{
    for (int i = 0; i < n; i++)
        out[i] = op_to_byte(in[i] * scale);
}

static int byte_row(void *arg, int y, int worker SST_UNUSED)
{
    const struct job *j = arg;
    const struct net_tensor *src = j->src;
    int8_t *out = j->bytes + (size_t)y * (size_t)src->w * (size_t)src->c;

    for (int x = 0; x < src->w; x++, out += src->c) {
        double sum = 0, length;
        float scale;

        for (int c = 0; c < src->c; c += src->block)
            sum += sum_of_squares(src->data + offset(src, c, y, x), sst_min_int(src->block, src->c - c));
        length = length_of(sum, j->op);
        scale = length > 0 ? (float)((double)j->factor / length) : 0;
        for (int c = 0; c < src->c; c += src->block) {
            const float *run = src->data + offset(src, c, y, x);
            const int n = sst_min_int(src->block, src->c - c);

            to_bytes(out + c, run, scale, n);
        }
    }
    return 0;
}

int op_normalize_s8(int8_t *out, const struct net_tensor *src, const struct sst_op *op, float factor, int threads)
{
    struct job job = { .src = src, .op = op, .bytes = out, .factor = factor };

    return sst_parallel_for(src->h, threads, byte_row, &job);
}
