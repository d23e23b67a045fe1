/* Costs of the live scene and errors of its pictures, set by set, on a simulated world that moves:
 *   make build/bench/live_scene && build/bench/live_scene SCENE [SETS [EVERY [THREADS [CACHE [FOLDER [quick]]]]]]
 * Prints CSV: each set's time, and of every EVERY-th set the see-through error in the pixels that the scene's first
 * occluder hides (dB of PSNR against the truth behind it): of the live maps, of `sst process --preset preview`,
 * balanced and accurate on the same pictures, of plain refocusing, and of the true maps. With FOLDER, if it is not
 * empty, the pictures stay there; quick: without the presets. Edges: PSNR of the differences of neighbouring pixels
 * there. SSIM: there, too. CPU ms: of the maps (without opening networks) and the picture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <linux/videodev2.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/eval/eval.h"
#include "pipeline/image/codec.h"
#include "pipeline/live/scene/scene.h"
#include "pipeline/live/scene/scene_internal.h"
#include "pipeline/method/disparity/disparity.h"
#include "pipeline/method/refine/refine.h"
#include "simulators/scene/scene.h"
#include "simulators/scene/world/sim_world.h"

#define WIDTH    640
#define HEIGHT   480
#define SIDE     6
#define VIEWS    (SIDE * SIDE)
#define RATE_HZ  10
#define MODEL    "models/pspnet-small.onnx"
#define CAPACITY ((size_t)1 << 20)
/* A block of 8x8 pixels with a mean that moved by this much changed; noise moves it by half a level. */
#define BLOCK         8
#define NEAR_FOCUS_PX 1.5
#define SURE          0.95 /* as live.c has it */
#define CHANGE_SUM    (3 * BLOCK * BLOCK)

enum method { LIVE, MAPS, PREVIEW, BALANCED, ACCURATE, REFOCUS, TRUE_MAPS, METHODS };

static const char *const names[METHODS] = { "live",     "its maps alone", "preview",  "balanced",
                                            "accurate", "refocus",        "true maps" };

struct bench {
    const char *scene_name, *folder;
    bool presets;
    double confirmed;
    int threads;
    struct sst_sim_world *world;
    struct sst_lightfield lf, exact; /* exact borrows the images */
    struct sst_live_config cfg;
    struct sst_livescene *scene;
    struct sst_liveframes_changes changes;
    struct sst_image next[VIEWS];
    uint8_t frame[VIEWS][CAPACITY];
    size_t bytes[VIEWS];
    struct sst_segmenter *segmenters[VIEWS];
};

static struct bench b;

static int decode_job(void *arg, int view, int worker SST_UNUSED)
{
    (void)arg;
    sst_image_fini(&b.next[view]);
    return sst_image_decode(&b.next[view], b.frame[view], b.bytes[view], "frame");
}

static int fetch(int set)
{
    for (int view = 0; view < VIEWS; view++) {
        const struct sst_sim_exposure e = { .cam = view,
                                            .trigger = (uint64_t)set,
                                            .exposure_us = 5000,
                                            .gain = 1,
                                            .t_ns = INT64_C(1000000000) / RATE_HZ * set + 1000000 };
        const int err = sst_sim_world_frame(b.world, &e, (struct sst_sim_format){ V4L2_PIX_FMT_MJPEG, WIDTH, HEIGHT },
                                            (struct sst_sim_room){ b.frame[view], CAPACITY }, &b.bytes[view]);

        if (err)
            return err;
    }
    return sst_parallel_for(VIEWS, b.threads, decode_job, NULL);
}

static bool block_changed(const struct sst_image *a, const struct sst_image *c, int x, int y)
{
    for (int k = 0; k < 3; k++) {
        int sum = 0;

        for (int j = 0; j < BLOCK; j++) {
            for (int i = 0; i < BLOCK; i++)
                sum += sst_image_row(a, k, y + j)[x + i] - sst_image_row(c, k, y + j)[x + i];
        }
        if (abs(sum) > CHANGE_SUM)
            return true;
    }
    return false;
}

static bool tile_changed(const struct sst_image *a, const struct sst_image *c, int x0, int y0)
{
    for (int y = y0; y < y0 + SST_LIVE_TILE; y += BLOCK) {
        for (int x = x0; x < x0 + SST_LIVE_TILE; x += BLOCK) {
            if (block_changed(a, c, x, y))
                return true;
        }
    }
    return false;
}

/* Take the tiles over that changed, as frames.h does. */
static void take_changes(bool first)
{
    b.changes.changed = 0;
    b.changes.whole = first;
    for (int view = 0; view < VIEWS; view++) {
        struct sst_image *to = &b.lf.views[view].image;

        for (int t = 0; t < b.changes.cols * b.changes.rows; t++) {
            const int x0 = t % b.changes.cols * SST_LIVE_TILE, y0 = t / b.changes.cols * SST_LIVE_TILE;
            const bool changed = first || tile_changed(to, &b.next[view], x0, y0);

            b.changes.map[view][t] = changed;
            b.changes.changed += changed;
            for (int y = y0; changed && y < y0 + SST_LIVE_TILE; y++) {
                for (int c = 0; c < 3; c++)
                    memcpy(sst_image_row(to, c, y) + x0, sst_image_row(&b.next[view], c, y) + x0, SST_LIVE_TILE);
            }
        }
    }
}

static int make_lightfields(void)
{
    struct sst_scene_config cfg;
    struct sst_scene *scene;
    double min_px, max_px;
    int err;

    sst_scene_config_defaults(&cfg);
    cfg.width = WIDTH;
    cfg.height = HEIGHT;
    err = sst_scene_create(&scene, b.scene_name, &cfg);
    if (err)
        return err;
    sst_scene_range(scene, &min_px, &max_px);
    b.cfg.range_min_px = floor(min_px);
    b.cfg.range_max_px = ceil(max_px);
    sst_scene_destroy(scene);
    err = sst_lightfield_init(&b.lf, SIDE, SIDE);
    err = err ? err : sst_lightfield_init(&b.exact, SIDE, SIDE);
    b.lf.width = b.exact.width = WIDTH;
    b.lf.height = b.exact.height = HEIGHT;
    for (int view = 0; !err && view < VIEWS; view++) {
        b.lf.views[view].present = b.exact.views[view].present = true;
        err = sst_image_init(&b.lf.views[view].image, WIDTH, HEIGHT);
        b.exact.views[view].image = b.lf.views[view].image;
        /* Maps of the presets. */
        err = err || b.presets ? err : sst_map_u16_init(&b.exact.views[view].disp, WIDTH, HEIGHT);
        err = err || b.presets ? err : sst_map_u8_init(&b.exact.views[view].label, WIDTH, HEIGHT);
        b.changes.map[view] = calloc(1, WIDTH / SST_LIVE_TILE * (HEIGHT / SST_LIVE_TILE));
    }
    b.changes.cols = WIDTH / SST_LIVE_TILE;
    b.changes.rows = HEIGHT / SST_LIVE_TILE;
    return err;
}

static int open_world(const char *cache)
{
    char path[SST_PATH_MAX], text[256];
    int err;

    snprintf(path, sizeof(path), "%s/live-%s.yaml", cache, b.scene_name);
    snprintf(text, sizeof(text), "scene: %s\nstrip: false\n", b.scene_name);
    err = sst_file_write(path, text, strlen(text));
    return err ? err : sst_sim_world_open(&b.world, path, cache);
}

static int segment_job(void *arg, int view, int worker)
{
    (void)arg;
    sst_map_u8_fini(&b.exact.views[view].label);
    return sst_segment_hcsm(b.segmenters[worker], &b.exact.views[view].image, &b.exact.views[view].label);
}

/* Maps of sst process. */
static int process(const char *preset, int64_t *cpu_ns)
{
    struct sst_disparity_config match;
    struct sst_refine_config refine;
    int err = sst_disparity_preset(&match, preset);

    match.disp_min_px = b.cfg.range_min_px;
    match.disp_max_px = b.cfg.range_max_px;
    match.threads = b.threads;
    for (int i = 0; !err && i < b.threads && !b.segmenters[i]; i++)
        err = sst_segmenter_open(&b.segmenters[i], MODEL, SST_PRECISION_AUTO, 1);
    *cpu_ns = sst_clock_cpu_ns();
    err = err ? err : sst_disparity_lightfield(&b.exact, &match, NULL, NULL);
    b.exact.classes = b.lf.classes;
    err = err ? err : sst_parallel_for(VIEWS, b.threads, segment_job, NULL);
    sst_refine_config_defaults(&refine);
    refine.threads = b.threads;
    err = err ? err : sst_refine_labels(&b.exact, &refine, NULL);
    *cpu_ns = sst_clock_cpu_ns() - *cpu_ns;
    return err;
}

static int truth_job(void *arg, int view, int worker SST_UNUSED)
{
    struct sst_view *v = &b.exact.views[view];
    struct sst_map_f32 disp = { 0 };
    int err = sst_map_f32_init(&disp, WIDTH, HEIGHT);

    err = err ? err
              : sst_scene_render(arg, v->bx, v->by, 0, &(struct sst_scene_maps){ .disp = &disp, .label = &v->label });
    for (int y = 0; !err && y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++)
            sst_map_u16_row(&v->disp, y)[x] = sst_disp_q6(&b.exact, sst_map_f32_row(&disp, y)[x]);
    }
    sst_map_f32_fini(&disp);
    return err;
}

/* Share of pixels, in percent, of three views whose disparity is off by more than 1 px, or whose label is wrong. */
static void count_errors(double out[2], struct sst_scene *scene)
{
    static const int views[] = { 0, 2 * SIDE + 2, VIEWS - 1 };
    struct sst_map_f32 disp = { 0 };
    struct sst_map_u8 label = { 0 };
    int64_t bad = 0, wrong = 0, all = 0;
    int err = sst_map_f32_init(&disp, WIDTH, HEIGHT);

    err = err ? err : sst_map_u8_init(&label, WIDTH, HEIGHT);
    for (size_t i = 0; !err && i < ARRAY_LEN(views); i++) {
        const struct sst_view *v = &b.lf.views[views[i]];

        err = sst_scene_render(scene, v->bx, v->by, 0, &(struct sst_scene_maps){ .disp = &disp, .label = &label });
        for (int y = 0; !err && y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++, all++) {
                const double d = sst_disp_px(&b.lf, sst_map_u16_row(&v->disp, y)[x]);

                bad += !(fabs(d - sst_map_f32_row(&disp, y)[x]) <= 1);
                wrong += sst_map_u8_row(&v->label, y)[x] != sst_map_u8_row(&label, y)[x];
            }
        }
    }
    out[0] = err ? NAN : 100.0 * (double)bad / (double)all;
    out[1] = err ? NAN : 100.0 * (double)wrong / (double)all;
    sst_map_f32_fini(&disp);
    sst_map_u8_fini(&label);
}

struct truth {
    struct sst_scene *scene;
    struct sst_image behind;
    struct sst_map_u8 mask; /* hidden part of the surface in focus */
    double focus_px;
};

static int make_truth(struct truth *t, int set)
{
    struct sst_map_f32 with = { 0 }, without = { 0 };
    struct sst_scene_config cfg;
    int err;

    sst_scene_config_defaults(&cfg);
    cfg.width = WIDTH;
    cfg.height = HEIGHT;
    cfg.time_s = (double)set / RATE_HZ;
    err = sst_scene_create(&t->scene, b.scene_name, &cfg);
    if (!err)
        t->focus_px = sst_scene_occluder_at(t->scene, 0)->focus_px;
    err = err ? err : sst_image_init(&t->behind, WIDTH, HEIGHT);
    err = err ? err : sst_map_u8_init(&t->mask, WIDTH, HEIGHT);
    err = err ? err : sst_map_f32_init(&with, WIDTH, HEIGHT);
    err = err ? err : sst_map_f32_init(&without, WIDTH, HEIGHT);
    err = err ? err : sst_scene_render(t->scene, 0, 0, 0, &(struct sst_scene_maps){ .disp = &with });
    err = err ? err
              : sst_scene_render(t->scene, 0, 0, 1, &(struct sst_scene_maps){ .image = &t->behind, .disp = &without });
    for (int y = 0; !err && y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++)
            sst_map_u8_row(&t->mask, y)[x] =
                fabs(sst_map_f32_row(&with, y)[x] - sst_map_f32_row(&without, y)[x]) > 0.5 &&
                        fabs(sst_map_f32_row(&without, y)[x] - t->focus_px) <= NEAR_FOCUS_PX
                    ? 255
                    : 0;
    }
    sst_map_f32_fini(&with);
    sst_map_f32_fini(&without);
    return err;
}

/* PSNR of the differences to the pixels on the right and below: of structure, which a blurred mean has not. */
static double edge_psnr(const struct sst_image *a, const struct sst_image *behind, const struct sst_map_u8 *mask)
{
    double sum = 0, n = 0;

    for (int c = 0; c < 3; c++) {
        for (int y = 0; y + 1 < HEIGHT; y++) {
            const uint8_t *in[2] = { sst_map_u8_row(mask, y), sst_map_u8_row(mask, y + 1) };
            const uint8_t *p[2] = { sst_image_row(a, c, y), sst_image_row(a, c, y + 1) };
            const uint8_t *q[2] = { sst_image_row(behind, c, y), sst_image_row(behind, c, y + 1) };

            for (int x = 0; x + 1 < WIDTH; x++) {
                const int across = p[0][x + 1] - p[0][x] - q[0][x + 1] + q[0][x];
                const int down = p[1][x] - p[0][x] - q[1][x] + q[0][x];

                if (in[0][x] && in[0][x + 1] && in[1][x]) {
                    sum += across * across + down * down;
                    n += 2;
                }
            }
        }
    }
    return 10 * log10(255.0 * 255.0 * n / sum);
}

/* @param maps_ns  CPU time of the maps */
static int render(const struct sst_lightfield *lf, const struct truth *t, int set, enum method method, int64_t maps_ns)
{
    struct sst_image out = { 0 };
    struct sst_renderer *r = NULL;
    struct sst_render_config cfg;
    char name[64], path[SST_PATH_MAX];
    double ssim = NAN;
    int64_t cpu;
    int err = sst_renderer_create(&r, lf, b.threads);

    sst_render_config_defaults(&cfg);
    cfg.method = method == REFOCUS ? SST_RENDER_REFOCUS : SST_RENDER_SST;
    cfg.focus_px = t->focus_px;
    cfg.verify = method == LIVE && b.confirmed < SURE ? SST_VERIFY_ON : SST_VERIFY_OFF;
    cfg.threads = b.threads;
    err = err ? err : sst_image_init(&out, WIDTH, HEIGHT);
    cpu = sst_clock_cpu_ns();
    err = err ? err : sst_render(r, &cfg, &out, NULL);
    cpu = sst_clock_cpu_ns() - cpu;
    err = err ? err : sst_ssim(&ssim, &out, &t->behind, &t->mask);
    if (!err)
        printf(",%.2f,%.2f,%.3f,%.0f", sst_psnr(&out, &t->behind, &t->mask), edge_psnr(&out, &t->behind, &t->mask),
               ssim, (double)(cpu + maps_ns) / 1e6);
    snprintf(name, sizeof(name), "%s-%02d-%s.png", b.scene_name, set, names[method]);
    if (!err && b.folder)
        err = sst_path_join(path, b.folder, name) ? -ENAMETOOLONG : sst_image_write_png(&out, path);
    sst_renderer_destroy(r);
    sst_image_fini(&out);
    return err;
}

static int compare(int set, int64_t live_ns)
{
    struct truth t = { 0 };
    double errors[2];
    int err = make_truth(&t, set);

    if (!err) {
        count_errors(errors, t.scene);
        printf(",%.2f,%.2f", errors[0], errors[1]);
    }
    err = err ? err : render(&b.lf, &t, set, LIVE, live_ns);
    err = err ? err : render(&b.lf, &t, set, MAPS, live_ns);
    for (int m = PREVIEW; !err && b.presets && m <= ACCURATE; m++) {
        int64_t cpu_ns;

        err = process(names[m], &cpu_ns);
        err = err ? err : render(&b.exact, &t, set, m, cpu_ns);
    }
    err = err ? err : render(&b.lf, &t, set, REFOCUS, 0);
    err = err ? err : sst_parallel_for(VIEWS, b.threads, truth_job, t.scene);
    err = err ? err : render(&b.exact, &t, set, TRUE_MAPS, 0);
    sst_image_fini(&t.behind);
    sst_map_u8_fini(&t.mask);
    sst_scene_destroy(t.scene);
    return err;
}

static int run(int sets, int every)
{
    int err = 0;

    printf("set,changed %%,confirmed %%,wall ms,cpu ms,disparity ms,labels ms,refine ms,bad1 %%,label errors %%");
    for (int m = 0; m < METHODS; m++) {
        if (b.presets || m < PREVIEW || m > ACCURATE)
            printf(",%s dB,%s edges dB,%s SSIM,%s cpu ms", names[m], names[m], names[m], names[m]);
    }
    for (int set = 0; !err && set < sets; set++) {
        struct sst_live_report report = { 0 };
        int64_t wall, cpu;
        double share;

        err = fetch(set);
        if (err)
            break;
        take_changes(set == 0);
        share = 100.0 * (double)b.changes.changed / (VIEWS * b.changes.cols * b.changes.rows);
        wall = sst_clock_now_ns();
        cpu = sst_clock_cpu_ns();
        err = sst_livescene_update(b.scene, &b.changes, &(const struct sst_live_input){ 0 }, &report);
        cpu = sst_clock_cpu_ns() - cpu;
        b.confirmed = report.confirmed;
        printf("\n%d,%.1f,%.1f,%.1f,%.1f,%.1f,%.1f,%.1f", set, share, 100 * b.confirmed,
               (double)(sst_clock_now_ns() - wall) / 1e6, (double)cpu / 1e6,
               (double)report.stage_ns[SST_LIVE_DISPARITY] / 1e6, (double)report.stage_ns[SST_LIVE_LABELS] / 1e6,
               (double)report.stage_ns[SST_LIVE_REFINE] / 1e6);
        if (!err && every && set % every == 0)
            err = compare(set, cpu);
        fflush(stdout);
    }
    printf("\n");
    return err;
}

int main(int argc, char **argv)
{
    const int sets = argc > 2 ? atoi(argv[2]) : 20, every = argc > 3 ? atoi(argv[3]) : 5;
    const char *cache = argc > 5 ? argv[5] : "/tmp";
    int err;

    b.scene_name = argc > 1 ? argv[1] : "pedestrian";
    b.threads = sst_thread_count(argc > 4 ? atoi(argv[4]) : 0);
    b.folder = argc > 6 && argv[6][0] ? argv[6] : NULL;
    b.presets = argc <= 7;
    b.cfg = (struct sst_live_config){ .rows = SIDE,
                                      .cols = SIDE,
                                      .width = WIDTH,
                                      .height = HEIGHT,
                                      .model = MODEL,
                                      .threads = b.threads,
                                      .skip_change = true,
                                      .skip_labels = true };
    err = make_lightfields();
    err = err ? err : open_world(cache);
    err = err ? err : sst_livescene_open(&b.scene, &b.cfg, &b.lf);
    err = err ? err : run(sets, every);
    sst_livescene_close(b.scene);
    sst_sim_world_close(b.world);
    if (err)
        fprintf(stderr, "live_scene: error %d\n", -err);
    return err ? 1 : 0;
}
