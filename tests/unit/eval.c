/* pipeline/eval: figures of merit against hand-worked values and direct loops. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "pipeline/eval/eval.h"
#include "simulators/scene/noise.h"
#include "tests/test.h"

#define CLOSE(a, b, eps) assert_true(fabs((double)(a) - (double)(b)) <= (eps))

static uint64_t seed = 7;

static struct sst_map_f32 map_f32(int width, const float *values)
{
    struct sst_map_f32 map;

    assert_int_equal(sst_map_f32_init(&map, width, 1), 0);
    memcpy(map.data, values, (size_t)width * sizeof(float));
    return map;
}

static struct sst_map_u8 map_u8(int width, const uint8_t *values)
{
    struct sst_map_u8 map;

    assert_int_equal(sst_map_u8_init(&map, width, 1), 0);
    memcpy(map.data, values, (size_t)width);
    return map;
}

/* Errors 0, 0.5, 1.5, 3, 8, unknown, unknown; the last pixel has no truth. */
static void disparity_errors(void **state SST_UNUSED)
{
    struct sst_map_f32 e = map_f32(8, (float[]){ 5, 5.5F, 6.5F, 2, 13, INFINITY, NAN, 4 });
    struct sst_map_f32 t = map_f32(8, (float[]){ 5, 5, 5, 5, 5, 5, 5, INFINITY });
    struct sst_map_u8 mask = map_u8(8, (uint8_t[]){ 255, 255, 255, 0, 0, 0, 0, 255 });
    struct sst_map_u8 none = map_u8(8, (uint8_t[8]){ 0 }), small = map_u8(7, (uint8_t[7]){ 0 });
    struct sst_disparity_error d, m, sum = { 0 };

    assert_int_equal(sst_eval_disparity(&d, &e, &t, NULL), 0);
    assert_int_equal(d.pixels, 7);
    CLOSE(d.bad_half, 500.0 / 7, 1e-9);
    CLOSE(d.bad1, 500.0 / 7, 1e-9);
    CLOSE(d.bad2, 400.0 / 7, 1e-9);
    CLOSE(d.bad4, 300.0 / 7, 1e-9);
    CLOSE(d.rmse, sqrt((0.25 + 2.25 + 9 + 64) / 5), 1e-9);
    CLOSE(d.mean_abs, 13.0 / 5, 1e-9);
    CLOSE(d.density, 500.0 / 7, 1e-9);
    assert_int_equal(sst_eval_disparity(&m, &e, &t, &mask), 0);
    assert_int_equal(m.pixels, 3);
    CLOSE(m.bad1, 100.0 / 3, 1e-9);
    CLOSE(m.rmse, sqrt(2.5 / 3), 1e-9);
    sst_eval_disparity_merge(&sum, &d);
    CLOSE(sum.rmse, d.rmse, 1e-12);
    sst_eval_disparity_merge(&sum, &m);
    assert_int_equal(sum.pixels, 10);
    CLOSE(sum.bad1, 60, 1e-9);
    CLOSE(sum.density, 80, 1e-9);
    CLOSE(sum.rmse, sqrt((75.5 + 2.5) / 8), 1e-9);
    CLOSE(sum.mean_abs, 15.0 / 8, 1e-9);
    assert_int_equal(sst_eval_disparity(&d, &e, &t, &none), 0);
    assert_true(d.pixels == 0 && isnan(d.bad1) && isnan(d.rmse) && isnan(d.density));
    sst_eval_disparity_merge(&sum, &d);
    assert_int_equal(sum.pixels, 10);
    CLOSE(sum.bad1, 60, 1e-9);
    sum = (struct sst_disparity_error){ 0 };
    sst_eval_disparity_merge(&sum, &d);
    assert_true(isnan(sum.bad1) && isnan(sum.rmse));
    assert_int_equal(sst_eval_disparity(&m, &e, &t, &small), -EINVAL);
    sst_map_f32_fini(&e);
    sst_map_f32_fini(&t);
    sst_map_u8_fini(&mask);
    sst_map_u8_fini(&none);
    sst_map_u8_fini(&small);
}

/* Errors of 0, 2/64, 5/64 and 0.2 px either way, and an unknown pixel: the limits of narrow light fields. */
static void narrow_errors(void **state SST_UNUSED)
{
    struct sst_map_f32 e = map_f32(6, (float[]){ 2, 2.03125F, 1.96875F, 2.078125F, 1.8F, INFINITY });
    struct sst_map_f32 t = map_f32(6, (float[]){ 2, 2, 2, 2, 2, 2 });
    struct sst_map_u8 mask = map_u8(6, (uint8_t[]){ 255, 255, 0, 0, 0, 0 });
    struct sst_disparity_error d, m;

    assert_int_equal(sst_eval_disparity(&d, &e, &t, NULL), 0);
    CLOSE(d.bad003, 500.0 / 6, 1e-9);
    CLOSE(d.bad007, 300.0 / 6, 1e-9);
    CLOSE(d.bad_half, 100.0 / 6, 1e-9);
    assert_int_equal(sst_eval_disparity(&m, &e, &t, &mask), 0);
    CLOSE(m.bad003, 50, 1e-9);
    CLOSE(m.bad007, 0, 0);
    sst_eval_disparity_merge(&d, &m);
    CLOSE(d.bad003, 600.0 / 8, 1e-9);
    CLOSE(d.bad007, 300.0 / 8, 1e-9);
    sst_map_f32_fini(&e);
    sst_map_f32_fini(&t);
    sst_map_u8_fini(&mask);
}

/* A near thing of 4 px disparity before a wall of 1 px; one spacing to the right it has moved 3 px more to the left. */
static void visible_in_the_neighbour(void **state SST_UNUSED)
{
    struct sst_map_f32 here = map_f32(10, (float[]){ 1, 1, 1, 1, 1, 1, 4, 4, 1, INFINITY });
    struct sst_map_f32 right = map_f32(10, (float[]){ 1, 1, 4, 4, 1, 1, 1, 1, 1, 1 });
    struct sst_map_u8 mask = map_u8(10, (uint8_t[10]){ 0 });

    assert_int_equal(sst_eval_visible(&mask, &here, &right, 1, 0), 0);
    assert_memory_equal(mask.data, ((uint8_t[]){ 0, 255, 255, 0, 0, 255, 255, 255, 255, 0 }), 10);
    /* In the view below everything moves out of the picture of one row; marked pixels stay. */
    assert_int_equal(sst_eval_visible(&mask, &here, &right, 0, 1), 0);
    assert_int_equal(mask.data[1], 255);
    assert_int_equal(mask.data[0], 0);
    sst_map_f32_fini(&here);
    sst_map_f32_fini(&right);
    sst_map_u8_fini(&mask);
}

/* Truth 1 1 1 2 2 3 0, estimate 1 1 0 2 1 9 1: IoU of 1 is 2/4, of 2 is 1/2, of 3 is 0, of 9 is 0; truth 0 is left out.
 */
static void confusion(void **state SST_UNUSED)
{
    struct sst_map_u8 t = map_u8(7, (uint8_t[]){ 1, 1, 1, 2, 2, 3, 0 });
    struct sst_map_u8 e = map_u8(7, (uint8_t[]){ 1, 1, 0, 2, 1, 9, 1 });
    struct sst_map_u8 bad = map_u8(7, (uint8_t[]){ 1, 1, 65, 2, 1, 9, 1 }), small = map_u8(6, (uint8_t[6]){ 0 });
    struct sst_confusion c = { { { 0 } } };

    assert_true(isnan(sst_confusion_miou(&c)) && isnan(sst_confusion_coverage(&c)) &&
                isnan(sst_confusion_accuracy(&c)));
    assert_int_equal(sst_confusion_add(&c, &e, &t), 0);
    CLOSE(sst_confusion_iou(&c, 1), 50, 1e-12);
    CLOSE(sst_confusion_iou(&c, 2), 50, 1e-12);
    CLOSE(sst_confusion_iou(&c, 3), 0, 0);
    CLOSE(sst_confusion_iou(&c, 9), 0, 0);
    assert_true(isnan(sst_confusion_iou(&c, 5)));
    CLOSE(sst_confusion_miou(&c), 100.0 / 3, 1e-12);
    CLOSE(sst_confusion_coverage(&c), 500.0 / 6, 1e-12);
    CLOSE(sst_confusion_accuracy(&c), 60, 1e-12);
    assert_int_equal(sst_confusion_add(&c, &bad, &t), -EINVAL);
    assert_int_equal(sst_confusion_add(&c, &small, &t), -EINVAL);
    CLOSE(sst_confusion_accuracy(&c), 60, 1e-12);
    sst_map_u8_fini(&t);
    sst_map_u8_fini(&e);
    sst_map_u8_fini(&bad);
    sst_map_u8_fini(&small);
}

static void fill(struct sst_image *img, int width, int height, int value)
{
    assert_int_equal(sst_image_init(img, width, height), 0);
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < height; y++) {
            for (int x = 0; x < width; x++)
                sst_image_row(img, c, y)[x] = value < 0 ? (uint8_t)sst_random_u64(&seed) : (uint8_t)value;
        }
    }
}

static void psnr(void **state SST_UNUSED)
{
    struct sst_image a, b, c;
    struct sst_map_u8 mask;

    fill(&a, 4, 2, 100);
    fill(&b, 4, 2, 100);
    fill(&c, 3, 2, 100);
    assert_int_equal(sst_map_u8_init(&mask, 4, 2), 0);
    CLOSE(sst_psnr(&a, &b, NULL), 100, 0);
    assert_true(isnan(sst_psnr(&a, &b, &mask)));
    assert_true(isnan(sst_psnr(&a, &c, NULL)));
    /* One sample of 24 off by 60: 10 log10(255^2 24 / 3600) = 26.3699 dB; in a mask of this pixel and another one of 6.
     */
    sst_image_row(&b, 1, 1)[2] = 160;
    CLOSE(sst_psnr(&a, &b, NULL), 10 * log10(65025.0 * 24 / 3600), 1e-12);
    CLOSE(sst_psnr(&a, &b, NULL), 26.37, 0.001);
    sst_map_u8_row(&mask, 1)[2] = 255;
    sst_map_u8_row(&mask, 0)[0] = 1;
    CLOSE(sst_psnr(&a, &b, &mask), 10 * log10(65025.0 * 6 / 3600), 1e-12);
    sst_map_u8_row(&mask, 1)[2] = 0;
    CLOSE(sst_psnr(&a, &b, &mask), 100, 0);
    sst_image_fini(&a);
    sst_image_fini(&b);
    sst_image_fini(&c);
    sst_map_u8_fini(&mask);
}

static double luma(const struct sst_image *img, int x, int y)
{
    return 0.299 * sst_image_row(img, 0, y)[x] + 0.587 * sst_image_row(img, 1, y)[x] +
           0.114 * sst_image_row(img, 2, y)[x];
}

/* SSIM of one pixel as the definition has it: weighted means first, then central moments about them. */
static double ssim_direct(const struct sst_image *a, const struct sst_image *b, int x0, int y0)
{
    const double c1 = 6.5025, c2 = 58.5225;
    double weight = 0, ma = 0, mb = 0, va = 0, vb = 0, cov = 0;

    for (int pass = 0; pass < 2; pass++) {
        for (int y = y0 - 5; y <= y0 + 5; y++) {
            for (int x = x0 - 5; x <= x0 + 5; x++) {
                const double w = exp(-((x - x0) * (x - x0) + (y - y0) * (y - y0)) / 4.5);

                if (x < 0 || y < 0 || x >= a->width || y >= a->height)
                    continue;
                if (pass == 0) {
                    weight += w;
                    ma += w * luma(a, x, y);
                    mb += w * luma(b, x, y);
                    continue;
                }
                va += w / weight * (luma(a, x, y) - ma) * (luma(a, x, y) - ma);
                vb += w / weight * (luma(b, x, y) - mb) * (luma(b, x, y) - mb);
                cov += w / weight * (luma(a, x, y) - ma) * (luma(b, x, y) - mb);
            }
        }
        if (pass == 0) {
            ma /= weight;
            mb /= weight;
        }
    }
    return (2 * ma * mb + c1) * (2 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
}

static void ssim_equals_the_definition(void **state SST_UNUSED)
{
    static const int sizes[][2] = { { 1, 1 }, { 3, 2 }, { 11, 11 }, { 30, 17 }, { 1, 40 } };

    for (size_t i = 0; i < ARRAY_LEN(sizes); i++) {
        const int width = sizes[i][0], height = sizes[i][1];
        double want = 0, want_masked = 0, masked = 0, got;
        struct sst_map_u8 mask;
        struct sst_image a, b;

        fill(&a, width, height, -1);
        fill(&b, width, height, -1);
        assert_int_equal(sst_map_u8_init(&mask, width, height), 0);
        for (int p = 0; p < width * height; p++) {
            const int x = p % width, y = p / width;

            if (p % 2)
                sst_image_row(&b, 0, y)[x] = sst_image_row(&a, 0, y)[x];
            sst_map_u8_row(&mask, y)[x] = y % 3 == 0 && x % 2 == 0 ? 255 : 0;
        }
        for (int p = 0; p < width * height; p++) {
            const double s = ssim_direct(&a, &b, p % width, p / width);

            want += s;
            want_masked += sst_map_u8_row(&mask, p / width)[p % width] ? s : 0;
            masked += sst_map_u8_row(&mask, p / width)[p % width] != 0;
        }
        assert_int_equal(sst_ssim(&got, &a, &b, NULL), 0);
        CLOSE(got, want / (width * height), 1e-9);
        assert_int_equal(sst_ssim(&got, &a, &b, &mask), 0);
        CLOSE(got, want_masked / masked, 1e-9);
        assert_int_equal(sst_ssim(&got, &a, &a, NULL), 0);
        CLOSE(got, 1, 1e-12);
        sst_image_fini(&a);
        sst_image_fini(&b);
        sst_map_u8_fini(&mask);
    }
}

/* Constant pictures have no variance: only the term of the means is left, (2 100 110 + C1) / (100^2 + 110^2 + C1). */
static void ssim_of_constant_pictures(void **state SST_UNUSED)
{
    struct sst_image a, b, c;
    struct sst_map_u8 mask;
    double got = 5;

    fill(&a, 20, 13, 100);
    fill(&b, 20, 13, 110);
    fill(&c, 20, 12, 110);
    assert_int_equal(sst_map_u8_init(&mask, 20, 13), 0);
    assert_int_equal(sst_ssim(&got, &a, &b, NULL), 0);
    CLOSE(got, 22006.5025 / 22106.5025, 1e-9);
    assert_int_equal(sst_ssim(&got, &a, &c, NULL), -EINVAL);
    CLOSE(got, 22006.5025 / 22106.5025, 1e-9);
    assert_int_equal(sst_ssim(&got, &a, &b, &mask), 0);
    assert_true(isnan(got));
    sst_image_fini(&a);
    sst_image_fini(&b);
    sst_image_fini(&c);
    sst_map_u8_fini(&mask);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(disparity_errors),
        cmocka_unit_test(narrow_errors),
        cmocka_unit_test(visible_in_the_neighbour),
        cmocka_unit_test(confusion),
        cmocka_unit_test(psnr),
        cmocka_unit_test(ssim_equals_the_definition),
        cmocka_unit_test(ssim_of_constant_pictures),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
