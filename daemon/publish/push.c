/* Web Push: one thread follows the events and sends. Messages wait in a bounded queue; when it is full the oldest is dropped. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/publish/push.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "base/text.h"
#include "base/thread.h"
#include "daemon/publish/publish_internal.h"
#include "daemon/publish/push_internal.h"

#define QUEUE       64
#define TRIES       3
#define TTL_S       600 /* for which the push service keeps a message of a browser that is not there */
#define TOKEN_S     (12 * 3600)
#define BACK_OFF_NS INT64_C(2000000000) /* before the second try; ten times as long before the third */
#define RETRY_S     300                 /* that a server may ask for */
#define KEY_FILE    "push-key.pem"
#define LIST_FILE   "push.json"
#define LOG_NS      INT64_C(600000000000) /* between lines about failures */

struct message {
    char endpoint[PUSH_ENDPOINT];
    char *text; /* JSON */
    int tries;
    int64_t due_ns;
};

struct sst_push {
    /* fixed after open */
    struct sst_events *events;
    char key_path[SST_PATH_MAX], list_path[SST_PATH_MAX], page[512];
    pthread_t thread;
    pthread_mutex_t lock;
    /* under bell: events never wait for the disk, which `lock` is held for */
    pthread_mutex_t bell;
    pthread_cond_t wake;
    bool rung; /* events have come, or there is something to send */
    /* under lock */
    struct sst_push_settings settings;
    char site[128];
    struct push_subscription list[SST_PUSH_MAX];
    int count;
    struct message queue[QUEUE];
    int queued;
    bool stop;
    uint64_t sent, failed;
    /* thread only */
    uint64_t seen;     /* id of the last event */
    int64_t logged_ns; /* of the last line about a failure; 0: none */
};

static void ring(void *arg)
{
    struct sst_push *p = arg;

    pthread_mutex_lock(&p->bell);
    p->rung = true;
    pthread_cond_broadcast(&p->wake);
    pthread_mutex_unlock(&p->bell);
}

/* --- the queue ---------------------------------------------------------------------------------------------------- */

static void remove_message_locked(struct sst_push *p, int i)
{
    free(p->queue[i].text);
    memmove(&p->queue[i], &p->queue[i + 1], (size_t)(--p->queued - i) * sizeof(p->queue[0]));
}

static void enqueue_locked(struct sst_push *p, const char *endpoint, const char *text)
{
    struct message *m;
    char *copy = strdup(text);

    if (!copy)
        return;
    if (p->queued == QUEUE) {
        remove_message_locked(p, 0);
        p->failed++;
    }
    m = &p->queue[p->queued++];
    *m = (struct message){ .text = copy };
    snprintf(m->endpoint, sizeof(m->endpoint), "%s", endpoint);
    ring(p);
}

static int find_locked(const struct sst_push *p, const char *endpoint)
{
    for (int i = 0; i < p->count; i++)
        if (!strcmp(p->list[i].endpoint, endpoint))
            return i;
    return -1;
}

static int save_locked(struct sst_push *p)
{
    return push_write(p->list_path, p->list, p->count);
}

static void remove_locked(struct sst_push *p, int i)
{
    for (int k = p->queued; k-- > 0;)
        if (!strcmp(p->queue[k].endpoint, p->list[i].endpoint))
            remove_message_locked(p, k);
    memmove(&p->list[i], &p->list[i + 1], (size_t)(--p->count - i) * sizeof(p->list[0]));
}

/* --- events ------------------------------------------------------------------------------------------------------- */

static const char *text_of(const json_t *o, const char *key)
{
    const char *text = json_string_value(json_object_get(o, key));

    return text ? text : "";
}

/* Is a name in the list of a filter? */
static bool has_name(const char *list, const char *name)
{
    char key[128];

    snprintf(key, sizeof(key), ",%.120s,", name);
    return !list[0] || (name[0] && strstr(list, key));
}

static bool wants(const struct push_subscription *s, const json_t *data, bool line)
{
    const json_t *zones = json_object_get(data, "zones"), *zone;
    bool found = !s->zones[0];
    size_t i;

    if (!has_name(s->labels, text_of(data, "label")))
        return false;
    if (line)
        return s->zones[0] && has_name(s->zones, text_of(data, "zone"));
    json_array_foreach(zones, i, zone)
    {
        const char *name = json_string_value(zone);

        found |= name && has_name(s->zones, name);
    }
    return found;
}

/* "Pedestrian in gate" */
static void title_of(char out[160], const json_t *data, bool line)
{
    const char *label = text_of(data, "label"), *zone;
    const json_t *zones = json_object_get(data, "zones");

    snprintf(out, 160, "%.60s", label[0] ? label : "Something");
    if (line)
        sst_text_add(out, 160, " crossed %.32s %.10s", text_of(data, "zone"), text_of(data, "direction"));
    for (size_t i = 0; !line && i < json_array_size(zones) && i < 3; i++) {
        zone = json_string_value(json_array_get(zones, i));
        sst_text_add(out, 160, "%s%.32s", i ? ", " : " in ", zone ? zone : "");
    }
    if (!line && !json_array_size(zones))
        sst_text_add(out, 160, " moves");
    sst_text_end_whole(out);
    sst_text_make_utf8(out);
}

static char *text_of_event(const struct sst_push *p, const json_t *event, const json_t *data, bool line)
{
    const char *visit = text_of(data, "visit");
    char title[160], body[400], picture[160], url[512];
    json_t *o;
    char *text;

    title_of(title, data, line);
    snprintf(body, sizeof(body), "%.128s%s%.240s", p->site, p->site[0] ? ": " : "", text_of(event, "message"));
    sst_text_end_whole(body);
    sst_text_make_utf8(body);
    snprintf(picture, sizeof(picture), "/api/v1/visits/%.64s/seen", visit);
    snprintf(url, sizeof(url), "%.400s/#visit=%.64s", p->page, visit);
    o = json_pack("{s:s, s:s, s:s, s:s, s:s, s:s}", "title", title, "body", body, "tag", visit, "url", url, "picture",
                  picture, "time", text_of(event, "time"));
    text = o ? json_dumps(o, JSON_COMPACT) : NULL;
    json_decref(o);
    return text;
}

/* May a subscription get another message? Visits and crossings each have a cool-down of their own; a visit is notified once. A
 * label may be recognised after the beginning: a filter of labels is tried again at the end of the visit. */
static bool is_due(const struct push_subscription *s, const json_t *data, bool line, double cool_s)
{
    const int64_t last_ns = line ? s->line_ns : s->told_ns;
    const bool ends = !json_is_true(json_object_get(data, "active"));

    if (!line && (!strcmp(s->visit, text_of(data, "visit")) || (ends && !s->labels[0])))
        return false;
    return !last_ns || (double)(sst_clock_now_ns() - last_ns) >= cool_s * 1e9;
}

static void handle_event(struct sst_push *p, const char *json)
{
    json_t *event = json_loads(json, 0, NULL);
    const json_t *data = json_object_get(event, "data");
    const bool line = !strcmp(text_of(event, "type"), "line");
    const bool visit = !strcmp(text_of(event, "type"), "visit");
    char *text = NULL;

    pthread_mutex_lock(&p->lock);
    for (int i = 0; (line || visit) && p->settings.enabled && i < p->count; i++) {
        struct push_subscription *s = &p->list[i];
        const double cool_s = isnan(s->cool_down_s) ? p->settings.cool_down_s : s->cool_down_s;

        if (!wants(s, data, line) || !is_due(s, data, line, cool_s))
            continue;
        text = text ? text : text_of_event(p, event, data, line);
        if (!text)
            break;
        *(line ? &s->line_ns : &s->told_ns) = sst_clock_now_ns();
        if (visit)
            snprintf(s->visit, sizeof(s->visit), "%s", text_of(data, "visit"));
        enqueue_locked(p, s->endpoint, text);
    }
    pthread_mutex_unlock(&p->lock);
    free(text);
    json_decref(event);
}

static void handle_events(struct sst_push *p)
{
    uint64_t id;
    char *event;

    while (sst_events_next(p->events, p->seen, &id, &event)) {
        p->seen = id;
        handle_event(p, event);
        free(event);
    }
}

/* --- sending ------------------------------------------------------------------------------------------------------ */

static bool may_go_on(void *arg)
{
    struct sst_push *p = arg;
    bool stop;

    pthread_mutex_lock(&p->lock);
    stop = p->stop;
    pthread_mutex_unlock(&p->lock);
    return !stop;
}

/* Result of a try. */
struct outcome {
    int status, retry_s; /* status: of the answer, or -errno */
    char why[160];
};

static void send_message(struct sst_push *p, const struct message *m, const struct push_receiver *to,
                         const struct sst_push_settings *settings, struct outcome *o)
{
    const int64_t until_s = sst_clock_wall_ns() / 1000000000 + TOKEN_S;
    char origin[300], error[512] = "", token[PUSH_TOKEN], public[PUSH_BASE64(PUSH_POINT)], authorization[PUSH_TOKEN + 200];
    uint8_t body[PUSH_BODY_MOST], key[PUSH_POINT];
    struct push_message out = { .endpoint = m->endpoint, .authorization = authorization, .body = body, .ttl_s = TTL_S,
                                .settings = settings, .go_on = may_go_on, .arg = p };
    int n = push_check_endpoint(settings, m->endpoint, origin, error);

    n = n ? n : push_key(p->key_path, key);
    n = n ? n : push_token(p->key_path, origin, settings->contact, until_s, token);
    n = n ? n : push_encrypt(to, m->text, NULL, NULL, body);
    if (n < 0) {
        snprintf(o->why, sizeof(o->why), "%.150s", error[0] ? error : strerror(-n));
        o->status = n;
        return;
    }
    push_base64(public, key, PUSH_POINT);
    snprintf(authorization, sizeof(authorization), "vapid t=%s, k=%s", token, public);
    out.bytes = (size_t)n;
    o->status = push_send(&out, &o->retry_s, o->why);
}

static void log_failure(struct sst_push *p, const char *endpoint, int status, const char *why)
{
    const int64_t now_ns = sst_clock_now_ns();
    char host[64];

    snprintf(host, sizeof(host), "%.*s", (int)strcspn(endpoint + 8, "/?#:"), endpoint + 8);
    if (p->logged_ns && now_ns - p->logged_ns < LOG_NS)
        return;
    p->logged_ns = now_ns;
    if (status > 0)
        sst_log_warning("notifications: %s answers %d%s; the message is lost", host, status,
                        status == 401 || status == 403 ? ": set push: contact to an address of yours" : "");
    else
        sst_log_warning("notifications: %s: %s; the message is lost", host, why);
}

/* The result of a try: gone subscriptions are removed, the rest is tried again while that helps. */
static void judge(struct sst_push *p, struct message *m, const struct outcome *o)
{
    const int status = o->status;
    const bool again = (status == 429 || status >= 500 || status == -EIO) && m->tries < TRIES;
    int i;

    pthread_mutex_lock(&p->lock);
    i = find_locked(p, m->endpoint);
    if (status >= 200 && status < 300) {
        p->sent++;
    } else if ((status == 404 || status == 410) && i >= 0) {
        remove_locked(p, i);
        if (save_locked(p))
            sst_log_warning("notifications: %s cannot be written", p->list_path);
    } else if (again && i >= 0 && p->queued < QUEUE && !p->stop) {
        m->due_ns = sst_clock_now_ns() + (o->retry_s  ? (int64_t)(o->retry_s < RETRY_S ? o->retry_s : RETRY_S) * 1000000000
                                          : m->tries > 1 ? 10 * BACK_OFF_NS
                                                         : BACK_OFF_NS);
        p->queue[p->queued++] = *m;
        m->text = NULL;
    } else if (status != -ECANCELED) {
        p->failed++;
    }
    pthread_mutex_unlock(&p->lock);
    if (m->text && !(status >= 200 && status < 300) && status != 404 && status != 410 && status != -ECANCELED)
        log_failure(p, m->endpoint, status, o->why);
    free(m->text);
}

/* @return false: none is due; next_ns: of the next one */
static bool take_locked(struct sst_push *p, struct message *m, int64_t *next_ns)
{
    const int64_t now_ns = sst_clock_now_ns();

    *next_ns = now_ns + INT64_C(60000000000);
    for (int i = 0; i < p->queued; i++) {
        if (p->queue[i].due_ns <= now_ns) {
            *m = p->queue[i];
            p->queue[i].text = NULL;
            remove_message_locked(p, i);
            return true;
        }
        *next_ns = p->queue[i].due_ns < *next_ns ? p->queue[i].due_ns : *next_ns;
    }
    return false;
}

/* @return false: none is due; next_ns: when one is */
static bool send_next(struct sst_push *p, int64_t *next_ns)
{
    struct sst_push_settings settings;
    struct push_receiver to;
    struct outcome o = { .status = -ECANCELED };
    int i;
    struct message m;
    bool taken;

    pthread_mutex_lock(&p->lock);
    settings = p->settings;
    taken = !p->stop && take_locked(p, &m, next_ns);
    i = taken ? find_locked(p, m.endpoint) : -1;
    to = p->list[i < 0 ? 0 : i].to;
    pthread_mutex_unlock(&p->lock);
    if (!taken)
        return false;
    m.tries++;
    if (i >= 0 && settings.enabled) /* else the message is dropped: notifications may have been disabled since */
        send_message(p, &m, &to, &settings, &o);
    judge(p, &m, &o);
    return true;
}

static void *run(void *arg)
{
    struct sst_push *p = arg;
    int64_t next_ns = 0;

    sst_thread_name("sst-push");
    while (may_go_on(p)) {
        pthread_mutex_lock(&p->bell);
        while (!p->rung && sst_cond_wait_until(&p->wake, &p->bell, next_ns))
            ;
        p->rung = false;
        pthread_mutex_unlock(&p->bell);
        handle_events(p);
        while (send_next(p, &next_ns))
            handle_events(p);
    }
    return NULL;
}

/* --- verbs -------------------------------------------------------------------------------------------------------- */

void sst_push_configure(struct sst_push *p, const struct sst_push_settings *settings, const char *site)
{
    pthread_mutex_lock(&p->lock);
    p->settings = *settings;
    snprintf(p->site, sizeof(p->site), "%s", site);
    pthread_mutex_unlock(&p->lock);
}

int sst_push_open(struct sst_push **out, const struct sst_push_config *cfg)
{
    const int folder = (int)(sst_path_base(cfg->beside) - cfg->beside);
    struct sst_push *p = calloc(1, sizeof(*p));
    int err;

    if (!p)
        return -ENOMEM;
    p->events = cfg->events;
    p->seen = sst_events_last(cfg->events);
    snprintf(p->page, sizeof(p->page), "%s", cfg->page);
    snprintf(p->key_path, sizeof(p->key_path), "%.*s" KEY_FILE, folder, cfg->beside);
    snprintf(p->list_path, sizeof(p->list_path), "%.*s" LIST_FILE, folder, cfg->beside);
    pthread_mutex_init(&p->lock, NULL);
    pthread_mutex_init(&p->bell, NULL);
    sst_cond_init(&p->wake);
    sst_push_configure(p, cfg->settings, cfg->site);
    p->count = push_read(p->list_path, p->list);
    err = sst_events_watch(p->events, ring, p);
    if (!err) {
        err = -pthread_create(&p->thread, NULL, run, p);
        if (err)
            sst_events_unwatch(p->events, ring, p);
    }
    if (err) {
        pthread_cond_destroy(&p->wake);
        pthread_mutex_destroy(&p->bell);
        pthread_mutex_destroy(&p->lock);
        free(p);
        return err;
    }
    *out = p;
    return 0;
}

json_t *sst_push_state(struct sst_push *p)
{
    uint8_t key[PUSH_POINT];
    char text[PUSH_BASE64(PUSH_POINT)] = "", said[SST_LOG_MAX] = "";
    char *held;
    json_t *o;
    int err;

    pthread_mutex_lock(&p->lock);
    held = sst_log_hold_errors(said);
    err = p->settings.enabled ? push_key(p->key_path, key) : -EPERM;
    sst_log_hold_errors(held);
    if (!err)
        push_base64(text, key, PUSH_POINT);
    o = json_pack("{s:b, s:s, s:s, s:i, s:f, s:I, s:I}", "supported", !err, "reason",
                  !err              ? ""
                  : err == -EPERM   ? "push: enabled is false"
                  : err == -ENOTSUP ? "built without libcurl, GnuTLS or Nettle"
                                    : said,
                  "key", text, "subscriptions", p->count, "cool_down_s", p->settings.cool_down_s, "sent",
                  (json_int_t)p->sent, "failed", (json_int_t)p->failed);
    pthread_mutex_unlock(&p->lock);
    return o;
}

static int subscribe_locked(struct sst_push *p, const json_t *request, char error[512])
{
    struct push_subscription s, before = { .cool_down_s = 0 };
    char origin[300];
    int i, err;

    if (!push_subscription_of(request, &s, error))
        return -EINVAL;
    err = push_check_endpoint(&p->settings, s.endpoint, origin, error);
    if (err)
        return err;
    i = find_locked(p, s.endpoint);
    if (i < 0 && p->count == SST_PUSH_MAX)
        return sst_api_refuse(error, -EOVERFLOW, "%d browsers have subscribed already; end one of them", SST_PUSH_MAX);
    if (i >= 0) { /* another filter */
        before = p->list[i];
        s.told_ns = before.told_ns;
        s.line_ns = before.line_ns;
        memcpy(s.visit, before.visit, sizeof(s.visit));
    }
    p->list[i < 0 ? p->count++ : i] = s;
    err = save_locked(p);
    if (!err)
        return 0;
    if (i < 0)
        p->count--;
    else
        p->list[i] = before;
    return sst_api_refuse(error, -EIO, "the subscription cannot be stored: %s", strerror(-err));
}

int sst_push_change(struct sst_push *p, const json_t *request, char error[512])
{
    const bool gone = json_is_true(json_object_get(request, "delete"));
    const bool test = json_is_true(json_object_get(request, "test"));
    const char *endpoint = text_of(request, "endpoint");
    int i, err = 0;

    pthread_mutex_lock(&p->lock);
    i = find_locked(p, endpoint);
    if (!gone && !p->settings.enabled) {
        err = sst_api_refuse(error, -ENOTSUP, "notifications are off: push: enabled is false");
    } else if (!gone && !test) {
        err = subscribe_locked(p, request, error);
    } else if (i < 0) {
        err = sst_api_refuse(error, -ENOENT, "this browser has not subscribed");
    } else if (gone) {
        remove_locked(p, i);
        err = save_locked(p);
        if (err)
            err = sst_api_refuse(error, -EIO, "the subscriptions cannot be stored: %s", strerror(-err));
    } else {
        enqueue_locked(p, endpoint, "{\"title\":\"Notifications work\",\"body\":\"They come when no page is open, too.\",\"tag\":\"test\","
                                    "\"url\":\"/\",\"picture\":\"\",\"time\":\"\"}");
    }
    pthread_mutex_unlock(&p->lock);
    return err;
}

void sst_push_stop(struct sst_push *p)
{
    if (!p)
        return;
    pthread_mutex_lock(&p->lock);
    p->stop = true;
    pthread_mutex_unlock(&p->lock);
    ring(p);
}

void sst_push_close(struct sst_push *p)
{
    if (!p)
        return;
    sst_push_stop(p);
    pthread_join(p->thread, NULL);
    sst_events_unwatch(p->events, ring, p);
    while (p->queued)
        remove_message_locked(p, p->queued - 1);
    pthread_cond_destroy(&p->wake);
    pthread_mutex_destroy(&p->bell);
    pthread_mutex_destroy(&p->lock);
    free(p);
}
