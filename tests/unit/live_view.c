/* Pictures of a light field that changes: parts against the whole, the default focus, picking, overlays. The light
 * field's maps are those of simulated scenes; what follows cameras is tested in tests/sim/live.c. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/stats.h"
#include "base/thread.h"
#include "pipeline/eval/eval.h"
#include "pipeline/live/live_internal.h"
#include "simulators/scene/noise.h"
#include "simulators/scene/scene.h"
#include "tests/live_shown.h"
#include "tests/live_zone.h"
#include "tests/small.h"
#include "tests/test.h"

#define assert_near(got, want, eps)                                                                                    \
    do {                                                                                                               \
        const double g_ = (got), w_ = (want);                                                                          \
        if (!(fabs(g_ - w_) <= (eps)))                                                                                 \
            fail_msg("%s:%d: %.9g, not %.9g", __FILE__, __LINE__, g_, w_);                                             \
    } while (0)

static struct sst_render_config config(double focus_px)
{
    struct sst_render_config cfg;

    sst_render_config_defaults(&cfg);
    cfg.focus_px = focus_px;
    return cfg;
}

/* A picture rendered again of the light field as it is. */
static void assert_whole(struct shown *s, const struct sst_render_config *cfg, const struct sst_image *got)
{
    const struct sst_image *want;
    struct sst_livepicture *p;
    int64_t rendered_px;

    assert_int_equal(sst_livepicture_create(&p, s->live), 0);
    assert_int_equal(sst_livepicture_render(p, cfg, &want, &rendered_px), 0);
    assert_int_equal(rendered_px, (int64_t)want->width * want->height);
    assert_true(same_image(got, want));
    sst_livepicture_destroy(p);
}

/* Other pixels in one tile of one view; maps too, if asked for. */
static void change_tile(struct shown *s, int view, int tile, bool maps, uint64_t seed)
{
    const int cols = s->changes.cols, x0 = tile % cols * SST_LIVE_TILE, y0 = tile / cols * SST_LIVE_TILE;
    struct sst_lightfield *lf = &s->live->lf;
    struct sst_view *v = &lf->views[view];

    s->changes.map[view][tile] = 1;
    for (int y = y0; y < sst_min_int(y0 + SST_LIVE_TILE, lf->height); y++) {
        for (int x = x0; x < sst_min_int(x0 + SST_LIVE_TILE, lf->width); x++) {
            const uint64_t r = sst_random_u64(&seed);

            for (int c = 0; c < 3; c++)
                sst_image_row(&v->image, c, y)[x] = (uint8_t)(r >> (8 * c));
            if (!maps)
                continue;
            sst_map_u16_row(&v->disp, y)[x] = r % 17 ? (uint16_t)(r >> 8) % 700 : SST_DISP_NONE;
            sst_map_u8_row(&v->label, y)[x] = (uint8_t)(r >> 28);
        }
    }
}

static void parts_have_the_bytes_of_the_whole(void **state SST_UNUSED)
{
    static const double focus[] = { 9, 8.43, -1.7, 23.9 };
    const struct sst_image *image;
    struct shown s;

    show(&s, "bush", 200, 141, 4, false); /* no side is a multiple of tiles, cells or vectors */
    take(&s, 1);
    for (size_t i = 0; i < ARRAY_LEN(focus); i++) {
        struct sst_render_config cfg = config(focus[i]);
        struct sst_livepicture *p;
        int64_t rendered_px;

        cfg.method = i == 2 ? SST_RENDER_REFOCUS : SST_RENDER_SST;
        cfg.c2 = 1; /* label ranges follow all pixels, and a part would differ unnoticeably */
        cfg.aperture = i == 1 ? 1.5 : INFINITY;
        assert_int_equal(sst_livepicture_create(&p, s.live), 0);
        assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
        assert_int_equal(rendered_px, 200 * 141);
        assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
        assert_int_equal(rendered_px, 0);
        for (int round = 0; round < 6; round++) {
            const int tiles = s.changes.cols * s.changes.rows;

            change_tile(&s, (round * 7) % 16, (round * 11) % tiles, true, (uint64_t)round);
            if (round % 2)
                change_tile(&s, (round * 5) % 16, (round * 13 + 3) % tiles, true, (uint64_t)round + 100);
            take(&s, round + 2);
            if (round == 3)
                continue; /* two changes at a time */
            assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
            assert_true(rendered_px < 200 * 141);
            assert_whole(&s, &cfg, image);
        }
        sst_livepicture_destroy(p);
    }
    hide(&s);
}

/* Colours alone change: label ranges stay, so parts equal the whole with them, too. Any number of threads. */
static void labelled_parts_do_too(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(8.43);
    const struct sst_image *image;
    struct sst_livepicture *p;
    struct shown s;
    int64_t rendered_px;

    show(&s, "bush", 200, 141, 3, false);
    take(&s, 1);
    assert_int_equal(sst_livepicture_create(&p, s.live), 0);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
    for (int threads = 1; threads < 4; threads++) {
        change_tile(&s, threads, 2 * threads, false, (uint64_t)threads);
        take(&s, threads + 1);
        assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
        s.live->cfg.threads = threads;
        assert_whole(&s, &cfg, image);
        s.live->cfg.threads = 2;
        assert_true(rendered_px > 0 && rendered_px < 200 * 141 / 2);
    }
    /* Without labels' pixels where the focus is, the object's range is another: that is noticed. */
    for (int k = 0; k < 9; k++) {
        for (int y = 0; y < 141; y++) {
            for (int x = 0; x < 200; x++) {
                if (sst_disp_px(&s.live->lf, sst_map_u16_row(&s.live->lf.views[k].disp, y)[x]) < 9)
                    sst_map_u8_row(&s.live->lf.views[k].label, y)[x] = SST_LABEL_TREE;
            }
        }
        memset(s.changes.map[k], k == 4, (size_t)(s.changes.cols * s.changes.rows));
    }
    take(&s, 9);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
    assert_int_equal(rendered_px, 200 * 141);
    sst_livepicture_destroy(p);
    hide(&s);
}

/* Colours and maps of views that rarity and label ranges are not counted from. */
static void verified_parts_do_too(void **state SST_UNUSED)
{
    static const int views[] = { 1, 2, 4, 6, 9, 14 };
    struct sst_render_config cfg = config(8.43);
    const struct sst_image *image, *plain;
    struct sst_livepicture *p, *without;
    struct shown s;
    int64_t rendered_px;

    show(&s, "bush", 200, 141, 4, false);
    take(&s, 1);
    cfg.c1 = cfg.c2 = 0.001;
    cfg.sigma_px = 0.3; /* few rays are in focus, many in front */
    assert_int_equal(sst_livepicture_create(&without, s.live), 0);
    assert_int_equal(sst_livepicture_render(without, &cfg, &plain, &rendered_px), 0);
    cfg.verify = SST_VERIFY_ON;
    assert_int_equal(sst_livepicture_create(&p, s.live), 0);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
    assert_true(same_image(image, plain)); /* maps are not poor */
    s.live->low_confidence = true;
    for (int round = 0; round < (small_level() >= 2 ? 3 : 12); round++) {
        assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
        assert_true(round || !same_image(image, plain)); /* it does something here */
        assert_true(round ? rendered_px < 200 * 141 : rendered_px == 200 * 141);
        assert_whole(&s, &cfg, image);
        change_tile(&s, views[round % 6], (round * 11) % (s.changes.cols * s.changes.rows), true, (uint64_t)round);
        take(&s, round + 2);
    }
    cfg.verify = SST_VERIFY_OFF;
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0); /* a setting like any other */
    assert_int_equal(rendered_px, 200 * 141);
    sst_livepicture_destroy(without);
    sst_livepicture_destroy(p);
    hide(&s);
}

static void absent_views_are_left_out(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(8.4);
    const struct sst_image *image;
    struct sst_livepicture *p;
    struct shown s;
    int64_t rendered_px;

    show(&s, "bush", 160, 120, 3, false);
    take(&s, 1);
    assert_int_equal(sst_livepicture_create(&p, s.live), 0);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
    s.live->lf.views[s.live->lf.ref_view].present = false;
    s.live->lf.views[8].present = false;
    take(&s, 2);
    assert_true(sst_render_lead_view(&s.live->lf) >= 0 && sst_render_lead_view(&s.live->lf) != s.live->lf.ref_view);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
    assert_int_equal(rendered_px, 160 * 120);
    assert_whole(&s, &cfg, image);
    /* One comes back and has no maps yet: its rays are of unknown depth. */
    sst_map_u16_fini(&s.live->lf.views[8].disp);
    sst_map_u8_fini(&s.live->lf.views[8].label);
    s.live->lf.views[8].present = true;
    take(&s, 3);
    assert_int_equal(s.live->lf.views[8].disp.data[0], SST_DISP_NONE);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
    assert_int_equal(rendered_px, 160 * 120);
    assert_whole(&s, &cfg, image);
    for (int k = 0; k < 9; k++)
        s.live->lf.views[k].present = false;
    take(&s, 4);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), -ENODATA);
    sst_livepicture_destroy(p);
    hide(&s);
}

static void what_cannot_be_rendered_is_said(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(NAN);
    struct sst_image overlay = { 0 };
    const struct sst_image *image;
    struct sst_livepicture_pick pick;
    struct sst_livepicture *p;
    struct shown s;
    int64_t rendered_px;
    double px;

    show(&s, NULL, 160, 120, 2, false);
    assert_int_equal(sst_image_init(&overlay, 160, 120), 0);
    assert_int_equal(sst_livepicture_create(&p, s.live), 0);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), -ENODATA);
    assert_int_equal(sst_livepicture_pick(p, 1, 1, &pick), -ENODATA);
    assert_int_equal(sst_livepicture_overlay(s.live, SST_LIVE_LABELS_PICTURE, &overlay), -ENODATA);
    assert_int_equal(sst_livepicture_label_disparity(s.live, SST_LABEL_TREE, &px), -ENODATA);
    assert_true(isnan(sst_live_default_focus(s.live)));
    assert_false(sst_live_range(s.live, &px, &px));
    /* Pictures without disparities: plain refocusing works. */
    for (int k = 0; k < 4; k++)
        assert_int_equal(sst_image_init(&s.live->lf.views[k].image, 160, 120), 0);
    take(&s, 1);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), -ENODATA);
    cfg.method = SST_RENDER_REFOCUS;
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
    cfg.focus_px = 1e6; /* put where views overlap */
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
    assert_int_equal(rendered_px, 160 * 120);
    set_scene(&s, "bush", 0);
    take(&s, 2);
    cfg = config(1e6);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
    cfg = config(NAN); /* the default focus */
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
    cfg.focus_px = sst_live_default_focus(s.live);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
    assert_int_equal(rendered_px, 0);
    sst_log_set_level((enum sst_log_level) - 1);
    cfg.c1 = 2;
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), -EINVAL);
    sst_log_set_level(SST_LOG_WARNING);
    cfg.c1 = 0;
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
    assert_int_equal(sst_livepicture_pick(p, 160, 0, &pick), -ERANGE);
    assert_int_equal(sst_livepicture_pick(p, 0, -1, &pick), -ERANGE);
    sst_livepicture_destroy(p);
    sst_image_fini(&overlay);
    hide(&s);
}

/* --- focus -------------------------------------------------------------------------------------------------------- */

static void the_focus_is_behind_what_is_in_front(void **state SST_UNUSED)
{
    static const char *const names[] = { "bush", "pedestrian", "cell", "cat", "humvee", "cd-cases" };

    for (size_t i = 0; i < ARRAY_LEN(names); i++) {
        struct shown s;

        show(&s, names[i], 320, 240, 6, true);
        take(&s, 1);
        if (getenv("SST_VERBOSE"))
            printf("%s: %.2f, truth %.2f\n", names[i], sst_live_default_focus(s.live),
                   sst_scene_occluder_at(s.scene, 0)->focus_px);
        assert_near(sst_live_default_focus(s.live), sst_scene_occluder_at(s.scene, 0)->focus_px, 1);
        hide(&s);
    }
}

/* Disparities as matching gives them: 3 % are wild, all are off by up to a quarter pixel, edges are unknown. */
static void spoil(struct shown *s)
{
    struct sst_lightfield *lf = &s->live->lf;
    uint64_t seed = 1;

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        for (int y = 0; lf->views[k].present && y < lf->height; y++) {
            uint16_t *d = sst_map_u16_row(&lf->views[k].disp, y);

            for (int x = 0; x < lf->width; x++) {
                const uint64_t r = sst_random_u64(&seed);

                d[x] = (uint16_t)sst_clamp_int(d[x] + (int)(r % 33) - 16, 0, SST_DISP_MAX_Q6);
                if (r % 100 < 3)
                    d[x] = r % 2 ? SST_DISP_NONE : (uint16_t)(r % 2000);
            }
        }
    }
}

static void wrong_disparities_do_not_move_it(void **state SST_UNUSED)
{
    static const char *const names[] = { "bush", "pedestrian", "cell", "cat" };

    for (size_t i = 0; i < ARRAY_LEN(names); i++) {
        struct shown s;

        show(&s, names[i], 320, 240, 6, true);
        spoil(&s);
        take(&s, 1);
        assert_near(sst_live_default_focus(s.live), sst_scene_occluder_at(s.scene, 0)->focus_px, 1);
        hide(&s);
    }
}

/* The pedestrian walks to and fro, and is out of the picture for a part of each round: after some seconds the focus
 * stays at the car behind. */
static void it_stays_from_set_to_set(void **state SST_UNUSED)
{
    struct shown s;
    double last = NAN;
    int moves = 0;

    show(&s, NULL, 320, 240, 6, true);
    for (int i = 0; i < 40; i++) {
        double focus;

        if (i % 4 == 0)
            set_scene(&s, "pedestrian", i * 0.25 + 3.4);
        take(&s, (int64_t)i * 250000000 + 1);
        focus = sst_live_default_focus(s.live);
        if (getenv("SST_VERBOSE"))
            printf("%.2f ", focus);
        moves += i && fabs(focus - last) > 0;
        if (i >= 16)
            assert_near(focus, sst_scene_occluder_at(s.scene, 0)->focus_px, 1);
        last = focus;
    }
    assert_in_range(moves, 0, 3);
    hide(&s);
}

/* A wall and a floor that nothing stands on. */
static void without_occluders_it_is_what_fills_the_picture(void **state SST_UNUSED)
{
    struct shown s;

    show(&s, NULL, 160, 120, 3, false);
    for (int k = 0; k < 9; k++) {
        struct sst_view *v = &s.live->lf.views[k];

        assert_int_equal(sst_image_init(&v->image, 160, 120), 0);
        assert_int_equal(sst_map_u16_init(&v->disp, 160, 120), 0);
        for (int y = 0; y < 120; y++) {
            for (int x = 0; x < 160; x++)
                sst_map_u16_row(&v->disp, y)[x] = sst_disp_q6(&s.live->lf, y < 80 ? 6.5 : 6.5 + (y - 80) * 0.05);
        }
    }
    s.live->ready = true;
    take(&s, 1);
    assert_near(sst_live_default_focus(s.live), 6.5, 0.5);
    /* Nothing is known of any pixel: the focus stays. */
    for (int k = 0; k < 9; k++) {
        memset(s.live->lf.views[k].disp.data, 0xFF, s.live->lf.views[k].disp.stride * 120);
        s.changes.map[k][0] = 1;
    }
    take(&s, 2);
    assert_near(sst_live_default_focus(s.live), 6.5, 0.5);
    hide(&s);
}

/* --- picking ------------------------------------------------------------------------------------------------------ */

/* Places of the reference view with one label in their surrounding 5x5 pixels. */
static bool uniform(const struct sst_map_u8 *label, int x, int y)
{
    for (int dy = -2; dy <= 2; dy++) {
        for (int dx = -2; dx <= 2; dx++) {
            if (sst_map_u8_row(label, y + dy)[x + dx] != sst_map_u8_row(label, y)[x])
                return false;
        }
    }
    return true;
}

/* On leaves before the pedestrian: the leaf in front and the pedestrian (or another surface, by the truth) behind.
 */
static void a_leaf_and_what_is_behind_it(void **state SST_UNUSED)
{
    struct sst_map_f32 disp = { 0 };
    struct sst_map_u8 label = { 0 };
    struct sst_render_config cfg = config(NAN);
    const struct sst_image *image;
    struct sst_livepicture *p;
    struct sst_livepicture_pick pick;
    struct shown s;
    int64_t rendered_px;
    int leaves = 0, right_leaf = 0, right_behind = 0;

    show(&s, "bush", 320, 240, 4, false);
    take(&s, 1);
    assert_int_equal(sst_map_f32_init(&disp, 320, 240), 0);
    assert_int_equal(sst_map_u8_init(&label, 320, 240), 0);
    assert_int_equal(sst_scene_render(s.scene, 0, 0, 1, &(struct sst_scene_maps){ .disp = &disp, .label = &label }), 0);
    assert_int_equal(sst_livepicture_create(&p, s.live), 0);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
    for (int y = 20; y < 220; y += 3) {
        for (int x = 20; x < 300; x += 3) {
            const struct sst_view *ref = &s.live->lf.views[s.live->lf.ref_view];
            const double leaf_px = sst_disp_px(&s.live->lf, sst_map_u16_row(&ref->disp, y)[x]);

            if (sst_map_u8_row(&ref->label, y)[x] != SST_LABEL_TREE || leaf_px < 14 || !uniform(&ref->label, x, y) ||
                sst_map_u8_row(&label, y)[x] != SST_LABEL_PEDESTRIAN || !uniform(&label, x, y))
                continue;
            assert_int_equal(sst_livepicture_pick(p, x, y, &pick), 0);
            leaves++;
            right_leaf += pick.front_label == SST_LABEL_TREE && pick.front_px >= leaf_px - 1;
            right_behind +=
                pick.label == SST_LABEL_PEDESTRIAN && fabs(pick.disp_px - (double)sst_map_f32_row(&disp, y)[x]) < 1;
        }
    }
    if (getenv("SST_VERBOSE"))
        printf("leaves %d, right %d, behind %d\n", leaves, right_leaf, right_behind);
    assert_true(leaves > 50);
    assert_true(right_leaf >= 0.98 * leaves);
    assert_true(right_behind >= 0.9 * leaves);
    sst_livepicture_destroy(p);
    sst_map_f32_fini(&disp);
    sst_map_u8_fini(&label);
    hide(&s);
}

/* --- surfaces of the scene ---------------------------------------------------------------------------------------- */

static void labels_and_ranges_are_found(void **state SST_UNUSED)
{
    struct shown s;
    struct sst_live_zone zone;
    double lo, hi, px;

    show(&s, "bush", 320, 240, 6, true);
    zone = live_rectangle(0.25, 0.25, 0.5, 0.5);
    assert_int_equal(sst_live_set_zones(s.live, &zone, 1), 0);
    take(&s, 1);
    assert_int_equal(sst_livepicture_label_disparity(s.live, SST_LABEL_PEDESTRIAN, &px), 0);
    assert_near(px, sst_scene_occluder_at(s.scene, 0)->focus_px, 1);
    assert_int_equal(sst_livepicture_label_disparity(s.live, SST_LABEL_CAT, &px), -ENODATA);
    assert_int_equal(sst_livepicture_label_disparity(s.live, 0, &px), -ENODATA);
    assert_true(sst_live_range(s.live, &lo, &hi));
    assert_true(lo >= s.live->lf.range_min_px - 0.5 && lo < 9 && hi > 21 && hi <= s.live->lf.range_max_px + 0.5);
    for (int i = 0; i <= SST_LIVE_ZONES; i += SST_LIVE_ZONES) {
        const struct sst_map_u8 *label = &s.live->lf.views[s.live->lf.ref_view].label;
        const int x0 = i ? 0 : 80, x1 = i ? 320 : 160, y0 = i ? 0 : 60, y1 = i ? 240 : 120;
        int trees = 0;

        for (int y = y0; y < y1; y++) {
            for (int x = x0; x < x1; x++)
                trees += sst_map_u8_row(label, y)[x] == SST_LABEL_TREE;
        }
        assert_near((double)s.live->zone_label[i][SST_LABEL_TREE], (double)trees / ((x1 - x0) * (y1 - y0)), 0.02);
    }
    /* The leaves are nearer than the limit; surfaces behind them count. */
    zone.near_px = 15;
    assert_int_equal(sst_live_set_zones(s.live, &zone, 1), 0);
    take(&s, 2);
    assert_true(s.live->zone_label[0][SST_LABEL_TREE] < 0.02f);
    hide(&s);
}

/* Median of a label's true disparities in the reference view, and its pixel that is nearest to the middle of them all.
 */
static double truth_of(const struct shown *s, int label, int at[2])
{
    const struct sst_view *v = &s->live->lf.views[s->live->lf.ref_view];
    float *all = malloc(sizeof(*all) * (size_t)v->label.width * (size_t)v->label.height);
    double x_sum = 0, y_sum = 0, nearest = INFINITY, px;
    int n = 0;

    assert_non_null(all);
    for (int pass = 0; pass < 2; pass++) {
        for (int y = 0; y < v->label.height; y++) {
            for (int x = 0; x < v->label.width; x++) {
                const double away = n ? hypot(x - x_sum / n, y - y_sum / n) : 0;

                if (sst_map_u8_row(&v->label, y)[x] != label || (pass && away >= nearest))
                    continue;
                if (pass) {
                    nearest = away;
                    at[0] = x;
                    at[1] = y;
                    continue;
                }
                x_sum += x;
                y_sum += y;
                all[n++] = (float)sst_disp_px(&s->live->lf, sst_map_u16_row(&v->disp, y)[x]);
            }
        }
    }
    assert_true(n > 100);
    sst_stats_sort_float(all, n);
    px = (double)all[n / 2];
    free(all);
    return px;
}

/* A hen 5 cm before a cat: a click on either focuses on it and not between them, and so does its label. */
static void neighbours_in_depth_are_two(void **state SST_UNUSED)
{
    static const int labels[] = { SST_LABEL_HEN, SST_LABEL_CAT };
    struct sst_render_config cfg = config(NAN);
    const struct sst_image *image;
    struct sst_livepicture_pick pick;
    struct sst_livepicture *p;
    double want[2], px;
    int64_t rendered_px;
    struct shown s;
    int at[2] = { 0 };

    show(&s, "cat", 320, 240, 4, false);
    take(&s, 1);
    assert_int_equal(sst_livepicture_create(&p, s.live), 0);
    for (int i = 0; i < 2; i++) {
        want[i] = truth_of(&s, labels[i], at);
        cfg.focus_px = want[i];
        assert_int_equal(sst_livepicture_render(p, &cfg, &image, &rendered_px), 0);
        assert_int_equal(sst_livepicture_pick(p, at[0], at[1], &pick), 0);
        assert_int_equal(pick.label, labels[i]);
        assert_near(pick.disp_px, want[i], 0.8);
        assert_int_equal(sst_livepicture_label_disparity(s.live, labels[i], &px), 0);
        assert_near(px, want[i], 0.3);
    }
    assert_true(want[0] - want[1] > 1.5);
    sst_livepicture_destroy(p);
    hide(&s);
}

static void zones_tell_what_changed(void **state SST_UNUSED)
{
    const struct sst_live_zone zones[] = { live_rectangle(0, 0, 0.4, 0.5), /* tiles 0, 1 of rows 0, 1 */
                                           live_rectangle(0.8, 0, 1, 1) };
    struct shown s;
    double changed[SST_LIVE_ZONES + 1];

    show(&s, "cell", 160, 128, 2, false); /* 5 x 4 tiles */
    assert_int_equal(sst_live_set_zones(s.live, zones, 2), 0);
    s.changes.map[s.live->lf.ref_view][6] = 1; /* column 1, row 1 */
    s.changes.map[(s.live->lf.ref_view + 1) % 4][4] = 1;
    live_zones_changed(s.live, &s.changes, changed);
    assert_near(changed[0], 0.25, 0);
    assert_near(changed[1], 0, 0);
    assert_near(changed[2], 0, 0);
    assert_near(changed[SST_LIVE_ZONES], 0.05, 0);
    s.changes.whole = true;
    live_zones_changed(s.live, &s.changes, changed);
    assert_near(changed[1], 1, 0);
    hide(&s);
}

/* A triangle, a mask over a part of the picture, and invalid zones. */
static void zones_are_polygons(void **state SST_UNUSED)
{
    struct sst_live_zone zone[2] = { live_rectangle(0, 0, 1, 1), live_rectangle(0, 0, 0.2, 0.25) };
    struct shown s;
    double changed[SST_LIVE_ZONES + 1];

    zone[0].points = 3; /* the lower left half */
    zone[0].x[0] = zone[0].y[0] = zone[0].x[2] = 0;
    zone[0].x[1] = zone[0].y[1] = zone[0].y[2] = 1;
    assert_true(sst_live_zone_has(&zone[0], 0.25, 0.75, 5) && !sst_live_zone_has(&zone[0], 0.75, 0.25, 5));
    zone[0].near_px = 4;
    assert_true(!sst_live_zone_has(&zone[0], 0.25, 0.75, 5) && sst_live_zone_has(&zone[0], 0.25, 0.75, 3));
    zone[0].near_px = INFINITY;
    show(&s, "cell", 160, 128, 2, false); /* 5 x 4 tiles */
    assert_int_equal(sst_live_set_zones(s.live, zone, 1), 0);
    s.changes.map[s.live->lf.ref_view][0] = s.changes.map[s.live->lf.ref_view][4] = 1; /* corners above */
    live_zones_changed(s.live, &s.changes, changed);
    assert_true(changed[0] > 0.06 && changed[0] < 0.1); /* one of about 14 */
    assert_near(changed[SST_LIVE_ZONES], 0.1, 0);
    zone[1].mask = true; /* the first tile */
    assert_int_equal(sst_live_set_zones(s.live, zone, 2), 0);
    live_zones_changed(s.live, &s.changes, changed);
    assert_near(changed[0], 0, 0);
    assert_near(changed[SST_LIVE_ZONES], 1.0 / 19, 1e-9);
    sst_log_set_level((enum sst_log_level) - 1);
    zone[1].far_px = zone[1].near_px = 3;
    assert_int_equal(sst_live_set_zones(s.live, zone, 2), -EINVAL);
    zone[1] = live_rectangle(0.1, 0.1, 0.1, 0.5);
    assert_int_equal(sst_live_set_zones(s.live, zone, 2), -EINVAL);
    sst_log_set_level(SST_LOG_WARNING);
    assert_int_equal(s.live->cfg.zones, 2); /* as before */
    hide(&s);
}

static void counts_of_all_views_are_the_histogram(void **state SST_UNUSED)
{
    struct sst_label_histogram all = { 0 }, again = { 0 };
    struct shown s;
    int view[4];
    int n = 0;

    show(&s, "cat", 160, 120, 2, false);
    for (int k = 0; k < 4; k++)
        view[n++] = k;
    assert_int_equal(sst_render_histogram_init(&all, &s.live->lf, 2), 0);
    for (int round = 0; round < 2; round++) { /* the second one in the memory of the first */
        assert_int_equal(sst_render_histogram_recount(&again, &s.live->lf, view, n, 1), 0);
        assert_int_equal(again.bins, all.bins);
        assert_int_equal(again.first_bin, all.first_bin);
        for (int i = 0; i < 256; i++) {
            assert_int_equal(again.present[i], all.present[i]);
            assert_int_equal(!again.count[i], !all.count[i]);
            if (all.count[i])
                assert_memory_equal(again.count[i], all.count[i], (size_t)all.bins * sizeof(*all.count[i]));
        }
    }
    sst_render_histogram_fini(&all);
    sst_render_histogram_fini(&again);
    hide(&s);
}

static double luminance(const struct sst_image *img, int x, int y)
{
    double sum = 0;

    for (int c = 0; c < 3; c++)
        sum += (double[]){ 0.2126, 0.7152, 0.0722 }[c] * pow(sst_image_row(img, c, y)[x] / 255.0, 2.2);
    return sum;
}

static void overlays_show_labels_and_disparities(void **state SST_UNUSED)
{
    struct sst_image out = { 0 };
    struct shown s;
    double last = -1;

    show(&s, "cell", 160, 120, 2, false);
    for (int k = 0; k < 4; k++) { /* a staircase of disparities, and half of it unlabeled */
        for (int y = 0; y < 120; y++) {
            for (int x = 0; x < 160; x++) {
                unsigned step = (unsigned)x / 10 * 40; /* in steps of disparity */

                sst_map_u16_row(&s.live->lf.views[k].disp, y)[x] = (uint16_t)(y ? step : SST_DISP_NONE);
                sst_map_u8_row(&s.live->lf.views[k].label, y)[x] = y < 60 ? SST_LABEL_NUCLEUS : 0;
            }
        }
    }
    take(&s, 1);
    assert_int_equal(sst_image_init(&out, 160, 120), 0);
    assert_int_equal(sst_livepicture_overlay(s.live, SST_LIVE_DISPARITY_PICTURE, &out), 0);
    assert_near(luminance(&out, 5, 0), 0, 0);
    for (int x = 5; x < 160; x += 10) { /* nearer is lighter */
        assert_true(luminance(&out, x, 50) > last);
        last = luminance(&out, x, 50);
    }
    assert_int_equal(sst_livepicture_overlay(s.live, SST_LIVE_LABELS_PICTURE, &out), 0);
    for (int c = 0; c < 3; c++) {
        const struct sst_image *in = &s.live->lf.views[s.live->lf.ref_view].image;
        const int colour = sst_classes_palette()[SST_LABEL_NUCLEUS][c];

        assert_int_equal(sst_image_row(&out, c, 100)[80], sst_image_row(in, c, 100)[80] / 2);
        assert_near(sst_image_row(&out, c, 30)[80], 0.625 * colour + 0.375 * sst_image_row(in, c, 30)[80], 1);
    }
    sst_image_fini(&out);
    hide(&s);
}

/* Loops on no threads would run on one: all of the live picture gets a number. */
static void zero_threads_are_all_processors(void **state SST_UNUSED)
{
    const struct sst_live_config cfg = { .rows = 1, .cols = 2, .width = 64, .height = 48, .present = { true, true } };
    struct sst_live *live = calloc(1, sizeof(*live));

    assert_non_null(live);
    assert_int_equal(live_init(live, &cfg), 0);
    assert_int_equal(live->cfg.threads, sst_thread_count(0));
    live_fini(live);
    free(live);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        serial_test(parts_have_the_bytes_of_the_whole),
        cmocka_unit_test(labelled_parts_do_too),
        serial_test(verified_parts_do_too),
        cmocka_unit_test(absent_views_are_left_out),
        cmocka_unit_test(what_cannot_be_rendered_is_said),
        plain_test(the_focus_is_behind_what_is_in_front),
        plain_test(wrong_disparities_do_not_move_it),
        plain_test(it_stays_from_set_to_set),
        cmocka_unit_test(without_occluders_it_is_what_fills_the_picture),
        serial_test(a_leaf_and_what_is_behind_it),
        serial_test(labels_and_ranges_are_found),
        serial_test(neighbours_in_depth_are_two),
        cmocka_unit_test(zones_tell_what_changed),
        cmocka_unit_test(zones_are_polygons),
        cmocka_unit_test(counts_of_all_views_are_the_histogram),
        cmocka_unit_test(overlays_show_labels_and_disparities),
        cmocka_unit_test(zero_threads_are_all_processors),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
