/* tests/device_nets.h - small networks that run on a device and on the CPU, and how far their results are apart. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_DEVICE_NETS_H
#define SST_TESTS_DEVICE_NETS_H

#include "pipeline/method/network/device.h"
#include "tests/network_bench.h"

static SST_UNUSED void nets_add_conv(struct ow_buf *graph, const char *name, const struct conv *c, const char *ins,
                                     const char *out)
{
    const int per = c->ic / c->group * c->kernel[0] * c->kernel[1];
    float *w = random_floats(c->oc * per), *b = random_floats(c->oc);
    char weights[32], bias[32], all[128];

    for (int i = 0; i < c->oc * per; i++)
        w[i] *= 1.5f / sqrtf((float)per);
    snprintf(weights, sizeof(weights), "%s_w", name);
    snprintf(bias, sizeof(bias), "%s_b", name);
    snprintf(all, sizeof(all), "%s %s %s", ins, weights, bias);
    ow_floats(graph, weights, w, c->oc, c->ic / c->group, c->kernel[0], c->kernel[1]);
    ow_floats(graph, bias, b, c->oc, 0, 0, 0);
    ow_conv(graph, c, all, out);
    free(w);
    free(b);
}

static SST_UNUSED struct ow_buf nets_finish(struct ow_buf *graph, int in, int out, const char *ranges)
{
    struct ow_buf model;

    ow_value(graph, 11, "x", in);
    ow_value(graph, 12, "y", out);
    model = ow_model(graph, 13);
    if (ranges)
        ow_metadata(&model, "sst.ranges", ranges);
    return model;
}

static const char nets_pyramid_ranges[] = "1 x\n5 a\n5 b\n5 c\n5 d\n5 e\n5 f\n5 g\n5 p1\n5 p2\n5 q1\n5 q2\n5 r1\n5 r2\n"
                                          "5 s1\n5 s2\n5 l\n5 m\n5 n\n5 o\n5 y\n";

/* All layers of the label networks that ship: strides, dilation, residuals, a pyramid of pools, its concatenation. */
static SST_UNUSED struct ow_buf nets_pyramid(const char *ranges)
{
    const struct conv c1 = { 3, 16, { 3, 3 }, { 2, 2 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    const struct conv c2 = { 16, 24, { 3, 3 }, { 1, 1 }, { 2, 2 }, { 2, 2, 2, 2 }, 1 };
    const struct conv c3 = { 24, 24, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    const struct conv c4 = { 24, 8, { 1, 1 }, { 1, 1 }, { 1, 1 }, { 0, 0, 0, 0 }, 1 };
    const struct conv c5 = { 40, 36, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    const struct conv c6 = { 36, 5, { 1, 1 }, { 1, 1 }, { 1, 1 }, { 0, 0, 0, 0 }, 1 };
    struct ow_buf graph = { 0 }, a = { 0 };

    srand(7);
    nets_add_conv(&graph, "c1", &c1, "x", "a");
    ow_node(&graph, "Relu", "a", "b", NULL);
    nets_add_conv(&graph, "c2", &c2, "b", "c");
    ow_node(&graph, "Relu", "c", "d", NULL);
    nets_add_conv(&graph, "c3", &c3, "d", "e");
    ow_node(&graph, "Add", "e d", "f", NULL);
    ow_node(&graph, "Relu", "f", "g", NULL);
    for (int i = 1; i <= 2; i++) {
        char p[3] = { 'p', (char)('0' + i), 0 }, q[] = { 'q', p[1], 0 }, r[] = { 'r', p[1], 0 }, s[] = { 's', p[1], 0 };
        char ins[8], name[] = { 'k', p[1], 0 };

        ow_attr_ints(&a, "output_size", 2, i, i + 1);
        ow_node(&graph, "sst.AdaptiveAveragePool", "g", p, &a);
        nets_add_conv(&graph, name, &c4, p, q);
        ow_node(&graph, "Relu", q, r, NULL);
        snprintf(ins, sizeof(ins), "%s g", r);
        ow_node(&graph, "sst.ResizeLike", ins, s, NULL);
    }
    ow_attr_int(&a, "axis", 1);
    ow_node(&graph, "Concat", "g s1 s2", "l", &a);
    nets_add_conv(&graph, "c5", &c5, "l", "m");
    ow_node(&graph, "Relu", "m", "n", NULL);
    nets_add_conv(&graph, "c6", &c6, "n", "o");
    ow_node(&graph, "sst.ResizeLike", "o b", "y", NULL);
    return nets_finish(&graph, 3, 5, ranges);
}

/* The layers of the matching networks: convolutions, and vectors of length 1. */
static SST_UNUSED struct ow_buf nets_matching(const char *ranges)
{
    const struct conv c1 = { 1, 32, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    const struct conv c2 = { 32, 16, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    struct ow_buf graph = { 0 }, a = { 0 };

    srand(9);
    nets_add_conv(&graph, "c1", &c1, "x", "a");
    ow_node(&graph, "Relu", "a", "b", NULL);
    nets_add_conv(&graph, "c2", &c2, "b", "c");
    ow_attr_int(&a, "axis", 1);
    ow_attr_int(&a, "p", 2);
    ow_node(&graph, "LpNormalization", "c", "y", &a);
    return nets_finish(&graph, 1, 16, ranges);
}

/* Share of the results that differ by more than `tolerance`, which is relative to 1 + |x|. */
static SST_UNUSED double nets_apart(const struct image *got, const struct image *want, double tolerance)
{
    const int n = want->c * want->h * want->w;
    int apart = 0;

    assert_int_equal(got->c, want->c);
    assert_int_equal(got->h, want->h);
    assert_int_equal(got->w, want->w);
    for (int i = 0; i < n; i++)
        apart += !(fabs((double)got->d[i] - (double)want->d[i]) <= tolerance * (1 + fabs((double)want->d[i])));
    return (double)apart / n;
}

/* Run a copy of a model on a device; NULL: on the CPU. */
static SST_UNUSED struct image nets_run(const struct ow_buf *model, const struct image *in,
                                        enum sst_precision precision, struct sst_runner_user *d)
{
    struct ow_buf copy = { 0 };
    struct sst_network *net;
    struct image out;

    ow_raw(&copy, model->p, model->n);
    assert_int_equal(open_with(&net, &copy, precision, 1), 0);
    sst_network_use_runner(net, d);
    out = run_net(net, in);
    sst_network_close(net);
    return out;
}

/* Results of a device against the CPU's. On 8 bits both compute the same numbers, whatever the processor; only the first
 * layer, on floats, may round another way, which few results show, by steps of the 8 bits. Floats differ by their order of
 * summation. */
static SST_UNUSED void nets_expect(const struct image *got, const struct image *want, bool int8)
{
    const double apart = nets_apart(got, want, int8 ? 0 : 1e-5);

    if (int8)
        print_message("8 bits: %.5f of the results differ\n", apart);
    assert_true(apart <= (int8 ? 0.01 : 0));
    assert_true(nets_apart(got, want, int8 ? 0.1 : 1e-5) <= (int8 ? 0.01 : 0));
}

/* Vectors of length 1 in bytes, on a device and on the CPU: at most one step apart, and that rarely. */
static SST_UNUSED void nets_expect_features(struct sst_runner_user *d, enum sst_precision precision)
{
    const char ranges[] = "1 x\n5 a\n5 b\n5 c\n1 y\n";
    struct ow_buf models[] = { nets_matching(ranges), nets_matching(ranges) };
    const int n = 16 * 19 * 13;
    struct image in = random_image(1, 13, 19);
    int8_t *out[] = { malloc((size_t)n), malloc((size_t)n) };
    int apart = 0, most = 0;

    for (int i = 0; i < 2; i++) {
        struct sst_network *net;

        assert_int_equal(open_with(&net, &models[i], precision, 1), 0);
        sst_network_use_runner(net, i ? d : NULL);
        assert_non_null(out[i]);
        assert_int_equal(sst_network_run_s8(net, &(struct sst_network_bytes){ in.d, 19, 13, 127, out[i], NULL }), 0);
        sst_network_close(net);
    }
    for (int i = 0; i < n; i++) {
        apart += out[0][i] != out[1][i];
        most = sst_max_int(most, abs(out[0][i] - out[1][i]));
    }
    print_message("%d of %d bytes of features differ, by %d at most\n", apart, n, most);
    assert_true(apart <= n / 50 && most <= 2);
    free(in.d), free(out[0]), free(out[1]);
}

#endif
