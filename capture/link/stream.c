/* Connections between hosts, over TLS.
 *
 * TLS by GnuTLS, the library that the page's HTTPS uses, on plain sockets, and not NNG or libzmq: libzmq's CURVE has
 * keys, no certificates. Debian's NNG has tls+tcp, by Mbed TLS, which would be a second TLS in the service, ends at
 * TLS 1.2, and its sockets report neither the progress of their queue nor their congestion control; "every frame
 * in one place" needs the one, a lossy network the other. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/link/link_internal.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/brake.h"

#define IN_STEP     65536
#define GONE_MS     2000   /* a connection without an answer ends */
#define LOWAT_BYTES 131072 /* unsent bytes in the kernel: more would only become old there */
#define CONGESTION  "bbr"  /* does not take each lost packet for congestion, as the usual one does */

void link_socket_prepare(int fd)
{
    const int on = 1, gone = GONE_MS, lowat = LOWAT_BYTES;

    (void)fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK);
    (void)setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
    (void)setsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &gone, sizeof(gone));
    (void)setsockopt(fd, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &lowat, sizeof(lowat));
    /* Where the kernel has or permits no other, it stays the usual one. */
    (void)setsockopt(fd, IPPROTO_TCP, TCP_CONGESTION, CONGESTION, strlen(CONGESTION));
}

int link_address(const char *address, int port, struct sockaddr_storage *out, unsigned *bytes)
{
    struct sockaddr_in four = { .sin_family = AF_INET, .sin_port = htons((uint16_t)port) };
    struct sockaddr_in6 six = { .sin6_family = AF_INET6, .sin6_port = htons((uint16_t)port) };

    memset(out, 0, sizeof(*out));
    if (inet_pton(AF_INET, address, &four.sin_addr) == 1) {
        memcpy(out, &four, sizeof(four));
        *bytes = sizeof(four);
        return 0;
    }
    if (inet_pton(AF_INET6, address, &six.sin6_addr) == 1) {
        memcpy(out, &six, sizeof(six));
        *bytes = sizeof(six);
        return 0;
    }
    return -EINVAL;
}

void link_address_text(const struct sockaddr_storage *address, char out[64])
{
    const void *at = address->ss_family == AF_INET6 ? (const void *)&((const struct sockaddr_in6 *)address)->sin6_addr
                                                    : (const void *)&((const struct sockaddr_in *)address)->sin_addr;

    if (!inet_ntop(address->ss_family, at, out, 64))
        out[0] = 0;
}

bool link_same_network(const struct sockaddr_storage *a, const struct sockaddr_storage *b)
{
    uint8_t of_a[16], of_b[16];

    sst_brake_network((const struct sockaddr *)a, of_a);
    sst_brake_network((const struct sockaddr *)b, of_b);
    return !memcmp(of_a, of_b, sizeof(of_a));
}

/* --- messages ----------------------------------------------------------------------------------------------------- */

static int make_room(uint8_t **buffer, size_t *room, size_t need)
{
    uint8_t *grown;
    size_t size = *room ? *room : IN_STEP;

    if (need <= *room)
        return 0;
    while (size < need)
        size += size / 2;
    grown = realloc(*buffer, size);
    if (!grown)
        return -ENOMEM;
    *buffer = grown;
    *room = size;
    return 0;
}

static uint32_t word(const uint8_t *in)
{
    return (uint32_t)(wire_get_u64((const uint8_t[8]){ in[0], in[1], in[2], in[3] }));
}

int link_stream_next(struct link_stream *s, enum message_type *type, const uint8_t **data, size_t *bytes)
{
    size_t length;

    if (s->taken) {
        memmove(s->in, s->in + s->taken, s->in_bytes - s->taken);
        s->in_bytes -= s->taken;
        s->taken = 0;
    }
    if (s->in_bytes < MESSAGE_HEAD)
        return 0;
    length = word(s->in + 4);
    if (length > s->most)
        return -EBADMSG;
    if (s->in_bytes < MESSAGE_HEAD + length)
        return 0;
    *type = (enum message_type)word(s->in);
    *data = s->in + MESSAGE_HEAD;
    *bytes = length;
    s->taken = MESSAGE_HEAD + length;
    return 1;
}

uint8_t *link_stream_add(struct link_stream *s, enum message_type type, size_t bytes)
{
    uint8_t *at;

    if (s->out_at == s->out_bytes)
        s->out_at = s->out_bytes = 0;
    if (make_room(&s->out, &s->out_room, s->out_bytes + MESSAGE_HEAD + bytes))
        return NULL;
    at = s->out + s->out_bytes;
    wire_put_u64(at, (uint64_t)bytes << 32 | (uint64_t)type);
    s->out_bytes += MESSAGE_HEAD + bytes;
    return at + MESSAGE_HEAD;
}

int link_stream_add_json(struct link_stream *s, enum message_type type, json_t *message)
{
    char *text = message ? json_dumps(message, JSON_COMPACT) : NULL;
    uint8_t *at = text ? link_stream_add(s, type, strlen(text)) : NULL;

    if (at)
        memcpy(at, text, strlen(text));
    free(text);
    json_decref(message);
    return at ? 0 : -ENOMEM;
}

size_t link_stream_waiting(const struct link_stream *s)
{
    return s->out_bytes - s->out_at;
}

#if WITH_HTTPD

#include <gnutls/gnutls.h>

struct link_tls {
    gnutls_session_t session;
    size_t resume; /* bytes of a record that the socket did not accept whole */
};

int link_stream_open(struct link_stream *s, int fd, struct link_credentials *credentials, bool server, size_t most)
{
    struct link_tls *t = calloc(1, sizeof(*t));

    *s = (struct link_stream){ .fd = fd, .tls = t, .server = server, .most = most };
    if (!t || link_session_create(&t->session, credentials, server, false))
        return -ENOMEM;
    gnutls_transport_set_int(t->session, fd);
    return 0;
}

static int shake_hands(struct link_stream *s, char why[256])
{
    const int r = gnutls_handshake(s->tls->session);
    int err;

    if (r < 0)
        return link_session_judge(r, why);
    err = link_session_verify(s->tls->session, s->peer, why);
    s->ready = !err;
    return err;
}

static int send_all(struct link_stream *s, char why[256])
{
    while (s->out_at < s->out_bytes) {
        /* A record of which a part was sent must be continued as it was, though the buffer may have moved since. */
        const ssize_t n = s->tls->resume
                              ? gnutls_record_send(s->tls->session, NULL, 0)
                              : gnutls_record_send(s->tls->session, s->out + s->out_at, s->out_bytes - s->out_at);

        if (n == GNUTLS_E_AGAIN || n == GNUTLS_E_INTERRUPTED) {
            s->tls->resume = 1;
            return 0;
        }
        if (n < 0)
            return link_session_judge(n, why);
        s->tls->resume = 0;
        s->out_at += (size_t)n;
        s->sent_bytes += (uint64_t)n;
    }
    return 0;
}

static int receive_all(struct link_stream *s, char why[256])
{
    /* No more than one message ahead: a slow reader slows the sender down. */
    while (s->in_bytes <= s->most + MESSAGE_HEAD) {
        ssize_t n;

        if (make_room(&s->in, &s->in_room, s->in_bytes + IN_STEP))
            return -ENOMEM;
        n = gnutls_record_recv(s->tls->session, s->in + s->in_bytes, IN_STEP);
        if (n == 0) {
            snprintf(why, 256, "the connection was closed");
            return -ECONNRESET;
        }
        if (n == GNUTLS_E_AGAIN)
            return 0;
        if (n < 0) {
            const int err = link_session_judge(n, why);

            if (err)
                return err;
            continue;
        }
        s->in_bytes += (size_t)n;
        s->received_bytes += (uint64_t)n;
    }
    return 0;
}

int link_stream_work(struct link_stream *s, char why[256])
{
    int err = s->ready ? 0 : shake_hands(s, why);

    if (!err && s->ready)
        err = receive_all(s, why);
    if (!err && s->ready)
        err = send_all(s, why);
    return err;
}

bool link_stream_greeted(const struct link_stream *s)
{
    return s->ready || gnutls_handshake_get_last_in(s->tls->session) == GNUTLS_HANDSHAKE_CLIENT_HELLO;
}

short link_stream_events(const struct link_stream *s)
{
    const bool sends = s->ready ? link_stream_waiting(s) > 0 : gnutls_record_get_direction(s->tls->session) == 1;

    return (short)(POLLIN | (sends ? POLLOUT : 0));
}

void link_stream_close(struct link_stream *s)
{
    if (s->tls) {
        if (s->ready) /* without waiting: the other side notices the closed socket, too */
            (void)gnutls_bye(s->tls->session, GNUTLS_SHUT_WR);
        if (s->tls->session)
            gnutls_deinit(s->tls->session);
        free(s->tls);
    }
    if (s->fd >= 0)
        close(s->fd);
    free(s->in);
    free(s->out);
    *s = (struct link_stream){ .fd = -1 };
}

#else

#include "base/absent.h"

SST_ABSENT(int, -ENOSYS, link_stream_open, struct link_stream *s, int fd, struct link_credentials *credentials,
           bool server, size_t most)
SST_ABSENT(int, -ENOSYS, link_stream_work, struct link_stream *s, char why[256])
SST_ABSENT(bool, false, link_stream_greeted, const struct link_stream *s)
SST_ABSENT(short, 0, link_stream_events, const struct link_stream *s)
SST_ABSENT(void, , link_stream_close, struct link_stream *s)

#endif
