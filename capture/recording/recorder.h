/* capture/recording/recorder.h - recorder of raw sets: camera bytes untouched in Matroska segments, with a manifest. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_RECORDING_RECORDER_H
#define SST_CAPTURE_RECORDING_RECORDER_H

#include "capture/array/frame_sync.h"

/** Can frames of this V4L2 format be recorded? MJPG, JPEG, YUYV, GREY, Y16, RGB24 and 8-bit Bayer are. */
bool sst_recording_format_known(uint32_t fourcc);

/** "MJPG", "Y16" ... (without trailing blanks; '?' for unprintable bytes), and the inverse; 0: not 1 to 4 letters. */
void sst_recording_format_name(uint32_t fourcc, char out[5]);
uint32_t sst_recording_format_parse(const char *name);

struct sst_recorder; /* opaque; one thread at a time */

struct sst_recorder_track {
    int row, col;
    char serial[64], port[64], name[64];
};

struct sst_recorder_config {
    const char *dir; /* created if missing; an existing recording is refused unless `append` */
    bool append;
    int rows, cols, cameras;
    const struct sst_recorder_track *tracks; /* [cameras] */
    uint32_t fourcc;
    int width, height;
    double rate_hz;        /* nominal; 0 unknown */
    double spacing_mm;     /* 0 unknown */
    double segment_s;      /* a new file after this long ... */
    int64_t segment_bytes; /* ... or this much; 0: defaults */
    double sync_s;         /* longest time between syncs, which a power cut may lose; 0: every set */
};

/** Segments of 60 s or 1 GiB, a sync every second; everything else is 0. */
void sst_recorder_config_defaults(struct sst_recorder_config *cfg);

/**
 * Create a recording or resume one. Resuming removes half-written output of a killed recorder; grid, cameras, format
 * and size must equal the recording's.
 *
 * @param cfg  copied
 * @return 0, -EINVAL (cfg), -EEXIST (a recording exists, or does not match), -EBUSY (another process records
 *         there), -EBADMSG (the recording is damaged), -ENOSPC, -EROFS, -EIO, -ENOMEM, -ENOTSUP (built without
 *         libavformat); logged.
 */
SST_MUST_CHECK int sst_recorder_open(struct sst_recorder **out, const struct sst_recorder_config *cfg);

/**
 * Append a set: its frames' bytes to the segment, then its line to the manifest. The set's frames stay the caller's.
 *
 * After an error nothing of the set is in the manifest; the recorder stays usable and starts a new segment with the
 * next set that can be written (disk full, read-only: reported once per change of state; retried twice a second).
 * Allocates no memory; libavformat's gathering buffer grows to the largest cluster. With sync_s above 0 it does not
 * wait for the disk, except where the kernel makes writers wait.
 * @param set  of cfg's number of cameras; frames of cfg's format
 * @return 0, -EINVAL (set; logged), -ENOSPC (also quota and largest file), -EROFS, -EIO, -ENOMEM
 */
SST_MUST_CHECK int sst_recorder_write(struct sst_recorder *recorder, const struct sst_frameset *set);

/** Set the largest segment, from the next set on; 0: the default. */
void sst_recorder_set_segment_bytes(struct sst_recorder *recorder, int64_t bytes);

/** Finish the segment and sync everything; waits for the disk. @return 0 or the error of closing (logged). NULL is
 * fine. */
int sst_recorder_close(struct sst_recorder *recorder);

#endif
