/* Cameras of the head itself: captured by a thread of their own, their sets arrive as from one more node. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "capture/link/link_internal.h"

#define RETRY_NS INT64_C(1000000000)

struct link_local {
    struct sst_link_head *head;
    struct sst_array_config array;
    pthread_t thread;
    bool threaded;
    /* own thread */
    uint64_t run;
    char logged[SST_LOG_MAX]; /* the last failure: each is logged once, not at each attempt */
    /* under lock */
    pthread_mutex_t lock;
    pthread_cond_t changed;
    struct sst_capture *capture;
    bool stop;
};

/* On the writer's thread of the capture: copy, so that the frames go back at once. */
static int on_set(void *arg, const struct sst_frameset *set)
{
    struct link_local *l = arg;
    size_t bytes = 0;
    struct head_set *to;
    uint8_t *at;

    for (int i = 0; i < set->cameras; i++)
        bytes += set->frame[i] ? sst_frame_packed_bytes(set->frame[i]) : 0;
    to = head_set_acquire(l->head, LINK_OWN, set->present, 0, bytes);
    if (!to)
        return -ENOBUFS;
    to->edge = (struct sst_numbering_edge){ set->index, set->t_ns, set->wall_ns };
    to->stamped = set->edge;
    at = to->data;
    for (int i = 0; i < set->cameras; i++) {
        const struct sst_frame *f = set->frame[i];
        const int64_t delay_ns = l->array.lines ? (int64_t)l->array.delay_us[l->array.camera[i].line] * 1000 : 0;

        to->frame[i] = (struct sst_frame){ 0 };
        if (!f)
            continue;
        at += sst_frame_pack(&to->frame[i], at, f);
        to->frame[i].t_ns = f->t_ns - delay_ns - set->t_ns;
    }
    head_set_pass(l->head, to);
    return 0;
}

static void on_camera(void *arg, int cam, enum sst_grab_state state, const char *why)
{
    struct link_local *l = arg;
    struct sst_grab_counters counters;
    const struct sst_grab_device *device = NULL;

    pthread_mutex_lock(&l->lock);
    if (l->capture)
        sst_capture_camera(l->capture, cam, &counters, &device);
    pthread_mutex_unlock(&l->lock);
    pthread_mutex_lock(&l->head->lock);
    head_camera_locked(l->head, LINK_OWN, cam, (struct head_camera){ state, why ? why : "", device });
    pthread_mutex_unlock(&l->head->lock);
}

static void capture_once(struct link_local *l)
{
    const struct sst_capture_events events = { .arg = l, .set = on_set, .camera = on_camera };
    struct sst_capture *capture = NULL;
    char why[SST_LOG_MAX] = "";
    int err;

    sst_log_hold_errors(why);
    pthread_mutex_lock(&l->head->lock);
    sst_numbering_join(l->head->numbering, LINK_OWN, ++l->run);
    pthread_mutex_unlock(&l->head->lock);
    err = sst_capture_open(&capture, &l->array, &events);
    pthread_mutex_lock(&l->lock);
    l->capture = err ? NULL : capture;
    if (l->capture && l->stop)
        sst_capture_stop(l->capture);
    pthread_mutex_unlock(&l->lock);
    err = err ? err : sst_capture_run(capture, 0);
    pthread_mutex_lock(&l->lock);
    l->capture = NULL;
    pthread_mutex_unlock(&l->lock);
    sst_capture_close(capture);
    sst_log_hold_errors(NULL);
    if (why[0] && strcmp(why, l->logged) != 0)
        sst_log_error("%s", why);
    memcpy(l->logged, why, sizeof(why));
    pthread_mutex_lock(&l->head->lock);
    sst_numbering_leave(l->head->numbering, LINK_OWN);
    head_forget_locked(l->head, LINK_OWN);
    for (int i = 0; i < l->array.bound; i++)
        head_camera_locked(
            l->head, LINK_OWN, i,
            (struct head_camera){ SST_GRAB_ABSENT, err && why[0] ? why : "capturing is started again", NULL });
    pthread_mutex_unlock(&l->head->lock);
}

static void *run(void *arg)
{
    struct link_local *l = arg;

    sst_thread_name("sst-own");
    pthread_mutex_lock(&l->lock);
    while (!l->stop) {
        const int64_t again_ns = sst_clock_now_ns() + RETRY_NS;

        pthread_mutex_unlock(&l->lock);
        capture_once(l);
        pthread_mutex_lock(&l->lock);
        while (!l->stop && sst_cond_wait_until(&l->changed, &l->lock, again_ns))
            ;
    }
    pthread_mutex_unlock(&l->lock);
    return NULL;
}

int link_local_open(struct link_local **out, struct sst_link_head *head, const struct sst_array_config *array)
{
    struct link_local *l = calloc(1, sizeof(*l));
    struct head_source *s = &head->source[LINK_OWN];
    int err;

    if (!l)
        return -ENOMEM;
    l->head = head;
    l->array = *array;
    l->array.role = SST_CONFIG_SINGLE;
    l->array.masks = 0; /* the capture of all hosts applies them */
    pthread_mutex_init(&l->lock, NULL);
    sst_cond_init(&l->changed);
    pthread_mutex_lock(&head->lock);
    s->peer.connected = true;
    s->used = true;
    s->cameras = array->bound;
    for (int i = 0; i < array->bound; i++) {
        s->slot[i] = array->camera[i].row * array->cols + array->camera[i].col;
        head->slot[s->slot[i]].source = LINK_OWN;
    }
    pthread_mutex_unlock(&head->lock);
    err = -pthread_create(&l->thread, NULL, run, l);
    l->threaded = !err;
    if (err)
        link_local_close(l);
    else
        *out = l;
    return err;
}

void link_local_close(struct link_local *l)
{
    if (!l)
        return;
    pthread_mutex_lock(&l->lock);
    l->stop = true;
    if (l->capture)
        sst_capture_stop(l->capture);
    pthread_cond_broadcast(&l->changed);
    pthread_mutex_unlock(&l->lock);
    if (l->threaded)
        pthread_join(l->thread, NULL);
    pthread_cond_destroy(&l->changed);
    pthread_mutex_destroy(&l->lock);
    free(l);
}
