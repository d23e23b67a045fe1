/* pipeline/lightfield/share: steps whose items several workers compute, each once, and all have the maps of. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "base/mem.h"
#include "pipeline/lightfield/share.h"
#include "tests/test.h"

#define ITEMS   27
#define ALONE   (ITEMS - 1) /* has nothing for others in one step */
#define WORKERS 3
#define BLOCK   5 /* made smaller, so that there are 12 of them */
#define BATCH   2
#define STEPS   5 /* of a round */
#define ROUNDS  2

static char dir[SST_PATH_MAX];

static int make_folder(void **state SST_UNUSED)
{
    snprintf(dir, sizeof(dir), "/tmp/sst-share-XXXXXX");
    return mkdtemp(dir) ? 0 : -1;
}

static int remove_folder(void **state SST_UNUSED)
{
    sst_path_remove_tree(dir);
    return 0;
}

struct field {
    struct sst_share *share;
    struct sst_map_u16 disp[ITEMS];
    struct sst_map_u8 label[ITEMS]; /* empty for every third item */
    struct sst_map_f32 entropy[ITEMS];
    struct sst_image image[ITEMS];
    struct {
        int32_t *value; /* every fourth item has no list, every fourth an empty one */
        size_t count;
        double mean;
    } list[ITEMS];
    SST_ATOMIC(int) * computed;     /* [ITEMS], by all workers */
    int fails;                      /* item that fails; -1: none */
    int step, killed_in, killed_at; /* the process is killed in this step, counted from 1, at this index */
};

static void kill_here(const struct field *f, int i)
{
    if (f->killed_in && f->step == f->killed_in && i == f->killed_at)
        raise(SIGKILL);
}

/* The maps of an item depend on the maps of the last step. */
static int compute(void *arg, int i, int worker SST_UNUSED)
{
    struct field *f = arg;
    const int width = 5 + i, height = 3;
    const unsigned before = f->disp[(i + 1) % ITEMS].data ? *f->disp[(i + 1) % ITEMS].data : 0u;
    int err;

    f->computed[i]++;
    kill_here(f, i);
    if (i == f->fails) {
        sst_log_error("item %d is spoiled", i);
        return -EBADMSG;
    }
    sst_map_u8_fini(&f->label[i]);
    sst_map_f32_fini(&f->entropy[i]);
    err = sst_map_f32_init(&f->entropy[i], width, height);
    if (!err && i % 3)
        err = sst_map_u8_init(&f->label[i], width, height);
    for (int y = 0; !err && y < height; y++) {
        for (int x = 0; x < width; x++) {
            sst_map_f32_row(&f->entropy[i], y)[x] = (float)(i + x) / 3 + (float)before;
            if (i % 3)
                sst_map_u8_row(&f->label[i], y)[x] = (uint8_t)(i * y + x);
        }
    }
    return err;
}

static int turn(void *arg, int i, int worker SST_UNUSED)
{
    struct field *f = arg;
    int err;

    f->computed[i]++;
    kill_here(f, i);
    sst_map_u16_fini(&f->disp[i]);
    err = sst_map_u16_init(&f->disp[i], 4, 2);
    for (int x = 0; !err && x < 4; x++)
        sst_map_u16_row(&f->disp[i], 1)[x] = (uint16_t)(f->entropy[(i + 5) % ITEMS].data[x] * 100);
    return err;
}

static void computed_maps(void *arg, int i, struct sst_share_maps *out)
{
    struct field *f = arg;

    sst_share_add_u8(out, &f->label[i]);
    sst_share_add_f32(out, &f->entropy[i]);
}

static void turned_maps(void *arg, int i, struct sst_share_maps *out)
{
    sst_share_add_u16(out, &((struct field *)arg)->disp[i]);
}

static int paint(void *arg, int i, int worker SST_UNUSED)
{
    struct field *f = arg;
    int err;

    f->computed[i]++;
    kill_here(f, i);
    sst_image_fini(&f->image[i]);
    err = sst_image_init(&f->image[i], 70, 3);
    for (int x = 0; !err && x < 3 * 70; x++)
        sst_image_row(&f->image[i], x % 3, 2)[x / 3] = (uint8_t)(x * i + *sst_map_u16_row(&f->disp[i], 1));
    return err;
}

static void painted_maps(void *arg, int i, struct sst_share_maps *out)
{
    sst_share_add_image(out, &((struct field *)arg)->image[i]);
}

static int list_bytes(void *arg, int i, int worker SST_UNUSED)
{
    struct field *f = arg;

    f->computed[i]++;
    kill_here(f, i);
    sst_mem_free(f->list[i].value);
    f->list[i].value = NULL;
    f->list[i].count = i % 4 == 2 ? 0 : (size_t)i;
    f->list[i].mean = i / 7.0;
    if (i % 4 == 3)
        f->list[i].count = 0;
    else if (!(f->list[i].value = sst_mem_alloc(f->list[i].count, sizeof(*f->list[i].value))))
        return -ENOMEM;
    for (size_t k = 0; k < f->list[i].count; k++)
        f->list[i].value[k] = sst_image_row(&f->image[i], 1, 2)[k] - 100;
    return 0;
}

static void listed_values(void *arg, int i, struct sst_share_maps *out)
{
    struct field *f = arg;

    if (i == ALONE)
        return;
    sst_share_add_list(out, &f->list[i].value, &f->list[i].count, sizeof(*f->list[i].value));
    sst_share_add_values(out, &f->list[i].mean, sizeof(f->list[i].mean));
}

/* Some items at once: neighbours, if this process is alone. */
static int turn_some(void *arg, const int *index, int count)
{
    int err = count < 1 || count > BATCH ? -EINVAL : 0;

    for (int i = 0; !err && i < count; i++)
        err = turn(arg, index[i], 0);
    return err;
}

static void fini(struct field *f)
{
    for (int i = 0; i < ITEMS; i++) {
        sst_image_fini(&f->image[i]);
        sst_mem_free(f->list[i].value);
        sst_map_u16_fini(&f->disp[i]);
        sst_map_u8_fini(&f->label[i]);
        sst_map_f32_fini(&f->entropy[i]);
    }
    sst_share_close(f->share);
}

static int run_steps(void *arg, int index, int worker SST_UNUSED)
{
    struct field *f = &((struct field *)arg)[index];
    int err = 0;

    f->step = 0;
    for (int round = 0; !err && round < ROUNDS; round++) {
        f->step++;
        err = sst_share_for(f->share, ITEMS, 2, compute, f, computed_maps);
        f->step++;
        err = err ? err : sst_share_for(f->share, ITEMS, 2, turn, f, turned_maps);
        f->step++;
        err = err ? err : sst_share_blocks(f->share, ITEMS, BLOCK, 2, paint, f, painted_maps);
        f->step++;
        err = err ? err : sst_share_for(f->share, ITEMS, 2, list_bytes, f, listed_values);
        f->step++;
        err = err ? err : sst_share_batches(f->share, ITEMS, BATCH, turn_some, f, turned_maps);
    }
    return err;
}

static void open_share(struct field *f, const char *name, int index, int count, int lease_ms)
{
    char path[SST_PATH_MAX];
    const struct sst_share_config cfg = { path, "test", index, count, lease_ms };

    assert_int_equal(sst_path_join(path, dir, name), 0);
    assert_int_equal(sst_share_open(&f->share, &cfg), 0);
}

static void expect_same(const struct field *a, const struct field *b)
{
    for (int i = 0; i < ITEMS; i++) {
        assert_int_equal(!a->label[i].data, !b->label[i].data);
        for (int y = 0; y < 3; y++) {
            assert_memory_equal(sst_map_f32_row(&a->entropy[i], y), sst_map_f32_row(&b->entropy[i], y),
                                (size_t)(5 + i) * sizeof(float));
            if (a->label[i].data)
                assert_memory_equal(sst_map_u8_row(&a->label[i], y), sst_map_u8_row(&b->label[i], y), (size_t)(5 + i));
        }
        for (int y = 0; y < 2; y++)
            assert_memory_equal(sst_map_u16_row(&a->disp[i], y), sst_map_u16_row(&b->disp[i], y), 4 * sizeof(uint16_t));
        for (int c = 0; c < 3; c++)
            assert_memory_equal(sst_image_row(&a->image[i], c, 2), sst_image_row(&b->image[i], c, 2), 70);
        assert_int_equal(!a->list[i].value, !b->list[i].value);
        assert_int_equal(a->list[i].count, b->list[i].count);
        if (a->list[i].count)
            assert_memory_equal(a->list[i].value, b->list[i].value, a->list[i].count * sizeof(int32_t));
        assert_true(a->list[i].mean == b->list[i].mean);
    }
}

static void workers_have_what_one_process_has(void **state SST_UNUSED)
{
    SST_ATOMIC(int) alone[ITEMS] = { 0 }, shared[ITEMS] = { 0 };
    struct field one = { .computed = alone, .fails = -1 }, worker[WORKERS] = { 0 };

    assert_int_equal(run_steps(&one, 0, 0), 0);
    for (int k = 0; k < WORKERS; k++) {
        worker[k].computed = shared;
        worker[k].fails = -1;
        open_share(&worker[k], "same", k, WORKERS, 60000);
    }
    assert_int_equal(sst_parallel_for(WORKERS, WORKERS, run_steps, worker), 0);
    for (int i = 0; i < ITEMS; i++) /* once a step */
        assert_int_equal(shared[i], i == ALONE ? (STEPS - 1 + WORKERS) * ROUNDS : STEPS * ROUNDS);
    for (int k = 0; k < WORKERS; k++) {
        expect_same(&one, &worker[k]);
        fini(&worker[k]);
    }
    /* One that comes late reads everything. */
    worker[0] = (struct field){ .computed = shared, .fails = -1 };
    open_share(&worker[0], "same", 0, 1, 60000);
    assert_int_equal(run_steps(worker, 0, 0), 0);
    assert_int_equal(shared[3], STEPS * ROUNDS);
    expect_same(&one, &worker[0]);
    fini(&worker[0]);
    fini(&one);
}

static void failures_are_tried_by_every_worker(void **state SST_UNUSED)
{
    SST_ATOMIC(int) computed[ITEMS] = { 0 }, alone[ITEMS] = { 0 };
    struct field first = { .computed = computed, .fails = 7 }, second = { .computed = computed, .fails = 7 };
    struct field third = { .computed = computed, .fails = -1 }, one = { .computed = alone, .fails = -1 };
    char said[SST_LOG_MAX] = "";

    sst_log_hold_errors(said);
    open_share(&first, "failed", 0, 1, 60000);
    assert_int_equal(run_steps(&first, 0, 0), -EBADMSG);
    open_share(&second, "failed", 0, 1, 60000);
    assert_int_equal(run_steps(&second, 0, 0), -EBADMSG);
    assert_contains(said, "item 7 is spoiled");
    assert_int_equal(computed[7], 2);
    sst_log_hold_errors(NULL);
    /* Where it succeeds, all goes on. */
    open_share(&third, "failed", 0, 1, 60000);
    assert_int_equal(run_steps(&third, 0, 0), 0);
    assert_int_equal(run_steps(&one, 0, 0), 0);
    expect_same(&one, &third);
    fini(&first);
    fini(&second);
    fini(&third);
    fini(&one);
}

static void damage_ends_a_worker(void **state SST_UNUSED)
{
    SST_ATOMIC(int) computed[ITEMS] = { 0 };
    struct field first = { .computed = computed, .fails = -1 }, second = { .computed = computed, .fails = -1 };
    static const char *const files[] = { "step-00/003", "step-01/004", "step-02/002", "step-03/009", "step-09/001" };
    char said[SST_LOG_MAX] = "", name[64], path[SST_PATH_MAX], want[128];

    sst_log_hold_errors(said);
    open_share(&first, "damaged", 0, 1, 60000);
    assert_int_equal(run_steps(&first, 0, 0), 0);
    for (size_t i = ARRAY_LEN(files); i-- > 0;) { /* earlier ones are read first */
        struct stat st;

        snprintf(name, sizeof(name), "damaged/%s.maps", files[i]);
        assert_int_equal(sst_path_join(path, dir, name), 0);
        assert_int_equal(stat(path, &st), 0);
        assert_int_equal(truncate(path, i % 2 ? st.st_size + 1 : st.st_size - 1), 0);
        open_share(&second, "damaged", 0, 1, 60000);
        assert_int_equal(run_steps(&second, 0, 0), -EIO);
        snprintf(want, sizeof(want), "%s, maps from another worker: damaged", name);
        assert_contains(said, want);
        sst_share_close(second.share);
        second.share = NULL;
    }
    sst_log_hold_errors(NULL);
    fini(&first);
    fini(&second);
}

/* In each step a process is killed while it computes an index; another one computes that again, and all after it. */
static void killed_workers_are_replaced(void **state SST_UNUSED)
{
    SST_ATOMIC(int) alone[ITEMS] = { 0 }, computed[ITEMS] = { 0 };
    struct field one = { .computed = alone, .fails = -1 }, last = { .computed = computed, .fails = -1 };

    assert_int_equal(run_steps(&one, 0, 0), 0);
    for (int step = 1; step <= STEPS * ROUNDS; step++) {
        const pid_t child = fork();
        int status;

        assert_true(child >= 0);
        if (!child) {
            struct field f = { .computed = computed, .fails = -1, .killed_in = step, .killed_at = step % ITEMS };
            char path[SST_PATH_MAX];
            const struct sst_share_config cfg = { path, "test", 0, 1, 200 };

            if (sst_path_join(path, dir, "killed") || sst_share_open(&f.share, &cfg))
                _exit(1);
            _exit(run_steps(&f, 0, 0) ? 2 : 3);
        }
        assert_int_equal(waitpid(child, &status, 0), child);
        assert_true(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
    }
    open_share(&last, "killed", 0, 1, 200);
    assert_int_equal(run_steps(&last, 0, 0), 0);
    expect_same(&one, &last);
    assert_int_equal(computed[0], 0); /* finished items are not done again */
    assert_int_equal(computed[STEPS * ROUNDS], 1);
    fini(&one);
    fini(&last);
}

static void small_views_make_blocks(void **state SST_UNUSED)
{
    assert_int_equal(sst_share_block(250 * 188), 13);
    assert_int_equal(sst_share_block(500 * 375), 4);
    assert_int_equal(sst_share_block(1000 * 750), 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(workers_have_what_one_process_has),
        cmocka_unit_test(failures_are_tried_by_every_worker),
        cmocka_unit_test(damage_ends_a_worker),
        cmocka_unit_test(killed_workers_are_replaced),
        cmocka_unit_test(small_views_make_blocks),
    };

    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
