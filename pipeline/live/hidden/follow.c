/* Tracks of candidates from set to set. An object is a candidate that returns at about the same place and depth, each
 * time above the background model; its excess over the least of a candidate, summed over time, is its evidence. The
 * evidence of chance is learnt from tracks that end without a report: their number falls exponentially with their
 * evidence, so that the evidence which chance reaches at the accepted rate follows from their rate and mean. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include "pipeline/live/hidden/hidden_internal.h"

#define LEAST       2.0 /* standard deviations that count for nothing */
#define MOST        9.0 /* that count at most in one set */
#define SET_MOST_S  1.0 /* time that a set stands for at most */
#define LOSS        2.0 /* of evidence in a second without a candidate */
#define LOST_S      3.0
#define STILL_S     20.0 /* without any change in the scene: persons move sooner or later */
#define LOST_SETS   2
#define REACH       0.5  /* of the height: a thing moves by this at once, ... */
#define SPEED       1.0  /* ... and by this in a second, ... */
#define REACH_S     1.5  /* ... for at most this time: a candidate farther away belongs to another thing or is noise */
#define DEPTH_STEPS 4.0  /* planes */
#define IMAGE       0.6  /* one that differs much shows images of itself on other planes, weaker than this ... */
#define IMAGE_SIDES 2.0  /* ... within this many times the sizes of both together */
#define IMAGE_SETS  2    /* of a better one */
#define KNOWN_S     2.0  /* after the report, its depth is known: one farther from it than ... */
#define KNOWN_STEPS 2.0  /* ... this many planes is no image of it */
#define FAINT       0.25 /* of a reported one's candidates lately: less is chance, or leaves, and does not keep it */
#define GAIN        0.7
#define GAIN_Z      0.3
#define GAIN_SPEED  0.25
#define GAIN_SIZE   0.25
#define GAIN_DEPTH  0.1 /* at least: a mean in the beginning */
#define SETS        3   /* and seconds of a thing that is reported */
#define SECONDS     1.0
/* While the level of the leaves is not known: times the evidence, of a thing that has moved by this much of its size.
 */
#define EARLY       1.5
#define EARLY_MOVED 0.5
#define LEFT_NS     INT64_C(12000000000) /* for this long it counts that a reported one has been at a place */
#define AFTER_S     30.0                 /* until a track is reported that begins there, or has been beside one */
#define RESTS_NS    INT64_C(8000000000)  /* in one place: a standing person, or leaves that one has disturbed */
#define STAYS_S     600.0                /* an object that has not moved for this long is part of the scene */
#define PEAK_MIN    1.0
/* At the start: as if chance had made tracks for these hours, at this rate an hour and with this mean evidence. */
#define PRIOR_H     0.03
#define PRIOR_RATE  60.0
#define PRIOR_MEAN  1.0
#define MEMORY_H    3.0
#define CHANCE_MOST 2.0 /* largest evidence counted of one: it may have been a person */
#define LOWEST      4.0
#define HIGHEST     40.0

void hidden_tracks_init(struct hidden_tracks *t, double alarms_per_hour)
{
    *t = (struct hidden_tracks){ .next_key = 1,
                                 .alarms_per_hour = alarms_per_hour,
                                 .chances = PRIOR_RATE * PRIOR_H,
                                 .chance_sum = PRIOR_RATE * PRIOR_H * PRIOR_MEAN,
                                 .chance_h = PRIOR_H };
}

double hidden_tracks_threshold(const struct hidden_tracks *t)
{
    const double mean = t->chance_sum / t->chances, rate = t->chances / t->chance_h;

    return sst_clamp_double(PEAK_MIN + mean * log(rate / t->alarms_per_hour), LOWEST, HIGHEST);
}

static void note_time(struct hidden_tracks *t, double hours)
{
    const double keep = fmax(1 - hours / MEMORY_H, 0);

    t->chances = t->chances * keep + 1e-3 * (1 - keep);
    t->chance_sum = t->chance_sum * keep + 1e-3 * PRIOR_MEAN * (1 - keep);
    t->chance_h = t->chance_h * keep + hours;
}

static void note_chance(struct hidden_tracks *t, const struct hidden_track *a)
{
    if (a->thing.reported || a->beside || a->sets < 2 || a->peak < PEAK_MIN)
        return;
    t->chances++;
    t->chance_sum += fmin(a->peak - PEAK_MIN, CHANCE_MOST);
}

/* --- candidates that are parts of one thing -------------------------------------------------------------------------
 */

struct group {
    double x0, y0, x1, y1, disp_px, z;
    double weight; /* of the mean disparity: standard deviations */
};

static bool belongs(const struct group *g, const struct group *c, double depth_px)
{
    const double gap_x = fmax(g->x0, c->x0) - fmin(g->x1, c->x1), gap_y = fmax(g->y0, c->y0) - fmin(g->y1, c->y1);
    const double side = fmin(g->x1 - g->x0, c->x1 - c->x0), high = fmin(g->y1 - g->y0, c->y1 - c->y0);

    return gap_x < -side / 4 && gap_y < high / 4 && fabs(g->disp_px - c->disp_px) <= depth_px;
}

static int join(struct group *g, const struct hidden_candidate *c, int count, const struct hidden_planes *p)
{
    int n = 0;

    for (int i = 0; i < count; i++) {
        const struct group one = { c[i].at.x0, c[i].at.y0, c[i].at.x1, c[i].at.y1, p->disp_px[c[i].plane],
                                   c[i].z,     c[i].z };
        int k = 0;

        while (k < n && !belongs(&g[k], &one, DEPTH_STEPS * p->step_px))
            k++;
        if (k == n) {
            g[n++] = one;
            continue;
        }
        g[k].x0 = fmin(g[k].x0, one.x0);
        g[k].y0 = fmin(g[k].y0, one.y0);
        g[k].x1 = fmax(g[k].x1, one.x1);
        g[k].y1 = fmax(g[k].y1, one.y1);
        g[k].weight += one.z;
        g[k].disp_px += (one.disp_px - g[k].disp_px) * one.z / g[k].weight;
    }
    return n;
}

/* --- tracks ----------------------------------------------------------------------------------------------------------
 */

/* How badly a group fits; infinite: not at all. */
static double misfit(const struct hidden_track *a, const struct group *g, double depth_px, int64_t t_ns)
{
    const double age_s = sst_clamp_double((double)(t_ns - a->thing.seen_ns) * 1e-9, 0, REACH_S);
    const double reach = fmax(a->h, g->y1 - g->y0) * (REACH + SPEED * age_s);
    const double dx = fabs((g->x0 + g->x1) / 2 - a->x) / reach, dy = fabs((g->y0 + g->y1) / 2 - a->y) / reach;
    const double dd = fabs(g->disp_px - a->thing.disp_px) / depth_px;
    const bool faint = a->thing.reported && g->z < FAINT * a->z;

    return faint || dx > 1 || dy > 1 || dd > 1 ? INFINITY : dx + dy + dd - g->z / 10;
}

static void see(struct hidden_track *a, const struct group *g, double dt_s, int64_t t_ns)
{
    const double rx = (g->x0 + g->x1) / 2 - a->x, ry = (g->y0 + g->y1) / 2 - a->y;

    a->x += GAIN * rx;
    a->y += GAIN * ry;
    if (dt_s > 0) {
        a->vx = sst_clamp_double(a->vx + GAIN_SPEED * rx / dt_s, -SPEED * a->h, SPEED * a->h);
        a->vy = sst_clamp_double(a->vy + GAIN_SPEED * ry / dt_s, -SPEED * a->h, SPEED * a->h);
    }
    a->w += GAIN_SIZE * (g->x1 - g->x0 - a->w);
    a->h += GAIN_SIZE * (g->y1 - g->y0 - a->h);
    a->thing.disp_px += fmax(GAIN_DEPTH, 1.0 / (a->sets + 1)) * (g->disp_px - a->thing.disp_px);
    a->thing.evidence += (fmin(g->z, MOST) - LEAST) * fmin(dt_s, SET_MOST_S);
    a->peak = fmax(a->peak, a->thing.evidence);
    a->thing.evidence = fmin(a->thing.evidence, 2 * HIGHEST);
    a->thing.seen_ns = t_ns;
    a->z += GAIN_Z * (g->z - a->z);
    a->sets++;
    a->seen = true;
}

/* Sizes by which it has gone away from a place. */
static double moved_from(const struct hidden_track *a, double x, double y)
{
    return hypot(a->x - x, a->y - y) / fmax(fmax(a->w, a->h), 1);
}

/* Sizes by which it has gone away from where it began. */
static double moved(const struct hidden_track *a)
{
    return moved_from(a, a->from_x, a->from_y);
}

bool hidden_track_rests(const struct hidden_track *a, int64_t t_ns)
{
    return hidden_track_moved(a) && t_ns - a->rest_ns > RESTS_NS;
}

bool hidden_track_moved(const struct hidden_track *a)
{
    return moved(a) > 1;
}

/* A passing person disturbs the leaves, and their background model, for some seconds. */
static void note_left(struct hidden_tracks *t, const struct hidden_track *a, double x, double y)
{
    const int n = sst_min_int(t->lefts, HIDDEN_LEFT);

    for (int i = 0; i < n; i++) {
        struct hidden_left *l = &t->left[i];

        if (t->t_ns - l->t_ns < LEFT_NS && fabs(l->x - x) < a->w / 2 && fabs(l->y - y) < a->h / 4) {
            l->t_ns = t->t_ns;
            return;
        }
    }
    t->left[t->lefts++ % HIDDEN_LEFT] = (struct hidden_left){ x, y, a->w, a->h, a->thing.disp_px, t->t_ns };
}

/* The way of a track until it was reported: about straight. */
static void note_way(struct hidden_tracks *t, const struct hidden_track *a)
{
    const double dx = a->x - a->from_x, dy = a->y - a->from_y;
    const int n = sst_min_int((int)(2 * hypot(dx, dy) / fmax(a->w, 1)) + 1, HIDDEN_LEFT / 2);

    for (int i = 0; i < n; i++)
        note_left(t, a, a->from_x + i * dx / n, a->from_y + i * dy / n);
}

static bool meets(const struct hidden_left *l, const struct hidden_track *a)
{
    return 2 * fabs(l->x - a->x) < l->w + a->w && 2 * fabs(l->y - a->y) < l->h + a->h;
}

bool hidden_tracks_left(const struct hidden_tracks *t, const struct hidden_left *l)
{
    bool there = false;

    for (int i = 0; i < t->count; i++)
        there |= t->track[i].thing.reported && t->track[i].seen && meets(l, &t->track[i]);
    return t->t_ns - l->t_ns < LEFT_NS && !there;
}

static bool was_left(const struct hidden_tracks *t, const struct hidden_track *a)
{
    bool was = false;

    for (int i = 0; i < sst_min_int(t->lefts, HIDDEN_LEFT); i++)
        was |= t->t_ns - t->left[i].t_ns < LEFT_NS && meets(&t->left[i], a);
    return was;
}

static bool is_near(const struct hidden_track *a, const struct hidden_track *b)
{
    return fabs(b->x - a->x) < IMAGE_SIDES * (a->w + b->w) && fabs(b->y - a->y) < IMAGE_SIDES * (a->h + b->h);
}

/* Head and feet, or an edge at another depth, of one that is reported are no others, nor are its images. */
static bool is_part(const struct hidden_tracks *t, const struct hidden_track *a)
{
    bool part = false;

    for (int i = 0; i < t->count; i++) {
        const struct hidden_track *b = &t->track[i];

        part |= b != a && b->thing.reported && b->seen && fabs(b->x - a->x) < a->w + b->w &&
                fabs(b->y - a->y) < 1.25 * (a->h + b->h);
        part |= b != a && b->thing.reported && a->z < IMAGE * b->z && is_near(a, b);
    }
    return part;
}

static bool may_be_reported(const struct hidden_tracks *t, const struct hidden_track *a, double threshold)
{
    const double age_s = (double)(t->t_ns - a->thing.first_ns) * 1e-9;

    return !a->thing.reported && a->thing.evidence >= threshold && a->sets >= SETS && !is_part(t, a) &&
           age_s >= (a->beside ? AFTER_S : SECONDS) && (!t->early || moved(a) > EARLY_MOVED);
}

static void add(struct hidden_tracks *t, const struct group *g, int64_t t_ns)
{
    struct hidden_track *a = &t->track[t->count];

    if (t->count == SST_HIDDEN_THINGS)
        return;
    t->count++;
    *a = (struct hidden_track){ .x = (g->x0 + g->x1) / 2,
                                .y = (g->y0 + g->y1) / 2,
                                .w = g->x1 - g->x0,
                                .h = g->y1 - g->y0,
                                .z = g->z,
                                .sets = 1,
                                .seen = true };
    a->from_x = a->rest_x = a->x;
    a->from_y = a->rest_y = a->y;
    a->rest_ns = t_ns;
    a->behind_one = was_left(t, a);
    a->thing =
        (struct sst_hidden_thing){ .key = t->next_key++, .disp_px = g->disp_px, .first_ns = t_ns, .seen_ns = t_ns };
}

static void assign(struct hidden_tracks *t, struct group *g, int groups, double dt_s)
{
    const int64_t t_ns = t->t_ns;

    for (;;) {
        double best = INFINITY;
        int track = -1, of = -1;

        for (int i = 0; i < t->count; i++) {
            for (int k = 0; k < groups && !t->track[i].seen; k++) {
                const double m = g[k].z > 0 ? misfit(&t->track[i], &g[k], DEPTH_STEPS * t->step_px, t_ns) : INFINITY;

                if (m < best) {
                    best = m;
                    track = i;
                    of = k;
                }
            }
        }
        if (track < 0)
            return;
        see(&t->track[track], &g[of], dt_s, t_ns);
        g[of].z = 0;
    }
}

/* @return false: it ends */
static bool stays(struct hidden_track *a, double dt_s, int64_t t_ns)
{
    const double missed_s = (double)(t_ns - a->thing.seen_ns) * 1e-9;

    if (!a->seen) {
        a->thing.evidence -= LOSS * fmin(dt_s, SET_MOST_S);
        a->vx *= 0.5;
        a->vy *= 0.5;
    }
    if ((double)(t_ns - a->thing.first_ns) * 1e-9 > STAYS_S)
        return false;
    return a->thing.evidence >= 0 && (missed_s <= LOST_S || missed_s <= LOST_SETS * dt_s);
}

/* A track goes on as another one, which is reported in its place. */
static void go_on_as(struct hidden_track *a, struct hidden_track *b)
{
    const uint32_t key = b->thing.key;

    b->thing.key = a->thing.key;
    b->thing.reported = true;
    b->reported_ns = a->reported_ns;
    b->thing.first_ns = a->thing.first_ns < b->thing.first_ns ? a->thing.first_ns : b->thing.first_ns;
    b->from_x = a->from_x;
    b->from_y = a->from_y;
    b->rest_x = a->rest_x;
    b->rest_y = a->rest_y;
    b->rest_ns = a->rest_ns;
    a->thing.key = key;
    a->thing.reported = false;
    a->beside = true;
}

/* A person of high contrast has images on many planes, the best one on the right plane; which image has enough evidence
 * first is chance. Later the depth is known, and leaves that the person has disturbed are no image.
 * @return the best track that stays and is not reported, near a track and with no less evidence, begun until then;
 * NULL: none */
static struct hidden_track *best_near(struct hidden_tracks *t, const struct hidden_track *a, double evidence,
                                      int64_t until_ns)
{
    const bool known = a->thing.reported && (double)(t->t_ns - a->reported_ns) * 1e-9 >= KNOWN_S;
    struct hidden_track *best = NULL;

    for (int i = 0; i < t->count; i++) {
        struct hidden_track *b = &t->track[i];

        if (b != a && !b->thing.reported && b->seen && !b->gone && b->sets >= IMAGE_SETS &&
            b->thing.evidence >= evidence && b->thing.first_ns <= until_ns && is_near(a, b) &&
            (!known || fabs(b->thing.disp_px - a->thing.disp_px) <= KNOWN_STEPS * t->step_px) &&
            (!best || b->z > best->z))
            best = b;
    }
    return best;
}

/* One that was an image of a reported track, or a part of it, is that thing when the track is lost; what the leaves
 * show after it, which is far weaker, is not. */
static void leave_to_heir(struct hidden_tracks *t, struct hidden_track *lost, double threshold)
{
    struct hidden_track *heir = lost->thing.reported ? best_near(t, lost, threshold, lost->thing.seen_ns) : NULL;

    if (heir && heir->z >= FAINT * lost->z)
        go_on_as(lost, heir);
}

/* A reported track that turns out to be an image of a better one becomes that. */
static void become_better(struct hidden_tracks *t, struct hidden_track *a, double threshold)
{
    struct hidden_track *b = a->thing.reported ? best_near(t, a, threshold, t->t_ns) : NULL;

    if (b && (a->seen ? IMAGE * b->z : b->z) > a->z)
        go_on_as(a, b);
}

/* Report a track, or the one that it is an image of. */
static void report(struct hidden_tracks *t, struct hidden_track *a)
{
    struct hidden_track *b = best_near(t, a, 0, t->t_ns);

    a->thing.reported = true;
    a->reported_ns = t->t_ns;
    if (b && b->z > a->z)
        go_on_as(a, b);
    note_way(t, b && b->thing.reported ? b : a);
}

void hidden_tracks_doubt(struct hidden_tracks *t)
{
    int kept = 0;

    for (int i = 0; i < t->count; i++)
        if (t->track[i].thing.reported)
            t->track[kept++] = t->track[i];
    t->count = kept;
}

void hidden_tracks_wait(struct hidden_tracks *t, int64_t t_ns)
{
    const double dt_s = fmax((double)(t_ns - t->t_ns) * 1e-9, 0);
    int kept = 0;

    for (int i = 0; i < t->count; i++) {
        struct hidden_track *a = &t->track[i];

        a->seen &= (double)(t_ns - a->thing.seen_ns) * 1e-9 <= STILL_S;
        a->vx = a->vy = 0;
        if (a->seen || stays(a, dt_s, t_ns))
            t->track[kept++] = *a;
        else
            note_chance(t, a);
    }
    t->count = kept;
    note_time(t, fmin(dt_s, SET_MOST_S) / 3600);
    t->t_ns = t_ns;
}

void hidden_tracks_follow(struct hidden_tracks *t, const struct hidden_candidate *c, int count,
                          const struct hidden_planes *p, int64_t t_ns)
{
    const double dt_s = t->t_ns ? fmax((double)(t_ns - t->t_ns) * 1e-9, 0) : 0;
    struct group g[SST_HIDDEN_THINGS];
    const int groups = join(g, c, count, p);
    const double threshold = hidden_tracks_threshold(t) * (t->early ? EARLY : 1);
    int kept = 0;

    t->t_ns = t_ns;
    t->step_px = p->step_px;
    for (int i = 0; i < t->count; i++) {
        struct hidden_track *a = &t->track[i];

        a->x += a->vx * fmin(dt_s, SET_MOST_S);
        a->y += a->vy * fmin(dt_s, SET_MOST_S);
        a->seen = false;
    }
    assign(t, g, groups, dt_s);
    for (int i = 0; i < t->count; i++) {
        struct hidden_track *a = &t->track[i];

        a->beside |= a->behind_one || is_part(t, a) || was_left(t, a);
        a->gone = !stays(a, dt_s, t_ns);
    }
    for (int i = 0; i < t->count; i++) {
        if (t->track[i].gone)
            leave_to_heir(t, &t->track[i], threshold);
        else
            become_better(t, &t->track[i], threshold);
    }
    for (int i = 0; i < t->count; i++)
        if (!t->track[i].gone && may_be_reported(t, &t->track[i], threshold))
            report(t, &t->track[i]);
    for (int i = 0; i < t->count; i++) {
        struct hidden_track *a = &t->track[i];

        if (a->gone) {
            if (!t->early)
                note_chance(t, a);
            continue;
        }
        if (a->thing.reported && a->seen)
            note_left(t, a, a->x, a->y);
        if (moved_from(a, a->rest_x, a->rest_y) > 1) {
            a->rest_x = a->x;
            a->rest_y = a->y;
            a->rest_ns = t_ns;
        }
        t->track[kept++] = *a;
    }
    t->count = kept;
    for (int k = 0; k < groups; k++)
        if (g[k].z > 0)
            add(t, &g[k], t_ns);
    if (!t->early)
        note_time(t, fmin(dt_s, SET_MOST_S) / 3600);
}
