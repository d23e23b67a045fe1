/* capture/array/frame_sync.h - frames of all cameras grouped into framesets, one per trigger; every frame is
 * accounted for. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_ARRAY_FRAME_SYNC_H
#define SST_CAPTURE_ARRAY_FRAME_SYNC_H

#include <stdbool.h>

#include "base/frame.h"

/** Where a frame ended: exactly one bucket each (design.md, 6). */
enum sst_bucket {
    SST_BUCKET_SET = 0,       /* in a set that was passed on */
    SST_BUCKET_LATE = 1,      /* its set was already closed */
    SST_BUCKET_DUPLICATE = 2, /* its set already has a frame of this camera */
    SST_BUCKET_STRAY = 3,     /* belongs to no trigger */
    SST_BUCKET_CORRUPT = 4,   /* its bytes or time stamp are wrong */
    SST_BUCKET_FLAGGED = 5,   /* marked as bad by the driver */
    SST_BUCKET_DROPPED = 6,   /* in a set dropped by policy: a later stage was full, or shut-down */
    SST_BUCKETS = 7,
};

/** Differences between the start-of-exposure stamps of one set, and to the edge of the trigger. */
struct sst_skew {
    int64_t spread_ns; /* latest minus earliest stamp; 0 with fewer than two frames */
    int64_t
        from_edge_ns; /* stamp of the frame farthest from the median of the others, minus the edge; 0 without an edge */
    int worst_cam;    /* farthest from the median stamp; -1 with fewer than two */
};

/** A frameset: one frame of each camera for one trigger. Frames are borrowed from the grab; release them all when done.
 */
struct sst_frameset {
    uint64_t index;  /* of the trigger */
    int64_t t_ns;    /* time zero: loop-back edge, else the trigger's own time, else the earliest stamp */
    int64_t wall_ns; /* CLOCK_REALTIME at t_ns */
    bool edge;       /* t_ns is a kernel time stamp of the edge */
    int cameras;     /* size of the array */
    int present;     /* number of frames in the set */
    struct sst_skew skew;
    struct sst_frame *frame[SST_CAMERAS_MAX]; /* NULL: missing */
};

struct sst_framesync; /* opaque; one thread, but for sst_framesync_recycle() */

/** How frames are assigned to sets. */
enum sst_framesync_match {
    SST_FRAMESYNC_EDGE = 0,    /* each trigger exposes every camera once: a frame matches if it is in the window */
    SST_FRAMESYNC_NEAREST = 1, /* cameras run on their own, faster than the triggers: the frame of each camera that is
                             nearest to a trigger; the others are stray */
    SST_FRAMESYNC_FREE = 2,    /* no triggers: by ticks of the frame period, tracked per camera */
    SST_FRAMESYNC_INDEX = 3,   /* each frame names its trigger: sst_framesync_place() */
};

struct sst_framesync_config {
    int cameras;
    enum sst_framesync_match match;
    int64_t period_ns; /* of triggers (EDGE, NEAREST, INDEX; 0: irregular) or frames (FREE, > 0) */
    int64_t window_ns; /* 0: 0.4 of the period, at least 1 ms (EDGE, NEAREST) */
    int64_t wait_ns; /* a set is closed this long after its trigger, complete or not; 0: 2.5 periods, at least 250 ms */
    int64_t delay_ns[SST_CAMERAS_MAX]; /* planned, from the trigger to the exposure; subtracted from the skew */
    bool commanded[SST_CAMERAS_MAX];   /* EDGE: exposed by a command that follows the trigger, so never before it: the
                                          window is after the trigger */
    int pool;                          /* maximum number of sets that are open or with the receiver, 2..64 */
};

struct sst_framesync_events {
    void *arg;
    /** A closed set, in the order of the triggers, also without frames; owned by the receiver until
     * sst_framesync_recycle().
     */
    void (*set)(void *arg, struct sst_frameset *set);
    /** A frame can be released; for SET and DROPPED called by sst_framesync_recycle() and sst_framesync_withhold(), on
     * their thread. */
    void (*release)(void *arg, struct sst_frame *frame, enum sst_bucket bucket);
};

struct sst_framesync_counters {
    uint64_t sets, complete, empty; /* passed on; of these, with all cameras, with none */
    uint64_t dropped;               /* triggers without a free set: the receiver holds them all */
    uint64_t relocked;              /* FREE: a camera's ticks slipped against the others' */
    uint64_t bucket[SST_BUCKETS];
    uint64_t camera[SST_CAMERAS_MAX][SST_BUCKETS];
    uint64_t
        waiting; /* frames not yet in a bucket: in sets that are open or with the receiver, or ahead of their set */
};

/** @return 0, -EINVAL, -ENOMEM. */
SST_MUST_CHECK int sst_framesync_create(struct sst_framesync **out, const struct sst_framesync_config *cfg,
                                        const struct sst_framesync_events *events);

/** Report a fired trigger, in order of time. @param edge  t_ns is the kernel's stamp of a loop-back edge */
void sst_framesync_trigger(struct sst_framesync *sets, uint64_t index, int64_t t_ns, bool edge);

/** Add an arrived frame; it ends in its bucket now or when its set is closed. */
void sst_framesync_frame(struct sst_framesync *sets, struct sst_frame *frame);

/** INDEX: frame of a camera for the trigger of an index reported before; it ends in its bucket now or when its set is
 *  closed. NULL: none will come, and the set does not wait for it. */
void sst_framesync_place(struct sst_framesync *sets, int cam, uint64_t index, struct sst_frame *frame);

/** Set whether a camera streams: sets wait only for streaming cameras. Initially none streams. */
void sst_framesync_camera(struct sst_framesync *sets, int cam, bool streaming);

/** Close complete and overdue sets. @return latest time of the next call; INT64_MAX: after the next event */
int64_t sst_framesync_tick(struct sst_framesync *sets, int64_t now_ns);

/** Close all open sets as they are. */
void sst_framesync_flush(struct sst_framesync *sets);

/** Return one frame of a set that the receiver holds; it counts as corrupt, and is no longer in the set.  Thread: any. */
void sst_framesync_withhold(struct sst_framesync *sets, struct sst_frameset *set, int cam);

/** Return a set from the receiver: its frames are released.  Thread: any; calls the release event.
 *  @param dropped  count its frames as dropped by policy */
void sst_framesync_recycle(struct sst_framesync *sets, struct sst_frameset *set, bool dropped);

/** Thread: the one of sst_framesync_frame() and sst_framesync_trigger(). */
void sst_framesync_counters(const struct sst_framesync *sets, struct sst_framesync_counters *out);

/** Every set must have been recycled. NULL is fine. */
void sst_framesync_destroy(struct sst_framesync *sets);

const char *sst_bucket_name(enum sst_bucket bucket);

/** Their names in JSON and metrics. */
extern const char *const sst_bucket_keys[SST_BUCKETS];

#endif
