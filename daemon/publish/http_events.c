/* Events: the journal as lines of JSON, and the endless stream. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* asprintf */
#include "daemon/publish/publish_internal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"

#define LIMIT_USUAL 100
#define LIMIT_MAX   1000
#define TIME_MOST   64
#define DAY         10
#define OFFSET_MOST 900
#define PIECE_BYTES 4096
#define SILENCE     6 /* idle times after which a client that reads nothing is disconnected */

struct listener {
    struct sst_http *http;
    struct sst_events *events;
    uint64_t after;
    struct MHD_Connection *connection;
    int fd, silence_s;
    char session[HTTP_SESSION_NAME + 1]; /* "": none */
    bool sse;
    char *text; /* being sent */
    size_t size, at;
    int64_t sent_ns;
};

/* A number in the query. @return false: answered already */
static bool number_of(struct http_request *q, const char *name, uint64_t max, uint64_t *out, int *done)
{
    const char *text = http_query(q, name);

    if (!text || http_number(text, max, out))
        return true;
    *done = http_reply_error(q, MHD_HTTP_BAD_REQUEST, "%s=%.40s is not a number from 0 to %llu", name, text,
                             (unsigned long long)max);
    return false;
}

/* "2026-11-21", "2026-11-21T18:05:00Z", or the name of a visit, which begins with its time: compared as texts. NULL:
 * any */
static bool time_of(struct http_request *q, const char *name, const char **out, int *done)
{
    const char *text = http_query(q, name);

    *out = text && *text ? text : NULL;
    if (!*out || (sst_clock_begins_with_day(text) && (!text[DAY] || text[DAY] == 'T') && strlen(text) < TIME_MOST &&
                  strspn(text, "0123456789-:.TZ") == strlen(text)))
        return true;
    *done = http_reply_error(q, MHD_HTTP_BAD_REQUEST, "%s=%.40s is not a time like 2026-11-21T18:05:00Z", name, text);
    return false;
}

/* Members of all queries about visits. @return false: answered already */
static bool visits_query(struct http_request *q, struct sst_visits_query *out, int *done)
{
    const char *label = http_query(q, "label"), *zone = http_query(q, "zone");

    *out = (struct sst_visits_query){ .label = label && *label ? label : NULL,
                                      .zone = zone && *zone ? zone : NULL,
                                      .user = http_user(q) };
    return time_of(q, "from", &out->from, done) && time_of(q, "to", &out->to, done);
}

int http_do_visits(struct http_request *q)
{
    const char *reviewed = http_query(q, "reviewed");
    struct sst_visits_query query;
    struct sst_api_answer out = { 0 };
    uint64_t limit = LIMIT_USUAL;
    int done;

    if (!visits_query(q, &query, &done) || !number_of(q, "limit", LIMIT_MAX, &limit, &done) ||
        !time_of(q, "before", &query.before, &done) || !time_of(q, "after", &query.after, &done))
        return done;
    if (reviewed && *reviewed && strcmp(reviewed, "true") != 0 && strcmp(reviewed, "false") != 0)
        return http_reply_error(q, MHD_HTTP_BAD_REQUEST, "reviewed=%.40s is neither true nor false", reviewed);
    query.reviewed = !reviewed || !*reviewed ? 0 : !strcmp(reviewed, "true") ? 1 : -1;
    query.limit = (int)limit;
    return http_reply_answer(q, q->http->cfg.api->visits(q->http->cfg.api->arg, &query, &out), &out, "visits");
}

int http_do_visit_days(struct http_request *q)
{
    const char *text = http_query(q, "offset_min");
    struct sst_visits_query query;
    struct sst_api_answer out = { 0 };
    uint64_t offset_min = 0;
    int done;

    if (!visits_query(q, &query, &done))
        return done;
    if (text && *text && !http_number(text + (*text == '-'), OFFSET_MOST, &offset_min))
        return http_reply_error(q, MHD_HTTP_BAD_REQUEST,
                                "offset_min=%.40s is not a whole number of minutes east of Greenwich, -900 to 900",
                                text);
    return http_reply_answer(q,
                             q->http->cfg.api->visit_days(q->http->cfg.api->arg, &query,
                                                          text && *text == '-' ? -(int)offset_min : (int)offset_min,
                                                          &out),
                             &out, "days of visits");
}

int http_do_visit_picture(struct http_request *q, enum sst_visit_picture kind)
{
    const struct sst_api *api = q->http->cfg.api;
    struct MHD_Response *response;
    struct sst_api_answer out = { 0 };
    uint8_t *data;
    size_t size;
    const int err = api->visit_picture(api->arg, q->name, kind, &data, &size);

    if (err)
        return http_reply_answer(q, err, &out, "the picture of this visit");
    response = MHD_create_response_from_buffer(size, data, MHD_RESPMEM_MUST_FREE);
    if (!response) {
        free(data);
        return MHD_NO;
    }
    atomic_fetch_add(&q->http->count->bytes, size);
    http_set(response, "Content-Type", "image/jpeg");
    http_set(response, "Cache-Control", "no-cache, private");
    return http_reply(q, MHD_HTTP_OK, response);
}

int http_do_events(struct http_request *q)
{
    struct sst_events *events = q->http->cfg.api->events;
    const uint64_t last = sst_events_last(events);
    uint64_t limit = LIMIT_USUAL, after, id;
    char *json, *text = NULL;
    size_t size = 0;
    FILE *out;
    int done;

    if (!number_of(q, "limit", LIMIT_MAX, &limit, &done))
        return done;
    after = last > limit ? last - limit : 0;
    if (!number_of(q, "after", UINT64_MAX, &after, &done))
        return done;
    out = open_memstream(&text, &size);
    if (!out)
        return MHD_NO;
    for (uint64_t i = 0; i < limit && sst_events_next(events, after, &id, &json); i++) {
        fprintf(out, "%s\n", json);
        free(json);
        after = id;
    }
    if (fclose(out)) {
        free(text);
        return MHD_NO;
    }
    return http_reply_text(q, MHD_HTTP_OK, "application/x-ndjson", text);
}

/* The next event, or after a silence a sign of life, as it goes out. @return false: over */
static bool next_text(struct listener *l)
{
    static const int64_t silence_ns = HTTP_KEEP_ALIVE_S * 1000000000LL;
    uint64_t id;
    char *json;
    int n;

    for (;;) {
        if (atomic_load(&l->http->stopping) || http_peer_gone(l->fd) ||
            !http_session_lasts(&l->http->auth.sessions, l->session))
            return false;
        if (sst_events_next(l->events, l->after, &id, &json))
            break;
        if (!l->sent_ns || sst_clock_now_ns() - l->sent_ns > silence_ns) {
            l->text = strdup(l->sse ? ":\n\n" : "\n");
            l->size = l->text ? strlen(l->text) : 0;
            l->sent_ns = sst_clock_now_ns();
            return l->text != NULL;
        }
        sst_events_wait(l->events, l->after, HTTP_WAIT_MS);
    }
    if (l->sse)
        n = asprintf(&l->text, "id: %llu\ndata: %s\n\n", (unsigned long long)id, json);
    else
        n = asprintf(&l->text, "%s\n", json);
    free(json);
    if (n < 0) {
        l->text = NULL;
        return false;
    }
    l->size = (size_t)n;
    l->after = id;
    l->sent_ns = sst_clock_now_ns();
    return true;
}

static ssize_t listener_read(void *arg, uint64_t pos SST_UNUSED, char *buf, size_t max)
{
    struct listener *l = arg;
    size_t n;

    if (!l->text && !next_text(l))
        return MHD_CONTENT_READER_END_OF_STREAM;
    http_awake(l->connection, l->silence_s);
    n = l->size - l->at < max ? l->size - l->at : max;
    memcpy(buf, l->text + l->at, n);
    l->at += n;
    if (l->at == l->size) {
        free(l->text);
        l->text = NULL;
        l->at = 0;
    }
    atomic_fetch_add(&l->http->count->bytes, n);
    return (ssize_t)n;
}

static void listener_free(void *arg)
{
    struct listener *l = arg;

    free(l->text);
    atomic_fetch_sub(&l->http->count->listeners, 1);
    free(l);
}

/* The first event to send: after Last-Event-ID, after the query's `after`, or from now. @return false: answered */
static bool start_of(struct http_request *q, struct sst_events *events, uint64_t *after, int *done)
{
    const char *got = http_header(q, "Last-Event-ID");
    const uint64_t last = sst_events_last(events);

    *after = last;
    if (!number_of(q, "after", UINT64_MAX, after, done))
        return false;
    if (got)
        (void)http_number(got, UINT64_MAX, after); /* of another server's making: now */
    if (*after > last)
        *after = 0; /* the service was restarted and counts from 1 */
    return true;
}

int http_do_listen(struct http_request *q)
{
    struct sst_events *events = q->http->cfg.api->events;
    const char *accept = http_header(q, "Accept");
    struct MHD_Response *response;
    struct listener *l;
    uint64_t after;
    int done;

    if (!start_of(q, events, &after, &done))
        return done;
    l = calloc(1, sizeof(*l));
    if (!l)
        return MHD_NO;
    l->http = q->http;
    l->events = events;
    l->after = after;
    l->connection = q->connection;
    l->fd = q->fd;
    l->silence_s = q->silence_s = SILENCE * q->http->cfg.idle_s;
    memcpy(l->session, q->session, sizeof(l->session));
    l->sse = !accept || !strstr(accept, "application/x-ndjson");
    atomic_fetch_add(&q->http->count->listeners, 1);
    response = MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, PIECE_BYTES, listener_read, l, listener_free);
    if (!response) {
        listener_free(l);
        return MHD_NO;
    }
    /* Without chunks there is no last one, which libmicrohttpd would send for HEAD, too. */
    if (q->head && MHD_set_response_options(response, MHD_RF_HTTP_1_0_COMPATIBLE_STRICT, MHD_RO_END) != MHD_YES) {
        MHD_destroy_response(response);
        return MHD_NO;
    }
    http_set(response, "Content-Type", l->sse ? "text/event-stream" : "application/x-ndjson");
    http_set(response, "X-Accel-Buffering", "no");
    return http_reply(q, MHD_HTTP_OK, response);
}
