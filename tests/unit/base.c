/* base/: files that appear whole or not at all, parallel work. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/border.h"
#include "base/brake.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "base/mem.h"
#include "base/text.h"
#include "base/thread.h"
#include "tests/folder.h"
#include "tests/small.h"
#include "tests/test.h"

static int square(void *arg, int index, int worker SST_UNUSED)
{
    ((int *)arg)[index] = index * index;
    return 0;
}

static int fail_from_seven(void *arg SST_UNUSED, int index, int worker SST_UNUSED)
{
    return index >= 7 ? -index : 0;
}

static void parallel_for_runs_every_index(void **state SST_UNUSED)
{
    int out[1000] = { 0 };

    assert_int_equal(sst_parallel_for(1000, 4, square, out), 0);
    for (int i = 0; i < 1000; i++)
        assert_int_equal(out[i], i * i);
    assert_int_equal(sst_parallel_for(0, 4, square, out), 0);
}

static void parallel_for_reports_the_lowest_error(void **state SST_UNUSED)
{
    for (int threads = 1; threads < 9; threads++)
        assert_int_equal(sst_parallel_for(100, threads, fail_from_seven, NULL), -7);
}

static int complain_from_seven(void *arg SST_UNUSED, int index, int worker SST_UNUSED)
{
    if (index < 7)
        return sst_parallel_for(3, 2, fail_from_seven, NULL);
    sst_log_error("piece %d\n", index);
    return -index;
}

/* One of many errors is shown, the same one for any number of threads, and through nested calls; no line breaks. */
static void parallel_for_shows_one_error(void **state SST_UNUSED)
{
    char text[SST_LOG_MAX];

    for (int threads = 1; threads < 9; threads++) {
        text[0] = 0;
        assert_null(sst_log_hold_errors(text));
        assert_int_equal(sst_parallel_for(100, threads, complain_from_seven, NULL), -7);
        assert_ptr_equal(sst_log_hold_errors(NULL), text);
        assert_string_equal(text, "piece 7?");
    }
}

static void alloc_refuses_overflow(void **state SST_UNUSED)
{
    void *p = sst_mem_alloc(3, 5);

    assert_non_null(p);
    assert_int_equal((uintptr_t)p % SST_ALIGN, 0);
    sst_mem_free(p);
    assert_null(sst_mem_alloc(SIZE_MAX / 2, 3));
    assert_null(sst_mem_alloc(SIZE_MAX, 1));
}

static void arrays_grow_and_keep_their_elements(void **state SST_UNUSED)
{
    int *list = NULL, capacity = 0;

    for (int i = 0; i < 1000; i++) {
        assert_true(sst_mem_grow(&list, i, &capacity, sizeof(*list)));
        assert_true(capacity > i);
        list[i] = i;
    }
    for (int i = 0; i < 1000; i++)
        assert_int_equal(list[i], i);
    free(list);
}

static void texts_are_added_as_far_as_they_fit(void **state SST_UNUSED)
{
    char text[8] = "";

    sst_text_add(text, sizeof(text), "%s%d", "a", 12);
    assert_string_equal(text, "a12");
    sst_text_add(text, sizeof(text), ", %s", "longer");
    assert_string_equal(text, "a12, lo");
    sst_text_add(text, sizeof(text), "more");
    assert_string_equal(text, "a12, lo");
    for (size_t n = 0; n <= strlen("a\xc3\xa4\xe2\x82\xac\xf0\x9f\x98\x80"); n++) {
        static const char whole[] = "a\xc3\xa4\xe2\x82\xac\xf0\x9f\x98\x80";
        char part[sizeof(whole)];

        snprintf(part, n + 1, "%s", whole);
        sst_text_end_whole(part);
        assert_int_equal(strlen(part), n >= 10 ? 10 : n >= 6 ? 6 : n >= 3 ? 3 : n >= 1);
    }
    assert_true(sst_text_ends("a.png", ".png"));
    assert_false(sst_text_ends(".png", ".png"));
    assert_false(sst_text_ends("a.PNG", ".png"));
    assert_false(sst_text_ends("", ".png"));
}

static void outfile_appears_whole_or_not(void **state SST_UNUSED)
{
    char dir[] = "/tmp/sst-test-XXXXXX", path[SST_PATH_MAX];
    struct sst_outfile out;
    struct sst_outdir folder;

    assert_non_null(mkdtemp(dir));
    assert_int_equal(sst_path_join(path, dir, "a"), 0);
    assert_int_equal(sst_outfile_open(&out, path), 0);
    fputs("x", out.stream);
    assert_false(sst_path_exists(path));
    sst_outfile_abort(&out);
    assert_false(sst_path_exists(path));
    assert_int_equal(sst_file_write(path, "hello", 5), 0);
    assert_true(sst_path_exists(path));
    assert_int_equal(sst_outfile_open(&out, "/dev/null"), -EEXIST);
    assert_int_equal(sst_outdir_open(&folder, path, false), -EEXIST);
    assert_int_equal(sst_path_join(path, dir, "d/"), 0);
    assert_int_equal(sst_outdir_open(&folder, path, false), 0);
    assert_false(sst_path_exists(path));
    assert_int_equal(sst_outdir_commit(&folder), 0);
    assert_true(sst_path_is_dir(path));
    sst_path_remove_tree(dir);
    assert_false(sst_path_exists(dir));
}

static void expect_text(const char *path, const char *text)
{
    uint8_t *data;
    size_t size;

    assert_int_equal(sst_file_read(path, 100, &data, &size), 0);
    assert_string_equal((const char *)data, text);
    free(data);
}

static void swap_exchanges_or_moves(void **state SST_UNUSED)
{
    char dir[] = "/tmp/sst-test-XXXXXX", a[SST_PATH_MAX], b[SST_PATH_MAX];

    assert_non_null(mkdtemp(dir));
    assert_int_equal(sst_path_join(a, dir, "a"), 0);
    assert_int_equal(sst_path_join(b, dir, "b"), 0);
    assert_int_equal(sst_path_swap(a, b), -ENOENT);
    assert_int_equal(sst_file_write(a, "new", 3), 0);
    assert_int_equal(sst_path_swap(a, b), 0);
    assert_false(sst_path_exists(a));
    assert_int_equal(sst_file_write(a, "newer", 5), 0);
    assert_int_equal(sst_path_swap(a, b), 0);
    expect_text(a, "new");
    expect_text(b, "newer");
    sst_path_remove_tree(dir);
}

enum { WRITERS = 3, INTERRUPTS = 40 };

/* Replaces its folder again and again, with two files that always say the same. */
static int replace_for_ever(void *arg, int index, int worker SST_UNUSED)
{
    char name[16], path[SST_PATH_MAX], file[SST_PATH_MAX], text[16];

    snprintf(name, sizeof(name), "out-%d", index);
    assert_int_equal(sst_path_join(path, arg, name), 0);
    for (int round = 0;; round++) {
        struct sst_outdir out;
        const int n = snprintf(text, sizeof(text), "%d", round);
        int err = sst_outdir_open(&out, path, true);

        for (int i = 0; !err && i < 2; i++) {
            void *memory = malloc(200000); /* the allocator's lock is often held */

            err = memory ? sst_path_join(file, out.temporary, i ? "b" : "a") : -ENOMEM;
            err = err ? err : sst_file_write(file, text, (size_t)n);
            free(memory);
        }
        err = err ? err : sst_outdir_commit(&out);
        if (err)
            _exit(1);
    }
}

static void expect_whole_folders(const char *dir)
{
    struct dirent *e;
    DIR *d = opendir(dir);

    assert_non_null(d);
    while ((e = readdir(d))) {
        char path[SST_PATH_MAX], file[SST_PATH_MAX];
        uint8_t *data;
        size_t size;

        if (e->d_name[0] == '.')
            continue;
        assert_null(strstr(e->d_name, ".tmp-"));
        assert_int_equal(sst_path_join(path, dir, e->d_name), 0);
        assert_int_equal(sst_path_join(file, path, "a"), 0);
        assert_int_equal(sst_file_read(file, 100, &data, &size), 0);
        assert_int_equal(sst_path_join(file, path, "b"), 0);
        expect_text(file, (const char *)data);
        free(data);
    }
    closedir(d);
}

static void interrupt_leaves_whole_folders(void **state SST_UNUSED)
{
    char dir[] = "/tmp/sst-test-XXXXXX";

    assert_non_null(mkdtemp(dir));
    for (int i = 0; i < (small_level() ? 4 : INTERRUPTS); i++) {
        int status = 0, ready[2];
        pid_t child;
        char c;

        assert_int_equal(pipe(ready), 0);
        child = fork();
        assert_true(child >= 0);
        if (!child) {
            if (sst_file_clean_on_interrupt() || write(ready[1], "r", 1) != 1)
                _exit(1);
            _exit(sst_parallel_for(WRITERS, WRITERS, replace_for_ever, dir) ? 1 : 2);
        }
        close(ready[1]);
        assert_int_equal(read(ready[0], &c, 1), 1);
        close(ready[0]);
        usleep(2000 + 777 * (useconds_t)i);
        assert_int_equal(kill(child, SIGINT), 0);
        assert_int_equal(kill(child, i % 2 ? SIGINT : SIGTERM), 0);
        for (int64_t end = sst_clock_now_ns() + 60000000000; !waitpid(child, &status, WNOHANG);) {
            if (sst_clock_now_ns() > end) {
                kill(child, SIGKILL);
                fail_msg("the process that was interrupted hangs");
            }
            usleep(1000);
        }
        assert_true(WIFEXITED(status));
        assert_true(WEXITSTATUS(status) == 128 + SIGINT || WEXITSTATUS(status) == 128 + SIGTERM);
        expect_whole_folders(dir);
    }
    sst_path_remove_tree(dir);
}

/* Output that an interrupt removes while it is synced is no error of its own: the process ends as interrupted. */
static void interrupt_during_a_sync_is_no_error(void **state SST_UNUSED)
{
    char dir[] = "/tmp/sst-test-XXXXXX", path[SST_PATH_MAX];
    int status = 0;
    pid_t child;

    assert_non_null(mkdtemp(dir));
    assert_int_equal(sst_path_join(path, dir, "out"), 0);
    child = fork();
    assert_true(child >= 0);
    if (!child) {
        struct sst_outdir out;
        char file[SST_PATH_MAX + 16];

        if (sst_file_clean_on_interrupt() || sst_outdir_open(&out, path, false))
            _exit(1);
        for (int i = 0; i < 400; i++) { /* removing takes a while */
            snprintf(file, sizeof(file), "%s/%d", out.temporary, i);
            if (close(open(file, O_WRONLY | O_CREAT, 0666)))
                _exit(2);
        }
        raise(SIGINT);
        while (!sst_outdir_sync(&out))
            ;
        _exit(3);
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 128 + SIGINT);
    assert_int_equal(rmdir(dir), 0); /* nothing is left */
}

/* Only outside sanitized builds, which end there. */
static void values_that_cross_a_border_are_counted(void **state SST_UNUSED)
{
    const double good[] = { 0, -0.0, 1e308, -1e-308, 5e-324 };
    const float unknown[] = { 1, INFINITY, -INFINITY };

    assert_int_equal(sst_border_doubles("good", good, ARRAY_LEN(good)), 0);
    assert_int_equal(sst_border_unknown("unknown", unknown, ARRAY_LEN(unknown)), 0);
    assert_int_equal(sst_border_floats("good", (const float[]){ 0, -1e38f, 1e-45f }, 3), 0);
    assert_int_equal(sst_border_count(), 0);
#ifndef SST_TRAPS
    assert_int_equal(sst_border_doubles("bad", (const double[]){ 1, NAN, -INFINITY, 2 }, 4), 2);
    assert_int_equal(sst_border_unknown("bad", (const float[]){ NAN, INFINITY, -NAN }, 3), 2);
    assert_int_equal(sst_border_floats("bad", (const float[]){ NAN, INFINITY, 1 }, 3), 2);
    assert_int_equal(sst_border_count(), 6);
#endif
}

/* Of a blocked client one attempt is at once, one waits, and no more can. */
static void attempts_of_a_blocked_client_come_in_turn(void **state)
{
    const int64_t s = 1000000000, turn = SST_BRAKE_TURN_S * s;
    const uint8_t who[16] = { 1 }, other[16] = { 2 };
    struct sst_brake b;
    bool first;

    (void)state;
    sst_brake_init(&b);
    for (int i = 0; i < SST_BRAKE_WRONG; i++) {
        assert_int_equal(sst_brake_turn(&b, who, s), 0);
        assert_int_equal(sst_brake_wrong(&b, who, s, &first), 0);
        assert_false(first);
    }
    assert_int_equal(sst_brake_wrong(&b, who, s, &first), 60);
    assert_true(first);
    assert_true(sst_brake_turn(&b, who, 2 * s) == 0);
    assert_true(sst_brake_turn(&b, who, 3 * s) == turn - s);
    assert_true(sst_brake_turn(&b, who, 4 * s) == -1);
    assert_true(sst_brake_turn(&b, who, 2 * s + turn) == turn);
    assert_true(sst_brake_turn(&b, other, 4 * s) == 0);
    assert_true(sst_brake_turn(&b, who, 62 * s) == 0); /* the block is over */
    assert_true(sst_brake_turn(&b, who, 62 * s) == 0);
    sst_brake_fini(&b);
}

static void put(const char *path, const char *text)
{
    assert_int_equal(sst_file_write(path, text, strlen(text)), 0);
}

/* Files and folders alone: no targets of links, and no entry that would have to be waited for. */
static void copies_follow_no_links(void **state SST_UNUSED)
{
    static const char *const gone[] = { "to/link", "to/loop", "to/pipe", "to/in/file", "to/.hidden" };
    const mode_t before = umask(022);
    struct stat st;

    assert_int_equal(sst_path_make_dir(test_path("from")), 0);
    assert_int_equal(sst_path_make_dir(test_path("from/in")), 0);
    put(test_path("secret"), "secret");
    put(test_path("from/open"), "a");
    put(test_path("from/.hidden"), "h");
    put(test_path("from/in/mine"), "b");
    assert_int_equal(chmod(test_path("from/in/mine"), 0600), 0);
    assert_int_equal(symlink("../secret", test_path("from/link")), 0);
    assert_int_equal(symlink(".", test_path("from/loop")), 0);
    assert_int_equal(symlink("/dev/zero", test_path("from/in/file")), 0);
    assert_int_equal(mkfifo(test_path("from/pipe"), 0666), 0);
    assert_int_equal(symlink("from", test_path("named")), 0);
    assert_int_equal(sst_path_copy_tree(test_path("named"), test_path("to")), 0);
    for (size_t i = 0; i < ARRAY_LEN(gone); i++)
        assert_false(sst_path_exists(test_path("%s", gone[i])));
    assert_int_equal(stat(test_path("to/open"), &st), 0);
    assert_int_equal(st.st_mode & 0777, 0644);
    assert_int_equal(stat(test_path("to/in/mine"), &st), 0);
    assert_int_equal(st.st_mode & 0777, 0600);
    assert_int_equal(st.st_size, 1);
    umask(before);
}

/* Texts of any editor; pipes and folders are none. */
static void texts_may_have_a_mark(void **state SST_UNUSED)
{
    static const char *const other[] = { "\xff\xfek\0", "\xfe\xff\0k", "\0k", "k\0" };
    char said[SST_LOG_MAX] = "", *before;
    uint8_t *text;
    size_t size;

    put(test_path("text"), "\xef\xbb\xbfk: 1");
    assert_int_equal(sst_file_read_text(test_path("text"), 100, &text, &size), 0);
    assert_int_equal(size, 4);
    assert_string_equal((const char *)text, "k: 1");
    free(text);
    put(test_path("text"), "");
    assert_int_equal(sst_file_read_text(test_path("text"), 100, &text, &size), 0);
    assert_int_equal(size, 0);
    free(text);
    before = sst_log_hold_errors(said);
    for (size_t i = 0; i < ARRAY_LEN(other); i++) {
        assert_int_equal(sst_file_write(test_path("text"), other[i], i < 2 ? 4 : 2), 0);
        assert_int_equal(sst_file_read_text(test_path("text"), 100, &text, &size), -EBADMSG);
        assert_non_null(strstr(said, "UTF-16"));
    }
    assert_int_equal(mkfifo(test_path("fifo"), 0666), 0);
    assert_int_equal(sst_file_read(test_path("fifo"), 100, &text, &size), -EBADMSG);
    assert_int_equal(sst_file_open(test_path("fifo")), -EBADMSG);
    assert_int_equal(sst_file_open("/dev/null"), -EBADMSG);
    assert_int_equal(sst_file_open(test_path("none")), -ENOENT);
    assert_int_equal(sst_file_open(test_path(".")), -EISDIR);
    sst_log_hold_errors(before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(parallel_for_runs_every_index),
        cmocka_unit_test(parallel_for_reports_the_lowest_error),
        cmocka_unit_test(parallel_for_shows_one_error),
        cmocka_unit_test(alloc_refuses_overflow),
        cmocka_unit_test(arrays_grow_and_keep_their_elements),
        cmocka_unit_test(texts_are_added_as_far_as_they_fit),
        cmocka_unit_test(outfile_appears_whole_or_not),
        cmocka_unit_test(swap_exchanges_or_moves),
        cmocka_unit_test(interrupt_leaves_whole_folders),
        cmocka_unit_test(interrupt_during_a_sync_is_no_error),
        cmocka_unit_test(attempts_of_a_blocked_client_come_in_turn),
        cmocka_unit_test(values_that_cross_a_border_are_counted),
        cmocka_unit_test_setup_teardown(copies_follow_no_links, test_folder_create, test_folder_remove),
        cmocka_unit_test_setup_teardown(texts_may_have_a_mark, test_folder_create, test_folder_remove),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
