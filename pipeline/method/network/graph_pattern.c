/* Recognises patterns of several nodes that form one layer.
 *
 * x / |x| over channels is exported in single steps:
 *   Div(x, D), D = [Expand] [Clip | Max | Add] N,  N = ReduceL2(x)  or  Sqrt([Clip | Max | Add] S),
 *   S = ReduceSum(x x) or ReduceSumSquare(x),  x x = Mul(x, x) or Pow(x, 2). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */

#include "pipeline/method/network/network_internal.h"

/* The node that produces input `in` of a node, or NULL. */
static const struct raw_node *maker(const struct graph_builder *b, const struct raw_node *node, int in)
{
    const int v = in < node->onnx->n_in ? node->in[in] : -1;

    return v >= 0 && b->values[v].node >= 0 ? &b->nodes[b->values[v].node] : NULL;
}

static bool one_number(const struct sst_onnx_tensor *t, double *out)
{
    if (!t || t->count != 1 || !t->f)
        return false;
    *out = t->f[0];
    return true;
}

/* Skip one Clip, Max or Add of a constant and record it. */
static const struct raw_node *peel(const struct graph_builder *b, const struct raw_node *node, double *add, double *min)
{
    struct sst_onnx_attr a;
    double v;

    if (!node)
        return NULL;
    if (graph_is(node->onnx, "Clip")) {
        if (sst_onnx_attr_find(node->onnx, "min", &a))
            v = a.f;
        else if (!one_number(graph_constant(b, node, 1), &v))
            return NULL;
        if ((node->onnx->n_in > 2 && node->in[2] >= 0) || sst_onnx_attr_find(node->onnx, "max", &a) || v < 0)
            return NULL;
        *min = v;
        return maker(b, node, 0);
    }
    if (graph_is(node->onnx, "Max") || graph_is(node->onnx, "Add")) {
        const int c = graph_constant(b, node, 1) ? 1 : 0;

        if (node->onnx->n_in != 2 || !one_number(graph_constant(b, node, c), &v) || v < 0)
            return NULL;
        *(graph_is(node->onnx, "Max") ? min : add) = v;
        return maker(b, node, 1 - c);
    }
    return node;
}

/* True for a reduction over axis 1 that keeps the axis. */
static bool reduces_channels(const struct graph_builder *b, const struct raw_node *node, const char *op)
{
    const struct sst_onnx_tensor *t = graph_constant(b, node, 1);
    struct sst_onnx_attr a;

    if (!graph_is(node->onnx, op) || sst_onnx_attr_int(node->onnx, "keepdims", 1) != 1)
        return false;
    if (sst_onnx_attr_find(node->onnx, "axes", &a))
        return a.n_ints == 1 && (a.ints[0] == 1 || a.ints[0] == -3);
    return t && t->count == 1 && t->i && (t->i[0] == 1 || t->i[0] == -3);
}

static bool is_square(const struct graph_builder *b, const struct raw_node *node, int x)
{
    double power;

    if (!node || node->in[0] != x)
        return false;
    if (graph_is(node->onnx, "Mul"))
        return node->onnx->n_in == 2 && node->in[1] == x;
    return graph_is(node->onnx, "Pow") && one_number(graph_constant(b, node, 1), &power) && power == 2;
}

struct graph_norm graph_find_norm(const struct graph_builder *b, const struct raw_node *node)
{
    struct graph_norm norm = { 0 };
    const struct raw_node *d;

    if (!graph_is(node->onnx, "Div") || node->onnx->n_in != 2 || node->in[0] < 0 || b->values[node->in[0]].constant)
        return norm;
    norm.x = node->in[0];
    d = maker(b, node, 1);
    if (d && graph_is(d->onnx, "Expand"))
        d = maker(b, d, 0);
    d = peel(b, d, &norm.add, &norm.min);
    if (!d)
        return norm;
    if (reduces_channels(b, d, "ReduceL2")) {
        norm.found = d->in[0] == norm.x;
    } else if (graph_is(d->onnx, "Sqrt")) {
        d = peel(b, maker(b, d, 0), &norm.in_add, &norm.in_min);
        if (d && reduces_channels(b, d, "ReduceSumSquare"))
            norm.found = d->in[0] == norm.x;
        else if (d && reduces_channels(b, d, "ReduceSum"))
            norm.found = is_square(b, maker(b, d, 0), norm.x);
    }
    return norm;
}

/* --- sizes of a Resize: x.shape[2:] comes as Concat(Slice(Shape(y), 0, 2), Cast(Concat(Unsqueeze(Gather(Shape(x), 2)),
 * ...))), a fixed size as Concat(Slice(Shape(y), 0, 2), [h, w]) --------------------------------------------------- */

/* One element of such an integer list: a constant, or the size of an image along an axis. */
struct element {
    int value; /* -1: a constant */
    int64_t n; /* the constant, or the axis */
};

/* Bounds the search in nested lists; real ones take about 20 steps. */
struct search {
    const struct graph_builder *b;
    int steps_left;
};

static const struct sst_onnx_tensor *integers(const struct sst_onnx_tensor *t)
{
    return t && t->i && t->count ? t : NULL;
}

/* The first number of a constant input, or of the attribute that older files use. */
static bool first_of(const struct graph_builder *b, const struct raw_node *node, int in, const char *attr, int64_t *out)
{
    const struct sst_onnx_tensor *t = integers(graph_constant(b, node, in));
    struct sst_onnx_attr a;

    if (t)
        *out = t->i[0];
    else if (sst_onnx_attr_find(node->onnx, attr, &a) && a.n_ints > 0)
        *out = a.ints[0];
    else
        return false;
    return true;
}

static bool is_wrapper(const struct sst_onnx_node *onnx)
{
    return graph_is(onnx, "Unsqueeze") || graph_is(onnx, "Squeeze") || graph_is(onnx, "Cast") ||
           graph_is(onnx, "Identity");
}

/* The list in input `in` of a node: a constant, or the result of another node. */
static const struct raw_node *list_of(const struct graph_builder *b, const struct raw_node *node, int in,
                                      const struct sst_onnx_tensor **constant)
{
    *constant = integers(graph_constant(b, node, in));
    return *constant ? NULL : maker(b, node, in);
}

/* Number of elements of a list; 0: unknown. */
static int64_t list_length(struct search *s, const struct raw_node *node, int in)
{
    const struct sst_onnx_tensor *t;
    const struct raw_node *n = list_of(s->b, node, in, &t);
    int64_t from, to, sum = 0;

    if (t)
        return t->count;
    if (!n || s->steps_left-- <= 0)
        return 0;
    if (graph_is(n->onnx, "Shape"))
        return 4; /* of an image; graph_resize_target() checks that it is one */
    if (is_wrapper(n->onnx))
        return list_length(s, n, 0);
    if (graph_is(n->onnx, "Gather"))
        return integers(graph_constant(s->b, n, 1)) ? graph_constant(s->b, n, 1)->count : 0;
    if (graph_is(n->onnx, "Slice") && first_of(s->b, n, 1, "starts", &from) && first_of(s->b, n, 2, "ends", &to) &&
        from >= 0 && from <= 4)
        return (to < 0 ? to + 4 : to > 4 ? 4 : to) - from;
    for (int i = 0; graph_is(n->onnx, "Concat") && i < n->onnx->n_in; i++) {
        const int64_t part = list_length(s, n, i);

        if (part < 1 || part > 4)
            return 0;
        sum += part;
    }
    return sum;
}

static bool list_element(struct search *s, const struct raw_node *node, int in, int64_t i, struct element *out)
{
    const struct sst_onnx_tensor *t;
    const struct raw_node *n = list_of(s->b, node, in, &t);
    int64_t from;

    if (t) {
        *out = (struct element){ -1, i >= 0 && i < t->count ? t->i[i] : 0 };
        return i >= 0 && i < t->count;
    }
    if (!n || i < 0 || i > 3 || s->steps_left-- <= 0)
        return false;
    if (graph_is(n->onnx, "Shape")) {
        *out = (struct element){ n->in[0], i };
        return n->onnx->n_in == 1 && n->onnx->n_out == 1 && n->in[0] >= 0;
    }
    if (is_wrapper(n->onnx))
        return list_element(s, n, 0, i, out);
    if (graph_is(n->onnx, "Gather")) {
        t = integers(graph_constant(s->b, n, 1));
        return t && i < t->count && t->i[i] >= -4 && t->i[i] < 4 &&
               list_element(s, n, 0, t->i[i] < 0 ? t->i[i] + 4 : t->i[i], out);
    }
    if (graph_is(n->onnx, "Slice"))
        return first_of(s->b, n, 1, "starts", &from) && from >= -4 && from < 4 &&
               list_element(s, n, 0, (from < 0 ? from + 4 : from) + i, out);
    for (int k = 0; graph_is(n->onnx, "Concat") && k < n->onnx->n_in; k++) {
        const int64_t part = list_length(s, n, k);

        if (part < 1)
            return false;
        if (i < part)
            return list_element(s, n, k, i, out);
        i -= part;
    }
    return false;
}

bool graph_resize_target(const struct graph_builder *b, const struct raw_node *node, struct resize_target *out)
{
    struct search s = { b, 256 };
    struct element h, w;

    if (!list_element(&s, node, 3, 2, &h) || !list_element(&s, node, 3, 3, &w) || h.value != w.value)
        return false;
    if (h.value < 0)
        *out = (struct resize_target){ { h.n, w.n }, -1 };
    else
        *out = (struct resize_target){ { 0, 0 }, h.value };
    return h.value < 0 || (h.n == 2 && w.n == 3);
}
