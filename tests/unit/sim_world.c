/* Simulated frames: valid JPEG with its strip at any quality and size, other formats, light, the loop's time, the
 * cache, and invalid world files. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/sim_test.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <time.h>

#include "simulators/scene/world/settings.h"
#include "simulators/scene/world/world_internal.h"
#include "tests/strip_read.h"

static const struct sst_sim_exposure example = {
    .cam = 1, .trigger = 7, .t_ns = 123456789012, .exposure_us = 5000, .gain = 1
};

#define SMALL "scene: cat\ngrid: [1, 2]\nsize: [160, 192]\n"

/* --- JPEG --------------------------------------------------------------------------------------------------------- */

static void any_quality_and_width_makes_valid_frames(void **state SST_UNUSED)
{
    static const int widths[] = { 160, 168, 640, 656, 1920 }, qualities[] = { 20, 50, 85, 100 };

    for (size_t i = 0; i < ARRAY_LEN(widths); i++) {
        const int width = widths[i], height = 200;
        struct sst_image image;

        assert_int_equal(sst_image_init(&image, width, height), 0);
        for (int c = 0; c < 3; c++) {
            for (int y = 0; y < height; y++) {
                for (int x = 0; x < width; x++)
                    sst_image_row(&image, c, y)[x] = (uint8_t)(x * (c + 3) ^ y * 7);
            }
        }
        for (size_t q = 0; q < ARRAY_LEN(qualities); q++) {
            struct sst_sim_exposure got;
            struct sim_jpeg jpeg;
            uint8_t *plain, *luma;
            size_t bytes;

            assert_int_equal(sim_jpeg_encode(&image, qualities[q], true, &jpeg), 0);
            plain = sim_decode(jpeg.data, jpeg.bytes, width, height);
            assert_int_equal(
                sim_jpeg_copy(&jpeg, width, &example, (struct sst_sim_room){ sim_out, SIM_CAPACITY }, &bytes), 0);
            luma = sim_decode(sim_out, bytes, width, height);
            assert_int_equal(strip_read(luma, (size_t)width, width, height, &got), 0);
            assert_int_equal(got.t_ns, example.t_ns);
            /* Below the strip nothing has changed. */
            assert_memory_equal(luma + strip_height(width) * width, plain + strip_height(width) * width,
                                (size_t)((height - strip_height(width)) * width));
            assert_int_equal(sim_jpeg_copy(&jpeg, width, NULL, (struct sst_sim_room){ sim_out, jpeg.bytes }, &bytes),
                             0);
            assert_int_equal(bytes, jpeg.bytes);
            assert_memory_equal(sim_out, jpeg.data, bytes);
            free(luma);
            free(plain);
            free(jpeg.data);
        }
        sst_image_fini(&image);
    }
}

static void a_picture_without_room_for_the_strip_is_refused(void **state SST_UNUSED)
{
    struct sim_jpeg jpeg;
    struct sst_image image;

    assert_int_equal(sst_image_init(&image, 640, 24), 0);
    assert_int_equal(sim_jpeg_encode(&image, 85, true, &jpeg), -EINVAL);
    assert_int_equal(sim_jpeg_encode(&image, 85, false, &jpeg), 0);
    free(jpeg.data);
    sst_image_fini(&image);
}

/* --- formats ------------------------------------------------------------------------------------------------------ */

/* A red, a green, a blue and a white pixel: Y = 76, 150, 29, 255 (BT.601, full range). */
static void formats_are_packed_as_v4l2_says(void **state SST_UNUSED)
{
    static const uint8_t yuyv[8] = { 76, 64, 150, 138, 29, 192, 255, 118 };
    static const uint8_t grey[4] = { 76, 150, 29, 255 }, y16[8] = { 76, 76, 150, 150, 29, 29, 255, 255 };
    uint8_t out[8];
    struct sst_image image;

    assert_int_equal(sst_image_init(&image, 4, 1), 0);
    for (int c = 0; c < 3; c++)
        sst_image_row(&image, c, 0)[c] = sst_image_row(&image, c, 0)[3] = 255;
    assert_int_equal(sim_format_bytes(V4L2_PIX_FMT_YUYV, 4, 1), 8);
    assert_int_equal(sim_format_bytes(V4L2_PIX_FMT_Y16, 4, 1), 8);
    assert_int_equal(sim_format_bytes(V4L2_PIX_FMT_GREY, 4, 1), 4);
    assert_int_equal(sim_format_bytes(V4L2_PIX_FMT_NV12, 4, 1), 0);
    sim_pack(&image, V4L2_PIX_FMT_GREY, out);
    assert_memory_equal(out, grey, 4);
    sim_pack(&image, V4L2_PIX_FMT_Y16, out);
    assert_memory_equal(out, y16, 8);
    /* Red and green together: U = 128 - (43 + 85) / 2 = 64, V = 128 + (127.5 - 106.8) / 2 = 138.4; blue and white: U =
     * 128 + 128 / 2 = 192, V = 128 - 21 / 2 = 117.5. */
    sim_pack(&image, V4L2_PIX_FMT_YUYV, out);
    assert_memory_equal(out, yuyv, 8);
    sst_image_fini(&image);
}

static void bayer_has_its_four_orders(void **state SST_UNUSED)
{
    static const struct {
        uint32_t fourcc;
        uint8_t want[4]; /* upper left, upper right, lower left, lower right */
    } cases[] = {
        { V4L2_PIX_FMT_SRGGB8, { 10, 20, 20, 30 } },
        { V4L2_PIX_FMT_SGRBG8, { 20, 10, 30, 20 } },
        { V4L2_PIX_FMT_SGBRG8, { 20, 30, 10, 20 } },
        { V4L2_PIX_FMT_SBGGR8, { 30, 20, 20, 10 } },
    };
    struct sst_image image;
    uint8_t out[4];

    assert_int_equal(sst_image_init(&image, 2, 2), 0);
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < 2; y++)
            memset(sst_image_row(&image, c, y), 10 * (c + 1), 2);
    }
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        sim_pack(&image, cases[i].fourcc, out);
        assert_memory_equal(out, cases[i].want, 4);
    }
    sst_image_fini(&image);
}

static void every_format_and_size_carries_the_strip(void **state SST_UNUSED)
{
    static const uint32_t formats[] = { V4L2_PIX_FMT_MJPEG,  V4L2_PIX_FMT_YUYV,   V4L2_PIX_FMT_GREY,
                                        V4L2_PIX_FMT_Y16,    V4L2_PIX_FMT_SBGGR8, V4L2_PIX_FMT_SGBRG8,
                                        V4L2_PIX_FMT_SGRBG8, V4L2_PIX_FMT_SRGGB8 };
    struct sst_sim_world *w = sim_open("scene: cat\ngrid: [1, 2]\nsize: [640, 480]\n");
    const int(*sizes)[2];
    const int n = sst_sim_world_sizes(w, &sizes);

    assert_int_equal(n, 3); /* 640x480, 480x360, 320x240; 160x120 has no room for a strip of 96 rows */
    assert_int_equal(sizes[0][0], 640);
    assert_int_equal(sizes[2][1], 240);
    for (int i = 0; i < 2 * (int)ARRAY_LEN(formats) * n; i++) { /* the second time from the cache */
        const uint32_t fourcc = formats[i % (int)ARRAY_LEN(formats)];
        const int *size = sizes[i / (int)ARRAY_LEN(formats) % n], width = size[0], height = size[1];
        const size_t bytes = sim_frame(w, &example, fourcc, width, height);
        const int step = fourcc == V4L2_PIX_FMT_YUYV || fourcc == V4L2_PIX_FMT_Y16 ? 2 : 1;
        struct sst_sim_exposure got;
        uint8_t *luma;

        if (fourcc == V4L2_PIX_FMT_MJPEG) {
            luma = sim_decode(sim_out, bytes, width, height);
        } else {
            assert_int_equal(bytes, step * width * height);
            luma = malloc((size_t)width * (size_t)height);
            for (int p = 0; p < width * height; p++)
                luma[p] = sim_out[p * step];
        }
        assert_int_equal(strip_read(luma, (size_t)width, width, height, &got), 0);
        assert_int_equal(got.cam, example.cam);
        assert_int_equal(got.trigger, example.trigger);
        free(luma);
    }
    sst_sim_world_close(w);
}

static void what_no_camera_offers_is_refused(void **state SST_UNUSED)
{
    struct sst_sim_world *w = sim_open(SMALL);
    struct sst_sim_exposure other = example;
    size_t bytes = 99;

    memset(sim_out, 0xA5, 64);
    assert_int_equal(sst_sim_world_frame(w, &example, (struct sst_sim_format){ V4L2_PIX_FMT_NV12, 160, 192 },
                                         (struct sst_sim_room){ sim_out, SIM_CAPACITY }, &bytes),
                     -EINVAL);
    assert_int_equal(sst_sim_world_frame(w, &example, (struct sst_sim_format){ V4L2_PIX_FMT_GREY, 161, 192 },
                                         (struct sst_sim_room){ sim_out, SIM_CAPACITY }, &bytes),
                     -EINVAL);
    other.cam = 2;
    assert_int_equal(sst_sim_world_frame(w, &other, (struct sst_sim_format){ V4L2_PIX_FMT_GREY, 160, 192 },
                                         (struct sst_sim_room){ sim_out, SIM_CAPACITY }, &bytes),
                     -EINVAL);
    other = example;
    other.gain = NAN;
    assert_int_equal(sst_sim_world_frame(w, &other, (struct sst_sim_format){ V4L2_PIX_FMT_GREY, 160, 192 },
                                         (struct sst_sim_room){ sim_out, SIM_CAPACITY }, &bytes),
                     -EINVAL);
    assert_int_equal(sst_sim_world_frame(w, &example, (struct sst_sim_format){ V4L2_PIX_FMT_GREY, 160, 192 },
                                         (struct sst_sim_room){ sim_out, 160 * 192 - 1 }, &bytes),
                     -ENOSPC);
    assert_int_equal(sst_sim_world_frame(w, &example, (struct sst_sim_format){ V4L2_PIX_FMT_MJPEG, 160, 192 },
                                         (struct sst_sim_room){ sim_out, 64 }, &bytes),
                     -ENOSPC);
    assert_int_equal(bytes, 99);
    for (int i = 0; i < 64; i++)
        assert_int_equal(sim_out[i], 0xA5);
    sst_sim_world_close(w);
}

/* --- light and time ----------------------------------------------------------------------------------------------- */

/* Mean of the grey frame below the strip. */
static double mean_grey(struct sst_sim_world *w, const struct sst_sim_exposure *e)
{
    const int top = strip_height(160) * 160;
    double sum = 0;

    sim_frame(w, e, V4L2_PIX_FMT_GREY, 160, 192);
    for (int i = top; i < 160 * 192; i++)
        sum += sim_out[i];
    return sum / (160 * 192 - top);
}

static void exposure_and_gain_change_the_light(void **state SST_UNUSED)
{
    struct sst_sim_world *w = sim_open(SMALL);
    struct sst_sim_exposure half = example, dark = example, same = example;

    half.exposure_us = 2500;
    dark.exposure_us = 0;
    same.exposure_us = 2500;
    same.gain = 2;
    /* Half the light is about 0.73 of an sRGB value in the middle of the range (0.5 ^ (1 / 2.2)). */
    assert_true(mean_grey(w, &half) < 0.8 * mean_grey(w, &example));
    assert_true(mean_grey(w, &half) > 0.65 * mean_grey(w, &example));
    assert_true(mean_grey(w, &dark) < 1);
    assert_true(mean_grey(w, &same) == mean_grey(w, &example));
    sst_sim_world_close(w);
}

/* Which of the loop's frames a camera shows, by its bytes below the strip. */
static uint32_t picture(struct sst_sim_world *w, int cam, uint64_t trigger, int64_t t_ns)
{
    const struct sst_sim_exposure e = { .cam = cam, .trigger = trigger, .t_ns = t_ns, .exposure_us = 5000, .gain = 1 };
    uint32_t sum = 0;

    sim_frame(w, &e, V4L2_PIX_FMT_GREY, 160, 192);
    for (int i = 160 * 104; i < 160 * 192; i++)
        sum = sum * 31 + sim_out[i];
    return sum;
}

static void the_loop_follows_time_and_a_trigger_shows_one_frame(void **state SST_UNUSED)
{
    struct sst_sim_world *w = sim_open(SMALL "light_percent: 30\nloop: {seconds: 0.4, rate_hz: 10}\n");
    const int64_t ms = 1000000;
    const uint32_t first = picture(w, 0, 1, 1200 * ms), second = picture(w, 0, 2, 1300 * ms);

    assert_true(first != second);
    assert_int_equal(picture(w, 0, 3, 1299 * ms), first); /* the frame lasts 100 ms */
    assert_int_equal(picture(w, 0, 4, 1600 * ms), first); /* the loop 400 ms */
    assert_int_equal(picture(w, 0, 5, 1200 * ms + 400000 * ms), first);
    /* One trigger with exposures around the change: the first camera decides. */
    assert_int_equal(picture(w, 0, 6, 1700 * ms - 1000), first);
    assert_true(picture(w, 1, 6, 1700 * ms + 1000) == picture(w, 1, 7, 1200 * ms));
    assert_true(picture(w, 1, 7, 1700 * ms + 1000) == picture(w, 1, 8, 1300 * ms)); /* another trigger */
    sst_sim_world_close(w);
}

/* Somebody passes in the first 8 s of a loop; the wind repeats every 4 s. */
static void somebody_passes_behind_the_hedge_once_a_loop(void **state SST_UNUSED)
{
    struct sst_sim_world *w =
        sim_open("scene: hedge\ngrid: [1, 2]\nsize: [160, 192]\nstrip: false\nloop: {seconds: 20, rate_hz: 2}\n");
    const int64_t s = 1000000000;
    const uint32_t wind = picture(w, 0, 1, 8 * s), passes = picture(w, 0, 2, 4 * s);

    assert_true(passes != wind); /* the leaves are where they were */
    assert_int_equal(picture(w, 0, 3, 12 * s), wind);
    assert_int_equal(picture(w, 0, 4, 16 * s), wind);
    assert_true(picture(w, 0, 5, 9 * s) != wind);
    assert_int_equal(picture(w, 0, 6, 24 * s), passes);
    assert_int_equal(picture(w, 0, 7, 28 * s), wind);
    assert_int_equal(picture(w, 0, 8, 0), wind); /* still outside */
    sst_sim_world_close(w);
}

/* --- seed and cache ----------------------------------------------------------------------------------------------- */

#define NOISY                                                                                                          \
    "scene: cell\ngrid: [1, 2]\nsize: [160, 192]\nsensor: {full_well_e: 5000, read_noise_e: 5,\n"                      \
    "  gain_spread_percent: 5}\noptics: {distortion_spread: [0.02, 0, 0, 0, 0]}\nloop: {seconds: 0.2}\n"

/* The one prepared loop in the folder, or NULL. */
static uint8_t *prepared(size_t *bytes, char path[512])
{
    DIR *dir = opendir(test_folder);
    uint8_t *data = NULL;
    struct dirent *d;

    assert_non_null(dir);
    while ((d = readdir(dir))) {
        if (!strstr(d->d_name, ".loop"))
            continue;
        assert_null(data);
        snprintf(path, 512, "%s/%s", test_folder, d->d_name);
        assert_int_equal(sst_file_read(path, SIM_CAPACITY, &data, bytes), 0);
    }
    closedir(dir);
    return data;
}

static void the_same_seed_gives_the_same_bytes(void **state SST_UNUSED)
{
    size_t n[3];
    uint8_t *data[3];
    char path[512];

    for (int i = 0; i < 3; i++) {
        struct sst_sim_world *w = sim_open(i < 2 ? NOISY : NOISY "seed: 2\n");

        data[i] = malloc(SIM_CAPACITY);
        n[i] = sim_frame(w, &example, V4L2_PIX_FMT_MJPEG, 160, 192);
        memcpy(data[i], sim_out, n[i]);
        sst_sim_world_close(w);
        free(prepared(&(size_t){ 0 }, path));
        assert_int_equal(unlink(path), 0);
    }
    assert_int_equal(n[0], n[1]);
    assert_memory_equal(data[0], data[1], n[0]);
    assert_true(n[0] != n[2] || memcmp(data[0], data[2], n[0]) != 0);
    for (int i = 0; i < 3; i++)
        free(data[i]);
}

static void a_damaged_cache_is_made_again(void **state SST_UNUSED)
{
    struct sst_sim_world *w = sim_open(SMALL);
    size_t size, got, bytes = sim_frame(w, &example, V4L2_PIX_FMT_MJPEG, 160, 192);
    uint8_t *want = malloc(bytes), *data;
    char path[512];

    assert_non_null(want);
    memcpy(want, sim_out, bytes);
    sst_sim_world_close(w);
    data = prepared(&size, path);
    assert_non_null(data);
    for (int i = 0; i < 4; i++) {
        const size_t cut = i == 0 ? 0 : i == 1 ? 30 : i == 2 ? size - 1 : size;

        data[64] = (uint8_t)(i == 3 ? 0xFF : data[64]); /* an offset outside the file */
        data[63] = (uint8_t)(i == 3 ? 0xFF : data[63]);
        assert_int_equal(sst_file_write(path, data, cut), 0);
        w = sim_open(SMALL);
        got = sim_frame(w, &example, V4L2_PIX_FMT_MJPEG, 160, 192);
        assert_int_equal(got, bytes);
        assert_memory_equal(sim_out, want, bytes);
        sst_sim_world_close(w);
    }
    unlink(path);
    free(data);
    free(want);
}

/** A file of the cache's folder, last used at a time. */
static void cached(const char *name, time_t used)
{
    const struct timespec times[2] = { { .tv_sec = used }, { .tv_sec = used } };

    assert_int_equal(sst_file_write(test_path("%s", name), "x", 1), 0);
    assert_int_equal(utimensat(AT_FDCWD, test_path("%s", name), times, 0), 0);
}

/** Before a loop is written, leftovers of killed programs are removed, and of 20 loops the 15 used last are kept
 *  beside the new one. */
static void the_cache_does_not_grow_for_ever(void **state SST_UNUSED)
{
    const time_t now = time(NULL);
    char name[64];

    for (int i = 0; i < 20; i++) {
        snprintf(name, sizeof(name), "%032d.loop", i);
        cached(name, now - 100 * (i + 1));
    }
    cached("00000000000000000000000000000077.loop.tmp-abcdef", now - 4000);
    cached("00000000000000000000000000000078.loop.tmp-abcdef", now - 60);
    cached("notes.txt", now - 1000000);
    sst_sim_world_close(sim_open(SMALL));
    for (int i = 0; i < 20; i++) {
        snprintf(name, sizeof(name), "%032d.loop", i);
        assert_int_equal(sst_path_exists(test_path("%s", name)), i < 15);
    }
    assert_false(sst_path_exists(test_path("00000000000000000000000000000077.loop.tmp-abcdef")));
    assert_true(sst_path_exists(test_path("00000000000000000000000000000078.loop.tmp-abcdef")));
    assert_true(sst_path_exists(test_path("notes.txt")));
}

/* --- world files -------------------------------------------------------------------------------------------------- */

static void a_fault_in_a_world_file_is_named_with_its_place(void **state SST_UNUSED)
{
    static const struct {
        const char *text, *words;
    } cases[] = {
        { "seed: 1\n", "scene" },
        { "scene: moon\n", "w.yaml:1:8: scene is not a scene" },
        { "scene: cat\nsizes: [160, 192]\n", "w.yaml:2:1" },
        { "scene: cat\nsize: [150, 192]\n", "w.yaml:2:7: size must be a multiple" },
        { "scene: cat\nsize: [160, 96]\n", "too small for the strip" },
        { "scene: cat\ngrid: [17, 17]\n", "289 cameras" },
        { "scene: cat\ngrid: [1.5, 2]\n", "whole" },
        { "scene: cat\nloop: 4\n", "w.yaml:2:7: loop must be a mapping" },
        { "scene: cat\nloop: {seconds: 60, rate_hz: 60}\n", "3600 frames" },
        { "scene: cat\nshutter: {kind: barn}\n", "kind" },
        { "scene: board\nboard: {squares: [20, 20]}\n", "markers for 100" },
        { "scene: board\nboard: {kind: aprilgrid, squares: [7, 7]}\n", "markers for 36" },
        { "scene: board\nboard: {poses: [{rotation_deg: [0, 0, 0]}]}\n", "position_mm" },
        { "scene: cat\noptics: {scene: board}\n", "their own optics" },
        { "scene: board\noptics: {scene: dog}\n", "is not a scene" },
        { "scene: board\noptics: {scene: hedge}\n", "is not a scene with optics" },
        { "scene: hedge\nrig: true\n", "an array of ideal cameras" },
        { "scene: hedge\noptics: {distortion: [0.1, 0, 0, 0, 0]}\n", "an array of ideal cameras" },
        { "scene: hedge\ncameras: [{camera: 3, rotation_deg: [0, 1, 0]}]\n", "an array of ideal cameras" },
        { "scene: hedge\nsize: [800, 600]\n", "at most 640 px" },
        { "scene: hedge\nloop: {seconds: 14}\n", "in steps of 4 s" },
        { "scene: cat\nboard: {poses: [{position_mm: 0, blur_px: 1}]}\n", "worlds of the scene board" },
        { "scene: cat\nstill: {}\n", "only to worlds with `rig: true`" },
        { "scene: cat\nrig: true\nstill: {card_mb: 0}\n", "card_mb" },
        { "scene: cat\nrig: true\nstill: {faults: [{fault: busy}]}\n", "shot" },
        { "scene: board\ncameras: [{camera: 0, moves: {at_pose: 20}}]\n", "at_pose" },
        { "scene: board\nrig: true\ncameras: [{camera: 0, moves: {at_pose: 1}}]\n", "only to arrays" },
        { "scene: board\ncameras: [{camera: 0, moves: 3}]\n", "at_pose" },
        { "scene: cat\ncameras: [{camera: 36}]\n", "camera" },
        { "scene: cat\ncameras: [{camera: 3, latency: 1}]\n", "latency" },
        { "scene: cat\noptics: {distortion: [-5, 0, 0, 0, 0]}\n", "folds" },
    };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        char said[SST_LOG_MAX] = "", *before;
        struct sst_sim_world *w = NULL;
        int err;

        assert_int_equal(sst_file_write(test_path("w.yaml"), cases[i].text, strlen(cases[i].text)), 0);
        before = sst_log_hold_errors(said);
        err = sst_sim_world_open(&w, test_path("w.yaml"), test_folder);
        sst_log_hold_errors(before);
        assert_true(err == -EBADMSG || err == -EINVAL);
        assert_null(w);
        assert_contains(said, cases[i].words);
    }
}

static void the_examples_can_be_read(void **state SST_UNUSED)
{
    static const char *const names[] = { "array", "board", "rig", "small", "small-rig", "still-rig" };

    for (size_t i = 0; i < ARRAY_LEN(names); i++) {
        struct sst_sim_settings settings = { 0 };
        char path[64];

        snprintf(path, sizeof(path), "simulators/scene/world/worlds/%s.yaml", names[i]);
        assert_int_equal(sst_sim_settings_read(&settings, path), 0);
        assert_int_equal(settings.rig, strstr(names[i], "rig") != NULL);
        assert_int_equal(settings.camera[7].given, !strcmp(names[i], "array") ? SST_SIM_DELAY : 0);
    }
}

static void an_unknown_world_and_an_unwritable_cache_are_told(void **state SST_UNUSED)
{
    char said[SST_LOG_MAX] = "", *before = sst_log_hold_errors(said);
    struct sst_sim_world *w = NULL;

    assert_int_equal(sst_sim_world_open(&w, "nowhere", test_folder), -EINVAL);
    assert_non_null(strstr(said, "nowhere"));
    assert_true(sst_sim_world_open(&w, "cat", "/proc/none/cache") < 0);
    assert_non_null(strstr(said, "/proc/none"));
    sst_log_hold_errors(before);
    assert_null(w);
    sst_sim_world_close(NULL);
}

/* A world that is new shows its first picture at once, the same as later, and moves when it is prepared; one that is closed
 * before leaves nothing behind. */
static void a_new_world_is_there_at_once(void **state SST_UNUSED)
{
    static const char text[] = "scene: hedge\ngrid: [1, 2]\nsize: [160, 192]\nstrip: false\nloop: {seconds: 12, rate_hz: 2}\n";
    struct sst_sim_exposure e = { .exposure_us = 5000, .gain = 1 };
    struct sst_sim_world *w;
    uint8_t *first;
    size_t bytes;

    assert_int_equal(sst_file_write(test_path("w.yaml"), text, sizeof(text) - 1), 0);
    for (int i = 0; i < 2; i++) { /* the first one is closed while it is prepared */
        assert_int_equal(sst_sim_world_open_at_once(&w, test_path("w.yaml"), test_folder), 0);
        if (!i)
            sst_sim_world_close(w);
    }
    e.t_ns = 0;
    bytes = sim_frame(w, &e, V4L2_PIX_FMT_MJPEG, 160, 192);
    first = malloc(bytes);
    assert_non_null(first);
    memcpy(first, sim_out, bytes);
    for (e.t_ns = 3000000000; sim_frame(w, &e, V4L2_PIX_FMT_MJPEG, 160, 192) == bytes && !memcmp(first, sim_out, bytes);)
        usleep(10000); /* until it moves */
    sst_sim_world_close(w);
    assert_int_equal(sst_sim_world_open(&w, test_path("w.yaml"), test_folder), 0); /* it is in the cache now */
    e.t_ns = 0;
    assert_int_equal(sim_frame(w, &e, V4L2_PIX_FMT_MJPEG, 160, 192), bytes);
    assert_memory_equal(first, sim_out, bytes);
    sst_sim_world_close(w);
    free(first);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(any_quality_and_width_makes_valid_frames, test_folder_create,
                                        test_folder_remove),
        cmocka_unit_test_setup_teardown(a_picture_without_room_for_the_strip_is_refused, test_folder_create,
                                        test_folder_remove),
        cmocka_unit_test_setup_teardown(formats_are_packed_as_v4l2_says, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(bayer_has_its_four_orders, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(every_format_and_size_carries_the_strip, test_folder_create,
                                        test_folder_remove),
        cmocka_unit_test_setup_teardown(what_no_camera_offers_is_refused, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(exposure_and_gain_change_the_light, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(the_loop_follows_time_and_a_trigger_shows_one_frame, test_folder_create,
                                        test_folder_remove),
        cmocka_unit_test_setup_teardown(somebody_passes_behind_the_hedge_once_a_loop, test_folder_create,
                                        test_folder_remove),
        cmocka_unit_test_setup_teardown(the_same_seed_gives_the_same_bytes, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(a_new_world_is_there_at_once, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(a_damaged_cache_is_made_again, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(the_cache_does_not_grow_for_ever, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(a_fault_in_a_world_file_is_named_with_its_place, test_folder_create,
                                        test_folder_remove),
        cmocka_unit_test_setup_teardown(the_examples_can_be_read, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(an_unknown_world_and_an_unwritable_cache_are_told, test_folder_create,
                                        test_folder_remove),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
