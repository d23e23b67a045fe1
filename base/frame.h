/* base/frame.h - one camera frame as delivered by the driver, with time stamps and faults. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_FRAME_H
#define SST_BASE_FRAME_H

#include "base/base.h"

#define SST_CAMERAS_MAX 256

/** Faults of a frame; bits. A frame with none of the bits of SST_FRAME_BAD is good. */
enum sst_frame_fault {
    SST_FRAME_FLAGGED = 1 << 0,   /* the driver set V4L2_BUF_FLAG_ERROR */
    SST_FRAME_EMPTY = 1 << 1,     /* no bytes */
    SST_FRAME_SHORT = 1 << 2,     /* fewer bytes than width, height and format need */
    SST_FRAME_NO_SOI = 1 << 3,    /* JPEG: does not start with a start-of-image marker */
    SST_FRAME_NO_EOI = 1 << 4,    /* JPEG: ends early */
    SST_FRAME_MARKER = 1 << 5,    /* JPEG: broken marker structure, another size than negotiated, or fields */
    SST_FRAME_BACKWARDS = 1 << 6, /* time stamp not after the frame before, later than its arrival, or too old */
    SST_FRAME_BAD = (1 << 7) - 1,
    SST_FRAME_FROZEN = 1 << 7, /* same bytes as the frame before: still delivered */
    SST_FRAME_PARTS = 1 << 8,  /* in a recording: differences from an earlier frame (pipeline/image/jpeg_parts.h) */
    SST_FRAME_ARRIVAL = 1 << 9,    /* t_ns is the time of arrival: the driver's stamp is of no use */
    SST_FRAME_UNFIT = 1 << 10,     /* with MARKER: a JPEG of another size than negotiated, or fields of a picture */
};

/**
 * A frame, borrowed from its driver's pool until released there; nothing is copied.
 * Times are ns on CLOCK_MONOTONIC.
 */
struct sst_frame {
    int cam;           /* index among the configured cameras */
    uint32_t fourcc;   /* V4L2 pixel format */
    int width, height; /* px */
    size_t stride;     /* bytes; 0 for compressed formats */
    const uint8_t *data;
    size_t bytes;
    size_t row_bytes;     /* of a view of a wider picture: bytes of a row that are its own, `bytes` ends with its last
                             row; 0: all bytes are the frame's */
    uint32_t sequence;    /* of the driver */
    uint32_t lost_before; /* frames lost just before this one, by a gap in the sequence */
    int64_t t_ns;         /* start of exposure, by the driver; with ARRIVAL the time of arrival */
    int64_t arrival_ns;   /* when it was dequeued */
    unsigned faults;      /* sst_frame_fault */
    void *pool;           /* private to the driver */
};

/** Bytes of a frame's own picture. */
size_t sst_frame_packed_bytes(const struct sst_frame *f);

/** Copy a frame's picture, of a view its own bytes of each row alone. @param to  out: the frame with that picture
 *  @param at  out, [sst_frame_packed_bytes()] @return bytes that were written */
size_t sst_frame_pack(struct sst_frame *to, uint8_t *at, const struct sst_frame *from);

#endif
