/* Datagrams between hosts, over DTLS 1.2 with the certificates of the TLS connection: a client of a node, a server of
 * the head, which serves all nodes by one socket. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* recvmmsg() */
#include "capture/link/link_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"

#if WITH_HTTPD && WITH_ISAL

#include <gnutls/dtls.h>
#include <gnutls/gnutls.h>

#define MTU          1232 /* bytes of a datagram: with its IPv6 and UDP headers 1280, which every path carries */
#define RESEND_MS    150  /* of handshakes */
#define HANDSHAKE_MS 1000 /* then another one has better chances */
#define IDLE_NS      INT64_C(5000000000) /* a session of which nothing comes ends with its node's connection */
#define REPLACE_NS   INT64_C(1000000000) /* ... and makes way for a new one from the same port after this */
#define BUFFER_BYTES (4 << 20)
#define PEERS        (2 * LINK_NODES + 64)
#define BATCH        32
#define ROUNDS       16 /* batches, before others have their turn */

static int open_socket(const char *address, int port, struct sockaddr_storage *at, unsigned *bytes)
{
    const int room = BUFFER_BYTES;
    int fd, err = link_address(address, port, at, bytes);

    if (err)
        return err;
    fd = socket(at->ss_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0)
        return -errno;
    /* The kernel grants as much as net.core.rmem_max and wmem_max permit. */
    (void)setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &room, sizeof(room));
    (void)setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &room, sizeof(room));
    return fd;
}

/* Records of a handshake that leave together: in a datagram of its own each, they overtake each other on a network that
 * delays them by different times, and GnuTLS then begins a flight again and again. */
struct flight {
    uint8_t data[MTU];
    size_t bytes;
};

/* Socket, and the address of the other end; `at` NULL: it is connected. */
struct end {
    int fd;
    const struct sockaddr_storage *at;
    socklen_t at_bytes;
};

static void send_flight(struct flight *f, struct end to)
{
    if (f->bytes && sendto(to.fd, f->data, f->bytes, MSG_DONTWAIT | MSG_NOSIGNAL, (const struct sockaddr *)to.at,
                           to.at_bytes) < 0) {
        /* it is lost, as others are: the handshake is repeated */
    }
    f->bytes = 0;
}

static ssize_t push_flight(struct flight *f, struct end to, const void *data, size_t bytes)
{
    if (bytes > MTU) {
        errno = EMSGSIZE;
        return -1;
    }
    if (f->bytes + bytes > MTU)
        send_flight(f, to);
    memcpy(f->data + f->bytes, data, bytes);
    f->bytes += bytes;
    return (ssize_t)bytes;
}

/* --- client ------------------------------------------------------------------------------------------------------- */

struct link_dtls {
    int fd;
    gnutls_session_t session;
    bool ready;
    char peer[64];
    struct flight flight;
};

static ssize_t push_client(gnutls_transport_ptr_t arg, const void *data, size_t bytes)
{
    struct link_dtls *d = arg;
    ssize_t n;

    if (!d->ready)
        return push_flight(&d->flight, (struct end){ .fd = d->fd }, data, bytes);
    n = send(d->fd, data, bytes, MSG_DONTWAIT | MSG_NOSIGNAL);
    /* A datagram that the network does not accept now, for want of a route or of room, is lost. */
    return n < 0 && errno != EAGAIN ? (ssize_t)bytes : n;
}

int link_dtls_open(struct link_dtls **out, const char *address, int port, struct link_credentials *credentials)
{
    struct link_dtls *d = calloc(1, sizeof(*d));
    struct sockaddr_storage to;
    unsigned bytes;
    int err;

    if (!d)
        return -ENOMEM;
    d->fd = open_socket(address, port, &to, &bytes);
    err = d->fd < 0 ? d->fd : 0;
    if (!err && connect(d->fd, (const struct sockaddr *)&to, bytes) < 0)
        err = -errno;
    err = err ? err : link_session_create(&d->session, credentials, false, true);
    if (err) {
        link_dtls_close(d);
        return err;
    }
    gnutls_dtls_set_mtu(d->session, MTU);
    gnutls_dtls_set_timeouts(d->session, RESEND_MS, HANDSHAKE_MS);
    gnutls_transport_set_ptr2(d->session, (gnutls_transport_ptr_t)(intptr_t)d->fd, d);
    gnutls_transport_set_push_function(d->session, push_client);
    *out = d;
    return 0;
}

/* The head sends nothing but alerts and the rest of a handshake. */
static int listen_to(struct link_dtls *d, char why[256])
{
    uint8_t away[MTU];
    ssize_t n;

    while ((n = gnutls_record_recv(d->session, away, sizeof(away))) > 0)
        ;
    if (n == 0) {
        snprintf(why, 256, "the head has ended it");
        return -ECONNRESET;
    }
    return link_session_judge(n, why);
}

int link_dtls_work(struct link_dtls *d, char why[256])
{
    int r;

    if (d->ready)
        return listen_to(d, why);
    r = gnutls_handshake(d->session);
    send_flight(&d->flight, (struct end){ .fd = d->fd });
    if (r < 0)
        return link_session_judge(r, why);
    r = link_session_verify(d->session, d->peer, why);
    d->ready = !r;
    return r;
}

bool link_dtls_ready(const struct link_dtls *d)
{
    return d && d->ready;
}

const char *link_dtls_peer(const struct link_dtls *d)
{
    return d->peer;
}

int link_dtls_fd(const struct link_dtls *d)
{
    return d->fd;
}

int link_dtls_send(struct link_dtls *d, const uint8_t *data, size_t bytes)
{
    const ssize_t n = gnutls_record_send(d->session, data, bytes);

    if (n == GNUTLS_E_AGAIN || n == GNUTLS_E_INTERRUPTED)
        return -EAGAIN;
    return n < 0 ? -ECONNRESET : 0;
}

void link_dtls_close(struct link_dtls *d)
{
    if (!d)
        return;
    if (d->session) {
        if (d->ready)
            (void)gnutls_bye(d->session, GNUTLS_SHUT_WR);
        gnutls_deinit(d->session);
    }
    if (d->fd >= 0)
        close(d->fd);
    free(d);
}

/* --- server ------------------------------------------------------------------------------------------------------- */

struct peer {
    struct link_dtls_server *server; /* NULL: unused */
    gnutls_session_t session;
    struct sockaddr_storage at;
    socklen_t at_bytes;
    bool ready;
    char name[64];
    int64_t began_ns, last_ns;
    const uint8_t *data; /* the datagram that it is to read; NULL: none */
    size_t bytes;
    struct flight flight;
};

struct link_dtls_server {
    /* fixed after open */
    int fd;
    struct link_credentials *credentials;
    struct link_dtls_events events;
    gnutls_datum_t cookie_key;
    /* link thread */
    struct peer peer[PEERS];
    uint64_t overflows;
    uint8_t buffer[BATCH][2048];
    struct sst_log_limit strangers;
};

/* The cookie, to a sender without a session. */
static ssize_t push_stranger(gnutls_transport_ptr_t arg, const void *data, size_t bytes)
{
    const struct end *to = arg;

    return sendto(to->fd, data, bytes, MSG_DONTWAIT | MSG_NOSIGNAL, (const struct sockaddr *)to->at, to->at_bytes);
}

static ssize_t push(gnutls_transport_ptr_t arg, const void *data, size_t bytes)
{
    struct peer *p = arg;

    return push_flight(&p->flight, (struct end){ p->server->fd, &p->at, p->at_bytes }, data, bytes);
}

static void flush(struct peer *p)
{
    send_flight(&p->flight, (struct end){ p->server->fd, &p->at, p->at_bytes });
}

static ssize_t pull(gnutls_transport_ptr_t arg, void *data, size_t bytes)
{
    struct peer *p = arg;
    const size_t n = p->bytes < bytes ? p->bytes : bytes;

    if (!p->data) {
        gnutls_transport_set_errno(p->session, EAGAIN);
        return -1;
    }
    memcpy(data, p->data, n);
    p->data = NULL;
    return (ssize_t)n;
}

static int pull_waits(gnutls_transport_ptr_t arg, unsigned ms SST_UNUSED)
{
    return ((const struct peer *)arg)->data != NULL;
}

int link_dtls_listen(struct link_dtls_server **out, const char *address, int port, struct link_credentials *credentials,
                     const struct link_dtls_events *events)
{
    struct link_dtls_server *s = calloc(1, sizeof(*s));
    struct sockaddr_storage at;
    const int on = 1;
    unsigned bytes;
    int err;

    if (!s)
        return -ENOMEM;
    s->credentials = credentials;
    s->events = *events;
    s->strangers.what = "hosts: handshakes for datagrams that were refused";
    s->fd = open_socket(address, port, &at, &bytes);
    err = s->fd < 0 ? s->fd : 0;
    if (!err && (setsockopt(s->fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof(on)) < 0 ||
                 bind(s->fd, (const struct sockaddr *)&at, bytes) < 0))
        err = -errno;
    if (!err && gnutls_key_generate(&s->cookie_key, GNUTLS_COOKIE_KEY_SIZE) < 0)
        err = -ENOMEM;
    if (err)
        link_dtls_server_close(s);
    else
        *out = s;
    return err;
}

static void drop(struct peer *p)
{
    if (p->ready) {
        p->data = NULL;
        (void)gnutls_bye(p->session, GNUTLS_SHUT_WR);
        flush(p);
    }
    gnutls_deinit(p->session);
    *p = (struct peer){ 0 };
}

void link_dtls_server_close(struct link_dtls_server *s)
{
    if (!s)
        return;
    for (int i = 0; i < PEERS; i++)
        if (s->peer[i].server)
            drop(&s->peer[i]);
    sst_log_limit_work(&s->strangers, INT64_MAX);
    if (s->fd >= 0)
        close(s->fd);
    gnutls_free(s->cookie_key.data);
    free(s);
}

int link_dtls_server_fd(const struct link_dtls_server *s)
{
    return s->fd;
}

uint64_t link_dtls_server_overflows(const struct link_dtls_server *s)
{
    return s->overflows;
}

static struct peer *find_peer(struct link_dtls_server *s, const struct sockaddr_storage *at, socklen_t bytes)
{
    for (int i = 0; i < PEERS; i++)
        if (s->peer[i].server && s->peer[i].at_bytes == bytes && !memcmp(&s->peer[i].at, at, bytes))
            return &s->peer[i];
    return NULL;
}

/* Handshakes of one address in excess of LINK_NODES, the most nodes that an array has behind one address. */
static int count_spare(const struct link_dtls_server *s, const struct peer *of)
{
    int n = 0;

    for (int i = 0; i < PEERS; i++)
        n += s->peer[i].server && !s->peer[i].ready && link_same_network(&s->peer[i].at, &of->at);
    return sst_max_int(n - LINK_NODES, 0);
}

/* Where another one has room: unused, or of the address with most handshakes the oldest one. @return NULL: all are
 * nodes */
static struct peer *find_room(struct link_dtls_server *s)
{
    struct peer *oldest = NULL;
    int most = 0;

    for (int i = 0; i < PEERS; i++) {
        struct peer *p = &s->peer[i];
        int spare;

        if (!p->server)
            return p;
        if (p->ready)
            continue;
        spare = count_spare(s, p);
        if (!oldest || spare > most || (spare == most && p->began_ns < oldest->began_ns)) {
            oldest = p;
            most = spare;
        }
    }
    if (oldest)
        drop(oldest);
    return oldest;
}

/* Of a ClientHello in the clear: record type 22, epoch 0, handshake type 1. */
static bool is_hello(const uint8_t *data, size_t bytes)
{
    return bytes > 25 && data[0] == 22 && !data[3] && !data[4] && data[13] == 1;
}

/* A client that has shown by a cookie that it receives at its address gets a session; others get the cookie, and no
 * memory. */
static struct peer *greet(struct link_dtls_server *s, const struct sockaddr_storage *at, socklen_t at_bytes,
                          uint8_t *data, size_t bytes)
{
    struct end stranger = { s->fd, at, at_bytes };
    gnutls_dtls_prestate_st prestate = { 0 };
    struct sockaddr_storage key = *at;
    struct peer *p;

    if (gnutls_dtls_cookie_verify(&s->cookie_key, &key, at_bytes, data, bytes, &prestate) < 0) {
        (void)gnutls_dtls_cookie_send(&s->cookie_key, &key, at_bytes, &prestate, &stranger, push_stranger);
        return NULL;
    }
    p = find_room(s);
    if (!p || link_session_create(&p->session, s->credentials, true, true))
        return NULL;
    p->server = s;
    p->at = *at;
    p->at_bytes = at_bytes;
    p->began_ns = p->last_ns = sst_clock_now_ns();
    gnutls_dtls_prestate_set(p->session, &prestate);
    gnutls_dtls_set_mtu(p->session, MTU);
    gnutls_dtls_set_timeouts(p->session, RESEND_MS, HANDSHAKE_MS);
    gnutls_transport_set_ptr(p->session, p);
    gnutls_transport_set_push_function(p->session, push);
    gnutls_transport_set_pull_function(p->session, pull);
    gnutls_transport_set_pull_timeout_function(p->session, pull_waits);
    return p;
}

static void shake_hands(struct link_dtls_server *s, struct peer *p)
{
    const int r = gnutls_handshake(p->session);
    char why[256] = "";
    int err;

    flush(p);
    err = r < 0 ? link_session_judge(r, why) : link_session_verify(p->session, p->name, why);

    if (!err && r < 0)
        return;
    if (!err && !s->events.known(s->events.arg, p->name)) {
        snprintf(why, sizeof(why), "\"%s\" is not connected over TLS", p->name);
        err = -EACCES;
    }
    if (err) {
        char address[64];

        link_address_text(&p->at, address);
        if (sst_log_limit_due(&s->strangers, (const struct sockaddr *)&p->at, address, sst_clock_now_ns()))
            sst_log_warning("hosts: datagrams of %s are refused: %s", address, why);
        drop(p);
        return;
    }
    for (int i = 0; i < PEERS; i++) /* the peer of its life before */
        if (&s->peer[i] != p && s->peer[i].ready && !strcmp(s->peer[i].name, p->name))
            drop(&s->peer[i]);
    p->ready = true;
}

static void read_records(struct link_dtls_server *s, struct peer *p)
{
    uint8_t data[2048];
    char why[256];

    while (p->ready) {
        const ssize_t n = gnutls_record_recv(p->session, data, sizeof(data));

        if (n > 0) {
            p->last_ns = sst_clock_now_ns();
            s->events.datagram(s->events.arg, p->name, data, (size_t)n);
        } else if (n == 0 || link_session_judge(n, why)) {
            drop(p);
        } else if (n == GNUTLS_E_AGAIN) {
            flush(p); /* the node has not seen the end of the handshake */
            return;
        }
    }
}

static void take(struct link_dtls_server *s, const struct sockaddr_storage *at, socklen_t at_bytes, uint8_t *data,
                 size_t bytes)
{
    struct peer *p = find_peer(s, at, at_bytes);

    if (is_hello(data, bytes) && (!p || (p->ready && sst_clock_now_ns() - p->last_ns > REPLACE_NS))) {
        struct peer *fresh = greet(s, at, at_bytes, data, bytes);

        if (p && fresh)
            drop(p);
        p = fresh;
    }
    if (!p)
        return;
    p->data = data;
    p->bytes = bytes;
    if (!p->ready)
        shake_hands(s, p);
    if (p->server && p->ready)
        read_records(s, p);
    p->data = NULL;
}

static void count_overflow(struct link_dtls_server *s, struct msghdr *m)
{
    for (struct cmsghdr *c = CMSG_FIRSTHDR(m); c; c = CMSG_NXTHDR(m, c)) {
        uint32_t lost;

        if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SO_RXQ_OVFL)
            continue;
        memcpy(&lost, CMSG_DATA(c), sizeof(lost));
        s->overflows += (uint32_t)(lost - (uint32_t)s->overflows); /* the kernel counts 32 bits */
    }
}

/* @return datagrams that came */
static int receive_batch(struct link_dtls_server *s)
{
    struct sockaddr_storage from[BATCH];
    struct iovec iov[BATCH];
    struct mmsghdr m[BATCH];
    char control[BATCH][CMSG_SPACE(sizeof(uint32_t))];
    int n;

    memset(from, 0, sizeof(from)); /* they are compared as bytes */
    for (int i = 0; i < BATCH; i++) {
        iov[i] = (struct iovec){ s->buffer[i], sizeof(s->buffer[i]) };
        m[i] = (struct mmsghdr){ .msg_hdr = { .msg_name = &from[i],
                                              .msg_namelen = sizeof(from[i]),
                                              .msg_iov = &iov[i],
                                              .msg_iovlen = 1,
                                              .msg_control = control[i],
                                              .msg_controllen = sizeof(control[i]) } };
    }
    n = recvmmsg(s->fd, m, BATCH, MSG_DONTWAIT, NULL);
    for (int i = 0; i < n; i++) {
        count_overflow(s, &m[i].msg_hdr);
        if (!(m[i].msg_hdr.msg_flags & MSG_TRUNC))
            take(s, &from[i], m[i].msg_hdr.msg_namelen, s->buffer[i], m[i].msg_len);
    }
    return n;
}

/* A session lasts as long as its node is connected, also while the trigger rests. */
static bool is_over(const struct link_dtls_server *s, const struct peer *p, int64_t now_ns)
{
    if (!p->ready)
        return now_ns - p->began_ns > HANDSHAKE_MS * INT64_C(1000000);
    return now_ns - p->last_ns > IDLE_NS && !s->events.known(s->events.arg, p->name);
}

bool link_dtls_server_work(struct link_dtls_server *s)
{
    const int64_t now_ns = sst_clock_now_ns();
    bool shaking = false;

    for (int i = 0; i < ROUNDS; i++)
        if (receive_batch(s) < BATCH)
            break;
    for (int i = 0; i < PEERS; i++) {
        struct peer *p = &s->peer[i];

        if (p->server && !p->ready && gnutls_dtls_get_timeout(p->session) == 0)
            shake_hands(s, p);
        if (p->server && is_over(s, p, now_ns))
            drop(p);
        shaking |= p->server && !p->ready;
    }
    sst_log_limit_work(&s->strangers, now_ns);
    return shaking;
}

#else

#include "base/absent.h"

SST_ABSENT(int, -ENOSYS, link_dtls_open, struct link_dtls **out, const char *address, int port,
           struct link_credentials *credentials)
SST_ABSENT(int, -ENOSYS, link_dtls_work, struct link_dtls *d, char why[256])
SST_ABSENT(bool, false, link_dtls_ready, const struct link_dtls *d)
SST_ABSENT(const char *, "", link_dtls_peer, const struct link_dtls *d)
SST_ABSENT(int, -1, link_dtls_fd, const struct link_dtls *d)
SST_ABSENT(int, -ENOSYS, link_dtls_send, struct link_dtls *d, const uint8_t *data, size_t bytes)
SST_ABSENT(void, , link_dtls_close, struct link_dtls *d)
SST_ABSENT(int, -ENOSYS, link_dtls_listen, struct link_dtls_server **out, const char *address, int port,
           struct link_credentials *credentials, const struct link_dtls_events *events)
SST_ABSENT(int, -1, link_dtls_server_fd, const struct link_dtls_server *s)
SST_ABSENT(uint64_t, 0, link_dtls_server_overflows, const struct link_dtls_server *s)
SST_ABSENT(bool, false, link_dtls_server_work, struct link_dtls_server *s)
SST_ABSENT(void, , link_dtls_server_close, struct link_dtls_server *s)

#endif
