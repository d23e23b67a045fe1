/* State and status of storage, from reports of the threads; nothing here waits for a disk. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "daemon/storage/storage_internal.h"

#define DAY_NS   INT64_C(86400000000000)
#define LEAST_NS INT64_C(60000000000) /* of recordings, before their rate is known */

static bool hangs(int64_t since_ns, int64_t now_ns)
{
    return since_ns && now_ns - since_ns > SST_STORE_HUNG_NS;
}

/* @return true: it changed */
static bool update_state_locked(struct sst_storage *s)
{
    const int64_t now_ns = sst_clock_now_ns();
    enum store_trouble trouble = s->limit;
    const char *text = s->limit_text;
    char hung[SST_STORE_TEXT];
    bool changed;

    if (s->folder_err) {
        trouble = SST_TROUBLE_FOLDER;
        text = s->folder_text;
    } else if (s->write_err) {
        trouble = SST_TROUBLE_WRITE;
        text = s->write_text;
    } else if (hangs(s->record_busy_ns, now_ns) || hangs(s->retention_busy_ns, now_ns)) {
        trouble = SST_TROUBLE_HUNG;
        snprintf(hung, sizeof(hung), "the disk of %.400s does not answer; check it", s->dir);
        text = hung;
    }
    changed = trouble != s->trouble || (trouble == SST_TROUBLE_FOLDER && strcmp(text, s->reason));
    s->trouble = trouble;
    s->state = trouble >= SST_TROUBLE_LIMIT       ? SST_STORAGE_FULL
               : trouble == SST_TROUBLE_LIMIT_LOW ? SST_STORAGE_LOW
                                                  : SST_STORAGE_OK;
    snprintf(s->reason, sizeof(s->reason), "%s", trouble == SST_TROUBLE_NONE ? "" : text);
    return changed;
}

static const char *state_name(enum sst_storage_state state)
{
    return state == SST_STORAGE_OK ? "OK" : state == SST_STORAGE_LOW ? "LOW" : "FULL";
}

/* Which limit the state is about. */
static const char *limit_name_locked(const struct sst_storage *s)
{
    const bool limit = s->trouble == SST_TROUBLE_LIMIT || s->trouble == SST_TROUBLE_LIMIT_LOW;

    return !limit ? "" : s->limit_quota ? "quota" : "disk";
}

static void report(struct sst_storage *s, enum sst_storage_state state, const char *reason, int64_t free_bytes,
                   int64_t used_bytes)
{
    const enum sst_event_level level = state == SST_STORAGE_FULL ? SST_EVENT_ERROR : SST_EVENT_INFO;

    sst_events_emit(s->events, level, "storage",
                    json_pack("{s:s, s:s, s:I, s:I}", "state", state_name(state), "reason", reason, "free_bytes",
                              (json_int_t)free_bytes, "used_bytes", (json_int_t)used_bytes),
                    "storage is %s%s%s", state_name(state), reason[0] ? ": " : "", reason);
}

void *status_run(void *storage)
{
    struct sst_storage *s = storage;

    pthread_mutex_lock(&s->lock);
    while (!s->stop) {
        if (s->checked_ns && update_state_locked(s)) {
            const enum sst_storage_state state = s->state;
            const int64_t free_bytes = s->free_bytes, used_bytes = s->used_bytes;
            char reason[SST_STORE_TEXT];

            memcpy(reason, s->reason, sizeof(reason));
            pthread_mutex_unlock(&s->lock);
            report(s, state, reason, free_bytes, used_bytes);
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

static json_t *time_json(int64_t wall_ns)
{
    char text[SST_CLOCK_TEXT] = "";

    if (wall_ns)
        sst_clock_text(text, wall_ns);
    return json_string(text);
}

static const char *mode_name(enum sst_record_mode mode)
{
    return mode == SST_RECORD_CONTINUOUS ? "continuous" : mode == SST_RECORD_EVENT ? "event" : "off";
}

static json_t *ring_json(struct sst_storage *s)
{
    struct sst_ring_counters c;
    double seconds;
    int pictures;

    sst_ring_counters(s->ring, &c);
    pthread_mutex_lock(&s->lock);
    pictures = s->history.count;
    pthread_mutex_unlock(&s->lock);
    seconds = c.oldest_ns ? (double)(sst_clock_now_ns() - c.oldest_ns) * 1e-9 : 0;
    return json_pack("{s:I, s:i, s:f, s:i}", "bytes", (json_int_t)c.bytes, "sets", c.sets, "seconds",
                     seconds > 0 ? seconds : 0.0, "pictures", pictures);
}

static json_t *recording_json_locked(const struct sst_storage *s)
{
    struct catalog catalog = s->catalog;
    const struct store_entry *e = s->active_name[0] ? catalog_find(&catalog, s->active_name) : NULL;

    return json_pack("{s:s, s:b, s:b, s:s, s:s, s:o, s:I, s:I}", "mode", mode_name(s->settings.mode), "active",
                     e != NULL, "reduced", e && store_class_of(e) == SST_STORE_REDUCED, "name", s->active_name, "why", e ? s->active_why : "", "since", time_json(e ? e->from_ns : 0),
                     "sets", (json_int_t)s->active_sets, "dropped", (json_int_t)s->dropped);
}

/* Counts of the catalog, by the keys of the status. */
static json_t *counts_json_locked(const struct sst_storage *s)
{
    int64_t count[SST_STORE_KINDS] = { 0 }, manual_bytes = 0, removed = 0;

    for (int i = 0; i < s->catalog.count; i++) {
        const struct store_entry *e = &s->catalog.entry[i];

        count[e->kind]++;
        manual_bytes += store_is_manual(e) ? e->bytes : 0;
    }
    for (int i = 0; i < SST_STORE_KINDS; i++)
        removed += (int64_t)s->removed[i];
    return json_pack("{s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:i}", "recordings", (json_int_t)count[0], "snapshots",
                     (json_int_t)count[1], "exports", (json_int_t)count[2], "by_hand_bytes", (json_int_t)manual_bytes,
                     "by_hand_limit_bytes", (json_int_t)s->manual_bytes, "removed", (json_int_t)removed, "shortened",
                     (json_int_t)s->trimmed, "deleted", (json_int_t)s->deleted, "downloads", s->downloads);
}

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
static json_t *class_json_locked(const struct sst_storage *s, enum store_class class_)
{
    const struct store_limits *l = &s->settings.limits;
    const struct store_room room = { .used_bytes = s->used_bytes, .free_bytes = s->free_bytes };
    const int64_t now_ns = sst_clock_wall_ns(), reduced_bytes = store_reduced_bytes(l, &room);
    const double per_day = bytes_per_day_locked(s, class_, now_ns), age = (double)l->max_age_ns[class_] / DAY_NS;
    int64_t bytes[SST_STORE_CLASSES] = { 0 }, space = store_room_bytes(l, &room), count = 0, oldest_ns = 0;
    double days = NAN;

    for (int i = 0; i < s->catalog.count; i++) {
        const struct store_entry *e = &s->catalog.entry[i];

        bytes[store_class_of(e)] += e->bytes;
        count += store_class_of(e) == class_;
        oldest_ns = store_class_of(e) == class_ && !oldest_ns ? e->from_ns : oldest_ns;
    }
    space -= bytes[SST_STORE_MANUAL];
    if (class_ == SST_STORE_FULL)
        space -= smaller(bytes[SST_STORE_REDUCED], reduced_bytes);
    else if (bytes[SST_STORE_FULL])
        space = smaller(space, reduced_bytes);
    if (per_day > 0 && s->checked_ns)
        days = fmax((double)space, 0) / per_day;
    if (age > 0 && days > age)
        days = age;
    return json_pack("{s:I, s:I, s:o, s:o, s:o}", "recordings", (json_int_t)count, "bytes", (json_int_t)bytes[class_],
                     "oldest", time_json(oldest_ns), "bytes_per_day", per_day > 0 ? json_real(per_day) : json_null(),
                     "fits_days", isnan(days) ? json_null() : json_real(days));
}

json_t *sst_storage_status(struct sst_storage *s)
{
    json_t *o, *counts, *ring = ring_json(s);
    const struct store_entry *oldest = NULL;

    pthread_mutex_lock(&s->lock);
    for (int i = 0; i < s->catalog.count && !oldest; i++) {
        if (s->catalog.entry[i].kind == SST_STORE_RECORDING)
            oldest = &s->catalog.entry[i];
    }
    o = json_pack("{s:s, s:s, s:s, s:s, s:I, s:I, s:I, s:o, s:f, s:o, s:o}", "state", state_name(s->state), "limit",
                  limit_name_locked(s), "reason", s->reason, "dir", s->dir, "free_bytes", (json_int_t)s->free_bytes,
                  "used_bytes", (json_int_t)s->used_bytes, "quota_bytes", (json_int_t)s->settings.limits.quota_bytes,
                  "oldest", time_json(oldest ? oldest->from_ns : 0), "age_s",
                  s->checked_ns ? (double)(sst_clock_now_ns() - s->checked_ns) * 1e-9 : 0.0, "recording",
                  recording_json_locked(s), "ring", ring);
    counts = counts_json_locked(s);
    json_object_set_new(counts, "full", class_json_locked(s, SST_STORE_FULL));
    json_object_set_new(counts, "reduced", class_json_locked(s, SST_STORE_REDUCED));
    pthread_mutex_unlock(&s->lock);
    json_object_update(o, counts);
    json_decref(counts);
    return o;
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
