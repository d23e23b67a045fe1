/* What rectifying costs and how true it is: rectify PICTURE. Prints the tables of docs/measured/notes-calibration.md:
 * maps and resampling in milliseconds of CPU time (medians of 9, interleaved), the error against interpolation in
 * double at the exact place, and the PSNR of each filter on a real picture moved by half a pixel and turned there and
 * back. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/stats.h"
#include "pipeline/image/codec.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/lightfield/rectify/rectify_internal.h"

#define ROUNDS 9
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

static double median(double v[ROUNDS])
{
    return sst_stats_upper_median(v, ROUNDS);
}

/* --- time --------------------------------------------------------------------------------------------------------- */

static void time_all(int width, int height)
{
    struct sst_calib calib = pair(width, height, 1.1 * width, true, 0.005);
    const struct sst_rectified to = plan(&calib);
    double build[ROUNDS], places[ROUNDS], view[ARRAY_LEN(filters)][ROUNDS];
    const double mpx = 1e-6 * width * height;
    int32_t *row = malloc(2 * sizeof(*row) * (size_t)width);
    struct sst_image raw, out;
    struct sst_rectify_map *map = map_of(&to, &calib);

    check("picture", sst_image_init(&raw, width, height));
    check("picture", sst_image_init(&out, width, height));
    for (int r = 0; r < ROUNDS; r++) {
        int64_t t = sst_clock_cpu_ns();

        sst_rectify_map_destroy(map);
        map = map_of(&to, &calib);
        build[r] = (double)(sst_clock_cpu_ns() - t) * 1e-6;
        t = sst_clock_cpu_ns();
        for (int y = 0; y < height; y++)
            sst_rectify_map_row(map, 0, y, width, row);
        places[r] = (double)(sst_clock_cpu_ns() - t) * 1e-6;
        for (size_t f = 0; f < ARRAY_LEN(filters); f++) {
            t = sst_clock_cpu_ns();
            check("view", sst_rectify_view(map, filters[f], &out, NULL, &raw, 1));
            view[f][r] = (double)(sst_clock_cpu_ns() - t) * 1e-6;
        }
    }
    printf(
        "%dx%d, %s: map %.2f ms, %zu KiB, cells of %d px; places %.2f ms per megapixel\n", width, height,
        sst_cpu_level_name(sst_cpu_level()), median(build),
        ((size_t)(map->cells_x + 3) * (size_t)(map->cells_y + 3) * 16 + (size_t)map->cells_x * (size_t)map->cells_y) /
            1024,
        1 << map->shift, median(places) / mpx);
    for (size_t f = 0; f < ARRAY_LEN(filters); f++)
        printf("| %s | %.1f |\n", sst_filter_name(filters[f]), median(view[f]) / mpx);
    sst_rectify_map_destroy(map);
    sst_image_fini(&raw);
    sst_image_fini(&out);
    free(row);
    sst_calib_fini(&calib);
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

static void errors_against_double(const struct sst_image *raw)
{
    struct sst_calib calib = pair(raw->width, raw->height, 1.1 * raw->width, true, 0.005);
    const struct sst_rectified to = plan(&calib);
    struct sst_rectify_map *map = map_of(&to, &calib);
    struct sst_image out;

    check("picture", sst_image_init(&out, raw->width, raw->height));
    for (size_t f = 0; f < ARRAY_LEN(filters); f++) {
        double worst = 0, sum2 = 0, n = 0;

        check("view", sst_rectify_view(map, filters[f], &out, NULL, raw, 0));
        for (int y = 0; y < out.height; y += 3) {
            for (int x = 0; x < out.width; x++) {
                double u, v, e;

                if (!sst_rectify_point(&to, &calib, 1, x, y, &u, &v))
                    continue;
                e = sst_image_row(&out, 1, y)[x] - exact_sample(raw, filters[f], 1, u, v);
                worst = fmax(worst, fabs(e));
                sum2 += e * e;
                n++;
            }
        }
        printf("| %s | %.3f | %.2f |\n", sst_filter_name(filters[f]), sqrt(sum2 / n), worst);
    }
    sst_image_fini(&out);
    sst_rectify_map_destroy(map);
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
static double moved_half(const struct sst_image *large, enum sst_filter filter)
{
    struct sst_image from, want, got;
    struct sst_calib calib;
    struct sst_rectified to;
    struct sst_rectify_map *map;
    double db;

    reduce(&from, large, 0);
    reduce(&want, large, 1);
    calib = pair(from.width, from.height, 1000, false, 0);
    to = plan(&calib);
    to.cx -= 0.5; /* what was at x is at x - 1/2 now */
    to.cy -= 0.5;
    map = map_of(&to, &calib);
    check("picture", sst_image_init(&got, from.width, from.height));
    check("view", sst_rectify_view(map, filter, &got, NULL, &from, 0));
    db = psnr(&got, &want, MARGIN);
    sst_rectify_map_destroy(map);
    sst_image_fini(&from);
    sst_image_fini(&want);
    sst_image_fini(&got);
    sst_calib_fini(&calib);
    return db;
}

static double turned_there_and_back(const struct sst_image *img, enum sst_filter filter)
{
    struct sst_image a, b;

    check("picture", sst_image_init(&a, img->width, img->height));
    check("picture", sst_image_init(&b, img->width, img->height));
    for (int back = 0; back < 2; back++) {
        struct sst_calib calib = pair(img->width, img->height, 1000, false, back ? -0.035 : 0.035); /* 2 degrees */
        struct sst_rectified to = plan(&calib);
        struct sst_rectify_map *map;

        memcpy(to.rotation, (const double[9]){ 1, 0, 0, 0, 1, 0, 0, 0, 1 }, sizeof(to.rotation));
        to.cx = (img->width - 1) / 2.0;
        to.cy = (img->height - 1) / 2.0;
        map = map_of(&to, &calib);
        check("view", sst_rectify_view(map, filter, back ? &b : &a, NULL, back ? &a : img, 0));
        sst_rectify_map_destroy(map);
        sst_calib_fini(&calib);
    }
    sst_image_fini(&a);
    const double db = psnr(&b, img, sst_max_int(img->width, img->height) / 12);

    sst_image_fini(&b);
    return db;
}

int main(int argc, char **argv)
{
    struct sst_image img;

    if (argc != 2) {
        fprintf(stderr, "usage: rectify PICTURE\n");
        return 2;
    }
    check(argv[1], sst_image_read(&img, argv[1]));
    time_all(640, 480);
    time_all(2000, 1500);
    printf("RMS and largest error in levels, rounding to bytes included\n");
    errors_against_double(&img);
    printf("PSNR in dB: moved by half a pixel both ways; turned by 2 degrees and back\n");
    for (size_t f = 0; f < ARRAY_LEN(filters); f++)
        printf("| %s | %.2f | %.2f |\n", sst_filter_name(filters[f]), moved_half(&img, filters[f]),
               turned_there_and_back(&img, filters[f]));
    sst_image_fini(&img);
    return 0;
}
