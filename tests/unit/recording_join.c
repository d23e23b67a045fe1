/* Recordings of several hosts, joined by trigger. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/recording_tests.h"

#define CAMERAS 3

/* Cameras of a host are a row of the array. */
static struct synthetic host(int row)
{
    struct synthetic s = small();

    for (int k = 0; k < CAMERAS; k++) {
        s.track[k].row = row;
        s.track[k].col = k;
        snprintf(s.track[k].serial, sizeof(s.track[k].serial), "R%dC%d", row, k);
    }
    return s;
}

static struct sst_recorder_config config(const struct synthetic *s, const char *to)
{
    struct sst_recorder_config cfg = synthetic_config(s, to);

    cfg.rows = 2;
    return cfg;
}

/* Faults of one host's recording of triggers 0 .. n-1. */
struct course {
    int64_t mono_ns, wall_ns;   /* its clocks ahead of the other host's */
    uint64_t first;             /* its count of trigger 0 */
    int misses;                 /* it does not count this trigger; -1: none */
    int lost_from, lost_before; /* sets that are not in the recording */
    int restarts;               /* at this trigger it begins to count from 0; -1: never */
};

static void make(const char *to, int row, int n, const struct course *c)
{
    struct synthetic s = host(row);
    struct sst_recorder_config cfg = config(&s, to);
    struct sst_recorder *r;
    uint64_t count = c->first;

    assert_int_equal(sst_recorder_open(&r, &cfg), 0);
    for (int i = 0; i < n; i++) {
        struct sst_frameset set;

        if (i == c->misses)
            continue;
        if (i == c->restarts) {
            assert_int_equal(sst_recorder_close(r), 0);
            cfg.append = true;
            assert_int_equal(sst_recorder_open(&r, &cfg), 0);
            count = 0;
        }
        synthetic_set(&s, (uint64_t)i, &set); /* the bytes say which trigger it is */
        set.index = count++;
        set.t_ns += c->mono_ns;
        set.wall_ns += c->wall_ns;
        for (int k = 0; k < CAMERAS; k++)
            if (set.frame[k])
                set.frame[k]->t_ns += c->mono_ns;
        if (i < c->lost_from || i >= c->lost_before)
            assert_int_equal(sst_recorder_write(r, &set), 0);
    }
    assert_int_equal(sst_recorder_close(r), 0);
    synthetic_fini(&s);
}

/* All frames of a joined set are of one trigger. @return it; -1: the set has no frame */
static int trigger_of(const struct sst_recording *r, int i, int *present)
{
    struct synthetic s = small();
    struct sst_recording_set set;
    int trigger = -1;

    assert_int_equal(sst_recording_set(r, i, &set), 0);
    *present = set.present;
    for (int k = 0; k < 2 * CAMERAS; k++) {
        uint8_t *data, want[64];

        if (!set.frame[k].present)
            continue;
        if (trigger < 0)
            trigger = (int)set.frame[k].sequence - 7;
        assert_int_equal(set.frame[k].sequence, trigger + 7);
        assert_int_equal(set.frame[k].t_ns - set.t_ns, synthetic_dt_ns((uint64_t)trigger, k % CAMERAS));
        assert_int_equal(sst_recording_frame(r, &set, k, &data), 0);
        synthetic_fill(want, set.frame[k].bytes, (uint64_t)trigger, k % CAMERAS);
        assert_memory_equal(data, want, set.frame[k].bytes);
        free(data);
    }
    synthetic_fini(&s);
    return trigger;
}

static struct sst_recording *join(const char *a, const char *b)
{
    const char *const dirs[] = { a, b };
    struct sst_recording *r = NULL;

    assert_int_equal(sst_recording_open_joined(&r, dirs, 2), 0);
    return r;
}

static const struct course plain = { .misses = -1, .restarts = -1 };

static void sets_of_one_trigger_are_one(void **state)
{
    char a[SST_PATH_MAX], b[SST_PATH_MAX], *line;
    struct sst_recording *r;
    int present;

    (void)state;
    assert_int_equal(sst_path_make_dir(dir), 0);
    strcpy(a, in(dir, "a"));
    strcpy(b, in(dir, "b"));
    make(a, 0, 40, &plain);
    make(b, 1, 40,
         &(struct course){ .mono_ns = 7000000000, .wall_ns = 9000000, .first = 500, .misses = -1, .restarts = -1 });
    r = join(a, b);
    assert_int_equal(sst_recording_info(r)->cameras, 2 * CAMERAS);
    assert_string_equal(sst_recording_info(r)->track[4].serial, "R1C1");
    assert_int_equal(sst_recording_sets(r), 40);
    for (int i = 0; i < 40; i++) {
        assert_int_equal(trigger_of(r, i, &present), i);
        assert_int_equal(present, 2 * CAMERAS);
    }
    assert_int_equal(sst_recording_line(r, 3, &line), 0);
    assert_contains(line, "\"joined\":[{\"recording\":");
    free(line);
    sst_recording_close(r);
}

static void what_one_host_lacks_is_missing(void **state)
{
    char a[SST_PATH_MAX], b[SST_PATH_MAX];
    struct sst_recording *r;
    int present, whole = 0;

    (void)state;
    assert_int_equal(sst_path_make_dir(dir), 0);
    strcpy(a, in(dir, "a"));
    strcpy(b, in(dir, "b"));
    make(a, 0, 60, &(struct course){ .misses = 20, .restarts = -1 });
    make(b, 1, 60,
         &(struct course){ .wall_ns = -12000000, .misses = -1, .lost_from = 30, .lost_before = 36, .restarts = 45 });
    r = join(a, b);
    assert_int_equal(sst_recording_sets(r), 60);
    for (int i = 0; i < 60; i++) {
        assert_int_equal(trigger_of(r, i, &present), i);
        whole += present == 2 * CAMERAS;
        if (i == 20 || (i >= 30 && i < 36))
            assert_int_equal(present, CAMERAS);
    }
    assert_int_equal(whole, 60 - 1 - 6);
    sst_recording_close(r);
}

static void recordings_that_do_not_belong_together_are_refused(void **state)
{
    char a[SST_PATH_MAX], b[SST_PATH_MAX];
    const char *const twice[] = { a, b };
    struct sst_recording *r;

    (void)state;
    assert_int_equal(sst_path_make_dir(dir), 0);
    strcpy(a, in(dir, "a"));
    strcpy(b, in(dir, "b"));
    make(a, 0, 3, &plain);
    make(b, 0, 3, &plain);
    assert_int_equal(sst_recording_open_joined(&r, twice, 2), -EBADMSG);
    assert_contains(said, "row 0, col 0");
    strcpy(b, in(dir, "none"));
    assert_int_equal(sst_recording_open_joined(&r, twice, 2), -ENOENT);
    assert_int_equal(sst_recording_open_joined(&r, twice, 0), -EINVAL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(sets_of_one_trigger_are_one),
        TEST(what_one_host_lacks_is_missing),
        TEST(recordings_that_do_not_belong_together_are_refused),
    };
    const int skipped = begin_tests(WITH_AVFORMAT);

    return skipped ? skipped : cmocka_run_group_tests(tests, NULL, remove_all);
}
