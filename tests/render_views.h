/* tests/render_views.h - light fields of a few pixels, set one by one or random, and pictures of them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_RENDER_VIEWS_H
#define SST_TESTS_RENDER_VIEWS_H

#include <math.h>
#include <stdlib.h>

#include "pipeline/method/render/render.h"
#include "simulators/scene/noise.h"
#include "tests/test.h"

#define UNKNOWN (-1000.0) /* outside what can be stored, so SST_DISP_NONE */

static inline void make_views(struct sst_lightfield *lf, int rows, int cols, int width, int height)
{
    *lf = (struct sst_lightfield){
        .rows = rows, .cols = cols, .width = width, .height = height, .ref_view = (rows - 1) / 2 * cols + (cols - 1) / 2
    };
    lf->views = calloc((size_t)(rows * cols), sizeof(*lf->views));
    assert_non_null(lf->views);
    for (int i = 0; i < rows * cols; i++) {
        struct sst_view *v = &lf->views[i];

        v->present = true;
        v->bx = i % cols - (cols - 1) / 2;
        v->by = i / cols - (rows - 1) / 2;
        assert_int_equal(sst_image_init(&v->image, width, height), 0);
        assert_int_equal(sst_map_u16_init(&v->disp, width, height), 0);
        assert_int_equal(sst_map_u8_init(&v->label, width, height), 0);
    }
}

static inline void free_view(struct sst_view *v)
{
    sst_image_fini(&v->image);
    sst_map_u16_fini(&v->disp);
    sst_map_u8_fini(&v->label);
    v->present = false;
}

static inline void free_views(struct sst_lightfield *lf)
{
    for (int i = 0; i < lf->rows * lf->cols; i++)
        free_view(&lf->views[i]);
    free(lf->views);
}

static inline void set_pixel(struct sst_lightfield *lf, int view, int x, int y, int grey, double disp_px, int label)
{
    for (int c = 0; c < 3; c++)
        sst_image_row(&lf->views[view].image, c, y)[x] = (uint8_t)(grey >> c);
    sst_map_u16_row(&lf->views[view].disp, y)[x] = sst_disp_q6(lf, disp_px);
    sst_map_u8_row(&lf->views[view].label, y)[x] = (uint8_t)label;
}

/* 3x3 views with measured offsets and a hole, negative disparities, unknown ones and unlabeled pixels. */
static inline void make_random(struct sst_lightfield *lf)
{
    uint64_t seed = 7;

    make_views(lf, 3, 3, 41, 29);
    lf->disp_min_px = -4;
    for (int i = 0; i < 9; i++) {
        lf->views[i].bx += (i % 4 - 2) * 0.013;
        lf->views[i].by -= (i % 5 - 2) * 0.017;
        for (int y = 0; y < 29; y++) {
            for (int x = 0; x < 41; x++) {
                const double d = sst_random_u64(&seed) % 9 ? -3 + (double)(sst_random_u64(&seed) % 500) / 64 : UNKNOWN;

                set_pixel(lf, i, x, y, (int)(sst_random_u64(&seed) % 256), d, (int)(sst_random_u64(&seed) % 5));
            }
        }
    }
    free_view(&lf->views[5]);
}

static inline struct sst_render_config config(double focus_px)
{
    struct sst_render_config cfg;

    sst_render_config_defaults(&cfg);
    cfg.focus_px = focus_px;
    cfg.sigma_px = 1;
    cfg.c1 = 0.001;
    cfg.c2 = 0.1;
    cfg.range_margin_px = 1;
    cfg.threads = 2;
    return cfg;
}

static inline int render(const struct sst_lightfield *lf, const struct sst_render_config *cfg, struct sst_image *out,
                         struct sst_map_u8 *valid)
{
    struct sst_renderer *r;
    int err;

    assert_int_equal(sst_renderer_create(&r, lf, 2), 0);
    assert_int_equal(sst_image_init(out, lf->width, lf->height), 0);
    if (valid)
        assert_int_equal(sst_map_u8_init(valid, lf->width, lf->height), 0);
    err = sst_render(r, cfg, out, valid);
    sst_renderer_destroy(r);
    return err;
}

static inline void assert_same_image(const struct sst_image *a, const struct sst_image *b)
{
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < a->height; y++)
            assert_memory_equal(sst_image_row(a, c, y), sst_image_row(b, c, y), (size_t)a->width);
    }
}

#define assert_near(a, b, tolerance)                                                                                   \
    do {                                                                                                               \
        const double a_ = (a), b_ = (b);                                                                               \
                                                                                                                       \
        if (!(fabs(a_ - b_) <= (tolerance)))                                                                           \
            fail_msg("%s is %.10g, not %.10g", #a, a_, b_);                                                            \
    } while (0)

#endif
