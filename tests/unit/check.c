/* Drift check: faults that it must and must not find in light fields of known texture, depth and misalignment.
 *
 * A view shows two depths (a disc before a wall), computed at exact places, so shifts and rolls of any size are exact.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "pipeline/calibration/drift/drift_internal.h"
#include "tests/random.h"
#include "tests/small.h"
#include "tests/test.h"

#define WIDTH  320
#define HEIGHT 240

/* Fault of a view's picture: it sits at (x, y), rolled and larger. */
struct fault {
    double x, y, roll_deg, scale, gain;
};

struct recipe {
    int rows, cols;
    uint64_t seed;
    double noise;      /* grey levels */
    double contrast;   /* 1: as usual, 0: a blank wall */
    double wall, disc; /* disparities */
    bool repeated;     /* texture with a period of 16 px both ways */
    double mesh;       /* disparity of a mesh of that period before both, turned by 0.1; 0: none */
    struct fault fault[SST_MAX_VIEWS];
};

static double texture(double x, double y, uint32_t seed, const struct recipe *r)
{
    if (r->repeated) {
        x -= 16 * floor(x / 16);
        y -= 16 * floor(y / 16);
        x = 8 - fabs(8 - x);
        y = 8 - fabs(8 - y);
    }
    return 128 + 180 * r->contrast * (sst_noise_fbm((struct sst_vec3){ x / 14 + 500, y / 14 + 500, 0 }, 3, seed) - 0.5);
}

/* Whether a bar is there: 4 of 16 px. */
static bool mesh_at(double x, double y)
{
    const double across = x * cos(0.1) + y * sin(0.1), down = y * cos(0.1) - x * sin(0.1);

    return across - 16 * floor(across / 16) < 4 || down - 16 * floor(down / 16) < 4;
}

static void draw_view(struct sst_image *out, const struct recipe *r, int view, double bx, double by)
{
    const struct fault *f = &r->fault[view];
    const double c = cos(f->roll_deg * M_PI / 180) / (1 + f->scale), s = sin(f->roll_deg * M_PI / 180) / (1 + f->scale);
    const double mx = 0.5 * (WIDTH - 1), my = 0.5 * (HEIGHT - 1), gain = f->gain > 0 ? f->gain : 1;
    uint64_t state = r->seed * 1000 + (uint64_t)view;

    assert_int_equal(sst_image_init(out, WIDTH, HEIGHT), 0);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            const double px = x - mx - f->x, py = y - my - f->y;
            const double qx = mx + c * px + s * py, qy = my - s * px + c * py; /* where it belongs */
            const double dx = qx + r->disc * bx, dy = qy + r->disc * by;
            const bool near = hypot(dx - mx - 20, dy - my) < 60;
            double v = near ? texture(dx, dy, (uint32_t)r->seed * 2 + 1, r)
                            : texture(qx + r->wall * bx, qy + r->wall * by, (uint32_t)r->seed * 2, r);

            if (r->mesh > 0 && mesh_at(qx + r->mesh * bx, qy + r->mesh * by))
                v = 40;
            v *= gain;
            for (int k = 0; k < 3; k++) {
                const double w = v + (r->noise > 0 ? r->noise * test_normal(&state) : 0);

                sst_image_row(out, k, y)[x] = (uint8_t)sst_clamp_double(floor(w + 0.5), 0, 255);
            }
        }
    }
}

static struct recipe plain(int rows, int cols, uint64_t seed)
{
    return (struct recipe){ .rows = rows, .cols = cols, .seed = seed, .contrast = 1, .wall = 2.3, .disc = 6.6 };
}

static void make(struct sst_lightfield *lf, const struct recipe *r)
{
    assert_int_equal(sst_lightfield_init(lf, r->rows, r->cols), 0);
    lf->width = WIDTH;
    lf->height = HEIGHT;
    for (int v = 0; v < r->rows * r->cols; v++) {
        /* Measured offsets, not quite on the grid. */
        lf->views[v].bx += 0.013 * (v % 5 - 2);
        lf->views[v].by -= 0.011 * (v % 7 - 3);
        lf->views[v].present = true;
        draw_view(&lf->views[v].image, r, v, lf->views[v].bx, lf->views[v].by);
    }
}

static void run(struct sst_drift *out, const struct sst_lightfield *lf, int threads)
{
    const struct sst_drift_config cfg = { .threads = threads };

    assert_int_equal(sst_drift_check(out, lf, &cfg), 0);
    print_message("%s\n", out->sentence);
}

static void check_recipe(struct sst_drift *out, const struct recipe *r)
{
    struct sst_lightfield lf;

    make(&lf, r);
    run(out, &lf, 2);
    sst_lightfield_fini(&lf);
}

/* --- numbers ------------------------------------------------------------------------------------------------------ */

/* Level 1's pixel 3 is the mean of 6 and 7: its centre is at 6.5, to which both round (6.5 - 0.5) / 2 = 3. */
static void levels_share_centres(void **state)
{
    (void)state;
    assert_int_equal(drift_to_level(6, 1), 3);
    assert_int_equal(drift_to_level(7, 1), 3);
    assert_int_equal(drift_to_level(6, 0), 6);
    assert_int_equal(drift_to_level(8, 2), 2); /* (8 - 1.5) / 4 = 1.6 */
}

static const struct sst_map_u8 everywhere; /* empty: the whole picture is one */

/* Sub-pixel shifts by eighths: mean of the error over all features below 0.01 px for every one, in both axes. */
static void alignment_is_unbiased(void **state)
{
    static struct drift_pyramid a, b;
    const struct drift_search s = { .u = { 1, 0 }, .n = { 0, 1 } };
    struct recipe r = plain(1, 2, 3);
    struct sst_image one, other;
    double worst = 0;

    (void)state;
    r.wall = r.disc = 0;
    draw_view(&one, &r, 0, 0, 0);
    assert_int_equal(drift_pyramid_init(&a, &one, &everywhere, 160), 0);
    for (int step = -4; step <= 4; step++) {
        double sum[2] = { 0 }, squares = 0;
        int n = 0;

        r.fault[1].x = 2 + step / 8.0;
        r.fault[1].y = -1 - step / 8.0;
        draw_view(&other, &r, 1, 0, 0);
        assert_int_equal(drift_pyramid_init(&b, &other, &everywhere, 160), 0);
        for (int i = 0; i < a.first[DRIFT_CELLS]; i++) {
            struct drift_match m = { .dx = 2, .dy = -1 };

            drift_refine_match(&m, &(struct drift_views){ &a, &b, &s }, &a.feature[i], 0);
            if (m.outcome != DRIFT_FOUND)
                continue;
            sum[0] += m.dx - r.fault[1].x;
            sum[1] += m.dy - r.fault[1].y;
            squares += pow(m.dx - r.fault[1].x, 2) + pow(m.dy - r.fault[1].y, 2);
            n++;
        }
        assert_true(n > 300);
        worst = fmax(worst, fmax(fabs(sum[0] / n), fabs(sum[1] / n)));
        assert_true(sqrt(squares / n) < 0.03);
        drift_pyramid_fini(&b);
        sst_image_fini(&other);
    }
    print_message("largest mean error %.4f px\n", worst);
    assert_true(worst < 0.01);
    drift_pyramid_fini(&a);
    sst_image_fini(&one);
}

/* Sigmas of matches equal their errors within a factor of 1.5: noise of 3 grey levels, one depth. */
static void sigmas_are_true(void **state)
{
    static struct drift_pyramid a, b;
    const struct drift_search s = { .u = { 0, 1 }, .n = { 1, 0 }, .noise = 3 * 0.306 };
    struct recipe r = plain(1, 2, 4);
    struct sst_image one, other;
    double cross = 0, along = 0;
    int n = 0;

    (void)state;
    r.wall = r.disc = 0;
    r.noise = 3;
    r.fault[1] = (struct fault){ .x = 0.3, .y = 0.4, .gain = 0.9 };
    draw_view(&one, &r, 0, 0, 0);
    draw_view(&other, &r, 1, 0, 0);
    assert_int_equal(drift_pyramid_init(&a, &one, &everywhere, 160), 0);
    assert_int_equal(drift_pyramid_init(&b, &other, &everywhere, 160), 0);
    for (int i = 0; i < a.first[DRIFT_CELLS]; i++) {
        struct drift_match m = { .dx = 0, .dy = 0 };

        drift_refine_match(&m, &(struct drift_views){ &a, &b, &s }, &a.feature[i], 0);
        if (m.outcome != DRIFT_FOUND)
            continue;
        cross += pow(m.dx - 0.3, 2) / m.var_across;
        along += pow(m.dy - 0.4, 2) / m.var_along;
        n++;
    }
    print_message("%d matches: errors over sigmas %.2f across, %.2f along\n", n, sqrt(cross / n), sqrt(along / n));
    assert_true(n > 200);
    assert_true(cross / n > 1 / 2.25 && cross / n < 2.25);
    assert_true(along / n > 1 / 2.25 && along / n < 2.25);
    drift_pyramid_fini(&a);
    drift_pyramid_fini(&b);
    sst_image_fini(&one);
    sst_image_fini(&other);
}

/* --- verdicts ----------------------------------------------------------------------------------------------------- */

static void nothing_is_found_where_nothing_is_wrong(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 3; seed++) {
        struct recipe r = plain(seed == 3 ? 6 : 3, seed == 3 ? 6 : 4, seed);
        struct sst_drift c;

        r.noise = seed == 1 ? 0 : 3;
        for (int v = 0; v < r.rows * r.cols; v++)
            r.fault[v].gain = seed == 1 ? 1 : 0.9 + 0.05 * (v % 5);
        check_recipe(&c, &r);
        assert_int_equal(c.verdict, SST_DRIFT_OK);
        assert_int_equal(c.measured, c.pairs);
        assert_int_equal(c.pairs, r.rows * (r.cols - 1) + r.cols * (r.rows - 1));
        assert_true(c.mean_px < 0.02);
        assert_true(c.p95_px < 0.1);
        assert_true(c.axes_px < 0.1);
        assert_true(c.far_p95_px < 0.15); /* NAN fails */
        for (int v = 0; v < r.rows * r.cols; v++)
            assert_true(c.camera[v].known && c.camera[v].off_px < 0.08);
        assert_true(c.range_min_px < 2.3 && c.range_max_px > 6.6);
        sst_drift_fini(&c);
    }
}

static void near_px(double value, double wanted, double tolerance)
{
    if (!(fabs(value - wanted) <= tolerance))
        fail_msg("%g px, wanted %g within %g", value, wanted, tolerance);
}

/* Shifts from 0.1 to 10 px and a roll of 0.1 degrees (0.2 px RMS over this picture), with noise and other exposures. */
static void drifts_are_measured(void **state)
{
    static const struct {
        int view;
        double x, y, roll_deg;
        bool drifted;
    } wrong[] = { { 1, 0.1, 0, 0, false },  { 3, 0, 0.3, 0, true },     { 9, -0.5, 0.2, 0, true },
                  { 13, 1, -1, 0.1, true }, { 20, 0, 0, 0.25, true },   { 22, -2.2, 3, 0, true },
                  { 33, 10, -4, 0, true },  { 35, 0.35, 0.35, 0, true } };
    struct recipe r = plain(6, 6, 11);
    struct sst_drift c;
    int drifted = 0;

    (void)state;
    r.noise = 3;
    for (size_t i = 0; i < ARRAY_LEN(wrong); i++)
        r.fault[wrong[i].view] = (struct fault){ wrong[i].x, wrong[i].y, wrong[i].roll_deg, 0, i % 2 ? 0.9 : 1.1 };
    check_recipe(&c, &r);
    assert_int_equal(c.verdict, SST_DRIFT_DRIFTED);
    for (size_t i = 0; i < ARRAY_LEN(wrong); i++) {
        const struct sst_drift_camera *k = &c.camera[wrong[i].view];

        near_px(k->shift_x_px, wrong[i].x, 0.05);
        near_px(k->shift_y_px, wrong[i].y, 0.05);
        near_px(k->roll_deg, wrong[i].roll_deg, 0.02);
        near_px(k->scale, 0, 3e-4);
        assert_true(k->sigma_px > 0 && k->sigma_px < 0.05);
        assert_int_equal(k->drifted, wrong[i].drifted);
    }
    for (int v = 0; v < 36; v++)
        drifted += c.camera[v].drifted;
    assert_int_equal(drifted, 7);
    assert_non_null(strstr(c.sentence, "DRIFTED: camera 05_03 sits 4.0"));
    assert_non_null(strstr(c.sentence, "too high and 10.0"));
    assert_non_null(strstr(c.sentence, "px too far right, camera 03_04 sits 3.0"));
    assert_non_null(strstr(c.sentence, "and 3 more; the other 29 are within 0."));
    sst_drift_fini(&c);
}

/* A camera with a picture that is 0.3 % larger, and no other fault. */
static void another_size_is_measured(void **state)
{
    struct recipe r = plain(3, 3, 12);
    struct sst_drift c;

    (void)state;
    r.fault[4].scale = 0.003;
    check_recipe(&c, &r);
    near_px(c.camera[4].scale, 0.003, 2e-4);
    near_px(c.camera[4].shift_x_px, 0, 0.05);
    near_px(c.camera[4].shift_y_px, 0, 0.05);
    assert_true(c.camera[4].drifted);
    assert_int_equal(c.verdict, SST_DRIFT_DRIFTED);
    assert_non_null(strstr(c.sentence, "camera 01_01 is 0.3"));
    assert_non_null(strstr(c.sentence, "% too large; the other 8"));
    sst_drift_fini(&c);
}

static void swap_images(struct sst_lightfield *lf, int a, int b)
{
    const struct sst_image image = lf->views[a].image;

    lf->views[a].image = lf->views[b].image;
    lf->views[b].image = image;
}

static void exchanged_views_are_named(void **state)
{
    static const int pair[][2] = { { 5, 6 }, { 1, 10 }, { 0, 15 } };
    const struct recipe r = plain(4, 4, 21);
    struct sst_lightfield lf;

    (void)state;
    make(&lf, &r);
    for (size_t i = 0; i < ARRAY_LEN(pair); i++) {
        struct sst_drift c;

        swap_images(&lf, pair[i][0], pair[i][1]);
        run(&c, &lf, 2);
        assert_int_equal(c.verdict, SST_DRIFT_UNUSABLE);
        assert_int_equal(c.swapped_a, pair[i][0]);
        assert_int_equal(c.swapped_b, pair[i][1]);
        swap_images(&lf, pair[i][0], pair[i][1]);
        sst_drift_fini(&c);
    }
    sst_lightfield_fini(&lf);
}

/* Columns from right to left: the epipolar error of every pair is fine, only the signs of the disparities are wrong. */
static void turned_grids_are_named(void **state)
{
    const struct recipe r = plain(4, 4, 22);
    struct sst_lightfield lf;
    struct sst_drift c;

    (void)state;
    make(&lf, &r);
    for (int v = 0; v < 16; v++) {
        if (v % 4 < 2)
            swap_images(&lf, v, v / 4 * 4 + 3 - v % 4);
    }
    run(&c, &lf, 2);
    assert_int_equal(c.verdict, SST_DRIFT_UNUSABLE);
    assert_non_null(strstr(c.sentence, "right to left"));
    sst_drift_fini(&c);
    for (int v = 0; v < 16; v++) {
        if (v % 4 < 2)
            swap_images(&lf, v, v / 4 * 4 + 3 - v % 4);
    }
    for (int v = 0; v < 16; v++) {
        if (v % 4 < v / 4)
            swap_images(&lf, v, v % 4 * 4 + v / 4);
    }
    run(&c, &lf, 2);
    assert_int_equal(c.verdict, SST_DRIFT_UNUSABLE);
    assert_non_null(strstr(c.sentence, "rows and columns are exchanged"));
    sst_drift_fini(&c);
    sst_lightfield_fini(&lf);
}

static void unrectified_is_unusable(void **state)
{
    struct recipe r = plain(4, 4, 31);
    struct sst_drift c;
    uint64_t random = 5;

    (void)state;
    for (int v = 0; v < 16; v++)
        r.fault[v] = (struct fault){ sst_random_in(&random, -12, 12), sst_random_in(&random, -12, 12),
                                     sst_random_in(&random, -1, 1), sst_random_in(&random, -0.01, 0.01), 1 };
    check_recipe(&c, &r);
    assert_int_equal(c.verdict, SST_DRIFT_UNUSABLE);
    assert_int_equal(c.swapped_a, -1);
    sst_drift_fini(&c);
}

static void blank_and_repeated_walls_raise_no_alarm(void **state)
{
    struct recipe r = plain(3, 3, 41);
    struct sst_drift c;

    (void)state;
    r.contrast = 0;
    r.noise = 3;
    check_recipe(&c, &r);
    assert_int_equal(c.verdict, SST_DRIFT_UNKNOWN);
    assert_true(isnan(c.mean_px) && isnan(c.far_p95_px) && isnan(c.axes_px));
    assert_false(c.camera[4].known);
    sst_drift_fini(&c);
    r.noise = 0; /* every value the same */
    check_recipe(&c, &r);
    assert_int_equal(c.verdict, SST_DRIFT_UNKNOWN);
    sst_drift_fini(&c);
    r = plain(3, 3, 42);
    r.repeated = true;
    r.disc = r.wall;
    check_recipe(&c, &r);
    assert_true(c.verdict == SST_DRIFT_UNKNOWN || (c.verdict == SST_DRIFT_OK && c.mean_px < 0.02));
    sst_drift_fini(&c);
}

/* Parts of a mesh are found a period off, at any of several displacements; parts of a displaced picture at one. */
static void meshes_contradict_themselves(void **state)
{
    const struct sst_drift_config cfg = { .threads = 2, .loose = true };

    (void)state;
    for (int mesh = 0; mesh < 2; mesh++) {
        struct recipe r = plain(4, 4, 27);
        struct sst_lightfield lf;
        struct sst_drift check;

        r.fault[5] = (struct fault){ .y = 2.5, .roll_deg = 0.5 };
        r.mesh = mesh ? 13 : 0;
        make(&lf, &r);
        lf.range_min_px = 1;
        lf.range_max_px = 20;
        assert_int_equal(sst_drift_check(&check, &lf, &cfg), 0);
        print_message("%s mesh: contradiction %.3f px, %d matches\n", mesh ? "with" : "without", check.contradiction_px,
                      check.matches);
        assert_true(mesh ? check.contradiction_px > 0.6 : check.contradiction_px > 0 && check.contradiction_px < 0.1);
        assert_int_equal(check.verdict, mesh ? SST_DRIFT_UNKNOWN : SST_DRIFT_DRIFTED);
        sst_drift_fini(&check);
        sst_lightfield_fini(&lf);
    }
}

/* (R + 2 G + B) / 4 and the mean of four pixels: noise of 1 becomes sqrt(6) / 8. */
static void noise_is_measured(void **state)
{
    static struct drift_pyramid v;
    struct recipe r = plain(1, 1, 43);
    struct sst_image image;

    (void)state;
    r.contrast = 0;
    for (r.noise = 2; r.noise <= 8; r.noise *= 2) {
        draw_view(&image, &r, 0, 0, 0);
        assert_int_equal(drift_pyramid_init(&v, &image, &everywhere, 160), 0);
        assert_true(fabs(v.noise / (r.noise * sqrt(6) / 8) - 1) < 0.2);
        assert_int_equal(v.first[DRIFT_CELLS], 0);
        drift_pyramid_fini(&v);
        sst_image_fini(&image);
    }
}

/* The part of the common view outside a camera's picture is black with a hard edge, which is no feature. */
static void borders_are_no_features(void **state)
{
    static struct drift_pyramid v;
    const struct recipe r = plain(1, 1, 44);
    struct sst_image image;
    struct sst_map_u8 valid;
    int before = 0;

    (void)state;
    draw_view(&image, &r, 0, 0, 0);
    assert_int_equal(sst_map_u8_init(&valid, image.width, image.height), 0);
    for (int y = 0; y < image.height; y++) {
        for (int x = 0; x < image.width; x++)
            sst_map_u8_row(&valid, y)[x] = x + y / 4 < image.width / 2 ? 0 : 255;
        for (int x = 0; x + y / 4 < image.width / 2; x++) {
            for (int c = 0; c < 3; c++)
                sst_image_row(&image, c, y)[x] = 0;
        }
    }
    assert_int_equal(drift_pyramid_init(&v, &image, &everywhere, 160), 0);
    for (int i = 0; i < v.first[DRIFT_CELLS]; i++)
        before += abs(v.feature[i].x + v.feature[i].y / 4 - image.width / 2) < 8;
    assert_true(before > 0);
    drift_pyramid_fini(&v);
    assert_int_equal(drift_pyramid_init(&v, &image, &valid, 160), 0);
    assert_true(v.first[DRIFT_CELLS] > 0);
    for (int i = 0; i < v.first[DRIFT_CELLS]; i++)
        assert_true(v.feature[i].x + v.feature[i].y / 4 - image.width / 2 >= 8);
    drift_pyramid_fini(&v);
    sst_map_u8_fini(&valid);
    sst_image_fini(&image);
}

/* A covered lens with something in focus on it: nothing of it is in the neighbours' pictures. */
static void covered_camera_is_lost(void **state)
{
    const struct recipe r = plain(4, 4, 51), other = plain(4, 4, 52);
    struct sst_lightfield lf;
    struct sst_drift c;

    (void)state;
    make(&lf, &r);
    sst_image_fini(&lf.views[5].image);
    draw_view(&lf.views[5].image, &other, 5, 0, 0);
    run(&c, &lf, 2);
    assert_int_equal(c.verdict, SST_DRIFT_DRIFTED);
    assert_true(c.camera[5].lost && c.camera[5].drifted && !c.camera[5].known);
    assert_non_null(strstr(c.sentence, "camera 01_01 shows nothing that its neighbours see"));
    assert_non_null(strstr(c.sentence, "the other 15 are within 0.0"));
    sst_drift_fini(&c);
    sst_lightfield_fini(&lf);
}

/* --- other grids -------------------------------------------------------------------------------------------------- */

/* A row sees vertical shifts alone. */
static void a_row_sees_vertical_shifts(void **state)
{
    struct recipe r = plain(1, 5, 61);
    struct sst_drift c;

    (void)state;
    r.fault[3].y = -0.6;
    r.fault[1].x = 0.6;
    check_recipe(&c, &r);
    assert_int_equal(c.verdict, SST_DRIFT_DRIFTED);
    assert_int_equal(c.pairs, 4);
    near_px(c.camera[3].shift_y_px, -0.6, 0.05);
    assert_true(isnan(c.camera[3].shift_x_px));
    near_px(c.camera[1].shift_y_px, 0, 0.05);
    assert_true(isnan(c.axes_px));
    sst_drift_fini(&c);
}

static void two_views_cannot_tell_which(void **state)
{
    struct recipe r = plain(1, 2, 62);
    struct sst_drift c;

    (void)state;
    check_recipe(&c, &r);
    assert_int_equal(c.verdict, SST_DRIFT_OK);
    sst_drift_fini(&c);
    r.fault[1].y = 0.8;
    check_recipe(&c, &r);
    assert_int_equal(c.verdict, SST_DRIFT_DRIFTED);
    assert_non_null(strstr(c.sentence, "cameras 00_00 and 00_01 sit 0.8"));
    near_px(c.pair[0].mean_px, 0.8, 0.05);
    sst_drift_fini(&c);
}

/* Holes are stepped over; figures stay right. */
static void holes_are_stepped_over(void **state)
{
    struct recipe r = plain(3, 4, 63);
    struct sst_lightfield lf;
    struct sst_drift c;

    (void)state;
    r.fault[7].y = 0.7;
    make(&lf, &r);
    for (int v = 5; v <= 6; v++) {
        sst_image_fini(&lf.views[v].image);
        lf.views[v].present = false;
    }
    run(&c, &lf, 2);
    assert_int_equal(c.verdict, SST_DRIFT_DRIFTED);
    assert_int_equal(c.pairs, 3 + 1 + 3 + 2 + 2 + 2);
    assert_false(c.camera[5].known);
    near_px(c.camera[7].shift_y_px, 0.7, 0.05);
    assert_true(c.camera[7].drifted);
    sst_drift_fini(&c);
    sst_lightfield_fini(&lf);
}

static void any_number_of_threads_gives_the_same(void **state)
{
    struct recipe r = plain(3, 3, 71);
    struct sst_lightfield lf;
    struct sst_drift a, b;

    (void)state;
    r.fault[2].x = 1;
    r.noise = 2;
    make(&lf, &r);
    run(&a, &lf, 1);
    run(&b, &lf, 5);
    assert_int_equal(a.pairs, b.pairs);
    assert_memory_equal(a.pair, b.pair, (size_t)a.pairs * sizeof(*a.pair));
    for (int v = 0; v < 9; v++) {
        assert_true(a.camera[v].shift_x_px == b.camera[v].shift_x_px);
        assert_true(a.camera[v].off_sigma_px == b.camera[v].off_sigma_px);
    }
    assert_string_equal(a.sentence, b.sentence);
    sst_drift_fini(&a);
    sst_drift_fini(&b);
    sst_lightfield_fini(&lf);
}

/* A black camera is no view with too little texture: the others have some. */
static void a_black_camera_is_named(void **state)
{
    const struct recipe r = plain(3, 3, 77);
    struct sst_lightfield lf;
    struct sst_drift c;

    (void)state;
    make(&lf, &r);
    for (int k = 0; k < 3; k++)
        memset(lf.views[5].image.plane[k], 3, lf.views[5].image.stride * HEIGHT);
    run(&c, &lf, 2);
    assert_int_equal(c.verdict, SST_DRIFT_DRIFTED);
    assert_true(c.camera[5].blank && c.camera[5].drifted && !c.camera[4].blank);
    assert_non_null(strstr(c.sentence, "camera 01_02 shows nothing at all"));
    sst_drift_fini(&c);
    sst_lightfield_fini(&lf);
}

static void unfit_input_is_refused(void **state)
{
    const struct sst_drift_config cfg = { .threads = 1 };
    struct sst_drift c = { .pairs = -7 };
    struct sst_lightfield lf;
    char text[SST_LOG_MAX];

    (void)state;
    sst_log_hold_errors(text);
    assert_int_equal(sst_lightfield_init(&lf, 1, 2), 0);
    lf.width = lf.height = 40;
    lf.views[0].present = true;
    assert_int_equal(sst_image_init(&lf.views[0].image, 40, 40), 0);
    assert_int_equal(sst_drift_check(&c, &lf, &cfg), -EBADMSG);
    assert_non_null(strstr(text, "1 view loaded, 2 are needed"));
    lf.views[1].present = true;
    assert_int_equal(sst_image_init(&lf.views[1].image, 40, 40), 0);
    assert_int_equal(sst_drift_check(&c, &lf, &cfg), -EBADMSG);
    assert_non_null(strstr(text, "40 x 40"));
    assert_int_equal(c.pairs, -7); /* untouched */
    sst_log_hold_errors(NULL);
    sst_lightfield_fini(&lf);
}

static void the_picture_shows_the_worst_in_red(void **state)
{
    struct recipe r = plain(3, 4, 81);
    struct sst_drift c;
    struct sst_image out;

    (void)state;
    r.fault[5].y = 2;
    check_recipe(&c, &r);
    assert_int_equal(sst_drift_picture(&out, &c), 0);
    /* The left edge of the box of camera 01_01 is red, the left edge of 00_03 green. */
    assert_true(sst_image_row(&out, 0, 40 + 168)[168 - 30] > 180 && sst_image_row(&out, 1, 40 + 168)[168 - 30] < 80);
    assert_true(sst_image_row(&out, 0, 40 + 56)[392 - 30] < 130 && sst_image_row(&out, 1, 40 + 56)[392 - 30] > 140);
    sst_image_fini(&out);
    sst_drift_fini(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(levels_share_centres),
        serial_test(alignment_is_unbiased),
        serial_test(sigmas_are_true),
        plain_test(nothing_is_found_where_nothing_is_wrong),
        plain_test(drifts_are_measured),
        serial_test(another_size_is_measured),
        plain_test(exchanged_views_are_named),
        plain_test(turned_grids_are_named),
        plain_test(unrectified_is_unusable),
        serial_test(blank_and_repeated_walls_raise_no_alarm),
        plain_test(meshes_contradict_themselves),
        plain_test(noise_is_measured),
        cmocka_unit_test(borders_are_no_features),
        serial_test(covered_camera_is_lost),
        serial_test(a_row_sees_vertical_shifts),
        serial_test(two_views_cannot_tell_which),
        serial_test(holes_are_stepped_over),
        thread_test(any_number_of_threads_gives_the_same),
        cmocka_unit_test(a_black_camera_is_named),
        cmocka_unit_test(unfit_input_is_refused),
        serial_test(the_picture_shows_the_worst_in_red),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
