/* The work of an update as parallel jobs, one thread each. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/thread.h"
#include "pipeline/live/scene/scene_internal.h"

/* The network runs if at least one tile in this number changed in the reference; fewer get the labels around. */
#define LABEL_TILES 100
/* ... and not more often than in every set of this number that changes so much: in between, objects keep the label of
 * earlier votes, the background its own, and other cells theirs while their disparity stays. */
#define LABEL_SETS 4
/* ... and not more often than after this time. */
#define LABEL_NS 350000000
/* ... and where most of the reference moves, as leaves in the wind do, not more often than after this time, whatever
 * appears: pieces of leaves do in every set. */
#define LABEL_MOST_NS 1000000000
/* A cell with a disparity further from that at which it was labelled shows another surface. */
#define LABEL_Q6 96
/* Label distributions are fitted again with every whole set and after this number of network runs. */
#define FIT_RUNS 4

int scene_open_segmenter(struct sst_livescene *s, int worker)
{
    int err;

    if (s->segmenters[worker])
        return 0;
    err = sst_segmenter_open(&s->segmenters[worker], s->cfg->model, s->cfg->precision, 1);
    if (!err)
        sst_segmenter_use_runner(s->segmenters[worker], s->networks);
    return err;
}

static bool any(const uint8_t *tiles, int count)
{
    return memchr(tiles, 1, (size_t)count) != NULL;
}

/* The first changed tile of a row of tiles, and the one after the last. @return false: none has changed */
static bool row_extent(const struct sst_livescene *s, int view, int y, int *x0, int *x1)
{
    const uint8_t *tiles = s->dirty[view] + y * s->cols;

    *x0 = 0;
    *x1 = s->cols;
    while (*x0 < *x1 && tiles[*x0] != 1)
        ++*x0;
    while (*x1 > *x0 && tiles[*x1 - 1] != 1)
        --*x1;
    return *x0 < *x1;
}

/* The next cells below r that contain changed tiles: a run of rows of tiles that changed in about the same columns, so
 * that describing them together takes less than apart. @return false: none */
static bool changed_part(const struct sst_livescene *s, int view, struct sst_rect *r)
{
    int y = (r->y1 + SST_SCENE_CELLS - 1) / SST_SCENE_CELLS, x0, x1, next0, next1, y0;

    while (y < s->rows && !row_extent(s, view, y, &x0, &x1))
        y++;
    if (y >= s->rows)
        return false;
    for (y0 = y++; y < s->rows && row_extent(s, view, y, &next0, &next1); y++) {
        const int both0 = sst_min_int(x0, next0), both1 = sst_max_int(x1, next1);

        if (2 * (both1 - both0) * (y + 1 - y0) > 2 * (x1 - x0) * (y - y0) + 3 * (next1 - next0))
            break;
        x0 = both0;
        x1 = both1;
    }
    *r = (struct sst_rect){ x0 * SST_SCENE_CELLS, y0 * SST_SCENE_CELLS, sst_min_int(x1 * SST_SCENE_CELLS, s->width),
                            sst_min_int(y * SST_SCENE_CELLS, s->height) };
    return true;
}

static unsigned phases_of(const struct sst_livescene *s, int view)
{
    unsigned phases = 0;

    for (int k = 0; k < s->keys; k++) {
        const struct sst_view *key = &s->lf->views[s->key[k].view];

        for (int i = 0; i < s->key[k].neighbours; i++) {
            if (s->key[k].neighbour[i] == view)
                phases |= sst_volume_phases(&s->matchers[0].volume, s->lf->views[view].bx - key->bx,
                                            s->lf->views[view].by - key->by);
        }
    }
    return phases;
}

static int describe_job(void *arg, int view, int worker SST_UNUSED)
{
    struct sst_livescene *s = arg;
    const struct sst_view *v = &s->lf->views[view];
    struct sst_descriptor *d = &s->desc[view];
    struct sst_rect r = { 0 };
    int err = scene_cancelled(s);

    if (err || !s->described[view])
        return err;
    if (d->luma.data) {
        while (!err && changed_part(s, view, &r))
            err = sst_descriptor_update(d, &v->image, (struct sst_rect){ r.x0, r.y0, r.x1, r.y1 });
        return err ? err : sst_descriptor_add_phases(d, phases_of(s, view));
    }
    err = sst_descriptor_init(d, &v->image, 2, SST_COST_CENSUS, NULL);
    if (!err && v->valid.data)
        err = sst_disparity_mask_reduce(&d->seen, &v->valid, 2);
    return err ? err : sst_descriptor_add_phases(d, phases_of(s, view));
}

/* Tiles of a key to match. */
static const uint8_t *dirty_of(const struct sst_livescene *s, int k)
{
    return s->key_whole[k] ? s->all : s->dirty[s->key[k].view];
}

static int run_network(struct sst_livescene *s)
{
    const int64_t start_ns = sst_clock_now_ns();
    const int err = sst_segment_hcsm(s->segmenters[0], &s->desc[s->key[0].view].image, &s->labels);

    s->label_ns = sst_clock_now_ns() - start_ns;
    s->label_runs += !err;
    return err;
}

static int match_job(void *arg, int index, int worker)
{
    struct sst_livescene *s = arg;
    const struct scene_job *job = &s->jobs[index];
    const int err = scene_cancelled(s);

    if (err)
        return err;
    if (job->key < 0)
        return run_network(s);
    return scene_match(&s->matchers[worker], &(struct scene_pictures){ s->lf, s->desc }, &s->key[job->key], &job->rect,
                       (struct scene_dirty){ dirty_of(s, job->key), s->cols });
}

static int area(const struct sst_rect *r)
{
    return (r->x1 - r->x0) * (r->y1 - r->y0);
}

static int larger_first(const void *a, const void *b)
{
    return area(&((const struct scene_job *)b)->rect) - area(&((const struct scene_job *)a)->rect);
}

/* Is it time for the network? */
static bool label_due(struct sst_livescene *s, int changed)
{
    if (!s->segmenters || !s->cfg->skip_labels || !changed || LABEL_TILES * changed < s->tiles)
        return false;
    if (s->labelled.data && !s->whole_next && s->ready) {
        const int64_t since_ns = s->t_ns - s->label_t_ns;

        if (s->label_wait > 1) {
            s->label_wait--;
            return false;
        }
        if ((s->label_wait == 1 && since_ns < LABEL_NS) || (2 * changed > s->tiles && since_ns < LABEL_MOST_NS))
            return false;
    }
    s->label_wait = LABEL_SETS;
    s->label_t_ns = s->t_ns;
    return true;
}

static int changed_tiles(const struct sst_livescene *s)
{
    int changed = 0;

    for (int i = 0; i < s->tiles; i++)
        changed += dirty_of(s, 0)[i] == 1;
    return changed;
}

int scene_label_ahead(struct sst_livescene *s, struct sst_live_report *report)
{
    int err = 0;

    s->label_ns = 0;
    s->label_runs = 0;
    if (!s->labels.data && label_due(s, changed_tiles(s))) {
        err = describe_job(s, s->key[0].view, 0);
        err = err ? err : run_network(s);
    }
    report->stage_ns[SST_LIVE_LABELS] = s->label_ns;
    report->label_runs = s->label_runs;
    return err;
}

/* Is the network left to sets without maps of their own? */
static bool label_later(const struct sst_livescene *s)
{
    return s->labels.data || (s->late_t_ns && s->t_ns - s->late_t_ns < LABEL_MOST_NS);
}

/* The network and the rectangles of all keys, longest jobs first. @return their number */
static int make_jobs(struct sst_livescene *s)
{
    struct sst_rect rects[SST_SCENE_RECTS];
    int count = 0;

    if (!label_later(s) && label_due(s, changed_tiles(s)))
        s->jobs[count++] = (struct scene_job){ -1, { 0, 0, 2 * s->width, s->height } };
    for (int k = 0; k < s->keys; k++) {
        const int n =
            scene_gather(rects, (struct scene_dirty){ dirty_of(s, k), s->cols }, s->rows, s->width, s->height);

        for (int i = 0; i < n; i++)
            s->jobs[count++] = (struct scene_job){ k, rects[i] };
    }
    qsort(s->jobs, (size_t)count, sizeof(*s->jobs), larger_first);
    return count;
}

static int check_job(void *arg, int k, int worker SST_UNUSED)
{
    struct sst_livescene *s = arg;

    if (any(dirty_of(s, k), s->tiles))
        scene_check(s->key, s->keys, k, s->lf, (struct scene_dirty){ dirty_of(s, k), s->cols });
    return scene_cancelled(s);
}

/* Fraction of the disparities of the keys that another key confirms. */
static double count_confirmed(const struct sst_livescene *s)
{
    int64_t known = 0, confirmed = 0;

    for (int k = 0; k < s->keys; k++) {
        const struct scene_maps *m = &s->key[k].maps;

        for (int y = 0; y < m->disp.height; y++) {
            const uint16_t *disp = sst_map_u16_row(&m->disp, y);
            const uint8_t *row = sst_map_u8_row(&m->confirmed, y);
            int n[2] = { 0, 0 };

            for (int x = 0; x < m->disp.width; x++) {
                n[0] += disp[x] != SST_DISP_NONE;
                n[1] += row[x];
            }
            known += n[0];
            confirmed += n[1];
        }
    }
    return known && s->keys > 1 ? (double)confirmed / (double)known : NAN;
}

/* Copy the network labels to changed tiles of the reference key. */
static void copy_labels(struct sst_livescene *s, const uint8_t *dirty)
{
    struct scene_maps *maps = &s->key[0].maps;

    for (int y = 0; y < maps->label.height; y++) {
        const uint8_t *from = sst_map_u8_row(&s->labels, y), *tiles = dirty + y / SST_SCENE_CELLS * s->cols;
        const uint16_t *disp = sst_map_u16_row(&maps->disp, y);
        uint16_t *at = sst_map_u16_row(&s->labelled, y);
        uint8_t *to = sst_map_u8_row(&maps->label, y);

        for (int x = 0; x < maps->label.width; x++) {
            if (!tiles[x / SST_SCENE_CELLS])
                continue;
            to[x] = from[x];
            at[x] = disp[x];
        }
    }
}

/* Without new network labels: changed cells that show another surface lose theirs. */
static void drop_labels(struct sst_livescene *s, const uint8_t *dirty)
{
    struct scene_maps *maps = &s->key[0].maps;

    for (int y = 0; y < maps->label.height; y++) {
        const uint8_t *tiles = dirty + y / SST_SCENE_CELLS * s->cols;
        const uint16_t *disp = sst_map_u16_row(&maps->disp, y);
        uint16_t *at = sst_map_u16_row(&s->labelled, y);
        uint8_t *label = sst_map_u8_row(&maps->label, y);

        for (int x = 0; x < maps->label.width; x++) {
            if (!tiles[x / SST_SCENE_CELLS] || abs(disp[x] - at[x]) <= LABEL_Q6)
                continue;
            label[x] = SST_LABEL_NONE;
            at[x] = disp[x];
        }
    }
}

/* Label the reference key: labels of network, background and objects, and gaps filled. */
static int label_reference(struct sst_livescene *s)
{
    struct scene_maps *maps = &s->key[0].maps;
    const uint8_t *dirty = dirty_of(s, 0);
    const int err = s->labelled.data ? 0 : sst_map_u16_init(&s->labelled, s->width, s->height);

    if (err)
        return err;
    if (s->labels.data)
        copy_labels(s, dirty);
    else
        drop_labels(s, dirty);
    if (s->whole)
        scene_foreground_reset(s->foreground);
    if (scene_foreground_label(s->foreground, &s->key[0], s->candidates, dirty, s->labels.data != NULL))
        s->label_wait = 0;
    s->runs += s->labels.data != NULL;
    if (s->labels.data && (s->whole || s->runs >= FIT_RUNS)) {
        scene_fit_labels(s->candidates, maps, s->lf->classes.count, s->lf->disp_min_px, s->hist);
        s->runs = 0;
    }
    sst_map_u8_fini(&s->labels);
    scene_fill_labels(maps, s->candidates, (struct scene_dirty){ dirty, s->cols });
    return 0;
}

static int label_job(void *arg, int index, int worker SST_UNUSED)
{
    struct sst_livescene *s = arg;
    struct scene_key *key = &s->key[index + 1];
    const uint8_t *dirty = dirty_of(s, index + 1);

    if (any(dirty, s->tiles)) {
        scene_transfer_labels(key, &s->key[0], s->lf, (struct scene_dirty){ dirty, s->cols });
        scene_fill_labels(&key->maps, s->candidates, (struct scene_dirty){ dirty, s->cols });
    }
    return scene_cancelled(s);
}

static int measure_job(void *arg, int k, int worker SST_UNUSED)
{
    struct sst_livescene *s = arg;

    scene_measure_tiles(&s->key[k]);
    return scene_cancelled(s);
}

static int compose_job(void *arg, int view, int worker)
{
    struct sst_livescene *s = arg;
    int err = scene_cancelled(s);

    if (!err && s->lf->views[view].present)
        scene_compose(&s->composers[worker], s->lf, view,
                      &(struct scene_keys){ s->key, s->keys, s->cfg->model != NULL }, s->dirty[view]);
    return err;
}

/* Without S4: run the network on every changed view; pixels of low confidence keep the warped label. */
static int segment_job(void *arg, int view, int worker)
{
    struct sst_livescene *s = arg;
    struct sst_view *v = &s->lf->views[view];
    struct sst_map_u8 label = { 0 };
    int err = scene_cancelled(s);

    if (err || !v->present || !any(s->dirty[view], s->tiles))
        return err;
    err = scene_open_segmenter(s, worker);
    err = err ? err : sst_segment_hcsm(s->segmenters[worker], &v->image, &label);
    s->label_runs += !err;
    for (int y = 0; !err && y < label.height; y++) {
        const uint8_t *from = sst_map_u8_row(&label, y), *tiles = s->dirty[view] + y / SST_LIVE_TILE * s->cols;
        const uint8_t *valid = v->valid.data ? sst_map_u8_row(&v->valid, y) : NULL;
        uint8_t *to = sst_map_u8_row(&v->label, y);

        for (int x = 0; x < label.width; x++) {
            if (tiles[x / SST_LIVE_TILE] && from[x] != SST_LABEL_NONE && (!valid || valid[x]))
                to[x] = from[x];
        }
    }
    sst_map_u8_fini(&label);
    return err;
}

/* Nanoseconds since *from; sets *from to now. */
static int64_t lap(int64_t *from)
{
    const int64_t now = sst_clock_now_ns(), took = now - *from;

    *from = now;
    return took;
}

/* Disparities of all dirty tiles of the keys. */
static int match_keys(struct sst_livescene *s)
{
    const int err = sst_parallel_for(make_jobs(s), s->threads, match_job, s);

    return err ? err : sst_parallel_for(s->keys, s->threads, check_job, s);
}

int scene_compute(struct sst_livescene *s, struct sst_live_report *report)
{
    int64_t clock = sst_clock_now_ns();
    int err = sst_parallel_for(s->views, s->threads, describe_job, s);
    bool wider = false;

    s->label_ns = 0;
    s->label_runs = 0;
    if (s->key_whole[0]) /* labels ahead are of another view */
        sst_map_u8_fini(&s->labels);
    err = err ? err : match_keys(s);
    err = err ? err : scene_follow_range(s, &wider);
    if (!err && wider)
        err = match_keys(s);
    if (!err)
        s->confirmed = count_confirmed(s);
    report->stage_ns[SST_LIVE_DISPARITY] = lap(&clock);
    if (!err && s->segmenters) {
        err = label_reference(s);
        err = err ? err : sst_parallel_for(s->keys - 1, s->threads, label_job, s);
    }
    err = err ? err : sst_parallel_for(s->keys, s->threads, measure_job, s);
    err = err ? err : sst_parallel_for(s->views, s->threads, compose_job, s);
    report->stage_ns[SST_LIVE_REFINE] = lap(&clock);
    if (!err && s->segmenters && !s->cfg->skip_labels) {
        err = sst_parallel_for(s->views, s->threads, segment_job, s);
        s->label_ns = lap(&clock);
    }
    report->stage_ns[SST_LIVE_LABELS] = s->label_ns;
    sst_map_u8_fini(&s->labels);
    return err;
}
