/* pipeline/video/h264.h - H.264 encoder of moving pictures for viewers: each picture is one access unit at once, none is
 * predicted from a later one. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_VIDEO_H264_H
#define SST_PIPELINE_VIDEO_H264_H

#include <stdbool.h>

#include "base/base.h"

struct sst_h264; /* opaque; one thread at a time */

struct sst_h264_config {
    int width, height;     /* even, at least 32 */
    int bytes_per_picture; /* on average, at most; more only while bytes of pictures before are left over */
    bool full_range;       /* levels 0 to 255, as of JPEG; else 16 to 235 */
};

/** Samples of 4:2:0 with the matrix of BT.601, as of JPEG. */
struct sst_h264_picture {
    const uint8_t *plane[3]; /* Y, Cb, Cr */
    size_t stride[3];
    bool key; /* it must be decodable without any before it */
};

/** Access unit of one picture: Annex B; before a key picture the parameter sets. */
struct sst_h264_unit {
    const uint8_t *data; /* valid until the next call */
    size_t bytes;
    bool key;
    char codec[16]; /* RFC 6381, of the last parameter set: "avc1.42c01f" */
};

/**
 * Open the first encoder that works: VAAPI, V4L2, libx264, OpenH264, by FFmpeg; loads libsst-video.so.
 * @param why  out, cause of a failure
 * @return 0, -ENOTSUP (none: not this size, or not on this machine), -ENOMEM. Thread: any
 */
SST_MUST_CHECK int sst_h264_open(struct sst_h264 **out, const struct sst_h264_config *cfg, char why[256]);

/** FFmpeg's name of the encoder. */
const char *sst_h264_name(const struct sst_h264 *h);

/** @return 0, or -EIO, -ENOMEM: `why` is set, close it; the next open skips a device that failed */
SST_MUST_CHECK int sst_h264_encode(struct sst_h264 *h, const struct sst_h264_picture *picture,
                                   struct sst_h264_unit *out, char why[256]);

void sst_h264_close(struct sst_h264 *h); /* NULL is fine */

/** Functions of libsst-video.so, which calls none of the program. */
struct sst_h264_part {
    int (*open)(struct sst_h264 **out, const struct sst_h264_config *cfg, char why[256]);
    const char *(*name)(const struct sst_h264 *h);
    int (*encode)(struct sst_h264 *h, const struct sst_h264_picture *picture, struct sst_h264_unit *out, char why[256]);
    void (*close)(struct sst_h264 *h);
};

#endif
