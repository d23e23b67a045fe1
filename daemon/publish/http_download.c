/* What is kept, as files: whole, or the part that a Range asks for (RFC 9110).
 *
 * The bytes come over a socket from a thread of storage, so that a connection waits for no disk: it ends when the
 * service stops, whatever hangs. An answer whose bytes end too early is broken off, never finished as if whole. */
#include "daemon/publish/publish_internal.h"

#if WITH_HTTPD

#include <errno.h>
#include <inttypes.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"

#define PIECE_BYTES ((size_t)128 << 10)
#define PATIENCE_NS 60000000000LL /* with a disk; a light field that is being made is waited for */
#define TRIES       5             /* for a place at storage */
#define SILENCE_S   60 /* a client who takes nothing goes: players stop when they have enough, and ask again */

struct transfer {
    struct sst_http *http;
    struct http_link *link;
    int fd;
};

/* Some bytes. @return their number; 0: they ended, hang, or nobody wants them any more */
static ssize_t receive(const struct transfer *t, void *out, size_t max)
{
    const int64_t until_ns = sst_clock_now_ns() + PATIENCE_NS;

    while (!atomic_load(&t->http->stopping) && sst_clock_now_ns() < until_ns) {
        struct pollfd p = { .fd = t->fd, .events = POLLIN };
        const int ready = poll(&p, 1, HTTP_WAIT_MS);
        const ssize_t n = ready > 0 ? recv(t->fd, out, max, 0) : -1;

        if (n >= 0)
            return n;
        if ((ready > 0 && errno != EAGAIN && errno != EINTR) || http_peer_gone(t->link->fd))
            return 0;
    }
    return 0;
}

static bool receive_all(const struct transfer *t, void *out, size_t n)
{
    size_t done = 0;
    ssize_t got = 1;

    while (done < n && got > 0) {
        got = receive(t, (char *)out + done, n - done);
        done += (size_t)got;
    }
    return done == n;
}

static ssize_t piece(void *arg, uint64_t pos, char *buf, size_t max)
{
    const struct transfer *t = arg;
    ssize_t n;

    (void)pos;
    http_reader_waits(t->http, t->link);
    n = receive(t, buf, max);
    if (n <= 0)
        return MHD_CONTENT_READER_END_WITH_ERROR;
    http_reader_given(t->http, t->link, (size_t)n);
    atomic_fetch_add(&t->http->bytes, (uint64_t)n);
    return n;
}

static void transfer_free(void *arg)
{
    struct transfer *t = arg;

    close(t->fd);
    http_reader_end(t->http, t->link);
    free(t);
}

/* No bytes will come. */
static void give_up(struct http_request *q, int fd)
{
    close(fd);
    http_reader_end(q->http, q->link);
}

/* Ask for a part, and answer with it as it comes. Takes fd over. */
static struct MHD_Response *respond(struct http_request *q, int fd, uint64_t first, uint64_t bytes)
{
    const struct sst_download_part part = { .first = (int64_t)first, .bytes = (int64_t)bytes };
    struct transfer *t = q->head || !bytes ? NULL : malloc(sizeof(*t));
    struct MHD_Response *response;

    if (!t) {
        give_up(q, fd);
        /* HEAD is told the length by a body that is never asked for. */
        if (q->head && bytes)
            return MHD_create_response_from_callback(bytes, PIECE_BYTES, piece, NULL, NULL);
        return bytes ? NULL : MHD_create_response_from_buffer(0, (void *)"", MHD_RESPMEM_PERSISTENT);
    }
    *t = (struct transfer){ .http = q->http, .link = q->link, .fd = fd };
    response = send(fd, &part, sizeof(part), MSG_NOSIGNAL) == (ssize_t)sizeof(part)
                   ? MHD_create_response_from_callback(bytes, PIECE_BYTES, piece, t, transfer_free)
                   : NULL;
    if (!response)
        transfer_free(t);
    return response;
}

static void describe(struct http_request *q, struct MHD_Response *response, const char *type, const char *etag)
{
    http_set(response, "Content-Type", "%s", type);
    http_set(response, "Content-Disposition", "%s; filename=\"%s\"",
             !strcmp(type, "image/jpeg") ? "inline" : "attachment", q->name);
    http_set(response, "Accept-Ranges", "%s", etag[0] ? "bytes" : "none");
    if (etag[0])
        http_set(response, "ETag", "%s", etag);
}

static int not_modified(struct http_request *q, const char *etag)
{
    struct MHD_Response *response = MHD_create_response_from_buffer(0, (void *)"", MHD_RESPMEM_PERSISTENT);

    if (!response)
        return MHD_NO;
    http_set(response, "ETag", "%s", etag);
    return http_reply(q, MHD_HTTP_NOT_MODIFIED, response);
}

static int beyond(struct http_request *q, uint64_t size)
{
    char *text = malloc(160);
    struct MHD_Response *response;

    if (!text)
        return MHD_NO;
    snprintf(text, 160, "{\"error\":\"%.64s has %" PRIu64 " bytes: nothing of that range is there\"}\n", q->name, size);
    response = MHD_create_response_from_buffer(strlen(text), text, MHD_RESPMEM_MUST_FREE);
    if (!response) {
        free(text);
        return MHD_NO;
    }
    http_set(response, "Content-Type", "application/json");
    http_set(response, "Content-Range", "bytes */%" PRIu64, size);
    return http_reply(q, MHD_HTTP_RANGE_NOT_SATISFIABLE, response);
}

/* What is asked for, now that its size and tag are known. Takes fd over. */
static int answer(struct http_request *q, int fd, const struct sst_download_info *info, const char *type)
{
    const char *match = http_header(q, "If-None-Match"), *if_range = http_header(q, "If-Range");
    const uint64_t size = (uint64_t)info->bytes;
    uint64_t first = 0, bytes = size;
    enum http_range range = HTTP_RANGE_WHOLE;
    struct MHD_Response *response;
    char etag[32] = "";

    if (info->tag[0])
        snprintf(etag, sizeof(etag), "\"%s\"", info->tag);
    if (etag[0] && match && http_etag_matches(match, etag)) {
        give_up(q, fd);
        return not_modified(q, etag);
    }
    if (etag[0] && !q->head && (!if_range || http_if_range(if_range, etag)))
        range = http_range_parse(http_header(q, "Range"), size, &first, &bytes);
    if (range == HTTP_RANGE_BEYOND) {
        give_up(q, fd);
        return beyond(q, size);
    }
    response = respond(q, fd, first, bytes);
    if (!response)
        return MHD_NO;
    (void)MHD_set_connection_option(q->connection, MHD_CONNECTION_OPTION_TIMEOUT, SILENCE_S);
    describe(q, response, type, etag);
    if (range == HTTP_RANGE_PART)
        http_set(response, "Content-Range", "bytes %" PRIu64 "-%" PRIu64 "/%" PRIu64, first, first + bytes - 1, size);
    return http_reply(q, range == HTTP_RANGE_PART ? MHD_HTTP_PARTIAL_CONTENT : MHD_HTTP_OK, response);
}

static int refuse(struct http_request *q, int err)
{
    struct sst_api_answer out = { 0 };

    if (err == -ENOENT)
        snprintf(out.error, sizeof(out.error), "there is no %.128s; GET /api/v1/recordings lists what is kept",
                 q->name);
    else if (err == -ENODATA)
        snprintf(out.error, sizeof(out.error), "nothing of %.128s was recorded", q->name);
    else if (err == -EBUSY)
        snprintf(out.error, sizeof(out.error), "%.128s is still being written; try again when it has ended", q->name);
    return http_reply_answer(q, err == -ENODATA ? -ENOENT : err, &out, "download");
}

/* The thread of a reader who was dropped may not have noticed yet. */
static int ask(struct http_request *q, int *fd, const char **type)
{
    const struct sst_api *api = q->http->cfg.api;
    int err = api->download(api->arg, q->name, fd, type);

    for (int tries = 0; err == -EMFILE && tries < TRIES && !atomic_load(&q->http->stopping); tries++) {
        (void)poll(NULL, 0, HTTP_WAIT_MS);
        err = api->download(api->arg, q->name, fd, type);
    }
    return err;
}

int http_do_download(struct http_request *q)
{
    struct transfer t = { .http = q->http, .link = q->link, .fd = -1 };
    struct sst_download_info info;
    const char *type = NULL;
    int err = http_reader_begin(q);

    if (err)
        return refuse(q, err);
    err = ask(q, &t.fd, &type);
    if (err) {
        http_reader_end(q->http, q->link);
        return refuse(q, err);
    }
    if (!receive_all(&t, &info, sizeof(info)) || (!info.err && info.bytes < 0))
        info.err = -EIO;
    if (info.err) {
        give_up(q, t.fd);
        return refuse(q, info.err);
    }
    info.tag[sizeof(info.tag) - 1] = 0;
    return answer(q, t.fd, &info, type);
}

#endif
