/* JPEG: read through the API of libjpeg, which tells warnings apart; written through TurboJPEG. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jerror.h>
#include <jpeglib.h>
#include <turbojpeg.h>

#include "base/file.h"
#include "base/log.h"
#include "base/mem.h"
#include "base/stats.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/codec_formats.h"
#include "pipeline/image/jpeg_planes.h"
#include "pipeline/kernels/kernels.h"

/* A block of 8x8 samples takes at least one bit of each component in a Huffman-coded file: one byte for about 340
 * pixels at 4:2:0. A large image that claims far more is truncated, and is rejected before memory is allocated for
 * it. */
#define LARGE_PIXELS        ((size_t)1 << 24)
#define MAX_PIXELS_PER_BYTE 2048
#define MAX_SCANS           500 /* a progressive file with more would take for ever */
/* Bytes between the coded data and the next marker that are no damage: cameras leave some before restart markers, and
 * align the end of the picture. All pixels are decoded then. A decoder that went astray has more left, or reports a bad
 * code or a wrong marker. */
#define STRAY_RESTART 32
#define STRAY_END     3

bool sst_jpeg_may_hold(size_t pixels, size_t bytes)
{
    return pixels <= LARGE_PIXELS || pixels / MAX_PIXELS_PER_BYTE <= bytes;
}

struct file {
    const uint8_t *data;
    size_t size;
    const char *name;
    bool strict; /* the end marker must be there */
};

/* Everything that must survive a longjmp out of libjpeg lives here, not in locals. */
struct reader {
    struct file file;
    struct jpeg_decompress_struct jpeg;
    struct jpeg_error_mgr errors;
    struct jpeg_progress_mgr progress;
    jmp_buf escape;
    uint8_t *row;
    bool ends_early; /* the end marker is not there */
    char message[JMSG_LENGTH_MAX];
};

static void on_error(j_common_ptr c)
{
    struct reader *r = c->client_data;

    c->err->format_message(c, r->message);
    longjmp(r->escape, 1);
}

/* Bytes before a marker: anything in the header, where only segments count. */
static bool is_stray(const struct reader *r)
{
    const int bytes = r->errors.msg_parm.i[0], marker = r->errors.msg_parm.i[1];
    const bool restart = marker >= JPEG_RST0 && marker <= JPEG_RST0 + 7;

    return !r->jpeg.input_scan_number || bytes <= (restart ? STRAY_RESTART : STRAY_END);
}

/* The file ends before its end marker: libjpeg goes on as if one followed. A sample for which data are missing then is
 * a warning of its own, but not with arithmetic coding. */
static bool may_end_early(struct reader *r)
{
    r->ends_early = !r->file.strict && r->jpeg.input_scan_number && !r->jpeg.arith_code;
    return r->ends_early;
}

/* A warning means that samples are missing or guessed, which is damage, unless it is about bytes that no sample is made
 * of: a version number, bytes between segments, or the end marker. */
static void on_message(j_common_ptr c, int level)
{
    const int code = c->err->msg_code;

    if (level < 0 && code == JWRN_JPEG_EOF && may_end_early(c->client_data))
        return;
    if (level < 0 && code != JWRN_JFIF_MAJOR && !(code == JWRN_EXTRANEOUS_DATA && is_stray(c->client_data)))
        on_error(c);
}

static void on_progress(j_common_ptr c)
{
    struct reader *r = c->client_data;

    if (r->jpeg.input_scan_number <= MAX_SCANS)
        return;
    snprintf(r->message, sizeof(r->message), "it has more than %d scans", MAX_SCANS);
    longjmp(r->escape, 1);
}

static int damaged(const struct reader *r)
{
    if (!strncmp(r->message, "Unsupported", 11))
        sst_log_error("%s is a JPEG image of a kind that is not read (%s); write it as one of 8 bits, baseline or progressive",
                      r->file.name, r->message);
    else
        sst_log_error("%s is a damaged or truncated JPEG image (%s); write it again", r->file.name, r->message);
    return -EBADMSG;
}

/* May escape. */
static int read_header(struct reader *r)
{
    struct jpeg_decompress_struct *jpeg = &r->jpeg;
    size_t pixels;

    jpeg_create_decompress(jpeg);
    r->progress.progress_monitor = on_progress;
    jpeg->progress = &r->progress;
    jpeg_mem_src(jpeg, r->file.data, r->file.size);
    (void)jpeg_read_header(jpeg, TRUE);
    pixels = (size_t)jpeg->image_width * jpeg->image_height;
    if (jpeg->image_width > SST_IMAGE_MAX_SIDE || jpeg->image_height > SST_IMAGE_MAX_SIDE ||
        pixels > SST_IMAGE_MAX_PIXELS)
        return sst_image_size_error(-EINVAL, r->file.name, jpeg->image_width, jpeg->image_height);
    if (!sst_jpeg_may_hold(pixels, r->file.size)) {
        sst_log_error("%s is a truncated JPEG image (%zu bytes for %ux%u pixels); write it again", r->file.name,
                      r->file.size, jpeg->image_width, jpeg->image_height);
        return -EBADMSG;
    }
    return 0;
}

/* Were there scans for everything, with all bits of progressive ones? */
static bool is_complete(const struct jpeg_decompress_struct *jpeg)
{
    bool complete = true;

    for (int c = 0; c < jpeg->num_components; c++) {
        complete &= jpeg->comp_info[c].quant_table != NULL; /* set by the component's first scan */
        for (int k = 0; jpeg->progressive_mode && k < DCTSIZE2; k++)
            complete &= jpeg->coef_bits && jpeg->coef_bits[c][k] == 0;
    }
    return complete;
}

/* All rows are read. May escape. */
static int finish(struct reader *r)
{
    static atomic_bool warned;
    const bool complete = is_complete(&r->jpeg); /* its tables are gone afterwards */

    (void)jpeg_finish_decompress(&r->jpeg);
    if (!r->ends_early)
        return 0;
    if (!complete) {
        snprintf(r->message, sizeof(r->message), "its last scans are missing");
        return damaged(r);
    }
    if (!atomic_exchange(&warned, true)) /* an array's pictures are all alike, and read by several stages */
        sst_log_warning("%s lacks the end marker of JPEG, but none of its samples; other programs may refuse it, and "
                        "others of this kind",
                        r->file.name);
    return 0;
}

/* Work on a file of which the header is read; may escape. */
typedef int work_fn(struct reader *r, void *arg);

static int guarded(struct reader *r, work_fn *work, void *arg)
{
    int err;

    if (setjmp(r->escape))
        return damaged(r);
    err = read_header(r);
    return err ? err : work(r, arg);
}

static int read_file(const struct file *file, work_fn *work, void *arg)
{
    struct reader r;
    int err;

    memset(&r, 0, sizeof(r));
    r.file = *file;
    r.jpeg.err = jpeg_std_error(&r.errors);
    r.jpeg.client_data = &r;
    r.errors.error_exit = on_error;
    r.errors.emit_message = on_message;
    err = guarded(&r, work, arg);
    jpeg_destroy_decompress(&r.jpeg);
    sst_mem_free(r.row);
    return err;
}

static int note_size(struct reader *r, void *arg)
{
    int *side = arg;

    side[0] = (int)r->jpeg.image_width;
    side[1] = (int)r->jpeg.image_height;
    return 0;
}

int sst_jpeg_size(int *width, int *height, const uint8_t *data, size_t size, const char *name)
{
    int side[2], err = read_file(&(struct file){ data, size, name }, note_size, side);

    if (!err) {
        *width = side[0];
        *height = side[1];
    }
    return err;
}

/* Steps of the luma at quality 50, rows of growing frequency (ISO/IEC 10918-1, table K.1). */
static const int luma_steps[DCTSIZE2] = {
    16, 11,  10,  16, 24, 40, 51, 61, 12,  12,  14,  19,  26, 58, 60, 55,  14,  13,  16,  24, 40, 57,
    69, 56,  14,  17, 22, 29, 51, 87, 80,  62,  18,  22,  37, 56, 68, 109, 103, 77,  24,  35, 55, 64,
    81, 104, 113, 92, 49, 64, 78, 87, 103, 121, 120, 101, 72, 92, 95, 98,  112, 100, 103, 99,
};

/* libjpeg's scale of qualities, by the step that is typical in comparison. */
static int note_quality(struct reader *r, void *quality)
{
    const struct jpeg_decompress_struct *jpeg = &r->jpeg;
    const JQUANT_TBL *table = jpeg->comp_info ? jpeg->quant_tbl_ptrs[jpeg->comp_info[0].quant_tbl_no] : NULL;
    double percent[DCTSIZE2], scale;

    if (!table)
        return 0;
    for (int i = 0; i < DCTSIZE2; i++)
        percent[i] = 100.0 * table->quantval[i] / luma_steps[i];
    scale = sst_stats_median(percent, DCTSIZE2);
    *(double *)quality = scale <= 100 ? (200 - scale) / 2 : 5000 / scale;
    return 0;
}

double sst_jpeg_quality(const uint8_t *data, size_t size, const char *name)
{
    double quality = NAN;

    return read_file(&(struct file){ data, size, name }, note_quality, &quality) ? NAN : quality;
}

/* In place, four bytes a pixel. 255 is no ink where Adobe's marker is, as Photoshop writes it: R = C * K / 255; else 255 is full ink. */
static void cmyk_to_rgb(uint8_t *px, size_t n, bool inverted)
{
    const unsigned flip = inverted ? 0 : 255;

    for (size_t i = 0; i < n; i++) {
        const unsigned k = px[4 * i + 3] ^ flip;

        for (size_t c = 0; c < 3; c++)
            px[4 * i + c] = (uint8_t)(((px[4 * i + c] ^ flip) * k + 127) / 255);
    }
}

struct decoding {
    struct sst_image *out;
    int least_width; /* that is enough; 0: all */
};

static int decode_image(struct reader *r, void *arg)
{
    struct jpeg_decompress_struct *jpeg = &r->jpeg;
    const struct decoding *d = arg;
    struct sst_image *out = d->out;
    int err;

    jpeg->out_color_space = jpeg->num_components == 4 ? JCS_CMYK : JCS_EXT_RGBX;
    jpeg->dct_method = JDCT_ISLOW;
    while (d->least_width > 0 && jpeg->scale_denom < 8 &&
           jpeg->image_width >= 2 * jpeg->scale_denom * (unsigned)d->least_width)
        jpeg->scale_denom *= 2;
    jpeg_calc_output_dimensions(jpeg);
    r->row = sst_mem_alloc_raw(jpeg->output_width, 4);
    err = r->row ? sst_image_init(out, (int)jpeg->output_width, (int)jpeg->output_height) : -ENOMEM;
    if (err)
        return sst_image_size_error(err, r->file.name, jpeg->image_width, jpeg->image_height);
    (void)jpeg_start_decompress(jpeg);
    while (jpeg->output_scanline < jpeg->output_height) {
        const int y = (int)jpeg->output_scanline;

        (void)jpeg_read_scanlines(jpeg, &r->row, 1);
        if (jpeg->out_color_space == JCS_CMYK)
            cmyk_to_rgb(r->row, jpeg->output_width, jpeg->saw_Adobe_marker);
        sst_kernels_get()->split_row((uint8_t *const[]){ sst_image_row(out, 0, y), sst_image_row(out, 1, y),
                                                         sst_image_row(out, 2, y) },
                                     r->row, jpeg->output_width);
    }
    return finish(r);
}

static int decode(struct sst_image *img, const struct file *file, int least_width)
{
    struct sst_image made = { 0 };
    int err = read_file(file, decode_image, &(struct decoding){ &made, least_width });

    if (err)
        sst_image_fini(&made);
    else
        *img = made;
    return err;
}

int sst_jpeg_decode(struct sst_image *img, const uint8_t *data, size_t size, const char *name, bool strict)
{
    return decode(img, &(struct file){ data, size, name, strict }, 0);
}

int sst_jpeg_decode_small(struct sst_image *img, const uint8_t *data, size_t size, const char *name, int least_width)
{
    return decode(img, &(struct file){ data, size, name, true }, least_width);
}

/* --- planes ------------------------------------------------------------------------------------------------------- */

#define MAX_ROWS (4 * DCTSIZE) /* of a plane that are decoded at once */

/* @return false: a device does not convert it */
static bool set_layout(struct sst_jpeg_planes *out, const struct jpeg_decompress_struct *jpeg)
{
    const jpeg_component_info *c = jpeg->comp_info;
    const int most_h = jpeg->max_h_samp_factor, most_v = jpeg->max_v_samp_factor;
    const bool grey = jpeg->num_components == 1 && jpeg->jpeg_color_space == JCS_GRAYSCALE;
    size_t bytes = 0;

    *out = (struct sst_jpeg_planes){ .width = (int)jpeg->image_width,
                                     .height = (int)jpeg->image_height,
                                     .count = jpeg->num_components,
                                     .across = grey ? 1 : most_h,
                                     .down = grey ? 1 : most_v };
    if (!grey && (jpeg->num_components != 3 || jpeg->jpeg_color_space != JCS_YCbCr || c[0].h_samp_factor != most_h ||
                  c[0].v_samp_factor != most_v || c[1].h_samp_factor * c[1].v_samp_factor != 1 ||
                  c[2].h_samp_factor * c[2].v_samp_factor != 1 || most_h > 2 || most_v > most_h))
        return false;
    out->chroma_width = (out->width + out->across - 1) / out->across;
    out->chroma_height = (out->height + out->down - 1) / out->down;
    for (int i = 0; i < out->count; i++) {
        const size_t mcus = (jpeg->image_height + (size_t)most_v * DCTSIZE - 1) / ((size_t)most_v * DCTSIZE);

        out->at[i] = bytes;
        out->stride[i] = (jpeg->image_width * (size_t)c[i].h_samp_factor + (size_t)most_h * DCTSIZE - 1) /
                         ((size_t)most_h * DCTSIZE) * DCTSIZE;
        bytes += out->stride[i] * mcus * (size_t)c[i].v_samp_factor * DCTSIZE;
    }
    out->bytes = bytes;
    return out->chroma_width > 2;
}

static int read_layout(struct reader *r, void *out)
{
    return set_layout(out, &r->jpeg) ? 0 : -ENOTSUP;
}

int sst_jpeg_planes_read(struct sst_jpeg_planes *out, const uint8_t *data, size_t size, const char *name)
{
    struct sst_jpeg_planes made;
    int err = read_file(&(struct file){ data, size, name }, read_layout, &made);

    if (!err)
        *out = made;
    return err;
}

struct planes {
    uint8_t *to;
    const struct sst_jpeg_planes *layout;
};

static int decode_planes(struct reader *r, void *arg)
{
    struct jpeg_decompress_struct *jpeg = &r->jpeg;
    const struct planes *p = arg;
    JSAMPROW row[3][MAX_ROWS];
    JSAMPARRAY plane[3] = { row[0], row[1], row[2] };

    jpeg->raw_data_out = TRUE;
    jpeg->out_color_space = jpeg->jpeg_color_space;
    jpeg->dct_method = JDCT_ISLOW;
    (void)jpeg_start_decompress(jpeg);
    while (jpeg->output_scanline < jpeg->output_height) {
        for (int c = 0; c < p->layout->count; c++) {
            const JDIMENSION rows = (JDIMENSION)jpeg->comp_info[c].v_samp_factor * DCTSIZE;
            const JDIMENSION first = jpeg->output_scanline / (JDIMENSION)jpeg->max_v_samp_factor *
                                     (JDIMENSION)jpeg->comp_info[c].v_samp_factor;

            for (JDIMENSION i = 0; i < rows; i++)
                row[c][i] = p->to + p->layout->at[c] + (first + i) * p->layout->stride[c];
        }
        (void)jpeg_read_raw_data(jpeg, plane, (JDIMENSION)jpeg->max_v_samp_factor * DCTSIZE);
    }
    return finish(r);
}

int sst_jpeg_planes_decode(uint8_t *to, const struct sst_jpeg_planes *layout, const uint8_t *data, size_t size,
                           const char *name)
{
    return read_file(&(struct file){ data, size, name }, decode_planes, &(struct planes){ to, layout });
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

struct sst_jpeg_encoder {
    tjhandle tj;
    struct sst_mem_kept packed, jpeg;
    enum sst_jpeg_chroma chroma;
};

int sst_jpeg_encoder_create(struct sst_jpeg_encoder **out)
{
    struct sst_jpeg_encoder *e = calloc(1, sizeof(*e));

    if (e)
        e->tj = tjInitCompress();
    if (!e || !e->tj) {
        free(e);
        return -ENOMEM;
    }
    *out = e;
    return 0;
}

void sst_jpeg_encoder_destroy(struct sst_jpeg_encoder *e)
{
    if (!e)
        return;
    tjDestroy(e->tj);
    sst_mem_kept_fini(&e->packed);
    sst_mem_kept_fini(&e->jpeg);
    free(e);
}

int sst_jpeg_encoder_run(struct sst_jpeg_encoder *e, const struct sst_image *img, int quality, const uint8_t **data,
                         size_t *size)
{
    static const int samples[] = { [SST_JPEG_420] = TJSAMP_420,
                                   [SST_JPEG_422] = TJSAMP_422,
                                   [SST_JPEG_444] = TJSAMP_444,
                                   [SST_JPEG_GREY] = TJSAMP_GRAY };
    const int sampling = samples[e->chroma];
    const size_t row_bytes = (size_t)img->width * 3;
    unsigned long bytes = tjBufSize(img->width, img->height, sampling);
    uint8_t *packed = sst_mem_keep(&e->packed, (size_t)img->height, row_bytes);
    unsigned char *jpeg = sst_mem_keep(&e->jpeg, bytes, 1);

    if (!packed || !jpeg)
        return -ENOMEM;
    for (int y = 0; y < img->height; y++)
        sst_rgb_pack_row(packed + (size_t)y * row_bytes, img, y);
    if (tjCompress2(e->tj, packed, img->width, 0, img->height, TJPF_RGB, &jpeg, &bytes, sampling, quality,
                    TJFLAG_ACCURATEDCT | TJFLAG_NOREALLOC)) {
        sst_log_error("cannot encode an image of %dx%d as JPEG: %s", img->width, img->height, tjGetErrorStr2(e->tj));
        return -EIO;
    }
    *data = jpeg;
    *size = bytes;
    return 0;
}

int sst_image_encode_jpeg(const struct sst_image *img, int quality, uint8_t **data, size_t *size)
{
    return sst_image_encode_jpeg_as(img, quality, SST_JPEG_420, data, size);
}

int sst_image_encode_jpeg_as(const struct sst_image *img, int quality, enum sst_jpeg_chroma chroma, uint8_t **data,
                             size_t *size)
{
    struct sst_jpeg_encoder *e = NULL;
    const uint8_t *jpeg;
    uint8_t *copy = NULL;
    size_t bytes;
    int err = sst_jpeg_encoder_create(&e);

    if (e)
        e->chroma = chroma;
    err = err ? err : sst_jpeg_encoder_run(e, img, quality, &jpeg, &bytes);
    if (!err)
        copy = malloc(bytes);
    if (!err && !copy)
        err = -ENOMEM;
    if (!err) {
        memcpy(copy, jpeg, bytes);
        *data = copy;
        *size = bytes;
    }
    sst_jpeg_encoder_destroy(e);
    return err;
}

int sst_image_write_jpeg(const struct sst_image *img, const char *path, int quality)
{
    uint8_t *jpeg = NULL;
    size_t size = 0;
    int err = sst_image_encode_jpeg(img, quality, &jpeg, &size);

    if (err == -ENOMEM)
        return sst_image_size_error(err, path, img->width, img->height);
    err = err ? err : sst_file_write(path, jpeg, size);
    free(jpeg);
    return err;
}
