/* pipeline/image/image_internal.h - the common kinds of PNG, without libpng; segments of a JPEG; TIFF; terrain. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_IMAGE_INTERNAL_H
#define SST_PIPELINE_IMAGE_IMAGE_INTERNAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pipeline/image/deep.h"
#include "pipeline/image/heights.h"

/* Deflate expands a byte to at most 1032; a file that claims more is truncated, and no memory is allocated for it. */
#define PNG_PLAIN_MOST_RATIO 1040

/* 8-bit RGB, the values of 8-bit grey or indexed files, the values of 16-bit grey files. */
enum png_plain_kind { PNG_PLAIN_RGB = 0, PNG_PLAIN_U8 = 1, PNG_PLAIN_U16 = 2 };

struct png_plain {
    enum png_plain_kind kind;
    bool indexed;
    int width, height;
    size_t step;   /* bytes of a pixel */
    uint8_t *rows; /* [height][1 + step width] owned: samples as in the file, 16 bits big endian, after a byte each */
};

/**
 * Read a whole file that is of this kind, not interlaced and without any fault.
 * @return false: it is not, or there is no memory; nothing is to be freed then. Not logged. Not in builds without
 * libdeflate
 */
bool png_plain_read(struct png_plain *out, const uint8_t *data, size_t size, enum png_plain_kind kind);

void png_plain_fini(struct png_plain *p);

/** A map that becomes a file. */
struct png_map {
    const void *data; /* [height] rows of `stride` bytes */
    size_t stride;
    int width, height;
    bool u16;                      /* numbers of 16 bits in the processor's order; else bytes */
    const uint8_t (*palette)[3];   /* [256] of bytes, or NULL: grey */
    const struct sst_image *image; /* a picture, in place of all these but its size; NULL: a map */
};

/**
 * A whole file of a map or picture: quickly rather than small. The bytes depend on the library, the samples are the
 * map's.
 *
 * @param out  the file; the caller frees it
 * @return false: there is no memory; nothing is to be freed then. Not logged. Not in builds without ISA-L
 */
bool png_pack_map(uint8_t **out, size_t *size, const struct png_map *map);

/** A map becomes a file, by libpng where it cannot be packed faster. Faults are logged. */
SST_MUST_CHECK int png_write_map(const struct png_map *map, const char *path);

#define NPY_HEADER                                                                                                     \
    192 /* bytes before the data of an .npy: a multiple of 64 that holds four dimensions of 20 digits                  \
         */

/**
 * Header of an .npy, version 1.0, in C order and this machine's byte order.
 *
 * @param type   as of sst_npz_array, npz.h @param n_dims  0 to 4 @param bytes  out, of the data
 * @return 0, -EINVAL (n_dims, a type that is not known, more bytes than memory can have); not logged
 */
SST_MUST_CHECK int npy_header(char out[NPY_HEADER], const char *type, const size_t *dims, int n_dims, size_t *bytes);

#define JPEG_MARK_DHT 0xC4
#define JPEG_MARK_SOS 0xDA

/** A segment of a JPEG before its first scan's data (ITU-T T.81, B.1.1.4). */
struct jpeg_segment {
    size_t at; /* of its marker in the file */
    uint8_t mark;
    const uint8_t *data; /* after its length */
    size_t bytes;
};

/**
 * Go to the next segment; the header of the first scan is the last one.
 *
 * @param s  in: zeroed for the first one, else as it was left
 * @return false: there is no whole one, or the file is no JPEG
 */
bool jpeg_next_segment(struct jpeg_segment *s, const uint8_t *data, size_t size);

/* --- TIFF, and terrain ----------------------------------------------------------------------------------------------
 */

/** Place of a grid, and numbers that stand for none, by tags of GeoTIFF and GDAL. */
struct tiff_geo {
    bool placed;
    double x, y, dx, dy; /* as in heights.h */
    int epsg;            /* of the map; 0: unknown */
    bool has_nodata;
    double nodata; /* among the numbers as they are stored; heights are these * scale + offset */
    double scale, offset;
};

/** Whether a file in memory begins as a TIFF. */
bool tiff_is(const uint8_t *data, size_t size);

/** As the functions of deep.h; all refuse where this build has no libtiff. */
SST_MUST_CHECK int tiff_decode(struct sst_deep *out, const uint8_t *data, size_t size, const char *name);
SST_MUST_CHECK int tiff_size(struct sst_deep_size *out, const uint8_t *data, size_t size, const char *name);
SST_MUST_CHECK int tiff_write(const struct sst_deep *deep, const char *path);

/** Read one channel of floats, or of 16 bits, signed or not. @param grid  out, initialised here
 *  @return as sst_deep_decode() */
SST_MUST_CHECK int tiff_decode_grid(struct sst_map_f32 *grid, struct tiff_geo *geo, const uint8_t *data, size_t size,
                                    const char *name);

/** Grid of a mesh's heights, in its own unit. @param text  ends with a NUL @param name  only used in messages
 *  @return as sst_heights_read() */
SST_MUST_CHECK int mesh_to_heights(struct sst_heights *out, const char *text, const char *name);

#endif
