/* Home Assistant's MQTT discovery: one retained message per entity, all of one device. */
#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "publishers/mqtt/mqtt_internal.h"

#define ENTITIES_MAX (SST_CAMERAS_MAX + SST_ZONES_MAX * (6 + SST_ZONE_LABELS) + 48)

struct announcement {
    const struct sst_config *config;
    char node[128]; /* the topic as one word */
    struct mqtt_message *list;
    int n;
    bool failed;
};

/* An entity without its common members. */
struct entity {
    const char *component, *id, *name;
    const char *topic;  /* of its state, below mqtt.topic */
    const char *value;  /* template, or NULL */
    const char *class_; /* of the device, or NULL */
    const char *unit, *icon, *category;
    bool measured;
    bool attributes; /* the state is JSON with attributes as members */
};

#define LABEL_TEMPLATE "{{ value_json.label or 'Something' }}"

static const struct entity entities[] = {
    { "sensor", "state", "State", "status", "{{ value_json.state }}", NULL, NULL, "mdi:state-machine", NULL, false },
    { "binary_sensor", "problem", "Problem", "status",
      /* LOW by the quota is the usual state of a loop of recordings. */
      "{{ 'OFF' if value_json.state in ['capturing', 'armed'] and (value_json.storage == 'OK' or value_json.storage == "
      "'LOW' and value_json.storage_limit == 'quota') else 'ON' }}",
      "problem", NULL, NULL, NULL, false },
    { "binary_sensor", "cameras", "All cameras", "status",
      "{{ 'ON' if value_json.present == value_json.cameras else 'OFF' }}", "connectivity", NULL, NULL, NULL, false },
    { "sensor", "rate", "Capture rate", "status", "{{ value_json.rate_hz }}", "frequency", "Hz", NULL, "diagnostic",
      true },
    { "sensor", "live_rate", "See-through rate", "status", "{{ value_json.live_hz }}", "frequency", "Hz", NULL,
      "diagnostic", true },
    { "sensor", "latency", "Latency", "status", "{{ value_json.latency_ms }}", "duration", "ms", NULL, "diagnostic",
      true },
    { "sensor", "storage", "Storage", "status", "{{ value_json.storage }}", NULL, NULL, "mdi:harddisk", NULL, false },
    { "sensor", "free", "Storage free", "status", "{{ value_json.free_gb }}", "data_size", "GB", NULL, "diagnostic",
      true },
    { "switch", "record", "Record", "record", NULL, NULL, NULL, "mdi:record-rec", NULL, false },
    { "camera", "picture", "See-through view", "picture", NULL, NULL, NULL, NULL, NULL, false },
    { "image", "visit_picture", "Last visit", "visit/picture", NULL, NULL, NULL, NULL, NULL, false },
    { "sensor", "last_visit", "Last visit", "visit", LABEL_TEMPLATE, NULL, NULL, "mdi:walk", NULL, false, true },
};

static json_t *device(const struct announcement *a)
{
    const struct sst_config *c = a->config;
    char name[160], model[64];

    snprintf(name, sizeof(name), "See-through array%s%s", strcmp(c->mqtt.topic, "sst") ? " " : "",
             strcmp(c->mqtt.topic, "sst") ? c->mqtt.topic : "");
    snprintf(model, sizeof(model), "camera array %dx%d", c->array.rows, c->array.cols);
    return json_pack("{s:[s], s:s, s:s, s:s, s:s}", "identifiers", a->node, "name", name, "manufacturer", "sst",
                     "model", model, "sw_version", SST_VERSION);
}

static void add(struct announcement *a, const struct entity *e)
{
    const char *base = a->config->mqtt.topic;
    const bool camera = !strcmp(e->component, "camera"), image = !strcmp(e->component, "image");
    const char *state_topic = camera ? "topic" : image ? "image_topic" : "state_topic";
    char topic[MQTT_TOPIC_MAX];
    struct mqtt_message *m = &a->list[a->n];
    json_t *o;

    if (a->n == ENTITIES_MAX)
        return;
    o = json_pack("{s:s, s:s++, s:s++, s:s+, s:s*, s:s*, s:s*, s:s*, s:s*, s:s*}", "name", e->name, "unique_id",
                  a->node, "_", e->id, state_topic, base, "/", e->topic, "availability_topic", base, "/available",
                  "value_template", e->value, "device_class", e->class_, "unit_of_measurement", e->unit, "icon",
                  e->icon, "entity_category", e->category, "state_class", e->measured ? "measurement" : NULL);
    if (!o)
        return;
    if (e->attributes)
        json_object_set_new(o, "json_attributes_topic", json_sprintf("%s/%s", base, e->topic));
    if (image)
        json_object_set_new(o, "content_type", json_string("image/jpeg"));
    if (!strcmp(e->component, "switch"))
        json_object_set_new(o, "command_topic", json_sprintf("%s/record/set", base));
    if (!strcmp(e->id, "problem"))
        json_object_set_new(o, "json_attributes_topic", json_sprintf("%s/status", base));
    json_object_set_new(o, "device", device(a));
    json_object_set_new(o, "origin", json_pack("{s:s, s:s}", "name", "sstd", "sw_version", SST_VERSION));
    snprintf(topic, sizeof(topic), "%s/%s/%s/%s/config", a->config->mqtt.discovery, e->component, a->node, e->id);
    m->topic = strdup(topic);
    m->payload = json_dumps(o, JSON_COMPACT);
    a->failed = a->failed || !m->topic || !m->payload;
    a->n++;
    json_decref(o);
}

static void add_cameras(struct announcement *a, const json_t *cameras)
{
    const json_t *camera;
    size_t i;

    json_array_foreach(json_object_get(cameras, "cameras"), i, camera)
    {
        const char *name = json_string_value(json_object_get(camera, "name"));
        char id[48], shown[48], topic[64];

        if (!name)
            continue;
        snprintf(id, sizeof(id), "camera_%.32s", name);
        snprintf(shown, sizeof(shown), "Camera %.32s", name);
        snprintf(topic, sizeof(topic), "camera/%.32s/state", name);
        add(a, &(struct entity){ "binary_sensor", id, shown, topic, "{{ 'ON' if value == 'streaming' else 'OFF' }}",
                                 "connectivity", NULL, NULL, "diagnostic", false });
    }
}

/* "When a visit begins at the gate", for automations. @param zone  "": anywhere @param payload  "came", "gone", or the
 * direction in which a line is crossed */
static void add_trigger(struct announcement *a, const char *zone, const char *id, const char *type, const char *payload)
{
    struct mqtt_message *m = &a->list[a->n];
    char topic[MQTT_TOPIC_MAX];
    json_t *o;

    if (a->n == ENTITIES_MAX)
        return;
    o = json_pack("{s:s, s:s, s:s, s:s, s:o}", "automation_type", "trigger", "type", type, "subtype",
                  *zone ? zone : "anywhere", "payload", payload, "device", device(a));
    json_object_set_new(o, "topic",
                        *zone ? json_sprintf("%s/zone/%s/trigger", a->config->mqtt.topic, zone)
                              : json_sprintf("%s/visit/trigger", a->config->mqtt.topic));
    snprintf(topic, sizeof(topic), "%s/device_automation/%s/%s_%s/config", a->config->mqtt.discovery, a->node, id,
             *zone ? zone : "anywhere_"); /* no zone's name: one may be `anywhere` */
    m->topic = strdup(topic);
    m->payload = json_dumps(o, JSON_COMPACT);
    a->failed = a->failed || !m->topic || !m->payload;
    a->n++;
    json_decref(o);
}

/* One entity of a zone; id, name and topic get the zone's name. */
static void add_of_zone(struct announcement *a, const char *zone, struct entity e)
{
    char name[96], shown[96], path[96];

    snprintf(name, sizeof(name), "%s_%.31s", e.id, zone);
    snprintf(shown, sizeof(shown), "%s %.31s", e.name, zone);
    snprintf(path, sizeof(path), "zone/%.31s/%s", zone, e.topic);
    e.id = name;
    e.name = shown;
    e.topic = path;
    add(a, &e);
}

static void add_line(struct announcement *a, const struct sst_zone *z)
{
    add_of_zone(a, z->name,
                (struct entity){ .id = "crossed",
                                 .name = "Last across",
                                 .topic = "crossed",
                                 .component = "sensor",
                                 .value = LABEL_TEMPLATE,
                                 .icon = "mdi:boom-gate",
                                 .attributes = true });
    if (a->config->mqtt.picture_s > 0)
        add_of_zone(
            a, z->name,
            (struct entity){ .id = "picture", .name = "Last across", .topic = "picture", .component = "image" });
    if (z->direction != SST_LINE_BACKWARD)
        add_trigger(a, z->name, "forward", "crossed_forward", "forward");
    if (z->direction != SST_LINE_FORWARD)
        add_trigger(a, z->name, "backward", "crossed_backward", "backward");
}

static void add_zones(struct announcement *a)
{
    for (int i = 0; i < a->config->zones; i++) {
        const struct sst_zone *z = &a->config->zone[i];
        const char *labels[SST_ZONE_LABELS];
        const int n = mqtt_zone_labels(z, labels);

        if (z->line)
            add_line(a, z);
        if (z->mask || z->line)
            continue;
        add_of_zone(
            a, z->name,
            (struct entity){
                .id = "zone", .name = "Motion", .topic = "motion", .component = "binary_sensor", .class_ = "motion" });
        add_of_zone(a, z->name,
                    (struct entity){ .id = "visited",
                                     .name = "Visit",
                                     .topic = "visited",
                                     .component = "binary_sensor",
                                     .class_ = "occupancy" });
        add_of_zone(a, z->name,
                    (struct entity){ .id = "visit",
                                     .name = "Last visit",
                                     .topic = "visit",
                                     .component = "sensor",
                                     .value = LABEL_TEMPLATE,
                                     .icon = "mdi:walk",
                                     .attributes = true });
        if (a->config->mqtt.picture_s > 0)
            add_of_zone(
                a, z->name,
                (struct entity){ .id = "picture", .name = "Last visit", .topic = "picture", .component = "image" });
        for (int k = 0; k < n; k++) {
            char id[48], topic[48];

            snprintf(id, sizeof(id), "label_%.31s", labels[k]);
            snprintf(topic, sizeof(topic), "label/%.31s", labels[k]);
            add_of_zone(
                a, z->name,
                (struct entity){
                    .id = id, .name = labels[k], .topic = topic, .component = "binary_sensor", .class_ = "occupancy" });
        }
        add_trigger(a, z->name, "began", "visit_began", "came");
        add_trigger(a, z->name, "ended", "visit_ended", "gone");
    }
}

void mqtt_node(char out[128], const struct sst_config *config)
{
    const char *t = config->mqtt.topic;
    size_t n = 0;

    for (; t[n] && n < 127; n++)
        out[n] = isalnum((unsigned char)t[n]) ? t[n] : '_';
    out[n] = 0;
}

int mqtt_announcements(struct mqtt_message **out, const struct sst_config *config, const json_t *cameras)
{
    struct announcement a = { .config = config };

    a.list = calloc(ENTITIES_MAX, sizeof(*a.list));
    if (!a.list)
        return -ENOMEM;
    mqtt_node(a.node, config);
    for (size_t i = 0; i < ARRAY_LEN(entities); i++)
        if ((strcmp(entities[i].component, "camera") != 0 && strcmp(entities[i].component, "image") != 0) ||
            config->mqtt.picture_s > 0)
            add(&a, &entities[i]);
    add_trigger(&a, "", "began", "visit_began", "came");
    add_trigger(&a, "", "ended", "visit_ended", "gone");
    add_cameras(&a, cameras);
    add_zones(&a);
    if (a.failed) {
        mqtt_messages_free(a.list, a.n);
        return -ENOMEM;
    }
    *out = a.list;
    return a.n;
}

void mqtt_messages_free(struct mqtt_message *list, int n)
{
    for (int i = 0; i < n; i++) {
        free(list[i].topic);
        free(list[i].payload);
    }
    free(list);
}
