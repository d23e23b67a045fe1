/* Registration of views on the ground by the warm places that they show. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/find/sharpen.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/camera/numbers.h"
#include "pipeline/posed/find/sharpen_internal.h"

#define WIDTH_PX    640  /* of the registered pictures, about */
#define WINDOW      20   /* the local mean's reach is the width divided by this */
#define FROM        1.5  /* spreads: lower scores are background */
#define MOST        4.5  /* spreads above that count */
#define LEVELS      8000 /* of a picture of scores, a spread */
#define SQUARES     3000 /* of a picture of their squares */
#define SPARSE      4    /* px between the places at which sharpness is computed */
#define NEAREST     0.7  /* of the extent of the views: the sweep's first plane */
#define FARTHEST    15.0 /* and its last one */
#define RATIO       1.05 /* of the distances of neighbouring planes */
#define ROUNDS      9    /* of registration */
#define DAMPED      0.7  /* share of a step that is made at once: views move together */
#define PRIOR       0.05 /* correlation that a rotation by one sigma must gain, twice */
#define SIGMA_DEG   0.5
#define TILES       8    /* along a side, of which the gain of a view is the mean */
#define SIGNIFICANT 0.5  /* standard errors of a view's gain */
#define GAIN        1.02 /* least ratio of sharpness after and before */
#define ZERO_NEAR   0.1  /* of its distance: how far from the sharpest plane the ground of the source may be ... */
#define ZERO_SHARP  0.4  /* and how sharp at least, in that one's sharpness */

/* --- pictures of scores ------------------------------------------------------------------------------------------- */

static int make_score(void *arg, int k, int worker SST_UNUSED)
{
    struct sharp *s = arg;
    struct sst_deep *score = &s->score[k], *square = &s->square[k];
    const struct sst_deep *from = &s->greys.picture[k];
    int err = find_local_scores(score, from, 1, sst_max_int(from->width / WINDOW, 2));

    err = err ? err : sst_deep_init(square, from->width, from->height, 1, UINT16_MAX);
    for (int y = 0; !err && y < from->height; y++) {
        uint16_t *row = sst_map_u16_row(&score->plane[0], y);

        for (int x = 0; x < from->width; x++) {
            const double v = sst_clamp_double((double)row[x] / SCORE_STEPS - SCORE_LOWEST - FROM, 0, MOST);

            row[x] = (uint16_t)(v * LEVELS);
            sst_map_u16_row(&square->plane[0], y)[x] = (uint16_t)(v * v * SQUARES);
        }
    }
    return err;
}

/* --- sharpness ---------------------------------------------------------------------------------------------------- */

struct sst_surface sharp_plane(const struct sharp *s, const double at[3])
{
    double normal[3], point[3];

    for (int i = 0; i < 3; i++) {
        normal[i] = s->normal[i] + at[1] * s->across[0][i] + at[2] * s->across[1][i];
        point[i] = s->camera.centre_mm[i] + at[0] * s->camera.rotation[6 + i];
    }
    return sst_surface_plane(normal, point);
}

/* Views as they are assumed: given rotations, each turned about the view's own axes, and the lens. */
void sharp_rotate(struct sharp *s)
{
    double own[9];

    for (int k = 0; k < s->n; k++) {
        sst_rotation_from_vector(s->turned[k], own);
        s->greys.camera[k] = s->bare[k];
        sst_camera_adjust(&s->greys.camera[k], s->focal, s->k1);
        sst_numbers_mul3(own, s->given[k], s->greys.camera[k].rotation);
    }
}

static int add_all(struct sst_integral *sum, const struct sharp *s, const struct sst_deep *picture,
                   const struct sst_surface *surface)
{
    const struct sst_calib_camera *camera[WARP_CELL];
    const struct sst_deep *some[WARP_CELL];
    int err = 0;

    sst_integral_restart(sum, surface);
    for (int k = 0; k < s->n && !err; k += WARP_CELL) {
        const int n = sst_min_int(s->n - k, WARP_CELL);

        for (int i = 0; i < n; i++) {
            camera[i] = &s->greys.camera[k + i];
            some[i] = &picture[k + i];
        }
        err = sst_integral_add(sum, camera, some, n);
    }
    return err;
}

static int most_views(const struct sst_map_u16 *count)
{
    int most = 0;

    for (int y = 0; y < count->height; y++) {
        for (int x = 0; x < count->width; x++)
            most = sst_max_int(most, sst_map_u16_row(count, y)[x]);
    }
    return most;
}

/* Mean product of the scores of two views that see a place, over places that a quarter of the most views see */
int sharp_measure(double *out, struct sharp *s, const double at[3])
{
    const struct sst_surface surface = sharp_plane(s, at);
    struct sst_map_f32 mean = { 0 }, square = { 0 };
    struct sst_map_u16 count = { 0 };
    double sum = 0, weight = 0;
    int err, least;

    sharp_rotate(s);
    err = add_all(s->sum, s, s->score, &surface);
    err = err ? err : add_all(s->squares, s, s->square, &surface);
    err = err ? err : sst_integral_means(&mean, s->sum, 0);
    err = err ? err : sst_integral_means(&square, s->squares, 0);
    err = err ? err : sst_integral_views(&count, s->sum);
    least = err ? 0 : sst_max_int(most_views(&count) / 4, 2);
    for (int y = 0; !err && y < mean.height; y++) {
        for (int x = 0; x < mean.width; x++) {
            const double n = sst_map_u16_row(&count, y)[x];

            if (n >= least) {
                const double m = (double)sst_map_f32_row(&mean, y)[x] / LEVELS;

                sum += (n * n * m * m - n * (double)sst_map_f32_row(&square, y)[x] / SQUARES) / (n - 1);
                weight += n;
            }
        }
    }
    *out = weight > 0 ? sum / weight : 0;
    sst_map_f32_fini(&mean);
    sst_map_f32_fini(&square);
    sst_map_u16_fini(&count);
    return err;
}

/* Steps of distance and slopes, smaller in every round. */
static int climb(struct sharp *s, double *best, double scale)
{
    double step[3] = { scale * 0.015 * s->at[0], scale * 0.03, scale * 0.03 };
    int err = 0;

    for (int round = 0; round < 5 && !err; round++) {
        for (int k = 0; k < 6 && !err; k++) {
            double trial[3], value;

            memcpy(trial, s->at, sizeof(trial));
            trial[k / 2] += k % 2 ? step[k / 2] : -step[k / 2];
            err = sharp_measure(&value, s, trial);
            if (!err && value > *best) {
                *best = value;
                memcpy(s->at, trial, sizeof(trial));
            }
        }
        for (int i = 0; i < 3; i++)
            step[i] *= 0.6;
    }
    return err;
}

/* The sharpest of planes from near to far. */
static int sweep(struct sharp *s, double *best, double extent_mm)
{
    int err = 0;

    *best = 0;
    for (double mm = NEAREST * extent_mm; mm < FARTHEST * extent_mm && !err; mm *= RATIO) {
        const double at[3] = { mm, 0, 0 };
        double value;

        err = sharp_measure(&value, s, at);
        if (!err && value > *best) {
            *best = value;
            memcpy(s->at, at, sizeof(at));
        }
    }
    return err;
}

/* --- registration ------------------------------------------------------------------------------------------------- */

/* Scores of all views on the plane, and their sums. */
int sharp_see(struct sharp *s)
{
    const struct sst_surface surface = sharp_plane(s, s->at);
    int err;

    sharp_rotate(s);
    sst_map_f32_fini(&s->total);
    sst_map_u16_fini(&s->count);
    err = sst_map_f32_init(&s->total, s->camera.width, s->camera.height);
    err = err ? err : sst_map_u16_init(&s->count, s->camera.width, s->camera.height);
    for (int k = 0; k < s->n && !err; k++) {
        const struct sst_calib_camera *camera = &s->greys.camera[k];
        const struct sst_deep *score = &s->score[k];

        sst_map_f32_fini(&s->seen[k]);
        sst_integral_restart(s->one, &surface);
        err = sst_integral_add(s->one, &camera, &score, 1);
        err = err ? err : sst_integral_means(&s->seen[k], s->one, 0);
        for (int y = 0; !err && y < s->total.height; y++) {
            float *row = sst_map_f32_row(&s->seen[k], y), *total = sst_map_f32_row(&s->total, y);

            for (int x = 0; x < s->total.width; x++) {
                sst_map_u16_row(&s->count, y)[x] = (uint16_t)(sst_map_u16_row(&s->count, y)[x] + !isnan(row[x]));
                row[x] = isnan(row[x]) ? -1 : row[x] / LEVELS;
                total[x] += row[x] < 0 ? 0 : row[x];
            }
        }
    }
    s->least = err ? 0 : sst_max_int(most_views(&s->count) / 4, 2);
    return err;
}

/* A score where the view looks, else 0: fmaxf() would be a call. */
static inline float shown(float score)
{
    return score > 0 ? score : 0;
}

/* Mean of the other views where it stands out; 0 elsewhere. */
static int template_of(struct sst_map_f32 *out, const struct sharp *s, int k)
{
    double sum = 0, square = 0, n = 0, from;
    const int err = sst_map_f32_init(out, s->total.width, s->total.height);

    for (int y = 0; !err && y < out->height; y++) {
        float *row = sst_map_f32_row(out, y);
        const float *own = sst_map_f32_row(&s->seen[k], y);

        for (int x = 0; x < out->width; x++) {
            const int others = sst_map_u16_row(&s->count, y)[x] - (own[x] >= 0);

            row[x] = others < s->least ? -1 : (sst_map_f32_row(&s->total, y)[x] - shown(own[x])) / (float)others;
            if (row[x] >= 0) {
                sum += (double)row[x];
                square += (double)row[x] * (double)row[x];
                n++;
            }
        }
    }
    from = n > 0 ? sum / n + sqrt(fmax(square / n - sum / n * (sum / n), 0)) : 0;
    for (int y = 0; !err && y < out->height; y++) {
        float *row = sst_map_f32_row(out, y);

        for (int x = 0; x < out->width; x++)
            row[x] = shown(row[x] - (float)from);
    }
    return err;
}

/* Sums of products of the template with the view moved by up to `reach` px, smoothed. @param out  [side][side] */
static void correlate(double *out, const struct sst_map_f32 *with, const struct sst_map_f32 *own, int reach)
{
    const int side = 2 * reach + 1;

    memset(out, 0, (size_t)side * (size_t)side * sizeof(*out));
    for (int y = reach; y < with->height - reach; y++) {
        for (int x = reach; x < with->width - reach; x++) {
            const float t = sst_map_f32_row(with, y)[x];

            for (int dy = -reach; dy <= reach && t > 0; dy++) {
                const float *restrict row = sst_map_f32_row(own, y + dy) + x - reach;
                double *restrict to = out + (size_t)(dy + reach) * (size_t)side;

                for (int i = 0; i < side; i++)
                    to[i] += (double)(t * shown(row[i]));
            }
        }
    }
}

void sharp_smooth_square(double *v, double *work, int side, double sigma)
{
    for (int pass = 0; pass < 2; pass++) {
        const int along = pass ? side : 1;

        memcpy(work, v, (size_t)side * (size_t)side * sizeof(*v));
        for (int i = 0; i < side * side; i++) {
            const int at = pass ? i / side : i % side, reach = (int)ceil(3 * sigma);
            double sum = 0, weights = 0;

            for (int d = -reach; d <= reach; d++) {
                if (at + d >= 0 && at + d < side) {
                    const double w = exp(-0.5 * d * d / (sigma * sigma));

                    sum += w * work[i + d * along];
                    weights += w;
                }
            }
            v[i] = sum / weights;
        }
    }
}

/* Pixel of the virtual picture that the middle of a turned view sees. */
static bool middle_seen(const struct sharp *s, const struct sst_calib_camera *cam, const double turn[2], double xy[2])
{
    const struct sst_surface surface = sharp_plane(s, s->at);
    double own[9], rotation[9], at[3], p[3], t;

    sst_rotation_from_vector((double[]){ turn[0], turn[1], 0 }, own);
    sst_numbers_mul3(own, cam->rotation, rotation);
    t = sst_surface_meet(&surface, cam->position_mm, rotation + 6);
    if (!isfinite(t))
        return false;
    for (int i = 0; i < 3; i++)
        at[i] = cam->position_mm[i] + t * rotation[6 + i] - s->camera.centre_mm[i];
    sst_numbers_apply3(s->camera.rotation, at, p);
    xy[0] = s->camera.fx * p[0] / p[2] + s->camera.cx;
    xy[1] = s->camera.fy * p[1] / p[2] + s->camera.cy;
    return p[2] > 0;
}

/* Turns of a view, in rad, that move its scores by a virtual pixel to the right and down. */
static bool turns_of(const struct sharp *s, int k, double turn[2][2])
{
    const double tiny = 1e-4;
    double p[3][2], j[4], det;

    for (int i = 0; i < 3; i++) {
        if (!middle_seen(s, &s->greys.camera[k], (double[]){ i == 1 ? tiny : 0, i == 2 ? tiny : 0 }, p[i]))
            return false;
    }
    for (int i = 0; i < 4; i++)
        j[i] = (p[1 + i % 2][i / 2] - p[0][i / 2]) / tiny;
    det = j[0] * j[3] - j[1] * j[2];
    turn[0][0] = j[3] / det;
    turn[0][1] = -j[2] / det;
    turn[1][0] = -j[1] / det;
    turn[1][1] = j[0] / det;
    return fabs(det) > 1e-12;
}

/* Place of a parabola's top through three values, from the middle one. */
double sharp_top(double l, double c, double r)
{
    const double bend = l - 2 * c + r;

    return bend < 0 ? sst_clamp_double(0.5 * (l - r) / bend, -0.5, 0.5) : 0;
}

/* Turn a view by most of the way to the largest of the values, which is between pixels. */
static void step_to(struct sharp *s, int k, const double *value, int best, double turn[2][2])
{
    const int side = 2 * s->reach + 1, x = best % side, y = best / side;
    const double fx = x > 0 && x < side - 1 ? sharp_top(value[best - 1], value[best], value[best + 1]) : 0;
    const double fy = y > 0 && y < side - 1 ? sharp_top(value[best - side], value[best], value[best + side]) : 0;

    for (int i = 0; i < 2; i++)
        s->turned[k][i] += DAMPED * ((s->reach - x - fx) * turn[0][i] + (s->reach - y - fy) * turn[1][i]);
}

/* Where a view agrees best with the others, not far from its given rotation. */
static int register_view(void *arg, int k, int worker SST_UNUSED)
{
    struct sharp *s = arg;
    const int side = 2 * s->reach + 1;
    const double sigma = s->turn_sigma;
    double *value = malloc(2 * (size_t)side * (size_t)side * sizeof(*value)), turn[2][2], norm = 0, own = 0;
    struct sst_map_f32 with = { 0 };
    int best = s->reach * side + s->reach, err = value ? template_of(&with, s, k) : -ENOMEM;

    if (err || !turns_of(s, k, turn))
        goto done;
    for (int y = 0; y < with.height; y++) {
        for (int x = 0; x < with.width; x++) {
            const double t = (double)sst_map_f32_row(&with, y)[x],
                         v = (double)shown(sst_map_f32_row(&s->seen[k], y)[x]);

            norm += t * t;
            own += v * v;
        }
    }
    if (!(norm > 0 && own > 0))
        goto done;
    correlate(value, &with, &s->seen[k], s->reach);
    sharp_smooth_square(value, value + side * side, side, s->sigma_px);
    for (int i = 0; i < side * side; i++) {
        const double dx = s->reach - i % side, dy = s->reach - i / side; /* that it is to be moved by */
        const double a = s->turned[k][0] + dx * turn[0][0] + dy * turn[1][0];
        const double b = s->turned[k][1] + dx * turn[0][1] + dy * turn[1][1];

        value[i] = value[i] / sqrt(norm * own) - PRIOR * (a * a + b * b) / (2 * sigma * sigma);
        best = value[i] > value[best] ? i : best;
    }
    step_to(s, k, value, best, turn);
done:
    sst_map_f32_fini(&with);
    free(value);
    return err;
}

/* All views turned alike move the picture and sharpen nothing. */
static void keep_mean(struct sharp *s)
{
    double mean[3] = { 0 };

    for (int k = 0; k < s->n; k++) {
        for (int i = 0; i < 3; i++)
            mean[i] += (s->turned[k][0] * s->given[k][i] + s->turned[k][1] * s->given[k][3 + i]) / s->n;
    }
    for (int k = 0; k < s->n; k++) {
        for (int i = 0; i < 2; i++)
            s->turned[k][i] -= vector_dot(mean, s->given[k] + 3 * i);
    }
}

/* From far to near. @param first  round: later ones reach less far */
int sharp_register(struct sharp *s, int first)
{
    static const double sigma_px[ROUNDS] = { 3, 2, 1.5, 1, 1, 1, 1, 0.7, 0.7 };
    static const double reach_deg[ROUNDS] = { 1.2, 1.2, 0.8, 0.6, 0.4, 0.4, 0.2, 0.2, 0.2 };
    int err = 0;

    for (int round = first; round < ROUNDS && !err; round++) {
        s->reach = (int)(tan(reach_deg[round] * SHARP_RAD) * s->camera.fx + 0.5) + 1;
        s->sigma_px = sigma_px[round];
        err = sharp_see(s);
        err = err ? err : sst_parallel_for(s->n, s->threads, register_view, s);
        keep_mean(s);
    }
    return err;
}

/* --- views that have not gained ----------------------------------------------------------------------------------- */

/* Products of view and template, by tiles. */
static void products(double sum[TILES * TILES], const struct sst_map_f32 *with, const struct sst_map_f32 *own)
{
    memset(sum, 0, TILES * TILES * sizeof(*sum));
    for (int y = 0; y < with->height; y++) {
        for (int x = 0; x < with->width; x++)
            sum[y * TILES / with->height * TILES + x * TILES / with->width] +=
                (double)(sst_map_f32_row(with, y)[x] * shown(sst_map_f32_row(own, y)[x]));
    }
}

/* Views without a significant gain return to their given rotation. */
static int keep_gains(struct sharp *s, int *moved)
{
    const struct sst_surface surface = sharp_plane(s, s->at);
    int err = sharp_see(s);

    *moved = 0;
    for (int k = 0; k < s->n && !err; k++) {
        struct sst_calib_camera was = s->greys.camera[k];
        const struct sst_calib_camera *camera = &was;
        const struct sst_deep *score = &s->score[k];
        const double turned[3] = { s->turned[k][0], s->turned[k][1], s->turned[k][2] };
        struct sst_map_f32 with = { 0 }, old = { 0 };
        double now[TILES * TILES], before[TILES * TILES], sum = 0, square = 0;
        double back[9];

        sst_rotation_from_vector((double[]){ -turned[0], -turned[1], -turned[2] }, back);
        sst_numbers_mul3(back, s->greys.camera[k].rotation, was.rotation);
        err = template_of(&with, s, k);
        sst_integral_restart(s->one, &surface);
        err = err ? err : sst_integral_add(s->one, &camera, &score, 1);
        err = err ? err : sst_integral_means(&old, s->one, 0);
        if (!err) {
            products(now, &with, &s->seen[k]);
            for (int i = 0; i < old.width * old.height; i++) {
                float *v = &sst_map_f32_row(&old, i / old.width)[i % old.width];

                *v = isnan(*v) ? -1 : *v / LEVELS;
            }
            products(before, &with, &old);
        }
        for (int i = 0; i < TILES * TILES && !err; i++) {
            sum += now[i] - before[i];
            square += (now[i] - before[i]) * (now[i] - before[i]);
        }
        if (!(sum > SIGNIFICANT * sqrt(square)))
            memset(s->turned[k], 0, sizeof(s->turned[k]));
        else
            ++*moved;
        sst_map_f32_fini(&with);
        sst_map_f32_fini(&old);
    }
    return err;
}

/* --- light fields ------------------------------------------------------------------------------------------------- */

static double extent_of(const struct sharp *s)
{
    double most = 0;

    for (int k = 0; k < s->n; k++) {
        const double *a = s->greys.camera[k].position_mm, *b = s->greys.camera[0].position_mm;

        most = fmax(
            most, sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2])));
    }
    return most;
}

static int sharp_init(struct sharp *s, const struct sst_posed *posed, const char *dir)
{
    const size_t n = (size_t)posed->count;
    int err;

    s->view = calloc(n, sizeof(*s->view));
    s->score = calloc(n, sizeof(*s->score));
    s->square = calloc(n, sizeof(*s->square));
    s->given = calloc(n, sizeof(*s->given));
    s->turned = calloc(n, sizeof(*s->turned));
    s->seen = calloc(n, sizeof(*s->seen));
    s->bare = calloc(n, sizeof(*s->bare));
    if (!s->view || !s->score || !s->square || !s->given || !s->turned || !s->seen || !s->bare)
        return -ENOMEM;
    for (int k = 0; k < posed->count; k++) {
        if (posed->view[k].camera.known)
            s->view[s->n++] = k;
    }
    if (s->n < 3)
        return -ENODATA;
    s->greys.count = s->n;
    s->greys.step = greys_step(posed, (int)lround((double)posed->width / WIDTH_PX));
    err = greys_read(&s->greys, posed, dir, s->view, s->threads);
    err = err ? err : sst_parallel_for(s->n, s->threads, make_score, s);
    for (int k = 0; k < s->n && !err; k++) {
        s->bare[k] = s->greys.camera[k];
        memcpy(s->given[k], s->bare[k].rotation, sizeof(*s->given));
    }
    s->focal = 1;
    s->turn_sigma = (s->cfg->sigma_angle_deg > 0 ? s->cfg->sigma_angle_deg : SIGMA_DEG) * SHARP_RAD;
    return err;
}

static int planes_init(struct sharp *s, const struct sst_posed *posed)
{
    const struct sst_virtual middle = sst_virtual_of_view(posed, sst_posed_middle(posed));
    const double against = vector_dot(posed->up, middle.rotation + 6);
    const struct sst_surface none = { .normal = { 0, 0, 1 } };
    struct sst_virtual sparse;
    bool level;
    int err;

    s->camera = sst_virtual_scaled(&middle, s->greys.step);
    sparse = sst_virtual_scaled(&s->camera, SPARSE);
    level = vector_length(posed->up) > 0.5 && against < -0.5;
    for (int i = 0; i < 3; i++)
        s->normal[i] = level ? posed->up[i] : -middle.rotation[6 + i];
    if (level && !strncmp(posed->source, "AOS", 3)) /* its heights are above the ground */
        s->zero_mm = -vector_dot(posed->up, middle.centre_mm) / against;
    vector_cross(s->across[0], s->normal, middle.rotation + 3);
    vector_unit(s->across[0]);
    vector_cross(s->across[1], s->normal, s->across[0]);
    err = sst_integral_create(&s->sum, &sparse, &none, 1, s->threads);
    err = err ? err : sst_integral_create(&s->squares, &sparse, &none, 1, s->threads);
    return err ? err : sst_integral_create(&s->one, &s->camera, &none, 1, s->threads);
}

static void sharp_fini(struct sharp *s)
{
    for (int k = 0; k < s->n; k++) {
        sst_deep_fini(&s->score[k]);
        sst_deep_fini(&s->square[k]);
        sst_map_f32_fini(&s->seen[k]);
    }
    sst_map_f32_fini(&s->total);
    sst_map_u16_fini(&s->count);
    greys_fini(&s->greys);
    sst_integral_destroy(s->sum);
    sst_integral_destroy(s->squares);
    sst_integral_destroy(s->one);
    free(s->view);
    free(s->score);
    free(s->square);
    free(s->given);
    free(s->turned);
    free(s->seen);
    free(s->bare);
}

/* Turns that grow along a line of views move its sharpest plane: a plane that the source knows decides between them.
 * @param known  out */
static int take_known(bool *known, struct sharp *s, double best)
{
    const double at[3] = { s->zero_mm, 0, 0 };
    double value;
    int err;

    *known = false;
    if (!(fabs(s->zero_mm / s->at[0] - 1) < ZERO_NEAR))
        return 0;
    err = sharp_measure(&value, s, at);
    *known = !err && value > ZERO_SHARP * best;
    if (*known)
        memcpy(s->at, at, sizeof(at));
    return err;
}

static int refine(struct sharp *s, struct sst_posed *posed, struct sst_sharpened *out)
{
    double after = out->before;
    bool known = false;
    int err = climb(s, &after, 1);

    out->before = after;
    err = err ? err : take_known(&known, s, after);
    err = err ? err : sharp_register(s, 0);
    err = err ? err : sharp_measure(&after, s, s->at);
    err = err || known ? err : climb(s, &after, 0.5);
    err = err ? err : sharp_register(s, 3);
    err = err ? err : sharp_refine_lens(s, known, &after, out);
    err = err || known || !out->lens_gain ? err : climb(s, &after, 0.5);
    err = err ? err : keep_gains(s, &out->moved);
    err = err ? err : sharp_measure(&after, s, s->at); /* with the views' rotations */
    if (err || after < GAIN * out->before) {
        out->moved = 0;
        out->focal = 1;
        out->k1 = out->lens_gain = 0;
        return err;
    }
    out->after = after;
    for (int k = 0; k < s->n; k++)
        memcpy(posed->view[s->view[k]].camera.rotation, s->greys.camera[k].rotation, sizeof(*s->given));
    for (int k = 0; k < posed->count && out->lens_gain > 0; k++) {
        if (posed->view[k].camera.fx > 0)
            sst_camera_adjust(&posed->view[k].camera, s->focal, s->k1);
    }
    return 0;
}

int sst_posed_sharpen(struct sst_posed *posed, const char *dir, const struct sst_sharpen_config *cfg,
                      struct sst_sharpened *out)
{
    struct sharp s = { .cfg = cfg, .threads = sst_thread_count(cfg->threads) };
    double extent;
    int err = sharp_init(&s, posed, dir);

    *out = (struct sst_sharpened){ .focal = 1 };
    err = err ? err : planes_init(&s, posed);
    extent = err ? 0 : extent_of(&s);
    if (!err && !(extent > 0))
        err = -ENODATA;
    err = err ? err : sweep(&s, &out->before, extent);
    if (!err && !(out->before > 0))
        err = -ENODATA;
    if (!err && cfg->look)
        err = climb(&s, &out->before, 1);
    out->after = out->before;
    if (!err && !cfg->look)
        err = refine(&s, posed, out);
    out->plane = sharp_plane(&s, s.at);
    out->distance_mm = s.at[0];
    out->tilt_deg = atan(hypot(s.at[1], s.at[2])) / SHARP_RAD;
    sharp_fini(&s);
    if (err == -ENOMEM)
        sst_log_error("%s: no memory to register %d views", dir, posed->count);
    return err;
}
