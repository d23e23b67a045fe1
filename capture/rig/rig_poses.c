/* Order, approach and duration of the poses. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>

#include "base/log.h"
#include "capture/rig/rig.h"

#define ASSUMED_MM_S  50.0
#define ASSUMED_MM_S2 500.0
#define OVERHEAD_S    0.1 /* requests, and storing a view */

void sst_scan_config_defaults(struct sst_scan_config *cfg)
{
    *cfg = (struct sst_scan_config){
        .rows = 6,
        .cols = 6,
        .pitch_um = { 40000, 40000 },
        .backlash_um = 1000,
        .guard_ms = 40,
        .attempts = 3,
        .camera_ms = 20000,
        .home_ms = 120000,
        .fourcc = 'M' | 'J' << 8 | 'P' << 16 | (uint32_t)'G' << 24,
        .width = 640,
        .height = 480,
    };
}

int sst_scan_view(const struct sst_scan_config *cfg, int i)
{
    const int row = i / cfg->cols, col = i % cfg->cols;

    return row * cfg->cols + (row % 2 ? cfg->cols - 1 - col : col);
}

struct sst_rig_pos sst_scan_pose(const struct sst_scan_config *cfg, int view)
{
    struct sst_rig_pos pos = { { cfg->origin_um[0], cfg->origin_um[1], cfg->origin_um[2] } };

    pos.um[0] += view % cfg->cols * cfg->pitch_um[0];
    pos.um[1] += view / cfg->cols * cfg->pitch_um[1];
    return pos;
}

struct sst_rig_pos sst_scan_approach(const struct sst_scan_config *cfg, int axes, const struct sst_rig_pos *from,
                                     struct sst_rig_pos to)
{
    for (int a = 0; a < axes; a++) {
        if (!from || from->um[a] > to.um[a])
            to.um[a] -= cfg->backlash_um;
    }
    return to;
}

/* Of the axis that goes farthest. */
static double longest_mm(int axes, const struct sst_rig_pos *from, const struct sst_rig_pos *to)
{
    double longest = 0;

    for (int a = 0; a < axes; a++)
        longest = fmax(longest, fabs((double)to->um[a] - from->um[a]) / 1000.0);
    return longest;
}

double sst_scan_leg_s(const struct sst_rig_config *rig, const struct sst_rig_pos *from, const struct sst_rig_pos *to)
{
    const double v = rig->speed_mm_s > 0 ? rig->speed_mm_s : ASSUMED_MM_S;
    const double acc = rig->accel_mm_s2 > 0 ? rig->accel_mm_s2 : ASSUMED_MM_S2;
    const double longest = longest_mm(rig->axes, from, to);

    return longest > v * v / acc ? longest / v + v / acc : 2 * sqrt(longest / acc);
}

static int check_travel(const struct sst_scan_config *cfg, const struct sst_rig_config *rig)
{
    for (int a = 0; a < rig->axes; a++) {
        const int64_t steps = a == 0 ? cfg->cols - 1 : a == 1 ? cfg->rows - 1 : 0;
        const int64_t first = cfg->origin_um[a], last = first + (a < 2 ? steps * cfg->pitch_um[a] : 0);

        if (first - cfg->backlash_um >= rig->travel_min_um[a] && last <= rig->travel_max_um[a])
            continue;
        sst_log_error("the grid needs %c from %.3f to %.3f mm and a backlash of %.3f mm below, but the travel is %.3f "
                      "to %.3f mm; change pitch, grid, origin or backlash",
                      'x' + a, (double)first / 1000.0, (double)last / 1000.0, cfg->backlash_um / 1000.0,
                      rig->travel_min_um[a] / 1000.0, rig->travel_max_um[a] / 1000.0);
        return -EINVAL;
    }
    return 0;
}

static int check_settings(const struct sst_scan_config *cfg, const struct sst_rig_config *rig)
{
    const char *fault = NULL;

    if (cfg->rows < 1 || cfg->cols < 1 || cfg->rows > 256 || cfg->cols > 256 || cfg->rows * cfg->cols > 256)
        fault = "a grid has 1 to 256 views";
    else if (cfg->pitch_um[0] < 1 || cfg->pitch_um[1] < 1)
        fault = "the pitch must be at least 0.001 mm";
    else if (cfg->backlash_um < 0)
        fault = "the backlash must not be negative";
    else if ((cfg->rows > 1 && rig->axes < 2))
        fault = "a rig with one axis captures one row only; use --grid 1xC";
    if (!fault)
        return check_travel(cfg, rig);
    sst_log_error("rig capture: %s", fault);
    return -EINVAL;
}

int sst_scan_plan(struct sst_scan_plan *out, const struct sst_scan_config *cfg, const struct sst_rig_config *rig)
{
    struct sst_scan_plan p = { .views = cfg->rows * cfg->cols, .speed_assumed = !(rig->speed_mm_s > 0) };
    const double mjpeg_bytes = 0.25, pixels = (double)cfg->width * cfg->height;
    struct sst_rig_pos at = { { 0 } };
    const int err = check_settings(cfg, rig);

    if (err)
        return err;
    for (int i = 0; i < p.views; i++) {
        const struct sst_rig_pos to = sst_scan_pose(cfg, sst_scan_view(cfg, i));
        const struct sst_rig_pos via = sst_scan_approach(cfg, rig->axes, i ? &at : NULL, to);

        for (int leg = 0; leg < 2; leg++) {
            const struct sst_rig_pos *next = leg ? &to : &via;
            const double longest = longest_mm(rig->axes, &at, next);

            p.way_mm += longest;
            /* A separate leg needs settling as well. */
            p.seconds += longest > 0 ? sst_scan_leg_s(rig, &at, next) + rig->settle_ms / 1000.0 : 0;
            at = *next;
        }
        p.seconds += cfg->guard_ms / 1000.0 + OVERHEAD_S +
                     (cfg->shot_s > 0    ? cfg->shot_s
                      : cfg->rate_hz > 0 ? 1.5 / cfg->rate_hz
                                         : 0.1);
    }
    p.bytes = (cfg->view_bytes ? cfg->view_bytes : (int64_t)(pixels * mjpeg_bytes)) * p.views;
    *out = p;
    return 0;
}
