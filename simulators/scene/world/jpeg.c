/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/world/world_internal.h"

#include <errno.h>
#include <setjmp.h>
#include <stdlib.h>
#include <string.h>

#include <jpeglib.h>

#include "base/log.h"
#include "base/mem.h"

#define MCU_WIDTH  16 /* 4:2:2: two blocks of luma side by side, one of each chroma */
#define MCU_HEIGHT 8

/* --- encoding ----------------------------------------------------------------------------------------------------- */

struct encoder {
    struct jpeg_compress_struct c;
    struct jpeg_error_mgr errors;
    jmp_buf fault;
    unsigned char *data; /* libjpeg's */
    unsigned long bytes;
    uint8_t *row;
};

static void on_error(j_common_ptr c)
{
    struct encoder *e = c->client_data;
    char text[JMSG_LENGTH_MAX];

    c->err->format_message(c, text);
    sst_log_error("cannot encode a simulated frame: %s; choose another size or quality", text);
    longjmp(e->fault, 1);
}

static int run(struct encoder *e, const struct sst_image *img, int quality)
{
    e->c.err = jpeg_std_error(&e->errors);
    e->errors.error_exit = on_error;
    e->c.client_data = e;
    if (setjmp(e->fault))
        return -EIO;
    jpeg_create_compress(&e->c);
    jpeg_mem_dest(&e->c, &e->data, &e->bytes);
    e->c.image_width = (JDIMENSION)img->width;
    e->c.image_height = (JDIMENSION)img->height;
    e->c.input_components = 3;
    e->c.in_color_space = JCS_RGB;
    jpeg_set_defaults(&e->c);
    jpeg_set_quality(&e->c, quality, TRUE);
    e->c.comp_info[0].h_samp_factor = 2;
    e->c.comp_info[0].v_samp_factor = 1;
    e->c.restart_in_rows = 1;
    jpeg_start_compress(&e->c, TRUE);
    for (int y = 0; y < img->height; y++) {
        JSAMPROW row = e->row;

        for (size_t x = 0; x < (size_t)img->width; x++) {
            e->row[3 * x] = sst_image_row(img, 0, y)[x];
            e->row[3 * x + 1] = sst_image_row(img, 1, y)[x];
            e->row[3 * x + 2] = sst_image_row(img, 2, y)[x];
        }
        jpeg_write_scanlines(&e->c, &row, 1);
    }
    jpeg_finish_compress(&e->c);
    return 0;
}

/* Start of the scan, from the markers of our own encoder. */
static uint32_t find_scan(const uint8_t *data, size_t bytes)
{
    size_t at = 2;
    bool scan = false;

    while (!scan && at + 4 <= bytes) {
        scan = data[at + 1] == 0xDA;
        at += 2 + ((size_t)data[at + 2] << 8 | data[at + 3]);
    }
    return (uint32_t)at;
}

/* Position after `rows` restart markers. */
static uint32_t find_rest(const uint8_t *data, size_t bytes, size_t at, int rows)
{
    while (rows > 0 && at + 1 < bytes) {
        if (data[at] == 0xFF && data[at + 1] >= 0xD0 && data[at + 1] <= 0xD7)
            rows--;
        at += data[at] == 0xFF ? 2 : 1;
    }
    return (uint32_t)at;
}

int sim_jpeg_encode(const struct sst_image *img, int quality, bool strip, struct sim_jpeg *out)
{
    const int strip_rows = strip ? strip_height(img->width) / MCU_HEIGHT : 0;
    struct encoder *e;
    int err;

    /* A marker must follow the strip's last row. */
    if (strip_rows * MCU_HEIGHT >= img->height)
        return -EINVAL;
    e = calloc(1, sizeof(*e));
    if (!e)
        return -ENOMEM;
    e->row = sst_mem_alloc_raw((size_t)img->width, 3);
    err = e->row ? run(e, img, quality) : -ENOMEM;
    if (!err) {
        const uint32_t scan = find_scan(e->data, e->bytes);

        *out = (struct sim_jpeg){
            .data = e->data,
            .bytes = (uint32_t)e->bytes,
            .scan = scan,
            .rest = find_rest(e->data, e->bytes, scan, strip_rows),
            .dc_step = e->c.quant_tbl_ptrs[0]->quantval[0],
        };
        e->data = NULL;
    }
    jpeg_destroy_compress(&e->c);
    free(e->data);
    sst_mem_free(e->row);
    free(e);
    return err;
}

/* --- the strip's rows --------------------------------------------------------------------------------------------- */

/* Code and length of the size of a luma mean's difference: table K.3 of ITU-T T.81, which libjpeg writes by default. */
static const struct {
    uint16_t code;
    uint8_t length;
} dc_code[12] = { { 0x0, 2 }, { 0x2, 3 },  { 0x3, 3 },  { 0x4, 3 },  { 0x5, 3 },  { 0x6, 3 },
                  { 0xE, 4 }, { 0x1E, 5 }, { 0x3E, 6 }, { 0x7E, 7 }, { 0xFE, 8 }, { 0x1FE, 9 } };

#define LUMA_END      0xA /* end of a luma block without any detail, table K.5 ... */
#define LUMA_END_BITS 4
#define CHROMA_GREY   0x0 /* ... difference 0 (K.4) and end (K.6) of one chroma block, and of both */
#define CHROMA_BITS   8

struct writer {
    uint8_t *out;
    uint64_t bits; /* its last `count` bits are pending */
    int count;
};

static void put(struct writer *w, uint32_t bits, int count)
{
    w->bits = w->bits << count | bits;
    w->count += count;
    while (w->count >= 8) {
        const uint8_t byte = (uint8_t)(w->bits >> (w->count - 8));

        *w->out++ = byte;
        if (byte == 0xFF)
            *w->out++ = 0;
        w->count -= 8;
    }
}

static void put_mean(struct writer *w, int diff)
{
    const int size = diff ? 32 - __builtin_clz((unsigned)abs(diff)) : 0;

    put(w, dc_code[size].code, dc_code[size].length);
    if (size)
        put(w, (uint32_t)(diff > 0 ? diff : diff + (1 << size) - 1), size);
    put(w, LUMA_END, LUMA_END_BITS);
}

/* Quantised mean of a cell: 8 times its level above 128. */
static int mean_of(bool white, int step)
{
    const int level = 8 * ((white ? SST_STRIP_WHITE : SST_STRIP_BLACK) - 128);

    return (2 * level + (level < 0 ? -step : step)) / (2 * step);
}

static uint8_t *put_row(uint8_t *out, const uint8_t *bits, int row, int width, int step)
{
    const int cells = width / SST_STRIP_CELL, mcus = (width + MCU_WIDTH - 1) / MCU_WIDTH;
    const int means[2] = { mean_of(false, step), mean_of(true, step) };
    struct writer w = { .out = out };
    int before = 0;

    for (int i = 0; i < 2 * mcus; i++) {
        const int mean = means[i < cells && strip_cell(bits, row * cells + i)];

        put_mean(&w, mean - before);
        before = mean;
        if (i & 1)
            put(&w, CHROMA_GREY, CHROMA_BITS);
    }
    if (w.count)
        put(&w, (1u << (8 - w.count)) - 1, 8 - w.count);
    *w.out++ = 0xFF;
    *w.out++ = (uint8_t)(0xD0 + row % 8);
    return w.out;
}

int sim_jpeg_copy(const struct sim_jpeg *in, int width, const struct sst_sim_exposure *exposure,
                  struct sst_sim_room out, size_t *bytes)
{
    const int rows = exposure ? strip_height(width) / MCU_HEIGHT : 0;
    /* At most 9 + 11 + 4 bits for each luma block and 8 for the chroma, all stuffed, and a marker. */
    const size_t row_most = (size_t)(width / MCU_WIDTH + 1) * 14 + 4;
    const size_t tail = in->bytes - (exposure ? in->rest : in->scan);
    uint8_t bits[SST_STRIP_BYTES], *at = out.data + in->scan;

    if (out.bytes < in->scan + tail + (size_t)rows * row_most)
        return -ENOSPC;
    memcpy(out.data, in->data, in->scan);
    if (exposure)
        strip_pack(exposure, bits);
    for (int row = 0; row < rows; row++)
        at = put_row(at, bits, row, width, (int)in->dc_step);
    memcpy(at, in->data + in->bytes - tail, tail);
    *bytes = (size_t)(at - out.data) + tail;
    return 0;
}
