/* Networks on the dummy device: results against those of the CPU, what ends on the CPU, memory, faults. */
#include "base/log.h"
#include "tests/device_nets.h"
#include "tests/small.h"

static struct sst_network_device *open_device(const char *name, uint64_t memory_bytes)
{
    struct sst_network_device *d;

    assert_int_equal(sst_network_device_open(&d, name, memory_bytes), 0);
    assert_non_null(d);
    return d;
}

static struct sst_network_device_report report_of(struct sst_network_device *d)
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
    struct sst_network_device *d = open_device("dummy", 0);

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
    struct sst_network_device *d = open_device("dummy", 0);

    for (int int8 = 0; int8 < 2; int8++) {
        const enum sst_precision precision = int8 ? SST_PRECISION_INT8 : SST_PRECISION_F32;
        struct ow_buf model = nets_pyramid(nets_pyramid_ranges);
        struct image in = random_image(3, 22, 30), got = nets_run(&model, &in, precision, d);
        struct image want = nets_run(&model, &in, precision, NULL);

        print_message("%s: %.5f of the results differ by more than 1e-5\n", int8 ? "int8" : "f32",
                      nets_apart(&got, &want, 1e-5));
        assert_true(nets_apart(&got, &want, 1e-5) <= (int8 ? 0.01 : 0));
        free(model.p), free(in.d), free(got.d), free(want.d);
    }
    print_message("%s\n", report_of(d).why);
    assert_int_equal(report_of(d).runs, 2);
    assert_int_equal(report_of(d).on_cpu, 0);
    sst_network_device_close(d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(convolutions_equal_the_cpu),
        cmocka_unit_test(a_pyramid_equals_the_cpu),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
