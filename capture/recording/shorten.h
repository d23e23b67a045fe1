/* capture/recording/shorten.h - take the oldest segments of a recording away, and say so beside the rest.
 *
 * removed.json in a recording's folder says up to which segment its beginning was removed on purpose; lines of
 * sets.jsonl that name older segments stay and are passed over. Segments that are gone without it are damage. */
#ifndef SST_CAPTURE_RECORDING_SHORTEN_H
#define SST_CAPTURE_RECORDING_SHORTEN_H

#include <stdbool.h>

#include "base/base.h"

struct sst_recording_removed {
    int before_segment;    /* segments below it were removed; 0: none */
    uint64_t sets;         /* that were in them */
    int64_t t_ns, wall_ns; /* where the rest begins: start of its first segment (CLOCK_MONOTONIC), and UTC */
    bool assumed;          /* removed.json is damaged: what was before the first segment that is there */
};

/**
 * What was removed of a recording. A removed.json that is damaged is no reason not to have the rest: what it said is
 * worked out from the files that are there, and a warning says so.
 * @param out  zeros: nothing @return 0, -EACCES, -ENOMEM, -ENAMETOOLONG; logged
 */
SST_MUST_CHECK int sst_recording_read_removed(const char *dir, struct sst_recording_removed *out);

/** Write removed.json, whole: one that was damaged, say. @return 0 or an error of the output; logged */
SST_MUST_CHECK int sst_recording_write_removed(const char *dir, const struct sst_recording_removed *removed);

/** Segments that are there. @return their number; 0 also where they cannot be read */
int sst_recording_segments(const char *dir);

/**
 * Remove the oldest segment of a recording, which may be being written: removed.json says so first, so that a process
 * that is killed in between leaves nothing that looks damaged (on a disk without any room left it comes second).
 *
 * @param keep   segments that are to stay at least; 1 or more, of one that is being written 2
 * @param out    what is removed of the recording now, in all
 * @param bytes  out, that are free now, in whole blocks of 4 KiB
 * @return 0, -ENODATA (it has no more than those), -EBADMSG (its list names no set behind), -ENOSPC, -EROFS, -EIO,
 *         -ENOMEM; logged, but for -ENODATA. Thread: any, one at a time for a recording; waits for the disk.
 */
SST_MUST_CHECK int sst_recording_shorten(const char *dir, int keep, struct sst_recording_removed *out, int64_t *bytes);

#endif
