/* Pure parts of drivers/genicam: formats, numbers of frames, clock, action commands. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <arpa/inet.h>
#include <linux/videodev2.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.h"
#include "drivers/genicam/genicam_internal.h"
#include "tests/test.h"

#define MS INT64_C(1000000)
#define S  INT64_C(1000000000)

/* --- pixels ------------------------------------------------------------------------------------------------------- */

/* Samples as a camera packs them, by the text of GigE Vision and PFNC. */
static size_t pack(uint8_t *out, const unsigned *v, size_t n, enum genicam_packing packing)
{
    size_t bits = 0;

    memset(out, 0, 2 * n + 8);
    for (size_t i = 0; i < n; i++) {
        const size_t width = packing == GENICAM_P12 ? 12 : 10;
        const int low = packing == GENICAM_PACKED12 ? 4 : 2;
        uint8_t *pair = out + i / 2 * 3;

        if (packing == GENICAM_SHIFT) {
            out[2 * i] = (uint8_t)v[i];
            out[2 * i + 1] = (uint8_t)(v[i] >> 8);
        } else if (packing == GENICAM_P12 || packing == GENICAM_P10) {
            for (size_t b = 0; b < width; b++, bits++)
                out[bits / 8] |= (uint8_t)((v[i] >> b & 1) << bits % 8);
        } else {
            pair[i % 2 * 2] = (uint8_t)(v[i] >> low);
            pair[1] |= (uint8_t)((v[i] & ((1u << low) - 1)) << i % 2 * 4);
        }
    }
    return bits;
}

static void packed_samples_become_16_bits(void **state SST_UNUSED)
{
    static const char *const names[] = { "Mono10", "Mono10p", "Mono10Packed", "Mono12", "Mono12p", "Mono12Packed", "Mono14" };

    for (size_t k = 0; k < ARRAY_LEN(names); k++) {
        const struct genicam_pixels *p = genicam_pixels_named(names[k]);

        assert_non_null(p);
        assert_int_equal(p->fourcc, V4L2_PIX_FMT_Y16);
        for (size_t n = 1; n <= 37; n++) {
            unsigned v[37];
            uint8_t *data = malloc(2 * n + 8);

            for (size_t i = 0; i < n; i++)
                v[i] = (unsigned)(i * 2654435761u >> 7) & ((1u << p->bits) - 1);
            pack(data, v, n, p->packing);
            genicam_unpack(data, n, p);
            for (size_t i = 0; i < n; i++)
                assert_int_equal(data[2 * i] | data[2 * i + 1] << 8, v[i] << (16 - p->bits));
            free(data);
        }
    }
}

static void frames_have_their_sizes(void **state SST_UNUSED)
{
    assert_int_equal(genicam_bytes(genicam_pixels_named("Mono8"), 640, 480), 307200);
    assert_int_equal(genicam_bytes(genicam_pixels_named("Mono12Packed"), 640, 480), 460800);
    assert_int_equal(genicam_frame_bytes(genicam_pixels_named("Mono12Packed"), 640, 480), 614400);
    assert_int_equal(genicam_bytes(genicam_pixels_named("Mono10p"), 6, 3), 23); /* 22.5 */
    assert_int_equal(genicam_frame_bytes(genicam_pixels_named("RGB8"), 10, 10), 300);
    assert_null(genicam_pixels_named("YUV422_8"));
    assert_true(sst_genicam_has_format(V4L2_PIX_FMT_SGBRG8));
    assert_false(sst_genicam_has_format(V4L2_PIX_FMT_MJPEG));
}

/* --- numbers ------------------------------------------------------------------------------------------------------ */

static void lost_frames_are_counted_by_their_numbers(void **state SST_UNUSED)
{
    static const struct {
        uint64_t id;
        uint32_t lost;
    } seen[] = {
        { 65533, 0 }, { 65534, 0 }, { 1, 1 },     /* 65535 is lost, and 0 is no number */
        { 2, 0 },     { 5, 2 },     { 0, 0 },     /* the first packet of 6 is lost */
        { 7, 0 },     { 0, 0 },     { 0, 0 },     { 11, 1 }, /* 8 and 9, or of 8 to 10 any two */
        { 3, 0 },     { 4, 0 },                   /* it starts again */
        { 70000, 0 }, { 70002, 1 },               /* numbers of 64 bits after that */
    };
    struct genicam_ids ids = { 0 };

    for (size_t i = 0; i < ARRAY_LEN(seen); i++)
        assert_int_equal(genicam_lost_before(&ids, seen[i].id), seen[i].lost);
    ids = (struct genicam_ids){ 0 };
    assert_int_equal(genicam_lost_before(&ids, 0), 0); /* nothing is known of the frames before */
    assert_int_equal(genicam_lost_before(&ids, 42), 0);
    ids = (struct genicam_ids){ 0 };
    assert_int_equal(genicam_lost_before(&ids, 65535), 0);
    assert_int_equal(genicam_lost_before(&ids, 1), 0);
    ids = (struct genicam_ids){ 0 };
    assert_int_equal(genicam_lost_before(&ids, 65535), 0); /* one of 64 bits: no wrap */
    assert_int_equal(genicam_lost_before(&ids, 65536), 0);
}

/* --- clock -------------------------------------------------------------------------------------------------------- */

static void time_of_a_camera_is_mapped_through_delays_and_drift(void **state SST_UNUSED)
{
    const double drift = 80e-6; /* the camera's crystal is slow */
    struct genicam_clock c = { 0 };
    int64_t t, worst = 0;
    unsigned seed = 1;

    assert_false(genicam_clock_here(&c, 5, &t));
    for (int i = 0; i < 600; i++) { /* a minute at 10 Hz */
        const int64_t true_ns = 1000 * S + i * 100 * MS;
        const int64_t stamp_ns = 77 * S + (int64_t)((double)(true_ns - 1000 * S) * (1 - drift));
        int64_t delay_ns = 200000; /* of the network; often much more, as the machine is busy */

        seed = seed * 1103515245 + 12345;
        if (i % 5)
            delay_ns += (int64_t)(seed >> 8) % (40 * MS);
        genicam_clock_add(&c, stamp_ns, true_ns + delay_ns);
        assert_true(genicam_clock_here(&c, stamp_ns, &t));
        if (i > 150 && llabs(t - true_ns) > worst)
            worst = llabs(t - true_ns);
        assert_true(i < 150 || genicam_clock_there(&c, t, &t));
        assert_true(i < 150 || llabs(t - stamp_ns) < 10000);
    }
    assert_in_range(worst, 0, 800000);
}

static void stamps_that_no_clock_has_do_no_harm(void **state SST_UNUSED)
{
    static const int64_t odd[] = { INT64_MIN, -1, INT64_MAX, INT64_MAX / 2 + 1 };
    struct genicam_clock c = { 0 };
    int64_t t;

    for (size_t i = 0; i < 3 * ARRAY_LEN(odd); i++) {
        genicam_clock_add(&c, odd[i % ARRAY_LEN(odd)], 50 * S);
        assert_false(genicam_clock_here(&c, odd[i % ARRAY_LEN(odd)], &t));
    }
    genicam_clock_add(&c, 2 * S, 50 * S);
    for (size_t i = 0; i < 3 * ARRAY_LEN(odd); i++)
        genicam_clock_add(&c, odd[i % ARRAY_LEN(odd)], 51 * S);
    assert_true(genicam_clock_here(&c, 3 * S, &t));
    assert_int_equal(t, 51 * S);
    for (size_t i = 0; i < ARRAY_LEN(odd); i++)
        assert_false(genicam_clock_here(&c, odd[i], &t));
}

static void a_clock_that_is_set_is_learnt_again(void **state SST_UNUSED)
{
    struct genicam_clock c = { 0 };
    int64_t t;

    for (int i = 0; i < 20; i++)
        genicam_clock_add(&c, i * 100 * MS, 50 * S + i * 100 * MS);
    assert_true(genicam_clock_here(&c, 2 * S, &t));
    assert_int_equal(t, 52 * S);
    /* It steps by 1,000 s: nothing is known until it has been seen thrice. */
    genicam_clock_add(&c, 1002 * S, 52 * S);
    assert_false(genicam_clock_here(&c, 1002 * S, &t));
    genicam_clock_add(&c, 1002 * S + 100 * MS, 52 * S + 100 * MS);
    genicam_clock_add(&c, 1002 * S + 200 * MS, 52 * S + 200 * MS);
    assert_true(genicam_clock_here(&c, 1002 * S + 200 * MS, &t));
    assert_int_equal(t, 52 * S + 200 * MS);
}

/* --- action commands ---------------------------------------------------------------------------------------------- */

static const struct sst_genicam_action action = {
    .device_key = 0x11223344, .group_key = 0x55667788, .group_mask = 0x0000000f, .address = "127.0.0.1"
};

static void action_commands_have_the_layout_of_gige_vision(void **state SST_UNUSED)
{
    static const uint8_t now[] = { 0x42, 0x01, 0x01, 0x00, 0x00, 0x0c, 0x12, 0x34, 0x11, 0x22,
                                   0x33, 0x44, 0x55, 0x66, 0x77, 0x88, 0x00, 0x00, 0x00, 0x0f };
    static const uint8_t later[] = { 0x42, 0x81, 0x01, 0x00, 0x00, 0x14, 0x12, 0x34, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66,
                                     0x77, 0x88, 0x00, 0x00, 0x00, 0x0f, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08 };
    uint8_t out[GENICAM_ACTION_MAX];

    assert_int_equal(genicam_action_write(out, &action, 0, 0x1234), sizeof(now));
    assert_memory_equal(out, now, sizeof(now));
    assert_int_equal(genicam_action_write(out, &action, 0x0102030405060708, 0x1234), sizeof(later));
    assert_memory_equal(out, later, sizeof(later));
}

static void acknowledgements_are_read(void **state SST_UNUSED)
{
    static const uint8_t done[] = { 0x00, 0x00, 0x01, 0x01, 0x00, 0x00, 0x12, 0x34 };
    static const uint8_t late[] = { 0x80, 0x17, 0x01, 0x01, 0x00, 0x00, 0x12, 0x35 };
    static const uint8_t other[] = { 0x00, 0x00, 0x00, 0x83, 0x00, 0x00, 0x12, 0x34 };
    uint16_t id = 0;

    assert_int_equal(genicam_action_read(done, sizeof(done), &id), 0);
    assert_int_equal(id, 0x1234);
    assert_int_equal(genicam_action_read(late, sizeof(late), &id), 0x8017);
    assert_int_equal(id, 0x1235);
    assert_int_equal(genicam_action_read(other, sizeof(other), &id), GENICAM_ACTION_NONE);
    assert_int_equal(genicam_action_read(done, sizeof(done) - 1, &id), GENICAM_ACTION_NONE);
    assert_int_equal(genicam_action_read(done, 0, &id), GENICAM_ACTION_NONE);
}

/* A small camera at the port of GVCP: it gets the command of a trigger, and answers twice, as two cameras do. */
static void a_trigger_sends_one_command_and_counts_its_answers(void **state SST_UNUSED)
{
    const struct sockaddr_in at = { .sin_family = AF_INET, .sin_port = htons(GENICAM_GVCP_PORT),
                                    .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
    const int camera = socket(AF_INET, SOCK_DGRAM, 0);
    struct genicam_camera slave = { .ptp = { .role = "Slave" } };
    struct sst_genicam g = { .cfg = { .cameras = 1, .action = action }, .camera = &slave, .action_fd = genicam_action_open() };
    struct sst_genicam_action_counters n;
    struct sockaddr_in from;
    socklen_t size = sizeof(from);
    uint8_t got[64], ack[8] = { 0x00, 0x00, 0x01, 0x01, 0x00, 0x00 };
    uint64_t time_ns = 0;

    if (bind(camera, (const struct sockaddr *)&at, sizeof(at))) {
        close(camera);
        close(g.action_fd);
        print_message("port %d of this machine is in use\n", GENICAM_GVCP_PORT);
        skip();
    }
    assert_true(g.action_fd >= 0);
    genicam_clock_add(&slave.clock, 7000 * S, 50 * S);
    genicam_action_send(&g, 50 * S);
    assert_int_equal(recvfrom(camera, got, sizeof(got), 0, (struct sockaddr *)&from, &size), 20);
    assert_int_equal(got[7], 1); /* the first request */
    memcpy(ack + 6, got + 6, 2);
    assert_int_equal(sendto(camera, ack, 8, 0, (const struct sockaddr *)&from, size), 8);
    ack[0] = 0x80;
    assert_int_equal(sendto(camera, ack, 8, 0, (const struct sockaddr *)&from, size), 8);
    assert_int_equal(sendto(camera, "noise", 5, 0, (const struct sockaddr *)&from, size), 5);
    genicam_action_receive(&g); /* over loopback they are there */
    sst_genicam_actions(&g, &n);
    assert_int_equal(n.sent, 1);
    assert_int_equal(n.acknowledged, 1);
    assert_int_equal(n.refused, 1);
    /* Scheduled: by the clock of a camera that follows the master. */
    g.cfg.action.delay_us = 2000;
    genicam_action_send(&g, 51 * S);
    assert_int_equal(recv(camera, got, sizeof(got), 0), 28);
    for (int i = 20; i < 28; i++)
        time_ns = time_ns << 8 | got[i];
    assert_int_equal(time_ns, 7001 * S + 2 * MS);
    close(camera);
    close(g.action_fd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(packed_samples_become_16_bits),
        cmocka_unit_test(frames_have_their_sizes),
        cmocka_unit_test(lost_frames_are_counted_by_their_numbers),
        cmocka_unit_test(time_of_a_camera_is_mapped_through_delays_and_drift),
        cmocka_unit_test(a_clock_that_is_set_is_learnt_again),
        cmocka_unit_test(stamps_that_no_clock_has_do_no_harm),
        cmocka_unit_test(action_commands_have_the_layout_of_gige_vision),
        cmocka_unit_test(acknowledgements_are_read),
        cmocka_unit_test(a_trigger_sends_one_command_and_counts_its_answers),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
