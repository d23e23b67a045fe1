/* pipeline/live: an object enters that is closer than the range of disparities found so far. The picture is compared
 * with the truth from the first set on. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/live/picture/picture_internal.h"
#include "pipeline/live/scene/scene_internal.h"
#include "tests/live_shown.h"

#define SIDE   4
#define WIDTH  320
#define HEIGHT 240
#define FROM_S 2.4 /* no pedestrian; from 2.7 s on one view after the other has one at its edge */
#define STEP_S 0.1
#define SETS   6

struct bench {
    struct sst_live *live;
    struct sst_liveframes_changes changes;
    struct sst_scene *scene;
    struct sst_image now[SIDE * SIDE];
};

static void open_bench(struct bench *b)
{
    struct sst_live_config cfg = {
        .rows = SIDE, .cols = SIDE, .width = WIDTH, .height = HEIGHT, .threads = 2, .skip_change = true
    };

    *b = (struct bench){ .live = calloc(1, sizeof(struct sst_live)) };
    assert_non_null(b->live);
    for (int k = 0; k < SIDE * SIDE; k++)
        cfg.present[k] = true;
    assert_int_equal(live_init(b->live, &cfg), 0);
    for (int k = 0; k < SIDE * SIDE; k++) {
        assert_int_equal(sst_image_init(&b->live->lf.views[k].image, WIDTH, HEIGHT), 0);
        assert_int_equal(sst_image_init(&b->now[k], WIDTH, HEIGHT), 0);
    }
    assert_int_equal(sst_liveframes_changes_init(&b->changes, &b->live->lf), 0);
    assert_int_equal(sst_livescene_open(&b->live->scene, &b->live->cfg, &b->live->lf), 0);
}

static void close_bench(struct bench *b)
{
    sst_scene_destroy(b->scene);
    for (int k = 0; k < SIDE * SIDE; k++)
        sst_image_fini(&b->now[k]);
    sst_livescene_close(b->live->scene);
    sst_liveframes_changes_fini(&b->changes);
    live_fini(b->live);
    free(b->live);
}

static int draw_view(void *arg, int k, int worker SST_UNUSED)
{
    struct bench *b = arg;
    const struct sst_view *v = &b->live->lf.views[k];

    return sst_scene_render(b->scene, v->bx, v->by, 0, &(struct sst_scene_maps){ .image = &b->now[k] });
}

/* Copy the new picture of a view and mark its tiles that differ. */
static void update_view(struct bench *b, int k)
{
    struct sst_image *image = &b->live->lf.views[k].image;
    uint8_t *map = b->changes.map[k];

    memset(map, 0, (size_t)(b->changes.cols * b->changes.rows));
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < HEIGHT; y++) {
            uint8_t *was = sst_image_row(image, c, y);
            const uint8_t *is = sst_image_row(&b->now[k], c, y);

            for (int x = 0; x < WIDTH; x++) {
                if (was[x] != is[x])
                    map[y / SST_LIVE_TILE * b->changes.cols + x / SST_LIVE_TILE] = 1;
                was[x] = is[x];
            }
        }
    }
    for (int i = 0; i < b->changes.cols * b->changes.rows; i++)
        b->changes.changed += map[i];
}

static void take_set(struct bench *b, int set)
{
    const struct sst_live_input in = { .t_ns = (int64_t)(set * STEP_S * 1e9) };
    struct sst_live_report report = { 0 };
    struct sst_scene_config cfg;

    sst_scene_config_defaults(&cfg);
    cfg.width = WIDTH;
    cfg.height = HEIGHT;
    cfg.rows = cfg.cols = SIDE;
    cfg.time_s = FROM_S + set * STEP_S;
    sst_scene_destroy(b->scene);
    assert_int_equal(sst_scene_create(&b->scene, "pedestrian", &cfg), 0);
    assert_int_equal(sst_parallel_for(SIDE * SIDE, 2, draw_view, b), 0);
    b->changes.whole = !set;
    b->changes.changed = 0;
    for (int k = 0; k < SIDE * SIDE; k++)
        update_view(b, k);
    assert_int_equal(sst_livescene_update(b->live->scene, &b->changes, &in, &report), 0);
    assert_true(report.ready);
    b->live->ready = true;
    b->live->confirmed = report.confirmed;
    assert_int_equal(live_ingest(b->live, &b->changes), 0);
    assert_int_equal(live_summarize(b->live, in.t_ns), 0);
}

/* Percent of the picture that is off by more than 40 levels from the truth: with everybody, or without who is removed.
 */
static double wrong(const struct bench *b, const struct sst_image *image, bool removed)
{
    struct sst_image truth = { 0 };
    int n = 0;

    assert_int_equal(sst_image_init(&truth, WIDTH, HEIGHT), 0);
    assert_int_equal(sst_scene_render(b->scene, 0, 0, removed, &(struct sst_scene_maps){ .image = &truth }), 0);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            int most = 0;

            for (int c = 0; c < 3; c++)
                most = sst_max_int(most, abs(sst_image_row(image, c, y)[x] - sst_image_row(&truth, c, y)[x]));
            n += most > 40;
        }
    }
    sst_image_fini(&truth);
    return 100.0 * n / (WIDTH * HEIGHT);
}

static void who_is_nearer_than_all_before_leaves_nothing(void **state SST_UNUSED)
{
    struct sst_livepicture_clear shown;
    const struct sst_image *image;
    struct sst_render_config cfg;
    struct sst_livepicture *p;
    struct bench b;
    double at_first = 0;
    int64_t px;

    open_bench(&b);
    sst_render_config_defaults(&cfg);
    cfg.method = SST_RENDER_CLEAR;
    cfg.cut_px = NAN;
    assert_int_equal(sst_livepicture_create(&p, b.live), 0);
    for (int set = 0; set < SETS; set++) {
        double percent;

        take_set(&b, set);
        assert_int_equal(sst_livepicture_render(p, &cfg, &image, &px), 0);
        sst_livepicture_clear(p, &shown);
        percent = wrong(&b, image, !isnan(shown.cut_px));
        at_first = set ? at_first : percent;
        if (getenv("SST_VERBOSE"))
            printf("%.1f s: %.0f to %.0f px, cut %.1f px, wrong %.2f %%\n", FROM_S + STEP_S * set,
                   b.live->lf.range_min_px, b.live->lf.range_max_px, shown.cut_px, percent);
        assert_true(percent < at_first + 1);
    }
    assert_true(b.live->lf.range_max_px > 20);
    sst_livepicture_destroy(p);
    close_bench(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(who_is_nearer_than_all_before_leaves_nothing) };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
