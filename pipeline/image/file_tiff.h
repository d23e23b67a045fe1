/* pipeline/image/file_tiff.h - a TIFF file in memory that is read or written by libtiff, which is loaded when it is
 * first needed. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_FILE_TIFF_H
#define SST_PIPELINE_IMAGE_FILE_TIFF_H

#include <stdbool.h>
#include <tiffio.h>

#include "base/base.h"

#define TIFF_FUNCTIONS(X)                                                                                              \
    X(TIFFOpenOptionsAlloc)                                                                                            \
    X(TIFFOpenOptionsFree)                                                                                             \
    X(TIFFOpenOptionsSetErrorHandlerExtR)                                                                              \
    X(TIFFOpenOptionsSetMaxSingleMemAlloc)                                                                             \
    X(TIFFOpenOptionsSetWarningHandlerExtR)                                                                            \
    X(TIFFClientOpenExt)                                                                                               \
    X(TIFFClose)                                                                                                       \
    X(TIFFFieldDataType)                                                                                               \
    X(TIFFFieldPassCount)                                                                                              \
    X(TIFFFieldReadCount)                                                                                              \
    X(TIFFFindField)                                                                                                   \
    X(TIFFGetField)                                                                                                    \
    X(TIFFGetFieldDefaulted)                                                                                           \
    X(TIFFSetField)                                                                                                    \
    X(TIFFIsTiled)                                                                                                     \
    X(TIFFComputeStrip)                                                                                                \
    X(TIFFComputeTile)                                                                                                 \
    X(TIFFGetStrileByteCount)                                                                                          \
    X(TIFFGetStrileOffset)                                                                                             \
    X(TIFFReadEncodedStrip)                                                                                            \
    X(TIFFReadEncodedTile)                                                                                             \
    X(TIFFWriteEncodedStrip)

/** Functions of the library. Fixed after the first tiff_open(). */
struct tiff_library {
#define X(name) __typeof__(&(name)) name;
    TIFF_FUNCTIONS(X)
#undef X
};
extern struct tiff_library tiff_lib;

/* The first page, as its tags describe it. */
struct tiff_layout {
    int width, height;
    int bits, format; /* of a sample; SAMPLEFORMAT_ */
    int photometric;  /* PHOTOMETRIC_ */
    int channels;     /* that are read */
};

/* An open file in memory. */
struct tiff_file {
    const char *name;
    const uint8_t *in; /* reading */
    uint8_t *out;      /* writing */
    size_t size, capacity, pos;
    TIFF *tif;
    char message[256]; /* the library's first error */

    struct tiff_layout layout;
    int samples;   /* of a pixel */
    bool separate; /* a plane for each */
    bool tiled;
    uint32_t chunk_width, chunk_height; /* px of a tile or strip */
    size_t chunk_bytes;                 /* when decoded, of the largest one */
    uint16_t compression;
    const uint16_t *palette[3];
};

/* Decoded samples of a row within a strip or tile, in the processor's byte order. */
struct tiff_row {
    int x, y, width;  /* of the picture */
    int first, count; /* channels */
    size_t step;      /* samples from a pixel to the next one */
    const uint8_t *samples;
};
typedef void tiff_row_fn(void *arg, const struct tiff_row *row);

/** Open it, for reading if `in` is set. @return 0, -EBADMSG (logged where the library is not there), -ENOMEM */
SST_MUST_CHECK int tiff_open(struct tiff_file *f, const char *mode);
void tiff_close(struct tiff_file *f);

/** Work on an open file of which the layout is read. */
typedef int tiff_work_fn(void *arg, struct tiff_file *f);

/** Open a file in memory, work on it and close it. @return as readers of codec.h, else the work's */
SST_MUST_CHECK int tiff_read_file(const uint8_t *data, size_t size, const char *name, tiff_work_fn *work, void *arg);

/** Whether all pixels of the layout's channels can be in the file, before memory is allocated for them. The bits of a
 *  sample are a multiple of 8. @return 0, -EBADMSG, logged */
SST_MUST_CHECK int tiff_check_rows(struct tiff_file *f);

/** Decode the channels of the layout, row by row, after tiff_check_rows(). @return 0, -EBADMSG, -ENOMEM, logged */
SST_MUST_CHECK int tiff_read_rows(struct tiff_file *f, tiff_row_fn *put, void *arg);

/** Log one sentence: "... is a TIFF of this kind; remedy", or the library's error. @return -EBADMSG */
int tiff_refuse(const struct tiff_file *f, const char *what, const char *remedy);
int tiff_damaged(const struct tiff_file *f);

#endif
