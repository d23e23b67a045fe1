/* Events: visits, changes and labels of the service as properties of ONVIF, and subscriptions that are pulled. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/random.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "publishers/onvif/onvif_internal.h"

#define SECOND            INT64_C(1000000000)
#define SUBSCRIPTIONS_MAX 16
#define QUEUE_MAX         64 /* messages of a subscription; the oldest goes */
#define PRESENT_MAX       64 /* visits and changes at a time */
#define ZONES_MAX         32
#define ZONE_NAME         32
#define TERM_LEAST_NS     (10 * SECOND)
#define TERM_NS           (60 * SECOND) /* where a client asks for none */
#define TERM_MOST_NS      (3600 * SECOND)
#define PULL_MOST_NS      (60 * SECOND)
#define IDLE_NS           (60 * SECOND) /* a subscription that was not pulled for this long makes room for another one */
#define SOURCE_ITEM       "<tt:SimpleItem Name=\"%s\" Value=\"%s\"/>"

enum topic {
    TOPIC_ALARM = 0,
    TOPIC_MOTION = 1,
    TOPIC_PEOPLE = 2,
    TOPIC_FIELD = 3,
    TOPIC_LINE = 4,
    TOPICS = 5,
};

static const struct {
    const char *name, *data;
    bool rule; /* its source is a rule, else the video source */
} topics[TOPICS] = {
    [TOPIC_ALARM] = { "VideoSource/MotionAlarm", "State", false },
    [TOPIC_MOTION] = { "RuleEngine/CellMotionDetector/Motion", "IsMotion", true },
    [TOPIC_PEOPLE] = { "RuleEngine/MyRuleDetector/PeopleDetect", "State", false },
    [TOPIC_FIELD] = { "RuleEngine/FieldDetector/ObjectsInside", "IsInside", true },
    [TOPIC_LINE] = { "RuleEngine/LineDetector/Crossed", "ObjectId", true },
};

struct message {
    enum topic topic;
    int value;         /* a state, or the number of an object */
    bool first;        /* state at a synchronization point */
    int64_t wall_ns;
    char rule[ZONE_NAME];
};

struct subscription {
    char name[ONVIF_SUBSCRIPTION]; /* "": free */
    unsigned topics;               /* bits */
    int64_t until_ns, period_ns;   /* of the steady clock */
    int64_t pulled_ns;
    unsigned pulls; /* counts them: a newer one ends one that waits */
    int waiters;
    struct message queue[QUEUE_MAX];
    int first, count;
};

/** A visit, or a zone that changes. */
struct presence {
    char key[96]; /* "": free */
    bool person;
    uint32_t zones;
    int number;
};

static struct {
    struct sst_server *server; /* fixed after init */
    pthread_mutex_t lock;
    pthread_cond_t news;
    /* under lock */
    bool stop;
    struct subscription subscription[SUBSCRIPTIONS_MAX];
    struct presence present[PRESENT_MAX];
    char zone[ZONES_MAX][ZONE_NAME];
    int zones, numbers;
    bool motion, people;
    uint32_t inside;
} events = { .lock = PTHREAD_MUTEX_INITIALIZER };

void events_init(struct sst_server *server)
{
    events.server = server;
    sst_cond_init(&events.news);
}

/* --- messages ----------------------------------------------------------------------------------------------------- */

static void push_locked(struct subscription *s, const struct message *m)
{
    if (!(s->topics & 1u << m->topic))
        return;
    if (s->count == QUEUE_MAX) {
        s->first = (s->first + 1) % QUEUE_MAX;
        s->count--;
    }
    s->queue[(s->first + s->count++) % QUEUE_MAX] = *m;
}

static void emit_locked(enum topic topic, int value, const char *rule)
{
    struct message m = { .topic = topic, .value = value, .wall_ns = sst_clock_wall_ns() };

    snprintf(m.rule, sizeof(m.rule), "%s", rule);
    for (int i = 0; i < SUBSCRIPTIONS_MAX; i++)
        if (events.subscription[i].name[0])
            push_locked(&events.subscription[i], &m);
    pthread_cond_broadcast(&events.news);
}

/* The present states, for one subscription. */
static void synchronize_locked(struct subscription *s)
{
    struct message m = { .first = true, .wall_ns = sst_clock_wall_ns(), .rule = "motion" };

    for (m.topic = TOPIC_ALARM; m.topic <= TOPIC_PEOPLE; m.topic++) {
        m.value = m.topic == TOPIC_PEOPLE ? events.people : events.motion;
        push_locked(s, &m);
    }
    m.topic = TOPIC_FIELD;
    for (int i = 0; i < events.zones; i++) {
        snprintf(m.rule, sizeof(m.rule), "%s", events.zone[i]);
        m.value = events.inside >> i & 1;
        push_locked(s, &m);
    }
    pthread_cond_broadcast(&events.news);
}

static void put_message(FILE *out, const struct message *m)
{
    char at[SST_CLOCK_TEXT], number[16];

    sst_clock_text(at, m->wall_ns);
    snprintf(number, sizeof(number), "%d", m->value);
    fprintf(out,
            "<wsnt:NotificationMessage>"
            "<wsnt:Topic Dialect=\"http://www.onvif.org/ver10/tev/topicExpression/ConcreteSet\">tns1:%s</wsnt:Topic>"
            "<wsnt:Message><tt:Message UtcTime=\"%s\"",
            topics[m->topic].name, at);
    if (m->topic != TOPIC_LINE)
        fprintf(out, " PropertyOperation=\"%s\"", m->first ? "Initialized" : "Changed");
    fputs("><tt:Source>", out);
    if (topics[m->topic].rule) {
        fprintf(out, SOURCE_ITEM SOURCE_ITEM "<tt:SimpleItem Name=\"Rule\" Value=\"", "VideoSourceConfigurationToken",
                "main_source", "VideoAnalyticsConfigurationToken", "main_analytics");
        soap_put(out, m->rule);
        fputs("\"/>", out);
    } else {
        fprintf(out, SOURCE_ITEM, "Source", "main");
    }
    fprintf(out,
            "</tt:Source><tt:Data>" SOURCE_ITEM "</tt:Data></tt:Message></wsnt:Message></wsnt:NotificationMessage>",
            topics[m->topic].data, m->topic == TOPIC_LINE ? number : m->value ? "true" : "false");
}

/* --- the service's events ----------------------------------------------------------------------------------------- */

/* Report states that differ from before. */
static void update_locked(void)
{
    bool motion = false, people = false;
    uint32_t inside = 0;

    for (int i = 0; i < PRESENT_MAX; i++) {
        motion |= events.present[i].key[0] != 0;
        people |= events.present[i].key[0] && events.present[i].person;
        inside |= events.present[i].key[0] ? events.present[i].zones : 0;
    }
    if (motion != events.motion) {
        events.motion = motion;
        emit_locked(TOPIC_ALARM, motion, "motion");
        emit_locked(TOPIC_MOTION, motion, "motion");
    }
    if (people != events.people) {
        events.people = people;
        emit_locked(TOPIC_PEOPLE, people, "");
    }
    for (int i = 0; i < events.zones; i++)
        if ((inside ^ events.inside) >> i & 1)
            emit_locked(TOPIC_FIELD, inside >> i & 1, events.zone[i]);
    events.inside = inside;
}

static uint32_t zone_bit_locked(const char *name)
{
    for (int i = 0; name && i < events.zones; i++)
        if (!strcmp(events.zone[i], name))
            return 1u << i;
    return 0;
}

static bool is_person(const char *label)
{
    return label && (!strcasecmp(label, "Pedestrian") || !strcasecmp(label, "Bicyclist") ||
                     !strcasecmp(label, "Person"));
}

static struct presence *find_locked(const char *key)
{
    for (int i = 0; i < PRESENT_MAX; i++)
        if (!strcmp(events.present[i].key, key))
            return &events.present[i];
    return NULL;
}

/* @return NULL: it has gone, or there are too many */
static struct presence *note_locked(const char *kind, const char *name, bool active)
{
    char key[sizeof(events.present[0].key)];
    struct presence *p;

    snprintf(key, sizeof(key), "%s %s", kind, name ? name : "");
    p = find_locked(key);
    if (!active) {
        if (p)
            *p = (struct presence){ 0 };
        return NULL;
    }
    p = p ? p : find_locked("");
    if (p && !p->key[0]) {
        memcpy(p->key, key, sizeof(key));
        p->number = ++events.numbers;
    }
    return p;
}

static void on_visit_locked(const json_t *data)
{
    struct presence *p = note_locked("visit", json_string_value(json_object_get(data, "visit")),
                                     json_is_true(json_object_get(data, "active")));
    const json_t *name;
    size_t i;

    if (!p)
        return;
    p->person |= is_person(json_string_value(json_object_get(data, "label")));
    json_array_foreach(json_object_get(data, "zones"), i, name) p->zones |= zone_bit_locked(json_string_value(name));
}

static void on_line_locked(const json_t *data)
{
    const char *zone = json_string_value(json_object_get(data, "zone"));
    char key[sizeof(events.present[0].key)];
    const struct presence *p;

    snprintf(key, sizeof(key), "visit %s", json_string_value(json_object_get(data, "visit")));
    p = find_locked(key);
    emit_locked(TOPIC_LINE, p ? p->number : ++events.numbers, zone ? zone : "");
}

/* A trigger of recordings: a zone, or the whole picture, that changes or shows a label. */
static void on_trigger_locked(const char *type, const json_t *data)
{
    const char *zone = json_string_value(json_object_get(data, "zone")),
               *label = json_string_value(json_object_get(data, "label"));
    char name[64];
    struct presence *p;

    snprintf(name, sizeof(name), "%.31s %.31s", zone ? zone : "", label ? label : "");
    p = note_locked(type, name, json_is_true(json_object_get(data, "active")));
    if (p)
        p->person = is_person(label);
}

void events_on_event(const json_t *event)
{
    const char *type = json_string_value(json_object_get(event, "type"));
    const json_t *data = json_object_get(event, "data");

    if (!type || !json_is_object(data))
        return;
    pthread_mutex_lock(&events.lock);
    if (!strcmp(type, "visit"))
        on_visit_locked(data);
    else if (!strcmp(type, "motion") || !strcmp(type, "label"))
        on_trigger_locked(type, data);
    else if (!strcmp(type, "line"))
        on_line_locked(data);
    update_locked();
    pthread_mutex_unlock(&events.lock);
}

/* Zones without masks and lines. @return their number */
static int read_zones(char out[ZONES_MAX][ZONE_NAME], const json_t *zones)
{
    const json_t *zone;
    size_t i;
    int n = 0;

    json_array_foreach(json_object_get(zones, "zones"), i, zone)
    {
        const char *name = json_string_value(json_object_get(zone, "name"));

        if (name && n < ZONES_MAX && !json_is_true(json_object_get(zone, "mask")) &&
            !json_is_true(json_object_get(zone, "line")))
            snprintf(out[n++], ZONE_NAME, "%s", name);
    }
    return n;
}

static void forget_locked(void)
{
    memset(events.present, 0, sizeof(events.present));
    update_locked();
}

void events_zones(const json_t *zones)
{
    char now[ZONES_MAX][ZONE_NAME] = { "" };
    const int n = read_zones(now, zones);

    pthread_mutex_lock(&events.lock);
    if (n != events.zones || memcmp(now, events.zone, sizeof(now)) != 0) {
        forget_locked(); /* visits are in zones that have other numbers now */
        memcpy(events.zone, now, sizeof(now));
        events.zones = n;
    }
    pthread_mutex_unlock(&events.lock);
}

void events_disconnected(void)
{
    pthread_mutex_lock(&events.lock);
    forget_locked();
    pthread_mutex_unlock(&events.lock);
}

void events_stop(void)
{
    pthread_mutex_lock(&events.lock);
    events.stop = true;
    pthread_cond_broadcast(&events.news);
    pthread_mutex_unlock(&events.lock);
}

/* --- subscriptions ------------------------------------------------------------------------------------------------ */

static const struct soap_fault no_subscription = { 400, "wsrf-rw:ResourceUnknownFault", NULL,
                                                   "There is no such subscription; it may have ended" };
static const struct soap_fault too_many = { 500, "ter:OutofMemory", "wsnt:UnableToCreatePullPointFault",
                                            "16 subscriptions are in use" };
static const struct soap_fault bad_time = { 400, "wsnt:UnacceptableInitialTerminationTimeFault", NULL,
                                            "The termination time is no duration and no time in the future" };
static const struct soap_fault bad_topic = { 400, "wsnt:InvalidFilterFault", "wsnt:TopicNotSupportedFault",
                                             "There are no events of this topic; GetEventProperties lists them" };
static const struct soap_fault bad_pull = { 400, "ter:InvalidArgVal", NULL, "Timeout is no duration" };

static void drop_locked(struct subscription *s)
{
    s->name[0] = 0;
    s->pulls++; /* ends one that waits */
    pthread_cond_broadcast(&events.news);
}

static void expire_locked(void)
{
    const int64_t now_ns = sst_clock_now_ns();
    int there = 0;

    for (int i = 0; i < SUBSCRIPTIONS_MAX; i++) {
        struct subscription *s = &events.subscription[i];

        if (s->name[0] && !s->waiters && s->until_ns < now_ns)
            drop_locked(s);
        there += s->name[0] != 0;
    }
    sst_server_report_clients(events.server, there);
}

/* One without a name; or the one that was not pulled for longest. @return NULL: all are in use */
static struct subscription *find_room_locked(void)
{
    struct subscription *oldest = &events.subscription[0];

    for (int i = 0; i < SUBSCRIPTIONS_MAX; i++) {
        struct subscription *s = &events.subscription[i];

        if (!s->name[0] && !s->waiters)
            return s;
        if (!s->waiters && (oldest->waiters || s->pulled_ns < oldest->pulled_ns))
            oldest = s;
    }
    if (oldest->waiters || sst_clock_now_ns() - oldest->pulled_ns < IDLE_NS)
        return NULL;
    drop_locked(oldest);
    return oldest;
}

/* Its name is in the path, or in the address that the message names. */
static struct subscription *find_subscription_locked(const struct onvif_call *call)
{
    const char *to = soap_text(call->soap, call->soap->header, "To");
    const char *place = strstr(call->path, ONVIF_EVENTS_PATH);

    expire_locked();
    place = place || !to ? place : strstr(to, ONVIF_EVENTS_PATH);
    place = place ? place + strlen(ONVIF_EVENTS_PATH) : "";
    for (int i = 0; *place && i < SUBSCRIPTIONS_MAX; i++)
        if (!strcmp(events.subscription[i].name, place))
            return &events.subscription[i];
    return NULL;
}

/* @param text  a duration or a time; NULL or "": none @return false: neither, or not in the future */
static bool read_term(const char *text, int64_t *period_ns)
{
    int64_t at_ns, ns = TERM_NS;

    if (text && *text && !value_duration(text, &ns)) {
        if (!value_time(text, &at_ns))
            return false;
        ns = at_ns - sst_clock_wall_ns();
    }
    if (ns <= 0)
        return false;
    *period_ns = ns < TERM_LEAST_NS ? TERM_LEAST_NS : ns > TERM_MOST_NS ? TERM_MOST_NS : ns;
    return true;
}

/* A path without its prefixes: tns1:RuleEngine/tns1:X is RuleEngine/X. */
static void strip_prefixes(char *out, size_t room, const char *at, size_t n)
{
    const char *end = at + n;
    size_t used = 0;

    while (at < end && isspace((unsigned char)*at))
        at++;
    while (end > at && isspace((unsigned char)end[-1]))
        end--;
    for (size_t begin = 0; at < end && used < room - 1; at++) {
        if (*at == ':') {
            used = begin;
            continue;
        }
        out[used++] = *at;
        if (*at == '/')
            begin = used;
    }
    out[used] = 0;
}

/* Topics of an expression: paths joined by |, of which PATH//. has all below. */
static unsigned read_topics(const char *text)
{
    unsigned bits = 0;

    while (*text) {
        const size_t n = strcspn(text, "|");
        char path[128];
        size_t length;
        bool below;

        strip_prefixes(path, sizeof(path), text, n);
        length = strlen(path);
        below = length >= 3 && !strcmp(path + length - 3, "//.");
        if (below)
            length -= 3;
        for (int i = 0; i < TOPICS; i++)
            if (!strncmp(topics[i].name, path, length) &&
                (!topics[i].name[length] || (below && (!length || topics[i].name[length] == '/'))))
                bits |= 1u << i;
        text += n + (text[n] == '|');
    }
    return bits;
}

static void set_term_locked(struct subscription *s, struct onvif_call *call, int64_t period_ns)
{
    s->until_ns = sst_clock_now_ns() + period_ns;
    call->now_ns = sst_clock_wall_ns();
    call->until_ns = call->now_ns + period_ns;
}

const struct soap_fault *events_create(struct onvif_call *call)
{
    const struct soap *soap = call->soap;
    const char *filter = soap_text(soap, soap_child(soap, soap->call, "Filter"), "TopicExpression");
    const unsigned bits = filter && *filter ? read_topics(filter) : (1u << TOPICS) - 1;
    struct subscription *s;
    int64_t period_ns;
    uint64_t random;

    if (!read_term(soap_text(soap, soap->call, "InitialTerminationTime"), &period_ns))
        return &bad_time;
    if (!bits)
        return &bad_topic;
    if (getentropy(&random, sizeof(random)))
        return &too_many;
    pthread_mutex_lock(&events.lock);
    expire_locked();
    s = find_room_locked();
    if (s) {
        *s = (struct subscription){
            .topics = bits, .period_ns = period_ns, .pulled_ns = sst_clock_now_ns(), .pulls = s->pulls + 1
        };
        snprintf(s->name, sizeof(s->name), "%016llx", (unsigned long long)random);
        memcpy(call->subscription, s->name, sizeof(s->name));
        set_term_locked(s, call, period_ns);
        synchronize_locked(s);
    }
    expire_locked(); /* counts them */
    pthread_mutex_unlock(&events.lock);
    return s ? NULL : &too_many;
}

static void write_messages_locked(struct subscription *s, struct onvif_call *call, int limit)
{
    size_t bytes;
    FILE *out = open_memstream(&call->messages, &bytes);

    for (; out && s->count && limit > 0; limit--) {
        put_message(out, &s->queue[s->first]);
        s->first = (s->first + 1) % QUEUE_MAX;
        s->count--;
    }
    if (out)
        fclose(out);
}

const struct soap_fault *events_pull(struct onvif_call *call)
{
    const char *timeout = soap_text(call->soap, call->soap->call, "Timeout"),
               *most = soap_text(call->soap, call->soap->call, "MessageLimit");
    const int limit = most && atoi(most) > 0 ? atoi(most) : QUEUE_MAX;
    int64_t wait_ns = 0, end_ns;
    struct subscription *s;
    bool there = false;
    unsigned mine;

    if (timeout && *timeout && !value_duration(timeout, &wait_ns))
        return &bad_pull;
    pthread_mutex_lock(&events.lock);
    s = find_subscription_locked(call);
    if (s) {
        mine = ++s->pulls;
        pthread_cond_broadcast(&events.news); /* an older one returns without messages */
        end_ns = sst_clock_now_ns() + (wait_ns > PULL_MOST_NS ? PULL_MOST_NS : wait_ns);
        s->waiters++;
        while (s->pulls == mine && !s->count && !events.stop && sst_clock_now_ns() < end_ns)
            (void)sst_cond_wait_until(&events.news, &events.lock, end_ns);
        s->waiters--;
        there = s->name[0] != 0;
        s->pulled_ns = sst_clock_now_ns();
        if (s->pulls == mine)
            write_messages_locked(s, call, limit);
        set_term_locked(s, call, s->period_ns); /* a pull is a sign of life */
    }
    pthread_mutex_unlock(&events.lock);
    return there ? NULL : &no_subscription;
}

const struct soap_fault *events_renew(struct onvif_call *call)
{
    struct subscription *s;
    int64_t period_ns;

    if (!read_term(soap_text(call->soap, call->soap->call, "TerminationTime"), &period_ns))
        return &bad_time;
    pthread_mutex_lock(&events.lock);
    s = find_subscription_locked(call);
    if (s) {
        s->period_ns = period_ns;
        set_term_locked(s, call, period_ns);
    }
    pthread_mutex_unlock(&events.lock);
    return s ? NULL : &no_subscription;
}

const struct soap_fault *events_unsubscribe(struct onvif_call *call)
{
    struct subscription *s;

    pthread_mutex_lock(&events.lock);
    s = find_subscription_locked(call);
    if (s) {
        drop_locked(s);
        expire_locked();
    }
    pthread_mutex_unlock(&events.lock);
    return s ? NULL : &no_subscription;
}

const struct soap_fault *events_synchronize(struct onvif_call *call)
{
    struct subscription *s;

    pthread_mutex_lock(&events.lock);
    s = find_subscription_locked(call);
    if (s)
        synchronize_locked(s);
    pthread_mutex_unlock(&events.lock);
    return s ? NULL : &no_subscription;
}
