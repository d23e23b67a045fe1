/* Topics: their messages, the time of each, and commands. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/clock.h"
#include "base/log.h"
#include "publishers/mqtt/mqtt_internal.h"

#define STATUS_NS        INT64_C(10000000000)
#define SOON_NS          INT64_C(500000000) /* after an event that changes the state: several come together */
#define PICTURE_QUIET_NS INT64_C(1000000000)
#define ONLINE_NS        INT64_C(1000000000)

/* --- status ------------------------------------------------------------------------------------------------------- */

/* Member of an object within objects, "live.latency_ms.p50"; NULL: not there. */
static json_t *member(const json_t *o, const char *path)
{
    char key[64];

    while (o && *path) {
        const size_t n = strcspn(path, ".");

        snprintf(key, sizeof(key), "%.*s", (int)n, path);
        o = json_object_get(o, key);
        path += n + (path[n] == '.');
    }
    return (json_t *)(uintptr_t)o;
}

/* NULL: no memory */
static json_t *short_status(const json_t *status)
{
    static const char *const taken[][2] = {
        { "state", "state" },
        { "reason", "reason" },
        { "time", "time" },
        { "version", "version" },
        { "uptime_s", "uptime_s" },
        { "cameras", "capture.cameras" },
        { "present", "capture.present" },
        { "rate_hz", "capture.rate_hz" },
        { "sets", "capture.sets" },
        { "skew_us", "capture.skew_us.p99" },
        { "live", "live.ready" },
        { "live_hz", "live.rate_hz" },
        { "too_slow", "live.too_slow" },
        { "removed", "live.removed" },
        { "noticed", "noticed" },
        { "latency_ms", "live.latency_ms.p50" },
        { "focus_px", "live.focus_px" },
        { "storage", "storage.state" },
        { "storage_limit", "storage.limit" },
        { "recording", "storage.recording.active" },
    };
    json_t *o = json_object();
    int err = o ? 0 : -1;

    for (size_t i = 0; !err && i < ARRAY_LEN(taken); i++) {
        json_t *v = member(status, taken[i][1]);

        err = v ? json_object_set(o, taken[i][0], v) : 0;
    }
    if (!err && json_is_true(member(status, "storage.recording.reduced"))) /* which goes on all the time */
        err = json_object_set_new(o, "recording", json_false());
    for (int i = 0; !err && i < 2; i++) {
        const json_t *v = member(status, i ? "storage.used_bytes" : "storage.free_bytes");

        if (v)
            err = json_object_set_new(o, i ? "used_gb" : "free_gb", json_real(round(json_number_value(v) / 1e7) / 100));
    }
    if (err) {
        json_decref(o);
        return NULL;
    }
    return o;
}

static bool publish_json(struct mqtt *m, const char *topic, const json_t *o)
{
    char *text = json_dumps(o, JSON_COMPACT | JSON_REAL_PRECISION(6));
    bool done = text && mqtt_publish(m, topic, text, strlen(text), MQTT_SURE | MQTT_RETAIN);

    free(text);
    return done;
}

static bool publish_text(struct mqtt *m, const char *topic, const char *text)
{
    return mqtt_publish(m, topic, text, strlen(text), MQTT_SURE | MQTT_RETAIN);
}

/* The setting, not its value now: `auto` stays `auto`. @return false: not known now, or not accepted */
static bool publish_focus(struct mqtt *m)
{
    json_t *answer = NULL;
    const json_t *view;
    char text[32] = "";
    size_t i;

    if (sst_publisher_ask(&m->publisher, "/api/v1/views", NULL, &answer, NULL))
        return false;
    json_array_foreach(json_object_get(answer, "views"), i, view)
    {
        const char *id = json_string_value(json_object_get(view, "id"));
        const json_t *px = member(view, "settings.focus_px");

        if (id && !strcmp(id, "main"))
            snprintf(text, sizeof(text), json_is_number(px) ? "%.6g" : "auto", json_number_value(px));
    }
    json_decref(answer);
    return *text && publish_text(m, "focus", text);
}

static void publish_status(struct mqtt *m)
{
    json_t *answer = NULL, *o;

    if (sst_publisher_ask(&m->publisher, "/api/v1/status", NULL, &answer, NULL))
        return;
    o = short_status(answer);
    if (o)
        (void)(publish_json(m, "status", o) &&
               publish_text(m, "record", json_is_true(json_object_get(o, "recording")) ? "ON" : "OFF") &&
               publish_focus(m)); /* messages not accepted now are sent with the next status */
    json_decref(o);
    json_decref(answer);
}

/* Cameras with a state other than the published one. */
static void publish_cameras(struct mqtt *m)
{
    json_t *answer = NULL;
    const json_t *camera;
    size_t i;

    if (sst_publisher_ask(&m->publisher, "/api/v1/cameras", NULL, &answer, NULL))
        return;
    mqtt_announce_cameras(m, answer);
    json_array_foreach(json_object_get(answer, "cameras"), i, camera)
    {
        const char *name = json_string_value(json_object_get(camera, "name"));
        const char *state = json_string_value(json_object_get(camera, "state"));
        char topic[96];

        if (i >= SST_CAMERAS_MAX || !name || !state || !strcmp(m->camera_state[i], state))
            continue;
        snprintf(topic, sizeof(topic), "camera/%.32s/state", name);
        if (!publish_text(m, topic, state)) {
            m->state_changed = true; /* the rest soon */
            break;
        }
        snprintf(m->camera_state[i], sizeof(m->camera_state[i]), "%s", state);
    }
    json_decref(answer);
}

/* --- events ------------------------------------------------------------------------------------------------------- */

/* True for events after which status or cameras differ. */
static bool changes_state(const char *type)
{
    static const char *const types[] = { "state",     "camera-lost",  "camera-found", "trigger-lost", "trigger-found",
                                         "storage",   "record-start", "record-stop",  "reload",       "skew",
                                         "host-lost", "host-found",   "device-lost",  "device-found",
                                         "too-slow",  "visit" };

    for (size_t i = 0; i < ARRAY_LEN(types); i++)
        if (!strcmp(types[i], type))
            return true;
    return false;
}

static void publish_motion(struct mqtt *m, const json_t *data)
{
    const char *zone = json_string_value(json_object_get(data, "zone"));
    char topic[96];

    if (!zone || !*zone || strpbrk(zone, "/+#"))
        return;
    snprintf(topic, sizeof(topic), "zone/%.48s/motion", zone);
    (void)publish_text(m, topic, json_is_true(json_object_get(data, "active")) ? "ON" : "OFF");
}

static bool publish_event(struct mqtt *m, const char *text)
{
    json_t *o = json_loads(text, 0, NULL);
    const char *type = json_string_value(json_object_get(o, "type"));
    char topic[96];
    bool done = true;

    if (type) {
        snprintf(topic, sizeof(topic), "event/%.48s", type);
        done = mqtt_publish(m, topic, text, strlen(text), MQTT_SURE);
        if (done && !strcmp(type, "motion"))
            publish_motion(m, json_object_get(o, "data"));
        if (done && !strcmp(type, "visit"))
            mqtt_on_visit(m, json_object_get(o, "data"));
        if (!strcmp(type, "line"))
            mqtt_on_line(m, json_object_get(o, "data"));
        if (done && !strcmp(type, "start")) { /* the service begins anew: nobody is known to be there */
            memset(m->visit, 0, sizeof(m->visit));
            mqtt_visits_begin(m);
        }
        m->state_changed = m->state_changed || changes_state(type);
    }
    json_decref(o);
    return done;
}

static void publish_events(struct mqtt *m)
{
    char *line;

    /* A motion event makes two messages; a visit's wait in a list. */
    while (mqtt_visits_step(m) && m->in_flight < MQTT_IN_FLIGHT_MAX - 1 && (line = mqtt_next_event(m))) {
        if (!publish_event(m, line)) {
            mqtt_return_event(m, line);
            break;
        }
        free(line);
    }
}

/* --- picture ------------------------------------------------------------------------------------------------------ */

static void publish_picture(struct mqtt *m, int64_t now_ns)
{
    uint8_t *data;
    size_t bytes;

    if (m->config->mqtt.picture_s <= 0 || now_ns < m->picture_ns || m->in_flight ||
        !mqtt_fetch_picture(m, "", &data, &bytes))
        return;
    m->picture_ns = now_ns + PICTURE_QUIET_NS;
    if (data && mqtt_publish(m, "picture", data, bytes, MQTT_RETAIN))
        m->picture_ns = now_ns + (int64_t)(m->config->mqtt.picture_s * 1e9);
    free(data);
}

/* --- due work ----------------------------------------------------------------------------------------------------- */

/* Once a second at most: another program may say the opposite as often. */
static void publish_online(struct mqtt *m)
{
    const int64_t now_ns = sst_clock_now_ns();

    if (m->online_due && now_ns - m->online_ns >= ONLINE_NS && publish_text(m, "available", "online")) {
        m->online_due = false;
        m->online_ns = now_ns;
    }
}

void mqtt_topics_begin(struct mqtt *m)
{
    mqtt_topics_reset(m);
    mqtt_announce_begin(m);
    m->online_due = true;
    m->online_ns = -ONLINE_NS;
    publish_online(m);
    mqtt_visits_begin(m);
    m->status_ns = m->picture_ns = 0;
}

void mqtt_topics_step(struct mqtt *m)
{
    const int64_t now_ns = sst_clock_now_ns();

    publish_online(m);
    if (!mqtt_announce_step(m))
        return;
    publish_events(m);
    if (m->state_changed && m->status_ns > now_ns + SOON_NS)
        m->status_ns = now_ns + SOON_NS;
    if (now_ns >= m->status_ns && m->in_flight < MQTT_IN_FLIGHT_MAX / 2) {
        m->state_changed = false;
        m->status_ns = now_ns + STATUS_NS;
        publish_status(m);
        publish_cameras(m);
    }
    if (!mqtt_visits_picture(m))
        publish_picture(m, now_ns);
}

void mqtt_topics_reset(struct mqtt *m)
{
    mqtt_announce_reset(m);
    memset(m->camera_state, 0, sizeof(m->camera_state));
}

/* --- commands ----------------------------------------------------------------------------------------------------- */

/* @param why  out [SST_LOG_MAX] */
static int record(struct mqtt *m, const char *text, json_t **answer, char *why)
{
    const bool on = !strcasecmp(text, "ON");
    json_t *request;
    int err;

    if (!on && strcasecmp(text, "OFF") != 0) {
        snprintf(why, SST_LOG_MAX, "it must be ON or OFF");
        return -EINVAL;
    }
    request = json_pack("{s:s}", "action", on ? "start" : "stop");
    err = request ? sst_publisher_ask(&m->publisher, "/api/v1/record", request, answer, why) : -ENOMEM;
    json_decref(request);
    return err;
}

static int focus(struct mqtt *m, const char *text, json_t **answer, char *why)
{
    char *end;
    const double px = strtod(text, &end);
    const bool number = end != text && !*end && isfinite(px) && strspn(text, "0123456789+-.eE") == strlen(text);
    json_t *request;
    int err;

    if (!number && strcasecmp(text, "auto") != 0) {
        snprintf(why, SST_LOG_MAX, "it must be a number of pixels per spacing, or auto");
        return -EINVAL;
    }
    request = json_pack("{s:o}", "focus_px", number ? json_real(px) : json_null());
    err = request ? sst_publisher_ask(&m->publisher, "/api/v1/views/main", request, answer, why) : -ENOMEM;
    json_decref(request);
    return err;
}

static int snapshot(struct mqtt *m, const char *text, json_t **answer, char *why)
{
    json_t *request = json_object();
    int err = -EINVAL;

    if (strcasecmp(text, "ON") != 0)
        snprintf(why, SST_LOG_MAX, "it must be ON");
    else
        err = request ? sst_publisher_ask(&m->publisher, "/api/v1/snapshot", request, answer, why) : -ENOMEM;
    json_decref(request);
    return err;
}

void mqtt_on_command(struct mqtt *m, const char *topic, const void *payload, size_t bytes, bool retained)
{
    char text[40], why[SST_LOG_MAX] = "";
    json_t *answer = NULL;
    int err;

    if (retained) /* an old command, that a new connection must not repeat */
        return;
    snprintf(text, sizeof(text), "%.*s", (int)(bytes < sizeof(text) ? bytes : 0), (const char *)payload);
    for (char *c = text; *c; c++)
        if ((unsigned char)*c < ' ')
            *c = '?';
    if (!strcmp(topic, "record/set"))
        err = record(m, text, &answer, why);
    else if (!strcmp(topic, "focus/set"))
        err = focus(m, text, &answer, why);
    else if (!strcmp(topic, "snapshot/set"))
        err = snapshot(m, text, &answer, why);
    else
        return;
    if (err)
        sst_log_warning("mqtt: %s/%s %s: %s", m->config->mqtt.topic, topic, text, why[0] ? why : strerror(-err));
    else
        json_decref(answer);
    m->status_ns = 0; /* the answer is the new state */
}
