/* Inputs at which formulas have no answer of their own: each has a defined result, which `make bounds` lists. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fenv.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/lightfield/rectify/rectify.h"
#include "pipeline/method/labels/labels.h"
#include "pipeline/method/process/process.h"
#include "pipeline/method/refine/parts.h"
#include "pipeline/method/render/render.h"
#include "simulators/scene/noise.h"
#include "tests/bounds.h"
#include "tests/camera_project.h"

static uint64_t seed = 1;
static char errors[SST_LOG_MAX]; /* refusals are expected */

/* --- 5.1 ------------------------------------------------------------------------------------------------------------
 */

static float entropy_of(const float *p, size_t count, uint8_t *top)
{
    float h;

    sst_class_row_ref(top, &h, p, 1, count, 1);
    return h;
}

static void entropies(void **state SST_UNUSED)
{
    const float sure[] = { 0, 1, 0 }, even[] = { 0.25F, 0.25F, 0.25F, 0.25F }, none[] = { 0, 0, 0 },
                half[] = { 0.5F, 0, 0 };
    uint8_t top;

    assert_true(entropy_of(sure, 3, &top) == 0 && top == 1);
    bound_case("entropy, p = 0 and 1", "0");
    assert_true(fabs((double)entropy_of(even, 4, &top) - log(4)) < 1e-6 && top == 0);
    bound_case("entropy, all equal", "log of their number; the smallest class");
    assert_true(entropy_of(none, 3, &top) == 0 && top == 0);
    bound_case("entropy, all 0 (no distribution)",
               "class 0, entropy 0; sst_segment() refuses outputs that are not finite");
    assert_true(fabs((double)entropy_of(half, 3, &top)) < 1e-6 && top == 0);
    bound_case("entropy, sum below 1", "that of the classes beside the most probable one");
}

/* Comparing with NaN is an invalid operation; this one is on purpose. */
static void entropy_of_nan(void **state SST_UNUSED)
{
    float p[] = { 0.5F, 0.5F, 0 };
    struct sst_map_f32 h;
    struct sst_map_u8 label;
    fenv_t env;

    feholdexcept(&env);
    assert_int_equal(sst_map_f32_init(&h, 1, 1), 0);
    assert_int_equal(sst_map_u8_init(&label, 1, 1), 0);
    p[2] = strtof("nan", NULL);
    sst_class_row_ref(label.data, h.data, p, 1, 3, 1);
    label.data[0]++;
    assert_true(isnan(h.data[0]));
    sst_hcsm(&label, &h, INFINITY);
    assert_int_equal(label.data[0], 0);
    bound_case("entropy, NaN", "NaN; never kept, below no threshold");
    sst_map_f32_fini(&h);
    sst_map_u8_fini(&label);
    feclearexcept(FE_ALL_EXCEPT);
    fesetenv(&env);
}

static int search(struct sst_epsilon_result *r, int n, const uint8_t *found, const uint8_t *right, const float *h,
                  double m)
{
    struct sst_map_u8 label, truth;
    struct sst_map_f32 entropy;
    int err;

    assert_int_equal(sst_map_u8_init(&label, n, 1), 0);
    assert_int_equal(sst_map_u8_init(&truth, n, 1), 0);
    assert_int_equal(sst_map_f32_init(&entropy, n, 1), 0);
    memcpy(label.data, found, (size_t)n);
    memcpy(truth.data, right, (size_t)n);
    memcpy(entropy.data, h, (size_t)n * sizeof(*h));
    sst_log_hold_errors(errors);
    err = sst_epsilon_search(r, &label, &entropy, &truth, m);
    sst_log_hold_errors(NULL);
    sst_map_u8_fini(&label);
    sst_map_u8_fini(&truth);
    sst_map_f32_fini(&entropy);
    return err;
}

static void thresholds(void **state SST_UNUSED)
{
    const uint8_t found[] = { 1, 1, 2 }, right[] = { 1, 1, 1 }, wrong[] = { 2, 2, 1 };
    const float equal[] = { 0.5F, 0.5F, 0.5F }, far[] = { INFINITY, INFINITY, INFINITY };
    struct sst_epsilon_result r;

    assert_int_equal(search(&r, 3, found, wrong, equal, 4), -EBADMSG);
    bound_case("eps_H, no correct pixel", "an error, not a score");
    assert_int_equal(search(&r, 3, found, right, equal, 4), 0);
    assert_true(r.eps_h > 0.5 && fabs(r.accuracy - 2 / 3.0) < 1e-12);
    bound_case("eps_H, all entropies equal", "just above them: all pixels are kept");
    assert_int_equal(search(&r, 3, found, right, equal, 0), 0);
    assert_true(fabs(r.score - 2 / 3.0) < 1e-12);
    bound_case("eps_H, m = 0", "coverage alone; pow(NaN, 0) cannot occur");
    assert_int_equal(search(&r, 3, found, right, far, 4), -EBADMSG);
    bound_case("eps_H, all entropies infinite", "an error: nothing is ever kept");
}

/* --- 5.3 ------------------------------------------------------------------------------------------------------------
 */

static void fits(void **state SST_UNUSED)
{
    int64_t *hist = calloc(SST_DISP_BINS, sizeof(*hist));
    struct sst_refine_config cfg;
    struct sst_label_fit f;

    assert_non_null(hist);
    sst_refine_config_defaults(&cfg);
    cfg.min_pixels = 1;
    f = sst_refine_fit_histogram(hist, 0, &cfg);
    assert_true(!f.usable && f.sigma_px > 0);
    bound_case("label fit, no pixel", "takes no part; spread at its floor");
    hist[640] = 1;
    f = sst_refine_fit_histogram(hist, 0, &cfg);
    assert_true(f.usable && f.mean_px == 10 && f.sigma_px >= cfg.matcher_sigma_px);
    bound_case("label fit, one pixel or equal ones", "spread at its floor, sqrt(quantum^2 / 12 + matcher_sigma^2)");
    free(hist);
}

static void normals(void **state SST_UNUSED)
{
    enum { N = 25 };
    struct sst_planes planes = { .width = N, .height = N, .window = SST_NORMAL_WINDOW_MIN };
    struct sst_map_u16 disp;
    int64_t *sums = malloc(N * SST_PLANE_SUMS * sizeof(*sums));

    planes.at = malloc(sizeof(*planes.at) * N * N);
    assert_true(sums && planes.at);
    assert_int_equal(sst_map_u16_init(&disp, N, N), 0);
    for (int kind = 0; kind < 3; kind++) {
        for (int i = 0; i < N * N; i++)
            sst_map_u16_row(&disp, i / N)[i % N] =
                (uint16_t)((kind == 1 && i % N == N / 2) || (kind == 2 && i == N * (N / 2) + N / 2) ? 500
                                                                                                    : SST_DISP_NONE);
        sst_planes_fit(&planes, &disp, sums);
        for (int i = 0; i < N * N; i++)
            assert_true(planes.at[i].variance == SST_SURFACE_NONE);
    }
    bound_case("normals, no pixel, one pixel, a line of pixels", "no plane, so no normal");
    assert_true(sst_energy_distance(0, 0) == 0);
    bound_case("E_d of a region of one pixel, at it", "0");
    assert_true(sst_energy_normal((const float[3]){ 0, 0, 1 }, &(struct sst_region){ .mean = { 0, 0, -1 } }, 0.1) == 0);
    bound_case("E_n against opposed normals, or none", "0: no consistency");
    sst_map_u16_fini(&disp);
    free(planes.at);
    free(sums);
}

/* --- 5.4, 5.6 -------------------------------------------------------------------------------------------------------
 */

struct field {
    struct sst_lightfield lf;
    struct sst_image out;
    struct sst_map_u8 valid;
};

static void field_init(struct field *f, int rows, int cols, int width, int height)
{
    *f = (struct field){ 0 };
    assert_int_equal(sst_lightfield_init(&f->lf, rows, cols), 0);
    f->lf.width = width;
    f->lf.height = height;
    f->lf.classes = sst_classes_default;
    assert_int_equal(sst_image_init(&f->out, width, height), 0);
    assert_int_equal(sst_map_u8_init(&f->valid, width, height), 0);
    for (int k = 0; k < rows * cols; k++) {
        struct sst_view *v = &f->lf.views[k];

        v->present = true;
        assert_int_equal(sst_image_init(&v->image, width, height), 0);
        assert_int_equal(sst_map_u16_init(&v->disp, width, height), 0);
        assert_int_equal(sst_map_u8_init(&v->label, width, height), 0);
        for (int i = 0; i < width * height; i++) {
            for (int c = 0; c < 3; c++)
                sst_image_row(&v->image, c, i / width)[i % width] = (uint8_t)sst_random_u64(&seed);
            sst_map_u16_row(&v->disp, i / width)[i % width] = 320;
            sst_map_u8_row(&v->label, i / width)[i % width] = 1;
        }
    }
}

static void field_fini(struct field *f)
{
    sst_image_fini(&f->out);
    sst_map_u8_fini(&f->valid);
    sst_lightfield_fini(&f->lf);
}

static void set_all(struct field *f, int disp, int label)
{
    for (int k = 0; k < f->lf.rows * f->lf.cols; k++) {
        for (int y = 0; y < f->lf.height; y++) {
            for (int x = 0; x < f->lf.width; x++) {
                sst_map_u16_row(&f->lf.views[k].disp, y)[x] = (uint16_t)disp;
                sst_map_u8_row(&f->lf.views[k].label, y)[x] = (uint8_t)label;
            }
        }
    }
}

static int render(struct field *f, const struct sst_render_config *cfg)
{
    struct sst_renderer *r;
    int err;

    assert_int_equal(sst_renderer_create(&r, &f->lf, 2), 0);
    sst_log_hold_errors(errors);
    err = sst_render(r, cfg, &f->out, &f->valid);
    sst_log_hold_errors(NULL);
    sst_renderer_destroy(r);
    return err;
}

static struct sst_render_config config(double focus_px)
{
    struct sst_render_config cfg;

    sst_render_config_defaults(&cfg);
    cfg.focus_px = focus_px;
    cfg.verify = SST_VERIFY_OFF;
    return cfg;
}

static bool valid_is(const struct field *f, int value)
{
    for (int y = 0; y < f->lf.height; y++) {
        for (int x = 0; x < f->lf.width; x++) {
            if (sst_map_u8_row(&f->valid, y)[x] != value)
                return false;
        }
    }
    return true;
}

/* Largest distance from plain refocusing at the same focus. */
static int from_refocus(struct field *f, const struct sst_render_config *cfg)
{
    struct sst_render_config plain = *cfg;
    struct sst_image got = f->out;
    int most = 0;

    assert_int_equal(sst_image_init(&f->out, f->lf.width, f->lf.height), 0);
    plain.method = SST_RENDER_REFOCUS;
    assert_int_equal(render(f, &plain), 0);
    for (int y = 0; y < f->lf.height; y++) {
        for (int x = 0; x < f->lf.width; x++)
            most = abs(sst_image_row(&got, 1, y)[x] - sst_image_row(&f->out, 1, y)[x]) > most
                       ? abs(sst_image_row(&got, 1, y)[x] - sst_image_row(&f->out, 1, y)[x])
                       : most;
    }
    sst_image_fini(&f->out);
    f->out = got;
    return most;
}

static void weights(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(5);
    struct field f;

    field_init(&f, 2, 3, 12, 9);
    cfg.c1 = cfg.c2 = 0;
    cfg.sigma_px = 1e-6;
    sst_map_u16_row(&f.lf.views[0].disp, 0)[0] = 300; /* something for the range to lie around */
    cfg.focus_px = 4.8;
    assert_int_equal(render(&f, &cfg), 0);
    assert_true(valid_is(&f, 0));
    assert_in_range(from_refocus(&f, &cfg), 0, 1);
    bound_case("rendering, no ray with weight (C1 = C2 = 0, all far)",
               "the plain refocus value, unsupported in the validity plane");
    cfg.unsupported = SST_UNSUPPORTED_INVALID;
    assert_int_equal(render(&f, &cfg), 0);
    assert_int_equal(sst_image_row(&f.out, 0, 5)[5], 0);
    bound_case("the same, --unsupported invalid", "black, 0 in the validity plane");
    cfg = config(5);
    cfg.sigma_px = INFINITY;
    cfg.c2 = 1;
    assert_int_equal(render(&f, &cfg), 0);
    assert_int_equal(from_refocus(&f, &cfg), 0);
    bound_case("rendering, sigma infinite, C2 = 1", "plain refocusing, same bytes");
    cfg = config(5);
    cfg.sigma_px = 0;
    assert_int_equal(render(&f, &cfg), 0);
    bound_case("rendering, sigma 0", "the default: a tenth of the disparity range, at least 0.1 px");
    cfg.sigma_px = -1;
    assert_int_equal(render(&f, &cfg), -EINVAL);
    cfg.sigma_px = NAN;
    assert_int_equal(render(&f, &cfg), -EINVAL);
    bound_case("rendering, sigma negative or NaN", "refused");
    field_fini(&f);
}

static void ranges(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(5);
    struct field f;

    field_init(&f, 2, 2, 12, 9);
    cfg.range = SST_RANGE_MINMAX;
    assert_int_equal(render(&f, &cfg), 0);
    assert_true(sst_weight_label(5, 5, 5, 1.0 / 64, 0) == 1);
    bound_case("W_s, Dmin = Dmax", "widened to one quantum: 1 at the focus, C2 a quantum away");
    sst_map_u8_row(&f.lf.views[0].label, 0)[0] = 7;
    assert_int_equal(render(&f, &cfg), 0);
    bound_case("W_s, a label of one pixel", "a range of one quantum around it");
    set_all(&f, 320, 0);
    assert_int_equal(render(&f, &cfg), 0);
    bound_case("W_s, no labels", "1: depth alone decides");
    cfg.focus_label = 9;
    assert_int_equal(render(&f, &cfg), 0);
    bound_case("focus label that does not occur", "all labels weigh the same; unlabeled rays as before");
    set_all(&f, SST_DISP_NONE, 1);
    cfg = config(0);
    assert_int_equal(render(&f, &cfg), 0);
    bound_case("rendering, all disparities unknown", "W_d = C1 for all: plain refocusing, unsupported");
    f.lf.disp_min_px = -500;
    set_all(&f, 0, 1);
    cfg = config(-500);
    assert_int_equal(render(&f, &cfg), -ERANGE);
    bound_case("rendering, a focus at which the views do not overlap", "refused");
    f.lf.disp_min_px = -3;
    set_all(&f, SST_DISP_MAX_Q6, 1);
    cfg = config(-3 + SST_DISP_MAX_Q6 / 64.0);
    assert_int_equal(render(&f, &cfg), -ERANGE);
    set_all(&f, 0, 1);
    cfg = config(-3);
    assert_int_equal(render(&f, &cfg), 0);
    bound_case("disparities at both ends of what is stored, negative ones", "rendered where the views overlap");
    field_fini(&f);
}

static void clear_pictures(void **state SST_UNUSED)
{
    struct sst_render_config cfg = config(5);
    struct field f;

    field_init(&f, 3, 3, 24, 18);
    cfg.method = SST_RENDER_CLEAR;
    cfg.cut_px = 1;
    assert_int_equal(render(&f, &cfg), -ERANGE);
    bound_case("clear picture, everything in front of the cut", "refused: the message names the range of disparities");
    cfg.cut_px = 900;
    assert_int_equal(render(&f, &cfg), 0);
    assert_true(valid_is(&f, 255));
    bound_case("clear picture, everything behind the cut", "the viewpoint's own camera");
    cfg.cut_px = NAN;
    assert_int_equal(render(&f, &cfg), -EINVAL);
    bound_case("clear picture, cut NaN", "refused");
    cfg.cut_px = INFINITY;
    cfg.remove_label = 1;
    assert_int_equal(render(&f, &cfg), 0);
    assert_true(valid_is(&f, 0));
    bound_case("clear picture, the label of everything removed", "black, unknown");
    field_fini(&f);
}

static void sizes(void **state SST_UNUSED)
{
    static const int size[][2] = { { 1, 1 }, { 1, 9 }, { 9, 1 }, { 2, 2 }, { 20000, 2 }, { 2, 20000 } };

    for (size_t i = 0; i < ARRAY_LEN(size); i++) {
        for (int method = SST_RENDER_REFOCUS; method <= SST_RENDER_CLEAR; method++) {
            struct sst_render_config cfg = config(0);
            struct field f;

            field_init(&f, 1, 2, size[i][0], size[i][1]);
            set_all(&f, 0, 1);
            cfg.method = (enum sst_render_method)method;
            assert_int_equal(render(&f, &cfg), 0);
            field_fini(&f);
        }
    }
    bound_case("rendering, 1x1 to 20000x2 and 2x20000", "rendered by all three methods");
}

/* --- the chain -------------------------------------------------------------------------------------------------------
 */

enum { W = 72, H = 48 };

static void paint(struct field *f, int kind)
{
    for (int k = 0; k < f->lf.rows * f->lf.cols; k++) {
        for (int y = 0; y < H; y++) {
            for (int x = 0; x < W; x++) {
                for (int c = 0; c < 3; c++)
                    sst_image_row(&f->lf.views[k].image, c, y)[x] =
                        (uint8_t)(kind == 0   ? 100
                                  : kind == 1 ? 0
                                  : kind == 2 ? 255
                                  : kind == 3 ? (x == W / 2 && y == H / 2 ? 255 : 0)
                                  : kind == 4 ? (x / 4 % 2 ? 200 : 30)
                                  : kind == 5 ? sst_noise_hash(x, y, 0, 5) % 256
                                              : sst_noise_hash(x, y, k, 6) % 256);
            }
        }
    }
}

static void chains(void **state SST_UNUSED)
{
    static const char *const kinds[] = { "constant", "black",        "saturated", "of one bright pixel",
                                         "periodic", "all the same", "pure noise" };

    for (int kind = 0; kind < (int)ARRAY_LEN(kinds); kind++) {
        struct sst_process_config cfg = { .eps_h = -1, .accuracy_weight = 4, .refine = true, .threads = 2 };
        struct sst_process_report report;
        struct sst_render_config look = config(0);
        char name[64];
        struct field f;

        field_init(&f, 3, 3, W, H);
        paint(&f, kind);
        for (int k = 0; k < 9; k++) {
            sst_map_u16_fini(&f.lf.views[k].disp);
            sst_map_u8_fini(&f.lf.views[k].label);
        }
        assert_int_equal(sst_disparity_preset(&cfg.disparity, "balanced"), 0);
        sst_refine_config_defaults(&cfg.refinement);
        cfg.disparity.disp_max_px = 8;
        assert_int_equal(sst_process(&f.lf, &cfg, NULL, &report), 0);
        assert_true(report.confirmed >= 0 && report.confirmed <= 100);
        look.focus_px = sst_disp_px(&f.lf, sst_map_u16_row(&f.lf.views[f.lf.ref_view].disp, H / 2)[W / 2]);
        assert_int_equal(render(&f, &look), 0);
        look.method = SST_RENDER_CLEAR;
        look.cut_px = INFINITY;
        assert_int_equal(render(&f, &look), 0);
        snprintf(name, sizeof(name), "matching, pictures %s", kinds[kind]);
        bound_case(name, "%.0f %% of the disparities confirmed, %s", report.confirmed,
                   report.parallax == SST_PARALLAX_NONE ? "reported: no parallax" : "rendered");
        field_fini(&f);
    }
}

/* A textured wall with a post in front, seen by 3x3 cameras. */
static void paint_post(struct field *f)
{
    for (int k = 0; k < 9; k++) {
        for (int y = 0; y < H; y++) {
            for (int x = 0; x < W; x++) {
                const double bx = f->lf.views[k].bx, by = f->lf.views[k].by;
                const bool post = x + 6 * bx >= 30 && x + 6 * bx < 42;
                const int d = post ? 6 : 2;

                for (int c = 0; c < 3; c++)
                    sst_image_row(&f->lf.views[k].image, c, y)[x] =
                        (uint8_t)(sst_noise_hash(x + d * (int)bx, y + d * (int)by, post, 7) % 256);
                sst_map_u8_row(&f->lf.views[k].label, y)[x] = (uint8_t)(post ? 1 : x % 3 ? 2 : 0);
            }
        }
    }
}

/* The whole chain under each rounding mode: a thread inherits the mode of its creator. */
static void rounding(void **state SST_UNUSED)
{
    static const int modes[] = { FE_TONEAREST, FE_DOWNWARD, FE_UPWARD, FE_TOWARDZERO };
    struct field f[4];
    int most = 0, differ = 0, farthest = 0;

    for (int m = 0; m < 4; m++) {
        struct sst_process_config cfg = { .eps_h = -1, .accuracy_weight = 4, .refine = true, .threads = 2 };
        struct sst_render_config look = config(2);

        field_init(&f[m], 3, 3, W, H);
        paint_post(&f[m]);
        assert_int_equal(sst_disparity_preset(&cfg.disparity, "balanced"), 0);
        sst_refine_config_defaults(&cfg.refinement);
        cfg.disparity.disp_max_px = 9;
        assert_int_equal(fesetround(modes[m]), 0);
        assert_int_equal(sst_process(&f[m].lf, &cfg, NULL, NULL), 0);
        assert_int_equal(render(&f[m], &look), 0);
        assert_int_equal(fesetround(FE_TONEAREST), 0);
        for (int i = 0; i < W * H; i++) {
            const int a = sst_image_row(&f[m].out, 1, i / W)[i % W], b = sst_image_row(&f[0].out, 1, i / W)[i % W];

            most = abs(a - b) > most ? abs(a - b) : most;
            for (int k = 0; k < 9; k++) {
                const int off = abs((int)sst_map_u16_row(&f[m].lf.views[k].disp, i / W)[i % W] -
                                    (int)sst_map_u16_row(&f[0].lf.views[k].disp, i / W)[i % W]);

                differ += off != 0;
                farthest = off > farthest ? off : farthest;
            }
        }
    }
    for (int m = 0; m < 4; m++)
        field_fini(&f[m]);
    print_message("%d disparities differ by up to %d/64 px, %d levels\n", differ, farthest, most);
    /* Half-way between two steps of 1/64 px, and where a pixel of a window counts or not. */
    assert_in_range(differ, 0, 27 * W * H / 10000);
    assert_in_range(farthest, 0, 20);
    assert_in_range(most, 0, 1);
    bound_case("the four rounding modes", "%d disparities of %d differ, by up to %d/64 px; pictures within %d level",
               differ, 27 * W * H, farthest, most);
}

/* --- geometry
 * --------------------------------------------------------------------------------------------------------- */

static int plan(const double (*centre)[3], int n, double turn)
{
    struct sst_rectified to;
    struct sst_calib calib;
    int err;

    assert_int_equal(sst_calib_init(&calib, 1, n), 0);
    calib.width = 64;
    calib.height = 48;
    for (int k = 0; k < n; k++) {
        calib.camera[k] =
            (struct sst_calib_camera){ .known = true, .fx = 60, .fy = 60, .cx = 32, .cy = 24, .gain = { 1, 1, 1 } };
        sst_rotation_from_vector((const double[3]){ 0, k == calib.reference ? 0 : turn, 0 }, calib.camera[k].rotation);
        for (int i = 0; i < 3; i++)
            calib.camera[k].position_mm[i] = centre[k][i] - centre[calib.reference][i];
    }
    sst_log_hold_errors(errors);
    err = sst_rectify_plan(&to, &calib, &(struct sst_rectify_config){ 0 });
    sst_log_hold_errors(NULL);
    sst_calib_fini(&calib);
    return err;
}

static void geometry(void **state SST_UNUSED)
{
    const double row[][3] = { { 0, 0, 0 }, { 100, 0, 0 } }, same[][3] = { { 0, 0, 0 }, { 0, 0, 0 } };
    double v[3], m[9], x, y;
    struct sst_calib_camera cam = { .known = true, .fx = 60, .fy = 60 };

    assert_int_equal(plan(row, 2, 0), 0);
    assert_int_equal(plan(same, 2, 0), -EBADMSG);
    bound_case("rectification, two cameras at one place", "refused: no lattice");
    assert_int_equal(plan(row, 2, 3.1), -EBADMSG);
    bound_case("rectification, a camera that looks the other way", "refused");
    sst_rotation_from_vector((const double[3]){ 0, 0, 0 }, m);
    sst_rotation_to_vector(m, v);
    assert_true(v[0] == 0 && v[1] == 0 && v[2] == 0);
    bound_case("rotation by 0", "exactly 0 there and back");
    sst_rotation_from_vector((const double[3]){ acos(-1), 0, 0 }, m);
    sst_rotation_to_vector(m, v);
    assert_true(fabs(fabs(v[0]) - acos(-1)) < 1e-7 && fabs(v[1]) + fabs(v[2]) < 1e-7);
    bound_case("rotation by pi", "the axis, of either sign");
    memcpy(cam.rotation, ((double[9]){ 1, 0, 0, 0, 1, 0, 0, 0, 1 }), sizeof(cam.rotation));
    assert_false(camera_project(&cam, (const double[3]){ 1, 1, 0 }, &x, &y));
    assert_false(camera_project(&cam, (const double[3]){ 1, 1, -5 }, &x, &y));
    bound_case("projection, a point beside or behind the camera", "not seen");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(entropies), cmocka_unit_test(entropy_of_nan), cmocka_unit_test(thresholds),
        cmocka_unit_test(fits),      cmocka_unit_test(normals),        cmocka_unit_test(weights),
        cmocka_unit_test(ranges),    cmocka_unit_test(clear_pictures), cmocka_unit_test(sizes),
        cmocka_unit_test(chains),    cmocka_unit_test(rounding),       cmocka_unit_test(geometry),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
