/* base/: files that appear whole or not at all, parallel work. */
#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/file.h"
#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"

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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(parallel_for_runs_every_index),
        cmocka_unit_test(parallel_for_reports_the_lowest_error),
        cmocka_unit_test(parallel_for_shows_one_error),
        cmocka_unit_test(alloc_refuses_overflow),
        cmocka_unit_test(outfile_appears_whole_or_not),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
