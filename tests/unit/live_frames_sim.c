/* pipeline/live/frames on simulated cameras: noise, unequal gains, light that drifts, somebody who walks by. What is
 * kept never differs from what exact mode keeps by more than the budget. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <linux/videodev2.h>

#include "base/file.h"
#include "pipeline/live/frames/frames.h"
#include "pipeline/live/frames/frames_internal.h"
#include "simulators/scene/world/sim_world.h"
#include "tests/small.h"
#include "tests/test.h"

#define VIEWS_MAX  16
#define FRAME_ROOM ((size_t)1 << 18)
#define STEP_NS    200000000

static char dir[] = "/tmp/sst-live-frames-XXXXXX";

struct keeper {
    struct sst_live_config cfg;
    struct sst_lightfield lf;
    struct sst_liveframes *frames;
    struct sst_liveframes_changes changes;
    struct sst_live_report report;
};

static struct sst_sim_world *open_world(const char *text)
{
    struct sst_sim_world *w;
    char path[SST_PATH_MAX];

    assert_int_equal(sst_path_join(path, dir, "world.yaml"), 0);
    assert_int_equal(sst_file_write(path, text, strlen(text)), 0);
    assert_int_equal(sst_sim_world_open(&w, path, dir), 0);
    return w;
}

static void open_keeper(struct keeper *k, const struct sst_sim_world *w, bool skip)
{
    const struct sst_sim_settings *world = sst_sim_world_settings(w);

    *k = (struct keeper){ .cfg = { .rows = world->rows,
                                   .cols = world->cols,
                                   .width = world->width,
                                   .height = world->height,
                                   .fourcc = V4L2_PIX_FMT_MJPEG,
                                   .threads = 2,
                                   .skip_change = skip } };
    assert_int_equal(sst_lightfield_init(&k->lf, k->cfg.rows, k->cfg.cols), 0);
    k->lf.width = k->cfg.width;
    k->lf.height = k->cfg.height;
    for (int v = 0; v < k->cfg.rows * k->cfg.cols; v++)
        k->cfg.present[v] = k->lf.views[v].present = true;
    assert_int_equal(sst_liveframes_open(&k->frames, &k->cfg, &k->lf), 0);
    assert_int_equal(sst_liveframes_changes_init(&k->changes, &k->lf), 0);
}

static void close_keeper(struct keeper *k)
{
    sst_liveframes_close(k->frames);
    sst_liveframes_changes_fini(&k->changes);
    sst_lightfield_fini(&k->lf);
}

static double worst_difference(const struct keeper *a, const struct keeper *b)
{
    double worst = 0;

    for (int v = 0; v < a->lf.rows * a->lf.cols; v++) {
        for (int t = 0; t < a->changes.cols * a->changes.rows; t++) {
            const int x0 = t % a->changes.cols * SST_LIVE_TILE, x1 = sst_min_int(x0 + SST_LIVE_TILE, a->lf.width);
            const int y0 = t / a->changes.cols * SST_LIVE_TILE, y1 = sst_min_int(y0 + SST_LIVE_TILE, a->lf.height);
            double sum = 0;

            for (int c = 0; c < 3; c++)
                for (int y = y0; y < y1; y++)
                    for (int x = x0; x < x1; x++)
                        sum += abs(sst_image_row(&a->lf.views[v].image, c, y)[x] -
                                   sst_image_row(&b->lf.views[v].image, c, y)[x]);
            worst = fmax(worst, sum / (3.0 * (x1 - x0) * (y1 - y0)));
        }
    }
    return worst;
}

struct outcome {
    double worst;   /* levels, of any tile in any set */
    double changed; /* share of tiles computed anew after the first set */
    int whole;      /* sets computed whole after the first */
    int idle;       /* sets without a change */
    int watched;    /* tiles that changed in one view of WATCHED sets after these, seen by no viewer */
};

#define WATCHED 8

static void expose(struct sst_live_input *in, struct sst_sim_world *w, const struct keeper *of, int n, uint8_t *frames)
{
    *in = (struct sst_live_input){ .set = (uint64_t)n, .t_ns = 1000000000 + (int64_t)n * STEP_NS };
    for (int k = 0; k < sst_sim_world_cameras(w); k++) {
        const struct sst_sim_exposure e = { .cam = k,
                                            .trigger = (uint64_t)n,
                                            .t_ns = in->t_ns,
                                            .exposure_us = sst_sim_world_settings(w)->exposure_us,
                                            .gain = 1 };

        in->frame[k].data = frames + (size_t)k * FRAME_ROOM;
        assert_int_equal(sst_sim_world_frame(
                             w, &e, (struct sst_sim_format){ V4L2_PIX_FMT_MJPEG, of->cfg.width, of->cfg.height },
                             (struct sst_sim_room){ frames + (size_t)k * FRAME_ROOM, FRAME_ROOM }, &in->frame[k].bytes),
                         0);
    }
}

static struct outcome run(const char *text, int sets)
{
    struct sst_sim_world *w = open_world(text);
    struct outcome out = { 0 };
    struct keeper skip, exact;
    uint8_t *frames = malloc(VIEWS_MAX * FRAME_ROOM);

    open_keeper(&skip, w, true);
    open_keeper(&exact, w, false);
    for (int n = 0; n < sets; n++) {
        struct sst_live_input in;

        expose(&in, w, &skip, n, frames);
        assert_int_equal(sst_liveframes_update(skip.frames, &in, &skip.changes, &skip.report), 0);
        assert_int_equal(sst_liveframes_update(exact.frames, &in, &exact.changes, &exact.report), 0);
        out.worst = fmax(out.worst, worst_difference(&skip, &exact));
        out.whole += n && skip.changes.whole;
        out.idle += !skip.changes.changed;
        if (n)
            out.changed += (double)skip.changes.changed / (double)skip.report.tiles / (sets - 1);
    }
    for (int n = sets; n < sets + WATCHED; n++) {
        struct sst_live_input in;

        expose(&in, w, &skip, n, frames);
        assert_int_equal(sst_liveframes_watch(skip.frames, &in, 5, &skip.changes), 0);
        for (int t = 0; t < skip.changes.cols * skip.changes.rows; t++)
            out.watched += skip.changes.map[5][t];
    }
    print_message("worst tile %.2f levels, %.1f %% of the tiles, %d of %d sets whole\n", out.worst, 100 * out.changed,
                  out.whole, sets);
    close_keeper(&skip);
    close_keeper(&exact);
    sst_sim_world_close(w);
    free(frames);
    return out;
}

#define ARRAY   "grid: [4, 4]\nsize: [320, 240]\nstrip: false\n"
#define SENSORS "sensor: {gain_spread_percent: 3, balance_spread_percent: 2, full_well_e: 12000, read_noise_e: 6}\n"

static void somebody_walks_by(void **state)
{
    const struct outcome o = run("scene: pedestrian\nloop: {seconds: 4, rate_hz: 5}\n" ARRAY, 24);

    (void)state;
    assert_true(o.worst < SST_DETECTOR_BUDGET);
    assert_true(o.changed > 0.02 && o.changed < 0.4);
    assert_true(o.watched > WATCHED);
}

/* Two pictures of the same differ by their noise: kept tiles may differ by it and the budget. */
static double noise_worst;

static void nothing_happens_before_real_cameras(void **state)
{
    const struct outcome o = run("scene: cat\nloop: {seconds: 4, rate_hz: 2.5}\n" ARRAY SENSORS, 24);

    (void)state;
    noise_worst = o.worst;
    assert_true(o.worst < SST_DETECTOR_BUDGET);
    assert_true(o.changed < 1e-3);
    assert_int_equal(o.whole, 0);
}

static void somebody_walks_by_before_real_cameras(void **state)
{
    const struct outcome o =
        run("scene: pedestrian\nlight_percent: 3\nloop: {seconds: 4, rate_hz: 5}\n" ARRAY SENSORS, 24);

    (void)state;
    assert_true(o.worst < SST_DETECTOR_BUDGET + noise_worst);
    assert_true(o.changed > 0.02 && o.changed < 0.5);
}

/* The strip changes in every set. From the 12th one on it is known and read in one set of four. */
static void text_in_frames_is_read_now_and_then(void **state)
{
    const struct outcome o =
        run("scene: cat\nloop: {seconds: 4, rate_hz: 2.5}\ngrid: [4, 4]\nsize: [320, 240]\nstrip: true\n", 44);

    (void)state;
    print_message("%d sets without a change\n", o.idle);
    assert_in_range(o.idle, 15, 24);
    assert_int_equal(o.watched, 0);
}

static int remove_all(void **state)
{
    (void)state;
    sst_path_remove_tree(dir);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(somebody_walks_by),
        plain_test(nothing_happens_before_real_cameras),
        plain_test(somebody_walks_by_before_real_cameras),
        cmocka_unit_test(text_in_frames_is_read_now_and_then),
    };

    if (!mkdtemp(dir))
        return 1;
    return cmocka_run_group_tests(tests, NULL, remove_all);
}
