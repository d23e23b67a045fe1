/* pipeline/image/jpeg_means.h - block means of a JPEG frame, read without decoding the coefficients. */
#ifndef SST_PIPELINE_IMAGE_JPEG_MEANS_H
#define SST_PIPELINE_IMAGE_JPEG_MEANS_H

#include <stdio.h>

#include <jpeglib.h>

#include "base/base.h"

/*
 * A block of 8x8 samples begins with its mean; the rest of its code is skipped, several symbols at a time. The means
 * are enough to detect changes between frames, in a fraction of the decoding time. libjpeg reads the headers.
 */
struct sst_jpeg_means; /* tables of the last frame's codes; one thread at a time */

/** @return 0, -ENOMEM */
SST_MUST_CHECK int sst_jpeg_means_create(struct sst_jpeg_means **out);
void sst_jpeg_means_destroy(struct sst_jpeg_means *m);

/**
 * Means of all blocks, in 1/8 levels (0 .. 2047).
 *
 * @param m       may have read other frames before
 * @param header  after jpeg_read_header() from memory; not read further
 * @param out     [components][height_in_blocks * width_in_blocks] of comp_info
 * @return 0, -ENOTSUP (neither baseline nor extended sequential Huffman code of 8 bits in one scan of 1 or 3
 *         components), -EBADMSG (damaged or truncated), -ENOMEM; not logged, out may be partly written
 */
SST_MUST_CHECK int sst_jpeg_means_read(struct sst_jpeg_means *m, const struct jpeg_decompress_struct *header,
                                       int16_t *const out[3]);

#endif
