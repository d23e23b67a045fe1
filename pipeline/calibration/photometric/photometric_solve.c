/* Gain and fall-off of each camera from samples of white patches: selection of samples, the fit, its report. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/calibration/photometric/photometric.h"
#include "pipeline/calibration/photometric/photometric_internal.h"

#define FEWEST_SAMPLES 12 /* of a camera, on patches that another one sees too */
#define ORDER          3

/* A sample, and whether it is used. */
struct usable {
    const struct sst_photometric_sample *sample;
    bool dropped;
};

struct solving {
    const struct sst_calib *calib;
    int views, count;
    struct usable *usable; /* by frame, patch, view: groups are neighbours */
    int *samples;          /* [views] in groups of two or more; 0: not part of the solution */
    int *cam;              /* [views] number in the problem, or -1 */
    struct photometric_observation *seen;
    struct photometric_problem problem;
};

/* --- usable samples ---------------------------------------------------------------------------------------------- */

static int compare(int a, int b)
{
    return (a > b) - (a < b);
}

static int by_group(const void *a, const void *b)
{
    const struct sst_photometric_sample *s = ((const struct usable *)a)->sample,
                                        *t = ((const struct usable *)b)->sample;
    int order = compare(s->frame, t->frame);

    order = order ? order : compare(s->patch, t->patch);
    order = order ? order : compare(s->view, t->view);
    order = order ? order : (s->x > t->x) - (s->x < t->x);
    return order ? order : (s->y > t->y) - (s->y < t->y);
}

static bool is_sane(const struct solving *s, const struct sst_photometric_sample *a)
{
    if (a->view < 0 || a->view >= s->views || !s->calib->camera[a->view].known || !isfinite(a->x) || !isfinite(a->y))
        return false;
    for (int c = 0; c < 3; c++) {
        if (!(a->linear[c] > 0) || !isfinite(a->linear[c]))
            return false;
    }
    return true;
}

static bool same_group(const struct usable *a, const struct usable *b)
{
    return a->sample->frame == b->sample->frame && a->sample->patch == b->sample->patch;
}

/* Drop samples that no other camera shares, and cameras with too few, until nothing changes. */
static void drop_lonely(struct solving *s)
{
    bool changed = true;

    while (changed) {
        changed = false;
        memset(s->samples, 0, (size_t)s->views * sizeof(*s->samples));
        for (int from = 0, end; from < s->count; from = end) {
            int first = -1;
            bool shared = false;

            for (end = from; end < s->count && same_group(&s->usable[from], &s->usable[end]); end++) {
                const int view = s->usable[end].sample->view;

                if (s->usable[end].dropped)
                    continue;
                first = first < 0 ? view : first;
                shared = shared || view != first;
            }
            for (int i = from; i < end; i++) {
                changed = changed || (!shared && !s->usable[i].dropped);
                s->usable[i].dropped = s->usable[i].dropped || !shared;
                s->samples[s->usable[i].sample->view] += !s->usable[i].dropped;
            }
        }
        for (int i = 0; i < s->count; i++) {
            const bool few = s->samples[s->usable[i].sample->view] < FEWEST_SAMPLES;

            changed = changed || (few && !s->usable[i].dropped);
            s->usable[i].dropped = s->usable[i].dropped || few;
        }
    }
}

static double r2_of(const struct sst_calib *calib, const struct sst_calib_camera *cam, double x, double y)
{
    const double half2 = 0.25 * ((double)calib->width * calib->width + (double)calib->height * calib->height);

    return ((x - cam->cx) * (x - cam->cx) + (y - cam->cy) * (y - cam->cy)) / half2;
}

/* r2 of the farthest corner, at most 4: a principal point far outside the picture is not used. */
static double reach_of(const struct sst_calib *calib, const struct sst_calib_camera *cam)
{
    const double x = cam->cx > 0.5 * calib->width ? 0 : calib->width - 1;
    const double y = cam->cy > 0.5 * calib->height ? 0 : calib->height - 1;

    return fmin(r2_of(calib, cam, x, y), 4);
}

/* --- parts: cameras that patches link ---------------------------------------------------------------------------- */

static int root_of(struct photometric_camera *cam, int k)
{
    while (cam[k].part != k)
        k = cam[k].part = cam[cam[k].part].part;
    return k;
}

static void find_parts(struct photometric_problem *p)
{
    for (int k = 0; k < p->cams; k++)
        p->cam[k].part = k;
    for (int i = 1; i < p->count; i++) {
        if (p->seen[i].group == p->seen[i - 1].group) {
            const int a = root_of(p->cam, p->seen[i - 1].cam), b = root_of(p->cam, p->seen[i].cam);

            p->cam[sst_max_int(a, b)].part = sst_min_int(a, b);
        }
    }
    for (int k = 0; k < p->cams; k++)
        p->cam[k].part = root_of(p->cam, k);
    /* Roots are the lowest of their part, so numbered before its members. */
    for (int k = 0; k < p->cams; k++) {
        const int root = p->cam[k].part;

        p->cam[k].part = root == k ? p->parts++ : p->cam[root].part;
    }
}

/* --- the problem ------------------------------------------------------------------------------------------------- */

static int make_cams(struct solving *s)
{
    struct photometric_problem *p = &s->problem;

    for (int view = 0; view < s->views; view++)
        s->cam[view] = s->samples[view] ? p->cams++ : -1;
    p->cam = calloc((size_t)p->cams + 1, sizeof(*p->cam));
    s->seen = calloc((size_t)s->count + 1, sizeof(*s->seen));
    if (!p->cam || !s->seen)
        return -ENOMEM;
    for (int view = 0; view < s->views; view++) {
        if (s->cam[view] >= 0)
            p->cam[s->cam[view]].reach = reach_of(s->calib, &s->calib->camera[view]);
    }
    return 0;
}

static void make_seen(struct solving *s)
{
    struct photometric_problem *p = &s->problem;

    for (int i = 0, group = 0; i < s->count; i++) {
        const struct sst_photometric_sample *a = s->usable[i].sample;
        struct photometric_observation *seen = &s->seen[p->count];

        group += i > 0 && !same_group(&s->usable[i - 1], &s->usable[i]);
        if (s->usable[i].dropped)
            continue;
        seen->cam = s->cam[a->view];
        seen->group = group;
        seen->r2 = fmin(r2_of(s->calib, &s->calib->camera[a->view], a->x, a->y), p->cam[seen->cam].reach);
        for (int c = 0; c < 3; c++)
            seen->value[c] = log((double)a->linear[c]);
        p->count++;
    }
    p->seen = s->seen;
}

static int prepare(struct solving *s, const struct sst_photometric_samples *all)
{
    s->views = s->calib->rows * s->calib->cols;
    s->usable = calloc((size_t)all->count + 1, sizeof(*s->usable));
    s->samples = calloc((size_t)s->views, sizeof(*s->samples));
    s->cam = calloc((size_t)s->views, sizeof(*s->cam));
    if (!s->usable || !s->samples || !s->cam)
        return -ENOMEM;
    for (int i = 0; i < all->count; i++) {
        if (is_sane(s, &all->sample[i]))
            s->usable[s->count++].sample = &all->sample[i];
    }
    qsort(s->usable, (size_t)s->count, sizeof(*s->usable), by_group);
    drop_lonely(s);
    s->problem.one_camera = s->calib->rig;
    if (make_cams(s))
        return -ENOMEM;
    make_seen(s);
    if (!s->problem.count)
        return -ENODATA;
    find_parts(&s->problem);
    return 0;
}

/* The highest degree with a plausible common fall-off; then cameras with an implausible one get the common one.
 */
static int fit(struct photometric_problem *p)
{
    int bad = 0, err = 0;

    for (p->order = ORDER; bad >= 0 && !err; p->order -= bad == p->cams) {
        memset(p->common, 0, sizeof(p->common));
        for (int k = 0; k < p->cams; k++) {
            p->cam[k].own = 0;
            memset(p->cam[k].gain, 0, sizeof(p->cam[k].gain));
        }
        err = photometric_fit_gains(p);
        bad = photometric_falloff_fault(p);
        for (int k = bad; k >= 0 && k < p->cams && !err; k = photometric_falloff_fault(p)) {
            p->cam[k].plain = true;
            p->cam[k].own = 0;
        }
    }
    return err;
}

/* --- results ----------------------------------------------------------------------------------------------------- */

static double residual_of(const struct photometric_problem *p, const struct photometric_observation *s, int c,
                          bool corrected)
{
    return corrected ? s->value[c] - p->cam[s->cam].gain[c] - photometric_log_falloff(p, s->cam, s->r2) : s->value[c];
}

/* RMS of light over the mean of its patch less 1. */
static double spread(const struct photometric_problem *p, bool corrected)
{
    double sum = 0;

    for (int from = 0, end; from < p->count; from = end) {
        for (int c = 0; c < 3; c++) {
            double mean = 0;

            for (end = from; end < p->count && p->seen[end].group == p->seen[from].group; end++)
                mean += residual_of(p, &p->seen[end], c, corrected);
            mean /= end - from;
            for (int i = from; i < end; i++) {
                const double relative = expm1(residual_of(p, &p->seen[i], c, corrected) - mean);

                sum += relative * relative;
            }
        }
    }
    return sqrt(sum / (3.0 * p->count));
}

static void store(struct sst_calib *calib, const struct solving *s, struct sst_photometric_report *report)
{
    const struct photometric_problem *p = &s->problem;

    for (int view = 0; view < s->views; view++) {
        struct sst_calib_camera *cam = &calib->camera[view];
        const struct photometric_camera *found = s->cam[view] >= 0 ? &p->cam[s->cam[view]] : NULL;

        if (!cam->known)
            continue;
        for (int i = 0; i < 3; i++) {
            cam->gain[i] = found ? exp(found->gain[i]) : 1;
            cam->falloff[i] = found || p->one_camera ? p->common[i] + (found && i == 0 ? found->own : 0) : 0;
            report->worst_gain = fmax(report->worst_gain, fabs(cam->gain[i] - 1));
        }
        if (found)
            report->worst_falloff =
                fmax(report->worst_falloff, -expm1(photometric_log_falloff(p, s->cam[view], found->reach)));
    }
}

static void log_result(const struct solving *s)
{
    const struct photometric_problem *p = &s->problem;

    for (int view = 0; view < s->views; view++) {
        const struct sst_calib_camera *cam = &s->calib->camera[view];

        if (cam->known && s->cam[view] < 0 && !p->one_camera)
            sst_log_warning("light: camera %s (row %d, column %d) shares fewer than %d white patches with others: its "
                            "gain stays 1; show the board where its neighbours see it too",
                            cam->name, view / s->calib->cols, view % s->calib->cols, FEWEST_SAMPLES);
    }
    for (int part = 1; part < p->parts && !p->one_camera; part++) {
        int view = 0;

        while (s->cam[view] < 0 || p->cam[s->cam[view]].part != part)
            view++;
        sst_log_warning("light: no white patch links camera %s (row %d, column %d) and those seen with it to the first "
                        "cameras: they are equalised among themselves only; show the board where both see it",
                        s->calib->camera[view].name, view / s->calib->cols, view % s->calib->cols);
    }
}

static void solving_fini(struct solving *s)
{
    free(s->usable);
    free(s->samples);
    free(s->cam);
    free(s->seen);
    free(s->problem.cam);
}

int sst_photometric_solve(struct sst_calib *calib, const struct sst_photometric_samples *all,
                          struct sst_photometric_report *report)
{
    struct solving s = { .calib = calib };
    struct sst_photometric_report made = { 0 };
    int err = prepare(&s, all);

    err = err ? err : fit(&s.problem);
    if (!err) {
        made.samples = s.problem.count;
        made.cameras = s.problem.cams;
        made.before = spread(&s.problem, false);
        made.after = spread(&s.problem, true);
        log_result(&s);
        store(calib, &s, &made);
        *report = made;
    } else if (err == -ENODATA) {
        sst_log_warning(
            "no white patch of the board is seen by two cameras in one frame (%d samples), so gains and "
            "fall-off stay unknown: show it larger, evenly lit and not overexposed, where neighbours see it "
            "too",
            all->count);
    } else {
        sst_log_error("no memory to solve the light of %d cameras", s.views);
    }
    solving_fini(&s);
    return err;
}
