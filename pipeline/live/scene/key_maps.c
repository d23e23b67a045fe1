/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "pipeline/live/scene/scene_internal.h"
#include "pipeline/method/refine/parts.h"

/* Maximum difference of disparities of one surface in two key views: three quarters of a cell. */
#define AGREE_Q6 96
/* Neighbouring cells within this difference are one surface and share labels. */
#define SURFACE_Q6 64
/* Minimum number of cells for the distribution of a label; noise of disparities at half size. */
#define MIN_CELLS 25
#define SIGMA_PX  0.5

struct cell_at {
    int x, y;
};

/* The cell of another view that shows the same surface point; x -1: outside. */
static struct cell_at project(const struct scene_warp *way, const struct sst_map_u16 *there, int x, int y,
                              uint16_t disp_q6)
{
    const int64_t d = way->zero_q6 + disp_q6;
    const struct cell_at to = { x - scene_shift(d, way->bx_q16), y - scene_shift(d, way->by_q16) };
    const bool inside = to.x >= 0 && to.x < there->width && to.y >= 0 && to.y < there->height;

    return inside ? to : (struct cell_at){ -1, 0 };
}

static void check_against(struct scene_key *key, const struct scene_key *other, const struct scene_warp *way,
                          const uint8_t *tiles, int y)
{
    const uint16_t *disp = sst_map_u16_row(&key->maps.disp, y);
    uint8_t *confirmed = sst_map_u8_row(&key->maps.confirmed, y);

    for (int x = 0; x < key->maps.disp.width; x++) {
        struct cell_at to;
        int d;

        if (!tiles[x / SST_SCENE_CELLS]) {
            x |= SST_SCENE_CELLS - 1;
            continue;
        }
        if (confirmed[x] || disp[x] == SST_DISP_NONE)
            continue;
        to = project(way, &other->maps.disp, x, y, disp[x]);
        if (to.x < 0)
            continue;
        d = sst_map_u16_row(&other->maps.disp, to.y)[to.x];
        confirmed[x] = d != (int)SST_DISP_NONE && abs(d - disp[x]) <= AGREE_Q6;
    }
}

void scene_check(struct scene_key *keys, int count, int k, const struct sst_lightfield *lf, struct scene_dirty dirty)
{
    struct scene_key *key = &keys[k];

    for (int y = 0; y < key->maps.confirmed.height; y++) {
        const uint8_t *tiles = dirty.tiles + y / SST_SCENE_CELLS * dirty.cols;
        uint8_t *confirmed = sst_map_u8_row(&key->maps.confirmed, y);

        for (int x = 0; x < key->maps.confirmed.width; x++)
            confirmed[x] = (uint8_t)(tiles[x / SST_SCENE_CELLS] ? 0 : confirmed[x]);
    }
    for (int i = 0; i < count; i++) {
        const struct scene_warp way = scene_warp(lf, key->view, keys[i].view);

        for (int y = 0; i != k && y < key->maps.disp.height; y++)
            check_against(key, &keys[i], &way, dirty.tiles + y / SST_SCENE_CELLS * dirty.cols, y);
    }
}

void scene_transfer_labels(struct scene_key *key, const struct scene_key *ref, const struct sst_lightfield *lf,
                           struct scene_dirty dirty)
{
    const struct scene_warp way = scene_warp(lf, key->view, ref->view);

    for (int y = 0; y < key->maps.disp.height; y++) {
        const uint8_t *tiles = dirty.tiles + y / SST_SCENE_CELLS * dirty.cols;
        const uint16_t *disp = sst_map_u16_row(&key->maps.disp, y);
        uint8_t *label = sst_map_u8_row(&key->maps.label, y);

        for (int x = 0; x < key->maps.disp.width; x++) {
            struct cell_at to;

            if (!tiles[x / SST_SCENE_CELLS])
                continue;
            label[x] = SST_LABEL_NONE;
            if (disp[x] == SST_DISP_NONE)
                continue;
            to = project(&way, &ref->maps.disp, x, y, disp[x]);
            if (to.x >= 0 && abs(sst_map_u16_row(&ref->maps.disp, to.y)[to.x] - disp[x]) <= AGREE_Q6)
                label[x] = sst_map_u8_row(&ref->maps.label, to.y)[to.x];
        }
    }
}

/* Count the disparities of a label. @return number of cells */
static int64_t count_label(int64_t *hist, const struct scene_maps *maps, int label)
{
    int64_t cells = 0;

    for (int y = 0; y < maps->label.height; y++) {
        const uint8_t *l = sst_map_u8_row(&maps->label, y);
        const uint16_t *d = sst_map_u16_row(&maps->disp, y);

        for (int x = 0; x < maps->label.width; x++) {
            if (l[x] != label || d[x] == SST_DISP_NONE)
                continue;
            if (!cells++)
                memset(hist, 0, SST_DISP_BINS * sizeof(*hist));
            hist[d[x]]++;
        }
    }
    return cells;
}

void scene_fit_labels(struct scene_candidates *c, const struct scene_maps *maps, int classes, double disp_min_px,
                      int64_t *hist)
{
    float highest[SST_SCENE_COLUMNS] = { 0 };
    struct sst_refine_config cfg;

    sst_refine_config_defaults(&cfg);
    cfg.min_pixels = MIN_CELLS;
    cfg.matcher_sigma_px = SIGMA_PX;
    *c = (struct scene_candidates){ 0 };
    for (int label = 1; label <= classes; label++) {
        struct sst_label_fit fit;

        if (count_label(hist, maps, label) < MIN_CELLS)
            continue;
        fit = sst_refine_fit_histogram(hist, disp_min_px, &cfg);
        for (int i = 0; i < SST_SCENE_COLUMNS; i++) {
            const double px = disp_min_px + ((i + 0.5) * (1 << SST_SCENE_COLUMN_SHIFT)) / SST_DISP_SCALE;
            const float density = (float)sst_refine_fit_density(&fit, px);

            if (!((double)density > cfg.eps_d))
                continue;
            c->mask[i] |= (uint64_t)1 << (label - 1);
            if (density > highest[i]) {
                highest[i] = density;
                c->best[i] = (uint8_t)label;
            }
        }
    }
}

/* The label of a neighbouring cell if it is on the same surface and a candidate; else 0. */
static uint8_t from_neighbour(const struct scene_maps *maps, const struct scene_candidates *c, int disp_q6, int x,
                              int y)
{
    int label, d;

    if (x < 0 || y < 0 || x >= maps->label.width || y >= maps->label.height)
        return SST_LABEL_NONE;
    label = sst_map_u8_row(&maps->label, y)[x];
    d = sst_map_u16_row(&maps->disp, y)[x];
    if (label == SST_LABEL_NONE || d == (int)SST_DISP_NONE || abs(d - disp_q6) > SURFACE_Q6)
        return SST_LABEL_NONE;
    return c->mask[disp_q6 >> SST_SCENE_COLUMN_SHIFT] >> (label - 1) & 1 ? (uint8_t)label : SST_LABEL_NONE;
}

/* Labels spread to cells without one: rightwards and down (step 1), or leftwards and up (step -1). */
static void spread(struct scene_maps *maps, const struct scene_candidates *c, struct scene_dirty dirty, int step)
{
    const int w = maps->label.width, h = maps->label.height;

    for (int y = step > 0 ? 0 : h - 1; y >= 0 && y < h; y += step) {
        const uint8_t *tiles = dirty.tiles + y / SST_SCENE_CELLS * dirty.cols;
        const uint16_t *disp = sst_map_u16_row(&maps->disp, y);
        uint8_t *label = sst_map_u8_row(&maps->label, y);

        for (int x = step > 0 ? 0 : w - 1; x >= 0 && x < w; x += step) {
            if (!tiles[x / SST_SCENE_CELLS] || label[x] != SST_LABEL_NONE || disp[x] == SST_DISP_NONE)
                continue;
            label[x] = from_neighbour(maps, c, disp[x], x - step, y);
            if (label[x] == SST_LABEL_NONE)
                label[x] = from_neighbour(maps, c, disp[x], x, y - step);
        }
    }
}

void scene_fill_labels(struct scene_maps *maps, const struct scene_candidates *c, struct scene_dirty dirty)
{
    spread(maps, c, dirty, 1);
    spread(maps, c, dirty, -1);
    for (int y = 0; y < maps->label.height; y++) {
        const uint8_t *tiles = dirty.tiles + y / SST_SCENE_CELLS * dirty.cols;
        const uint16_t *disp = sst_map_u16_row(&maps->disp, y);
        uint8_t *label = sst_map_u8_row(&maps->label, y);

        for (int x = 0; x < maps->label.width; x++) {
            if (tiles[x / SST_SCENE_CELLS] && label[x] == SST_LABEL_NONE && disp[x] != SST_DISP_NONE)
                label[x] = c->best[disp[x] >> SST_SCENE_COLUMN_SHIFT];
        }
    }
}
