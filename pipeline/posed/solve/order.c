/* Order of the views of a scene: a path through the pictures that match best, where names are in another order. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/stats.h"
#include "pipeline/posed/solve/solve_internal.h"

#define PREFERENCE 1.25 /* ratio of scores of the best path and of names up to which their order stays */
#define ALONE_SELF 1.7  /* a view whose most matches are below both, of its median and of all views' median most, ... */
#define ALONE_ALL  0.5  /* ... matches nothing */
#define LEAST_GAP  0.4  /* of views on a line, of the mean gap */
#define MOST_GAP   2.0
#define ASIDE      1.0  /* of the mean gap: distance from the line */

/* Matches of next views, and by half of second next ones: these pairs are matched in full. */
static int64_t path_score(const int *path, const int *alike, int count, int views)
{
    int64_t sum = 0;

    for (int i = 0; i + 1 < count; i++) {
        const int *row = alike + (size_t)path[i] * (size_t)views;

        sum += 2 * row[path[i + 1]] + (i + 2 < count ? row[path[i + 2]] : 0);
    }
    return sum;
}

/* out: path with its part [from, to) moved before place `at` of the rest, turned round or not. */
static void moved(int *out, const int *path, int count, const int part[2], int place)
{
    const bool turned = place < 0;
    const int at = turned ? -place - 1 : place, length = part[1] - part[0];

    for (int i = 0, rest = 0; i < count; i++) {
        if (i >= at && i < at + length) {
            out[i] = turned ? path[part[1] - 1 - (i - at)] : path[part[0] + i - at];
        } else {
            out[i] = path[rest < part[0] ? rest : rest + length];
            rest++;
        }
    }
}

/* Move the part of the path that gains most, until none does. */
static int64_t climb(int *path, int *work, const int *alike, int count, int views)
{
    int *trial = work, *next = work + count;
    int64_t score = path_score(path, alike, count, views), before;

    do {
        before = score;
        for (int from = 0; from < count; from++) {
            for (int to = from + 1; to <= count; to++) {
                const int left = count - (to - from);

                for (int place = -left - 1; place <= left; place++) {
                    int64_t now;

                    moved(trial, path, count, (const int[]){ from, to }, place);
                    now = path_score(trial, alike, count, views);
                    if (now > score) {
                        score = now;
                        memcpy(next, trial, (size_t)count * sizeof(*next));
                    }
                }
            }
        }
        if (score > before)
            memcpy(path, next, (size_t)count * sizeof(*path));
    } while (score > before);
    return score;
}

/* From the view at place `first` of the path on, always the one that matches best. */
static void follow(int *path, const int *alike, int count, int views, int first)
{
    for (int i = 0, best = first; i < count; i++, best = i) {
        int view;

        for (int k = i; i && k < count; k++) {
            const int *row = alike + (size_t)path[i - 1] * (size_t)views;

            best = row[path[k]] > row[path[best]] ? k : best;
        }
        view = path[best];
        path[best] = path[i];
        path[i] = view;
    }
}

static double apart(const double a[3], const double b[3])
{
    return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

/* Views that match others, then the rest, both in the order of names. @return number that match */
static int split_matching(int *path, const int *alike, int views)
{
    double *most = malloc((size_t)views * 3 * sizeof(*most)), *row = most + views, *all = row + views, usual;
    int count = 0, rest = views;

    if (!most)
        return -ENOMEM;
    for (int v = 0; v < views; v++) {
        most[v] = 0;
        for (int k = 0; k < views; k++)
            most[v] = sst_max_int((int)most[v], alike[(size_t)v * (size_t)views + k]);
    }
    memcpy(all, most, (size_t)views * sizeof(*all));
    usual = sst_stats_median(all, views);
    for (int v = 0; v < views; v++) {
        for (int k = 0; k < views; k++)
            row[k] = alike[(size_t)v * (size_t)views + k];
        if (most[v] >= ALONE_ALL * usual || most[v] >= ALONE_SELF * sst_stats_median(row, views))
            path[count++] = v;
    }
    for (int v = views - 1, at = count - 1; v >= 0; v--) {
        if (at >= 0 && path[at] == v)
            at--;
        else
            path[--rest] = v;
    }
    free(most);
    return count;
}

static void turn_round(int *path, int count)
{
    for (int i = 0, k = count - 1; i < k; i++, k--) {
        const int view = path[i];

        path[i] = path[k];
        path[k] = view;
    }
}

int poses_order(int *order, const int *alike, int views)
{
    const size_t bytes = (size_t)views * sizeof(*order);
    int *path = malloc(4 * bytes), *names = path + views, *work = names + views;
    const int count = path ? split_matching(names, alike, views) : -ENOMEM;
    int64_t most = -1, score;

    for (int first = 0; first < count; first++) {
        memcpy(path, names, bytes);
        follow(path, alike, count, views, first);
        score = path_score(path, alike, count, views);
        if (score > most) {
            most = score;
            memcpy(order, path, bytes);
        }
    }
    if (count > 0) {
        most = climb(order, work, alike, count, views);
        memcpy(path, names, bytes);
        score = climb(path, work, alike, count, views);
        if (score >= most) {
            most = score;
            memcpy(order, path, bytes);
        }
        if (order[0] > order[count - 1])
            turn_round(order, count);
    }
    if (count >= 0 && (double)most <= PREFERENCE * (double)path_score(names, alike, count, views)) {
        for (int v = 0; v < views; v++)
            order[v] = v;
    }
    free(path);
    return count < 0 ? count : 0;
}

/* --- scenes ------------------------------------------------------------------------------------------------------- */

/* array[i] becomes array[from[i]]. @return 0, -ENOMEM */
static int permute(void *array, size_t size, const int *from, int count)
{
    char *copy = malloc(size * (size_t)count);

    if (!copy)
        return -ENOMEM;
    memcpy(copy, array, size * (size_t)count);
    for (int i = 0; i < count; i++)
        memcpy((char *)array + size * (size_t)i, copy + size * (size_t)from[i], size);
    free(copy);
    return 0;
}

/* The light field's own array stays in the order of names. */
static int copy_views(struct poses_scene *scene)
{
    const int n = scene->views;
    struct sst_posed_view *view = malloc((size_t)n * sizeof(*view));

    scene->order = malloc((size_t)n * 2 * sizeof(*scene->order));
    if (!view || !scene->order) {
        free(view);
        free(scene->order);
        scene->order = NULL;
        return -ENOMEM;
    }
    memcpy(view, scene->posed->view, (size_t)n * sizeof(*view));
    scene->named = scene->order + n;
    for (int i = 0; i < n; i++)
        scene->order[i] = i;
    scene->in_names_order = scene->posed->view;
    scene->posed->view = view;
    return 0;
}

int poses_scene_arrange(struct poses_scene *scene, const int *order)
{
    const int n = scene->views;
    int err = scene->order ? 0 : copy_views(scene);

    err = err ? err : permute(scene->feature, sizeof(*scene->feature), order, n);
    err = err ? err : permute(scene->middle, sizeof(*scene->middle), order, n);
    err = err ? err : permute(scene->posed->view, sizeof(*scene->posed->view), order, n);
    err = err ? err : permute(scene->order, sizeof(*scene->order), order, n);
    for (int i = 0; !err && i < n; i++)
        scene->named[scene->order[i]] = i;
    return err;
}

bool poses_line_order(int *order, const struct poses_scene *scene)
{
    const double(*at)[3] = (const double(*)[3])scene->model.centre;
    const int n = scene->views;
    double place[POSES_MANY_VIEWS], along[3], longest = 0, step, aside = 0;
    int end[2] = { 0 };

    for (int v = 0; v < n; v++) {
        if (!scene->placed[v] || n > POSES_MANY_VIEWS)
            return false;
        for (int k = 0; k < v; k++) {
            const double mm = apart(at[v], at[k]);

            if (mm > longest) {
                longest = mm;
                end[0] = k;
                end[1] = v;
            }
        }
    }
    step = longest / (n - 1);
    if (n < 3 || !(step > 0))
        return false;
    for (int i = 0; i < 3; i++)
        along[i] = (at[end[1]][i] - at[end[0]][i]) / longest;
    for (int v = 0; v < n; v++) { /* sorted in */
        int i = v;
        double from;

        place[v] = 0;
        for (int c = 0; c < 3; c++)
            place[v] += along[c] * (at[v][c] - at[end[0]][c]);
        from = apart(at[v], at[end[0]]);
        aside = fmax(aside, sqrt(fmax(from * from - place[v] * place[v], 0)));
        for (; i > 0 && place[order[i - 1]] > place[v]; i--)
            order[i] = order[i - 1];
        order[i] = v;
    }
    for (int i = 1; i < n; i++) {
        const double gap = place[order[i]] - place[order[i - 1]];

        if (gap < LEAST_GAP * step || gap > MOST_GAP * step)
            return false;
    }
    if (order[0] > order[n - 1])
        turn_round(order, n);
    return aside < ASIDE * step;
}

int poses_scene_restore(struct poses_scene *scene, struct sst_posed_solved *solved)
{
    const int n = scene->views;
    int err = 0;

    if (!scene->order)
        return 0;
    for (int i = 0; i < n; i++)
        scene->in_names_order[scene->order[i]] = scene->posed->view[i];
    free(scene->posed->view);
    scene->posed->view = scene->in_names_order;
    if (solved->view_px) { /* poses are found */
        for (int i = 0; i < scene->posed->sight_count; i++)
            scene->posed->sights[i].view = scene->order[scene->posed->sights[i].view];
        err = permute(solved->doubtful, sizeof(*solved->doubtful), scene->named, n);
        err = err ? err : permute(solved->view_px, sizeof(*solved->view_px), scene->named, n);
    }
    free(scene->order);
    scene->order = scene->named = NULL;
    return err;
}
