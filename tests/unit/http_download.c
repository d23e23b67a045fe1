/* Downloads of stored data over HTTP: whole, in parts, and never a half as if it were whole. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
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

/* Bytes of the answer's body that equal the file from `first` on. */
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

    /* From the middle of a file that is larger than the buffers. */
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
    assert_int_equal(get("GET", "full.mkv", ""), 507);
    assert_non_null(strstr(answer, "no room to make full.mkv"));
    assert_int_equal(get("GET", "nothing.tar", "Range: bytes=0-1\r\n"), 404);
    /* The rules of access are the usual ones. */
    assert_int_equal(ask("GET", "/api/v1/download/picture.jpg", "Range: bytes=0-1\r\n", NULL), 401);
    assert_int_equal(ask("POST", "/api/v1/delete", with(bearer(view), JSON), "{\"name\":\"x\"}"), 403);
    assert_int_equal(ask("POST", "/api/v1/delete", with(bearer(control), JSON), "{\"name\":\"x\"}"), 200);
}

static void wait_until_closed(void)
{
    const int64_t until_ns = sst_clock_now_ns() + DEADLINE_MS * 1000000LL;

    while (fake_open && sst_clock_now_ns() < until_ns)
        sleep_ms(5);
    assert_int_equal(fake_open, 0);
}

/* A client that reads nothing, from now on. */
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

static void wait_for(atomic_int *count, int least)
{
    const int64_t until_ns = sst_clock_now_ns() + DEADLINE_MS * 1000000LL;

    while (*count < least && sst_clock_now_ns() < until_ns)
        sleep_ms(5);
    assert_true(*count >= least);
}

/* A client that leaves, or waits for a file that is still being made, holds up nothing. */
static void clients_that_leave_close_what_they_read(void **state)
{
    const struct sst_http_config cfg = config();
    int64_t start_ns;
    int fd[4], asked;

    (void)state;
    serve(&cfg);
    for (size_t i = 0; i < ARRAY_LEN(fd); i++) {
        fd[i] = stand("huge.mkv");
        assert_true(recv(fd[i], answer, 100, 0) > 0);
    }
    for (size_t i = 0; i < ARRAY_LEN(fd); i++)
        close(fd[i]);
    wait_until_closed();
    /* Asked for again and again, as long as the client waits. */
    asked = fake_asked;
    fd[0] = stand("made.mkv");
    wait_for(&fake_asked, asked + 10);
    close(fd[0]);
    do {
        asked = fake_asked;
        sleep_ms(500);
    } while (fake_asked != asked);
    fd[0] = stand("made.mkv");
    wait_for(&fake_asked, asked + 10);
    fd[1] = stand("huge.mkv");
    wait_for(&fake_open, 1);
    start_ns = sst_clock_now_ns();
    sst_http_close(server);
    server = NULL;
    assert_quick(start_ns, 5000000000);
    close(fd[0]);
    close(fd[1]);
    wait_until_closed();
}

/* Clients that read nothing cost a connection each; beyond the limit of downloads others come again later. */
static void there_is_a_limit_of_downloads(void **state)
{
    const struct sst_http_config cfg = config();
    int slow[SST_DOWNLOADS_MAX], code = 0;

    (void)state;
    serve(&cfg);
    for (size_t i = 0; i < ARRAY_LEN(slow); i++)
        slow[i] = stand("huge.mkv");
    wait_for(&fake_open, SST_DOWNLOADS_MAX);
    assert_int_equal(get("GET", "big.mkv", ""), 503);
    assert_string_equal(header("\r\nRetry-After: "), "5");
    close(slow[0]);
    for (int i = 0; i < 60000 && code != 206; i++)
        code = get("GET", "big.mkv", "Range: bytes=0-99999\r\n");
    assert_int_equal(code, 206);
    assert_int_equal(body(0), 100000);
    for (size_t i = 1; i < ARRAY_LEN(slow); i++)
        close(slow[i]);
    wait_until_closed();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ranges_are_read_as_the_rfc_says),
        cmocka_unit_test_setup_teardown(parts_are_parts_of_the_whole, make_service, end_service),
        cmocka_unit_test_setup_teardown(a_half_file_is_never_a_whole_one, make_service, end_service),
        cmocka_unit_test_setup_teardown(clients_that_leave_close_what_they_read, make_service, end_service),
        cmocka_unit_test_setup_teardown(there_is_a_limit_of_downloads, make_service, end_service),
    };

    signal(SIGPIPE, SIG_IGN);
    return http_tests(tests);
}
