/* The network runner: every layer against plain loops, layouts, fusions, sizes, OpenCV's runner. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/network/network.h"
#include "tests/onnx_writer.h"

struct image {
    int c, h, w;
    float *d;
};

static struct image new_image(int c, int h, int w)
{
    struct image m = { c, h, w, calloc((size_t)c * (size_t)h * (size_t)w, sizeof(float)) };

    assert_non_null(m.d);
    return m;
}

static float *at(const struct image *m, int c, int y, int x)
{
    return &m->d[((size_t)c * (size_t)m->h + (size_t)y) * (size_t)m->w + (size_t)x];
}

static float random_float(void)
{
    return (float)rand() / (float)RAND_MAX * 2 - 1;
}

static float *random_floats(int n)
{
    float *p = malloc((size_t)n * sizeof(*p));

    assert_non_null(p);
    for (int i = 0; i < n; i++)
        p[i] = random_float();
    return p;
}

static struct image random_image(int c, int h, int w)
{
    return (struct image){ c, h, w, random_floats(c * h * w) };
}

/* Write the model, which is taken, to a file, open it, remove the file. */
static int open_with(struct sst_network **net, struct ow_buf *model, enum sst_precision precision, int threads)
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

static int open_model(struct sst_network **net, struct ow_buf *model, int threads)
{
    return open_with(net, model, SST_PRECISION_F32, threads);
}

static struct image run_net(struct sst_network *net, const struct image *in)
{
    struct image out = { 0 };

    assert_int_equal(sst_network_in_channels(net), in->c);
    assert_int_equal(sst_network_out_shape(net, in->w, in->h, &out.c, &out.w, &out.h), 0);
    out = new_image(out.c, out.h, out.w);
    assert_int_equal(sst_network_run(net, in->d, in->w, in->h, out.d), 0);
    return out;
}

/* Finish a graph from "x" to "y" and run it on oneDNN, with one and with two threads: the bytes must agree. */
static struct image run_graph(struct ow_buf *graph, const struct image *in, int out_channels, int opset)
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

static void expect_image(const struct image *got, const struct image *want, double tolerance)
{
    assert_int_equal(got->c, want->c);
    assert_int_equal(got->h, want->h);
    assert_int_equal(got->w, want->w);
    for (int i = 0; i < got->c * got->h * got->w; i++) {
        if (!(fabs((double)got->d[i] - (double)want->d[i]) <= tolerance * (1 + fabs((double)want->d[i]))))
            fail_msg("sample %d is %g, not %g", i, (double)got->d[i], (double)want->d[i]);
    }
}

/* --- convolution --- */

struct conv {
    int ic, oc, kernel[2], stride[2], dilation[2], pad[4], group; /* pad: top, left, bottom, right */
};

static struct image ref_conv(const struct image *in, const struct conv *c, const float *w, const float *bias)
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

static void ow_conv(struct ow_buf *graph, const struct conv *c, const char *ins, const char *out)
{
    struct ow_buf a = { 0 };

    ow_attr_ints(&a, "kernel_shape", 2, c->kernel[0], c->kernel[1]);
    ow_attr_ints(&a, "strides", 2, c->stride[0], c->stride[1]);
    ow_attr_ints(&a, "dilations", 2, c->dilation[0], c->dilation[1]);
    ow_attr_ints(&a, "pads", 4, c->pad[0], c->pad[1], c->pad[2], c->pad[3]);
    ow_attr_int(&a, "group", c->group);
    ow_node(graph, "Conv", ins, out, &a);
}

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
    static const struct conv c = { 64, 64, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    static const int sizes[2][2] = { { 72, 96 }, { 240, 320 } }, threads[3] = { 2, 1, 16 };

    for (int i = 0; i < 2; i++) {
        float *w = random_floats(64 * 64 * 9);
        struct image in = random_image(64, sizes[i][0], sizes[i][1]), out[3];
        struct ow_buf graph = { 0 }, model;

        ow_floats(&graph, "w", w, 64, 64, 3, 3);
        ow_conv(&graph, &c, "x w", "y");
        ow_value(&graph, 11, "x", 64);
        ow_value(&graph, 12, "y", 64);
        model = ow_model(&graph, 11);
        for (int k = 0; k < 3; k++) {
            struct ow_buf copy = { 0 };
            struct sst_network *net;

            ow_raw(&copy, model.p, model.n);
            assert_int_equal(open_model(&net, &copy, threads[k]), 0);
            out[k] = run_net(net, &in);
            sst_network_close(net);
            assert_memory_equal(out[k].d, out[0].d, 64 * (size_t)(in.h * in.w) * sizeof(float));
        }
        free(w), free(in.d), free(model.p), free(out[0].d), free(out[1].d), free(out[2].d);
    }
}

/* conv 1x1 of the identity, so that the layer under test gets whatever layout oneDNN likes, from "x" to "blocked" */
static void ow_identity_conv(struct ow_buf *graph, int channels)
{
    const struct conv c = { channels, channels, { 1, 1 }, { 1, 1 }, { 1, 1 }, { 0, 0, 0, 0 }, 1 };
    struct image w = new_image(channels, channels, 1);

    for (int i = 0; i < channels; i++)
        *at(&w, i, i, 0) = 1;
    ow_floats(graph, "identity", w.d, channels, channels, 1, 1);
    ow_conv(graph, &c, "x identity", "blocked");
    free(w.d);
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

/* --- pools --- */

static struct image ref_pool(const struct image *in, int h, int w, int kernel, int stride, int pad, int mode)
{
    struct image out = new_image(in->c, h, w);

    for (int i = 0; i < in->c * h * w; i++) {
        const int c = i / (h * w), y0 = i / w % h * stride - pad, x0 = i % w * stride - pad;
        double sum = 0, max = -HUGE_VAL;
        int n = 0;

        for (int k = 0; k < kernel * kernel; k++) {
            const int y = y0 + k / kernel, x = x0 + k % kernel;

            if (y < 0 || y >= in->h || x < 0 || x >= in->w)
                continue;
            n++;
            sum += (double)*at(in, c, y, x);
            max = fmax(max, (double)*at(in, c, y, x));
        }
        out.d[i] = (float)(mode == 'm' ? max : sum / (mode == 'p' ? kernel * kernel : n));
    }
    return out;
}

static void pools_equal_plain_loops(void **state SST_UNUSED)
{
    static const struct {
        int kernel, stride, pad, ceil, mode, h, w; /* mode: max, average, average that counts the padding */
    } cases[] = {
        { 3, 2, 1, 0, 'm', 7, 9 }, { 3, 2, 0, 1, 'm', 6, 8 }, { 2, 2, 0, 1, 'a', 7, 9 },  { 3, 2, 1, 0, 'a', 7, 9 },
        { 3, 2, 1, 0, 'p', 7, 9 }, { 3, 2, 1, 1, 'm', 7, 9 }, { 13, 1, 0, 0, 'a', 1, 5 },
    };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        struct image in = random_image(20, 13, 17), got;
        struct image want =
            ref_pool(&in, cases[i].h, cases[i].w, cases[i].kernel, cases[i].stride, cases[i].pad, cases[i].mode);
        struct ow_buf graph = { 0 }, a = { 0 };

        ow_identity_conv(&graph, 20);
        ow_attr_ints(&a, "kernel_shape", 2, cases[i].kernel, cases[i].kernel);
        ow_attr_ints(&a, "strides", 2, cases[i].stride, cases[i].stride);
        ow_attr_ints(&a, "pads", 4, cases[i].pad, cases[i].pad, cases[i].pad, cases[i].pad);
        ow_attr_int(&a, "ceil_mode", cases[i].ceil);
        ow_attr_int(&a, "count_include_pad", cases[i].mode == 'p');
        ow_node(&graph, cases[i].mode == 'm' ? "MaxPool" : "AveragePool", "blocked", "y", &a);
        got = run_graph(&graph, &in, 20, 11);
        expect_image(&got, &want, 1e-5);
        free(in.d), free(want.d), free(got.d);
    }
}

/* Bins of 5 samples in 3: 0..1, 1..3, 3..4 (floor and ceiling of 5/3 and 10/3): they overlap. */
static void adaptive_pools_equal_hand_worked_bins(void **state SST_UNUSED)
{
    const struct image in = { 1, 1, 5, (float[]){ 1, 2, 4, 8, 16 } },
                       want = { 1, 1, 3, (float[]){ 1.5f, 14.0f / 3, 12 } };
    struct ow_buf graph = { 0 }, a = { 0 };
    struct image got;

    ow_attr_ints(&a, "output_size", 2, 1, 3);
    ow_node(&graph, "sst.AdaptiveAveragePool", "x", "y", &a);
    got = run_graph(&graph, &in, 1, 11);
    expect_image(&got, &want, 1e-7);
    free(got.d);
}

static void adaptive_pools_work_in_every_layout(void **state SST_UNUSED)
{
    static const int channels[] = { 3, 16, 20, 64 }, sizes[] = { 1, 2, 3, 6 };

    for (size_t i = 0; i < ARRAY_LEN(channels) * ARRAY_LEN(sizes); i++) {
        const int c = channels[i / 4], n = sizes[i % 4];
        struct image in = random_image(c, 12, 18), want = new_image(c, n, n), got;
        struct ow_buf graph = { 0 }, a = { 0 };

        for (int k = 0; k < c * 12 * 18; k++)
            want.d[k / 216 * n * n + k / 18 % 12 * n / 12 * n + k % 18 * n / 18] += in.d[k] / (216.0f / (float)(n * n));
        ow_identity_conv(&graph, c);
        ow_attr_ints(&a, "output_size", 2, n, n);
        /* a relu behind it makes the pool keep the layout */
        ow_node(&graph, n == 1 ? "GlobalAveragePool" : "sst.AdaptiveAveragePool", "blocked", "p", &a);
        ow_node(&graph, "Relu", "p", "y", NULL);
        for (int k = 0; k < c * n * n; k++)
            want.d[k] = want.d[k] > 0 ? want.d[k] : 0;
        got = run_graph(&graph, &in, c, 11);
        expect_image(&got, &want, 1e-5);
        free(in.d), free(want.d), free(got.d);
    }
}

/* --- resize --- */

static void resize_samples_where_the_standard_says(void **state SST_UNUSED)
{
    static const struct {
        const char *mode;
        float want[4];
    } cases[] = {
        { "half_pixel", { 0, 0.25f, 0.75f, 1 } },
        { "align_corners", { 0, 1 / 3.0f, 2 / 3.0f, 1 } },
        { "asymmetric", { 0, 0.5f, 1, 1 } },
        { "pytorch_half_pixel", { 0, 0.25f, 0.75f, 1 } },
    };
    const struct image in = { 1, 1, 2, (float[]){ 0, 1 } };
    const float scales[] = { 1, 1, 1, 2 };
    const int64_t sizes[] = { 1, 1, 1, 4 };

    const int64_t zero = 0, two = 2, tail[] = { 1, 4 };

    for (size_t i = 0; i < 3 * ARRAY_LEN(cases); i++) {
        static const char *const inputs[] = { "x - scales", "x - - sizes", "x - - computed" };
        struct image got, want = { 1, 1, 4, (float *)(uintptr_t)cases[i / 3].want };
        struct ow_buf graph = { 0 }, a = { 0 };

        ow_floats(&graph, "scales", scales, 4, 0, 0, 0);
        ow_int64s(&graph, "sizes", sizes, 4);
        ow_attr_str(&a, "mode", "linear");
        ow_attr_str(&a, "coordinate_transformation_mode", cases[i / 3].mode);
        /* as an exporter writes a fixed size: the first two of x's sizes, then the new ones */
        ow_int64s(&graph, "zero", &zero, 1);
        ow_int64s(&graph, "two", &two, 1);
        ow_int64s(&graph, "tail", tail, 2);
        ow_node(&graph, "Shape", "x", "shape", NULL);
        ow_node(&graph, "Slice", "shape zero two zero", "head", NULL);
        ow_node(&graph, "Concat", "head tail", "computed", NULL);
        ow_node(&graph, "Resize", inputs[i % 3], "y", &a);
        got = run_graph(&graph, &in, 1, 13);
        expect_image(&got, &want, 1e-6);
        free(got.d);
    }
}

/* Where sample i of `to` lies among `from`. */
static double ref_position(int i, int from, int to, int align)
{
    const double p = align ? (double)i * (from - 1) / (to - 1) : (i + 0.5) * from / to - 0.5;

    return fmin(fmax(p, 0), from - 1);
}

/* Weight of input sample k at a position: a hat of width one. */
static double hat(double position, int k)
{
    return fmax(0, 1 - fabs(position - k));
}

/* The skeleton of a PSPNet: bins of 3 x 2 brought back to the size of x, concatenated behind it. */
static void resize_like_takes_the_size_of_another_value(void **state SST_UNUSED)
{
    for (int align = 0; align < 2; align++) {
        struct image in = random_image(20, 9, 8), want = new_image(40, 9, 8), got;
        struct ow_buf graph = { 0 }, pool = { 0 }, resize = { 0 }, axis = { 0 };

        ow_identity_conv(&graph, 20);
        ow_attr_ints(&pool, "output_size", 2, 3, 2);
        ow_node(&graph, "sst.AdaptiveAveragePool", "blocked", "p", &pool);
        ow_attr_int(&resize, "align_corners", align);
        ow_node(&graph, "sst.ResizeLike", "p blocked", "r", &resize);
        ow_attr_int(&axis, "axis", 1);
        ow_node(&graph, "Concat", "blocked r", "y", &axis);
        got = run_graph(&graph, &in, 40, 13);
        memcpy(want.d, in.d, 20 * 72 * sizeof(float));
        for (int i = 0; i < 20 * 72; i++) {
            double sum = 0;

            for (int k = 0; k < 72; k++) /* bins of 3 x 4 pixels */
                sum += (double)in.d[i / 72 * 72 + k] / 12 * hat(ref_position(i % 72 / 8, 3, 9, align), k / 8 / 3) *
                       hat(ref_position(i % 8, 2, 8, align), k % 8 / 4);
            want.d[20 * 72 + i] = (float)sum;
        }
        expect_image(&got, &want, 1e-6);
        free(in.d), free(want.d), free(got.d);
    }
}

/* --- over channels --- */

static void softmax_is_over_channels(void **state SST_UNUSED)
{
    const float x[] = { 0, 1e4f, 1, -1e4f, 2, 1e4f }; /* two pixels, three channels */
    const double sum = 1 + exp(1) + exp(2);
    const struct image in = { 3, 1, 2, (float *)(uintptr_t)x };
    struct image want = new_image(3, 1, 2), got;
    struct ow_buf graph = { 0 }, a = { 0 };

    for (int c = 0; c < 3; c++)
        want.d[2 * c] = (float)(exp(c) / sum);
    want.d[1] = want.d[5] = 0.5f;
    ow_identity_conv(&graph, 3);
    ow_attr_int(&a, "axis", 1);
    ow_node(&graph, "Softmax", "blocked", "y", &a);
    got = run_graph(&graph, &in, 3, 13);
    expect_image(&got, &want, 1e-6);
    free(want.d), free(got.d);
}

/* The ways in which exporters write x / |x|; eps only matters for the pixel that is 0. */
static void add_norm(struct ow_buf *graph, int form)
{
    const float eps = 1e-12f, two = 2;
    const int64_t one = 1;
    struct ow_buf a = { 0 };

    ow_floats(graph, "eps", &eps, 1, 0, 0, 0);
    ow_floats(graph, "two", &two, 1, 0, 0, 0);
    ow_int64s(graph, "axes", &one, 1);
    if (form == 0) {
        ow_attr_int(&a, "axis", 1);
        ow_node(graph, "LpNormalization", "blocked", "y", &a);
    } else if (form == 1) { /* reduction, clip, expand, division */
        ow_attr_ints(&a, "axes", 1, 1);
        ow_attr_int(&a, "keepdims", 1);
        ow_node(graph, "ReduceL2", "blocked", "n", &a);
        ow_node(graph, "Clip", "n eps", "c", NULL);
        ow_node(graph, "Shape", "blocked", "shape", NULL);
        ow_node(graph, "Expand", "c shape", "e", NULL);
        ow_node(graph, "Div", "blocked e", "y", NULL);
    } else if (form == 2) {
        ow_node(graph, "Mul", "blocked blocked", "q", NULL);
        ow_node(graph, "ReduceSum", "q axes", "s", NULL);
        ow_node(graph, "Add", "s eps", "t", NULL);
        ow_node(graph, "Sqrt", "t", "n", NULL);
        ow_node(graph, "Div", "blocked n", "y", NULL);
    } else {
        ow_node(graph, "Pow", "blocked two", "q", NULL);
        ow_node(graph, "ReduceSum", "q axes", "s", NULL);
        ow_node(graph, "Sqrt", "s", "n", NULL);
        ow_node(graph, "Max", "n eps", "m", NULL);
        ow_node(graph, "Div", "blocked m", "y", NULL);
    }
}

static void normalisation_is_recognised_in_all_its_forms(void **state SST_UNUSED)
{
    struct image in = random_image(20, 5, 37), want = new_image(20, 5, 37);

    for (int p = 0; p < 5 * 37; p++) {
        double sum = 0;

        for (int c = 0; c < 20; c++) {
            if (p == 3)
                in.d[c * 185 + p] = 0;
            sum += (double)in.d[c * 185 + p] * (double)in.d[c * 185 + p];
        }
        for (int c = 0; c < 20; c++)
            want.d[c * 185 + p] = sum > 0 ? (float)((double)in.d[c * 185 + p] / sqrt(sum)) : 0;
    }
    for (int form = 0; form < 4; form++) {
        struct ow_buf graph = { 0 };
        struct image got;

        ow_identity_conv(&graph, 20);
        add_norm(&graph, form);
        got = run_graph(&graph, &in, 20, 13);
        expect_image(&got, &want, 1e-6);
        free(got.d);
    }
    free(in.d), free(want.d);
}

/* --- the whole --- */

/* A small network with most of the layers, on sizes that it was not made for; OpenCV gives the same numbers. */
static struct ow_buf small_network(bool with_sigmoid)
{
    const struct conv c1 = { 3, 16, { 3, 3 }, { 2, 2 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    const struct conv c2 = { 16, 16, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    const struct conv c3 = { 32, 5, { 1, 1 }, { 1, 1 }, { 1, 1 }, { 0, 0, 0, 0 }, 1 };
    const float scales[] = { 1, 1, 2, 2 };
    struct ow_buf graph = { 0 }, a = { 0 }, model;
    float *w;

    srand(3);
    w = random_floats(16 * 27);
    ow_floats(&graph, "w1", w, 16, 3, 3, 3);
    free(w);
    w = random_floats(16 * 16 * 9);
    ow_floats(&graph, "w2", w, 16, 16, 3, 3);
    free(w);
    w = random_floats(5 * 32);
    ow_floats(&graph, "w3", w, 5, 32, 1, 1);
    free(w);
    ow_floats(&graph, "scales", scales, 4, 0, 0, 0);
    ow_conv(&graph, &c1, "x w1", "a");
    ow_node(&graph, "Relu", "a", "b", NULL);
    ow_attr_ints(&a, "kernel_shape", 2, 3, 3);
    ow_attr_ints(&a, "strides", 2, 1, 1);
    ow_attr_ints(&a, "pads", 4, 1, 1, 1, 1);
    ow_node(&graph, "MaxPool", "b", "p", &a);
    ow_conv(&graph, &c2, "p w2", "c");
    ow_node(&graph, "Add", "c p", "d", NULL);
    ow_attr_int(&a, "axis", 1);
    ow_node(&graph, "Concat", "d b", "e", &a);
    ow_conv(&graph, &c3, "e w3", "f");
    ow_attr_str(&a, "mode", "linear");
    ow_attr_str(&a, "coordinate_transformation_mode", "align_corners");
    ow_node(&graph, "Resize", "f - scales", with_sigmoid ? "g" : "y", &a);
    if (with_sigmoid)
        ow_node(&graph, "Sigmoid", "g", "y", NULL);
    ow_value(&graph, 11, "x", 3);
    ow_value(&graph, 12, "y", 5);
    model = ow_model(&graph, 11);
    ow_metadata(&model, "sst.key", "a value");
    return model;
}

static void both_runners_agree_at_any_size(void **state SST_UNUSED)
{
    static const int sizes[][2] = { { 40, 30 }, { 48, 64 }, { 34, 22 }, { 40, 30 } };
    struct ow_buf model = small_network(false), with_sigmoid = small_network(true);
    struct sst_network *net, *cv;

    if (!WITH_OPENCV) {
        print_message("built without OpenCV: there is no other runner to agree with\n");
        free(model.p), free(with_sigmoid.p);
        skip();
    }
    assert_int_equal(open_model(&net, &model, 2), 0);
    sst_log_set_level(SST_LOG_ERROR); /* the warning is meant */
    assert_int_equal(open_model(&cv, &with_sigmoid, 2), 0);
    sst_log_set_level(SST_LOG_WARNING);
    assert_string_equal(sst_network_runner(net), "onednn");
    assert_string_equal(sst_network_runner(cv), "opencv");
    assert_string_equal(sst_network_metadata(net, "sst.key"), "a value");
    assert_string_equal(sst_network_metadata(cv, "sst.key"), "a value");
    assert_null(sst_network_metadata(net, "sst.other"));
    for (size_t i = 0; i < ARRAY_LEN(sizes); i++) {
        struct image in = random_image(3, sizes[i][1], sizes[i][0]), a = run_net(net, &in), b = run_net(cv, &in);

        assert_true(a.h == in.h && a.w == in.w);
        for (int k = 0; k < a.c * a.h * a.w; k++)
            a.d[k] = (float)(1 / (1 + exp(-(double)a.d[k])));
        expect_image(&a, &b, 1e-5);
        free(in.d), free(a.d), free(b.d);
    }
    sst_network_close(net);
    sst_network_close(cv);
}

/* --- 8 bits --- */

/* Run a model with ranges on 8 bits, with one and with two threads: the bytes must agree. */
static struct image run_int8(const struct ow_buf *model, const struct image *in)
{
    struct image out[2];

    for (int i = 0; i < 2; i++) {
        struct ow_buf copy = { 0 };
        struct sst_network *net;

        ow_raw(&copy, model->p, model->n);
        assert_int_equal(open_with(&net, &copy, SST_PRECISION_INT8, 1 + i), 0);
        assert_int_equal(sst_network_precision(net), SST_PRECISION_INT8);
        out[i] = run_net(net, in);
        sst_network_close(net);
    }
    assert_memory_equal(out[0].d, out[1].d, (size_t)(out[0].c * out[0].h * out[0].w) * sizeof(float));
    free(out[1].d);
    return out[0];
}

/* Identity, relu, then y = 0.5 a + 0.25 b + 3, 127 a - b on 1x1. The first layer runs on floats; its result is stored
 * in steps of s = range / 255 (or / 127), so that a = 100.3 s, b = 7.6 s become 100 s and 8 s. Weights of output 0 are
 * in steps of 0.5 / 127: 127 and 63.5, which goes to the even 64; of output 1 in steps of 1: exact. */
static void eight_bits_equal_hand_worked_numbers(void **state SST_UNUSED)
{
    const struct conv c = { 2, 2, { 1, 1 }, { 1, 1 }, { 1, 1 }, { 0, 0, 0, 0 }, 1 };
    const float w[] = { 0.5f, 0.25f, 127, -1 }, bias[] = { 3, 0 };
    const struct image in = { 2, 1, 1, (float[]){ 100.3f, 7.6f } };

    for (int levels = 127; levels <= 255; levels += 128) {
        char ranges[80];
        struct ow_buf graph = { 0 }, model;
        struct image got;

        ow_identity_conv(&graph, 2);
        ow_node(&graph, "Relu", "blocked", "r", NULL);
        ow_floats(&graph, "w", w, 2, 2, 1, 1);
        ow_floats(&graph, "b", bias, 2, 0, 0, 0);
        ow_conv(&graph, &c, "r w b", "y");
        ow_value(&graph, 11, "x", 2);
        ow_value(&graph, 12, "y", 2);
        model = ow_model(&graph, 13);
        snprintf(ranges, sizeof(ranges), "101 x\n101 blocked\n%d r\n13000 y\n", levels);
        ow_metadata(&model, "sst.ranges", ranges);
        got = run_int8(&model, &in);
        /* With the steps of the other kind of processor 100.3 and 7.6 are not 100 and 8. */
        if (fabs((double)got.d[1] - (127 * 100 - 8)) < 1e-2) {
            assert_true(fabs((double)got.d[0] - ((127 * 100 + 64 * 8) * 0.5 / 127 + 3)) < 1e-4);
            levels = 1000;
        } else {
            assert_int_equal(levels, 127);
        }
        free(model.p), free(got.d);
    }
}

/* Two blocks with residuals of both signs, pool, concatenation with a resized branch, dilation, a depthwise layer. */
static struct ow_buf branched_network(const char *ranges)
{
    const struct conv c1 = { 3, 16, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    const struct conv c2 = { 16, 16, { 3, 3 }, { 1, 1 }, { 2, 2 }, { 2, 2, 2, 2 }, 1 };
    const struct conv c3 = { 16, 16, { 1, 1 }, { 1, 1 }, { 1, 1 }, { 0, 0, 0, 0 }, 1 };
    const struct conv c4 = { 16, 16, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 16 };
    const struct conv c5 = { 48, 5, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    const struct conv *const convs[] = { &c1, &c2, &c3, &c4, &c5 };
    struct ow_buf graph = { 0 }, a = { 0 }, model;

    srand(5);
    for (int i = 0; i < 5; i++) {
        const struct conv *c = convs[i];
        const int per = c->ic / c->group * c->kernel[0] * c->kernel[1];
        float *w = random_floats(c->oc * per);
        char name[] = "w1";

        for (int k = 0; k < c->oc * per; k++)
            w[k] /= sqrtf((float)per);
        name[1] = (char)('1' + i);
        ow_floats(&graph, name, w, c->oc, c->ic / c->group, c->kernel[0], c->kernel[1]);
        free(w);
    }
    ow_conv(&graph, &c1, "x w1", "a");
    ow_node(&graph, "Relu", "a", "b", NULL);
    ow_conv(&graph, &c3, "b w3", "c"); /* signed, the residual of an unsigned sum */
    ow_conv(&graph, &c2, "b w2", "d");
    ow_node(&graph, "Add", "d c", "e", NULL);
    ow_node(&graph, "Relu", "e", "f", NULL);
    ow_conv(&graph, &c4, "f w4", "g");
    ow_node(&graph, "Add", "g f", "h", NULL); /* f is read again below: its place must be kept */
    ow_attr_ints(&a, "kernel_shape", 2, 3, 3);
    ow_attr_ints(&a, "pads", 4, 1, 1, 1, 1);
    ow_node(&graph, "MaxPool", "f", "i", &a);
    ow_attr_ints(&a, "output_size", 2, 2, 3);
    ow_node(&graph, "sst.AdaptiveAveragePool", "f", "j", &a);
    ow_node(&graph, "sst.ResizeLike", "j h", "k", NULL);
    ow_attr_int(&a, "axis", 1);
    ow_node(&graph, "Concat", "h i k", "l", &a);
    ow_conv(&graph, &c5, "l w5", "y");
    ow_value(&graph, 11, "x", 3);
    ow_value(&graph, 12, "y", 5);
    model = ow_model(&graph, 13);
    if (ranges)
        ow_metadata(&model, "sst.ranges", ranges);
    return model;
}

static const char branched_ranges[] =
    "1 x\n1.4 a\n1.4 b\n1.4 c\n1.4 d\n1.75 e\n1.75 f\n1.12 g\n2.1 h\n1.75 i\n1.05 j\n1.05 k\n2.1 l\n1.4 y\n";

static void eight_bits_stay_near_floats_in_branches(void **state SST_UNUSED)
{
    struct ow_buf model = branched_network(branched_ranges), copy = { 0 };
    struct image in = random_image(3, 23, 30), want, got;
    double error = 0, size = 0;
    struct sst_network *net;

    got = run_int8(&model, &in);
    ow_raw(&copy, model.p, model.n);
    assert_int_equal(open_model(&net, &copy, 1), 0);
    assert_int_equal(sst_network_precision(net), SST_PRECISION_F32);
    want = run_net(net, &in);
    sst_network_close(net);
    for (int i = 0; i < want.c * want.h * want.w; i++) {
        error += pow((double)got.d[i] - (double)want.d[i], 2);
        size += pow((double)want.d[i], 2);
    }
    print_message("8 bits: %.4f of the result's size off\n", sqrt(error / size));
    assert_true(error > 0 && sqrt(error / size) < 0.04);
    free(model.p), free(in.d), free(want.d), free(got.d);
}

static void ranges_that_do_not_fit_are_refused(void **state SST_UNUSED)
{
    static const char *const bad[] = { "1 x\n",       "one x\n", "1 x\n-2 y\n", "nan x\n",
                                       "1 nowhere\n", "1\n",     "1e-30 x\n",   "\n" };
    struct ow_buf model = branched_network(NULL);
    struct sst_network *net = NULL;

    sst_log_set_level(SST_LOG_ERROR);
    assert_int_equal(open_with(&net, &model, SST_PRECISION_INT8, 1), -ENOTSUP);
    model = branched_network(NULL);
    assert_int_equal(open_with(&net, &model, SST_PRECISION_AUTO, 1), 0);
    assert_int_equal(sst_network_precision(net), SST_PRECISION_F32);
    sst_network_close(net);
    net = NULL;
    for (size_t i = 0; i < ARRAY_LEN(bad); i++) {
        model = branched_network(bad[i]);
        assert_int_equal(open_with(&net, &model, SST_PRECISION_INT8, 1), -EBADMSG);
        assert_null(net);
    }
    model = small_network(true);
    if (WITH_OPENCV)
        assert_int_equal(open_with(&net, &model, SST_PRECISION_INT8, 1), -ENOTSUP);
    else
        free(model.p);
}

/* A shipped network on a picture of the street, each channel (v - mean) / deviation. */
static struct image run_shipped(const char *path, const struct sst_image *picture, enum sst_precision precision)
{
    struct sst_network *net;
    struct image in, out;

    assert_int_equal(sst_network_open(&net, path, precision, 2), 0);
    in = new_image(sst_network_in_channels(net), picture->height, picture->width);
    for (int c = 0; c < in.c; c++) {
        for (int y = 0; y < in.h; y++) {
            for (int x = 0; x < in.w; x++)
                *at(&in, c, y, x) = ((float)sst_image_row(picture, c, y)[x] / 255 - 0.43f) / 0.26f;
        }
    }
    out = run_net(net, &in);
    sst_network_close(net);
    free(in.d);
    return out;
}

static int top_channel(const struct image *m, int plane, int p)
{
    int top = 0;

    for (int c = 1; c < m->c; c++)
        top = m->d[c * plane + p] > m->d[top * plane + p] ? c : top;
    return top;
}

/* On 8 bits the features of the matching network turn by a small angle, and the labels are nearly all the same. */
static void shipped_networks_keep_their_results(void **state SST_UNUSED)
{
    static const char picture_file[] = "../shared/data/camvid/val/0016E5_07959.jpg";
    static const char *const files[] = { "models/mccnn-fast.onnx", "models/pspnet-small.onnx" };
    struct sst_image picture;

    if (access(picture_file, R_OK) || access(files[0], R_OK) || access(files[1], R_OK)) {
        print_message("%s or the networks in models/ are not here\n", picture_file);
        skip();
    }
    assert_int_equal(sst_image_read(&picture, picture_file), 0);
    for (int i = 0; i < 2; i++) {
        struct image want = run_shipped(files[i], &picture, SST_PRECISION_F32);
        struct image got = run_shipped(files[i], &picture, SST_PRECISION_INT8);
        const int plane = want.h * want.w;
        double near = 0;

        for (int p = 0; p < plane; p++) {
            for (int c = 0; i == 0 && c < want.c; c++)
                near += (double)want.d[c * plane + p] * (double)got.d[c * plane + p] / plane;
            near += i == 1 ? (double)(top_channel(&want, plane, p) == top_channel(&got, plane, p)) / plane : 0;
        }
        print_message("%s: mean %s %.5f\n", files[i], i ? "share of equal labels" : "cosine", near);
        assert_true(near > 0.98 && near < 1.0);
        free(want.d), free(got.d);
    }
    sst_image_fini(&picture);
}

/* Pixels (3, 4), (0, 0), and one whose squares pass the floats: bytes of 127 x / |x|, channels side by side. */
static void bytes_equal_hand_worked_numbers(void **state SST_UNUSED)
{
    const struct image in = { 2, 1, 3, (float[]){ 3, 0, -1e30f, 4, 0, 1e30f } };
    static const int8_t want[2][6] = { { 76, 102, 0, 0, -90, 90 }, { 6, 8, 0, 0, -127, 127 } };

    for (int with_norm = 1; with_norm >= 0; with_norm--) {
        struct ow_buf graph = { 0 }, a = { 0 }, model;
        struct sst_network *net;
        int8_t out[6];

        ow_identity_conv(&graph, 2);
        ow_attr_int(&a, "axis", 1);
        if (with_norm)
            ow_node(&graph, "LpNormalization", "blocked", "y", &a);
        else
            ow_node(&graph, "Identity", "blocked", "y", NULL);
        ow_value(&graph, 11, "x", 2);
        ow_value(&graph, 12, "y", 2);
        model = ow_model(&graph, 13);
        assert_int_equal(open_model(&net, &model, 1), 0);
        assert_int_equal(sst_network_run_s8(net, in.d, 3, 1, with_norm ? 127 : 2, out), 0);
        assert_memory_equal(out, want[!with_norm], sizeof(out));
        sst_network_close(net);
        free(a.p);
    }
}

static void impossible_sizes_are_refused(void **state SST_UNUSED)
{
    const struct conv c = { 3, 3, { 5, 5 }, { 1, 1 }, { 1, 1 }, { 0, 0, 0, 0 }, 1 };
    float *w = random_floats(3 * 75);
    struct ow_buf graph = { 0 }, model;
    struct sst_network *net;
    int a = -1, b = -1, d = -1;

    ow_floats(&graph, "w", w, 3, 3, 5, 5);
    ow_conv(&graph, &c, "x w", "y");
    ow_value(&graph, 11, "x", 3);
    ow_value(&graph, 12, "y", 3);
    model = ow_model(&graph, 11);
    assert_int_equal(open_model(&net, &model, 1), 0);
    sst_log_set_level(SST_LOG_ERROR);
    assert_int_equal(sst_network_out_shape(net, 4, 100, &a, &b, &d), -EINVAL);
    assert_int_equal(sst_network_out_shape(net, 0, 5, &a, &b, &d), -EINVAL);
    assert_int_equal(sst_network_out_shape(net, 1 << 20, 1 << 20, &a, &b, &d), -EINVAL);
    assert_true(a == -1 && b == -1 && d == -1);
    assert_int_equal(sst_network_out_shape(net, 5, 6, &a, &b, &d), 0);
    assert_true(a == 3 && b == 1 && d == 2);
    sst_network_close(net);
    free(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(convolutions_equal_plain_loops),
        cmocka_unit_test(convolutions_do_not_depend_on_threads),
        cmocka_unit_test(residual_blocks_equal_plain_loops),
        cmocka_unit_test(shared_values_are_kept),
        cmocka_unit_test(padding_is_joined_with_the_convolution),
        cmocka_unit_test(pools_equal_plain_loops),
        cmocka_unit_test(adaptive_pools_equal_hand_worked_bins),
        cmocka_unit_test(adaptive_pools_work_in_every_layout),
        cmocka_unit_test(resize_samples_where_the_standard_says),
        cmocka_unit_test(resize_like_takes_the_size_of_another_value),
        cmocka_unit_test(softmax_is_over_channels),
        cmocka_unit_test(normalisation_is_recognised_in_all_its_forms),
        cmocka_unit_test(both_runners_agree_at_any_size),
        cmocka_unit_test(eight_bits_equal_hand_worked_numbers),
        cmocka_unit_test(eight_bits_stay_near_floats_in_branches),
        cmocka_unit_test(ranges_that_do_not_fit_are_refused),
        cmocka_unit_test(shipped_networks_keep_their_results),
        cmocka_unit_test(bytes_equal_hand_worked_numbers),
        cmocka_unit_test(impossible_sizes_are_refused),
    };

    if (!WITH_DNNL) {
        puts("built without oneDNN");
        return 77;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
