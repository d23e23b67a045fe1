/* pipeline/image/jpeg_means.h - block means of a JPEG frame, read without decoding the coefficients, and frames cut to
 * a part of it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_JPEG_MEANS_H
#define SST_PIPELINE_IMAGE_JPEG_MEANS_H

#include <stdbool.h>
#include <stdint.h>
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

/** State before an MCU (a group of blocks of all components): the end of the MCU before it and its own first bit, in
 * the data without markers and stuffed bytes; the last means, not yet scaled. */
struct sst_jpeg_mcu {
    uint32_t end, at;
    int16_t last[3];
};

/** Where the MCUs of one frame lie in its data; caller's memory. */
struct sst_jpeg_index {
    size_t room;              /* of mcu */
    struct sst_jpeg_mcu *mcu; /* [mcus_x * mcus_y + 1] */
    /* by sst_jpeg_means_read() */
    bool valid; /* false: the frame is damaged, or has more MCUs than there is room for */
    int mcus_x, mcus_y, mcu_width, mcu_height;
    unsigned interval; /* MCUs between restarts; 0: none */
    bool tall;         /* chroma rows are between luma rows: rows of MCUs depend on the ones beside them */
};

/**
 * Means of all blocks, in 1/8 levels (0 .. 2047).
 *
 * @param m       may have read other frames before
 * @param header  after jpeg_read_header() from memory; not read further
 * @param out     [components][height_in_blocks * width_in_blocks] of comp_info
 * @param index   out, or NULL
 * @return 0, -ENOTSUP (neither baseline nor extended sequential Huffman code of 8 bits in one scan of 1 or 3
 *         components), -EBADMSG (damaged or truncated), -ENOMEM; not logged, out may be partly written
 */
SST_MUST_CHECK int sst_jpeg_means_read(struct sst_jpeg_means *m, const struct jpeg_decompress_struct *header,
                                       int16_t *const out[3], struct sst_jpeg_index *index);

/** A part of a frame: MCUs x0 .. x1-1, y0 .. y1-1. */
struct sst_jpeg_part {
    int x0, y0, x1, y1;
};

/** A JPEG frame: its first byte, its header as for sst_jpeg_means_read(), and its valid index. */
struct sst_jpeg_frame {
    const uint8_t *data;
    const struct jpeg_decompress_struct *header;
    struct sst_jpeg_index *index;
};

/**
 * Make a JPEG frame of a part of another one, without decoding: its blocks have the same coefficients. Comments and
 * application segments, in which a small picture of the whole can be, are left out.
 *
 * @param out     out, frame; valid until the next call
 * @return 0, -ENOTSUP (the frame's code has no word for a mean, or its header is unusual), -EBADMSG, -ENOMEM; not
 * logged
 */
SST_MUST_CHECK int sst_jpeg_cut(struct sst_jpeg_means *m, const struct sst_jpeg_frame *frame,
                                const struct sst_jpeg_part *part, const uint8_t **out, size_t *bytes);

#endif
