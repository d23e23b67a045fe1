/* Client of a request: its address, headers, cookie and wrong tokens, and whether it has gone. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* POLLRDHUP */
#include "daemon/publish/publish_internal.h"

#include <arpa/inet.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"

#define FLOOD_NS 60000000000LL /* between reports of too many connections */

const char *http_query(struct http_request *q, const char *name)
{
    return MHD_lookup_connection_value(q->connection, MHD_GET_ARGUMENT_KIND, name);
}

const char *http_header(struct http_request *q, const char *name)
{
    return MHD_lookup_connection_value(q->connection, MHD_HEADER_KIND, name);
}

static const struct sockaddr *address_of(struct http_request *q)
{
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(q->connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);

    return info ? info->client_addr : NULL;
}

void http_name_address(const struct sockaddr *address, char *out, size_t size)
{
    char text[INET6_ADDRSTRLEN] = "unknown";

    if (address && address->sa_family == AF_INET)
        inet_ntop(AF_INET, &((const struct sockaddr_in *)address)->sin_addr, text, sizeof(text));
    else if (address && address->sa_family == AF_INET6)
        inet_ntop(AF_INET6, &((const struct sockaddr_in6 *)address)->sin6_addr, text, sizeof(text));
    snprintf(out, size, "%s", text);
}

void http_name_peer(struct http_request *q)
{
    http_name_address(address_of(q), q->who, sizeof(q->who));
}

int http_wrong_token(struct http_request *q, int *retry_s)
{
    const struct sst_api *api = q->http->cfg.api;
    const struct sockaddr *address = address_of(q);
    uint8_t network[16];
    bool first = false;

    *retry_s = 0;
    if (address && !q->local) {
        sst_brake_network(address, network);
        *retry_s = sst_brake_wrong(&q->http->auth.brake, network, sst_clock_now_ns(), &first);
    }
    q->retry_s = *retry_s;
    if (first)
        sst_events_emit(api->events, SST_EVENT_WARNING, "client",
                        json_pack("{s:s, s:s}", "reason", "wrong tokens", "address", q->who),
                        "%s sent %d wrong tokens within a minute: further wrong ones are answered 429 for %d s", q->who,
                        SST_BRAKE_WRONG + 1, *retry_s);
    return *retry_s ? MHD_HTTP_TOO_MANY_REQUESTS : MHD_HTTP_UNAUTHORIZED;
}

bool http_is_picture(const struct sst_route *route)
{
    return route && (!strncmp(route->path, "/stream", 7) || !strncmp(route->path, "/video", 6) || !strncmp(route->path, "/snapshot", 9));
}

void http_cookie(const struct sst_http *http, char out[HTTP_COOKIE])
{
    snprintf(out, HTTP_COOKIE, "sst_%d", atomic_load(&http->port));
}

bool http_crowded(struct http_request *q)
{
    struct sst_http *http = q->http;
    const int64_t now_ns = sst_clock_now_ns();
    bool report;

    if (atomic_load(&q->listener->clients) <= http->cfg.clients)
        return false;
    pthread_mutex_lock(&http->lock);
    report = !http->flood_ns || now_ns - http->flood_ns > FLOOD_NS;
    http->flood_ns = report ? now_ns : http->flood_ns;
    pthread_mutex_unlock(&http->lock);
    if (report)
        sst_events_emit(http->cfg.api->events, SST_EVENT_WARNING, "client", json_pack("{s:s}", "reason", "flood"),
                        "more than %d connections at a time: some were refused; web.clients is the limit",
                        http->cfg.clients);
    return true;
}

bool http_peer_gone(int fd)
{
    struct pollfd p = { .fd = fd, .events = POLLRDHUP };

    return poll(&p, 1, 0) > 0 && (p.revents & (POLLRDHUP | POLLHUP | POLLERR | POLLNVAL));
}
