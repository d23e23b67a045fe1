/* Each operation of a graph as a oneDNN primitive, or as one of ops.h. Convolutions choose the layouts; other layers
 * accept any, so that reorders are rare. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/network/plan_dnnl.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

int net_plan_desc(struct net_plan *p, const_dnnl_memory_desc_t *md, struct sst_shape shape, dnnl_data_type_t type,
                  dnnl_format_tag_t tag)
{
    const struct net_dnnl_shape s = { 4, { 1, shape.c, shape.h, shape.w }, type, tag };

    return net_dnnl_layout(&p->dnnl, md, &s);
}

void net_plan_add_arg(struct net_plan_step *s, int arg, int tensor, dnnl_memory_t memory)
{
    s->args[s->n_args] = (dnnl_exec_arg_t){ .arg = arg, .memory = memory };
    s->tensor[s->n_args++] = tensor;
}

int net_plan_primitive(struct net_plan *p, struct net_plan_step *s, dnnl_primitive_desc_t pd)
{
    const_dnnl_memory_desc_t scratch = dnnl_primitive_desc_query_md(pd, dnnl_query_scratchpad_md, 0);
    const size_t bytes = scratch ? dnnl_memory_desc_get_size(scratch) : 0;
    int err = net_dnnl_errno(dnnl_primitive_create(&s->primitive, pd));

    if (!err && bytes) {
        err = net_dnnl_errno(dnnl_memory_create(&s->scratch, scratch, p->dnnl.engine, DNNL_MEMORY_NONE));
        if (!err)
            net_plan_add_arg(s, DNNL_ARG_SCRATCHPAD, -1, s->scratch);
        if (bytes > p->scratch_bytes)
            p->scratch_bytes = bytes;
    }
    dnnl_primitive_desc_destroy(pd);
    return err;
}

int net_plan_attr(dnnl_primitive_attr_t *attr)
{
    int err = net_dnnl_errno(dnnl_primitive_attr_create(attr));

    if (err)
        return err;
    err = net_dnnl_errno(dnnl_primitive_attr_set_scratchpad_mode(*attr, dnnl_scratchpad_mode_user));
    if (err)
        dnnl_primitive_attr_destroy(*attr);
    return err;
}

int net_plan_scales(struct net_plan *p, struct net_plan_step *s, int arg, const float *factors, int n)
{
    const struct net_dnnl_shape shape = { 1, { n }, dnnl_f32, dnnl_x };
    const int number = net_dnnl_scales_arg(arg);
    const_dnnl_memory_desc_t md;
    int err;

    if (!number)
        return 0;
    s->scales_data = malloc((size_t)n * sizeof(*factors));
    if (!s->scales_data)
        return -ENOMEM;
    memcpy(s->scales_data, factors, (size_t)n * sizeof(*factors));
    err = net_dnnl_layout(&p->dnnl, &md, &shape);
    err = err ? err : net_dnnl_errno(dnnl_memory_create(&s->scales, md, p->dnnl.engine, s->scales_data));
    if (!err)
        net_plan_add_arg(s, number, -1, s->scales);
    return err;
}

int net_plan_result(struct net_plan *p, int value, const_dnnl_memory_desc_t md, float scale)
{
    const int t = net_plan_add_tensor(p, value, md, scale);

    if (t >= 0)
        p->current[value] = t;
    return t;
}

int net_plan_reorder(struct net_plan *p, int from, int to)
{
    const float scale = p->tensors[from].scale / p->tensors[to].scale;
    struct net_plan_step *s = net_plan_add_step(p, NULL);
    dnnl_primitive_desc_t pd;
    dnnl_primitive_attr_t attr;
    int err;

    if (!s)
        return -ENOMEM;
    err = net_plan_attr(&attr);
    if (err)
        return err;
    net_plan_add_arg(s, DNNL_ARG_FROM, from, NULL);
    net_plan_add_arg(s, DNNL_ARG_TO, to, NULL);
    if (scale != 1) {
        err = net_dnnl_scale_reorder(attr, scale);
        err = err ? err : net_plan_scales(p, s, DNNL_ARG_FROM, &scale, 1);
    }
    if (!err)
        err = net_dnnl_errno(dnnl_reorder_primitive_desc_create(&pd, p->tensors[from].md, p->dnnl.engine,
                                                                p->tensors[to].md, p->dnnl.engine, attr));
    dnnl_primitive_attr_destroy(attr);
    return err ? err : net_plan_primitive(p, s, pd);
}

int net_plan_in_layout(struct net_plan *p, int value, const_dnnl_memory_desc_t md, float scale)
{
    const int from = p->current[value];
    int to, err;

    for (int i = p->n_tensors - 1; i >= 0; i--) {
        const struct net_plan_tensor *t = &p->tensors[i];

        if (t->value == value && t->scale == scale && t->md == md)
            return i;
    }
    to = net_plan_add_tensor(p, value, md, scale);
    if (to < 0)
        return to;
    err = net_plan_reorder(p, from, to);
    if (err)
        return err;
    /* Later readers probably need the same layout; but values rounded to 8 bits do not suit all readers. */
    if (net_dnnl_type(md) == dnnl_f32 || net_dnnl_type(p->tensors[from].md) != dnnl_f32)
        p->current[value] = to;
    return to;
}

/* The same for channels last. */
static int in_nhwc(struct net_plan *p, int value, dnnl_data_type_t type, float scale)
{
    const_dnnl_memory_desc_t md;
    const int err = net_plan_desc(p, &md, p->shapes[value], type, dnnl_nhwc);

    return err ? err : net_plan_in_layout(p, value, md, scale);
}

int net_plan_in_8_bits(struct net_plan *p, int value)
{
    for (int i = 0; i < p->n_tensors; i++) {
        if (p->tensors[i].value == value && net_dnnl_type(p->tensors[i].md) != dnnl_f32)
            return i;
    }
    return in_nhwc(p, value, p->values[value].type, p->values[value].scale);
}

int net_plan_in_f32(struct net_plan *p, int value)
{
    const int t = p->current[value];

    return net_dnnl_type(p->tensors[t].md) == dnnl_f32 ? t : in_nhwc(p, value, dnnl_f32, 1);
}

/* --- the other primitives ------------------------------------------------------------------------- */

/* Add the step and result of a primitive whose inputs are set; consumes the description. */
static int finish(struct net_plan *p, const struct sst_op *op, dnnl_primitive_desc_t pd, const int *src, int first_arg)
{
    const_dnnl_memory_desc_t md;
    const int err = net_dnnl_chosen(&p->dnnl, &md, pd, dnnl_query_dst_md);
    const int dst = err ? err : net_plan_result(p, op->out, md, p->tensors[src[0]].scale);
    struct net_plan_step *s = dst < 0 ? NULL : net_plan_add_step(p, op);

    if (!s) {
        dnnl_primitive_desc_destroy(pd);
        return dst < 0 ? dst : -ENOMEM;
    }
    for (int i = 0; i < op->n_in; i++)
        net_plan_add_arg(s, first_arg + i, src[i], NULL);
    net_plan_add_arg(s, DNNL_ARG_DST, dst, NULL);
    return net_plan_primitive(p, s, pd);
}

static int add_relu(struct net_plan *p, const struct sst_op *op)
{
    const int src = net_plan_in_f32(p, op->in[0]);
    dnnl_primitive_attr_t attr;
    dnnl_primitive_desc_t pd;
    int err = src < 0 ? src : net_plan_attr(&attr);

    if (err)
        return err;
    err = net_dnnl_relu(&p->dnnl, &pd, p->tensors[src].md, attr);
    dnnl_primitive_attr_destroy(attr);
    return err ? err : finish(p, op, pd, &src, DNNL_ARG_SRC);
}

static int add_sum(struct net_plan *p, const struct sst_op *op)
{
    int src[2] = { net_plan_in_f32(p, op->in[0]), -1 };
    const_dnnl_memory_desc_t md;
    dnnl_primitive_attr_t attr;
    dnnl_primitive_desc_t pd;
    int err;

    if (src[0] < 0)
        return src[0];
    md = p->tensors[src[0]].md;
    src[1] = net_plan_in_layout(p, op->in[1], md, 1);
    err = src[1] < 0 ? src[1] : net_plan_attr(&attr);
    if (err)
        return err;
    err = net_dnnl_add(&p->dnnl, &pd, md, attr);
    dnnl_primitive_attr_destroy(attr);
    return err ? err : finish(p, op, pd, src, DNNL_ARG_SRC_0);
}

/* Input of a concatenation: on 8 bits all use the scale of the result. */
static int concat_input(struct net_plan *p, const struct sst_op *op, int value)
{
    const struct net_plan_value *out = &p->values[op->out];

    return out->bits8 ? in_nhwc(p, value, out->type, out->scale) : net_plan_in_f32(p, value);
}

static int add_concat(struct net_plan *p, const struct sst_op *op)
{
    const_dnnl_memory_desc_t mds[SST_ONNX_MAX_INS];
    int src[SST_ONNX_MAX_INS], err;
    dnnl_primitive_attr_t attr;
    dnnl_primitive_desc_t pd;

    for (int i = 0; i < op->n_in; i++) {
        src[i] = concat_input(p, op, op->in[i]);
        if (src[i] < 0)
            return src[i];
        mds[i] = p->tensors[src[i]].md;
    }
    err = net_plan_attr(&attr);
    if (err)
        return err;
    err = net_dnnl_concat(&p->dnnl, &pd, op->n_in, mds, attr);
    dnnl_primitive_attr_destroy(attr);
    return err ? err : finish(p, op, pd, src, DNNL_ARG_MULTIPLE_SRC);
}

static int add_pool(struct net_plan *p, const struct sst_op *op)
{
    const int src = p->values[op->out].bits8 ? net_plan_in_8_bits(p, op->in[0]) : net_plan_in_f32(p, op->in[0]);
    const struct sst_shape in = p->shapes[op->in[0]], out = p->shapes[op->out];
    const int sizes[2] = { in.h, in.w }, outs[2] = { out.h, out.w };
    struct net_dnnl_layer layer = {
        .algorithm = op->kind == SST_OP_MAX_POOL ? dnnl_pooling_max
                     : op->count_pad             ? dnnl_pooling_avg_include_padding
                                                 : dnnl_pooling_avg_exclude_padding,
        .stride = { op->stride[0], op->stride[1] },
        .kernel = { op->kernel[0], op->kernel[1] },
        .dilation = { op->dilation[0] - 1, op->dilation[1] - 1 },
        .before = { op->pad_before[0], op->pad_before[1] },
    };
    dnnl_primitive_attr_t attr;
    dnnl_primitive_desc_t pd;
    int err;

    if (src < 0)
        return src;
    /* Padding of the last window: ceil_mode extends beyond the specified padding. */
    for (int i = 0; i < 2; i++) {
        const int end = (outs[i] - 1) * op->stride[i] + op->dilation[i] * (op->kernel[i] - 1) + 1;

        layer.after[i] = sst_max_int(end - sizes[i] - op->pad_before[i], op->pad_after[i]);
    }
    layer.src = p->tensors[src].md;
    err = net_plan_desc(p, &layer.dst, out, net_dnnl_type(layer.src), dnnl_format_tag_any);
    err = err ? err : net_plan_attr(&attr);
    if (err)
        return err;
    err = net_dnnl_pool(&p->dnnl, &pd, &layer, attr);
    dnnl_primitive_attr_destroy(attr);
    return err ? err : finish(p, op, pd, &src, DNNL_ARG_SRC);
}

/* --- layers of ops.h ------------------------------------------------------------------------------ */

static int add_taps(struct net_plan *p, struct net_plan_step *s, const struct sst_op *op)
{
    const struct sst_shape out = p->shapes[op->out];

    s->taps = calloc((size_t)out.h + (size_t)out.w, sizeof(*s->taps));
    if (s->taps)
        resize_taps(s->taps, op, p->shapes[op->in[0]], out);
    return s->taps ? 0 : -ENOMEM;
}

/* The network's result is written in plain layout at once. */
static int add_own(struct net_plan *p, const struct sst_op *op)
{
    const struct sst_shape in = p->shapes[op->in[0]], out = p->shapes[op->out];
    const_dnnl_memory_desc_t md;
    struct net_plan_step *s;
    int src = net_plan_in_f32(p, op->in[0]), dst, err = 0;

    if (src >= 0 && !p->tensors[src].view.block) {
        err = net_plan_desc(p, &md, in, dnnl_f32, dnnl_nchw);
        src = err ? err : net_plan_in_layout(p, op->in[0], md, 1);
    }
    if (src < 0)
        return src;
    err = net_plan_desc(p, &md, out, dnnl_f32, op->out == p->graph->output ? dnnl_nchw : p->tensors[src].tag);
    if (err)
        return err;
    dst = net_plan_result(p, op->out, md, 1);
    s = dst < 0 ? NULL : net_plan_add_step(p, op);
    if (!s)
        return dst < 0 ? dst : -ENOMEM;
    s->n_args = 2;
    s->tensor[0] = src;
    s->tensor[1] = dst;
    return op->kind == SST_OP_RESIZE ? add_taps(p, s, op) : 0;
}

int net_plan_add_op(struct net_plan *p, int i)
{
    const struct sst_op *op = &p->graph->ops[i];

    switch (op->kind) {
    case SST_OP_CONV:
        return net_plan_add_conv(p, op);
    case SST_OP_RELU:
        return add_relu(p, op);
    case SST_OP_ADD:
        return add_sum(p, op);
    case SST_OP_CONCAT:
        return add_concat(p, op);
    case SST_OP_MAX_POOL:
    case SST_OP_AVG_POOL:
        return add_pool(p, op);
    case SST_OP_ADAPTIVE_POOL:
    case SST_OP_RESIZE:
    case SST_OP_SOFTMAX:
    case SST_OP_NORMALIZE:
        return add_own(p, op);
    }
    return -ENOTSUP;
}
