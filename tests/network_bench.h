/* tests/network_bench.h - for tests of the network runner: images, graphs that are run at once, plain convolutions. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_NETWORK_BENCH_H
#define SST_TESTS_NETWORK_BENCH_H

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "pipeline/method/network/network.h"
#include "tests/onnx_writer.h"
#include "tests/test.h"

struct image {
    int c, h, w;
    float *d;
};

static SST_UNUSED struct image new_image(int c, int h, int w)
{
    struct image m = { c, h, w, calloc((size_t)c * (size_t)h * (size_t)w, sizeof(float)) };

    assert_non_null(m.d);
    return m;
}

static SST_UNUSED float *at(const struct image *m, int c, int y, int x)
{
    return &m->d[((size_t)c * (size_t)m->h + (size_t)y) * (size_t)m->w + (size_t)x];
}

static SST_UNUSED float random_float(void)
{
    return (float)rand() / (float)RAND_MAX * 2 - 1;
}

static SST_UNUSED float *random_floats(int n)
{
    float *p = malloc((size_t)n * sizeof(*p));

    assert_non_null(p);
    for (int i = 0; i < n; i++)
        p[i] = random_float();
    return p;
}

static SST_UNUSED struct image random_image(int c, int h, int w)
{
    return (struct image){ c, h, w, random_floats(c * h * w) };
}

/* Write the model, which is taken, to a file, open it, remove the file. */
static SST_UNUSED int open_with(struct sst_network **net, struct ow_buf *model, enum sst_precision precision,
                                int threads)
{
    char path[] = "/tmp/sst-network-XXXXXX";
    const int fd = mkstemp(path);
    int err;

    assert_true(fd >= 0);
    assert_int_equal(write(fd, model->p, model->n), (ssize_t)model->n);
    close(fd);
    err = sst_network_open(net, path, precision, threads);
    unlink(path);
    free(model->p);
    *model = (struct ow_buf){ 0 };
    return err;
}

static SST_UNUSED int open_model(struct sst_network **net, struct ow_buf *model, int threads)
{
    return open_with(net, model, SST_PRECISION_F32, threads);
}

static SST_UNUSED struct image run_net(struct sst_network *net, const struct image *in)
{
    struct sst_shape shape;
    struct image out;

    assert_int_equal(sst_network_in_channels(net), in->c);
    assert_int_equal(sst_network_out_shape(net, in->w, in->h, &shape), 0);
    out = new_image(shape.c, shape.h, shape.w);
    assert_int_equal(sst_network_run(net, in->d, in->w, in->h, out.d), 0);
    return out;
}

/* Finish a graph from "x" to "y" and run it on oneDNN, with one and with two threads: the bytes must agree. */
static SST_UNUSED struct image run_graph(struct ow_buf *graph, const struct image *in, int out_channels, int opset)
{
    struct sst_network *net;
    struct ow_buf model, copy = { 0 };
    struct image out, again;

    ow_value(graph, 11, "x", in->c);
    ow_value(graph, 12, "y", out_channels);
    model = ow_model(graph, opset);
    ow_raw(&copy, model.p, model.n);
    assert_int_equal(open_model(&net, &model, 1), 0);
    assert_string_equal(sst_network_runner(net), "onednn");
    out = run_net(net, in);
    sst_network_close(net);
    assert_int_equal(open_model(&net, &copy, 2), 0);
    again = run_net(net, in);
    sst_network_close(net);
    assert_memory_equal(out.d, again.d, (size_t)out.c * (size_t)out.h * (size_t)out.w * sizeof(float));
    free(again.d);
    return out;
}

static SST_UNUSED void expect_image(const struct image *got, const struct image *want, double tolerance)
{
    assert_int_equal(got->c, want->c);
    assert_int_equal(got->h, want->h);
    assert_int_equal(got->w, want->w);
    for (int i = 0; i < got->c * got->h * got->w; i++) {
        if (!(fabs((double)got->d[i] - (double)want->d[i]) <= tolerance * (1 + fabs((double)want->d[i]))))
            fail_msg("sample %d is %g, not %g", i, (double)got->d[i], (double)want->d[i]);
    }
}

struct conv {
    int ic, oc, kernel[2], stride[2], dilation[2], pad[4], group; /* pad: top, left, bottom, right */
};

static SST_UNUSED struct image ref_conv(const struct image *in, const struct conv *c, const float *w, const float *bias)
{
    const int h = (in->h + c->pad[0] + c->pad[2] - c->dilation[0] * (c->kernel[0] - 1) - 1) / c->stride[0] + 1;
    const int wide = (in->w + c->pad[1] + c->pad[3] - c->dilation[1] * (c->kernel[1] - 1) - 1) / c->stride[1] + 1;
    const int per = c->ic / c->group;
    struct image out = new_image(c->oc, h, wide);

    for (int o = 0; o < c->oc; o++) {
        for (int p = 0; p < h * wide; p++) {
            double sum = bias ? bias[o] : 0;

            for (int k = 0; k < per * c->kernel[0] * c->kernel[1]; k++) {
                const int kx = k % c->kernel[1], ky = k / c->kernel[1] % c->kernel[0],
                          i = k / c->kernel[1] / c->kernel[0];
                const int y = p / wide * c->stride[0] + ky * c->dilation[0] - c->pad[0];
                const int x = p % wide * c->stride[1] + kx * c->dilation[1] - c->pad[1];

                if (y >= 0 && y < in->h && x >= 0 && x < in->w)
                    sum += (double)w[o * per * c->kernel[0] * c->kernel[1] + k] *
                           (double)*at(in, o / (c->oc / c->group) * per + i, y, x);
            }
            *at(&out, o, p / wide, p % wide) = (float)sum;
        }
    }
    return out;
}

static SST_UNUSED void ow_conv(struct ow_buf *graph, const struct conv *c, const char *ins, const char *out)
{
    struct ow_buf a = { 0 };

    ow_attr_ints(&a, "kernel_shape", 2, c->kernel[0], c->kernel[1]);
    ow_attr_ints(&a, "strides", 2, c->stride[0], c->stride[1]);
    ow_attr_ints(&a, "dilations", 2, c->dilation[0], c->dilation[1]);
    ow_attr_ints(&a, "pads", 4, c->pad[0], c->pad[1], c->pad[2], c->pad[3]);
    ow_attr_int(&a, "group", c->group);
    ow_node(graph, "Conv", ins, out, &a);
}

/* conv 1x1 of the identity, so that the layer under test gets whatever layout oneDNN likes, from "x" to "blocked" */
static SST_UNUSED void ow_identity_conv(struct ow_buf *graph, int channels)
{
    const struct conv c = { channels, channels, { 1, 1 }, { 1, 1 }, { 1, 1 }, { 0, 0, 0, 0 }, 1 };
    struct image w = new_image(channels, channels, 1);

    for (int i = 0; i < channels; i++)
        *at(&w, i, i, 0) = 1;
    ow_floats(graph, "identity", w.d, channels, channels, 1, 1);
    ow_conv(graph, &c, "x identity", "blocked");
    free(w.d);
}

#endif
