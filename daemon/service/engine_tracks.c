/* Tracks of moving objects in the live picture, for visits, for views that follow an object and for clients. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"

#define TRACK_PX 3.0 /* of the disparities of one thing, or ... */
#define TRACK    0.3 /* ... this fraction of the disparity: depths behind leaves are less exact */
#define APART    0.5 /* of the height: distance between boxes of one thing, since a track lags on a slow machine */
#define HOLD_NS  INT64_C(1000000000) /* that an unconfirmed object lasts without news */

/* --- unconfirmed objects ------------------------------------------------------------------------------------------ */

static bool is_one(const double a[4], double a_px, const double b[4], double b_px)
{
    const double apart = APART * fmax(a[3] - a[1], b[3] - b[1]);

    return fmax(a[0], b[0]) - fmin(a[2], b[2]) < apart && fmax(a[1], b[1]) - fmin(a[3], b[3]) < apart &&
           fabs(a_px - b_px) <= fmax(TRACK_PX, TRACK * fmax(a_px, b_px));
}

static const struct sst_live_track *track_at(const struct live_engine *v, const struct sst_livepicture_arrival *at)
{
    for (int i = 0; i < v->tracks; i++)
        if (is_one(at->box, at->disp_px, v->track[i].at, v->track[i].disp_px))
            return &v->track[i];
    return NULL;
}

static void add_arrival(struct live_engine *v, const struct sst_livepicture_arrival *at)
{
    struct engine_unconfirmed *u = v->unconfirmed, *end = u + v->unconfirmeds;

    while (u < end && (u->t_ns == v->set_t_ns || !is_one(at->box, at->disp_px, u->at.box, u->at.disp_px)))
        u++;
    if (u == &v->unconfirmed[ARRAY_LEN(v->unconfirmed)])
        return;
    if (u == end) {
        v->unconfirmeds++;
        u->id = ++v->unconfirmed_ids;
    }
    u->at = *at;
    u->t_ns = v->set_t_ns;
}

void engine_unconfirmed_follow_locked(struct live_engine *v, const struct sst_livepicture_clear *shown)
{
    const bool fresh = shown && shown->arrivals && v->arrivals_t_ns != v->set_t_ns;
    int kept = 0;

    for (int i = 0; fresh && i < shown->arrivals; i++)
        add_arrival(v, &shown->arrival[i]);
    v->arrivals_t_ns = fresh ? v->set_t_ns : v->arrivals_t_ns;
    for (int i = 0; i < v->unconfirmeds; i++) {
        struct engine_unconfirmed u = v->unconfirmed[i];
        const struct sst_live_track *t = track_at(v, &u.at);

        u.track = t ? t->id : 0;
        if (u.t_ns <= v->set_t_ns && v->set_t_ns - u.t_ns < HOLD_NS && !(t && t->seen_ns > u.t_ns))
            v->unconfirmed[kept++] = u;
    }
    v->unconfirmeds = kept;
}

/* --- tracks ------------------------------------------------------------------------------------------------------- */

void engine_tracks_follow(struct live_engine *v)
{
    struct sst_live_track track[SST_LIVE_TRACKS];
    const int n = v->live ? sst_live_tracks(v->live, track) : 0;

    pthread_mutex_lock(&v->lock);
    engine_names_follow(v, track, n);
    v->tracks = n;
    memcpy(v->track, track, (size_t)n * sizeof(track[0]));
    v->tracks_set = v->set_index;
    v->tracks_t_ns = v->set_t_ns;
    v->tracks_wall_ns = v->set_wall_ns;
    engine_unconfirmed_follow_locked(v, NULL);
    engine_removed_locked(v);
    pthread_mutex_unlock(&v->lock);
}

const struct sst_live_track *engine_track_locked(const struct live_engine *v, uint32_t id)
{
    for (int i = 0; i < v->tracks; i++)
        if (v->track[i].id == id)
            return &v->track[i];
    return NULL;
}

const struct sst_live_track *engine_track_at_locked(const struct live_engine *v, double x, double y, double disp_px)
{
    const struct sst_live_track *best = NULL;

    for (int i = 0; i < v->tracks; i++) {
        const struct sst_live_track *t = &v->track[i];

        if (x < t->x0 || x > t->x1 || y < t->y0 || y > t->y1 || !(fabs(t->disp_px - disp_px) <= TRACK_PX))
            continue;
        if (!best || fabs(t->disp_px - disp_px) < fabs(best->disp_px - disp_px))
            best = t;
    }
    return best;
}

json_t *engine_track_json_locked(const struct live_engine *v, const struct sst_live_track *t)
{
    static const char *const states[] = { "seen", "covered", "still" };
    const struct sized *a = engine_sized(v, t->id);
    const int64_t seen_ns = t->state == SST_LIVE_TRACK_COVERED ? t->seen_ns : v->tracks_t_ns;
    char seen[SST_CLOCK_TEXT];

    sst_clock_text(seen, v->tracks_wall_ns - (v->tracks_t_ns - seen_ns));
    return json_pack(
        "{s:I, s:s, s:b, s:i, s:s, s:s, s:b, s:[f, f, f, f], s:[f, f, f, f], s:[f, f], s:f, s:o, s:o, s:o, s:f, s:s}",
        "track", (json_int_t)t->id, "state", states[t->state], "hidden", t->hidden, "label", t->label, "name",
        engine_label_name(v, t->label), "label_by", engine_named_by(v, t), "removed",
        isgreater(t->disp_px, v->state.cut_px) != 0, "box", t->x0, t->y0, t->x1, t->y1, "at", t->at[0], t->at[1],
        t->at[2], t->at[3], "speed_px_s", t->vx_px_s, t->vy_px_s, "disparity_px", t->disp_px, "distance_m",
        sst_api_real(engine_distance_m(v, t->disp_px)), "height_m", sst_api_real(a ? a->height_m : (double)NAN),
        "speed_m_s", sst_api_real(a ? a->speed_m_s : (double)NAN), "seconds",
        (double)(v->tracks_t_ns - t->first_ns) / 1e9, "seen", seen);
}

static json_t *unconfirmed_json_locked(const struct live_engine *v, const struct engine_unconfirmed *u)
{
    const double *box = u->at.box;
    char seen[SST_CLOCK_TEXT];

    sst_clock_text(seen, v->tracks_wall_ns - (v->tracks_t_ns - u->t_ns));
    return json_pack("{s:I, s:I, s:[f, f, f, f], s:f, s:o, s:s}", "id", (json_int_t)u->id, "track",
                     (json_int_t)u->track, "box", box[0], box[1], box[2], box[3], "disparity_px", u->at.disp_px,
                     "distance_m", sst_api_real(engine_distance_m(v, u->at.disp_px)), "seen", seen);
}

int engine_tracks(void *engine, struct sst_api_answer *out)
{
    struct live_engine *v = engine;
    json_t *list = json_array(), *unconfirmed = json_array();
    char time[SST_CLOCK_TEXT];

    pthread_mutex_lock(&v->lock);
    for (int i = 0; i < v->tracks; i++)
        json_array_append_new(list, engine_track_json_locked(v, &v->track[i]));
    for (int i = 0; i < v->unconfirmeds; i++)
        json_array_append_new(unconfirmed, unconfirmed_json_locked(v, &v->unconfirmed[i]));
    sst_clock_text(time, v->tracks_wall_ns);
    out->body = json_pack("{s:I, s:s?, s:o, s:o}", "set", (json_int_t)v->tracks_set, "time",
                          v->tracks_wall_ns ? time : NULL, "tracks", list, "unconfirmed", unconfirmed);
    pthread_mutex_unlock(&v->lock);
    return out->body ? 0 : -ENOMEM;
}
