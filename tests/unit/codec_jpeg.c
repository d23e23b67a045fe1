/* pipeline/image: JPEG and its orientations, damaged files, files of other programs. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <errno.h>
#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jpeglib.h>
#include <linux/videodev2.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/codec_formats.h"
#include "pipeline/image/raw.h"
#include "tests/codec_pictures.h"
#include "tests/folder.h"

#define ROBUSTNESS "../shared/data/jpeg-robustness"

static void jpeg_stays_close(void **state SST_UNUSED)
{
    struct sst_image a, b;

    assert_int_equal(sst_image_init(&a, 50, 37), 0);
    for (int y = 0; y < 37; y++) {
        for (int x = 0; x < 50; x++) {
            sst_image_row(&a, 0, y)[x] = (uint8_t)(100 + x);
            sst_image_row(&a, 1, y)[x] = (uint8_t)(80 + y);
            sst_image_row(&a, 2, y)[x] = 60;
        }
    }
    assert_int_equal(sst_image_write_jpeg(&a, test_path("a.jpg"), 98), 0);
    assert_int_equal(sst_image_read(&b, test_path("a.jpg")), 0);
    assert_same_image(&a, &b, 4);
    sst_image_fini(&a);
    sst_image_fini(&b);
}

static void jpeg_is_decoded_small(void **state SST_UNUSED)
{
    static const struct {
        int least, width, height;
    } all[] = { { 1, 7, 5 }, { 12, 13, 10 }, { 13, 25, 19 }, { 25, 25, 19 }, { 26, 50, 37 }, { 90, 50, 37 }, { 0, 50, 37 } };
    struct sst_image a, b;
    uint8_t *data;
    size_t size;

    assert_int_equal(sst_image_init(&a, 50, 37), 0);
    for (int y = 0; y < 37; y++)
        for (int x = 0; x < 50; x++)
            for (int c = 0; c < 3; c++)
                sst_image_row(&a, c, y)[x] = (uint8_t)(60 + 2 * x + 40 * c);
    assert_int_equal(sst_image_encode_jpeg(&a, 98, &data, &size), 0);
    for (size_t i = 0; i < ARRAY_LEN(all); i++) {
        assert_int_equal(sst_jpeg_decode_small(&b, data, size, "x", all[i].least), 0);
        assert_true(b.width == all[i].width && b.height == all[i].height);
        for (int c = 0; c < 3; c++) {
            const int want = 60 + 2 * (b.width / 2) * 50 / b.width + 40 * c;

            assert_in_range(sst_image_row(&b, c, b.height / 2)[b.width / 2], want - 8, want + 16);
        }
        sst_image_fini(&b);
    }
    assert_int_equal(sst_jpeg_decode_small(&b, data, size / 2, "x", 12), -EBADMSG);
    free(data);
    sst_image_fini(&a);
}

enum jpeg_kind {
    BASELINE = 0,
    PROGRESSIVE = 1,
    RESTARTS = 2,
    SCANS = 3, /* one for each colour */
    ARITHMETIC = 4,
    JPEG_KINDS = 5,
};

static unsigned long put_jpeg(unsigned char **out, const struct sst_image *img, enum jpeg_kind kind)
{
    static const jpeg_scan_info scans[] = { { 1, { 0 }, 0, 63, 0, 0 },
                                            { 1, { 1 }, 0, 63, 0, 0 },
                                            { 1, { 2 }, 0, 63, 0, 0 } };
    struct jpeg_compress_struct c;
    struct jpeg_error_mgr errors;
    JSAMPLE row[3 * 64];
    JSAMPROW rows = row;
    unsigned long bytes = 0;

    *out = NULL;
    c.err = jpeg_std_error(&errors);
    jpeg_create_compress(&c);
    jpeg_mem_dest(&c, out, &bytes);
    c.image_width = (JDIMENSION)img->width;
    c.image_height = (JDIMENSION)img->height;
    c.input_components = 3;
    c.in_color_space = JCS_RGB;
    jpeg_set_defaults(&c);
    jpeg_set_quality(&c, 80, TRUE);
    if (kind == PROGRESSIVE)
        jpeg_simple_progression(&c);
    c.restart_interval = kind == RESTARTS ? 2 : 0;
    c.arith_code = kind == ARITHMETIC;
    if (kind == SCANS) {
        c.scan_info = scans;
        c.num_scans = 3;
    }
    jpeg_start_compress(&c, TRUE);
    for (int y = 0; y < img->height; y++) {
        for (int x = 0; x < img->width; x++)
            for (int k = 0; k < 3; k++)
                row[3 * x + k] = sst_image_row(img, k, y)[x];
        jpeg_write_scanlines(&c, &rows, 1);
    }
    jpeg_finish_compress(&c);
    jpeg_destroy_compress(&c);
    return bytes;
}

/* A JPEG that is cut anywhere decodes only to the very picture that the whole one has: without its end marker. */
static void jpegs_may_lack_their_end_marker(void **state SST_UNUSED)
{
    struct sst_image drawn = make_image(40, 30), whole, img;

    for (enum jpeg_kind kind = 0; kind < JPEG_KINDS; kind++) {
        unsigned char *data;
        const unsigned long bytes = put_jpeg(&data, &drawn, kind);
        char said[SST_LOG_MAX] = "", *before;
        unsigned long first = bytes;

        assert_int_equal(sst_image_decode(&whole, data, bytes, "t.jpg"), 0);
        before = sst_log_hold_errors(said);
        sst_log_set_level(SST_LOG_ERROR); /* each is warned about */
        for (unsigned long n = bytes - 1; n > 0; n--) {
            if (sst_image_decode(&img, data, n, "t.jpg"))
                continue;
            first = n;
            assert_same_image(&img, &whole, 0);
            sst_image_fini(&img);
        }
        sst_log_set_level(SST_LOG_WARNING);
        sst_log_hold_errors(before);
        /* A frame of a camera that ends early is damaged, as drivers/grab/check.c judges it. */
        assert_int_equal(sst_raw_decode(&img, &(struct sst_raw){ V4L2_PIX_FMT_MJPEG, 40, 30, 0, data, bytes }), 0);
        sst_image_fini(&img);
        assert_int_equal(sst_raw_decode(&img, &(struct sst_raw){ V4L2_PIX_FMT_MJPEG, 40, 30, 0, data, bytes - 2 }),
                         -EBADMSG);
        if (kind == ARITHMETIC ? first != bytes : first != bytes - 2)
            fail_msg("kind %d: %lu of %lu bytes are enough", (int)kind, first, bytes);
        sst_image_fini(&whole);
        free(data);
    }
    sst_image_fini(&drawn);
}

/* A TIFF structure of two tags, the second one the orientation. */
static size_t put_orientation(uint8_t *to, int orientation, bool little)
{
    static const uint8_t big_tags[] = { 'M', 'M', 0, 42, 0, 0, 0, 8,    0,    2, 1, 0, 0, 4, 0, 0, 0, 1, 0,
                                        0,   0,   1, 1,  0x12, 0, 3, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0 };
    static const uint8_t little_tags[] = { 'I', 'I', 42, 0, 8, 0,    0, 0, 2, 0, 0, 1, 4, 0, 1, 0, 0, 0, 1,
                                           0,   0,   0,  0x12, 1, 3, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0 };

    memcpy(to, little ? little_tags : big_tags, sizeof(big_tags));
    to[little ? 30 : 31] = (uint8_t)orientation;
    return sizeof(big_tags);
}

/* Where rows and columns begin, by EXIF 2.3, 4.6.4: the first row is at the top, the first column at the left ... */
static void orientations_are_those_of_exif(void **state SST_UNUSED)
{
    static const char row[] = "?ttbblrrl", column[] = "?lrrlttbb";
    struct sst_image img = make_image(24, 16), stored, got;
    uint8_t *data, file[8192] = { 0xFF, 0xD8, 0xFF, 0xE1 }, saved;
    const char *path = test_path("turned.jpg");
    size_t size;

    assert_int_equal(sst_image_encode_jpeg(&img, 90, &data, &size), 0);
    assert_int_equal(sst_image_decode(&stored, data, size, "stored"), 0);
    for (int i = 2; i < 18; i++) {
        const size_t tiff = put_orientation(file + 12, i / 2, i % 2), length = 8 + tiff;

        file[4] = (uint8_t)(length >> 8);
        file[5] = (uint8_t)length;
        memcpy(file + 6, "Exif\0", 6);
        assert_true(12 + tiff + size - 2 <= sizeof(file));
        memcpy(file + 12 + tiff, data + 2, size - 2);
        put_file("turned.jpg", file, 12 + tiff + size - 2);
        assert_int_equal(sst_image_read_orientation(path), i / 2);
        assert_int_equal(sst_image_read_upright(&got, path), 0);
        for (int y = 0; y < 16; y++) {
            for (int x = 0; x < 24; x++) {
                const char r = row[i / 2], c = column[i / 2];
                const int at_y = r == 't' ? y : r == 'b' ? 15 - y : c == 't' ? x : 23 - x;
                const int at_x = c == 'l' ? x : c == 'r' ? 23 - x : r == 'l' ? y : 15 - y;

                assert_int_equal(sst_image_row(&got, 1, at_y)[at_x], sst_image_row(&stored, 1, y)[x]);
            }
        }
        sst_image_fini(&got);
    }
    /* Cut anywhere, and with absurd numbers in it, a file has none. */
    for (size_t n = 0; n < 12 + 38; n++)
        assert_int_equal(sst_image_orientation(file, n), 1);
    for (int i = 6; i < 50; i++) {
        saved = file[i];
        file[i] = 0xFF;
        assert_in_range(sst_image_orientation(file, 12 + 38), 1, 8);
        file[i] = saved;
    }
    free(data);
    sst_image_fini(&img);
    sst_image_fini(&stored);
}

/* Every proper prefix of a file, and every file with one byte changed, is refused or decodes: no crash, no leak. A
 * prefix never decodes, unless it lacks the end marker of a JPEG alone. */
static void cut_and_damaged_files_are_refused(void **state SST_UNUSED)
{
    static const char *const names[] = { "cut.png", "cut.jpg", "cut.pfm" };
    struct sst_image a = make_image(40, 30), img;
    struct sst_map_f32 m, f;
    uint8_t *data;
    size_t size;

    assert_int_equal(sst_map_f32_init(&m, 5, 4), 0);
    assert_int_equal(sst_image_write_png(&a, test_path("cut.png")), 0);
    assert_int_equal(sst_image_write_jpeg(&a, test_path("cut.jpg"), 90), 0);
    assert_int_equal(sst_map_f32_write_pfm(&m, test_path("cut.pfm")), 0);
    for (size_t i = 0; i < 2; i++) {
        assert_int_equal(sst_file_read(test_path("%s", names[i]), 1 << 20, &data, &size), 0);
        for (size_t n = 0; n < size - 2 * i; n++) /* a JPEG may lack its end marker */
            assert_int_equal(sst_image_decode(&img, data, n, names[i]), -EBADMSG);
        for (size_t n = 0; n < size; n++) {
            data[n] ^= 0x40;
            if (!sst_image_decode(&img, data, size, names[i])) {
                assert_int_equal(i, 1); /* PNG has checksums, JPEG has none */
                sst_image_fini(&img);
            }
            data[n] ^= 0x40;
        }
        free(data);
    }
    assert_int_equal(sst_file_read(test_path("cut.pfm"), 1 << 20, &data, &size), 0);
    for (size_t n = 0; n < size; n += 3) {
        put_file("short.pfm", data, n);
        assert_int_equal(sst_map_f32_read_pfm(&f, test_path("short.pfm")), -EBADMSG);
    }
    free(data);
    sst_map_f32_fini(&m);
    sst_image_fini(&a);
}

/* --- files of other programs -------------------------------------------------------------------------------------- */

/* A JPEG file with bytes inserted before position `at`. */
static int decode_with(const uint8_t *jpeg, size_t size, size_t at, const void *bytes, size_t n, struct sst_image *img)
{
    char said[SST_LOG_MAX] = "", *before = sst_log_hold_errors(said);
    uint8_t *made = malloc(size + n);
    int err;

    assert_non_null(made);
    memcpy(made, jpeg, at);
    memcpy(made + at, bytes, n);
    memcpy(made + at + n, jpeg + at, size - at);
    err = sst_image_decode(img, made, size + n, "stray.jpg");
    sst_log_hold_errors(before);
    free(made);
    if (err)
        assert_non_null(strstr(said, "extraneous bytes"));
    return err;
}

static void bytes_that_make_no_sample_are_no_damage(void **state SST_UNUSED)
{
    static const uint8_t stray[64] = { 1, 2, 3 };
    struct sst_image a = make_image(70, 50), want, got;
    uint8_t *jpeg;
    size_t size;

    assert_int_equal(sst_image_write_jpeg(&a, test_path("sound.jpg"), 90), 0);
    assert_int_equal(sst_file_read(test_path("sound.jpg"), 1 << 20, &jpeg, &size), 0);
    assert_int_equal(sst_image_decode(&want, jpeg, size, "sound.jpg"), 0);
    /* After the first segment, before the end: as long as it may be alignment, and longer than any. */
    assert_int_equal(decode_with(jpeg, size, 20, stray, sizeof(stray), &got), 0);
    assert_same_image(&want, &got, 0);
    sst_image_fini(&got);
    assert_int_equal(decode_with(jpeg, size, size - 2, stray, 3, &got), 0);
    assert_same_image(&want, &got, 0);
    sst_image_fini(&got);
    assert_int_equal(decode_with(jpeg, size, size - 2, stray, sizeof(stray), &got), -EBADMSG);
    assert_memory_equal(jpeg + 6, "JFIF", 5);
    jpeg[11] = 9; /* the revision */
    assert_int_equal(sst_image_decode(&got, jpeg, size, "revision.jpg"), 0);
    assert_same_image(&want, &got, 0);
    sst_image_fini(&got);
    sst_image_fini(&want);
    sst_image_fini(&a);
    free(jpeg);
}

/* A hierarchical file is not damaged. */
static void kinds_that_are_not_read_are_named(void **state SST_UNUSED)
{
    char said[SST_LOG_MAX] = "", *before;
    struct sst_image a = make_image(40, 30), got;
    uint8_t *jpeg, *at;
    size_t size;

    assert_int_equal(sst_image_write_jpeg(&a, test_path("kind.jpg"), 90), 0);
    assert_int_equal(sst_file_read(test_path("kind.jpg"), 1 << 20, &jpeg, &size), 0);
    at = memmem(jpeg, size, "\xFF\xC0", 2);
    assert_non_null(at);
    at[1] = 0xC5;
    before = sst_log_hold_errors(said);
    assert_int_equal(sst_image_decode(&got, jpeg, size, "kind.jpg"), -EBADMSG);
    sst_log_hold_errors(before);
    assert_non_null(strstr(said, "of a kind that is not read (Unsupported"));
    sst_image_fini(&a);
    free(jpeg);
}

/* Ink with two samples of each row in one, which is no subsampling that TurboJPEG knows. */
static void cmyk_is_read(void **state SST_UNUSED)
{
    for (int adobe = 0; adobe < 2; adobe++) {
        struct jpeg_compress_struct jpeg;
        struct jpeg_error_mgr errors;
        unsigned char *data = NULL;
        unsigned long size = 0;
        struct sst_image img;
        JSAMPLE row[4 * 32];

        for (int i = 0; i < 4 * 32; i++)
            row[i] = (JSAMPLE)((const int[]){ 200, 100, 50, 220 }[i % 4] ^ (adobe ? 0 : 255));
        jpeg.err = jpeg_std_error(&errors);
        jpeg_create_compress(&jpeg);
        jpeg_mem_dest(&jpeg, &data, &size);
        jpeg.image_width = jpeg.image_height = 32;
        jpeg.input_components = 4;
        jpeg.in_color_space = JCS_CMYK;
        jpeg_set_defaults(&jpeg);
        jpeg.write_Adobe_marker = adobe;
        jpeg.comp_info[0].h_samp_factor = 2;
        jpeg_start_compress(&jpeg, TRUE);
        while (jpeg.next_scanline < 32)
            (void)jpeg_write_scanlines(&jpeg, &(JSAMPROW){ row }, 1);
        jpeg_finish_compress(&jpeg);
        jpeg_destroy_compress(&jpeg);
        assert_int_equal(sst_image_decode(&img, data, size, "cmyk.jpg"), 0);
        for (int c = 0; c < 3; c++)
            assert_in_range(sst_image_row(&img, c, 9)[9], ((const int[]){ 172, 86, 43 })[c] - 2,
                            ((const int[]){ 174, 88, 45 })[c] + 2);
        sst_image_fini(&img);
        free(data);
    }
}

static int decoded, refused, compared;

static bool ends_in(const char *path, const char *end)
{
    const size_t n = strlen(path), m = strlen(end);

    return n >= m && !strcmp(path + n - m, end);
}

/* The reference picture beside a JPEG, decoded by another decoder: DCT and up-sampling may differ slightly. */
static void compare_with_png(const char *path, const struct sst_image *img)
{
    char png[SST_PATH_MAX];
    struct sst_image want;
    double sum = 0;

    snprintf(png, sizeof(png), "%.*s.png", (int)(strlen(path) - 4), path);
    if (!sst_path_exists(png))
        return;
    assert_int_equal(sst_image_read(&want, png), 0);
    assert_int_equal(img->width, want.width);
    assert_int_equal(img->height, want.height);
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < img->height; y++) {
            for (int x = 0; x < img->width; x++)
                sum += abs(sst_image_row(img, c, y)[x] - sst_image_row(&want, c, y)[x]);
        }
    }
    if (sum / (3.0 * img->width * img->height) > 2.0)
        print_error("%s differs by %.2f on average\n", path, sum / (3.0 * img->width * img->height));
    assert_true(sum / (3.0 * img->width * img->height) <= 2.0);
    compared++;
    sst_image_fini(&want);
}

static int read_one(const char *path, const struct stat *st SST_UNUSED, int type, struct FTW *ftw SST_UNUSED)
{
    struct sst_image img;
    int width, height, err;

    if (type != FTW_F)
        return 0;
    err = sst_image_read(&img, path);
    assert_true(err == 0 || err == -EBADMSG);
    if (err) {
        refused++;
        if (strstr(path, "reftest/") && ends_in(path, ".jpg"))
            print_message("refused: %s\n", path);
        return 0;
    }
    decoded++;
    assert_int_equal(sst_image_read_size(path, &width, &height), 0);
    assert_true(width == img.width && height == img.height);
    if (ends_in(path, ".jpg"))
        compare_with_png(path, &img);
    sst_image_fini(&img);
    return 0;
}

static void files_of_others_decode_or_are_refused(void **state SST_UNUSED)
{
    if (!sst_path_is_dir(ROBUSTNESS)) {
        print_message("no " ROBUSTNESS "\n");
        skip();
    }
    assert_int_equal(nftw(ROBUSTNESS, read_one, 16, FTW_PHYS), 0);
    print_message("%d decoded, %d of them compared, %d refused\n", decoded, compared, refused);
    assert_true(compared > 30);
    assert_true(refused > 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(jpeg_stays_close),
        cmocka_unit_test(jpeg_is_decoded_small),
        cmocka_unit_test(orientations_are_those_of_exif),
        cmocka_unit_test(jpegs_may_lack_their_end_marker),
        cmocka_unit_test(cut_and_damaged_files_are_refused),
        cmocka_unit_test(kinds_that_are_not_read_are_named),
        cmocka_unit_test(bytes_that_make_no_sample_are_no_damage),
        cmocka_unit_test(cmyk_is_read),
        cmocka_unit_test(files_of_others_decode_or_are_refused),
    };

    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
