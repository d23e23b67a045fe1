/* Access of users: the identity that a proxy reports, named tokens over the API, and the audit log. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/publish/publish_internal.h"

#include <arpa/inet.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/text.h"

#define AUDIT_USUAL 100
#define AUDIT_MAX   10000
#define OBJECT_MAX  160

/* --- proxies ------------------------------------------------------------------------------------------------------ */

/* 16 bytes of an address, IPv4 as a mapped one. */
static bool parse_address(const char *text, uint8_t out[16])
{
    memcpy(out, "\0\0\0\0\0\0\0\0\0\0\377\377", 12);
    return inet_pton(AF_INET, text, out + 12) == 1 || inet_pton(AF_INET6, text, out) == 1;
}

void http_proxies_init(struct http_proxies *p, const struct sst_http_config *cfg)
{
    memset(p, 0, sizeof(*p));
    if (!cfg->proxy_header || !cfg->proxy_header[0])
        return;
    snprintf(p->header, sizeof(p->header), "%s", cfg->proxy_header);
    p->rights = cfg->proxy_rights;
    for (int i = 0; i < cfg->proxies && i < HTTP_PROXIES; i++)
        if (parse_address(cfg->proxy[i], p->address[p->count]))
            p->count++;
}

struct identity {
    const char *name;
    const char *value;
    int count;
};

static enum MHD_Result look_at_header(void *arg, enum MHD_ValueKind kind SST_UNUSED, const char *name,
                                      const char *value)
{
    struct identity *i = arg;

    if (!strcasecmp(name, i->name)) {
        i->value = value ? value : "";
        i->count++;
    }
    return MHD_YES;
}

/* The name as the audit log and lists have it. */
static bool is_user(const char *name)
{
    const size_t n = strlen(name);

    return n > 0 && n < sizeof(((struct http_request *)0)->user) &&
           strspn(name, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.@+") == n;
}

int http_check_proxy(struct http_request *q)
{
    const struct http_proxies *p = &q->http->proxies;
    struct identity found = { .name = p->header };
    bool known = false;
    uint8_t from[16];

    if (!p->count || q->local)
        return -1;
    (void)MHD_get_connection_values(q->connection, MHD_HEADER_KIND, look_at_header, &found);
    if (!found.count)
        return -1;
    for (int i = 0; i < p->count && parse_address(q->who, from); i++)
        known = known || !memcmp(from, p->address[i], sizeof(from));
    if (!known) /* somebody who went past the proxy */
        return http_reply_error(q, MHD_HTTP_FORBIDDEN, "the header %s is accepted from the proxy alone, not from %s",
                                p->header, q->who);
    if (found.count > 1 || !is_user(found.value))
        return http_reply_error(q, MHD_HTTP_BAD_REQUEST,
                                "the header %s must come once, with a name of letters, digits, - _ . @ +, from the "
                                "proxy",
                                p->header);
    if (http_header(q, "Authorization"))
        return -1; /* a program's token, through the proxy */
    q->rights = p->rights;
    q->role = p->rights & SST_RIGHT_CONTROL ? SST_ROLE_CONTROL : SST_ROLE_VIEW;
    snprintf(q->user, sizeof(q->user), "%s", found.value);
    return -1;
}

/* --- rights of routes --------------------------------------------------------------------------------------------- */

unsigned http_rights_of(const struct sst_route *route, bool replay)
{
    static const char *const recorded[] = { "/api/v1/recordings", "/api/v1/download/", "/api/v1/replay", "/api/v1/videos" };

    if (route->role == SST_ROLE_CONTROL)
        return SST_RIGHT_CONTROL;
    if (!strcmp(route->path, "/api/v1/logout"))
        return SST_RIGHTS_ALL;
    for (size_t i = 0; i < ARRAY_LEN(recorded); i++)
        if (replay || !strncmp(route->path, recorded[i], strlen(recorded[i])))
            return SST_RIGHT_RECORDINGS;
    return SST_RIGHT_VIEW | (strncmp(route->path, "/snapshot", 9) ? 0u : (unsigned)SST_RIGHT_SNAPSHOT);
}

/* --- the audit log ------------------------------------------------------------------------------------------------ */

void http_audit(struct http_request *q, const char *action, const char *object)
{
    struct http_audit *a = &q->http->audit;
    char address[96];
    const struct sst_audit line = {
        .name = q->user[0] ? q->user : http_user(q), .address = address, .action = action, .object = object
    };
    int err;

    snprintf(address, sizeof(address), "%s", q->local ? "socket" : q->who);
    if (!a->path[0])
        return;
    pthread_mutex_lock(&a->lock);
    err = sst_audit_write(a->path, &line);
    if (err && !a->failed)
        sst_log_warning("audit log %s cannot be written: %s; what is done is in this log alone", a->path, strerror(-err));
    a->failed = err != 0;
    pthread_mutex_unlock(&a->lock);
}

/* Reports of programs and views of one's own are no changes for others. */
static bool is_noted(const struct http_request *q)
{
    static const char *const own[] = { "/login", "/api/v1/publishers", "/api/v1/views", "/api/v1/replay" };

    if (!q->route || strcmp(q->route->method, "POST") != 0)
        return false;
    if (!strncmp(q->route->path, "/api/v1/views/", 14) && strcmp(q->name, "main") != 0)
        return false;
    for (size_t i = 0; i < ARRAY_LEN(own); i++)
        if (!strcmp(q->route->path, own[i]))
            return false;
    return true;
}

void http_audit_answer(struct http_request *q, int status)
{
    char action[64], object[OBJECT_MAX + 4] = "", *text = NULL;
    const char *path = q->route ? q->route->path : "";

    if (status >= 400 || !is_noted(q))
        return;
    path += strncmp(path, "/api/v1/", 8) ? 1 : 8;
    snprintf(action, sizeof(action), "%.*s", (int)strcspn(path, "/"), path);
    if (json_object_size(q->body))
        text = json_dumps(q->body, JSON_COMPACT | JSON_ENSURE_ASCII);
    snprintf(object, sizeof(object), "%.128s%s", q->name, q->name[0] && text ? " " : "");
    if (text)
        sst_text_add(object, sizeof(object), "%.*s", (int)(OBJECT_MAX - strlen(object)), text);
    if (text && strlen(text) + strlen(q->name) + 1 > OBJECT_MAX)
        strcpy(object + OBJECT_MAX, "...");
    http_audit(q, action, object);
    free(text);
}

void http_audit_init(struct http_audit *a, const char *token_file)
{
    memset(a, 0, sizeof(*a));
    pthread_mutex_init(&a->lock, NULL);
    if (token_file && snprintf(a->path, sizeof(a->path), "%s.audit", token_file) >= (int)sizeof(a->path))
        a->path[0] = 0;
}

int http_do_audit(struct http_request *q)
{
    const char *limit = http_query(q, "limit");
    uint64_t lines = AUDIT_USUAL;
    char *text;

    if (limit && (!http_number(limit, AUDIT_MAX, &lines) || !lines))
        return http_reply_error(q, MHD_HTTP_BAD_REQUEST, "limit=%.40s is not a number from 1 to %d", limit, AUDIT_MAX);
    pthread_mutex_lock(&q->http->audit.lock);
    text = sst_audit_text(q->http->audit.path, (int)lines);
    pthread_mutex_unlock(&q->http->audit.lock);
    return http_reply_text(q, MHD_HTTP_OK, "application/x-ndjson", text);
}

/* --- tokens ------------------------------------------------------------------------------------------------------- */

int http_do_tokens(struct http_request *q)
{
    struct sst_api_answer out = { 0 };

    out.body = json_pack("{s:o}", "tokens", http_tokens_json(&q->http->auth.tokens));
    return http_reply_answer(q, out.body ? 0 : -ENOMEM, &out, "tokens");
}

/* @return false: answered */
static bool read_token(struct http_request *q, struct sst_access_token *out, int *done)
{
    static const char *const known[] = { "name", "rights", "expires_s", NULL };
    const char *name = json_string_value(json_object_get(q->body, "name"));
    const json_t *rights = json_object_get(q->body, "rights"), *expires = json_object_get(q->body, "expires_s"), *one;
    char error[512] = "";
    size_t i;

    *out = (struct sst_access_token){ 0 };
    if (!sst_api_members(q->body, known, error) && !name)
        snprintf(error, sizeof(error), "give name and rights, like {\"name\": \"guard\", \"rights\": [\"view\"]}");
    snprintf(out->name, sizeof(out->name), "%s", name && strlen(name) <= SST_ACCESS_NAME ? name : "");
    json_array_foreach(rights, i, one)
    {
        const char *word = json_string_value(one);
        const unsigned right = word ? sst_access_right(word, strlen(word)) : 0;

        if (!right && !error[0])
            snprintf(error, sizeof(error), "rights are of view, snapshot, recordings, control");
        out->rights |= right;
    }
    if (!error[0] && expires && !json_is_null(expires) &&
        !(json_is_integer(expires) && json_integer_value(expires) > 0 && json_integer_value(expires) <= INT32_MAX))
        snprintf(error, sizeof(error), "expires_s is a whole number of seconds from now, or null");
    else if (json_is_integer(expires))
        out->expires_s = sst_clock_wall_ns() / 1000000000 + json_integer_value(expires);
    if (error[0])
        *done = http_reply_error(q, MHD_HTTP_BAD_REQUEST, "token: %s", error);
    return !error[0];
}

int http_do_token_add(struct http_request *q)
{
    const char *path = q->http->auth.tokens.path;
    struct sst_api_answer out = { 0 };
    struct sst_access_token token;
    char secret[SST_ACCESS_SECRET];
    int done, err;

    if (!read_token(q, &token, &done))
        return done;
    if (!path[0])
        return http_reply_error(q, MHD_HTTP_NOT_IMPLEMENTED, "token: web.token_file names no file");
    err = sst_access_add(path, &token, secret, out.error);
    if (!err)
        out.body = json_pack("{s:s, s:s}", "name", token.name, "token", secret);
    explicit_bzero(secret, sizeof(secret));
    return http_reply_answer(q, err, &out, "token");
}

int http_do_token_change(struct http_request *q)
{
    static const char *const known[] = { "revoke", NULL };
    struct sst_api_answer out = { 0 };
    int err;

    if (sst_api_members(q->body, known, out.error))
        return http_reply_error(q, MHD_HTTP_BAD_REQUEST, "token: %s", out.error);
    if (!json_is_true(json_object_get(q->body, "revoke")))
        return http_reply_error(q, MHD_HTTP_BAD_REQUEST, "token: give revoke: true");
    err = q->http->auth.tokens.path[0] ? sst_access_revoke(q->http->auth.tokens.path, q->name, out.error) : -ENOENT;
    if (!err)
        out.body = json_pack("{s:b}", "revoked", 1);
    return http_reply_answer(q, err, &out, "token");
}
