/* Views: their settings and clients, and the pictures rendered for them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

#include "base/clock.h"
#include "base/thread.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"
#include "pipeline/image/codec.h"

/* --- the list of views, under lock -------------------------------------------------------------------------------- */

struct view *engine_view_find_locked(struct live_engine *v, const char *id)
{
    for (int i = 0; i < VIEWS_MAX; i++)
        if (v->view[i].used && !strcmp(v->view[i].id, id))
            return &v->view[i];
    return NULL;
}

static int add_locked(struct live_engine *v, const char *id, const struct view_settings *settings, struct view **out)
{
    const int room = 1 + sst_clamp_int(v->config.web.views, 0, VIEWS_MAX - 1);
    struct sst_slot *slot;

    for (int i = 0; i < room; i++) {
        struct view *e = &v->view[i];

        if (e->used || e->picture)
            continue;
        if (sst_slot_create(&slot))
            return -ENOMEM;
        *e = (struct view){ .used = true, .settings = *settings, .version = 1, .slot = slot };
        e->used_ns = sst_clock_now_ns();
        e->track_px = NAN;
        e->shown = (struct sst_livepicture_clear){ NAN, NAN, NAN, NAN, NAN, 0, false };
        snprintf(e->id, sizeof(e->id), "%s", id);
        engine_preview_show_locked(v, e);
        *out = e;
        return 0;
    }
    return -EOVERFLOW;
}

int engine_views_open(struct live_engine *v)
{
    struct view_settings settings;
    struct view *e;

    view_settings_defaults(&settings, &v->config.live);
    return add_locked(v, "main", &settings, &e);
}

void engine_views_follow_locked(struct live_engine *v, const struct sst_live_settings *to)
{
    struct view *e = engine_view_find_locked(v, "main");

    if (!e)
        return;
    view_settings_follow(&e->settings, &v->config.live, to);
    e->version++;
}

void engine_views_close(struct live_engine *v)
{
    for (int i = 0; i < VIEWS_MAX; i++)
        sst_slot_unref(v->view[i].slot);
    for (int i = 0; i < 2; i++)
        sst_slot_unref(v->overlay[i].slot);
    for (int i = 0; i < SST_CAMERAS_MAX; i++)
        sst_slot_unref(v->camera[i].slot);
    engine_preview_end(v);
    sst_jpeg_encoder_destroy(v->encoder);
    sst_image_fini(&v->overlay_image);
}

static json_t *view_json_locked(const struct live_engine *v, const struct view *e)
{
    const struct sst_live_track *t = e->settings.follow_track ? engine_track_locked(v, e->settings.follow_track) : NULL;

    return json_pack("{s:s, s:i, s:o?, s:o, s:o, s:o, s:o, s:o, s:o, s:i, s:o}", "id", e->id, "viewers",
                     sst_slot_clients(e->slot), "settings", view_settings_json(&e->settings), "shown_focus_px",
                     sst_api_real(e->shown_focus_px), "shown_cut_px", sst_api_real(e->shown.cut_px), "seen_percent",
                     sst_api_real(100 * e->shown.seen), "remembered_percent", sst_api_real(100 * e->shown.remembered),
                     "filled_percent", sst_api_real(100 * e->shown.filled), "oldest_s", sst_api_real(e->shown.oldest_s),
                     "objects", e->shown.objects, "track", t ? engine_track_json_locked(v, t) : json_null());
}

int engine_views(void *engine, struct sst_api_answer *out)
{
    struct live_engine *v = engine;
    json_t *list = json_array();

    pthread_mutex_lock(&v->lock);
    for (int i = 0; i < VIEWS_MAX; i++)
        if (v->view[i].used)
            json_array_append_new(list, view_json_locked(v, &v->view[i]));
    pthread_mutex_unlock(&v->lock);
    out->body = json_pack("{s:o}", "views", list);
    return out->body ? 0 : -ENOMEM;
}

/** Labels must be some of the network's. */
static int check_label_locked(struct live_engine *v, const struct view_settings *s, char error[512])
{
    const char *const labels[] = { s->focus_label, s->remove_label };

    for (size_t i = 0; i < ARRAY_LEN(labels) && v->classes.count; i++) {
        if (labels[i][0] && !sst_classes_find(&v->classes, labels[i]))
            return sst_api_refuse(error, -EINVAL, "the network knows no class \"%s\"; /api/v1/labels lists them",
                                  labels[i]);
    }
    return 0;
}

/* A client that does not control leaves some to others. */
static int check_share_locked(const struct live_engine *v, const char *client, char error[512])
{
    const int most = sst_max_int(v->config.web.views * 3 / 4, 1);
    int own = 0;

    for (int i = 0; i < VIEWS_MAX && client[0]; i++)
        own += v->view[i].used && !strcmp(v->view[i].client, client);
    if (own < most)
        return 0;
    return sst_api_refuse(error, -EOVERFLOW,
                          "this client has %d views already, the rest of web: views is for others; close one", own);
}

/* @return 0, -EPERM */
int engine_view_check_client(const struct view *e, const char *client, char error[512])
{
    if (!client[0] || !strcmp(e->client, client))
        return 0;
    return sst_api_refuse(error, -EPERM, "the view %s is another client's; create one, or use the control token",
                          e->id);
}

int engine_view_create(void *engine, const char *client, const json_t *settings, struct sst_api_answer *out)
{
    struct live_engine *v = engine;
    struct view_settings s;
    struct view *e;
    char id[16];
    uint32_t number;
    int err;

    if (getrandom(&number, sizeof(number), 0) != sizeof(number))
        return -EIO;
    snprintf(id, sizeof(id), "v%08x", number);
    pthread_mutex_lock(&v->lock);
    view_settings_defaults(&s, &v->config.live);
    s.tint = true;
    err = settings ? view_settings_take(&s, settings, out->error) : 0;
    err = err ? err : check_label_locked(v, &s, out->error);
    err = err ? err : check_share_locked(v, client, out->error);
    err = err ? err : add_locked(v, id, &s, &e);
    if (!err)
        snprintf(e->client, sizeof(e->client), "%s", client);
    if (err == -EOVERFLOW && !out->error[0])
        snprintf(out->error, sizeof(out->error),
                 "there are %d views already, more cost too much; close one, or raise web: views", v->config.web.views);
    out->body = err ? NULL : view_json_locked(v, e);
    pthread_mutex_unlock(&v->lock);
    return err ? err : out->body ? 0 : -ENOMEM;
}

int engine_view_change(void *engine, const char *client, const char *id, const json_t *settings,
                       struct sst_api_answer *out)
{
    struct live_engine *v = engine;
    struct view_settings s;
    struct view *e;
    int err = -ENOENT;

    pthread_mutex_lock(&v->lock);
    e = engine_view_find_locked(v, id);
    if (e) {
        s = e->settings;
        err = engine_view_check_client(e, client, out->error);
        err = err ? err : view_settings_take(&s, settings, out->error);
        err = err ? err : check_label_locked(v, &s, out->error);
    } else {
        snprintf(out->error, sizeof(out->error), "there is no view %.32s; it may have ended for want of viewers", id);
    }
    if (!err) {
        e->settings = s;
        e->version++;
        e->used_ns = v->interaction_ns = sst_clock_now_ns();
        pthread_cond_broadcast(&v->changed);
        out->body = view_json_locked(v, e);
    }
    pthread_mutex_unlock(&v->lock);
    return err ? err : out->body ? 0 : -ENOMEM;
}

/* --- pictures, live thread ---------------------------------------------------------------------------------------- */

/** Remove views that have had no clients for long. */
static void expire(struct live_engine *v)
{
    for (int i = 1; i < VIEWS_MAX; i++) {
        struct view *e = &v->view[i];
        struct sst_livepicture *picture = NULL;

        pthread_mutex_lock(&v->lock);
        if (e->used && sst_slot_clients(e->slot))
            e->used_ns = sst_clock_now_ns();
        if (e->used && sst_clock_now_ns() - e->used_ns > EXPIRY_NS) {
            picture = e->picture;
            sst_slot_shut(e->slot);
            sst_slot_unref(e->slot);
            *e = (struct view){ 0 };
        }
        pthread_mutex_unlock(&v->lock);
        sst_livepicture_destroy(picture);
    }
}

void engine_forget_pictures(struct live_engine *v)
{
    sst_livepicture_destroy(v->visit_picture);
    v->visit_picture = NULL;
    for (int i = 0; i < VIEWS_MAX; i++) {
        struct sst_livepicture *picture;

        pthread_mutex_lock(&v->lock);
        picture = v->view[i].picture;
        v->view[i].picture = NULL;
        v->view[i].alone = false;
        v->view[i].shown_version = 0;
        pthread_mutex_unlock(&v->lock);
        sst_livepicture_destroy(picture);
    }
}

void engine_forget_shown(struct live_engine *v)
{
    pthread_mutex_lock(&v->lock);
    for (size_t i = 0; i < ARRAY_LEN(v->view); i++)
        if (v->view[i].slot)
            sst_slot_forget(v->view[i].slot);
    for (size_t i = 0; i < ARRAY_LEN(v->overlay); i++)
        if (v->overlay[i].slot)
            sst_slot_forget(v->overlay[i].slot);
    for (size_t i = 0; i < ARRAY_LEN(v->camera); i++)
        if (v->camera[i].slot)
            sst_slot_forget(v->camera[i].slot);
    pthread_mutex_unlock(&v->lock);
}

bool engine_masks_follow(struct live_engine *v)
{
    bool unmasked;

    pthread_mutex_lock(&v->lock);
    v->unmasked = !sst_array_same_masks(&v->layout.config, &v->config.array);
    unmasked = v->unmasked;
    pthread_mutex_unlock(&v->lock);
    return unmasked;
}

/** The cut in front of all tracks. */
static void keep_moving(struct live_engine *v, struct sst_render_config *render)
{
    double cut_px = isnan(render->cut_px) ? sst_live_cut(v->live) : render->cut_px;

    pthread_mutex_lock(&v->lock);
    for (int i = 0; i < v->tracks; i++)
        if (isgreater(v->track[i].disp_px, cut_px))
            cut_px = sst_live_before(v->track[i].disp_px, v->track[i].hidden);
    pthread_mutex_unlock(&v->lock);
    render->cut_px = cut_px;
}

/** Settings for the renderer, resolved for the present scene. */
static void resolve(struct live_engine *v, struct view *e, const struct view_settings *s,
                    struct sst_render_config *render)
{
    const struct sst_classes *classes = &sst_live_lightfield(v->live)->classes;

    *render = s->render;
    render->remove_label = s->remove_label[0] ? sst_classes_find(classes, s->remove_label) : 0;
    render->focus_label = s->focus_label[0] ? sst_classes_find(classes, s->focus_label) : 0;
    if (s->keep_moving && render->method == SST_RENDER_CLEAR)
        keep_moving(v, render);
    if (s->follow && render->focus_label) {
        double disp_px;

        if (!sst_livepicture_label_disparity(v->live, render->focus_label, &disp_px))
            render->focus_px = disp_px;
    }
    if (s->follow_track) {
        const struct sst_live_track *t;

        pthread_mutex_lock(&v->lock);
        t = engine_track_locked(v, s->follow_track);
        e->track_px = t ? t->disp_px : e->track_px; /* where it was last */
        pthread_mutex_unlock(&v->lock);
        render->focus_px = isnan(e->track_px) ? render->focus_px : e->track_px;
    } else {
        e->track_px = NAN;
    }
    if (isnan(render->focus_px))
        render->focus_px = sst_live_default_focus(v->live);
    if (isnan(render->focus_px))
        render->focus_px = 0;
}

int engine_jpeg(struct live_engine *v, const struct sst_image *image, int quality, uint8_t **out, size_t *bytes)
{
    const uint8_t *jpeg;
    int err = v->encoder ? 0 : sst_jpeg_encoder_create(&v->encoder);

    err = err ? err : sst_jpeg_encoder_run(v->encoder, image, quality, &jpeg, bytes);
    *out = err ? NULL : malloc(*bytes);
    if (err || !*out)
        return err ? err : -ENOMEM;
    memcpy(*out, jpeg, *bytes);
    return 0;
}

static int show(struct live_engine *v, struct sst_slot *slot, const struct sst_image *image, int quality)
{
    uint8_t *data;
    size_t bytes;
    const int err = engine_jpeg(v, image, quality, &data, &bytes);

    if (err)
        return err;
    return sst_slot_put(slot, data, bytes, v->set_index, v->set_t_ns, v->set_wall_ns);
}

/* Is the picture of main also this view's? Settings that say the same render the same, with any outlines and tint. */
bool engine_view_shows_main(struct live_engine *v, const struct view *e, const struct view_settings *settings)
{
    const struct view *m = &v->view[0];
    struct view_settings plain = *settings;
    json_t *own = NULL, *other = NULL;
    bool is = false;

    pthread_mutex_lock(&v->lock);
    plain.outline = m->settings.outline;
    plain.outline_moving = m->settings.outline_moving;
    plain.tint = m->settings.tint;
    if (e != m && !e->alone && m->used && !m->shown.objects && !settings->follow_track) {
        own = view_settings_json(&plain);
        other = view_settings_json(&m->settings);
        is = own && other && json_equal(own, other);
    }
    pthread_mutex_unlock(&v->lock);
    json_decref(own);
    json_decref(other);
    return is;
}

/* The view that has the picture of view e: main or e, which then begins with the memory of main.
 * @return NULL: no memory (logged) */
static struct view *owner_of(struct live_engine *v, struct view *e, const struct view_settings *settings)
{
    struct view *o = engine_view_shows_main(v, e, settings) ? &v->view[0] : e;

    if (o != e) { /* again, perhaps */
        sst_livepicture_destroy(e->picture);
        e->picture = NULL;
    }
    if (o->picture)
        return o;
    if (sst_livepicture_create(&o->picture, v->live))
        return NULL;
    if (o != &v->view[0] && v->view[0].picture && sst_livepicture_remember(o->picture, v->view[0].picture))
        return NULL;
    return o;
}

/** @param ns  in, out, time spent on rendering and on encoding @return a picture was made */
static bool render_view(struct live_engine *v, struct view *e, const struct view_settings *settings, int quality,
                        int64_t ns[2])
{
    const int64_t start_ns = sst_clock_now_ns();
    const enum sst_livepicture_outline outline = settings->outline          ? SST_OUTLINE_ALL
                                                 : settings->outline_moving ? SST_OUTLINE_MOVING
                                                                            : SST_OUTLINE_NONE;
    const struct sst_image *image;
    struct sst_livepicture_clear shown;
    struct sst_render_config render;
    struct view *o = owner_of(v, e, settings);
    int64_t rendered_px = 0, rendered_ns;
    bool first;
    int err = o ? 0 : -ENOMEM;

    resolve(v, e, settings, &render);
    err = err ? err : sst_livepicture_render(o->picture, &render, &image, &rendered_px);
    if (err == -ENODATA && render.method != SST_RENDER_REFOCUS) {
        render.method = SST_RENDER_REFOCUS; /* until there are disparities */
        err = sst_livepicture_render(o->picture, &render, &image, &rendered_px);
    }
    rendered_ns = sst_clock_now_ns();
    ns[0] += rendered_ns - start_ns;
    if (err)
        return false;
    if (rendered_px)
        o->rendering = ++v->renderings;
    sst_livepicture_clear(o->picture, &shown);
    v->moving |= shown.moving;
    pthread_mutex_lock(&v->lock);
    if (rendered_px)
        engine_unconfirmed_follow_locked(v, &shown);
    first = !e->shown_version;
    e->shown_focus_px = render.focus_px;
    e->shown = shown;
    pthread_mutex_unlock(&v->lock);
    if (e->shown_rendering == o->rendering && e->shown_outline == outline && e->shown_tint == settings->tint &&
        !first && v->events)
        return false;
    e->shown_rendering = o->rendering;
    e->shown_outline = outline;
    e->shown_tint = settings->tint;
    err = sst_livepicture_decorate(o->picture, outline, settings->tint, &image);
    err = err ? err : show(v, e->slot, image, quality);
    ns[1] += sst_clock_now_ns() - rendered_ns;
    return !err;
}

/** Render a view's picture if the shown one is out of date.
 * @param asked  also without clients, as a request needs it
 * @return a picture was made */
bool engine_view_publish(struct live_engine *v, struct view *e, bool asked, int64_t ns[2])
{
    struct view_settings settings;
    unsigned version;
    uint64_t update;
    bool due, made;
    int quality;

    pthread_mutex_lock(&v->lock);
    asked |= engine_armed_locked(v) && !strcmp(e->id, "main");
    due = e->used && (asked || engine_wanted(e->slot, e->used_ns)) &&
          (e->shown_version != e->version || e->shown_update != v->update ||
           (!v->events && e->shown_t_ns != v->set_t_ns)); /* a picture of a recording has the time of its set */
    settings = e->settings;
    version = e->version;
    update = v->update;
    quality = v->config.live.jpeg_quality;
    pthread_mutex_unlock(&v->lock);
    if (!due)
        return false;
    made = render_view(v, e, &settings, quality, ns);
    pthread_mutex_lock(&v->lock);
    e->shown_version = version;
    e->shown_update = update;
    e->shown_t_ns = v->set_t_ns;
    pthread_cond_broadcast(&v->changed);
    pthread_mutex_unlock(&v->lock);
    return made;
}

static void publish_overlay(struct live_engine *v, enum sst_livepicture_overlay kind)
{
    const struct sst_lightfield *lf = sst_live_lightfield(v->live);
    struct shared *s = &v->overlay[kind];
    struct sst_image *image = &v->overlay_image;
    struct sst_slot *slot;
    uint64_t update;
    int quality;

    pthread_mutex_lock(&v->lock);
    slot = s->slot && s->shown != v->update && engine_wanted(s->slot, s->used_ns) ? s->slot : NULL;
    update = v->update;
    quality = v->config.live.jpeg_quality;
    pthread_mutex_unlock(&v->lock);
    if (!slot)
        return;
    if (image->width != lf->width || image->height != lf->height) {
        sst_image_fini(image);
        if (sst_image_init(image, lf->width, lf->height))
            return;
    }
    if (!sst_livepicture_overlay(v->live, kind, image) && !show(v, slot, image, quality)) {
        pthread_mutex_lock(&v->lock);
        s->shown = update;
        pthread_cond_broadcast(&v->changed);
        pthread_mutex_unlock(&v->lock);
    }
}

/** Views with viewers, or the others. @return pictures that were made */
static int publish_views(struct live_engine *v, bool watched, int64_t ns[2])
{
    int made = 0;

    for (int i = 0; i < VIEWS_MAX; i++) {
        bool turn;

        pthread_mutex_lock(&v->lock);
        turn = v->view[i].used && (sst_slot_clients(v->view[i].slot) > 0) == watched;
        pthread_mutex_unlock(&v->lock);
        made += turn && engine_view_publish(v, &v->view[i], false, ns);
    }
    return made;
}

static void note_latency(struct live_engine *v, const int64_t ns[2])
{
    const int64_t now_ns = sst_clock_now_ns();

    pthread_mutex_lock(&v->lock);
    window_add(&v->state.latency_ms, (double)(now_ns - v->set_t_ns) / 1e6, now_ns);
    window_add(&v->state.stage_ms[ENGINE_RENDER], (double)ns[0] / 1e6, now_ns);
    window_add(&v->state.stage_ms[ENGINE_ENCODE], (double)ns[1] / 1e6, now_ns);
    pthread_mutex_unlock(&v->lock);
    v->latency_due = false;
}

void engine_publish(struct live_engine *v)
{
    int64_t ns[2] = { 0, 0 };
    bool outdated;
    int made;

    expire(v);
    pthread_mutex_lock(&v->lock);
    outdated = !v->events && v->config_seen != v->config_count;
    pthread_mutex_unlock(&v->lock);
    if ((!v->set_index && !v->set_t_ns) || outdated)
        return;                        /* no set yet, or another moment of the recording is to come */
    made = publish_views(v, true, ns); /* a viewer waits for no picture that is only recorded */
    if (made && v->latency_due)
        note_latency(v, ns);
    made += publish_views(v, false, ns);
    engine_follow_device(v);
    publish_overlay(v, SST_LIVE_LABELS_PICTURE);
    publish_overlay(v, SST_LIVE_DISPARITY_PICTURE);
    if (!made)
        return;
    engine_preview_end(v);
    pthread_mutex_lock(&v->lock);
    v->state.pictures += (uint64_t)made;
    pthread_mutex_unlock(&v->lock);
    if (v->latency_due)
        note_latency(v, ns);
}

/* --- requests from outside ---------------------------------------------------------------------------------------- */

bool engine_wanted(struct sst_slot *slot, int64_t used_ns)
{
    return sst_slot_clients(slot) > 0 || (used_ns && sst_clock_now_ns() - used_ns < WANTED_NS);
}

bool engine_armed_locked(const struct live_engine *v)
{
    return v->config.storage.mode == SST_RECORD_EVENT && v->config.storage.record_view;
}

bool engine_seen_locked(const struct live_engine *v)
{
    bool seen = v->request.pending;

    for (int i = 0; i < VIEWS_MAX && !seen; i++)
        seen = v->view[i].used && engine_wanted(v->view[i].slot, v->view[i].used_ns);
    for (size_t i = 0; i < ARRAY_LEN(v->overlay) && !seen; i++)
        seen = v->overlay[i].slot && engine_wanted(v->overlay[i].slot, v->overlay[i].used_ns);
    return seen;
}

/* Get the JPEG slot of a shared picture; created if there is none. */
static int share_locked(struct shared *s, struct sst_slot **out)
{
    if (!s->slot && sst_slot_create(&s->slot))
        return -ENOMEM;
    s->used_ns = sst_clock_now_ns();
    *out = sst_slot_ref(s->slot);
    return 0;
}

int64_t engine_end_of_wait(void)
{
    return sst_clock_now_ns() + FRESH_MS * INT64_C(1000000);
}

/** Wait, a little, until the picture shows the present: it may not have been made for long. A recorded one is there at
 * once. */
static void await_view_locked(struct live_engine *v, const char *id)
{
    const int64_t end_ns = engine_end_of_wait();
    const struct view *e;

    while (!v->stop && v->live && (e = engine_view_find_locked(v, id)) && !engine_preview_fits_locked(v, e) &&
           (v->behind || e->shown_version != e->version || e->shown_update != v->update) &&
           sst_cond_wait_until(&v->changed, &v->lock, end_ns))
        ;
}

static int view_outlet_locked(struct live_engine *v, const char *id, struct sst_slot **out)
{
    struct view *e = engine_view_find_locked(v, id);

    if (!e)
        return -ENOENT;
    e->used_ns = sst_clock_now_ns();
    *out = sst_slot_ref(e->slot);
    if (!sst_slot_clients(e->slot))
        await_view_locked(v, id);
    return 0;
}

static int overlay_outlet_locked(struct live_engine *v, enum sst_livepicture_overlay kind, struct sst_slot **out)
{
    const int64_t end_ns = engine_end_of_wait();
    struct shared *s = &v->overlay[kind];
    const int err = share_locked(s, out);

    while (!err && !v->stop && v->state.ready && (v->behind || s->shown != v->update) && !sst_slot_clients(s->slot) &&
           sst_cond_wait_until(&v->changed, &v->lock, end_ns))
        ;
    return err;
}

static int camera_outlet_locked(struct live_engine *v, const char *name, struct sst_slot **out)
{
    struct array_layout *layout = calloc(1, sizeof(*layout));
    int row, col, end = 0, err = -ENOENT;

    if (!layout)
        return -ENOMEM;
    (void)array_layout(v->source, 0, layout);
    if (sscanf(name, "r%3dc%3d%n", &row, &col, &end) == 2 && !name[end])
        for (int i = 0; i < layout->config.bound && err == -ENOENT; i++)
            if (layout->config.camera[i].row == row && layout->config.camera[i].col == col)
                err = share_locked(&v->camera[i], out);
    free(layout);
    return err;
}

int engine_outlet(void *engine, enum sst_api_picture kind, const char *name, struct sst_slot **out)
{
    struct live_engine *v = engine;
    int err;

    pthread_mutex_lock(&v->lock);
    if (!v->config.live.enabled && kind != SST_PICTURE_CAMERA) {
        pthread_mutex_unlock(&v->lock);
        return -ENODATA; /* a picture from before it was switched off would pass for one of now */
    }
    switch (kind) {
    case SST_PICTURE_VIEW:
        err = view_outlet_locked(v, name, out);
        break;
    case SST_PICTURE_CAMERA:
        err = camera_outlet_locked(v, name, out);
        break;
    case SST_PICTURE_LABELS:
        err = overlay_outlet_locked(v, SST_LIVE_LABELS_PICTURE, out);
        break;
    default:
        err = overlay_outlet_locked(v, SST_LIVE_DISPARITY_PICTURE, out);
        break;
    }
    pthread_mutex_unlock(&v->lock);
    return err;
}
