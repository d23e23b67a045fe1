/* Poses of AOS (airborne optical sectioning): {"images": [{"imagefile", "M3x4"}]}. M3x4 takes points from the world into
 * the camera's axes: x right, y down, z forward; z of the world is down in flights. Lenses are elsewhere. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/text.h"
#include "pipeline/posed/import/import_internal.h"

#define MAX_FILES 4096

static struct model_view *find(const struct model *m, const char *name)
{
    for (int k = 0; k < m->count; k++) {
        if (!strcmp(m->view[k].name, name))
            return &m->view[k];
    }
    return NULL;
}

/* Files of a flight list a picture several times, as its poses become better: the last file's counts. */
static int add(struct model *m, const char *name, const double M[12], int file)
{
    const double R[9] = { M[0], M[1], M[2], M[4], M[5], M[6], M[8], M[9], M[10] }, t[3] = { M[3], M[7], M[11] };
    struct model_view *v = find(m, name);
    const char *fault;

    if (v && v->file == file)
        return model_fault(m, name, "it has two poses; remove one");
    v = v ? v : model_add(m, name);
    if (!v)
        return -EBADMSG;
    v->file = file;
    fault = model_place(v, R, t);
    return fault ? model_fault(m, name, fault) : 0;
}

static int read_images(struct model *m, const json_t *images, int file)
{
    char text[96];
    int err = 0;

    if (!images)
        return model_fault(m, "", "it has no list `images` with M3x4");
    if (!json_is_array(images))
        return model_fault(m, "", "images is not a list; put the one image into brackets");
    for (size_t i = 0; !err && i < json_array_size(images); i++) {
        const json_t *image = json_array_get(images, i);
        const char *name = json_string_value(json_object_get(image, "imagefile"));
        double M[12];

        snprintf(text, sizeof(text), "images[%zu]", i);
        if (!name)
            err = model_fault(m, text, "imagefile is missing, or no text");
        else if (!model_numbers(json_object_get(image, "M3x4"), M, 12))
            err = model_fault(m, name, "M3x4 is not a list of 3 rows of 4 numbers");
        else
            err = add(m, name, M, file);
    }
    return err;
}

/* @param file  number of it */
static int read_file(struct model *m, const char *path, int file)
{
    json_t *root;
    int err = model_json(&root, path);

    if (err)
        return err;
    m->path = path;
    err = read_images(m, json_object_get(root, "images"), file);
    json_decref(root);
    return err;
}

static int compare(const void *a, const void *b)
{
    return natural_order(a, b);
}

/* All *.json of a folder, in the natural order of their names. */
static int read_folder(struct model *m, const char *dir)
{
    char(*name)[256] = calloc(MAX_FILES, sizeof(*name)), path[SST_PATH_MAX];
    struct dirent *e;
    int n = 0, err = name ? 0 : -ENOMEM;
    DIR *d = err ? NULL : opendir(dir);

    while (d && n < MAX_FILES && (e = readdir(d))) {
        if (e->d_name[0] != '.' && sst_text_ends(e->d_name, ".json"))
            snprintf(name[n++], sizeof(*name), "%s", e->d_name);
    }
    if (d)
        closedir(d);
    if (n)
        qsort(name, (size_t)n, sizeof(*name), compare);
    for (int i = 0; !err && i < n; i++) {
        err = sst_path_join(path, dir, name[i]);
        err = err ? err : read_file(m, path, i + 1);
    }
    m->path = dir;
    free(name);
    return err;
}

/* The world's ground is near z = 0, or at its height above the sea: cameras far from it, compared with their distances,
 * look towards it. @return false: all look away */
static bool find_up(struct model *m)
{
    double lo[3] = { INFINITY, INFINITY, INFINITY }, hi[3] = { -INFINITY, -INFINITY, -INFINITY }, near = INFINITY, size = 0;
    int towards = 0, away = 0;

    for (int k = 0; k < m->count; k++) {
        const struct sst_calib_camera *c = &m->view[k].camera;

        for (int i = 0; i < 3; i++) {
            lo[i] = fmin(lo[i], c->position_mm[i]);
            hi[i] = fmax(hi[i], c->position_mm[i]);
        }
        near = fmin(near, fabs(c->position_mm[2]));
        if (fabs(c->rotation[8]) > 0.5) {
            towards += c->rotation[8] * c->position_mm[2] < 0;
            away += c->rotation[8] * c->position_mm[2] > 0;
        }
    }
    for (int i = 0; i < 3; i++)
        size = fmax(size, hi[i] - lo[i]);
    if (near < size / 4 || near == 0)
        return true;
    if (towards == m->count)
        m->up[2] = m->view[0].camera.position_mm[2] < 0 ? -1 : 1;
    return away < m->count;
}

int read_aos(struct model *m, const char *path)
{
    const int err = sst_path_is_dir(path) ? read_folder(m, path) : read_file(m, path, 1);

    m->format = "AOS";
    m->metric = true;
    m->path = path;
    if (err || !m->count)
        return err;
    if (!find_up(m))
        return model_fault(m, "", "all cameras look away from the ground (z = 0); M3x4 must take points from the world "
                                  "into the camera, z forward");
    return 0;
}
