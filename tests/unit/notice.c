/* Faults of pictures: JPEG by its steps, blur by its edges, noise, missing views. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/image/codec.h"
#include "pipeline/method/process/notice.h"
#include "simulators/scene/scene.h"
#include "tests/random.h"
#include "tests/test.h"

#define WIDTH  200
#define HEIGHT 150
#define VIEWS  4

static struct sst_lightfield scene_views;

static int setup(void **state SST_UNUSED)
{
    struct sst_scene_config cfg;
    struct sst_scene *scene;

    sst_scene_config_defaults(&cfg);
    cfg.width = WIDTH;
    cfg.height = HEIGHT;
    cfg.rows = cfg.cols = 2;
    if (sst_scene_create(&scene, "pedestrian", &cfg) || sst_lightfield_init(&scene_views, 2, 2))
        return -1;
    scene_views.width = WIDTH;
    scene_views.height = HEIGHT;
    for (int k = 0; k < VIEWS; k++) {
        struct sst_view *v = &scene_views.views[k];

        v->present = true;
        if (sst_image_init(&v->image, WIDTH, HEIGHT) ||
            sst_scene_render(scene, v->bx, v->by, 0, &(struct sst_scene_maps){ .image = &v->image }))
            return -1;
    }
    sst_scene_destroy(scene);
    return 0;
}

static int teardown(void **state SST_UNUSED)
{
    sst_lightfield_fini(&scene_views);
    return 0;
}

static void copy_views(struct sst_lightfield *lf)
{
    assert_int_equal(sst_lightfield_init(lf, 2, 2), 0);
    lf->width = WIDTH;
    lf->height = HEIGHT;
    for (int k = 0; k < VIEWS; k++)
        assert_int_equal(sst_view_copy(&lf->views[k], &scene_views.views[k]), 0);
}

static void notice(struct sst_notices *out, const struct sst_lightfield *lf)
{
    assert_int_equal(sst_notice_measure(out, lf, NULL, 2), 0);
    sst_notice_describe(out, lf->rows, lf->cols);
    for (int i = 0; i < out->count; i++)
        print_message("%s: %s\n", out->notice[i].what, out->notice[i].text);
}

/* Gaussian of sigma px, repeated borders. */
static void blur(struct sst_image *image, double sigma)
{
    const int taps = (int)ceil(3 * sigma);
    double *line = malloc(sizeof(*line) * (WIDTH + HEIGHT));

    for (int i = 0; i < 3 * (WIDTH + HEIGHT); i++) {
        const int c = i % 3, at = i / 3, down = at >= HEIGHT, n = down ? HEIGHT : WIDTH;

        for (int k = 0; k < n; k++) {
            double sum = 0, weights = 0;

            for (int t = -taps; t <= taps; t++) {
                const int j = sst_clamp_int(k + t, 0, n - 1);
                const double w = exp(-0.5 * t * t / (sigma * sigma));

                sum += w * *(down ? &sst_image_row(image, c, j)[at - HEIGHT] : &sst_image_row(image, c, at)[j]);
                weights += w;
            }
            line[k] = sum / weights;
        }
        for (int k = 0; k < n; k++)
            *(down ? &sst_image_row(image, c, k)[at - HEIGHT] : &sst_image_row(image, c, at)[k]) =
                (uint8_t)(line[k] + 0.5);
    }
    free(line);
}

static void good_pictures_are_not_warned_of(void **state SST_UNUSED)
{
    struct sst_notices n;

    notice(&n, &scene_views);
    assert_int_equal(n.count, 0);
    assert_true(isnan(n.jpeg_quality) && !n.jpeg_views && !n.soft && !n.missing);
    assert_true(n.edge_px > 0.15 && n.edge_px < 0.45);
}

static void qualities_of_jpeg_are_found_in_pixels_and_tables(void **state SST_UNUSED)
{
    static const int quality[] = { 25, 50, 75, 88 };

    for (size_t i = 0; i < ARRAY_LEN(quality); i++) {
        struct sst_image read = { 0 };
        uint8_t *data;
        size_t size;

        assert_int_equal(sst_image_encode_jpeg(&scene_views.views[0].image, quality[i], &data, &size), 0);
        assert_int_equal(sst_image_decode(&read, data, size, "a test"), 0);
        if (fabs(sst_image_jpeg_quality(&read) - quality[i]) > 2.5)
            fail_msg("%.1f for %d in pixels", sst_image_jpeg_quality(&read), quality[i]);
        if (fabs(sst_jpeg_quality(data, size, "a test") - quality[i]) > 1)
            fail_msg("%.1f for %d in tables", sst_jpeg_quality(data, size, "a test"), quality[i]);
        sst_image_fini(&read);
        free(data);
    }
    assert_true(isnan(sst_image_jpeg_quality(&scene_views.views[0].image)));
}

static void jpeg_is_warned_of_by_the_worst_view(void **state SST_UNUSED)
{
    const double files[VIEWS] = { 90, NAN, 60, 95 }, none[VIEWS] = { NAN, NAN, NAN, NAN };
    struct sst_notices n;

    notice(&n, &scene_views);
    sst_notice_jpeg_files(&n, none, VIEWS);
    sst_notice_describe(&n, 2, 2);
    assert_int_equal(n.count, 0);
    sst_notice_jpeg_files(&n, files, VIEWS);
    sst_notice_describe(&n, 2, 2);
    assert_int_equal(n.count, 1);
    assert_string_equal(n.notice[0].what, "jpeg");
    assert_true(n.jpeg_views == 3 && n.jpeg_quality == 60);
    assert_non_null(strstr(n.notice[0].text, "quality 60"));
}

static void a_soft_view_is_named(void **state SST_UNUSED)
{
    struct sst_lightfield lf;
    struct sst_notices n;

    copy_views(&lf);
    blur(&lf.views[2].image, 1);
    notice(&n, &lf);
    assert_int_equal(n.count, 1);
    assert_string_equal(n.notice[0].what, "soft-views");
    assert_true(n.soft == 1 && n.soft_view[2] && n.softest == 2 && n.soft_px > 0.4 && n.soft_px < 1.5);
    assert_non_null(strstr(n.notice[0].text, "row 1, column 0"));
    for (int k = 0; k < VIEWS; k++) {
        if (k != 2)
            blur(&lf.views[k].image, 1);
    }
    blur(&lf.views[0].image, 1);
    notice(&n, &lf);
    assert_true(n.edge_px > 0.5 && n.edge_px < 1.2);
    for (int k = 0; k < VIEWS; k++)
        blur(&lf.views[k].image, 1.7);
    notice(&n, &lf);
    assert_true(n.count >= 1 && !strcmp(n.notice[0].what, "blur") && n.edge_px > 1);
    sst_lightfield_fini(&lf);
}

static void noise_and_missing_views_are_warned_of(void **state SST_UNUSED)
{
    struct sst_lightfield lf;
    struct sst_notices n;
    uint64_t seed = 1;

    copy_views(&lf);
    for (int k = 0; k < VIEWS; k++) {
        for (int i = 0; i < 3 * HEIGHT; i++) {
            uint8_t *row = sst_image_row(&lf.views[k].image, i / HEIGHT, i % HEIGHT);

            for (int x = 0; x < WIDTH; x++)
                row[x] = (uint8_t)sst_clamp_int(row[x] + (int)(sst_random_u64(&seed) % 51) - 25, 0, 255);
        }
    }
    lf.views[3].present = false;
    notice(&n, &lf);
    assert_int_equal(n.count, 2);
    assert_string_equal(n.notice[0].what, "noise");
    assert_string_equal(n.notice[1].what, "missing-views");
    assert_int_equal(n.missing, 1);
    sst_lightfield_fini(&lf);
}

/* Summed up one view after the other, as in the service: a view that is covered has no edges, and is no soft one. */
static void views_are_summed_up_one_by_one(void **state SST_UNUSED)
{
    struct sst_notice_view view[VIEWS] = { 0 };
    struct sst_lightfield lf;
    struct sst_notices n;

    copy_views(&lf);
    sst_notice_sum(&n, view, 2, 2);
    sst_notice_describe(&n, 2, 2);
    assert_true(n.missing == VIEWS && n.count == 1 && isnan(n.edge_px) && !n.blank && !n.noise_levels);
    for (int k = 0; k < VIEWS; k++)
        sst_notice_view(&view[k], &lf.views[k].image, &lf.views[k].valid);
    sst_notice_sum(&n, view, 2, 2);
    sst_notice_describe(&n, 2, 2);
    assert_true(n.count == 0 && !n.missing && n.edge_px < 0.45);
    memset(lf.views[1].image.plane[0], 3, 3 * lf.views[1].image.stride * HEIGHT);
    sst_notice_view(&view[1], &lf.views[1].image, &lf.views[1].valid);
    sst_notice_sum(&n, view, 2, 2);
    sst_notice_describe(&n, 2, 2);
    assert_true(n.count == 1 && n.blank == 1 && n.first_blank == 1 && !n.soft);
    assert_string_equal(n.notice[0].what, "blank-views");
    assert_non_null(strstr(n.notice[0].text, "row 0, column 1"));
    sst_lightfield_fini(&lf);
}

static void exposures_apart_are_warned_of(void **state SST_UNUSED)
{
    struct sst_lightfield lf;
    struct sst_notices n;
    char text[320];

    copy_views(&lf);
    lf.skew_us = 4999;
    notice(&n, &lf);
    assert_int_equal(n.count, 0);
    lf.skew_us = 33000;
    notice(&n, &lf);
    assert_int_equal(n.count, 1);
    assert_string_equal(n.notice[0].what, "time-offsets");
    assert_non_null(strstr(n.notice[0].text, "33 ms apart"));
    assert_true(!sst_notice_skew(text, 0) && !sst_notice_skew(text, NAN) && sst_notice_skew(text, 5000));
    sst_lightfield_fini(&lf);
}

/* Black, one level, a few pixels: nothing is measured, and nothing is warned of. */
static void degenerate_pictures_have_no_figures(void **state SST_UNUSED)
{
    static const int sizes[][2] = { { 1, 1 }, { 7, 300 }, { 41, 42 }, { 100, 100 } };

    for (size_t i = 0; i < ARRAY_LEN(sizes); i++) {
        struct sst_image image = { 0 };

        assert_int_equal(sst_image_init(&image, sizes[i][0], sizes[i][1]), 0);
        assert_true(isnan(sst_image_edge_px(&image, NULL)) && isnan(sst_image_jpeg_quality(&image)));
        memset(image.plane[0], 255, 3 * image.stride * (size_t)image.height);
        assert_true(isnan(sst_image_edge_px(&image, NULL)) && isnan(sst_image_jpeg_quality(&image)));
        sst_image_fini(&image);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(good_pictures_are_not_warned_of),
        cmocka_unit_test(qualities_of_jpeg_are_found_in_pixels_and_tables),
        cmocka_unit_test(jpeg_is_warned_of_by_the_worst_view),
        cmocka_unit_test(a_soft_view_is_named),
        cmocka_unit_test(noise_and_missing_views_are_warned_of),
        cmocka_unit_test(views_are_summed_up_one_by_one),
        cmocka_unit_test(exposures_apart_are_warned_of),
        cmocka_unit_test(degenerate_pictures_have_no_figures),
    };

    return cmocka_run_group_tests(tests, setup, teardown);
}
