/* daemon/storage/storage.h - storage of recordings (continuous, on event, on demand), snapshots and exports, within
 * limits of space and age. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_STORAGE_STORAGE_H
#define SST_DAEMON_STORAGE_STORAGE_H

#include <jansson.h>

#include "base/jpeg_slot.h"
#include "capture/array/ring.h"
#include "capture/recording/recorder.h"
#include "config/sstd.h"
#include "daemon/events/events.h"
#include "daemon/fields/fields.h"
#include "daemon/storage/download.h"

/* storage.dir:
 *   recordings/2026-11-21T18-05-00Z/   recordings as by sst capture array (docs/integrate/recordings.md): one per
 *                                      hour of continuous recording, per event and per demand
 *   snapshots/, exports/               light fields; names are never chosen by clients */

enum sst_storage_state {
    SST_STORAGE_OK = 0,
    SST_STORAGE_LOW = 1,  /* the oldest recordings are being removed to stay within the limits */
    SST_STORAGE_FULL = 2, /* nothing is recorded: nothing is left to remove, the disk accepts no writes, or FFmpeg is missing */
};

#define SST_STORAGE_NEAR_NS INT64_C(500000000) /* of sst_storage_view_picture() */

struct sst_storage; /* opaque; any thread */

struct sst_storage_config {
    const struct sst_config *config; /* copied */
    struct sst_ring *ring;           /* must outlive the storage */
    struct sst_events *events;       /* must outlive the storage */
    /* [config->array.bound]; copied. With 0 nothing is recorded before sst_storage_cameras(). */
    const struct sst_recorder_track *tracks;
};

/**
 * Create the folders, repair remains of a killed daemon, and start the threads that record and clean up. A disk that
 * cannot be written is a state, not an error: storage retries without limit.
 * @return 0, -EINVAL, -ENOMEM
 */
SST_MUST_CHECK int sst_storage_open(struct sst_storage **out, const struct sst_storage_config *cfg);

/** Set the cameras of later recordings, after the array was opened. @param tracks  [array->bound]; both are copied */
void sst_storage_cameras(struct sst_storage *s, const struct sst_array_config *array,
                         const struct sst_recorder_track *tracks);

/** Apply changed settings of `storage:` and `zones:`, except the folder and the size of the ring. @return 0, -ENOMEM */
SST_MUST_CHECK int sst_storage_configure(struct sst_storage *s, const struct sst_config *config);

/** Pictures of the main view of sets until now go into no recording. */
void sst_storage_forget_views(struct sst_storage *storage);

/** Bytes below the folder that are not the storage's own and count in the quota. */
enum sst_storage_aside {
    SST_STORAGE_ASIDE_VISITS = 0,
    SST_STORAGE_ASIDE_CASES = 1, /* videos for others */
    SST_STORAGE_ASIDES = 2,
};
void sst_storage_aside(struct sst_storage *s, enum sst_storage_aside of, int64_t bytes);

/** Set the see-through view that is recorded beside the sets (storage.record_view); only the first call has effect.
 *  @param slot  of the main view; referenced */
void sst_storage_view(struct sst_storage *s, struct sst_slot *slot);

/** Results of the live pipeline for a set: recording on event follows them. Shares: changed[i] of zone i,
 * changed[zones] of the whole picture. Never blocks. */
struct sst_seen {
    int64_t t_ns;
    int zones;
    double changed[SST_ZONES_MAX + 1];
    double label[SST_TRIGGERS_MAX]; /* share that the label of config->storage.trigger[i] covers in its zone; 1: its visit lasts */
};
void sst_storage_seen(struct sst_storage *s, const struct sst_seen *seen);

/** Reason of -ENOTSUP. */
#if WITH_AVFORMAT
#define SST_STORE_NO_MUXER                                                                                             \
    "recordings and snapshots need FFmpeg's libraries, which Debian's package sst-video brings; install it, and restart sstd"
#else
#define SST_STORE_NO_MUXER "this build has no libavformat, so it makes no recordings and no snapshots; build it with libavformat"
#endif

/** Start or extend a recording on demand, with pre-roll; an active recording continues.
 *  @param seconds  0: until stopped; name: out, [64]
 *  @return 0, -ENODATA (no set arrives), -ENOSPC (FULL), -EROFS, -EBUSY (another service uses the folder), -EIO (last
 *          error of the disk, or it hangs), -ENOTSUP (SST_STORE_NO_MUXER); after an error the request is dropped */
SST_MUST_CHECK int sst_storage_record(struct sst_storage *s, double seconds, char *name);
/** Stop a recording on demand. @return 0, -ENOENT (nothing is being recorded on demand) */
SST_MUST_CHECK int sst_storage_stop(struct sst_storage *s);

/** Store the newest set as a light field (with the calibration, if any) and the given picture (JPEG; NULL: none) under
 * a new name in snapshots/. Returns after 0.8 s even if it is still being made: its event then reports the result, and
 * a download waits for it. @param name  out, [64]
 *  @return 0, -ENODATA (no set yet), -EBUSY (four are being made), -ENOSPC, -EROFS, -EIO, -ENOTSUP (SST_STORE_NO_MUXER); reported by an event */
SST_MUST_CHECK int sst_storage_snapshot(struct sst_storage *s, const uint8_t *jpeg, size_t bytes, char *name);

/** Make a light field in exports/ from the set nearest to a moment, of a recording or in memory.
 *  @param recording  NULL: the one (or the RAM) that holds the moment; wall_ns: the moment; name: out, [64]
 *  @return as of a snapshot, and -ENOENT (no such recording, or nothing within 10 s of the moment), -EBADMSG (damaged)
 */
SST_MUST_CHECK int sst_storage_export(struct sst_storage *s, const char *recording, int64_t wall_ns, char *name);

/** Open a download: "NAME.tar" is the whole folder; "NAME" or "NAME.jpg" the picture of a snapshot, "NAME.jpg" the
 *  see-through picture in the middle of a recording; "NAME.r0c5.mkv" the video of a camera of a recording, "NAME.mkv"
 *  the see-through view's. A video is first made as a file that counts towards the limits; one of the active recording has the frames so far. Waits for the disk.
 *  @param name  validated here; out: must be closed before the storage is
 *  @return 0, -EINPROGRESS (it is being made: call again, after 0.2 s already), -ENOENT, -ENODATA (nothing of it was
 *          recorded), -EBUSY (all of a recording that is being written), -EMFILE (sixteen are open), -ENOSPC (for the
 *          video), -EAGAIN (it changed meanwhile), -EBADMSG, -EROFS, -EIO */
SST_MUST_CHECK int sst_storage_download(struct sst_storage *s, const char *name, struct sst_download **out);

/** Keep a recording from being removed to make room, while it is read; a client can still delete it.
 *  @param recording  NULL: the one that holds the moment, or is within 10 s of it
 *  @param name, dir  out, [64], [SST_PATH_MAX] @return 0, -ENOENT, -ENAMETOOLONG */
SST_MUST_CHECK int sst_storage_hold(struct sst_storage *s, const char *recording, int64_t wall_ns, char *name,
                                    char *dir);
void sst_storage_release(struct sst_storage *s, const char *name);

/** Picture of the see-through view that a recording has of a moment.
 *  @param dir  of sst_storage_hold() @param wall_ns  in, the moment; out, of the picture, at most SST_STORAGE_NEAR_NS away
 *  @param set  out, index of its trigger; data  out, JPEG, to free with free() @return 0, -ENOENT (none), -EBADMSG, -EIO, -ENOMEM; not logged. Waits for the disk */
SST_MUST_CHECK int sst_storage_view_picture(const char *dir, int64_t *wall_ns, uint64_t *set, uint8_t **data,
                                            size_t *bytes);

/** Delete a recording, snapshot or export; running downloads of its archive are aborted. Returns after
 * 0.8 s even if the removal continues. @return 0, -ENOENT, -EBUSY (it is being written), -EROFS, -EIO */
SST_MUST_CHECK int sst_storage_delete(struct sst_storage *s, const char *name);

/** Automatic recordings of one class. */
struct sst_storage_class {
    int64_t recordings, bytes, oldest_ns; /* wall time; 0: none */
    double bytes_per_day, fits_days;      /* NaN: not known */
};

/** State of storage; sst_storage_fields explains the members. */
struct sst_storage_report {
    enum sst_storage_state state;
    int limit;        /* 0: none, 1: quota, 2: disk */
    char reason[512];
    const char *dir;  /* of the storage */
    int64_t free_bytes, used_bytes, quota_bytes, oldest_ns, kind[3], manual_bytes, manual_limit_bytes;
    double age_s;
    uint64_t removed, trimmed, deleted;
    int downloads;
    struct sst_storage_class full, reduced;
    /* the recording that is made */
    enum sst_record_mode mode;
    bool active, is_reduced;
    char name[64], why[112];
    int64_t since_ns;
    uint64_t sets, dropped;
    /* memory */
    struct sst_ring_counters ring;
    double ring_s;
    int pictures;
};

/** Never waits for a disk. */
void sst_storage_report(struct sst_storage *s, struct sst_storage_report *out);
/** Of a struct sst_storage_report: storage of the status, and metrics. */
extern const struct sst_field sst_storage_fields[];

/** {recordings: [{name, from, to, sets, bytes, why, by_hand, view, active}], snapshots and exports: [{name, time,
 *  bytes, picture, active}]}, the oldest of each first. view: the see-through view was recorded. NULL: no memory. */
json_t *sst_storage_list(struct sst_storage *s);

enum sst_storage_state sst_storage_state(struct sst_storage *s);

/** Start to shut down, within timeout_ms: half of it for sets that wait in memory, half for the disk. New calls are
 * refused, waiting ones return. sst_storage_close() waits for the end. NULL is fine. */
void sst_storage_shut(struct sst_storage *s, int timeout_ms);

/** Finish all writing; other threads may still call. @return true: everything is on disk; false: the disk still hangs
 * after timeout_ms (its threads still run: the process must end by _exit(); acknowledged data is on disk) */
SST_MUST_CHECK bool sst_storage_finish(struct sst_storage *s, int timeout_ms);

/** Finish all writing and free the storage; no other calls may follow. @return as sst_storage_finish(); false: not
 * freed */
SST_MUST_CHECK bool sst_storage_close(struct sst_storage *s, int timeout_ms);

#endif
