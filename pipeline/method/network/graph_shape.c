/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>

#include "base/log.h"
#include "pipeline/method/network/graph.h"

/* Number of windows along one axis, or 0 if none fits. */
static int64_t windows(const struct sst_op *op, int axis, int size)
{
    const int64_t window = (int64_t)op->dilation[axis] * (op->kernel[axis] - 1) + 1;
    const int64_t room = (int64_t)size + op->pad_before[axis] + op->pad_after[axis] - window;
    int64_t n;

    if (room < 0)
        return 0;
    n = (room + (op->ceil_mode ? op->stride[axis] - 1 : 0)) / op->stride[axis] + 1;
    /* A last window that would begin in the padding after the image is dropped, as in all frameworks. */
    if (op->ceil_mode && (n - 1) * op->stride[axis] >= (int64_t)size + op->pad_before[axis])
        n--;
    return n;
}

static int64_t resized(const struct sst_op *op, int axis, int size, int like)
{
    if (op->scale[axis] > 0)
        return (int64_t)(size * op->scale[axis]);
    return op->size[axis] ? op->size[axis] : like;
}

/* Height and width of an operation's result; 0 where it is impossible. */
static void op_size(const struct sst_op *op, const struct sst_shape *in, const struct sst_shape *in1, int64_t size[2])
{
    const int sizes[2] = { in->h, in->w }, like[2] = { in1->h, in1->w };

    for (int i = 0; i < 2; i++) {
        switch (op->kind) {
        case SST_OP_CONV:
        case SST_OP_MAX_POOL:
        case SST_OP_AVG_POOL:
            size[i] = windows(op, i, sizes[i]);
            break;
        case SST_OP_ADAPTIVE_POOL:
            size[i] = op->size[i];
            break;
        case SST_OP_RESIZE:
            size[i] = resized(op, i, sizes[i], like[i]);
            break;
        default:
            size[i] = sizes[i];
        }
    }
}

static int op_shape(const struct sst_op *op, struct sst_shape *shapes)
{
    int64_t size[2];

    op_size(op, &shapes[op->in[0]], &shapes[op->in[op->n_in > 1 ? 1 : 0]], size);
    for (int i = 0; i < 2; i++) {
        if (size[i] < 1 || size[i] > SST_ONNX_MAX_ELEMENTS)
            return -EINVAL;
    }
    if (size[0] * size[1] > SST_ONNX_MAX_ELEMENTS / op->channels)
        return -EINVAL;
    shapes[op->out] = (struct sst_shape){ op->channels, (int)size[0], (int)size[1] };
    /* The terms of sums and concatenations must have one size. */
    if (op->kind != SST_OP_ADD && op->kind != SST_OP_CONCAT && !op->residual)
        return 0;
    for (int i = op->residual ? 1 : 0; i < op->n_in; i++) {
        const struct sst_shape *s = &shapes[op->in[i]];

        if (s->h != (int)size[0] || s->w != (int)size[1] || (op->kind != SST_OP_CONCAT && s->c != op->channels))
            return -EINVAL;
    }
    return 0;
}

int sst_graph_shapes(const struct sst_graph *graph, int width, int height, struct sst_shape *shapes, const char *name)
{
    for (int i = 0; i < graph->n_values; i++)
        shapes[i] = (struct sst_shape){ 0 };
    if (width < 1 || height < 1 || (int64_t)width * height > SST_ONNX_MAX_ELEMENTS / graph->in_channels)
        goto impossible;
    shapes[graph->input] = (struct sst_shape){ graph->in_channels, height, width };
    for (int i = 0; i < graph->n_ops; i++) {
        if (op_shape(&graph->ops[i], shapes))
            goto impossible;
    }
    return 0;

impossible:
    if (name)
        sst_log_error(
            "model %s: the network cannot run on an image of %d x %d: a layer's input is too small, too large or"
            " does not fit the layer it is joined with",
            name, width, height);
    return -EINVAL;
}
