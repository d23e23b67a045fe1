/* Convolutions of the network runner against plain loops: paddings, groups, residual blocks, threads. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/network_bench.h"

static void convolutions_equal_plain_loops(void **state SST_UNUSED)
{
    static const struct conv cases[] = {
        { 1, 64, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 },
        { 64, 64, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 },
        { 3, 5, { 7, 7 }, { 2, 2 }, { 1, 1 }, { 3, 3, 3, 3 }, 1 },
        { 16, 24, { 3, 3 }, { 1, 1 }, { 2, 2 }, { 2, 2, 2, 2 }, 1 },
        { 12, 12, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 0, 1, 2, 1 }, 12 },
        { 8, 6, { 1, 3 }, { 2, 1 }, { 1, 3 }, { 0, 3, 0, 3 }, 2 },
        { 20, 11, { 1, 1 }, { 1, 1 }, { 1, 1 }, { 0, 0, 0, 0 }, 1 },
        { 48, 33, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 },
    };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        const struct conv *c = &cases[i];
        float *w = random_floats(c->oc * c->ic / c->group * c->kernel[0] * c->kernel[1]), *bias = random_floats(c->oc);
        struct image in = random_image(c->ic, 23, 31), want = ref_conv(&in, c, w, bias), got;
        struct ow_buf graph = { 0 };

        ow_floats(&graph, "w", w, c->oc, c->ic / c->group, c->kernel[0], c->kernel[1]);
        ow_floats(&graph, "b", bias, c->oc, 0, 0, 0);
        ow_conv(&graph, c, "x w b", "y");
        got = run_graph(&graph, &in, c->oc, 11);
        expect_image(&got, &want, 2e-5);
        free(w), free(bias), free(in.d), free(want.d), free(got.d);
    }
}

/* Sizes at which oneDNN would choose another algorithm for 1 thread than for 2, and for 16 than for 2. */
static void convolutions_do_not_depend_on_threads(void **state SST_UNUSED)
{
    static const struct {
        struct conv c;
        int size[2];
    } cases[] = {
        { { 64, 64, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 }, { 72, 96 } },
        { { 64, 64, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 }, { 240, 320 } },
        { { 128, 128, { 3, 3 }, { 1, 1 }, { 4, 4 }, { 4, 4, 4, 4 }, 1 }, { 47, 63 } }, /* of the small PSPNet */
        { { 6, 9, { 3, 3 }, { 1, 1 }, { 9, 9 }, { 9, 9, 9, 9 }, 1 }, { 21, 23 } },
    };
    static const int threads[] = { 2, 1, 3, 16 };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        const struct conv *c = &cases[i].c;
        float *w = random_floats(c->oc * c->ic * 9);
        struct image in = random_image(c->ic, cases[i].size[0], cases[i].size[1]), out[ARRAY_LEN(threads)];
        struct ow_buf graph = { 0 }, model;

        ow_floats(&graph, "w", w, c->oc, c->ic, 3, 3);
        ow_conv(&graph, c, "x w", "y");
        ow_value(&graph, 11, "x", c->ic);
        ow_value(&graph, 12, "y", c->oc);
        model = ow_model(&graph, 11);
        for (size_t k = 0; k < ARRAY_LEN(threads); k++) {
            struct ow_buf copy = { 0 };
            struct sst_network *net;

            ow_raw(&copy, model.p, model.n);
            assert_int_equal(open_model(&net, &copy, threads[k]), 0);
            out[k] = run_net(net, &in);
            sst_network_close(net);
            assert_memory_equal(out[k].d, out[0].d, (size_t)(c->oc * in.h * in.w) * sizeof(float));
        }
        for (size_t k = 0; k < ARRAY_LEN(threads); k++)
            free(out[k].d);
        free(w), free(in.d), free(model.p);
    }
}

/* The residual block of a ResNet with a strided shortcut: y = relu(bn(conv(x)) + bn(conv1x1(x))), and then
 * z = relu(y + conv(y)), where the shortcut is y itself. */
static void residual_blocks_equal_plain_loops(void **state SST_UNUSED)
{
    const struct conv c1 = { 16, 32, { 3, 3 }, { 2, 2 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    const struct conv c2 = { 16, 32, { 1, 1 }, { 2, 2 }, { 1, 1 }, { 0, 0, 0, 0 }, 1 };
    const struct conv c3 = { 32, 32, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    float *w1 = random_floats(32 * 16 * 9), *w2 = random_floats(32 * 16), *w3 = random_floats(32 * 32 * 9);
    float *bn[4];
    struct image in = random_image(16, 18, 22), a = ref_conv(&in, &c1, w1, NULL), b = ref_conv(&in, &c2, w2, NULL), d,
                 got;
    struct ow_buf graph = { 0 }, attrs = { 0 };

    for (int i = 0; i < 4; i++) {
        static const char *const names[] = { "scale", "shift", "mean", "variance" };

        bn[i] = random_floats(32);
        for (int c = 0; i == 3 && c < 32; c++)
            bn[i][c] = fabsf(bn[i][c]) + 0.1f;
        ow_floats(&graph, names[i], bn[i], 32, 0, 0, 0);
    }
    for (int c = 0; c < 32; c++) {
        for (int p = 0; p < a.h * a.w; p++) {
            float *v = at(&a, c, 0, p), *u = at(&b, c, 0, p);
            const double s = (double)bn[0][c] / sqrt((double)bn[3][c] + 1e-3);

            *v = (float)(((double)*v - (double)bn[2][c]) * s + (double)bn[1][c] + ((double)*u - (double)bn[2][c]) * s +
                         (double)bn[1][c]);
            *v = *v > 0 ? *v : 0;
        }
    }
    d = ref_conv(&a, &c3, w3, NULL);
    for (int i = 0; i < d.c * d.h * d.w; i++)
        d.d[i] = d.d[i] + a.d[i] > 0 ? d.d[i] + a.d[i] : 0;

    ow_floats(&graph, "w1", w1, 32, 16, 3, 3);
    ow_floats(&graph, "w2", w2, 32, 16, 1, 1);
    ow_floats(&graph, "w3", w3, 32, 32, 3, 3);
    ow_conv(&graph, &c1, "x w1", "a");
    ow_attr_float(&attrs, "epsilon", 1e-3f);
    ow_node(&graph, "BatchNormalization", "a scale shift mean variance", "an", &attrs);
    ow_conv(&graph, &c2, "x w2", "b");
    ow_attr_float(&attrs, "epsilon", 1e-3f);
    ow_node(&graph, "BatchNormalization", "b scale shift mean variance", "bn", &attrs);
    ow_node(&graph, "Add", "an bn", "s", NULL);
    ow_node(&graph, "Relu", "s", "r", NULL);
    ow_conv(&graph, &c3, "r w3", "c");
    ow_node(&graph, "Add", "c r", "t", NULL);
    ow_node(&graph, "Relu", "t", "y", NULL);
    got = run_graph(&graph, &in, 32, 11);
    expect_image(&got, &d, 1e-4);
    for (int i = 0; i < 4; i++)
        free(bn[i]);
    free(w1), free(w2), free(w3), free(in.d), free(a.d), free(b.d), free(d.d), free(got.d);
}

/* A sum that is the result, of layers whose result is planes, as the caller's memory is: of groups, or far apart. */
static void sums_at_the_end_equal_plain_loops(void **state SST_UNUSED)
{
    static const struct conv convs[] = {
        { 24, 33, { 3, 5 }, { 1, 1 }, { 1, 1 }, { 1, 2, 1, 2 }, 1 },
        { 6, 9, { 3, 3 }, { 1, 1 }, { 9, 9 }, { 9, 9, 9, 9 }, 1 },
        { 6, 9, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 3 },
    };

    for (size_t i = 0; i < ARRAY_LEN(convs); i++) {
        const struct conv *c = &convs[i], shortcut = { c->ic, c->oc, { 1, 1 }, { 1, 1 }, { 1, 1 }, { 0, 0, 0, 0 }, 1 };
        const int per = c->ic / c->group;
        float *w = random_floats(c->oc * per * 15), *v = random_floats(c->oc * c->ic);
        struct image in = random_image(c->ic, 21, 23), want = ref_conv(&in, c, w, NULL), got;
        struct image beside = ref_conv(&in, &shortcut, v, NULL);
        struct ow_buf graph = { 0 }, model;
        struct sst_network *net;

        for (int k = 0; k < want.c * want.h * want.w; k++)
            want.d[k] += beside.d[k];
        ow_floats(&graph, "w", w, c->oc, per, c->kernel[0], c->kernel[1]);
        ow_floats(&graph, "v", v, c->oc, c->ic, 1, 1);
        ow_conv(&graph, &shortcut, "x v", "b");
        ow_conv(&graph, c, "x w", "c");
        ow_node(&graph, "Add", "c b", "y", NULL);
        ow_value(&graph, 11, "x", c->ic);
        ow_value(&graph, 12, "y", c->oc);
        model = ow_model(&graph, 11);
        assert_int_equal(open_model(&net, &model, 1), 0);
        got = run_net(net, &in);
        expect_image(&got, &want, 1e-4);
        sst_network_close(net);
        free(w), free(v), free(in.d), free(want.d), free(beside.d), free(got.d);
    }
}

/* Values that several layers read must not be fused or written over: y = relu(c) + c + x, c = conv(x). */
static void shared_values_are_kept(void **state SST_UNUSED)
{
    struct image in = random_image(16, 9, 7), want = new_image(16, 9, 7), got;
    struct ow_buf graph = { 0 };

    ow_identity_conv(&graph, 16);
    ow_node(&graph, "Relu", "blocked", "r", NULL);
    ow_node(&graph, "Add", "r blocked", "s", NULL);
    ow_node(&graph, "Identity", "s", "i", NULL);
    ow_node(&graph, "Add", "i x", "y", NULL);
    got = run_graph(&graph, &in, 16, 11);
    for (int i = 0; i < 16 * 9 * 7; i++)
        want.d[i] = (in.d[i] > 0 ? in.d[i] : 0) + 2 * in.d[i];
    expect_image(&got, &want, 1e-6);
    free(in.d), free(want.d), free(got.d);
}

static void padding_is_joined_with_the_convolution(void **state SST_UNUSED)
{
    const struct conv given = { 3, 4, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 0, 1, 0 }, 1 };
    const struct conv whole = { 3, 4, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 2, 2, 4, 4 }, 1 };
    const int64_t pads[] = { 0, 0, 1, 2, 0, 0, 3, 4 };
    float *w = random_floats(4 * 27);
    struct image in = random_image(3, 8, 9), want = ref_conv(&in, &whole, w, NULL), got;
    struct ow_buf graph = { 0 };

    ow_floats(&graph, "w", w, 4, 3, 3, 3);
    ow_int64s(&graph, "pads", pads, 8);
    ow_node(&graph, "Pad", "x pads", "p", NULL);
    ow_conv(&graph, &given, "p w", "y");
    got = run_graph(&graph, &in, 4, 11);
    expect_image(&got, &want, 1e-5);
    free(w), free(in.d), free(want.d), free(got.d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(convolutions_equal_plain_loops),
        cmocka_unit_test(convolutions_do_not_depend_on_threads),
        cmocka_unit_test(residual_blocks_equal_plain_loops),
        cmocka_unit_test(sums_at_the_end_equal_plain_loops),
        cmocka_unit_test(shared_values_are_kept),
        cmocka_unit_test(padding_is_joined_with_the_convolution),
    };

    if (!WITH_DNNL) {
        puts("built without oneDNN");
        return 77;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
