/* pipeline/image/jpeg_parts.c, daemon/storage/parts.c, capture/recording/picture.c: of a camera's frames only what
 * differs from a whole one is recorded, and read as whole pictures again. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include <jpeglib.h>

#include "base/log.h"
#include "capture/recording/recording.h"
#include "daemon/storage/storage_internal.h"
#include "pipeline/image/jpeg_parts.h"
#include "pipeline/image/raw.h"
#include "simulators/scene/noise.h"
#include "tests/folder.h"
#include "tests/test.h"

#define WIDTH  320
#define HEIGHT 200 /* the last row of blocks is no whole one */
#define SIDE   48  /* of moving pixels */
#define TOP    64

struct jpeg {
    unsigned char *data;
    unsigned long bytes;
};

/* A picture with noise of 2 levels, before which something stands. @param x  negative: nothing */
static struct jpeg picture(int x, int width, int quality, uint64_t seed)
{
    struct jpeg_compress_struct c;
    struct jpeg_error_mgr errors;
    struct jpeg out = { 0 };
    JSAMPLE row[3 * WIDTH];

    c.err = jpeg_std_error(&errors);
    jpeg_create_compress(&c);
    jpeg_mem_dest(&c, &out.data, &out.bytes);
    c.image_width = (JDIMENSION)width;
    c.image_height = HEIGHT;
    c.input_components = 3;
    c.in_color_space = JCS_YCbCr;
    jpeg_set_defaults(&c);
    jpeg_set_quality(&c, quality, TRUE);
    c.comp_info[0].h_samp_factor = 2; /* 4:2:2, as cameras have it */
    c.comp_info[0].v_samp_factor = 1;
    jpeg_start_compress(&c, TRUE);
    for (int y = 0; y < HEIGHT; y++) {
        JSAMPROW rows = row;

        for (int i = 0; i < width; i++) {
            const bool in = x >= 0 && i >= x && i < x + SIDE && y >= TOP && y < TOP + SIDE;
            const int noise = (int)(sst_random_u64(&seed) % 5) - 2;

            row[3 * i] = (JSAMPLE)((in ? 210 : 60 + i / 4 + (y / 8 % 2) * 30) + noise);
            row[3 * i + 1] = (JSAMPLE)(in ? 90 : 128);
            row[3 * i + 2] = (JSAMPLE)(in ? 160 : 128 + i / 16);
        }
        jpeg_write_scanlines(&c, &rows, 1);
    }
    jpeg_finish_compress(&c);
    jpeg_destroy_compress(&c);
    return out;
}

static struct sst_jpeg_bytes bytes_of(struct jpeg j)
{
    return (struct sst_jpeg_bytes){ j.data, j.bytes };
}

static void decode(struct sst_image *out, const uint8_t *data, size_t bytes)
{
    assert_int_equal(sst_raw_decode(out, &(struct sst_raw){ V4L2_PIX_FMT_MJPEG, WIDTH, HEIGHT, 0, data, bytes }), 0);
}

/* The largest difference of two pictures in columns x0..x1-1 of rows y0..y1-1. */
static int largest(const struct sst_image *a, const struct sst_image *b, int x0, int x1, int y0, int y1)
{
    int most = 0;

    for (int c = 0; c < 3; c++)
        for (int y = y0; y < y1; y++)
            for (int x = x0; x < x1; x++)
                most = sst_max_int(most, abs(sst_image_row(a, c, y)[x] - sst_image_row(b, c, y)[x]));
    return most;
}

static void what_changed_stays_bit_by_bit(void **state)
{
    struct jpeg base = picture(16, WIDTH, 85, 1), whole = picture(160, WIDTH, 85, 2);
    struct sst_image was = { 0 }, is = { 0 }, joined = { 0 };
    struct sst_jpeg_bytes parts, again;
    uint8_t *data, *joint;
    int64_t base_ns = 0;
    double share;
    size_t n;

    (void)state;
    assert_int_equal(sst_jpeg_parts_cut(&(struct sst_jpeg_pair){ bytes_of(base), bytes_of(whole), WIDTH, HEIGHT },
                                        INT64_C(1795600000123456789), &data, &n, &share),
                     0);
    assert_true(n < whole.bytes / 2);
    assert_true(share > 0.08 && share < 0.3); /* where it stands and where it stood, 48x48 px each, and a margin */
    parts = (struct sst_jpeg_bytes){ data, n };
    assert_true(sst_jpeg_parts_base(parts, &base_ns) && base_ns == INT64_C(1795600000123456789));
    assert_false(sst_jpeg_parts_base(bytes_of(whole), &base_ns));
    assert_int_equal(sst_jpeg_parts_join(&(struct sst_jpeg_pair){ bytes_of(base), parts, WIDTH, HEIGHT }, &joint, &n),
                     0);
    again = (struct sst_jpeg_bytes){ joint, n };
    assert_false(sst_jpeg_parts_base(again, &base_ns)); /* whole again */
    decode(&was, base.data, base.bytes);
    decode(&is, whole.data, whole.bytes);
    decode(&joined, joint, n);
    assert_int_equal(largest(&joined, &is, 160, 160 + SIDE, TOP, TOP + SIDE), 0);
    assert_int_equal(largest(&joined, &was, 280, WIDTH, 0, HEIGHT),
                     0); /* nothing moved there: as in the base, noise and all */
    assert_true(largest(&joined, &is, 0, WIDTH, 0, HEIGHT) < 20); /* noise of both */
    assert_true(largest(&was, &is, 0, WIDTH, 0, HEIGHT) > 100);
    free(data);
    free(joint);
    sst_image_fini(&was);
    sst_image_fini(&is);
    sst_image_fini(&joined);
    free(base.data);
    free(whole.data);
}

/* Others are refused, and bytes of any kind do no harm. */
static void what_is_no_part_is_refused(void **state)
{
    struct jpeg base = picture(16, WIDTH, 85, 1), narrow = picture(16, WIDTH - 32, 85, 1),
                coarse = picture(16, WIDTH, 40, 1);
    struct jpeg whole = picture(160, WIDTH, 85, 2);
    const struct sst_jpeg_bytes noise = { (const uint8_t *)"no JPEG at all", 14 };
    uint8_t *data, *joint;
    uint64_t seed = 5;
    size_t n, unused;

    (void)state;
    assert_int_equal(sst_jpeg_parts_cut(&(struct sst_jpeg_pair){ bytes_of(narrow), bytes_of(whole), WIDTH, HEIGHT }, 1,
                                        &data, &n, NULL),
                     -EINVAL);
    assert_int_equal(sst_jpeg_parts_cut(&(struct sst_jpeg_pair){ bytes_of(coarse), bytes_of(whole), WIDTH, HEIGHT }, 1,
                                        &data, &n, NULL),
                     -EINVAL);
    assert_int_equal(
        sst_jpeg_parts_cut(&(struct sst_jpeg_pair){ noise, bytes_of(whole), WIDTH, HEIGHT }, 1, &data, &n, NULL),
        -EINVAL);
    assert_int_equal(
        sst_jpeg_parts_join(&(struct sst_jpeg_pair){ bytes_of(base), bytes_of(whole), WIDTH, HEIGHT }, &joint, &n),
        -EINVAL);
    assert_int_equal(sst_jpeg_parts_cut(&(struct sst_jpeg_pair){ bytes_of(base), bytes_of(whole), WIDTH, HEIGHT }, 1,
                                        &data, &n, NULL),
                     0);
    assert_int_equal(sst_jpeg_parts_join(
                         &(struct sst_jpeg_pair){ bytes_of(narrow), (struct sst_jpeg_bytes){ data, n }, WIDTH, HEIGHT },
                         &joint, &unused),
                     -EINVAL);
    for (int i = 0; i < 200; i++) { /* bytes that are wrong, and ends that are missing */
        uint8_t *bad = malloc(n);
        const size_t left = i % 2 ? n : 1 + sst_random_u64(&seed) % n;

        memcpy(bad, data, n);
        for (int k = 0; k < 3; k++)
            bad[sst_random_u64(&seed) % n] = (uint8_t)sst_random_u64(&seed);
        if (!sst_jpeg_parts_join(
                &(struct sst_jpeg_pair){ bytes_of(base), (struct sst_jpeg_bytes){ bad, left }, WIDTH, HEIGHT }, &joint,
                &unused))
            free(joint);
        free(bad);
    }
    free(data);
    free(base.data);
    free(narrow.data);
    free(coarse.data);
    free(whole.data);
}

/* Let its header claim a side. */
static void claim(uint8_t *jpeg, size_t bytes, unsigned side)
{
    for (size_t i = 0; i + 9 < bytes; i++) {
        if (jpeg[i] == 0xFF && jpeg[i + 1] == 0xC0) {
            jpeg[i + 5] = jpeg[i + 7] = (uint8_t)(side >> 8);
            jpeg[i + 6] = jpeg[i + 8] = (uint8_t)side;
            return;
        }
    }
    fail();
}

static long peak_kb(void)
{
    struct rusage use;

    assert_int_equal(getrusage(RUSAGE_SELF, &use), 0);
    return use.ru_maxrss;
}

/* A few bytes that claim a large picture take no memory, whatever size is expected. */
static void sizes_are_checked_before_memory_is_taken(void **state)
{
    struct jpeg base = picture(16, WIDTH, 85, 1), whole = picture(160, WIDTH, 85, 2);
    uint8_t *data, *joint;
    struct sst_jpeg_bytes parts;
    struct sst_image img;
    long before;
    size_t n, unused;

    (void)state;
    assert_int_equal(sst_jpeg_parts_cut(&(struct sst_jpeg_pair){ bytes_of(base), bytes_of(whole), WIDTH, HEIGHT }, 1,
                                        &data, &n, NULL),
                     0);
    parts = (struct sst_jpeg_bytes){ data, n };
    claim(base.data, base.bytes, 8000);
    claim(whole.data, whole.bytes, 8000);
    claim(data, n, 8000);
    before = peak_kb();
    assert_int_equal(
        sst_jpeg_parts_join(&(struct sst_jpeg_pair){ bytes_of(base), parts, WIDTH, HEIGHT }, &joint, &unused), -EINVAL);
    assert_int_equal(sst_jpeg_parts_join(&(struct sst_jpeg_pair){ bytes_of(base), parts, 8000, 8000 }, &joint, &unused),
                     -EINVAL);
    assert_int_equal(sst_jpeg_parts_cut(&(struct sst_jpeg_pair){ bytes_of(base), bytes_of(whole), WIDTH, HEIGHT }, 1,
                                        &joint, &unused, NULL),
                     -EINVAL);
    claim(whole.data, whole.bytes, 4000); /* below the size that a file is compared with */
    assert_int_equal(
        sst_raw_decode(&img, &(struct sst_raw){ V4L2_PIX_FMT_MJPEG, WIDTH, HEIGHT, 0, whole.data, whole.bytes }),
        -EBADMSG);
    assert_true(peak_kb() - before < 16 * 1024);
    free(data);
    free(base.data);
    free(whole.data);
}

#define SETS 8

/* Recorded and read again: whole sets once a minute, parts between them, a frame that is damaged whole. */
static void recordings_of_parts_are_read_as_pictures(void **state)
{
    struct sst_recorder_track track[2] = { { .row = 0, .col = 0 }, { .row = 0, .col = 1 } };
    struct sst_recorder_config cfg;
    struct sst_recorder *recorder;
    struct sst_recording *r;
    struct sst_recording_set *got = malloc(sizeof(*got));
    struct set_parts *parts = calloc(1, sizeof(*parts));
    struct jpeg made[SETS][2];
    size_t whole = 0, part = 0;

    (void)state;
    sst_recorder_config_defaults(&cfg);
    cfg.dir = test_path("parts");
    cfg.rows = 1;
    cfg.cols = cfg.cameras = 2;
    cfg.tracks = track;
    cfg.fourcc = V4L2_PIX_FMT_MJPEG;
    cfg.width = WIDTH;
    cfg.height = HEIGHT;
    if (!WITH_AVFORMAT) {
        print_message("built without libavformat: nothing can be recorded\n");
        skip();
    }
    assert_int_equal(sst_recorder_open(&recorder, &cfg), 0);
    for (int i = 0; i < SETS; i++) {
        const int64_t t_ns = INT64_C(1000000000) * (1 + 15 * i);
        struct sst_frameset set = { .index = (uint64_t)i,
                                    .t_ns = t_ns,
                                    .wall_ns = INT64_C(1795600000000000000) + t_ns,
                                    .cameras = 2,
                                    .present = 2 };
        struct sst_frame frame[2];
        const struct sst_frameset *written;

        for (int k = 0; k < 2; k++) {
            made[i][k] = picture(20 * i + 8 * k, WIDTH, 85, (uint64_t)(10 * i + k));
            frame[k] = (struct sst_frame){ .cam = k,
                                           .fourcc = cfg.fourcc,
                                           .width = WIDTH,
                                           .height = HEIGHT,
                                           .data = made[i][k].data,
                                           .bytes = made[i][k].bytes,
                                           .t_ns = t_ns,
                                           .arrival_ns = t_ns,
                                           .faults = i == 3 && k ? SST_FRAME_NO_EOI : 0 };
            set.frame[k] = &frame[k];
        }
        written = set_parts_of(parts, &set);
        assert_int_equal(written == &set, i % 4 == 0); /* 60 s after the one before */
        assert_int_equal(sst_recorder_write(recorder, written), 0);
        set_parts_written(parts, written);
    }
    assert_int_equal(sst_recorder_close(recorder), 0);
    assert_int_equal(sst_recording_open(&r, cfg.dir), 0);
    assert_int_equal(sst_recording_sets(r), SETS);
    for (int i = 0; i < SETS; i++) {
        assert_int_equal(sst_recording_set(r, i, got), 0);
        for (int k = 0; k < 2; k++) {
            const bool in_parts = i % 4 && !(i == 3 && k);
            struct sst_image is = { 0 }, read = { 0 };
            uint8_t *data;
            size_t n;

            assert_int_equal((got->frame[k].faults & SST_FRAME_PARTS) != 0, in_parts);
            *(in_parts ? &part : &whole) += got->frame[k].bytes;
            assert_int_equal(sst_recording_picture(r, got, k, &data, &n), 0);
            decode(&is, made[i][k].data, made[i][k].bytes);
            decode(&read, data, n);
            assert_int_equal(largest(&read, &is, 20 * i + 8 * k, 20 * i + 8 * k + SIDE, TOP, TOP + SIDE), 0);
            assert_true(largest(&read, &is, 0, WIDTH, 0, HEIGHT) < 20);
            free(data);
            sst_image_fini(&is);
            sst_image_fini(&read);
            free(made[i][k].data);
        }
    }
    assert_true(part / 11 < whole / 5 / 2);
    sst_recording_close(r);
    set_parts_forget(parts);
    free(parts);
    free(got);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_changed_stays_bit_by_bit),
        cmocka_unit_test(what_is_no_part_is_refused),
        cmocka_unit_test(sizes_are_checked_before_memory_is_taken),
        cmocka_unit_test_setup_teardown(recordings_of_parts_are_read_as_pictures, test_folder_create,
                                        test_folder_remove),
    };

    sst_log_set_level(SST_LOG_WARNING);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
