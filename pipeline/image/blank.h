/* pipeline/image/blank.h - black blocks in a camera's frame: samples of a raw frame, coefficients of a JPEG. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_BLANK_H
#define SST_PIPELINE_IMAGE_BLANK_H

#include <stdbool.h>

#include "pipeline/image/raw.h"

#define SST_BLANK_SIDE 8 /* px: width and height of a block */

/** Blocks of a frame, row by row; the last of a row and of a column may lie beyond the picture. */
struct sst_blank_blocks {
    int cols, rows;
    const uint8_t *black; /* [rows * cols], 1: black; borrowed */
};

/** Scratch memory of one camera. One thread at a time. */
struct sst_blank;

/** @return 0, -ENOMEM */
SST_MUST_CHECK int sst_blank_create(struct sst_blank **out);
void sst_blank_destroy(struct sst_blank *blank); /* NULL is fine */

/** Is the format known? Frames of others are refused. */
bool sst_blank_format(uint32_t fourcc);

/**
 * A frame with black blocks, of the same format and size, in the object's memory until its next call.
 *
 * Of a JPEG the coefficients of the other blocks stay bit by bit: nothing is decoded to samples and encoded again. Where
 * blocks of a component are larger than SST_BLANK_SIDE, the larger one is black. Comments and application segments, in
 * which a small picture can be, are left out, as are bytes behind the picture's end. A damaged JPEG is refused: pixels behind
 * the damage can lie in other blocks than they were exposed in. A progressive one becomes sequential.
 *
 * @param out  frame; data and bytes (and stride of a raw frame) differ from raw's
 * @return 0, -EINVAL (format, number of blocks), -EBADMSG (damaged, another size than raw's), -ENOTSUP (a JPEG of
 * arithmetic code or with four colours), -ENOMEM; not logged; out untouched then
 */
SST_MUST_CHECK int sst_blank_frame(struct sst_blank *blank, const struct sst_raw *raw,
                                   const struct sst_blank_blocks *blocks, struct sst_raw *out);

#endif
