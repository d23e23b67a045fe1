/* Small random networks, on which shaders are compared with the CPU: sizes of layers at which some failed stay.
 *
 * The first seed is on floats, the others on 8 bits, where results must be equal: the sums of the first layer, which is
 * on floats, are exact in any order. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>

#include "base/mem.h"
#include "pipeline/method/network/network_internal.h"

#define OPS       16 /* at most */
#define SEEDS     NET_SAMPLE_SEEDS
#define TOLERANCE 1e-5 /* of floats, over the largest value of a result */

enum residual { NONE, OF_INPUT, OF_CONV };
enum tail { PLAIN, CONV, ENLARGE, REDUCE, PYRAMID, UNIT };

/* A network: a first convolution to `inputs` channels, then one of this shape and its residual, then a tail. */
struct kind {
    int channels, width, height, inputs, outputs, kernel[2], stride, dilation;
    bool negative, relu; /* values between the two may be negative; the second one ends with relu */
    enum residual residual;
    enum tail tail;
    bool extreme; /* mostly the largest bytes of one sign */
};

static const struct kind kinds[SST_STEP_SAMPLES] = {
    { 3, 13, 9, 32, 64, { 3, 3 }, 2, 1, false, true, NONE, CONV, false },
    { 1, 7, 5, 128, 24, { 3, 3 }, 1, 2, false, true, OF_CONV, CONV, false },
    { 3, 11, 8, 20, 23, { 1, 1 }, 1, 1, false, false, NONE, ENLARGE, false },
    { 1, 9, 9, 64, 40, { 3, 3 }, 1, 4, true, false, OF_CONV, UNIT, false },
    { 3, 10, 6, 24, 33, { 3, 5 }, 1, 1, true, true, OF_CONV, PLAIN, false },
    { 3, 17, 9, 7, 7, { 5, 5 }, 1, 1, false, false, OF_INPUT, REDUCE, false },
    { 3, 29, 17, 12, 24, { 3, 3 }, 1, 1, false, true, NONE, PYRAMID, false },
    { 3, 6, 5, 100, 8, { 3, 3 }, 1, 1, false, false, NONE, PLAIN, true },
    { 3, 6, 5, 100, 8, { 3, 3 }, 2, 1, true, false, NONE, PLAIN, true },
};

struct sample {
    struct net_job job[SST_STEP_SAMPLES]; /* first: items of the step */
    struct sst_graph graph[SST_STEP_SAMPLES];
    struct net_plan *plan[SST_STEP_SAMPLES];
    size_t values[SST_STEP_SAMPLES]; /* of a result */
    uint32_t state;
    float push; /* of all values of the first layer, so that most have one sign, and of weights behind it; 0: none */
};

/* A multiple of 1/most between -1 and 1. */
static float fraction(struct sample *s, int most)
{
    return (float)((int)(sst_step_random(&s->state) % (uint32_t)(2 * most + 1)) - most) / (float)most;
}

/* --- layers ------------------------------------------------------------------------------------------------------- */

/* Append a layer that sets the next value. @return its value */
static int add(struct sst_graph *g, struct sst_op op)
{
    op.out = g->n_values++;
    g->range[op.out] = net_plan_fast_int8() ? 4 : 16; /* without VNNI oneDNN needs values within the range */
    g->ops[g->n_ops++] = op;
    return op.out;
}

static struct sst_op conv(int in, int inputs, int outputs)
{
    return (struct sst_op){ .kind = SST_OP_CONV,
                            .n_in = 1,
                            .in = { in },
                            .channels = outputs,
                            .kernel = { 1, 1 },
                            .stride = { 1, 1 },
                            .dilation = { 1, 1 },
                            .group = 1,
                            .group_in = inputs,
                            .relu = true };
}

/* Append a convolution of random weights. @return its value, or -1: no memory */
static int add_conv(struct sample *s, struct sst_graph *g, struct sst_op op)
{
    const size_t per = (size_t)op.group_in * (size_t)op.kernel[0] * (size_t)op.kernel[1], n = (size_t)op.channels;
    const bool exact = !g->n_ops;
    const float scale = 2 / sqrtf((float)per), fine = s->push == 0 ? 1 : 1.0f / 16;

    op.weights = malloc(n * per * sizeof(*op.weights));
    op.bias = malloc(n * sizeof(*op.bias));
    for (int i = 0; i < 2; i++)
        op.pad_before[i] = op.pad_after[i] = op.dilation[i] * (op.kernel[i] - 1) / 2;
    for (size_t i = 0; op.weights && i < n * per; i++)
        op.weights[i] = exact              ? fraction(s, 16) * fine
                        : s->push == 0     ? fraction(s, 1 << 20) * scale
                        : sst_step_random(&s->state) % 8 == 0 ? scale
                                           : -scale;
    for (size_t i = 0; op.bias && i < n; i++)
        op.bias[i] = exact ? fraction(s, 128) * fine + s->push : fraction(s, 1 << 20);
    add(g, op); /* which frees them */
    return op.weights && op.bias ? g->n_values - 1 : -1;
}

/* Means over bins, a convolution and an enlarged map of each, beside the value, and a convolution of all. */
static int add_pyramid(struct sample *s, struct sst_graph *g, int value, const struct kind *k)
{
    struct sst_op all = { .kind = SST_OP_CONCAT, .n_in = 3, .in = { value }, .channels = k->outputs + 16 };
    struct sst_op last = conv(0, all.channels, 5);

    for (int i = 0; i < 2; i++) {
        const int size[] = { 1 + 2 * i, 2 + 4 * i };
        const int pooled = add(g, (struct sst_op){ .kind = SST_OP_ADAPTIVE_POOL,
                                                   .n_in = 1,
                                                   .in = { value },
                                                   .channels = k->outputs,
                                                   .size = { size[0], size[1] } });
        struct sst_op c = conv(pooled, k->outputs, 8);

        c.relu = k->relu;
        c.in[0] = add_conv(s, g, c);
        if (c.in[0] < 0)
            return -1;
        all.in[1 + i] = add(g, (struct sst_op){ .kind = SST_OP_RESIZE,
                                                .n_in = 2,
                                                .in = { c.in[0], value },
                                                .channels = 8,
                                                .mode = SST_RESIZE_HALF_PIXEL });
    }
    last.in[0] = add(g, all);
    last.kernel[0] = last.kernel[1] = 3;
    last.relu = false;
    return add_conv(s, g, last);
}

static int add_tail(struct sample *s, struct sst_graph *g, int value, const struct kind *k)
{
    const struct sst_op resize = { .kind = SST_OP_RESIZE, .n_in = 1, .in = { value }, .channels = k->outputs };
    struct sst_op op = resize;

    switch (k->tail) {
    case PLAIN:
        return value;
    case CONV:
        return add_conv(s, g, conv(value, k->outputs, 9));
    case ENLARGE:
        op.scale[0] = op.scale[1] = 2;
        op.mode = SST_RESIZE_PYTORCH;
        return add(g, op);
    case REDUCE:
        op.size[0] = 5;
        op.size[1] = 6;
        op.mode = SST_RESIZE_ALIGN_CORNERS;
        return add(g, op);
    case PYRAMID:
        return add_pyramid(s, g, value, k);
    case UNIT:
        op.kind = SST_OP_NORMALIZE;
        op.norm_min = 1e-12;
        return add(g, op);
    }
    return -1;
}

/* @return 0 or -1: no memory */
static int build(struct sample *s, struct sst_graph *g, const struct kind *k)
{
    struct sst_op first = conv(0, k->channels, k->inputs), second = conv(0, k->inputs, k->outputs), residual;

    g->ops = calloc(OPS, sizeof(*g->ops));
    g->range = calloc(OPS + 1, sizeof(*g->range));
    if (!g->ops || !g->range)
        return -1;
    g->n_values = 1; /* the input */
    g->range[0] = 1;
    g->in_channels = k->channels;
    first.kernel[0] = first.kernel[1] = k->extreme ? 1 : 3;
    first.relu = !k->negative;
    s->push = !k->extreme ? 0 : k->negative ? -2 : 2;
    second.in[0] = add_conv(s, g, first);
    if (k->extreme)
        g->range[second.in[0]] = net_plan_fast_int8() ? 1 : 2.25f;
    residual = conv(second.in[0], k->inputs, k->outputs);
    residual.relu = first.relu;
    second.relu = k->relu;
    second.residual = k->residual != NONE;
    second.n_in += second.residual;
    second.in[1] = k->residual == OF_CONV ? add_conv(s, g, residual) : second.in[0];
    for (int i = 0; i < 2; i++) {
        second.kernel[i] = k->kernel[i];
        second.stride[i] = k->stride;
        second.dilation[i] = k->dilation;
    }
    g->output = second.in[0] < 0 || second.in[1] < 0 ? -1 : add_conv(s, g, second);
    g->output = g->output < 0 ? -1 : add_tail(s, g, g->output, k);
    g->out_channels = g->ops[g->n_ops - 1].channels;
    return g->output < 0 ? -1 : 0;
}

/* --- jobs --------------------------------------------------------------------------------------------------------- */

static bool init(struct sample *s, int item, uint32_t seed)
{
    struct kind k = kinds[item];
    struct sst_graph *g = &s->graph[item];
    struct sst_shape shapes[OPS + 1];
    struct net_job *job = &s->job[item];
    const size_t pixels = (size_t)k.width * (size_t)k.height * (size_t)k.channels;
    float *in = sst_mem_alloc(pixels, sizeof(*in));

    job->in = in;
    k.negative ^= seed == SEEDS;
    k.relu ^= seed == SEEDS;
    if (!in || build(s, g, &k))
        return false;
    for (size_t i = 0; i < pixels; i++)
        in[i] = fraction(s, 8);
    job->cfg = (struct net_plan_config){ .graph = g,
                                         .name = "",
                                         .width = k.width,
                                         .height = k.height,
                                         .threads = 1,
                                         .precision = seed == 1 ? SST_PRECISION_F32 : SST_PRECISION_INT8 };
    job->plan = &s->plan[item];
    job->factor = 127;
    if (sst_graph_shapes(g, k.width, k.height, shapes, NULL))
        return false;
    s->values[item] = (size_t)shapes[g->output].c * (size_t)shapes[g->output].h * (size_t)shapes[g->output].w;
    if (k.tail == UNIT)
        job->out_s8 = sst_mem_alloc(s->values[item], 1);
    else
        job->out = sst_mem_alloc(s->values[item], sizeof(*job->out));
    return job->out || job->out_s8;
}

void *net_sample(uint32_t seed)
{
    struct sample *s = calloc(1, sizeof(*s));
    bool made = s;

    if (s)
        s->state = seed * 7919;
    for (int i = 0; made && i < SST_STEP_SAMPLES; i++)
        made = init(s, i, seed);
    if (made)
        return s;
    net_sample_free(s);
    return NULL;
}

void net_sample_free(void *job)
{
    struct sample *s = job;

    for (int i = 0; s && i < SST_STEP_SAMPLES; i++) {
        net_plan_destroy(s->plan[i]);
        sst_graph_fini(&s->graph[i]);
        sst_mem_free((void *)(uintptr_t)s->job[i].in);
        sst_mem_free(s->job[i].out);
        sst_mem_free(s->job[i].out_s8);
    }
    free(s);
}

bool net_sample_same(const void *got_job, const void *want_job, int item)
{
    const struct sample *a = got_job, *b = want_job;
    const struct net_job *got = &a->job[item], *want = &b->job[item];
    const bool exact = want->cfg.precision == SST_PRECISION_INT8;
    double most = 0, apart = 0;

    for (size_t i = 0; i < b->values[item]; i++) {
        const double x = want->out ? (double)got->out[i] : got->out_s8[i];
        const double y = want->out ? (double)want->out[i] : want->out_s8[i];

        if (!(x == x && y == y)) /* never */
            return false;
        most = fmax(most, fabs(y));
        apart = fmax(apart, fabs(x - y));
    }
    return apart <= (exact ? 0 : want->out ? TOLERANCE * (1 + most) : 1);
}
