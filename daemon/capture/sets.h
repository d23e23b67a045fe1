/* daemon/capture/sets.h - frames of all cameras put together into sets, one per trigger; every frame is accounted for. */
#ifndef SST_DAEMON_CAPTURE_SETS_H
#define SST_DAEMON_CAPTURE_SETS_H

#include <stdbool.h>

#include "base/frame.h"

SST_EXTERN_C_BEGIN

/** Where a frame ended: exactly one bucket each (DESIGN section 6). */
enum sst_bucket {
    SST_BUCKET_SET = 0,       /* in a set that was handed on */
    SST_BUCKET_LATE = 1,      /* its set was closed already */
    SST_BUCKET_DUPLICATE = 2, /* its set has a frame of this camera already */
    SST_BUCKET_STRAY = 3,     /* belongs to no trigger */
    SST_BUCKET_CORRUPT = 4,   /* its bytes or stamp are wrong */
    SST_BUCKET_FLAGGED = 5,   /* the driver says so */
    SST_BUCKET_DROPPED = 6,   /* in a set that policy dropped: a later stage was full, or shut-down */
    SST_BUCKETS = 7,
};

/** Start-of-exposure stamps of one set against each other and against the trigger's edge. */
struct sst_skew {
    int64_t spread_ns;    /* latest less earliest stamp; 0 with fewer than two frames */
    int64_t from_edge_ns; /* of the frame farthest from the others' median: its stamp less the edge; 0 without an edge */
    int worst_cam;        /* farthest from the median stamp; -1 with fewer than two */
};

/** One frame of each camera for one trigger. Frames are borrowed from the grab; release them all when done. */
struct sst_set {
    uint64_t index;   /* of the trigger */
    int64_t t_ns;     /* time zero: loop-back edge, else the trigger's own time, else the earliest stamp */
    int64_t wall_ns;  /* CLOCK_REALTIME at t_ns */
    bool edge;        /* t_ns is a kernel time stamp of the edge */
    int cameras;      /* size of the array */
    int present;      /* frames that are there */
    struct sst_skew skew;
    struct sst_frame *frame[SST_CAMERAS_MAX]; /* NULL: missing */
};

SST_EXTERN_C_END

#endif
