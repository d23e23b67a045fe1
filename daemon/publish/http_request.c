/* A request from its first byte to its last: connection, body, handler, end. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/publish/publish_internal.h"

#include <netinet/tcp.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"

#define DISCARD_MAX (1 << 20) /* of a body too large that is read before hanging up, so that the answer arrives */
#define SECOND_NS   1000000000LL

/* A client that waits for a picture or an event sends and gets nothing for long: the kernel finds out whether it is
 * still there. */
static void notice_dead_peers(int fd)
{
    const int on = 1, idle_s = 15, interval_s = 5, probes = 4, unread_ms = 60000;

    (void)!setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof(on));
    (void)!setsockopt(fd, IPPROTO_TCP, TCP_KEEPIDLE, &idle_s, sizeof(idle_s));
    (void)!setsockopt(fd, IPPROTO_TCP, TCP_KEEPINTVL, &interval_s, sizeof(interval_s));
    (void)!setsockopt(fd, IPPROTO_TCP, TCP_KEEPCNT, &probes, sizeof(probes));
    (void)!setsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &unread_ms, sizeof(unread_ms));
}

void http_on_connection(void *cls, struct MHD_Connection *connection, void **state,
                        enum MHD_ConnectionNotificationCode how)
{
    struct http_listener *listener = cls;
    struct sst_http *http = listener->http;
    struct http_connection *l = *state;

    if (how == MHD_CONNECTION_NOTIFY_STARTED) {
        l = calloc(1, sizeof(*l));
        *state = l;
        if (!l)
            return; /* its requests are refused */
        atomic_fetch_add(&listener->clients, 1);
        atomic_fetch_add(&listener->http->count->clients, 1);
        l->pair = http_tls_begin(&http->pairs, connection);
        l->fd = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd;
        l->deadline_ns = sst_clock_now_ns() + HTTP_REQUEST_S * SECOND_NS;
        if (!listener->local)
            notice_dead_peers(l->fd);
        pthread_mutex_lock(&http->lock);
        l->next = http->links;
        l->prev = &http->links;
        if (l->next)
            l->next->prev = &l->next;
        http->links = l;
        pthread_mutex_unlock(&http->lock);
    } else if (l) {
        pthread_mutex_lock(&http->lock);
        *l->prev = l->next;
        if (l->next)
            l->next->prev = l->prev;
        pthread_mutex_unlock(&http->lock);
        atomic_fetch_sub(&listener->clients, 1);
        atomic_fetch_sub(&listener->http->count->clients, 1);
        http_tls_end(&http->pairs, l->pair);
        free(l);
        *state = NULL;
    }
}

static struct http_connection *link_of(struct MHD_Connection *connection)
{
    return MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT)->socket_context;
}

void *http_on_uri(void *cls SST_UNUSED, const char *uri, struct MHD_Connection *connection)
{
    struct http_connection *link = link_of(connection);

    if (link) {
        link->uri_at = (uintptr_t)uri;
        link->uri_bytes = strlen(uri);
    }
    return NULL; /* the request begins with its headers */
}

static struct http_request *new_request(struct http_listener *listener, struct MHD_Connection *connection)
{
    struct http_connection *link = link_of(connection);
    struct http_request *q = link ? calloc(1, sizeof(*q)) : NULL;

    if (!q)
        return NULL;
    q->http = listener->http;
    q->listener = listener;
    q->local = listener->local;
    q->connection = connection;
    q->link = link;
    q->fd = link->fd;
    q->silence_s = listener->http->cfg.idle_s;
    http_name_peer(q);
    atomic_fetch_add(&listener->http->count->requests, 1);
    return q;
}

/* @return false: hang up */
static bool add_body(struct http_request *q, const char *data, size_t size)
{
    size_t capacity = q->capacity ? q->capacity : 1024;
    char *grown;

    if (q->too_large || q->size + size > HTTP_BODY_MAX) {
        q->too_large = true;
        q->size += size;
        return q->size <= DISCARD_MAX;
    }
    while (capacity < q->size + size + 1)
        capacity *= 2;
    if (capacity != q->capacity) {
        grown = realloc(q->data, capacity);
        if (!grown)
            return false;
        q->data = grown;
        q->capacity = capacity;
    }
    memcpy(q->data + q->size, data, size);
    q->size += size;
    q->data[q->size] = 0;
    return true;
}

/* The body as an object; none is an empty one. @return -1: done; else answered */
static int parse_body(struct http_request *q)
{
    json_error_t error;

    q->body = q->size ? json_loadb(q->data, q->size, JSON_REJECT_DUPLICATES, &error) : json_object();
    if (!q->body && !q->size)
        return MHD_NO;
    if (!q->body)
        return http_reply_error(q, MHD_HTTP_BAD_REQUEST, "the body is not JSON: line %d, column %d: %s", error.line,
                                error.column, error.text);
    if (!json_is_object(q->body))
        return http_reply_error(q, MHD_HTTP_BAD_REQUEST, "the body is JSON, but not an object {...}");
    return -1;
}

static int answer(struct http_request *q)
{
    const struct sst_api *api = q->http->cfg.api;
    const bool post = !strcmp(q->route->method, "POST");
    int done;

    atomic_store(&q->link->deadline_ns, INT64_MAX);
    if (q->too_large)
        return http_reply_error(q, MHD_HTTP_CONTENT_TOO_LARGE, "a body has at most %d bytes", HTTP_BODY_MAX);
    if (post && strcmp(q->route->path, "/login")) {
        done = parse_body(q);
        if (done >= 0)
            return done;
    }
    if (!q->replay) {
        q->live = api->live;
        return http_handler(q->index)(q);
    }
    q->live = api->replay_take(api->replayed);
    if (!q->live)
        return http_reply_error(q, MHD_HTTP_NOT_FOUND,
                                "no recording is being played; POST /api/v1/replay with its name opens one");
    done = http_handler(q->index)(q);
    api->replay_release(api->replayed);
    return done;
}

enum MHD_Result http_on_request(void *cls, struct MHD_Connection *connection, const char *path, const char *method,
                                const char *version, const char *data, size_t *size, void **state)
{
    struct http_request *q = *state;
    int done;

    if (!q) {
        *state = q = new_request(cls, connection);
        if (!q)
            return MHD_NO;
        done = http_check(q, path, method, version);
        return done ? MHD_YES : MHD_NO;
    }
    if (*size) {
        const bool fine = add_body(q, data, *size);

        *size = 0;
        return fine ? MHD_YES : MHD_NO;
    }
    return answer(q) ? MHD_YES : MHD_NO;
}

void http_on_done(void *cls SST_UNUSED, struct MHD_Connection *connection SST_UNUSED, void **state,
                  enum MHD_RequestTerminationCode how SST_UNUSED)
{
    struct http_request *q = *state;

    if (!q)
        return;
    /* An idle connection goes earlier, and the next request has its time from its first byte on. */
    if (!q->upgraded)
        atomic_store(&q->link->deadline_ns, sst_clock_now_ns() + (q->http->cfg.idle_s + HTTP_REQUEST_S) * SECOND_NS);
    http_watch_drop(q->watch);
    json_decref(q->body);
    free(q->data);
    free(q);
    *state = NULL;
}
