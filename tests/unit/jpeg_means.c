/* pipeline/image/jpeg_means: against libjpeg's own decoding at 1/8, on every kind of frame, and on damaged ones. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/image/jpeg_means.h"
#include "simulators/scene/noise.h"
#include "tests/test.h"

#define WIDTH_MAX  200
#define HEIGHT_MAX 120
#define CELLS_MAX  (((WIDTH_MAX + 7) / 8) * ((HEIGHT_MAX + 7) / 8))

static uint64_t seed = 1;

struct kind {
    int width, height, h, v, quality, restart, components;
    bool optimise, progressive;
};

struct frame {
    unsigned char *data;
    unsigned long bytes;
};

/* Smooth, with detail and noise. */
static int sample(int x, int y, int c)
{
    const int v =
        128 + (x * (c + 3) % 150 - 75) + ((x / 5 + y / 7) % 2 ? 30 : -30) + (int)(sst_random_u64(&seed) % 32) - 16;

    return v < 0 ? 0 : v > 255 ? 255 : v;
}

static struct frame encode(const struct kind *k)
{
    struct jpeg_compress_struct c;
    struct jpeg_error_mgr errors;
    struct frame f = { 0 };
    JSAMPLE row[3 * WIDTH_MAX];

    c.err = jpeg_std_error(&errors);
    jpeg_create_compress(&c);
    jpeg_mem_dest(&c, &f.data, &f.bytes);
    c.image_width = (JDIMENSION)k->width;
    c.image_height = (JDIMENSION)k->height;
    c.input_components = k->components;
    c.in_color_space = k->components == 1 ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_set_defaults(&c);
    jpeg_set_quality(&c, k->quality, TRUE);
    c.comp_info[0].h_samp_factor = k->h;
    c.comp_info[0].v_samp_factor = k->v;
    c.restart_interval = (unsigned)k->restart;
    c.optimize_coding = k->optimise;
    if (k->progressive)
        jpeg_simple_progression(&c);
    jpeg_start_compress(&c, TRUE);
    for (int y = 0; y < k->height; y++) {
        JSAMPROW rows = row;

        for (int x = 0; x < k->components * k->width; x++)
            row[x] = (JSAMPLE)sample(x / k->components, y, x % k->components);
        jpeg_write_scanlines(&c, &rows, 1);
    }
    jpeg_finish_compress(&c);
    jpeg_destroy_compress(&c);
    return f;
}

/* --- the plain twin: libjpeg's blocks, whole ---------------------------------------------------------------------- */

static void assert_means(const struct kind *k, const struct frame *f, int16_t *const got[3])
{
    struct jpeg_decompress_struct d;
    struct jpeg_error_mgr errors;
    jvirt_barray_ptr *coefs;

    d.err = jpeg_std_error(&errors);
    jpeg_create_decompress(&d);
    jpeg_mem_src(&d, f->data, f->bytes);
    jpeg_read_header(&d, TRUE);
    coefs = jpeg_read_coefficients(&d);
    for (int i = 0; i < d.num_components; i++) {
        const jpeg_component_info *info = &d.comp_info[i];

        for (JDIMENSION y = 0; y < info->height_in_blocks; y++) {
            JBLOCKARRAY row = d.mem->access_virt_barray((j_common_ptr)&d, coefs[i], y, 1, FALSE);

            for (JDIMENSION x = 0; x < info->width_in_blocks; x++) {
                const int want = sst_clamp_int(1024 + row[0][x][0] * info->quant_table->quantval[0], 0, 2047);

                if (got[i][y * info->width_in_blocks + x] != want)
                    fail_msg("%dx%d %dx%d q%d r%d: component %d block (%u, %u): %d, not %d", k->width, k->height, k->h,
                             k->v, k->quality, k->restart, i, x, y, got[i][y * info->width_in_blocks + x], want);
            }
        }
    }
    jpeg_abort_decompress(&d);
    jpeg_destroy_decompress(&d);
}

static jmp_buf escape;

static void on_error(j_common_ptr c)
{
    (void)c;
    longjmp(escape, 1);
}

static void on_message(j_common_ptr c, int level)
{
    (void)c;
    (void)level;
}

/* @return what sst_jpeg_means_read() does, or -EPROTO where libjpeg refuses the headers. The bytes lie in memory of
 * their own, which ends with them. */
static int read_means(struct sst_jpeg_means *m, const void *data, size_t bytes, int16_t *const out[3])
{
    struct jpeg_decompress_struct d;
    struct jpeg_error_mgr errors;
    unsigned char *copy = malloc(bytes ? bytes : 1);
    int err;

    memcpy(copy, data, bytes);
    d.err = jpeg_std_error(&errors);
    errors.error_exit = on_error;
    errors.emit_message = on_message;
    jpeg_create_decompress(&d);
    if (setjmp(escape)) {
        jpeg_destroy_decompress(&d);
        free(copy);
        return -EPROTO;
    }
    jpeg_mem_src(&d, copy, bytes);
    jpeg_read_header(&d, TRUE);
    err = d.image_width <= WIDTH_MAX && d.image_height <= HEIGHT_MAX ? sst_jpeg_means_read(m, &d, out, NULL) : -EPROTO;
    jpeg_destroy_decompress(&d);
    free(copy);
    return err;
}

static int16_t means[3][CELLS_MAX];
static int16_t *const out[3] = { means[0], means[1], means[2] };

static const struct kind kinds[] = {
    { 192, 112, 2, 1, 75, 0, 3, false, false },  { 192, 112, 2, 2, 90, 0, 3, false, false },
    { 200, 120, 1, 1, 50, 0, 3, false, false },  { 185, 99, 2, 2, 75, 0, 3, false, false },
    { 185, 99, 1, 2, 95, 0, 3, true, false },    { 185, 99, 4, 1, 100, 0, 3, true, false },
    { 9, 7, 2, 2, 75, 0, 3, false, false },      { 1, 1, 1, 1, 75, 0, 3, false, false },
    { 185, 99, 1, 1, 75, 0, 1, false, false },   { 185, 99, 2, 2, 75, 0, 1, true, false },
    { 192, 112, 2, 1, 75, 12, 3, false, false }, { 185, 99, 2, 2, 85, 5, 3, true, false },
    { 192, 112, 2, 1, 75, 1, 3, false, false },  { 185, 99, 1, 1, 1, 0, 3, true, false },
};

static void means_are_those_of_the_blocks(void **state)
{
    struct sst_jpeg_means *m;

    (void)state;
    assert_int_equal(sst_jpeg_means_create(&m), 0);
    for (size_t i = 0; i < 3 * sizeof(kinds) / sizeof(*kinds); i++) {
        const struct kind *k = &kinds[i % (sizeof(kinds) / sizeof(*kinds))];
        struct frame f = encode(k);

        assert_int_equal(read_means(m, f.data, f.bytes, out), 0);
        assert_means(k, &f, out);
        free(f.data);
    }
    sst_jpeg_means_destroy(m);
}

/* --- cuts: the same blocks, by libjpeg ---------------------------------------------------------------------------- */

static void open_blocks(struct jpeg_decompress_struct *d, struct jpeg_error_mgr *errors, const unsigned char *data,
                        size_t bytes, jvirt_barray_ptr **coefs)
{
    d->err = jpeg_std_error(errors);
    jpeg_create_decompress(d);
    jpeg_mem_src(d, data, bytes);
    jpeg_read_header(d, TRUE);
    *coefs = jpeg_read_coefficients(d);
    assert_int_equal(errors->num_warnings, 0);
}

static void assert_cut(const struct kind *k, const struct frame *f, const struct frame *cut,
                       const struct sst_jpeg_part *part)
{
    struct jpeg_decompress_struct d[2];
    struct jpeg_error_mgr errors[2];
    jvirt_barray_ptr *coefs[2];

    open_blocks(&d[0], &errors[0], f->data, f->bytes, &coefs[0]);
    open_blocks(&d[1], &errors[1], cut->data, cut->bytes, &coefs[1]);
    for (int i = 0; i < d[1].num_components; i++) {
        const jpeg_component_info *info = &d[1].comp_info[i];
        const int across = k->components == 1 ? 1 : info->h_samp_factor,
                  down = k->components == 1 ? 1 : info->v_samp_factor;

        for (JDIMENSION y = 0; y < info->height_in_blocks; y++) {
            const JDIMENSION from = y + (JDIMENSION)(part->y0 * down);
            JBLOCKARRAY want = d[0].mem->access_virt_barray((j_common_ptr)&d[0], coefs[0][i], from, 1, FALSE);
            JBLOCKARRAY got = d[1].mem->access_virt_barray((j_common_ptr)&d[1], coefs[1][i], y, 1, FALSE);

            for (JDIMENSION x = 0; x < info->width_in_blocks; x++)
                assert_memory_equal(got[0][x], want[0][x + (JDIMENSION)(part->x0 * across)], sizeof(JBLOCK));
        }
    }
    for (int i = 0; i < 2; i++) {
        jpeg_abort_decompress(&d[i]);
        jpeg_destroy_decompress(&d[i]);
    }
}

static int below(int n)
{
    return (int)(sst_random_u64(&seed) % (uint64_t)n);
}

/* @return cuts that were made */
static int try_cuts(struct sst_jpeg_means *m, const struct kind *k, struct sst_jpeg_index *index)
{
    struct frame f = encode(k);
    struct jpeg_decompress_struct d;
    struct jpeg_error_mgr errors;
    int made = 0;

    d.err = jpeg_std_error(&errors);
    jpeg_create_decompress(&d);
    jpeg_mem_src(&d, f.data, f.bytes);
    jpeg_read_header(&d, TRUE);
    assert_int_equal(sst_jpeg_means_read(m, &d, out, index), 0);
    assert_true(index->valid);
    for (int i = 0; i < 20; i++) {
        struct sst_jpeg_part part = { .x0 = below(index->mcus_x), .y0 = below(index->mcus_y) };
        const uint8_t *data;
        size_t bytes;
        int err;

        part.x1 = part.x0 + 1 + below(index->mcus_x - part.x0);
        part.y1 = part.y0 + 1 + below(index->mcus_y - part.y0);
        err = sst_jpeg_cut(m, &(struct sst_jpeg_frame){ f.data, &d, index }, &part, &data, &bytes);
        if (err && (err != -ENOTSUP || !k->optimise)) /* optimised codes have only the words that the frame needs */
            fail_msg("%dx%d %dx%d r%d: %d", k->width, k->height, k->h, k->v, k->restart, err);
        if (err)
            continue;
        assert_cut(k, &f, &(struct frame){ (unsigned char *)(uintptr_t)data, bytes }, &part);
        made++;
    }
    jpeg_destroy_decompress(&d);
    free(f.data);
    return made;
}

static void cuts_have_the_same_blocks(void **state)
{
    struct sst_jpeg_mcu mcu[CELLS_MAX + 1];
    struct sst_jpeg_index index = { .room = CELLS_MAX + 1, .mcu = mcu };
    struct sst_jpeg_means *m;

    (void)state;
    assert_int_equal(sst_jpeg_means_create(&m), 0);
    for (size_t i = 0; i < sizeof(kinds) / sizeof(*kinds); i++)
        assert_true(try_cuts(m, &kinds[i], &index) == 20 || kinds[i].optimise);
    index.room = 10; /* too little is noticed */
    {
        struct frame f = encode(&kinds[0]);
        struct jpeg_decompress_struct d;
        struct jpeg_error_mgr errors;

        d.err = jpeg_std_error(&errors);
        jpeg_create_decompress(&d);
        jpeg_mem_src(&d, f.data, f.bytes);
        jpeg_read_header(&d, TRUE);
        assert_int_equal(sst_jpeg_means_read(m, &d, out, &index), 0);
        assert_false(index.valid);
        jpeg_destroy_decompress(&d);
        free(f.data);
    }
    sst_jpeg_means_destroy(m);
}

/* Frames of video leave out the tables that everybody knows. */
static void frames_without_tables_are_read(void **state)
{
    struct frame f = encode(&kinds[0]);
    struct sst_jpeg_means *m;
    unsigned long at = 2, n = 2;

    (void)state;
    assert_int_equal(sst_jpeg_means_create(&m), 0);
    while (f.data[at + 1] != 0xDA) {
        const unsigned long size = 2 + ((unsigned long)f.data[at + 2] << 8 | f.data[at + 3]);

        if (f.data[at + 1] != 0xC4) {
            memmove(f.data + n, f.data + at, size);
            n += size;
        }
        at += size;
    }
    memmove(f.data + n, f.data + at, f.bytes - at);
    f.bytes -= at - n;
    assert_int_equal(read_means(m, f.data, f.bytes, out), 0);
    assert_means(&kinds[0], &f, out);
    free(f.data);
    sst_jpeg_means_destroy(m);
}

static void other_codes_are_told(void **state)
{
    const struct kind progressive = { 100, 80, 2, 2, 75, 0, 3, false, true };
    struct frame f = encode(&progressive);
    struct sst_jpeg_means *m;

    (void)state;
    assert_int_equal(sst_jpeg_means_create(&m), 0);
    assert_int_equal(read_means(m, f.data, f.bytes, out), -ENOTSUP);
    free(f.data);
    sst_jpeg_means_destroy(m);
}

/* Wherever the bytes end, the frame is refused, unless only the marker of its end is gone. */
static void cut_frames_are_refused(void **state)
{
    struct sst_jpeg_means *m;

    (void)state;
    assert_int_equal(sst_jpeg_means_create(&m), 0);
    for (size_t i = 0; i < sizeof(kinds) / sizeof(*kinds); i++) {
        struct frame f = encode(&kinds[i]);

        for (size_t bytes = 0; bytes + 4 < f.bytes; bytes += 1 + f.bytes / 97)
            assert_int_not_equal(read_means(m, f.data, bytes, out), 0);
        free(f.data);
    }
    sst_jpeg_means_destroy(m);
}

/* Damage anywhere gives an answer and stays inside the memory (the sanitizers see to that). */
static void damaged_frames_do_no_harm(void **state)
{
    struct sst_jpeg_means *m;
    int refused = 0;

    (void)state;
    assert_int_equal(sst_jpeg_means_create(&m), 0);
    for (int i = 0; i < 1500; i++) {
        struct frame f = encode(&kinds[(size_t)i % (sizeof(kinds) / sizeof(*kinds))]);
        const int hits = 1 + (int)(sst_random_u64(&seed) % 8);

        for (int k = 0; k < hits; k++)
            f.data[sst_random_u64(&seed) % f.bytes] = i % 3 ? (unsigned char)sst_random_u64(&seed) : 0xFF;
        refused += read_means(m, f.data, f.bytes, out) != 0;
        free(f.data);
    }
    assert_true(refused > 300);
    sst_jpeg_means_destroy(m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(means_are_those_of_the_blocks),  cmocka_unit_test(cuts_have_the_same_blocks),
        cmocka_unit_test(frames_without_tables_are_read), cmocka_unit_test(other_codes_are_told),
        cmocka_unit_test(cut_frames_are_refused),         cmocka_unit_test(damaged_frames_do_no_harm),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
