/* Pictures straight from raw frames against pictures of rectified views and against the exact ones. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdint.h>
#include <unistd.h>

#include "base/log.h"
#include "pipeline/method/render/render_internal.h"
#include "tests/raw_field.h"
#include "tests/small.h"
#include "tests/test.h"

#define WIDTH  256
#define HEIGHT 192

static struct raw_field field;
static struct sst_renderer *from_raw, *from_rectified;

/* A slanted plane of disparities and two labels: what weights see is the same for both ways. */
static int add_maps(struct sst_lightfield *lf)
{
    int err = 0;

    for (int k = 0; k < lf->rows * lf->cols && !err; k++) {
        struct sst_view *v = &lf->views[k];

        err = sst_map_u16_init(&v->disp, lf->width, lf->height);
        err = err ? err : sst_map_u8_init(&v->label, lf->width, lf->height);
        for (int y = 0; y < lf->height && !err; y++) {
            for (int x = 0; x < lf->width; x++) {
                sst_map_u16_row(&v->disp, y)[x] = (uint16_t)(64 * 4 + 2 * x);
                sst_map_u8_row(&v->label, y)[x] = (uint8_t)(1 + (y > lf->height / 2));
            }
        }
    }
    return err;
}

static int set_up(void **state SST_UNUSED)
{
    struct sst_sim_settings s;

    raw_field_settings(&s, "cd-cases", 2, 3, WIDTH, HEIGHT, 4);
    if (raw_field_make(&field, &s) || add_maps(&field.raw) || add_maps(&field.rectified) ||
        sst_renderer_create(&from_raw, &field.raw, 2) || sst_renderer_create(&from_rectified, &field.rectified, 2))
        return -1;
    return 0;
}

static int tear_down(void **state SST_UNUSED)
{
    sst_renderer_destroy(from_raw);
    sst_renderer_destroy(from_rectified);
    raw_field_free(&field);
    return 0;
}

static struct sst_render_config refocus(double focus_px, double aperture)
{
    struct sst_render_config cfg;

    sst_render_config_defaults(&cfg);
    cfg.method = SST_RENDER_REFOCUS;
    cfg.focus_px = focus_px;
    cfg.aperture = aperture;
    cfg.threads = 2;
    return cfg;
}

struct picture {
    struct sst_image image;
    struct sst_map_u8 valid;
};

static struct picture render(struct sst_renderer *r, const struct sst_render_config *cfg)
{
    struct picture p = { 0 };

    assert_int_equal(sst_image_init(&p.image, field.raw.width, field.raw.height), 0);
    assert_int_equal(sst_map_u8_init(&p.valid, field.raw.width, field.raw.height), 0);
    assert_int_equal(sst_render(r, cfg, &p.image, &p.valid), 0);
    return p;
}

static void discard(struct picture *p)
{
    sst_image_fini(&p->image);
    sst_map_u8_fini(&p->valid);
}

static bool equal(const struct picture *a, const struct picture *b)
{
    for (int y = 0; y < a->image.height; y++) {
        for (int c = 0; c < 3; c++) {
            if (memcmp(sst_image_row(&a->image, c, y), sst_image_row(&b->image, c, y), (size_t)a->image.width))
                return false;
        }
        if (memcmp(sst_map_u8_row(&a->valid, y), sst_map_u8_row(&b->valid, y), (size_t)a->image.width))
            return false;
    }
    return true;
}

/* Over the middle, where all views see. */
static double psnr(const struct picture *a, const struct picture *b, const double *exact)
{
    const int margin = 40;
    double sum = 0;
    int n = 0;

    for (int c = 0; c < 3; c++) {
        for (int y = margin; y < HEIGHT - margin; y++) {
            for (int x = margin; x < WIDTH - margin; x++, n++) {
                const double d = sst_image_row(&a->image, c, y)[x] -
                                 (b ? sst_image_row(&b->image, c, y)[x] : exact[(c * HEIGHT + y) * WIDTH + x]);

                sum += d * d;
            }
        }
    }
    return 10 * log10(255 * 255 / fmax(sum / n, 1e-9));
}

/* Where rays fall on whole pixels both ways do the same: the bytes of sst_rectify_view(). */
static void one_view_is_that_view_rectified(void **state SST_UNUSED)
{
    const struct sst_render_config cfg = refocus(5, 0);
    struct picture a = render(from_raw, &cfg), b = render(from_rectified, &cfg);
    const struct sst_image *view = &field.rectified.views[field.raw.ref_view].image;

    assert_true(equal(&a, &b));
    for (int y = 50; y < HEIGHT - 50; y++)
        assert_memory_equal(sst_image_row(&a.image, 1, y) + 50, sst_image_row(view, 1, y) + 50, WIDTH - 100);
    discard(&a);
    discard(&b);
}

static void one_interpolation_is_nearer_to_the_truth_than_two(void **state SST_UNUSED)
{
    double *exact = malloc(3 * sizeof(*exact) * (size_t)(WIDTH * HEIGHT));

    assert_non_null(exact);
    for (int i = 0; i < 2; i++) {
        const struct sst_render_config cfg = refocus(7.37, i ? INFINITY : 1);
        struct picture a = render(from_raw, &cfg), b = render(from_rectified, &cfg);
        const double same = psnr(&a, &b, NULL);
        double raw, rectified;

        assert_int_equal(raw_field_truth(&field, &cfg, exact), 0);
        raw = psnr(&a, NULL, exact);
        rectified = psnr(&b, NULL, exact);
        print_message("raw and rectified: %.1f dB; against the truth: raw %.1f dB, rectified %.1f dB\n", same, raw,
                      rectified);
        assert_true(same > 34);
        assert_true(raw > 30);
        assert_true(raw > rectified + 0.3);
        discard(&a);
        discard(&b);
    }
    free(exact);
}

static void threads_do_not_matter(void **state SST_UNUSED)
{
    struct sst_render_config cfg = refocus(7.37, INFINITY);
    struct sst_renderer *other;
    struct picture a, b;

    cfg.method = SST_RENDER_SST;
    a = render(from_raw, &cfg);
    assert_int_equal(sst_renderer_create(&other, &field.raw, 1), 0);
    cfg.threads = 1;
    b = render(other, &cfg);
    assert_true(equal(&a, &b));
    sst_renderer_destroy(other);
    discard(&a);
    discard(&b);
}

/* Weights come from rectified positions: validity is that of the other way where all views see, colours are near. The
 * tiny sigma takes all pixels but a column through the exact form. */
static void weights_are_those_of_rectified_views(void **state SST_UNUSED)
{
    struct sst_render_config cfg = refocus(6.2, INFINITY);

    cfg.method = SST_RENDER_SST;
    cfg.unsupported = SST_UNSUPPORTED_INVALID;
    for (int i = 0; i < 2; i++) {
        struct picture a, b;

        cfg.sigma_px = i ? 0.004 : 1;
        cfg.c1 = i ? 0 : 0.01;
        cfg.c2 = i ? 0 : 0.5;
        a = render(from_raw, &cfg);
        b = render(from_rectified, &cfg);
        assert_true(psnr(&a, &b, NULL) > 34);
        for (int y = 40; y < HEIGHT - 40; y++)
            assert_memory_equal(sst_map_u8_row(&a.valid, y) + 40, sst_map_u8_row(&b.valid, y) + 40, WIDTH - 80);
        discard(&a);
        discard(&b);
    }
}

/* Raw frames are rectified for this: the rays that rectified views explain, but for the few whose colours just agree.
 */
static void rays_are_explained_as_in_rectified_views(void **state SST_UNUSED)
{
    struct sst_renderer *r[2] = { from_raw, from_rectified };
    struct sst_lightfield *lf[2] = { &field.raw, &field.rectified };
    struct sst_render_config cfg = refocus(5, INFINITY);
    struct sst_render_plan plan[2];
    int explained = 0, differ = 0, n = 0;

    cfg.method = SST_RENDER_SST;
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < lf[i]->rows * lf[i]->cols; k++)
            assert_int_equal(sst_map_u8_init(&lf[i]->views[k].confidence, lf[i]->width, lf[i]->height), 0);
        assert_int_equal(sst_render_plan_init(&plan[i], r[i], &cfg), 0);
        assert_int_equal(explainer_prepare(plan[i].explainer), 0);
    }
    for (int y = 0; y < HEIGHT; y += 3) {
        for (int x = 0; x < WIDTH; x += 3, n++) {
            const bool from[2] = { explainer_contradicts(plan[0].explainer, 1, x, y),
                                   explainer_contradicts(plan[1].explainer, 1, x, y) };

            explained += !from[0];
            differ += from[0] != from[1];
        }
    }
    print_message("explained: %d of %d, %d otherwise from rectified views\n", explained, n, differ);
    assert_true(explained > n / 20 && differ <= n / 200);
    for (int i = 0; i < 2; i++) {
        sst_render_plan_fini(&plan[i]);
        for (int k = 0; k < lf[i]->rows * lf[i]->cols; k++)
            sst_map_u8_fini(&lf[i]->views[k].confidence);
    }
}

/* The rays that explain a pixel add up to the pixel, and none comes from outside its raw frame. */
static void rays_add_up_to_the_picture(void **state SST_UNUSED)
{
    struct sst_render_config cfg = refocus(7.37, INFINITY);
    struct picture a;
    int fewer = 0;

    cfg.method = SST_RENDER_SST;
    a = render(from_raw, &cfg);
    for (int y = 0; y < HEIGHT; y += 7) {
        for (int x = 0; x < WIDTH; x += 5) {
            struct sst_ray rays[SST_MAX_VIEWS];
            double rgb[3] = { 0 };
            int n;

            assert_true((n = sst_render_rays(from_raw, &cfg, x, y, rays)) >= 0);
            for (int i = 0; i < n; i++) {
                double raw[2];

                assert_true(sst_rectify_point(field.raw.rectified, field.raw.calibration, rays[i].view,
                                              (const double[2]){ rays[i].x, rays[i].y }, raw) ||
                            rays[i].x < 1 || rays[i].y < 1 || rays[i].x > WIDTH - 2 || rays[i].y > HEIGHT - 2);
                for (int c = 0; c < 3; c++)
                    rgb[c] += rays[i].share * rays[i].colour[c];
            }
            fewer += n < 6;
            for (int c = 0; c < 3; c++)
                assert_true(fabs(rgb[c] - sst_image_row(&a.image, c, y)[x]) <= 0.51);
        }
    }
    assert_true(fewer > 20);
    discard(&a);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        serial_test(one_view_is_that_view_rectified),
        plain_test(one_interpolation_is_nearer_to_the_truth_than_two),
        thread_test(threads_do_not_matter),
        serial_test(weights_are_those_of_rectified_views),
        serial_test(rays_are_explained_as_in_rectified_views),
        serial_test(rays_add_up_to_the_picture),
    };

    return cmocka_run_group_tests(tests, set_up, tear_down);
}
