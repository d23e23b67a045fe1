/* Gains between cameras from matches: windows that show the same surface have the same light.
 *
 * A match of a and b gives log light(b) - log light(a) = g_b - g_a, a colour at a time, g the logs of the gains.
 * Robust least squares over all matches; what matches do not connect has a common gain of its own. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/stats.h"
#include "pipeline/calibration/drift/drift_internal.h"
#include "pipeline/image/srgb.h"

#define HALF      3     /* windows of 7x7 px */
#define CLIPPED   250   /* levels from here on are not trusted */
#define DARK      0.002 /* linear light: darker windows are mostly noise and black level */
#define ROUNDS    12
#define TUKEY     4.685
#define SCALE_MIN 0.002 /* of the residuals, logs */

struct ratio {
    int a, b;
    double log[3];
};

struct solver {
    int views, count;
    const struct ratio *ratio;
    double *normal, *right, *x; /* [views][views] lower half, then its factor; [views]; [views] */
    double *sort;               /* [count] */
};

/* Mean light of a window at a fractional place, by colour. @return false: outside, clipped or dark */
static bool window_light(const struct sst_image *image, const double *light, double x, double y, double out[3])
{
    const int x0 = (int)floor(x), y0 = (int)floor(y);
    const double tx = x - x0, ty = y - y0;

    if (x0 - HALF < 0 || y0 - HALF < 0 || x0 + HALF + 1 >= image->width || y0 + HALF + 1 >= image->height)
        return false;
    for (int c = 0; c < 3; c++) {
        double sum = 0;

        for (int j = -HALF; j <= HALF + 1; j++) {
            const uint8_t *row = sst_image_row(image, c, y0 + j) + x0;
            const double wy = j == -HALF ? 1 - ty : j == HALF + 1 ? ty : 1;

            for (int i = -HALF; i <= HALF + 1; i++) {
                if (row[i] >= CLIPPED)
                    return false;
                sum += wy * (i == -HALF ? 1 - tx : i == HALF + 1 ? tx : 1) * light[row[i]];
            }
        }
        out[c] = sum / ((2 * HALF + 1) * (2 * HALF + 1));
        if (out[c] < DARK)
            return false;
    }
    return true;
}

static int collect(struct ratio *out, const struct drift_work *w)
{
    double light[256];
    int n = 0;

    for (int i = 0; i < 256; i++)
        light[i] = sst_srgb_to_light(i / 255.0);
    for (int i = 0; i < w->links; i++) {
        const struct drift_link *l = &w->link[i];

        for (int k = 0; drift_link_useful(l) && k < DRIFT_CELLS; k++) {
            const struct drift_feature *p = &w->view[l->a].feature[l->feature[k]];
            double la[3], lb[3];

            if (!l->used[k] || !window_light(w->view[l->a].image, light, p->x, p->y, la) ||
                !window_light(w->view[l->b].image, light, p->x + l->m[k].dx, p->y + l->m[k].dy, lb))
                continue;
            out[n] = (struct ratio){ .a = l->a, .b = l->b };
            for (int c = 0; c < 3; c++)
                out[n].log[c] = log(lb[c] / la[c]);
            n++;
        }
    }
    return n;
}

static double misfit(const struct solver *s, const struct ratio *r, int colour)
{
    return r->log[colour] - (s->x[r->b] - s->x[r->a]);
}

static double *at(const struct solver *s, int row, int col)
{
    return &s->normal[(size_t)row * (size_t)s->views + (size_t)col];
}

/* Cholesky's factor in place: positive definite by the prior. */
static void factor(const struct solver *s)
{
    for (int i = 0; i < s->views; i++) {
        for (int j = 0; j <= i; j++) {
            double v = *at(s, i, j);

            for (int k = 0; k < j; k++)
                v -= *at(s, i, k) * *at(s, j, k);
            *at(s, i, j) = i == j ? sqrt(fmax(v, 1e-12)) : v / *at(s, j, j);
        }
    }
}

static void solve(const struct solver *s, double *v)
{
    for (int i = 0; i < s->views; i++) {
        for (int k = 0; k < i; k++)
            v[i] -= *at(s, i, k) * v[k];
        v[i] /= *at(s, i, i);
    }
    for (int i = s->views; i-- > 0;) {
        for (int k = i + 1; k < s->views; k++)
            v[i] -= *at(s, k, i) * v[k];
        v[i] /= *at(s, i, i);
    }
}

static double residual_scale(const struct solver *s, int colour)
{
    for (int i = 0; i < s->count; i++)
        s->sort[i] = fabs(misfit(s, &s->ratio[i], colour));
    return fmax(1.4826 * sst_stats_quantile(s->sort, s->count, 0.5), SCALE_MIN);
}

/* One round of reweighted least squares. A weak prior fixes what no match does, the mean. */
static void iterate(const struct solver *s, int colour, double scale)
{
    memset(s->normal, 0, (size_t)s->views * (size_t)s->views * sizeof(*s->normal));
    memset(s->right, 0, (size_t)s->views * sizeof(*s->right));
    for (int v = 0; v < s->views; v++)
        *at(s, v, v) = 1e-6 / (scale * scale);
    for (int i = 0; i < s->count; i++) {
        const struct ratio *r = &s->ratio[i];
        const double t = misfit(s, r, colour) / (TUKEY * scale);
        const double weight = fabs(t) >= 1 ? 0 : (1 - t * t) * (1 - t * t) / (scale * scale);

        *at(s, r->a, r->a) += weight;
        *at(s, r->b, r->b) += weight;
        *at(s, sst_max_int(r->a, r->b), sst_min_int(r->a, r->b)) -= weight;
        s->right[r->b] += weight * r->log[colour];
        s->right[r->a] -= weight * r->log[colour];
    }
    factor(s);
    solve(s, s->right);
    memcpy(s->x, s->right, (size_t)s->views * sizeof(*s->x));
}

/* Sigma of each camera's gain relative to the mean of all, from the last factor. */
static void add_sigmas(struct sst_drift_camera *camera, const struct solver *s, const int *matches, double *column)
{
    int n = 0;

    for (int v = 0; v < s->views; v++)
        n += matches[v] > 0;
    for (int v = 0; v < s->views; v++) {
        if (!matches[v])
            continue;
        for (int i = 0; i < s->views; i++)
            column[i] = matches[i] ? (i == v) - 1.0 / n : 0;
        memcpy(s->right, column, (size_t)s->views * sizeof(*column));
        solve(s, s->right);
        double variance = 0;

        for (int i = 0; i < s->views; i++)
            variance += column[i] * s->right[i];
        camera[v].gain_sigma = fmax(isnan(camera[v].gain_sigma) ? 0 : camera[v].gain_sigma, sqrt(fmax(variance, 0)));
    }
}

static void solve_colour(struct sst_drift_camera *camera, const struct solver *s, int colour, const int *matches,
                         double *column)
{
    double mean = 0, scale = 0;
    int n = 0;

    memset(s->x, 0, (size_t)s->views * sizeof(*s->x));
    for (int i = 0; i < ROUNDS; i++) {
        /* From loose to the scale of the matches: first gains are not yet known. */
        scale = fmax(residual_scale(s, colour), i < ROUNDS / 2 ? 0.3 / (1 << i) : 0);
        iterate(s, colour, scale);
    }
    for (int v = 0; v < s->views; v++) {
        if (matches[v])
            mean += (s->x[v] - mean) / ++n;
    }
    for (int v = 0; v < s->views; v++) {
        if (matches[v])
            camera[v].gain[colour] = exp(s->x[v] - mean);
    }
    add_sigmas(camera, s, matches, column);
}

int drift_solve_gains(struct sst_drift_camera *camera, const struct drift_work *w)
{
    const size_t n = (size_t)w->views;
    struct ratio *ratio = malloc(((size_t)w->links * DRIFT_CELLS + 1) * sizeof(*ratio));
    int *matches = calloc(n, sizeof(*matches));
    double *column = calloc(n, sizeof(*column));
    struct solver s = { .views = w->views,
                        .ratio = ratio,
                        .normal = calloc(n * n, sizeof(double)),
                        .right = calloc(n, sizeof(double)),
                        .x = calloc(n, sizeof(double)) };
    int err = -ENOMEM;

    for (int v = 0; v < w->views; v++) {
        camera[v].gain[0] = camera[v].gain[1] = camera[v].gain[2] = 1;
        camera[v].gain_sigma = NAN;
    }
    if (ratio && matches && column && s.normal && s.right && s.x) {
        s.count = collect(ratio, w);
        s.sort = malloc(((size_t)s.count + 1) * sizeof(*s.sort));
        err = s.sort ? 0 : -ENOMEM;
        for (int i = 0; i < s.count; i++) {
            matches[ratio[i].a]++;
            matches[ratio[i].b]++;
        }
        for (int c = 0; !err && s.count && c < 3; c++)
            solve_colour(camera, &s, c, matches, column);
    }
    free(ratio);
    free(matches);
    free(column);
    free(s.normal);
    free(s.right);
    free(s.x);
    free(s.sort);
    return err;
}
