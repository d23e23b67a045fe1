/* What the CPU does for a view of raw frames that is rendered on a device: device_frames ROUNDS. CPU time of one thread for a
 * JPEG of 2000x1500 pixels, median of the rounds: with the view rectified on the CPU and uploaded, and with its samples and
 * places handed to the device (docs/design/gpu.md, Raw frames). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/stats.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/jpeg_planes.h"
#include "pipeline/kernels/kernels.h"
#include "tests/raw_field.h"

#define WIDTH  2000
#define HEIGHT 1500
#define ROUNDS 99 /* at most */

struct bench {
    struct raw_field field;
    struct sst_rectify_map *map;
    struct sst_rectify_tables tables;
    struct sst_places *places;
    struct sst_rectify_list list;
    struct sst_jpeg_planes planes;
    uint8_t *jpeg, *samples;
    size_t bytes;
    uint32_t *packed;
    struct sst_image frame, view;
    struct sst_map_u8 valid;
};

static int decode(struct bench *b)
{
    sst_image_fini(&b->frame);
    return sst_image_decode(&b->frame, b->jpeg, b->bytes, "frame");
}

static int rectify(struct bench *b)
{
    return sst_rectify_view(&(struct sst_rectified_view){ &b->view, &b->valid }, b->map, SST_FILTER_BICUBIC, &b->frame);
}

static int pack(struct bench *b)
{
    sst_image_put_rgbx((uint8_t *)b->packed, 4 * (size_t)WIDTH, &b->view);
    return 0;
}

static int make_map(struct bench *b)
{
    sst_rectify_map_destroy(b->map);
    return sst_rectify_map_create(&b->map, b->field.raw.rectified, &b->field.use.calib, 0);
}

static int decode_samples(struct bench *b)
{
    return sst_jpeg_planes_decode(b->samples, &b->planes, b->jpeg, b->bytes, "frame");
}

static int place(struct bench *b)
{
    int err = 0;

    b->list.count = 0;
    for (int y = 0; y < HEIGHT && !err; y++)
        err = sst_rectify_map_cells(b->map, 0, y, b->places + (size_t)y * (size_t)b->tables.cells, &b->list);
    return err;
}

static double cpu_ms(void)
{
    struct timespec t;

    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static int prepare(struct bench *b)
{
    struct sst_sim_settings s;
    int err;

    raw_field_settings(&s, "cd-cases", 1, 2, WIDTH, HEIGHT, 4);
    err = raw_field_make(&b->field, &s);
    err = err ? err : sst_image_encode_jpeg(&b->field.raw.views[0].image, 90, &b->jpeg, &b->bytes);
    err = err ? err : sst_jpeg_planes_read(&b->planes, b->jpeg, b->bytes, "frame");
    err = err ? err : make_map(b);
    err = err ? err : sst_image_init(&b->view, WIDTH, HEIGHT);
    err = err ? err : sst_map_u8_init(&b->valid, WIDTH, HEIGHT);
    if (err)
        return err;
    sst_rectify_map_tables(&b->tables, b->map, SST_FILTER_BICUBIC);
    b->samples = malloc(b->planes.bytes);
    b->places = malloc((size_t)b->tables.cells * HEIGHT * sizeof(*b->places));
    b->packed = malloc(4 * (size_t)WIDTH * HEIGHT);
    return b->samples && b->places && b->packed ? 0 : -1;
}

int main(int argc, char **argv)
{
    static const struct {
        const char *name;
        int (*work)(struct bench *b);
        int ways; /* that need it: 1 the CPU's, 2 the device's */
    } steps[] = { { "map", make_map, 3 },         { "pixels decoded", decode, 1 },         { "view rectified", rectify, 1 },
                  { "view packed", pack, 1 },     { "samples decoded", decode_samples, 2 }, { "places", place, 2 } };
    const int rounds = argc > 1 ? sst_clamp_int(atoi(argv[1]), 1, ROUNDS) : 15;
    double ms[ARRAY_LEN(steps)][ROUNDS], sum[2] = { 0, 0 };
    struct bench b = { 0 };

    if (prepare(&b))
        return 1;
    for (int i = 0; i < rounds; i++) {
        for (size_t k = 0; k < ARRAY_LEN(steps); k++) {
            const double start = cpu_ms();

            if (steps[k].work(&b))
                return 1;
            ms[k][i] = cpu_ms() - start;
        }
    }
    printf("%dx%d, JPEG of %zu bytes; samples %zu, places %zu bytes\n", WIDTH, HEIGHT, b.bytes, b.planes.bytes,
           (size_t)b.tables.cells * HEIGHT * sizeof(*b.places));
    for (size_t k = 0; k < ARRAY_LEN(steps); k++) {
        const double median = sst_stats_median(ms[k], rounds);

        printf("%-16s %6.2f ms\n", steps[k].name, median);
        for (int way = 0; way < 2; way++)
            sum[way] += steps[k].ways >> way & 1 ? median : 0;
    }
    printf("rectified on the CPU %.1f ms, on a device %.1f ms of the CPU\n", sum[0], sum[1]);
    raw_field_free(&b.field);
    sst_rectify_map_destroy(b.map);
    sst_image_fini(&b.frame);
    sst_image_fini(&b.view);
    sst_map_u8_fini(&b.valid);
    free(b.list.xy);
    free(b.jpeg);
    free(b.samples);
    free(b.places);
    free(b.packed);
    return 0;
}
