/* The folder: DIR/views/rr_cc.*, of still cameras also DIR/raw/rr_cc.*; DIR/capture.jsonl, a line with the settings,
 * then a line for each view, appended and synced after the files of the view; DIR/lightfield.json at the end. The last
 * line of a view is the valid one. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <jansson.h>
#include <linux/videodev2.h>
#include <sha2.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "base/text.h"
#include "capture/rig/rig.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/develop.h"
#include "pipeline/image/jpeg_tables.h"
#include "pipeline/image/raw.h"
#include "pipeline/lightfield/folder.h"
#include "pipeline/lightfield/parallax.h"

#define MANIFEST       "capture.jsonl"
#define MANIFEST_MAX   ((size_t)16 << 20)
#define FORMAT_NAME    "sst-rig-capture"
#define FORMAT_VERSION 1

struct stored_view {
    bool there;
    struct sst_rig_pos read;
    char sha256[SHA256_DIGEST_STRING_LENGTH], serial[64], port[64];
    char raw[32], raw_sha256[SHA256_DIGEST_STRING_LENGTH]; /* "00_01.cr2"; "": no raw file */
};

struct sst_scan_store {
    char dir[SST_PATH_MAX], views_dir[SST_PATH_MAX], raw_dir[SST_PATH_MAX], manifest[SST_PATH_MAX];
    int dir_fd, fd; /* the folder, locked; the manifest, to append */
    int rows, cols;
    int32_t pitch_um[2];
    uint32_t fourcc;
    bool must_exist, put_any;
    json_t *settings;
    struct stored_view *view; /* [rows * cols] */
};

static const char *extension(uint32_t fourcc)
{
    return fourcc == V4L2_PIX_FMT_MJPEG ? "jpg" : "png";
}

static void file_name(const struct sst_scan_store *s, int view, char out[32])
{
    snprintf(out, 32, "%02d_%02d.%s", view / s->cols, view % s->cols, extension(s->fourcc));
}

static int view_path(const struct sst_scan_store *s, int view, char out[SST_PATH_MAX])
{
    char name[32];

    file_name(s, view, name);
    return sst_path_join(out, s->views_dir, name);
}

static int no_memory(const struct sst_scan_store *s)
{
    sst_log_error("%s: not enough memory", s->dir);
    return -ENOMEM;
}

/* An object as a line of the manifest, to free; releases it. NULL: no memory. */
static char *line_of(json_t *object)
{
    char *text = object ? json_dumps(object, JSON_COMPACT) : NULL, *line = NULL;

    if (text && asprintf(&line, "%s\n", text) < 0)
        line = NULL;
    free(text);
    json_decref(object);
    return line;
}

/* --- settings ----------------------------------------------------------------------------------------------------- */

static json_t *settings_of(const struct sst_scan_config *cfg)
{
    char fourcc[5];

    for (int i = 0; i < 4; i++)
        fourcc[i] = (char)(cfg->fourcc >> 8 * i);
    fourcc[4] = 0;
    return json_pack("{s:i, s:i, s:[ii], s:[iii], s:i, s:s, s:i, s:i, s:s}", "rows", cfg->rows, "cols", cfg->cols,
                     "pitch_um", cfg->pitch_um[0], cfg->pitch_um[1], "origin_um", cfg->origin_um[0], cfg->origin_um[1],
                     cfg->origin_um[2], "backlash_um", cfg->backlash_um, "format", fourcc, "width", cfg->width,
                     "height", cfg->height, "controls", cfg->controls ? cfg->controls : "");
}

/* List every setting that differs. */
static int compare_settings(const struct sst_scan_store *s, json_t *there)
{
    char text[512] = "";
    const char *key;
    json_t *asked;

    json_object_foreach(s->settings, key, asked)
    {
        json_t *old = json_object_get(there, key);
        char *a, *b;

        if (json_equal(old, asked))
            continue;
        a = json_dumps(old, JSON_ENCODE_ANY | JSON_COMPACT);
        b = json_dumps(asked, JSON_ENCODE_ANY | JSON_COMPACT);
        sst_text_add(text, sizeof(text), "%s%s was %s and is now %s", *text ? ", " : "", key, a ? a : "missing",
                     b ? b : "?");
        free(a);
        free(b);
    }
    if (!text[0])
        return 0;
    sst_log_error("%s contains a capture with other settings: %s; use those or choose another folder", s->dir, text);
    return -EINVAL;
}

/* --- beginning ---------------------------------------------------------------------------------------------------- */

/* True for a temporary file of base/file.h with this final name. */
static bool is_left_over(const char *name)
{
    return strstr(name, ".tmp-") &&
           (!strncmp(name, MANIFEST, strlen(MANIFEST)) || !strncmp(name, "lightfield.json", 15) ||
            (name[0] >= '0' && name[0] <= '9' && name[2] == '_'));
}

/* Remove temporary files of a killed process; false: there are files that do not belong to a capture. */
static bool tidy(const char *dir)
{
    DIR *d = opendir(dir);
    bool ours = true;

    for (struct dirent *e = d ? readdir(d) : NULL; e; e = readdir(d)) {
        if (!strcmp(e->d_name, ".") || !strcmp(e->d_name, "..") || !strcmp(e->d_name, "views"))
            continue;
        if (is_left_over(e->d_name))
            (void)unlinkat(dirfd(d), e->d_name, 0);
        else
            ours = false;
    }
    if (d)
        closedir(d);
    return ours;
}

static int write_header(const struct sst_scan_store *s)
{
    char *line = line_of(
        json_pack("{s:s, s:i, s:O}", "format", FORMAT_NAME, "version", FORMAT_VERSION, "settings", s->settings));
    const int err = line ? sst_file_write(s->manifest, line, strlen(line)) : no_memory(s);

    free(line);
    return err;
}

/* --- reading ------------------------------------------------------------------------------------------------------ */

static bool read_pos(json_t *list, struct sst_rig_pos *out)
{
    struct sst_rig_pos pos;

    if (json_array_size(list) != SST_RIG_AXES)
        return false;
    for (int a = 0; a < SST_RIG_AXES; a++) {
        json_t *v = json_array_get(list, (size_t)a);

        if (!json_is_integer(v) || json_integer_value(v) < INT32_MIN || json_integer_value(v) > INT32_MAX)
            return false;
        pos.um[a] = (int32_t)json_integer_value(v);
    }
    *out = pos;
    return true;
}

static bool read_view(struct sst_scan_store *s, json_t *line)
{
    const char *sha256, *serial, *port, *file, *raw = "", *raw_sha256 = "";
    struct stored_view v = { .there = true };
    json_int_t view;
    json_t *read_um;
    char name[32];

    if (json_unpack(line, "{s:I, s:s, s:s, s:s, s:s, s:o, s?s, s?s}", "view", &view, "sha256", &sha256, "serial",
                    &serial, "port", &port, "file", &file, "read_um", &read_um, "raw", &raw, "raw_sha256",
                    &raw_sha256) ||
        view < 0 || view >= s->rows * s->cols || strlen(sha256) != 64 || strlen(serial) >= sizeof(v.serial) ||
        strlen(port) >= sizeof(v.port) || !read_pos(read_um, &v.read) ||
        (raw[0] && (strlen(raw_sha256) != 64 || strlen(raw) >= sizeof(v.raw) || strchr(raw, '/'))))
        return false;
    file_name(s, (int)view, name);
    if (strcmp(name, file) != 0)
        return false;
    strcpy(v.sha256, sha256);
    strcpy(v.serial, serial);
    strcpy(v.port, port);
    strcpy(v.raw, raw);
    strcpy(v.raw_sha256, raw[0] ? raw_sha256 : "");
    s->view[view] = v;
    return true;
}

/* A start that failed before its first view leaves a header alone: other settings spoil nothing then. */
static int read_header(struct sst_scan_store *s, json_t *line, bool alone)
{
    const char *format = json_string_value(json_object_get(line, "format"));

    if (!format || strcmp(format, FORMAT_NAME) != 0 ||
        json_integer_value(json_object_get(line, "version")) != FORMAT_VERSION) {
        sst_log_error("%s is not a rig capture manifest that this version can read; choose another folder",
                      s->manifest);
        return -EBADMSG;
    }
    if (alone && !s->must_exist && !json_equal(json_object_get(line, "settings"), s->settings) && tidy(s->views_dir) &&
        tidy(s->raw_dir))
        return write_header(s);
    return compare_settings(s, json_object_get(line, "settings"));
}

/* @param keep  out: bytes up to the end of the last complete line */
static int read_lines(struct sst_scan_store *s, const char *text, size_t size, size_t *keep)
{
    size_t at = 0;

    *keep = 0;
    for (int n = 1; at < size; n++) {
        const char *end = memchr(text + at, '\n', size - at);
        json_t *line;
        int err = 0;

        if (!end)
            break; /* the process was killed while writing this line */
        line = json_loadb(text + at, (size_t)(end - text) - at, JSON_REJECT_DUPLICATES, NULL);
        at = (size_t)(end - text) + 1;
        if (n == 1)
            err = read_header(s, line, at == size);
        else if (!line || !read_view(s, line))
            sst_log_warning("%s:%d is damaged; its view is captured again", s->manifest, n);
        json_decref(line);
        if (err)
            return err;
        *keep = at;
    }
    if (*keep)
        return 0;
    sst_log_error("%s has no complete first line; choose another folder or remove this one", s->manifest);
    return -EBADMSG;
}

static int read_manifest(struct sst_scan_store *s)
{
    uint8_t *text;
    size_t size, keep = 0;
    int err = sst_file_read_text(s->manifest, MANIFEST_MAX, &text, &size);

    if (err)
        return err;
    err = read_lines(s, (const char *)text, size, &keep);
    free(text);
    if (err || keep == size)
        return err;
    if (truncate(s->manifest, (off_t)keep)) {
        err = -errno;
        sst_log_error("cannot truncate the incomplete last line of %s: %s", s->manifest, strerror(errno));
    }
    return err;
}

static bool check_file(const char *path, const char *sha256)
{
    char hash[SHA256_DIGEST_STRING_LENGTH] = "";

    if (SHA256File(path, hash) && !strcmp(hash, sha256))
        return true;
    sst_log_warning("%s %s; it is captured again", path,
                    hash[0] ? "has changed since it was stored" : "cannot be read");
    return false;
}

static void check_views(struct sst_scan_store *s)
{
    for (int k = 0; k < s->rows * s->cols; k++) {
        struct stored_view *v = &s->view[k];
        char path[SST_PATH_MAX];

        if (v->there)
            v->there = !view_path(s, k, path) && check_file(path, v->sha256);
        if (v->there && v->raw[0])
            v->there = !sst_path_join(path, s->raw_dir, v->raw) && check_file(path, v->raw_sha256);
    }
}

/* --- opening ------------------------------------------------------------------------------------------------------ */

static int fault(const char *what, const char *path)
{
    const int e = errno;

    sst_log_error("cannot %s %s: %s", what, path, strerror(e));
    return e == ENOSPC || e == EROFS || e == EDQUOT || e == EACCES ? -e : -EIO;
}

static int begin_new(struct sst_scan_store *s, bool must_exist)
{
    if (must_exist) {
        sst_log_error("%s contains no capture to resume; omit --resume to start one", s->dir);
        return -ENOENT;
    }
    if (!tidy(s->views_dir)) {
        sst_log_error("%s is a folder with other contents; choose another one", s->dir);
        return -EEXIST;
    }
    return write_header(s);
}

static int lock_folder(struct sst_scan_store *s)
{
    s->dir_fd = open(s->dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (s->dir_fd < 0)
        return fault("open the folder", s->dir);
    if (!flock(s->dir_fd, LOCK_EX | LOCK_NB))
        return 0;
    if (errno != EWOULDBLOCK)
        return fault("lock the folder", s->dir);
    sst_log_error("%s: another capture is running in this folder; wait for it or choose another one", s->dir);
    return -EBUSY;
}

static int make_folders(struct sst_scan_store *s, bool must_exist)
{
    int err = 0;

    if (must_exist && !sst_path_exists(s->dir)) {
        sst_log_error("there is no folder %s to resume; omit --resume to start a capture", s->dir);
        return -ENOENT;
    }
    err = sst_path_make_dir(s->dir);
    err = err ? err : lock_folder(s);
    if (!err && sst_path_exists(s->manifest))
        return sst_path_make_dir(s->views_dir);
    if (!err && !must_exist && !tidy(s->dir)) {
        sst_log_error("%s is a folder with other contents; choose another one", s->dir);
        return -EEXIST;
    }
    return err || must_exist ? err : sst_path_make_dir(s->views_dir);
}

static int open_all(struct sst_scan_store *s, const struct sst_scan_config *cfg)
{
    int err = sst_path_join(s->dir, cfg->dir, NULL);

    err = err ? err : sst_path_join(s->views_dir, cfg->dir, "views");
    err = err ? err : sst_path_join(s->raw_dir, cfg->dir, "raw");
    err = err ? err : sst_path_join(s->manifest, cfg->dir, MANIFEST);
    err = err ? err : make_folders(s, cfg->must_exist);
    if (!err && !sst_path_exists(s->manifest))
        err = begin_new(s, cfg->must_exist);
    err = err ? err : read_manifest(s);
    if (err)
        return err;
    (void)tidy(s->dir);
    (void)tidy(s->views_dir);
    if (sst_path_exists(s->raw_dir))
        (void)tidy(s->raw_dir);
    check_views(s);
    s->fd = open(s->manifest, O_WRONLY | O_APPEND | O_CLOEXEC);
    return s->fd < 0 ? fault("open", s->manifest) : 0;
}

int sst_scan_store_open(struct sst_scan_store **out, const struct sst_scan_config *cfg)
{
    struct sst_scan_store *s = calloc(1, sizeof(*s));
    int err = -ENOMEM;

    if (!s)
        return err;
    s->dir_fd = s->fd = -1;
    s->rows = cfg->rows;
    s->cols = cfg->cols;
    s->must_exist = cfg->must_exist;
    s->fourcc = cfg->fourcc;
    memcpy(s->pitch_um, cfg->pitch_um, sizeof(s->pitch_um));
    if (s->fourcc != V4L2_PIX_FMT_MJPEG && s->fourcc != V4L2_PIX_FMT_GREY && s->fourcc != V4L2_PIX_FMT_Y16 &&
        s->fourcc != SST_SCAN_RAW) {
        sst_log_error("a rig capture supports MJPG (stored unchanged), GREY and Y16 (stored as PNG); choose one of "
                      "them as the cameras' format");
        err = -EINVAL;
        goto fail;
    }
    s->view = calloc((size_t)(s->rows * s->cols), sizeof(*s->view));
    s->settings = settings_of(cfg);
    err = s->view && s->settings ? open_all(s, cfg) : no_memory(s);
    if (err)
        goto fail;
    *out = s;
    return 0;

fail:
    sst_scan_store_close(s);
    return err;
}

void sst_scan_store_close(struct sst_scan_store *s)
{
    if (!s)
        return;
    if (s->fd >= 0)
        close(s->fd);
    if (s->dir_fd >= 0)
        close(s->dir_fd);
    json_decref(s->settings);
    free(s->view);
    free(s);
}

bool sst_scan_store_has(const struct sst_scan_store *s, int view)
{
    return s->view[view].there;
}

int sst_scan_store_count(const struct sst_scan_store *s)
{
    int n = 0;

    for (int k = 0; k < s->rows * s->cols; k++)
        n += s->view[k].there;
    return n;
}

int sst_scan_store_check_camera(const struct sst_scan_store *s, const struct sst_scan_camera *camera)
{
    for (int k = 0; k < s->rows * s->cols; k++) {
        const struct stored_view *v = &s->view[k];

        if (!v->there || (v->serial[0] ? !strcmp(v->serial, camera->serial) : !strcmp(v->port, camera->port)))
            continue;
        sst_log_error(
            "%s was started with camera %s at %s, this one is %s at %s; connect the old one or choose another folder",
            s->dir, v->serial[0] ? v->serial : "without a serial", v->port,
            camera->serial[0] ? camera->serial : "without a serial", camera->port);
        return -EINVAL;
    }
    return 0;
}

/* --- storing ------------------------------------------------------------------------------------------------------ */

/* A view of a raw file alone is developed from it. */
static int write_developed(const char *path, const struct sst_scan_original *raw)
{
    struct sst_image img = { 0 };
    int err = raw ? sst_image_develop(&img, raw->data, raw->bytes, path) : -EINVAL;

    err = err ? err : sst_image_write_png(&img, path);
    sst_image_fini(&img);
    return err;
}

/* The raw file, unchanged, and its hash read back. */
static int write_original(const struct sst_scan_store *s, int view, const struct sst_scan_original *raw,
                          struct stored_view *v)
{
    char path[SST_PATH_MAX];
    int err = sst_path_make_dir(s->raw_dir);

    snprintf(v->raw, sizeof(v->raw), "%02d_%02d.%.16s", view / s->cols, view % s->cols, raw->extension);
    err = err ? err : sst_path_join(path, s->raw_dir, v->raw);
    err = err ? err : sst_file_write(path, raw->data, raw->bytes);
    if (!err && !SHA256File(path, v->raw_sha256))
        err = fault("read back", path);
    return err;
}

static int write_frame(const struct sst_scan_store *s, const char *path, const struct sst_frame *f)
{
    const struct sst_raw raw = { s->fourcc, f->width, f->height, f->stride, f->data, f->bytes };

    return s->fourcc == V4L2_PIX_FMT_MJPEG ? sst_jpeg_write(path, f->data, f->bytes) : sst_raw_write_png(&raw, path);
}

static char *view_line(const struct sst_scan_store *s, int view, const struct sst_scan_shot *shot,
                       const struct sst_scan_camera *camera, const struct sst_frame *f, const struct stored_view *v)
{
    const int32_t *asked = shot->asked.um, *read = shot->read.um;
    json_t *line, *state = camera->state ? camera->state(camera->arg) : NULL;
    char name[32];

    file_name(s, view, name);
    line = json_pack("{s:i, s:i, s:i, s:s, s:[iii], s:[iii], s:s, s:s, s:I, s:I, s:I, s:I, s:i, s:I, s:s}", "view",
                     view, "row", view / s->cols, "col", view % s->cols, "file", name, "asked_um", asked[0], asked[1],
                     asked[2], "read_um", read[0], read[1], read[2], "serial", camera->serial, "port", camera->port,
                     "sequence", (json_int_t)f->sequence, "t_ns", (json_int_t)f->t_ns, "wall_ns",
                     (json_int_t)(sst_clock_wall_ns() - sst_clock_now_ns() + f->t_ns), "arrival_ns",
                     (json_int_t)f->arrival_ns, "attempts", shot->attempts, "bytes", (json_int_t)f->bytes, "sha256",
                     v->sha256);
    if (line && v->raw[0] &&
        (json_object_set_new(line, "raw", json_string(v->raw)) ||
         json_object_set_new(line, "raw_sha256", json_string(v->raw_sha256)))) {
        json_decref(line);
        line = NULL;
    }
    if (line && state)
        (void)json_object_set(line, "still", state);
    json_decref(state);
    return line_of(line);
}

/* Append the whole line durably, or nothing of it. */
static int append(struct sst_scan_store *s, const char *line)
{
    const size_t size = strlen(line);
    struct stat st;
    ssize_t n;
    int err;

    if (fstat(s->fd, &st))
        return fault("append to", s->manifest);
    errno = 0;
    n = write(s->fd, line, size);
    if (n == (ssize_t)size && !fdatasync(s->fd))
        return 0;
    if (n >= 0 && !errno)
        errno = ENOSPC;
    err = fault("append to", s->manifest);
    if (ftruncate(s->fd, st.st_size))
        sst_log_warning("%s: its incomplete last line cannot be truncated: %s", s->manifest, strerror(errno));
    return err;
}

/* While a view is captured again, the folder is not a valid light field: its hashes and offsets would be the old ones.
 */
static int reopen_capture(struct sst_scan_store *s)
{
    if (!unlinkat(s->dir_fd, "lightfield.json", 0))
        sst_log_warning("%s: data computed from its old views is out of date; process it again", s->dir);
    else if (errno != ENOENT)
        return fault("replace the lightfield.json of", s->dir);
    return 0;
}

int sst_scan_store_put(struct sst_scan_store *s, int view, const struct sst_scan_shot *shot,
                       const struct sst_scan_camera *camera, const struct sst_frame *f)
{
    const struct sst_scan_original *raw = camera->original ? camera->original(camera->arg) : NULL;
    struct stored_view v = { .there = true, .read = shot->read };
    char path[SST_PATH_MAX], *line;
    int err = view_path(s, view, path);

    s->view[view].there = false;
    if (!err && !s->put_any)
        err = reopen_capture(s);
    s->put_any = true;
    if (!err && raw)
        err = write_original(s, view, raw, &v);
    if (!err)
        err = s->fourcc == SST_SCAN_RAW ? write_developed(path, raw) : write_frame(s, path, f);
    if (err)
        return err;
    /* Hash of the file, not of the memory: detects a disk that returns other bytes. */
    if (!SHA256File(path, v.sha256))
        return fault("read back", path);
    snprintf(v.serial, sizeof(v.serial), "%s", camera->serial);
    snprintf(v.port, sizeof(v.port), "%s", camera->port);
    line = view_line(s, view, shot, camera, f, &v);
    err = line ? append(s, line) : no_memory(s);
    free(line);
    if (err)
        return err;
    s->view[view] = v;
    return 0;
}

/* --- the light field ---------------------------------------------------------------------------------------------- */

static int fill(const struct sst_scan_store *s, struct sst_lightfield *lf)
{
    const struct sst_rig_pos *ref;
    int err = sst_lightfield_init_files(lf, s->rows, s->cols);

    if (err)
        return err;
    ref = &s->view[lf->ref_view].read;
    lf->spacing_mm = s->pitch_um[0] / 1000.0;
    lf->infinity_known = true; /* at 0: one camera that moves without turning */
    snprintf(lf->files->source, sizeof(lf->files->source), "rig capture, camera %s at %s",
             s->view[lf->ref_view].serial[0] ? s->view[lf->ref_view].serial : "without serial",
             s->view[lf->ref_view].port);
    for (int k = 0; !err && k < s->rows * s->cols; k++) {
        struct sst_view *v = &lf->views[k];
        char path[SST_PATH_MAX];
        int width, height;

        v->present = true;
        v->bx = (double)(s->view[k].read.um[0] - ref->um[0]) / s->pitch_um[0];
        v->by = (double)(s->view[k].read.um[1] - ref->um[1]) / s->pitch_um[0];
        file_name(s, k, lf->files->view[k].name);
        memcpy(lf->files->view[k].sha256, s->view[k].sha256, sizeof(s->view[k].sha256));
        err = view_path(s, k, path);
        err = err ? err : sst_image_read_size(path, &width, &height);
        if (!err && k && (width != lf->width || height != lf->height)) {
            sst_log_error("%s has %dx%d pixels, the earlier views have %dx%d; remove it and run the same command to "
                          "capture it again",
                          path, width, height, lf->width, lf->height);
            err = -EBADMSG;
        }
        if (!err) {
            lf->width = width;
            lf->height = height;
        }
    }
    return err;
}

int sst_scan_store_finish(struct sst_scan_store *s)
{
    struct sst_lightfield lf = { 0 };
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, s->dir, "lightfield.json");

    if (err || (sst_path_exists(path) && !s->put_any))
        return err;
    err = fill(s, &lf);
    err = err ? err : sst_lightfield_choose_samples(&lf, s->dir, s->dir);
    err = err ? err : sst_lightfield_write(&lf, s->dir, 1);
    if (!err)
        sst_lightfield_warn_views(&lf, s->dir, s->dir);
    sst_lightfield_fini(&lf);
    if (!err)
        s->put_any = false;
    return err;
}
