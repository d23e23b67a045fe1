/* Requests that the live thread serves for other threads: the surface under a point, things removed by a click. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "base/clock.h"
#include "base/thread.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"

/* Remove a thing from a view's clear picture, bring it back, or bring all back; the next picture shows it. */
static int change_objects(struct live_engine *v, struct view *e, struct request *r)
{
    struct sst_livepicture_clear shown;
    int err = 0;

    if (r->kind == REQUEST_TOGGLE)
        err = sst_livepicture_toggle(e->picture, r->x, r->y, &r->removed);
    else
        sst_livepicture_restore(e->picture);
    if (err)
        return err;
    sst_livepicture_clear(e->picture, &shown);
    r->objects = shown.objects;
    pthread_mutex_lock(&v->lock);
    e->shown.objects = shown.objects;
    e->alone = r->kind == REQUEST_TOGGLE;
    e->version++;
    v->interaction_ns = sst_clock_now_ns();
    pthread_mutex_unlock(&v->lock);
    return 0;
}

/* Picks are in the picture that the view shows; things are removed from one of its own. */
static int serve(struct live_engine *v, struct view *e, struct request *r)
{
    struct view_settings settings;
    struct view *o = e;

    pthread_mutex_lock(&v->lock);
    settings = e->settings;
    if (r->kind != REQUEST_PICK && e != &v->view[0]) {
        e->alone = true;
        e->shown_version = e->picture ? e->shown_version : 0; /* its picture is to be rendered */
    }
    pthread_mutex_unlock(&v->lock);
    if (r->kind == REQUEST_PICK && engine_view_shows_main(v, e, &settings))
        o = &v->view[0];
    if (!o->picture)
        return -ENODATA;
    return r->kind == REQUEST_PICK ? sst_livepicture_pick(o->picture, r->x, r->y, &r->pick) : change_objects(v, e, r);
}

void engine_serve(struct live_engine *v)
{
    int64_t ns[2] = { 0, 0 };
    struct request r;
    int err = -ENODATA;
    struct view *e;

    pthread_mutex_lock(&v->lock);
    if (!v->request.pending || v->request.done) {
        pthread_mutex_unlock(&v->lock);
        return;
    }
    e = engine_view_find_locked(v, v->request.id);
    v->request.started = true;
    r = v->request;
    pthread_mutex_unlock(&v->lock);
    if (e)
        err = serve(v, e, &r);
    /* Not rendered since cameras came or went, or not yet alone. */
    if (e && err == -ENODATA && v->live && (v->set_index || v->set_t_ns)) {
        (void)engine_view_publish(v, e, true, ns);
        err = serve(v, e, &r);
    }
    pthread_mutex_lock(&v->lock);
    if (v->request.pending && v->request.number == r.number) { /* else the request of another client, which is gone */
        r.err = err;
        r.done = true;
        v->request = r;
        pthread_cond_broadcast(&v->changed);
    }
    pthread_mutex_unlock(&v->lock);
}

/* Status for a client of a failed request. */
static int explain_locked(struct live_engine *v, struct sst_api_answer *out)
{
    switch (v->request.err) {
    case -ERANGE:
        return sst_api_refuse(out->error, -EINVAL, "the point is outside the picture of %d x %d", v->state.width,
                              v->state.height);
    case -EOVERFLOW:
        return sst_api_refuse(out->error, -EAGAIN, "%d things are removed already; bring one back first",
                              SST_LIVEPICTURE_OBJECTS);
    case -EINVAL:
        return sst_api_refuse(out->error, -EINVAL,
                              "what is there fills most of the picture, as a wall or the ground does; choose a thing "
                              "that stands out from it, or set cut_px");
    case -ENOTSUP:
        return sst_api_refuse(out->error, -EINVAL, "cameras with live: poses see no things that could be removed");
    case -ENODATA:
        return v->state.ready && v->request.kind == REQUEST_TOGGLE
                   ? sst_api_refuse(out->error, -EINVAL,
                                    "the depth of that point is not known; choose another point of the thing")
                   : sst_api_refuse(out->error, -ENODATA, "nothing is known about depths yet");
    default:
        return sst_api_refuse(out->error, v->request.err, "the request failed: %s", strerror(-v->request.err));
    }
}

static int answer_locked(struct live_engine *v, struct sst_api_answer *out)
{
    const struct sst_livepicture_pick *p = &v->request.pick;
    const struct sst_live_track *track = engine_track_at_locked(v, v->request.x, v->request.y, p->disp_px);
    const struct sst_live_track *front = engine_track_at_locked(v, v->request.x, v->request.y, p->front_px);

    if (v->request.err)
        return explain_locked(v, out);
    if (v->request.kind == REQUEST_PICK)
        out->body = json_pack("{s:o, s:i, s:s, s:o, s:i, s:s, s:I, s:I}", "disparity_px", sst_api_real(p->disp_px),
                              "label", p->label, "name", p->label ? sst_classes_name(&v->classes, p->label) : "",
                              "front_px", sst_api_real(p->front_px), "front_label", p->front_label, "front_name",
                              p->front_label ? sst_classes_name(&v->classes, p->front_label) : "", "track",
                              (json_int_t)(track ? track->id : 0), "front_track", (json_int_t)(front ? front->id : 0));
    else
        out->body = json_pack("{s:b, s:i}", "removed", v->request.removed, "objects", v->request.objects);
    return out->body ? 0 : -ENOMEM;
}

/* Have the live thread do something with a view. @param at  x, y in pixels of the picture */
static int request(struct live_engine *v, const char *id, enum request_kind kind, const double at[2],
                   struct sst_api_answer *out)
{
    const int64_t end_ns = engine_end_of_wait();
    const double x = at[0], y = at[1];
    int err;

    if (!(x >= -1e6 && x <= 1e6 && y >= -1e6 && y <= 1e6))
        return sst_api_refuse(out->error, -EINVAL, "x and y are pixels of the picture");
    pthread_mutex_lock(&v->lock);
    while (v->request.pending && !v->stop && sst_cond_wait_until(&v->changed, &v->lock, end_ns))
        ;
    if (!engine_view_find_locked(v, id)) {
        err = sst_api_refuse(out->error, -ENOENT, "there is no view %.32s; it may have ended for want of viewers", id);
    } else if (v->request.pending || v->stop) {
        err = sst_api_refuse(out->error, -EAGAIN, "the service is busy; ask again");
    } else {
        v->request = (struct request){ .kind = kind,
                                       .pending = true,
                                       .number = v->request.number + 1,
                                       .x = (int)floor(x + 0.5),
                                       .y = (int)floor(y + 0.5) };
        snprintf(v->request.id, sizeof(v->request.id), "%s", id);
        while (!v->request.done && !v->stop && sst_cond_wait_until(&v->changed, &v->lock, end_ns))
            ;
        /* A click that is answered with an error must not take effect. */
        while (v->request.started && !v->request.done && !v->stop &&
               sst_cond_wait_until(&v->changed, &v->lock, end_ns + STARTED_MS * INT64_C(1000000)))
            ;
        err = v->request.done ? answer_locked(v, out)
                              : sst_api_refuse(out->error, -EAGAIN, "the service is busy; ask again");
        v->request.pending = false;
        pthread_cond_broadcast(&v->changed);
    }
    pthread_mutex_unlock(&v->lock);
    return err;
}

int engine_pick(void *engine, const char *id, double x, double y, struct sst_api_answer *out)
{
    return request(engine, id, REQUEST_PICK, (const double[]){ x, y }, out);
}

int engine_remove(void *engine, const char *client, const char *id, const json_t *body, struct sst_api_answer *out)
{
    static const char *const known[] = { "x", "y", "clear", NULL };
    const json_t *x = json_object_get(body, "x"), *y = json_object_get(body, "y"),
                 *clear = json_object_get(body, "clear");
    struct live_engine *v = engine;
    const struct view *e;
    int err;

    if (sst_api_members(body, known, out->error))
        return -EINVAL;
    pthread_mutex_lock(&v->lock);
    e = engine_view_find_locked(v, id);
    err = e ? engine_view_check_client(e, client, out->error) : 0; /* a view that has gone is reported below */
    pthread_mutex_unlock(&v->lock);
    if (err)
        return err;
    if (clear && !json_is_boolean(clear))
        return sst_api_refuse(out->error, -EINVAL, "clear must be true or false");
    if (json_is_true(clear))
        return request(engine, id, REQUEST_RESTORE, (const double[]){ 0, 0 }, out);
    if (!json_is_number(x) || !json_is_number(y))
        return sst_api_refuse(out->error, -EINVAL,
                              "give x and y in pixels of the picture, like {\"x\": 320, \"y\": 240}, or "
                              "{\"clear\": true} to bring everything back");
    return request(engine, id, REQUEST_TOGGLE, (const double[]){ json_number_value(x), json_number_value(y) }, out);
}
