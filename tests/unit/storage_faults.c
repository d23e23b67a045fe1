/* daemon/storage on bad disks: full, hung, gone, shared, killed. Each fault is a state that passes by itself. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/statvfs.h>
#include <sys/syscall.h>
#include <sys/wait.h>

#if WITH_AVFORMAT
#include <libavformat/avformat.h>
#else
#define LIBAVFORMAT_VERSION_MAJOR 0
#define AV_STRINGIFY(version)     #version
#endif

#include "tests/quick.h"
#include "tests/storage_bench.h"

#define MS    ((int64_t)1000000)
#define KILLS 50

/* --- faults: the system's calls, made to fail or to hang ---------------------------------------------------------- */

static _Atomic int write_errno; /* of pwrite, while not 0 */
static _Atomic bool hang;       /* writes and syncs wait while it is set */

static void wait_while_hung(void)
{
    while (hang)
        usleep(1000);
}

ssize_t pwrite(int fd, const void *data, size_t n, off_t offset)
{
    wait_while_hung();
    if (write_errno) {
        errno = write_errno;
        return -1;
    }
    return syscall(SYS_pwrite64, fd, data, n, offset);
}

int fdatasync(int fd SST_UNUSED)
{
    wait_while_hung();
    return 0; /* the disk has time; the test has not */
}

int fsync(int fd SST_UNUSED)
{
    wait_while_hung();
    if (write_errno)
        errno = write_errno;
    return write_errno ? -1 : 0;
}

/* --- helpers ------------------------------------------------------------------------------------------------------ */

static void feed(struct bench *b, int n)
{
    for (int i = 0; i < n; i++) {
        bench_put(b, sst_clock_now_ns());
        usleep(2000);
    }
}

/* Feed sets until storage is in this state. */
static void feed_until(struct bench *b, enum sst_storage_state state)
{
    const int64_t end_ns = sst_clock_now_ns() + 60000 * MS;

    while (sst_storage_state(b->storage) != state) {
        assert_true(sst_clock_now_ns() < end_ns);
        feed(b, 1);
    }
}

/* Feed sets until this many such events were emitted: a state may have ended before it is checked. */
static void feed_until_event(struct bench *b, const char *type, const char *words, int n)
{
    const int64_t end_ns = sst_clock_now_ns() + 60000 * MS;

    while (bench_events(b, type, words) < n) {
        assert_true(sst_clock_now_ns() < end_ns);
        feed(b, 1);
    }
    assert_int_equal(bench_events(b, type, words), n);
}

/* Feed sets until they are being recorded. */
static void feed_until_recorded(struct bench *b)
{
    const int64_t end_ns = sst_clock_now_ns() + 60000 * MS;

    while (!bench_number(b, "recording", "active") || bench_number(b, "recording", "sets") < 3) {
        assert_true(sst_clock_now_ns() < end_ns);
        feed(b, 1);
    }
}

static const char *self;
static bool own_namespace; /* of users, in which any user may mount */

/* Run one of the tests below in a process of its own, which may mount, be another user, or leave hung threads behind.
 */
static int in_process(const char *test)
{
    const pid_t pid = fork();
    int status = 0;

    assert_true(pid >= 0);
    if (!pid) {
        if (own_namespace)
            execlp("unshare", "unshare", "--user", "--map-root-user", "--mount", self, test, (char *)NULL);
        else
            execl(self, self, test, (char *)NULL);
        _exit(127);
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128;
}

/* --- tests -------------------------------------------------------------------------------------------------------- */

static void a_full_disk_is_a_state(void **state)
{
    static const int codes[] = { ENOSPC, EROFS, EIO };
    static const int answers[] = { -ENOSPC, -EROFS, -EIO };
    char name[64], path[SST_PATH_MAX];
    struct bench b;

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(codes); i++) {
        int64_t sets;

        sst_path_remove_tree(dir);
        bench_init(&b, SST_RECORD_CONTINUOUS);
        bench_open_storage(&b);
        bench_wait_ready(&b);
        feed(&b, 10);
        bench_wait(&b, "recording", "sets", 10);
        write_errno = codes[i];
        feed_until(&b, SST_STORAGE_FULL);
        feed(&b, 30);
        bench_wait_event(&b, "storage", "\"state\":\"FULL\"", 1);
        assert_int_equal(sst_storage_record(b.storage, 1, name), answers[i]);
        assert_int_equal(sst_storage_snapshot(b.storage, NULL, 0, name), answers[i]);
        assert_true(bench_number(&b, "recording", "dropped") > 0);
        write_errno = 0;
        feed_until(&b, SST_STORAGE_OK);
        bench_wait_event(&b, "storage", NULL, 2);
        sets = bench_number(&b, "recording", "sets");
        feed(&b, 10);
        bench_wait(&b, "recording", "sets", sets + 5);
        /* It ends while nothing can be written: the next recording is tried by itself. */
        write_errno = codes[i];
        feed_until(&b, SST_STORAGE_FULL);
        b.config->storage.mode = SST_RECORD_OFF;
        assert_int_equal(sst_storage_configure(b.storage, b.config), 0);
        bench_wait_inactive(&b);
        write_errno = 0;
        bench_wait_state(&b, SST_STORAGE_OK);
        assert_int_equal(bench_recording(&b, 0, path), 1);
        bench_fini(&b);
    }
}

static void a_service_alone_has_the_folder(void **state)
{
    struct bench a, b;

    (void)state;
    bench_init(&a, SST_RECORD_CONTINUOUS);
    bench_open_storage(&a);
    feed(&a, 5);
    bench_wait(&a, "recording", "sets", 5);
    bench_init(&b, SST_RECORD_CONTINUOUS);
    bench_open_storage(&b);
    feed(&b, 5);
    bench_wait_state(&b, SST_STORAGE_FULL);
    bench_wait_event(&b, "storage", "another sstd", 1);
    assert_int_equal(bench_number(&b, "recording", "active"), 0);
    feed(&a, 5);
    bench_wait(&a, "recording", "sets", 10);
    bench_fini(&a);
    feed_until(&b, SST_STORAGE_OK); /* takes over */
    feed_until_recorded(&b);
    assert_int_equal(bench_number(&b, NULL, "recordings"), 2);
    bench_fini(&b);
}

static void a_folder_that_goes_is_made_again(void **state)
{
    struct bench b;

    (void)state;
    bench_init(&b, SST_RECORD_CONTINUOUS);
    bench_open_storage(&b);
    feed(&b, 5);
    bench_wait(&b, "recording", "sets", 5);
    sst_path_remove_tree(dir);
    bench_wait_event(&b, "storage", "was removed", 1);
    feed_until(&b, SST_STORAGE_OK);
    feed_until_recorded(&b);
    feed(&b, 5);
    assert_int_equal(bench_number(&b, NULL, "recordings"), 1);
    /* Only the recording at work: the next set begins another. */
    sst_path_remove_tree(in(dir, "recordings/"));
    feed_until_event(&b, "storage", "was removed", 2);
    feed_until(&b, SST_STORAGE_OK);
    bench_fini(&b);
}

/* Nothing that the disk does may be waited for by callers, nor by the end of the service. */
static void hung_disk(void **state)
{
    int64_t start_ns;
    char name[64] = "x";
    struct bench b;
    int refused = 0;
    struct sst_download *d;

    (void)state;
    bench_init(&b, SST_RECORD_CONTINUOUS);
    bench_open_storage(&b);
    feed(&b, 20);
    bench_wait(&b, "recording", "sets", 20);
    hang = true;
    start_ns = sst_clock_now_ns();
    while (sst_storage_state(b.storage) != SST_STORAGE_FULL) {
        const int64_t before_ns = sst_clock_now_ns();

        bench_put(&b, before_ns);
        refused += 0 != sst_storage_record(b.storage, 1, name);
        refused += 0 != sst_storage_export(b.storage, NULL, sst_clock_wall_ns(), name);
        refused += 0 != sst_storage_snapshot(b.storage, NULL, 0, name);
        refused += 0 != sst_storage_download(b.storage, name, &d);
        (void)bench_number(&b, NULL, "recordings");
        assert_quick(before_ns, 3000 * MS); /* three calls that wait */
        assert_quick(start_ns, 20000 * MS);
    }
    assert_true(refused);
    bench_wait_event(&b, "storage", "does not answer", 1);
    start_ns = sst_clock_now_ns();
    assert_false(sst_storage_close(b.storage, 500));
    assert_quick(start_ns, 900 * MS);
    sst_path_remove_tree(top);
    syscall(SYS_exit_group, 0); /* its threads still hang: only the process can end them */
}

static void a_hung_disk_holds_nobody_up(void **state)
{
    (void)state;
    assert_int_equal(in_process("hung_disk"), 0);
}

/* A recording that cannot begin is tried again and again, and reported once. */
static void a_recording_that_cannot_begin_is_reported_once(void **state)
{
    struct bench b;

    (void)state;
    bench_init(&b, SST_RECORD_CONTINUOUS);
    b.config->array.rows = b.config->array.cols = 1; /* no grid for three cameras */
    bench_open_storage(&b);
    feed_until(&b, SST_STORAGE_FULL);
    for (int i = 0; i < 3; i++) {
        usleep(500000);
        feed(&b, 1);
    }
    assert_int_equal(bench_events(&b, "storage", "the grid does not hold the cameras"), 1);
    assert_int_equal(bench_events(&b, "storage", NULL), 1);
    assert_int_equal(bench_number(&b, NULL, "recordings"), 0);
    b.config->array.cols = 6;
    sst_storage_cameras(b.storage, &b.config->array, b.sets.track);
    feed_until(&b, SST_STORAGE_OK);
    bench_fini(&b);
}

/* Also of one that is asked for at once again the reason is known. */
static void a_refused_recording_has_its_reason(void **state)
{
    struct sst_storage_report *report = calloc(1, sizeof(*report));
    char name[64];
    struct bench b;

    (void)state;
    assert_non_null(report);
    bench_init(&b, SST_RECORD_OFF);
    b.config->array.rows = b.config->array.cols = 1; /* no grid for three cameras */
    bench_open_storage(&b);
    bench_wait_ready(&b);
    feed(&b, 1);
    for (int i = 0; i < 3; i++) {
        assert_int_not_equal(sst_storage_record(b.storage, 1, name), 0);
        sst_storage_report(b.storage, report);
        assert_non_null(strstr(report->reason, "the grid does not hold the cameras"));
        assert_int_equal(report->state, SST_STORAGE_FULL);
    }
    free(report);
    bench_wait_event(&b, "storage", "nothing can be stored: ", 1);
    bench_fini(&b);
}

/* Without FFmpeg's libraries no set can be written; the disk is not full. */
static void no_libraries(void **state)
{
    struct sst_storage_report *report = calloc(1, sizeof(*report));
    char name[64];
    struct bench b;

    (void)state;
    assert_non_null(report);
    bench_init(&b, SST_RECORD_OFF);
    bench_open_storage(&b);
    bench_wait_ready(&b);
    bench_put_pictures(&b, 1, sst_clock_now_ns());
    for (int i = 0; i < 3; i++) {
        assert_int_equal(sst_storage_record(b.storage, 1, name), -ENOTSUP);
        sst_storage_report(b.storage, report);
        assert_string_equal(report->reason, SST_STORE_NO_MUXER);
        assert_int_equal(report->limit, 0);
    }
    bench_wait_event(&b, "storage", "nothing can be recorded: recordings and snapshots need FFmpeg", 1);
    assert_int_equal(bench_events(&b, "storage", "is FULL"), 0);
    assert_int_equal(sst_storage_snapshot(b.storage, (const uint8_t *)"picture", 7, name), -ENOTSUP);
    bench_wait_event(&b, "snapshot", "sst-video", 1);
    assert_int_equal(bench_number(&b, NULL, "recordings"), 0);
    free(report);
    bench_fini(&b);
}

static void missing_libraries_are_no_full_disk(void **state)
{
    const char *before = getenv("LD_LIBRARY_PATH"), *name = in(top, "libavformat.so." AV_STRINGIFY(LIBAVFORMAT_VERSION_MAJOR));
    FILE *f = fopen(name, "w");

    (void)state;
    assert_true(f && fputs("no library", f) > 0 && !fclose(f));
    assert_int_equal(setenv("LD_LIBRARY_PATH", top, 1), 0);
    assert_int_equal(in_process("no_libraries"), 0);
    assert_int_equal(before ? setenv("LD_LIBRARY_PATH", before, 1) : unsetenv("LD_LIBRARY_PATH"), 0);
}

/* A snapshot that takes longer than a caller waits is still made. */
static void a_download_waits_for_its_snapshot(void **state)
{
    struct sst_download *d;
    struct bench b;
    char name[64];

    (void)state;
    bench_init(&b, SST_RECORD_OFF);
    bench_open_storage(&b);
    bench_wait_ready(&b);
    bench_put_pictures(&b, 1, sst_clock_now_ns());
    hang = true;
    assert_int_equal(sst_storage_snapshot(b.storage, (const uint8_t *)"picture", 7, name), 0);
    assert_int_equal(bench_events(&b, "snapshot", NULL), 0);
    assert_int_equal(sst_storage_download(b.storage, name, &d), -EINPROGRESS);
    hang = false;
    assert_int_equal(bench_open(&b, name, &d), 0);
    assert_int_equal(d->bytes, 7);
    assert_int_equal(bench_copy(d, 1, 6, in(top, "got")), 6);
    d->close(d);
    bench_wait_event(&b, "snapshot", "is made", 1);
    bench_fini(&b);
}

static int private_mount(unsigned long bytes)
{
    char size[64];

    snprintf(size, sizeof(size), "size=%lu", bytes);
    return mount("none", dir, "tmpfs", 0, size) ? -1 : 0;
}

static void small_disk(void **state)
{
    const bool mounted = !mkdir(dir, 0777) && !unshare(CLONE_NEWNS) &&
                         !mount("none", "/", NULL, MS_REC | MS_PRIVATE, NULL) && !private_mount(8 << 20);
    struct bench b;
    char *zeros = calloc(1, 1 << 20);
    FILE *f;
    int n = 0;

    (void)state;
    if (!mounted && (errno == EPERM || errno == EACCES))
        _exit(77);
    assert_true(mounted);
    bench_init(&b, SST_RECORD_CONTINUOUS);
    b.config->storage.min_free_gb = 0.002;
    bench_open_storage(&b);
    feed_until_recorded(&b);
    /* Others fill the disk: beyond the free space that is to be left, then wholly. */
    f = fopen(in(dir, "others"), "wb");
    assert_true(f && zeros);
    while (fwrite(zeros, 1, 1 << 20, f) == 1 << 20)
        n++;
    fclose(f);
    free(zeros);
    feed_until(&b, SST_STORAGE_FULL);
    assert_true(n >= 6 && size_of(in(dir, "others")) >= n << 20); /* foreign files are not touched */
    unlink(in(dir, "others"));
    feed_until(&b, SST_STORAGE_OK);
    feed_until_recorded(&b);

    /* Another file system over it, and away again. */
    assert_int_equal(private_mount(16 << 20), 0);
    bench_wait_event(&b, "storage", "another file system", 1);
    feed_until(&b, SST_STORAGE_OK);
    feed_until_recorded(&b);
    assert_int_equal(access(in(dir, "recordings"), F_OK), 0);
    assert_int_equal(umount2(dir, MNT_DETACH), 0);
    bench_wait_event(&b, "storage", "another file system", 2);
    feed_until(&b, SST_STORAGE_OK);
    feed_until_recorded(&b);
    bench_fini(&b);
    umount2(dir, MNT_DETACH);
}

static void a_small_disk_is_filled_by_others(void **state)
{
    int code;

    (void)state;
    own_namespace = geteuid() && !system("unshare --user --map-root-user --mount true 2>/dev/null");
    code = in_process("small_disk");
    own_namespace = false;
    if (code == 77) {
        puts("no right to mount, also not in a namespace of users");
        skip();
    }
    assert_int_equal(code, 0);
}

static void forbidden_folder(void **state)
{
    struct bench b;

    (void)state;
    assert_int_equal(mkdir(dir, 0755), 0);
    assert_true(!chmod(top, 0755) && !seteuid(65534));
    bench_init(&b, SST_RECORD_CONTINUOUS);
    bench_open_storage(&b);
    feed(&b, 5);
    bench_wait_event(&b, "storage", "give it and all in it to the user", 1);
    assert_int_equal(seteuid(0), 0);
    assert_int_equal(chmod(dir, 0777), 0);
    assert_int_equal(seteuid(65534), 0);
    feed_until(&b, SST_STORAGE_OK);
    feed_until_recorded(&b);
    bench_fini(&b);
    assert_int_equal(seteuid(0), 0);
}

static void a_folder_of_others_is_told(void **state)
{
    (void)state;
    if (getuid()) {
        puts("not root: a folder of another user is not tried");
        skip();
    }
    assert_int_equal(in_process("forbidden_folder"), 0);
}

/* Sets that a killed service reported as recorded are there, run after run, and the next one mends the recording. */
struct shared {
    _Atomic int run;
    _Atomic int64_t acknowledged[KILLS];
};

static void serve_until_killed(struct shared *shared, int run)
{
    struct bench b;

    bench_init(&b, SST_RECORD_CONTINUOUS);
    b.index = (uint64_t)run * 100000;
    bench_open_storage(&b);
    for (;;) {
        for (int i = 0; i < 5; i++)
            bench_put(&b, sst_clock_now_ns());
        usleep(500);
        shared->acknowledged[run] = bench_number(&b, "recording", "sets");
    }
}

static void kills_lose_nothing_that_was_said_to_be_there(void **state)
{
    struct shared *shared = mmap(NULL, sizeof(*shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    int64_t all = 0, end_ns;
    struct bench b;
    int n, torn = 1;

    (void)state;
    for (int run = 0; run < KILLS; run++) {
        const pid_t pid = fork();
        int status;

        assert_true(pid >= 0);
        if (!pid)
            serve_until_killed(shared, run);
        /* Every second time not before something was recorded, however slow the machine is. */
        for (int i = 0; i < 60000 && run % 2 && shared->acknowledged[run] <= 10; i++)
            usleep(1000);
        usleep((useconds_t)(synthetic_hash((uint64_t)run) % 100000));
        assert_int_equal(kill(pid, SIGKILL), 0);
        assert_int_equal(waitpid(pid, &status, 0), pid);
        assert_true(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
        all += shared->acknowledged[run];
    }
    assert_true(all > KILLS * 5);
    bench_init(&b, SST_RECORD_OFF);
    bench_open_storage(&b);
    bench_wait_ready(&b);
    for (end_ns = sst_clock_now_ns() + 240000 * MS; torn;) {
        char path[SST_PATH_MAX];

        torn = 0;
        n = bench_recording(&b, 0, path);
        for (int i = 0; i < n; i++) {
            char line[2 * SST_PATH_MAX];

            (void)bench_recording(&b, i, path);
            snprintf(line, sizeof(line), "grep -q '\"finished\": true' %s/storage.json", path);
            torn += system(line) != 0;
        }
        assert_true(sst_clock_now_ns() < end_ns);
        usleep(10000);
    }
    for (int i = 0; i < n; i++) {
        char path[SST_PATH_MAX];
        uint64_t first = 0;
        int count, run;

        (void)bench_recording(&b, i, path);
        count = bench_check(&b, path, &first);
        run = (int)(first / 100000);
        assert_true(count > 0 && count >= shared->acknowledged[run]);
        shared->acknowledged[run] = 0;
    }
    for (int run = 0; run < KILLS; run++)
        assert_int_equal(shared->acknowledged[run], 0);
    bench_fini(&b);
    munmap(shared, sizeof(*shared));
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        TEST(a_full_disk_is_a_state),
        TEST(a_service_alone_has_the_folder),
        TEST(a_folder_that_goes_is_made_again),
        TEST(a_hung_disk_holds_nobody_up),
        TEST(a_download_waits_for_its_snapshot),
        TEST(a_recording_that_cannot_begin_is_reported_once),
        TEST(a_refused_recording_has_its_reason),
        TEST(missing_libraries_are_no_full_disk),
        TEST(a_small_disk_is_filled_by_others),
        TEST(a_folder_of_others_is_told),
        TEST(kills_lose_nothing_that_was_said_to_be_there),
    };
    const struct CMUnitTest alone[] = { TEST(hung_disk), TEST(small_disk), TEST(forbidden_folder), TEST(no_libraries) };
    const int rc = begin_tests(WITH_AVFORMAT);

    if (rc)
        return rc;
    self = argv[0];
    if (argc < 2)
        return cmocka_run_group_tests(tests, NULL, remove_all);
    cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(alone, NULL, remove_all);
}
