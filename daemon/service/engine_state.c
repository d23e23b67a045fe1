/* State of the live engine as status, metrics and the page show it: sets, ranges, devices, rates, labels. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"

/* How long the range of disparities and the cut have to stay until the picture counts as settled. */
#define SETTLE_NS INT64_C(3000000000)
/* Labels that are offered for removal have had this part of the picture for so long, and not less than that since. */
#define OFFERED_SHARE 0.01
#define OFFERED_LEAST 0.008
#define OFFERED_NS    INT64_C(60000000000)

const char *const engine_stage_names[ENGINE_STAGES] = { "wait",   "change", "decode", "rectify", "disparity",
                                                        "labels", "refine", "render", "encode" };
const char *const engine_demand_names[] = { "none", "events", "pictures" };

/* @param work, done  "pictures" "rendered" @param failure  NULL: the device works again */
static void emit_device(struct live_engine *v, const char *work, const char *done, const char *name,
                        const char *failure)
{
    if (!v->events)
        return;
    if (failure)
        sst_events_emit(v->events, SST_EVENT_WARNING, "device-lost",
                        json_pack("{s:s, s:s, s:s}", "device", name, "work", work, "reason", failure),
                        "live %s are %s on the CPU, not on %s: %s", work, done, name, failure);
    else
        sst_events_emit(v->events, SST_EVENT_INFO, "device-found",
                        json_pack("{s:s, s:s}", "device", name, "work", work), "live %s are %s on %s again", work, done,
                        name);
}

void engine_follow_device(struct live_engine *v)
{
    struct sst_render_device_report now = { 0 };
    struct sst_network_device_report labels = { 0 };
    const bool on_device = sst_live_device(v->live, &now), labels_on_device = sst_live_label_device(v->live, &labels);
    bool turned, labels_turned;

    pthread_mutex_lock(&v->lock);
    turned = now.failing != v->state.device.failing;
    labels_turned = labels.step.failing != v->state.label_device.step.failing;
    v->state.on_device = on_device;
    v->state.device = now;
    v->state.labels_on_device = labels_on_device;
    v->state.label_device = labels;
    pthread_mutex_unlock(&v->lock);
    if (turned)
        emit_device(v, "pictures", "rendered", now.name, now.failing ? now.failure : NULL);
    if (labels_turned)
        emit_device(v, "labels", "computed", labels.step.name, labels.step.failing ? labels.step.failure : NULL);
}

/* Counts of the present second. */
static struct second *second_now(struct live_engine *v)
{
    const int64_t s = sst_clock_now_ns() / 1000000000;
    struct second *at = &v->second[s % RATE_SLOTS];

    if (at->s != s)
        *at = (struct second){ .s = s };
    return at;
}

void engine_note_passed_locked(struct live_engine *v, uint64_t sets)
{
    second_now(v)->passed += sets;
}

void engine_note_second_locked(struct live_engine *v, const struct sst_live_report *r, int sets)
{
    struct second *at = second_now(v);

    at->sets += (uint64_t)sets;
    at->taken++;
    at->tiles += (uint64_t)r->tiles;
    at->changed += (uint64_t)r->tiles_changed;
    at->cpu_ns += r->cpu_ns;
}

void engine_note_set_locked(struct live_engine *v, const struct sst_live_report *r, int64_t wait_ns)
{
    struct engine_state *s = &v->state;
    const int64_t now_ns = sst_clock_now_ns();

    engine_note_second_locked(v, r, 1);
    s->sets++;
    s->idle += r->tiles_changed == 0;
    s->relit += r->relit > 0;
    s->ready = r->ready;
    s->levels = r->levels;
    snprintf(s->reason, sizeof(s->reason), "%s",
             r->alone ? "no two neighbouring cameras give pictures, so there is plain refocusing only" : "");
    s->views = v->layout.config.bound;
    s->present = r->views;
    s->tiles += (uint64_t)r->tiles;
    s->tiles_changed += (uint64_t)r->tiles_changed;
    s->label_runs += (uint64_t)r->label_runs;
    s->label_runs_skipped += (uint64_t)r->label_runs_skipped;
    if (!isnan(r->error_change))
        s->error_change = r->error_change;
    if (!isnan(r->error_labels))
        s->error_labels = r->error_labels;
    if (!r->tiles_changed)
        return;
    v->update++;
    window_add(&s->stage_ms[ENGINE_WAIT], (double)wait_ns / 1e6, now_ns);
    for (int i = 0; i < SST_LIVE_STAGES; i++)
        if (!r->late || i < SST_LIVE_DISPARITY || r->stage_ns[i]) /* else left out */
            window_add(&s->stage_ms[ENGINE_LIVE + i], (double)r->stage_ns[i] / 1e6, now_ns);
    for (int i = 0; i < 256; i++) {
        v->share[i] = r->zone[SST_LIVE_ZONES].label[i];
        if ((double)v->share[i] < (v->share_ns[i] ? OFFERED_LEAST : OFFERED_SHARE))
            v->share_ns[i] = 0;
        else if (!v->share_ns[i])
            v->share_ns[i] = now_ns;
    }
}

void engine_note_rest_locked(struct live_engine *v, const struct sst_live_report *r)
{
    const int64_t now_ns = sst_clock_now_ns();

    second_now(v)->cpu_ns += r->cpu_ns;
    v->state.label_runs += (uint64_t)r->label_runs;
    v->state.label_runs_skipped -= (uint64_t)r->label_runs;
    if (r->label_runs)
        window_add(&v->state.stage_ms[ENGINE_LIVE + SST_LIVE_LABELS], (double)r->stage_ns[SST_LIVE_LABELS] / 1e6,
                   now_ns);
}

bool engine_settling(const struct engine_state *v)
{
    return v->ready && sst_clock_now_ns() - v->settles_ns < SETTLE_NS;
}

static bool same_px(double a, double b)
{
    return isnan(a) || isnan(b) ? isnan(a) && isnan(b) : fabs(a - b) < 1e-9;
}

void engine_note_scene(struct live_engine *v, bool changed)
{
    const struct sst_lightfield *lf = sst_live_lightfield(v->live);
    double min_px = NAN, max_px = NAN;
    const bool known = sst_live_range(v->live, &min_px, &max_px);
    const double focus_px = sst_live_default_focus(v->live), cut_px = sst_live_cut(v->live);
    float share[SST_LIVE_HISTOGRAM];
    double share_min_px = NAN, share_max_px = NAN;
    const bool count = changed || !v->state.counted;
    const bool counted = count && sst_live_histogram(v->live, &share_min_px, &share_max_px, share);

    pthread_mutex_lock(&v->lock);
    v->state.range_min_px = known ? min_px : NAN;
    v->state.range_max_px = known ? max_px : NAN;
    v->state.focus_px = focus_px;
    if (!same_px(v->state.cut_px, cut_px) || !same_px(v->state.searched_min_px, lf->range_min_px) ||
        !same_px(v->state.searched_max_px, lf->range_max_px))
        v->state.settles_ns = sst_clock_now_ns();
    v->state.cut_px = cut_px;
    v->state.searched_min_px = lf->range_min_px;
    v->state.searched_max_px = lf->range_max_px;
    if (count) {
        v->state.counted = counted;
        v->state.share_min_px = share_min_px;
        v->state.share_max_px = share_max_px;
    }
    if (counted)
        memcpy(v->state.share, share, sizeof(share));
    v->state.width = lf->width;
    v->state.height = lf->height;
    v->state.focal_px = lf->focal_px;
    v->state.spacing_mm = lf->spacing_mm > 0 ? lf->spacing_mm : v->layout.config.spacing_mm;
    v->classes = lf->classes;
    pthread_mutex_unlock(&v->lock);
}

void engine_state(struct live_engine *v, struct engine_state *out)
{
    const int64_t now_s = sst_clock_now_ns() / 1000000000;
    uint64_t sets = 0, tiles = 0, changed = 0;
    int64_t cpu_ns = 0;

    pthread_mutex_lock(&v->lock);
    *out = v->state;
    for (int i = 0; i < RATE_SLOTS; i++) {
        const struct second *s = &v->second[i];

        if (s->s < now_s - 10 || s->s >= now_s)
            continue;
        sets += s->sets;
        tiles += s->tiles;
        changed += s->changed;
        cpu_ns += s->cpu_ns;
    }
    pthread_mutex_unlock(&v->lock);
    out->rate_hz = (double)sets / 10;
    out->changed_percent = tiles ? 100.0 * (double)changed / (double)tiles : 0;
    out->cpu_percent = (double)cpu_ns / 1e8;
}

/* Classes of the networks that ship, of things in simulated scenes alone. */
static bool is_of_demo(const char *name)
{
    static const char *const names[] = { "Toy", "Case", "Poster", "Cat", "Hen", "Membrane", "Nucleus" };
    bool found = false;

    for (size_t i = 0; i < ARRAY_LEN(names); i++)
        found |= !strcmp(name, names[i]);
    return found;
}

/* Is a class worth a chip? */
static bool is_offered_locked(const struct live_engine *v, int label)
{
    const int64_t since_ns = v->share_ns[label];

    return (v->config.live.demo_labels || !is_of_demo(v->classes.names[label - 1])) && since_ns &&
           sst_clock_now_ns() - since_ns >= (v->config.live.demo_labels ? 0 : OFFERED_NS);
}

int engine_labels(void *engine, struct sst_api_answer *out)
{
    struct live_engine *v = engine;
    const uint8_t(*palette)[3] = sst_classes_palette();
    json_t *list = json_array();

    pthread_mutex_lock(&v->lock);
    for (int i = 1; i <= v->classes.count; i++) {
        char colour[8];

        snprintf(colour, sizeof(colour), "#%02x%02x%02x", palette[i][0], palette[i][1], palette[i][2]);
        json_array_append_new(list, json_pack("{s:i, s:s, s:s, s:f, s:b}", "label", i, "name", v->classes.names[i - 1],
                                              "colour", colour, "share", (double)v->share[i], "offered",
                                              is_offered_locked(v, i)));
    }
    pthread_mutex_unlock(&v->lock);
    out->body = json_pack("{s:o}", "labels", list);
    return out->body ? 0 : -ENOMEM;
}
