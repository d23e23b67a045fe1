/* Figures of a live picture, as in the status and the metrics. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/border.h"
#include "base/clock.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"

#define ROW      SST_FIELD
#define GROUP    SST_FIELD_GROUP
#define GROUP_IF SST_FIELD_GROUP_IF
#define NAMES    SST_FIELD_NAMES

static const char *const skip_names[] = { "change", "labels" };

#define IN struct live_skip
static const struct sst_field skip_fields[] = {
    ROW("on", BOOL, on, "It is switched on"),
    ROW("skipped_percent", REAL, percent, "Share that is left out"),
    ROW("error", REAL, error, "Error that this adds, as last sampled", .nullable = true),
    { 0 },
};
#undef IN

#define IN struct engine_removed
static const struct sst_field removed_fields[] = {
    ROW("track", INTEGER, track, "Its number in /api/v1/tracks"),
    ROW("name", TEXT, name, "Its label, or \"\""),
    ROW("distance_m", REAL, distance_m, "Its distance; null: not calibrated", .nullable = true),
    ROW("disparity_px", REAL, disparity_px, "Its disparity"),
    { 0 },
};
#undef IN

#define IN struct live_now
const struct sst_field engine_live_fields[] = {
    ROW("enabled", BOOL, engine.enabled, "It is configured"),
    ROW("ready", BOOL, engine.ready, "See-through pictures are made", "live_ready"),
    ROW("settling", BOOL, settling,
        "Pictures come, but the range of disparities or the automatic cut has changed in the last 3 s"),
    ROW("reason", TEXT, engine.reason, "Reason why it is not ready, or \"\""),
    ROW("rate_hz", REAL, engine.rate_hz, "Sets per second, over the last ten seconds", "live_rate_hz"),
    ROW("sets", INTEGER, engine.sets, "Sets taken into the live picture", "live_sets_total"),
    ROW("too_slow", BOOL, engine.too_slow,
        "Fewer than 2 sets a second are processed, or half of them are passed over, for seconds: visits and crossings are "
        "missed",
        "live_too_slow"),
    ROW("due_hz", REAL, engine.due_hz, "Sets per second that should be processed, over the last five seconds",
        "live_due_hz"),
    ROW("dropped", INTEGER, engine.dropped, "Sets passed over for newer ones", "live_sets_dropped_total"),
    ROW("idle", INTEGER, engine.idle, "Sets in which nothing had changed", "live_sets_idle_total"),
    ROW(NULL, INTEGER, not_finite, "NaN and infinity where results leave a module: faults", "values_not_finite_total"),
    ROW("pictures", INTEGER, engine.pictures, "Pictures rendered and encoded", "live_pictures_total"),
    ROW(NULL, INTEGER, engine.visits, "Things that came into view and moved", "visits_total"),
    ROW("changed_percent", REAL, engine.changed_percent, "Share of the tiles that changed, over the last ten seconds"),
    ROW("cpu_percent", REAL, engine.cpu_percent, "Of one core, over the last ten seconds, without rendering"),
    ROW("views", INTEGER, engine.views, "Views of the light field"),
    ROW("present", INTEGER, engine.present, "Views of the last set"),
    ROW("demand", CHOICE, engine.demand,
        "Use of the pictures: none (all is brought up to date every 5 s), "
        "events (visits to zones, triggers on labels, the time before a recorded event: and up to twice a second after "
        "changes), pictures (viewers, a recorded view: every set)",
        .names = engine_demand_names, 3),
    ROW("light_changes", INTEGER, engine.relit, "Sets in which the light or exposure of a view changed",
        "live_light_changes_total"),
    ROW("watched", INTEGER, engine.watched, "Sets of which one view was watched, as no pictures were needed",
        "live_sets_watched_total"),
    ROW("latency_ms", SPREAD, latency_ms,
        "From the trigger to the encoded picture; quantiles of the last minute, none: nothing changed",
        "live_latency_seconds", .per = 1e3, .nullable = true),
    ROW("stages_ms", MAP, stage_ms, "Duration of each stage; quantiles of the last minute, null: nothing changed",
        .item = SST_FIELD_SPREAD, .names = engine_stage_names, ENGINE_STAGES, sizeof(struct sst_spread),
        .nullable = true),
    ROW(NULL, MAP, stage_sum_ms, "Time spent in each stage", "live_stage_seconds_total", .per = 1e3, .label = "stage",
        .item = SST_FIELD_REAL, .names = engine_stage_names, ENGINE_STAGES, sizeof(double)),
    ROW("skips", MAP, skip, "Work that is left out (design.md, 5.5)", .of = skip_fields, NAMES(skip_names),
        sizeof(struct live_skip)),
    ROW(NULL, INTEGER, engine.tiles, "Tiles of the sets taken in", "live_tiles_total"),
    ROW(NULL, INTEGER, engine.tiles_changed, "Tiles of them that were recomputed", "live_tiles_changed_total"),
    ROW(NULL, INTEGER, engine.label_runs, "Runs of the segmentation network", "live_label_runs_total"),
    ROW(NULL, INTEGER, engine.label_runs_skipped, "Runs that were not needed", "live_label_runs_skipped_total"),
    GROUP_IF(
        "device", engine.on_device, "Work of a device; null: all is on the CPU, as configured",
        ROW("name", TEXT, engine.device.name, "Name of the device"),
        ROW("driver", TEXT, engine.device.driver, "Its driver and version"),
        ROW("failing", BOOL, engine.device.failing, "It failed at its last picture, or cannot be opened"),
        ROW(NULL, BOOL, device_up, "Pictures are rendered on a device; else on the CPU", "live_device_up"),
        ROW("pictures", INTEGER, engine.device.pictures, "Pictures that the device rendered",
            "live_device_pictures_total"),
        ROW("on_cpu", INTEGER, engine.device.on_cpu, "Pictures that the CPU rendered instead of the device",
            "live_device_on_cpu_total"),
        ROW("verified_on_cpu", INTEGER, engine.device.verified_on_cpu, "Pictures whose rays were verified on the CPU"),
        ROW("filled_on_cpu", INTEGER, engine.device.filled_on_cpu, "Clear pictures whose holes were filled on the CPU"),
        ROW("failures", INTEGER, engine.device.failures, "Times that the device failed at pictures",
            "live_device_failures_total"),
        ROW("reason", NAME, device_reason, "Cause of the last failure, or of the last work on the CPU"),
        ROW(NULL, BOOL, labels_up, "The network runs on a device; else on the CPU", "live_device_labels_up"),
        GROUP_IF("labels", engine.labels_on_device, "The network on a device; null: on the CPU, or there is none",
                 ROW("failing", BOOL, engine.label_device.step.failing,
                     "It failed at its last run, or cannot be opened"),
                 ROW("runs", INTEGER, engine.label_device.runs, "Runs of the network on the device",
                     "live_device_label_runs_total"),
                 ROW("on_cpu", INTEGER, engine.label_device.on_cpu, "Runs of it on the CPU instead of the device",
                     "live_device_label_runs_on_cpu_total"),
                 ROW("failures", INTEGER, engine.label_device.step.failures,
                     "Times that the device failed at the network", "live_device_label_failures_total"),
                 ROW("reason", NAME, labels_reason, "Cause of the last failure, or of the last run on the CPU")),
        ROW("stages_on_cpu", LIST, on_cpu, "Steps that the CPU does now, beside the device", .item = SST_FIELD_NAME,
            .stride = sizeof(char *), .count_at = offsetof(struct live_now, on_cpu_count))),
    ROW("verify_rays", BOOL, verify_rays, "live.verify_rays of the configuration"),
    ROW("size", LIST, engine.width, "Width and height of the pictures", .item = SST_FIELD_INTEGER, .count = 2,
        .stride = sizeof(int)),
    ROW("levels", LIST, levels, "Levels of 16-bit frames that are shown black and white; null: frames of 8 bits, or all",
        .item = SST_FIELD_INTEGER, .count = 2, .stride = sizeof(int64_t), .given = offsetof(struct live_now, leveled)),
    ROW("range_px", LIST, range_px, "Disparities that are searched; null: not known yet", .item = SST_FIELD_REAL,
        .count = 2, .stride = sizeof(double), .given = offsetof(struct live_now, ranged)),
    ROW("focus_px", REAL, engine.focus_px, "Default focus", .nullable = true),
    ROW("cut_px", REAL, engine.cut_px,
        "The automatic cut of clear pictures, px per camera spacing; null: there is no "
        "gap between something in front and the rest",
        .nullable = true),
    ROW("removed", LIST, engine.removed, "Moving things that clear pictures with the automatic cut are without", .of = removed_fields,
        .stride = sizeof(struct engine_removed), .count_at = offsetof(struct live_now, engine.removed_count)),
    ROW(NULL, INTEGER, engine.removed_count, "Moving things that clear pictures with the automatic cut are without",
        "live_removed"),
    GROUP("histogram", "Of the reference view's disparities over range_px",
          ROW("min_px", REAL, engine.share_min_px, "Its least disparity; null: not known yet", .nullable = true),
          ROW("max_px", REAL, engine.share_max_px, "Its largest one", .nullable = true),
          ROW("share", LIST, engine.share, "Shares of equal steps, which sum to 1; all 0 until disparities are known",
              .item = SST_FIELD_REAL, .count = SST_LIVE_HISTOGRAM, .stride = sizeof(float))),
    ROW("focal_px", REAL, engine.focal_px, "Focal length; null: not calibrated", .nullable = true),
    ROW("spacing_mm", REAL, engine.spacing_mm,
        "Camera spacing. Disparity d lies focal_px * spacing_mm / 1000 / d metres away; null: not calibrated",
        .nullable = true),
    ROW("calibration", TEXT, engine.check, "Last verdict on the calibration, or \"\""),
    GROUP_IF("surface", engine.posed, "Surface of the pictures of cameras with live: poses; null: a lattice",
             ROW("known", BOOL, engine.surface.known, "Pictures can be rendered on it"),
             ROW("fitted", BOOL, engine.surface.fitted, "It was found; false: given, or not found yet"),
             ROW("fitting", BOOL, engine.surface.fitting, "It is being sought"),
             ROW("distance_m", REAL, surface_m, "Along the middle camera's axis", .nullable = true),
             ROW("tilt_deg", REAL, engine.surface.tilt_deg, "Tilt of a plane that was found", .nullable = true),
             ROW("views", INTEGER, engine.surface.views, "Views that were compared"),
             ROW("age_s", REAL, surface_age_s, "Time since it was found; null: given, or not found yet",
                 .nullable = true),
             ROW("compare_px", INTEGER, compare_px, "Width of the pictures by which views are compared, about")),
    GROUP("quality", "Figures of the pictures, of as many views as were measured; null: not measured",
          ROW("views", INTEGER, engine.noticed_views, "Views that were measured"),
          ROW("noise_levels", REAL, engine.noticed.noise_levels, "Noise, of 0..255", .nullable = true),
          ROW("edge_px", REAL, engine.noticed.edge_px, "Width of the sharpest edges", .nullable = true),
          ROW("jpeg_quality", REAL, engine.noticed.jpeg_quality, "Least quality of JPEG; null: no JPEG",
              .nullable = true),
          ROW("soft_views", INTEGER, engine.noticed.soft, "Views that are less sharp than the others")),
    { 0 },
};
#undef IN

/* --- state now ---------------------------------------------------------------------------------------------------- */

static struct sst_spread window_spread(const struct time_window *w)
{
    const int64_t now_ns = sst_clock_now_ns();

    return (struct sst_spread){ window_quantile(w, 0.5, now_ns), window_quantile(w, 0.99, now_ns),
                                window_quantile(w, 1, now_ns), w->sum, w->count };
}

static double share(uint64_t done, uint64_t skipped)
{
    return skipped ? 100 * ((double)skipped / (double)(done + skipped)) : 0;
}

/** The first sentence that is not empty. */
static const char *either(const char *a, const char *b)
{
    return a[0] ? a : b;
}

/* Work of a device on the live picture, and the steps of the CPU beside it. */
static void gather_device(struct live_now *now)
{
    const struct engine_state *v = &now->engine;
    const struct sst_render_device_report *d = &v->device;
    const struct sst_network_device_report *n = &v->label_device;
    bool labels, pictures;

    now->device_up = v->on_device && !d->failing;
    now->labels_up = v->labels_on_device && !n->step.failing;
    now->device_reason =
        d->failing ? d->failure : either(d->why, either(d->why_verified, d->why_filled));
    now->labels_reason = n->step.failing ? n->step.failure : n->step.why;
    /* A device that has run nothing has no form for this network. */
    labels = now->labels_up && (n->runs || !n->on_cpu);
    pictures = now->device_up && (d->pictures || !d->on_cpu);
    for (const char *const *step = sst_live_device_steps; *step; step++)
        if (!strcmp(*step, "labels") ? !labels : !pictures)
            now->on_cpu[now->on_cpu_count++] = *step;
    for (const char *const *step = sst_live_cpu_steps; *step; step++)
        now->on_cpu[now->on_cpu_count++] = *step;
}

void engine_live(struct live_now *now, struct live_engine *engine, const struct sst_live_settings *s)
{
    struct engine_state *v = &now->engine;

    engine_state(engine, v);
    now->settling = engine_settling(v);
    now->verify_rays = s->verify_rays;
    now->surface_m = v->surface.distance_mm / 1000;
    now->surface_age_s = v->surface.fitted_ns ? (double)(sst_clock_now_ns() - v->surface.fitted_ns) * 1e-9 : (double)NAN;
    now->compare_px = s->compare_px;
    now->not_finite = sst_border_count();
    now->latency_ms = window_spread(&v->latency_ms);
    for (int i = 0; i < ENGINE_STAGES; i++) {
        now->stage_ms[i] = window_spread(&v->stage_ms[i]);
        now->stage_sum_ms[i] = v->stage_ms[i].sum;
    }
    now->skip[0] =
        (struct live_skip){ s->skip_change, share(v->tiles_changed, v->tiles - v->tiles_changed), v->error_change };
    now->skip[1] = (struct live_skip){ s->skip_labels, share(v->label_runs, v->label_runs_skipped), v->error_labels };
    now->levels[0] = v->levels.black;
    now->levels[1] = v->levels.white;
    now->leveled = v->levels.white > 0;
    now->range_px[0] = v->range_min_px;
    now->range_px[1] = v->range_max_px;
    now->ranged = isfinite(v->range_min_px) && isfinite(v->range_max_px);
    if (!v->counted) {
        v->share_min_px = v->share_max_px = NAN;
        memset(v->share, 0, sizeof(v->share));
    }
    if (!(v->focal_px > 0))
        v->focal_px = NAN;
    if (!(v->spacing_mm > 0))
        v->spacing_mm = NAN;
    if (!v->noticed_views)
        v->noticed.noise_levels = NAN;
    gather_device(now);
}

json_t *engine_live_json(struct live_engine *engine, const struct sst_live_settings *settings)
{
    struct live_now *now = calloc(1, sizeof(*now));
    json_t *live = NULL;

    if (now) {
        engine_live(now, engine, settings);
        live = sst_fields_json(engine_live_fields, now);
    }
    free(now);
    return live;
}
