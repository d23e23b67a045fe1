/* Clear pictures whose rays are sampled from raw frames, on the dummy device: those of the CPU, in bands, with labels
 * and masks, of encoded frames and of corrected pictures, and what fails. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/correction.h"
#include "tests/frames_field.h"
#include "tests/render_tests.h"
#include "tests/small.h"

#define VIEWS      6
#define PICTURES   5

static struct raw_field field;
static struct sst_map_u8 masks[VIEWS];

static int set_up(void **state SST_UNUSED)
{
    int err = frames_make(&field);

    for (int k = 0; k < VIEWS && !err; k++) {
        err = sst_map_u8_init(&masks[k], FRAMES_WIDTH, FRAMES_HEIGHT);
        for (int y = 20; y < 50 && !err; y++)
            memset(sst_map_u8_row(&masks[k], y) + 30 + 4 * (k % 3), 255, 25);
    }
    return err;
}

static int tear_down(void **state SST_UNUSED)
{
    for (int k = 0; k < VIEWS; k++)
        sst_map_u8_fini(&masks[k]);
    raw_field_free(&field);
    return 0;
}

static int merge_nothing(void *arg SST_UNUSED, struct sst_image *img SST_UNUSED, struct sst_map_u8 *weight SST_UNUSED)
{
    return 0;
}

/* At a camera, between cameras, without a label, without an object, with surfaces. */
static struct sst_render_config config(int i, struct sst_render_merge *merge)
{
    struct sst_render_config cfg = frames_config(FRAMES_CLEAR);

    cfg.view_bx = i == 1 ? 0.37 : 0;
    cfg.view_by = i == 1 ? 0.21 : 0;
    cfg.remove_label = i == 2 ? 1 : 0;
    cfg.remove = i == 3 ? masks : NULL;
    cfg.rays = i == 1 ? 2 : 0;
    cfg.merge = i == 4 ? merge : NULL;
    return cfg;
}

struct seen {
    struct frames_picture picture;
    struct sst_map_u16 surface;
    struct sst_map_u8 support;
};

static struct seen render(struct sst_renderer *r, const struct sst_lightfield *lf, int i)
{
    struct seen s = { 0 };
    struct sst_render_merge merge = { .merge = merge_nothing, .surface = &s.surface, .support = &s.support };
    const struct sst_render_config cfg = config(i, &merge);

    assert_int_equal(sst_map_u16_init(&s.surface, lf->width, lf->height), 0);
    assert_int_equal(sst_map_u8_init(&s.support, lf->width, lf->height), 0);
    s.picture = frames_render(r, lf, &cfg);
    return s;
}

static void discard(struct seen *s)
{
    frames_free(&s->picture);
    sst_map_u16_fini(&s->surface);
    sst_map_u8_fini(&s->support);
}

/* Surfaces are the same but where a ray is missing: pixels that differ. */
static int count_surfaces(const struct seen *a, const struct seen *b)
{
    int n = 0;

    for (int y = 0; y < FRAMES_HEIGHT; y++) {
        for (int x = 0; x < FRAMES_WIDTH; x++)
            n += sst_map_u16_row(&a->surface, y)[x] != sst_map_u16_row(&b->surface, y)[x];
    }
    return n;
}

/* All pictures against those of the CPU from `decoded`. */
static struct sst_render_device_report compare(const struct sst_lightfield *lf, const struct sst_lightfield *decoded,
                                               const char *device, uint64_t memory)
{
    struct sst_render_device_report report;
    struct sst_renderer *cpu, *gpu;

    assert_int_equal(sst_renderer_create(&cpu, decoded, 2), 0);
    assert_int_equal(sst_renderer_create(&gpu, lf, 2), 0);
    assert_int_equal(sst_renderer_use_device(gpu, device, memory), 0);
    for (int i = 0; i < PICTURES; i++) {
        struct seen a = render(cpu, decoded, i), b = render(gpu, lf, i);
        const int off = frames_count(&a.picture, &b.picture, 0), far = frames_count(&a.picture, &b.picture, 1);

        if (off)
            print_message("%s, picture %d: %d pixels differ, %d by more than a level\n", device, i, off, far);
        assert_in_range(far, 0, FRAMES_WIDTH * FRAMES_HEIGHT / 1000);
        assert_int_equal(count_surfaces(&a, &b), 0);
        discard(&a);
        discard(&b);
    }
    assert_true(sst_renderer_device(gpu, &report));
    sst_renderer_destroy(cpu);
    sst_renderer_destroy(gpu);
    return report;
}

/* With room for all rows, and in bands; frames stay where there is room for them. */
static void pictures_are_those_of_the_cpu(void **state SST_UNUSED)
{
    static const struct {
        const char *device;
        uint64_t memory;
        int in_parts, on_cpu, uploads; /* uploads: of frames and views; 0: more than those of maps and frames once */
    } devices[] = {
        { "dummy:known=1", 0, 0, 0, PICTURES * VIEWS + VIEWS },
        { "dummy:known=1", (uint64_t)1000 << 10, PICTURES, 0, 0 },
        { "dummy:known=1,buffer=290", 0, PICTURES, 0, 0 },
        { "dummy:known=1", (uint64_t)300 << 10, 0, PICTURES, 0 },
    };

    for (size_t i = 0; i < ARRAY_LEN(devices); i++) {
        const struct sst_render_device_report r = compare(&field.raw, &field.raw, devices[i].device, devices[i].memory);

        print_message("%s, %d KiB: %d pictures, %d in parts, %d uploads, %d dispatches: %s\n", devices[i].device,
                      (int)(devices[i].memory >> 10), (int)r.pictures, (int)r.in_parts, (int)r.uploads,
                      (int)r.dispatches, r.why);
        assert_int_equal(r.pictures, PICTURES - devices[i].on_cpu);
        assert_int_equal(r.on_cpu, devices[i].on_cpu);
        assert_int_equal(r.in_parts, devices[i].in_parts);
        assert_int_equal(r.filled_on_cpu, 0);
        if (devices[i].uploads)
            assert_int_equal(r.uploads, devices[i].uploads);
    }
}

/* JPEG files, decoded to where the device copies from. */
static void encoded_frames_are_decoded(void **state SST_UNUSED)
{
    const size_t bytes = VIEWS * sizeof(*field.raw.views);
    struct sst_lightfield encoded = field.raw, decoded = field.raw;
    struct sst_render_device_report r;

    encoded.views = malloc(bytes);
    decoded.views = malloc(bytes);
    assert_true(encoded.views && decoded.views);
    memcpy(encoded.views, field.raw.views, bytes);
    memcpy(decoded.views, field.raw.views, bytes);
    for (int k = 0; k < VIEWS; k++) {
        struct sst_view *v = &encoded.views[k];

        assert_int_equal(sst_image_encode_jpeg(&v->image, 90, &v->encoded, &v->encoded_bytes), 0);
        v->image = (struct sst_image){ 0 };
        assert_int_equal(sst_lightfield_decode_frame(&decoded.views[k].image, &encoded, k), 0);
    }
    r = compare(&encoded, &decoded, "dummy:known=1", 0);
    assert_int_equal(r.pictures, PICTURES);
    r = compare(&encoded, &decoded, "dummy:known=1", (uint64_t)1000 << 10);
    assert_int_equal(r.pictures, PICTURES);
    r = compare(&encoded, &decoded, render_fault("lost", 40), 0);
    assert_true(r.on_cpu > 0);
    for (int k = 0; k < VIEWS; k++) {
        free(encoded.views[k].encoded);
        sst_image_fini(&decoded.views[k].image);
    }
    free(encoded.views);
    free(decoded.views);
}

static void copy_image(struct sst_image *to, const struct sst_image *from)
{
    assert_int_equal(sst_image_init(to, from->width, from->height), 0);
    for (int i = 0; i < 3 * from->height; i++)
        memcpy(sst_image_row(to, i % 3, i / 3), sst_image_row(from, i % 3, i / 3), (size_t)from->width);
}

/* Corrected views are sampled from their originals, the others between their own pixels. */
static void corrected_pictures_are_sampled_from_originals(void **state SST_UNUSED)
{
    struct sst_correction correction[VIEWS];
    struct sst_image original[VIEWS];
    struct sst_render_device_report r;
    struct raw_field corrected;

    assert_int_equal(frames_make(&corrected), 0);
    for (int k = 0; k < VIEWS; k++)
        correction[k] = sst_correction_none();
    for (int k = 1; k < VIEWS; k += 2) {
        correction[k].shift_x_px = 0.7 - 0.2 * k;
        correction[k].shift_y_px = 0.4;
        correction[k].roll_deg = 0.2;
    }
    for (int k = 1; k < VIEWS; k += 2)
        copy_image(&original[k], &corrected.rectified.views[k].image);
    assert_int_equal(sst_lightfield_correct(NULL, &corrected.rectified, correction, 2), 0);
    for (int k = 1; k < VIEWS; k += 2)
        corrected.rectified.views[k].original = original[k];
    assert_true(sst_lightfield_has_originals(&corrected.rectified));
    for (int parts = 0; parts < 2; parts++) {
        r = compare(&corrected.rectified, &corrected.rectified, "dummy:known=1", parts ? (uint64_t)1000 << 10 : 0);
        assert_int_equal(r.pictures, PICTURES);
        assert_int_equal(r.in_parts, parts ? PICTURES : 0);
    }
    raw_field_free(&corrected);
}

/* The device can be opened. */
static bool joins(const char *name)
{
    struct sst_renderer *r;
    int err;

    assert_int_equal(sst_renderer_create(&r, &field.raw, 2), 0);
    err = sst_renderer_use_device(r, name, 0);
    sst_renderer_destroy(r);
    return !err;
}

/* A device that is lost at one dispatch after the other. */
static void a_lost_device_ends_on_the_cpu(void **state SST_UNUSED)
{
    for (int at = 1; at < 30; at += small_level() ? 12 : 4) {
        struct sst_render_device_report r;
        char name[32];

        snprintf(name, sizeof(name), "dummy:known=1,lost=%d", at);
        r = compare(&field.raw, &field.raw, name, 0);
        assert_int_equal(r.pictures + r.on_cpu, PICTURES);
        assert_true(r.on_cpu > 0 && r.failures > 0);
        assert_string_equal(r.why, "the device is lost");
    }
}

/* A step that is refused: its pictures are rendered on the CPU, the device is not to blame. */
static void a_refused_shader_ends_on_the_cpu(void **state SST_UNUSED)
{
    const int tests = self_tests(joins);

    for (int i = 0; i < 2; i++) {
        struct sst_render_device_report r;
        char name[32];

        snprintf(name, sizeof(name), "dummy:wrong=%d", tests + 2 + 10 * i); /* of clear pictures */
        r = compare(&field.raw, &field.raw, name, 0);
        assert_int_equal(r.on_cpu, PICTURES);
        assert_int_equal(r.failures, 0);
        assert_string_equal(r.why, "a shader is refused");
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pictures_are_those_of_the_cpu),
        cmocka_unit_test(encoded_frames_are_decoded),
        cmocka_unit_test(corrected_pictures_are_sampled_from_originals),
        cmocka_unit_test(a_lost_device_ends_on_the_cpu),
        cmocka_unit_test(a_refused_shader_ends_on_the_cpu),
    };

    return cmocka_run_group_tests(tests, set_up, tear_down);
}
