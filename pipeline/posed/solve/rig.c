/* One rig at several moments: relative poses of its views are the same, so their median is a prior of each moment. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/stats.h"
#include "base/thread.h"
#include "pipeline/posed/solve/solve_internal.h"

#define SIGMA_ANGLE  (0.3 * 3.14159265358979 / 180) /* of a rig's rotations at one moment */
#define SIGMA_CENTRE 0.03                           /* of its centres, in distances of neighbours */
#define SIGMA_FOCAL  0.02                           /* of the logarithm, between moments with pictures of one size */
#define SIGMA_AXES   1e-4                           /* of the reference view, which defines the axes */
#define WIDEST_PX    30

struct rig {
    struct poses_scene *scene;
    const struct sst_posed_solve_config *cfg;
    int count, views, reference;
    double *focal; /* [count] */
    bool line;
    bool *known;               /* [views] */
    struct poses_prior *prior; /* [views] */
    double (*rotation)[9];     /* [count][views] relative to the reference view */
    double (*centre)[3];       /* in median distances of neighbours */
};

static bool has(const struct rig *rig, int set, int view)
{
    return rig->scene[set].placed[view] && rig->scene[set].placed[rig->reference];
}

/* View that most moments have placed, the nearest to the middle among equals. */
static int reference_of(const struct rig *rig)
{
    int best = 0, most = -1;

    for (int k = 0; k < rig->views; k++) {
        const int v = rig->views / 2 + (k % 2 ? -(k + 1) / 2 : k / 2);
        int placed = 0;

        for (int s = 0; v >= 0 && v < rig->views && s < rig->count; s++)
            placed += rig->scene[s].placed[v];
        if (v >= 0 && v < rig->views && placed > most) {
            most = placed;
            best = v;
        }
    }
    return best;
}

static double median_gap(const struct poses_scene *scene, double *work)
{
    int count = 0;

    for (int v = 1; v < scene->views; v++) {
        const double *a = scene->model.centre[v - 1], *b = scene->model.centre[v];

        if (scene->placed[v - 1] && scene->placed[v])
            work[count++] =
                sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
    }
    return count ? sst_stats_median(work, count) : 1;
}

/* Poses of a moment in the axes of its reference view. */
static void relative(struct rig *rig, int set, double *work)
{
    const struct poses_scene *scene = rig->scene + set;
    const double *axes = scene->model.rotation[rig->reference], *from = scene->model.centre[rig->reference];
    const double gap = median_gap(scene, work);

    for (int v = 0; v < rig->views; v++) {
        const size_t at = (size_t)set * rig->views + v;
        double d[3];

        for (int i = 0; i < 3; i++)
            d[i] = (scene->model.centre[v][i] - from[i]) / gap;
        sst_rotation_between(scene->model.rotation[v], axes, rig->rotation[at]);
        sst_numbers_apply3(axes, d, rig->centre[at]);
    }
}

static double angle_between(const double a[9], const double b[9])
{
    double between[9], v[3];

    sst_rotation_between(a, b, between);
    sst_rotation_to_vector(between, v);
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* The moment's rotation that is nearest to all others', and medians of centres. */
static void median_pose(struct rig *rig, int v, double *work)
{
    double least = INFINITY;
    int count = 0;

    for (int s = 0; s < rig->count; s++) {
        const double *own = rig->rotation[(size_t)s * rig->views + v];
        double sum = 0;

        for (int o = 0; has(rig, s, v) && o < rig->count; o++)
            sum += has(rig, o, v) ? angle_between(own, rig->rotation[(size_t)o * rig->views + v]) : 0;
        if (has(rig, s, v) && sum < least) {
            least = sum;
            memcpy(rig->prior[v].rotation, own, sizeof(rig->prior[v].rotation));
        }
    }
    for (int i = 0; i < 3; i++) {
        count = 0;
        for (int s = 0; s < rig->count; s++) {
            if (has(rig, s, v))
                work[count++] = rig->centre[(size_t)s * rig->views + v][i];
        }
        rig->prior[v].centre[i] = sst_stats_median(work, count);
    }
    rig->known[v] = count > 0;
    rig->prior[v].sigma_angle = v == rig->reference ? SIGMA_AXES : SIGMA_ANGLE;
    rig->prior[v].sigma_centre = v == rig->reference ? SIGMA_AXES : SIGMA_CENTRE;
}

/* Mean distance of neighbours one, as in each scene's model. */
static void scale_prior(struct rig *rig)
{
    struct poses_model all = { .views = rig->views, .centre = malloc((size_t)rig->views * sizeof(*all.centre)) };
    double unit = 1;

    if (!all.centre)
        return;
    for (int v = 0; v < rig->views; v++)
        memcpy(all.centre[v], rig->prior[v].centre, sizeof(*all.centre));
    unit = poses_spacing(&all, rig->known, NULL);
    for (int v = 0; v < rig->views; v++) {
        for (int i = 0; i < 3; i++)
            rig->prior[v].centre[i] /= unit;
    }
    free(all.centre);
}

static bool same_size(const struct poses_scene *a, const struct poses_scene *b)
{
    return a->posed->width == b->posed->width && a->posed->height == b->posed->height;
}

/* Median focal length of the moments whose pictures have this one's size. */
static double usual_focal(const struct rig *rig, int set)
{
    double focal = rig->focal[set];
    double *some = malloc((size_t)rig->count * sizeof(*some));
    int n = 0;

    for (int s = 0; some && s < rig->count; s++) {
        if (same_size(rig->scene + s, rig->scene + set))
            some[n++] = rig->focal[s];
    }
    if (some)
        focal = sst_stats_median(some, n);
    free(some);
    return focal;
}

/* A moment again, from the rig's poses. Views without matches of their own stand where the rig has them. */
static int solve_again(void *arg, int set, int worker)
{
    const struct rig *rig = arg;
    struct poses_scene *scene = rig->scene + set;
    struct poses_adjust how = { .linked = scene->linked,
                                .prior = rig->prior,
                                .free_focal = !scene->focal_known,
                                .focal_prior = usual_focal(rig, set),
                                .focal_sigma = SIGMA_FOCAL };
    int err;

    (void)worker;
    for (int v = 0; v < rig->views; v++) {
        memcpy(scene->model.rotation[v], rig->prior[v].rotation, sizeof(*scene->model.rotation));
        memcpy(scene->model.centre[v], rig->prior[v].centre, sizeof(*scene->model.centre));
    }
    scene->model.focal = how.focal_prior;
    scene->line = rig->line;
    poses_triangulate(&scene->model, &scene->few);
    err = poses_finish(scene, &how, WIDEST_PX);
    for (int v = 0; !err && v < rig->views; v++)
        scene->placed[v] = scene->placed[v] || rig->known[v];
    return err;
}

static void read_lenses(struct rig *rig)
{
    int lines = 0;

    for (int s = 0; s < rig->count; s++) {
        rig->focal[s] = rig->scene[s].model.focal;
        lines += rig->scene[s].line;
    }
    rig->line = 2 * lines > rig->count;
}

int poses_share_rig(struct poses_scene *scene, int count, const struct sst_posed_solve_config *cfg)
{
    struct rig rig = { .scene = scene, .cfg = cfg, .count = count, .views = scene->views };
    const size_t n = (size_t)scene->views, all = n * (size_t)count;
    double *work = malloc((n + (size_t)count) * sizeof(*work));
    int err = -ENOMEM, known = 0;

    rig.focal = malloc((size_t)count * sizeof(*rig.focal));
    rig.known = calloc(n, sizeof(*rig.known));
    rig.prior = calloc(n, sizeof(*rig.prior));
    rig.rotation = malloc(all * sizeof(*rig.rotation));
    rig.centre = malloc(all * sizeof(*rig.centre));
    if (!work || !rig.focal || !rig.known || !rig.prior || !rig.rotation || !rig.centre)
        goto done;
    rig.reference = reference_of(&rig);
    read_lenses(&rig);
    for (int s = 0; s < count; s++)
        relative(&rig, s, work);
    for (int v = 0; v < rig.views; v++)
        median_pose(&rig, v, work);
    for (int v = 0; v < rig.views; v++)
        known += rig.known[v];
    err = 0;
    if (known < 2) /* no distance to scale by */
        goto done;
    scale_prior(&rig);
    err = sst_parallel_for(count, cfg->threads, solve_again, &rig);
done:
    free(work);
    free(rig.focal);
    free(rig.known);
    free(rig.prior);
    free(rig.rotation);
    free(rig.centre);
    return err;
}
