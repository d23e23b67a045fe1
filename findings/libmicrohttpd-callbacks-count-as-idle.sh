#!/usr/bin/env bash
# libmicrohttpd 0.9.75, a thread per connection, in which a content reader may block: the time that it blocks before it returns
# bytes of a chunked body counts as inactivity of the client. Where it is longer than MHD_OPTION_CONNECTION_TIMEOUT, the connection is closed at the
# moment when the callback returns its bytes, which are lost, though the client waited all the time. An earlier piece of the body does
# not help. MHD_set_connection_option(..._TIMEOUT, 0) and then the wanted value, after the wait, begins a new period.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
unpack libmicrohttpd12=0.9.75-6 libmicrohttpd-dev=0.9.75-6
cat >wait.c <<'C'
/* wait SECONDS PREAMBLE RENEW: what a client of a server with a time-out of 2 s receives of 8 bytes that come after SECONDS */
#include <arpa/inet.h>
#include <microhttpd.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { LIMIT_S = 2 };
static int seconds, preamble, renew, given;
static struct MHD_Connection *connection;

static ssize_t body(void *arg, uint64_t at, char *to, size_t room)
{
    if (at == 0 && preamble) {
        memcpy(to, "begin\n", 6);
        return 6;
    }
    if (given++)
        return MHD_CONTENT_READER_END_OF_STREAM;
    sleep(seconds);
    if (renew) {
        MHD_set_connection_option(connection, MHD_CONNECTION_OPTION_TIMEOUT, 0);
        MHD_set_connection_option(connection, MHD_CONNECTION_OPTION_TIMEOUT, LIMIT_S);
    }
    memcpy(to, "picture\n", 8);
    return 8;
}

static enum MHD_Result answer(void *arg, struct MHD_Connection *c, const char *url, const char *method, const char *version,
                              const char *data, size_t *size, void **state)
{
    struct MHD_Response *r = MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, 4096, body, NULL, NULL);
    enum MHD_Result result;

    connection = c;
    result = MHD_queue_response(c, 200, r);
    MHD_destroy_response(r);
    return result;
}

int main(int argc, char **argv)
{
    static const char ask[] = "GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    static char got[1 << 16];
    struct sockaddr_in to = { .sin_family = AF_INET, .sin_addr = { htonl(INADDR_LOOPBACK) } };
    struct MHD_Daemon *d;
    size_t n = 0;
    ssize_t k;
    int s = socket(AF_INET, SOCK_STREAM, 0);

    seconds = atoi(argv[1]);
    preamble = atoi(argv[2]);
    renew = atoi(argv[3]);
    d = MHD_start_daemon(MHD_USE_INTERNAL_POLLING_THREAD | MHD_USE_THREAD_PER_CONNECTION | MHD_USE_POLL | MHD_USE_ITC, 0, NULL,
                         NULL, answer, NULL, MHD_OPTION_CONNECTION_TIMEOUT, (unsigned)LIMIT_S, MHD_OPTION_END);
    if (!d)
        return 2;
    to.sin_port = htons(MHD_get_daemon_info(d, MHD_DAEMON_INFO_BIND_PORT)->port);
    if (connect(s, (void *)&to, sizeof(to)) || write(s, ask, sizeof(ask) - 1) < 0)
        return 2;
    while ((k = read(s, got + n, sizeof(got) - 1 - n)) > 0)
        n += (size_t)k;
    printf("after %d s%s%s: %s\n", seconds, preamble ? ", a first piece at once" : "", renew ? ", renewed" : "",
           strstr(got, "picture") ? "received" : "closed without it");
    MHD_stop_daemon(d);
    return 0;
}
C
compile wait -lmicrohttpd
{ ./wait 1 0 0; ./wait 4 0 0; ./wait 4 1 0; ./wait 4 0 1; } | tee seen
printf '%s\n' 'after 1 s: received' 'after 4 s: closed without it' 'after 4 s, a first piece at once: closed without it' 'after 4 s, renewed: received' >expected
holds "what a callback waits counts as the client's inactivity" cmp -s seen expected
# Seen: these four lines
