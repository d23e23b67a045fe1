/* Chooses which values are stored in 8 bits, and their scales. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "pipeline/method/network/plan_dnnl.h"

/* A product of u8 and s8 is at most 255 * 127; this many fit an int32 in any order, with room for a bias of the same
 * size. */
#define MAX_PRODUCTS (INT32_MAX / 2 / (255 * 127))

/* Without VNNI oneDNN multiplies pairs of bytes into 16 bits, which 2 * 255 * 127 overflows and 2 * 127 * 127 does not:
 * values that are never negative use 7 bits there. Others it makes u8 by adding 128, and halves the weights, rounded:
 * these are even there, so that nothing is lost. Shaders beside such a processor do the same. */
bool net_plan_fast_int8(void)
{
    static const unsigned vnni[] = { dnnl_cpu_isa_avx512_core_vnni, dnnl_cpu_isa_avx2_vnni };
    const unsigned isa = (unsigned)dnnl_get_effective_cpu_isa();

    /* Instruction sets are bit masks; each includes those it builds on. */
    return (isa & vnni[0]) == vnni[0] || (isa & vnni[1]) == vnni[1];
}

/* Pairs of bytes take about half the time of floats with SSE4.1 and AVX2. AVX-512 without VNNI has no gain; oneDNN for
 * arm64 names no instruction set. */
bool net_plan_int8_pays(void)
{
    const unsigned isa = (unsigned)dnnl_get_effective_cpu_isa();

    return net_plan_fast_int8() || ((isa & dnnl_cpu_isa_sse41) && net_plan_bias_first());
}

bool net_plan_bias_first(void)
{
    const unsigned avx512 = dnnl_cpu_isa_avx512_core;

    return ((unsigned)dnnl_get_effective_cpu_isa() & avx512) != avx512;
}

bool net_plan_conv_on_8_bits(const struct net_plan *p, const struct sst_op *op)
{
    return p->precision == SST_PRECISION_INT8 && op->kind == SST_OP_CONV && p->graph->range[op->in[0]] > 0 &&
           op->in[0] != p->graph->input && (int64_t)op->group_in * op->kernel[0] * op->kernel[1] <= MAX_PRODUCTS;
}

static bool moves_values(const struct sst_op *op)
{
    return op->kind == SST_OP_MAX_POOL || op->kind == SST_OP_AVG_POOL || op->kind == SST_OP_CONCAT;
}

static bool never_negative(const struct net_plan *p, const struct sst_op *op)
{
    bool all = true;

    if (op->kind == SST_OP_CONV)
        return op->relu;
    if (op->kind == SST_OP_RELU || op->kind == SST_OP_SOFTMAX)
        return true;
    if (op->kind == SST_OP_NORMALIZE)
        return p->values[op->in[0]].never_negative;
    for (int i = 0; i < (op->kind == SST_OP_RESIZE ? 1 : op->n_in); i++)
        all &= p->values[op->in[i]].never_negative;
    return all;
}

/* Walk back: convolutions request 8-bit inputs; layers that only move values propagate the request. */
static void find_requested(struct net_plan *p)
{
    for (int i = p->graph->n_ops - 1; i >= 0; i--) {
        const struct sst_op *op = &p->graph->ops[i];
        const bool out = p->values[op->out].bits8;

        if (net_plan_conv_on_8_bits(p, op)) {
            p->values[op->in[0]].bits8 = true;
            if (op->residual && out)
                p->values[op->in[1]].bits8 = true;
        } else if (moves_values(op) && out) {
            for (int k = 0; k < op->n_in; k++)
                p->values[op->in[k]].bits8 = true;
        }
    }
}

static void set_units(struct net_plan *p, int value, float range, bool never_negative)
{
    struct net_plan_value *v = &p->values[value];

    v->type = never_negative ? dnnl_u8 : dnnl_s8;
    v->scale = range / (never_negative && net_plan_fast_int8() ? 255.0f : 127.0f);
}

/* Inputs of a concatenation share their scale, so that it is a copy. */
static void join_units(struct net_plan *p, const struct sst_op *op)
{
    float range = p->graph->range[op->out];

    for (int i = 0; i < op->n_in; i++)
        range = fmaxf(range, p->graph->range[op->in[i]]);
    set_units(p, op->out, range, p->values[op->out].never_negative);
    for (int i = 0; i < op->n_in; i++)
        set_units(p, op->in[i], range, p->values[op->out].never_negative);
}

void net_plan_choose_bits(struct net_plan *p)
{
    const struct sst_graph *g = p->graph;

    if (p->precision != SST_PRECISION_INT8)
        return;
    for (int i = 0; i < g->n_ops; i++)
        p->values[g->ops[i].out].never_negative = never_negative(p, &g->ops[i]);
    find_requested(p);
    for (int v = 0; v < g->n_values; v++) {
        p->values[v].bits8 &= g->range[v] > 0 && v != g->output;
        set_units(p, v, g->range[v], p->values[v].never_negative);
    }
    for (int i = 0; i < g->n_ops; i++) {
        if (g->ops[i].kind == SST_OP_CONCAT && p->values[g->ops[i].out].bits8)
            join_units(p, &g->ops[i]);
    }
}
