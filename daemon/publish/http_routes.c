/* Table of routes and their handlers. Routes of the live picture exist below /replay as well, for the recording that is
 * played. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "daemon/publish/publish_internal.h"

#define HEALTH_NS INT64_C(250000000) /* for which an answer of /healthz is good */

/* method, path, role, one line, handler, parameters. The first that fits counts: {name} comes after words. Below /api/v1
 * other parameters are refused. */
#define ROUTES(X)                                                                                                      \
    X("GET", "/healthz", ANYONE, "Health check: is the array being captured?", healthz)                                \
    X("GET", "/login", ANYONE, "A form for the token", http_do_login_form)                                             \
    X("POST", "/login", ANYONE, "Log in with a token; sets a cookie", http_do_login)                                   \
    X("POST", "/api/v1/logout", VIEW, "End one's own session", http_do_logout)                                         \
    X("GET", "/api/v1/sessions", VIEW, "Who has logged in; one's own session without control", sessions)               \
    X("POST", "/api/v1/sessions/{id}", CONTROL, "End a session", session_change)                                       \
    X("GET", "/api/v1/tokens", CONTROL, "Named tokens: rights, end", http_do_tokens)                                   \
    X("POST", "/api/v1/tokens", CONTROL, "A named token; its secret is in this answer alone", http_do_token_add)       \
    X("POST", "/api/v1/tokens/{id}", CONTROL, "Revoke a named token", http_do_token_change)                            \
    X("GET", "/api/v1/audit", CONTROL, "Who has changed what, one line of JSON each", http_do_audit, "limit")          \
    X("GET", "/", VIEW, "The page", page)                                                                              \
    X("GET", "/web/{file}", VIEW, "A file of the page", web)                                                           \
    X("GET", "/api/v1/openapi.json", VIEW, "This API", openapi)                                                        \
    X("GET", "/api/v1/status", VIEW, "State, rates, latencies, counters", status)                                      \
    X("GET", "/api/v1/cameras", VIEW, "The grid of cameras and each one's state", cameras)                             \
    X("GET", "/api/v1/labels", VIEW, "Classes, colours, shares of the picture", labels)                                \
    X("GET", "/api/v1/tracks", VIEW, "What moves: place, label, distance", tracks)                                     \
    X("GET", "/api/v1/visits", VIEW, "What came into view, the newest first", http_do_visits,                          \
      "from", "to", "label", "zone", "before", "after", "reviewed", "limit")                                           \
    X("GET", "/api/v1/visits/days", VIEW, "Days on which visits came, with their number", http_do_visit_days,          \
      "from", "to", "label", "zone", "offset_min")                                                                     \
    X("POST", "/api/v1/visits", VIEW, "Change many visits at once; keep, delete: control", visits_change)              \
    X("POST", "/api/v1/visits/{id}", VIEW, "Mark a visit as reviewed; keep, delete: control", visit_change)            \
    X("GET", "/api/v1/visits/{id}/camera", VIEW, "A visit as a camera saw it", visit_camera)                           \
    X("GET", "/api/v1/visits/{id}/seen", VIEW, "A visit seen through what stood in front", visit_seen)                 \
    X("GET", "/api/v1/events", VIEW, "Stored events, one line of JSON each", http_do_events, "limit", "after")         \
    X("GET", "/api/v1/events/stream", VIEW, "Event stream", http_do_listen, "after")                                   \
    X("GET", "/api/v1/views", VIEW, "Views and their settings", views)                                                 \
    X("POST", "/api/v1/views", VIEW, "A view with settings of its own", view_create)                                   \
    X("POST", "/api/v1/views/{id}", VIEW, "Change a view's settings; main: control", view_change)                      \
    X("POST", "/api/v1/views/{id}/remove", VIEW, "Remove the thing at a point; main: control", view_remove)            \
    X("GET", "/api/v1/views/{id}/pick", VIEW, "What is under a point of a view", pick, "x", "y")                       \
    X("GET", "/stream", VIEW, "Moving picture of the main view", stream_main)                                          \
    X("GET", "/stream/labels", VIEW, "Moving picture of the labels", stream_labels)                                    \
    X("GET", "/stream/disparity", VIEW, "Moving picture of the disparity", stream_disparity)                           \
    X("GET", "/stream/camera/{camera}", VIEW, "Moving picture of a camera", stream_camera)                             \
    X("GET", "/stream/{id}", VIEW, "Moving picture of a view", stream_view)                                            \
    X("GET", "/video", VIEW, "H.264 of the main view, over WebSocket", video_main)                                     \
    X("GET", "/video/camera/{camera}", VIEW, "H.264 of a camera, over WebSocket", video_camera)                        \
    X("GET", "/video/{id}", VIEW, "H.264 of a view, over WebSocket", video_view)                                       \
    X("GET", "/snapshot", VIEW, "Latest picture of the main view", snapshot_main)                                      \
    X("GET", "/snapshot/labels", VIEW, "Latest picture of the labels", snapshot_labels)                                \
    X("GET", "/snapshot/disparity", VIEW, "Latest picture of the disparity", snapshot_disparity)                       \
    X("GET", "/snapshot/camera/{camera}", VIEW, "Latest picture of a camera", snapshot_camera)                         \
    X("GET", "/snapshot/{id}", VIEW, "Latest picture of a view", snapshot_view)                                        \
    X("POST", "/api/v1/snapshot", CONTROL, "Take a snapshot: light field and picture of this moment", snapshot)        \
    X("POST", "/api/v1/record", CONTROL, "Start or stop recording", record)                                            \
    X("GET", "/api/v1/recordings", VIEW, "Stored recordings, snapshots and exports", recordings)                       \
    X("POST", "/api/v1/export", CONTROL, "A light field of a moment of a recording", export)                           \
    X("GET", "/api/v1/videos", VIEW, "Videos for others: their state", cases)                                          \
    X("POST", "/api/v1/videos", CONTROL, "Make a video of visits or of a span of a recording", case_create)            \
    X("POST", "/api/v1/videos/{name}", CONTROL, "Cancel or delete a video", case_change)                               \
    X("GET", "/api/v1/signing-key.pem", VIEW, "Public key of the manifests of videos", signing_key)                    \
    X("GET", "/api/v1/download/{name}", VIEW, "Download a recording, snapshot or export as a file", http_do_download)  \
    X("GET", "/api/v1/replay", VIEW, "The recording that is played", replay)                                           \
    X("POST", "/api/v1/replay", VIEW, "Play a recording from a moment on, pause, close", replay_change)                \
    X("POST", "/api/v1/delete", CONTROL, "Delete a recording, snapshot or export", delete)                             \
    X("GET", "/push-worker.js", VIEW, "Service worker of the page: notifications", push_worker)                        \
    X("GET", "/api/v1/push", VIEW, "Notifications: key, number of subscriptions", push)                                \
    X("POST", "/api/v1/push", VIEW, "Subscribe this browser to notifications, or end that", push_change)               \
    X("GET", "/api/v1/zones", VIEW, "Zones of the picture that are watched or ignored", zones)                         \
    X("GET", "/api/v1/masks", VIEW, "Privacy masks of the configuration", masks)                                       \
    X("POST", "/api/v1/zones", CONTROL, "Other zones: the whole list", zones_change)                                   \
    X("POST", "/api/v1/reload", CONTROL, "Reload the configuration", reload)                                           \
    X("POST", "/api/v1/publishers", VIEW, "Report of a program on this machine that publishes", publishers)            \
    X("POST", "/api/v1/calibration/check", CONTROL, "Check the calibration against the scene", calibration_check)      \
    X("GET", "/metrics", VIEW, "Counters and gauges for Prometheus", metrics)

#define PUBLIC(method, path, role, what, handler, ...) { method, path, SST_ROLE_##role, what, { __VA_ARGS__ } },
static const struct sst_route routes[] = { ROUTES(PUBLIC) };

const struct sst_route *sst_http_routes(int *count)
{
    *count = ARRAY_LEN(routes);
    return routes;
}

#if WITH_HTTPD

static const struct sst_api *api_of(struct http_request *q)
{
    return q->http->cfg.api;
}

/* Anyone may ask, as often as they like: the status is composed for one request, a few times a second. */
static int healthz(struct http_request *q)
{
    struct http_health *h = &q->http->health;
    struct sst_api_answer out = { 0 };
    const int64_t now_ns = sst_clock_now_ns();
    const char *state;
    char *text;
    bool ok;

    pthread_mutex_lock(&h->lock);
    if (now_ns >= h->until_ns) {
        state =
            api_of(q)->status(api_of(q)->arg, &out) ? "failed" : json_string_value(json_object_get(out.body, "state"));
        h->ok = state && (!strcmp(state, "capturing") || !strcmp(state, "degraded"));
        snprintf(h->text, sizeof(h->text), "%.70s\n", h->ok ? "ok" : state ? state : "unknown");
        h->until_ns = sst_clock_now_ns() + HEALTH_NS;
        json_decref(out.body);
    }
    ok = h->ok;
    text = strdup(h->text);
    pthread_mutex_unlock(&h->lock);
    return http_reply_text(q, ok ? MHD_HTTP_OK : MHD_HTTP_SERVICE_UNAVAILABLE, "text/plain; charset=utf-8", text);
}

static int page(struct http_request *q)
{
    return http_do_web(q, "index.html", true);
}

static int web(struct http_request *q)
{
    return http_do_web(q, q->name, true);
}

/* At the root: its scope is the whole page. */
static int push_worker(struct http_request *q)
{
    return http_do_web(q, "push-worker.js", false);
}

static int openapi(struct http_request *q)
{
    return http_do_web(q, "openapi.json", false);
}

/* Calls without arguments. */
#define PLAIN(name, call, arg, what)                                                                                   \
    static int name(struct http_request *q)                                                                            \
    {                                                                                                                  \
        struct sst_api_answer out = { 0 };                                                                             \
        const int err = api_of(q)->call(arg, &out);                                                                    \
                                                                                                                       \
        return http_reply_answer(q, err, &out, what);                                                                  \
    }
PLAIN(cameras, cameras, api_of(q)->arg, "cameras")
PLAIN(labels, labels, q->live, "labels")
PLAIN(tracks, tracks, q->live, "tracks")
PLAIN(views, views, q->live, "views")
PLAIN(zones, zones, api_of(q)->arg, "zones")
PLAIN(masks, masks, api_of(q)->arg, "masks")
PLAIN(recordings, recordings, api_of(q)->arg, "recordings")
PLAIN(push, push, api_of(q)->arg, "notifications")
PLAIN(cases, cases, api_of(q)->arg, "videos")
PLAIN(replay, replay, api_of(q)->replayed, "replay")

const char *http_user(const struct http_request *q)
{
    return q->user[0] ? q->user : q->role == SST_ROLE_CONTROL ? "control" : "view";
}

/* With the role of the client, which the service itself does not know. */
static int status(struct http_request *q)
{
    struct sst_api_answer out = { 0 };
    const int err = api_of(q)->status(api_of(q)->arg, &out);

    if (!err)
        json_object_set_new(out.body, "role", json_string(q->role == SST_ROLE_CONTROL ? "control" : "view"));
    return http_reply_answer(q, err, &out, "status");
}

/* The body must be empty, or an empty object. */
static int calibration_check(struct http_request *q)
{
    static const char *const known[] = { NULL };
    struct sst_api_answer out = { 0 };

    if (sst_api_members(q->body, known, out.error))
        return http_reply_error(q, MHD_HTTP_BAD_REQUEST, "calibration check: %s", out.error);
    return http_reply_answer(q, api_of(q)->calibration_check(api_of(q)->live, &out), &out, "calibration check");
}

/* Calls with the body as argument. */
#define WITH_BODY(name, call, arg, what)                                                                               \
    static int name(struct http_request *q)                                                                            \
    {                                                                                                                  \
        struct sst_api_answer out = { 0 };                                                                             \
        const int err = api_of(q)->call(arg, q->body, &out);                                                           \
                                                                                                                       \
        return http_reply_answer(q, err, &out, what);                                                                  \
    }
WITH_BODY(snapshot, snapshot, api_of(q)->arg, "snapshot")
WITH_BODY(record, record, api_of(q)->arg, "record")
WITH_BODY(export, export_, api_of(q)->arg, "export")
WITH_BODY(zones_change, zones_change, api_of(q)->arg, "zones")
WITH_BODY(delete, delete_, api_of(q)->arg, "delete")
WITH_BODY(push_change, push_change, api_of(q)->arg, "notifications")
WITH_BODY(case_create, case_create, api_of(q)->arg, "video")
WITH_BODY(replay_change, replay_change, api_of(q)->replayed, "replay")

/* A program of this machine: a token that may view is meant for others. */
static int publishers(struct http_request *q)
{
    struct sst_api_answer out = { 0 };
    int err;

    if (!q->local && q->role < SST_ROLE_CONTROL)
        return http_reply_error(q, MHD_HTTP_FORBIDDEN, "reports come through the socket, or need the control role");
    err = api_of(q)->publisher(api_of(q)->arg, q->body, &out);
    return http_reply_answer(q, err, &out, "publisher");
}

/* Owner of the views that a request may change: its session, else its address. */
static const char *client_of(const struct http_request *q)
{
    return q->role == SST_ROLE_CONTROL ? "" : q->session[0] ? q->session : q->who;
}

static int view_create(struct http_request *q)
{
    struct sst_api_answer out = { 0 };
    const int err = api_of(q)->view_create(q->live, client_of(q), q->body, &out);

    return http_reply_answer(q, err, &out, "view");
}

static int change_view(struct http_request *q, int (*change)(void *live, const char *client, const char *id,
                                                             const json_t *body, struct sst_api_answer *out))
{
    struct sst_api_answer out = { 0 };
    int err;

    if (!strcmp(q->name, "main") && q->role < SST_ROLE_CONTROL)
        return http_reply_error(q, MHD_HTTP_FORBIDDEN,
                                "the main view is shared by all: changing it needs the control role; "
                                "POST /api/v1/views makes a view of your own");
    err = change(q->live, client_of(q), q->name, q->body, &out);
    if (err == -EPERM)
        return http_reply_error(q, MHD_HTTP_FORBIDDEN, "%s", out.error);
    return http_reply_answer(q, err, &out, "view");
}

static int view_change(struct http_request *q)
{
    return change_view(q, api_of(q)->view_change);
}

static int view_remove(struct http_request *q)
{
    return change_view(q, api_of(q)->view_remove);
}

static bool coordinate(struct http_request *q, const char *name, double *out)
{
    const char *text = http_query(q, name);
    char *end = NULL;

    if (!text || !text[0])
        return false;
    *out = strtod(text, &end);
    return !*end && isfinite(*out) && fabs(*out) <= 1e6;
}

static int pick(struct http_request *q)
{
    struct sst_api_answer out = { 0 };
    double x, y;
    int err;

    if (!coordinate(q, "x", &x) || !coordinate(q, "y", &y))
        return http_reply_error(q, MHD_HTTP_BAD_REQUEST,
                                "pick: give x and y in pixels of the picture, like ?x=320&y=240");
    err = api_of(q)->pick(q->live, q->name, x, y, &out);
    return http_reply_answer(q, err, &out, "pick");
}

static int reload(struct http_request *q)
{
    struct sst_api_answer out = { 0 };
    static const char *const known[] = { "dry_run", NULL };
    const json_t *dry = json_object_get(q->body, "dry_run");
    int err;

    if (sst_api_members(q->body, known, out.error))
        return http_reply_error(q, MHD_HTTP_BAD_REQUEST, "reload: %s", out.error);
    if (dry && !json_is_boolean(dry))
        return http_reply_error(q, MHD_HTTP_BAD_REQUEST, "reload: dry_run is true or false");
    err = api_of(q)->reload(api_of(q)->arg, json_is_true(dry), &out);
    return http_reply_answer(q, err, &out, "reload");
}

static int sessions(struct http_request *q)
{
    struct sst_api_answer out = { 0 };

    out.body = json_pack("{s:o}", "sessions",
                         http_sessions_json(&q->http->auth.sessions, q->session, q->role == SST_ROLE_CONTROL));
    return http_reply_answer(q, out.body ? 0 : -ENOMEM, &out, "sessions");
}

static int session_change(struct http_request *q)
{
    static const char *const known[] = { "end", NULL };
    struct sst_api_answer out = { 0 };

    if (sst_api_members(q->body, known, out.error))
        return http_reply_error(q, MHD_HTTP_BAD_REQUEST, "session: %s", out.error);
    if (!json_is_true(json_object_get(q->body, "end")))
        return http_reply_error(q, MHD_HTTP_BAD_REQUEST, "session: give end: true");
    if (!http_session_end(&q->http->auth.sessions, q->name))
        return http_reply_error(q, MHD_HTTP_NOT_FOUND, "there is no session %.20s", q->name);
    out.body = json_pack("{s:b}", "ended", 1);
    return http_reply_answer(q, out.body ? 0 : -ENOMEM, &out, "session");
}

/* @param visit  NULL: names in the body */
static int change_visits(struct http_request *q, const char *visit)
{
    struct sst_api_answer out = { 0 };
    int err;

    if (q->role < SST_ROLE_CONTROL && (json_object_get(q->body, "keep") || json_object_get(q->body, "delete")))
        return http_reply_error(
            q, MHD_HTTP_FORBIDDEN,
            "this token is read-only: it marks visits as reviewed; use the other token to keep or delete them");
    err = api_of(q)->visit_change(api_of(q)->arg, visit, http_user(q), q->body, &out);
    return http_reply_answer(q, err, &out, "visit");
}

static int case_change(struct http_request *q)
{
    struct sst_api_answer out = { 0 };
    const int err = api_of(q)->case_change(api_of(q)->arg, q->name, q->body, &out);

    return http_reply_answer(q, err, &out, "video");
}

static int signing_key(struct http_request *q)
{
    struct sst_api_answer out = { 0 };
    char *text = NULL;
    const int err = api_of(q)->signing_key(api_of(q)->arg, &text);

    return err ? http_reply_answer(q, err, &out, "signing key")
               : http_reply_text(q, MHD_HTTP_OK, "application/x-pem-file", text);
}

static int visit_change(struct http_request *q)
{
    return change_visits(q, q->name);
}

static int visits_change(struct http_request *q)
{
    return change_visits(q, NULL);
}

static int visit_camera(struct http_request *q)
{
    return http_do_visit_picture(q, SST_VISIT_CAMERA);
}

static int visit_seen(struct http_request *q)
{
    return http_do_visit_picture(q, SST_VISIT_SEEN);
}

static int metrics(struct http_request *q)
{
    struct sst_api_answer out = { 0 };
    char *text = NULL;
    const int err = api_of(q)->metrics(api_of(q)->arg, &text);

    if (err)
        return http_reply_answer(q, err, &out, "metrics");
    return http_reply_text(q, MHD_HTTP_OK, "text/plain; version=0.0.4; charset=utf-8", text);
}

#define PICTURE(what, kind, name)                                                                                      \
    static int stream_##what(struct http_request *q)                                                                   \
    {                                                                                                                  \
        return http_do_stream(q, SST_PICTURE_##kind, name);                                                            \
    }                                                                                                                  \
    static int snapshot_##what(struct http_request *q)                                                                 \
    {                                                                                                                  \
        return http_do_snapshot(q, SST_PICTURE_##kind, name);                                                          \
    }
PICTURE(main, VIEW, "main")
PICTURE(view, VIEW, q->name)
PICTURE(camera, CAMERA, q->name)
PICTURE(labels, LABELS, "")
PICTURE(disparity, DISPARITY, "")

static int video_main(struct http_request *q)
{
    return http_do_watch(q, SST_PICTURE_VIEW, "main");
}

static int video_camera(struct http_request *q)
{
    return http_do_watch(q, SST_PICTURE_CAMERA, q->name);
}

static int video_view(struct http_request *q)
{
    return http_do_watch(q, SST_PICTURE_VIEW, q->name);
}

#define HANDLER(method, path, role, what, handler, ...) handler,
static http_handler_fn *const handlers[] = { ROUTES(HANDLER) };

http_handler_fn *http_handler(int index)
{
    return handlers[index];
}

#endif
