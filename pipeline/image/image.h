/* pipeline/image/image.h - planar images and maps in memory. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_IMAGE_H
#define SST_PIPELINE_IMAGE_IMAGE_H

#include <stdbool.h>

#include "base/base.h"

/* Limits of all images; both fit int, and their product fits size_t with a margin. */
#define SST_IMAGE_MAX_SIDE   32768
#define SST_IMAGE_MAX_PIXELS ((size_t)1 << 28)

/** 8-bit sRGB, three planes R, G, B in one allocation. Rows are aligned to 64 bytes; stride is in bytes. */
struct sst_image {
    int width, height;
    size_t stride;
    uint8_t *plane[3];
};

/** One uint8_t per pixel: labels (0 = unlabeled), masks (0 or 255), confidence (0..255 means 0..1). */
struct sst_map_u8 {
    int width, height;
    size_t stride;
    uint8_t *data;
};

/** Samples of 16-bit pictures that become levels 0 and 255 when they are read; white 0: 0 and 65535. */
struct sst_samples {
    int black, white;
};

/** One uint16_t per pixel: disparity in 1/64 px above the light field's disp_min_px. */
struct sst_map_u16 {
    int width, height;
    size_t stride;
    uint16_t *data;
};

/** One float per pixel. */
struct sst_map_f32 {
    int width, height;
    size_t stride;
    float *data;
};

/**
 * Zeroed pixels; free with the matching fini, which accepts a zeroed object.
 *
 * @return 0, -EINVAL (side below 1 or above SST_IMAGE_MAX_SIDE, or too many pixels), -ENOMEM. Not logged.
 */
SST_MUST_CHECK int sst_image_init(struct sst_image *img, int width, int height);
SST_MUST_CHECK int sst_map_u8_init(struct sst_map_u8 *map, int width, int height);
SST_MUST_CHECK int sst_map_u16_init(struct sst_map_u16 *map, int width, int height);
SST_MUST_CHECK int sst_map_f32_init(struct sst_map_f32 *map, int width, int height);

/** Write the pixels as R, G, B and 255. @param rgbx  rows `stride` bytes apart; not read */
void sst_image_put_rgbx(uint8_t *rgbx, size_t stride, const struct sst_image *img);

/**
 * Sensor noise of a picture, levels RMS of green: the mean of |n| over 8x8 pixels, n the response to
 * [1 -2 1; -2 4 -2; 1 -2 1] / 6 (Immerkaer 1996), in the block that 5 % of the blocks are below; of at most 2048 blocks
 * that are neither dark nor bright. Texture that no smooth place interrupts counts as noise. 0: none is measured.
 */
double sst_image_noise(const struct sst_image *img);

/** Standard deviation of the green, levels, of every fourth pixel of every fourth row: next to 0 where nothing is seen.
 */
double sst_image_contrast(const struct sst_image *img);

/** The same of one channel, 0 to 2, of every step-th pixel of every step-th row. */
double sst_image_channel_contrast(const struct sst_image *img, int channel, int step);

/**
 * Width of a picture's sharpest edges, as the sigma of a Gaussian that blurs ideal ones: the best tenth of the steepest
 * tenth of green's gradients, of at most 64 tiles of 32x32 pixels. Drawn scenes and good pictures have 0.25 to 0.35 px,
 * lenses that are less sharp than their sensor 0.6. Noise in a picture hides its blur. Thread: any.
 *
 * @param valid  tiles with unseen pixels do not count; NULL or empty: all are seen
 * @return NAN: too small, too few edges, or no memory
 */
double sst_image_edge_px(const struct sst_image *image, const struct sst_map_u8 *valid);

/**
 * Quality of the JPEG file that these pixels were decoded from, whatever file they came from since: 1..100 in the scale
 * of libjpeg, from the steps of the luma's lowest frequencies. Only while the blocks begin at the picture's corner: not
 * of pictures that were cropped, resampled or denoised. Up to 90; finer steps are hidden by rounding. Thread: any.
 *
 * @return NAN: no traces, or no memory
 */
double sst_image_jpeg_quality(const struct sst_image *image);

void sst_image_fini(struct sst_image *img);
void sst_map_u8_fini(struct sst_map_u8 *map);
void sst_map_u16_fini(struct sst_map_u16 *map);
void sst_map_f32_fini(struct sst_map_f32 *map);

/** Half the size: means of 2x2 pixels, the last odd column or row repeated. @param out  out, initialised here */
SST_MUST_CHECK int sst_image_halve(struct sst_image *out, const struct sst_image *in);

/** The same of a map, but the last odd column or row is left out. A side of 1 stays. */
SST_MUST_CHECK int sst_map_u8_halve(struct sst_map_u8 *out, const struct sst_map_u8 *in);

/** Halve into a part of out, which has half the size. */
void sst_image_halve_part(struct sst_image *out, const struct sst_image *in, struct sst_rect part);

/** Halve in place until it is at most max_width wide. @return 0, or as sst_image_init() with the last size */
SST_MUST_CHECK int sst_image_shrink(struct sst_image *img, int max_width);

/** Luma: 0.299 R + 0.587 G + 0.114 B in 1/256. @param luma  out, initialised here. @return as sst_map_u8_init() */
SST_MUST_CHECK int sst_luma(struct sst_map_u8 *luma, const struct sst_image *img);

/** Luma of a part; luma has the picture's size. */
void sst_luma_part(struct sst_map_u8 *luma, const struct sst_image *img, struct sst_rect part);

static inline uint8_t *sst_image_row(const struct sst_image *img, int channel, int y)
{
    return img->plane[channel] + (size_t)y * img->stride;
}

static inline uint8_t *sst_map_u8_row(const struct sst_map_u8 *map, int y)
{
    return map->data + (size_t)y * map->stride;
}

static inline uint16_t *sst_map_u16_row(const struct sst_map_u16 *map, int y)
{
    return (uint16_t *)(void *)((uint8_t *)map->data + (size_t)y * map->stride);
}

static inline float *sst_map_f32_row(const struct sst_map_f32 *map, int y)
{
    return (float *)(void *)((uint8_t *)map->data + (size_t)y * map->stride);
}

#endif
