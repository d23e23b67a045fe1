/* Arrays without a lattice: their poses, and the surface of their pictures. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <linux/videodev2.h>

#include "daemon/service/engine_internal.h"
#include "pipeline/posed/array.h"

int engine_posed_describe(struct live_engine *v, const struct sst_live_settings *settings)
{
    const struct sst_array_config *a = &v->layout.config;
    const bool grey = a->fourcc == V4L2_PIX_FMT_GREY || a->fourcc == V4L2_PIX_FMT_Y16;
    const struct sst_posed_array array = { a->rows, a->cols, a->width, a->height, grey ? 1 : 3 };
    int err;

    if (!settings->poses[0])
        return 0;
    err = sst_posed_array_read(&v->poses, settings->poses, &array);
    if (err)
        return err;
    v->live_config.posed = (struct sst_live_posed){
        .poses = &v->poses,
        .plane_mm = 1000 * settings->surface_m,
        .near_mm = 1000 * settings->near_m,
        .far_mm = 1000 * settings->far_m,
        .every_s = 60 * settings->fit_every_min,
        .compare_px = settings->compare_px,
    };
    return 0;
}

void engine_posed_follow(struct live_engine *v)
{
    struct sst_live_surface surface = { .known = false };
    const bool posed = sst_live_surface(v->live, &surface);
    bool found, refit;

    pthread_mutex_lock(&v->lock);
    refit = v->refit;
    v->refit = false;
    found = posed && surface.fitted_ns != v->state.surface.fitted_ns && surface.fitted_ns;
    v->state.surface = surface;
    if (posed) {
        v->state.ready = surface.known;
        snprintf(v->state.reason, sizeof(v->state.reason), "%.510s", surface.why);
    }
    pthread_mutex_unlock(&v->lock);
    if (refit && posed && sst_live_refit(v->live))
        sst_log_info("live: the plane is given by live: surface_m, nothing is fitted");
    if (found && v->events)
        sst_events_emit(v->events, SST_EVENT_INFO, "calibration",
                        json_pack("{s:f, s:f}", "distance_m", surface.distance_mm / 1000, "tilt_deg",
                                  surface.tilt_deg),
                        "the ground is %.2f m before the middle camera, tilted by %.1f degrees",
                        surface.distance_mm / 1000, surface.tilt_deg);
}
