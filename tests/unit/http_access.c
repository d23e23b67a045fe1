/* Access rights: every route of the table for every kind of client, and the headers that a request must bear. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/http_fake.h"

#include "daemon/publish/publish_internal.h"

#include <grp.h>
#include <sys/wait.h>

static int make_server(void **state)
{
    struct sst_http_config cfg;

    if (make_service(state))
        return -1;
    cfg = config();
    cfg.host = "Cam.Example";
    serve(&cfg);
    show(1, 1000);
    return 0;
}

static bool endless(const struct sst_route *r)
{
    return strstr(r->path, "stream") != NULL;
}

/* A request as its route wants it. */
static int ask_route(const struct sst_route *r, const char *more)
{
    const bool post = !strcmp(r->method, "POST"), login = !strcmp(r->path, "/login");
    char target[300], form[160], head[512];

    snprintf(target, sizeof(target), "%s%s", example(r), strstr(r->path, "/pick") ? "?x=1&y=2" : "");
    snprintf(form, sizeof(form), "token=%s", control);
    snprintf(head, sizeof(head), "%s%s", more,
             !post   ? ""
             : login ? "Content-Type: application/x-www-form-urlencoded\r\n"
                     : JSON);
    if (!post)
        return ask(endless(r) ? "HEAD" : "GET", target, head, NULL);
    return ask("POST", target, head, login ? form : "{}");
}

static void every_route_for_everybody(void **state)
{
    const struct sst_route *routes;
    int count;

    (void)state;
    routes = sst_http_routes(&count);
    assert_true(count > 25);
    for (int i = 0; i < count; i++) {
        const struct sst_route *r = &routes[i];
        const bool public = r->role == SST_ROLE_ANYONE;
        const bool post = !strcmp(r->method, "POST");
        const int fine = post && public                          ? 303
                         : !strcmp(r->path, "/api/v1/logout")    ? 409 /* a token has no session */
                         : !strncmp(r->path, "/video", 6)        ? 426 /* no WebSocket */
                         : strstr(r->path, "/sessions/") != NULL || (post && strstr(r->path, "/tokens") != NULL)
                             ? 400 /* `end`, `name` or `revoke` lacks */
                                                                 : 200;

        print_message("%s %s\n", r->method, r->path);
        assert_int_equal(ask_route(r, ""), public ? fine : 401);
        /* Reports are for programs of this machine. */
        assert_int_equal(ask_route(r, bearer(view)),
                         r->role == SST_ROLE_CONTROL || !strcmp(r->path, "/api/v1/publishers") ? 403 : fine);
        assert_int_equal(ask_route(r, bearer(control)), fine);
        assert_non_null(strcasestr(answer, "\r\nX-Content-Type-Options: nosniff"));
        assert_non_null(strcasestr(answer, "\r\nContent-Security-Policy: default-src"));
        assert_non_null(strcasestr(answer, "frame-ancestors 'none'"));
        assert_non_null(strcasestr(answer, "\r\nReferrer-Policy: same-origin"));
        assert_non_null(strcasestr(answer, "\r\nCache-Control: no-"));
        assert_null(strcasestr(answer, "Access-Control-"));
        assert_int_equal(ask("DELETE", example(r), bearer(control), NULL), 405);
        assert_non_null(strcasestr(answer, "\r\nAllow: "));
    }
}

static void unknown_paths(void **state)
{
    static const char *const paths[] = { "/nothing",
                                         "/api/v1/status/",
                                         "/api/v1/statu",
                                         "/web/",
                                         "/web/none.js",
                                         "/web/../token",
                                         "/web/%2e%2e/token",
                                         "/web/..%2ftoken",
                                         "/web/.hidden",
                                         "/api/v1/download/%2e%2e%2ftoken",
                                         "/api/v1/download/..",
                                         "/stream/a/b",
                                         "/healthz%00",
                                         "/web/index.html%00.js",
                                         "//",
                                         "/api/v1/views//pick",
                                         "/api/v1/download/picture.jpg%2f..",
                                         "/web/index.html/",
                                         "/stream/%ff" };
    char longest[4000];

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(paths); i++) {
        print_message("%s\n", paths[i]);
        assert_int_equal(ask("GET", paths[i], bearer(control), NULL), 404);
        assert_int_equal(ask("GET", paths[i], "", NULL), 401);
    }
    memset(longest, 'a', sizeof(longest));
    memcpy(longest, "/web/", 5);
    longest[sizeof(longest) - 1] = 0;
    assert_int_equal(ask("GET", longest, bearer(control), NULL), 404);
}

/* The secret in the cookie that an answer sets. */
static void cookie(char secret[80])
{
    char name[24];
    const char *at;

    snprintf(name, sizeof(name), "sst_%d=", sst_http_port(server));
    at = strstr(answer, name);
    assert_non_null(at);
    assert_int_equal(sscanf(at + strlen(name), "%64[0-9a-f]", secret), 1);
}

/* The cookie as a header. */
static const char *session(const char *secret)
{
    static char text[2][160];
    static int next;

    next = !next;
    snprintf(text[next], sizeof(text[next]), "Cookie: other=1; sst_%d=%s\r\n", sst_http_port(server), secret);
    return text[next];
}

static void log_in(char secret[80], const char *token)
{
    char text[300];

    snprintf(text, sizeof(text), "/?token=%s", token);
    assert_int_equal(ask("GET", text, "User-Agent: Browser/1 <b>\r\n", NULL), 303);
    cookie(secret);
}

static void main_view_takes_control(void **state)
{
    char guard[80];

    (void)state;
    assert_int_equal(ask("POST", "/api/v1/views/main", with(bearer(view), JSON), "{}"), 403);
    assert_int_equal(ask("POST", "/api/v1/views/main", with(bearer(control), JSON), "{}"), 200);
    assert_string_equal(fake_client, "");
    assert_int_equal(ask("POST", "/api/v1/views/nobody", with(bearer(control), JSON), "{}"), 404);
    /* Others have views of their session or address. */
    assert_int_equal(ask("POST", "/api/v1/views", with(bearer(view), JSON), "{}"), 200);
    assert_string_equal(fake_client, "127.0.0.1");
    log_in(guard, view);
    assert_int_equal(ask("POST", "/api/v1/views/v1", with(session(guard), JSON), "{}"), 200);
    assert_int_equal(strlen(fake_client), 12);
    assert_memory_equal(fake_client, guard, 12);
    assert_int_equal(ask("POST", "/api/v1/views/v1", with(session(guard), JSON), "{\"fail\":-1}"), 403); /* -EPERM */
}

static void restart(void)
{
    struct sst_http_config cfg = config();

    sst_http_close(server);
    assert_int_equal(sst_http_open(&server, &cfg), 0);
    read_word(in_folder("token"), control);
}

/* Sessions are listed, survive a restart, and are ended: by themselves, by a controlling client, by another token. */
static void sessions_are_listed_and_ended(void **state)
{
    char guard[80], boss[80], first[80], path[64], name[16];
    FILE *f;

    (void)state;
    log_in(guard, view);
    log_in(boss, control);
    assert_int_equal(ask("GET", "/api/v1/sessions", session(guard), NULL), 200);
    assert_non_null(strstr(answer, "\"agent\":\"Browser/1 <b>\""));
    assert_non_null(strstr(answer, "\"address\":\"127.0.0.1\""));
    assert_non_null(strstr(answer, "\"own\":true"));
    assert_null(strstr(answer, "\"role\":\"control\"")); /* only a controlling client is told of other sessions */
    snprintf(name, sizeof(name), "%.12s", strstr(answer, "\"session\":\"") + 11);
    snprintf(path, sizeof(path), "/api/v1/sessions/%s", name);
    assert_int_equal(ask("POST", path, with(session(guard), JSON), "{\"end\":true}"), 403);
    assert_int_equal(ask("GET", "/api/v1/sessions", session(boss), NULL), 200);
    assert_non_null(strstr(answer, name));
    assert_null(strstr(answer, guard)); /* its name is not its secret */
    assert_int_equal(ask("GET", "/api/v1/sessions", bearer(control), NULL), 200);
    assert_null(strstr(answer, "\"own\":true"));

    restart();
    assert_int_equal(ask("GET", "/api/v1/status", session(guard), NULL), 200);
    assert_int_equal(ask("POST", "/api/v1/reload", with(session(boss), JSON), "{}"), 200);
    assert_int_equal(ask("POST", path, with(session(boss), JSON), "{\"end\":false}"), 400);
    assert_int_equal(ask("POST", path, with(session(boss), JSON), "{\"end\":true}"), 200);
    assert_int_equal(ask("POST", path, with(session(boss), JSON), "{\"end\":true}"), 404);
    assert_int_equal(ask("GET", "/api/v1/status", session(guard), NULL), 401);
    assert_int_equal(ask("POST", "/api/v1/logout", with(session(boss), JSON), "{}"), 200);
    assert_non_null(strstr(answer, "=; Path=/; Max-Age=0;"));
    assert_int_equal(ask("GET", "/api/v1/status", session(boss), NULL), 401);
    assert_int_equal(ask("POST", "/api/v1/logout", with(bearer(control), JSON), "{}"), 409);

    log_in(boss, control);
    f = fopen(in_folder("token"), "w"); /* another token: the sessions of the old one end */
    fputs("another-token-of-more-than-32-letters-0123456789\n", f);
    fclose(f);
    restart();
    assert_int_equal(ask("GET", "/api/v1/status", session(boss), NULL), 401);
    log_in(boss, control);
    log_in(first, view);
    for (int i = 0; i < 140; i++) /* more than there is room for: the oldest of this role end */
        log_in(guard, view);
    assert_int_equal(ask("GET", "/api/v1/status", session(first), NULL), 401);
    assert_int_equal(ask("GET", "/api/v1/status", session(guard), NULL), 200);
    assert_int_equal(ask("POST", "/api/v1/reload", with(session(boss), JSON), "{}"), 200);
}

/* Of the sessions in a store: how many are valid. */
static int lasting(struct http_sessions *s, char secret[][HTTP_SECRET + 1], int n)
{
    struct http_grant grant;
    int valid = 0;

    for (int i = 0; i < n; i++)
        valid += http_session_check(s, secret[i], &grant);
    return valid;
}

/* Frequent log-ins end sessions of the same role, first the ones of the same address. */
static void logins_end_only_their_like(void **state)
{
    static char boss[HTTP_SESSIONS_ROLE][HTTP_SECRET + 1], guard[HTTP_SESSIONS_ROLE][HTTP_SECRET + 1];
    const struct http_grant control_role = { .role = SST_ROLE_CONTROL }, view_role = { .role = SST_ROLE_VIEW };
    struct http_sessions s;
    char secret[HTTP_SECRET + 1], address[32];

    (void)state;
    http_sessions_init(&s, NULL, "control", "view");
    for (int i = 0; i < HTTP_SESSIONS_ROLE; i++) {
        snprintf(address, sizeof(address), "192.0.2.%d", i);
        assert_true(http_session_begin(&s, &control_role, address, "", boss[i]));
        if (i < 10)
            assert_true(http_session_begin(&s, &view_role, address, "", guard[i]));
    }
    for (int i = 0; i < 500; i++)
        assert_true(http_session_begin(&s, &view_role, "198.51.100.1", "", secret));
    assert_int_equal(lasting(&s, guard, 10), 10);
    for (int i = 0; i < 500; i++) { /* from everywhere */
        snprintf(address, sizeof(address), "203.0.113.%d", i % 250);
        assert_true(http_session_begin(&s, &view_role, address, "", secret));
    }
    assert_int_equal(lasting(&s, guard, 10), 0);
    assert_int_equal(lasting(&s, boss, HTTP_SESSIONS_ROLE), HTTP_SESSIONS_ROLE);
    http_sessions_fini(&s);
}

/* The token counts wherever it stands; in an address or as a password it only looks. */
static void ways_to_give_a_token(void **state)
{
    char text[512], basic[400], plain[160], secret[80];
    FILE *f;

    (void)state;
    snprintf(text, sizeof(text), "/?token=%s", control);
    assert_int_equal(ask("GET", text, "", NULL), 303);
    assert_non_null(strstr(answer, "; Path=/; Max-Age=2592000; HttpOnly; SameSite=Strict\r\n"));
    assert_null(strstr(answer, control)); /* the cookie has a session, not the token */
    assert_non_null(strstr(answer, "Location: /\r\n"));
    cookie(secret);
    assert_int_equal(ask("POST", "/api/v1/reload", with(session(secret), JSON), "{}"), 200);
    snprintf(text, sizeof(text), "Cookie: sst_%d=%s\r\n", sst_http_port(server), control);
    assert_int_equal(ask("GET", "/api/v1/status", text, NULL), 401);
    snprintf(text, sizeof(text), "/snapshot?token=%s", view);
    assert_int_equal(ask("GET", text, "", NULL), 200);
    snprintf(text, sizeof(text), "/api/v1/status?token=%s", control);
    assert_int_equal(ask("GET", text, "", NULL), 401);
    snprintf(plain, sizeof(plain), "printf %%s 'me:%s' | base64 -w0", control);
    f = popen(plain, "r");
    assert_int_equal(fscanf(f, "%390s", basic), 1);
    pclose(f);
    snprintf(text, sizeof(text), "Authorization: Basic %s\r\n", basic);
    assert_int_equal(ask("GET", "/api/v1/status", text, NULL), 200);
    assert_non_null(strstr(answer, "\"role\":\"view\""));
    assert_int_equal(ask("GET", "/api/v1/status", bearer(control), NULL), 200);
    assert_non_null(strstr(answer, "\"role\":\"control\""));
    assert_int_equal(ask("POST", "/api/v1/reload", with(text, JSON), "{}"), 403);
    assert_int_equal(ask("GET", "/snapshot", "", NULL), 401);
    assert_non_null(strcasestr(answer, "WWW-Authenticate: Basic"));
    assert_int_equal(ask("GET", "/api/v1/status", "", NULL), 401);
    assert_null(strcasestr(answer, "WWW-Authenticate: Basic"));
}

static void login_and_page(void **state)
{
    static const char form[] = "Content-Type: application/x-www-form-urlencoded\r\n";
    char body[200];
    const char *etag;

    (void)state;
    assert_int_equal(ask("GET", "/", "Accept: text/html,*/*\r\n", NULL), 303);
    assert_non_null(strstr(answer, "Location: /login\r\n"));
    assert_int_equal(ask("GET", "/?token=wrong", "Accept: text/html\r\n", NULL), 303);
    assert_non_null(strstr(answer, "Location: /login?wrong=1\r\n"));
    assert_int_equal(ask("GET", "/login?wrong=1", "", NULL), 200);
    assert_non_null(strstr(answer, "is not right"));
    assert_int_equal(ask("GET", "/login", "", NULL), 200);
    assert_null(strstr(answer, "is not right"));
    assert_null(strstr(answer, folder)); /* nobody learns from here where the token lies */
    assert_int_equal(ask("GET", "/api/v1/status", "", NULL), 401);
    assert_null(strstr(answer, folder));
    assert_int_equal(ask("GET", "/api/v1/status", bearer("wrong"), NULL), 401);
    assert_null(strstr(answer, folder));
    assert_int_equal(ask("POST", "/api/v1/reload", with(bearer(view), JSON), "{}"), 403);
    assert_null(strstr(answer, folder));
    assert_int_equal(ask("POST", "/login", form, "token=wrong"), 401);
    assert_non_null(strstr(answer, "That is not the token."));
    assert_int_equal(ask("POST", "/login", form, "nothing"), 401);
    snprintf(body, sizeof(body), "a=b&token=+%s+", view);
    assert_int_equal(ask("POST", "/login", form, body), 303);
    assert_non_null(strstr(answer, "Location: /\r\n"));
    assert_int_equal(ask("POST", "/login", with(form, "Origin: http://evil.example\r\n"), body), 403);
    assert_int_equal(ask("GET", "/", bearer(view), NULL), 200);
    assert_non_null(strcasestr(answer, "Content-Type: text/html"));
    etag = strcasestr(answer, "ETag: ");
    assert_non_null(etag);
    snprintf(body, sizeof(body), "If-None-Match: W/\"x\", %.18s\r\n", etag + 6);
    assert_int_equal(ask("GET", "/", with(bearer(view), body), NULL), 304);
    assert_int_equal(ask("GET", "/", with(bearer(view), "If-None-Match: \"x\"\r\n"), NULL), 200);
}

static void hosts_and_origins(void **state)
{
    static const struct {
        const char *head;
        int get, post;
    } cases[] = {
        { "Host: localhost:8090\r\n", 200, 200 },
        { "Host: 127.0.0.1\r\n", 200, 200 },
        { "Host: [::1]:80\r\n", 200, 200 },
        { "Host: cam.example\r\n", 200, 200 },
        { "Host: CAM.example.:1\r\n", 200, 200 },
        { "Host: evil.example\r\n", 403, 403 },
        { "Host: localhost.evil.example\r\n", 403, 403 },
        { "Host: 10.0.0.1\r\n", 403, 403 },
        { "Host: \r\n", 403, 403 },
        { "Host: localhost:0x50\r\n", 403, 403 },
        { "Host: localhost\r\nOrigin: http://localhost\r\n", 200, 200 },
        { "Host: localhost:8090\r\nOrigin: http://localhost:8090\r\n", 200, 200 },
        { "Host: cam.example\r\nOrigin: https://cam.example\r\n", 200, 200 },
        { "Host: localhost:8090\r\nOrigin: http://localhost:8091\r\n", 200, 403 },
        { "Host: localhost\r\nOrigin: http://evil.example\r\n", 200, 403 },
        { "Host: localhost\r\nOrigin: null\r\n", 200, 403 },
        { "Host: localhost\r\nSec-Fetch-Site: cross-site\r\n", 200, 403 },
        { "Host: localhost\r\nSec-Fetch-Site: same-site\r\n", 200, 403 },
        { "Host: localhost\r\nSec-Fetch-Site: same-origin\r\n", 200, 200 },
    };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        print_message("%s", cases[i].head);
        assert_int_equal(ask("GET", "/api/v1/status", with(cases[i].head, bearer(view)), NULL), cases[i].get);
        assert_int_equal(ask("POST", "/api/v1/reload", with(with(cases[i].head, JSON), bearer(control)), "{}"),
                         cases[i].post);
    }
}

/* A target in absolute form counts instead of Host (RFC 9112, 3.2.2). */
static void absolute_targets(void **state)
{
    static const struct {
        const char *target, *head;
        int status;
    } cases[] = {
        { "http://localhost/api/v1/status", "", 200 },
        { "HTTPS://cam.example:8090/api/v1/visits?limit=3", "Host: other.example\r\n", 200 },
        { "http://[::1]:80/api/v1/status", "", 200 },
        { "http://evil.example/api/v1/status", "Host: localhost\r\n", 403 },
        { "http://me@localhost/api/v1/status", "", 403 },
        { "http:///api/v1/status", "", 404 },
        { "ftp://localhost/api/v1/status", "", 404 },
        { "http://localhost", "Accept: text/html\r\n", 200 },
    };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        print_message("%s\n", cases[i].target);
        assert_int_equal(ask("GET", cases[i].target, with(cases[i].head, bearer(view)), NULL), cases[i].status);
    }
    assert_int_equal(ask("POST", "http://localhost/api/v1/reload",
                         with(with("Host: cam.example\r\nOrigin: http://cam.example\r\n", JSON), bearer(control)), "{}"),
                     403); /* of another origin than the target's */
}

static void parameters(void **state)
{
    static const struct {
        const char *method, *target, *says;
    } cases[] = {
        { "GET", "/api/v1/visits?form=2026-11-21", "/api/v1/visits: unknown parameter `form`; did you mean `from`?" },
        { "GET", "/api/v1/events?limit=2&colour=red", "unknown parameter `colour`; there are limit and after" },
        { "GET", "/api/v1/audit?colour=red", "unknown parameter `colour`; there is limit" },
        { "GET", "/api/v1/status?_=17", "unknown parameter `_`; it has none" },
        { "GET", "/replay/api/v1/views/main/pick?x=1&y=1&z=1", "unknown parameter `z`" },
        { "POST", "/api/v1/reload?dry_run=true", "unknown parameter `dry_run`; it has none" },
        { "GET", "/snapshot?t=17", NULL }, /* addresses of pictures get such, against caches */
        { "GET", "/?fbclid=17", NULL },
        { "GET", "/api/v1/status?", NULL },
    };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        const bool post = !strcmp(cases[i].method, "POST");

        print_message("%s\n", cases[i].target);
        assert_int_equal(ask(cases[i].method, cases[i].target, with(JSON, bearer(control)), post ? "{}" : NULL),
                         cases[i].says ? 400 : 200);
        assert_true(!cases[i].says || strstr(answer, cases[i].says));
    }
}

static void bodies(void **state)
{
    static const struct {
        const char *type, *body;
        int status;
        const char *says;
    } cases[] = {
        { "", "{}", 415, "application/json" },
        { "Content-Type: text/plain\r\n", "{}", 415, "application/json" },
        { "Content-Type: application/jsonx\r\n", "{}", 415, "application/json" },
        { "Content-Type: application/json; charset=utf-8\r\n", "{}", 200, "reload" },
        { JSON, "", 200, "reload" },
        { JSON, "{\"dry_run\": true}", 200, "dry" },
        { JSON, "{\"dry_run\": 1}", 400, "true or false" },
        { JSON, "{\"dry\": true}", 400, "did you mean `dry_run`" },
        { JSON, "{", 400, "line 1" },
        { JSON, "[]", 400, "not an object" },
        { JSON, "{\"a\": 1, \"a\": 2}", 400, "not JSON" },
        { JSON, "{} x", 400, "not JSON" },
        { JSON, "{\"a\": 1e999}", 400, "not JSON" },
    };
    char *big = malloc(65537 + 1), chunk[1100];
    int fd;

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        assert_int_equal(ask("POST", "/api/v1/reload", with(bearer(control), cases[i].type), cases[i].body),
                         cases[i].status);
        assert_non_null(strstr(answer, cases[i].says));
        if (cases[i].status >= 400)
            assert_non_null(strstr(answer, "{\"error\":\""));
    }
    memset(big, ' ', 65537);
    big[65537] = 0;
    assert_int_equal(ask("POST", "/api/v1/reload", with(bearer(control), JSON), big), 413);
    big[65536] = 0;
    memcpy(big, "{}", 2);
    assert_int_equal(ask("POST", "/api/v1/reload", with(bearer(control), JSON), big), 200);
    free(big);
    /* in pieces without a stated sum */
    fd = connect_tcp();
    snprintf(chunk, sizeof(chunk),
             "POST /api/v1/reload HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
             "Transfer-Encoding: chunked\r\n%s%s\r\n",
             bearer(control), JSON);
    assert_true(send_all(fd, chunk, strlen(chunk)));
    snprintf(chunk, sizeof(chunk), "400\r\n%*s\r\n", 1024, "");
    for (int i = 0; i < 80; i++)
        assert_true(send_all(fd, chunk, strlen(chunk)));
    assert_true(send_all(fd, "0\r\n\r\n", 5));
    receive(fd, answer, sizeof(answer));
    close(fd);
    assert_non_null(strstr(answer, " 413 "));
}

static void errors_of_the_service(void **state)
{
    static const struct {
        int err, status;
    } cases[] = { { -EINVAL, 400 },  { -ENOENT, 404 },  { -EBUSY, 409 },  { -EAGAIN, 409 },
                  { -ENOSPC, 507 },  { -EROFS, 507 },   { -EIO, 500 },    { -EOVERFLOW, 429 },
                  { -ENODATA, 503 }, { -ENOTSUP, 501 }, { -ENOMEM, 503 }, { -EPERM, 500 } };
    char body[64];

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        snprintf(body, sizeof(body), "{\"fail\": %d}", cases[i].err);
        assert_int_equal(ask("POST", "/api/v1/record", with(bearer(control), JSON), body), cases[i].status);
        assert_non_null(strstr(answer, "{\"error\":\"asked to fail\"}"));
        if (cases[i].status == 409)
            assert_non_null(strstr(answer, "\r\nRetry-After: 1\r\n"));
    }
    assert_int_equal(ask("GET", "/stream/camera/r9c9", bearer(view), NULL), 404);
    assert_non_null(strstr(answer, "no camera r9c9"));
    assert_int_equal(ask("GET", "/api/v1/views/main/pick?x=nan&y=1", bearer(view), NULL), 400);
    assert_int_equal(ask("GET", "/api/v1/views/main/pick?x=1", bearer(view), NULL), 400);
    api_calls = 0;
    for (int i = 0; i < 100; i++)
        (void)ask("GET", "/healthz", "", NULL);
    assert_true(api_calls < 100); /* an answer is good for a while, unless each takes as long */
    fake_state = "armed";
    sleep_ms(300);
    assert_int_equal(ask("GET", "/healthz", "", NULL), 503);
    assert_non_null(strstr(answer, "\r\n\r\narmed\n"));
    fake_state = "degraded";
    sleep_ms(300);
    assert_int_equal(ask("GET", "/healthz", "", NULL), 200);
    assert_non_null(strstr(answer, "\r\n\r\nok\n"));
}

static void visits_are_asked_for(void **state)
{
    static const char *const no_time[] = { "yesterday",  "1764460800", "2026-02-30", "2026-13-01",
                                           "2026-11-00", "2027-02-29", "----------", "2026-11-21Z05" };

    (void)state;
    assert_int_equal(ask("GET", "/api/v1/visits?label=Car&zone=gate&from=2026-11-21&limit=7", bearer(view), NULL), 200);
    assert_non_null(
        strstr(answer, "{\"limit\":7,\"from\":\"2026-11-21\",\"to\":null,\"label\":\"Car\",\"zone\":\"gate\","));
    assert_int_equal(ask("GET", "/api/v1/visits?before=2026-11-21T18-05-00-123Z-7&after=2026-11-20&reviewed=false",
                         bearer(view), NULL),
                     200);
    assert_non_null(strstr(answer,
                           "\"before\":\"2026-11-21T18-05-00-123Z-7\",\"after\":\"2026-11-20\",\"user\":\"view\","
                           "\"reviewed\":-1}"));
    assert_int_equal(ask("GET", "/api/v1/visits?reviewed=maybe", bearer(view), NULL), 400);
    assert_int_equal(ask("GET", "/api/v1/visits?before=the-first", bearer(view), NULL), 400);
    assert_int_equal(ask("GET", "/api/v1/visits/days?from=2026-11-01&offset_min=-90", bearer(view), NULL), 200);
    assert_non_null(strstr(answer, "{\"from\":\"2026-11-01\",\"offset_min\":-90}"));
    assert_int_equal(ask("GET", "/api/v1/visits/days?offset_min=901", bearer(view), NULL), 400);
    assert_int_equal(ask("GET", "/api/v1/visits/days?offset_min=--1", bearer(view), NULL), 400);
    for (size_t i = 0; i < ARRAY_LEN(no_time); i++) {
        char target[100];

        snprintf(target, sizeof(target), "/api/v1/visits?from=%s", no_time[i]);
        assert_int_equal(ask("GET", target, bearer(view), NULL), 400);
    }
    assert_int_equal(ask("GET", "/api/v1/visits?limit=0x7", bearer(view), NULL), 400);
    assert_int_equal(ask("GET", "/api/v1/visits/v1/seen", bearer(view), NULL), 200);
    assert_non_null(strstr(answer, "\r\n\r\nseen"));
    assert_int_equal(ask("GET", "/api/v1/visits/v2/seen", bearer(view), NULL), 404);
}

static const char *posting(const char *token)
{
    static char headers[2][1024];
    static int next;

    next ^= 1;
    snprintf(headers[next], sizeof(headers[next]), "Content-Type: application/json\r\n%s", bearer(token));
    return headers[next];
}

/* A token for viewing reviews, and neither keeps nor deletes. */
static void visits_are_reviewed_by_viewers(void **state)
{
    (void)state;
    assert_int_equal(ask("POST", "/api/v1/visits/v1", posting(view), "{\"reviewed\":true}"), 200);
    assert_non_null(strstr(answer, "{\"user\":\"view\",\"body\":{\"reviewed\":true}}"));
    assert_int_equal(ask("POST", "/api/v1/visits", posting(control), "{\"visits\":[\"v1\"],\"reviewed\":true}"), 200);
    assert_non_null(strstr(answer, "\"user\":\"control\""));
    assert_int_equal(ask("POST", "/api/v1/visits/v1", posting(view), "{\"keep\":true}"), 403);
    assert_int_equal(ask("POST", "/api/v1/visits/v1", posting(view), "{\"delete\":true}"), 403);
    assert_int_equal(ask("POST", "/api/v1/visits", posting(view), "{\"visits\":[\"v1\"],\"delete\":true}"), 403);
    assert_int_equal(ask("POST", "/api/v1/visits", posting(control), "{\"visits\":[\"v1\"],\"delete\":true}"), 200);
    assert_int_equal(
        ask("POST", "/api/v1/visits", "Content-Type: application/json\r\n", "{\"visits\":[\"v1\"],\"reviewed\":true}"),
        401);
}

static void wrong_tokens_are_put_off(void **state)
{
    uint64_t id;
    char *event;

    (void)state;
    for (int i = 0; i < 10; i++)
        assert_int_equal(ask("GET", "/api/v1/status", bearer("0123456789abcdef0123456789abcdef"), NULL), 401);
    for (int i = 0; i < 5; i++) {
        assert_int_equal(ask("GET", "/api/v1/status", bearer(""), NULL), 429);
        assert_non_null(strcasestr(answer, "\r\nRetry-After: "));
    }
    assert_int_equal(ask("POST", "/login", "Content-Type: application/x-www-form-urlencoded\r\n", "token=x"), 429);
    assert_int_equal(ask("GET", "/api/v1/status", "", NULL), 401);           /* none is not a wrong one */
    assert_int_equal(ask("GET", "/api/v1/status", bearer(view), NULL), 200); /* nobody can be locked out */
    assert_int_equal(fake_counters.requests, 18);
    assert_int_equal(fake_counters.refused, 17);
    assert_true(sst_events_next(fake.events, 0, &id, &event));
    assert_non_null(strstr(event, "\"client\""));
    assert_non_null(strstr(event, "127.0.0.1"));
    free(event);
    assert_false(sst_events_next(fake.events, id, &id, &event));
}

/* What a child with this user and groups is answered; 0: not even connected. It connects, by which it is known, and no
 * more: the server has threads, and one of them may have held the allocator's lock when it forked. */
static int ask_as(uid_t uid, gid_t gid, int groups, const gid_t *group, const char *method, const char *target)
{
    struct sockaddr_un at = { .sun_family = AF_UNIX };
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    int status;
    pid_t child;

    assert_true(fd >= 0);
    snprintf(at.sun_path, sizeof(at.sun_path), "%s", in_folder("control.sock"));
    child = fork();
    if (!child) {
        if (setgroups((size_t)groups, group) || setgid(gid) || setuid(uid))
            _exit(2);
        _exit(connect(fd, (struct sockaddr *)&at, sizeof(at)) != 0);
    }
    assert_true(child > 0);
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) < 2);
    if (WEXITSTATUS(status)) {
        close(fd);
        return 0;
    }
    return ask_on(fd, method, target, !strcmp(method, "POST") ? JSON : "", !strcmp(method, "POST") ? "{}" : NULL);
}

static void peers_of_the_socket(void **state)
{
    const struct group *daemon = getgrnam("daemon");
    const gid_t control_group = daemon ? daemon->gr_gid : 1;
    const struct group *video = getgrnam("video");
    const gid_t view_group = video ? video->gr_gid : 44;
    struct sst_http_config cfg;
    struct stat st;

    (void)state;
    assert_int_equal(ask_on(connect_local(in_folder("control.sock")), "POST", "/api/v1/reload", JSON, "{}"), 200);
    assert_int_equal(
        ask_on(connect_local(in_folder("control.sock")), "GET", "/api/v1/status", "Host: what.ever\r\n", NULL), 200);
    assert_int_equal(stat(in_folder("control.sock"), &st), 0);
    assert_int_equal(st.st_mode & 0777, 0660);
    if (geteuid() || !daemon || !video) {
        print_message("%s: strangers are not tried\n",
                      geteuid() ? "not root" : "there is no group `daemon` or `video`");
        skip();
    }
    sst_http_close(server);
    cfg = config();
    cfg.address = NULL;
    cfg.group = "daemon";
    cfg.view_group = "video";
    assert_int_equal(sst_http_open(&server, &cfg), 0);
    assert_int_equal(chmod(folder, 0755), 0);
    assert_int_equal(ask_as(12345, 12345, 0, NULL, "GET", "/api/v1/status"), 403);
    assert_int_equal(ask_as(12345, 12345, 0, NULL, "GET", "/healthz"), 200);
    assert_int_equal(ask_as(12345, 12345, 1, &view_group, "GET", "/api/v1/status"), 200);
    assert_int_equal(ask_as(12345, 12345, 1, &view_group, "POST", "/api/v1/reload"), 403);
    assert_int_equal(ask_as(12345, 12345, 1, &view_group, "POST", "/api/v1/publishers"), 200); /* as sst-rtsp */
    assert_int_equal(ask_as(12345, 12345, 0, NULL, "POST", "/api/v1/publishers"), 403);
    assert_int_equal(ask_as(12345, 12345, 1, &control_group, "POST", "/api/v1/reload"), 200);
    assert_int_equal(ask_as(12345, control_group, 0, NULL, "POST", "/api/v1/reload"), 200);
    assert_int_equal(ask_as(12345, view_group, 0, NULL, "POST", "/api/v1/reload"), 403);
    assert_int_equal(stat(in_folder("control.sock"), &st), 0);
    assert_int_equal(st.st_gid, control_group);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(every_route_for_everybody, make_server, end_service),
        cmocka_unit_test_setup_teardown(main_view_takes_control, make_server, end_service),
        cmocka_unit_test_setup_teardown(unknown_paths, make_server, end_service),
        cmocka_unit_test_setup_teardown(ways_to_give_a_token, make_server, end_service),
        cmocka_unit_test_setup_teardown(sessions_are_listed_and_ended, make_server, end_service),
        cmocka_unit_test(logins_end_only_their_like),
        cmocka_unit_test_setup_teardown(login_and_page, make_server, end_service),
        cmocka_unit_test_setup_teardown(hosts_and_origins, make_server, end_service),
        cmocka_unit_test_setup_teardown(absolute_targets, make_server, end_service),
        cmocka_unit_test_setup_teardown(parameters, make_server, end_service),
        cmocka_unit_test_setup_teardown(bodies, make_server, end_service),
        cmocka_unit_test_setup_teardown(errors_of_the_service, make_server, end_service),
        cmocka_unit_test_setup_teardown(visits_are_asked_for, make_server, end_service),
        cmocka_unit_test_setup_teardown(visits_are_reviewed_by_viewers, make_server, end_service),
        cmocka_unit_test_setup_teardown(wrong_tokens_are_put_off, make_server, end_service),
        cmocka_unit_test_setup_teardown(peers_of_the_socket, make_server, end_service),
    };

    return http_tests(tests);
}
