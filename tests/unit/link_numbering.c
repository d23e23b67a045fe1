/* capture/link: one numbering of triggers for hosts that count the same edges, with clocks of their own. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "capture/link/numbering.h"
#include "tests/random.h"
#include "tests/test.h"

#define MS      INT64_C(1000000)
#define PERIOD  (100 * MS)
#define SOURCES 4

/* A host: its count of the edges 0, 1, 2 ... that come at PERIOD, and its clocks. */
struct host {
    int64_t mono_ns, wall_ns; /* ahead of ours */
    double drift;             /* of its monotonic clock */
    uint64_t count;           /* of edges that it saw */
    uint64_t run;
    bool away;
    int64_t due_ns; /* its report of `truth` arrives then; 0: none is on its way */
    uint64_t truth;
    struct sst_numbering_edge edge;
};

static struct {
    struct sst_numbering *n;
    struct host host[SOURCES];
    int64_t truth_of[8192], index_of[8192]; /* by index, by true number, plus 1; 0: none yet */
    int placed, held, unnamed;
    int mixed; /* sets of another edge under an index */
    int split; /* sets of an edge under another index */
    struct sst_numbering_place last;
} t;

static uint64_t draw(uint64_t *rng, uint64_t below)
{
    return (uint64_t)(sst_random(rng) * (double)below);
}

static void begin(void)
{
    memset(&t, 0, sizeof(t));
    assert_int_equal(sst_numbering_create(&t.n, PERIOD), 0);
}

static void join(int source, int64_t mono_ns, int64_t wall_ns, double drift)
{
    struct host *h = &t.host[source];

    *h = (struct host){ .mono_ns = mono_ns, .wall_ns = wall_ns, .drift = drift, .run = h->run + 1, .count = h->count };
    sst_numbering_join(t.n, source, h->run);
}

/* The host sees the true edge of that number and time. */
static struct sst_numbering_edge see(int source, int64_t t_ns)
{
    struct host *h = &t.host[source];

    return (struct sst_numbering_edge){ h->count++, t_ns + h->mono_ns + (int64_t)((double)t_ns * h->drift),
                                        t_ns + h->wall_ns };
}

static enum sst_numbering_verdict place(int source, uint64_t truth, const struct sst_numbering_edge *edge,
                                        int64_t now_ns)
{
    struct sst_numbering_place at;
    const enum sst_numbering_verdict v = sst_numbering_place(t.n, source, edge, now_ns, &at);

    t.held += v == SST_NUMBERING_HELD;
    t.unnamed += v == SST_NUMBERING_UNNAMED;
    if (v != SST_NUMBERING_PLACED)
        return v;
    t.placed++;
    t.last = at;
    assert_true(at.index < 8190 && truth < 8190);
    if (t.truth_of[at.index] && t.truth_of[at.index] != (int64_t)truth + 1) {
        t.mixed++;
        printf("source %d: edge %llu is placed at %llu, where edge %lld is\n", source, (unsigned long long)truth,
               (unsigned long long)at.index, (long long)t.truth_of[at.index] - 1);
    }
    t.split += t.index_of[truth] && t.index_of[truth] != (int64_t)at.index + 1;
    t.truth_of[at.index] = (int64_t)truth + 1;
    t.index_of[truth] = (int64_t)at.index + 1;
    return v;
}

static enum sst_numbering_verdict report(int source, uint64_t truth)
{
    const int64_t t_ns = (int64_t)truth * PERIOD + 5000 * MS;
    const struct sst_numbering_edge edge = see(source, t_ns);

    return place(source, truth, &edge, t_ns + 20 * MS);
}

static struct sst_numbering_state state_of(int source)
{
    struct sst_numbering_state s;

    sst_numbering_state(t.n, source, &s);
    return s;
}

static void end(void)
{
    assert_int_equal(t.mixed, 0);
    assert_int_equal(t.split, 0);
    sst_numbering_destroy(t.n);
}

static void counts_of_hosts_agree_after_one_look_at_the_clock(void **state SST_UNUSED)
{
    begin();
    join(0, 70000 * MS, 3 * MS, 0);
    join(1, -4000 * MS, -6 * MS, 50e-6);
    t.host[1].count = 777;
    for (uint64_t i = 10; i < 500; i++) {
        assert_int_equal(report(0, i), SST_NUMBERING_PLACED);
        assert_int_equal(report(1, i), SST_NUMBERING_PLACED);
        /* A clock that is stepped by seconds changes nothing: it named the first set only. */
        if (i == 100)
            t.host[1].wall_ns += 7300 * MS;
    }
    assert_int_equal(state_of(0).slips + state_of(1).slips, 0);
    assert_true(state_of(1).clock_ns > 6000 * MS); /* it is reported */
    end();
}

/* A host that starts with a wrong clock, as a board without a battery, leaves the sets of the other hosts alone. */
static void a_clock_that_is_far_off_names_nothing(void **state SST_UNUSED)
{
    begin();
    join(0, 70000 * MS, 0, 0);
    join(1, -4000 * MS, 2 * MS, 0);
    for (uint64_t i = 10; i < 400; i++) {
        if (i == 50 || i == 150 || i == 250) /* ahead, behind, and by a whole number of periods */
            join(1, 9000 * MS, i == 50 ? 900037 * MS : i == 150 ? -86400011 * MS : 3000 * MS, 0);
        if (i == 100 || i == 200 || i == 300)
            t.host[1].wall_ns = 2 * MS; /* it is set */
        assert_int_equal(report(0, i), SST_NUMBERING_PLACED);
        assert_int_equal(report(1, i), i % 100 >= 50 && i < 300 ? SST_NUMBERING_UNNAMED : SST_NUMBERING_PLACED);
    }
    assert_int_equal(t.unnamed, 150);
    end();

    /* The clock of the first host is off: hosts with the right time are placed once it is set. */
    begin();
    join(0, 70000 * MS, -86400000 * MS, 0);
    join(1, -4000 * MS, 2 * MS, 0);
    for (uint64_t i = 10; i < 100; i++) {
        if (i == 50)
            t.host[0].wall_ns = 0;
        assert_int_equal(report(0, i), SST_NUMBERING_PLACED);
        assert_int_equal(report(1, i), i < 50 ? SST_NUMBERING_UNNAMED : SST_NUMBERING_PLACED);
    }
    assert_true(state_of(0).clock_ns > 80000000 * MS);
    end();

    /* A single host counts by its own clock, under numbers that were not used before. */
    begin();
    join(0, 70000 * MS, 0, 0);
    for (uint64_t i = 10; i < 50; i++)
        assert_int_equal(report(0, i), SST_NUMBERING_PLACED);
    sst_numbering_leave(t.n, 0);
    join(0, 10 * MS, -86400000 * MS, 0);
    t.host[0].count = 0;
    for (uint64_t i = 100; i < 150; i++)
        assert_int_equal(report(0, i), SST_NUMBERING_PLACED);
    end();
}

static void a_missed_edge_is_put_right_before_its_set_is_placed(void **state SST_UNUSED)
{
    begin();
    join(0, 0, 0, 0);
    join(1, 9 * MS, 4 * MS, 0);
    for (uint64_t i = 0; i < 100; i++) {
        (void)report(0, i);
        if (i == 40 || i == 60 || i == 61)
            continue;
        assert_int_equal(report(1, i), SST_NUMBERING_PLACED);
    }
    assert_int_equal(state_of(1).slips, 2);
    assert_int_equal(state_of(1).slipped, 3);
    assert_int_equal(state_of(0).slips, 0);
    end();
}

static void who_is_first_to_report_after_missing_edges_waits_for_the_others(void **state SST_UNUSED)
{
    struct sst_numbering_edge edge;
    const int64_t t_ns = 5000 * MS + 51 * PERIOD;

    begin();
    join(0, 0, 0, 0);
    join(1, 9 * MS, 4 * MS, 0);
    for (uint64_t i = 0; i < 50; i++) {
        (void)report(0, i);
        (void)report(1, i);
    }
    /* Host 1 misses edge 50, and its report of 51 is here before host 0's of 50. */
    edge = see(1, t_ns);
    assert_int_equal(place(1, 51, &edge, t_ns + 10 * MS), SST_NUMBERING_HELD);
    assert_int_equal(report(0, 50), SST_NUMBERING_PLACED);
    assert_int_equal(place(1, 51, &edge, t_ns + 20 * MS), SST_NUMBERING_PLACED);
    assert_int_equal(report(0, 51), SST_NUMBERING_PLACED);
    assert_int_equal(state_of(1).slips, 1);
    assert_int_equal(state_of(0).slips, 0);
    end();
}

static void a_pause_of_the_trigger_is_no_slip(void **state SST_UNUSED)
{
    struct sst_numbering_edge edge[2];
    const int64_t pause_ns = 730 * MS;

    begin();
    join(0, 0, 0, 0);
    join(1, 9 * MS, 4 * MS, 0);
    for (uint64_t i = 0; i < 50; i++) {
        (void)report(0, i);
        (void)report(1, i);
    }
    for (uint64_t i = 50; i < 90; i++) {
        const int64_t t_ns = 5000 * MS + (int64_t)i * PERIOD + pause_ns;

        edge[0] = see(0, t_ns);
        edge[1] = see(1, t_ns);
        if (place(0, i, &edge[0], t_ns + 10 * MS) == SST_NUMBERING_HELD) {
            assert_int_equal(i, 50); /* the first one, until the other says the same */
            assert_int_equal(place(1, i, &edge[1], t_ns + 12 * MS), SST_NUMBERING_PLACED);
            assert_int_equal(place(0, i, &edge[0], t_ns + 12 * MS), SST_NUMBERING_PLACED);
            continue;
        }
        assert_int_equal(place(1, i, &edge[1], t_ns + 12 * MS), SST_NUMBERING_PLACED);
    }
    assert_int_equal(state_of(0).slips + state_of(1).slips, 0);
    assert_int_equal(t.held, 1);
    end();
}

static void an_edge_that_one_host_counts_twice_shifts_nothing(void **state SST_UNUSED)
{
    begin();
    join(0, 0, 0, 0);
    join(1, 9 * MS, 4 * MS, 0);
    for (uint64_t i = 0; i < 60; i++) {
        (void)report(0, i);
        (void)report(1, i);
        if (i == 30) { /* a bounce, 2 ms later: it must not become a set */
            const struct sst_numbering_edge edge = see(1, 5000 * MS + 30 * PERIOD + 2 * MS);

            assert_int_equal(place(1, 30, &edge, 5030 * MS + 30 * PERIOD), SST_NUMBERING_UNNAMED);
        }
        if (i == 45) { /* something in the middle between two edges */
            const struct sst_numbering_edge edge = see(1, 5050 * MS + 45 * PERIOD);

            assert_int_equal(place(1, 45, &edge, 5060 * MS + 45 * PERIOD), SST_NUMBERING_HELD);
            assert_int_equal(report(0, 46), SST_NUMBERING_PLACED); /* the others have seen none there */
            assert_int_equal(place(1, 45, &edge, 5120 * MS + 45 * PERIOD), SST_NUMBERING_UNNAMED);
            assert_int_equal(report(1, 46), SST_NUMBERING_PLACED);
            i++;
        }
    }
    assert_int_equal(state_of(1).slipped, -2);
    assert_int_equal(t.unnamed, 2);
    end();
}

static void a_host_that_comes_back_goes_on_or_is_named_again(void **state SST_UNUSED)
{
    begin();
    join(0, 0, 0, 0);
    join(1, 9 * MS, 4 * MS, 0);
    for (uint64_t i = 0; i < 50; i++) {
        (void)report(0, i);
        (void)report(1, i);
    }
    /* A cut cable: its counting went on, and its clock is not asked, though it is wrong by now. */
    sst_numbering_leave(t.n, 1);
    for (uint64_t i = 50; i < 80; i++) {
        (void)report(0, i);
        t.host[1].count++;
    }
    t.host[1].wall_ns += 45 * MS;
    sst_numbering_join(t.n, 1, t.host[1].run);
    assert_int_equal(report(1, 80), SST_NUMBERING_PLACED);
    (void)report(0, 80);
    /* A restart: it counts from 0, and the clock must be right again. */
    sst_numbering_leave(t.n, 1);
    join(1, 123 * MS, 40 * MS, 0);
    t.host[1].count = 0;
    (void)report(0, 81);
    assert_int_equal(report(1, 81), SST_NUMBERING_UNNAMED); /* 0.4 of a period: no */
    t.host[1].wall_ns = 20 * MS;
    assert_int_equal(report(1, 82), SST_NUMBERING_PLACED);
    (void)report(0, 82);
    assert_int_equal(report(1, 83), SST_NUMBERING_PLACED);
    end();
}

/* Hosts that miss edges, bounce, restart and are cut off, with reports that are late in any order or lost. */
static void random_course(uint64_t seed)
{
    uint64_t rng = seed;
    int64_t offset_ns = 0;

    begin();
    for (int k = 0; k < SOURCES; k++)
        join(k, (int64_t)draw(&rng, 1000000) * MS, (int64_t)draw(&rng, 16) * MS - 8 * MS,
             ((double)draw(&rng, 200) - 100) * 1e-6);
    for (uint64_t i = 0; i < 3000; i++) {
        const int64_t t_ns = 5000 * MS + (int64_t)i * PERIOD + offset_ns;

        if (draw(&rng, 500) == 0)
            offset_ns += (int64_t)draw(&rng, 900) * MS; /* the trigger pauses */
        for (int64_t now_ns = t_ns; now_ns < t_ns + PERIOD; now_ns += 5 * MS) {
            for (int k = 0; k < SOURCES; k++) {
                struct host *h = &t.host[k];

                if (now_ns == t_ns && !h->due_ns && !h->away && draw(&rng, 40)) {
                    h->edge = see(k, t_ns); /* else it misses this one */
                    h->truth = i;
                    h->due_ns = t_ns + 15 * MS + (int64_t)draw(&rng, 80) * MS;
                } else if (now_ns == t_ns && h->due_ns) {
                    h->count++; /* counted, and its set was dropped: the one before is still on its way */
                }
                if (h->due_ns && now_ns >= h->due_ns && place(k, h->truth, &h->edge, now_ns) != SST_NUMBERING_HELD)
                    h->due_ns = 0;
            }
        }
        for (int k = 1; k < SOURCES; k++) {
            struct host *h = &t.host[k];

            if (draw(&rng, 400) == 0) {
                sst_numbering_leave(t.n, k);
                h->away = true;
                h->due_ns = 0;
            } else if (h->away && draw(&rng, 30) == 0) {
                join(k, (int64_t)draw(&rng, 1000000) * MS, (int64_t)draw(&rng, 16) * MS - 8 * MS, 0);
                h->count = 0;
            }
        }
    }
    if (t.mixed || t.split * 1000 > t.placed)
        printf("seed %llu: %d placed, %d mixed, %d split, %d unnamed\n", (unsigned long long)seed, t.placed, t.mixed,
               t.split, t.unnamed);
    assert_int_equal(t.mixed, 0);
    assert_true(t.split * 1000 <= t.placed);
    assert_true(t.placed > 9000);
    sst_numbering_destroy(t.n);
}

static void no_set_is_mixed_whatever_happens(void **state SST_UNUSED)
{
    for (uint64_t seed = 1; seed <= 30; seed++)
        random_course(seed);
}

/* Numbers and times at the ends of a message's range, from hosts that join again and again. */
static void no_number_of_a_host_overflows(void **state SST_UNUSED)
{
    static const int64_t ends[] = { 0, 1, INT64_MAX / 8, INT64_MAX / 8 - 1, 5000 * MS, INT64_MAX / 16 };
    struct sst_numbering_place at;
    struct sst_numbering_state s;
    uint64_t rng = 1;

    begin();
    for (int i = 0; i < 20000; i++) {
        const int source = (int)draw(&rng, SOURCES);
        const struct sst_numbering_edge edge = { .count = (uint64_t)ends[draw(&rng, ARRAY_LEN(ends))] + draw(&rng, 2),
                                                 .t_ns = ends[draw(&rng, ARRAY_LEN(ends))],
                                                 .wall_ns = 4 * ends[draw(&rng, ARRAY_LEN(ends))] -
                                                            INT64_C(1800000000000000000) };

        if (!draw(&rng, 50))
            sst_numbering_join(t.n, source, draw(&rng, 3));
        if (sst_numbering_place(t.n, source, &edge, i * PERIOD, &at) == SST_NUMBERING_PLACED)
            assert_true(at.index <= INT64_MAX / 2 && llabs(at.t_ns) <= INT64_MAX / 2);
        sst_numbering_state(t.n, source, &s);
    }
    sst_numbering_destroy(t.n);
}

static void a_period_is_needed(void **state SST_UNUSED)
{
    struct sst_numbering *n;

    assert_int_equal(sst_numbering_create(&n, 0), -EINVAL);
    sst_numbering_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(counts_of_hosts_agree_after_one_look_at_the_clock),
        cmocka_unit_test(a_clock_that_is_far_off_names_nothing),
        cmocka_unit_test(a_missed_edge_is_put_right_before_its_set_is_placed),
        cmocka_unit_test(who_is_first_to_report_after_missing_edges_waits_for_the_others),
        cmocka_unit_test(a_pause_of_the_trigger_is_no_slip),
        cmocka_unit_test(an_edge_that_one_host_counts_twice_shifts_nothing),
        cmocka_unit_test(a_host_that_comes_back_goes_on_or_is_named_again),
        cmocka_unit_test(no_set_is_mixed_whatever_happens),
        cmocka_unit_test(no_number_of_a_host_overflows),
        cmocka_unit_test(a_period_is_needed),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
