/* What is kept on its way out: planned, then sent by a thread of its own that ends when nobody reads. */
#define _GNU_SOURCE
#include "daemon/slot/download.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "capture/recording/shorten.h"
#include "daemon/storage/storage_internal.h"

#define PATIENCE_NS 60000000000 /* with a reader that takes nothing, and with what is still being made */
#define UNUSED_NS   60000000000 /* a plan that nobody asked for goes */
#define SLICE_MS    100

enum content { CONTENT_PICTURE, CONTENT_TAR, CONTENT_CAMERA, CONTENT_VIEW };

struct download {
    struct sst_storage *s;
    enum store_kind kind;
    enum content content;
    char name[SST_STORE_NAME]; /* of the entry */
    int row, col;
    bool active; /* it still grows */
    int fd;      /* our end, not blocking */
};

/* A plan, and what it was made of: seeking in a video asks for the same one again and again. */
struct store_plan {
    struct spans spans;
    char name[SST_STORE_NAME];
    enum content content;
    int row, col;
    struct timespec mtime;
    int64_t size; /* of the list of sets, or pictures */
    int before;   /* segments that were removed of it */
    int refs;     /* under the storage's lock */
    int64_t used_ns;
};

/* --- bytes between both ends -------------------------------------------------------------------------------------- */

static bool stopping(struct sst_storage *s)
{
    bool stop;

    pthread_mutex_lock(&s->lock);
    stop = s->stop;
    pthread_mutex_unlock(&s->lock);
    return stop;
}

/* All n bytes in or out, in the time that `patience` allows for each piece. */
static int transfer(const struct download *d, void *data, size_t n, bool out)
{
    int64_t until_ns = sst_clock_now_ns() + PATIENCE_NS;
    size_t done = 0;

    while (done < n) {
        struct pollfd p = { .fd = d->fd, .events = out ? POLLOUT : POLLIN };
        char *at = (char *)data + done;
        const ssize_t got = out ? send(d->fd, at, n - done, MSG_NOSIGNAL) : recv(d->fd, at, n - done, 0);

        if (got > 0) {
            done += (size_t)got;
            until_ns = sst_clock_now_ns() + PATIENCE_NS;
            continue;
        }
        if (!got || (errno != EAGAIN && errno != EINTR))
            return got ? -errno : -EPIPE;
        if (stopping(d->s) || sst_clock_now_ns() > until_ns)
            return -ECANCELED;
        (void)poll(&p, 1, SLICE_MS);
    }
    return 0;
}

static int send_bytes(void *arg, const void *data, size_t n)
{
    return transfer(arg, (void *)data, n, true);
}

/* --- plans -------------------------------------------------------------------------------------------------------- */

static void unref_locked(struct store_plan *p)
{
    if (!p || --p->refs)
        return;
    spans_fini(&p->spans);
    free(p);
}

void store_plans_expire(struct sst_storage *s, int64_t now_ns)
{
    pthread_mutex_lock(&s->lock);
    for (int i = 0; i < SST_STORE_PLANS; i++) {
        if (!s->plan[i] || s->plan[i]->refs > 1 || now_ns - s->plan[i]->used_ns < UNUSED_NS)
            continue;
        unref_locked(s->plan[i]);
        s->plan[i] = NULL;
    }
    pthread_mutex_unlock(&s->lock);
}

static bool same_plan(const struct store_plan *a, const struct store_plan *b)
{
    return a && a->content == b->content && a->row == b->row && a->col == b->col && !strcmp(a->name, b->name) &&
           a->size == b->size && a->before == b->before && a->mtime.tv_sec == b->mtime.tv_sec &&
           a->mtime.tv_nsec == b->mtime.tv_nsec;
}

/* One that was made before for the same, referenced. */
static struct store_plan *known_plan(struct sst_storage *s, const struct store_plan *like)
{
    struct store_plan *found = NULL;

    pthread_mutex_lock(&s->lock);
    for (int i = 0; i < SST_STORE_PLANS && !found; i++) {
        if (same_plan(s->plan[i], like))
            found = s->plan[i];
    }
    if (found) {
        found->refs++;
        found->used_ns = sst_clock_now_ns();
    }
    pthread_mutex_unlock(&s->lock);
    return found;
}

/* In the place of the one that was not used for longest. */
static void keep_plan(struct sst_storage *s, struct store_plan *p)
{
    int at = 0;

    pthread_mutex_lock(&s->lock);
    for (int i = 0; i < SST_STORE_PLANS; i++) {
        if (!s->plan[i] || (s->plan[at] && s->plan[i]->used_ns < s->plan[at]->used_ns))
            at = i;
    }
    unref_locked(s->plan[at]);
    s->plan[at] = p;
    p->refs++;
    p->used_ns = sst_clock_now_ns();
    pthread_mutex_unlock(&s->lock);
}

static int plan_picture(struct spans *to, int folder)
{
    const int fd = spans_open(folder, "picture.jpg");
    struct stat st;
    int err = fd < 0 ? fd : fstat(fd, &st) ? -errno : S_ISREG(st.st_mode) ? 0 : -ENOENT;

    if (!err) {
        spans_mark(to, &st.st_mtim, sizeof(st.st_mtim));
        spans_piece(to, spans_file(to, "picture.jpg"), 0, st.st_size);
        err = spans_error(to);
    }
    if (fd >= 0)
        close(fd);
    return err;
}

static int make_plan(const struct download *d, const char *dir, int folder, struct spans *to)
{
    switch (d->content) {
    case CONTENT_TAR:
        return tar_plan(to, folder, d->name);
    case CONTENT_CAMERA:
        return video_plan_camera(to, dir, d->row, d->col);
    case CONTENT_VIEW:
        return video_plan_view(to, dir);
    default:
        return plan_picture(to, folder);
    }
}

/* The plan, referenced. Those of videos, which take a while to make, are kept while they are used. */
static int get_plan(const struct download *d, const char *dir, int folder, struct store_plan **out)
{
    const bool video = d->content == CONTENT_CAMERA || d->content == CONTENT_VIEW;
    struct store_plan *p = calloc(1, sizeof(*p)), *known = NULL;
    struct sst_recording_removed removed = { 0 };
    struct stat st = { 0 };
    int err = !p ? -ENOMEM : video ? sst_recording_read_removed(dir, &removed) : 0;

    if (err) {
        free(p);
        return err;
    }
    p->before = removed.before_segment;
    p->content = d->content;
    p->row = d->row;
    p->col = d->col;
    memcpy(p->name, d->name, sizeof(p->name));
    p->refs = 1;
    if (video &&
        !fstatat(folder, d->content == CONTENT_VIEW ? SST_VIDEO_INDEX : "sets.jsonl", &st, AT_SYMLINK_NOFOLLOW)) {
        p->mtime = st.st_mtim;
        p->size = st.st_size;
        known = d->active ? NULL : known_plan(d->s, p);
    }
    if (!known)
        err = make_plan(d, dir, folder, &p->spans);
    if (known || err) {
        spans_fini(&p->spans);
        free(p);
        p = known;
    } else if (video && !d->active) {
        keep_plan(d->s, p);
    }
    if (!err)
        *out = p;
    return err;
}

/* --- the thread --------------------------------------------------------------------------------------------------- */

/* Who asks for what is still being made gets it then. */
static void wait_until_made(struct download *d)
{
    struct sst_storage *s = d->s;
    const int64_t until_ns = sst_clock_now_ns() + PATIENCE_NS;
    const struct store_entry *e;

    pthread_mutex_lock(&s->lock);
    while (!s->stop && sst_clock_now_ns() < until_ns && (e = catalog_find(&s->catalog, d->name)) &&
           e->stage == SST_STORE_ACTIVE && e->kind != SST_STORE_RECORDING)
        (void)store_wait_answer_locked(s, sst_clock_now_ns() + SLICE_MS * INT64_C(1000000));
    pthread_mutex_unlock(&s->lock);
}

static int send_part(struct download *d, const struct store_plan *p, int folder)
{
    struct sst_download_info info = { .bytes = p->spans.bytes };
    struct sst_download_part part;
    int err;

    if (!d->active)
        snprintf(info.tag, sizeof(info.tag), "%016" PRIx64, p->spans.tag);
    err = transfer(d, &info, sizeof(info), true);
    if (!err)
        err = transfer(d, &part, sizeof(part), false);
    if (err)
        return -EPIPE; /* it was enough to know how large it is */
    if (part.first < 0 || part.bytes < 0 || part.first > info.bytes || part.bytes > info.bytes - part.first)
        return -EINVAL;
    return spans_send(&p->spans, folder, part.first, part.bytes, send_bytes, d);
}

static int serve(struct download *d)
{
    const char *top = d->s->folder[d->kind];
    const int above = open(top, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    const int folder = above < 0 ? -1 : openat(above, d->name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    struct sst_download_info none = { .err = folder < 0 ? -errno : 0 };
    struct store_plan *p = NULL;
    char dir[SST_PATH_MAX];
    int err = none.err ? none.err : sst_path_join(dir, top, d->name);

    if (!err)
        err = get_plan(d, dir, folder, &p);
    if (err) {
        none.err = err;
        (void)transfer(d, &none, sizeof(none), true);
    } else {
        err = send_part(d, p, folder);
        pthread_mutex_lock(&d->s->lock);
        unref_locked(p);
        pthread_mutex_unlock(&d->s->lock);
    }
    if (folder >= 0)
        close(folder);
    if (above >= 0)
        close(above);
    return err;
}

/* Its place is free again. */
static void end(struct download *d)
{
    struct sst_storage *s = d->s;
    struct store_entry *e;

    pthread_mutex_lock(&s->lock);
    s->downloads--;
    e = catalog_find(&s->catalog, d->name);
    if (e && e->readers > 0)
        e->readers--;
    pthread_mutex_unlock(&s->lock);
    free(d);
    store_thread_ends(s);
}

static void *run(void *arg)
{
    struct download *d = arg;
    struct sst_storage *s = d->s;
    char said[SST_LOG_MAX] = "";
    int err;

    pthread_setname_np(pthread_self(), "sst-tar");
    sst_log_hold_errors(said);
    wait_until_made(d);
    err = serve(d);
    sst_log_hold_errors(NULL);
    if (err && err != -EPIPE && err != -ECONNRESET && err != -ECANCELED && err != -ENODATA && err != -ENOENT)
        sst_log_warning("%s/%s cannot be read for a download: %s", s->folder[d->kind], d->name,
                        said[0] ? said : strerror(-err));
    close(d->fd);
    end(d);
    return NULL;
}

static int start(struct download *d)
{
    pthread_attr_t attr;
    pthread_t thread;
    sigset_t all, before;
    int err;

    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    pthread_attr_init(&attr);
    pthread_attr_setdetachstate(&attr, PTHREAD_CREATE_DETACHED);
    err = -pthread_create(&thread, &attr, run, d);
    pthread_attr_destroy(&attr);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return err;
}

/* --- the call ----------------------------------------------------------------------------------------------------- */

/* "r0c5" */
static bool read_camera(const char *text, int *row, int *col)
{
    int end = 0;

    /* Numbers may begin with signs and white space, names may not hold any. */
    return !text[strspn(text, "rc0123456789")] && sscanf(text, "r%3dc%3d%n", row, col, &end) == 2 && end && !text[end];
}

/* NAME.tar is all of it; NAME and NAME.jpg the picture of a snapshot; NAME.mkv the see-through view of a recording,
 * NAME.r0c5.mkv a camera. */
static bool split_name(const char *name, struct download *d)
{
    char stem[2 * SST_STORE_NAME], *dot;

    if (snprintf(stem, sizeof(stem), "%s", name) >= (int)sizeof(stem))
        return false;
    dot = strrchr(stem, '.');
    d->content = CONTENT_PICTURE;
    if (dot && !strcmp(dot, ".tar"))
        d->content = CONTENT_TAR;
    else if (dot && !strcmp(dot, ".mkv"))
        d->content = CONTENT_VIEW;
    else if (dot && strcmp(dot, ".jpg"))
        dot = NULL;
    if (dot)
        *dot = 0;
    dot = strrchr(stem, '.');
    if (d->content == CONTENT_VIEW && dot && read_camera(dot + 1, &d->row, &d->col)) {
        d->content = CONTENT_CAMERA;
        *dot = 0;
    }
    if (!store_name_good(stem))
        return false;
    memcpy(d->name, stem, strlen(stem) + 1);
    return true;
}

static int is_there_locked(const struct store_entry *e, const struct download *d)
{
    const bool recording = e && e->kind == SST_STORE_RECORDING;
    const bool video = d->content == CONTENT_CAMERA || d->content == CONTENT_VIEW;

    if (!e || e->doomed || (d->content == CONTENT_PICTURE && (recording || !e->picture)) || (video && !recording) ||
        (d->content == CONTENT_VIEW && !e->picture))
        return -ENOENT;
    /* Its list may name sets that a file of it does not hold yet. */
    return recording && d->content == CONTENT_TAR && e->stage == SST_STORE_ACTIVE ? -EBUSY : 0;
}

/* Only what the catalog knows is there; a place for the thread is taken. */
static int reserve(struct sst_storage *s, struct download *d)
{
    struct store_entry *e;
    int err;

    pthread_mutex_lock(&s->lock);
    e = catalog_find(&s->catalog, d->name);
    err = is_there_locked(e, d);
    if (!err && (s->downloads == SST_DOWNLOADS_MAX || s->stop))
        err = -EMFILE;
    if (!err) {
        d->kind = e->kind;
        d->active = e->kind == SST_STORE_RECORDING && e->stage == SST_STORE_ACTIVE;
        e->readers++;
        s->downloads++;
        s->threads++;
    }
    pthread_mutex_unlock(&s->lock);
    return err;
}

int sst_storage_download(struct sst_storage *s, const char *name, int *fd, const char **type)
{
    static const char *const types[] = { "image/jpeg", "application/x-tar", "video/x-matroska", "video/x-matroska" };
    struct download *d = calloc(1, sizeof(*d));
    int ends[2] = { -1, -1 }, err;
    enum content content;

    if (!d)
        return -ENOMEM;
    d->s = s;
    err = split_name(name, d) ? reserve(s, d) : -ENOENT;
    if (err) {
        free(d);
        return err;
    }
    content = d->content;
    err = socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) ? -errno : 0;
    if (!err) {
        d->fd = ends[1];
        err = fcntl(d->fd, F_SETFL, O_NONBLOCK) ? -errno : start(d);
    }
    if (err) {
        for (int i = 0; i < 2; i++) {
            if (ends[i] >= 0)
                close(ends[i]);
        }
        end(d);
        return err;
    }
    *fd = ends[0];
    *type = types[content];
    return 0;
}
