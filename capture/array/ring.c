/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/array/ring.h"

#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/mem.h"
#include "base/thread.h"

#define SLOTS_MAX 4096

/* A set in the arena: this header, the descriptions of its frames, then their bytes. */
struct slot {
    size_t size; /* of all, rounded up to SST_ALIGN */
    int refs;    /* under lock */
    struct sst_kept kept;
    struct sst_frame frame[];
};

struct sst_ring {
    /* fixed after create */
    uint8_t *arena;
    size_t bytes;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    /* under lock */
    struct slot *slot[SLOTS_MAX]; /* by number */
    int slots;
    size_t head; /* offset of the next set */
    uint64_t number, hidden; /* of the newest set; of the newest one that is hidden */
    bool shut;
    struct sst_ring_counters count;
};

static size_t offset_of(const struct sst_ring *r, const struct slot *s)
{
    return (size_t)((const uint8_t *)s - r->arena);
}

static void remove_locked(struct sst_ring *r, int i)
{
    r->count.bytes -= r->slot[i]->kept.bytes;
    memmove(&r->slot[i], &r->slot[i + 1], sizeof(r->slot[0]) * (size_t)(r->slots - i - 1));
    r->slots--;
}

/*
 * Make room for `size` bytes at head: sets in the way are dropped; if one has readers, the space behind it is
 * tried. So a hung reader costs only the space of its own set.
 */
static uint8_t *reserve_locked(struct sst_ring *r, size_t size)
{
    int wraps = 0;

    if (size > r->bytes)
        return NULL;
    while (wraps < 2) {
        bool moved = false;

        if (r->head + size > r->bytes) {
            r->head = 0;
            wraps++;
        }
        for (int i = 0; i < r->slots && !moved; i++) {
            const size_t at = offset_of(r, r->slot[i]), end = at + r->slot[i]->size;

            if (at >= r->head + size || end <= r->head)
                continue;
            if (r->slot[i]->refs) {
                r->head = end;
                moved = true;
            } else {
                remove_locked(r, i--);
            }
        }
        if (!moved && r->slots < SLOTS_MAX)
            return r->arena + r->head;
        if (!moved) { /* all slots are in use: drop the oldest one without readers */
            int i = 0;

            while (i < r->slots && r->slot[i]->refs)
                i++;
            if (i == r->slots)
                return NULL;
            remove_locked(r, i);
        }
    }
    return NULL;
}

int sst_ring_create(struct sst_ring **out, size_t bytes)
{
    struct sst_ring *r;

    if (bytes < SST_ALIGN)
        return -EINVAL;
    r = calloc(1, sizeof(*r));
    if (!r)
        return -ENOMEM;
    r->bytes = bytes / SST_ALIGN * SST_ALIGN;
    r->arena = sst_mem_alloc_raw(r->bytes, 1);
    if (!r->arena) {
        free(r);
        return -ENOMEM;
    }
    pthread_mutex_init(&r->lock, NULL);
    sst_cond_init(&r->changed);
    *out = r;
    return 0;
}

static void fill(struct slot *s, const struct sst_frameset *set)
{
    uint8_t *at = (uint8_t *)&s->frame[set->cameras];
    int n = 0;

    s->kept.set = *set;
    s->kept.bytes = 0;
    for (int i = 0; i < set->cameras; i++) {
        struct sst_frame *f = &s->frame[n];

        if (!set->frame[i])
            continue;
        n++;
        at += sst_frame_pack(f, at, set->frame[i]);
        s->kept.bytes += f->bytes;
        s->kept.set.frame[i] = f;
    }
}

int sst_ring_put(struct sst_ring *r, const struct sst_frameset *set)
{
    size_t size = sizeof(struct slot) + sizeof(struct sst_frame) * (size_t)set->cameras;
    struct slot *s;

    for (int i = 0; i < set->cameras; i++)
        size += set->frame[i] ? sst_frame_packed_bytes(set->frame[i]) : 0;
    size = sst_mem_stride(size, 1);
    pthread_mutex_lock(&r->lock);
    s = (struct slot *)(void *)reserve_locked(r, size);
    if (!s) {
        r->count.refused++;
        pthread_mutex_unlock(&r->lock);
        return -ENOBUFS;
    }
    r->head += size;
    pthread_mutex_unlock(&r->lock);

    /* There is one writer: no other call uses the space while it is filled. */
    s->size = size;
    s->refs = 0;
    fill(s, set);

    pthread_mutex_lock(&r->lock);
    s->kept.number = ++r->number;
    r->slot[r->slots++] = s;
    r->count.kept++;
    r->count.complete += set->present == set->cameras;
    r->count.bytes += s->kept.bytes;
    pthread_cond_broadcast(&r->changed);
    pthread_mutex_unlock(&r->lock);
    return 0;
}

void sst_ring_forget(struct sst_ring *r)
{
    pthread_mutex_lock(&r->lock);
    r->hidden = r->number;
    for (int i = r->slots - 1; i >= 0; i--)
        if (!r->slot[i]->refs)
            remove_locked(r, i);
    pthread_mutex_unlock(&r->lock);
}

static bool is_hidden_locked(const struct sst_ring *r, int i)
{
    return r->slot[i]->kept.number <= r->hidden;
}

const struct sst_kept *sst_ring_get(struct sst_ring *r, uint64_t number)
{
    struct slot *s = NULL;

    pthread_mutex_lock(&r->lock);
    for (int i = 0; i < r->slots && !s && number; i++)
        if (r->slot[i]->kept.number >= number && !is_hidden_locked(r, i))
            s = r->slot[i];
    if (!s && r->slots && !is_hidden_locked(r, r->slots - 1))
        s = r->slot[r->slots - 1];
    if (s)
        s->refs++;
    pthread_mutex_unlock(&r->lock);
    return s ? &s->kept : NULL;
}

const struct sst_kept *sst_ring_newest(struct sst_ring *r, uint64_t after, uint64_t *dropped)
{
    struct slot *s = NULL;

    pthread_mutex_lock(&r->lock);
    for (int i = r->slots - 1; i >= 0 && r->slot[i]->kept.number > after && !is_hidden_locked(r, i); i--) {
        const bool complete = r->slot[i]->kept.set.present == r->slot[i]->kept.set.cameras;

        if (!s || complete)
            s = r->slot[i];
        if (complete)
            break;
    }
    if (s) {
        s->refs++;
        *dropped = s->kept.number - after - 1;
    }
    pthread_mutex_unlock(&r->lock);
    return s ? &s->kept : NULL;
}

void sst_ring_unref(struct sst_ring *r, const struct sst_kept *kept)
{
    struct slot *s;

    if (!kept)
        return;
    s = (struct slot *)((uint8_t *)kept - offsetof(struct slot, kept));
    pthread_mutex_lock(&r->lock);
    s->refs--;
    pthread_mutex_unlock(&r->lock);
}

bool sst_ring_wait(struct sst_ring *r, uint64_t after, int timeout_ms)
{
    const int64_t end_ns = sst_clock_now_ns() + (int64_t)timeout_ms * 1000000;
    bool there;

    pthread_mutex_lock(&r->lock);
    while (!r->shut && r->number <= after && sst_cond_wait_until(&r->changed, &r->lock, end_ns))
        ;
    there = !r->shut && r->number > after;
    pthread_mutex_unlock(&r->lock);
    return there;
}

void sst_ring_shut(struct sst_ring *r)
{
    pthread_mutex_lock(&r->lock);
    r->shut = true;
    pthread_cond_broadcast(&r->changed);
    pthread_mutex_unlock(&r->lock);
}

void sst_ring_counters(struct sst_ring *r, struct sst_ring_counters *out)
{
    pthread_mutex_lock(&r->lock);
    *out = r->count;
    out->sets = r->slots;
    out->oldest_ns = r->slots ? r->slot[0]->kept.set.t_ns : 0;
    pthread_mutex_unlock(&r->lock);
}

void sst_ring_destroy(struct sst_ring *r)
{
    if (!r)
        return;
    pthread_cond_destroy(&r->changed);
    pthread_mutex_destroy(&r->lock);
    sst_mem_free(r->arena);
    free(r);
}
