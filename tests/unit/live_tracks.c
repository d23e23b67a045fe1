/* Tracks: identities of moving objects, on pieces of a foreground made here. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <string.h>

#include "pipeline/live/scene/scene_internal.h"
#include "tests/random.h"
#include "tests/test.h"

#define WIDTH   320
#define HEIGHT  240
#define WALL    (6 * 64)
#define NEAR    (20 * 64) /* disparities, 1/64 px */
#define NEARER  (30 * 64)
#define RATE_HZ 10

static const float blue[2][3] = { { 40, 50, 160 }, { 30, 30, 30 } }, red[2][3] = { { 180, 40, 40 }, { 70, 70, 90 } };

struct bench {
    struct scene_tracks tracks;
    struct sst_map_u16 disp;
    struct scene_piece piece[SCENE_PIECES];
    int pieces;
    int64_t t_ns;
    uint64_t seed;
};

static void fill(struct bench *b, int x0, int y0, int x1, int y1, int disp)
{
    for (int y = sst_max_int(y0, 0); y < sst_min_int(y1, HEIGHT); y++)
        for (int x = sst_max_int(x0, 0); x < sst_min_int(x1, WIDTH); x++)
            sst_map_u16_row(&b->disp, y)[x] = (uint16_t)disp;
}

static void open_bench(struct bench *b, uint64_t seed)
{
    memset(b, 0, sizeof(*b));
    b->seed = seed;
    b->t_ns = 1000000000;
    assert_int_equal(sst_map_u16_init(&b->disp, WIDTH, HEIGHT), 0);
    scene_tracks_init(&b->tracks, &sst_classes_default);
    fill(b, 0, 0, WIDTH, HEIGHT, WALL);
}

static void close_bench(struct bench *b)
{
    sst_map_u16_fini(&b->disp);
}

static int jitter(struct bench *b, double cells)
{
    return (int)lround((2 * sst_random(&b->seed) - 1) * cells);
}

static void add_piece(struct bench *b, int x0, int y0, int x1, int y1, int label, const float colour[2][3])
{
    struct scene_piece *p = &b->piece[b->pieces++];
    const struct sst_rect at = { sst_max_int(x0, 0), sst_max_int(y0, 0), sst_min_int(x1, WIDTH),
                                 sst_min_int(y1, HEIGHT) };

    if (at.x1 - at.x0 < 4 || at.y1 - at.y0 < 4) {
        b->pieces--;
        return;
    }
    *p = (struct scene_piece){ .at = at,
                               .disp_q6 = NEAR + jitter(b, 32),
                               .cells = (int64_t)(at.x1 - at.x0) * (at.y1 - at.y0) * 7 / 10,
                               .label = (uint8_t)label };
    memcpy(p->colour, colour, sizeof(p->colour));
    fill(b, at.x0, at.y0, at.x1, at.y1, NEAR);
}

/* A person with its middle at x. */
static void add_person(struct bench *b, double x, const float colour[2][3])
{
    const int at = (int)lround(x);

    add_piece(b, at - 14 + jitter(b, 3), 80 + jitter(b, 3), at + 14 + jitter(b, 3), 200 + jitter(b, 3),
              SST_LABEL_PEDESTRIAN, colour);
}

/* The set is complete: follow it, and start the next one. */
static void step(struct bench *b)
{
    scene_tracks_update(&b->tracks, b->piece, b->pieces, &b->disp, b->t_ns);
    b->t_ns += 1000000000 / RATE_HZ;
    b->pieces = 0;
    fill(b, 0, 0, WIDTH, HEIGHT, WALL);
}

static const struct scene_track *reported(const struct bench *b, int which)
{
    for (int i = 0; i < b->tracks.count; i++)
        if (b->tracks.track[i].reported && !which--)
            return &b->tracks.track[i];
    return NULL;
}

static uint32_t ids(const struct bench *b)
{
    return b->tracks.next_id - 1;
}

static void a_pass_is_one_track(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 20; seed++) {
        struct bench b;

        open_bench(&b, seed);
        for (int n = 0; n < 50; n++) {
            add_person(&b, -20 + 8.0 * n, blue);
            step(&b);
            if (n > 15 && n < 38) {
                assert_non_null(reported(&b, 0));
                assert_null(reported(&b, 1));
                assert_true(fabs(reported(&b, 0)->x - (-20 + 8.0 * n)) < 8);
                assert_int_equal(scene_track_label(&b.tracks, reported(&b, 0)), SST_LABEL_PEDESTRIAN);
            }
        }
        for (int n = 0; n < 15; n++)
            step(&b);
        assert_int_equal(b.tracks.count, 0);
        assert_int_equal(ids(&b), 1);
        for (int n = 0; n < 25; n++) { /* the next one is another */
            add_person(&b, 340 - 8.0 * n, blue);
            step(&b);
        }
        assert_int_equal(ids(&b), 2);
        close_bench(&b);
    }
}

/* The place of an object that is not seen in a set is predicted, and flagged; a seen one is at its piece. */
static void predictions_are_not_seen(void **state)
{
    struct sst_live_track t[SST_LIVE_TRACKS];
    struct bench b;
    int n, seen_x1;

    (void)state;
    open_bench(&b, 3);
    for (n = 0; n < 20; n++) {
        add_person(&b, 60 + (n < 12 ? 2.0 * n : 24 + 14.0 * (n - 12)), blue); /* it begins to run */
        seen_x1 = b.piece[0].at.x1;
        step(&b);
        if (n < 10)
            continue;
        assert_int_equal(scene_tracks_list(&b.tracks, 0, t), 1);
        assert_int_equal(t[0].state, SST_LIVE_TRACK_SEEN);
        assert_int_equal(lround(t[0].at[2]), 2 * seen_x1);
    }
    for (n = 0; n < 5; n++) {
        step(&b);
        assert_int_equal(scene_tracks_list(&b.tracks, 0, t), 1);
        assert_int_equal(t[0].state, SST_LIVE_TRACK_COVERED);
        assert_int_equal(lround(t[0].at[2]), 2 * seen_x1);
        assert_true(t[0].x1 > 2 * seen_x1); /* predicted */
    }
    close_bench(&b);

    open_bench(&b, 1); /* where it would be is no motion */
    for (n = 0; n < 5; n++) {
        add_piece(&b, 60 + 3 * n, 80, 90 + 3 * n, 200, SST_LABEL_PEDESTRIAN, blue);
        step(&b);
    }
    for (n = 0; n < 15; n++)
        step(&b);
    assert_int_equal(ids(&b), 0);
    close_bench(&b);
}

/* Once or twice a second, too. */
static void slow_sets_do(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 20; seed++) {
        struct bench b;

        open_bench(&b, seed);
        for (int n = 0; n < 12; n++) {
            add_person(&b, -10 + 35.0 * n, blue);
            b.t_ns += 400000000;
            step(&b);
        }
        assert_int_equal(ids(&b), 1);
        close_bench(&b);
    }
}

/* Behind a pillar for one and a half seconds. */
static void what_is_covered_comes_out_as_itself(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 20; seed++) {
        struct bench b;
        bool covered = false;

        open_bench(&b, seed);
        for (int n = 0; n < 60; n++) {
            const double x = 20 + 5.0 * n;

            if (x < 130 || x > 200)
                add_person(&b, x, blue);
            fill(&b, 120, 0, 210, HEIGHT, NEARER);
            step(&b);
            covered |= reported(&b, 0) && reported(&b, 0)->state == SST_LIVE_TRACK_COVERED;
        }
        assert_true(covered);
        assert_int_equal(ids(&b), 1);
        close_bench(&b);
    }
}

/* As a clock that is set: who is lost ends as soon as otherwise, who goes on is reported as soon. */
static void time_may_go_back(void **state)
{
    struct bench b;

    (void)state;
    open_bench(&b, 1);
    b.t_ns += INT64_C(200000000000);
    for (int n = 0; n < 25; n++) {
        add_person(&b, 20 + 5.0 * n, blue);
        step(&b);
    }
    assert_non_null(reported(&b, 0));
    b.t_ns -= INT64_C(100000000000);
    for (int n = 0; n < 12; n++)
        step(&b);
    assert_int_equal(b.tracks.count, 0);
    for (int n = 0; n < 25; n++) {
        add_person(&b, 20 + 5.0 * n, blue);
        step(&b);
        b.t_ns -= n == 2 ? INT64_C(100000000000) : 0;
    }
    assert_non_null(reported(&b, 0));
    close_bench(&b);
}

/* Two that pass each other at one distance are one piece for a while. */
static void who_meets_parts_as_before(void **state)
{
    int swapped = 0;

    (void)state;
    for (uint64_t seed = 1; seed <= 20; seed++) {
        struct bench b;
        uint32_t left = 0;

        open_bench(&b, seed);
        for (int n = 0; n < 50; n++) {
            const double x = 20 + 5.5 * n, y = 300 - 5.5 * n;

            if (fabs(x - y) < 30) {
                const int from = (int)lround(fmin(x, y)) - 14, to = (int)lround(fmax(x, y)) + 14;

                add_piece(&b, from, 80, to, 200, SST_LABEL_PEDESTRIAN, x < y ? blue : red);
            } else {
                add_person(&b, x, blue);
                add_person(&b, y, red);
            }
            step(&b);
            for (int i = 0; n == 10 && i < b.tracks.count; i++)
                left = b.tracks.track[i].x < 160 ? b.tracks.track[i].id : left;
        }
        assert_true(left);
        assert_int_equal(ids(&b), 2);
        for (int i = 0; i < b.tracks.count; i++)
            swapped += b.tracks.track[i].id == left && b.tracks.track[i].x < 160;
        close_bench(&b);
    }
    print_message("swapped in %d of 20\n", swapped);
    assert_true(swapped == 0);
}

/* A standing object becomes background, and has no piece until it goes on. */
static void what_stands_stays(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 20; seed++) {
        struct bench b;

        open_bench(&b, seed);
        for (int n = 0; n < 20; n++) {
            add_person(&b, 20 + 6.0 * n, blue);
            step(&b);
        }
        for (int n = 0; n < 300; n++) {
            fill(&b, 134 - 10, 84, 134 + 10, 196, NEAR);
            step(&b);
        }
        assert_non_null(reported(&b, 0));
        assert_int_equal(reported(&b, 0)->state, SST_LIVE_TRACK_STILL);
        for (int n = 0; n < 20; n++) {
            add_person(&b, 140 + 6.0 * n, blue);
            step(&b);
        }
        assert_int_equal(reported(&b, 0)->state, SST_LIVE_TRACK_SEEN);
        assert_int_equal(ids(&b), 1);
        close_bench(&b);
    }
}

/* Posts cut a person into pieces. */
static void pieces_of_one_are_one(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 20; seed++) {
        struct bench b;

        open_bench(&b, seed);
        for (int n = 0; n < 50; n++) {
            const int at = (int)(20 + 5.0 * n);

            for (int from = at - 20; from < at + 20; from++) {
                int to = from;

                while (to < at + 20 && to % 24 >= 6) /* posts of 6 cells, 18 apart */
                    to++;
                if (to > from)
                    add_piece(&b, from, 80, to, 200, SST_LABEL_PEDESTRIAN, blue);
                from = to;
            }
            for (int post = 0; post < WIDTH; post += 24)
                fill(&b, post, 0, post + 6, HEIGHT, NEARER);
            step(&b);
        }
        assert_int_equal(ids(&b), 1);
        close_bench(&b);
    }
}

/* Two gaps in a hedge show head and legs of a person. @param leaf  disparity of the leaves that hide the rest */
static void add_head_and_legs(struct bench *b, int at, int leaf)
{
    fill(b, at - 14, 105, at + 14, 147, leaf);
    add_piece(b, at - 8, 80, at + 8, 106, SST_LABEL_PEDESTRIAN, blue);
    add_piece(b, at - 12, 146, at + 12, 176, SST_LABEL_PEDESTRIAN, blue);
    for (int i = b->pieces - 2; i < b->pieces; i++)
        b->piece[i].disp_q6 = NEAR;
}

static void pieces_behind_leaves_are_one(void **state)
{
    struct bench b;

    (void)state;
    open_bench(&b, 1);
    for (int n = 0; n < 50; n++) {
        add_head_and_legs(&b, 30 + 5 * n, NEARER);
        step(&b);
    }
    assert_int_equal(ids(&b), 1);
    assert_true(reported(&b, 0)->h > 85);
    close_bench(&b);
}

/* Surfaces as near as leaves are to each other hide nothing, nor do gaps that show the wall. */
static void pieces_among_leaves_are_not(void **state)
{
    for (int leaf = NEAR; leaf <= NEAR + 192; leaf += 96) {
        struct bench b;

        (void)state;
        open_bench(&b, 1);
        for (int n = 0; n < 30; n++) {
            add_head_and_legs(&b, 30 + 5 * n, leaf);
            step(&b);
        }
        assert_int_equal(ids(&b), 2);
        close_bench(&b);
    }
}

/* Two walk one behind the other behind a hedge that shows the wall between them. */
static void two_behind_leaves_are_two(void **state)
{
    struct bench b;

    (void)state;
    open_bench(&b, 1);
    for (int n = 0; n < 40; n++) {
        for (int x = 0; x < WIDTH; x += 10)
            fill(&b, x, 60, x + 5, 220, NEARER);
        add_head_and_legs(&b, 30 + 5 * n, NEARER);
        add_head_and_legs(&b, 75 + 5 * n, NEARER);
        step(&b);
    }
    assert_int_equal(ids(&b), 2);
    close_bench(&b);
}

/* A twig of a few cells that the network has called an animal now and then does not become one by moving; a bird is one
 * in most sets. */
static void small_things_need_their_label(void **state)
{
    const int hen = sst_classes_find(&sst_classes_default, "Hen");

    (void)state;
    for (int every = 1; every <= 3; every += 2) {
        struct bench b;

        open_bench(&b, 1);
        for (int n = 0; n < 12; n++) {
            add_piece(&b, 20 + 4 * n, 100, 31 + 4 * n, 109, n % every == 0 ? hen : 0, red);
            step(&b);
        }
        assert_int_equal(ids(&b), every == 1);
        close_bench(&b);
    }
}

/* Twigs go to and fro; so do holes between them, which come and go anywhere. A minute of both. */
static void leaves_get_nowhere(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 20; seed++) {
        struct bench b;

        open_bench(&b, seed);
        for (int n = 0; n < 600; n++) {
            for (int twig = 0; twig < 6; twig++) {
                const int x = 30 + 50 * twig + (int)lround(12 * sin(0.4 * n + twig)), y = 60 + 20 * (twig % 3);

                add_piece(&b, x - 15 + jitter(&b, 4), y - 10 + jitter(&b, 4), x + 15 + jitter(&b, 4),
                          y + 10 + jitter(&b, 4), twig % 2 ? SST_LABEL_TREE : 0, blue);
            }
            for (int i = 0; i < 3; i++) {
                const int x = 20 + (int)(280 * sst_random(&b.seed)), y = 130 + (int)(80 * sst_random(&b.seed));

                add_piece(&b, x - 10, y - 8, x + 10, y + 8, 0, blue);
            }
            step(&b);
        }
        assert_int_equal(ids(&b), 0);
        close_bench(&b);
    }
}

/* So do bunches of leaves that the network takes for an animal: seen twice in three seconds, each time a bit elsewhere,
 * now at one depth of the foliage, now at another. Five minutes. An animal that walks off from among them is reported.
 */
static void leaves_called_animals_get_nowhere(void **state)
{
    const int hen = sst_classes_find(&sst_classes_default, "Hen");

    (void)state;
    for (uint64_t seed = 1; seed <= 20; seed++) {
        struct bench b;

        open_bench(&b, seed);
        for (int n = 0; n < 200; n++) {
            for (int bunch = 0; bunch < 6; bunch++) {
                const int x = 30 + 50 * bunch + jitter(&b, 7), y = 60 + 20 * (bunch % 3) + jitter(&b, 7);

                add_piece(&b, x - 6, y - 6, x + 6 + jitter(&b, 2), y + 6 + jitter(&b, 2), hen, blue);
                b.piece[b.pieces - 1].disp_q6 += jitter(&b, 128);
            }
            b.t_ns += 1400000000;
            step(&b);
        }
        assert_int_equal(ids(&b), 0);
        for (int n = 0; n < 12; n++) {
            add_piece(&b, 20 + 8 * n, 180 + jitter(&b, 2), 44 + 8 * n, 200 + jitter(&b, 2), hen, red);
            b.t_ns += 400000000;
            step(&b);
        }
        assert_int_equal(ids(&b), 1);
        close_bench(&b);
    }
}

/* More pieces and tracks than there is room for, none at all, and times that stand or go back. */
static void anything_goes(void **state)
{
    struct bench b;

    (void)state;
    open_bench(&b, 7);
    for (int n = 0; n < 500; n++) {
        const int count = (int)(sst_random(&b.seed) * (SCENE_PIECES + 1));

        for (int i = 0; i < count; i++) {
            const int x = jitter(&b, 400), y = jitter(&b, 300);

            add_piece(&b, x, y, x + 4 + (int)(100 * sst_random(&b.seed)), y + 4 + (int)(100 * sst_random(&b.seed)),
                      (int)(sst_random(&b.seed) * 24), sst_random(&b.seed) < 0.5 ? blue : red);
        }
        if (n % 50 == 0)
            b.t_ns -= 2000000000;
        step(&b);
        assert_in_range(b.tracks.count, 0, SCENE_TRACKS);
        for (int i = 0; i < b.tracks.count; i++) {
            const struct scene_track *a = &b.tracks.track[i];

            assert_true(isfinite(a->x) && isfinite(a->y) && isfinite(a->vx) && isfinite(a->vy) && a->w > 0 && a->h > 0);
        }
    }
    close_bench(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_pass_is_one_track),
        cmocka_unit_test(predictions_are_not_seen),
        cmocka_unit_test(slow_sets_do),
        cmocka_unit_test(what_is_covered_comes_out_as_itself),
        cmocka_unit_test(who_meets_parts_as_before),
        cmocka_unit_test(time_may_go_back),
        cmocka_unit_test(what_stands_stays),
        cmocka_unit_test(pieces_of_one_are_one),
        cmocka_unit_test(pieces_behind_leaves_are_one),
        cmocka_unit_test(pieces_among_leaves_are_not),
        cmocka_unit_test(two_behind_leaves_are_two),
        cmocka_unit_test(small_things_need_their_label),
        cmocka_unit_test(leaves_get_nowhere),
        cmocka_unit_test(leaves_called_animals_get_nowhere),
        cmocka_unit_test(anything_goes),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
