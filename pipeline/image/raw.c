/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/raw.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include <linux/videodev2.h>

#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/codec_formats.h"
#include "pipeline/image/image_internal.h"

#define FOLLOWED_PX     128   /* samples across the shorter side that a stretch is followed by */
#define FOLLOWED_SPAN   32768 /* a wider span is shown from all 16 bits; a third less, to return from that */
#define FOLLOWED_MARGIN 10    /* a tenth of the span at either end, so that small changes do not move it */

static size_t row_bytes(const struct sst_raw *raw)
{
    const int bytes = raw->fourcc == V4L2_PIX_FMT_RGB24                                         ? 3
                      : raw->fourcc == V4L2_PIX_FMT_Y16 || raw->fourcc == V4L2_PIX_FMT_YUYV ? 2
                                                                                                : 1;

    return (size_t)raw->width * (size_t)bytes;
}

static size_t stride_of(const struct sst_raw *raw)
{
    return raw->stride ? raw->stride : row_bytes(raw);
}

static int check(const struct sst_raw *raw)
{
    const size_t row = row_bytes(raw);

    if (raw->width < 1 || raw->height < 1 || (raw->fourcc == V4L2_PIX_FMT_YUYV && raw->width % 2) ||
        stride_of(raw) < row || (raw->bytes < row) || (raw->bytes - row) / stride_of(raw) < (size_t)raw->height - 1)
        return -EBADMSG;
    return 0;
}

/* --- YUYV --------------------------------------------------------------------------------------------------------- */

static uint8_t to_byte(int v_q16)
{
    return (uint8_t)sst_clamp_int((v_q16 + 32768) >> 16, 0, 255);
}

static void yuyv_row(struct sst_image *img, int y, int x0, int x1, const uint8_t *row)
{
    for (int x = x0; x < x1; x++) {
        const uint8_t *a = row + x / 2 * 4, *b = x % 2 && x + 1 < img->width ? a + 4 : a;
        const int luma = 76309 * (row[2 * x] - 16);               /* 255/219 in 1/65536 */
        const int u2 = a[1] + b[1] - 256, v2 = a[3] + b[3] - 256; /* twice the chroma */

        sst_image_row(img, 0, y)[x] = to_byte(luma + 52299 * v2);              /* 1.596027 / 2 */
        sst_image_row(img, 1, y)[x] = to_byte(luma - 12837 * u2 - 26639 * v2); /* 0.391762 / 2, 0.812968 / 2 */
        sst_image_row(img, 2, y)[x] = to_byte(luma + 66101 * u2);              /* 2.017232 / 2 */
    }
}

/* --- Bayer -------------------------------------------------------------------------------------------------------- */

/* Mirroring at the edge keeps odd and even, so every sample keeps its colour. */
static int mirror(int i, int n)
{
    if (n == 1)
        return 0;
    while (i < 0 || i >= n)
        i = i < 0 ? -i : 2 * (n - 1) - i;
    return i;
}

struct neighbours {
    int centre;
    int h1, v1, h2, v2; /* sums of two: at distance 1 and 2, horizontally and vertically */
    int diagonal;       /* sum of four */
};

static struct neighbours neighbours_of(const struct sst_raw *raw, int x, int y)
{
    const size_t stride = stride_of(raw);
    const uint8_t *row[5];
    int col[5];

    for (int i = 0; i < 5; i++) {
        row[i] = raw->data + (size_t)mirror(y + i - 2, raw->height) * stride;
        col[i] = mirror(x + i - 2, raw->width);
    }
    return (struct neighbours){
        .centre = row[2][col[2]],
        .h1 = row[2][col[1]] + row[2][col[3]],
        .v1 = row[1][col[2]] + row[3][col[2]],
        .h2 = row[2][col[0]] + row[2][col[4]],
        .v2 = row[0][col[2]] + row[4][col[2]],
        .diagonal = row[1][col[1]] + row[1][col[3]] + row[3][col[1]] + row[3][col[3]],
    };
}

static uint8_t sixteenth(int v)
{
    return (uint8_t)sst_clamp_int((v + 8) >> 4, 0, 255);
}

/* The sampled colour is exact; the other two come from the paper's 5x5 filters, here in sixteenths. */
static void bayer_pixel(struct sst_image *img, const struct sst_raw *raw, int x, int y, const int red[2])
{
    const struct neighbours n = neighbours_of(raw, x, y);
    const bool red_col = x % 2 == red[0], red_row = y % 2 == red[1];
    uint8_t *rgb[3];

    for (int c = 0; c < 3; c++)
        rgb[c] = sst_image_row(img, c, y) + x;
    if (red_col == red_row) { /* a red or blue sample */
        const int own = red_row ? 0 : 2;

        *rgb[own] = (uint8_t)n.centre;
        *rgb[1] = sixteenth(8 * n.centre + 4 * (n.h1 + n.v1) - 2 * (n.h2 + n.v2));
        *rgb[2 - own] = sixteenth(12 * n.centre + 4 * n.diagonal - 3 * (n.h2 + n.v2));
    } else { /* green: one colour lies beside it, the other above and below */
        const int beside = red_row ? 0 : 2;

        *rgb[1] = (uint8_t)n.centre;
        *rgb[beside] = sixteenth(10 * n.centre + 8 * n.h1 - 2 * n.diagonal - 2 * n.h2 + n.v2);
        *rgb[2 - beside] = sixteenth(10 * n.centre + 8 * n.v1 - 2 * n.diagonal - 2 * n.v2 + n.h2);
    }
}

bool sst_raw_red(uint32_t fourcc, int *x, int *y)
{
    static const uint32_t formats[] = { V4L2_PIX_FMT_SRGGB8, V4L2_PIX_FMT_SGRBG8, V4L2_PIX_FMT_SGBRG8,
                                        V4L2_PIX_FMT_SBGGR8 };

    for (int i = 0; i < 4; i++) {
        if (fourcc == formats[i]) {
            *x = i % 2;
            *y = i / 2;
            return true;
        }
    }
    return false;
}

/* The highest byte of each sample, which is its last. */
static void grey_row(struct sst_image *img, int y, struct sst_rect part, const uint8_t *row, int bytes)
{
    for (int c = 0; c < 3; c++)
        for (int x = part.x0; x < part.x1; x++)
            sst_image_row(img, c, y)[x] = row[x * bytes + bytes - 1];
}

static void rgb_row(struct sst_image *img, int y, struct sst_rect part, const uint8_t *row)
{
    for (int c = 0; c < 3; c++)
        for (int x = part.x0; x < part.x1; x++)
            sst_image_row(img, c, y)[x] = row[3 * x + c];
}

int sst_raw_part(struct sst_image *img, const struct sst_raw *raw, struct sst_rect part)
{
    const bool rgb = raw->fourcc == V4L2_PIX_FMT_RGB24;
    const int grey = raw->fourcc == V4L2_PIX_FMT_GREY ? 1 : raw->fourcc == V4L2_PIX_FMT_Y16 ? 2 : 0;
    const size_t stride = stride_of(raw);
    int red[2] = { 0, 0 };
    const bool bayer = sst_raw_red(raw->fourcc, &red[0], &red[1]);

    if (!bayer && !grey && !rgb && raw->fourcc != V4L2_PIX_FMT_YUYV)
        return -EINVAL;
    if (check(raw) || img->width != raw->width || img->height != raw->height)
        return -EBADMSG;
    for (int y = part.y0; y < part.y1; y++) {
        const uint8_t *row = raw->data + (size_t)y * stride;

        if (grey)
            grey_row(img, y, part, row, grey);
        else if (rgb)
            rgb_row(img, y, part, row);
        else if (!bayer)
            yuyv_row(img, y, part.x0, part.x1, row);
        for (int x = part.x0; bayer && x < part.x1; x++)
            bayer_pixel(img, raw, x, y, red);
    }
    return 0;
}

int sst_raw_to_image(struct sst_image *img, const struct sst_raw *raw)
{
    struct sst_image made = { 0 };
    int err = check(raw);

    err = err ? err : sst_image_init(&made, raw->width, raw->height);
    if (err == -EINVAL)
        err = -EBADMSG; /* a size beyond the limits of images */
    err = err ? err : sst_raw_part(&made, raw, (struct sst_rect){ 0, 0, raw->width, raw->height });
    if (err) {
        sst_image_fini(&made);
        return err;
    }
    *img = made;
    return 0;
}

int sst_raw_count_samples(struct sst_sample_counts *counts, const struct sst_raw *raw)
{
    if (raw->fourcc != V4L2_PIX_FMT_Y16)
        return 0;
    if (check(raw))
        return -EBADMSG;
    for (int y = 0; y < raw->height; y++) {
        for (int x = 0; x < raw->width; x++)
            counts->of[sst_raw_y16(raw->data + (size_t)y * stride_of(raw), x)]++;
    }
    return 1;
}

int sst_raw_to_image_samples(struct sst_image *img, const struct sst_raw *raw, struct sst_samples samples)
{
    const int err = sst_raw_to_image(img, raw);

    for (int i = 0; !err && raw->fourcc == V4L2_PIX_FMT_Y16 && i < 3 * raw->height; i++) {
        const uint8_t *from = raw->data + (size_t)(i / 3) * stride_of(raw);
        uint8_t *row = sst_image_row(img, i % 3, i / 3);

        for (int x = 0; x < raw->width; x++)
            row[x] = (uint8_t)sst_samples_scale(sst_raw_y16(from, x), samples);
    }
    return err;
}

/* Samples of every few rows and columns. @return how many */
static uint64_t count_some(struct sst_sample_counts *counts, const struct sst_raw *raw)
{
    const int step = sst_max_int(1, sst_min_int(raw->width, raw->height) / FOLLOWED_PX);
    uint64_t n = 0;

    if (raw->fourcc != V4L2_PIX_FMT_Y16 || check(raw))
        return 0;
    for (int y = step / 2; y < raw->height; y += step) {
        for (int x = step / 2; x < raw->width; x += step, n++)
            counts->of[sst_raw_y16(raw->data + (size_t)y * stride_of(raw), x)]++;
    }
    return n;
}

bool sst_raw_follow(struct sst_samples *stretch, const struct sst_raw *frame, int count)
{
    struct sst_sample_counts *counts = calloc(1, sizeof(*counts));
    const int span = stretch->white - stretch->black;
    struct sst_samples now;
    uint64_t n = 0;
    int margin;

    for (int i = 0; counts && i < count; i++)
        n += count_some(counts, &frame[i]);
    now = n ? sst_samples_stretch(counts, n, 65535) : *stretch;
    free(counts);
    if (!n)
        return false;
    if (now.white - now.black >= FOLLOWED_SPAN - (stretch->white ? 0 : FOLLOWED_SPAN / 3)) {
        now = (struct sst_samples){ 0, 0 };
    } else if (stretch->white > 0 && now.black >= stretch->black && now.white <= stretch->white &&
               2 * (now.white - now.black) >= span) {
        return false; /* it shows all, and not in too few levels */
    } else {
        margin = (now.white - now.black) / FOLLOWED_MARGIN;
        now = (struct sst_samples){ sst_max_int(now.black - margin, 0), sst_min_int(now.white + margin, 65535) };
    }
    if (now.black == stretch->black && now.white == stretch->white)
        return false;
    *stretch = now;
    return true;
}

bool sst_raw_is_jpeg(uint32_t fourcc)
{
    return fourcc == V4L2_PIX_FMT_MJPEG || fourcc == V4L2_PIX_FMT_JPEG;
}

int sst_raw_decode(struct sst_image *img, const struct sst_raw *raw)
{
    struct sst_samples stretch = { 0, -1 };
    char text[SST_LOG_MAX] = "", *before;
    int width, height, err;

    if (!sst_raw_is_jpeg(raw->fourcc)) {
        (void)sst_raw_follow(&stretch, raw, 1);
        return stretch.white > 0 ? sst_raw_to_image_samples(img, raw, stretch) : sst_raw_to_image(img, raw);
    }
    before = sst_log_hold_errors(text);
    err = sst_jpeg_size(&width, &height, raw->data, raw->bytes, "frame"); /* before memory is taken for it */
    if (!err && (width != raw->width || height != raw->height))
        err = -EBADMSG;
    err = err ? err : sst_jpeg_decode(img, raw->data, raw->bytes, "frame", true);
    sst_log_hold_errors(before);
    return err;
}

/* --- files -------------------------------------------------------------------------------------------------------- */

static int write_y16(const struct sst_raw *raw, const char *path)
{
    struct sst_map_u16 map;
    int err = sst_map_u16_init(&map, raw->width, raw->height);

    if (err)
        return err;
    for (int y = 0; y < raw->height; y++) {
        const uint8_t *row = raw->data + (size_t)y * stride_of(raw);

        for (int x = 0; x < raw->width; x++)
            sst_map_u16_row(&map, y)[x] = (uint16_t)sst_raw_y16(row, x);
    }
    err = sst_map_u16_write_png(&map, path);
    sst_map_u16_fini(&map);
    return err;
}

int sst_raw_write_png(const struct sst_raw *raw, const char *path)
{
    struct sst_image img;
    int err = check(raw);

    if (err) {
        sst_log_error("the frame for %s has %zu bytes, which do not make %dx%d pixels", path, raw->bytes, raw->width,
                      raw->height);
        return err;
    }
    if (raw->fourcc == V4L2_PIX_FMT_GREY)
        return png_write_map(
            &(struct png_map){ raw->data, stride_of(raw), raw->width, raw->height, false, NULL, NULL }, path);
    if (raw->fourcc == V4L2_PIX_FMT_Y16)
        return write_y16(raw, path);
    err = sst_raw_to_image(&img, raw);
    if (err) {
        sst_log_error("cannot make %s of a raw frame: %s", path,
                      err == -EINVAL ? "its format is unknown" : strerror(-err));
        return err;
    }
    err = sst_image_write_png(&img, path);
    sst_image_fini(&img);
    return err;
}
