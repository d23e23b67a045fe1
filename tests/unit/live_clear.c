/* Clear pictures of a light field that changes: what is kept from the last one, things removed by a click, the
 * automatic cut. Maps are true. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/live/picture/picture_internal.h"
#include "tests/live_shown.h"
#include "tests/small.h"

/* --- pictures ----------------------------------------------------------------------------------------------------- */

static struct sst_render_config clear_config(double cut_px)
{
    struct sst_render_config cfg;

    sst_render_config_defaults(&cfg);
    cfg.method = SST_RENDER_CLEAR;
    cfg.cut_px = cut_px;
    return cfg;
}

/* Share of the picture that is wrong by more than 20 levels, in percent. */
static double wrong(const struct sst_image *a, const struct sst_image *b)
{
    int n = 0;

    for (int y = 0; y < a->height; y++) {
        for (int x = 0; x < a->width; x++) {
            int most = 0;

            for (int c = 0; c < 3; c++)
                most = sst_max_int(most, abs(sst_image_row(a, c, y)[x] - sst_image_row(b, c, y)[x]));
            n += most > 20;
        }
    }
    return 100.0 * n / ((double)a->width * a->height);
}

static void behind(struct shown *s, struct sst_image *out)
{
    assert_int_equal(sst_image_init(out, s->live->lf.width, s->live->lf.height), 0);
    assert_int_equal(sst_scene_render(s->scene, 0, 0, 1, &(struct sst_scene_maps){ .image = out }), 0);
}

/* A new picture that takes over the memory of another one shows as much of it. */
static void remembers_too(struct shown *s, const struct sst_livepicture *from, double remembered)
{
    const struct sst_render_config cfg = clear_config(NAN);
    struct sst_livepicture_clear shown;
    const struct sst_image *image;
    struct sst_livepicture *p;
    int64_t px;

    for (int takes_over = 0; takes_over < 2; takes_over++) {
        assert_int_equal(sst_livepicture_create(&p, s->live), 0);
        if (takes_over)
            assert_int_equal(sst_livepicture_remember(p, from), 0);
        assert_int_equal(sst_livepicture_render(p, &cfg, &image, &px), 0);
        sst_livepicture_clear(p, &shown);
        assert_true(takes_over ? shown.remembered > 0.5 * remembered : shown.remembered == 0);
        sst_livepicture_destroy(p);
    }
    assert_true(remembered > 0);
}

static void a_walker_vanishes_and_leaves_nothing(void **state SST_UNUSED)
{
    struct sst_livepicture_clear shown;
    struct sst_render_config cfg = clear_config(NAN);
    const struct sst_image *image;
    struct sst_image truth = { 0 };
    struct sst_livepicture *p;
    struct shown s;
    int64_t px;

    show(&s, "pedestrian", 160, 120, 6, false);
    take(&s, 1000000);
    assert_int_equal(sst_livepicture_create(&p, s.live), 0);
    sst_livepicture_clear(p, &shown);
    assert_true(isnan(shown.cut_px) && isnan(shown.seen));
    for (int i = 0; i < 8; i++) {
        if (i)
            set_scene(&s, "pedestrian", 0.2 * i);
        take(&s, 1000000 + i * INT64_C(200000000));
        assert_int_equal(sst_livepicture_render(p, &cfg, &image, &px), 0);
        sst_livepicture_clear(p, &shown);
        if (isnan(shown.cut_px))
            continue; /* no gap yet: all in focus */
        behind(&s, &truth);
        if (getenv("SST_VERBOSE"))
            printf("%.1f s: cut %.2f px, wrong %.2f %%, seen %.1f, remembered %.1f %%\n", 0.2 * i, shown.cut_px,
                   wrong(image, &truth), 100 * shown.seen, 100 * shown.remembered);
        assert_true(wrong(image, &truth) < 3);
        assert_true(shown.seen + shown.remembered + shown.filled > 0.999 && shown.seen > 0.9);
        sst_image_fini(&truth);
        assert_int_equal(sst_livepicture_render(p, &cfg, &image, &px), 0);
        assert_int_equal(px, 0); /* nothing changed: nothing is computed */
        if (i == 4)
            remembers_too(&s, p, shown.remembered);
    }
    assert_false(isnan(sst_live_cut(s.live)));
    sst_livepicture_destroy(p);
    hide(&s);
}

/* Any number of threads gives the same bytes. */
static void threads_do_not_matter(void **state SST_UNUSED)
{
    const int sets = small_level() >= 2 ? 2 : 3;
    struct sst_render_config cfg = clear_config(11);
    const struct sst_image *image;
    struct sst_image first = { 0 };
    struct shown s;
    int64_t px;

    for (int threads = 1; threads < 5; threads += 2) {
        struct sst_livepicture *p;

        show(&s, "bush", 160, 120, 3, false);
        s.live->cfg.threads = threads;
        assert_int_equal(sst_livepicture_create(&p, s.live), 0);
        for (int i = 0; i < sets; i++) {
            set_scene(&s, "bush", 0.3 * i);
            s.live->low_confidence = i == 1; /* then rays are verified, too */
            take(&s, 1000000 + i * INT64_C(700000000));
            assert_int_equal(sst_livepicture_render(p, &cfg, &image, &px), 0);
            assert_int_equal(sst_livepicture_decorate(p, SST_OUTLINE_ALL, true, &image), 0);
        }
        if (threads == 1) {
            assert_int_equal(sst_image_init(&first, 160, 120), 0);
            for (int c = 0; c < 3; c++)
                memcpy(first.plane[c], image->plane[c], image->stride * 120);
        } else {
            assert_true(same_image(image, &first));
        }
        sst_livepicture_destroy(p);
        hide(&s);
    }
    sst_image_fini(&first);
}

/* --- parts kept from the last picture ----------------------------------------------------------------------------- */

/* A view of a textured wall, of a box that moves before it, and of a lamp in a corner that is switched on and off. */
static void draw_view(struct sst_lightfield *lf, struct sst_view *v, int t)
{
    for (int y = 0; y < lf->height; y++) {
        for (int x = 0; x < lf->width; x++) {
            const double wall_px = 4.3 + 0.002 * y, box_px = 12.6;
            const int box_x = (int)floor(x + box_px * v->bx) - 20 - 9 * t, box_y = (int)floor(y + box_px * v->by) - 60;
            const bool box = box_x >= 0 && box_x < 40 && box_y >= 0 && box_y < 90;
            const int at_x = box ? box_x : (int)floor(x + wall_px * v->bx);
            const int at_y = box ? box_y : (int)floor(y + wall_px * v->by);
            const int lit = !box && at_x > 250 && at_y > 150 && t % 3 == 0 ? 40 : 0;

            for (int c = 0; c < 3; c++)
                sst_image_row(&v->image, c, y)[x] =
                    (uint8_t)(((at_x * (7 + c) ^ at_y * (11 - c)) & 127) + (box ? 80 : 20) + lit);
            sst_map_u16_row(&v->disp, y)[x] =
                (x * 31 + y * 17) % 97 ? sst_disp_q6(lf, box ? box_px : wall_px) : SST_DISP_NONE;
            sst_map_u8_row(&v->label, y)[x] = box ? 5 : 2;
        }
    }
}

/* Does a tile of two views differ? */
static bool differs(const struct sst_view *a, const struct sst_view *b, int x0, int y0, int width, int height)
{
    const size_t x = (size_t)x0, n = (size_t)sst_min_int(SST_LIVE_TILE, width - x0);

    for (int y = y0; y < sst_min_int(y0 + SST_LIVE_TILE, height); y++) {
        if (memcmp(sst_map_u16_row(&a->disp, y) + x, sst_map_u16_row(&b->disp, y) + x, 2 * n) ||
            memcmp(sst_map_u8_row(&a->label, y) + x, sst_map_u8_row(&b->label, y) + x, n))
            return true;
        for (int c = 0; c < 3; c++) {
            if (memcmp(sst_image_row(&a->image, c, y) + x, sst_image_row(&b->image, c, y) + x, n))
                return true;
        }
    }
    return false;
}

static void init_view(struct sst_view *v, int width, int height)
{
    assert_int_equal(sst_image_init(&v->image, width, height), 0);
    assert_int_equal(sst_map_u16_init(&v->disp, width, height), 0);
    assert_int_equal(sst_map_u8_init(&v->label, width, height), 0);
}

static void fini_view(struct sst_view *v)
{
    sst_image_fini(&v->image);
    sst_map_u16_fini(&v->disp);
    sst_map_u8_fini(&v->label);
}

/* The box moves: only tiles that differ are marked. @return fraction that does */
static double move_on(struct shown *s, int t)
{
    struct sst_lightfield *lf = &s->live->lf;
    const int cols = s->changes.cols, tiles = cols * s->changes.rows;
    int changed = 0;

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        struct sst_view *v = &lf->views[k], before = *v;

        init_view(v, lf->width, lf->height);
        draw_view(lf, v, t);
        for (int i = 0; i < tiles; i++) {
            s->changes.map[k][i] =
                differs(v, &before, i % cols * SST_LIVE_TILE, i / cols * SST_LIVE_TILE, lf->width, lf->height);
            changed += s->changes.map[k][i];
        }
        fini_view(&before);
    }
    return (double)changed / (lf->rows * lf->cols * tiles);
}

/* Two pictures of one light field: one that keeps unchanged parts, one that computes everything. */
struct both {
    struct sst_livepicture *kept, *exact;
    struct sst_renderer *other; /* of the exact one */
    struct sst_render_config cfg;
    int64_t kept_px;
};

static void open_both(struct both *b, struct shown *s, double cut_px)
{
    *b = (struct both){ .cfg = clear_config(cut_px) };
    assert_int_equal(sst_livepicture_create(&b->kept, s->live), 0);
    assert_int_equal(sst_livepicture_create(&b->exact, s->live), 0);
    assert_int_equal(sst_renderer_create(&b->other, &s->live->lf, 2), 0);
}

static void close_both(struct both *b)
{
    sst_livepicture_destroy(b->kept);
    sst_livepicture_destroy(b->exact);
    sst_renderer_destroy(b->other);
}

static void render_both(struct both *b, struct shown *s)
{
    struct sst_live *live = s->live;
    struct sst_renderer *shared = live->renderer;
    const struct sst_image *image, *whole;
    int64_t px;

    live->cfg.skip_change = true;
    assert_int_equal(sst_livepicture_render(b->kept, &b->cfg, &image, &b->kept_px), 0);
    assert_int_equal(sst_renderer_recount(b->other, live->sample, live->sampled, 1), 0);
    live->renderer = b->other;
    live->cfg.skip_change = false;
    assert_int_equal(sst_livepicture_render(b->exact, &b->cfg, &whole, &px), 0);
    live->renderer = shared;
    assert_true(same_image(image, whole));
}

static void show_box(struct shown *s)
{
    struct sst_lightfield *lf;

    show(s, NULL, 320, 240, 3, false);
    lf = &s->live->lf;
    lf->range_min_px = 4;
    lf->range_max_px = 13;
    lf->disp_min_px = 3;
    for (int k = 0; k < 9; k++) {
        init_view(&lf->views[k], 320, 240);
        draw_view(lf, &lf->views[k], 0);
    }
    s->live->ready = true;
    s->changes.whole = true;
    take(s, 1000000);
    s->changes.whole = false;
}

static void unchanged_parts_are_kept(void **state SST_UNUSED)
{
    const int64_t all = INT64_C(320) * 240;
    const int sets = small_level() >= 2 ? 7 : 14;
    int64_t computed = 0;
    bool removed, toggled;
    struct shown s;
    struct both b;
    const struct sst_image *image, *whole;

    show_box(&s);
    open_both(&b, &s, 9);
    render_both(&b, &s);
    assert_int_equal(b.kept_px, all);
    for (int i = 1; i < sets; i++) {
        const double changed = move_on(&s, i);

        assert_true(changed > 0 && changed < 0.5);
        if (i == 5)
            b.cfg.cut_px = 4.5; /* in the wall */
        if (i == 7)
            b.cfg.remove_label = 5;
        if (i == 8)
            b.cfg.cut_px = 20;
        if (i == 9 || i == 10) {
            assert_int_equal(sst_livepicture_toggle(b.kept, 40 + 9 * i, 100, &removed), 0);
            assert_int_equal(sst_livepicture_toggle(b.exact, 40 + 9 * i, 100, &toggled), 0);
            assert_int_equal(removed, toggled);
        }
        if (i == 12)
            s.live->lf.views[0].present = false;
        take(&s, 1000000 + i * INT64_C(150000000));
        render_both(&b, &s);
        assert_true(i != 5 || b.kept_px == all);
        assert_true(i != 12 || b.kept_px == all);
        if (i < 5)
            computed += b.kept_px;
    }
    assert_true(computed > 0 && computed < 4 * all * 3 / 5);
    assert_true(b.kept_px < all);
    b.cfg.cut_px = 10; /* of the same set */
    render_both(&b, &s);
    assert_int_equal(b.kept_px, all);
    assert_int_equal(sst_livepicture_decorate(b.kept, SST_OUTLINE_ALL, true, &image), 0);
    assert_int_equal(sst_livepicture_decorate(b.exact, SST_OUTLINE_ALL, true, &whole), 0);
    assert_true(same_image(image, whole));
    close_both(&b);
    hide(&s);
}

/* Everything comes nearer in some tiles of all views. */
static void shift_tiles(struct shown *s, int first, int end, int by_q6)
{
    struct sst_lightfield *lf = &s->live->lf;
    const int cols = s->changes.cols;

    for (int at = 0; at < 9 * (end - first); at++) {
        const int k = at / (end - first), i = first + at % (end - first);
        const int x0 = i % cols * SST_LIVE_TILE, y0 = i / cols * SST_LIVE_TILE;

        s->changes.map[k][i] = 1;
        for (int y = y0; y < sst_min_int(y0 + SST_LIVE_TILE, lf->height); y++) {
            uint16_t *disp = sst_map_u16_row(&lf->views[k].disp, y);

            for (int x = x0; x < sst_min_int(x0 + SST_LIVE_TILE, lf->width); x++)
                disp[x] = (uint16_t)(disp[x] == SST_DISP_NONE ? disp[x] : disp[x] + by_q6);
        }
    }
}

/* Where most of a view changes, how far its rays may reach is measured with the next picture that needs it. */
static void views_that_change_are_measured_later(void **state SST_UNUSED)
{
    enum { TILE = 34 };
    const int near_q6 = 24 * SST_DISP_SCALE;
    struct shown s;
    struct both b;
    int64_t px[5];

    show_box(&s);
    open_both(&b, &s, 60);
    for (int i = 0; i < 5; i++) {
        if (i == 0)
            shift_tiles(&s, 0, 1, 40 * SST_DISP_SCALE); /* the range is wide */
        if (i == 1)
            shift_tiles(&s, 1, s.changes.cols * s.changes.rows, 0); /* it might have been anything */
        if (i > 0)
            shift_tiles(&s, TILE, TILE + 1, i % 2 ? near_q6 : -near_q6);
        take(&s, 1000000 + i * INT64_C(150000000));
        render_both(&b, &s);
        px[i] = b.kept_px;
        print_message("%d: %d px\n", i, (int)px[i]);
    }
    assert_int_equal(px[1], 320 * 240);
    assert_true(px[2] > px[3] && px[3] > 0);
    assert_int_equal(px[3], px[4]);
    close_both(&b);
    hide(&s);
}

/* Pictures share the renderer's rays, also with different cuts; one that pauses goes on from its own last picture. */
static void pictures_in_turn_keep_their_own(void **state SST_UNUSED)
{
    struct both near, far;
    struct shown s;

    show_box(&s);
    open_both(&near, &s, 9);
    open_both(&far, &s, 5);
    for (int i = 0; i < 12; i++) {
        if (i)
            (void)move_on(&s, i);
        take(&s, 1000000 + i * INT64_C(150000000));
        if (i != 3 && i != 4 && i != 9)
            render_both(&near, &s);
        if (i == 5)
            far.cfg.cut_px = 9; /* rays are shared from now on */
        if (i == 2 || i == 4 || i >= 5)
            render_both(&far, &s);
        if (i > 6 && i != 10)
            assert_true(far.kept_px < 320 * 240 && near.kept_px < 320 * 240);
    }
    close_both(&near);
    close_both(&far);
    hide(&s);
}

static void outlines_and_other_methods(void **state SST_UNUSED)
{
    struct sst_render_config cfg = clear_config(8), sst;
    const struct sst_image *image;
    struct sst_image plain = { 0 };
    struct sst_livepicture_pick pick;
    struct sst_livepicture *p;
    struct shown s;
    int64_t px;

    show(&s, "pedestrian", 160, 120, 3, false);
    take(&s, 1);
    assert_int_equal(sst_livepicture_create(&p, s.live), 0);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &px), 0);
    assert_int_equal(sst_image_init(&plain, 160, 120), 0);
    for (int c = 0; c < 3; c++)
        memcpy(plain.plane[c], image->plane[c], image->stride * 120);
    assert_int_equal(sst_livepicture_pick(p, 80, 20, &pick), 0);
    assert_true(fabs(pick.disp_px - pick.front_px) < 1); /* the wall, which nothing hides */
    assert_int_equal(sst_livepicture_decorate(p, SST_OUTLINE_ALL, false, &image), 0);
    assert_false(same_image(image, &plain));
    assert_int_equal(sst_livepicture_decorate(p, SST_OUTLINE_NONE, false, &image), 0);
    assert_true(same_image(image, &plain));
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &px), 0);
    assert_true(px == 0 && same_image(image, &plain));
    sst_render_config_defaults(&sst);
    sst.focus_px = 5;
    assert_int_equal(sst_livepicture_render(p, &sst, &image, &px), 0);
    assert_true(px == 160 * 120 && !same_image(image, &plain));
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &px), 0);
    assert_true(px == 160 * 120 && same_image(image, &plain));
    sst_image_fini(&plain);
    sst_livepicture_destroy(p);
    hide(&s);
}

/* --- things removed by a click ------------------------------------------------------------------------------------ */

/* A pixel of the reference view with a label. */
static void find_label(const struct shown *s, int label, int *at_x, int *at_y)
{
    const struct sst_lightfield *lf = &s->live->lf;
    const struct sst_map_u8 *map = &lf->views[lf->ref_view].label;
    int n = 0, x_sum = 0, y_sum = 0;

    for (int y = 0; y < lf->height; y++) {
        for (int x = 0; x < lf->width; x++) {
            if (sst_map_u8_row(map, y)[x] == label) {
                n++;
                x_sum += x;
                y_sum += y;
            }
        }
    }
    assert_true(n > 0);
    *at_x = x_sum / n;
    *at_y = y_sum / n;
}

static void a_click_removes_and_brings_back(void **state SST_UNUSED)
{
    struct sst_render_config cfg = clear_config(INFINITY);
    struct sst_livepicture_clear shown;
    struct sst_image truth = { 0 };
    const struct sst_image *image;
    struct sst_livepicture *p;
    bool removed = false;
    double all;
    struct shown s;
    int64_t px;
    int x, y;

    show(&s, NULL, 160, 120, 6, false);
    assert_int_equal(sst_livepicture_create(&p, s.live), 0);
    assert_int_equal(sst_livepicture_toggle(p, 5, 5, &removed), -ENODATA);
    set_scene(&s, "pedestrian", 0.2);
    take(&s, 1000000);
    find_label(&s, sst_scene_occluder_at(s.scene, 0)->label, &x, &y);
    assert_int_equal(sst_livepicture_toggle(p, -1, 5, &removed), -ERANGE);
    assert_int_equal(sst_livepicture_toggle(p, x, y, &removed), 0);
    assert_true(removed);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &px), 0);
    behind(&s, &truth);
    assert_true(wrong(image, &truth) < 5);
    sst_image_fini(&truth);
    sst_livepicture_clear(p, &shown);
    assert_true(shown.objects == 1 && isnan(shown.cut_px));
    /* It moves on, and stays removed. */
    for (int i = 1; i < 6; i++) {
        set_scene(&s, "pedestrian", 0.2 + 0.05 * i);
        take(&s, 1000000 + i * INT64_C(50000000));
        assert_int_equal(sst_livepicture_render(p, &cfg, &image, &px), 0);
        behind(&s, &truth);
        if (getenv("SST_VERBOSE"))
            printf("followed for %d sets: wrong %.2f %%\n", i, wrong(image, &truth));
        assert_true(wrong(image, &truth) < 5);
        sst_image_fini(&truth);
    }
    find_label(&s, sst_scene_occluder_at(s.scene, 0)->label, &x, &y);
    assert_int_equal(sst_livepicture_toggle(p, x, y, &removed), 0);
    assert_false(removed);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &px), 0);
    assert_true(px > 0);
    all = wrong(image, &s.live->lf.views[s.live->lf.ref_view].image); /* the camera's picture */
    if (getenv("SST_VERBOSE"))
        printf("back: wrong %.2f %%\n", all);
    assert_true(all < 4);
    assert_int_equal(sst_livepicture_toggle(p, x, y, &removed), 0);
    assert_true(removed);
    sst_livepicture_restore(p);
    sst_livepicture_clear(p, &shown);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &px), 0);
    assert_true(px > 0 && wrong(image, &s.live->lf.views[s.live->lf.ref_view].image) < 4);
    sst_livepicture_clear(p, &shown);
    assert_int_equal(shown.objects, 0);
    sst_livepicture_destroy(p);
    hide(&s);
}

/* Where the walker hides the van and the cut removes the walker, a click removes the van, and brings it back. */
static void a_click_goes_through_what_the_cut_removes(void **state SST_UNUSED)
{
    struct sst_livepicture_pick before, after;
    struct sst_livepicture_clear shown;
    struct sst_render_config cfg;
    const struct sst_image *image;
    struct sst_livepicture *p;
    bool removed;
    struct shown s;
    int64_t px;
    int x, y;

    show(&s, "pedestrian", 320, 240, 6, false);
    take(&s, 1000000);
    assert_int_equal(sst_livepicture_create(&p, s.live), 0);
    find_label(&s, sst_scene_occluder_at(s.scene, 0)->label, &x, &y);
    cfg = clear_config(1.4 * sst_scene_occluder_at(s.scene, 0)->focus_px);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &px), 0);
    assert_int_equal(sst_livepicture_pick(p, x, y, &before), 0);
    assert_true(before.front_px > cfg.cut_px && before.disp_px < cfg.cut_px);
    assert_int_equal(sst_livepicture_toggle(p, x, y, &removed), 0);
    assert_true(removed);
    assert_int_equal(sst_livepicture_render(p, &cfg, &image, &px), 0);
    assert_int_equal(sst_livepicture_pick(p, x, y, &after), 0);
    assert_false(fabs(after.disp_px - before.disp_px) < 0.5); /* the walker parts it in two: both are removed */
    sst_livepicture_clear(p, &shown);
    assert_int_equal(shown.objects, 1);
    assert_int_equal(sst_livepicture_toggle(p, x, y, &removed), 0);
    assert_false(removed);
    sst_livepicture_destroy(p);
    hide(&s);
}

/* Vanished objects are forgotten after two seconds; their number is bounded. */
static void objects_are_bounded(void **state SST_UNUSED)
{
    struct picture_objects o;
    struct sst_lightfield *lf;
    bool removed;
    struct shown s;
    int err = 0;

    show(&s, "pedestrian", 160, 120, 3, false);
    take(&s, 1);
    lf = &s.live->lf;
    picture_objects_init(&o, lf->width, lf->height);
    for (int i = 0; i < 9; i++) { /* nine patches of other depths than their surroundings */
        const int x0 = 10 + i % 3 * 40, y0 = 8 + i / 3 * 24;

        for (int y = y0; y < y0 + 8; y++) {
            for (int x = x0; x < x0 + 8; x++)
                sst_map_u16_row(&lf->views[lf->ref_view].disp, y)[x] = (uint16_t)(64 * (20 + i));
        }
        err = picture_objects_toggle(&o, &(struct picture_click){ lf, x0 + 4, y0 + 4, 1, 2 }, &removed);
        assert_int_equal(err, i < 8 ? 0 : -EOVERFLOW);
    }
    assert_int_equal(o.count, SST_LIVEPICTURE_OBJECTS);
    assert_int_equal(picture_objects_toggle(&o, &(struct picture_click){ lf, 14, 12, 1, 2 }, &removed), 0);
    assert_false(removed);
    set_scene(&s, "pedestrian", 0); /* the patches are gone */
    assert_int_equal(picture_objects_follow(&o, lf, INT64_C(1000000000), 2), 0);
    assert_int_equal(o.count, SST_LIVEPICTURE_OBJECTS - 1);
    assert_int_equal(picture_objects_follow(&o, lf, INT64_C(2100000000), 2), 0);
    assert_int_equal(o.count, 0);
    picture_objects_fini(&o);
    hide(&s);
}

/* Set by set a thing would run along a surface that comes nearer and nearer. */
static void objects_do_not_creep(void **state SST_UNUSED)
{
    struct picture_objects o;
    struct sst_lightfield *lf;
    bool removed;
    struct shown s;
    double first_px;
    int first;

    show(&s, "pedestrian", 160, 120, 3, false);
    take(&s, 1);
    lf = &s.live->lf;
    picture_objects_init(&o, lf->width, lf->height);
    for (int y = 0; y < lf->height; y++) { /* of one colour, a quarter of a pixel a column */
        for (int c = 0; c < 3; c++)
            memset(sst_image_row(&lf->views[lf->ref_view].image, c, y), 90, (size_t)lf->width);
        for (int x = 0; x < lf->width; x++)
            sst_map_u16_row(&lf->views[lf->ref_view].disp, y)[x] = (uint16_t)(16 * x);
    }
    assert_int_equal(picture_objects_toggle(&o, &(struct picture_click){ lf, 80, 60, 1, 2 }, &removed), 0);
    assert_true(removed);
    first = o.object[0].area;
    first_px = o.object[0].near_px - o.object[0].far_px;
    for (int i = 2; i < 30; i++)
        assert_int_equal(picture_objects_follow(&o, lf, i, 2), 0);
    assert_int_equal(o.count, 1);
    assert_true(o.object[0].area <= 3 * first);
    assert_true(o.object[0].near_px - o.object[0].far_px <= first_px + 1e-9);
    picture_objects_fini(&o);
    hide(&s);
}

/* --- cut and histogram -------------------------------------------------------------------------------------------- */

static void the_cut_stays_when_the_walker_has_left(void **state SST_UNUSED)
{
    float share[SST_LIVE_HISTOGRAM];
    double min_px, max_px, sum = 0, cut = NAN;
    struct shown s;

    show(&s, NULL, 160, 120, 6, true);
    assert_true(isnan(sst_live_cut(s.live)));
    assert_false(sst_live_histogram(s.live, &min_px, &max_px, share));
    for (int i = 0; i < 25; i++) {
        set_scene(&s, "pedestrian", 0.1 * i);
        take(&s, 1 + i * INT64_C(100000000));
        if (isnan(cut))
            cut = sst_live_cut(s.live);
        else
            assert_true(sst_live_cut(s.live) >= cut); /* it never cuts off surfaces that do not stand in front */
    }
    assert_false(isnan(cut));
    assert_true(sst_live_histogram(s.live, &min_px, &max_px, share));
    for (int i = 0; i < SST_LIVE_HISTOGRAM; i++)
        sum += (double)share[i];
    assert_float_equal(sum, 1, 1e-4);
    assert_true(min_px < max_px);
    hide(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        plain_test(a_walker_vanishes_and_leaves_nothing),
        thread_test(threads_do_not_matter),
        cmocka_unit_test(unchanged_parts_are_kept),
        cmocka_unit_test(views_that_change_are_measured_later),
        serial_test(pictures_in_turn_keep_their_own),
        serial_test(outlines_and_other_methods),
        serial_test(a_click_removes_and_brings_back),
        plain_test(a_click_goes_through_what_the_cut_removes),
        serial_test(objects_are_bounded),
        serial_test(objects_do_not_creep),
        serial_test(the_cut_stays_when_the_walker_has_left),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
