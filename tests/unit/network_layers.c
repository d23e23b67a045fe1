/* Layers of the network runner other than convolutions, against plain loops: pools, resizes, over channels. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/network_bench.h"

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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pools_equal_plain_loops),
        cmocka_unit_test(adaptive_pools_equal_hand_worked_bins),
        cmocka_unit_test(adaptive_pools_work_in_every_layout),
        cmocka_unit_test(resize_samples_where_the_standard_says),
        cmocka_unit_test(resize_like_takes_the_size_of_another_value),
        cmocka_unit_test(softmax_is_over_channels),
        cmocka_unit_test(normalisation_is_recognised_in_all_its_forms),
    };

    if (!WITH_DNNL) {
        puts("built without oneDNN");
        return 77;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
