/* pipeline/method/render/: which pixels of a picture rays support, by definition and by hand, and what the others show.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <fenv.h>
#include <math.h>

#include "pipeline/method/render/plan.h"
#include "tests/render_views.h"

/* The definition, from the weights of one ray. */
static bool ends_at_focus(const struct sst_ray *ray, const struct sst_render_config *cfg)
{
    const double factor = cfg->focus_label && ray->label && ray->label != cfg->focus_label ? cfg->label_factor : 1;
    const bool by_depth = isfinite(cfg->sigma_px) && cfg->c1 < 1, by_label = cfg->c2 < 1 && ray->label;

    const double disp_px = isnan(ray->disp_px) ? 1e6 : ray->disp_px;

    return (!by_depth || fabs(disp_px - cfg->focus_px) <= 2 * cfg->sigma_px) &&
           (!by_label || ray->w_label * factor > cfg->c2 * (1 + 1e-6));
}

/* @return the number of supported pixels */
static int check_support(const struct sst_lightfield *lf, const struct sst_render_config *cfg)
{
    struct sst_ray rays[SST_MAX_VIEWS];
    struct sst_render_plan plan;
    struct sst_renderer *r;
    struct sst_image out;
    struct sst_map_u8 valid;
    int supported = 0;

    assert_int_equal(render(lf, cfg, &out, &valid), 0);
    assert_int_equal(sst_renderer_create(&r, lf, 1), 0);
    assert_int_equal(sst_render_plan_init(&plan, r, cfg), 0);
    for (int i = 0; i < lf->width * lf->height; i++) {
        const int x = i % lf->width, y = i / lf->width;
        double rgb[3];
        int count, want = 0;

        count = sst_render_pixel_exact(&plan, x, y, rgb, rays);
        for (int k = 0; k < count; k++)
            want = plan.weighted && !ends_at_focus(&rays[k], &plan.cfg) ? want : 255;
        if (sst_map_u8_row(&valid, y)[x] != want)
            fail_msg("focus %g, pixel %d,%d: %d, not %d", cfg->focus_px, x, y, sst_map_u8_row(&valid, y)[x], want);
        supported += want != 0;
    }
    sst_render_plan_fini(&plan);
    sst_renderer_destroy(r);
    sst_image_fini(&out);
    sst_map_u8_fini(&valid);
    return supported;
}

static void support_is_that_of_the_rays(void **state SST_UNUSED)
{
    static const double focus[] = { -4.2, -2.37, 0, 1, 4.7123, 6 };
    struct sst_lightfield lf;

    make_random(&lf);
    for (size_t i = 0; i < 8 * ARRAY_LEN(focus); i++) {
        struct sst_render_config cfg = config(focus[i / 8]);

        cfg.sigma_px = i % 8 < 6 ? 0.15 : INFINITY;
        cfg.c1 = i % 8 == 1 ? 1 : i % 8 == 2 ? 0 : 0.001;
        cfg.c2 = i % 2 ? 0.1 : i % 8 == 4 ? 1 : 0;
        cfg.range = i % 3 ? SST_RANGE_OBJECT : SST_RANGE_MINMAX;
        cfg.range_margin_px = i % 5 ? 0.2 : 0;
        cfg.focus_label = i % 8 == 3 ? 2 : 0;
        cfg.view_bx = i % 8 == 5 ? 0.3 : 0;
        check_support(&lf, &cfg);
    }
    free_views(&lf);
}

/* 3x3 views of an occluder at 8 px that leaves a column of the target at 2 px free in one view. */
static void floors_are_no_support(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(2);
    struct sst_map_u8 valid;
    struct sst_lightfield lf;
    struct sst_image out, marked;

    make_views(&lf, 3, 3, 30, 20);
    for (int i = 0; i < 9 * 30 * 20; i++) {
        const bool target = i / 600 == 4 && i % 30 == 12;

        set_pixel(&lf, i / 600, i % 30, i / 30 % 20, target ? 200 : 80, target ? 2 : 8, target ? 4 : 3);
    }
    assert_int_equal(check_support(&lf, &cfg), 20);
    cfg.c2 = 1; /* by depth alone */
    assert_int_equal(check_support(&lf, &cfg), 20);
    cfg = config(2);
    cfg.sigma_px = INFINITY; /* by label alone */
    assert_int_equal(check_support(&lf, &cfg), 20);
    cfg.c2 = 1; /* plain refocusing: all that is seen */
    assert_int_equal(check_support(&lf, &cfg), 600);
    cfg.method = SST_RENDER_REFOCUS;
    assert_int_equal(check_support(&lf, &cfg), 600);
    cfg = config(2);
    assert_int_equal(render(&lf, &cfg, &out, NULL), 0);
    cfg.unsupported = SST_UNSUPPORTED_INVALID;
    assert_int_equal(render(&lf, &cfg, &marked, &valid), 0);
    for (int x = 0; x < 30; x++) {
        assert_int_equal(sst_map_u8_row(&valid, 9)[x], x == 12 ? 255 : 0);
        assert_int_equal(sst_image_row(&marked, 0, 9)[x], x == 12 ? sst_image_row(&out, 0, 9)[12] : 0);
        assert_true(sst_image_row(&out, 0, 9)[x] >= 80);
    }
    sst_image_fini(&marked);
    assert_int_equal(render(&lf, &cfg, &marked, NULL), 0); /* marked without a mask as well */
    assert_int_equal(sst_image_row(&marked, 0, 9)[0], 0);
    sst_image_fini(&marked);
    sst_image_fini(&out);
    sst_map_u8_fini(&valid);
    free_views(&lf);
}

/* All rays at least 400 sigma from the focus: the nearest decides; e^-80000 is no number in double either. */
static void far_rays_still_make_a_picture(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(0);
    struct sst_map_u8 valid;
    struct sst_lightfield lf;
    struct sst_image out;

    make_views(&lf, 1, 3, 2, 1);
    for (int x = 0; x < 2; x++) {
        set_pixel(&lf, 0, x, 0, 10, 4.5, 0);
        set_pixel(&lf, 1, x, 0, 20, 4, 0);
        set_pixel(&lf, 2, x, 0, 30, 4, 0);
    }
    lf.range_max_px = 10;
    cfg.sigma_px = 0.01;
    cfg.c1 = cfg.c2 = 0;
    assert_int_equal(render(&lf, &cfg, &out, &valid), 0);
    assert_int_equal(out.plane[0][0], 25);
    assert_int_equal(valid.data[0], 0); /* of the nearest, which do not end at the focus */
    sst_image_fini(&out);
    sst_map_u8_fini(&valid);
    cfg.sigma_px = 1e-6;
    assert_int_equal(render(&lf, &cfg, &out, NULL), 0);
    assert_int_equal(out.plane[0][0], 25);
    sst_image_fini(&out);
    free_views(&lf);
}

static void unsupported_pixels_are_said(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(2);
    struct sst_map_u8 valid;
    struct sst_lightfield lf;
    struct sst_image out;

    /* Label 3 spans 8..9, the focus is 2: W_s = C2 = 0. */
    make_views(&lf, 1, 2, 4, 1);
    for (int x = 0; x < 4; x++) {
        set_pixel(&lf, 0, x, 0, 50, 8, 3);
        set_pixel(&lf, 1, x, 0, 70, 9, 3);
    }
    lf.range_max_px = 10;
    cfg.c1 = cfg.c2 = 0;
    for (int invalid = 0; invalid < 2; invalid++) {
        cfg.unsupported = invalid ? SST_UNSUPPORTED_INVALID : SST_UNSUPPORTED_REFOCUS;
        assert_int_equal(render(&lf, &cfg, &out, &valid), 0);
        for (int x = 0; x < 4; x++) {
            assert_int_equal(valid.data[x], 0);
            assert_int_equal(out.plane[0][x], invalid ? 0 : x < 2 ? 50 : 60);
        }
        sst_image_fini(&out);
        sst_map_u8_fini(&valid);
    }
    /* Unknown depth and C1 = 0 give no support either; one ray with a depth is enough. */
    for (int x = 0; x < 4; x++) {
        set_pixel(&lf, 0, x, 0, 50, UNKNOWN, 0);
        set_pixel(&lf, 1, x, 0, 70, x ? UNKNOWN : 3, 0);
    }
    assert_int_equal(render(&lf, &cfg, &out, &valid), 0);
    assert_true(valid.data[1] == 0 && valid.data[2] == 255 && valid.data[3] == 0);
    assert_int_equal(out.plane[0][2], 70);
    sst_image_fini(&out);
    sst_map_u8_fini(&valid);
    free_views(&lf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(support_is_that_of_the_rays),
        cmocka_unit_test(floors_are_no_support),
        cmocka_unit_test(far_rays_still_make_a_picture),
        cmocka_unit_test(unsupported_pixels_are_said),
    };

    feenableexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
