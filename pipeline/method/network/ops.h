/* pipeline/method/network/ops.h - the layers that oneDNN lacks, or rounds in its own way, on any of the layouts that it
 * chooses. */
#ifndef SST_PIPELINE_METHOD_NETWORK_OPS_H
#define SST_PIPELINE_METHOD_NETWORK_OPS_H

#include <math.h>

#include "pipeline/method/network/graph.h"

/**
 * Activations of one image: channel c of pixel (x, y) is data[((c / block * h + y) * w + x) * block + c % block].
 *
 * block 1 is [c][h][w], block c is [h][w][c], others are oneDNN's blocked layouts, whose last block may be longer than
 * c; those channels are 0 in every tensor and are kept so.
 */
struct sst_tensor {
    float *data;
    int c, h, w, block;
};

/** Place of one output sample along an axis: in[lo] + part (in[hi] - in[lo]). */
struct sst_tap {
    int lo, hi;
    float part;
};

/** Fill taps for `to` output samples from `from` input samples. */
void sst_resize_taps(struct sst_tap *taps, enum sst_resize_mode mode, double scale, int from, int to);

/* All: dst->block is src->block or 1. Each output has one fixed order of sums: same bytes for any number of threads. */

/** @param taps_y, taps_x  [dst->h] and [dst->w] */
SST_MUST_CHECK int sst_op_resize(const struct sst_tensor *dst, const struct sst_tensor *src,
                                 const struct sst_tap *taps_y, const struct sst_tap *taps_x, int threads);

/** Means over bins; sums in double. */
SST_MUST_CHECK int sst_op_adaptive_pool(const struct sst_tensor *dst, const struct sst_tensor *src, int threads);

/** exp(x - max) / sum over channels. Needs c * 16 floats on the stack of each thread: c at most SST_OP_MAX_CHANNELS. */
SST_MUST_CHECK int sst_op_softmax(const struct sst_tensor *dst, const struct sst_tensor *src, int threads);

/** SST_OP_NORMALIZE with the op's constants; sums in double; same limit of channels. */
SST_MUST_CHECK int sst_op_normalize(const struct sst_tensor *dst, const struct sst_tensor *src, const struct sst_op *op,
                                    int threads);

/** The same, rounded to bytes: out[(y w + x) c + channel] as of sst_op_to_byte(factor x / |x|). */
SST_MUST_CHECK int sst_op_normalize_s8(int8_t *out, const struct sst_tensor *src, const struct sst_op *op, float factor,
                                       int threads);

/** Nearest integer, halves away from 0, between -127 and 127; NaN gives 0. */
static inline int8_t sst_op_to_byte(float v)
{
    /* Each step one instruction on vectors of floats. */
    v = v < -127.0f ? -127.0f : v;
    v = v > 127.0f ? 127.0f : v;
    v = v == v ? v : 0.0f;
    return (int8_t)(int)(v + copysignf(0.5f, v));
}

#endif
