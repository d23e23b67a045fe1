/* Downloads, whole and in parts, left-overs of a kill, and deletion. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <fcntl.h>

#include "daemon/storage/storage_internal.h"
#include "daemon/storage/video_internal.h"
#include "tests/storage_bench.h"

#if WITH_AVFORMAT
#include <libavformat/avformat.h>
#endif

#define MS  ((int64_t)1000000)
#define S   (1000 * MS)
#define DAY ((int64_t)86400 * 1000 * MS)
#define T0  (20600 * DAY) /* in 2026 */

int fdatasync(int fd SST_UNUSED)
{
    return 0; /* the disk has time; the test has not */
}

int fsync(int fd SST_UNUSED)
{
    return 0; /* a call that records is answered within a second, too */
}

/* --- archives ----------------------------------------------------------------------------------------------------- */

static void every_part_of_an_archive_is_that_part(void **state)
{
    static uint8_t whole[20000], part[20000];
    char line[SST_PATH_MAX * 5];
    struct tar t;
    ssize_t n;

    (void)state;
    assert_int_equal(mkdir(dir, 0777), 0);
    assert_int_equal(sst_file_write(in(dir, "a"), "0123456789", 10), 0);
    assert_int_equal(sst_file_write(in(dir, "empty"), "", 0), 0);
    assert_int_equal(mkdir(in(dir, "b"), 0777), 0);
    memset(part, 'x', 600);
    assert_int_equal(sst_file_write(in(dir, "b/c"), part, 600), 0);
    assert_int_equal(symlink("a", in(dir, "link")), 0);
    assert_int_equal(symlink("b", in(dir, "below")), 0);
    assert_int_equal(tar_open(&t, dir), 0);
    assert_in_range(t.bytes, 5 * 512, sizeof(whole));
    for (int64_t at = 0; at < t.bytes; at += n) {
        n = tar_read(&t, at, whole + at, sizeof(whole));
        assert_in_range(n, 1, t.bytes - at);
    }
    assert_int_equal(sst_file_write(in(top, "got.tar"), whole, (size_t)t.bytes), 0);
    snprintf(line, sizeof(line), "cd %s && mkdir x && tar xf got.tar -C x && rm %s/link %s/below && diff -r x/* %s",
             top, dir, dir, dir);
    assert_int_equal(system(line), 0);
    for (int64_t at = 0; at < t.bytes; at += 37) {
        n = tar_read(&t, at, part, 100);
        assert_in_range(n, 1, 100);
        assert_memory_equal(part, whole + at, n);
    }
    /* A file that is no longer as listed is an error; links are not followed. */
    assert_int_equal(truncate(in(dir, "b/c"), 300), 0);
    n = 0;
    for (int64_t at = 0; at < t.bytes && n >= 0; at += n)
        n = tar_read(&t, at, part, sizeof(part));
    assert_int_equal(n, -EBADMSG);
    assert_int_equal(symlink("a", in(dir, "link")), 0);
    assert_int_equal(symlink("b", in(dir, "below")), 0);
    assert_int_equal(open_below(t.folder, "link"), -ELOOP);
    assert_true(open_below(t.folder, "below/c") < 0);
    tar_close(&t);
}

static void lines_of_the_view_are_read_strictly(void **state)
{
    const struct video_line l = { -5, 1763748300000000000, 7, 123456789012, 4000 };
    static const char *const bad[] = { "",
                                       "{}",
                                       "{\"t_ns\":1,\"wall_ns\":1,\"set\":1,\"offset\":0,\"bytes\":0}\n",
                                       "{\"t_ns\":1,\"wall_ns\":1,\"set\":1,\"offset\":-1,\"bytes\":5}\n",
                                       "{\"t_ns\":1,\"wall_ns\":1,\"set\":1,\"offset\":0,\"bytes\":5",
                                       "{\"t_ns\":1,\"wall_ns\":1,\"set\":1,\"offset\":0,\"bytes\":5}" };
    char text[SST_VIDEO_LINE_MAX];
    struct video_line got;
    const size_t n = video_write_line(text, &l);

    (void)state;
    assert_int_equal(strlen(text), n);
    assert_true(video_read_line(text, &got));
    assert_memory_equal(&got, &l, sizeof(l));
    for (size_t i = 0; i < ARRAY_LEN(bad); i++)
        assert_false(video_read_line(bad[i], &got));
}

/* The view of a trimmed recording begins with the picture that was shown there. */
static void a_trimmed_view_begins_where_the_rest_does(void **state)
{
    static const uint8_t jpeg[] = { 0xff, 0xd8, 0xff, 0xc0, 0, 11, 8, 0, 120, 0,  160, 1,    1,    0x11,
                                    0,    0xff, 0xda, 0,    8, 1,  1, 0, 0,   63, 0,   0xff, 0xd9, 'x' };
    static const char removed[] = "{\"format\":\"sst-recording-removed\",\"version\":1,\"before_segment\":2,\"sets\":5,"
                                  "\"t_ns\":5500000000,\"wall_ns\":1763748305500000000}";
    struct video whole = { .frame = NULL }, rest = { .frame = NULL };
    FILE *pictures, *index;

    (void)state;
    assert_int_equal(mkdir(dir, 0777), 0);
    pictures = fopen(in(dir, SST_VIDEO_PICTURES), "wb");
    index = fopen(in(dir, SST_VIDEO_INDEX), "w");
    assert_true(pictures && index);
    for (int i = 0; i < 10; i++) {
        const int64_t n = (int64_t)sizeof(jpeg);
        const struct video_line l = { i * S, 1763748300000000000 + i * S, (uint64_t)i, i * n, n };
        char text[SST_VIDEO_LINE_MAX];

        assert_int_equal(fwrite(jpeg, 1, sizeof(jpeg), pictures), sizeof(jpeg));
        assert_true(fwrite(text, 1, video_write_line(text, &l), index) > 0);
    }
    fclose(pictures);
    fclose(index);
    assert_int_equal(video_of_view(&whole, dir), 0);
    assert_int_equal(whole.count, 10);
    assert_true(whole.format.width == 160 && whole.format.height == 120);
    assert_int_equal(sst_file_write(in(dir, "removed.json"), removed, sizeof(removed) - 1), 0);
    assert_int_equal(video_of_view(&rest, dir), 0);
    /* Pictures 5 (at 5.5 s now) to 9 of 0 to 9. */
    assert_int_equal(rest.count, 5);
    assert_int_equal(rest.bytes, 5 * sizeof(jpeg));
    assert_int_equal(rest.frame[0].t_ns, 5500 * MS);
    assert_int_equal(rest.frame[0].offset, 5 * sizeof(jpeg));
    assert_int_equal(rest.format.wall_ns, 1763748305500000000);
    video_fini(&rest);
    assert_int_equal(sst_file_write(in(dir, "removed.json"), "{}", 2), 0);
    assert_int_equal(video_of_view(&rest, dir), 0); /* no other file states the removed sets */
    assert_int_equal(rest.count, 10);
    video_fini(&rest);
    video_fini(&whole);
}

static struct store_entry scanned(void)
{
    struct catalog c = { 0 };
    struct store_entry e;

    assert_int_equal(store_scan(top, SST_STORE_RECORDING, true, &c), 0);
    assert_int_equal(c.count, 1);
    e = c.entry[0];
    catalog_fini(&c);
    return e;
}

/* Its storage.json is from when it began, or from before its beginning was removed; the limits go by the files that are
 * there. */
static void what_a_kill_left_is_measured(void **state)
{
    static const char removed[] = "{\"format\":\"sst-recording-removed\",\"version\":1,\"before_segment\":2,\"sets\":5,"
                                  "\"t_ns\":5500000000,\"wall_ns\":1763748305500000000}";
    static const char lines[] =
        "{\"segment\":0}\n{\"set\":0}\n{\"set\":1}\n{\"set\":2}\n{\"set\":3}\n"
        "{\"segment\":1}\n{\"set\":4}\n{\"set\":5}\n{\"set\":6}\n"
        "{\"segment\":2,\"session\":0,\"start_ns\":7500000000,\"wall_ns\":1763748307500000000,\"crc\":\"1e06bfad\"}\n";
    static const uint8_t segment[100000];
    struct sst_recording_removed now;
    struct store_entry e = { .order = 1, .why = "continuous", .stage = SST_STORE_TORN, .from_ns = T0, .to_ns = T0 };

    (void)state;
    assert_int_equal(mkdir(dir, 0777), 0);
    assert_int_equal(mkdir(in(dir, "segments"), 0777), 0);
    assert_int_equal(sst_file_write(in(dir, "segments/000002.mkv"), segment, sizeof(segment)), 0);
    assert_int_equal(store_write(dir, &e), 0);
    e = scanned();
    assert_true(e.stage == SST_STORE_TORN && e.from_ns == T0 && e.bytes == store_bytes(dir) && e.bytes > 100000);
    e.stage = SST_STORE_DONE;
    e.sets = 20;
    e.bytes = 900000;
    assert_int_equal(store_write(dir, &e), 0);
    assert_int_equal(scanned().bytes, 900000); /* not read through at each start */
    assert_int_equal(sst_file_write(in(dir, "removed.json"), removed, sizeof(removed) - 1), 0);
    e = scanned();
    assert_true(e.from_ns == 1763748305500000000 && e.bytes == store_bytes(dir));
    assert_true(e.sets == 15 && e.gone == 5);
    /* As it is written when all went well: nothing is taken off twice. */
    assert_int_equal(store_write(dir, &e), 0);
    e = scanned();
    assert_true(e.sets == 15 && e.gone == 5);
    /* An older storage.json without `gone` is accepted. */
    e.gone = UINT64_MAX;
    assert_int_equal(store_write(dir, &e), 0);
    e = scanned();
    assert_true(e.sets == 15 && e.gone == 5);
    /* Damaged itself: the recording stays in the list, and is looked through. */
    assert_int_equal(sst_file_write(in(dir, "storage.json"), "{\"format\":", 10), 0);
    assert_int_equal(rename(dir, in(top, "2026-11-21T12-00-00Z")), 0);
    assert_true(scanned().stage == SST_STORE_TORN && scanned().order == 1);
    assert_int_equal(rename(in(top, "2026-11-21T12-00-00Z"), dir), 0);
    /* removed.json is damaged: rewritten from the files that are present. */
    assert_int_equal(store_write(dir, &e), 0);
    assert_int_equal(sst_file_write(in(dir, "sets.jsonl"), lines, sizeof(lines) - 1), 0);
    assert_int_equal(sst_file_write(in(dir, "removed.json"), "{\"format\":", 10), 0);
    e = scanned();
    assert_true(e.sets == 13 && e.gone == 7 && e.from_ns == 1763748307500000000);
    assert_int_equal(sst_recording_read_removed(dir, &now), 0);
    assert_true(!now.assumed && now.before_segment == 2 && now.sets == 7 && now.t_ns == 7500000000);
}

/* The rest of a recording without its list cannot be used, but it counts, and goes like any other. */
static void a_recording_without_its_manifest_is_reported(void **state)
{
    struct synthetic s = small();
    const struct sst_recorder_config cfg = synthetic_config(&s, dir);
    struct store_entry e = { .order = 1, .why = "continuous", .stage = SST_STORE_TORN };

    (void)state;
    assert_int_equal(sst_recorder_close(record(&s, &cfg, 0, 3)), 0);
    assert_int_equal(unlink(in(dir, "sets.jsonl")), 0);
    assert_int_equal(store_repair(dir, &e), -EBADMSG);
    assert_non_null(strstr(said, "sets.jsonl is missing"));
    sst_path_remove_tree(in(dir, "segments"));
    assert_int_equal(store_repair(dir, &e), -ENODATA); /* killed before it had one */
    synthetic_fini(&s);
}

/* --- videos ------------------------------------------------------------------------------------------------------- */

#if WITH_AVFORMAT
struct sink {
    uint8_t *data;
    size_t n;
};

/* Frames of a file as another program reads them. @param pts_ms  out, [100] */
static int read_video(const char *path, struct sink *frame, int64_t *pts_ms, double *seconds)
{
    AVFormatContext *f = NULL;
    AVPacket *p = av_packet_alloc();
    int n = 0;

    assert_int_equal(avformat_open_input(&f, path, NULL, NULL), 0);
    *seconds = (double)f->duration / AV_TIME_BASE;
    assert_int_equal(f->nb_streams, 1);
    assert_int_equal(f->streams[0]->codecpar->codec_id, AV_CODEC_ID_MJPEG);
    while (n < 100 && !av_read_frame(f, p)) {
        pts_ms[n] = p->pts;
        frame[n].data = malloc((size_t)p->size);
        frame[n].n = (size_t)p->size;
        memcpy(frame[n++].data, p->data, (size_t)p->size);
        av_packet_unref(p);
    }
    /* By its index, to the second of a moment. */
    if (n > 40) {
        assert_true(av_seek_frame(f, 0, 2500, AVSEEK_FLAG_BACKWARD) >= 0);
        assert_int_equal(av_read_frame(f, p), 0);
        assert_in_range(p->pts, 1400, 2500);
        av_packet_unref(p);
    }
    av_packet_free(&p);
    avformat_close_input(&f);
    return n;
}
#endif

static void record_some(struct bench *b, int n)
{
    const int64_t first_ns = sst_clock_now_ns() - n * 100 * MS;

    bench_init(b, SST_RECORD_CONTINUOUS);
    bench_open_storage(b);
    bench_wait_ready(b);
    for (int i = 0; i < n; i++)
        bench_put(b, first_ns + i * 100 * MS);
    bench_wait(b, "recording", "sets", n);
}

static void end_recording(struct bench *b)
{
    b->config->storage.mode = SST_RECORD_OFF;
    assert_int_equal(sst_storage_configure(b->storage, b->config), 0);
    bench_wait_inactive(b);
    bench_wait_event(b, "record-stop", NULL, 1);
}

static void a_camera_is_a_video_that_plays(void **state)
{
    char path[SST_PATH_MAX], name[SST_STORE_NAME + 16], base[SST_STORE_NAME];
    struct sst_download *d;
    int64_t bytes, all;
    struct bench b;

    (void)state;
    record_some(&b, 60);
    (void)bench_recording(&b, 0, path);
    snprintf(base, sizeof(base), "%s", sst_path_base(path));
    snprintf(name, sizeof(name), "%s.tar", base);
    assert_int_equal(bench_open(&b, name, &d), -EBUSY);
    snprintf(name, sizeof(name), "%s.r0c1.mkv", base);
    assert_int_equal(bench_open(&b, name, &d), 0);
    assert_string_equal(d->tag, ""); /* it grows: nothing to put parts of together */
    d->close(d);
    end_recording(&b);
    bytes = bench_download(&b, name, "video/x-matroska", in(top, "got.mkv"));
#if WITH_AVFORMAT
    struct sink frame[100] = { { 0 } };
    int64_t pts_ms[100];
    double seconds;

    assert_int_equal(read_video(in(top, "got.mkv"), frame, pts_ms, &seconds), 60);
    assert_true(seconds > 5.9 && seconds < 6.1);
    for (int i = 0; i < 60; i++) {
        uint8_t want[64];

        assert_in_range(pts_ms[i], i * 100 - (i > 0), i * 100 + 1);
        assert_int_equal(frame[i].n, synthetic_bytes(&b.sets, (uint64_t)i, 1));
        synthetic_fill(want, frame[i].n, (uint64_t)i, 1);
        assert_memory_equal(frame[i].data, want, frame[i].n);
        free(frame[i].data);
    }
#endif
    /* Again the same bytes under the same tag, also as parts; nothing with a name is left behind. */
    for (int64_t first = 0; first < bytes; first += all) {
        char line[SST_PATH_MAX * 2];

        all = bytes - first < 1000 ? bytes - first : 1000;
        assert_int_equal(bench_open(&b, name, &d), 0);
        assert_int_equal(strlen(d->tag), 16);
        assert_int_equal(d->bytes, bytes);
        assert_int_equal(bench_copy(d, first, all, in(top, "part")), all);
        d->close(d);
        snprintf(line, sizeof(line), "cd %s && tail -c +%d got.mkv | head -c %d | cmp - part", top, (int)first + 1,
                 (int)all);
        assert_int_equal(system(line), 0);
    }
    assert_int_equal(access(in(dir, ".video"), F_OK), -1);
    snprintf(name, sizeof(name), "%s.r5c5.mkv", base);
    assert_int_equal(bench_open(&b, name, &d), -ENOENT);
    snprintf(name, sizeof(name), "%s.r0c\n1.mkv", base);
    assert_int_equal(bench_open(&b, name, &d), -ENOENT);
    snprintf(name, sizeof(name), "%s.mkv", base); /* no view was recorded */
    assert_int_equal(bench_open(&b, name, &d), -ENOENT);
    bench_fini(&b);
}

#if WITH_AVFORMAT
static int read_zeros(void *arg, size_t i, uint8_t *data)
{
    memset(data, 0, 100000);
    return i == *(size_t *)arg ? -EIO : 0;
}

/* Errors of the disk, in reading and writing, are the video's. */
static void a_failed_write_is_an_error(void **state)
{
    const struct sst_mkv_config cfg = {
        .title = "", .track = "", .fourcc = V4L2_PIX_FMT_MJPEG, .width = 8, .height = 6
    };
    struct sst_mkv_frame frame[50];
    size_t bad = ARRAY_LEN(frame);
    int fd;

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(frame); i++)
        frame[i] = (struct sst_mkv_frame){ .t_ns = (int64_t)i * 100 * MS, .bytes = 100000 };
    fd = open("/dev/full", O_RDWR);
    assert_true(fd >= 0);
    assert_int_equal(sst_mkv_write(fd, &cfg, &(struct sst_mkv_frames){ frame, ARRAY_LEN(frame), read_zeros, &bad }),
                     -ENOSPC);
    close(fd);
    fd = open(in(top, "out.mkv"), O_RDWR | O_CREAT, 0600);
    assert_int_equal(sst_mkv_write(fd, &cfg, &(struct sst_mkv_frames){ frame, ARRAY_LEN(frame), read_zeros, &bad }), 0);
    bad = 40;
    assert_int_equal(sst_mkv_write(fd, &cfg, &(struct sst_mkv_frames){ frame, ARRAY_LEN(frame), read_zeros, &bad }),
                     -EIO);
    close(fd);
}
#endif

/* A video for which there is no room is one error; it counts as long as it is there. */
static void a_video_needs_room(void **state)
{
    char path[SST_PATH_MAX], name[SST_STORE_NAME + 16];
    struct sst_download *d;
    struct bench b;
    int64_t used;

    (void)state;
    record_some(&b, 20);
    (void)bench_recording(&b, 0, path);
    snprintf(name, sizeof(name), "%s.r0c1.mkv", sst_path_base(path));
    end_recording(&b);
    used = bench_number(&b, NULL, "used_bytes");
    b.config->storage.quota_gb = (double)(used + 60000) * 1e-9;
    assert_int_equal(sst_storage_configure(b.storage, b.config), 0);
    assert_int_equal(bench_open(&b, name, &d), -ENOSPC);
    assert_int_equal(access(in(dir, ".video"), F_OK), -1);
    b.config->storage.quota_gb = 0;
    assert_int_equal(sst_storage_configure(b.storage, b.config), 0);
    assert_int_equal(bench_open(&b, name, &d), 0);
    bench_wait(&b, NULL, "used_bytes", used + d->bytes);
    /* An open download stays so, whatever becomes of the recording. */
    assert_int_equal(sst_storage_delete(b.storage, sst_path_base(path)), 0);
    bench_wait_exactly(&b, NULL, "recordings", 0);
    assert_int_equal(bench_copy(d, 0, d->bytes, in(top, "got")), d->bytes);
    d->close(d);
    assert_int_equal(bench_open(&b, name, &d), -ENOENT);
    bench_fini(&b);
}

/* A picture of the view with this content, shown at a time. */
static void show_at(struct bench *b, struct sst_slot *slot, int content, int64_t t_ns, int64_t wall_ns, int in_memory)
{
    static const uint8_t head[] = { 0xff, 0xd8, 0xff, 0xc0, 0, 11, 8, 0, 6, 0, 8,  1, 1,
                                    0x11, 0,    0xff, 0xda, 0, 8,  1, 1, 0, 0, 63, 0 };
    uint8_t *data = malloc(sizeof(head) + 1);

    memcpy(data, head, sizeof(head));
    data[sizeof(head)] = (uint8_t)content;
    assert_int_equal(sst_slot_put(slot, data, sizeof(head) + 1, (uint64_t)content, t_ns, wall_ns), 0);
    bench_wait(b, "ring", "pictures", in_memory);
}

static void show(struct bench *b, struct sst_slot *slot, int content, int64_t t_ns, int in_memory)
{
    show_at(b, slot, content, t_ns, t_ns + 5, in_memory);
}

/* Times that no clock shows: these pictures are left out. */
static void damage_index(const char *name)
{
    char path[SST_PATH_MAX], text[SST_VIDEO_LINE_MAX];
    struct video_line line = { .t_ns = -9000000000000000000, .bytes = 1 };
    FILE *f;

    snprintf(path, sizeof(path), "%s/recordings/%s/%s", dir, name, SST_VIDEO_INDEX);
    f = fopen(path, "ae");
    assert_non_null(f);
    for (int i = 0; i < 2; i++, line.t_ns = 9000000000000000000)
        fwrite(text, 1, video_write_line(text, &line), f);
    assert_int_equal(fclose(f), 0);
}

static void the_view_is_recorded_with_what_was_before(void **state)
{
    const int64_t now_ns = sst_clock_now_ns();
    char name[SST_STORE_NAME], file[SST_STORE_NAME + 8];
    struct sst_download *d;
    struct sst_slot *slot;
    struct bench b;
    uint8_t *jpeg;
    size_t size;

    (void)state;
    assert_int_equal(sst_slot_create(&slot), 0);
    bench_init(&b, SST_RECORD_OFF);
    b.config->live.enabled = b.config->storage.record_view = true;
    b.config->storage.preroll_s = 1000;
    bench_open_storage(&b);
    bench_wait_ready(&b);
    sst_storage_view(b.storage, slot);
    usleep(50000);
    assert_int_equal(sst_slot_clients(slot), 0); /* nothing is recorded: no viewer */
    show(&b, slot, 1, now_ns - 6000 * MS, 0);
    sst_slot_join(slot); /* another viewer, noticed at the next poll */
    bench_wait(&b, "ring", "pictures", 1);
    for (int i = 0; i < 40; i++)
        bench_put(&b, now_ns - (40 - i) * 100 * MS);
    show(&b, slot, 2, now_ns - 5000 * MS, 2); /* the picture when it begins, 4 s ago */
    show(&b, slot, 3, now_ns - 500 * MS, 3);
    assert_int_equal(sst_storage_record(b.storage, 0, name), 0);
    bench_put(&b, now_ns);
    bench_wait(&b, "recording", "sets", 41);
    for (int i = 0; sst_slot_clients(slot) < 2 && i < 60000; i++)
        usleep(1000);
    assert_int_equal(sst_slot_clients(slot), 2);
    show(&b, slot, 4, now_ns, 4);
    bench_put(&b, now_ns + 3000 * MS);
    bench_wait(&b, "recording", "sets", 42);
    assert_int_equal(sst_storage_stop(b.storage), 0);
    bench_put(&b, sst_clock_now_ns() + 4000 * MS); /* ends it */
    bench_wait_event(&b, "record-stop", name, 1);
    snprintf(file, sizeof(file), "%s.mkv", name);
    damage_index(name);
    (void)bench_download(&b, file, "video/x-matroska", in(top, "view.mkv"));
    snprintf(file, sizeof(file), "%s.jpg", name);
    assert_int_equal(bench_download(&b, file, "image/jpeg", in(top, "view.jpg")), 26);
    assert_int_equal(sst_file_read(in(top, "view.jpg"), 100, &jpeg, &size), 0);
    assert_true(jpeg[0] == 0xff && jpeg[1] == 0xd8 && jpeg[25] >= 2 && jpeg[25] <= 4);
    free(jpeg);
    assert_int_equal(bench_open(&b, name, &d), -ENOENT); /* without .jpg a recording is no picture */
#if WITH_AVFORMAT
    static const int want[] = { 2, 3, 4 }; /* and the last one until the end */
    struct sink frame[100] = { { 0 } };
    int64_t pts_ms[100];
    double seconds;
    const int n = read_video(in(top, "view.mkv"), frame, pts_ms, &seconds);

    for (int i = 0; i < n; i++) {
        assert_int_equal(frame[i].data[frame[i].n - 1], i < 3 ? want[i] : 4);
        free(frame[i].data);
    }
    assert_int_equal(pts_ms[0], 0);
    assert_int_equal(pts_ms[1], 3500);
    assert_int_equal(pts_ms[2], 4000);
    assert_int_equal(n, 4);
    assert_int_equal(pts_ms[3], 7000);
    assert_true(seconds > 7 && seconds < 8.1);
#endif
    bench_fini(&b);
    assert_int_equal(sst_slot_clients(slot), 1);
    sst_slot_unref(slot);
}

/* A time of the only recording's entry, in s. */
static double time_s(struct bench *b, const char *key)
{
    json_t *all = sst_storage_list(b->storage);
    const json_t *one = json_array_get(json_object_get(all, "recordings"), 0);
    struct tm tm = { 0 };
    double s;

    assert_int_equal(sscanf(json_string_value(json_object_get(one, key)), "%4d-%2d-%2dT%2d:%2d:%lfZ", &tm.tm_year,
                            &tm.tm_mon, &tm.tm_mday, &tm.tm_hour, &tm.tm_min, &s),
                     6);
    tm.tm_year -= 1900;
    tm.tm_mon--;
    json_decref(all);
    return (double)timegm(&tm) + s;
}

/* Nobody looked while the sets before the recording came: its entry says from when on there is a view, also later. */
static void a_view_that_begins_late_says_so(void **state)
{
    char name[SST_STORE_NAME];
    struct sst_slot *slot;
    struct bench b;

    (void)state;
    assert_int_equal(sst_slot_create(&slot), 0);
    bench_init(&b, SST_RECORD_OFF);
    b.config->live.enabled = b.config->storage.record_view = true;
    b.config->storage.preroll_s = 1000;
    bench_open_storage(&b);
    bench_wait_ready(&b);
    sst_storage_view(b.storage, slot);
    for (int i = 0; i < 40; i++)
        bench_put(&b, sst_clock_now_ns() - (40 - i) * 100 * MS);
    assert_int_equal(sst_storage_record(b.storage, 0, name), 0);
    for (int i = 0; !sst_slot_clients(slot) && i < 60000; i++)
        usleep(1000);
    show_at(&b, slot, 1, sst_clock_now_ns(), sst_clock_wall_ns(), 1);
    bench_put(&b, sst_clock_now_ns());
    bench_wait(&b, "recording", "sets", 41);
    assert_int_equal(sst_storage_stop(b.storage), 0);
    bench_put(&b, sst_clock_now_ns() + 4000 * MS);
    bench_wait_event(&b, "record-stop", name, 1);
    for (int again = 0; again < 2; again++) {
        const double late_s = time_s(&b, "view_from") - time_s(&b, "from");

        assert_true(late_s >= 3.99 && late_s < 60);
        assert_true(sst_storage_close(b.storage, 60000));
        bench_open_storage(&b); /* as it was before */
        bench_wait_ready(&b);
    }
    bench_fini(&b);
    sst_slot_unref(slot);
}

/* A picture from before anybody looked is none of now, but if nothing has moved since. */
static void an_old_picture_does_not_pass_for_a_new_one(void **state)
{
    char name[SST_STORE_NAME], file[SST_STORE_NAME + 8];

    (void)state;
    for (int still = 0; still < 2; still++) {
        struct sst_slot *slot;
        struct bench b;

        assert_int_equal(sst_slot_create(&slot), 0);
        bench_init(&b, SST_RECORD_OFF);
        b.config->live.enabled = b.config->storage.record_view = true;
        bench_open_storage(&b);
        bench_wait_ready(&b);
        sst_storage_view(b.storage, slot);
        show(&b, slot, 1, sst_clock_now_ns() - 1000000 * MS, 0);
        bench_put(&b, sst_clock_now_ns());
        assert_int_equal(sst_storage_record(b.storage, 0, name), 0);
        bench_put(&b, sst_clock_now_ns());
        for (int i = 0; !sst_slot_clients(slot) && i < 60000; i++)
            usleep(1000);
        if (!still)
            assert_int_equal(bench_number(&b, "ring", "pictures"), 0);
        if (!still)
            show(&b, slot, 2, sst_clock_now_ns(), 1);
        bench_wait(&b, "ring", "pictures", 1);
        bench_put(&b, sst_clock_now_ns());
        assert_int_equal(sst_storage_stop(b.storage), 0);
        bench_put(&b, sst_clock_now_ns() + 4000 * MS);
        bench_wait_event(&b, "record-stop", name, 1);
        snprintf(file, sizeof(file), "%s.mkv", name);
        (void)bench_download(&b, file, "video/x-matroska", in(top, "view.mkv"));
#if WITH_AVFORMAT
        struct sink frame[100] = { { 0 } };
        int64_t pts_ms[100];
        double seconds;
        const int n = read_video(in(top, "view.mkv"), frame, pts_ms, &seconds);

        assert_in_range(n, 1, 2);
        for (int i = 0; i < n; i++) {
            assert_int_equal(frame[i].data[frame[i].n - 1], still ? 1 : 2);
            free(frame[i].data);
        }
#endif
        bench_fini(&b);
        sst_slot_unref(slot);
    }
}

static void moments_are_kept_as_long_as_they_may_be_wanted(void **state)
{
    struct view_history *shown = calloc(1, sizeof(*shown));
    struct sst_slot *slot;
    const struct sst_jpeg *jpeg;

    (void)state;
    assert_int_equal(sst_slot_create(&slot), 0);
    for (int i = 1; i <= 10000; i++) {
        assert_int_equal(sst_slot_put(slot, calloc(1, 100), 100, 0, i * MS, 0), 0);
        view_history_add(shown, sst_slot_get(slot, 0), i > 9000 ? 9500 * MS : 0);
        assert_in_range(shown->count, 1, VIEW_HISTORY_MAX);
    }
    jpeg = view_history_next(shown, 0);
    assert_int_equal(jpeg->number, 9500); /* the picture of that time */
    sst_slot_jpeg_unref(jpeg);
    jpeg = view_history_at(shown, 9700 * MS);
    assert_int_equal(jpeg->number, 9700);
    sst_slot_jpeg_unref(jpeg);
    assert_null(view_history_at(shown, 9499 * MS));
    assert_null(view_history_next(shown, 10000));
    assert_int_equal(shown->bytes, 501 * 100);
    /* However large: the newest stays. */
    for (int i = 0; i < 8; i++) {
        assert_int_equal(sst_slot_put(slot, calloc(1, (size_t)30 << 20), (size_t)30 << 20, 0, INT64_MAX, 0), 0);
        view_history_add(shown, sst_slot_get(slot, 0), 0);
    }
    assert_int_equal(shown->count, 2);
    view_history_fini(shown);
    assert_int_equal(shown->bytes, 0);
    sst_slot_unref(slot);
    free(shown);
}

/* --- deleting --------------------------------------------------------------------------------------------- */

static void what_is_deleted_is_gone(void **state)
{
    char path[SST_PATH_MAX], name[SST_STORE_NAME], file[SST_STORE_NAME + 8], line[SST_PATH_MAX * 2];
    struct sst_download *d;
    struct bench b;

    (void)state;
    record_some(&b, 20);
    (void)bench_recording(&b, 0, path);
    snprintf(name, sizeof(name), "%s", sst_path_base(path));
    assert_int_equal(sst_storage_delete(b.storage, name), -EBUSY);
    assert_int_equal(sst_storage_delete(b.storage, "../recordings"), -ENOENT);
    assert_int_equal(sst_storage_delete(b.storage, ""), -ENOENT);
    end_recording(&b);
    /* A download of it breaks off before its promised length. */
    snprintf(file, sizeof(file), "%s.tar", name);
    assert_int_equal(bench_open(&b, file, &d), 0);
    const int64_t start_ns = sst_clock_now_ns();
    assert_int_equal(sst_storage_delete(b.storage, name), 0);
    assert_true(!sst_path_exists(path) || sst_clock_now_ns() - start_ns > 800 * MS); /* no caller waits longer */
    for (int i = 0; i < 60000; i++) {                                                /* its files go behind its name */
        snprintf(line, sizeof(line), "test -z \"$(ls -A %s/recordings)\"", dir);
        if (!system(line))
            break;
        usleep(1000);
    }
    assert_true(bench_copy(d, 0, d->bytes, in(top, "cut.tar")) < d->bytes);
    d->close(d);
    assert_int_equal(sst_storage_delete(b.storage, name), -ENOENT);
    assert_int_equal(bench_open(&b, file, &d), -ENOENT);
    assert_int_equal(bench_recording(&b, 0, path), 0);
    assert_int_equal(bench_number(&b, NULL, "deleted"), 1);
    assert_int_equal(bench_number(&b, NULL, "removed"), 0);
    assert_int_equal(bench_number(&b, NULL, "recordings"), 0);

    bench_put_pictures(&b, 2, sst_clock_now_ns());
    assert_int_equal(sst_storage_snapshot(b.storage, (const uint8_t *)"picture", 7, name), 0);
    bench_wait_event(&b, "snapshot", name, 1); /* also when it took longer than a caller waits */
    assert_int_equal(bench_number(&b, NULL, "snapshots"), 1);
    assert_true(bench_number(&b, NULL, "by_hand_bytes") > 0);
    assert_int_equal(sst_storage_delete(b.storage, name), 0);
    bench_wait_exactly(&b, NULL, "snapshots", 0);
    bench_fini(&b);
    snprintf(line, sizeof(line), "test -z \"$(ls -A %s/snapshots)\"", dir);
    assert_int_equal(system(line), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(every_part_of_an_archive_is_that_part),
        TEST(lines_of_the_view_are_read_strictly),
        TEST(a_view_that_begins_late_says_so),
        TEST(a_trimmed_view_begins_where_the_rest_does),
        TEST(what_a_kill_left_is_measured),
        TEST(a_recording_without_its_manifest_is_reported),
        TEST(a_camera_is_a_video_that_plays),
#if WITH_AVFORMAT
        TEST(a_failed_write_is_an_error),
#endif
        TEST(a_video_needs_room),
        TEST(the_view_is_recorded_with_what_was_before),
        TEST(an_old_picture_does_not_pass_for_a_new_one),
        TEST(moments_are_kept_as_long_as_they_may_be_wanted),
        TEST(what_is_deleted_is_gone),
    };
    const int rc = begin_tests(WITH_AVFORMAT);

    return rc ? rc : cmocka_run_group_tests(tests, NULL, remove_all);
}
