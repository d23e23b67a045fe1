/* Fuzz target: the reader of block means from the Huffman code of cameras' JPEG, and parts that are cut out of frames.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <setjmp.h>
#include <string.h>

#include "pipeline/image/jpeg_means.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define SIDE_MAX 1024

struct errors {
    struct jpeg_error_mgr base;
    jmp_buf back;
};

static void leave(j_common_ptr c)
{
    longjmp(((struct errors *)c->err)->back, 1);
}

static void be_silent(j_common_ptr c SST_UNUSED, int level SST_UNUSED)
{
}

static void read_means(struct sst_jpeg_means *m, const struct jpeg_decompress_struct *header, const uint8_t *data)
{
    struct sst_jpeg_index index = { .room = SIDE_MAX * SIDE_MAX / 64 + 1 };
    int16_t *out[3] = { NULL };
    const uint8_t *cut;
    size_t bytes;

    index.mcu = malloc(index.room * sizeof(*index.mcu));
    for (int i = 0; i < header->num_components && i < 3; i++)
        out[i] = malloc((size_t)header->comp_info[i].width_in_blocks * header->comp_info[i].height_in_blocks *
                        sizeof(*out[i]));
    if (!sst_jpeg_means_read(m, header, out, &index) && index.valid) {
        const int x = index.mcus_x, y = index.mcus_y;
        const struct sst_jpeg_part parts[] = { { 0, 0, x, y }, { x / 2, y / 3, x, y }, { 0, y / 2, (x + 1) / 2, y } };

        for (size_t i = 0; i < ARRAY_LEN(parts); i++)
            if (parts[i].x0 < parts[i].x1 && parts[i].y0 < parts[i].y1 &&
                !sst_jpeg_cut(m, &(struct sst_jpeg_frame){ data, header, &index }, &parts[i], &cut, &bytes) &&
                (bytes < 4 || cut[0] != 0xff))
                abort();
    }
    free(index.mcu);
    for (int i = 0; i < 3; i++)
        free(out[i]);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct sst_jpeg_means *m;
    struct jpeg_decompress_struct d;
    struct errors errors;

    if (!size || (!m && sst_jpeg_means_create(&m)))
        return 0;
    d.err = jpeg_std_error(&errors.base);
    errors.base.error_exit = leave;
    errors.base.emit_message = be_silent;
    if (!setjmp(errors.back)) {
        jpeg_create_decompress(&d);
        jpeg_mem_src(&d, data, size);
        if (jpeg_read_header(&d, TRUE) == JPEG_HEADER_OK && d.image_width <= SIDE_MAX && d.image_height <= SIDE_MAX)
            read_means(m, &d, data);
    }
    jpeg_destroy_decompress(&d);
    return 0;
}
