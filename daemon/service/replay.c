/* A recording that is played (service_internal.h). Its thread alone reads the recording, opens and closes the engine;
 * calls only leave their wishes. Locks: the engine's before the replay's. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

#include <linux/videodev2.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "capture/recording/recording.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"

#define KEPT_NS   INT64_C(10000000000) /* without a request of its client it ends */
#define ANSWER_NS INT64_C(800000000)
#define END_NS    INT64_C(5000000000)
#define GAP_NS    INT64_C(5000000000) /* longer gaps between sets are skipped */
#define POLL_NS   INT64_C(100000000)
#define WAIT_NS   INT64_C(20000000)   /* ... while a picture is awaited */
#define VIEWER_NS INT64_C(2000000000) /* whoever opens a recording is about to watch it */
#define RING_SETS 4
#define SPEED_MIN 0.1
#define SPEED_MAX 16.0

/* Wishes of calls to the thread. */
struct wish {
    bool open, seek, close;
    char recording[64]; /* "": the one that holds the moment */
    int64_t wall_ns;    /* 0: its beginning */
};

struct service_replay {
    struct sst_storage *storage; /* fixed after open */
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    /* under lock */
    bool stop, ended;
    struct sst_config config; /* of the service */
    struct wish wish;
    char id[16];             /* of the recording played; "": none */
    int64_t used_ns;         /* time of the last request of its client */
    bool playing, restarted; /* restarted: playing or its speed changed */
    bool computing;          /* the picture of at_ns after a jump is not there yet */
    double speed;
    unsigned asked, answered; /* requests, and how many the thread has carried out */
    char recording[64];
    int64_t from_ns, to_ns, at_ns; /* wall times */
    int err;                       /* why it could not be opened */
    char error[512];
    struct live_engine *engine; /* NULL: nothing is played yet */
    int users;                  /* calls that use the engine */
    struct array_layout layout;
    /* thread only */
    struct sst_config *used; /* by the engine */
    struct sst_recording *reader;
    struct sst_ring *ring;
    char dir[SST_PATH_MAX]; /* of the recording */
    uint64_t puts;
    int at; /* the set that is shown */
    int64_t zero_ns, zero_wall_ns,
        stamp_ns; /* stamps of sets: zero_ns when their wall time is zero_wall_ns; the last */
    int64_t awaited_ns; /* stamp of the set with the picture that the clock waits for; 0: it runs */
    int64_t computed_ns; /* since when that picture is there */
    int64_t clock_ns, clock_wall_ns, next_ns; /* of playing: the wall time that was due then; the next set's */
    struct sst_recording_set set;
    struct sst_frame frame[SST_CAMERAS_MAX];
};

/* --- sets, thread only -------------------------------------------------------------------------------------------- */

/* Frames that are damaged or gone are missing in the set. @return number of frames */
static int read_frames(struct service_replay *r, struct sst_frameset *set, uint8_t *data[SST_CAMERAS_MAX])
{
    const struct sst_recording_info *info = sst_recording_info(r->reader);
    int present = 0;

    for (int k = 0; k < info->cameras; k++) {
        const struct sst_recording_frame *f = &r->set.frame[k];
        size_t bytes;

        data[k] = NULL;
        if (sst_recording_picture(r->reader, &r->set, k, &data[k], &bytes))
            continue;
        r->frame[k] = (struct sst_frame){ .cam = k,
                                          .fourcc = info->fourcc,
                                          .width = info->width,
                                          .height = info->height,
                                          .stride = f->stride,
                                          .data = data[k],
                                          .bytes = bytes,
                                          .sequence = f->sequence,
                                          .t_ns = set->t_ns,
                                          .faults = f->faults };
        set->frame[k] = &r->frame[k];
        present++;
    }
    return present;
}

/* Stamps grow as the wall time of the sets does, and by 1 us where that goes back: objects keep their speed. */
static int64_t stamp(struct service_replay *r, int64_t wall_ns, bool jump)
{
    int64_t t_ns;

    if (jump) {
        r->zero_ns = sst_clock_now_ns();
        r->zero_wall_ns = wall_ns;
    }
    t_ns = r->zero_ns + (wall_ns - r->zero_wall_ns);
    r->stamp_ns = t_ns > r->stamp_ns ? t_ns : r->stamp_ns + 1000;
    return r->stamp_ns;
}

/* Until the picture of a moment is computed, the one that was recorded is shown, if there is one. */
static void show_preview(struct service_replay *r)
{
    struct engine_preview p = { .t_ns = r->stamp_ns, .wall_ns = r->set.wall_ns };

    if (sst_storage_view_picture(r->dir, &p.wall_ns, &p.set, &p.data, &p.bytes))
        p.data = NULL;
    engine_preview(r->engine, &p);
}

/* Give set i to the engine. After a jump the engine forgets the scene. @return 0, or why it cannot be read */
static int show_set(struct service_replay *r, int i, bool jump)
{
    const int cameras = sst_recording_info(r->reader)->cameras;
    const bool again = jump && r->puts; /* a new engine has nothing to forget */
    struct sst_frameset set = { .cameras = cameras };
    uint8_t *data[SST_CAMERAS_MAX];
    int err = sst_recording_set(r->reader, i, &r->set);

    if (err)
        return err;
    set.index = r->set.index;
    set.wall_ns = r->set.wall_ns;
    set.t_ns = stamp(r, r->set.wall_ns, jump);
    set.present = read_frames(r, &set, data);
    pthread_mutex_lock(&r->lock);
    if (again) {
        r->layout.first = r->puts + 1;
        r->layout.generation++;
    }
    pthread_mutex_unlock(&r->lock);
    if (again)
        engine_configure(r->engine, r->used, true);
    if (jump)
        show_preview(r);
    err = set.present ? sst_ring_put(r->ring, &set) : -ENODATA;
    r->puts += !err;
    for (int k = 0; k < cameras; k++)
        free(data[k]);
    if (err == -ENODATA)
        return err;
    r->at = i;
    pthread_mutex_lock(&r->lock);
    r->at_ns = r->set.wall_ns;
    pthread_mutex_unlock(&r->lock);
    return 0;
}

/* The first readable set from i on. */
static int jump_to(struct service_replay *r, int i)
{
    const int sets = sst_recording_sets(r->reader);
    int err = -ENODATA;

    while (err && i < sets)
        err = show_set(r, i++, true);
    r->next_ns = r->computed_ns = 0;
    r->awaited_ns = err ? 0 : r->stamp_ns;
    return err;
}

/* Wall time of a set; of the next one if it is damaged. @param i  in, out; INT64_MAX: there is none */
static int64_t wall_of(struct service_replay *r, int *i)
{
    for (; *i < sst_recording_sets(r->reader); ++*i)
        if (!sst_recording_set(r->reader, *i, &r->set))
            return r->set.wall_ns;
    return INT64_MAX;
}

/* Play on: of the sets that are due, the last is shown. @return when the next one is due; 0: the end */
static int64_t play(struct service_replay *r, double speed, int64_t at_ns)
{
    const int64_t now_ns = sst_clock_now_ns();
    int next = r->at + 1, due = -1;
    int64_t wall_ns;

    while ((wall_ns = wall_of(r, &next)) != INT64_MAX) {
        const bool gap = wall_ns < at_ns || wall_ns - at_ns > GAP_NS;

        if (gap && due >= 0)
            break;
        if (gap) {
            r->clock_ns = now_ns;
            r->clock_wall_ns = wall_ns;
        }
        if ((double)(wall_ns - r->clock_wall_ns) > (double)(now_ns - r->clock_ns) * speed)
            break;
        at_ns = wall_ns;
        due = next++;
    }
    if (due >= 0 && show_set(r, due, false))
        r->at = due; /* not readable: the next one */
    if (wall_ns == INT64_MAX)
        return 0;
    return r->clock_ns + (int64_t)((double)(wall_ns - r->clock_wall_ns) / speed);
}

/* The first picture after a jump takes long: the clock waits for it, and for a viewer that is about to come.
 * @param computing  out: it is not there yet @return the clock waits */
static bool clock_waits(struct service_replay *r, bool *computing)
{
    const int64_t now_ns = sst_clock_now_ns();
    bool watched;

    *computing = r->awaited_ns && !engine_has_shown(r->engine, r->awaited_ns, &watched);
    if (!r->awaited_ns || *computing)
        return *computing;
    r->computed_ns = r->computed_ns ? r->computed_ns : now_ns;
    if (watched || now_ns - r->computed_ns > VIEWER_NS)
        r->awaited_ns = 0;
    return r->awaited_ns != 0;
}

/* --- opening and closing, thread only ----------------------------------------------------------------------------- */

static void describe(struct array_layout *out, const struct sst_recording_info *info, unsigned generation)
{
    struct sst_array_config *a = &out->config;

    *out = (struct array_layout){ .generation = generation, .first = 1 };
    sst_array_config_defaults(a);
    a->rows = info->rows;
    a->cols = info->cols;
    a->spacing_mm = info->spacing_mm;
    a->fourcc = info->fourcc;
    a->width = info->width;
    a->height = info->height;
    a->rate_hz = info->rate_hz;
    a->bound = info->cameras;
    for (int i = 0; i < info->cameras; i++) {
        a->camera[i].row = info->track[i].row;
        a->camera[i].col = info->track[i].col;
    }
}

/* Memory of a few sets; compressed frames rarely need a byte for each pixel. */
static size_t ring_bytes(const struct sst_recording_info *info)
{
    const bool jpeg = info->fourcc == V4L2_PIX_FMT_MJPEG || info->fourcc == V4L2_PIX_FMT_JPEG;

    return (size_t)RING_SETS * (size_t)info->cameras * (size_t)info->width * (size_t)info->height * (jpeg ? 1 : 2) +
           ((size_t)1 << 20);
}

/* The engine's settings: nothing is recorded or reported. */
static void take_config(struct service_replay *r)
{
    pthread_mutex_lock(&r->lock);
    *r->used = r->config;
    pthread_mutex_unlock(&r->lock);
    r->used->live.enabled = true;
    r->used->zones = 0;
    r->used->storage.mode = SST_RECORD_OFF;
    r->used->storage.triggers = 0;
}

static int open_engine(struct service_replay *r)
{
    const struct sst_recording_info *info = sst_recording_info(r->reader);
    struct engine_config cfg = { .config = r->used, .source = { &r->lock, &r->layout } };
    struct live_engine *engine = NULL;
    int err = sst_ring_create(&r->ring, ring_bytes(info));

    if (err)
        return err;
    r->puts = 0;
    pthread_mutex_lock(&r->lock);
    describe(&r->layout, info, r->layout.generation + 1);
    pthread_mutex_unlock(&r->lock);
    take_config(r);
    cfg.ring = r->ring;
    err = engine_open(&engine, &cfg);
    pthread_mutex_lock(&r->lock);
    r->engine = engine;
    pthread_mutex_unlock(&r->lock);
    return err;
}

static void read_ends(struct service_replay *r)
{
    int first = 0, last = sst_recording_sets(r->reader) - 1;
    const int64_t from_ns = wall_of(r, &first);
    int64_t to_ns = from_ns;

    for (; last > first; last--) {
        if (!sst_recording_set(r->reader, last, &r->set)) {
            to_ns = r->set.wall_ns;
            break;
        }
    }
    pthread_mutex_lock(&r->lock);
    r->from_ns = from_ns;
    r->to_ns = to_ns;
    pthread_mutex_unlock(&r->lock);
}

static int seek(struct service_replay *r, int64_t wall_ns)
{
    int i = 0;
    const int err = wall_ns ? sst_recording_near(r->reader, wall_ns, INT64_MAX, &i) : 0;

    return err ? err : jump_to(r, i);
}

/* @return true: nothing is left of it; false: something hangs */
static bool close_session(struct service_replay *r, int64_t until_ns)
{
    struct live_engine *engine;
    char name[64];

    pthread_mutex_lock(&r->lock);
    engine = r->engine;
    r->engine = NULL; /* another recording may be opened to be played: `playing` stays */
    memcpy(name, r->recording, sizeof(name));
    r->recording[0] = 0;
    pthread_mutex_unlock(&r->lock);
    r->awaited_ns = 0;
    if (engine) {
        engine_stop(engine);
        pthread_mutex_lock(&r->lock);
        while (r->users && sst_cond_wait_until(&r->changed, &r->lock, until_ns))
            ;
        pthread_mutex_unlock(&r->lock);
        if (!engine_join(engine, until_ns)) {
            sst_log_error("the replay of %s hangs: it is left behind", name);
            return false;
        }
        engine_close(engine);
    }
    sst_ring_destroy(r->ring);
    r->ring = NULL;
    sst_recording_close(r->reader);
    r->reader = NULL;
    if (name[0])
        sst_storage_release(r->storage, name);
    return true;
}

static int open_session(struct service_replay *r, const struct wish *w)
{
    char name[64];
    int err = sst_storage_hold(r->storage, w->recording[0] ? w->recording : NULL, w->wall_ns, name, r->dir);

    if (err)
        return err;
    pthread_mutex_lock(&r->lock);
    memcpy(r->recording, name, sizeof(name));
    pthread_mutex_unlock(&r->lock);
    err = sst_recording_open(&r->reader, r->dir);
    if (!err)
        err = sst_recording_sets(r->reader) > 0 ? 0 : -ENODATA;
    if (!err)
        read_ends(r);
    err = err ? err : open_engine(r);
    return err ? err : seek(r, w->wall_ns);
}

static void say(char error[512], const char *why, int err)
{
    if (why[0])
        snprintf(error, 512, "%.500s", why);
    else if (err == -ENOENT)
        snprintf(error, 512, "no recording has that moment, or there is none of that name");
    else if (err == -ENODATA)
        snprintf(error, 512, "nothing of it can be read any more");
    else
        snprintf(error, 512, "the recording cannot be played: %s", strerror(-err));
}

/* --- the thread --------------------------------------------------------------------------------------------------- */

static void carry_out(struct service_replay *r, const struct wish *w)
{
    const bool renew = w->open || w->close;
    char why[SST_LOG_MAX] = "";
    int err = 0;

    sst_log_hold_errors(why);
    if (renew && !close_session(r, sst_clock_now_ns() + END_NS))
        err = -EBUSY;
    if (!err && w->open)
        err = open_session(r, w);
    else if (!err && w->seek && r->reader)
        err = seek(r, w->wall_ns);
    sst_log_hold_errors(NULL);
    if (err && w->open)
        (void)close_session(r, sst_clock_now_ns() + END_NS);
    pthread_mutex_lock(&r->lock);
    r->err = err;
    r->error[0] = 0;
    if (err)
        say(r->error, why, err);
    r->restarted = true;
    pthread_mutex_unlock(&r->lock);
}

static bool has_expired_locked(const struct service_replay *r)
{
    return r->id[0] && sst_clock_now_ns() - r->used_ns > KEPT_NS;
}

/* @return when there is more to do */
static int64_t go_on(struct service_replay *r)
{
    int64_t at_ns, next_ns = 0;
    double speed;
    bool restarted;

    pthread_mutex_lock(&r->lock);
    at_ns = r->at_ns;
    speed = r->speed;
    restarted = r->restarted;
    r->restarted = false;
    pthread_mutex_unlock(&r->lock);
    if (restarted) {
        r->clock_ns = sst_clock_now_ns();
        r->clock_wall_ns = at_ns;
    }
    next_ns = play(r, speed, at_ns);
    pthread_mutex_lock(&r->lock);
    if (!next_ns && !r->restarted)
        r->playing = false;
    pthread_mutex_unlock(&r->lock);
    return next_ns ? next_ns : INT64_MAX;
}

static void *run(void *replay)
{
    struct service_replay *r = replay;
    int64_t due_ns, next_ns;
    bool waits, computing;

    sst_thread_name("sst-replay");
    pthread_mutex_lock(&r->lock);
    while (!r->stop) {
        struct wish w = r->wish;
        const unsigned asked = r->asked;

        r->wish = (struct wish){ 0 };
        if (has_expired_locked(r) && !w.open) {
            w = (struct wish){ .close = true };
            r->id[0] = 0;
            r->playing = false;
        }
        if (w.open || w.seek || w.close) {
            pthread_mutex_unlock(&r->lock);
            carry_out(r, &w);
            pthread_mutex_lock(&r->lock);
            if (r->err && w.open && asked == r->asked)
                r->id[0] = 0;
        }
        r->answered = asked;
        pthread_cond_broadcast(&r->changed);
        due_ns = sst_clock_now_ns() + POLL_NS;
        if (r->engine) {
            pthread_mutex_unlock(&r->lock);
            waits = clock_waits(r, &computing);
            pthread_mutex_lock(&r->lock);
        }
        r->computing = (r->engine && computing) || r->wish.open || r->wish.seek;
        if (r->engine && waits) {
            r->restarted = true; /* the clock begins when it need not wait any more */
            due_ns = sst_clock_now_ns() + WAIT_NS;
        } else if (r->playing && r->engine) {
            pthread_mutex_unlock(&r->lock);
            next_ns = go_on(r);
            due_ns = next_ns < due_ns ? next_ns : due_ns;
            pthread_mutex_lock(&r->lock);
        }
        while (!r->stop && r->asked == r->answered && sst_cond_wait_until(&r->changed, &r->lock, due_ns))
            ;
    }
    pthread_mutex_unlock(&r->lock);
    if (close_session(r, sst_clock_now_ns() + END_NS)) {
        pthread_mutex_lock(&r->lock);
        r->ended = true;
        pthread_cond_broadcast(&r->changed);
        pthread_mutex_unlock(&r->lock);
    }
    return NULL;
}

/* --- for the others ----------------------------------------------------------------------------------------------- */

int replay_open(struct service_replay **out, struct sst_storage *storage, const struct sst_config *config)
{
    struct service_replay *r = calloc(1, sizeof(*r));
    int err;

    if (!r || !(r->used = malloc(sizeof(*r->used)))) {
        free(r);
        return -ENOMEM;
    }
    r->storage = storage;
    r->config = *config;
    r->speed = 1;
    pthread_mutex_init(&r->lock, NULL);
    sst_cond_init(&r->changed);
    err = -pthread_create(&r->thread, NULL, run, r);
    if (err) {
        replay_close(r);
        return err;
    }
    *out = r;
    return 0;
}

void replay_configure(struct service_replay *r, const struct sst_config *config)
{
    pthread_mutex_lock(&r->lock);
    r->config = *config;
    pthread_mutex_unlock(&r->lock);
}

void *replay_take(void *replay)
{
    struct service_replay *r = replay;
    struct live_engine *engine;

    pthread_mutex_lock(&r->lock);
    engine = r->stop ? NULL : r->engine;
    r->users += engine != NULL;
    pthread_mutex_unlock(&r->lock);
    return engine;
}

void replay_release(void *replay)
{
    struct service_replay *r = replay;

    pthread_mutex_lock(&r->lock);
    if (!--r->users)
        pthread_cond_broadcast(&r->changed);
    pthread_mutex_unlock(&r->lock);
}

static json_t *time_json(int64_t wall_ns)
{
    char text[SST_CLOCK_TEXT];

    if (!wall_ns)
        return json_null();
    sst_clock_text(text, wall_ns);
    return json_string(text);
}

/* The state, also where nothing is played. @param id  "": not for the client that asks */
static int describe_state(struct service_replay *r, const char *id, struct sst_api_answer *out)
{
    struct live_engine *engine = replay_take(r);
    struct sst_live_settings settings;
    json_t *live = NULL;

    pthread_mutex_lock(&r->lock);
    settings = r->config.live;
    pthread_mutex_unlock(&r->lock);
    if (engine) {
        live = engine_live_json(engine, &settings);
        replay_release(r);
    }
    pthread_mutex_lock(&r->lock);
    out->body =
        json_pack("{s:o, s:b, s:s, s:o, s:o, s:o, s:b, s:b, s:f, s:s, s:o}", "replay",
                  id[0] ? json_string(id) : json_null(), "open", engine != NULL, "recording", r->recording, "from",
                  time_json(r->from_ns), "to", time_json(r->to_ns), "time", time_json(r->at_ns), "computing",
                  r->computing, "playing", r->playing, "speed", r->speed, "error", r->error, "live",
                  live ? live : json_null());
    pthread_mutex_unlock(&r->lock);
    return out->body ? 0 : -ENOMEM;
}

int replay_state(void *replay, struct sst_api_answer *out)
{
    return describe_state(replay, "", out);
}

/* Wishes of a request, checked. */
struct order {
    const char *id;
    struct wish wish;
    bool play, pause;
    double speed; /* 0: as it is */
};

static int read_order(const json_t *request, struct order *o, char error[512])
{
    static const char *const known[] = { "replay", "recording", "time", "playing", "speed", "close", NULL };
    const json_t *playing = json_object_get(request, "playing"), *speed = json_object_get(request, "speed");
    const json_t *time = json_object_get(request, "time"), *end = json_object_get(request, "close");
    const char *recording = json_string_value(json_object_get(request, "recording"));
    int err = sst_api_members(request, known, error);

    if (err)
        return err;
    *o = (struct order){ .id = json_string_value(json_object_get(request, "replay")) };
    if (json_object_get(request, "recording") && (!recording || !recording[0] || strlen(recording) > 63))
        return sst_api_refuse(error, -EINVAL, "recording must be the name of one; GET /api/v1/recordings lists them");
    if (time && !sst_clock_read(json_string_value(time), &o->wish.wall_ns))
        return sst_api_refuse(error, -EINVAL, "time must be like \"2026-11-21T18:05:00.5Z\"");
    if ((playing && !json_is_boolean(playing)) || (end && !json_is_boolean(end)))
        return sst_api_refuse(error, -EINVAL, "playing and close must be true or false");
    if (speed && (!json_is_number(speed) || !(json_number_value(speed) >= SPEED_MIN) ||
                  !(json_number_value(speed) <= SPEED_MAX)))
        return sst_api_refuse(error, -EINVAL, "speed must be a number from %.10g to %.10g", SPEED_MIN, SPEED_MAX);
    if (!o->id && !recording && !time)
        return sst_api_refuse(error, -EINVAL,
                              "give a recording or a time to play, or the replay of an earlier answer to control it");
    snprintf(o->wish.recording, sizeof(o->wish.recording), "%s", recording ? recording : "");
    o->wish.open = !o->id || recording;
    o->wish.seek = !o->wish.open && time;
    o->wish.close = json_is_true(end);
    o->play = json_is_true(playing);
    o->pause = playing && !o->play;
    o->speed = speed ? json_number_value(speed) : 0;
    return 0;
}

/* Two clients cannot play different moments. */
static int admit_locked(const struct service_replay *r, const struct order *o, char error[512])
{
    const bool mine = o->id && r->id[0] && !strcmp(o->id, r->id);

    if (r->stop)
        return sst_api_refuse(error, -EAGAIN, "the service is ending");
    if (mine || (!o->id && !r->id[0]))
        return 0;
    if (!o->id)
        return sst_api_refuse(error, -EBUSY, "another client plays %s; it is free %d s after that one has left",
                              r->recording[0] ? r->recording : "a recording", (int)(KEPT_NS / 1000000000));
    return sst_api_refuse(error, -ENOENT, "the replay %.32s has ended; open the recording again", o->id);
}

static int name_locked(struct service_replay *r)
{
    uint32_t number;

    if (getrandom(&number, sizeof(number), 0) != sizeof(number))
        return -EIO;
    snprintf(r->id, sizeof(r->id), "r%08x", number);
    r->playing = false;
    r->speed = 1;
    r->at_ns = r->from_ns = r->to_ns = 0;
    return 0;
}

int replay_change(void *replay, const json_t *request, struct sst_api_answer *out)
{
    const int64_t end_ns = sst_clock_now_ns() + ANSWER_NS;
    struct service_replay *r = replay;
    bool failed = false;
    struct order o;
    char id[16];
    int err = read_order(request, &o, out->error);

    if (err)
        return err;
    pthread_mutex_lock(&r->lock);
    err = admit_locked(r, &o, out->error);
    if (!err && !o.id)
        err = name_locked(r);
    if (err) {
        pthread_mutex_unlock(&r->lock);
        return err;
    }
    memcpy(id, r->id, sizeof(id));
    r->used_ns = sst_clock_now_ns();
    if (o.wish.seek && r->to_ns && (o.wish.wall_ns < r->from_ns - GAP_NS || o.wish.wall_ns > r->to_ns + GAP_NS))
        o.wish.open = true; /* another recording has it */
    if (o.wish.open || o.wish.seek || o.wish.close)
        r->wish = o.wish;
    r->computing |= o.wish.open || o.wish.seek;
    if (o.wish.close)
        r->id[0] = 0;
    r->restarted |= o.play || o.pause || o.speed > 0;
    r->playing = (r->playing || o.play) && !o.pause && !o.wish.close;
    r->speed = o.speed > 0 ? o.speed : r->speed;
    r->asked++;
    pthread_cond_broadcast(&r->changed);
    while (r->answered != r->asked && !r->stop && sst_cond_wait_until(&r->changed, &r->lock, end_ns))
        ;
    if (r->answered == r->asked && r->err && (o.wish.open || o.wish.seek)) {
        failed = true;
        err = r->err == -EBADMSG ? -EIO : r->err;
        memcpy(out->error, r->error, sizeof(r->error));
    }
    pthread_mutex_unlock(&r->lock);
    return failed ? err : describe_state(r, o.wish.close ? "" : id, out);
}

void replay_stop(struct service_replay *r)
{
    struct live_engine *engine = replay_take(r);

    if (engine) {
        engine_stop(engine);
        replay_release(r);
    }
    pthread_mutex_lock(&r->lock);
    r->stop = true;
    pthread_cond_broadcast(&r->changed);
    pthread_mutex_unlock(&r->lock);
}

bool replay_join(struct service_replay *r, int64_t until_ns)
{
    bool ended;

    pthread_mutex_lock(&r->lock);
    while (!r->ended && sst_cond_wait_until(&r->changed, &r->lock, until_ns))
        ;
    ended = r->ended;
    pthread_mutex_unlock(&r->lock);
    if (ended)
        pthread_join(r->thread, NULL);
    return ended;
}

void replay_close(struct service_replay *r)
{
    if (!r)
        return;
    pthread_cond_destroy(&r->changed);
    pthread_mutex_destroy(&r->lock);
    free(r->used);
    free(r);
}
