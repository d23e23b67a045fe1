/* Folders of pictures: camera and moment from the names of folders and files. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "base/mem.h"
#include "capture/calibration/calibration_internal.h"
#include "capture/recording/recording.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/raw.h"
#include "pipeline/lightfield/folder.h"

/* --- a recording's framesets -------------------------------------------------------------------------------------- */

static int open_recorded(struct sst_gather_source *out, const struct sst_gather_selection *selection)
{
    const struct sst_recording_info *info;
    int sets, err = sst_recording_open(&out->recording, out->path);

    if (err)
        return err;
    info = sst_recording_info(out->recording);
    sets = sst_recording_sets(out->recording);
    out->rows = info->rows;
    out->cols = info->cols;
    if (selection->grid[0] && (selection->grid[0] != out->rows || selection->grid[1] != out->cols)) {
        sst_log_error("%s is of %dx%d cameras, not %dx%d; leave out --grid", out->path, out->rows, out->cols,
                      selection->grid[0], selection->grid[1]);
        return -EBADMSG;
    }
    out->spacing_mm = info->spacing_mm;
    out->frames = gather_selection_count(selection, sets);
    if (!out->frames) {
        sst_log_error("%s holds no set; record some first", out->path);
        return -EBADMSG;
    }
    out->camera_name = calloc((size_t)(out->rows * out->cols), sizeof(*out->camera_name));
    out->frame_name = calloc((size_t)out->frames, sizeof(*out->frame_name));
    out->frameset = calloc((size_t)out->frames, sizeof(*out->frameset));
    if (!out->camera_name || !out->frame_name || !out->frameset)
        return -ENOMEM;
    for (int i = 0; i < info->cameras; i++) {
        const struct sst_recorder_track *t = &info->track[i];

        snprintf(out->camera_name[t->row * out->cols + t->col], sizeof(*out->camera_name), "%s",
                 t->serial[0] ? t->serial
                 : t->port[0] ? t->port
                              : t->name);
        if (!out->camera_name[t->row * out->cols + t->col][0])
            snprintf(out->camera_name[t->row * out->cols + t->col], sizeof(*out->camera_name), "%02d_%02d", t->row,
                     t->col);
    }
    for (int i = 0; i < out->frames; i++) {
        out->frameset[i] = gather_selection_at(selection, sets, i);
        snprintf(out->frame_name[i], sizeof(*out->frame_name), "set %d", out->frameset[i]);
    }
    return 0;
}

static int read_recorded(const struct sst_gather_source *source, int view, int frame, struct sst_image *out)
{
    const struct sst_recording_info *info = sst_recording_info(source->recording);
    struct sst_recording_set *set = malloc(sizeof(*set));
    uint8_t *data = NULL;
    size_t bytes = 0;
    int cam = 0, err = set ? 0 : -ENOMEM;

    while (cam < info->cameras && info->track[cam].row * source->cols + info->track[cam].col != view)
        cam++;
    if (!err && cam == info->cameras)
        err = -ENODATA;
    err = err ? err : sst_recording_set(source->recording, source->frameset[frame], set);
    if (!err && set->frame[cam].faults & SST_RECORDING_BAD_PICTURE)
        err = -ENODATA;
    err = err ? err : sst_recording_picture(source->recording, set, cam, &data, &bytes);
    if (!err)
        err = sst_raw_decode(
            out, &(struct sst_raw){ info->fourcc, info->width, info->height, set->frame[cam].stride, data, bytes });
    free(data);
    free(set);
    return err == -EBADMSG ? -EILSEQ : err;
}

/* --- folders of pictures ------------------------------------------------------------------------------------------ */

/* One picture found: camera and moment by name. */
struct found {
    char camera[64], frame[64];
    char *path;
};

struct list {
    int count, capacity;
    struct found *item;
};

static void list_fini(struct list *l)
{
    for (int i = 0; i < l->count; i++)
        free(l->item[i].path);
    free(l->item);
}

static int list_add(struct list *l, const char *camera, const char *frame, const char *path)
{
    struct found *f;

    if (!sst_mem_grow(&l->item, l->count, &l->capacity, sizeof(*l->item)))
        return -ENOMEM;
    f = &l->item[l->count];
    snprintf(f->camera, sizeof(f->camera), "%s", camera);
    snprintf(f->frame, sizeof(f->frame), "%s", frame);
    f->path = strdup(path);
    if (!f->path)
        return -ENOMEM;
    l->count++;
    return 0;
}

static int visible(const struct dirent *e)
{
    return e->d_name[0] != '.';
}

/* Names in a folder, sorted bytewise: no program here sets a locale. @return count or a negative errno, logged */
static int scan(const char *dir, struct dirent ***names)
{
    const int n = scandir(dir, names, visible, alphasort), err = n < 0 ? -errno : 0;

    if (err)
        sst_log_error("cannot read the folder %s: %s", dir, strerror(-err));
    return err ? err : n;
}

static void free_names(struct dirent **names, int n)
{
    for (int i = 0; i < n; i++)
        free(names[i]);
    free(names);
}

/* The pictures of one camera's folder. */
static int scan_camera(struct list *l, const char *dir, const char *camera)
{
    struct dirent **names;
    const int n = scan(dir, &names);
    int err = n < 0 ? n : 0;

    for (int i = 0; i < n && !err; i++) {
        char path[SST_PATH_MAX], frame[256];

        if (!sst_image_is_picture(names[i]->d_name))
            continue;
        snprintf(frame, sizeof(frame), "%s", names[i]->d_name);
        *strrchr(frame, '.') = 0;
        err = sst_path_join(path, dir, names[i]->d_name);
        err = err ? err : list_add(l, camera, frame, path);
    }
    if (n >= 0)
        free_names(names, n);
    return err;
}

/* "left01.jpg": camera left, frame 01. */
static int add_flat(struct list *l, const char *dir, const char *name)
{
    char camera[256], frame[256], path[SST_PATH_MAX];
    size_t digits;
    int err = sst_path_join(path, dir, name);

    if (err)
        return err;
    snprintf(camera, sizeof(camera), "%s", name);
    *strrchr(camera, '.') = 0;
    digits = strlen(camera);
    while (digits && isdigit((unsigned char)camera[digits - 1]))
        digits--;
    if (!camera[digits]) /* no number: one camera, its name is the frame */
        return list_add(l, "camera", camera, path);
    snprintf(frame, sizeof(frame), "%s", camera + digits);
    while (digits && strchr("_- .", camera[digits - 1]))
        digits--;
    camera[digits] = 0;
    return list_add(l, digits ? camera : "camera", frame, path);
}

static bool has(const char *dir, const char *name)
{
    char path[SST_PATH_MAX];

    return !sst_path_join(path, dir, name) && sst_path_exists(path);
}

/* Views of a light field: they are its files, raw where it has a calibration. */
static int add_lightfield(struct sst_gather_source *s, struct list *l, const char *dir, const char *frame)
{
    struct sst_lightfield lf;
    char path[SST_PATH_MAX];
    int err = sst_lightfield_load(&lf, dir, 0, 1);

    if (err)
        return err;
    if (s->rows && (s->rows != lf.rows || s->cols != lf.cols)) {
        sst_log_error("%s has %dx%d views, but the light fields before it %dx%d; calibrate them separately", dir,
                      lf.rows, lf.cols, s->rows, s->cols);
        err = -EBADMSG;
    }
    if (!err && has(dir, "capture.jsonl"))
        s->rig = true;
    if (!err && s->rig && !s->drive_mm && lf.spacing_mm > 0) {
        s->drive_mm = calloc((size_t)(lf.rows * lf.cols), sizeof(*s->drive_mm));
        for (int k = 0; s->drive_mm && k < lf.rows * lf.cols; k++) {
            s->drive_mm[k][0] = lf.views[k].bx * lf.spacing_mm;
            s->drive_mm[k][1] = lf.views[k].by * lf.spacing_mm;
        }
        err = s->drive_mm ? 0 : -ENOMEM;
    }
    s->rows = lf.rows;
    s->cols = lf.cols;
    for (int k = 0; k < lf.rows * lf.cols && !err; k++) {
        char name[16], file[SST_PATH_MAX];

        if (!lf.views[k].present)
            continue;
        sst_view_name(&lf, k, name);
        err = sst_path_join(path, dir, "views");
        err = err ? err : sst_path_join(file, path, lf.files->view[k].name);
        err = err ? err : list_add(l, name, frame, file);
    }
    sst_lightfield_fini(&lf);
    return err;
}

static int scan_all(struct sst_gather_source *s, struct list *l)
{
    struct dirent **names;
    int n, err = 0;

    if (has(s->path, "lightfield.json"))
        return add_lightfield(s, l, s->path, sst_path_base(s->path));
    n = scan(s->path, &names);
    if (n < 0)
        return n;
    for (int i = 0; i < n && !err; i++) {
        const char *name = names[i]->d_name;
        char path[SST_PATH_MAX];

        err = sst_path_join(path, s->path, name);
        if (!err && sst_path_is_dir(path))
            err = has(path, "lightfield.json") ? add_lightfield(s, l, path, name) : scan_camera(l, path, name);
        else if (!err && sst_image_is_picture(name))
            err = add_flat(l, s->path, name);
    }
    free_names(names, n);
    return err;
}

/* --- names into views --------------------------------------------------------------------------------------------- */

static int by_name(const void *a, const void *b)
{
    return strcmp(a, b);
}

/* The different names among the items, sorted. @param field  offset of the name in struct found */
static int distinct(const struct list *l, size_t field, char (**out)[64])
{
    char(*names)[64] = malloc((size_t)l->count * sizeof(*names));
    int n = 0;

    if (!names)
        return -ENOMEM;
    for (int i = 0; i < l->count; i++)
        memcpy(names[i], (const char *)&l->item[i] + field, sizeof(*names));
    qsort(names, (size_t)l->count, sizeof(*names), by_name);
    for (int i = 0; i < l->count; i++) {
        if (!n || strcmp(names[n - 1], names[i]))
            memmove(names[n++], names[i], sizeof(*names));
    }
    *out = names;
    return n;
}

static bool parse_position(const char *name, int *row, int *col)
{
    int end = 0;

    return sscanf(name, "%d_%d%n", row, col, &end) == 2 && !name[end] && *row >= 0 && *col >= 0 &&
           *row < SST_CAMERAS_MAX && *col < SST_CAMERAS_MAX;
}

/* The view of each camera name. */
static int assign_views(struct sst_gather_source *s, char (*name)[64], int n,
                        const struct sst_gather_selection *selection, int *view)
{
    int rows = selection->grid[0], cols = selection->grid[1], row, col;
    bool positioned = !selection->plain_names;

    if (rows && s->rows && (rows != s->rows || cols != s->cols)) { /* the drives' positions are indexed by its views */
        sst_log_error("%s is a light field of %dx%d views, not %dx%d; leave --grid out", s->path, s->rows, s->cols,
                      rows, cols);
        return -EBADMSG;
    }
    for (int i = 0; i < n; i++)
        positioned = positioned && parse_position(name[i], &row, &col);
    if (!rows && s->rows) {
        rows = s->rows;
        cols = s->cols;
    }
    for (int i = 0; i < n && positioned && !selection->grid[0] && !s->rows; i++) {
        if (parse_position(name[i], &row, &col)) {
            rows = row + 1 > rows ? row + 1 : rows;
            cols = col + 1 > cols ? col + 1 : cols;
        }
    }
    if (!rows) {
        rows = 1;
        cols = n;
    }
    if (rows * cols > SST_CAMERAS_MAX || (!positioned && rows * cols != n)) {
        sst_log_error(
            "%s has pictures of %d cameras (%s ... %s), which do not fill a grid of %dx%d; name them rr_cc by "
            "row and column, or give --grid",
            s->path, n, name[0], name[n - 1], rows, cols);
        return -EBADMSG;
    }
    s->rows = rows;
    s->cols = cols;
    for (int i = 0; i < n; i++) {
        view[i] = i;
        if (positioned && parse_position(name[i], &row, &col))
            view[i] = row * cols + col;
        if (positioned && (row >= rows || col >= cols)) {
            sst_log_error("camera %s of %s lies outside of a grid of %dx%d; correct --grid, or add --plain-names if "
                          "names are no places",
                          name[i], s->path, rows, cols);
            return -EBADMSG;
        }
    }
    return 0;
}

static int arrange(struct sst_gather_source *s, struct list *l, const struct sst_gather_selection *selection)
{
    char(*camera)[64] = NULL;
    int *view = NULL;
    const int cameras = distinct(l, offsetof(struct found, camera), &camera);
    int all = cameras < 0 ? cameras : distinct(l, offsetof(struct found, frame), &s->frame_name), err;

    err = all < 0 ? all : 0;
    if (!err) {
        view = calloc((size_t)cameras, sizeof(*view));
        err = view ? assign_views(s, camera, cameras, selection, view) : -ENOMEM;
    }
    if (!err) {
        s->frames = gather_selection_count(selection, all);
        s->camera_name = calloc((size_t)(s->rows * s->cols), sizeof(*s->camera_name));
        s->file = calloc((size_t)s->frames * (size_t)(s->rows * s->cols), sizeof(*s->file));
        err = s->camera_name && s->file ? 0 : -ENOMEM;
        for (int f = 0; f < s->frames; f++)
            memmove(s->frame_name[f], s->frame_name[gather_selection_at(selection, all, f)], sizeof(*s->frame_name));
    }
    for (int i = 0; i < cameras && !err; i++)
        memcpy(s->camera_name[view[i]], camera[i], sizeof(*camera));
    for (int i = 0; i < l->count && !err; i++) {
        struct found *f = &l->item[i];
        const char(*c)[64] = bsearch(f->camera, camera, (size_t)cameras, sizeof(*camera), by_name);
        const char(*t)[64] = bsearch(f->frame, s->frame_name, (size_t)s->frames, sizeof(*s->frame_name), by_name);
        char **slot;

        if (!t)
            continue;
        slot =
            &s->file[(size_t)((const char(*)[64])t - (const char(*)[64])s->frame_name) * (size_t)(s->rows * s->cols) +
                     (size_t)view[c - (const char(*)[64])camera]];
        if (*slot) {
            sst_log_error("%s and %s are both frame %s of camera %s; rename one", *slot, f->path, f->frame, f->camera);
            err = -EBADMSG;
            break;
        }
        *slot = f->path;
        f->path = NULL;
    }
    free(camera);
    free(view);
    return err;
}

static void warn_orientations(const struct sst_gather_source *s)
{
    const int n = s->frames * s->rows * s->cols;
    uint8_t *orientation = calloc((size_t)n, 1);

    for (int i = 0; orientation && i < n; i++)
        orientation[i] = (uint8_t)(s->file[i] ? sst_image_read_orientation(s->file[i]) : 1);
    if (orientation)
        sst_image_warn_orientations(s->path, (const char *const *)s->file, orientation, n);
    free(orientation);
}

int sst_gather_source_open(struct sst_gather_source *out, const char *path,
                           const struct sst_gather_selection *selection)
{
    struct list l = { 0 };
    int err;

    *out = (struct sst_gather_source){ .path = path, .rig = selection->rig };
    if (!sst_path_is_dir(path)) {
        const bool there = sst_path_exists(path);

        sst_log_error("%s %s; give a recording, a light field or a folder of pictures", path,
                      there ? "is not a folder" : "does not exist");
        return there ? -EBADMSG : -ENOENT;
    }
    if (has(path, "recording.json")) {
        err = open_recorded(out, selection);
    } else {
        err = scan_all(out, &l);
        if (!err && !l.count) {
            sst_log_error("%s holds no pictures (.jpg, .png), light fields or recording", path);
            err = -EBADMSG;
        }
        err = err ? err : arrange(out, &l, selection);
        if (!err)
            warn_orientations(out);
    }
    list_fini(&l);
    if (err)
        sst_gather_source_close(out);
    return err;
}

void sst_gather_source_close(struct sst_gather_source *s)
{
    for (int i = 0; s->file && i < s->frames * s->rows * s->cols; i++)
        free(s->file[i]);
    free(s->file);
    free(s->camera_name);
    free(s->frame_name);
    free(s->drive_mm);
    free(s->frameset);
    sst_recording_close(s->recording);
    *s = (struct sst_gather_source){ 0 };
}

int sst_gather_source_read(const struct sst_gather_source *s, int view, int frame, struct sst_image *out)
{
    const char *path;

    if (s->recording)
        return read_recorded(s, view, frame, out);
    path = s->file[(size_t)frame * (size_t)(s->rows * s->cols) + (size_t)view];
    /* Ranges of their own would hide the cameras' gains: the loss is reported for the first moment. */
    if (path && !frame)
        sst_image_report_depth(path);
    return path ? sst_image_read(out, path) : -ENODATA;
}
