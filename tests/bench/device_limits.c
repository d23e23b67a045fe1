/* What a device reaches at most: bytes copied, products of floats, upload and download. The best of some runs each, one
 * JSON object.
 *
 *   device_limits DEVICE */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>

#include "base/clock.h"
#include "base/mem.h"
#include "pipeline/gpu/gpu_internal.h"

#define RUNS        7
#define COPIES      8 /* dispatches of a run */
#define MOST_BYTES  (UINT64_C(256) << 20)
#define LEAST_NS    INT64_C(20000000) /* of a run of products */
#define MOST_ROUNDS 65536U
#define GROUPS      4096U

struct bench {
    struct sst_gpu *gpu;
    struct sst_gpu_buffer *buffer[2];
    size_t bytes;
    float *data;
};

static uint64_t least(uint64_t a, uint64_t b)
{
    return a < b ? a : b;
}

static int open_device(struct bench *b, const char *name)
{
    int err = sst_gpu_open(&b->gpu, name, NULL);

    if (err)
        return err;
    b->bytes = (size_t)least(least(MOST_BYTES, sst_gpu_free_bytes(b->gpu) / 4), sst_gpu_get_info(b->gpu)->buffer_bytes);
    b->bytes -= b->bytes % (4 * sizeof(float));
    b->data = sst_mem_alloc(b->bytes, 1);
    if (!b->data)
        return -ENOMEM;
    for (size_t i = 0; i < b->bytes / sizeof(*b->data); i++)
        b->data[i] = 0.5F;
    for (int i = 0; i < 2 && !err; i++)
        err = sst_gpu_buffer_create(b->gpu, &b->buffer[i], b->bytes);
    return err;
}

static int run(struct bench *b, uint32_t count, uint32_t rounds, int dispatches, int64_t *ns)
{
    const struct gpu_limits push = { count, rounds };
    const struct sst_gpu_work work = { .shader = SST_GPU_LIMITS,
                                       .push = &push,
                                       .push_bytes = sizeof(push),
                                       .buffer = { b->buffer[0], b->buffer[1] },
                                       .groups = { GROUPS, 1, 1 } };
    const int64_t start_ns = sst_clock_now_ns();
    int err = 0;

    for (int i = 0; i < dispatches && !err; i++)
        err = sst_gpu_dispatch(b->gpu, &work);
    err = err ? err : sst_gpu_wait(b->gpu);
    *ns = sst_clock_now_ns() - start_ns;
    return err;
}

/* GB/s, read and written. */
static int copy_rate(struct bench *b, double *best)
{
    int64_t ns = 1;
    int err = 0;

    for (int i = 0; i < RUNS && !err; i++) {
        err = run(b, (uint32_t)(b->bytes / (4 * sizeof(float))), 0, COPIES, &ns);
        *best = fmax(*best, 2.0 * COPIES * (double)b->bytes / (double)ns);
    }
    return err;
}

/* TFLOP/s: a multiplication and an addition are two. */
static int product_rate(struct bench *b, double *best)
{
    const uint32_t count = (uint32_t)least(b->bytes / (4 * sizeof(float)), (uint64_t)GROUPS * GPU_LIMITS_GROUP);
    uint32_t rounds = 64;
    int64_t ns = 0;
    int err = run(b, count, rounds, 1, &ns);

    while (!err && ns < LEAST_NS && rounds < MOST_ROUNDS) {
        rounds *= 2;
        err = run(b, count, rounds, 1, &ns);
    }
    for (int i = 0; i < RUNS && !err; i++) {
        err = run(b, count, rounds, 1, &ns);
        *best = fmax(*best, 2.0 * GPU_LIMITS_PRODUCTS * count * rounds / (double)ns * 1e-3);
    }
    return err;
}

/* GB/s between the host's memory and the device's. */
static int transfer_rate(struct bench *b, double *up, double *down)
{
    int err = 0;

    for (int i = 0; i < RUNS && !err; i++) {
        const int64_t start_ns = sst_clock_now_ns();
        int64_t middle_ns;

        err = sst_gpu_upload(b->gpu, b->buffer[0], 0, b->data, b->bytes);
        err = err ? err : sst_gpu_wait(b->gpu);
        middle_ns = sst_clock_now_ns();
        err = err ? err : sst_gpu_download(b->gpu, b->data, b->buffer[0], 0, b->bytes);
        *up = fmax(*up, (double)b->bytes / (double)(middle_ns - start_ns));
        *down = fmax(*down, (double)b->bytes / (double)(sst_clock_now_ns() - middle_ns));
    }
    return err;
}

int main(int argc, char **argv)
{
    struct bench b = { 0 };
    double copy = 0, products = 0, up = 0, down = 0;
    int err;

    if (argc != 2) {
        fprintf(stderr, "usage: device_limits DEVICE\n");
        return 2;
    }
    err = open_device(&b, argv[1]);
    err = err ? err : transfer_rate(&b, &up, &down);
    err = err ? err : copy_rate(&b, &copy);
    err = err ? err : product_rate(&b, &products);
    if (err)
        fprintf(stderr, "device_limits: %s\n", sst_gpu_error(err));
    else
        printf("{\"copy_gb_s\": %.4g, \"float_tflop_s\": %.4g, \"upload_gb_s\": %.4g, \"download_gb_s\": %.4g, \"bytes\": %zu}\n",
               copy, products, up, down, b.bytes);
    for (int i = 0; i < 2 && b.gpu; i++)
        sst_gpu_buffer_destroy(b.gpu, b.buffer[i]);
    sst_gpu_close(b.gpu);
    sst_mem_free(b.data);
    return err ? 1 : 0;
}
