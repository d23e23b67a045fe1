/* The flow from corners to a calibration, and its output. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/calibration/solve/solve.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/border.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/stats.h"
#include "pipeline/calibration/solve/solve_internal.h"

/* One sigma of the board's warp, of its longer side: boards are flat to a few millimetres in a metre. */
#define WARP_OF_SIDE 0.005
#define OUTSIDE_PX   2    /* corners may be this far beyond the picture */
#define MOST_OUTSIDE 0.25 /* of the corners that are */

static void board_extent(const struct sst_board *board, double low[2], double high[2])
{
    low[0] = low[1] = INFINITY;
    high[0] = high[1] = -INFINITY;
    for (int id = 0; id < sst_board_points(board); id++) {
        double at[2];

        sst_board_point(board, id, at);
        for (int i = 0; i < 2; i++) {
            low[i] = fmin(low[i], at[i]);
            high[i] = fmax(high[i], at[i]);
        }
    }
}

/* Distance of a corner beyond its picture, px; NaN where it is not finite. */
static double outside(const struct sst_corner *c, const struct sst_detections *all)
{
    const double x = fmax(-c->x, c->x - (all->width - 1)), y = fmax(-c->y, c->y - (all->height - 1));

    return isfinite(c->x) && isfinite(c->y) ? fmax(x, y) : (double)NAN;
}

/* Copy one corner. @return false: not finite, far outside the picture, or not a point of the board */
static bool copy_corner(struct solve_corner *to, const struct sst_corner *from, const struct sst_detections *all,
                        const double low[2], const double high[2])
{
    const struct sst_board *board = &all->board;

    *to = (struct solve_corner){ .id = from->id, .x = from->x, .y = from->y, .weight = from->weight };
    if (from->id < 0 || from->id >= sst_board_points(board) ||
        !(outside(from, all) < sst_max_int(all->width, all->height)) || !(from->weight > 1e-3) || !(from->weight <= 1))
        return false;
    sst_board_point(board, from->id, to->p);
    for (int i = 0; i < 2; i++) {
        const double size = high[i] - low[i], u = size > 0 ? 2 * (to->p[i] - low[i]) / size - 1 : 0;

        to->bulge[i] = 1 - u * u;
    }
    return true;
}

/* A few corners beyond the picture are outliers; many mean pictures of another size. */
static int check_size(const struct sst_detections *all, const struct sst_solve_config *cfg)
{
    long long corners = 0, beyond = 0;

    for (int i = 0; i < all->count; i++) {
        for (int k = 0; k < all->detection[i].corners; k++) {
            corners++;
            beyond += !(outside(&all->detection[i].corner[k], all) <= OUTSIDE_PX);
        }
    }
    if ((double)beyond <= (double)corners * MOST_OUTSIDE)
        return 0;
    return solve_reject(cfg,
                        "%lld of %lld corners lie outside the %dx%d pictures; correct the size or detect "
                        "the corners again",
                        beyond, corners, all->width, all->height);
}

static int copy_detections(struct solve_problem *p, const struct sst_detections *all,
                           const struct sst_solve_config *cfg)
{
    double low[2], high[2];
    struct solve_corner *next = p->pool;
    int left_out = 0;

    if (check_size(all, cfg))
        return -EBADMSG;
    board_extent(&all->board, low, high);
    p->warp_sigma_mm = fmax(WARP_OF_SIDE * fmax(high[0] - low[0], high[1] - low[1]), 1e-3);
    for (int i = 0; i < all->count; i++) {
        const struct sst_detection *from = &all->detection[i];
        struct solve_detection *d = &p->detection[i];
        char name[128];

        if (from->view < 0 || from->view >= p->views || from->frame < 0 || from->frame >= p->frames ||
            (i && (from->frame < from[-1].frame || (from->frame == from[-1].frame && from->view <= from[-1].view)))) {
            sst_log_error(
                "detection %d refers to view %d in frame %d, but there are %d views and %d frames, in ascending order",
                i, from->view, from->frame, p->views, p->frames);
            return -EBADMSG;
        }
        *d = (struct solve_detection){ .view = from->view, .frame = from->frame, .corner = next };
        for (int k = 0; k < from->corners; k++) {
            if (copy_corner(&next[d->corners], &from->corner[k], all, low, high))
                d->corners++;
            else if (!left_out++ &&
                     solve_reject(cfg,
                                  "corner %d of %s in frame %s is at (%g, %g) with weight %g, which is not a "
                                  "point of the board (%d points) in a picture of %dx%d; detect the corners again",
                                  from->corner[k].id, solve_name(all, from->view, name), all->frame_name[from->frame],
                                  from->corner[k].x, from->corner[k].y, from->corner[k].weight,
                                  sst_board_points(&all->board), all->width, all->height))
                return -EBADMSG;
        }
        next += d->corners;
        d->used = d->corners >= SOLVE_MIN_CORNERS;
    }
    if (left_out > 1)
        sst_log_warning("%d such corners are left out", left_out);
    return 0;
}

/* Copy the given intrinsics. */
static int copy_lenses(struct solve_problem *p, const struct sst_detections *all, const struct sst_calib *given)
{
    if (given->rows * given->cols != p->views && !p->rig) {
        sst_log_error(
            "the given lenses are of %dx%d cameras, the detections of %dx%d; give the calibration of this array",
            given->rows, given->cols, all->rows, all->cols);
        return -EBADMSG;
    }
    if (given->width != all->width || given->height != all->height) {
        sst_log_error("the given lenses are for pictures of %dx%d, these have %dx%d; give lenses of the same size",
                      given->width, given->height, all->width, all->height);
        return -EBADMSG;
    }
    p->keep_lens = true;
    p->lens = 0;
    for (int v = 0; v < p->views; v++) {
        const struct sst_calib_camera *from = &given->camera[p->rig ? given->reference : v];
        double *lens = p->camera[v].lens;

        if (!from->known && all->camera_name[v][0]) {
            char name[128];

            sst_log_error("the given lenses do not include %s; calibrate it, or solve its lens too",
                          solve_name(all, v, name));
            return -EBADMSG;
        }
        lens[0] = from->fx, lens[1] = from->fy, lens[2] = from->cx, lens[3] = from->cy;
        memcpy(lens + 4, from->k, sizeof(from->k));
        p->lens = sst_max_int(p->lens, from->lens);
    }
    return 0;
}

int solve_problem_make(struct solve_problem *out, const struct sst_detections *all, const struct sst_solve_config *cfg)
{
    const int views = all->rows * all->cols;
    struct solve_problem p = { .views = views,
                               .frames = all->frames,
                               .count = all->count,
                               .width = all->width,
                               .height = all->height,
                               .lens = cfg->lens == 8 ? 8 : 5,
                               .rig = all->rig,
                               .keep_warp = cfg->flat,
                               .threads = cfg->threads,
                               .reference = (all->rows - 1) / 2 * all->cols + (all->cols - 1) / 2 };
    size_t corners = 0;
    int err = -ENOMEM;

    for (int i = 0; i < all->count; i++)
        corners += (size_t)all->detection[i].corners;
    p.camera = calloc((size_t)views, sizeof(*p.camera));
    p.frame = calloc((size_t)all->frames + 1, sizeof(*p.frame));
    p.detection = calloc((size_t)all->count + 1, sizeof(*p.detection));
    p.pool = calloc(corners + 1, sizeof(*p.pool));
    if (!p.camera || !p.frame || !p.detection || !p.pool)
        goto fail;
    err = copy_detections(&p, all, cfg);
    if (!err && cfg->lenses)
        err = copy_lenses(&p, all, cfg->lenses);
    if (err)
        goto fail;
    *out = p;
    return 0;
fail:
    solve_problem_fini(&p);
    return err;
}

/* The reference camera: the light field's, or the nearest one that saw the board. */
static void choose_reference(struct solve_case *c)
{
    const int cols = c->all->cols, wanted = c->p.reference;
    int64_t least = INT64_MAX;

    for (int i = 0; i < c->p.count; i++) {
        const int v = c->p.detection[i].view, row = v / cols - wanted / cols, col = v % cols - wanted % cols;
        const int64_t far = (int64_t)(row * row + col * col) * c->p.views + v;

        if (c->p.detection[i].used && far < least) {
            least = far;
            c->p.reference = v;
        }
    }
}

static void report_progress(const struct solve_case *c, double done)
{
    if (c->cfg->progress)
        c->cfg->progress(c->cfg->progress_arg, done);
}

/* Seeds, tree, robust fit: everything before outliers are dropped. */
static int begin(struct solve_case *c)
{
    int err = solve_check_corners(c);

    choose_reference(c);
    err = err ? err : solve_seed(&c->p, c->single);
    err = err ? err : solve_check_mirrored(c);
    err = err ? err : solve_links(&c->p, &c->s.link, &c->s.links);
    err = err ? err : solve_chain(&c->p, c->single, c->s.link, c->s.links);
    err = err ? err : solve_check_linked(c);
    report_progress(c, 0.3);
    return err;
}

static int fit(struct solve_case *c)
{
    int err = solve_soft(&c->p, &c->sigma_px);

    err = err ? err : solve_check_still(c);
    report_progress(c, 0.5);
    if (!err && !c->cfg->lens && !c->p.keep_lens)
        err = solve_choose_lens(c);
    report_progress(c, 0.7);
    err = err ? err : solve_hard(&c->p, c->cfg->plain, &c->sigma_px, &c->done);
    if (!err && !c->done.converged) {
        sst_log_error("the adjustment did not converge in %d steps, %.3g px of noise left: the corners contradict "
                      "each other or constrain too little; take more frames, near and far, and tilted",
                      c->done.evaluations, c->sigma_px);
        err = -EDOM;
    }
    report_progress(c, 0.8);
    return err ? err : solve_check_outliers(c);
}

/* Median depth of the boards' centres in front of the reference. */
static double board_range(const struct solve_case *c, double *depth)
{
    const int points = sst_board_points(&c->all->board);
    double first[2], last[2];
    int n = 0;

    sst_board_point(&c->all->board, 0, first);
    sst_board_point(&c->all->board, points - 1, last);
    for (int f = 0; f < c->p.frames; f++) {
        const double *r = c->p.frame[f].pose.rotation;

        if (c->p.frame[f].known)
            depth[n++] =
                c->p.frame[f].pose.shift[2] + r[6] * (first[0] + last[0]) / 2 + r[7] * (first[1] + last[1]) / 2;
    }
    return fmax(sst_stats_upper_median(depth, n), 0);
}

/* Map residuals of the used corners back to the detection's; all others are outliers without a residual. */
static void spread(struct sst_solve_view *view, const struct solve_detection *taken, const struct sst_detection *all)
{
    int n = taken->corners;

    for (int k = all->corners - 1; k >= n; k--) {
        const struct sst_corner *c = &all->corner[k];
        const struct solve_corner *last = n ? &taken->corner[n - 1] : NULL;

        if (last && last->id == c->id && last->x == c->x && last->y == c->y) {
            n--;
            memcpy(view->residual[k], view->residual[n], sizeof(view->residual[k]));
            view->outlier[k] = view->outlier[n];
        } else {
            memset(view->residual[k], 0, sizeof(view->residual[k]));
            view->outlier[k] = true;
            view->outliers++;
        }
    }
}

static int fill_views(struct solve_case *c)
{
    struct sst_solution *s = &c->s;
    double(*sum)[2] = calloc((size_t)(c->p.views + c->p.frames), sizeof(*sum)); /* squares, corners */

    if (!sum)
        return -ENOMEM;
    for (int i = 0; i < c->p.count; i++) {
        const struct solve_detection *d = &c->p.detection[i];
        struct sst_solve_view *view = &s->view[i];
        double square = 0;
        int used = 0;

        view->residual = calloc((size_t)c->all->detection[i].corners + 1, sizeof(*view->residual));
        view->outlier = calloc((size_t)c->all->detection[i].corners + 1, sizeof(*view->outlier));
        if (!view->residual || !view->outlier) {
            free(sum);
            return -ENOMEM;
        }
        if (c->p.camera[d->view].known && c->p.frame[d->frame].known)
            solve_residuals(&c->p, d, view->residual);
        for (int k = 0; k < d->corners; k++) {
            double *r = view->residual[k];

            r[0] = -r[0];
            r[1] = -r[1];
            view->outlier[k] = !d->used || d->corner[k].out;
            view->outliers += view->outlier[k];
            if (!view->outlier[k]) {
                square += r[0] * r[0] + r[1] * r[1];
                used++;
            }
        }
        spread(view, d, &c->all->detection[i]);
        view->rms_px = used ? sqrt(square / used) : 0;
        sum[d->view][0] += square;
        sum[d->view][1] += used;
        sum[c->p.views + d->frame][0] += square;
        sum[c->p.views + d->frame][1] += used;
        s->corners += used;
        s->outliers += view->outliers;
    }
    for (int v = 0; v < c->p.views; v++) {
        s->calib.camera[v].corners = (int)sum[v][1];
        s->calib.camera[v].rms_px = sum[v][1] > 0 ? sqrt(sum[v][0] / sum[v][1]) : 0;
        s->rms_px += sum[v][0];
    }
    for (int f = 0; f < c->p.frames; f++)
        s->frame[f].rms_px = sum[c->p.views + f][1] > 0 ? sqrt(sum[c->p.views + f][0] / sum[c->p.views + f][1]) : 0;
    s->rms_px = s->corners ? sqrt(s->rms_px / s->corners) : 0;
    free(sum);
    return 0;
}

static void fill_cameras(struct solve_case *c)
{
    struct sst_solution *s = &c->s;

    s->calib.width = c->all->width;
    s->calib.height = c->all->height;
    s->calib.reference = c->p.reference;
    s->calib.rig = c->all->rig;
    sst_board_format(&c->all->board, s->calib.board);
    for (int v = 0; v < c->p.views; v++) {
        struct sst_calib_camera *to = &s->calib.camera[v];
        const struct solve_camera *from = &c->p.camera[v];

        memcpy(to->name, c->all->camera_name[v], sizeof(to->name));
        to->known = from->known;
        if (!from->known)
            continue;
        to->fx = from->lens[0], to->fy = from->lens[1], to->cx = from->lens[2], to->cy = from->lens[3];
        to->lens = c->p.lens;
        memcpy(to->k, from->lens + 4, sizeof(to->k));
        memcpy(to->rotation, from->pose.rotation, sizeof(to->rotation));
        solve_centre(from, to->position_mm);
        for (int i = 0; i < 3; i++)
            to->position_mm[i] += 0.0; /* no -0 in the file */
    }
    for (int f = 0; f < c->p.frames; f++) {
        s->frame[f].known = c->p.frame[f].known;
        memcpy(s->frame[f].rotation, c->p.frame[f].pose.rotation, sizeof(s->frame[f].rotation));
        memcpy(s->frame[f].position_mm, c->p.frame[f].pose.shift, sizeof(s->frame[f].position_mm));
    }
}

static int fill_maps(struct solve_case *c)
{
    struct sst_solution *s = &c->s;
    struct solve_covariance cov;
    int err = solve_covariances(&cov, &c->p, solve_unit_sigma(&c->done));

    if (err == -EDOM)
        return solve_reject(c->cfg, "the corners do not determine every camera's lens and pose; take more frames, "
                                    "near and far, tilted, and seen by several cameras at once");
    if (err)
        return err;
    err = solve_check_focal(c, &cov);
    for (int v = 0; v < c->p.views && !err; v++) {
        if (!c->p.camera[v].known)
            continue;
        solve_lens_map(&c->p, &cov, v, 1, s->lens_sigma[v]);
        solve_transfer_map(&c->p, &cov, v, 0, s->transfer_sigma[v][0]);
        solve_transfer_map(&c->p, &cov, v, s->calib.range_mm, s->transfer_sigma[v][1]);
        s->calib.camera[v].sigma_px = fmax(sst_uncertainty_rms(s->transfer_sigma[v][1]), 0);
    }
    solve_covariance_fini(&cov);
    return err;
}

static int allocate(struct sst_solution *s, const struct sst_detections *all)
{
    const size_t views = (size_t)(all->rows * all->cols), frames = (size_t)all->frames;
    const int err = sst_calib_init(&s->calib, all->rows, all->cols);

    if (err)
        return err;
    s->view = calloc((size_t)all->count + 1, sizeof(*s->view));
    s->frame = calloc(frames + 1, sizeof(*s->frame));
    s->lens_sigma = malloc(views * sizeof(*s->lens_sigma));
    s->transfer_sigma = malloc(views * sizeof(*s->transfer_sigma));
    if (!s->view || !s->frame || !s->lens_sigma || !s->transfer_sigma)
        return -ENOMEM;
    for (size_t v = 0; v < views; v++) {
        for (int i = 0; i < SST_UNCERTAINTY_ROWS * SST_UNCERTAINTY_COLS; i++) {
            (&s->lens_sigma[v][0][0])[i] = NAN;
            (&s->transfer_sigma[v][0][0][0])[i] = (&s->transfer_sigma[v][1][0][0])[i] = NAN;
        }
    }
    return 0;
}

static int fill(struct solve_case *c)
{
    struct sst_solution *s = &c->s;
    double *depth = malloc((size_t)(c->p.frames + 1) * sizeof(*depth));
    int err;

    if (!depth)
        return -ENOMEM;
    fill_cameras(c);
    s->calib.range_mm = board_range(c, depth);
    free(depth);
    err = fill_views(c);
    err = err ? err : fill_maps(c);
    if (err)
        return err;
    s->lens = c->p.lens;
    s->states = c->done.states;
    s->measurements = c->done.measurements;
    s->iterations = c->done.evaluations;
    s->rcond = c->done.rcond;
    memcpy(s->warp_mm, c->p.warp, sizeof(s->warp_mm));
    s->predicted_rms_px = sqrt(2) * c->sigma_px;
    s->noise_px = c->sigma_px / sqrt(fmax(1 - (double)s->states / fmax(s->measurements, 1), 1e-3));
    s->calib.noise_px = s->noise_px;
    s->weakest = -1;
    for (int i = 0; i < s->links; i++) {
        if (s->link[i].tree && (s->weakest < 0 || s->link[i].corners < s->link[s->weakest].corners))
            s->weakest = i;
    }
    return 0;
}

static void check_border(const struct sst_calib *calib)
{
    for (int k = 0; k < calib->rows * calib->cols; k++) {
        const struct sst_calib_camera *c = &calib->camera[k];

        if (!c->known)
            continue;
        sst_border_doubles("camera of the calibration", (const double[]){ c->fx, c->fy, c->cx, c->cy, c->rms_px }, 5);
        sst_border_doubles("lens of the calibration", c->k, (size_t)c->lens);
        sst_border_doubles("rotation of the calibration", c->rotation, 9);
        sst_border_doubles("position of the calibration", c->position_mm, 3);
    }
}

int sst_solve(struct sst_solution *out, const struct sst_detections *all, const struct sst_solve_config *cfg)
{
    const int64_t start_ns = sst_clock_now_ns();
    struct solve_case c = { .all = all,
                            .cfg = cfg,
                            .s = { .cv_px = NAN,
                                   .cv_expected_px = NAN,
                                   .cv_camera = -1,
                                   .drive_rms_mm = NAN,
                                   .drive_scale = NAN,
                                   .drive_skew_deg = NAN } };
    int err;

    if (!WITH_DOGLEG) {
        sst_log_error("this build has no calibration solver; install libdogleg-dev and rebuild");
        return -ENOTSUP;
    }
    err = solve_problem_make(&c.p, all, cfg);
    if (err)
        return err;
    c.single = calloc((size_t)all->count + 1, sizeof(*c.single));
    err = c.single ? allocate(&c.s, all) : -ENOMEM;
    err = err ? err : begin(&c);
    err = err ? err : fit(&c);
    err = err ? err : solve_check_places(&c);
    err = err ? err : solve_compare_drives(&c);
    if (!err && cfg->cross_validate)
        err = solve_cross_validate(&c);
    report_progress(&c, 0.95);
    err = err ? err : fill(&c);
    if (!err) {
        c.s.seconds = (double)(sst_clock_now_ns() - start_ns) * 1e-9;
        check_border(&c.s.calib);
        *out = c.s;
        c.s = (struct sst_solution){ 0 };
        report_progress(&c, 1);
    }
    sst_solution_fini(&c.s);
    free(c.single);
    solve_problem_fini(&c.p);
    return err;
}

void sst_solution_fini(struct sst_solution *solution)
{
    /* view has one more element than detections; the first without residuals ends the list */
    for (int i = 0; solution->view && (solution->view[i].residual || solution->view[i].outlier); i++) {
        free(solution->view[i].residual);
        free(solution->view[i].outlier);
    }
    free(solution->view);
    free(solution->frame);
    free(solution->link);
    free(solution->lens_sigma);
    free(solution->transfer_sigma);
    free(solution->drive_residual_mm);
    sst_calib_fini(&solution->calib);
    *solution = (struct sst_solution){ 0 };
}
