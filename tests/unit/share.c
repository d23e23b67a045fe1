/* pipeline/lightfield/share: steps whose items several workers compute, each once, and all have the maps of. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/lightfield/share.h"
#include "tests/test.h"

#define ITEMS   12
#define WORKERS 3

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
    SST_ATOMIC(int) * computed; /* [ITEMS], by all workers */
    int fails;                  /* item that fails; -1: none */
};

/* The maps of an item depend on those of the last step. */
static int compute(void *arg, int i, int worker SST_UNUSED)
{
    struct field *f = arg;
    const int width = 5 + i, height = 3;
    const unsigned before = f->disp[(i + 1) % ITEMS].data ? *f->disp[(i + 1) % ITEMS].data : 0u;
    int err;

    f->computed[i]++;
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

static void fini(struct field *f)
{
    for (int i = 0; i < ITEMS; i++) {
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

    for (int round = 0; !err && round < 2; round++) {
        err = sst_share_for(f->share, ITEMS, 2, compute, f, computed_maps);
        err = err ? err : sst_share_for(f->share, ITEMS, 2, turn, f, turned_maps);
    }
    return err;
}

static void open_share(struct field *f, const char *name, int index, int count)
{
    char path[SST_PATH_MAX];

    assert_int_equal(sst_path_join(path, dir, name), 0);
    assert_int_equal(sst_share_open(&f->share, path, "test", index, count, 60000), 0);
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
        open_share(&worker[k], "same", k, WORKERS);
    }
    assert_int_equal(sst_parallel_for(WORKERS, WORKERS, run_steps, worker), 0);
    for (int i = 0; i < ITEMS; i++)
        assert_int_equal(shared[i], 4); /* once a step */
    for (int k = 0; k < WORKERS; k++) {
        expect_same(&one, &worker[k]);
        fini(&worker[k]);
    }
    /* One that comes late reads everything. */
    worker[0] = (struct field){ .computed = shared, .fails = -1 };
    open_share(&worker[0], "same", 0, 1);
    assert_int_equal(run_steps(worker, 0, 0), 0);
    assert_int_equal(shared[3], 4);
    expect_same(&one, &worker[0]);
    fini(&worker[0]);
    fini(&one);
}

static void failures_and_damage_end_all_workers(void **state SST_UNUSED)
{
    SST_ATOMIC(int) computed[ITEMS] = { 0 };
    struct field first = { .computed = computed, .fails = 7 }, second = { .computed = computed, .fails = -1 };
    char said[SST_LOG_MAX] = "", path[SST_PATH_MAX];
    FILE *f;

    sst_log_hold_errors(said);
    open_share(&first, "failed", 0, 1);
    assert_int_equal(run_steps(&first, 0, 0), -EBADMSG);
    open_share(&second, "failed", 0, 1);
    assert_int_equal(run_steps(&second, 0, 0), -EIO);
    assert_contains(said, "item 7 is spoiled");
    fini(&first);
    fini(&second);

    first = (struct field){ .computed = computed, .fails = -1 };
    open_share(&first, "damaged", 0, 1);
    assert_int_equal(run_steps(&first, 0, 0), 0);
    assert_int_equal(sst_path_join(path, dir, "damaged/step-01/004.maps"), 0);
    f = fopen(path, "r+");
    assert_non_null(f);
    assert_int_equal(fputc('X', f), 'X');
    fclose(f);
    open_share(&second, "damaged", 0, 1);
    assert_int_equal(run_steps(&second, 0, 0), -EIO);
    assert_contains(said, "damaged/step-01/004.maps, maps from another worker: damaged");
    sst_log_hold_errors(NULL);
    fini(&first);
    fini(&second);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(workers_have_what_one_process_has),
        cmocka_unit_test(failures_and_damage_end_all_workers),
    };

    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
