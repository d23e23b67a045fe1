/* Viewers of H.264 over WebSocket (RFC 6455): handshake, units in order, messages of the viewer.
 *
 * A viewer has a thread, and gets a unit when the one before is with the kernel. The kernel, proxies and the network
 * would still hold seconds of pictures: so a ping follows a unit, one at a time, and while its answer is late nothing
 * more is sent. Then the viewer goes on with the next key picture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* POLLRDHUP, strcasestr */
#include "daemon/publish/publish_internal.h"

#include <errno.h>
#include <gnutls/gnutls.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sha1.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/thread.h"

#define UNIT_HEAD  20          /* bytes before a picture: time in us, number of the set, flags */
#define UNSENT_MAX 65536       /* bytes that the kernel buffers for a slow viewer */
#define LATE_NS    400000000LL /* of the answer to a ping, beyond two times the quickest */
#define SILENCE    2           /* idle times after which a viewer that answers nothing is disconnected */
#define MESSAGES   64          /* of a viewer in a second, unasked ones */
#define CLOSE_NS   1000000000LL
#define SMALL_MAX  1024        /* bytes, the last ones for a close */

struct http_watch {
    struct sst_http *http;
    struct sst_slot *slot;    /* NULL: refused */
    struct http_video *video; /* while its thread runs */
    struct http_watcher watcher;
    MHD_socket sock;
    struct MHD_UpgradeResponseHandle *upgrade;
    char session[HTTP_SESSION_NAME + 1];
    int code;      /* to close with; 0: goes on */
    char why[512]; /* reason to send with it */
    bool counted;  /* among the streams */
    struct http_ws_reader reader;
    int messages; /* since second_ns */
    int64_t second_ns;
    /* out */
    const struct http_unit *unit; /* being sent */
    uint8_t head[HTTP_WS_HEAD + UNIT_HEAD];
    size_t head_bytes, at; /* of head and unit */
    uint8_t small[SMALL_MAX]; /* whole messages that wait for the end of a unit */
    size_t small_bytes;
    uint64_t number; /* of the last unit; 0: none */
    bool key;        /* only a key picture will do */
    int width, height;
    char codec[16]; /* as the viewer knows them */
    /* pings */
    bool awaited, late;
    uint8_t ping[8]; /* data of the last one */
    int64_t ping_ns, trip_ns; /* of the last ping; the quickest answer */
};

/* --- handshake, on the connection's thread ------------------------------------------------------------------------ */

void http_watch_drop(struct http_watch *w)
{
    if (!w)
        return;
    if (w->slot)
        sst_slot_leave(w->slot);
    sst_slot_unref(w->slot);
    http_unit_unref(w->unit);
    if (w->counted)
        atomic_fetch_sub(&w->http->count->streams, 1);
    if (w->watcher.wake >= 0)
        close(w->watcher.wake);
    free(w);
}

/* Is `word` one of a header's, which commas separate? */
static bool has_word(const char *header, const char *word)
{
    const size_t n = strlen(word);

    for (const char *at = header; at && *at; at = strchr(at, ',') ? strchr(at, ',') + 1 : NULL) {
        const char *begin = at + strspn(at, " \t");

        if (!strncasecmp(begin, word, n) && strchr(", \t", begin[n]))
            return true;
    }
    return false;
}

/* @param out  [32] @return false: no key */
static bool accept_of(const char *key, char *out)
{
    static const char guid[] = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";
    uint8_t digest[SHA1_DIGEST_LENGTH];
    gnutls_datum_t text = { 0 };
    SHA1_CTX sha;

    if (!key || strlen(key) != 24 || strcmp(key + 22, "=="))
        return false;
    SHA1Init(&sha);
    SHA1Update(&sha, (const uint8_t *)key, 24);
    SHA1Update(&sha, (const uint8_t *)guid, sizeof(guid) - 1);
    SHA1Final(digest, &sha);
    if (gnutls_base64_encode2(&(gnutls_datum_t){ digest, sizeof(digest) }, &text))
        return false;
    snprintf(out, 32, "%.*s", (int)text.size, (const char *)text.data);
    gnutls_free(text.data);
    return true;
}

/* @return -1: a handshake that can be answered; else answered */
static int check_handshake(struct http_request *q, char *accept)
{
    const char *version = http_header(q, "Sec-WebSocket-Version");

    if (http_is_foreign(q))
        return http_reply_error(q, MHD_HTTP_FORBIDDEN, "a page of another origin may not watch");
    if (MHD_is_feature_supported(MHD_FEATURE_UPGRADE) != MHD_YES)
        return http_reply_error(q, MHD_HTTP_NOT_IMPLEMENTED, "libmicrohttpd of this machine has no WebSocket");
    if (q->head || !has_word(http_header(q, "Upgrade"), "websocket") || !has_word(http_header(q, "Connection"), "upgrade"))
        return http_reply_error(q, MHD_HTTP_UPGRADE_REQUIRED,
                                "this is a WebSocket: send Upgrade: websocket; a proxy has to pass Upgrade and Connection");
    if (!version || strcmp(version, "13"))
        return http_reply_error(q, MHD_HTTP_UPGRADE_REQUIRED, "the version of WebSocket is 13: Sec-WebSocket-Version");
    if (!accept_of(http_header(q, "Sec-WebSocket-Key"), accept))
        return http_reply_error(q, MHD_HTTP_BAD_REQUEST, "Sec-WebSocket-Key is 16 bytes in base64");
    return -1;
}

/* A browser shows its page nothing of a refused handshake: the reason comes as the first message, a close. */
static void refuse(struct http_watch *w, int status, const char *why)
{
    w->code = HTTP_WS_STATUS + status;
    snprintf(w->why, sizeof(w->why), "%s", why);
}

static struct http_watch *create(struct http_request *q, enum sst_api_picture kind, const char *name)
{
    struct http_watch *w = calloc(1, sizeof(*w));
    struct sst_api_answer answer = { 0 };
    char why[128];
    int err;

    if (!w)
        return NULL;
    w->http = q->http;
    w->key = true;
    memcpy(w->session, q->session, sizeof(w->session));
    w->watcher.wake = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    w->counted = http_stream_begin(q);
    if (!w->counted) {
        snprintf(why, sizeof(why), HTTP_STREAMS_FULL, q->http->cfg.streams);
        refuse(w, MHD_HTTP_SERVICE_UNAVAILABLE, why);
        return w;
    }
    err = http_find_slot(q, kind, name, &w->slot, &answer);
    if (err)
        refuse(w, http_status_of(err), answer.error[0] ? answer.error : "nothing has been captured yet");
    else
        sst_slot_join(w->slot);
    return w;
}

/* --- out ---------------------------------------------------------------------------------------------------------- */

static void end(struct http_watch *w, int code, const char *why)
{
    if (w->code)
        return;
    w->code = code;
    snprintf(w->why, sizeof(w->why), "%s", why);
}

/* A message that the viewer's buffer has no room for: it does not read, and lets us answer. */
static void add_small(struct http_watch *w, enum http_ws_op op, const void *data, size_t bytes)
{
    uint8_t head[HTTP_WS_HEAD];
    const size_t n = http_ws_head(head, op, bytes), most = SMALL_MAX - (op == HTTP_WS_CLOSE ? 0 : 2 + HTTP_WS_MAX);

    if (w->small_bytes + n + bytes > most) {
        end(w, HTTP_WS_POLICY, "too many messages");
        return;
    }
    memcpy(w->small + w->small_bytes, head, n);
    memcpy(w->small + w->small_bytes + n, data, bytes);
    w->small_bytes += n + bytes;
}

static void put_number(uint8_t *to, uint64_t v, int bytes)
{
    for (int i = 0; i < bytes; i++)
        to[i] = (uint8_t)(v >> 8 * (bytes - 1 - i));
}

/* Codec and size, unless the viewer knows them. */
static void describe(struct http_watch *w, const struct http_unit *u)
{
    char text[160];

    if (u->width == w->width && u->height == w->height && !strcmp(u->codec, w->codec))
        return;
    w->width = u->width;
    w->height = u->height;
    memcpy(w->codec, u->codec, sizeof(w->codec));
    snprintf(text, sizeof(text), "{\"codec\":\"%s\",\"width\":%d,\"height\":%d,\"encoder\":\"%s\"}", u->codec, u->width,
             u->height, u->encoder);
    add_small(w, HTTP_WS_TEXT, text, strlen(text));
}

/* The next unit to send, if there is one and the viewer keeps up. */
static bool take_unit(struct http_watch *w)
{
    const int64_t now_ns = sst_clock_now_ns();
    const struct http_unit *u;

    w->late |= w->awaited && now_ns - w->ping_ns > LATE_NS + 2 * w->trip_ns;
    if (w->late && w->awaited)
        return false;
    w->key |= w->late;
    w->late = false;
    u = http_video_next(w->video, w->number, &w->key);
    if (!u)
        return false;
    if (w->number)
        atomic_fetch_add(&w->http->count->skipped, u->number - w->number - 1);
    w->number = u->number;
    describe(w, u);
    w->unit = u;
    w->at = 0;
    w->head_bytes = http_ws_head(w->head, HTTP_WS_BINARY, UNIT_HEAD + u->bytes);
    put_number(w->head + w->head_bytes, (uint64_t)(u->wall_ns / 1000), 8);
    put_number(w->head + w->head_bytes + 8, u->set, 8);
    put_number(w->head + w->head_bytes + 16, u->key, 4);
    w->head_bytes += UNIT_HEAD;
    return true;
}

/* @return bytes; 0: not now; negative: gone */
static ssize_t push_some(struct http_watch *w, const void *data, size_t bytes)
{
    const ssize_t n = send(w->sock, data, bytes, MSG_DONTWAIT | MSG_NOSIGNAL);

    if (n >= 0) {
        atomic_fetch_add(&w->http->count->bytes, (uint64_t)n);
        return n;
    }
    return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR ? 0 : -1;
}

static void unit_sent(struct http_watch *w)
{
    http_unit_unref(w->unit);
    w->unit = NULL;
    if (w->awaited)
        return;
    w->awaited = true;
    w->ping_ns = sst_clock_now_ns();
    put_number(w->ping, w->number, sizeof(w->ping));
    add_small(w, HTTP_WS_PING, w->ping, sizeof(w->ping));
}

/* Send all that waits, small messages between units. @return 1: all is sent; 0: not now; negative: gone */
static int push(struct http_watch *w)
{
    while (w->unit || w->small_bytes) {
        const bool small = w->small_bytes && (!w->unit || !w->at);
        const bool head = w->at < w->head_bytes;
        const uint8_t *data = small ? w->small : head ? w->head + w->at : w->unit->data + (w->at - w->head_bytes);
        const size_t left = small ? w->small_bytes : head ? w->head_bytes - w->at : w->unit->bytes + w->head_bytes - w->at;
        const ssize_t n = push_some(w, data, left);

        if (n <= 0)
            return (int)n;
        if (small) { /* the rest of a message keeps its place before the unit */
            memmove(w->small, w->small + n, w->small_bytes - (size_t)n);
            w->small_bytes -= (size_t)n;
            continue;
        }
        w->at += (size_t)n;
        if (w->at == w->head_bytes + w->unit->bytes)
            unit_sent(w);
    }
    return 1;
}

/* --- in ----------------------------------------------------------------------------------------------------------- */

static bool is_answer(const struct http_watch *w, const struct http_ws_message *m)
{
    return m->op == HTTP_WS_PONG && w->awaited && m->bytes == sizeof(w->ping) && !memcmp(m->data, w->ping, m->bytes);
}

static void answered(struct http_watch *w)
{
    const int64_t trip_ns = sst_clock_now_ns() - w->ping_ns;

    w->awaited = false;
    w->trip_ns = !w->trip_ns || trip_ns < w->trip_ns ? trip_ns : w->trip_ns;
    w->messages--;
}

/* Control frames of any kind are answered, as long as there are not too many. */
static void take_message(struct http_watch *w, const struct http_ws_message *m)
{
    const int64_t now_ns = sst_clock_now_ns();

    if (now_ns - w->second_ns > 1000000000) {
        w->second_ns = now_ns;
        w->messages = 0;
    }
    if (++w->messages > MESSAGES)
        end(w, HTTP_WS_POLICY, "too many messages");
    else if (is_answer(w, m))
        answered(w);
    else if (m->op == HTTP_WS_PING)
        add_small(w, HTTP_WS_PONG, m->data, m->bytes);
    else if (m->op == HTTP_WS_CLOSE)
        end(w, m->bytes ? m->data[0] << 8 | m->data[1] : 1000, "");
    else if (m->op == HTTP_WS_TEXT && m->bytes == 3 && !memcmp(m->data, "key", 3))
        w->key = true;
    else if (m->op == HTTP_WS_TEXT)
        end(w, HTTP_WS_POLICY, "the one message is \"key\"");
}

static void parse(struct http_watch *w, const uint8_t *data, size_t bytes)
{
    struct http_ws_message m;
    size_t at = 0, used;

    while (at < bytes && !w->code) {
        const int done = http_ws_read(&w->reader, data + at, bytes - at, &used, &m);

        at += used;
        if (done < 0)
            end(w, -done, "");
        else if (done)
            take_message(w, &m);
    }
}

/* @return false: the peer has gone */
static bool receive(struct http_watch *w)
{
    uint8_t data[2048];
    const ssize_t n = recv(w->sock, data, sizeof(data), MSG_DONTWAIT);

    if (n > 0)
        parse(w, data, (size_t)n);
    return n > 0 || (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR));
}

/* --- its thread --------------------------------------------------------------------------------------------------- */

static void check_end(struct http_watch *w)
{
    const int64_t silence_ns = INT64_C(1000000000) * SILENCE * w->http->cfg.idle_s;
    char why[256];

    if (w->code)
        return;
    if (atomic_load(&w->http->stopping))
        end(w, HTTP_WS_GONE, "the service ends");
    else if (sst_slot_is_shut(w->slot))
        end(w, HTTP_WS_GONE, "the picture has ended");
    else if (!http_session_lasts(&w->http->auth.sessions, w->session))
        end(w, HTTP_WS_STATUS + MHD_HTTP_UNAUTHORIZED, "the session has ended");
    else if (http_video_over(w->video, why))
        end(w, HTTP_WS_STATUS + MHD_HTTP_NOT_IMPLEMENTED, why);
    else if (w->awaited && sst_clock_now_ns() - w->ping_ns > silence_ns)
        end(w, HTTP_WS_POLICY, "pings are not answered");
}

/* Wait for the socket, a unit, or a while. */
static void await(const struct http_watch *w, bool out)
{
    struct pollfd p[] = { { .fd = w->sock, .events = (short)(POLLIN | (out ? POLLOUT : 0)) },
                          { .fd = w->watcher.wake, .events = POLLIN } };
    uint64_t count;

    if (poll(p, ARRAY_LEN(p), w->late ? HTTP_WAIT_MS / 4 : HTTP_WAIT_MS) > 0 && (p[1].revents & POLLIN))
        (void)!read(w->watcher.wake, &count, sizeof(count));
}

/* Read on after our close. @return false: the peer's close, or its end */
static bool drain(struct http_watch *w, bool *parsed)
{
    struct http_ws_message m = { 0 };
    uint8_t data[2048];
    const ssize_t n = recv(w->sock, data, sizeof(data), MSG_DONTWAIT);
    size_t at = 0, used;

    while (n > 0 && at < (size_t)n && *parsed) {
        const int done = http_ws_read(&w->reader, data + at, (size_t)n - at, &used, &m);

        at += used;
        *parsed = done >= 0; /* else bytes without a meaning */
        if (done > 0 && m.op == HTTP_WS_CLOSE)
            return false;
    }
    return n > 0 || (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR));
}

static void add_close(struct http_watch *w)
{
    size_t n = strnlen(w->why, HTTP_WS_MAX - 2);
    uint8_t data[HTTP_WS_MAX];

    while (n && ((uint8_t)w->why[n] & 0xc0) == 0x80)
        n--; /* not within a character */
    put_number(data, (uint64_t)w->code, 2);
    memcpy(data + 2, w->why, n);
    if (!w->at) { /* else the rest of a unit comes first */
        http_unit_unref(w->unit);
        w->unit = NULL;
    }
    add_small(w, HTTP_WS_CLOSE, data, 2 + n);
    w->awaited = true; /* no ping follows */
}

/* Send the reason, then read until the peer has seen it: unread bytes in a socket that closes would destroy it. */
static void say_goodbye(struct http_watch *w)
{
    const int64_t end_ns = sst_clock_now_ns() + (atomic_load(&w->http->stopping) ? CLOSE_NS / 3 : CLOSE_NS);
    bool parsed = w->code >= HTTP_WS_STATUS || w->code <= HTTP_WS_GONE, said = false;
    int done;

    add_close(w);
    do {
        struct pollfd p = { .fd = w->sock, .events = POLLIN };

        done = said ? 1 : push(w);
        if (done == 1 && !said)
            shutdown(w->sock, SHUT_WR);
        said |= done == 1;
        p.events |= said ? 0 : POLLOUT;
        (void)poll(&p, 1, HTTP_WAIT_MS / 4);
        if (p.revents & ~POLLOUT && !drain(w, &parsed))
            break;
    } while (done >= 0 && sst_clock_now_ns() < end_ns);
}

static void *watch(void *arg)
{
    struct http_watch *w = arg;
    struct sst_http *http = w->http;
    bool there = true;

    sst_thread_name("sst-watch");
    if (!w->code)
        w->video = http_video_join(http, w->slot, &w->watcher);
    if (!w->code && !w->video)
        end(w, HTTP_WS_STATUS + MHD_HTTP_SERVICE_UNAVAILABLE, "out of memory");
    atomic_fetch_add(&http->count->videos, w->video != NULL);
    while (there && !w->code) {
        int sent;

        do
            sent = push(w);
        while (sent == 1 && !w->code && take_unit(w));
        there = sent >= 0;
        if (there && !w->code)
            await(w, sent == 0);
        there = there && receive(w);
        check_end(w);
    }
    if (there)
        say_goodbye(w);
    atomic_fetch_sub(&http->count->videos, w->video != NULL);
    http_video_leave(w->video, &w->watcher);
    (void)MHD_upgrade_action(w->upgrade, MHD_UPGRADE_ACTION_CLOSE);
    http_watch_drop(w);
    http_thread_ended(&http->videos);
    return NULL;
}

static void on_upgrade(void *cls, struct MHD_Connection *connection SST_UNUSED, void *request, const char *extra,
                       size_t extra_bytes, MHD_socket sock, struct MHD_UpgradeResponseHandle *upgrade)
{
    struct http_request *q = request;
    struct http_watch *w = cls;
    const int on = 1;

    q->watch = NULL;
    q->upgraded = true;
    w->sock = sock;
    w->upgrade = upgrade;
    (void)!setsockopt(sock, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
    parse(w, (const uint8_t *)extra, extra_bytes);
    if (http_thread_start(&w->http->videos, watch, w)) {
        (void)MHD_upgrade_action(upgrade, MHD_UPGRADE_ACTION_CLOSE);
        http_watch_drop(w);
    }
}

int http_do_watch(struct http_request *q, enum sst_api_picture kind, const char *name)
{
    const int unsent = UNSENT_MAX;
    struct MHD_Response *response;
    char accept[32];
    const int done = check_handshake(q, accept);

    if (done >= 0)
        return done;
    q->watch = create(q, kind, name);
    response = q->watch && q->watch->watcher.wake >= 0 ? MHD_create_response_for_upgrade(on_upgrade, q->watch) : NULL;
    if (!response)
        return MHD_NO;
    if (!q->local)
        (void)!setsockopt(q->fd, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &unsent, sizeof(unsent));
    http_set(response, "Upgrade", "websocket");
    http_set(response, "Sec-WebSocket-Accept", "%s", accept);
    return http_reply(q, MHD_HTTP_SWITCHING_PROTOCOLS, response);
}
