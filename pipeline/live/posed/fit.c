/* The ground, found on a thread of its own: pictures go on meanwhile. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/live/posed/posed_internal.h"

#include <errno.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread.h"

#define NICE 10

static void *run(void *arg)
{
    struct posed_fit *fit = arg;
    char *before;

    sst_thread_name("sst-ground");
    sst_thread_nice(NICE);
    before = sst_log_hold_errors(fit->why);
    fit->err = sst_posed_ground(&fit->ground, &fit->posed, "live", &fit->camera, &fit->cfg);
    sst_log_hold_errors(before);
    atomic_store(&fit->done, true);
    return NULL;
}

static void free_copies(struct posed_fit *fit)
{
    free(fit->posed.view);
    free(fit->posed.points);
    fit->posed = (struct sst_posed){ 0 };
    for (int k = 0; k < SST_MAX_VIEWS; k++)
        sst_deep_fini(&fit->picture[k]);
}

static int copy_views(struct posed_fit *fit, const struct sst_posed *posed)
{
    const size_t views = (size_t)posed->count * sizeof(*posed->view);
    const size_t points = (size_t)posed->point_count * sizeof(*posed->points);

    fit->posed = *posed;
    fit->posed.view = malloc(views);
    fit->posed.points = points ? malloc(points) : NULL;
    fit->posed.picture = fit->picture;
    if (!fit->posed.view || (points && !fit->posed.points))
        return -ENOMEM;
    memcpy(fit->posed.view, posed->view, views);
    if (points)
        memcpy(fit->posed.points, posed->points, points);
    for (int k = 0; k < posed->count; k++) {
        const struct sst_deep *from = &posed->picture[k];
        int err;

        if (!posed->view[k].camera.known)
            continue;
        err = sst_deep_init(&fit->picture[k], from->width, from->height, from->channels, from->white);
        if (err)
            return err;
        for (int c = 0; c < from->channels; c++)
            memcpy(fit->picture[k].plane[c].data, from->plane[c].data,
                   from->plane[c].stride * (size_t)from->height);
    }
    return 0;
}

int posed_fit_start(struct posed_fit *fit, const struct sst_posed *posed, const struct sst_virtual *camera,
                    const struct sst_ground_config *cfg)
{
    int err = copy_views(fit, posed);

    fit->camera = *camera;
    fit->cfg = *cfg;
    fit->cfg.canceled = &fit->canceled;
    fit->why[0] = 0;
    atomic_store(&fit->done, false);
    err = err ? err : -pthread_create(&fit->thread, NULL, run, fit);
    fit->running = !err;
    if (err)
        free_copies(fit);
    return err;
}

void posed_fit_end(struct posed_fit *fit)
{
    if (!fit->running)
        return;
    pthread_join(fit->thread, NULL);
    fit->running = false;
    atomic_store(&fit->done, false);
    free_copies(fit);
}
