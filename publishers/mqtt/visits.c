/* Visits for Home Assistant and others: present visitors by zone, the last one of each zone with its picture, triggers.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "publishers/mqtt/mqtt_internal.h"

const char *const mqtt_labels[] = { "Pedestrian", "Bicyclist", "Car" };
const int mqtt_labels_count = (int)ARRAY_LEN(mqtt_labels);

int mqtt_zone_labels(const struct sst_zone *zone, const char **out)
{
    int n = 0;

    while (n < SST_ZONE_LABELS && zone->labels[n][0]) {
        out[n] = zone->labels[n];
        n++;
    }
    for (int i = 0; !zone->labels[0][0] && i < mqtt_labels_count; i++)
        out[n++] = mqtt_labels[i];
    return n;
}

/* --- messages, one after the other as the broker accepts them ----------------------------------------------------- */

static void later(struct mqtt *m, bool retain, const char *payload, const char *fmt, ...) SST_PRINTF(4, 5);
static void later(struct mqtt *m, bool retain, const char *payload, const char *fmt, ...)
{
    struct mqtt_later *l = &m->later[(m->first_later + m->laters) % MQTT_LATER_MAX];
    char topic[MQTT_TOPIC_MAX];
    va_list args;

    if (m->laters == MQTT_LATER_MAX) /* more than all zones and labels make of one event */
        return;
    va_start(args, fmt);
    vsnprintf(topic, sizeof(topic), fmt, args);
    va_end(args);
    *l = (struct mqtt_later){ .topic = strdup(topic), .payload = strdup(payload), .retain = retain };
    if (l->topic && l->payload) {
        m->laters++;
        return;
    }
    free(l->topic);
    free(l->payload);
}

/* For an event entity: its type and what is known. @param zone  NULL: anywhere */
static void later_event(struct mqtt *m, const char *type, const json_t *data, const char *zone)
{
    json_t *o = json_deep_copy(data);
    char *text;

    json_object_set_new(o, "event_type", json_string(type));
    text = json_dumps(o, JSON_COMPACT | JSON_REAL_PRECISION(6));
    if (text && zone)
        later(m, false, text, "zone/%s/event", zone);
    else if (text)
        later(m, false, text, "visit/event");
    free(text);
    json_decref(o);
}

bool mqtt_visits_step(struct mqtt *m)
{
    while (m->laters) {
        struct mqtt_later *l = &m->later[m->first_later];

        if (!mqtt_publish(m, l->topic, l->payload, strlen(l->payload), MQTT_SURE | (l->retain ? MQTT_RETAIN : 0)))
            return false;
        free(l->topic);
        free(l->payload);
        m->first_later = (m->first_later + 1) % MQTT_LATER_MAX;
        m->laters--;
    }
    return true;
}

/* --- visitors by zone --------------------------------------------------------------------------------------------- */

static uint32_t zones_of(const struct mqtt *m, const json_t *data)
{
    const json_t *name;
    uint32_t zones = 0;
    size_t i;

    json_array_foreach(json_object_get(data, "zones"), i, name)
    {
        for (int k = 0; k < m->config->zones; k++)
            if (json_is_string(name) && !strcmp(m->config->zone[k].name, json_string_value(name)))
                zones |= 1u << k;
    }
    return zones;
}

static struct mqtt_visit *find(struct mqtt *m, const char *name)
{
    for (int i = 0; i < MQTT_VISITS_MAX; i++)
        if (!strcmp(m->visit[i].name, name))
            return &m->visit[i];
    return NULL;
}

/* Whether somebody, and somebody of each label, is in a zone. */
static void publish_zone(struct mqtt *m, int zone)
{
    const char *labels[SST_ZONE_LABELS], *name = m->config->zone[zone].name;
    const int n = mqtt_zone_labels(&m->config->zone[zone], labels);
    bool any = false, there[SST_ZONE_LABELS] = { false };

    for (int i = 0; i < MQTT_VISITS_MAX; i++) {
        const struct mqtt_visit *v = &m->visit[i];

        if (!v->name[0] || !(v->zones & 1u << zone))
            continue;
        any = true;
        for (int k = 0; k < n; k++)
            there[k] |= !strcmp(v->label, labels[k]);
    }
    later(m, true, any ? "ON" : "OFF", "zone/%s/visited", name);
    for (int k = 0; k < n; k++)
        later(m, true, there[k] ? "ON" : "OFF", "zone/%s/label/%s", name, labels[k]);
}

void mqtt_visits_begin(struct mqtt *m)
{
    for (int i = 0; i < m->config->zones; i++)
        if (!m->config->zone[i].mask && !m->config->zone[i].line)
            publish_zone(m, i);
}

/* Its picture is fetched when the one before has been; of more than fit the newest are. */
static void want_picture(struct mqtt *m, const char *name, uint32_t zones)
{
    struct mqtt_wanted *w = m->wanteds ? &m->wanted[m->wanteds - 1] : NULL;

    if (w && !strcmp(w->visit, name)) {
        w->zones |= zones;
        return;
    }
    if (m->wanteds == MQTT_WANTED_MAX)
        memmove(m->wanted, m->wanted + 1, (size_t)--m->wanteds * sizeof(m->wanted[0]));
    w = &m->wanted[m->wanteds++];
    w->zones = zones;
    snprintf(w->visit, sizeof(w->visit), "%s", name);
}

/* Is it the name of a visit, and no other path of the service? */
static bool is_visit(const char *name)
{
    return name && strlen(name) < sizeof(((struct mqtt_visit *)0)->name) && !name[strspn(name, MQTT_VISIT_LETTERS)];
}

void mqtt_on_visit(struct mqtt *m, const json_t *data)
{
    const char *name = json_string_value(json_object_get(data, "visit"));
    const char *label = json_string_value(json_object_get(data, "label"));
    const bool active = json_is_true(json_object_get(data, "active"));
    const uint32_t zones = zones_of(m, data);
    struct mqtt_visit *v = name ? find(m, name) : NULL;
    const uint32_t before = v ? v->zones : 0;
    char *text = name ? json_dumps(data, JSON_COMPACT | JSON_REAL_PRECISION(6)) : NULL;

    if (!text || !is_visit(name)) {
        free(text);
        return;
    }
    later(m, true, text, "visit");
    if (!active || !v) {
        later(m, false, active ? "came" : "gone", "visit/trigger");
        later_event(m, active ? "visit_began" : "visit_ended", data, NULL);
    }
    if (active && !v)
        v = find(m, "");
    if (v) {
        *v = (struct mqtt_visit){ .zones = zones };
        snprintf(v->label, sizeof(v->label), "%s", label ? label : "");
        snprintf(v->name, sizeof(v->name), "%s", active ? name : "");
    }
    for (int i = 0; i < m->config->zones; i++) {
        const char *zone = m->config->zone[i].name;

        if (!(zones & 1u << i) || m->config->zone[i].line)
            continue;
        later(m, true, text, "zone/%s/visit", zone);
        if (!active || !(before & 1u << i)) {
            later(m, false, active ? "came" : "gone", "zone/%s/trigger", zone);
            later_event(m, active ? "visit_began" : "visit_ended", data, zone);
        }
        publish_zone(m, i);
    }
    if (m->config->mqtt.picture_s > 0)
        want_picture(m, name, zones);
    free(text);
}

void mqtt_on_line(struct mqtt *m, const json_t *data)
{
    const char *name = json_string_value(json_object_get(data, "zone"));
    const char *visit = json_string_value(json_object_get(data, "visit"));
    const char *direction = json_string_value(json_object_get(data, "direction"));
    char *text = json_dumps(data, JSON_COMPACT | JSON_REAL_PRECISION(6));

    for (int i = 0; text && name && direction && i < m->config->zones; i++) {
        if (!m->config->zone[i].line || strcmp(m->config->zone[i].name, name) != 0)
            continue;
        later(m, true, text, "zone/%s/crossed", m->config->zone[i].name);
        later(m, false, direction, "zone/%s/trigger", m->config->zone[i].name);
        later_event(m, !strcmp(direction, "forward") ? "crossed_forward" : "crossed_backward", data, name);
        if (m->config->mqtt.picture_s > 0 && is_visit(visit))
            want_picture(m, visit, 1u << i);
    }
    free(text);
}

/* --- pictures ----------------------------------------------------------------------------------------------------- */

bool mqtt_visits_picture(struct mqtt *m)
{
    uint8_t *data;
    size_t bytes;

    if (!m->wanteds || m->in_flight >= MQTT_IN_FLIGHT_MAX / 2 || !mqtt_fetch_picture(m, m->wanted[0].visit, &data, &bytes))
        return m->wanteds > 0;
    if (data)
        (void)mqtt_publish(m, "visit/picture", data, bytes, MQTT_RETAIN);
    for (int i = 0; data && i < m->config->zones; i++) {
        char topic[96];

        snprintf(topic, sizeof(topic), "zone/%.31s/picture", m->config->zone[i].name);
        if (m->wanted[0].zones & 1u << i)
            (void)mqtt_publish(m, topic, data, bytes, MQTT_RETAIN);
    }
    free(data);
    memmove(m->wanted, m->wanted + 1, (size_t)--m->wanteds * sizeof(m->wanted[0]));
    return true;
}
