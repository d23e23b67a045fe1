/* How the live clear picture compares with the truth, set by set, on a simulated world that moves:
 *   make build/bench/live_clear && build/bench/live_clear SCENE [name=value ...]
 * sets=21 threads=2 rate=10 (sets a second; scenes of the world stand still between their own moments) cut=AUTO
 * label=NAME (removed) from=0 (first set) calibrated=0 (1: views are rectified) cache=/tmp out=DIR (pictures)
 *
 * Prints CSV: whether the maps are of the set (0: of an earlier one); CPU ms of the update, of the clear picture and of
 * a see-through one; dB over the whole picture against the scene without its first occluder: with memory, of this set
 * alone, see-through; percent of pixels wrong by more than 20 levels, of those that only the memory makes wrong
 * (ghosts), and of those with the colour of an earlier set (stale); shares seen, remembered and filled, oldest pixel.
 * The last line sums up. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
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
#include "pipeline/live/live.h"
#include "simulators/scene/hedge.h"
#include "simulators/scene/scene.h"
#include "simulators/scene/world/sim_world.h"

#define WIDTH    640
#define HEIGHT   480
#define SIDE     6
#define VIEWS    (SIDE * SIDE)
#define CAPACITY ((size_t)1 << 20)
#define BEFORE   20 /* sets */
#define WRONG    20 /* levels in one channel */

static struct {
    const char *scene, *label, *cache, *out;
    int sets, from, threads, rate, calibrated;
    struct sst_use_calibration use;
    double cut;
    struct sst_sim_world *world;
    struct sst_live *live;
    struct sst_livepicture *clear, *alone, *see_through;
    struct sst_live_input in;
    struct sst_live_report report;
    struct sst_image before[BEFORE]; /* truth of the sets before */
    uint8_t frame[VIEWS][CAPACITY];
} b = { .cache = "/tmp", .sets = 21, .threads = 2, .rate = 10, .cut = NAN };

static bool set_option(const char *text)
{
    const char *eq = strchr(text, '=');
    const size_t n = eq ? (size_t)(eq - text) : 0;
    const struct {
        const char *name, **text;
        int *number;
    } known[] = { { "label", &b.label, NULL }, { "cache", &b.cache, NULL },
                  { "out", &b.out, NULL },     { "sets", NULL, &b.sets },
                  { "from", NULL, &b.from },   { "threads", NULL, &b.threads },
                  { "rate", NULL, &b.rate },   { "calibrated", NULL, &b.calibrated } };

    for (size_t i = 0; n && i < ARRAY_LEN(known); i++) {
        if (strlen(known[i].name) != n || strncmp(text, known[i].name, n) != 0)
            continue;
        if (known[i].text)
            *known[i].text = eq + 1;
        else
            *known[i].number = atoi(eq + 1);
        return true;
    }
    if (n == 3 && !strncmp(text, "cut", 3)) {
        b.cut = atof(eq + 1);
        return true;
    }
    fprintf(stderr, "live_clear: unknown option %s\n", text);
    return false;
}

static int open_world(void)
{
    char path[SST_PATH_MAX], text[256];
    int err;

    snprintf(path, sizeof(path), "%s/live-%s.yaml", b.cache, b.scene);
    snprintf(text, sizeof(text), "scene: %s\nstrip: false\n", b.scene);
    err = sst_file_write(path, text, strlen(text));
    return err ? err : sst_sim_world_open(&b.world, path, b.cache);
}

static int open_live(void)
{
    char world[SST_PATH_MAX], path[SST_PATH_MAX];
    struct sst_live_config cfg = { .rows = SIDE,
                                   .cols = SIDE,
                                   .fourcc = V4L2_PIX_FMT_MJPEG,
                                   .width = WIDTH,
                                   .height = HEIGHT,
                                   .model = "models/pspnet-small.onnx",
                                   .threads = b.threads,
                                   .skip_change = true,
                                   .skip_labels = true };
    int err = 0;

    for (int k = 0; k < VIEWS; k++)
        cfg.present[k] = true;
    sst_use_calibration_defaults(&b.use);
    if (b.calibrated) {
        snprintf(world, sizeof(world), "%s/live-%s.yaml", b.cache, b.scene);
        snprintf(path, sizeof(path), "%s/live-%s-calibration.yaml", b.cache, b.scene);
        err = sst_sim_world_parameters(world, path);
        err = err ? err : sst_use_calibration_read(&b.use, path);
        cfg.calibration = &b.use;
    }
    err = err ? err : sst_live_open(&b.live, &cfg);
    err = err ? err : sst_livepicture_create(&b.clear, b.live);
    return err ? err : sst_livepicture_create(&b.see_through, b.live);
}

static int feed(int set)
{
    b.in.set = (uint64_t)set;
    b.in.t_ns = INT64_C(1000000000) / b.rate * set + 1000000;
    for (int view = 0; view < VIEWS; view++) {
        const struct sst_sim_exposure e = {
            .cam = view, .trigger = (uint64_t)set, .exposure_us = 5000, .gain = 1, .t_ns = b.in.t_ns
        };
        const int err = sst_sim_world_frame(b.world, &e, (struct sst_sim_format){ V4L2_PIX_FMT_MJPEG, WIDTH, HEIGHT },
                                            (struct sst_sim_room){ b.frame[view], CAPACITY }, &b.in.frame[view].bytes);

        if (err)
            return err;
        b.in.frame[view].data = b.frame[view];
    }
    return sst_live_update(b.live, &b.in, &b.report);
}

/* The scene hedge without its leaves. */
static int make_bare(struct sst_image *truth, int set)
{
    struct sst_hedge_config cfg = { .rows = SIDE, .cols = SIDE, .width = WIDTH, .height = HEIGHT, .seed = 1 };
    const double t_s = fmod((double)set / b.rate, 60);
    struct sst_hedge_person person;
    struct sst_hedge *hedge;
    int err;

    sst_hedge_scene_config(&cfg);
    cfg.cover = 0;
    err = sst_hedge_create(&hedge, &cfg);
    if (err)
        return err;
    person = sst_hedge_passer_by(&cfg, t_s);
    sst_hedge_draw_view(hedge, t_s, t_s < SST_HEDGE_PASS_S ? &person : NULL, VIEWS / 2 - SIDE / 2 - 1, truth);
    sst_hedge_destroy(hedge);
    return 0;
}

static int make_truth(struct sst_image *truth, int set)
{
    struct sst_scene_config cfg;
    struct sst_scene *scene;
    int err;

    if (!strcmp(b.scene, "hedge"))
        return make_bare(truth, set);
    sst_scene_config_defaults(&cfg);
    cfg.width = WIDTH;
    cfg.height = HEIGHT;
    cfg.time_s = (double)set / b.rate;
    err = sst_scene_create(&scene, b.scene, &cfg);
    if (err)
        return err;
    err = sst_scene_render(scene, 0, 0, 1, &(struct sst_scene_maps){ .image = truth });
    sst_scene_destroy(scene);
    return err;
}

static int deviation(const struct sst_image *a, const struct sst_image *t, int x, int y)
{
    int most = 0;

    for (int c = 0; c < 3; c++)
        most = sst_max_int(most, abs(sst_image_row(a, c, y)[x] - sst_image_row(t, c, y)[x]));
    return most;
}

/* Pixels that only the memory makes wrong. */
static double ghost_percent(const struct sst_image *memory, const struct sst_image *alone,
                            const struct sst_image *truth)
{
    int ghosts = 0;

    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++)
            ghosts += deviation(memory, truth, x, y) > WRONG && deviation(alone, truth, x, y) <= WRONG;
    }
    return 100.0 * ghosts / (WIDTH * HEIGHT);
}

/* Wrong pixels with the colour of their place in one of the sets before. */
static double stale_percent(const struct sst_image *memory, const struct sst_image *truth)
{
    int stale = 0;

    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            bool was = false;

            for (int i = 0; i < BEFORE && !was && deviation(memory, truth, x, y) > WRONG; i++)
                was = b.before[i].plane[0] && deviation(memory, &b.before[i], x, y) <= WRONG;
            stale += was;
        }
    }
    return 100.0 * stale / (WIDTH * HEIGHT);
}

static double wrong_percent(const struct sst_image *a, const struct sst_image *t)
{
    int wrong = 0;

    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++)
            wrong += deviation(a, t, x, y) > WRONG;
    }
    return 100.0 * wrong / (WIDTH * HEIGHT);
}

static int write_picture(const struct sst_image *image, const char *name, int set)
{
    char file[64], path[SST_PATH_MAX];

    if (!b.out)
        return 0;
    snprintf(file, sizeof(file), "%s-%03d-%s.png", b.scene, set, name);
    return sst_path_join(path, b.out, file) ? -ENAMETOOLONG : sst_image_write_png(image, path);
}

static int render(struct sst_livepicture *p, enum sst_render_method method, const struct sst_image **image,
                  double *cpu_ms)
{
    const int64_t cpu_ns = sst_clock_cpu_ns();
    struct sst_render_config cfg;
    int64_t px;
    int err;

    sst_render_config_defaults(&cfg);
    cfg.method = method;
    cfg.focus_px = NAN;
    cfg.verify = SST_VERIFY_ON;
    cfg.cut_px = b.cut;
    cfg.remove_label = b.label ? sst_classes_find(&sst_live_lightfield(b.live)->classes, b.label) : 0;
    err = sst_livepicture_render(p, &cfg, image, &px);
    *cpu_ms = (double)(sst_clock_cpu_ns() - cpu_ns) / 1e6;
    return err;
}

struct sum {
    double update, clear, see_through, memory_db, alone_db, stale;
    int n;
};

static int show(int set, double update_ms, struct sum *sum)
{
    struct sst_livepicture_clear state;
    const struct sst_image *memory, *alone, *see_through;
    struct sst_image truth = { 0 };
    double clear_ms, alone_ms, see_ms, stale, db[2];
    int err = sst_image_init(&truth, WIDTH, HEIGHT);

    err = err ? err : make_truth(&truth, set);
    err = err ? err : render(b.see_through, SST_RENDER_SST, &see_through, &see_ms);
    err = err ? err : render(b.clear, SST_RENDER_CLEAR, &memory, &clear_ms);
    err = err ? err : sst_livepicture_create(&b.alone, b.live); /* without a memory */
    err = err ? err : render(b.alone, SST_RENDER_CLEAR, &alone, &alone_ms);
    if (!err) {
        sst_livepicture_clear(b.clear, &state);
        b.in.moving = state.moving;
        stale = stale_percent(memory, &truth);
        sum->stale += stale;
        db[0] = sst_psnr(memory, &truth, NULL);
        db[1] = sst_psnr(alone, &truth, NULL);
        printf("%d,%d,%.1f,%.1f,%.1f,%.2f,%.2f,%.2f,%.2f,%.3f,%.3f,%.3f,%.1f,%.1f,%.1f,%.2f\n", set, !b.report.late,
               update_ms, clear_ms, see_ms, state.cut_px, db[0], db[1], sst_psnr(see_through, &truth, NULL),
               wrong_percent(memory, &truth), ghost_percent(memory, alone, &truth), stale, 100 * state.seen,
               100 * state.remembered, 100 * state.filled, state.oldest_s);
        fflush(stdout);
        sum->update += update_ms;
        sum->clear += clear_ms;
        sum->see_through += see_ms;
        sum->memory_db += db[0];
        sum->alone_db += db[1];
        sum->n++;
        err = write_picture(memory, "clear", set);
        err = err ? err : write_picture(alone, "alone", set);
        err = err ? err : write_picture(&truth, "truth", set);
        err = err ? err : write_picture(&sst_live_lightfield(b.live)->views[14].image, "camera", set);
    }
    sst_livepicture_destroy(b.alone);
    b.alone = NULL;
    sst_image_fini(&b.before[set % BEFORE]);
    b.before[set % BEFORE] = truth;
    return err;
}

static int run(void)
{
    struct sum sum = { 0 };
    int err = 0;

    printf(
        "set,maps,update ms,clear ms,see-through ms,cut px,with memory dB,alone dB,see-through dB,wrong %%,ghosts %%,"
        "stale %%,seen %%,remembered %%,filled %%,oldest s\n");
    for (int set = b.from; !err && set < b.from + b.sets; set++) {
        const int64_t cpu_ns = sst_clock_cpu_ns();

        err = feed(set);
        err = err ? err : show(set, (double)(sst_clock_cpu_ns() - cpu_ns) / 1e6, &sum);
    }
    if (sum.n)
        printf("mean of %d sets: update %.1f ms, clear %.1f ms, see-through %.1f ms; %.2f dB, alone %.2f dB; stale "
               "%.3f %%\n",
               sum.n, sum.update / sum.n, sum.clear / sum.n, sum.see_through / sum.n, sum.memory_db / sum.n,
               sum.alone_db / sum.n, sum.stale / sum.n);
    return err;
}

int main(int argc, char **argv)
{
    int err;

    b.scene = argc > 1 ? argv[1] : "bush";
    for (int i = 2; i < argc; i++) {
        if (!set_option(argv[i]))
            return 2;
    }
    err = open_world();
    err = err ? err : open_live();
    err = err ? err : run();
    sst_livepicture_destroy(b.clear);
    sst_livepicture_destroy(b.see_through);
    sst_live_close(b.live);
    sst_use_calibration_fini(&b.use);
    for (int i = 0; i < BEFORE; i++)
        sst_image_fini(&b.before[i]);
    sst_sim_world_close(b.world);
    if (err)
        fprintf(stderr, "live_clear: error %d\n", -err);
    return err ? 1 : 0;
}
