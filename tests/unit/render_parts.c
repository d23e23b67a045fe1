/* Clear pictures in bands of rows, on the dummy device: the CPU's bytes, whatever fits; and what does not. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/frames_field.h"
#include "tests/gpu_field.h"
#include "tests/self_tests.h"
#include "tests/small.h"

#define FILL       18 /* dispatches that fill the holes of a picture of 301 pixels: 9 levels, there and back */
#define CLEAR (FIELD_PICTURES - FIELD_CLEAR) /* the first one */

struct seen {
    struct field_picture picture;
    struct sst_map_u16 surface;
    struct sst_map_u8 support;
};

static int merge_nothing(void *arg SST_UNUSED, struct sst_image *img SST_UNUSED, struct sst_map_u8 *weight SST_UNUSED)
{
    return 0;
}

/* @param merged  with surfaces and support */
static void render_seen(struct seen *to, struct sst_renderer *r, int picture, bool merged)
{
    struct sst_render_config cfg = field_config(picture);
    struct sst_render_merge merge = { .merge = merge_nothing, .surface = &to->surface, .support = &to->support };

    *to = (struct seen){ { { 0 } } };
    assert_int_equal(sst_image_init(&to->picture.image, FIELD_WIDTH, FIELD_HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&to->picture.valid, FIELD_WIDTH, FIELD_HEIGHT), 0);
    assert_int_equal(sst_map_u16_init(&to->surface, FIELD_WIDTH, FIELD_HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&to->support, FIELD_WIDTH, FIELD_HEIGHT), 0);
    cfg.merge = merged ? &merge : NULL;
    assert_int_equal(sst_render(r, &cfg, &to->picture.image, &to->picture.valid), 0);
}

static void free_seen(struct seen *s)
{
    field_free(&s->picture);
    sst_map_u16_fini(&s->surface);
    sst_map_u8_fini(&s->support);
}

static void assert_same(const struct seen *a, const struct seen *b)
{
    assert_int_equal(field_difference(&a->picture, &b->picture), 0);
    for (int y = 0; y < FIELD_HEIGHT; y++) {
        assert_memory_equal(sst_map_u16_row(&a->surface, y), sst_map_u16_row(&b->surface, y), 2 * FIELD_WIDTH);
        assert_memory_equal(sst_map_u8_row(&a->support, y), sst_map_u8_row(&b->support, y), FIELD_WIDTH);
    }
}

/* The clear pictures, each with and without a merge. */
static struct sst_render_device_report compare(const struct sst_lightfield *lf, const char *device, uint64_t memory)
{
    struct sst_render_device_report report;
    struct sst_renderer *cpu, *gpu;

    assert_int_equal(sst_renderer_create(&cpu, lf, 2), 0);
    assert_int_equal(sst_renderer_create(&gpu, lf, 2), 0);
    assert_int_equal(sst_renderer_use_device(gpu, device, memory), 0);
    for (int i = 0; i < 2 * FIELD_CLEAR; i++) {
        struct seen a, b;

        render_seen(&a, cpu, CLEAR + i / 2, i % 2);
        render_seen(&b, gpu, CLEAR + i / 2, i % 2);
        assert_same(&a, &b);
        free_seen(&a);
        free_seen(&b);
    }
    assert_true(sst_renderer_device(gpu, &report));
    sst_renderer_destroy(cpu);
    sst_renderer_destroy(gpu);
    return report;
}

/* From all views at once down to bands of one row, and less. */
static void test_memory(void **state)
{
    static const struct {
        uint64_t memory;
        int in_parts, on_cpu, dispatches; /* at most; 0: any number */
        int filled_on_cpu;
    } limits[] = {
        { 0, 0, 0, 4 * (2 + FILL), 0 }, { (uint64_t)1000 << 10, 4, 0, 4 * (2 * 5 + FILL), 0 },
        { 600 << 10, 4, 0, 0, 0 },      { 400 << 10, 4, 0, 0, 0 },
        { 320 << 10, 4, 0, 0, 0 },      { 100 << 10, 0, 4, 0, 0 },
    };
    struct sst_lightfield lf;

    (void)state;
    field_init(&lf);
    for (size_t i = 0; i < ARRAY_LEN(limits); i++) {
        const struct sst_render_device_report r = compare(&lf, "dummy:known=1", limits[i].memory);

        print_message("%d KiB: %d pictures, %d in parts, %d filled on the CPU, %d dispatches, %d KiB uploaded\n",
                      (int)(limits[i].memory >> 10), (int)r.pictures, (int)r.in_parts, (int)r.filled_on_cpu,
                      (int)r.dispatches, (int)(r.upload_bytes >> 10));
        assert_int_equal(r.pictures, 4 - limits[i].on_cpu);
        assert_int_equal(r.in_parts, limits[i].in_parts);
        assert_int_equal(r.on_cpu, limits[i].on_cpu);
        assert_int_equal(r.failures, 0);
        assert_true(!limits[i].dispatches || r.dispatches <= limits[i].dispatches);
        assert_int_equal(r.filled_on_cpu, limits[i].filled_on_cpu);
        assert_string_equal(r.why_filled, r.filled_on_cpu ? "not enough memory on the device to fill holes" : "");
        assert_string_equal(r.why, r.on_cpu ? "not enough memory on the device for a part of a clear picture" : "");
    }
    field_fini(&lf);
}

/* Buffers are small, memory is not: the views of other pictures stay where they are. */
static void test_buffers(void **state)
{
    struct sst_render_device_report report;
    struct sst_renderer *cpu, *gpu;
    struct sst_lightfield lf;

    (void)state;
    field_init(&lf);
    report = compare(&lf, "dummy:known=1,buffer=200", 0);
    assert_int_equal(report.in_parts, 4);
    report = compare(&lf, "dummy:known=1,buffer=100", 0);
    assert_int_equal(report.on_cpu, 4);
    assert_int_equal(sst_renderer_create(&cpu, &lf, 2), 0);
    assert_int_equal(sst_renderer_create(&gpu, &lf, 2), 0);
    assert_int_equal(sst_renderer_use_device(gpu, "dummy:known=1,buffer=200", 0), 0);
    for (int i = 0; i < 8; i++) { /* in turn with pictures of another kind */
        const int picture = i % 2 ? CLEAR + i / 4 : 4;
        struct field_picture a, b;

        field_render(&a, cpu, picture);
        field_render(&b, gpu, picture);
        assert_int_equal(field_difference(&a, &b), 0);
        field_free(&a);
        field_free(&b);
        assert_true(sst_renderer_device(gpu, &report));
        assert_int_equal(report.chunks, 3);
    }
    assert_int_equal(report.pictures, 8);
    assert_int_equal(report.in_parts, 4);
    sst_renderer_destroy(cpu);
    sst_renderer_destroy(gpu);
    field_fini(&lf);
}

static bool clears(const char *name)
{
    struct sst_render_device_report report = { .failures = 1 };
    struct sst_lightfield lf;
    struct sst_renderer *r;
    struct seen s;

    field_init(&lf);
    assert_int_equal(sst_renderer_create(&r, &lf, 2), 0);
    if (!sst_renderer_use_device(r, name, 0)) {
        render_seen(&s, r, CLEAR, false);
        free_seen(&s);
        assert_true(sst_renderer_device(r, &report));
    }
    sst_renderer_destroy(r);
    field_fini(&lf);
    return !report.failures;
}

/* Dispatches of a device before those of its first clear picture; the last ones test the filling of holes. */
static int tests_of_clear(void)
{
    static int tests;

    tests = tests ? tests : self_tests(clears) - 2 - FILL;
    return tests;
}

/* A device that is lost at one dispatch after the other: within a band, while holes are filled, before and after a
 * merge, which the CPU then fills. */
static void lose(const struct sst_lightfield *lf, uint64_t memory, int *filled_on_cpu)
{
    const int step = small_level() ? 9 : 3;

    for (int at = 1; at < 66; at += step) {
        struct sst_render_device_report report;
        char name[32];

        snprintf(name, sizeof(name), "dummy:known=1,lost=%d", at);
        report = compare(lf, name, memory);
        assert_int_equal(report.pictures + report.on_cpu, 4);
        assert_int_equal(report.in_parts, memory ? report.pictures : 0);
        assert_true(report.failures > 0);
        if (report.on_cpu)
            assert_string_equal(report.why, "the device is lost");
        if (report.filled_on_cpu)
            assert_string_equal(report.why_filled, "the device is lost");
        *filled_on_cpu += (int)report.filled_on_cpu;
    }
}

static void test_lost(void **state)
{
    struct sst_lightfield lf;

    (void)state;
    field_init(&lf);
    for (int parts = 0; parts < 2; parts++) {
        int filled_on_cpu = 0;

        lose(&lf, parts ? 500 << 10 : 0, &filled_on_cpu);
        print_message("%d pictures were filled on the CPU\n", filled_on_cpu);
        assert_true(filled_on_cpu > 0);
    }
    field_fini(&lf);
}

/* Shaders that are refused leave only the holes to the CPU. */
static void test_refused(void **state)
{
    const int tests = tests_of_clear();
    struct sst_lightfield lf;

    (void)state;
    field_init(&lf);
    for (int at = tests - FILL / 2; at <= tests; at += FILL / 2) {
        struct sst_render_device_report report;
        char name[32];

        snprintf(name, sizeof(name), "dummy:wrong=%d", at);
        report = compare(&lf, name, 0);
        assert_int_equal(report.pictures, 4);
        assert_int_equal(report.failures, 0);
        assert_int_equal(report.filled_on_cpu, 4);
        assert_string_equal(report.why_filled, "a shader is refused");
    }
    field_fini(&lf);
}

/* Frames are rectified on the CPU, once. */
static void test_frames(void **state)
{
    struct sst_render_config cfg = frames_config(FRAMES_CLEAR);
    struct sst_render_device_report report;
    struct sst_renderer *cpu, *gpu;
    struct raw_field field;

    (void)state;
    assert_int_equal(frames_make(&field), 0);
    assert_int_equal(sst_renderer_create(&cpu, &field.rectified, 2), 0);
    assert_int_equal(sst_renderer_create(&gpu, &field.raw, 2), 0);
    assert_int_equal(sst_renderer_use_rectified(gpu), 0);
    assert_int_equal(sst_renderer_use_device(gpu, "dummy", 900 << 10), 0);
    for (int i = 0; i < 2; i++) {
        struct frames_picture a, b;

        cfg.view_bx = 0.1 * i;
        a = frames_render(cpu, &field.rectified, &cfg);
        b = frames_render(gpu, &field.raw, &cfg);
        assert_int_equal(frames_count(&a, &b, 0), 0);
        frames_free(&a);
        frames_free(&b);
    }
    assert_true(sst_renderer_device(gpu, &report));
    assert_int_equal(report.pictures, 2);
    assert_int_equal(report.in_parts, 2);
    assert_int_equal(report.on_cpu, 0);
    sst_renderer_destroy(cpu);
    sst_renderer_destroy(gpu);
    raw_field_free(&field);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        serial_test(test_memory),  serial_test(test_buffers),     serial_test(test_lost),
        serial_test(test_refused), cmocka_unit_test(test_frames),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
