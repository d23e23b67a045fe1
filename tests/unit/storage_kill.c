/* A service is killed (SIGKILL) at each step of making room and of beginning a recording, and at any moment of doing
 * both at once: what it had said to be recorded, and was not removed since, is there; its next run puts the rest in
 * order. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <stdatomic.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/wait.h>

#include "daemon/storage/storage_internal.h"
#include "tests/storage_bench.h"

#define MS     ((int64_t)1000000)
#define BYTES  20000 /* of a frame, three frames a set */
#define QUOTA  2500000
#define LARGE  60 /* sets of the recording that is trimmed: 3.6 MB in pieces of 5 */
#define SMALL  10 /* of one that goes as a whole */
#define RUNS   12
#define AHEAD  100 /* sets that are fed before they are recorded */
#define QUOTA2 6000000
#define RUN    100000 /* between the numbers of sets of two runs */

/* --- steps: the calls that change names, or make files durable ---------------------------------------------------- */

static _Atomic int kill_at; /* the process ends before that many more of them; 0: not */
static _Atomic int *steps;  /* that were made; NULL: not counted */

static void step(void)
{
    if (steps)
        ++*steps;
    if (kill_at && --kill_at == 0) {
        kill(getpid(), SIGKILL);
        for (;;)
            pause();
    }
}

int rename(const char *from, const char *to)
{
    step();
    return (int)syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0);
}

int unlink(const char *path)
{
    step();
    return (int)syscall(SYS_unlinkat, AT_FDCWD, path, 0);
}

int mkdir(const char *path, mode_t mode)
{
    step();
    return (int)syscall(SYS_mkdirat, AT_FDCWD, path, mode);
}

int fsync(int fd SST_UNUSED)
{
    step();
    return 0; /* the disk has time; the test has not */
}

int fdatasync(int fd SST_UNUSED)
{
    return 0; /* now and then, on a thread of its own: no step */
}

/* --- helpers ------------------------------------------------------------------------------------------------------ */

struct shared {
    _Atomic int steps;
    _Atomic int64_t acknowledged[RUNS], shortened[RUNS];
};

static struct shared *shared;

static struct synthetic large_sets(void)
{
    struct synthetic s = small();

    synthetic_fini(&s);
    s.bytes = BYTES;
    s.exact = true;
    synthetic_init(&s);
    return s;
}

static void init(struct bench *b, enum sst_record_mode mode, int64_t quota)
{
    bench_init(b, mode);
    synthetic_fini(&b->sets);
    b->sets = large_sets();
    sst_ring_destroy(b->ring);
    assert_int_equal(sst_ring_create(&b->ring, (size_t)64 << 20), 0);
    b->config->storage.quota_gb = (double)quota * 1e-9;
    b->config->storage.sync_s = 0.02;
}

/* A recording that was finished, as the service leaves it. */
static void make(uint64_t order, int sets)
{
    struct synthetic s = large_sets();
    char name[SST_STORE_NAME], path[SST_PATH_MAX];
    struct sst_recorder_config cfg = synthetic_config(&s, path);
    struct store_entry e = { .order = order, .why = "continuous", .stage = SST_STORE_DONE };

    e.from_ns = e.to_ns = e.made_ns = SYNTHETIC_WALL_NS + (int64_t)order * 100000 * MS;
    store_name(name, SST_STORE_RECORDING, e.made_ns, 1);
    snprintf(path, sizeof(path), "%s", in(in(dir, "recordings"), name));
    cfg.segment_s = 5 * (double)s.period_ns * 1e-9 - 0.001;
    assert_int_equal(sst_recorder_close(record(&s, &cfg, 0, sets)), 0);
    e.sets = (uint64_t)sets;
    e.bytes = store_bytes(path);
    assert_int_equal(store_write(path, &e), 0);
    synthetic_fini(&s);
}

/* All recordings, by their names in a folder that no service has. @return how many; left: other names */
static int all(char path[][SST_PATH_MAX], int max, int *left)
{
    DIR *d = opendir(in(dir, "recordings"));
    const struct dirent *e;
    int n = 0;

    assert_non_null(d);
    *left = 0;
    while ((e = readdir(d))) {
        if (e->d_name[0] == '.')
            continue;
        if (strstr(e->d_name, ".tmp-") ||
            !sst_path_exists(in(in(in(dir, "recordings"), e->d_name), "recording.json"))) {
            ++*left;
            continue;
        }
        assert_true(n < max);
        snprintf(path[n++], SST_PATH_MAX, "%s", in(in(dir, "recordings"), e->d_name));
    }
    closedir(d);
    return n;
}

/* No set that is listed is damaged, and all after the removed ones are listed. @return how many were recorded
 */
static int64_t check(struct bench *b, const char *path, uint64_t *first, int *sets)
{
    struct sst_recording *r;
    int64_t removed;

    assert_int_equal(sst_recording_open(&r, path), 0);
    removed = (int64_t)sst_recording_removed(r)->sets;
    assert_false(sst_recording_removed(r)->assumed);
    sst_recording_close(r);
    *first = 0;
    *sets = bench_check(b, path, first);
    *first -= (uint64_t)removed;
    return removed + *sets;
}

/* The service's status of a recording. */
static int64_t listed(struct bench *b, const char *path)
{
    json_t *list = sst_storage_list(b->storage);
    int64_t sets = -1;
    const json_t *one;
    size_t i;

    json_array_foreach(json_object_get(list, "recordings"), i, one)
    {
        if (!strcmp(json_string_value(json_object_get(one, "name")), sst_path_base(path)))
            sets = json_integer_value(json_object_get(one, "sets"));
    }
    json_decref(list);
    return sets;
}

static void wait_mended(struct bench *b)
{
    static char path[RUNS + 4][SST_PATH_MAX];
    const int64_t end_ns = sst_clock_now_ns() + 60000 * MS;
    int torn = 1, left;

    while (torn) {
        const int n = all(path, RUNS + 4, &left);

        torn = left;
        for (int i = 0; i < n; i++) {
            struct store_entry e = { .stage = SST_STORE_TORN };

            torn += store_read(path[i], &e) || e.stage == SST_STORE_TORN || listed(b, path[i]) != (int64_t)e.sets;
        }
        assert_true(sst_clock_now_ns() < end_ns);
        usleep(2000);
    }
}

static void wait_within(struct bench *b, int64_t quota)
{
    const int64_t end_ns = sst_clock_now_ns() + 60000 * MS;

    bench_wait_ready(b);
    while (bench_number(b, NULL, "used_bytes") > quota) {
        assert_true(sst_clock_now_ns() < end_ns);
        usleep(1000);
    }
}

/* Run it in a process of its own. @return true: it was killed */
static bool killed(void (*run)(void), int at)
{
    pid_t pid;
    int status;

    shared->steps = 0;
    pid = fork();
    assert_true(pid >= 0);
    if (!pid) {
        steps = &shared->steps;
        kill_at = at;
        run();
        _exit(0);
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFSIGNALED(status) ? WTERMSIG(status) == SIGKILL : !WEXITSTATUS(status));
    return WIFSIGNALED(status);
}

/* --- making room -------------------------------------------------------------------------------------------------- */

static void make_room(void)
{
    struct bench b;

    init(&b, SST_RECORD_OFF, QUOTA);
    bench_open_storage(&b);
    wait_within(&b, QUOTA - QUOTA / 20);
}

static void check_shortened(int n, char path[][SST_PATH_MAX], struct bench *b)
{
    for (int i = 0; i < n; i++) {
        uint64_t first;
        int sets;
        const int64_t was = check(b, path[i], &first, &sets);

        assert_true(first == 0 && (was == LARGE || was == SMALL));
        if (b->storage)
            assert_int_equal(listed(b, path[i]), sets);
    }
}

static void killed_while_it_makes_room(void **state)
{
    char path[2][SST_PATH_MAX];
    struct bench b;
    bool again = true;
    int at, left, last = 0;

    (void)state;
    for (at = 1; again; at++) {
        sst_path_remove_tree(dir);
        assert_int_equal(mkdir(dir, 0777) | mkdir(in(dir, "recordings"), 0777), 0);
        make(1, SMALL);
        make(2, LARGE);
        again = killed(make_room, at);
        b = (struct bench){ .sets = large_sets() };
        check_shortened(all(path, 2, &left), path, &b);
        synthetic_fini(&b.sets);
        assert_in_range(left, 0, 1);

        init(&b, SST_RECORD_OFF, QUOTA);
        bench_open_storage(&b);
        wait_within(&b, QUOTA - QUOTA / 20);
        assert_int_equal(all(path, 2, &left), 1); /* the large one, trimmed; the small one was removed */
        check_shortened(1, path, &b);
        assert_true(store_bytes(in(dir, "recordings")) <= QUOTA && store_bytes(path[0]) > QUOTA / 2);
        bench_fini(&b);
        assert_int_equal(all(path, 2, &left) + left, 1);
        last = again ? last : shared->steps;
    }
    assert_true(last > 25); /* at each of the steps, which are these */
}

/* --- beginning ---------------------------------------------------------------------------------------------------- */

static void record_five(void)
{
    struct bench b;

    init(&b, SST_RECORD_CONTINUOUS, 0);
    bench_open_storage(&b);
    bench_wait_ready(&b);
    for (int i = 0; i < 5; i++)
        bench_put(&b, sst_clock_now_ns());
    bench_wait(&b, "recording", "sets", 5);
    shared->acknowledged[0] = 5;
    bench_fini(&b);
}

static void killed_while_it_begins_and_ends(void **state)
{
    char path[1][SST_PATH_MAX];
    struct bench b;
    bool again = true;
    int left;

    (void)state;
    for (int at = 1; again; at++) {
        uint64_t first;
        int n, sets = 0;

        sst_path_remove_tree(dir);
        shared->acknowledged[0] = 0;
        again = killed(record_five, at);
        init(&b, SST_RECORD_OFF, 0);
        bench_open_storage(&b);
        bench_wait_ready(&b);
        wait_mended(&b);
        for (const int64_t end_ns = sst_clock_now_ns() + 60000 * MS;;) { /* a manifest may just be replaced */
            n = all(path, 1, &left);
            if (!left)
                break;
            assert_true(sst_clock_now_ns() < end_ns);
            usleep(2000);
        }
        assert_int_equal(bench_number(&b, NULL, "recordings"), n);
        if (n)
            assert_in_range(check(&b, path[0], &first, &sets), 1, 5);
        assert_true(sets >= shared->acknowledged[0]);
        bench_fini(&b);
    }
    assert_true(shared->steps > 10);
}

/* --- both at once ------------------------------------------------------------------------------------------------- */

static int run_number;

static void record_on_and_on(void)
{
    struct bench b;
    int64_t fed = 0;

    init(&b, SST_RECORD_CONTINUOUS, QUOTA2);
    b.index = (uint64_t)run_number * RUN;
    bench_open_storage(&b);
    bench_wait_ready(&b);
    for (;;) {
        const int64_t sets = bench_number(&b, "recording", "sets");

        shared->acknowledged[run_number] = sets;
        shared->shortened[run_number] = bench_number(&b, NULL, "shortened");
        for (int i = 0; i < 10 && fed < sets + AHEAD; i++, fed++)
            bench_put(&b, sst_clock_now_ns());
        usleep(200);
    }
}

static void kill_one(int run)
{
    const int64_t end_ns = sst_clock_now_ns() + 60000 * MS;
    pid_t pid;
    int status;

    run_number = run;
    pid = fork();
    assert_true(pid >= 0);
    if (!pid)
        record_on_and_on();
    while (shared->shortened[run] < 1 + run % 4) {
        assert_true(sst_clock_now_ns() < end_ns && !waitpid(pid, &status, WNOHANG));
        usleep(500);
    }
    usleep((useconds_t)(synthetic_hash((uint64_t)run) % 20000));
    assert_int_equal(kill(pid, SIGKILL), 0);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
}

static void killed_while_it_records_and_makes_room(void **state)
{
    char path[RUNS + 1][SST_PATH_MAX];
    bool newest = false;
    struct bench b;
    int n, left;

    (void)state;
    for (int run = 0; run < RUNS; run++)
        kill_one(run);
    init(&b, SST_RECORD_OFF, QUOTA2);
    bench_open_storage(&b);
    wait_within(&b, QUOTA2);
    wait_mended(&b);
    wait_within(&b, QUOTA2);
    assert_true(store_bytes(in(dir, "recordings")) <= QUOTA2);
    n = all(path, RUNS + 1, &left);
    assert_true(n > 0 && !left);
    for (int i = 0; i < n; i++) {
        uint64_t first;
        int sets;
        const int64_t was = check(&b, path[i], &first, &sets);

        assert_int_equal(listed(&b, path[i]), sets);
        assert_true(sets > 0 && was >= shared->acknowledged[first / RUN]);
        newest |= first / RUN == RUNS - 1;
    }
    assert_true(newest);
    bench_fini(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(killed_while_it_makes_room),
        TEST(killed_while_it_begins_and_ends),
        TEST(killed_while_it_records_and_makes_room),
    };
    const int rc = begin_tests(WITH_AVFORMAT);

    if (rc)
        return rc;
    shared = mmap(NULL, sizeof(*shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (shared == MAP_FAILED)
        return 1;
    return cmocka_run_group_tests(tests, NULL, remove_all);
}
