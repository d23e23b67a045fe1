/* The automatic cut of clear pictures, and the histogram that the page draws it into.
 *
 * The cut lies at the near end of the gap behind the foreground, so that visitors in the gap stay in the picture, and
 * is never behind a track that moves behind the foreground. A cut is useful where other views see behind the removed
 * surfaces. A known cut stays while its foreground does, also when the foreground object has left: it waits for the
 * next one. When its gap has been closed for a second, or a useful cut that removes less has been found for a second,
 * the new cut replaces it, or none does. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "pipeline/live/live_internal.h"

#define FINE_SHIFT  3 /* of stored disparities, for the histogram */
#define FINE_BINS   (1 << (16 - FINE_SHIFT))
#define WAIT_NS     INT64_C(1000000000)
#define FARTHER_NS  INT64_C(20000000000) /* farther, while its foreground is there: somebody may stand in the gap */
#define MOVED_SHARE 0.05                 /* of all rays between two cuts that are not the same */
#define LEFT_SHARE  0.5                  /* of the rays in front of the cut: the foreground has left */
#define SAME_PX     1.0                  /* apart: the same cut */
#define CLOSE_PX    0.5                  /* to both sides of a cut, where ... */
#define CLOSE_SHARE 0.01                 /* ... this fraction of the rays closes the gap */
#define SEEN_SHARE  0.5 /* of the removed pixels: other views see behind them. In dense leaves the maps ... */
#define DENSE       0.9 /* ... confirm a smaller fraction than this, and say little about that */
/* Distance of the cut from the near side of its gap, of which maps place some rays too far. */
#define MARGIN_PX 1.25
#define MARGIN    0.25 /* of the gap, at most */
/* Distance of the cut from a track behind it. */
#define BEFORE        0.05 /* of its disparity */
#define BEFORE_HIDDEN 0.08 /* depths of hidden things are less exact */
#define STEADY_PX     0.25 /* in addition: not again with each step that comes nearer */
#define BEFORE_PX     0.5
#define VISITOR_SHARE 0.15 /* of all rays, at most: a visitor in the gap */
#define FRONT_SHARE   0.05 /* of all rays, nearer than a track: it moves behind the foreground */
#define FEW_SHARE     0.08 /* of the foreground's rays: wrong depths in its gap, and its farthest leaves */
#define STEP_PX       0.25
#define GUARD_NS      INT64_C(3000000000) /* after the last track that needed another cut */

/* Fraction of the counted rays with a disparity of from_px .. to_px. */
static double share_between(const struct sst_live *live, double from_px, double to_px)
{
    const struct sst_label_histogram *h = &live->renderer->histogram;
    const double lo = (fmin(from_px, to_px) - h->disp_min_px) * SST_DISP_SCALE;
    const double hi = (fmax(from_px, to_px) - h->disp_min_px) * SST_DISP_SCALE;
    uint64_t inside = 0, all = 0;

    for (int label = 0; label < 256; label++) {
        for (int bin = h->first_bin; h->count[label] && bin < h->bins; bin++) {
            all += h->count[label][bin];
            inside += bin > lo && bin <= hi ? h->count[label][bin] : 0;
        }
    }
    return all ? (double)inside / (double)all : 0;
}

/* Do other views see behind enough of what the cut removes from the lead view? By the samples of
 * sst_render_focus_vote(). */
static bool sees_behind(const struct sst_live *live, double cut_px)
{
    const struct sst_render_focus *f = &live->focus;
    const int cut_q6 = (int)((cut_px - live->lf.disp_min_px) * SST_DISP_SCALE);
    int removed = 0, seen = 0;

    for (int i = 0; i < f->cells; i++) {
        if (f->front[i] == SST_DISP_NONE || f->front[i] <= cut_q6)
            continue;
        removed++;
        seen += f->behind[i] && f->behind[i] - 1 <= cut_q6;
    }
    return seen >= SEEN_SHARE * removed;
}

static double share_nearer(const struct sst_live *live, double px)
{
    return share_between(live, px, INFINITY);
}

/* Is there a track in the open between two disparities? */
static bool has_walker(const struct live_cut *c, double from_px, double to_px)
{
    for (int i = 0; i < c->tracks; i++)
        if (!c->track[i].hidden && c->track[i].disp_px > from_px && c->track[i].disp_px < to_px)
            return true;
    return false;
}

/* Next value of the cut; NaN: none. @param wait_ns  out, how long it has to be found before it applies */
static double wanted(const struct sst_live *live, double found_px, int64_t *wait_ns)
{
    const struct live_cut *c = &live->cut;
    const double cut_px = c->gap_px;
    const bool open = !isnan(cut_px) && share_between(live, cut_px - CLOSE_PX, cut_px + CLOSE_PX) <= CLOSE_SHARE;
    const bool useful = !isnan(found_px) && (live->confirmed < DENSE || sees_behind(live, found_px));
    const bool there = !isnan(cut_px) && share_nearer(live, cut_px) >= LEFT_SHARE * c->front;

    bool walker;

    *wait_ns = WAIT_NS;
    if (isnan(cut_px))
        return useful ? found_px : NAN;
    if (useful && fabs(found_px - cut_px) <= SAME_PX)
        return cut_px;
    if (useful && found_px > cut_px) /* somebody in front of the foreground is removed with it */
        return share_between(live, cut_px, found_px) > MOVED_SHARE && has_walker(c, found_px, INFINITY) ? cut_px
                                                                                                        : found_px;
    walker = useful && has_walker(c, found_px, cut_px); /* the foreground, when the former has left */
    if (there || !walker)                               /* somebody may stand just behind it */
        *wait_ns = FARTHER_NS;
    if (!useful)
        return open ? cut_px : NAN;
    return there == walker && (open || walker) ? cut_px : found_px;
}

void live_cut_init(struct live_cut *c)
{
    c->cut_px = c->gap_px = c->end_px = c->guard_px = NAN;
}

static void apply(struct live_cut *c)
{
    c->cut_px = isgreater(c->guard_px, c->gap_px) ? c->guard_px : c->gap_px; /* NaN: no exception */
}

/* Farthest surfaces of the foreground, but few of its rays. */
static double foreground_end(const struct sst_live *live, double px)
{
    const double few = FEW_SHARE * share_nearer(live, px);
    double end_px = px;

    while (few > 0 && share_between(live, px, end_px + STEP_PX) <= few)
        end_px += STEP_PX;
    return end_px;
}

static void set_gap(struct sst_live *live, double px)
{
    struct live_cut *c = &live->cut;

    c->gap_px = px;
    c->end_px = isnan(px) ? NAN : foreground_end(live, px);
    c->front = isnan(px) ? 0 : share_nearer(live, px);
    c->since_ns = 0;
}

static bool same(double a, double b)
{
    return isnan(a) || isnan(b) ? isnan(a) && isnan(b) : fabs(a - b) < 1e-9;
}

int live_cut_follow(struct sst_live *live, int64_t t_ns)
{
    struct live_cut *c = &live->cut;
    struct sst_render_gap gap = { .near_px = NAN };
    double found_px = NAN, to_px;
    int64_t wait_ns;
    int err = sst_render_find_gap(live->renderer, VISITOR_SHARE, &gap);

    if (err && err != -ENODATA)
        return err;
    if (!err)
        found_px = gap.near_px - fmin(MARGIN * (gap.near_px - gap.far_px), MARGIN_PX);
    to_px = wanted(live, found_px, &wait_ns);
    if (same(to_px, c->gap_px)) {
        c->since_ns = 0;
        c->front = isnan(to_px) ? 0 : fmax(c->front, share_nearer(live, to_px));
    } else if (isnan(c->gap_px)) {
        set_gap(live, to_px);
    } else if (!c->since_ns) {
        c->since_ns = t_ns;
    } else if (t_ns - c->since_ns >= wait_ns) {
        set_gap(live, to_px);
    }
    apply(c);
    return 0;
}

/* Cut in front of a track. Nothing behind the foreground is nearer than its farthest surfaces, so that the accuracy of
 * a depth is no reason to show more of it. */
static double before_track(const struct live_cut *c, const struct sst_live_track *t)
{
    return fmin(sst_live_before(t->disp_px, t->hidden), fmax(t->disp_px + BEFORE_PX, c->end_px));
}

/* Fraction of the picture in the boxes of tracks in the open that are as near as this, or nearer. */
static double share_of_boxes(const struct sst_live *live, const struct sst_live_track *track, int n, double px)
{
    double area = 0;

    for (int i = 0; i < n; i++)
        if (!track[i].hidden && track[i].disp_px >= px)
            area += (track[i].x1 - track[i].x0) * (track[i].y1 - track[i].y0);
    return area / ((double)live->lf.width * live->lf.height);
}

/* Does a track in the open move behind the foreground? The accuracy of its depth may reach beyond a thin foreground:
 * where it may be behind that one's farthest surfaces, surfaces that are nearer and no track's decide. */
static bool moves_behind(const struct sst_live *live, const struct sst_live_track *track, int n,
                         const struct sst_live_track *t)
{
    const double px = t->disp_px;

    return share_nearer(live, sst_live_before(px, true)) >= FRONT_SHARE ||
           (islessequal(px, sst_live_before(live->cut.end_px, false)) && /* false where there is none */
            share_nearer(live, px + BEFORE_PX) >= FRONT_SHARE + share_of_boxes(live, track, n, px));
}

/* Nearest cut in front of all tracks that move behind the foreground; NaN: there is none. */
static double before_tracks(const struct sst_live *live, const struct sst_live_track *track, int n)
{
    double most = NAN;

    for (int i = 0; i < n; i++) {
        const struct sst_live_track *t = &track[i];
        const double px = before_track(&live->cut, t);

        if (t->hidden || moves_behind(live, track, n, t))
            most = fmax(most, px);
    }
    return most;
}

double sst_live_before(double disp_px, bool hidden)
{
    return disp_px + (hidden ? BEFORE_HIDDEN : BEFORE) * fabs(disp_px) + BEFORE_PX;
}

void live_cut_guard(struct sst_live *live, const struct sst_live_track *track, int n, int64_t t_ns)
{
    struct live_cut *c = &live->cut;
    double need_px;
    bool needed;

    if (n)
        memcpy(c->track, track, (size_t)n * sizeof(*track));
    c->tracks = n;
    if (t_ns < c->guarded_ns) /* a recording that begins again */
        c->guard_px = NAN;
    need_px = before_tracks(live, c->track, n);
    needed = isgreater(need_px, c->gap_px);
    if (needed && !isgreaterequal(c->guard_px, need_px)) {
        c->guard_px = need_px + STEADY_PX;
        c->guarded_ns = t_ns;
    } else if (needed && need_px >= c->guard_px - 2 * STEADY_PX) {
        c->guarded_ns = t_ns;
    } else if (t_ns - c->guarded_ns >= GUARD_NS) {
        c->guard_px = needed ? need_px + STEADY_PX : NAN;
        c->guarded_ns = t_ns;
    }
    apply(c);
}

bool live_cut_removes(const struct sst_live *live, const struct sst_live_track *track, int n)
{
    return isgreater(before_tracks(live, track, n), live->cut.cut_px);
}

double sst_live_cut(const struct sst_live *live)
{
    return live->cut.cut_px;
}

bool sst_live_histogram(const struct sst_live *live, double *min_px, double *max_px, float share[SST_LIVE_HISTOGRAM])
{
    const int lead = sst_render_lead_view(&live->lf);
    const struct sst_map_u16 *disp = lead < 0 ? NULL : &live->lf.views[lead].disp;
    uint32_t fine[FINE_BINS] = { 0 }, count[SST_LIVE_HISTOGRAM] = { 0 }, all = 0;
    double lo, hi, scale;

    if (!live->ready || !disp || !sst_live_range(live, &lo, &hi))
        return false;
    scale = SST_LIVE_HISTOGRAM / fmax(hi - lo, 1 / SST_DISP_SCALE);
    for (int y = 0; y < disp->height; y += 2) {
        const uint16_t *row = sst_map_u16_row(disp, y);

        for (int x = 0; x < disp->width; x += 2)
            fine[row[x] >> FINE_SHIFT]++;
    }
    for (int i = 0; i < FINE_BINS - 1; i++) { /* the last one: unknown */
        const double px = sst_disp_px(&live->lf, (uint16_t)((i << FINE_SHIFT) + (1 << FINE_SHIFT) / 2));

        count[sst_clamp_int((int)((px - lo) * scale), 0, SST_LIVE_HISTOGRAM - 1)] += fine[i];
        all += fine[i];
    }
    if (!all)
        return false;
    for (int i = 0; i < SST_LIVE_HISTOGRAM; i++)
        share[i] = (float)count[i] / (float)all;
    *min_px = lo;
    *max_px = hi;
    return true;
}
