/* pipeline/method/network/graph.h - a network as a list of validated operations, ready to plan for any input size. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_NETWORK_GRAPH_H
#define SST_PIPELINE_METHOD_NETWORK_GRAPH_H

#include <stdbool.h>

#include "pipeline/method/network/network.h"
#include "pipeline/method/network/onnx.h"

enum sst_op_kind {
    SST_OP_CONV = 0,
    SST_OP_RELU = 1,
    SST_OP_ADD = 2,
    SST_OP_CONCAT = 3, /* of channels */
    SST_OP_MAX_POOL = 4,
    SST_OP_AVG_POOL = 5,
    SST_OP_ADAPTIVE_POOL = 6, /* mean over bins floor(i n / m) .. ceil((i + 1) n / m) */
    SST_OP_RESIZE = 7,        /* bilinear */
    SST_OP_SOFTMAX = 8,       /* over channels */
    SST_OP_NORMALIZE = 9, /* over channels: x / max(sqrt(max(S + in_add, in_min)) + add, min), S = sum x^2; 0 for 0/0 */
};

/** Where output sample i of a resize lies among the input's samples; scale = output / input size. */
enum sst_resize_mode {
    SST_RESIZE_HALF_PIXEL = 0,    /* (i + 0.5) / scale - 0.5 */
    SST_RESIZE_PYTORCH = 1,       /* the same, but 0 for an output of one sample */
    SST_RESIZE_ALIGN_CORNERS = 2, /* i (in - 1) / (out - 1) */
    SST_RESIZE_ASYMMETRIC = 3,    /* i / scale */
};

#define SST_GRAPH_MAX_OPS 1024

/* Metadata key: a line per value (input and node results) with the largest |x| that 8 bits must hold, and its name. */
#define SST_RANGES_KEY "sst.ranges"
/* Limit of the numbers in all operations' weights: twice what a file can hold, as constants may be shared. */
#define SST_GRAPH_MAX_WEIGHTS ((int64_t)2 * (int64_t)(SST_ONNX_MAX_BYTES / sizeof(float)))

/* For softmax and normalisation. */
#define SST_OP_MAX_CHANNELS 2048

/** One operation. Values are numbers; pairs are (vertical, horizontal). */
struct sst_op {
    enum sst_op_kind kind;
    int n_in, in[SST_ONNX_MAX_INS], out;
    int channels; /* of out */

    /* conv and pools; dilation 1 is dense */
    int kernel[2], stride[2], dilation[2], pad_before[2], pad_after[2];
    int group, group_in; /* groups, and input channels of each */
    bool ceil_mode, count_pad;
    float *weights, *bias; /* [out][group_in][kernel] and [out]; batch normalisation is folded in */
    bool residual;         /* in[1] is added to the convolution, before relu */
    bool relu;             /* of a convolution's result */

    /* resize: size by `scale`, or `size`, or (both 0) that of in[1]; adaptive pool: `size` */
    enum sst_resize_mode mode;
    double scale[2];
    int size[2];

    double norm_in_add, norm_in_min, norm_add, norm_min;
};

struct sst_graph {
    int n_ops, n_values;
    struct sst_op *ops; /* in an order in which they can run */
    int input, output;  /* values */
    int in_channels, out_channels;
    float *range; /* [n_values] largest |x| for 8 bits, 0: unknown; NULL: the file has none */
};

/**
 * Build the operations from a model: constants are resolved, batch normalisation, relu and residual sums fused into
 * convolutions, normalisation patterns recognised, unused nodes dropped. The model may be freed afterwards.
 *
 * @param why  out, when -ENOTSUP: what is not supported, for a message (256 bytes)
 * @return 0, -ENOTSUP (not logged), -EBADMSG (inconsistent: cycles, unknown names, wrong shapes; logged), -ENOMEM.
 */
SST_MUST_CHECK int sst_graph_build(struct sst_graph *out, const struct sst_onnx *model, const char *name,
                                   char why[256]);
void sst_graph_fini(struct sst_graph *graph);

/**
 * Shapes of all values for an input size.
 *
 * @param shapes  out [n_values]; 0 for values that no operation produces
 * @param name    for the message; NULL: no message
 * @return 0, -EINVAL: the network cannot run at this size (logged)
 */
SST_MUST_CHECK int sst_graph_shapes(const struct sst_graph *graph, int width, int height, struct sst_shape *shapes,
                                    const char *name);

#endif
