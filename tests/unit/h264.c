/* H.264 encoder: pictures are decodable at once, key pictures on request, bytes within their limit, sizes checked. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/video/h264.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/test.h"

#if WITH_AVFORMAT

#include <libavcodec/avcodec.h>

#define WIDTH  320
#define HEIGHT 240
#define LIMIT  4000 /* bytes of a picture */

static uint8_t luma[WIDTH * HEIGHT], chroma[2][WIDTH * HEIGHT / 4];

/* A soft pattern with a square that walks. */
static struct sst_h264_picture picture(int number)
{
    const int left = 8 * number % (WIDTH - 64);

    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++)
            luma[y * WIDTH + x] = (uint8_t)(x >= left && x < left + 64 && y >= 64 && y < 128 ? 250 : x / 4 + y / 3);
    memset(chroma[0], 100, sizeof(chroma[0]));
    memset(chroma[1], 150, sizeof(chroma[1]));
    return (struct sst_h264_picture){ .plane = { luma, chroma[0], chroma[1] }, .stride = { WIDTH, WIDTH / 2, WIDTH / 2 } };
}

static struct sst_h264 *open_small(void)
{
    const struct sst_h264_config cfg = { WIDTH, HEIGHT, LIMIT, true };
    struct sst_h264 *h = NULL;
    char why[256] = "";
    const int err = sst_h264_open(&h, &cfg, why);

    if (err == -ENOTSUP) {
        print_message("%s\n", why);
        skip();
    }
    assert_int_equal(err, 0);
    return h;
}

static double mean_error(const AVFrame *f)
{
    double sum = 0;

    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++)
            sum += abs(f->data[0][y * f->linesize[0] + x] - luma[y * WIDTH + x]);
    return sum / (WIDTH * HEIGHT);
}

static AVCodecContext *open_decoder(void)
{
    AVCodecContext *c = avcodec_alloc_context3(avcodec_find_decoder(AV_CODEC_ID_H264));

    assert_non_null(c);
    c->thread_count = 1;
    c->flags |= AV_CODEC_FLAG_LOW_DELAY;
    assert_int_equal(avcodec_open2(c, NULL, NULL), 0);
    return c;
}

/* Pictures from number 3 on, as of a viewer that comes when the fourth is the next. */
static void a_viewer_joins_at_a_key_picture(void **state)
{
    struct sst_h264 *h = open_small();
    AVCodecContext *decoder = open_decoder();
    AVPacket *packet = av_packet_alloc();
    AVFrame *frame = av_frame_alloc();
    size_t bytes = 0, key_bytes = 0;
    char why[256];

    (void)state;
    for (int n = 0; n < 40; n++) {
        struct sst_h264_picture p = picture(n);
        struct sst_h264_unit unit;

        p.key = n == 0 || n == 4;
        assert_int_equal(sst_h264_encode(h, &p, &unit, why), 0);
        assert_int_equal(unit.key, p.key);
        assert_memory_equal(unit.data, "\0\0\0\1", 4);
        assert_memory_equal(unit.codec, "avc1.", 5);
        assert_int_equal(strlen(unit.codec), 11);
        key_bytes = p.key ? unit.bytes : key_bytes;
        bytes += unit.bytes;
        if (n < 4)
            continue;
        assert_int_equal(av_new_packet(packet, (int)unit.bytes), 0);
        memcpy(packet->data, unit.data, unit.bytes);
        assert_int_equal(avcodec_send_packet(decoder, packet), 0);
        assert_int_equal(avcodec_receive_frame(decoder, frame), 0); /* not one later */
        assert_int_equal(frame->width, WIDTH);
        assert_int_equal(frame->color_range, AVCOL_RANGE_JPEG);
        assert_true(mean_error(frame) < 4);
        av_packet_unref(packet);
        av_frame_unref(frame);
    }
    print_message("%s: %zu bytes a picture, %zu of a key picture\n", sst_h264_name(h), bytes / 40, key_bytes);
    assert_true(bytes / 40 < LIMIT);
    av_packet_free(&packet);
    av_frame_free(&frame);
    avcodec_free_context(&decoder);
    sst_h264_close(h);
}

/* Noise takes as many bytes as it is given. */
static void bytes_are_limited(void **state)
{
    struct sst_h264 *h = open_small();
    struct sst_h264_picture p = picture(0);
    struct sst_h264_unit unit;
    uint32_t seed = 1;
    size_t bytes = 0;
    char why[256];

    (void)state;
    for (int n = 0; n < 60; n++) {
        for (size_t i = 0; i < sizeof(luma); i++)
            luma[i] = (uint8_t)((seed = seed * 1664525 + 1013904223) >> 24);
        p.key = n == 0;
        assert_int_equal(sst_h264_encode(h, &p, &unit, why), 0);
        bytes += n >= 20 ? unit.bytes : 0; /* once the rate control has met it */
    }
    print_message("%zu bytes a picture of noise\n", bytes / 40);
    assert_true(bytes / 40 < 3 * LIMIT / 2);
    sst_h264_close(h);
}

static void sizes_are_checked(void **state)
{
    static const int sizes[][2] = { { 0, 0 }, { 16, 240 }, { 321, 240 }, { 320, 241 }, { 10000, 240 }, { -2, -2 } };
    struct sst_h264 *h = NULL;
    char why[256] = "";

    (void)state;
    sst_h264_close(open_small());
    for (size_t i = 0; i < ARRAY_LEN(sizes); i++) {
        const struct sst_h264_config cfg = { sizes[i][0], sizes[i][1], LIMIT, true };

        assert_int_equal(sst_h264_open(&h, &cfg, why), -ENOTSUP);
        assert_non_null(strstr(why, "are not encoded"));
    }
    assert_null(h);
    sst_h264_close(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_viewer_joins_at_a_key_picture),
        cmocka_unit_test(bytes_are_limited),
        cmocka_unit_test(sizes_are_checked),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}

#else

static void it_is_explained(void **state)
{
    const struct sst_h264_config cfg = { 320, 240, 4000, true };
    struct sst_h264 *h = NULL;
    char why[256] = "";

    (void)state;
    assert_int_equal(sst_h264_open(&h, &cfg, why), -ENOTSUP);
    assert_non_null(strstr(why, "libavcodec"));
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(it_is_explained) };

    return cmocka_run_group_tests(tests, NULL, NULL);
}

#endif
