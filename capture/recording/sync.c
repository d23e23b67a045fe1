/* Thread that syncs: a sync may take long (docs/integrate/recordings.md), and the thread that writes frames never
 * waits. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "capture/recording/recording_internal.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "base/thread.h"

#define MAX_PAIRS   8 /* segments that wait for their last sync */
#define HURRY_PAIRS 4 /* from here on it is synced early */

struct pair {
    int segment_fd, manifest_fd;
    bool fresh; /* its name in the folder is not durable yet */
};

struct sync {
    /* fixed after start */
    char folder[SST_PATH_MAX];
    int64_t every_ns;
    pthread_t thread;
    /* sync thread only, after its end the owner */
    bool failing;
    int last_error;
    /* under lock */
    pthread_mutex_t lock;
    pthread_cond_t wake;
    struct pair pair[MAX_PAIRS]; /* the last one is being written to; only the sync thread removes from the front */
    int pairs;
    bool stop;
    int error;
};

int sync_folder(const char *folder)
{
    const int fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    const int err = fd < 0 || (fsync(fd) && errno != EINVAL) ? -errno : 0;

    if (fd >= 0)
        close(fd);
    return err;
}

/* The manifest is synced last, so that it never names bytes that are not on disk. */
static int sync_pair(const struct sync *s, const struct pair *p)
{
    int err = fdatasync(p->segment_fd) ? -errno : 0;

    if (!err && p->fresh)
        err = sync_folder(s->folder);
    if (!err && fdatasync(p->manifest_fd))
        err = -errno;
    return err;
}

static void report(struct sync *s, int err)
{
    if (err && !s->failing)
        sst_log_error("cannot sync the recording in %s: %s; its last sets may be damaged, check the disk", s->folder,
                      strerror(-err));
    if (!err && s->failing)
        sst_log_warning("the recording in %s can be synced again", s->folder);
    s->failing = err != 0;
    s->last_error = err;
}

/* Called and returns with the lock held; releases it during the sync. */
static void sync_all_locked(struct sync *s)
{
    struct pair pair[MAX_PAIRS];
    const int n = s->pairs;
    int err = 0;

    memcpy(pair, s->pair, sizeof(pair));
    pthread_mutex_unlock(&s->lock);
    for (int i = 0; i < n; i++) {
        const int e = sync_pair(s, &pair[i]);

        err = err ? err : e;
        if (i + 1 < n) {
            close(pair[i].segment_fd);
            close(pair[i].manifest_fd);
        }
    }
    report(s, err);
    pthread_mutex_lock(&s->lock);
    if (n > 1) {
        memmove(s->pair, s->pair + n - 1, (size_t)(s->pairs - n + 1) * sizeof(*s->pair));
        s->pairs -= n - 1;
    }
    if (n > 0)
        s->pair[0].fresh = s->pair[0].fresh && err;
    if (err)
        s->error = err;
}

static void *run(void *arg)
{
    struct sync *s = arg;
    int64_t due = sst_clock_now_ns() + s->every_ns;

    pthread_mutex_lock(&s->lock);
    while (!s->stop) {
        if (sst_clock_now_ns() < due && s->pairs < HURRY_PAIRS) {
            (void)sst_cond_wait_until(&s->wake, &s->lock, due);
            continue;
        }
        if (s->pairs)
            sync_all_locked(s);
        due = sst_clock_now_ns() + s->every_ns;
    }
    if (s->pairs)
        sync_all_locked(s);
    pthread_mutex_unlock(&s->lock);
    return NULL;
}

int sync_start(struct sync **out, const char *folder, double every_s)
{
    struct sync *s = calloc(1, sizeof(*s));
    int err;

    if (!s)
        return -ENOMEM;
    err = sst_path_join(s->folder, folder, NULL);
    if (err) {
        free(s);
        return err;
    }
    s->every_ns = (int64_t)(every_s * 1e9);
    pthread_mutex_init(&s->lock, NULL);
    sst_cond_init(&s->wake);
    err = -pthread_create(&s->thread, NULL, run, s);
    if (err) {
        sst_log_error("cannot start the thread that syncs %s: %s", folder, strerror(-err));
        pthread_cond_destroy(&s->wake);
        pthread_mutex_destroy(&s->lock);
        free(s);
        return err;
    }
    pthread_setname_np(s->thread, "sst-sync");
    *out = s;
    return 0;
}

int sync_watch(struct sync *s, int segment_fd, int manifest_fd)
{
    struct pair p = { .segment_fd = fcntl(segment_fd, F_DUPFD_CLOEXEC, 0), .fresh = true };
    int err = p.segment_fd < 0 ? -errno : 0;

    p.manifest_fd = err ? -1 : fcntl(manifest_fd, F_DUPFD_CLOEXEC, 0);
    if (!err && p.manifest_fd < 0)
        err = -errno;
    pthread_mutex_lock(&s->lock);
    if (!err && s->pairs == MAX_PAIRS)
        err = -EAGAIN;
    if (!err)
        s->pair[s->pairs++] = p;
    if (s->pairs >= HURRY_PAIRS)
        pthread_cond_signal(&s->wake);
    pthread_mutex_unlock(&s->lock);
    if (err && p.segment_fd >= 0)
        close(p.segment_fd);
    if (err && p.manifest_fd >= 0)
        close(p.manifest_fd);
    return err;
}

bool sync_has_room(struct sync *s)
{
    bool room;

    pthread_mutex_lock(&s->lock);
    room = s->pairs < MAX_PAIRS;
    pthread_mutex_unlock(&s->lock);
    return room;
}

int sync_fetch_error(struct sync *s)
{
    int err;

    pthread_mutex_lock(&s->lock);
    err = s->error;
    s->error = 0;
    pthread_mutex_unlock(&s->lock);
    return err;
}

int sync_stop(struct sync *s)
{
    int err;

    if (!s)
        return 0;
    pthread_mutex_lock(&s->lock);
    s->stop = true;
    pthread_cond_signal(&s->wake);
    pthread_mutex_unlock(&s->lock);
    pthread_join(s->thread, NULL);
    for (int i = 0; i < s->pairs; i++) {
        close(s->pair[i].segment_fd);
        close(s->pair[i].manifest_fd);
    }
    err = s->last_error;
    pthread_cond_destroy(&s->wake);
    pthread_mutex_destroy(&s->lock);
    free(s);
    return err;
}
