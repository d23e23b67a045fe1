/* Raw frames on the dummy device: rectified and sampled there, encoded ones, its faults, what ends on the CPU. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>

#include <turbojpeg.h>

#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/jpeg_planes.h"
#include "pipeline/kernels/place_patch.h"
#include "tests/frames_field.h"
#include "tests/render_tests.h"
#include "tests/small.h"

#define VIEWS     6

static struct raw_field field;

static int set_up(void **state SST_UNUSED)
{
    return frames_make(&field);
}

static int tear_down(void **state SST_UNUSED)
{
    raw_field_free(&field);
    return 0;
}

/* Views made by the device: the bytes of the CPU, once for all pictures; and again and again with little memory. */
static void rectified_views_have_the_bytes_of_the_cpu(void **state SST_UNUSED)
{
    struct sst_render_device_report report;

    assert_int_equal(frames_compare(&field, false, "dummy", 0, 0, &report), 0);
    assert_int_equal(report.pictures, FRAMES_PICTURES - 1);
    assert_int_equal(report.on_cpu, 0);
    assert_int_equal(report.failures, 0);
    assert_int_equal(report.rectified, VIEWS);
    assert_int_equal(report.uploads, VIEWS);
    assert_int_equal(frames_compare(&field, false, "dummy:known=1", (uint64_t)1150 << 10, 0, &report), 0);
    assert_true(report.rectified > 3 * VIEWS);
    assert_int_equal(report.failures, 0);
}

/* Places between pixels may differ by 1/256 px where a row is not begun at the same pixel. */
static void sampled_rays_are_those_of_the_cpu(void **state SST_UNUSED)
{
    struct sst_render_device_report report;

    for (int small = small_level() >= 2; small < 2; small++) {
        assert_in_range(frames_compare(&field, true, "dummy:known=1", small ? (uint64_t)1150 << 10 : 0, 1, &report), 0,
                        FRAMES_PICTURES * FRAMES_WIDTH * FRAMES_HEIGHT / 1000);
        assert_int_equal(report.pictures, FRAMES_PICTURES);
        assert_int_equal(report.on_cpu, 0);
        assert_int_equal(report.failures, 0);
        assert_true(report.rectified > 3 * VIEWS);
        if (!small)
            assert_int_equal(report.uploads, 2 * VIEWS); /* the frames stay; maps of the clear picture */
        else
            assert_true(report.uploads > 2 * VIEWS);
    }
}

/* The first picture of rectified frames is made on a device. */
static bool renders(const char *name)
{
    const struct sst_render_config cfg = frames_config(0);
    struct sst_render_device_report report;
    struct frames_picture p;
    struct sst_renderer *r;
    bool opened;

    assert_int_equal(sst_renderer_create(&r, &field.raw, 2), 0);
    assert_int_equal(sst_renderer_use_rectified(r), 0);
    opened = !sst_renderer_use_device(r, name, 0);
    if (opened) {
        p = frames_render(r, &field.raw, &cfg);
        frames_free(&p);
        assert_true(sst_renderer_device(r, &report));
    }
    sst_renderer_destroy(r);
    return opened && !report.failures;
}

/* What fails ends on the CPU with the same picture. */
static void failures_end_on_the_cpu(void **state SST_UNUSED)
{
    const int blend = work_dispatches(renders), tests = render_tests(); /* the picture's last dispatch; those of the opening */
    const struct {
        const char *fault;
        int at;
        const char *why;
        int failures;
    } devices[] = {
        { "known=1,lost", blend - VIEWS, "the device is lost", 3 },               /* the first view, at each opening */
        { "known=1,timeout", blend - VIEWS + 2, "the device does not answer", 3 }, /* the third one */
        { "wrong", tests + 2, "the shader that rectifies is refused", 0 },
    };
    struct sst_render_device_report report;

    for (size_t i = 0; i < (small_level() >= 2 ? 1 : ARRAY_LEN(devices)); i++) {
        for (int sampled = 0; sampled < 2; sampled++) {
            char name[48];

            snprintf(name, sizeof(name), "dummy:%s=%d", devices[i].fault, devices[i].at);

            print_message("%s\n", name);
            assert_int_equal(frames_compare(&field, sampled, name, 0, 0, &report), 0);
            assert_int_equal(report.pictures, 0);
            assert_int_equal(report.on_cpu, FRAMES_PICTURES - !sampled);
            assert_int_equal(report.failures, devices[i].failures);
        }
    }
}

/* A light field whose frames are JPEG files, and one of their pixels. */
static void encode(struct sst_lightfield *encoded, struct sst_lightfield *decoded)
{
    const size_t bytes = VIEWS * sizeof(*encoded->views);

    *encoded = *decoded = field.raw;
    encoded->views = malloc(bytes);
    decoded->views = malloc(bytes);
    assert_true(encoded->views && decoded->views);
    memcpy(encoded->views, field.raw.views, bytes);
    memcpy(decoded->views, field.raw.views, bytes);
    for (int k = 0; k < VIEWS; k++) {
        struct sst_view *v = &encoded->views[k];

        assert_int_equal(sst_image_encode_jpeg(&v->image, 90, &v->encoded, &v->encoded_bytes), 0);
        v->image = (struct sst_image){ 0 };
        assert_int_equal(sst_lightfield_decode_frame(&decoded->views[k].image, encoded, k), 0);
    }
}

static void discard(struct sst_lightfield *encoded, struct sst_lightfield *decoded)
{
    for (int k = 0; k < VIEWS; k++) {
        free(encoded->views[k].encoded);
        sst_image_fini(&decoded->views[k].image);
    }
    free(encoded->views);
    free(decoded->views);
}

static struct frames_picture render(const struct sst_lightfield *lf, const char *device, bool sampled, int picture)
{
    const struct sst_render_config cfg = frames_config(picture);
    struct frames_picture p;
    struct sst_renderer *r;

    assert_int_equal(sst_renderer_create(&r, lf, 2), 0);
    if (!sampled)
        assert_int_equal(sst_renderer_use_rectified(r), 0);
    assert_int_equal(sst_renderer_use_device(r, device, 0), 0);
    p = frames_render(r, lf, &cfg);
    sst_renderer_destroy(r);
    return p;
}

/* Files that are decoded to where the device copies from, or when the CPU needs them: the same pictures. */
static void encoded_frames_are_decoded_where_they_are_needed(void **state SST_UNUSED)
{
    static const int pictures[] = { 0, 3, FRAMES_CLEAR };
    struct sst_lightfield encoded, decoded;

    encode(&encoded, &decoded);
    for (size_t i = small_level() >= 2 ? 2 : 0; i < ARRAY_LEN(pictures); i++) {
        struct frames_picture want = render(&decoded, "cpu", false, pictures[i]);
        struct frames_picture got[] = { render(&encoded, "dummy:known=1", false, pictures[i]),
                                        render(&encoded, "cpu", false, pictures[i]),
                                        render(&encoded, render_fault("lost", 10), false, pictures[i]),
                                        render(&encoded, "cpu", true, pictures[i]) };
        struct frames_picture sampled = render(&decoded, "cpu", true, pictures[i]);

        for (size_t k = 0; k < ARRAY_LEN(got); k++) {
            assert_int_equal(frames_count(k == 3 ? &sampled : &want, &got[k], 0), 0);
            frames_free(&got[k]);
        }
        frames_free(&want);
        frames_free(&sampled);
    }
    discard(&encoded, &decoded);
}

/* The picture fails, with one message; the device is not to blame. */
static void a_damaged_frame_is_an_error(void **state SST_UNUSED)
{
    const struct sst_render_config cfg = frames_config(0);
    struct sst_render_device_report report;
    struct sst_lightfield encoded, decoded;
    struct sst_image out = { 0 };
    char text[SST_LOG_MAX] = "";
    struct sst_renderer *r;

    encode(&encoded, &decoded);
    encoded.views[2].encoded_bytes /= 2;
    assert_int_equal(sst_image_init(&out, encoded.width, encoded.height), 0);
    assert_int_equal(sst_renderer_create(&r, &encoded, 2), 0);
    assert_int_equal(sst_renderer_use_rectified(r), 0);
    assert_int_equal(sst_renderer_use_device(r, "dummy:known=1", 0), 0);
    sst_log_hold_errors(text);
    assert_int_equal(sst_render(r, &cfg, &out, NULL), -EBADMSG);
    sst_log_hold_errors(NULL);
    assert_contains(text, "damaged or truncated JPEG");
    assert_true(sst_renderer_device(r, &report));
    assert_int_equal(report.failures, 0);
    assert_string_equal(report.why, "a frame cannot be decoded");
    sst_renderer_destroy(r);
    sst_image_fini(&out);
    discard(&encoded, &decoded);
}

/* Encode the upper left part of a frame. */
static void encode_part(int width, int height, int sampling, int flags, uint8_t **jpeg, unsigned long *bytes)
{
    const struct sst_image *img = &field.raw.views[1].image;
    uint8_t *rgb = malloc(3 * (size_t)width * (size_t)height);
    tjhandle tj = tjInitCompress();

    assert_true(rgb && tj);
    for (int i = 0; i < width * height; i++) {
        for (int c = 0; c < 3; c++) /* strong colours, that chroma differs from place to place */
            rgb[3 * i + c] = (uint8_t)(sst_image_row(img, c, i / width)[i % width] * (1 + (i / 3 + c) % 3));
    }
    *jpeg = NULL;
    assert_int_equal(tjCompress2(tj, rgb, width, 0, height, TJPF_RGB, jpeg, bytes, sampling, 93, flags), 0);
    tjDestroy(tj);
    free(rgb);
}

/* Samples of chroma that the shader does not enlarge. */
static void other_samplings_are_decoded_by_the_cpu(void **state SST_UNUSED)
{
    struct sst_jpeg_planes p;
    unsigned long bytes;
    uint8_t *jpeg;

    encode_part(40, 40, TJSAMP_440, 0, &jpeg, &bytes);
    assert_int_equal(sst_jpeg_planes_read(&p, jpeg, bytes, "frame"), -ENOTSUP);
    tjFree(jpeg);
    encode_part(4, 4, TJSAMP_420, 0, &jpeg, &bytes);
    assert_int_equal(sst_jpeg_planes_read(&p, jpeg, bytes, "frame"), -ENOTSUP);
    tjFree(jpeg);
}

/* The places of a row from the pieces of a table. */
static void places_of(const struct sst_rectify_tables *t, const struct sst_places *cells,
                      const struct sst_rectify_list *list, double x0, int n, int32_t *xy_q8)
{
    for (int x = 0; x < n; x++) {
        const int cell = sst_min_int(x >> t->cell_shift, t->cells - 1), column = x - (cell << t->cell_shift);
        const struct sst_places *p = &cells[cell];

        xy_q8[2 * x] = xy_q8[2 * x + 1] = INT32_MIN;
        if (p->most[0] >= 0)
            sst_place_row_ref(xy_q8 + 2 * x, p, (float)x0 + (float)column, 1);
        else if (p->most[0] == SST_PLACES_LISTED)
            memcpy(xy_q8 + 2 * x, list->xy + 2 * (p->whole_q8[0] + column), 2 * sizeof(*xy_q8));
    }
}

/* Tables of a map are the map: also where cells are exact or have no place, with a lens that folds. */
static void tables_have_the_places_of_the_map(void **state SST_UNUSED)
{
    struct sst_rectified to = *field.raw.rectified;
    int kinds[3] = { 0, 0, 0 }, off = 0, n = 0;

    for (int strong = 0; strong < 2; strong++) {
        struct sst_calib_camera *camera = &field.use.calib.camera[0], before = *camera;
        struct sst_rectify_list list = { 0 };
        struct sst_rectify_tables t;
        struct sst_rectify_map *map;
        struct sst_places cells[64];
        int32_t want[2 * FRAMES_WIDTH], got[2 * FRAMES_WIDTH];

        camera->k[0] = strong ? -0.35 : camera->k[0];
        to.focal_px *= strong ? 0.3 : 1;
        assert_int_equal(sst_rectify_map_create(&map, &to, &field.use.calib, 0), 0);
        sst_rectify_map_tables(&t, map, SST_FILTER_LANCZOS);
        assert_int_equal(t.taps, 6);
        assert_true(t.cells <= 64 && t.falloff);
        for (int row = 0; row < 2 * FRAMES_HEIGHT; row++) {
            const double y = row / 2 + (row % 2) * 0.37, x0 = (row % 2) * 0.61;
            const int width = FRAMES_WIDTH - row % 2;

            if (row == 2 * FRAMES_HEIGHT - 1)
                continue;
            list.count = 0;
            assert_int_equal(sst_rectify_map_cells(map, x0, y, cells, &list), 0);
            for (int i = 0; i < t.cells; i++)
                kinds[cells[i].most[0] >= 0 ? 0 : -cells[i].most[0]]++;
            sst_rectify_map_row(map, x0, y, width, want);
            places_of(&t, cells, &list, x0, width, got);
            if (row % 2 == 0)
                assert_memory_equal(got, want, 2 * sizeof(want[0]) * (size_t)width);
            for (int i = 0; i < 2 * width; i++, n++) {
                if (got[i] == want[i])
                    continue;
                off++;
                assert_true(got[i] == INT32_MIN || want[i] == INT32_MIN || abs(got[i] - want[i]) == 1);
            }
        }
        sst_rectify_map_destroy(map);
        free(list.xy);
        *camera = before;
    }
    print_message("%d cubics, %d listed, %d without places; %d of %d places between pixels are off by 1/256 px\n",
                  kinds[0], kinds[1], kinds[2], off, n);
    assert_true(kinds[0] && kinds[1] && kinds[2]);
    assert_in_range(off, 0, n / 500);
}

static float place_cubic(float k, float c0, float c1, float c2, float c3)
{
    return c0 + k * (c1 + k * (c2 + k * c3));
}

/* Bilinear between four listed places, 1/256 px. @return false: one of them is none */
static bool place_listed(int32_t xy_q8[2], const int32_t *list, int side, float k, float t)
{
    const int i = sst_min_int((int)k, side - 1), j = sst_min_int((int)t, side - 1);
    const int32_t *upper = list + 2 * (j * (side + 1) + i), *lower = upper + 2 * (side + 1);
    const float right = k - (float)i, below = t - (float)j;

    if (upper[0] == INT32_MIN || upper[2] == INT32_MIN || lower[0] == INT32_MIN || lower[2] == INT32_MIN)
        return false;
    for (int axis = 0; axis < 2; axis++) {
        const int32_t a = upper[axis], b = upper[axis + 2] - a, c = lower[axis] - a, d = lower[axis + 2] - a - b - c;
        const float v = right * (float)b + below * ((float)c + right * (float)d);

        xy_q8[axis] = (a + (int32_t)lrintf(v) + (1 << (SST_PATCH_LISTED_BITS - 9))) >> (SST_PATCH_LISTED_BITS - 8);
    }
    return true;
}

/* What the shader clear_sample computes. @param k, t  column and row from the first ones of the piece on */
static bool place_patch(int32_t xy_q8[2], const struct sst_place_patch *patch, const int32_t *list, int side, float k,
                        float t, const int32_t most_q8[2])
{
    if (patch->kind == SST_PLACES_LISTED) {
        if (!place_listed(xy_q8, list + 2 * (size_t)patch->whole_q8[0], side, k, t))
            return false;
    } else if (patch->kind) {
        return false;
    } else {
        for (int axis = 0; axis < 2; axis++) {
            float across[4];

            for (int i = 0; i < 4; i++) {
                const float *c = patch->c[axis][i];

                across[i] = place_cubic(t, c[0], c[1], c[2], c[3]);
            }
            xy_q8[axis] =
                patch->whole_q8[axis] + (int32_t)lrintf(place_cubic(k, across[0], across[1], across[2], across[3]));
        }
    }
    return xy_q8[0] >= 0 && xy_q8[0] <= most_q8[0] && xy_q8[1] >= 0 && xy_q8[1] <= most_q8[1];
}

/* Places of a map that its patches do not have, or more than 1/256 px off. */
struct patch_errors {
    int n, off, far, lost; /* positions; coordinates off by 1/256 px, by more; places that are not there */
    int worst;
};

static void compare_places(struct patch_errors *e, const struct sst_rectify_map *map,
                           const struct sst_rectify_tables *t, const struct sst_place_patch *patches,
                           const int32_t *list, double x, double y)
{
    const int32_t most[2] = { 256 * (t->raw_width - 1), 256 * (t->raw_height - 1) };
    const int i = sst_min_int((int)x >> t->cell_shift, t->cells - 1);
    const int j = sst_min_int((int)y >> t->cell_shift, t->cell_rows - 1), side = 1 << t->cell_shift;
    int32_t want[2], got[2];
    bool is;

    sst_rectify_map_row(map, x, y, 1, want);
    is = place_patch(got, &patches[j * t->cells + i], list, side, (float)(x - i * side), (float)(y - j * side), most);
    e->n++;
    e->lost += is != (want[0] != INT32_MIN);
    for (int axis = 0; axis < 2 && is && want[0] != INT32_MIN; axis++) {
        const int d = abs(got[axis] - want[axis]);

        e->off += d == 1;
        e->far += d > 1;
        e->worst = sst_max_int(e->worst, d);
    }
}

/* Patches have the places of the map at any position; but where a lens folds, and near its fold. */
static void patches_have_the_places_of_the_map(void **state SST_UNUSED)
{
    struct sst_rectified to = *field.raw.rectified;
    uint64_t seed = 3;

    for (int strong = 0; strong < 2; strong++) {
        struct sst_calib_camera *camera = &field.use.calib.camera[0], before = *camera;
        struct sst_rectify_list list = { 0 };
        struct patch_errors e = { 0 };
        struct sst_place_patch *patches;
        struct sst_rectify_tables t;
        struct sst_rectify_map *map;

        camera->k[0] = strong ? -0.35 : camera->k[0];
        to.focal_px *= strong ? 0.3 : 1;
        assert_int_equal(sst_rectify_map_create(&map, &to, &field.use.calib, 0), 0);
        sst_rectify_map_tables(&t, map, SST_FILTER_BICUBIC);
        patches = calloc((size_t)t.cells * (size_t)t.cell_rows, sizeof(*patches));
        assert_non_null(patches);
        assert_int_equal(sst_rectify_map_patches(map, patches, &list), 0);
        for (int i = 0; i < 100000; i++) {
            const double x = (double)(float)((double)(sst_random_u64(&seed) % 65536) / 65536 * (FRAMES_WIDTH - 1));

            compare_places(&e, map, &t, patches, list.xy, x,
                           (double)(float)((double)(sst_random_u64(&seed) % 65536) / 65536 * (FRAMES_HEIGHT - 1)));
        }
        print_message("of %d places %d are lost or found, %d coordinates off by 1/256 px, %d by more, at most by %d\n",
                      e.n, e.lost, e.off, e.far, e.worst);
        assert_in_range(e.off, 0, strong ? e.n / 10 : e.n / 500);
        assert_in_range(e.lost, 0, strong ? e.n / 100 : 10);
        assert_in_range(e.far, 0, strong ? e.n / 200 : 0);
        sst_rectify_map_destroy(map);
        free(patches);
        free(list.xy);
        *camera = before;
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rectified_views_have_the_bytes_of_the_cpu),
        cmocka_unit_test(sampled_rays_are_those_of_the_cpu),
        serial_test(failures_end_on_the_cpu),
        cmocka_unit_test(encoded_frames_are_decoded_where_they_are_needed),
        cmocka_unit_test(a_damaged_frame_is_an_error),
        serial_test(other_samplings_are_decoded_by_the_cpu),
        serial_test(tables_have_the_places_of_the_map),
        serial_test(patches_have_the_places_of_the_map),
    };

    return cmocka_run_group_tests(tests, set_up, tear_down);
}
