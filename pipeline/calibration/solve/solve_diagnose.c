/*
 * Diagnosis from the residuals: exchanged cameras, cameras that moved, boards that moved.
 *
 * Runs after a robust fit to all corners, which follows the majority: contradicting detections keep their large
 * residuals.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/stats.h"
#include "pipeline/calibration/solve/solve_internal.h"

#define BAD_SIGMA     4   /* a detection is bad if its median residual exceeds this many sigma */
#define LEAST_BAD_PX  0.3 /* ... and longer than this */
#define LEAST_MOVE_PX 0.2 /* of a camera */
#define MOVE_SIGMA    2   /* ... and this many sigma of the corners */
#define GARBLED_PX    3   /* residual of a detection that does not fit the board even by itself */

struct diagnosis {
    const struct solve_case *c;
    double *median_px; /* [count] of weighted residuals; negative: not used */
    bool *bad;         /* [count] */
    int *at;           /* [frames][views] detection or -1 */
    double (*r)[2], *work;
};

static double median_of(struct diagnosis *l, const struct solve_detection *d, int corners)
{
    for (int k = 0; k < corners; k++)
        l->work[k] = d->corner[k].weight * hypot(l->r[k][0], l->r[k][1]);
    return sst_stats_upper_median(l->work, corners);
}

static void measure(struct diagnosis *l)
{
    const struct solve_problem *p = &l->c->p;

    for (int i = 0; i < p->count; i++) {
        l->median_px[i] = -1;
        l->bad[i] = false;
        if (!p->detection[i].used)
            continue;
        solve_residuals(p, &p->detection[i], l->r);
        l->median_px[i] = median_of(l, &p->detection[i], p->detection[i].corners);
        l->bad[i] = l->median_px[i] > fmax(1.1774 * BAD_SIGMA * l->c->sigma_px, LEAST_BAD_PX);
        l->at[p->detection[i].frame * p->views + p->detection[i].view] = i;
    }
}

/* Median residual if the detection belonged to another view. */
static double median_as(struct diagnosis *l, int detection, int view)
{
    struct solve_detection d = l->c->p.detection[detection];

    d.view = view;
    solve_residuals(&l->c->p, &d, l->r);
    return median_of(l, &d, d.corners);
}

/* Find two cameras that are exchanged in some frames. */
static int check_exchanged(struct diagnosis *l)
{
    const struct solve_problem *p = &l->c->p;
    char one[128], other[128];

    for (int pair = 0; pair < p->views * p->views; pair++) {
        const int a = pair / p->views, b = pair % p->views;
        int both = 0, cured = 0, first = -1, last = -1;
        double before = 0, after = 0;

        for (int f = 0; f < p->frames && a < b; f++) {
            const int i = l->at[f * p->views + a], j = l->at[f * p->views + b];
            double x, y;

            if (i < 0 || j < 0 || !l->bad[i] || !l->bad[j])
                continue;
            both++;
            x = median_as(l, i, b);
            y = median_as(l, j, a);
            if (x > 0.3 * l->median_px[i] || y > 0.3 * l->median_px[j])
                continue;
            cured++;
            before += (l->median_px[i] + l->median_px[j]) / 2;
            after += (x + y) / 2;
            first = first < 0 ? f : first;
            last = f;
        }
        if (cured && 10 * cured >= 6 * both)
            return solve_reject(
                l->c->cfg,
                "%s and %s are exchanged in %d frames, from %s to %s: each sees there what the other "
                "should (residuals of %.3g px become %.2g px); correct their names or leave these frames "
                "out",
                solve_name(l->c->all, a, one), solve_name(l->c->all, b, other), cured, l->c->all->frame_name[first],
                l->c->all->frame_name[last], before / cured, after / cured);
    }
    return 0;
}

/* --- a camera that moved ------------------------------------------------------------------------------------------ */

/* Normal equations of a small rotation and shift of a camera: residuals r + J x. */
struct motion {
    double a[36], g[6], s;
    int corners;
};

static void motion_add(struct motion *to, const struct motion *m, double sign)
{
    for (int i = 0; i < 36; i++)
        to->a[i] += sign * m->a[i];
    for (int i = 0; i < 6; i++)
        to->g[i] += sign * m->g[i];
    to->s += sign * m->s;
    to->corners += sign > 0 ? m->corners : -m->corners;
}

static void motion_of(struct diagnosis *l, int detection, struct motion *m)
{
    const struct solve_problem *p = &l->c->p;
    const struct solve_detection *d = &p->detection[detection];
    const double limit = 3 * fmax(l->median_px[detection], 1.1774 * l->c->sigma_px);
    struct solve_pose board;

    *m = (struct motion){ .s = 0 };
    solve_relative(p, d, &board);
    for (int k = 0; k < d->corners; k++) {
        const double w = d->corner[k].weight;
        double t[3], q[3], xy[2];
        struct solve_slopes slopes;

        solve_corner_place(&board, &d->corner[k], p->warp, t, q);
        solve_see(p->camera[d->view].lens, p->lens, q, xy, &slopes);
        xy[0] = w * (xy[0] - d->corner[k].x);
        xy[1] = w * (xy[1] - d->corner[k].y);
        if (hypot(xy[0], xy[1]) > limit)
            continue;
        for (int i = 0; i < 2; i++) {
            double j[6];

            solve_by_motion(slopes.q[i], q, w, j);
            for (int n = 0; n < 36; n++)
                m->a[n] += j[n / 6] * j[n % 6];
            for (int n = 0; n < 6; n++)
                m->g[n] += j[n] * xy[i];
            m->s += xy[i] * xy[i];
        }
        m->corners++;
    }
}

/* Smallest sum of squares over all motions, and that motion. */
static double motion_left(const struct motion *m, double x[6])
{
    double l[36], gain = 0;

    memcpy(l, m->a, sizeof(l));
    for (int i = 0; i < 6; i++) {
        x[i] = -m->g[i];
        l[7 * i] *= 1 + 1e-9;
    }
    if (!solve_cholesky(l, 6)) {
        memset(x, 0, 6 * sizeof(*x));
        return m->s;
    }
    sst_numbers_substitute(l, 6, x);
    for (int i = 0; i < 6; i++)
        gain -= x[i] * m->g[i];
    return m->s - gain;
}

struct split {
    int view, frame; /* first frame after the move */
    double gain;     /* reduction of the sum of squares by the split */
    double px, turn_deg, shift_mm;
};

/* The best split of one camera's frames into before and after. @return false: no sign of a move */
static bool split_view(struct diagnosis *l, int view, struct motion *m, int *frame, struct split *out)
{
    const struct solve_problem *p = &l->c->p;
    struct motion all = { .s = 0 }, before = { .s = 0 };
    double x[2][6], whole, freely = 0, least, px = 0;
    int n = 0, at = -1;

    for (int f = 0; f < p->frames; f++) {
        const int i = l->at[f * p->views + view];

        if (i < 0)
            continue;
        motion_of(l, i, &m[n]);
        motion_add(&all, &m[n], 1);
        freely += motion_left(&m[n], x[0]);
        frame[n++] = f;
    }
    if (n < 4)
        return false;
    least = whole = motion_left(&all, x[0]);
    for (int k = 1; k < n; k++) {
        struct motion after = all;
        double left;

        motion_add(&before, &m[k - 1], 1);
        motion_add(&after, &before, -1);
        left = motion_left(&before, x[0]) + motion_left(&after, x[1]);
        /* A single frame at either end means a wrong board or frame, not a camera that moved. */
        if (k < 2 || k > n - 2 || !(left < least))
            continue;
        least = left;
        at = k;
        for (int i = 0; i < 6; i++)
            x[1][i] -= x[0][i];
        px = 0;
        for (int i = 0; i < 36; i++)
            px += x[1][i / 6] * all.a[i] * x[1][i % 6];
        px = sqrt(fmax(px, 0) / sst_max_int(all.corners, 1));
        *out = (struct split){ .view = view,
                               .frame = frame[k],
                               .gain = whole - left,
                               .px = px,
                               .turn_deg = sqrt(x[1][0] * x[1][0] + x[1][1] * x[1][1] + x[1][2] * x[1][2]) * 180 / M_PI,
                               .shift_mm = sqrt(x[1][3] * x[1][3] + x[1][4] * x[1][4] + x[1][5] * x[1][5]) };
    }
    /* Two poses explain most of the residuals that a separate pose for every frame would. */
    return at > 0 && out->gain > 0.5 * (whole - freely) && px > fmax(LEAST_MOVE_PX, MOVE_SIGMA * l->c->sigma_px);
}

static int check_moved(struct diagnosis *l)
{
    const struct solve_problem *p = &l->c->p;
    struct motion *m = malloc((size_t)p->frames * sizeof(*m));
    int *frame = malloc((size_t)p->frames * sizeof(*frame)), cameras = 0;
    struct split worst = { .view = -1 };
    char name[128];

    for (int v = 0; v < p->views && m && frame; v++) {
        struct split s = { .view = -1 };

        cameras += p->camera[v].known;
        if (split_view(l, v, m, frame, &s) && s.gain > worst.gain)
            worst = s;
    }
    free(m);
    free(frame);
    if (!m || !frame)
        return -ENOMEM;
    if (worst.view < 0)
        return 0;
    return solve_reject(l->c->cfg,
                        "%s moved %sbefore frame %s, by %.2f px (%.2f degrees, %.1f mm): fasten it and take all frames "
                        "again, or calibrate from the frames before or after that one alone",
                        solve_name(l->c->all, worst.view, name),
                        cameras == 2 ? "against the other (or both were exchanged) " : "",
                        l->c->all->frame_name[worst.frame], worst.px, worst.turn_deg, worst.shift_mm);
}

/* --- boards and cameras that are wrong as a whole ----------------------------------------------------------------- */

/* Find frames in which cameras disagree about the board's pose. */
static int check_boards(struct diagnosis *l)
{
    const struct solve_problem *p = &l->c->p;
    const double most = l->c->cfg->max_outliers > 0 ? l->c->cfg->max_outliers : SOLVE_MOST_OUTLIERS;
    int frames = 0, lost = 0, all = 0, first = -1, first_bad = 0, first_seen = 0;
    double px = 0;
    char text[512];

    for (int f = 0; f < p->frames; f++) {
        int seen = 0, bad = 0, corners = 0;
        double median = 0;

        for (int v = 0; v < p->views; v++) {
            const int i = l->at[f * p->views + v];

            if (i < 0)
                continue;
            seen++;
            corners += p->detection[i].corners;
            bad += l->bad[i];
            median = fmax(median, l->median_px[i]);
        }
        all += corners;
        if (seen < 2 || 2 * bad < seen || (bad < 2 && seen > 2))
            continue;
        frames++;
        lost += corners;
        if (median > px) {
            px = median;
            first = f;
            first_bad = bad;
            first_seen = seen;
        }
    }
    if (!frames)
        return 0;
    snprintf(
        text, sizeof(text),
        "the board moved while %s %s was taken%s: %d of the %d cameras that saw it there disagree with the others by "
        "up to %.2f px; take frames with the board at rest and all cameras triggered together",
        frames == 1 ? "frame" : "several frames were taken, most when", l->c->all->frame_name[first],
        frames == 1 ? "" : " (or its points are wrong there)", first_bad, first_seen, px);
    if (lost > most * all && !l->c->cfg->plain)
        return solve_reject(l->c->cfg, "%s", text);
    sst_log_warning("%s", text);
    return 0;
}

/* Find cameras with mostly detections that do not fit the board at all. */
static int check_garbled(const struct diagnosis *l)
{
    const struct solve_problem *p = &l->c->p;
    const double limit_px = fmax(GARBLED_PX, 10 * l->c->sigma_px);
    char name[128];

    for (int v = 0; v < p->views; v++) {
        int all = 0, garbled = 0;
        double sum = 0;

        for (int i = 0; i < p->count; i++) {
            struct solve_single single;

            if (p->detection[i].view != v || !l->c->single[i].known)
                continue;
            all++;
            if (!(l->c->single[i].rms_px > limit_px))
                continue;
            /* the seeds' lenses are rough: use the joint fit's */
            solve_single_camera(&single, p, &p->detection[i], p->camera[v].lens);
            if (!single.known || single.rms_px > limit_px) {
                garbled++;
                sum += single.rms_px;
            }
        }
        if (garbled && 2 * garbled >= all)
            return solve_reject(l->c->cfg,
                                "what %s shows in %d of %d frames is not the board: its points are %.1f px off for "
                                "any pose; it shows another board, or the points are numbered in another "
                                "order, perhaps by columns",
                                solve_name(l->c->all, v, name), garbled, all, sum / garbled);
    }
    return 0;
}

/* Find cameras with a quarter or more of their detections contradicting the others, for any reason. */
static int check_contrary(const struct diagnosis *l)
{
    const struct solve_problem *p = &l->c->p;
    char name[128];

    for (int v = 0; v < p->views; v++) {
        int all = 0, bad = 0;
        double px = 0;

        for (int f = 0; f < p->frames; f++) {
            const int i = l->at[f * p->views + v];

            all += i >= 0;
            bad += i >= 0 && l->bad[i];
            px = i >= 0 ? fmax(px, l->median_px[i]) : px;
        }
        if (4 * bad >= all && bad > 1)
            return solve_reject(l->c->cfg,
                                "%s contradicts the others in %d of %d frames, by up to %.2f px: it moved, was not "
                                "triggered with them, or numbers the board's points from another corner; check its "
                                "pictures, or leave the camera out",
                                solve_name(l->c->all, v, name), bad, all, px);
    }
    return 0;
}

int solve_check_still(struct solve_case *c)
{
    const struct solve_problem *p = &c->p;
    const size_t cells = (size_t)p->frames * (size_t)p->views;
    struct diagnosis l = { .c = c };
    int most = 1, err = -ENOMEM;

    for (int i = 0; i < p->count; i++)
        most = sst_max_int(most, p->detection[i].corners);
    l.median_px = malloc((size_t)(p->count + 1) * sizeof(*l.median_px));
    l.bad = malloc((size_t)(p->count + 1) * sizeof(*l.bad));
    l.at = malloc((cells + 1) * sizeof(*l.at));
    l.r = malloc((size_t)most * sizeof(*l.r));
    l.work = malloc((size_t)most * sizeof(*l.work));
    if (l.median_px && l.bad && l.at && l.r && l.work) {
        for (size_t i = 0; i < cells; i++)
            l.at[i] = -1;
        measure(&l);
        err = check_garbled(&l);
        err = err ? err : check_exchanged(&l);
        err = err ? err : check_moved(&l);
        err = err ? err : check_boards(&l);
        err = err ? err : check_contrary(&l);
    }
    free(l.median_px);
    free(l.bad);
    free(l.at);
    free(l.r);
    free(l.work);
    return err;
}
