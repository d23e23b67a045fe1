/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/live/hidden/hidden.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread.h"
#include "pipeline/live/hidden/hidden_internal.h"

#define EARLY_S 30.0
#define KEEP_NS INT64_C(120000000000) /* dwell from which an object becomes background */
/* Sets that follow sooner are searched together with later ones: evidence is a matter of time, not of sets. */
#define SEARCH_NS INT64_C(150000000)
/* Wind: this fraction of all tiles changes in some searches in succession. After so long a calm the model has no
 * colours of leaves that swing, and the background level none of their excess. */
#define WIND_SHARE    0.5
#define WIND_SEARCHES 3
#define CALM_NS       KEEP_NS

struct sst_hidden {
    struct sst_hidden_config cfg;                       /* fixed after open, except for the accepted alarms */
    int step;                                           /* px per cell */
    double dx[SST_MAX_VIEWS], dy[SST_MAX_VIEWS], reach; /* cells per px of disparity */
    struct hidden_model *model[SST_MAX_VIEWS];
    struct hidden_planes planes;
    struct hidden_usual usual;
    struct hidden_tracks tracks;
    /* since the last search */
    uint8_t *changed[SST_MAX_VIEWS]; /* [tiles] */
    int64_t searched_ns;
    bool searched;   /* once */
    int windy;       /* searches in succession with wind, up to WIND_SEARCHES */
    bool blew;       /* wind_ns is valid */
    int64_t wind_ns; /* of the last wind */
    /* of this set */
    const struct sst_hidden_input *in;
    struct sst_rect keep[SST_HIDDEN_THINGS]; /* blocks */
    double keep_px[SST_HIDDEN_THINGS];
    int keeps, stands; /* stands: the first of keep */
};

static int open_model(struct sst_hidden *h, int k)
{
    const int width = (h->cfg.width + h->step - 1) / h->step, height = (h->cfg.height + h->step - 1) / h->step;

    h->dx[k] = h->cfg.bx[k] / h->step;
    h->dy[k] = h->cfg.by[k] / h->step;
    h->reach = fmax(h->reach, fmax(fabs(h->dx[k]), fabs(h->dy[k])));
    int err;

    h->model[k] = calloc(1, sizeof(*h->model[k]));
    err = h->model[k] ? hidden_model_init(h->model[k], width, height, h->step) : -ENOMEM;
    if (err)
        return err;
    h->changed[k] = calloc((size_t)h->model[k]->tiles_x, (size_t)h->model[k]->tiles_y);
    return h->changed[k] ? 0 : -ENOMEM;
}

int sst_hidden_open(struct sst_hidden **out, const struct sst_hidden_config *cfg)
{
    struct sst_hidden *h;
    bool any = false;
    int err = 0;

    for (int k = 0; k < cfg->views && k < SST_MAX_VIEWS; k++)
        any |= cfg->used[k];
    if (!any || cfg->views > SST_MAX_VIEWS || cfg->width < 32 || cfg->height < 32)
        return -EINVAL;
    h = calloc(1, sizeof(*h));
    if (!h)
        return -ENOMEM;
    h->cfg = *cfg;
    h->step = 1;
    while (cfg->width > HIDDEN_WIDTH * h->step && h->step < 8)
        h->step *= 2;
    if (cfg->width > HIDDEN_WIDTH * h->step)
        err = -EINVAL;
    for (int k = 0; k < cfg->views && !err; k++)
        err = cfg->used[k] ? open_model(h, k) : 0;
    err = err ? err
              : hidden_planes_init(&h->planes, (cfg->width + h->step - 1) / h->step,
                                   (cfg->height + h->step - 1) / h->step);
    err = err ? err : hidden_usual_init(&h->usual, h->planes.cols, h->planes.rows);
    hidden_tracks_init(&h->tracks, cfg->alarms_per_hour);
    if (err)
        sst_hidden_close(h);
    else
        *out = h;
    return err;
}

void sst_hidden_close(struct sst_hidden *h)
{
    if (!h)
        return;
    for (int k = 0; k < h->cfg.views; k++) {
        if (h->model[k])
            hidden_model_fini(h->model[k]);
        free(h->model[k]);
        free(h->changed[k]);
    }
    hidden_planes_fini(&h->planes);
    hidden_usual_fini(&h->usual);
    free(h);
}

/* --- a set ----------------------------------------------------------------------------------------------------------
 */

/* Boxes of reported tracks, excluded from background learning. Standing ones come first: colours of passing persons may
 * be learnt. Where a track that moved rests, the level follows: a person stays above it for most of a minute,
 * disturbed leaves for seconds. */
static void find_kept(struct sst_hidden *h)
{
    h->keeps = h->stands = 0;
    for (int n = 0; n < 2 * h->tracks.count; n++) {
        const struct hidden_track *a = &h->tracks.track[n % h->tracks.count];
        const bool stands = !hidden_track_moved(a);

        if (!a->thing.reported || stands != (n < h->tracks.count) || h->in->t_ns - a->thing.first_ns > KEEP_NS ||
            hidden_track_rests(a, h->in->t_ns))
            continue;
        h->stands += stands;
        h->keep_px[h->keeps] = a->thing.disp_px;
        h->keep[h->keeps++] = (struct sst_rect){ (int)floor(a->x - 0.75 * a->w), (int)floor(a->y - 0.75 * a->h),
                                                 (int)ceil(a->x + 0.75 * a->w), (int)ceil(a->y + 0.75 * a->h) };
    }
}

/* Learn the background level as at the start. */
static void begin_again(struct sst_hidden *h)
{
    hidden_usual_reset(&h->usual);
    hidden_tracks_doubt(&h->tracks);
}

static int update_model(void *arg, int k, int worker SST_UNUSED)
{
    struct sst_hidden *h = arg;
    struct hidden_rects r = { .keeps = h->stands };

    if (!h->model[k] || !h->in->image[k])
        return 0;
    for (int i = 0; i < h->stands; i++) {
        const int sx = (int)lround(h->keep_px[i] * h->dx[k]), sy = (int)lround(h->keep_px[i] * h->dy[k]);

        r.keep[i] = (struct sst_rect){ HIDDEN_BLOCK * h->keep[i].x0 - sx, HIDDEN_BLOCK * h->keep[i].y0 - sy,
                                       HIDDEN_BLOCK * h->keep[i].x1 - sx, HIDDEN_BLOCK * h->keep[i].y1 - sy };
    }
    for (int i = 0; i < sst_min_int(h->tracks.lefts, HIDDEN_LEFT); i++) {
        const struct hidden_left *l = &h->tracks.left[i];
        const double x = HIDDEN_BLOCK * l->x - l->disp_px * h->dx[k], y = HIDDEN_BLOCK * l->y - l->disp_px * h->dy[k];

        if (hidden_tracks_left(&h->tracks, l))
            r.wake[r.wakes++] = (struct sst_rect){ (int)(x - HIDDEN_BLOCK * l->w), (int)(y - HIDDEN_BLOCK * l->h),
                                                   (int)(x + HIDDEN_BLOCK * l->w), (int)(y + HIDDEN_BLOCK * l->h) };
    }
    hidden_model_update(h->model[k], &(struct hidden_picture){ h->in->image[k], h->changed[k], h->step }, h->in->t_ns,
                        &r);
    return 0;
}

/* Add the changes of this set. @return any since the last search */
static bool note_changes(struct sst_hidden *h, const struct sst_hidden_input *in)
{
    bool any = false;

    for (int k = 0; k < h->cfg.views; k++) {
        const size_t tiles = h->model[k] ? (size_t)h->model[k]->tiles_x * (size_t)h->model[k]->tiles_y : 0;

        if (!tiles || !in->image[k])
            continue;
        for (size_t i = 0; i < tiles; i++)
            h->changed[k][i] |= !in->changed[k] || in->changed[k][i];
        any |= !h->model[k]->filled || memchr(h->changed[k], 1, tiles);
    }
    return any;
}

static void forget_changes(struct sst_hidden *h)
{
    for (int k = 0; k < h->cfg.views; k++) {
        if (h->model[k] && h->in->image[k])
            memset(h->changed[k], 0, (size_t)h->model[k]->tiles_x * (size_t)h->model[k]->tiles_y);
    }
}

/* Wind after a calm is learnt as the scene is at the start. */
static void follow_wind(struct sst_hidden *h)
{
    size_t changed = 0, all = 0;

    for (int k = 0; k < h->cfg.views; k++) {
        const size_t tiles = h->model[k] ? (size_t)h->model[k]->tiles_x * (size_t)h->model[k]->tiles_y : 0;

        for (size_t i = 0; i < tiles && h->in->image[k] && h->in->changed[k]; i++) /* else it is not known */
            changed += h->changed[k][i] != 0;
        all += h->in->image[k] ? tiles : 0;
    }
    h->windy = (double)changed > WIND_SHARE * (double)all ? sst_min_int(h->windy + 1, WIND_SEARCHES) : 0;
    if (h->windy < WIND_SEARCHES)
        return;
    if (!h->blew || h->in->t_ns - h->wind_ns > CALM_NS) {
        for (int k = 0; k < h->cfg.views; k++)
            if (h->model[k])
                h->model[k]->filled = false;
        begin_again(h);
    }
    h->blew = true;
    h->wind_ns = h->in->t_ns;
}

int sst_hidden_update(struct sst_hidden *h, const struct sst_hidden_input *in)
{
    const struct hidden_model *model[SST_MAX_VIEWS] = { NULL };
    struct hidden_candidate candidate[SST_HIDDEN_THINGS];
    int err, count;

    if (!note_changes(h, in)) {
        hidden_usual_wait(&h->usual, in->t_ns);
        hidden_tracks_wait(&h->tracks, in->t_ns);
        return 0;
    }
    if (h->searched && in->t_ns >= h->searched_ns && in->t_ns - h->searched_ns < SEARCH_NS)
        return 0;
    h->searched = true;
    h->searched_ns = in->t_ns;
    h->in = in;
    find_kept(h);
    follow_wind(h);
    err = sst_parallel_for(h->cfg.views, h->cfg.threads, update_model, h);
    forget_changes(h);
    for (int k = 0; k < h->cfg.views; k++)
        model[k] = h->model[k] && in->image[k] && h->model[k]->filled ? h->model[k] : NULL;
    if (!err && hidden_planes_choose(&h->planes, in, h->reach))
        begin_again(h);
    err = err ? err : hidden_planes_cover(&h->planes, in, h->step, h->cfg.threads);
    err = err ? err
              : hidden_planes_sum(&h->planes, &(struct hidden_views){ model, h->cfg.views, h->dx, h->dy },
                                  h->cfg.threads);
    if (err)
        return err;
    count = hidden_usual_follow(&h->usual, &h->planes, &(struct hidden_kept){ in->t_ns, h->keep, h->keeps },
                                h->cfg.threads, candidate);
    h->tracks.early = h->usual.age_s < EARLY_S;
    hidden_tracks_follow(&h->tracks, candidate, count, &h->planes, in->t_ns);
    return 0;
}

double sst_hidden_threshold(const struct sst_hidden *h)
{
    return hidden_tracks_threshold(&h->tracks);
}

int sst_hidden_things(const struct sst_hidden *h, struct sst_hidden_thing out[SST_HIDDEN_THINGS])
{
    const double px = HIDDEN_BLOCK * h->step;

    for (int i = 0; i < h->tracks.count; i++) {
        const struct hidden_track *a = &h->tracks.track[i];

        out[i] = a->thing;
        out[i].seen = a->seen;
        out[i].x0 = px * (a->x - a->w / 2);
        out[i].y0 = px * (a->y - a->h / 2);
        out[i].x1 = px * (a->x + a->w / 2);
        out[i].y1 = px * (a->y + a->h / 2);
        out[i].vx_px_s = px * a->vx;
        out[i].vy_px_s = px * a->vy;
    }
    return h->tracks.count;
}
