/* The disparity stage as a whole: two textured planes seen by arrays of several shapes, and nothing to match. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/method/disparity/stage.h"
#include "simulators/scene/scene.h"
#include "tests/small.h"
#include "tests/test.h"

/* Even, so that half-size views are whole pixels apart too. */
#define BACK_PX  (-2)
#define FRONT_PX 4

/* What an array may look at. */
enum look {
    LOOK_PLANES,
    LOOK_SAME,    /* all views alike */
    LOOK_STRIPES, /* a period of 4 px: many disparities fit equally well */
    LOOK_GREY,
    LOOK_BLACK,
    LOOK_WHITE,
    LOOKS,
};

static uint8_t noise(int x, int y, int c)
{
    uint32_t h = (uint32_t)x * 0x9E3779B1u ^ (uint32_t)y * 0x85EBCA77u ^ (uint32_t)c * 0xC2B2AE3Du;

    h = (h ^ h >> 15) * 0x2C1B3C6Du;
    h = (h ^ h >> 12) * 0x297A2D39u;
    return (uint8_t)(h >> 24);
}

/* A point of the front plane is at the reference pixel X = x + d b; it covers the middle of the reference picture. */
static bool in_front(const struct sst_lightfield *lf, int x, int y, const struct sst_view *v)
{
    const int rx = x + FRONT_PX * (int)v->bx, ry = y + FRONT_PX * (int)v->by;

    return rx >= lf->width / 3 && rx < lf->width * 2 / 3 && ry >= lf->height / 3 && ry < lf->height * 2 / 3;
}

static uint8_t colour(const struct sst_lightfield *lf, enum look look, int x, int y, int c, const struct sst_view *v)
{
    const bool front = in_front(lf, x, y, v);
    const int d = front ? FRONT_PX : BACK_PX;

    switch (look) {
    case LOOK_PLANES:
        return noise(x + d * (int)v->bx, y + d * (int)v->by, c + 10 * front);
    case LOOK_SAME:
        return noise(x, y, c);
    case LOOK_STRIPES:
        return x % 4 < 2 ? 200 : 50;
    case LOOK_GREY:
        return 128;
    case LOOK_BLACK:
        return 0;
    default:
        return 255;
    }
}

static struct sst_lightfield field(int rows, int cols, int width, int height, enum look look)
{
    struct sst_lightfield lf;

    assert_int_equal(sst_lightfield_init(&lf, rows, cols), 0);
    lf.width = width;
    lf.height = height;
    for (int k = 0; k < rows * cols; k++) {
        struct sst_view *v = &lf.views[k];

        v->present = true;
        assert_int_equal(sst_image_init(&v->image, width, height), 0);
        for (int i = 0; i < 3 * width * height; i++)
            sst_image_row(&v->image, i % 3, i / 3 / width)[i / 3 % width] =
                colour(&lf, look, i / 3 % width, i / 3 / width, i % 3, v);
    }
    return lf;
}

static void drop(struct sst_lightfield *lf, int view)
{
    lf->views[view].present = false;
    sst_image_fini(&lf->views[view].image);
}

static struct sst_disparity_config preset(const char *name, double lo, double hi)
{
    struct sst_disparity_config cfg;

    assert_int_equal(sst_disparity_preset(&cfg, name), 0);
    cfg.cost = SST_COST_CENSUS; /* without a model */
    cfg.disp_min_px = lo;
    cfg.disp_max_px = hi;
    cfg.threads = 2;
    return cfg;
}

/* Every present view has maps of its size with known disparities inside the range only. */
static void is_dense(const struct sst_lightfield *lf, double lo, double hi)
{
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const struct sst_view *v = &lf->views[k];

        if (!v->present) {
            assert_null(v->disp.data);
            continue;
        }
        assert_true(v->disp.width == lf->width && v->disp.height == lf->height);
        assert_true(v->confidence.width == lf->width && v->confidence.height == lf->height);
        for (int i = 0; i < lf->width * lf->height; i++) {
            const uint16_t d = sst_map_u16_row(&v->disp, i / lf->width)[i % lf->width];

            if (d == SST_DISP_NONE || sst_disp_px(lf, d) < lo || sst_disp_px(lf, d) > hi)
                fail_msg("view %d, pixel %d: %d is not a disparity of %g..%g px", k, i, d, lo, hi);
        }
    }
}

/* Share of the pixels of a view that are within 1 px of the truth. */
static double right_share(const struct sst_lightfield *lf, int k)
{
    const struct sst_view *v = &lf->views[k];
    int right = 0;

    for (int y = 0; y < lf->height; y++) {
        for (int x = 0; x < lf->width; x++)
            right += fabs(sst_disp_px(lf, sst_map_u16_row(&v->disp, y)[x]) -
                          (in_front(lf, x, y, v) ? FRONT_PX : BACK_PX)) <= 1;
    }
    return (double)right / (lf->width * lf->height);
}

static void matches(struct sst_lightfield *lf, const struct sst_disparity_config *cfg, double share, const char *what)
{
    assert_int_equal(sst_disparity_lightfield(lf, cfg, NULL, NULL), 0);
    is_dense(lf, cfg->disp_min_px - 1, cfg->disp_max_px + 1);
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        if (lf->views[k].present && right_share(lf, k) < share)
            fail_msg("%s: %.1f %% of view %d are right, not %.1f", what, 100 * right_share(lf, k), k, 100 * share);
    }
    sst_lightfield_fini(lf);
}

static const struct sst_disparity_search one_thread = { .scale = 1, .threads = 1 },
                                         two_threads = { .scale = 1, .threads = 2 };

static void two_planes(void **state SST_UNUSED)
{
    static const struct {
        const char *preset;
        int rows, cols, missing;
        bool joint;
        double share;
    } cases[] = {
        { "balanced", 3, 3, -1, true, 0.97 },  { "balanced", 3, 3, 4, true, 0.97 },
        { "balanced", 3, 3, 0, true, 0.97 },   { "accurate", 3, 3, -1, true, 0.97 },
        { "preview", 3, 3, -1, true, 0.90 },   { "balanced", 3, 3, -1, false, 0.95 },
        { "balanced", 1, 2, -1, true, 0.90 },  { "balanced", 2, 1, -1, true, 0.90 },
        { "balanced", 1, 2, -1, false, 0.90 }, { "balanced", 2, 1, -1, false, 0.90 },
        { "balanced", 1, 4, -1, true, 0.93 },
    };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        struct sst_lightfield lf = field(cases[i].rows, cases[i].cols, 72, 54, LOOK_PLANES);
        struct sst_disparity_config cfg = preset(cases[i].preset, -5.5, 7);
        char what[64];

        cfg.joint = cases[i].joint;
        if (cases[i].missing >= 0)
            drop(&lf, cases[i].missing);
        snprintf(what, sizeof(what), "%s %dx%d without %d, %s", cases[i].preset, cases[i].rows, cases[i].cols,
                 cases[i].missing, cfg.joint ? "joint" : "apart");
        matches(&lf, &cfg, cases[i].share, what);
    }
}

static void a_pair_is_left_minus_right(void **state SST_UNUSED)
{
    struct sst_lightfield lf = field(1, 2, 72, 54, LOOK_PLANES);
    struct sst_disparity_config cfg = preset("balanced", -5, 7);
    struct sst_map_f32 disp;

    assert_int_equal(sst_disparity_stereo(&disp, &lf.views[0].image, &lf.views[1].image, &cfg), 0);
    assert_true(fabsf(sst_map_f32_row(&disp, 27)[36] - FRONT_PX) < 0.1f);
    assert_true(fabsf(sst_map_f32_row(&disp, 4)[60] - BACK_PX) < 0.1f);
    assert_null(lf.views[0].disp.data); /* the caller's images are only borrowed */
    sst_map_f32_fini(&disp);
    lf.views[1].image.width--;
    assert_int_equal(sst_disparity_stereo(&disp, &lf.views[0].image, &lf.views[1].image, &cfg), -EBADMSG);
    lf.views[1].image.width++;
    sst_lightfield_fini(&lf);
}

/* Nothing that fits in a window: still dense and inside the range. */
static void tiny_views(void **state SST_UNUSED)
{
    static const int sizes[][2] = { { 1, 1 }, { 1, 9 }, { 9, 1 }, { 2, 2 }, { 17, 5 } };
    static const int grids[][2] = { { 1, 2 }, { 2, 1 }, { 3, 3 } };
    static const char *const presets[] = { "preview", "balanced", "accurate" };

    for (int i = 0; i < 5 * 3 * 3; i++) {
        const int *size = sizes[i % 5], *grid = grids[i / 5 % 3];
        struct sst_lightfield lf = field(grid[0], grid[1], size[0], size[1], LOOK_PLANES);
        const struct sst_disparity_config cfg = preset(presets[i / 15], -5, 30);
        double lo = 7, hi = 8;

        matches(&lf, &cfg, 0, "tiny");
        lf = field(grid[0], grid[1], size[0], size[1], LOOK_PLANES);
        assert_int_equal(sst_disparity_range(&lf, &two_threads, &lo, &hi), -ENODATA);
        assert_true(lo == 7 && hi == 8);
        sst_lightfield_fini(&lf);
    }
}

static void nothing_to_match(void **state SST_UNUSED)
{
    for (enum look look = LOOK_SAME; look < LOOKS; look++) {
        struct sst_lightfield lf = field(3, 3, 40, 30, look);
        const struct sst_disparity_config cfg = preset("balanced", -4, 6);
        double lo, hi;
        int at_zero = 0;

        assert_int_equal(sst_disparity_lightfield(&lf, &cfg, NULL, NULL), 0);
        is_dense(&lf, -4, 6);
        for (int i = 0; i < 40 * 30; i++)
            at_zero += fabs(sst_disp_px(&lf, sst_map_u16_row(&lf.views[4].disp, i / 40)[i % 40])) < 0.1;
        if (look == LOOK_SAME)
            assert_true(at_zero > 0.97 * 40 * 30);
        else if (look != LOOK_STRIPES) /* whose border tells something */
            assert_int_equal(sst_disparity_range(&lf, &one_thread, &lo, &hi), -ENODATA);
        sst_lightfield_fini(&lf);
    }
}

/* The range is found from half-size views: within two pixels outwards of the truth, or one step of them more. */
static void range(void **state SST_UNUSED)
{
    static const int grids[][2] = { { 3, 3 }, { 1, 2 }, { 2, 1 } };

    for (int i = 0; i < 3; i++) {
        struct sst_lightfield lf = field(grids[i][0], grids[i][1], 160, 120, LOOK_PLANES);
        double lo = 0, hi = 0;

        assert_int_equal(sst_disparity_range(&lf, &two_threads, &lo, &hi), 0);
        if (!(lo <= BACK_PX && lo >= BACK_PX - 4 && hi >= FRONT_PX && hi <= FRONT_PX + 4))
            fail_msg("grid %dx%d: range %g..%g", grids[i][0], grids[i][1], lo, hi);
        sst_lightfield_fini(&lf);
    }
}

/* Leaves match other leaves by chance, far off, and of each neighbour others. */
static void range_of_leaves(void **state SST_UNUSED)
{
    struct sst_scene_config cfg;
    struct sst_scene *scene;
    struct sst_lightfield lf;
    double lo = 0, hi = 0, true_lo, true_hi;

    sst_scene_config_defaults(&cfg);
    cfg.width = 320;
    cfg.height = 240;
    cfg.rows = cfg.cols = 3;
    assert_int_equal(sst_scene_create(&scene, "bush", &cfg), 0);
    sst_scene_range(scene, &true_lo, &true_hi);
    assert_int_equal(sst_lightfield_init(&lf, 3, 3), 0);
    lf.width = cfg.width;
    lf.height = cfg.height;
    for (int k = 0; k < 9; k++) {
        struct sst_view *v = &lf.views[k];
        struct sst_map_f32 disp = { 0 };

        assert_int_equal(sst_image_init(&v->image, lf.width, lf.height), 0);
        assert_int_equal(sst_map_f32_init(&disp, lf.width, lf.height), 0);
        assert_int_equal(
            sst_scene_render(scene, v->bx, v->by, 0, &(struct sst_scene_maps){ .image = &v->image, .disp = &disp }), 0);
        sst_map_f32_fini(&disp);
        v->present = true;
    }
    assert_int_equal(sst_disparity_range(&lf, &two_threads, &lo, &hi), 0);
    if (fabs(lo - true_lo) > 4 || fabs(hi - true_hi) > 4)
        fail_msg("range %g..%g, the truth is %g..%g", lo, hi, true_lo, true_hi);
    sst_lightfield_fini(&lf);
    sst_scene_destroy(scene);
}

/* Views that are not aligned, each side off by its own: what all of them say is taken. */
static void range_of_views_that_are_not_aligned(void **state SST_UNUSED)
{
    struct sst_lightfield lf = field(3, 3, 160, 120, LOOK_PLANES);
    double lo = 0, hi = 0;

    for (int c = 0; c < 3; c++) {
        struct sst_image *up = &lf.views[1].image, *down = &lf.views[7].image;

        memmove(sst_image_row(up, c, 0), sst_image_row(up, c, 8), up->stride * 112);
        memmove(sst_image_row(down, c, 0), sst_image_row(down, c, 16), down->stride * 104);
        for (int y = 0; y < 120; y++) {
            uint8_t *row = sst_image_row(&lf.views[3].image, c, y);

            memmove(row, row + 12, 148);
        }
    }
    assert_int_equal(sst_disparity_range(&lf, &two_threads, &lo, &hi), 0);
    if (lo > BACK_PX || hi < FRONT_PX)
        fail_msg("range %g..%g", lo, hi);
    sst_lightfield_fini(&lf);
}

static void same_maps(const struct sst_lightfield *a, const struct sst_lightfield *b)
{
    assert_true(a->disp_min_px == b->disp_min_px);
    for (int k = 0; k < a->rows * a->cols; k++) {
        for (int y = 0; y < a->height; y++) {
            assert_memory_equal(sst_map_u16_row(&a->views[k].disp, y), sst_map_u16_row(&b->views[k].disp, y),
                                (size_t)a->width * 2);
            assert_memory_equal(sst_map_u8_row(&a->views[k].confidence, y), sst_map_u8_row(&b->views[k].confidence, y),
                                (size_t)a->width);
        }
    }
}

static void any_number_of_threads(void **state SST_UNUSED)
{
    static const int threads[] = { 2, 5 };
    static const char *const presets[] = { "preview", "balanced", "accurate" };

    for (int p = 0; p < 3; p++) {
        struct sst_disparity_config cfg = preset(presets[p], -5, 7);
        struct sst_lightfield one = field(3, 3, 45, 31, LOOK_PLANES);

        cfg.threads = 1;
        assert_int_equal(sst_disparity_lightfield(&one, &cfg, NULL, NULL), 0);
        for (int i = 0; i < 2; i++) {
            struct sst_lightfield many = field(3, 3, 45, 31, LOOK_PLANES);

            cfg.threads = threads[i];
            assert_int_equal(sst_disparity_lightfield(&many, &cfg, NULL, NULL), 0);
            same_maps(&one, &many);
            /* A second run over its own result gives the same. */
            assert_int_equal(sst_disparity_lightfield(&many, &cfg, NULL, NULL), 0);
            same_maps(&one, &many);
            sst_lightfield_fini(&many);
        }
        sst_lightfield_fini(&one);
    }
}

/* Threads that share a volume: the same bytes, in bands and columns of all sizes. */
static void threads_share_a_volume(void **state SST_UNUSED)
{
    static const struct {
        const char *preset;
        size_t volumes;
        int threads, width, height;
    } cases[] = { { "balanced", 1, 2, 150, 141 },
                  { "balanced", 1, 5, 61, 97 },
                  { "balanced", 2, 7, 130, 70 },
                  { "preview", 1, 3, 300, 194 },
                  { "balanced", 1, 4, 40, 20 } };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        struct sst_disparity_config cfg = preset(cases[i].preset, -5, 45);
        struct sst_lightfield one = field(2, 3, cases[i].width, cases[i].height, LOOK_PLANES);
        struct sst_lightfield many = field(2, 3, cases[i].width, cases[i].height, LOOK_PLANES);

        cfg.threads = 1;
        cfg.memory = cases[i].volumes < 2 ? 1 : 2 * sst_volume_bytes(cases[i].width, cases[i].height, 51);
        assert_int_equal(sst_disparity_lightfield(&one, &cfg, NULL, NULL), 0);
        cfg.threads = cases[i].threads;
        assert_int_equal(sst_disparity_lightfield(&many, &cfg, NULL, NULL), 0);
        same_maps(&one, &many);
        sst_lightfield_fini(&one);
        sst_lightfield_fini(&many);
    }
}

/* With little memory: the same bytes, between pixels in quarters (12 px are searched) and in halves. */
static void frugal(void **state SST_UNUSED)
{
    for (int step = 0; step <= 2; step++) {
        struct sst_disparity_config cfg = preset("balanced", -5, 7);
        struct sst_lightfield all = field(4, 3, 45, 31, LOOK_PLANES), one = field(4, 3, 45, 31, LOOK_PLANES);

        for (int k = 0; k < 12; k++) /* as measured, not as planned */
            all.views[k].bx = one.views[k].bx += 0.07 * (k % 5);
        cfg.phase_step = step;
        assert_int_equal(sst_disparity_lightfield(&all, &cfg, NULL, NULL), 0);
        cfg.frugal = true;
        assert_int_equal(sst_disparity_lightfield(&one, &cfg, NULL, NULL), 0);
        same_maps(&all, &one);
        sst_lightfield_fini(&all);
        sst_lightfield_fini(&one);
    }
}

/* A view without any neighbour beside it: its disparity comes from two steps away; without those it stays unknown. */
static void a_view_on_its_own(void **state SST_UNUSED)
{
    struct sst_lightfield lf = field(1, 5, 72, 54, LOOK_PLANES);
    struct sst_disparity_config cfg = preset("balanced", -5, 7);

    drop(&lf, 3);
    matches(&lf, &cfg, 0.85, "a gap of one");
    lf = field(1, 5, 72, 54, LOOK_PLANES);
    drop(&lf, 2);
    drop(&lf, 3);
    assert_int_equal(sst_disparity_lightfield(&lf, &cfg, NULL, NULL), 0);
    assert_true(right_share(&lf, 0) > 0.9 && right_share(&lf, 1) > 0.9);
    for (int i = 0; i < 72 * 54; i++) {
        assert_int_equal(sst_map_u16_row(&lf.views[4].disp, i / 72)[i % 72], SST_DISP_NONE);
        assert_int_equal(sst_map_u8_row(&lf.views[4].confidence, i / 72)[i % 72], 0);
    }
    sst_lightfield_fini(&lf);
}

static void refused(struct sst_lightfield *lf, const struct sst_disparity_config *cfg, int want)
{
    lf->disp_min_px = 3;
    assert_int_equal(sst_disparity_lightfield(lf, cfg, NULL, NULL), want);
    assert_true(lf->disp_min_px == 3);
    for (int k = 0; k < lf->rows * lf->cols; k++)
        assert_null(lf->views[k].disp.data);
}

static void bad_settings_change_nothing(void **state SST_UNUSED)
{
    static const double ranges[][2] = { { 0, 0 },         { 5, 4 },   { NAN, 4 },      { 0, NAN },
                                        { -INFINITY, 0 }, { 0, 512 }, { 20000, 20010 } };
    struct sst_lightfield lf = field(1, 2, 20, 20, LOOK_PLANES);
    struct sst_disparity_config cfg;

    for (size_t i = 0; i < ARRAY_LEN(ranges); i++) {
        cfg = preset("balanced", ranges[i][0], ranges[i][1]);
        refused(&lf, &cfg, -EINVAL);
    }
    cfg = preset("balanced", 0, 4);
    cfg.paths = 5;
    refused(&lf, &cfg, -EINVAL);
    cfg = preset("balanced", 0, 4);
    cfg.p2 = cfg.p1 - 1;
    refused(&lf, &cfg, -EINVAL);
    cfg.p2 = SST_DISPARITY_MAX_PENALTY + 1;
    refused(&lf, &cfg, -EINVAL);
    cfg = preset("balanced", 0, 4);
    cfg.support_arm = SST_SUPPORT_MAX_ARM + 1;
    refused(&lf, &cfg, -EINVAL);
    cfg = preset("balanced", 0, 4);
    cfg.phase_step = 3;
    refused(&lf, &cfg, -EINVAL);
    cfg = preset("balanced", 0, 4);
    cfg.cost = SST_COST_BOTH;
    cfg.model = "/nonexistent/model.onnx";
    refused(&lf, &cfg, -ENOENT);
    drop(&lf, 1);
    cfg = preset("balanced", 0, 4);
    refused(&lf, &cfg, -EINVAL);
    sst_lightfield_fini(&lf);
    assert_int_equal(sst_disparity_preset(&cfg, "fast"), -EINVAL);
}

/* The largest number of steps, with penalties that fill 16 bits. */
static void the_widest_search(void **state SST_UNUSED)
{
    struct sst_lightfield lf = field(1, 2, 40, 12, LOOK_PLANES);
    struct sst_disparity_config cfg = preset("accurate", -11, SST_DISPARITY_MAX_STEPS - 12);

    cfg.p1 = cfg.p2 = SST_DISPARITY_MAX_PENALTY;
    matches(&lf, &cfg, 0, "widest");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        serial_test(two_planes),
        cmocka_unit_test(a_pair_is_left_minus_right),
        serial_test(tiny_views),
        cmocka_unit_test(nothing_to_match),
        serial_test(range),
        serial_test(range_of_leaves),
        serial_test(range_of_views_that_are_not_aligned),
        cmocka_unit_test(any_number_of_threads),
        serial_test(threads_share_a_volume),
        cmocka_unit_test(frugal),
        serial_test(a_view_on_its_own),
        cmocka_unit_test(bad_settings_change_nothing),
        serial_test(the_widest_search),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
