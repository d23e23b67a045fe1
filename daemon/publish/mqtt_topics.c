/* What is told to the broker and when, and what it tells us. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "daemon/publish/publish_internal.h"

#if WITH_MQTT

#define STATUS_NS        INT64_C(10000000000)
#define SOON_NS          INT64_C(500000000) /* after an event that changes the state: several come together */
#define PICTURE_QUIET_NS INT64_C(1000000000)

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

json_t *mqtt_short_status(const json_t *status)
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
        { "latency_ms", "live.latency_ms.p50" },
        { "focus_px", "live.focus_px" },
        { "storage", "storage.state" },
        { "recording", "storage.recording.active" },
    };
    json_t *o = json_object();
    int err = o ? 0 : -1;

    for (size_t i = 0; !err && i < ARRAY_LEN(taken); i++) {
        json_t *v = member(status, taken[i][1]);

        err = v ? json_object_set(o, taken[i][0], v) : 0;
    }
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

static bool tell_json(struct sst_mqtt *m, const char *topic, const json_t *o)
{
    char *text = json_dumps(o, JSON_COMPACT | JSON_REAL_PRECISION(6));
    bool done = text && mqtt_tell(m, topic, text, strlen(text), 1, true);

    free(text);
    return done;
}

static bool tell_text(struct sst_mqtt *m, const char *topic, const char *text)
{
    return mqtt_tell(m, topic, text, strlen(text), 1, true);
}

static void tell_status(struct sst_mqtt *m)
{
    struct sst_api_answer a = { 0 };
    json_t *o;
    const json_t *focus;
    char text[32] = "auto";

    if (m->api->status(m->api->arg, &a))
        return;
    o = mqtt_short_status(a.body);
    focus = json_object_get(o, "focus_px");
    if (json_is_number(focus))
        snprintf(text, sizeof(text), "%.6g", json_number_value(focus));
    if (o)
        (void)(tell_json(m, "status", o) &&
               tell_text(m, "record", json_is_true(json_object_get(o, "recording")) ? "ON" : "OFF") &&
               tell_text(m, "focus", text)); /* what the broker does not take now it gets with the next status */
    json_decref(o);
    json_decref(a.body);
}

static void add_hello(struct sst_mqtt *m);

/* Those whose state differs from what was told. */
static void tell_cameras(struct sst_mqtt *m)
{
    struct sst_api_answer a = { 0 };
    const json_t *camera;
    size_t i;

    if (m->api->cameras(m->api->arg, &a))
        return;
    if ((int)json_array_size(json_object_get(a.body, "cameras")) != m->cameras && mqtt_hello(m))
        add_hello(m); /* they were opened after connecting */
    json_array_foreach(json_object_get(a.body, "cameras"), i, camera)
    {
        const char *name = json_string_value(json_object_get(camera, "name"));
        const char *state = json_string_value(json_object_get(camera, "state"));
        char topic[96];

        if (i >= SST_CAMERAS_MAX || !name || !state || !strcmp(m->camera_state[i], state))
            continue;
        snprintf(topic, sizeof(topic), "camera/%.32s/state", name);
        if (!tell_text(m, topic, state)) {
            m->unread_events = true; /* the rest soon */
            break;
        }
        snprintf(m->camera_state[i], sizeof(m->camera_state[i]), "%s", state);
    }
    json_decref(a.body);
}

/* --- events ------------------------------------------------------------------------------------------------------- */

/* Does it change what the status or the cameras say? */
static bool of_state(const char *type)
{
    static const char *const types[] = { "state",   "camera-lost",  "camera-found", "trigger-lost", "trigger-found",
                                         "storage", "record-start", "record-stop",  "reload",       "skew" };

    for (size_t i = 0; i < ARRAY_LEN(types); i++)
        if (!strcmp(types[i], type))
            return true;
    return false;
}

static void tell_motion(struct sst_mqtt *m, const json_t *data)
{
    const char *zone = json_string_value(json_object_get(data, "zone"));
    char topic[96];

    if (!zone || !*zone || strpbrk(zone, "/+#"))
        return;
    snprintf(topic, sizeof(topic), "zone/%.48s/motion", zone);
    (void)tell_text(m, topic, json_is_true(json_object_get(data, "active")) ? "ON" : "OFF");
}

static bool tell_event(struct sst_mqtt *m, const char *text)
{
    json_t *o = json_loads(text, 0, NULL);
    const char *type = json_string_value(json_object_get(o, "type"));
    char topic[96];
    bool done = true;

    if (type) {
        snprintf(topic, sizeof(topic), "event/%.48s", type);
        done = mqtt_tell(m, topic, text, strlen(text), 1, false);
        if (done && !strcmp(type, "motion"))
            tell_motion(m, json_object_get(o, "data"));
        m->unread_events = m->unread_events || of_state(type);
    }
    json_decref(o);
    return done;
}

static void tell_events(struct sst_mqtt *m)
{
    uint64_t id;
    char *text;
    bool done = true;

    /* A motion event makes two messages. */
    while (done && m->under_way < SST_MQTT_UNDER_WAY - 1 && sst_events_next(m->api->events, m->seen, &id, &text)) {
        done = tell_event(m, text);
        free(text);
        if (!done)
            break;
        pthread_mutex_lock(&m->lock);
        m->n.missed += id - m->seen - 1;
        pthread_mutex_unlock(&m->lock);
        m->seen = id;
    }
}

/* --- picture ------------------------------------------------------------------------------------------------------ */

static void leave(struct sst_mqtt *m)
{
    if (m->joined)
        sst_outlet_leave(m->outlet);
    m->joined = false;
}

/* Pictures are made for viewers only: we are one from when a picture is due until it is there. */
static void tell_picture(struct sst_mqtt *m, int64_t now_ns)
{
    const struct sst_jpeg *jpeg;

    if (m->config->mqtt.picture_s <= 0 || now_ns < m->picture_ns || m->under_way)
        return;
    if (m->outlet && sst_outlet_is_shut(m->outlet)) {
        leave(m);
        sst_outlet_unref(m->outlet);
        m->outlet = NULL;
        m->picture = 0;
    }
    if (!m->outlet && m->api->outlet(m->api->arg, SST_PICTURE_VIEW, "main", &m->outlet)) {
        m->outlet = NULL;
        m->picture_ns = now_ns + PICTURE_QUIET_NS;
        return;
    }
    if (!m->joined)
        sst_outlet_join(m->outlet);
    m->joined = true;
    jpeg = sst_outlet_get(m->outlet, m->picture);
    if (!jpeg)
        return;
    if (mqtt_tell(m, "picture", jpeg->data, jpeg->bytes, 0, true)) {
        m->picture = jpeg->number;
        m->picture_ns = now_ns + (int64_t)(m->config->mqtt.picture_s * 1e9);
        leave(m);
    }
    sst_jpeg_unref(jpeg);
}

/* --- what is due -------------------------------------------------------------------------------------------------- */

static void forget_hello(struct sst_mqtt *m)
{
    mqtt_messages_free(m->hello, m->hellos);
    m->hello = NULL;
    m->hellos = m->hello_next = 0;
}

static void add_hello(struct sst_mqtt *m)
{
    struct sst_api_answer a = { 0 };
    int n;

    forget_hello(m);
    if (m->api->cameras(m->api->arg, &a))
        a.body = NULL;
    m->cameras = (int)json_array_size(json_object_get(a.body, "cameras"));
    n = m->config->mqtt.discovery[0] ? mqtt_announce(&m->hello, m->config, a.body) : 0;
    json_decref(a.body);
    m->hellos = sst_max_int(n, 0);
    m->asked = !m->hellos;
}

bool mqtt_hello(struct sst_mqtt *m)
{
    char node[128], pattern[SST_MQTT_TOPIC_MAX];

    while (m->hello_next < m->hellos) {
        const struct mqtt_message *h = &m->hello[m->hello_next];

        if (!mqtt_tell_at(m, h->topic, h->payload, strlen(h->payload), 1, true))
            return false;
        m->hello_next++;
    }
    if (!m->asked) {
        mqtt_node(node, m->config);
        snprintf(pattern, sizeof(pattern), "%s/+/%s/+/config", m->config->mqtt.discovery, node);
        m->asked = mqtt_ask(m, pattern);
    }
    return true;
}

void mqtt_withdraw(struct sst_mqtt *m)
{
    for (int i = 0; i < m->hellos; i++)
        m->hello[i].payload[0] = 0; /* an empty retained message removes the one before */
    m->hello_next = 0;
    m->asked = true;
}

/* The id of an entity in "PREFIX/COMPONENT/NODE/ID/config" of ours. @return false: another's topic */
static bool read_id(const struct sst_mqtt *m, const char *topic, char id[64])
{
    const size_t n = strlen(m->config->mqtt.discovery);
    char node[128];
    int end = 0;

    mqtt_node(node, m->config);
    if (strncmp(topic, m->config->mqtt.discovery, n) != 0 || topic[n] != '/')
        return false;
    topic += n + 1;
    topic += strcspn(topic, "/");
    topic += *topic == '/';
    if (strncmp(topic, node, strlen(node)) != 0 || topic[strlen(node)] != '/')
        return false;
    return sscanf(topic + strlen(node) + 1, "%63[^/]/config%n", id, &end) == 1 && end &&
           !topic[strlen(node) + 1 + (size_t)end];
}

void mqtt_found(struct sst_mqtt *m, const char *topic)
{
    char id[64], state[96];

    if (!m->config->mqtt.discovery[0] || !read_id(m, topic, id))
        return;
    for (int i = 0; i < m->hellos; i++)
        if (!strcmp(m->hello[i].topic, topic))
            return;
    if (!m->hellos || (!m->cameras && !strncmp(id, "camera_", 7)))
        return; /* which cameras there are is not known yet */
    if (!mqtt_tell_at(m, topic, "", 0, 1, true))
        m->asked = false; /* once more, later */
    if (!strncmp(id, "zone_", 5)) {
        snprintf(state, sizeof(state), "zone/%s/motion", id + 5);
        (void)mqtt_tell(m, state, "", 0, 1, true);
    }
}

void mqtt_greet(struct sst_mqtt *m)
{
    mqtt_forget(m);
    add_hello(m);
    (void)tell_text(m, "available", "online");
    m->status_ns = m->picture_ns = 0;
}

void mqtt_due(struct sst_mqtt *m)
{
    const int64_t now_ns = sst_clock_now_ns();

    if (!mqtt_hello(m))
        return;
    tell_events(m);
    if (m->unread_events && m->status_ns > now_ns + SOON_NS)
        m->status_ns = now_ns + SOON_NS;
    if (now_ns >= m->status_ns && m->under_way < SST_MQTT_UNDER_WAY / 2) {
        m->unread_events = false;
        m->status_ns = now_ns + STATUS_NS;
        tell_status(m);
        tell_cameras(m);
    }
    tell_picture(m, now_ns);
}

void mqtt_forget(struct sst_mqtt *m)
{
    leave(m);
    sst_outlet_unref(m->outlet);
    m->outlet = NULL;
    m->picture = 0;
    forget_hello(m);
    memset(m->camera_state, 0, sizeof(m->camera_state));
}

/* --- commands ----------------------------------------------------------------------------------------------------- */

static int record(struct sst_mqtt *m, const char *text, struct sst_api_answer *a)
{
    const bool on = !strcasecmp(text, "ON");
    json_t *request;
    int err;

    if (!on && strcasecmp(text, "OFF") != 0) {
        snprintf(a->error, sizeof(a->error), "it is ON or OFF");
        return -EINVAL;
    }
    request = json_pack("{s:s}", "action", on ? "start" : "stop");
    err = request ? m->api->record(m->api->arg, request, a) : -ENOMEM;
    json_decref(request);
    return err;
}

static int focus(struct sst_mqtt *m, const char *text, struct sst_api_answer *a)
{
    char *end;
    const double px = strtod(text, &end);
    const bool number = end != text && !*end && isfinite(px) && strspn(text, "0123456789+-.eE") == strlen(text);
    json_t *settings;
    int err;

    if (!number && strcasecmp(text, "auto") != 0) {
        snprintf(a->error, sizeof(a->error), "it is a number of pixels per spacing, or auto");
        return -EINVAL;
    }
    settings = json_pack("{s:o}", "focus_px", number ? json_real(px) : json_null());
    err = settings ? m->api->view_change(m->api->arg, "main", settings, a) : -ENOMEM;
    json_decref(settings);
    return err;
}

void mqtt_command(struct sst_mqtt *m, const char *topic, const void *payload, size_t bytes, bool retained)
{
    struct sst_api_answer a = { 0 };
    char text[40];
    int err;

    if (retained) /* an old wish, that a new connection must not repeat */
        return;
    snprintf(text, sizeof(text), "%.*s", (int)(bytes < sizeof(text) ? bytes : 0), (const char *)payload);
    for (char *c = text; *c; c++)
        if ((unsigned char)*c < ' ')
            *c = '?';
    if (!strcmp(topic, "record/set"))
        err = record(m, text, &a);
    else if (!strcmp(topic, "focus/set"))
        err = focus(m, text, &a);
    else
        return;
    if (err)
        sst_log_warning("mqtt: %s/%s %s: %s", m->config->mqtt.topic, topic, text,
                        a.error[0] ? a.error : strerror(-err));
    else
        json_decref(a.body);
    pthread_mutex_lock(&m->lock);
    m->n.commands++;
    pthread_mutex_unlock(&m->lock);
    m->status_ns = 0; /* the answer is the new state */
}

#endif
