/* Clicks on light fields made by hand: layers of noise, each with a disparity and holes, and maps that are
 * right or wrong about them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/live/live_internal.h"
#include "pipeline/live/picture/picture_internal.h"
#include "tests/test.h"

#define SIDE   6
#define VIEWS  (SIDE * SIDE)
#define WIDTH  160
#define HEIGHT 120
#define BEHIND 5.3
#define FRONT  13.0

#define assert_near(got, want, eps)                                                                                    \
    do {                                                                                                               \
        const double g_ = (got), w_ = (want);                                                                          \
        if (!(fabs(g_ - w_) <= (eps)))                                                                                 \
            fail_msg("%s:%d: %.9g, not %.9g", __FILE__, __LINE__, g_, w_);                                             \
    } while (0)

/** Noise in blocks, mixed between them; flat: one colour. */
struct layer {
    double disp_px;
    double cover; /* share of it that is there, in blocks of 5x5 px */
    int label;
    bool flat;
};

struct made {
    struct sst_live live;
    struct sst_liveframes_changes changes;
    struct sst_livepicture *picture;
    const struct layer *layer; /* nearest first; the last covers all */
    int layers;
};

/* 0..255, by place of a block of a layer. */
static unsigned hash(int layer, int c, int x, int y)
{
    uint32_t h = (uint32_t)x * 73856093U ^ (uint32_t)y * 19349663U ^ (uint32_t)(layer * 4 + c) * 83492791U;

    h = (h ^ h >> 15) * 0x2C1B3C6DU;
    h = (h ^ h >> 12) * 0x297A2D39U;
    return (h ^ h >> 15) >> 24;
}

static double noise(int layer, int c, double x, double y)
{
    const double u = x / 3, v = y / 3;
    const int i = (int)floor(u), j = (int)floor(v);
    const double fu = u - i, fv = v - j;

    return (1 - fv) * ((1 - fu) * hash(layer, c, i, j) + fu * hash(layer, c, i + 1, j)) +
           fv * ((1 - fu) * hash(layer, c, i, j + 1) + fu * hash(layer, c, i + 1, j + 1));
}

/* The layer that is seen where layer i would be seen at (x, y) of the reference view, from offset (bx, by). */
static int seen(const struct made *m, double bx, double by, int x, int y)
{
    int i = 0;

    for (; i < m->layers - 1; i++) {
        const double u = x + m->layer[i].disp_px * bx, v = y + m->layer[i].disp_px * by;

        if (hash(i, 3, (int)floor(u / 5), (int)floor(v / 5)) < 256 * m->layer[i].cover)
            break;
    }
    return i;
}

static void draw(struct made *m, struct sst_view *view)
{
    struct sst_lightfield *lf = &m->live.lf;

    assert_int_equal(sst_image_init(&view->image, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u16_init(&view->disp, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&view->label, WIDTH, HEIGHT), 0);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            const int i = seen(m, view->bx, view->by, x, y);
            const struct layer *l = &m->layer[i];

            for (int c = 0; c < 3; c++)
                sst_image_row(&view->image, c, y)[x] =
                    (uint8_t)(l->flat ? 120 : noise(i, c, x + l->disp_px * view->bx, y + l->disp_px * view->by) + 0.5);
            sst_map_u16_row(&view->disp, y)[x] = sst_disp_q6(lf, l->disp_px);
            sst_map_u8_row(&view->label, y)[x] = (uint8_t)l->label;
        }
    }
}

static void take(struct made *m, int64_t s)
{
    m->changes.whole = true;
    assert_int_equal(live_ingest(&m->live, &m->changes), 0);
    assert_int_equal(live_summarize(&m->live, s * 1000000000), 0);
}

/* Views of these layers, with true maps. */
static void make(struct made *m, const struct layer *layer, int layers)
{
    struct sst_live_config cfg = { .rows = SIDE, .cols = SIDE, .width = WIDTH, .height = HEIGHT, .threads = 1 };

    memset(m, 0, sizeof(*m));
    m->layer = layer;
    m->layers = layers;
    for (int k = 0; k < VIEWS; k++)
        cfg.present[k] = true;
    assert_int_equal(live_init(&m->live, &cfg), 0);
    assert_int_equal(sst_liveframes_changes_init(&m->changes, &m->live.lf), 0);
    m->live.lf.range_max_px = 16;
    for (int k = 0; k < VIEWS; k++)
        draw(m, &m->live.lf.views[k]);
    m->live.ready = m->live.low_confidence = true;
    take(m, 1);
    assert_int_equal(sst_livepicture_create(&m->picture, &m->live), 0);
}

static void unmake(struct made *m)
{
    sst_livepicture_destroy(m->picture);
    sst_liveframes_changes_fini(&m->changes);
    live_fini(&m->live);
}

/* The maps of all views say the same everywhere. */
static void tell(struct made *m, double disp_px, int label)
{
    for (int k = 0; k < VIEWS; k++) {
        struct sst_view *v = &m->live.lf.views[k];

        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++)
                sst_map_u16_row(&v->disp, y)[x] = isnan(disp_px) ? SST_DISP_NONE : sst_disp_q6(&m->live.lf, disp_px);
            memset(sst_map_u8_row(&v->label, y), label, WIDTH);
        }
    }
    take(m, 2);
}

static struct sst_livepicture_pick pick_at(struct made *m, double focus_px, int x, int y)
{
    struct sst_livepicture_pick pick = { .disp_px = -1 };
    struct sst_render_config cfg;
    const struct sst_image *image;
    int64_t anew;

    sst_render_config_defaults(&cfg);
    cfg.focus_px = focus_px;
    cfg.verify = true;
    assert_int_equal(sst_livepicture_render(m->picture, &cfg, &image, &anew), 0);
    assert_int_equal(sst_livepicture_pick(m->picture, x, y, &pick), 0);
    return pick;
}

/* --- the sweep ------------------------------------------------------------------------------------------------------
 */

/** A sweep needs the views of a plan only. */
struct swept {
    struct made made;
    struct sst_render_plan plan;
    struct patch_sweep sweep;
};

static void sweep_made(struct swept *s, int x, int y)
{
    struct sst_render_config cfg;

    sst_render_config_defaults(&cfg);
    cfg.method = SST_RENDER_REFOCUS;
    cfg.focus_px = 0;
    assert_int_equal(sst_render_plan_init(&s->plan, s->made.live.renderer, &cfg), 0);
    sweep_init(&s->sweep, &s->plan, s->made.live.renderer->rarity, x, y);
}

static void sweep_of(struct swept *s, const struct layer *layer, int layers, int x, int y)
{
    make(&s->made, layer, layers);
    sweep_made(s, x, y);
}

static void end_sweep(struct swept *s)
{
    sst_render_plan_fini(&s->plan);
    unmake(&s->made);
}

static const struct layer wall[] = { { BEHIND, 1, 2, false } };
static const struct layer hedge[] = { { FRONT, 0.6, 6, false }, { BEHIND, 1, 2, false } };
static const struct layer hedge_before_paint[] = { { FRONT, 0.6, 6, false }, { BEHIND, 1, 2, true } };

static void one_layer_is_found_between_the_steps(void **state SST_UNUSED)
{
    static const int at[][2] = { { 80, 60 }, { 0, 0 }, { WIDTH - 1, HEIGHT - 1 }, { 0, 60 }, { 80, HEIGHT - 1 } };
    struct swept s;

    sweep_of(&s, wall, 1, 0, 0);
    for (size_t i = 0; i < ARRAY_LEN(at); i++) {
        struct sweep_peak peak;

        sweep_init(&s.sweep, &s.plan, s.made.live.renderer->rarity, at[i][0], at[i][1]);
        peak = sweep_peak(&s.sweep, 0, 16, 0);
        assert_near(peak.disp_px, BEHIND, 0.15);
        assert_true(peak.agree > 0.5 && peak.agree <= 1);
        assert_true(sweep_agree(&s.sweep, BEHIND + 3) < 0.5 * peak.agree);
    }
    end_sweep(&s);
}

static void of_two_layers_both_are_found(void **state SST_UNUSED)
{
    struct swept s;
    int found[2] = { 0 }, all[2] = { 0 };

    sweep_of(&s, hedge, 2, 0, 0);
    for (int y = 20; y < HEIGHT - 20; y += 8) {
        for (int x = 20; x < WIDTH - 20; x += 8) {
            const int front = seen(&s.made, 0, 0, x, y) == 0;

            sweep_init(&s.sweep, &s.plan, s.made.live.renderer->rarity, x, y);
            found[1] += fabs(sweep_peak(&s.sweep, 0, FRONT - 3, 0).disp_px - BEHIND) <= 0.5;
            found[0] += front && fabs(sweep_peak(&s.sweep, FRONT - 3, 16, 0).disp_px - FRONT) <= 0.5;
            all[1]++;
            all[0] += front;
        }
    }
    assert_true(all[0] > 50 && all[1] > all[0]);
    assert_true(found[0] >= 0.95 * all[0]);
    assert_true(found[1] >= 0.95 * all[1]);
    end_sweep(&s);
}

static void without_texture_what_is_preferred_is_told(void **state SST_UNUSED)
{
    static const struct layer paint[] = { { BEHIND, 1, 2, true } };
    struct sweep_peak peak;
    struct swept s;

    sweep_of(&s, paint, 1, 80, 60);
    peak = sweep_peak(&s.sweep, 0, 16, 7.25);
    assert_near(peak.disp_px, 7.25, 0);
    assert_near(peak.agree, 1, 1e-9);
    assert_near(sweep_peak(&s.sweep, 0, 16, 99).disp_px, 16, 0.5);
    end_sweep(&s);
}

static void where_no_rays_are_nothing_is_told(void **state SST_UNUSED)
{
    struct sweep_peak peak;
    struct swept s;

    sweep_of(&s, wall, 1, 80, 60);
    assert_true(isnan(sweep_agree(&s.sweep, 1e9))); /* the reference view alone */
    assert_true(isnan(sweep_peak(&s.sweep, 1e5, 2e5, 0).disp_px));
    /* One place, and a stretch that is none. */
    assert_near(sweep_peak(&s.sweep, BEHIND, BEHIND, 0).disp_px, BEHIND, 0);
    assert_near(sweep_peak(&s.sweep, BEHIND, BEHIND - 1, 0).disp_px, BEHIND - 1, 1);
    sst_render_plan_fini(&s.plan);
    for (int k = 1; k < VIEWS; k++)
        s.made.live.lf.views[k].present = false;
    sweep_made(&s, 80, 60);
    peak = sweep_peak(&s.sweep, 0, 16, 0);
    assert_true(isnan(peak.disp_px));
    assert_int_equal(sweep_label(&s.sweep, BEHIND, 1), 0);
    end_sweep(&s);
}

/* A frame's places outside the camera's picture count as little as an absent camera. */
static void what_no_camera_saw_does_not_count(void **state SST_UNUSED)
{
    double without;
    struct swept s;

    sweep_of(&s, wall, 1, 80, 60);
    sst_render_plan_fini(&s.plan);
    for (int k = 0; k < VIEWS; k += 5)
        s.made.live.lf.views[k].present = false;
    sweep_made(&s, 80, 60);
    without = sweep_agree(&s.sweep, BEHIND);
    assert_true(without > 0.5);
    sst_render_plan_fini(&s.plan);
    for (int k = 0; k < VIEWS; k += 5) {
        struct sst_view *v = &s.made.live.lf.views[k];

        v->present = true;
        assert_int_equal(sst_map_u8_init(&v->valid, WIDTH, HEIGHT), 0);
        for (int y = 0; y < HEIGHT; y++)
            memset(sst_map_u8_row(&v->valid, y), 0, WIDTH);
        for (int c = 0; c < 3; c++)
            memset(sst_image_row(&v->image, c, 0), 77, v->image.stride * HEIGHT);
    }
    sweep_made(&s, 80, 60);
    assert_near(sweep_agree(&s.sweep, BEHIND), without, 0.02); /* votes are of another size */
    end_sweep(&s);
}

static void a_label_is_of_the_rays_that_agree(void **state SST_UNUSED)
{
    struct swept s;

    sweep_of(&s, hedge, 2, 80, 60);
    assert_int_equal(sweep_label(&s.sweep, BEHIND, 1), 2);
    /* All maps say hedge: nothing is known of surfaces behind. */
    tell(&s.made, FRONT, 6);
    sweep_init(&s.sweep, &s.plan, s.made.live.renderer->rarity, 80, 60);
    assert_int_equal(sweep_label(&s.sweep, BEHIND, 1), 0);
    /* But for a strip next to the patch. */
    for (int k = 0; k < VIEWS; k++) {
        struct sst_view *v = &s.made.live.lf.views[k];

        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++) {
                if (fabs(x + BEHIND * v->bx - 97) > 4)
                    continue;
                sst_map_u16_row(&v->disp, y)[x] = sst_disp_q6(&s.made.live.lf, BEHIND);
                sst_map_u8_row(&v->label, y)[x] = 10;
            }
        }
    }
    sweep_init(&s.sweep, &s.plan, s.made.live.renderer->rarity, 80, 60);
    assert_int_equal(sweep_label(&s.sweep, BEHIND, 1), 10);
    end_sweep(&s);
}

/* --- clicks ---------------------------------------------------------------------------------------------------------
 */

/* Share of clicks on hidden surfaces that find the surface behind the hedge. */
static double found_behind(struct made *m, double focus_px, int *labels)
{
    int all = 0, right = 0;

    *labels = 0;
    for (int y = 20; y < HEIGHT - 20; y += 7) {
        for (int x = 20; x < WIDTH - 20; x += 7) {
            struct sst_livepicture_pick pick;

            if (seen(m, 0, 0, x, y))
                continue;
            pick = pick_at(m, focus_px, x, y);
            all++;
            right += fabs(pick.disp_px - BEHIND) <= 1;
            *labels += pick.label == 2;
        }
    }
    assert_true(all > 50);
    return (double)right / all;
}

static void what_is_seen_between_leaves_is_found(void **state SST_UNUSED)
{
    struct made m;
    int labels;

    make(&m, hedge, 2);
    assert_true(found_behind(&m, BEHIND, &labels) >= 0.95); /* by maps that are right */
    assert_true(labels > 50);
    tell(&m, FRONT, 6); /* by maps that know of the hedge alone */
    assert_true(found_behind(&m, BEHIND, &labels) >= 0.95);
    assert_int_equal(labels, 0);
    assert_true(found_behind(&m, BEHIND + 1, &labels) >= 0.95); /* the focus is not quite there */
    tell(&m, NAN, 0);                                           /* by maps that know nothing */
    assert_true(found_behind(&m, BEHIND, &labels) >= 0.95);
    unmake(&m);
}

/* Without verified rays the picture follows the maps, and so does a click. */
static void maps_decide_where_the_picture_is_theirs(void **state SST_UNUSED)
{
    struct sst_livepicture_pick pick;
    struct made m;

    make(&m, hedge, 2);
    tell(&m, FRONT, 6);
    pick = pick_at(&m, FRONT, 80, 60); /* the hedge is in focus */
    assert_near(pick.disp_px, FRONT, 0.1);
    assert_int_equal(pick.label, 6);
    m.live.low_confidence = false;
    pick = pick_at(&m, BEHIND, 80, 60);
    assert_near(pick.disp_px, FRONT, 0.1);
    assert_int_equal(pick.label, 6);
    unmake(&m);
}

/* Paint behind the hedge: rays agree on it at any depth, and the maps, or without them the focus, say which. */
static void without_texture_maps_and_focus_decide(void **state SST_UNUSED)
{
    struct made m;
    int labels;

    make(&m, hedge_before_paint, 2);
    assert_true(found_behind(&m, BEHIND + 0.8, &labels) >= 0.8);
    tell(&m, FRONT, 6);
    assert_true(found_behind(&m, BEHIND, &labels) >= 0.95);
    unmake(&m);
}

static void cameras_may_be_absent(void **state SST_UNUSED)
{
    struct made m;
    int labels;

    make(&m, hedge, 2);
    tell(&m, FRONT, 6);
    for (int k = 0; k < VIEWS; k++)
        m.live.lf.views[k].present = k % 4 != 1;
    take(&m, 3);
    assert_true(found_behind(&m, BEHIND, &labels) >= 0.9);
    for (int k = 0; k < VIEWS; k++)
        m.live.lf.views[k].present = k == 7;
    take(&m, 4);
    assert_near(pick_at(&m, BEHIND, 80, 60).disp_px, FRONT, 0.1); /* one says nothing about agreement */
    unmake(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_layer_is_found_between_the_steps),
        cmocka_unit_test(of_two_layers_both_are_found),
        cmocka_unit_test(without_texture_what_is_preferred_is_told),
        cmocka_unit_test(where_no_rays_are_nothing_is_told),
        cmocka_unit_test(what_no_camera_saw_does_not_count),
        cmocka_unit_test(a_label_is_of_the_rays_that_agree),
        cmocka_unit_test(what_is_seen_between_leaves_is_found),
        cmocka_unit_test(maps_decide_where_the_picture_is_theirs),
        cmocka_unit_test(without_texture_maps_and_focus_decide),
        cmocka_unit_test(cameras_may_be_absent),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
