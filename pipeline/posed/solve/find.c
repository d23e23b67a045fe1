/* Search of the poses of a scene: starts are adjusted on few tracks, the best one then on more. */
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

#define TRACKS_PER_VIEW 150 /* of the result */
#define TRACKS_AT_LEAST 1500
#define FEW_PER_VIEW    50   /* of starts */
#define FOCAL_USUAL     2.0  /* picture widths: middle of the search for a focal length ... */
#define FOCAL_FACTOR    2.0  /* ... and its sigma as a factor */
#define KNOWN_FOCAL     0.03 /* sigma of the logarithm of a focal length that is given */
#define LINE_PREFERENCE 1.2  /* cost that a line may have, of the cost without it */
#define INLIER_PX       3.0
#define FREE_ROUNDS     20 /* of adjustments with another focal length, which are compared with the result */
#define FOCAL_STEP      0.05
#define DOUBT_SPREADS   10 /* that an error may have */
#define STILL_FACTOR    2.0 /* cost of rotations alone, of that with motion, below which nothing moved */

#define RAD        (3.14159265358979 / 180)
#define COMMON_DEG 10.0 /* sigma of an error that all views of a compass share */

enum start {
    START_LINE = 0,
    START_PLANE = 1,
    START_TURNS = 2, /* no motion: to see whether there is any */
    START_GIVEN = 3,
};

struct attempt {
    enum start start;
    double focal;
    bool done;
    double cost;
    struct poses_model model;
};

struct search {
    struct poses_scene *scene;
    const struct sst_posed_solve_config *cfg;
    struct poses_tracks tracks;
    struct attempt attempt[12];
    int attempts;
    struct poses_prior *prior;
};

static struct poses_adjust adjust_of(const struct search *s, enum start start)
{
    const struct poses_scene *scene = s->scene;
    struct poses_adjust how = { .linked = scene->linked, .still = start == START_TURNS, .prior = s->prior };

    if (start == START_LINE) {
        how.line_along = POSES_LINE_ALONG;
        how.line_across = POSES_LINE_ACROSS;
    }
    if (!scene->focal_known) {
        how.focal_prior = FOCAL_USUAL * scene->posed->width;
        how.focal_sigma = log(FOCAL_FACTOR);
    } else {
        how.focal_prior = scene->focal;
        how.focal_sigma = KNOWN_FOCAL; /* where the lens is adjusted: k1 can stand for it in part */
    }
    return how;
}

int poses_failed(const struct poses_scene *scene, const char *why)
{
    if (!scene->warm)
        sst_log_error("%s: %s", scene->dir, why);
    return -EDOM;
}

/* Poses of the start. @return false: there is none of this kind */
static bool begin(struct poses_model *m, const struct search *s, enum start start)
{
    const struct poses_scene *scene = s->scene;

    switch (start) {
    case START_LINE:
        return poses_start_line(m, scene);
    case START_PLANE:
        poses_start_plane(m, scene);
        return poses_normalise(m, scene->linked) > 1e-3 * m->focal;
    case START_TURNS:
        poses_start_turns(m, scene);
        return true;
    case START_GIVEN:
        for (int v = 0; v < scene->views; v++) {
            memcpy(m->rotation[v], s->prior[v].rotation, sizeof(m->rotation[v]));
            memcpy(m->centre[v], s->prior[v].centre, sizeof(m->centre[v]));
        }
        return true;
    }
    return false;
}

/* From wide to narrow on few tracks. */
static int narrow(struct poses_model *m, double *cost, const struct search *s, enum start start)
{
    static const struct {
        double sigma_px, across;
        int rounds;
        bool focal;
    } stage[] = { { 30, 0.02, 12, false }, { 8, POSES_LINE_ACROSS, 10, false }, { 2, POSES_LINE_ACROSS, 12, true } };
    const double px = s->scene->posed->width / 1024.0; /* errors of starts grow with pictures */
    struct poses_adjust how = adjust_of(s, start);
    int err = 0;

    how.threads = s->attempts == 1 ? s->cfg->threads : 1; /* attempts run beside each other */
    for (size_t i = 0; !err && i < ARRAY_LEN(stage); i++) {
        how.sigma_px = stage[i].sigma_px > 4 ? fmax(stage[i].sigma_px * px, 3) : stage[i].sigma_px;
        how.rounds = stage[i].rounds;
        how.line_across = how.line_along > 0 ? stage[i].across : 0;
        how.free_focal = (stage[i].focal || start == START_TURNS) && !s->scene->focal_known;
        err = poses_adjust(m, &s->tracks, &how, cost);
    }
    return err;
}

/* The reversed start, if that fits better. */
static int try_reversed(struct attempt *a, const struct search *s)
{
    struct poses_model other;
    double cost = INFINITY;
    int err = poses_model_copy(&other, &a->model);

    if (err)
        return err;
    other.focal = a->focal;
    if (poses_reverse(&other, &s->tracks, s->scene->linked))
        err = narrow(&other, &cost, s, a->start);
    if (!err && cost < a->cost) {
        const struct poses_model worse = a->model;

        a->model = other;
        a->cost = cost;
        other = worse;
    }
    poses_model_fini(&other);
    return err;
}

static int attempt(void *arg, int index, int worker)
{
    struct search *s = arg;
    struct attempt *a = s->attempt + index;
    int err = poses_model_init(&a->model, s->scene->views, s->tracks.tracks);

    (void)worker;
    if (err)
        return err;
    a->model.focal = a->focal;
    if (!begin(&a->model, s, a->start))
        return 0;
    if (a->start == START_TURNS)
        poses_far_points(&a->model, &s->tracks);
    else
        poses_triangulate(&a->model, &s->tracks);
    err = narrow(&a->model, &a->cost, s, a->start);
    if (!err && (a->start == START_LINE || a->start == START_PLANE))
        err = try_reversed(a, s);
    a->done = !err && isfinite(a->cost) &&
              (a->start == START_TURNS || poses_spacing(&a->model, s->scene->linked, NULL) > 0);
    return err;
}

static void add_attempt(struct search *s, enum start start, double focal)
{
    s->attempt[s->attempts++] = (struct attempt){ .start = start, .focal = focal };
}

/* Starts that are tried. */
static void list_attempts(struct search *s)
{
    static const double widths[] = { 2.0, 1.1 };
    const struct poses_scene *scene = s->scene;

    if (s->prior) {
        add_attempt(s, START_GIVEN, scene->focal);
        return;
    }
    for (size_t i = 0; i < (scene->focal_known ? 1 : ARRAY_LEN(widths)); i++) {
        const double focal = scene->focal_known ? scene->focal : widths[i] * scene->posed->width;

        add_attempt(s, START_LINE, focal);
        add_attempt(s, START_PLANE, focal);
        add_attempt(s, START_TURNS, focal);
    }
}

/* The best attempt with motion, or of rotations alone; a line is preferred. */
static const struct attempt *best_of(const struct search *s, bool still)
{
    const struct attempt *best = NULL;

    for (int i = 0; i < s->attempts; i++) {
        const struct attempt *a = s->attempt + i;

        if (a->done && (a->start == START_TURNS) == still &&
            (!best || a->cost * (a->start == START_LINE ? 1 : LINE_PREFERENCE) <
                          best->cost * (best->start == START_LINE ? 1 : LINE_PREFERENCE)))
            best = a;
    }
    return best;
}

/* The best attempt becomes the scene's model. */
static int choose(struct search *s)
{
    struct poses_scene *scene = s->scene;
    const struct attempt *best = best_of(s, false), *still = best_of(s, true);
    int err;

    if (!best || (still && still->cost < STILL_FACTOR * best->cost)) {
        return poses_failed(
            scene, "the pictures show no parallax; poses need cameras at different places, and things near enough");
    }
    err = poses_model_init(&scene->model, scene->views, scene->few.tracks);
    if (err)
        return err;
    memcpy(scene->model.rotation, best->model.rotation, (size_t)scene->views * sizeof(*best->model.rotation));
    memcpy(scene->model.centre, best->model.centre, (size_t)scene->views * sizeof(*best->model.centre));
    scene->model.focal = best->model.focal;
    scene->line = best->start == START_LINE;
    poses_triangulate(&scene->model, &scene->few);
    return 0;
}

/* Views that enough sights support. */
static int keep_supported(struct poses_scene *scene)
{
    double *px = malloc((size_t)scene->few.sights * sizeof(*px) + 1);
    int *good = calloc((size_t)scene->views, sizeof(*good));
    int err = px && good ? 0 : -ENOMEM;

    if (!err)
        poses_residuals(&scene->model, &scene->few, px);
    for (int i = 0; !err && i < scene->few.sights; i++)
        good[scene->few.sight[i].view] += px[i] < INLIER_PX;
    for (int v = 0; !err && v < scene->views; v++)
        scene->placed[v] = scene->linked[v] && good[v] >= POSES_MIN_SIGHTS;
    free(px);
    free(good);
    return err;
}

int poses_finish(struct poses_scene *scene, const struct poses_adjust *how, double widest_px)
{
    struct poses_adjust now = *how;
    int err = 0;

    for (double sigma = widest_px; !err && sigma >= 1; sigma = sigma > 2 ? 2 : sigma - 1) {
        double cost;

        now.sigma_px = sigma;
        now.rounds = 20;
        now.free_focal = sigma <= 2 && how->free_focal;
        now.free_k1 = sigma <= 2 && how->free_k1;
        err = poses_adjust(&scene->model, &scene->few, &now, &cost);
    }
    return err ? err : keep_supported(scene);
}

int poses_check_placed(const struct poses_scene *scene)
{
    int placed = 0;

    for (int v = 0; v < scene->views; v++)
        placed += scene->placed[v];
    if (placed > 1)
        return 0;
    return poses_failed(scene, "too few matches of the pictures agree to place two views; poses need more overlap, or "
                               "sharper pictures");
}

/* Groups of pictures that do not match each other are refined together: given poses hold them in one world. */
static void link_given(struct poses_scene *scene)
{
    memset(scene->linked, 0, (size_t)scene->views * sizeof(*scene->linked));
    for (int p = 0; p < scene->pairs; p++) {
        const int a = scene->pair[p].a, b = scene->pair[p].b;

        if (scene->posed->view[a].camera.known && scene->posed->view[b].camera.known)
            scene->linked[a] = scene->linked[b] = true;
    }
}

/* Given poses as priors, in the unit of their neighbours' mean distance. */
static int read_priors(struct search *s)
{
    struct poses_scene *scene = s->scene;
    const double angle = s->cfg->sigma_angle_deg > 0 ? s->cfg->sigma_angle_deg : 2;
    struct poses_model given;
    double unit, sigma;
    int err = poses_model_init(&given, scene->views, 0);

    if (err)
        return err;
    s->prior = calloc((size_t)scene->views, sizeof(*s->prior));
    link_given(scene);
    for (int v = 0; v < scene->views; v++)
        memcpy(given.centre[v], scene->posed->view[v].camera.position_mm, sizeof(given.centre[v]));
    unit = scene->unit_mm = poses_spacing(&given, scene->linked, NULL);
    sigma = s->cfg->sigma_position_mm > 0 ? s->cfg->sigma_position_mm / unit : 0.1;
    for (int v = 0; s->prior && v < scene->views; v++) {
        struct poses_prior *p = s->prior + v;

        memcpy(p->rotation, scene->posed->view[v].camera.rotation, sizeof(p->rotation));
        for (int i = 0; i < 3; i++)
            p->centre[i] = given.centre[v][i] / unit;
        p->sigma_angle = angle * RAD;
        memcpy(p->axis, scene->posed->up, sizeof(p->axis));
        p->sigma_axis = COMMON_DEG * RAD * sqrt(scene->views); /* pictures tie views' turns to each other */
        p->sigma_centre = sigma;
    }
    poses_model_fini(&given);
    if (!s->prior)
        return -ENOMEM;
    if (!(unit > 0))
        return poses_failed(scene, "the given positions are all the same; find poses without --refine");
    return 0;
}

static int choose_tracks(struct search *s)
{
    struct poses_scene *scene = s->scene;
    struct poses_tracks all;
    int err = poses_tracks_make(&all, scene);

    if (err)
        return err;
    err = poses_tracks_choose(&scene->few, &all, scene, sst_max_int(TRACKS_AT_LEAST, TRACKS_PER_VIEW * scene->views));
    if (!err)
        err = poses_tracks_choose(&s->tracks, &all, scene, FEW_PER_VIEW * scene->views);
    poses_tracks_fini(&all);
    return err;
}

static int enough_views(const struct poses_scene *scene)
{
    if (scene->used > 1)
        return 0;
    return poses_failed(scene, scene->views == 1
                                   ? "one picture alone has no pose; poses are found from two pictures on"
                                   : "no two pictures show the same things; poses need pictures that overlap, with "
                                     "texture");
}

/* The focal length that the matches ask for, where a given one is kept: to say that it is wrong. */
static int find_free_focal(struct poses_scene *scene, const struct poses_adjust *how)
{
    struct poses_adjust now = *how;
    struct poses_model free_model;
    double cost;
    int err = poses_model_copy(&free_model, &scene->model);

    if (err)
        return err;
    now.focal_sigma = log(FOCAL_FACTOR);
    now.free_focal = true;
    now.rounds = FREE_ROUNDS;
    now.sigma_px = 1;
    err = poses_adjust(&free_model, &scene->few, &now, &cost);
    scene->free_focal = free_model.focal;
    poses_model_fini(&free_model);
    return err;
}

/* Doubt of a focal length that was found: how fast the cost rises when it is held FOCAL_STEP longer and all else adjusts.
 * Sights that share errors of matches count less than free ones: the spread is multiplied by DOUBT_SPREADS. */
static int find_focal_doubt(struct poses_scene *scene, const struct poses_adjust *how)
{
    struct poses_adjust now = *how;
    struct poses_model model;
    double best, longer;
    int err = poses_model_copy(&model, &scene->model);

    if (err)
        return err;
    now.free_focal = false;
    now.rounds = FREE_ROUNDS;
    now.sigma_px = 1;
    err = poses_adjust(&model, &scene->few, &now, &best);
    model.focal *= 1 + FOCAL_STEP;
    err = err ? err : poses_adjust(&model, &scene->few, &now, &longer);
    if (!err) {
        const double freedom = fmax(2.0 * scene->few.sights - 3.0 * scene->few.tracks - 6.0 * scene->used, 1);

        scene->focal_doubt = DOUBT_SPREADS * FOCAL_STEP / sqrt(fmax(longer - best, 0) * freedom / best + 1e-9);
    }
    poses_model_fini(&model);
    return err;
}

int poses_find(struct poses_scene *scene, const struct sst_posed_solve_config *cfg)
{
    struct search s = { .scene = scene, .cfg = cfg };
    struct poses_adjust how;
    int err = enough_views(scene);

    if (!err && cfg->refine)
        err = read_priors(&s);
    if (!err)
        err = choose_tracks(&s);
    if (!err) {
        list_attempts(&s);
        err = sst_parallel_for(s.attempts, cfg->threads, attempt, &s);
    }
    if (!err)
        err = choose(&s);
    if (!err) {
        how = adjust_of(&s, scene->line ? START_LINE : START_PLANE);
        how.free_focal = !scene->focal_known || cfg->free_lens;
        how.free_k1 = cfg->free_lens;
        how.threads = cfg->threads;
        err = poses_finish(scene, &how, 8);
    }
    if (!err)
        err = how.free_focal ? find_focal_doubt(scene, &how) : find_free_focal(scene, &how);
    for (int i = 0; i < s.attempts; i++)
        poses_model_fini(&s.attempt[i].model);
    poses_tracks_fini(&s.tracks);
    free(s.prior);
    return err;
}
