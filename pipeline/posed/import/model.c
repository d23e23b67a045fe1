/* The model that readers of other programs' poses fill: views, lenses, points. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "pipeline/posed/import/import_internal.h"

#define ROTATION_MISS 1e-3 /* largest error of R R^T that is rounding */
#define LEAST_FOCAL   1.0  /* px, as of the option */
#define TURNS         20   /* of the iteration to the nearest rotation */

struct model_view *model_add(struct model *m, const char *name)
{
    struct model_view *v;

    if (m->count == SST_POSED_MAX_VIEWS) {
        sst_log_error("%s has more than %d views, the most that a light field can have; split it", m->path,
                      SST_POSED_MAX_VIEWS);
        return NULL;
    }
    if (strlen(name) >= MODEL_NAME || !name[0]) {
        sst_log_error("%s: a picture's name is %s; rename it", m->path, name[0] ? "too long" : "empty");
        return NULL;
    }
    if (!sst_mem_grow(&m->view, m->count, &m->capacity, sizeof(*m->view))) {
        sst_log_error("not enough memory to import %s", m->path);
        return NULL;
    }
    v = &m->view[m->count++];
    *v = (struct model_view){ .camera = { .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 }, .gain = { 1, 1, 1 } } };
    memcpy(v->name, name, strlen(name));
    return v;
}

int model_fault(const struct model *m, const char *name, const char *fault)
{
    sst_log_error("%s: %s%s%s", m->path, name, name[0] ? ": " : "", fault);
    return -EBADMSG;
}

static double determinant(const double r[9])
{
    return r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) + r[2] * (r[3] * r[7] - r[4] * r[6]);
}

/* R becomes the mean of itself and its transposed inverse until nothing changes. */
static void nearest_rotation(double r[9])
{
    for (int turn = 0; turn < TURNS; turn++) {
        const double d = determinant(r);
        const double inverse[9] = { /* transposed: the cofactors */
                                    r[4] * r[8] - r[5] * r[7], r[5] * r[6] - r[3] * r[8], r[3] * r[7] - r[4] * r[6],
                                    r[2] * r[7] - r[1] * r[8], r[0] * r[8] - r[2] * r[6], r[1] * r[6] - r[0] * r[7],
                                    r[1] * r[5] - r[2] * r[4], r[2] * r[3] - r[0] * r[5], r[0] * r[4] - r[1] * r[3]
        };

        for (int i = 0; i < 9; i++)
            r[i] = (r[i] + inverse[i] / d) / 2;
    }
}

const char *model_place(struct model_view *v, const double R[9], const double t[3])
{
    static _Thread_local char text[96];
    struct sst_calib_camera *c = &v->camera;
    double r[9], worst = 0, det;

    for (int i = 0; i < 9; i++) {
        if (!(fabs(R[i]) <= SST_CALIB_LARGEST) || !(fabs(t[i % 3]) <= SST_CALIB_LARGEST))
            return "a number of its pose is not finite or beyond 1e12";
    }
    det = determinant(R);
    for (int i = 0; i < 9; i++) {
        double dot = i % 4 == 0 ? -1 : 0;

        for (int l = 0; l < 3; l++)
            dot += R[i / 3 * 3 + l] * R[i % 3 * 3 + l];
        worst = fmax(worst, fabs(dot));
    }
    if (worst > ROTATION_MISS && fabs(det) > 1e-9 && fabs(cbrt(fabs(det)) - 1) > ROTATION_MISS) {
        snprintf(text, sizeof(text), "its rotation is scaled by %.4g or none; divide it by that", cbrt(fabs(det)));
        return text;
    }
    if (worst > ROTATION_MISS)
        return "its rotation is not a rotation matrix";
    if (det < 0)
        return "its rotation is mirrored (determinant -1); an axis has the wrong sign";
    memcpy(r, R, sizeof(r));
    nearest_rotation(r);
    memcpy(c->rotation, r, sizeof(r));
    for (int i = 0; i < 3; i++)
        c->position_mm[i] = -(r[i] * t[0] + r[3 + i] * t[1] + r[6 + i] * t[2]);
    c->known = true;
    return NULL;
}

const char *model_lens(struct model_view *v, const double focal_centre[4], const double *k, int n)
{
    static _Thread_local char text[160];
    struct sst_calib_camera *c = &v->camera, lens;
    const char *fault;

    c->fx = focal_centre[0];
    c->fy = focal_centre[1];
    c->cx = focal_centre[2] - 0.5;
    c->cy = focal_centre[3] - 0.5;
    c->lens = 0;
    for (int i = 0; i < n; i++) {
        c->k[i] = k[i];
        if (!(k[i] == 0)) /* NaN counts */
            c->lens = i < 5 ? sst_max_int(c->lens, 5) : 8;
    }
    lens = (struct sst_calib_camera){ .fx = c->fx,
                                      .fy = c->fy,
                                      .cx = c->cx,
                                      .cy = c->cy,
                                      .lens = c->lens,
                                      .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 },
                                      .gain = { 1, 1, 1 } };
    memcpy(lens.k, c->k, sizeof(lens.k));
    fault = sst_camera_fault(&lens);
    if (!fault && fmin(lens.fx, lens.fy) < LEAST_FOCAL)
        fault = "the focal length is below 1 px";
    if (fault)
        snprintf(text, sizeof(text), "its lens: %s", fault);
    return fault ? text : NULL;
}

int model_reserve_points(struct model *m, uint64_t count)
{
    if (!count)
        return 0;
    m->points = calloc(count < POSED_MAX_POINTS ? (size_t)count : POSED_MAX_POINTS, sizeof(*m->points));
    if (m->points)
        return 0;
    sst_log_error("not enough memory for the points of %s", m->path);
    return -ENOMEM;
}

/* Evenly over the source's order. */
bool model_keeps_point(uint64_t index, uint64_t count)
{
    if (count <= POSED_MAX_POINTS)
        return true;
    return (uint64_t)((double)(index + 1) * POSED_MAX_POINTS / (double)count) >
           (uint64_t)((double)index * POSED_MAX_POINTS / (double)count);
}

void model_observe(struct model *m, const struct sst_calib_camera *c, const double at[3])
{
    double depth = 0;

    for (int i = 0; i < 3; i++)
        depth += c->rotation[6 + i] * (at[i] - c->position_mm[i]);
    if (depth > 0)
        m->ahead++;
    else
        m->behind++;
}

bool model_number(const json_t *value, double *out)
{
    const char *text = json_string_value(value);
    char *end;

    if (text) {
        *out = strtod(text, &end);
        while (*end == ' ')
            end++;
        return end != text && !*end && isfinite(*out);
    }
    *out = json_number_value(value);
    return json_is_number(value) && isfinite(*out);
}

const char *model_check_numbers(const json_t *object, const char *const *keys, size_t n)
{
    static _Thread_local char text[64];

    for (size_t i = 0; i < n; i++) {
        const json_t *value = json_object_get(object, keys[i]);
        double number;

        if (!value || json_is_null(value) || model_number(value, &number))
            continue;
        snprintf(text, sizeof(text), "%s is not a number", keys[i]);
        return text;
    }
    return NULL;
}

static bool add_numbers(const json_t *value, double *out, int n, int *found)
{
    if (!json_is_array(value)) {
        if (*found == n)
            return false;
        return model_number(value, &out[(*found)++]);
    }
    for (size_t i = 0; i < json_array_size(value); i++) {
        const json_t *element = json_array_get(value, i);

        if (json_is_array(element) && json_is_array(json_array_get(element, 0)))
            return false; /* deeper than rows */
        if (!add_numbers(element, out, n, found))
            return false;
    }
    return true;
}

bool model_numbers(const json_t *list, double *out, int n)
{
    int found = 0;

    return json_is_array(list) && add_numbers(list, out, n, &found) && found == n;
}

int model_json(json_t **root, const char *path)
{
    json_error_t e;
    uint8_t *text;
    size_t size;
    const int err = sst_file_read_text(path, MODEL_BYTES, &text, &size);

    if (err)
        return err;
    *root = json_loadb((const char *)text, size, 0, &e);
    free(text);
    if (*root)
        return 0;
    sst_log_error("%s:%d:%d: %s; correct the file", path, e.line, e.column, e.text);
    return -EBADMSG;
}
