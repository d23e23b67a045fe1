/* Connections between hosts.
 *
 * TLS by GnuTLS, the library that the page's HTTPS uses, on plain sockets, and not NNG or libzmq: libzmq's CURVE has
 * keys, no certificates. Debian's NNG has tls+tcp, by Mbed TLS, which would be a second TLS in the service, ends at
 * TLS 1.2, and its sockets say neither what of their queue has left nor which congestion control they use; "every frame
 * in one place" needs the one, a lossy network the other. */
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

#include "base/file.h"
#include "base/log.h"

#define IN_STEP     65536
#define GONE_MS     2000   /* without an answer to what was sent a connection ends */
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
#include <gnutls/x509.h>

#define PRIORITY "SECURE128:-VERS-ALL:+VERS-TLS1.3" /* both sides are ours */

struct link_credentials {
    gnutls_certificate_credentials_t x509;
};

struct link_tls {
    gnutls_session_t session;
    size_t resume; /* bytes of a record that the socket did not accept whole */
};

static int refuse(const char *key, const char *path, int err)
{
    sst_log_error("hosts.%s %s: %s; docs/use/hosts.md says how certificates are made", key, path, gnutls_strerror(err));
    return -EINVAL;
}

int link_credentials_create(struct link_credentials **out, const struct sst_array_config *array)
{
    struct link_credentials *c = calloc(1, sizeof(*c));
    int n, err;

    if (!c || gnutls_certificate_allocate_credentials(&c->x509) < 0) {
        free(c);
        return -ENOMEM;
    }
    n = gnutls_certificate_set_x509_trust_file(c->x509, array->hosts.ca, GNUTLS_X509_FMT_PEM);
    err = n <= 0 ? refuse("ca", array->hosts.ca, n ? n : GNUTLS_E_NO_CERTIFICATE_FOUND) : 0;
    if (!err) {
        n = gnutls_certificate_set_x509_key_file(c->x509, array->hosts.certificate, array->hosts.key,
                                                 GNUTLS_X509_FMT_PEM);
        err = n < 0 ? refuse(n == GNUTLS_E_FILE_ERROR && !sst_path_exists(array->hosts.key) ? "key" : "certificate",
                             array->hosts.certificate, n)
                    : 0;
    }
    if (err) {
        link_credentials_destroy(c);
        return err;
    }
    *out = c;
    return 0;
}

void link_credentials_destroy(struct link_credentials *c)
{
    if (!c)
        return;
    gnutls_certificate_free_credentials(c->x509);
    free(c);
}

int link_stream_open(struct link_stream *s, int fd, struct link_credentials *credentials, bool server, size_t most)
{
    const unsigned flags = (server ? GNUTLS_SERVER : GNUTLS_CLIENT) | GNUTLS_NONBLOCK | GNUTLS_NO_SIGNAL;
    struct link_tls *t = calloc(1, sizeof(*t));

    *s = (struct link_stream){ .fd = fd, .tls = t, .server = server, .most = most };
    if (!t || gnutls_init(&t->session, flags) < 0 || gnutls_priority_set_direct(t->session, PRIORITY, NULL) < 0 ||
        gnutls_credentials_set(t->session, GNUTLS_CRD_CERTIFICATE, credentials->x509) < 0)
        return -ENOMEM;
    if (server)
        gnutls_certificate_server_set_request(t->session, GNUTLS_CERT_REQUIRE);
    gnutls_transport_set_int(t->session, fd);
    return 0;
}

/* The certificate is signed by the authority and in its time. What its name may do is the caller's to judge. */
static int verify(struct link_stream *s, char why[256])
{
    unsigned status = 0, n = 0;
    const gnutls_datum_t *list;
    gnutls_x509_crt_t certificate;
    gnutls_datum_t text;
    size_t size = sizeof(s->peer);
    int err = gnutls_certificate_verify_peers2(s->tls->session, &status);

    if (err < 0 || status) {
        if (err < 0 || gnutls_certificate_verification_status_print(status, GNUTLS_CRT_X509, &text, 0) < 0) {
            snprintf(why, 256, "its certificate cannot be verified: %s", gnutls_strerror(err));
        } else {
            snprintf(why, 256, "%.*s", (int)text.size, text.data);
            gnutls_free(text.data);
        }
        return -EACCES;
    }
    list = gnutls_certificate_get_peers(s->tls->session, &n);
    if (!list || !n || gnutls_x509_crt_init(&certificate) < 0)
        return -EACCES;
    err = gnutls_x509_crt_import(certificate, &list[0], GNUTLS_X509_FMT_DER);
    if (err >= 0)
        err = gnutls_x509_crt_get_dn_by_oid(certificate, GNUTLS_OID_X520_COMMON_NAME, 0, 0, s->peer, &size);
    gnutls_x509_crt_deinit(certificate);
    if (err < 0) {
        snprintf(why, 256, "its certificate has no common name: %s", gnutls_strerror(err));
        return -EACCES;
    }
    return 0;
}

/* @return 0: it waits for the socket, or it was a warning; else what ends the connection */
static int judge(ssize_t n, char why[256])
{
    if (n == GNUTLS_E_AGAIN || n == GNUTLS_E_INTERRUPTED || !gnutls_error_is_fatal((int)n))
        return 0;
    snprintf(why, 256, "%s",
             n == GNUTLS_E_PREMATURE_TERMINATION ? "the connection was closed" : gnutls_strerror((int)n));
    return n == GNUTLS_E_CERTIFICATE_REQUIRED || n == GNUTLS_E_NO_CERTIFICATE_FOUND ? -EACCES : -ECONNRESET;
}

static int shake_hands(struct link_stream *s, char why[256])
{
    const int r = gnutls_handshake(s->tls->session);
    int err;

    if (r < 0)
        return judge(r, why);
    err = verify(s, why);
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
            return judge(n, why);
        s->tls->resume = 0;
        s->out_at += (size_t)n;
        s->sent_bytes += (uint64_t)n;
    }
    return 0;
}

static int receive_all(struct link_stream *s, char why[256])
{
    /* No more than one message ahead: what is not read slows the sender down. */
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
            const int err = judge(n, why);

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

int link_credentials_create(struct link_credentials **out SST_UNUSED, const struct sst_array_config *array SST_UNUSED)
{
    sst_log_error("role: this build has no GnuTLS, by which hosts are connected: build with libmicrohttpd-dev and "
                  "libgnutls28-dev");
    return -ENOSYS;
}

void link_credentials_destroy(struct link_credentials *c SST_UNUSED)
{
}

int link_stream_open(struct link_stream *s SST_UNUSED, int fd SST_UNUSED,
                     struct link_credentials *credentials SST_UNUSED, bool server SST_UNUSED, size_t most SST_UNUSED)
{
    return -ENOSYS;
}

int link_stream_work(struct link_stream *s SST_UNUSED, char why[256] SST_UNUSED)
{
    return -ENOSYS;
}

short link_stream_events(const struct link_stream *s SST_UNUSED)
{
    return 0;
}

void link_stream_close(struct link_stream *s SST_UNUSED)
{
}

#endif
