/* mrcal's .cameramodel files, one a picture, with its name: a Python dictionary. Pixel centres are on integers; the
 * extrinsics are a rotation vector and a translation in metres that take points from the reference into the camera. */
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

#define END ".cameramodel"

/* Begin of a key's value, outside of comments and other strings. @return NULL: there is none */
static const char *find_value(const char *text, const char *key)
{
    const size_t n = strlen(key);

    for (const char *p = text; *p; p++) {
        if (*p == '#') {
            p += strcspn(p, "\n");
            if (!*p)
                break;
        } else if (*p == '\'' || *p == '"') {
            const char *end = strchr(p + 1, *p), *after;

            if (!end)
                break;
            after = end + 1 + strspn(end + 1, " \t\r\n");
            if ((size_t)(end - p - 1) == n && !strncmp(p + 1, key, n) && *after == ':')
                return after + 1;
            p = end;
        }
    }
    return NULL;
}

static const char *skip_space(const char *p)
{
    for (;;) {
        p += strspn(p, " \t\r\n,");
        if (*p != '#')
            return p;
        p += strcspn(p, "\n");
    }
}

/* Numbers of a list. @return their count, at most max, or -1: no list of numbers */
static int read_list(const char *p, double *out, int max)
{
    int n = 0;

    p = p ? skip_space(p) : "";
    if (*p != '[' && *p != '(')
        return -1;
    for (p = skip_space(p + 1); *p != ']' && *p != ')'; p = skip_space(p)) {
        char *end;

        if (n == max)
            return -1;
        out[n] = strtod(p, &end);
        if (end == p || !isfinite(out[n++]))
            return -1;
        p = end;
    }
    return n;
}

static const char *read_lens(struct model_view *v, const char *text)
{
    static _Thread_local char fault[140];
    static const struct {
        const char *name;
        int k;
    } lenses[] = { { "LENSMODEL_PINHOLE", 0 }, { "LENSMODEL_OPENCV4", 4 }, { "LENSMODEL_OPENCV5", 5 }, { "LENSMODEL_OPENCV8", 8 } };
    const char *model = find_value(text, "lensmodel");
    size_t bytes = 0;
    double p[32], size[2];

    if (model) {
        model += strspn(model, " \t\r\n'\"");
        bytes = strcspn(model, "'\" \n");
    }
    if (read_list(find_value(text, "imagersize"), size, 2) != 2 || !(size[0] >= 1) || !(size[1] >= 1) ||
        size[0] > SST_IMAGE_MAX_SIDE || size[1] > SST_IMAGE_MAX_SIDE)
        return "imagersize is not two numbers of 1 to 32768";
    for (size_t i = 0; i < ARRAY_LEN(lenses); i++) {
        if (!bytes || strlen(lenses[i].name) != bytes || strncmp(model, lenses[i].name, bytes))
            continue;
        if (read_list(find_value(text, "intrinsics"), p, 32) != 4 + lenses[i].k)
            return "intrinsics is not as many numbers as its lensmodel has";
        v->width = (int)size[0];
        v->height = (int)size[1];
        return model_lens(v, (const double[4]){ p[0], p[1], p[2] + 0.5, p[3] + 0.5 }, p + 4, lenses[i].k);
    }
    snprintf(fault, sizeof(fault), "the lensmodel %.*s is not LENSMODEL_PINHOLE, _OPENCV4, _OPENCV5 or _OPENCV8",
             (int)(bytes < 60 ? bytes : 60), model ? model : "");
    return fault;
}

static int read_file(struct model *m, const char *path)
{
    const char *pose, *fault = NULL;
    char name[MODEL_NAME];
    struct model_view *v;
    uint8_t *text;
    size_t size;
    double rt[6], R[9];
    int err = sst_file_read_text(path, MODEL_BYTES, &text, &size);

    if (err)
        return err;
    m->path = path;
    snprintf(name, sizeof(name), "%.*s", (int)(strlen(sst_path_base(path)) - strlen(END)), sst_path_base(path));
    v = model_add(m, name);
    pose = find_value((const char *)text, "extrinsics");
    pose = pose ? pose : find_value((const char *)text, "rt_cam_ref");
    if (!v) {
        err = -EBADMSG;
    } else if (read_list(pose, rt, 6) != 6) {
        fault = "extrinsics is not a list of 6 numbers";
    } else {
        sst_rotation_from_vector(rt, R);
        fault = model_place(v, R, rt + 3);
        fault = fault ? fault : read_lens(v, (const char *)text);
    }
    free(text);
    return fault ? model_fault(m, "", fault) : err;
}

static int compare(const void *a, const void *b)
{
    return natural_order(a, b);
}

int read_mrcal(struct model *m, const char *path)
{
    char(*name)[256] = calloc(SST_POSED_MAX_VIEWS + 1, sizeof(*name)), file[SST_PATH_MAX];
    struct dirent *e;
    int n = 0, err = name ? 0 : -ENOMEM;
    DIR *d = err ? NULL : opendir(path);

    m->format = "mrcal";
    m->metric = true;
    if (!err && !d) {
        sst_log_error("%s is one camera; name the folder with a model for each picture", path);
        err = -EBADMSG;
    }
    while (d && n <= SST_POSED_MAX_VIEWS && (e = readdir(d))) {
        if (e->d_name[0] != '.' && sst_text_ends(e->d_name, END))
            snprintf(name[n++], sizeof(*name), "%s", e->d_name);
    }
    if (d)
        closedir(d);
    if (n)
        qsort(name, (size_t)n, sizeof(*name), compare);
    for (int i = 0; !err && i < n; i++) {
        err = sst_path_join(file, path, name[i]);
        err = err ? err : read_file(m, file);
    }
    m->path = path;
    free(name);
    return err;
}
