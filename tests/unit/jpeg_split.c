/* pipeline/image/jpeg_split: parts of pictures of every kind against libjpeg's blocks of the whole, pictures that
 * cannot be cut, and damaged ones; raw views against the same pictures packed. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jpeglib.h>

#include "base/frame.h"
#include "capture/array/ring.h"
#include "pipeline/image/jpeg_split.h"
#include "simulators/scene/noise.h"
#include "tests/test.h"

static uint64_t seed = 1;

struct kind {
    struct sst_jpeg_grid grid;
    int h, v, components, restart;
    bool progressive, thumbnail;
};

static uint8_t *encode(const struct kind *k, size_t *bytes)
{
    const int width = k->grid.cols * k->grid.width, height = k->grid.rows * k->grid.height;
    JSAMPLE *row = malloc((size_t)width * 3);
    struct jpeg_compress_struct c;
    struct jpeg_error_mgr errors;
    unsigned char *data = NULL;
    unsigned long size = 0;

    c.err = jpeg_std_error(&errors);
    jpeg_create_compress(&c);
    jpeg_mem_dest(&c, &data, &size);
    c.image_width = (JDIMENSION)width;
    c.image_height = (JDIMENSION)height;
    c.input_components = k->components;
    c.in_color_space = k->components == 1 ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_set_defaults(&c);
    c.comp_info[0].h_samp_factor = k->h;
    c.comp_info[0].v_samp_factor = k->v;
    c.restart_interval = (unsigned)k->restart;
    if (k->progressive)
        jpeg_simple_progression(&c);
    jpeg_start_compress(&c, TRUE);
    if (k->thumbnail) {
        static const JOCTET small[] = "Exif SECRET";

        jpeg_write_marker(&c, JPEG_APP0 + 1, small, sizeof(small));
        jpeg_write_marker(&c, JPEG_APP0, small, sizeof(small));
        jpeg_write_marker(&c, JPEG_COM, small, sizeof(small));
    }
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < k->components * width; x++)
            row[x] = (JSAMPLE)(100 + (x * 3 + y * 5) % 60 + (int)(sst_random_u64(&seed) % 64));
        jpeg_write_scanlines(&c, &row, 1);
    }
    jpeg_finish_compress(&c);
    jpeg_destroy_compress(&c);
    free(row);
    *bytes = size;
    return data;
}

static void open_blocks(struct jpeg_decompress_struct *d, struct jpeg_error_mgr *errors, struct sst_jpeg_bytes jpeg,
                        jvirt_barray_ptr **coefs)
{
    d->err = jpeg_std_error(errors);
    jpeg_create_decompress(d);
    jpeg_mem_src(d, jpeg.data, (unsigned long)jpeg.bytes);
    jpeg_read_header(d, TRUE);
    *coefs = jpeg_read_coefficients(d);
    assert_int_equal(errors->num_warnings, 0);
}

/* All blocks of a part equal the whole's at its place. */
static void assert_part(const struct kind *k, struct sst_jpeg_bytes whole, struct sst_jpeg_bytes part, int n)
{
    struct jpeg_decompress_struct d[2];
    struct jpeg_error_mgr errors[2];
    jvirt_barray_ptr *coefs[2];

    open_blocks(&d[0], &errors[0], whole, &coefs[0]);
    open_blocks(&d[1], &errors[1], part, &coefs[1]);
    assert_int_equal(d[1].image_width, k->grid.width);
    assert_int_equal(d[1].image_height, k->grid.height);
    for (int i = 0; i < d[1].num_components; i++) {
        const jpeg_component_info *info = &d[1].comp_info[i];
        const int mcu_w = k->components == 1 ? 8 : 8 * d[1].max_h_samp_factor,
                  mcu_h = k->components == 1 ? 8 : 8 * d[1].max_v_samp_factor;
        const int h = k->components == 1 ? 1 : info->h_samp_factor, v = k->components == 1 ? 1 : info->v_samp_factor;
        const JDIMENSION left = (JDIMENSION)(n % k->grid.cols * k->grid.width / mcu_w * h);
        const JDIMENSION top = (JDIMENSION)(n / k->grid.cols * k->grid.height / mcu_h * v);

        for (JDIMENSION y = 0; y < info->height_in_blocks; y++) {
            JBLOCKARRAY want = d[0].mem->access_virt_barray((j_common_ptr)&d[0], coefs[0][i], top + y, 1, FALSE);
            JBLOCKARRAY got = d[1].mem->access_virt_barray((j_common_ptr)&d[1], coefs[1][i], y, 1, FALSE);

            for (JDIMENSION x = 0; x < info->width_in_blocks; x++)
                assert_memory_equal(got[0][x], want[0][left + x], sizeof(JBLOCK));
        }
    }
    for (int i = 0; i < 2; i++) {
        jpeg_abort_decompress(&d[i]);
        jpeg_destroy_decompress(&d[i]);
    }
}

static void parts_have_the_blocks_of_the_whole(void **state SST_UNUSED)
{
    static const struct kind kinds[] = {
        { { 2, 2, 64, 48 }, 2, 1, 3, 0, false }, { { 2, 2, 64, 48 }, 2, 2, 3, 0, false },
        { { 1, 4, 48, 52 }, 2, 2, 3, 0, false }, /* the last row ends within a block */
        { { 3, 1, 50, 32 }, 2, 2, 3, 0, false }, /* and so do columns */
        { { 2, 2, 56, 40 }, 1, 1, 3, 0, false }, { { 2, 3, 40, 24 }, 1, 1, 1, 0, false },
        { { 2, 2, 64, 48 }, 2, 1, 3, 4, false }, /* restarts between cameras, */
        { { 2, 2, 64, 48 }, 2, 1, 3, 3, false }, /* and within them */
        { { 1, 1, 64, 48 }, 2, 2, 3, 0, false }, { { 2, 2, 64, 48 }, 2, 1, 3, 0, false, true },
    };
    struct sst_jpeg_split *split;

    assert_int_equal(sst_jpeg_split_create(&split), 0);
    for (size_t i = 0; i < ARRAY_LEN(kinds); i++) {
        struct sst_jpeg_bytes whole, part;
        char why[200] = "";
        uint8_t *data = encode(&kinds[i], &whole.bytes);

        whole.data = data;
        assert_int_equal(sst_jpeg_split_read(split, whole, &kinds[i].grid, why, sizeof(why)), 0);
        for (int n = kinds[i].grid.rows * kinds[i].grid.cols - 1; n >= 0; n--) {
            assert_int_equal(sst_jpeg_split_cut(split, n, &part), 0);
            assert_part(&kinds[i], whole, part, n);
            for (size_t at = 0; at + 6 <= part.bytes; at++) /* a small picture would show the other cameras */
                assert_memory_not_equal(part.data + at, "SECRET", 6);
        }
        free(data);
    }
    sst_jpeg_split_destroy(split);
    sst_jpeg_split_destroy(NULL);
}

static void other_pictures_are_refused(void **state SST_UNUSED)
{
    static const struct {
        struct kind k;
        int err;
        const char *words;
    } cases[] = {
        { { { 2, 2, 56, 48 }, 2, 1, 3, 0, false }, -EINVAL, "blocks of 16x8 pixels, and cameras of 56x48" },
        { { { 2, 1, 64, 40 }, 2, 2, 3, 0, false }, -EINVAL, "blocks of 16x16 pixels" },
        { { { 2, 2, 64, 48 }, 2, 1, 3, 0, true }, -EINVAL, "not of the baseline kind" },
    };
    struct sst_jpeg_split *split;
    struct sst_jpeg_bytes whole, part;
    struct sst_jpeg_grid other;
    char why[300] = "";
    uint8_t *data;

    assert_int_equal(sst_jpeg_split_create(&split), 0);
    assert_int_equal(sst_jpeg_split_cut(split, 0, &part), -EBADMSG); /* none was read */
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        data = encode(&cases[i].k, &whole.bytes);
        whole.data = data;
        assert_int_equal(sst_jpeg_split_read(split, whole, &cases[i].k.grid, why, sizeof(why)), cases[i].err);
        assert_contains(why, cases[i].words);
        assert_int_equal(sst_jpeg_split_cut(split, 0, &part), -EBADMSG);
        free(data);
    }
    const struct kind k = { { 2, 2, 64, 48 }, 2, 1, 3, 0, false };

    data = encode(&k, &whole.bytes);
    other = (struct sst_jpeg_grid){ 2, 2, 64, 40 };
    whole.data = data;
    assert_int_equal(sst_jpeg_split_read(split, whole, &other, why, sizeof(why)), -EBADMSG);
    for (size_t bytes = 0; bytes < whole.bytes - 40; bytes += 97) { /* cut off anywhere */
        uint8_t *less = memcpy(malloc(bytes + 1), data, bytes);

        assert_int_equal(sst_jpeg_split_read(split, (struct sst_jpeg_bytes){ less, bytes }, &k.grid, why, sizeof(why)),
                         -EBADMSG);
        free(less);
    }
    assert_int_equal(sst_jpeg_split_read(split, whole, &k.grid, why, sizeof(why)), 0); /* the next one is fine */
    free(data);
    sst_jpeg_split_destroy(split);
}

/* Views of a picture of 2x2 cameras, in a ring: each camera's own bytes, row by row. */
static void views_are_packed(void **state SST_UNUSED)
{
    enum { WIDTH = 6, HEIGHT = 4, STRIDE = 16 }; /* two columns of 6, padded */
    uint8_t whole[2 * HEIGHT * STRIDE], packed[WIDTH * HEIGHT];
    struct sst_frame view[4], out;
    struct sst_frameset set = { .cameras = 4, .present = 4 };
    struct sst_ring *ring;
    const struct sst_kept *kept;

    for (int i = 0; i < (int)sizeof(whole); i++)
        whole[i] = (uint8_t)i;
    for (int i = 0; i < 4; i++) {
        view[i] =
            (struct sst_frame){ .cam = i, .width = WIDTH, .height = HEIGHT, .stride = STRIDE, .row_bytes = WIDTH };
        view[i].data = whole + i / 2 * HEIGHT * STRIDE + i % 2 * WIDTH;
        view[i].bytes = (HEIGHT - 1) * STRIDE + WIDTH;
        set.frame[i] = &view[i];
    }
    assert_int_equal(sst_frame_packed_bytes(&view[3]), sizeof(packed));
    assert_int_equal(sst_frame_pack(&out, packed, &view[3]), sizeof(packed));
    assert_int_equal(out.bytes, sizeof(packed));
    assert_int_equal(out.stride, WIDTH);
    assert_int_equal(out.row_bytes, 0);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        assert_int_equal(packed[i], (HEIGHT + i / WIDTH) * STRIDE + WIDTH + i % WIDTH);
    assert_int_equal(sst_ring_create(&ring, 1 << 16), 0);
    assert_int_equal(sst_ring_put(ring, &set), 0);
    kept = sst_ring_get(ring, 0);
    assert_non_null(kept);
    assert_int_equal(kept->bytes, 4 * sizeof(packed));
    assert_memory_equal(kept->set.frame[3]->data, packed, sizeof(packed));
    sst_ring_unref(ring, kept);
    sst_ring_destroy(ring);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(parts_have_the_blocks_of_the_whole),
        cmocka_unit_test(other_pictures_are_refused),
        cmocka_unit_test(views_are_packed),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
