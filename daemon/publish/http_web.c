/* The page's files, which are part of the program, and the form for the token. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* asprintf */
#include "daemon/publish/publish_internal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *type_of(const char *name)
{
    static const struct {
        const char *end, *type;
    } types[] = {
        { ".html", "text/html; charset=utf-8" },
        { ".css", "text/css; charset=utf-8" },
        { ".js", "text/javascript; charset=utf-8" },
        { ".json", "application/json" },
        { ".svg", "image/svg+xml" },
        { ".png", "image/png" },
        { ".jpg", "image/jpeg" },
        { ".ico", "image/x-icon" },
        { ".woff2", "font/woff2" },
        { ".webmanifest", "application/manifest+json" },
    };
    const char *end = strrchr(name, '.');

    for (size_t i = 0; end && i < ARRAY_LEN(types); i++) {
        if (!strcmp(end, types[i].end))
            return types[i].type;
    }
    return "application/octet-stream";
}

static struct MHD_Response *empty(void)
{
    return MHD_create_response_from_buffer(0, (void *)"", MHD_RESPMEM_PERSISTENT);
}

static void set_cookie(struct http_request *q, struct MHD_Response *response, const char *secret, int64_t age_s)
{
    char name[HTTP_COOKIE];

    http_cookie(q->http, name);
    http_set(response, "Set-Cookie", "%s=%s; Path=/; Max-Age=%lld; HttpOnly; SameSite=Strict%s", name, secret,
             (long long)age_s, q->http->tls ? "; Secure" : "");
}

/* A session, so that the token stands in no history and in no cookie. @param token  a right one */
static int redirect_with_cookie(struct http_request *q, const char *token)
{
    struct http_auth *auth = &q->http->auth;
    struct MHD_Response *response;
    char secret[HTTP_SECRET + 1];
    struct http_grant grant;

    http_name_peer(q);
    if (!http_auth_token(auth, token, &grant)) /* it has ended meanwhile */
        return http_reply_error(q, MHD_HTTP_UNAUTHORIZED, "that is not a token any more");
    q->role = grant.role;
    snprintf(q->user, sizeof(q->user), "%s", grant.user);
    http_audit(q, "login", "");
    if (!http_session_begin(&auth->sessions, &grant, q->who, http_header(q, "User-Agent"), secret))
        return http_reply_error(q, MHD_HTTP_INTERNAL_SERVER_ERROR, "this machine has no random numbers");
    response = empty();
    if (!response)
        return MHD_NO;
    set_cookie(q, response, secret, HTTP_SESSION_S);
    explicit_bzero(secret, sizeof(secret));
    if (!q->name[0])
        http_set(response, "Location", "/");
    else
        http_set(response, "Location", "/web/%s", q->name);
    return http_reply(q, MHD_HTTP_SEE_OTHER, response);
}

int http_do_web(struct http_request *q, const char *file, bool redirect)
{
    const char *token = redirect ? http_query(q, "token") : NULL;
    const char *match = http_header(q, "If-None-Match");
    const struct web_file *f = web_files;
    struct MHD_Response *response;
    char etag[32];
    bool same;

    if (token && !q->local)
        return redirect_with_cookie(q, token); /* it was right, else we were not here */
    while (f->name && strcmp(f->name, file))
        f++;
    if (!f->name)
        return http_reply_error(q, MHD_HTTP_NOT_FOUND, "the page has no file %s", file);
    /* The same file has the same tag after an update. */
    snprintf(etag, sizeof(etag), "\"%016llx\"", (unsigned long long)http_hash(f->data, (size_t)(f->end - f->data)));
    same = match && http_etag_matches(match, etag);
    response =
        same ? empty()
             : MHD_create_response_from_buffer((size_t)(f->end - f->data), (void *)f->data, MHD_RESPMEM_PERSISTENT);
    if (!response)
        return MHD_NO;
    atomic_fetch_add(&q->http->count->bytes, same ? 0 : (uint64_t)(f->end - f->data));
    http_set(response, "Content-Type", "%s", type_of(file));
    http_set(response, "ETag", "%s", etag);
    http_set(response, "Cache-Control", "no-cache"); /* kept, but asked for each time */
    return http_reply(q, same ? MHD_HTTP_NOT_MODIFIED : MHD_HTTP_OK, response);
}

static const char form[] =
    "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>sst: log in</title>\n"
    "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
    "<style>:root{color-scheme:light dark}body{font:16px/1.5 system-ui,sans-serif;max-width:32rem;margin:12vh auto;"
    "padding:0 1rem}\ninput,button{font:inherit;padding:.5rem;width:100%%;box-sizing:border-box;margin:.3rem 0}"
    "code{overflow-wrap:anywhere}\n.error{color:#c62828;color:light-dark(#b8232a,#ff7a70);font-weight:600}"
    "</style></head>\n"
    "<body><main><h1>sst</h1>%s%s%s\n<form method=\"post\" action=\"/login\">"
    "<label for=\"token\">Token</label><input id=\"token\" name=\"token\" type=\"password\" "
    "autocomplete=\"current-password\" required autofocus>\n<button>Log in</button></form>\n"
    "<p>Who runs this service gives one: <code>sst token --help</code> on its machine.</p>"
    "</main></body></html>\n";

static int reply_login(struct http_request *q, int status, const char *sentence)
{
    struct MHD_Response *response;
    char *text;
    const int n = asprintf(&text, form, sentence ? "<p class=\"error\" role=\"alert\">" : "", sentence ? sentence : "",
                           sentence ? "</p>" : "");

    if (n < 0)
        return MHD_NO;
    response = MHD_create_response_from_buffer((size_t)n, text, MHD_RESPMEM_MUST_FREE);
    if (!response) {
        free(text);
        return MHD_NO;
    }
    http_set(response, "Content-Type", "text/html; charset=utf-8");
    /* The one page with an inline style: the style sheet needs a login. */
    http_set(response, "Content-Security-Policy",
             "default-src 'none'; style-src 'unsafe-inline'; form-action 'self'; base-uri 'none'; "
             "frame-ancestors 'none'");
    return http_reply(q, status, response);
}

int http_do_logout(struct http_request *q)
{
    static const char done[] = "{\"ended\":true}";
    struct MHD_Response *response;

    if (!http_session_end(&q->http->auth.sessions, q->session))
        return http_reply_error(q, MHD_HTTP_CONFLICT, "only a browser that has logged in can log out");
    response = MHD_create_response_from_buffer(sizeof(done) - 1, (void *)done, MHD_RESPMEM_PERSISTENT);
    if (!response)
        return MHD_NO;
    http_set(response, "Content-Type", "application/json");
    set_cookie(q, response, "", 0);
    return http_reply(q, MHD_HTTP_OK, response);
}

int http_do_login_form(struct http_request *q)
{
    return reply_login(q, MHD_HTTP_OK,
                       http_query(q, "wrong") ? "The token that was given is not right, or not any more." : NULL);
}

int http_do_login(struct http_request *q)
{
    char token[HTTP_TOKEN_MAX + 1], sentence[96];
    struct http_grant grant;
    int retry_s, status;

    if (!http_form_token(q->data ? q->data : "", q->size, token) || !http_auth_token(&q->http->auth, token, &grant)) {
        status = http_wrong_token(q, &retry_s);
        if (status == MHD_HTTP_TOO_MANY_REQUESTS)
            snprintf(sentence, sizeof(sentence), "Too many wrong tokens; try again in %d seconds.", retry_s);
        else
            snprintf(sentence, sizeof(sentence), "That is not the token.");
        atomic_fetch_add(&q->http->count->refused, 1);
        return reply_login(q, status, sentence);
    }
    if (!(grant.rights & SST_RIGHT_VIEW))
        return reply_login(q, MHD_HTTP_FORBIDDEN, "This token does not open the page.");
    return redirect_with_cookie(q, token);
}
