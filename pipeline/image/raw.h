/* pipeline/image/raw.h - conversion of uncompressed camera frames to images. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_RAW_H
#define SST_PIPELINE_IMAGE_RAW_H

#include <stdbool.h>

#include "pipeline/image/image.h"

/** A frame as V4L2 describes it: uncompressed, unless a function says that it may be a JPEG. */
struct sst_raw {
    uint32_t fourcc; /* V4L2: GREY, Y16, YUYV, RGB3, BA81, GBRG, GRBG, RGGB; MJPG, JPEG */
    int width, height;
    size_t stride; /* bytes; 0: rows without padding */
    const uint8_t *data;
    size_t bytes;
};

/**
 * Write a frame as PNG: GREY and Y16 unchanged (8 and 16 bits), YUYV, RGB and Bayer as converted by sst_raw_to_image().
 * @return 0, -EINVAL (format), -EBADMSG (fewer bytes than the size needs; an odd width of YUYV), or a writer's error;
 * logged.
 */
SST_MUST_CHECK int sst_raw_write_png(const struct sst_raw *raw, const char *path);

/**
 * RGB of a frame; Y16 uses the high byte.
 *
 * YUYV: BT.601, limited range, V4L2's default for cameras; chroma is sampled on even columns, odd columns use the mean
 * of both neighbours. The conversion rounds, so it is not exactly invertible. Bayer: Malvar, He, Cutler, High-quality
 * linear interpolation for demosaicing of Bayer-patterned color images, ICASSP 2004; the frame is mirrored at its
 * edges. Recorded samples stay as they are.
 * @param img  out, initialised here
 * @return 0, -EINVAL, -EBADMSG, -ENOMEM; not logged.
 */
SST_MUST_CHECK int sst_raw_to_image(struct sst_image *img, const struct sst_raw *raw);

/** Convert a frame that may be a JPEG, which must have the frame's size; Y16 by the stretch that shows it. @return as sst_raw_to_image(); not logged */
SST_MUST_CHECK int sst_raw_decode(struct sst_image *img, const struct sst_raw *raw);

struct sst_sample_counts;

/** Add the samples of a Y16 frame. @return 1, 0 (another format: nothing is added), -EBADMSG; not logged */
SST_MUST_CHECK int sst_raw_count_samples(struct sst_sample_counts *counts, const struct sst_raw *raw);

/** sst_raw_to_image() with the samples of Y16 scaled as by sst_image_decode_samples(). @return as that */
SST_MUST_CHECK int sst_raw_to_image_samples(struct sst_image *img, const struct sst_raw *raw,
                                            struct sst_samples samples);

/**
 * Follow the stretch of Y16 frames from set to set: one for all frames, kept while it shows them well, {0, 0} where they
 * span half of 16 bits or more, as usual pictures do. Other formats leave it alone.
 *
 * @param stretch  in and out; white below 0: none yet
 * @return whether it changed
 */
bool sst_raw_follow(struct sst_samples *stretch, const struct sst_raw *frame, int count);

/** Sample of a row of Y16. */
static inline int sst_raw_y16(const uint8_t *row, int x)
{
    return row[2 * x] | row[2 * x + 1] << 8;
}

/** Is a format JPEG, one picture per frame? */
bool sst_raw_is_jpeg(uint32_t fourcc);

/**
 * sst_raw_to_image() for a part, with the same bytes as the conversion of the whole
 * frame; the rest of the picture is unchanged.
 * @param img  initialised by the caller to the frame's size; contains the part
 * @return 0, -EINVAL, -EBADMSG (as sst_raw_to_image(), or img has another size); not logged
 */
SST_MUST_CHECK int sst_raw_part(struct sst_image *img, const struct sst_raw *raw, struct sst_rect part);

/** Position of the red sample in each 2x2 cell of a Bayer format. @return false: not a Bayer format */
bool sst_raw_red(uint32_t fourcc, int *x, int *y);

#endif
