/* Time of a network on a device, beside that on the CPU, and how far the results are apart. Interleaved rounds in one
 * process, medians, one JSON object.
 *
 *   network_device MODEL.onnx WxH ROUNDS DEVICE PRECISION(f32, int8) */
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

/* One network, on the CPU or on the device. */
struct runner {
    struct sst_network *net;
    float *out;
    int8_t *bytes; /* of a matching network, else NULL */
    double ms[MAX_ROUNDS];
};

struct bench {
    struct runner cpu, device;
    float *in;
    int width, height;
    size_t results;
};

static int open_runner(struct runner *r, const struct bench *b, const char *model, enum sst_precision precision,
                       struct sst_network_device *d)
{
    int err = sst_network_open(&r->net, model, precision, sst_thread_count(0));

    if (err)
        return err;
    sst_network_use_device(r->net, d);
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
    int channels, width, height, err = sst_network_open(&net, model, SST_PRECISION_AUTO, 1);
    size_t n;

    if (err)
        return err;
    err = sst_network_out_shape(net, b->width, b->height, &channels, &width, &height);
    n = (size_t)sst_network_in_channels(net) * (size_t)b->width * (size_t)b->height;
    b->results = (size_t)channels * (size_t)width * (size_t)height;
    b->in = sst_mem_alloc_raw(n, sizeof(*b->in));
    for (size_t i = 0; b->in && i < n; i++)
        b->in[i] = (float)(i * 2654435761u % 65536) / 16384 - 2;
    sst_network_close(net);
    return err || b->in ? err : -1;
}

static int time_once(const struct bench *b, struct runner *r, double *ms)
{
    const int64_t start = sst_clock_now_ns();
    const int err = r->bytes ? sst_network_run_s8(r->net, b->in, b->width, b->height, FACTOR, r->bytes)
                             : sst_network_run(r->net, b->in, b->width, b->height, r->out);

    *ms = (double)(sst_clock_now_ns() - start) * 1e-6;
    return err;
}

static double median(double *v, int n)
{
    sst_stats_sort_double(v, n);
    return (v[(n - 1) / 2] + v[n / 2]) / 2;
}

static void print(struct bench *b, const char *model, const char *precision, int rounds, struct sst_network_device *d)
{
    struct sst_network_device_report r;
    double most = 0, largest = 0;
    size_t differ = 0;

    for (size_t i = 0; i < b->results; i++) {
        const double want = b->cpu.bytes ? b->cpu.bytes[i] : (double)b->cpu.out[i];
        const double got = b->device.bytes ? b->device.bytes[i] : (double)b->device.out[i];

        differ += got != want;
        most = fmax(most, fabs(got - want));
        largest = fmax(largest, fabs(want));
    }
    sst_network_device_get_report(d, &r);
    printf("{\"model\": \"%s\", \"precision\": \"%s\", \"width\": %d, \"height\": %d, \"rounds\": %d,\n", model,
           precision, b->width, b->height, rounds);
    printf(" \"cpu_ms\": %.3f, \"device_ms\": %.3f, \"upload_ms\": %.3f, \"download_ms\": %.3f,\n",
           median(b->cpu.ms, rounds), median(b->device.ms, rounds), (double)r.upload_ns * 1e-6 / (double)r.runs,
           (double)r.download_ns * 1e-6 / (double)r.runs);
    printf(" \"on_cpu\": %lld, \"memory_bytes\": %lld, \"dispatches\": %.0f, \"differ\": %.3g, \"most\": %.3g, "
           "\"largest\": %.3g}\n",
           (long long)r.on_cpu, (long long)r.memory_bytes, (double)r.dispatches / (double)r.runs,
           (double)differ / (double)b->results, most, largest);
}

int main(int argc, char **argv)
{
    const int rounds = argc == 6 ? atoi(argv[3]) : 0;
    const enum sst_precision precision = rounds && !strcmp(argv[5], "f32") ? SST_PRECISION_F32 : SST_PRECISION_INT8;
    struct sst_network_device *d = NULL;
    struct bench b = { .results = 0 };
    double unused;
    int err;

    if (rounds < 1 || rounds > MAX_ROUNDS || sscanf(argv[2], "%dx%d", &b.width, &b.height) != 2) {
        fprintf(stderr, "usage: network_device MODEL.onnx WxH ROUNDS (1..%d) DEVICE f32|int8\n", MAX_ROUNDS);
        return 2;
    }
    err = sst_network_device_open(&d, argv[4], 0);
    if (!err && !d)
        err = -1;
    if (!err)
        err = prepare(&b, argv[1]);
    if (!err)
        err = open_runner(&b.cpu, &b, argv[1], precision, NULL);
    if (!err)
        err = open_runner(&b.device, &b, argv[1], precision, d);
    for (int i = -1; i < rounds && !err; i++) { /* the first one to warm up */
        err = time_once(&b, &b.cpu, i < 0 ? &unused : &b.cpu.ms[i]);
        if (!err)
            err = time_once(&b, &b.device, i < 0 ? &unused : &b.device.ms[i]);
    }
    if (!err)
        print(&b, sst_path_base(argv[1]), argv[5], rounds, d);
    sst_network_close(b.cpu.net);
    sst_network_close(b.device.net);
    sst_network_device_close(d);
    sst_mem_free(b.in);
    sst_mem_free(b.cpu.out), sst_mem_free(b.cpu.bytes), sst_mem_free(b.device.out), sst_mem_free(b.device.bytes);
    return err ? 1 : 0;
}
