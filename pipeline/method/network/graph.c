/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/network/graph.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/method/network/network_internal.h"

int graph_unsupported(struct graph_builder *b, const struct sst_onnx_node *node, const char *what)
{
    snprintf(b->why, 256, "%.*s%s%.*s %.*s%s%s", SST_ONNX_STR(node->domain), node->domain.n ? "." : "",
             SST_ONNX_STR(node->op), SST_ONNX_STR(node->name), *what ? " " : "", what);
    return -ENOTSUP;
}

int graph_wrong(struct graph_builder *b, const struct sst_onnx_node *node, const char *what)
{
    sst_log_error("model %s: node %.*s (%.*s) %s; the file is damaged or wrongly exported", b->name,
                  SST_ONNX_STR(node->name), SST_ONNX_STR(node->op), what);
    return -EBADMSG;
}

bool graph_is(const struct sst_onnx_node *node, const char *op)
{
    return (!node->domain.n || sst_onnx_str_is(node->domain, "ai.onnx")) && sst_onnx_str_is(node->op, op);
}

int graph_original(const struct graph_builder *b, int v)
{
    while (b->values[v].alias >= 0)
        v = b->values[v].alias;
    return v;
}

const struct sst_onnx_tensor *graph_constant(const struct graph_builder *b, const struct raw_node *node, int in)
{
    const int v = in < node->onnx->n_in ? node->in[in] : -1;

    return v >= 0 ? b->values[graph_original(b, v)].constant : NULL;
}

/* --- names ---------------------------------------------------------------------------------------- */

static unsigned hash(struct sst_onnx_str s)
{
    uint32_t h = 2166136261u;

    for (size_t i = 0; i < s.n; i++)
        h = (h ^ (uint8_t)s.p[i]) * 16777619u;
    return (h ^ h >> 16) % SST_NAME_BUCKETS;
}

static int find_value(const struct graph_builder *b, struct sst_onnx_str name)
{
    int v = b->bucket[hash(name)];

    while (v >= 0 && !sst_onnx_str_same(b->values[v].name, name))
        v = b->values[v].next;
    return v;
}

/* Index of the new value, or -1 if the name exists. build() allocated enough. */
static int add_value(struct graph_builder *b, struct sst_onnx_str name)
{
    const unsigned h = hash(name);

    if (find_value(b, name) >= 0)
        return -1;
    b->values[b->n_values] = (struct raw_value){
        .name = name,
        .next = b->bucket[h],
        .node = -1,
        .alias = -1,
        .op = -1,
        .unpadded = -1,
    };
    b->bucket[h] = b->n_values;
    return b->n_values++;
}

/* Inputs of a node must precede it: ONNX files are sorted, so this also excludes cycles. */
static int resolve_node(struct graph_builder *b, int n)
{
    const struct sst_onnx_node *onnx = &b->model->nodes[n];
    struct raw_node *node = &b->nodes[n];

    node->onnx = onnx;
    for (int i = 0; i < SST_ONNX_MAX_INS; i++)
        node->in[i] = -1;
    for (int i = 0; i < onnx->n_in; i++) {
        node->in[i] = onnx->in[i].n ? find_value(b, onnx->in[i]) : -1;
        if (onnx->in[i].n && node->in[i] < 0)
            return graph_wrong(b, onnx, "reads a value that no earlier node produces (a cycle, or a missing constant)");
    }
    for (int i = 0; i < onnx->n_out; i++) {
        node->out[i] = -1;
        if (!onnx->out[i].n)
            continue;
        node->out[i] = add_value(b, onnx->out[i]);
        if (node->out[i] < 0)
            return graph_wrong(b, onnx, "produces a value that already exists");
        b->values[node->out[i]].node = n;
    }
    if (!onnx->n_out || node->out[0] < 0)
        return graph_wrong(b, onnx, "has no output");
    return 0;
}

/* A Constant node is equivalent to an initialiser. */
static int resolve_constant(struct graph_builder *b, int n)
{
    const struct sst_onnx_node *onnx = b->nodes[n].onnx;
    struct sst_onnx_attr a;
    int err;

    if (!graph_is(onnx, "Constant") || !sst_onnx_attr_find(onnx, "value", &a))
        return 0;
    err = sst_onnx_tensor_read(&b->constants[n], a.tensor, b->name);
    if (!err)
        b->values[b->nodes[n].out[0]].constant = &b->constants[n];
    return err;
}

static int resolve_input(struct graph_builder *b)
{
    const struct sst_onnx *m = b->model;
    const struct sst_onnx_value *in = NULL;
    int v;

    for (int i = 0; i < m->n_ins; i++) {
        if (find_value(b, m->ins[i].name) >= 0)
            continue; /* old files list the initialisers among the inputs */
        if (in) {
            snprintf(b->why, 256, "more than one input");
            return -ENOTSUP;
        }
        in = &m->ins[i];
    }
    if (!in || in->n_dims != 4 || in->dims[1] < 1 || in->dims[1] > 4096) {
        snprintf(b->why, 256, "an input that is not 1 x C x height x width");
        return -ENOTSUP; /* not reached from sst_network_open(), which checks the input first */
    }
    v = add_value(b, in->name);
    b->graph.input = v;
    b->graph.in_channels = b->values[v].channels = (int)in->dims[1];
    return 0;
}

static int resolve(struct graph_builder *b)
{
    const struct sst_onnx *m = b->model;
    int err;

    for (int i = 0; i < m->n_tensors; i++) {
        const int v = add_value(b, m->tensors[i].name);

        if (v < 0) {
            sst_log_error("model %s: two constants are named %.*s; the file is damaged", b->name,
                          SST_ONNX_STR(m->tensors[i].name));
            return -EBADMSG;
        }
        b->values[v].constant = &m->tensors[i];
    }
    err = resolve_input(b);
    for (int n = 0; !err && n < m->n_nodes; n++) {
        err = resolve_node(b, n);
        err = err ? err : resolve_constant(b, n);
    }
    if (err)
        return err;
    if (m->n_outs > 1)
        sst_log_info("model %s has %d outputs; only the first one, %.*s, is used", b->name, m->n_outs,
                     SST_ONNX_STR(m->outs[0].name));
    b->graph.output = m->n_outs ? find_value(b, m->outs[0].name) : -1;
    if (b->graph.output < 0 || b->values[b->graph.output].node < 0) {
        sst_log_error("model %s: no node produces its output; the file is damaged", b->name);
        return -EBADMSG;
    }
    return 0;
}

/* --- from nodes to operations --------------------------------------------------------------------- */

/* Walk back from the output: mark the needed nodes and count the readers of each value. */
static void find_needed(struct graph_builder *b)
{
    b->values[b->graph.output].users = 1;
    for (int n = b->model->n_nodes - 1; n >= 0; n--) {
        struct raw_node *node = &b->nodes[n];
        const bool resize = graph_is(node->onnx, "Resize");
        struct resize_target to;

        for (int i = 0; i < node->onnx->n_out; i++)
            node->needed |= node->out[i] >= 0 && b->values[node->out[i]].users > 0;
        if (!node->needed)
            continue;
        node->norm = graph_find_norm(b, node);
        if (node->norm.found) {
            b->values[node->norm.x].users++;
            continue;
        }
        /* Beyond its first input a resize reads constants, or the shape of an image. */
        if (resize && graph_resize_target(b, node, &to) && to.like >= 0)
            b->values[to.like].users++;
        for (int i = 0; i < (resize ? 1 : node->onnx->n_in); i++) {
            if (node->in[i] >= 0)
                b->values[node->in[i]].users++;
        }
    }
}

static int translate(struct graph_builder *b)
{
    struct sst_graph *g = &b->graph;
    struct raw_value *out;
    int err = 0;

    find_needed(b);
    for (int n = 0; !err && n < b->model->n_nodes; n++) {
        if (b->nodes[n].needed)
            err = graph_translate(b, &b->nodes[n]);
    }
    if (err)
        return err;
    g->output = graph_original(b, g->output);
    out = &b->values[g->output];
    if (out->op < 0) {
        snprintf(b->why, 256, "an output that is a constant, the input or only padded");
        return -ENOTSUP;
    }
    g->out_channels = out->channels;
    g->n_values = b->n_values;
    return 0;
}

/* --- ranges for 8 bits ---------------------------------------------------------------------------- */

static int bad_ranges(const struct graph_builder *b, const char *what)
{
    sst_log_error("model %s: its metadata " SST_RANGES_KEY " %s; write them again with models/quantise.py", b->name,
                  what);
    return -EBADMSG;
}

/* One line "number name". Its length with the line's end, or a negative errno. */
static int read_range(struct graph_builder *b, struct sst_onnx_str text)
{
    const char *end = memchr(text.p, '\n', text.n), *blank = memchr(text.p, ' ', text.n);
    const size_t n = end ? (size_t)(end - text.p) : text.n, digits = blank ? (size_t)(blank - text.p) : n;
    char number[32] = "", *rest;
    double range;
    int v;

    if (digits >= n || digits >= sizeof(number))
        return bad_ranges(b, "are not lines of a number and a name");
    memcpy(number, text.p, digits);
    range = strtod(number, &rest);
    if (rest != number + digits || !(range >= 1e-20 && range <= 1e20))
        return bad_ranges(b, "have a number outside 1e-20..1e20");
    v = find_value(b, (struct sst_onnx_str){ text.p + digits + 1, n - digits - 1 });
    if (v < 0)
        return bad_ranges(b, "name a value that the network lacks");
    b->graph.range[graph_original(b, v)] = (float)range;
    return (int)n + (end ? 1 : 0);
}

static int read_ranges(struct graph_builder *b)
{
    const struct sst_graph *g = &b->graph;
    struct sst_onnx_str text = { 0 };

    for (int i = 0; i < b->model->n_metadata; i++) {
        if (sst_onnx_str_is(b->model->metadata[i].key, SST_RANGES_KEY))
            text = b->model->metadata[i].value;
    }
    if (!text.n)
        return 0;
    b->graph.range = calloc((size_t)b->n_values, sizeof(*b->graph.range));
    if (!b->graph.range)
        return -ENOMEM;
    while (text.n) {
        const int n = read_range(b, text);

        if (n < 0)
            return n;
        text.p += n;
        text.n -= (size_t)n;
    }
    for (int i = 0; i < g->n_ops; i++) {
        if (!(g->range[g->ops[i].out] > 0) || !(g->range[g->ops[i].in[0]] > 0))
            return bad_ranges(b, "leave out a layer");
    }
    return 0;
}

static int allocate(struct graph_builder *b)
{
    const struct sst_onnx *m = b->model;
    size_t n_values = (size_t)m->n_tensors + 1;

    for (int i = 0; i < m->n_nodes; i++)
        n_values += (size_t)m->nodes[i].n_out;
    b->values = calloc(n_values, sizeof(*b->values));
    b->nodes = calloc((size_t)m->n_nodes, sizeof(*b->nodes));
    b->constants = calloc((size_t)m->n_nodes, sizeof(*b->constants));
    b->graph.ops = calloc((size_t)m->n_nodes, sizeof(*b->graph.ops));
    for (int i = 0; i < SST_NAME_BUCKETS; i++)
        b->bucket[i] = -1;
    return b->values && b->nodes && b->constants && b->graph.ops ? 0 : -ENOMEM;
}

int sst_graph_build(struct sst_graph *out, const struct sst_onnx *model, const char *name, char why[256])
{
    struct graph_builder *b = calloc(1, sizeof(*b));
    int err = -ENOMEM;

    if (!b)
        return err;
    b->model = model;
    b->name = name;
    b->why = why;
    err = allocate(b);
    err = err ? err : resolve(b);
    err = err ? err : translate(b);
    err = err ? err : read_ranges(b);
    if (err)
        sst_graph_fini(&b->graph);
    else
        *out = b->graph;
    for (int i = 0; b->constants && i < model->n_nodes; i++)
        sst_onnx_tensor_fini(&b->constants[i]);
    free(b->constants);
    free(b->nodes);
    free(b->values);
    free(b);
    return err;
}

void sst_graph_fini(struct sst_graph *graph)
{
    for (int i = 0; i < graph->n_ops; i++) {
        free(graph->ops[i].weights);
        free(graph->ops[i].bias);
    }
    free(graph->ops);
    free(graph->range);
    *graph = (struct sst_graph){ 0 };
}
