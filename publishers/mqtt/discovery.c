/* Home Assistant's MQTT discovery: one retained message per entity of entities.json, all of one device. */
#define _GNU_SOURCE /* asprintf */
#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "publishers/mqtt/mqtt_internal.h"

#define ENTITIES_MAX (SST_CAMERAS_MAX + SST_ZONES_MAX * (6 + SST_ZONE_LABELS) + 48)

__asm__(".section .rodata\nmqtt_entities: .incbin \"publishers/mqtt/entities.json\"\n.byte 0\n.previous");
extern const char mqtt_entities[];

struct announcement {
    const struct sst_config *config;
    char node[128], array[160], grid[64]; /* node: the topic as one word */
    const char *part, *label;             /* name of the camera or zone; a label of the zone */
    json_t *entities;
    struct mqtt_message *list;
    int n;
    bool failed;
};

/* Put values for the $WORDS of all texts within. */
static void fill(const struct announcement *a, json_t *within)
{
    const char *const words[][2] = {
        { "$TOPIC", a->config->mqtt.topic },
        { "$NODE", a->node },
        { "$ARRAY", a->array },
        { "$GRID", a->grid },
        { "$PART", a->part },
        { "$LABEL", a->label },
        { "$VERSION", SST_VERSION },
    };
    const char *key, *text = json_string_value(within);
    char out[1024] = "";
    json_t *v;
    size_t i;

    json_object_foreach(within, key, v)
    {
        fill(a, v);
    }
    json_array_foreach(within, i, v)
    {
        fill(a, v);
    }
    while (text && *text) {
        size_t n = *text == '$' ? 1 : strcspn(text, "$");

        for (i = 0; i < ARRAY_LEN(words) && strncmp(text, words[i][0], strlen(words[i][0])) != 0; i++)
            ;
        if (i < ARRAY_LEN(words))
            n = strlen(words[i][0]);
        sst_text_add(out, sizeof(out), "%.*s", i < ARRAY_LEN(words) ? 1000 : (int)n,
                     i < ARRAY_LEN(words) ? words[i][1] : text);
        text += n;
    }
    if (json_is_string(within))
        (void)json_string_set(within, out);
}

static void add(struct announcement *a, const json_t *entity)
{
    struct mqtt_message *m = &a->list[a->n];
    json_t *o = json_deep_copy(entity);
    const char *component = json_string_value(json_object_get(entity, "component")), *id;
    const bool trigger = !strcmp(component, "device_automation");

    if (a->n == ENTITIES_MAX ||
        (a->config->mqtt.picture_s <= 0 && (!strcmp(component, "camera") || !strcmp(component, "image"))))
        return json_decref(o);
    if (!trigger) {
        json_object_set_new(o, "unique_id", json_sprintf("$NODE_%s", json_string_value(json_object_get(o, "id"))));
        json_object_set_new(o, "availability_topic", json_string("$TOPIC/available"));
        json_object_set_new(o, "origin", json_deep_copy(json_object_get(a->entities, "origin")));
    }
    json_object_set_new(o, "device", json_deep_copy(json_object_get(a->entities, "device")));
    fill(a, o);
    id = json_string_value(json_object_get(o, "id"));
    if (id && asprintf(&m->topic, "%s/%s/%s/%s/config", a->config->mqtt.discovery, component, a->node, id) < 0)
        m->topic = NULL;
    json_object_del(o, "id");
    json_object_del(o, "component");
    m->payload = json_dumps(o, JSON_COMPACT);
    a->failed = a->failed || !m->topic || !m->payload;
    a->n++;
    json_decref(o);
}

/* The entities of the array, or of a camera, zone or label. */
static void add_all(struct announcement *a, const char *of, const char *part, const char *label)
{
    const json_t *entity;
    size_t i;

    a->part = part;
    a->label = label;
    json_array_foreach(json_object_get(a->entities, of), i, entity)
    {
        add(a, entity);
    }
}

static void add_zone(struct announcement *a, const struct sst_zone *z)
{
    const char *labels[SST_ZONE_LABELS];
    const int n = z->mask || z->line ? 0 : mqtt_zone_labels(z, labels);

    if (z->line)
        add_all(a, "line", z->name, "");
    if (z->line && z->direction != SST_LINE_BACKWARD)
        add_all(a, "forward", z->name, "");
    if (z->line && z->direction != SST_LINE_FORWARD)
        add_all(a, "backward", z->name, "");
    if (!z->mask && !z->line)
        add_all(a, "zone", z->name, "");
    for (int i = 0; i < n; i++)
        add_all(a, "label", z->name, labels[i]);
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
    struct announcement a = { .config = config, .entities = json_loads(mqtt_entities, 0, NULL) };
    const bool other = strcmp(config->mqtt.topic, "sst") != 0;
    const json_t *camera;
    size_t i;

    a.list = calloc(ENTITIES_MAX, sizeof(*a.list));
    a.failed = !a.list || !a.entities;
    mqtt_node(a.node, config);
    snprintf(a.array, sizeof(a.array), "%s%s", other ? " " : "", other ? config->mqtt.topic : "");
    snprintf(a.grid, sizeof(a.grid), "%dx%d", config->array.rows, config->array.cols);
    if (!a.failed)
        add_all(&a, "array", "", "");
    json_array_foreach(a.failed ? NULL : json_object_get(cameras, "cameras"), i, camera)
    {
        const char *name = json_string_value(json_object_get(camera, "name"));

        if (name)
            add_all(&a, "camera", name, "");
    }
    for (int z = 0; !a.failed && z < config->zones; z++)
        add_zone(&a, &config->zone[z]);
    json_decref(a.entities);
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
