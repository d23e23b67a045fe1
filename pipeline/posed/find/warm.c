/* Warm bodies that many views of a flight see, and the one lens that they show. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread.h"
#include "pipeline/camera/numbers.h"
#include "pipeline/posed/find/sharpen_internal.h"

#define PLACE       50   /* the reach of a warm place's window is the width divided by this */
#define ALIKE       0.35 /* least correlation of a view with the others at a place */
#define STANDS_OUT  2    /* standard deviations of the smoothed mean by which places do */
#define FEW_SIGHTS  3    /* of a place */
#define FEW_PLACES  6    /* on which a lens is fitted */
#define LENS_ROUNDS 4    /* of sights and fits */
#define LAST_ROUNDS 5    /* of registration that follow */
#define LENS_CHI2   100  /* least worth of a lens, in squares of standard errors, ... */
#define LENS_GAIN   1.03 /* and ratio of sharpness with and without it */

/* Places of warm bodies on the plane, and the sights of the views. */
struct warm {
    struct sharp *s;
    int places, reach; /* px of a window */
    int (*px)[2];      /* [places] in the virtual picture */
    double (*at_mm)[3];
    struct lens_sight *sight; /* [views][places]; weight 0: none */
    double from;              /* lower scores of a mean are background */
};

static void warm_fini(struct warm *w)
{
    free(w->px);
    free(w->at_mm);
    free(w->sight);
}

/* The mean of all views, smoothed; 0 where few look. */
static int smooth_mean(struct sst_map_f32 *out, const struct sharp *s)
{
    static const double weight[5] = { 1 / 16.0, 4 / 16.0, 6 / 16.0, 4 / 16.0, 1 / 16.0 };
    struct sst_map_f32 work = { 0 };
    int err = sst_map_f32_init(out, s->total.width, s->total.height);

    err = err ? err : sst_map_f32_init(&work, out->width, out->height);
    for (int i = 0; !err && i < out->width * out->height; i++) {
        const int x = i % out->width, y = i / out->width, n = sst_map_u16_row(&s->count, y)[x];

        sst_map_f32_row(out, y)[x] = n < s->least ? 0 : sst_map_f32_row(&s->total, y)[x] / (float)n;
    }
    for (int pass = 0; !err && pass < 8; pass++) { /* along rows and columns, four times: a Gaussian of 2 px */
        struct sst_map_f32 swap = work;

        for (int i = 0; i < out->width * out->height; i++) {
            const int x = i % out->width, y = i / out->width;
            double sum = 0;

            for (int d = -2; d <= 2; d++)
                sum += weight[d + 2] * (double)sst_map_f32_row(
                                           out, pass % 2 ? sst_clamp_int(y + d, 0, out->height - 1)
                                                         : y)[pass % 2 ? x : sst_clamp_int(x + d, 0, out->width - 1)];
            sst_map_f32_row(&work, y)[x] = (float)sum;
        }
        work = *out;
        *out = swap;
    }
    sst_map_f32_fini(&work);
    return err;
}

/* Is a pixel the first of the highest around? */
static bool is_peak(const struct sst_map_f32 *map, int x, int y, int reach)
{
    const float v = sst_map_f32_row(map, y)[x];

    for (int j = y - reach; j <= y + reach; j++) {
        for (int i = x - reach; i <= x + reach; i++) {
            const float o = sst_map_f32_row(map, j)[i];

            if (o > v || (o == v && (j < y || (j == y && i < x))))
                return false;
        }
    }
    return true;
}

/* Where the mean of all views has a peak that stands out, away from the border. */
static int find_places(struct warm *w)
{
    const struct sharp *s = w->s;
    const struct sst_surface surface = sharp_plane(s, s->at);
    const int border = w->reach + s->reach, most = (s->camera.width / w->reach + 1) * (s->camera.height / w->reach + 1);
    double sum = 0, square = 0, n = (double)s->camera.width * s->camera.height, least;
    struct sst_map_f32 mean = { 0 };
    int err;

    w->px = malloc((size_t)most * sizeof(*w->px));
    w->at_mm = malloc((size_t)most * sizeof(*w->at_mm));
    err = w->px && w->at_mm ? smooth_mean(&mean, s) : -ENOMEM;
    for (int y = 0; !err && y < mean.height; y++) {
        for (int x = 0; x < mean.width; x++) {
            const double v = (double)sst_map_f32_row(&mean, y)[x];

            sum += v;
            square += v * v;
        }
    }
    w->from = sum / n + sqrt(fmax(square / n - sum / n * (sum / n), 0));
    least = sum / n + STANDS_OUT * (w->from - sum / n);
    for (int y = border; !err && y < mean.height - border; y++) {
        for (int x = border; x < mean.width - border; x++) {
            if ((double)sst_map_f32_row(&mean, y)[x] > least && is_peak(&mean, x, y, w->reach) && w->places < most &&
                find_place(&s->camera, &surface, x, y, w->at_mm[w->places])) {
                w->px[w->places][0] = x;
                w->px[w->places++][1] = y;
            }
        }
    }
    sst_map_f32_fini(&mean);
    return err;
}

/* Mean of the other views in the window of a place, less the background. @return its sum of squares; 0: the view does
 * not see all around the window, or too few others do */
static double window_of(float *out, const struct warm *w, int k, int place)
{
    const struct sharp *s = w->s;
    const int x0 = w->px[place][0], y0 = w->px[place][1], reach = w->reach + s->reach;
    double squares = 0;

    for (int y = y0 - reach; y <= y0 + reach; y++) {
        const float *own = sst_map_f32_row(&s->seen[k], y);

        for (int x = x0 - reach; x <= x0 + reach; x++) {
            const int others = sst_map_u16_row(&s->count, y)[x] - 1;
            double v;

            if (own[x] < 0 || others < 1)
                return 0;
            if (abs(x - x0) > w->reach || abs(y - y0) > w->reach)
                continue;
            v = fmax((double)(sst_map_f32_row(&s->total, y)[x] - own[x]) / others - w->from, 0);
            *out++ = (float)v;
            squares += v * v;
        }
    }
    return squares;
}

/* Correlations of a window with a view's scores around. @param value  out [side][side]. @return the largest's index */
static int match_window(double *value, const struct warm *w, const float *with, int k, int place)
{
    const struct sharp *s = w->s;
    const int side = 2 * s->reach + 1, wide = 2 * w->reach + 1;
    int best = 0;

    for (int i = 0; i < side * side; i++) {
        double sum = 0;

        for (int y = 0; y < wide; y++) {
            const float *own = sst_map_f32_row(&s->seen[k], w->px[place][1] - w->reach - s->reach + i / side + y) +
                               w->px[place][0] - w->reach - s->reach + i % side;

            for (int x = 0; x < wide; x++)
                sum += (double)(with[y * wide + x] * own[x]);
        }
        value[i] = sum;
    }
    sharp_smooth_square(value, value + side * side, side, s->sigma_px);
    for (int i = 0; i < side * side; i++)
        best = value[i] > value[best] ? i : best;
    return best;
}

static double squares_of(const struct warm *w, int k, int place, int dx, int dy)
{
    double sum = 0;

    for (int y = -w->reach; y <= w->reach; y++) {
        const float *own = sst_map_f32_row(&w->s->seen[k], w->px[place][1] + dy + y) + w->px[place][0] + dx;

        for (int x = -w->reach; x <= w->reach; x++)
            sum += (double)(own[x] * own[x]);
    }
    return sum;
}

/* Pixel of a view that shows a place of the virtual picture. */
static bool view_pixel(const struct sharp *s, int k, double x, double y, struct lens_sight *out)
{
    const struct sst_surface surface = sharp_plane(s, s->at);
    const struct sst_calib_camera *cam = &s->greys.camera[k];
    double at[3], p[3];

    if (!find_place(&s->camera, &surface, x, y, at))
        return false;
    for (int i = 0; i < 3; i++)
        at[i] -= cam->position_mm[i];
    sst_numbers_apply3(cam->rotation, at, p);
    sst_camera_distort(cam, p[0] / p[2], p[1] / p[2], &out->x, &out->y);
    return p[2] > 0 && isfinite(out->x) && isfinite(out->y);
}

/* Sights of one view: where its scores match the mean of the others best. */
static int see_places(void *arg, int k, int worker SST_UNUSED)
{
    struct warm *w = arg;
    const struct sharp *s = w->s;
    const int side = 2 * s->reach + 1, wide = 2 * w->reach + 1;
    double *value = malloc(2 * (size_t)(side * side) * sizeof(*value));
    float *with = malloc((size_t)(wide * wide) * sizeof(*with));

    for (int p = 0; value && with && p < w->places; p++) {
        struct lens_sight *sight = &w->sight[k * w->places + p];
        const double norm = window_of(with, w, k, p);
        double x, y, alike;
        int best;

        *sight = (struct lens_sight){ k, p, 0, 0, 0 };
        if (!(norm > 0))
            continue;
        best = match_window(value, w, with, k, p);
        x = best % side - s->reach;
        y = best / side - s->reach;
        if (fabs(x) > s->reach - 1 || fabs(y) > s->reach - 1)
            continue;
        alike = value[best] / sqrt(norm * squares_of(w, k, p, (int)x, (int)y) + 1e-12);
        x += sharp_top(value[best - 1], value[best], value[best + 1]);
        y += sharp_top(value[best - side], value[best], value[best + side]);
        if (alike > ALIKE && view_pixel(s, k, w->px[p][0] + x, w->px[p][1] + y, sight))
            sight->weight = fmin(alike, 1);
    }
    free(value);
    free(with);
    return value && with ? 0 : -ENOMEM;
}

/* Keep places that enough views see. @return sights */
static int gather(struct warm *w)
{
    int places = 0, sights = 0;
    int *number = calloc((size_t)w->places + 1, sizeof(*number)), *seen = calloc((size_t)w->places + 1, sizeof(*seen));

    for (int i = 0; number && seen && i < w->s->n * w->places; i++)
        seen[w->sight[i].place] += w->sight[i].weight > 0;
    for (int p = 0; number && seen && p < w->places; p++) {
        number[p] = seen[p] >= FEW_SIGHTS ? places++ : -1;
        if (number[p] >= 0)
            memcpy(w->at_mm[number[p]], w->at_mm[p], sizeof(*w->at_mm));
    }
    for (int i = 0; number && seen && i < w->s->n * w->places; i++) {
        if (w->sight[i].weight > 0 && number[w->sight[i].place] >= 0) {
            w->sight[sights] = w->sight[i];
            w->sight[sights].place = number[w->sight[sights].place];
            sights++;
        }
    }
    w->places = number && seen ? places : 0;
    sights = number && seen ? sights : -ENOMEM;
    free(number);
    free(seen);
    return sights;
}

/* Fit turns, and the lens if it is free, to the sights of warm places. @return 0, -ENODATA (too few), -EDOM,
 * ... */
static int fit_once(struct sharp *s, struct lens_fit *fit)
{
    struct warm w = { .s = s, .reach = sst_max_int(s->camera.width / PLACE, 2) };
    int err = sharp_see(s);

    err = err ? err : find_places(&w);
    w.sight = err ? NULL : calloc((size_t)s->n * (size_t)sst_max_int(w.places, 1), sizeof(*w.sight));
    if (!err)
        err = w.sight ? sst_parallel_for(s->n, s->threads, see_places, &w) : -ENOMEM;
    if (!err) {
        fit->sights = gather(&w);
        err = fit->sights < 0 ? fit->sights : w.places < FEW_PLACES || fit->sights < 2 * s->n ? -ENODATA : 0;
    }
    if (!err) {
        fit->views = s->n;
        fit->camera = s->greys.camera;
        fit->given = s->given;
        fit->places = w.places;
        fit->place_mm = w.at_mm;
        fit->sight = w.sight;
        fit->sigma_rad = s->turn_sigma;
        memcpy(fit->normal, s->normal, sizeof(fit->normal));
        memcpy(fit->across, s->across, sizeof(fit->across));
        memcpy(fit->slope, s->at + 1, sizeof(fit->slope));
        for (int i = 0; i < 3; i++)
            fit->pivot_mm[i] = s->camera.centre_mm[i] + s->at[0] * s->camera.rotation[6 + i];
        for (int k = 0; k < s->n; k++) { /* the lens of the fit comes before the views' own */
            double own[9];

            memcpy(own, s->greys.camera[k].rotation, sizeof(own));
            s->greys.camera[k] = s->bare[k];
            memcpy(s->greys.camera[k].rotation, own, sizeof(own));
        }
        err = lens_fit(fit);
    }
    for (int k = 0; !err && k < s->n; k++) {
        double turn[9];

        sst_rotation_between(s->greys.camera[k].rotation, s->given[k], turn);
        sst_rotation_to_vector(turn, s->turned[k]);
    }
    if (!err)
        memcpy(s->at + 1, fit->slope, sizeof(fit->slope));
    if (!err && fit->free_lens) {
        s->focal = fit->focal;
        s->k1 = fit->k1;
        if (fit->plane_moves) {
            const double *axis = s->camera.rotation + 6;

            s->at[0] += fit->raise_mm / (vector_dot(s->normal, axis) + s->at[1] * vector_dot(s->across[0], axis) +
                                         s->at[2] * vector_dot(s->across[1], axis));
        }
    }
    warm_fini(&w);
    return err;
}

/* A registration to return to. */
struct kept {
    double (*turned)[3];
    double at[3], focal, k1, sharp;
};

static int keep(struct kept *out, const struct sharp *s, double sharp)
{
    const size_t bytes = (size_t)s->n * sizeof(*out->turned);

    *out = (struct kept){ .turned = malloc(bytes), .focal = s->focal, .k1 = s->k1, .sharp = sharp };
    if (!out->turned)
        return -ENOMEM;
    memcpy(out->turned, s->turned, bytes);
    memcpy(out->at, s->at, sizeof(out->at));
    return 0;
}

static void return_to(struct sharp *s, const struct kept *to)
{
    memcpy(s->turned, to->turned, (size_t)s->n * sizeof(*s->turned));
    memcpy(s->at, to->at, sizeof(s->at));
    s->focal = to->focal;
    s->k1 = to->k1;
    sharp_rotate(s);
}

/* Turns by all three angles, with or without a lens, from the present ones. @param sharp  out */
static int fit_turns(struct sharp *s, struct lens_fit *fit, double *sharp)
{
    int err = 0;

    fit->focal = s->focal;
    fit->k1 = s->k1;
    for (int round = 0; round < LENS_ROUNDS && !err; round++) {
        s->reach = (int)(tan((round ? 0.6 : 0.8) * SHARP_RAD) * s->camera.fx + 0.5) + 1;
        s->sigma_px = 1;
        err = fit_once(s, fit);
    }
    err = err ? err : sharp_register(s, LAST_ROUNDS);
    return err ? err : sharp_measure(sharp, s, s->at);
}

/* One lens for all views, if warm places show it; else turns about all three axes, if they are sharper. */
int sharp_refine_lens(struct sharp *s, bool known, double *sharp, struct sst_sharpened *out)
{
    struct lens_fit turns = { 0 }, lens = { .free_lens = true, .plane_moves = !known };
    struct kept was = { 0 }, turned = { 0 }, with = { 0 };
    const struct kept *best = &was;
    int err = sharp_measure(sharp, s, s->at);

    err = err ? err : keep(&was, s, *sharp);
    err = err ? err : fit_turns(s, &turns, sharp);
    err = err ? err : keep(&turned, s, *sharp);
    if (!err && turned.sharp > was.sharp)
        best = &turned;
    if (!err && !s->cfg->keep_lens) {
        return_to(s, &was);
        err = fit_turns(s, &lens, sharp);
        err = err ? err : keep(&with, s, *sharp);
        if (!err && lens.chi2 > LENS_CHI2 && with.sharp > LENS_GAIN * best->sharp) {
            best = &with;
            out->focal = lens.focal;
            out->k1 = lens.k1;
            out->lens_gain = with.sharp / fmax(turned.sharp, was.sharp);
        }
    }
    if (was.turned)
        return_to(s, best);
    *sharp = best->sharp;
    free(was.turned);
    free(turned.turned);
    free(with.turned);
    return err == -ENODATA || err == -EDOM ? 0 : err; /* too few warm places tell nothing */
}
