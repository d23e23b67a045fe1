/* Tracks: features of several pictures that matches join. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/posed/solve/solve_internal.h"

#define CELLS     8  /* of a picture, in each direction */
#define CELL_FULL 12 /* sights in a cell: others are preferred */

static int root_of(int *parent, int i)
{
    while (parent[i] != i)
        i = parent[i] = parent[parent[i]];
    return i;
}

void poses_tracks_fini(struct poses_tracks *tracks)
{
    free(tracks->first);
    free(tracks->sight);
    *tracks = (struct poses_tracks){ 0 };
}

/* The smaller feature is the root, so that results do not depend on the order of pairs. */
static void join_pairs(int *parent, const int *offset, const struct poses_scene *scene)
{
    for (int p = 0; p < scene->pairs; p++) {
        const struct poses_pair *pair = scene->pair + p;

        for (int m = 0; m < pair->count; m++) {
            const int a = root_of(parent, offset[pair->a] + pair->match[m][0]);
            const int b = root_of(parent, offset[pair->b] + pair->match[m][1]);

            parent[sst_max_int(a, b)] = sst_min_int(a, b);
        }
    }
}

struct feature_of {
    int root, view, feature;
};

static int by_root(const void *left, const void *right)
{
    const struct feature_of *a = left, *b = right;

    return a->root != b->root   ? (a->root > b->root) - (a->root < b->root)
           : a->view != b->view ? (a->view > b->view) - (a->view < b->view)
                                : (a->feature > b->feature) - (a->feature < b->feature);
}

/* Groups of at least two features, none of them in one view, become tracks. */
static void collect(struct poses_tracks *out, const struct feature_of *of, int count, const struct poses_scene *scene)
{
    for (int i = 0, end; i < count; i = end) {
        bool good = true;

        for (end = i + 1; end < count && of[end].root == of[i].root; end++)
            good = good && of[end].view != of[end - 1].view;
        if (!good || end - i < 2)
            continue;
        out->first[out->tracks] = out->sights;
        for (int k = i; k < end; k++) {
            const float *at = scene->feature[of[k].view].at[of[k].feature];

            out->sight[out->sights++] =
                (struct poses_sight){ .view = of[k].view, .track = out->tracks, .x = at[0], .y = at[1] };
        }
        out->first[++out->tracks] = out->sights;
    }
}

int poses_tracks_make(struct poses_tracks *out, const struct poses_scene *scene)
{
    int *offset = calloc((size_t)scene->views + 1, sizeof(*offset)), *parent = NULL, total, n = 0;
    struct feature_of *of = NULL;
    int err = -ENOMEM;

    *out = (struct poses_tracks){ 0 };
    if (!offset)
        return err;
    for (int v = 0; v < scene->views; v++)
        offset[v + 1] = offset[v] + scene->feature[v].count;
    total = offset[scene->views];
    parent = malloc((size_t)total * sizeof(*parent) + 1);
    of = malloc((size_t)total * sizeof(*of) + 1);
    out->first = calloc((size_t)total + 1, sizeof(*out->first));
    out->sight = malloc((size_t)total * sizeof(*out->sight) + 1);
    if (!parent || !of || !out->first || !out->sight)
        goto done;
    for (int i = 0; i < total; i++)
        parent[i] = i;
    join_pairs(parent, offset, scene);
    for (int v = 0; v < scene->views; v++) {
        for (int i = 0; scene->linked[v] && i < scene->feature[v].count; i++)
            of[n++] = (struct feature_of){ .root = root_of(parent, offset[v] + i), .view = v, .feature = i };
    }
    qsort(of, (size_t)n, sizeof(*of), by_root);
    collect(out, of, n, scene);
    err = 0;
done:
    free(offset);
    free(parent);
    free(of);
    if (err)
        poses_tracks_fini(out);
    return err;
}

struct ranked {
    int length;
    uint32_t mixed; /* order among tracks of a length that has nothing to do with places */
    int track;
};

static int by_rank(const void *left, const void *right)
{
    const struct ranked *a = left, *b = right;

    return a->length != b->length ? (a->length < b->length) - (a->length > b->length)
           : a->mixed != b->mixed ? (a->mixed > b->mixed) - (a->mixed < b->mixed)
                                  : (a->track > b->track) - (a->track < b->track);
}

static int cell_of(const struct poses_sight *s, const struct poses_scene *scene)
{
    const double *middle = scene->middle[s->view];
    const int x = (int)sst_clamp_double((s->x + middle[0]) * CELLS / scene->posed->width, 0, CELLS - 1);
    const int y = (int)sst_clamp_double((s->y + middle[1]) * CELLS / scene->posed->height, 0, CELLS - 1);

    return (s->view * CELLS + y) * CELLS + x;
}

/* A track is chosen while one of its cells has room. @return number chosen, first in `rank` */
static int choose(struct ranked *rank, const struct poses_tracks *in, const struct poses_scene *scene, int most,
                  int *full)
{
    int chosen = 0;

    for (int i = 0; i < in->tracks && chosen < most; i++) {
        const int t = rank[i].track;
        bool room = false;

        for (int k = in->first[t]; k < in->first[t + 1]; k++)
            room = room || full[cell_of(in->sight + k, scene)] < CELL_FULL;
        if (!room)
            continue;
        for (int k = in->first[t]; k < in->first[t + 1]; k++)
            full[cell_of(in->sight + k, scene)]++;
        rank[chosen++] = rank[i];
    }
    return chosen;
}

int poses_tracks_choose(struct poses_tracks *out, const struct poses_tracks *in, const struct poses_scene *scene,
                        int most)
{
    struct ranked *rank = malloc((size_t)in->tracks * sizeof(*rank) + 1);
    int *full = calloc((size_t)scene->views * CELLS * CELLS, sizeof(*full));
    int err = -ENOMEM, chosen;

    *out = (struct poses_tracks){ 0 };
    out->first = calloc((size_t)in->tracks + 1, sizeof(*out->first));
    out->sight = malloc((size_t)in->sights * sizeof(*out->sight) + 1);
    if (!rank || !full || !out->first || !out->sight)
        goto done;
    for (int t = 0; t < in->tracks; t++)
        rank[t] = (struct ranked){ .length = in->first[t + 1] - in->first[t],
                                   .mixed = (uint32_t)t * 2654435761u,
                                   .track = t };
    qsort(rank, (size_t)in->tracks, sizeof(*rank), by_rank);
    chosen = choose(rank, in, scene, most, full);
    for (int i = 0; i < chosen; i++) {
        const int t = rank[i].track;

        for (int k = in->first[t]; k < in->first[t + 1]; k++) {
            out->sight[out->sights] = in->sight[k];
            out->sight[out->sights++].track = i;
        }
        out->first[++out->tracks] = out->sights;
    }
    err = 0;
done:
    free(rank);
    free(full);
    if (err)
        poses_tracks_fini(out);
    return err;
}
