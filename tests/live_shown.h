/* tests/live_shown.h - a live light field without cameras: its views and maps are those of a simulated scene. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_LIVE_SHOWN_H
#define SST_TESTS_LIVE_SHOWN_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread.h"
#include "pipeline/live/live_internal.h"
#include "simulators/scene/scene.h"
#include "tests/test.h"

struct shown {
    struct sst_live *live;
    struct sst_scene *scene;
    struct sst_liveframes_changes changes;
};

static inline int make_view(void *arg, int k, int worker SST_UNUSED)
{
    struct shown *s = arg;
    struct sst_lightfield *lf = &s->live->lf;
    struct sst_view *v = &lf->views[k];
    struct sst_map_f32 disp = { 0 };
    int err;

    if (!v->present)
        return 0;
    err = v->image.plane[0] ? 0 : sst_image_init(&v->image, lf->width, lf->height);
    err = err || v->disp.data ? err : sst_map_u16_init(&v->disp, lf->width, lf->height);
    err = err || v->label.data ? err : sst_map_u8_init(&v->label, lf->width, lf->height);
    err = err ? err : sst_map_f32_init(&disp, lf->width, lf->height);
    err = err ? err
              : sst_scene_render(s->scene, v->bx, v->by, 0,
                                 &(struct sst_scene_maps){ .image = &v->image, .disp = &disp, .label = &v->label });
    for (int y = 0; !err && y < lf->height; y++) {
        for (int x = 0; x < lf->width; x++)
            sst_map_u16_row(&v->disp, y)[x] = sst_disp_q6(lf, sst_map_f32_row(&disp, y)[x]);
    }
    sst_map_f32_fini(&disp);
    return err;
}

/* The scene at a time: everything changed. */
static inline void set_scene(struct shown *s, const char *name, double time_s)
{
    struct sst_lightfield *lf = &s->live->lf;
    struct sst_scene_config cfg;

    sst_scene_config_defaults(&cfg);
    cfg.width = lf->width;
    cfg.height = lf->height;
    cfg.rows = lf->rows;
    cfg.cols = lf->cols;
    cfg.time_s = time_s;
    sst_scene_destroy(s->scene);
    assert_int_equal(sst_scene_create(&s->scene, name, &cfg), 0);
    sst_scene_range(s->scene, &lf->range_min_px, &lf->range_max_px);
    lf->disp_min_px = floor(lf->range_min_px);
    assert_int_equal(sst_parallel_for(lf->rows * lf->cols, 2, make_view, s), 0);
    s->live->ready = true;
    s->changes.whole = true;
    assert_int_equal(live_ingest(s->live, &s->changes), 0);
    s->changes.whole = false;
}

/* only_outer: the reference view and the corners alone are there. */
static inline void show(struct shown *s, const char *name, int width, int height, int side, bool only_outer)
{
    struct sst_live_config cfg = { .rows = side, .cols = side, .width = width, .height = height, .threads = 2 };
    const int last = side - 1, middle = (side - 1) / 2;

    *s = (struct shown){ .live = calloc(1, sizeof(struct sst_live)) };
    assert_non_null(s->live);
    for (int k = 0; k < side * side; k++) {
        const int row = k / side, col = k % side;

        cfg.present[k] =
            !only_outer || ((row == 0 || row == last) && (col == 0 || col == last)) || (row == middle && col == middle);
    }
    assert_int_equal(live_init(s->live, &cfg), 0);
    assert_int_equal(sst_liveframes_changes_init(&s->changes, &s->live->lf), 0);
    if (name)
        set_scene(s, name, 0);
}

static inline void hide(struct shown *s)
{
    sst_scene_destroy(s->scene);
    sst_liveframes_changes_fini(&s->changes);
    live_fini(s->live);
    free(s->live);
}

static inline void take(struct shown *s, int64_t t_ns)
{
    assert_int_equal(live_ingest(s->live, &s->changes), 0);
    assert_int_equal(live_summarize(s->live, t_ns), 0);
    for (int k = 0; k < s->live->lf.rows * s->live->lf.cols; k++) {
        if (s->changes.map[k])
            memset(s->changes.map[k], 0, (size_t)(s->changes.cols * s->changes.rows));
    }
}

static inline bool same_image(const struct sst_image *a, const struct sst_image *b)
{
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < a->height; y++) {
            if (memcmp(sst_image_row(a, c, y), sst_image_row(b, c, y), (size_t)a->width))
                return false;
        }
    }
    return true;
}

#endif
