/* Sets of sources: their memory, and their way from a connection over the numbering to capture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>

#include "base/clock.h"
#include "base/log.h"
#include "capture/link/link_internal.h"

static struct head_set *acquire_locked(struct head_source *source)
{
    for (int i = 0; i < LINK_SETS; i++) {
        if (!source->set[i])
            source->set[i] = calloc(1, sizeof(*source->set[i]));
        if (!source->set[i] || !source->set[i]->refs)
            return source->set[i];
    }
    return NULL;
}

struct head_set *head_set_acquire(struct sst_link_head *h, int source, int frames, int missed, size_t bytes)
{
    struct head_source *s = &h->source[source];
    struct head_set *set;

    pthread_mutex_lock(&h->lock);
    s->peer.sets++;
    s->peer.frames += (uint64_t)frames;
    s->peer.missed += (uint64_t)missed;
    frames -= missed;
    set = acquire_locked(s);
    if (set)
        set->data = sst_mem_keep(&set->kept, bytes, 1); /* after the first sets no more is asked for */
    if (set && set->data) {
        set->source = source;
        set->frames = frames;
        set->cameras = s->cameras;
        set->refs = 1;
        memcpy(set->slot, s->slot, sizeof(s->slot[0]) * (size_t)s->cameras);
        s->peer.waiting += (uint64_t)frames;
    } else {
        s->peer.dropped += (uint64_t)frames;
        set = NULL;
    }
    pthread_mutex_unlock(&h->lock);
    return set;
}

/* A set goes before capture has seen it. */
static void discard_locked(struct sst_link_head *h, struct head_set *set, uint64_t *count)
{
    struct head_source *s = &h->source[set->source];

    s->peer.waiting -= (uint64_t)set->frames;
    *count += (uint64_t)set->frames;
    set->refs = 0;
}

static void make_ready_locked(struct sst_link_head *h, struct head_set *set)
{
    if (h->ready_count == LINK_READY) { /* capture stands still: the oldest goes */
        struct head_set *oldest = h->ready[h->ready_first];

        h->ready_first = (h->ready_first + 1) % LINK_READY;
        h->ready_count--;
        discard_locked(h, oldest, &h->source[oldest->source].peer.dropped);
    }
    h->ready[(h->ready_first + h->ready_count++) % LINK_READY] = set;
    (void)eventfd_write(h->ready_fd, 1); /* full: it is already readable */
}

static void log_slip(const struct sst_link_head *h, int source, const struct sst_numbering_state *before,
                     const struct sst_numbering_state *after)
{
    const char *name = source == LINK_OWN ? "of this host" : h->source[source].peer.name;

    if (after->slips != before->slips)
        sst_log_warning("node %s: its count of edges was off by %lld and is corrected: it %s; check its trigger input",
                        name, (long long)(after->slipped - before->slipped),
                        after->slipped > before->slipped ? "missed edges" : "counted edges that others did not see");
    if (after->renamed != before->renamed)
        sst_log_warning("node %s: its time stamps jumped; its sets are named by its wall clock again", name);
}

static enum sst_numbering_verdict name_edge(struct sst_link_head *h, int source, const struct sst_numbering_edge *edge,
                                            int64_t now_ns, struct sst_numbering_place *place)
{
    const struct sst_numbering_edge here = { edge->count, edge->t_ns,
                                             edge->wall_ns - (sst_clock_wall_ns() - sst_clock_now_ns()) };
    struct sst_numbering_state before, after;
    enum sst_numbering_verdict verdict;

    sst_numbering_state(h->numbering, source, &before);
    verdict = sst_numbering_place(h->numbering, source, &here, now_ns, place);
    sst_numbering_state(h->numbering, source, &after);
    log_slip(h, source, &before, &after);
    return verdict;
}

/* @return true: the oldest set that waits is decided */
static bool decide_locked(struct sst_link_head *h, int source, int64_t now_ns)
{
    struct head_source *s = &h->source[source];
    enum sst_numbering_verdict verdict;
    struct head_set *set;

    if (!s->count)
        return false;
    set = s->waiting[s->first];
    verdict = name_edge(h, source, &set->edge, now_ns, &set->place);
    if (verdict == SST_NUMBERING_HELD)
        return false;
    s->first = (s->first + 1) % LINK_SETS;
    s->count--;
    if (verdict == SST_NUMBERING_PLACED)
        make_ready_locked(h, set);
    else
        discard_locked(h, set, &s->peer.unnamed);
    return true;
}

/* Another source may wait for one source's decision. */
static bool settle_locked(struct sst_link_head *h, int64_t now_ns)
{
    bool any = true, waits = false;

    while (any) {
        any = false;
        for (int i = 0; i < LINK_NODES; i++)
            while (decide_locked(h, i, now_ns))
                any = true;
    }
    for (int i = 0; i < LINK_NODES; i++)
        waits |= h->source[i].count > 0;
    return waits;
}

void head_set_pass(struct sst_link_head *h, struct head_set *set)
{
    struct head_source *s = &h->source[set->source];

    pthread_mutex_lock(&h->lock);
    s->waiting[(s->first + s->count++) % LINK_SETS] = set; /* it has no more sets than places */
    (void)settle_locked(h, sst_clock_now_ns());
    pthread_mutex_unlock(&h->lock);
}

bool head_settle(struct sst_link_head *h, int64_t now_ns)
{
    bool waits;

    pthread_mutex_lock(&h->lock);
    waits = settle_locked(h, now_ns);
    pthread_mutex_unlock(&h->lock);
    return waits;
}

void head_forget_locked(struct sst_link_head *h, int source)
{
    struct head_source *s = &h->source[source];

    for (; s->count; s->count--) {
        discard_locked(h, s->waiting[s->first], &s->peer.unnamed);
        s->first = (s->first + 1) % LINK_SETS;
    }
}

void head_camera_locked(struct sst_link_head *h, int source, int cam, struct head_camera now)
{
    struct head_slot *slot = &h->slot[h->source[source].slot[cam]];

    if (slot->source != source)
        return; /* another host has it now */
    if (now.device)
        slot->device = *now.device;
    if (slot->state == now.state && !strcmp(slot->why, now.why))
        return;
    slot->state = now.state;
    strncpy(slot->why, now.why, sizeof(slot->why) - 1);
    slot->changed = true;
    (void)eventfd_write(h->ready_fd, 1); /* full: it is already readable */
}

void head_sets_free(struct sst_link_head *h)
{
    for (int i = 0; i < LINK_NODES; i++) {
        for (int k = 0; k < LINK_SETS; k++) {
            if (h->source[i].set[k])
                sst_mem_kept_fini(&h->source[i].set[k]->kept);
            free(h->source[i].set[k]);
        }
        json_decref(h->source[i].peer.reported);
    }
}
