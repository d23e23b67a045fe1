/* Costs and errors of rectifying, beside OpenCV's remap: rectify PICTURE ROUNDS. Prints CSV, one line for
 * each round, filter and, of ours, level of the processor (levels.h): CPU time of resampling 2000x1500 pixels with a
 * lens of 8 coefficients, one thread; the error against the same filter in double at the exact place; and the PSNR of
 * the picture moved by half a pixel and turned there and back. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/lightfield/rectify/rectify.h"
#include "tests/bench/levels.h"
#include "tests/bench/remap.h"

#define WIDTH  2000 /* of the timed work */
#define HEIGHT 1500
#define MARGIN 8 /* px of a picture's border that are not judged */

static const enum sst_filter filters[] = { SST_FILTER_BILINEAR, SST_FILTER_BICUBIC, SST_FILTER_LANCZOS };

static void fail(const char *what, int err)
{
    fprintf(stderr, "rectify: %s: %s\n", what, strerror(-err));
    exit(1);
}

static void check(const char *what, int err)
{
    if (err)
        fail(what, err);
}

/* Two cameras 60 mm apart, turned by a few tenths of a degree, with a lens of 8 coefficients. */
static struct sst_calib pair(int width, int height, double focal, bool lens, double turn_rad)
{
    const double k[8] = { 0.25, -0.15, 4e-4, -3e-4, 0.03, 0.45, -0.08, 0.07 };
    struct sst_calib calib;

    check("calibration", sst_calib_init(&calib, 1, 2));
    calib.width = width;
    calib.height = height;
    for (int i = 0; i < 2; i++) {
        struct sst_calib_camera *cam = &calib.camera[i];

        cam->known = true;
        cam->fx = cam->fy = focal;
        cam->cx = (width - 1) / 2.0;
        cam->cy = (height - 1) / 2.0;
        cam->position_mm[0] = 60 * i;
        if (lens) {
            cam->lens = 8;
            memcpy(cam->k, k, sizeof(k));
        }
        if (i)
            sst_rotation_from_vector((const double[3]){ lens ? 0.004 : 0, lens ? -0.006 : 0, turn_rad }, cam->rotation);
    }
    return calib;
}

static struct sst_rectify_map *map_of(const struct sst_rectified *to, const struct sst_calib *calib)
{
    struct sst_rectify_map *map;

    check("map", sst_rectify_map_create(&map, to, calib, 1));
    return map;
}

static struct sst_rectified plan(const struct sst_calib *calib)
{
    struct sst_rectified to;

    check("plan", sst_rectify_plan(&to, calib, &(struct sst_rectify_config){ .plane_mm = 0 }));
    return to;
}

/* One picture of WIDTHxHEIGHT, timed and forgotten: its contents change no time. */
struct timed {
    struct sst_calib calib;
    struct sst_rectified to;
    struct sst_rectify_map *map;
    struct sst_image raw, out;
    struct bench_remap *remap[ARRAY_LEN(filters)];
};

/* Places as OpenCV wants them: outside the picture -1. */
static void places_of(struct sst_map_f32 *x, struct sst_map_f32 *y, const struct sst_rectified *to,
                      const struct sst_calib *calib)
{
    for (int row = 0; row < x->height; row++) {
        for (int col = 0; col < x->width; col++) {
            double raw[2];
            const bool seen = sst_rectify_point(to, calib, 1, (const double[2]){ col, row }, raw);

            sst_map_f32_row(x, row)[col] = seen ? (float)raw[0] : -1;
            sst_map_f32_row(y, row)[col] = seen ? (float)raw[1] : -1;
        }
    }
}

static struct bench_remap *remap_of(const struct sst_image *img, const struct sst_rectified *to,
                                    const struct sst_calib *calib, enum sst_filter filter)
{
    struct sst_map_f32 x = { 0 }, y = { 0 };
    struct bench_remap *remap;

    check("places", sst_map_f32_init(&x, img->width, img->height));
    check("places", sst_map_f32_init(&y, img->width, img->height));
    places_of(&x, &y, to, calib);
    remap = bench_remap_create(img, &x, &y, filter);
    sst_map_f32_fini(&x);
    sst_map_f32_fini(&y);
    return remap;
}

static void timed_init(struct timed *t)
{
    t->calib = pair(WIDTH, HEIGHT, 1.1 * WIDTH, true, 0.005);
    t->to = plan(&t->calib);
    t->map = map_of(&t->to, &t->calib);
    check("picture", sst_image_init(&t->raw, WIDTH, HEIGHT));
    check("picture", sst_image_init(&t->out, WIDTH, HEIGHT));
    for (size_t f = 0; f < ARRAY_LEN(filters); f++)
        t->remap[f] = remap_of(&t->raw, &t->to, &t->calib, filters[f]);
}

static void timed_fini(struct timed *t)
{
    for (size_t f = 0; f < ARRAY_LEN(filters); f++)
        bench_remap_destroy(t->remap[f]);
    sst_image_fini(&t->raw);
    sst_image_fini(&t->out);
    sst_rectify_map_destroy(t->map);
    sst_calib_fini(&t->calib);
}

/* CPU milliseconds of one picture. */
static double time_one(struct timed *t, size_t filter, bool opencv)
{
    const int64_t start_ns = sst_clock_cpu_ns();

    if (opencv)
        bench_remap_run(t->remap[filter]);
    else
        check("view",
              sst_rectify_view(&(struct sst_rectified_view){ &t->out, NULL }, t->map, filters[filter], &t->raw));
    return (double)(sst_clock_cpu_ns() - start_ns) * 1e-6;
}

/* --- errors ------------------------------------------------------------------------------------------------------- */

static double weight_at(enum sst_filter f, double x)
{
    const double p = M_PI * x;

    x = fabs(x);
    if (f == SST_FILTER_BILINEAR)
        return fmax(0, 1 - x);
    if (f == SST_FILTER_BICUBIC)
        return x < 1 ? 1.5 * x * x * x - 2.5 * x * x + 1 : x < 2 ? -0.5 * x * x * x + 2.5 * x * x - 4 * x + 2 : 0;
    return x >= 3 ? 0 : x == 0 ? 1 : 3 * sin(p) * sin(p / 3) / (p * p);
}

/* The filter's value at a place, in double, weights divided by their sum. */
static double exact_sample(const struct sst_image *img, enum sst_filter f, int c, double u, double v)
{
    const int n = f == SST_FILTER_BILINEAR ? 1 : f == SST_FILTER_BICUBIC ? 2 : 3;
    const int x0 = (int)floor(u), y0 = (int)floor(v);
    double sum = 0, total = 0;

    for (int y = y0 + 1 - n; y <= y0 + n; y++) {
        for (int x = x0 + 1 - n; x <= x0 + n; x++) {
            const double w = weight_at(f, x - u) * weight_at(f, y - v);

            sum += w * sst_image_row(img, c, sst_clamp_int(y, 0, img->height - 1))[sst_clamp_int(x, 0, img->width - 1)];
            total += w;
        }
    }
    return sst_clamp_double(sum / total, 0, 255);
}

/* A view of `raw`, ours or OpenCV's. */
static void make(struct sst_image *out, const struct sst_image *raw, const struct sst_rectified *to,
                 const struct sst_calib *calib, enum sst_filter filter, bool opencv)
{
    check("picture", sst_image_init(out, raw->width, raw->height));
    if (opencv) {
        struct bench_remap *remap = remap_of(raw, to, calib, filter);

        bench_remap_run(remap);
        bench_remap_copy(remap, out);
        bench_remap_destroy(remap);
    } else {
        struct sst_rectify_map *map = map_of(to, calib);

        check("view", sst_rectify_view(&(struct sst_rectified_view){ out, NULL }, map, filter, raw));
        sst_rectify_map_destroy(map);
    }
}

struct errors {
    double rms, most, moved_db, turned_db;
};

static void errors_against_double(struct errors *errors, const struct sst_image *raw, enum sst_filter filter,
                                  bool opencv)
{
    struct sst_calib calib = pair(raw->width, raw->height, 1.1 * raw->width, true, 0.005);
    const struct sst_rectified to = plan(&calib);
    double worst = 0, sum2 = 0, n = 0;
    struct sst_image out;

    make(&out, raw, &to, &calib, filter, opencv);
    for (int y = 0; y < out.height; y += 3) {
        for (int x = 0; x < out.width; x++) {
            double at[2], e;

            if (!sst_rectify_point(&to, &calib, 1, (const double[2]){ x, y }, at) || at[0] < MARGIN || at[1] < MARGIN ||
                at[0] > raw->width - MARGIN || at[1] > raw->height - MARGIN)
                continue;
            e = sst_image_row(&out, 1, y)[x] - exact_sample(raw, filter, 1, at[0], at[1]);
            worst = fmax(worst, fabs(e));
            sum2 += e * e;
            n++;
        }
    }
    errors->rms = sqrt(sum2 / n);
    errors->most = worst;
    sst_image_fini(&out);
    sst_calib_fini(&calib);
}

static double psnr(const struct sst_image *a, const struct sst_image *b, int margin)
{
    double sum2 = 0, n = 0;

    for (int c = 0; c < 3; c++) {
        for (int y = margin; y < a->height - margin; y++) {
            for (int x = margin; x < a->width - margin; x++) {
                const double e = sst_image_row(a, c, y)[x] - sst_image_row(b, c, y)[x];

                sum2 += e * e;
                n++;
            }
        }
    }
    return 10 * log10(255 * 255 / (sum2 / n));
}

/* Half the size, from pixel (at, at) on. */
static void reduce(struct sst_image *out, const struct sst_image *in, int at)
{
    check("picture", sst_image_init(out, in->width / 2 - 1, in->height / 2 - 1));
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < out->height; y++) {
            const uint8_t *a = sst_image_row(in, c, 2 * y + at) + at, *b = sst_image_row(in, c, 2 * y + at + 1) + at;

            for (int x = 0; x < out->width; x++)
                sst_image_row(out, c, y)[x] = (uint8_t)((a[2 * x] + a[2 * x + 1] + b[2 * x] + b[2 * x + 1] + 2) / 4);
        }
    }
}

/* Both pictures are means of 2x2 of one of twice the size, one pixel of that apart both ways: half a pixel of theirs.
 */
static double moved_half(const struct sst_image *large, enum sst_filter filter, bool opencv)
{
    struct sst_image from, want, got;
    struct sst_calib calib;
    struct sst_rectified to;
    double db;

    reduce(&from, large, 0);
    reduce(&want, large, 1);
    calib = pair(from.width, from.height, 1000, false, 0);
    to = plan(&calib);
    to.cx -= 0.5; /* a point that was at x is at x - 1/2 now */
    to.cy -= 0.5;
    make(&got, &from, &to, &calib, filter, opencv);
    db = psnr(&got, &want, MARGIN);
    sst_image_fini(&from);
    sst_image_fini(&want);
    sst_image_fini(&got);
    sst_calib_fini(&calib);
    return db;
}

static double turned_there_and_back(const struct sst_image *img, enum sst_filter filter, bool opencv)
{
    struct sst_image turned[2];
    double db;

    for (int back = 0; back < 2; back++) {
        struct sst_calib calib = pair(img->width, img->height, 1000, false, back ? -0.035 : 0.035); /* 2 degrees */
        struct sst_rectified to = plan(&calib);

        memcpy(to.rotation, (const double[9]){ 1, 0, 0, 0, 1, 0, 0, 0, 1 }, sizeof(to.rotation));
        to.cx = (img->width - 1) / 2.0;
        to.cy = (img->height - 1) / 2.0;
        make(&turned[back], back ? &turned[0] : img, &to, &calib, filter, opencv);
        sst_calib_fini(&calib);
    }
    db = psnr(&turned[1], img, sst_max_int(img->width, img->height) / 12);
    sst_image_fini(&turned[0]);
    sst_image_fini(&turned[1]);
    return db;
}

/* A filter of ours at a level, or of OpenCV. */
struct kind {
    size_t filter;
    bool opencv;
    enum sst_cpu_level level;
    struct errors errors;
};

static int list_kinds(struct kind kinds[3 * ARRAY_LEN(filters)])
{
    const struct bench_levels levels = bench_levels();
    int n = 0;

    for (size_t f = 0; f < ARRAY_LEN(filters); f++) {
        for (int l = 0; l < levels.count; l++)
            kinds[n++] = (struct kind){ .filter = f, .level = levels.level[l] };
        kinds[n++] = (struct kind){ .filter = f, .opencv = true, .level = levels.level[0] };
    }
    return n;
}

static void measure(const struct sst_image *img, int rounds)
{
    struct kind kinds[3 * ARRAY_LEN(filters)];
    const int n = list_kinds(kinds);
    struct timed timed;

    timed_init(&timed);
    for (struct kind *k = kinds; k < kinds + n; k++) {
        bench_level_use(k->level);
        errors_against_double(&k->errors, img, filters[k->filter], k->opencv);
        k->errors.moved_db = moved_half(img, filters[k->filter], k->opencv);
        k->errors.turned_db = turned_there_and_back(img, filters[k->filter], k->opencv);
    }
    printf("level,method,round,ms,ms_per_mpx,error_rms,error_most,moved_db,turned_db\n");
    for (int round = 0; round <= rounds; round++) { /* the first one warms up */
        for (const struct kind *k = kinds; k < kinds + n; k++) {
            const struct errors *e = &k->errors;
            double ms;

            bench_level_use(k->level);
            ms = time_one(&timed, k->filter, k->opencv);
            if (round)
                printf("%s,%s%s,%d,%.3f,%.3f,%.3f,%.2f,%.2f,%.2f\n", sst_cpu_level_name(k->level),
                       k->opencv ? "OpenCV " : "", sst_filter_name(filters[k->filter]), round, ms,
                       ms * 1e6 / (WIDTH * HEIGHT), e->rms, e->most, e->moved_db, e->turned_db);
        }
    }
    timed_fini(&timed);
}

int main(int argc, char **argv)
{
    const int rounds = argc == 3 ? atoi(argv[2]) : 0;
    struct sst_image img;

    if (rounds < 1) {
        fprintf(stderr, "usage: rectify PICTURE ROUNDS: rounds >= 1\n");
        return 2;
    }
    check(argv[1], sst_image_read(&img, argv[1]));
    measure(&img, rounds);
    sst_image_fini(&img);
    return 0;
}
