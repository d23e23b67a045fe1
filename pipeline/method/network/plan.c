/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/network/network_internal.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "pipeline/method/network/plan_dnnl.h"

/* Layouts that ops.h works on: [c][h][w], channels in blocks of 16 or 8, [h][w][c]. */
static void find_layout(struct net_plan *p, struct net_plan_tensor *t)
{
    static const struct {
        dnnl_format_tag_t tag;
        int block;
    } known[] = { { dnnl_nchw, 1 }, { dnnl_nChw16c, 16 }, { dnnl_nChw8c, 8 }, { dnnl_nhwc, 0 } };

    for (size_t i = 0; i < ARRAY_LEN(known); i++) {
        const_dnnl_memory_desc_t same;

        if (net_plan_desc(p, &same, p->shapes[t->value], dnnl_f32, known[i].tag) || same != t->md)
            continue;
        t->tag = known[i].tag;
        t->view.block = known[i].block ? known[i].block : t->view.c;
        return;
    }
}

int net_plan_add_tensor(struct net_plan *p, int value, const_dnnl_memory_desc_t md, float scale)
{
    const struct sst_shape shape = p->shapes[value];
    struct net_plan_tensor *t;

    if (!sst_mem_grow(&p->tensors, p->n_tensors, &p->tensors_room, sizeof(*p->tensors)))
        return -ENOMEM;
    t = &p->tensors[p->n_tensors];
    *t = (struct net_plan_tensor){
        .value = value,
        .place_of = -1,
        .scale = scale,
        .md = md,
        .bytes = sst_mem_stride(dnnl_memory_desc_get_size(md), 1),
        .first = -1,
        .view = { .c = shape.c, .h = shape.h, .w = shape.w },
    };
    find_layout(p, t);
    return p->n_tensors++;
}

struct net_plan_step *net_plan_add_step(struct net_plan *p, const struct sst_op *op)
{
    struct net_plan_step *s;

    if (!sst_mem_grow(&p->steps, p->n_steps, &p->steps_room, sizeof(*p->steps)))
        return NULL;
    s = &p->steps[p->n_steps++];
    *s = (struct net_plan_step){ .op = op };
    return s;
}

/* --- memory --------------------------------------------------------------------------------------- */

static void find_lifetimes(struct net_plan *p)
{
    for (int i = 0; i < p->n_steps; i++) {
        for (int k = 0; k < p->steps[i].n_args; k++) {
            struct net_plan_tensor *t = p->steps[i].tensor[k] >= 0 ? &p->tensors[p->steps[i].tensor[k]] : NULL;

            if (!t)
                continue;
            if (t->first < 0)
                t->first = i;
            t->last = i;
        }
    }
    /* Memory of tensors that are no longer needed is reused. */
    for (int i = p->n_tensors - 1; i >= 0; i--) {
        const struct net_plan_tensor *t = &p->tensors[i];

        if (t->place_of >= 0)
            p->tensors[t->place_of].last = sst_max_int(p->tensors[t->place_of].last, t->last);
    }
}

static bool in_arena(const struct net_plan_tensor *t)
{
    return !t->external && t->first >= 0 && t->place_of < 0;
}

static int place_tensors(struct net_plan *p)
{
    struct net_span *spans = calloc((size_t)p->n_tensors, sizeof(*spans));

    if (!spans)
        return -ENOMEM;
    for (int i = 0; i < p->n_tensors; i++) {
        const struct net_plan_tensor *t = &p->tensors[i];

        spans[i] = (struct net_span){ .bytes = t->bytes, .first = in_arena(t) ? t->first : -1, .last = t->last };
    }
    p->arena_bytes = net_place(spans, p->n_tensors);
    for (int i = 0; i < p->n_tensors; i++) {
        struct net_plan_tensor *t = &p->tensors[i];

        t->offset = t->place_of >= 0 ? p->tensors[t->place_of].offset : spans[i].offset;
    }
    free(spans);
    return 0;
}

static int allocate(struct net_plan *p)
{
    const struct sst_shape in = p->shapes[p->graph->input];
    int err = place_tensors(p);

    if (err)
        return err;
    if (p->arena_bytes + p->scratch_bytes > NET_PLAN_MAX_BYTES((int64_t)in.w * in.h)) {
        sst_log_error("model %s needs %zu MiB for an image of %d x %d, more than the limit of 64 MiB and 16 KiB per "
                      "pixel; use another one",
                      p->name, (p->arena_bytes + p->scratch_bytes) >> 20, in.w, in.h);
        return -EINVAL;
    }
    p->arena = sst_mem_alloc_raw(1, p->arena_bytes + 1);
    p->scratch = sst_mem_alloc_raw(1, p->scratch_bytes + 1);
    if (!p->arena || !p->scratch)
        return -ENOMEM;
    for (int i = 0; !err && i < p->n_tensors; i++) {
        struct net_plan_tensor *t = &p->tensors[i];

        if (!t->external)
            t->view.data = (float *)(void *)((char *)p->arena + t->offset);
        err = net_dnnl_errno(
            dnnl_memory_create(&t->memory, t->md, p->dnnl.engine, t->external ? DNNL_MEMORY_NONE : t->view.data));
    }
    for (int i = 0; !err && i < p->n_steps; i++) {
        struct net_plan_step *s = &p->steps[i];

        for (int k = 0; k < s->n_args; k++) {
            if (s->tensor[k] >= 0)
                s->args[k].memory = p->tensors[s->tensor[k]].memory;
        }
        if (s->scratch)
            err = net_dnnl_errno(dnnl_memory_set_data_handle(s->scratch, p->scratch));
    }
    return err;
}

static bool tiles_stay(struct net_plan *p, int threads)
{
    omp_set_num_threads(threads);
    for (int i = 0; i < p->graph->n_ops; i++) {
        if (p->winograd[i] != net_plan_winograd_tile(p, &p->graph->ops[i]))
            return false;
    }
    return true;
}

/* oneDNN chooses the tiles by the number of threads (smaller ones for many threads or small images, none for one
 * thread), and they round differently. For the same bytes everywhere, use the tiles of two threads, and the largest
 * number of threads that gives the same tiles. Everything else is planned for the threads that run it: a primitive
 * starts as many as it was planned for, even if fewer are set when it runs. */
static void choose_winograd(struct net_plan *p)
{
    int planned = sst_max_int(p->threads, 2);

    omp_set_num_threads(2);
    for (int i = 0; i < p->graph->n_ops; i++)
        p->winograd[i] = net_plan_winograd_tile(p, &p->graph->ops[i]);
    while (planned > 2 && !tiles_stay(p, planned))
        planned--;
    p->winograd_threads = planned;
    p->threads = sst_min_int(p->threads, planned);
    omp_set_num_threads(p->threads);
}

/* --- life ----------------------------------------------------------------------------------------- */

/* The tensor that is written to the caller's memory: not the one of a residual, which lies in the arena. */
static int add_output(struct net_plan *p)
{
    const_dnnl_memory_desc_t md;
    int to, from, err = net_plan_desc(p, &md, p->shapes[p->graph->output], dnnl_f32, dnnl_nchw);

    if (err)
        return err;
    from = net_plan_in_layout(p, p->graph->output, md, 1);
    if (from < 0 || p->tensors[from].place_of < 0)
        return from;
    to = net_plan_add_tensor(p, p->graph->output, md, 1);
    err = to < 0 ? to : net_plan_reorder(p, from, to);
    return err ? err : to;
}

static int add_ops(struct net_plan *p)
{
    const struct sst_graph *g = p->graph;
    const_dnnl_memory_desc_t md;
    int err = net_plan_desc(p, &md, p->shapes[g->input], dnnl_f32, dnnl_nchw);

    if (err)
        return err;
    for (int i = 0; i < g->n_ops; i++) {
        for (int k = 0; k < g->ops[i].n_in; k++)
            p->last_use[g->ops[i].in[k]] = i;
    }
    p->last_use[g->output] = g->n_ops;
    p->input = net_plan_add_tensor(p, g->input, md, 1);
    if (p->input < 0)
        return p->input;
    p->tensors[p->input].external = true;
    p->current[g->input] = p->input;
    net_plan_choose_bits(p);
    choose_winograd(p);
    for (int i = 0; !err && i < g->n_ops; i++)
        err = net_plan_add_op(p, i);
    if (err)
        return err;
    p->output = add_output(p);
    if (p->output < 0)
        return p->output;
    p->tensors[p->output].external = true;
    return 0;
}

static int build(struct net_plan *p, struct sst_shape *shapes, const struct net_plan_config *cfg)
{
    const size_t n = (size_t)p->graph->n_values;
    int err = sst_graph_shapes(p->graph, cfg->width, cfg->height, shapes, cfg->name);

    err = err ? err : net_dnnl_open(&p->dnnl);
    p->current = malloc(n * sizeof(*p->current));
    p->last_use = calloc(n, sizeof(*p->last_use));
    p->winograd = calloc((size_t)p->graph->n_ops, sizeof(*p->winograd));
    p->values = calloc(n, sizeof(*p->values));
    if (!p->values || !p->current || !p->last_use || !p->winograd)
        return -ENOMEM;
    memset(p->current, 0xff, n * sizeof(*p->current));
    err = err ? err : add_ops(p);
    if (err)
        return err;
    find_lifetimes(p);
    return allocate(p);
}

int net_plan_create(struct net_plan **out, const struct net_plan_config *cfg)
{
    const int before = omp_get_max_threads();
    struct net_plan *p = calloc(1, sizeof(*p));
    struct sst_shape *shapes = calloc((size_t)cfg->graph->n_values, sizeof(*shapes));
    int err = -ENOMEM;

    if (p && shapes) {
        *p = (struct net_plan){
            .graph = cfg->graph,
            .shapes = shapes,
            .threads = cfg->threads,
            .precision = cfg->precision,
            .name = cfg->name,
        };
        err = build(p, shapes, cfg);
        omp_set_num_threads(before);
        p->shapes = NULL;
    }
    free(shapes);
    if (!err) {
        if (*cfg->name)
            sst_log_info("model %s: %d steps, %zu MiB of activations, %zu MiB of scratch for an image of %d x %d",
                         cfg->name, p->n_steps, p->arena_bytes >> 20, p->scratch_bytes >> 20, cfg->width, cfg->height);
        *out = p;
        return 0;
    }
    if (err == -ENOMEM)
        sst_log_error("model %s: not enough memory for an image of %d x %d; use a smaller one", cfg->name, cfg->width,
                      cfg->height);
    else if (err != -EINVAL)
        sst_log_error("model %s: oneDNN cannot run one of its layers on an image of %d x %d; use another size or model",
                      cfg->name, cfg->width, cfg->height);
    net_plan_destroy(p);
    return err;
}

void net_plan_destroy(struct net_plan *plan)
{
    if (!plan)
        return;
    for (int i = 0; i < plan->n_steps; i++) {
        struct net_plan_step *s = &plan->steps[i];

        dnnl_primitive_destroy(s->primitive);
        dnnl_memory_destroy(s->weights);
        dnnl_memory_destroy(s->bias);
        dnnl_memory_destroy(s->scales);
        dnnl_memory_destroy(s->scratch);
        sst_mem_free(s->weights_data);
        free(s->bias_data);
        free(s->scales_data);
        free(s->taps);
        net_plan_tiles_destroy(s->tiles);
    }
    for (int i = 0; i < plan->n_tensors; i++)
        dnnl_memory_destroy(plan->tensors[i].memory);
    net_dnnl_close(&plan->dnnl);
    sst_mem_free(plan->arena);
    sst_mem_free(plan->scratch);
    free(plan->tensors);
    free(plan->steps);
    free(plan->current);
    free(plan->last_use);
    free(plan->winograd);
    free(plan->values);
    free(plan);
}

static int run_own(const struct net_plan *p, const struct net_plan_step *s)
{
    const struct net_tensor *src = &p->tensors[s->tensor[0]].view, *dst = &p->tensors[s->tensor[1]].view;

    if (s->tiles)
        return net_plan_tiles_run(s->tiles, src->data, dst->data, p->scratch, p->threads);
    switch (s->op->kind) {
    case SST_OP_ADAPTIVE_POOL:
        return op_adaptive_pool(dst, src, p->threads);
    case SST_OP_RESIZE:
        return op_resize(dst, src, s->taps, p->threads);
    case SST_OP_SOFTMAX:
        return op_softmax(dst, src, p->threads);
    default:
        return op_normalize(dst, src, s->op, p->threads);
    }
}

static int set_external(struct net_plan_tensor *t, float *data)
{
    t->view.data = data;
    return net_dnnl_errno(dnnl_memory_set_data_handle(t->memory, data));
}

static int run_steps(struct net_plan *p, int count)
{
    int err = 0;

    for (int i = 0; !err && i < count; i++) {
        const struct net_plan_step *s = &p->steps[i];

        if (s->serial)
            omp_set_num_threads(1);
        err = s->primitive ? net_dnnl_errno(dnnl_primitive_execute(s->primitive, p->dnnl.stream, s->n_args, s->args))
                           : run_own(p, s);
        if (s->serial)
            omp_set_num_threads(p->threads);
    }
    err = err ? err : net_dnnl_errno(dnnl_stream_wait(p->dnnl.stream));
    return err;
}

/* The first `count` steps, on the plan's threads. */
static int run(struct net_plan *p, const float *in, int count)
{
    const int before = omp_get_max_threads(), levels = omp_get_max_active_levels();
    int err = set_external(&p->tensors[p->input], (float *)(uintptr_t)in); /* only read */

    if (err)
        return err;
    omp_set_num_threads(p->threads);
    /* With one thread a Winograd primitive would still start the threads that it was planned for. */
    if (p->threads == 1)
        omp_set_max_active_levels(0);
    err = run_steps(p, count);
    omp_set_max_active_levels(levels);
    omp_set_num_threads(before);
    return err;
}

int net_plan_run(struct net_plan *plan, const float *in, float *out)
{
    const int err = set_external(&plan->tensors[plan->output], out);

    return err ? err : run(plan, in, plan->n_steps);
}

int net_plan_run_s8(struct net_plan *plan, const float *in, float factor, int8_t *out)
{
    const struct net_plan_step *last = &plan->steps[plan->n_steps - 1];
    const int err = run(plan, in, plan->n_steps - 1);

    return err ? err : op_normalize_s8(out, &plan->tensors[last->tensor[0]].view, last->op, factor, plan->threads);
}
