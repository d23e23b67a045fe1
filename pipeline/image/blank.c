/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/blank.h"

#include <errno.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <linux/videodev2.h>

#include <jerror.h>
#include <jpeglib.h>

#include "pipeline/image/codec_formats.h"

/* Bytes that libjpeg warns of and that no sample is made of: as pipeline/image/jpeg.c has them. */
#define STRAY_RESTART 32
#define STRAY_END     3
#define SCANS_MOST    64 /* of a progressive picture; libjpeg writes 10 */

#define LIMIT 1023    /* of coefficients: the usual Huffman tables have no codes for larger ones (ITU T.81, table F.1) */
#define BLACK (-1024) /* DC coefficient of black luma times its step: 8 times the level shift of 128 */

/* Everything that must survive a longjmp out of libjpeg lives here. */
struct sst_blank {
    struct jpeg_error_mgr errors; /* the first: on_error() finds the object by it */
    struct jpeg_progress_mgr progress;
    jmp_buf escape;
    struct jpeg_decompress_struct d;
    struct jpeg_compress_struct c;
    bool reads, writes; /* libjpeg's objects exist */
    struct jpeg_destination_mgr to;
    uint8_t *out;
    size_t room, bytes;
};

static void on_error(j_common_ptr c)
{
    longjmp(((struct sst_blank *)(void *)c->err)->escape, 1);
}

/* Warnings are errors: behind a damaged code blocks may lie in other places than they were exposed in. */
static void on_message(j_common_ptr c, int level)
{
    const int code = c->err->msg_code, bytes = c->err->msg_parm.i[0], marker = c->err->msg_parm.i[1];
    const bool restart = marker >= JPEG_RST0 && marker <= JPEG_RST0 + 7;

    if (level < 0 && code != JWRN_JFIF_MAJOR &&
        !(code == JWRN_EXTRANEOUS_DATA && bytes <= (restart ? STRAY_RESTART : STRAY_END)))
        on_error(c);
}

/* A scan for each component at most, of progressive pictures as many as encoders make: more would only cost time. */
static void on_progress(j_common_ptr c)
{
    const j_decompress_ptr d = (j_decompress_ptr)c;

    if (d->input_scan_number > (d->progressive_mode ? SCANS_MOST : d->num_components))
        on_error(c);
}

/* Room for a frame. @return whether there is */
static bool provide(struct sst_blank *b, size_t bytes)
{
    uint8_t *more = b->room >= bytes ? b->out : realloc(b->out, bytes);

    if (!more)
        return false;
    b->out = more;
    b->room = b->room >= bytes ? b->room : bytes;
    return true;
}

/* Destination: the object's own memory, which grows. */
static void begin_output(j_compress_ptr c)
{
    struct sst_blank *b = (struct sst_blank *)(void *)c->err;

    b->to.next_output_byte = b->out;
    b->to.free_in_buffer = b->room;
}

static boolean grow_output(j_compress_ptr c)
{
    struct sst_blank *b = (struct sst_blank *)(void *)c->err;
    const size_t used = b->room;

    if (!provide(b, 2 * used))
        on_error((j_common_ptr)c);
    b->to.next_output_byte = b->out + used;
    b->to.free_in_buffer = b->room - used;
    return TRUE;
}

static void end_output(j_compress_ptr c)
{
    struct sst_blank *b = (struct sst_blank *)(void *)c->err;

    b->bytes = b->room - b->to.free_in_buffer;
}

int sst_blank_create(struct sst_blank **out)
{
    struct sst_blank *b = calloc(1, sizeof(*b));

    if (!b)
        return -ENOMEM;
    jpeg_std_error(&b->errors);
    b->errors.error_exit = on_error;
    b->errors.emit_message = on_message;
    b->progress.progress_monitor = on_progress;
    b->to.init_destination = begin_output;
    b->to.empty_output_buffer = grow_output;
    b->to.term_destination = end_output;
    *out = b;
    return 0;
}

void sst_blank_destroy(struct sst_blank *b)
{
    if (!b)
        return;
    if (b->reads)
        jpeg_destroy_decompress(&b->d);
    if (b->writes)
        jpeg_destroy_compress(&b->c);
    free(b->out);
    free(b);
}

/* --- raw frames --------------------------------------------------------------------------------------------------- */

struct format {
    uint32_t fourcc;
    int bytes;        /* of a pixel */
    uint8_t black[2]; /* of bytes at even and odd places */
};

/* YUYV: chroma 128 is grey. All sizes of blocks are even, so that pairs of pixels and cells of Bayer lie in one. */
static const struct format formats[] = {
    { V4L2_PIX_FMT_GREY, 1, { 0, 0 } },   { V4L2_PIX_FMT_Y16, 2, { 0, 0 } },    { V4L2_PIX_FMT_YUYV, 2, { 0, 128 } },
    { V4L2_PIX_FMT_SBGGR8, 1, { 0, 0 } }, { V4L2_PIX_FMT_SGBRG8, 1, { 0, 0 } }, { V4L2_PIX_FMT_SGRBG8, 1, { 0, 0 } },
    { V4L2_PIX_FMT_SRGGB8, 1, { 0, 0 } }, { V4L2_PIX_FMT_RGB24, 3, { 0, 0 } },
};

static const struct format *find(uint32_t fourcc)
{
    for (size_t i = 0; i < ARRAY_LEN(formats); i++)
        if (formats[i].fourcc == fourcc)
            return &formats[i];
    return NULL;
}

bool sst_blank_format(uint32_t fourcc)
{
    return sst_raw_is_jpeg(fourcc) || find(fourcc);
}

/* Rows without padding: bytes between rows, which no picture shows, are left out. */
static int blank_raw(struct sst_blank *b, const struct sst_raw *raw, const struct sst_blank_blocks *blocks,
                     struct sst_raw *out)
{
    const struct format *f = find(raw->fourcc);
    const size_t row = f ? (size_t)raw->width * (size_t)f->bytes : 0, stride = raw->stride ? raw->stride : row;
    const size_t side = (size_t)SST_BLANK_SIDE * (size_t)(f ? f->bytes : 0);

    if (!f)
        return -EINVAL;
    if (stride < row || raw->bytes < row || (raw->bytes - row) / stride < (size_t)raw->height - 1)
        return -EBADMSG;
    if (!provide(b, row * (size_t)raw->height))
        return -ENOMEM;
    for (int y = 0; y < raw->height; y++) {
        const uint8_t *black = blocks->black + (size_t)(y / SST_BLANK_SIDE) * (size_t)blocks->cols;
        uint8_t *to = memcpy(b->out + (size_t)y * row, raw->data + (size_t)y * stride, row);

        for (int x = 0; x < blocks->cols; x++)
            for (size_t i = (size_t)x * side; black[x] && i < row && i < ((size_t)x + 1) * side; i++)
                to[i] = f->black[i % 2];
    }
    *out = *raw;
    out->stride = row;
    out->data = b->out;
    out->bytes = row * (size_t)raw->height;
    return 0;
}

/* --- JPEG --------------------------------------------------------------------------------------------------------- */

/* Any block of the frame within a block of a component that is h times v as large. */
static bool any_black(const struct sst_blank_blocks *blocks, int x, int y, int h, int v)
{
    for (int j = y * v; j < (y + 1) * v && j < blocks->rows; j++)
        for (int i = x * h; i < (x + 1) * h && i < blocks->cols; i++)
            if (blocks->black[(size_t)j * (size_t)blocks->cols + (size_t)i])
                return true;
    return false;
}

/* Coefficients that no picture of 8 bits has, and that the writer of libjpeg-turbo writes wrongly without a word. */
static bool is_absurd(const JCOEF *block)
{
    int beyond = block[0] < BLACK || block[0] > LIMIT;

    for (int i = 1; i < DCTSIZE2; i++)
        beyond |= block[i] < -LIMIT || block[i] > LIMIT;
    return beyond;
}

/* Groups of blocks of all components (MCUs) are black as a whole. @return false: another block is damaged */
static bool blank_component(struct sst_blank *b, jvirt_barray_ptr coefs, const jpeg_component_info *info,
                            const struct sst_blank_blocks *blocks)
{
    const bool dark = info->component_index == 0 || b->d.jpeg_color_space == JCS_RGB;
    const int step = info->quant_table ? info->quant_table->quantval[0] : 0;

    if (step < 1)
        return false;
    for (JDIMENSION y = 0; y < info->height_in_blocks; y++) {
        JBLOCKARRAY row = b->d.mem->access_virt_barray((j_common_ptr)&b->d, coefs, y, 1, TRUE);

        for (JDIMENSION x = 0; x < info->width_in_blocks; x++) {
            if (!any_black(blocks, (int)x / info->h_samp_factor, (int)y / info->v_samp_factor, b->d.max_h_samp_factor,
                           b->d.max_v_samp_factor)) {
                if (is_absurd(row[0][x]))
                    return false;
                continue;
            }
            memset(row[0][x], 0, sizeof(JBLOCK));
            if (dark)
                row[0][x][0] = (JCOEF)((BLACK - (step - 1)) / step);
        }
    }
    return true;
}

/* @return 0, -EBADMSG (another size, too few bytes), -ENOTSUP (another kind of JPEG) */
static int check_header(const struct sst_blank *b, const struct sst_raw *raw)
{
    const struct jpeg_decompress_struct *d = &b->d;

    if ((int)d->image_width != raw->width || (int)d->image_height != raw->height ||
        !sst_jpeg_may_hold((size_t)raw->width * (size_t)raw->height, raw->bytes))
        return -EBADMSG;
    return !d->arith_code && d->data_precision == 8 &&
                   (d->jpeg_color_space == JCS_YCbCr || d->jpeg_color_space == JCS_GRAYSCALE ||
                    d->jpeg_color_space == JCS_RGB)
               ? 0
               : -ENOTSUP;
}

/* A progressive picture becomes a sequential one of the same coefficients. May escape. @return 0, -EBADMSG, -ENOTSUP */
static int transcode(struct sst_blank *b, const struct sst_raw *raw, const struct sst_blank_blocks *blocks)
{
    jvirt_barray_ptr *coefs;
    int err;

    if (!b->reads) {
        b->d.err = b->c.err = &b->errors;
        jpeg_create_decompress(&b->d);
        b->reads = true;
        jpeg_create_compress(&b->c);
        b->writes = true;
    }
    jpeg_mem_src(&b->d, raw->data, raw->bytes);
    (void)jpeg_read_header(&b->d, TRUE);
    b->d.progress = &b->progress;
    err = check_header(b, raw);
    if (err)
        return err;
    coefs = jpeg_read_coefficients(&b->d);
    for (int i = 0; i < b->d.num_components; i++)
        if (!blank_component(b, coefs[i], &b->d.comp_info[i], blocks))
            return -EBADMSG;
    b->c.dest = &b->to;
    jpeg_copy_critical_parameters(&b->d, &b->c);
    b->c.restart_interval = b->d.restart_interval;
    jpeg_write_coefficients(&b->c, coefs);
    jpeg_finish_compress(&b->c);
    (void)jpeg_finish_decompress(&b->d);
    return 0;
}

static int blank_jpeg(struct sst_blank *b, const struct sst_raw *raw, const struct sst_blank_blocks *blocks,
                      struct sst_raw *out)
{
    int err;

    if (!provide(b, raw->bytes + 4096))
        return -ENOMEM;
    if (setjmp(b->escape))
        err = -EBADMSG;
    else
        err = transcode(b, raw, blocks);
    if (b->reads)
        jpeg_abort_decompress(&b->d);
    if (b->writes)
        jpeg_abort_compress(&b->c);
    if (err)
        return err;
    *out = *raw;
    out->data = b->out;
    out->bytes = b->bytes;
    return 0;
}

int sst_blank_frame(struct sst_blank *blank, const struct sst_raw *raw, const struct sst_blank_blocks *blocks,
                    struct sst_raw *out)
{
    if (raw->width < 1 || raw->height < 1 ||
        blocks->cols != (raw->width + SST_BLANK_SIDE - 1) / SST_BLANK_SIDE ||
        blocks->rows != (raw->height + SST_BLANK_SIDE - 1) / SST_BLANK_SIDE)
        return -EINVAL;
    return sst_raw_is_jpeg(raw->fourcc) ? blank_jpeg(blank, raw, blocks, out) : blank_raw(blank, raw, blocks, out);
}
