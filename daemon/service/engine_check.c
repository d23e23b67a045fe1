/* Check of the calibration, once a day and on demand, from the pictures of the cameras, on a thread of its own. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"
#include "pipeline/calibration/drift/drift.h"

#define EVERY_NS INT64_C(86400000000000)
#define FIRST_NS INT64_C(60000000000)

struct work {
    struct live_engine *v;
    struct sst_lightfield lf; /* copies of the images */
};

static int copy(struct sst_lightfield *to, const struct sst_lightfield *from)
{
    int err = sst_lightfield_init(to, from->rows, from->cols);

    if (err)
        return err;
    to->width = from->width;
    to->height = from->height;
    to->ref_view = from->ref_view;
    to->focal_px = from->focal_px;
    to->spacing_mm = from->spacing_mm;
    for (int i = 0; i < from->rows * from->cols && !err; i++)
        if (from->views[i].present && from->views[i].image.plane[0])
            err = sst_view_copy(&to->views[i], &from->views[i]);
    return err;
}

static void *run(void *arg)
{
    struct work *w = arg;
    struct live_engine *v = w->v;
    const struct sst_drift_config cfg = { .threads = 1 };
    struct sst_drift check;
    char why[SST_LOG_MAX] = "";
    int err;

    sst_thread_name("sst-check");
    sst_thread_nice(19);
    sst_log_hold_errors(why);
    err = sst_drift_check(&check, &w->lf, &cfg);
    sst_log_hold_errors(NULL);
    if (err)
        sst_events_emit(v->events, SST_EVENT_WARNING, "calibration", NULL, "the calibration could not be checked: %s",
                        why);
    else
        sst_events_emit(
            v->events,
            check.verdict == SST_DRIFT_OK || check.verdict == SST_DRIFT_UNKNOWN ? SST_EVENT_INFO : SST_EVENT_WARNING,
            "calibration",
            json_pack("{s:s, s:s}", "verdict", sst_drift_verdict_name(check.verdict), "sentence", check.sentence),
            "calibration %s", check.sentence);
    pthread_mutex_lock(&v->lock);
    snprintf(v->state.check, sizeof(v->state.check), "%s%.490s", err ? "UNKNOWN: " : "", err ? why : check.sentence);
    v->state.misaligned = !err && (check.verdict == SST_DRIFT_DRIFTED || check.verdict == SST_DRIFT_UNUSABLE);
    v->check_ended = true;
    pthread_mutex_unlock(&v->lock);
    if (!err)
        sst_drift_fini(&check);
    sst_lightfield_fini(&w->lf);
    free(w);
    return NULL;
}

static void start(struct live_engine *v)
{
    struct work *w = calloc(1, sizeof(*w));
    int err = w ? copy(&w->lf, sst_live_lightfield(v->live)) : -ENOMEM;

    if (!err) {
        w->v = v;
        v->check_ended = false;
        err = -pthread_create(&v->check_thread, NULL, run, w);
        v->check_runs = !err;
    }
    if (err && w) {
        sst_lightfield_fini(&w->lf);
        free(w);
    }
    if (err)
        sst_log_warning("the calibration cannot be checked now: %s", strerror(-err));
}

void engine_check_join(struct live_engine *v)
{
    if (v->check_runs)
        pthread_join(v->check_thread, NULL);
    v->check_runs = false;
}

void engine_check_by_time(struct live_engine *v)
{
    const int64_t now_ns = sst_clock_now_ns();
    bool due, ended;

    pthread_mutex_lock(&v->lock);
    ended = v->check_ended;
    if (!v->check_due_ns)
        v->check_due_ns = v->live_config.calibration ? now_ns + FIRST_NS : INT64_MAX;
    due = now_ns >= v->check_due_ns && v->state.ready && (!v->check_runs || ended);
    if (due)
        v->check_due_ns = v->live_config.calibration ? now_ns + EVERY_NS : INT64_MAX;
    pthread_mutex_unlock(&v->lock);
    if (!due)
        return;
    engine_check_join(v);
    start(v);
}

int engine_calibration_check(void *engine, struct sst_api_answer *out)
{
    struct live_engine *v = engine;
    bool ready, posed;

    pthread_mutex_lock(&v->lock);
    posed = v->state.posed && v->live;
    ready = v->state.ready || posed;
    v->refit |= posed;
    if (ready && !posed)
        v->check_due_ns = 1;
    pthread_mutex_unlock(&v->lock);
    if (!ready)
        return sst_api_refuse(out->error, -ENODATA, "there are no pictures to check by yet");
    out->body = json_pack("{s:b, s:s}", "started", 1, "result", "an event of type calibration, and the status");
    return out->body ? 0 : -ENOMEM;
}
