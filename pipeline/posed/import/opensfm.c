/* OpenSfM's reconstruction.json. Focal lengths are in units of the longer side; poses are a rotation vector and a
 * translation that take points from the world into the camera's axes: x right, y down, z forward. With GPS the world is
 * east, north, up about reference_lla, metres. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/posed/import/import_internal.h"

static bool get(const json_t *object, const char *key, double *out)
{
    return model_number(json_object_get(object, key), out);
}

static const char *read_lens(struct model_view *v, const json_t *camera)
{
    static const char *const coefficients[] = { "k1", "k2", "p1", "p2", "k3" };
    static _Thread_local char text[160];
    const char *fault = model_check_numbers(camera, coefficients, ARRAY_LEN(coefficients));
    const char *type = json_string_value(json_object_get(camera, "projection_type"));
    double size[2], lens[4], centre[2] = { 0, 0 }, k[5] = { 0 }, side;
    bool whole;

    if (!get(camera, "width", &size[0]) || !get(camera, "height", &size[1]) || !(size[0] >= 1) || !(size[1] >= 1) ||
        size[0] > SST_IMAGE_MAX_SIDE || size[1] > SST_IMAGE_MAX_SIDE)
        return "its camera's width or height is not 1 to 32768";
    side = fmax(size[0], size[1]);
    if (type && !strcmp(type, "perspective")) {
        whole = get(camera, "focal", &lens[0]);
        lens[1] = lens[0];
    } else if (type && (!strcmp(type, "brown") || !strcmp(type, "simple_radial") || !strcmp(type, "radial"))) {
        whole = get(camera, "focal_x", &lens[0]) && get(camera, "focal_y", &lens[1]);
        whole &= get(camera, "c_x", &centre[0]) && get(camera, "c_y", &centre[1]);
    } else {
        snprintf(text, sizeof(text),
                 "the projection %.60s is not one of a pinhole with OpenCV's distortion; undistort it",
                 type ? type : "(none)");
        return text;
    }
    if (!whole)
        return "its camera's focal length or centre is missing";
    if (fault)
        return fault;
    for (size_t i = 0; i < ARRAY_LEN(k); i++)
        (void)get(camera, coefficients[i], &k[i]);
    lens[0] *= side;
    lens[1] *= side;
    lens[2] = centre[0] * side + size[0] / 2;
    lens[3] = centre[1] * side + size[1] / 2;
    v->width = (int)size[0];
    v->height = (int)size[1];
    return model_lens(v, lens, k, 5);
}

static int read_shot(struct model *m, const char *name, const json_t *shot, const json_t *cameras)
{
    const char *camera = json_string_value(json_object_get(shot, "camera"));
    struct model_view *v = model_add(m, name);
    double turn[3], t[3], R[9];
    const char *fault;

    if (!v)
        return -EBADMSG;
    if (!model_numbers(json_object_get(shot, "rotation"), turn, 3) ||
        !model_numbers(json_object_get(shot, "translation"), t, 3))
        return model_fault(m, name, "rotation or translation is not a list of 3 numbers");
    if (!camera || !json_object_get(cameras, camera))
        return model_fault(m, name, "its camera is not in the list of cameras");
    if (fabs(turn[0]) + fabs(turn[1]) + fabs(turn[2]) > 100)
        return model_fault(m, name, "its rotation is not a rotation vector in radians");
    sst_rotation_from_vector(turn, R);
    fault = model_place(v, R, t);
    fault = fault ? fault : read_lens(v, json_object_get(cameras, camera));
    if (fault)
        return model_fault(m, name, fault);
    snprintf(v->camera.name, sizeof(v->camera.name), "%s", camera);
    return 0;
}

/* Points have no tracks, thus no number of views. */
static int read_points(struct model *m, const json_t *points)
{
    const uint64_t count = json_object_size(points);
    uint64_t i = 0;
    const char *key;
    json_t *point;
    int err;

    if (points && !json_is_object(points))
        return model_fault(m, "", "points is not an object");
    err = model_reserve_points(m, count);
    if (err)
        return err;
    json_object_foreach((json_t *)points, key, point)
    {
        double at[3];

        if (!model_keeps_point(i++, count))
            continue;
        if (!model_numbers(json_object_get(point, "coordinates"), at, 3))
            return model_fault(m, "", "points: coordinates is not a list of 3 numbers");
        if (m->point_count == POSED_MAX_POINTS)
            break;
        memcpy(m->points[m->point_count++].at_mm, at, sizeof(at));
    }
    return 0;
}

/* A camera looks away if fewer than one in ten of at most 1,000 points is in front of it. */
static void observe(struct model *m)
{
    const int step = m->point_count / 1000 + 1;

    for (int k = 0; k < m->count; k++) {
        struct model one = { .count = 0 };

        for (int i = 0; i < m->point_count; i += step)
            model_observe(&one, &m->view[k].camera, m->points[i].at_mm);
        m->ahead += one.ahead * 10 > one.behind;
        m->behind += one.ahead * 10 <= one.behind && one.behind;
    }
}

static void read_place(struct model *m, const json_t *lla)
{
    double at[3];

    if (!get(lla, "latitude", &at[0]) || !get(lla, "longitude", &at[1]) || !get(lla, "altitude", &at[2]) ||
        (at[0] == 0 && at[1] == 0))
        return; /* without GPS it is 0, 0 */
    m->geographic = m->metric = true;
    m->latitude = at[0];
    m->longitude = at[1];
    m->altitude_m = at[2];
    m->up[2] = 1;
}

/* The reconstruction with most pictures, the first of these. */
static const json_t *largest(const json_t *root)
{
    const json_t *most = json_array_get(root, 0);

    for (size_t i = 1; i < json_array_size(root); i++) {
        const json_t *next = json_array_get(root, i);

        if (json_object_size(json_object_get(next, "shots")) > json_object_size(json_object_get(most, "shots")))
            most = next;
    }
    return most;
}

static int read_root(struct model *m, const json_t *root)
{
    const json_t *most = largest(root), *shots = json_object_get(most, "shots");
    const json_t *cameras = json_object_get(most, "cameras");
    const char *name;
    json_t *shot;
    int err = 0;

    if (!json_is_object(shots) || !json_is_object(cameras))
        return model_fault(m, "", "shots or cameras is not an object");
    if (json_array_size(root) > 1)
        sst_log_warning("%s has %zu reconstructions; the one with most pictures, %zu, is used", m->path,
                        json_array_size(root), json_object_size(shots));
    json_object_foreach((json_t *)shots, name, shot)
    {
        err = err ? err : read_shot(m, name, shot, cameras);
    }
    err = err ? err : read_points(m, json_object_get(most, "points"));
    if (err)
        return err;
    read_place(m, json_object_get(most, "reference_lla"));
    observe(m);
    return 0;
}

int read_opensfm(struct model *m, const char *path)
{
    json_t *root;
    int err = model_json(&root, path);

    if (err)
        return err;
    m->format = "OpenSfM";
    m->path = path;
    err = read_root(m, root);
    json_decref(root);
    return err;
}
