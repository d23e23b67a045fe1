/* Time of a network: the whole of it as the program runs it (a matching network: from the picture to the features, band
 * by band), beside its convolutions alone as bare oneDNN primitives in the layouts that the library likes best.
 * Interleaved rounds in one process, medians of wall and CPU time, one JSON object.
 *
 *   network MODEL.onnx WxH ROUNDS */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/mem.h"
#include "base/stats.h"
#include "pipeline/method/disparity/stage.h"
#include "pipeline/method/network/compat_dnnl.h"
#include "pipeline/method/network/graph.h"
#include "pipeline/method/network/network.h"

extern void omp_set_num_threads(int n);

#define MAX_ROUNDS 101

/* A convolution with memory of its own; scales are 1, for only the time counts. */
struct bare {
    dnnl_primitive_t primitive;
    dnnl_memory_t src, weights, bias, dst;
};

struct bare_network {
    struct net_dnnl dnnl;
    struct bare *convs;
    int n_convs;
};

/* How a convolution is computed. */
struct form {
    dnnl_alg_kind_t algorithm;
    bool int8;
};

struct kind {
    bool whole;
    enum sst_precision precision;
    int threads;
};

static const struct kind kinds[] = {
    { false, SST_PRECISION_F32, 1 },  { true, SST_PRECISION_F32, 1 },   { false, SST_PRECISION_F32, 2 },
    { true, SST_PRECISION_F32, 2 },   { false, SST_PRECISION_INT8, 1 }, { true, SST_PRECISION_INT8, 1 },
    { false, SST_PRECISION_INT8, 2 }, { true, SST_PRECISION_INT8, 2 },
};

struct runner {
    struct bare_network bare;
    struct sst_network *net;
    struct sst_image picture; /* of a matching network, else empty */
    float *in, *out;
    int width, height;
    double ms[MAX_ROUNDS], cpu_ms[MAX_ROUNDS];
};

static void check(dnnl_status_t status, const char *what)
{
    if (status) {
        fprintf(stderr, "network: oneDNN: %s failed (%d)\n", what, (int)status);
        exit(1);
    }
}

static dnnl_memory_t memory_of(const struct net_dnnl *d, const_dnnl_primitive_desc_t pd, dnnl_query_t what, int index)
{
    const_dnnl_memory_desc_t md = dnnl_primitive_desc_query_md(pd, what, index);
    dnnl_memory_t m;
    float *data;

    check(dnnl_memory_create(&m, md, d->engine, DNNL_MEMORY_ALLOCATE), "memory");
    check(dnnl_memory_get_data_handle(m, (void **)&data), "memory");
    memset(data, 0, dnnl_memory_desc_get_size(md));
    return m;
}

static const_dnnl_memory_desc_t layout(struct net_dnnl *d, const struct net_dnnl_shape *shape)
{
    const_dnnl_memory_desc_t md;

    if (net_dnnl_layout(d, &md, shape)) {
        fputs("network: oneDNN: a layout failed\n", stderr);
        exit(1);
    }
    return md;
}

static int describe(struct net_dnnl *d, dnnl_primitive_desc_t *pd, const struct sst_op *op,
                    const struct sst_shape *shapes, const struct form *form)
{
    const struct sst_shape in = shapes[op->in[0]], out = shapes[op->out];
    const int g = op->group;
    const bool int8 = form->int8;
    const dnnl_data_type_t src = !int8 ? dnnl_f32 : in.c < 4 ? dnnl_s8 : dnnl_u8, weights = int8 ? dnnl_s8 : dnnl_f32;
    const dnnl_data_type_t dst = !int8 ? dnnl_f32 : op->relu ? dnnl_u8 : dnnl_s8;
    const dnnl_format_tag_t any = dnnl_format_tag_any;
    const struct net_dnnl_shape w4 = { 4, { out.c, in.c, op->kernel[0], op->kernel[1] }, weights, any };
    const struct net_dnnl_shape w5 = { 5, { g, out.c / g, in.c / g, op->kernel[0], op->kernel[1] }, weights, any };
    const struct net_dnnl_layer layer = {
        .algorithm = form->algorithm,
        .src = layout(d, &(struct net_dnnl_shape){ 4, { 1, in.c, in.h, in.w }, src, any }),
        .weights = layout(d, g > 1 ? &w5 : &w4),
        .bias = layout(d, &(struct net_dnnl_shape){ 1, { out.c }, dnnl_f32, dnnl_x }),
        .dst = layout(d, &(struct net_dnnl_shape){ 4, { 1, out.c, out.h, out.w }, dst, any }),
        .stride = { op->stride[0], op->stride[1] },
        .dilation = { op->dilation[0] - 1, op->dilation[1] - 1 },
        .before = { op->pad_before[0], op->pad_before[1] },
        .after = { op->pad_after[0], op->pad_after[1] },
    };
    dnnl_primitive_attr_t attr;
    dnnl_post_ops_t post;
    int err = 0;

    check(dnnl_primitive_attr_create(&attr), "attributes");
    check(dnnl_post_ops_create(&post), "attributes");
    if (op->residual)
        err = net_dnnl_append_sum(post, 1.0f, dnnl_data_type_undef);
    if (!err && op->relu)
        err = net_dnnl_append_relu(post);
    check(dnnl_primitive_attr_set_post_ops(attr, post), "attributes");
    err = err ? err : net_dnnl_conv(d, pd, &layer, attr);
    dnnl_post_ops_destroy(post);
    dnnl_primitive_attr_destroy(attr);
    return err;
}

static void make_bare(struct bare *b, struct net_dnnl *d, const struct sst_op *op, const struct sst_shape *shapes,
                      bool int8)
{
    dnnl_primitive_desc_t pd;

    if ((int8 || describe(d, &pd, op, shapes, &(struct form){ dnnl_convolution_winograd, false })) &&
        describe(d, &pd, op, shapes, &(struct form){ dnnl_convolution_auto, int8 })) {
        fputs("network: oneDNN: a convolution failed\n", stderr);
        exit(1);
    }
    check(dnnl_primitive_create(&b->primitive, pd), "primitive");
    b->src = memory_of(d, pd, dnnl_query_src_md, 0);
    b->weights = memory_of(d, pd, dnnl_query_weights_md, 0);
    b->bias = memory_of(d, pd, dnnl_query_weights_md, 1);
    b->dst = memory_of(d, pd, dnnl_query_dst_md, 0);
    dnnl_primitive_desc_destroy(pd);
}

static void make_network(struct bare_network *b, const struct sst_graph *graph, const struct sst_shape *shapes,
                         const struct kind *kind)
{
    omp_set_num_threads(kind->threads);
    if (net_dnnl_open(&b->dnnl)) {
        fputs("network: oneDNN cannot be opened\n", stderr);
        exit(1);
    }
    b->convs = calloc((size_t)graph->n_ops, sizeof(*b->convs));
    if (!b->convs)
        exit(1);
    for (int i = 0; i < graph->n_ops; i++) {
        if (graph->ops[i].kind == SST_OP_CONV)
            make_bare(&b->convs[b->n_convs++], &b->dnnl, &graph->ops[i], shapes, kind->precision == SST_PRECISION_INT8);
    }
}

static void run_bare(const struct bare_network *b, int threads)
{
    omp_set_num_threads(threads);
    for (int i = 0; i < b->n_convs; i++) {
        const struct bare *c = &b->convs[i];
        const dnnl_exec_arg_t args[] = { { DNNL_ARG_SRC, c->src },
                                         { DNNL_ARG_WEIGHTS, c->weights },
                                         { DNNL_ARG_BIAS, c->bias },
                                         { DNNL_ARG_DST, c->dst } };

        check(dnnl_primitive_execute(c->primitive, b->dnnl.stream, (int)ARRAY_LEN(args), args), "convolution");
    }
    check(dnnl_stream_wait(b->dnnl.stream), "convolution");
}

/* A picture of noise, from 0 to 255. */
static int make_picture(struct sst_image *img, int width, int height)
{
    const int err = sst_image_init(img, width, height);

    for (int c = 0; !err && c < 3; c++) {
        for (int y = 0; y < height; y++) {
            for (int x = 0; x < width; x++)
                sst_image_row(img, c, y)[x] = (uint8_t)((uint32_t)(y * width + x) * 2654435761u >> 20);
        }
    }
    return err;
}

static int make_tensors(struct runner *r, struct sst_shape in, struct sst_shape out)
{
    const size_t n = (size_t)in.c * (size_t)in.h * (size_t)in.w;

    r->in = sst_mem_alloc_raw(n, sizeof(*r->in));
    r->out = sst_mem_alloc_raw((size_t)out.c * (size_t)out.h, (size_t)out.w * sizeof(*r->out));
    if (!r->in || !r->out)
        return -1;
    for (size_t i = 0; i < n; i++)
        r->in[i] = (float)(i * 2654435761u % 65536) / 16384 - 2;
    return 0;
}

static int open_runner(struct runner *r, const char *model, const struct kind *kind, const struct sst_graph *graph,
                       const struct sst_shape *shapes)
{
    const struct sst_shape in = shapes[graph->input], out = shapes[graph->output];
    int err;

    r->width = in.w;
    r->height = in.h;
    if (!kind->whole) {
        make_network(&r->bare, graph, shapes, kind);
        return 0;
    }
    err = sst_network_open(&r->net, model, kind->precision, kind->threads);
    if (err)
        return err;
    return sst_network_metadata(r->net, "sst.radius") ? make_picture(&r->picture, in.w, in.h)
                                                      : make_tensors(r, in, out);
}

static int run_whole(struct runner *r)
{
    struct sst_descriptor desc;
    int err;

    if (!r->picture.width)
        return sst_network_run(r->net, r->in, r->width, r->height, r->out);
    err = sst_descriptor_init(&desc, &r->picture, 1, SST_COST_MCCNN, r->net);
    if (!err)
        sst_descriptor_fini(&desc);
    return err;
}

static int time_once(struct runner *r, const struct kind *kind, double *ms, double *cpu_ms)
{
    const int64_t start = sst_clock_now_ns(), start_cpu = sst_clock_cpu_ns();
    int err = 0;

    if (kind->whole)
        err = run_whole(r);
    else
        run_bare(&r->bare, kind->threads);
    *ms = (double)(sst_clock_now_ns() - start) * 1e-6;
    *cpu_ms = (double)(sst_clock_cpu_ns() - start_cpu) * 1e-6;
    return err;
}

static double median(double *v, int n)
{
    sst_stats_sort_double(v, n);
    return (v[(n - 1) / 2] + v[n / 2]) / 2;
}

static void print(const char *model, struct runner *runners, int rounds)
{
    printf("{\"model\": \"%s\", \"width\": %d, \"height\": %d, \"rounds\": %d, \"times\": [", model, runners[0].width,
           runners[0].height, rounds);
    for (size_t k = 0; k < ARRAY_LEN(kinds); k++) {
        const double ms = median(runners[k].ms, rounds), cpu_ms = median(runners[k].cpu_ms, rounds);

        printf("%s\n  {\"what\": \"%s\", \"precision\": \"%s\", \"threads\": %d, \"ms\": %.2f, \"min_ms\": %.2f,"
               " \"max_ms\": %.2f, \"cpu_ms\": %.2f}",
               k ? "," : "", kinds[k].whole ? "network" : "convolutions",
               kinds[k].precision == SST_PRECISION_INT8 ? "int8" : "f32", kinds[k].threads, ms, runners[k].ms[0],
               runners[k].ms[rounds - 1], cpu_ms);
    }
    puts("]}");
}

static int load_graph(struct sst_graph *graph, struct sst_shape **shapes, const char *model, int width, int height)
{
    struct sst_onnx onnx;
    uint8_t *data;
    size_t size;
    char why[256] = "";
    int err = sst_file_read(model, SST_ONNX_MAX_BYTES, &data, &size);

    if (!err)
        err = sst_onnx_parse(&onnx, data, size, model);
    if (!err)
        err = sst_graph_build(graph, &onnx, model, why);
    if (*why)
        fprintf(stderr, "network: %s: %s is not supported on oneDNN\n", model, why);
    if (!err)
        *shapes = calloc((size_t)graph->n_values, sizeof(**shapes));
    return err ? err : sst_graph_shapes(graph, width, height, *shapes, model);
}

int main(int argc, char **argv)
{
    const int rounds = argc == 4 ? atoi(argv[3]) : 0;
    struct runner runners[ARRAY_LEN(kinds)] = { 0 };
    struct sst_shape *shapes;
    struct sst_graph graph;
    int width, height, err;
    double unused;

    if (argc != 4 || sscanf(argv[2], "%dx%d", &width, &height) != 2 || rounds < 1 || rounds > MAX_ROUNDS) {
        fprintf(stderr, "usage: network MODEL.onnx WxH ROUNDS (1..%d)\n", MAX_ROUNDS);
        return 2;
    }
    err = load_graph(&graph, &shapes, argv[1], width, height);
    for (size_t k = 0; !err && k < ARRAY_LEN(kinds); k++) {
        err = open_runner(&runners[k], argv[1], &kinds[k], &graph, shapes);
        if (!err)
            err = time_once(&runners[k], &kinds[k], &unused, &unused); /* to warm up */
    }
    for (int i = 0; !err && i < rounds; i++) {
        for (size_t k = 0; !err && k < ARRAY_LEN(kinds); k++)
            err = time_once(&runners[k], &kinds[k], &runners[k].ms[i], &runners[k].cpu_ms[i]);
    }
    if (!err)
        print(sst_path_base(argv[1]), runners, rounds);
    return err ? 1 : 0;
}
