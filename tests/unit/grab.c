/* Grabbing without devices: faults in a frame's bytes, assignment of devices to cameras, names of controls. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <turbojpeg.h>

#include "drivers/grab/grab_internal.h"
#include "tests/test.h"

/* --- frames ------------------------------------------------------------------------------------------------------- */

/* The smallest file with all that counts: frame header of 16x8, one scan with a stuffed byte and a restart. */
static const uint8_t tiny[] = {
    0xff, 0xd8,                                                                /* 0: SOI */
    0xff, 0xe0, 0x00, 0x04, 'a',  'b',                                         /* 2: APP0 */
    0xff, 0xc0, 0x00, 0x0b, 8,    0x00, 0x08, 0x00, 0x10, 1,    1,    0x11, 0, /* 8: SOF0 */
    0xff, 0xda, 0x00, 0x08, 1,    1,    0,    0,    0x3f, 0,                   /* 21: SOS */
    0x12, 0xff, 0x00, 0x34, 0xff, 0xd0, 0x56, 0xff, 0xff, 0xd1, 0x78,          /* 31: coded data */
    0xff, 0xd9,                                                                /* 42: EOI */
};

static unsigned check(const struct sst_frame *f)
{
    int size[2];

    return frame_check(f, 0, size) & SST_FRAME_BAD;
}

/* From the heap, so that the address sanitizer sees a byte too many. */
static unsigned check_jpeg(const uint8_t *data, size_t bytes)
{
    uint8_t *copy = malloc(bytes ? bytes : 1);
    unsigned faults;

    assert_non_null(copy);
    memcpy(copy, data, bytes);
    faults = check(&(struct sst_frame){
        .fourcc = V4L2_PIX_FMT_MJPEG, .width = 16, .height = 8, .stride = 0, .data = copy, .bytes = bytes });
    free(copy);
    return faults;
}

static unsigned check_changed(size_t at, uint8_t value)
{
    uint8_t jpeg[sizeof(tiny)];

    memcpy(jpeg, tiny, sizeof(tiny));
    jpeg[at] = value;
    return check_jpeg(jpeg, sizeof(jpeg));
}

static void jpeg_structure_is_walked(void **state SST_UNUSED)
{
    uint8_t padded[sizeof(tiny) + 9] = { 0 };

    assert_int_equal(check_jpeg(tiny, sizeof(tiny)), 0);
    memcpy(padded, tiny, sizeof(tiny));
    assert_int_equal(check_jpeg(padded, sizeof(padded)), 0); /* padding after the end is usual */
    assert_int_equal(check_jpeg(tiny, 0), SST_FRAME_EMPTY);
    assert_int_equal(check_changed(0, 0), SST_FRAME_NO_SOI);
    assert_int_equal(check_changed(1, 0xd9), SST_FRAME_NO_SOI);
    assert_int_equal(check_changed(2, 0), SST_FRAME_MARKER);     /* no marker where one must be */
    assert_int_equal(check_changed(3, 0x02), SST_FRAME_MARKER);  /* reserved */
    assert_int_equal(check_changed(3, 0xd8), SST_FRAME_MARKER);  /* a second start */
    assert_int_equal(check_changed(5, 1), SST_FRAME_MARKER);     /* a length below its own two bytes */
    assert_int_equal(check_changed(4, 0xff), SST_FRAME_NO_EOI);  /* a length beyond the end */
    assert_int_equal(check_changed(9, 0xda), SST_FRAME_MARKER);  /* scan before the frame header */
    assert_int_equal(check_changed(9, 0xc4), SST_FRAME_MARKER);  /* no frame header at all */
    assert_int_equal(check_changed(14, 9), SST_FRAME_MARKER);    /* height */
    assert_int_equal(check_changed(16, 17), SST_FRAME_MARKER);   /* width */
    assert_int_equal(check_changed(17, 2), SST_FRAME_MARKER);    /* components against length */
    assert_int_equal(check_changed(25, 2), SST_FRAME_MARKER);    /* the same of the scan */
    assert_int_equal(check_changed(33, 0x02), SST_FRAME_MARKER); /* a reserved one within the data */
    assert_int_equal(check_changed(33, 0xc0), SST_FRAME_NO_EOI); /* a segment there, longer than the file */
    assert_int_equal(check_changed(43, 0), SST_FRAME_NO_EOI);
    assert_int_equal(check_changed(22, 0xd9), SST_FRAME_MARKER); /* the end without a scan */
}

/* Cut anywhere, the file is damaged, and no byte beyond the cut is read. */
static void jpeg_cut_anywhere_is_damaged(void **state SST_UNUSED)
{
    for (size_t n = 0; n < sizeof(tiny); n++)
        assert_int_not_equal(check_jpeg(tiny, n), 0);
    assert_int_equal(check_jpeg(tiny, sizeof(tiny) - 1), SST_FRAME_NO_EOI);
    assert_int_equal(check_jpeg(tiny, 35), SST_FRAME_NO_EOI);
    assert_int_equal(check_jpeg(tiny, 12), SST_FRAME_NO_EOI);
}

/* A camera's Huffman tables may be left out (UVC); an encoder's files pass, progressive ones too. */
static void jpeg_of_an_encoder_passes(void **state SST_UNUSED)
{
    uint8_t rgb[48 * 64 * 3];
    tjhandle tj = tjInitCompress();

    for (size_t i = 0; i < sizeof(rgb); i++)
        rgb[i] = (uint8_t)(i * 2654435761u >> 13);
    for (int progressive = 0; progressive < 2; progressive++) {
        unsigned char *jpeg = NULL;
        unsigned long bytes = 0;

        assert_int_equal(tjCompress2(tj, rgb, 64, 0, 48, TJPF_RGB, &jpeg, &bytes, TJSAMP_422, 95,
                                     progressive ? TJFLAG_PROGRESSIVE : 0),
                         0);
        assert_int_equal(
            check(&(struct sst_frame){
                .fourcc = V4L2_PIX_FMT_MJPEG, .width = 64, .height = 48, .stride = 0, .data = jpeg, .bytes = bytes }),
            0);
        assert_int_equal(
            check(&(struct sst_frame){
                .fourcc = V4L2_PIX_FMT_MJPEG, .width = 48, .height = 64, .stride = 0, .data = jpeg, .bytes = bytes }),
            SST_FRAME_MARKER);
        for (unsigned long n = 2; n < bytes - 1; n += 97)
            assert_int_equal(
                check(&(struct sst_frame){
                    .fourcc = V4L2_PIX_FMT_JPEG, .width = 64, .height = 48, .stride = 0, .data = jpeg, .bytes = n }),
                SST_FRAME_NO_EOI);
        tjFree(jpeg);
    }
    tjDestroy(tj);
}

static void raw_frames_must_be_whole(void **state SST_UNUSED)
{
    static const uint8_t data[1] = { 0 };

    /* YUYV 6x4 with rows of 16 bytes: 3 whole rows and 12 bytes of the last. */
    assert_int_equal(raw_bytes(V4L2_PIX_FMT_YUYV, 6, 4, 16), 60);
    assert_int_equal(raw_bytes(V4L2_PIX_FMT_YUYV, 6, 4, 0), 48);
    assert_int_equal(raw_bytes(V4L2_PIX_FMT_GREY, 5, 3, 0), 15);
    assert_int_equal(raw_bytes(V4L2_PIX_FMT_Y10P, 8, 2, 0), 20); /* 4 pixels in 5 bytes */
    assert_int_equal(raw_bytes(V4L2_PIX_FMT_NV12, 8, 4, 16), 96);
    assert_int_equal(raw_bytes(V4L2_PIX_FMT_MJPEG, 8, 4, 0), 0);
    assert_int_equal(
        check(&(struct sst_frame){
            .fourcc = V4L2_PIX_FMT_YUYV, .width = 6, .height = 4, .stride = 16, .data = data, .bytes = 59 }),
        SST_FRAME_SHORT);
    assert_int_equal(
        check(&(struct sst_frame){
            .fourcc = V4L2_PIX_FMT_YUYV, .width = 6, .height = 4, .stride = 16, .data = data, .bytes = 60 }),
        0);
    assert_int_equal(
        check(&(struct sst_frame){
            .fourcc = V4L2_PIX_FMT_YUYV, .width = 6, .height = 4, .stride = 16, .data = data, .bytes = 64 }),
        0);
    assert_int_equal(
        check(&(struct sst_frame){
            .fourcc = V4L2_PIX_FMT_YUYV, .width = 6, .height = 4, .stride = 16, .data = data, .bytes = 0 }),
        SST_FRAME_EMPTY);
}

/* Any one bit that differs, anywhere, and any other length, gives another hash. */
static void hash_sees_every_bit(void **state SST_UNUSED)
{
    uint8_t data[100];
    uint64_t same;

    for (size_t i = 0; i < sizeof(data); i++)
        data[i] = (uint8_t)(i * 37);
    same = sst_grab_hash(data, sizeof(data));
    assert_true(same == sst_grab_hash(data, sizeof(data)));
    for (size_t bit = 0; bit < 8 * sizeof(data); bit++) {
        data[bit / 8] ^= (uint8_t)(1 << bit % 8);
        assert_true(sst_grab_hash(data, sizeof(data)) != same);
        data[bit / 8] ^= (uint8_t)(1 << bit % 8);
    }
    memset(data, 0, sizeof(data));
    for (size_t n = 1; n < sizeof(data); n++)
        assert_true(sst_grab_hash(data, n) != sst_grab_hash(data, n - 1));
}

/* The size in a JPEG is given if only that is wrong; bytes before its start marker are counted. */
static void jpegs_of_another_size_are_measured(void **state SST_UNUSED)
{
    uint8_t late[300 + sizeof(tiny)] = { 0 };
    int size[2] = { 0, 0 };

    assert_int_equal(frame_check(&(struct sst_frame){ .fourcc = V4L2_PIX_FMT_MJPEG,
                                                      .width = 16,
                                                      .height = 16,
                                                      .stride = 0,
                                                      .data = tiny,
                                                      .bytes = sizeof(tiny) },
                                 0, size),
                     SST_FRAME_MARKER | SST_FRAME_UNFIT);
    assert_int_equal(size[0], 16);
    assert_int_equal(size[1], 8);
    assert_int_equal(frame_check(&(struct sst_frame){ .fourcc = V4L2_PIX_FMT_MJPEG,
                                                      .width = 16,
                                                      .height = 8,
                                                      .stride = 0,
                                                      .data = tiny,
                                                      .bytes = sizeof(tiny) },
                                 0, size),
                     0);
    for (size_t lead = 0; lead <= 300; lead++) {
        const size_t bytes = lead + sizeof(tiny);

        memset(late, 0xff, sizeof(late)); /* fill bytes are no start either */
        memcpy(late + lead, tiny, sizeof(tiny));
        assert_int_equal(frame_lead(V4L2_PIX_FMT_MJPEG, late, bytes), lead < 256 ? lead : 0);
    }
    for (size_t bytes = 0; bytes < 19; bytes++) {
        memset(late, 0, 16);
        memcpy(late + 16, tiny, 3);
        assert_int_equal(frame_lead(V4L2_PIX_FMT_MJPEG, late, bytes), 0);
    }
    assert_int_equal(frame_lead(V4L2_PIX_FMT_MJPEG, late, 19), 16);
    assert_int_equal(frame_lead(V4L2_PIX_FMT_YUYV, late, 19), 0);
}

/* --- time stamps -------------------------------------------------------------------------------------------------- */

#define SECOND INT64_C(1000000000)

/* A camera of 30 Hz with a clock that is off by off_ns and frames that are dequeued wait_ns late.
 * @return number of frames out of `frames` with a stamp that was found wrong */
static int run_clock(struct stamp_clock *c, int64_t *now_ns, int frames, int64_t off_ns, double drift, int64_t wait_ns)
{
    int wrong = 0;

    for (int i = 0; i < frames; i++) {
        const int64_t t_ns = *now_ns += SECOND / 30;

        wrong += stamp_judge(c, t_ns + off_ns + (int64_t)(drift * i * SECOND / 30), t_ns + 40 * SST_MS + wait_ns) !=
                 STAMP_RIGHT;
        if (!wait_ns) /* else the next one has been filled meanwhile */
            c->empty_ns = t_ns + 41 * SST_MS;
    }
    return wrong;
}

/* @param right  frames before, all with right stamps */
static void clock_begin(struct stamp_clock *c, int64_t *now_ns, int right)
{
    *c = (struct stamp_clock){ 0 };
    *now_ns = 5000 * SECOND;
    stamp_begin(c, *now_ns);
    assert_int_equal(run_clock(c, now_ns, right, 0, 0, 0), 0);
}

/* An impossible stamp costs its frame, but neither later frames nor the trust in the clock. */
static void single_wrong_stamps_cost_their_frames(void **state SST_UNUSED)
{
    static const int64_t off_ns[] = { 3600 * SECOND, -140459 * SECOND, 2 * SECOND, -2 * SECOND, 60 * SECOND };
    struct stamp_clock c;
    int64_t now_ns;

    for (size_t i = 0; i < ARRAY_LEN(off_ns); i++)
        for (int right = 0; right <= 100; right += 100) {
            clock_begin(&c, &now_ns, right);
            assert_int_equal(run_clock(&c, &now_ns, 10, off_ns[i], 0, 0), 10);
            assert_int_equal(run_clock(&c, &now_ns, 100, 0, 0, 0), 0);
            assert_false(c.foreign);
        }
}

/* Stamps that are wrong for seconds are of another clock; once right for long, they are believed again. */
static void clocks_that_are_not_the_monotonic_one_are_found(void **state SST_UNUSED)
{
    static const int64_t off_ns[] = { 1790000000 * SECOND, 190 * SECOND, -190 * SECOND, 2 * SECOND, -2 * SECOND };
    struct stamp_clock c;
    int64_t now_ns;

    for (size_t i = 0; i < ARRAY_LEN(off_ns); i++)
        for (int right = 0; right <= 100; right += 100) {
            clock_begin(&c, &now_ns, right);
            assert_int_equal(run_clock(&c, &now_ns, 90, off_ns[i], 0, 0), 90);
            assert_true(c.foreign);
            stamp_begin(&c, now_ns); /* the stream is started again: still known */
            (void)run_clock(&c, &now_ns, 200, off_ns[i], 0, 0);
            assert_true(c.foreign);
            (void)run_clock(&c, &now_ns, 200, 0, 0, 0);
            assert_true(c.foreign);
            (void)run_clock(&c, &now_ns, 200, 0, 0, 0);
            assert_false(c.foreign);
        }
    /* Slower and faster by 1 %. */
    for (int way = -1; way <= 1; way += 2) {
        clock_begin(&c, &now_ns, 0);
        (void)run_clock(&c, &now_ns, 4000, 0, way * 0.01, 0);
        assert_true(c.foreign);
    }
    /* Always the same. */
    clock_begin(&c, &now_ns, 0);
    for (int i = 0; i < 90; i++)
        assert_int_equal(stamp_judge(&c, 1000 * SECOND, now_ns += SECOND / 30), i ? STAMP_REPEATED : STAMP_BEHIND);
    assert_true(c.foreign);
}

/* Frames that a busy machine dequeues late, or after it stood still, have old stamps, which are right. */
static void late_frames_have_right_stamps(void **state SST_UNUSED)
{
    struct stamp_clock c;
    int64_t now_ns;

    clock_begin(&c, &now_ns, 100);
    assert_int_equal(run_clock(&c, &now_ns, 900, 0, 0, 5 * SECOND), 0); /* behind for half a minute */
    assert_int_equal(run_clock(&c, &now_ns, 100, 0, 0, 0), 0);
    for (int i = 0; i < 32; i++) /* all buffers at once, a minute later */
        assert_int_equal(stamp_judge(&c, now_ns + (i + 1) * (SECOND / 30), now_ns + 60 * SECOND + i), STAMP_RIGHT);
    /* One frame in ten seconds, exposed for four. */
    clock_begin(&c, &now_ns, 0);
    for (int i = 0; i < 20; i++) {
        now_ns += 10 * SECOND;
        assert_int_equal(stamp_judge(&c, now_ns - 4 * SECOND, now_ns), STAMP_RIGHT);
        c.empty_ns = now_ns;
    }
}

static void clocks_are_described(void **state SST_UNUSED)
{
    char out[96];

    stamp_describe(out, sizeof(out), STAMP_AHEAD, &(struct sst_frame){ .t_ns = 190 * SECOND, .arrival_ns = 0 },
                   1790000000 * SECOND);
    assert_string_equal(out, "its time stamps are 190.0 s ahead");
    stamp_describe(out, sizeof(out), STAMP_AHEAD, &(struct sst_frame){ .t_ns = SECOND / 50, .arrival_ns = 0 },
                   1790000000 * SECOND);
    assert_string_equal(out, "its time stamps are 0.020 s ahead");
    stamp_describe(out, sizeof(out), STAMP_BEHIND, &(struct sst_frame){ .t_ns = -2 * SECOND, .arrival_ns = 0 },
                   1790000000 * SECOND);
    assert_string_equal(out, "its time stamps are 2.0 s behind");
    stamp_describe(out, sizeof(out), STAMP_REPEATED, &(struct sst_frame){ .t_ns = -2 * SECOND, .arrival_ns = 0 },
                   1790000000 * SECOND);
    assert_string_equal(out, "its time stamps do not advance");
    stamp_describe(out, sizeof(out), STAMP_AHEAD, &(struct sst_frame){ .t_ns = 1790000001 * SECOND, .arrival_ns = 0 },
                   1790000000 * SECOND);
    assert_string_equal(out, "its time stamps are of the wall clock");
}

/* --- identity ----------------------------------------------------------------------------------------------------- */

static struct grab_node node(int number, const char *serial, const char *port, int capture)
{
    struct grab_node n = { .number = number, .capture = capture };

    snprintf(n.device.serial, sizeof(n.device.serial), "%s", serial);
    snprintf(n.device.port, sizeof(n.device.port), "%s", port);
    return n;
}

static void ports_are_ordered_as_people_read_them(void **state SST_UNUSED)
{
    struct grab_node n[] = { node(0, "", "1-2.10", 1), node(3, "", "1-2.9", 1), node(2, "", "1-2.9", 1),
                             node(1, "", "10-1", 1), node(4, "", "2-1", 1) };
    static const int want[] = { 2, 3, 0, 4, 1 };

    qsort(n, ARRAY_LEN(n), sizeof(*n), grab_node_order);
    for (size_t i = 0; i < ARRAY_LEN(n); i++)
        assert_int_equal(n[i].number, want[i]);
}

/* @param want  index of the node, or the error
 * @param words, more  that are said of it; NULL: nothing */
static void check_match(const char *serial, const char *port, const struct grab_node *n, int count, int want,
                        const char *words, const char *more)
{
    struct sst_grab_binding b = { "", "" };
    char why[SST_WHY_MAX];

    snprintf(b.serial, sizeof(b.serial), "%s", serial);
    snprintf(b.port, sizeof(b.port), "%s", port);
    assert_int_equal(grab_match(&b, n, count, why), want);
    if (!words)
        assert_string_equal(why, "");
    if (words)
        assert_contains(why, words);
    if (more)
        assert_contains(why, more);
}

static void bindings_find_their_devices(void **state SST_UNUSED)
{
    /* One camera with its metadata node first, one with two pictures, one without a serial. */
    const struct grab_node n[] = { node(1, "A", "1-1", 0), node(0, "A", "1-1", -1), node(2, "B", "1-2", 1),
                                   node(3, "B", "1-2", 1), node(4, "", "1-3", 1) };

    check_match("A", "", n, 5, 1, NULL, NULL);
    check_match("B", "", n, 5, 2, NULL, NULL); /* two nodes of one device are no doubt */
    check_match("", "1-3", n, 5, 4, NULL, NULL);
    check_match("", "1-30", n, 5, -ENODEV, NULL, NULL);
    check_match("C", "", n, 5, -ENODEV, NULL, NULL);
}

static void odd_identities_are_named(void **state SST_UNUSED)
{
    const struct grab_node n[] = { node(0, "A", "1-1", 1), node(1, "A", "1-2", 1), node(2, "B", "1-3", 1) };

    check_match("A", "", n, 3, -ENOTUNIQ, "1-1", "1-2");
    check_match("", "1-2", n, 3, 1, NULL, NULL); /* by port there is no doubt */
    /* B was plugged where A belongs: found by its serial, and named. */
    check_match("B", "1-1", n, 3, 2, "1-3", "has serial A");
    check_match("C", "1-3", n, 3, -ENODEV, "has serial B", NULL);
}

/* Nodes of one device: the binding chooses by number among the capturing ones. */
static void a_node_of_several_is_chosen(void **state SST_UNUSED)
{
    const struct grab_node n[] = { node(0, "A", "1-1", 1), node(1, "A", "1-1", 0), node(2, "A", "1-1", 1),
                                   node(3, "B", "1-2", 1) };
    struct sst_grab_binding b = { .serial = "A" };
    char why[SST_WHY_MAX];

    assert_int_equal(grab_match(&b, n, 4, why), 0);
    b.node = 2;
    assert_int_equal(grab_match(&b, n, 4, why), 2);
    b.node = 3;
    assert_int_equal(grab_match(&b, n, 4, why), -ENODEV);
    b = (struct sst_grab_binding){ .port = "1-1", .node = 2 };
    assert_int_equal(grab_match(&b, n, 4, why), 2);
    b = (struct sst_grab_binding){ .port = "1-2", .node = 1 };
    assert_int_equal(grab_match(&b, n, 4, why), 3);
}

static struct sst_grab_device device(const char *name, const char *port, int nth, uint32_t first, uint32_t second)
{
    struct sst_grab_device d = { .nth = nth, .fourcc = { first, second } };

    snprintf(d.node, sizeof(d.node), "/dev/%s", name);
    snprintf(d.port, sizeof(d.port), "%s", port);
    return d;
}

/* One camera of each device, which offers the format; the others follow, with the reason. */
static void cameras_of_an_array_are_selected(void **state SST_UNUSED)
{
    struct sst_grab_device d[] = {
        device("video0", "1-1", 1, V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_YUYV),
        device("video2", "2-1", 1, V4L2_PIX_FMT_GREY, 0),
        device("video3", "2-1", 2, V4L2_PIX_FMT_JPEG, 0), /* the same as MJPG */
        device("video4", "2-1", 3, V4L2_PIX_FMT_MJPEG, 0),
        device("video5", "3-1", 1, V4L2_PIX_FMT_GREY, 0),
        device("video6", "4-1", 1, 0, 0), /* it could not be asked */
    };
    static const char *const order[] = { "video0", "video3", "video6", "video2", "video4", "video5" };

    assert_int_equal(sst_grab_select(d, 6, V4L2_PIX_FMT_MJPEG), 3);
    for (int i = 0; i < 6; i++) {
        assert_string_equal(d[i].node + 5, order[i]);
        assert_int_equal(*d[i].left_out != 0, i >= 3);
    }
    assert_string_equal(d[3].left_out, "it offers no MJPG");
    assert_string_equal(d[4].left_out, "/dev/video3 is of the same device");
    /* Where none offers it, a camera of each device is refused by its own name. */
    struct sst_grab_device none[] = { device("video0", "1-1", 1, V4L2_PIX_FMT_GREY, 0),
                                      device("video1", "1-1", 2, V4L2_PIX_FMT_GREY, 0),
                                      device("video2", "1-2", 1, V4L2_PIX_FMT_GREY, 0) };

    assert_int_equal(sst_grab_select(none, 3, V4L2_PIX_FMT_MJPEG), 2);
    assert_string_equal(none[1].node, "/dev/video2");
    assert_int_equal(sst_grab_select(none, 0, V4L2_PIX_FMT_MJPEG), 0);
}

/* Parts of split pictures have names of their own, and bindings find their devices by them. */
static void parts_have_names(void **state SST_UNUSED)
{
    static const struct {
        const char *name, *device;
        int part;
    } cases[] = { { "A17#2", "A17", 2 },   { "1-2.3#16", "1-2.3", 16 }, { "A#1#4", "A#1", 4 }, { "A17", "A17", 0 },
                  { "A17#", "A17#", 0 },   { "A17#0", "A17#0", 0 },     { "A#17", "A#17", 0 }, { "#1", "#1", 0 },
                  { "A#1x", "A#1x", 0 },   { "", "", 0 } };
    char device[SST_GRAB_NAME_MAX];

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        assert_int_equal(sst_grab_part_of(device, cases[i].name), cases[i].part);
        assert_string_equal(device, cases[i].device);
    }
}

static void devices_are_listed_by_part(void **state SST_UNUSED)
{
    struct sst_grab_device *list = calloc(3, sizeof(*list));
    int count = 2, all = 3;

    snprintf(list[0].serial, sizeof(list[0].serial), "A");
    snprintf(list[0].port, sizeof(list[0].port), "1-1");
    snprintf(list[1].port, sizeof(list[1].port), "1-2"); /* without a serial */
    memset(list[2].serial, 'x', sizeof(list[2].serial) - 1);
    assert_int_equal(sst_grab_list_parts(&list, &count, &all, (struct sst_grab_split){ 1, 1 }), 0);
    assert_int_equal(count, 2);
    assert_int_equal(sst_grab_list_parts(&list, &count, &all, (struct sst_grab_split){ 2, 2 }), 0);
    assert_int_equal(count, 8);
    assert_int_equal(all, 9);
    assert_string_equal(list[0].serial, "A#1");
    assert_string_equal(list[3].port, "1-1#4");
    assert_string_equal(list[5].serial, "");
    assert_string_equal(list[5].port, "1-2#2");
    assert_int_equal(list[8].serial[0], 'x'); /* the others stay */
    count = 9; /* a name without room keeps its part */
    assert_int_equal(sst_grab_list_parts(&list, &count, &all, (struct sst_grab_split){ 1, 12 }), 0);
    assert_string_equal(list[8 * 12 + 11].serial + sizeof(list->serial) - 5, "x#12");
    free(list);
}

/* --- controls ----------------------------------------------------------------------------------------------------- */

static void control_names_are_those_of_v4l2_ctl(void **state SST_UNUSED)
{
    static const char *const names[][2] = {
        { "White Balance, Automatic", "white_balance_automatic" },
        { "Exposure Time, Absolute", "exposure_time_absolute" },
        { "Exposure (Absolute)", "exposure_absolute" },
        { "  Gain ", "gain" },
        { "3D Noise-Reduction (Y)", "3d_noise_reduction_y" },
        { "", "" },
        { "(---)", "" },
    };
    char out[64], small[6];

    for (size_t i = 0; i < ARRAY_LEN(names); i++) {
        control_name(out, sizeof(out), names[i][0]);
        assert_string_equal(out, names[i][1]);
    }
    control_name(small, sizeof(small), "Exposure");
    assert_int_equal(strnlen(small, sizeof(small)) < sizeof(small), 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(jpeg_structure_is_walked),
        cmocka_unit_test(jpeg_cut_anywhere_is_damaged),
        cmocka_unit_test(jpeg_of_an_encoder_passes),
        cmocka_unit_test(raw_frames_must_be_whole),
        cmocka_unit_test(hash_sees_every_bit),
        cmocka_unit_test(jpegs_of_another_size_are_measured),
        cmocka_unit_test(single_wrong_stamps_cost_their_frames),
        cmocka_unit_test(clocks_that_are_not_the_monotonic_one_are_found),
        cmocka_unit_test(late_frames_have_right_stamps),
        cmocka_unit_test(clocks_are_described),
        cmocka_unit_test(ports_are_ordered_as_people_read_them),
        cmocka_unit_test(bindings_find_their_devices),
        cmocka_unit_test(odd_identities_are_named),
        cmocka_unit_test(a_node_of_several_is_chosen),
        cmocka_unit_test(cameras_of_an_array_are_selected),
        cmocka_unit_test(parts_have_names),
        cmocka_unit_test(devices_are_listed_by_part),
        cmocka_unit_test(control_names_are_those_of_v4l2_ctl),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
