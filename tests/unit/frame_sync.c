/* Assembly of sets: hand-worked timelines, and random ones in which every frame must end in exactly one bucket. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/histogram.h"
#include "capture/array/frame_sync.h"
#include "tests/test.h"

#define MS 1000000ll

static struct {
    struct sst_framesync *sets;
    struct sst_frameset *out[4096]; /* in the order of hand-over; recycled at once unless `keep` */
    struct {
        uint64_t index;
        int present;
        int64_t t_ns;
        uint64_t have; /* bits: cameras */
        struct sst_skew skew;
    } seen[4096];
    int n, released;
    bool keep;
    struct sst_frame frame[200000];
    int frames;
} t;

static void on_set(void *arg, struct sst_frameset *set)
{
    (void)arg;
    assert_true(t.n < 4096);
    t.seen[t.n].index = set->index;
    t.seen[t.n].present = set->present;
    t.seen[t.n].t_ns = set->t_ns;
    t.seen[t.n].skew = set->skew;
    t.seen[t.n].have = 0;
    for (int i = 0; i < set->cameras && i < 64; i++)
        t.seen[t.n].have |= (uint64_t)(set->frame[i] != NULL) << i;
    t.out[t.n++] = set;
    if (!t.keep)
        sst_framesync_recycle(t.sets, set, false);
}

static void on_release(void *arg, struct sst_frame *frame, enum sst_bucket bucket)
{
    (void)arg;
    (void)bucket;
    assert_ptr_equal(frame->pool, &t); /* not released before */
    frame->pool = NULL;
    t.released++;
}

static void begin(int cameras, enum sst_framesync_match match, int64_t period_ns, int pool)
{
    const struct sst_framesync_events events = { .set = on_set, .release = on_release };
    const struct sst_framesync_config cfg = {
        .cameras = cameras, .match = match, .period_ns = period_ns, .pool = pool
    };

    memset(&t, 0, sizeof(t));
    assert_int_equal(sst_framesync_create(&t.sets, &cfg, &events), 0);
    for (int i = 0; i < cameras; i++)
        sst_framesync_camera(t.sets, i, true);
}

static void frame_bad(int cam, int64_t t_ns, unsigned faults)
{
    struct sst_frame *f = &t.frame[t.frames++];

    *f = (struct sst_frame){ .cam = cam, .t_ns = t_ns, .arrival_ns = t_ns + 20 * MS, .faults = faults, .pool = &t };
    sst_framesync_frame(t.sets, f);
    sst_framesync_tick(t.sets, t_ns + 20 * MS);
}

static void frame(int cam, int64_t t_ns)
{
    frame_bad(cam, t_ns, 0);
}

static struct sst_framesync_counters end(void)
{
    struct sst_framesync_counters n;
    uint64_t sum = 0;

    sst_framesync_flush(t.sets);
    sst_framesync_counters(t.sets, &n);
    for (int i = 0; i < SST_BUCKETS; i++)
        sum += n.bucket[i];
    assert_int_equal(sum, t.frames);
    assert_int_equal(n.waiting, 0);
    assert_int_equal(t.released, t.frames);
    assert_int_equal(n.sets, t.n);
    for (int i = 1; i < t.n; i++)
        assert_true(t.seen[i].index > t.seen[i - 1].index);
    sst_framesync_destroy(t.sets);
    return n;
}

static void complete_sets_and_skew(void **state)
{
    (void)state;
    begin(3, SST_FRAMESYNC_EDGE, 100 * MS, 8);
    sst_framesync_trigger(t.sets, 7, 1000 * MS, true);
    frame(0, 1000 * MS + 10);
    frame(2, 1000 * MS + 250);
    assert_int_equal(t.n, 0);
    frame(1, 1000 * MS + 20);
    assert_int_equal(t.n, 1); /* as soon as the last is in */
    assert_int_equal(t.seen[0].index, 7);
    assert_int_equal(t.seen[0].present, 3);
    assert_int_equal(t.seen[0].skew.spread_ns, 240);
    assert_int_equal(t.seen[0].skew.worst_cam, 2);
    assert_int_equal(t.seen[0].skew.from_edge_ns, 250);
    assert_int_equal(end().complete, 1);
}

/* Exposed by a command that comes late: its frame belongs to the trigger before, however near the next one is. */
static void frames_of_commands_follow_their_trigger(void **state)
{
    const struct sst_framesync_events events = { .set = on_set, .release = on_release };
    struct sst_framesync_config cfg = { .cameras = 2, .period_ns = 100 * MS, .pool = 4, .commanded = { false, true } };

    (void)state;
    memset(&t, 0, sizeof(t));
    assert_int_equal(sst_framesync_create(&t.sets, &cfg, &events), 0);
    sst_framesync_camera(t.sets, 0, true);
    sst_framesync_camera(t.sets, 1, true);
    for (int i = 0; i < 3; i++) {
        sst_framesync_trigger(t.sets, (uint64_t)i, 1000 * MS + i * 100 * MS, false);
        frame(0, 1000 * MS + i * 100 * MS + MS);
        frame(1, 1000 * MS + i * 100 * MS + 70 * MS); /* 30 ms before the next */
    }
    assert_int_equal(end().complete, 3);
    assert_int_equal(t.n, 3);
}

static void planned_delays_are_no_skew(void **state)
{
    const struct sst_framesync_events events = { .set = on_set, .release = on_release };
    struct sst_framesync_config cfg = { .cameras = 2, .period_ns = 100 * MS, .pool = 4, .delay_ns = { 0, 30 * MS } };

    (void)state;
    memset(&t, 0, sizeof(t));
    assert_int_equal(sst_framesync_create(&t.sets, &cfg, &events), 0);
    sst_framesync_trigger(t.sets, 0, 1000 * MS, false);
    frame(0, 1000 * MS);
    frame(1, 1030 * MS + 5);
    assert_int_equal(end().complete, 1);
    assert_int_equal(t.seen[0].skew.spread_ns, 5);
    assert_int_equal(t.seen[0].skew.from_edge_ns, 0); /* no edge was seen */
}

/** A camera that delivered for a later trigger, or does not stream, is not waited for; one that is silent is. */
static void partial_sets(void **state)
{
    (void)state;
    begin(2, SST_FRAMESYNC_EDGE, 100 * MS, 8);
    for (int k = 0; k < 3; k++)
        sst_framesync_trigger(t.sets, (uint64_t)k, (1000 + 100 * k) * MS, false);
    frame(0, 1000 * MS);
    frame(0, 1100 * MS);
    assert_int_equal(t.n, 0);
    frame(1, 1100 * MS);
    assert_int_equal(t.n, 2); /* camera 1 will not deliver for trigger 0 any more */
    assert_int_equal(t.seen[0].have, 1);
    assert_int_equal(t.seen[1].have, 3);
    frame(0, 1200 * MS);
    assert_int_equal(sst_framesync_tick(t.sets, 1300 * MS), 1450 * MS); /* 2.5 periods after the trigger */
    assert_int_equal(t.n, 2);
    sst_framesync_camera(t.sets, 1, false);
    sst_framesync_tick(t.sets, 1301 * MS);
    assert_int_equal(t.n, 3);
    sst_framesync_trigger(t.sets, 3, 1300 * MS, false);
    sst_framesync_camera(t.sets, 1, true);
    sst_framesync_tick(t.sets, 1549 * MS);
    assert_int_equal(t.n, 3);
    assert_true(sst_framesync_tick(t.sets, 1550 * MS) == INT64_MAX);
    assert_int_equal(t.n, 4);
    assert_int_equal(t.seen[3].present, 0);
    assert_int_equal(end().empty, 1);
}

static void buckets(void **state)
{
    struct sst_framesync_counters n;

    (void)state;
    begin(2, SST_FRAMESYNC_EDGE, 100 * MS, 8);
    sst_framesync_trigger(t.sets, 0, 1000 * MS, false);
    frame(0, 1000 * MS);
    frame(0, 1001 * MS);                                           /* duplicate */
    frame_bad(1, 1000 * MS, SST_FRAME_FLAGGED | SST_FRAME_NO_EOI); /* flagged */
    frame_bad(1, 1000 * MS, SST_FRAME_NO_SOI);                     /* corrupt */
    frame_bad(1, 1002 * MS, SST_FRAME_FROZEN);                     /* told, but good */
    assert_int_equal(t.n, 1);
    assert_int_equal(t.seen[0].present, 2);
    frame(0, 1050 * MS); /* held: its trigger may come, and does not */
    sst_framesync_trigger(t.sets, 1, 1100 * MS, false);
    frame(1, 1100 * MS);
    sst_framesync_tick(t.sets, 1400 * MS); /* set 1 closed without camera 0 */
    frame(0, 1101 * MS);                   /* late */
    frame(1, 1102 * MS);                   /* duplicate of a closed set */
    n = end();
    assert_int_equal(n.bucket[SST_BUCKET_SET], 3);
    assert_int_equal(n.bucket[SST_BUCKET_DUPLICATE], 2);
    assert_int_equal(n.bucket[SST_BUCKET_FLAGGED], 1);
    assert_int_equal(n.bucket[SST_BUCKET_CORRUPT], 1);
    assert_int_equal(n.bucket[SST_BUCKET_STRAY], 1);
    assert_int_equal(n.bucket[SST_BUCKET_LATE], 1);
    assert_int_equal(n.camera[1][SST_BUCKET_FLAGGED], 1);
}

/** A clock that jumps by whole periods: into the future it is seen at once, into the past since stamps ran backwards.
 */
static void jumped_stamps_are_not_matched(void **state)
{
    struct sst_framesync_counters n;
    const int64_t jump[] = { 200 * MS, -200 * MS };

    (void)state;
    for (int way = 0; way < 2; way++) {
        begin(2, SST_FRAMESYNC_EDGE, 100 * MS, 8);
        for (int k = 0; k < 20; k++) {
            const int64_t at = (1000 + 100 * k) * MS, off = k >= 5 && k < 10 ? jump[way] : 0;
            const bool back = way ? k == 5 : k == 10; /* as the driver sees it: not after the frame before */
            struct sst_frame *f = &t.frame[t.frames++];

            sst_framesync_trigger(t.sets, (uint64_t)k, at, false);
            frame(0, at);
            *f = (struct sst_frame){ .cam = 1, .t_ns = at + off, .arrival_ns = at + 20 * MS, .pool = &t };
            f->faults = back ? SST_FRAME_BACKWARDS : 0;
            sst_framesync_frame(t.sets, f);
            sst_framesync_tick(t.sets, at + 20 * MS);
        }
        n = end();
        assert_int_equal(n.bucket[SST_BUCKET_CORRUPT], way ? 5 : 6);
        assert_int_equal(n.bucket[SST_BUCKET_SET], 40 - (way ? 5 : 6));
        assert_int_equal(n.bucket[SST_BUCKET_DUPLICATE], 0);
        for (int i = 0; i < t.n; i++)
            assert_in_range(t.seen[i].skew.spread_ns, 0, 1);
    }
}

static void frame_before_its_trigger_waits(void **state)
{
    struct sst_framesync_counters n;

    (void)state;
    begin(1, SST_FRAMESYNC_EDGE, 100 * MS, 4);
    frame(0, 1000 * MS);
    assert_int_equal(t.n, 0);
    sst_framesync_counters(t.sets, &n);
    assert_int_equal(n.waiting, 1);
    sst_framesync_trigger(t.sets, 0, 999 * MS, false);
    sst_framesync_tick(t.sets, 1021 * MS);
    assert_int_equal(t.n, 1);
    frame(0, 1100 * MS);
    sst_framesync_tick(t.sets, 1500 * MS); /* 250 ms and more after arrival: no trigger came */
    assert_int_equal(end().bucket[SST_BUCKET_STRAY], 1);
}

static void frames_of_open_sets_wait(void **state)
{
    struct sst_framesync_counters n;

    (void)state;
    begin(3, SST_FRAMESYNC_EDGE, 100 * MS, 4);
    for (int k = 0; k < 2; k++) {
        sst_framesync_trigger(t.sets, (uint64_t)k, (1000 + 100 * k) * MS, false);
        frame(0, (1000 + 100 * k) * MS);
        frame(1, (1000 + 100 * k) * MS);
    }
    assert_int_equal(t.n, 0);
    sst_framesync_counters(t.sets, &n);
    assert_int_equal(n.waiting, 4);
    assert_int_equal(end().bucket[SST_BUCKET_SET], 4);
}

static void a_receiver_that_keeps_all_sets(void **state)
{
    struct sst_framesync_counters n;

    (void)state;
    begin(1, SST_FRAMESYNC_EDGE, 100 * MS, 2);
    t.keep = true;
    for (int k = 0; k < 5; k++) {
        sst_framesync_trigger(t.sets, (uint64_t)k, (1000 + 100 * k) * MS, false);
        frame(0, (1000 + 100 * k) * MS);
    }
    assert_int_equal(t.n, 2);
    sst_framesync_counters(t.sets, &n);
    assert_int_equal(n.waiting, 2);
    sst_framesync_recycle(t.sets, t.out[0], false);
    sst_framesync_counters(t.sets, &n);
    assert_int_equal(n.waiting, 1);
    sst_framesync_recycle(t.sets, t.out[1], true);
    n = end();
    assert_int_equal(n.dropped, 3);
    assert_int_equal(n.bucket[SST_BUCKET_SET], 1);
    assert_int_equal(n.bucket[SST_BUCKET_DROPPED], 4);
}

static void nearest_of_fast_cameras(void **state)
{
    struct sst_framesync_counters n;

    (void)state;
    begin(2, SST_FRAMESYNC_NEAREST, 100 * MS, 8);
    for (int ms = 960; ms < 1400; ms += 10) {
        if (ms % 100 == 0)
            sst_framesync_trigger(t.sets, (uint64_t)(ms / 100), ms * MS, false);
        frame(0, ms * MS + 1 * MS); /* 1 after each mark */
        frame(1, ms * MS + 7 * MS); /* 3 before each mark */
    }
    n = end();
    assert_int_equal(n.complete, 4);
    for (int i = 0; i < 4; i++)
        assert_int_equal(t.seen[i].skew.spread_ns, 4 * MS);
    assert_int_equal(n.bucket[SST_BUCKET_SET], 8);
}

static double unit(void)
{
    return (double)rand() / RAND_MAX;
}

/** Cameras with phases all over the period, jitter and 0.02 % of drift against the nominal rate, all alike. */
static void free_run_follows_the_beat(void **state)
{
    static const double phase[] = { 0, 0.24, 0.49, -0.26 };
    struct sst_framesync_counters n;

    (void)state;
    srand(3);
    begin(4, SST_FRAMESYNC_FREE, 100 * MS, 8);
    for (int k = 0; k < 3000; k++)
        for (int step = 0; step < 4; step++) { /* in the order of time */
            static const int order[] = { 3, 0, 1, 2 };
            const int cam = order[step];

            frame(cam, (int64_t)((10 + k + phase[cam] + 0.02 * (unit() - 0.5)) * 100.02e6));
        }
    n = end();
    assert_int_equal(n.bucket[SST_BUCKET_SET], 12000);
    assert_true(n.complete >= 2998); /* the first and the last */
    assert_int_equal(n.relocked, 0);
}

/** A stamp from the future costs its own frame, whatever it says; no other camera's, and none that follow. */
static void free_run_survives_stamps_from_the_future(void **state)
{
    static const int64_t ahead[] = { 2 * MS + 20 * MS, 2000 * MS, 900000 * MS, 3600000 * MS };

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(ahead); i++)
        for (int first = 0; first < 2; first++) { /* the very first frame of all, or some in the middle */
            struct sst_framesync_counters n;
            int wrong = 0;

            begin(3, SST_FRAMESYNC_FREE, 100 * MS, 8);
            for (int k = 0; k < 60; k++)
                for (int cam = 0; cam < 3; cam++) {
                    struct sst_frame *f = &t.frame[t.frames];
                    const int64_t at = (1000 + 100 * k + cam) * MS;
                    const bool off = cam == 1 && (first ? k == 0 : k >= 20 && k < 25);

                    if (!off) {
                        frame(cam, at);
                        continue;
                    }
                    t.frames++;
                    wrong++;
                    *f = (struct sst_frame){ .cam = 1, .t_ns = at + ahead[i], .arrival_ns = at + 20 * MS, .pool = &t };
                    sst_framesync_frame(t.sets, f);
                    sst_framesync_tick(t.sets, at + 20 * MS);
                }
            n = end();
            assert_int_equal(n.bucket[SST_BUCKET_CORRUPT], wrong);
            assert_int_equal(n.camera[1][SST_BUCKET_CORRUPT], wrong);
            assert_int_equal(n.bucket[SST_BUCKET_SET], 180 - wrong);
            assert_int_equal(n.complete, 60 - wrong);
            assert_int_equal(n.relocked, 0);
        }
}

/** One camera is 0.5 % slow: every 200 beats it has one frame less, and nothing is lost. */
static void free_run_with_a_slow_camera(void **state)
{
    struct sst_framesync_counters n;
    int64_t next[2] = { 1000 * MS, 1001 * MS };

    (void)state;
    begin(2, SST_FRAMESYNC_FREE, 100 * MS, 8);
    while (t.frames < 4000) {
        const int cam = next[1] < next[0];

        frame(cam, next[cam]);
        next[cam] += cam ? 100500000 : 100000000;
    }
    n = end();
    assert_in_range(n.relocked, 3, 30);
    assert_true(n.complete > 1900);
}

/** Anything may come: each frame in one bucket, sets in order (checked by end()). */
static void random_timelines(void **state)
{
    (void)state;
    for (int seed = 0; seed < 60; seed++) {
        const enum sst_framesync_match match = (enum sst_framesync_match)(seed % 3);
        int64_t now = 5000 * MS;
        uint64_t index = 0;

        srand((unsigned)seed);
        begin(5, match, 100 * MS, 3);
        for (int i = 0; i < 1500 && t.n < 4000; i++) {
            const double u = unit();

            now += (int64_t)(unit() * 40e6);
            if (u < 0.2 && match != SST_FRAMESYNC_FREE)
                sst_framesync_trigger(t.sets, index++, now, false);
            else if (u < 0.22)
                sst_framesync_camera(t.sets, rand() % 5, rand() % 2);
            else if (u < 0.3)
                frame_bad(rand() % 5, now, (unsigned)rand() & SST_FRAME_BAD);
            else
                frame(rand() % 5, now + (int64_t)((unit() - 0.5) * 400e6));
            sst_framesync_tick(t.sets, now);
        }
        end();
    }
}

/* Frames that name their trigger, like frames of other hosts: their time stamps decide nothing. */
static void place(int cam, uint64_t index, int64_t now_ns)
{
    struct sst_frame *f = &t.frame[t.frames++];

    *f = (struct sst_frame){ .cam = cam, .t_ns = 999 * MS, .arrival_ns = now_ns, .pool = &t };
    sst_framesync_place(t.sets, cam, index, f);
    sst_framesync_tick(t.sets, now_ns);
}

static void frames_that_name_their_trigger(void **state)
{
    struct sst_framesync_counters n;

    (void)state;
    begin(3, SST_FRAMESYNC_INDEX, 100 * MS, 6);
    for (uint64_t i = 5; i < 8; i++)
        sst_framesync_trigger(t.sets, i, 1000 * MS + (int64_t)i * 100 * MS, true);
    place(0, 5, 1510 * MS);
    place(1, 5, 1511 * MS);
    assert_int_equal(t.n, 0);
    sst_framesync_place(t.sets, 2, 5, NULL); /* it has none: nobody waits for it */
    sst_framesync_tick(t.sets, 1512 * MS);
    assert_int_equal(t.n, 1);
    assert_int_equal(t.seen[0].index, 5);
    assert_int_equal(t.seen[0].have, 3);
    assert_true(t.seen[0].t_ns == 1500 * MS);
    place(0, 7, 1720 * MS); /* newer frames come first: of 6 it has nothing any more */
    place(1, 6, 1721 * MS);
    place(2, 6, 1722 * MS);
    assert_int_equal(t.n, 2);
    assert_int_equal(t.seen[1].index, 6);
    assert_int_equal(t.seen[1].have, 6);
    place(1, 7, 1723 * MS);
    place(2, 7, 1724 * MS);
    assert_int_equal(t.n, 3);
    assert_int_equal(t.seen[2].have, 7);
    place(2, 5, 1730 * MS); /* late */
    place(1, 7, 1731 * MS); /* twice */
    place(0, 3, 1732 * MS); /* before all that is known */
    place(0, 9, 1733 * MS); /* never reported */
    n = end();
    assert_int_equal(n.bucket[SST_BUCKET_SET], 7);
    assert_int_equal(n.bucket[SST_BUCKET_LATE], 2);
    assert_int_equal(n.bucket[SST_BUCKET_DUPLICATE], 1);
    assert_int_equal(n.bucket[SST_BUCKET_STRAY], 1);
}

static void a_host_that_is_gone_is_not_waited_for(void **state)
{
    (void)state;
    begin(2, SST_FRAMESYNC_INDEX, 100 * MS, 6);
    sst_framesync_trigger(t.sets, 0, 1000 * MS, true);
    place(0, 0, 1010 * MS);
    assert_int_equal(t.n, 0);
    assert_int_equal(sst_framesync_tick(t.sets, 1011 * MS), 1250 * MS);
    sst_framesync_camera(t.sets, 1, false);
    sst_framesync_tick(t.sets, 1012 * MS);
    assert_int_equal(t.n, 1);
    end();
}

static void histogram(void **state)
{
    static struct sst_histogram h;

    (void)state;
    assert_int_equal(sst_histogram_quantile(&h, 0.5), 0);
    sst_histogram_add(&h, -5);
    assert_int_equal(sst_histogram_quantile(&h, 1), 0);
    memset(&h, 0, sizeof(h));
    for (int i = 1; i <= 100; i++)
        sst_histogram_add(&h, i);
    assert_int_equal(sst_histogram_quantile(&h, 0.5), 50);
    assert_int_equal(sst_histogram_quantile(&h, 0.99), 99);
    assert_int_equal(sst_histogram_quantile(&h, 0), 1);
    memset(&h, 0, sizeof(h));
    for (int64_t v = 1; v < INT64_MAX / 3; v = v * 3 + 1) { /* within 1/64 above, never below */
        memset(&h, 0, sizeof(h));
        sst_histogram_add(&h, v);
        sst_histogram_add(&h, INT64_MAX);
        assert_true(sst_histogram_quantile(&h, 0.5) >= v);
        assert_true(sst_histogram_quantile(&h, 0.5) - v <= v / 64);
        assert_true(sst_histogram_quantile(&h, 1) == INT64_MAX);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(complete_sets_and_skew),
        cmocka_unit_test(frames_of_commands_follow_their_trigger),
        cmocka_unit_test(planned_delays_are_no_skew),
        cmocka_unit_test(partial_sets),
        cmocka_unit_test(buckets),
        cmocka_unit_test(jumped_stamps_are_not_matched),
        cmocka_unit_test(frame_before_its_trigger_waits),
        cmocka_unit_test(frames_of_open_sets_wait),
        cmocka_unit_test(a_receiver_that_keeps_all_sets),
        cmocka_unit_test(nearest_of_fast_cameras),
        cmocka_unit_test(free_run_follows_the_beat),
        cmocka_unit_test(free_run_survives_stamps_from_the_future),
        cmocka_unit_test(free_run_with_a_slow_camera),
        cmocka_unit_test(frames_that_name_their_trigger),
        cmocka_unit_test(a_host_that_is_gone_is_not_waited_for),
        cmocka_unit_test(random_timelines),
        cmocka_unit_test(histogram),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
