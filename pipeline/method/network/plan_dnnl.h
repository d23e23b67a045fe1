/* pipeline/method/network/plan_dnnl.h - internals of a plan, shared by plan*.c. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_NETWORK_PLAN_DNNL_H
#define SST_PIPELINE_METHOD_NETWORK_PLAN_DNNL_H

#include <dnnl.h>

#include "pipeline/method/network/compat_dnnl.h"
#include "pipeline/method/network/network_internal.h"

#define NET_PLAN_MAX_ARGS (SST_ONNX_MAX_INS + 4)

/** Representation of a value in 8 bits: round(x / scale). */
struct net_plan_value {
    bool bits8; /* some layer requests it */
    bool never_negative;
    dnnl_data_type_t type; /* u8 or s8 */
    float scale;
};

/** A value in one layout. A convolution that adds to a residual writes over that tensor. */
struct net_plan_tensor {
    int value;    /* of the graph; -1: overwritten */
    int place_of; /* tensor whose memory it uses, or -1 */
    float scale;  /* the value is scale times what is stored */
    const_dnnl_memory_desc_t md;
    dnnl_memory_t memory;
    struct net_tensor view; /* block 0: a layout private to oneDNN */
    dnnl_format_tag_t tag;  /* of the layout, if block > 0 */
    size_t bytes, offset;   /* position in the arena */
    int first, last;        /* first and last step that use it */
    bool external;          /* the caller's memory: input or output */
};

struct net_plan_step {
    const struct sst_op *op;
    dnnl_primitive_t primitive; /* NULL: by tiles or one of ops.h, from tensor[0] to tensor[1] */
    bool serial;                /* on one thread: the result depends on their number */
    int n_args;
    dnnl_exec_arg_t args[NET_PLAN_MAX_ARGS];
    int tensor[NET_PLAN_MAX_ARGS]; /* of args, -1 for weights, bias, scales and scratch */
    dnnl_memory_t weights, bias, scales, scratch;
    void *weights_data;
    float *bias_data, *scales_data;
    struct net_tap *taps;
    struct net_plan_tiles *tiles; /* a convolution by tiles, without primitive */
};

struct net_plan {
    const struct sst_graph *graph;
    const struct sst_shape *shapes;
    const char *name;
    int threads;
    enum sst_precision precision;
    struct net_plan_value *values; /* [n_values] */
    struct net_dnnl dnnl;
    struct net_plan_tensor *tensors;
    struct net_plan_step *steps;
    int n_tensors, n_steps, tensors_room, steps_room;
    int *current;         /* [n_values] tensor that holds a value now, or -1 */
    int *last_use;        /* [n_values] last operation that reads it */
    int winograd_threads; /* that these are planned for; at least 2 */
    uint8_t *winograd;    /* [n_ops] tile side of the convolutions that run as Winograd's, else 0 */
    int input, output;
    void *arena, *scratch;
    size_t arena_bytes, scratch_bytes;
};

/* OpenMP's C interface, as not every compiler has omp.h. The setting is per calling thread. */
extern void omp_set_num_threads(int n);
extern int omp_get_max_threads(void);
extern void omp_set_max_active_levels(int n);
extern int omp_get_max_active_levels(void);

/* --- plan.c --- */

/** New tensor of a value; its number or a negative errno. */
int net_plan_add_tensor(struct net_plan *p, int value, const_dnnl_memory_desc_t md, float scale);

/** Append a step to fill in; NULL: out of memory. */
struct net_plan_step *net_plan_add_step(struct net_plan *p, const struct sst_op *op);

/* --- plan_dnnl.c --- */

/** Plan operation i of the graph. */
SST_MUST_CHECK int net_plan_add_op(struct net_plan *p, int i);

/** Layout of a shape; tags as dnnl_nchw, which is [c][h][w]. */
SST_MUST_CHECK int net_plan_desc(struct net_plan *p, const_dnnl_memory_desc_t *md, struct sst_shape shape,
                                 dnnl_data_type_t type, dnnl_format_tag_t tag);

/** Number of a tensor that holds a value in a layout and scale; plans a reorder if there is none. */
int net_plan_in_layout(struct net_plan *p, int value, const_dnnl_memory_desc_t md, float scale);

/** Number of a tensor that holds a value in 8 bits of any scale. */
int net_plan_in_8_bits(struct net_plan *p, int value);

/** The same in f32, in whatever layout. */
int net_plan_in_f32(struct net_plan *p, int value);

/** Create the tensor that holds a value from now on; its number or a negative errno. */
int net_plan_result(struct net_plan *p, int value, const_dnnl_memory_desc_t md, float scale);

SST_MUST_CHECK int net_plan_reorder(struct net_plan *p, int from, int to);

void net_plan_add_arg(struct net_plan_step *s, int arg, int tensor, dnnl_memory_t memory);

/** Attributes that all primitives share: scratch memory is ours. */
SST_MUST_CHECK int net_plan_attr(dnnl_primitive_attr_t *attr);

/** Create the primitive of a step and reserve its scratch memory; consumes the description. */
SST_MUST_CHECK int net_plan_primitive(struct net_plan *p, struct net_plan_step *s, dnnl_primitive_desc_t pd);

/** Pass n factors, which are copied, to a step's argument as it runs; without effect where the primitive has them. */
SST_MUST_CHECK int net_plan_scales(struct net_plan *p, struct net_plan_step *s, int arg, const float *factors, int n);

/* --- plan_conv.c --- */

SST_MUST_CHECK int net_plan_add_conv(struct net_plan *p, const struct sst_op *op);

/** Tile side of an operation as a oneDNN Winograd convolution with the current number of threads; 0: not possible. */
uint8_t net_plan_winograd_tile(struct net_plan *p, const struct sst_op *op);

/**
 * Weights in bytes between -127 and 127, and the factor of each output channel's sums.
 *
 * @param s8       true: the inputs may be negative
 * @param factor   of all channels
 * @param weights  out [channels][group_in][kernel]
 * @param scales   out [channels]
 */
void net_plan_quantise(const struct sst_op *op, bool s8, float factor, int8_t *weights, float *scales);

/** Biases in units of the sums, which scales[c] brings to units of dst_scale; in these, unless net_dnnl_scales_bias().
 * @param bias  out [channels] */
void net_plan_scale_bias(const struct sst_op *op, const float *scales, float dst_scale, float *bias);

/** Numbers of a convolution on 8 bits; all zero for f32. */
struct net_plan_bytes {
    dnnl_data_type_t src, dst; /* dnnl_data_type_undef: f32 */
    float src_scale, dst_scale;
    dnnl_data_type_t sum; /* of the residual */
    float sum_scale;
    float *scales;   /* [channels] of the products, over the result's */
    int8_t *weights; /* [channels][group_in][kernel] */
};

/* --- plan_tiles.c --- */

struct net_plan_tiles; /* weights, scales and places of a convolution by tiles */

/** True if a convolution on bytes runs by tiles: with the bytes of oneDNN, in less time. */
bool net_plan_tiles_fit(const struct net_plan *p, const struct sst_op *op, const int8_t *weights);

/** Prepare it, and raise p->scratch_bytes to what it needs. @return 0, -ENOMEM */
SST_MUST_CHECK int net_plan_tiles_create(struct net_plan_tiles **out, struct net_plan *p, const struct sst_op *op,
                                         const struct net_plan_bytes *b);
void net_plan_tiles_destroy(struct net_plan_tiles *t);

/** @param from, to  channels last; `to` holds the residual before @param scratch  p->scratch */
SST_MUST_CHECK int net_plan_tiles_run(const struct net_plan_tiles *t, const void *from, void *to, void *scratch,
                                      int threads);

/* --- plan_bits.c --- */

/** Fill p->values; of p only graph and precision are read. */
void net_plan_choose_bits(struct net_plan *p);

bool net_plan_conv_on_8_bits(const struct net_plan *p, const struct sst_op *op);

#endif
