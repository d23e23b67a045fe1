/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/storage/storage_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/mem.h"

#define PLAUSIBLE_NS (INT64_C(1767225600) * 1000000000) /* 2026-01-01: no clock that was set is earlier */
#define SLACK_NS     (INT64_C(3600) * 1000000000)       /* for pre-roll and length */

static bool is_before(const struct store_entry *a, const struct store_entry *b)
{
    return a->order < b->order || (a->order == b->order && a->made_ns < b->made_ns);
}

int catalog_add(struct catalog *c, const struct store_entry *entry)
{
    int at = c->count;

    if (!sst_mem_grow(&c->entry, c->count, &c->capacity, sizeof(*c->entry)))
        return -ENOMEM;
    while (at > 0 && is_before(entry, &c->entry[at - 1]))
        at--;
    memmove(&c->entry[at + 1], &c->entry[at], (size_t)(c->count - at) * sizeof(*c->entry));
    c->entry[at] = *entry;
    c->count++;
    if (entry->order > c->order)
        c->order = entry->order;
    return 0;
}

void catalog_remove(struct catalog *c, const char *name)
{
    const struct store_entry *e = catalog_find(c, name);
    const int at = e ? (int)(e - c->entry) : c->count;

    if (!e)
        return;
    memmove(&c->entry[at], &c->entry[at + 1], (size_t)(c->count - at - 1) * sizeof(*c->entry));
    c->count--;
}

void catalog_update(struct catalog *c, const struct store_entry *entry)
{
    struct store_entry *e = catalog_find(c, entry->name), made = *entry;

    if (!e)
        return;
    made.readers = e->readers;
    made.deleted_by_hand = e->deleted_by_hand;
    *e = made;
}

struct store_entry *catalog_find(struct catalog *c, const char *name)
{
    for (int i = 0; i < c->count; i++) {
        if (!strcmp(c->entry[i].name, name))
            return &c->entry[i];
    }
    return NULL;
}

void catalog_fini(struct catalog *c)
{
    free(c->entry);
    *c = (struct catalog){ 0 };
}

bool store_name_good(const char *name)
{
    static const char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-.";
    const size_t n = strlen(name);

    return n > 0 && n < SST_STORE_NAME && name[0] != '.' && strspn(name, letters) == n;
}

bool store_is_manual(const struct store_entry *e)
{
    return e->kind != SST_STORE_RECORDING || !strcmp(e->why, SST_STORE_ON_DEMAND);
}

const char *store_prefix(enum store_kind kind)
{
    return kind == SST_STORE_SNAPSHOT ? "snapshot-" : kind == SST_STORE_EXPORT ? "export-" : "";
}

void store_name(char out[SST_STORE_NAME], enum store_kind kind, int64_t wall_ns, int attempt)
{
    const time_t s = (time_t)(wall_ns / 1000000000);
    struct tm tm = { 0 };
    char date[32], suffix[16] = "";

    /* Four digits of year, whatever the clock. */
    if (!gmtime_r(&s, &tm) || tm.tm_year < 0 || tm.tm_year > 8099 ||
        !strftime(date, sizeof(date), "%Y-%m-%dT%H-%M-%SZ", &tm))
        snprintf(date, sizeof(date), "0000-00-00T00-00-00Z");
    if (attempt > 1)
        snprintf(suffix, sizeof(suffix), "-%d", attempt);
    snprintf(out, SST_STORE_NAME, "%s%s%s", store_prefix(kind), date, suffix);
}

static bool may_go(const struct store_entry *e)
{
    return e->stage == SST_STORE_DONE || e->stage == SST_STORE_TORN;
}

/* May its oldest segments be removed while it is being written? */
static bool may_be_trimmed(const struct store_entry *e)
{
    return e->kind == SST_STORE_RECORDING && e->stage == SST_STORE_ACTIVE && e->segments > SST_STORE_SEGMENTS;
}

enum store_class store_class_of(const struct store_entry *e)
{
    return store_is_manual(e)                      ? SST_STORE_MANUAL
           : !strcmp(e->why, SST_STORE_REDUCED_WHY) ? SST_STORE_REDUCED
                                                   : SST_STORE_FULL;
}

/* The first of a class to remove; -1: none. */
static int oldest(const struct catalog *c, enum store_class class_)
{
    int read = -1, written = -1;

    for (int i = 0; i < c->count; i++) {
        const struct store_entry *e = &c->entry[i];

        if (store_class_of(e) != class_)
            continue;
        if (may_go(e) && !e->readers)
            return i;
        if (may_go(e) && read < 0)
            read = i;
        if (may_be_trimmed(e))
            written = i; /* at most one is active */
    }
    return read >= 0 ? read : written;
}

int64_t store_room_bytes(const struct store_limits *l, const struct store_room *room)
{
    const int64_t disk = room->used_bytes + room->free_bytes - l->min_free_bytes;

    return l->quota_bytes && l->quota_bytes < disk ? l->quota_bytes : disk;
}

int64_t store_manual_bytes(const struct store_limits *l, const struct store_room *room)
{
    return l->manual_bytes ? l->manual_bytes : store_room_bytes(l, room) / 2;
}

int64_t store_reduced_bytes(const struct store_limits *l, const struct store_room *room)
{
    return l->reduced_bytes ? l->reduced_bytes : store_room_bytes(l, room) / 3;
}

int64_t store_download_bytes(const struct store_limits *l, const struct store_room *room, int64_t made_bytes)
{
    const int64_t part = store_room_bytes(l, room) / 10 - made_bytes, disk = room->free_bytes - l->margin_bytes;
    int64_t most = room->free_bytes - l->min_free_bytes;

    if (l->quota_bytes && l->quota_bytes - room->used_bytes < most)
        most = l->quota_bytes - room->used_bytes;
    most = most > part ? most : part;
    return most < disk ? most : disk;
}

static int too_much(const struct catalog *c, const struct store_limits *limits, const struct store_room *room)
{
    const int full = oldest(c, SST_STORE_FULL), reduced = oldest(c, SST_STORE_REDUCED),
              manual = oldest(c, SST_STORE_MANUAL);
    int64_t bytes[SST_STORE_CLASSES] = { 0 };

    for (int i = 0; i < c->count; i++)
        bytes[store_class_of(&c->entry[i])] += c->entry[i].bytes;
    if (manual >= 0 && bytes[SST_STORE_MANUAL] > store_manual_bytes(limits, room))
        return manual;
    if (reduced >= 0 && bytes[SST_STORE_REDUCED] > store_reduced_bytes(limits, room))
        return reduced;
    return full >= 0 ? full : reduced >= 0 ? reduced : manual;
}

/* Was the clock not set yet, or set wrong? Entries are made in their order, and none in the future. */
static bool is_doubtful(int64_t end_ns, int64_t before_ns, int64_t wall_ns)
{
    return end_ns < PLAUSIBLE_NS || end_ns - SLACK_NS > wall_ns || end_ns < before_ns - SLACK_NS;
}

/* Of each class; -1: none. */
static void find_newest(const struct catalog *c, int newest[SST_STORE_CLASSES])
{
    for (int k = 0; k < SST_STORE_CLASSES; k++)
        newest[k] = -1;
    for (int i = 0; i < c->count; i++)
        newest[store_class_of(&c->entry[i])] = i;
}

/* An entry with a doubtful time is as old as the next one with a plausible time. */
static int too_old(const struct catalog *c, const struct store_limits *limits, const struct store_room *room)
{
    const int64_t *age_ns = limits->max_age_ns;
    int newest[SST_STORE_CLASSES], waits[SST_STORE_CLASSES] = { -1, -1, -1 }; /* depend on the time of the next entry */
    int64_t before_ns = 0; /* the latest beginning so far that is in the past */

    find_newest(c, newest);
    for (int i = 0; i < c->count; i++) {
        const struct store_entry *e = &c->entry[i];
        const bool recording = e->kind == SST_STORE_RECORDING;
        const enum store_class class_ = store_class_of(e);
        const int64_t begin_ns = recording ? e->from_ns : e->made_ns, end_ns = recording ? e->to_ns : e->made_ns;

        if (end_ns && may_go(e) && i != newest[class_] && age_ns[class_] && waits[class_] < 0)
            waits[class_] = i;
        if (end_ns && !is_doubtful(end_ns, before_ns, room->wall_ns)) {
            for (int k = 0; k < SST_STORE_CLASSES; k++) {
                if (waits[k] >= 0 && end_ns < room->wall_ns - age_ns[k])
                    return waits[k];
                waits[k] = -1;
            }
        }
        if (e->order && begin_ns > before_ns && begin_ns <= room->wall_ns)
            before_ns = begin_ns;
    }
    return -1;
}

enum store_verdict store_judge(const struct catalog *c, const struct store_limits *limits,
                               const struct store_room *room, int *victim)
{
    const bool quota = limits->quota_bytes && room->used_bytes > limits->quota_bytes - limits->margin_bytes;
    const bool low = limits->min_free_bytes && room->free_bytes < limits->min_free_bytes + limits->margin_bytes;
    int first = quota || low ? too_much(c, limits, room) : -1;

    if (first >= 0) {
        *victim = first;
        return SST_STORE_TOO_MUCH;
    }
    if ((limits->quota_bytes &&
         (room->used_bytes >= limits->quota_bytes || room->used_bytes + room->waiting_bytes > limits->quota_bytes)) ||
        (limits->min_free_bytes && room->free_bytes < limits->min_free_bytes))
        return SST_STORE_NO_ROOM;
    first = room->clock_steady ? too_old(c, limits, room) : -1;
    if (first < 0)
        return SST_STORE_FITS;
    *victim = first;
    return SST_STORE_TOO_OLD;
}
