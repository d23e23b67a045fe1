/* pipeline/image/codec_formats.h - decoders of one format each, from memory; codec.c and deep.c select by content. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_CODEC_FORMATS_H
#define SST_PIPELINE_IMAGE_CODEC_FORMATS_H

#include "pipeline/image/codec.h"
#include "pipeline/image/deep.h"

/* Larger files are rejected: the largest image without any compression, and a header. */
#define SST_IMAGE_MAX_BYTES (SST_IMAGE_MAX_PIXELS * 4 + 65536)

enum sst_image_format {
    SST_IMAGE_OTHER = 0,
    SST_IMAGE_PNG = 1,
    SST_IMAGE_JPEG = 2,
    SST_IMAGE_TIFF = 3,
};

/** Format of a file in memory by its first bytes; another one than these is logged. */
enum sst_image_format sst_image_format_of(const uint8_t *data, size_t size, const char *name);

/* Same contract as in codec.h: logged, output untouched on failure. */
SST_MUST_CHECK int sst_png_decode(struct sst_image *img, const uint8_t *data, size_t size, const char *name,
                                  struct sst_samples samples);
/** @param strict  the end marker must be there; else it may lack, with a warning, if no sample does */
SST_MUST_CHECK int sst_jpeg_decode(struct sst_image *img, const uint8_t *data, size_t size, const char *name,
                                   bool strict);
/** The smallest of the whole, half, quarter and eighth picture that is least_width wide or wider: faster than scaling the whole. */
SST_MUST_CHECK int sst_jpeg_decode_small(struct sst_image *img, const uint8_t *data, size_t size, const char *name,
                                         int least_width);
SST_MUST_CHECK int sst_png_decode_deep(struct sst_deep *out, const uint8_t *data, size_t size, const char *name);
SST_MUST_CHECK int sst_png_size(struct sst_deep_size *out, const uint8_t *data, size_t size, const char *name);
SST_MUST_CHECK int sst_jpeg_size(int *width, int *height, const uint8_t *data, size_t size, const char *name);

/** Whether a Huffman-coded file of so many bytes can have so many pixels; small pictures always. */
bool sst_jpeg_may_hold(size_t pixels, size_t bytes);

/** Log an error of sst_*_init(): the rejected size, or out of memory. @return -EBADMSG or -ENOMEM */
int sst_image_size_error(int err, const char *name, int64_t width, int64_t height);

/** Split `width` pixels of packed RGB into row y of the planes, and the reverse. */
void sst_rgb_unpack_row(struct sst_image *img, int y, const uint8_t *rgb);
void sst_rgb_pack_row(uint8_t *rgb, const struct sst_image *img, int y);

#endif
