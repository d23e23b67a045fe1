/* Certificates that are renewed while the server runs: by hand and by themselves, good ones and bad ones. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/http_fake.h"

#include "daemon/publish/publish_internal.h"

static char said[SST_LOG_MAX];

/* --- certificates ------------------------------------------------------------------------------------------------- */

static void need_openssl(void)
{
    if (system("openssl version >/dev/null 2>&1")) {
        print_message("openssl is not installed: TLS is not tried\n");
        skip();
    }
}

/* A certificate for localhost, named by its organisation. */
static void make_pair(const char *name, const char *organisation, int days)
{
    char command[800];

    snprintf(command, sizeof(command),
             "cd %s && openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days %d "
             "-subj /O=%s/CN=localhost -keyout %s.key -out %s.pem 2>/dev/null",
             folder, days, organisation, name, name);
    assert_int_equal(system(command), 0);
}

/* As renewals do: a new file beside, renamed. */
static void install(const char *name)
{
    char command[600];

    snprintf(command, sizeof(command), "cd %s && cp %s.key k && cp %s.pem c && mv k key.pem && mv c cert.pem", folder,
             name, name);
    assert_int_equal(system(command), 0);
}

/* Whose certificate does a new connection get? By another program's TLS. */
static void expect_organisation(const char *organisation)
{
    char command[300], text[400];
    FILE *f;

    snprintf(command, sizeof(command),
             "openssl s_client -connect 127.0.0.1:%d </dev/null 2>/dev/null | openssl x509 -noout -subject",
             sst_http_port(server));
    f = popen(command, "r");
    assert_non_null(f);
    text[fread(text, 1, sizeof(text) - 1, f)] = 0;
    pclose(f);
    snprintf(command, sizeof(command), "O = %s,", organisation);
    if (!strstr(text, command))
        fail_msg("wanted %s, got: %s", organisation, text);
}

static json_t *last_event(const char *type)
{
    uint64_t id, after = 0;
    json_t *found = NULL;
    char *text;

    while (sst_events_next(fake.events, after, &id, &text)) {
        json_t *o = json_loads(text, 0, NULL);

        if (!strcmp(json_string_value(json_object_get(o, "type")), type)) {
            json_decref(found);
            found = json_incref(o);
        }
        json_decref(o);
        free(text);
        after = id;
    }
    return found;
}

static void expect_event(const char *state, const char *words)
{
    json_t *o = last_event("certificate");

    if (!o || strcmp(json_string_value(json_object_get(json_object_get(o, "data"), "state")), state) ||
        !strstr(json_string_value(json_object_get(o, "message")), words))
        fail_msg("wanted %s, %s, got: %s", state, words, o ? json_string_value(json_object_get(o, "message")) : "none");
    json_decref(o);
}

/* A page that is being watched while the certificate changes. @return the program, whose output is the stream */
static FILE *watch_events(void)
{
    char command[400];
    FILE *f;

    snprintf(command, sizeof(command),
             "curl -s -k -N -H 'Accept: application/x-ndjson' 'https://127.0.0.1:%d/api/v1/events/stream?after=0' "
             "-H 'Authorization: Bearer %s'",
             sst_http_port(server), view);
    f = popen(command, "r");
    assert_non_null(f);
    return f;
}

static void expect_line(FILE *f, const char *words)
{
    char line[1000] = "";

    while (fgets(line, sizeof(line), f))
        if (strstr(line, words))
            return;
    fail_msg("the stream ended without %s", words);
}

static void refuse(const char *certificate, const char *key, int err, const char *words)
{
    struct sst_http_certificate c;
    char *before = sst_log_hold_errors(said);

    said[0] = 0;
    assert_int_equal(sst_http_renew(server, certificate, key, false, &c), err);
    sst_log_hold_errors(before);
    assert_contains(said, words);
}

/* --- tests -------------------------------------------------------------------------------------------------------- */

/* The old pair stays when the new one is no good; open streams see nothing of either. */
static void certificate_is_renewed(void **state)
{
    struct sst_http_config cfg = config();
    struct sst_http_certificate now, then;
    const char *cert = in_folder("cert.pem");
    char key[200], command[600];
    FILE *f;

    (void)state;
    need_openssl();
    make_pair("one", "First", 2);
    make_pair("two", "Second", 300);
    install("one");
    snprintf(key, sizeof(key), "%s/key.pem", folder);
    cfg.tls_certificate = cert;
    cfg.tls_key = key;
    serve(&cfg);
    assert_true(sst_http_certificate(server, &now));
    assert_true(llabs(now.until_s - (int64_t)time(NULL) - 2 * 86400) < 600);
    expect_organisation("First");
    sst_events_emit(fake.events, SST_EVENT_INFO, "start", NULL, "before");
    f = watch_events();
    expect_line(f, "before");

    /* Nothing changed, not the key of it, cut off, unreadable, another's. */
    assert_int_equal(sst_http_renew(server, cert, key, false, &then), 0);
    snprintf(command, sizeof(command), "cp %s/two.pem %s/cert.pem", folder, folder);
    assert_int_equal(system(command), 0);
    refuse(cert, key, -EINVAL, "is not the key of the certificate");
    snprintf(command, sizeof(command), "head -c 200 %s/two.pem >%s/cert.pem", folder, folder);
    assert_int_equal(system(command), 0);
    refuse(cert, key, -EINVAL, "holds no certificate in PEM");
    refuse(cert, "/nowhere/key.pem", -ENOENT, "/nowhere/key.pem");
    expect_organisation("First");

    /* By hand: first only judged. */
    install("two");
    assert_int_equal(sst_http_renew(server, cert, key, true, &then), 1);
    assert_true(then.until_s - now.until_s > 290 * 86400);
    expect_organisation("First");
    assert_int_equal(sst_http_renew(server, cert, key, false, &then), 1);
    expect_organisation("Second");
    expect_event("renewed", "holds until");
    sst_events_emit(fake.events, SST_EVENT_INFO, "start", NULL, "afterwards");
    expect_line(f, "afterwards");

    /* A certificate that is to hold for ever: to the end of the range of nanoseconds. */
    make_pair("long", "Long", 2900000);
    install("long");
    assert_int_equal(sst_http_renew(server, cert, key, false, &then), 1);
    assert_int_equal(then.until_s, INT64_MAX / 1000000000);
    expect_event("renewed", "holds until 2262-");
    sst_http_close(server); /* the stream ends */
    server = NULL;
    pclose(f);
}

/* Files that change by themselves: taken when they stand still, told once when they are no good. */
static void certificate_is_noticed(void **state)
{
    const int64_t step_ns = INT64_C(21000000000);
    struct sst_http_config cfg = config();
    const char *cert = in_folder("cert.pem");
    int64_t now_ns = sst_clock_now_ns() + 3600 * INT64_C(1000000000); /* then the server itself looks no more */
    char key[200], command[600];
    uint64_t events;

    (void)state;
    need_openssl();
    make_pair("one", "First", 20);
    make_pair("two", "Second", 300);
    make_pair("soon", "Soon", 5);
    install("one");
    snprintf(key, sizeof(key), "%s/key.pem", folder);
    cfg.tls_certificate = cert;
    cfg.tls_key = key;
    serve(&cfg);
    http_tls_look(&server->pairs, fake.events, now_ns += step_ns);
    assert_null(last_event("certificate"));
    install("two");
    http_tls_look(&server->pairs, fake.events, now_ns += step_ns);
    expect_organisation("First"); /* it may be incomplete */
    http_tls_look(&server->pairs, fake.events, now_ns += step_ns);
    expect_organisation("Second");
    expect_event("renewed", "holds until");

    snprintf(command, sizeof(command), "cp %s/one.pem %s/cert.pem", folder, folder);
    assert_int_equal(system(command), 0);
    for (int i = 0; i < 2; i++)
        http_tls_look(&server->pairs, fake.events, now_ns += step_ns);
    expect_event("refused", "is not the key of the certificate");
    events = sst_events_last(fake.events);
    for (int i = 0; i < 5; i++)
        http_tls_look(&server->pairs, fake.events, now_ns += step_ns);
    assert_int_equal(sst_events_last(fake.events), events);
    expect_organisation("Second");

    install("soon");
    for (int i = 0; i < 3; i++)
        http_tls_look(&server->pairs, fake.events, now_ns += step_ns);
    expect_organisation("Soon");
    expect_event("expiring", "it is taken over by itself");
    events = sst_events_last(fake.events);
    http_tls_look(&server->pairs, fake.events, now_ns += step_ns);
    assert_int_equal(sst_events_last(fake.events), events);
}

static int end(void **state)
{
    char command[200];

    snprintf(command, sizeof(command), "cd %s && rm -f one.* two.* soon.* long.* k c cert.pem key.pem", folder);
    return system(command) | end_service(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(certificate_is_renewed, make_service, end),
        cmocka_unit_test_setup_teardown(certificate_is_noticed, make_service, end),
    };

    return http_tests(tests);
}
