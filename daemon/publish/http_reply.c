/* Answers: common headers, errors as one sentence, and results of the API as a status. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/publish/publish_internal.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"

void http_set(struct MHD_Response *response, const char *name, const char *fmt, ...)
{
    char text[512];
    va_list args;

    va_start(args, fmt);
    vsnprintf(text, sizeof(text), fmt, args);
    va_end(args);
    /* Without memory the answer goes out with a header less; none carries the protection alone. */
    if (MHD_add_response_header(response, name, text) != MHD_YES)
        sst_log_debug("http: header %s does not fit", name);
}

/* Credentials to come with. Recorders and players send a password only when asked for one; a browser that is asked
 * shows a window of its own, so not for requests of the page. */
static void challenge(struct http_request *q, struct MHD_Response *response)
{
    http_set(response, "WWW-Authenticate", "Bearer realm=\"sst\"");
    if (http_is_picture(q->route) && !http_header(q, "Cookie"))
        http_set(response, "WWW-Authenticate", "Basic realm=\"sst\", charset=\"UTF-8\"");
}

static bool is_tls(struct MHD_Connection *connection)
{
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_GNUTLS_SESSION);

    return info && info->tls_session;
}

void http_awake(struct MHD_Connection *connection, int silence_s)
{
    /* It counts from the moment at which a limit comes where there was none. */
    (void)MHD_set_connection_option(connection, MHD_CONNECTION_OPTION_TIMEOUT, 0u);
    (void)MHD_set_connection_option(connection, MHD_CONNECTION_OPTION_TIMEOUT, (unsigned)silence_s);
}

int http_reply(struct http_request *q, int status, struct MHD_Response *response)
{
    enum MHD_Result done;

    if (!response)
        return MHD_NO;
    http_set(response, "X-Content-Type-Options", "nosniff");
    /* Without any, browsers send the form for the token with the origin "null". */
    http_set(response, "Referrer-Policy", "same-origin");
    if (!MHD_get_response_header(response, "Cache-Control"))
        http_set(response, "Cache-Control", "no-store");
    if (!MHD_get_response_header(response, "Content-Security-Policy"))
        http_set(response, "Content-Security-Policy",
                 "default-src 'self'; img-src 'self' blob: data:; base-uri 'none'; form-action 'self'; "
                 "frame-ancestors 'none'");
    if (is_tls(q->connection)) /* browsers heed it where they trust the certificate */
        http_set(response, "Strict-Transport-Security", "max-age=31536000");
    if (q->hang_up)
        http_set(response, "Connection", "close");
    if (q->allow[0])
        http_set(response, "Allow", "%s", q->allow);
    if (status == MHD_HTTP_UPGRADE_REQUIRED) {
        http_set(response, "Upgrade", "websocket");
        http_set(response, "Sec-WebSocket-Version", "13");
    }
    if (q->retry_s || status == MHD_HTTP_SERVICE_UNAVAILABLE)
        http_set(response, "Retry-After", "%d", sst_max_int(q->retry_s, 1));
    if (status == MHD_HTTP_UNAUTHORIZED)
        challenge(q, response);
    if (q->route && !strcmp(q->route->method, "POST"))
        sst_log_info("http: %s: POST %s: %d", q->who, q->route->path, status);
    http_audit_answer(q, status);
    http_awake(q->connection, q->silence_s);
    done = MHD_queue_response(q->connection, (unsigned)status, response);
    MHD_destroy_response(response);
    return done;
}

int http_reply_text(struct http_request *q, int status, const char *type, char *text)
{
    const size_t size = text ? strlen(text) : 0;
    struct MHD_Response *response = NULL;

    if (text)
        response = MHD_create_response_from_buffer(size, text, MHD_RESPMEM_MUST_FREE);
    if (!response) {
        free(text);
        return MHD_NO;
    }
    atomic_fetch_add(&q->http->count->bytes, size);
    http_set(response, "Content-Type", "%s", type);
    return http_reply(q, status, response);
}

static int reply_json(struct http_request *q, int status, json_t *body)
{
    char *text = json_dumps(body, JSON_COMPACT | JSON_REAL_PRECISION(12));
    const size_t n = text ? strlen(text) : 0;
    char *line = text ? realloc(text, n + 2) : NULL;

    json_decref(body);
    if (!line) {
        free(text);
        return MHD_NO;
    }
    strcpy(line + n, "\n");
    return http_reply_text(q, status, "application/json", line);
}

int http_reply_error(struct http_request *q, int status, const char *fmt, ...)
{
    char text[1024];
    va_list args;

    va_start(args, fmt);
    vsnprintf(text, sizeof(text), fmt, args);
    va_end(args);
    if (status < 500 && status != MHD_HTTP_BAD_REQUEST && status != MHD_HTTP_NOT_FOUND && status != MHD_HTTP_CONFLICT) {
        atomic_fetch_add(&q->http->count->refused, 1);
        sst_log_debug("http: %s: %d: %s", q->who, status, text);
    }
    /* A sentence may quote the client: bytes that are not UTF-8 are replaced. */
    for (char *c = text; *c; c++) {
        if ((unsigned char)*c < 0x20 || (unsigned char)*c >= 0x7f)
            *c = '?';
    }
    return reply_json(q, status, json_pack("{s:s}", "error", text));
}

static const struct {
    int err, status;
    const char *sentence; /* where the call gave none */
} statuses[] = {
    { -EINVAL, 400, "a value is not right" },
    { -ENOENT, 404, "there is no such thing" },
    { -EBUSY, 409, "busy; try again when it is done" },
    { -EAGAIN, 409, "not now; try again" },
    { -EEXIST, 409, "it exists already" },
    { -ENOSPC, 507, "the disk is full" },
    { -EROFS, 507, "the disk cannot be written" },
    { -EIO, 500, "reading or writing failed; see the service's log" },
    { -EOVERFLOW, 429, "too many views at a time; close one, or raise web.views" },
    { -ENODATA, 503, "nothing has been captured yet; try again in a moment" },
    { -EMFILE, 503, "too many at a time; try again when another one has ended" },
    { -ENOTSUP, 501, "this build or configuration cannot do that" },
    { -ENOSYS, 501, "this service does not do that" },
    { -ENOMEM, 503, "out of memory; try again" },
};

int http_status_of(int err)
{
    for (size_t i = 0; i < ARRAY_LEN(statuses); i++)
        if (statuses[i].err == err)
            return statuses[i].status;
    return 500;
}

int http_reply_answer(struct http_request *q, int err, struct sst_api_answer *out, const char *what)
{
    if (!err && out->body)
        return reply_json(q, MHD_HTTP_OK, out->body);
    json_decref(out->body);
    if (err == -EAGAIN || err == -EBUSY)
        q->retry_s = sst_max_int(q->retry_s, 1);
    for (size_t i = 0; i < ARRAY_LEN(statuses); i++) {
        if (statuses[i].err != err)
            continue;
        if (out->error[0])
            return http_reply_error(q, statuses[i].status, "%s", out->error);
        return http_reply_error(q, statuses[i].status, "%s: %s", what, statuses[i].sentence);
    }
    return http_reply_error(q, 500, "%s", out->error[0] ? out->error : strerror(err < 0 ? -err : EIO));
}
