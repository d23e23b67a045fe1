/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/jpeg_slot.h"

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "base/clock.h"
#include "base/thread.h"

struct jpeg {
    struct sst_jpeg jpeg;
    uint8_t *data;
    atomic_int refs;
};

struct sst_slot {
    atomic_int refs, viewers;
    atomic_bool shut;     /* written under lock */
    pthread_mutex_t lock; /* of the picture */
    pthread_cond_t changed;
    /* under lock */
    struct jpeg *newest;
    uint64_t number;
};

int sst_slot_create(struct sst_slot **out)
{
    struct sst_slot *o = calloc(1, sizeof(*o));

    if (!o)
        return -ENOMEM;
    o->refs = 1;
    pthread_mutex_init(&o->lock, NULL);
    sst_cond_init(&o->changed);
    *out = o;
    return 0;
}

struct sst_slot *sst_slot_ref(struct sst_slot *o)
{
    o->refs++;
    return o;
}

void sst_slot_unref(struct sst_slot *o)
{
    if (!o || --o->refs)
        return;
    if (o->newest)
        sst_slot_jpeg_unref(&o->newest->jpeg);
    pthread_cond_destroy(&o->changed);
    pthread_mutex_destroy(&o->lock);
    free(o);
}

int sst_slot_put(struct sst_slot *o, uint8_t *data, size_t bytes, uint64_t set, int64_t t_ns, int64_t wall_ns)
{
    struct jpeg *j = calloc(1, sizeof(*j)), *before;

    if (!j) {
        free(data);
        return -ENOMEM;
    }
    j->data = data;
    j->refs = 1;
    j->jpeg = (struct sst_jpeg){ .set = set, .t_ns = t_ns, .wall_ns = wall_ns, .bytes = bytes, .data = data };
    pthread_mutex_lock(&o->lock);
    before = o->newest;
    j->jpeg.number = ++o->number;
    o->newest = j;
    pthread_cond_broadcast(&o->changed);
    pthread_mutex_unlock(&o->lock);
    if (before)
        sst_slot_jpeg_unref(&before->jpeg);
    return 0;
}

void sst_slot_forget(struct sst_slot *o)
{
    struct jpeg *before;

    pthread_mutex_lock(&o->lock);
    before = o->newest;
    o->newest = NULL;
    pthread_mutex_unlock(&o->lock);
    if (before)
        sst_slot_jpeg_unref(&before->jpeg);
}

const struct sst_jpeg *sst_slot_get(struct sst_slot *o, uint64_t after)
{
    struct jpeg *j = NULL;

    pthread_mutex_lock(&o->lock);
    if (o->newest && o->number > after) {
        j = o->newest;
        j->refs++;
    }
    pthread_mutex_unlock(&o->lock);
    return j ? &j->jpeg : NULL;
}

static struct jpeg *whole(const struct sst_jpeg *jpeg)
{
    return (struct jpeg *)(void *)((uint8_t *)jpeg - offsetof(struct jpeg, jpeg));
}

const struct sst_jpeg *sst_slot_jpeg_ref(const struct sst_jpeg *jpeg)
{
    whole(jpeg)->refs++;
    return jpeg;
}

void sst_slot_jpeg_unref(const struct sst_jpeg *jpeg)
{
    struct jpeg *j = jpeg ? whole(jpeg) : NULL;

    if (!j || --j->refs)
        return;
    free(j->data);
    free(j);
}

bool sst_slot_wait(struct sst_slot *o, uint64_t after, int timeout_ms)
{
    const int64_t end_ns = sst_clock_now_ns() + (int64_t)timeout_ms * 1000000;
    bool there;

    pthread_mutex_lock(&o->lock);
    while (!o->shut && o->number <= after && sst_cond_wait_until(&o->changed, &o->lock, end_ns))
        ;
    there = !o->shut && o->number > after;
    pthread_mutex_unlock(&o->lock);
    return there;
}

void sst_slot_join(struct sst_slot *o)
{
    o->viewers++;
}

void sst_slot_leave(struct sst_slot *o)
{
    o->viewers--;
}

int sst_slot_clients(struct sst_slot *o)
{
    return o->viewers;
}

void sst_slot_shut(struct sst_slot *o)
{
    pthread_mutex_lock(&o->lock);
    o->shut = true;
    pthread_cond_broadcast(&o->changed);
    pthread_mutex_unlock(&o->lock);
}

bool sst_slot_is_shut(struct sst_slot *o)
{
    return o->shut;
}
