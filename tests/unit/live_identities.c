/* pipeline/live/identities.c: one identity for what the scene's tracks and the search behind leaves see of one thing,
 * on parts made here; pipeline/live/hidden/follow.c: who is reported of the images of one thing. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <string.h>

#include "pipeline/live/hidden/hidden_internal.h"
#include "pipeline/live/live_internal.h"
#include "tests/test.h"

#define WIDTH  640
#define HEIGHT 480
#define SET_NS INT64_C(333000000)
#define SPEED  100.0 /* px/s */
#define NEARBY 10.0  /* px, disparity of the passer-by */

struct bench {
    struct live_identities who;
    struct sst_live_track open[4];
    struct sst_hidden_thing thing[4];
    int opens, things;
    int64_t t_ns;
    struct sst_live_track track[SST_LIVE_TRACKS];
    int tracks;
    uint32_t ids[8]; /* seen so far */
    int seen;
};

static void start(struct bench *b)
{
    memset(b, 0, sizeof(*b));
    b->t_ns = INT64_C(10000000000);
}

static double passed_s(const struct bench *b)
{
    return (double)b->t_ns * 1e-9 - 10;
}

/* Legs in a gap. */
static void add_open(struct bench *b, uint32_t id, double x, double y, double speed, double disp_px)
{
    b->open[b->opens++] = (struct sst_live_track){ .id = id,
                                                   .label = SST_LABEL_PEDESTRIAN,
                                                   .x0 = x - 20,
                                                   .x1 = x + 20,
                                                   .y0 = y - 25,
                                                   .y1 = y + 25,
                                                   .vx_px_s = speed,
                                                   .disp_px = disp_px,
                                                   .first_ns = b->t_ns,
                                                   .seen_ns = b->t_ns };
}

/* About the whole, about there. */
static void add_hidden(struct bench *b, uint32_t key, double x, double speed, double disp_px)
{
    b->thing[b->things++] = (struct sst_hidden_thing){ .key = key,
                                                       .reported = true,
                                                       .seen = true,
                                                       .x0 = x - 45,
                                                       .x1 = x + 25,
                                                       .y0 = 290,
                                                       .y1 = 430,
                                                       .vx_px_s = speed,
                                                       .disp_px = disp_px,
                                                       .first_ns = b->t_ns,
                                                       .seen_ns = b->t_ns };
}

static void step(struct bench *b)
{
    live_identities_update(&b->who,
                           &(struct live_seen){ b->open, b->opens, b->thing, b->things, WIDTH, HEIGHT, b->t_ns });
    b->tracks = live_identities_tracks(&b->who, b->track);
    for (int i = 0; i < b->tracks; i++) {
        int k = 0;

        while (k < b->seen && b->ids[k] != b->track[i].id)
            k++;
        if (k == b->seen)
            b->ids[b->seen++] = b->track[i].id;
    }
    b->opens = b->things = 0;
    b->t_ns += SET_NS;
}

/* Now one of the searches sees the passer-by, now the other, now both, now none; both begin in one set. */
static void a_passage_is_one_identity(void **state)
{
    struct bench b;

    (void)state;
    start(&b);
    for (int n = 0; n < 18; n++) {
        const double x = 50 + SPEED * passed_s(&b);

        if (n % 5 != 3 && n % 7 != 6)
            add_open(&b, n < 9 ? 1 : 2, x, n < 9 ? 400 : 320, SPEED, NEARBY);
        if (n % 4 != 3)
            add_hidden(&b, n < 12 ? 1 : 2, x, SPEED / 2, NEARBY + 1 + n % 3);
        step(&b);
        assert_int_equal(b.tracks, 1);
        assert_true(fabs(b.track[0].disp_px - NEARBY) < 0.1); /* known from the open */
        assert_int_equal(b.track[0].label, SST_LABEL_PEDESTRIAN);
    }
    assert_int_equal(b.seen, 1);
}

/* Two persons who walk in opposite directions behind the hedge, whatever their depths. */
static void two_who_cross_stay_two(void **state)
{
    (void)state;
    for (double disp_px = 5; disp_px <= 11; disp_px += 2) {
        struct bench b;

        start(&b);
        for (int n = 0; n < 18; n++) {
            const double s = passed_s(&b), x = 50 + SPEED * s, y = 590 - SPEED * s;

            if (n % 3 != 2)
                add_open(&b, 1, x, 400, SPEED, NEARBY);
            if (n % 4 != 3)
                add_hidden(&b, 1, x, SPEED / 2, NEARBY + 1);
            add_hidden(&b, 2, y, -SPEED / 2, disp_px);
            step(&b);
            assert_int_equal(b.tracks, 2);
        }
        assert_int_equal(b.seen, 2);
    }
}

/* The one in front of the hedge hides the one behind it. */
static void who_overtakes_stays_another(void **state)
{
    struct bench b;

    (void)state;
    start(&b);
    for (int n = 0; n < 15; n++) {
        const double s = passed_s(&b);

        add_open(&b, 1, 40 + 1.4 * SPEED * s, 300, 1.4 * SPEED, 3 * NEARBY);
        if (n % 4 != 3)
            add_hidden(&b, 1, 150 + SPEED * s, SPEED, NEARBY + n % 2);
        step(&b);
        assert_int_equal(b.tracks, 2);
    }
    assert_int_equal(b.seen, 2);
}

/* The search behind leaves has not found the depth of a newcomer yet. */
static void what_turns_out_to_be_one_is(void **state)
{
    struct bench b;

    (void)state;
    start(&b);
    for (int n = 0; n < 15; n++) {
        const double x = 50 + SPEED * passed_s(&b);

        add_open(&b, 1, x, 400, SPEED, NEARBY);
        add_hidden(&b, 1, x, SPEED, n < 3 ? NEARBY / 2 : NEARBY + 1);
        step(&b);
        assert_int_equal(b.tracks, n < 7 ? 2 : 1);
    }
    assert_int_equal(b.track[0].id, 1);
}

/* An object may be fully hidden for six seconds; beyond the edge it has gone. */
static void what_vanishes_is_covered(void **state)
{
    struct bench b;

    (void)state;
    start(&b);
    for (int n = 0; n < 6; n++) {
        add_open(&b, 1, 300, 300, 0, NEARBY);
        step(&b);
    }
    for (int n = 0; n < 18; n++) {
        step(&b);
        assert_int_equal(b.tracks, 1);
        assert_int_equal(b.track[0].state, SST_LIVE_TRACK_COVERED);
    }
    step(&b);
    assert_int_equal(b.tracks, 0);
    for (int n = 0; n < 6; n++) { /* a part that the scene's tracks only expect is none */
        add_open(&b, 2, 300, 300, 0, NEARBY);
        b.open[0].state = SST_LIVE_TRACK_COVERED;
        step(&b);
        assert_int_equal(b.tracks, 0);
    }
    for (int n = 0; n < 6; n++) {
        add_open(&b, 3, 450 + SPEED * n / 3, 300, SPEED, NEARBY);
        step(&b);
    }
    for (int n = 0; n < 3; n++)
        step(&b);
    assert_int_equal(b.tracks, 0);
}

/* As a clock that is set: for six seconds from then on, not until the old time is reached again. */
static void time_may_go_back(void **state)
{
    struct bench b;

    (void)state;
    start(&b);
    for (int n = 0; n < 6; n++) {
        add_open(&b, 1, 300, 300, 0, NEARBY);
        step(&b);
    }
    b.t_ns -= INT64_C(9000000000);
    for (int n = 0; n < 18; n++) {
        step(&b);
        assert_int_equal(b.tracks, 1);
    }
    for (int n = 0; n < 2; n++)
        step(&b);
    assert_int_equal(b.tracks, 0);
}

/* More at once than there is room for. */
static void there_is_room_for_those_who_are_there(void **state)
{
    struct sst_live_track open[SST_LIVE_TRACKS], track[SST_LIVE_TRACKS];
    struct live_identities who = { .count = 0 };
    int64_t t_ns = 1;

    (void)state;
    for (uint32_t round = 0; round < 4; round++, t_ns += SET_NS) {
        for (uint32_t i = 0; i < SST_LIVE_TRACKS; i++)
            open[i] = (struct sst_live_track){ .id = 1 + i + SST_LIVE_TRACKS * round,
                                               .x0 = 20 * i,
                                               .x1 = 20 * i + 8,
                                               .y0 = 100 * round,
                                               .y1 = 100 * round + 20,
                                               .disp_px = NEARBY };
        live_identities_update(&who, &(struct live_seen){ open, SST_LIVE_TRACKS, NULL, 0, WIDTH, HEIGHT, t_ns });
        assert_int_equal(live_identities_tracks(&who, track), SST_LIVE_TRACKS);
        for (int i = 0; i < SST_LIVE_TRACKS; i++)
            assert_int_equal(track[i].y0, 100 * round);
    }
}

/* Somebody who differs much is also seen beside the right place, on a plane far behind, and there first. */
static void the_best_image_is_reported(void **state)
{
    struct hidden_planes planes = { .count = 20, .step_px = 1 };
    struct hidden_tracks tracks;
    int reported = 0;

    (void)state;
    for (int i = 0; i < planes.count; i++)
        planes.disp_px[i] = 3 + i;
    hidden_tracks_init(&tracks, 1);
    for (int n = 0; n < 12; n++) {
        const int x = 4 * n;
        const struct hidden_candidate c[] = { { .at = { x - 6, 46, x - 3, 53 }, .plane = 2, .z = 8 },
                                              { .at = { x, 34, x + 8, 54 }, .plane = 7, .z = 40 } };

        hidden_tracks_follow(&tracks, c, n < 2 ? 1 : 2, &planes, 1 + n * SET_NS);
        for (int i = 0; i < tracks.count; i++) {
            if (!tracks.track[i].thing.reported)
                continue;
            reported++;
            assert_int_equal(tracks.track[i].thing.disp_px, 10);
            assert_true(fabs(tracks.track[i].x - x - 4) < 4);
        }
    }
    assert_in_range(reported, 7, 12); /* one in each set, from the first second on */
}

/* An object that has been there for ten minutes is part of the scene, and no better image of a person, however much it
 * differs. */
static void who_is_reported_does_not_end_as_another(void **state)
{
    struct hidden_planes planes = { .count = 20, .step_px = 1 };
    const struct hidden_candidate old = { .at = { 0, 34, 8, 54 }, .plane = 12, .z = 2 };
    struct hidden_tracks tracks;
    int64_t t_ns = 1;

    (void)state;
    for (int i = 0; i < planes.count; i++)
        planes.disp_px[i] = 3 + i;
    hidden_tracks_init(&tracks, 1000);
    for (; t_ns < INT64_C(599000000000); t_ns += 1000000000)
        hidden_tracks_follow(&tracks, &old, 1, &planes, t_ns);
    for (int n = 0; n < 5; n++, t_ns += INT64_C(255000000)) {
        const struct hidden_candidate c[] = { { .at = { 10, 34, 18, 54 }, .plane = 2, .z = 9 },
                                              { .at = old.at, .plane = old.plane, .z = n < 4 ? 2 : 40 } };

        hidden_tracks_follow(&tracks, c, 2, &planes, t_ns);
        assert_int_equal(tracks.count, n < 4 ? 2 : 1); /* the old one ends when the new one is reported */
    }
    assert_int_equal(tracks.track[0].thing.disp_px, 5);
    assert_true(tracks.track[0].thing.reported);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_passage_is_one_identity),
        cmocka_unit_test(two_who_cross_stay_two),
        cmocka_unit_test(who_overtakes_stays_another),
        cmocka_unit_test(what_turns_out_to_be_one_is),
        cmocka_unit_test(what_vanishes_is_covered),
        cmocka_unit_test(there_is_room_for_those_who_are_there),
        cmocka_unit_test(time_may_go_back),
        cmocka_unit_test(the_best_image_is_reported),
        cmocka_unit_test(who_is_reported_does_not_end_as_another),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
