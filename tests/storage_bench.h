/* tests/storage_bench.h - storage on a folder of its own, fed with synthetic sets. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_STORAGE_BENCH_H
#define SST_TESTS_STORAGE_BENCH_H

#include "base/clock.h"
#include "daemon/storage/download.h"
#include "daemon/storage/storage.h"
#include "pipeline/image/codec.h"
#include "tests/recording_tests.h"

struct bench {
    struct synthetic sets;
    struct sst_config *config;
    struct sst_ring *ring;
    struct sst_events *events;
    struct sst_storage *storage;
    uint64_t index;  /* of the next set */
    int64_t wall_ns; /* added to the wall clock of sets */
    const uint8_t *still; /* bytes of all frames; NULL: those of synthetic sets */
};

static inline void bench_open_storage(struct bench *b)
{
    const struct sst_storage_config cfg = {
        .config = b->config, .ring = b->ring, .events = b->events, .tracks = b->sets.track
    };

    assert_int_equal(sst_storage_open(&b->storage, &cfg), 0);
}

/* Everything but the storage: the configuration may still be changed. */
static inline void bench_init(struct bench *b, enum sst_record_mode mode)
{
    *b = (struct bench){ .sets = small() };
    b->config = (struct sst_config *)calloc(1, sizeof(*b->config));
    assert_non_null(b->config);
    b->config->array.rows = 1;
    b->config->array.cols = 6;
    b->config->array.bound = b->sets.cameras;
    b->config->array.fourcc = b->sets.fourcc;
    b->config->array.width = b->sets.width;
    b->config->array.height = b->sets.height;
    b->config->array.trigger_hz = 10;
    b->config->live.plane_mm = -1;
    assert_true(strlen(dir) < sizeof(b->config->storage.dir));
    memcpy(b->config->storage.dir, dir, strlen(dir) + 1);
    b->config->storage.mode = mode;
    b->config->storage.segment_s = 60;
    b->config->storage.sync_s = 1;
    assert_int_equal(sst_ring_create(&b->ring, (size_t)8 << 20), 0);
    assert_int_equal(sst_events_create(&b->events, 256), 0);
}

static inline void bench_fini(struct bench *b)
{
    sst_ring_shut(b->ring);
    assert_true(sst_storage_close(b->storage, 60000));
    sst_events_shut(b->events);
    sst_events_destroy(b->events);
    sst_ring_destroy(b->ring);
    synthetic_fini(&b->sets);
    free(b->config);
}

/* The next set, as if it had been taken at this moment of CLOCK_MONOTONIC. */
static inline void bench_put(struct bench *b, int64_t t_ns)
{
    struct sst_frameset set;
    int64_t shift;

    synthetic_set(&b->sets, b->index++, &set);
    shift = t_ns - set.t_ns;
    set.t_ns = t_ns;
    set.wall_ns = sst_clock_wall_ns() - (sst_clock_now_ns() - t_ns) + b->wall_ns;
    for (int k = 0; k < set.cameras; k++) {
        if (!set.frame[k])
            continue;
        set.frame[k]->t_ns += shift;
        set.frame[k]->arrival_ns += shift;
        if (b->still)
            memcpy(b->sets.data + (size_t)k * b->sets.bytes, b->still, b->sets.bytes);
    }
    assert_int_equal(sst_ring_put(b->ring, &set), 0);
}

/* Storage of the status. */
static inline json_t *bench_status(struct bench *b)
{
    struct sst_storage_report report;

    sst_storage_report(b->storage, &report);
    return sst_fields_json(sst_storage_fields, &report);
}

/* A number of the status, or of its recording. */
static inline int64_t bench_number(struct bench *b, const char *part, const char *key)
{
    json_t *o = bench_status(b), *of = part ? json_object_get(o, part) : o;
    const json_t *v = json_object_get(of, key);
    const int64_t n = json_is_boolean(v) ? json_is_true(v) : json_integer_value(v);

    assert_non_null(v);
    json_decref(o);
    return n;
}

/* A busy disk may hold up one fsync for a minute. */
static inline int64_t bench_deadline(void)
{
    return sst_clock_now_ns() + 180000000000;
}

/* Fail after the deadline, with the status that did not come to what the test waits for. */
static inline void bench_assert_before(struct bench *b, int64_t end_ns)
{
    json_t *o;

    if (sst_clock_now_ns() < end_ns)
        return;
    o = bench_status(b);
    fputs("error: the status is ", stderr);
    json_dumpf(o, stderr, JSON_COMPACT);
    fputc('\n', stderr);
    json_decref(o);
    fail();
}

/* Wait until a number of the status is this, or more. */
static inline void bench_wait(struct bench *b, const char *part, const char *key, int64_t least)
{
    const int64_t end_ns = bench_deadline();

    while (bench_number(b, part, key) < least) {
        bench_assert_before(b, end_ns);
        usleep(2000);
    }
}

/* Wait until a number of the status is just this. */
static inline void bench_wait_exactly(struct bench *b, const char *part, const char *key, int64_t want)
{
    const int64_t end_ns = bench_deadline();

    while (bench_number(b, part, key) != want) {
        bench_assert_before(b, end_ns);
        usleep(2000);
    }
}

static inline void bench_wait_state(struct bench *b, enum sst_storage_state state)
{
    const int64_t end_ns = bench_deadline();

    while (sst_storage_state(b->storage) != state) {
        bench_assert_before(b, end_ns);
        usleep(2000);
    }
}

static inline void bench_wait_ready(struct bench *b)
{
    const int64_t end_ns = bench_deadline();
    bool ready = false;

    while (!ready) {
        json_t *o = bench_status(b);

        ready = json_integer_value(json_object_get(o, "free_bytes")) > 0;
        json_decref(o);
        bench_assert_before(b, end_ns);
        usleep(2000);
    }
}

static inline void bench_wait_inactive(struct bench *b)
{
    const int64_t end_ns = bench_deadline();

    while (bench_number(b, "recording", "active")) {
        bench_assert_before(b, end_ns);
        usleep(2000);
    }
}

/* Events of a type, with these words in their line (NULL: any), so far. */
static inline int bench_events(struct bench *b, const char *type, const char *words)
{
    char key[64], *line;
    uint64_t after = 0;
    int n = 0;

    snprintf(key, sizeof(key), "\"type\":\"%s\"", type);
    while (sst_events_next(b->events, after, &after, &line)) {
        n += strstr(line, key) && (!words || strstr(line, words));
        free(line);
    }
    return n;
}

static inline void bench_wait_event(struct bench *b, const char *type, const char *words, int n)
{
    const int64_t end_ns = bench_deadline();

    while (bench_events(b, type, words) < n) {
        bench_assert_before(b, end_ns);
        usleep(2000);
    }
    assert_int_equal(bench_events(b, type, words), n);
}

/* Path of the i-th recording; count of all. */
static inline int bench_recording(struct bench *b, int i, char path[SST_PATH_MAX])
{
    json_t *all = sst_storage_list(b->storage), *list = json_object_get(all, "recordings");
    const json_t *one = json_array_get(list, (size_t)i);
    const int n = (int)json_array_size(list);

    if (one)
        assert_int_equal(sst_path_join(path, in(dir, "recordings"), json_string_value(json_object_get(one, "name"))),
                         0);
    json_decref(all);
    return n;
}

/* Sets of a recording follow on one another, by content. @return their number; first: index of the first */
static inline int bench_check(struct bench *b, const char *path, uint64_t *first)
{
    struct sst_recording *r;
    struct sst_recording_set set;
    static uint8_t want[32768];
    uint8_t *data;
    int n;

    assert_int_equal(sst_recording_open(&r, path), 0);
    n = sst_recording_sets(r);
    for (int i = 0; i < n; i++) {
        assert_int_equal(sst_recording_set(r, i, &set), 0);
        if (!i)
            *first = set.index;
        assert_int_equal(set.index, *first + (uint64_t)i);
        for (int k = 0; k < b->sets.cameras; k++) {
            assert_int_equal(sst_recording_frame(r, &set, k, &data), 0);
            assert_true(set.frame[k].bytes <= sizeof(want));
            synthetic_fill(want, set.frame[k].bytes, set.index, k);
            assert_memory_equal(data, want, set.frame[k].bytes);
            free(data);
        }
    }
    sst_recording_close(r);
    return n;
}

/* Real pictures, for light fields. */
static inline void bench_put_pictures(struct bench *b, int n, int64_t first_ns)
{
    struct sst_image img;
    uint8_t *file;
    size_t bytes;

    assert_int_equal(sst_image_init(&img, 8, 6), 0);
    for (int c = 0; c < 3; c++)
        for (int y = 0; y < 6; y++)
            memset(sst_image_row(&img, c, y), 40 * (c + 1), 8);
    assert_int_equal(sst_image_write_jpeg(&img, in(top, "view.jpg"), 90), 0);
    assert_int_equal(sst_file_read(in(top, "view.jpg"), 1 << 20, &file, &bytes), 0);
    for (int i = 0; i < n; i++) {
        struct sst_frame frame[3];
        struct sst_frameset set = {
            .index = b->index++, .t_ns = first_ns + i * INT64_C(100000000), .cameras = 3, .present = 3
        };

        set.wall_ns = sst_clock_wall_ns() - (sst_clock_now_ns() - set.t_ns);
        for (int k = 0; k < 3; k++) {
            frame[k] = (struct sst_frame){ .cam = k,
                                           .fourcc = V4L2_PIX_FMT_MJPEG,
                                           .width = 8,
                                           .height = 6,
                                           .data = file,
                                           .bytes = bytes,
                                           .t_ns = set.t_ns,
                                           .arrival_ns = set.t_ns };
            set.frame[k] = &frame[k];
        }
        assert_int_equal(sst_ring_put(b->ring, &set), 0);
    }
    free(file);
    sst_image_fini(&img);
}

/* Open a download, made by then. @return 0 or the error */
static inline int bench_open(struct bench *b, const char *name, struct sst_download **d)
{
    int err;

    do
        err = sst_storage_download(b->storage, name, d);
    while (err == -EINPROGRESS);
    return err;
}

/* Bytes of a download from a position on, into a file; reads end where it cannot be read. @return bytes */
static inline int64_t bench_copy(struct sst_download *d, int64_t first, int64_t bytes, const char *path)
{
    FILE *f = fopen(path, "wb");
    char copy[4096];
    int64_t done = 0;
    ssize_t n = 1;

    assert_non_null(f);
    while (done < bytes && n > 0) {
        n = d->read(d, first + done, copy,
                    bytes - done < (int64_t)sizeof(copy) ? (size_t)(bytes - done) : sizeof(copy));
        if (n > 0)
            assert_int_equal(fwrite(copy, 1, (size_t)n, f), n);
        done += n > 0 ? n : 0;
    }
    fclose(f);
    return done;
}

/* All of a download, into a file. @return its size */
static inline int64_t bench_download(struct bench *b, const char *name, const char *want_type, const char *path)
{
    struct sst_download *d = NULL;
    int64_t bytes;

    assert_int_equal(bench_open(b, name, &d), 0);
    assert_string_equal(d->type, want_type);
    bytes = d->bytes;
    assert_int_equal(bench_copy(d, 0, bytes, path), bytes);
    d->close(d);
    return bytes;
}

#endif
