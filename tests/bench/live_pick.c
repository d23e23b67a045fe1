/* Does a click find what the live picture shows there? Sets of a simulated world become live pictures, every few pixels
 * of them are picked, and the surfaces found are compared with the truth:
 *   make build/bench/live_pick && build/bench/live_pick SCENE [SETS [EVERY [THREADS [CACHE [still]]]]]
 * CACHE: folder for prepared worlds. still: the first set again and again, until the background has made its maps.
 * Prints, for a focus on what the scene's first occluder hides, for one that is 1 px off, and for one on the occluder,
 * of every EVERY-th set together, the share of picks within 1 px of the truth, and of these the share whose label is
 * right, for pixels that the surface named makes up most of when the picture is made by the true maps:
 *   hidden        surfaces in focus, hidden in the reference view, and seen by at least 4 others;
 *   seen through  of these, the ones that the picture shows as they are in truth;
 *   in focus      surfaces in focus and not hidden in the reference view;
 *   out of focus  surfaces elsewhere and not hidden;
 *   front         the occluder in focus. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <linux/videodev2.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/thread.h"
#include "pipeline/live/live.h"
#include "pipeline/method/render/plan.h"
#include "simulators/scene/scene.h"
#include "simulators/scene/world/settings.h"
#include "simulators/scene/world/sim_world.h"

#define WIDTH     640
#define HEIGHT    480
#define SIDE      6
#define VIEWS     (SIDE * SIDE)
#define REF       (2 * SIDE + 2)
#define MODEL     "models/pspnet-small.onnx"
#define CAPACITY  ((size_t)1 << 20)
#define STEP      8   /* px between clicks */
#define RIGHT_PX  1.0 /* a pick this near to the truth is right */
#define IN_FOCUS  1.5 /* px: a surface this near to the focus is in it */
#define SEEN      4   /* views, at least */
#define LIKE      30  /* levels of each colour: the picture is as the truth */
#define SETTLE_NS INT64_C(900000000000)

enum kind { HIDDEN, SEEN_THROUGH, FOCUSED, BLURRED, FRONT, KINDS };

static const char *const kinds[KINDS] = { "hidden", "seen through", "in focus", "out of focus", "front" };

enum focus { TARGET, OFF, OCCLUDER, FOCI };

static const char *const foci[FOCI] = { "target", "1 px off it", "occluder" };

struct count {
    int all, right, label;
};

/** The truth at one time. */
struct truth {
    struct sst_lightfield lf;                /* the live pictures with true maps; images are borrowed */
    struct sst_map_f32 front[VIEWS], behind; /* disparities; behind: of the reference view without the occluder */
    struct sst_map_u8 label;                 /* of what is behind */
    struct sst_image image;                  /* what is behind */
    double focus_px, occluder_px;
};

static struct {
    const char *scene_name;
    int threads;
    struct sst_sim_world *world;
    struct sst_sim_settings settings;
    struct sst_scene *scene;
    struct sst_live_config cfg;
    struct sst_live *live;
    struct sst_livepicture *picture;
    struct sst_live_input in;
    struct sst_live_report report;
    uint8_t frame[VIEWS][CAPACITY];
    struct truth truth;
    struct count count[FOCI][KINDS];
    int64_t pick_ns, picks;
} b;

/* --- the world ---------------------------------------------------------------------------------------------------- */

static int open_world(const char *cache)
{
    char path[SST_PATH_MAX], text[256];
    int err;

    snprintf(path, sizeof(path), "%s/live-%s.yaml", cache, b.scene_name);
    snprintf(text, sizeof(text), "scene: %s\nstrip: false\n", b.scene_name);
    err = sst_file_write(path, text, strlen(text));
    err = err ? err : sst_sim_settings_read(&b.settings, path);
    return err ? err : sst_sim_world_open(&b.world, path, cache);
}

static double time_of(int set)
{
    return fmod(set / b.settings.rate_hz, b.settings.loop_s);
}

static int make_scene(double time_s)
{
    struct sst_scene_config cfg;

    sst_scene_config_defaults(&cfg);
    cfg.width = WIDTH;
    cfg.height = HEIGHT;
    cfg.seed = b.settings.seed;
    cfg.time_s = time_s;
    sst_scene_destroy(b.scene);
    b.scene = NULL;
    return sst_scene_create(&b.scene, b.scene_name, &cfg);
}

/* @param shown  set of the world that the cameras see */
static int take_set(int set, int shown)
{
    b.in.set = (uint64_t)set;
    b.in.t_ns = (int64_t)(set * 1e9 / b.settings.rate_hz) + 1000000000;
    for (int view = 0; view < VIEWS; view++) {
        const struct sst_sim_exposure e = { .cam = view,
                                            .trigger = (uint64_t)set,
                                            .exposure_us = 5000,
                                            .gain = 1,
                                            .t_ns = (int64_t)(time_of(shown) * 1e9) + 1000000 };
        const int err = sst_sim_world_frame(b.world, &e, (struct sst_sim_format){ V4L2_PIX_FMT_MJPEG, WIDTH, HEIGHT },
                                            (struct sst_sim_room){ b.frame[view], CAPACITY }, &b.in.frame[view].bytes);

        if (err)
            return err;
        b.in.frame[view].data = b.frame[view];
    }
    return sst_live_update(b.live, &b.in, &b.report);
}

/* --- the truth ---------------------------------------------------------------------------------------------------- */

static int truth_job(void *arg, int view, int worker SST_UNUSED)
{
    struct sst_view *v = &b.truth.lf.views[view];
    int err = sst_scene_render(b.scene, v->bx, v->by, 0,
                               &(struct sst_scene_maps){ .disp = &b.truth.front[view], .label = &v->label });

    (void)arg;
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++)
            sst_map_u16_row(&v->disp, y)[x] =
                sst_disp_q6(&b.truth.lf, (double)sst_map_f32_row(&b.truth.front[view], y)[x]);
    }
    return err;
}

static int make_truth(void)
{
    const struct sst_lightfield *live = sst_live_lightfield(b.live);
    double sum = 0, n = 0;
    int err = sst_parallel_for(VIEWS, b.threads, truth_job, NULL);

    b.truth.focus_px = sst_scene_occluder_at(b.scene, 0)->focus_px;
    for (int k = 0; k < VIEWS; k++)
        b.truth.lf.views[k].image = live->views[k].image;
    err = err ? err
              : sst_scene_render(b.scene, 0, 0, 1,
                                 &(struct sst_scene_maps){
                                     .image = &b.truth.image, .disp = &b.truth.behind, .label = &b.truth.label });
    for (int y = 0; !err && y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            const double f = (double)sst_map_f32_row(&b.truth.front[REF], y)[x];

            if (f > (double)sst_map_f32_row(&b.truth.behind, y)[x] + 1) {
                sum += f;
                n++;
            }
        }
    }
    b.truth.occluder_px = n > 0 ? sum / n : NAN;
    return err;
}

static int init_truth(void)
{
    struct sst_lightfield *lf = &b.truth.lf;
    int err = sst_map_f32_init(&b.truth.behind, WIDTH, HEIGHT);

    err = err ? err : sst_lightfield_init(lf, SIDE, SIDE);
    lf->width = WIDTH;
    lf->height = HEIGHT;
    for (int k = 0; k < VIEWS && !err; k++) {
        err = sst_map_f32_init(&b.truth.front[k], WIDTH, HEIGHT);
        err = err ? err : sst_map_u16_init(&lf->views[k].disp, WIDTH, HEIGHT);
        err = err ? err : sst_map_u8_init(&lf->views[k].label, WIDTH, HEIGHT);
        lf->views[k].present = true;
    }
    err = err ? err : sst_map_u8_init(&b.truth.label, WIDTH, HEIGHT);
    return err ? err : sst_image_init(&b.truth.image, WIDTH, HEIGHT);
}

/* Do rays within 1 px of d make up most of the pixel? */
static bool shown(const struct sst_render_plan *exact, int x, int y, double d)
{
    struct sst_ray rays[SST_MAX_VIEWS];
    double rgb[3], share = 0;
    int count;

    count = sst_render_pixel_exact(exact, x, y, rgb, rays);
    for (int i = 0; i < count; i++)
        share += fabs(rays[i].disp_px - d) <= RIGHT_PX ? rays[i].share : 0;
    return share > 0.5;
}

static int views_that_see(int x, int y, double d)
{
    int n = 0;

    for (int k = 0; k < VIEWS; k++) {
        const int u = (int)floor(x - d * (k % SIDE - 2) + 0.5), v = (int)floor(y - d * (k / SIDE - 2) + 0.5);

        n += u >= 0 && u < WIDTH && v >= 0 && v < HEIGHT &&
             fabs((double)sst_map_f32_row(&b.truth.front[k], v)[u] - d) < 0.5;
    }
    return n;
}

static bool like(const struct sst_image *image, int x, int y)
{
    for (int c = 0; c < 3; c++) {
        if (abs(sst_image_row(image, c, y)[x] - sst_image_row(&b.truth.image, c, y)[x]) > LIKE)
            return false;
    }
    return true;
}

/* --- clicks ------------------------------------------------------------------------------------------------------- */

static void note(struct count *c, const struct sst_livepicture_pick *pick, double want_px, int label)
{
    const bool right = fabs(pick->disp_px - want_px) <= RIGHT_PX;

    c->all++;
    c->right += right;
    c->label += right && pick->label == label;
}

/* @param exact  of the same picture by the true maps */
static int click(enum focus focus, const struct sst_image *image, const struct sst_render_plan *exact, int x, int y)
{
    const double f = (double)sst_map_f32_row(&b.truth.front[REF], y)[x];
    const double behind = (double)sst_map_f32_row(&b.truth.behind, y)[x];
    const bool hidden = f > behind + 1, target = focus != OCCLUDER;
    const double want = hidden && target ? behind : f;
    const int label = sst_map_u8_row(want < f ? &b.truth.label : &b.truth.lf.views[REF].label, y)[x];
    const bool focused = fabs(want - exact->cfg.focus_px) <= IN_FOCUS;
    struct count *count = b.count[focus];
    struct sst_livepicture_pick pick;
    int64_t cpu;
    int err;

    if (!shown(exact, x, y, want) || (hidden && (!focused || (target && views_that_see(x, y, want) < SEEN))) ||
        (!hidden && !target))
        return 0;
    cpu = sst_clock_cpu_ns();
    err = sst_livepicture_pick(b.picture, x, y, &pick);
    b.pick_ns += sst_clock_cpu_ns() - cpu;
    b.picks++;
    if (err)
        return err;
    note(&count[!target ? FRONT : hidden ? HIDDEN : focused ? FOCUSED : BLURRED], &pick, want, label);
    if (hidden && target && like(image, x, y))
        note(&count[SEEN_THROUGH], &pick, want, label);
    return 0;
}

static int click_everywhere(enum focus focus, double focus_px)
{
    const struct sst_image *image;
    struct sst_render_config cfg;
    struct sst_renderer *r;
    struct sst_render_plan exact;
    int64_t anew;
    int err;

    sst_render_config_defaults(&cfg);
    cfg.focus_px = focus_px;
    cfg.verify = true;
    err = sst_livepicture_render(b.picture, &cfg, &image, &anew);
    err = err ? err : sst_renderer_create(&r, &b.truth.lf, b.threads);
    if (err)
        return err;
    cfg.verify = false;
    err = sst_render_plan_init(&exact, r, &cfg);
    for (int y = STEP / 2; y < HEIGHT && !err; y += STEP) {
        for (int x = STEP / 2; x < WIDTH && !err; x += STEP)
            err = click(focus, image, &exact, x, y);
    }
    if (!err)
        sst_render_plan_fini(&exact);
    sst_renderer_destroy(r);
    return err;
}

static void print(void)
{
    for (int i = 0; i < FOCI; i++) {
        for (int k = 0; k < KINDS; k++) {
            const struct count *c = &b.count[i][k];

            if (c->all)
                printf("%-14s focus on %-12s %-13s %6d clicks  %5.1f %% right  label of these %5.1f %%\n", b.scene_name,
                       foci[i], kinds[k], c->all, 100.0 * c->right / c->all, 100.0 * c->label / fmax(c->right, 1));
        }
    }
    printf("%-14s %.3f ms of CPU time a pick, sure %.1f %%\n", b.scene_name, (double)b.pick_ns / (double)b.picks / 1e6,
           100 * b.report.confirmed);
}

/* The same set until the background work has reported its result. */
static int settle(void)
{
    const int64_t end_ns = sst_clock_now_ns() + SETTLE_NS;
    bool settled = false;
    int err = 0;

    for (int i = 1; !err && !settled && sst_clock_now_ns() < end_ns; i++) {
        err = take_set(i, 0);
        settled = sst_live_unsettled(b.live) && sst_live_settle(b.live);
        nanosleep(&(struct timespec){ 0, 100000000 }, NULL);
    }
    return err ? err : settled ? take_set(100000, 0) : -ETIMEDOUT;
}

static int run(int sets, int every, bool still)
{
    int err = 0;

    for (int set = 0; set < sets && !err; set++) {
        err = take_set(set, set);
        if (!err && still)
            err = settle();
        if (err || set % every)
            continue;
        err = make_scene(time_of(set));
        err = err ? err : make_truth();
        err = err ? err : click_everywhere(TARGET, b.truth.focus_px);
        err = err ? err : click_everywhere(OFF, b.truth.focus_px - 1);
        if (!err && !isnan(b.truth.occluder_px)) /* it may have walked out of the picture */
            err = click_everywhere(OCCLUDER, b.truth.occluder_px);
    }
    return err;
}

int main(int argc, char **argv)
{
    const int sets = argc > 2 ? atoi(argv[2]) : 4, every = argc > 3 ? atoi(argv[3]) : 3;
    const bool still = argc > 6;
    int err;

    b.scene_name = argc > 1 ? argv[1] : "bush";
    b.threads = sst_thread_count(argc > 4 ? atoi(argv[4]) : 0);
    b.cfg = (struct sst_live_config){ .rows = SIDE,
                                      .cols = SIDE,
                                      .fourcc = V4L2_PIX_FMT_MJPEG,
                                      .width = WIDTH,
                                      .height = HEIGHT,
                                      .model = MODEL,
                                      .precision = SST_PRECISION_AUTO,
                                      .threads = b.threads,
                                      .background = still,
                                      .skip_change = true,
                                      .skip_labels = true };
    for (int k = 0; k < VIEWS; k++)
        b.cfg.present[k] = true;
    err = open_world(argc > 5 ? argv[5] : "/tmp");
    err = err ? err : make_scene(0);
    err = err ? err : init_truth();
    if (!err) {
        sst_scene_range(b.scene, &b.cfg.range_min_px, &b.cfg.range_max_px);
        b.cfg.range_min_px = floor(b.cfg.range_min_px);
        b.cfg.range_max_px = ceil(b.cfg.range_max_px);
    }
    err = err ? err : sst_live_open(&b.live, &b.cfg);
    err = err ? err : sst_livepicture_create(&b.picture, b.live);
    err = err ? err : run(still ? 1 : sets, every, still);
    if (!err)
        print();
    sst_livepicture_destroy(b.picture);
    sst_live_close(b.live);
    sst_scene_destroy(b.scene);
    sst_sim_world_close(b.world);
    for (int k = 0; k < VIEWS && b.truth.lf.views; k++)
        b.truth.lf.views[k].image = (struct sst_image){ 0 };
    if (err)
        fprintf(stderr, "live_pick: error %d\n", -err);
    return err ? 1 : 0;
}
