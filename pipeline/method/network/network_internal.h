/* pipeline/method/network/network_internal.h - private declarations of this folder. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_NETWORK_NETWORK_INTERNAL_H
#define SST_PIPELINE_METHOD_NETWORK_NETWORK_INTERNAL_H

#include <math.h>

#include "pipeline/method/network/graph.h"
#include "pipeline/method/network/network.h"
#include "pipeline/step/run.h"

/* --- graph_build: shared by graph*.c: ONNX nodes with their names resolved, on the way to operations. --- */

struct raw_value {
    struct sst_onnx_str name;
    int next;     /* chain of the name table, or -1 */
    int node;     /* that produces it, or -1 */
    int users;    /* needed nodes that read it */
    int alias;    /* value that it is equal to, or -1 */
    int op;       /* operation that produces it, or -1 */
    int channels; /* 0: unknown, a constant */
    int unpadded; /* value that it equals without the `pad` zeros around it (top, left, bottom, right), or -1 */
    int pad[4];
    const struct sst_onnx_tensor *constant;
};

struct graph_norm {
    bool found;
    int x;
    double in_add, in_min, add, min;
};

struct raw_node {
    const struct sst_onnx_node *onnx;
    int in[SST_ONNX_MAX_INS], out[SST_ONNX_MAX_OUTS]; /* values, -1 where left out */
    bool needed;
    struct graph_norm norm; /* this node ends a normalisation */
};

#define SST_NAME_BUCKETS 4096

struct graph_builder {
    const struct sst_onnx *model;
    const char *name;
    char *why;
    struct raw_value *values;
    int n_values, room;
    int bucket[SST_NAME_BUCKETS];
    struct raw_node *nodes;
    struct sst_onnx_tensor *constants; /* of Constant nodes; [n_nodes] */
    int64_t weights;                   /* numbers copied into operations */
    struct sst_graph graph;
};

/** Set builder->why to what is not supported and return -ENOTSUP. */
int graph_unsupported(struct graph_builder *b, const struct sst_onnx_node *node, const char *what);
/** Log a fault of a node and return -EBADMSG. */
int graph_wrong(struct graph_builder *b, const struct sst_onnx_node *node, const char *what);
/** The value that an alias stands for; any other value itself. */
int graph_original(const struct graph_builder *b, int v);
/** Constant input of a node, or NULL. */
const struct sst_onnx_tensor *graph_constant(const struct graph_builder *b, const struct raw_node *node, int in);
/** True where the node is op of the standard domain. */
bool graph_is(const struct sst_onnx_node *node, const char *op);

/** Detect a node that ends a normalisation over channels exported in single steps, and return the normalised value. */
struct graph_norm graph_find_norm(const struct graph_builder *b, const struct raw_node *node);

struct resize_target {
    int64_t size[2]; /* height and width, where like is -1 */
    int like;        /* value whose height and width it takes, or -1 */
};

/** Find the target size of a Resize, which exporters wrap into arithmetic on shapes. @return false: unknown */
bool graph_resize_target(const struct graph_builder *b, const struct raw_node *node, struct resize_target *out);

/** Turn one node into an operation, fuse it into an earlier one, or make its output an alias. */
SST_MUST_CHECK int graph_translate(struct graph_builder *b, const struct raw_node *node);

/* --- ops ---
 * layers that oneDNN lacks or rounds differently, on any layout that it chooses. */

/**
 * Activations of one image: channel c of pixel (x, y) is data[((c / block * h + y) * w + x) * block + c % block].
 *
 * block 1 is [c][h][w], block c is [h][w][c], others are oneDNN's blocked layouts, whose last block may be longer than
 * c; those channels must be 0 in every tensor and stay 0.
 */
struct net_tensor {
    float *data;
    int c, h, w, block;
};

/** Position of one output sample along an axis: in[lo] + part (in[hi] - in[lo]). */
struct net_tap {
    int lo, hi;
    float part;
};

/** @param taps  out, [out.h + out.w]: of rows, then of columns */
void resize_taps(struct net_tap *taps, const struct sst_op *op, struct sst_shape in, struct sst_shape out);

/* All: dst->block is src->block or 1. Each output has one fixed order of sums: same bytes for any number of threads. */

/** @param taps  of resize_taps() */
SST_MUST_CHECK int op_resize(const struct net_tensor *dst, const struct net_tensor *src, const struct net_tap *taps,
                             int threads);

/** Means over bins; sums in double. */
SST_MUST_CHECK int op_adaptive_pool(const struct net_tensor *dst, const struct net_tensor *src, int threads);

/** exp(x - max) / sum over channels. Needs c * 16 floats on the stack of each thread: c at most SST_OP_MAX_CHANNELS. */
SST_MUST_CHECK int op_softmax(const struct net_tensor *dst, const struct net_tensor *src, int threads);

/** SST_OP_NORMALIZE with the op's constants; sums in double; same limit of channels. */
SST_MUST_CHECK int op_normalize(const struct net_tensor *dst, const struct net_tensor *src, const struct sst_op *op,
                                int threads);

/** The same, rounded to bytes: out[(y w + x) c + channel] as of op_to_byte(factor x / |x|). */
SST_MUST_CHECK int op_normalize_s8(int8_t *out, const struct net_tensor *src, const struct sst_op *op, float factor,
                                   int threads);

/** Nearest integer, halves away from 0, between -127 and 127; NaN gives 0. */
static inline int8_t op_to_byte(float v)
{
    /* Each step one instruction on vectors of floats. */
    v = v < -127.0f ? -127.0f : v;
    v = v > 127.0f ? 127.0f : v;
    v = v == v ? v : 0.0f;
    return (int8_t)(int)(v + copysignf(0.5f, v));
}

/* --- place.c --- */

/** Memory that is used from step `first` to step `last`; first below 0: never. */
struct net_span {
    size_t bytes, offset; /* offset out */
    int first, last;
    bool placed;
};

/** Give spans that are used at the same time different memory. @return bytes of all of it */
size_t net_place(struct net_span *spans, int n);

/* --- plan: a graph prepared for one input size: primitives, weights in their layout, memory. --- */

struct net_plan; /* one thread at a time */

/* Limit of memory for activations and scratch; real networks stay far below it. */
#define NET_PLAN_MAX_BYTES(pixels) (((size_t)64 << 20) + ((size_t)16 << 10) * (size_t)(pixels))

/** A graph for an input size. */
struct net_plan_config {
    const struct sst_graph *graph;
    const char *name; /* of the model, for messages; "": that it is planned is not logged */
    int width, height, threads;
    enum sst_precision precision; /* not SST_PRECISION_AUTO */
};

/**
 * @param cfg  borrowed during the call, its graph and name until destroy
 * @return 0, -ENOMEM, -EINVAL (the graph has no such size, or needs more than NET_PLAN_MAX_BYTES of the input's
 * pixels), -ENOTSUP (oneDNN has no code for a layer on this machine); logged.
 */
SST_MUST_CHECK int net_plan_create(struct net_plan **out, const struct net_plan_config *cfg);
void net_plan_destroy(struct net_plan *plan);

/** True if this processor multiplies and adds bytes in one instruction (VNNI) and oneDNN may use it. */
bool net_plan_fast_int8(void);

/** True if oneDNN computes convolutions in less time on 8 bits than on floats here. */
bool net_plan_int8_pays(void);

/** True if oneDNN's sums of floats begin with the bias, as its code for processors without AVX-512 has them. */
bool net_plan_bias_first(void);

/** Run once; allocates nothing. @param in [c][h][w] @param out [c][h][w] of the graph's output. */
SST_MUST_CHECK int net_plan_run(struct net_plan *plan, const float *in, float *out);

/** Run a network that ends with a normalisation once, with the result times factor in bytes, see op_normalize_s8().
 * @param out [h][w][c] of the output */
SST_MUST_CHECK int net_plan_run_s8(struct net_plan *plan, const float *in, float factor, int8_t *out);

/* --- runs ------------------------------------------------------------------------------------- */

/** A network, its input and its result. */
struct net_job {
    struct net_plan_config cfg;
    struct net_plan **plan;       /* of the CPU; NULL in it: made when the CPU runs the network */
    struct sst_runner_user *user; /* NULL: the CPU */
    uint64_t id;                  /* with it: a hash of the file's path and of its weights */
    const float *in;
    float *out; /* or NULL, and in bytes: */
    int8_t *out_s8;
    float factor;
    const struct sst_network_keeper *keeper; /* or NULL */
    bool kept;                               /* out: the keeper alone has the result */
};

/** Run a network. @return 0 or an error of the CPU, logged */
SST_MUST_CHECK int net_job_run(struct net_job *job);

/* --- sample.c: of struct sst_step --- */

#define NET_SAMPLE_SEEDS 3
void *net_sample(uint32_t seed);
void net_sample_free(void *job);
bool net_sample_same(const void *got, const void *want, int item);

#endif
