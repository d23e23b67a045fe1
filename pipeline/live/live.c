/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/live/live.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "pipeline/live/live_internal.h"

/* Maps have low confidence when the fraction of confirmed disparities falls below the first value, until it exceeds the
 * second: it is 0.98 with people in front of a wall, 0.74 in dense leaves (docs/design/live.md). */
#define CONFIRMED       0.95
#define CONFIRMED_AGAIN 0.965

int sst_live_open(struct sst_live **out, const struct sst_live_config *cfg)
{
    struct sst_live *live = calloc(1, sizeof(*live));
    int err;

    if (!live) {
        sst_log_error("live: no memory");
        return -ENOMEM;
    }
    err = live_init(live, cfg);
    if (!err && cfg->posed.poses)
        err = sst_liveposed_open(&live->posed, &live->cfg, &live->lf);
    err = err ? err : sst_liveframes_open(&live->frames, &live->cfg, &live->lf);
    if (!err && !live->posed)
        err = sst_livescene_open(&live->scene, &live->cfg, &live->lf);
    if (!err && !live->posed)
        err = live_watch_open(live);
    if (err) {
        sst_live_close(live);
        return err;
    }
    *out = live;
    return 0;
}

void sst_live_close(struct sst_live *live)
{
    if (!live)
        return;
    sst_live_cancel(live);
    live_watch_close(live);
    sst_liveposed_close(live->posed);
    sst_livescene_close(live->scene);
    sst_liveframes_close(live->frames);
    live_fini(live);
    free(live);
}

int sst_live_set_zones(struct sst_live *live, const struct sst_live_zone *zone, int zones)
{
    const int err = live_zones_set(live, zone, zones);

    if (!err)
        live->counted = 0; /* with the next update */
    return err;
}

void sst_live_cancel(struct sst_live *live)
{
    atomic_store(&live->canceled, true);
    if (live->frames)
        sst_liveframes_cancel(live->frames);
    if (live->scene)
        sst_livescene_cancel(live->scene);
}

/* --- updates ------------------------------------------------------------------------------------------------------ */

static void mark_all(struct sst_liveframes_changes *c)
{
    c->whole = true;
    c->changed = 0;
    for (int k = 0; k < SST_MAX_VIEWS; k++) {
        if (!c->map[k])
            continue;
        memset(c->map[k], 1, (size_t)c->cols * (size_t)c->rows);
        c->changed += c->cols * c->rows;
    }
}

static void set_zones(const struct sst_live *live, const double changed[SST_LIVE_ZONES + 1],
                      struct sst_live_report *report)
{
    for (int zone = 0; zone <= SST_LIVE_ZONES; zone++) {
        report->zone[zone].changed = changed[zone];
        memcpy(report->zone[zone].label, live->zone_label[zone], sizeof(report->zone[zone].label));
    }
}

/* Work that no picture of the set needs. */
static int follow_scene(struct sst_live *live, struct sst_live_report *done)
{
    struct sst_live_track track[SST_LIVE_TRACKS];
    int err = sst_livescene_follow(live->scene, done);

    live->left = false;
    err = err ? err : live_watch_update(live, live->t_ns);
    if (!err)
        live_cut_guard(live, track, sst_live_tracks(live, track), live->t_ns);
    return err;
}

/* Has a new track in the open to be known before the picture is made? Tracks are as they were in sets without maps. */
static bool needs_tracks(const struct sst_live *live)
{
    struct sst_live_track track[SST_LIVE_TRACKS];

    return !live->late && live_cut_removes(live, track, sst_livescene_tracks(live->scene, track));
}

static int update_scene(struct sst_live *live, const struct sst_live_input *in, struct sst_live_report *done)
{
    int err = sst_livescene_update(live->scene, &live->changes, in, done);

    live->ready = err ? live->ready : done->ready;
    live->late = err ? live->late : done->late;
    if (!err && !isnan(done->confirmed))
        live->confirmed = done->confirmed;
    if (!err && !isnan(done->confirmed))
        live->low_confidence = done->confirmed < (live->low_confidence ? CONFIRMED_AGAIN : CONFIRMED);
    err = err ? err : live_ingest(live, &live->changes);
    err = err ? err : live_summarize(live, in->t_ns);
    live->t_ns = in->t_ns;
    live->left = !err && in->picture_first && !needs_tracks(live);
    return err || live->left ? err : follow_scene(live, done);
}

static int update_posed(struct sst_live *live, const struct sst_live_input *in, struct sst_live_report *done)
{
    struct sst_live_surface surface;
    const int err = sst_liveposed_update(live->posed, &live->changes, !in->unseen);

    sst_liveposed_surface(live->posed, &surface);
    live->ready = done->ready = surface.known;
    return err;
}

int sst_live_follow(struct sst_live *live, struct sst_live_report *report)
{
    const int64_t cpu_ns = sst_clock_cpu_ns();
    int err;

    if (!live->left)
        return 0;
    err = atomic_load(&live->canceled) ? -ECANCELED : follow_scene(live, report);
    live->lost |= err != 0;
    report->cpu_ns += sst_clock_cpu_ns() - cpu_ns;
    return err;
}

int sst_live_update(struct sst_live *live, const struct sst_live_input *in, struct sst_live_report *report)
{
    struct sst_live_report done = { .error_change = NAN, .error_labels = NAN, .confirmed = NAN };
    const int64_t cpu_ns = sst_clock_cpu_ns();
    double changed[SST_LIVE_ZONES + 1];
    int err = atomic_load(&live->canceled) ? -ECANCELED : sst_live_follow(live, &done);

    err = err ? err : sst_liveframes_update(live->frames, in, &live->changes, &done);
    if (!err && live->lost)
        mark_all(&live->changes);
    live->lost = true;
    if (!err)
        live_zones_changed(live, &live->changes, changed);
    if (!err)
        err = live->posed ? update_posed(live, in, &done) : update_scene(live, in, &done);
    if (err)
        return err;
    live->lost = false;
    set_zones(live, changed, &done);
    done.cpu_ns = sst_clock_cpu_ns() - cpu_ns;
    *report = done;
    return 0;
}

int sst_live_watch(struct sst_live *live, const struct sst_live_input *in, struct sst_live_report *report)
{
    struct sst_live_report done = { .error_change = NAN, .error_labels = NAN, .confirmed = NAN, .ready = live->ready };
    const int64_t cpu_ns = sst_clock_cpu_ns();
    double changed[SST_LIVE_ZONES + 1];
    const int lead = live_zone_view(live);
    int err = atomic_load(&live->canceled) ? -ECANCELED : sst_live_follow(live, &done);

    err = err ? err : sst_liveframes_watch(live->frames, in, lead, &live->changes);
    if (err)
        return err;
    live_zones_changed(live, &live->changes, changed);
    set_zones(live, changed, &done);
    done.cpu_ns = sst_clock_cpu_ns() - cpu_ns;
    *report = done;
    return 0;
}

void live_track_hold(struct sst_live_track *t)
{
    t->x0 = t->at[0];
    t->y0 = t->at[1];
    t->x1 = t->at[2];
    t->y1 = t->at[3];
    t->vx_px_s = t->vy_px_s = 0;
}

int sst_live_tracks(const struct sst_live *live, struct sst_live_track out[SST_LIVE_TRACKS])
{
    int n;

    if (live->posed)
        return 0;
    n = live->watch ? live_watch_tracks(live, out) : sst_livescene_tracks(live->scene, out);
    for (int i = 0; i < n; i++)
        if (out[i].state == SST_LIVE_TRACK_COVERED)
            live_track_hold(&out[i]);
        else if (out[i].hidden)
            live_track_grow(live, &out[i]);
    return n;
}

int sst_live_recognise(struct sst_live *live, const struct sst_image *image, const double box[4])
{
    return live->posed ? 0 : sst_livescene_recognise(live->scene, image, box);
}

bool sst_live_unsettled(struct sst_live *live)
{
    return live->posed ? sst_liveposed_unsettled(live->posed) : sst_livescene_unsettled(live->scene);
}

bool sst_live_settle(struct sst_live *live)
{
    if (live->posed) {
        const bool settled = sst_liveposed_settle(live->posed);

        live->ready |= settled;
        return settled;
    }
    if (!sst_livescene_settle(live->scene, &live->changes))
        return false;
    live->lost = live_ingest(live, &live->changes) || live_summarize(live, live->focus.t_ns);
    return !live->lost;
}

/* --- cameras that stand anywhere ---------------------------------------------------------------------------------- */

bool sst_live_surface(const struct sst_live *live, struct sst_live_surface *out)
{
    if (live->posed)
        sst_liveposed_surface(live->posed, out);
    return live->posed != NULL;
}

int sst_live_refit(struct sst_live *live)
{
    if (!live->posed || live->cfg.posed.plane_mm > 0)
        return -ENOTSUP;
    sst_liveposed_refit(live->posed);
    return 0;
}
