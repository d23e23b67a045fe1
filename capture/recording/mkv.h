/* capture/recording/mkv.h - Matroska files with one video track of untouched frames; the index comes first. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_RECORDING_MKV_H
#define SST_CAPTURE_RECORDING_MKV_H

#include "base/base.h"

struct sst_mkv_frame {
    int64_t t_ns;   /* any clock; not before the previous frame's, less than INT64_MAX / 4 from zero */
    int64_t offset; /* of its bytes in `file`; both are for the caller's read function */
    uint32_t bytes;
    int file;
};

struct sst_mkv_config {
    const char *title, *track; /* names of the file and of the track */
    uint32_t fourcc;           /* V4L2 */
    int width, height;
    double rate_hz;  /* nominal; 0: unknown */
    int64_t wall_ns; /* of the first frame; 0: unknown */
};

/** Reads the bytes of frame i into data [frame[i].bytes]. @return 0, or a negative errno that ends the writing */
typedef int sst_mkv_read_fn(void *arg, size_t i, uint8_t *data);

/** Frames of a file, count > 0. */
struct sst_mkv_frames {
    const struct sst_mkv_frame *frame;
    size_t count;
    sst_mkv_read_fn *read;
    void *arg;
};

/**
 * Write the file: header with duration and seek index, then the frames, a new cluster each second. The
 * same arguments give the same bytes.
 *
 * @param fd  an empty file that can be reopened through /proc/self/fd; stays the caller's
 * @return 0, the error of read, -ENOTSUP (built without libavformat), -ENOMEM, -EINVAL (libavformat refuses the track)
 *         or -errno of writing; not logged.
 */
SST_MUST_CHECK int sst_mkv_write(int fd, const struct sst_mkv_config *cfg, const struct sst_mkv_frames *frames);

#endif
