/* lightfield.json of posed light fields: format version 3, kind "posed". Every field is checked; a fault is logged in
 * one sentence with file and field. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/lightfield/json_read.h"
#include "pipeline/posed/posed_internal.h"

#define JSON_MAX_BYTES ((size_t)4 << 20)
#define FORMAT_NAME    "sst-lightfield"
#define KIND           "posed"
#define VERSION        3
#define REMEDY         "import the pictures again"

/* --- writing ------------------------------------------------------------------------------------------------------ */

static json_t *numbers(const double *v, int n)
{
    json_t *list = json_array();

    for (int i = 0; list && i < n; i++) {
        if (json_array_append_new(list, json_real(v[i]))) {
            json_decref(list);
            return NULL;
        }
    }
    return list;
}

static json_t *lens_to_json(const struct sst_calib_camera *c)
{
    return json_pack("{s:f, s:f, s:f, s:f, s:o}", "fx", c->fx, "fy", c->fy, "cx", c->cx, "cy", c->cy, "k",
                     numbers(c->k, c->lens));
}

static json_t *view_to_json(const struct sst_posed_view *v, const char *hash)
{
    const struct sst_calib_camera *c = &v->camera;
    json_t *view = json_pack("{s:s, s:s, s:s}", "name", v->name, "file", v->file, "sha256", hash);

    if (view && ((c->name[0] && json_object_set_new(view, "camera", json_string(c->name))) ||
                 (c->fx != 0 && json_object_set_new(view, "lens", lens_to_json(c))) ||
                 (c->known && (json_object_set_new(view, "rotation", numbers(c->rotation, 9)) ||
                               json_object_set_new(view, "position_mm", numbers(c->position_mm, 3)))) ||
                 (c->rms_px > 0 && json_object_set_new(view, "rms_px", json_real(c->rms_px))) ||
                 (v->moment && json_object_set_new(view, "moment", json_integer(v->moment))) ||
                 (!isnan(v->time_s) && json_object_set_new(view, "time_s", json_real(v->time_s))))) {
        json_decref(view);
        return NULL;
    }
    return view;
}

static json_t *views_to_json(const struct sst_posed *posed, char (*hashes)[65])
{
    json_t *views = json_array();

    for (int k = 0; views && k < posed->count; k++) {
        const struct sst_posed_view *v = &posed->view[k];

        if (json_array_append_new(views, view_to_json(v, v->sha256[0] ? v->sha256 : hashes[k]))) {
            json_decref(views);
            return NULL;
        }
    }
    return views;
}

static int world_to_json(json_t *root, const struct sst_posed *posed)
{
    const double *up = posed->up, kelvin[2] = { posed->kelvin_scale, posed->kelvin_offset };

    return (posed->samples.white &&
            json_object_set_new(root, "samples", json_pack("[i, i]", posed->samples.black, posed->samples.white))) ||
           ((up[0] != 0 || up[1] != 0 || up[2] != 0) && json_object_set_new(root, "up", numbers(up, 3))) ||
           (posed->geographic &&
            json_object_set_new(root, "geographic",
                                json_pack("{s:f, s:f, s:f}", "latitude", posed->latitude, "longitude", posed->longitude,
                                          "altitude_m", posed->altitude_m))) ||
           (kelvin[0] != 0 && json_object_set_new(root, "kelvin", numbers(kelvin, 2))) ||
           (!isnan(posed->median_px) && json_object_set_new(root, "median_px", json_real(posed->median_px)));
}

char *posed_to_json(const struct sst_posed *posed, char (*hashes)[65], const struct points_file *points)
{
    json_t *root =
        json_pack("{s:s, s:i, s:s, s:i, s:i, s:i, s:i, s:b, s:s, s:s}", "format", FORMAT_NAME, "version", VERSION,
                  "kind", KIND, "width", posed->width, "height", posed->height, "channels", posed->channels, "bits",
                  posed->bits, "metric", (int)posed->metric, "source", posed->source, "history", posed->history);
    char *text = NULL;

    if (root && !world_to_json(root, posed) &&
        (!points->count || !json_object_set_new(root, "points",
                                                json_pack("{s:s, s:s, s:i}", "file", points->name, "sha256",
                                                          points->sha256, "count", points->count))) &&
        !json_object_set_new(root, "views", views_to_json(posed, hashes)))
        text = json_dumps(root, JSON_INDENT(1));
    json_decref(root);
    return text;
}

/* --- reading ------------------------------------------------------------------------------------------------------ */

static void read_lens(struct sst_json_reader *r, struct sst_calib_camera *c)
{
    json_t *k;

    c->fx = sst_json_double(r, "fx");
    c->fy = sst_json_double(r, "fy");
    c->cx = sst_json_double(r, "cx");
    c->cy = sst_json_double(r, "cy");
    k = sst_json_array(r, "k", SST_LENS_MAX);
    c->lens = (int)json_array_size(k);
    for (int i = 0; i < c->lens; i++) {
        const json_t *v = json_array_get(k, (size_t)i);

        if (!json_is_number(v))
            sst_json_fault(r, "k", "has an element that is not a number");
        c->k[i] = json_number_value(v);
    }
    sst_json_finish(r);
}

static void read_view(struct sst_json_reader *r, size_t index, void *arg)
{
    struct sst_posed *posed = arg;
    struct sst_posed_view *v = &posed->view[index];
    char where[48];

    sst_json_string(r, "name", v->name, sizeof(v->name));
    sst_json_string(r, "file", v->file, sizeof(v->file));
    sst_json_hash(r, "sha256", v->sha256);
    if (sst_json_has(r, "camera"))
        sst_json_string(r, "camera", v->camera.name, sizeof(v->camera.name));
    if (sst_json_has(r, "lens")) {
        struct sst_json_reader lens;

        snprintf(where, sizeof(where), "%slens.", r->where);
        lens = sst_json_inside(r, "lens", where);
        read_lens(&lens, &v->camera);
        r->err = lens.err;
    }
    v->camera.known = sst_json_has(r, "rotation") || sst_json_has(r, "position_mm");
    if (v->camera.known) {
        sst_json_doubles(r, "rotation", v->camera.rotation, 9);
        sst_json_doubles(r, "position_mm", v->camera.position_mm, 3);
    }
    if (sst_json_has(r, "rms_px"))
        v->camera.rms_px = sst_json_double(r, "rms_px");
    if (sst_json_has(r, "moment"))
        v->moment = sst_json_int(r, "moment", 0, 1000000000);
    if (sst_json_has(r, "time_s"))
        v->time_s = sst_json_double(r, "time_s");
    if (!r->err && v->camera.known && !(v->camera.fx > 0))
        sst_json_fault(r, "lens", "is missing beside the rotation");
    sst_json_finish(r);
}

static void read_points(struct sst_json_reader *r, struct points_file *points)
{
    struct sst_json_reader inner = sst_json_inside(r, "points", "points.");

    sst_json_string(&inner, "file", points->name, sizeof(points->name));
    sst_json_hash(&inner, "sha256", points->sha256);
    points->count = sst_json_int(&inner, "count", 1, POSED_MAX_POINTS);
    if (!inner.err && (points->name[0] == '.' || strchr(points->name, '/')))
        sst_json_fault(&inner, "file", "is not a plain file name");
    sst_json_finish(&inner);
    r->err = inner.err;
}

static void read_place(struct sst_json_reader *r, struct sst_posed *posed)
{
    struct sst_json_reader inner = sst_json_inside(r, "geographic", "geographic.");

    posed->geographic = true;
    posed->latitude = sst_json_double(&inner, "latitude");
    posed->longitude = sst_json_double(&inner, "longitude");
    posed->altitude_m = sst_json_double(&inner, "altitude_m");
    sst_json_finish(&inner);
    r->err = inner.err;
}

static void read_world(struct sst_json_reader *r, struct sst_posed *posed, struct points_file *points)
{
    double kelvin[2] = { 0, 0 };

    posed->width = sst_json_int(r, "width", 1, SST_IMAGE_MAX_SIDE);
    posed->height = sst_json_int(r, "height", 1, SST_IMAGE_MAX_SIDE);
    posed->channels = sst_json_int(r, "channels", 1, 3);
    posed->bits = sst_json_int(r, "bits", 8, 16);
    posed->metric = sst_json_bool(r, "metric");
    sst_json_string(r, "source", posed->source, sizeof(posed->source));
    sst_json_string(r, "history", posed->history, sizeof(posed->history));
    if (sst_json_has(r, "samples"))
        sst_json_samples(r, "samples", &posed->samples);
    if (sst_json_has(r, "up"))
        sst_json_doubles(r, "up", posed->up, 3);
    if (sst_json_has(r, "geographic"))
        read_place(r, posed);
    if (sst_json_has(r, "kelvin"))
        sst_json_doubles(r, "kelvin", kelvin, 2);
    posed->kelvin_scale = kelvin[0];
    posed->kelvin_offset = kelvin[1];
    if (sst_json_has(r, "median_px"))
        posed->median_px = sst_json_double(r, "median_px");
    if (sst_json_has(r, "points"))
        read_points(r, points);
}

static int read_head(struct sst_json_reader *r)
{
    char format[32] = "", kind[32] = "";
    int version;

    sst_json_string(r, "format", format, sizeof(format));
    if (!r->err && strcmp(format, FORMAT_NAME))
        sst_json_fault(r, "format", "is not \"" FORMAT_NAME "\"");
    version = sst_json_int(r, "version", 1, 1000000);
    if (!r->err && version < VERSION && !sst_json_has(r, "kind")) {
        sst_log_error("%s is of a light field in rows and columns, not of one with a pose for every view; make one "
                      "with `sst import poses` or `sst import pictures`",
                      r->path);
        return r->err = -EBADMSG;
    }
    if (!r->err && version > VERSION) {
        sst_log_error("%s: version %d is newer than %d, the newest that this program reads; update sst", r->path,
                      version, VERSION);
        return r->err = -EBADMSG;
    }
    sst_json_string(r, "kind", kind, sizeof(kind));
    if (!r->err && strcmp(kind, KIND))
        sst_json_fault(r, "kind", "is not \"" KIND "\"");
    return r->err;
}

static int read_root(struct sst_posed *posed, struct points_file *points, struct sst_json_reader *r)
{
    json_t *views;
    const char *what;

    if (read_head(r))
        return r->err;
    views = sst_json_array(r, "views", SST_POSED_MAX_VIEWS);
    if (!r->err && !json_array_size(views))
        sst_json_fault(r, "views", "is empty");
    if (r->err)
        return r->err;
    if (sst_posed_init(posed, (int)json_array_size(views))) {
        sst_log_error("no memory for the light field %s", r->path);
        return -ENOMEM;
    }
    read_world(r, posed, points);
    sst_json_each(r, views, "views", read_view, posed);
    sst_json_finish(r);
    what = r->err ? NULL : posed_fault(posed);
    if (what) {
        sst_log_error("%s: %s; " REMEDY, r->path, what);
        r->err = -EBADMSG;
    }
    return r->err;
}

int posed_read_json(struct sst_posed *posed, struct points_file *points, const char *path)
{
    struct sst_json_reader r = { .path = path, .where = "", .remedy = REMEDY };
    struct sst_posed made = { 0 };
    struct points_file file = { .count = 0 };
    int err = sst_json_load(&r.object, path, JSON_MAX_BYTES, REMEDY);

    if (err)
        return err;
    err = read_root(&made, &file, &r);
    json_decref(r.object);
    if (err) {
        sst_posed_fini(&made);
        return err;
    }
    *posed = made;
    *points = file;
    return 0;
}
