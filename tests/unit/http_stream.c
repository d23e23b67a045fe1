/* Pictures and events over HTTP: each viewer gets as many as it has time for, and no viewer waits for another. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/http_fake.h"
#include "tests/quick.h"

#include <pthread.h>
#include <sys/resource.h>

#define VIEWERS 10

static int make_server(void **state)
{
    const struct sst_http_config cfg = config();

    if (make_service(state))
        return -1;
    serve(&(struct sst_http_config){ .socket = config().socket,
                                     .socket_fd = -1,
                                     .address = "127.0.0.1",
                                     .token_file = config().token_file,
                                     .clients = cfg.clients,
                                     .streams = VIEWERS,
                                     .api = &fake,
                                     .counters = &fake_counters });
    return 0;
}

static int get(const char *target, const char *more)
{
    const int fd = connect_tcp();
    char text[600];

    assert_true(fd >= 0);
    snprintf(text, sizeof(text), "GET %s HTTP/1.1\r\nHost: localhost\r\n%s%s\r\n", target, bearer(view), more);
    assert_true(send_all(fd, text, strlen(text)));
    return fd;
}

/* A line without its end. @return false: over */
static bool read_line(FILE *f, char *out, size_t size)
{
    if (!fgets(out, (int)size, f))
        return false;
    out[strcspn(out, "\r\n")] = 0;
    return true;
}

/* Of the answer's or a part's headers: one's value, and whether they ended. */
static bool read_headers(FILE *f, const char *name, char *value, size_t size)
{
    const size_t n = strlen(name);
    char line[600];

    while (read_line(f, line, sizeof(line))) {
        if (!line[0])
            return true;
        if (!strncasecmp(line, name, n) && line[n] == ':')
            snprintf(value, size, "%s", line + n + 1 + strspn(line + n + 1, " "));
    }
    return false;
}

/* The next part of a stream. @return its number, from its first byte; -1: over */
static int read_picture(FILE *f, bool first)
{
    char line[600], length[32] = "";
    size_t bytes;
    uint8_t *data;
    int number;

    if (first && (!read_line(f, line, sizeof(line)) || strcmp(line, "--sst-picture")))
        return -1;
    if (!read_headers(f, "Content-Length", length, sizeof(length)) || !length[0])
        return -1;
    bytes = strtoul(length, NULL, 10);
    assert_in_range(bytes, 1, 1 << 20);
    data = malloc(bytes);
    if (fread(data, 1, bytes, f) != bytes) {
        free(data);
        return -1;
    }
    number = data[0];
    for (size_t i = 1; i < bytes; i++)
        assert_int_equal(data[i], number);
    free(data);
    assert_true(read_line(f, line, sizeof(line)) && !line[0]);
    assert_true(read_line(f, line, sizeof(line)) && !strcmp(line, "--sst-picture"));
    return number;
}

static FILE *open_stream(const char *target, char *type, size_t size)
{
    const int fd = get(target, "");
    FILE *f = fdopen(fd, "r");
    char line[200];

    assert_non_null(f);
    assert_true(read_line(f, line, sizeof(line)));
    assert_string_equal(line, "HTTP/1.1 200 OK");
    assert_true(read_headers(f, "Content-Type", type, size));
    return f;
}

static void wait_viewers(int wanted)
{
    for (int i = 0; i < DEADLINE_MS / 10 && sst_slot_clients(fake_outlet) != wanted; i++)
        sleep_ms(10);
    assert_int_equal(sst_slot_clients(fake_outlet), wanted);
}

struct viewer {
    pthread_t thread;
    atomic_int got;
    int wanted, gaps;
    int64_t worst_ns; /* from showing a picture to having it */
    bool late;        /* it was more than 5 s, and not for the machine's sake */
};

static atomic_llong shown_ns[256];

static void *watch(void *arg)
{
    struct viewer *v = arg;
    char type[100] = "";
    FILE *f = open_stream("/stream", type, sizeof(type));
    int last = 0, number;
    int64_t late;

    assert_string_equal(type, "multipart/x-mixed-replace; boundary=sst-picture");
    while (v->got < v->wanted && (number = read_picture(f, !v->got)) >= 0) {
        if (number == last && sst_clock_now_ns() - shown_ns[number] > 5000000000)
            continue; /* the next one is late: others have to be waited for */
        v->late |= !quick_enough(shown_ns[number], 5000000000);
        late = sst_clock_now_ns() - shown_ns[number];
        v->worst_ns = late > v->worst_ns ? late : v->worst_ns;
        v->gaps += last && number != last + 1;
        last = number;
        v->got++;
    }
    fclose(f);
    return NULL;
}

static void wait_got(struct viewer *v, int wanted)
{
    const int64_t end_ns = sst_clock_now_ns() + DEADLINE_MS * 1000000LL;

    for (int i = 0; i < VIEWERS - 1; i++) {
        while (v[i].got < wanted) {
            if (sst_clock_now_ns() > end_ns)
                fail_msg("viewer %d has %d of %d pictures", i, v[i].got, wanted);
            sleep_ms(1);
        }
    }
}

/* Nine get every picture while the tenth takes none; one more is refused. The cost is printed. */
static void nobody_waits_for_a_slow_one(void **state)
{
    struct viewer v[VIEWERS - 1] = { 0 };
    int64_t cpu_ns, worst_ns = 0;
    const int slow = get("/stream", "");

    (void)state;
    wait_viewers(1);
    for (int i = 0; i < VIEWERS - 1; i++) {
        v[i].wanted = 30;
        assert_int_equal(pthread_create(&v[i].thread, NULL, watch, &v[i]), 0);
    }
    wait_viewers(VIEWERS);
    assert_int_equal(ask("GET", "/stream", bearer(view), NULL), 503);
    assert_non_null(strstr(answer, "web.streams"));
    cpu_ns = sst_clock_cpu_ns();
    for (int n = 1; n <= 30; n++) {
        shown_ns[n] = sst_clock_now_ns();
        show((uint64_t)n, 200000);
        wait_got(v, n);
    }
    print_message("CPU of server and clients together: %.1f ms for %d pictures\n",
                  (double)(sst_clock_cpu_ns() - cpu_ns) / 1e6, 30 * (VIEWERS - 1));
    for (int i = 0; i < VIEWERS - 1; i++) {
        pthread_join(v[i].thread, NULL);
        assert_int_equal(v[i].got, 30);
        assert_int_equal(v[i].gaps, 0);
        assert_false(v[i].late);
        worst_ns = v[i].worst_ns > worst_ns ? v[i].worst_ns : worst_ns;
    }
    print_message("a picture was with its viewer after %.1f ms at most\n", (double)worst_ns / 1e6);
    close(slow);
    wait_viewers(0);
}

static void skipped_pictures_are_counted(void **state)
{
    FILE *f;
    char type[100] = "";
    int first = 0, last = 0, number = 0, got = 0;

    (void)state;
    f = open_stream("/stream", type, sizeof(type));
    wait_viewers(1);
    for (int n = 1; n <= 60; n++) {
        show((uint64_t)n, 400000);
        sleep_ms(10);
    }
    while (number != 60) {
        number = read_picture(f, !got);
        assert_true(number > last);
        first = first ? first : number;
        last = number;
        got++;
    }
    fclose(f);
    assert_true(got < 40);
    assert_int_equal(fake_counters.skipped + (uint64_t)got, 60 - first + 1);
}

/* A hundred pictures a second to a viewer that wants ten of them. @return number missed because it was slow */
static uint64_t watch_at_10_hz(void)
{
    struct sst_http_config cfg = config();
    FILE *f;
    char type[100] = "";
    int last = 0, number = 0, got = 0, most;
    int64_t start_ns;

    sst_http_close(server);
    sst_slot_unref(fake_outlet);
    assert_int_equal(sst_slot_create(&fake_outlet), 0);
    cfg.stream_hz = 10;
    serve(&cfg);
    f = open_stream("/stream", type, sizeof(type));
    wait_viewers(1);
    start_ns = sst_clock_now_ns();
    /* On a busy machine longer, until he was sent some: that many are less than a stream's first ten. */
    for (int n = 1; n <= 100 || (n <= 250 && fake_counters.bytes < 5000); n++) {
        show((uint64_t)n, 1000);
        sleep_ms(10);
    }
    most = (int)((sst_clock_now_ns() - start_ns) / 100000000) + 3; /* a busy machine shows them more slowly */
    sst_slot_shut(fake_outlet);
    while ((number = read_picture(f, !got)) >= 0) {
        assert_true(number > last);
        last = number;
        got++;
    }
    assert_in_range(got, 4, most);
    fclose(f);
    return fake_counters.skipped;
}

/* Nobody was slow, unless the server's thread had to wait for a processor: then again. */
static void rate_is_limited(void **state)
{
    uint64_t skipped = 1;

    (void)state;
    for (int i = 0; i < 20 && skipped; i++)
        skipped = watch_at_10_hz();
    assert_int_equal(skipped, 0);
}

static void still_picture_is_repeated(void **state)
{
    char type[100] = "";
    FILE *f;
    int64_t before_ns, start_ns;

    (void)state;
    show(7, 1000);
    before_ns = sst_clock_now_ns(); /* the first may be here long before it is looked at */
    f = open_stream("/stream/labels", type, sizeof(type));
    assert_int_equal(read_picture(f, true), 7);
    start_ns = sst_clock_now_ns();
    assert_int_equal(read_picture(f, false), 7);
    assert_true(sst_clock_now_ns() - before_ns > 4000000000);
    assert_quick(start_ns, 8000000000);
    fclose(f);
    wait_viewers(0);
}

static void snapshots(void **state)
{
    (void)state;
    assert_int_equal(ask("GET", "/snapshot", bearer(view), NULL), 503); /* after waiting for one */
    show(3, 5000);
    assert_int_equal(ask("GET", "/snapshot/camera/r0c0", bearer(view), NULL), 200);
    assert_non_null(strcasestr(answer, "Content-Type: image/jpeg\r\n"));
    assert_non_null(strcasestr(answer, "Content-Length: 5000\r\n"));
    assert_non_null(strcasestr(answer, "X-Sst-Set: 3\r\n"));
    assert_int_equal(strlen(strstr(answer, "\r\n\r\n") + 4), 5000);
    assert_int_equal(ask("HEAD", "/snapshot", bearer(view), NULL), 200);
    assert_non_null(strcasestr(answer, "Content-Length: 5000\r\n"));
    assert_int_equal(strlen(strstr(answer, "\r\n\r\n") + 4), 0);
    assert_int_equal(ask("HEAD", "/stream", bearer(view), NULL), 200);
    assert_int_equal(ask("HEAD", "/api/v1/events/stream", bearer(view), NULL), 200);
    assert_string_equal(strstr(answer, "\r\n\r\n"), "\r\n\r\n"); /* a body would begin the next answer */
    wait_viewers(0);
}

static void emit(const char *what)
{
    sst_events_emit(fake.events, SST_EVENT_INFO, "state", json_pack("{s:s}", "state", what), "now %s", what);
}

/* Does a text have the event with this id? */
static bool has_id(const char *text, int id)
{
    char member[2][24];

    snprintf(member[0], sizeof(member[0]), "\"id\":%d,", id);
    snprintf(member[1], sizeof(member[1]), "\"id\":%d}", id);
    return strstr(text, member[0]) || strstr(text, member[1]);
}

static void kept_events(void **state)
{
    (void)state;
    for (int i = 0; i < 5; i++)
        emit("capturing");
    assert_int_equal(ask("GET", "/api/v1/events", bearer(view), NULL), 200);
    assert_non_null(strcasestr(answer, "Content-Type: application/x-ndjson"));
    assert_true(has_id(answer, 1));
    assert_true(has_id(answer, 5));
    assert_int_equal(ask("GET", "/api/v1/events?after=2&limit=2", bearer(view), NULL), 200);
    assert_false(has_id(answer, 2));
    assert_true(has_id(answer, 4));
    assert_false(has_id(answer, 5));
    assert_int_equal(ask("GET", "/api/v1/events?limit=2", bearer(view), NULL), 200);
    assert_false(has_id(answer, 3));
    assert_true(has_id(answer, 5));
    assert_int_equal(ask("GET", "/api/v1/events?limit=x", bearer(view), NULL), 400);
    assert_int_equal(ask("GET", "/api/v1/events?after=-1", bearer(view), NULL), 400);
    assert_int_equal(ask("GET", "/api/v1/events?limit=99999999999999999999999", bearer(view), NULL), 400);
}

/* Skip chunk sizes and blank lines. */
static void expect_line(FILE *f, const char *start, int id)
{
    char line[600];

    do
        assert_true(read_line(f, line, sizeof(line)));
    while (!line[0] || (strspn(line, "0123456789abcdefABCDEF") == strlen(line)) || !strcmp(line, ":"));
    if (strncmp(line, start, strlen(start)) || (id && !has_id(line, id)))
        fail_msg("\"%s\" does not start with %s or has not id %d", line, start, id);
}

static FILE *listen_to(const char *target, const char *more, const char *type)
{
    FILE *f = fdopen(get(target, more), "r");
    char got[100] = "";

    assert_non_null(f);
    assert_true(read_headers(f, "Content-Type", got, sizeof(got)));
    assert_string_equal(got, type);
    return f;
}

static void events_as_they_come(void **state)
{
    FILE *sse, *lines, *again, *restarted;

    (void)state;
    emit("armed");
    sse = listen_to("/api/v1/events/stream", "", "text/event-stream");
    lines = listen_to("/api/v1/events/stream?after=0", "Accept: application/x-ndjson\r\n", "application/x-ndjson");
    expect_line(lines, "{", 1);
    emit("capturing");
    expect_line(sse, "id: 2", 0);
    expect_line(sse, "data: {", 2);
    expect_line(lines, "{", 2);
    again = listen_to("/api/v1/events/stream", "Last-Event-ID: 1\r\n", "text/event-stream");
    expect_line(again, "id: 2", 0);
    restarted = listen_to("/api/v1/events/stream", "Last-Event-ID: 700\r\n", "text/event-stream");
    expect_line(restarted, "id: 1", 0);
    assert_int_equal(fake_counters.listeners, 4);
    fclose(sse);
    fclose(lines);
    fclose(again);
    fclose(restarted);
    for (int i = 0; i < DEADLINE_MS / 10 && fake_counters.listeners; i++)
        sleep_ms(10);
    assert_int_equal(fake_counters.listeners, 0);
}

static void *close_it(void *arg)
{
    sst_http_close(server);
    server = NULL;
    *(int64_t *)arg = sst_clock_now_ns();
    return NULL;
}

/* Whoever hangs where: streams that wait, streams that are not read, listeners, a call that takes its second. */
static void closes_within_a_second(void **state)
{
    int fds[12];
    int64_t start_ns, end_ns = 0;
    pthread_t t;

    (void)state;
    show(1, 1000);
    api_sleep_ms = 700;
    for (int i = 0; i < 4; i++)
        fds[i] = get("/stream", "");
    for (int i = 4; i < 8; i++)
        fds[i] = get("/api/v1/events/stream", "");
    for (int i = 8; i < 11; i++)
        fds[i] = get("/api/v1/status", "");
    fds[11] = connect_tcp();
    wait_viewers(4);
    for (int n = 2; n < 20; n++)
        show((uint64_t)n, 1000000);
    start_ns = sst_clock_now_ns();
    assert_int_equal(pthread_create(&t, NULL, close_it, &end_ns), 0);
    pthread_join(t, NULL);
    print_message("closed after %lld ms\n", (long long)(end_ns - start_ns) / 1000000);
    assert_quick(start_ns, 2000000000);
    for (int i = 0; i < 12; i++)
        close(fds[i]);
    assert_int_equal(sst_slot_clients(fake_outlet), 0);
}

static int make_impatient_server(void **state)
{
    struct sst_http_config cfg;

    if (make_service(state))
        return -1;
    cfg = config();
    cfg.idle_s = 1; /* 2 for streams */
    serve(&cfg);
    return 0;
}

/* The time for which the service makes a client wait is not the client's silence: it gets the next events afterwards.
 */
static void who_waits_is_served(void **state)
{
    char type[100];
    FILE *f, *again;

    (void)state;
    fake_plays = true;
    f = open_stream("/stream", type, sizeof(type));
    again = open_stream("/replay/stream", type, sizeof(type));
    wait_viewers(2);
    api_sleep_ms = 2600;
    assert_int_equal(ask("GET", "/api/v1/status", bearer(view), NULL), 200);
    api_sleep_ms = 0;
    assert_int_equal(sst_slot_clients(fake_outlet), 2);
    show(7, 1000);
    assert_int_equal(read_picture(f, true), 7);
    assert_int_equal(read_picture(again, true), 7);
    fclose(f);
    fclose(again);
    fake_plays = false;
    wait_viewers(0); /* a closed connection is noticed, also while nothing is sent */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(nobody_waits_for_a_slow_one, make_server, end_service),
        cmocka_unit_test_setup_teardown(skipped_pictures_are_counted, make_server, end_service),
        cmocka_unit_test_setup_teardown(rate_is_limited, make_server, end_service),
        cmocka_unit_test_setup_teardown(still_picture_is_repeated, make_server, end_service),
        cmocka_unit_test_setup_teardown(who_waits_is_served, make_impatient_server, end_service),
        cmocka_unit_test_setup_teardown(snapshots, make_server, end_service),
        cmocka_unit_test_setup_teardown(kept_events, make_server, end_service),
        cmocka_unit_test_setup_teardown(events_as_they_come, make_server, end_service),
        cmocka_unit_test_setup_teardown(closes_within_a_second, make_server, end_service),
    };

    return http_tests(tests);
}
