/* pipeline/image/blank.c, capture/array/masks.c: masked regions leave no information in frames, whatever their format; masks
 * of the reference view are placed where any point of the region is seen. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <linux/videodev2.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <jpeglib.h>

#include "base/log.h"
#include "capture/array/masks.h"
#include "config/sstd.h"
#include "pipeline/image/blank.h"
#include "pipeline/lightfield/rectify/rectify.h"
#include "simulators/scene/noise.h"
#include "tests/camera_project.h"
#include "tests/folder.h"
#include "tests/test.h"

#define WIDTH  168 /* no whole number of groups of blocks at 4:2:0 */
#define HEIGHT 100
#define COLS   21
#define ROWS   13

static uint8_t black[ROWS * COLS]; /* blocks of columns 4..9, rows 3..6 */
static const struct sst_blank_blocks blocks = { COLS, ROWS, black };

static void choose_blocks(int x0, int x1, int y0, int y1)
{
    memset(black, 0, sizeof(black));
    for (int y = y0; y < y1; y++)
        memset(&black[y * COLS + x0], 1, (size_t)(x1 - x0));
}

/* --- frames ------------------------------------------------------------------------------------------------------- */

struct kind {
    int h, v, components, restart;
    bool exif, progressive;
};

/* A picture that has other pixels in the chosen blocks for another `inner`. */
static size_t encode(unsigned char **out, struct kind k, uint64_t inner)
{
    struct jpeg_compress_struct c;
    struct jpeg_error_mgr errors;
    unsigned long bytes = 0;
    uint64_t outer = 5;
    JSAMPLE row[3 * WIDTH];
    JSAMPROW rows = row;

    *out = NULL;
    c.err = jpeg_std_error(&errors);
    jpeg_create_compress(&c);
    jpeg_mem_dest(&c, out, &bytes);
    c.image_width = WIDTH;
    c.image_height = HEIGHT;
    c.input_components = k.components;
    c.in_color_space = k.components == 1 ? JCS_GRAYSCALE : JCS_YCbCr;
    jpeg_set_defaults(&c);
    jpeg_set_quality(&c, 80, TRUE);
    c.comp_info[0].h_samp_factor = k.h;
    c.comp_info[0].v_samp_factor = k.v;
    c.restart_interval = (unsigned)k.restart;
    if (k.progressive)
        jpeg_simple_progression(&c);
    jpeg_start_compress(&c, TRUE);
    if (k.exif) {
        char text[80];

        snprintf(text, sizeof(text), "SECRET %llu", (unsigned long long)inner);
        jpeg_write_marker(&c, JPEG_APP0 + 1, (const JOCTET *)text, (unsigned)strlen(text));
        jpeg_write_marker(&c, JPEG_COM, (const JOCTET *)text, (unsigned)strlen(text));
    }
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++)
            for (int i = 0; i < k.components; i++) {
                const int base = x + 20 * (y / 16 % 3) + 30 * i, a = (int)(sst_random_u64(&outer) % 40);
                const int b = (int)(sst_random_u64(&inner) % 200);

                row[k.components * x + i] = (JSAMPLE)(black[y / 8 * COLS + x / 8] ? b + 20 : sst_min_int(base, 200) + a);
            }
        jpeg_write_scanlines(&c, &rows, 1);
    }
    jpeg_finish_compress(&c);
    jpeg_destroy_compress(&c);
    return bytes;
}

static struct sst_raw frame_of(const uint8_t *data, size_t bytes)
{
    return (struct sst_raw){ V4L2_PIX_FMT_MJPEG, WIDTH, HEIGHT, 0, data, bytes };
}

/* Pixels of the picture: 0 inside, but for two at the border, whose chroma is mixed with the outside; unchanged
 * outside, with the same exception. */
static void check_picture(const struct sst_raw *before, const struct sst_raw *after)
{
    struct sst_image a, b;

    assert_int_equal(sst_raw_decode(&a, before), 0);
    assert_int_equal(sst_raw_decode(&b, after), 0);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            int in = 0, n = 0;

            for (int j = sst_max_int(y - 2, 0); j <= sst_min_int(y + 2, HEIGHT - 1); j++)
                for (int i = sst_max_int(x - 2, 0); i <= sst_min_int(x + 2, WIDTH - 1); i++, n++)
                    in += black[j / 8 * COLS + i / 8];
            for (int k = 0; k < 3; k++) {
                const int was = sst_image_row(&a, k, y)[x], is = sst_image_row(&b, k, y)[x];

                if (in == n && is)
                    fail_msg("pixel %d,%d of colour %d is %d in the mask", x, y, k, is);
                if (!in && is != was)
                    fail_msg("pixel %d,%d of colour %d is %d instead of %d outside", x, y, k, is, was);
            }
        }
    sst_image_fini(&a);
    sst_image_fini(&b);
}

static const struct kind kinds[] = {
    { 1, 1, 3, 0, true }, { 2, 1, 3, 0, false }, { 2, 2, 3, 5, true }, { 1, 2, 3, 0, false }, { 1, 1, 1, 3, true },
    { 2, 2, 1, 0, false }, { 4, 1, 3, 0, false }, { 2, 2, 3, 0, true, true }, { 1, 1, 1, 0, false, true },
};

/* Two frames that differ in the masked region alone, in comments and behind the end are the same bytes afterwards. */
static void test_jpeg_keeps_nothing(void **state)
{
    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(kinds); i++) {
        uint8_t *first = NULL;
        size_t first_bytes = 0;
        struct sst_blank *b;

        choose_blocks(4, 12, 4, 8); /* whole groups of all samplings */
        assert_int_equal(sst_blank_create(&b), 0);
        for (uint64_t inner = 1; inner < 4; inner++) {
            unsigned char *data;
            size_t bytes = encode(&data, kinds[i], inner);
            struct sst_raw raw = frame_of(data, bytes), out;

            assert_int_equal(sst_blank_frame(b, &raw, &blocks, &out), 0);
            check_picture(&raw, &out);
            for (size_t at = 0; at + 6 <= out.bytes; at++)
                assert_memory_not_equal(out.data + at, "SECRET", 6);
            if (first) {
                assert_int_equal(out.bytes, first_bytes);
                assert_memory_equal(out.data, first, first_bytes);
            } else {
                first_bytes = out.bytes;
                first = malloc(first_bytes);
                assert_non_null(first);
                memcpy(first, out.data, first_bytes);
            }
            free(data);
        }
        free(first);
        sst_blank_destroy(b);
    }
}

/* A mask that ends within a group of blocks takes the whole group. */
static void test_jpeg_whole_groups(void **state)
{
    const struct kind k = { 2, 2, 3, 0, false };
    unsigned char *data;
    struct sst_blank *b;
    struct sst_image img;
    size_t bytes;
    struct sst_raw raw, out;

    (void)state;
    choose_blocks(5, 6, 5, 6);
    bytes = encode(&data, k, 1);
    raw = frame_of(data, bytes);
    assert_int_equal(sst_blank_create(&b), 0);
    assert_int_equal(sst_blank_frame(b, &raw, &blocks, &out), 0);
    assert_int_equal(sst_raw_decode(&img, &out), 0);
    for (int y = 34; y < 46; y++)
        for (int x = 34; x < 46; x++)
            assert_int_equal(sst_image_row(&img, 1, y)[x], 0);
    sst_image_fini(&img);
    free(data);
    sst_blank_destroy(b);
}

/* Damaged streams, whose pixels may lie anywhere: refused, or the region is black. */
static void test_jpeg_damaged(void **state)
{
    const struct kind k = { 2, 1, 3, 0, false };
    uint64_t seed = 3;
    unsigned char *data;
    struct sst_blank *b;
    int refused = 0;
    size_t bytes;

    (void)state;
    choose_blocks(4, 12, 4, 8);
    bytes = encode(&data, k, 1);
    assert_int_equal(sst_blank_create(&b), 0);
    for (int i = 0; i < 300; i++) {
        uint8_t *bad = malloc(bytes);
        struct sst_raw raw = frame_of(bad, i < 100 ? bytes * (size_t)(i + 1) / 101 : bytes), out = { 0 };
        int err;

        assert_non_null(bad);
        memcpy(bad, data, bytes);
        if (i >= 100)
            bad[sst_random_u64(&seed) % bytes] ^= (uint8_t)(1u << sst_random_u64(&seed) % 8);
        err = sst_blank_frame(b, &raw, &blocks, &out);
        refused += err == -EBADMSG;
        assert_true(!err || err == -EBADMSG);
        if (!err) {
            struct sst_image img;

            assert_int_equal(sst_raw_decode(&img, &out), 0);
            assert_int_equal(sst_image_row(&img, 1, 48)[64], 0);
            sst_image_fini(&img);
        }
        free(bad);
    }
    assert_true(refused >= 100);
    /* Other sizes and colours are refused before memory is taken. */
    {
        struct sst_raw raw = frame_of(data, bytes), out;
        const struct sst_blank_blocks few = { COLS - 1, ROWS, black };

        assert_int_equal(sst_blank_frame(b, &raw, &few, &out), -EINVAL);
        raw.height--;
        assert_int_equal(sst_blank_frame(b, &raw, &blocks, &out), -EBADMSG);
    }
    free(data);
    sst_blank_destroy(b);
}

static void test_raw_formats(void **state)
{
    static const uint32_t formats[] = { V4L2_PIX_FMT_GREY,   V4L2_PIX_FMT_Y16,    V4L2_PIX_FMT_YUYV,  V4L2_PIX_FMT_SBGGR8,
                                        V4L2_PIX_FMT_SGBRG8, V4L2_PIX_FMT_SGRBG8, V4L2_PIX_FMT_SRGGB8, V4L2_PIX_FMT_RGB24 };

    (void)state;
    choose_blocks(4, 10, 3, 7);
    for (size_t i = 0; i < ARRAY_LEN(formats); i++) {
        const size_t two = formats[i] == V4L2_PIX_FMT_Y16 || formats[i] == V4L2_PIX_FMT_YUYV ? 2 : 1;
        const size_t pixel = formats[i] == V4L2_PIX_FMT_RGB24 ? 3 : two;
        const size_t row = WIDTH * pixel, stride = row + 24, bytes = stride * HEIGHT;
        uint8_t *first = malloc(row * HEIGHT), *data = malloc(bytes);
        struct sst_blank *b;

        assert_int_equal(sst_blank_create(&b), 0);
        assert_true(sst_blank_format(formats[i]));
        assert_non_null(first);
        assert_non_null(data);
        for (uint64_t inner = 1; inner < 4; inner++) {
            struct sst_raw raw = { formats[i], WIDTH, HEIGHT, stride, data, bytes }, out;
            uint64_t outer = 9, in = inner;
            struct sst_image img;

            for (size_t at = 0; at < bytes; at++) {
                const int y = (int)(at / stride), x = (int)(at % stride / pixel);
                const bool masked = x >= WIDTH || black[y / 8 * COLS + x / 8];
                const uint64_t o = sst_random_u64(&outer), m = sst_random_u64(&in);

                data[at] = (uint8_t)(masked ? m : o);
            }
            assert_int_equal(sst_blank_frame(b, &raw, &blocks, &out), 0);
            assert_int_equal(out.bytes, row * HEIGHT);
            if (inner > 1)
                assert_memory_equal(out.data, first, out.bytes);
            memcpy(first, out.data, out.bytes);
            assert_memory_equal(out.data, data, 32 * pixel); /* left of the mask nothing changed */
            assert_int_equal(sst_raw_decode(&img, &out), 0);
            for (int y = 28; y < 52; y++)
                for (int x = 36; x < 76; x++)
                    for (int k = 0; k < 3; k++)
                        assert_int_equal(sst_image_row(&img, k, y)[x], 0);
            sst_image_fini(&img);
        }
        free(first);
        free(data);
        sst_blank_destroy(b);
    }
    assert_false(sst_blank_format(V4L2_PIX_FMT_NV12));
}

/* --- sets --------------------------------------------------------------------------------------------------------- */

static struct sst_array_config array; /* large */

static void set_array(int rows, int cols)
{
    sst_array_config_defaults(&array);
    array.rows = rows;
    array.cols = cols;
    array.width = WIDTH;
    array.height = HEIGHT;
    array.bound = rows * cols;
    for (int i = 0; i < array.bound; i++)
        array.camera[i] = (struct sst_config_camera){ .row = i / cols, .col = i % cols };
}

static void test_sets(void **state)
{
    static struct sst_masks_set out;
    static struct sst_frameset set;
    unsigned char *data;
    size_t bytes;
    struct sst_frame frame[3];
    struct sst_masks *m;

    (void)state;
    choose_blocks(4, 12, 4, 8);
    bytes = encode(&data, kinds[0], 1);
    set_array(1, 3);
    assert_int_equal(sst_masks_create(&m, &array), 0);
    assert_null(m); /* no masks */
    array.masks = 1;
    array.mask[0] = (struct sst_config_mask){ "a", 0, 1, 0.5, 0.5, 0.6, 1, "", INFINITY, 0 };
    assert_int_equal(sst_masks_create(&m, &array), 0);
    assert_true(sst_masks_share(m, 0) == 0 && sst_masks_share(m, 1) > 0.05 && sst_masks_share(m, 2) == 0);
    set = (struct sst_frameset){ .cameras = 3, .present = 3 };
    for (int i = 0; i < 3; i++) {
        frame[i] = (struct sst_frame){ .cam = i,          .fourcc = V4L2_PIX_FMT_MJPEG, .width = WIDTH, .height = HEIGHT,
                                       .data = data,      .bytes = bytes,               .sequence = 7 };
        set.frame[i] = &frame[i];
    }
    sst_masks_apply(m, &set, &out);
    assert_int_equal(out.set.present, 3);
    assert_int_equal(out.withheld, 0);
    assert_ptr_equal(out.set.frame[0], &frame[0]); /* untouched */
    assert_true(out.set.frame[1]->data != data && out.set.frame[1]->sequence == 7);
    assert_ptr_equal(set.frame[1]->data, data);

    frame[1].bytes /= 2;
    frame[2].bytes /= 2; /* no mask: as it is */
    sst_log_hold_errors(NULL);
    sst_masks_apply(m, &set, &out);
    assert_int_equal(out.set.present, 2);
    assert_int_equal(out.withheld, 1);
    assert_int_equal(out.cam[0], 1);
    assert_null(out.set.frame[1]);
    assert_non_null(set.frame[1]);
    sst_masks_destroy(m);
    free(data);
}

/* --- geometry ----------------------------------------------------------------------------------------------------- */

#define PITCH 50.0
#define NEAR  9.0 /* px per spacing */

/* An array of which no camera is exactly in its place. */
static void build_calibration(struct sst_calib *calib, uint64_t *seed)
{
    assert_int_equal(sst_calib_init(calib, 3, 4), 0);
    calib->width = 640;
    calib->height = 480;
    calib->range_mm = 4000;
    for (int k = 0; k < 12; k++) {
        struct sst_calib_camera *c = &calib->camera[k];
        const bool ref = k == calib->reference;
        double turn[3];

        c->known = true;
        snprintf(c->name, sizeof(c->name), "%02d_%02d", k / 4, k % 4);
        c->fx = c->fy = 600 + sst_random_in(seed, -10, 10);
        c->cx = 319.5 + sst_random_in(seed, -15, 15);
        c->cy = 239.5 + sst_random_in(seed, -15, 15);
        c->lens = 5;
        c->k[0] = -0.2 + sst_random_in(seed, -0.02, 0.02);
        c->k[1] = 0.04;
        for (int i = 0; i < 3; i++)
            turn[i] = ref ? 0 : sst_random_in(seed, -0.03, 0.03);
        sst_rotation_from_vector(turn, c->rotation);
        c->position_mm[0] = PITCH * (k % 4 - calib->reference % 4) + (ref ? 0 : sst_random_in(seed, -2, 2));
        c->position_mm[1] = PITCH * (k / 4 - calib->reference / 4) + (ref ? 0 : sst_random_in(seed, -2, 2));
        c->position_mm[2] = ref ? 0 : sst_random_in(seed, -2, 2);
    }
}

static uint8_t shown[12][640 * 480];

/* Frames of all cameras, masked, into `shown`. */
static void show(struct sst_masks *m)
{
    static struct sst_masks_set out;
    static struct sst_frameset set;
    static uint8_t grey[640 * 480];

    assert_true(array.bound <= 12);
    memset(grey, 200, sizeof(grey));
    for (int cam = 0; cam < array.bound; cam++) {
        struct sst_frame frame = { .cam = cam,  .fourcc = V4L2_PIX_FMT_GREY, .width = 640, .height = 480,
                                   .data = grey, .bytes = sizeof(grey) };

        set = (struct sst_frameset){ .cameras = array.bound, .present = 1 };
        set.frame[cam] = &frame;
        sst_masks_apply(m, &set, &out);
        memcpy(shown[cam], out.set.frame[cam]->data, sizeof(grey));
    }
}

static bool is_black(int cam, double x, double y)
{
    return !shown[cam][(int)floor(y + 0.5) * 640 + (int)floor(x + 0.5)];
}

/* Points of the region in space, at all depths behind the near one, are black wherever a camera sees them; ones well
 * outside it are seen. */
static void test_reference_view(void **state)
{
    const double x0 = 0.1, x1 = 0.35, y0 = 0.3, y1 = 0.6;
    uint64_t seed = 11;
    struct sst_calib calib;
    struct sst_rectified to;
    struct sst_masks *m;
    const char *path = test_path("calib.yaml");
    int seen = 0, free_seen = 0;

    (void)state;
    build_calibration(&calib, &seed);
    assert_int_equal(sst_calib_write(&calib, path), 0);
    assert_int_equal(sst_rectify_plan(&to, &calib, &(struct sst_rectify_config){ .plane_mm = -1 }), 0);
    set_array(3, 4);
    array.width = 640;
    array.height = 480;
    array.fourcc = V4L2_PIX_FMT_GREY;
    array.masks = 1;
    array.mask[0] = (struct sst_config_mask){ "garden", -1, -1, x0, y0, x1, y1, "", NEAR, 0 };
    snprintf(array.mask_calibration, sizeof(array.mask_calibration), "%s", path);
    assert_int_equal(sst_masks_create(&m, &array), 0);
    show(m);
    for (int i = 0; i < 250; i++) {
        const bool in = i % 2;
        const double d = in ? sst_random_in(&seed, 0.01, NEAR) : 2 * NEAR; /* others: in front, beyond the region's shadow */
        const double px = in ? sst_random_in(&seed, x0, x1) * 640 - 0.5 : sst_random_in(&seed, 0.8, 0.95) * 640;
        const double py = sst_random_in(&seed, y0, y1) * 480 - 0.5;
        const double z = to.focal_px * to.spacing_mm / d, *r = to.rotation;
        const double scale = to.view[to.reference].scale * to.focal_px;
        const double p[3] = { (px - to.cx) / scale * z, (py - to.cy) / scale * z, z };
        const double *c = calib.camera[to.reference].position_mm;
        double X[3];

        for (int k = 0; k < 3; k++)
            X[k] = r[k] * p[0] + r[3 + k] * p[1] + r[6 + k] * p[2] + c[k];
        for (int cam = 0; cam < 12; cam++) {
            double x, y;

            if (!camera_project(&calib.camera[cam], X, &x, &y) || x < 0 || y < 0 || x > 639 || y > 479)
                continue;
            if (in && !is_black(cam, x, y))
                fail_msg("camera %d sees the region at %.1f,%.1f px, disparity %.2f", cam, x, y, d);
            if (!in && is_black(cam, x, y))
                fail_msg("camera %d is black at %.1f,%.1f px, far from the region", cam, x, y);
            seen += in;
            free_seen += !in;
        }
    }
    assert_true(seen > 1000 && free_seen > 500);
    sst_masks_destroy(m);

    calib.camera[3].known = false; /* a camera without calibration shows nothing */
    assert_int_equal(sst_calib_write(&calib, path), 0);
    sst_log_set_level(SST_LOG_ERROR);
    assert_int_equal(sst_masks_create(&m, &array), 0);
    assert_true(sst_masks_share(m, 3) == 1 && sst_masks_share(m, 4) < 0.4);
    sst_masks_destroy(m);

    array.width = 320; /* another size: nothing is captured */
    assert_int_equal(sst_masks_create(&m, &array), -EBADMSG);
    assert_null(m);
    unlink(path);
    array.width = 640;
    assert_int_equal(sst_masks_create(&m, &array), -ENOENT);

    array.mask_calibration[0] = 0; /* on the lattice: x_k = x - d b_k */
    assert_int_equal(sst_masks_create(&m, &array), 0);
    show(m);
    assert_true(is_black(5, 0.2 * 640, 200) && !is_black(5, 0.5 * 640, 200)); /* the reference view */
    assert_true(is_black(4, 0.34 * 640 + NEAR, 200) && !is_black(6, 0.34 * 640 + NEAR + 14, 200));
    sst_masks_destroy(m);
    sst_calib_fini(&calib);
}

/* A corner on the edge of the reference view goes on beyond it, where other cameras see more. */
static void test_beyond_the_edge(void **state)
{
    struct sst_masks *m;

    (void)state;
    set_array(1, 3);
    array.width = 640;
    array.height = 480;
    array.fourcc = V4L2_PIX_FMT_GREY;
    array.masks = 1;
    array.mask[0] = (struct sst_config_mask){ "left", -1, -1, 0, 0, 0.25, 1, "", 20, 0 };
    assert_int_equal(sst_masks_create(&m, &array), 0);
    show(m);
    for (int cam = 0; cam < 3; cam++)
        for (int x = 2; x < 120; x += 9)
            assert_true(is_black(cam, x, 300));
    assert_false(is_black(1, 250, 300));
    sst_masks_destroy(m);
}

/* A region that widens towards the edge is black as drawn, and so is a region whose outline crosses itself. */
static void test_all_that_is_drawn(void **state)
{
    struct sst_masks *m;

    (void)state;
    set_array(1, 3);
    array.width = 640;
    array.height = 480;
    array.fourcc = V4L2_PIX_FMT_GREY;
    array.masks = 1;
    array.mask[0] = (struct sst_config_mask){ "street", -1, -1, 0, 0, 1, 1, "0,0.3 0.4,0.4 0.4,0.5 0,0.8", 20, 0 };
    assert_int_equal(sst_masks_create(&m, &array), 0);
    show(m);
    for (int x = 2; x < 250; x += 4)
        for (int y = 0; y < 480; y += 4) {
            const double u = (x + 0.5) / 640, v = (y + 0.5) / 480;

            if (v > 0.3 + 0.25 * u && v < 0.8 - 0.75 * u && !is_black(1, x, y))
                fail_msg("%d,%d px of the region is seen", x, y);
        }
    for (int y = 150; y < 380; y += 10) /* beyond the edge the region has its height there */
        assert_true(is_black(0, 0, y) && is_black(0, 15, y));
    assert_false(is_black(1, 10, 100) || is_black(1, 10, 420) || is_black(1, 300, 216));
    sst_masks_destroy(m);

    for (int of = -1; of < 1; of++) { /* a star */
        array.mask[0] = (struct sst_config_mask){
            "star", of, of < 0 ? -1 : 1, 0, 0, 1, 1, "0.5,0.1 0.73,0.82 0.12,0.38 0.88,0.38 0.27,0.82", of < 0 ? 1 : INFINITY, 0
        };
        assert_int_equal(sst_masks_create(&m, &array), 0);
        show(m);
        assert_true(is_black(1, 320, 80) && is_black(1, 320, 240) && !is_black(1, 320, 400));
        sst_masks_destroy(m);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_jpeg_keeps_nothing), cmocka_unit_test(test_jpeg_whole_groups),
        cmocka_unit_test(test_jpeg_damaged),       cmocka_unit_test(test_raw_formats),
        cmocka_unit_test(test_sets),               cmocka_unit_test(test_reference_view),
        cmocka_unit_test(test_beyond_the_edge),    cmocka_unit_test(test_all_that_is_drawn),
    };

    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
