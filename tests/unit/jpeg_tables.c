/* Huffman tables that a JPEG leaves out: the tables of annex K.3 are put in, and no other byte is touched. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <turbojpeg.h>

#include "pipeline/image/jpeg_tables.h"
#include "tests/test.h"

enum { WIDTH = 64, HEIGHT = 48 };

static uint8_t picture[WIDTH * HEIGHT * 3];

static uint8_t *encode(int format, int subsampling, int flags, size_t *size)
{
    tjhandle tj = tjInitCompress();
    unsigned char *jpeg = NULL;
    unsigned long bytes = 0;
    uint8_t *copy;

    for (size_t i = 0; i < sizeof(picture); i++)
        picture[i] = (uint8_t)(i * 2654435761u >> 13);
    assert_int_equal(tjCompress2(tj, picture, WIDTH, 0, HEIGHT, format, &jpeg, &bytes, subsampling, 85, flags), 0);
    tjDestroy(tj);
    copy = malloc(bytes);
    assert_non_null(copy);
    memcpy(copy, jpeg, bytes);
    *size = bytes;
    tjFree(jpeg);
    return copy;
}

/* Remove DHT segments: all, or all but the first. @return new size */
static size_t strip(uint8_t *data, size_t size, int keep)
{
    for (size_t at = 2; data[at + 1] != 0xda;) {
        const size_t length = 2 + ((size_t)data[at + 2] << 8 | data[at + 3]);

        if (data[at + 1] == 0xc4 && keep-- <= 0) {
            memmove(data + at, data + at + length, size - at - length);
            size -= length;
        } else {
            at += length;
        }
    }
    return size;
}

static void decode(uint8_t *rgb, const uint8_t *data, size_t size)
{
    tjhandle tj = tjInitDecompress();

    assert_int_equal(tjDecompress2(tj, data, size, rgb, WIDTH, 0, HEIGHT, TJPF_RGB, 0), 0);
    tjDestroy(tj);
}

/* Definitions of a file by class and destination, as in DHT. */
static void gather(uint8_t out[4][256], const uint8_t *data)
{
    memset(out, 0, 4 * 256);
    for (size_t at = 2; data[at + 1] != 0xda; at += 2 + ((size_t)data[at + 2] << 8 | data[at + 3])) {
        const size_t end = at + 2 + ((size_t)data[at + 2] << 8 | data[at + 3]);

        for (size_t p = at + 4; data[at + 1] == 0xc4 && p < end;) {
            size_t n = 17;

            for (int i = 1; i <= 16; i++)
                n += data[p + (size_t)i];
            memcpy(out[(data[p] >> 4) * 2 + (data[p] & 1)], data + p, n);
            p += n;
        }
    }
}

static void missing_tables_are_those_of_the_standard(void **state SST_UNUSED)
{
    static const int kinds[][2] = { { TJPF_RGB, TJSAMP_422 }, { TJPF_RGB, TJSAMP_420 }, { TJPF_GRAY, TJSAMP_GRAY } };

    for (size_t i = 0; i < ARRAY_LEN(kinds); i++)
        for (int keep = 0; keep < (kinds[i][1] == TJSAMP_GRAY ? 2 : 4); keep++) {
            static uint8_t is[WIDTH * HEIGHT * 3], want[WIDTH * HEIGHT * 3], defined[4][256], standard[4][256];
            size_t size, bare, bytes;
            uint8_t *jpeg = encode(kinds[i][0], kinds[i][1], 0, &size), *out;

            decode(want, jpeg, size);
            gather(standard, jpeg);
            bare = strip(jpeg, size, keep);
            assert_true(bare < size);
            out = sst_jpeg_complete(jpeg, bare, &bytes);
            assert_non_null(out);
            assert_int_equal(bytes, bare + 420);
            gather(defined, out);
            for (int k = 0; k < 4; k++)
                if (standard[k][1] || standard[k][2] || standard[k][3]) /* grey has two */
                    assert_memory_equal(defined[k], standard[k], 256);
            decode(is, out, bytes);
            assert_memory_equal(is, want, sizeof(is));
            free(out);
            free(jpeg);
        }
}

static void what_has_tables_stays(void **state SST_UNUSED)
{
    static const int flags[] = { 0, TJFLAG_PROGRESSIVE };
    static const uint8_t png[] = { 0x89, 'P', 'N', 'G', 0xff, 0xda };
    size_t size, bytes;
    uint8_t *out = sst_jpeg_complete(png, sizeof(png), &bytes);

    assert_int_equal(bytes, sizeof(png));
    assert_memory_equal(out, png, sizeof(png));
    free(out);
    for (size_t i = 0; i < ARRAY_LEN(flags); i++) {
        uint8_t *jpeg = encode(TJPF_RGB, TJSAMP_420, flags[i], &size);

        out = sst_jpeg_complete(jpeg, size, &bytes);
        assert_int_equal(bytes, size);
        assert_memory_equal(out, jpeg, size);
        free(out);
        free(jpeg);
    }
}

/* Cut anywhere, or with any one byte wrong, no byte beyond the end is read, and all bytes are still there. */
static void damaged_files_are_copied(void **state SST_UNUSED)
{
    size_t size, bare;
    uint8_t *jpeg = encode(TJPF_RGB, TJSAMP_422, 0, &size);

    bare = strip(jpeg, size, 1);
    for (size_t n = 0; n < 2 * bare; n++) {
        const size_t cut = n < bare ? n : bare;
        uint8_t *data = malloc(cut ? cut : 1), *out;
        size_t bytes;

        assert_non_null(data);
        memcpy(data, jpeg, cut);
        if (n >= bare)
            data[n - bare] ^= 0xff;
        out = sst_jpeg_complete(data, cut, &bytes);
        assert_non_null(out);
        assert_true(bytes == cut || bytes == cut + 420);
        assert_memory_equal(out, data, cut < 2 ? cut : 2);
        free(out);
        free(data);
        if (n > 2000 && n < bare) /* within the coded data nothing is new */
            n += 97;
        if (n == bare + 1000)
            break;
    }
    free(jpeg);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(missing_tables_are_those_of_the_standard),
        cmocka_unit_test(what_has_tables_stays),
        cmocka_unit_test(damaged_files_are_copied),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
