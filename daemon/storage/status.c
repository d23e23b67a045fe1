/* State and status of storage, from reports of the threads; nothing here waits for a disk. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "daemon/storage/storage_internal.h"

#define ROW   SST_FIELD
#define GROUP SST_FIELD_GROUP

#define DAY_NS   INT64_C(86400000000000)
#define LEAST_NS INT64_C(60000000000) /* of recordings, before their rate is known */

static bool hangs(int64_t since_ns, int64_t now_ns)
{
    return since_ns && now_ns - since_ns > SST_STORE_HUNG_NS;
}

/* The worst trouble at this moment, with its text. */
static enum store_trouble trouble_locked(const struct sst_storage *s, char text[SST_STORE_TEXT])
{
    const int64_t now_ns = sst_clock_now_ns();

    if (s->folder_err) {
        memcpy(text, s->folder_text, SST_STORE_TEXT);
        return SST_TROUBLE_FOLDER;
    }
    if (s->write_err) {
        memcpy(text, s->write_text, SST_STORE_TEXT);
        return SST_TROUBLE_WRITE;
    }
    if (hangs(s->record_busy_ns, now_ns) || hangs(s->retention_busy_ns, now_ns)) {
        snprintf(text, SST_STORE_TEXT, "the disk of %.400s does not answer; check it", s->dir);
        return SST_TROUBLE_HUNG;
    }
    if (s->no_muxer && s->limit != SST_TROUBLE_LIMIT) {
        snprintf(text, SST_STORE_TEXT, "%s", SST_STORE_NO_MUXER);
        return SST_TROUBLE_LIBRARY;
    }
    snprintf(text, SST_STORE_TEXT, "%s", s->limit == SST_TROUBLE_NONE ? "" : s->limit_text);
    return s->limit;
}

static enum sst_storage_state state_of(enum store_trouble trouble)
{
    return trouble >= SST_TROUBLE_LIMIT       ? SST_STORAGE_FULL
           : trouble == SST_TROUBLE_LIMIT_LOW ? SST_STORAGE_LOW
                                              : SST_STORAGE_OK;
}

/* @return true: it changed */
static bool update_state_locked(struct sst_storage *s)
{
    char text[SST_STORE_TEXT];
    const enum store_trouble trouble = trouble_locked(s, text);
    const bool changed = trouble != s->trouble || (trouble == SST_TROUBLE_FOLDER && strcmp(text, s->reason));

    s->trouble = trouble;
    s->state = state_of(trouble);
    memcpy(s->reason, text, sizeof(s->reason));
    return changed;
}

static const char *const state_names[] = { "OK", "LOW", "FULL" };
static const char *const limit_names[] = { "", "quota", "disk" };
static const char *const kind_names[] = { "recordings", "snapshots", "exports" };
static const char *const mode_names[] = { "off", "continuous", "event" };

static void report(struct sst_storage *s, enum store_trouble trouble, const char *reason, int64_t free_bytes,
                   int64_t used_bytes)
{
    const enum sst_storage_state state = state_of(trouble);
    const enum sst_event_level level = state == SST_STORAGE_FULL ? SST_EVENT_ERROR : SST_EVENT_INFO;
    const char *is = trouble == SST_TROUBLE_LIBRARY ? "nothing can be recorded"
                     : trouble > SST_TROUBLE_LIMIT  ? "nothing can be stored"
                     : state == SST_STORAGE_FULL    ? "storage is FULL"
                     : state == SST_STORAGE_LOW     ? "storage is LOW"
                                                    : "storage is OK";

    sst_events_emit(s->events, level, "storage",
                    json_pack("{s:s, s:s, s:I, s:I}", "state", state_names[state], "reason", reason, "free_bytes",
                              (json_int_t)free_bytes, "used_bytes", (json_int_t)used_bytes),
                    "%s%s%s", is, reason[0] ? ": " : "", reason);
}

void *status_run(void *storage)
{
    struct sst_storage *s = storage;

    pthread_mutex_lock(&s->lock);
    while (!s->stop) {
        if (s->checked_ns && update_state_locked(s)) {
            const enum store_trouble trouble = s->trouble;
            const int64_t free_bytes = s->free_bytes, used_bytes = s->used_bytes;
            char reason[SST_STORE_TEXT];

            memcpy(reason, s->reason, sizeof(reason));
            pthread_mutex_unlock(&s->lock);
            report(s, trouble, reason, free_bytes, used_bytes);
            pthread_mutex_lock(&s->lock);
        }
        store_wait_locked(s, 250);
    }
    pthread_mutex_unlock(&s->lock);
    store_thread_ends(s);
    return NULL;
}

enum sst_storage_state sst_storage_state(struct sst_storage *s)
{
    enum sst_storage_state state;

    pthread_mutex_lock(&s->lock);
    state = s->state;
    pthread_mutex_unlock(&s->lock);
    return state;
}

/* --- status ------------------------------------------------------------------------------------------------- */

#define IN struct sst_storage_class
static const struct sst_field class_fields[] = {
    ROW("recordings", INTEGER, recordings, "Number of recordings"),
    ROW("bytes", INTEGER, bytes, "Size of them"),
    ROW("oldest", TIME, oldest_ns, "Beginning of the oldest, or \"\""),
    ROW("bytes_per_day", REAL, bytes_per_day, "Growth over the last 24 hours", .nullable = true),
    ROW("fits_days", REAL, fits_days, "Days for which there is room at this rate", .nullable = true),
    { 0 },
};
#undef IN

#define IN struct sst_storage_report
const struct sst_field sst_storage_fields[] = {
    ROW("state", CHOICE, state, "State of storage", "storage_state", .label = "state", .names = state_names,
        ARRAY_LEN(state_names)),
    ROW("limit", CHOICE, limit,
        "The limit that LOW or FULL is about: storage.quota_gb or storage.min_free_gb. LOW by "
        "quota is the usual state of a loop of recordings",
        .names = limit_names, ARRAY_LEN(limit_names)),
    ROW("reason", TEXT, reason, "Cause of a state other than OK, or \"\""),
    ROW("dir", NAME, dir, "storage.dir of the configuration"),
    ROW("free_bytes", INTEGER, free_bytes, "Free space", "storage_free_bytes"),
    ROW("used_bytes", INTEGER, used_bytes, "Taken by recordings, snapshots and exports", "storage_used_bytes"),
    ROW("quota_bytes", INTEGER, quota_bytes, "storage.quota_gb of the configuration; 0: no limit"),
    ROW("oldest", TIME, oldest_ns, "Beginning of the oldest recording, or \"\""),
    ROW("age_s", REAL, age_s, "Seconds since the disk was last looked at"),
    GROUP("recording", "The recording being made",
          ROW("mode", CHOICE, mode, "storage.mode of the configuration", .names = mode_names, ARRAY_LEN(mode_names)),
          ROW("active", BOOL, active, "Something is recorded", "recording"),
          ROW("reduced", BOOL, is_reduced, "One of some sets, which goes on while no other is made"),
          ROW("name", TEXT, name, "Name of the recording, or \"\""),
          ROW("why", TEXT, why, "Reason for the recording, or \"\""),
          ROW("since", TIME, since_ns, "Time of its first set, or \"\""),
          ROW("sets", INTEGER, sets, "Sets in it", "recording_sets"),
          ROW("dropped", INTEGER, dropped, "Sets that it lacks", "recording_dropped")),
    GROUP("ring", "Sets in memory, from which recordings on event begin",
          ROW("bytes", INTEGER, ring.bytes, "Memory in use"), ROW("sets", INTEGER, ring.sets, "Sets in memory"),
          ROW("seconds", REAL, ring_s, "Age of the oldest set"),
          ROW("pictures", INTEGER, pictures, "Pictures of the main view in memory")),
    ROW("", MAP, kind, "Stored items, by kind", "storage_kept", .label = "kind", .item = SST_FIELD_INTEGER,
        .names = kind_names, ARRAY_LEN(kind_names), sizeof(int64_t)),
    ROW("by_hand_bytes", INTEGER, manual_bytes, "Taken by items made by hand", "storage_by_hand_bytes"),
    ROW("by_hand_limit_bytes", INTEGER, manual_limit_bytes, "Up to this it outlives the rest",
        "storage_by_hand_limit_bytes"),
    ROW("removed", INTEGER, removed, "Removed to keep within the limits", "storage_removed_total"),
    ROW("shortened", INTEGER, trimmed,
        "Segments of recordings removed because of the limits, while the rest of the recording stays"),
    ROW("deleted", INTEGER, deleted, "Deleted by hand", "storage_deleted_total"),
    ROW("downloads", INTEGER, downloads, "Downloads at work", "storage_downloads"),
    ROW("full", OBJECT, full, "Automatic recordings of all sets", .of = class_fields),
    ROW("reduced", OBJECT, reduced, "Automatic recordings of some sets (storage.reduced)", .of = class_fields),
    { 0 },
};
#undef IN

static int64_t smaller(int64_t a, int64_t b)
{
    return a < b ? a : b;
}

/* Bytes a day of a class: of the last day, or of all its time if nothing was recorded since. 0: unknown. */
static double bytes_per_day_locked(const struct sst_storage *s, enum store_class class_, int64_t now_ns)
{
    double recent = 0, all = 0;
    int64_t oldest_ns = INT64_MAX;

    for (int i = 0; i < s->catalog.count; i++) {
        const struct store_entry *e = &s->catalog.entry[i];
        const int64_t length_ns = e->to_ns - e->from_ns, since_ns = now_ns - DAY_NS;

        if (store_class_of(e) != class_ || !e->from_ns || e->to_ns > now_ns || length_ns < 0)
            continue;
        oldest_ns = e->from_ns < oldest_ns ? e->from_ns : oldest_ns;
        all += (double)e->bytes;
        if (e->from_ns >= since_ns)
            recent += (double)e->bytes;
        else if (e->to_ns > since_ns)
            recent += (double)e->bytes * (double)(e->to_ns - since_ns) / (double)length_ns;
    }
    if (oldest_ns > now_ns - LEAST_NS)
        return 0;
    if (recent > 0)
        return recent * (double)DAY_NS / (double)smaller(now_ns - oldest_ns, DAY_NS);
    return all * (double)DAY_NS / (double)(now_ns - oldest_ns);
}

/* Full and reduced recordings, and for how many days there is room at the present rate. */
static struct sst_storage_class class_of_locked(const struct sst_storage *s, enum store_class class_)
{
    const struct store_limits *l = &s->settings.limits;
    const struct store_room room = { .used_bytes = s->used_bytes, .free_bytes = s->free_bytes };
    const int64_t now_ns = sst_clock_wall_ns(), reduced_bytes = store_reduced_bytes(l, &room);
    const double per_day = bytes_per_day_locked(s, class_, now_ns), age = (double)l->max_age_ns[class_] / DAY_NS;
    struct sst_storage_class out = { .bytes_per_day = per_day > 0 ? per_day : NAN, .fits_days = NAN };
    int64_t bytes[SST_STORE_CLASSES] = { 0 }, space = store_room_bytes(l, &room);

    for (int i = 0; i < s->catalog.count; i++) {
        const struct store_entry *e = &s->catalog.entry[i];
        const bool mine = store_class_of(e) == class_;

        bytes[store_class_of(e)] += e->bytes;
        out.recordings += mine;
        out.oldest_ns = mine && !out.oldest_ns ? e->from_ns : out.oldest_ns;
    }
    space -= bytes[SST_STORE_MANUAL];
    if (class_ == SST_STORE_FULL)
        space -= smaller(bytes[SST_STORE_REDUCED], reduced_bytes);
    else if (bytes[SST_STORE_FULL])
        space = smaller(space, reduced_bytes);
    out.bytes = bytes[class_];
    if (per_day > 0 && s->checked_ns)
        out.fits_days = fmax((double)space, 0) / per_day;
    if (age > 0 && out.fits_days > age)
        out.fits_days = age;
    return out;
}

static void count_locked(const struct sst_storage *s, struct sst_storage_report *out)
{
    for (int i = 0; i < s->catalog.count; i++) {
        const struct store_entry *e = &s->catalog.entry[i];

        if (e->kind == SST_STORE_RECORDING && !out->kind[SST_STORE_RECORDING]++)
            out->oldest_ns = e->from_ns;
        else if (e->kind != SST_STORE_RECORDING)
            out->kind[e->kind]++;
        out->manual_bytes += store_is_manual(e) ? e->bytes : 0;
    }
    for (int i = 0; i < SST_STORE_KINDS; i++)
        out->removed += s->removed[i];
    out->full = class_of_locked(s, SST_STORE_FULL);
    out->reduced = class_of_locked(s, SST_STORE_REDUCED);
}

void sst_storage_report(struct sst_storage *s, struct sst_storage_report *out)
{
    const struct store_entry *e;
    struct catalog catalog;
    int64_t now_ns;
    enum store_trouble trouble;

    *out = (struct sst_storage_report){ .dir = s->dir };
    sst_ring_counters(s->ring, &out->ring);
    pthread_mutex_lock(&s->lock);
    now_ns = sst_clock_now_ns();
    if (out->ring.oldest_ns && out->ring.oldest_ns < now_ns)
        out->ring_s = (double)(now_ns - out->ring.oldest_ns) * 1e-9;
    catalog = s->catalog;
    e = s->active_name[0] ? catalog_find(&catalog, s->active_name) : NULL;
    /* As it is now: a client that was refused asks before sst-state has reported it. */
    trouble = trouble_locked(s, out->reason);
    out->state = state_of(trouble);
    out->limit = trouble != SST_TROUBLE_LIMIT && trouble != SST_TROUBLE_LIMIT_LOW ? 0 : s->limit_quota ? 1 : 2;
    out->free_bytes = s->free_bytes;
    out->used_bytes = s->used_bytes;
    out->quota_bytes = s->settings.limits.quota_bytes;
    out->age_s = s->checked_ns ? (double)(now_ns - s->checked_ns) * 1e-9 : 0;
    out->mode = s->settings.mode;
    out->active = e != NULL;
    out->is_reduced = e && store_class_of(e) == SST_STORE_REDUCED;
    snprintf(out->name, sizeof(out->name), "%s", s->active_name);
    snprintf(out->why, sizeof(out->why), "%s", e ? s->active_why : "");
    out->since_ns = e ? e->from_ns : 0;
    out->sets = s->active_sets;
    out->dropped = s->dropped;
    out->pictures = s->history.count;
    out->manual_limit_bytes = s->manual_bytes;
    out->trimmed = s->trimmed;
    out->deleted = s->deleted;
    out->downloads = s->downloads;
    count_locked(s, out);
    pthread_mutex_unlock(&s->lock);
}

/* --- stored items --------------------------------------------------------------------------------------------- */

static json_t *time_json(int64_t wall_ns)
{
    char text[SST_CLOCK_TEXT] = "";

    if (wall_ns)
        sst_clock_text(text, wall_ns);
    return json_string(text);
}

/* The beginning may have been removed since. */
static int64_t view_from(const struct store_entry *e)
{
    return e->picture && e->view_ns ? (e->view_ns > e->from_ns ? e->view_ns : e->from_ns) : 0;
}

static json_t *entry_json(const struct store_entry *e)
{
    const bool active = e->stage == SST_STORE_ACTIVE;

    if (e->kind == SST_STORE_RECORDING)
        return json_pack("{s:s, s:o, s:o, s:I, s:I, s:s, s:b, s:b, s:o, s:b}", "name", e->name, "from",
                         time_json(e->from_ns), "to", time_json(e->to_ns), "sets", (json_int_t)e->sets, "bytes",
                         (json_int_t)e->bytes, "why", e->why, "by_hand", store_is_manual(e), "view", e->picture,
                         "view_from", time_json(view_from(e)), "active", active);
    return json_pack("{s:s, s:o, s:I, s:b, s:b}", "name", e->name, "time", time_json(e->from_ns), "bytes",
                     (json_int_t)e->bytes, "picture", e->picture, "active", active);
}

json_t *sst_storage_list(struct sst_storage *s)
{
    json_t *list[SST_STORE_KINDS];
    bool good = true;

    for (int i = 0; i < SST_STORE_KINDS; i++)
        good &= (list[i] = json_array()) != NULL;
    pthread_mutex_lock(&s->lock);
    for (int i = 0; good && i < s->catalog.count; i++) {
        const struct store_entry *e = &s->catalog.entry[i];

        if (!e->deleted_by_hand)
            good = !json_array_append_new(list[e->kind], entry_json(e));
    }
    pthread_mutex_unlock(&s->lock);
    if (good)
        return json_pack("{s:o, s:o, s:o}", "recordings", list[0], "snapshots", list[1], "exports", list[2]);
    for (int i = 0; i < SST_STORE_KINDS; i++)
        json_decref(list[i]);
    return NULL;
}
