/* pipeline/live/watch.c: somebody who passes behind a hedge is one hidden track of the live light field, which has only
 * its own maps. The detection itself, in wind, is tested in live_hidden.c. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <linux/videodev2.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/live/live.h"
#include "simulators/scene/hedge.h"
#include "tests/small.h"
#include "tests/test.h"

#define SIDE   4
#define VIEWS  (SIDE * SIDE)
#define WIDTH  160
#define HEIGHT 120
#define EMPTY  32 /* sets, one a second */

struct watch {
    struct sst_hedge *hedge;
    struct sst_image image[VIEWS];
    uint8_t *grey[VIEWS];
    struct sst_live *live;
    struct sst_live_input in;
    struct sst_live_track track[SST_LIVE_TRACKS];
    int tracks, t_s;
    bool late_follow; /* the next update does it */
};

static void open_watch(struct watch *w, double alarms_per_hour)
{
    struct sst_live_config cfg = { .rows = SIDE,
                                   .cols = SIDE,
                                   .width = WIDTH,
                                   .height = HEIGHT,
                                   .threads = 1,
                                   .fourcc = V4L2_PIX_FMT_GREY,
                                   .skip_change = true,
                                   .alarms_per_hour = alarms_per_hour };
    struct sst_hedge_config c;

    memset(w, 0, sizeof(*w));
    sst_hedge_config_defaults(&c);
    c.rows = c.cols = SIDE;
    c.width = WIDTH;
    c.height = HEIGHT;
    c.near_px = 8;
    c.spread_px = 2;
    c.wall_px = 1;
    c.wind = 0;
    c.seed = 3;
    assert_int_equal(sst_hedge_create(&w->hedge, &c), 0);
    for (int k = 0; k < VIEWS; k++) {
        cfg.present[k] = true;
        w->grey[k] = malloc(WIDTH * HEIGHT);
        assert_non_null(w->grey[k]);
        assert_int_equal(sst_image_init(&w->image[k], WIDTH, HEIGHT), 0);
    }
    assert_int_equal(sst_live_open(&w->live, &cfg), 0);
}

static void close_watch(struct watch *w)
{
    sst_live_close(w->live);
    for (int k = 0; k < VIEWS; k++) {
        free(w->grey[k]);
        sst_image_fini(&w->image[k]);
    }
    sst_hedge_destroy(w->hedge);
}

static void step(struct watch *w, const struct sst_hedge_person *person)
{
    struct sst_live_report report;

    sst_hedge_draw(w->hedge, w->t_s, person, w->image, NULL);
    w->in.set = (uint64_t)w->t_s;
    w->in.t_ns = (INT64_C(1) + w->t_s++) * 1000000000;
    for (int k = 0; k < VIEWS; k++) {
        for (int y = 0; y < HEIGHT; y++)
            memcpy(w->grey[k] + (size_t)y * WIDTH, sst_image_row(&w->image[k], 1, y), WIDTH);
        w->in.frame[k].data = w->grey[k];
        w->in.frame[k].bytes = (size_t)WIDTH * HEIGHT;
        w->in.frame[k].stride = WIDTH;
    }
    assert_int_equal(sst_live_update(w->live, &w->in, &report), 0);
    if (w->in.picture_first && !w->late_follow) { /* tracks are as of the set before */
        struct sst_live_track track[SST_LIVE_TRACKS];

        assert_int_equal(sst_live_tracks(w->live, track), w->tracks);
        assert_memory_equal(track, w->track, (size_t)w->tracks * sizeof(*track));
    }
    if (!w->late_follow)
        assert_int_equal(sst_live_follow(w->live, &report), 0);
    w->tracks = sst_live_tracks(w->live, w->track);
}

/* Somebody walks from left to right. @return sets with a track */
static int pass(struct watch *w)
{
    int seen = 0;

    for (int n = 0; n < 20; n++) {
        const struct sst_hedge_person p = {
            .x = 26 + 6 * n, .foot = 112, .height = 60, .disp_px = 3.5, .stride = n, .clothes = 12345
        };
        const struct sst_live_track *t = w->track;

        step(w, &p);
        if (!w->tracks)
            continue;
        assert_int_equal(w->tracks, 1);
        assert_true(t->hidden && t->id == 1);
        if (t->state == SST_LIVE_TRACK_COVERED)
            continue;
        seen++;
        assert_true(t->x0 < p.x && t->x1 > p.x - 40);
        assert_true(fabs(t->disp_px - p.disp_px) < 1.5);
    }
    return seen;
}

static void a_passer_by_is_one_hidden_track(void **state)
{
    struct watch w;

    (void)state;
    open_watch(&w, 1);
    for (int n = 0; n < EMPTY; n++) {
        step(&w, NULL);
        assert_int_equal(w.tracks, 0);
    }
    assert_in_range(pass(&w), 12, 20);
    for (int n = 0; n < 25; n++)
        step(&w, NULL);
    assert_int_equal(w.tracks, 0); /* it has gone */
    close_watch(&w);
}

/* The search follows the picture: its tracks are the same; without sst_live_follow() they follow with the next set. */
static void behind_the_picture_it_finds_the_same(void **state)
{
    struct watch w, first, late;

    (void)state;
    open_watch(&w, 1);
    open_watch(&first, 1);
    open_watch(&late, 1);
    first.in.picture_first = late.in.picture_first = late.late_follow = true;
    for (int n = 0; n < EMPTY + 16; n++) {
        const struct sst_hedge_person p = {
            .x = 26 + 6 * (n - EMPTY), .foot = 112, .height = 60, .disp_px = 3.5, .stride = n, .clothes = 12345
        };
        const int before = w.tracks;
        struct sst_live_track track[SST_LIVE_TRACKS];

        memcpy(track, w.track, sizeof(track));
        step(&w, n < EMPTY ? NULL : &p);
        step(&first, n < EMPTY ? NULL : &p);
        step(&late, n < EMPTY ? NULL : &p);
        assert_int_equal(first.tracks, w.tracks);
        assert_memory_equal(first.track, w.track, (size_t)w.tracks * sizeof(*track));
        assert_int_equal(late.tracks, before);
        assert_memory_equal(late.track, track, (size_t)before * sizeof(*track));
    }
    assert_int_equal(w.tracks, 1);
    close_watch(&w);
    close_watch(&first);
    close_watch(&late);
}

static void without_the_search_there_is_none(void **state)
{
    struct watch w;

    (void)state;
    open_watch(&w, 0);
    for (int n = 0; n < 3; n++)
        step(&w, NULL);
    assert_int_equal(pass(&w), 0);
    close_watch(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(a_passer_by_is_one_hidden_track),
                                        cmocka_unit_test(behind_the_picture_it_finds_the_same),
                                        serial_test(without_the_search_there_is_none) };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
