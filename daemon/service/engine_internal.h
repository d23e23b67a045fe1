/* daemon/service/engine_internal.h - state of the live engine, shared by its files: views, requests, visits. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_SERVICE_ENGINE_INTERNAL_H
#define SST_DAEMON_SERVICE_ENGINE_INTERNAL_H

#include "base/log.h"
#include "daemon/service/service_internal.h"

/* --- settings: settings of one view as JSON (docs/integrate/api.md). --- */

struct view_settings {
    struct sst_render_config render; /* focus_px NaN: the default focus; focus_label is found by name when rendering */
    char focus_label[SST_CLASS_NAME_MAX];  /* "": none */
    bool follow;                           /* the focus tracks that label */
    uint32_t follow_track;                 /* ... or this track, as long as it is there; 0: none */
    char remove_label[SST_CLASS_NAME_MAX]; /* of clear pictures; their cut_px NaN: the automatic one */
    bool outline, tint;                    /* of clear pictures */
    bool outline_moving;                   /* of clear pictures: of removed tracks */
    bool keep_moving;                      /* clear pictures remove no track */
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
    struct sst_livepicture *picture; /* live thread only; NULL: main's, while its settings are the same */
    bool alone;                      /* has a picture of its own with any settings: something was removed by a click */
    uint64_t rendering;              /* number of the rendering that its picture comes from; live thread */
    uint64_t shown_rendering; /* number of the rendering that its clients have, and its decoration; live thread */
    enum sst_livepicture_outline shown_outline;
    bool shown_tint;
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
    uint64_t taken, passed; /* sets processed or watched, and passed over for newer ones */
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
    bool by_size;   /* the label is by size and motion */
    bool announced; /* its first event has been emitted */
    unsigned zones; /* that it has been in, and lines that it has crossed */
    struct visit_line line[SST_ZONES_MAX];
    struct visit_crossing crossing[VISIT_CROSSINGS]; /* the last ones */
    int crossings;
    int64_t from_ns, from_wall_ns;
    double nearest_px;
    struct visit_point path[VISIT_POINTS], last; /* where it stood */
    int points;
    double height_px; /* in the last set */
    double box[4];    /* fractions of the picture, in the set of its best picture */
    double best;      /* share of the picture that it took there */
    int pictures;
    bool of_camera; /* one picture is the reference camera's */
    int64_t picture_ns;
};

/** Size and motion of a track. */
struct sized {
    uint32_t id;
    double height_m, speed_m_s; /* NaN: not known */
    int sets, fits;             /* in which its height was known, was a person's */
    bool walked, ran;
    bool by_size;  /* its label is by these */
    double from_m; /* where its walk is measured from, since ... */
    int64_t from_ns;
};

/** An arrival of the clear picture, as of the last set with it. */
struct engine_unconfirmed {
    uint32_t id, track; /* track: at the same place, seen before; 0: none */
    struct sst_livepicture_arrival at;
    int64_t t_ns;
};

/** A visit, or its end, that a line may be crossed after: a new track may go on where it was last. */
struct visit_lost {
    struct visit_point last;
    struct visit_line line[SST_ZONES_MAX];
    int label;
    double height_px;
};

#define VISITS_LOST 8

struct live_engine {
    /* fixed after open */
    struct sst_ring *ring;
    struct array_source source;
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
    struct sst_posed poses; /* of cameras that stand anywhere; empty: a lattice */
    struct sst_live_config live_config;
    struct sst_live_input input;   /* of the last set */
    struct sst_live_report report; /* about it */
    struct array_layout layout;
    char model[SST_PATH_MAX], device[SST_CONFIG_TEXT_MAX];
    char said[SST_LOG_MAX]; /* last error of pictures */
    uint64_t last;          /* number of the last set */
    int64_t last_ns, retry_ns;
    int64_t updated_ns; /* when the light field was last brought up to date */
    bool moved;         /* a watched set has changes that are not processed */
    bool moving;        /* something moves in a picture of the last set */
    uint64_t set_index; /* the set that the pictures show; its time zero and wall time */
    int64_t set_t_ns, set_wall_ns;
    int64_t tried_t_ns;    /* the last set that was processed, or could not be; 0: none */
    bool latency_due;      /* the next pictures are the first of a set */
    int notice_at;         /* the view that was measured last */
    bool notice_whole;     /* all views were measured */
    int64_t notice_due_ns; /* when the next one is */
    struct visit visit[SST_LIVE_TRACKS];
    int visits;
    struct visit_lost lost[VISITS_LOST];
    int losts;
    struct sized sized[SST_LIVE_TRACKS]; /* changed under lock, too */
    int sizeds;
    int64_t pace_s, pace_from_s, pace_turn_s; /* last looked at; not before; another state is seen since; 0: none */
    uint64_t renderings;                      /* of pictures of views, so far; live thread */
    struct sst_livepicture *visit_picture;    /* NULL until the first */
    struct sst_jpeg_encoder *encoder;         /* NULL until the first picture */
    struct sst_image overlay_image;           /* of labels or disparities; empty until the first */

    /* under lock */
    struct sst_config config;
    unsigned config_count, config_seen;
    bool refit;         /* the ground is to be fitted again */
    bool unmasked;      /* the array has other privacy masks than `config`, for a moment */
    bool zones_changed; /* zones of `config` are not in `live` yet */
    bool stop, ended, camera_ended, check_runs, check_ended, notice_runs, notice_ended;
    unsigned notice_count; /* light fields */
    struct sst_notice_view noticed_view[SST_MAX_VIEWS];
    int64_t interaction_ns; /* when a client last changed settings; 0: never */
    int64_t check_due_ns;   /* when the calibration is to be checked next; 0: not known yet */
    struct engine_state state;
    struct second second[RATE_SLOTS];
    uint64_t update;     /* states of the light field */
    bool behind;         /* the last set was only watched */
    int64_t served_t_ns; /* tried_t_ns, when its pictures were rendered */
    struct view view[VIEWS_MAX];
    struct shared overlay[2], camera[SST_CAMERAS_MAX];
    struct engine_preview preview;
    struct request request;
    struct sst_classes classes;
    float share[256];      /* of the reference view, by label */
    int64_t share_ns[256]; /* since when it is worth a chip; 0: it is not */
    struct sst_live_track track[SST_LIVE_TRACKS];
    int tracks;
    uint64_t tracks_set; /* the set that they are of, and its time */
    int64_t tracks_t_ns, tracks_wall_ns;
    struct engine_unconfirmed unconfirmed[SST_LIVEPICTURE_ARRIVALS];
    int unconfirmeds;
    uint32_t unconfirmed_ids; /* so far */
    int64_t arrivals_t_ns;    /* set whose arrivals are among them */
};

/* engine_state.c */
/** Note the work of the devices of pictures and labels since the last call, and the events of a loss or return. Live
 *  thread. */
void engine_follow_device(struct live_engine *v);
/** Count processed sets, 0 or 1, and their processor time in their second. */
void engine_note_second_locked(struct live_engine *v, const struct sst_live_report *r, int sets);
/** Count sets that were passed over for newer ones. */
void engine_note_passed_locked(struct live_engine *v, uint64_t sets);
/** Note the results of a set. @param wait_ns  from its trigger until it was processed */
void engine_note_set_locked(struct live_engine *v, const struct sst_live_report *r, int64_t wait_ns);
/** Count the work that followed the picture. @param r  of sst_live_follow() alone */
void engine_note_rest_locked(struct live_engine *v, const struct sst_live_report *r);
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
/** Drop the pictures of all slots, and show no later picture until the array has its new masks. */
void engine_forget_shown(struct live_engine *v);
/** The array was opened. @return it still has other masks than the configuration */
bool engine_masks_follow(struct live_engine *v);
/** Serve engine_pick() and engine_remove().  Live thread. */
/** The view of an id; NULL: there is none. Locked. */
struct view *engine_view_find_locked(struct live_engine *v, const char *id);
/** @return 0 if the client may change the view, else -EPERM with one sentence */
int engine_view_check_client(const struct view *e, const char *client, char error[512]);
/** Is the picture of main also this view's? */
bool engine_view_shows_main(struct live_engine *v, const struct view *e, const struct view_settings *settings);
/** Render a view's picture if the shown one is out of date; asked: also without clients. @return a picture was made */
bool engine_view_publish(struct live_engine *v, struct view *e, bool asked, int64_t ns[2]);
/** Time until which a picture or an answer is waited for. */
int64_t engine_end_of_wait(void);

/* engine_requests.c: serve the request of another thread, if there is one */
void engine_serve(struct live_engine *v);

/* engine_preview.c */
/** Is there one for this view? */
bool engine_preview_fits_locked(const struct live_engine *v, const struct view *e);
void engine_preview_show_locked(struct live_engine *v, struct view *e);
void engine_preview_end(struct live_engine *v);

/* engine_tracks.c */
/** Tracks of the last set, for views, clients and visits. Live thread. */
void engine_tracks_follow(struct live_engine *v);
/** Follow the arrivals of the clear picture, until tracks are as new. They may be chance: they get a box and nothing
 * else.
 *  @param shown  a picture of the last set, before viewers have it: the first with arrivals counts; NULL: none */
void engine_unconfirmed_follow_locked(struct live_engine *v, const struct sst_livepicture_clear *shown);
/** The track of this id, or at a point of the reference view at about this disparity. NULL: none */
const struct sst_live_track *engine_track_locked(const struct live_engine *v, uint32_t id);
const struct sst_live_track *engine_track_at_locked(const struct live_engine *v, double x, double y, double disp_px);
json_t *engine_track_json_locked(const struct live_engine *v, const struct sst_live_track *t);

/* engine_names.c; the first on the live thread */
/** Label the tracks of a set that the network has not labelled. */
void engine_names_follow(struct live_engine *v, struct sst_live_track *track, int n);
/** NULL: not known */
const struct sized *engine_sized(const struct live_engine *v, uint32_t id);
/** "network", "size and motion"; "": it has no label */
const char *engine_named_by(const struct live_engine *v, const struct sst_live_track *t);
/** Note the tracks that the automatic cut removes. */
void engine_removed_locked(struct live_engine *v);

/* engine_pace.c */
/** Notice whether the machine is too slow. Live thread. */
void engine_pace_follow(struct live_engine *v);
/** Is it, at these rates of processed and due sets? @param slow  it was */
bool engine_pace_slow(double done_hz, double due_hz, bool slow);

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
bool engine_wanted(struct sst_slot *slot, int64_t used_ns);
/** Does a client need a picture of a view, of labels or disparities, or an answer about one? */
bool engine_seen_locked(const struct live_engine *v);
/** May an event start a recording of the main view, which begins some time before? */
bool engine_armed_locked(const struct live_engine *v);

/* engine_posed.c: arrays without a lattice; all on the live thread */
/** Poses of the configuration, if it has some, for v->live_config. @return as sst_posed_array_read() */
SST_MUST_CHECK int engine_posed_describe(struct live_engine *v, const struct sst_live_settings *settings);
/** Pass on a demand to fit the ground, and note the surface for the status. */
void engine_posed_follow(struct live_engine *v);

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
