/* pipeline/image/deep.h - pictures of 8 or 16 bits and one or three channels as they are, without rounding. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_DEEP_H
#define SST_PIPELINE_IMAGE_DEEP_H

#include "pipeline/image/image.h"

/** Levels of a picture: channels is 1 (grey, thermal) or 3 (red, green, blue). */
struct sst_deep {
    int width, height;
    int channels;
    int white;                   /* largest level of the file's type: 255 or 65535 */
    struct sst_map_u16 plane[3]; /* [channels] */
};

/** Size and kind of a picture without its pixels. */
struct sst_deep_size {
    int width, height;
    int channels, bits; /* 1 or 3; 8 or 16 */
};

/** Zeroed levels. @return as sst_map_u16_init(), -EINVAL also for other channels and whites */
SST_MUST_CHECK int sst_deep_init(struct sst_deep *deep, int width, int height, int channels, int white);
void sst_deep_fini(struct sst_deep *deep);

/**
 * Read a PNG, JPEG or TIFF of 8 or 16 bits, by its content; alpha is dropped, palettes become colours. TIFF: strips or
 * tiles, uncompressed, PackBits, LZW or deflate, grey or RGB, chunky or planar, both byte orders, first page.
 * A radiometric JPEG (FLIR, DJI) is refused with the command that converts it, floats and other depths by name.
 * @return as readers of codec.h
 */
SST_MUST_CHECK int sst_deep_decode(struct sst_deep *out, const uint8_t *data, size_t size, const char *name);

/** Size, channels and bits of a file without its pixels. @return as sst_deep_decode() */
SST_MUST_CHECK int sst_deep_decode_size(struct sst_deep_size *out, const uint8_t *data, size_t size, const char *name);

/** 16-bit PNG or TIFF (deflate) by the name's end, grey or RGB; levels of 8 bits are multiplied by 257.
 *  @return as writers of codec.h, -EINVAL: another end, logged */
SST_MUST_CHECK int sst_deep_write(const struct sst_deep *deep, const char *path);

/** 8-bit picture by a linear stretch: levels black to white become 0 to 255; white 0: the file's whole range.
 *  @return as sst_image_init() */
SST_MUST_CHECK int sst_deep_to_image(struct sst_image *out, const struct sst_deep *deep, struct sst_samples stretch);

/** Stretch that shows a picture: the levels that 0.5 % of the samples are below and above, at least two apart. */
struct sst_samples sst_deep_stretch(const struct sst_deep *deep);

#endif
