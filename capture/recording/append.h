/* capture/recording/append.h - bring a recording into a state that more sets can follow. Only for capture/recording. */
#ifndef SST_CAPTURE_RECORDING_APPEND_H
#define SST_CAPTURE_RECORDING_APPEND_H

#include "capture/recording/recorder.h"

struct sst_append {
    int64_t manifest_bytes; /* where the next line goes */
    int segment, session;   /* the next ones */
};

/**
 * Cut off what a killed recorder or a power cut left half-written: sets at the end whose bytes are not all there, torn
 * lines, segments that no line names. Sets before those stay as they are.
 *
 * @param manifest_fd  of sets.jsonl, writable; the recording is locked
 * @return 0, -EEXIST (made with another array, format or size), -EBADMSG, -EIO, -ENOSPC (no number left), -ENOMEM.
 *         Logged.
 */
SST_MUST_CHECK int sst_append_prepare(struct sst_append *out, const struct sst_recorder_config *cfg, int manifest_fd);

#endif
