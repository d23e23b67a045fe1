/* Converts ONNX nodes to operations. Nodes that only rescale, clip or add to a convolution are fused into it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/method/network/network_internal.h"

/* Limit of strides, dilations, padding and pool windows; it also keeps sizes inside int. */
#define MAX_WINDOW 4096

typedef int translate_fn(struct graph_builder *b, const struct raw_node *node);

/* A value with channels that a node reads; `pad` comes from a Pad node, which only convolutions support. */
static int image_value(struct graph_builder *b, const struct raw_node *node, int v, bool padding_is_fine, int *out)
{
    const struct raw_value *value;

    v = graph_original(b, v);
    value = &b->values[v];
    if (!value->channels)
        return graph_unsupported(b, node->onnx, "of a constant or of something that is not an image");
    if (!padding_is_fine && value->unpadded >= 0)
        return graph_unsupported(b, node->onnx, "after Pad");
    *out = v;
    return 0;
}

static int input_value(struct graph_builder *b, const struct raw_node *node, int in, bool padding_is_fine, int *out)
{
    if (in >= node->onnx->n_in || node->in[in] < 0)
        return graph_wrong(b, node->onnx, "lacks an input");
    return image_value(b, node, node->in[in], padding_is_fine, out);
}

/* A new operation with input 0 set and the channels of that input; the array has room for one per node. */
static int new_op(struct graph_builder *b, const struct raw_node *node, enum sst_op_kind kind, struct sst_op **out)
{
    struct sst_op *op = &b->graph.ops[b->graph.n_ops];
    int v = 0, err = input_value(b, node, 0, kind == SST_OP_CONV, &v);

    if (err)
        return err;
    if (b->graph.n_ops == SST_GRAPH_MAX_OPS)
        return graph_unsupported(b, node->onnx, "as layer 1025; at most 1024 are planned");
    if ((kind == SST_OP_SOFTMAX || kind == SST_OP_NORMALIZE) && b->values[v].channels > SST_OP_MAX_CHANNELS)
        return graph_unsupported(b, node->onnx, "of more than 2048 channels");
    *op = (struct sst_op){
        .kind = kind,
        .n_in = 1,
        .in = { v },
        .out = node->out[0],
        .channels = b->values[v].channels,
        .stride = { 1, 1 },
        .dilation = { 1, 1 },
        .group = 1,
    };
    *out = op;
    return 0;
}

static int commit_op(struct graph_builder *b, struct sst_op *op)
{
    b->values[op->out].op = b->graph.n_ops++;
    b->values[op->out].channels = op->channels;
    return 0;
}

static int make_alias(struct graph_builder *b, const struct raw_node *node, int v)
{
    b->values[node->out[0]].alias = v;
    /* Merge the readers of both values, except this node. */
    b->values[v].users += b->values[node->out[0]].users - 1;
    return 0;
}

/* The convolution that produces a value read by this node alone, so that it may be changed; else NULL. */
static struct sst_op *private_conv(const struct graph_builder *b, int v)
{
    const struct raw_value *value = &b->values[v];
    struct sst_op *op = value->op >= 0 ? &b->graph.ops[value->op] : NULL;

    return op && op->kind == SST_OP_CONV && value->users == 1 && !op->relu ? op : NULL;
}

static int fuse(struct graph_builder *b, struct sst_op *op, int out)
{
    b->values[out].op = (int)(op - b->graph.ops);
    b->values[out].channels = op->channels;
    op->out = out;
    return 0;
}

static int read_pair(struct graph_builder *b, const struct raw_node *node, const char *name, int min, int out[2])
{
    struct sst_onnx_attr a;

    if (!sst_onnx_attr_find(node->onnx, name, &a))
        return 0;
    if (a.n_ints != 2 || a.ints[0] < min || a.ints[1] < min || a.ints[0] > MAX_WINDOW || a.ints[1] > MAX_WINDOW)
        return graph_wrong(b, node->onnx, "has a window, stride, dilation or size that is not two numbers up to 4096");
    out[0] = (int)a.ints[0];
    out[1] = (int)a.ints[1];
    return 0;
}

/* Strides, dilations, pads of convolutions and pools. */
static int read_window(struct graph_builder *b, const struct raw_node *node, struct sst_op *op)
{
    struct sst_onnx_attr a;
    int err;

    if (sst_onnx_attr_find(node->onnx, "auto_pad", &a) && a.s.n && !sst_onnx_str_is(a.s, "NOTSET") &&
        !sst_onnx_str_is(a.s, "VALID"))
        return graph_unsupported(b, node->onnx, "with automatic padding");
    err = read_pair(b, node, "strides", 1, op->stride);
    err = err ? err : read_pair(b, node, "dilations", 1, op->dilation);
    if (err || !sst_onnx_attr_find(node->onnx, "pads", &a))
        return err;
    if (a.n_ints != 4)
        return graph_wrong(b, node->onnx, "has not four pads");
    for (int i = 0; i < 4; i++) {
        if (a.ints[i] < 0 || a.ints[i] > MAX_WINDOW)
            return graph_wrong(b, node->onnx, "has pads outside 0..4096");
        (i < 2 ? op->pad_before : op->pad_after)[i & 1] = (int)a.ints[i];
    }
    return 0;
}

/* --- convolution and fused nodes -------------------------------------------------------- */

static int copy_weights(struct graph_builder *b, const struct raw_node *node, struct sst_op *op)
{
    const struct sst_onnx_tensor *w = graph_constant(b, node, 1), *bias = graph_constant(b, node, 2);

    if (node->onnx->n_in > 2 && node->in[2] >= 0 && (!bias || !bias->f || bias->count != op->channels))
        return graph_wrong(b, node->onnx, "has a bias that is not one constant per channel");
    b->weights += w->count;
    if (b->weights > SST_GRAPH_MAX_WEIGHTS)
        return graph_wrong(b, node->onnx, "shares constants with other nodes, more than 128 MiB in all");
    op->weights = malloc((size_t)w->count * sizeof(float));
    op->bias = calloc((size_t)op->channels, sizeof(float));
    if (!op->weights || !op->bias) {
        free(op->weights);
        free(op->bias);
        return -ENOMEM;
    }
    memcpy(op->weights, w->f, (size_t)w->count * sizeof(float));
    if (bias)
        memcpy(op->bias, bias->f, (size_t)op->channels * sizeof(float));
    return 0;
}

static int conv(struct graph_builder *b, const struct raw_node *node)
{
    const struct sst_onnx_tensor *w = graph_constant(b, node, 1);
    const int64_t group = sst_onnx_attr_int(node->onnx, "group", 1);
    const struct raw_value *in;
    struct sst_op *op = NULL;
    int err = new_op(b, node, SST_OP_CONV, &op);

    if (err)
        return err;
    if (!w)
        return graph_unsupported(b, node->onnx, "with weights that are computed");
    if (!w->f || w->n_dims != 4)
        return graph_unsupported(b, node->onnx, "with weights that are not four-dimensional floats");
    if (group < 1 || group > w->dims[0] || w->dims[0] % group || w->dims[1] * group != op->channels ||
        w->dims[0] > 65536 || w->dims[2] > MAX_WINDOW || w->dims[3] > MAX_WINDOW)
        return graph_wrong(b, node->onnx, "has weights that do not fit its input or groups");
    err = read_pair(b, node, "kernel_shape", 1, op->kernel);
    if (err)
        return err;
    if (op->kernel[0] && (op->kernel[0] != w->dims[2] || op->kernel[1] != w->dims[3]))
        return graph_wrong(b, node->onnx, "has a kernel_shape that is not that of its weights");
    op->group = (int)group;
    op->group_in = (int)w->dims[1];
    op->channels = (int)w->dims[0];
    for (int i = 0; i < 2; i++)
        op->kernel[i] = (int)w->dims[2 + i];
    err = read_window(b, node, op);
    if (err)
        return err;
    in = &b->values[op->in[0]];
    if (in->unpadded >= 0) {
        for (int i = 0; i < 4; i++)
            (i < 2 ? op->pad_before : op->pad_after)[i & 1] += in->pad[i];
        op->in[0] = in->unpadded;
    }
    err = copy_weights(b, node, op);
    return err ? err : commit_op(b, op);
}

static int batch_norm(struct graph_builder *b, const struct raw_node *node)
{
    const struct sst_onnx_tensor *p[4]; /* scale, shift, mean, variance */
    struct sst_onnx_attr a;
    const double eps = sst_onnx_attr_find(node->onnx, "epsilon", &a) ? (double)a.f : 1e-5;
    struct sst_op *op = NULL;
    size_t per_channel;
    int v = 0, err = input_value(b, node, 0, false, &v);

    if (err)
        return err;
    for (int i = 0; i < 4; i++) {
        p[i] = graph_constant(b, node, 1 + i);
        if (!p[i] || !p[i]->f || p[i]->count != b->values[v].channels)
            return graph_wrong(b, node->onnx, "has parameters that are not one constant per channel");
    }
    if (sst_onnx_attr_int(node->onnx, "training_mode", 0))
        return graph_unsupported(b, node->onnx, "in training mode");
    op = private_conv(b, v);
    if (!op || op->residual)
        return graph_unsupported(b, node->onnx, "that does not follow a convolution");
    per_channel = (size_t)op->group_in * (size_t)op->kernel[0] * (size_t)op->kernel[1];
    for (int c = 0; c < op->channels; c++) {
        const double variance = (double)p[3]->f[c] + eps, s = p[0]->f[c] / sqrt(variance > 0 ? variance : 1);
        float *w = op->weights + (size_t)c * per_channel;
        bool finite;

        if (!(variance > 0))
            return graph_wrong(b, node->onnx, "has a variance that is not positive");
        op->bias[c] = (float)((op->bias[c] - (double)p[2]->f[c]) * s + p[1]->f[c]);
        finite = isfinite(op->bias[c]);
        for (size_t i = 0; i < per_channel; i++) {
            w[i] = (float)(w[i] * s);
            finite &= isfinite(w[i]);
        }
        if (!finite)
            return graph_wrong(b, node->onnx, "overflows the weights that it scales");
    }
    return fuse(b, op, node->out[0]);
}

static int relu(struct graph_builder *b, const struct raw_node *node)
{
    struct sst_op *op = NULL, *made;
    int err = new_op(b, node, SST_OP_RELU, &op);

    if (err)
        return err;
    made = private_conv(b, op->in[0]);
    if (!made)
        return commit_op(b, op);
    made->relu = true;
    return fuse(b, made, node->out[0]);
}

/* A sum is fused into the convolution that produces one of its terms, if the other term precedes it. */
static int add(struct graph_builder *b, const struct raw_node *node)
{
    struct sst_op *op = NULL, *made = NULL;
    int other = 0, err = new_op(b, node, SST_OP_ADD, &op);

    if (!err && node->onnx->n_in != 2)
        return graph_wrong(b, node->onnx, "has not two inputs");
    err = err ? err : input_value(b, node, 1, false, &op->in[1]);
    if (err)
        return err;
    if (b->values[op->in[1]].channels != op->channels)
        return graph_unsupported(b, node->onnx, "of different numbers of channels");
    op->n_in = 2;
    for (int i = 0; i < 2 && !made; i++) {
        other = op->in[1 - i];
        made = private_conv(b, op->in[i]);
        if (made && (made->residual || b->values[other].op >= b->values[op->in[i]].op))
            made = NULL;
    }
    if (!made)
        return commit_op(b, op);
    made->residual = true;
    made->in[1] = other;
    made->n_in = 2;
    return fuse(b, made, node->out[0]);
}

/* --- the other layers ----------------------------------------------------------------------------- */

static int concat(struct graph_builder *b, const struct raw_node *node)
{
    const int64_t axis = sst_onnx_attr_int(node->onnx, "axis", 1);
    struct sst_op *op = NULL;
    int err = new_op(b, node, SST_OP_CONCAT, &op);

    if (!err && axis != 1 && axis != -3)
        return graph_unsupported(b, node->onnx, "along another axis than the channels");
    for (int i = 1; !err && i < node->onnx->n_in; i++) {
        err = input_value(b, node, i, false, &op->in[i]);
        if (!err)
            op->channels += b->values[op->in[i]].channels;
    }
    if (err)
        return err;
    if (op->channels > 65536)
        return graph_wrong(b, node->onnx, "produces more than 65536 channels");
    op->n_in = node->onnx->n_in;
    return commit_op(b, op);
}

static int pool(struct graph_builder *b, const struct raw_node *node)
{
    const bool max = graph_is(node->onnx, "MaxPool");
    struct sst_op *op = NULL;
    int err = new_op(b, node, max ? SST_OP_MAX_POOL : SST_OP_AVG_POOL, &op);

    err = err ? err : read_pair(b, node, "kernel_shape", 1, op->kernel);
    err = err ? err : read_window(b, node, op);
    if (err)
        return err;
    if (!op->kernel[0])
        return graph_wrong(b, node->onnx, "has no kernel_shape");
    if (node->onnx->n_out > 1)
        return graph_unsupported(b, node->onnx, "with indices");
    op->ceil_mode = sst_onnx_attr_int(node->onnx, "ceil_mode", 0) != 0;
    op->count_pad = sst_onnx_attr_int(node->onnx, "count_include_pad", 0) != 0;
    if (!max && (op->dilation[0] != 1 || op->dilation[1] != 1 || (op->ceil_mode && op->count_pad)))
        return graph_unsupported(b, node->onnx, "with dilation, or with ceil_mode that counts the padding");
    for (int i = 0; i < 2; i++) {
        const int window = op->dilation[i] * (op->kernel[i] - 1) + 1;

        if (op->pad_before[i] >= window || op->pad_after[i] >= window)
            return graph_wrong(b, node->onnx, "has pads as wide as its window");
    }
    return commit_op(b, op);
}

static int adaptive_pool(struct graph_builder *b, const struct raw_node *node)
{
    struct sst_op *op = NULL;
    int err = new_op(b, node, SST_OP_ADAPTIVE_POOL, &op);

    if (!err && graph_is(node->onnx, "GlobalAveragePool"))
        op->size[0] = op->size[1] = 1;
    else if (!err)
        err = read_pair(b, node, "output_size", 1, op->size);
    if (err)
        return err;
    return op->size[0] ? commit_op(b, op) : graph_wrong(b, node->onnx, "has no output_size");
}

static int resize_mode(struct graph_builder *b, const struct raw_node *node, struct sst_op *op)
{
    static const char *const names[] = { "half_pixel", "pytorch_half_pixel", "align_corners", "asymmetric" };
    const bool before_11 = graph_is(node->onnx, "Upsample") || b->model->opset < 11;
    struct sst_onnx_attr a;

    if (!sst_onnx_attr_find(node->onnx, "mode", &a) ||
        !(sst_onnx_str_is(a.s, "linear") || sst_onnx_str_is(a.s, "bilinear")))
        return graph_unsupported(b, node->onnx, "that is not bilinear");
    op->mode = before_11 ? SST_RESIZE_ASYMMETRIC : SST_RESIZE_HALF_PIXEL;
    if (before_11 || !sst_onnx_attr_find(node->onnx, "coordinate_transformation_mode", &a))
        return 0;
    for (size_t i = 0; i < ARRAY_LEN(names); i++) {
        if (sst_onnx_str_is(a.s, names[i])) {
            op->mode = (enum sst_resize_mode)i;
            return 0;
        }
    }
    return graph_unsupported(b, node->onnx, "with this coordinate_transformation_mode");
}

/* X, scales (opset 9 and 10); X, roi, scales, sizes (from 11), of which one of the last two is empty. */
static int resize(struct graph_builder *b, const struct raw_node *node)
{
    const int at = graph_is(node->onnx, "Upsample") || b->model->opset < 11 ? 1 : 2;
    const struct sst_onnx_tensor *scales = graph_constant(b, node, at);
    struct resize_target to;
    struct sst_op *op = NULL;
    int err = new_op(b, node, SST_OP_RESIZE, &op);

    err = err ? err : resize_mode(b, node, op);
    if (err)
        return err;
    if (scales && scales->f && scales->count == 4) {
        if (scales->f[0] != 1 || scales->f[1] != 1)
            return graph_unsupported(b, node->onnx, "of the channels");
        for (int i = 0; i < 2; i++) {
            op->scale[i] = scales->f[2 + i];
            if (!(op->scale[i] >= 1e-4 && op->scale[i] <= 1e4))
                return graph_wrong(b, node->onnx, "has a scale outside 0.0001..10000");
        }
    } else if (!graph_resize_target(b, node, &to)) {
        return graph_unsupported(b, node->onnx,
                                 "to a size that is computed; export it with fixed scales, a fixed size or the size"
                                 " of another image");
    } else if (to.like >= 0) {
        op->n_in = 2;
        err = image_value(b, node, to.like, false, &op->in[1]);
        if (err)
            return err;
    } else {
        for (int i = 0; i < 2; i++) {
            if (to.size[i] < 1 || to.size[i] > 65536)
                return graph_wrong(b, node->onnx, "has a size outside 1..65536");
            op->size[i] = (int)to.size[i];
        }
    }
    return commit_op(b, op);
}

static int resize_like(struct graph_builder *b, const struct raw_node *node)
{
    struct sst_op *op = NULL;
    int err = new_op(b, node, SST_OP_RESIZE, &op);

    err = err ? err : input_value(b, node, 1, false, &op->in[1]);
    if (err)
        return err;
    op->n_in = 2;
    op->mode = sst_onnx_attr_int(node->onnx, "align_corners", 0) ? SST_RESIZE_ALIGN_CORNERS : SST_RESIZE_HALF_PIXEL;
    return commit_op(b, op);
}

static int softmax(struct graph_builder *b, const struct raw_node *node)
{
    const int64_t axis = sst_onnx_attr_int(node->onnx, "axis", -1);
    struct sst_op *op = NULL;
    int err = new_op(b, node, SST_OP_SOFTMAX, &op);

    if (err)
        return err;
    /* Before opset 13 softmax runs over all axes from `axis` on. */
    if (b->model->opset < 13 || (axis != 1 && axis != -3))
        return graph_unsupported(b, node->onnx, "that is not over the channels");
    return commit_op(b, op);
}

static int lp_norm(struct graph_builder *b, const struct raw_node *node)
{
    const int64_t axis = sst_onnx_attr_int(node->onnx, "axis", -1);
    struct sst_op *op = NULL;
    int err = new_op(b, node, SST_OP_NORMALIZE, &op);

    if (err)
        return err;
    if ((axis != 1 && axis != -3) || sst_onnx_attr_int(node->onnx, "p", 2) != 2)
        return graph_unsupported(b, node->onnx, "that is not the length over the channels");
    return commit_op(b, op);
}

static int norm_pattern(struct graph_builder *b, const struct raw_node *node)
{
    struct sst_op *op = NULL;
    int err = new_op(b, node, SST_OP_NORMALIZE, &op);

    if (err)
        return err;
    op->norm_in_add = node->norm.in_add;
    op->norm_in_min = node->norm.in_min;
    op->norm_add = node->norm.add;
    op->norm_min = node->norm.min;
    return commit_op(b, op);
}

static int identity(struct graph_builder *b, const struct raw_node *node)
{
    if (node->onnx->n_in < 1 || node->in[0] < 0)
        return graph_wrong(b, node->onnx, "lacks an input");
    return make_alias(b, node, graph_original(b, node->in[0]));
}

static int constant(struct graph_builder *b, const struct raw_node *node)
{
    return b->values[node->out[0]].constant ? 0 : graph_unsupported(b, node->onnx, "without a tensor");
}

/* Pads as an input (from opset 11) or as an attribute: begins, then ends, of the four axes. */
static int pad(struct graph_builder *b, const struct raw_node *node)
{
    const struct sst_onnx_tensor *t = graph_constant(b, node, 1), *fill = graph_constant(b, node, 2);
    struct raw_value *out = &b->values[node->out[0]];
    const int64_t *pads = t && t->i && t->count == 8 ? t->i : NULL;
    struct sst_onnx_attr a, value;
    int v = 0, err = input_value(b, node, 0, false, &v);

    if (err)
        return err;
    if (sst_onnx_attr_find(node->onnx, "mode", &a) && !sst_onnx_str_is(a.s, "constant"))
        return graph_unsupported(b, node->onnx, "that does not pad with zeros");
    if ((sst_onnx_attr_find(node->onnx, "value", &value) && value.f != 0) ||
        (node->onnx->n_in > 2 && node->in[2] >= 0 && (!fill || !fill->f || fill->f[0] != 0)))
        return graph_unsupported(b, node->onnx, "that does not pad with zeros");
    if (!pads && sst_onnx_attr_find(node->onnx, "pads", &a) && a.n_ints == 8)
        pads = a.ints;
    if (!pads || pads[0] || pads[1] || pads[4] || pads[5])
        return graph_unsupported(b, node->onnx, "of other axes than height and width");
    for (int i = 0; i < 4; i++) {
        const int64_t n = pads[(i < 2 ? 2 : 6) + (i & 1)];

        if (n < 0 || n > MAX_WINDOW)
            return graph_wrong(b, node->onnx, "has pads outside 0..4096");
        out->pad[i] = (int)n;
    }
    if (!out->pad[0] && !out->pad[1] && !out->pad[2] && !out->pad[3])
        return make_alias(b, node, v);
    out->unpadded = v;
    out->channels = b->values[v].channels;
    return 0;
}

int graph_translate(struct graph_builder *b, const struct raw_node *node)
{
    static const struct {
        const char *op;
        translate_fn *fn;
    } standard[] = {
        { "Conv", conv }, { "BatchNormalization", batch_norm }, { "Relu", relu }, { "Add", add }, { "Concat", concat },
        { "MaxPool", pool }, { "AveragePool", pool }, { "GlobalAveragePool", adaptive_pool }, { "Resize", resize },
        { "Upsample", resize }, { "Softmax", softmax }, { "LpNormalization", lp_norm }, { "Identity", identity },
        { "Dropout", identity }, { "Constant", constant }, { "Pad", pad },
    }, own[] = {
        { "AdaptiveAveragePool", adaptive_pool }, { "ResizeLike", resize_like },
    };

    if (node->norm.found)
        return norm_pattern(b, node);
    for (size_t i = 0; i < ARRAY_LEN(standard); i++) {
        if (graph_is(node->onnx, standard[i].op))
            return standard[i].fn(b, node);
    }
    for (size_t i = 0; sst_onnx_str_is(node->onnx->domain, "sst") && i < ARRAY_LEN(own); i++) {
        if (sst_onnx_str_is(node->onnx->op, own[i].op))
            return own[i].fn(b, node);
    }
    return graph_unsupported(b, node->onnx, "");
}
