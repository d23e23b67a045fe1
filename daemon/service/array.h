/* daemon/service/array.h - the array kept capturing for months: opened, run, and opened again whatever ends it. */
#ifndef SST_DAEMON_SERVICE_ARRAY_H
#define SST_DAEMON_SERVICE_ARRAY_H

#include "config/sstd.h"
#include "capture/array/capture.h"
#include "capture/array/ring.h"
#include "daemon/events/events.h"
#include "capture/recording/recorder.h"

struct sst_array; /* opaque; any thread, but open and close */

/** Where cameras sit, from one opening of the array to the next. */
struct sst_layout {
    unsigned generation;            /* 0: the array was never open; counts openings */
    uint64_t first;                 /* sets of the ring with lower numbers are of another layout */
    struct sst_array_config config; /* with the bindings found */
};

/** One camera, as people and programs are told of it. */
struct sst_array_camera {
    int row, col;
    enum sst_grab_state state;
    char serial[64], port[64], name[64];
    char reason[256]; /* of a state other than streaming */
    struct sst_grab_counters grab;
    uint64_t bucket[SST_BUCKETS];
    double rate_hz;  /* frames in sets, over the last second */
    double skew_us;  /* its stamps less the median of their sets, smoothed */
    int64_t last_ns; /* of its last frame in a set; 0: none yet */
};

struct sst_array_state {
    bool open;   /* cameras and trigger are */
    bool failed; /* opening or running ended with `reason`, which stays until sets come; tried again */
    char reason[512];
    int cameras, present;                  /* bound; of them streaming */
    double rate_hz;                        /* sets per second */
    int64_t period_ns;                     /* between sets, as configured; 0: never open */
    int64_t beat_ns;                       /* when the capturing thread was last seen alive */
    int64_t frame_ns;                      /* when a set with a frame last came; 0: never */
    int64_t unused_ns;                     /* when a frame last ended outside a set; 0: never */
    int unused_s;                          /* for so many seconds nearly all frames have ended outside sets ... */
    enum sst_bucket unused_bucket;         /* ... most of them in this one */
    uint64_t sets, complete, ring_refused; /* of all openings */
    struct sst_capture_report report;      /* of this one */
};

/** Start the thread that captures into the ring. @param events, ring  must stay @return 0, -ENOMEM, -EAGAIN */
SST_MUST_CHECK int sst_array_open(struct sst_array **out, const struct sst_array_config *config, struct sst_ring *ring,
                                  struct sst_events *events);

/** Go on with another configuration: capturing starts anew. */
void sst_array_configure(struct sst_array *a, const struct sst_array_config *config);

void sst_array_state(struct sst_array *a, struct sst_array_state *out);

/** Of the newest opening, by index of sst_layout.config.camera. @param out  [SST_CAMERAS_MAX] @return how many */
int sst_array_cameras(struct sst_array *a, struct sst_array_camera *out);

unsigned sst_array_generation(struct sst_array *a);
void sst_array_layout(struct sst_array *a, struct sst_layout *out);

/** What recordings say of the cameras. @param out  [SST_CAMERAS_MAX] */
void sst_array_tracks(struct sst_array *a, struct sst_recorder_track *out);

/** Ask the thread to end. */
void sst_array_stop(struct sst_array *a);
/** @return true: it has ended; false: something in it hangs */
SST_MUST_CHECK bool sst_array_join(struct sst_array *a, int64_t until_ns);
/** After a join. NULL is fine. */
void sst_array_close(struct sst_array *a);

/** "streaming", "absent" ... */
const char *sst_array_state_name(enum sst_grab_state state);

#endif
