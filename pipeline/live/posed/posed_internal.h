/* pipeline/live/posed/posed_internal.h - private declarations of this folder. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIVE_POSED_POSED_INTERNAL_H
#define SST_PIPELINE_LIVE_POSED_POSED_INTERNAL_H

#include <pthread.h>

#include "base/log.h"
#include "pipeline/live/posed/posed.h"
#include "pipeline/posed/ground.h"
#include "pipeline/posed/render.h"

/* --- fit.c: the ground, found on a thread of its own --- */

/** Zeroed: none runs. */
struct posed_fit {
    bool running; /* live thread: the thread is to be joined */
    pthread_t thread;
    SST_ATOMIC(bool) done, canceled;
    /* of the thread while it runs */
    struct sst_posed posed; /* copies of the views' poses and pictures */
    struct sst_deep picture[SST_MAX_VIEWS];
    struct sst_virtual camera;
    struct sst_ground_config cfg;
    struct sst_posed_ground ground;
    int err;
    char why[SST_LOG_MAX]; /* it failed */
};

/** Copy the placed views and start. @return 0, -ENOMEM, -EAGAIN; not logged */
SST_MUST_CHECK int posed_fit_start(struct posed_fit *fit, const struct sst_posed *posed,
                                   const struct sst_virtual *camera, const struct sst_ground_config *cfg);
/** Wait for its end, and free the copies. */
void posed_fit_end(struct posed_fit *fit);

/* --- state --- */

#define POSED_PLACES 4 /* surfaces with kept places */

struct posed_places {
    struct sst_integral_places *places; /* NULL: free */
    struct sst_surface surface;
    uint64_t used; /* serial of the last picture on it */
};

struct sst_liveposed {
    /* fixed after open */
    const struct sst_live_config *cfg;
    struct sst_lightfield *lf;
    struct sst_posed all; /* poses of all cameras */
    struct sst_virtual camera;
    double near_mm, far_mm; /* of the ground's limits; 0: by the points of the scene */
    double start_mm;        /* distance of pictures until the ground is known */
    /* live thread */
    struct sst_posed now; /* views with a picture are placed */
    struct sst_deep picture[SST_MAX_VIEWS];
    uint64_t serial; /* of the last change of a view or of the surface */
    bool known;
    struct sst_posed_ground ground; /* of a plane that is given: the distance and the plane alone */
    double reach_mm[2];             /* nearest and farthest distance of the focus; 0: not known */
    int64_t fitted_ns, due_ns;      /* due_ns: of the next fit */
    char why[SST_LOG_MAX];          /* the last fit failed */
    struct posed_fit fit;
    struct sst_integral *integral; /* NULL until the first picture */
    struct posed_places places[POSED_PLACES];
    struct sst_liveposed_picture last; /* weighted picture that was rendered last, for clients with the same settings */
};

/** The surface for a focus; 0 or NaN: the fitted one, before that a plane at start_mm. */
struct sst_surface posed_surface(const struct sst_liveposed *p, double focus_px);

#endif
