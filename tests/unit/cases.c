/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* memmem */
/* Videos for others: the file's form against the limits of players, its pictures and captions, manifest, archive, cancelling. */
#include "capture/evidence/evidence.h"
#include "daemon/storage/case_internal.h"
#include "daemon/storage/video_internal.h"
#include "tests/storage_bench.h"

#if WITH_AVFORMAT && WITH_HTTPD
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <math.h>

#define MS     ((int64_t)1000000)
#define S      (1000 * MS)
#define SETS   50 /* at 10 Hz */
#define WIDTH  160
#define HEIGHT 120

int fdatasync(int fd SST_UNUSED)
{
    return 0; /* the disk has time; the test has not */
}

int fsync(int fd SST_UNUSED)
{
    return 0;
}

static struct bench b;
static struct sst_cases *cases;
static int64_t first_wall_ns; /* of the recording */
static char key[SST_PATH_MAX], videos[SST_PATH_MAX];

/* Pictures of the view, light; the camera's are dark. */
static void write_view(const char *recording)
{
    FILE *pictures = fopen(in(recording, SST_VIDEO_PICTURES), "wb"), *index = fopen(in(recording, SST_VIDEO_INDEX), "w");
    struct sst_image img;
    char text[SST_VIDEO_LINE_MAX];
    int64_t at = 0;

    assert_true(pictures && index);
    assert_int_equal(sst_image_init(&img, WIDTH, HEIGHT), 0);
    for (int c = 0; c < 3; c++)
        memset(img.plane[c], c == 0 ? 230 : 200, img.stride * HEIGHT);
    for (int i = 0; i < SETS; i += 2) {
        uint8_t *jpeg;
        size_t bytes;

        assert_int_equal(sst_image_encode_jpeg(&img, 90, &jpeg, &bytes), 0);
        const struct video_line l = { i * 100 * MS, first_wall_ns + i * 100 * MS, (uint64_t)i, at, (int64_t)bytes };

        assert_int_equal(fwrite(jpeg, 1, bytes, pictures), bytes);
        assert_true(fwrite(text, 1, video_write_line(text, &l), index) > 0);
        at += (int64_t)bytes;
        free(jpeg);
    }
    sst_image_fini(&img);
    fclose(pictures);
    fclose(index);
}

static void open_cases(const char *site)
{
    const struct sst_cases_config cfg = { .storage = b.storage, .dir = dir, .key = key, .site = site };

    assert_int_equal(sst_cases_open(&cases, &cfg), 0);
}

static void close_cases(void)
{
    assert_true(sst_cases_close(cases, sst_clock_now_ns() + 60 * S));
}

/* A recording of five seconds that has ended. */
static void begin(void)
{
    const int64_t first_ns = sst_clock_now_ns() - SETS * 100 * MS;
    char path[SST_PATH_MAX];
    struct sst_recording *r;
    struct sst_recording_set set;

    bench_init(&b, SST_RECORD_CONTINUOUS);
    synthetic_fini(&b.sets);
    b.sets = (struct synthetic){
        .cameras = 3, .fourcc = V4L2_PIX_FMT_GREY, .width = WIDTH, .height = HEIGHT, .bytes = WIDTH * HEIGHT, .exact = true, .period_ns = 100 * MS
    };
    synthetic_init(&b.sets);
    b.config->array.fourcc = b.sets.fourcc;
    b.config->array.width = WIDTH;
    b.config->array.height = HEIGHT;
    b.config->storage.record_view = false;
    static uint8_t dark[WIDTH * HEIGHT];
    memset(dark, 30, sizeof(dark));
    b.still = dark;
    bench_open_storage(&b);
    bench_wait_ready(&b);
    for (int i = 0; i < SETS; i++)
        bench_put(&b, first_ns + i * 100 * MS);
    bench_wait(&b, "recording", "sets", SETS);
    b.config->storage.mode = SST_RECORD_OFF;
    assert_int_equal(sst_storage_configure(b.storage, b.config), 0);
    bench_wait_inactive(&b);
    assert_int_equal(bench_recording(&b, 0, path), 1);
    assert_int_equal(sst_recording_open(&r, path), 0);
    assert_int_equal(sst_recording_set(r, 0, &set), 0);
    first_wall_ns = set.wall_ns;
    sst_recording_close(r);
    write_view(path);
    snprintf(key, sizeof(key), "%s/signing-key.pem", dir);
    snprintf(videos, sizeof(videos), "%s/videos", dir);
    open_cases("G\xc3\xa4rtnerei, Tor 2");
}

static void end(void)
{
    close_cases();
    bench_fini(&b);
}

static json_t *state_of(const char *name)
{
    json_t *list = sst_cases_list(cases), *one, *found = NULL;
    size_t i;

    json_array_foreach(json_object_get(list, "videos"), i, one)
    {
        if (!strcmp(json_string_value(json_object_get(one, "name")), name))
            found = json_incref(one);
    }
    json_decref(list);
    return found;
}

/* @return its error, to free with free() */
static char *wait_for(const char *name, const char *state)
{
    const int64_t end_ns = bench_deadline();
    char *error = NULL;

    for (bool there = false; !there;) {
        json_t *o = state_of(name);

        assert_non_null(o);
        there = !strcmp(json_string_value(json_object_get(o, "state")), state);
        if (!there && !strcmp(json_string_value(json_object_get(o, "state")), "failed"))
            fail_msg("%s", json_string_value(json_object_get(o, "error")));
        if (there)
            error = strdup(json_string_value(json_object_get(o, "error")));
        json_decref(o);
        bench_assert_before(&b, end_ns);
        usleep(2000);
    }
    return error;
}

static struct sst_case_span span(double from_s, double to_s)
{
    struct sst_case_span made = { .from_ns = first_wall_ns + (int64_t)(from_s * 1e9),
                                  .to_ns = first_wall_ns + (int64_t)(to_s * 1e9),
                                  .title = "Somebody <b>" };

    return made;
}

static void save(const char *name, const char *ending, const char *type, const char *path)
{
    char whole[SST_CASE_NAME + 8];
    struct sst_download *d;

    snprintf(whole, sizeof(whole), "%s%s", name, ending);
    assert_int_equal(sst_cases_download(cases, whole, &d), 0);
    assert_string_equal(d->type, type);
    assert_int_equal(bench_copy(d, 0, d->bytes, path), d->bytes);
    d->close(d);
}

/* Boxes of the file: the index comes before the pictures. */
static void assert_index_first(const char *path)
{
    uint8_t *data;
    size_t size, at = 0, moov = 0, mdat = 0;

    assert_int_equal(sst_file_read(path, 1 << 24, &data, &size), 0);
    while (at + 8 <= size) {
        const size_t n = (size_t)data[at] << 24 | (size_t)data[at + 1] << 16 | (size_t)data[at + 2] << 8 | data[at + 3];

        moov = memcmp(data + at + 4, "moov", 4) ? moov : at;
        mdat = memcmp(data + at + 4, "mdat", 4) ? mdat : at;
        assert_true(n >= 8);
        at += n;
    }
    free(data);
    assert_true(moov > 0 && moov < mdat);
}

/* Mean of luma of a part of a picture. */
static double mean(const AVFrame *f, int x0, int x1, int y0, int y1)
{
    double sum = 0;

    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++)
            sum += f->data[0][y * f->linesize[0] + x];
    return sum / ((x1 - x0) * (y1 - y0));
}

/* Limits of players of telephones and of Windows in hardware. @param alone  no see-through view was recorded: the camera has the whole width @return
 * number of pictures */
static int check_file(const char *path, bool alone)
{
    const int width = alone ? 320 : 2 * WIDTH, height = alone ? 320 * HEIGHT / WIDTH : HEIGHT, right = alone ? 0 : WIDTH;
    AVFormatContext *f = NULL;
    AVPacket *p = av_packet_alloc();
    AVFrame *frame = av_frame_alloc();
    AVCodecContext *c = avcodec_alloc_context3(avcodec_find_decoder(AV_CODEC_ID_H264));
    const AVCodecParameters *par;
    int n = 0;

    assert_int_equal(avformat_open_input(&f, path, NULL, NULL), 0);
    assert_true(avformat_find_stream_info(f, NULL) >= 0);
    assert_int_equal(f->nb_streams, 1);
    par = f->streams[0]->codecpar;
    assert_int_equal(par->codec_id, AV_CODEC_ID_H264);
    assert_true(par->profile == FF_PROFILE_H264_HIGH || par->profile == FF_PROFILE_H264_MAIN);
    assert_in_range(par->level, 10, 41);
    assert_int_equal(par->format, AV_PIX_FMT_YUV420P);
    assert_true(par->width % 2 == 0 && par->height % 2 == 0 && par->width == width && par->height > height);
    assert_int_equal(av_cmp_q(f->streams[0]->avg_frame_rate, f->streams[0]->r_frame_rate), 0);
    assert_int_equal(av_cmp_q(f->streams[0]->avg_frame_rate, (AVRational){ 10, 1 }), 0);
    assert_int_equal(par->color_space, AVCOL_SPC_BT709);
    assert_int_equal(avcodec_parameters_to_context(c, par), 0);
    assert_int_equal(avcodec_open2(c, NULL, NULL), 0);
    for (bool more = true; more;) {
        more = av_read_frame(f, p) >= 0;
        assert_true(avcodec_send_packet(c, more ? p : NULL) >= 0);
        av_packet_unref(p);
        for (; avcodec_receive_frame(c, frame) >= 0; n++) {
            /* Left the view, 230 200 200; right the camera, 30; below a line of each text, white on black. */
            if (!alone)
                assert_true(fabs(mean(frame, 20, WIDTH - 20, 20, HEIGHT - 20) - (16 + 206 * 219 / 255.0)) < 4);
            assert_true(fabs(mean(frame, right + 20, width - 20, 20, height - 20) - (16 + 30 * 219 / 255.0)) < 4);
            assert_true(mean(frame, 4, width / 2 - 40, height + 4, height + 11) > 40);
            assert_true(mean(frame, 2, width / 2 - 10, height + 1, height + 3) < 30);
        }
    }
    av_frame_free(&frame);
    av_packet_free(&p);
    avcodec_free_context(&c);
    avformat_close_input(&f);
    return n;
}

static void assert_verdict(const char *path, const char *pem, bool good, const char *words)
{
    struct sst_verdict v;

    assert_int_equal(sst_evidence_verify(path, pem, &v), 0);
    if (v.good != good || !strstr(v.text, words))
        fail_msg("%s: %s, %s", path, v.good ? "good" : "bad", v.text);
    json_decref(v.manifest);
}

static void change(const char *path, const char *from, const char *to)
{
    uint8_t *data;
    size_t size;
    char *at;

    assert_int_equal(sst_file_read(path, 1 << 24, &data, &size), 0);
    at = memmem(data, size, from, strlen(from));
    assert_non_null(at);
    memcpy(at, to, strlen(to));
    assert_int_equal(sst_file_write(path, data, size), 0);
    free(data);
}

static void a_visit_is_a_file_for_any_player(void **state)
{
    struct sst_case_span one;
    char name[SST_CASE_NAME], pem[SST_EVIDENCE_PEM], print[SST_EVIDENCE_PRINT], line[2 * SST_PATH_MAX];
    json_t *root;
    const json_t *file;

    (void)state;
    begin();
    one = span(1, 3);
    one.visit = json_pack("{s:s}", "visit", "2026-11-21T18-05-00-123Z-7");
    assert_int_equal(sst_cases_add(cases, &one, 1, name), 0);
    json_decref(one.visit);
    free(wait_for(name, "done"));
    save(name, ".mp4", "video/mp4", in(top, "clip.mp4"));
    save(name, ".json", "application/json", in(top, "clip.json"));
    assert_index_first(in(top, "clip.mp4"));
    assert_int_equal(check_file(in(top, "clip.mp4"), false), 20);
    root = json_load_file(in(top, "clip.json"), 0, NULL);
    file = json_array_get(json_object_get(json_object_get(root, "manifest"), "files"), 0);
    assert_string_equal(json_string_value(json_object_get(json_object_get(root, "manifest"), "site")), "G\xc3\xa4rtnerei, Tor 2");
    assert_true(json_is_true(json_object_get(file, "clear")));
    assert_int_equal(json_integer_value(json_object_get(file, "milliseconds")), 2000);
    assert_string_equal(json_string_value(json_object_get(json_object_get(file, "visit"), "visit")), "2026-11-21T18-05-00-123Z-7");
    json_decref(root);
    /* Signed by the key that the service gives out, and by no other. */
    assert_int_equal(sst_cases_key(cases, pem, print), 0);
    assert_int_equal(sst_file_write(in(top, "key.pem"), pem, strlen(pem)), 0);
    assert_int_equal(sst_evidence_key(in(top, "other-private.pem"), pem, print), 0);
    assert_int_equal(sst_file_write(in(top, "other.pem"), pem, strlen(pem)), 0);
    assert_verdict(in(top, "clip.mp4"), NULL, true, "1 file is as signed");
    /* As others verify it. */
    snprintf(line, sizeof(line),
             "cd %s && /usr/bin/python3 -c 'import base64, json; o = json.load(open(\"clip.json\")); "
             "open(\"m\", \"w\").write(json.dumps(o[\"manifest\"], sort_keys=True, separators=(\",\", \":\"), ensure_ascii=False)); "
             "open(\"s\", \"wb\").write(base64.b64decode(o[\"signature\"]))' && "
             "openssl pkeyutl -verify -pubin -inkey key.pem -rawin -in m -sigfile s >/dev/null",
             top);
    assert_int_equal(system(line), 0);
    assert_verdict(in(top, "clip.mp4"), in(top, "key.pem"), true, "1 file is as signed");
    assert_verdict(in(top, "clip.mp4"), in(top, "other.pem"), false, "another key signed it");
    /* Any change of either file is found and named. */
    change(in(top, "clip.mp4"), "mdat", "mdaT");
    assert_verdict(in(top, "clip.mp4"), NULL, false, "clip.mp4 was changed: its SHA-256 is");
    change(in(top, "clip.mp4"), "mdaT", "mdat");
    change(in(top, "clip.json"), "Somebody", "Somebodx");
    assert_verdict(in(top, "clip.mp4"), NULL, false, "the manifest was changed after it was signed");
    change(in(top, "clip.json"), "Somebodx", "Somebody");
    assert_int_equal(truncate(in(top, "clip.mp4"), 4000), 0);
    assert_verdict(in(top, "clip.mp4"), NULL, false, "it has 4000 bytes, signed were");
    end();
}

/* Unpackers would write other files: the last of two files of a name, or a file that the list leaves out. */
static void archives_that_lie(void)
{
    static const char program[] =
        "import struct, warnings, zipfile\n"
        "warnings.simplefilter('ignore')\n"
        "data = open('case.zip', 'rb').read()\n"
        "for n, name in enumerate(('index.html', 'manifest.json', 'bad\\x1b[2K\\r')):\n"
        "    open('twice%d.zip' % n, 'wb').write(data)\n"
        "    zipfile.ZipFile('twice%d.zip' % n, 'a').writestr(name, 'forged')\n"
        "at, = struct.unpack('<I', data[-6:-2])\n"
        "local = struct.pack('<4s5H3I2H', b'PK\\3\\4', 10, 0, 0, 0, 0, 0, 6, 6, 10, 0) + b'index.htmlforged'\n"
        "end = data[at:-6] + struct.pack('<I', at + len(local)) + data[-2:]\n"
        "open('hidden.zip', 'wb').write(data[:at] + local + end)\n"
        "open('renamed.zip', 'wb').write(data.replace(b'index.html', b'other.html', 1))\n";
    char line[2 * SST_PATH_MAX];

    assert_int_equal(sst_file_write(in(top, "lie.py"), program, strlen(program)), 0);
    snprintf(line, sizeof(line), "cd %s && /usr/bin/python3 lie.py", top);
    assert_int_equal(system(line), 0);
    assert_verdict(in(top, "twice0.zip"), NULL, false, "index.html is in it twice");
    assert_verdict(in(top, "twice1.zip"), NULL, false, "manifest.json is in it twice");
    assert_verdict(in(top, "twice2.zip"), NULL, false, "bad?[2K? was added");
    assert_verdict(in(top, "hidden.zip"), NULL, false, "bytes that its list does not name");
    assert_verdict(in(top, "renamed.zip"), NULL, false, "bytes that its list does not name");
}

/* Sizes reported for the quota. */
struct sizes {
    int64_t first, last; /* first: but zero */
};

static void note_size(void *arg, int64_t bytes)
{
    struct sizes *s = arg;

    s->first = s->first ? s->first : bytes;
    s->last = bytes;
}

static void several_are_a_case(void **state)
{
    struct sizes sizes = { 0, 0 };
    char name[SST_CASE_NAME], line[2 * SST_PATH_MAX];
    struct sst_download *d;
    static uint8_t whole[1 << 22], part[1000];
    int64_t bytes, end_ns;

    (void)state;
    begin();
    struct sst_case_span two[] = { span(0, 1), span(2, 3) };

    /* Characters of three bytes up to the limit. */
    memset(two[0].title, 0, sizeof(two[0].title));
    for (size_t i = strlen(strcpy(two[0].title, "<b>")); i + 3 < sizeof(two[0].title); i += 3)
        memcpy(two[0].title + i, "\xe2\x82\xac", 3);
    sst_cases_report(cases, note_size, &sizes);
    assert_int_equal(sst_cases_add(cases, two, 2, name), 0);
    free(wait_for(name, "done"));
    assert_in_range(sizes.first, 1, sizes.last - 1000); /* counted before all of it was there */
    snprintf(line, sizeof(line), "%s.mp4", name);
    assert_int_equal(sst_cases_download(cases, line, &d), -ENOENT);
    save(name, ".zip", "application/zip", in(top, "case.zip"));
    snprintf(line, sizeof(line),
             "cd %s && /usr/bin/python3 -m zipfile -t case.zip >/dev/null && rm -rf case && /usr/bin/python3 -m zipfile -e case.zip case && "
             "test $(ls case | wc -l) = 4 && grep -q 'Somebody &lt;b&gt;' case/index.html && grep -q '<h1>2 visits, &lt;b&gt;\xe2\x82\xac' case/index.html",
             top);
    assert_int_equal(system(line), 0);
    assert_verdict(in(top, "case.zip"), NULL, true, "3 files are as signed");
    assert_verdict(in(top, "case/manifest.json"), NULL, true, "3 files are as signed");
    snprintf(line, sizeof(line), "%s.zip", name);
    assert_int_equal(sst_cases_download(cases, line, &d), 0);
    bytes = d->bytes;
    assert_in_range(bytes, 1000, sizeof(whole));
    for (int64_t at = 0; at < bytes;) {
        const ssize_t n = d->read(d, at, whole + at, sizeof(whole));

        assert_true(n > 0);
        at += n;
    }
    for (int64_t at = 0; at < bytes; at += 97) {
        const ssize_t n = d->read(d, at, part, sizeof(part));

        assert_in_range(n, 1, bytes - at);
        assert_memory_equal(part, whole + at, n);
    }
    assert_int_equal(sst_cases_remove(cases, name), -EBUSY);
    d->close(d);
    /* Files added to the archive, removed from it or changed in it. */
    snprintf(line, sizeof(line), "cd %s && cp case.zip other.zip && echo x >x && zip -q0 other.zip x 2>/dev/null || /usr/bin/python3 -c 'import zipfile; zipfile.ZipFile(\"other.zip\", \"a\").write(\"x\")'", top);
    assert_int_equal(system(line), 0);
    assert_verdict(in(top, "other.zip"), NULL, false, "x was added");
    archives_that_lie();
    change(in(top, "case.zip"), "mdat", "mdaT");
    assert_verdict(in(top, "case.zip"), NULL, false, "-1.mp4 was changed");
    assert_int_equal(unlink(in(top, "case/index.html")), 0);
    assert_verdict(in(top, "case/manifest.json"), NULL, false, "index.html is missing");
    /* The next process has it, and removes the rest of a killed one. */
    close_cases();
    assert_int_equal(mkdir(in(videos, ".making"), 0777), 0);
    open_cases("x");
    free(wait_for(name, "done"));
    assert_int_equal(access(in(videos, ".making"), F_OK), -1);
    /* A week is over, by the time of its manifest. */
    end_ns = bench_deadline();
    close_cases();
    snprintf(line, sizeof(line), "touch -d '8 days ago' %s/%s/" SST_EVIDENCE_MANIFEST, videos, name);
    assert_int_equal(system(line), 0);
    open_cases("x");
    usleep(20000);
    free(wait_for(name, "done")); /* while the clock is not trusted */
    sst_cases_clock(cases, true);
    for (json_t *o; (o = state_of(name)); bench_assert_before(&b, end_ns))
        json_decref(o);
    assert_int_equal(access(in(videos, name), F_OK), -1);
    end();
}

static void what_cannot_be_made_says_why(void **state)
{
    char name[SST_CASE_NAME], path[SST_PATH_MAX], *error, line[2 * SST_PATH_MAX];
    struct sst_case_span one;

    (void)state;
    begin();
    one = span(3600, 3610);
    assert_int_equal(sst_cases_add(cases, &one, 1, name), 0);
    error = wait_for(name, "failed");
    assert_string_equal(error, "no recording has this moment");
    free(error);
    /* Without a see-through view the camera is there. */
    assert_int_equal(bench_recording(&b, 0, path), 1);
    assert_int_equal(unlink(in(path, SST_VIDEO_INDEX)), 0);
    one = span(-5, 1);
    assert_int_equal(sst_cases_add(cases, &one, 1, name), 0);
    free(wait_for(name, "done"));
    save(name, ".mp4", "video/mp4", in(top, "alone.mp4"));
    assert_int_equal(check_file(in(top, "alone.mp4"), true), 10); /* from the recording's beginning */
    /* The queue is bounded; a waiting case can be taken out of it. */
    for (int i = 0, err = 0; i < 200 && !err; i++) {
        one = span(0, 5);
        err = sst_cases_add(cases, &one, 1, name);
        assert_true(!err || err == -EBUSY);
        if (i == 199)
            fail_msg("the queue has no end");
    }
    assert_int_equal(sst_cases_remove(cases, name), 0);
    assert_int_equal(sst_cases_remove(cases, "video-2026-11-21T18-05-00-123Z"), -ENOENT);
    end(); /* while one is made */
    snprintf(line, sizeof(line), "test -z \"$(find %s/videos -name '*.tmp*' -o -name '.making' -o -name '*.mp4' -path '*making*')\"", dir);
    assert_int_equal(system(line), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_visit_is_a_file_for_any_player),
        TEST(several_are_a_case),
        TEST(what_cannot_be_made_says_why),
    };
    const int rc = begin_tests(WITH_AVFORMAT);

    return rc ? rc : cmocka_run_group_tests(tests, NULL, remove_all);
}

#else

int main(void)
{
    puts("built without libavformat or GnuTLS");
    return 77;
}

#endif
