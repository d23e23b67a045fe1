/* Fuzz target: the reader of ONNX files, the graph, the shapes, and the plan with a run where the network is small
 * enough. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>

#include "pipeline/method/network/graph.h"
#include "pipeline/method/network/network_internal.h"
#include "pipeline/method/network/onnx.h"
#include "tests/fuzz/seeds.h"
#include "tests/onnx_writer.h"

#define WIDTH  40
#define HEIGHT 24

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Multiplications and samples of a run; the fuzzer wants many short ones. */
static double work(const struct sst_graph *g, const struct sst_shape *shapes)
{
    double sum = 0;

    for (int i = 0; i < g->n_ops; i++) {
        const struct sst_op *op = &g->ops[i];
        const struct sst_shape *s = &shapes[op->out];
        const double window = op->kernel[0] ? (double)op->kernel[0] * op->kernel[1] : 1;

        sum += (double)s->c * s->h * s->w * window * sst_max_int(op->group_in, 1);
    }
    return sum;
}

static void run(const struct sst_graph *g, const struct sst_shape *shapes)
{
    const struct net_plan_config cfg = { g, "fuzz", WIDTH, HEIGHT, 1, SST_PRECISION_F32 };
    const struct sst_shape *out = &shapes[g->output];
    float *x = calloc((size_t)g->in_channels * WIDTH * HEIGHT, sizeof(*x));
    float *y = calloc((size_t)out->c * (size_t)out->h * (size_t)out->w, sizeof(*y));
    struct net_plan *plan = NULL;

    for (int i = 0; x && i < g->in_channels * WIDTH * HEIGHT; i++)
        x[i] = (float)(i % 7) - 3;
    if (x && y && !net_plan_create(&plan, &cfg) && net_plan_run(plan, x, y))
        abort();
    net_plan_destroy(plan);
    free(x);
    free(y);
}

static void build(const struct sst_onnx *model)
{
    struct sst_shape *shapes;
    struct sst_graph graph;
    char why[256];

    if (sst_graph_build(&graph, model, "fuzz", why))
        return;
    shapes = calloc((size_t)graph.n_values, sizeof(*shapes));
    if (shapes && !sst_graph_shapes(&graph, WIDTH, HEIGHT, shapes, "fuzz")) {
        if (shapes[graph.output].c != graph.out_channels)
            abort();
        if (work(&graph, shapes) < 1e7)
            run(&graph, shapes);
    }
    free(shapes);
    sst_graph_fini(&graph);
}

/* --- seeds: together they hold every operator ------------------------------------------------------------------- */

static const float numbers[4 * 4 * 3 * 3] = { 0.5f, -1, 0.25f, 2, 1, 1, 1, 1, 0.1f };

static struct ow_buf residual_net(void)
{
    const float scales[] = { 1, 1, 2, 2 };
    struct ow_buf g = { 0 }, attrs = { 0 };

    ow_value(&g, 11, "x", 3);
    ow_value(&g, 12, "y", 8);
    ow_floats(&g, "w0", numbers, 4, 3, 3, 3);
    ow_floats(&g, "w1", numbers, 4, 4, 3, 3);
    ow_floats(&g, "b", numbers + 4, 4, 0, 0, 0);
    ow_floats(&g, "scales", scales, 4, 0, 0, 0);
    ow_attr_ints(&attrs, "pads", 4, 1, 1, 1, 1);
    ow_attr_ints(&attrs, "strides", 2, 2, 2);
    ow_node(&g, "Conv", "x w0 b", "c0", &attrs);
    ow_node(&g, "BatchNormalization", "c0 b b b b", "n", NULL);
    ow_node(&g, "Relu", "n", "r", NULL);
    ow_attr_ints(&attrs, "pads", 4, 2, 2, 2, 2);
    ow_attr_ints(&attrs, "dilations", 2, 2, 2);
    ow_node(&g, "Conv", "r w1", "c1", &attrs);
    ow_node(&g, "Add", "c1 r", "a", NULL);
    ow_attr_ints(&attrs, "kernel_shape", 2, 2, 2);
    ow_attr_ints(&attrs, "strides", 2, 2, 2);
    ow_attr_int(&attrs, "ceil_mode", 1);
    ow_node(&g, "MaxPool", "a", "m", &attrs);
    ow_attr_str(&attrs, "mode", "linear");
    ow_node(&g, "Resize", "m - scales", "u", &attrs);
    ow_attr_int(&attrs, "axis", 1);
    ow_node(&g, "Concat", "a u", "j", &attrs);
    ow_attr_int(&attrs, "axis", 1);
    ow_node(&g, "Softmax", "j", "y", &attrs);
    return ow_model(&g, 13);
}

static struct ow_buf pyramid_net(void)
{
    const int64_t pads[] = { 0, 0, 1, 1, 0, 0, 1, 1 }, sizes[] = { 1, 4, 24, 40 };
    struct ow_buf g = { 0 }, attrs = { 0 };

    ow_value(&g, 11, "x", 4);
    ow_value(&g, 12, "y", 4);
    ow_floats(&g, "w", numbers, 4, 1, 3, 3);
    ow_int64s(&g, "pads", pads, 8);
    ow_int64s(&g, "sizes", sizes, 4);
    ow_node(&g, "Pad", "x pads", "p", NULL);
    ow_attr_int(&attrs, "group", 4);
    ow_node(&g, "Conv", "p w", "c", &attrs);
    ow_attr_ints(&attrs, "output_size", 2, 2, 3);
    ow_node(&g, "sst.AdaptiveAveragePool", "c", "a", &attrs);
    ow_node(&g, "sst.ResizeLike", "a c", "b", NULL);
    ow_node(&g, "GlobalAveragePool", "c", "g", NULL);
    ow_attr_str(&attrs, "mode", "linear");
    ow_node(&g, "Resize", "g - - sizes", "u", &attrs);
    ow_node(&g, "Add", "b u", "s", NULL);
    ow_attr_ints(&attrs, "kernel_shape", 2, 3, 3);
    ow_attr_ints(&attrs, "pads", 4, 1, 1, 1, 1);
    ow_node(&g, "AveragePool", "s", "v", &attrs);
    ow_attr_int(&attrs, "axis", 1);
    ow_node(&g, "LpNormalization", "v", "y", &attrs);
    return ow_model(&g, 13);
}

static struct ow_buf norm_net(void)
{
    const float two = 2, small = 1e-6f;
    struct ow_buf g = { 0 }, attrs = { 0 };

    ow_value(&g, 11, "x", 4);
    ow_value(&g, 12, "y", 4);
    ow_floats(&g, "w", numbers, 4, 4, 1, 1);
    ow_floats(&g, "two", &two, 1, 0, 0, 0);
    ow_floats(&g, "small", &small, 1, 0, 0, 0);
    ow_node(&g, "Conv", "x w", "c", NULL);
    ow_node(&g, "Pow", "c two", "q", NULL);
    ow_attr_ints(&attrs, "axes", 1, 1);
    ow_node(&g, "ReduceSum", "q", "s", &attrs);
    ow_node(&g, "Sqrt", "s", "l", NULL);
    ow_node(&g, "Clip", "l small", "m", NULL);
    ow_node(&g, "Div", "c m", "y", NULL);
    return ow_model(&g, 11);
}

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    struct ow_buf seeds[] = { residual_net(), pyramid_net(), norm_net() };

    for (int i = 0; i < (int)ARRAY_LEN(seeds); i++) {
        seed_write("onnx", i, seeds[i].p, seeds[i].n);
        free(seeds[i].p);
    }
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sst_summary summary;
    struct sst_onnx model;

    if (!sst_onnx_parse(&model, data, size, "fuzz")) {
        sst_onnx_summary(&summary, &model);
        build(&model);
        sst_onnx_fini(&model);
    }
    return 0;
}
