/* Parts of the reference view: which tiles changed in them, and which labels they show. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/live/live_internal.h"

#define COUNT_COLS 320 /* about this number of pixels of a row is counted */
#define TILE_STEP  4   /* px: between the points of a tile that are tried */
#define DEPTH_STEP 8
#define ALL        SST_LIVE_ZONES /* the whole view, after the zones */

/* Does a ray to the right meet an odd number of edges? */
static bool has_point(const struct sst_live_zone *z, double x, double y)
{
    bool in = false;

    for (int i = 0, k = z->points - 1; i < z->points; k = i++)
        if ((z->y[i] > y) != (z->y[k] > y) &&
            x < (z->x[k] - z->x[i]) * (y - z->y[i]) / (z->y[k] - z->y[i]) + z->x[i])
            in = !in;
    return in;
}

static bool is_limited(const struct sst_live_zone *z)
{
    return !isinf(z->near_px) || !isinf(z->far_px);
}

bool sst_live_zone_has(const struct sst_live_zone *zone, double x, double y, double disp_px)
{
    return has_point(zone, x, y) && disp_px <= zone->near_px && disp_px >= zone->far_px;
}

static bool is_valid(const struct sst_live_zone *z)
{
    bool valid = z->points >= 3 && z->points <= SST_LIVE_ZONE_POINTS && z->far_px < z->near_px;
    double area = 0;

    if (!z->points)
        return z->far_px < z->near_px;
    for (int i = 0, k = z->points - 1; valid && i < z->points; k = i++) {
        valid = z->x[i] >= 0 && z->x[i] <= 1 && z->y[i] >= 0 && z->y[i] <= 1;
        area += z->x[k] * z->y[i] - z->x[i] * z->y[k];
    }
    return valid && fabs(area) > 1e-9;
}

/* --- tiles -------------------------------------------------------------------------------------------------------- */

static bool overlaps(const struct sst_live *live, const struct sst_live_zone *z, int col, int row)
{
    for (int y = row * SST_LIVE_TILE + TILE_STEP / 2; y < (row + 1) * SST_LIVE_TILE; y += TILE_STEP) {
        for (int x = col * SST_LIVE_TILE + TILE_STEP / 2; x < (col + 1) * SST_LIVE_TILE; x += TILE_STEP)
            if (has_point(z, (x + 0.5) / live->lf.width, (y + 0.5) / live->lf.height))
                return true;
    }
    return false;
}

static void mark_tiles(struct sst_live *live, int zone)
{
    const struct sst_live_zone *z = &live->cfg.zone[zone];
    const int cols = live->changes.cols, rows = live->changes.rows;
    const int col = sst_clamp_int((int)(z->x[0] * live->lf.width) / SST_LIVE_TILE, 0, cols - 1);
    const int row = sst_clamp_int((int)(z->y[0] * live->lf.height) / SST_LIVE_TILE, 0, rows - 1);

    if (!z->points)
        return;
    live->tile_zones[row * cols + col] |= 1u << zone; /* a zone between the points that are tried has one all the same */
    for (int i = 0; i < cols * rows; i++)
        if (overlaps(live, z, i % cols, i / cols))
            live->tile_zones[i] |= 1u << zone;
}

int live_zones_set(struct sst_live *live, const struct sst_live_zone *zone, int zones)
{
    const int tiles = live->changes.cols * live->changes.rows;
    uint32_t masks = 0;

    if (zones < 0 || zones > SST_LIVE_ZONES) {
        sst_log_error("live: %d zones, more than the limit of %d", zones, SST_LIVE_ZONES);
        return -EINVAL;
    }
    for (int i = 0; i < zones; i++)
        if (!is_valid(&zone[i])) {
            sst_log_error("live: zone %d is not a polygon inside the picture (fractions 0..1) with far_px below near_px", i);
            return -EINVAL;
        }
    live->cfg.zones = zones;
    if (zones && zone != live->cfg.zone)
        memcpy(live->cfg.zone, zone, (size_t)zones * sizeof(*zone));
    memset(live->tile_zones, 0, (size_t)tiles * sizeof(*live->tile_zones));
    for (int i = 0; i < zones; i++) {
        mark_tiles(live, i);
        masks |= zone[i].mask && !is_limited(&zone[i]) ? 1u << i : 0;
    }
    for (int i = 0; i < tiles; i++)
        live->tile_zones[i] = live->tile_zones[i] & masks ? 0 : live->tile_zones[i] | 1u << ALL;
    return 0;
}

/* Is something in a tile within the zone's limits of depth? Where nothing is known: yes. */
static bool within_depth(const struct sst_live *live, const struct sst_live_zone *z, int col, int row)
{
    const struct sst_view *v = &live->lf.views[live_zone_view(live)];
    const int x1 = sst_min_int((col + 1) * SST_LIVE_TILE, v->disp.width);
    const int y1 = sst_min_int((row + 1) * SST_LIVE_TILE, v->disp.height);
    bool known = false;

    if (!is_limited(z) || !v->disp.data)
        return true;
    for (int y = row * SST_LIVE_TILE; y < y1; y += DEPTH_STEP) {
        const uint16_t *disp = sst_map_u16_row(&v->disp, y);

        for (int x = col * SST_LIVE_TILE; x < x1; x += DEPTH_STEP) {
            const double px = disp[x] == SST_DISP_NONE ? NAN : sst_disp_px(&live->lf, disp[x]);

            if (px <= z->near_px && px >= z->far_px)
                return true;
            known |= !isnan(px);
        }
    }
    return !known;
}

int live_zone_view(const struct sst_live *live)
{
    const int lead = sst_render_lead_view(&live->lf);

    return lead < 0 ? live->lf.ref_view : lead;
}

void live_zones_changed(const struct sst_live *live, const struct sst_liveframes_changes *changes, double *changed)
{
    const uint8_t *map = changes->map[live_zone_view(live)];
    const int tiles = changes->cols * changes->rows;

    for (int zone = 0; zone <= ALL; zone++) {
        const bool used = zone < live->cfg.zones || zone == ALL;
        int n = 0, all = 0;

        for (int i = 0; map && used && i < tiles; i++) {
            if (!(live->tile_zones[i] & 1u << zone))
                continue;
            all++;
            n += !changes->stretched && (changes->whole || map[i]) &&
                 (zone == ALL || within_depth(live, &live->cfg.zone[zone], i % changes->cols, i / changes->cols));
        }
        changed[zone] = all ? (double)n / all : 0;
    }
}

/* --- labels ------------------------------------------------------------------------------------------------------- */

/* Is a pixel of a zone within its limits of depth? A pixel without depth is not. */
static bool counts(const struct sst_live *live, const struct sst_view *view, const struct sst_live_zone *z, int x, int y)
{
    uint16_t disp;

    if (!is_limited(z) || !view->disp.data)
        return true;
    disp = sst_map_u16_row(&view->disp, y)[x];
    return disp != SST_DISP_NONE && sst_disp_px(&live->lf, disp) <= z->near_px &&
           sst_disp_px(&live->lf, disp) >= z->far_px;
}

void live_zones_count(struct sst_live *live, const struct sst_view *view)
{
    const struct sst_map_u8 *label = &view->label;
    const int step = sst_max_int(label->width / COUNT_COLS, 1);
    uint32_t count[SST_LIVE_ZONES + 1][256] = { { 0 } }, total[SST_LIVE_ZONES + 1] = { 0 };

    if (!label->data)
        return;
    for (int y = 0; y < label->height; y += step) {
        const uint8_t *row = sst_map_u8_row(label, y);

        for (int x = 0; x < label->width; x += step) {
            uint32_t left = live->tile_zones[y / SST_LIVE_TILE * live->changes.cols + x / SST_LIVE_TILE];

            for (; left; left &= left - 1) {
                const int zone = __builtin_ctz(left);

                if (zone < ALL &&
                    !has_point(&live->cfg.zone[zone], (x + 0.5) / label->width, (y + 0.5) / label->height))
                    continue;
                total[zone]++;
                count[zone][row[x]] += zone == ALL || counts(live, view, &live->cfg.zone[zone], x, y);
            }
        }
    }
    for (int zone = 0; zone <= ALL; zone++)
        for (int i = 0; i < 256; i++)
            live->zone_label[zone][i] = total[zone] ? (float)count[zone][i] / (float)total[zone] : 0;
}
