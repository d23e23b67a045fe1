/* Zones drawn on the page: read as JSON, kept as a configuration file of their own, applied by a reload. Masks as JSON. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "base/text.h"
#include "config/sstd.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"

#define REVISION_MAX 20

static const char *const directions[] = { "both", "forward", "backward" };

static json_t *limit_json(double px)
{
    return isinf(px) ? json_null() : json_real(px);
}

static json_t *zone_json(const struct sst_zone *z)
{
    double x[SST_ZONE_POINTS], y[SST_ZONE_POINTS];
    const int n = sst_zone_corners(z, x, y);
    json_t *points = json_array(), *labels = json_array();

    for (int i = 0; i < n; i++)
        json_array_append_new(points, json_pack("[f, f]", x[i], y[i]));
    for (int i = 0; i < SST_ZONE_LABELS && z->labels[i][0]; i++)
        json_array_append_new(labels, json_string(z->labels[i]));
    return json_pack("{s:s, s:o, s:o, s:o, s:o, s:b, s:b, s:s}", "name", z->name, "points", points, "near_px",
                     limit_json(z->near_px), "far_px", limit_json(z->far_px), "labels", labels, "mask", z->mask, "line",
                     z->line, "direction", directions[z->direction]);
}

/* Differs for other zones: two clients that draw do not overwrite each other's. */
static void revision_of(char out[REVISION_MAX], const struct sst_config *c)
{
    char *text = sst_zones_text(c->zone, c->zones);
    uint64_t hash = UINT64_C(14695981039346656037); /* FNV-1a */

    for (const char *p = text; p && *p; p++)
        hash = (hash ^ (unsigned char)*p) * UINT64_C(1099511628211);
    free(text);
    snprintf(out, REVISION_MAX, "%016" PRIx64, hash);
}

static int zones_answer(const struct sst_config *c, struct sst_api_answer *out)
{
    char revision[REVISION_MAX];
    json_t *list = json_array();

    revision_of(revision, c);
    for (int i = 0; i < c->zones; i++)
        json_array_append_new(list, zone_json(&c->zone[i]));
    out->body = json_pack("{s:o, s:s, s:s}", "zones", list, "revision", revision, "file", c->web.zones_file);
    return out->body ? 0 : -ENOMEM;
}

static struct sst_config *copy_config(struct sst_service *s)
{
    struct sst_config *c = malloc(sizeof(*c));

    if (!c)
        return NULL;
    pthread_mutex_lock(&s->lock);
    *c = s->config;
    pthread_mutex_unlock(&s->lock);
    return c;
}

int service_zones(void *arg, struct sst_api_answer *out)
{
    struct sst_config *c = copy_config(arg);
    const int err = c ? zones_answer(c, out) : -ENOMEM;

    free(c);
    return err;
}

static json_t *mask_json(const struct sst_config_mask *m)
{
    const bool place = m->row < 0;
    double x[SST_MASK_POINTS], y[SST_MASK_POINTS];
    const int n = sst_mask_corners(m, x, y);
    json_t *points = json_array();

    for (int i = 0; i < n; i++)
        json_array_append_new(points, json_pack("[f, f]", x[i], y[i]));
    return json_pack("{s:s, s:o, s:o, s:o, s:o, s:o}", "name", m->name, "row", place ? json_null() : json_integer(m->row),
                     "col", place ? json_null() : json_integer(m->col), "points", points, "near_px", limit_json(m->near_px),
                     "far_px", limit_json(place ? m->far_px : INFINITY));
}

int service_masks(void *arg, struct sst_api_answer *out)
{
    struct sst_config *c = copy_config(arg);
    json_t *list = json_array();

    for (int i = 0; c && i < c->array.masks; i++)
        json_array_append_new(list, mask_json(&c->array.mask[i]));
    out->body = c ? json_pack("{s:o}", "masks", list) : NULL;
    if (!c)
        json_decref(list);
    free(c);
    return out->body ? 0 : -ENOMEM;
}

/* --- from JSON: only types and sizes; the configuration's own reader checks the values --- */

static int read_points(struct sst_zone *z, const json_t *points, char error[512])
{
    const json_t *p;
    size_t i;

    if (!json_is_array(points) || json_array_size(points) < 2 || json_array_size(points) > SST_ZONE_POINTS)
        return sst_api_refuse(error, -EINVAL, "points of zone %.32s must be 3 to %d pairs [x, y], those of a line 2",
                              z->name, SST_ZONE_POINTS);
    json_array_foreach(points, i, p)
    {
        const json_t *x = json_array_get(p, 0), *y = json_array_get(p, 1);

        if (json_array_size(p) != 2 || !json_is_number(x) || !json_is_number(y) || !(json_number_value(x) >= 0) ||
            !(json_number_value(x) <= 1) || !(json_number_value(y) >= 0) || !(json_number_value(y) <= 1))
            return sst_api_refuse(error, -EINVAL, "a point of zone %.32s must be [x, y], fractions 0..1 of the picture",
                                  z->name);
        sst_text_add(z->points, sizeof(z->points), "%s%.4f,%.4f", i ? " " : "", json_number_value(x),
                     json_number_value(y));
    }
    return 0;
}

static int read_limit(double *out, const json_t *value, double none, const char *key, char error[512])
{
    *out = none;
    if (!value || json_is_null(value))
        return 0;
    if (!json_is_number(value))
        return sst_api_refuse(error, -EINVAL, "%s must be a number of px per spacing, or null", key);
    *out = json_number_value(value);
    return 0;
}

static int read_labels(struct sst_zone *z, const json_t *labels, char error[512])
{
    const json_t *label;
    size_t i;

    if (labels && (!json_is_array(labels) || json_array_size(labels) > SST_ZONE_LABELS))
        return sst_api_refuse(error, -EINVAL, "labels of zone %.32s must be a list of at most %d names", z->name,
                              SST_ZONE_LABELS);
    json_array_foreach(labels, i, label)
    {
        const char *name = json_string_value(label);

        if (!name || !*name || strlen(name) >= sizeof(z->labels[i]))
            return sst_api_refuse(error, -EINVAL, "a label of zone %.32s must be a class of /api/v1/labels", z->name);
        strcpy(z->labels[i], name);
    }
    return 0;
}

static int read_direction(struct sst_zone *z, const json_t *direction, char error[512])
{
    const char *name = json_string_value(direction);

    for (size_t i = 0; name && i < ARRAY_LEN(directions); i++) {
        if (!strcmp(name, directions[i])) {
            z->direction = (enum sst_line_direction)i;
            return 0;
        }
    }
    return direction ? sst_api_refuse(error, -EINVAL, "direction of zone %.32s must be both, forward or backward", z->name)
                     : 0;
}

static int read_zone(struct sst_zone *z, const json_t *from, char error[512])
{
    static const char *const known[] = { "name", "points", "near_px", "far_px", "labels", "mask", "line", "direction", NULL };
    const char *name = json_string_value(json_object_get(from, "name"));
    const json_t *mask = json_object_get(from, "mask"), *line = json_object_get(from, "line");
    int err = json_is_object(from) ? sst_api_members(from, known, error)
                                   : sst_api_refuse(error, -EINVAL, "a zone is an object with name and points");

    *z = (struct sst_zone){ .x1 = 1, .y1 = 1, .mask = json_is_true(mask), .line = json_is_true(line) };
    if (!err && (!name || !*name || strlen(name) >= sizeof(z->name)))
        return sst_api_refuse(error, -EINVAL, "a zone needs a name of a-z, 0-9, - and _, at most 31 characters");
    if (!err && ((mask && !json_is_boolean(mask)) || (line && !json_is_boolean(line))))
        return sst_api_refuse(error, -EINVAL, "mask and line of zone %.32s must be true or false", name);
    if (!err)
        strcpy(z->name, name);
    err = err ? err : read_direction(z, json_object_get(from, "direction"), error);
    err = err ? err : read_points(z, json_object_get(from, "points"), error);
    err = err ? err : read_limit(&z->near_px, json_object_get(from, "near_px"), INFINITY, "near_px", error);
    err = err ? err : read_limit(&z->far_px, json_object_get(from, "far_px"), -INFINITY, "far_px", error);
    return err ? err : read_labels(z, json_object_get(from, "labels"), error);
}

/* @return to free with free(); NULL: refused, or no memory */
static char *read_request(const json_t *request, char error[512])
{
    static const char *const known[] = { "zones", "revision", NULL };
    const json_t *list = json_object_get(request, "zones"), *one;
    struct sst_zone *zone = calloc(SST_ZONES_MAX, sizeof(*zone));
    char *text = NULL;
    size_t i;
    int err = zone ? sst_api_members(request, known, error) : -ENOMEM;

    if (!err && (!json_is_array(list) || json_array_size(list) > SST_ZONES_MAX))
        err = sst_api_refuse(error, -EINVAL, "zones must be the list of all zones, at most %d", SST_ZONES_MAX);
    json_array_foreach(list, i, one)
    {
        err = err ? err : read_zone(&zone[i], one, error);
    }
    if (!err)
        text = sst_zones_text(zone, (int)json_array_size(list));
    free(zone);
    return text;
}

/* --- the file --- */

/* Would the whole configuration be accepted with these zones? */
static int try_zones(struct sst_service *s, const char *text, char error[512])
{
    struct sst_config *c = calloc(1, sizeof(*c));
    char why[440] = "";
    int err = c ? 0 : -ENOMEM;

    sst_log_copy_errors(why, sizeof(why));
    if (!err) {
        sst_config_defaults(c);
        err = sst_config_try_zones(c, s->path[0] ? s->path : NULL, text);
    }
    sst_log_copy_errors(NULL, 0);
    free(c);
    return err ? sst_api_refuse(error, err == -ENOMEM ? err : -EINVAL, "the zones are not applied, the old ones stay: %s",
                                why[0] ? why : strerror(-err))
               : 0;
}

/* Write the file and apply it; on failure the file is as before. */
static int write_and_apply(struct sst_service *s, const char *path, const char *text, struct sst_api_answer *out)
{
    uint8_t *before = NULL;
    size_t bytes = 0;
    const int there = sst_path_exists(path) ? sst_file_read(path, 1 << 20, &before, &bytes) : -ENOENT;
    struct sst_api_answer answer = { 0 };
    int err = sst_file_write(path, text, strlen(text));

    if (err) {
        free(before);
        return sst_api_refuse(out->error, err == -ENOSPC ? err : -EROFS,
                              "%s cannot be written: %s; web.zones_file must be in a folder that the service can write",
                              path, strerror(-err));
    }
    err = service_apply(s, false, &answer);
    json_decref(answer.body);
    if (err) {
        if (there == -ENOENT)
            unlink(path);
        else if (there || sst_file_write(path, before, bytes))
            sst_log_warning("%s has zones that are not applied; sst reload applies them", path);
        snprintf(out->error, sizeof(out->error), "%s", answer.error);
    }
    free(before);
    return err;
}

int service_zones_change(void *arg, const json_t *request, struct sst_api_answer *out)
{
    struct sst_service *s = arg;
    const char *revision = json_string_value(json_object_get(request, "revision"));
    struct sst_config *c;
    char now[REVISION_MAX] = "", *text = read_request(request, out->error);
    int err = text ? 0 : out->error[0] ? -EINVAL : -ENOMEM;

    pthread_mutex_lock(&s->drawing);
    c = copy_config(s);
    err = err ? err : c ? 0 : -ENOMEM;
    if (!err)
        revision_of(now, c);
    if (!err && !c->web.zones_file[0])
        err = sst_api_refuse(out->error, -EINVAL, "zones cannot be drawn: web.zones_file is \"\"");
    if (!err && revision && strcmp(revision, now) != 0)
        err = sst_api_refuse(out->error, -EBUSY, "the zones have been changed by another client; load them again");
    err = err ? err : try_zones(s, text, out->error);
    err = err ? err : write_and_apply(s, c->web.zones_file, text, out);
    pthread_mutex_unlock(&s->drawing);
    free(text);
    free(c);
    return err ? err : service_zones(s, out);
}
