/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/rig/rig.h"

#include <errno.h>
#include <stdlib.h>

#include "base/clock.h"
#include "base/log.h"

/* State of a running capture. */
struct job {
    struct sst_rig *rig;
    const struct sst_rig_config *rig_cfg;
    const struct sst_scan_camera *camera;
    struct sst_scan_store *store;
    const struct sst_scan_config *cfg;
    struct sst_scan_report *report;
    struct sst_rig_pos at; /* end of the last move; valid if known */
    bool known;
};

static bool cancelled(const struct job *j)
{
    return j->cfg->cancel && atomic_load(j->cfg->cancel);
}

/* --- one view ----------------------------------------------------------------------------------------------------- */

static int go(struct job *j, struct sst_rig_pos to)
{
    /* Twice the duration of the move at the configured or assumed speed, at least 10 s. */
    const struct sst_rig_pos home = { { 0 } };
    const int timeout_ms = 10000 + (int)(2000 * sst_scan_leg_s(j->rig_cfg, j->known ? &j->at : &home, &to));
    int err = sst_rig_move(j->rig, to);

    err = err ? err : sst_rig_wait(j->rig, timeout_ms);
    j->known = !err;
    j->at = to;
    return err;
}

static int approach(struct job *j, struct sst_rig_pos to)
{
    struct sst_rig_pos via;
    int err = 0;

    if (!sst_rig_homed(j->rig)) {
        j->known = false;
        j->report->homed++;
        sst_log_info("rig: homing");
        err = sst_rig_home(j->rig, j->cfg->home_ms);
    }
    via = sst_scan_approach(j->cfg, j->rig_cfg->axes, j->known ? &j->at : NULL, to);
    for (int a = 0; !err && a < j->rig_cfg->axes; a++) {
        if (via.um[a] != to.um[a]) {
            err = go(j, via);
            break;
        }
    }
    return err ? err : go(j, to);
}

/* Capture a frame with the rig at standstill before, during and after its exposure. @return 0, -EAGAIN (it moved), or
 * an error */
static int expose(struct job *j, struct sst_scan_shot *shot, struct sst_frame **frame)
{
    struct sst_rig_pos before;
    struct sst_frame *f;
    int64_t since_ns;
    int err;

    if (!sst_rig_still(j->rig))
        return -EAGAIN;
    err = sst_rig_position(j->rig, &before);
    if (err)
        return err;
    since_ns = sst_clock_now_ns();
    err = j->camera->expose(j->camera->arg, since_ns + (int64_t)j->cfg->guard_ms * 1000000, j->cfg->camera_ms, &f);
    if (err) {
        j->report->camera_faults += err != -ECANCELED;
        return err;
    }
    /* The rig was at standstill when the frame started and when it arrived, as far as its encoders resolve. */
    if (!sst_rig_still(j->rig) || sst_rig_position(j->rig, &shot->read) || f->t_ns < since_ns)
        err = -EAGAIN;
    for (int a = 0; !err && a < j->rig_cfg->axes; a++) {
        if (abs(shot->read.um[a] - before.um[a]) > j->rig_cfg->tolerance_um)
            err = -EAGAIN;
    }
    if (err)
        j->camera->release(j->camera->arg, f);
    else
        *frame = f;
    return err;
}

static int try_view(struct job *j, int view, struct sst_scan_shot *shot)
{
    struct sst_frame *frame;
    int err = approach(j, shot->asked);

    if (err) {
        j->report->rig_faults += err != -ECANCELED;
        return err;
    }
    err = expose(j, shot, &frame);
    if (err == -EAGAIN) {
        j->report->moved++;
        j->known = false;
        sst_log_warning("view row %d, column %d: the rig was not confirmed at standstill before and after the "
                        "exposure; the frame is dropped",
                        view / j->cfg->cols, view % j->cfg->cols);
    }
    if (err)
        return err;
    err = sst_scan_store_put(j->store, view, shot, j->camera, frame);
    j->camera->release(j->camera->arg, frame);
    return err;
}

/* Faults that a retry cannot fix. */
static bool is_final(int err)
{
    switch (-err) {
    case ECANCELED:
    case EINVAL:
    case ENOMEM:
    case ENOSPC:
    case EROFS:
    case EDQUOT:
    case EFBIG:
    case ENOMEDIUM: /* card full, battery low */
    case ENOPKG:
        return true;
    default:
        return false;
    }
}

static int capture_view(struct job *j, int view)
{
    struct sst_scan_shot shot = { .asked = sst_scan_pose(j->cfg, view) };
    int err = 0;

    for (shot.attempts = 1; shot.attempts <= j->cfg->attempts; shot.attempts++) {
        if (cancelled(j))
            return -ECANCELED;
        err = try_view(j, view, &shot);
        if (!err) {
            j->report->taken++;
            return 0;
        }
        if (is_final(err))
            break;
        j->report->again++;
        if (shot.attempts < j->cfg->attempts)
            sst_log_warning("view row %d, column %d: attempt %d of %d failed; retrying", view / j->cfg->cols,
                            view % j->cfg->cols, shot.attempts, j->cfg->attempts);
    }
    return err;
}

/* --- all views ---------------------------------------------------------------------------------------------------- */

static int capture_all(struct job *j)
{
    const int views = j->cfg->rows * j->cfg->cols;
    int err = 0;

    for (int i = 0; !err && i < views; i++) {
        const int view = sst_scan_view(j->cfg, i);

        if (!sst_scan_store_has(j->store, view))
            err = capture_view(j, view);
        if (!err && j->cfg->progress)
            j->cfg->progress(j->cfg->progress_arg, (i + 1.0) / views);
    }
    return err;
}

int sst_scan_run(const struct sst_scan *scan, struct sst_scan_report *report)
{
    struct sst_scan_store *store = scan->store;
    const struct sst_scan_config *cfg = scan->cfg;
    struct job j = {
        .rig = scan->rig, .rig_cfg = scan->rig_cfg, .camera = scan->camera, .store = store, .cfg = cfg, .report = report
    };
    const int views = cfg->rows * cfg->cols;
    int err = sst_scan_store_check_camera(store, scan->camera);

    *report = (struct sst_scan_report){ .there = sst_scan_store_count(store) };
    if (err)
        return err;
    err = capture_all(&j);
    err = err ? err : sst_scan_store_finish(store);
    sst_rig_counters(scan->rig, &report->rig);
    if (!err)
        return 0;
    (void)sst_rig_stop(scan->rig);
    if (err == -ECANCELED) {
        sst_log_warning("%s: stopped with %d of %d views; run the same command to resume", cfg->dir,
                        sst_scan_store_count(store), views);
        return -EINTR;
    }
    sst_log_error("%s: capture ended with %d of %d views; remove the cause above, then run the same command to resume",
                  cfg->dir, sst_scan_store_count(store), views);
    return err;
}
