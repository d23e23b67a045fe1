/* Patterns of several nodes that stand for one layer.
 *
 * x / |x| over channels comes out of exporters in single steps:
 *   Div(x, D), D = [Expand] [Clip | Max | Add] N,  N = ReduceL2(x)  or  Sqrt([Clip | Max | Add] S),
 *   S = ReduceSum(x x) or ReduceSumSquare(x),  x x = Mul(x, x) or Pow(x, 2). */

#include "pipeline/network/graph_build.h"

/* The node that makes input `in` of a node, or NULL. */
static const struct sst_raw_node *maker(const struct sst_builder *b, const struct sst_raw_node *node, int in)
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

/* Step over one Clip, Max or Add of a constant, taking note of it. */
static const struct sst_raw_node *peel(const struct sst_builder *b, const struct sst_raw_node *node, double *add, double *min)
{
    struct sst_onnx_attr a;
    double v;

    if (!node)
        return NULL;
    if (sst_graph_is(node->onnx, "Clip")) {
        if (sst_onnx_attr_find(node->onnx, "min", &a))
            v = a.f;
        else if (!one_number(sst_graph_constant(b, node, 1), &v))
            return NULL;
        if ((node->onnx->n_in > 2 && node->in[2] >= 0) || sst_onnx_attr_find(node->onnx, "max", &a) || v < 0)
            return NULL;
        *min = v;
        return maker(b, node, 0);
    }
    if (sst_graph_is(node->onnx, "Max") || sst_graph_is(node->onnx, "Add")) {
        const int c = sst_graph_constant(b, node, 1) ? 1 : 0;

        if (node->onnx->n_in != 2 || !one_number(sst_graph_constant(b, node, c), &v) || v < 0)
            return NULL;
        *(sst_graph_is(node->onnx, "Max") ? min : add) = v;
        return maker(b, node, 1 - c);
    }
    return node;
}

/* A reduction over axis 1 that keeps it. */
static bool reduces_channels(const struct sst_builder *b, const struct sst_raw_node *node, const char *op)
{
    const struct sst_onnx_tensor *t = sst_graph_constant(b, node, 1);
    struct sst_onnx_attr a;

    if (!sst_graph_is(node->onnx, op) || sst_onnx_attr_int(node->onnx, "keepdims", 1) != 1)
        return false;
    if (sst_onnx_attr_find(node->onnx, "axes", &a))
        return a.n_ints == 1 && (a.ints[0] == 1 || a.ints[0] == -3);
    return t && t->count == 1 && t->i && (t->i[0] == 1 || t->i[0] == -3);
}

static bool is_square(const struct sst_builder *b, const struct sst_raw_node *node, int x)
{
    double power;

    if (!node || node->in[0] != x)
        return false;
    if (sst_graph_is(node->onnx, "Mul"))
        return node->onnx->n_in == 2 && node->in[1] == x;
    return sst_graph_is(node->onnx, "Pow") && one_number(sst_graph_constant(b, node, 1), &power) && power == 2;
}

struct sst_norm sst_graph_find_norm(const struct sst_builder *b, const struct sst_raw_node *node)
{
    struct sst_norm norm = { 0 };
    const struct sst_raw_node *d;

    if (!sst_graph_is(node->onnx, "Div") || node->onnx->n_in != 2 || node->in[0] < 0 || b->values[node->in[0]].constant)
        return norm;
    norm.x = node->in[0];
    d = maker(b, node, 1);
    if (d && sst_graph_is(d->onnx, "Expand"))
        d = maker(b, d, 0);
    d = peel(b, d, &norm.add, &norm.min);
    if (!d)
        return norm;
    if (reduces_channels(b, d, "ReduceL2")) {
        norm.found = d->in[0] == norm.x;
    } else if (sst_graph_is(d->onnx, "Sqrt")) {
        d = peel(b, maker(b, d, 0), &norm.in_add, &norm.in_min);
        if (d && reduces_channels(b, d, "ReduceSumSquare"))
            norm.found = d->in[0] == norm.x;
        else if (d && reduces_channels(b, d, "ReduceSum"))
            norm.found = is_square(b, maker(b, d, 0), norm.x);
    }
    return norm;
}

static bool one_integer(const struct sst_onnx_tensor *t, int64_t value)
{
    return t && t->count == 1 && t->i && t->i[0] == value;
}

/* A resize to a fixed size h x w comes with sizes = Concat(Slice(Shape(x), 0, 2), [h, w]). */
const int64_t *sst_graph_resize_sizes(const struct sst_builder *b, const struct sst_raw_node *node)
{
    const struct sst_onnx_tensor *sizes = sst_graph_constant(b, node, 3);
    const struct sst_raw_node *concat = maker(b, node, 3), *slice, *shape;

    if (sizes)
        return sizes->i && sizes->count == 4 ? sizes->i + 2 : NULL;
    if (!concat || !sst_graph_is(concat->onnx, "Concat") || concat->onnx->n_in != 2)
        return NULL;
    sizes = sst_graph_constant(b, concat, 1);
    slice = maker(b, concat, 0);
    shape = slice && sst_graph_is(slice->onnx, "Slice") ? maker(b, slice, 0) : NULL;
    if (!shape || !sst_graph_is(shape->onnx, "Shape") || shape->in[0] != node->in[0] || !sizes || !sizes->i ||
        sizes->count != 2 || !one_integer(sst_graph_constant(b, slice, 1), 0) ||
        !one_integer(sst_graph_constant(b, slice, 2), 2))
        return NULL;
    return sizes->i;
}
