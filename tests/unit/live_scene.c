/* pipeline/live/scene: maps that follow a small light field in which a square moves before a wall, and their pieces. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/clock.h"
#include "base/log.h"
#include "pipeline/live/scene/scene_internal.h"
#include "tests/moving_square.h"
#include "tests/quick.h"
#include "tests/small.h"
#include "tests/test.h"

/* --- the pieces --------------------------------------------------------------------------------------------------- */

static void keys_are_spread_and_survive_holes(void **state SST_UNUSED)
{
    struct sst_lightfield lf;
    int views[SST_SCENE_KEYS];

    assert_int_equal(sst_lightfield_init(&lf, 6, 6), 0);
    assert_int_equal(scene_choose_keys(&lf, views), 0);
    for (int view = 0; view < 36; view++)
        lf.views[view].present = true;
    assert_int_equal(scene_choose_keys(&lf, views), 5);
    assert_int_equal(views[0], 14);
    assert_int_equal(views[1], 7);
    assert_int_equal(views[4], 28);
    lf.views[7].present = false;
    assert_int_equal(scene_choose_keys(&lf, views), 5);
    assert_int_not_equal(views[1], 7);
    assert_true(lf.views[views[1]].present);
    for (int view = 1; view < 36; view++)
        lf.views[view].present = view == 35;
    assert_int_equal(scene_choose_keys(&lf, views), 0); /* two corners are no neighbours */
    sst_lightfield_fini(&lf);
}

static void changed_tiles_are_gathered(void **state SST_UNUSED)
{
    struct sst_rect r[SST_SCENE_RECTS];
    uint8_t dirty[20 * 15] = { 0 };
    int n;

    assert_int_equal(scene_gather(r, (struct scene_dirty){ dirty, 20 }, 15, 320, 240), 0);
    dirty[0] = 1;
    dirty[7 * 20 + 10] = dirty[8 * 20 + 10] = 1;
    assert_int_equal(scene_gather(r, (struct scene_dirty){ dirty, 20 }, 15, 320, 240), 2);
    assert_int_equal(r[0].x0, 0);
    assert_int_equal(r[0].x1, 32);
    assert_int_equal(r[1].x0, 144);
    assert_int_equal(r[1].y0, 96);
    assert_int_equal(r[1].x1, 192);
    assert_int_equal(r[1].y1, 160);
    for (int i = 0; i < 300; i += 4) /* far more than there is room for */
        dirty[i] = 1;
    n = scene_gather(r, (struct scene_dirty){ dirty, 20 }, 15, 320, 240);
    assert_in_range(n, 1, SST_SCENE_RECTS);
    for (int i = 0; i < 300; i++) {
        int holds = 0;

        for (int k = 0; k < n; k++)
            holds += i % 20 * 16 >= r[k].x0 && i % 20 * 16 < r[k].x1 && i / 20 * 16 >= r[k].y0 && i / 20 * 16 < r[k].y1;
        assert_true(holds <= 1 && (holds || !dirty[i]));
    }
}

/* A surface of 8 px before one of 4 px, seen from one spacing to the right: cells move left by 4 and by 2. */
static void cells_are_carried_over(void **state SST_UNUSED)
{
    struct scene_composer composer;
    struct scene_span tiles[4];
    uint32_t packed[32 * 32];
    struct scene_key key = { .view = 0, .tile = tiles, .packed = packed };
    struct sst_lightfield lf;
    uint8_t dirty[4] = { 1, 1, 0, 0 };

    assert_int_equal(sst_lightfield_init(&lf, 1, 2), 0);
    lf.width = 64;
    lf.height = 64;
    lf.range_max_px = 16;
    for (int view = 0; view < 2; view++) {
        struct sst_view *v = &lf.views[view];

        v->present = true;
        assert_int_equal(sst_image_init(&v->image, 64, 64), 0);
        assert_int_equal(sst_map_u16_init(&v->disp, 64, 64), 0);
        assert_int_equal(sst_map_u8_init(&v->label, 64, 64), 0);
        memset(v->disp.data, 0xEE, v->disp.stride * 64);
        memset(v->label.data, 0xEE, v->label.stride * 64);
    }
    assert_int_equal(sst_map_u16_init(&key.maps.disp, 32, 32), 0);
    assert_int_equal(sst_map_u8_init(&key.maps.label, 32, 32), 0);
    assert_int_equal(sst_map_u8_init(&key.maps.confirmed, 32, 32), 0);
    for (int y = 0; y < 32; y++) {
        for (int x = 0; x < 32; x++) {
            const bool near = x >= 12 && x < 20;

            sst_map_u16_row(&key.maps.disp, y)[x] = (uint16_t)(64 * (near ? 8 : 4));
            sst_map_u8_row(&key.maps.label, y)[x] = near ? 2 : 1;
            sst_map_u8_row(&key.maps.confirmed, y)[x] = 1;
        }
    }
    assert_int_equal(scene_composer_init(&composer, 32, 32), 0);
    scene_measure_tiles(&key);
    scene_compose(&composer, &lf, 1, &(struct scene_keys){ &key, 1, true }, dirty);
    for (int y = 0; y < 64; y++) {
        for (int x = 0; x < 64; x++) {
            const int d = sst_map_u16_row(&lf.views[1].disp, y)[x], l = sst_map_u8_row(&lf.views[1].label, y)[x];
            const bool near = x / 2 >= 8 && x / 2 < 16; /* cells 16 and 17 no key sees: they are of the wall */

            assert_int_equal(d, y >= 32 ? 0xEEEE : near ? 512 : 256);
            assert_int_equal(l, y >= 32 ? 0xEE : near ? 2 : 1);
        }
    }
    scene_composer_fini(&composer);
    sst_map_u16_fini(&key.maps.disp);
    sst_map_u8_fini(&key.maps.label);
    sst_map_u8_fini(&key.maps.confirmed);
    sst_lightfield_fini(&lf);
}

/* --- updates ------------------------------------------------------------------------------------------------------ */

static void maps_follow_what_moves(void **state SST_UNUSED)
{
    uint8_t changed[9][TILES];
    struct sst_map_u16 before[9];
    struct field f;

    open_field(&f, 3, 3);
    draw(&f, 40);
    update(&f);
    assert_true(f.report.ready && f.report.whole && f.changes.whole);
    for (int view = 0; view < 9; view++) {
        if (!(bad_share(&f, view, 40) < 8))
            fail_msg("view %d: %.1f %% bad", view, bad_share(&f, view, 40));
        assert_int_equal(sst_map_u16_init(&before[view], WIDTH, HEIGHT), 0);
    }
    assert_true(bad_share(&f, 4, 40) < 5);
    draw(&f, 40);
    assert_int_equal(f.changes.changed, 0);
    update(&f);
    assert_false(f.report.whole);
    for (int view = 0; view < 9; view++)
        memcpy(before[view].data, f.lf.views[view].disp.data, before[view].stride * HEIGHT);
    draw(&f, 72);
    for (int view = 0; view < 9; view++)
        memcpy(changed[view], f.changes.map[view], TILES);
    update(&f);
    assert_false(f.report.whole);
    for (int view = 0; view < 9; view++) {
        assert_memory_equal(changed[view], f.changes.map[view], TILES);
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            const int x = i % WIDTH, y = i / WIDTH;

            if (!changed[view][y / SST_LIVE_TILE * TILES_X + x / SST_LIVE_TILE])
                assert_int_equal(sst_map_u16_row(&f.lf.views[view].disp, y)[x], sst_map_u16_row(&before[view], y)[x]);
        }
        if (!(bad_share(&f, view, 72) < 8))
            fail_msg("view %d: %.1f %% bad after the move", view, bad_share(&f, view, 72));
        sst_map_u16_fini(&before[view]);
    }
    close_field(&f);
}

/* Tiles that changed in the set before, beside one that changes now, had maps of an object that has left it. */
static void what_moved_on_leaves_nothing_behind(void **state SST_UNUSED)
{
    uint8_t before[TILES], now[TILES];
    struct field f;
    int again = 0;

    open_field(&f, 3, 3);
    for (int i = 0; i < 4; i++) {
        draw(&f, 40 + 28 * i);
        memcpy(now, f.changes.map[4], TILES);
        update(&f);
        for (int t = 0; i > 1 && t < TILES; t++) {
            bool beside = false;

            for (int n = 0; n < TILES; n++)
                beside |= now[n] && abs(n % TILES_X - t % TILES_X) <= 1 && abs(n / TILES_X - t / TILES_X) <= 1;
            assert_int_equal(f.changes.map[4][t], now[t] || (before[t] && beside));
            again += !now[t] && f.changes.map[4][t];
        }
        memcpy(before, now, TILES);
        for (int view = 0; view < 9; view++)
            if (!(bad_share(&f, view, 40 + 28 * i) < 8))
                fail_msg("view %d: %.1f %% bad after move %d", view, bad_share(&f, view, 40 + 28 * i), i);
    }
    assert_true(again > 0);
    close_field(&f);
}

static void update_at(struct field *f, int ms, bool all_changed)
{
    for (int view = 0; all_changed && view < 9; view++)
        memset(f->changes.map[view], 1, TILES);
    f->report = (struct sst_live_report){ 0 };
    assert_int_equal(sst_livescene_update(f->scene, &f->changes,
                                          &(const struct sst_live_input){ .t_ns = (int64_t)ms * 1000000 }, &f->report),
                     0);
}

/* Where something moves behind leaves, sets that come seldom have maps of their own, unless there is no time for them. */
static void maps_of_who_moves_behind_leaves_do_not_wait(void **state SST_UNUSED)
{
    struct sst_live_input in = { .t_ns = INT64_C(1000000000) };
    struct field f;

    open_field(&f, 3, 3);
    draw(&f, 40);
    update_at(&f, 1000, false);
    f.scene->confirmed = 0.9;
    for (int i = 0; i < 4; i++) {
        in.t_ns += i < 3 ? 200000000 : 100000000;
        in.moving = i > 0;
        in.crowded = i == 2;
        draw(&f, i % 2 ? 40 : 72);
        for (int view = 0; view < 9; view++)
            memset(f.changes.map[view], 1, TILES);
        f.report = (struct sst_live_report){ 0 };
        assert_int_equal(sst_livescene_update(f.scene, &f.changes, &in, &f.report), 0);
        f.scene->confirmed = 0.9;
        assert_int_equal(f.report.late, i != 1);
    }
    close_field(&f);
}

/* Where few disparities are confirmed and most tiles change, maps are made every 0.55 s, and every 0.35 s
 * while something moves in the open; between, they stay. */
static void maps_of_moving_leaves_wait(void **state SST_UNUSED)
{
    struct sst_map_u16 before;
    struct field f;

    open_field(&f, 3, 3);
    assert_int_equal(sst_map_u16_init(&before, WIDTH, HEIGHT), 0);
    draw(&f, 40);
    update_at(&f, 1000, false);
    assert_true(f.report.ready && !f.report.late);
    memcpy(before.data, f.lf.views[4].disp.data, before.stride * HEIGHT);
    f.scene->confirmed = 0.9;
    draw(&f, 72);
    update_at(&f, 1100, true);
    assert_true(f.report.ready && f.report.late && !f.report.whole);
    assert_memory_equal(before.data, f.lf.views[4].disp.data, before.stride * HEIGHT);
    draw(&f, 72); /* nothing changes: the maps still wait, and nothing is reported */
    update_at(&f, 1200, false);
    assert_true(f.report.late);
    for (int i = 0; i < TILES; i++)
        assert_int_equal(f.changes.map[4][i], 0);
    update_at(&f, 1540, false);
    assert_true(f.report.late);
    f.scene->tracks.track[0] = (struct scene_track){ .id = 1, .reported = true, .state = SST_LIVE_TRACK_SEEN };
    f.scene->tracks.count = 1; /* something moves in the open: the maps do not wait as long */
    update_at(&f, 1540, false);
    assert_false(f.report.late);
    assert_int_equal(f.report.tiles_changed, 9 * TILES);
    for (int i = 0; i < TILES; i++)
        assert_int_equal(f.changes.map[4][i], 1);
    for (int view = 0; view < 9; view++)
        assert_true(bad_share(&f, view, 72) < 8);
    draw(&f, 40); /* the maps are reliable */
    update_at(&f, 1600, true);
    assert_false(f.report.late);
    f.scene->confirmed = 0.9; /* few tiles change */
    draw(&f, 42);
    update_at(&f, 1700, false);
    assert_false(f.report.late);
    f.scene->confirmed = 0.9; /* exact mode */
    f.cfg.skip_change = false;
    update_at(&f, 1800, true);
    assert_false(f.report.late);
    sst_map_u16_fini(&before);
    close_field(&f);
}

static void threads_make_no_difference(void **state SST_UNUSED)
{
    const int sets = small_level() >= 2 ? 4 : 8;
    struct field f[2];
    int runs[2] = { 0, 0 };

    for (int i = 0; i < 2; i++) {
        init_field(&f[i], 3, 4);
        f[i].cfg.threads = i ? 5 : 1;
        f[i].cfg.model = "models/pspnet-small.onnx";
        assert_int_equal(sst_livescene_open(&f[i].scene, &f[i].cfg, &f[i].lf), 0);
        for (int set = 0; set < sets; set++) { /* the network runs in the first set and in some of the others */
            draw(&f[i], 40 + 10 * set);
            update(&f[i]);
            assert_true(set || f[i].report.label_runs == 1);
            assert_int_equal(f[i].report.label_runs_skipped, 12 - f[i].report.label_runs);
            runs[i] += (int)f[i].report.label_runs;
        }
        assert_in_range(runs[i], 2, 5);
    }
    assert_true(f[0].lf.classes.count > 0);
    for (int view = 0; view < 12; view++) {
        const struct sst_view *a = &f[0].lf.views[view], *b = &f[1].lf.views[view];

        assert_memory_equal(a->disp.data, b->disp.data, a->disp.stride * HEIGHT);
        assert_memory_equal(a->label.data, b->label.data, a->label.stride * HEIGHT);
    }
    close_field(&f[0]);
    close_field(&f[1]);
}

static void every_view_is_labelled_without_reuse(void **state SST_UNUSED)
{
    struct field f;

    init_field(&f, 2, 2);
    f.cfg.model = "models/pspnet-small.onnx";
    f.cfg.skip_labels = false;
    assert_int_equal(sst_livescene_open(&f.scene, &f.cfg, &f.lf), 0);
    draw(&f, 40);
    update(&f);
    assert_int_equal(f.report.label_runs, 4);
    assert_int_equal(f.report.label_runs_skipped, 0);
    close_field(&f);
}

static void views_come_and_go(void **state SST_UNUSED)
{
    struct field f;

    open_field(&f, 3, 3);
    draw(&f, 40);
    update(&f);
    f.lf.views[4].present = false; /* the reference, and the only key */
    assert_int_equal(sst_lightfield_choose_ref(&f.lf), 0);
    draw(&f, 60);
    update(&f);
    assert_true(f.report.ready);
    assert_true(bad_share(&f, 0, 60) < 8);
    f.lf.views[4].present = true;
    f.lf.ref_view = 4;
    draw(&f, 60);
    update(&f);
    assert_true(bad_share(&f, 4, 60) < 8); /* all of it anew, though no tile was told to have changed */
    close_field(&f);
}

static void one_camera_is_never_ready(void **state SST_UNUSED)
{
    struct field f;

    open_field(&f, 1, 1);
    for (int i = 0; i < 3; i++) {
        draw(&f, 40 + i);
        update(&f);
        assert_false(f.report.ready);
        assert_null(f.lf.views[0].label.data);
    }
    close_field(&f);
}

static void no_texture_is_waited_out(void **state SST_UNUSED)
{
    const int64_t end_ns = sst_clock_now_ns() + INT64_C(60000000000);
    struct field f;

    init_field(&f, 3, 3);
    f.cfg.range_min_px = f.cfg.range_max_px = 0;
    assert_int_equal(sst_livescene_open(&f.scene, &f.cfg, &f.lf), 0);
    for (int i = 0; i < 2; i++) {
        f.changes.whole = true;
        update(&f);
        assert_false(f.report.ready);
    }
    draw(&f, 40);
    while (!f.report.ready && sst_clock_now_ns() < end_ns) {
        nanosleep(&(struct timespec){ .tv_nsec = 50000000 }, NULL);
        update(&f);
        f.changes.changed = 0;
    }
    assert_true(f.report.ready);
    assert_true(f.lf.range_min_px <= WALL_PX && f.lf.range_max_px >= NEAR_PX);
    assert_true(bad_share(&f, 4, 40) < 8);
    close_field(&f);
}

static void cancel_ends_updates(void **state SST_UNUSED)
{
    struct field f;

    open_field(&f, 3, 3);
    draw(&f, 40);
    sst_livescene_cancel(f.scene);
    assert_int_equal(sst_livescene_update(f.scene, &f.changes, &(const struct sst_live_input){ 0 }, &f.report),
                     -ECANCELED);
    close_field(&f);
}

/* --- the background ----------------------------------------------------------------------------------------------- */

static void open_with_background(struct field *f)
{
    init_field(f, 3, 3);
    f->cfg.background = true;
    f->cfg.model = "models/pspnet-small.onnx";
    assert_int_equal(sst_livescene_open(&f->scene, &f->cfg, &f->lf), 0);
    f->scene->next_start_ns = INT64_MAX; /* an update of seconds, on a busy machine, is long enough to be still */
    draw(f, 40);
    update(f);
    f->scene->next_start_ns = 0;
    draw(f, 40); /* nothing changes from now on */
}

static void a_scene_at_rest_becomes_better_once(void **state SST_UNUSED)
{
    const int64_t end_ns = sst_clock_now_ns() + INT64_C(60000000000);
    double before;
    struct field f;

    open_with_background(&f);
    before = bad_share(&f, 4, 40);
    assert_false(sst_livescene_settle(f.scene, &f.changes));
    while (!sst_livescene_unsettled(f.scene)) {
        if (sst_clock_now_ns() > end_ns) {
            close_field(&f);
            if (quick_is_measured())
                fail_msg("no idle time for the background within a minute");
            print_message("not judged: no idle time for the background within a minute\n");
            return;
        }
        nanosleep(&(struct timespec){ .tv_nsec = small_level() >= 2 ? 200000000 : 20000000 }, NULL);
        update(&f);
    }
    draw(&f, 41); /* tiles that change meanwhile keep their own maps */
    update(&f);
    assert_true(sst_livescene_settle(f.scene, &f.changes));
    assert_in_range(f.changes.changed, 1, 9 * TILES - 1);
    assert_int_equal(f.changes.map[4][0], 1);
    assert_int_equal(f.changes.map[4][2 * TILES_X + 1], 0);
    assert_true(bad_share(&f, 4, 41) <= before + 0.5);
    f.changes.changed = 0;
    for (int view = 0; view < 9; view++)
        memset(f.changes.map[view], 0, TILES);
    update(&f);
    assert_true(f.report.error_labels >= 0 && f.report.error_labels <= 1);
    assert_false(sst_livescene_settle(f.scene, &f.changes));
    close_field(&f);
}

/* Objects left behind are counted until they are gone: until then the process must not exit(). */
static void await_left_behind(int64_t start_ns)
{
    while (sst_livescene_left_behind() && sst_clock_now_ns() - start_ns < INT64_C(60000000000))
        nanosleep(&(struct timespec){ .tv_nsec = 20000000 }, NULL);
    assert_int_equal(sst_livescene_left_behind(), 0);
}

/* All tiles have been still for long. @return has the background started? */
static bool start_still(struct field *f, bool crowded)
{
    for (int view = 0; view < 9; view++)
        for (int i = 0; i < TILES; i++)
            f->scene->changed_ns[view][i] = sst_clock_now_ns() - INT64_C(3000000000);
    f->scene->next_start_ns = 0;
    scene_start_background(f->scene, crowded);
    return !scene_background_idle(f->scene->background);
}

static void the_background_rests(void **state SST_UNUSED)
{
    const int64_t minute_ns = INT64_C(60000000000);
    struct field f;

    open_with_background(&f);
    assert_false(start_still(&f, true));
    assert_false(start_still(&f, false)); /* sets have just been left out */
    f.scene->crowded_ns = 0;
    for (int view = 0; view < 9; view++)
        memset(f.scene->settled[view], view < 7, TILES * sizeof(bool)); /* little becomes better */
    f.scene->took_ns = minute_ns;
    f.scene->rested_ns = sst_clock_now_ns() - 4 * minute_ns;
    assert_false(start_still(&f, false));
    f.scene->rested_ns -= minute_ns;
    assert_true(start_still(&f, true));
    sst_livescene_cancel(f.scene);
    close_field(&f);
    await_left_behind(sst_clock_now_ns());
}

static void closing_does_not_wait_for_the_background(void **state SST_UNUSED)
{
    int64_t start_ns;
    struct field f;

    open_with_background(&f);
    assert_true(start_still(&f, false));
    nanosleep(&(struct timespec){ .tv_nsec = 200000000 }, NULL);
    start_ns = sst_clock_now_ns();
    sst_livescene_cancel(f.scene);
    close_field(&f);
    assert_quick(start_ns, INT64_C(500000000));
    await_left_behind(start_ns);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(keys_are_spread_and_survive_holes),
        cmocka_unit_test(changed_tiles_are_gathered),
        serial_test(cells_are_carried_over),
        serial_test(maps_follow_what_moves),
        serial_test(what_moved_on_leaves_nothing_behind),
        serial_test(maps_of_moving_leaves_wait),
        cmocka_unit_test(maps_of_who_moves_behind_leaves_do_not_wait),
        thread_test(threads_make_no_difference),
        serial_test(every_view_is_labelled_without_reuse),
        cmocka_unit_test(views_come_and_go),
        cmocka_unit_test(one_camera_is_never_ready),
        serial_test(no_texture_is_waited_out),
        cmocka_unit_test(cancel_ends_updates),
        serial_test(a_scene_at_rest_becomes_better_once),
        cmocka_unit_test(the_background_rests),
        cmocka_unit_test(closing_does_not_wait_for_the_background),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
