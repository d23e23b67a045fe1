/* pipeline/method/refine: fits, distances, planes, energies against hand-worked values and plain loops; rules of the
 * driver.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "pipeline/method/refine/parts.h"
#include "simulators/scene/noise.h"
#include "tests/test.h"

#define CLOSE(a, b, eps) assert_true(fabs((double)(a) - (double)(b)) <= (eps))

static uint64_t seed = 1;

static struct sst_label_fit fit_of(const int64_t (*pairs)[2], int n, double disp_min_px, double sigma_px,
                                   int min_pixels)
{
    struct sst_refine_config cfg;
    struct sst_label_fit fit;
    int64_t *hist = calloc(SST_DISP_BINS, sizeof(*hist));

    assert_non_null(hist);
    sst_refine_config_defaults(&cfg);
    cfg.matcher_sigma_px = sigma_px;
    cfg.min_pixels = min_pixels;
    for (int i = 0; i < n; i++)
        hist[pairs[i][0]] = pairs[i][1];
    fit = sst_refine_fit_histogram(hist, disp_min_px, &cfg);
    free(hist);
    return fit;
}

static void fit_has_mean_and_sample_spread(void **state SST_UNUSED)
{
    /* 100 102 104 106 108: median 104, MAD 2, nothing beyond 5 * 1.4826 * 2; variance (16+4+0+4+16)/4 = 10. */
    static const int64_t even[][2] = { { 100, 1 }, { 102, 1 }, { 104, 1 }, { 106, 1 }, { 108, 1 } };
    struct sst_label_fit f = fit_of(even, 5, -2, 0, 5);

    assert_int_equal(f.count, 5);
    CLOSE(f.mean_px, -2 + 104 / 64.0, 1e-12);
    CLOSE(f.sigma_px, sqrt(10) / 64, 1e-12);
    assert_true(f.usable);
    assert_false(fit_of(even, 5, -2, 0, 6).usable);
}

static void fit_floors_the_spread(void **state SST_UNUSED)
{
    static const int64_t one[][2] = { { 640, 1 } }, same[][2] = { { 640, 1000 } };
    struct sst_label_fit none = fit_of(one, 0, 5, 0.5, 1);

    CLOSE(fit_of(one, 1, 0, 0, 1).sigma_px, sqrt(1.0 / 12) / 64, 1e-12);
    CLOSE(fit_of(same, 1, 0, 0.25, 1).sigma_px, sqrt(1.0 / 12 / 4096 + 0.0625), 1e-12);
    CLOSE(fit_of(same, 1, 0, 0.25, 1).mean_px, 10, 1e-12);
    assert_int_equal(none.count, 0);
    assert_false(none.usable);
    CLOSE(none.sigma_px, 0.5, 1e-4);
}

static void fit_trims_outliers_but_no_second_body(void **state SST_UNUSED)
{
    static const int64_t outliers[][2] = { { 640, 90 }, { 60000, 10 } };
    static const int64_t quarter[][2] = { { 10, 3 }, { 1000, 1 } };
    static const int64_t bodies[][2] = { { 10, 2 }, { 12, 2 } };

    CLOSE(fit_of(outliers, 2, 0, 0.25, 1).mean_px, 10, 1e-12);
    assert_int_equal(fit_of(outliers, 2, 0, 0.25, 1).count, 100);
    CLOSE(fit_of(quarter, 2, 0, 0, 1).mean_px, 10 / 64.0, 1e-12);
    /* Half of them lie beyond the limit of 1.44 steps: all count. Mean 11, variance 4 / 3. */
    CLOSE(fit_of(bodies, 2, 0, 0, 1).mean_px, 11 / 64.0, 1e-12);
    CLOSE(fit_of(bodies, 2, 0, 0, 1).sigma_px, sqrt(4.0 / 3) / 64, 1e-12);
}

/* 2^36 pixels at the far end of the scale: n sum q^2 is near 2^104, the variance 1/4 must survive the difference. */
static void fit_does_not_cancel(void **state SST_UNUSED)
{
    const int64_t half = (int64_t)1 << 35;
    const int64_t far[][2] = { { 65533, half }, { 65534, half } };
    const struct sst_label_fit f = fit_of(far, 2, 0, 0, 1);

    CLOSE(f.mean_px, 65533.5 / 64, 1e-9);
    CLOSE(f.sigma_px, 0.5 / 64, 1e-9);
}

static void density_and_candidates(void **state SST_UNUSED)
{
    const struct sst_label_fit fits[] = {
        { .mean_px = 2, .sigma_px = 0.5, .usable = true },
        { .mean_px = 4, .sigma_px = 1, .usable = true },
        { .mean_px = 2, .sigma_px = 1, .usable = false },
    };
    uint64_t *mask = malloc(SST_DISP_BINS * sizeof(*mask));

    assert_non_null(mask);
    CLOSE(sst_refine_fit_density(&fits[0], 2), 0.7978845608, 1e-9);
    CLOSE(sst_refine_fit_density(&fits[1], 5), 0.2419707245, 1e-9);
    /* g > 0.2 where |d - mean| < sigma sqrt(2 ln(peak / 0.2)): up to 2.83177 px, from 2.82483 px; stored 0 is 1 px. */
    sst_candidate_masks(mask, fits, 3, 1, 0.2);
    assert_int_equal(mask[64], 1);
    assert_int_equal(mask[116], 1); /* 2.8125 px */
    assert_int_equal(mask[117], 3); /* 2.828125 px */
    assert_int_equal(mask[118], 2); /* 2.84375 px */
    assert_int_equal(mask[3 * 64], 2);
    assert_int_equal(mask[6 * 64], 0);
    assert_int_equal(mask[SST_DISP_NONE], 0);
    free(mask);
}

static void check_distances(int width, int height, unsigned one_in)
{
    const size_t pixels = (size_t)width * (size_t)height;
    uint32_t *got = malloc(pixels * sizeof(*got));
    struct sst_distance_scratch scratch = { malloc((size_t)width * 8), malloc((size_t)width * 4),
                                            malloc((size_t)width * 4) };
    struct sst_hull hull = { 0, malloc((size_t)height * 8 + 8), malloc((size_t)height * 8 + 8) };
    uint32_t *extents = malloc((size_t)height * sizeof(*extents));
    struct sst_map_u8 map;
    int region = 0;

    assert_true(got && scratch.start && scratch.vertex && scratch.row && hull.x && hull.y && extents);
    assert_int_equal(sst_map_u8_init(&map, width, height), 0);
    for (int i = 0; i < (int)pixels; i++) {
        sst_map_u8_row(&map, i / width)[i % width] = sst_random_u64(&seed) % (unsigned)one_in ? 3 : 7;
        region += sst_map_u8_row(&map, i / width)[i % width] == 7;
    }
    assert_int_equal(sst_distance_columns(got, &map, 7), region > 0);
    for (int y = 0; y < map.height && region; y++)
        sst_distance_row(got + (size_t)y * (size_t)map.width, map.width, &scratch);
    sst_region_extents(extents, &map, 7);
    sst_hull_build(&hull, extents, height);
    assert_int_equal(hull.count > 0, region > 0);
    for (int i = 0; i < (int)pixels && region; i++) {
        uint32_t nearest = UINT32_MAX, farthest = 0;

        for (int j = 0; j < (int)pixels; j++) {
            const int dx = i % width - j % width, dy = i / width - j / width;
            const uint32_t d2 = (uint32_t)(dx * dx + dy * dy);

            if (sst_map_u8_row(&map, j / width)[j % width] != 7)
                continue;
            nearest = d2 < nearest ? d2 : nearest;
            farthest = d2 > farthest ? d2 : farthest;
        }
        assert_int_equal(got[i], nearest);
        assert_int_equal(sst_hull_farthest(&hull, i % width, i / width), farthest);
    }
    sst_map_u8_fini(&map);
    free(got);
    free(scratch.start);
    free(scratch.vertex);
    free(scratch.row);
    free(hull.x);
    free(hull.y);
    free(extents);
}

static void distances_equal_plain_loops(void **state SST_UNUSED)
{
    static const int sizes[][2] = { { 1, 1 }, { 1, 17 }, { 17, 1 }, { 2, 2 }, { 23, 19 }, { 31, 8 } };

    for (size_t i = 0; i < ARRAY_LEN(sizes); i++) {
        for (unsigned one_in = 1; one_in < 300; one_in = one_in * 3 + 1)
            check_distances(sizes[i][0], sizes[i][1], one_in);
    }
}

/* A square's hull is its four corners, and the far ends of the largest image do not overflow. */
static void hull_of_a_square(void **state SST_UNUSED)
{
    int32_t x[42], y[42], far_x[1] = { SST_IMAGE_MAX_SIDE - 1 }, far_y[1] = { SST_IMAGE_MAX_SIDE - 1 };
    struct sst_hull hull = { 0, x, y };
    const struct sst_hull corner = { 1, far_x, far_y };
    uint32_t extents[20];
    struct sst_map_u8 map;

    assert_int_equal(sst_map_u8_init(&map, 20, 20), 0);
    for (int j = 5; j < 10; j++)
        memset(sst_map_u8_row(&map, j) + 3, 9, 6);
    sst_region_extents(extents, &map, 9);
    assert_int_equal(extents[4], SST_EXTENT_NONE);
    assert_int_equal(extents[5], 3 | 8 << 16);
    sst_hull_build(&hull, extents, 20);
    assert_int_equal(hull.count, 4);
    assert_int_equal(sst_hull_farthest(&hull, 0, 0), 8 * 8 + 9 * 9);
    assert_int_equal(sst_hull_farthest(&corner, 0, 0), 2147352578);
    sst_map_u8_fini(&map);
}

struct surface {
    struct sst_map_u16 disp;
    struct sst_planes planes;
};

static void surface_init(struct surface *s, int width, int height)
{
    assert_int_equal(sst_map_u16_init(&s->disp, width, height), 0);
    s->planes = (struct sst_planes){ width, height, SST_NORMAL_WINDOW_MIN,
                                     malloc((size_t)width * (size_t)height * sizeof(struct sst_surface_plane)) };
    assert_non_null(s->planes.at);
}

static void surface_fit(struct surface *s)
{
    int64_t *sums = malloc((size_t)s->disp.width * SST_PLANE_SUMS * sizeof(*sums));

    assert_non_null(sums);
    sst_planes_fit(&s->planes, &s->disp, sums);
    free(sums);
}

static void surface_fini(struct surface *s)
{
    sst_map_u16_fini(&s->disp);
    free(s->planes.at);
}

/* d = (640 + 3 x + 2 y) / 64 with holes: every window gives it back, cut ones too. */
static void planes_are_exact_on_a_plane(void **state SST_UNUSED)
{
    const struct sst_surface_frame frame = { .focal_px = 64, .cx = 15, .cy = 20, .zero_px = 0.5, .score_max = 1 };
    struct surface s;
    float n[3];

    surface_init(&s, 31, 41);
    for (int i = 0; i < 31 * 41; i++)
        sst_map_u16_row(&s.disp, i / 31)[i % 31] =
            (uint16_t)(sst_random_u64(&seed) % 3 ? 640 + 3 * (i % 31) + 2 * (i / 31) : (int)SST_DISP_NONE);
    sst_map_u16_row(&s.disp, 0)[0] = 640;
    sst_map_u16_row(&s.disp, 40)[30] = SST_DISP_NONE;
    surface_fit(&s);
    for (int i = 0; i < 31 * 41; i++) {
        const struct sst_surface_plane *p = &s.planes.at[i];

        CLOSE(p->a, 3 / 64.0, 1e-7);
        CLOSE(p->b, 2 / 64.0, 1e-7);
        CLOSE(p->d0, (640 + 3 * (i % 31) + 2 * (i / 31)) / 64.0, 5e-6);
        CLOSE(p->variance, 0, 1e-7);
    }
    /* (f a, f b, c) = (3, 2, 0.5 + (640 + 45 + 40) / 64 = 11.828125), length sqrt(152.9045410) = 12.3654575. */
    assert_true(sst_normal_at(n, &s.planes, &frame, 0, 0));
    CLOSE(n[0], 0.2426113, 1e-5);
    CLOSE(n[1], 0.1617409, 1e-5);
    CLOSE(n[2], 0.9565457, 1e-5);
    assert_false(sst_normal_at(n, &s.planes, &frame, 30, 40));
    surface_fini(&s);
}

/* Largest coordinates and disparities that fit; slope 1/64 px per pixel must survive them. */
static void planes_do_not_cancel(void **state SST_UNUSED)
{
    const int width = 2000;
    struct surface s;

    surface_init(&s, width, 127);
    s.planes.window = SST_NORMAL_WINDOW_MAX;
    for (int i = 0; i < width * 127; i++)
        sst_map_u16_row(&s.disp, i / width)[i % width] = (uint16_t)(SST_DISP_MAX_Q6 - 3000 + i % width + i / width);
    surface_fit(&s);
    CLOSE(s.planes.at[64 * width - 1].a, 1 / 64.0, 1e-7);
    CLOSE(s.planes.at[64 * width - 1].b, 1 / 64.0, 1e-7);
    CLOSE(s.planes.at[64 * width - 1].variance, 0, 1e-6);
    surface_fini(&s);
}

static void planes_refuse_lines(void **state SST_UNUSED)
{
    const struct sst_surface_frame frame = { .focal_px = 64, .score_max = 1e29F };
    float n[3] = { 5, 5, 5 };
    struct surface s;

    surface_init(&s, 25, 25);
    for (int pass = 0; pass < 3; pass++) {
        for (int i = 0; i < 25 * 25; i++) {
            const int x = i % 25, y = i / 25;
            const bool known = pass == 0 ? x == 12 : pass == 1 ? x == y : i < 2;

            sst_map_u16_row(&s.disp, y)[x] = known ? (uint16_t)(100 + x) : (uint16_t)SST_DISP_NONE;
        }
        surface_fit(&s);
        for (int i = 0; i < 25 * 25; i++)
            assert_true(s.planes.at[i].variance == SST_SURFACE_NONE);
        assert_false(sst_normal_at(n, &s.planes, &frame, 12, 12));
        CLOSE(n[0], 5, 0);
    }
    surface_fini(&s);
}

/* An upright wall above row 40, the floor it stands on below: right up to the crease each pixel gets its own normal. */
static void normals_keep_to_their_side(void **state SST_UNUSED)
{
    const struct sst_surface_frame frame = { .focal_px = 80, .cx = 39.5, .cy = 39.5, .score_max = 1 };
    float n[3];
    struct surface s;

    surface_init(&s, 80, 80);
    for (int i = 0; i < 80 * 80; i++)
        sst_map_u16_row(&s.disp, i / 80)[i % 80] = (uint16_t)(i / 80 < 40 ? 640 : 640 + 16 * (i / 80 - 40));
    surface_fit(&s);
    for (int x = 0; x < 80; x += 13) {
        assert_true(sst_normal_at(n, &s.planes, &frame, x, 38));
        CLOSE(n[2], 1, 1e-5);
        assert_true(sst_normal_at(n, &s.planes, &frame, x, 42));
        CLOSE(n[1], 20 / hypot(20, 10 - 0.125), 1e-5); /* floor: b = 1/4, 10 px at row 40, so c = 9.875 */
    }
    surface_fini(&s);
}

/* Rows in turn 2 px apart: planes miss by 1 px rms. Noise of 0.4 px allows for 0.8, of 0.6 for 1.2. */
static void rough_surfaces_have_no_normals(void **state SST_UNUSED)
{
    struct sst_lightfield lf = { .width = 40, .height = 40, .focal_px = 50, .disp_min_px = -3 };
    struct sst_refine_config cfg;
    struct sst_surface_frame frame;
    struct surface s;
    float n[3];

    surface_init(&s, 40, 40);
    for (int i = 0; i < 40 * 40; i++)
        sst_map_u16_row(&s.disp, i / 40)[i % 40] = (uint16_t)(640 + (i / 40 % 2) * 128);
    surface_fit(&s);
    sst_refine_config_defaults(&cfg);
    cfg.matcher_sigma_px = 0.4;
    frame = sst_normal_frame_of(&lf, &cfg);
    assert_true(frame.focal_px == 50 && frame.cx == 19.5 && frame.zero_px == 0);
    assert_false(sst_normal_at(n, &s.planes, &frame, 20, 20));
    cfg.matcher_sigma_px = 0.6;
    lf.focal_px = 0;
    lf.disp_min_px = 4;
    frame = sst_normal_frame_of(&lf, &cfg);
    assert_true(frame.focal_px == 40 && frame.zero_px == 4);
    lf.infinity_px = -7; /* depth counts from infinity, rays from the principal point */
    lf.off_centre_px[1] = 2.5;
    frame = sst_normal_frame_of(&lf, &cfg);
    assert_true(frame.zero_px == 11 && frame.cx == 19.5 && frame.cy == 22);
    lf.infinity_px = lf.off_centre_px[1] = 0;
    frame = sst_normal_frame_of(&lf, &cfg);
    assert_true(sst_normal_at(n, &s.planes, &frame, 20, 20));
    surface_fini(&s);
}

struct ground_view {
    struct sst_view view;
    struct sst_refine_config cfg;
    int64_t *hist;
};

static void ground_view_init(struct ground_view *g)
{
    memset(g, 0, sizeof(*g));
    sst_refine_config_defaults(&g->cfg);
    g->hist = malloc(SST_DISP_BINS * sizeof(*g->hist));
    assert_non_null(g->hist);
    assert_int_equal(sst_map_u16_init(&g->view.disp, 50, 40), 0);
    assert_int_equal(sst_map_u8_init(&g->view.label, 50, 40), 0);
}

static void ground_view_fini(struct ground_view *g)
{
    sst_map_u16_fini(&g->view.disp);
    sst_map_u8_fini(&g->view.label);
    free(g->hist);
}

/* q = 1000 + 2 x + 5 y with every tenth pixel far off, and a second label that does not count. */
static void ground_plane_survives_outliers(void **state SST_UNUSED)
{
    struct sst_ground plane = { 0 };
    struct ground_view g;

    ground_view_init(&g);
    for (int i = 0; i < 50 * 40; i++) {
        const int x = i % 50, y = i / 50;
        const int off = y < 20 ? 0 : i % 10 == 3 ? 3000 : 0;

        sst_map_u16_row(&g.view.disp, y)[x] = (uint16_t)(y < 20 ? 50000 : 1000 + 2 * x + 5 * y + off);
        sst_map_u8_row(&g.view.label, y)[x] = y < 20 ? 3 : 4;
    }
    sst_map_u16_row(&g.view.disp, 30)[7] = SST_DISP_NONE;
    assert_true(sst_ground_fit(&plane, &g.view, 4, &g.cfg, g.hist));
    assert_int_equal(plane.a_q24, 2 << 24);
    assert_int_equal(plane.b_q24, 5 << 24);
    assert_int_equal(plane.d0_q24, INT64_C(1000) << 24);
    assert_int_equal(plane.limit_q24, INT64_C(80) << 24); /* 5 times 0.25 px */
    assert_true(sst_ground_has(&plane, 10, 2, 1030 + 79));
    assert_false(sst_ground_has(&plane, 10, 2, 1030 + 81));
    assert_false(sst_ground_has(&plane, 10, 2, 1030 - 81));
    ground_view_fini(&g);
}

/* Too few pixels, one row, and two steps of which neither holds three quarters: no plane, nothing written. */
static void ground_without_a_plane(void **state SST_UNUSED)
{
    struct sst_ground plane = { .a_q24 = 7 };
    struct ground_view g;

    ground_view_init(&g);
    memset(sst_map_u8_row(&g.view.label, 3), 4, 50);
    assert_false(sst_ground_fit(&plane, &g.view, 4, &g.cfg, g.hist));
    g.cfg.min_pixels = 1;
    assert_false(sst_ground_fit(&plane, &g.view, 4, &g.cfg, g.hist));
    for (int i = 0; i < 50 * 40; i++) {
        sst_map_u8_row(&g.view.label, i / 50)[i % 50] = 4;
        sst_map_u16_row(&g.view.disp, i / 50)[i % 50] = sst_random_u64(&seed) % 10 < 6 ? 1000 : 20000;
    }
    assert_true(!sst_ground_fit(&plane, &g.view, 4, &g.cfg, g.hist) || plane.limit_q24 > INT64_C(9000) << 24);
    ground_view_fini(&g);
}

static struct sst_region region(double x, double y, double z, int normals, int pixels)
{
    struct sst_region r = { { (int64_t)(x * SST_SURFACE_ONE), (int64_t)(y * SST_SURFACE_ONE),
                              (int64_t)(z * SST_SURFACE_ONE) },
                            normals,
                            pixels,
                            { 0 } };

    sst_region_finish(&r);
    return r;
}

static void energies(void **state SST_UNUSED)
{
    const struct sst_region some = region(0, 3, 30, 40, 80), empty = region(0, 0, 0, 0, 0),
                            few = region(0, 3, 30, 40, 81);

    CLOSE(sst_energy_normal((float[]){ 0, 0, 1 }, &some, 1), -30.0 / 70, 2e-7);
    CLOSE(sst_energy_normal((float[]){ 0, 1, 0 }, &some, 0.5), -3.0 / 23, 1e-7);
    CLOSE(sst_energy_normal((float[]){ 0, 0, -1 }, &some, 1), 0, 0);
    CLOSE(sst_energy_normal((float[]){ 0, 0, 1 }, &empty, 1), 0, 0);
    assert_true(sst_region_has_normal(&some));
    assert_false(sst_region_has_normal(&empty));
    assert_false(sst_region_has_normal(&few));
    CLOSE(sst_energy_distance(4, 16), 0.25, 0);
    CLOSE(sst_energy_distance(9, 9), 1, 0);
    CLOSE(sst_energy_distance(1, 3), 1.0 / 3, 6e-8);
    CLOSE(sst_energy_distance(0, 0), 0, 0);
    assert_true(sst_energy_is_nearer(1, 3, 1, 2));
    assert_false(sst_energy_is_nearer(2, 4, 1, 2));
    assert_true(sst_energy_is_nearer(2147352577, 2147352578, 2147352578, 2147352578));
}

/* Two views in one row, each a line of eight pixels. */
struct lines {
    struct sst_lightfield lf;
    struct sst_view views[2];
    struct sst_refine_config cfg;
};

static void lines_init(struct lines *s, const uint8_t labels[2][8], const uint16_t disp[2][8])
{
    memset(s, 0, sizeof(*s));
    s->lf = (struct sst_lightfield){ .rows = 1, .cols = 2, .width = 8, .height = 1, .views = s->views };
    s->lf.classes = sst_classes_default;
    sst_refine_config_defaults(&s->cfg);
    s->cfg.min_pixels = 2;
    for (int k = 0; k < 2; k++) {
        s->views[k].present = true;
        assert_int_equal(sst_map_u8_init(&s->views[k].label, 8, 1), 0);
        assert_int_equal(sst_map_u16_init(&s->views[k].disp, 8, 1), 0);
        memcpy(s->views[k].label.data, labels[k], 8);
        memcpy(s->views[k].disp.data, disp[k], 16);
    }
}

static void lines_fini(struct lines *s)
{
    for (int k = 0; k < 2; k++) {
        sst_map_u8_fini(&s->views[k].label);
        sst_map_u16_fini(&s->views[k].disp);
    }
}

/*
 * View 0: the regions of 9 and 5 are single pixels, so min = max and E_d = 1 for both: the smaller label wins every
 * tie. Pixel 6 has no candidate, pixel 7 no disparity. View 1: 5 is absent and has E_d = 1, 9 is near; pixel 5 has the
 * disparity of label 2 alone; label 33 is outside the class list and stays.
 */
static void driver_rules(void **state SST_UNUSED)
{
    static const uint8_t labels[2][8] = { { 9, 0, 0, 0, 5, 2, 0, 0 }, { 9, 9, 0, 0, 2, 0, 9, 33 } };
    static const uint16_t disp[2][8] = { { 640, 640, 640, 640, 640, 3200, 9000, SST_DISP_NONE },
                                         { 640, 640, 640, 640, 3200, 3200, 640, 640 } };
    static const uint8_t want[2][8] = { { 9, 5, 5, 5, 5, 2, 0, 0 }, { 9, 9, 9, 9, 2, 2, 9, 33 } };
    struct sst_label_fit fits[SST_MAX_CLASSES];
    struct lines s;

    lines_init(&s, labels, disp);
    s.cfg.min_pixels = 1;
    assert_int_equal(sst_refine_labels(&s.lf, &s.cfg, fits), 0);
    assert_memory_equal(s.views[0].label.data, want[0], 8);
    assert_memory_equal(s.views[1].label.data, want[1], 8);
    assert_int_equal(fits[8].count, 4);
    assert_int_equal(fits[1].count, 2);
    CLOSE(fits[1].mean_px, 50, 1e-12);
    lines_fini(&s);
}

/* Regions of two pixels: 9 at 0 and 1, 5 at 6 and 7. Pixel 3: 4/9 from 9, 9/16 from 5. Pixel 4: 9/16 and 4/9. */
static void refinement_assigns_the_nearer(void **state SST_UNUSED)
{
    static const uint8_t labels[2][8] = { { 9, 9, 0, 0, 0, 0, 5, 5 }, { 1, 0, 0, 0, 0, 0, 0, 0 } };
    static const uint16_t disp[2][8] = { { 640, 640, 640, 640, 640, 640, 640, 640 }, { 640 } };
    static const uint8_t want[8] = { 9, 9, 9, 9, 5, 5, 5, 5 };
    struct lines s;

    lines_init(&s, labels, disp);
    assert_int_equal(sst_refine_labels(&s.lf, &s.cfg, NULL), 0);
    assert_memory_equal(s.views[0].label.data, want, 8);
    lines_fini(&s);
}

static void refuses_what_is_missing(void **state SST_UNUSED)
{
    static const uint8_t labels[2][8] = { { 9, 9, 0 } };
    static const uint16_t disp[2][8] = { { 640, 640, 640 } };
    const struct sst_refine_config bad[] = {
        { .eps_d = NAN }, { .tau = 0 }, { .normal_window = 22 }, { .normal_window = 19 }, { .p_distance = -1 },
    };
    struct lines s;

    lines_init(&s, labels, disp);
    for (size_t i = 0; i < ARRAY_LEN(bad); i++) {
        struct sst_refine_config cfg = s.cfg;

        cfg.eps_d = i == 0 ? bad[i].eps_d : cfg.eps_d;
        cfg.tau = i == 1 ? bad[i].tau : cfg.tau;
        cfg.normal_window = i == 2 || i == 3 ? bad[i].normal_window : cfg.normal_window;
        cfg.p_distance = i == 4 ? bad[i].p_distance : cfg.p_distance;
        assert_int_equal(sst_refine_labels(&s.lf, &cfg, NULL), -EINVAL);
    }
    sst_map_u16_fini(&s.views[1].disp);
    assert_int_equal(sst_refine_labels(&s.lf, &s.cfg, NULL), -EINVAL);
    assert_memory_equal(s.views[0].label.data, labels[0], 8);
    s.views[1].present = false;
    assert_int_equal(sst_refine_labels(&s.lf, &s.cfg, NULL), 0);
    assert_int_equal(s.views[0].label.data[2], 9);
    lines_fini(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fit_has_mean_and_sample_spread),
        cmocka_unit_test(fit_floors_the_spread),
        cmocka_unit_test(fit_trims_outliers_but_no_second_body),
        cmocka_unit_test(fit_does_not_cancel),
        cmocka_unit_test(density_and_candidates),
        cmocka_unit_test(distances_equal_plain_loops),
        cmocka_unit_test(hull_of_a_square),
        cmocka_unit_test(planes_are_exact_on_a_plane),
        cmocka_unit_test(planes_do_not_cancel),
        cmocka_unit_test(planes_refuse_lines),
        cmocka_unit_test(normals_keep_to_their_side),
        cmocka_unit_test(rough_surfaces_have_no_normals),
        cmocka_unit_test(ground_plane_survives_outliers),
        cmocka_unit_test(ground_without_a_plane),
        cmocka_unit_test(energies),
        cmocka_unit_test(driver_rules),
        cmocka_unit_test(refinement_assigns_the_nearer),
        cmocka_unit_test(refuses_what_is_missing),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
