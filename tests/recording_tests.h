/* tests/recording_tests.h - what the tests of recordings share: a folder per test, a small array, comparisons. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_RECORDING_TESTS_H
#define SST_TESTS_RECORDING_TESTS_H

#include <errno.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include <linux/videodev2.h>

#include "base/file.h"
#include "base/log.h"
#include "capture/recording/recording.h"
#include "tests/synthetic_sets.h"
#include "tests/test.h"

static char top[] = "/tmp/sst-recording-XXXXXX";
static char dir[SST_PATH_MAX]; /* of one test */
static char said[SST_LOG_MAX]; /* the last error */

static inline const char *in(const char *folder, const char *name)
{
    static char path[8][SST_PATH_MAX];
    static int next;

    next = (next + 1) % 8;
    assert_int_equal(sst_path_join(path[next], folder, name), 0);
    return path[next];
}

static inline int each_setup(void **state)
{
    static int n;

    (void)state;
    snprintf(dir, sizeof(dir), "%s/%d", top, n++);
    said[0] = 0;
    sst_log_hold_errors(said);
    return 0;
}

static inline int each_teardown(void **state)
{
    (void)state;
    sst_log_hold_errors(NULL);
    return 0;
}

static inline struct synthetic small(void)
{
    struct synthetic s = {
        .cameras = 3, .fourcc = V4L2_PIX_FMT_MJPEG, .width = 8, .height = 6, .bytes = 40, .period_ns = 100000000
    };

    synthetic_init(&s);
    return s;
}

static inline struct sst_recorder *record(struct synthetic *s, const struct sst_recorder_config *cfg, int from, int to)
{
    struct sst_recorder *r;

    assert_int_equal(sst_recorder_open(&r, cfg), 0);
    for (int i = from; i < to; i++) {
        struct sst_frameset set;

        synthetic_set(s, (uint64_t)i, &set);
        assert_int_equal(sst_recorder_write(r, &set), 0);
    }
    return r;
}

/* Is set i of a recording the one that was written with this index? */
static inline void assert_set(const struct sst_recording *r, int i, struct synthetic *s, uint64_t index)
{
    struct sst_recording_set set;
    uint8_t *want = (uint8_t *)malloc(s->bytes), *data;

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
static inline void assert_recording(const char *at, struct synthetic *s, int n)
{
    struct sst_recording *r;

    assert_int_equal(sst_recording_open(&r, at), 0);
    assert_int_equal(sst_recording_sets(r), n);
    for (int i = 0; i < n; i++)
        assert_set(r, i, s, (uint64_t)i);
    sst_recording_close(r);
}

static inline int64_t size_of(const char *path)
{
    struct stat st;

    return stat(path, &st) ? -1 : (int64_t)st.st_size;
}

static inline int remove_all(void **state)
{
    (void)state;
    sst_path_remove_tree(top);
    return 0;
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, each_setup, each_teardown)

/* Of each main(): what must be before the tests run. @return 0, else the exit code */
static inline int begin_tests(bool can_record)
{
    if (!can_record) {
        puts("built without libavformat: nothing can be recorded");
        return 77;
    }
    sst_log_set_level(SST_LOG_ERROR); /* each warning comes many times */
    return mkdtemp(top) ? 0 : 1;
}

#endif
