/* Videos that clients asked for, written one after the other into files without a name: nothing is left behind, however
 * the process ends. A file stays while it is read, and a while longer: players ask for one part after the other. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "daemon/storage/storage_internal.h"
#include "daemon/storage/video_internal.h"

#define UNUSED_NS   60000000000 /* without a request: the file is closed, or no longer written */
#define FRESH_NS    5000000000  /* an error, and a video of a recording that still grows, are good for this long */
#define WAIT_NS     200000000   /* of a call for a file that is being written */
#define FRAME_BYTES 96          /* of Matroska for each frame, more than there are */

static void clear(struct video_file *f)
{
    if (f->stage == VIDEO_MADE && f->fd >= 0)
        close(f->fd);
    *f = (struct video_file){ .stage = VIDEO_NONE };
}

void video_files_fini(struct sst_storage *s)
{
    for (int i = 0; i < SST_DOWNLOADS_MAX; i++)
        clear(&s->video[i]);
}

/* --- calls -------------------------------------------------------------------------------------------------------- */

static bool is_of(const struct video_file *f, const struct store_entry *e, int row, int col)
{
    if (f->stage == VIDEO_NONE || f->row != row || f->col != col || strcmp(f->name, e->name))
        return false;
    if (f->active || e->stage == SST_STORE_ACTIVE)
        return f->active && e->stage == SST_STORE_ACTIVE &&
               (f->stage != VIDEO_MADE || sst_clock_now_ns() - f->made_ns < FRESH_NS);
    return f->sets == e->sets && f->gone == e->gone;
}

static struct video_file *find_locked(struct sst_storage *s, const struct store_entry *e, int row, int col)
{
    for (int i = 0; i < SST_DOWNLOADS_MAX; i++) {
        if (is_of(&s->video[i], e, row, col))
            return &s->video[i];
    }
    return NULL;
}

/* The least recently used file without readers; NULL: all are in use. */
static struct video_file *find_unused_locked(struct sst_storage *s)
{
    struct video_file *oldest = NULL;

    for (int i = 0; i < SST_DOWNLOADS_MAX; i++) {
        struct video_file *f = &s->video[i];

        if (f->stage == VIDEO_MADE && !f->readers && (!oldest || f->used_ns < oldest->used_ns))
            oldest = f;
    }
    return oldest;
}

static struct video_file *begin_locked(struct sst_storage *s, struct store_entry *e, int row, int col)
{
    struct video_file *f = NULL;

    for (int i = 0; !f && i < SST_DOWNLOADS_MAX; i++)
        f = s->video[i].stage == VIDEO_NONE ? &s->video[i] : NULL;
    f = f ? f : find_unused_locked(s);
    if (!f)
        return NULL;
    clear(f);
    *f = (struct video_file){
        .stage = VIDEO_WANTED, .row = row, .col = col, .sets = e->sets, .gone = e->gone, .fd = -1
    };
    memcpy(f->name, e->name, sizeof(f->name));
    f->active = e->stage == SST_STORE_ACTIVE;
    f->asked_ns = sst_clock_now_ns();
    e->readers++;
    pthread_cond_broadcast(&s->wake);
    return f;
}

int video_file_open_locked(struct sst_storage *s, struct store_entry *entry, int row, int col, struct video_file **out)
{
    const struct store_entry e = *entry;
    struct video_file *f = find_locked(s, &e, row, col);
    int err;

    if (!f)
        f = begin_locked(s, entry, row, col);
    if (!f)
        return -EMFILE;
    f->used_ns = sst_clock_now_ns();
    if (f->stage != VIDEO_MADE) {
        if (s->trouble == SST_TROUBLE_HUNG)
            return -EIO;
        (void)store_wait_answer_locked(s, f->used_ns + WAIT_NS);
        f = find_locked(s, &e, row, col);
    }
    if (!f || f->stage != VIDEO_MADE)
        return -EINPROGRESS;
    err = f->err;
    if (err) {
        clear(f);
        return err;
    }
    f->readers++;
    *out = f;
    return 0;
}

/* --- the thread --------------------------------------------------------------------------------------------------- */

/* Files without readers are closed first. */
static int reserve_room(struct sst_storage *s, struct video_file *f, int64_t bytes)
{
    struct video_file *unused;
    struct store_room room;
    int64_t most;

    pthread_mutex_lock(&s->lock);
    room = (struct store_room){ .used_bytes = store_used_locked(s), .free_bytes = s->free_bytes };
    while (bytes > (most = store_download_bytes(&s->settings.limits, &room, video_files_bytes_locked(s))) &&
           (unused = find_unused_locked(s))) {
        room.used_bytes -= unused->bytes;
        room.free_bytes += unused->bytes;
        clear(unused);
    }
    f->bytes = bytes <= most ? bytes : 0;
    pthread_mutex_unlock(&s->lock);
    return bytes <= most ? 0 : -ENOSPC;
}

static int open_unnamed(const char *dir)
{
    char path[SST_PATH_MAX];
    int fd = sst_path_join(path, dir, ".video") ? -ENAMETOOLONG : 0;

    if (fd < 0)
        return fd;
    (void)unlink(path);
    fd = open(path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (fd < 0)
        return -errno;
    (void)unlink(path);
    return fd;
}

struct work {
    struct sst_storage *s;
    struct video_file *f;
};

static bool is_unwanted(void *arg)
{
    const struct work *w = arg;
    bool unwanted;

    pthread_mutex_lock(&w->s->lock);
    unwanted = w->s->stop || sst_clock_now_ns() - w->f->used_ns > UNUSED_NS;
    pthread_mutex_unlock(&w->s->lock);
    return unwanted;
}

/* @param fd  out, also with an error */
static int make(const struct work *w, int *fd)
{
    const struct video_file *f = w->f;
    struct video v = { .frame = NULL };
    char dir[SST_PATH_MAX];
    int err = sst_path_join(dir, w->s->folder[SST_STORE_RECORDING], f->name);

    if (!err)
        err = f->row < 0 ? video_of_view(&v, dir) : video_of_camera(&v, dir, f->row, f->col);
    err = err ? err : reserve_room(w->s, w->f, v.bytes + (int64_t)v.count * FRAME_BYTES + (1 << 16));
    if (!err)
        *fd = open_unnamed(w->s->dir);
    if (!err)
        err = *fd < 0 ? *fd : video_write(&v, *fd, is_unwanted, (void *)w);
    video_fini(&v);
    return err;
}

static void end(struct sst_storage *s, struct video_file *f, int fd, int err)
{
    struct store_entry *e;
    struct stat st;

    if (!err && fstat(fd, &st))
        err = -errno;
    if (err && fd >= 0)
        close(fd);
    pthread_mutex_lock(&s->lock);
    e = catalog_find(&s->catalog, f->name);
    if (e && e->readers > 0)
        e->readers--;
    f->stage = VIDEO_MADE;
    f->err = err;
    f->fd = err ? -1 : fd;
    f->bytes = err ? 0 : st.st_size;
    f->made_ns = sst_clock_now_ns();
    if (err == -ECANCELED)
        clear(f);
    pthread_cond_broadcast(&s->answered);
    pthread_mutex_unlock(&s->lock);
}

static struct video_file *next_locked(struct sst_storage *s)
{
    const int64_t now_ns = sst_clock_now_ns();
    struct video_file *next = NULL;

    for (int i = 0; i < SST_DOWNLOADS_MAX; i++) {
        struct video_file *f = &s->video[i];

        if (f->stage == VIDEO_MADE && !f->readers && now_ns - f->used_ns > (f->err ? FRESH_NS : UNUSED_NS))
            clear(f);
        else if (f->stage == VIDEO_WANTED && (!next || f->asked_ns < next->asked_ns))
            next = f;
    }
    return next;
}

void *store_video_run(void *storage)
{
    struct sst_storage *s = storage;
    char said[SST_LOG_MAX];

    sst_log_hold_errors(said);
    pthread_mutex_lock(&s->lock);
    while (!s->stop) {
        struct work w = { .s = s, .f = next_locked(s) };
        int err, fd = -1;

        if (!w.f) {
            store_wait_locked(s, 1000);
            continue;
        }
        w.f->stage = VIDEO_AT_WORK;
        pthread_mutex_unlock(&s->lock);
        said[0] = 0;
        err = is_unwanted(&w) ? -ECANCELED : make(&w, &fd);
        if (err && err != -ECANCELED && err != -ENODATA && err != -ENOENT && err != -EAGAIN)
            sst_log_warning("cannot make a video of %s/%s for a download: %s", s->folder[SST_STORE_RECORDING],
                            w.f->name, said[0] ? said : strerror(-err));
        end(s, w.f, fd, err);
        pthread_mutex_lock(&s->lock);
    }
    pthread_mutex_unlock(&s->lock);
    sst_log_hold_errors(NULL);
    store_thread_ends(s);
    return NULL;
}
