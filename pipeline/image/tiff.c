/* Pictures of 8 and 16 bits as TIFF files. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "pipeline/image/codec_formats.h"
#include "pipeline/image/file_tiff.h"
#include "pipeline/image/image_internal.h"

#define STRIP_BYTES 262144 /* of files that are written */

/* Channels and bits, if it is a picture of a kind that is read. */
static int check_picture(struct tiff_file *f)
{
    struct tiff_layout *l = &f->layout;
    char what[64];

    snprintf(what, sizeof(what), "of %d bits a sample", l->bits);
    if (l->format == SAMPLEFORMAT_IEEEFP)
        return tiff_refuse(f, "of floating-point numbers", "write it with 16-bit levels");
    if (l->bits != 8 && l->bits != 16)
        return tiff_refuse(f, what, "write it with 8 or 16");
    if (l->format == SAMPLEFORMAT_INT)
        return tiff_refuse(f, "of signed numbers", "write it with unsigned levels");
    if (l->format != SAMPLEFORMAT_UINT && l->format != SAMPLEFORMAT_VOID)
        return tiff_refuse(f, "of complex numbers", "write it with 8 or 16 bits a sample");
    snprintf(what, sizeof(what), "of %d channels, neither grey nor RGB", f->samples);
    switch (l->photometric) {
    case PHOTOMETRIC_MINISBLACK:
    case PHOTOMETRIC_MINISWHITE:
        l->channels = 1;
        return f->samples <= 2 ? 0 : tiff_refuse(f, what, "export the channels that are meant");
    case PHOTOMETRIC_RGB:
        l->channels = 3;
        return f->samples == 3 || f->samples == 4 ? 0 : tiff_refuse(f, what, "export the channels that are meant");
    case PHOTOMETRIC_PALETTE:
        l->channels = 1;
        if (f->samples <= 2 &&
            tiff_lib.TIFFGetField(f->tif, TIFFTAG_COLORMAP, &f->palette[0], &f->palette[1], &f->palette[2]))
            return 0;
        return tiff_damaged(f);
    default:
        return tiff_refuse(f, "of colours that are neither grey nor RGB", "convert it to grey or RGB");
    }
}

/* A picture that is decoded. */
struct decoded {
    struct sst_deep *deep;
    const struct tiff_file *file;
};

static void put_row(void *arg, const struct tiff_row *row)
{
    const struct decoded *d = arg;
    const struct tiff_file *f = d->file;
    const bool wide = f->layout.bits == 16;
    const int flip = f->layout.photometric == PHOTOMETRIC_MINISWHITE ? d->deep->white : 0; /* v ^ flip is white - v */

    for (int c = 0; c < row->count; c++) {
        uint16_t *to = sst_map_u16_row(&d->deep->plane[row->first + c], row->y) + row->x;
        const uint8_t *u8 = row->samples + c;
        const uint16_t *u16 = (const uint16_t *)(const void *)row->samples + c;

        for (int x = 0; x < row->width; x++)
            to[x] = (uint16_t)((wide ? u16[(size_t)x * row->step] : u8[(size_t)x * row->step]) ^ flip);
    }
}

/* A palette has levels of 16 bits; those that older programs wrote have 8 (libtiff's tiff2rgba guesses likewise). */
static void apply_palette(struct sst_deep *deep, const struct tiff_file *f)
{
    const int n = 1 << f->layout.bits;
    bool wide = false;

    for (int i = 0; i < 3 * n; i++)
        wide |= f->palette[i / n][i % n] > 255;
    for (int c = 2; c >= 0; c--) { /* indices are in the first plane */
        for (int y = 0; y < deep->height; y++) {
            const uint16_t *from = sst_map_u16_row(&deep->plane[0], y);
            uint16_t *to = sst_map_u16_row(&deep->plane[c], y);

            for (int x = 0; x < deep->width; x++)
                to[x] = (uint16_t)(f->palette[c][from[x]] >> (wide ? 8 : 0));
        }
    }
}

static int decode(struct sst_deep *out, struct tiff_file *f)
{
    const bool coloured = f->layout.photometric == PHOTOMETRIC_PALETTE;
    struct sst_deep made = { 0 };
    int err = tiff_check_rows(f);

    if (err)
        return err;
    err = sst_deep_init(&made, f->layout.width, f->layout.height, coloured ? 3 : f->layout.channels,
                        f->layout.bits == 16 && !coloured ? 65535 : 255);
    err = err ? sst_image_size_error(err, f->name, f->layout.width, f->layout.height)
              : tiff_read_rows(f, put_row, &(struct decoded){ &made, f });
    if (err) {
        sst_deep_fini(&made);
        return err;
    }
    if (coloured)
        apply_palette(&made, f);
    *out = made;
    return 0;
}

static int decode_work(void *arg, struct tiff_file *f)
{
    const int err = check_picture(f);

    return err ? err : decode(arg, f);
}

int tiff_decode(struct sst_deep *out, const uint8_t *data, size_t size, const char *name)
{
    return tiff_read_file(data, size, name, decode_work, out);
}

static int size_work(void *arg, struct tiff_file *f)
{
    const bool coloured = f->layout.photometric == PHOTOMETRIC_PALETTE;
    struct sst_deep_size *out = arg;
    const int err = check_picture(f);

    if (!err)
        *out = (struct sst_deep_size){ f->layout.width, f->layout.height, coloured ? 3 : f->layout.channels,
                                       coloured ? 8 : f->layout.bits };
    return err;
}

int tiff_size(struct sst_deep_size *out, const uint8_t *data, size_t size, const char *name)
{
    return tiff_read_file(data, size, name, size_work, out);
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

static int write_strips(struct tiff_file *f, const struct sst_deep *deep)
{
    const size_t row_bytes = (size_t)deep->width * (size_t)deep->channels * 2;
    const int rows = sst_clamp_int((int)(STRIP_BYTES / row_bytes), 1, deep->height);
    uint16_t *packed = malloc(row_bytes * (size_t)rows);
    bool good = packed && tiff_lib.TIFFSetField(f->tif, TIFFTAG_IMAGEWIDTH, deep->width) &&
                tiff_lib.TIFFSetField(f->tif, TIFFTAG_IMAGELENGTH, deep->height) &&
                tiff_lib.TIFFSetField(f->tif, TIFFTAG_BITSPERSAMPLE, 16) &&
                tiff_lib.TIFFSetField(f->tif, TIFFTAG_SAMPLESPERPIXEL, deep->channels) &&
                tiff_lib.TIFFSetField(f->tif, TIFFTAG_PHOTOMETRIC,
                                      deep->channels == 3 ? PHOTOMETRIC_RGB : PHOTOMETRIC_MINISBLACK) &&
                tiff_lib.TIFFSetField(f->tif, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG) &&
                tiff_lib.TIFFSetField(f->tif, TIFFTAG_COMPRESSION, COMPRESSION_ADOBE_DEFLATE) &&
                tiff_lib.TIFFSetField(f->tif, TIFFTAG_PREDICTOR, PREDICTOR_HORIZONTAL) &&
                tiff_lib.TIFFSetField(f->tif, TIFFTAG_ROWSPERSTRIP, rows);

    for (int y = 0; good && y < deep->height; y += rows) {
        const int n = sst_min_int(rows, deep->height - y);
        uint16_t *to = packed;

        for (int row = y; row < y + n; row++)
            for (int x = 0; x < deep->width; x++)
                for (int c = 0; c < deep->channels; c++)
                    *to++ = sst_map_u16_row(&deep->plane[c], row)[x];
        good = tiff_lib.TIFFWriteEncodedStrip(f->tif, (uint32_t)(y / rows), packed,
                                              (tmsize_t)(row_bytes * (size_t)n)) >= 0;
    }
    free(packed);
    return good ? 0 : -ENOMEM;
}

int tiff_write(const struct sst_deep *deep, const char *path)
{
    struct tiff_file f = { .name = path };
    int err = tiff_open(&f, "w");

    if (!f.tif)
        return err;
    err = write_strips(&f, deep);
    tiff_close(&f);
    /* Encoding to memory only fails for lack of memory. */
    if (err || f.message[0])
        err = sst_image_size_error(-ENOMEM, path, deep->width, deep->height);
    err = err ? err : sst_file_write(path, f.out, f.size);
    free(f.out);
    return err;
}
