/* Pictures of the service: one MJPEG stream for each that is watched, received on a thread of its own. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "publishers/rtsp/rtsp_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "client/client.h"

#define PICTURES_MAX 48
#define LINGER_NS    3000000000LL  /* between the description of a picture and the first viewer */
#define AGE_MAX_NS   10000000000LL /* of a frame; more is a wall clock that was set */

struct source {
    struct rtsp_picture picture; /* first: a reference to it is one to this */
    enum rtsp_kind kind;
    char name[RTSP_NAME_MAX + 1];
    int64_t used_ns; /* under lock: when it was asked for or had a viewer */
};

static struct {
    const struct sst_client_service *service; /* fixed after init */
    pthread_mutex_t lock;
    struct source *source[PICTURES_MAX]; /* under lock; NULL: free */
    atomic_bool stop;
    atomic_int running; /* threads */
} pictures = { .lock = PTHREAD_MUTEX_INITIALIZER };

void rtsp_pictures_init(const struct sst_client_service *service)
{
    pictures.service = service;
}

bool rtsp_pictures_end(int64_t until_ns)
{
    atomic_store(&pictures.stop, true);
    while (atomic_load(&pictures.running) && sst_clock_now_ns() < until_ns)
        nanosleep(&(struct timespec){ .tv_nsec = 10000000 }, NULL);
    return !atomic_load(&pictures.running);
}

void rtsp_picture_unref(struct rtsp_picture *picture)
{
    if (!picture || atomic_fetch_sub(&picture->refs, 1) > 1)
        return;
    sst_slot_unref(picture->slot);
    free(picture);
}

static void remove_locked(const struct source *s)
{
    for (int i = 0; i < PICTURES_MAX; i++)
        if (pictures.source[i] == s)
            pictures.source[i] = NULL;
}

/* A source without viewers leaves the table at once: the next request for its picture gets another one. */
static bool is_used(void *arg)
{
    struct source *s = arg;
    const int64_t now_ns = sst_clock_now_ns();
    bool used;

    pthread_mutex_lock(&pictures.lock);
    if (sst_slot_clients(s->picture.slot) > 0)
        s->used_ns = now_ns;
    used = now_ns - s->used_ns < LINGER_NS && !atomic_load(&pictures.stop);
    if (!used)
        remove_locked(s);
    pthread_mutex_unlock(&pictures.lock);
    return used;
}

/* The service sends a picture that stands still again, as a sign of life. */
static bool is_repeated(const struct source *s, const struct sst_client_picture *p)
{
    const struct sst_jpeg *newest = sst_slot_get(s->picture.slot, 0);
    const bool same =
        newest && newest->set == p->set && newest->bytes == p->bytes && !memcmp(newest->data, p->data, p->bytes);

    sst_slot_jpeg_unref(newest);
    return same;
}

static int on_picture(void *arg, const struct sst_client_picture *p)
{
    struct source *s = arg;
    const int64_t age_ns = p->wall_ns ? sst_clock_wall_ns() - p->wall_ns : 0;
    const int64_t past_ns = age_ns < 0 ? 0 : age_ns < AGE_MAX_NS ? age_ns : AGE_MAX_NS;
    uint8_t *copy;

    if (!is_used(s))
        return -ECANCELED;
    if (is_repeated(s, p))
        return 0;
    copy = malloc(p->bytes);
    if (copy)
        memcpy(copy, p->data, p->bytes);
    if (!copy || sst_slot_put(s->picture.slot, copy, p->bytes, p->set, sst_clock_now_ns() - past_ns, p->wall_ns))
        sst_log_warning("rtsp: no memory for a frame; it is dropped");
    return 0;
}

static void *receive(void *arg)
{
    static const char *const paths[] = { "/stream/", "/stream/camera/" };
    struct source *s = arg;
    struct sst_client *client = NULL;
    char path[RTSP_NAME_MAX + 32], held[SST_LOG_MAX] = "";
    int err;

    sst_thread_name("rtsp-picture");
    sst_log_hold_errors(held);
    snprintf(path, sizeof(path), "%s%s", paths[s->kind], s->name);
    err = sst_client_open(&client, pictures.service);
    if (!err) {
        sst_client_set_continue(client, is_used, s);
        err = sst_client_stream(client, path, on_picture, s);
    }
    sst_client_close(client);
    sst_log_hold_errors(NULL);
    if (err && err != -ECANCELED)
        sst_log_debug("rtsp: %s: %s", path, held);
    pthread_mutex_lock(&pictures.lock);
    remove_locked(s);
    pthread_mutex_unlock(&pictures.lock);
    atomic_store(&s->picture.err, err ? err : -ENOENT);
    sst_slot_shut(s->picture.slot);
    rtsp_picture_unref(&s->picture);
    atomic_fetch_sub(&pictures.running, 1);
    return NULL;
}

static struct source *create(enum rtsp_kind kind, const char *name)
{
    struct source *s = calloc(1, sizeof(*s));
    pthread_t thread;

    if (!s || sst_slot_create(&s->picture.slot)) {
        free(s);
        return NULL;
    }
    s->kind = kind;
    s->used_ns = sst_clock_now_ns();
    snprintf(s->name, sizeof(s->name), "%s", name);
    atomic_store(&s->picture.refs, 1); /* the thread's */
    atomic_fetch_add(&pictures.running, 1);
    if (pthread_create(&thread, NULL, receive, s)) {
        atomic_fetch_sub(&pictures.running, 1);
        rtsp_picture_unref(&s->picture);
        return NULL;
    }
    pthread_detach(thread);
    return s;
}

/* @param room  out, a free place; as it was without one */
static struct source *find_locked(enum rtsp_kind kind, const char *name, struct source ***room)
{
    for (int i = 0; i < PICTURES_MAX; i++) {
        struct source *s = pictures.source[i];

        if (!s)
            *room = &pictures.source[i];
        else if (s->kind == kind && !strcmp(s->name, name))
            return s;
    }
    return NULL;
}

struct rtsp_picture *rtsp_picture_get(enum rtsp_kind kind, const char *name)
{
    struct source *s, **room = NULL;

    pthread_mutex_lock(&pictures.lock);
    s = find_locked(kind, name, &room);
    if (!s && room)
        s = *room = create(kind, name);
    if (s) {
        s->used_ns = sst_clock_now_ns();
        atomic_fetch_add(&s->picture.refs, 1);
    }
    pthread_mutex_unlock(&pictures.lock);
    return s ? &s->picture : NULL;
}

bool rtsp_picture_is_open(enum rtsp_kind kind, const char *name)
{
    struct source **room = NULL;
    bool open;

    pthread_mutex_lock(&pictures.lock);
    open = find_locked(kind, name, &room) != NULL;
    pthread_mutex_unlock(&pictures.lock);
    return open;
}
