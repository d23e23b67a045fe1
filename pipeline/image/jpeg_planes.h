/* pipeline/image/jpeg_planes.h - a JPEG decoded as far as its samples: luma and chroma as they are stored, before
 * chroma is enlarged and colours are made. A device does the rest (pipeline/kernels/jpeg_rgb.comp). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_JPEG_PLANES_H
#define SST_PIPELINE_IMAGE_JPEG_PLANES_H

#include <stddef.h>
#include <stdint.h>

#include "base/base.h"

/** Where the samples lie: planes of Y, Cb and Cr, or of Y alone. */
struct sst_jpeg_planes {
    int width, height;               /* of the picture */
    int count;                       /* 3, or 1: grey */
    int across, down;                /* pixels for one sample of chroma: 1 x 1, 2 x 1, 2 x 2 */
    int chroma_width, chroma_height; /* samples that count; the planes have some more at the right and below */
    size_t at[3], stride[3], bytes;  /* of the planes from the first byte on, of their rows, of all; multiples of 8 */
};

/**
 * Read the layout from a file's header.
 * @return 0, -ENOTSUP (other samplings or colours, or less than 3 columns of chroma: not logged), -EBADMSG, -ENOMEM
 * (logged)
 */
SST_MUST_CHECK int sst_jpeg_planes_read(struct sst_jpeg_planes *out, const uint8_t *data, size_t size,
                                        const char *name);

/**
 * Decode to the planes of a layout that sst_jpeg_planes_read() made from the same file.
 * @param to  [bytes] written once and not read: may be mapped memory of a device; undefined on failure
 * @return 0, -EBADMSG, -ENOMEM; logged
 */
SST_MUST_CHECK int sst_jpeg_planes_decode(uint8_t *to, const struct sst_jpeg_planes *layout, const uint8_t *data,
                                          size_t size, const char *name);

#endif
