/* daemon/service/service_internal.h - private declarations of this folder; code outside of it includes the public
 * headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_SERVICE_SERVICE_INTERNAL_H
#define SST_DAEMON_SERVICE_SERVICE_INTERNAL_H

#include <jansson.h>
#include <pthread.h>
#include <stdio.h>

#include "base/base.h"
#include "base/clock.h"
#include "capture/array/capture.h"
#include "capture/array/ring.h"
#include "capture/link/link.h"
#include "capture/recording/recorder.h"
#include "config/sstd.h"
#include "daemon/counters/counters.h"
#include "daemon/events/events.h"
#include "daemon/fields/fields.h"
#include "daemon/publish/api.h"
#include "daemon/publish/hooks.h"
#include "daemon/publish/http.h"
#include "daemon/publish/push.h"
#include "daemon/service/service.h"
#include "capture/evidence/evidence.h"
#include "daemon/storage/cases.h"
#include "daemon/storage/storage.h"
#include "daemon/visits/visits.h"
#include "pipeline/live/live.h"
#include "pipeline/method/process/notice.h"
#include "pipeline/method/render/device.h"

/* --- array: captures for months: opens and runs the array, and reopens it after every failure. --- */

struct service_array; /* opaque; any thread, but open and close */

/** Positions of the cameras in the grid, valid from one opening of the array to the next. */
struct array_layout {
    unsigned generation;            /* 0: the array was never open; counts openings */
    uint64_t first;                 /* sets of the ring with lower numbers are of another layout */
    struct sst_array_config config; /* with the bindings found */
};

/** One camera, as reported. */
struct array_camera {
    int row, col;
    enum sst_grab_state state;
    char serial[64], port[64], name[64];
    char reason[256]; /* of a state other than streaming; of streaming: a remark on its frames, or "" */
    struct sst_grab_counters grab;
    struct sst_genicam_ptp ptp; /* role "": none */
    uint64_t bucket[SST_BUCKETS];
    double rate_hz;  /* frames in sets, over the last second */
    double skew_us;  /* its stamps less the median of their sets, smoothed */
    double masked;   /* share of its frames that privacy masks make black */
    int64_t last_ns; /* of its last frame in a set; 0: none yet */
};

struct array_state {
    bool open;   /* cameras and trigger are open */
    bool failed; /* opening or running ended with `reason`, which stays until sets arrive; it is retried */
    char reason[512];
    int cameras, present;                  /* bound; streaming */
    double rate_hz;                        /* sets per second */
    int64_t period_ns;                     /* between sets, as configured; 0: never open */
    int64_t beat_ns;                       /* when the capturing thread was last seen alive */
    int64_t frame_ns;                      /* when a set with a frame last came; 0: never */
    int64_t unused_ns;                     /* when a frame last ended outside a set; 0: never */
    int unused_s;                          /* seconds for which nearly all frames have ended outside sets ... */
    enum sst_bucket unused_bucket;         /* ... most in this one */
    uint64_t sets, complete, ring_refused; /* of all openings */
    struct sst_capture_report report;      /* of this one */
    struct sst_histogram delay_ns;         /* from the trigger until its set is in the ring, of this opening */
};

/** Start the thread that captures into the ring, and on a node that which sends to the head.
 *  @param events, ring  must outlive it @return 0, -ENOMEM, -EAGAIN; on a node also -EINVAL (certificates), -ENOSYS, logged */
SST_MUST_CHECK int array_open(struct service_array **out, const struct sst_array_config *config, struct sst_ring *ring,
                              struct sst_events *events);

/** Follow another configuration: capturing restarts. */
void array_configure(struct service_array *a, const struct sst_array_config *config);

void array_state(struct service_array *a, struct array_state *out);

/** Cameras of the last opening, by index of array_layout.config.camera. @param out  [SST_CAMERAS_MAX] @return count */
int array_cameras(struct service_array *a, struct array_camera *out);

/** Where the cameras of a ring's sets are: in the array, or in a recording. */
struct array_source {
    pthread_mutex_t *lock;
    const struct array_layout *layout; /* under lock */
};
struct array_source array_source(struct service_array *a);

/** Copy the layout unless it is the one of generation `seen`. @return its generation; 0: none, nothing is copied */
unsigned array_layout(struct array_source source, unsigned seen, struct array_layout *out);

/** Tracks of the cameras for recordings. @param out  [SST_CAMERAS_MAX] */
void array_tracks(struct service_array *a, struct sst_recorder_track *out);

/** A node, as the head sees it. */
struct hosts_peer {
    struct sst_link_peer link;
    uint64_t bucket[SST_BUCKETS]; /* where the frames passed to capture ended */
    double clock_ms, edge_us;     /* of link.numbering */
};

/** The other hosts of the array, now. */
struct hosts_now {
    enum sst_config_role role;
    const char *role_name; /* "node", "head" */
    int64_t period_ns;
    const char *address; /* where the head is */
    bool synchronised;   /* this host's clock, by its kernel */
    double error_ms;
    struct sst_link_node_state node; /* of a node */
    int peers;                       /* of a head, while it is open */
    uint64_t overflows;              /* ... datagrams that the kernel had no room for */
    struct hosts_peer peer[SST_NUMBERING_SOURCES];
};

/** @param out  zeroed @return false: this host is the only one */
bool array_hosts(struct service_array *a, struct hosts_now *out);
/** Release the reports of its nodes. A zeroed one is fine. */
void array_hosts_forget(struct hosts_now *now);

/** Make the thread end; does not wait. */
void array_stop(struct service_array *a);
/** @return true: the thread has ended; false: it hangs */
SST_MUST_CHECK bool array_join(struct service_array *a, int64_t until_ns);
/** After a join. NULL is fine. */
void array_close(struct service_array *a);

/** "streaming", "absent" ...; by enum sst_grab_state. */
extern const char *const array_state_names[];

/* --- window: percentiles of the last minute of a repeated measurement. --- */

#define SST_WINDOW    512
#define SST_WINDOW_NS INT64_C(60000000000)

/** Zeroed: empty. The caller locks. */
struct time_window {
    uint64_t count; /* ever */
    double sum;     /* of all ever */
    float value[SST_WINDOW];
    int64_t t_ns[SST_WINDOW];
};

void window_add(struct time_window *w, double value, int64_t now_ns);
/** Of the last SST_WINDOW values of the last SST_WINDOW_NS; NaN if there are none. @param q  0..1, 1: the largest */
double window_quantile(const struct time_window *w, double q, int64_t now_ns);

/* --- engine ---
 * the live engine: runs the newest sets of the ring through the pipeline and renders the viewers'
 * pictures. */

struct live_engine; /* opaque; any thread, but open and close */

/** From the trigger to the picture: waiting in the ring, the stages of sst_live_update(), rendering, encoding. */
enum engine_stage {
    ENGINE_WAIT = 0,                     /* from the trigger until the set is processed */
    ENGINE_LIVE = 1,                     /* SST_LIVE_STAGES stages */
    ENGINE_RENDER = 1 + SST_LIVE_STAGES, /* of all requested pictures */
    ENGINE_ENCODE = 2 + SST_LIVE_STAGES,
    ENGINE_STAGES = 3 + SST_LIVE_STAGES,
};

/** Need of the pictures; less need, less is computed. */
enum engine_demand {
    ENGINE_UNUSED = 0, /* one view is watched for changes; all is brought up to date every few seconds */
    ENGINE_EVENTS =
        1, /* visits to zones, triggers on labels, before a recorded event: up to twice a second after changes */
    ENGINE_PICTURES = 2, /* viewers, or a recording of the view: every set */
};

/** "none", "events", "pictures" */
extern const char *const engine_demand_names[];

/** "wait", "change" ... */
extern const char *const engine_stage_names[ENGINE_STAGES];

/** A track that the automatic cut removes from clear pictures. */
struct engine_removed {
    uint32_t track;
    char name[SST_CLASS_NAME_MAX];
    double distance_m, disparity_px; /* NaN: not known */
};

struct engine_state {
    bool enabled, ready;          /* ready: see-through pictures can be made */
    char reason[512];             /* why not */
    double rate_hz;               /* sets per second, over the last ten */
    uint64_t sets, dropped, idle; /* processed; skipped for newer ones; processed without any change */
    uint64_t relit;               /* sets in which the light or exposure of a view changed */
    uint64_t watched;             /* only one of their views was watched for changes */
    enum engine_demand demand;
    uint64_t pictures;      /* encoded */
    uint64_t visits;        /* begun */
    double changed_percent; /* tiles, over the last ten seconds */
    double cpu_percent;     /* of one core, over the last ten seconds, without rendering */
    struct time_window latency_ms, stage_ms[ENGINE_STAGES]; /* of sets that changed something */
    uint64_t tiles, tiles_changed, label_runs, label_runs_skipped;
    double error_change, error_labels;           /* last sampled; NaN */
    bool on_device;                              /* pictures are rendered on a device: */
    struct sst_render_device_report device;
    bool labels_on_device; /* so is the network run: */
    struct sst_network_device_report label_device;
    struct sst_samples levels;                   /* of 16-bit frames, shown black and white; white 0: all */
    int width, height, views, present;           /* of the light field */
    double range_min_px, range_max_px, focus_px; /* NaN: not known */
    double cut_px;                               /* automatic; NaN: none */
    double searched_min_px, searched_max_px;     /* disparities; NaN: none yet */
    int64_t settles_ns;                          /* when the range or the cut got its value */
    bool counted;                                /* the histogram is known */
    double share_min_px, share_max_px;
    float share[SST_LIVE_HISTOGRAM]; /* of the disparities in that range */
    double focal_px, spacing_mm;     /* 0: not known */
    int64_t beat_ns;                 /* when the thread was last seen alive */
    char check[512];                 /* last verdict on the calibration */
    bool posed;                      /* the cameras stand anywhere: */
    struct sst_live_surface surface; /* on which pictures are rendered */
    bool misaligned;                 /* which was that cameras have moved, or worse */
    struct sst_notices noticed;      /* of the pictures, without views that are late */
    int noticed_views;               /* that it is of; 0: not measured yet */
    bool too_slow;                   /* for the sets that come: */
    double done_hz, due_hz;          /* sets processed, and that should be, over the last seconds */
    char slow_text[320];
    struct engine_removed removed[SST_LIVE_TRACKS];
    int removed_count;
    char removed_text[192];
};

/** Pictures come, but the range of disparities or the cut has only just been found. */
bool engine_settling(const struct engine_state *v);

struct engine_config {
    const struct sst_config *config; /* copied */
    struct sst_ring *ring;           /* this and all below must outlive the engine */
    struct array_source source;
    /* NULL: the sets are a recording's, and are neither recorded nor reported */
    struct sst_storage *storage;
    struct sst_visits *visits;
    struct sst_events *events;
};

/** Start the threads. @return 0, -ENOMEM, -EAGAIN */
SST_MUST_CHECK int engine_open(struct live_engine **out, const struct engine_config *cfg);

/** Zones of the configuration for the pipeline. @param out  [SST_LIVE_ZONES] */
void engine_zones(struct sst_live_zone *out, const struct sst_config *c);
/** Follow other settings. @param restart  restart the pipeline */
void engine_configure(struct live_engine *v, const struct sst_config *config, bool restart);

void engine_state(struct live_engine *v, struct engine_state *out);
/** A picture of the main view (JPEG) that was recorded. */
struct engine_preview {
    uint8_t *data; /* malloc'ed; NULL: none */
    size_t bytes;
    uint64_t set;
    int64_t t_ns, wall_ns;
};

/** Show a recorded picture until views have pictures of their own; none: forget the one before. @param preview  its data is
 *  owned from then on */
void engine_preview(struct live_engine *v, struct engine_preview *preview);

/** Whether all viewers have their pictures of the set of a stamp or a later one, as far as there can be any.
 *  @param watched  out: there is a viewer */
bool engine_has_shown(struct live_engine *v, int64_t t_ns, bool *watched);

/* Verbs of struct sst_api, by the same names; `engine` is a struct live_engine. */
int engine_labels(void *engine, struct sst_api_answer *out);
int engine_tracks(void *engine, struct sst_api_answer *out);
int engine_views(void *engine, struct sst_api_answer *out);
int engine_view_create(void *engine, const char *client, const json_t *settings, struct sst_api_answer *out);
int engine_view_change(void *engine, const char *client, const char *id, const json_t *settings,
                       struct sst_api_answer *out);
int engine_pick(void *engine, const char *id, double x, double y, struct sst_api_answer *out);
int engine_remove(void *engine, const char *client, const char *id, const json_t *request, struct sst_api_answer *out);
int engine_calibration_check(void *engine, struct sst_api_answer *out);
int engine_outlet(void *engine, enum sst_api_picture kind, const char *name, struct sst_slot **out);

/** Ask the threads to end: work in progress returns early, and the viewers' streams end. */
void engine_stop(struct live_engine *v);
/** @return true: all threads have ended; false: one hangs */
SST_MUST_CHECK bool engine_join(struct live_engine *v, int64_t until_ns);
/** After a join. NULL is fine. */
void engine_close(struct live_engine *v);

/* --- replay ---
 * plays a recording: its sets go through a live engine of its own, so that clients see its pictures with settings of
 * their own, as in the live view. One recording at a time. */

struct service_replay; /* opaque; any thread, but open and close */

/** Start the thread. @param storage  must outlive it @return 0, -ENOMEM, -EAGAIN */
SST_MUST_CHECK int replay_open(struct service_replay **out, struct sst_storage *storage,
                               const struct sst_config *config);

/** Follow other settings; the recording that is played keeps the former ones. */
void replay_configure(struct service_replay *r, const struct sst_config *config);

/* Verbs of struct sst_api; `replay` is a struct service_replay. */
int replay_state(void *replay, struct sst_api_answer *out);
int replay_change(void *replay, const json_t *request, struct sst_api_answer *out);
void *replay_take(void *replay);
void replay_release(void *replay);

/** Ask the thread to end, and the viewers' streams with it. */
void replay_stop(struct service_replay *r);
/** @return true: all has ended; false: something hangs */
SST_MUST_CHECK bool replay_join(struct service_replay *r, int64_t until_ns);
/** After a join. NULL is fine. */
void replay_close(struct service_replay *r);

/* --- state behind sst_service; used by the files of sst_service only --- */

struct sst_service {
    /* fixed after open */
    char path[SST_PATH_MAX]; /* of the configuration; "": the default */
    int64_t start_ns;
    struct sst_api api;
    struct sst_events *events;
    struct sst_ring *ring;
    struct sst_storage *storage;
    struct sst_visits *visits;
    struct sst_cases *cases;
    struct service_array *array;
    struct live_engine *engine;
    struct service_replay *replay;
    struct sst_http *http; /* set under lock: its clients send requests before it is open */
    struct sst_hooks *hooks;
    struct sst_push *push; /* set before http is open */
    struct sst_counters counters;
    /* main thread */
    unsigned generation;    /* of the layout that was passed to storage */
    int64_t wall_offset_ns; /* wall less monotonic */
    struct sst_clock_watch clock;
    int64_t cpu_ns, cpu_at_ns;
    struct array_state array_now; /* the last state; too large for a stack, as the next two */
    struct array_layout layout_now;
    struct engine_state engine_now;
    pthread_mutex_t reload;  /* held while the configuration is read and applied */
    pthread_mutex_t drawing; /* before `reload`: held while the file of zones is exchanged */
    pthread_mutex_t parts;   /* held while a configuration is applied to them */
    bool open;               /* under parts: all parts are open */
    /* under lock */
    pthread_mutex_t lock;
    struct sst_config config;
    enum sst_service_phase phase;
    char reason[512];
    double cpu_percent; /* of the process, over the last seconds */
    int64_t refused_ns; /* when a wrong password was last reported */
};

/* api.c */
void service_api(struct sst_service *s);

/* engine_status.c */
/** A skip of the live picture (design.md, 5.5). */
struct live_skip {
    bool on;
    double percent, error;
};

/** The state of an engine with derived figures; engine_live_fields explains the members. */
struct live_now {
    struct engine_state engine;
    struct live_skip skip[2];
    bool settling, verify_rays, ranged, device_up, labels_up;
    bool leveled;
    int64_t levels[2];
    double range_px[2];
    struct sst_spread latency_ms, stage_ms[ENGINE_STAGES];
    double stage_sum_ms[ENGINE_STAGES];
    const char *device_reason, *labels_reason, *on_cpu[16];
    int on_cpu_count;
    uint64_t not_finite;
    double surface_m, surface_age_s; /* of cameras with poses */
    int compare_px;
};

extern const struct sst_field engine_live_fields[];
/** @param now  zeroed */
void engine_live(struct live_now *now, struct live_engine *engine, const struct sst_live_settings *settings);
/** Figures of a live picture, as in the status. NULL: no memory. */
json_t *engine_live_json(struct live_engine *engine, const struct sst_live_settings *settings);

/* status.c */
/** "starting", "armed" ... */
extern const char *const service_phase_names[];
int service_status(void *arg, struct sst_api_answer *out);
int service_cameras(void *arg, struct sst_api_answer *out);
int service_metrics(void *arg, char **text);

/* hosts.c */
/** Of a struct hosts_now of a node, and of a head. */
extern const struct sst_field hosts_node_fields[], hosts_head_fields[];
/** @return true: something is wrong with another host or its clock; why: one clause */
bool service_hosts_problem(struct service_array *array, char *why, size_t size);

/* reload.c */
int service_apply(void *arg, bool dry_run, struct sst_api_answer *out);

/* zones.c: zones drawn on the page, kept in web.zones_file; masks, which only the configuration sets */
int service_zones(void *arg, struct sst_api_answer *out);
int service_masks(void *arg, struct sst_api_answer *out);
int service_zones_change(void *arg, const json_t *request, struct sst_api_answer *out);

/* cases.c: videos for others, notifications */
/** The place in videos and notifications: the configuration's, else the name of this machine. */
void service_site(char out[256], const struct sst_config *c);
int service_push(void *arg, struct sst_api_answer *out);
int service_push_change(void *arg, const json_t *request, struct sst_api_answer *out);
int service_open_cases(struct sst_service *s);
void service_configure_cases(struct sst_service *s, const struct sst_config *to);
int service_cases(void *arg, struct sst_api_answer *out);
int service_case_create(void *arg, const json_t *request, struct sst_api_answer *out);
int service_case_change(void *arg, const char *name, const json_t *request, struct sst_api_answer *out);
int service_signing_key(void *arg, char **pem);

/** Pass the JPEG slot of the main view to storage, once there is one. */
void service_record_view(struct sst_service *s);
/** The share of visits, by the present configuration. */
void service_limit_visits(struct sst_service *s);

#endif
