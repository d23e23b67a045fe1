/* daemon/recording/recorder.h - raw sets on disk: camera bytes untouched in segmented Matroska, with a manifest. */
#ifndef SST_DAEMON_RECORDING_RECORDER_H
#define SST_DAEMON_RECORDING_RECORDER_H

#include "daemon/capture/sets.h"

SST_EXTERN_C_BEGIN

struct sst_recorder; /* opaque; one thread at a time */

struct sst_recorder_track {
    int row, col;
    char serial[64], port[64], name[64];
};

struct sst_recorder_config {
    const char *dir; /* made if missing; a recording that is there is refused unless `append` */
    bool append;
    int rows, cols, cameras;
    const struct sst_recorder_track *tracks; /* [cameras] */
    uint32_t fourcc;
    int width, height;
    double rate_hz;     /* nominal; 0 unknown */
    double spacing_mm;  /* 0 unknown */
    double segment_s;   /* a new file after this long ... */
    int64_t segment_bytes; /* ... or this much; 0: defaults */
    double sync_s;      /* longest time between syncs: what a power cut may cost. 0: every set */
};

void sst_recorder_config_defaults(struct sst_recorder_config *cfg);

/** @return 0, -EEXIST, -ENOSPC, -EROFS, -EACCES, -ENOSYS (built without libavformat); logged. */
SST_MUST_CHECK int sst_recorder_open(struct sst_recorder **out, const struct sst_recorder_config *cfg);

/**
 * Append a set: its frames' bytes to the segment, then its line to the manifest. The set's frames stay the caller's.
 *
 * After an error nothing of the set is in the manifest; the recorder stays usable and starts a new segment with the next
 * set that can be written (disk full, read-only: told once per change of state).
 * @return 0, -ENOSPC, -EROFS, -EIO
 */
SST_MUST_CHECK int sst_recorder_write(struct sst_recorder *recorder, const struct sst_set *set);

/** Finish the segment and the manifest. @return 0 or the error that closing met. NULL is fine. */
int sst_recorder_close(struct sst_recorder *recorder);

SST_EXTERN_C_END

#endif
