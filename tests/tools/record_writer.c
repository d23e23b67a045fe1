/* Records synthetic sets, to be killed, starved and measured; and checks what it recorded by content.
 *
 *   record_writer write DIR [name=value ...]   prints the number of sets written after each one
 *   record_writer check DIR [name=value ...]   exit 0: every set is what was written; prints how many there are
 *   record_writer bench DIR [name=value ...]   prints the cost of a set
 * cameras=36 bytes=40000 sets=100 rate=10 sync=1 segment_s=60 segment_bytes=0 append=0 holes=1 exact=0 pace=0
 * format=MJPG width=640 height=480 jpeg=0 first=0 stay=0 views=LF shift=0 parts=0
 * pace: one set each period instead of as fast as it goes; jpeg: real pictures instead of random bytes; views: the views of a
 * light field in every set, MJPG, GREY, Y16 (of 12 bits) or Bayer; shift: px that cameras 3, 10, 17 ... are too low;
 * parts: after the first set, differences from it alone (with jpeg); first: index of
 * the first set; stay: after an error go on with the next set 20 ms later; the first time that recording is not
 * possible those sets do not count, a minute at most: somebody is about to mend it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <time.h>
#include <unistd.h>

#include <linux/videodev2.h>

#include "base/clock.h"
#include "base/file.h"
#include "capture/recording/recording.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/jpeg_parts.h"
#include "pipeline/image/raw.h"
#include "tests/synthetic_sets.h"

static struct {
    const char *name;
    double value;
} options[] = {
    { "cameras", 36 },      { "bytes", 40000 }, { "sets", 100 }, { "rate", 10 }, { "sync", 1 }, { "segment_s", 60 },
    { "segment_bytes", 0 }, { "append", 0 },    { "holes", 1 },  { "exact", 0 }, { "pace", 0 }, { "width", 640 },
    { "height", 480 },      { "jpeg", 0 },      { "first", 0 },  { "stay", 0 },
    { "shift", 0 },         { "parts", 0 },
};
static const char *format = "MJPG", *views;

static double option(const char *name)
{
    for (size_t i = 0; i < ARRAY_LEN(options); i++) {
        if (!strcmp(options[i].name, name))
            return options[i].value;
    }
    abort();
}

static void read_options(int argc, char **argv)
{
    for (int a = 3; a < argc; a++) {
        const char *eq = strchr(argv[a], '=');
        size_t i = 0;

        if (!strncmp(argv[a], "format=", 7)) {
            format = argv[a] + 7;
            continue;
        }
        if (!strncmp(argv[a], "views=", 6)) {
            views = argv[a] + 6;
            continue;
        }
        while (i < ARRAY_LEN(options) && !(eq && strlen(options[i].name) == (size_t)(eq - argv[a]) &&
                                           !strncmp(options[i].name, argv[a], (size_t)(eq - argv[a]))))
            i++;
        if (i == ARRAY_LEN(options)) {
            fprintf(stderr, "unknown option %s\n", argv[a]);
            exit(2);
        }
        options[i].value = atof(eq + 1);
    }
}

/* Camera cam's picture in set `index`: columns of different brightness, red by camera, blue by set. */
static size_t make_jpeg(struct synthetic *s, int index, int cam, uint8_t *data)
{
    struct sst_image img;
    char path[] = "/tmp/sst-jpeg-XXXXXX";
    const int fd = mkstemp(path);
    uint8_t *file;
    size_t n;

    if (fd < 0 || sst_image_init(&img, s->width, s->height))
        abort();
    for (int y = 0; y < s->height; y++) {
        memset(sst_image_row(&img, 0, y), cam * 7 % 256, (size_t)s->width);
        memset(sst_image_row(&img, 2, y), index * 11 % 256, (size_t)s->width);
        if (option("parts") != 0) /* the right-hand half stands still */
            memset(sst_image_row(&img, 2, y) + s->width / 2, 0, (size_t)(s->width - s->width / 2));
        for (int x = 0; x < s->width; x++)
            sst_image_row(&img, 1, y)[x] = (uint8_t)(x * 3 + cam);
    }
    if (sst_image_write_jpeg(&img, path, 90) || sst_file_read(path, s->bytes, &file, &n))
        abort();
    memcpy(data, file, n);
    free(file);
    sst_image_fini(&img);
    unlink(path);
    close(fd);
    return n;
}

/* A picture's differences from that of the first set. */
static size_t cut_parts(struct synthetic *s, int cam, size_t bytes, int64_t base_ns)
{
    uint8_t *data = s->data + (size_t)cam * s->bytes, *base = malloc(s->bytes), *parts;
    struct sst_jpeg_pair pair = { { base, make_jpeg(s, 0, cam, base) }, { data, bytes }, s->width, s->height };
    size_t n;

    if (sst_jpeg_parts_cut(&pair, base_ns, &parts, &n, NULL) || n > s->bytes)
        abort();
    memcpy(data, parts, n);
    free(parts);
    free(base);
    return n;
}

static void put_pictures(struct synthetic *s, int index, struct sst_frameset *set, int64_t base_ns)
{
    for (int k = 0; k < s->cameras; k++) {
        if (!set->frame[k])
            continue;
        set->frame[k]->bytes = make_jpeg(s, index, k, s->data + (size_t)k * s->bytes);
        if (option("parts") != 0 && index > 0) {
            set->frame[k]->bytes = cut_parts(s, k, set->frame[k]->bytes, base_ns);
            set->frame[k]->faults |= SST_FRAME_PARTS;
        }
    }
}

static struct sst_image *read_views(const struct synthetic *s)
{
    struct sst_image *img = calloc((size_t)s->cameras, sizeof(*img));
    char path[SST_PATH_MAX];

    for (int k = 0; k < s->cameras; k++) {
        snprintf(path, sizeof(path), "%s/views/%02d_%02d.png", views, s->track[k].row, s->track[k].col);
        if (!img || sst_image_read(&img[k], path) || img[k].width != s->width || img[k].height != s->height)
            abort();
        for (int i = 0; k % 7 == 3 && i < 3 * s->height; i++) { /* from below */
            const int y = s->height - 1 - i / 3;

            memmove(sst_image_row(&img[k], i % 3, y),
                    sst_image_row(&img[k], i % 3, sst_max_int(y - (int)option("shift"), 0)), (size_t)s->width);
        }
    }
    return img;
}

/* One pixel of an uncompressed frame. */
static void put_sample(uint8_t *to, const struct synthetic *s, const struct sst_image *img, int x, int y)
{
    int red[2], c = 1;

    if (sst_raw_red(s->fourcc, &red[0], &red[1]) && (x % 2 == red[0]) == (y % 2 == red[1]))
        c = x % 2 == red[0] ? 0 : 2;
    if (s->fourcc == V4L2_PIX_FMT_Y16) {
        const int v = 16 * sst_image_row(img, 1, y)[x] + (x + y) % 16;

        to[2 * (y * s->width + x)] = (uint8_t)v;
        to[2 * (y * s->width + x) + 1] = (uint8_t)(v >> 8);
    } else {
        to[y * s->width + x] = sst_image_row(img, c, y)[x];
    }
}

static void put_view(struct synthetic *s, struct sst_frame *f, const struct sst_image *img)
{
    uint8_t *data = s->data + (size_t)f->cam * s->bytes, *file;

    if (s->fourcc == V4L2_PIX_FMT_MJPEG) {
        if (sst_image_encode_jpeg(img, 95, &file, &f->bytes) || f->bytes > s->bytes)
            abort();
        memcpy(data, file, f->bytes);
        free(file);
        return;
    }
    for (int y = 0; y < s->height; y++) {
        for (int x = 0; x < s->width; x++)
            put_sample(data, s, img, x, y);
    }
}

static int write_sets(struct synthetic *s, const char *dir, bool bench)
{
    struct sst_recorder_config cfg = synthetic_config(s, dir);
    const int first = (int)option("first");
    int n = (int)option("sets"), failed = 0;
    bool went_on = false;
    int64_t base_ns = 0, cpu = 0, wall = 0, longest = 0, bytes = 0, due = sst_clock_now_ns();
    struct sst_image *img = NULL;
    struct sst_recorder *r;
    int err;

    if (views)
        img = read_views(s);
    cfg.append = option("append") != 0;
    cfg.sync_s = option("sync");
    cfg.segment_s = option("segment_s");
    cfg.segment_bytes = (int64_t)option("segment_bytes");
    err = sst_recorder_open(&r, &cfg);
    for (int i = first; !err && i < first + n; i++) {
        struct sst_frameset set;
        int64_t c0, t0, took;

        synthetic_set(s, (uint64_t)i, &set);
        base_ns = i == 0 ? set.wall_ns : base_ns;
        if (option("jpeg") != 0)
            put_pictures(s, i, &set, base_ns);
        for (int k = 0; img && k < s->cameras; k++) {
            if (set.frame[k])
                put_view(s, &s->frame[k], &img[k]);
        }
        c0 = sst_clock_cpu_ns();
        t0 = sst_clock_now_ns();
        err = sst_recorder_write(r, &set);
        took = sst_clock_now_ns() - t0;
        cpu += sst_clock_cpu_ns() - c0;
        wall += took;
        longest = took > longest ? took : longest;
        for (int k = 0; k < s->cameras; k++)
            bytes += set.frame[k] ? (int64_t)set.frame[k]->bytes : 0;
        if (!bench && !err) {
            printf("%d\n", i + 1);
            fflush(stdout);
        }
        went_on = went_on || (failed && !err);
        if (err && option("stay") != 0) {
            n += !went_on && ++failed < 3000;
            usleep(20000);
            err = 0;
        }
        due += s->period_ns;
        if (option("pace") != 0 && due > sst_clock_now_ns())
            usleep((useconds_t)((due - sst_clock_now_ns()) / 1000));
    }
    for (int k = 0; img && k < s->cameras; k++)
        sst_image_fini(&img[k]);
    free(img);
    if (err)
        return 1;
    if (sst_recorder_close(r))
        return 1;
    if (bench)
        printf("%d sets of %d cameras, %.3f MB each: CPU %.3f ms, wall %.3f ms, longest %.1f ms per set\n",
               n, s->cameras, (double)bytes * 1e-6 / n, (double)cpu * 1e-6 / n, (double)wall * 1e-6 / n,
               (double)longest * 1e-6);
    return 0;
}

static bool frame_is(const struct sst_recording *r, const struct sst_recording_set *set, struct synthetic *s, int k)
{
    const struct sst_recording_frame *f = &set->frame[k];
    bool same;
    uint8_t *data;

    if (f->present == synthetic_missing(s, set->index, k))
        return false;
    if (!f->present)
        return true;
    if (f->bytes != synthetic_bytes(s, set->index, k) || f->t_ns != set->t_ns + synthetic_dt_ns(set->index, k) ||
        sst_recording_frame(r, set, k, &data))
        return false;
    synthetic_fill(s->data, f->bytes, set->index, k);
    same = !memcmp(data, s->data, f->bytes);
    free(data);
    return same;
}

/* Indices grow by one: a set lost between two runs of the writer would show here, and the caller counts the end. */
static int check_sets(struct synthetic *s, const char *dir)
{
    struct sst_recording *r;
    struct sst_recording_set set;
    int n;

    if (sst_recording_open(&r, dir))
        return 1;
    n = sst_recording_sets(r);
    for (int i = 0; i < n; i++) {
        bool good = !sst_recording_set(r, i, &set) && set.index == (uint64_t)i;

        for (int k = 0; good && k < s->cameras; k++)
            good = frame_is(r, &set, s, k);
        if (!good) {
            fprintf(stderr, "set %d is not what was written\n", i);
            return 1;
        }
    }
    printf("%d\n", n);
    sst_recording_close(r);
    return 0;
}

int main(int argc, char **argv)
{
    struct synthetic s = { 0 };
    int rc = 2;

    if (argc < 3)
        return 2;
    read_options(argc, argv);
    s.cameras = (int)option("cameras");
    s.width = (int)option("width");
    s.height = (int)option("height");
    s.fourcc = sst_recording_format_parse(format);
    s.bytes = (size_t)option("bytes");
    s.exact = option("exact") != 0;
    if (s.fourcc != V4L2_PIX_FMT_MJPEG) {
        s.bytes = (size_t)s.width * (size_t)s.height *
                  (s.fourcc == V4L2_PIX_FMT_YUYV || s.fourcc == V4L2_PIX_FMT_Y16 ? 2 : 1);
        s.exact = true;
    }
    s.period_ns = (int64_t)(1e9 / option("rate"));
    s.holes = option("holes") != 0;
    synthetic_init(&s);
    if (!strcmp(argv[1], "write") || !strcmp(argv[1], "bench"))
        rc = write_sets(&s, argv[2], argv[1][0] == 'b');
    else if (!strcmp(argv[1], "check"))
        rc = check_sets(&s, argv[2]);
    synthetic_fini(&s);
    return rc;
}
