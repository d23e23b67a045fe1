/* Features of pictures, pairs of pictures that match, and the group that they link. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/posed/picture.h"
#include "pipeline/posed/solve/solve_internal.h"

#define FEW_FEATURES 250 /* of a picture, the strongest, to find its neighbours */
#define NEIGHBOURS   6   /* nearest views of each that are matched besides the next two in order */
#define SOME_FEATURES 1000 /* to find the order of few pictures */
#define MIN_RAW      20  /* matches before the epipolar geometry */
#define MIN_COARSE   14  /* matches of few features; pictures of other things have up to 11 */
#define SIMILAR_PX   12  /* of a similarity, of pictures that are 1024 px wide */

int poses_levels(void *arg, int view, float **level)
{
    const struct poses_scene *scene = arg;
    struct sst_samples stretch = { 0, 255 };
    struct sst_deep deep = { 0 };
    float *out = NULL;
    int err = sst_posed_picture(&deep, scene->posed, scene->dir, view);

    if (err)
        return err;
    if (deep.white > 255) /* each picture's own: spreads are local anyway */
        stretch = sst_deep_stretch(&deep);
    out = malloc((size_t)deep.width * (size_t)deep.height * sizeof(*out));
    for (int y = 0; out && y < deep.height; y++) {
        static const float part[3] = { 0.299f, 0.587f, 0.114f };
        const float unit = 255.0f / (float)(stretch.white - stretch.black);
        float *row = out + (size_t)y * (size_t)deep.width;

        for (int x = 0; x < deep.width; x++) {
            float sum = 0;

            for (int c = 0; c < deep.channels; c++)
                sum += (deep.channels == 1 ? 1 : part[c]) * (float)sst_map_u16_row(&deep.plane[c], y)[x];
            row[x] = (sum - (float)stretch.black) * unit;
        }
    }
    sst_deep_fini(&deep);
    if (!out)
        return -ENOMEM;
    *level = out;
    return 0;
}

struct finding {
    struct poses_scene *scene;
    poses_levels_fn *levels;
    void *arg;
};

/* Positions in pictures to ideal px. */
static void idealise(struct poses_scene *scene, int view)
{
    const struct sst_calib_camera *cam = &scene->posed->view[view].camera;
    struct cv_features *f = scene->feature + view;
    int kept = 0;

    for (int i = 0; i < f->count; i++) {
        double a = f->at[i][0] - scene->middle[view][0], b = f->at[i][1] - scene->middle[view][1];

        if (scene->lenses) {
            if (!sst_camera_undistort(cam, f->at[i][0], f->at[i][1], &a, &b))
                continue;
            a *= scene->focal;
            b *= scene->focal;
        }
        f->at[kept][0] = (float)a;
        f->at[kept][1] = (float)b;
        memmove(f->descriptor + (size_t)kept * CV_DESCRIPTOR, f->descriptor + (size_t)i * CV_DESCRIPTOR,
                CV_DESCRIPTOR * sizeof(*f->descriptor));
        kept++;
    }
    f->count = kept;
}

static int cv_error(int err, const char *why)
{
    if (err == -ENOTSUP)
        sst_log_error("features of pictures need OpenCV: %s", why);
    else if (err == -EINVAL)
        sst_log_error("OpenCV: %s", why);
    return err;
}

static int find_view(void *arg, int view, int worker)
{
    const struct finding *f = arg;
    struct poses_scene *scene = f->scene;
    float *level = NULL;
    char why[256] = "";
    int err = f->levels(f->arg, view, &level);

    (void)worker;
    if (err)
        return err;
    err = cv_error(cv_features_find(&scene->feature[view],
                                    &(struct cv_grey){
                                        .level = level, .width = scene->posed->width, .height = scene->posed->height },
                                    POSES_FEATURES, why),
                   why);
    free(level);
    if (!err)
        idealise(scene, view);
    return err;
}

/* --- pairs -------------------------------------------------------------------------------------------------------- */

/* Points of the matches, as OpenCV takes them. */
static int points_of(struct cv_points *out, float (**room)[2], const struct poses_scene *scene,
                     const struct poses_pair *pair)
{
    float(*at)[2] = malloc((size_t)pair->count * 2 * sizeof(*at) + 1);

    if (!at)
        return -ENOMEM;
    for (int i = 0; i < pair->count; i++) {
        memcpy(at[i], scene->feature[pair->a].at[pair->match[i][0]], sizeof(*at));
        memcpy(at[pair->count + i], scene->feature[pair->b].at[pair->match[i][1]], sizeof(*at));
    }
    *out = (struct cv_points){ .count = pair->count,
                               .a = (const float(*)[2])at,
                               .b = (const float(*)[2])(at + pair->count) };
    *room = at;
    return 0;
}

/* Drop matches that the epipolar geometry does not explain. */
static int verify(struct poses_pair *pair, const struct poses_scene *scene, char why[256])
{
    uint8_t *inlier = malloc((size_t)pair->count + 1);
    float(*room)[2] = NULL;
    struct cv_points points;
    int err = inlier ? points_of(&points, &room, scene, pair) : -ENOMEM, kept = 0;

    if (!err)
        err = cv_points_epipolar(&points, inlier, why);
    for (int i = 0; !err && i < pair->count; i++) {
        if (inlier[i])
            memmove(pair->match[kept++], pair->match[i], sizeof(*pair->match));
    }
    if (!err)
        pair->count = kept;
    free(room);
    free(inlier);
    return err;
}

static int fit_similarity(struct poses_pair *pair, const struct poses_scene *scene, char why[256])
{
    const double within = SIMILAR_PX * fmax(scene->posed->width, scene->posed->height) / 1024;
    float(*room)[2] = NULL;
    struct cv_points points;
    int err = points_of(&points, &room, scene, pair);

    if (!err)
        err = cv_points_similarity(&points, within, pair->similarity, &pair->share, why);
    free(room);
    return err;
}

/* Matches of a pair; none are left of pictures that do not match. */
static int match_pair(void *arg, int index, int worker)
{
    struct poses_scene *scene = arg;
    struct poses_pair *pair = scene->pair + index;
    const struct cv_features *a = scene->feature + pair->a, *b = scene->feature + pair->b;
    char why[256] = "";
    int err;

    (void)worker;
    pair->match = malloc((size_t)a->count * sizeof(*pair->match) + 1);
    if (!pair->match)
        return -ENOMEM;
    err = poses_descriptors_match(a, b, pair->match, &pair->count);
    if (!err && pair->count < MIN_RAW)
        pair->count = 0;
    if (!err && pair->count)
        err = verify(pair, scene, why);
    if (!err && pair->count < POSES_MIN_PAIR)
        pair->count = 0;
    if (!err && pair->count)
        err = fit_similarity(pair, scene, why);
    return cv_error(err, why);
}

/* Match pairs and append them to the scene's; pairs without matches are dropped. */
static int match_pairs(struct poses_scene *scene, struct poses_pair *more, int count, int threads)
{
    struct poses_scene part = *scene;
    int err;

    part.pair = more;
    err = sst_parallel_for(count, threads, match_pair, &part);
    for (int i = 0; i < count; i++) {
        if (!err && more[i].count)
            scene->pair[scene->pairs++] = more[i];
        else
            free(more[i].match);
    }
    return err;
}

/* --- neighbours --------------------------------------------------------------------------------------------------- */

struct nearness {
    const struct poses_scene *scene;
    bool places; /* pairs of two placed views are compared by their positions */
    int features;
    uint16_t *alike; /* [views][views] matches of so many features, or nearness of given positions */
};

static bool by_places(const struct nearness *near, int a, int b)
{
    const struct sst_posed_view *view = near->scene->posed->view;

    return near->places && view[a].camera.known && view[b].camera.known;
}

static int compare_view(void *arg, int view, int worker)
{
    const struct nearness *near = arg;
    const struct poses_scene *scene = near->scene;
    struct cv_features a = scene->feature[view];
    int(*match)[2] = malloc((size_t)near->features * sizeof(*match)), count, err = match ? 0 : -ENOMEM;

    (void)worker;
    a.count = sst_min_int(a.count, near->features);
    for (int v = view + 1; !err && v < scene->views; v++) {
        struct cv_features b = scene->feature[v];

        if (by_places(near, view, v))
            continue;
        b.count = sst_min_int(b.count, near->features);
        err = poses_descriptors_match(&a, &b, match, &count);
        near->alike[(size_t)view * scene->views + v] = (uint16_t)count;
    }
    free(match);
    return err;
}

static int alike(const struct nearness *near, int a, int b)
{
    return near->alike[(size_t)sst_min_int(a, b) * near->scene->views + sst_max_int(a, b)];
}

/* Whether b is among a's nearest: fewer than NEIGHBOURS are more alike. */
static bool is_near(const struct nearness *near, int a, int b)
{
    const int own = alike(near, a, b);
    int before = 0;

    for (int v = 0; v < near->scene->views; v++) {
        if (v != a && v != b && (alike(near, a, v) > own || (alike(near, a, v) == own && v < b)))
            before++;
    }
    return own >= MIN_COARSE && before < NEIGHBOURS;
}

/* Given positions in place of matches: the nearest are most alike. A view that is not placed has matches alone. */
static void compare_places(struct nearness *near)
{
    const struct poses_scene *scene = near->scene;
    const double unit = sst_posed_spacing(scene->posed);

    for (int a = 0; a < scene->views; a++) {
        const struct sst_calib_camera *own = &scene->posed->view[a].camera;

        for (int b = a + 1; b < scene->views; b++) {
            const struct sst_calib_camera *other = &scene->posed->view[b].camera;
            double d2 = 0;

            for (int i = 0; i < 3; i++)
                d2 += (own->position_mm[i] - other->position_mm[i]) * (own->position_mm[i] - other->position_mm[i]);
            if (by_places(near, a, b))
                near->alike[(size_t)a * scene->views + b] = (uint16_t)(UINT16_MAX / (1 + sqrt(d2) / unit));
        }
    }
}

static int compare_views(struct nearness *near, int threads)
{
    const struct poses_scene *scene = near->scene;

    near->alike = calloc((size_t)scene->views * scene->views, sizeof(*near->alike));
    if (!near->alike)
        return -ENOMEM;
    if (near->places)
        compare_places(near);
    return sst_parallel_for(scene->views, threads, compare_view, near);
}

/* Match each view with its nearest, besides the next two. */
static int match_near(struct poses_scene *scene, int threads)
{
    struct nearness near = { .scene = scene,
                             .places = sst_posed_placed(scene->posed) > 1 && sst_posed_spacing(scene->posed) > 0,
                             .features = FEW_FEATURES };
    struct poses_pair *more = calloc((size_t)scene->views * NEIGHBOURS * 2, sizeof(*more));
    int err = more ? compare_views(&near, threads) : -ENOMEM, count = 0;

    for (int a = 0; !err && a < scene->views; a++) {
        for (int b = a + 3; b < scene->views; b++) {
            if (is_near(&near, a, b) || is_near(&near, b, a))
                more[count++] = (struct poses_pair){ .a = a, .b = b };
        }
    }
    if (!err)
        err = match_pairs(scene, more, count, threads);
    free(near.alike);
    free(more);
    return err;
}

static int match_next(struct poses_scene *scene, int threads)
{
    struct poses_pair *more = calloc((size_t)scene->views * 2, sizeof(*more));
    int count = 0, err;

    if (!more)
        return -ENOMEM;
    for (int a = 0; a < scene->views; a++) {
        for (int b = a + 1; b < scene->views && b <= a + 2; b++)
            more[count++] = (struct poses_pair){ .a = a, .b = b };
    }
    err = match_pairs(scene, more, count, threads);
    free(more);
    return err;
}

/* The largest group of views that pairs link, the first of equal ones. */
static int link_views(struct poses_scene *scene)
{
    int *group = malloc((size_t)scene->views * sizeof(*group)), *size = calloc((size_t)scene->views, sizeof(*size));
    int best = 0;

    for (int v = 0; group && v < scene->views; v++)
        group[v] = v;
    for (bool changed = group != NULL; changed;) {
        changed = false;
        for (int p = 0; p < scene->pairs; p++) {
            int *a = group + scene->pair[p].a, *b = group + scene->pair[p].b;

            if (*a != *b) {
                *a = *b = sst_min_int(*a, *b);
                changed = true;
            }
        }
    }
    for (int v = 0; group && size && v < scene->views; v++)
        size[group[v]]++;
    for (int v = 0; size && v < scene->views; v++)
        best = size[v] > size[best] ? v : best;
    for (int v = 0; group && size && v < scene->views; v++)
        scene->linked[v] = group[v] == best;
    scene->used = size ? size[best] : 0;
    free(group);
    free(size);
    return scene->used ? 0 : -ENOMEM;
}

int poses_scene_detect(struct poses_scene *scene, poses_levels_fn *levels, void *arg, int threads)
{
    struct finding finding = { .scene = scene, .levels = levels, .arg = arg };
    const size_t n = (size_t)scene->views;

    scene->feature = calloc(n, sizeof(*scene->feature));
    scene->linked = calloc(n, sizeof(*scene->linked));
    scene->placed = calloc(n, sizeof(*scene->placed));
    scene->pair = calloc(n * (2 + 2 * NEIGHBOURS), sizeof(*scene->pair));
    if (!scene->feature || !scene->linked || !scene->placed || !scene->pair)
        return -ENOMEM;
    return sst_parallel_for(scene->views, threads, find_view, &finding);
}

int poses_scene_compare(const struct poses_scene *scene, int *alike, int threads)
{
    struct nearness near = { .scene = scene, .features = SOME_FEATURES };
    const size_t n = (size_t)scene->views;
    const int err = compare_views(&near, threads);

    for (size_t i = 0; !err && i < n * n; i++)
        alike[i] += near.alike[i / n < i % n ? i : i % n * n + i / n];
    free(near.alike);
    return err;
}

int poses_scene_match(struct poses_scene *scene, int threads)
{
    int err = match_next(scene, threads);

    if (!err)
        err = link_views(scene);
    if (!err && scene->views > 3 && (scene->views > POSES_MANY_VIEWS || scene->used < scene->views)) {
        err = match_near(scene, threads);
        if (!err)
            err = link_views(scene);
    }
    return err;
}

void poses_scene_unmatch(struct poses_scene *scene)
{
    for (int p = 0; p < scene->pairs; p++)
        free(scene->pair[p].match);
    for (int v = 0; v < scene->views && scene->placed; v++)
        scene->placed[v] = false;
    scene->pairs = scene->used = 0;
    poses_tracks_fini(&scene->few);
    poses_model_fini(&scene->model);
}

void poses_scene_fini(struct poses_scene *scene)
{
    for (int v = 0; scene->feature && v < scene->views; v++) {
        free(scene->feature[v].at);
        free(scene->feature[v].descriptor);
    }
    free(scene->feature);
    free(scene->middle);
    poses_scene_unmatch(scene);
    free(scene->pair);
    free(scene->linked);
    free(scene->placed);
    *scene = (struct poses_scene){ 0 };
}
