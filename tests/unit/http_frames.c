/* WebSocket frames: messages however they arrive, and a code for each kind of frame that is not allowed. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "daemon/publish/publish_internal.h"
#include "tests/test.h"

/** A client's frame. @return its bytes */
static size_t frame(uint8_t *out, int first, const void *data, size_t bytes)
{
    static const uint8_t mask[4] = { 0xa5, 0x00, 0xff, 0x13 };

    out[0] = (uint8_t)first;
    out[1] = (uint8_t)(0x80 | bytes);
    memcpy(out + 2, mask, 4);
    for (size_t i = 0; i < bytes; i++)
        out[6 + i] = (uint8_t)(((const uint8_t *)data)[i] ^ mask[i % 4]);
    return 6 + bytes;
}

static int read_all(struct http_ws_reader *r, const uint8_t *data, size_t bytes, struct http_ws_message *out)
{
    size_t used = 0;
    const int done = http_ws_read(r, data, bytes, &used, out);

    assert_in_range(used, 0, bytes);
    if (!done)
        assert_int_equal(used, bytes);
    return done;
}

static void a_message_arrives_in_pieces(void **state)
{
    struct http_ws_reader r = { 0 };
    struct http_ws_message m;
    uint8_t data[400];
    size_t n = 0;
    int got = 0;

    (void)state;
    n += frame(data + n, 0x01, "k", 1);  /* text, begun */
    n += frame(data + n, 0x89, "hi", 2); /* a ping between its frames */
    n += frame(data + n, 0x00, "e", 1);
    n += frame(data + n, 0x80, "y", 1);
    n += frame(data + n, 0x8a, "", 0);
    for (size_t at = 0; at < n; at++) {
        const int done = read_all(&r, data + at, 1, &m);

        assert_true(done >= 0);
        if (!done)
            continue;
        if (got == 0)
            assert_true(m.op == HTTP_WS_PING && m.bytes == 2 && !memcmp(m.data, "hi", 2));
        if (got == 1)
            assert_true(m.op == HTTP_WS_TEXT && m.bytes == 3 && !memcmp(m.data, "key", 3));
        if (got == 2)
            assert_true(m.op == HTTP_WS_PONG && m.bytes == 0);
        got++;
    }
    assert_int_equal(got, 3);
}

static void several_arrive_at_once(void **state)
{
    struct http_ws_reader r = { 0 };
    struct http_ws_message m;
    uint8_t data[400], long_text[HTTP_WS_MAX];
    size_t n = 0, used, at = 0;

    (void)state;
    memset(long_text, 'x', sizeof(long_text));
    n += frame(data + n, 0x81, long_text, sizeof(long_text));
    n += frame(data + n, 0x88, "\x03\xe8z", 3);
    assert_int_equal(http_ws_read(&r, data, n, &used, &m), 1);
    assert_true(m.op == HTTP_WS_TEXT && m.bytes == HTTP_WS_MAX);
    at += used;
    assert_int_equal(http_ws_read(&r, data + at, n - at, &used, &m), 1);
    assert_true(m.op == HTTP_WS_CLOSE && m.bytes == 3);
    assert_int_equal(at + used, n);
}

static void what_is_not_allowed_has_a_code(void **state)
{
    static const struct {
        const char *what;
        uint8_t bytes[12];
        size_t count;
        int code;
    } cases[] = {
        { "no mask", { 0x81, 0x01, 'x' }, 3, 1002 },
        { "reserved bit 1", { 0xc1, 0x80 }, 2, 1002 },
        { "reserved bit 2", { 0xa1, 0x80 }, 2, 1002 },
        { "reserved bit 3", { 0x91, 0x80 }, 2, 1002 },
        { "reserved data opcode", { 0x83, 0x80 }, 2, 1002 },
        { "reserved control opcode", { 0x8b, 0x80 }, 2, 1002 },
        { "a ping in pieces", { 0x09, 0x80 }, 2, 1002 },
        { "a long ping", { 0x89, 0xfe }, 2, 1002 },
        { "a continuation of nothing", { 0x80, 0x80 }, 2, 1002 },
        { "binary", { 0x82, 0x80 }, 2, 1003 },
        { "126 bytes or more", { 0x81, 0xfe }, 2, 1009 },
        { "65536 bytes or more", { 0x81, 0xff }, 2, 1009 },
        { "text in text", { 0x01, 0x80, 0, 0, 0, 0, 0x81, 0x80 }, 8, 1002 },
        { "text that is not UTF-8", { 0x81, 0x81, 0, 0, 0, 0, 0xff }, 7, 1007 },
        { "a close of one byte", { 0x88, 0x81, 0, 0, 0, 0, 3 }, 7, 1002 },
        { "a close with code 999", { 0x88, 0x82, 0, 0, 0, 0, 0x03, 0xe7 }, 8, 1002 },
        { "a close with code 1005", { 0x88, 0x82, 0, 0, 0, 0, 0x03, 0xed }, 8, 1002 },
        { "a close with code 5000", { 0x88, 0x82, 0, 0, 0, 0, 0x13, 0x88 }, 8, 1002 },
        { "a reason that is not UTF-8", { 0x88, 0x83, 0, 0, 0, 0, 0x03, 0xe8, 0xc0 }, 9, 1007 },
    };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        struct http_ws_reader r = { 0 };
        struct http_ws_message m;
        size_t used;
        int done = http_ws_read(&r, cases[i].bytes, cases[i].count, &used, &m);

        if (done != -cases[i].code)
            fail_msg("%s: %d", cases[i].what, done);
    }
}

/* Fragments add up to the same limit as one frame. */
static void pieces_are_limited_together(void **state)
{
    struct http_ws_reader r = { 0 };
    struct http_ws_message m;
    uint8_t data[64];
    int done = 0, frames = 0;

    (void)state;
    for (; !done && frames < 100; frames++)
        done = read_all(&r, data, frame(data, frames ? 0x00 : 0x01, "0123456789", 10), &m);
    assert_int_equal(done, -HTTP_WS_TOO_BIG);
    assert_int_equal(frames, HTTP_WS_MAX / 10 + 1);
}

static void heads_have_the_shortest_length(void **state)
{
    uint8_t head[HTTP_WS_HEAD];

    (void)state;
    assert_int_equal(http_ws_head(head, HTTP_WS_PING, 125), 2);
    assert_memory_equal(head, "\x89\x7d", 2);
    assert_int_equal(http_ws_head(head, HTTP_WS_BINARY, 126), 4);
    assert_memory_equal(head, "\x82\x7e\x00\x7e", 4);
    assert_int_equal(http_ws_head(head, HTTP_WS_BINARY, 65536), 10);
    assert_memory_equal(head, "\x82\x7f\0\0\0\0\0\1\0\0", 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_message_arrives_in_pieces),
        cmocka_unit_test(several_arrive_at_once),
        cmocka_unit_test(what_is_not_allowed_has_a_code),
        cmocka_unit_test(pieces_are_limited_together),
        cmocka_unit_test(heads_have_the_shortest_length),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
