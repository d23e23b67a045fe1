/*
 * Census of views that are matched one by one, where the census of all views takes more memory than the limit: narrow
 * light fields with offsets of any fraction have up to 16 phases a view, of eight bytes a pixel each. As many planes are
 * kept as fit; the plane with the latest next use is evicted.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/method/disparity/disparity_internal.h"

#define NEVER INT_MAX

/** A place of a plane. */
struct census_slot {
    uint64_t *data;
    int view, phase; /* view: -1: no plane */
    bool stale;      /* the plane is to be computed */
};

/* The first slots last; the other slots lie in the sums of the volume, which overwrite them when paths are summed. */
struct census_cache {
    uint64_t *memory;
    struct census_slot *slot;
    int lasting, slots;
    int (*next)[SST_PHASES]; /* [views] matched view, counted from this one on, that uses the plane next */
};

/* A plane without a slot. */
struct missing {
    int view, phase, next;
};

static int views_of(const struct disparity_run *run)
{
    return run->lf->rows * run->lf->cols;
}

static size_t plane_words(const struct disparity_run *run)
{
    return sst_mem_stride((size_t)run->width, sizeof(uint64_t)) / sizeof(uint64_t) * (size_t)run->height;
}

static int count_needed(const struct disparity_run *run)
{
    int planes = 0;

    for (int k = 0; k < views_of(run); k++)
        planes += __builtin_popcount(run->need[k]);
    return planes;
}

size_t run_census_bytes(struct disparity_run *run)
{
    memset(run->need, 0, (size_t)views_of(run) * sizeof(*run->need));
    for (int k = 0; k < views_of(run); k++) {
        if (run->lf->views[k].present)
            run_need_view(run, k);
    }
    return (size_t)count_needed(run) * plane_words(run) * sizeof(uint64_t);
}

/* The most planes that a view is matched with. */
static int most_needed(struct disparity_run *run)
{
    int most = 0;

    for (int k = 0; k < views_of(run); k++) {
        memset(run->need, 0, (size_t)views_of(run) * sizeof(*run->need));
        if (run->lf->views[k].present)
            run_need_view(run, k);
        most = sst_max_int(most, count_needed(run));
    }
    return most;
}

int run_make_census_cache(struct disparity_run *run, size_t bytes)
{
    const struct sst_volume *v = &run->volumes[0];
    const size_t words = plane_words(run), plane = words * sizeof(uint64_t);
    const size_t passing = v->pixels * v->steps_padded * sizeof(*v->sum) / plane, fit = bytes / plane;
    const int most = most_needed(run), all = SST_PHASES * views_of(run);
    struct census_cache *c = calloc(1, sizeof(*c));

    run->cache = c;
    if (!c)
        return -ENOMEM;
    c->lasting = (int)(passing + fit < (size_t)most ? (size_t)most - passing : fit < (size_t)all ? fit : (size_t)all);
    c->slots = c->lasting + (int)(passing < (size_t)all ? passing : (size_t)all);
    c->memory = sst_mem_alloc_raw((size_t)sst_max_int(c->lasting, 1), plane);
    c->slot = calloc((size_t)c->slots, sizeof(*c->slot));
    c->next = calloc((size_t)views_of(run), sizeof(*c->next));
    if (!c->memory || !c->slot || !c->next)
        return -ENOMEM;
    for (int i = 0; i < c->slots; i++) {
        c->slot[i].view = -1;
        c->slot[i].data = i < c->lasting
                              ? c->memory + (size_t)i * words
                              : (uint64_t *)(void *)v->sum + (size_t)(i - c->lasting) * words;
    }
    return 0;
}

static void evict(struct disparity_run *run, struct census_slot *slot)
{
    if (slot->view >= 0)
        run->desc[slot->view].census[slot->phase] = NULL;
    slot->view = -1;
    slot->stale = false;
}

void run_free_census_cache(struct disparity_run *run)
{
    struct census_cache *c = run->cache;

    if (!c)
        return;
    for (int i = 0; c->slot && i < c->slots; i++)
        evict(run, &c->slot[i]);
    sst_mem_free(c->memory);
    free(c->slot);
    free(c->next);
    free(c);
    run->cache = NULL;
}

/* When planes are used next. @param view  [count] that are matched, in this order; the first one now */
static void look_ahead(struct disparity_run *run, const int *view, int count)
{
    const size_t views = (size_t)views_of(run);

    for (size_t k = 0; k < views; k++) {
        for (int p = 0; p < SST_PHASES; p++)
            run->cache->next[k][p] = NEVER;
    }
    for (int i = count - 1; i >= 0; i--) {
        memset(run->need, 0, views * sizeof(*run->need));
        run_need_view(run, view[i]);
        for (size_t k = 0; i && k < views; k++) {
            for (int p = 0; p < SST_PHASES; p++) {
                if (run->need[k] >> p & 1)
                    run->cache->next[k][p] = i;
            }
        }
    }
}

static bool is_needed(const struct disparity_run *run, const struct census_slot *slot)
{
    return slot->view >= 0 && run->need[slot->view] >> slot->phase & 1;
}

/* When a slot's plane is used again; -1: it is used now. */
static int used_next(const struct disparity_run *run, const struct census_slot *slot)
{
    return slot->view < 0 ? NEVER : is_needed(run, slot) ? -1 : run->cache->next[slot->view][slot->phase];
}

/* The slot for a plane: a lasting one, if its plane is used later than this plane. */
static struct census_slot *choose_slot(const struct disparity_run *run, int next)
{
    const struct census_cache *c = run->cache;
    struct census_slot *latest = NULL, *passing = NULL;

    for (int i = 0; i < c->lasting; i++) {
        if (!latest || used_next(run, &c->slot[i]) > used_next(run, latest))
            latest = &c->slot[i];
    }
    for (int i = c->lasting; i < c->slots && !passing; i++)
        passing = c->slot[i].view < 0 ? &c->slot[i] : NULL;
    if (passing && (!latest || (latest->view >= 0 && used_next(run, latest) <= next)))
        return passing;
    return latest && used_next(run, latest) >= 0 ? latest : NULL;
}

static int compare_next(const void *a, const void *b)
{
    const struct missing *one = a, *two = b;

    return one->next != two->next     ? (one->next < two->next ? -1 : 1)
           : one->view != two->view   ? one->view - two->view
           : one->phase != two->phase ? one->phase - two->phase
                                      : 0;
}

int run_place_census(struct disparity_run *run, const int *view, int count)
{
    struct census_cache *c = run->cache;
    struct missing *missing;
    int n = 0, err = 0;

    for (int i = c->lasting; i < c->slots; i++)
        evict(run, &c->slot[i]);
    look_ahead(run, view, count);
    missing = malloc((size_t)count_needed(run) * sizeof(*missing));
    if (!missing)
        return -ENOMEM;
    for (int k = 0; k < views_of(run); k++) {
        for (int p = 0; p < SST_PHASES; p++) {
            if (run->need[k] >> p & 1 && !run->desc[k].census[p])
                missing[n++] = (struct missing){ k, p, c->next[k][p] };
        }
    }
    qsort(missing, (size_t)n, sizeof(*missing), compare_next);
    for (int i = 0; !err && i < n; i++) {
        struct census_slot *slot = choose_slot(run, missing[i].next);

        err = slot ? 0 : -ENOMEM;
        if (slot) {
            evict(run, slot);
            slot->view = missing[i].view;
            slot->phase = missing[i].phase;
            slot->stale = true;
        }
    }
    free(missing);
    return err;
}

int run_compute_census(struct disparity_run *run, int view)
{
    const struct census_cache *c = run->cache;
    int err = 0;

    for (int i = 0; !err && i < c->slots; i++) {
        struct census_slot *slot = &c->slot[i];

        if (slot->view == view && slot->stale) {
            slot->stale = false;
            err = sst_descriptor_lend_census(&run->desc[view], slot->phase, slot->data);
        }
    }
    return err;
}
