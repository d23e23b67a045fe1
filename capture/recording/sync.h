/* capture/recording/sync.h - a thread that makes files durable now and then. Inside capture/recording only. */
#ifndef SST_CAPTURE_RECORDING_SYNC_H
#define SST_CAPTURE_RECORDING_SYNC_H

#include "capture/recording/recorder.h"

/** Make the names in a folder durable. @return 0 or -errno, not logged. */
SST_MUST_CHECK int sst_sync_folder(const char *folder);

struct sst_sync; /* opaque */

/** Start the thread. @param folder  of the segments: synced when a new one is watched. @return 0, -ENOMEM, -errno. */
SST_MUST_CHECK int sst_sync_start(struct sst_sync **out, const char *folder, double every_s);

/**
 * From now on these two files are the ones written to: the segment is synced first, then the manifest. The pair before
 * is synced once more. The descriptors stay the caller's (they are duplicated).
 * @return 0, -errno, -EAGAIN (the disk is so far behind that no more pairs can wait)
 */
SST_MUST_CHECK int sst_sync_watch(struct sst_sync *sync, int segment_fd, int manifest_fd);

/** Can another pair wait? */
bool sst_sync_has_room(struct sst_sync *sync);

/** The error of a sync since the last call, 0: none. Logged by the thread, once per change of state. */
int sst_sync_take_error(struct sst_sync *sync);

/** Add this thread's part to the counters. */
void sst_sync_count(struct sst_sync *sync, struct sst_recorder_counters *counters);

/** Sync once more, end the thread, free. @return 0 or that sync's error. NULL is fine. */
int sst_sync_stop(struct sst_sync *sync);

#endif
