/* nerfstudio's transforms.json, and instant-ngp's. Matrices take points from the camera's axes (x right, y up, z back)
 * into the world; pixel centres are at halves. applied_transform was applied to the world, and is undone. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/posed/import/import_internal.h"

/* A number of a frame, else of all frames. @return false: there is none */
static bool get(const json_t *frame, const json_t *root, const char *key, double *out)
{
    const json_t *v = json_object_get(frame, key);

    return model_number(v ? v : json_object_get(root, key), out);
}

static bool text_among(const json_t *value, const char *const *texts, size_t n)
{
    for (size_t i = 0; json_is_string(value) && i < n; i++) {
        if (!strcmp(json_string_value(value), texts[i]))
            return true;
    }
    return !value;
}

static const char *read_lens(struct model_view *v, const json_t *frame, const json_t *root)
{
    static const char *const keys[] = { "k1", "k2", "p1", "p2", "k3", "k4", "w", "h", "fl_x", "fl_y", "cx", "cy" };
    const double pi = 3.14159265358979323846;
    double lens[4], k[5] = { 0 }, size[2] = { 0, 0 }, k4 = 0, angle;
    const char *fault = model_check_numbers(root, keys, ARRAY_LEN(keys));

    fault = fault ? fault : model_check_numbers(frame, keys, ARRAY_LEN(keys));
    if (fault)
        return fault;
    if ((get(frame, root, "w", &size[0]) && !(size[0] >= 1 && size[0] <= SST_IMAGE_MAX_SIDE)) ||
        (get(frame, root, "h", &size[1]) && !(size[1] >= 1 && size[1] <= SST_IMAGE_MAX_SIDE)))
        return "w or h is not 1 to 32768";
    if (get(frame, root, "fl_x", &lens[0])) {
        if (!get(frame, root, "fl_y", &lens[1]))
            lens[1] = lens[0];
    } else if (get(frame, root, "camera_angle_x", &angle) && angle > 0 && angle < pi) {
        v->angle[0] = angle;
        v->angle[1] = get(frame, root, "camera_angle_y", &angle) && angle > 0 && angle < pi ? angle : 0;
        if (!(size[0] > 0 && size[1] > 0))
            return NULL; /* of the NeRF paper's scenes: from the pictures' size */
        lens[0] = size[0] / 2 / tan(v->angle[0] / 2);
        lens[1] = v->angle[1] > 0 ? size[1] / 2 / tan(v->angle[1] / 2) : lens[0];
    } else {
        return NULL; /* from the user */
    }
    if (size[0] == 0 || size[1] == 0)
        return "w and h are missing beside fl_x";
    if (!get(frame, root, "cx", &lens[2]))
        lens[2] = size[0] / 2;
    if (!get(frame, root, "cy", &lens[3]))
        lens[3] = size[1] / 2;
    for (size_t i = 0; i < ARRAY_LEN(k); i++)
        (void)get(frame, root, keys[i], &k[i]);
    if (get(frame, root, "k4", &k4) && k4 != 0)
        return "k4 is not 0: the lens is not one with OpenCV's distortion";
    v->width = (int)size[0];
    v->height = (int)size[1];
    return model_lens(v, lens, k, 5);
}

/* Pose from a matrix of camera to world, the applied transform X' = A X + b undone. */
static const char *place(struct model_view *v, const double M[16], const double A[12])
{
    double R[9], t[3] = { 0, 0, 0 };

    /* R = flip M^T A; t = -flip M^T (c - b), M's columns being the camera's axes and c its centre. */
    for (int i = 0; i < 3; i++) {
        const double sign = i ? -1 : 1;

        for (int j = 0; j < 3; j++) {
            R[3 * i + j] = 0;
            for (int l = 0; l < 3; l++)
                R[3 * i + j] += sign * M[4 * l + i] * A[4 * l + j];
        }
        for (int l = 0; l < 3; l++)
            t[i] -= sign * M[4 * l + i] * (M[4 * l + 3] - A[4 * l + 3]);
    }
    return model_place(v, R, t);
}

static int read_frame(struct model *m, const json_t *frame, const json_t *root, const double A[12])
{
    static const char *const lenses[] = { "OPENCV",        "PINHOLE", "SIMPLE_PINHOLE",
                                          "SIMPLE_RADIAL", "RADIAL",  "PERSPECTIVE" };
    const json_t *name = json_object_get(frame, "file_path"), *lens = json_object_get(frame, "camera_model");
    const char *file = json_string_value(name), *fault;
    struct model_view *v;
    double M[16];

    if (!file)
        return model_fault(m, "", "frames: file_path is missing, or no text");
    if (!model_numbers(json_object_get(frame, "transform_matrix"), M, 16)) {
        M[12] = M[13] = M[14] = 0;
        M[15] = 1;
        if (!model_numbers(json_object_get(frame, "transform_matrix"), M, 12))
            return model_fault(m, file, "transform_matrix is not a list of 4 rows of 4 numbers");
    }
    if (M[12] != 0 || M[13] != 0 || M[14] != 0 || M[15] != 1)
        return model_fault(m, file, "the last row of transform_matrix is not 0, 0, 0, 1");
    lens = lens ? lens : json_object_get(root, "camera_model");
    if (!text_among(lens, lenses, ARRAY_LEN(lenses))) {
        sst_log_error("%s: %s: the camera model %s is not one of a pinhole with OpenCV's distortion; undistort it",
                      m->path, file, json_string_value(lens) ? json_string_value(lens) : "(no text)");
        return -EBADMSG;
    }
    v = model_add(m, file + (!strncmp(file, "./", 2) ? 2 : 0));
    if (!v)
        return -EBADMSG;
    fault = place(v, M, A);
    fault = fault ? fault : read_lens(v, frame, root);
    return fault ? model_fault(m, file, fault) : 0;
}

int read_nerfstudio(struct model *m, const char *path)
{
    double A[12] = { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0 };
    const json_t *frames, *applied;
    json_t *root;
    int err = model_json(&root, path);

    if (err)
        return err;
    m->format = "nerfstudio";
    m->path = path;
    frames = json_object_get(root, "frames");
    applied = json_object_get(root, "applied_transform");
    if (!json_is_array(frames))
        err = model_fault(m, "", "frames is not a list");
    else if (applied && !model_numbers(applied, A, 12) && json_array_size(applied) != 4)
        err = model_fault(m, "", "applied_transform is not a list of 3 rows of 4 numbers");
    for (size_t i = 0; !err && i < json_array_size(frames); i++)
        err = read_frame(m, json_array_get(frames, i), root, A);
    json_decref(root);
    return err;
}
