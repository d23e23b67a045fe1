/* Each operation of a graph as a oneDNN primitive, or as one of ops.h. Convolutions choose the layouts; what follows
 * takes what it gets, so that reorders are rare. */
#if WITH_DNNL
#include "pipeline/network/plan_dnnl.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"

int plan_errno(dnnl_status_t status)
{
    switch (status) {
    case dnnl_success:
        return 0;
    case dnnl_out_of_memory:
        return -ENOMEM;
    default:
        return -ENOTSUP;
    }
}

int plan_plain(dnnl_memory_desc_t *md, struct sst_shape shape)
{
    const dnnl_dims_t dims = { 1, shape.c, shape.h, shape.w };

    return plan_errno(dnnl_memory_desc_init_by_tag(md, 4, dims, dnnl_f32, dnnl_nchw));
}

static int any_layout(dnnl_memory_desc_t *md, struct sst_shape shape)
{
    const dnnl_dims_t dims = { 1, shape.c, shape.h, shape.w };

    return plan_errno(dnnl_memory_desc_init_by_tag(md, 4, dims, dnnl_f32, dnnl_format_tag_any));
}

static void add_arg(struct plan_step *s, int arg, int tensor, dnnl_memory_t memory)
{
    s->args[s->n_args] = (dnnl_exec_arg_t){ .arg = arg, .memory = memory };
    s->tensor[s->n_args++] = tensor;
}

/* Make the primitive of a step and the place of its scratch memory; takes the description. */
static int make_primitive(struct sst_plan *p, struct plan_step *s, dnnl_primitive_desc_t pd)
{
    const dnnl_memory_desc_t *scratch = dnnl_primitive_desc_query_md(pd, dnnl_query_scratchpad_md, 0);
    const size_t bytes = scratch ? dnnl_memory_desc_get_size(scratch) : 0;
    int err = plan_errno(dnnl_primitive_create(&s->primitive, pd));

    if (!err && bytes) {
        err = plan_errno(dnnl_memory_create(&s->scratch, scratch, p->engine, DNNL_MEMORY_NONE));
        if (!err)
            add_arg(s, DNNL_ARG_SCRATCHPAD, -1, s->scratch);
        if (bytes > p->scratch_bytes)
            p->scratch_bytes = bytes;
    }
    dnnl_primitive_desc_destroy(pd);
    return err;
}

/* Attributes that all primitives share: scratch memory is ours. */
static int make_attr(dnnl_primitive_attr_t *attr)
{
    int err = plan_errno(dnnl_primitive_attr_create(attr));

    if (err)
        return err;
    err = plan_errno(dnnl_primitive_attr_set_scratchpad_mode(*attr, dnnl_scratchpad_mode_user));
    if (err)
        dnnl_primitive_attr_destroy(*attr);
    return err;
}

static int make_desc(struct sst_plan *p, dnnl_primitive_desc_t *pd, const_dnnl_op_desc_t desc)
{
    dnnl_primitive_attr_t attr;
    int err = make_attr(&attr);

    if (err)
        return err;
    err = plan_errno(dnnl_primitive_desc_create(pd, desc, attr, p->engine, NULL));
    dnnl_primitive_attr_destroy(attr);
    return err;
}

/* New tensor for an operation's result. */
static int result_tensor(struct sst_plan *p, const struct sst_op *op, const dnnl_memory_desc_t *md)
{
    const int t = plan_add_tensor(p, md, p->shapes[op->out]);

    if (t >= 0)
        p->current[op->out] = t;
    return t;
}

static int add_reorder(struct sst_plan *p, int from, int to)
{
    struct plan_step *s = plan_add_step(p, NULL);
    dnnl_primitive_desc_t pd;
    dnnl_primitive_attr_t attr;
    int err;

    if (!s)
        return -ENOMEM;
    err = make_attr(&attr);
    if (err)
        return err;
    add_arg(s, DNNL_ARG_FROM, from, NULL);
    add_arg(s, DNNL_ARG_TO, to, NULL);
    err = plan_errno(
        dnnl_reorder_primitive_desc_create(&pd, &p->tensors[from].md, p->engine, &p->tensors[to].md, p->engine, attr));
    dnnl_primitive_attr_destroy(attr);
    return err ? err : make_primitive(p, s, pd);
}

int plan_in_layout(struct sst_plan *p, int value, const dnnl_memory_desc_t *md)
{
    const int from = p->current[value];
    int to, err;

    if (dnnl_memory_desc_equal(&p->tensors[from].md, md))
        return from;
    to = plan_add_tensor(p, md, p->shapes[value]);
    if (to < 0)
        return to;
    err = add_reorder(p, from, to);
    if (err)
        return err;
    /* Later readers are likely to want the same. */
    p->current[value] = to;
    return to;
}

/* --- convolution ---------------------------------------------------------------------------------- */

static int conv_attr(dnnl_primitive_attr_t *attr, const struct sst_op *op)
{
    dnnl_post_ops_t post;
    int err = make_attr(attr);

    if (err)
        return err;
    err = plan_errno(dnnl_post_ops_create(&post));
    if (err)
        goto fail_attr;
    if (op->residual)
        err = plan_errno(dnnl_post_ops_append_sum(post, 1.0f));
    if (!err && op->relu)
        err = plan_errno(dnnl_post_ops_append_eltwise(post, 1.0f, dnnl_eltwise_relu, 0.0f, 0.0f));
    if (!err)
        err = plan_errno(dnnl_primitive_attr_set_post_ops(*attr, post));
    dnnl_post_ops_destroy(post);
    if (!err)
        return 0;

fail_attr:
    dnnl_primitive_attr_destroy(*attr);
    return err;
}

static int weights_desc(dnnl_memory_desc_t *md, const struct sst_op *op, bool plain)
{
    const int g = op->group;
    const dnnl_dims_t grouped = { g, op->channels / g, op->group_in, op->kernel[0], op->kernel[1] };
    const dnnl_dims_t dims = { op->channels, op->group_in, op->kernel[0], op->kernel[1] };

    if (g > 1)
        return plan_errno(
            dnnl_memory_desc_init_by_tag(md, 5, grouped, dnnl_f32, plain ? dnnl_goihw : dnnl_format_tag_any));
    return plan_errno(dnnl_memory_desc_init_by_tag(md, 4, dims, dnnl_f32, plain ? dnnl_oihw : dnnl_format_tag_any));
}

static int conv_desc(struct sst_plan *p, const struct sst_op *op, dnnl_alg_kind_t algorithm, dnnl_format_tag_t dst_tag,
                     dnnl_primitive_desc_t *pd)
{
    const struct sst_shape out = p->shapes[op->out];
    const dnnl_dims_t strides = { op->stride[0], op->stride[1] }, bias_dims = { op->channels };
    const dnnl_dims_t dilation = { op->dilation[0] - 1, op->dilation[1] - 1 }, dst_dims = { 1, out.c, out.h, out.w };
    const dnnl_dims_t before = { op->pad_before[0], op->pad_before[1] }, after = { op->pad_after[0], op->pad_after[1] };
    dnnl_memory_desc_t src, weights, bias, dst;
    dnnl_convolution_desc_t desc;
    dnnl_primitive_attr_t attr;
    int err = any_layout(&src, p->shapes[op->in[0]]);

    if (!err)
        err = plan_errno(dnnl_memory_desc_init_by_tag(&dst, 4, dst_dims, dnnl_f32, dst_tag));
    if (!err)
        err = weights_desc(&weights, op, false);
    if (!err)
        err = plan_errno(dnnl_memory_desc_init_by_tag(&bias, 1, bias_dims, dnnl_f32, dnnl_x));
    if (!err)
        err = plan_errno(dnnl_dilated_convolution_forward_desc_init(
            &desc, dnnl_forward_inference, algorithm, &src, &weights, &bias, &dst, strides, dilation, before, after));
    if (!err)
        err = conv_attr(&attr, op);
    if (err)
        return err;
    err = plan_errno(dnnl_primitive_desc_create(pd, &desc, attr, p->engine, NULL));
    dnnl_primitive_attr_destroy(attr);
    return err;
}

/* Winograd halves the time of 3x3 layers with many channels (measured: 64 to 64 channels, 2.0x); oneDNN has it for some
 * machines only, and its "auto" passes it over in favour of slower code. */
uint8_t plan_winograd_tile(struct sst_plan *p, const struct sst_op *op)
{
    dnnl_primitive_desc_t pd;
    const char *name = NULL;
    uint8_t tile;

    if (op->kind != SST_OP_CONV || op->group != 1 || op->group_in < 16 || op->channels < 16 || op->kernel[0] != 3 ||
        op->kernel[1] != 3 || conv_desc(p, op, dnnl_convolution_winograd, dnnl_format_tag_any, &pd))
        return 0;
    tile = !dnnl_primitive_desc_query(pd, dnnl_query_impl_info_str, 0, (void *)&name) && strstr(name, "4x3") ? 4 : 2;
    dnnl_primitive_desc_destroy(pd);
    return tile;
}

static bool feeds_winograd(const struct sst_plan *p, int value)
{
    for (int i = 0; i < p->graph->n_ops; i++) {
        if (p->winograd[i] && p->graph->ops[i].in[0] == value)
            return true;
    }
    return false;
}

/* Winograd reads channels in blocks of 16; a layer before it that writes them so saves a reorder. */
static int best_conv_desc(struct sst_plan *p, const struct sst_op *op, dnnl_primitive_desc_t *pd)
{
    if (p->winograd[op - p->graph->ops])
        return conv_desc(p, op, dnnl_convolution_winograd, dnnl_format_tag_any, pd);
    if (feeds_winograd(p, op->out) && !conv_desc(p, op, dnnl_convolution_auto, dnnl_nChw16c, pd))
        return 0;
    return conv_desc(p, op, dnnl_convolution_auto, dnnl_format_tag_any, pd);
}

/* Weights in the layout of the primitive, once and for all runs. */
static int load_weights(struct sst_plan *p, struct plan_step *s, const struct sst_op *op, const dnnl_memory_desc_t *md)
{
    dnnl_memory_desc_t plain;
    dnnl_memory_t from = NULL;
    dnnl_primitive_desc_t pd;
    dnnl_primitive_t reorder = NULL;
    int err = weights_desc(&plain, op, true);

    s->weights_data = sst_mem_alloc(1, dnnl_memory_desc_get_size(md));
    if (!s->weights_data)
        return -ENOMEM;
    if (!err)
        err = plan_errno(dnnl_memory_create(&s->weights, md, p->engine, s->weights_data));
    if (!err)
        err = plan_errno(dnnl_memory_create(&from, &plain, p->engine, op->weights));
    if (!err)
        err = plan_errno(dnnl_reorder_primitive_desc_create(&pd, &plain, p->engine, md, p->engine, NULL));
    if (!err) {
        err = plan_errno(dnnl_primitive_create(&reorder, pd));
        dnnl_primitive_desc_destroy(pd);
    }
    if (!err) {
        const dnnl_exec_arg_t args[] = { { DNNL_ARG_FROM, from }, { DNNL_ARG_TO, s->weights } };

        err = plan_errno(dnnl_primitive_execute(reorder, p->stream, 2, args));
    }
    if (!err)
        err = plan_errno(dnnl_stream_wait(p->stream));
    dnnl_primitive_destroy(reorder);
    dnnl_memory_destroy(from);
    return err;
}

/* The tensor that a convolution writes: a new one, or that of the residual, which it adds to. */
static int conv_result(struct sst_plan *p, const struct sst_op *op, const dnnl_memory_desc_t *md)
{
    const int i = (int)(op - p->graph->ops);
    int from, to, err;

    if (!op->residual)
        return result_tensor(p, op, md);
    from = p->current[op->in[1]];
    if (p->last_use[op->in[1]] == i && !p->tensors[from].external && op->in[1] != op->in[0] &&
        dnnl_memory_desc_equal(&p->tensors[from].md, md)) {
        p->current[op->out] = from;
        return from;
    }
    to = result_tensor(p, op, md);
    if (to < 0)
        return to;
    err = add_reorder(p, from, to);
    return err ? err : to;
}

static int add_conv(struct sst_plan *p, const struct sst_op *op)
{
    const dnnl_dims_t bias_dims = { op->channels };
    dnnl_memory_desc_t bias;
    dnnl_primitive_desc_t pd;
    struct plan_step *s;
    int src, dst, err = best_conv_desc(p, op, &pd);

    if (err)
        return err;
    src = plan_in_layout(p, op->in[0], dnnl_primitive_desc_query_md(pd, dnnl_query_src_md, 0));
    dst = src < 0 ? src : conv_result(p, op, dnnl_primitive_desc_query_md(pd, dnnl_query_dst_md, 0));
    s = dst < 0 ? NULL : plan_add_step(p, op);
    if (!s) {
        dnnl_primitive_desc_destroy(pd);
        return dst < 0 ? dst : -ENOMEM;
    }
    err = load_weights(p, s, op, dnnl_primitive_desc_query_md(pd, dnnl_query_weights_md, 0));
    if (!err)
        err = plan_errno(dnnl_memory_desc_init_by_tag(&bias, 1, bias_dims, dnnl_f32, dnnl_x));
    if (!err)
        err = plan_errno(dnnl_memory_create(&s->bias, &bias, p->engine, op->bias));
    if (err) {
        dnnl_primitive_desc_destroy(pd);
        return err;
    }
    add_arg(s, DNNL_ARG_SRC, src, NULL);
    add_arg(s, DNNL_ARG_DST, dst, NULL);
    add_arg(s, DNNL_ARG_WEIGHTS, -1, s->weights);
    add_arg(s, DNNL_ARG_BIAS, -1, s->bias);
    return make_primitive(p, s, pd);
}

/* --- the other primitives ------------------------------------------------------------------------- */

/* Step and result of a primitive whose inputs are set; takes the description. */
static int finish(struct sst_plan *p, const struct sst_op *op, dnnl_primitive_desc_t pd, const int *src, int n_src,
                  int first_arg)
{
    const int dst = result_tensor(p, op, dnnl_primitive_desc_query_md(pd, dnnl_query_dst_md, 0));
    struct plan_step *s = dst < 0 ? NULL : plan_add_step(p, op);

    if (!s) {
        dnnl_primitive_desc_destroy(pd);
        return dst < 0 ? dst : -ENOMEM;
    }
    for (int i = 0; i < n_src; i++)
        add_arg(s, first_arg + i, src[i], NULL);
    add_arg(s, DNNL_ARG_DST, dst, NULL);
    return make_primitive(p, s, pd);
}

static int add_relu(struct sst_plan *p, const struct sst_op *op)
{
    const int src = p->current[op->in[0]];
    dnnl_eltwise_desc_t desc;
    dnnl_primitive_desc_t pd;
    int err = plan_errno(
        dnnl_eltwise_forward_desc_init(&desc, dnnl_forward_inference, dnnl_eltwise_relu, &p->tensors[src].md, 0, 0));

    if (!err)
        err = make_desc(p, &pd, &desc);
    return err ? err : finish(p, op, pd, &src, 1, DNNL_ARG_SRC);
}

static int add_sum(struct sst_plan *p, const struct sst_op *op)
{
    const dnnl_memory_desc_t md = p->tensors[p->current[op->in[0]]].md;
    const int src[2] = { p->current[op->in[0]], plan_in_layout(p, op->in[1], &md) };
    dnnl_binary_desc_t desc;
    dnnl_primitive_desc_t pd;
    int err = src[1] < 0 ? src[1] : plan_errno(dnnl_binary_desc_init(&desc, dnnl_binary_add, &md, &md, &md));

    if (!err)
        err = make_desc(p, &pd, &desc);
    return err ? err : finish(p, op, pd, src, 2, DNNL_ARG_SRC_0);
}

static int add_concat(struct sst_plan *p, const struct sst_op *op)
{
    dnnl_memory_desc_t mds[SST_ONNX_MAX_INS];
    int src[SST_ONNX_MAX_INS];
    dnnl_primitive_attr_t attr;
    dnnl_primitive_desc_t pd;
    int err = make_attr(&attr);

    if (err)
        return err;
    for (int i = 0; i < op->n_in; i++) {
        src[i] = p->current[op->in[i]];
        mds[i] = p->tensors[src[i]].md;
    }
    err = plan_errno(dnnl_concat_primitive_desc_create(&pd, NULL, op->n_in, 1, mds, attr, p->engine));
    dnnl_primitive_attr_destroy(attr);
    return err ? err : finish(p, op, pd, src, op->n_in, DNNL_ARG_MULTIPLE_SRC);
}

static int add_pool(struct sst_plan *p, const struct sst_op *op)
{
    const int src = p->current[op->in[0]];
    const struct sst_shape in = p->shapes[op->in[0]], out = p->shapes[op->out];
    const int sizes[2] = { in.h, in.w }, outs[2] = { out.h, out.w };
    const dnnl_dims_t strides = { op->stride[0], op->stride[1] }, kernel = { op->kernel[0], op->kernel[1] };
    const dnnl_dims_t dilation = { op->dilation[0] - 1, op->dilation[1] - 1 };
    const dnnl_dims_t before = { op->pad_before[0], op->pad_before[1] };
    dnnl_dims_t after;
    const dnnl_alg_kind_t algorithm = op->kind == SST_OP_MAX_POOL ? dnnl_pooling_max
                                      : op->count_pad             ? dnnl_pooling_avg_include_padding
                                                                  : dnnl_pooling_avg_exclude_padding;
    dnnl_pooling_v2_desc_t desc;
    dnnl_memory_desc_t dst;
    dnnl_primitive_desc_t pd;
    int err = any_layout(&dst, out);

    /* What the last window needs: ceil_mode reaches beyond the given padding. */
    for (int i = 0; i < 2; i++) {
        const int end = (outs[i] - 1) * op->stride[i] + op->dilation[i] * (op->kernel[i] - 1) + 1;

        after[i] = sst_max_int(end - sizes[i] - op->pad_before[i], op->pad_after[i]);
    }
    if (!err)
        err =
            plan_errno(dnnl_pooling_v2_forward_desc_init(&desc, dnnl_forward_inference, algorithm, &p->tensors[src].md,
                                                         &dst, strides, kernel, dilation, before, after));
    if (!err)
        err = make_desc(p, &pd, &desc);
    return err ? err : finish(p, op, pd, &src, 1, DNNL_ARG_SRC);
}

/* --- layers of ops.h ------------------------------------------------------------------------------ */

static int add_taps(struct sst_plan *p, struct plan_step *s, const struct sst_op *op)
{
    const struct sst_shape in = p->shapes[op->in[0]], out = p->shapes[op->out];
    const double scale_y = op->scale[0] > 0 ? op->scale[0] : (double)out.h / in.h;
    const double scale_x = op->scale[1] > 0 ? op->scale[1] : (double)out.w / in.w;

    s->taps_y = calloc((size_t)out.h, sizeof(*s->taps_y));
    s->taps_x = calloc((size_t)out.w, sizeof(*s->taps_x));
    if (!s->taps_y || !s->taps_x)
        return -ENOMEM;
    sst_resize_taps(s->taps_y, op->mode, scale_y, in.h, out.h);
    sst_resize_taps(s->taps_x, op->mode, scale_x, in.w, out.w);
    return 0;
}

/* The network's result is written in plain layout at once. */
static int add_own(struct sst_plan *p, const struct sst_op *op)
{
    const struct sst_shape in = p->shapes[op->in[0]], out = p->shapes[op->out];
    dnnl_memory_desc_t md;
    struct plan_step *s;
    const dnnl_dims_t dims = { 1, out.c, out.h, out.w };
    int src = p->current[op->in[0]], dst, err = 0;

    if (!p->tensors[src].view.block) {
        err = plan_plain(&md, in);
        src = err ? err : plan_in_layout(p, op->in[0], &md);
        if (src < 0)
            return src;
    }
    err = plan_errno(dnnl_memory_desc_init_by_tag(&md, 4, dims, dnnl_f32,
                                                  op->out == p->graph->output ? dnnl_nchw : p->tensors[src].tag));
    if (err)
        return err;
    dst = result_tensor(p, op, &md);
    s = dst < 0 ? NULL : plan_add_step(p, op);
    if (!s)
        return dst < 0 ? dst : -ENOMEM;
    s->n_args = 2;
    s->tensor[0] = src;
    s->tensor[1] = dst;
    return op->kind == SST_OP_RESIZE ? add_taps(p, s, op) : 0;
}

int plan_add_op(struct sst_plan *p, int i)
{
    const struct sst_op *op = &p->graph->ops[i];

    switch (op->kind) {
    case SST_OP_CONV:
        return add_conv(p, op);
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
#endif
