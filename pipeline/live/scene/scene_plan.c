/* Choice of the key views, and the range of disparities. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/mem.h"
#include "pipeline/live/scene/scene_internal.h"

#define RETRY_NS INT64_C(2000000000)
/* Something may be nearer than the range if this fraction of the changed cells of the reference (of at least one tile
 * in CHANGED) is not confirmed by another key: 1 % is usual, 25 to 40 % means out of range. An estimate costs as much
 * as three sets: after one without a new result, the number of such sets until the next one grows fourfold each time;
 * after a static phase it starts again at the minimum. */
#define UNCONFIRMED_SHARE 0.15
#define CHANGED           33
#define SCAN_FIRST        2
#define SCAN_MOST         512
#define REST_SETS         100
/* The range grows if two estimates, of two views or of consecutive sets, exceed it by more than their accuracy. */
#define NEARER_PX 2.0

/* --- key views ---------------------------------------------------------------------------------------------------- */

static int make_key(struct sst_livescene *s, struct scene_key *key, int view)
{
    struct scene_maps *m = &key->maps;
    int err = 0;

    key->view = view;
    key->neighbours = scene_neighbours(s->lf, view, key->neighbour);
    if (!m->disp.data) {
        err = sst_map_u16_init(&m->disp, s->width, s->height);
        err = err ? err : sst_map_u8_init(&m->label, s->width, s->height);
        err = err ? err : sst_map_u8_init(&m->confirmed, s->width, s->height);
    }
    if (!err && !key->tile) {
        key->tile = calloc((size_t)s->tiles, sizeof(*key->tile));
        key->packed = sst_mem_alloc_raw((size_t)s->width * (size_t)s->height, sizeof(*key->packed));
        err = key->tile && key->packed ? 0 : -ENOMEM;
    }
    if (!err)
        memset(m->disp.data, 0xFF, m->disp.stride * (size_t)m->disp.height);
    return err;
}

/* Maps of a new view: unknown everywhere. */
static int make_view_maps(struct sst_livescene *s, struct sst_view *v)
{
    int err = 0;

    if (!v->disp.data) {
        err = sst_map_u16_init(&v->disp, s->lf->width, s->lf->height);
        if (!err)
            memset(v->disp.data, 0xFF, v->disp.stride * (size_t)v->disp.height);
    }
    if (!err && s->cfg->model && !v->label.data)
        err = sst_map_u8_init(&v->label, s->lf->width, s->lf->height);
    return err;
}

/* Choose the keys again; earlier keys keep their maps. */
static int choose_keys(struct sst_livescene *s)
{
    int views[SST_SCENE_KEYS], err = 0;
    const int count = scene_choose_keys(s->lf, views);

    for (int i = 0; !err && i < count; i++) {
        int at = i;

        while (at < s->keys && s->key[at].view != views[i])
            at++;
        if (at < s->keys) {
            const struct scene_key swap = s->key[i];
            const bool whole = s->key_whole[i];

            s->key[i] = s->key[at];
            s->key_whole[i] = s->key_whole[at];
            s->key[at] = swap;
            s->key_whole[at] = whole;
            s->key[i].neighbours = scene_neighbours(s->lf, views[i], s->key[i].neighbour);
            continue;
        }
        err = make_key(s, &s->key[i], views[i]);
        s->key_whole[i] = true;
    }
    s->keys = err ? 0 : count;
    return err;
}

int scene_plan(struct sst_livescene *s)
{
    bool same = true;
    int err = 0;

    for (int view = 0; view < s->views; view++)
        same = same && s->planned[view] == s->lf->views[view].present;
    if (same)
        return 0;
    for (int view = 0; !err && view < s->views; view++) {
        if (!s->lf->views[view].present)
            continue;
        err = make_view_maps(s, &s->lf->views[view]);
        if (!s->planned[view])
            memset(s->dirty[view], 1, (size_t)s->tiles);
    }
    err = err ? err : choose_keys(s);
    memset(s->described, 0, sizeof(s->described));
    for (int k = 0; !err && k < s->keys; k++) {
        s->described[s->key[k].view] = true;
        for (int i = 0; i < s->key[k].neighbours; i++)
            s->described[s->key[k].neighbour[i]] = true;
    }
    for (int view = 0; !err && view < s->views; view++) {
        s->planned[view] = s->lf->views[view].present;
        /* Recomputed when needed again. */
        if (!s->described[view])
            sst_descriptor_fini(&s->desc[view]);
    }
    return err;
}

/* --- the range ---------------------------------------------------------------------------------------------------- */

void scene_free_matchers(struct sst_livescene *s)
{
    for (int i = 0; s->matchers && i < s->threads; i++)
        scene_matcher_fini(&s->matchers[i]);
    free(s->matchers);
    s->matchers = NULL;
}

int scene_set_range(struct sst_livescene *s, double min_px, double max_px)
{
    struct scene_matcher *made = calloc((size_t)s->threads, sizeof(*made));
    int err = made ? 0 : -ENOMEM;

    for (int i = 0; !err && i < s->threads; i++)
        err = scene_matcher_init(&made[i], min_px, max_px, s->width, s->height);
    if (err) {
        for (int i = 0; made && i < s->threads; i++)
            scene_matcher_fini(&made[i]);
        free(made);
        return err;
    }
    scene_free_matchers(s);
    s->matchers = made;
    s->lf->range_min_px = min_px;
    s->lf->range_max_px = max_px;
    scene_tracks_shift(&s->tracks, (int)lround((s->lf->disp_min_px - scene_disp_min(min_px)) * SST_DISP_SCALE));
    s->lf->disp_min_px = scene_disp_min(min_px);
    return 0;
}

/* Near end of the range by one view of this set. @return 0, -ENODATA (no texture), -ENOMEM */
static int estimate_near(const struct sst_livescene *s, int view, double *near_px)
{
    const struct sst_disparity_search search = { .scale = 2, .threads = s->threads, .from = view + 1 };
    char text[SST_LOG_MAX], *before = sst_log_hold_errors(text);
    double min_px;
    const int err = sst_disparity_range(s->lf, &search, &min_px, near_px);

    (void)sst_log_hold_errors(before);
    return err;
}

/* A view diagonally beside one: it shares no pair of neighbours with it. @return -1: none */
static int beside(const struct sst_lightfield *lf, int view)
{
    for (int i = 0; i < 4; i++) {
        const int col = view % lf->cols + (i % 2 ? -1 : 1), row = view / lf->cols + (i / 2 ? -1 : 1);

        if (col >= 0 && col < lf->cols && row >= 0 && row < lf->rows && lf->views[row * lf->cols + col].present)
            return row * lf->cols + col;
    }
    return -1;
}

/* The same by a view and, where that exceeds `enough_px`, one beside it: the nearer end that both agree on.
 * @param view_px  out: by the view alone; 0: none @param both_px  out: 0: none */
static int estimate_agreed(const struct sst_livescene *s, int view, double enough_px, double *view_px, double *both_px)
{
    const int other = beside(s->lf, view);
    int err = estimate_near(s, view, view_px);

    *both_px = 0;
    if (err)
        *view_px = 0;
    if (!err && *view_px >= enough_px && other >= 0) {
        err = estimate_near(s, other, both_px);
        *both_px = err ? 0 : fmin(*view_px, *both_px);
    }
    return err == -ENODATA ? 0 : err;
}

/* Disparities that the outer keys see nearer than the reference view does. */
static int widen_by_keys(const struct sst_livescene *s, double *max_px)
{
    int err = 0;

    for (int k = 1; !err && k < s->keys; k++) {
        double view_px, both_px;

        err = estimate_agreed(s, s->key[k].view, *max_px + NEARER_PX, &view_px, &both_px);
        *max_px = fmax(*max_px, both_px >= *max_px + NEARER_PX ? both_px : 0);
    }
    return err;
}

int scene_find_range(struct sst_livescene *s)
{
    double min_px = s->cfg->range_min_px, max_px = s->cfg->range_max_px;
    char text[SST_LOG_MAX], *before;
    int err;

    if (s->ranged)
        return 0;
    if (!(min_px < max_px)) {
        if (sst_clock_now_ns() < s->next_range_ns)
            return 0;
        before = sst_log_hold_errors(text);
        err = sst_disparity_range(s->lf, &(struct sst_disparity_search){ .scale = 1, .threads = s->threads }, &min_px,
                                  &max_px);
        (void)sst_log_hold_errors(before);
        if (err && err != -ENODATA)
            return err;
        if (err) {
            if (!s->logged_range)
                sst_log_warning("the pictures have too little texture to estimate disparities; see-through starts when "
                                "they have enough, or set live.range_min_px and live.range_max_px");
            s->logged_range = true;
            s->next_range_ns = sst_clock_now_ns() + RETRY_NS;
            return 0;
        }
        err = widen_by_keys(s, &max_px);
        if (err)
            return err;
        sst_log_info("disparities found between %.0f and %.0f px", min_px, max_px);
    }
    err = scene_set_range(s, min_px, max_px);
    s->ranged = !err;
    return err;
}

/* Extend the near end of the range by an estimate from this set. */
static int extend_range(struct sst_livescene *s, bool *wider)
{
    const double enough_px = s->lf->range_max_px + NEARER_PX, last_px = s->nearer_px;
    double near_px, both_px;
    int err = estimate_agreed(s, s->unconfirmed_view, enough_px, &near_px, &both_px);

    s->nearer_px = near_px;
    if (err)
        return err;
    both_px = fmax(both_px, fmin(near_px, last_px));
    if (near_px < enough_px) {
        s->scan_in = s->scan_every;
        s->scan_every = sst_min_int(4 * s->scan_every, SCAN_MOST);
        return 0;
    }
    s->scan_in = 0;
    if (both_px < enough_px)
        return 0;
    s->scan_every = SCAN_FIRST;
    sst_log_info("disparities found up to %.0f px", both_px);
    err = scene_set_range(s, s->lf->range_min_px, both_px);
    *wider = !err;
    return err;
}

/* Fraction of the changed cells of a key that no other key confirms; 0: too few changed. */
static double unconfirmed(const struct sst_livescene *s, const struct scene_key *key)
{
    const struct scene_maps *maps = &key->maps;
    const uint8_t *dirty = s->dirty[key->view];
    int tiles = 0, cells = 0, n = 0;

    for (int i = 0; i < s->tiles; i++) {
        const int x0 = i % s->cols * SST_SCENE_CELLS, y0 = i / s->cols * SST_SCENE_CELLS;
        const int x1 = sst_min_int(x0 + SST_SCENE_CELLS, s->width), y1 = sst_min_int(y0 + SST_SCENE_CELLS, s->height);

        if (dirty[i] != 1)
            continue;
        tiles++;
        for (int y = y0; y < y1; y++)
            for (int x = x0; x < x1; x++, cells++)
                n += !sst_map_u8_row(&maps->confirmed, y)[x];
    }
    return CHANGED * tiles < s->tiles ? 0 : (double)n / cells;
}

void scene_rest_range(struct sst_livescene *s)
{
    s->rested = sst_min_int(s->rested + 1, REST_SETS);
}

int scene_follow_range(struct sst_livescene *s, bool *wider)
{
    *wider = false;
    if (s->cfg->range_min_px < s->cfg->range_max_px)
        return 0;
    if (s->rested == REST_SETS || !s->scan_every) {
        s->scan_every = SCAN_FIRST;
        s->scan_in = 0;
    }
    s->rested = 0;
    s->unconfirmed_share = 0;
    for (int k = 0; k < s->keys; k++) {
        const double share = unconfirmed(s, &s->key[k]);

        if (share > s->unconfirmed_share) {
            s->unconfirmed_share = share;
            s->unconfirmed_view = s->key[k].view;
        }
    }
    if (s->whole || s->unconfirmed_share < UNCONFIRMED_SHARE || s->scan_in-- > 0)
        return 0;
    return extend_range(s, wider);
}
