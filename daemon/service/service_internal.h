/* daemon/service/service_internal.h - private declarations of this folder; code outside of it includes the public
 * headers. */
#ifndef SST_DAEMON_SERVICE_SERVICE_INTERNAL_H
#define SST_DAEMON_SERVICE_SERVICE_INTERNAL_H

#include <jansson.h>
#include <pthread.h>
#include <stdio.h>

#include "base/base.h"
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
#include "daemon/service/service.h"
#include "daemon/storage/storage.h"
#include "daemon/visits/visits.h"
#include "pipeline/live/live.h"
#include "pipeline/method/process/notice.h"
#include "pipeline/method/render/render.h"

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
    uint64_t bucket[SST_BUCKETS];
    double rate_hz;  /* frames in sets, over the last second */
    double skew_us;  /* its stamps less the median of their sets, smoothed */
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

unsigned array_generation(void *array); /* a struct service_array; also a source of layouts for an engine */
void array_layout(void *array, struct array_layout *out);

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
    bool misaligned;                 /* which was that cameras have moved, or worse */
    struct sst_notices noticed;      /* of the pictures, without views that are late */
    int noticed_views;               /* that it is of; 0: not measured yet */
};

/** Pictures come, but the range of disparities or the cut has only just been found. */
bool engine_settling(const struct engine_state *v);

/** Where the cameras of the ring's sets are: in the array, or in a recording. */
struct engine_source {
    void *arg;
    unsigned (*generation)(void *arg);
    void (*layout)(void *arg, struct array_layout *out);
};

struct engine_config {
    const struct sst_config *config; /* copied */
    struct sst_ring *ring;           /* this and all below must outlive the engine */
    struct engine_source source;
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
    struct service_array *array;
    struct live_engine *engine;
    struct service_replay *replay;
    struct sst_http *http; /* set under lock: its clients send requests before it is open */
    struct sst_hooks *hooks;
    struct sst_counters counters;
    /* main thread */
    unsigned generation;    /* of the layout that was passed to storage */
    int64_t wall_offset_ns; /* wall less monotonic */
    int64_t cpu_ns, cpu_at_ns;
    struct array_state array_now; /* the last state; too large for a stack */
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

/** "2026-11-21T18:05:00Z", with a fraction if need be. */
bool service_read_time(const char *text, int64_t *wall_ns);

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
    double range_px[2];
    struct sst_spread latency_ms, stage_ms[ENGINE_STAGES];
    double stage_sum_ms[ENGINE_STAGES];
    const char *device_reason, *labels_reason, *on_cpu[16];
    int on_cpu_count;
    uint64_t not_finite;
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

/* zones.c: zones drawn on the page, kept in web.zones_file */
int service_zones(void *arg, struct sst_api_answer *out);
int service_zones_change(void *arg, const json_t *request, struct sst_api_answer *out);

/** Pass the JPEG slot of the main view to storage, once there is one. */
void service_record_view(struct sst_service *s);
/** The share of visits, by the present configuration. */
void service_limit_visits(struct sst_service *s);

/* --- settings: settings of one view as JSON (docs/integrate/api.md). --- */

struct view_settings {
    struct sst_render_config render; /* focus_px NaN: the default focus; focus_label is found by name when rendering */
    char focus_label[SST_CLASS_NAME_MAX];  /* "": none */
    bool follow;                           /* the focus tracks that label */
    uint32_t follow_track;                 /* ... or this track, as long as it is there; 0: none */
    char remove_label[SST_CLASS_NAME_MAX]; /* of clear pictures; their cut_px NaN: the automatic one */
    bool outline, tint;                    /* of clear pictures */
};

void view_settings_defaults(struct view_settings *s, const struct sst_live_settings *config);

/** Apply the defaults that a new configuration changes; other settings keep the clients' values. */
void view_settings_follow(struct view_settings *s, const struct sst_live_settings *from,
                          const struct sst_live_settings *to);

/**
 * Apply the members of an object; missing ones keep their values.
 * @param error  out, one sentence on failure
 * @return 0, -EINVAL (s untouched)
 */
SST_MUST_CHECK int view_settings_take(struct view_settings *s, const json_t *from, char error[512]);

/** NULL: no memory. */
json_t *view_settings_json(const struct view_settings *s);

/* --- state behind live_engine; used by the files of live_engine only --- */

#define VIEWS_MAX  17                   /* "main" and the viewers' */
#define WANTED_NS  INT64_C(5000000000)  /* a picture that was requested once is rendered for this long */
#define EXPIRY_NS  INT64_C(30000000000) /* a view without viewers goes after this */
#define FRESH_MS   800                  /* a picture is waited for no longer */
#define STARTED_MS 2000                 /* and the set begun by the live thread, for this long in addition */
#define RATE_SLOTS 16                   /* seconds that rates are averaged over, and some */

/** One view. */
struct view {
    bool used;
    char id[16];
    char client[96]; /* client that may change it; "": only controlling ones */
    struct view_settings settings;
    unsigned version;       /* of the settings */
    unsigned shown_version; /* version that its picture shows */
    uint64_t shown_update;  /* state of the light field that its picture shows */
    int64_t shown_t_ns;     /* of a recording: the set that its picture shows */
    double shown_focus_px;
    double track_px;                    /* where the track that it follows was last; live thread */
    struct sst_livepicture_clear shown; /* of its picture */
    int64_t used_ns;                    /* time of the last request for it */
    struct sst_slot *slot;
    struct sst_livepicture *picture; /* live thread only */
};

/** A picture shared by all clients: of a camera, of labels or disparities. */
struct shared {
    struct sst_slot *slot;
    int64_t used_ns;
    uint64_t shown; /* update, or number of the set */
};

enum request_kind {
    REQUEST_PICK = 0,
    REQUEST_TOGGLE = 1, /* remove the thing at a point, or bring it back */
    REQUEST_RESTORE = 2,
};

/** Work done by the live thread for another thread, which waits for it. */
struct request {
    enum request_kind kind;
    bool pending, started, done; /* started: it will be done, so that its answer is waited for */
    unsigned number;             /* a request that timed out is not answered */
    char id[16];
    int x, y, err;
    struct sst_livepicture_pick pick;
    bool removed;
    int objects;
};

/** Counts of one second. */
struct second {
    int64_t s;
    uint64_t sets, tiles, changed;
    int64_t cpu_ns;
};

#define VISIT_POINTS 32

struct visit_point {
    int64_t t_ns;
    double x, y, disp_px; /* fractions of the picture */
};

/** Where a visit is beside a line of the zones. Zeroed: not known. */
struct visit_line {
    int side;     /* the one on which it was last clear of the line: 1: right, -1: left; 0: not known */
    bool between; /* it last went over between the ends of the line, not beside them */
};

#define VISIT_CROSSINGS 8

struct visit_crossing {
    int zone; /* a line */
    bool forward;
    int64_t t_ns;
};

/** A track from its report until it has gone. */
struct visit {
    uint32_t id;
    bool there;  /* in this set */
    bool hidden; /* it was seen behind the foreground */
    int label;
    bool announced; /* its first event has been emitted */
    unsigned zones; /* that it has been in, and lines that it has crossed */
    struct visit_line line[SST_ZONES_MAX];
    struct visit_crossing crossing[VISIT_CROSSINGS]; /* the last ones */
    int crossings;
    int64_t from_ns, from_wall_ns;
    double nearest_px;
    struct visit_point path[VISIT_POINTS], last; /* where it stood */
    int points;
    double box[4]; /* fractions of the picture, in the set of its best picture */
    double best;   /* share of the picture that it took there */
    int pictures;
    bool of_camera; /* one picture is the reference camera's */
    int64_t picture_ns;
};

struct live_engine {
    /* fixed after open */
    struct sst_ring *ring;
    struct engine_source source;
    struct sst_storage *storage; /* this and the next two: NULL of a recording */
    struct sst_visits *kept;
    struct sst_events *events;
    pthread_t thread, camera_thread, check_thread, notice_thread;
    bool camera_runs;
    pthread_mutex_t lock;
    pthread_cond_t changed;

    /* live thread */
    struct sst_live *live; /* set and cleared under lock, so that stop can cancel it */
    struct sst_use_calibration use;
    struct sst_live_config live_config;
    struct sst_live_input input;   /* of the last set */
    struct sst_live_report report; /* about it */
    struct array_layout layout;
    char model[SST_PATH_MAX], device[SST_CONFIG_TEXT_MAX];
    uint64_t last; /* number of the last set */
    int64_t last_ns, retry_ns;
    int64_t updated_ns; /* when the light field was last brought up to date */
    bool moved;         /* a watched set has changes that are not processed */
    uint64_t set_index; /* the set that the pictures show; its time zero and wall time */
    int64_t set_t_ns, set_wall_ns;
    int64_t tried_t_ns; /* the last set that was processed, or could not be; 0: none */
    bool latency_due; /* the next pictures are the first of a set */
    int notice_at;    /* the view that was measured last */
    bool notice_whole;     /* all views were measured */
    int64_t notice_due_ns; /* when the next one is */
    struct visit visit[SST_LIVE_TRACKS];
    int visits;
    struct sst_livepicture *visit_picture; /* NULL until the first */
    struct sst_jpeg_encoder *encoder;      /* NULL until the first picture */
    struct sst_image overlay_image;        /* of labels or disparities; empty until the first */

    /* under lock */
    struct sst_config config;
    unsigned config_count, config_seen;
    bool zones_changed; /* zones of `config` are not in `live` yet */
    bool stop, ended, camera_ended, check_runs, check_ended, notice_runs, notice_ended;
    unsigned notice_count; /* light fields */
    struct sst_notice_view noticed_view[SST_MAX_VIEWS];
    int64_t interaction_ns; /* when a client last changed settings; 0: never */
    int64_t check_due_ns;   /* when the calibration is to be checked next; 0: not known yet */
    struct engine_state state;
    struct second second[RATE_SLOTS];
    uint64_t update; /* states of the light field */
    bool behind;     /* the last set was only watched */
    int64_t served_t_ns; /* tried_t_ns, when its pictures were rendered */
    struct view view[VIEWS_MAX];
    struct shared overlay[2], camera[SST_CAMERAS_MAX];
    struct request request;
    struct sst_classes classes;
    float share[256]; /* of the reference view, by label */
    struct sst_live_track track[SST_LIVE_TRACKS];
    int tracks;
    uint64_t tracks_set; /* the set that they are of, and its time */
    int64_t tracks_t_ns;
};

/* engine_state.c */
/** Note the work of the devices of pictures and labels since the last call, and the events of a loss or return. Live
 *  thread. */
void engine_follow_device(struct live_engine *v);
/** Count processed sets, 0 or 1, and their processor time in their second. */
void engine_note_second_locked(struct live_engine *v, const struct sst_live_report *r, int sets);
/** Note the results of a set. @param wait_ns  from its trigger until it was processed */
void engine_note_set_locked(struct live_engine *v, const struct sst_live_report *r, int64_t wait_ns);
/** Note ranges and focus, for the sliders of the page. Live thread. @param changed  disparities may have */
void engine_note_scene(struct live_engine *v, bool changed);

/* engine_views.c */
int engine_views_open(struct live_engine *v);
/** Apply a new configuration to the main view, before it becomes the current one. */
void engine_views_follow_locked(struct live_engine *v, const struct sst_live_settings *to);
void engine_views_close(struct live_engine *v);
/** Render every wanted picture that is out of date. Live thread. */
void engine_publish(struct live_engine *v);
/** Encode a picture. Live thread. @param out  to free with free() @return 0, -ENOMEM */
SST_MUST_CHECK int engine_jpeg(struct live_engine *v, const struct sst_image *image, int quality, uint8_t **out,
                               size_t *bytes);
/** Discard all rendered pictures before the light field is freed.  Live thread. */
void engine_forget_pictures(struct live_engine *v);
/** Serve engine_pick() and engine_remove().  Live thread. */
void engine_serve(struct live_engine *v);

/* engine_tracks.c */
/** Tracks of the last set, and the events of new and ended ones. Live thread. */
void engine_tracks_follow(struct live_engine *v);
/** The track of this id, or at a point of the reference view at about this disparity. NULL: none */
const struct sst_live_track *engine_track_locked(const struct live_engine *v, uint32_t id);
const struct sst_live_track *engine_track_at_locked(const struct live_engine *v, double x, double y, double disp_px);
json_t *engine_track_json_locked(const struct live_engine *v, const struct sst_live_track *t);

/* engine_visits.c */
/** Visits of these tracks, their events and pictures. Live thread. */
void engine_visits_follow(struct live_engine *v, const struct sst_live_track *track, int n);
/** Is there a visit now that a trigger asks for? Live thread. */
bool engine_visit_lasts_locked(const struct live_engine *v, const struct sst_record_trigger *t);
/** The zones are others: zones and lines that visits have met count no more. Live thread. */
void engine_visits_forget_zones(struct live_engine *v);
/** NaN: not known without a calibration. */
double engine_distance_m(const struct live_engine *v, double disp_px);
/** "": none */
const char *engine_label_name(const struct live_engine *v, int label);

/* engine_lines.c */
/** The lines that a visit crosses on its way from a point to where it is. @param height_px  of the visitor
 *  @return number */
int engine_lines_follow(struct live_engine *v, struct visit *a, const struct visit_point *from, double height_px,
                        struct visit_crossing out[SST_ZONES_MAX]);

/* engine_cameras.c */
void *engine_run_cameras(void *arg);
/** Get the JPEG slot of a shared picture; created if there is none.  @return 0, -ENOMEM */
int engine_share_locked(struct shared *s, struct sst_slot **out);
bool engine_wanted(struct sst_slot *slot, int64_t used_ns);
/** Does a client need a picture of a view, of labels or disparities, or an answer about one? */
bool engine_seen_locked(const struct live_engine *v);
/** May an event start a recording of the main view, which begins some time before? */
bool engine_armed_locked(const struct live_engine *v);

/* engine_check.c; both on the live thread, join also after it has ended */
void engine_check_by_time(struct live_engine *v);
void engine_check_join(struct live_engine *v);

/* engine_notice.c; all on the live thread, join also after it has ended */
/** Look at the next view if it is time for one, while the frames of a set are borrowed. */
void engine_notice_follow(struct live_engine *v);
/** The light field is another one. */
void engine_notice_forget(struct live_engine *v);
void engine_notice_join(struct live_engine *v);

#endif
