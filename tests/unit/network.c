/* Networks as a whole: sizes, OpenCV's runner, 8 bits, shipped networks, what is refused. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/log.h"
#include "pipeline/image/codec.h"
#include "tests/network_bench.h"
#include "tests/small.h"

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

/* Weights of 3x3 in the middle of 5x5, or as they are. */
static void add_kernel(struct ow_buf *graph, const char *name, const struct conv *c)
{
    const int side = c->kernel[0], edge = (side - 3) / 2;
    float *w = calloc((size_t)(c->oc * c->ic * side * side), sizeof(*w));

    for (int i = 0; i < c->oc * c->ic * 9; i++)
        w[(i / 9 * side + i % 9 / 3 + edge) * side + i % 3 + edge] = (float)rand() / (float)RAND_MAX - 0.5f;
    ow_floats(graph, name, w, c->oc, c->ic, side, side);
    free(w);
}

/* Two layers and a residual, with kernels of `side`, dilations 1 and d. */
static struct ow_buf layers_of(int side, int d)
{
    const int pad = side / 2;
    const struct conv first = { 16, 48, { side, side }, { 1, 1 }, { 1, 1 }, { pad, pad, pad, pad }, 1 };
    const struct conv second = {
        48, 16, { side, side }, { 1, 1 }, { d, d }, { pad * d, pad * d, pad * d, pad * d }, 1
    };
    struct ow_buf graph = { 0 }, model;

    srand(7);
    ow_identity_conv(&graph, 16);
    add_kernel(&graph, "w1", &first);
    add_kernel(&graph, "w2", &second);
    ow_conv(&graph, &first, "blocked w1", "a"); /* of values with a sign */
    ow_node(&graph, "Relu", "a", "b", NULL);
    ow_conv(&graph, &second, "b w2", "c");
    ow_node(&graph, "Add", "c blocked", "d", NULL);
    ow_node(&graph, "Relu", "d", "e", NULL);
    ow_conv(&graph, &first, "e w1", "y");
    ow_value(&graph, 11, "x", 16);
    ow_value(&graph, 12, "y", 48);
    model = ow_model(&graph, 13);
    ow_metadata(&model, "sst.ranges", "1 x\n1 blocked\n20 a\n20 b\n150 c\n150 d\n150 e\n900 y\n");
    return model;
}

/* oneDNN runs kernels of 5x5; 3x3 may run by tiles, with the same sums while values keep to their ranges: then no pair
 * of products saturates. */
static void layers_of_three_are_those_of_five_with_zeros(void **state SST_UNUSED)
{
    static const int sizes[][3] = { { 1, 1, 1 }, { 5, 9, 1 }, { 24, 33, 2 }, { 13, 6, 4 } };

    for (size_t i = 0; i < ARRAY_LEN(sizes); i++) {
        struct image in = random_image(16, sizes[i][0], sizes[i][1]), got[2];

        for (int k = 0; k < 2; k++) {
            struct ow_buf model = layers_of(3 + 2 * k, sizes[i][2]);

            got[k] = run_int8(&model, &in);
            free(model.p);
        }
        assert_memory_equal(got[0].d, got[1].d, (size_t)(48 * in.h * in.w) * sizeof(float));
        free(in.d), free(got[0].d), free(got[1].d);
    }
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

    if (access(picture_file, R_OK)) {
        print_message("%s is not here\n", picture_file);
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
        assert_int_equal(
            sst_network_run_s8(net, &(struct sst_network_bytes){ in.d, 3, 1, with_norm ? 127 : 2, out, NULL }), 0);
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
    struct sst_shape out = { -1, -1, -1 };

    ow_floats(&graph, "w", w, 3, 3, 5, 5);
    ow_conv(&graph, &c, "x w", "y");
    ow_value(&graph, 11, "x", 3);
    ow_value(&graph, 12, "y", 3);
    model = ow_model(&graph, 11);
    assert_int_equal(open_model(&net, &model, 1), 0);
    sst_log_set_level(SST_LOG_ERROR);
    assert_int_equal(sst_network_out_shape(net, 4, 100, &out), -EINVAL);
    assert_int_equal(sst_network_out_shape(net, 0, 5, &out), -EINVAL);
    assert_int_equal(sst_network_out_shape(net, 1 << 20, 1 << 20, &out), -EINVAL);
    assert_true(out.c == -1 && out.w == -1 && out.h == -1);
    assert_int_equal(sst_network_out_shape(net, 5, 6, &out), 0);
    assert_true(out.c == 3 && out.w == 1 && out.h == 2);
    sst_network_close(net);
    free(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(both_runners_agree_at_any_size),
        cmocka_unit_test(eight_bits_equal_hand_worked_numbers),
        cmocka_unit_test(eight_bits_stay_near_floats_in_branches),
        cmocka_unit_test(layers_of_three_are_those_of_five_with_zeros),
        cmocka_unit_test(ranges_that_do_not_fit_are_refused),
        plain_test(shipped_networks_keep_their_results),
        cmocka_unit_test(bytes_equal_hand_worked_numbers),
        cmocka_unit_test(impossible_sizes_are_refused),
    };

    if (!WITH_DNNL) {
        puts("built without oneDNN");
        return 77;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
