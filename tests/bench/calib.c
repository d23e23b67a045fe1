/*
 * How exact a calibration is, on made-up corners with known truth (tests/calib_truth.h):
 *   make build/bench/calib && build/bench/calib [KEY=VALUE ...]
 * Keys: seed rows cols frames board (CxR squares) noise (px) focal (px) lens (0, 5, 8: of the solution) true_lens (0,
 * 5, 8) keep (share of detections) without (a camera whose detections are taken away; -1 none) outliers (share) cross
 * (0, 1) threads. One JSON object: what the solution says of itself, what true points say of the rectification made of
 * it, and how often the truth lies within the predicted sigma. scripts/bench_calib.py runs it for
 * docs/measured/bench-calibration.md.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>

#include <jansson.h>

#include "base/clock.h"
#include "base/stats.h"
#include "pipeline/calibration/solve/solve.h"
#include "pipeline/lightfield/rectify/rectify.h"
#include "tests/calib_truth.h"
#include "tests/camera_project.h"

#define ACROSS    13 /* points over the picture of the reference camera */
#define DOWN      9
#define POINTS    (ACROSS * DOWN)
#define DEPTHS    4
#define BORDER_PX 8 /* points nearer to the border of a picture are left out */
#define STEP_PX   0.25

struct options {
    struct truth_config truth;
    struct sst_solve_config solve;
    int without;
};

/* --- true points in the rectified views --------------------------------------------------------------------------- */

struct seen {
    bool known;
    double x, y;
};

struct carried {
    const struct sst_calib *truth, *calib;
    struct sst_rectified to;
    bool level; /* undo what a camera's place before or behind the plane of the others does at the depth */
    struct seen at[SST_MAX_VIEWS][POINTS];
};

static bool to_raw(const struct carried *c, int view, double x, double y, double raw[2])
{
    return sst_rectify_point(&c->to, c->calib, view, (const double[2]){ x, y }, raw);
}

/* Where the rectified picture shows what the raw one has at (x, y): Newton's method on the way that pictures take. */
static struct seen rectified(const struct carried *c, int view, double x, double y)
{
    const struct sst_calib_camera *cam = &c->calib->camera[view];
    struct seen out = { .known = true };
    double a, b, rig[3], p[3];

    if (!sst_camera_undistort(cam, x, y, &a, &b))
        return (struct seen){ 0 };
    for (int i = 0; i < 3; i++)
        rig[i] = cam->rotation[i] * a + cam->rotation[3 + i] * b + cam->rotation[6 + i];
    for (int i = 0; i < 3; i++)
        p[i] = c->to.rotation[3 * i] * rig[0] + c->to.rotation[3 * i + 1] * rig[1] + c->to.rotation[3 * i + 2] * rig[2];
    out.x = c->to.focal_px * p[0] / p[2] + c->to.cx;
    out.y = c->to.focal_px * p[1] / p[2] + c->to.cy;
    for (int round = 0; round < 6; round++) {
        double here[2], right[2], down[2], det;

        if (!to_raw(c, view, out.x, out.y, here) || !to_raw(c, view, out.x + STEP_PX, out.y, right) ||
            !to_raw(c, view, out.x, out.y + STEP_PX, down))
            return (struct seen){ 0 };
        for (int i = 0; i < 2; i++) {
            right[i] = (right[i] - here[i]) / STEP_PX;
            down[i] = (down[i] - here[i]) / STEP_PX;
        }
        det = right[0] * down[1] - right[1] * down[0];
        out.x += ((x - here[0]) * down[1] - (y - here[1]) * down[0]) / det;
        out.y += ((y - here[1]) * right[0] - (x - here[0]) * right[1]) / det;
    }
    out.known = out.x >= 0 && out.y >= 0 && out.x <= c->to.width - 1 && out.y <= c->to.height - 1;
    return out;
}

/* A picture of the plane that the calibration expects to be larger by scale depth / (depth - dz) than the others. */
static struct seen levelled(const struct carried *c, int view, struct seen s, const double X[3])
{
    const double *z = c->to.rotation + 6, depth = z[0] * X[0] + z[1] * X[1] + z[2] * X[2];
    const double factor = (1 - c->to.view[view].dz_mm / depth) / c->to.view[view].scale;

    return (struct seen){ s.known, c->to.cx + (s.x - c->to.cx) * factor, c->to.cy + (s.y - c->to.cy) * factor };
}

/* Points of the plane z = depth, as all views see them. */
static void carry(struct carried *c, double depth_mm)
{
    const struct sst_calib *t = c->truth;
    const struct sst_calib_camera *ref = &t->camera[t->reference];

    for (int i = 0; i < POINTS; i++) {
        const double px = (i % ACROSS + 0.5) * t->width / ACROSS, py = ((i / ACROSS) + 0.5) * t->height / DOWN;
        double X[3] = { 0, 0, depth_mm };
        const bool is = sst_camera_undistort(ref, px, py, &X[0], &X[1]);

        X[0] *= depth_mm;
        X[1] *= depth_mm;
        for (int view = 0; view < t->rows * t->cols; view++) {
            double x, y;

            c->at[view][i] = (struct seen){ 0 };
            if (is && c->calib->camera[view].known && camera_project(&t->camera[view], X, &x, &y) && x > BORDER_PX &&
                y > BORDER_PX && x < t->width - BORDER_PX && y < t->height - BORDER_PX)
                c->at[view][i] = rectified(c, view, x, y);
            if (c->level)
                c->at[view][i] = levelled(c, view, c->at[view][i], X);
        }
    }
}

/* --- figures ------------------------------------------------------------------------------------------------------ */

struct values {
    double *v;
    int count, capacity;
};

static void add(struct values *all, double v)
{
    if (all->count == all->capacity) {
        all->capacity = all->capacity ? 2 * all->capacity : 4096;
        all->v = realloc(all->v, (size_t)all->capacity * sizeof(*all->v));
        if (!all->v)
            abort();
    }
    all->v[all->count++] = v;
}

/* Of magnitudes. */
static json_t *spread_of(struct values *all)
{
    double sum = 0;
    json_t *out;

    if (!all->count)
        return json_null();
    sst_stats_sort_double(all->v, all->count);
    for (int i = 0; i < all->count; i++)
        sum += all->v[i];
    out = json_pack("{s:f, s:f, s:f, s:i}", "mean", sum / all->count, "p95", all->v[all->count * 95 / 100], "max",
                    all->v[all->count - 1], "count", all->count);
    free(all->v);
    return out;
}

/* Across the line between the views, measured minus predicted: the rest beside the disparity along it. */
static void cross_disparity(const struct carried *c, int a, int b, struct values *out)
{
    const double bx = c->to.view[b].bx - c->to.view[a].bx, by = c->to.view[b].by - c->to.view[a].by;

    for (int i = 0; i < POINTS; i++) {
        const struct seen *p = &c->at[a][i], *q = &c->at[b][i];

        if (p->known && q->known)
            add(out, fabs((q->x - p->x) * by - (q->y - p->y) * bx) / hypot(bx, by));
    }
}

static json_t *pairs(const struct carried *c, bool neighbours)
{
    const int cols = c->truth->cols, views = c->truth->rows * cols;
    struct values all = { 0 };

    for (int a = 0; a < views; a++) {
        for (int b = a + 1; b < views; b++) {
            const int apart = abs(a / cols - b / cols) + abs(a % cols - b % cols);

            if (c->calib->camera[a].known && c->calib->camera[b].known && (!neighbours || apart == 1))
                cross_disparity(c, a, b, &all);
        }
    }
    return spread_of(&all);
}

/* Mean disparity of the plane's points between the reference and each other view, by points that all of them see: how
 * far they lie apart, largest minus smallest over their mean. */
static double plane_spread(const struct carried *c)
{
    const int views = c->truth->rows * c->truth->cols, ref = c->calib->reference;
    double least = INFINITY, most = -INFINITY, mean = 0;
    int n = 0;

    for (int view = 0; view < views; view++) {
        const double bx = c->to.view[view].bx, by = c->to.view[view].by;
        double sum = 0;
        int points = 0;

        for (int i = 0; i < POINTS && view != ref && c->calib->camera[view].known; i++) {
            bool all = true;

            for (int other = 0; other < views; other++)
                all = all && (c->at[other][i].known || !c->calib->camera[other].known);
            if (!all)
                continue;
            sum -= ((c->at[view][i].x - c->at[ref][i].x) * bx + (c->at[view][i].y - c->at[ref][i].y) * by) /
                   (bx * bx + by * by);
            points++;
        }
        if (!points)
            continue;
        least = fmin(least, sum / points);
        most = fmax(most, sum / points);
        mean += sum / points;
        n++;
    }
    return n ? (most - least) / (mean / n) : NAN;
}

/* @param calib  whose rectification carries the true points */
static json_t *rectification(const struct truth *t, const struct sst_calib *calib, bool level)
{
    const struct sst_rectify_config cfg = { .plane_mm = -1 };
    struct carried *c = calloc(1, sizeof(*c));
    const double depths[DEPTHS] = { t->cfg.near_mm, sqrt(t->cfg.near_mm * t->cfg.far_mm), t->cfg.far_mm, 1e6 };
    json_t *out = json_array();

    if (!c)
        abort();
    c->truth = &t->calib;
    c->calib = calib;
    c->level = level;
    if (sst_rectify_plan(&c->to, calib, &cfg)) {
        free(c);
        json_decref(out);
        return json_null();
    }
    for (int i = 0; i < DEPTHS; i++) {
        carry(c, depths[i]);
        json_array_append_new(out, json_pack("{s:f, s:o, s:o, s:f}", "depth_mm", depths[i], "neighbours",
                                             pairs(c, true), "all", pairs(c, false), "plane_spread",
                                             depths[i] < 1e5 ? plane_spread(c) : 0.0));
    }
    free(c);
    return out;
}

/* --- predicted and true errors ------------------------------------------------------------------------------------ */

/* A pixel of the reference view in another one, for a point at a depth. */
static bool follow(const struct sst_calib *c, int view, double x, double y, double depth_mm, double out[2])
{
    double X[3] = { 0, 0, 1 };

    if (!sst_camera_undistort(&c->camera[c->reference], x, y, &X[0], &X[1]))
        return false;
    for (int i = 0; i < 3; i++)
        X[i] *= depth_mm;
    return camera_project(&c->camera[view], X, &out[0], &out[1]);
}

/* Shares of the cells' errors (x and y apart) within one and two predicted sigma. */
static json_t *sigma_shares(const struct truth *t, const struct sst_solution *s)
{
    const struct sst_calib *c = &s->calib;
    int count = 0, one = 0, two = 0;
    double squares = 0;

    for (int view = 0; view < c->rows * c->cols; view++) {
        for (int i = 0; i < SST_UNCERTAINTY_ROWS * SST_UNCERTAINTY_COLS; i++) {
            const int row = i / SST_UNCERTAINTY_COLS, col = i % SST_UNCERTAINTY_COLS;
            const double x = (col + 0.5) * c->width / SST_UNCERTAINTY_COLS - 0.5;
            const double y = (row + 0.5) * c->height / SST_UNCERTAINTY_ROWS - 0.5;
            const double sigma = s->transfer_sigma[view][1][row][col];
            double is[2], should[2];

            if (view == c->reference || !(sigma > 0) || !follow(c, view, x, y, c->range_mm, is) ||
                !follow(&t->calib, view, x, y, c->range_mm, should))
                continue;
            for (int k = 0; k < 2; k++) {
                const double z = fabs(is[k] - should[k]) / sigma;

                count++;
                one += z <= 1;
                two += z <= 2;
                squares += z * z;
            }
        }
    }
    if (!count)
        return json_null();
    return json_pack("{s:i, s:f, s:f, s:f}", "count", count, "one", (double)one / count, "two", (double)two / count,
                     "rms", sqrt(squares / count));
}

/* --- one solution ------------------------------------------------------------------------------------------------- */

static json_t *real(double v)
{
    return isfinite(v) ? json_real(v) : json_null();
}

static json_t *told(const struct truth *t, const struct sst_solution *s)
{
    json_t *out = json_object();
    double worst_focal = 0, worst_mm = 0, sigma = 0;
    int known = 0;

    for (int view = 0; view < t->cfg.rows * t->cfg.cols; view++) {
        const struct sst_calib_camera *is = &s->calib.camera[view], *should = &t->calib.camera[view];

        if (!is->known)
            continue;
        sigma += is->sigma_px;
        known += is->sigma_px > 0;
        worst_focal = fmax(worst_focal, fabs(is->fx / should->fx - 1));
        for (int i = 0; i < 3; i++)
            worst_mm = fmax(worst_mm, fabs(is->position_mm[i] - should->position_mm[i]));
    }
    json_object_set_new(out, "seconds", json_real(s->seconds));
    json_object_set_new(out, "iterations", json_integer(s->iterations));
    json_object_set_new(out, "states", json_integer(s->states));
    json_object_set_new(out, "measurements", json_integer(s->measurements));
    json_object_set_new(out, "corners", json_integer(s->corners));
    json_object_set_new(out, "outliers", json_integer(s->outliers));
    json_object_set_new(out, "lens", json_integer(s->lens));
    json_object_set_new(out, "rms_px", real(s->rms_px));
    json_object_set_new(out, "predicted_rms_px", real(s->predicted_rms_px));
    json_object_set_new(out, "noise_px", real(s->noise_px));
    json_object_set_new(out, "rcond", real(s->rcond));
    json_object_set_new(out, "cross_px", real(s->cv_px));
    json_object_set_new(out, "cross_expected_px", real(s->cv_expected_px));
    json_object_set_new(out, "held_out_px", json_pack("[f, f]", s->held_out_px[0], s->held_out_px[1]));
    json_object_set_new(out, "range_mm", json_real(s->calib.range_mm));
    json_object_set_new(out, "sigma_px", real(known ? sigma / known : NAN));
    json_object_set_new(out, "worst_focal", json_real(worst_focal));
    json_object_set_new(out, "worst_position_mm", json_real(worst_mm));
    return out;
}

/* Take a camera's detections away, and its place in the grid. */
static void take_away(struct truth *t, int view)
{
    struct sst_detections *all = &t->all;
    int kept = 0;

    for (int i = 0; i < all->count; i++) {
        if (all->detection[i].view == view)
            sst_detection_fini(&all->detection[i]);
        else
            all->detection[kept++] = all->detection[i];
    }
    all->count = kept;
    all->camera_name[view][0] = 0;
}

static int run(const struct options *o)
{
    struct truth t;
    struct sst_solution s;
    double cpu_s;
    json_t *out;
    int err;

    truth_make(&t, &o->truth);
    if (o->without >= 0)
        take_away(&t, o->without);
    cpu_s = -(double)sst_clock_cpu_ns() / 1e9;
    err = sst_solve(&s, &t.all, &o->solve);
    cpu_s += (double)sst_clock_cpu_ns() / 1e9;
    if (err) {
        printf("{\"error\": %d}\n", -err);
        truth_free(&t);
        return 1;
    }
    t.calib.range_mm = s.calib.range_mm;
    out = told(&t, &s);
    json_object_set_new(out, "sigma", sigma_shares(&t, &s));
    json_object_set_new(out, "cpu_seconds", json_real(cpu_s));
    json_object_set_new(out, "rectified", rectification(&t, &s.calib, false));
    json_object_set_new(out, "levelled", rectification(&t, &s.calib, true));
    json_object_set_new(out, "rectified_by_truth", rectification(&t, &t.calib, false));
    json_dumpf(out, stdout, JSON_COMPACT);
    printf("\n");
    json_decref(out);
    sst_solution_fini(&s);
    truth_free(&t);
    return 0;
}

/* @return false: not KEY=VALUE of a known key */
static bool set(struct options *o, const char *text)
{
    struct truth_config *t = &o->truth;
    const struct {
        const char *key;
        int *whole;
        double *real;
    } keys[] = {
        { "rows", &t->rows, NULL },       { "cols", &t->cols, NULL },         { "frames", &t->frames, NULL },
        { "lens", &o->solve.lens, NULL }, { "true_lens", &t->lens, NULL },    { "threads", &o->solve.threads, NULL },
        { "without", &o->without, NULL }, { "noise", NULL, &t->noise_px },    { "keep", NULL, &t->detections },
        { "focal", NULL, &t->focal_px },  { "outliers", NULL, &t->outliers },
    };
    const char *value = strchr(text, '=');
    const size_t length = value ? (size_t)(value - text) : 0;

    if (!value++)
        return false;
    if (!strncmp(text, "seed=", 5))
        return sscanf(value, "%lu", &t->seed) == 1;
    if (!strncmp(text, "cross=", 6)) {
        o->solve.cross_validate = *value == '1';
        return true;
    }
    if (!strncmp(text, "board=", 6))
        return sscanf(value, "%dx%d", &t->board.cols, &t->board.rows) == 2;
    for (size_t i = 0; i < ARRAY_LEN(keys); i++) {
        if (strlen(keys[i].key) == length && !strncmp(keys[i].key, text, length))
            return keys[i].whole ? sscanf(value, "%d", keys[i].whole) == 1 : sscanf(value, "%lf", keys[i].real) == 1;
    }
    return false;
}

int main(int argc, char **argv)
{
    struct options o = { .truth = truth_defaults(), .solve = { .lens = 5, .threads = 1 }, .without = -1 };

    for (int i = 1; i < argc; i++) {
        if (!set(&o, argv[i])) {
            fprintf(stderr, "calib: no such setting: %s\n", argv[i]);
            return 2;
        }
    }
    if (o.truth.lens == 8) { /* an equidistant lens, atan r / r by Pade's approximation, which 5 do not follow */
        static const double k[SST_LENS_MAX] = { 7 / 9.0, 64 / 945.0, 0.0004, -0.0003, 0, 10 / 9.0, 5 / 21.0, 0 };

        memcpy(o.truth.k, k, sizeof(k));
    }
    return run(&o);
}
