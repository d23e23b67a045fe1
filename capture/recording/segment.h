/* capture/recording/segment.h - one Matroska file of a recording, being written. Inside capture/recording only. */
#ifndef SST_CAPTURE_RECORDING_SEGMENT_H
#define SST_CAPTURE_RECORDING_SEGMENT_H

#include "capture/recording/recorder.h"

struct sst_segment; /* opaque; one thread at a time */

/** Largest frame, bytes: what fits one block with room to spare. */
#define SST_SEGMENT_FRAME_MAX ((size_t)1 << 30)

/**
 * Create the file and write its head.
 *
 * @param path      must not exist
 * @param start_ns  time stamp 0 of the file
 * @return 0, -errno of the system, -ENOTSUP (built without libavformat), -EINVAL (libavformat refuses the tracks;
 *         logged). Other errors are not logged; nothing is left of the file.
 */
SST_MUST_CHECK int sst_segment_open(struct sst_segment **out, const char *path, const struct sst_recorder_config *cfg,
                                    int64_t start_ns);

/**
 * Append the set's frames; all bytes are with the kernel afterwards. Empty frames are left out.
 *
 * Time stamps in the file are whole milliseconds, never backwards, at most 1 s from the set's.
 * @param offset  out, of each present frame's first byte in the file; -1 of others
 * @return 0 or -errno (not logged); after an error only sst_segment_abandon() may follow.
 */
SST_MUST_CHECK int sst_segment_add(struct sst_segment *segment, const struct sst_set *set,
                                   int64_t offset[SST_CAMERAS_MAX]);

/** What was added so far stays, whatever comes. */
void sst_segment_keep(struct sst_segment *segment);

int64_t sst_segment_bytes(const struct sst_segment *segment);
int sst_segment_fd(const struct sst_segment *segment);

/** Write cues, duration and size, and free. @param sync  make it durable as well
 *  @return 0 or -errno (not logged): the file then is cut behind the last set and readable. */
SST_MUST_CHECK int sst_segment_finish(struct sst_segment *segment, bool sync);

/** Cut the file behind the last set that was kept (remove it if there is none), and free. NULL is fine. */
void sst_segment_abandon(struct sst_segment *segment);

#endif
