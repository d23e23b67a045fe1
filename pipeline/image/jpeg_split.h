/* pipeline/image/jpeg_split.h - a JPEG that shows several cameras side by side, cut into one JPEG for each without
 * decoding: the blocks of DCT coefficients stay bit by bit. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_JPEG_SPLIT_H
#define SST_PIPELINE_IMAGE_JPEG_SPLIT_H

#include <stddef.h>
#include <stdint.h>

#include "base/base.h"
#include "pipeline/image/jpeg_parts.h"

struct sst_jpeg_split; /* opaque; one thread at a time */

/** A picture of rows x cols cameras, each of width x height. */
struct sst_jpeg_grid {
    int rows, cols, width, height;
};

/** @return 0, -ENOMEM */
SST_MUST_CHECK int sst_jpeg_split_create(struct sst_jpeg_split **out);
void sst_jpeg_split_destroy(struct sst_jpeg_split *split);

/**
 * Find the blocks of a picture: one pass over its code, which is neither decoded nor copied.
 *
 * @param jpeg  borrowed until the next call
 * @param why   out, [size], on -EINVAL: one sentence with the remedy
 * @return 0, -EBADMSG (damaged, or of another size), -EINVAL (cameras do not begin at an edge of blocks, or the code is
 *         progressive or arithmetic), -ENOMEM; not logged
 */
SST_MUST_CHECK int sst_jpeg_split_read(struct sst_jpeg_split *split, struct sst_jpeg_bytes jpeg,
                                       const struct sst_jpeg_grid *grid, char *why, size_t size);

/**
 * Cut the picture of one camera out of the one that was read.
 *
 * @param part  row by row, from 0
 * @param out   valid until the next call
 * @return 0, -EBADMSG, -ENOTSUP (its Huffman code, made for this picture alone, has no word for a mean), -ENOMEM; not
 *         logged
 */
SST_MUST_CHECK int sst_jpeg_split_cut(struct sst_jpeg_split *split, int part, struct sst_jpeg_bytes *out);

#endif
