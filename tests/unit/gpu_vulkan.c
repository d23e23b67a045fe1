/* The Vulkan back end on Mesa's software device, lavapipe, under the validation layers where they are installed.
 * Without lavapipe it fails: a build with shaders whose shaders nobody runs is not tested. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <errno.h>
#include <fenv.h>
#include <glob.h>
#include <unistd.h>

#include "base/log.h"
#include "pipeline/gpu/blend.h"
#include "pipeline/gpu/clear.h"
#include "tests/device_nets.h"
#include "tests/frames_field.h"
#include "tests/gpu_field.h"
#include "tests/match_field.h"
#include "tests/match_network.h"
#include "tests/second_field.h"
#include "tests/small.h"

#define DRIVERS "/usr/share/vulkan/icd.d/lvp_icd*.json"
#define LAYERS  "/usr/share/vulkan/explicit_layer.d/VkLayer_khronos_validation.json"

/* Listed, but never chosen except by name. */
static void test_choice(void **state)
{
    struct sst_gpu_info info[SST_GPU_DEVICES];
    char text[SST_LOG_MAX];
    struct sst_gpu *g;

    (void)state;
    assert_int_equal(sst_gpu_list(info), 1);
    assert_contains(info[0].name, "llvmpipe");
    assert_contains(info[0].driver, "lavapipe");
    assert_int_equal(info[0].kind, SST_GPU_SOFTWARE);
    sst_log_hold_errors(text);
    assert_int_equal(sst_gpu_open(&g, "gpu", NULL), -ENOENT);
    assert_contains(text, "software devices are used only by name: `llvmpipe");
    *text = 0;
    assert_int_equal(sst_gpu_open(&g, "auto", NULL), -ENOENT);
    assert_string_equal(text, "");
    assert_int_equal(sst_gpu_open(&g, "GeForce", NULL), -ENOENT);
    sst_log_hold_errors(NULL);
    assert_int_equal(sst_gpu_open(&g, "LLVMpipe", NULL), 0);
    sst_gpu_close(g);
}

/* Every shader gives what its reference gives. */
static void test_self(void **state)
{
    struct sst_gpu *g;

    (void)state;
    assert_int_equal(sst_gpu_open(&g, "lavapipe", &(struct sst_gpu_config){ .test_again = true }), 0);
    for (int i = 0; i < SST_GPU_SHADERS; i++) {
        const bool can = sst_gpu_can(sst_gpu_get_info(g), (enum sst_gpu_shader)i);

        if (!can)
            print_message("not on this device: %s\n", sst_gpu_shader_name((enum sst_gpu_shader)i));
        assert_int_equal(sst_gpu_prepare(g, (enum sst_gpu_shader)i), can ? 0 : -ENOTSUP);
        assert_true(can || (sst_gpu_is_variant((enum sst_gpu_shader)i) &&
                            i != SST_GPU_NET_CONV8_DOT)); /* which Mesa 22 does not have */
    }
    sst_gpu_close(g);
}

/* More than the staging memory holds, at odd places, in the order of the calls. */
static void test_transfer(void **state)
{
    const size_t bytes = ((size_t)40 << 20) + 5;
    struct sst_gpu_buffer *a, *b;
    struct sst_gpu_span *span;
    uint8_t *data = malloc(bytes), *back = calloc(1, bytes);
    struct sst_gpu *g;

    (void)state;
    for (size_t i = 0; i < bytes; i++)
        data[i] = (uint8_t)(i * 2654435761U >> 13);
    assert_int_equal(sst_gpu_open(&g, "lavapipe", NULL), 0);
    assert_int_equal(sst_gpu_buffer_create(g, &a, bytes), 0);
    assert_int_equal(sst_gpu_buffer_create(g, &b, 7), 0);
    assert_int_equal(sst_gpu_upload(g, a, 0, data, bytes), 0);
    assert_int_equal(sst_gpu_upload(g, b, 0, data, 7), 0);
    assert_int_equal(sst_gpu_upload(g, a, bytes - 3, "abc", 3), 0);
    assert_int_equal(sst_gpu_upload(g, b, 1, "de", 2), 0);
    assert_int_equal(sst_gpu_download(g, back, a, 0, bytes), 0);
    memcpy(data + bytes - 3, "abc", 3);
    assert_memory_equal(back, data, bytes);
    assert_int_equal(sst_gpu_download(g, back, b, 1, 3), 0);
    assert_memory_equal(back, ((uint8_t[]){ 'd', 'e', data[3] }), 3);
    /* a span of mapped memory, written again after a wait */
    assert_int_equal(sst_gpu_span_create(g, &span, 64), 0);
    memcpy(sst_gpu_span_data(span), data, 64);
    assert_int_equal(sst_gpu_upload_span(g, a, 4096, span, 16, 48), 0);
    assert_int_equal(sst_gpu_wait(g), 0);
    memset(sst_gpu_span_data(span), 7, 8);
    assert_int_equal(sst_gpu_upload_span(g, a, 4100, span, 4, 4), 0);
    assert_int_equal(sst_gpu_download(g, back, a, 4092, 56), 0);
    memcpy(data + 4096, data + 16, 48);
    memset(data + 4100, 7, 4);
    assert_memory_equal(back, data + 4092, 52);
    sst_gpu_span_destroy(g, span);
    sst_gpu_span_destroy(g, NULL);
    /* between buffers, and within one */
    assert_int_equal(sst_gpu_copy(g, b, 0, a, 4096, 4), 0);
    assert_int_equal(sst_gpu_copy(g, a, 0, a, 4096, 64), 0);
    assert_int_equal(sst_gpu_download(g, back, b, 0, 4), 0);
    assert_int_equal(sst_gpu_download(g, back + 4, a, 0, 64), 0);
    assert_memory_equal(back, data + 4096, 4);
    assert_memory_equal(back + 4, data + 4096, 64);
    sst_gpu_buffer_destroy(g, a);
    sst_gpu_buffer_destroy(g, b);
    assert_int_equal(sst_gpu_wait(g), 0); /* -EIO if a validation layer has found a fault */
    sst_gpu_close(g);
    free(data);
    free(back);
}

static void test_pictures(void **state)
{
    const uint64_t memory[] = { 0,
                                (uint64_t)560 << 10 }; /* all views, or a few at a time and bands of clear pictures */
    struct sst_render_device_report report;
    struct sst_lightfield lf;

    (void)state;
    field_init(&lf);
    for (size_t i = 0; i < ARRAY_LEN(memory); i++) {
        const int most = field_compare(&lf, "lavapipe", memory[i], &report);

        print_message("worst difference to the CPU: %d levels\n", most);
        assert_in_range(most, 0, SST_GPU_BLEND_LEVELS);
        assert_int_equal(report.pictures, FIELD_PICTURES);
        assert_int_equal(report.in_parts, i ? FIELD_CLEAR : 0);
        assert_int_equal(report.verified_on_cpu,
                         i ? 2 : 1); /* where weights underflow; what all views are needed for */
        assert_int_equal(report.failures, 0);
    }
    field_fini(&lf);
}

/* Raw frames are rectified there with the bytes of the CPU, and sampled between pixels. */
static void test_frames(void **state)
{
    struct sst_render_device_report report;
    struct raw_field field;

    (void)state;
    assert_int_equal(frames_make(&field), 0);
    assert_int_equal(frames_compare(&field, false, "lavapipe", 0, SST_GPU_BLEND_LEVELS, &report), 0);
    assert_int_equal(report.pictures, FRAMES_PICTURES - 1);
    assert_int_equal(report.rectified, 6);
    assert_int_equal(report.failures, 0);
    assert_in_range(frames_compare(&field, true, "lavapipe", 0, SST_GPU_BLEND_LEVELS, &report), 0,
                    FRAMES_PICTURES * FRAMES_WIDTH * FRAMES_HEIGHT / 1000);
    assert_int_equal(report.pictures, FRAMES_PICTURES);
    assert_int_equal(report.failures, 0);
    raw_field_free(&field);
}

/* Clear pictures in bands, their rays sampled from frames of which one at a time is there; where lenses fold, places
 * are listed, and some differ. */
static void test_frames_in_bands(void **state)
{
    struct sst_render_config cfg = frames_config(FRAMES_CLEAR);
    struct raw_field field;

    (void)state;
    assert_int_equal(frames_make(&field), 0);
    for (int folds = 0; folds < 2; folds++) {
        struct sst_render_device_report report;
        struct frames_picture want, got;
        struct sst_renderer *cpu, *gpu;
        int differ;

        for (int k = 0; k < field.raw.rows * field.raw.cols && folds; k++)
            field.raw.calibration->camera[k].k[0] = -0.35;
        field.raw.rectified->focal_px *= folds ? 0.3 : 1;
        assert_int_equal(sst_renderer_create(&cpu, &field.raw, 2), 0);
        assert_int_equal(sst_renderer_create(&gpu, &field.raw, 2), 0);
        assert_int_equal(sst_renderer_use_device(gpu, "lavapipe", (uint64_t)1000 << 10), 0);
        want = frames_render(cpu, &field.raw, &cfg);
        got = frames_render(gpu, &field.raw, &cfg);
        differ = frames_count(&want, &got, SST_GPU_CLEAR_LEVELS);
        print_message("%s: %d pixels differ\n", folds ? "lenses fold" : "lenses do not fold", differ);
        assert_in_range(differ, 0, folds ? FRAMES_WIDTH * FRAMES_HEIGHT / 500 : 0);
        assert_true(sst_renderer_device(gpu, &report));
        assert_int_equal(report.in_parts, 1);
        assert_int_equal(report.filled_on_cpu, 0);
        frames_free(&want);
        frames_free(&got);
        sst_renderer_destroy(cpu);
        sst_renderer_destroy(gpu);
    }
    raw_field_free(&field);
}

/* Views are matched with the bytes of the CPU, in the whole range and tile by tile. */
static void test_matches(void **state)
{
    static const int configs[] = { 1, 3, 4, 5 }; /* tests/system/gpu.sh has the presets preview and accurate */
    struct sst_step_report report;
    struct sst_runner_user *device;
    struct sst_disparity_config cfg;
    struct sst_lightfield lf;

    (void)state;
    assert_int_equal(match_device_create(&device, "lavapipe", 0), 0);
    match_init(&lf, 2, 2, 73, 44, 8);
    for (size_t i = 0; i < ARRAY_LEN(configs); i++) {
        assert_true(match_config(&cfg, configs[i]));
        cfg.runner = device;
        match_compare(&lf, &cfg, &report);
        assert_true(report.items[SST_DISPARITY_MATCHED].device >= 3);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu, 0);
        assert_int_equal(report.failures, 0);
        assert_int_equal(report.stages_on_cpu & ~(1U << SST_DISPARITY_STAGE_SWEEP), 0);
        /* Colours, once; later steps need no more, but what a sweep in scene space makes on the CPU. */
        assert_int_equal(report.uploads, report.stages_on_cpu ? 9 : 3);
    }
    sst_lightfield_fini(&lf);
    match_init(&lf, 1, 3, 230, 192, 21);
    match_config_tiles(&cfg);
    cfg.runner = device;
    match_compare(&lf, &cfg, &report);
    assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu, 0);
    sst_lightfield_fini(&lf);
    match_device_destroy(device);
    match_init(&lf, 1, 3, 97, 60, 8); /* in bands of rows */
    assert_true(match_config(&cfg, 5));
    assert_int_equal(match_device_create(&cfg.runner, "lavapipe", (uint64_t)1350 << 10), 0);
    match_compare(&lf, &cfg, &report);
    assert_int_equal(report.items[SST_DISPARITY_MATCHED].in_bands, 3);
    assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu, 0);
    match_device_destroy(cfg.runner);
    sst_lightfield_fini(&lf);
}

/* The learned cost, whose features any network may give. */
static void test_learned(void **state)
{
    char path[] = "/tmp/sst-learned-XXXXXX";
    struct sst_step_report report;
    struct sst_disparity_config cfg;
    struct sst_lightfield lf;

    (void)state;
    if (!WITH_DNNL && !WITH_OPENCV) {
        print_message("this build runs no networks\n");
        skip();
    }
    ow_feature_network(path, "1");
    match_init(&lf, 2, 2, 97, 60, 8);
    for (int i = 0; match_config_learned(&cfg, i, path); i++) {
        assert_int_equal(match_device_create(&cfg.runner, "lavapipe", 0), 0);
        match_compare(&lf, &cfg, &report);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].device, 3);
        assert_int_equal(report.items[SST_DISPARITY_MATCHED].on_cpu, 0);
        match_device_destroy(cfg.runner);
    }
    sst_lightfield_fini(&lf);
    unlink(path);
}

/* The second pass and carried maps, where a sweep finds surfaces that no map has. */
static void test_second(void **state)
{
    struct sst_step_report report;
    struct sst_runner_user *device;

    (void)state;
    assert_int_equal(match_device_create(&device, "lavapipe", 0), 0);
    for (int skip = 0; skip < 2; skip++) {
        second_compare(device, skip, &report);
        assert_int_equal(report.items[SST_DISPARITY_TESTED].device, SECOND_TESTED);
        assert_int_equal(report.stages_on_cpu, 0);
        assert_int_equal(report.failures, 0);
    }
    match_device_destroy(device);
}

/* Networks in floats and on 8 bits. */
static void test_networks(void **state)
{
    struct ow_buf model = nets_pyramid(nets_pyramid_ranges);
    struct sst_network_device_report report;
    struct sst_runner_user *d;

    (void)state;
    if (!WITH_DNNL) {
        free(model.p);
        print_message("built without oneDNN: no network runs on a device\n");
        skip();
    }
    assert_int_equal(sst_network_device_open(&d, "lavapipe", 0), 0);
    for (int int8 = 0; int8 < 2; int8++) {
        const enum sst_precision precision = int8 ? SST_PRECISION_INT8 : SST_PRECISION_F32;
        struct image in = random_image(3, 33, 46), got = nets_run(&model, &in, precision, d);
        struct image want = nets_run(&model, &in, precision, NULL);

        nets_expect(&got, &want, int8);
        nets_expect_features(d, precision);
        free(in.d), free(got.d), free(want.d);
    }
    sst_network_device_get_report(d, &report);
    assert_int_equal(report.runs, 4);
    assert_int_equal(report.on_cpu, 0);
    sst_network_device_close(d);
    free(model.p);
}

/* Variants of convolutions on 8 bits give the same bytes. */
static void test_variants(void **state)
{
    static const char *const names[] = { "plain", "dot", "matrix" };
    struct ow_buf model = nets_pyramid(nets_pyramid_ranges);
    struct image in = random_image(3, 41, 54), want = { 0 };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(names) && WITH_DNNL; i++) {
        struct sst_network_device_report report;
        struct sst_runner_user *d;
        struct image got;

        setenv("SST_GPU_VARIANT", names[i], 1);
        assert_int_equal(sst_network_device_open(&d, "lavapipe", 0), 0);
        got = nets_run(&model, &in, SST_PRECISION_INT8, d);
        sst_network_device_get_report(d, &report);
        print_message("%s: %s\n", names[i], report.conv8);
        assert_int_equal(report.runs, 1);
        if (i)
            expect_image(&got, &want, 0);
        if (i < 2) /* matrices: if the device has them */
            assert_string_equal(report.conv8, i ? "net_conv8_dot" : "net_conv8");
        sst_network_device_close(d);
        free(want.d);
        want = got;
    }
    unsetenv("SST_GPU_VARIANT");
    free(want.d), free(in.d), free(model.p);
}

/* A wait that ends too soon, as it does unless the machine is far faster than any: the device is lost, and what it
 * still uses is left alone. */
static void test_timeout(void **state)
{
    const size_t bytes = (size_t)30 << 20;
    const struct sst_gpu_config cfg = { .timeout_ms = 1 };
    uint8_t *data = calloc(1, bytes);
    struct sst_gpu_buffer *a;
    struct sst_gpu *g;
    int err = 0;

    (void)state;
    assert_int_equal(sst_gpu_open(&g, "lavapipe", &cfg), 0);
    assert_int_equal(sst_gpu_buffer_create(g, &a, 4 * bytes), 0);
    for (size_t i = 0; i < 40 && !err; i++)
        err = sst_gpu_upload(g, a, i % 4 * bytes, data, bytes);
    assert_true(err == 0 || err == -ETIMEDOUT);
    assert_int_equal(sst_gpu_wait(g), err);
    sst_gpu_buffer_destroy(g, a);
    sst_gpu_close(g);
    free(data);
}

/* A convolution of n inputs over 5x5 pixels, on floats, against the CPU; the report afterwards. */
static struct sst_network_device_report run_long(int n)
{
    const struct conv c1 = { 3, n, { 1, 1 }, { 1, 1 }, { 1, 1 }, { 0, 0, 0, 0 }, 1 };
    const struct conv c2 = { n, 4, { 5, 5 }, { 1, 1 }, { 1, 1 }, { 2, 2, 2, 2 }, 1 };
    struct image in = random_image(3, 4, 4), got, want;
    struct sst_network_device_report r;
    struct sst_runner_user *d;
    struct ow_buf graph = { 0 }, model;

    nets_add_conv(&graph, "c1", &c1, "x", "a");
    nets_add_conv(&graph, "c2", &c2, "a", "y");
    model = nets_finish(&graph, 3, 4, NULL);
    assert_int_equal(sst_network_device_open(&d, "lavapipe", 0), 0);
    got = nets_run(&model, &in, SST_PRECISION_F32, d);
    want = nets_run(&model, &in, SST_PRECISION_F32, NULL);
    expect_image(&got, &want, 1e-5);
    sst_network_device_get_report(d, &r);
    sst_network_device_close(d);
    free(model.p), free(in.d), free(got.d), free(want.d);
    return r;
}

/* Lavapipe leaves loops after 65,535 passes: the longest that are allowed have the CPU's results, longer ones are the
 * CPU's. */
static void test_longest(void **state SST_UNUSED)
{
    struct sst_network_device_report r = run_long(1308);

    assert_int_equal(r.runs, 1);
    r = run_long(2048);
    assert_int_equal(r.runs, 0);
    assert_contains(r.step.why, "more than 32768 numbers");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_choice),   cmocka_unit_test(test_self),     cmocka_unit_test(test_transfer),
        cmocka_unit_test(test_pictures), cmocka_unit_test(test_frames),   plain_test(test_matches),
        plain_test(test_second),         cmocka_unit_test(test_networks), cmocka_unit_test(test_variants),
        plain_test(test_learned),        cmocka_unit_test(test_timeout),  cmocka_unit_test(test_frames_in_bands),
        cmocka_unit_test(test_longest),
    };
    glob_t drivers;

    if (!WITH_VULKAN) {
        print_message("built without Vulkan\n");
        return 77;
    }
    if (glob(DRIVERS, 0, NULL, &drivers)) {
        print_message("no %s: install mesa-vulkan-drivers\n", DRIVERS);
        return 1;
    }
    /* Drivers compute with lanes that do not count: without the traps of tests/traps.h, which their threads inherit. */
    fedisableexcept(FE_ALL_EXCEPT);
    /* No other driver answers. */
    setenv("VK_DRIVER_FILES", drivers.gl_pathv[0], 1);
    setenv("VK_ICD_FILENAMES", drivers.gl_pathv[0], 1);
    globfree(&drivers);
    setenv("SST_GPU_VALIDATE", access(LAYERS, R_OK) ? "0" : "1", 1);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
