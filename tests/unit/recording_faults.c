/* Recordings after cuts and failures: all accepted sets are there and nothing else. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <sys/syscall.h>
#include <sys/wait.h>

#include "base/clock.h"
#include "tests/quick.h"
#include "tests/recording_tests.h"

/* --- faults: the system's calls, made to fail --------------------------------------------------------------------- */

static _Atomic int fail_in = -1; /* writes until one fails; below 0: none will */
static _Atomic int fail_many;    /* that many fail in a row */
static _Atomic int fail_errno;   /* 0: half of the bytes are written, and the rest at the next call */
static _Atomic int writes;
static _Atomic int sync_errno; /* of fdatasync, while not 0 */
static _Atomic int syncs[2];   /* calls of it that went well, and that failed */

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
    const int err = sync_errno;

    syncs[err != 0]++;
    if (err) {
        errno = err;
        return -1;
    }
    return 0; /* the disk has time; the test has not */
}

int fsync(int fd SST_UNUSED)
{
    return 0;
}

/* --- helpers ------------------------------------------------------------------------------------------------------ */

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

/* --- tests -------------------------------------------------------------------------------------------------------- */

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
            struct sst_frameset set;

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
                             ? set.frame[k].offset + (int64_t)set.frame[k].bytes
                             : segment_before;
    sst_recording_close(r);
    assert_true(segment > segment_before + 3 && list > list_before + 100);
    assert_cut(&s, &cfg, segment, list, 3);
    for (int64_t at = list_before; at < list; at++)
        assert_cut(&s, &cfg, segment, at, 2);
    for (int64_t at = segment_before; at < segment; at++)
        assert_cut(&s, &cfg, at, at % 2 ? list : list_before, 2);
    synthetic_fini(&s);
}

/* Write n sets into `at` while the write number `nth` and those behind it fail. @return the sets that were taken */
static int write_with_fault(struct synthetic *s, const char *at, int nth, int many, int err, bool taken[])
{
    struct sst_recorder_config cfg = synthetic_config(s, at);
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
        struct sst_frameset set;
        int e;

        synthetic_set(s, (uint64_t)i, &set);
        e = sst_recorder_write(r, &set);
        assert_true(!e || e == (err == EIO ? -EIO : err == EROFS ? -EROFS : -ENOSPC));
        taken[i] = !e;
        count += !e;
    }
    fail_in = -1;
    (void)sst_recorder_close(r);
    return count;
}

/* Every single write fails once, in each way: accepted sets are there, refused ones are not, and it goes on. */
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

/* A disk that stays full costs two attempts and then one each half second, and is reported once. */
static void a_full_disk_is_told_once(void **state)
{
    struct synthetic s = small();
    struct sst_recorder_config cfg = synthetic_config(&s, dir);
    struct sst_recorder *r = record(&s, &cfg, 0, 2);
    struct sst_frameset set;
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
        assert_quick(start, 5000000000);
        usleep(10000);
    }
    assert_int_equal(sst_recorder_close(r), 0);
    assert_recording(dir, &s, 3);
    synthetic_fini(&s);
}

static void wait_for_syncs(int n, bool failed)
{
    const int64_t start = sst_clock_now_ns();

    for (syncs[failed] = 0; syncs[failed] < n; usleep(1000))
        assert_quick(start, 20000000000);
}

static void syncs_beside_the_writer(void **state)
{
    struct synthetic s = small();
    struct sst_recorder_config cfg = synthetic_config(&s, dir);
    struct sst_recorder *r;
    struct sst_frameset set;

    (void)state;
    cfg.sync_s = 0.002;
    cfg.segment_bytes = 1000;
    r = record(&s, &cfg, 0, 30);
    wait_for_syncs(6, false);
    sync_errno = EIO;
    wait_for_syncs(20, true);
    sync_errno = 0;
    synthetic_set(&s, 30, &set); /* a new segment, nothing is lost */
    assert_int_equal(sst_recorder_write(r, &set), 0);
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(survives_a_torn_end),
        TEST(a_write_fails),
        TEST(a_full_disk_is_told_once),
        TEST(syncs_beside_the_writer),
    };
    const int rc = begin_tests(WITH_AVFORMAT);

    return rc ? rc : cmocka_run_group_tests(tests, NULL, remove_all);
}
