/* What the values of a network's result are, by the nodes at its end: those that only move or enlarge values are followed
 * to the one that makes them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */

#include "pipeline/method/network/onnx.h"

/* The axis of the channels, counted from the first (0) and from the last (-1) as ONNX does; UNKNOWN: lost. */
struct axis {
    int64_t start, end;
};

#define UNKNOWN INT64_MIN

/* Nodes that only move, cut or enlarge values. */
static const char *const moves[] = { "Identity",  "Dropout", "Cast",      "Resize", "Upsample", "ResizeLike", "Clip",
                                     "Slice",     "Reshape", "Flatten",   "Squeeze", "Unsqueeze", "Transpose" };

static bool is_one_of(const struct sst_onnx_node *node, const char *const *names, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        if (sst_onnx_str_is(node->op, names[i]))
            return true;
    }
    return false;
}

static const struct sst_onnx_node *producer(const struct sst_onnx *model, struct sst_onnx_str value)
{
    for (int n = 0; value.n && n < model->n_nodes; n++) {
        for (int i = 0; i < model->nodes[n].n_out; i++) {
            if (sst_onnx_str_same(model->nodes[n].out[i], value))
                return &model->nodes[n];
        }
    }
    return NULL;
}

/* The axis before a node that only moves values. */
static struct axis axis_before(const struct sst_onnx_node *node, struct axis a)
{
    struct sst_onnx_attr perm;

    if (sst_onnx_str_is(node->op, "Squeeze") || sst_onnx_str_is(node->op, "Unsqueeze"))
        return (struct axis){ UNKNOWN, a.end };
    if (sst_onnx_str_is(node->op, "Reshape") || sst_onnx_str_is(node->op, "Flatten"))
        return (struct axis){ a.start == 1 ? 1 : UNKNOWN, a.end == -1 ? -1 : UNKNOWN };
    if (!sst_onnx_str_is(node->op, "Transpose"))
        return a;
    if (!sst_onnx_attr_find(node, "perm", &perm)) /* reverses */
        return (struct axis){ a.end == UNKNOWN ? UNKNOWN : -1 - a.end, a.start == UNKNOWN ? UNKNOWN : -1 - a.start };
    if (a.start == UNKNOWN && a.end != UNKNOWN)
        a.start = a.end + perm.n_ints;
    if (a.start < 0 || a.start >= perm.n_ints || perm.n_ints > SST_ONNX_MAX_DIMS)
        return (struct axis){ UNKNOWN, UNKNOWN };
    return (struct axis){ perm.ints[a.start], perm.ints[a.start] - perm.n_ints };
}

/* False where a softmax is known to be over other axes. Before opset 13 it is over all from its axis on; shares of a sum
 * over the whole image are shares of the channels' sum as well. */
static bool over_channels(const struct sst_onnx *model, const struct sst_onnx_node *node, struct axis a)
{
    const int64_t axis = sst_onnx_attr_int(node, "axis", model->opset < 13 ? 1 : -1);
    const int64_t channels = axis < 0 ? a.end : a.start;

    if (channels == UNKNOWN)
        return true;
    return model->opset < 13 ? channels >= axis : channels == axis;
}

/* exp(x) / sum of exp(x), in single nodes. */
static bool is_softmax_in_steps(const struct sst_onnx *model, const struct sst_onnx_node *node)
{
    const struct sst_onnx_node *exp = producer(model, node->in[0]), *sum = producer(model, node->in[1]);

    return sst_onnx_str_is(node->op, "Div") && exp && sum && sst_onnx_str_is(exp->op, "Exp") &&
           sst_onnx_str_is(sum->op, "ReduceSum") && sst_onnx_str_same(sum->in[0], node->in[0]);
}

/* x * 255, 1 - x and the like. @return the input that is no constant, or an empty name: it is another node */
static struct sst_onnx_str scaled(const struct sst_onnx *model, const struct sst_onnx_node *node)
{
    static const char *const steps[] = { "Mul", "Div", "Add", "Sub" };

    for (int i = 0; i < 2 && node->n_in == 2 && is_one_of(node, steps, ARRAY_LEN(steps)); i++) {
        const struct sst_onnx_node *other = producer(model, node->in[i]);

        if (sst_onnx_is_constant(model, &(struct sst_onnx_value){ .name = node->in[i] }) ||
            (other && sst_onnx_str_is(other->op, "Constant")))
            return node->in[1 - i];
    }
    return (struct sst_onnx_str){ 0 };
}

/* Whether arithmetic with constants leads back to a softmax or a sigmoid. */
static bool is_scaled_share(const struct sst_onnx *model, const struct sst_onnx_node *node)
{
    static const char *const shares[] = { "Softmax", "Sigmoid", "HardSigmoid" };
    bool changed = false;

    for (int steps = 0; node && steps < model->n_nodes; steps++) {
        const struct sst_onnx_str from = scaled(model, node);

        if (is_one_of(node, shares, ARRAY_LEN(shares)))
            return changed;
        if (!from.n && !is_one_of(node, moves, ARRAY_LEN(moves)))
            return false;
        changed |= from.n > 0;
        node = producer(model, from.n ? from : node->in[0]);
    }
    return false;
}

enum sst_network_values sst_onnx_ending(const struct sst_onnx *model, struct sst_onnx_str *op)
{
    static const char *const classes[] = { "ArgMax", "ArgMin", "TopK", "Hardmax" };
    static const char *const shares[] = { "Softmax", "LogSoftmax" }, *const sigmoids[] = { "Sigmoid", "HardSigmoid" };
    const struct sst_onnx_node *node = model->n_outs ? producer(model, model->outs[0].name) : NULL;
    struct axis a = { 1, -3 };

    for (int steps = 0; node && steps < model->n_nodes; steps++) {
        *op = node->op;
        if (is_one_of(node, moves, ARRAY_LEN(moves))) {
            a = axis_before(node, a);
            node = producer(model, node->in[0]);
            continue;
        }
        if (is_one_of(node, classes, ARRAY_LEN(classes)))
            return SST_NETWORK_CLASSES;
        if (is_one_of(node, sigmoids, ARRAY_LEN(sigmoids)))
            return SST_NETWORK_PROBABILITIES;
        if (is_softmax_in_steps(model, node))
            return SST_NETWORK_PROBABILITIES;
        if (is_scaled_share(model, node))
            return SST_NETWORK_SCALED;
        if (!is_one_of(node, shares, ARRAY_LEN(shares)))
            break;
        if (!over_channels(model, node, a))
            return SST_NETWORK_OTHER_AXIS;
        return sst_onnx_str_is(node->op, "Softmax") ? SST_NETWORK_PROBABILITIES : SST_NETWORK_LOGARITHMS;
    }
    return SST_NETWORK_VALUES;
}
