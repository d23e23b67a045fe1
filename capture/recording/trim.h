/* capture/recording/trim.h - trimming of a recording: its oldest segments are removed.
 *
 * removed.json in a recording's folder states up to which segment its beginning was removed on purpose; lines of
 * sets.jsonl that name older segments stay and are skipped. Other missing segments are damage. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_RECORDING_TRIM_H
#define SST_CAPTURE_RECORDING_TRIM_H

#include <stdbool.h>

#include "base/base.h"

struct sst_recording_removed {
    int before_segment;    /* segments below it were removed; 0: none */
    uint64_t sets;         /* that were in them */
    int64_t t_ns, wall_ns; /* start of the first remaining segment, CLOCK_MONOTONIC and UTC */
    bool assumed;          /* removed.json is damaged: derived from the first segment present */
};

/**
 * Read the record of a recording's removed beginning. If removed.json is damaged, its content is derived from the files
 * present, with a warning.
 * @param out  zeros: nothing @return 0, -EACCES, -ENOMEM, -ENAMETOOLONG; logged
 */
SST_MUST_CHECK int sst_recording_read_removed(const char *dir, struct sst_recording_removed *out);

/** Write removed.json, for one that was damaged. @return 0 or an error of the output; logged */
SST_MUST_CHECK int sst_recording_write_removed(const char *dir, const struct sst_recording_removed *removed);

/** Count the segments present. @return 0 also if they cannot be read */
int sst_recording_segments(const char *dir);

/**
 * Remove the oldest segment of a recording, which may be active. removed.json is written first, so that a kill
 * in between leaves no apparent damage (on a full disk it is written second).
 *
 * @param keep   minimum number of segments to keep: 1; 2 for an active recording
 * @param out    everything removed from the recording so far
 * @param bytes  out, freed, in whole blocks of 4 KiB
 * @return 0, -ENODATA (no segment beyond `keep`), -EBADMSG (its manifest names no set after it), -ENOSPC, -EROFS,
 * -EIO, -ENOMEM; logged, but for -ENODATA. Thread: any, one at a time for a recording; waits for the disk.
 */
SST_MUST_CHECK int sst_recording_trim(const char *dir, int keep, struct sst_recording_removed *out, int64_t *bytes);

#endif
