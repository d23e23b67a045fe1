/* Poses of light fields: pictures are matched, poses found, and shared by the moments of one rig. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/solve/solve.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/stats.h"
#include "base/text.h"
#include "base/thread.h"
#include "pipeline/posed/find/sharpen.h"
#include "pipeline/posed/solve/solve_internal.h"

/* Common focal length of ideal pixels and principal points: of the user, of lenses that are known, or none. */
static int scene_init(struct poses_scene *scene, struct sst_posed *posed, const char *dir,
                      const struct sst_posed_solve_config *cfg)
{
    const double focal_px = cfg->focal_px;
    const int n = posed->count;
    double *fx = malloc((size_t)n * sizeof(*fx));
    int known = 0;

    *scene = (struct poses_scene){ .posed = posed, .dir = dir, .views = n };
    scene->middle = calloc((size_t)n, sizeof(*scene->middle));
    if (!fx || !scene->middle) {
        free(fx);
        return -ENOMEM;
    }
    for (int v = 0; v < n; v++) {
        const struct sst_calib_camera *cam = &posed->view[v].camera;
        const bool own = !(focal_px > 0) && !cfg->search_focal && cam->fx > 0;

        if (own)
            fx[known++] = cam->fx;
        scene->middle[v][0] = own ? cam->cx : (posed->width - 1) / 2.0;
        scene->middle[v][1] = own ? cam->cy : (posed->height - 1) / 2.0;
    }
    scene->lenses = known == n;
    scene->focal_known = focal_px > 0 || known == n;
    scene->focal = focal_px > 0 ? focal_px : known ? sst_stats_median(fx, known) : 0;
    free(fx);
    return 0;
}

static int check(const struct sst_posed *posed, const char *dir, const struct sst_posed_solve_config *cfg)
{
    const int placed = sst_posed_placed(posed);

    if (!cfg->refine || placed > 1)
        return 0;
    sst_log_error("%s: --refine starts from given poses, and %s; find them without --refine", dir,
                  placed ? "one view alone is placed" : "no view is placed");
    return -EDOM;
}

void sst_posed_solved_fini(struct sst_posed_solved *solved)
{
    free(solved->doubtful);
    free(solved->view_px);
    *solved = (struct sst_posed_solved){ 0 };
}

static void report_progress(const struct sst_posed_solve_config *cfg, double done)
{
    if (cfg->progress)
        cfg->progress(cfg->progress_arg, done);
}

/* Views of scenes, if they are few, into one order along which pictures match; names may have any order. */
static int arrange(struct poses_scene *scene, int count, const struct sst_posed_solve_config *cfg)
{
    const int n = scene->views;
    int *alike, *order, err = 0;

    if (cfg->refine || n < 3 || n > POSES_MANY_VIEWS)
        return 0;
    for (int i = 1; i < count; i++) {
        if (scene[i].views != n)
            return 0;
    }
    alike = calloc((size_t)n * (size_t)n, sizeof(*alike));
    order = calloc((size_t)n, sizeof(*order));
    if (!alike || !order)
        err = -ENOMEM;
    for (int i = 0; !err && i < count; i++)
        err = poses_scene_compare(&scene[i], alike, cfg->threads);
    if (!err)
        err = poses_order(order, alike, n);
    for (int v = 0; !err && v < n; v++) {
        if (order[v] == v)
            continue;
        for (int i = 0; !err && i < count; i++)
            err = poses_scene_arrange(&scene[i], order);
        break;
    }
    free(alike);
    free(order);
    return err;
}

/* Once more, if views stand on a line in another order, with matches and neighbours along it. */
static int find_along(struct poses_scene *scene, const struct sst_posed_solve_config *cfg)
{
    int order[POSES_MANY_VIEWS], err = 0;
    bool as_named = true, again = false;

    if (cfg->refine || scene->views < 3 || scene->views > POSES_MANY_VIEWS || !poses_line_order(order, scene))
        return 0;
    for (int i = 0; i < scene->views; i++) {
        again = again || order[i] != i;
        as_named = as_named && (scene->order ? scene->order[order[i]] : order[i]) == i;
    }
    if (again) {
        poses_scene_unmatch(scene);
        err = poses_scene_arrange(scene, order);
        err = err ? err : poses_scene_match(scene, cfg->threads);
        err = err ? err : poses_find(scene, cfg);
    }
    scene->along = true;
    if (!err && !as_named)
        sst_log_warning("%s: views stand on a line, and their names are in another order; neighbours are those on the "
                        "line",
                        scene->dir);
    return err;
}

/* The same number of views, or the moments are not of one rig. Sizes may differ: pictures can have been cropped. */
static int check_alike(const struct poses_scene *scene, int count)
{
    for (int s = 1; s < count; s++) {
        if (scene[s].views != scene->views) {
            sst_log_error("%s has %d views, %s %d: they are not of one rig", scene->dir, scene->views, scene[s].dir,
                          scene[s].views);
            return -EBADMSG;
        }
    }
    return 0;
}

static int solve_scenes(struct poses_scene *scene, int count, const struct sst_posed_solve_config *cfg)
{
    int err = cfg->one_rig ? check_alike(scene, count) : 0;

    for (int i = 0; !err && i < count; i++) {
        report_progress(cfg, 0.4 * i / count);
        err = poses_scene_detect(&scene[i], poses_levels, &scene[i], cfg->threads);
    }
    if (!err && cfg->one_rig)
        err = arrange(scene, count, cfg);
    for (int i = 0; !err && !cfg->one_rig && i < count; i++)
        err = arrange(&scene[i], 1, cfg);
    for (int i = 0; !err && i < count; i++) {
        report_progress(cfg, 0.4 + 0.6 * i / count);
        err = poses_scene_match(&scene[i], cfg->threads);
        report_progress(cfg, 0.4 + 0.6 * (i + 0.6) / count);
        if (!err)
            err = poses_find(&scene[i], cfg);
        if (!err && !cfg->one_rig)
            err = find_along(&scene[i], cfg);
    }
    if (!err && cfg->one_rig && count > 1)
        err = poses_share_rig(scene, count, cfg);
    for (int i = 0; !err && i < count; i++)
        err = poses_check_placed(&scene[i]);
    return err;
}

/* May given poses be refined by warm places? */
static bool is_warm(const struct sst_posed *posed, const struct sst_posed_solve_config *cfg)
{
    return cfg->refine && !cfg->free_lens && posed->channels == 1;
}

/* Poses by features. */
static int solve(struct sst_posed *posed, const char *const *dir, int count, const struct sst_posed_solve_config *cfg,
                 struct sst_posed_solved *solved)
{
    const bool warm = count == 1 && is_warm(posed, cfg);
    struct poses_scene *scene = calloc((size_t)count, sizeof(*scene));
    struct sst_posed_solve_config own = *cfg;
    int err = scene ? 0 : -ENOMEM;

    own.threads = sst_thread_count(cfg->threads);
    memset(solved, 0, (size_t)count * sizeof(*solved));
    for (int i = 0; !err && i < count; i++) {
        err = check(&posed[i], dir[i], cfg);
        if (!err)
            err = scene_init(&scene[i], &posed[i], dir[i], cfg);
        scene[i].warm = warm;
    }
    if (!err)
        err = solve_scenes(scene, count, &own);
    for (int i = 0; !err && i < count; i++)
        err = poses_report(&scene[i], &own, &solved[i]);
    for (int i = 0; scene && i < count; i++) {
        const int back = poses_scene_restore(&scene[i], &solved[i]);

        err = err ? err : back;
        poses_scene_fini(&scene[i]);
    }
    free(scene);
    if (err == -ENOMEM)
        sst_log_error("out of memory while poses are found");
    return err;
}

/* --- refinement by warm places ----------------------------------------------------------------------------------- */

#define PREFERENCE 1.25 /* least ratio of sharpness without and with features where the former is preferred */

static int copy_posed(struct sst_posed *out, const struct sst_posed *in)
{
    const size_t points = (size_t)in->point_count * sizeof(*in->points);

    *out = *in;
    out->view = malloc((size_t)in->count * sizeof(*in->view));
    out->points = points ? malloc(points) : NULL;
    if (!out->view || (points && !out->points)) {
        free(out->view);
        free(out->points);
        return -ENOMEM;
    }
    memcpy(out->view, in->view, (size_t)in->count * sizeof(*in->view));
    if (points)
        memcpy(out->points, in->points, points);
    return 0;
}

/* Every view gets the pinhole that the user gives, as features take it. */
static void take_focal(struct sst_posed *posed, double focal_px)
{
    for (int k = 0; k < posed->count && focal_px > 0; k++) {
        struct sst_calib_camera *cam = &posed->view[k].camera;

        cam->fx = cam->fy = focal_px;
        cam->cx = (posed->width - 1) / 2.0;
        cam->cy = (posed->height - 1) / 2.0;
        cam->lens = 0;
        memset(cam->k, 0, sizeof(cam->k));
    }
}

/* Are views tilted against the given ones by more than these may be off? Few matches let flights bend like that. */
static bool is_bent(const struct sst_posed *posed, const struct sst_posed *given, double sigma_deg)
{
    double square = 0, between[9], v[3];
    int n = 0;

    for (int k = 0; k < posed->count; k++) {
        if (!posed->view[k].camera.known || !given->view[k].camera.known)
            continue;
        sst_rotation_between(posed->view[k].camera.rotation, given->view[k].camera.rotation, between);
        sst_rotation_to_vector(between, v);
        square += v[0] * v[0] + v[1] * v[1];
        n++;
    }
    return sqrt(square / sst_max_int(n, 1)) > (sigma_deg > 0 ? sigma_deg : 2) * M_PI / 180;
}

/* The result without features, with its figures. */
static int take_sharpened(struct sst_posed *posed, struct sst_posed *sharp, const struct sst_sharpened *by,
                          struct sst_posed_solved *solved)
{
    const struct sst_posed features = *posed;
    int err;

    sst_posed_solved_fini(solved);
    snprintf(sharp->history, sizeof(sharp->history), "refined %d of %d views by warm places: %.2f times as sharp",
             by->moved, sharp->count, by->after / by->before);
    if (by->lens_gain > 0)
        sst_text_add(sharp->history, sizeof(sharp->history), ", lens by factor %.4f, k1 %+.4f", by->focal, by->k1);
    err = sst_posed_judge(sharp, solved);
    if (err)
        return err;
    if (by->lens_gain > 0) {
        solved->lens_gain = by->lens_gain;
        solved->lens_focal_px = solved->focal_px / by->focal;
        solved->lens_k1 = by->k1;
    }
    solved->sharper = by->after / by->before;
    solved->ground_mm = by->distance_mm;
    solved->ground_tilt_deg = by->tilt_deg;
    *posed = *sharp;
    *sharp = features; /* to be freed */
    return 0;
}

/* Refine given poses by warm places, and keep that if it is better than the result of features.
 * @param both  the result of features, and the given poses
 * @param err  of features: 0 or -EDOM. @return 0, -EDOM (neither is better than the given poses), or an error */
static int sharpen(struct sst_posed *const both[2], const char *dir, const struct sst_posed_solve_config *cfg,
                   struct sst_posed_solved *solved, int err)
{
    struct sst_sharpen_config how = { .sigma_angle_deg = cfg->sigma_angle_deg,
                                      .keep_lens = cfg->keep_lens,
                                      .threads = cfg->threads };
    const bool bent = !err && is_bent(both[0], both[1], cfg->sigma_angle_deg);
    struct sst_sharpened own, features = { 0 };
    int r = sst_posed_sharpen(both[1], dir, &how, &own);

    how.look = true;
    if (!r && !err && !bent)
        r = sst_posed_sharpen(both[0], dir, &how, &features);
    if (r == -ENODATA || (!r && !(own.after > own.before)))
        return err;
    if (r)
        return r;
    return own.after > PREFERENCE * features.before ? take_sharpened(both[0], both[1], &own, solved) : 0;
}

int sst_posed_solve(struct sst_posed *posed, const char *const *dir, int count,
                    const struct sst_posed_solve_config *cfg, struct sst_posed_solved *solved)
{
    const bool warm = count == 1 && is_warm(posed, cfg);
    struct sst_posed given;
    int err, r;

    if (!warm)
        return solve(posed, dir, count, cfg, solved);
    err = copy_posed(&given, posed);
    if (err)
        return err;
    take_focal(&given, cfg->focal_px);
    err = solve(posed, dir, count, cfg, solved);
    if (!err || (err == -EDOM && sst_posed_placed(&given) > 1)) {
        r = sharpen((struct sst_posed *const[]){ posed, &given }, dir[0], cfg, solved, err);
        if (r == -EDOM)
            sst_log_error("%s: too few features match, and warm places show no better poses than the given ones",
                          dir[0]);
        err = r;
    }
    if (err)
        sst_posed_solved_fini(solved);
    sst_posed_fini(&given);
    return err;
}
