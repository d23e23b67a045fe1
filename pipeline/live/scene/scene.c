/* The steps of an update in order, and the state from set to set. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/live/scene/scene.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/live/scene/scene_internal.h"
#include "pipeline/method/refine/parts.h"

/* Scale of the network input relative to its nominal size: half the work of the whole picture (measured in
 * docs/design/live.md). */
#define LABEL_SCALE 1.0
/* Above this fraction of changed tiles everything is computed. */
#define WHOLE_SHARE 0.8
/* Where this fraction of the disparities at most is confirmed and this one of the tiles moves, as dense leaves do, maps
 * are made only so often: between, pictures show surfaces on which rays agree. More often while something moves in the
 * open, which is shown and followed at the rate of the maps. */
#define LATE_CONFIRMED 0.95
#define LATE_SHARE     0.5
/* While maps wait, less motion lets them wait, too: a gust is not even. */
#define LATE_AGAIN    0.2
#define LATE_AGAIN_NS 1500000000
#define LATE_NS       550000000
#define LATE_TRACK_NS 350000000
/* While something moves behind the leaves, and for a while after it, sets that come as seldom have maps of their own
 * where there is processor time: rays that agree show torn pieces of it. */
#define SELDOM_NS 150000000
#define MOVING_NS 1000000000
/* Part of a box that must have a label. */
#define RECOGNISED 0.15

static void free_maps(struct scene_maps *m)
{
    sst_map_u16_fini(&m->disp);
    sst_map_u8_fini(&m->label);
    sst_map_u8_fini(&m->confirmed);
}

void sst_livescene_close(struct sst_livescene *s)
{
    if (!s)
        return;
    scene_background_close(s->background);
    for (int i = 0; i < s->threads; i++) {
        if (s->composers)
            scene_composer_fini(&s->composers[i]);
        if (s->segmenters)
            sst_segmenter_close(s->segmenters[i]);
    }
    sst_network_device_close(s->networks);
    for (int i = 0; i < SST_SCENE_KEYS; i++) {
        free_maps(&s->key[i].maps);
        free(s->key[i].tile);
        sst_mem_free(s->key[i].packed);
    }
    for (int view = 0; view < s->views; view++) {
        if (s->desc)
            sst_descriptor_fini(&s->desc[view]);
        free(s->dirty[view]);
        free(s->before[view]);
        free(s->changed_ns[view]);
        free(s->settled[view]);
    }
    scene_free_matchers(s);
    free(s->composers);
    free(s->segmenters);
    free(s->desc);
    free(s->jobs);
    free(s->all);
    free(s->candidates);
    scene_foreground_close(s->foreground);
    sst_map_u16_fini(&s->labelled);
    sst_map_u8_fini(&s->labels);
    sst_mem_free(s->hist);
    free(s);
}

static int allocate(struct sst_livescene *s)
{
    int err = 0;

    s->composers = calloc((size_t)s->threads, sizeof(*s->composers));
    s->desc = calloc((size_t)s->views, sizeof(*s->desc));
    s->all = malloc((size_t)s->tiles);
    s->jobs = calloc(1 + SST_SCENE_KEYS * SST_SCENE_RECTS, sizeof(*s->jobs));
    s->candidates = calloc(1, sizeof(*s->candidates));
    s->hist = sst_mem_alloc(SST_DISP_BINS, sizeof(*s->hist));
    if (!s->composers || !s->desc || !s->all || !s->jobs || !s->candidates || !s->hist)
        return -ENOMEM;
    memset(s->all, 1, (size_t)s->tiles);
    for (int i = 0; !err && i < s->threads; i++)
        err = scene_composer_init(&s->composers[i], s->width, s->height);
    for (int view = 0; !err && view < s->views; view++) {
        s->dirty[view] = calloc((size_t)s->tiles, 1);
        s->before[view] = calloc((size_t)s->tiles, 1);
        s->changed_ns[view] = calloc((size_t)s->tiles, sizeof(int64_t));
        s->settled[view] = calloc((size_t)s->tiles, sizeof(bool));
        if (!s->dirty[view] || !s->before[view] || !s->changed_ns[view] || !s->settled[view])
            err = -ENOMEM;
    }
    return err;
}

static int open_labels(struct sst_livescene *s)
{
    const struct sst_segment_config quick = { .scale = LABEL_SCALE };
    int err;

    if (!s->cfg->model)
        return 0;
    s->segmenters = calloc((size_t)s->threads, sizeof(*s->segmenters));
    if (!s->segmenters)
        return -ENOMEM;
    err = s->cfg->device ? sst_network_device_open_live(&s->networks, s->cfg->device, s->cfg->device_label_bytes) : 0;
    err = err ? err : scene_open_segmenter(s, 0);
    if (err)
        return err;
    if (s->cfg->skip_labels)
        sst_segmenter_configure(s->segmenters[0], &quick);
    s->lf->classes = *sst_segmenter_classes(s->segmenters[0]);
    scene_tracks_init(&s->tracks, &s->lf->classes);
    err = scene_foreground_open(&s->foreground, s->width, s->height, s->cols, s->rows);
    if (err)
        sst_log_error("not enough memory to label foreground objects in a view of %dx%d", s->lf->width, s->lf->height);
    return err;
}

int sst_livescene_open(struct sst_livescene **out, const struct sst_live_config *cfg, struct sst_lightfield *lf)
{
    struct sst_livescene *s = calloc(1, sizeof(*s));
    int err;

    if (!s)
        return -ENOMEM;
    s->cfg = cfg;
    s->lf = lf;
    s->threads = sst_thread_count(cfg->threads);
    s->views = lf->rows * lf->cols;
    s->width = (lf->width + 1) / 2;
    s->height = (lf->height + 1) / 2;
    s->cols = (lf->width + SST_LIVE_TILE - 1) / SST_LIVE_TILE;
    s->rows = (lf->height + SST_LIVE_TILE - 1) / SST_LIVE_TILE;
    s->tiles = s->cols * s->rows;
    s->error_labels = s->confirmed = NAN;
    s->rested_ns = sst_clock_now_ns();
    s->tracks.next_id = 1;
    err = allocate(s);
    if (err)
        sst_log_error("not enough memory to track a scene of %d views of %dx%d", s->views, lf->width, lf->height);
    err = err ? err : open_labels(s);
    if (!err && cfg->background)
        err = scene_background_open(&s->background, cfg, lf);
    if (err)
        sst_livescene_close(s);
    else
        *out = s;
    return err;
}

void sst_livescene_cancel(struct sst_livescene *s)
{
    s->cancel = true;
    scene_background_cancel(s->background);
}

/* --- an update ---------------------------------------------------------------------------------------------------- */

static bool beside_changed(const struct sst_livescene *s, int view, int tile)
{
    const int x0 = sst_max_int(tile % s->cols - 1, 0), x1 = sst_min_int(tile % s->cols + 1, s->cols - 1);
    const int y0 = sst_max_int(tile / s->cols - 1, 0), y1 = sst_min_int(tile / s->cols + 1, s->rows - 1);

    for (int y = y0; y <= y1; y++)
        for (int x = x0; x <= x1; x++)
            if (s->dirty[view][y * s->cols + x] == 1)
                return true;
    return false;
}

/* Mark tiles to compute again: see SST_SCENE_AGAIN. */
static void mark_again(struct sst_livescene *s, int view)
{
    for (int i = 0; i < s->tiles; i++) {
        if (!s->dirty[view][i] && s->before[view][i] && beside_changed(s, view, i))
            s->dirty[view][i] = SST_SCENE_AGAIN;
    }
}

/* Mark the tiles to compute. @return their number */
static int64_t mark_dirty(struct sst_livescene *s, const struct sst_liveframes_changes *changes)
{
    const int64_t now = sst_clock_now_ns();
    int64_t all = 0, count = 0;

    for (int view = 0; view < s->views; view++) {
        if (!s->lf->views[view].present) {
            memset(s->dirty[view], 0, (size_t)s->tiles);
            continue;
        }
        for (int i = 0; i < s->tiles; i++) {
            /* New views are already marked. */
            s->dirty[view][i] |= !changes->map[view] || changes->map[view][i];
            count += s->dirty[view][i];
        }
        all += s->tiles;
    }
    s->whole = s->whole_next || !s->ready || changes->whole || (!s->cfg->skip_change && count > 0) ||
               (double)count > WHOLE_SHARE * (double)all;
    for (int view = 0; view < s->views; view++) {
        for (int i = 0; s->lf->views[view].present && i < s->tiles; i++) {
            s->dirty[view][i] |= s->whole;
            if (s->dirty[view][i]) {
                s->changed_ns[view][i] = now;
                s->settled[view][i] = false;
            }
        }
        if (s->lf->views[view].present && !s->whole)
            mark_again(s, view);
    }
    return s->whole ? all : count;
}

/* Report changed tiles: of pictures, and all tiles if everything was computed. */
static void report_changes(const struct sst_livescene *s, struct sst_liveframes_changes *changes)
{
    changes->whole = s->whole;
    changes->changed = 0;
    for (int view = 0; view < s->views; view++) {
        if (!changes->map[view] || !s->lf->views[view].present)
            continue;
        for (int i = 0; i < s->tiles; i++) {
            changes->map[view][i] = s->dirty[view][i] != 0;
            changes->changed += changes->map[view][i];
        }
    }
}

static void clean(struct sst_livescene *s)
{
    for (int view = 0; view < s->views; view++) {
        for (int i = 0; i < s->tiles; i++)
            s->before[view][i] = !s->whole && s->dirty[view][i] == 1;
        memset(s->dirty[view], 0, (size_t)s->tiles);
    }
    memset(s->key_whole, 0, sizeof(s->key_whole));
    s->whole_next = false;
    s->ready = true;
}

/* The age at which maps of moving leaves are made again. */
static int64_t late_ns(const struct sst_livescene *s)
{
    if (s->seldom && s->moving_t_ns && s->t_ns - s->moving_t_ns < MOVING_NS)
        return 0;
    for (int i = 0; i < s->tracks.count; i++)
        if (s->tracks.track[i].reported)
            return LATE_TRACK_NS;
    return LATE_NS;
}

/* The fraction of changed tiles above which they may. */
static double late_share(const struct sst_livescene *s)
{
    return s->late_t_ns && s->t_ns - s->late_t_ns < LATE_AGAIN_NS ? LATE_AGAIN : LATE_SHARE;
}

/* May the maps stay as they are in this set? */
static bool may_wait(const struct sst_livescene *s, int64_t tiles)
{
    int64_t all = 0;

    if (!s->cfg->skip_change || !s->ready || !s->ranged || s->whole_next || !isless(s->confirmed, LATE_CONFIRMED) ||
        s->t_ns - s->maps_t_ns >= late_ns(s) || s->t_ns <= s->maps_t_ns)
        return false;
    for (int k = 0; k < s->keys; k++)
        if (s->key_whole[k])
            return false;
    for (int view = 0; view < s->views; view++) {
        if (s->lf->views[view].present && !s->lf->views[view].disp.data)
            return false;
        all += s->lf->views[view].present ? s->tiles : 0;
    }
    return (double)tiles > late_share(s) * (double)all;
}

/* Compute the changed tiles, as far as possible. */
static int compute_changes(struct sst_livescene *s, struct sst_liveframes_changes *changes,
                           struct sst_live_report *report)
{
    int64_t tiles;
    int err = scene_plan(s);

    if (err)
        return err;
    if (!s->keys) {
        if (!s->logged_alone)
            sst_log_warning("no two neighbouring cameras deliver pictures: disparities need two, so only plain "
                            "refocusing is available");
        s->logged_alone = true;
        s->ready = false;
        return 0;
    }
    s->logged_alone = false;
    tiles = mark_dirty(s, changes);
    if (s->foreground)
        scene_foreground_still(s->foreground, &s->key[0], s->dirty[s->key[0].view]);
    if (!tiles) {
        scene_rest_range(s);
        return 0;
    }
    if (may_wait(s, tiles)) {
        s->late_t_ns = s->t_ns;
        report->late = s->left = true;
        return 0;
    }
    err = scene_find_range(s);
    if (err || !s->ranged)
        return err;
    err = scene_compute(s, report);
    if (err)
        return err;
    report->label_runs = s->label_runs;
    report_changes(s, changes);
    if (s->late_t_ns > s->maps_t_ns && changes->changed > report->tiles_changed)
        report->tiles_changed = changes->changed; /* with the tiles of sets without maps */
    s->maps_t_ns = s->t_ns;
    clean(s);
    report->whole = s->whole;
    return 0;
}

static void follow_tracks(struct sst_livescene *s, int64_t t_ns)
{
    const struct scene_key *key = &s->key[0];
    struct scene_piece piece[SCENE_PIECES];
    int pieces;

    if (!s->foreground || !s->ready || !s->keys)
        return;
    pieces = scene_foreground_pieces(s->foreground, &key->maps, &s->lf->views[key->view].image, piece);
    scene_tracks_update(&s->tracks, piece, pieces, &key->maps.disp, t_ns);
}

int sst_livescene_tracks(const struct sst_livescene *s, struct sst_live_track out[SST_LIVE_TRACKS])
{
    return scene_tracks_list(&s->tracks, s->lf->disp_min_px, out);
}

bool sst_livescene_device(const struct sst_livescene *s, struct sst_network_device_report *out)
{
    if (s->networks)
        sst_network_device_get_report(s->networks, out);
    return s->networks;
}

int sst_livescene_recognise(struct sst_livescene *s, const struct sst_image *image, const double box[4])
{
    const int x0 = sst_clamp_int((int)box[0], 0, image->width), x1 = sst_clamp_int((int)box[2], 0, image->width);
    const int y0 = sst_clamp_int((int)box[1], 0, image->height), y1 = sst_clamp_int((int)box[3], 0, image->height);
    int count[SST_MAX_CLASSES + 1] = { 0 }, best = 0;
    struct sst_map_u8 label = { 0 };

    if (!s->segmenters || sst_segment_hcsm(s->segmenters[0], image, &label))
        return 0;
    for (int y = y0; y < y1; y++) {
        for (int x = x0; x < x1; x++) {
            const int at = sst_map_u8_row(&label, y)[x];

            if (at && at <= SST_MAX_CLASSES && s->tracks.motion[at] == SCENE_MOBILE && ++count[at] > count[best])
                best = at;
        }
    }
    sst_map_u8_fini(&label);
    return count[best] >= RECOGNISED * (x1 - x0) * (y1 - y0) ? best : 0;
}

static void log_memory(void)
{
    sst_log_error("not enough memory to track the scene; the next set is computed from scratch");
}

int sst_livescene_follow(struct sst_livescene *s, struct sst_live_report *report)
{
    int err;

    if (!s->left)
        return 0;
    s->left = false;
    err = scene_label_ahead(s, report);
    report->label_runs_skipped -= report->label_runs;
    s->whole_next |= err != 0;
    if (err == -ENOMEM)
        log_memory();
    return err;
}

int sst_livescene_update(struct sst_livescene *s, struct sst_liveframes_changes *changes,
                         const struct sst_live_input *in, struct sst_live_report *report)
{
    int64_t present = 0;
    int err = scene_cancelled(s);

    report->stage_ns[SST_LIVE_DISPARITY] = report->stage_ns[SST_LIVE_LABELS] = report->stage_ns[SST_LIVE_REFINE] = 0;
    report->label_runs = 0;
    report->whole = report->late = s->left = false;
    s->seldom = !in->crowded && in->t_ns - s->t_ns >= SELDOM_NS;
    s->t_ns = in->t_ns;
    if (in->moving)
        s->moving_t_ns = in->t_ns;
    err = err ? err : compute_changes(s, changes, report);
    for (int view = 0; view < s->views; view++)
        present += s->lf->views[view].present;
    report->label_runs_skipped = s->segmenters ? present - report->label_runs : 0;
    report->ready = s->ready;
    report->alone = s->logged_alone;
    report->error_labels = s->error_labels;
    report->confirmed = s->confirmed;
    s->error_labels = NAN;
    if (err)
        s->whole_next = true;
    else if (s->ready && !in->unseen)
        scene_start_background(s, in->crowded);
    if (!err && !report->late)
        follow_tracks(s, in->t_ns);
    if (err == -ENOMEM)
        log_memory();
    return err;
}
