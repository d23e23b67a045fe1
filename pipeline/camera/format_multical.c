/* multical's calibration.json: cameras by name (image_size, K, dist in OpenCV's order, model) and camera_poses, which
 * take points from the rig's axes ("NAME") or from another camera ("NAME_to_OTHER") into the camera: X = R X' + T,
 * metres; pixel centres on integers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/camera/format_parts.h"
#include "pipeline/camera/numbers.h"

#define METRE_MM 1000.0
#define MOST     16

/* A file being read. */
struct reader {
    const char *name;
    const struct sst_calib_format_config *cfg;
    double unit_mm;
    json_t *cameras, *poses;
    struct sst_loose *loose;
};

/* Numbers of a list or nested lists. @return their number, -1: something else, or too many */
static int numbers(const json_t *v, double out[MOST], int n, int depth)
{
    const json_t *item;
    size_t i;

    if (json_is_number(v)) {
        if (n == MOST || !(fabs(json_number_value(v)) <= SST_CALIB_LARGEST))
            return -1;
        out[n] = json_number_value(v);
        return n + 1;
    }
    if (!json_is_array(v) || depth == 0)
        return -1;
    json_array_foreach(v, i, item)
    {
        n = numbers(item, out, n, depth - 1);
        if (n < 0)
            return -1;
    }
    return n;
}

static int fault(const struct reader *r, const char *camera, const char *what)
{
    sst_log_error("%s: %.80s: %s", r->name, camera, what);
    return -EBADMSG;
}

static bool place_part(const json_t *camera, const char *key, int *out)
{
    const json_t *v = json_object_get(camera, key);

    if (!json_is_integer(v) || json_integer_value(v) < 0 || json_integer_value(v) >= SST_MAX_VIEWS)
        return false;
    *out = (int)json_integer_value(v);
    return true;
}

/* Whether a value, or one in a list of it, is of another lens model. */
static bool is_other(const char *key, const json_t *v, bool listed, char why[SST_LENS_WHY])
{
    char text[40] = "";
    const json_t *item;
    size_t i;

    json_array_foreach(v, i, item)
    {
        if (is_other(key, item, true, why)) /* no deeper than jansson's own limit */
            return true;
    }
    if (json_is_number(v))
        snprintf(text, sizeof(text), "%g", json_number_value(v));
    else if (json_is_string(v) || json_is_boolean(v))
        snprintf(text, sizeof(text), "%s", json_is_string(v) ? json_string_value(v) : json_is_true(v) ? "true" : "");
    return sst_loose_other_lens(key, text, listed, why);
}

/* Whether a member of a camera, or of the whole file, gives it another lens. @param why  a clause that begins with its
 * key */
static bool has_other_lens(const json_t *object, char why[SST_LENS_WHY])
{
    const char *key;
    json_t *v;

    json_object_foreach((json_t *)(uintptr_t)object, key, v)
    {
        char clause[SST_LENS_WHY];

        if (is_other(strcmp(key, "model") ? key : "lens_model", v, false, clause)) {
            snprintf(why, SST_LENS_WHY, "%.40s %.150s", key, clause);
            return true;
        }
    }
    return false;
}

static int read_camera(const struct reader *r, const char *name, const json_t *camera)
{
    struct sst_loose_camera *c = sst_loose_add(r->loose, name, r->name);
    const json_t *size = json_object_get(camera, "image_size"), *dist = json_object_get(camera, "dist");
    double K[MOST], d[MOST], s[MOST];
    const char *what;
    char why[SST_LENS_WHY];
    int n;

    if (!c)
        return -EBADMSG;
    if (numbers(json_object_get(camera, "K"), K, 0, 2) != 9)
        return fault(r, name, "K is not a 3 x 3 matrix");
    what = sst_loose_matrix(&c->cam, K);
    n = json_is_null(dist) ? 0 : numbers(dist, d, 0, 2); /* Python's None: a lens without distortion */
    if (!what && has_other_lens(camera, why))
        what = why;
    if (!what && n == 4) /* multical's pinholes have 5 and more */
        what = "dist has four coefficients: a fisheye lens, which is not supported; calibrate it as a pinhole";
    if (!what)
        what = n < 0 ? "dist is not a list of numbers" : sst_loose_lens(&c->cam, d, n);
    if (what)
        return fault(r, name, what);
    if (numbers(size, s, 0, 1) != 2 || !(s[0] >= 1 && s[0] <= SST_IMAGE_MAX_SIDE) ||
        !(s[1] >= 1 && s[1] <= SST_IMAGE_MAX_SIDE))
        return fault(r, name, "image_size is not [width, height]");
    c->width = (int)s[0];
    c->height = (int)s[1];
    if (!place_part(camera, "row", &c->row) || !place_part(camera, "col", &c->col))
        sst_loose_place(c, name, r->cfg);
    return 0;
}

static int read_transform(const struct reader *r, const char *key, const json_t *v, struct sst_loose_camera *out)
{
    double R[MOST], T[MOST];
    const char *what = NULL;

    if (numbers(json_object_get(v, "R"), R, 0, 2) != 9 || numbers(json_object_get(v, "T"), T, 0, 2) != 3)
        what = "R is not a 3 x 3 matrix, or T is not a vector of 3";
    else
        what = sst_loose_pose(out, R, T, r->unit_mm);
    return what ? fault(r, key, what) : 0;
}

static int find_camera(const struct reader *r, const char *name, size_t n)
{
    const char *key;
    json_t *camera;
    int i = 0;

    json_object_foreach(r->cameras, key, camera)
    {
        if (strlen(key) == n && !memcmp(key, name, n))
            return i;
        i++;
    }
    return -1;
}

/* X_camera = R (R_o (X - c_o) - c): the step's pose is in the other's axes. */
static void follow(struct sst_loose_camera *out, const struct sst_loose_camera *step,
                   const struct sst_loose_camera *other)
{
    const double *o = other->cam.rotation;
    double *p = out->cam.position_mm;

    for (int i = 0; i < 3; i++) {
        p[i] = other->cam.position_mm[i];
        for (int l = 0; l < 3; l++)
            p[i] += o[3 * l + i] * step->cam.position_mm[l];
    }
    sst_numbers_mul3(step->cam.rotation, o, out->cam.rotation);
    out->posed = true;
}

/* Read one pose if its parent is known. @return 1: read, 0: not yet, or a negative errno, logged */
static int read_pose(const struct reader *r, const char *key, const json_t *v)
{
    const char *to = strstr(key, "_to_");
    const int whole = find_camera(r, key, strlen(key));
    const int one = whole >= 0 ? whole : to ? find_camera(r, key, (size_t)(to - key)) : -1;
    const int other = whole >= 0 ? -1 : to ? find_camera(r, to + 4, strlen(to + 4)) : -1;
    struct sst_loose_camera *c, step;
    int err;

    if (one < 0 || (whole < 0 && other < 0))
        return fault(r, key, "camera_poses names a camera that cameras does not list");
    c = &r->loose->camera[one];
    if (c->posed)
        return 0;
    if (whole >= 0) {
        err = read_transform(r, key, v, c);
    } else {
        if (!r->loose->camera[other].posed)
            return 0;
        step = *c;
        err = read_transform(r, key, v, &step);
        if (!err)
            follow(c, &step, &r->loose->camera[other]);
    }
    return err ? err : 1;
}

static int read_all(const struct reader *r)
{
    const char *key;
    json_t *v;
    int taken = 1, err = 0;

    json_object_foreach(r->cameras, key, v)
    {
        err = read_camera(r, key, v);
        if (err)
            return err;
    }
    while (taken > 0) { /* poses may follow each other in any order */
        taken = 0;
        json_object_foreach(r->poses, key, v)
        {
            const int one = read_pose(r, key, v);

            if (one < 0)
                return one;
            taken += one;
        }
    }
    return 0;
}

int sst_multical_parse(struct sst_calib *out, const char *text, size_t size, const char *name,
                       const struct sst_calib_format_config *cfg)
{
    struct reader r = { .name = name, .cfg = cfg, .unit_mm = cfg->unit_mm > 0 ? cfg->unit_mm : METRE_MM };
    char why[SST_LENS_WHY];
    json_error_t where;
    json_t *root = json_loadb(text, size, JSON_REJECT_DUPLICATES, &where);
    int err;

    if (!root) {
        sst_log_error("%s:%d:%d: not JSON: %s", name, where.line, where.column, where.text);
        return -EBADMSG;
    }
    r.cameras = json_object_get(root, "cameras");
    r.poses = json_object_get(root, "camera_poses");
    r.loose = sst_loose_create();
    if (!r.loose) {
        err = -ENOMEM;
    } else if (!json_is_object(r.cameras) || (r.poses && !json_is_object(r.poses))) {
        sst_log_error("%s has no objects \"cameras\" and \"camera_poses\"; is it multical's calibration.json?", name);
        err = -EBADMSG;
    } else if (has_other_lens(root, why)) {
        sst_log_error("%s: %s", name, why);
        err = -EBADMSG;
    } else {
        err = read_all(&r);
    }
    err = err ? err : sst_loose_assemble(out, r.loose, cfg, name, "multical");
    free(r.loose);
    json_decref(root);
    return err;
}

int sst_multical_read(struct sst_calib *out, const char *path, const struct sst_calib_format_config *cfg)
{
    return sst_calib_read_file(out, path, cfg, sst_multical_parse);
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

static void put_rows(FILE *f, const double *v)
{
    for (int i = 0; i < 3; i++) {
        fputs(i ? ", [" : "[[", f);
        sst_put_numbers(f, v + 3 * i, 3);
        fputs("]", f);
    }
    fputs("]", f);
}

static void put_camera(FILE *f, const struct sst_calib *calib, int k, const char *separator)
{
    const struct sst_calib_camera *c = &calib->camera[k];
    const int row = k / calib->cols, col = k % calib->cols;

    fprintf(f, "%s\n    \"%02d_%02d\": {\n      \"model\": \"%s\",\n      \"image_size\": [%d, %d],\n      \"K\": ",
            separator, row, col, c->lens == 8 ? "rational" : "standard", calib->width, calib->height);
    put_rows(f, (const double[]){ c->fx, 0, c->cx, 0, c->fy, c->cy, 0, 0, 1 });
    fputs(",\n      \"dist\": [[", f);
    sst_put_numbers(f, c->k, c->lens ? c->lens : 5);
    fprintf(f, "]],\n      \"row\": %d,\n      \"col\": %d\n    }", row, col);
}

static void put_pose(FILE *f, const struct sst_calib *calib, int k, const char *separator)
{
    const int ref = calib->reference;
    double t[3];

    sst_camera_translation(&calib->camera[k], METRE_MM, t);
    fprintf(f, "%s\n    \"%02d_%02d", separator, k / calib->cols, k % calib->cols);
    if (k != ref)
        fprintf(f, "_to_%02d_%02d", ref / calib->cols, ref % calib->cols);
    fputs("\": {\n      \"R\": ", f);
    put_rows(f, calib->camera[k].rotation);
    fputs(",\n      \"T\": [", f);
    sst_put_numbers(f, t, 3);
    fputs("]\n    }", f);
}

int sst_multical_write(const struct sst_calib *calib, const char *path,
                       const struct sst_calib_format_config *cfg SST_UNUSED)
{
    const int first = sst_calib_next(calib, 0);
    struct sst_outfile out;
    int err = sst_outfile_open(&out, path);

    if (err)
        return err;
    fputs("{\n  \"cameras\": {", out.stream);
    for (int k = first; k >= 0; k = sst_calib_next(calib, k + 1))
        put_camera(out.stream, calib, k, k == first ? "" : ",");
    fputs("\n  },\n  \"camera_poses\": {", out.stream);
    for (int k = first; k >= 0; k = sst_calib_next(calib, k + 1))
        put_pose(out.stream, calib, k, k == first ? "" : ",");
    fputs("\n  }\n}\n", out.stream);
    return sst_outfile_commit(&out);
}
