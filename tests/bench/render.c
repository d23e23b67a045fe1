/* Times see-through and plain pictures against the same sums written with OpenCV, and clear ones against see-through
 * ones, interleaved: render WxH ROUNDS.
 * Prints CSV, one line for each round, method and, of ours, level of the processor (levels.h), with the picture's error
 * against the picture of all views in double; OpenCV uses all that the processor has. The light field is the bush of
 * the simulator with its true maps, 36 views, made in memory. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/method/render/plan.h"
#include "simulators/scene/scene.h"
#include "tests/bench/blend.h"
#include "tests/bench/levels.h"

#define THREADS 2
#define STEP_X  7 /* columns and rows of which one is compared with the exact picture */
#define STEP_Y  5
#define MIB     (1024.0 * 1024.0)

struct bench {
    int rounds;
    struct bench_levels levels;
    struct sst_lightfield lf;
    struct sst_scene *scene;
    struct sst_renderer *renderer;
    struct sst_image out[3]; /* of each method */
    double lf_mib;           /* memory that the light field takes */
};

static const char *const names[2] = { "refocus", "see-through" };

/* The pictures that are compared: of all views, of fewer, by OpenCV. */
static const struct {
    const char *name; /* of "%s": the method */
    int views;        /* 0: all; -1: OpenCV */
    bool skip;        /* views that hardly change the picture */
} makers[] = { { "%s", 0, false },
               { "OpenCV %s", -1, false },
               { "%s, skips", 0, true },
               { "%s, 25 views", 25, false },
               { "%s, 16 views", 16, false },
               { "%s, 9 views", 9, false },
               { "%s, 4 views", 4, false } };

static int make_view(void *arg, int view, int worker SST_UNUSED)
{
    struct bench *b = arg;
    struct sst_view *v = &b->lf.views[view];
    struct sst_map_f32 disp = { 0 };
    int err = sst_image_init(&v->image, b->lf.width, b->lf.height);

    err = err ? err : sst_map_u16_init(&v->disp, b->lf.width, b->lf.height);
    err = err ? err : sst_map_u8_init(&v->label, b->lf.width, b->lf.height);
    err = err ? err : sst_map_f32_init(&disp, b->lf.width, b->lf.height);
    err = err ? err
              : sst_scene_render(b->scene, v->bx, v->by, 0,
                                 &(struct sst_scene_maps){ .image = &v->image, .disp = &disp, .label = &v->label });
    for (int y = 0; !err && y < b->lf.height; y++) {
        for (int x = 0; x < b->lf.width; x++)
            sst_map_u16_row(&v->disp, y)[x] = sst_disp_q6(&b->lf, sst_map_f32_row(&disp, y)[x]);
    }
    sst_map_f32_fini(&disp);
    v->present = true;
    return err;
}

static int make_lightfield(struct bench *b, int width, int height)
{
    struct sst_scene_config cfg;
    struct sst_lightfield *lf = &b->lf;
    int err;

    sst_scene_config_defaults(&cfg);
    cfg.width = width;
    cfg.height = height;
    err = sst_scene_create(&b->scene, "bush", &cfg);
    err = err ? err : sst_lightfield_init(lf, cfg.rows, cfg.cols);
    if (err)
        return err;
    lf->width = width;
    lf->height = height;
    sst_scene_range(b->scene, &lf->range_min_px, &lf->range_max_px);
    lf->disp_min_px = floor(lf->range_min_px);
    lf->classes = sst_classes_default;
    err = sst_parallel_for(lf->rows * lf->cols, THREADS, make_view, b);
    for (int view = 0; !err && view < lf->rows * lf->cols; view++) {
        const struct sst_view *v = &lf->views[view];

        b->lf_mib += (double)(3 * v->image.stride + v->disp.stride + v->label.stride) * height / MIB;
    }
    return err ? err : sst_renderer_create(&b->renderer, lf, THREADS);
}

/* Largest memory of this process since the last reset; NaN where the system does not tell. */
static double peak_mib(void)
{
    FILE *f = fopen("/proc/self/status", "r");
    char line[256];
    double kib = NAN;

    while (f && fgets(line, sizeof(line), f))
        sscanf(line, "VmHWM: %lf", &kib);
    if (f)
        fclose(f);
    return kib / 1024;
}

static void reset_peak(void)
{
    FILE *f = fopen("/proc/self/clear_refs", "w");

    if (!f || fputs("5", f) < 0 || fclose(f))
        sst_log_warning("render bench: the peak of memory cannot be reset here and includes the making of the scene");
}

/* The first picture with each method, which also prepares later ones; its memory is measured. */
static int warm_up(struct bench *b, int method, const struct sst_render_config *cfg, double *mib)
{
    int err;

    reset_peak();
    err = sst_render(b->renderer, cfg, &b->out[method], NULL);
    *mib = peak_mib();
    return err;
}

struct error {
    double rms, most; /* grey levels */
};

/* Error of a picture against that of all views in double, on a lattice of its pixels. */
static int compare(struct bench *b, const struct sst_render_config *cfg, const struct sst_image *img,
                   struct error *error)
{
    struct sst_ray rays[SST_MAX_VIEWS];
    struct sst_render_plan plan;
    double sum2 = 0, n = 0;
    int err = sst_render_plan_init(&plan, b->renderer, cfg);

    *error = (struct error){ 0, 0 };
    for (int y = STEP_Y / 2; !err && y < img->height; y += STEP_Y) {
        for (int x = STEP_X / 2; x < img->width; x += STEP_X) {
            double rgb[3];

            (void)sst_render_pixel_exact(&plan, x, y, rgb, rays);
            for (int c = 0; c < 3; c++) {
                const double e = sst_image_row(img, c, y)[x] - rgb[c];

                sum2 += e * e;
                n++;
                error->most = fmax(error->most, fabs(e));
            }
        }
    }
    error->rms = sqrt(sum2 / n);
    if (!err)
        sst_render_plan_fini(&plan);
    return err;
}

/* One picture. */
static int make(struct bench *b, int method, int maker, const struct sst_render_config *all, struct bench_blend *blend)
{
    struct sst_render_config cfg = *all;

    cfg.max_views = makers[maker].views;
    cfg.skip_rays = makers[maker].skip;
    if (makers[maker].views >= 0)
        return sst_render(b->renderer, &cfg, &b->out[method], NULL);
    bench_blend_render(blend);
    return 0;
}

/* A kind of pictures of one method: by which maker, at which level. */
struct kind {
    int method, maker;
    enum sst_cpu_level level;
    double mib; /* peak of the method's first picture */
    struct error error;
};

/* All of one method. @return their number */
static int list_kinds(const struct bench *b, int method, struct kind kinds[2 * ARRAY_LEN(makers)])
{
    int n = 0;

    for (int i = 0; i < (int)ARRAY_LEN(makers); i++) {
        for (int l = 0; l < (makers[i].views < 0 ? 1 : b->levels.count); l++)
            kinds[n++] = (struct kind){ .method = method, .maker = i, .level = b->levels.level[l] };
    }
    return n;
}

static int measure_kind(struct bench *b, const struct kind *k, const struct sst_render_config *cfg,
                        struct bench_blend *blend, int round)
{
    int64_t start_ns, start_cpu_ns;
    char name[64];
    int err;

    bench_level_use(k->level);
    start_ns = sst_clock_now_ns();
    start_cpu_ns = sst_clock_cpu_ns();
    err = make(b, k->method, k->maker, cfg, blend);
    snprintf(name, sizeof(name), makers[k->maker].name, names[k->method]);
    printf("%s,%d,%d,\"%s\",%d,%.3f,%.3f,%.0f,%.0f,%.3f,%.3f\n", sst_cpu_level_name(k->level), b->lf.width,
           b->lf.height, name, round, (double)(sst_clock_now_ns() - start_ns) * 1e-6,
           (double)(sst_clock_cpu_ns() - start_cpu_ns) * 1e-6, b->lf_mib, k->mib, k->error.rms, k->error.most);
    return err;
}

/* Interleaved rounds of one method: ours, OpenCV's, ours from fewer views. */
static int measure(struct bench *b, int method, const struct sst_render_config *cfg, double mib)
{
    struct bench_blend *blend = bench_blend_create(&b->lf, b->renderer, cfg);
    struct kind kinds[2 * ARRAY_LEN(makers)];
    const int n = list_kinds(b, method, kinds);
    int err = blend ? 0 : -ENOMEM;

    for (int i = 0; !err && i < n; i++) { /* warms up as well */
        kinds[i].mib = mib;
        bench_level_use(kinds[i].level);
        err = make(b, method, kinds[i].maker, cfg, blend);
        if (!err && makers[kinds[i].maker].views < 0)
            bench_blend_copy(blend, &b->out[method]);
        err = err ? err : compare(b, cfg, &b->out[method], &kinds[i].error);
    }
    for (int round = 1; !err && round <= b->rounds; round++) {
        for (int i = 0; !err && i < n; i++)
            err = measure_kind(b, &kinds[i], cfg, blend, round);
    }
    bench_level_use(b->levels.level[0]);
    bench_blend_destroy(blend);
    return err;
}

/* Clear and see-through pictures in turn: without a peer, both are ours. */
static int measure_clear(struct bench *b, const struct sst_render_config *see_through)
{
    struct sst_render_config clear = *see_through;
    double mib;
    int err = sst_render_find_cut(b->renderer, &clear.cut_px);

    clear.method = SST_RENDER_CLEAR;
    err = err ? err : sst_image_init(&b->out[2], b->lf.width, b->lf.height);
    err = err ? err : warm_up(b, 2, &clear, &mib);
    for (int i = 0; !err && i < 2 * b->levels.count * b->rounds; i++) {
        const enum sst_cpu_level level = b->levels.level[i / 2 % b->levels.count];
        int64_t start_ns, start_cpu_ns;

        bench_level_use(level);
        start_ns = sst_clock_now_ns();
        start_cpu_ns = sst_clock_cpu_ns();
        err = sst_render(b->renderer, i % 2 ? see_through : &clear, &b->out[i % 2 ? 1 : 2], NULL);
        printf("%s,%d,%d,%s,%d,%.3f,%.3f,%.0f,%.0f,,\n", sst_cpu_level_name(level), b->lf.width, b->lf.height,
               i % 2 ? "see-through beside clear" : "clear", i / (2 * b->levels.count) + 1,
               (double)(sst_clock_now_ns() - start_ns) * 1e-6, (double)(sst_clock_cpu_ns() - start_cpu_ns) * 1e-6,
               b->lf_mib, mib);
    }
    return err;
}

static int run(struct bench *b, int width, int height)
{
    struct sst_render_config cfg[2];
    double mib[2];
    int err = make_lightfield(b, width, height);

    for (int m = 0; !err && m < 2; m++) {
        sst_render_config_defaults(&cfg[m]);
        cfg[m].method = m ? SST_RENDER_SST : SST_RENDER_REFOCUS;
        cfg[m].focus_px = sst_scene_occluder_at(b->scene, 0)->focus_px;
        cfg[m].threads = THREADS;
        cfg[m].verify = SST_VERIFY_OFF;
        err = sst_image_init(&b->out[m], width, height);
        err = err ? err : warm_up(b, m, &cfg[m], &mib[m]);
    }
    for (int m = 0; !err && m < 2; m++)
        err = measure(b, m, &cfg[m], mib[m]);
    return err ? err : measure_clear(b, &cfg[1]);
}

int main(int argc, char **argv)
{
    struct bench b = { .levels = bench_levels() };
    int width, height, err;

    b.rounds = argc == 3 ? atoi(argv[2]) : 0;
    if (b.rounds < 1 || sscanf(argv[1], "%dx%d", &width, &height) != 2) {
        fprintf(stderr, "usage: render WxH ROUNDS: size of a view; rounds >= 1\n");
        return 2;
    }
    printf("level,width,height,method,round,ms,cpu_ms,light_field_mib,peak_mib,error_rms,error_most\n");
    err = run(&b, width, height);
    if (err)
        sst_log_error("render bench: %s", strerror(-err));
    for (int m = 0; m < 3; m++)
        sst_image_fini(&b.out[m]);
    sst_renderer_destroy(b.renderer);
    sst_scene_destroy(b.scene);
    sst_lightfield_fini(&b.lf);
    return err ? 1 : 0;
}
