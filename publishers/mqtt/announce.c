/* Announcement of the array to Home Assistant, as one device.
 *
 * The broker's last one is read before it is replaced: components that the array no longer has are sent once with their
 * platform alone, which removes their entities. Topics of single entities, as earlier versions had them, get Home
 * Assistant's migration marker before the device comes, so that entities keep their names and history, and are emptied
 * when it had time to move them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "publishers/mqtt/mqtt_internal.h"

#define GRACE_NS  INT64_C(200000000)   /* for retained messages that follow the answer to the subscription */
#define ANSWER_NS INT64_C(10000000000) /* without an answer */
#define LATE_NS   INT64_C(2000000000)  /* for Home Assistant, which moves entities one by one */
#define BYTES_MAX ((size_t)1 << 20)    /* of an announcement that is read */
#define MARKER    "{\"migrate_discovery\":true}"

static void device_topic(const struct mqtt *m, char out[MQTT_TOPIC_MAX])
{
    char node[128];

    mqtt_node(node, m->config);
    snprintf(out, MQTT_TOPIC_MAX, "%.150s/device/%s/config", m->config->mqtt.discovery, node);
}

static json_t *components(const struct mqtt *m)
{
    return json_object_get(m->device, "cmps");
}

static const char *text_of(const json_t *o, const char *key)
{
    const char *text = json_string_value(json_object_get(o, key));

    return text ? text : "";
}

/* Does the array have this entity? */
static bool is_present(const struct mqtt *m, const char *id, const char *platform)
{
    return !strcmp(text_of(json_object_get(components(m), id), "p"), platform);
}

/* --- the list of messages ----------------------------------------------------------------------------------------- */

/* @param payload  owned from then on; NULL: no memory, nothing is added */
static void add(struct mqtt *m, const char *topic, char *payload, bool late)
{
    struct mqtt_message *list = realloc(m->announcement, (size_t)(m->announcements + 1) * sizeof(*list));

    if (list)
        m->announcement = list;
    if (list && payload)
        list[m->announcements] = (struct mqtt_message){ .topic = strdup(topic), .payload = payload, .late = late };
    if (list && payload && list[m->announcements].topic)
        m->announcements++;
    else
        free(payload);
}

static void clear_list(struct mqtt *m)
{
    mqtt_messages_free(m->announcement, m->announcements);
    m->announcement = NULL;
    m->announcements = m->announced = 0;
}

static const char *const state_keys[] = { "state_topic", "image_topic", "json_attributes_topic", "topic" };

static bool is_used(const struct mqtt *m, const char *topic)
{
    const char *id;
    json_t *component;

    json_object_foreach(components(m), id, component)
    {
        for (size_t i = 0; i < ARRAY_LEN(state_keys); i++)
            if (!strcmp(text_of(component, state_keys[i]), topic))
                return true;
    }
    return false;
}

/* Empty the retained states of an entity that is gone. */
static void add_states(struct mqtt *m, const json_t *component)
{
    const size_t n = strlen(m->config->mqtt.topic);

    for (size_t i = 0; i < ARRAY_LEN(state_keys); i++) {
        const char *topic = text_of(component, state_keys[i]);

        if (!strncmp(topic, m->config->mqtt.topic, n) && topic[n] == '/' && !strpbrk(topic, "+#") && !is_used(m, topic))
            add(m, topic, strdup(""), false);
    }
}

/* The announcement with components that are to be removed. */
static char *removal_text(const struct mqtt *m)
{
    json_t *whole = json_copy(m->device), *all = json_copy(components(m)), *component;
    const char *id;
    char *text;

    json_object_foreach(m->stale, id, component)
    {
        json_object_set_new(all, id, json_pack("{s:s}", "p", text_of(component, "p")));
    }
    json_object_set_new(whole, "cmps", all);
    text = json_dumps(whole, JSON_COMPACT);
    json_decref(whole);
    return text;
}

static void make_list(struct mqtt *m)
{
    char topic[MQTT_TOPIC_MAX];
    const char *key;
    json_t *component;

    clear_list(m);
    device_topic(m, topic);
    json_object_foreach(m->old, key, component)
    {
        if (is_present(m, text_of(component, "id"), text_of(component, "p")))
            add(m, key, strdup(MARKER), false);
    }
    if (json_object_size(m->stale))
        add(m, topic, removal_text(m), false);
    add(m, topic, json_dumps(m->device, JSON_COMPACT), false);
    json_object_foreach(m->stale, key, component)
    {
        add_states(m, component);
    }
    json_object_clear(m->stale);
    json_object_foreach(m->old, key, component)
    {
        add(m, key, strdup(""), true);
        if (!is_present(m, text_of(component, "id"), text_of(component, "p")))
            add_states(m, component);
    }
}

/* --- announcements that the broker has ---------------------------------------------------------------------------- */

/* Platform and id of an entity in "PREFIX/PLATFORM/NODE/ID/config" of ours. @return false: another's topic */
static bool read_entity(const struct mqtt *m, const char *topic, char platform[64], char id[128])
{
    const size_t n = strlen(m->config->mqtt.discovery);
    char node[128], of[128];
    int end = 0;

    mqtt_node(node, m->config);
    if (strncmp(topic, m->config->mqtt.discovery, n) != 0 || topic[n] != '/')
        return false;
    topic += n + 1;
    return sscanf(topic, "%63[^/]/%127[^/]/%127[^/]/config%n", platform, of, id, &end) == 3 && end && !topic[end] &&
           !strcmp(of, node);
}

/* Components of a message for the device: those that the array lacks are stale. */
static void read_device(struct mqtt *m, const json_t *message)
{
    const char *id;
    json_t *component;

    json_object_foreach(json_object_get(message, "cmps"), id, component)
    {
        if (is_present(m, id, text_of(component, "p")))
            continue;
        if (!m->cameras && !strncmp(id, "camera_", 7)) /* which cameras there are is not known yet */
            json_object_set(components(m), id, component);
        else if (!json_object_get(components(m), id))
            json_object_set(m->stale, id, component);
    }
}

void mqtt_on_announced(struct mqtt *m, const char *topic, const void *payload, size_t bytes)
{
    char own[MQTT_TOPIC_MAX], platform[64], id[128];
    const int64_t now_ns = sst_clock_now_ns();
    json_t *message;

    if (!m->device)
        return;
    device_topic(m, own);
    if (strcmp(topic, own) != 0 && !read_entity(m, topic, platform, id))
        return;
    message = bytes <= BYTES_MAX ? json_loadb(payload, bytes, 0, NULL) : NULL;
    if (!strcmp(topic, own)) {
        read_device(m, message);
    } else if (m->cameras || strncmp(id, "camera_", 7) != 0) {
        json_t *component = json_is_object(message) ? json_copy(message) : json_object();

        json_object_set_new(component, "p", json_string(platform));
        json_object_set_new(component, "id", json_string(id));
        json_object_set_new(m->old, topic, component);
    }
    json_decref(message);
    if (m->announce_ns == INT64_MAX || m->announce_ns < now_ns + GRACE_NS)
        m->announce_ns = now_ns + GRACE_NS;
}

void mqtt_on_subscribed(struct mqtt *m, int id)
{
    if (m->asked && id == m->ask_id && m->announce_ns != INT64_MAX)
        m->announce_ns = sst_clock_now_ns() + GRACE_NS;
}

static bool ask(struct mqtt *m)
{
    char node[128], topic[MQTT_TOPIC_MAX];
    int first;

    mqtt_node(node, m->config);
    snprintf(topic, sizeof(topic), "%s/+/%s/+/config", m->config->mqtt.discovery, node);
    if (!mqtt_subscribe(m, topic, &first))
        return false;
    device_topic(m, topic);
    return mqtt_subscribe(m, topic, &m->ask_id);
}

/* --- the verbs ---------------------------------------------------------------------------------------------------- */

void mqtt_announce_reset(struct mqtt *m)
{
    clear_list(m);
    json_decref(m->device);
    json_decref(m->stale);
    json_decref(m->old);
    m->device = m->stale = m->old = NULL;
    m->announce_ns = m->late_ns = INT64_MAX;
}

void mqtt_announce_begin(struct mqtt *m)
{
    json_t *cameras = NULL;

    mqtt_announce_reset(m);
    if (sst_publisher_ask(&m->publisher, "/api/v1/cameras", NULL, &cameras, NULL))
        cameras = NULL;
    m->cameras = (int)json_array_size(json_object_get(cameras, "cameras"));
    m->device = m->config->mqtt.discovery[0] ? mqtt_device(m->config, cameras) : NULL;
    m->stale = json_object();
    m->old = json_object();
    m->asked = false;
    json_decref(cameras);
}

/* They were opened after connecting, for example. */
void mqtt_announce_cameras(struct mqtt *m, const json_t *cameras)
{
    const int n = (int)json_array_size(json_object_get(cameras, "cameras"));
    json_t *before = m->device;

    if (!before || n == m->cameras)
        return;
    m->device = mqtt_device(m->config, cameras);
    if (m->device) {
        m->cameras = n;
        read_device(m, before);
        m->announce_ns = m->announce_ns == INT64_MAX ? sst_clock_now_ns() : m->announce_ns;
        m->asked = false; /* topics of single cameras were passed over */
        json_decref(before);
    } else {
        m->device = before;
    }
}

bool mqtt_announce_step(struct mqtt *m)
{
    const int64_t now_ns = sst_clock_now_ns();

    if (m->device && !m->asked) {
        m->asked = ask(m);
        m->announce_ns = now_ns + ANSWER_NS;
    }
    if (m->announce_ns != INT64_MAX) {
        if (now_ns < m->announce_ns)
            return false;
        make_list(m);
        m->announce_ns = INT64_MAX;
    }
    while (m->announced < m->announcements) {
        const struct mqtt_message *h = &m->announcement[m->announced];

        if (h->late && now_ns < m->late_ns)
            return true;
        if (!mqtt_publish_at(m, h->topic, h->payload, strlen(h->payload), MQTT_SURE | MQTT_RETAIN))
            return false;
        m->late_ns = h->late ? m->late_ns : now_ns + LATE_NS;
        if (!h->payload[0])
            json_object_del(m->old, h->topic);
        m->announced++;
    }
    return true;
}

/* All topics that are retained, of the cameras and zones as they are now. */
static void add_retained(struct mqtt *m)
{
    static const char *const fixed[] = { "status", "record", "focus", "picture", "visit", "visit/picture", "available" };
    static const char *const of_zone[] = { "motion", "visited", "visit", "picture", "crossed" };
    const char *top = m->config->mqtt.topic, *id, *labels[SST_ZONE_LABELS];
    char topic[MQTT_TOPIC_MAX];
    json_t *component;

    for (int z = 0; z < m->config->zones; z++) {
        const struct sst_zone *zone = &m->config->zone[z];
        const int n = mqtt_zone_labels(zone, labels);

        for (size_t i = 0; i < ARRAY_LEN(of_zone) + (size_t)n; i++) {
            const bool label = i >= ARRAY_LEN(of_zone);

            snprintf(topic, sizeof(topic), "%s/zone/%s/%s%s", top, zone->name, label ? "label/" : "",
                     label ? labels[i - ARRAY_LEN(of_zone)] : of_zone[i]);
            add(m, topic, strdup(""), false);
        }
    }
    json_object_foreach(components(m), id, component)
    {
        if (strncmp(id, "camera_", 7) != 0)
            continue;
        snprintf(topic, sizeof(topic), "%s/camera/%s/state", top, id + 7);
        add(m, topic, strdup(""), false);
    }
    for (size_t i = 0; i < ARRAY_LEN(fixed); i++) {
        snprintf(topic, sizeof(topic), "%s/%s", top, fixed[i]);
        add(m, topic, strdup(""), false);
    }
}

void mqtt_announce_withdraw(struct mqtt *m, bool all)
{
    char topic[MQTT_TOPIC_MAX];
    const char *key;
    json_t *component;

    clear_list(m);
    m->announce_ns = INT64_MAX;
    m->asked = true;
    if (m->device) {
        device_topic(m, topic);
        add(m, topic, strdup(""), false);
    }
    json_object_foreach(m->old, key, component)
    {
        add(m, key, strdup(""), false);
    }
    if (all)
        add_retained(m);
}
