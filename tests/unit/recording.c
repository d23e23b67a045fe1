/* capture/recording: what is recorded is read back byte for byte, by us and by others; damage is reported; what cannot
 * be is refused. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <fcntl.h>

#if WITH_AVFORMAT
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#endif

#include "capture/recording/recording_internal.h"
#include "tests/recording_tests.h"

/* --- tests -------------------------------------------------------------------------------------------------------- */

static void reads_element_heads(void **state)
{
    static const uint8_t cluster[] = { 0x1F, 0x43, 0xB6, 0x75, 0x01, 0, 0, 0, 0, 0, 0x10, 0x02 };
    static const uint8_t open_end[] = { 0x18, 0x53, 0x80, 0x67, 0x01, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF };
    static const uint8_t block[] = { 0xA3, 0x40, 0x85 };
    struct ebml e;

    (void)state;
    assert_int_equal(ebml_head(cluster, sizeof(cluster), &e), 0);
    assert_true(e.id == SST_EBML_CLUSTER && e.size == 0x1002 && e.head == 12);
    assert_int_equal(ebml_head(open_end, sizeof(open_end), &e), 0);
    assert_true(e.id == SST_EBML_SEGMENT && e.size == SST_EBML_UNKNOWN);
    assert_int_equal(ebml_head(block, sizeof(block), &e), 0);
    assert_true(e.id == SST_EBML_SIMPLE_BLOCK && e.size == 0x85 && e.head == 3);
    for (size_t n = 0; n < sizeof(cluster); n++)
        assert_int_equal(ebml_head(cluster, n, &e), -EBADMSG);
    assert_int_equal(ebml_head((const uint8_t[]){ 0x00, 0x81 }, 2, &e), -EBADMSG);
    assert_int_equal(ebml_head((const uint8_t[]){ 0xA3, 0x00 }, 2, &e), -EBADMSG);
}

#define SET_HEAD                                                                                                       \
    "{\"set\":1,\"t_ns\":5,\"wall_ns\":6,\"edge\":true,\"spread_ns\":0,\"from_edge_ns\":0,\"worst_cam\":-1,"

/* Lines with a right checksum and wrong content, as another program could write them. */
static void lines_are_read_strictly(void **state)
{
    static const struct {
        int want;
        const char *line;
    } cases[] = {
        { 1, SET_HEAD "\"frames\":[[1,7,0,-2,9,100,40,0,0,4294967295]],\"missing\":[0]}" },
        { 0, "{\"segment\":3,\"session\":1,\"start_ns\":-5,\"wall_ns\":6}" },
        { -EBADMSG, "" },
        { -EBADMSG, "[]" },
        { -EBADMSG, "{}" },
        { -EBADMSG, "{\"segment\":1000000,\"session\":1,\"start_ns\":5}" },
        { -EBADMSG, "{\"segment\":1,\"session\":2,\"start_ns\":5,\"wall_ns\":6}" },
        { -EBADMSG, "{\"segment\":3,\"session\":2147483647,\"start_ns\":5,\"wall_ns\":6}" },
        { -EBADMSG, "{\"segment\":-1,\"session\":1,\"start_ns\":5}" },
        { -EBADMSG, "{\"segment\":1,\"session\":1,\"start_ns\":\"5\"}" },
        { -EBADMSG, "{\"set\":1}" },
        { -EBADMSG, SET_HEAD "\"frames\":7,\"missing\":[0,1]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[],\"missing\":[0]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[[2,7,0,-2,9,100,40,0,0,1]],\"missing\":[0]}" }, /* no such camera */
        { -EBADMSG, SET_HEAD "\"frames\":[[-1,7,0,-2,9,100,40,0,0,1]],\"missing\":[0]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[[1,7,0,-2,9,100,40,0,0,1],[1,7,0,-2,9,100,40,0,0,1]],\"missing\":[]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[[1,7,0,-2,9,-1,40,0,0,1]],\"missing\":[0]}" }, /* bytes, but nowhere */
        { -EBADMSG, SET_HEAD "\"frames\":[[1,7,0,-2,9,9223372036854775807,40,0,0,1]],\"missing\":[0]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[[1,7,0,-2,9,100,4294967296,0,0,1]],\"missing\":[0]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[[1,7,0,-2,9,100,40,0,0,4294967296]],\"missing\":[0]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[[1,7,0,9223372036854775807,9,100,40,0,0,1]],\"missing\":[0]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[[1,7,0,-2.5,9,100,40,0,0,1]],\"missing\":[0]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[[1,7,0,-2,9,100,40,0,0]],\"missing\":[0]}" },
    };
    struct manifest_segment segment;
    struct sst_recording_set set;

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        const int got = manifest_parse(cases[i].line, strlen(cases[i].line), 2, &segment, &set);

        if (got != cases[i].want)
            fail_msg("%d, not %d: %s", got, cases[i].want, cases[i].line);
    }
    assert_true(segment.segment == 3 && segment.session == 1 && segment.start_ns == -5);
    assert_true(set.present == 1 && set.frame[1].t_ns == 3 && set.frame[1].arrival_ns == 12 &&
                set.frame[1].crc32 == UINT32_MAX && set.frame[1].offset == 100 && set.frame[1].bytes == 40);
    /* The checksum is zlib.crc32(b'{"a":1') of Python. */
    assert_true(manifest_line_whole("{\"a\":1,\"crc\":\"a702fc6e\"}", 24));
    assert_false(manifest_line_whole("{\"a\":2,\"crc\":\"a702fc6e\"}", 24));
    assert_false(manifest_line_whole("", 0));
}

static void round_trip(void **state)
{
    static const struct {
        uint32_t fourcc;
        int cameras, width, height;
        size_t bytes;
    } cases[] = {
        { V4L2_PIX_FMT_MJPEG, 36, 640, 480, 5000 }, { V4L2_PIX_FMT_YUYV, 4, 64, 48, 64 * 48 * 2 },
        { V4L2_PIX_FMT_GREY, 2, 7, 5, 35 },         { V4L2_PIX_FMT_Y16, 2, 7, 5, 70 },
        { V4L2_PIX_FMT_SBGGR8, 2, 1, 1, 1 },        { V4L2_PIX_FMT_SGBRG8, 1, 33, 17, 33 * 17 },
        { V4L2_PIX_FMT_SGRBG8, 7, 9, 3, 27 },       { V4L2_PIX_FMT_SRGGB8, 256, 5, 5, 25 },
        { V4L2_PIX_FMT_RGB24, 3, 7, 5, 105 },
    };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        struct synthetic s = { .fourcc = cases[i].fourcc,
                               .cameras = cases[i].cameras,
                               .width = cases[i].width,
                               .height = cases[i].height,
                               .bytes = cases[i].bytes,
                               .period_ns = 100000000,
                               .holes = true,
                               .exact = cases[i].fourcc != V4L2_PIX_FMT_MJPEG };
        struct sst_recorder_config cfg;
        const struct sst_recording_info *info;
        struct sst_recording *r;
        char at[SST_PATH_MAX + 8];

        synthetic_init(&s);
        snprintf(at, sizeof(at), "%s.%zu", dir, i);
        cfg = synthetic_config(&s, at);
        if (cfg.rows * cfg.cols > 256)
            cfg.rows = 43;
        assert_int_equal(sst_recorder_close(record(&s, &cfg, 0, 20)), 0);
        assert_recording(at, &s, 20);
        assert_int_equal(sst_recording_open(&r, at), 0);
        info = sst_recording_info(r);
        assert_true(info->fourcc == s.fourcc && info->width == s.width && info->height == s.height);
        assert_true(info->cameras == s.cameras && info->cols == 6 && info->rate_hz == 10 && info->spacing_mm == 40);
        assert_string_equal(info->track[s.cameras - 1].serial, s.track[s.cameras - 1].serial);
        assert_string_equal(info->track[0].port, "1-0");
        sst_recording_close(r);
        synthetic_fini(&s);
    }
}

/* Frames as a driver may hand them on: empty, of a padded stride, faulty, with a stamp from another world. */
static void odd_frames(void **state)
{
    struct synthetic s = small();
    struct sst_recorder_config cfg = synthetic_config(&s, dir);
    struct sst_recorder *r = record(&s, &cfg, 0, 1);
    struct sst_recording_set got;
    struct sst_recording *rec;
    struct sst_frameset set;
    uint8_t *data;

    (void)state;
    synthetic_set(&s, 1, &set);
    set.frame[0]->bytes = 0;
    set.frame[0]->faults = SST_FRAME_EMPTY;
    set.frame[1]->stride = 64;
    set.frame[1]->lost_before = 3;
    set.frame[1]->faults = SST_FRAME_NO_EOI | SST_FRAME_FROZEN;
    set.frame[2]->t_ns = 12;
    set.edge = false;
    assert_int_equal(sst_recorder_write(r, &set), 0);
    memset(set.frame, 0, sizeof(set.frame)); /* nothing came */
    set.present = 0;
    assert_int_equal(sst_recorder_write(r, &set), 0);
    synthetic_set(&s, 3, &set);
    assert_int_equal(sst_recorder_write(r, &set), 0);
    assert_int_equal(sst_recorder_close(r), 0);
    assert_int_equal(sst_recording_open(&rec, dir), 0);
    assert_int_equal(sst_recording_set(rec, 1, &got), 0);
    assert_true(got.present == 3 && got.frame[0].present && !got.frame[0].bytes && !got.edge);
    assert_int_equal(sst_recording_frame(rec, &got, 0, &data), -ENODATA);
    assert_true(got.frame[1].stride == 64 && got.frame[1].lost_before == 3 && got.frame[2].t_ns == 12);
    assert_int_equal(got.frame[1].faults, SST_FRAME_NO_EOI | SST_FRAME_FROZEN);
    assert_int_equal(sst_recording_set(rec, 2, &got), 0);
    assert_int_equal(got.present, 0);
    assert_set(rec, 3, &s, 3);
    sst_recording_close(rec);
    synthetic_fini(&s);
}

static void rolls_over(void **state)
{
    struct synthetic s = small();
    struct sst_recorder_config cfg = synthetic_config(&s, dir);
    struct sst_recording_set set;
    struct sst_recording *rec;
    struct sst_recorder *r;
    struct sst_frameset next;

    (void)state;
    cfg.segment_s = 0.5; /* five sets of 100 ms */
    r = record(&s, &cfg, 0, 12);
    assert_int_equal(sst_recorder_close(r), 0);
    assert_recording(dir, &s, 12);
    assert_int_equal(sst_recording_open(&rec, dir), 0);
    for (int i = 0; i < 12; i++) {
        assert_int_equal(sst_recording_set(rec, i, &set), 0);
        assert_true(set.segment == i / 5 && set.session == 0);
    }
    sst_recording_close(rec);
    strcat(dir, "b");
    cfg.segment_s = 0;
    cfg.segment_bytes = 1; /* reached by every set */
    assert_int_equal(sst_recorder_close(record(&s, &cfg, 0, 4)), 0);
    assert_recording(dir, &s, 4);
    assert_true(sst_path_exists(in(dir, "segments/000003.mkv")) && !sst_path_exists(in(dir, "segments/000004.mkv")));
    /* A file that is there already is never written to. */
    cfg.append = true;
    r = record(&s, &cfg, 4, 5);
    assert_int_equal(sst_file_write(in(dir, "segments/000005.mkv"), "left", 4), 0);
    synthetic_set(&s, 5, &next);
    assert_int_equal(sst_recorder_write(r, &next), 0);
    assert_int_equal(sst_recorder_close(r), 0);
    assert_recording(dir, &s, 6);
    assert_int_equal(size_of(in(dir, "segments/000005.mkv")), 4);
    synthetic_fini(&s);
}

#if WITH_AVFORMAT
/* Segment 0 as any program with libavformat sees it: the same bytes at the same milliseconds. */
static void others_read_it(void **state)
{
    struct synthetic s = { .cameras = 4,
                           .fourcc = V4L2_PIX_FMT_YUYV,
                           .width = 8,
                           .height = 6,
                           .bytes = 96,
                           .period_ns = 100000000,
                           .exact = true };
    struct sst_recorder_config cfg = synthetic_config(&s, dir);
    AVFormatContext *format = NULL;
    AVPacket *packet = av_packet_alloc();
    uint8_t want[96];
    int n = 0;

    (void)state;
    synthetic_init(&s);
    cfg = synthetic_config(&s, dir);
    assert_int_equal(sst_recorder_close(record(&s, &cfg, 0, 5)), 0);
    assert_int_equal(avformat_open_input(&format, in(dir, "segments/000000.mkv"), NULL, NULL), 0);
    assert_true(avformat_find_stream_info(format, NULL) >= 0);
    assert_int_equal(format->nb_streams, 4);
    assert_int_equal(format->streams[3]->codecpar->codec_id, AV_CODEC_ID_RAWVIDEO);
    assert_int_equal(format->streams[3]->codecpar->format, AV_PIX_FMT_YUYV422);
    while (av_read_frame(format, packet) >= 0) {
        const int index = n / 4, k = packet->stream_index;

        synthetic_fill(want, sizeof(want), (uint64_t)index, k);
        assert_int_equal(packet->size, sizeof(want));
        assert_memory_equal(packet->data, want, sizeof(want));
        assert_int_equal(packet->pts, index * 100);
        av_packet_unref(packet);
        n++;
    }
    assert_int_equal(n, 20);
    avformat_close_input(&format);
    av_packet_free(&packet);
    synthetic_fini(&s);
}
#endif

static void goes_on(void **state)
{
    struct synthetic s = small();
    struct sst_recorder_config cfg = synthetic_config(&s, dir), wrong;
    struct sst_recorder_track moved[3];
    struct sst_recording_set set;
    struct sst_recording *rec;
    struct sst_recorder *r, *second;

    (void)state;
    cfg.append = true; /* of nothing: a new one */
    assert_int_equal(sst_recorder_close(record(&s, &cfg, 0, 3)), 0);
    r = record(&s, &cfg, 3, 5);
    assert_int_equal(sst_recorder_open(&second, &cfg), -EBUSY);
    assert_int_equal(sst_recorder_close(r), 0);
    assert_recording(dir, &s, 5);
    assert_int_equal(sst_recording_open(&rec, dir), 0);
    assert_int_equal(sst_recording_set(rec, 4, &set), 0);
    assert_true(set.session == 1 && set.segment == 1);
    sst_recording_close(rec);

    wrong = cfg;
    wrong.append = false;
    assert_int_equal(sst_recorder_open(&r, &wrong), -EEXIST);
    assert_non_null(strstr(said, "append"));
    wrong = cfg;
    wrong.width = 9;
    assert_int_equal(sst_recorder_open(&r, &wrong), -EEXIST);
    assert_non_null(strstr(said, "another folder"));
    wrong = cfg;
    memcpy(moved, cfg.tracks, sizeof(moved));
    strcpy(moved[1].serial, "S999");
    wrong.tracks = moved;
    assert_int_equal(sst_recorder_open(&r, &wrong), -EEXIST);
    assert_non_null(strstr(said, "S999"));
    assert_recording(dir, &s, 5);
    synthetic_fini(&s);
}

/* A set in the middle that the disk has lost is reported by its number; the others are there. */
static void tells_damage(void **state)
{
    struct synthetic s = small();
    struct sst_recorder_config cfg = synthetic_config(&s, dir);
    struct sst_recording_set set;
    struct sst_recording *r;
    uint8_t byte, *data;
    char *text;
    int cam, fd;

    (void)state;
    assert_int_equal(sst_recorder_close(record(&s, &cfg, 0, 4)), 0);
    assert_int_equal(sst_recording_open(&r, dir), 0);
    assert_int_equal(sst_recording_set(r, 1, &set), 0);
    fd = open(in(dir, "segments/000000.mkv"), O_RDWR);
    assert_int_equal(pread(fd, &byte, 1, set.frame[2].offset), 1);
    byte ^= 1;
    assert_int_equal(pwrite(fd, &byte, 1, set.frame[2].offset), 1);
    close(fd);
    assert_int_equal(sst_recording_check(r, 1, &cam), -EBADMSG);
    assert_int_equal(cam, 2);
    assert_int_equal(sst_recording_frame(r, &set, 2, &data), -EBADMSG);
    assert_int_equal(sst_recording_frame(r, &set, 1, &data), 0);
    free(data);
    for (int i = 0; i < 4; i++)
        assert_true(i == 1 || !sst_recording_check(r, i, &cam));
    assert_int_equal(sst_recording_line(r, 2, &text), 0);
    sst_recording_close(r);

    /* One letter of the line of set 2. */
    fd = open(in(dir, "sets.jsonl"), O_RDWR);
    assert_int_equal(sst_file_read(in(dir, "sets.jsonl"), 1 << 20, &data, &(size_t){ 0 }), 0);
    assert_int_equal(pwrite(fd, "9", 1, strstr((char *)data, text) - (char *)data + 12), 1);
    close(fd);
    free(data);
    free(text);
    assert_int_equal(sst_recording_open(&r, dir), 0);
    assert_int_equal(sst_recording_sets(r), 4);
    assert_int_equal(sst_recording_set(r, 2, &set), -EBADMSG);
    assert_int_equal(sst_recording_check(r, 2, &cam), -EBADMSG);
    assert_int_equal(cam, -1);
    assert_set(r, 3, &s, 3);
    sst_recording_close(r);

    /* Going on keeps good frames behind the damage. */
    cfg.append = true;
    assert_int_equal(sst_recorder_close(record(&s, &cfg, 4, 5)), 0);
    assert_int_equal(sst_recording_open(&r, dir), 0);
    assert_int_equal(sst_recording_sets(r), 5);
    assert_set(r, 4, &s, 4);
    sst_recording_close(r);
    assert_int_equal(unlink(in(dir, "segments/000000.mkv")), 0);
    assert_int_equal(sst_recording_open(&r, dir), 0);
    assert_int_equal(sst_recording_check(r, 0, &cam), -EBADMSG);
    assert_int_equal(sst_recording_check(r, 4, &cam), 0);
    sst_recording_close(r);
    synthetic_fini(&s);
}

static void refuses(void **state)
{
    struct synthetic s = small();
    const struct sst_recorder_config good = synthetic_config(&s, dir);
    struct sst_recorder_config cfg = good;
    struct sst_recording *rec;
    struct sst_recorder *r;
    struct sst_frameset set;

    (void)state;
    cfg.fourcc = V4L2_PIX_FMT_NV12;
    assert_int_equal(sst_recorder_open(&r, &cfg), -EINVAL);
    assert_non_null(strstr(said, "NV12"));
    cfg = good;
    cfg.cameras = 7; /* on 1x6 */
    assert_int_equal(sst_recorder_open(&r, &cfg), -EINVAL);
    cfg = good;
    cfg.sync_s = -1;
    assert_int_equal(sst_recorder_open(&r, &cfg), -EINVAL);
    assert_false(sst_path_exists(dir));
    cfg = good;
    cfg.dir = in(top, "none/there");
    assert_int_equal(sst_recorder_open(&r, &cfg), -EIO);
    cfg.dir = "/dev/null";
    assert_int_equal(sst_recorder_open(&r, &cfg), -EEXIST);

    r = record(&s, &good, 0, 1);
    synthetic_set(&s, 1, &set);
    set.frame[1]->fourcc = V4L2_PIX_FMT_GREY;
    assert_int_equal(sst_recorder_write(r, &set), -EINVAL);
    synthetic_set(&s, 1, &set);
    set.cameras = 2;
    assert_int_equal(sst_recorder_write(r, &set), -EINVAL);
    assert_int_equal(sst_recorder_close(r), 0);
    assert_recording(dir, &s, 1);
    assert_int_equal(sst_recorder_close(NULL), 0);

    assert_int_equal(sst_recording_open(&rec, top), -ENOENT);
    assert_non_null(strstr(said, "recording.json"));
    assert_int_equal(sst_file_write(in(dir, "recording.json"), "{\"format\":\"other\"}", 18), 0);
    assert_int_equal(sst_recording_open(&rec, dir), -EBADMSG);
    synthetic_fini(&s);
}

/* Segments of four sets; the first goes, and once more while a recorder is at work, and after a kill. */
static void begins_later(void **state)
{
    struct synthetic s = small();
    struct sst_recorder_config cfg = synthetic_config(&s, dir);
    struct sst_recording_removed removed;
    struct sst_recorder *recorder;
    struct sst_recording *r;
    int64_t bytes, before;
    int cam;

    (void)state;
    cfg.segment_s = 4 * (double)s.period_ns * 1e-9 - 0.001;
    assert_int_equal(sst_recorder_close(record(&s, &cfg, 0, 20)), 0);
    assert_int_equal(sst_recording_segments(dir), 5);
    before = size_of(in(dir, "segments/000000.mkv"));
    assert_int_equal(sst_recording_trim(dir, 4, &removed, &bytes), 0);
    assert_true(removed.before_segment == 1 && removed.sets == 4 && bytes >= before && bytes < before + 4096);
    assert_true(removed.wall_ns >= SYNTHETIC_WALL_NS + 3 * s.period_ns);
    assert_true(removed.wall_ns <= SYNTHETIC_WALL_NS + 4 * s.period_ns);
    assert_int_equal(size_of(in(dir, "segments/000000.mkv")), -1);
    assert_int_equal(sst_recording_trim(dir, 4, &removed, &bytes), -ENODATA);
    assert_int_equal(sst_recording_open(&r, dir), 0);
    assert_int_equal(sst_recording_sets(r), 16);
    for (int i = 0; i < 16; i++)
        assert_set(r, i, &s, (uint64_t)i + 4);
    assert_int_equal(sst_recording_removed(r)->sets, 4);
    sst_recording_close(r);

    cfg.append = true; /* sets follow, and some go meanwhile */
    recorder = record(&s, &cfg, 20, 22);
    assert_int_equal(sst_recording_trim(dir, 2, &removed, &bytes), 0);
    assert_int_equal(removed.sets, 8);
    for (int i = 0; i < 3; i++)
        assert_int_equal(sst_recording_trim(dir, 2, &removed, &bytes), i < 2 ? 0 : -ENODATA);
    assert_int_equal(sst_recorder_close(recorder), 0);
    assert_int_equal(sst_recording_open(&r, dir), 0);
    assert_int_equal(sst_recording_sets(r), 6);
    for (int i = 0; i < 6; i++)
        assert_set(r, i, &s, (uint64_t)i + 16);
    sst_recording_close(r);

    /* Killed after the removal of all was noted: later sets do not count as removed. */
    assert_int_equal(sst_file_write(in(dir, "removed.json"),
                                    "{\"format\":\"sst-recording-removed\",\"version\":1,\"before_segment\":99,"
                                    "\"sets\":22,\"t_ns\":0,\"wall_ns\":0}",
                                    97),
                     0);
    assert_int_equal(sst_recording_open(&r, dir), 0);
    assert_int_equal(sst_recording_sets(r), 0);
    sst_recording_close(r);
    assert_int_equal(sst_recorder_close(record(&s, &cfg, 0, 2)), 0);
    assert_int_equal(sst_recording_open(&r, dir), 0);
    assert_int_equal(sst_recording_sets(r), 2);
    assert_int_equal(sst_recording_check(r, 1, &cam), 0);
    sst_recording_close(r);
    synthetic_fini(&s);
}

static void damage_the_note(int how, const char *good, size_t size)
{
    const char *path = in(dir, "removed.json");
    char *zeros = calloc(1, 100000);

    assert_non_null(zeros);
    assert_int_equal(unlink(path), 0);
    switch (how) {
    case 0: /* as a power cut leaves it on some disks */
        assert_int_equal(sst_file_write(path, "", 0), 0);
        break;
    case 1:
        assert_int_equal(sst_file_write(path, zeros, size), 0);
        break;
    case 2:
        assert_int_equal(sst_file_write(path, good, size / 2), 0);
        break;
    case 3:
        assert_int_equal(sst_file_write(path, "{}", 2), 0);
        break;
    case 4:
        assert_int_equal(sst_file_write(path, zeros, 100000), 0);
        break;
    case 5:
        assert_int_equal(mkdir(path, 0777), 0);
        break;
    default:
        assert_int_equal(symlink("nowhere", path), 0);
        break;
    }
    free(zeros);
}

/* The contents of removed.json are derived from the files that are there. */
static void a_damaged_note_costs_nothing(void **state)
{
    struct synthetic s = small();
    struct sst_recorder_config cfg = synthetic_config(&s, dir);
    struct sst_recording_removed said_before, removed;
    struct sst_recording *r;
    int64_t bytes;
    uint8_t *good;
    size_t size;
    int cam;

    (void)state;
    cfg.segment_s = 4 * (double)s.period_ns * 1e-9 - 0.001;
    assert_int_equal(sst_recorder_close(record(&s, &cfg, 0, 20)), 0);
    assert_int_equal(sst_recording_trim(dir, 1, &removed, &bytes), 0);
    assert_int_equal(sst_recording_trim(dir, 1, &said_before, &bytes), 0);
    assert_int_equal(sst_file_read(in(dir, "removed.json"), 4096, &good, &size), 0);
    for (int how = 0; how <= 6; how++) {
        damage_the_note(how, (const char *)good, size);
        said[0] = 0;
        assert_int_equal(sst_recording_open(&r, dir), 0);
        assert_string_equal(said, ""); /* a warning, and no error beside it */
        assert_int_equal(sst_recording_sets(r), 12);
        for (int i = 0; i < 12; i++)
            assert_set(r, i, &s, (uint64_t)i + 8);
        removed = *sst_recording_removed(r);
        assert_true(removed.assumed && removed.before_segment == 2 && removed.sets == 8);
        assert_true(removed.t_ns == said_before.t_ns && removed.wall_ns == said_before.wall_ns);
        sst_recording_close(r);
        if (how < 5) {
            assert_int_equal(sst_recording_write_removed(dir, &removed), 0);
            assert_int_equal(sst_recording_read_removed(dir, &removed), 0);
            assert_true(!removed.assumed && removed.before_segment == 2 && removed.sets == 8);
        } else {
            assert_int_equal(remove(in(dir, "removed.json")), 0);
            assert_int_equal(sst_file_write(in(dir, "removed.json"), good, size), 0);
        }
    }
    /* A gap in the middle stays damage. */
    assert_int_equal(unlink(in(dir, "segments/000003.mkv")), 0);
    damage_the_note(0, NULL, 0);
    assert_int_equal(sst_recording_open(&r, dir), 0);
    assert_int_equal(sst_recording_sets(r), 12);
    assert_int_equal(sst_recording_check(r, 3, &cam), 0);
    assert_int_equal(sst_recording_check(r, 4, &cam), -EBADMSG);
    assert_int_equal(sst_recording_check(r, 8, &cam), 0);
    sst_recording_close(r);
    /* Resuming repairs it, and so does trimming. */
    assert_int_equal(sst_recording_trim(dir, 1, &removed, &bytes), 0);
    assert_true(removed.before_segment == 3 && removed.sets == 12);
    assert_int_equal(sst_recording_read_removed(dir, &removed), 0);
    assert_true(!removed.assumed && removed.sets == 12);
    free(good);
    synthetic_fini(&s);
}

/* Nothing was removed, or nothing is there: then nothing is assumed to be gone. */
static void a_damaged_note_of_a_whole_recording(void **state)
{
    struct synthetic s = small();
    const struct sst_recorder_config cfg = synthetic_config(&s, dir);
    struct sst_recording *r;

    (void)state;
    assert_int_equal(sst_recorder_close(record(&s, &cfg, 0, 20)), 0);
    assert_int_equal(sst_file_write(in(dir, "removed.json"), "{", 1), 0);
    assert_recording(dir, &s, 20);
    sst_path_remove_tree(in(dir, "segments"));
    assert_int_equal(sst_recording_open(&r, dir), 0);
    assert_int_equal(sst_recording_sets(r), 20); /* each of them damaged */
    assert_true(sst_recording_removed(r)->assumed && !sst_recording_removed(r)->before_segment);
    sst_recording_close(r);
    synthetic_fini(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(reads_element_heads),
        TEST(lines_are_read_strictly),
        TEST(round_trip),
        TEST(odd_frames),
        TEST(rolls_over),
#if WITH_AVFORMAT
        TEST(others_read_it),
#endif
        TEST(goes_on),
        TEST(tells_damage),
        TEST(begins_later),
        TEST(a_damaged_note_costs_nothing),
        TEST(a_damaged_note_of_a_whole_recording),
        TEST(refuses),
    };
    const int rc = begin_tests(WITH_AVFORMAT);

    return rc ? rc : cmocka_run_group_tests(tests, NULL, remove_all);
}
