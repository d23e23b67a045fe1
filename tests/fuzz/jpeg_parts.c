/* Fuzz target: JPEGs of which only parts were recorded, and ones with black blocks. Two bytes say how long the first picture is. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <string.h>

#include <linux/videodev2.h>

#include <jpeglib.h>

#include "pipeline/image/blank.h"
#include "pipeline/image/jpeg_parts.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define WIDTH  48
#define HEIGHT 33

static struct sst_jpeg_bytes encode(int step, int components)
{
    struct jpeg_compress_struct c;
    struct jpeg_error_mgr errors;
    unsigned long size = 0;
    unsigned char *data = NULL;
    JSAMPLE row[3 * WIDTH], *rows = row;

    c.err = jpeg_std_error(&errors);
    jpeg_create_compress(&c);
    jpeg_mem_dest(&c, &data, &size);
    c.image_width = WIDTH;
    c.image_height = HEIGHT;
    c.input_components = components;
    c.in_color_space = components == 1 ? JCS_GRAYSCALE : JCS_YCbCr;
    jpeg_set_defaults(&c);
    jpeg_set_quality(&c, 50, TRUE);
    jpeg_start_compress(&c, TRUE);
    for (int y = 0; y < HEIGHT; y++) {
        for (int i = 0; i < components * WIDTH; i++)
            row[i] = (JSAMPLE)(i * 3 + (y > 16 && i > 20 ? step : 0));
        jpeg_write_scanlines(&c, &rows, 1);
    }
    jpeg_finish_compress(&c);
    jpeg_destroy_compress(&c);
    return (struct sst_jpeg_bytes){ data, size };
}

static void put_seed(int i, struct sst_jpeg_bytes base, struct sst_jpeg_bytes second)
{
    uint8_t *seed = malloc(2 + base.bytes + second.bytes);

    if (!seed)
        abort();
    seed[0] = (uint8_t)(base.bytes >> 8);
    seed[1] = (uint8_t)base.bytes;
    memcpy(seed + 2, base.data, base.bytes);
    memcpy(seed + 2 + base.bytes, second.data, second.bytes);
    seed_write("jpeg_parts", i, seed, 2 + base.bytes + second.bytes);
    free(seed);
}

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    for (int k = 0; k < 2; k++) {
        const struct sst_jpeg_bytes base = encode(0, k ? 3 : 1), whole = encode(90, k ? 3 : 1);
        uint8_t *parts;
        size_t bytes;

        put_seed(2 * k, base, whole);
        if (!sst_jpeg_parts_cut(&(struct sst_jpeg_pair){ base, whole, WIDTH, HEIGHT }, 5, &parts, &bytes, NULL)) {
            put_seed(2 * k + 1, base, (struct sst_jpeg_bytes){ parts, bytes });
            free(parts);
        }
        free((void *)base.data);
        free((void *)whole.data);
    }
    return 0;
}

/* Black blocks stay black: a masked picture is masked to the same bytes. */
static void blank(struct sst_jpeg_bytes jpeg)
{
    static const uint8_t black[] = { 0, 1, 1, 0, 0, 1, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 1, 0, 0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 1 };
    const struct sst_blank_blocks blocks = { (WIDTH + 7) / 8, (HEIGHT + 7) / 8, black };
    struct sst_raw raw = { V4L2_PIX_FMT_MJPEG, WIDTH, HEIGHT, 0, jpeg.data, jpeg.bytes }, once, twice;
    struct sst_blank *first, *second;

    _Static_assert(sizeof(black) == (WIDTH + 7) / 8 * ((HEIGHT + 7) / 8), "a byte for each block");
    if (sst_blank_create(&first))
        return;
    if (!sst_blank_create(&second)) {
        if (!sst_blank_frame(first, &raw, &blocks, &once) &&
            (sst_blank_frame(second, &once, &blocks, &twice) || once.bytes != twice.bytes ||
             memcmp(once.data, twice.data, once.bytes) != 0))
            abort();
        sst_blank_destroy(second);
    }
    sst_blank_destroy(first);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const size_t said = size >= 2 ? (size_t)data[0] << 8 | data[1] : 0, n = said < size ? said : size;
    struct sst_jpeg_bytes base, second;
    int64_t base_ns;
    uint8_t *out;
    double share;
    size_t bytes;

    if (size < 2)
        return 0;
    base = (struct sst_jpeg_bytes){ data + 2, n < size - 2 ? n : size - 2 };
    second = (struct sst_jpeg_bytes){ base.data + base.bytes, size - 2 - base.bytes };
    (void)sst_jpeg_parts_base(second, &base_ns);
    blank(base);
    if (!sst_jpeg_parts_join(&(struct sst_jpeg_pair){ base, second, WIDTH, HEIGHT }, &out, &bytes))
        free(out);
    if (!sst_jpeg_parts_cut(&(struct sst_jpeg_pair){ base, second, WIDTH, HEIGHT }, 7, &out, &bytes, &share)) {
        if (!(share >= 0 && share <= 1) || !sst_jpeg_parts_base((struct sst_jpeg_bytes){ out, bytes }, &base_ns) ||
            base_ns != 7)
            abort();
        free(out);
    }
    return 0;
}
