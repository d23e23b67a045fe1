/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/live/frames/frames_internal.h"

#include <errno.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jerror.h>
#include <jpeglib.h>
#include <linux/videodev2.h>

#include "base/mem.h"
#include "pipeline/image/jpeg_means.h"
#include "pipeline/image/raw.h"

#define CELL 8
/* Cropping closer saves little, and the margin has the neighbours for chroma interpolation. */
#define CROP_MARGIN 32

struct decoder {
    /* fixed after create */
    uint32_t fourcc;
    int width, height;
    size_t stride;
    const uint8_t *level; /* [65536] of Y16; NULL: the high byte */
    /* of the last frame */
    uint8_t *pixels;        /* [height][stride], or parts of it, one after the other ... */
    size_t used;            /* ... of which these bytes are taken */
    struct sst_image image; /* of raw formats */
    char fault[JMSG_LENGTH_MAX];
    bool refused;
    /* JPEG */
    struct sst_jpeg_means *means;
    struct jpeg_decompress_struct jpeg;
    struct jpeg_error_mgr errors;
    jmp_buf escape;
};

/* --- block means -------------------------------------------------------------------------------------------------- */

int block_means_init(struct block_means *c, int width, int height)
{
    const size_t n = (size_t)((width + CELL - 1) / CELL) * (size_t)((height + CELL - 1) / CELL);

    *c = (struct block_means){ 0 };
    for (int p = 0; p < 3; p++) {
        c->plane[p].mean = sst_mem_alloc(n, sizeof(int16_t));
        if (!c->plane[p].mean) {
            block_means_fini(c);
            return -ENOMEM;
        }
    }
    return 0;
}

void block_means_fini(struct block_means *c)
{
    for (int p = 0; p < 3; p++)
        sst_mem_free(c->plane[p].mean);
    *c = (struct block_means){ 0 };
}

bool block_means_alike(const struct block_means *a, const struct block_means *b)
{
    if (a->planes != b->planes)
        return false;
    for (int p = 0; p < a->planes; p++) {
        if (a->plane[p].cols != b->plane[p].cols || a->plane[p].rows != b->plane[p].rows ||
            a->plane[p].step_x != b->plane[p].step_x || a->plane[p].step_y != b->plane[p].step_y ||
            a->plane[p].zero != b->plane[p].zero)
            return false;
    }
    return true;
}

void block_means_copy(struct block_means *to, const struct block_means *from)
{
    to->planes = from->planes;
    for (int p = 0; p < from->planes; p++) {
        int16_t *mean = to->plane[p].mean;

        memcpy(mean, from->plane[p].mean, (size_t)from->plane[p].cols * (size_t)from->plane[p].rows * sizeof(*mean));
        to->plane[p] = from->plane[p];
        to->plane[p].mean = mean;
    }
}

/* Set the form of a plane, which keeps its memory. */
static void set_plane(struct mean_plane *plane, struct mean_plane form)
{
    form.mean = plane->mean;
    *plane = form;
}

/* --- uncompressed frames ------------------------------------------------------------------------------------------ */

/* Samples of one plane: every dx-th byte from x0 of every dy-th row from y0. */
struct samples {
    size_t x0, dx;
    int y0, dy, zero;
    int columns, per_cell; /* in a row of the frame, and in a row of a cell */
    const uint8_t *level;  /* of 16 bits; NULL: bytes */
};

/* Means of the samples in each cell. */
static void mean_plane(struct block_means *c, int p, const struct sst_raw *raw, const struct samples *s)
{
    const int rows = c->plane[p].rows, cols = c->plane[p].cols, per_cell = s->per_cell;

    for (int j = 0; j < rows; j++) {
        for (int i = 0; i < cols; i++) {
            const int end_y = sst_min_int((j + 1) * CELL, raw->height),
                      end = sst_min_int((i + 1) * per_cell, s->columns);
            int sum = 0, n = 0;

            for (int y = j * CELL + s->y0; y < end_y; y += s->dy) {
                const uint8_t *row = raw->data + (size_t)y * raw->stride + s->x0;

                for (int k = i * per_cell; k < end; k++)
                    sum += s->level ? s->level[sst_raw_y16(row, k)] : row[(size_t)k * s->dx];
                n += end - i * per_cell;
            }
            c->plane[p].mean[(size_t)j * (size_t)cols + (size_t)i] = (int16_t)(n > 0 ? (8 * sum + n / 2) / n : s->zero);
        }
    }
}

static void raw_means(struct block_means *c, const struct sst_raw *raw, const uint8_t *level)
{
    const int cols = (raw->width + CELL - 1) / CELL, rows = (raw->height + CELL - 1) / CELL;
    int red_x = 0, red_y = 0;
    const bool bayer = sst_raw_red(raw->fourcc, &red_x, &red_y), yuyv = raw->fourcc == V4L2_PIX_FMT_YUYV;
    const bool rgb = raw->fourcc == V4L2_PIX_FMT_RGB24;
    const size_t bytes = rgb ? 3 : yuyv || raw->fourcc == V4L2_PIX_FMT_Y16 ? 2 : 1;
    struct samples all = {
        .x0 = raw->fourcc == V4L2_PIX_FMT_Y16 && !level, .dx = bytes, .dy = 1, .columns = raw->width, .per_cell = CELL,
        .level = raw->fourcc == V4L2_PIX_FMT_Y16 ? level : NULL,
    };

    c->planes = bayer || yuyv || rgb ? 3 : 1;
    for (int p = 0; p < c->planes; p++)
        set_plane(&c->plane[p], (struct mean_plane){ cols, rows, CELL, CELL, p && yuyv ? 1024 : 0, NULL });
    mean_plane(c, 0, raw, &all);
    for (int p = 1; p < c->planes; p++) {
        const int x = p == 1 ? red_x : 1 - red_x, y = p == 1 ? red_y : 1 - red_y;
        struct samples colour = { .x0 = yuyv ? (size_t)(2 * p - 1) : (size_t)x,
                                  .dx = yuyv ? 4 : 2,
                                  .y0 = yuyv ? 0 : y,
                                  .dy = yuyv ? 1 : 2,
                                  .zero = c->plane[p].zero,
                                  .columns = yuyv ? raw->width / 2 : (raw->width - x + 1) / 2,
                                  .per_cell = CELL / 2 };

        if (rgb) {
            colour = all;
            colour.x0 = (size_t)p;
        }
        mean_plane(c, p, raw, &colour);
    }
}

static size_t row_bytes(const struct decoder *d)
{
    const size_t bytes = d->fourcc == V4L2_PIX_FMT_RGB24                                           ? 3
                         : d->fourcc == V4L2_PIX_FMT_YUYV || d->fourcc == V4L2_PIX_FMT_Y16 ? 2
                                                                                                   : 1;

    return (size_t)d->width * bytes;
}

static int raw_of(struct decoder *d, const struct decoder_frame *frame, struct sst_raw *raw)
{
    const size_t row = row_bytes(d), stride = frame->stride ? frame->stride : row;

    *raw = (struct sst_raw){ d->fourcc, d->width, d->height, stride, frame->data, frame->bytes };
    if (stride >= row && frame->bytes >= row && (frame->bytes - row) / stride >= (size_t)d->height - 1)
        return 0;
    snprintf(d->fault, sizeof(d->fault), "%zu bytes in rows of %zu are too few for %dx%d pixels", frame->bytes, stride,
             d->width, d->height);
    return -EBADMSG;
}

/* A part of a Y16 frame by the table of levels. */
static void decode_levels(struct decoder *d, const struct sst_raw *raw, struct sst_rect part)
{
    for (int y = part.y0; y < part.y1; y++) {
        const uint8_t *row = raw->data + (size_t)y * raw->stride;
        uint8_t *to = d->pixels + (size_t)y * d->stride;

        for (int x = part.x0; x < part.x1; x++)
            to[4 * x] = to[4 * x + 1] = to[4 * x + 2] = d->level[sst_raw_y16(row, x)];
    }
}

static int decode_raw(struct decoder *d, const struct decoder_frame *frame, struct sst_rect part)
{
    struct sst_raw raw;
    int err = raw_of(d, frame, &raw);

    if (!err && d->level && raw.fourcc == V4L2_PIX_FMT_Y16) {
        decode_levels(d, &raw, part);
        return 0;
    }
    if (!err)
        err = sst_raw_part(&d->image, &raw, part);
    for (int y = part.y0; !err && y < part.y1; y++) {
        const uint8_t *r = sst_image_row(&d->image, 0, y), *g = sst_image_row(&d->image, 1, y),
                      *b = sst_image_row(&d->image, 2, y);
        uint8_t *to = d->pixels + (size_t)y * d->stride;

        for (int x = part.x0; x < part.x1; x++) {
            to[4 * x] = r[x];
            to[4 * x + 1] = g[x];
            to[4 * x + 2] = b[x];
        }
    }
    return err;
}

/* --- JPEG --------------------------------------------------------------------------------------------------------- */

static void on_error(j_common_ptr c)
{
    struct decoder *d = c->client_data;

    c->err->format_message(c, d->fault);
    longjmp(d->escape, 1);
}

/* Warnings mean invented samples, except for warnings about bytes between the segments of a frame, which many cameras
 * leave, and about the version of the format. */
static void on_message(j_common_ptr c, int level)
{
    struct decoder *d = c->client_data;

    if (level >= 0 || c->err->msg_code == JWRN_EXTRANEOUS_DATA || c->err->msg_code == JWRN_JFIF_MAJOR || d->refused)
        return;
    c->err->format_message(c, d->fault);
    d->refused = true;
}

/* @return 0, -EBADMSG; may escape */
static int read_header(struct decoder *d, const struct decoder_frame *frame)
{
    d->refused = false;
    jpeg_mem_src(&d->jpeg, frame->data, frame->bytes);
    (void)jpeg_read_header(&d->jpeg, TRUE);
    if (d->refused)
        return -EBADMSG;
    if (d->jpeg.image_width != (JDIMENSION)d->width || d->jpeg.image_height != (JDIMENSION)d->height) {
        snprintf(d->fault, sizeof(d->fault), "it has %ux%u pixels instead of %dx%d", d->jpeg.image_width,
                 d->jpeg.image_height, d->width, d->height);
        return -EBADMSG;
    }
    if (d->jpeg.num_components != 1 && d->jpeg.num_components != 3) {
        snprintf(d->fault, sizeof(d->fault), "it has %d colours instead of 1 or 3", d->jpeg.num_components);
        return -EBADMSG;
    }
    return 0;
}

static void jpeg_planes(struct block_means *c, const struct jpeg_decompress_struct *jpeg)
{
    const int n = jpeg->num_components;

    c->planes = n;
    for (int p = 0; p < n; p++) {
        const jpeg_component_info *info = &jpeg->comp_info[p];
        const bool colour = p && (jpeg->jpeg_color_space == JCS_YCbCr);

        set_plane(&c->plane[p], (struct mean_plane){
                                    .cols = (int)info->width_in_blocks,
                                    .rows = (int)info->height_in_blocks,
                                    .step_x = n == 1 ? CELL : CELL * jpeg->max_h_samp_factor / info->h_samp_factor,
                                    .step_y = n == 1 ? CELL : CELL * jpeg->max_v_samp_factor / info->v_samp_factor,
                                    .zero = colour ? 1024 : 0,
                                });
    }
}

static int jpeg_means(struct decoder *d, const struct decoder_frame *frame, struct block_means *means,
                      struct sst_jpeg_index *index)
{
    int err;

    if (setjmp(d->escape)) {
        jpeg_abort_decompress(&d->jpeg);
        return -EBADMSG;
    }
    err = read_header(d, frame);
    if (!err) {
        int16_t *const out[3] = { means->plane[0].mean, means->plane[1].mean, means->plane[2].mean };

        jpeg_planes(means, &d->jpeg);
        err = sst_jpeg_means_read(d->means, &d->jpeg, out, index);
        if (err == -EBADMSG)
            snprintf(d->fault, sizeof(d->fault), "its data is damaged or truncated");
    }
    jpeg_abort_decompress(&d->jpeg);
    return err;
}

/* May escape. */
static void decode_rows(struct decoder *d, struct sst_rect part)
{
    struct jpeg_decompress_struct *jpeg = &d->jpeg;
    JDIMENSION left = (JDIMENSION)sst_max_int(part.x0 - CROP_MARGIN, 0);
    JDIMENSION width = (JDIMENSION)sst_min_int(part.x1 + CROP_MARGIN, d->width) - left;

    jpeg->out_color_space = JCS_EXT_RGBX;
    jpeg->dct_method = JDCT_ISLOW;
    jpeg_start_decompress(jpeg);
    if (width < jpeg->output_width)
        jpeg_crop_scanline(jpeg, &left, &width);
    else
        left = 0;
    if (part.y0)
        (void)jpeg_skip_scanlines(jpeg, (JDIMENSION)part.y0);
    while ((int)jpeg->output_scanline < part.y1 && !d->refused) {
        JSAMPROW row = d->pixels + (size_t)jpeg->output_scanline * d->stride + 4 * (size_t)left;

        (void)jpeg_read_scanlines(jpeg, &row, 1);
    }
}

static int decode_jpeg(struct decoder *d, const struct decoder_frame *frame, struct sst_rect part)
{
    int err;

    if (setjmp(d->escape)) {
        jpeg_abort_decompress(&d->jpeg);
        return -EBADMSG;
    }
    err = read_header(d, frame);
    if (!err) {
        decode_rows(d, part);
        err = d->refused ? -EBADMSG : 0;
    }
    jpeg_abort_decompress(&d->jpeg);
    return err;
}

/* Cut a part out of the frame; its header is read. May escape. */
static int cut_part(struct decoder *d, const struct decoder_frame *frame, struct sst_jpeg_index *index,
                    const struct sst_jpeg_part *part)
{
    const uint8_t *cut;
    size_t bytes;
    int err = read_header(d, frame);

    err = err ? err
              : sst_jpeg_cut(d->means, &(struct sst_jpeg_frame){ frame->data, &d->jpeg, index }, part, &cut, &bytes);
    jpeg_abort_decompress(&d->jpeg);
    if (err)
        return err;
    jpeg_mem_src(&d->jpeg, cut, bytes);
    (void)jpeg_read_header(&d->jpeg, TRUE);
    return 0;
}

/* Decode a part behind the parts in memory. @return 0, -EBADMSG, -ENOTSUP; may escape */
static int decode_part(struct decoder *d, const struct decoder_frame *frame, struct sst_jpeg_index *index,
                       struct decoder_part *p)
{
    const int w = index->mcu_width, h = index->mcu_height, above = index->tall, *box = p->box;
    /* With the neighbours for chroma interpolation. */
    const struct sst_jpeg_part part = { sst_max_int(box[0] / w - 1, 0), sst_max_int(box[1] / h - above, 0),
                                        sst_min_int((box[2] + w - 1) / w + 1, index->mcus_x),
                                        sst_min_int((box[3] + h - 1) / h + above, index->mcus_y) };
    size_t skipped;
    int err = cut_part(d, frame, index, &part);

    if (err)
        return err;
    d->jpeg.out_color_space = JCS_EXT_RGBX;
    d->jpeg.dct_method = JDCT_ISLOW;
    jpeg_start_decompress(&d->jpeg);
    p->stride = sst_mem_stride(d->jpeg.output_width, 4);
    if (p->stride * d->jpeg.output_height > d->stride * (size_t)d->height - d->used)
        err = -ENOTSUP;
    while (!err && d->jpeg.output_scanline < d->jpeg.output_height && !d->refused) {
        JSAMPROW line = d->pixels + d->used + d->jpeg.output_scanline * p->stride;

        (void)jpeg_read_scanlines(&d->jpeg, &line, 1);
    }
    skipped = (size_t)(box[1] - part.y0 * h) * p->stride + 4 * (size_t)(box[0] - part.x0 * w);
    p->pixels = d->pixels + d->used + skipped;
    d->used += p->stride * d->jpeg.output_height;
    return d->refused ? -EBADMSG : err;
}

int decoder_decode_parts(struct decoder *d, const struct decoder_frame *frame, struct sst_jpeg_index *index,
                         struct decoder_part *part, int parts)
{
    volatile int err = 0;

    d->used = 0;
    if (setjmp(d->escape)) {
        jpeg_abort_decompress(&d->jpeg);
        return -EBADMSG;
    }
    for (int i = 0; i < parts && !err; i++) {
        err = decode_part(d, frame, index, &part[i]);
        jpeg_abort_decompress(&d->jpeg);
    }
    return err;
}

static int open_jpeg(struct decoder *d)
{
    d->jpeg.err = jpeg_std_error(&d->errors);
    d->errors.error_exit = on_error;
    d->errors.emit_message = on_message;
    d->jpeg.client_data = d;
    if (setjmp(d->escape))
        return -ENOMEM;
    jpeg_create_decompress(&d->jpeg);
    return sst_jpeg_means_create(&d->means);
}

/* --- both --------------------------------------------------------------------------------------------------------- */

static bool is_raw(uint32_t fourcc, int width)
{
    int x, y;

    return fourcc == V4L2_PIX_FMT_GREY || fourcc == V4L2_PIX_FMT_Y16 || fourcc == V4L2_PIX_FMT_RGB24 ||
           (fourcc == V4L2_PIX_FMT_YUYV && width % 2 == 0) || sst_raw_red(fourcc, &x, &y);
}

int decoder_create(struct decoder **out, uint32_t fourcc, int width, int height)
{
    const bool jpeg = sst_raw_is_jpeg(fourcc);
    struct decoder *d;
    int err = 0;

    if (width < 1 || height < 1 || width > SST_IMAGE_MAX_SIDE || height > SST_IMAGE_MAX_SIDE ||
        (!jpeg && !is_raw(fourcc, width)))
        return -EINVAL;
    d = calloc(1, sizeof(*d));
    if (!d)
        return -ENOMEM;
    d->fourcc = fourcc;
    d->width = width;
    d->height = height;
    d->stride = sst_mem_stride((size_t)width, 4);
    d->pixels = sst_mem_alloc((size_t)height, d->stride);
    if (!d->pixels)
        err = -ENOMEM;
    else
        err = jpeg ? open_jpeg(d) : sst_image_init(&d->image, width, height);
    if (err)
        decoder_destroy(d);
    else
        *out = d;
    return err;
}

void decoder_set_levels(struct decoder *d, const uint8_t *level)
{
    d->level = level;
}

void decoder_destroy(struct decoder *d)
{
    if (!d)
        return;
    if (d->jpeg.err)
        jpeg_destroy_decompress(&d->jpeg);
    sst_jpeg_means_destroy(d->means);
    sst_image_fini(&d->image);
    sst_mem_free(d->pixels);
    free(d);
}

int decoder_read_means(struct decoder *d, const struct decoder_frame *frame, struct block_means *means,
                       struct sst_jpeg_index *index)
{
    struct sst_raw raw;
    int err;

    if (sst_raw_is_jpeg(d->fourcc))
        return jpeg_means(d, frame, means, index);
    err = raw_of(d, frame, &raw);
    if (!err)
        raw_means(means, &raw, d->level);
    return err;
}

int decoder_decode(struct decoder *d, const struct decoder_frame *frame, struct sst_rect part, const uint8_t **pixels,
                   size_t *stride)
{
    const int err = sst_raw_is_jpeg(d->fourcc) ? decode_jpeg(d, frame, part) : decode_raw(d, frame, part);

    if (err)
        return err;
    *pixels = d->pixels;
    *stride = d->stride;
    return 0;
}

const char *decoder_fault(const struct decoder *d)
{
    return d->fault;
}
