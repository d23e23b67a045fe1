/* Costs of keeping the views up to date, and their errors:
 *   make build/bench/live_frames && build/bench/live_frames [SETS [WORLD...]]
 * Prints the table of docs/measured/notes-live.md. Worlds are prepared when they are first used (a minute each). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <linux/videodev2.h>

#include "base/clock.h"
#include "base/file.h"
#include "pipeline/live/frames/frames.h"
#include "simulators/scene/world/sim_world.h"

#define FRAME_ROOM ((size_t)1 << 19)
#define STEP_NS    100000000

static void check(const char *what, int err)
{
    if (err) {
        fprintf(stderr, "live_frames: %s: %s\n", what, strerror(-err));
        exit(1);
    }
}

/* The sets of a world: all frames in memory. */
struct sets {
    int rows, cols, width, height, count;
    struct sst_live_input *in;
};

static struct sets make_sets(const char *world, int count)
{
    struct sets s = { .count = count, .in = calloc((size_t)count, sizeof(*s.in)) };
    const struct sst_sim_settings *settings;
    struct sst_sim_world *w;
    uint8_t *frame = malloc(FRAME_ROOM);

    check(world, sst_sim_world_open(&w, world, NULL));
    settings = sst_sim_world_settings(w);
    s.rows = settings->rows;
    s.cols = settings->cols;
    s.width = settings->width;
    s.height = settings->height;
    for (int i = 0; i < count; i++) {
        s.in[i].set = (uint64_t)i;
        s.in[i].t_ns = 1000000000 + (int64_t)i * STEP_NS;
        for (int k = 0; k < s.rows * s.cols; k++) {
            const struct sst_sim_exposure e = { .cam = k,
                                                .trigger = (uint64_t)i,
                                                .t_ns = s.in[i].t_ns,
                                                .exposure_us = settings->exposure_us,
                                                .gain = 1 };
            size_t bytes = 0;
            uint8_t *copy;

            check("frame", sst_sim_world_frame(w, &e, (struct sst_sim_format){ V4L2_PIX_FMT_MJPEG, s.width, s.height },
                                               (struct sst_sim_room){ frame, FRAME_ROOM }, &bytes));
            copy = malloc(bytes);
            memcpy(copy, frame, bytes);
            s.in[i].frame[k].data = copy;
            s.in[i].frame[k].bytes = bytes;
        }
    }
    free(frame);
    sst_sim_world_close(w);
    return s;
}

static void free_sets(struct sets *s)
{
    for (int i = 0; i < s->count; i++)
        for (int k = 0; k < SST_MAX_VIEWS; k++)
            free((void *)(uintptr_t)s->in[i].frame[k].data);
    free(s->in);
}

/* One way to keep up. */
struct keeper {
    struct sst_live_config cfg;
    struct sst_lightfield lf;
    struct sst_liveframes *frames;
    struct sst_liveframes_changes changes;
};

static void open_keeper(struct keeper *k, const struct sets *s, const struct sst_use_calibration *use, bool skip,
                        int threads)
{
    *k = (struct keeper){ .cfg = { .rows = s->rows,
                                   .cols = s->cols,
                                   .fourcc = V4L2_PIX_FMT_MJPEG,
                                   .width = s->width,
                                   .height = s->height,
                                   .calibration = use,
                                   .threads = threads,
                                   .skip_change = skip } };
    check("light field", sst_lightfield_init(&k->lf, s->rows, s->cols));
    k->lf.width = s->width;
    k->lf.height = s->height;
    for (int v = 0; v < s->rows * s->cols; v++)
        k->cfg.present[v] = k->lf.views[v].present = true;
    if (use)
        check("calibration", sst_lightfield_calibrate(&k->lf, use));
    check("open", sst_liveframes_open(&k->frames, &k->cfg, &k->lf));
    check("changes", sst_liveframes_changes_init(&k->changes, &k->lf));
}

static void close_keeper(struct keeper *k)
{
    sst_liveframes_close(k->frames);
    sst_liveframes_changes_fini(&k->changes);
    sst_lightfield_fini(&k->lf);
}

/* Mean |difference| of all views, and of the tile that is worst. */
static void compare(const struct sst_lightfield *a, const struct sst_lightfield *b, double *mean, double *worst)
{
    double sum = 0;
    int64_t tiles = 0;

    *worst = 0;
    for (int k = 0; k < a->rows * a->cols; k++) {
        for (int y0 = 0; y0 < a->height; y0 += SST_LIVE_TILE) {
            for (int x0 = 0; x0 < a->width; x0 += SST_LIVE_TILE, tiles++) {
                const int x1 = sst_min_int(x0 + SST_LIVE_TILE, a->width),
                          y1 = sst_min_int(y0 + SST_LIVE_TILE, a->height);
                int64_t off = 0;

                for (int c = 0; c < 3; c++)
                    for (int y = y0; y < y1; y++)
                        for (int x = x0; x < x1; x++)
                            off += abs(sst_image_row(&a->views[k].image, c, y)[x] -
                                       sst_image_row(&b->views[k].image, c, y)[x]);
                sum += (double)off / (3.0 * (x1 - x0) * (y1 - y0));
                *worst = fmax(*worst, (double)off / (3.0 * (x1 - x0) * (y1 - y0)));
            }
        }
    }
    *mean = sum / (double)tiles;
}

static double ms(int64_t ns)
{
    return (double)ns * 1e-6;
}

static void measure(const char *name, const struct sets *s, const struct sst_use_calibration *use, bool skip)
{
    struct keeper fast, exact;
    struct sst_live_report sum = { 0 };
    double error = 0, worst = 0, sampled = NAN;
    int64_t cpu = 0, wall = 0, cpu_most = 0;

    open_keeper(&fast, s, use, skip, 0);
    open_keeper(&exact, s, use, false, 0);
    for (int i = 0; i < s->count; i++) {
        struct sst_live_report r = { 0 };
        const int64_t cpu_start = sst_clock_cpu_ns(), start = sst_clock_now_ns();
        double mean, most;

        check("update", sst_liveframes_update(fast.frames, &s->in[i], &fast.changes, &r));
        if (!i) /* everything is new */
            continue;
        wall += sst_clock_now_ns() - start;
        cpu += sst_clock_cpu_ns() - cpu_start;
        cpu_most = sst_clock_cpu_ns() - cpu_start > cpu_most ? sst_clock_cpu_ns() - cpu_start : cpu_most;
        for (int stage = 0; stage <= SST_LIVE_RECTIFY; stage++)
            sum.stage_ns[stage] += r.stage_ns[stage];
        sum.decodes += r.decodes;
        sum.tiles += r.tiles;
        sum.tiles_changed += r.tiles_changed;
        sampled = isnan(r.error_change) ? sampled : r.error_change;
        if (!skip)
            continue;
        check("exact", sst_liveframes_update(exact.frames, &s->in[i], &exact.changes, &r));
        compare(&fast.lf, &exact.lf, &mean, &most);
        error += mean;
        worst = fmax(worst, most);
    }
    const double n = s->count - 1;
    printf("| %-14s | %-3s | %-5s | %6.1f | %6.1f | %6.1f | %5.1f %5.1f %5.1f | %5.1f | %5.1f %% | %5.2f | %5.1f | "
           "%5.2f |\n",
           name, use ? "yes" : "no", skip ? "skip" : "exact", ms(wall) / n, ms(cpu) / n, ms(cpu_most),
           ms(sum.stage_ns[SST_LIVE_CHANGE]) / n, ms(sum.stage_ns[SST_LIVE_DECODE]) / n,
           ms(sum.stage_ns[SST_LIVE_RECTIFY]) / n, (double)sum.decodes / n,
           100.0 * (double)sum.tiles_changed / (double)sum.tiles, error / n, worst, sampled);
    fflush(stdout);
    close_keeper(&fast);
    close_keeper(&exact);
}

static void bench(const char *name, const char *world, int count)
{
    struct sets s = make_sets(world, count);
    struct sst_use_calibration use;
    char path[] = "/tmp/sst-live-frames-XXXXXX.yaml";
    const int fd = mkstemps(path, 5);

    if (fd < 0)
        check(path, -errno);
    close(fd);
    check(path, sst_sim_world_parameters(world, path));
    sst_use_calibration_defaults(&use);
    check(path, sst_use_calibration_read(&use, path));
    unlink(path);
    measure(name, &s, NULL, true);
    measure(name, &s, NULL, false);
    measure(name, &s, &use, true);
    measure(name, &s, &use, false);
    sst_use_calibration_fini(&use);
    free_sets(&s);
}

/* A world that stands still before cameras with noise, as real ones see it: without the strip, which changes. */
static void bench_noisy(int count)
{
    static const char text[] =
        "scene: cat\nstrip: false\nloop: {seconds: 2, rate_hz: 5}\nsensor: {gain_spread_percent: "
        "3, balance_spread_percent: 2, full_well_e: 12000, read_noise_e: 6}\n";
    char path[] = "/tmp/sst-live-frames-XXXXXX.yaml";
    const int fd = mkstemps(path, 5);

    if (fd < 0)
        check(path, -errno);
    close(fd);
    check(path, sst_file_write(path, text, sizeof(text) - 1));
    bench("cat, noise, no strip", path, count);
    unlink(path);
}

int main(int argc, char **argv)
{
    const int count = argc > 1 ? atoi(argv[1]) : 21;

    if (count < 2) {
        fprintf(stderr, "usage: live_frames [SETS [WORLD...]], SETS from 2\n");
        return 2;
    }
    printf("| world | calibrated | mode | wall, ms | CPU, ms | CPU, most | change, decode, rectify | decodes | tiles | "
           "error | worst tile | sampled |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for (int i = 2; i < argc; i++)
        bench(argv[i], argv[i], count);
    if (argc > 2)
        return 0;
    bench("cat", "cat", count);
    bench_noisy(count);
    bench("pedestrian", "pedestrian", count);
    bench("pedestrian, real cameras", "simulators/scene/world/worlds/array.yaml", count);
    bench("bush", "bush", count);
    return 0;
}
