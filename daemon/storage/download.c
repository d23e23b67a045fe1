/* Downloads, opened: files as they are, archives read from their files, videos made before. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/storage/download.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "daemon/storage/storage_internal.h"
#include "daemon/storage/video_internal.h"

#define WAIT_NS 200000000 /* of a call for a light field that is being made */

enum content { CONTENT_PICTURE, CONTENT_TAR, CONTENT_VIDEO };

struct download {
    struct sst_download d;
    struct sst_storage *s;
    enum content content;
    int row, col;              /* of the video's camera; row -1: the see-through view */
    char name[SST_STORE_NAME]; /* of the entry */
    enum store_kind kind;
    struct video_file *video; /* NULL: none */
    int fd;                   /* -1: none */
    int64_t at;               /* of the content in that file */
    bool jpeg;                /* the name ends so */
    struct tar tar;
};

/* --- reading ------------------------------------------------------------------------------------------------------ */

static ssize_t read_fd(struct sst_download *d, int64_t at, void *out, size_t n)
{
    const struct download *o = (struct download *)d;
    const ssize_t got = pread(o->fd, out, at + (int64_t)n > d->bytes ? (size_t)(d->bytes - at) : n, o->at + at);

    return got < 0 ? -errno : got ? got : -EBADMSG;
}

static ssize_t read_tar(struct sst_download *d, int64_t at, void *out, size_t n)
{
    struct download *o = (struct download *)d;
    const ssize_t got = tar_read(&o->tar, at, out, n);

    if (got < 0)
        sst_log_warning("cannot read %s/%s for a download: %s", o->s->folder[o->kind], o->name, strerror((int)-got));
    return got;
}

static void end(struct sst_download *d)
{
    struct download *o = (struct download *)d;
    struct sst_storage *s = o->s;
    struct store_entry *e;

    if (o->content == CONTENT_TAR)
        tar_close(&o->tar);
    if (o->fd >= 0)
        close(o->fd);
    pthread_mutex_lock(&s->lock);
    s->downloads--;
    e = o->video ? NULL : catalog_find(&s->catalog, o->name);
    if (e && e->readers > 0)
        e->readers--;
    if (o->video) {
        o->video->readers--;
        o->video->used_ns = sst_clock_now_ns();
    }
    pthread_mutex_unlock(&s->lock);
    free(o);
}

/* --- opening ------------------------------------------------------------------------------------------------------ */

/* "r0c5" */
static bool read_camera(const char *text, int *row, int *col)
{
    int end_at = 0;

    /* Numbers may begin with signs and white space, names may not hold any. */
    return !text[strspn(text, "rc0123456789")] && sscanf(text, "r%3dc%3d%n", row, col, &end_at) == 2 && end_at &&
           !text[end_at];
}

/* NAME.tar is all of it; NAME and NAME.jpg the picture of a snapshot, NAME.jpg one of a recording; NAME.mkv the
 * see-through view of a recording, NAME.r0c5.mkv a camera. */
static bool split_name(const char *name, struct download *o)
{
    char stem[2 * SST_STORE_NAME], *dot;

    if (snprintf(stem, sizeof(stem), "%s", name) >= (int)sizeof(stem))
        return false;
    dot = strrchr(stem, '.');
    o->row = -1;
    o->content = CONTENT_PICTURE;
    if (dot && !strcmp(dot, ".tar"))
        o->content = CONTENT_TAR;
    else if (dot && !strcmp(dot, ".mkv"))
        o->content = CONTENT_VIDEO;
    else if (dot && strcmp(dot, ".jpg"))
        dot = NULL;
    o->jpeg = dot && o->content == CONTENT_PICTURE;
    if (dot)
        *dot = 0;
    dot = strrchr(stem, '.');
    if (o->content == CONTENT_VIDEO && dot && read_camera(dot + 1, &o->row, &o->col))
        *dot = 0;
    if (!store_name_good(stem))
        return false;
    memcpy(o->name, stem, strlen(stem) + 1);
    return true;
}

static int check_entry(const struct store_entry *e, const struct download *o)
{
    const bool recording = e && e->kind == SST_STORE_RECORDING, active = e && e->stage == SST_STORE_ACTIVE;

    if (!e || e->deleted_by_hand || (o->content == CONTENT_PICTURE && ((recording && !o->jpeg) || !e->picture)) ||
        (o->content == CONTENT_VIDEO && (!recording || (o->row < 0 && !e->picture))))
        return -ENOENT;
    /* The list of a recording may name sets that a file of it does not hold yet. */
    if (recording && active && o->content == CONTENT_TAR)
        return -EBUSY;
    return !recording && active ? -EINPROGRESS : 0;
}

static void set_tag(struct download *o, uint64_t tag)
{
    snprintf(o->d.tag, sizeof(o->d.tag), "%016" PRIx64, tag);
}

/* Sets and pictures of a recording that has ended change only when its beginning is removed. */
static void describe_video(struct download *o, const struct store_entry *e)
{
    const int64_t what[] = { o->row, o->row < 0 ? 0 : o->col, (int64_t)e->order, (int64_t)e->sets, (int64_t)e->gone };
    uint64_t tag = 0;

    add_to_tag(&tag, what, sizeof(what));
    add_to_tag(&tag, o->name, strlen(o->name));
    add_to_tag(&tag, SST_VERSION, strlen(SST_VERSION));
    if (e->stage != SST_STORE_ACTIVE)
        set_tag(o, tag);
}

/* Only entries of the catalog can be opened. */
static int reserve(struct sst_storage *s, struct download *o)
{
    struct store_entry *e;
    int err;

    pthread_mutex_lock(&s->lock);
    e = catalog_find(&s->catalog, o->name);
    err = check_entry(e, o);
    if (err == -EINPROGRESS)
        (void)store_wait_answer_locked(s, sst_clock_now_ns() + WAIT_NS);
    if (!err && (s->downloads == SST_DOWNLOADS_MAX || s->stop))
        err = -EMFILE;
    if (!err && o->content == CONTENT_VIDEO) {
        describe_video(o, e);
        err = video_file_open_locked(s, e, o->row, o->col, &o->video);
        if (!err) {
            o->fd = fcntl(o->video->fd, F_DUPFD_CLOEXEC, 0);
            o->d.bytes = o->video->bytes;
        }
    } else if (!err) {
        o->kind = e->kind;
        e->readers++;
    }
    s->downloads += !err;
    pthread_mutex_unlock(&s->lock);
    return err;
}

static int open_picture(struct download *o, const char *dir)
{
    char path[SST_PATH_MAX];
    uint64_t tag = 0;
    struct stat st;
    const int err = sst_path_join(path, dir, "picture.jpg");

    if (err)
        return err;
    o->fd = open(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (o->fd < 0 || fstat(o->fd, &st))
        return -errno;
    add_to_tag(&tag, &st.st_mtim, sizeof(st.st_mtim));
    add_to_tag(&tag, &st.st_ino, sizeof(st.st_ino));
    add_to_tag(&tag, &st.st_size, sizeof(st.st_size));
    set_tag(o, tag);
    o->d.bytes = st.st_size;
    return S_ISREG(st.st_mode) ? 0 : -ENOENT;
}

/* A line near the middle of the index of a recording's view. @return 0, -ENODATA, or of reading */
static int middle_line(const char *path, struct video_line *out)
{
    char text[2 * SST_VIDEO_LINE_MAX + 1], *line = text, *next;
    const int fd = open(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    struct stat st;
    int64_t at;
    ssize_t n;
    int err = fd < 0 || fstat(fd, &st) ? -errno : S_ISREG(st.st_mode) ? 0 : -ENODATA;

    at = err || st.st_size < SST_VIDEO_LINE_MAX * 2 ? 0 : st.st_size / 2 - SST_VIDEO_LINE_MAX;
    n = err ? 0 : pread(fd, text, sizeof(text) - 1, at);
    err = err ? err : n < 0 ? -errno : -ENODATA;
    if (fd >= 0)
        close(fd);
    text[n > 0 ? n : 0] = 0;
    if (at && (line = strchr(text, '\n')))
        line++;
    for (; err == -ENODATA && line && (next = strchr(line, '\n')); line = next + 1) {
        char one[sizeof(text)];

        snprintf(one, sizeof(one), "%.*s", (int)(next + 1 - line), line); /* with its end: else it is torn */
        err = video_read_line(one, out) ? 0 : -ENODATA;
    }
    return err;
}

/* The see-through picture in the middle of a recording. */
static int open_view_picture(struct download *o, const char *dir)
{
    static const uint8_t begin[] = { 0xff, 0xd8 };
    char path[SST_PATH_MAX];
    struct video_line line;
    uint8_t head[2];
    struct stat st;
    uint64_t tag = 0;
    int err = sst_path_join(path, dir, SST_VIDEO_INDEX);

    err = err ? err : middle_line(path, &line);
    err = err ? err : sst_path_join(path, dir, SST_VIDEO_PICTURES);
    if (err)
        return err;
    o->fd = open(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (o->fd < 0 || fstat(o->fd, &st))
        return -errno;
    if (!S_ISREG(st.st_mode) || line.bytes < 2 || line.offset < 0 || line.bytes > st.st_size - line.offset ||
        pread(o->fd, head, 2, line.offset) != 2 || memcmp(head, begin, 2) != 0)
        return -ENODATA;
    o->at = line.offset;
    o->d.bytes = line.bytes;
    add_to_tag(&tag, &line, sizeof(line));
    add_to_tag(&tag, &st.st_ino, sizeof(st.st_ino));
    set_tag(o, tag);
    return 0;
}

static int open_files(struct download *o)
{
    char dir[SST_PATH_MAX];
    int err = sst_path_join(dir, o->s->folder[o->kind], o->name);

    if (o->content == CONTENT_PICTURE)
        return err ? err : o->kind == SST_STORE_RECORDING ? open_view_picture(o, dir) : open_picture(o, dir);
    o->tar = (struct tar){ .folder = -1, .fd = -1 };
    err = err ? err : tar_open(&o->tar, dir);
    o->d.bytes = o->tar.bytes;
    set_tag(o, o->tar.tag);
    return err;
}

int sst_storage_download(struct sst_storage *s, const char *name, struct sst_download **out)
{
    static const char *const types[] = { "image/jpeg", "application/x-tar", "video/x-matroska" };
    struct download *o = calloc(1, sizeof(*o));
    int err;

    if (!o)
        return -ENOMEM;
    o->s = s;
    o->fd = -1;
    err = split_name(name, o) ? reserve(s, o) : -ENOENT;
    if (err) {
        free(o);
        return err;
    }
    o->d.type = types[o->content];
    o->d.read = o->content == CONTENT_TAR ? read_tar : read_fd;
    o->d.close = end;
    err = o->content != CONTENT_VIDEO ? open_files(o) : o->fd < 0 ? -EMFILE : 0;
    if (err) {
        sst_log_debug("cannot read %s/%s for a download: %s", s->folder[o->kind], o->name, strerror(-err));
        end(&o->d);
        return err;
    }
    *out = &o->d;
    return 0;
}
