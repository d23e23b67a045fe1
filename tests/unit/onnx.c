/* Damaged and hostile network files: an error in one sentence, never a crash. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/method/network/graph.h"
#include "pipeline/method/network/onnx.h"
#include "tests/onnx_writer.h"
#include "tests/test.h"

/* Parse and build as the runner does, without running; the model is taken. */
static int read_model(const uint8_t *data, size_t size)
{
    struct sst_onnx model;
    struct sst_graph graph;
    char why[256] = "";
    int err = sst_onnx_parse(&model, data, size, "test");

    if (err)
        return err;
    err = sst_graph_build(&graph, &model, "test", why);
    if (!err)
        sst_graph_fini(&graph);
    else
        assert_true(err != -ENOTSUP || why[0]);
    sst_onnx_fini(&model);
    return err;
}

static int parse_model(struct ow_buf *graph)
{
    struct ow_buf model;
    int err;

    ow_value(graph, 12, "y", 2);
    model = ow_model(graph, 13);
    err = read_model(model.p, model.n);
    free(model.p);
    return err;
}

static const float weights[8] = { 1, 2, 3, 4, 5, 6, 7, 8 };

/* x (2 channels) -> 1x1 convolution -> relu -> y, with room for other constants */
static struct ow_buf good_graph(void)
{
    struct ow_buf graph = { 0 };

    ow_value(&graph, 11, "x", 2);
    ow_floats(&graph, "w", weights, 2, 2, 1, 1);
    ow_node(&graph, "Conv", "x w", "c", NULL);
    ow_node(&graph, "Relu", "c", "y", NULL);
    return graph;
}

static void a_good_model_is_read(void **state SST_UNUSED)
{
    struct ow_buf graph = good_graph();

    assert_int_equal(parse_model(&graph), 0);
}

static void truncated_files_are_refused(void **state SST_UNUSED)
{
    struct ow_buf graph = good_graph(), model;
    size_t accepted = 0;

    ow_value(&graph, 12, "y", 2);
    model = ow_model(&graph, 13);
    for (size_t n = 0; n < model.n; n++) {
        uint8_t *copy = malloc(n + 1); /* the sanitizers see a read behind the end */

        memcpy(copy, model.p, n);
        accepted += read_model(copy, n) == 0;
        free(copy);
    }
    assert_int_equal(accepted, 0);
    free(model.p);
}

/* Any one byte changed: accepted or refused, but no crash. */
static void flipped_bytes_do_no_harm(void **state SST_UNUSED)
{
    struct ow_buf graph = good_graph(), model;
    int refused = 0;

    ow_value(&graph, 12, "y", 2);
    model = ow_model(&graph, 13);
    for (size_t i = 0; i < model.n; i++) {
        static const uint8_t flips[] = { 0x01, 0x02, 0x04, 0x08, 0x10, 0x20, 0x40, 0x80, 0xff };

        for (size_t k = 0; k < ARRAY_LEN(flips); k++) {
            model.p[i] ^= flips[k];
            refused += read_model(model.p, model.n) < 0;
            model.p[i] ^= flips[k];
        }
    }
    assert_true(refused > 100);
    free(model.p);
}

/* A tensor from its raw parts. */
static void ow_tensor(struct ow_buf *graph, const char *name, const int64_t *dims, int n_dims, const void *data,
                      size_t bytes)
{
    struct ow_buf t = { 0 };

    for (int i = 0; i < n_dims; i++)
        ow_int(&t, 1, dims[i]);
    ow_int(&t, 2, 1);
    ow_str(&t, 8, name);
    ow_bytes(&t, 9, data, bytes);
    ow_take(graph, 5, &t);
}

static void impossible_tensors_are_refused(void **state SST_UNUSED)
{
    static const int64_t cases[][4] = {
        { 2, 2, 1, 2 },                               /* twice the stored size */
        { 1, 2, 1, 1 },                               /* half of it */
        { -2, -2, 1, 1 },                             /* negative, though the product fits */
        { INT64_C(1) << 62, 4, 1, 1 },                /* the product overflows */
        { INT64_C(1) << 32, INT64_C(1) << 32, 1, 1 }, /* the product overflows to 0 */
        { INT64_C(1) << 28, 2, 1, 1 },                /* over the limit */
    };
    const float bad[2][4] = { { 1, 2, NAN, 4 }, { 1, -INFINITY, 3, 4 } };
    const int64_t dims[9] = { 2, 2, 1, 1, 1, 1, 1, 1, 1 };
    struct ow_buf graph;

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        graph = good_graph();
        ow_tensor(&graph, "t", cases[i], 4, weights, 16);
        assert_int_equal(parse_model(&graph), -EBADMSG);
    }
    for (size_t i = 0; i < ARRAY_LEN(bad); i++) {
        graph = good_graph();
        ow_tensor(&graph, "t", dims, 4, bad[i], 16);
        assert_int_equal(parse_model(&graph), -EBADMSG);
    }
    graph = good_graph();
    ow_tensor(&graph, "t", dims, 9, weights, 16);
    assert_int_equal(parse_model(&graph), -EBADMSG);
}

static void data_in_other_files_are_refused(void **state SST_UNUSED)
{
    for (int form = 0; form < 2; form++) {
        struct ow_buf graph = good_graph(), t = { 0 }, entry = { 0 };

        ow_int(&t, 1, 4);
        ow_int(&t, 2, 1);
        ow_str(&t, 8, "t");
        if (form) {
            ow_str(&entry, 1, "location");
            ow_str(&entry, 2, "../../etc/passwd");
            ow_take(&t, 13, &entry);
        } else {
            ow_int(&t, 14, 1);
            ow_bytes(&t, 9, weights, 16);
        }
        ow_take(&graph, 5, &t);
        assert_int_equal(parse_model(&graph), -EBADMSG);
    }
}

static void names_cannot_write_on_the_terminal(void **state SST_UNUSED)
{
    struct ow_buf graph = good_graph();

    ow_floats(&graph, "\033[2J", weights, 4, 0, 0, 0);
    assert_int_equal(parse_model(&graph), -EBADMSG);
    graph = good_graph();
    ow_node(&graph, "Relu\n", "c", "z", NULL);
    assert_int_equal(parse_model(&graph), -EBADMSG);
}

static void contradictory_graphs_are_refused(void **state SST_UNUSED)
{
    static const struct {
        const char *op, *ins, *outs;
        int want;
    } cases[] = {
        { "Relu", "z", "z", -EBADMSG },     /* a cycle of one */
        { "Relu", "later", "z", -EBADMSG }, /* reads a tensor that is never made */
        { "Relu", "c", "y", -EBADMSG },     /* makes y again */
        { "Relu", "c", "w", -EBADMSG },     /* makes a tensor that is a constant */
        { "Relu", "c", "-", -EBADMSG },     /* makes nothing */
        { "Mystery", "c", "z", 0 },         /* unknown, but nobody reads it */
    };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        struct ow_buf graph = good_graph();

        ow_node(&graph, cases[i].op, cases[i].ins, cases[i].outs, NULL);
        assert_int_equal(parse_model(&graph), cases[i].want);
    }
}

/* x -> op with these attributes -> y */
static int try_layer(const char *op, const char *ins, struct ow_buf *attrs)
{
    struct ow_buf graph = { 0 };
    const float scales[] = { 1, 1, 1e30f, 2 }, negative[] = { -1, -1 };
    const int64_t sizes[] = { 1, 2, -5, INT64_MAX };

    ow_value(&graph, 11, "x", 2);
    ow_floats(&graph, "w", weights, 2, 2, 1, 1);
    ow_floats(&graph, "w3", weights, 2, 4, 1, 1);
    ow_floats(&graph, "scales", scales, 4, 0, 0, 0);
    ow_floats(&graph, "p", weights, 2, 0, 0, 0);
    ow_floats(&graph, "p3", weights, 3, 0, 0, 0);
    ow_floats(&graph, "negative", negative, 2, 0, 0, 0);
    ow_int64s(&graph, "sizes", sizes, 4);
    ow_node(&graph, "Conv", "x w", "c", NULL);
    ow_node(&graph, op, ins, "y", attrs);
    return parse_model(&graph);
}

static void layers_that_cannot_be_are_refused(void **state SST_UNUSED)
{
    struct ow_buf a = { 0 };

    assert_int_equal(try_layer("Conv", "x w3", NULL), -EBADMSG); /* four channels in for two */
    assert_int_equal(try_layer("Conv", "x w p3", NULL), -EBADMSG);
    assert_int_equal(try_layer("Conv", "x", NULL), -ENOTSUP);
    assert_int_equal(try_layer("Conv", "w w", NULL), -ENOTSUP);
    ow_attr_int(&a, "group", 0);
    assert_int_equal(try_layer("Conv", "x w", &a), -EBADMSG);
    ow_attr_int(&a, "group", -1);
    assert_int_equal(try_layer("Conv", "x w", &a), -EBADMSG);
    ow_attr_ints(&a, "strides", 2, 0, 1);
    assert_int_equal(try_layer("Conv", "x w", &a), -EBADMSG);
    ow_attr_ints(&a, "pads", 4, -1, 0, 0, 0);
    assert_int_equal(try_layer("Conv", "x w", &a), -EBADMSG);
    ow_attr_ints(&a, "pads", 3, 1, 0, 0);
    assert_int_equal(try_layer("Conv", "x w", &a), -EBADMSG);
    ow_attr_ints(&a, "dilations", 2, 0x7fffffff, 1);
    assert_int_equal(try_layer("Conv", "x w", &a), -EBADMSG);
    ow_attr_ints(&a, "kernel_shape", 2, 1, 3);
    assert_int_equal(try_layer("Conv", "x w", &a), -EBADMSG);
    ow_attr_ints(&a, "kernel_shape", 2, 2, 2);
    ow_attr_ints(&a, "pads", 4, 2, 0, 0, 0);
    assert_int_equal(try_layer("MaxPool", "x", &a), -EBADMSG);
    assert_int_equal(try_layer("MaxPool", "x", NULL), -EBADMSG);
    assert_int_equal(try_layer("BatchNormalization", "c p p p negative", NULL), -EBADMSG);
    assert_int_equal(try_layer("BatchNormalization", "c p p p p3", NULL), -EBADMSG);
    assert_int_equal(try_layer("BatchNormalization", "c p p p p", NULL), 0);
    ow_attr_str(&a, "mode", "linear");
    assert_int_equal(try_layer("Resize", "x - scales", &a), -EBADMSG);
    ow_attr_str(&a, "mode", "linear");
    assert_int_equal(try_layer("Resize", "x - - sizes", &a), -EBADMSG);
    ow_attr_str(&a, "mode", "cubic");
    assert_int_equal(try_layer("Resize", "x - scales", &a), -ENOTSUP);
    ow_attr_ints(&a, "output_size", 2, 0, -1);
    assert_int_equal(try_layer("sst.AdaptiveAveragePool", "x", &a), -EBADMSG);
    assert_int_equal(try_layer("sst.AdaptiveAveragePool", "x", NULL), -EBADMSG);
    assert_int_equal(try_layer("sst.ResizeLike", "x", NULL), -EBADMSG);
    assert_int_equal(try_layer("AdaptiveAveragePool", "x", NULL), -ENOTSUP); /* not of the standard domain */
    assert_int_equal(try_layer("Mystery", "x", NULL), -ENOTSUP);
    assert_int_equal(try_layer("Add", "x w", NULL), -ENOTSUP);
    ow_attr_int(&a, "axis", 2);
    assert_int_equal(try_layer("Concat", "x x", &a), -ENOTSUP);
}

static void too_many_nodes_are_refused(void **state SST_UNUSED)
{
    struct ow_buf graph = good_graph();

    for (int i = 0; i < SST_ONNX_MAX_NODES; i++) {
        char out[16];

        snprintf(out, sizeof(out), "v%d", i);
        ow_node(&graph, "Relu", "c", out, NULL);
    }
    assert_int_equal(parse_model(&graph), -EBADMSG);
}

/* A chain of enlargements by 100: the file is small, the sizes are not. */
static void sizes_that_explode_are_refused(void **state SST_UNUSED)
{
    const float scales[] = { 1, 1, 100, 100 };
    struct ow_buf graph = { 0 }, a = { 0 }, model;
    struct sst_shape shapes[64];
    struct sst_onnx onnx;
    struct sst_graph g;
    char why[256];

    ow_value(&graph, 11, "x", 2);
    ow_floats(&graph, "scales", scales, 4, 0, 0, 0);
    for (int i = 0; i < 20; i++) {
        char in[32], out[16];

        snprintf(in, sizeof(in), i ? "v%d - scales" : "x - scales", i);
        snprintf(out, sizeof(out), i < 19 ? "v%d" : "y", i + 1);
        ow_attr_str(&a, "mode", "linear");
        ow_node(&graph, "Resize", in, out, &a);
    }
    ow_value(&graph, 12, "y", 2);
    model = ow_model(&graph, 13);
    assert_int_equal(sst_onnx_parse(&onnx, model.p, model.n, "test"), 0);
    assert_int_equal(sst_graph_build(&g, &onnx, "test", why), 0);
    assert_true(g.n_values <= 64);
    assert_int_equal(sst_graph_shapes(&g, 4, 4, shapes, "test"), -EINVAL);
    sst_graph_fini(&g);
    sst_onnx_fini(&onnx);
    free(model.p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_good_model_is_read),
        cmocka_unit_test(truncated_files_are_refused),
        cmocka_unit_test(flipped_bytes_do_no_harm),
        cmocka_unit_test(impossible_tensors_are_refused),
        cmocka_unit_test(data_in_other_files_are_refused),
        cmocka_unit_test(names_cannot_write_on_the_terminal),
        cmocka_unit_test(contradictory_graphs_are_refused),
        cmocka_unit_test(layers_that_cannot_be_are_refused),
        cmocka_unit_test(too_many_nodes_are_refused),
        cmocka_unit_test(sizes_that_explode_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
