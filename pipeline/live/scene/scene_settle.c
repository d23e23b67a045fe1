/* Background computation: its start, and its result applied. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "pipeline/live/scene/scene_internal.h"

/* The background starts when this fraction of the tiles has been static for this time, and enough of it can improve. */
#define STILL_NS       INT64_C(2000000000)
#define STILL_SHARE    0.7
#define BETTER_SHARE   0.05
#define CHECK_EVERY_NS INT64_C(250000000)
/* Pause after a failure of the background. */
#define RETRY_NS INT64_C(60000000000)

/* A run takes all idle time for seconds, and slows what shares a core with it. For little to improve it rests after a
 * run for this multiple of its duration; while sets are left out, and for this time after, for a minute. */
#define REST_TIMES   5
#define MOST_SHARE   0.3
#define CROWDED_NS   INT64_C(2000000000)
#define CROWDED_REST INT64_C(60000000000)

static int64_t rest_ns(const struct sst_livescene *s, int64_t now, bool little)
{
    const int64_t rest = little ? REST_TIMES * s->took_ns : 0;
    const bool crowded = s->crowded_ns && now - s->crowded_ns < CROWDED_NS;

    return crowded && rest < CROWDED_REST ? CROWDED_REST : rest;
}

void scene_start_background(struct sst_livescene *s, bool crowded)
{
    const int64_t now = sst_clock_now_ns();
    int64_t all = 0, still = 0, better = 0;

    s->crowded_ns = crowded ? now : s->crowded_ns;
    if (!s->background || now < s->next_start_ns)
        return;
    s->next_start_ns = now + CHECK_EVERY_NS;
    for (int view = 0; view < s->views; view++) {
        if (!s->lf->views[view].present)
            continue;
        all += s->tiles;
        for (int i = 0; i < s->tiles; i++) {
            const bool stands = now - s->changed_ns[view][i] >= STILL_NS;

            still += stands;
            better += stands && !s->settled[view][i];
        }
    }
    if ((double)still < STILL_SHARE * (double)all || (double)better < BETTER_SHARE * (double)all ||
        now - s->rested_ns < rest_ns(s, now, (double)better < MOST_SHARE * (double)all) ||
        !scene_background_idle(s->background))
        return;
    if (scene_background_start(s->background, s->lf->range_min_px, s->lf->range_max_px)) {
        s->next_start_ns = now + RETRY_NS;
        return;
    }
    s->copied_ns = now;
}

bool sst_livescene_unsettled(struct sst_livescene *s)
{
    return scene_background_done(s->background);
}

/* Convert all maps to a new disparity of stored value 0. */
static void move_zero(struct sst_livescene *s, double before_px)
{
    const int by = (int)lround((before_px - s->lf->disp_min_px) * SST_DISP_SCALE);
    struct sst_map_u16 *maps[SST_MAX_VIEWS + SST_SCENE_KEYS];
    int count = 0;

    for (int view = 0; view < s->views; view++)
        maps[count++] = &s->lf->views[view].disp;
    for (int k = 0; k < s->keys; k++)
        maps[count++] = &s->key[k].maps.disp;
    for (int i = 0; by && i < count; i++) {
        for (int y = 0; y < maps[i]->height; y++) {
            uint16_t *d = sst_map_u16_row(maps[i], y);

            for (int x = 0; x < maps[i]->width; x++)
                d[x] = d[x] == SST_DISP_NONE ? d[x] : (uint16_t)sst_clamp_int(d[x] + by, 0, (int)SST_DISP_MAX_Q6);
        }
    }
}

/* Apply a wider range of the background. @return true: it is searched from now on */
static bool apply_range(struct sst_livescene *s, const struct sst_lightfield *from)
{
    const double before_px = s->lf->disp_min_px;

    if (from->range_min_px >= s->lf->range_min_px && from->range_max_px <= s->lf->range_max_px)
        return false;
    if (scene_set_range(s, from->range_min_px, from->range_max_px)) {
        sst_log_warning("not enough memory to search disparities from %.0f to %.0f px; the range stays %.0f to %.0f px",
                        from->range_min_px, from->range_max_px, s->lf->range_min_px, s->lf->range_max_px);
        return false;
    }
    sst_log_info("disparities found between %.0f and %.0f px", from->range_min_px, from->range_max_px);
    move_zero(s, before_px);
    if (s->foreground && s->lf->disp_min_px != before_px)
        scene_foreground_reset(s->foreground);
    return true;
}

/* Copy one tile of one view. @return number of pixels whose label changed */
static int64_t copy_tile(struct sst_livescene *s, const struct sst_lightfield *from, int view, int tile)
{
    struct sst_view *to = &s->lf->views[view];
    const struct sst_view *v = &from->views[view];
    const int x0 = tile % s->cols * SST_LIVE_TILE, y0 = tile / s->cols * SST_LIVE_TILE;
    const int x1 = sst_min_int(x0 + SST_LIVE_TILE, s->lf->width), y1 = sst_min_int(y0 + SST_LIVE_TILE, s->lf->height);
    const int by = (int)lround((from->disp_min_px - s->lf->disp_min_px) * SST_DISP_SCALE);
    int64_t other = 0;

    for (int y = y0; y < y1; y++) {
        const uint16_t *d = sst_map_u16_row(&v->disp, y);
        uint16_t *out = sst_map_u16_row(&to->disp, y);

        for (int x = x0; x < x1; x++)
            out[x] = d[x] == SST_DISP_NONE ? d[x] : (uint16_t)sst_clamp_int(d[x] + by, 0, (int)SST_DISP_MAX_Q6);
        for (int x = x0; v->label.data && to->label.data && x < x1; x++) {
            uint8_t *label = &sst_map_u8_row(&to->label, y)[x];

            other += *label != sst_map_u8_row(&v->label, y)[x];
            *label = sst_map_u8_row(&v->label, y)[x];
        }
    }
    return other;
}

/* Copy the tile's cells of a key, which improves the maps warped to other views. */
static void copy_cells(struct sst_livescene *s, struct scene_key *key, const struct sst_view *from, int tile)
{
    const struct sst_view *v = &s->lf->views[key->view];
    const int x0 = tile % s->cols * SST_SCENE_CELLS, y0 = tile / s->cols * SST_SCENE_CELLS;
    const int x1 = sst_min_int(x0 + SST_SCENE_CELLS, s->width), y1 = sst_min_int(y0 + SST_SCENE_CELLS, s->height);

    for (int y = y0; y < y1; y++) {
        for (int x = x0; x < x1; x++) {
            sst_map_u16_row(&key->maps.disp, y)[x] = sst_map_u16_row(&v->disp, 2 * y)[2 * x];
            sst_map_u8_row(&key->maps.confirmed, y)[x] = sst_map_u8_row(&from->confidence, 2 * y)[2 * x] > 0;
            if (v->label.data)
                sst_map_u8_row(&key->maps.label, y)[x] = sst_map_u8_row(&v->label, 2 * y)[2 * x];
        }
    }
}

static int key_of(const struct sst_livescene *s, int view)
{
    for (int k = 0; k < s->keys; k++) {
        if (s->key[k].view == view)
            return k;
    }
    return -1;
}

bool sst_livescene_settle(struct sst_livescene *s, struct sst_liveframes_changes *changes)
{
    const struct sst_lightfield *from;
    int64_t taken = 0, other = 0, pixels = 0;

    changes->whole = false;
    changes->changed = 0;
    for (int view = 0; view < s->views; view++) {
        if (changes->map[view])
            memset(changes->map[view], 0, (size_t)s->tiles);
    }
    if (!s->background || !scene_background_done(s->background))
        return false;
    from = scene_background_result(s->background);
    s->rested_ns = sst_clock_now_ns();
    s->took_ns = s->rested_ns - s->copied_ns;
    if (!from) {
        s->next_start_ns = sst_clock_now_ns() + RETRY_NS;
        return false;
    }
    (void)apply_range(s, from);
    for (int view = 0; view < s->views; view++) {
        const int k = key_of(s, view);

        if (!from->views[view].present || !s->lf->views[view].present || !s->planned[view])
            continue;
        for (int i = 0; i < s->tiles; i++) {
            if (s->changed_ns[view][i] > s->copied_ns)
                continue;
            other += copy_tile(s, from, view, i);
            pixels += SST_LIVE_TILE * SST_LIVE_TILE;
            if (k >= 0)
                copy_cells(s, &s->key[k], &from->views[view], i);
            if (k == 0 && s->foreground)
                scene_foreground_settle(s->foreground, &s->key[0], i);
            s->settled[view][i] = true;
            if (changes->map[view])
                changes->map[view][i] = 1;
            taken++;
        }
    }
    scene_background_release(s->background);
    if (s->segmenters && pixels)
        s->error_labels = (double)other / (double)pixels;
    changes->changed = taken;
    return taken > 0;
}
