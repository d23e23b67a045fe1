/* Poses of light fields: pictures are matched, poses found, and shared by the moments of one rig. */
#include "pipeline/posed/solve/solve.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/log.h"
#include "base/stats.h"
#include "base/thread.h"
#include "pipeline/posed/solve/solve_internal.h"

/* Common focal length of ideal pixels and principal points: of the user, of lenses that are known, or none. */
static int scene_init(struct poses_scene *scene, struct sst_posed *posed, const char *dir, double focal_px)
{
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
        const bool own = !(focal_px > 0) && cam->fx > 0;

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

static int solve_scenes(struct poses_scene *scene, int count, const struct sst_posed_solve_config *cfg)
{
    int err = 0;

    for (int i = 0; !err && i < count; i++) {
        report_progress(cfg, (double)i / count);
        err = poses_scene_match(&scene[i], poses_levels, &scene[i], cfg->threads);
        report_progress(cfg, (i + 0.8) / count);
        if (!err)
            err = poses_find(&scene[i], cfg);
    }
    if (!err && cfg->one_rig && count > 1)
        err = poses_share_rig(scene, count, cfg);
    for (int i = 0; !err && i < count; i++)
        err = poses_check_placed(&scene[i]);
    return err;
}

int sst_posed_solve(struct sst_posed *posed, const char *const *dir, int count,
                    const struct sst_posed_solve_config *cfg, struct sst_posed_solved *solved)
{
    struct poses_scene *scene = calloc((size_t)count, sizeof(*scene));
    struct sst_posed_solve_config own = *cfg;
    int err = scene ? 0 : -ENOMEM;

    own.threads = sst_thread_count(cfg->threads);
    for (int i = 0; !err && i < count; i++) {
        err = check(&posed[i], dir[i], cfg);
        if (!err)
            err = scene_init(&scene[i], &posed[i], dir[i], cfg->focal_px);
    }
    if (!err)
        err = solve_scenes(scene, count, &own);
    for (int i = 0; !err && i < count; i++)
        err = poses_report(&scene[i], &own, &solved[i]);
    for (int i = 0; scene && i < count; i++)
        poses_scene_fini(&scene[i]);
    free(scene);
    if (err == -ENOMEM)
        sst_log_error("out of memory while poses are found");
    return err;
}
