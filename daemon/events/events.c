/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/events/events.h"

#include <errno.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/uio.h>
#if WITH_SYSTEMD
#include <systemd/sd-journal.h>
#endif

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"

#define WATCHERS 8

struct watcher {
    sst_events_fn *fn;
    void *arg;
};

struct sst_events {
    pthread_mutex_t lock, watch; /* watch is held while watchers are called: unwatch waits for that */
    pthread_cond_t changed;
    bool journal; /* fixed after create: standard error is the journal's */
    int capacity;
    /* under lock */
    char **line; /* [capacity], event id at id % capacity */
    uint64_t last, count[3];
    bool shut;
    /* under watch */
    struct watcher watcher[WATCHERS];
    int watchers;
};

static const char *const level_names[] = { "info", "warning", "error" };

#if WITH_SYSTEMD
/* For `journalctl MESSAGE_ID=`; docs/use/install.md lists them. */
static const struct {
    const char *type, *id;
} message_ids[] = {
    { "state", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a01" },         { "camera-lost", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a02" },
    { "camera-found", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a03" },  { "trigger-lost", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a04" },
    { "trigger-found", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a05" }, { "skew", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a06" },
    { "storage", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a07" },       { "record-start", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a08" },
    { "record-stop", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a09" },   { "motion", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a0a" },
    { "label", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a0b" },         { "snapshot", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a0c" },
    { "export", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a0d" },        { "reload", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a0e" },
    { "calibration", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a0f" },   { "clock", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a10" },
    { "client", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a11" },        { "start", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a12" },
    { "stop", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a13" },          { "certificate", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a14" },
    { "visit", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a15" },         { "line", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a16" },
    { "host-lost", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a17" },     { "host-found", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a18" },
    { "device-lost", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a19" },   { "device-found", "5f6c1b6d2a5a4f0f9f0c6a6e0b7d1a1a" },
};
#endif

int sst_events_create(struct sst_events **out, int capacity)
{
    struct sst_events *e;

    if (capacity < 1)
        return -EINVAL;
    e = calloc(1, sizeof(*e));
    if (!e)
        return -ENOMEM;
    e->capacity = capacity;
    e->journal = WITH_SYSTEMD && getenv("JOURNAL_STREAM") != NULL;
    e->line = calloc((size_t)capacity, sizeof(*e->line));
    if (!e->line) {
        free(e);
        return -ENOMEM;
    }
    pthread_mutex_init(&e->lock, NULL);
    pthread_mutex_init(&e->watch, NULL);
    sst_cond_init(&e->changed);
    *out = e;
    return 0;
}

#if WITH_SYSTEMD
static void to_journal(enum sst_event_level level, const char *type, const json_t *data, const char *message)
{
    static const int priority[] = { 6, 4, 3 };
    const json_t *row = json_object_get(data, "row"), *col = json_object_get(data, "col"),
                 *set = json_object_get(data, "set");
    char text[6][512];
    struct iovec field[6];
    int n = 0;

    snprintf(text[n++], sizeof(text[0]), "MESSAGE=%s", message);
    snprintf(text[n++], sizeof(text[0]), "PRIORITY=%d", priority[level]);
    snprintf(text[n++], sizeof(text[0]), "SST_EVENT=%s", type);
    for (size_t i = 0; i < ARRAY_LEN(message_ids); i++)
        if (!strcmp(type, message_ids[i].type))
            snprintf(text[n++], sizeof(text[0]), "MESSAGE_ID=%s", message_ids[i].id);
    if (json_is_integer(row) && json_is_integer(col))
        snprintf(text[n++], sizeof(text[0]), "CAMERA=r%dc%d", (int)json_integer_value(row),
                 (int)json_integer_value(col));
    if (json_is_integer(set))
        snprintf(text[n++], sizeof(text[0]), "SET=%lld", (long long)json_integer_value(set));
    for (int i = 0; i < n; i++)
        field[i] = (struct iovec){ text[i], strlen(text[i]) };
    sd_journal_sendv(field, n);
}
#endif

static void show(const struct sst_events *e, enum sst_event_level level, const char *type, const json_t *data,
                 const char *message)
{
#if WITH_SYSTEMD
    if (e->journal) {
        to_journal(level, type, data, message);
        return;
    }
#else
    (void)e;
    (void)type;
    (void)data;
#endif
    char *held = sst_log_hold_errors(NULL); /* an event is no message of its thread's work */

    if (level == SST_EVENT_ERROR)
        sst_log_error("%s", message);
    else if (level == SST_EVENT_WARNING)
        sst_log_warning("%s", message);
    else
        sst_log_info("%s", message);
    sst_log_hold_errors(held);
}

static void call_watchers(struct sst_events *e)
{
    pthread_mutex_lock(&e->watch);
    for (int i = 0; i < e->watchers; i++)
        e->watcher[i].fn(e->watcher[i].arg);
    pthread_mutex_unlock(&e->watch);
}

void sst_events_emit(struct sst_events *e, enum sst_event_level level, const char *type, json_t *data, const char *fmt,
                     ...)
{
    const int64_t wall_ns = sst_clock_wall_ns();
    char message[256], when[SST_CLOCK_TEXT];
    json_t *o;
    va_list args;

    va_start(args, fmt);
    vsnprintf(message, sizeof(message), fmt, args);
    va_end(args);
    sst_clock_text(when, wall_ns);
    show(e, level, type, data, message);
    if (!data)
        data = json_object();
    o = json_pack("{s:s, s:s, s:s, s:s%, s:o?}", "time", when, "level", level_names[level], "type", type, "message",
                  message, strlen(message), "data", data);

    pthread_mutex_lock(&e->lock);
    e->count[level]++;
    if (o) { /* without memory, or with a message that is no UTF-8, the journal has it */
        char **line = &e->line[(e->last + 1) % (uint64_t)e->capacity];

        json_object_set_new(o, "id", json_integer((json_int_t)(e->last + 1)));
        free(*line);
        *line = json_dumps(o, JSON_COMPACT | JSON_REAL_PRECISION(9));
        e->last++;
        pthread_cond_broadcast(&e->changed);
    }
    pthread_mutex_unlock(&e->lock);
    json_decref(o);
    call_watchers(e);
}

bool sst_events_next(struct sst_events *e, uint64_t after, uint64_t *id, char **json)
{
    const uint64_t room = (uint64_t)e->capacity;
    bool found = false;

    pthread_mutex_lock(&e->lock);
    if (e->last > room && after < e->last - room)
        after = e->last - room; /* older ones are gone */
    for (uint64_t i = after + 1; i <= e->last && !found; i++) {
        char *copy = e->line[i % room] ? strdup(e->line[i % room]) : NULL;

        if (copy) {
            *id = i;
            *json = copy;
            found = true;
        }
    }
    pthread_mutex_unlock(&e->lock);
    return found;
}

bool sst_events_wait(struct sst_events *e, uint64_t after, int timeout_ms)
{
    const int64_t end_ns = sst_clock_now_ns() + (int64_t)timeout_ms * 1000000;
    bool there;

    pthread_mutex_lock(&e->lock);
    while (!e->shut && e->last <= after && sst_cond_wait_until(&e->changed, &e->lock, end_ns))
        ;
    there = !e->shut && e->last > after;
    pthread_mutex_unlock(&e->lock);
    return there;
}

uint64_t sst_events_last(struct sst_events *e)
{
    uint64_t last;

    pthread_mutex_lock(&e->lock);
    last = e->last;
    pthread_mutex_unlock(&e->lock);
    return last;
}

int sst_events_watch(struct sst_events *e, sst_events_fn *fn, void *arg)
{
    int err = 0;

    pthread_mutex_lock(&e->watch);
    if (e->watchers < WATCHERS)
        e->watcher[e->watchers++] = (struct watcher){ fn, arg };
    else
        err = -ENOSPC;
    pthread_mutex_unlock(&e->watch);
    return err;
}

void sst_events_unwatch(struct sst_events *e, sst_events_fn *fn, void *arg)
{
    pthread_mutex_lock(&e->watch);
    for (int i = 0; i < e->watchers; i++)
        if (e->watcher[i].fn == fn && e->watcher[i].arg == arg) {
            e->watcher[i] = e->watcher[--e->watchers];
            break;
        }
    pthread_mutex_unlock(&e->watch);
}

void sst_events_counts(struct sst_events *e, uint64_t count[3])
{
    pthread_mutex_lock(&e->lock);
    memcpy(count, e->count, sizeof(e->count));
    pthread_mutex_unlock(&e->lock);
}

void sst_events_shut(struct sst_events *e)
{
    pthread_mutex_lock(&e->lock);
    e->shut = true;
    pthread_cond_broadcast(&e->changed);
    pthread_mutex_unlock(&e->lock);
    call_watchers(e);
}

void sst_events_destroy(struct sst_events *e)
{
    if (!e)
        return;
    for (int i = 0; i < e->capacity; i++)
        free(e->line[i]);
    free(e->line);
    pthread_cond_destroy(&e->changed);
    pthread_mutex_destroy(&e->watch);
    pthread_mutex_destroy(&e->lock);
    free(e);
}
