/* H.264 over WebSocket: pictures of all samplings for all viewers, damaged ones, ends, and counts afterwards. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/http_fake.h"

#include "pipeline/image/codec.h"

#define WIDTH  160
#define HEIGHT 96

struct watcher {
    int fd;
    uint8_t data[1 << 18]; /* payload of the last frame */
    size_t bytes;
};

static struct watcher one, other;
static uint64_t shown;

static int make_server(void **state)
{
    struct sst_http_config cfg;

    shown = 0;
    if (make_service(state))
        return -1;
    cfg = config();
    serve(&cfg);
    return 0;
}

static void show_jpeg(int width, int height, enum sst_jpeg_chroma chroma)
{
    struct sst_image image;
    uint8_t *data;
    size_t bytes;

    assert_int_equal(sst_image_init(&image, width, height), 0);
    for (int c = 0; c < 3; c++)
        for (int y = 0; y < height; y++)
            memset(image.plane[c] + (size_t)y * image.stride, (int)(40 + 10 * shown + (uint64_t)(20 * c + y) % 90), (size_t)width);
    assert_int_equal(sst_image_encode_jpeg_as(&image, 90, chroma, &data, &bytes), 0);
    sst_image_fini(&image);
    assert_int_equal(sst_slot_put(fake_outlet, data, bytes, ++shown, sst_clock_now_ns(), sst_clock_wall_ns()), 0);
}

static void read_bytes(int fd, void *to, size_t n)
{
    for (size_t at = 0; at < n;) {
        const ssize_t got = recv(fd, (uint8_t *)to + at, n - at, 0);

        assert_true(got > 0 || (got < 0 && errno == EINTR)); /* the process was stopped */
        at += got > 0 ? (size_t)got : 0;
    }
}

static void watch(struct watcher *w, const char *target)
{
    const struct timeval patience = { .tv_sec = DEADLINE_MS / 1000 };
    char text[800], last[4] = "";

    w->fd = connect_tcp();
    assert_true(w->fd >= 0);
    (void)setsockopt(w->fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    snprintf(text, sizeof(text),
             "GET %s HTTP/1.1\r\nHost: localhost\r\n%sUpgrade: websocket\r\nConnection: Upgrade\r\n"
             "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n",
             target, bearer(view));
    assert_true(send_all(w->fd, text, strlen(text)));
    memset(text, 0, sizeof(text));
    for (size_t n = 0; memcmp(last, "\r\n\r\n", 4) && n < sizeof(text) - 1; n++) {
        read_bytes(w->fd, text + n, 1);
        memmove(last, last + 1, 3);
        last[3] = text[n];
    }
    assert_non_null(strstr(text, "HTTP/1.1 101"));
    assert_non_null(strstr(text, "Sec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=")); /* RFC 6455, 1.3 */
}

/* The next frame; pings are answered. @return its opcode */
static int read_frame(struct watcher *w)
{
    static const uint8_t no_mask[4];
    uint8_t head[10];

    for (;;) {
        size_t more = 0;

        read_bytes(w->fd, head, 2);
        w->bytes = head[1];
        more = head[1] == 126 ? 2 : head[1] == 127 ? 8 : 0;
        read_bytes(w->fd, head + 2, more);
        for (size_t i = 0; i < more; i++)
            w->bytes = (i ? w->bytes << 8 : 0) | head[2 + i];
        assert_true(w->bytes < sizeof(w->data));
        read_bytes(w->fd, w->data, w->bytes);
        w->data[w->bytes] = 0;
        if ((head[0] & 15) != 9)
            return head[0] & 15;
        head[0] = 0x8a;
        head[1] = (uint8_t)(0x80 | w->bytes);
        assert_true(send_all(w->fd, (char *)head, 2) && send_all(w->fd, (const char *)no_mask, 4) &&
                    send_all(w->fd, (char *)w->data, w->bytes));
    }
}

/* The picture of set `set`, which was shown last. @return it is a key picture */
static bool read_picture(struct watcher *w, uint64_t set)
{
    int op = read_frame(w);

    while (op == 1 || (op == 2 && w->data[15] < set)) /* descriptions, and the picture before once more for a new viewer */
        op = read_frame(w);
    assert_int_equal(op, 2);
    assert_int_equal(w->data[15], set);
    assert_true(w->bytes > 24 && !memcmp(w->data + 20, "\0\0\0\1", 4));
    return w->data[19] & 1;
}

static int close_code(struct watcher *w)
{
    int op;

    while ((op = read_frame(w)) != 8)
        assert_true(op == 1 || op == 2);
    return w->data[0] << 8 | w->data[1];
}

static void wait_none(void)
{
    for (int i = 0; i < DEADLINE_MS / 10 && (fake_counters.streams || sst_slot_clients(fake_outlet)); i++)
        nanosleep(&(struct timespec){ .tv_nsec = 10000000 }, NULL);
    assert_int_equal(fake_counters.streams, 0);
    assert_int_equal(fake_counters.videos, 0);
    assert_int_equal(sst_slot_clients(fake_outlet), 0);
}

/* Without an encoder a viewer is closed with the reason. */
static bool has_encoder(void)
{
    bool has;

    show_jpeg(WIDTH, HEIGHT, SST_JPEG_420);
    watch(&one, "/video");
    has = read_frame(&one) == 1;
    if (!has)
        assert_int_equal(one.data[0] << 8 | one.data[1], 4501);
    close(one.fd);
    wait_none();
    return has;
}

static void all_viewers_get_all_samplings(void **state)
{
    static const enum sst_jpeg_chroma chromas[] = { SST_JPEG_420, SST_JPEG_422, SST_JPEG_444, SST_JPEG_GREY };
    char encoder[16];

    (void)state;
    if (!has_encoder())
        skip();
    watch(&one, "/video/v1");
    assert_true(read_picture(&one, shown));
    fake_plays = true;
    watch(&other, "/replay/video/v1"); /* of a recording */
    fake_plays = false;
    assert_true(read_picture(&other, shown));
    close(other.fd);
    watch(&other, "/video/camera/r0c0");
    assert_true(read_picture(&other, shown));
    for (int i = 0; i < DEADLINE_MS / 10 && fake_counters.videos != 2; i++) /* the one before is on its way out */
        nanosleep(&(struct timespec){ .tv_nsec = 10000000 }, NULL);
    assert_int_equal(fake_counters.videos, 2);
    sst_counters_encoder(&fake_counters, encoder);
    assert_true(encoder[0]);
    for (size_t i = 0; i < 8; i++) {
        show_jpeg(WIDTH, HEIGHT, chromas[i % 4]);
        (void)read_picture(&one, shown);
        (void)read_picture(&other, shown);
    }
    show_jpeg(WIDTH / 2 + 1, HEIGHT + 1, SST_JPEG_420); /* even from then on */
    assert_true(read_picture(&one, shown));
    assert_true(read_picture(&other, shown));
    close(one.fd);
    close(other.fd);
    wait_none();
}

static void damaged_pictures_are_left_out(void **state)
{
    (void)state;
    if (!has_encoder())
        skip();
    watch(&one, "/video");
    (void)read_picture(&one, shown);
    show(++shown, 1000); /* no JPEG */
    show_jpeg(WIDTH, HEIGHT, SST_JPEG_420);
    (void)read_picture(&one, shown);
    show_jpeg(16, 16, SST_JPEG_420);
    assert_int_equal(close_code(&one), 4501);
    assert_non_null(strstr((char *)one.data + 2, "16 x 16"));
    close(one.fd);
    wait_none();
}

static void ends_are_announced(void **state)
{
    (void)state;
    show_jpeg(WIDTH, HEIGHT, SST_JPEG_420);
    watch(&one, "/video/gone");
    assert_int_equal(close_code(&one), 4404);
    assert_non_null(strstr((char *)one.data + 2, "no view gone"));
    close(one.fd);
    wait_none();
    if (!has_encoder())
        skip();
    watch(&one, "/video");
    (void)read_picture(&one, shown);
    sst_slot_shut(fake_outlet);
    assert_int_equal(close_code(&one), 1001);
    close(one.fd);
    wait_none();
}

/* The server is closed while somebody watches, and others are in the middle of it. */
static void the_server_ends_first(void **state)
{
    (void)state;
    show_jpeg(WIDTH, HEIGHT, SST_JPEG_420);
    watch(&one, "/video");
    watch(&other, "/video");
    sst_http_close(server);
    server = NULL;
    assert_int_equal(fake_counters.streams, 0);
    assert_int_equal(sst_slot_clients(fake_outlet), 0);
    close(one.fd);
    close(other.fd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(all_viewers_get_all_samplings, make_server, end_service),
        cmocka_unit_test_setup_teardown(damaged_pictures_are_left_out, make_server, end_service),
        cmocka_unit_test_setup_teardown(ends_are_announced, make_server, end_service),
        cmocka_unit_test_setup_teardown(the_server_ends_first, make_server, end_service),
    };

    return http_tests(tests);
}
