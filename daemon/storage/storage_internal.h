/* daemon/storage/storage_internal.h - private declarations of this folder; code outside of it includes the public
 * headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_STORAGE_STORAGE_INTERNAL_H
#define SST_DAEMON_STORAGE_STORAGE_INTERNAL_H

#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <sys/types.h>

#include "base/base.h"
#include "base/file.h"
#include "base/jpeg_slot.h"
#include "capture/recording/mkv.h"
#include "config/sstd.h"
#include "daemon/storage/catalog_internal.h"
#include "daemon/storage/storage.h"

/* --- parts.c: sets recorded by their changes alone --- */

/** Frames of the last whole set, and the set that was made with them. Zeroed: none yet. Recording thread. */
struct set_parts {
    uint8_t *base[SST_CAMERAS_MAX]; /* NULL: the next frame is whole */
    size_t base_bytes[SST_CAMERAS_MAX];
    int64_t base_t_ns, base_wall_ns;
    struct sst_frameset set;
    struct sst_frame frame[SST_CAMERAS_MAX];
    uint8_t *made[SST_CAMERAS_MAX];
};

/** Form of a set to record: its parts, or itself if a whole one is due. Valid until the next call. */
const struct sst_frameset *set_parts_of(struct set_parts *p, const struct sst_frameset *set);
/** A set has been written: later ones have parts if it was whole. */
void set_parts_written(struct set_parts *p, const struct sst_frameset *set);
/** The next set is whole. */
void set_parts_forget(struct set_parts *p);

/* --- triggers: when a change or a label is there for long enough to be reported and recorded. No input or output. - */

/* A trigger has hysteresis: its condition holds from its share up, and down to half of the share. It becomes active
 * when the condition held for begin_s, inactive when it did not for end_s, in two sets at least. Sets to the contrary
 * subtract their time, and a single one never changes anything. */
#define EVENT_TRIGGER_BEGIN_S 0.3
#define EVENT_TRIGGER_END_S   1.0
#define EVENT_TRIGGER_KEEPS   0.5
#define EVENT_TRIGGER_SHARE   0.02 /* of zones that no trigger names */
/* Repeated changes are reported as one: each that begins within AGAIN after the last reported end doubles the hold time
 * before the next end is reported, up to HOLD. Labels are reported each time. */
#define EVENT_TRIGGER_AGAIN_NS 10000000000
#define EVENT_TRIGGER_HOLD_NS  60000000000
#define EVENT_TRIGGERS_MAX     (SST_TRIGGERS_MAX + SST_ZONES_MAX)

/** A condition: a change, a label or a visit, in a zone or in the whole picture. */
struct event_trigger {
    char zone[32], label[64]; /* "": the whole picture; any change */
    bool visit;               /* reported by its own events */
    int trigger;              /* of the configuration: it is recorded; -1: only reported */
    int index;                /* of the zone in sst_seen; -1: the whole picture */
    double share;
    double begin_s, end_s; /* above 0; else the common ones */
    /* the state that recordings follow */
    bool active;
    int sets;          /* in favour of the other state, in a row but for single ones */
    int64_t t_ns;      /* set.t_ns of the last set */
    int64_t since_ns;  /* of the first set for the other state */
    int64_t weight_ns; /* time in favour of it */
    int64_t begin_ns;  /* first set of the active state */
    int64_t last_ns;   /* last set in which the condition held */
    /* the reported state */
    bool reported;
    int64_t reported_ns; /* begin_ns at the reported beginning; time of the reported end */
    int64_t hold_ns;     /* inactive for this long before the end is reported */
    int times;           /* activations since the reported beginning */
    bool was_active;     /* at the last call */
    double peak;         /* largest share since then */
};

struct event_triggers {
    int count;
    struct event_trigger list[EVENT_TRIGGERS_MAX];
};

/** The configuration's triggers, and changes in every zone that no trigger names, all inactive. */
void event_triggers_init(struct event_triggers *w, const struct sst_config *config);

/** A value in a set; NaN counts as 0. @return true: active changed */
bool event_trigger_update(struct event_trigger *w, double value, int64_t t_ns);

/** After an update: is a beginning or end (w->reported) to be reported? @return true: that changed */
bool event_trigger_report(struct event_trigger *w, double value, int64_t t_ns);

/** Copy the state of a trigger to its successor with other settings. */
void event_trigger_continue(struct event_trigger *w, const struct event_trigger *before);

/* --- view ---
 * the see-through view beside the sets of a recording.
 *
 * Its pictures come from the JPEG slot of the main view: the thread sst-view keeps the latest in memory (pre-roll), and
 * the recording thread writes them. */

#define VIEW_HISTORY_MAX   4096
#define VIEW_HISTORY_BYTES ((size_t)64 << 20)

/** The latest pictures; the oldest is dropped first. Under the storage's lock. Zeroed: none. */
struct view_history {
    const struct sst_jpeg *jpeg[VIEW_HISTORY_MAX]; /* a ring from `first` on */
    int first, count;
    size_t bytes;
};

/** Add a picture; its reference becomes the history's. Pictures before keep_ns are dropped, but the last one. */
void view_history_add(struct view_history *s, const struct sst_jpeg *jpeg, int64_t keep_ns);
/** The first with a number above `after`, referenced; NULL: none. */
const struct sst_jpeg *view_history_next(struct view_history *s, uint64_t after);
/** The last that is not after t_ns, referenced; NULL: none. */
const struct sst_jpeg *view_history_at(struct view_history *s, int64_t t_ns);
void view_history_fini(struct view_history *s);

/** The files of a recording; zeroed: none. One thread. */
struct view_files {
    int fd;                                 /* pictures; 0: none */
    FILE *index;                            /* NULL: none */
    int64_t at;                             /* end of the pictures */
    int64_t last_t_ns, last_at, last_bytes; /* of the last line */
    uint64_t last_set;
};

/** Create them in a recording's folder. @return 0 or -errno; logged. Waits for the disk. */
SST_MUST_CHECK int view_begin(struct view_files *f, const char *dir);
/** @param t_ns  when it is to be shown: its own time, or the recording's beginning; wall_ns is the same by the wall clock
 * @return 0 or -errno; not logged */
SST_MUST_CHECK int view_write(struct view_files *f, const struct sst_jpeg *jpeg, int64_t t_ns, int64_t wall_ns);
/** Close them; the last picture is shown until end_ns. @return 0 or the error that it met; not logged */
int view_end(struct view_files *f, int64_t end_ns, int64_t end_wall_ns);

/* --- parts ---
 * common state of the threads of storage.
 *
 * sst-record     writes sets (record.c)                 waits for the disk
 * sst-retention  free space, limits, repairs (retention.c) waits for the disk
 * sst-export     snapshots and exports (jobs.c)         waits for the disk
 * sst-video      videos for downloads (video_files.c)   waits for the disk
 * sst-view       the latest pictures (view.c)           never waits for the disk
 * sst-state      state and its events (status.c)         never waits for the disk
 * Calls only access memory, but for downloads, which read; the lock is never held during disk access. */

#define SST_STORE_TEXT      512
#define SST_STORE_JOBS      4          /* waiting or running */
#define SST_STORE_ANSWER_MS 800        /* a call waits this long for a thread */
#define SST_STORE_GRACE_NS  100000000  /* and this much longer after a stall of the machine */
#define SST_STORE_HUNG_NS   5000000000 /* a disk counts as hung after this */

/** The array as it was opened. */
struct store_array {
    struct sst_recorder_config recorder; /* its grid, cameras, format and rate, else defaults */
    unsigned opening;                    /* counts openings of the array; a recording belongs to one; 0: never open */
};

/** The configuration as the threads use it. */
struct store_settings {
    enum sst_record_mode mode;
    bool view; /* the see-through view is recorded, too */
    enum sst_reduced_mode reduced;
    int reduced_every;
    struct store_limits limits;
    double segment_s, sync_s;
    int64_t preroll_ns, postroll_ns;
    struct store_array array;
    char calibration[SST_CONFIG_TEXT_MAX], poses[SST_CONFIG_TEXT_MAX]; /* at most one */
    double plane_mm;
};

/** A request to record sets, by their time. */
struct store_want {
    bool armed; /* until a set after the end arrives */
    int64_t begin_ns, end_ns;
    char why[SST_STORE_WHY], zone[32], label[64];
};

/** Obstacle to recording. */
enum store_trouble {
    SST_TROUBLE_NONE = 0,
    SST_TROUBLE_LIMIT_LOW = 1, /* LOW; from here on FULL */
    SST_TROUBLE_LIMIT = 2,
    SST_TROUBLE_LIBRARY = 3, /* FFmpeg is missing: no recordings and snapshots */
    SST_TROUBLE_HUNG = 4,
    SST_TROUBLE_WRITE = 5,
    SST_TROUBLE_FOLDER = 6,
};

struct store_job; /* jobs.c */

enum video_stage {
    VIDEO_NONE = 0, /* the rest is zero */
    VIDEO_WANTED = 1,
    VIDEO_AT_WORK = 2, /* sst-video alone changes the fixed fields */
    VIDEO_MADE = 3,    /* or not: err */
};

/** A video requested by a client, as an unnamed file (video_files.c); under the storage's lock. */
struct video_file {
    enum video_stage stage;
    /* fixed from WANTED on */
    char name[SST_STORE_NAME]; /* of the recording */
    int row, col;              /* row -1: the see-through view */
    bool active;               /* the recording was being written ... */
    uint64_t sets, gone;       /* ... else its content */
    int64_t asked_ns;
    /* fixed when MADE */
    int fd, err;
    int64_t made_ns;
    /* changing */
    int64_t bytes, used_ns; /* bytes: reserved, then of the file */
    int readers;
};

struct sst_storage {
    /* fixed after open */
    struct sst_ring *ring;
    struct sst_events *events;
    char dir[SST_PATH_MAX], folder[SST_STORE_KINDS][SST_PATH_MAX];

    pthread_mutex_t lock;
    pthread_cond_t wake;     /* something is to be done */
    pthread_cond_t answered; /* something was done */
    /* under lock */
    bool stop;
    int64_t stop_ns; /* sets in the ring are written until then */
    int threads;     /* that run */
    int downloads;
    struct store_settings settings;
    struct sst_recorder_track *tracks; /* [SST_CAMERAS_MAX], of settings.cameras */
    struct catalog catalog;

    /* requests */
    struct event_triggers event_triggers;
    struct store_want event, demand;
    bool wanted;            /* sets are to be recorded now */
    int64_t seen_ns;        /* clock, at the last sst_storage_seen(); 0: never */
    int64_t moved_ns;       /* time of the last set in which something changed; 0: none */
    uint64_t asked, answer; /* requests to record; the last one answered, ... */
    int answer_err;         /* ... with this */

    /* the active recording */
    char active_name[SST_STORE_NAME], active_why[SST_STORE_WHY]; /* "": none */
    uint64_t active_sets, dropped;                               /* dropped: since open */
    bool active_lost;                                            /* its folder was removed */
    int64_t waiting_bytes; /* of a set that waits for room in the quota; 0: none */
    int64_t part_bytes;    /* the largest piece that is removed at once, a tenth of the room; 0: unknown yet */

    /* state */
    bool ready;                /* the folder exists, is locked and was scanned */
    bool blocked;              /* nothing may be written */
    int folder_err, write_err; /* negative errno */
    bool no_muxer;             /* recordings were refused for want of FFmpeg; until the service is restarted */
    enum store_trouble limit;  /* NONE, LIMIT_LOW, LIMIT */
    bool limit_quota;          /* it is the quota's, not the free space's */
    char folder_text[SST_STORE_TEXT], write_text[SST_STORE_TEXT], limit_text[SST_STORE_TEXT];
    int64_t free_bytes, used_bytes, checked_ns; /* checked: clock; 0: never */
    int64_t aside_bytes[SST_STORAGE_ASIDES];    /* of others, in the quota */
    int64_t manual_bytes;                       /* up to this entries made by hand are removed last */
    uint64_t removed[SST_STORE_KINDS], deleted; /* because of the limits; by hand */
    uint64_t trimmed;                           /* segments removed from recordings because of the limits */
    int64_t record_busy_ns,
        retention_busy_ns; /* clock, since when the thread waits for the disk; 0: it does not wait */
    enum sst_storage_state state;
    enum store_trouble trouble;
    char reason[SST_STORE_TEXT];

    struct store_job *job[SST_STORE_JOBS]; /* in their order; the first is running */
    int jobs;

    struct video_file video[SST_DOWNLOADS_MAX]; /* each download reads one at most */

    struct sst_slot *slot; /* of the main view; NULL: not yet */
    struct view_history history;
    int64_t views_from_ns; /* pictures of earlier sets are not recorded any more */

    pthread_t thread[6];
};

void *store_record_run(void *storage);
void *retention_run(void *storage);
void *store_jobs_run(void *storage);
void *store_video_run(void *storage);
void *status_run(void *storage);
void *store_view_run(void *storage);

/** The lock is held; waits for `wake` or `ms`, whichever comes first. */
void store_wait_locked(struct sst_storage *s, int ms);
/** Wait for `answered`; call again until the condition holds. @return false: until_ns has passed, with some grace */
bool store_wait_answer_locked(struct sst_storage *s, int64_t until_ns);
/** Report that the calling thread ends. */
void store_thread_ends(struct sst_storage *s);
/** Set whether the thread waits for the disk. */
void store_busy(struct sst_storage *s, int64_t *since_ns, bool busy);

/** The result of a call that needs the disk: 0, or why it is refused now: -ENOSPC, -EROFS, -EBUSY, -EIO. */
int store_refusal_locked(const struct sst_storage *s);

/** Add an ACTIVE entry with a new name to the catalog. @param attempt  from 1 @param entry  in: kind, from_ns, why;
 *  out: all @return 0, -EEXIST (another attempt may do), -ENOMEM */
SST_MUST_CHECK int store_reserve(struct sst_storage *s, int attempt, struct store_entry *entry);
/** Remove an entry from disk and catalog because of the limits. sst-retention only. @return 0 or -errno: it stays, as
 *  KEPT */
int store_remove(struct sst_storage *s, const struct store_entry *entry);
/** Remove the oldest segment of a recording because of the limits. sst-retention only. @return 0, -ENODATA (only
 *  segments that must stay are left) or an error of sst_recording_trim(): nothing was removed */
int store_trim(struct sst_storage *s, const struct store_entry *entry);
/** Remove entries that clients deleted. sst-retention only. */
void store_remove_deleted(struct sst_storage *s);

/**
 * Open a video, or have it made; waits for it for 0.2 s.
 *
 * @param e    a recording of the catalog; no longer valid on return
 * @param out  counts one more reader until that is taken back with used_ns, under lock; its fd and bytes stay until then
 * @return 0, -EINPROGRESS (ask again, within a minute), -EMFILE, and errors of making it: -ENOENT, -ENODATA (no frame),
 *         -ENOSPC, -EAGAIN (its beginning was removed meanwhile), -EBADMSG, -EIO ...
 */
SST_MUST_CHECK int video_file_open_locked(struct sst_storage *s, struct store_entry *e, int row, int col,
                                          struct video_file **out);
/** Bytes of all videos, with reserved ones. */
int64_t video_files_bytes_locked(const struct sst_storage *s);
void video_files_fini(struct sst_storage *s);

/** Bytes of everything in the catalog, and of videos made for downloads. */
int64_t store_used_locked(const struct sst_storage *s);

/** Tracks of the cameras as they are now. @return [SST_CAMERAS_MAX] to free, or NULL: no memory */
struct sst_recorder_track *store_tracks(struct sst_storage *s);
/** Settings of a recorder for the array, with the format of the set's frames. */
void store_recorder_config(struct sst_recorder_config *out, const struct store_array *array,
                           const struct sst_frameset *set);

#endif
