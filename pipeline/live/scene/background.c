/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/live/scene/scene_internal.h"
#include "pipeline/method/process/process.h"

/* Longest wait of close. */
#define CLOSE_NS INT64_C(300000000)

/* Abandoned threads that have not ended yet. */
static _Atomic int left_behind;

enum state {
    IDLE = 0,
    WORKING = 1,
    DONE = 2,
    QUIT = 3,
};

struct scene_background {
    /* fixed after open */
    char *model; /* NULL: no labels */
    enum sst_precision precision;
    bool estimates;                    /* the range is estimated */
    const struct sst_lightfield *live; /* the caller's thread alone */
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t wake; /* on CLOCK_MONOTONIC */
    /* Written under lock, read without: the background thread may be preempted for long while it holds the lock, and
     * the render thread must never block on it. */
    _Atomic enum state state;
    /* under lock */
    bool ended, abandoned;
    /* owned by the thread while WORKING, else by the caller */
    bool failed;
    struct sst_lightfield copy;
    struct sst_segmenter *segmenter;
    /* atomic */
    _Atomic bool cancel, done;
};

/* --- thread ------------------------------------------------------------------------------------------------------- */

/* Widen the known range to the range of the current images. */
static void widen_range(struct scene_background *b)
{
    struct sst_lightfield *lf = &b->copy;
    char text[SST_LOG_MAX], *before;
    double min_px, max_px;
    int err;

    if (!b->estimates)
        return;
    before = sst_log_hold_errors(text);
    err = sst_disparity_range(lf, &(struct sst_disparity_search){ .scale = 1, .threads = 1 }, &min_px, &max_px);
    (void)sst_log_hold_errors(before);
    if (err)
        return;
    if (min_px < lf->range_min_px)
        lf->range_min_px = min_px;
    if (max_px > lf->range_max_px)
        lf->range_max_px = max_px;
}

/* Maps as of `sst process --preset balanced`, with a coarser census between pixels. */
static int work(struct scene_background *b)
{
    struct sst_process_config cfg = { .model = b->model,
                                      .precision = b->precision,
                                      .eps_h = -1,
                                      .refine = true,
                                      .threads = 1,
                                      .cancel = &b->cancel,
                                      .segmenters = &b->segmenter };
    int err = sst_disparity_preset(&cfg.disparity, "balanced");

    if (err)
        return err;
    widen_range(b);
    cfg.disparity.disp_min_px = b->copy.range_min_px;
    cfg.disparity.disp_max_px = b->copy.range_max_px;
    cfg.disparity.phase_step = 2; /* as good a picture as quarters give (docs/measured/notes-live.md) */
    cfg.disparity.frugal = true;
    sst_refine_config_defaults(&cfg.refinement);
    return b->cancel ? -ECANCELED : sst_process(&b->copy, &cfg, NULL, NULL);
}

static void free_background(struct scene_background *b)
{
    sst_segmenter_close(b->segmenter);
    sst_lightfield_fini(&b->copy);
    pthread_mutex_destroy(&b->lock);
    pthread_cond_destroy(&b->wake);
    free(b->model);
    free(b);
}

static void *run(void *arg)
{
    struct scene_background *b = arg;
    const struct sched_param none = { 0 };
    bool abandoned;

    /* Run only in idle time. */
    (void)pthread_setschedparam(pthread_self(), SCHED_IDLE, &none);
    pthread_mutex_lock(&b->lock);
    for (;;) {
        int err;

        while (b->state != WORKING && b->state != QUIT)
            pthread_cond_wait(&b->wake, &b->lock);
        if (b->state == QUIT)
            break;
        pthread_mutex_unlock(&b->lock);
        err = work(b);
        b->failed = err != 0;
        pthread_mutex_lock(&b->lock);
        if (b->state == WORKING)
            b->state = DONE;
        b->done = true;
    }
    b->ended = true;
    abandoned = b->abandoned;
    pthread_cond_broadcast(&b->wake);
    pthread_mutex_unlock(&b->lock);
    if (abandoned) {
        free_background(b);
        left_behind--;
    }
    return NULL;
}

/* --- caller ------------------------------------------------------------------------------------------------- */

int scene_background_open(struct scene_background **out, const struct sst_live_config *cfg,
                          const struct sst_lightfield *lf)
{
    struct scene_background *b = calloc(1, sizeof(*b));

    if (!b)
        return -ENOMEM;
    pthread_mutex_init(&b->lock, NULL);
    sst_cond_init(&b->wake);
    b->live = lf;
    b->model = cfg->model ? strdup(cfg->model) : NULL;
    b->precision = cfg->precision;
    b->estimates = !(cfg->range_min_px < cfg->range_max_px);
    if ((cfg->model && !b->model) || sst_lightfield_init(&b->copy, lf->rows, lf->cols) ||
        pthread_create(&b->thread, NULL, run, b)) {
        free_background(b);
        return -ENOMEM;
    }
    *out = b;
    return 0;
}

void scene_background_cancel(struct scene_background *b)
{
    const struct sched_param none = { 0 };

    if (!b)
        return;
    b->cancel = true;
    /* If permitted, it reaches the next cancellation point without waiting for idle time. */
    (void)pthread_setschedparam(b->thread, SCHED_OTHER, &none);
}

void scene_background_close(struct scene_background *b)
{
    const int64_t until_ns = sst_clock_now_ns() + CLOSE_NS;
    pthread_t thread;
    bool ended;

    if (!b)
        return;
    thread = b->thread;
    scene_background_cancel(b);
    pthread_mutex_lock(&b->lock);
    b->state = QUIT;
    pthread_cond_broadcast(&b->wake);
    while (!b->ended && sst_cond_wait_until(&b->wake, &b->lock, until_ns))
        ;
    ended = b->ended;
    b->abandoned = !ended;
    left_behind += !ended;
    pthread_mutex_unlock(&b->lock);
    if (ended) {
        pthread_join(thread, NULL);
        free_background(b);
        return;
    }
    /* Without idle time it may take long to notice the request: then it frees itself when it ends. */
    pthread_detach(thread);
}

int sst_livescene_left_behind(void)
{
    return left_behind;
}

int scene_background_start(struct scene_background *b, double min_px, double max_px)
{
    struct sst_lightfield *lf = &b->copy;
    int err = 0;

    if (b->state != IDLE)
        return -EBUSY;
    lf->width = b->live->width;
    lf->height = b->live->height;
    lf->ref_view = b->live->ref_view;
    lf->focal_px = b->live->focal_px;
    lf->spacing_mm = b->live->spacing_mm;
    lf->infinity_known = b->live->infinity_known;
    lf->infinity_px = b->live->infinity_px;
    memcpy(lf->off_centre_px, b->live->off_centre_px, sizeof(lf->off_centre_px));
    lf->classes = b->live->classes;
    lf->range_min_px = min_px;
    lf->range_max_px = max_px;
    for (int view = 0; !err && view < lf->rows * lf->cols; view++)
        err = sst_view_copy(&lf->views[view], &b->live->views[view]);
    if (err)
        return err;
    pthread_mutex_lock(&b->lock);
    b->state = WORKING;
    pthread_cond_broadcast(&b->wake);
    pthread_mutex_unlock(&b->lock);
    return 0;
}

bool scene_background_idle(struct scene_background *b)
{
    return b->state == IDLE;
}

bool scene_background_done(struct scene_background *b)
{
    return b && b->done;
}

void scene_background_release(struct scene_background *b)
{
    for (int view = 0; view < b->copy.rows * b->copy.cols; view++) {
        struct sst_view *v = &b->copy.views[view];

        sst_map_u16_fini(&v->disp);
        sst_map_u8_fini(&v->label);
        sst_map_u8_fini(&v->confidence);
        sst_image_fini(&v->image); /* hundreds of kilobytes each, unused until the next run */
    }
    pthread_mutex_lock(&b->lock);
    b->state = IDLE;
    b->done = false;
    pthread_mutex_unlock(&b->lock);
}

const struct sst_lightfield *scene_background_result(struct scene_background *b)
{
    if (b->state != DONE)
        return NULL;
    if (!b->failed)
        return &b->copy;
    scene_background_release(b);
    return NULL;
}
