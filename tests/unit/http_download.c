/* What is kept, over HTTP: whole, in parts, and never a half as if it were whole. */
#include "tests/http_fake.h"
#include "tests/quick.h"

#include "daemon/publish/publish_internal.h"

static void ranges_are_read_as_the_rfc_says(void **state)
{
    static const struct {
        const char *text;
        uint64_t size;
        enum http_range want;
        uint64_t first, bytes;
    } cases[] = {
        { NULL, 10, HTTP_RANGE_WHOLE, 0, 0 },
        { "bytes=0-0", 10, HTTP_RANGE_PART, 0, 1 },
        { "Bytes=2-5", 10, HTTP_RANGE_PART, 2, 4 },
        { "bytes= 2-5 ", 10, HTTP_RANGE_PART, 2, 4 },
        { "bytes=9-", 10, HTTP_RANGE_PART, 9, 1 },
        { "bytes=0-", 10, HTTP_RANGE_PART, 0, 10 },
        { "bytes=5-100", 10, HTTP_RANGE_PART, 5, 5 },
        { "bytes=-1", 10, HTTP_RANGE_PART, 9, 1 },
        { "bytes=-10", 10, HTTP_RANGE_PART, 0, 10 },
        { "bytes=-11", 10, HTTP_RANGE_PART, 0, 10 },
        { "bytes=10-", 10, HTTP_RANGE_BEYOND, 0, 0 },
        { "bytes=10-20", 10, HTTP_RANGE_BEYOND, 0, 0 },
        { "bytes=-0", 10, HTTP_RANGE_BEYOND, 0, 0 },
        { "bytes=5-3", 10, HTTP_RANGE_WHOLE, 0, 0 },
        { "bytes=0-1,3-4", 10, HTTP_RANGE_WHOLE, 0, 0 },
        { "bytes=0-0,-1", 10, HTTP_RANGE_WHOLE, 0, 0 },
        { "bytes=-", 10, HTTP_RANGE_WHOLE, 0, 0 },
        { "bytes=", 10, HTTP_RANGE_WHOLE, 0, 0 },
        { "bytes", 10, HTTP_RANGE_WHOLE, 0, 0 },
        { "", 10, HTTP_RANGE_WHOLE, 0, 0 },
        { "bytes=a-b", 10, HTTP_RANGE_WHOLE, 0, 0 },
        { "bytes=+1-2", 10, HTTP_RANGE_WHOLE, 0, 0 },
        { "bytes=--1", 10, HTTP_RANGE_WHOLE, 0, 0 },
        { "bytes=1-2x", 10, HTTP_RANGE_WHOLE, 0, 0 },
        { "bytes=0x1-2", 10, HTTP_RANGE_WHOLE, 0, 0 },
        { "items=0-1", 10, HTTP_RANGE_WHOLE, 0, 0 },
        /* numbers that do not fit are as large as any */
        { "bytes=0-18446744073709551615", 10, HTTP_RANGE_PART, 0, 10 },
        { "bytes=1-18446744073709551616", 10, HTTP_RANGE_PART, 1, 9 },
        { "bytes=1-99999999999999999999999999", 10, HTTP_RANGE_PART, 1, 9 },
        { "bytes=-99999999999999999999999999", 10, HTTP_RANGE_PART, 0, 10 },
        { "bytes=99999999999999999999999999-", 10, HTTP_RANGE_BEYOND, 0, 0 },
        { "bytes=18446744073709551616-18446744073709551617", 10, HTTP_RANGE_BEYOND, 0, 0 },
        { "bytes=18446744073709551615-", UINT64_MAX, HTTP_RANGE_BEYOND, 0, 0 },
        { "bytes=18446744073709551614-", UINT64_MAX, HTTP_RANGE_PART, UINT64_MAX - 1, 1 },
        /* an empty file */
        { "bytes=0-0", 0, HTTP_RANGE_BEYOND, 0, 0 },
        { "bytes=0-", 0, HTTP_RANGE_BEYOND, 0, 0 },
        { "bytes=-0", 0, HTTP_RANGE_BEYOND, 0, 0 },
        { "bytes=-5", 0, HTTP_RANGE_WHOLE, 0, 0 },
    };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        uint64_t first = 0, bytes = 0;
        const enum http_range got = http_range_parse(cases[i].text, cases[i].size, &first, &bytes);

        if (got != cases[i].want || first != cases[i].first || bytes != cases[i].bytes)
            fail_msg("%s of %llu: %d, %llu + %llu", cases[i].text, (unsigned long long)cases[i].size, (int)got,
                     (unsigned long long)first, (unsigned long long)bytes);
    }
    assert_true(http_if_range("\"a\"", "\"a\""));
    assert_false(http_if_range("W/\"a\"", "\"a\""));
    assert_false(http_if_range("\"a\", \"b\"", "\"a\""));
    assert_false(http_if_range("*", "\"a\""));
    assert_false(http_if_range("Sat, 21 Nov 2026 21:00:00 GMT", "\"a\""));
    assert_false(http_if_range("", ""));
}

/* A header of the answer's, into one of a few places; "": it has none. */
static const char *header(const char *name)
{
    static char out[256];
    const char *end = strstr(answer, "\r\n\r\n"), *at = strcasestr(answer, name);

    out[0] = 0;
    if (at && end && at < end)
        snprintf(out, sizeof(out), "%.*s", (int)strcspn(at + strlen(name), "\r"), at + strlen(name));
    return out;
}

/* Bytes of the answer's body that are those of the file from `first` on. */
static int64_t body(int64_t first)
{
    const char *at = strstr(answer, "\r\n\r\n");
    int64_t n = 0;

    while (at && n < strtoll(header("\r\nContent-Length: "), NULL, 10) && (uint8_t)at[4 + n] == fake_byte(first + n))
        n++;
    return n;
}

static int get(const char *method, const char *name, const char *more)
{
    char target[100];

    snprintf(target, sizeof(target), "/api/v1/download/%s", name);
    return ask(method, target, with(bearer(view), more), NULL);
}

static void parts_are_parts_of_the_whole(void **state)
{
    const struct sst_http_config cfg = config();

    (void)state;
    serve(&cfg);
    assert_int_equal(get("GET", "picture.jpg", ""), 200);
    assert_int_equal(body(0), 10);
    assert_string_equal(header("\r\nContent-Length: "), "10");
    assert_string_equal(header("\r\nAccept-Ranges: "), "bytes");
    assert_string_equal(header("\r\nETag: "), "\"00000000000000aa\"");
    assert_string_equal(header("\r\nContent-Disposition: "), "inline; filename=\"picture.jpg\"");
    assert_int_equal(get("GET", "picture.jpg", "Range: bytes=2-5\r\n"), 206);
    assert_int_equal(body(2), 4);
    assert_string_equal(header("\r\nContent-Length: "), "4");
    assert_string_equal(header("\r\nContent-Range: "), "bytes 2-5/10");
    assert_int_equal(get("GET", "picture.jpg", "Range: bytes=-3\r\nIf-Range: \"00000000000000aa\"\r\n"), 206);
    assert_int_equal(body(7), 3);
    assert_int_equal(get("GET", "picture.jpg", "Range: bytes=-3\r\nIf-Range: \"00000000000000ab\"\r\n"), 200);
    assert_int_equal(body(0), 10);
    assert_int_equal(get("GET", "picture.jpg", "Range: bytes=-3\r\nIf-Range: W/\"00000000000000aa\"\r\n"), 200);
    assert_int_equal(get("GET", "picture.jpg", "Range: bytes=0-1,4-5\r\n"), 200);
    assert_int_equal(body(0), 10);
    assert_int_equal(get("GET", "picture.jpg", "Range: bytes=10-\r\n"), 416);
    assert_string_equal(header("\r\nContent-Range: "), "bytes */10");
    assert_int_equal(get("GET", "picture.jpg", "If-None-Match: \"00000000000000aa\"\r\n"), 304);
    assert_int_equal(get("GET", "picture.jpg", "If-None-Match: \"00000000000000aa\"\r\nRange: bytes=0-1\r\n"), 304);

    /* From the middle of one that is larger than what is under way at a time. */
    assert_int_equal(get("GET", "big.mkv", "Range: bytes=2900000-2999999\r\n"), 206);
    assert_int_equal(body(2900000), 100000);
    assert_string_equal(header("\r\nContent-Range: "), "bytes 2900000-2999999/3000000");

    /* HEAD knows the length and no ranges (RFC 9110, 14.2). */
    assert_int_equal(get("HEAD", "big.mkv", "Range: bytes=0-1\r\n"), 200);
    assert_string_equal(header("\r\nContent-Length: "), "3000000");
    assert_null(strstr(strstr(answer, "\r\n\r\n") + 4, "x"));

    /* An empty file, one that still grows. */
    assert_int_equal(get("GET", "empty.mkv", ""), 200);
    assert_string_equal(header("\r\nContent-Length: "), "0");
    assert_int_equal(get("GET", "empty.mkv", "Range: bytes=0-\r\n"), 416);
    assert_string_equal(header("\r\nContent-Range: "), "bytes */0");
    assert_int_equal(get("HEAD", "empty.mkv", ""), 200);
    assert_int_equal(get("GET", "growing.mkv", "Range: bytes=5-9\r\nIf-None-Match: *\r\n"), 200);
    assert_int_equal(body(0), 1000);
    assert_string_equal(header("\r\nAccept-Ranges: "), "none");
    assert_string_equal(header("\r\nETag: "), "");
}

static void a_half_file_is_never_a_whole_one(void **state)
{
    const struct sst_http_config cfg = config();

    (void)state;
    serve(&cfg);
    assert_int_equal(get("GET", "short.mkv", ""), 200);
    assert_string_equal(header("\r\nContent-Length: "), "100000");
    assert_string_equal(header("\r\nTransfer-Encoding: "), "");
    assert_in_range(body(0), 1, 70000); /* the connection ends before its promise */
    assert_int_equal(get("GET", "gone.mkv", ""), 404);
    assert_non_null(strstr(answer, "\"error\""));
    assert_int_equal(get("GET", "torn.mkv", ""), 500);
    assert_int_equal(get("GET", "busy.tar", ""), 409);
    assert_non_null(strstr(answer, "still being written"));
    assert_int_equal(get("GET", "nothing.tar", "Range: bytes=0-1\r\n"), 404);
    /* The rules of access are those of everything else. */
    assert_int_equal(ask("GET", "/api/v1/download/picture.jpg", "Range: bytes=0-1\r\n", NULL), 401);
    assert_int_equal(ask("POST", "/api/v1/delete", with(bearer(view), JSON), "{\"name\":\"x\"}"), 403);
    assert_int_equal(ask("POST", "/api/v1/delete", with(bearer(control), JSON), "{\"name\":\"x\"}"), 200);
}

static void wait_for_senders(void)
{
    const int64_t until_ns = sst_clock_now_ns() + DEADLINE_MS * 1000000LL;

    while (fake_sending && sst_clock_now_ns() < until_ns)
        sleep_ms(5);
    assert_int_equal(fake_sending, 0);
}

/* Who leaves in the middle, or takes nothing, frees what he held; a disk that hangs holds up no ending. */
static void nobody_is_held_up(void **state)
{
    const struct sst_http_config cfg = config();
    int fd[4], silent;
    char text[512];
    int64_t start_ns;

    (void)state;
    serve(&cfg);
    snprintf(text, sizeof(text), "GET /api/v1/download/big.mkv HTTP/1.1\r\nHost: localhost\r\n%s\r\n", bearer(view));
    for (size_t i = 0; i < ARRAY_LEN(fd); i++) {
        fd[i] = connect_tcp();
        assert_true(send_all(fd[i], text, strlen(text)));
        assert_true(recv(fd[i], answer, 100, 0) > 0);
    }
    for (size_t i = 0; i < ARRAY_LEN(fd); i++)
        close(fd[i]);
    wait_for_senders();
    snprintf(text, sizeof(text), "GET /api/v1/download/silent.mkv HTTP/1.1\r\nHost: localhost\r\n%s\r\n", bearer(view));
    silent = connect_tcp();
    assert_true(send_all(silent, text, strlen(text)));
    while (!fake_sending)
        sleep_ms(5);
    start_ns = sst_clock_now_ns();
    sst_http_close(server);
    server = NULL;
    assert_quick(start_ns, 5000000000);
    close(silent);
    wait_for_senders();
}

#define S ((int64_t)1000000000)

static void a_pace_is_of_the_last_moments(void **state)
{
    struct http_pace p = { .early = { 0, 0 } };

    (void)state;
    assert_true(http_throughput(&p, 5 * S - 1, 1 << 30) < 0); /* too early to say */
    assert_true(http_throughput(&p, 5 * S, 0) == 0);
    assert_true(http_throughput(&p, 5 * S, 500000) == 100000);
    /* A burst at the beginning is forgotten in two windows. */
    for (int64_t i = 1; i <= 9; i++)
        http_throughput_mark(&p, i * S, 100000000);
    assert_true(http_throughput(&p, 9 * S, 100000000) > 1e7);
    for (int64_t i = 10; i <= 15; i++)
        http_throughput_mark(&p, i * S, 100000000 + (uint64_t)(i - 9) * 1000);
    assert_true(http_throughput(&p, 15 * S, 100006000) < 1001);
    /* Less in the socket's way than was thought is no pace below 0; a clock that stands (a disk is waited for) is none.
     */
    assert_true(http_throughput(&p, 15 * S, 5) == 0);
    p = (struct http_pace){ .early = { 0, 0 } };
    for (int i = 0; i < 100; i++)
        http_throughput_mark(&p, 3 * S, 10);
    assert_true(http_throughput(&p, 3 * S, 10) < 0);
}

/* One who takes nothing, from now on. */
static int stand(const char *name)
{
    const int small = 4096, fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    struct sockaddr_in at = { .sin_family = AF_INET, .sin_port = htons((uint16_t)sst_http_port(server)) };
    char text[512];

    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    assert_true(fd >= 0 && !setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &small, sizeof(small)));
    assert_int_equal(connect(fd, (struct sockaddr *)&at, sizeof(at)), 0);
    snprintf(text, sizeof(text), "GET /api/v1/download/%s HTTP/1.1\r\nHost: localhost\r\n%s\r\n", name, bearer(view));
    assert_true(send_all(fd, text, strlen(text)));
    return fd;
}

/* Twenty who take next to nothing do not shut out one who reads; and they do go on where nobody waits. */
static void slow_readers_make_room(void **state)
{
    const struct sst_http_config cfg = config();
    const int64_t until_ns = sst_clock_now_ns() + 3 * DEADLINE_MS * 1000000LL;
    struct sst_http_counters n;
    int slow[20], code = 0;

    (void)state;
    serve(&cfg);
    for (size_t i = 0; i < ARRAY_LEN(slow); i++)
        slow[i] = stand("huge.mkv");
    while (fake_sending < SST_DOWNLOADS_ADDRESS && sst_clock_now_ns() < until_ns)
        sleep_ms(5);
    assert_int_equal(fake_sending, SST_DOWNLOADS_ADDRESS); /* one address has no more */
    while (code != 200 && sst_clock_now_ns() < until_ns)
        code = get("GET", "big.mkv", "Range: bytes=0-99999\r\n") == 206 ? 200 : 503;
    assert_int_equal(code, 200);
    assert_int_equal(body(0), 100000);
    sst_http_counters(server, &n);
    assert_true(n.slow >= 1 && n.slow <= ARRAY_LEN(slow));
    assert_true(fake_sending >= SST_DOWNLOADS_ADDRESS / 2);
    for (size_t i = 0; i < ARRAY_LEN(slow); i++)
        close(slow[i]);
    wait_for_senders();
}

/* Who reads keeps his place, whoever waits. */
static void readers_keep_their_places(void **state)
{
    const struct sst_http_config cfg = config();
    struct sst_http_counters n;
    int fd[SST_DOWNLOADS_ADDRESS], waiting;
    int64_t until_ns;
    uint8_t *bytes = malloc(1 << 20);
    ssize_t got = 1;

    (void)state;
    assert_non_null(bytes);
    serve(&cfg);
    for (size_t i = 0; i < ARRAY_LEN(fd); i++)
        fd[i] = stand("huge.mkv");
    while (fake_sending < SST_DOWNLOADS_ADDRESS)
        sleep_ms(5);
    waiting = stand("picture.jpg");
    /* As long as it takes until the one who waits is told: he who stops to read is slow. */
    until_ns = sst_clock_now_ns() + DEADLINE_MS * 1000000LL;
    while (recv(waiting, bytes, 1, MSG_DONTWAIT | MSG_PEEK) < 0 && sst_clock_now_ns() < until_ns && got > 0) {
        for (size_t i = 0; i < ARRAY_LEN(fd) && got > 0; i++)
            got = recv(fd[i], bytes, 1 << 18, 0);
    }
    assert_true(got > 0);
    got = recv(waiting, bytes, 100, 0);
    assert_true(got > 12 && !memcmp(bytes + 9, "503", 3));
    sst_http_counters(server, &n);
    assert_int_equal(n.slow, 0);
    close(waiting);
    for (size_t i = 0; i < ARRAY_LEN(fd); i++)
        close(fd[i]);
    free(bytes);
    wait_for_senders();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ranges_are_read_as_the_rfc_says),
        cmocka_unit_test_setup_teardown(parts_are_parts_of_the_whole, make_service, end_service),
        cmocka_unit_test_setup_teardown(a_half_file_is_never_a_whole_one, make_service, end_service),
        cmocka_unit_test_setup_teardown(nobody_is_held_up, make_service, end_service),
        cmocka_unit_test(a_pace_is_of_the_last_moments),
        cmocka_unit_test_setup_teardown(slow_readers_make_room, make_service, end_service),
        cmocka_unit_test_setup_teardown(readers_keep_their_places, make_service, end_service),
    };

    signal(SIGPIPE, SIG_IGN);
    return http_tests(tests);
}
