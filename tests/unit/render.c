/* pipeline/method/render/: hand-worked weights and pixels, equalities, and pictures against a plain renderer in double.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <errno.h>
#include <fenv.h>
#include <malloc.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/border.h"
#include "base/log.h"
#include "base/mem.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/lightfield/correction.h"
#include "pipeline/method/render/plan.h"
#include "tests/render_views.h"
#include "tests/small.h"

static void depth_weight_by_hand(void **state SST_UNUSED)
{
    /* One sigma off: 0.9 e^-0.5 + 0.1 = 0.9 * 0.60653066 + 0.1. */
    assert_near(sst_weight_depth(10, 12, 2, 0.1), 0.645877594, 1e-9);
    assert_near(sst_weight_depth(10, 8, 2, 0.1), 0.645877594, 1e-9);
    assert_near(sst_weight_depth(-3, -3, 0.5, 0), 1, 0);
    assert_near(sst_weight_depth(0, 1000, 1, 0.25), 0.25, 0);
    assert_near(sst_weight_depth(0, 1000, INFINITY, 0), 1, 0);
    assert_near(sst_weight_depth(0, 1000, 1, 1), 1, 0);
    assert_near(sst_weight_depth(0, NAN, 1, 0.25), 0.25, 0);
    assert_near(sst_weight_depth(0, NAN, INFINITY, 0.25), 1, 0);
}

static void label_weight_by_hand(void **state SST_UNUSED)
{
    /* Range 4..8, focus 5: -(5-4)(5-8) / 2^2 = 0.75; 0.8 * 0.75 + 0.2 = 0.8. */
    assert_near(sst_weight_label(5, 4, 8, 1.0 / 64, 0.2), 0.8, 1e-15);
    assert_near(sst_weight_label(6, 4, 8, 1.0 / 64, 0.2), 1, 0);
    assert_near(sst_weight_label(4, 4, 8, 1.0 / 64, 0.2), 0.2, 0);
    assert_near(sst_weight_label(9, 4, 8, 1.0 / 64, 0.2), 0.2, 0);
    assert_near(sst_weight_label(9, 4, 8, 1.0 / 64, 1), 1, 0);
    /* No range: one quantum around the middle, half of it 1/128; 1/256 off is half way: 1 - 0.25. */
    assert_near(sst_weight_label(6, 6, 6, 1.0 / 64, 0), 1, 0);
    assert_near(sst_weight_label(6 + 1.0 / 256, 6, 6, 1.0 / 64, 0), 0.75, 1e-12);
    assert_near(sst_weight_label(6 + 1.0 / 64, 6, 6, 1.0 / 64, 0), 0, 0);
}

static void histogram_range_by_hand(void **state SST_UNUSED)
{
    const uint64_t count[] = { 0, 1, 0, 98, 0, 1, 0 }, pair[] = { 3, 0, 3 };
    int lo, hi;

    assert_true(sst_render_histogram_range(count, 0, 7, 0, &lo, &hi));
    assert_true(lo == 1 && hi == 5);
    assert_true(sst_render_histogram_range(count, 0, 7, 0.01, &lo, &hi));
    assert_true(lo == 3 && hi == 3);
    assert_true(sst_render_histogram_range(count, 4, 7, 0.5, &lo, &hi));
    assert_true(lo == 5 && hi == 5);
    assert_true(sst_render_histogram_range(pair, 0, 3, 0.5, &lo, &hi));
    assert_true(lo == 0 && hi == 2);
    assert_false(sst_render_histogram_range(count, 6, 7, 0, &lo, &hi));
    assert_false(sst_render_histogram_range(count, 3, 3, 0, &lo, &hi));
}

/* Columns hold 16 bins. Peaks around columns 10 and 30, nothing between 12 and 28: the smoothed counts are 0 from 15 to
 * 25 (two columns of smoothing), with the middle 20. */
static void histogram_objects_by_hand(void **state SST_UNUSED)
{
    uint64_t count[1000] = { 0 };
    int end[SST_BLEND_COLUMNS];

    assert_int_equal(sst_render_histogram_objects(count, 1000, end), 1);
    for (int c = 8; c <= 12; c++)
        count[c * 16] = 100;
    assert_int_equal(sst_render_histogram_objects(count, 1000, end), 1);
    for (int c = 28; c <= 32; c++)
        count[c * 16 + 3] = 50;
    assert_int_equal(sst_render_histogram_objects(count, 1000, end), 2);
    assert_int_equal(end[0], 21);
    assert_int_equal(end[1], SST_BLEND_COLUMNS);
    /* A bridge of more than a fifth of the lower peak joins them. */
    for (int c = 13; c < 28; c++)
        count[c * 16] = 12;
    assert_int_equal(sst_render_histogram_objects(count, 1000, end), 1);
    /* Two pixels of 752 are no object of their own. */
    for (int c = 13; c < 28; c++)
        count[c * 16] = 0;
    count[50 * 16] = 2;
    assert_int_equal(sst_render_histogram_objects(count, 1000, end), 2);
    assert_int_equal(end[1], SST_BLEND_COLUMNS);
    /* The same below the first object. */
    count[50 * 16] = 0;
    count[0] = 2;
    assert_int_equal(sst_render_histogram_objects(count, 1000, end), 2);
    assert_int_equal(end[0], 21);
}

/* Two views one spacing apart, focus 1: pixel x meets view 1 at x - 1. sigma 1, C1 = 0, C2 = 1: weights 1, e^-0.5. */
static void picture_by_hand(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(1);
    struct sst_lightfield lf;
    struct sst_image out;

    make_views(&lf, 1, 2, 3, 1);
    for (int x = 0; x < 3; x++) {
        set_pixel(&lf, 0, x, 0, 100, 1, 1);
        set_pixel(&lf, 1, x, 0, 200 + x, 2, 2);
    }
    cfg.sigma_px = 1;
    cfg.c1 = 0;
    cfg.c2 = 1;
    assert_int_equal(render(&lf, &cfg, &out, NULL), 0);
    /* (100 + 0.60653 * 200) / 1.60653 = 137.754; view 1 has no pixel for x = 0; its value is 201 for x = 2: 138.13. */
    assert_int_equal(out.plane[0][0], 100);
    assert_int_equal(out.plane[0][1], 138);
    assert_int_equal(out.plane[0][2], 138);
    sst_image_fini(&out);
    /* Focused on label 1, view 1 weighs half of 0.60653: (100 + 0.30327 * 200) / 1.30327 = 123.27. */
    cfg.focus_label = 1;
    assert_int_equal(render(&lf, &cfg, &out, NULL), 0);
    assert_int_equal(out.plane[0][1], 123);
    sst_image_fini(&out);
    /* Unlabeled rays are not reduced. */
    sst_map_u8_row(&lf.views[1].label, 0)[0] = 0;
    assert_int_equal(render(&lf, &cfg, &out, NULL), 0);
    assert_int_equal(out.plane[0][1], 138);
    sst_image_fini(&out);
    /* Plain refocusing at 0.5: pixel 1 meets view 1 at 0.5, half way between 200 and 201. */
    cfg = config(0.5);
    cfg.method = SST_RENDER_REFOCUS;
    assert_int_equal(render(&lf, &cfg, &out, NULL), 0);
    assert_int_equal(out.plane[0][0], 100);
    assert_int_equal(out.plane[0][1], 150);
    sst_image_fini(&out);
    free_views(&lf);
}

/* The plainest renderer: no tables, no plan, double throughout. */
static double naive_range_weight(const struct sst_lightfield *lf, const struct sst_render_config *cfg, int label)
{
    double lo = INFINITY, hi = -INFINITY;

    for (int i = 0; i < lf->rows * lf->cols; i++) {
        for (int y = 0; lf->views[i].present && y < lf->height; y++) {
            for (int x = 0; x < lf->width; x++) {
                const uint16_t q = sst_map_u16_row(&lf->views[i].disp, y)[x];

                if (sst_map_u8_row(&lf->views[i].label, y)[x] == label && q != SST_DISP_NONE) {
                    lo = fmin(lo, sst_disp_px(lf, q));
                    hi = fmax(hi, sst_disp_px(lf, q));
                }
            }
        }
    }
    return sst_weight_label(cfg->focus_px, lo, hi, 1.0 / 64, cfg->c2);
}

static double naive_pixel(const struct sst_lightfield *lf, const struct sst_render_config *cfg, const double *w_label,
                          int c, int x, int y)
{
    double sum = 0, weight = 0;

    for (int i = 0; i < lf->rows * lf->cols; i++) {
        const struct sst_view *v = &lf->views[i];
        const double px = x - cfg->focus_px * (v->bx - cfg->view_bx), py = y - cfg->focus_px * (v->by - cfg->view_by);
        const int x0 = (int)floor(px), y0 = (int)floor(py), nx = (int)floor(px + 0.5), ny = (int)floor(py + 0.5);
        const double fx = px - x0, fy = py - y0;
        double colour, w = 1;
        uint16_t q;

        if (!v->present || hypot(v->bx - cfg->view_bx, v->by - cfg->view_by) > cfg->aperture || px < 0 || py < 0 ||
            px > lf->width - 1 || py > lf->height - 1)
            continue;
        colour = (1 - fy) * ((1 - fx) * sst_image_row(&v->image, c, y0)[x0] +
                             (fx > 0 ? fx * sst_image_row(&v->image, c, y0)[x0 + 1] : 0));
        if (fy > 0)
            colour += fy * ((1 - fx) * sst_image_row(&v->image, c, y0 + 1)[x0] +
                            (fx > 0 ? fx * sst_image_row(&v->image, c, y0 + 1)[x0 + 1] : 0));
        if (cfg->method == SST_RENDER_SST) {
            q = sst_map_u16_row(&v->disp, ny)[nx];
            w = w_label[sst_map_u8_row(&v->label, ny)[nx]] *
                sst_weight_depth(cfg->focus_px, q == SST_DISP_NONE ? NAN : sst_disp_px(lf, q), cfg->sigma_px, cfg->c1);
        }
        sum += w * colour;
        weight += w;
    }
    return weight > 0 ? sum / weight : NAN;
}

static void compare_with_naive(const struct sst_lightfield *lf, const struct sst_render_config *cfg)
{
    double w_label[256] = { 1 };
    struct sst_image out;

    for (int i = 1; i < 5; i++)
        w_label[i] =
            naive_range_weight(lf, cfg, i) / (cfg->focus_label && cfg->focus_label != i ? cfg->label_factor : 1);
    assert_int_equal(render(lf, cfg, &out, NULL), 0);
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < lf->height; y++) {
            for (int x = 0; x < lf->width; x++) {
                const double want = naive_pixel(lf, cfg, w_label, c, x, y);

                if (!isnan(want))
                    assert_near(sst_image_row(&out, c, y)[x], want, 0.5 + 0.02); /* rounded, and colours in 1/128 */
            }
        }
    }
    sst_image_fini(&out);
}

static void pictures_equal_the_naive_renderer(void **state SST_UNUSED)
{
    static const double focus[] = { 0, 1, -2.37, 2.5, 4.7123 };
    struct sst_lightfield lf;

    make_random(&lf);
    for (size_t i = 0; i < ARRAY_LEN(focus); i++) {
        struct sst_render_config cfg = config(focus[i]);

        cfg.range = SST_RANGE_MINMAX;
        compare_with_naive(&lf, &cfg);
        cfg.sigma_px = 0.11; /* most weights vanish as floats */
        cfg.c1 = 0;
        cfg.c2 = 0.5;
        cfg.focus_label = 2;
        compare_with_naive(&lf, &cfg);
        cfg.view_bx = 0.3;
        cfg.view_by = -0.7;
        cfg.aperture = 1.3;
        compare_with_naive(&lf, &cfg);
        cfg.method = SST_RENDER_REFOCUS;
        compare_with_naive(&lf, &cfg);
    }
    free_views(&lf);
}

static void equal_weights_are_plain_refocusing(void **state SST_UNUSED)
{
    struct sst_lightfield lf;

    make_random(&lf);
    for (int i = 0; i < 2; i++) {
        struct sst_render_config cfg = config(1.3);
        struct sst_image plain, sst;

        cfg.method = SST_RENDER_REFOCUS;
        assert_int_equal(render(&lf, &cfg, &plain, NULL), 0);
        cfg.method = SST_RENDER_SST;
        cfg.c2 = 1;
        cfg.c1 = i ? 1 : 0.25;
        cfg.sigma_px = i ? 1 : INFINITY;
        assert_int_equal(render(&lf, &cfg, &sst, NULL), 0);
        assert_same_image(&plain, &sst);
        sst_image_fini(&sst);
        /* The limit is approached, not only short-cut. */
        cfg.c1 = i ? 1 - 1e-9 : 0.25;
        cfg.sigma_px = i ? 1 : 1e7;
        for (int v = 0; v < 9; v++) {
            for (int y = 0; lf.views[v].present && y < lf.height; y++) {
                for (int x = 0; x < lf.width; x++)
                    sst_map_u16_row(&lf.views[v].disp, y)[x] %= SST_DISP_NONE;
            }
        }
        assert_int_equal(render(&lf, &cfg, &sst, NULL), 0);
        for (int y = 0; y < lf.height; y++) {
            for (int x = 0; x < lf.width; x++)
                assert_true(abs(sst_image_row(&sst, 0, y)[x] - sst_image_row(&plain, 0, y)[x]) <= 1);
        }
        sst_image_fini(&sst);
        sst_image_fini(&plain);
    }
    free_views(&lf);
}

static void threads_and_levels_do_not_matter(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(1.7);
    struct sst_lightfield lf;
    struct sst_image first, other;

    make_random(&lf);
    cfg.threads = 1;
    assert_int_equal(render(&lf, &cfg, &first, NULL), 0);
    for (cfg.threads = 2; cfg.threads < 6; cfg.threads++) {
        assert_int_equal(render(&lf, &cfg, &other, NULL), 0);
        assert_same_image(&first, &other);
        sst_image_fini(&other);
    }
    sst_image_fini(&first);
    free_views(&lf);
}

/* Any cells, in a picture of which no side is a multiple of theirs: rendered as in the whole, the others left alone. */
static void parts_equal_the_whole(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(1.7);
    struct sst_lightfield lf;
    struct sst_renderer *r;
    struct sst_image whole, part = { 0 };
    struct sst_render_plan plan;

    make_random(&lf);
    cfg.threads = 2;
    assert_int_equal(render(&lf, &cfg, &whole, NULL), 0);
    assert_int_equal(sst_renderer_create(&r, &lf, 1), 0);
    assert_int_equal(sst_render_plan_init(&plan, r, &cfg), 0);
    assert_int_equal(sst_image_init(&part, lf.width, lf.height), 0);
    for (int pattern = 1; pattern < 16; pattern++) {
        const int cols = (lf.width + SST_RENDER_CELL_WIDTH - 1) / SST_RENDER_CELL_WIDTH;
        const int rows = (lf.height + SST_RENDER_CELL_HEIGHT - 1) / SST_RENDER_CELL_HEIGHT;
        uint8_t *cells = calloc((size_t)(cols * rows), 1);

        assert_non_null(cells);
        for (int i = 0; i < cols * rows; i++)
            cells[i] = (pattern >> (i % 4)) & 1;
        for (int c = 0; c < 3; c++)
            memset(part.plane[c], 77, part.stride * (size_t)part.height);
        assert_int_equal(sst_render_plan_render(&plan, cells, &part, NULL), 0);
        for (int y = 0; y < lf.height; y++) {
            for (int x = 0; x < lf.width; x++) {
                const bool made = cells[y / SST_RENDER_CELL_HEIGHT * cols + x / SST_RENDER_CELL_WIDTH];

                for (int c = 0; c < 3; c++)
                    assert_int_equal(sst_image_row(&part, c, y)[x], made ? sst_image_row(&whole, c, y)[x] : 77);
            }
        }
        free(cells);
    }
    sst_render_plan_fini(&plan);
    sst_renderer_destroy(r);
    sst_image_fini(&part);
    sst_image_fini(&whole);
    free_views(&lf);
}

/* One label near (8 px) and far (2 px), a target of another label at 4: by label both weigh 1, by object only C2. */
static void objects_have_their_own_range(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(4);
    struct sst_renderer *r;
    struct sst_ray rays[SST_MAX_VIEWS];
    struct sst_lightfield lf;
    int count;

    make_views(&lf, 1, 2, 40, 1);
    for (int x = 0; x < 40; x++) {
        set_pixel(&lf, 0, x, 0, 50, x < 20 ? 2 : 8, 6);
        set_pixel(&lf, 1, x, 0, 50, 4, 9);
    }
    cfg.c2 = 0.1;
    cfg.range_margin_px = 0.5;
    assert_int_equal(sst_renderer_create(&r, &lf, 1), 0);
    assert_true((count = sst_render_rays(r, &cfg, 30, 0, rays)) >= 0);
    assert_int_equal(count, 2);
    assert_near(rays[0].w_label, 0.1, 1e-7);
    assert_near(rays[1].w_label, 1, 1e-7);
    assert_near(rays[0].share + rays[1].share, 1, 1e-12);
    /* By label: 2..8 around 5, half 3: 1 - 1/9; 0.9 * 0.888889 + 0.1. The target's range is one quantum, in focus. */
    cfg.range = SST_RANGE_MINMAX;
    assert_true((count = sst_render_rays(r, &cfg, 30, 0, rays)) >= 0);
    assert_near(rays[0].w_label, 0.9, 1e-7);
    assert_near(rays[1].w_label, 1, 1e-7);
    /* Half a quantum beside the focus the paper's form loses the target, the margin keeps it. */
    cfg.focus_px = 4.25;
    assert_true((count = sst_render_rays(r, &cfg, 30, 0, rays)) >= 0);
    assert_near(rays[1].w_label, 0.1, 1e-7);
    cfg.range = SST_RANGE_OBJECT;
    assert_true((count = sst_render_rays(r, &cfg, 30, 0, rays)) >= 0);
    assert_near(rays[1].w_label, 0.1 + 0.9 * 0.75, 1e-7);
    sst_renderer_destroy(r);
    free_views(&lf);
}

static void apertures_choose_views(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(0);
    struct sst_ray rays[SST_MAX_VIEWS];
    struct sst_renderer *r;
    struct sst_lightfield lf;
    int count;

    make_views(&lf, 5, 5, 3, 3);
    cfg.method = SST_RENDER_REFOCUS;
    assert_int_equal(sst_renderer_create(&r, &lf, 1), 0);
    assert_true((count = sst_render_rays(r, &cfg, 1, 1, rays)) >= 0);
    assert_int_equal(count, 25);
    cfg.aperture = 1;
    assert_true((count = sst_render_rays(r, &cfg, 1, 1, rays)) >= 0);
    assert_int_equal(count, 5);
    cfg.aperture_soft = true; /* the rim is at 1.5: cos^2(60 degrees) = 0.25 beside 1 */
    assert_true((count = sst_render_rays(r, &cfg, 1, 1, rays)) >= 0);
    assert_near(rays[2].share, 0.5, 1e-12);
    assert_near(rays[0].share, 0.125, 1e-12);
    cfg.aperture = INFINITY;
    cfg.aperture_soft = false;
    cfg.max_views = 2; /* the centre, and the first of the four at distance 1: the one above */
    assert_true((count = sst_render_rays(r, &cfg, 1, 1, rays)) >= 0);
    assert_int_equal(count, 2);
    assert_true(rays[0].view == 7 && rays[1].view == 12);
    sst_renderer_destroy(r);
    free_views(&lf);
}

static void impossible_wishes_are_refused(void **state SST_UNUSED)
{
    struct sst_render_config cfg;
    struct sst_lightfield lf;
    struct sst_image out;

    make_random(&lf);
    sst_log_set_level((enum sst_log_level) - 1);
    cfg = config(900);
    assert_int_equal(render(&lf, &cfg, &out, NULL), -ERANGE);
    sst_image_fini(&out);
    cfg = config(NAN);
    fedisableexcept(FE_INVALID); /* comparing it is one */
    assert_int_equal(render(&lf, &cfg, &out, NULL), -EINVAL);
    feclearexcept(FE_INVALID);
    feenableexcept(FE_INVALID);
    sst_image_fini(&out);
    cfg = config(1);
    cfg.sigma_px = -1;
    assert_int_equal(render(&lf, &cfg, &out, NULL), -EINVAL);
    sst_image_fini(&out);
    cfg = config(1);
    cfg.view_bx = 50;
    cfg.aperture = 1;
    assert_int_equal(render(&lf, &cfg, &out, NULL), -ERANGE);
    sst_image_fini(&out);
    sst_map_u16_fini(&lf.views[8].disp);
    cfg = config(1);
    assert_int_equal(render(&lf, &cfg, &out, NULL), -ENODATA);
    sst_image_fini(&out);
    sst_log_set_level(SST_LOG_WARNING);
    free_views(&lf);
}

/* Disparities 2..47: sigma is 45 / 10 = 4.5, so a ray 4.5 off the focus weighs 0.995 e^-0.5 + 0.005. The range of its
 * label, one value, is widened by 45 / 50 = 0.9 at each end: half that off, 1 - 0.25, 0.98 * 0.75 + 0.02. */
static void defaults_follow_the_disparities(void **state SST_UNUSED)
{
    struct sst_render_config cfg;
    struct sst_ray rays[SST_MAX_VIEWS];
    struct sst_renderer *r;
    struct sst_lightfield lf;
    struct sst_map_f32 w_depth = { 0 }, w_label = { 0 };
    int count;

    assert_int_equal(sst_map_f32_init(&w_depth, 3, 1), 0);
    assert_int_equal(sst_map_f32_init(&w_label, 3, 1), 0);
    make_views(&lf, 1, 1, 3, 1);
    set_pixel(&lf, 0, 0, 0, 9, 2, 1);
    set_pixel(&lf, 0, 1, 0, 9, 8, 2);
    set_pixel(&lf, 0, 2, 0, 9, 47, 3);
    sst_render_config_defaults(&cfg);
    assert_int_equal(sst_renderer_create(&r, &lf, 1), 0);
    cfg.focus_px = 12.5;
    assert_true((count = sst_render_rays(r, &cfg, 1, 0, rays)) >= 0);
    assert_near(rays[0].w_depth, 0.995 * 0.60653066 + 0.005, 1e-8);
    assert_near(rays[0].w_label, 0.02, 1e-8);
    assert_int_equal(sst_render_weights(r, &cfg, 0, &w_depth, &w_label), 0);
    assert_near(w_depth.data[1], 0.995 * 0.60653066 + 0.005, 1e-6);
    assert_near(w_label.data[1], 0.02, 1e-6);
    cfg.focus_px = 8.45;
    assert_true((count = sst_render_rays(r, &cfg, 1, 0, rays)) >= 0);
    assert_near(rays[0].w_label, 0.755, 1e-7);
    sst_map_f32_fini(&w_depth);
    sst_map_f32_fini(&w_label);
    sst_renderer_destroy(r);
    free_views(&lf);
}

static void one_view_is_that_view(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(2.2);
    struct sst_lightfield lf;
    struct sst_image out;

    make_random(&lf);
    cfg.max_views = 1;
    cfg.view_bx = lf.views[4].bx;
    cfg.view_by = lf.views[4].by;
    assert_int_equal(render(&lf, &cfg, &out, NULL), 0);
    assert_same_image(&out, &lf.views[4].image);
    sst_image_fini(&out);
    free_views(&lf);
}

/* The table has room for a row a label; unused rows hold earlier contents of the memory. */
static void unused_rows_cross_no_border(void **state SST_UNUSED)
{
    const size_t bytes = (size_t)257 * SST_BLEND_COLUMNS * sizeof(float);
    const struct sst_render_config cfg = config(1);
    struct sst_lightfield lf;
    struct sst_image img;

    if (!mallopt(M_MMAP_THRESHOLD, 32 << 20) || !mallopt(M_TRIM_THRESHOLD, 64 << 20)) {
        print_message("left out: the address sanitizer does not use memory again\n");
        skip();
    }
    make_random(&lf);
    for (int i = 0; i < 4; i++) {
        void *before[2] = { sst_mem_alloc_raw(bytes, 1), sst_mem_alloc_raw(bytes, 1) };

        for (int k = 0; k < 2; k++) {
            assert_non_null(before[k]);
            memset(before[k], 0xFF, bytes); /* NaN */
            sst_mem_free(before[k]);
        }
        assert_int_equal(render(&lf, &cfg, &img, NULL), 0);
        sst_image_fini(&img);
    }
    assert_int_equal(sst_border_count(), 0);
    free_views(&lf);
}

/* Lanczos, a = 3, at x from its centre. */
static double lanczos(double x)
{
    if (fabs(x) >= 3)
        return 0;
    return fabs(x) < 1e-9 ? 1 : 3 * sin(M_PI * x) * sin(M_PI * x / 3) / (M_PI * M_PI * x * x);
}

/* Both ways, the weights' sum 1. */
static double interpolated(const struct sst_image *image, int channel, double x, double y)
{
    const int x0 = (int)floor(x), y0 = (int)floor(y);
    double sum = 0, weights = 0;

    for (int j = y0 - 2; j <= y0 + 3; j++) {
        for (int i = x0 - 2; i <= x0 + 3; i++) {
            const double weight = lanczos(x - i) * lanczos(y - j);

            sum +=
                weight * sst_image_row(image, channel,
                                       sst_clamp_int(j, 0, image->height - 1))[sst_clamp_int(i, 0, image->width - 1)];
            weights += weight;
        }
    }
    return fmin(fmax(sum / weights, 0), 255);
}

/* Of a picture that was moved by 0.4, 0.7 px, seen 1 and 1.3 px beside it: the bytes of the corrected picture at whole
 * positions, its original interpolated once elsewhere. */
static void originals_are_sampled_once(void **state SST_UNUSED)
{
    struct sst_correction c = sst_correction_none();
    struct sst_render_config cfg = config(1);
    struct sst_lightfield lf;
    struct sst_image img, original;
    uint64_t seed = 3;

    make_views(&lf, 1, 1, 40, 30);
    lf.views[0].bx = 0;
    for (int i = 0; i < 3 * 30 * 40; i++)
        sst_image_row(&lf.views[0].image, i / 1200, i / 40 % 30)[i % 40] = (uint8_t)(sst_random_u64(&seed) % 100 + 80);
    assert_int_equal(sst_image_init(&original, 40, 30), 0);
    for (int i = 0; i < 90; i++)
        memcpy(sst_image_row(&original, i / 30, i % 30), sst_image_row(&lf.views[0].image, i / 30, i % 30), 40);
    c.shift_x_px = 0.4;
    c.shift_y_px = -0.7;
    assert_int_equal(sst_lightfield_correct(NULL, &lf, &c, 1), 0);
    assert_false(sst_lightfield_has_originals(&lf));
    lf.views[0].original = original;
    assert_true(sst_lightfield_has_originals(&lf));
    cfg.method = SST_RENDER_REFOCUS;
    for (int i = 0; i < 2; i++) {
        const double beside = i ? 1.3 : 1;

        cfg.view_bx = beside;
        assert_int_equal(render(&lf, &cfg, &img, NULL), 0);
        for (int y = 4; y < 26; y++) {
            for (int x = 4; x < 34; x++) {
                const double want = interpolated(&lf.views[0].original, 1, x + beside + 0.4, y - 0.7);
                const int got = sst_image_row(&img, 1, y)[x];

                if (fabs(got - want) > 1.5) /* positions in 1/256 px, light in between */
                    fail_msg("%d for %.2f at %d %d beside %g", got, want, x, y, beside);
                assert_true(i || got == sst_image_row(&lf.views[0].image, 1, y)[x + 1]);
            }
        }
        sst_image_fini(&img);
    }
    sst_image_fini(&lf.views[0].original);
    sst_map_u8_fini(&lf.views[0].valid);
    free(lf.correction);
    free_views(&lf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(depth_weight_by_hand),
        cmocka_unit_test(label_weight_by_hand),
        cmocka_unit_test(histogram_range_by_hand),
        cmocka_unit_test(histogram_objects_by_hand),
        cmocka_unit_test(picture_by_hand),
        cmocka_unit_test(pictures_equal_the_naive_renderer),
        cmocka_unit_test(equal_weights_are_plain_refocusing),
        thread_test(threads_and_levels_do_not_matter),
        cmocka_unit_test(parts_equal_the_whole),
        cmocka_unit_test(objects_have_their_own_range),
        cmocka_unit_test(apertures_choose_views),
        cmocka_unit_test(impossible_wishes_are_refused),
        cmocka_unit_test(defaults_follow_the_disparities),
        cmocka_unit_test(one_view_is_that_view),
        cmocka_unit_test(unused_rows_cross_no_border),
        cmocka_unit_test(originals_are_sampled_once),
    };

    feenableexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
