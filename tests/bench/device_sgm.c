/* Rate of the semi-global optimisation on a device: disparities a second along 4 and 8 paths, of one view with random costs.
 * The best of some runs, one JSON object.
 *
 *   device_sgm DEVICE WIDTHxHEIGHT DISPARITIES */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>

#include "base/clock.h"
#include "base/mem.h"
#include "pipeline/gpu/match.h"

#define RUNS    7
#define WARM_NS INT64_C(200000000) /* of work before, until clocks are up */

struct bench {
    struct sst_gpu *gpu;
    struct sst_gpu_buffer *buffer[SST_GPU_SGM_BUFFERS];
    enum sst_gpu_shader shader; /* the fastest variant */
    int width, height, disparities;
};

static int create(struct bench *b, enum sst_gpu_sgm_buffer i, size_t bytes, bool random)
{
    uint32_t *words = sst_mem_alloc_raw((bytes + 3) / 4, sizeof(*words)), state = 1;
    int err = words ? sst_gpu_buffer_create(b->gpu, &b->buffer[i], bytes) : -ENOMEM;

    for (size_t k = 0; words && k < (bytes + 3) / 4; k++) {
        state = state * 1664525U + 1013904223U;
        words[k] = random ? state & 0x7F7F7F7FU : 10 | 120U << 16;
    }
    err = err ? err : sst_gpu_upload(b->gpu, b->buffer[i], 0, words, bytes);
    sst_mem_free(words);
    return err;
}

static int fill(struct bench *b)
{
    const size_t pixels = (size_t)b->width * (size_t)b->height, cells = pixels * (size_t)b->disparities;
    const struct sst_gpu_tile tile = { .width = b->width,
                                       .height = b->height,
                                       .pitch = b->width,
                                       .rows = b->height,
                                       .steps = b->disparities,
                                       .nd = b->disparities };
    int err = create(b, SST_GPU_SGM_PIXELS, pixels * sizeof(uint32_t), true);

    err = err ? err : create(b, SST_GPU_SGM_TABLE, 256 * sizeof(uint32_t), false);
    err = err ? err : create(b, SST_GPU_SGM_COST, cells, true);
    err = err ? err : create(b, SST_GPU_SGM_SUM, cells * sizeof(uint16_t), true);
    err = err ? err : create(b, SST_GPU_SGM_STATE, sizeof(uint32_t), false);
    err = err ? err : create(b, SST_GPU_SGM_TILES, sizeof(tile), false);
    return err ? err : sst_gpu_upload(b->gpu, b->buffer[SST_GPU_SGM_TILES], 0, &tile, sizeof(tile));
}

static int follow(struct bench *b, int way, int ways)
{
    const struct sst_gpu_sgm push = { .width = b->width,
                                      .bottom = b->height,
                                      .tile_width = b->width,
                                      .tile_height = b->height,
                                      .columns = 1,
                                      .way = way,
                                      .ways = ways,
                                      .first = !way,
                                      .load = -1,
                                      .store = -1,
                                      .all = (uint32_t)b->disparities };
    struct sst_gpu_work work = { .shader = b->shader,
                                 .push = &push,
                                 .push_bytes = sizeof(push),
                                 .groups = { sst_gpu_sgm_groups(&push), (uint32_t)ways, 1 } };

    for (int i = 0; i < SST_GPU_SGM_BUFFERS; i++)
        work.buffer[i] = b->buffer[i];
    return sst_gpu_dispatch(b->gpu, &work);
}

/* Directions from .. to - 1, as matching has them: the first one sets the sums, the others add to them. */
static int run(struct bench *b, int from, int to)
{
    const int first = from ? 0 : 1;
    int err = first ? follow(b, 0, 1) : 0;

    if (!err && from + first < to)
        err = follow(b, from + first, to - from - first);
    return err ? err : sst_gpu_wait(b->gpu);
}

/* Milliseconds of the directions from..to - 1. */
static int measure(struct bench *b, int from, int to, double *best)
{
    const int64_t begin_ns = sst_clock_now_ns();
    int err = 0;

    *best = INFINITY;
    while (!err && sst_clock_now_ns() - begin_ns < WARM_NS)
        err = run(b, from, to);
    for (int i = 0; i < RUNS && !err; i++) {
        const int64_t start_ns = sst_clock_now_ns();

        err = run(b, from, to);
        *best = fmin(*best, 1e-6 * (double)(sst_clock_now_ns() - start_ns));
    }
    return err;
}

int main(int argc, char **argv)
{
    struct bench b = { 0 };
    double along = 0, across = 0, four = 0, eight = 0, cells;
    int err;

    if (argc != 4 || sscanf(argv[2], "%dx%d", &b.width, &b.height) != 2 || sscanf(argv[3], "%d", &b.disparities) != 1 ||
        b.width < 1 || b.height < 1 || b.disparities < 4 || b.disparities % 4 || b.disparities > SST_GPU_MATCH_STEPS) {
        fprintf(stderr, "usage: device_sgm DEVICE WIDTHxHEIGHT DISPARITIES (a multiple of 4)\n");
        return 2;
    }
    cells = (double)b.width * b.height * b.disparities;
    err = sst_gpu_open(&b.gpu, argv[1], NULL);
    err = err ? err : sst_gpu_prepare_fastest(b.gpu, SST_GPU_SGM_PATH, &b.shader);
    b.shader = b.disparities <= SST_GPU_SGM_SUBGROUP_STEPS ? b.shader : SST_GPU_SGM_PATH;
    err = err ? err : fill(&b);
    err = err ? err : measure(&b, 0, 1, &along);
    err = err ? err : measure(&b, 2, 3, &across);
    err = err ? err : measure(&b, 0, 4, &four);
    err = err ? err : measure(&b, 0, 8, &eight);
    if (err)
        fprintf(stderr, "device_sgm: %s\n", sst_gpu_error(err));
    else
        printf("{\"shader\": \"%s\", \"row_ms\": %.4g, \"column_ms\": %.4g, \"paths4_ms\": %.4g, \"paths8_ms\": %.4g, "
               "\"paths4_g_disparities_s\": %.4g, \"paths8_g_disparities_s\": %.4g}\n",
               sst_gpu_shader_name(b.shader), along, across, four, eight, 1e-6 * cells / four, 1e-6 * cells / eight);
    for (int i = 0; i < SST_GPU_SGM_BUFFERS && b.gpu; i++)
        sst_gpu_buffer_destroy(b.gpu, b.buffer[i]);
    sst_gpu_close(b.gpu);
    return err ? 1 : 0;
}
