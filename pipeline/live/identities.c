/* Data association between the scene's tracks and the search behind leaves, which both detect parts of a person behind
 * a hedge. A new detection is assigned to the identity that it fits by position, depth and motion, also to one that
 * begins in the same set. Two identities that move together are merged. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <string.h>

#include "pipeline/live/live_internal.h"

#define HOLD_NS    INT64_C(6000000000) /* an object that vanishes within the picture is covered for as long as this */
#define PREDICT_S  2.0                 /* it goes on, for as long as this, and may be ... */
#define REACH_S    0.5                 /* ... this much of its height away for each second since it was seen, ... */
#define REACH_MOST 1.0                 /* ... at most */
#define SAME_PX    3.0                 /* disparities of one thing, and ... */
#define SAME_RATIO 1.4                 /* ... their ratio: one of both is enough */
#define SURE_NS    INT64_C(3000000000) /* depth in the open is known better than behind leaves, for this long */
#define MOVING     0.25                /* of its height, in a second: it goes to one side */
#define SHRINK_S   0.1                 /* part by which its size shrinks in a second when only a part is seen */
#define TOGETHER_S 1.0                 /* two that move together for this long are one */
#define APART      0.5                 /* of the height: they do not move together */

/* --- bindings -------------------------------------------------------------------------------------------------------
 */

static struct live_identity *find(struct live_identities *w, uint32_t id)
{
    for (int i = 0; i < w->count && id; i++)
        if (w->who[i].track.id == id)
            return &w->who[i];
    return NULL;
}

static struct live_identity *bound_to(struct live_identities *w, enum live_part_kind kind, uint32_t key)
{
    for (int i = 0; i < w->parts; i++)
        if (w->part[i].kind == kind && w->part[i].key == key)
            return find(w, w->part[i].id);
    return NULL;
}

static void bind(struct live_identities *w, enum live_part_kind kind, uint32_t key, uint32_t id)
{
    if (w->parts < LIVE_PARTS)
        w->part[w->parts++] = (struct live_part){ kind, key, id };
}

/* Parts that have ended. */
static void forget_parts(struct live_identities *w, const struct live_seen *set)
{
    int kept = 0;

    for (int i = 0; i < w->parts; i++) {
        bool there = false;

        for (int k = 0; k < set->n; k++)
            there |= w->part[i].kind == LIVE_PART_OPEN && set->open[k].id == w->part[i].key;
        for (int k = 0; k < set->things; k++)
            there |= w->part[i].kind == LIVE_PART_HIDDEN && set->thing[k].key == w->part[i].key;
        if (there && find(w, w->part[i].id))
            w->part[kept++] = w->part[i];
    }
    w->parts = kept;
}

/* --- is it the same? ------------------------------------------------------------------------------------------------
 */

static bool same_depth(double a_px, double b_px)
{
    return fabs(a_px - b_px) <= SAME_PX || (a_px > 0 && b_px > 0 && fabs(log(a_px / b_px)) <= log(SAME_RATIO));
}

static bool goes_against(double a, double b, double least)
{
    return fabs(a) > least && fabs(b) > least && a * b < 0;
}

static double middle_x(const struct sst_live_track *t)
{
    return (t->x0 + t->x1) / 2;
}

static double middle_y(const struct sst_live_track *t)
{
    return (t->y0 + t->y1) / 2;
}

static double age_s(const struct live_identity *a, int64_t t_ns)
{
    return sst_clamp_double((double)(t_ns - a->seen_ns) * 1e-9, 0, (double)HOLD_NS * 1e-9);
}

/* How badly a part fits to an identity; infinite: not at all. */
static double misfit(const struct live_identity *a, const struct sst_live_track *t, int64_t t_ns)
{
    const double high = fmax(a->height, t->y1 - t->y0), wide = fmax(a->width, t->x1 - t->x0);
    const double s = age_s(a, t_ns), far = fmin(REACH_S * s, REACH_MOST) * high, on = fmin(s, PREDICT_S);
    const double dx = fabs(middle_x(t) - middle_x(&a->seen) - a->seen.vx_px_s * on) / (wide + far);
    const double dy = fabs(middle_y(t) - middle_y(&a->seen) - a->seen.vy_px_s * on) / (high + far);

    if (dx > 1 || dy > 1 || !same_depth(a->track.disp_px, t->disp_px) ||
        goes_against(a->seen.vx_px_s, t->vx_px_s, MOVING * high))
        return INFINITY;
    return dx + dy;
}

/* The identity that a new part fits best. @param kind  one that has such a part now is another thing; NULL: none */
static struct live_identity *recognise(struct live_identities *w, enum live_part_kind kind,
                                       const struct sst_live_track *t, int64_t t_ns)
{
    struct live_identity *best = NULL;
    double least = INFINITY;

    for (int i = 0; i < w->count; i++) {
        struct live_identity *a = &w->who[i];
        const double m = a->has[kind] ? INFINITY : misfit(a, t, t_ns);

        if (m < least) {
            least = m;
            best = a;
        }
    }
    return best;
}

/* --- parts of a set -------------------------------------------------------------------------------------------------
 */

static struct sst_live_track as_track(const struct sst_hidden_thing *t)
{
    return (struct sst_live_track){ .state = t->seen ? SST_LIVE_TRACK_SEEN : SST_LIVE_TRACK_COVERED,
                                    .hidden = true,
                                    .x0 = t->x0,
                                    .y0 = t->y0,
                                    .x1 = t->x1,
                                    .y1 = t->y1,
                                    .at = { t->x0, t->y0, t->x1, t->y1 },
                                    .vx_px_s = t->vx_px_s,
                                    .vy_px_s = t->vy_px_s,
                                    .disp_px = t->disp_px,
                                    .first_ns = t->first_ns,
                                    .seen_ns = t->seen_ns };
}

/* Is a part a better description of its identity than the one that it has from this set? Detections in the open are
 * measured best, then detections behind leaves, then predictions of the scene's tracks. */
static bool is_better(const struct live_identity *a, const struct sst_live_track *t)
{
    if (!a->updated)
        return true;
    if ((a->track.state == SST_LIVE_TRACK_COVERED) != (t->state == SST_LIVE_TRACK_COVERED))
        return t->state != SST_LIVE_TRACK_COVERED;
    return a->track.hidden && !t->hidden;
}

static void describe(struct live_identity *a, const struct sst_live_track *t, int64_t t_ns)
{
    const uint32_t id = a->track.id;
    const int label = t->label ? t->label : a->track.label;
    const int64_t first_ns = t->first_ns < a->track.first_ns ? t->first_ns : a->track.first_ns;
    const int64_t seen_ns = t->seen_ns > a->track.seen_ns ? t->seen_ns : a->track.seen_ns;

    if (!is_better(a, t))
        return;
    a->track = *t;
    a->track.id = id;
    a->track.label = label;
    a->track.first_ns = first_ns;
    a->track.seen_ns = seen_ns;
    a->updated = true;
    if (t->state != SST_LIVE_TRACK_COVERED) {
        a->seen = *t;
        a->seen_ns = t_ns;
    }
    if (!t->hidden && t->state != SST_LIVE_TRACK_COVERED) {
        a->sure_px = t->disp_px;
        a->sure_ns = t_ns;
    } else if (a->sure_ns && t_ns - a->sure_ns <= SURE_NS) {
        a->track.disp_px = a->sure_px;
    }
}

static void measure(struct live_identity *a, double dt_s)
{
    const double keep = fmax(1 - SHRINK_S * dt_s, 0);

    if (a->track.state == SST_LIVE_TRACK_COVERED)
        return;
    a->width = fmax(a->track.x1 - a->track.x0, keep * a->width);
    a->height = fmax(a->track.y1 - a->track.y0, keep * a->height);
}

/* Room for another identity: a free one, or the one seen longest ago. @return NULL: all are there now */
static struct live_identity *make_room(struct live_identities *w)
{
    struct live_identity *oldest = NULL;

    if (w->count < LIVE_IDENTITIES)
        return &w->who[w->count++];
    for (int i = 0; i < w->count; i++)
        if (!w->who[i].updated && (!oldest || w->who[i].seen_ns < oldest->seen_ns))
            oldest = &w->who[i];
    return oldest;
}

/* A part that no identity has. */
static void meet(struct live_identities *w, enum live_part_kind kind, uint32_t key, const struct sst_live_track *t,
                 int64_t t_ns)
{
    struct live_identity *a = recognise(w, kind, t, t_ns);

    if (!a) {
        a = make_room(w);
        if (!a)
            return;
        *a = (struct live_identity){ .track = *t };
        a->track.id = ++w->ids;
    }
    bind(w, kind, key, a->track.id);
    a->has[kind] = true;
    describe(a, t, t_ns);
    measure(a, 0);
}

static void follow_parts(struct live_identities *w, const struct live_seen *set)
{
    for (int i = 0; i < set->n; i++) {
        struct live_identity *a = bound_to(w, LIVE_PART_OPEN, set->open[i].id);

        if (!a)
            continue;
        a->has[LIVE_PART_OPEN] |= set->open[i].state != SST_LIVE_TRACK_COVERED;
        describe(a, &set->open[i], set->t_ns);
    }
    for (int i = 0; i < set->things; i++) {
        struct live_identity *a = bound_to(w, LIVE_PART_HIDDEN, set->thing[i].key);
        const struct sst_live_track t = as_track(&set->thing[i]);

        if (!a)
            continue;
        a->has[LIVE_PART_HIDDEN] |= set->thing[i].seen;
        describe(a, &t, set->t_ns);
    }
}

static void meet_parts(struct live_identities *w, const struct live_seen *set)
{
    for (int i = 0; i < set->n; i++)
        if (set->open[i].state != SST_LIVE_TRACK_COVERED && !bound_to(w, LIVE_PART_OPEN, set->open[i].id))
            meet(w, LIVE_PART_OPEN, set->open[i].id, &set->open[i], set->t_ns);
    for (int i = 0; i < set->things; i++) {
        const struct sst_live_track t = as_track(&set->thing[i]);

        if (set->thing[i].reported && set->thing[i].seen && !bound_to(w, LIVE_PART_HIDDEN, set->thing[i].key))
            meet(w, LIVE_PART_HIDDEN, set->thing[i].key, &t, set->t_ns);
    }
}

/* --- two that are one -----------------------------------------------------------------------------------------------
 */

/* Are they of different kinds, so that they may be one? */
static bool may_be_one(const struct live_identity *a, const struct live_identity *b)
{
    return a->track.state == SST_LIVE_TRACK_SEEN && b->track.state == SST_LIVE_TRACK_SEEN &&
           !(a->has[LIVE_PART_OPEN] && b->has[LIVE_PART_OPEN]) &&
           !(a->has[LIVE_PART_HIDDEN] && b->has[LIVE_PART_HIDDEN]);
}

/* The younger becomes the older one. */
static void unite(struct live_identities *w, struct live_identity *a, struct live_identity *b)
{
    struct live_identity *to = a->track.id < b->track.id ? a : b, *from = to == a ? b : a;

    for (int i = 0; i < w->parts; i++)
        w->part[i].id = w->part[i].id == from->track.id ? to->track.id : w->part[i].id;
    for (int kind = 0; kind < 2; kind++)
        to->has[kind] |= from->has[kind];
    to->track.label = to->track.label ? to->track.label : from->track.label;
    from->track.id = 0;
}

/* One of another kind at the same place. */
static struct live_identity *find_beside(struct live_identities *w, const struct live_identity *a, int64_t t_ns)
{
    struct live_identity *best = NULL;
    double least = INFINITY;

    for (int i = 0; i < w->count && a->track.id; i++) {
        struct live_identity *b = &w->who[i];
        const double m = b != a && b->track.id && may_be_one(a, b) ? misfit(b, &a->track, t_ns) : INFINITY;

        if (m < least) {
            least = m;
            best = b;
        }
    }
    return best;
}

static void unite_all(struct live_identities *w, int64_t t_ns)
{
    for (int i = 0; i < w->count; i++) {
        struct live_identity *a = &w->who[i], *b = find_beside(w, a, t_ns);
        const double from_b = b ? middle_x(&a->track) - middle_x(&b->track) : 0;

        if (b && a->beside == b->track.id && fabs(from_b - a->beside_x) <= APART * fmax(a->height, b->height)) {
            if ((double)(t_ns - a->beside_ns) * 1e-9 >= TOGETHER_S)
                unite(w, a, b);
            continue;
        }
        a->beside = b ? b->track.id : 0;
        a->beside_x = from_b;
        a->beside_ns = t_ns;
    }
}

/* --- a set ----------------------------------------------------------------------------------------------------------
 */

/* @return false: it has gone */
static bool stays(struct live_identity *a, int width, int height, int64_t t_ns)
{
    const double s = age_s(a, t_ns);
    const double x = middle_x(&a->seen) + a->seen.vx_px_s * s, y = middle_y(&a->seen) + a->seen.vy_px_s * s;

    if (!a->track.id || a->updated)
        return a->track.id;
    a->track.state = SST_LIVE_TRACK_COVERED;
    return x >= 0 && x <= width && y >= 0 && y <= height && t_ns - a->seen_ns <= HOLD_NS;
}

/* Where time goes back nothing was seen later than now: covered objects are held from now on. */
static void start_times(struct live_identities *w, int64_t t_ns)
{
    for (int i = 0; i < w->count; i++) {
        struct live_identity *a = &w->who[i];

        a->seen_ns = a->seen_ns < t_ns ? a->seen_ns : t_ns;
        a->sure_ns = a->sure_ns < t_ns ? a->sure_ns : t_ns;
        a->beside_ns = a->beside_ns < t_ns ? a->beside_ns : t_ns;
    }
}

void live_identities_update(struct live_identities *w, const struct live_seen *set)
{
    const int64_t t_ns = set->t_ns;
    const double dt_s = w->t_ns ? fmax((double)(t_ns - w->t_ns) * 1e-9, 0) : 0;
    int kept = 0;

    if (t_ns < w->t_ns)
        start_times(w, t_ns);
    w->t_ns = t_ns;
    for (int i = 0; i < w->count; i++) {
        w->who[i].updated = false;
        memset(w->who[i].has, 0, sizeof(w->who[i].has));
    }
    forget_parts(w, set);
    follow_parts(w, set);
    for (int i = 0; i < w->count; i++)
        if (w->who[i].updated)
            measure(&w->who[i], dt_s);
    meet_parts(w, set);
    unite_all(w, t_ns);
    for (int i = 0; i < w->count; i++)
        if (stays(&w->who[i], set->width, set->height, t_ns))
            w->who[kept++] = w->who[i];
    w->count = kept;
}

int live_identities_tracks(const struct live_identities *w, struct sst_live_track track[SST_LIVE_TRACKS])
{
    const int n = sst_min_int(w->count, SST_LIVE_TRACKS);

    for (int i = 0; i < n; i++)
        track[i] = w->who[i].track;
    return n;
}
