/* Permission of a request: everything is refused unless the table of routes allows it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/publish/publish_internal.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>


/* Where the client wants to be: a target in absolute form says so instead of the header (RFC 9112, 3.2.2). */
static const char *host_of(struct http_request *q)
{
    return q->authority[0] ? q->authority : http_header(q, "Host");
}

/* Is a name under which a client of TCP reaches us one of ours? Others belong to a foreign page with a name that leads
 * here. */
static bool host_is_ours(struct http_request *q, const char *host)
{
    struct sockaddr_storage at = { 0 };
    socklen_t size = sizeof(at);
    char name[256], own[96];
    int port;

    if (!http_host_split(host, name, &port))
        return false;
    if (!strcmp(name, "localhost") || !strcmp(name, "127.0.0.1") || !strcmp(name, "::1") ||
        !strcasecmp(name, q->http->address) || (q->http->host[0] && !strcasecmp(name, q->http->host)) ||
        (q->http->url_host[0] && !strcmp(name, q->http->url_host)))
        return true;
    /* Listening on all addresses: the one that this connection came to. */
    if (getsockname(q->fd, (struct sockaddr *)&at, &size))
        return false;
    http_name_address((const struct sockaddr *)&at, own, sizeof(own));
    return !strcmp(name, own) || (!strncmp(own, "::ffff:", 7) && !strcmp(name, own + 7));
}

/* About the live picture, so that /replay before its path is about the one that is played? */
static bool is_live(const struct sst_route *route)
{
    static const char *const starts[] = { "/api/v1/views", "/api/v1/labels", "/api/v1/tracks" };
    bool live = http_is_picture(route);

    for (size_t i = 0; i < ARRAY_LEN(starts) && !live; i++)
        live = !strncmp(route->path, starts[i], strlen(starts[i]));
    return live;
}

/* Any user name; a password that is no token is "". @param space  [HTTP_TOKEN_MAX + 1] */
static const char *basic_password(struct http_request *q, char *space)
{
    char *password = NULL, *user = MHD_basic_auth_get_username_password(q->connection, &password);

    space[0] = 0;
    if (user && password && strlen(password) <= HTTP_TOKEN_MAX)
        strcpy(space, password);
    MHD_free(user);
    MHD_free(password);
    return space;
}

/* The token of a request, and the highest role that this way of sending it allows. @param cookie  out: it is the secret
 * of a session */
static const char *token_of(struct http_request *q, char *space, enum sst_role *most, bool *cookie)
{
    const char *text = http_header(q, "Authorization");
    const bool page = q->route && (!strcmp(q->route->path, "/") || !strncmp(q->route->path, "/web/", 5));
    char name[HTTP_COOKIE];

    *cookie = false;
    *most = SST_ROLE_CONTROL;
    if (text && !strncasecmp(text, "Bearer ", 7))
        return text + 7 + strspn(text + 7, " ");
    if (text) {
        *most = SST_ROLE_VIEW;
        return basic_password(q, space);
    }
    text = page || http_is_picture(q->route) ? http_query(q, "token") : NULL;
    if (text) {
        *most = page ? SST_ROLE_CONTROL : SST_ROLE_VIEW;
        return text;
    }
    *cookie = true;
    http_cookie(q->http, name);
    return MHD_lookup_connection_value(q->connection, MHD_COOKIE_KIND, name);
}

static int refuse_stranger(struct http_request *q, bool gave_token)
{
    const char *accept = http_header(q, "Accept");
    struct MHD_Response *response;
    int retry_s = 0, status = MHD_HTTP_UNAUTHORIZED;

    if (gave_token)
        status = http_wrong_token(q, &retry_s);
    if (status == MHD_HTTP_TOO_MANY_REQUESTS)
        return http_reply_error(q, status, "too many wrong tokens from %s; try again in %d s", q->who, retry_s);
    if (q->route && !strcmp(q->route->path, "/") && accept && strstr(accept, "text/html")) {
        response = MHD_create_response_from_buffer(0, (void *)"", MHD_RESPMEM_PERSISTENT);
        if (!response)
            return MHD_NO;
        atomic_fetch_add(&q->http->count->refused, 1);
        http_set(response, "Location", gave_token ? "/login?wrong=1" : "/login"); /* the form shows it */
        return http_reply(q, MHD_HTTP_SEE_OTHER, response);
    }
    return http_reply_error(q, status,
                            gave_token
                                ? "that is not a token, or not any more, or the session has ended"
                                : "a token is needed: `Authorization: Bearer TOKEN`; who runs this service gives one");
}

/* Client of the UNIX socket, by its user and groups. @return -1: allowed; else answered */
static int check_peer(struct http_request *q, enum sst_role needed)
{
    q->role = http_auth_peer(&q->http->auth, q->fd, q->who);
    q->rights = q->role == SST_ROLE_CONTROL ? SST_RIGHTS_ALL : SST_RIGHTS_READ;
    snprintf(q->user, sizeof(q->user), "%.*s", (int)strcspn(q->who, ","), q->who); /* uid 1000 */
    if (q->role >= needed)
        return -1;
    return http_reply_error(q, MHD_HTTP_FORBIDDEN, "%s may not: %s", q->who,
                            q->http->auth.group_name[0] ? "join the group of control.group (usermod -aG) and log "
                                                          "in again"
                                                        : "set control.group, or be root");
}

static int check_rights(struct http_request *q, enum sst_role needed)
{
    char has[SST_ACCESS_TEXT];

    if (q->role >= needed && (!q->route || q->rights & http_rights_of(q->route, q->replay)))
        return -1;
    return http_reply_error(q, MHD_HTTP_FORBIDDEN, "this needs more rights than this client has: %s",
                            sst_access_rights_text(q->rights, has));
}

/* Authenticate and authorize. @return -1: allowed; else answered */
static int check_role(struct http_request *q)
{
    enum sst_role needed = q->route ? q->route->role : SST_ROLE_VIEW, most = SST_ROLE_CONTROL;
    char space[HTTP_TOKEN_MAX + 1];
    struct http_grant grant;
    const char *token;
    bool cookie, right;
    int done;

    if (needed == SST_ROLE_ANYONE)
        return -1;
    if (q->local)
        return check_peer(q, needed);
    done = http_check_proxy(q);
    if (done >= 0)
        return done;
    if (q->role != SST_ROLE_ANYONE)
        return check_rights(q, needed);
    token = token_of(q, space, &most, &cookie);
    right = token && (cookie ? http_session_check(&q->http->auth.sessions, token, &grant)
                             : http_auth_token(&q->http->auth, token, &grant));
    if (!right)
        return refuse_stranger(q, token != NULL);
    q->role = grant.role < most ? grant.role : most;
    q->rights = most == SST_ROLE_CONTROL ? grant.rights : grant.rights & ~(unsigned)SST_RIGHT_CONTROL;
    snprintf(q->user, sizeof(q->user), "%s", grant.user);
    snprintf(q->session, sizeof(q->session), "%s", cookie ? grant.session : grant.id);
    return check_rights(q, needed);
}

/* Form of a request by its own headers. */
struct form {
    int count[6]; /* of `single` */
    bool plain;   /* names and values have only characters that they may have */
};

static const char *const single[] = { "Host",          "Content-Length", "Transfer-Encoding",
                                      "Authorization", "Content-Type",   "Origin" };

static enum MHD_Result look_at_header(void *arg, enum MHD_ValueKind kind SST_UNUSED, const char *name,
                                      const char *value)
{
    struct form *f = arg;

    for (size_t i = 0; i < ARRAY_LEN(single); i++)
        f->count[i] += !strcasecmp(name, single[i]);
    for (const char *c = name; *c; c++)
        f->plain &= *c > ' ' && *c < 127 && !strchr("()<>@,;:\\\"/[]?={}", *c);
    for (const char *c = value ? value : ""; *c; c++)
        f->plain &= ((unsigned char)*c >= ' ' && *c != 127) || *c == '\t';
    return MHD_YES;
}

/* A request that a proxy before us may delimit otherwise than the library does. @return NULL: none; else its fault */
static const char *ambiguity(struct http_request *q, const char *method, const char *version)
{
    const char *length = http_header(q, "Content-Length"), *coding = http_header(q, "Transfer-Encoding");
    const uintptr_t uri_at = q->link->uri_at, method_at = (uintptr_t)method, version_at = (uintptr_t)version;
    struct form f = { .plain = true };
    uint64_t bytes;

    (void)MHD_get_connection_values(q->connection, MHD_HEADER_KIND, look_at_header, &f);
    for (size_t i = 0; i < ARRAY_LEN(single); i++)
        if (f.count[i] > 1)
            return single[i];
    if (!f.plain)
        return "a header with characters that are none of a header";
    if (coding && (length || strcasecmp(coding, "chunked")))
        return length ? "Content-Length beside Transfer-Encoding" : "a Transfer-Encoding other than chunked";
    if (length && !http_number(length, UINT64_MAX, &bytes))
        return "a Content-Length that is no number";
    /* Versions 0.9 leave the line where it was read, and end its words at a NUL that it has. */
    if (!strncmp(MHD_get_version(), "0.9.", 4) && uri_at > method_at && uri_at - method_at <= HTTP_HEADER_MAX &&
        (uri_at != method_at + strlen(method) + 1 || (version_at > uri_at && version_at - uri_at <= HTTP_HEADER_MAX &&
                                                      version_at != uri_at + q->link->uri_bytes + 1)))
        return "a first line that is more than method, path and version";
    return NULL;
}

/* The first route that fits, or one of another method. @return false: with none of this method */
static bool find_route(struct http_request *q, const char *method, const char *path)
{
    const bool get = !strcmp(method, "GET") || !strcmp(method, "HEAD");
    const struct sst_route *routes;
    int count;

    routes = sst_http_routes(&count);
    for (int i = 0; i < count; i++) {
        if (!http_path_matches(routes[i].path, path, q->name) || (q->replay && !is_live(&routes[i])))
            continue;
        q->route = &routes[i];
        q->index = i;
        if (!strcmp(routes[i].method, get ? "GET" : method))
            return true;
    }
    return false;
}

bool http_is_foreign(struct http_request *q)
{
    const char *origin = http_header(q, "Origin"), *site = http_header(q, "Sec-Fetch-Site"), *host = host_of(q);

    if (site && strcmp(site, "same-origin") && strcmp(site, "none"))
        return true;
    return origin && (!host || !http_same_origin(origin, host));
}

struct parameters {
    const char *const *known;
    char error[512]; /* about the first unknown one */
};

static enum MHD_Result on_parameter(void *arg, enum MHD_ValueKind kind SST_UNUSED, const char *name,
                                    const char *value SST_UNUSED)
{
    struct parameters *p = arg;

    return name && *name && sst_api_known("parameter", name, p->known, p->error) ? MHD_NO : MHD_YES;
}

/* Refuse misspelt filters: without them an answer would have more than was asked for. @return -1: fine; else answered */
static int check_query(struct http_request *q)
{
    struct parameters p = { .known = q->route->query };

    if (strncmp(q->route->path, "/api/v1/", 8) != 0)
        return -1;
    (void)MHD_get_connection_values(q->connection, MHD_GET_ARGUMENT_KIND, on_parameter, &p);
    return p.error[0] ? http_reply_error(q, MHD_HTTP_BAD_REQUEST, "%s: %s", q->route->path, p.error) : -1;
}

static bool is_login(const struct http_request *q)
{
    return !strcmp(q->route->path, "/login");
}

/* Conditions of a POST. @return -1: fulfilled; else answered */
static int check_post(struct http_request *q)
{
    const char *type = http_header(q, "Content-Type"), *length = http_header(q, "Content-Length");
    const char *wanted = is_login(q) ? "application/x-www-form-urlencoded" : "application/json";
    uint64_t bytes = 0;

    if (http_is_foreign(q))
        return http_reply_error(q, MHD_HTTP_FORBIDDEN, "a page of another origin may not change anything here");
    if (!type || !http_is_type(type, wanted))
        return http_reply_error(q, MHD_HTTP_UNSUPPORTED_MEDIA_TYPE, "send Content-Type: %s", wanted);
    if (length && (!http_number(length, UINT64_MAX, &bytes) || bytes > HTTP_BODY_MAX))
        return http_reply_error(q, MHD_HTTP_CONTENT_TOO_LARGE, "a body has at most %d bytes", HTTP_BODY_MAX);
    return -1;
}

static int refuse_method(struct http_request *q, const char *path)
{
    const struct sst_route *routes;
    bool get = false, post = false;
    char name[HTTP_NAME_MAX + 1];
    int count;

    routes = sst_http_routes(&count);
    for (int i = 0; i < count; i++) {
        if (!http_path_matches(routes[i].path, path, name))
            continue;
        get |= !strcmp(routes[i].method, "GET");
        post |= !strcmp(routes[i].method, "POST");
    }
    snprintf(q->allow, sizeof(q->allow), "%s%s%s", get ? "GET, HEAD" : "", get && post ? ", " : "", post ? "POST" : "");
    return http_reply_error(q, MHD_HTTP_METHOD_NOT_ALLOWED, "the methods of this path are %s", q->allow);
}

int http_check(struct http_request *q, const char *path, const char *method, const char *version)
{
    const union MHD_ConnectionInfo *info =
        MHD_get_connection_info(q->connection, MHD_CONNECTION_INFO_REQUEST_HEADER_SIZE);
    const char *host, *unclear;
    bool found;
    int done;

    if (!info || info->header_size > HTTP_HEADER_MAX)
        return http_reply_error(q, MHD_HTTP_REQUEST_HEADER_FIELDS_TOO_LARGE,
                                "a request has at most %d bytes before its body", HTTP_HEADER_MAX);
    unclear = ambiguity(q, method, version);
    q->hang_up = unclear != NULL;
    if (unclear)
        return http_reply_error(q, MHD_HTTP_BAD_REQUEST, "the request has %s%s", unclear,
                                strchr(unclear, ' ') ? "" : " more than once");
    if (http_crowded(q))
        return http_reply_error(q, MHD_HTTP_SERVICE_UNAVAILABLE,
                                "%d connections are open already; try again, or raise web.clients",
                                q->http->cfg.clients);
    path = http_target_path(path, q->authority);
    host = host_of(q);
    if (!q->local && (!host || !host_is_ours(q, host)))
        return http_reply_error(q, MHD_HTTP_FORBIDDEN, "\"%.80s\" is not a name of this service; web.host adds one",
                                host ? host : "");
    q->head = !strcmp(method, "HEAD");
    q->replay = !strncmp(path, "/replay/", 8);
    path += q->replay ? 7 : 0;
    found = find_route(q, method, path);
    done = check_role(q);
    if (done >= 0)
        return done;
    if (!q->route)
        return http_reply_error(q, MHD_HTTP_NOT_FOUND,
                                "there is no %.200s; GET /api/v1/openapi.json names what there is", path);
    if (!found)
        return refuse_method(q, path);
    done = check_query(q);
    return done >= 0 || strcmp(q->route->method, "POST") ? done : check_post(q);
}
