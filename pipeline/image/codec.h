/* pipeline/image/codec.h - reading and writing of images and maps. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_CODEC_H
#define SST_PIPELINE_IMAGE_CODEC_H

#include "pipeline/image/image.h"

/* Every reader checks the whole file before it returns; on failure it logs one sentence (file, fault, remedy) and
 * leaves its output untouched. Readers return 0, -ENOENT, -EBADMSG (not an image, truncated, absurd size), -ENOMEM or
 * -EIO. Every writer goes through sst_outfile: whole file or none. Thread: any. */

/** Does the name of a file end as that of a PNG, JPEG or TIFF? */
bool sst_image_is_picture(const char *name);

/** Ending that the name of a picture in memory should have: .png, .jpg or .tif. */
const char *sst_image_ending(const uint8_t *data, size_t size);

/** Read a PNG, JPEG or TIFF (deep.h), detected by content. Grey becomes three equal planes, 16 bits are rounded to 8
 * (v 255/65535), alpha is dropped. */
SST_MUST_CHECK int sst_image_read(struct sst_image *img, const char *path);

/** Read a picture in memory, as sst_image_read(); name is only used in messages. */
SST_MUST_CHECK int sst_image_decode(struct sst_image *img, const uint8_t *data, size_t size, const char *name);

/** Read a picture with 16 bits scaled from `samples`: (v - black) 255 / (white - black), limited to 0..255 and
 *  rounded. Pictures of 8 bits do not depend on it. */
SST_MUST_CHECK int sst_image_decode_samples(struct sst_image *img, const uint8_t *data, size_t size, const char *name,
                                            struct sst_samples samples);

/** The samples themselves of a 16-bit picture in memory: red, green, blue, or grey in all three. @param plane  out,
 * initialised here
 *  @return as sst_image_decode(); -EBADMSG where it has fewer bits */
SST_MUST_CHECK int sst_image_decode_deep(struct sst_map_u16 plane[3], const uint8_t *data, size_t size,
                                         const char *name);

/** True if a file in memory begins as a JPEG. */
bool sst_image_is_jpeg(const uint8_t *data, size_t size);

/** Width and height of a picture in memory, without decoding its pixels. @return as sst_image_decode() */
SST_MUST_CHECK int sst_image_decode_size(int *width, int *height, const uint8_t *data, size_t size, const char *name);

/** How often each sample occurs, all channels but alpha together. */
struct sst_sample_counts {
    uint64_t of[65536];
};

/** Add the samples of a 16-bit picture in memory. @return 1, 0 (8 bits: nothing is added), or errors of
 *  sst_image_decode() */
SST_MUST_CHECK int sst_image_count_samples(struct sst_sample_counts *counts, const uint8_t *data, size_t size,
                                           const char *name);

/**
 * The samples to scale from, for pictures that are compared with each other: {0, 0} where they span half of 16 bits or
 * more, as usual pictures do, or are all one. Narrower ones, as of cameras of 10, 12 or 14 bits, span 0..255
 * afterwards: up to 256 different samples stay different. Where there are more, a ten-thousandth of the samples at
 * either end does not count: defective pixels would take the levels.
 */
struct sst_samples sst_samples_choose(const struct sst_sample_counts *counts);

/** Level 0..255 of a sample; the result of png_set_scale_16() where all 16 bits are scaled from. */
int sst_samples_scale(int v, struct sst_samples samples);

/** The stretch that shows pictures to people: the levels that 0.5 % of the samples are below and above, at least two
 *  apart, of 0 to `most`. Defective pixels do not count. @param total  samples that were counted */
struct sst_samples sst_samples_stretch(const struct sst_sample_counts *counts, uint64_t total, int most);

/** Log the loss when these samples are read: as a warning if different ones become the same.
 *  @param name  of the pictures */
void sst_samples_report(const struct sst_sample_counts *counts, struct sst_samples samples, const char *name);

/** Distinct samples, and how many levels they become. */
void sst_samples_levels(int *before, int *after, const struct sst_sample_counts *counts, struct sst_samples samples);

/** Log the loss of sst_image_read() in a picture of 16 bits. */
void sst_image_report_depth(const char *path);

/** Read pictures that are compared with each other: 16 bits are scaled alike in all, and the loss is reported. Where
 *  only some have 16 bits, they are read as by sst_image_read(). @param count  1 or 2 @return as sst_image_read(); on
 *  failure none is read */
SST_MUST_CHECK int sst_image_read_alike(struct sst_image *const *img, const char *const *path, int count);

/** sst_image_read_alike() of one picture, turned upright by its orientation. */
SST_MUST_CHECK int sst_image_read_upright(struct sst_image *img, const char *path);

/** Orientation of a picture in memory, EXIF's or a TIFF's own, 1..8; 1 (upright) where it has none, or no valid one. No reader but
 *  sst_image_read_upright() applies it: geometry is by the pixels as they are stored. */
int sst_image_orientation(const uint8_t *data, size_t size);

/** EXIF's orientation of a file, of which only the beginning is read; 1 where it cannot be read. */
int sst_image_read_orientation(const char *path);

/** Turn and mirror a picture as its orientation says: upright afterwards. @return 0 or -ENOMEM (unchanged; not logged)
 */
SST_MUST_CHECK int sst_image_orient(struct sst_image *img, int orientation);

/** Log a warning where pictures of an array have an orientation, which does not count, and name the pictures of another
 *  one than most. @param names  [count]; NULL: no picture */
void sst_image_warn_orientations(const char *source, const char *const *names, const uint8_t *orientations, int count);

/** Size of a picture without decoding its pixels. */
SST_MUST_CHECK int sst_image_read_size(const char *path, int *width, int *height);

/** Quality of a JPEG file in memory by the quantisation of its luma, in the scale of libjpeg: 1..100. NAN: damaged
 * (logged), or without tables. @param name  for messages */
double sst_jpeg_quality(const uint8_t *data, size_t size, const char *name);

SST_MUST_CHECK int sst_image_write_png(const struct sst_image *img, const char *path);

/** 16-bit RGB PNG: levels 0 to 255 become samples black to white, so that reading with `samples` gives the image again.
 */
SST_MUST_CHECK int sst_image_write_samples(const struct sst_image *img, struct sst_samples samples, const char *path);

/** 16-bit RGB PNG of these samples. */
SST_MUST_CHECK int sst_image_write_deep(const struct sst_map_u16 plane[3], const char *path);

/** @param quality 1..100; 4:2:0 */
SST_MUST_CHECK int sst_image_write_jpeg(const struct sst_image *img, const char *path, int quality);

struct sst_jpeg_encoder; /* reusable encoder state; one thread at a time */

/** @return 0, -ENOMEM (not logged) */
SST_MUST_CHECK int sst_jpeg_encoder_create(struct sst_jpeg_encoder **out);
void sst_jpeg_encoder_destroy(struct sst_jpeg_encoder *encoder);

/**
 * Encode to the same bytes as sst_image_write_jpeg(). @param data  out, borrowed until the next call
 * @return 0, -ENOMEM (not logged), -EIO
 */
SST_MUST_CHECK int sst_jpeg_encoder_run(struct sst_jpeg_encoder *encoder, const struct sst_image *img, int quality,
                                        const uint8_t **data, size_t *size);

/** Encode to memory; release with free(). @return 0, -ENOMEM (not logged), -EIO */
SST_MUST_CHECK int sst_image_encode_jpeg(const struct sst_image *img, int quality, uint8_t **data, size_t *size);

enum sst_jpeg_chroma {
    SST_JPEG_420 = 0,
    SST_JPEG_422 = 1,
    SST_JPEG_444 = 2,
    SST_JPEG_GREY = 3, /* none */
};

/** The same with other samples of chroma. */
SST_MUST_CHECK int sst_image_encode_jpeg_as(const struct sst_image *img, int quality, enum sst_jpeg_chroma chroma,
                                            uint8_t **data, size_t *size);

/** 8-bit PNG with samples as values: grey, or palette indices (the palette is ignored). */
SST_MUST_CHECK int sst_map_u8_read_png(struct sst_map_u8 *map, const char *path);

/** Grey 8-bit PNG, or an indexed one if palette (256 RGB triples) is not NULL; the samples are the values in both
 *  cases. */
SST_MUST_CHECK int sst_map_u8_write_png(const struct sst_map_u8 *map, const char *path, const uint8_t (*palette)[3]);

/** Grey 16-bit PNG. */
SST_MUST_CHECK int sst_map_u16_read_png(struct sst_map_u16 *map, const char *path);
SST_MUST_CHECK int sst_map_u16_write_png(const struct sst_map_u16 *map, const char *path);

/**
 * One-channel PFM ("Pf") of either byte order, rows stored bottom up. Infinite values are kept (the usual mark of
 * unknown disparity); NaN is rejected with its position.
 */
SST_MUST_CHECK int sst_map_f32_read_pfm(struct sst_map_f32 *map, const char *path);
SST_MUST_CHECK int sst_map_f32_write_pfm(const struct sst_map_f32 *map, const char *path);

/** NumPy .npy version 1.0, little-endian float32, C order, shape dims[0..n_dims). n_dims at most 4. */
SST_MUST_CHECK int sst_npy_write_f32(const float *data, const size_t *dims, int n_dims, const char *path);

#endif
