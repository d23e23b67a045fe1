/* Named tokens, identities of proxies and the audit log: over HTTP, and their files. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/http_fake.h"

#include "capture/access/access.h"
#include "daemon/publish/publish_internal.h"

#define OTHERS "chmod 600"

static const char *const proxies[] = { "127.0.0.1" };

static int make_server(void **state)
{
    struct sst_http_config cfg;

    if (make_service(state))
        return -1;
    cfg = config();
    serve(&cfg);
    show(1, 1000);
    return 0;
}

/* Made over the API. @param more  members of the request */
static void add(char secret[80], const char *name, const char *more)
{
    char body[300];
    const char *at;

    snprintf(body, sizeof(body), "{\"name\":\"%s\",%s}", name, more);
    assert_int_equal(ask("POST", "/api/v1/tokens", with(bearer(control), JSON), body), 200);
    at = strstr(answer, "\"token\":\"");
    assert_non_null(at);
    assert_int_equal(sscanf(at + 9, "%64[0-9a-f]", secret), 1);
}

static void rights_open_routes(void **state)
{
    static const struct {
        const char *rights;
        int status, snapshot, recordings, control;
    } cases[] = {
        { "\"view\"", 200, 200, 403, 403 },
        { "\"snapshot\"", 403, 200, 403, 403 },
        { "\"recordings\"", 403, 403, 200, 403 },
        { "\"view\",\"recordings\"", 200, 200, 200, 403 },
        { "\"control\"", 200, 200, 200, 200 },
    };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        char secret[80], name[16], more[80];

        snprintf(name, sizeof(name), "t%zu", i);
        snprintf(more, sizeof(more), "\"rights\":[%s]", cases[i].rights);
        add(secret, name, more);
        print_message("%s\n", cases[i].rights);
        assert_int_equal(ask("GET", "/api/v1/status", bearer(secret), NULL), cases[i].status);
        assert_int_equal(ask("GET", "/", bearer(secret), NULL), cases[i].status);
        assert_int_equal(ask("HEAD", "/stream", bearer(secret), NULL), cases[i].status);
        assert_int_equal(ask("GET", "/api/v1/visits", bearer(secret), NULL), cases[i].status);
        assert_int_equal(ask("GET", "/snapshot/camera/r0c0", bearer(secret), NULL), cases[i].snapshot);
        assert_int_equal(ask("GET", "/api/v1/recordings", bearer(secret), NULL), cases[i].recordings);
        assert_int_equal(ask("GET", "/api/v1/download/picture.jpg", bearer(secret), NULL), cases[i].recordings);
        assert_int_equal(ask("POST", "/api/v1/replay", with(bearer(secret), JSON), "{}"), cases[i].recordings);
        assert_int_equal(ask("POST", "/api/v1/delete", with(bearer(secret), JSON), "{}"), cases[i].control);
        assert_int_equal(ask("GET", "/api/v1/tokens", bearer(secret), NULL), cases[i].control);
        assert_null(strstr(answer, secret));
        assert_int_equal(ask("GET", "/api/v1/audit", bearer(secret), NULL), cases[i].control);
    }
}

static void form_of_a_new_token(void **state)
{
    static const char *const bad[] = { "{}", "{\"name\":\"a\"}", "{\"name\":\"a\",\"rights\":[]}",
                                       "{\"name\":\"a\",\"rights\":[\"all\"]}", "{\"name\":\"a b\",\"rights\":[\"view\"]}",
                                       "{\"name\":\"control\",\"rights\":[\"view\"]}",
                                       "{\"name\":\"a\",\"rights\":[\"view\"],\"expires_s\":0}",
                                       "{\"name\":\"a\",\"rights\":[\"view\"],\"expires_s\":\"1\"}",
                                       "{\"name\":\"a\",\"rights\":[\"view\"],\"other\":1}",
                                       "{\"name\":\"a23456789012345678901234567890123\",\"rights\":[\"view\"]}" };
    char secret[80];
    struct stat st;

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(bad); i++) {
        print_message("%s\n", bad[i]);
        assert_int_equal(ask("POST", "/api/v1/tokens", with(bearer(control), JSON), bad[i]), 400);
    }
    assert_int_equal(ask("POST", "/api/v1/tokens", with(bearer(view), JSON), bad[0]), 403);
    add(secret, "guard", "\"rights\":[\"view\"]");
    assert_int_equal(ask("POST", "/api/v1/tokens", with(bearer(control), JSON),
                         "{\"name\":\"guard\",\"rights\":[\"control\"]}"),
                     409);
    assert_int_equal(stat(in_folder("token.named"), &st), 0);
    assert_int_equal(st.st_mode & 0777, 0600);
    assert_int_equal(ask("POST", "/api/v1/tokens/nobody", with(bearer(control), JSON), "{\"revoke\":true}"), 404);
    assert_int_equal(ask("POST", "/api/v1/tokens/guard", with(bearer(control), JSON), "{}"), 400);
    assert_int_equal(ask("GET", "/api/v1/status", bearer(secret), NULL), 200);
}

/* The cookie of a login as a header. */
static const char *log_in(const char *secret)
{
    static char text[200];
    char body[100], name[24], value[80];
    const char *at;

    snprintf(body, sizeof(body), "token=%s", secret);
    assert_int_equal(ask("POST", "/login", "Content-Type: application/x-www-form-urlencoded\r\n", body), 303);
    snprintf(name, sizeof(name), "sst_%d=", sst_http_port(server));
    at = strstr(answer, name);
    assert_non_null(at);
    assert_int_equal(sscanf(at + strlen(name), "%64[0-9a-f]", value), 1);
    snprintf(text, sizeof(text), "Cookie: %s%s\r\n", name, value);
    return text;
}

/* A revoked token ends its session and its open streams, and the file's tokens stay. */
static void revocation_takes_effect_at_once(void **state)
{
    static const char *const paths[] = { "/stream", "/api/v1/events/stream" };
    char secret[80], request[600], cookie[200];
    int fd[4];

    (void)state;
    add(secret, "guard", "\"rights\":[\"view\"]");
    snprintf(cookie, sizeof(cookie), "%s", log_in(secret));
    assert_int_equal(ask("GET", "/api/v1/sessions", cookie, NULL), 200);
    assert_contains(answer, "\"user\":\"guard\"");
    assert_int_equal(ask("GET", "/api/v1/visits", cookie, NULL), 200); /* with the visits that this user has reviewed */
    assert_contains(answer, "\"user\":\"guard\"");
    assert_int_equal(ask("POST", "/api/v1/visits/v1", with(bearer(secret), JSON), "{\"reviewed\":true}"), 200);
    assert_contains(answer, "\"user\":\"guard\"");
    assert_int_equal(ask("POST", "/api/v1/visits/v1", with(bearer(secret), JSON), "{\"delete\":true}"), 403);
    for (int i = 0; i < 4; i++) {
        fd[i] = connect_tcp();
        snprintf(request, sizeof(request), "GET %s HTTP/1.1\r\nHost: localhost\r\n%s\r\n", paths[i & 1],
                 i & 2 ? cookie : bearer(secret));
        assert_true(send_all(fd[i], request, strlen(request)));
        assert_true(recv(fd[i], request, 12, MSG_WAITALL) == 12 && !memcmp(request + 9, "200", 3));
    }
    assert_int_equal(ask("POST", "/api/v1/tokens/guard", with(bearer(control), JSON), "{\"revoke\":true}"), 200);
    for (int i = 0; i < 4; i++) {
        receive(fd[i], answer, sizeof(answer)); /* returns when the service ends it */
        close(fd[i]);
    }
    assert_int_equal(ask("GET", "/api/v1/status", bearer(secret), NULL), 401);
    assert_int_equal(ask("GET", "/api/v1/status", cookie, NULL), 401);
    assert_int_equal(ask("GET", "/api/v1/status", bearer(view), NULL), 200);
}

static void tokens_expire(void **state)
{
    struct sst_access_token token = { .name = "soon", .rights = SST_RIGHT_VIEW };
    char secret[SST_ACCESS_SECRET], error[256], cookie[200];
    int status = 200;

    (void)state;
    assert_int_equal(sst_access_add(in_folder("token.named"), &token, secret, error), 0); /* as `sst token` offline */
    assert_int_equal(ask("GET", "/api/v1/status", bearer(secret), NULL), 200);
    assert_int_equal(sst_access_revoke(in_folder("token.named"), "soon", error), 0);
    assert_int_equal(ask("GET", "/api/v1/status", bearer(secret), NULL), 401);
    token.expires_s = sst_clock_wall_ns() / 1000000000 - 1;
    assert_int_equal(sst_access_add(in_folder("token.named"), &token, secret, error), -EINVAL);
    token.expires_s += 4;
    assert_int_equal(sst_access_add(in_folder("token.named"), &token, secret, error), 0);
    snprintf(cookie, sizeof(cookie), "%s", log_in(secret));
    for (int i = 0; i < 600 && status == 200; i++) {
        status = ask("GET", "/api/v1/status", cookie, NULL);
        sleep_ms(100);
    }
    assert_int_equal(status, 401);
    assert_true(sst_clock_wall_ns() / 1000000000 >= token.expires_s);
    assert_int_equal(ask("GET", "/api/v1/status", bearer(secret), NULL), 401);
    assert_int_equal(ask("GET", "/api/v1/tokens", bearer(control), NULL), 200);
    assert_contains(answer, "\"expired\":true");
}

/* A file that others can write, or a damaged one, lets nobody in; all others still come in. */
static void files_that_are_not_trusted(void **state)
{
    struct sst_access_list list;
    char secret[80], error[256];
    FILE *f;

    (void)state;
    add(secret, "guard", "\"rights\":[\"view\"]");
    for (int mode = 0620; mode >= 0602; mode -= 06) { /* 0620, 0612, 0604 */
        assert_int_equal(chmod(in_folder("token.named"), (mode_t)mode), 0);
        assert_int_equal(sst_access_read(&list, in_folder("token.named"), error), -EPERM);
        assert_contains(error, OTHERS);
        assert_int_equal(list.tokens, 0);
        assert_int_equal(ask("GET", "/api/v1/status", bearer(secret), NULL), 401);
        assert_int_equal(ask("GET", "/api/v1/status", bearer(view), NULL), 200);
        assert_int_equal(sst_access_revoke(in_folder("token.named"), "guard", error), -EPERM);
    }
    assert_int_equal(chmod(in_folder("token.named"), 0600), 0);
    assert_int_equal(ask("GET", "/api/v1/status", bearer(secret), NULL), 200);
    f = fopen(in_folder("token.named"), "w");
    fputs("{\"tokens\": [{\"name\": \"guard\", \"rights\": [\"control\"]}]}", f);
    fclose(f);
    assert_int_equal(sst_access_read(&list, in_folder("token.named"), error), -EBADMSG);
    assert_int_equal(ask("GET", "/api/v1/status", bearer(secret), NULL), 401);
    assert_int_equal(ask("POST", "/api/v1/tokens", with(bearer(control), JSON), "{\"name\":\"a\",\"rights\":[\"view\"]}"),
                     500);
    assert_int_equal(unlink(in_folder("token.named")), 0);
    assert_int_equal(symlink(in_folder("elsewhere"), in_folder("token.named")), 0);
    assert_true(sst_access_read(&list, in_folder("token.named"), error) < 0);
}

static void serve_behind(const char *address)
{
    const char *const *from = address ? &address : proxies;
    struct sst_http_config cfg = config();

    sst_http_close(server);
    cfg.proxy = from;
    cfg.proxies = 1;
    cfg.proxy_header = "X-Remote-User";
    cfg.proxy_rights = SST_RIGHT_VIEW | SST_RIGHT_RECORDINGS;
    assert_int_equal(sst_http_open(&server, &cfg), 0);
}

static void a_proxy_reports_its_users(void **state)
{
    static const char alice[] = "x-remote-user: alice@example\r\n";

    (void)state;
    assert_int_equal(ask("GET", "/api/v1/status", alice, NULL), 401); /* no proxy is named: a header like others */
    serve_behind(NULL);
    assert_int_equal(ask("GET", "/api/v1/status", alice, NULL), 200);
    assert_int_equal(ask("GET", "/api/v1/recordings", alice, NULL), 200);
    assert_int_equal(ask("POST", "/api/v1/reload", with(alice, JSON), "{}"), 403);
    assert_int_equal(ask("GET", "/api/v1/status", "", NULL), 401);
    assert_int_equal(ask("GET", "/api/v1/status", with(alice, "X-Remote-User: root\r\n"), NULL), 400);
    assert_int_equal(ask("GET", "/api/v1/status", "X-Remote-User: \r\n", NULL), 400);
    assert_int_equal(ask("GET", "/api/v1/status", "X-Remote-User: a b\r\n", NULL), 400);
    assert_int_equal(ask("GET", "/api/v1/status", "X-Remote-User: <script>\r\n", NULL), 400);
    assert_int_equal(ask("POST", "/api/v1/reload", with(with(alice, bearer(control)), JSON), "{}"), 200);
    assert_int_equal(ask("GET", "/api/v1/status", with(alice, bearer("wrong")), NULL), 401);
    /* A page elsewhere cannot use the proxy's login to change anything. */
    assert_int_equal(ask("POST", "/api/v1/replay", with(with(alice, "Origin: http://evil.example\r\n"), JSON), "{}"), 403);
    serve_behind("192.0.2.1"); /* and this client comes from elsewhere */
    assert_int_equal(ask("GET", "/api/v1/status", alice, NULL), 403);
    assert_contains(answer, "from the proxy alone");
    assert_int_equal(ask("GET", "/api/v1/status", with(alice, bearer(control)), NULL), 403);
    assert_int_equal(ask("GET", "/api/v1/status", bearer(control), NULL), 200);
    serve_behind("::ffff:127.0.0.1");
    assert_int_equal(ask("GET", "/api/v1/download/picture.jpg", alice, NULL), 200);
    assert_int_equal(ask("GET", "/api/v1/audit", bearer(control), NULL), 200);
    assert_contains(answer, "\"name\":\"alice@example\",\"address\":\"127.0.0.1\",\"action\":\"download\",\"object\":\"picture.jpg\"");
}

static void what_is_done_is_noted(void **state)
{
    const struct sst_audit line = { .name = "a", .address = "b", .action = "c", .object = "d" };
    char secret[80], *text;
    struct stat st;

    (void)state;
    add(secret, "boss", "\"rights\":[\"control\"]");
    (void)log_in(secret);
    assert_int_equal(ask("POST", "/api/v1/delete", with(bearer(secret), JSON), "{\"name\":\"old\"}"), 200);
    assert_int_equal(ask("POST", "/api/v1/delete", with(bearer(view), JSON), "{\"name\":\"other\"}"), 403);
    assert_int_equal(ask("POST", "/api/v1/views/main", with(bearer(control), JSON), "{\"focus_px\":3}"), 200);
    assert_int_equal(ask("POST", "/api/v1/views/v1", with(bearer(control), JSON), "{\"focus_px\":4}"), 200);
    assert_int_equal(ask("POST", "/login", "Content-Type: application/x-www-form-urlencoded\r\n", "token=wrong"), 401);
    assert_int_equal(ask("GET", "/api/v1/audit", bearer(control), NULL), 200);
    assert_contains(answer, "\"name\":\"control\",\"address\":\"127.0.0.1\",\"action\":\"tokens\",\"object\":\"{\\\"name\\\":\\\"boss\\\"");
    assert_contains(answer, "\"name\":\"boss\",\"address\":\"127.0.0.1\",\"action\":\"login\"");
    assert_contains(answer, "\"name\":\"boss\",\"address\":\"127.0.0.1\",\"action\":\"delete\",\"object\":\"{\\\"name\\\":\\\"old\\\"}\"");
    assert_contains(answer, "\"action\":\"views\",\"object\":\"main {\\\"focus_px\\\":3}\"");
    assert_null(strstr(answer, "other"));
    assert_null(strstr(answer, "focus_px\\\":4"));
    assert_null(strstr(answer, secret));
    assert_int_equal(ask("GET", "/api/v1/audit?limit=1", bearer(control), NULL), 200);
    assert_null(strstr(answer, "boss"));
    assert_int_equal(ask("GET", "/api/v1/audit?limit=x", bearer(control), NULL), 400);
    /* Bounded: the file and the one before. */
    assert_int_equal(truncate(in_folder("token.audit"), SST_AUDIT_BYTES + 1), 0);
    assert_int_equal(sst_audit_write(in_folder("token.audit"), &line), 0);
    assert_int_equal(stat(in_folder("token.audit"), &st), 0);
    assert_true(st.st_size < 200 && (st.st_mode & 0777) == 0600);
    assert_int_equal(stat(in_folder("token.audit.1"), &st), 0);
    assert_int_equal(st.st_size, SST_AUDIT_BYTES + 1);
    text = sst_audit_text(in_folder("token.audit"), 1);
    assert_contains(text, "\"object\":\"d\"");
    free(text);
}

/* Strangers learn neither paths nor keys of the configuration. */
static void refusals_name_no_path(void **state)
{
    static const char *const asked[][2] = { { "GET", "/api/v1/status" }, { "GET", "/login" }, { "GET", "/nothing" } };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(asked); i++) {
        for (int wrong = 0; wrong < 2; wrong++) {
            (void)ask(asked[i][0], asked[i][1], wrong ? bearer("wrong") : "", NULL);
            assert_null(strstr(answer, "token_file"));
            assert_null(strstr(answer, folder));
            assert_null(strstr(answer, "/var/lib"));
        }
    }
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, make_server, end_service)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(rights_open_routes),
        TEST(form_of_a_new_token),
        TEST(revocation_takes_effect_at_once),
        TEST(tokens_expire),
        TEST(files_that_are_not_trusted),
        TEST(a_proxy_reports_its_users),
        TEST(what_is_done_is_noted),
        TEST(refusals_name_no_path),
    };

    return http_tests(tests);
}
