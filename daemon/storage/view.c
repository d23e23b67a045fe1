/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/storage/storage_internal.h"
#include "daemon/storage/video_internal.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"

#define LATE_NS  5000000000 /* pictures may arrive this much later than their sets */
#define FRESH_NS 2000000000
#define WAIT_MS  100

/* --- the last moments --------------------------------------------------------------------------------------------- */

static const struct sst_jpeg **at(struct view_history *s, int i)
{
    return &s->jpeg[(s->first + i) % VIEW_HISTORY_MAX];
}

static void drop_first(struct view_history *s)
{
    const struct sst_jpeg *gone = *at(s, 0);

    s->bytes -= gone->bytes;
    s->first = (s->first + 1) % VIEW_HISTORY_MAX;
    s->count--;
    sst_slot_jpeg_unref(gone);
}

void view_history_add(struct view_history *s, const struct sst_jpeg *jpeg, int64_t keep_ns)
{
    while (s->count && (s->count == VIEW_HISTORY_MAX || s->bytes + jpeg->bytes > VIEW_HISTORY_BYTES ||
                        (s->count > 1 && (*at(s, 1))->t_ns <= keep_ns)))
        drop_first(s);
    *at(s, s->count++) = jpeg;
    s->bytes += jpeg->bytes;
}

const struct sst_jpeg *view_history_next(struct view_history *s, uint64_t after)
{
    for (int i = 0; i < s->count; i++) {
        if ((*at(s, i))->number > after)
            return sst_slot_jpeg_ref(*at(s, i));
    }
    return NULL;
}

const struct sst_jpeg *view_history_at(struct view_history *s, int64_t t_ns)
{
    for (int i = s->count - 1; i >= 0; i--) {
        if ((*at(s, i))->t_ns <= t_ns)
            return sst_slot_jpeg_ref(*at(s, i));
    }
    return NULL;
}

void view_history_fini(struct view_history *s)
{
    while (s->count)
        drop_first(s);
}

/* Rendering is on demand: while something is recorded, storage counts as a viewer. */
static bool is_needed_locked(const struct sst_storage *s)
{
    return s->settings.view && !s->stop && !s->blocked && s->active_name[0];
}

/* A recording may begin at any moment: shown pictures are kept, less often than for viewers. */
static bool is_armed_locked(const struct sst_storage *s)
{
    return s->settings.view && !s->stop && !s->blocked && s->settings.mode != SST_RECORD_OFF;
}

/* The thread's state as a viewer. */
struct viewer {
    bool joined, alone; /* alone: there is no viewer, nothing is rendered */
    uint64_t number;    /* of the last picture */
    int64_t until_ns;   /* a newer one is waited for until then; 0: not */
};

/* Without a viewer before, the last picture may be old: it is used only if no newer one follows soon. */
static void update_viewer_locked(struct sst_storage *s, struct viewer *l)
{
    const bool needed = is_needed_locked(s);
    const bool alone = !needed && !is_armed_locked(s) && sst_slot_clients(s->slot) <= (int)l->joined;
    const struct sst_jpeg *old = l->alone && !alone ? sst_slot_get(s->slot, 0) : NULL;

    if (needed != l->joined)
        (needed ? sst_slot_join : sst_slot_leave)(s->slot);
    l->joined = needed;
    if (alone)
        view_history_fini(&s->history);
    if (old) {
        l->number = old->number;
        l->until_ns = sst_clock_now_ns() + FRESH_NS;
        sst_slot_jpeg_unref(old);
    }
    l->alone = alone;
}

static const struct sst_jpeg *next_shown(struct sst_slot *slot, struct viewer *l)
{
    const struct sst_jpeg *jpeg = sst_slot_wait(slot, l->number, WAIT_MS) ? sst_slot_get(slot, l->number) : NULL;

    if (!jpeg && l->until_ns && sst_clock_now_ns() > l->until_ns) {
        l->until_ns = 0;
        jpeg = sst_slot_get(slot, 0); /* nothing has changed since */
    }
    if (jpeg) {
        l->number = jpeg->number;
        l->until_ns = 0;
    }
    return jpeg;
}

void *store_view_run(void *storage)
{
    struct sst_storage *s = storage;
    struct viewer l = { .alone = true };

    pthread_mutex_lock(&s->lock);
    while (!s->stop) {
        struct sst_slot *slot = s->slot;
        const struct sst_jpeg *jpeg;

        if (!slot || !s->settings.view || sst_slot_is_shut(slot)) {
            if (l.joined)
                sst_slot_leave(slot);
            l = (struct viewer){ .alone = true };
            view_history_fini(&s->history);
            store_wait_locked(s, WAIT_MS);
            continue;
        }
        update_viewer_locked(s, &l);
        if (l.alone) {
            store_wait_locked(s, WAIT_MS);
            continue;
        }
        pthread_mutex_unlock(&s->lock);
        jpeg = next_shown(slot, &l);
        pthread_mutex_lock(&s->lock);
        if (jpeg && jpeg->t_ns < s->views_from_ns)
            sst_slot_jpeg_unref(jpeg);
        else if (jpeg)
            view_history_add(&s->history, jpeg, sst_clock_now_ns() - s->settings.preroll_ns - LATE_NS);
    }
    if (l.joined)
        sst_slot_leave(s->slot);
    pthread_mutex_unlock(&s->lock);
    store_thread_ends(s);
    return NULL;
}

void sst_storage_forget_views(struct sst_storage *s)
{
    pthread_mutex_lock(&s->lock);
    view_history_fini(&s->history);
    s->views_from_ns = sst_clock_now_ns();
    pthread_mutex_unlock(&s->lock);
}

void sst_storage_aside(struct sst_storage *s, enum sst_storage_aside of, int64_t bytes)
{
    pthread_mutex_lock(&s->lock);
    s->aside_bytes[of] = bytes;
    pthread_mutex_unlock(&s->lock);
}

void sst_storage_view(struct sst_storage *s, struct sst_slot *slot)
{
    pthread_mutex_lock(&s->lock);
    if (!s->slot)
        s->slot = sst_slot_ref(slot);
    pthread_cond_broadcast(&s->wake);
    pthread_mutex_unlock(&s->lock);
}

/* --- the files ---------------------------------------------------------------------------------------------------- */

int view_begin(struct view_files *f, const char *dir)
{
    const int flags = O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC;
    struct view_files made = { 0 };
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, dir, SST_VIDEO_PICTURES);

    made.fd = err ? -1 : open(path, flags, 0666);
    if (!err && made.fd < 0)
        err = -errno;
    err = err ? err : sst_path_join(path, dir, SST_VIDEO_INDEX);
    if (!err && !(made.index = fopen(path, "wxe")))
        err = -errno;
    if (err) {
        sst_log_error("cannot create %s: %s", path, strerror(-err));
        if (made.fd >= 0)
            close(made.fd);
        return err;
    }
    *f = made;
    return 0;
}

/* A line is written after all bytes of its picture. */
static int write_line(struct view_files *f, const struct video_line *line)
{
    char text[SST_VIDEO_LINE_MAX];
    const size_t n = video_write_line(text, line);

    if (fwrite(text, 1, n, f->index) != n || fflush(f->index))
        return errno ? -errno : -EIO;
    f->last_t_ns = line->t_ns;
    f->last_at = line->offset;
    f->last_bytes = line->bytes;
    f->last_set = line->set;
    return 0;
}

int view_write(struct view_files *f, const struct sst_jpeg *jpeg, int64_t t_ns, int64_t wall_ns)
{
    const struct video_line line = { t_ns, wall_ns, jpeg->set, f->at, (int64_t)jpeg->bytes };
    const int err = sst_file_write_at(f->fd, jpeg->data, jpeg->bytes, f->at);

    if (err)
        return err;
    f->at += (int64_t)jpeg->bytes;
    return write_line(f, &line);
}

int view_end(struct view_files *f, int64_t end_ns, int64_t end_wall_ns)
{
    const struct video_line last = { end_ns, end_wall_ns, f->last_set, f->last_at, f->last_bytes };
    int err = 0;

    if (!f->index)
        return 0;
    if (f->last_bytes && end_ns > f->last_t_ns)
        err = write_line(f, &last);
    if (fclose(f->index) && !err)
        err = -errno;
    if (fdatasync(f->fd) && !err)
        err = -errno;
    close(f->fd);
    *f = (struct view_files){ 0 };
    return err;
}
