/* Layout of the state vector: states, their units, and the mapping of a detection's columns to them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/calibration/solve/solve_internal.h"

/* Prior sigma of k4, k5, k6: many pairs of polynomials have nearly the same ratio. */
#define DENOMINATOR_SIGMA 1
/* Corner noise that the priors are weighted against. */
#define PRIOR_NOISE_PX 0.1

int solve_problem_copy(struct solve_problem *out, const struct solve_problem *in)
{
    struct solve_problem copy = *in;

    copy.pool = NULL;
    copy.camera = malloc((size_t)in->views * sizeof(*copy.camera));
    copy.frame = malloc((size_t)in->frames * sizeof(*copy.frame));
    copy.detection = malloc((size_t)in->count * sizeof(*copy.detection));
    if (!copy.camera || !copy.frame || !copy.detection) {
        solve_problem_fini(&copy);
        return -ENOMEM;
    }
    memcpy(copy.camera, in->camera, (size_t)in->views * sizeof(*copy.camera));
    memcpy(copy.frame, in->frame, (size_t)in->frames * sizeof(*copy.frame));
    memcpy(copy.detection, in->detection, (size_t)in->count * sizeof(*copy.detection));
    *out = copy;
    return 0;
}

void solve_problem_fini(struct solve_problem *p)
{
    free(p->camera);
    free(p->frame);
    free(p->detection);
    free(p->pool);
    *p = (struct solve_problem){ 0 };
}

/* Units of a lens: one unit moves each dependent corner by about a pixel, divided by the root of their number. */
static void set_lens_scales(struct solve_layout *l, const struct solve_problem *p, int view, double root)
{
    const double f = p->camera[view].lens[0];
    const double reach = 0.35 * hypot(p->width, p->height) / f, r2 = reach * reach; /* where most corners are */
    const double moves[SOLVE_LENS_MAX] = { reach / 2,
                                           reach / 2,
                                           1,
                                           1,
                                           f * reach * r2,
                                           f * reach * r2 * r2,
                                           f * r2,
                                           f * r2,
                                           f * reach * r2 * r2 * r2,
                                           f * reach * r2,
                                           f * reach * r2 * r2,
                                           f * reach * r2 * r2 * r2 };

    for (int i = 0; i < l->lens_size; i++)
        l->scale[l->lens[view] + i] = root / moves[i];
}

/* Units of a pose, of a camera or of a board that is so deep. */
static void set_pose_scales(double *scale, double focal_px, double depth, double root)
{
    for (int i = 0; i < 3; i++) {
        scale[i] = root / focal_px;
        scale[3 + i] = root * depth / focal_px;
    }
}

static int count_states(struct solve_layout *l, const struct solve_problem *p, const bool *seen_view,
                        const bool *seen_frame)
{
    int n = 0, shared = -1;

    for (int v = 0; v < p->views; v++) {
        l->lens[v] = -1;
        if (!seen_view[v] || p->keep_lens)
            continue;
        if (!p->rig || shared < 0) {
            l->lens[v] = n;
            shared = n;
            n += l->lens_size;
        } else {
            l->lens[v] = shared;
        }
    }
    for (int v = 0; v < p->views; v++) {
        l->pose[v] = -1;
        if (seen_view[v] && !p->keep_cameras && v != p->reference) {
            l->pose[v] = n;
            n += 6;
        }
    }
    l->camera_states = n;
    for (int f = 0; f < p->frames; f++) {
        l->frame[f] = -1;
        if (seen_frame[f]) {
            l->frame[f] = n;
            n += 6;
        }
    }
    l->warp = p->keep_warp ? -1 : n;
    return n + (p->keep_warp ? 0 : 2);
}

static void measure_scales(struct solve_layout *l, const struct solve_problem *p, double *corners)
{
    for (int i = 0; i < p->count; i++) {
        const struct solve_detection *d = &p->detection[i];
        const int at[3] = { l->lens[d->view], l->pose[d->view], l->frame[d->frame] };

        for (int k = 0; k < 3 && d->used; k++) {
            if (at[k] >= 0)
                corners[at[k]] += d->corners;
        }
        if (d->used && l->warp >= 0)
            corners[l->warp] += d->corners;
    }
    for (int i = 0; i < p->count; i++) {
        const struct solve_detection *d = &p->detection[i];
        const int at[3] = { l->lens[d->view], l->pose[d->view], l->frame[d->frame] };
        struct solve_pose board;

        if (!d->used)
            continue;
        solve_relative(p, d, &board);
        for (int k = 0; k < 3; k++) {
            const double root = at[k] < 0 ? 0 : 1 / sqrt(fmax(corners[at[k]], 1));

            if (at[k] >= 0 && !k)
                set_lens_scales(l, p, d->view, root);
            else if (at[k] >= 0)
                set_pose_scales(l->scale + at[k], p->camera[d->view].lens[0], fmax(board.shift[2], 1), root);
        }
        if (l->warp >= 0) { /* seen at a tilt of about 20 degrees */
            l->scale[l->warp] = l->scale[l->warp + 1] =
                3 * fmax(board.shift[2], 1) / (p->camera[d->view].lens[0] * sqrt(corners[l->warp]));
        }
    }
}

int solve_layout_init(struct solve_layout *out, const struct solve_problem *p)
{
    const size_t views = (size_t)p->views, frames = (size_t)p->frames;
    struct solve_layout l = { .lens_size = 4 + p->lens,
                              .lens = calloc(views, sizeof(int)),
                              .pose = calloc(views, sizeof(int)),
                              .frame = calloc(frames, sizeof(int)) };
    bool *seen = calloc(views + frames, sizeof(*seen));
    double *corners = NULL;
    int err = -ENOMEM;

    if (!l.lens || !l.pose || !l.frame || !seen)
        goto out;
    for (int i = 0; i < p->count; i++) {
        if (p->detection[i].used)
            seen[p->detection[i].view] = seen[views + (size_t)p->detection[i].frame] = true;
    }
    l.states = count_states(&l, p, seen, seen + views);
    l.scale = calloc((size_t)l.states + 1, sizeof(*l.scale));
    corners = calloc((size_t)l.states + 1, sizeof(*corners));
    if (!l.scale || !corners)
        goto out;
    measure_scales(&l, p, corners);
    err = 0;
    *out = l;
out:
    free(seen);
    free(corners);
    if (err)
        solve_layout_fini(&l);
    return err;
}

void solve_layout_fini(struct solve_layout *layout)
{
    free(layout->lens);
    free(layout->pose);
    free(layout->frame);
    free(layout->scale);
    *layout = (struct solve_layout){ 0 };
}

void solve_spread_make(struct solve_spread *s, const struct solve_problem *p, const struct solve_layout *layout,
                       const struct solve_detection *d, const double *const turns[2])
{
    static const double none[3] = { 0 };
    const struct solve_pose *camera = &p->camera[d->view].pose;
    double m[3];

    s->lens = layout->lens[d->view];
    s->pose = layout->pose[d->view];
    s->frame = layout->frame[d->frame];
    s->warp = layout->warp;
    s->lens_columns = p->keep_lens ? 0 : layout->lens_size;
    s->scale = layout->scale;
    memcpy(s->rotation, camera->rotation, sizeof(s->rotation));
    sst_numbers_apply3(camera->rotation, p->frame[d->frame].pose.shift, m);
    memcpy(s->across, (double[9]){ 0, -m[2], m[1], m[2], 0, -m[0], -m[1], m[0], 0 }, sizeof(s->across));
    solve_left_jacobian(turns ? turns[0] : none, s->camera_turn);
    solve_left_jacobian(turns ? turns[1] : none, s->board_turn);
    sst_numbers_mul3(s->rotation, s->board_turn, s->board_turn);
}

/* Row vector times matrix. */
static void row_times(const double v[3], const double m[9], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = v[0] * m[i] + v[1] * m[3 + i] + v[2] * m[6 + i];
}

int solve_spread_row(const struct solve_spread *s, const double *row, int from, int *state, double *value)
{
    const int lens = s->lens_columns;
    const double *turn = row + lens, *shift = turn + 3, *warp = turn + 6;
    double both[2][6], t[3];
    int n = 0;

    for (int i = from; i < lens; i++) {
        state[n] = s->lens + i;
        value[n++] = row[i];
    }
    if (from < lens + 6) {
        row_times(shift, s->across, t);
        for (int i = 0; i < 3; i++)
            t[i] = turn[i] - t[i];
        row_times(t, s->camera_turn, both[0]);
        memcpy(both[0] + 3, shift, 3 * sizeof(double));
        row_times(turn, s->board_turn, both[1]);
        row_times(shift, s->rotation, both[1] + 3);
        for (int k = 0; k < 2; k++) {
            const int at = k ? s->frame : s->pose;

            for (int i = 0; i < 6 && at >= 0; i++) {
                state[n] = at + i;
                value[n++] = both[k][i];
            }
        }
    }
    for (int i = sst_max_int(0, from - lens - 6); i < 2 && s->warp >= 0; i++) {
        state[n] = s->warp + i;
        value[n++] = warp[i];
    }
    for (int i = 0; i < n; i++)
        value[i] *= s->scale[state[i]];
    return n;
}

int solve_priors(const struct solve_problem *p, const struct solve_layout *layout, int *state, double *value,
                 double *residual)
{
    int n = 0, last = -1;

    for (int v = 0; v < p->views && p->lens == SST_LENS_MAX; v++) {
        if (layout->lens[v] < 0 || layout->lens[v] == last)
            continue;
        last = layout->lens[v];
        for (int i = 9; i < SOLVE_LENS_MAX; i++, n++) {
            if (!state)
                continue;
            state[n] = last + i;
            value[n] = PRIOR_NOISE_PX / DENOMINATOR_SIGMA * layout->scale[last + i];
            residual[n] = PRIOR_NOISE_PX / DENOMINATOR_SIGMA * p->camera[v].lens[i];
        }
    }
    for (int i = 0; i < 2 && layout->warp >= 0; i++, n++) {
        if (!state)
            continue;
        state[n] = layout->warp + i;
        value[n] = PRIOR_NOISE_PX / p->warp_sigma_mm * layout->scale[layout->warp + i];
        residual[n] = PRIOR_NOISE_PX / p->warp_sigma_mm * p->warp[i];
    }
    return n;
}
