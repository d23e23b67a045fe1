/* Convolutions: in f32, Winograd's where that is faster; or on 8 bits.
 *
 * On 8 bits a tensor holds round(x / scale): u8 where no value is negative, s8 else; weights are s8 with a scale for
 * each output channel o, so that
 *   y / s_y = (sum q_x q_w + b / (s_x s_w[o])) * (s_x s_w[o] / s_y)  [+ (s_r / s_y) q_r, the residual]  [relu]
 * with the sum in exact 32-bit integers: the same for any number of threads and any order. Version 3 of oneDNN adds
 * b / s_y after the factor instead. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/method/network/plan_dnnl.h"

static dnnl_data_type_t or_f32(dnnl_data_type_t type)
{
    return type == dnnl_data_type_undef ? dnnl_f32 : type;
}

static int conv_attr(dnnl_primitive_attr_t *attr, const struct sst_op *op, const struct net_plan_bytes *q)
{
    dnnl_post_ops_t post;
    int err = net_plan_attr(attr);

    if (err)
        return err;
    err = net_dnnl_errno(dnnl_post_ops_create(&post));
    if (err)
        goto fail_attr;
    if (q->scales)
        err = net_dnnl_scale_conv(*attr, q->scales, op->channels, op->group > 1);
    if (!err && op->residual)
        err = net_dnnl_append_sum(post, q->scales ? q->sum_scale : 1.0f, q->scales ? q->sum : dnnl_data_type_undef);
    if (!err && op->relu)
        err = net_dnnl_append_relu(post);
    err = err ? err : net_dnnl_errno(dnnl_primitive_attr_set_post_ops(*attr, post));
    dnnl_post_ops_destroy(post);
    if (!err)
        return 0;

fail_attr:
    dnnl_primitive_attr_destroy(*attr);
    return err;
}

static int weights_desc(struct net_plan *p, const_dnnl_memory_desc_t *md, const struct sst_op *op,
                        dnnl_data_type_t type, bool plain)
{
    const int g = op->group;
    const struct net_dnnl_shape grouped = { 5,
                                            { g, op->channels / g, op->group_in, op->kernel[0], op->kernel[1] },
                                            type,
                                            plain ? dnnl_goihw : dnnl_format_tag_any };
    const struct net_dnnl_shape single = {
        4, { op->channels, op->group_in, op->kernel[0], op->kernel[1] }, type, plain ? dnnl_oihw : dnnl_format_tag_any
    };

    return net_dnnl_layout(&p->dnnl, md, g > 1 ? &grouped : &single);
}

static int bias_desc(struct net_plan *p, const_dnnl_memory_desc_t *md, const struct sst_op *op)
{
    const struct net_dnnl_shape shape = { 1, { op->channels }, dnnl_f32, dnnl_x };

    return net_dnnl_layout(&p->dnnl, md, &shape);
}

/* A convolution's algorithm, and the layout of its result. */
struct form {
    dnnl_alg_kind_t algorithm;
    dnnl_format_tag_t dst;
};

static const struct form automatic = { dnnl_convolution_auto, dnnl_format_tag_any },
                         winograd = { dnnl_convolution_winograd, dnnl_format_tag_any };

static int conv_desc(struct net_plan *p, const struct sst_op *op, struct form form, const struct net_plan_bytes *q,
                     dnnl_primitive_desc_t *pd)
{
    struct net_dnnl_layer layer = {
        .algorithm = form.algorithm,
        .stride = { op->stride[0], op->stride[1] },
        .dilation = { op->dilation[0] - 1, op->dilation[1] - 1 },
        .before = { op->pad_before[0], op->pad_before[1] },
        .after = { op->pad_after[0], op->pad_after[1] },
    };
    dnnl_primitive_attr_t attr;
    int err = net_plan_desc(p, &layer.src, p->shapes[op->in[0]], or_f32(q->src), dnnl_format_tag_any);

    err = err ? err : net_plan_desc(p, &layer.dst, p->shapes[op->out], or_f32(q->dst), form.dst);
    err = err ? err : weights_desc(p, &layer.weights, op, q->scales ? dnnl_s8 : dnnl_f32, false);
    err = err ? err : bias_desc(p, &layer.bias, op);
    err = err ? err : conv_attr(&attr, op, q);
    if (err)
        return err;
    err = net_dnnl_conv(&p->dnnl, pd, &layer, attr);
    dnnl_primitive_attr_destroy(attr);
    return err;
}

/* --- f32 ------------------------------------------------------------------------------------------ */

static const struct net_plan_bytes not_quantised = { .src = dnnl_data_type_undef };

/* Winograd halves the time of 3x3 layers with many channels (measured: 64 to 64 channels, 2.0x); oneDNN has it for some
 * machines only, and its "auto" passes it over in favour of slower code. */
uint8_t net_plan_winograd_tile(struct net_plan *p, const struct sst_op *op)
{
    dnnl_primitive_desc_t pd;
    const char *name = NULL;
    uint8_t tile;

    if (op->kind != SST_OP_CONV || net_plan_conv_on_8_bits(p, op) || op->group != 1 || op->group_in < 16 ||
        op->channels < 16 || op->kernel[0] != 3 || op->kernel[1] != 3 ||
        conv_desc(p, op, winograd, &not_quantised, &pd))
        return 0;
    tile = !dnnl_primitive_desc_query(pd, dnnl_query_impl_info_str, 0, (void *)&name) && strstr(name, "4x3") ? 4 : 2;
    dnnl_primitive_desc_destroy(pd);
    return tile;
}

static bool feeds_winograd(const struct net_plan *p, int value)
{
    for (int i = 0; i < p->graph->n_ops; i++) {
        if (p->winograd[i] && p->graph->ops[i].in[0] == value)
            return true;
    }
    return false;
}

/* Winograd reads channels in blocks of 16; a preceding layer that writes this layout saves a reorder. */
static int best_conv_desc(struct net_plan *p, const struct sst_op *op, const struct net_plan_bytes *q,
                          dnnl_primitive_desc_t *pd)
{
    /* Not "auto", which selects Winograd on 8 bits without VNNI: its sums are not exact. */
    if (q->scales)
        return conv_desc(p, op, (struct form){ dnnl_convolution_direct, dnnl_format_tag_any }, q, pd);
    if (p->winograd[op - p->graph->ops]) {
        int err;

        omp_set_num_threads(p->winograd_threads);
        err = conv_desc(p, op, winograd, q, pd);
        omp_set_num_threads(p->threads);
        return err;
    }
    if (feeds_winograd(p, op->out) && !conv_desc(p, op, (struct form){ dnnl_convolution_auto, dnnl_nChw16c }, q, pd)) {
        const char *name = NULL;

        if (!dnnl_primitive_desc_query(*pd, dnnl_query_impl_info_str, 0, (void *)&name) && strncmp(name, "ref", 3) != 0)
            return 0;
        /* Reference loops, 100 times slower (for example with dilation 8): a reorder is far cheaper. */
        dnnl_primitive_desc_destroy(*pd);
    }
    return conv_desc(p, op, automatic, q, pd);
}

/* best_conv_desc() for one thread if the result depends on their number. @param serial  out: it runs on one thread */
static int same_conv_desc(struct net_plan *p, const struct sst_op *op, const struct net_plan_bytes *q,
                          dnnl_primitive_desc_t *pd, bool *serial)
{
    int err = best_conv_desc(p, op, q, pd);

    *serial = !err && !q->scales && net_dnnl_splits_sums(*pd);
    if (!*serial || p->threads == 1)
        return err;
    dnnl_primitive_desc_destroy(*pd);
    omp_set_num_threads(1);
    err = best_conv_desc(p, op, q, pd);
    omp_set_num_threads(p->threads);
    return err;
}

/* --- 8 bits --------------------------------------------------------------------------------------- */

void net_plan_quantise(const struct sst_op *op, bool s8, float factor, int8_t *weights, float *scales)
{
    const int step = s8 && !net_plan_fast_int8() ? 2 : 1; /* between two weights: plan_bits.c */
    const float most = (float)(127 / step);
    const size_t per = (size_t)op->group_in * (size_t)op->kernel[0] * (size_t)op->kernel[1];

    for (size_t c = 0; c < (size_t)op->channels; c++) {
        const float *w = op->weights + c * per;
        float max = 0;

        for (size_t i = 0; i < per; i++)
            max = fmaxf(max, fabsf(w[i]));
        /* Channels of zeros, or of numbers too small to divide by, become zero. */
        scales[c] = max > 1e-30f ? max / most : 1.0f;
        for (size_t i = 0; i < per; i++)
            weights[c * per + i] = (int8_t)(step * lrintf(w[i] / scales[c]));
        scales[c] *= factor / (float)step;
    }
}

void net_plan_scale_bias(const struct sst_op *op, const float *scales, float dst_scale, float *bias)
{
    const bool scaled = net_dnnl_scales_bias();

    for (int c = 0; c < op->channels; c++)
        bias[c] = op->bias[c] / (scaled ? scales[c] * dst_scale : dst_scale);
}

/* Weights in bytes, and the scale of the products. */
static int quantise_weights(struct net_plan_bytes *q, const struct sst_op *op)
{
    const size_t per = (size_t)op->group_in * (size_t)op->kernel[0] * (size_t)op->kernel[1];

    q->scales = malloc((size_t)op->channels * sizeof(*q->scales));
    q->weights = malloc((size_t)op->channels * per);
    if (!q->scales || !q->weights)
        return -ENOMEM;
    net_plan_quantise(op, q->src == dnnl_s8, q->src_scale / q->dst_scale, q->weights, q->scales);
    return 0;
}

static int quantise(struct net_plan *p, const struct sst_op *op, struct net_plan_bytes *q, int *residual)
{
    const struct net_plan_value *out = &p->values[op->out];
    const int src = net_plan_in_8_bits(p, op->in[0]);
    int err;

    if (src < 0)
        return src;
    q->src = net_dnnl_type(p->tensors[src].md);
    q->src_scale = p->tensors[src].scale;
    q->dst = out->bits8 ? out->type : dnnl_f32;
    q->dst_scale = out->bits8 ? out->scale : 1;
    err = quantise_weights(q, op);
    if (err)
        return err;
    if (!op->residual)
        return 0;
    *residual = out->bits8 ? net_plan_in_8_bits(p, op->in[1]) : net_plan_in_f32(p, op->in[1]);
    if (*residual < 0)
        return *residual;
    q->sum = net_dnnl_type(p->tensors[*residual].md);
    q->sum_scale = p->tensors[*residual].scale / q->dst_scale;
    return 0;
}

/* --- weights, residuals, the step ----------------------------------------------------------------- */

/* Reorder the weights into the primitive's layout, once for all runs. */
static int load_weights(struct net_plan *p, struct net_plan_step *s, const struct sst_op *op,
                        const struct net_plan_bytes *q, const_dnnl_memory_desc_t md)
{
    const_dnnl_memory_desc_t plain;
    dnnl_memory_t from = NULL;
    dnnl_primitive_desc_t pd;
    dnnl_primitive_t reorder = NULL;
    int err = weights_desc(p, &plain, op, q->scales ? dnnl_s8 : dnnl_f32, true);

    s->weights_data = sst_mem_alloc(1, dnnl_memory_desc_get_size(md));
    if (!s->weights_data)
        return -ENOMEM;
    err = err ? err : net_dnnl_errno(dnnl_memory_create(&s->weights, md, p->dnnl.engine, s->weights_data));
    if (!err)
        err = net_dnnl_errno(
            dnnl_memory_create(&from, plain, p->dnnl.engine, q->scales ? (void *)q->weights : (void *)op->weights));
    err =
        err ? err
            : net_dnnl_errno(dnnl_reorder_primitive_desc_create(&pd, plain, p->dnnl.engine, md, p->dnnl.engine, NULL));
    if (!err) {
        err = net_dnnl_errno(dnnl_primitive_create(&reorder, pd));
        dnnl_primitive_desc_destroy(pd);
    }
    if (!err) {
        const dnnl_exec_arg_t args[] = { { DNNL_ARG_FROM, from }, { DNNL_ARG_TO, s->weights } };

        err = net_dnnl_errno(dnnl_primitive_execute(reorder, p->dnnl.stream, 2, args));
    }
    err = err ? err : net_dnnl_errno(dnnl_stream_wait(p->dnnl.stream));
    dnnl_primitive_destroy(reorder);
    dnnl_memory_destroy(from);
    return err;
}

/* Biases in units of the 8-bit products, or of the result; unchanged for floats. */
static int load_bias(struct net_plan *p, struct net_plan_step *s, const struct sst_op *op,
                     const struct net_plan_bytes *q)
{
    const_dnnl_memory_desc_t md;
    int err = bias_desc(p, &md, op);

    if (!err && q->scales) {
        s->bias_data = malloc((size_t)op->channels * sizeof(*s->bias_data));
        if (!s->bias_data)
            return -ENOMEM;
        net_plan_scale_bias(op, q->scales, q->dst_scale, s->bias_data);
    }
    return err ? err
               : net_dnnl_errno(dnnl_memory_create(&s->bias, md, p->dnnl.engine, q->scales ? s->bias_data : op->bias));
}

/* The tensor that a convolution writes: a new one, or that of the residual, to which it adds. */
static int conv_result(struct net_plan *p, const struct sst_op *op, const struct net_plan_bytes *q, int residual,
                       const_dnnl_memory_desc_t md)
{
    const float scale = q->scales ? q->dst_scale : 1;
    const_dnnl_memory_desc_t as_read;
    int from = residual, to, err;

    if (!op->residual)
        return net_plan_result(p, op->out, md, scale);
    err = net_dnnl_retyped(&p->dnnl, &as_read, md, net_dnnl_type(p->tensors[from].md));
    if (err)
        return err;
    if (p->last_use[op->in[1]] != (int)(op - p->graph->ops) || p->tensors[from].external || op->in[1] == op->in[0] ||
        p->tensors[from].md != as_read) {
        to = net_plan_add_tensor(p, op->in[1], as_read, p->tensors[from].scale);
        if (to < 0)
            return to;
        err = net_plan_reorder(p, from, to);
        if (err)
            return err;
        from = to;
    }
    p->tensors[from].value = -1; /* its old value is overwritten */
    to = net_plan_result(p, op->out, md, scale);
    if (to >= 0)
        p->tensors[to].place_of = from;
    return to;
}

static int add_step(struct net_plan *p, const struct sst_op *op, const struct net_plan_bytes *q, int residual,
                    dnnl_primitive_desc_t pd)
{
    struct net_plan_step *s = NULL;
    const_dnnl_memory_desc_t md;
    int src = 0, dst = 0, err = net_dnnl_chosen(&p->dnnl, &md, pd, dnnl_query_src_md);

    if (!err)
        err = src = net_plan_in_layout(p, op->in[0], md, q->scales ? q->src_scale : 1);
    if (err >= 0)
        err = net_dnnl_chosen(&p->dnnl, &md, pd, dnnl_query_dst_md);
    if (!err)
        err = dst = conv_result(p, op, q, residual, md);
    if (err >= 0) {
        s = net_plan_add_step(p, op);
        err = s ? 0 : -ENOMEM;
    }
    if (!err)
        err = load_weights(p, s, op, q, dnnl_primitive_desc_query_md(pd, dnnl_query_weights_md, 0));
    err = err ? err : load_bias(p, s, op, q);
    if (!err && q->scales)
        err = net_plan_scales(p, s, DNNL_ARG_WEIGHTS, q->scales, op->channels);
    if (err) {
        dnnl_primitive_desc_destroy(pd);
        return err;
    }
    net_plan_add_arg(s, DNNL_ARG_SRC, src, NULL);
    net_plan_add_arg(s, DNNL_ARG_DST, dst, NULL);
    net_plan_add_arg(s, DNNL_ARG_WEIGHTS, -1, s->weights);
    net_plan_add_arg(s, DNNL_ARG_BIAS, -1, s->bias);
    return net_plan_primitive(p, s, pd);
}

/* A step by tiles from the quantised input: channels last, as oneDNN has bytes. */
static int add_tiles(struct net_plan *p, const struct sst_op *op, const struct net_plan_bytes *q, int residual)
{
    struct net_plan_step *s;
    const_dnnl_memory_desc_t md;
    int src = 0, dst = 0, err = net_plan_desc(p, &md, p->shapes[op->in[0]], q->src, dnnl_nhwc);

    if (!err)
        err = src = net_plan_in_layout(p, op->in[0], md, q->src_scale);
    if (err >= 0)
        err = net_plan_desc(p, &md, p->shapes[op->out], q->dst, dnnl_nhwc);
    if (!err)
        err = dst = conv_result(p, op, q, residual, md);
    if (err < 0)
        return err;
    s = net_plan_add_step(p, op);
    if (!s)
        return -ENOMEM;
    s->n_args = 2;
    s->tensor[0] = src;
    s->tensor[1] = dst;
    return net_plan_tiles_create(&s->tiles, p, op, q);
}

int net_plan_add_conv(struct net_plan *p, const struct sst_op *op)
{
    struct net_plan_bytes q = not_quantised;
    dnnl_primitive_desc_t pd;
    int residual = -1, err = 0;
    bool serial = false;

    if (net_plan_conv_on_8_bits(p, op))
        err = quantise(p, op, &q, &residual);
    else if (op->residual)
        err = residual = net_plan_in_f32(p, op->in[1]);
    if (err >= 0 && q.scales && net_plan_tiles_fit(p, op, q.weights)) {
        err = add_tiles(p, op, &q, residual);
    } else {
        err = err < 0 ? err : same_conv_desc(p, op, &q, &pd, &serial);
        err = err ? err : add_step(p, op, &q, residual, pd);
        if (!err)
            p->steps[p->n_steps - 1].serial = serial;
    }
    free(q.scales);
    free(q.weights);
    return err;
}
