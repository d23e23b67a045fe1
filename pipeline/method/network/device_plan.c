/* A graph as dispatches of the shaders of pipeline/gpu/net.h: the same choices of 8 bits, scales and conversions as the
 * plan for the CPU (plan_dnnl.c, plan_conv.c), also of processors without VNNI. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/network/device_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/gpu/net.h"
#include "pipeline/method/network/plan_dnnl.h"

#define NONE       (-1)
#define MAX_GROUPS 65535 /* that every device has along an axis */
/* Lavapipe of Mesa 22.3 leaves all loops of an invocation after 65,535 passes in sum, without an error: no layer comes
 * near it. A slab of 8 words is at most 12 passes of net_conv; on 8 bits MAX_PRODUCTS (plan_bits.c) is less than this
 * allows. */
#define MAX_PASSES       49152
#define MAX_WORDS_FLOATS (MAX_PASSES / 12 * SST_GPU_NET_SLAB) /* inputs of a result */
#define MAX_POOLED       (MAX_PASSES * 64)                    /* pixels of a mean: 64 invocations share them */

/** A value in one layout. */
struct tensor {
    int value; /* of the graph */
    float scale;
    int channels;
    struct sst_gpu_net_tensor at;
    struct net_span span;
};

_Static_assert(sizeof(struct sst_gpu_net_conv) == 108 && sizeof(struct sst_gpu_net_layer) == 72,
               "the layout of net_*.comp; every device has 128 bytes of constants");

struct step {
    enum sst_gpu_shader shader;
    union {
        struct sst_gpu_net_conv conv;
        struct sst_gpu_net_layer layer;
    };
    int from, to, residual; /* tensors */
    uint32_t to_words;      /* channels of `to` before those that are written, in words */
    uint32_t groups[3];
};

struct net_device_plan {
    struct tensor *tensors;
    struct step *steps;
    uint32_t *fixed; /* until it is uploaded */
    int n_tensors, n_steps, tensors_room, steps_room;
    size_t fixed_words, fixed_room;
    int input, output; /* tensors */
    bool ends_in_bytes;
    const char *conv8; /* shader of convolutions on 8 bits; NULL: there are none */
    struct sst_gpu *gpu;
    struct sst_gpu_buffer *weights;
    size_t arena_bytes;
};

enum { ARENA, PROBED }; /* scratch memory */

struct building {
    struct net_device_plan *p;
    struct sst_run *r;
    struct net_plan bits; /* graph, precision, values */
    const struct sst_shape *shapes;
    char *why;
};

static int unsupported(struct building *b, const char *why)
{
    snprintf(b->why, NET_DEVICE_WHY, "%s", why);
    return -ENOTSUP;
}

static void too_large(const struct net_plan_config *cfg, char why[NET_DEVICE_WHY])
{
    snprintf(why, NET_DEVICE_WHY, "a network of %d x %d pixels does not fit into the device's memory", cfg->width,
             cfg->height);
}

/* --- groups of the shaders ---------------------------------------------------------------------------------------- */

static uint32_t divide_up(uint32_t a, uint32_t b)
{
    return (a + b - 1) / b;
}

static bool is_conv(enum sst_gpu_shader shader)
{
    return shader == SST_GPU_NET_CONV || shader == SST_GPU_NET_CONV8 || shader == SST_GPU_NET_CONV8_DOT ||
           shader == SST_GPU_NET_CONV8_MATRIX;
}

/* Groups of a step with its constants set. */
static void set_groups(struct step *s)
{
    if (is_conv(s->shader)) {
        const bool matrix = s->shader == SST_GPU_NET_CONV8_MATRIX;
        const struct sst_gpu_net_conv *c = &s->conv;

        s->groups[0] =
            divide_up((uint32_t)c->to.width * (uint32_t)c->to.height, matrix ? SST_GPU_NET_MATRIX : SST_GPU_NET_TILE);
        s->groups[1] = divide_up((uint32_t)c->channels, matrix ? SST_GPU_NET_MATRIX_OUT : SST_GPU_NET_TILE_OUT);
    } else {
        const struct sst_gpu_net_layer *l = &s->layer;
        const uint32_t fours = s->shader == SST_GPU_NET_UNIT ? 1 : divide_up((uint32_t)l->channels, 4);
        const uint32_t across = (uint32_t)l->to.width * fours;

        s->groups[0] = s->shader == SST_GPU_NET_POOL ? across : divide_up(across, SST_GPU_NET_GROUP);
        s->groups[1] = (uint32_t)l->to.height;
    }
    s->groups[2] = 1;
}

/* --- tensors ------------------------------------------------------------------------------------------------------ */

static uint32_t type_of(const struct net_plan_value *v)
{
    return v->type == dnnl_u8 ? SST_GPU_NET_U8 : SST_GPU_NET_S8;
}

static bool is_bytes(const struct tensor *t)
{
    return t->at.type == SST_GPU_NET_U8 || t->at.type == SST_GPU_NET_S8;
}

static int add_tensor(struct building *b, int value, uint32_t type, float scale)
{
    struct net_device_plan *p = b->p;
    const struct sst_shape s = b->shapes[value];
    const bool planes = type == SST_GPU_NET_PLANES;
    const size_t pixels = (size_t)s.w * (size_t)s.h;
    const uint32_t pitch = planes ? (uint32_t)pixels : sst_gpu_net_words(s.c, type);

    if (!sst_mem_grow(&p->tensors, p->n_tensors, &p->tensors_room, sizeof(*p->tensors)))
        return -ENOMEM;
    p->tensors[p->n_tensors] = (struct tensor){
        .value = value,
        .scale = scale,
        .channels = s.c,
        .at = { 0, pitch, type, s.w, s.h },
        .span = { .bytes = sst_mem_stride((planes ? (size_t)s.c : pixels) * pitch, 4), .first = -1 },
    };
    return p->n_tensors++;
}

static struct step *add_step(struct building *b, enum sst_gpu_shader shader, int from, int to)
{
    struct net_device_plan *p = b->p;
    struct step *s;

    if (!sst_mem_grow(&p->steps, p->n_steps, &p->steps_room, sizeof(*p->steps)))
        return NULL;
    s = &p->steps[p->n_steps++];
    memset(s, 0, sizeof(*s));
    s->shader = shader;
    s->from = from;
    s->to = to;
    s->residual = NONE;
    return s;
}

/* Append a step that is no convolution. @param scale  of what is read */
static int add_layer(struct building *b, enum sst_gpu_shader shader, int from, int to, float scale)
{
    struct step *s = add_step(b, shader, from, to);

    if (!s)
        return -ENOMEM;
    s->layer.scale = scale;
    s->layer.channels = b->p->tensors[from].channels;
    return 0;
}

/* Append words that do not change; their index, or a negative errno. */
static int64_t add_fixed(struct building *b, size_t words)
{
    struct net_device_plan *p = b->p;
    const size_t at = p->fixed_words;

    if (at + words > p->fixed_room) {
        const size_t room = 2 * (at + words);
        uint32_t *bigger = realloc(p->fixed, room * sizeof(*bigger));

        if (!bigger)
            return -ENOMEM;
        p->fixed = bigger;
        p->fixed_room = room;
    }
    memset(p->fixed + at, 0, words * sizeof(*p->fixed));
    p->fixed_words += words;
    return (int64_t)at;
}

/* A tensor of a value that has a type and scale, by a copy if there is none. */
static int in_type(struct building *b, int value, uint32_t type, float scale)
{
    int from = NONE, to, err;

    for (int i = b->p->n_tensors - 1; i >= 0; i--) {
        const struct tensor *t = &b->p->tensors[i];

        if (t->value != value)
            continue;
        if (t->at.type == type && t->scale == scale)
            return i;
        from = i; /* the oldest: the source of the others */
    }
    to = add_tensor(b, value, type, scale);
    if (to < 0)
        return to;
    err = add_layer(b, SST_GPU_NET_MOVE, from, to, b->p->tensors[from].scale / scale);
    return err ? err : to;
}

static int in_f32(struct building *b, int value)
{
    return in_type(b, value, SST_GPU_NET_F32, 1);
}

/* In 8 bits of any scale. */
static int in_8_bits(struct building *b, int value)
{
    const struct net_plan_value *v = &b->bits.values[value];

    for (int i = 0; i < b->p->n_tensors; i++) {
        if (b->p->tensors[i].value == value && is_bytes(&b->p->tensors[i]))
            return i;
    }
    return in_type(b, value, type_of(v), v->scale);
}

/* In whatever type layers on floats read it: bytes only where it was computed so. */
static int as_computed(struct building *b, int value)
{
    for (int i = 0; i < b->p->n_tensors; i++) {
        if (b->p->tensors[i].value == value)
            return b->p->tensors[i].at.type == SST_GPU_NET_PLANES ? in_f32(b, value) : i;
    }
    return -EINVAL; /* not reached: values are computed in the graph's order */
}

/* --- convolutions ------------------------------------------------------------------------------------------------- */

static int pair(const int v[2])
{
    return v[0] << 16 | v[1];
}

static bool fits_pair(const int v[2])
{
    return v[0] >= 0 && v[1] >= 0 && v[0] < 1 << 15 && v[1] < 1 << 15;
}

/* True if every reader of a value reads it in the bytes that a convolution would store. */
static bool only_bytes_read(const struct building *b, int value)
{
    const struct sst_graph *g = b->bits.graph;

    if (!b->bits.values[value].bits8 || value == g->output)
        return false;
    for (int i = 0; i < g->n_ops; i++) {
        const struct sst_op *op = &g->ops[i];

        for (int k = 0; k < (op->kind == SST_OP_RESIZE ? 1 : op->n_in); k++) {
            const bool conv = op->kind == SST_OP_CONV && k == 0 && net_plan_conv_on_8_bits(&b->bits, op);
            const bool residual = op->kind == SST_OP_CONV && k == 1 && net_plan_conv_on_8_bits(&b->bits, op) &&
                                  b->bits.values[op->out].bits8;
            const bool same = op->kind == SST_OP_CONCAT && b->bits.values[op->out].bits8 &&
                              b->bits.values[op->out].scale == b->bits.values[value].scale &&
                              b->bits.values[op->out].type == b->bits.values[value].type;

            if (op->in[k] == value && !conv && !residual && !same)
                return false;
        }
    }
    return true;
}

/* Weights in the order of net.h. */
static int add_weights(struct building *b, const struct sst_op *op, struct sst_gpu_net_conv *c, const int8_t *bytes)
{
    const size_t outs = divide_up((uint32_t)op->channels, SST_GPU_NET_TILE_OUT) * SST_GPU_NET_TILE_OUT;
    const size_t taps = (size_t)op->kernel[0] * (size_t)op->kernel[1], inputs = (size_t)op->group_in;
    const size_t words = (taps * c->from.pitch + SST_GPU_NET_SLAB - 1) / SST_GPU_NET_SLAB * SST_GPU_NET_SLAB;
    const int64_t at = add_fixed(b, words * outs);
    uint32_t *to;

    if (at < 0)
        return (int)at;
    c->weights_at = (uint32_t)at;
    to = b->p->fixed + at;
    for (size_t o = 0; o < (size_t)op->channels; o++) {
        for (size_t i = 0; i < inputs; i++) {
            for (size_t t = 0; t < taps; t++) {
                const size_t from = (o * inputs + i) * taps + t;

                if (bytes)
                    to[(t * c->from.pitch + i / 4) * outs + o] |= (uint32_t)(uint8_t)bytes[from] << (8 * (i % 4));
                else
                    memcpy(to + (t * c->from.pitch + i) * outs + o, op->weights + from, sizeof(float));
            }
        }
    }
    return 0;
}

/* Append `n` floats, padded to the channels of a tile. */
static int add_floats(struct building *b, uint32_t *index, const float *values, int n)
{
    const int64_t at =
        add_fixed(b, ((size_t)n + SST_GPU_NET_TILE_OUT - 1) / SST_GPU_NET_TILE_OUT * SST_GPU_NET_TILE_OUT);

    if (at < 0)
        return (int)at;
    memcpy(b->p->fixed + at, values, (size_t)n * sizeof(*values));
    *index = (uint32_t)at;
    return 0;
}

static int add_numbers_8(struct building *b, const struct sst_op *op, struct sst_gpu_net_conv *c, float src_scale,
                         float dst_scale)
{
    const size_t n = (size_t)op->channels, per = (size_t)op->group_in * (size_t)op->kernel[0] * (size_t)op->kernel[1];
    float *scales = malloc(n * sizeof(*scales)), *bias = malloc(n * sizeof(*bias));
    int8_t *bytes = malloc(n * per);
    int err = scales && bias && bytes ? 0 : -ENOMEM;

    if (!err) {
        net_plan_quantise(op, c->from.type == SST_GPU_NET_S8, src_scale / dst_scale, bytes, scales);
        net_plan_scale_bias(op, scales, dst_scale, bias);
        err = add_weights(b, op, c, bytes);
    }
    err = err ? err : add_floats(b, &c->scales_at, scales, op->channels);
    err = err ? err : add_floats(b, &c->bias_at, bias, op->channels);
    free(scales);
    free(bias);
    free(bytes);
    return err;
}

/* Bias before relu: added to bytes of the result, or to floats. */
static void set_residual(const struct building *b, struct step *s, int residual, bool to_bytes)
{
    s->residual = residual;
    s->conv.residual_scale = b->p->tensors[residual].scale / (to_bytes ? b->p->tensors[s->to].scale : 1);
    s->conv.residual_mode = to_bytes ? SST_GPU_NET_FUSED : SST_GPU_NET_UNFUSED;
}

static int add_conv(struct building *b, const struct sst_op *op)
{
    const bool on8 = net_plan_conv_on_8_bits(&b->bits, op), bits8 = b->bits.values[op->out].bits8;
    const bool to_bytes = on8 ? bits8 : only_bytes_read(b, op->out);
    const struct net_plan_value *out = &b->bits.values[op->out];
    int from, residual = NONE, to, err;
    struct step *s;

    if (op->group != 1 || !fits_pair(op->kernel) || !fits_pair(op->stride) || !fits_pair(op->pad_before) ||
        !fits_pair(op->dilation))
        return unsupported(b, "a convolution in groups, or of absurd sizes");
    if (!on8 && (int64_t)((op->group_in + 3) / 4 * 4) * op->kernel[0] * op->kernel[1] > MAX_WORDS_FLOATS)
        return unsupported(b, "a convolution of more than 32768 numbers for a result");
    from = on8 ? in_8_bits(b, op->in[0]) : in_f32(b, op->in[0]);
    if (from < 0)
        return from;
    if (op->residual)
        residual = on8 && bits8 ? in_8_bits(b, op->in[1]) : as_computed(b, op->in[1]);
    if (op->residual && residual < 0)
        return residual;
    to = add_tensor(b, op->out, to_bytes ? type_of(out) : SST_GPU_NET_F32, to_bytes ? out->scale : 1);
    s = to < 0 ? NULL : add_step(b, on8 ? SST_GPU_NET_CONV8 : SST_GPU_NET_CONV, from, to);
    if (!s)
        return to < 0 ? to : -ENOMEM;
    s->conv = (struct sst_gpu_net_conv){
        .from = b->p->tensors[from].at,
        .channels = op->channels,
        .kernel = pair(op->kernel),
        .stride = pair(op->stride),
        .pad = pair(op->pad_before),
        .dilation = pair(op->dilation),
        .residual_mode = SST_GPU_NET_NONE,
        .out_scale = to_bytes ? 1 / out->scale : 1,
        .relu = op->relu,
    };
    if (residual != NONE)
        set_residual(b, s, residual, on8 && bits8);
    if (on8)
        return add_numbers_8(b, op, &s->conv, b->p->tensors[from].scale, to_bytes ? out->scale : 1);
    err = add_weights(b, op, &s->conv, NULL);
    return err ? err : add_floats(b, &s->conv.bias_at, op->bias, op->channels);
}

/* --- other layers ------------------------------------------------------------------------------------------------- */

static int add_concat(struct building *b, const struct sst_op *op)
{
    const struct net_plan_value *out = &b->bits.values[op->out];
    const int to = add_tensor(b, op->out, out->bits8 ? type_of(out) : SST_GPU_NET_F32, out->bits8 ? out->scale : 1);
    int channels = 0, err = to < 0 ? to : 0;

    for (int i = 0; i < op->n_in && !err; i++) {
        const int from = as_computed(b, op->in[i]);

        if (channels % 4)
            return unsupported(b, "a concatenation of channels that are no multiple of 4");
        err = from < 0 ? from
                       : add_layer(b, SST_GPU_NET_MOVE, from, to, b->p->tensors[from].scale / b->p->tensors[to].scale);
        if (!err)
            b->p->steps[b->p->n_steps - 1].to_words = sst_gpu_net_words(channels, b->p->tensors[to].at.type);
        channels += b->shapes[op->in[i]].c;
    }
    return err;
}

static int add_taps(struct building *b, const struct sst_op *op)
{
    const struct sst_shape out = b->shapes[op->out];
    const int64_t at =
        add_fixed(b, ((size_t)out.h + (size_t)out.w) * sizeof(struct sst_gpu_net_tap) / sizeof(*b->p->fixed));

    _Static_assert(sizeof(struct net_tap) == sizeof(struct sst_gpu_net_tap), "one structure on CPU and device");
    if (at < 0)
        return (int)at;
    resize_taps((struct net_tap *)(void *)(b->p->fixed + at), op, b->shapes[op->in[0]], out);
    b->p->steps[b->p->n_steps - 1].layer.taps_at = (uint32_t)at;
    return 0;
}

/* A layer from whatever type to floats. */
static int add_to_floats(struct building *b, const struct sst_op *op, enum sst_gpu_shader shader)
{
    const int from = as_computed(b, op->in[0]);
    const int to = from < 0 ? from : add_tensor(b, op->out, SST_GPU_NET_F32, 1);
    const int err = to < 0 ? to : add_layer(b, shader, from, to, b->p->tensors[from].scale);

    return err || shader != SST_GPU_NET_RESIZE ? err : add_taps(b, op);
}

/* The caller asks for bytes. */
static int add_unit(struct building *b, const struct sst_op *op)
{
    const int from = in_f32(b, op->in[0]);
    const int to = from < 0 ? from : add_tensor(b, op->out, SST_GPU_NET_S8, 1);
    struct sst_gpu_net_layer *l;
    int err;

    if (op->out != b->bits.graph->output || op->channels % 8)
        return unsupported(b, "a normalisation that is not the last layer, or of channels that are no multiple of 8");
    err = to < 0 ? to : add_layer(b, SST_GPU_NET_UNIT, from, to, 1);
    if (err)
        return err;
    l = &b->p->steps[b->p->n_steps - 1].layer;
    l->in_add = (float)op->norm_in_add;
    l->in_min = (float)op->norm_in_min;
    l->add = (float)op->norm_add;
    l->min = (float)op->norm_min;
    b->p->ends_in_bytes = true;
    return 0;
}

/* Pixels of the largest mean. */
static int64_t most_pooled(struct sst_shape in, struct sst_shape out)
{
    return (int64_t)(in.h / out.h + 2) * (in.w / out.w + 2);
}

static int add_op(struct building *b, const struct sst_op *op)
{
    switch (op->kind) {
    case SST_OP_CONV:
        return add_conv(b, op);
    case SST_OP_CONCAT:
        return add_concat(b, op);
    case SST_OP_ADAPTIVE_POOL:
        if (most_pooled(b->shapes[op->in[0]], b->shapes[op->out]) > MAX_POOLED)
            return unsupported(b, "a mean of more than 3 million pixels");
        return add_to_floats(b, op, SST_GPU_NET_POOL);
    case SST_OP_RESIZE:
        return add_to_floats(b, op, SST_GPU_NET_RESIZE);
    case SST_OP_NORMALIZE:
        return add_unit(b, op);
    case SST_OP_RELU:
    case SST_OP_ADD:
    case SST_OP_MAX_POOL:
    case SST_OP_AVG_POOL:
    case SST_OP_SOFTMAX:
        break;
    }
    return unsupported(b, op->kind == SST_OP_SOFTMAX ? "Softmax has no shader"
                          : op->kind == SST_OP_RELU || op->kind == SST_OP_ADD
                              ? "Relu or Add apart from a convolution has no shader"
                              : "MaxPool and AveragePool have no shader");
}

/* --- memory, buffers ---------------------------------------------------------------------------------------------- */

static void use(struct net_device_plan *p, int tensor, int step)
{
    struct net_span *s = &p->tensors[tensor].span;

    if (s->first < 0)
        s->first = step;
    s->last = step;
}

static int place(struct net_device_plan *p)
{
    struct net_span *spans = calloc((size_t)p->n_tensors, sizeof(*spans));

    if (!spans)
        return -ENOMEM;
    for (int i = 0; i < p->n_steps; i++) {
        use(p, p->steps[i].from, i);
        use(p, p->steps[i].to, i);
        if (p->steps[i].residual != NONE)
            use(p, p->steps[i].residual, i);
    }
    p->tensors[p->output].span.last = p->n_steps;
    for (int i = 0; i < p->n_tensors; i++)
        spans[i] = p->tensors[i].span;
    p->arena_bytes = net_place(spans, p->n_tensors);
    for (int i = 0; i < p->n_tensors; i++)
        p->tensors[i].at.at = (uint32_t)(spans[i].offset / 4);
    free(spans);
    return 0;
}

/* True if the sum of a product and another number is rounded once. @param by_parts  without fma() */
static bool rounds_once(struct sst_run *r, bool by_parts)
{
    enum { OUTS = SST_GPU_NET_TILE_OUT, WEIGHTS = SST_GPU_NET_SLAB * OUTS, PIXELS = SST_GPU_NET_TILE };
    const struct sst_gpu_net_conv c = { .from = { 0, 4, SST_GPU_NET_F32, PIXELS, 1 },
                                        .to = { 4 * PIXELS, OUTS, SST_GPU_NET_F32, PIXELS, 1 },
                                        .channels = OUTS,
                                        .kernel = 1 << 16 | 1,
                                        .stride = 1 << 16 | 1,
                                        .dilation = 1 << 16 | 1,
                                        .bias_at = WEIGHTS,
                                        .residual_mode = SST_GPU_NET_NONE,
                                        .by_parts = by_parts,
                                        .bias_first = 1 };
    float fixed[WEIGHTS + OUTS] = { 0 }, values[(4 + OUTS) * PIXELS] = { 0 }, *const bias = fixed + WEIGHTS;
    struct sst_gpu_range weights, at;

    for (int i = 0; i < OUTS; i++) { /* products that are nearly -bias: the rest shows how they were rounded */
        fixed[i] = 1 + (float)(i * i + 1) / 8192;
        bias[i] = i % 2 ? -fixed[i] : (float)(i - 16) / 3;
    }
    for (int i = 0; i < PIXELS; i++)
        values[4 * i] = 1 + (float)(i * i * i + 1) / (1 << 22);
    weights = sst_run_upload(r, PROBED, fixed, sizeof(fixed));
    at = sst_run_upload(r, ARENA, values, sizeof(values));
    SST_RUN_GROUPS(r, SST_GPU_NET_CONV, &c, 1, 1, 1, weights, at, at);
    sst_run_read(r, values, at, sizeof(values));
    for (int i = 0; i < PIXELS * OUTS && !sst_run_failed(r); i++) {
        if (values[4 * PIXELS + i] != fmaf(values[i / OUTS * 4], fixed[i % OUTS], bias[i % OUTS]))
            return false;
    }
    return true;
}

/* Addresses of the steps, now that tensors have theirs. */
static int resolve(struct building *b)
{
    const bool by_parts = !rounds_once(b->r, false);

    if (by_parts && !sst_gpu_is_dummy(b->p->gpu) && !rounds_once(b->r, true))
        return unsupported(b, "the shader net_conv rounds otherwise");
    for (int i = 0; i < b->p->n_steps; i++) {
        struct step *s = &b->p->steps[i];
        struct sst_gpu_net_tensor to = b->p->tensors[s->to].at;

        to.at += s->to_words;
        if (is_conv(s->shader)) {
            s->conv.from = b->p->tensors[s->from].at;
            s->conv.to = to;
            s->conv.by_parts = by_parts;
            s->conv.bias_first = s->shader == SST_GPU_NET_CONV ? net_plan_bias_first() : net_dnnl_scales_bias();
            if (s->residual != NONE) {
                s->conv.residual_at = b->p->tensors[s->residual].at.at;
                s->conv.residual_pitch = b->p->tensors[s->residual].at.pitch;
                s->conv.residual_type = b->p->tensors[s->residual].at.type;
            }
        } else {
            s->layer.from = b->p->tensors[s->from].at;
            s->layer.to = to;
        }
        set_groups(s);
        if (s->groups[0] > MAX_GROUPS || s->groups[1] > MAX_GROUPS)
            return unsupported(b, "a layer has more pixels than a device takes at once");
    }
    return 0;
}

static int make_buffers(struct building *b)
{
    struct net_device_plan *p = b->p;
    const size_t bytes = p->fixed_words * sizeof(*p->fixed);

    if (p->arena_bytes > UINT32_MAX || bytes > UINT32_MAX)
        return -ENOMEM;
    p->weights = sst_run_buffer(b->r, bytes);
    (void)sst_run_scratch(b->r, ARENA, p->arena_bytes); /* or it is known not to fit */
    sst_run_write(b->r, (struct sst_gpu_range){ p->weights, 0 }, p->fixed, bytes);
    free(p->fixed);
    p->fixed = NULL;
    return sst_run_failed(b->r) ? -ENOMEM : 0;
}

/* Choose the variant of convolutions on 8 bits. */
static int choose_variant(struct building *b)
{
    for (int i = 0; i < b->p->n_steps; i++) {
        struct step *s = &b->p->steps[i];

        if (s->shader == SST_GPU_NET_CONV8) {
            s->shader = sst_run_fastest(b->r, SST_GPU_NET_CONV8);
            b->p->conv8 = sst_gpu_shader_name(s->shader);
        }
    }
    return sst_run_failed(b->r) ? -ENOMEM : 0;
}

/* --- life --------------------------------------------------------------------------------------------------------- */

static int build(struct building *b)
{
    const struct sst_graph *g = b->bits.graph;
    int err;

    b->bits.values = calloc((size_t)g->n_values, sizeof(*b->bits.values));
    if (!b->bits.values)
        return -ENOMEM;
    net_plan_choose_bits(&b->bits);
    b->p->input = add_tensor(b, g->input, SST_GPU_NET_PLANES, 1);
    err = b->p->input < 0 ? b->p->input : 0;
    for (int i = 0; i < g->n_ops && !err; i++)
        err = add_op(b, &g->ops[i]);
    if (err)
        return err;
    b->p->output = b->p->ends_in_bytes ? as_computed(b, g->output) : in_type(b, g->output, SST_GPU_NET_PLANES, 1);
    if (b->p->output < 0)
        return b->p->output;
    if (b->p->output == b->p->input)
        return unsupported(b, "the network has no layers");
    err = place(b->p);
    err = err ? err : choose_variant(b);
    err = err ? err : resolve(b);
    return err ? err : make_buffers(b);
}

struct net_device_plan *net_device_plan_create(struct sst_run *r, const struct net_plan_config *cfg,
                                               char why[NET_DEVICE_WHY])
{
    struct sst_shape *shapes = calloc((size_t)cfg->graph->n_values, sizeof(*shapes));
    struct building b = { .p = calloc(1, sizeof(*b.p)),
                          .r = r,
                          .bits = { .graph = cfg->graph, .precision = cfg->precision },
                          .shapes = shapes,
                          .why = why };
    int err = b.p && shapes ? sst_graph_shapes(cfg->graph, cfg->width, cfg->height, shapes, cfg->name) : -ENOMEM;

    why[0] = 0;
    if (!err) {
        b.p->gpu = sst_run_gpu(r);
        err = build(&b);
    }
    free(b.bits.values);
    free(shapes);
    if (!err)
        return b.p;
    if (err == -ENOMEM)
        too_large(cfg, why);
    else if (err != -ENOTSUP)
        sst_run_fail(r, err);
    if (*why)
        sst_run_leave(r, why);
    net_device_plan_destroy(b.p);
    return NULL;
}

void net_device_plan_destroy(struct net_device_plan *p)
{
    if (!p)
        return;
    sst_gpu_buffer_destroy(p->gpu, p->weights);
    free(p->tensors);
    free(p->steps);
    free(p->fixed);
    free(p);
}

void net_device_plan_bytes(const struct net_device_plan *p, size_t *weights, size_t *activations)
{
    *weights = p->fixed_words * sizeof(*p->fixed);
    *activations = p->arena_bytes;
}

const char *net_device_plan_conv8(const struct net_device_plan *p)
{
    return p->conv8;
}

bool net_device_plan_has_s8(const struct net_device_plan *p)
{
    return p->ends_in_bytes;
}

void net_device_plan_run(struct net_device_plan *p, struct sst_run *r, struct net_job *job)
{
    const struct sst_network_keeper *k = job->keeper;
    const struct tensor *from = &p->tensors[p->input], *to = &p->tensors[p->output];
    const size_t values = (size_t)to->at.width * (size_t)to->at.height * (size_t)to->channels;
    const struct sst_gpu_range arena = sst_run_scratch(r, ARENA, p->arena_bytes);
    const struct sst_gpu_range in = { arena.buffer, 4 * (size_t)from->at.at };
    const struct sst_gpu_range out = { arena.buffer, 4 * (size_t)to->at.at };
    const struct sst_gpu_range weights = { p->weights, 0 };

    if (!arena.buffer) {
        char why[NET_DEVICE_WHY];

        too_large(&job->cfg, why);
        sst_run_leave(r, why);
        return;
    }
    sst_run_write(r, in, job->in, (size_t)from->channels * from->at.pitch * 4);
    for (int i = 0; i < p->n_steps; i++) {
        struct step *s = &p->steps[i];

        if (s->shader == SST_GPU_NET_UNIT)
            s->layer.factor = job->factor;
        SST_RUN_GROUPS(r, s->shader, &s->conv, s->groups[0], s->groups[1], s->groups[2], weights, arena, arena);
    }
    job->kept = k && k->keep && !sst_run_failed(r) && !sst_gpu_is_dummy(p->gpu) &&
                k->keep(k->arg, &(struct sst_run_result){ p->gpu, arena.buffer, to->at.at });
    if (job->kept)
        sst_run_fail(r, sst_gpu_wait(p->gpu));
    else
        sst_run_read(r, job->out ? (void *)job->out : job->out_s8, out, p->ends_in_bytes ? values : 4 * values);
    job->kept = job->kept && !sst_run_failed(r);
}
