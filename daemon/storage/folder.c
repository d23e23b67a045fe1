/* Files of the storage folder: storage.json, scanning, clean-up and repair after a killed daemon. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <jansson.h>

#include "base/log.h"
#include "capture/recording/recording.h"
#include "daemon/storage/storage_internal.h"
#include "daemon/storage/video_internal.h"

#define ABOUT       "storage.json"
#define ABOUT_MAX   ((size_t)16 << 10)
#define BLOCK_BYTES 4096

/* --- storage.json ------------------------------------------------------------------------------------------------- */

int store_write(const char *dir, const struct store_entry *e)
{
    char path[SST_PATH_MAX], *text = NULL;
    int err = sst_path_join(path, dir, ABOUT);
    json_t *o;

    if (err)
        return err;
    o = json_pack("{s:s, s:i, s:I, s:s, s:b, s:I, s:I, s:I, s:I, s:I, s:I}", "format", "sst-storage", "version", 1,
                  "order", (json_int_t)e->order, "why", e->why, "finished", e->stage == SST_STORE_DONE, "from_ns",
                  (json_int_t)e->from_ns, "to_ns", (json_int_t)e->to_ns, "made_ns", (json_int_t)e->made_ns, "sets",
                  (json_int_t)e->sets, "gone", (json_int_t)e->gone, "bytes", (json_int_t)e->bytes);
    if (o)
        text = json_dumps(o, JSON_INDENT(1));
    err = text ? sst_file_write(path, text, strlen(text)) : -ENOMEM;
    free(text);
    json_decref(o);
    return err;
}

/* Without base/file.h, which logs errors: other people's folders are not errors. */
static int read_small(const char *path, char *text, size_t *size)
{
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    ssize_t n;
    int err = 0;

    if (fd < 0)
        return errno == ENOENT || errno == ENOTDIR || errno == ELOOP ? -ENOENT : -EIO;
    n = read(fd, text, ABOUT_MAX);
    if (n < 0)
        err = errno == EISDIR ? -ENOENT : -EIO;
    close(fd);
    *size = err ? 0 : (size_t)n;
    return err;
}

int store_read(const char *dir, struct store_entry *e)
{
    json_int_t order, from, to, made = 0, sets, gone = -1, bytes;
    char path[SST_PATH_MAX], text[ABOUT_MAX];
    const char *format, *why;
    int version, finished, err = sst_path_join(path, dir, ABOUT);
    size_t n;
    json_t *o;

    err = err ? err : read_small(path, text, &n);
    if (err)
        return err;
    o = json_loadb(text, n, 0, NULL);
    err = -EBADMSG;
    if (o &&
        !json_unpack(o, "{s:s, s:i, s:I, s:s, s:b, s:I, s:I, s?I, s:I, s?I, s:I}", "format", &format, "version",
                     &version, "order", &order, "why", &why, "finished", &finished, "from_ns", &from, "to_ns", &to,
                     "made_ns", &made, "sets", &sets, "gone", &gone, "bytes", &bytes) &&
        !strcmp(format, "sst-storage") && version == 1 && order > 0 && sets >= 0 && gone >= -1 && bytes >= 0) {
        e->order = (uint64_t)order;
        snprintf(e->why, sizeof(e->why), "%s", why);
        e->stage = finished ? SST_STORE_DONE : SST_STORE_TORN;
        e->from_ns = from;
        e->to_ns = to;
        e->made_ns = made;
        e->sets = (uint64_t)sets;
        e->gone = (uint64_t)gone;
        e->bytes = bytes;
        err = 0;
    }
    json_decref(o);
    return err;
}

/* --- scanning ------------------------------------------------------------------------------------------------ */

static __thread int64_t sum; /* nftw() has no argument for its function */

static int add_size(const char *path SST_UNUSED, const struct stat *st, int type, struct FTW *ftw SST_UNUSED)
{
    if (type == FTW_F || type == FTW_D)
        sum += (st->st_size + BLOCK_BYTES - 1) / BLOCK_BYTES * BLOCK_BYTES;
    return 0;
}

int64_t store_bytes(const char *dir)
{
    sum = 0;
    (void)nftw(dir, add_size, 16, FTW_PHYS | FTW_MOUNT);
    return sum;
}

/* Is it a name made here, perhaps with a suffix? Other folders are never touched. */
static bool is_ours(enum store_kind kind, const char *name)
{
    static const char form[] = "0000-00-00T00-00-00Z";
    const char *prefix = store_prefix(kind);

    if (!store_name_good(name) || strncmp(name, prefix, strlen(prefix)))
        return false;
    name += strlen(prefix);
    for (size_t i = 0; form[i]; i++) {
        if (form[i] == '0' ? name[i] < '0' || name[i] > '9' : name[i] != form[i])
            return false;
    }
    return true;
}

static bool has(const char *dir, const char *name)
{
    char path[SST_PATH_MAX];

    return !sst_path_join(path, dir, name) && !access(path, F_OK);
}

/* Correct facts that storage.json cannot know: after a kill it dates from the recording's beginning, or from before its
 * oldest segments were removed. */
static void refine_entry(const char *path, struct store_entry *e)
{
    struct sst_recording_removed removed;
    const bool known = !sst_recording_read_removed(path, &removed), shortened = known && removed.before_segment;

    if (known && removed.assumed && sst_recording_write_removed(path, &removed))
        sst_log_debug("%s: removed.json cannot be rewritten", path);
    if (shortened) {
        const uint64_t gone = removed.sets > e->gone ? removed.sets - e->gone : 0;

        e->sets -= gone < e->sets ? gone : e->sets;
        e->from_ns = removed.wall_ns;
    }
    if (known)
        e->gone = removed.sets;
    if (shortened || e->stage == SST_STORE_TORN)
        e->bytes = store_bytes(path);
}

/* Remove temporary files of a killed daemon, and the folder if it is empty then. */
static void clean_recording(const char *path)
{
    static const char *const notes[] = { ABOUT ".tmp-", "removed.json.tmp-" };
    DIR *d = opendir(path);
    const struct dirent *f;

    while (d && (f = readdir(d))) {
        for (size_t i = 0; i < ARRAY_LEN(notes); i++) {
            if (!strncmp(f->d_name, notes[i], strlen(notes[i])))
                (void)unlinkat(dirfd(d), f->d_name, 0);
        }
    }
    if (d)
        closedir(d);
    (void)rmdir(path); /* fails if it is not empty */
}

/* Read the entry of a folder. @return 0, -ENOENT: not ours */
static int read_entry(const char *folder, const char *name, enum store_kind kind, bool tidy, struct store_entry *e)
{
    char path[SST_PATH_MAX];
    struct stat st;
    int err = sst_path_join(path, folder, name);

    if (err || lstat(path, &st) || !S_ISDIR(st.st_mode))
        return -ENOENT;
    if (is_ours(kind, name) && strstr(name, ".tmp-")) {
        if (tidy)
            sst_path_remove_tree(path);
        return -ENOENT;
    }
    if (!store_name_good(name))
        return -ENOENT;
    *e = (struct store_entry){ .kind = kind };
    snprintf(e->name, sizeof(e->name), "%s", name);
    if (kind == SST_STORE_RECORDING) {
        if (tidy && is_ours(kind, name))
            clean_recording(path);
        err = store_read(path, e);
        if (err == -EBADMSG && is_ours(kind, name)) {
            sst_log_warning(
                "%s/%s is damaged; it is rebuilt from the recording, whose reason is lost and which is removed "
                "first when room is needed",
                path, ABOUT);
            e->order = 1; /* before all others */
            e->stage = SST_STORE_TORN;
            e->from_ns = e->to_ns = e->made_ns = (int64_t)st.st_mtim.tv_sec * 1000000000 + st.st_mtim.tv_nsec;
            err = 0;
        }
        e->picture = has(path, SST_VIDEO_PICTURES);
        e->view_ns = e->picture ? video_view_from(path) : 0;
        if (!err)
            refine_entry(path, e);
        return err;
    }
    if (!has(path, "lightfield.json"))
        return -ENOENT;
    if (store_read(path, e)) {
        e->from_ns = e->to_ns = e->made_ns = (int64_t)st.st_mtim.tv_sec * 1000000000 + st.st_mtim.tv_nsec;
        e->sets = 1;
    }
    e->stage = SST_STORE_DONE; /* they are renamed into place when complete */
    e->picture = has(path, "picture.jpg");
    e->bytes = store_bytes(path);
    return 0;
}

int store_scan(const char *folder, enum store_kind kind, bool tidy, struct catalog *c)
{
    DIR *d = opendir(folder);
    const struct dirent *f;
    int err = 0;

    if (!d)
        return -errno;
    while (!err && (errno = 0, f = readdir(d))) {
        struct store_entry e;

        if (f->d_name[0] != '.' && !read_entry(folder, f->d_name, kind, tidy, &e))
            err = catalog_add(c, &e);
    }
    if (!err && errno)
        err = -errno;
    closedir(d);
    return err;
}

/* --- repair ------------------------------------------------------------------------------------------------------ */

/* First and last set that can be read. */
static void read_range(const struct sst_recording *r, struct store_entry *e)
{
    struct sst_recording_set *set = malloc(sizeof(*set));
    const int n = sst_recording_sets(r);
    int i = 0;

    e->sets = (uint64_t)n;
    e->gone = sst_recording_removed(r)->sets;
    while (set && i < n && sst_recording_set(r, i, set))
        i++;
    if (set && i < n)
        e->from_ns = set->wall_ns;
    i = n - 1;
    while (set && i >= 0 && sst_recording_set(r, i, set))
        i--;
    if (set && i >= 0)
        e->to_ns = set->wall_ns;
    free(set);
}

/* Resuming a recording removes half-written parts. */
static int remove_torn(const char *dir, const struct sst_recording_info *info)
{
    struct sst_recorder_config cfg;
    struct sst_recorder *recorder;
    int err;

    sst_recorder_config_defaults(&cfg);
    cfg.dir = dir;
    cfg.append = true;
    cfg.rows = info->rows;
    cfg.cols = info->cols;
    cfg.cameras = info->cameras;
    cfg.tracks = info->track;
    cfg.fourcc = info->fourcc;
    cfg.width = info->width;
    cfg.height = info->height;
    cfg.rate_hz = info->rate_hz;
    cfg.spacing_mm = info->spacing_mm;
    err = sst_recorder_open(&recorder, &cfg);
    return err ? err : sst_recorder_close(recorder);
}

int store_repair(const char *dir, struct store_entry *e)
{
    struct store_entry made = *e;
    struct sst_recording *r;
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, dir, "recording.json");

    if (err)
        return err;
    if (access(path, F_OK))
        return errno == ENOENT ? -ENODATA : -EIO;
    err = sst_path_join(path, dir, "sets.jsonl");
    if (!err && access(path, F_OK) && errno == ENOENT) { /* it is created after recording.json and before any segment */
        if (!sst_recording_segments(dir))
            return -ENODATA;
        sst_log_error("%s is missing: nothing else says what the segments hold", path);
        err = -EBADMSG;
    }
    err = err ? err : sst_recording_open(&r, dir);
    if (err)
        return err;
    err = remove_torn(dir, sst_recording_info(r));
    sst_recording_close(r);
    err = err ? err : sst_recording_open(&r, dir);
    if (err)
        return err;
    read_range(r, &made);
    sst_recording_close(r);
    if (!made.sets)
        return -ENODATA;
    made.stage = SST_STORE_DONE;
    made.bytes = store_bytes(dir);
    err = store_write(dir, &made);
    if (!err)
        *e = made;
    return err;
}
