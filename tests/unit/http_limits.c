/* Limits of clients: silence, trickles, floods, garbage; no resource stays in use afterwards. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/http_fake.h"
#include "tests/quick.h"
#include "tests/random.h"

#define MANY 1000

static int make_server(void **state)
{
    struct sst_http_config cfg;

    if (make_service(state))
        return -1;
    cfg = config();
    cfg.clients = 24;
    serve(&cfg);
    return 0;
}

static bool has_ended(int fd)
{
    struct pollfd p = { .fd = fd, .events = POLLIN | POLLRDHUP };
    char byte;

    return poll(&p, 1, 0) > 0 && recv(fd, &byte, 1, MSG_DONTWAIT | MSG_PEEK) <= 0;
}

static int wait_clients(int wanted)
{
    for (int i = 0; i < DEADLINE_MS / 10 && fake_counters.clients != wanted; i++)
        sleep_ms(10);
    return fake_counters.clients;
}

/* All the slow ones at once: no byte, a byte now and then, half a body, silence after an answer. */
static void slow_clients_go(void **state)
{
    static const char request[] = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";
    const int64_t start_ns = sst_clock_now_ns(); /* before they connect: nobody is to go within 8 s from now */
    const int silent = connect_tcp(), trickle = connect_tcp(), body = connect_tcp(), idle = connect_tcp();
    const int body_trickle = connect_tcp();
    char text[600];
    int64_t late_ms = 0;
    int left = 5;

    (void)state;
    snprintf(text, sizeof(text), "POST /api/v1/reload HTTP/1.1\r\nHost: localhost\r\n%s%sContent-Length: 1000\r\n\r\n{",
             bearer(control), JSON);
    assert_true(send_all(body, text, strlen(text)));
    assert_true(send_all(body_trickle, text, strlen(text)));
    assert_true(send_all(idle, request, sizeof(request) - 1));
    assert_true(recv(idle, text, sizeof(text), 0) > 0);
    assert_true(send_all(trickle, request, 10));
    while (left && late_ms < DEADLINE_MS) {
        send_all(trickle, "a", 1);
        send_all(body_trickle, " ", 1);
        sleep_ms(250);
        left =
            !has_ended(silent) + !has_ended(trickle) + !has_ended(body) + !has_ended(body_trickle) + !has_ended(idle);
        late_ms = (sst_clock_now_ns() - start_ns) / 1000000;
        if (late_ms < 8000)
            assert_int_equal(left, 5);
    }
    assert_int_equal(left, 0);
    print_message("all gone after %lld ms\n", (long long)late_ms);
    assert_quick(start_ns, 14000000000);
    assert_int_equal(ask("GET", "/healthz", "", NULL), 200);
    close(silent);
    close(trickle);
    close(body);
    close(body_trickle);
    close(idle);
}

/* Beyond three quarters for one address nobody is let in; the socket is not concerned. */
static void connections_are_limited(void **state)
{
    int fds[40], open = 40;

    (void)state;
    for (int i = 0; i < 40; i++)
        fds[i] = connect_tcp();
    for (int wait = 0; wait < DEADLINE_MS / 10 && open > 18; wait++) {
        sleep_ms(10);
        open = 0;
        for (int i = 0; i < 40; i++)
            open += fds[i] >= 0 && !has_ended(fds[i]);
    }
    assert_int_equal(open, 18);
    assert_int_equal(ask("GET", "/healthz", "", NULL), 0);
    assert_int_equal(ask_on(connect_local(in_folder("control.sock")), "GET", "/api/v1/status", "", NULL), 200);
    for (int i = 0; i < 40; i++)
        close(fds[i]);
    assert_int_equal(wait_clients(0), 0);
    assert_int_equal(ask("GET", "/healthz", "", NULL), 200);
}

/* The socket has no addresses: the limit alone, and a few more to tell it to. */
static void beyond_the_limit_is_told(void **state)
{
    int fds[24];
    uint64_t id;
    char *event;

    (void)state;
    for (int i = 0; i < 24; i++) {
        fds[i] = connect_local(in_folder("control.sock"));
        assert_true(fds[i] >= 0);
    }
    assert_int_equal(wait_clients(24), 24);
    assert_int_equal(ask_on(connect_local(in_folder("control.sock")), "GET", "/api/v1/status", "", NULL), 503);
    assert_non_null(strstr(answer, "web.clients"));
    assert_true(sst_events_next(fake.events, 0, &id, &event));
    assert_non_null(strstr(event, "flood"));
    free(event);
    for (int i = 0; i < 24; i++)
        close(fds[i]);
}

static void headers_are_limited(void **state)
{
    char *head = malloc(200000);
    int fd, status;
    size_t n = 0;

    (void)state;
    /* within the limit, over it, and far over it: in one header, and in many */
    for (int size = 7000; size <= 150000; size += size < 10000 ? 1500 : 100000) {
        n = (size_t)snprintf(head, 200000, "%sX: ", bearer(view));
        memset(head + n, 'x', (size_t)size);
        strcpy(head + n + (size_t)size, "\r\n");
        status = ask("GET", "/api/v1/status", head, NULL);
        assert_int_equal(status, size == 7000 ? 200 : 431); /* also where the rest is not read any more */
        assert_true(size != 8500 || strstr(answer, "8192"));
    }
    n = (size_t)snprintf(head, 200000, "%s", bearer(view));
    for (int i = 0; i < 1500; i++)
        n += (size_t)snprintf(head + n, 200000 - n, "X%d: y\r\n", i);
    assert_int_equal(ask("GET", "/api/v1/status", head, NULL), 431);
    /* without an end */
    fd = connect_tcp();
    assert_true(send_all(fd, "GET /healthz HTTP/1.1\r\nHost: localhost\r\n", 40));
    for (n = 0; n < 100 && send_all(fd, head, 2000); n++)
        ;
    receive(fd, answer, sizeof(answer));
    assert_memory_equal(answer, "HTTP/1.1 431 ", 13);
    close(fd);
    free(head);
    assert_int_equal(ask("GET", "/healthz", "", NULL), 200);
}

/* Nothing sensible is answered with 400 or an end, and the server lives on. */
static void garbage(void **state)
{
    static const char *const texts[] = {
        "\r\n\r\n\r\n\r\n",
        "GET\r\n\r\n",
        "GET / HTTP/9.9\r\n\r\n",
        "\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
        "GET / HTTP/1.1\r\nHost localhost\r\n\r\n",
        "GET /healthz HTTP/1.1\r\n\r\n",
        "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
        "POST /api/v1/reload HTTP/1.1\r\nHost: localhost\r\nContent-Length: -1\r\n\r\n",
        "POST /api/v1/reload HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999999999999999\r\n\r\n",
        "POST /login HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n",
        "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n\xff\xfe\xfd garbage garbage\r\n\r\n",
        "GET * HTTP/1.1\r\nHost: localhost\r\n\r\n",
        "GET http://localhost/healthz HTTP/1.1\r\nHost: localhost\r\n\r\n",
    };
    uint64_t seed = 12345;
    char noise[4096];
    int fd;

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(texts); i++) {
        fd = connect_tcp();
        send_all(fd, texts[i], strlen(texts[i]));
        shutdown(fd, SHUT_WR);
        receive(fd, answer, sizeof(answer));
        assert_true(!answer[0] || !strncmp(answer, "HTTP/1.", 7));
        close(fd);
    }
    for (int i = 0; i < 50; i++) {
        for (size_t k = 0; k < sizeof(noise); k++)
            noise[k] = (char)sst_random_u64(&seed);
        memcpy(noise, "GET ", 4);
        fd = connect_tcp();
        send_all(fd, noise, sizeof(noise));
        shutdown(fd, SHUT_WR);
        receive(fd, answer, sizeof(answer));
        close(fd);
    }
    assert_int_equal(ask("GET", "/healthz", "", NULL), 200);
    assert_in_range(api_calls, 1,
                    2); /* of two that were asked rightly, before the garbage and now, if the first answer is old */
}

/* Send bytes on a connection of their own. @return status of the first answer; *more: there is another one */
static int exchange(const char *bytes, size_t size, bool *more)
{
    const int fd = connect_tcp();
    int status = 0;

    assert_true(send_all(fd, bytes, size));
    shutdown(fd, SHUT_WR);
    receive(fd, answer, sizeof(answer));
    close(fd);
    *more = strstr(answer + 1, "HTTP/1.1 200 ") != NULL;
    return sscanf(answer, "HTTP/1.%*d %d", &status) == 1 ? status : 0;
}

/* A message that another program might delimit otherwise is refused, and nothing after it is read as a request. */
static void unclear_requests_end(void **state)
{
    static const char next[] = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";
    static const struct {
        const char *line, *headers;
    } requests[] = {
        { "GET /healthz HTTP/1.1", "Host: localhost\r\nhost: localhost\r\n" },
        { "GET /healthz HTTP/1.1", "Host: localhost\r\nHost: another\r\n" },
        { "GET /healthz HTTP/1.1", "Host: localhost\r\nContent-Length: 0\r\nContent-Length: 0\r\n" },
        { "GET /healthz HTTP/1.1", "Host: localhost\r\nContent-Length: 0\r\nContent-Length: 1\r\n" },
        { "GET /healthz HTTP/1.1", "Host: localhost\r\nContent-Length : 0\r\n" },
        { "GET /healthz HTTP/1.1", "Host: localhost\r\nContent-Length: 0, 0\r\n" },
        { "GET /healthz HTTP/1.1", "Host: localhost\r\nContent-Length: +0\r\n" },
        { "GET /healthz HTTP/1.1", "Host: localhost\r\nContent-Length: 0\r\nTransfer-Encoding: chunked\r\n" },
        { "GET /healthz HTTP/1.1", "Host: localhost\r\nTransfer-Encoding: identity\r\n" },
        { "GET /healthz HTTP/1.1", "Host: localhost\r\nTransfer-Encoding: chunked\r\nTransfer-Encoding: chunked\r\n" },
        { "GET /healthz HTTP/1.1", "Host: localhost\r\nX Y: 1\r\n" },
        { "GET@ /healthz HTTP/1.1", "Host: localhost\r\n" }, /* "@" becomes a NUL */
        { "GET@/x /healthz HTTP/1.1", "Host: localhost\r\n" },
        { "GET /healthz@/x HTTP/1.1", "Host: localhost\r\n" },
    };
    char text[600];
    bool more;
    int n;

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(requests); i++) {
        n = snprintf(text, sizeof(text), "%s\r\n%s\r\n%s", requests[i].line, requests[i].headers, next);
        for (char *c = text; c < text + n; c++)
            *c = *c == '@' ? 0 : *c;
        if (exchange(text, (size_t)n, &more) != 400 || more)
            fail_msg("%s, %s: %s", requests[i].line, requests[i].headers, answer);
    }
    /* Unambiguous messages are not concerned. */
    n = snprintf(text, sizeof(text),
                 "GET /healthz?a=%%20b&c HTTP/1.1\r\nHost: localhost\r\nX-Any: a\tb\r\nX-Any: c\r\n\r\n%s", next);
    assert_int_equal(exchange(text, (size_t)n, &more), 200);
    assert_true(more);
    n = snprintf(text, sizeof(text),
                 "POST /api/v1/reload HTTP/1.1\r\nHost: localhost\r\n%s%sTransfer-Encoding: chunked\r\n\r\n"
                 "2\r\n{}\r\n0\r\n\r\n%s",
                 bearer(control), JSON, next);
    assert_int_equal(exchange(text, (size_t)n, &more), 200);
    assert_true(more);
}

/* Several requests in one packet are answered one after the other. */
static void requests_in_a_row(void **state)
{
    static const char two[] = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"
                              "GET /api/v1/status HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    const int fd = connect_tcp();

    (void)state;
    assert_true(send_all(fd, two, sizeof(two) - 1));
    receive(fd, answer, sizeof(answer));
    close(fd);
    assert_non_null(strstr(answer, " 200 OK"));
    assert_non_null(strstr(answer, " 401 "));
}

static void nothing_is_left(void **state)
{
    struct sst_http_config cfg = config();
    int descriptors, threads, left = 0, fd, fine = 0;

    (void)state;
    for (int i = 0; i < MANY; i++) {
        fd = connect_tcp();
        if (i % 3 == 0)
            send_all(fd, "GET /hea", 8);
        if (fd >= 0)
            close(fd);
    }
    /* connections that still wait to be accepted are before us in the queue; then they go */
    for (int i = 0; i < 1000 && ask("GET", "/healthz", "", NULL) != 200; i++)
        sleep_ms(10);
    assert_int_equal(wait_clients(0), 0);
    for (int i = 0; i < 100; i++) {
        fine += ask("GET", "/healthz", "", NULL) == 200;
        assert_true(wait_clients(0) == 0);
    }
    assert_int_equal(fine, 100);
    sst_http_close(server);
    server = NULL;
    descriptors = count_entries("/proc/self/fd");
    threads = count_entries("/proc/self/task");
    for (int i = 0; i < 100; i++) {
        serve(&cfg);
        fd = connect_tcp();
        if (i % 2)
            send_all(fd, "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n", 43);
        sst_http_close(server);
        server = NULL;
        close(fd);
    }
    for (int i = 0; i < DEADLINE_MS / 100 && (left = count_entries("/proc/self/fd")) > descriptors; i++)
        sleep_ms(100);
    assert_true(left <= descriptors);
    assert_true(count_entries("/proc/self/task") <= threads + 1); /* sanitizers have one of their own at times */
    assert_int_equal(access(in_folder("control.sock"), F_OK), -1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(slow_clients_go, make_server, end_service),
        cmocka_unit_test_setup_teardown(connections_are_limited, make_server, end_service),
        cmocka_unit_test_setup_teardown(beyond_the_limit_is_told, make_server, end_service),
        cmocka_unit_test_setup_teardown(headers_are_limited, make_server, end_service),
        cmocka_unit_test_setup_teardown(garbage, make_server, end_service),
        cmocka_unit_test_setup_teardown(unclear_requests_end, make_server, end_service),
        cmocka_unit_test_setup_teardown(requests_in_a_row, make_server, end_service),
        cmocka_unit_test_setup_teardown(nothing_is_left, make_server, end_service),
    };

    return http_tests(tests);
}
