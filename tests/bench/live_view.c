/* Times pictures of a light field that changes: live_view WxH ROUNDS. The pedestrian walks by in steps of 0.1 s, true
 * maps; each step is rendered in part by what changed, and whole. Prints a line for each kind of work: medians of wall
 * and CPU milliseconds on two threads, and on how much of the picture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/stats.h"
#include "base/thread.h"
#include "pipeline/live/live_internal.h"
#include "simulators/scene/scene.h"

#define THREADS    2
#define ROUNDS_MAX 200
#define SIDE       6

enum { TAKE = 0, PART = 1, WHOLE = 2, SETTINGS = 3, STILL = 4, PICK = 5, OVERLAY = 6, KINDS = 7 };
static const char *const kind_name[] = { "taking changes in", "changed parts", "whole picture",       "other focus",
                                         "nothing changed",   "pick",          "disparity in colours" };

struct sample {
    double ms[ROUNDS_MAX], cpu_ms[ROUNDS_MAX], share[ROUNDS_MAX];
    int n;
};

struct bench {
    struct sst_live *live;
    struct sst_scene *scene;
    struct sst_liveframes_changes changes;
    struct sample sample[KINDS];
    int64_t ns, cpu_ns;
    double psnr; /* of parts against an exact picture, worst */
};

static bool tile_differs(const struct sst_image *a, const struct sst_image *b, int x0, int y0)
{
    const int n = sst_min_int(SST_LIVE_TILE, a->width - x0);

    for (int y = y0; y < sst_min_int(y0 + SST_LIVE_TILE, a->height); y++) {
        for (int c = 0; c < 3; c++) {
            if (memcmp(sst_image_row(a, c, y) + x0, sst_image_row(b, c, y) + x0, (size_t)n))
                return true;
        }
    }
    return false;
}

static int make_view(void *arg, int k, int worker SST_UNUSED)
{
    struct bench *b = arg;
    struct sst_lightfield *lf = &b->live->lf;
    struct sst_view *v = &lf->views[k];
    struct sst_map_f32 disp = { 0 };
    struct sst_image image = { 0 };
    int err = v->disp.data ? 0 : sst_map_u16_init(&v->disp, lf->width, lf->height);

    err = err || v->label.data ? err : sst_map_u8_init(&v->label, lf->width, lf->height);
    err = err || v->image.plane[0] ? err : sst_image_init(&v->image, lf->width, lf->height);
    err = err ? err : sst_image_init(&image, lf->width, lf->height);
    err = err ? err : sst_map_f32_init(&disp, lf->width, lf->height);
    err = err ? err
              : sst_scene_render(b->scene, v->bx, v->by, 0,
                                 &(struct sst_scene_maps){ .image = &image, .disp = &disp, .label = &v->label });
    for (int i = 0; !err && i < b->changes.cols * b->changes.rows; i++)
        b->changes.map[k][i] =
            tile_differs(&image, &v->image, i % b->changes.cols * SST_LIVE_TILE, i / b->changes.cols * SST_LIVE_TILE);
    for (int y = 0; !err && y < lf->height; y++) {
        for (int x = 0; x < lf->width; x++)
            sst_map_u16_row(&v->disp, y)[x] = sst_disp_q6(lf, sst_map_f32_row(&disp, y)[x]);
    }
    sst_map_f32_fini(&disp);
    if (!err) {
        sst_image_fini(&v->image);
        v->image = image;
    }
    return err;
}

static int step(struct bench *b, int i)
{
    struct sst_lightfield *lf = &b->live->lf;
    struct sst_scene_config cfg;
    int err;

    sst_scene_config_defaults(&cfg);
    cfg.width = lf->width;
    cfg.height = lf->height;
    cfg.rows = cfg.cols = SIDE;
    cfg.time_s = 0.1 * i;
    sst_scene_destroy(b->scene);
    err = sst_scene_create(&b->scene, "pedestrian", &cfg);
    if (err)
        return err;
    sst_scene_range(b->scene, &lf->range_min_px, &lf->range_max_px);
    lf->disp_min_px = floor(lf->range_min_px);
    return sst_parallel_for(SIDE * SIDE, THREADS, make_view, b);
}

static void start(struct bench *b)
{
    b->ns = sst_clock_now_ns();
    b->cpu_ns = sst_clock_cpu_ns();
}

static void stop(struct bench *b, int kind, double share)
{
    struct sample *s = &b->sample[kind];

    s->ms[s->n] = (double)(sst_clock_now_ns() - b->ns) * 1e-6;
    s->cpu_ms[s->n] = (double)(sst_clock_cpu_ns() - b->cpu_ns) * 1e-6;
    s->share[s->n] = 100 * share;
    s->n++;
}

static double median(double *v, int n)
{
    return n ? sst_stats_upper_median(v, n) : NAN;
}

/* Of the picture against one whose label ranges are counted from all pixels of all views. */
static int compare(struct bench *b, const struct sst_render_config *cfg, const struct sst_image *got)
{
    struct sst_renderer *r = NULL;
    struct sst_image want = { 0 };
    double sum = 0;
    int err = sst_renderer_create(&r, &b->live->lf, THREADS);

    err = err ? err : sst_image_init(&want, got->width, got->height);
    err = err ? err : sst_render(r, cfg, &want, NULL);
    for (int i = 0; !err && i < 3 * got->height; i++) {
        for (int x = 0; x < got->width; x++)
            sum += pow(sst_image_row(got, i % 3, i / 3)[x] - sst_image_row(&want, i % 3, i / 3)[x], 2);
    }
    b->psnr = fmin(b->psnr, 10 * log10(255 * 255 / fmax(sum / (3.0 * got->width * got->height), 1e-9)));
    sst_image_fini(&want);
    sst_renderer_destroy(r);
    return err;
}

static int measure(struct bench *b, struct sst_livepicture *kept, int round)
{
    struct sst_live *live = b->live;
    const double pixels = (double)live->lf.width * live->lf.height;
    struct sst_render_config cfg;
    struct sst_livepicture *fresh = NULL;
    const struct sst_image *image;
    struct sst_image overlay = { 0 };
    struct sst_livepicture_pick pick;
    int64_t anew;
    int err;

    sst_render_config_defaults(&cfg);
    cfg.focus_px = sst_scene_occluder_at(b->scene, 0)->focus_px;
    start(b);
    err = live_ingest(live, &b->changes);
    err = err ? err : live_summarize(live, (int64_t)(round + 1) * 100000000);
    stop(b, TAKE, 1);
    start(b);
    err = err ? err : sst_livepicture_render(kept, &cfg, &image, &anew);
    if (round)
        stop(b, PART, (double)anew / pixels);
    err = err ? err : compare(b, &cfg, image);
    start(b);
    err = err ? err : sst_livepicture_render(kept, &cfg, &image, &anew);
    stop(b, STILL, (double)anew / pixels);
    start(b);
    err = err ? err : sst_livepicture_pick(kept, 100, 100, &pick);
    stop(b, PICK, 0);
    err = err ? err : sst_livepicture_create(&fresh, live);
    err = err ? err : sst_livepicture_render(fresh, &cfg, &image, &anew); /* pages that were never used cost extra */
    cfg.focus_px += 1;
    start(b);
    err = err ? err : sst_livepicture_render(fresh, &cfg, &image, &anew);
    stop(b, SETTINGS, (double)anew / pixels);
    sst_livepicture_destroy(fresh);
    err = err ? err : sst_image_init(&overlay, live->lf.width, live->lf.height);
    start(b);
    err = err ? err : sst_livepicture_overlay(live, SST_LIVE_DISPARITY_PICTURE, &overlay);
    stop(b, OVERLAY, 1);
    sst_image_fini(&overlay);
    return err;
}

/* All tiles changed, settings as before. */
static int measure_whole(struct bench *b, struct sst_livepicture *kept)
{
    struct sst_render_config cfg;
    const struct sst_image *image;
    int64_t anew;
    int err;

    sst_render_config_defaults(&cfg);
    cfg.focus_px = sst_scene_occluder_at(b->scene, 0)->focus_px;
    b->changes.whole = true;
    err = live_ingest(b->live, &b->changes);
    b->changes.whole = false;
    start(b);
    err = err ? err : sst_livepicture_render(kept, &cfg, &image, &anew);
    stop(b, WHOLE, (double)anew / ((double)b->live->lf.width * b->live->lf.height));
    return err;
}

static double changed_share(const struct bench *b)
{
    int64_t n = 0;

    for (int k = 0; k < SIDE * SIDE; k++) {
        for (int i = 0; i < b->changes.cols * b->changes.rows; i++)
            n += b->changes.map[k][i];
    }
    return (double)n / (SIDE * SIDE * b->changes.cols * b->changes.rows);
}

static int run(struct bench *b, int width, int height, int rounds)
{
    struct sst_live_config cfg = { .rows = SIDE, .cols = SIDE, .width = width, .height = height, .threads = THREADS };
    struct sst_livepicture *kept = NULL;
    double changed = 0;
    int err;

    for (int k = 0; k < SIDE * SIDE; k++)
        cfg.present[k] = true;
    err = live_init(b->live, &cfg);
    b->live->ready = true;
    err = err ? err : sst_liveframes_changes_init(&b->changes, &b->live->lf);
    err = err ? err : sst_livepicture_create(&kept, b->live);
    for (int i = 0; i < rounds && !err; i++) {
        err = step(b, i);
        changed += i && !err ? changed_share(b) / (rounds - 1) : 0;
        err = err ? err : measure(b, kept, i);
        err = err ? err : measure_whole(b, kept);
    }
    printf("%d views of %dx%d, %d threads; %.1f %% of the tiles change; worst PSNR against exact pictures %.1f dB\n\n",
           SIDE * SIDE, width, height, THREADS, 100 * changed, b->psnr);
    printf("| | ms | CPU ms | %% of the picture |\n| --- | --: | --: | --: |\n");
    for (int i = 0; i < KINDS; i++) {
        struct sample *s = &b->sample[i];

        printf("| %s | %.2f | %.2f | %.1f |\n", kind_name[i], median(s->ms, s->n), median(s->cpu_ms, s->n),
               median(s->share, s->n));
    }
    sst_livepicture_destroy(kept);
    return err;
}

int main(int argc, char **argv)
{
    struct bench b = { .live = calloc(1, sizeof(struct sst_live)), .psnr = INFINITY };
    const int rounds = argc == 3 ? atoi(argv[2]) : 0;
    int width, height, err;

    if (!b.live || rounds < 2 || rounds > ROUNDS_MAX || sscanf(argv[1], "%dx%d", &width, &height) != 2) {
        fprintf(stderr, "usage: live_view WxH ROUNDS: size of a view; 2 to %d rounds\n", ROUNDS_MAX);
        return 2;
    }
    err = run(&b, width, height, rounds);
    if (err)
        sst_log_error("live_view bench: %s", strerror(-err));
    sst_scene_destroy(b.scene);
    sst_liveframes_changes_fini(&b.changes);
    live_fini(b.live);
    free(b.live);
    return err ? 1 : 0;
}
