/* Downloads: whole, or the part that a Range asks for (RFC 9110).
 *
 * Each connection has a thread of its own, which reads from the disk as the client does from the connection: a slow
 * client costs a descriptor. An answer with too few bytes is broken off, never finished as if whole. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/publish/publish_internal.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PIECE_BYTES ((size_t)128 << 10)
#define RETRY_S     5
#define SILENCE     6 /* idle times of a client that reads nothing: players stop when they have enough, and ask again */

struct transfer {
    struct sst_http *http;
    struct MHD_Connection *connection;
    struct sst_download *download;
    uint64_t first;
};

static ssize_t piece(void *arg, uint64_t pos, char *buf, size_t max)
{
    const struct transfer *t = arg;
    const ssize_t n =
        atomic_load(&t->http->stopping) ? 0 : t->download->read(t->download, (int64_t)(t->first + pos), buf, max);

    if (n <= 0)
        return MHD_CONTENT_READER_END_WITH_ERROR;
    http_awake(t->connection, SILENCE * t->http->cfg.idle_s); /* the disk may have been slow */
    atomic_fetch_add(&t->http->count->bytes, (uint64_t)n);
    return n;
}

static void transfer_free(void *arg)
{
    struct transfer *t = arg;

    t->download->close(t->download);
    free(t);
}

/* Answer with a part; d is closed when it has been sent. */
static struct MHD_Response *respond(struct http_request *q, struct sst_download *d, uint64_t first, uint64_t bytes)
{
    struct transfer *t = q->head || !bytes ? NULL : malloc(sizeof(*t));
    struct MHD_Response *response;

    if (!t) {
        d->close(d);
        /* The length of HEAD comes with a body that is never asked for. */
        if (q->head && bytes)
            return MHD_create_response_from_callback(bytes, PIECE_BYTES, piece, NULL, NULL);
        return bytes ? NULL : MHD_create_response_from_buffer(0, (void *)"", MHD_RESPMEM_PERSISTENT);
    }
    *t = (struct transfer){ .http = q->http, .connection = q->connection, .download = d, .first = first };
    response = MHD_create_response_from_callback(bytes, PIECE_BYTES, piece, t, transfer_free);
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

static int answer(struct http_request *q, struct sst_download *d)
{
    const char *match = http_header(q, "If-None-Match"), *if_range = http_header(q, "If-Range");
    const char *const type = d->type;
    const uint64_t size = (uint64_t)d->bytes;
    uint64_t first = 0, bytes = size;
    enum http_range range = HTTP_RANGE_WHOLE;
    struct MHD_Response *response;
    char etag[32] = "";

    if (d->tag[0])
        snprintf(etag, sizeof(etag), "\"%s\"", d->tag);
    if (etag[0] && match && http_etag_matches(match, etag)) {
        d->close(d);
        return not_modified(q, etag);
    }
    if (etag[0] && !q->head && (!if_range || http_if_range(if_range, etag)))
        range = http_range_parse(http_header(q, "Range"), size, &first, &bytes);
    if (range == HTTP_RANGE_BEYOND) {
        d->close(d);
        return beyond(q, size);
    }
    response = respond(q, d, first, bytes);
    if (!response)
        return MHD_NO;
    q->silence_s = SILENCE * q->http->cfg.idle_s;
    describe(q, response, type, etag);
    if (range == HTTP_RANGE_PART)
        http_set(response, "Content-Range", "bytes %" PRIu64 "-%" PRIu64 "/%" PRIu64, first, first + bytes - 1, size);
    return http_reply(q, range == HTTP_RANGE_PART ? MHD_HTTP_PARTIAL_CONTENT : MHD_HTTP_OK, response);
}

static int refuse(struct http_request *q, int err)
{
    struct sst_api_answer out = { 0 };

    if (err == -ENOENT)
        snprintf(out.error, sizeof(out.error), "there is no %.128s; GET /api/v1/recordings lists what is stored",
                 q->name);
    else if (err == -ENODATA)
        snprintf(out.error, sizeof(out.error), "nothing of %.128s was recorded", q->name);
    else if (err == -EBUSY)
        snprintf(out.error, sizeof(out.error), "%.128s is still being written; try again when it has ended", q->name);
    else if (err == -ENOSPC)
        snprintf(out.error, sizeof(out.error),
                 "the disk has no room to make %.128s; delete something, or download all of it as .tar", q->name);
    else if (err == -EMFILE)
        q->retry_s = RETRY_S;
    return http_reply_answer(q, err == -ENODATA ? -ENOENT : err, &out, "download");
}

/* A file that has to be made first is waited for as long as the client does. */
int http_do_download(struct http_request *q)
{
    const struct sst_api *api = q->http->cfg.api;
    const char *range = http_header(q, "Range");
    struct sst_download *d = NULL;
    int err;

    do {
        err = api->download(api->arg, q->name, &d);
    } while (err == -EINPROGRESS && !atomic_load(&q->http->stopping) && !http_peer_gone(q->fd));
    if (!err && !q->head && (!range || !strncmp(range, "bytes=0-", 8))) /* a player asks for many parts */
        http_audit(q, "download", q->name);
    return err ? refuse(q, err) : answer(q, d);
}
