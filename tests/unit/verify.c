/* Verified rays: a bush with maps that know nothing behind it, good maps, foci without a surface. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread.h"
#include "pipeline/eval/eval.h"
#include "pipeline/method/disparity/disparity.h"
#include "pipeline/method/render/render_internal.h"
#include "pipeline/method/render/verify.h"
#include "simulators/scene/noise.h"
#include "simulators/scene/scene.h"
#include "tests/small.h"
#include "tests/test.h"

#define WIDTH  258 /* more than one run of cells, and no multiple of anything */
#define HEIGHT 150
#define SIDE   5

struct field {
    struct sst_scene *scene;
    struct sst_lightfield lf;
    struct sst_image behind, plain, verified;
    struct sst_map_u8 mask; /* hidden share of the surface in focus */
    double focus_px;
};

static int make_view(void *arg, int k, int worker SST_UNUSED)
{
    struct field *f = arg;
    struct sst_view *v = &f->lf.views[k];
    struct sst_map_f32 disp = { 0 };
    int err = sst_map_f32_init(&disp, WIDTH, HEIGHT);

    err = err ? err : sst_image_init(&v->image, WIDTH, HEIGHT);
    err = err ? err : sst_map_u16_init(&v->disp, WIDTH, HEIGHT);
    err = err ? err : sst_map_u8_init(&v->label, WIDTH, HEIGHT);
    err = err ? err
              : sst_scene_render(f->scene, v->bx, v->by, 0,
                                 &(struct sst_scene_maps){ .image = &v->image, .disp = &disp, .label = &v->label });
    for (int y = 0; !err && y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++)
            sst_map_u16_row(&v->disp, y)[x] = sst_disp_q6(&f->lf, sst_map_f32_row(&disp, y)[x]);
    }
    sst_map_f32_fini(&disp);
    return err;
}

static void draw_field(struct field *f, const char *name)
{
    struct sst_scene_config cfg;
    struct sst_map_f32 with = { 0 }, without = { 0 };

    sst_scene_config_defaults(&cfg);
    cfg.width = WIDTH;
    cfg.height = HEIGHT;
    cfg.rows = cfg.cols = SIDE;
    assert_int_equal(sst_scene_create(&f->scene, name, &cfg), 0);
    assert_int_equal(sst_lightfield_init(&f->lf, SIDE, SIDE), 0);
    f->lf.width = WIDTH;
    f->lf.height = HEIGHT;
    sst_scene_range(f->scene, &f->lf.range_min_px, &f->lf.range_max_px);
    f->lf.disp_min_px = floor(f->lf.range_min_px);
    f->focus_px = sst_scene_occluder_at(f->scene, 0)->focus_px;
    for (int k = 0; k < SIDE * SIDE; k++)
        f->lf.views[k].present = true;
    assert_int_equal(sst_parallel_for(SIDE * SIDE, 2, make_view, f), 0);
    assert_int_equal(sst_image_init(&f->behind, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&f->mask, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_f32_init(&with, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_map_f32_init(&without, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_scene_render(f->scene, 0, 0, 0, &(struct sst_scene_maps){ .disp = &with }), 0);
    assert_int_equal(
        sst_scene_render(f->scene, 0, 0, 1, &(struct sst_scene_maps){ .image = &f->behind, .disp = &without }), 0);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            const float d = sst_map_f32_row(&without, y)[x];

            sst_map_u8_row(&f->mask, y)[x] =
                fabsf(sst_map_f32_row(&with, y)[x] - d) > 0.5f && fabs((double)d - f->focus_px) < 0.7 ? 255 : 0;
        }
    }
    sst_map_f32_fini(&with);
    sst_map_f32_fini(&without);
}

static void copy_image(struct sst_image *to, const struct sst_image *from)
{
    assert_int_equal(sst_image_init(to, WIDTH, HEIGHT), 0);
    for (int c = 0; c < 3; c++)
        memcpy(to->plane[c], from->plane[c], from->stride * HEIGHT);
}

static void copy_mask(struct sst_map_u8 *to, const struct sst_map_u8 *from)
{
    assert_int_equal(sst_map_u8_init(to, WIDTH, HEIGHT), 0);
    memcpy(to->data, from->data, from->stride * HEIGHT);
}

/* Each scene is drawn, and matched, once; tests change copies. */
static struct drawn {
    const char *name;
    struct field field;
} drawn[] = { { .name = "bush" }, { .name = "pedestrian" } };

static struct field matched_bush; /* with the maps of match_field() */

static void copy_field(struct field *f, const struct field *d)
{
    *f = (struct field){ .focus_px = d->focus_px };
    assert_int_equal(sst_lightfield_init(&f->lf, SIDE, SIDE), 0);
    f->lf.width = WIDTH;
    f->lf.height = HEIGHT;
    f->lf.range_min_px = d->lf.range_min_px;
    f->lf.range_max_px = d->lf.range_max_px;
    f->lf.disp_min_px = d->lf.disp_min_px;
    for (int k = 0; k < SIDE * SIDE; k++) {
        struct sst_view *to = &f->lf.views[k];
        const struct sst_view *from = &d->lf.views[k];

        to->present = true;
        copy_image(&to->image, &from->image);
        assert_int_equal(sst_map_u16_init(&to->disp, WIDTH, HEIGHT), 0);
        memcpy(to->disp.data, from->disp.data, from->disp.stride * HEIGHT);
        copy_mask(&to->label, &from->label);
        if (from->confidence.data)
            copy_mask(&to->confidence, &from->confidence);
    }
    copy_image(&f->behind, &d->behind);
    copy_mask(&f->mask, &d->mask);
    assert_int_equal(sst_image_init(&f->plain, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_image_init(&f->verified, WIDTH, HEIGHT), 0);
}

static void open_field(struct field *f, const char *name)
{
    struct field *d = &drawn[strcmp(name, drawn[0].name) != 0].field;

    if (!d->scene)
        draw_field(d, name);
    copy_field(f, d);
}

static void close_field(struct field *f)
{
    sst_image_fini(&f->behind);
    sst_image_fini(&f->plain);
    sst_image_fini(&f->verified);
    sst_map_u8_fini(&f->mask);
    sst_lightfield_fini(&f->lf);
    sst_scene_destroy(f->scene);
}

/* Maps as half-size matching makes them in dense leaves: blocks of 12 px take the nearest surface in them. */
static void spoil_maps(struct field *f)
{
    for (int k = 0; k < SIDE * SIDE; k++) {
        struct sst_view *v = &f->lf.views[k];

        for (int y0 = 0; y0 < HEIGHT; y0 += 12) {
            for (int x0 = 0; x0 < WIDTH; x0 += 12) {
                const int x1 = sst_min_int(x0 + 12, WIDTH), y1 = sst_min_int(y0 + 12, HEIGHT);
                uint16_t most = 0;
                uint8_t label = 0;

                for (int i = 0; i < (y1 - y0) * (x1 - x0); i++) {
                    const int x = x0 + i % (x1 - x0), y = y0 + i / (x1 - x0);

                    if (sst_map_u16_row(&v->disp, y)[x] >= most) {
                        most = sst_map_u16_row(&v->disp, y)[x];
                        label = sst_map_u8_row(&v->label, y)[x];
                    }
                }
                for (int i = 0; i < (y1 - y0) * (x1 - x0); i++) {
                    sst_map_u16_row(&v->disp, y0 + i / (x1 - x0))[x0 + i % (x1 - x0)] = most;
                    sst_map_u8_row(&v->label, y0 + i / (x1 - x0))[x0 + i % (x1 - x0)] = label;
                }
            }
        }
    }
}

static void render(struct sst_image *out, const struct field *f, double focus_px, enum sst_render_verify verify,
                   int threads)
{
    struct sst_render_config cfg;
    struct sst_renderer *r;

    sst_render_config_defaults(&cfg);
    cfg.focus_px = focus_px;
    cfg.verify = verify;
    cfg.threads = threads;
    assert_int_equal(sst_renderer_create(&r, &f->lf, 2), 0);
    assert_int_equal(sst_render(r, &cfg, out, NULL), 0);
    sst_renderer_destroy(r);
}

static void render_both(struct field *f, double focus_px)
{
    render(&f->plain, f, focus_px, SST_VERIFY_OFF, 2);
    render(&f->verified, f, focus_px, SST_VERIFY_ON, 2);
}

static void assert_same_image(const struct sst_image *a, const struct sst_image *b)
{
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < a->height; y++)
            assert_memory_equal(sst_image_row(a, c, y), sst_image_row(b, c, y), (size_t)a->width);
    }
}

static int forget_fields(void **state SST_UNUSED)
{
    for (size_t i = 0; i < ARRAY_LEN(drawn); i++)
        close_field(&drawn[i].field);
    close_field(&matched_bush);
    return 0;
}

static void poor_maps_no_longer_hide_what_is_behind(void **state SST_UNUSED)
{
    double plain_db, verified_db, plain_ssim, verified_ssim;
    struct field f;

    open_field(&f, "bush");
    spoil_maps(&f);
    render_both(&f, f.focus_px);
    plain_db = sst_psnr(&f.plain, &f.behind, &f.mask);
    verified_db = sst_psnr(&f.verified, &f.behind, &f.mask);
    assert_int_equal(sst_ssim(&plain_ssim, &f.plain, &f.behind, &f.mask), 0);
    assert_int_equal(sst_ssim(&verified_ssim, &f.verified, &f.behind, &f.mask), 0);
    print_message("bush, poor maps: %.2f dB, SSIM %.3f; verified %.2f dB, %.3f\n", plain_db, plain_ssim, verified_db,
                  verified_ssim);
    assert_true(verified_db > plain_db + 3);
    assert_true(verified_ssim > plain_ssim + 0.1);
    for (int threads = 1; threads < 4; threads++) {
        render(&f.plain, &f, f.focus_px, SST_VERIFY_ON, threads);
        assert_same_image(&f.plain, &f.verified);
    }
    close_field(&f);
}

/* Views that are missing, that saw a part only, with a soft aperture and a viewpoint beside the middle. */
static void missing_rays_have_no_say(void **state SST_UNUSED)
{
    struct sst_render_config cfg;
    struct sst_map_u8 valid = { 0 };
    struct sst_renderer *r;
    struct field f;

    open_field(&f, "bush");
    spoil_maps(&f);
    f.lf.views[0].present = f.lf.views[7].present = false;
    for (int k = 1; k < SIDE * SIDE; k += 3) {
        struct sst_view *v = &f.lf.views[k];

        assert_int_equal(sst_map_u8_init(&v->valid, WIDTH, HEIGHT), 0);
        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++) {
                const bool seen = x > 9 && y > 5 + x / 40 && x < WIDTH - 17;

                sst_map_u8_row(&v->valid, y)[x] = seen ? 255 : 0;
                for (int c = 0; c < 3 && !seen; c++)
                    sst_image_row(&v->image, c, y)[x] = 0;
            }
        }
    }
    sst_render_config_defaults(&cfg);
    cfg.focus_px = f.focus_px;
    cfg.verify = SST_VERIFY_OFF;
    cfg.threads = 2;
    cfg.aperture = 2.4;
    cfg.aperture_soft = true;
    cfg.view_bx = 0.4;
    assert_int_equal(sst_map_u8_init(&valid, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_renderer_create(&r, &f.lf, 2), 0);
    assert_int_equal(sst_render(r, &cfg, &f.plain, &valid), 0);
    cfg.verify = SST_VERIFY_ON;
    assert_int_equal(sst_render(r, &cfg, &f.verified, &valid), 0);
    sst_renderer_destroy(r);
    /* Nothing is black here but unseen pixels: their blackness does not get a vote. */
    for (int y = 8; y < HEIGHT - 8; y++) {
        for (int x = 0; x < WIDTH; x++)
            assert_true(sst_image_row(&f.verified, 0, y)[x] || sst_image_row(&f.verified, 1, y)[x]);
    }
    sst_map_u8_fini(&valid);
    close_field(&f);
}

static void good_maps_decide_alone(void **state SST_UNUSED)
{
    struct field f;

    open_field(&f, "pedestrian");
    render_both(&f, f.focus_px);
    print_message("pedestrian, true maps: %.2f dB, verified %.2f dB\n", sst_psnr(&f.plain, &f.behind, &f.mask),
                  sst_psnr(&f.verified, &f.behind, &f.mask));
    assert_true(sst_psnr(&f.verified, &f.behind, &f.mask) > sst_psnr(&f.plain, &f.behind, &f.mask) - 0.1);
    /* Nothing is in front of the nearest surface: surfaces out of focus stay blurred. */
    render_both(&f, f.lf.range_max_px);
    assert_same_image(&f.plain, &f.verified);
    close_field(&f);
}

/* --- where maps are poor by their own account --------------------------------------------------------------------- */

/* Maps of the first pass, which closes gaps, and their confidences; labels stay true. */
static void match_field(struct field *f)
{
    struct sst_disparity_config cfg;

    assert_int_equal(sst_disparity_preset(&cfg, "balanced"), 0);
    cfg.rounds = 0;
    cfg.disp_min_px = floor(f->lf.range_min_px);
    cfg.disp_max_px = ceil(f->lf.range_max_px);
    cfg.threads = 2;
    assert_int_equal(sst_disparity_lightfield(&f->lf, &cfg, NULL, NULL), 0);
}

static void open_matched_bush(struct field *f)
{
    if (!matched_bush.lf.views) {
        open_field(&matched_bush, "bush");
        match_field(&matched_bush);
    }
    copy_field(f, &matched_bush);
}

static double db(const struct sst_image *img, const struct field *f)
{
    return sst_psnr(img, &f->behind, &f->mask);
}

static void matched_leaves_no_longer_hide_what_is_behind(void **state SST_UNUSED)
{
    double plain_ssim, ssim;
    struct field f;

    open_matched_bush(&f);
    render(&f.plain, &f, f.focus_px, SST_VERIFY_OFF, 2);
    render(&f.verified, &f, f.focus_px, SST_VERIFY_AUTO, 1);
    assert_int_equal(sst_ssim(&plain_ssim, &f.plain, &f.behind, &f.mask), 0);
    assert_int_equal(sst_ssim(&ssim, &f.verified, &f.behind, &f.mask), 0);
    print_message("bush, matched: %.2f dB, SSIM %.3f; auto %.2f dB, %.3f\n", db(&f.plain, &f), plain_ssim,
                  db(&f.verified, &f), ssim);
    assert_true(db(&f.verified, &f) > db(&f.plain, &f) + 2);
    assert_true(ssim > plain_ssim + 0.05);
    for (int threads = 2; threads < 4; threads++) {
        render(&f.plain, &f, f.focus_px, SST_VERIFY_AUTO, threads);
        assert_same_image(&f.plain, &f.verified);
    }
    close_field(&f);
}

/* Findings of one picture serve the next one; other views find out for themselves. */
static void pictures_of_one_renderer_are_those_of_many(void **state SST_UNUSED)
{
    struct sst_render_config cfg;
    struct sst_renderer *kept, *fresh;
    struct field f;

    open_matched_bush(&f);
    sst_render_config_defaults(&cfg);
    cfg.verify = SST_VERIFY_AUTO;
    assert_int_equal(sst_renderer_create(&kept, &f.lf, 2), 0);
    for (int i = 0; i < 6; i++) {
        cfg.focus_px = f.focus_px + i / 2 % 2;
        cfg.max_views = i % 2 ? 9 : 0;
        cfg.threads = 1 + i % 3;
        assert_int_equal(sst_renderer_create(&fresh, &f.lf, 2), 0);
        assert_int_equal(sst_render(kept, &cfg, &f.plain, NULL), 0);
        assert_int_equal(sst_render(fresh, &cfg, &f.verified, NULL), 0);
        assert_same_image(&f.plain, &f.verified);
        sst_renderer_destroy(fresh);
    }
    sst_renderer_destroy(kept);
    close_field(&f);
}

static void good_matches_decide_alone(void **state SST_UNUSED)
{
    struct field f;

    open_field(&f, "pedestrian");
    match_field(&f);
    render(&f.plain, &f, f.focus_px, SST_VERIFY_OFF, 2);
    render(&f.verified, &f, f.focus_px, SST_VERIFY_AUTO, 2);
    print_message("pedestrian, matched: %.2f dB, auto %.2f dB\n", db(&f.plain, &f), db(&f.verified, &f));
    assert_true(db(&f.verified, &f) > db(&f.plain, &f) - 0.1);
    close_field(&f);
}

static void tested_maps_are_trusted(void **state SST_UNUSED)
{
    struct field f;

    open_matched_bush(&f);
    assert_false(f.lf.disparity_tested);
    f.lf.disparity_tested = true;
    render(&f.plain, &f, f.focus_px, SST_VERIFY_OFF, 2);
    render(&f.verified, &f, f.focus_px, SST_VERIFY_AUTO, 2);
    assert_same_image(&f.plain, &f.verified);
    close_field(&f);
}

static void external_maps_are_trusted(void **state SST_UNUSED)
{
    struct sst_renderer *r;
    struct field f;

    open_field(&f, "bush");
    render(&f.plain, &f, f.focus_px, SST_VERIFY_OFF, 2);
    render(&f.verified, &f, f.focus_px, SST_VERIFY_AUTO, 2);
    assert_same_image(&f.plain, &f.verified);
    assert_int_equal(sst_renderer_create(&r, &f.lf, 2), 0);
    assert_true(isnan(sst_renderer_confirmed(r)));
    sst_renderer_destroy(r);
    close_field(&f);
}

static void confirmed_disparities_are_counted(void **state SST_UNUSED)
{
    struct sst_lightfield lf;
    struct sst_view *v;

    assert_int_equal(sst_lightfield_init(&lf, 1, 3), 0);
    v = &lf.views[1];
    assert_true(isnan(sst_lightfield_confirmed(&lf, 2)));
    assert_int_equal(sst_map_u8_init(&v->confidence, 40, 33), 0);
    for (int y = 0; y < 33; y++)
        memset(sst_map_u8_row(&v->confidence, y), y == 5 ? 0 : 1 + y, 40);
    assert_true(fabs(sst_lightfield_confirmed(&lf, 2) - 32.0 / 33) < 1e-12);
    /* Pixels that the view did not see do not count. */
    assert_int_equal(sst_map_u8_init(&v->valid, 40, 33), 0);
    for (int y = 0; y < 33; y++)
        memset(sst_map_u8_row(&v->valid, y), y != 5 ? 255 : 0, 40);
    assert_true(sst_lightfield_confirmed(&lf, 1) >= 1);
    sst_lightfield_fini(&lf);
}

/* --- which rays are explained ------------------------------------------------------------------------------------- */

#define NEAR_PX 8
#define FAR_PX  2

/* 3x3 views of 64x48: columns 20 to 39 of the reference are near, the rest is far, all of random colours; the map of
 * the middle view extends near surfaces by six columns. */
static void make_rim(struct sst_lightfield *lf, unsigned noise)
{
    uint64_t seed = 3;

    assert_int_equal(sst_lightfield_init(lf, 3, 3), 0);
    lf->width = 64;
    lf->height = 48;
    lf->range_max_px = NEAR_PX + 1;
    for (int i = 0; i < 9 * 64 * 48; i++) {
        const int k = i / (64 * 48), x = i % 64, y = i / 64 % 48;
        struct sst_view *v = &lf->views[k];
        const int bx = (int)v->bx, by = (int)v->by;
        const bool near = x + NEAR_PX * bx >= 20 && x + NEAR_PX * bx < 40;
        const int d = near ? NEAR_PX : FAR_PX;
        const uint32_t colour = sst_noise_hash(x + d * bx, y + d * by, d, 5);

        if (!v->present) {
            v->present = true;
            assert_int_equal(sst_image_init(&v->image, 64, 48), 0);
            assert_int_equal(sst_map_u16_init(&v->disp, 64, 48), 0);
            assert_int_equal(sst_map_u8_init(&v->confidence, 64, 48), 0);
        }
        for (int c = 0; c < 3; c++)
            sst_image_row(&v->image, c, y)[x] =
                (uint8_t)((colour >> 8 * c & 127) + 32 + (noise ? sst_random_u64(&seed) % noise : 0));
        sst_map_u16_row(&v->disp, y)[x] = sst_disp_q6(lf, k == 4 && x >= 20 && x < 46 ? NEAR_PX : d);
    }
}

static void rays_beside_a_rim_are_not_explained_by_it(void **state SST_UNUSED)
{
    for (unsigned noise = 0; noise <= 24; noise += 24) {
        struct sst_render_config cfg;
        struct sst_render_plan plan;
        struct sst_lightfield lf;
        struct sst_renderer *r;
        int wrong = 0;

        make_rim(&lf, noise);
        sst_render_config_defaults(&cfg);
        cfg.focus_px = FAR_PX;
        cfg.threads = 2;
        assert_int_equal(sst_renderer_create(&r, &lf, 2), 0);
        assert_int_equal(sst_render_plan_init(&plan, r, &cfg), 0);
        assert_non_null(plan.explainer);
        assert_int_equal(explainer_prepare(plan.explainer), 0);
        for (int y = 10; y < 38; y++) {
            for (int x = 20; x < 46; x++) {
                const bool near = x < 40;

                wrong += explainer_contradicts(plan.explainer, 4, x, y) == near;
            }
        }
        print_message("noise %u: %d of %d rays\n", noise, wrong, 28 * 26);
        assert_true(wrong <= (noise ? 28 * 26 / 20 : 0));
        sst_render_plan_fini(&plan);
        sst_renderer_destroy(r);
        sst_lightfield_fini(&lf);
    }
}

/* A view that did not see a place, and one that is missing, say nothing about it. */
static void unseen_places_explain_nothing(void **state SST_UNUSED)
{
    struct sst_render_config cfg;
    struct sst_render_plan plan;
    struct sst_lightfield lf;
    struct sst_renderer *r;

    make_rim(&lf, 0);
    for (int k = 0; k < 9; k++) {
        if (k != 4 && k != 1)
            assert_int_equal(sst_map_u8_init(&lf.views[k].valid, 64, 48), 0);
    }
    lf.views[0].present = false;
    sst_render_config_defaults(&cfg);
    cfg.focus_px = FAR_PX;
    assert_int_equal(sst_renderer_create(&r, &lf, 1), 0);
    assert_int_equal(sst_render_plan_init(&plan, r, &cfg), 0);
    assert_int_equal(plan.tap[3].view, 4);
    assert_int_equal(explainer_prepare(plan.explainer), 0);
    assert_false(explainer_contradicts(plan.explainer, 3, 30, 20)); /* by view 1 alone */
    assert_true(explainer_contradicts(plan.explainer, 3, 42, 20));
    assert_true(explainer_contradicts(plan.explainer, 3, 30, 44)); /* view 1 shows it beyond its last row */
    /* One colour everywhere: no view contradicts. */
    for (int i = 0; i < 3 * 9 * 48; i++)
        memset(sst_image_row(&lf.views[i / 3 % 9].image, i % 3, i / 27), 90, 64);
    assert_false(explainer_contradicts(plan.explainer, 3, 30, 20));
    sst_render_plan_fini(&plan);
    sst_renderer_destroy(r);
    sst_lightfield_fini(&lf);
}

static void rarity_is_that_of_the_pixels(void **state SST_UNUSED)
{
    static uint8_t rarity[SST_AGREE_BINS], other[SST_AGREE_BINS];
    const int views[] = { 0, 3 };
    struct field f;

    open_field(&f, "pedestrian");
    for (int i = 0; i < 2; i++) {
        for (int c = 0; c < 3; c++) {
            for (int y = 0; y < HEIGHT; y++)
                memset(sst_image_row(&f.lf.views[views[i]].image, c, y), c == 0 ? 200 : 40, WIDTH);
        }
    }
    sst_rarity_count(rarity, &f.lf, views, 2, 3);
    assert_int_equal(rarity[0], 255);
    /* All pixels in one bin, of which smoothing leaves an eighth: 512 times the mean. */
    assert_int_equal(rarity[12 << 8 | 2 << 4 | 2], (int)(255 * log(1 + 15 / 512.02) / log(751) + 0.5));
    assert_false(sst_rarity_differs(rarity, rarity, 0));
    sst_rarity_count(other, &f.lf, (const int[]){ 1, 2 }, 2, 3);
    assert_true(sst_rarity_differs(rarity, other, 0.25));
    sst_rarity_count(other, &f.lf, views, 0, 3); /* no view: everything is rare */
    assert_int_equal(other[77], 255);
    assert_false(sst_rarity_differs(other, other, 0));
    close_field(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        serial_test(poor_maps_no_longer_hide_what_is_behind),
        cmocka_unit_test(missing_rays_have_no_say),
        plain_test(good_maps_decide_alone),
        serial_test(matched_leaves_no_longer_hide_what_is_behind),
        serial_test(pictures_of_one_renderer_are_those_of_many),
        plain_test(good_matches_decide_alone),
        serial_test(tested_maps_are_trusted),
        serial_test(external_maps_are_trusted),
        serial_test(confirmed_disparities_are_counted),
        serial_test(rays_beside_a_rim_are_not_explained_by_it),
        cmocka_unit_test(unseen_places_explain_nothing),
        serial_test(rarity_is_that_of_the_pixels),
    };

    return cmocka_run_group_tests(tests, NULL, forget_fields);
}
