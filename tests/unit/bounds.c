/* The largest error of the formulas of design.md and of the geometry that run in double, against those of
 * tests/reference/ in wider numbers: random inputs, and those at which they cancel. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/lightfield/rectify/rectify.h"
#include "pipeline/method/labels/labels.h"
#include "pipeline/method/refine/parts.h"
#include "pipeline/method/render/render.h"
#include "simulators/scene/noise.h"
#include "tests/bounds.h"
#include "tests/camera_project.h"
#include "tests/reference/geometry.h"
#include "tests/reference/labels.h"
#include "tests/reference/refine.h"
#include "tests/reference/render.h"

static uint64_t seed = 20261125;

static unsigned below(unsigned n)
{
    return (unsigned)(sst_random_u64(&seed) % n);
}

static double in(double lo, double hi)
{
    return sst_random_in(&seed, lo, hi);
}

/* --- 5.1 ------------------------------------------------------------------------------------------------------------
 */

/* The score at the threshold that was found, and that no other threshold has a higher one. */
static void scores(void **state SST_UNUSED)
{
    struct bound b = {
        "epsilon search, Acc^m Cvg", "double, logarithms", "relative", "a few roundings times m", 1e-13, 0, 0, ""
    };

    for (int i = 0; i < 400; i++) {
        const int n = 1 + (int)below(200), m = (int)below(17);
        struct sst_map_u8 label, truth;
        struct sst_map_f32 h;
        struct sst_epsilon_result r;
        wide best = 0;

        assert_int_equal(sst_map_u8_init(&label, n, 1), 0);
        assert_int_equal(sst_map_u8_init(&truth, n, 1), 0);
        assert_int_equal(sst_map_f32_init(&h, n, 1), 0);
        for (int x = 0; x < n; x++) {
            label.data[x] = (uint8_t)(1 + below(2));
            truth.data[x] = (uint8_t)(below(8) ? 1 : 1 + below(2));
            h.data[x] = (float)(i % 2 ? below(9) / 4.0 : in(0, 3));
        }
        for (int at = 0; at < n; at++) {
            long tp = 0, kept = 0;

            for (int x = 0; x < n; x++) {
                kept += h.data[x] <= h.data[at];
                tp += h.data[x] <= h.data[at] && label.data[x] == truth.data[x];
            }
            best = fmaxl(best, ref_score(tp, kept, n, m));
        }
        if (best > 0) {
            assert_int_equal(sst_epsilon_search(&r, &label, &h, &truth, m), 0);
            bound_relative(&b, r.score, best, 0, "%d pixels, m = %d", n, m);
        }
        sst_map_u8_fini(&label);
        sst_map_u8_fini(&truth);
        sst_map_f32_fini(&h);
    }
    bound_end(&b);
}

/* --- 5.3 ------------------------------------------------------------------------------------------------------------
 */

/* Spreads of one step at the far end of the scale, where a sum of squares in float loses everything. */
static void fits(void **state SST_UNUSED)
{
    struct bound mean = { "label fit, mean", "exact sums, double", "px", "one quotient of 2^16 / 64", 1e-12, 0, 0, "" };
    struct bound sigma = {
        "label fit, sigma", "exact sums, double", "relative", "128-bit difference, one root", 1e-12, 0, 0, ""
    };
    int64_t *hist = calloc(SST_DISP_BINS, sizeof(*hist));
    struct sst_refine_config cfg;

    sst_refine_config_defaults(&cfg);
    cfg.matcher_sigma_px = 0;
    cfg.min_pixels = 1;
    assert_non_null(hist);
    for (int i = 0; i < 300; i++) {
        const int first = (int)below(65500), n = 2 + (int)below(5);
        int64_t value[8][2];
        struct sst_label_fit f;
        quad want_mean, want_variance;

        for (int k = 0; k < n; k++) {
            value[k][0] = first + 2 * k;
            value[k][1] = ((int64_t)1 << (i % 36)) + below(1U << 20);
            hist[value[k][0]] = value[k][1];
        }
        f = sst_refine_fit_histogram(hist, 0, &cfg);
        for (int k = 0; k < n; k++)
            hist[value[k][0]] = 0;
        ref_fit(&want_mean, &want_variance, value, n);
        if (f.sigma_px * 64 < 1.2 * sqrt(1.0 / 12) || fabs((double)(f.mean_px * 64 - want_mean)) > 1e-6)
            continue; /* at the floor, or a few pixels far out were left out */
        bound_note(&mean, fabs((double)(f.mean_px - want_mean / 64)), "%d values around %d", n, first);
        bound_note(&sigma, fabs((double)(f.sigma_px * 64 / quad_sqrt(want_variance) - 1)), "%d values around %d", n,
                   first);
    }
    free(hist);
    bound_end(&mean);
    bound_end(&sigma);
}

static void energies(void **state SST_UNUSED)
{
    struct bound g = { "label fit, density", "double", "relative", "3 |t| 2^-53, t up to 700", 3e-13, 0, 0, "" };
    struct bound d = { "E_d", "whole numbers", "absolute", "a quotient in steps of 2^-24", 6e-8, 0, 0, "" };
    struct bound e = { "E_n", "float", "absolute", "products that cancel lie near 0", 2e-6, 0, 0, "" };

    for (int i = 0; i < 20000; i++) {
        const struct sst_label_fit f = { .mean_px = in(-100, 900), .sigma_px = exp2(in(-8, 6)), .usable = true };
        const double at = f.mean_px + f.sigma_px * in(-37, 37);
        const uint32_t far = 1 + below(1U << 31), near = below(2) ? below(far) : 0;
        const double m[3] = { (float)in(-1, 1), (float)in(-1, 1), (float)in(-1, 1) };
        struct sst_region region = { .normals = 1 + below(1000000) };
        double sum[3];

        for (int c = 0; c < 3; c++) {
            region.sum_q20[c] = (int64_t)((double)region.normals * (below(3) ? m[c] : in(-1, 1)) / 2 * SST_SURFACE_ONE);
            sum[c] = (double)region.sum_q20[c] / SST_SURFACE_ONE;
        }
        sst_region_finish(&region);
        bound_relative(&g, sst_refine_fit_density(&f, at), ref_density(f.mean_px, f.sigma_px, at), 0, "%.2f sigma off",
                       fabs(at - f.mean_px) / f.sigma_px);
        bound_note(&d, fabs((double)(sst_energy_distance(near, far) - ref_energy_distance(near, far))), "%u of %u",
                   near, far);
        bound_note(
            &e,
            fabs((double)((quad)sst_energy_normal((float[3]){ (float)m[0], (float)m[1], (float)m[2] }, &region, 0.1) -
                          ref_energy_normal(m, sum, region.normals, 0.1))),
            "%lld normals", (long long)region.normals);
    }
    bound_end(&g);
    bound_end(&d);
    bound_end(&e);
}

/* Windows at the far corner of a large view, at the far end of the disparities. */
static void planes(void **state SST_UNUSED)
{
    enum { W = 4000, H = 21 };
    struct bound b = {
        "normals, slopes of planes", "exact sums, float result", "px per px", "rounding of the result", 1e-6, 0, 0, ""
    };
    struct sst_planes got = { .width = W, .height = H, .window = SST_NORMAL_WINDOW_MIN };
    int64_t *sums = malloc((size_t)W * SST_PLANE_SUMS * sizeof(*sums));
    int(*xyz)[3] = malloc(sizeof(*xyz) * H * SST_NORMAL_WINDOW_MIN);
    struct sst_map_u16 disp;

    got.at = malloc(sizeof(*got.at) * W * H);
    assert_true(sums && xyz && got.at);
    assert_int_equal(sst_map_u16_init(&disp, W, H), 0);
    for (int y = 0; y < H; y++) {
        for (int x = 0; x < W; x++)
            sst_map_u16_row(&disp, y)[x] = (uint16_t)(SST_DISP_MAX_Q6 - 300 + (x / 4 % 64) + (int)below(20));
    }
    sst_planes_fit(&got, &disp, sums);
    for (int i = 0; i < 200; i++) {
        const int x = i % 2 ? W - 1 - (int)below(30) : (int)below(W), y = H / 2;
        quad abc[3] = { 0 };
        int n = 0;

        for (int v = 0; v < H; v++) {
            for (int u = x - SST_NORMAL_WINDOW_MIN / 2; u <= x + SST_NORMAL_WINDOW_MIN / 2; u++) {
                if (u >= 0 && u < W)
                    memcpy(xyz[n++], ((int[3]){ u, v, sst_map_u16_row(&disp, v)[u] }), sizeof(*xyz));
            }
        }
        assert_true(ref_plane(abc, xyz, n, x, y));
        bound_note(
            &b,
            fmax(fabs((double)(got.at[y * W + x].a - abc[0] / 64)), fabs((double)(got.at[y * W + x].b - abc[1] / 64))),
            "column %d of %d", x, W);
    }
    sst_map_u16_fini(&disp);
    free(got.at);
    free(xyz);
    free(sums);
    bound_end(&b);
}

/* --- 5.4 ------------------------------------------------------------------------------------------------------------
 */

static void weights(void **state SST_UNUSED)
{
    struct bound d = { "W_d", "double", "relative", "3 |t| 2^-53, t up to 700", 3e-13, 0, 0, "" };
    struct bound s = { "W_s", "double", "of 1 + |middle| / half the range", "a few roundings", 1e-15, 0, 0, "" };

    for (int i = 0; i < 40000; i++) {
        const double sigma = exp2(in(-20, 12)), focus = in(-100, 900), disp = focus + sigma * in(-37, 37);
        const double c = below(3) ? in(0, 1) : 0, lo = in(-100, 900), hi = lo + (below(4) ? exp2(in(-9, 9)) : 0);
        const double at = below(3) ? in(lo, hi) : below(2) ? lo : hi;

        bound_relative(&d, sst_weight_depth(focus, disp, sigma, c), ref_weight_depth(focus, disp, sigma, c), 0,
                       "%.2f sigma off, C1 %.3f", fabs(focus - disp) / sigma, c);
        bound_note(
            &s,
            fabs((double)(sst_weight_label(at, lo, hi, 1.0 / 64, c) - ref_weight_label(at, lo, hi, 1.0 / 64, c))) /
                (1 + fabs(lo + hi) / fmax(hi - lo, 1.0 / 64)),
            "range of %.4g px from %.2f on", hi - lo, lo);
    }
    bound_end(&d);
    bound_end(&s);
}

/* --- geometry
 * --------------------------------------------------------------------------------------------------------- */

static struct sst_calib_camera draw_camera(void)
{
    struct sst_calib_camera cam = {
        .known = true, .fx = in(300, 3000), .fy = in(300, 3000), .cx = in(0, 2000), .cy = in(0, 1500)
    };
    const double v[3] = { in(-3, 3), in(-1, 1), in(-1, 1) };
    const double k[8] = { -0.26, 0.09, 1e-3, -2e-4, -0.002, 0, 0, 0 };

    cam.lens = 8;
    for (int i = 0; i < 8; i++)
        cam.k[i] = k[i] * in(0, 1);
    sst_rotation_from_vector(v, cam.rotation);
    for (int i = 0; i < 3; i++)
        cam.position_mm[i] = in(-1000, 1000);
    return cam;
}

static void lenses(void **state SST_UNUSED)
{
    struct bound x = { "projection", "double", "px", "2^12 px and 20 roundings", 1e-11, 0, 0, "" };
    struct bound u = { "lens, inverse", "double, Newton", "of (a, b)", "calib.h", 1e-11, 0, 0, "" };

    for (int i = 0; i < 4000; i++) {
        const struct sst_calib_camera cam = draw_camera();
        const double a = in(-0.6, 0.6), b = in(-0.6, 0.6), z = exp2(in(3, 17));
        double X[3], px[2], back[2];
        wide want[2];

        for (int r = 0; r < 3; r++)
            X[r] = cam.position_mm[r] + z * (cam.rotation[r] * a + cam.rotation[3 + r] * b + cam.rotation[6 + r]);
        assert_true(camera_project(&cam, X, &px[0], &px[1]));
        ref_project(&cam, X, &want[0], &want[1]);
        /* The point itself is known to 2^-53 of its distance from the origin, which is far compared with z. */
        bound_note(&x, (double)(fabsl(px[0] - want[0]) + fabsl(px[1] - want[1])) / (1 + 1000 / z), "depth %.0f mm", z);
        ref_distort(&cam, a, b, &want[0], &want[1]);
        assert_true(sst_camera_undistort(&cam, (double)want[0], (double)want[1], &back[0], &back[1]));
        bound_note(&u, fabs(back[0] - a) + fabs(back[1] - b), "a %.3f, b %.3f, k1 %.3f", a, b, cam.k[0]);
    }
    bound_end(&x);
    bound_end(&u);
}

/* Angles near 0, near pi, and any. */
static void rotations(void **state SST_UNUSED)
{
    struct bound m = { "rotation from a vector", "double", "absolute", "10 roundings", 4e-15, 0, 0, "" };
    struct bound v = {
        "rotation to a vector", "double", "rad, of the rotation", "square root of 2^-53 at pi alone", 4e-15, 0, 0, ""
    };

    for (int i = 0; i < 20000; i++) {
        const double pi = acos(-1), tiny = exp2(in(-60, -1)),
                     angle = i % 3 == 0   ? tiny
                             : i % 3 == 1 ? pi - tiny
                                          : in(0, pi);
        double axis[3] = { in(-1, 1), in(-1, 1), in(-1, 1) }, back[3], got[9];
        const double length = sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
        wide want[9], again[9];
        double worst = 0, turned = 0;

        for (int c = 0; c < 3; c++)
            axis[c] = i % 7 ? axis[c] * angle / length : c == i % 3 ? angle : 0;
        sst_rotation_from_vector(axis, got);
        ref_rotation(axis, want);
        sst_rotation_to_vector(got, back);
        ref_rotation(back, again);
        for (int c = 0; c < 9; c++) {
            worst = fmax(worst, (double)fabsl(got[c] - want[c]));
            turned = fmax(turned, (double)fabsl(again[c] - got[c]));
        }
        bound_note(&m, worst, "angle %.17g", angle);
        bound_note(&v, turned, "angle %.17g", angle);
    }
    bound_end(&m);
    bound_end(&v);
}

/* A rectified pixel through homography and lens, against the same in wide numbers. */
static void rectified_points(void **state SST_UNUSED)
{
    struct bound b = { "rectifying chain, exact", "double", "px", "2^12 px and 40 roundings", 1e-10, 0, 0, "" };
    struct bound q = { "rectifying maps", "cubic pieces, 1/256 px", "px", "rectify.h: 1/256", 1.0 / 256, 0, 0, "" };

    for (int trial = 0; trial < 6; trial++) {
        struct sst_rectify_map *map;
        struct sst_rectified to;
        struct sst_calib calib;

        assert_int_equal(sst_calib_init(&calib, 2, 3), 0);
        calib.width = 640;
        calib.height = 480;
        for (int k = 0; k < 6; k++) {
            struct sst_calib_camera cam = { .known = true,
                                            .fx = 560 + in(-9, 9),
                                            .fy = 560 + in(-9, 9),
                                            .cx = 320 + in(-9, 9),
                                            .cy = 240 + in(-9, 9),
                                            .lens = 5,
                                            .gain = { 1, 1, 1 } };
            const double turn[3] = { in(-0.03, 0.03), in(-0.03, 0.03), in(-0.03, 0.03) };

            cam.k[0] = in(-0.3, 0.05);
            cam.k[1] = in(-0.05, 0.1);
            sst_rotation_from_vector(k == calib.reference ? (const double[3]){ 0, 0, 0 } : turn, cam.rotation);
            cam.position_mm[0] = 100 * (k % 3 - calib.reference % 3) + (k == calib.reference ? 0 : in(-2, 2));
            cam.position_mm[1] = 100 * (k / 3 - calib.reference / 3) + (k == calib.reference ? 0 : in(-2, 2));
            calib.camera[k] = cam;
        }
        assert_int_equal(sst_rectify_plan(&to, &calib, &(struct sst_rectify_config){ 0 }), 0);
        for (int k = 0; k < 6; k++) {
            const struct sst_calib_camera *cam = &calib.camera[k];

            assert_int_equal(sst_rectify_map_create(&map, &to, &calib, k), 0);
            for (int i = 0; i < 300; i++) {
                const double x = below((unsigned)to.width), y = below((unsigned)to.height);
                wide ray[3] = { (x - to.cx) / ((wide)to.focal_px * to.view[k].scale),
                                (y - to.cy) / ((wide)to.focal_px * to.view[k].scale), 1 },
                     rig[3], p[3], want[2];
                int32_t xy_q8[2];
                double raw[2];

                if (!sst_rectify_point(&to, &calib, k, (const double[2]){ x, y }, raw))
                    continue;
                for (int r = 0; r < 3; r++) {
                    rig[r] = 0;
                    for (int c = 0; c < 3; c++)
                        rig[r] += to.rotation[3 * c + r] * ray[c];
                }
                for (int r = 0; r < 3; r++) {
                    p[r] = 0;
                    for (int c = 0; c < 3; c++)
                        p[r] += cam->rotation[3 * r + c] * rig[c];
                }
                ref_distort(cam, p[0] / p[2], p[1] / p[2], &want[0], &want[1]);
                bound_note(&b, (double)(fabsl(raw[0] - want[0]) + fabsl(raw[1] - want[1])), "view %d, pixel %.0f %.0f",
                           k, x, y);
                sst_rectify_map_row(map, x, y, 1, xy_q8);
                if (xy_q8[0] != INT32_MIN)
                    bound_note(&q,
                               (double)fmaxl(fabsl(xy_q8[0] / 256.0L - want[0]), fabsl(xy_q8[1] / 256.0L - want[1])),
                               "view %d, pixel %.0f %.0f", k, x, y);
            }
            sst_rectify_map_destroy(map);
        }
        sst_calib_fini(&calib);
    }
    bound_end(&b);
    bound_end(&q);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scores),    cmocka_unit_test(fits),
        cmocka_unit_test(energies),  cmocka_unit_test(planes),
        cmocka_unit_test(weights),   cmocka_unit_test(lenses),
        cmocka_unit_test(rotations), cmocka_unit_test(rectified_points),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
