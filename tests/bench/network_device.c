/* Time of a network on a device, by every variant of its shaders, beside that on the CPU, and how far the results are
 * apart. Interleaved rounds in one process, medians, one JSON object.
 *
 *   network_device MODEL.onnx WxH ROUNDS DEVICE PRECISION(f32, int8) */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/mem.h"
#include "base/stats.h"
#include "base/thread.h"
#include "pipeline/method/network/device.h"
#include "pipeline/method/network/network.h"

#define MAX_ROUNDS 101
#define FACTOR     127 /* of bytes of features */
#define VARIANTS   3

/* One network, on the CPU or on the device. */
struct runner {
    struct sst_runner_user *device; /* NULL: the CPU */
    bool chosen;                       /* used unless another variant is named */
    struct sst_network *net;
    float *out;
    int8_t *bytes; /* of a matching network, else NULL */
    double ms[MAX_ROUNDS];
};

struct bench {
    struct runner runner[1 + VARIANTS]; /* the CPU first */
    int runners;
    float *in;
    int width, height;
    size_t results;
};

/* @param device  NULL: the CPU */
static int open_runner(struct runner *r, const struct bench *b, const char *model, enum sst_precision precision,
                       const char *device)
{
    int err = device ? sst_network_device_open(&r->device, device, 0) : 0;

    if (!err && device && !r->device)
        err = -1;
    if (!err)
        err = sst_network_open(&r->net, model, precision, sst_thread_count(0));
    if (err)
        return err;
    sst_network_use_runner(r->net, r->device);
    if (sst_network_metadata(r->net, "sst.radius"))
        r->bytes = sst_mem_alloc_raw(b->results, 1);
    else
        r->out = sst_mem_alloc_raw(b->results, sizeof(*r->out));
    return r->bytes || r->out ? 0 : -1;
}

/* The size of the results, and random pixels. */
static int prepare(struct bench *b, const char *model)
{
    struct sst_network *net;
    struct sst_shape out = { 0, 0, 0 };
    int err = sst_network_open(&net, model, SST_PRECISION_AUTO, 1);
    size_t n;

    if (err)
        return err;
    err = sst_network_out_shape(net, b->width, b->height, &out);
    n = (size_t)sst_network_in_channels(net) * (size_t)b->width * (size_t)b->height;
    b->results = (size_t)out.c * (size_t)out.w * (size_t)out.h;
    b->in = sst_mem_alloc_raw(n, sizeof(*b->in));
    for (size_t i = 0; b->in && i < n; i++)
        b->in[i] = (float)(i * 2654435761u % 65536) / 16384 - 2;
    sst_network_close(net);
    return err || b->in ? err : -1;
}

static int time_once(const struct bench *b, struct runner *r, double *ms)
{
    const int64_t start = sst_clock_now_ns();
    const int err = r->bytes ? sst_network_run_s8(r->net, &(struct sst_network_bytes){ b->in, b->width, b->height,
                                                                                       FACTOR, r->bytes, NULL })
                             : sst_network_run(r->net, b->in, b->width, b->height, r->out);

    *ms = (double)(sst_clock_now_ns() - start) * 1e-6;
    return err;
}

static void close_runner(struct runner *r)
{
    sst_network_close(r->net);
    sst_network_device_close(r->device);
    sst_mem_free(r->out);
    sst_mem_free(r->bytes);
    memset(r, 0, sizeof(*r));
}

/* Shader of convolutions on 8 bits; "" of networks on floats. */
static const char *conv8_of(const struct runner *r, struct sst_network_device_report *report)
{
    sst_network_device_get_report(r->device, report);
    return report->conv8;
}

/* One runner for each variant that the device has, run once; the one that is chosen by itself is marked. */
static int open_variants(struct bench *b, const char *model, enum sst_precision precision, const char *device)
{
    static const char *const names[VARIANTS + 1] = { "plain", "dot", "matrix", "" };

    for (int i = 0; i < VARIANTS + 1; i++) {
        struct sst_network_device_report one, other;
        struct runner r = { 0 };
        double unused;
        int err, k;

        setenv("SST_GPU_VARIANT", names[i], 1);
        err = open_runner(&r, b, model, precision, device);
        if (!err)
            err = time_once(b, &r, &unused);
        if (err) {
            close_runner(&r);
            return err;
        }
        for (k = 1; k < b->runners && strcmp(conv8_of(&r, &one), conv8_of(&b->runner[k], &other)); k++)
            ;
        if (k == b->runners && b->runners < VARIANTS + 1) {
            b->runner[b->runners++] = r;
        } else {
            close_runner(&r);
        }
        if (!*names[i])
            b->runner[k].chosen = true;
    }
    return 0;
}

static double median(double *v, int n)
{
    sst_stats_sort_double(v, n);
    return (v[(n - 1) / 2] + v[n / 2]) / 2;
}

static void print_variant(struct bench *b, struct runner *device, int rounds)
{
    const struct runner *cpu = &b->runner[0];
    struct sst_network_device_report r;
    double most = 0, largest = 0;
    size_t differ = 0;

    for (size_t i = 0; i < b->results; i++) {
        const double want = cpu->bytes ? cpu->bytes[i] : (double)cpu->out[i];
        const double got = device->bytes ? device->bytes[i] : (double)device->out[i];

        differ += got != want;
        most = fmax(most, fabs(got - want));
        largest = fmax(largest, fabs(want));
    }
    printf("  {\"conv8\": \"%s\", \"chosen\": %s, \"device_ms\": %.3f", conv8_of(device, &r),
           device->chosen ? "true" : "false", median(device->ms, rounds));
    printf(", \"upload_ms\": %.3f, \"download_ms\": %.3f, \"on_cpu\": %lld, \"memory_bytes\": %lld",
           (double)r.step.upload_ns * 1e-6 / (double)r.runs, (double)r.step.download_ns * 1e-6 / (double)r.runs,
           (long long)r.on_cpu, (long long)r.memory_bytes);
    printf(", \"dispatches\": %.0f, \"differ\": %.3g, \"most\": %.3g, \"largest\": %.3g}",
           (double)r.step.dispatches / (double)r.runs, (double)differ / (double)b->results, most, largest);
}

static void print(struct bench *b, const char *model, const char *precision, int rounds)
{
    printf("{\"model\": \"%s\", \"precision\": \"%s\", \"width\": %d, \"height\": %d, \"rounds\": %d,\n", model,
           precision, b->width, b->height, rounds);
    printf(" \"cpu_ms\": %.3f, \"variants\": [\n", median(b->runner[0].ms, rounds));
    for (int i = 1; i < b->runners; i++) {
        print_variant(b, &b->runner[i], rounds);
        printf(i + 1 < b->runners ? ",\n" : "]}\n");
    }
}

int main(int argc, char **argv)
{
    const int rounds = argc == 6 ? atoi(argv[3]) : 0;
    const enum sst_precision precision = rounds && !strcmp(argv[5], "f32") ? SST_PRECISION_F32 : SST_PRECISION_INT8;
    struct bench b = { .runners = 1 };
    double unused;
    int err;

    if (rounds < 1 || rounds > MAX_ROUNDS || sscanf(argv[2], "%dx%d", &b.width, &b.height) != 2) {
        fprintf(stderr, "usage: network_device MODEL.onnx WxH ROUNDS (1..%d) DEVICE f32|int8\n", MAX_ROUNDS);
        return 2;
    }
    err = prepare(&b, argv[1]);
    if (!err)
        err = open_runner(&b.runner[0], &b, argv[1], precision, NULL);
    if (!err)
        err = time_once(&b, &b.runner[0], &unused);
    if (!err)
        err = open_variants(&b, argv[1], precision, argv[4]);
    for (int i = 0; i < rounds && !err; i++) {
        for (int k = 0; k < b.runners && !err; k++)
            err = time_once(&b, &b.runner[k], &b.runner[k].ms[i]);
    }
    if (!err)
        print(&b, sst_path_base(argv[1]), argv[5], rounds);
    for (int k = 0; k < b.runners; k++)
        close_runner(&b.runner[k]);
    sst_mem_free(b.in);
    return err ? 1 : 0;
}
