/* Result of a scene: axes and unit of the light field, its views, points and figures, and views that are doubtful. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/stats.h"
#include "base/text.h"
#include "pipeline/posed/solve/solve_internal.h"

#define UNIT_MM     1000.0 /* of a light field without a scale: the mean distance of neighbours */
#define INLIER_PX   3.0
#define GAP_LEAST   0.6 /* distances of neighbours on a line, in medians, that are plausible */
#define GAP_MOST    1.6
#define FAR_FACTOR  4.0  /* distance of the nearest view, in medians of all: farther is doubtful */
#define TILT_DEG    40.0 /* between views that match, besides the roll of their pictures */
#define RESIDUAL    3.0  /* median residual, in medians of all views, and ... */
#define RESIDUAL_PX 0.5
#define FEW_SIGHTS  30
#define FAR         1e5 /* of a point, in distances of neighbours: no longer a place */

/* World of the light field: X = turn (x - from) unit + to. */
struct world {
    double turn[9], from[3], to[3], unit;
};

static double distance(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
}

/* By name. */
static int first_placed(const struct poses_scene *scene)
{
    for (int i = 0; i < scene->views; i++) {
        const int v = scene->named ? scene->named[i] : i;

        if (scene->placed[v])
            return v;
    }
    return 0;
}

/* Neighbours on a line are its own, others those in the order of names. */
static double spacing_of(const struct poses_scene *scene)
{
    return poses_spacing(&scene->model, scene->placed, scene->line || scene->along ? NULL : scene->named);
}

/* Axes of the first placed view, at it. */
static void world_of_first(struct world *w, const struct poses_scene *scene, double unit)
{
    const int v = first_placed(scene);

    *w = (struct world){ .unit = unit };
    memcpy(w->turn, scene->model.rotation[v], sizeof(w->turn));
    memcpy(w->from, scene->model.centre[v], sizeof(w->from));
}

/* Mean rotation from the model's world to the given poses' world, by vectors from the first view's rotation. */
static void mean_turn(double out[9], const struct poses_scene *scene)
{
    double first[9], sum[3] = { 0 }, v[3], mean[9];
    int count = 0;

    for (int k = 0; k < scene->views; k++) {
        const double *given = scene->posed->view[k].camera.rotation, *own = scene->model.rotation[k];
        double turn[9], from[9];

        if (!scene->placed[k] || !scene->posed->view[k].camera.known)
            continue;
        for (int i = 0; i < 9; i++) /* given' own */
            turn[i] = given[i / 3] * own[i % 3] + given[3 + i / 3] * own[3 + i % 3] + given[6 + i / 3] * own[6 + i % 3];
        if (!count++)
            memcpy(first, turn, sizeof(first));
        sst_rotation_between(turn, first, from);
        sst_rotation_to_vector(from, v);
        for (int i = 0; i < 3; i++)
            sum[i] += v[i];
    }
    for (int i = 0; i < 3; i++)
        sum[i] /= count;
    sst_rotation_from_vector(sum, mean);
    sst_numbers_mul3(mean, first, out);
}

/* Similarity to the given poses. @return false: fewer than two are given */
static bool world_of_given(struct world *w, const struct poses_scene *scene)
{
    double own = 0, given = 0;
    int last = -1, count = 0;

    *w = (struct world){ .unit = 1 };
    for (int k = 0; k < scene->views; k++) {
        const struct sst_calib_camera *cam = &scene->posed->view[k].camera;

        if (!scene->placed[k] || !cam->known)
            continue;
        for (int i = 0; i < 3; i++) {
            w->from[i] += scene->model.centre[k][i];
            w->to[i] += cam->position_mm[i];
        }
        if (count++) {
            own += distance(scene->model.centre[k], scene->model.centre[last]);
            given += distance(cam->position_mm, scene->posed->view[last].camera.position_mm);
        }
        last = k;
    }
    if (count < 2 || !(own > 0) || !(given > 0))
        return false;
    w->unit = given / own;
    for (int i = 0; i < 3; i++) {
        w->from[i] /= count;
        w->to[i] /= count;
    }
    mean_turn(w->turn, scene);
    return true;
}

static void to_world(const struct world *w, const double in[3], double out[3])
{
    const double d[3] = { in[0] - w->from[0], in[1] - w->from[1], in[2] - w->from[2] };

    sst_numbers_apply3(w->turn, d, out);
    for (int i = 0; i < 3; i++)
        out[i] = out[i] * w->unit + w->to[i];
}

/* Place the views of the light field. @param refined  others stay where they were given */
static void write_views(struct poses_scene *scene, const struct world *w, bool refined)
{
    for (int k = 0; k < scene->views; k++) {
        struct sst_calib_camera *cam = &scene->posed->view[k].camera;
        double rotation[9];

        if (scene->lenses) {
            sst_camera_adjust(cam, scene->model.focal / scene->focal, scene->model.k1);
        } else {
            cam->fx = cam->fy = scene->model.focal;
            cam->cx = scene->middle[k][0];
            cam->cy = scene->middle[k][1];
            cam->lens = scene->model.k1 != 0 ? 5 : 0;
            memset(cam->k, 0, sizeof(cam->k));
            cam->k[0] = scene->model.k1;
        }
        if (!scene->placed[k]) {
            cam->known = cam->known && refined; /* where it was given */
            continue;
        }
        cam->known = true;
        sst_rotation_between(scene->model.rotation[k], w->turn, rotation);
        memcpy(cam->rotation, rotation, sizeof(rotation));
        to_world(w, scene->model.centre[k], cam->position_mm);
    }
}

/* Rays of short tracks can be parallel but for noise. */
static bool is_near(const double point[3])
{
    return fabs(point[0]) < FAR && fabs(point[1]) < FAR && fabs(point[2]) < FAR;
}

/* Place of a sight in its picture. */
static struct sst_posed_sight sight_of(const struct poses_scene *scene, const struct poses_sight *s)
{
    double x = s->x + scene->middle[s->view][0], y = s->y + scene->middle[s->view][1];

    if (scene->lenses) /* which are not adjusted yet */
        sst_camera_distort(&scene->posed->view[s->view].camera, s->x / scene->focal, s->y / scene->focal, &x, &y);
    return (struct sst_posed_sight){ s->view, (float)x, (float)y };
}

/* Points that two placed views see within a few px. */
static int write_points(struct poses_scene *scene, const struct world *w, const double *px)
{
    const struct poses_tracks *few = &scene->few;
    struct sst_posed_point *points = malloc((size_t)few->tracks * sizeof(*points) + 1);
    struct sst_posed_sight *sights = malloc((size_t)few->sights * sizeof(*sights) + 1);
    int count = 0, seen = 0;

    if (!points || !sights) {
        free(points);
        free(sights);
        return -ENOMEM;
    }
    for (int t = 0; t < few->tracks; t++) {
        int views = 0;

        for (int s = few->first[t]; s < few->first[t + 1]; s++)
            views += scene->placed[few->sight[s].view] && px[s] < INLIER_PX;
        if (views < 2 || !is_near(scene->model.point[t]))
            continue;
        to_world(w, scene->model.point[t], points[count].at_mm);
        points[count++].views = views;
        for (int s = few->first[t]; s < few->first[t + 1]; s++) {
            if (scene->placed[few->sight[s].view] && px[s] < INLIER_PX)
                sights[seen++] = sight_of(scene, &few->sight[s]);
        }
    }
    free(scene->posed->points);
    free(scene->posed->sights);
    scene->posed->points = points;
    scene->posed->sights = sights;
    scene->posed->point_count = count;
    scene->posed->sight_count = seen;
    return 0;
}

/* --- figures ------------------------------------------------------------------------------------------------------ */

/* Median residuals, of views and of all. */
static int residuals(struct poses_scene *scene, const double *px, struct sst_posed_solved *out)
{
    const struct poses_tracks *few = &scene->few;
    double *some = malloc((size_t)few->sights * sizeof(*some) + 1);
    int count = 0;

    out->view_px = malloc((size_t)scene->views * sizeof(*out->view_px));
    out->doubtful = calloc((size_t)scene->views, sizeof(*out->doubtful));
    if (!some || !out->view_px || !out->doubtful) {
        free(some);
        return -ENOMEM;
    }
    for (int k = 0; k < scene->views; k++) {
        count = 0;
        for (int s = 0; s < few->sights; s++) {
            if (few->sight[s].view == k)
                some[count++] = px[s];
        }
        out->view_px[k] = scene->placed[k] && count ? sst_stats_median(some, count) : (double)NAN;
        out->doubtful[k] = scene->placed[k] && count < FEW_SIGHTS;
        out->placed += scene->placed[k];
    }
    count = 0;
    for (int s = 0; s < few->sights; s++) {
        if (scene->placed[few->sight[s].view])
            some[count++] = px[s];
    }
    out->median_px = count ? sst_stats_median(some, count) : (double)NAN;
    out->p90_px = count ? sst_stats_quantile(some, count, 0.9) : (double)NAN;
    free(some);
    return 0;
}

/* Distances to the views before and after on a line, of their median. @return how many are plausible of `count` */
static int plausible_gaps(const struct poses_scene *scene, int k, double median, int *count)
{
    int good = 0;

    *count = 0;
    for (int way = -1; way <= 1; way += 2) {
        int o = k + way;

        while (o >= 0 && o < scene->views && !scene->placed[o])
            o += way;
        if (o >= 0 && o < scene->views) {
            const double gap = distance(scene->model.centre[k], scene->model.centre[o]) / abs(o - k) / median;

            ++*count;
            good += gap > GAP_LEAST && gap < GAP_MOST;
        }
    }
    return good;
}

static double nearest(const struct poses_scene *scene, int k)
{
    double least = INFINITY;

    for (int o = 0; o < scene->views; o++) {
        if (o != k && scene->placed[o])
            least = fmin(least, distance(scene->model.centre[k], scene->model.centre[o]));
    }
    return least;
}

/* Median distance of neighbours on a line, or of the nearest views. */
static double usual_gap(const struct poses_scene *scene, double *work)
{
    int count = 0, last = -1;

    for (int k = 0; k < scene->views; k++) {
        if (!scene->placed[k])
            continue;
        if (!scene->line)
            work[count++] = nearest(scene, k);
        else if (last >= 0)
            work[count++] = distance(scene->model.centre[k], scene->model.centre[last]) / (k - last);
        last = k;
    }
    return sst_stats_median(work, count);
}

/* Smallest tilt against the views that this one matches, besides the roll that pictures show. */
static double least_tilt(const struct poses_scene *scene, int k)
{
    double least = INFINITY;

    for (int p = 0; p < scene->pairs; p++) {
        const struct poses_pair *pair = scene->pair + p;
        double between[9], roll[9], rest[9], v[3];

        if ((pair->a != k && pair->b != k) || !scene->placed[pair->a] || !scene->placed[pair->b])
            continue;
        sst_rotation_between(scene->model.rotation[pair->b], scene->model.rotation[pair->a], between);
        sst_rotation_from_vector((double[]){ 0, 0, atan2(pair->similarity[1], pair->similarity[0]) }, roll);
        sst_rotation_between(between, roll, rest);
        sst_rotation_to_vector(rest, v);
        least = fmin(least, sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]));
    }
    return isfinite(least) ? least * 180 / 3.14159265358979 : 0;
}

/* Residuals alone do not show a camera that hangs on few matches: its place is compared with the others'. */
static int find_doubtful(const struct poses_scene *scene, struct sst_posed_solved *out)
{
    double *work = malloc((size_t)scene->views * sizeof(*work)), gap;

    if (!work)
        return -ENOMEM;
    gap = usual_gap(scene, work);
    for (int k = 0; k < scene->views; k++) {
        int gaps = 0, good = 0;

        if (!scene->placed[k])
            continue;
        if (scene->line)
            good = plausible_gaps(scene, k, gap, &gaps);
        else
            good = gaps = 1, good = nearest(scene, k) < FAR_FACTOR * gap;
        out->doubtful[k] = out->doubtful[k] || (gaps && !good) || least_tilt(scene, k) > TILT_DEG ||
                           isgreater(out->view_px[k], RESIDUAL * out->median_px + RESIDUAL_PX);
    }
    free(work);
    return 0;
}

static void write_history(const struct poses_scene *scene, const struct sst_posed_solve_config *cfg,
                          const struct sst_posed_solved *out)
{
    char lens[96] = "";

    if (cfg->free_lens || !scene->focal_known)
        snprintf(lens, sizeof(lens), ", focal length %.1f px found", out->focal_px);
    if (lens[0] && out->focal_doubt > 0)
        sst_text_add(lens, sizeof(lens), " +- %.2g %%", 100 * fmin(out->focal_doubt, 1));
    snprintf(scene->posed->history, sizeof(scene->posed->history),
             "%s %d of %d views by features%s%s: median %.3f px%s", cfg->refine ? "refined" : "found", out->placed,
             scene->views, scene->line ? " on a line" : "", cfg->one_rig ? " of one rig" : "", out->median_px, lens);
}

int poses_report(struct poses_scene *scene, const struct sst_posed_solve_config *cfg, struct sst_posed_solved *solved)
{
    struct sst_posed *posed = scene->posed;
    double *px = malloc((size_t)scene->few.sights * sizeof(*px) + 1);
    struct world w;
    int err = -ENOMEM;

    *solved = (struct sst_posed_solved){ 0 };
    if (!px)
        goto done;
    poses_residuals(&scene->model, &scene->few, px);
    err = residuals(scene, px, solved);
    if (!err)
        err = find_doubtful(scene, solved);
    if (err)
        goto done;
    if (cfg->refine) { /* the priors hold axes and unit */
        w = (struct world){ .turn = { 1, 0, 0, 0, 1, 0, 0, 0, 1 }, .unit = scene->unit_mm };
    } else if (cfg->spacing_mm > 0 || !world_of_given(&w, scene)) {
        world_of_first(&w, scene, (cfg->spacing_mm > 0 ? cfg->spacing_mm : UNIT_MM) / spacing_of(scene));
        posed->metric = cfg->spacing_mm > 0;
        posed->geographic = false;
        memset(posed->up, 0, sizeof(posed->up));
    }
    err = write_points(scene, &w, px);
    if (err)
        goto done;
    write_views(scene, &w, cfg->refine);
    for (int k = 0; cfg->refine && k < scene->views; k++) {
        const bool kept = posed->view[k].camera.known && !scene->placed[k];

        solved->placed += kept;
        solved->doubtful[k] = solved->doubtful[k] || kept;
    }
    posed->median_px = solved->median_px;
    solved->focal_px = posed->view[first_placed(scene)].camera.fx;
    if (scene->free_focal > 0)
        solved->free_focal_px = scene->free_focal * solved->focal_px / scene->focal;
    solved->focal_doubt = scene->focal_doubt;
    solved->spacing_mm = spacing_of(scene) * w.unit;
    write_history(scene, cfg, solved);
done:
    free(px);
    if (err)
        sst_posed_solved_fini(solved);
    return err;
}

/* A scene of the placed views, without sights. */
static int scene_of(struct poses_scene *scene, struct sst_posed *posed)
{
    int err = poses_model_init(&scene->model, posed->count, 0);

    scene->posed = posed;
    scene->views = posed->count;
    scene->placed = calloc((size_t)posed->count, sizeof(*scene->placed));
    if (err || !scene->placed)
        return -ENOMEM;
    for (int k = 0; k < posed->count; k++) {
        scene->placed[k] = posed->view[k].camera.known;
        memcpy(scene->model.rotation[k], posed->view[k].camera.rotation, sizeof(*scene->model.rotation));
        memcpy(scene->model.centre[k], posed->view[k].camera.position_mm, sizeof(*scene->model.centre));
    }
    return 0;
}

double sst_posed_spacing(const struct sst_posed *posed)
{
    struct sst_posed copy = *posed; /* not changed */
    struct poses_scene scene = { 0 };
    const double spacing = scene_of(&scene, &copy) ? 0 : spacing_of(&scene);

    poses_scene_fini(&scene);
    return spacing;
}

int sst_posed_judge(const struct sst_posed *posed, struct sst_posed_solved *solved)
{
    struct sst_posed copy = *posed;
    struct poses_scene scene = { 0 };
    int err = scene_of(&scene, &copy);

    *solved = (struct sst_posed_solved){ 0 };
    if (!err)
        err = residuals(&scene, NULL, solved);
    for (int k = 0; !err && k < posed->count; k++)
        solved->doubtful[k] = false; /* no sights are known */
    if (!err)
        err = find_doubtful(&scene, solved);
    if (!err) {
        solved->median_px = posed->median_px;
        solved->focal_px = posed->view[first_placed(&scene)].camera.fx;
        solved->spacing_mm = spacing_of(&scene);
    }
    poses_scene_fini(&scene);
    return err;
}
