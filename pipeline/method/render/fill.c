/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */

#include "base/thread.h"
#include "pipeline/kernels/pyramid_ref.h"
#include "pipeline/method/render/clear_internal.h"

#define MAX_LEVELS 17 /* of sides up to 2^16 */
#define BAND       16 /* rows of a job */
#define ALONE_PX   20000 /* smaller levels take no longer than starting a thread */

/* One level of the pyramid: colours times weight, then filled colours; weights 0..1. */
struct level {
    int width, height;
    float *plane[4]; /* [height][width] R, G, B, weight */
};

struct pyramid {
    struct sst_image *img;
    const struct sst_map_u8 *weight;
    int count, at;                  /* level worked on */
    struct level level[MAX_LEVELS]; /* half the picture's size and below */
};

size_t clear_fill_bytes(int width, int height)
{
    size_t floats = 0;

    do {
        width = sst_pyramid_half(width);
        height = sst_pyramid_half(height);
        floats += 4 * (size_t)width * (size_t)height;
    } while (width > 1 || height > 1);
    return floats * sizeof(float);
}

static void plan_levels(struct pyramid *p, float *memory)
{
    int width = p->img->width, height = p->img->height;

    do {
        struct level *l = &p->level[p->count++];

        l->width = width = sst_pyramid_half(width);
        l->height = height = sst_pyramid_half(height);
        for (int c = 0; c < 4; c++, memory += (size_t)width * (size_t)height)
            l->plane[c] = memory;
    } while (width > 1 || height > 1);
}

/* Sums of up to four pixels of the picture: columns 2 x, 2 x + 1 of the rows from 2 y. */
static void sum_picture(const struct pyramid *p, int x, int y, float sum[4])
{
    const int right = sst_min_int(2 * x + 2, p->img->width), bottom = sst_min_int(2 * y + 2, p->img->height);

    for (int sy = 2 * y; sy < bottom; sy++) {
        for (int sx = 2 * x; sx < right; sx++) {
            const float w = sst_pyramid_weight(sst_map_u8_row(p->weight, sy)[sx]);

            for (int c = 0; c < 3; c++)
                sum[c] += w * (float)sst_image_row(p->img, c, sy)[sx];
            sum[3] += w;
        }
    }
}

static void sum_level(const struct level *l, int x, int y, float sum[4])
{
    const int right = sst_min_int(2 * x + 2, l->width), bottom = sst_min_int(2 * y + 2, l->height);

    for (int sy = 2 * y; sy < bottom; sy++) {
        for (int sx = 2 * x; sx < right; sx++) {
            for (int c = 0; c < 4; c++)
                sum[c] += l->plane[c][(size_t)sy * (size_t)l->width + (size_t)sx];
        }
    }
}

/* Rows of the level `at` from the finer one; its weights are at most 1. */
static int pull(void *arg, int index, int worker SST_UNUSED)
{
    const struct pyramid *p = arg;
    const struct level *l = &p->level[p->at];

    for (int y = index * BAND; y < sst_min_int((index + 1) * BAND, l->height); y++) {
        for (int x = 0; x < l->width; x++) {
            float sum[4] = { 0 };

            if (p->at)
                sum_level(&p->level[p->at - 1], x, y, sum);
            else
                sum_picture(p, x, y, sum);
            for (int c = 0; c < 4; c++)
                l->plane[c][(size_t)y * (size_t)l->width + (size_t)x] = sst_pyramid_pull(sum[c], sum[3]);
        }
    }
    return 0;
}

/* The level's value at pixel (x, y) of the finer one, bilinear: its pixels lie at 2 x + 1/2. */
static float between(const struct level *l, int c, int x, int y)
{
    const int x0 = x / 2, y0 = y / 2;
    const int x1 = sst_pyramid_beside(x, l->width), y1 = sst_pyramid_beside(y, l->height);
    const float *near = l->plane[c] + (size_t)y0 * (size_t)l->width, *far = l->plane[c] + (size_t)y1 * (size_t)l->width;

    return sst_pyramid_between(near[x0], near[x1], far[x0], far[x1]);
}

/* Rows of the level `at`, filled from the coarser one. */
static int push(void *arg, int index, int worker SST_UNUSED)
{
    const struct pyramid *p = arg;
    const struct level *l = &p->level[p->at];

    for (int y = index * BAND; y < sst_min_int((index + 1) * BAND, l->height); y++) {
        for (int x = 0; x < l->width; x++) {
            const size_t i = (size_t)y * (size_t)l->width + (size_t)x;
            const float lack = 1 - l->plane[3][i];

            for (int c = 0; c < 3 && lack > 0; c++)
                l->plane[c][i] += lack * between(l + 1, c, x, y);
        }
    }
    return 0;
}

/* The coarsest level has one pixel: the mean of the picture. */
static void normalise(const struct level *l)
{
    for (int c = 0; c < 3 && l->plane[3][0] > 0; c++)
        l->plane[c][0] /= l->plane[3][0];
}

static int push_picture(void *arg, int index, int worker SST_UNUSED)
{
    const struct pyramid *p = arg;

    for (int y = index * BAND; y < sst_min_int((index + 1) * BAND, p->img->height); y++) {
        const uint8_t *weight = sst_map_u8_row(p->weight, y);

        for (int x = 0; x < p->img->width; x++) {
            const float w = sst_pyramid_weight(weight[x]);

            for (int c = 0; c < 3 && weight[x] < 255; c++) {
                uint8_t *to = sst_image_row(p->img, c, y) + x;

                *to = sst_pyramid_mix(*to, w, between(&p->level[0], c, x, y));
            }
        }
    }
    return 0;
}

static int bands(int height)
{
    return (height + BAND - 1) / BAND;
}

/* A step of one level. */
static int run_level(struct pyramid *p, sst_work_fn *step, int threads)
{
    const struct level *l = &p->level[p->at];

    return sst_parallel_for(bands(l->height), l->width * l->height < ALONE_PX ? 1 : threads, step, p);
}

int clear_fill(struct sst_image *img, const struct sst_map_u8 *weight, void *levels, int threads)
{
    struct pyramid p = { .img = img, .weight = weight };
    int err = 0;

    plan_levels(&p, levels);
    for (p.at = 0; p.at < p.count && !err; p.at++)
        err = run_level(&p, pull, threads);
    normalise(&p.level[p.count - 1]);
    for (p.at = p.count - 2; p.at >= 0 && !err; p.at--)
        err = run_level(&p, push, threads);
    return err ? err : sst_parallel_for(bands(img->height), threads, push_picture, &p);
}
