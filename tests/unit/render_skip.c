/* Pictures with skips: exact without them, within the budget with them, hard fields, counters, threads. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread.h"
#include "pipeline/method/render/render_internal.h"
#include "simulators/scene/scene.h"
#include "tests/small.h"
#include "tests/test.h"

#define WIDTH  262 /* two tiles and a narrow one */
#define HEIGHT 170 /* five rows of tiles and a low one: a row for lambda and others */
#define SIDE   5

struct field {
    struct sst_scene *scene; /* NULL: drawn here */
    struct sst_lightfield lf;
    struct sst_renderer *renderer;
    double focus_px;
};

static int make_view(void *arg, int k, int worker SST_UNUSED)
{
    struct field *f = arg;
    struct sst_view *v = &f->lf.views[k];
    struct sst_map_f32 disp = { 0 };
    int err = sst_map_f32_init(&disp, f->lf.width, f->lf.height);

    err = err ? err
              : sst_scene_render(f->scene, v->bx, v->by, 0,
                                 &(struct sst_scene_maps){ .image = &v->image, .disp = &disp, .label = &v->label });
    for (int y = 0; !err && y < f->lf.height; y++) {
        for (int x = 0; x < f->lf.width; x++)
            sst_map_u16_row(&v->disp, y)[x] = sst_disp_q6(&f->lf, sst_map_f32_row(&disp, y)[x]);
    }
    sst_map_f32_fini(&disp);
    return err;
}

/* Views of zeros. */
static void open_empty(struct field *f, int rows, int cols, int width, int height)
{
    *f = (struct field){ 0 };
    assert_int_equal(sst_lightfield_init(&f->lf, rows, cols), 0);
    f->lf.width = width;
    f->lf.height = height;
    for (int k = 0; k < rows * cols; k++) {
        struct sst_view *v = &f->lf.views[k];

        v->present = true;
        assert_int_equal(sst_image_init(&v->image, width, height), 0);
        assert_int_equal(sst_map_u16_init(&v->disp, width, height), 0);
        assert_int_equal(sst_map_u8_init(&v->label, width, height), 0);
    }
}

static void open_renderer(struct field *f)
{
    assert_int_equal(sst_renderer_create(&f->renderer, &f->lf, 2), 0);
}

static void open_scene(struct field *f, const char *name)
{
    struct sst_scene_config cfg;

    open_empty(f, SIDE, SIDE, WIDTH, HEIGHT);
    sst_scene_config_defaults(&cfg);
    cfg.width = WIDTH;
    cfg.height = HEIGHT;
    cfg.rows = cfg.cols = SIDE;
    assert_int_equal(sst_scene_create(&f->scene, name, &cfg), 0);
    sst_scene_range(f->scene, &f->lf.range_min_px, &f->lf.range_max_px);
    f->lf.disp_min_px = floor(f->lf.range_min_px);
    f->focus_px = sst_scene_occluder_at(f->scene, 0)->focus_px;
    assert_int_equal(sst_parallel_for(SIDE * SIDE, 2, make_view, f), 0);
    open_renderer(f);
}

static void close_field(struct field *f)
{
    sst_renderer_destroy(f->renderer);
    sst_lightfield_fini(&f->lf);
    sst_scene_destroy(f->scene);
}

/* Fill a view with noise around a level at one disparity. */
static void paint(struct field *f, int k, int level, int spread, double disp_px, int label)
{
    struct sst_view *v = &f->lf.views[k];
    uint32_t seed = (uint32_t)k * 2654435761U + 1;

    for (int y = 0; y < f->lf.height; y++) {
        for (int x = 0; x < f->lf.width; x++) {
            seed = seed * 1664525 + 1013904223;
            for (int c = 0; c < 3; c++)
                sst_image_row(&v->image, c, y)[x] =
                    (uint8_t)sst_clamp_int(level + (spread ? (int)(seed >> 16) % spread - spread / 2 : 0), 0, 255);
            sst_map_u16_row(&v->disp, y)[x] = sst_disp_q6(&f->lf, (float)disp_px);
            sst_map_u8_row(&v->label, y)[x] = (uint8_t)label;
        }
    }
}

struct pair {
    struct sst_image exact, made;
    struct sst_map_u8 exact_valid, valid;
    double db;
    int most; /* largest difference */
};

static struct sst_render_config config_of(const struct field *f)
{
    struct sst_render_config cfg;

    sst_render_config_defaults(&cfg);
    cfg.focus_px = f->focus_px;
    cfg.verify = SST_VERIFY_OFF;
    cfg.threads = 2;
    cfg.skip_rays = true;
    return cfg;
}

static void compare(struct pair *p)
{
    double sum = 0;

    p->most = 0;
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < p->exact.height; y++) {
            for (int x = 0; x < p->exact.width; x++) {
                const int d = abs(sst_image_row(&p->exact, c, y)[x] - sst_image_row(&p->made, c, y)[x]);

                sum += d * d;
                p->most = sst_max_int(p->most, d);
            }
        }
    }
    p->db = sum > 0 ? 10 * log10(255 * 255 * 3 * (double)p->exact.width * p->exact.height / sum) : INFINITY;
}

/* The picture with skips beside the exact one. */
static void make_pair(struct pair *p, struct field *f, const struct sst_render_config *cfg)
{
    struct sst_render_config exact = *cfg;

    *p = (struct pair){ 0 };
    exact.skip_rays = false;
    assert_int_equal(sst_image_init(&p->exact, f->lf.width, f->lf.height), 0);
    assert_int_equal(sst_image_init(&p->made, f->lf.width, f->lf.height), 0);
    assert_int_equal(sst_map_u8_init(&p->exact_valid, f->lf.width, f->lf.height), 0);
    assert_int_equal(sst_map_u8_init(&p->valid, f->lf.width, f->lf.height), 0);
    assert_int_equal(sst_render(f->renderer, &exact, &p->exact, &p->exact_valid), 0);
    assert_int_equal(sst_render(f->renderer, cfg, &p->made, &p->valid), 0);
    compare(p);
    for (int y = 0; y < f->lf.height; y++)
        assert_memory_equal(sst_map_u8_row(&p->exact_valid, y), sst_map_u8_row(&p->valid, y), (size_t)f->lf.width);
}

static void free_pair(struct pair *p)
{
    sst_image_fini(&p->exact);
    sst_image_fini(&p->made);
    sst_map_u8_fini(&p->exact_valid);
    sst_map_u8_fini(&p->valid);
}

/* The error is estimated from rows: a scene may exceed the budget a little, never by much. */
#define SLACK_DB 2

static void scenes_keep_the_budget_and_the_mask(void **state SST_UNUSED)
{
    static const char *const scenes[] = { "pedestrian", "cd-cases" };

    for (size_t i = 0; i < ARRAY_LEN(scenes); i++) {
        struct sst_render_skip_report report;
        struct field f;

        open_scene(&f, scenes[i]);
        assert_false(sst_renderer_skips(f.renderer, &report));
        for (int refocus = 0; refocus < 3; refocus++) { /* the last with weights of the aperture */
            struct sst_render_config cfg = config_of(&f);
            struct pair p;

            cfg.skip_error_db = 40; /* more is left out of small pictures */
            cfg.method = refocus ? SST_RENDER_REFOCUS : SST_RENDER_SST;
            cfg.aperture_soft = refocus == 2;
            make_pair(&p, &f, &cfg);
            print_message("%s%s: %.1f dB\n", scenes[i], refocus ? ", refocus" : "", p.db);
            assert_true(p.db > cfg.skip_error_db - SLACK_DB);
            free_pair(&p);
        }
        assert_true(sst_renderer_skips(f.renderer, &report));
        assert_int_equal(report.pictures, 3);
        assert_true(report.rays_skipped >= 0 && report.rays_skipped < 1);
        close_field(&f);
    }
}

static void a_small_budget_leaves_less_out(void **state SST_UNUSED)
{
    struct field f;
    struct pair p;
    struct sst_render_config cfg;
    struct sst_render_skip_report report;
    double skipped[2];

    open_scene(&f, "cd-cases");
    for (int i = 0; i < 2; i++) {
        cfg = config_of(&f);
        cfg.skip_error_db = i ? 40 : 60;
        make_pair(&p, &f, &cfg);
        assert_true(p.db > cfg.skip_error_db - SLACK_DB);
        assert_true(sst_renderer_skips(f.renderer, &report));
        skipped[i] = report.rays_skipped;
        assert_true(isnan(report.error_db) || report.error_db > cfg.skip_error_db - 6);
        free_pair(&p);
        sst_renderer_destroy(f.renderer);
        open_renderer(&f);
    }
    assert_true(skipped[1] > skipped[0] && skipped[1] > 0.3);
    close_field(&f);
}

static void same_bytes_for_any_number_of_threads(void **state SST_UNUSED)
{
    struct field f;
    struct pair p, other;
    struct sst_render_config cfg;

    open_scene(&f, "pedestrian");
    cfg = config_of(&f);
    make_pair(&p, &f, &cfg);
    for (int threads = small_level() >= 2 ? 5 : 1; threads <= 5; threads += 2) {
        cfg.threads = threads;
        make_pair(&other, &f, &cfg);
        for (int c = 0; c < 3; c++) {
            for (int y = 0; y < HEIGHT; y++)
                assert_memory_equal(sst_image_row(&p.made, c, y), sst_image_row(&other.made, c, y), WIDTH);
        }
        free_pair(&other);
    }
    free_pair(&p);
    close_field(&f);
}

/* Votes need all rays: these pictures are exact. */
static void verified_pictures_are_exact(void **state SST_UNUSED)
{
    struct sst_render_skip_report report;
    struct sst_render_config cfg;
    struct field f;
    struct pair p;

    open_scene(&f, "pedestrian");
    cfg = config_of(&f);
    cfg.verify = SST_VERIFY_ON;
    cfg.unsupported = SST_UNSUPPORTED_INVALID;
    make_pair(&p, &f, &cfg);
    assert_int_equal(p.most, 0);
    assert_true(sst_renderer_skips(f.renderer, &report));
    assert_int_equal(report.pictures, 1);
    assert_true(!(report.rays_skipped > 0) && !(report.rays_even > 0) && isnan(report.error_db));
    free_pair(&p);
    close_field(&f);
}

/* Equal views need no more than a quarter of them; one that differs from all others is missed by it. */
static void one_view_that_differs_is_seen(void **state SST_UNUSED)
{
    for (int differs = 0; differs < 2; differs++) {
        struct sst_render_skip_report report;
        struct sst_render_config cfg;
        struct field f;
        struct pair p;

        open_empty(&f, SIDE, SIDE, WIDTH, HEIGHT);
        for (int k = 0; k < SIDE * SIDE; k++)
            paint(&f, k, differs && k == 1 ? 255 : 60, 0, 0, 1);
        open_renderer(&f);
        cfg = config_of(&f);
        make_pair(&p, &f, &cfg);
        assert_true(sst_renderer_skips(f.renderer, &report));
        if (differs) {
            assert_int_equal(p.most, 0); /* 8 levels off without it: no tile may leave it out */
        } else {
            assert_int_equal(p.most, 0);
            assert_true(report.rays_skipped > 0.5);
        }
        free_pair(&p);
        close_field(&f);
    }
}

/* Half of the views show an occluder in front, in half of the columns: their weights are small, not nothing. */
static void half_occluded_tiles_keep_the_budget(void **state SST_UNUSED)
{
    struct sst_render_config cfg;
    struct field f;
    struct pair p;

    open_empty(&f, SIDE, SIDE, WIDTH, HEIGHT);
    f.lf.range_max_px = 40;
    f.focus_px = 4;
    for (int k = 0; k < SIDE * SIDE; k++) {
        paint(&f, k, 80, 40, 4, 1);
        for (int y = 0; k % 2 && y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH / 2 + y % 7; x++) {
                sst_map_u16_row(&f.lf.views[k].disp, y)[x] = sst_disp_q6(&f.lf, (float)(38 - 0.02 * y));
                sst_map_u8_row(&f.lf.views[k].label, y)[x] = 2;
                sst_image_row(&f.lf.views[k].image, 0, y)[x] = 255;
            }
        }
    }
    open_renderer(&f);
    cfg = config_of(&f);
    make_pair(&p, &f, &cfg);
    assert_true(p.db > cfg.skip_error_db - SLACK_DB);
    free_pair(&p);
    close_field(&f);
}

/* All weights are 0: C1 = C2 = 0 and nothing near the focus. Plain refocusing takes their place. */
static void no_weights_at_all(void **state SST_UNUSED)
{
    struct sst_render_config cfg;
    struct field f;
    struct pair p;

    open_empty(&f, SIDE, SIDE, WIDTH, 40);
    f.lf.range_max_px = 40;
    f.focus_px = 0;
    for (int k = 0; k < SIDE * SIDE; k++)
        paint(&f, k, 100, 20, 40, 1);
    open_renderer(&f);
    cfg = config_of(&f);
    cfg.c1 = cfg.c2 = 0;
    make_pair(&p, &f, &cfg);
    assert_true(p.db > cfg.skip_error_db - SLACK_DB);
    free_pair(&p);
    close_field(&f);
}

/* Few views, and pictures of a pixel or a few. */
static void small_fields(void **state SST_UNUSED)
{
    static const int fields[][4] = { { 1, 1, 1, 1 },    { 1, 1, 200, 70 }, { 1, 2, 1, 1 }, { 2, 1, 70, 300 },
                                     { 2, 2, 129, 33 }, { 1, 6, 130, 65 }, { 3, 3, 5, 40 } };

    for (size_t i = 0; i < ARRAY_LEN(fields); i++) {
        const int views = fields[i][0] * fields[i][1];
        struct sst_render_config cfg;
        struct field f;
        struct pair p;

        open_empty(&f, fields[i][0], fields[i][1], fields[i][2], fields[i][3]);
        for (int k = 0; k < views; k++)
            paint(&f, k, 128, 200, 0, 1);
        if (views > 2)
            f.lf.views[1].present = false;
        open_renderer(&f);
        cfg = config_of(&f);
        make_pair(&p, &f, &cfg);
        assert_true(p.db > cfg.skip_error_db - SLACK_DB);
        if (views == 1)
            assert_int_equal(p.most, 0);
        free_pair(&p);
        close_field(&f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        serial_test(scenes_keep_the_budget_and_the_mask),
        serial_test(a_small_budget_leaves_less_out),
        thread_test(same_bytes_for_any_number_of_threads),
        serial_test(verified_pictures_are_exact),
        cmocka_unit_test(one_view_that_differs_is_seen),
        serial_test(half_occluded_tiles_keep_the_budget),
        cmocka_unit_test(no_weights_at_all),
        cmocka_unit_test(small_fields),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
