/* Tracks behind the foreground, joined with the tracks in front of the background: one identity for a person who walks
 * behind the leaves and comes out of them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/live/hidden/hidden.h"
#include "pipeline/live/live_internal.h"

struct live_watch {
    struct sst_hidden *hidden;
    struct live_identities who;
};

int live_watch_open(struct sst_live *live)
{
    struct sst_hidden_config *c;
    int err = -ENOMEM;

    if (!(live->cfg.alarms_per_hour > 0))
        return 0;
    live->watch = calloc(1, sizeof(*live->watch));
    c = calloc(1, sizeof(*c));
    if (live->watch && c) {
        *c = (struct sst_hidden_config){ .views = live->lf.rows * live->lf.cols,
                                         .width = live->lf.width,
                                         .height = live->lf.height,
                                         .alarms_per_hour = live->cfg.alarms_per_hour,
                                         .threads = live->cfg.threads };
        for (int k = 0; k < c->views; k++) {
            c->used[k] = live->lf.views[k].present;
            c->bx[k] = live->lf.views[k].bx;
            c->by[k] = live->lf.views[k].by;
        }
        err = sst_hidden_open(&live->watch->hidden, c);
    }
    free(c);
    if (err == -ENOMEM)
        sst_log_error("live: no memory to search for things behind leaves in %d views of %dx%d pixels",
                      live->lf.rows * live->lf.cols, live->lf.width, live->lf.height);
    if (err == -EINVAL) { /* pictures of this size are not searched */
        live_watch_close(live);
        err = 0;
    }
    return err;
}

void live_watch_close(struct sst_live *live)
{
    if (live->watch)
        sst_hidden_close(live->watch->hidden);
    free(live->watch);
    live->watch = NULL;
}

int live_watch_update(struct sst_live *live, int64_t t_ns)
{
    const struct sst_lightfield *lf = &live->lf;
    struct live_watch *w = live->watch;
    struct sst_live_track open[SST_LIVE_TRACKS];
    struct sst_hidden_thing thing[SST_HIDDEN_THINGS];
    struct sst_hidden_input in = { .t_ns = t_ns };
    int n, things, err;

    if (!w)
        return 0;
    if (live->ready && lf->views[lf->ref_view].disp.data && !isnan(live->min_px)) {
        in.far_px = live->min_px;
        in.near_px = live->max_px;
        in.disp = &lf->views[lf->ref_view].disp;
        in.disp_min_px = lf->disp_min_px;
        for (int k = 0; k < lf->rows * lf->cols; k++) {
            in.image[k] = lf->views[k].present && lf->views[k].image.plane[0] ? &lf->views[k].image : NULL;
            in.changed[k] = live->changes.map[k];
        }
        err = sst_hidden_update(w->hidden, &in);
        if (err)
            return err;
    }
    n = sst_livescene_tracks(live->scene, open);
    things = sst_hidden_things(w->hidden, thing);
    live_identities_update(&w->who, &(struct live_seen){ open, n, thing, things, lf->width, lf->height, t_ns });
    return 0;
}

int live_watch_tracks(const struct sst_live *live, struct sst_live_track track[SST_LIVE_TRACKS])
{
    return live_identities_tracks(&live->watch->who, track);
}
