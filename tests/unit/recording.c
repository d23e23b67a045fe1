/* daemon/recording: what is recorded is read back byte for byte, whatever was cut off, refused or failed in between. */
#include <errno.h>
#include <fcntl.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <linux/videodev2.h>

#include <cmocka.h>

#if WITH_AVFORMAT
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#endif

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "daemon/recording/ebml.h"
#include "daemon/recording/recording.h"
#include "daemon/recording/setlist.h"
#include "tests/synthetic_sets.h"

#define DEADLINE_S 300 /* of the whole program, also under a sanitizer on a busy machine */

static char top[] = "/tmp/sst-recording-XXXXXX";
static char dir[SST_PATH_MAX]; /* of one test */
static char said[SST_LOG_MAX]; /* the last error */

static const char *in(const char *folder, const char *name)
{
    static char path[8][SST_PATH_MAX];
    static int next;

    next = (next + 1) % 8;
    assert_int_equal(sst_path_join(path[next], folder, name), 0);
    return path[next];
}

static int each_setup(void **state)
{
    static int n;

    (void)state;
    snprintf(dir, sizeof(dir), "%s/%d", top, n++);
    said[0] = 0;
    sst_log_hold_errors(said);
    return 0;
}

static int each_teardown(void **state)
{
    (void)state;
    sst_log_hold_errors(NULL);
    return 0;
}

/* --- faults: the system's calls, made to fail ------------------------------------------------------------------------ */

static _Atomic int fail_in = -1; /* writes until one fails; below 0: none will */
static _Atomic int fail_many;    /* that many fail in a row */
static _Atomic int fail_errno;   /* 0: half of the bytes are written, and the rest at the next call */
static _Atomic int writes;
static _Atomic int sync_errno; /* of fdatasync, while not 0 */

ssize_t pwrite(int fd, const void *data, size_t n, off_t offset)
{
    writes++;
    if (fail_in >= 0 && fail_in-- <= 0 && fail_many-- > 0) {
        fail_in = 0;
        if (fail_errno) {
            errno = fail_errno;
            return -1;
        }
        n = (n + 1) / 2;
    }
    return syscall(SYS_pwrite64, fd, data, n, offset);
}

int fdatasync(int fd SST_UNUSED)
{
    if (sync_errno) {
        errno = sync_errno;
        return -1;
    }
    return 0; /* the disk has time; the test has not */
}

int fsync(int fd SST_UNUSED)
{
    return 0;
}

/* --- helpers -------------------------------------------------------------------------------------------------------- */

static struct synthetic small(void)
{
    struct synthetic s = { .cameras = 3, .fourcc = V4L2_PIX_FMT_MJPEG, .width = 8, .height = 6, .bytes = 40,
                           .period_ns = 100000000 };

    synthetic_init(&s);
    return s;
}

static struct sst_recorder *record(struct synthetic *s, const struct sst_recorder_config *cfg, int from, int to)
{
    struct sst_recorder *r;

    assert_int_equal(sst_recorder_open(&r, cfg), 0);
    for (int i = from; i < to; i++) {
        struct sst_set set;

        synthetic_set(s, (uint64_t)i, &set);
        assert_int_equal(sst_recorder_write(r, &set), 0);
    }
    return r;
}

/* Is set i of a recording the one that was written with this index? */
static void assert_set(const struct sst_recording *r, int i, struct synthetic *s, uint64_t index)
{
    struct sst_recording_set set;
    uint8_t *want = malloc(s->bytes), *data;

    assert_non_null(want);
    assert_int_equal(sst_recording_set(r, i, &set), 0);
    assert_int_equal(set.index, index);
    assert_int_equal(set.t_ns, SYNTHETIC_START_NS + (int64_t)index * s->period_ns);
    assert_int_equal(set.wall_ns, SYNTHETIC_WALL_NS + (int64_t)index * s->period_ns);
    assert_true(set.edge);
    assert_int_equal(set.skew.spread_ns, 3999);
    assert_int_equal(set.skew.from_edge_ns, -2000);
    for (int k = 0; k < s->cameras; k++) {
        const struct sst_recording_frame *f = &set.frame[k];

        assert_int_equal(f->present, !synthetic_missing(s, index, k));
        if (!f->present) {
            assert_int_equal(sst_recording_frame(r, &set, k, &data), -ENODATA);
            continue;
        }
        assert_int_equal(f->bytes, synthetic_bytes(s, index, k));
        assert_int_equal(f->sequence, index + 7);
        assert_int_equal(f->t_ns, set.t_ns + synthetic_dt_ns(index, k));
        assert_int_equal(f->arrival_ns, f->t_ns + 30000000 + k);
        assert_int_equal(sst_recording_frame(r, &set, k, &data), 0);
        synthetic_fill(want, f->bytes, index, k);
        assert_memory_equal(data, want, f->bytes);
        free(data);
    }
    free(want);
}

/* The recording holds sets 0 .. n-1, all good. */
static void assert_recording(const char *at, struct synthetic *s, int n)
{
    struct sst_recording *r;

    assert_int_equal(sst_recording_open(&r, at), 0);
    assert_int_equal(sst_recording_sets(r), n);
    for (int i = 0; i < n; i++)
        assert_set(r, i, s, (uint64_t)i);
    sst_recording_close(r);
}

static int64_t size_of(const char *path)
{
    struct stat st;

    return stat(path, &st) ? -1 : (int64_t)st.st_size;
}

static void copy_file(const char *from, const char *to)
{
    uint8_t *data;
    size_t n;
    FILE *f = fopen(to, "wb");

    assert_non_null(f);
    assert_int_equal(sst_file_read(from, 1 << 24, &data, &n), 0);
    assert_int_equal(fwrite(data, 1, n, f), n);
    fclose(f);
    free(data);
}

/* A copy of the recording in `dir`, of one segment. */
static void copy_recording(const char *to)
{
    assert_int_equal(mkdir(to, 0777), 0);
    assert_int_equal(mkdir(in(to, "segments"), 0777), 0);
    copy_file(in(dir, "recording.json"), in(to, "recording.json"));
    copy_file(in(dir, "sets.jsonl"), in(to, "sets.jsonl"));
    copy_file(in(dir, "segments/000000.mkv"), in(to, "segments/000000.mkv"));
}

/* --- tests ---------------------------------------------------------------------------------------------------------- */

static void reads_element_heads(void **state)
{
    static const uint8_t cluster[] = { 0x1F, 0x43, 0xB6, 0x75, 0x01, 0, 0, 0, 0, 0, 0x10, 0x02 };
    static const uint8_t open_end[] = { 0x18, 0x53, 0x80, 0x67, 0x01, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF };
    static const uint8_t block[] = { 0xA3, 0x40, 0x85 };
    struct sst_ebml e;

    (void)state;
    assert_int_equal(sst_ebml_head(cluster, sizeof(cluster), &e), 0);
    assert_true(e.id == SST_EBML_CLUSTER && e.size == 0x1002 && e.head == 12);
    assert_int_equal(sst_ebml_head(open_end, sizeof(open_end), &e), 0);
    assert_true(e.id == SST_EBML_SEGMENT && e.size == SST_EBML_UNKNOWN);
    assert_int_equal(sst_ebml_head(block, sizeof(block), &e), 0);
    assert_true(e.id == SST_EBML_SIMPLE_BLOCK && e.size == 0x85 && e.head == 3);
    for (size_t n = 0; n < sizeof(cluster); n++)
        assert_int_equal(sst_ebml_head(cluster, n, &e), -EBADMSG);
    assert_int_equal(sst_ebml_head((const uint8_t[]){ 0x00, 0x81 }, 2, &e), -EBADMSG);
    assert_int_equal(sst_ebml_head((const uint8_t[]){ 0xA3, 0x00 }, 2, &e), -EBADMSG);
}

#define SET_HEAD "{\"set\":1,\"t_ns\":5,\"wall_ns\":6,\"edge\":true,\"spread_ns\":0,\"from_edge_ns\":0,\"worst_cam\":-1,"

/* Lines whose checksum is right and whose content is not, as another program could write them. */
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
        { -EBADMSG, "{\"segment\":-1,\"session\":1,\"start_ns\":5}" },
        { -EBADMSG, "{\"segment\":1,\"session\":1,\"start_ns\":\"5\"}" },
        { -EBADMSG, "{\"set\":1}" },
        { -EBADMSG, SET_HEAD "\"frames\":7,\"missing\":[0,1]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[],\"missing\":[0]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[[2,7,0,-2,9,100,40,0,0,1]],\"missing\":[0]}" },  /* no such camera */
        { -EBADMSG, SET_HEAD "\"frames\":[[-1,7,0,-2,9,100,40,0,0,1]],\"missing\":[0]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[[1,7,0,-2,9,100,40,0,0,1],[1,7,0,-2,9,100,40,0,0,1]],\"missing\":[]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[[1,7,0,-2,9,-1,40,0,0,1]],\"missing\":[0]}" },   /* bytes, but nowhere */
        { -EBADMSG, SET_HEAD "\"frames\":[[1,7,0,-2,9,9223372036854775807,40,0,0,1]],\"missing\":[0]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[[1,7,0,-2,9,100,4294967296,0,0,1]],\"missing\":[0]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[[1,7,0,-2,9,100,40,0,0,4294967296]],\"missing\":[0]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[[1,7,0,9223372036854775807,9,100,40,0,0,1]],\"missing\":[0]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[[1,7,0,-2.5,9,100,40,0,0,1]],\"missing\":[0]}" },
        { -EBADMSG, SET_HEAD "\"frames\":[[1,7,0,-2,9,100,40,0,0]],\"missing\":[0]}" },
    };
    struct sst_setlist_segment segment;
    struct sst_recording_set set;

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        const int got = sst_setlist_parse(cases[i].line, strlen(cases[i].line), 2, &segment, &set);

        if (got != cases[i].want)
            fail_msg("%d, not %d: %s", got, cases[i].want, cases[i].line);
    }
    assert_true(segment.segment == 3 && segment.session == 1 && segment.start_ns == -5);
    assert_true(set.present == 1 && set.frame[1].t_ns == 3 && set.frame[1].arrival_ns == 12 &&
                set.frame[1].crc32 == UINT32_MAX && set.frame[1].offset == 100 && set.frame[1].bytes == 40);
    /* The checksum is zlib.crc32(b'{"a":1') of Python. */
    assert_true(sst_setlist_line_whole("{\"a\":1,\"crc\":\"a702fc6e\"}", 24));
    assert_false(sst_setlist_line_whole("{\"a\":2,\"crc\":\"a702fc6e\"}", 24));
    assert_false(sst_setlist_line_whole("", 0));
}

static void round_trip(void **state)
{
    static const struct {
        uint32_t fourcc;
        int cameras, width, height;
        size_t bytes;
    } cases[] = {
        { V4L2_PIX_FMT_MJPEG, 36, 640, 480, 5000 },  { V4L2_PIX_FMT_YUYV, 4, 64, 48, 64 * 48 * 2 },
        { V4L2_PIX_FMT_GREY, 2, 7, 5, 35 },          { V4L2_PIX_FMT_Y16, 2, 7, 5, 70 },
        { V4L2_PIX_FMT_SBGGR8, 2, 1, 1, 1 },         { V4L2_PIX_FMT_SGBRG8, 1, 33, 17, 33 * 17 },
        { V4L2_PIX_FMT_SGRBG8, 7, 9, 3, 27 },        { V4L2_PIX_FMT_SRGGB8, 256, 5, 5, 25 },
    };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        struct synthetic s = { .fourcc = cases[i].fourcc, .cameras = cases[i].cameras, .width = cases[i].width,
                               .height = cases[i].height, .bytes = cases[i].bytes, .period_ns = 100000000,
                               .holes = true, .exact = cases[i].fourcc != V4L2_PIX_FMT_MJPEG };
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
    struct sst_set set;
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
    struct sst_recorder_counters c;
    struct sst_recording_set set;
    struct sst_recording *rec;
    struct sst_recorder *r;
    struct sst_set next;

    (void)state;
    cfg.segment_s = 0.5; /* five sets of 100 ms */
    r = record(&s, &cfg, 0, 12);
    sst_recorder_counters(r, &c);
    assert_int_equal(sst_recorder_close(r), 0);
    assert_true(c.sets == 12 && c.segments == 3 && c.dropped == 0);
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
/* What any program with libavformat sees of segment 0: the same bytes at the same milliseconds. */
static void others_read_it(void **state)
{
    struct synthetic s = { .cameras = 4, .fourcc = V4L2_PIX_FMT_YUYV, .width = 8, .height = 6, .bytes = 96,
                           .period_ns = 100000000, .exact = true };
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

/* A recorder that is killed: nothing is finished, nothing is closed. */
static void record_and_die(struct synthetic *s, const struct sst_recorder_config *cfg, int n)
{
    struct sst_recorder_config own = *cfg;
    const pid_t pid = fork();
    int status;

    assert_true(pid >= 0);
    if (!pid) {
        struct sst_recorder *r;

        own.sync_s = 0; /* no thread in a forked child */
        if (sst_recorder_open(&r, &own))
            _exit(1);
        for (int i = 0; i < n; i++) {
            struct sst_set set;

            synthetic_set(s, (uint64_t)i, &set);
            if (sst_recorder_write(r, &set))
                _exit(1);
        }
        _exit(0);
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_int_equal(status, 0);
}

/* Cut a copy's files at these lengths; it then reads as n good sets, and two more can follow. */
static void assert_cut(struct synthetic *s, const struct sst_recorder_config *cfg, int64_t segment, int64_t list, int n)
{
    struct sst_recorder_config own = *cfg;
    struct sst_recording *r;
    char at[SST_PATH_MAX];
    int cam;

    assert_int_equal(sst_path_join(at, top, "cut"), 0);
    copy_recording(at);
    assert_int_equal(truncate(in(at, "segments/000000.mkv"), segment), 0);
    assert_int_equal(truncate(in(at, "sets.jsonl"), list), 0);
    assert_int_equal(sst_recording_open(&r, at), 0);
    assert_true(sst_recording_sets(r) == n || sst_recording_sets(r) == n + 1);
    for (int i = 0; i < n; i++)
        assert_set(r, i, s, (uint64_t)i);
    if (sst_recording_sets(r) > n)
        assert_int_equal(sst_recording_check(r, n, &cam), -EBADMSG);
    sst_recording_close(r);
    own.dir = at;
    own.append = true;
    own.sync_s = 0;
    assert_int_equal(sst_recorder_close(record(s, &own, n, n + 2)), 0);
    assert_recording(at, s, n + 2);
    sst_path_remove_tree(at);
}

static void survives_a_torn_end(void **state)
{
    struct synthetic s = small();
    struct sst_recorder_config cfg = synthetic_config(&s, dir);
    struct sst_recording_set set;
    struct sst_recording *r;
    int64_t list, segment, list_before = 0, segment_before = 0;
    uint8_t *text;
    size_t n;

    (void)state;
    record_and_die(&s, &cfg, 3);
    assert_recording(dir, &s, 3);
    assert_int_equal(sst_file_read(in(dir, "sets.jsonl"), 1 << 20, &text, &n), 0);
    list = (int64_t)n;
    for (size_t i = 0; i + 1 < n; i++)
        list_before = text[i] == '\n' ? (int64_t)i + 1 : list_before;
    free(text);
    segment = size_of(in(dir, "segments/000000.mkv"));
    assert_int_equal(sst_recording_open(&r, dir), 0);
    assert_int_equal(sst_recording_set(r, 1, &set), 0);
    for (int k = 0; k < 3; k++)
        segment_before = set.frame[k].offset + (int64_t)set.frame[k].bytes > segment_before
                             ? set.frame[k].offset + (int64_t)set.frame[k].bytes : segment_before;
    sst_recording_close(r);
    assert_true(segment > segment_before + 3 && list > list_before + 100);
    assert_cut(&s, &cfg, segment, list, 3);
    for (int64_t at = list_before; at < list; at++)
        assert_cut(&s, &cfg, segment, at, 2);
    for (int64_t at = segment_before; at < segment; at++)
        assert_cut(&s, &cfg, at, at % 2 ? list : list_before, 2);
    synthetic_fini(&s);
}

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

/* A set in the middle that the disk has lost is told by its number; the others are there. */
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

    /* Going on keeps what is good behind the damage. */
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

/* Write n sets into `at` while the write number `nth` and those behind it fail. @return the sets that were taken */
static int write_with_fault(struct synthetic *s, const char *at, int nth, int many, int err, bool taken[])
{
    struct sst_recorder_config cfg = synthetic_config(s, at);
    struct sst_recorder_counters c;
    struct sst_recorder *r;
    int count = 0;

    cfg.sync_s = 0;
    cfg.segment_bytes = 1000; /* of about three sets: faults meet heads, sets, ends */
    assert_int_equal(sst_recorder_open(&r, &cfg), 0);
    writes = 0;
    fail_errno = err;
    fail_many = many;
    fail_in = nth;
    for (int i = 0; i < 10; i++) {
        struct sst_set set;
        int e;

        synthetic_set(s, (uint64_t)i, &set);
        e = sst_recorder_write(r, &set);
        assert_true(!e || e == (err == EIO ? -EIO : err == EROFS ? -EROFS : -ENOSPC));
        taken[i] = !e;
        count += !e;
    }
    fail_in = -1;
    sst_recorder_counters(r, &c);
    assert_true(c.sets == (uint64_t)count && c.dropped == (uint64_t)(10 - count));
    (void)sst_recorder_close(r);
    return count;
}

/* Every single write fails once, in each way: what was taken is there, what was refused is not, and it goes on. */
static void a_write_fails(void **state)
{
    static const int errors[] = { 0, EIO, ENOSPC, EROFS, EFBIG };
    struct synthetic s = small();
    bool taken[10];
    int total;

    (void)state;
    strcat(dir, "x");
    assert_int_equal(write_with_fault(&s, dir, -1, 0, 0, taken), 10);
    total = writes;
    assert_true(total > 30);
    for (size_t e = 0; e < ARRAY_LEN(errors); e++) {
        for (int nth = 0; nth < total; nth++) {
            struct sst_recording *r;
            int count, n = 0;

            sst_path_remove_tree(dir);
            said[0] = 0;
            count = write_with_fault(&s, dir, nth, 1, errors[e], taken);
            assert_true(count >= (errors[e] ? 9 : 10));
            assert_int_equal(count < 10, said[0] != 0);
            assert_int_equal(sst_recording_open(&r, dir), 0);
            assert_int_equal(sst_recording_sets(r), count);
            assert_int_equal(sst_recording_torn_bytes(r), 0);
            for (int i = 0; i < 10; i++) {
                if (taken[i])
                    assert_set(r, n++, &s, (uint64_t)i);
            }
            sst_recording_close(r);
        }
    }
    synthetic_fini(&s);
}

/* A disk that stays full costs two attempts and then one each half second, and is told once. */
static void a_full_disk_is_told_once(void **state)
{
    struct synthetic s = small();
    struct sst_recorder_config cfg = synthetic_config(&s, dir);
    struct sst_recorder *r = record(&s, &cfg, 0, 2);
    struct sst_recorder_counters c;
    struct sst_set set;
    int64_t start;

    (void)state;
    fail_errno = ENOSPC;
    fail_many = 1 << 30;
    fail_in = 0;
    writes = 0;
    synthetic_set(&s, 2, &set);
    assert_int_equal(sst_recorder_write(r, &set), -ENOSPC);
    assert_non_null(strstr(said, "has stopped: No space left on device; free space there"));
    said[0] = 0;
    for (int i = 0; i < 10; i++)
        assert_int_equal(sst_recorder_write(r, &set), -ENOSPC);
    assert_true(writes <= 6);
    assert_int_equal(said[0], 0);
    fail_in = -1;
    start = sst_clock_now_ns();
    while (sst_recorder_write(r, &set)) {
        assert_true(sst_clock_now_ns() - start < 5000000000);
        usleep(10000);
    }
    sst_recorder_counters(r, &c);
    assert_true(c.sets == 3 && c.dropped >= 11 && c.segments == 2);
    assert_int_equal(sst_recorder_close(r), 0);
    assert_recording(dir, &s, 3);
    synthetic_fini(&s);
}

static void wait_for_syncs(struct sst_recorder *r, uint64_t n, bool failed)
{
    const int64_t start = sst_clock_now_ns();
    struct sst_recorder_counters c;

    do {
        usleep(1000);
        sst_recorder_counters(r, &c);
        assert_true(sst_clock_now_ns() - start < 20000000000);
    } while ((failed ? c.sync_failures : c.syncs) < n);
}

static void syncs_beside_the_writer(void **state)
{
    struct synthetic s = small();
    struct sst_recorder_config cfg = synthetic_config(&s, dir);
    struct sst_recorder_counters c;
    struct sst_recorder *r;
    struct sst_set set;

    (void)state;
    cfg.sync_s = 0.002;
    cfg.segment_bytes = 1000;
    r = record(&s, &cfg, 0, 30);
    wait_for_syncs(r, 3, false);
    sync_errno = EIO;
    wait_for_syncs(r, 2, true);
    sync_errno = 0;
    synthetic_set(&s, 30, &set); /* a new segment, nothing is lost */
    assert_int_equal(sst_recorder_write(r, &set), 0);
    sst_recorder_counters(r, &c);
    assert_true(c.sets == 31 && c.dropped == 0 && c.sync_max_ns > 0);
    assert_int_equal(sst_recorder_close(r), 0);
    assert_recording(dir, &s, 31);

    /* Where every set is synced, one that cannot be is not there. */
    strcat(dir, "b");
    cfg.sync_s = 0;
    r = record(&s, &cfg, 0, 2);
    sync_errno = EIO;
    synthetic_set(&s, 2, &set);
    assert_int_equal(sst_recorder_write(r, &set), -EIO);
    sync_errno = 0;
    assert_recording(dir, &s, 2);
    assert_int_equal(sst_recorder_write(r, &set), 0);
    assert_int_equal(sst_recorder_close(r), 0);
    assert_recording(dir, &s, 3);
    synthetic_fini(&s);
}

static void refuses(void **state)
{
    struct synthetic s = small();
    const struct sst_recorder_config good = synthetic_config(&s, dir);
    struct sst_recorder_config cfg = good;
    struct sst_recording *rec;
    struct sst_recorder *r;
    struct sst_set set;

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

static int remove_all(void **state)
{
    (void)state;
    sst_path_remove_tree(top);
    return 0;
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, each_setup, each_teardown)

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
        TEST(survives_a_torn_end),
        TEST(goes_on),
        TEST(tells_damage),
        TEST(a_write_fails),
        TEST(a_full_disk_is_told_once),
        TEST(syncs_beside_the_writer),
        TEST(refuses),
    };

    if (!WITH_AVFORMAT) {
        puts("built without libavformat: nothing can be recorded");
        return 77;
    }
    alarm(DEADLINE_S);
    sst_log_set_level(SST_LOG_ERROR); /* each warning comes many times */
    if (!mkdtemp(top))
        return 1;
    return cmocka_run_group_tests(tests, NULL, remove_all);
}
