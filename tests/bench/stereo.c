/* Times matching of the Middlebury pairs by this project's presets and by OpenCV, interleaved: stereo DATA TRUTH
 * ROUNDS [METHOD], of one method to profile it. Prints CSV, one line for each pair, round, method and, of ours, level
 * of the processor (levels.h); OpenCV uses all that the processor has. stereo LF ROUNDS times OpenCV alone on all views
 * of a light field with its truth, each with its neighbour in the row; line by round and method, for all views
 * together. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "pipeline/eval/eval.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/lightfield.h"
#include "pipeline/method/disparity/disparity.h"
#include "pipeline/method/network/model_path.h"
#include "tests/bench/levels.h"
#include "tests/bench/sgbm.h"

#define THREADS 2

static const struct {
    const char *name, *left, *right, *truth;
    int disparities; /* from 0 on: where the truth lies */
} pairs[] = {
    { "cones", "cones/im2.png", "cones/im6.png", "cones.pfm", 64 },
    { "teddy", "teddy/im2.png", "teddy/im6.png", "teddy.pfm", 64 },
    { "motorcycle", "motorcycle/motorcycle_left.png", "motorcycle/motorcycle_right.png", "motorcycle.pfm", 64 },
    { "aloe", "aloe/aloeL.jpg", "aloe/aloeR.jpg", "aloe.pfm", 240 },
};

static const struct {
    const char *name, *preset; /* no preset: OpenCV in this mode */
    enum bench_sgbm mode;
} methods[] = {
    { .name = "OpenCV SGBM 3WAY", .mode = BENCH_SGBM_3WAY },
    { .name = "OpenCV SGBM HH", .mode = BENCH_SGBM_HH },
    { .name = "OpenCV BM", .mode = BENCH_BM },
    { .name = "sst preview", .preset = "preview" },
    { .name = "sst balanced", .preset = "balanced" },
    { .name = "sst accurate", .preset = "accurate" },
};

struct pair {
    struct sst_image left, right;
    struct sst_map_f32 truth;
};

static void pair_fini(struct pair *p)
{
    sst_image_fini(&p->left);
    sst_image_fini(&p->right);
    sst_map_f32_fini(&p->truth);
}

static int load(struct pair *p, size_t index, const char *data, const char *truth)
{
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, data, pairs[index].left);

    err = err ? err : sst_image_read(&p->left, path);
    err = err ? err : sst_path_join(path, data, pairs[index].right);
    err = err ? err : sst_image_read(&p->right, path);
    err = err ? err : sst_path_join(path, truth, pairs[index].truth);
    return err ? err : sst_map_f32_read_pfm(&p->truth, path);
}

static int match(struct sst_map_f32 *disp, const struct pair *p, int disparities, size_t method)
{
    struct sst_disparity_config cfg;
    char model[SST_PATH_MAX];
    int err;

    if (!methods[method].preset) {
        err = sst_map_f32_init(disp, p->left.width, p->left.height);
        return err ? err : bench_sgbm(disp, &p->left, &p->right, disparities, methods[method].mode, THREADS);
    }
    err = sst_disparity_preset(&cfg, methods[method].preset);
    if (!err && cfg.cost & SST_COST_MCCNN)
        err = sst_model_path(model, "mccnn-fast.onnx");
    cfg.model = model;
    cfg.disp_min_px = 0;
    cfg.disp_max_px = disparities - 1;
    cfg.threads = THREADS;
    return err ? err : sst_disparity_stereo(disp, &p->left, &p->right, &cfg);
}

struct line {
    enum sst_cpu_level level;
    const char *pair, *method;
    int round;
    int64_t ns, cpu_ns;
};

static void print_line(const struct line *l, const struct sst_disparity_error *e, const struct sst_image *picture)
{
    printf("%s,%s,%s,%d,%.3f,%.3f,%.4f,%.4f,%.4f,%.4f,%.4f,%d,%d\n", sst_cpu_level_name(l->level), l->pair, l->method,
           l->round, (double)l->ns * 1e-6, (double)l->cpu_ns * 1e-6, e->bad_half, e->bad1, e->bad2, e->bad4, e->rmse,
           picture->width, picture->height);
}

/* One round of one method at one level; round 0 only warms up. */
static int measure(const struct pair *p, size_t index, size_t method, enum sst_cpu_level level, int round)
{
    const int64_t start_ns = sst_clock_now_ns(), start_cpu_ns = sst_clock_cpu_ns();
    struct sst_map_f32 disp = { 0 };
    struct sst_disparity_error e;
    int err = match(&disp, p, pairs[index].disparities, method);
    const int64_t ns = sst_clock_now_ns() - start_ns, cpu_ns = sst_clock_cpu_ns() - start_cpu_ns;

    err = err ? err : sst_eval_disparity(&e, &disp, &p->truth, NULL);
    if (!err && round)
        print_line(&(struct line){ level, pairs[index].name, methods[method].name, round, ns, cpu_ns }, &e, &p->left);
    sst_map_f32_fini(&disp);
    return err;
}

/* One round of one method at every level that changes it. */
static int measure_levels(const struct pair *p, size_t index, size_t method, int round)
{
    const struct bench_levels levels = bench_levels();
    int err = 0;

    for (int i = 0; !err && i < (methods[method].preset ? levels.count : 1); i++) {
        bench_level_use(levels.level[i]);
        err = measure(p, index, method, levels.level[i], round);
    }
    return err;
}

static int measure_pair(size_t index, const char *data, const char *truth, int rounds, const char *only)
{
    struct pair p = { 0 };
    int err = load(&p, index, data, truth);

    for (int round = 0; !err && round <= rounds; round++) {
        for (size_t method = 0; !err && method < ARRAY_LEN(methods); method++) {
            if (!only || !strcmp(only, methods[method].name))
                err = measure_levels(&p, index, method, round);
        }
    }
    pair_fini(&p);
    return err;
}

/* --- all views of a light field ----------------------------------------------------------------------------------- */

/* In mirrored pictures the view to the left is the right one of a pair. */
static int copy_image(struct sst_image *to, const struct sst_image *from, bool mirrored)
{
    const int err = sst_image_init(to, from->width, from->height);

    for (int i = 0; !err && i < 3 * from->height; i++) {
        const uint8_t *in = sst_image_row(from, i % 3, i / 3);
        uint8_t *out = sst_image_row(to, i % 3, i / 3);

        for (int x = 0; x < from->width; x++)
            out[x] = in[mirrored ? from->width - 1 - x : x];
    }
    return err;
}

static void mirror_map(struct sst_map_f32 *map)
{
    for (int y = 0; y < map->height; y++) {
        float *row = sst_map_f32_row(map, y);

        for (int x = 0; x < map->width / 2; x++) {
            const float left = row[x];

            row[x] = row[map->width - 1 - x];
            row[map->width - 1 - x] = left;
        }
    }
}

/* A view and the one to the right of it; of the last column, mirrored, the one to the left. */
static int make_pair(struct pair *p, const struct sst_lightfield *lf, int view, const char *dir)
{
    const bool mirrored = view % lf->cols + 1 == lf->cols;
    char path[SST_PATH_MAX], name[16], file[32];
    int err = copy_image(&p->left, &lf->views[view].image, mirrored);

    err = err ? err : copy_image(&p->right, &lf->views[view + (mirrored ? -1 : 1)].image, mirrored);
    sst_view_name(lf, view, name);
    snprintf(file, sizeof(file), "truth/%s.pfm", name);
    err = err ? err : sst_path_join(path, dir, file);
    err = err ? err : sst_map_f32_read_pfm(&p->truth, path);
    if (!err && mirrored)
        mirror_map(&p->truth);
    return err;
}

/* All views by one method of OpenCV; round 0, which warms up, is of one view. */
static int measure_all(const struct pair *all, int count, int disparities, size_t method, int round)
{
    struct sst_disparity_error sum = { 0 }, e;
    int64_t ns = 0, cpu_ns = 0;
    int err = 0;

    for (int view = 0; !err && view < (round ? count : 1); view++) {
        const int64_t start_ns = sst_clock_now_ns(), start_cpu_ns = sst_clock_cpu_ns();
        struct sst_map_f32 disp = { 0 };

        err = match(&disp, &all[view], disparities, method);
        ns += sst_clock_now_ns() - start_ns;
        cpu_ns += sst_clock_cpu_ns() - start_cpu_ns;
        err = err ? err : sst_eval_disparity(&e, &disp, &all[view].truth, NULL);
        if (!err)
            sst_eval_disparity_merge(&sum, &e);
        sst_map_f32_fini(&disp);
    }
    if (!err && round)
        print_line(&(struct line){ sst_cpu_level(), "views", methods[method].name, round, ns, cpu_ns }, &sum,
                   &all->left);
    return err;
}

static int measure_views(const char *dir, int rounds)
{
    struct pair all[SST_MAX_VIEWS] = { 0 };
    struct sst_lightfield lf = { 0 };
    int err = sst_lightfield_load(&lf, dir, SST_LOAD_IMAGES, THREADS), count = err ? 0 : lf.rows * lf.cols;

    if (!err && lf.cols < 2)
        err = -EINVAL;
    for (int view = 0; !err && view < count; view++)
        err = make_pair(&all[view], &lf, view, dir);
    for (int round = 0; !err && round <= rounds; round++) {
        for (size_t method = 0; !err && methods[method].mode != BENCH_BM; method++)
            err = measure_all(all, count, (int)ceil(lf.range_max_px) + 1, method, round);
    }
    for (int view = 0; view < count; view++)
        pair_fini(&all[view]);
    sst_lightfield_fini(&lf);
    return err;
}

/* --- main --------------------------------------------------------------------------------------------------------- */

int main(int argc, char **argv)
{
    const int rounds = argc >= 3 && argc <= 5 ? atoi(argv[argc == 3 ? 2 : 3]) : 0;
    int err = 0;

    if (rounds < 1) {
        fprintf(stderr,
                "usage: stereo DATA TRUTH ROUNDS [METHOD]: folders of the pairs, of their truth (PFM); rounds >= 1\n"
                "       stereo LF ROUNDS: light field with its truth\n");
        return 2;
    }
    printf("level,pair,method,round,ms,cpu_ms,bad05,bad1,bad2,bad4,rmse,width,height\n");
    if (argc == 3)
        err = measure_views(argv[1], rounds);
    for (size_t i = 0; argc > 3 && !err && i < ARRAY_LEN(pairs); i++)
        err = measure_pair(i, argv[1], argv[2], rounds, argc == 5 ? argv[4] : NULL);
    if (err)
        sst_log_error("stereo bench: %s", strerror(-err));
    return err ? 1 : 0;
}
