/* pipeline/image/jpeg_parts.h - a camera's JPEG reduced to its difference from an earlier one, the base: blocks of DCT
 * coefficients that are alike are emptied, the others stay bit by bit. Joined with the base it is a whole picture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_JPEG_PARTS_H
#define SST_PIPELINE_IMAGE_JPEG_PARTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/base.h"

/** Bytes of a JPEG; borrowed. */
struct sst_jpeg_bytes {
    const uint8_t *data;
    size_t bytes;
};

/** A picture and its base; ones of another size are refused before memory is taken for them. */
struct sst_jpeg_pair {
    struct sst_jpeg_bytes base, other;
    int width, height;
};

/**
 * Cut the parts of a picture that differ from its base.
 *
 * @param base_ns  a name for the base, kept in the parts: a time
 * @param out      to free with free(); a JPEG of the same size, of which grey areas are as in the base
 * @param share    of the picture that differs, 0..1; may be NULL
 * @return 0, -EINVAL (one is no baseline JPEG, or they differ in size, sampling or tables), -ENOMEM; not logged
 */
SST_MUST_CHECK int sst_jpeg_parts_cut(const struct sst_jpeg_pair *pair, int64_t base_ns, uint8_t **out, size_t *bytes,
                                      double *share);

/** @return whether a JPEG has parts alone, and of which base */
bool sst_jpeg_parts_base(struct sst_jpeg_bytes jpeg, int64_t *base_ns);

/** Join parts with their base, the inverse of sst_jpeg_parts_cut(). @return as that, -EINVAL also: not parts */
SST_MUST_CHECK int sst_jpeg_parts_join(const struct sst_jpeg_pair *pair, uint8_t **out, size_t *bytes);

#endif
