/* Notices about faulty pictures during capture: one view at a time, copied on the live thread and measured
 * on a thread of its own that yields to everything else. All views once after the start, then one every ten seconds. */
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
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"
#include "pipeline/image/codec.h"

#define FIRST_NS INT64_C(500000000)   /* between two views, until all were measured */
#define EVERY_NS INT64_C(10000000000) /* afterwards */

struct work {
    struct live_engine *v;
    struct sst_view copy;
    int view;
    unsigned count; /* of the light field */
    double quality; /* of its frame; NAN: no JPEG */
};

static void *run(void *arg)
{
    struct work *w = arg;
    struct live_engine *v = w->v;
    struct sst_notice_view found;

    sst_thread_name("sst-notice");
    sst_thread_nice(19);
    sst_notice_view(&found, &w->copy.image, &w->copy.valid);
    if (!isnan(w->quality)) /* traces in pixels that were rectified say less */
        found.quality = w->quality;
    pthread_mutex_lock(&v->lock);
    if (w->count == v->notice_count)
        v->noticed_view[w->view] = found;
    v->notice_ended = true;
    pthread_cond_broadcast(&v->changed); /* a stop waits for it, since it takes some milliseconds */
    pthread_mutex_unlock(&v->lock);
    sst_image_fini(&w->copy.image);
    sst_map_u8_fini(&w->copy.valid);
    free(w);
    return NULL;
}

/* The next view that gives a picture, unmeasured ones first. @return -1: none */
static int next_view(const struct live_engine *v, const struct sst_lightfield *lf)
{
    const int views = lf->rows * lf->cols;
    int found = -1;

    for (int i = views; i >= 1; i--) {
        const int k = (v->notice_at + i) % views;

        if (lf->views[k].present && lf->views[k].image.plane[0] && v->input.frame[k].data &&
            (found < 0 || !v->noticed_view[k].present || v->noticed_view[found].present))
            found = k;
    }
    return found;
}

static int start(struct live_engine *v, int view)
{
    const uint8_t *data = v->input.frame[view].data;
    const size_t bytes = v->input.frame[view].bytes;
    const bool jpeg = bytes > 2 && data[0] == 0xFF && data[1] == 0xD8;
    struct work *w = calloc(1, sizeof(*w));
    int err;

    if (!w)
        return -ENOMEM;
    *w = (struct work){ .v = v, .view = view, .quality = jpeg ? sst_jpeg_quality(data, bytes, "a frame") : NAN };
    w->count = v->notice_count;
    err = sst_view_copy(&w->copy, &sst_live_lightfield(v->live)->views[view]);
    if (!err) {
        pthread_mutex_lock(&v->lock);
        v->notice_ended = false;
        pthread_mutex_unlock(&v->lock);
        err = -pthread_create(&v->notice_thread, NULL, run, w);
        v->notice_runs = !err;
    }
    if (err) {
        pthread_mutex_lock(&v->lock);
        v->notice_ended = true;
        pthread_mutex_unlock(&v->lock);
        sst_image_fini(&w->copy.image);
        sst_map_u8_fini(&w->copy.valid);
        free(w);
    }
    return err;
}

void engine_notice_join(struct live_engine *v)
{
    if (v->notice_runs)
        pthread_join(v->notice_thread, NULL);
    v->notice_runs = false;
}

static bool has(const struct sst_notices *n, const char *what)
{
    for (int i = 0; i < n->count; i++) {
        if (!strcmp(n->notice[i].what, what))
            return true;
    }
    return false;
}

/* Log notices that begin, and that end. */
static void log_changes(const struct sst_notices *before, const struct sst_notices *now)
{
    for (int i = 0; i < now->count; i++) {
        if (!has(before, now->notice[i].what))
            sst_log_warning("%s", now->notice[i].text);
    }
    for (int i = 0; i < before->count; i++) {
        if (!has(now, before->notice[i].what))
            sst_log_info("no longer so: %s", before->notice[i].text);
    }
}

/* Sum up, once every view that gives pictures was measured. */
static void sum_up(struct live_engine *v, const struct sst_lightfield *lf)
{
    struct sst_notices before, now;
    int measured = 0, wanted = 0;
    bool whole;

    pthread_mutex_lock(&v->lock);
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const bool gives = lf->views[k].present; /* a frame within two seconds */

        wanted += gives;
        measured += gives && v->noticed_view[k].present;
        if (!gives)
            v->noticed_view[k].present = false;
    }
    whole = wanted && measured == wanted;
    before = v->state.noticed;
    if (whole) {
        sst_notice_sum(&now, v->noticed_view, lf->rows, lf->cols);
        sst_notice_describe(&now, lf->rows, lf->cols);
        v->state.noticed = now;
        v->state.noticed_views = measured;
    }
    v->notice_whole = whole;
    pthread_mutex_unlock(&v->lock);
    if (whole && v->events) /* not of a recording */
        log_changes(&before, &now);
}

void engine_notice_follow(struct live_engine *v)
{
    const struct sst_lightfield *lf = sst_live_lightfield(v->live);
    const int64_t now_ns = sst_clock_now_ns();
    bool ended;
    int view;

    if (now_ns < v->notice_due_ns)
        return;
    pthread_mutex_lock(&v->lock);
    ended = v->notice_ended && v->state.ready;
    pthread_mutex_unlock(&v->lock);
    if (!ended)
        return;
    engine_notice_join(v);
    sum_up(v, lf);
    v->notice_due_ns = now_ns + (v->notice_whole ? EVERY_NS : FIRST_NS);
    view = next_view(v, lf);
    if (view < 0)
        return;
    v->notice_at = view;
    if (start(v, view))
        sst_log_debug("view %d could not be looked at", view);
}

void engine_notice_forget(struct live_engine *v)
{
    pthread_mutex_lock(&v->lock);
    if (!v->notice_runs)
        v->notice_ended = true;
    v->notice_count++; /* a measurement in progress comes too late */
    memset(v->noticed_view, 0, sizeof(v->noticed_view));
    v->state.noticed = (struct sst_notices){ .edge_px = NAN, .jpeg_quality = NAN, .softest = -1, .first_blank = -1 };
    v->state.noticed_views = 0;
    v->notice_whole = false;
    v->notice_at = -1;
    v->notice_due_ns = 0;
    pthread_mutex_unlock(&v->lock);
}
