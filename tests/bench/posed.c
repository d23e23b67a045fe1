/* Time of the integral of a flight, beside OpenCV's warpPerspective and addition: posed VIEWS SIDE ROUNDS THREADS.
 * Views of 16 bits and one channel are in memory, the same few pictures again and again. Prints CSV, one line for each
 * round: the integral on terrain and on a plane, OpenCV's on the plane, ms; the mean difference of the two on the
 * plane, levels. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "pipeline/posed/integral.h"
#include "simulators/scene/noise.h"
#include "tests/bench/warp.h"

#define PICTURES 8
#define HEIGHT   35000.0 /* mm above the ground */

static void check(int err, const char *what)
{
    if (err) {
        fprintf(stderr, "posed: %s: %s\n", what, strerror(-err));
        exit(1);
    }
}

/* Smooth noise: means of 8x8 random levels. */
static void make_picture(struct sst_deep *out, int side, uint64_t *seed)
{
    check(sst_deep_init(out, side, side, 1, 65535), "picture");
    for (int y = 0; y < side; y++) {
        uint16_t *row = sst_map_u16_row(&out->plane[0], y), *before = y ? sst_map_u16_row(&out->plane[0], y - 1) : row;

        for (int x = 0; x < side; x++) {
            const unsigned fresh = (unsigned)(sst_random_u64(seed) & 65535), left = x ? row[x - 1] : fresh;

            row[x] = (uint16_t)((fresh + 3 * left + 4u * before[x]) / 8);
        }
    }
}

/* A zigzag flight that looks down, tilted by up to 3 degrees. */
static struct sst_calib_camera camera(int k, int side)
{
    struct sst_calib_camera cam = { .known = true, .fx = side, .fy = side, .cx = side / 2.0, .cy = side / 2.0 };
    const double turn[3] = { M_PI + 0.05 * sin(k), 0.05 * cos(1.7 * k), 0 };

    sst_rotation_from_vector(turn, cam.rotation);
    cam.position_mm[0] = 500 * (k % 40 - 20);
    cam.position_mm[1] = 1500 * (k / 40 - 5);
    cam.position_mm[2] = HEIGHT + 200 * sin(0.3 * k);
    return cam;
}

/* Homography from the virtual camera's pixels into a view's, by way of the plane z = 0. */
static void homography(double h[9], const struct sst_virtual *from, const struct sst_calib_camera *cam)
{
    double turn[9], to[9], k[9];

    sst_rotation_between(cam->rotation, from->rotation, turn);
    for (int i = 0; i < 9; i++) { /* P = (turn + move n^T / d) ray, n the plane's normal in the virtual camera */
        double move = 0;

        for (int m = 0; m < 3; m++)
            move += cam->rotation[i / 3 * 3 + m] * (from->centre_mm[m] - cam->position_mm[m]);
        to[i] = turn[i] + move * from->rotation[i % 3 * 3 + 2] / -from->centre_mm[2];
    }
    for (int i = 0; i < 3; i++) {
        k[i] = cam->fx * to[i] + cam->cx * to[6 + i];
        k[3 + i] = cam->fy * to[3 + i] + cam->cy * to[6 + i];
        k[6 + i] = to[6 + i];
    }
    for (int i = 0; i < 3; i++) {
        h[3 * i] = k[3 * i] / from->fx;
        h[3 * i + 1] = k[3 * i + 1] / from->fy;
        h[3 * i + 2] = k[3 * i + 2] - h[3 * i] * from->cx - h[3 * i + 1] * from->cy;
    }
}

int main(int argc, char **argv)
{
    const int views = argc > 1 ? atoi(argv[1]) : 382, side = argc > 2 ? atoi(argv[2]) : 512;
    const int rounds = argc > 3 ? atoi(argv[3]) : 5, threads = argc > 4 ? atoi(argv[4]) : 2;
    const struct sst_surface plane = sst_surface_plane((const double[3]){ 0, 0, 1 }, (const double[3]){ 0, 0, 0 });
    struct sst_calib_camera *cams = calloc((size_t)views, sizeof(*cams));
    const struct sst_calib_camera **cam = calloc((size_t)views, sizeof(*cam));
    const struct sst_deep **picture = calloc((size_t)views, sizeof(*picture));
    int32_t *sum = calloc((size_t)(side * side), sizeof(*sum));
    struct sst_heights heights = { -60000, 60000, 500, -500, { 0 } };
    struct sst_deep pictures[PICTURES];
    struct sst_integral *integral;
    struct sst_surface terrain;
    struct sst_posed posed = { .width = side, .height = side };
    struct sst_virtual from;
    uint64_t seed = 1;

    if (views < 1 || views > SST_POSED_MAX_VIEWS || side < 16 || !cams || !cam || !picture || !sum)
        check(-22, "arguments");
    check(sst_map_f32_init(&heights.mm, 240, 240), "terrain");
    for (int i = 0; i < 240 * 240; i++)
        sst_map_f32_row(&heights.mm, i / 240)[i % 240] = (float)(2000 * sin(i % 240 / 20.0) * cos(i / 240 / 15.0));
    check(sst_surface_terrain(&terrain, &heights, (const double[3]){ 0, 0, 1 }), "terrain");
    for (int i = 0; i < PICTURES; i++)
        make_picture(&pictures[i], side, &seed);
    for (int k = 0; k < views; k++) {
        cams[k] = camera(k, side);
        cam[k] = &cams[k];
        picture[k] = &pictures[k % PICTURES];
    }
    posed.view = &(struct sst_posed_view){ .camera = cams[views / 2] };
    from = sst_virtual_of_view(&posed, 0);
    check(sst_integral_create(&integral, &from, &terrain, 1, threads), "integral");
    printf("views,side,threads,terrain_ms,plane_ms,opencv_ms,difference\n");
    for (int round = 0; round < rounds; round++) {
        double ms[3], off = 0;
        struct sst_map_u16 seen;
        struct sst_map_f32 mean;
        int n = 0;

        for (int i = 0; i < 2; i++) {
            int64_t start_ns;

            sst_integral_restart(integral, i ? &plane : &terrain);
            start_ns = sst_clock_now_ns();
            check(sst_integral_add(integral, cam, picture, views), "views");
            ms[i] = (double)(sst_clock_now_ns() - start_ns) * 1e-6;
        }
        memset(sum, 0, (size_t)(side * side) * sizeof(*sum));
        ms[2] = (double)sst_clock_now_ns() * 1e-6;
        for (int k = 0; k < views; k++) {
            double h[9];

            homography(h, &from, cam[k]);
            bench_warp_add(sum, side, side, &picture[k]->plane[0], h, threads);
        }
        ms[2] = (double)sst_clock_now_ns() * 1e-6 - ms[2];
        check(sst_integral_views(&seen, integral), "views");
        check(sst_integral_means(&mean, integral, 0), "means");
        for (int i = 0; i < side * side; i++) {
            const int count = sst_map_u16_row(&seen, i / side)[i % side];

            if (count > views / 4) {
                off += fabs((double)sst_map_f32_row(&mean, i / side)[i % side] - (double)sum[i] / count);
                n++;
            }
        }
        sst_map_u16_fini(&seen);
        sst_map_f32_fini(&mean);
        printf("%d,%d,%d,%.1f,%.1f,%.1f,%.2f\n", views, side, threads, ms[0], ms[1], ms[2], n ? off / n : NAN);
    }
    sst_integral_destroy(integral);
    for (int i = 0; i < PICTURES; i++)
        sst_deep_fini(&pictures[i]);
    sst_map_f32_fini(&heights.mm);
    free(cams);
    free(cam);
    free(picture);
    free(sum);
    return 0;
}
