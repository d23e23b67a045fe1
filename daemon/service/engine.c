/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/text.h"
#include "base/thread.h"
#include "pipeline/method/network/model_path.h"

#define POLL_MS  30
#define RETRY_NS INT64_C(10000000000)
/* While a user drags a control (settings change at least this often), the last set is rendered again before the next
 * one is processed, for at most as long as the last set took: sets lose half of their time at most. */
#define DRAG_NS            INT64_C(150000000)
#define INTERACTION_MAX_NS INT64_C(500000000)
/* Age that maps may reach while they are not needed: the first viewer has to wait until the changes since are
 * computed. */
#define KEEP_NS   INT64_C(5000000000)
#define EVENTS_NS INT64_C(500000000)
/* Capturing comes first: this thread and its loops use all processors. */
#define LIVE_NICE 5
/* One part in this number of the device's memory is the network's. */
#define LABELS_SHARE 4

/* --- the light field that is followed ----------------------------------------------------------------------------- */

/** Labels that start recordings, but are none of the network's: one that is misspelt would never record. */
static void name_unknown_locked(const struct live_engine *v, char out[512])
{
    out[0] = 0;
    for (int i = 0; i < v->config.storage.triggers && v->classes.count; i++) {
        const char *label = v->config.storage.trigger[i].label;

        if (label[0] && !sst_classes_find(&v->classes, label))
            sst_text_add(out, 512, "%s%s", *out ? ", " : "", label);
    }
}

static void log_unknown_labels(const char *labels)
{
    if (*labels)
        sst_log_warning("storage: record_on: the network knows no class %s, which will never start a recording; `curl "
                        "--unix-socket SOCKET http://sst/api/v1/labels` lists them",
                        labels);
}

static void close_live(struct live_engine *v)
{
    struct sst_live *live = v->live;

    if (!live)
        return;
    engine_forget_pictures(v);
    engine_notice_forget(v);
    pthread_mutex_lock(&v->lock);
    v->live = NULL;
    v->served_t_ns = 0;
    v->state.ready = v->state.counted = v->refit = v->state.too_slow = false;
    v->pace_from_s = v->losts = v->sizeds = v->unconfirmeds = 0;
    v->state.levels = (struct sst_samples){ 0, 0 };
    v->state.surface = (struct sst_live_surface){ .distance_mm = NAN, .tilt_deg = NAN };
    v->state.cut_px = v->state.searched_min_px = v->state.searched_max_px = NAN;
    pthread_mutex_unlock(&v->lock);
    engine_tracks_follow(v);
    if (v->kept)
        engine_visits_follow(v, NULL, 0);
    sst_live_close(live);
    sst_use_calibration_fini(&v->use);
    sst_posed_fini(&v->poses);
    /* Of the sets before nothing is rendered any more. */
    v->set_index = 0;
    v->set_t_ns = v->set_wall_ns = v->tried_t_ns = 0;
}

void engine_zones(struct sst_live_zone *out, const struct sst_config *c)
{
    for (int i = 0; i < c->zones; i++) {
        const struct sst_zone *z = &c->zone[i];

        _Static_assert(SST_LIVE_ZONE_POINTS >= SST_ZONE_POINTS && SST_LIVE_ZONES >= SST_ZONES_MAX, "zones fit");
        out[i] =
            (struct sst_live_zone){ .near_px = z->near_px, .far_px = z->far_px, .mask = z->mask && !*z->labels[0] };
        out[i].points = z->line ? 0 : sst_zone_corners(z, out[i].x, out[i].y);
    }
}

/** Settings from the configuration and the array. @return 0 or an error, logged */
static int describe(struct live_engine *v, const struct sst_config *c)
{
    const struct sst_array_config *a = &v->layout.config;
    struct sst_live_config *l = &v->live_config;
    const uint64_t bytes = (uint64_t)c->live.device_memory_mb << 20;
    int err = 0;

    *l = (struct sst_live_config){
        .rows = a->rows,
        .cols = a->cols,
        .fourcc = a->fourcc,
        .width = a->width,
        .height = a->height,
        .precision = SST_PRECISION_AUTO,
        .levels = { c->live.black_level, c->live.white_level },
        .range_min_px = c->live.range_min_px,
        .range_max_px = c->live.range_max_px,
        .threads = c->live.threads,
        .skip_change = c->live.skip_change,
        .skip_labels = c->live.skip_labels,
        .device = v->device,
        .device_memory_bytes = bytes - bytes / LABELS_SHARE,
        .device_label_bytes = bytes / LABELS_SHARE,
        .background = true,
        .alarms_per_hour = c->live.hidden_alarms_per_hour,
        .zones = c->zones,
    };
    snprintf(v->device, sizeof(v->device), "%s", c->live.device);
    engine_zones(l->zone, c);
    for (int i = 0; i < a->bound; i++)
        l->present[a->camera[i].row * a->cols + a->camera[i].col] = true;
    sst_use_calibration_defaults(&v->use);
    if (c->live.calibration[0]) {
        err = sst_use_calibration_read(&v->use, c->live.calibration);
        v->use.plan.plane_mm = c->live.plane_mm;
        l->calibration = &v->use;
    }
    err = err ? err : engine_posed_describe(v, &c->live);
    if (!err && !l->posed.poses)
        err = c->live.model[0] ? sst_model_resolve(v->model, c->live.model)
                               : sst_model_path(v->model, "pspnet-small.onnx");
    l->model = l->posed.poses ? NULL : v->model;
    return err;
}

/** The array and its settings are known: follow it. */
static void open_live(struct live_engine *v)
{
    struct sst_config *c = malloc(sizeof(*c));
    char why[SST_LOG_MAX] = "", unknown[512] = "";
    struct sst_live *live = NULL;
    bool tell;
    int err = -ENOMEM;

    if (c) {
        pthread_mutex_lock(&v->lock);
        *c = v->config;
        v->config_seen = v->config_count;
        pthread_mutex_unlock(&v->lock);
        sst_log_hold_errors(why);
        err = describe(v, c);
        err = err ? err : sst_live_open(&live, &v->live_config);
        sst_log_hold_errors(NULL);
    }
    pthread_mutex_lock(&v->lock);
    tell = err && strcmp(v->state.reason, why);
    snprintf(v->state.reason, sizeof(v->state.reason), "%s", err ? why : "");
    v->live = live;
    if (live && v->stop)
        sst_live_cancel(live);
    if (live)
        v->classes = sst_live_lightfield(live)->classes;
    v->state.posed = v->live_config.posed.poses;
    v->state.on_device = v->state.labels_on_device = false;
    v->state.device = (struct sst_render_device_report){ 0 };
    v->state.label_device = (struct sst_network_device_report){ 0 };
    v->check_due_ns = 0; /* there may be another calibration */
    if (live)
        name_unknown_locked(v, unknown);
    pthread_mutex_unlock(&v->lock);
    if (tell)
        sst_log_error("%s", why);
    if (live)
        engine_follow_device(v);
    log_unknown_labels(unknown);
    if (err) {
        sst_use_calibration_fini(&v->use);
        sst_posed_fini(&v->poses);
    }
    v->retry_ns = err ? sst_clock_now_ns() + RETRY_NS : 0;
    v->last = v->layout.first - 1;
    free(c);
}

static bool same_array(const struct sst_array_config *a, const struct sst_array_config *b)
{
    bool same = a->rows == b->rows && a->cols == b->cols && a->width == b->width && a->height == b->height &&
                a->fourcc == b->fourcc && a->bound == b->bound;

    for (int i = 0; same && i < a->bound; i++)
        same = a->camera[i].row == b->camera[i].row && a->camera[i].col == b->camera[i].col;
    return same;
}

/** Follow the array's openings and the configuration's changes. @return there is a light field to bring up to date */
static bool follow(struct live_engine *v)
{
    struct array_layout now;
    bool restart, enabled, unmasked;

    pthread_mutex_lock(&v->lock);
    restart = v->config_seen != v->config_count;
    enabled = v->config.live.enabled;
    v->state.enabled = enabled;
    if (!enabled)
        v->state.reason[0] = 0;
    unmasked = v->unmasked;
    pthread_mutex_unlock(&v->lock);
    /* After `restart`: sets from before it are not processed again. */
    if (unmasked)
        engine_forget_shown(v);
    if (array_layout(v->source, v->layout.generation, &now) != v->layout.generation) {
        if (same_array(&v->layout.config, &now.config) && !unmasked)
            v->last = now.first - 1 > v->last ? now.first - 1 : v->last;
        else
            restart = true;
        v->layout = now;
        unmasked = unmasked && engine_masks_follow(v);
    }
    if (restart || !enabled || unmasked)
        close_live(v);
    if (unmasked) /* nothing of sets without the masks is shown or remembered */
        return false;
    if (!enabled || !v->layout.generation)
        return false;
    if (!v->live && (restart || sst_clock_now_ns() >= v->retry_ns))
        open_live(v);
    return v->live != NULL;
}

/* --- sets --------------------------------------------------------------------------------------------------------- */

/** Recording on event follows the changes. */
static void notify_storage(struct live_engine *v, const struct sst_kept *kept, const struct sst_live_report *r)
{
    struct sst_seen seen = { .t_ns = kept->set.t_ns, .zones = v->live_config.zones };

    if (!v->storage)
        return;
    for (int i = 0; i < seen.zones; i++)
        seen.changed[i] = r->zone[i].changed;
    seen.changed[seen.zones] = r->zone[SST_LIVE_ZONES].changed;
    pthread_mutex_lock(&v->lock);
    for (int i = 0; i < v->config.storage.triggers; i++) {
        const struct sst_record_trigger *t = &v->config.storage.trigger[i];
        const int label = t->label[0] ? sst_classes_find(&v->classes, t->label) : 0;

        if (t->visit)
            seen.label[i] = engine_visit_lasts_locked(v, t);
        else if (label && t->zone < seen.zones)
            seen.label[i] = (double)r->zone[t->zone < 0 ? SST_LIVE_ZONES : t->zone].label[label];
    }
    pthread_mutex_unlock(&v->lock);
    sst_storage_seen(v->storage, &seen);
}

static void fill_input(struct live_engine *v, const struct sst_kept *kept)
{
    struct sst_live_input *in = &v->input;

    memset(in, 0, sizeof(*in));
    in->picture_first = v->events != NULL; /* in a recording picture and tracks are of one moment */
    in->moving = v->moving;
    in->set = kept->set.index;
    in->t_ns = kept->set.t_ns;
    for (int i = 0; i < kept->set.cameras && i < v->layout.config.bound; i++) {
        const struct sst_config_camera *at = &v->layout.config.camera[i];
        const struct sst_frame *f = kept->set.frame[i];

        if (f && f->bytes) {
            const int view = at->row * v->layout.config.cols + at->col;

            in->frame[view].data = f->data;
            in->frame[view].bytes = f->bytes;
            in->frame[view].stride = f->stride;
        }
    }
}

/** @return 0, or an error: logged, or stopped */
static int update(struct live_engine *v, const struct sst_kept *kept, uint64_t dropped)
{
    const int64_t start_ns = sst_clock_now_ns();
    const int err = sst_live_update(v->live, &v->input, &v->report);

    if (err)
        return err;
    v->updated_ns = start_ns;
    v->moved = v->moving = false;
    pthread_mutex_lock(&v->lock);
    v->state.dropped += dropped;
    v->behind = false;
    engine_note_set_locked(v, &v->report, start_ns - kept->set.t_ns);
    pthread_mutex_unlock(&v->lock);
    v->set_index = kept->set.index;
    v->set_t_ns = kept->set.t_ns;
    v->set_wall_ns = kept->set.wall_ns;
    v->latency_due = v->report.tiles_changed > 0;
    engine_note_scene(v, v->report.tiles_changed > 0);
    return 0;
}

static bool update_due(const struct live_engine *v, enum engine_demand demand)
{
    const int64_t age_ns = sst_clock_now_ns() - v->updated_ns;

    return demand == ENGINE_PICTURES || age_ns >= KEEP_NS ||
           (demand == ENGINE_EVENTS && v->moved && age_ns >= EVENTS_NS);
}

/** Watch one view of a set; all views only if it is time. Changes are counted from watched set to watched set, whether
 *  or not the light field is brought up to date. @return 0, or an error: logged, or stopped */
static int watch(struct live_engine *v, const struct sst_kept *kept, enum engine_demand demand)
{
    double changed[SST_LIVE_ZONES + 1];
    int err = sst_live_watch(v->live, &v->input, &v->report);

    if (err)
        return err;
    for (int i = 0; i <= SST_LIVE_ZONES; i++)
        changed[i] = v->report.zone[i].changed;
    v->moved |= changed[SST_LIVE_ZONES] > 0;
    v->input.unseen = true;
    if (update_due(v, demand)) {
        err = update(v, kept, 0);
        for (int i = 0; i <= SST_LIVE_ZONES; i++)
            v->report.zone[i].changed = changed[i];
        return err;
    }
    pthread_mutex_lock(&v->lock);
    v->state.watched++;
    v->behind = true;
    engine_note_second_locked(v, &v->report, 0);
    pthread_mutex_unlock(&v->lock);
    return 0;
}

/** @return it was processed, or watched */
static bool process_set(struct live_engine *v, const struct sst_kept *kept, uint64_t dropped, enum engine_demand demand)
{
    int err = -ENOTSUP;

    fill_input(v, kept);
    pthread_mutex_lock(&v->lock);
    v->input.crowded = dropped && !(v->config.live.rate_hz > 0); /* else they are left out on demand */
    engine_note_passed_locked(v, dropped);
    pthread_mutex_unlock(&v->lock);
    if (demand != ENGINE_PICTURES)
        err = watch(v, kept, demand);
    if (err == -ENOTSUP) /* also of frames with changes that only decoding shows */
        err = update(v, kept, dropped);
    return !err;
}

/** Search behind leaves, tracks and labels ahead: no picture of the set needs them. */
static void finish_set(struct live_engine *v)
{
    struct sst_live_report rest = { 0 };

    if (sst_live_follow(v->live, &rest)) /* logged, or stopped */
        return;
    pthread_mutex_lock(&v->lock);
    engine_note_rest_locked(v, &rest);
    pthread_mutex_unlock(&v->lock);
    engine_note_scene(v, false); /* tracks may have moved the cut */
}

/** Work on a set for which no viewer has to wait, with the frames borrowed: tracks, visits and their pictures,
 * recordings, notices. */
static void follow_set(struct live_engine *v, const struct sst_kept *kept)
{
    if (v->set_t_ns == kept->set.t_ns) { /* else it was only watched */
        finish_set(v);
        engine_tracks_follow(v);
    }
    if (v->kept && v->set_t_ns == kept->set.t_ns) /* else it was only watched */
        engine_visits_follow(v, v->track, v->tracks);
    notify_storage(v, kept, &v->report);
    if (v->events) /* of the present, not of a recording */
        engine_notice_follow(v);
}

/** Render and publish. An error that stays, as while the reference camera is away, is logged once. */
static void publish(struct live_engine *v)
{
    char held[SST_LOG_MAX] = "", *before = sst_log_hold_errors(held);

    engine_publish(v);
    sst_log_hold_errors(before);
    if (!*held || !strcmp(held, v->said))
        return;
    memcpy(v->said, held, sizeof(v->said));
    sst_log_error("%s", held);
}

/**
 * Answer requests and render pictures; continue while a user drags a control.
 *
 * @param took_ns  that the work before took, 0: there was none
 */
static void serve_clients(struct live_engine *v, int64_t took_ns)
{
    const int64_t end_ns = sst_clock_now_ns() + (took_ns < INTERACTION_MAX_NS ? took_ns : INTERACTION_MAX_NS);
    int64_t seen_ns, until_ns;
    bool more;

    do {
        pthread_mutex_lock(&v->lock);
        seen_ns = v->interaction_ns;
        pthread_mutex_unlock(&v->lock);
        engine_serve(v);
        publish(v);
        until_ns = seen_ns + DRAG_NS < end_ns ? seen_ns + DRAG_NS : end_ns;
        pthread_mutex_lock(&v->lock);
        v->served_t_ns = v->tried_t_ns;
        while (!v->stop && v->interaction_ns == seen_ns && sst_cond_wait_until(&v->changed, &v->lock, until_ns))
            ;
        more = !v->stop && v->interaction_ns != seen_ns && sst_clock_now_ns() < end_ns;
        pthread_mutex_unlock(&v->lock);
    } while (more);
}

/** Present need of pictures and maps. */
static enum engine_demand find_demand(struct live_engine *v)
{
    enum engine_demand demand = ENGINE_UNUSED;

    pthread_mutex_lock(&v->lock);
    if (engine_armed_locked(v))
        demand = ENGINE_EVENTS;
    for (int i = 0; i < v->config.zones; i++)
        demand = v->config.zone[i].mask ? demand : ENGINE_EVENTS;
    for (int i = 0; i < v->config.storage.triggers; i++)
        demand = v->config.storage.trigger[i].label[0] || v->config.storage.trigger[i].visit ? ENGINE_EVENTS : demand;
    /* Exact mode leaves nothing out; until there are maps, all work is for them. */
    if (!v->config.live.skip_change || !v->state.ready || engine_seen_locked(v))
        demand = ENGINE_PICTURES;
    v->state.demand = demand;
    pthread_mutex_unlock(&v->lock);
    return demand;
}

/** Changed zones apply from the next set on; former zones of visits count no more. */
static void follow_zones(struct live_engine *v)
{
    struct sst_live_zone zone[SST_LIVE_ZONES];
    int zones;

    pthread_mutex_lock(&v->lock);
    zones = v->zones_changed ? v->config.zones : -1;
    v->zones_changed = false;
    if (zones >= 0)
        engine_zones(zone, &v->config);
    pthread_mutex_unlock(&v->lock);
    if (zones < 0 || sst_live_set_zones(v->live, zone, zones)) /* logged; the configuration was checked before */
        return;
    v->live_config.zones = zones;
    memcpy(v->live_config.zone, zone, sizeof(zone));
    engine_visits_forget_zones(v);
}

/** Process the newest set if it is due. @return time needed, ns; 0: there was none */
static int64_t step(struct live_engine *v)
{
    const enum engine_demand demand = find_demand(v);
    /* A new viewer sees the set that has only been watched. */
    const uint64_t after = v->last - (demand == ENGINE_PICTURES && v->behind);
    const struct sst_kept *kept = NULL;
    uint64_t dropped = 0;
    double rate_hz;
    int64_t due_ns, took_ns = 0;
    bool restart, done;

    follow_zones(v);
    pthread_mutex_lock(&v->lock);
    rate_hz = v->config.live.rate_hz;
    pthread_mutex_unlock(&v->lock);
    due_ns = rate_hz > 0 ? v->last_ns + (int64_t)(1e9 / rate_hz) : 0;
    if (sst_clock_now_ns() + POLL_MS * INT64_C(1000000) < due_ns)
        nanosleep(&(struct timespec){ .tv_nsec = POLL_MS * 1000000 }, NULL);
    else if (sst_ring_wait(v->ring, after, POLL_MS))
        kept = sst_ring_newest(v->ring, after, &dropped);
    pthread_mutex_lock(&v->lock);
    restart = v->config_seen != v->config_count; /* requested before the set came: it applies to later ones */
    pthread_mutex_unlock(&v->lock);
    if (kept && restart)
        sst_ring_unref(v->ring, kept);
    if (kept && !restart) {
        v->last = kept->number;
        v->last_ns = sst_clock_now_ns();
        done = process_set(v, kept, dropped, demand);
        v->tried_t_ns = kept->set.t_ns;
        if (done) { /* pictures for viewers come before all else */
            engine_serve(v);
            publish(v);
            follow_set(v, kept);
        }
        sst_ring_unref(v->ring, kept);
        took_ns = sst_clock_now_ns() - v->last_ns;
    }
    /* Also where sets come faster than they are processed: the background's memory is large. */
    if (sst_live_unsettled(v->live) && sst_live_settle(v->live)) {
        engine_note_scene(v, true);
        pthread_mutex_lock(&v->lock);
        v->update++;
        pthread_mutex_unlock(&v->lock);
    }
    engine_posed_follow(v);
    return took_ns;
}

static void *run(void *arg)
{
    struct live_engine *v = arg;
    bool stop = false;

    sst_thread_name("sst-live");
    sst_thread_nice(LIVE_NICE);
    while (!stop) {
        if (follow(v)) {
            serve_clients(v, step(v));
            if (v->events)
                engine_check_by_time(v);
            engine_pace_follow(v);
        } else {
            engine_serve(v);
            nanosleep(&(struct timespec){ .tv_nsec = POLL_MS * 1000000 }, NULL);
        }
        pthread_mutex_lock(&v->lock);
        v->state.beat_ns = sst_clock_now_ns();
        stop = v->stop;
        pthread_mutex_unlock(&v->lock);
    }
    close_live(v);
    pthread_mutex_lock(&v->lock);
    v->ended = true;
    pthread_cond_broadcast(&v->changed);
    pthread_mutex_unlock(&v->lock);
    return NULL;
}

/* --- for the others ----------------------------------------------------------------------------------------------- */

int engine_open(struct live_engine **out, const struct engine_config *cfg)
{
    struct live_engine *v = calloc(1, sizeof(*v));
    int err;

    if (!v)
        return -ENOMEM;
    v->ring = cfg->ring;
    v->source = cfg->source;
    v->storage = cfg->storage;
    v->kept = cfg->visits;
    v->events = cfg->events;
    v->config = *cfg->config;
    v->state.enabled = cfg->config->live.enabled;
    v->state.error_change = v->state.error_labels = v->state.range_min_px = v->state.range_max_px = v->state.focus_px =
        v->state.cut_px = v->state.searched_min_px = v->state.searched_max_px = NAN;
    v->state.beat_ns = sst_clock_now_ns();
    pthread_mutex_init(&v->lock, NULL);
    sst_cond_init(&v->changed);
    engine_notice_forget(v);
    err = engine_views_open(v);
    if (!err) {
        err = -pthread_create(&v->camera_thread, NULL, engine_run_cameras, v);
        v->camera_runs = !err;
    }
    err = err ? err : -pthread_create(&v->thread, NULL, run, v);
    if (err) {
        engine_stop(v);
        if (v->camera_runs)
            pthread_join(v->camera_thread, NULL);
        engine_close(v);
        return err;
    }
    *out = v;
    return 0;
}

void engine_configure(struct live_engine *v, const struct sst_config *config, bool restart)
{
    char unknown[512];

    pthread_mutex_lock(&v->lock);
    engine_views_follow_locked(v, &config->live);
    v->zones_changed |=
        v->config.zones != config->zones || memcmp(v->config.zone, config->zone, sizeof(config->zone)) != 0;
    v->unmasked |= v->storage && !sst_array_same_masks(&v->config.array, &config->array);
    v->config = *config;
    v->config_count += restart;
    if (restart && v->live && !v->events) /* of a recording: its moment is given up */
        sst_live_cancel(v->live);
    name_unknown_locked(v, unknown);
    pthread_mutex_unlock(&v->lock);
    if (!restart)
        log_unknown_labels(unknown);
}

bool engine_has_shown(struct live_engine *v, int64_t t_ns, bool *watched)
{
    bool served, viewed = false, rendered = true, never;

    pthread_mutex_lock(&v->lock);
    never = v->stop || !v->config.live.enabled || (!v->live && v->state.reason[0]);
    served = v->served_t_ns >= t_ns;
    for (int i = 0; i < VIEWS_MAX; i++) {
        const bool has = v->view[i].used && sst_slot_clients(v->view[i].slot);

        viewed |= has;
        rendered &= !has || v->view[i].shown_version;
    }
    for (int i = 0; i < SST_CAMERAS_MAX && !viewed; i++)
        viewed = v->camera[i].slot && sst_slot_clients(v->camera[i].slot);
    pthread_mutex_unlock(&v->lock);
    *watched = viewed;
    return never || (served && rendered);
}

void engine_stop(struct live_engine *v)
{
    pthread_mutex_lock(&v->lock);
    v->stop = true;
    if (v->live)
        sst_live_cancel(v->live);
    for (int i = 0; i < VIEWS_MAX; i++)
        if (v->view[i].slot)
            sst_slot_shut(v->view[i].slot);
    for (int i = 0; i < 2; i++)
        if (v->overlay[i].slot)
            sst_slot_shut(v->overlay[i].slot);
    for (int i = 0; i < SST_CAMERAS_MAX; i++)
        if (v->camera[i].slot)
            sst_slot_shut(v->camera[i].slot);
    pthread_cond_broadcast(&v->changed);
    pthread_mutex_unlock(&v->lock);
}

bool engine_join(struct live_engine *v, int64_t until_ns)
{
    bool ended;

    pthread_mutex_lock(&v->lock);
    while ((!v->ended || !v->camera_ended || !v->notice_ended) && sst_cond_wait_until(&v->changed, &v->lock, until_ns))
        ;
    /* A check of the calibration cannot be cancelled, and is not waited for: the disk needs the time. */
    ended = v->ended && v->camera_ended && (!v->check_runs || v->check_ended) && v->notice_ended;
    pthread_mutex_unlock(&v->lock);
    if (ended) {
        pthread_join(v->thread, NULL);
        pthread_join(v->camera_thread, NULL);
        engine_check_join(v);
        engine_notice_join(v);
    }
    return ended;
}

void engine_close(struct live_engine *v)
{
    if (!v)
        return;
    engine_views_close(v);
    pthread_cond_destroy(&v->changed);
    pthread_mutex_destroy(&v->lock);
    free(v);
}
