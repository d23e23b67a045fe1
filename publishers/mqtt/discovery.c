/* Device of Home Assistant's MQTT discovery: one message with all entities of entities.json. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "publishers/mqtt/mqtt_internal.h"

__asm__(".section .rodata\nmqtt_entities: .incbin \"publishers/mqtt/entities.json\"\n.byte 0\n.previous");
extern const char mqtt_entities[];

struct announcement {
    const struct sst_config *config;
    char node[128], array[160], grid[64]; /* node: the topic as one word */
    const char *part, *label;             /* name of the camera or zone; a label of the zone */
    char page[512];                       /* address of the page; "": none */
    json_t *entities, *components;
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
        { "$PAGE", a->page },
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

/* Entities of pictures only where some are published. A name that another platform has is completed by its own. */
static void add(struct announcement *a, const json_t *entity)
{
    const char *platform = json_string_value(json_object_get(entity, "component"));
    json_t *o;
    char id[160];

    if (a->config->mqtt.picture_s <= 0 && (!strcmp(platform, "camera") || !strcmp(platform, "image")))
        return;
    o = json_deep_copy(entity);
    fill(a, o);
    snprintf(id, sizeof(id), "%.120s", o ? json_string_value(json_object_get(o, "id")) : "");
    if (strcmp(platform, "device_automation") != 0)
        json_object_set_new(o, "unique_id", json_sprintf("%s_%s", a->node, id));
    json_object_set_new(o, "p", json_string(platform));
    json_object_del(o, "id");
    json_object_del(o, "component");
    if (json_object_get(a->components, id))
        sst_text_add(id, sizeof(id), "-%s", platform);
    a->failed = json_object_set_new(a->components, id, o) || a->failed;
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

json_t *mqtt_device(const struct sst_config *config, const json_t *cameras)
{
    struct announcement a = { .config = config, .entities = json_loads(mqtt_entities, 0, NULL) };
    json_t *device = json_deep_copy(json_object_get(a.entities, "device")), *whole;
    const bool other = strcmp(config->mqtt.topic, "sst") != 0;
    const json_t *camera;
    size_t i;

    a.components = json_object();
    mqtt_node(a.node, config);
    snprintf(a.array, sizeof(a.array), "%s%s", other ? " " : "", other ? config->mqtt.topic : "");
    snprintf(a.grid, sizeof(a.grid), "%dx%d", config->array.rows, config->array.cols);
    sst_config_page(a.page, config);
    if (!a.page[0])
        json_object_del(device, "configuration_url");
    add_all(&a, "array", "", "");
    json_array_foreach(json_object_get(cameras, "cameras"), i, camera)
    {
        const char *name = json_string_value(json_object_get(camera, "name"));

        if (name)
            add_all(&a, "camera", name, "");
    }
    for (int z = 0; z < config->zones; z++)
        add_zone(&a, &config->zone[z]);
    whole = json_pack("{s:o, s:O, s:s, s:o}", "dev", device, "o", json_object_get(a.entities, "origin"),
                      "availability_topic", "", "cmps", a.components);
    fill(&a, json_object_get(whole, "dev"));
    fill(&a, json_object_get(whole, "o"));
    if (whole)
        json_object_set_new(whole, "availability_topic", json_sprintf("%s/available", config->mqtt.topic));
    json_decref(a.entities);
    if (!a.failed)
        return whole;
    json_decref(whole);
    return NULL;
}

void mqtt_messages_free(struct mqtt_message *list, int n)
{
    for (int i = 0; i < n; i++) {
        free(list[i].topic);
        free(list[i].payload);
    }
    free(list);
}
