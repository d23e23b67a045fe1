/* base/claim: pieces that processes share are claimed by one, and again once it gives no sign of life. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "base/claim.h"
#include "base/file.h"
#include "base/thread.h"
#include "tests/test.h"

#define LEASE_MS 100

static char dir[SST_PATH_MAX];

static int make_folder(void **state SST_UNUSED)
{
    snprintf(dir, sizeof(dir), "/tmp/sst-claim-XXXXXX");
    return mkdtemp(dir) ? 0 : -1;
}

static int remove_folder(void **state SST_UNUSED)
{
    sst_path_remove_tree(dir);
    return 0;
}

static const char *state_of(const char *name)
{
    static char path[SST_PATH_MAX + 32];

    snprintf(path, sizeof(path), "%s/%s", dir, name);
    return path;
}

static struct sst_claim_info look(const char *name)
{
    struct sst_claim_info info;

    assert_int_equal(sst_claim_look(&info, state_of(name)), 0);
    return info;
}

static struct sst_claim *take(const char *name, const char *job)
{
    const struct sst_claim_info info = look(name);
    struct sst_claim *c;

    assert_int_equal(sst_claim_take(&c, state_of(name), &info, job, LEASE_MS), 0);
    return c;
}

static void pause_ms(int ms)
{
    nanosleep(&(struct timespec){ ms / 1000, ms % 1000 * 1000000L }, NULL);
}

/* Remains of a killed worker. */
static void leave_held(const char *name, int attempts)
{
    char path[SST_PATH_MAX + 64];
    FILE *f;

    assert_int_equal(mkdir(state_of(name), 0777), 0);
    snprintf(path, sizeof(path), "%s/held.gone.1.00000000", state_of(name));
    f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f, "job render\nworker gone.1\nattempts %d\nseconds 0\n", attempts);
    fclose(f);
}

static void states_follow_one_another(void **state SST_UNUSED)
{
    struct sst_claim_info info = look("a"), free_one = info;
    struct sst_claim *c, *other;

    assert_int_equal(info.state, SST_CLAIM_FREE);
    c = take("a", "process --preset fast");
    assert_int_equal(sst_claim_attempts(c), 1);
    info = look("a");
    assert_int_equal(info.state, SST_CLAIM_HELD);
    assert_string_equal(info.job, "process --preset fast");
    assert_int_equal(sst_claim_take(&other, state_of("a"), &free_one, "x", LEASE_MS), -EBUSY);
    assert_int_equal(sst_claim_end(c, "no light field\nat all"), 0);
    info = look("a");
    assert_int_equal(info.state, SST_CLAIM_FAILED);
    assert_string_equal(info.error, "no light field");
    c = take("a", "another");
    assert_int_equal(sst_claim_attempts(c), 1);
    assert_int_equal(sst_claim_end(c, NULL), 0);
    info = look("a");
    assert_int_equal(info.state, SST_CLAIM_DONE);
    assert_string_equal(info.job, "another");
    assert_true(info.seconds >= 0 && info.seconds < 3600);
}

static void holders_keep_their_claims(void **state SST_UNUSED)
{
    struct sst_claim *c = take("b", "render");
    struct sst_claim_watch watch = { 0 };

    /* A sign of life is due four times in a lease; half a minute is for a machine that has no time for it. */
    for (int i = 0; i < 20; i++) {
        const struct sst_claim_info info = look("b");

        assert_false(sst_claim_expired(&watch, &info, 30000));
        pause_ms(LEASE_MS / 8);
    }
    assert_true(watch.touched_ns != 0 && look("b").touched_ns - watch.touched_ns < INT64_C(30000000000));
    assert_int_equal(sst_claim_end(c, NULL), 0);
}

static void silent_holders_are_replaced(void **state SST_UNUSED)
{
    struct sst_claim_watch watch = { 0 };
    struct sst_claim_info info;
    struct sst_claim *c;

    leave_held("c", 1);
    info = look("c");
    assert_false(sst_claim_expired(&watch, &info, LEASE_MS)); /* however old: it is seen for the first time */
    pause_ms(LEASE_MS + 50);
    info = look("c");
    assert_true(sst_claim_expired(&watch, &info, LEASE_MS));
    c = take("c", "render");
    assert_int_equal(sst_claim_attempts(c), 2);
    assert_int_equal(sst_claim_end(c, NULL), 0);
}

/* The one that only hung finds out, and does not spoil the state. */
static void late_holders_find_out(void **state SST_UNUSED)
{
    struct sst_claim *late = take("d", "render"), *now = take("d", "render");

    assert_int_equal(sst_claim_end(late, NULL), -ESTALE);
    assert_int_equal(look("d").state, SST_CLAIM_HELD);
    assert_int_equal(sst_claim_end(now, NULL), 0);
    assert_int_equal(look("d").state, SST_CLAIM_DONE);
}

static void an_emptied_state_is_free(void **state SST_UNUSED)
{
    assert_int_equal(mkdir(state_of("e"), 0777), 0); /* as after an interrupt */
    assert_int_equal(look("e").state, SST_CLAIM_FREE);
    assert_int_equal(sst_claim_end(take("e", "render"), NULL), 0);
    assert_int_equal(look("e").state, SST_CLAIM_DONE);
}

#define RIVALS 8
#define PIECES 40

static int claim_all(void *arg, int index SST_UNUSED, int worker SST_UNUSED)
{
    SST_ATOMIC(int) *taken = arg;

    for (int i = 0; i < PIECES; i++) {
        struct sst_claim_info info;
        struct sst_claim *c;
        char name[16];
        char path[SST_PATH_MAX + 32];
        int err;

        snprintf(name, sizeof(name), "r%d", i);
        snprintf(path, sizeof(path), "%s/%s", dir, name);
        err = sst_claim_look(&info, path);
        if (err || info.state != SST_CLAIM_FREE)
            continue;
        err = sst_claim_take(&c, path, &info, "race", 60000);
        if (err == -EBUSY)
            continue;
        if (err)
            return err;
        taken[i]++;
        err = sst_claim_end(c, NULL);
        if (err)
            return err;
    }
    return 0;
}

static void one_of_many_rivals_wins(void **state SST_UNUSED)
{
    SST_ATOMIC(int) taken[PIECES] = { 0 };

    assert_int_equal(sst_parallel_for(RIVALS, RIVALS, claim_all, taken), 0);
    for (int i = 0; i < PIECES; i++)
        assert_int_equal(taken[i], 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(states_follow_one_another),   cmocka_unit_test(holders_keep_their_claims),
        cmocka_unit_test(silent_holders_are_replaced), cmocka_unit_test(late_holders_find_out),
        cmocka_unit_test(an_emptied_state_is_free),    cmocka_unit_test(one_of_many_rivals_wins),
    };

    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
