#!/usr/bin/env bash
# libmicrohttpd 0.9.75, a response of unknown size (MHD_create_response_from_callback with MHD_SIZE_UNKNOWN) queued for a HEAD
# request: after the header with Transfer-Encoding: chunked come the bytes "0\r\n\r\n", though a response to HEAD has no body (RFC 9110,
# 9.3.2). On a kept connection a client takes them for the beginning of the next response. The reader is not called. A response of known size is
# answered rightly.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
unpack libmicrohttpd12=0.9.75-6 libmicrohttpd-dev=0.9.75-6
cat >head.c <<'C'
/* head KNOWN: what follows the header of the response to HEAD, and how often the reader was asked for its body */
#include <arpa/inet.h>
#include <microhttpd.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static int known, asked;

static ssize_t body(void *arg, uint64_t at, char *to, size_t room)
{
    asked++;
    if (at)
        return MHD_CONTENT_READER_END_OF_STREAM;
    memcpy(to, "picture\n", 8);
    return 8;
}

static enum MHD_Result answer(void *arg, struct MHD_Connection *c, const char *url, const char *method, const char *version,
                              const char *data, size_t *size, void **state)
{
    struct MHD_Response *r = MHD_create_response_from_callback(known ? 8 : MHD_SIZE_UNKNOWN, 4096, body, NULL, NULL);
    enum MHD_Result result = MHD_queue_response(c, 200, r);

    MHD_destroy_response(r);
    return result;
}

int main(int argc, char **argv)
{
    static const char ask[] = "HEAD / HTTP/1.1\r\nHost: localhost\r\n\r\n";
    static char got[1 << 16];
    const struct timeval limit = { .tv_sec = 1 };
    struct sockaddr_in to = { .sin_family = AF_INET, .sin_addr = { htonl(INADDR_LOOPBACK) } };
    struct MHD_Daemon *d;
    const char *rest;
    size_t n = 0;
    ssize_t k;
    int s = socket(AF_INET, SOCK_STREAM, 0);

    known = atoi(argv[1]);
    d = MHD_start_daemon(MHD_USE_INTERNAL_POLLING_THREAD | MHD_USE_ITC, 0, NULL, NULL, answer, NULL, MHD_OPTION_END);
    if (!d)
        return 2;
    to.sin_port = htons(MHD_get_daemon_info(d, MHD_DAEMON_INFO_BIND_PORT)->port);
    setsockopt(s, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof(limit));
    if (connect(s, (struct sockaddr *)&to, sizeof(to)) || write(s, ask, sizeof(ask) - 1) != sizeof(ask) - 1)
        return 2;
    while (n < sizeof(got) - 1 && (k = read(s, got + n, sizeof(got) - 1 - n)) > 0)
        n += (size_t)k;
    rest = strstr(got, "\r\n\r\n");
    if (!rest)
        return 2;
    printf("%s, %zu bytes after the header, reader asked %d times\n", strstr(got, "chunked") ? "chunked" : "of known size",
           n - (size_t)(rest + 4 - got), asked);
    close(s);
    MHD_stop_daemon(d);
    return 0;
}
C
compile head -lmicrohttpd
{ ./head 1; ./head 0; } | tee seen
printf '%s\n' 'of known size, 0 bytes after the header, reader asked 0 times' 'chunked, 5 bytes after the header, reader asked 0 times' >expected
holds "a response to HEAD ends a body in chunks" cmp -s seen expected
# Seen: these two lines
