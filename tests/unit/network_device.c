/* Networks on the dummy device: results against those of the CPU, what ends on the CPU, memory, faults. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/log.h"
#include "tests/device_nets.h"
#include "tests/self_tests.h"
#include "tests/small.h"

static struct sst_runner_user *open_device(const char *name, uint64_t memory_bytes)
{
    struct sst_runner_user *d;

    assert_int_equal(sst_network_device_open(&d, name, memory_bytes), 0);
    assert_non_null(d);
    return d;
}

static struct sst_network_device_report report_of(struct sst_runner_user *d)
{
    struct sst_network_device_report r;

    sst_network_device_get_report(d, &r);
    return r;
}

static void convolutions_equal_the_cpu(void **state SST_UNUSED)
{
    static const struct conv convs[] = {
        { 3, 16, { 3, 3 }, { 2, 2 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 },
        { 5, 7, { 1, 1 }, { 1, 1 }, { 1, 1 }, { 0, 0, 0, 0 }, 1 },
        { 16, 33, { 3, 5 }, { 1, 2 }, { 2, 1 }, { 2, 0, 1, 3 }, 1 },
    };
    struct sst_runner_user *d = open_device("dummy", 0);

    for (size_t i = 0; i < ARRAY_LEN(convs); i++) {
        struct ow_buf graph = { 0 }, model;
        struct image in = random_image(convs[i].ic, 11, 14), got, want;

        nets_add_conv(&graph, "c", &convs[i], "x", "y");
        model = nets_finish(&graph, convs[i].ic, convs[i].oc, NULL);
        want = nets_run(&model, &in, SST_PRECISION_F32, NULL);
        got = nets_run(&model, &in, SST_PRECISION_F32, d);
        expect_image(&got, &want, 1e-5);
        free(model.p), free(in.d), free(got.d), free(want.d);
    }
    assert_int_equal(report_of(d).runs, ARRAY_LEN(convs));
    assert_int_equal(report_of(d).on_cpu, 0);
    sst_network_device_close(d);
}

static void a_pyramid_equals_the_cpu(void **state SST_UNUSED)
{
    struct sst_runner_user *d = open_device("dummy", 0);

    for (int int8 = 0; int8 < 2; int8++) {
        const enum sst_precision precision = int8 ? SST_PRECISION_INT8 : SST_PRECISION_F32;
        struct ow_buf model = nets_pyramid(nets_pyramid_ranges);
        struct image in = random_image(3, 22, 30), got = nets_run(&model, &in, precision, d);
        struct image want = nets_run(&model, &in, precision, NULL);

        nets_expect(&got, &want, int8);
        free(model.p), free(in.d), free(got.d), free(want.d);
    }
    assert_int_equal(report_of(d).runs, 2);
    assert_int_equal(report_of(d).on_cpu, 0);
    assert_int_equal(report_of(d).plans, 2);
    sst_network_device_clear_report(d);
    assert_int_equal(report_of(d).runs, 0);
    assert_string_equal(report_of(d).step.name, "dummy");
    assert_int_equal(report_of(d).plans, 2);
    sst_network_device_close(d);
}

/* Values that may be negative, into a convolution, a residual and a concatenation: without VNNI their weights are even,
 * of others 7 bits. */
static void signed_values_equal_the_cpu(void **state SST_UNUSED)
{
    const struct conv c1 = { 3, 16, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    const struct conv c2 = { 16, 24, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    const struct conv c3 = { 24, 24, { 5, 5 }, { 2, 2 }, { 1, 1 }, { 2, 2, 2, 2 }, 1 };
    const struct conv c4 = { 24, 24, { 1, 1 }, { 1, 1 }, { 1, 1 }, { 0, 0, 0, 0 }, 1 };
    const struct conv c5 = { 48, 9, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    struct sst_runner_user *d = open_device("dummy", 0);
    struct ow_buf graph = { 0 }, a = { 0 }, model;
    struct image in = random_image(3, 22, 30), got, want;

    nets_add_conv(&graph, "c1", &c1, "x", "a");
    nets_add_conv(&graph, "c2", &c2, "a", "b");
    nets_add_conv(&graph, "c3", &c3, "b", "c");
    nets_add_conv(&graph, "c4", &c4, "c", "e");
    ow_node(&graph, "Add", "e c", "f", NULL);
    ow_node(&graph, "Relu", "f", "g", NULL);
    ow_attr_int(&a, "axis", 1);
    ow_node(&graph, "Concat", "c g", "h", &a);
    nets_add_conv(&graph, "c5", &c5, "h", "y");
    model = nets_finish(&graph, 3, 9, "1 x\n5 a\n5 b\n5 c\n5 e\n5 f\n5 g\n5 h\n5 y\n");
    want = nets_run(&model, &in, SST_PRECISION_INT8, NULL);
    got = nets_run(&model, &in, SST_PRECISION_INT8, d);
    nets_expect(&got, &want, true);
    assert_int_equal(report_of(d).runs, 1);
    free(model.p), free(in.d), free(got.d), free(want.d);
    sst_network_device_close(d);
}

static void features_equal_the_cpu(void **state SST_UNUSED)
{
    struct sst_runner_user *d = open_device("dummy", 0);

    for (int int8 = 0; int8 < 2; int8++)
        nets_expect_features(d, int8 ? SST_PRECISION_INT8 : SST_PRECISION_F32);
    assert_int_equal(report_of(d).runs, 2);
    assert_int_equal(report_of(d).on_cpu, 0);
    sst_network_device_close(d);
}

/* A float result of vectors of length 1 has no shader. */
static void float_features_are_the_cpus(void **state SST_UNUSED)
{
    struct sst_runner_user *d = open_device("dummy", 0);
    struct ow_buf model = nets_matching(NULL);
    struct image in = random_image(1, 9, 12), got = nets_run(&model, &in, SST_PRECISION_F32, d);
    struct image want = nets_run(&model, &in, SST_PRECISION_F32, NULL);

    expect_image(&got, &want, 0);
    assert_int_equal(report_of(d).runs, 0);
    assert_int_equal(report_of(d).on_cpu, 1);
    assert_contains(report_of(d).step.why, "in floats");
    free(model.p), free(in.d), free(got.d), free(want.d);
    sst_network_device_close(d);
}

/* --- variants ----------------------------------------------------------------------------------------------------- */

/* The pyramid on 8 bits. @param conv8  out: shader of its convolutions */
static struct image run_variant(const char *device, char conv8[32])
{
    struct sst_runner_user *d = open_device(device, 0);
    struct ow_buf model = nets_pyramid(nets_pyramid_ranges);
    struct image in = random_image(3, 22, 30), got = nets_run(&model, &in, SST_PRECISION_INT8, d);

    snprintf(conv8, 32, "%s", report_of(d).conv8);
    free(model.p), free(in.d);
    sst_network_device_close(d);
    return got;
}

static bool opens(const char *name)
{
    struct sst_runner_user *d;

    if (sst_network_device_open(&d, name, 0))
        return false;
    sst_network_device_close(d);
    return true;
}

/* The fastest variant is used; where it is refused, the next one, with the same bytes. */
static void variants_are_chosen(void **state SST_UNUSED)
{
    const int tests = self_tests(opens); /* dispatches of a comparison, with the shader itself and with each variant */
    const struct {
        const char *device;
        int wrong; /* 0: none */
        const char *conv8;
    } cases[] = {
        { "dummy", 0, "net_conv8" },
        { "dummy:dot=1", 0, "net_conv8_dot" },
        { "dummy:dot=2", 0, "net_conv8" },
        { "dummy:dot=1,matrix=1", 0, "net_conv8_matrix" },
        { "dummy:dot=1,matrix=1", 2 * tests, "net_conv8_matrix" },
        { "dummy:dot=1,matrix=1", 3 * tests, "net_conv8_dot" },
        { "dummy:dot=1", 2 * tests, "net_conv8" },
    };
    struct image want = run_variant("dummy", (char[32]){ 0 });

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        char conv8[32] = "", name[64];
        struct image got;

        snprintf(name, sizeof(name), cases[i].wrong ? "%s,wrong=%d" : "%s", cases[i].device, cases[i].wrong);
        got = run_variant(name, conv8);
        assert_string_equal(conv8, cases[i].conv8);
        expect_image(&got, &want, 0);
        free(got.d);
    }
    free(want.d);
}

/* --- what has no shader ------------------------------------------------------------------------------------------- */

static struct ow_buf pooled(void)
{
    const struct conv c = { 3, 8, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    struct ow_buf graph = { 0 }, a = { 0 };

    nets_add_conv(&graph, "c", &c, "x", "a");
    ow_attr_ints(&a, "kernel_shape", 2, 2, 2);
    ow_node(&graph, "MaxPool", "a", "y", &a);
    return nets_finish(&graph, 3, 8, NULL);
}

static struct ow_buf grouped(void)
{
    const struct conv c = { 4, 8, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 2 };
    struct ow_buf graph = { 0 };

    nets_add_conv(&graph, "c", &c, "x", "y");
    return nets_finish(&graph, 4, 8, NULL);
}

static struct ow_buf softened(void)
{
    const struct conv c = { 3, 8, { 3, 3 }, { 1, 1 }, { 1, 1 }, { 1, 1, 1, 1 }, 1 };
    struct ow_buf graph = { 0 }, a = { 0 };

    nets_add_conv(&graph, "c", &c, "x", "a");
    ow_attr_int(&a, "axis", 1);
    ow_node(&graph, "Softmax", "a", "y", &a);
    return nets_finish(&graph, 3, 8, NULL);
}

/* Channels of a concatenation that do not begin at a multiple of 4. */
static struct ow_buf joined(void)
{
    const struct conv c = { 3, 5, { 1, 1 }, { 1, 1 }, { 1, 1 }, { 0, 0, 0, 0 }, 1 };
    struct ow_buf graph = { 0 }, a = { 0 };

    nets_add_conv(&graph, "c", &c, "x", "a");
    nets_add_conv(&graph, "d", &c, "x", "b");
    ow_attr_int(&a, "axis", 1);
    ow_node(&graph, "Concat", "a b", "y", &a);
    return nets_finish(&graph, 3, 10, NULL);
}

static void other_layers_end_on_the_cpu(void **state SST_UNUSED)
{
    struct sst_runner_user *d = open_device("dummy", 0);
    struct ow_buf models[] = { pooled(), grouped(), softened(), joined() };
    static const char *const why[] = { "MaxPool", "groups", "Softmax", "multiple of 4" };

    for (size_t i = 0; i < ARRAY_LEN(models); i++) {
        struct image in = random_image(i == 1 ? 4 : 3, 8, 10), got = nets_run(&models[i], &in, SST_PRECISION_F32, d);
        struct image want = nets_run(&models[i], &in, SST_PRECISION_F32, NULL);

        expect_image(&got, &want, 0);
        assert_int_equal(report_of(d).on_cpu, (int)i + 1);
        assert_contains(report_of(d).step.why, why[i]);
        free(models[i].p), free(in.d), free(got.d), free(want.d);
    }
    assert_int_equal(report_of(d).runs, 0);
    assert_int_equal(report_of(d).step.failures, 0);
    assert_int_equal(report_of(d).plans, 0);
    sst_network_device_close(d);
}

/* --- memory ------------------------------------------------------------------------------------------------------- */

/* Sizes give way to each other; one that is too large is the CPU's, and the device stays. */
static void memory_is_bounded(void **state SST_UNUSED)
{
    struct sst_runner_user *d = open_device("dummy", 400000);
    struct ow_buf model = nets_pyramid(NULL);
    static const int sizes[][2] = { { 22, 30 }, { 30, 22 }, { 80, 100 }, { 22, 30 } };
    struct sst_network *net;

    assert_int_equal(open_model(&net, &model, 1), 0);
    for (size_t i = 0; i < ARRAY_LEN(sizes); i++) {
        struct image in = random_image(3, sizes[i][0], sizes[i][1]), got, want;

        sst_network_use_runner(net, d);
        got = run_net(net, &in);
        sst_network_use_runner(net, NULL);
        want = run_net(net, &in);
        expect_image(&got, &want, 1e-5);
        assert_true(report_of(d).memory_bytes <= 400000);
        free(in.d), free(got.d), free(want.d);
    }
    assert_int_equal(report_of(d).runs, 3);
    assert_int_equal(report_of(d).on_cpu, 1);
    assert_int_equal(report_of(d).step.failures, 0);
    assert_contains(report_of(d).step.why, "100 x 80 pixels does not fit");
    sst_network_close(net);
    sst_network_device_close(d);
}

/* More sizes than are kept. */
static void plans_are_bounded(void **state SST_UNUSED)
{
    struct sst_runner_user *d = open_device("dummy", 0);
    struct ow_buf model = nets_pyramid(NULL);
    struct sst_network *net;

    assert_int_equal(open_model(&net, &model, 1), 0);
    sst_network_use_runner(net, d);
    for (int i = 0; i < 20; i++) {
        struct image in = random_image(3, 8, 8 + i), got = run_net(net, &in);

        free(in.d), free(got.d);
    }
    assert_int_equal(report_of(d).runs, 20);
    assert_int_equal(report_of(d).plans, 16);
    sst_network_close(net);
    sst_network_device_close(d);
}

/* A network of one layer: of the same layers each time, and of other weights. */
static struct ow_buf one_layer(void)
{
    const struct conv c = { 3, 8, { 1, 1 }, { 1, 1 }, { 1, 1 }, { 0, 0, 0, 0 }, 1 };
    struct ow_buf graph = { 0 };

    nets_add_conv(&graph, "c", &c, "x", "y");
    return nets_finish(&graph, 3, 8, NULL);
}

static void write_model(const char *path, const struct ow_buf *model)
{
    FILE *f = fopen(path, "w");

    assert_non_null(f);
    assert_int_equal(fwrite(model->p, 1, model->n, f), model->n);
    assert_int_equal(fclose(f), 0);
}

/* Networks of one file have one plan there; one of other weights at the same path has its own. */
static void plans_are_shared(void **state SST_UNUSED)
{
    struct sst_runner_user *d = open_device("dummy", 0);
    struct ow_buf models[] = { one_layer(), one_layer() };
    struct sst_network *net[3];
    struct image in = random_image(3, 12, 16), out[3];
    char path[] = "/tmp/sst-network-XXXXXX";
    const int fd = mkstemp(path);

    assert_true(fd >= 0);
    close(fd);
    for (int i = 0; i < 3; i++) {
        write_model(path, &models[i / 2]);
        assert_int_equal(sst_network_open(&net[i], path, SST_PRECISION_F32, 1), 0);
        sst_network_use_runner(net[i], d);
        out[i] = run_net(net[i], &in);
    }
    unlink(path);
    expect_image(&out[0], &out[1], 0);
    assert_true(nets_apart(&out[2], &out[0], 1e-5) > 0.5);
    assert_int_equal(report_of(d).runs, 3);
    assert_int_equal(report_of(d).plans, 2);
    for (int i = 0; i < 3; i++) {
        sst_network_close(net[i]);
        free(out[i].d);
    }
    free(in.d), free(models[0].p), free(models[1].p);
    sst_network_device_close(d);
}

/* --- faults ------------------------------------------------------------------------------------------------------- */

/* Run the pyramid `runs` times on a device. */
static struct sst_network_device_report run_often(const char *name, int runs)
{
    struct ow_buf model = nets_pyramid(NULL);
    struct image in = random_image(3, 8, 10), want = nets_run(&model, &in, SST_PRECISION_F32, NULL);
    struct sst_network_device_report r = { 0 };
    struct sst_runner_user *d;

    if (!sst_network_device_open(&d, name, 0)) {
        for (int k = 0; k < runs; k++) {
            struct image got = nets_run(&model, &in, SST_PRECISION_F32, d);

            expect_image(&got, &want, 1e-5);
            free(got.d);
        }
        r = report_of(d);
        sst_network_device_close(d);
    }
    free(model.p), free(in.d), free(want.d);
    return r;
}

/* Runs that fail end on the CPU with its result; the device is tried again at once, and after 1, 3 ... runs where it
 * failed before. */
static void faults_end_on_the_cpu(void **state SST_UNUSED)
{
    static const char *const faults[][2] = { { "lost", "lost" }, { "timeout", "answer" } };
    const long run = (long)run_often("dummy", 1).step.dispatches;
    struct sst_network_device_report r;
    char text[SST_LOG_MAX], name[40];
    long first = self_tests(opens); /* the dispatch after those of the opening and of one run */

    sst_log_hold_errors(text);
    do
        snprintf(name, sizeof(name), "dummy:lost=%ld", ++first);
    while (run_often(name, 1).runs == 0);
    for (size_t i = 0; i < ARRAY_LEN(faults); i++) {
        snprintf(name, sizeof(name), "dummy:%s=%ld", faults[i][0], first + run / 2);
        r = run_often(name, 9); /* each device runs once, and fails in its second run */
        assert_int_equal(r.runs, 5);
        assert_int_equal(r.on_cpu, 4);
        assert_int_equal(r.step.failures, 4);
        assert_contains(r.step.why, faults[i][1]);
        snprintf(name, sizeof(name), "dummy:%s=%ld", faults[i][0], first - run / 2);
        r = run_often(name, 9); /* it fails in its first run: fails, fails, skipped, fails, 3 skipped, fails, skipped */
        assert_int_equal(r.runs, 0);
        assert_int_equal(r.on_cpu, 9);
        assert_int_equal(r.step.failures, 4);
    }
    sst_log_hold_errors(NULL);
}

static void wrong_devices_are_refused(void **state SST_UNUSED)
{
    struct sst_runner_user *d;
    char text[SST_LOG_MAX];

    sst_log_set_level(SST_LOG_ERROR);
    sst_log_hold_errors(text);
    assert_int_equal(sst_network_device_open(&d, "dummy:wrong=1", 0), -ENOTSUP);
    assert_contains(text, "cannot run networks");
    assert_int_equal(sst_network_device_open(&d, "no such device", 0), -ENOENT);
    sst_log_hold_errors(NULL);
    sst_log_set_level(SST_LOG_WARNING);
    assert_int_equal(sst_network_device_open(&d, "cpu", 0), 0);
    assert_null(d);
    sst_network_device_close(d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(convolutions_equal_the_cpu),
        cmocka_unit_test(a_pyramid_equals_the_cpu),
        cmocka_unit_test(signed_values_equal_the_cpu),
        cmocka_unit_test(features_equal_the_cpu),
        cmocka_unit_test(float_features_are_the_cpus),
        serial_test(variants_are_chosen),
        cmocka_unit_test(other_layers_end_on_the_cpu),
        cmocka_unit_test(memory_is_bounded),
        cmocka_unit_test(plans_are_bounded),
        cmocka_unit_test(plans_are_shared),
        serial_test(faults_end_on_the_cpu),
        cmocka_unit_test(wrong_devices_are_refused),
    };

    if (!WITH_DNNL) {
        print_message("built without oneDNN: no network runs on a device\n");
        return 77;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
