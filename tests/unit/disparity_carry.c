/* Maps of matched views carried to the others: where pixels arrive, which surface wins, gaps, what no view sees. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "pipeline/method/disparity/visible.h"
#include "simulators/scene/scene.h"
#include "tests/small.h"

enum { W = 64, H = 24, SIDE = 3, VIEWS = SIDE * SIDE, CENTRE = VIEWS / 2, FRONT = 9, BACK = 3 };
enum { SCENE_SIDE = 4, SCENE_VIEWS = SCENE_SIDE * SCENE_SIDE };

struct field {
    struct sst_image image; /* only its presence matters */
    struct sst_map_u16 disp[VIEWS];
    struct sst_map_u8 confidence[VIEWS], status[VIEWS];
    struct sst_visible_view view[VIEWS];
    struct sst_visible_views all;
};

/* The front is a column of the centre's x 28 .. 35. */
static int truth(int k, int x)
{
    const int from = x + FRONT * (k % SIDE - 1);

    return 64 * (from >= 28 && from < 36 ? FRONT : BACK);
}

/* All views matched and right. */
static void field_init(struct field *f)
{
    *f = (struct field){ .all = { .view = f->view, .count = VIEWS, .scale = 1, .range = 16 } };
    assert_int_equal(sst_image_init(&f->image, W, H), 0);
    for (int k = 0; k < VIEWS; k++) {
        assert_int_equal(sst_map_u16_init(&f->disp[k], W, H), 0);
        assert_int_equal(sst_map_u8_init(&f->confidence[k], W, H), 0);
        assert_int_equal(sst_map_u8_init(&f->status[k], W, H), 0);
        for (int i = 0; i < W * H; i++) {
            sst_map_u16_row(&f->disp[k], i / W)[i % W] = (uint16_t)truth(k, i % W);
            sst_map_u8_row(&f->confidence[k], i / W)[i % W] = 200;
            sst_map_u8_row(&f->status[k], i / W)[i % W] = SST_DISPARITY_CORRECT;
        }
        f->view[k] = (struct sst_visible_view){ .image = &f->image,
                                                .disp = &f->disp[k],
                                                .confidence = &f->confidence[k],
                                                .bx = k % SIDE - 1,
                                                .by = k / SIDE - 1 };
    }
}

static void field_fini(struct field *f)
{
    sst_image_fini(&f->image);
    for (int k = 0; k < VIEWS; k++) {
        sst_map_u16_fini(&f->disp[k]);
        sst_map_u8_fini(&f->confidence[k]);
        sst_map_u8_fini(&f->status[k]);
    }
}

/* Forget the map of a view; it is to be carried over. */
static void forget(struct field *f, int k)
{
    f->view[k].carried = true;
    memset(f->disp[k].data, 0x55, f->disp[k].stride * H);
    memset(f->confidence[k].data, 0x55, f->confidence[k].stride * H);
    memset(f->status[k].data, 0x55, f->status[k].stride * H);
}

static int wrong(const struct field *f, int k)
{
    int n = 0;

    for (int i = 0; i < W * H; i++)
        n += sst_map_u16_row(&f->disp[k], i / W)[i % W] != truth(k, i % W);
    return n;
}

static void test_right_maps_arrive(void **state SST_UNUSED)
{
    struct field f;

    field_init(&f);
    forget(&f, CENTRE);
    assert_int_equal(sst_disparity_carry(&f.all, f.status, 2), 0);
    assert_int_equal(wrong(&f, CENTRE), 0);
    for (int i = 0; i < W * H; i++) {
        assert_int_equal(sst_map_u8_row(&f.confidence[CENTRE], i / W)[i % W], 200);
        assert_int_equal(sst_map_u8_row(&f.status[CENTRE], i / W)[i % W], SST_DISPARITY_CORRECT);
    }
    field_fini(&f);
}

/* One source alone: the back beside the front is hidden there, and filled from the back around it. */
static void test_hidden_pixels_are_filled_from_behind(void **state SST_UNUSED)
{
    struct field f;
    int occluded = 0;

    field_init(&f);
    for (int k = 0; k < VIEWS; k++) {
        if (k != CENTRE - 1)
            forget(&f, k);
    }
    assert_int_equal(sst_disparity_carry(&f.all, f.status, 1), 0);
    assert_int_equal(wrong(&f, CENTRE), 0);
    for (int x = 0; x < W; x++)
        occluded += sst_map_u8_row(&f.status[CENTRE], H / 2)[x] == SST_DISPARITY_OCCLUSION;
    assert_int_equal(occluded, FRONT - BACK + BACK); /* beside the front, and the margin without an overlap */
    field_fini(&f);
}

static void test_unchecked_pixels_stay_unconfirmed(void **state SST_UNUSED)
{
    struct field f;

    field_init(&f);
    forget(&f, CENTRE);
    for (int k = 0; k < VIEWS; k++)
        memset(f.status[k].data, SST_DISPARITY_MISMATCH, f.status[k].stride * H);
    assert_int_equal(sst_disparity_carry(&f.all, f.status, 1), 0);
    assert_int_equal(wrong(&f, CENTRE), 0);
    for (int i = 0; i < W * H; i++)
        assert_int_not_equal(sst_map_u8_row(&f.status[CENTRE], i / W)[i % W], SST_DISPARITY_CORRECT);
    assert_int_equal(sst_disparity_carry(&f.all, NULL, 1), 0);
    assert_int_equal(wrong(&f, CENTRE), 0);
    field_fini(&f);
}

/* A slanted surface gets wider: what opens between its pixels is closed, not seen through. */
static void test_slanted_surface_has_no_gaps(void **state SST_UNUSED)
{
    struct field f;

    field_init(&f);
    for (int k = 0; k < VIEWS; k++) {
        if (k != CENTRE + 1)
            forget(&f, k);
    }
    for (int i = 0; i < W * H; i++) /* 1/4 px a column */
        sst_map_u16_row(&f.disp[CENTRE + 1], i / W)[i % W] = (uint16_t)(16 * (i % W));
    assert_int_equal(sst_disparity_carry(&f.all, f.status, 1), 0);
    for (int x = 2; x < W; x++)
        assert_in_range(sst_map_u16_row(&f.disp[CENTRE], H / 2)[x] - sst_map_u16_row(&f.disp[CENTRE], H / 2)[x - 1] +
                            64,
                        64, 64 + 40);
    field_fini(&f);
}

static void test_empty_maps_stay_unknown(void **state SST_UNUSED)
{
    struct field f;
    double percent;

    field_init(&f);
    forget(&f, CENTRE);
    for (int k = 0; k < VIEWS; k++) {
        if (k != CENTRE)
            memset(f.disp[k].data, 0xFF, f.disp[k].stride * H);
    }
    assert_int_equal(sst_disparity_carry(&f.all, f.status, 1), 0);
    assert_int_equal(sst_map_u16_row(&f.disp[CENTRE], 0)[0], SST_DISP_NONE);
    assert_int_equal(sst_disparity_carry_error(&f.all, f.status, 0, &percent), 0);
    assert_true(isnan(percent));
    field_fini(&f);
}

/* The error is that of a matched view against what the others carry to it. */
static void test_error_is_measured(void **state SST_UNUSED)
{
    struct field f;
    double percent;

    field_init(&f);
    forget(&f, 0);
    assert_int_equal(sst_disparity_carry_error(&f.all, f.status, CENTRE, &percent), 0);
    assert_float_equal(percent, 0, 0);
    for (int x = 0; x < W; x++) /* a quarter of the rows wrong by 2 px */
        for (int y = 0; y < H / 4; y++)
            sst_map_u16_row(&f.disp[CENTRE], y)[x] = (uint16_t)(truth(CENTRE, x) + 128);
    assert_int_equal(sst_disparity_carry_error(&f.all, f.status, CENTRE, &percent), 0);
    assert_float_equal(percent, 25, 0.01);
    field_fini(&f);
}

/* Agreed: at least three of the four sources put one surface there, and none another one, as the back that they see
 * behind the front. */
static void test_agreement(void **state SST_UNUSED)
{
    enum { ASIDE = 36 + FRONT + 1 };
    struct sst_map_u8 agreed = { 0 };
    struct field f;

    field_init(&f);
    forget(&f, CENTRE);
    f.view[CENTRE].agreed = &agreed;
    assert_int_equal(sst_disparity_carry(&f.all, NULL, 1), 0);
    assert_int_equal(sst_map_u8_row(&agreed, H / 2)[ASIDE], 255);
    assert_int_equal(sst_map_u8_row(&agreed, H / 2)[30], 0);
    assert_int_equal(sst_map_u8_row(&agreed, 0)[W - 1], 0); /* two sources see the corner */
    for (int x = 0; x < W; x++)
        sst_map_u16_row(&f.disp[CENTRE - SIDE], H / 2 + BACK)[x] = 64 * (BACK + 1);
    for (int x = 0; x < W; x++)
        sst_map_u16_row(&f.disp[CENTRE - SIDE], H / 2 - BACK)[x] = 64 * (BACK - 1);
    assert_int_equal(sst_disparity_carry(&f.all, NULL, 1), 0);
    assert_int_equal(sst_map_u8_row(&agreed, H / 2 - 1)[ASIDE], 0);
    sst_map_u8_fini(&agreed);
    field_fini(&f);
}

/* --- a scene ------------------------------------------------------------------------------------------------------ */

static void make_pedestrian(struct sst_lightfield *lf, struct sst_map_f32 truth[SCENE_VIEWS])
{
    struct sst_scene_config cfg;
    struct sst_scene *scene;

    sst_scene_config_defaults(&cfg);
    cfg.width = 160;
    cfg.height = 120;
    assert_int_equal(sst_scene_create(&scene, "pedestrian", &cfg), 0);
    assert_int_equal(sst_lightfield_init(lf, SCENE_SIDE, SCENE_SIDE), 0);
    lf->width = cfg.width;
    lf->height = cfg.height;
    sst_scene_range(scene, &lf->range_min_px, &lf->range_max_px);
    for (int k = 0; k < SCENE_VIEWS; k++) {
        struct sst_view *v = &lf->views[k];

        v->present = true;
        assert_int_equal(sst_image_init(&v->image, cfg.width, cfg.height), 0);
        assert_int_equal(sst_map_f32_init(&truth[k], cfg.width, cfg.height), 0);
        assert_int_equal(
            sst_scene_render(scene, v->bx, v->by, 0, &(struct sst_scene_maps){ .image = &v->image, .disp = &truth[k] }),
            0);
    }
    sst_scene_destroy(scene);
}

/* Percent of the disparities off by more than 1 px, of the views that keys of three leave out. */
static double match(struct sst_lightfield *lf, const struct sst_map_f32 truth[SCENE_VIEWS], int spacing, int rounds,
                    int threads)
{
    struct sst_disparity_config cfg;
    bool carried[SCENE_VIEWS];
    int off = 0, n = 0;

    assert_int_equal(sst_disparity_preset(&cfg, "balanced"), 0);
    cfg.disp_min_px = floor(lf->range_min_px);
    cfg.disp_max_px = ceil(lf->range_max_px);
    cfg.key_spacing = spacing;
    cfg.rounds = rounds;
    cfg.threads = threads;
    cfg.key_error = 100;
    assert_int_equal(sst_disparity_lightfield(lf, &cfg, NULL, NULL), 0);
    assert_true(sst_disparity_keys(lf, 3, carried) < SCENE_VIEWS / 2);
    for (int k = 0; k < SCENE_VIEWS; k++) {
        for (int i = 0; carried[k] && i < lf->width * lf->height; i++) {
            const uint16_t d = sst_map_u16_row(&lf->views[k].disp, i / lf->width)[i % lf->width];

            n++;
            off += fabs(sst_disp_px(lf, d) - sst_map_f32_row(&truth[k], i / lf->width)[i % lf->width]) > 1;
        }
    }
    return 100.0 * off / n;
}

static void test_repaired_maps_are_as_good_as_matched_ones(void **state SST_UNUSED)
{
    struct sst_map_f32 truth[SCENE_VIEWS];
    struct sst_lightfield lf;
    double matched, carried, repaired;

    make_pedestrian(&lf, truth);
    matched = match(&lf, truth, 1, 1, 2);
    carried = match(&lf, truth, 3, 0, 2);
    repaired = match(&lf, truth, 3, 1, 1);
    print_message("off by more than 1 px: %.2f %% matched, %.2f %% carried, %.2f %% repaired\n", matched, carried,
                  repaired);
    assert_true(repaired < carried);
    assert_true(repaired < 1.1 * matched + 0.1);
    assert_float_equal(match(&lf, truth, 3, 1, 3), repaired, 0);
    for (int k = 0; k < SCENE_VIEWS; k++)
        sst_map_f32_fini(&truth[k]);
    sst_lightfield_fini(&lf);
}

static void test_threads_and_cancel(void **state SST_UNUSED)
{
    struct field one, four;
    SST_ATOMIC(bool) cancel = true;

    field_init(&one);
    field_init(&four);
    for (int k = 0; k < VIEWS; k += 2) {
        forget(&one, k);
        forget(&four, k);
    }
    assert_int_equal(sst_disparity_carry(&one.all, one.status, 1), 0);
    assert_int_equal(sst_disparity_carry(&four.all, four.status, 4), 0);
    for (int k = 0; k < VIEWS; k++)
        assert_memory_equal(one.disp[k].data, four.disp[k].data, one.disp[k].stride * H);
    one.all.cancel = &cancel;
    assert_int_equal(sst_disparity_carry(&one.all, one.status, 1), -ECANCELED);
    field_fini(&one);
    field_fini(&four);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_right_maps_arrive),
        cmocka_unit_test(test_hidden_pixels_are_filled_from_behind),
        cmocka_unit_test(test_unchecked_pixels_stay_unconfirmed),
        cmocka_unit_test(test_slanted_surface_has_no_gaps),
        cmocka_unit_test(test_empty_maps_stay_unknown),
        cmocka_unit_test(test_error_is_measured),
        cmocka_unit_test(test_agreement),
        serial_test(test_repaired_maps_are_as_good_as_matched_ones),
        cmocka_unit_test(test_threads_and_cancel),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
