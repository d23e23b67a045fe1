/* daemon/service/viewer_parts.h - the state behind sst_viewer, shared by its files. Only for them. */
#ifndef SST_DAEMON_SERVICE_VIEWER_PARTS_H
#define SST_DAEMON_SERVICE_VIEWER_PARTS_H

#include <pthread.h>
#include <stdatomic.h>

#include "daemon/service/settings.h"
#include "daemon/service/viewer.h"

#define VIEWS_MAX  17                   /* "main" and those of viewers */
#define WANTED_NS  INT64_C(5000000000)  /* a picture asked for once is made for so long */
#define EXPIRY_NS  INT64_C(30000000000) /* a view without viewers goes after this */
#define FRESH_MS   800                  /* a picture is waited for no longer */
#define RATE_SLOTS 16                   /* seconds that rates are told over, and some */

/** What one viewer sees. */
struct view {
    bool used;
    char id[16];
    struct sst_view_settings settings;
    unsigned version;       /* of the settings */
    unsigned shown_version; /* that its picture shows */
    uint64_t shown_update;  /* state of the light field that its picture shows */
    double shown_focus_px;
    int64_t used_ns; /* when it was last asked for */
    struct sst_outlet *outlet;
    struct sst_live_picture *picture; /* live thread only */
};

/** A picture that is the same for all: of a camera, of labels or disparities. */
struct shared {
    struct sst_outlet *outlet;
    int64_t used_ns;
    uint64_t shown; /* update, or number of the set */
};

/** Work that only the live thread may do, for another thread that waits for it. */
struct request {
    bool pending, done;
    unsigned number; /* whoever gave up waiting leaves none to be answered */
    char id[16];
    int x, y, err;
    struct sst_live_pick pick;
};

/** What happened in one second. */
struct second {
    int64_t s;
    uint64_t sets, tiles, changed;
    int64_t cpu_ns;
};

struct sst_viewer {
    /* fixed after open */
    struct sst_ring *ring;
    struct sst_array *array;
    struct sst_storage *storage;
    struct sst_events *events;
    pthread_t thread, camera_thread, check_thread;
    bool camera_runs;
    pthread_mutex_t lock;
    pthread_cond_t changed;

    /* live thread */
    struct sst_live *live; /* set and cleared under lock, so that stop can cancel it */
    struct sst_use_calibration use;
    struct sst_live_config live_config;
    struct sst_live_input input;   /* of the set taken in last */
    struct sst_live_report report; /* about it */
    struct sst_layout layout;
    char model[SST_PATH_MAX];
    uint64_t last; /* number of the set taken in last */
    int64_t last_ns, retry_ns;
    uint64_t set_index; /* that the pictures show, its time zero and wall time */
    int64_t set_t_ns, set_wall_ns;
    bool latency_due;                 /* the next pictures are the first of a set */
    struct sst_jpeg_encoder *encoder; /* NULL until the first picture */
    struct sst_image overlay_image;   /* of labels or disparities; empty until the first */

    /* under lock */
    struct sst_config config;
    unsigned config_count, config_seen;
    bool stop, ended, camera_ended, check_runs, check_ended;
    int64_t hand_ns;      /* when a viewer last changed his settings; 0: never */
    int64_t check_due_ns; /* when the calibration is to be checked next; 0: not known yet */
    struct sst_viewer_state state;
    struct second second[RATE_SLOTS];
    uint64_t update; /* states of the light field */
    struct view view[VIEWS_MAX];
    struct shared overlay[2], camera[SST_CAMERAS_MAX];
    struct request request;
    struct sst_classes classes;
    float share[256]; /* of the reference view, by label */
};

/* viewer_views.c */
int sst_viewer_views_open(struct sst_viewer *v);
/** The configuration is about to become another one: the main view is as that says. */
void sst_viewer_views_follow_locked(struct sst_viewer *v, const struct sst_live_settings *to);
void sst_viewer_views_close(struct sst_viewer *v);
/** Make every picture that somebody wants and that is not as it should be.  Live thread. */
void sst_viewer_publish(struct sst_viewer *v);
/** The light field goes: pictures of it, too.  Live thread. */
void sst_viewer_forget_pictures(struct sst_viewer *v);
/** Serve sst_viewer_pick().  Live thread. */
void sst_viewer_serve(struct sst_viewer *v);

/* viewer_cameras.c */
void *sst_viewer_run_cameras(void *arg);
/** An outlet that is asked for: made if there is none.  @return 0, -ENOMEM */
int sst_viewer_share_locked(struct shared *s, struct sst_outlet **out);
bool sst_viewer_wanted(struct sst_outlet *outlet, int64_t used_ns);

/* viewer_check.c; live thread, and join once that has ended */
void sst_viewer_check_by_time(struct sst_viewer *v);
void sst_viewer_check_join(struct sst_viewer *v);

#endif
