/* tests/live_truth.h - compares a label of the live maps with the truth of a simulated world, and formats the result.
 *
 * For tools and benches. One zone counts: all of the picture below the simulator's strip. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_LIVE_TRUTH_H
#define SST_TESTS_LIVE_TRUTH_H

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/storage/storage_internal.h"
#include "pipeline/live/live.h"
#include "simulators/scene/scene.h"
#include "simulators/scene/world/settings.h"

#define LIVE_TRUTH_TOP     0.125 /* share of the picture above the zone */
#define LIVE_TRUTH_VIEWS   5     /* the reference and the corners */
#define LIVE_TRUTH_FRAMES  64    /* of a loop at most */
#define LIVE_TRUTH_WATCHES 5

static const double live_truth_shares[LIVE_TRUTH_WATCHES] = { 0.005, 0.01, 0.02, 0.04, 0.08 };

/** Pixels of the zone that bear the label: in truth, of these in the live maps, and in these without being it. */
struct live_truth_count {
    int64_t true_, hit, wrong, all;
};

struct live_truth {
    struct sst_sim_settings settings;
    int label, frames, sets;
    int view[LIVE_TRUTH_VIEWS];
    struct sst_map_u8 map[LIVE_TRUTH_FRAMES][LIVE_TRUTH_VIEWS]; /* empty until it is needed */
    /* over all sets */
    struct live_truth_count ref, corners;
    double miss_most, error2, spurious; /* of shares: largest miss, sum of squares, largest without anybody */
    struct event_trigger seen[LIVE_TRUTH_WATCHES], is[LIVE_TRUTH_WATCHES], motion;
    int told[LIVE_TRUTH_WATCHES][2], due[LIVE_TRUTH_WATCHES][2], moved[2]; /* times that they ended, began */
};

/** @return 0, -EINVAL (no scene with a truth) or what reading the world returns */
static inline int live_truth_init(struct live_truth *t, const char *world, int label)
{
    int err;

    memset(t, 0, sizeof(*t));
    err = sst_sim_settings_read(&t->settings, world);
    if (err)
        return err;
    t->label = label;
    t->frames = (int)lround(t->settings.loop_s * t->settings.rate_hz);
    if (t->frames < 1 || t->frames > LIVE_TRUTH_FRAMES || !strcmp(t->settings.scene, "board"))
        return -EINVAL;
    for (int i = 0; i < LIVE_TRUTH_WATCHES; i++) {
        t->seen[i] = t->is[i] = (struct event_trigger){ .share = live_truth_shares[i], .label = "x" };
        t->motion = (struct event_trigger){ .share = EVENT_TRIGGER_SHARE };
    }
    t->view[0] = (t->settings.rows - 1) / 2 * t->settings.cols + (t->settings.cols - 1) / 2;
    t->view[1] = 0;
    t->view[2] = t->settings.cols - 1;
    t->view[3] = (t->settings.rows - 1) * t->settings.cols;
    t->view[4] = t->settings.rows * t->settings.cols - 1;
    return 0;
}

static inline void live_truth_fini(struct live_truth *t)
{
    for (int i = 0; i < LIVE_TRUTH_FRAMES; i++)
        for (int k = 0; k < LIVE_TRUTH_VIEWS; k++)
            sst_map_u8_fini(&t->map[i][k]);
}

/** True labels of frame i of the loop. */
static inline int live_truth_make(struct live_truth *t, const struct sst_lightfield *lf, int i)
{
    struct sst_scene_config cfg;
    struct sst_scene *scene = NULL;
    int err;

    if (t->map[i][0].data)
        return 0;
    sst_scene_config_defaults(&cfg);
    cfg.width = lf->width;
    cfg.height = lf->height;
    cfg.seed = t->settings.seed;
    cfg.rows = t->settings.rows;
    cfg.cols = t->settings.cols;
    cfg.time_s = i / t->settings.rate_hz;
    err = sst_scene_create(&scene, t->settings.scene, &cfg);
    for (int k = 0; k < LIVE_TRUTH_VIEWS && !err; k++) {
        const struct sst_view *v = &lf->views[t->view[k]];

        err = sst_map_u8_init(&t->map[i][k], lf->width, lf->height);
        err = err ? err : sst_scene_render(scene, v->bx, v->by, 0, &(struct sst_scene_maps){ .label = &t->map[i][k] });
    }
    sst_scene_destroy(scene);
    return err;
}

static inline struct live_truth_count live_truth_compare(const struct sst_map_u8 *is, const struct sst_map_u8 *seen,
                                                         int label)
{
    struct live_truth_count c = { 0 };

    for (int y = (int)(LIVE_TRUTH_TOP * is->height); y < is->height; y++) {
        const uint8_t *a = sst_map_u8_row(is, y), *b = sst_map_u8_row(seen, y);

        for (int x = 0; x < is->width; x++, c.all++) {
            c.true_ += a[x] == label;
            c.hit += a[x] == label && b[x] == label;
            c.wrong += a[x] != label && b[x] == label;
        }
    }
    return c;
}

static inline void live_truth_add(struct live_truth_count *to, const struct live_truth_count *c)
{
    to->true_ += c->true_;
    to->hit += c->hit;
    to->wrong += c->wrong;
    to->all += c->all;
}

static inline double live_truth_percent(int64_t part, int64_t all)
{
    return all ? 100.0 * (double)part / (double)all : NAN;
}

static inline void live_truth_watch(struct event_trigger *w, double value, int64_t t_ns, int count[2])
{
    (void)event_trigger_update(w, value, t_ns);
    if (event_trigger_report(w, value, t_ns))
        count[w->reported]++;
}

/** After an update with zone 0 from LIVE_TRUTH_TOP down: one line of a table, and the sums. */
static inline int live_truth_add_set(struct live_truth *t, const struct sst_lightfield *lf,
                                     const struct sst_live_report *report, int64_t shown_ns, int64_t t_ns)
{
    const int frame = (int)(floor((double)shown_ns * 1e-9 * t->settings.rate_hz + 1e-6)) % t->frames;
    struct live_truth_count ref, corners = { 0 };
    double share, is;
    int err = live_truth_make(t, lf, frame);

    if (err || !lf->views[t->view[0]].label.data)
        return err;
    ref = live_truth_compare(&t->map[frame][0], &lf->views[t->view[0]].label, t->label);
    for (int k = 1; k < LIVE_TRUTH_VIEWS; k++) {
        const struct live_truth_count c = live_truth_compare(&t->map[frame][k], &lf->views[t->view[k]].label, t->label);

        live_truth_add(&corners, &c);
    }
    live_truth_add(&t->ref, &ref);
    live_truth_add(&t->corners, &corners);
    is = (double)ref.true_ / (double)ref.all;
    share = (double)report->zone[0].label[t->label];
    t->sets++;
    t->error2 += (share - is) * (share - is);
    t->miss_most = fmax(t->miss_most, is - share);
    t->spurious = ref.true_ ? t->spurious : fmax(t->spurious, share);
    for (int i = 0; i < LIVE_TRUTH_WATCHES; i++) {
        live_truth_watch(&t->seen[i], share, t_ns, t->told[i]);
        live_truth_watch(&t->is[i], is, t_ns, t->due[i]);
    }
    live_truth_watch(&t->motion, report->zone[0].changed, t_ns, t->moved);
    printf("  share %5.2f %% of true %5.2f %%; right %5.1f %%, corners %5.1f %%; too much %.2f %%, corners %.2f %%\n",
           100 * share, 100 * is, live_truth_percent(ref.hit, ref.true_),
           live_truth_percent(corners.hit, corners.true_), live_truth_percent(ref.wrong, ref.all),
           live_truth_percent(corners.wrong, corners.all));
    return 0;
}

static inline void live_truth_print(const struct live_truth *t)
{
    printf(
        "\n| of the label | reference | corners |\n|---|---|---|\n"
        "| its pixels that bear it | %.1f %% | %.1f %% |\n| pixels that bear it and are not it, of its own | %.1f %% "
        "| %.1f %% |\n",
        live_truth_percent(t->ref.hit, t->ref.true_), live_truth_percent(t->corners.hit, t->corners.true_),
        live_truth_percent(t->ref.wrong, t->ref.true_), live_truth_percent(t->corners.wrong, t->corners.true_));
    printf("share against truth: RMS %.2f %%, at most %.2f %% too little, at most %.2f %% with nobody there\n",
           100 * sqrt(t->error2 / fmax(t->sets, 1)), 100 * t->miss_most, 100 * t->spurious);
    printf("\n| share asked for | began, ended | by the truth |\n|---|---|---|\n");
    for (int i = 0; i < LIVE_TRUTH_WATCHES; i++)
        printf("| %.3f | %d, %d | %d, %d |\n", live_truth_shares[i], t->told[i][1], t->told[i][0], t->due[i][1],
               t->due[i][0]);
    printf("| any change, %.2f | %d, %d (times: %d) | |\n", EVENT_TRIGGER_SHARE, t->moved[1], t->moved[0],
           t->motion.times);
}

#endif
