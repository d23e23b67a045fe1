/* The graph of cameras that see the board together, and poses along its maximum spanning tree. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/stats.h"
#include "pipeline/calibration/solve/solve_internal.h"

static int shared_corners(const struct solve_detection *a, const struct solve_detection *b)
{
    int i = 0, j = 0, n = 0;

    while (i < a->corners && j < b->corners) {
        const int x = a->corner[i].id, y = b->corner[j].id;

        n += x == y;
        i += x <= y;
        j += y <= x;
    }
    return n;
}

/* Kruskal's algorithm; ties: the first link. */
static void mark_tree(struct sst_solve_link *links, int count, int *group, int views)
{
    for (int v = 0; v < views; v++)
        group[v] = v;
    for (;;) {
        struct sst_solve_link *best = NULL;
        int from, to;

        for (int i = 0; i < count; i++) {
            if (group[links[i].a] != group[links[i].b] && (!best || links[i].corners > best->corners))
                best = &links[i];
        }
        if (!best)
            return;
        best->tree = true;
        from = group[best->b];
        to = group[best->a];
        for (int v = 0; v < views; v++) {
            if (group[v] == from)
                group[v] = to;
        }
    }
}

int solve_links(const struct solve_problem *p, struct sst_solve_link **links, int *count)
{
    const size_t pairs = (size_t)p->views * (size_t)p->views;
    struct sst_solve_link *all = calloc(pairs, sizeof(*all));
    int *group = malloc((size_t)p->views * sizeof(*group)), n = 0;

    if (!all || !group) {
        free(all);
        free(group);
        return -ENOMEM;
    }
    for (int i = 0; i < p->count; i++) {
        const struct solve_detection *a = &p->detection[i];

        for (int j = i + 1; j < p->count && p->detection[j].frame == a->frame; j++) {
            const struct solve_detection *b = &p->detection[j];
            struct sst_solve_link *link = &all[(size_t)a->view * (size_t)p->views + (size_t)b->view];

            if (!a->used || !b->used)
                continue;
            link->frames++;
            link->corners += shared_corners(a, b);
        }
    }
    for (int v = 0; v < p->views * p->views; v++) {
        if (all[v].frames) {
            const struct sst_solve_link link = all[v];

            all[n] = link;
            all[n].a = v / p->views;
            all[n++].b = v % p->views;
        }
    }
    mark_tree(all, n, group, p->views);
    free(group);
    *links = all;
    *count = n;
    return 0;
}

/* Distance of two poses in px at a depth in mm. */
static double apart(const struct solve_pose *a, const struct solve_pose *b, double focal, double depth)
{
    double between[9], turn[3], move = 0;

    solve_mul3t(a->rotation, b->rotation, between);
    sst_rotation_to_vector(between, turn);
    for (int i = 0; i < 3; i++)
        move += (a->shift[i] - b->shift[i]) * (a->shift[i] - b->shift[i]);
    return focal * (sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]) + sqrt(move) / depth);
}

/* The median pose: least sum of distances, each clipped to a limit. */
static int middle_pose(const struct solve_pose *pose, int n, double focal, double depth)
{
    const double limit = 0.1 * focal;
    double least = INFINITY;
    int best = 0;

    for (int i = 0; i < n; i++) {
        double sum = 0;

        for (int j = 0; j < n && sum < least; j++)
            sum += fmin(apart(&pose[i], &pose[j], focal, depth), limit);
        if (sum < least) {
            least = sum;
            best = i;
        }
    }
    return best;
}

struct chain {
    struct solve_problem *p;
    const struct solve_single *single;
    int *at;                /* [frames][views] detection or -1 */
    struct solve_pose *try; /* [max(frames, views)] */
};

/* Pose of camera `to` from camera `from`'s by all boards that both see. */
static bool chain_camera(struct chain *c, int from, int to)
{
    struct solve_problem *p = c->p;
    double depth = 0;
    int n = 0;

    for (int f = 0; f < p->frames; f++) {
        const int a = c->at[f * p->views + from], b = c->at[f * p->views + to];
        struct solve_pose back;

        if (a < 0 || b < 0)
            continue;
        solve_pose_inverse(&back, &c->single[a].pose);
        solve_pose_chain(&c->try[n++], &c->single[b].pose, &back);
        depth += c->single[b].pose.shift[2];
    }
    if (!n)
        return false;
    solve_pose_chain(&p->camera[to].pose, &c->try[middle_pose(c->try, n, p->camera[to].lens[0], depth / n)],
                     &p->camera[from].pose);
    p->camera[to].known = true;
    return true;
}

static void chain_boards(struct chain *c)
{
    struct solve_problem *p = c->p;

    for (int f = 0; f < p->frames; f++) {
        double depth = 0, focal = 0;
        int n = 0;

        p->frame[f].known = false;
        for (int v = 0; v < p->views; v++) {
            const int d = c->at[f * p->views + v];
            struct solve_pose back;

            if (d < 0 || !p->camera[v].known)
                continue;
            solve_pose_inverse(&back, &p->camera[v].pose);
            solve_pose_chain(&c->try[n++], &back, &c->single[d].pose);
            depth += c->single[d].pose.shift[2];
            focal = p->camera[v].lens[0];
        }
        if (n) {
            p->frame[f].pose = c->try[middle_pose(c->try, n, focal, depth / n)];
            p->frame[f].known = true;
        }
    }
}

int solve_chain(struct solve_problem *p, const struct solve_single *single, const struct sst_solve_link *links,
                int count)
{
    const size_t cells = (size_t)p->frames * (size_t)p->views;
    struct chain c = { .p = p,
                       .single = single,
                       .at = malloc((cells + 1) * sizeof(int)),
                       .try = malloc((size_t)sst_max_int(p->frames, p->views) * sizeof(struct solve_pose)) };
    bool more = true;

    if (!c.at || !c.try) {
        free(c.at);
        free(c.try);
        return -ENOMEM;
    }
    for (size_t i = 0; i < cells; i++)
        c.at[i] = -1;
    for (int i = 0; i < p->count; i++) {
        if (p->detection[i].used && single[i].known)
            c.at[p->detection[i].frame * p->views + p->detection[i].view] = i;
    }
    for (int v = 0; v < p->views; v++) {
        p->camera[v].known = v == p->reference;
        for (int i = 0; i < 9; i++)
            p->camera[v].pose.rotation[i] = i % 4 == 0;
        memset(p->camera[v].pose.shift, 0, sizeof(p->camera[v].pose.shift));
    }
    while (more) {
        more = false;
        for (int i = 0; i < count; i++) {
            const int a = links[i].a, b = links[i].b;

            if (links[i].tree && p->camera[a].known != p->camera[b].known)
                more |= p->camera[a].known ? chain_camera(&c, a, b) : chain_camera(&c, b, a);
        }
    }
    chain_boards(&c);
    for (int i = 0; i < p->count; i++) {
        struct solve_detection *d = &p->detection[i];

        d->used = d->used && single[i].known && p->camera[d->view].known && p->frame[d->frame].known;
    }
    free(c.at);
    free(c.try);
    return 0;
}

int solve_noise(const struct solve_problem *p, double *sigma_px)
{
    size_t all = 0, most = 0;
    double *length, (*r)[2];
    int n = 0;

    for (int i = 0; i < p->count; i++) {
        all += (size_t)p->detection[i].corners;
        most = (size_t)p->detection[i].corners > most ? (size_t)p->detection[i].corners : most;
    }
    length = malloc((all + 1) * sizeof(*length));
    r = malloc((most + 1) * sizeof(*r));
    if (!length || !r) {
        free(length);
        free(r);
        return -ENOMEM;
    }
    for (int i = 0; i < p->count; i++) {
        const struct solve_detection *d = &p->detection[i];

        if (!d->used)
            continue;
        solve_residuals(p, d, r);
        for (int c = 0; c < d->corners; c++) {
            if (!d->corner[c].out)
                length[n++] = d->corner[c].weight * hypot(r[c][0], r[c][1]);
        }
    }
    *sigma_px = sst_stats_upper_median(length, n) / 1.1774;
    free(length);
    free(r);
    return 0;
}
