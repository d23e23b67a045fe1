/*
 * tests/calib_solution.h - a synthetic calibration solution with random residuals, to test reports of solutions;
 * nothing is solved here. Everything follows from the settings and the seed.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_CALIB_SOLUTION_H
#define SST_TESTS_CALIB_SOLUTION_H

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/calibration/solve/solve.h"
#include "tests/random.h"

struct made_config {
    int rows, cols, width, height, frames;
    int across, down;   /* points of the board */
    double noise_px;    /* per axis */
    double outliers;    /* share */
    int hole, unsolved; /* views that are not there, and there but not solved; -1 none */
    int bent, moved;    /* a view whose lens does not fit; a frame taken in motion; -1 none */
    bool rig;
    uint64_t seed;
};

struct made {
    struct made_config cfg;
    struct sst_detections all;
    struct sst_solution solution;
    uint64_t state;
};

static inline struct made_config made_defaults(void)
{
    return (struct made_config){ .rows = 6,
                                 .cols = 6,
                                 .width = 2000,
                                 .height = 1500,
                                 .frames = 100,
                                 .across = 15,
                                 .down = 10,
                                 .noise_px = 0.1,
                                 .outliers = 0.003,
                                 .hole = -1,
                                 .unsolved = -1,
                                 .bent = -1,
                                 .moved = -1,
                                 .seed = 1 };
}

static inline void *made_array(size_t count, size_t size)
{
    void *p = calloc(count ? count : 1, size);

    assert(p);
    return p;
}

static inline void made_maps(struct made *m, int view)
{
    struct sst_solution *s = &m->solution;
    const bool known = s->calib.camera[view].known;

    for (int i = 0; i < SST_UNCERTAINTY_ROWS * SST_UNCERTAINTY_COLS; i++) {
        const int row = i / SST_UNCERTAINTY_COLS, col = i % SST_UNCERTAINTY_COLS;
        const double x = (col + 0.5) / SST_UNCERTAINTY_COLS - 0.5, y = (row + 0.5) / SST_UNCERTAINTY_ROWS - 0.5;
        const double r2 = x * x + y * y, away = abs(view - s->calib.reference);

        s->lens_sigma[view][row][col] = known ? (float)(0.004 + 0.05 * r2 * r2) : NAN;
        for (int range = 0; range < 2; range++)
            s->transfer_sigma[view][range][row][col] =
                known ? (float)(away > 0 ? 0.012 + 0.001 * away + 0.08 * r2 * r2 - 0.004 * range : 0) : NAN;
    }
}

static inline void made_cameras(struct made *m)
{
    const struct made_config *c = &m->cfg;
    struct sst_solution *s = &m->solution;

    for (int k = 0; k < c->rows * c->cols; k++) {
        struct sst_calib_camera *cam = &s->calib.camera[k];
        const double turn[3] = { 0.004 * test_normal(&m->state), 0.004 * test_normal(&m->state),
                                 0.004 * test_normal(&m->state) };
        const int right = k % c->cols - s->calib.reference % c->cols, down = k / c->cols - s->calib.reference / c->cols;

        if (k != c->hole)
            snprintf(m->all.camera_name[k], 64, "SIM%04d", k);
        cam->known = k != c->hole && k != c->unsolved;
        made_maps(m, k);
        if (!cam->known)
            continue;
        snprintf(cam->name, sizeof(cam->name), "SIM%04d", k);
        cam->fx = 2250 + 5 * test_normal(&m->state);
        cam->fy = cam->fx * 1.0003;
        cam->cx = c->width / 2.0 + 8 * test_normal(&m->state);
        cam->cy = c->height / 2.0 + 8 * test_normal(&m->state);
        cam->lens = 5;
        cam->k[0] = -0.11 + 0.003 * test_normal(&m->state);
        cam->k[1] = 0.04;
        cam->falloff[0] = -0.25 + 0.02 * test_normal(&m->state);
        cam->gain[1] = 1 + 0.02 * test_normal(&m->state);
        cam->sigma_px = 0.02 + 0.0005 * k;
        if (k == s->calib.reference)
            continue;
        sst_rotation_from_vector(turn, cam->rotation);
        cam->position_mm[0] = 60 * right + 0.5 * test_normal(&m->state);
        cam->position_mm[1] = 60 * down + 0.5 * test_normal(&m->state);
        cam->position_mm[2] = 0.7 * test_normal(&m->state);
    }
}

/* One corner's residual, and whether it is an outlier. */
static inline bool made_residual(struct made *m, int view, int frame, const struct sst_corner *c, double e[2])
{
    const struct made_config *g = &m->cfg;
    const double x = c->x / g->width - 0.5, y = c->y / g->height - 0.5;
    const bool outlier = sst_random(&m->state) < g->outliers;

    for (int i = 0; i < 2; i++)
        e[i] = outlier ? 20 * sst_random(&m->state) - 10 : g->noise_px * test_normal(&m->state);
    if (view == g->bent) {
        e[0] += 3 * g->noise_px * x * (4 * (x * x + y * y) - 0.5) * 2;
        e[1] += 3 * g->noise_px * y * (4 * (x * x + y * y) - 0.5) * 2;
    }
    if (frame == g->moved)
        e[0] += 4 * g->noise_px * test_normal(&m->state);
    return outlier;
}

/* The board somewhere in the frame, turned, as one camera sees it; corners outside of the picture are missing. */
static inline void made_detection(struct made *m, int view, int frame, const double place[5])
{
    const struct made_config *c = &m->cfg;
    struct sst_detection *d = &m->all.detection[m->all.count];
    struct sst_solve_view *v = &m->solution.view[m->all.count];
    const int points = c->across * c->down;

    *d = (struct sst_detection){ .view = view,
                                 .frame = frame,
                                 .corner = made_array((size_t)points, sizeof(*d->corner)) };
    *v = (struct sst_solve_view){ .residual = made_array((size_t)points, sizeof(*v->residual)),
                                  .outlier = made_array((size_t)points, sizeof(*v->outlier)) };
    for (int id = 0; id < points; id++) {
        const double u = (id % c->across - (c->across - 1) / 2.0) * place[2];
        const double w = (id / c->across - (c->down - 1) / 2.0) * place[2] * place[4];
        const double x = place[0] + u * cos(place[3]) - w * sin(place[3]) - view % c->cols * place[2] * 0.7;
        const double y = place[1] + u * sin(place[3]) + w * cos(place[3]) - view / c->cols * place[2] * 0.7;

        if (x < 4 || y < 4 || x > c->width - 5 || y > c->height - 5)
            continue;
        d->corner[d->corners] = (struct sst_corner){ .id = id, .x = x, .y = y, .weight = 1 };
        v->outlier[d->corners] = made_residual(m, view, frame, &d->corner[d->corners], v->residual[d->corners]);
        v->outliers += v->outlier[d->corners++];
    }
    if (d->corners >= 6) {
        m->all.count++;
    } else {
        free(d->corner);
        free(v->residual);
        free(v->outlier);
    }
}

/* RMS of everything, as the contracts of struct sst_solution say. */
static inline void made_sums(struct made *m)
{
    struct sst_solution *s = &m->solution;
    const int views = m->cfg.rows * m->cfg.cols;
    double *frame = made_array((size_t)m->cfg.frames, sizeof(*frame)),
           *camera = made_array((size_t)views, sizeof(*camera));
    int *n = made_array((size_t)m->cfg.frames, sizeof(*n));
    double all = 0;

    for (int i = 0; i < m->all.count; i++) {
        const struct sst_detection *d = &m->all.detection[i];
        struct sst_solve_view *v = &s->view[i];
        double sum = 0;

        for (int j = 0; j < d->corners; j++) {
            if (!v->outlier[j])
                sum += v->residual[j][0] * v->residual[j][0] + v->residual[j][1] * v->residual[j][1];
        }
        v->rms_px = d->corners > v->outliers ? sqrt(sum / (d->corners - v->outliers)) : (double)NAN;
        all += sum, frame[d->frame] += sum, camera[d->view] += sum;
        n[d->frame] += d->corners - v->outliers;
        s->calib.camera[d->view].corners += d->corners - v->outliers;
        s->corners += d->corners - v->outliers;
        s->outliers += v->outliers;
    }
    s->rms_px = s->corners ? sqrt(all / s->corners) : (double)NAN;
    for (int i = 0; i < m->cfg.frames; i++) {
        s->frame[i].known = n[i] > 0;
        s->frame[i].rms_px = n[i] ? sqrt(frame[i] / n[i]) : (double)NAN;
    }
    for (int k = 0; k < views; k++) {
        if (s->calib.camera[k].corners)
            s->calib.camera[k].rms_px = sqrt(camera[k] / s->calib.camera[k].corners);
    }
    free(frame);
    free(camera);
    free(n);
}

/* Every pair, with a chain along the rows as the tree. */
static inline void made_links(struct made *m)
{
    struct sst_solution *s = &m->solution;
    const int views = m->cfg.rows * m->cfg.cols;

    s->link = made_array((size_t)views * (size_t)views / 2 + 1, sizeof(*s->link));
    s->weakest = -1;
    for (int a = 0; a < views; a++) {
        for (int b = a + 1; b < views; b++) {
            struct sst_solve_link *l = &s->link[s->links];
            const int apart = abs(a % m->cfg.cols - b % m->cfg.cols) + abs(a / m->cfg.cols - b / m->cfg.cols);

            if (!s->calib.camera[a].known || !s->calib.camera[b].known)
                continue;
            *l = (struct sst_solve_link){
                .a = a,
                .b = b,
                .frames = m->cfg.frames / apart,
                .corners = sst_min_int(s->calib.camera[a].corners, s->calib.camera[b].corners) / apart,
                .tree = apart == 1 && (b == a + 1 || b % m->cfg.cols == 0)
            };
            if (l->tree && (s->weakest < 0 || l->corners < s->link[s->weakest].corners))
                s->weakest = s->links;
            s->links++;
        }
    }
}

static inline void made_solution(struct made *m)
{
    const struct made_config *c = &m->cfg;
    struct sst_solution *s = &m->solution;

    s->lens = 5;
    s->warp_mm[0] = 0.12;
    s->warp_mm[1] = -0.03;
    s->noise_px = c->noise_px;
    s->states = 10 * c->rows * c->cols + 6 * c->frames;
    s->iterations = 9;
    s->seconds = 7.3;
    s->rcond = 3.2e-9;
    s->cv_px = 0.061;
    s->cv_expected_px = 0.052;
    s->drive_rms_mm = s->drive_scale = s->drive_skew_deg = (double)NAN;
    made_sums(m);
    made_links(m);
    s->measurements = 2 * s->corners;
    s->predicted_rms_px = sqrt(2) * c->noise_px * sqrt(fmax(0, 1 - (double)s->states / fmax(s->measurements, 1)));
    if (!c->rig)
        return;
    s->calib.rig = true;
    s->drive_rms_mm = 0.041, s->drive_scale = 1.0012, s->drive_skew_deg = 0.03;
    s->drive_residual_mm = made_array((size_t)(c->rows * c->cols), sizeof(*s->drive_residual_mm));
    for (int i = 0; i < 3 * c->rows * c->cols; i++)
        s->drive_residual_mm[i / 3][i % 3] = 0.03 * test_normal(&m->state);
}

static inline void made_open(struct made *m, const struct made_config *cfg)
{
    const size_t views = (size_t)(cfg->rows * cfg->cols), most = views * (size_t)cfg->frames;
    struct sst_solution *s = &m->solution;

    *m = (struct made){ .cfg = *cfg, .state = cfg->seed };
    m->all = (struct sst_detections){ .rows = cfg->rows,
                                      .cols = cfg->cols,
                                      .board = { .kind = SST_BOARD_CHARUCO,
                                                 .cols = sst_max_int(cfg->across, 4) + 1,
                                                 .rows = sst_max_int(cfg->down, 4) + 1,
                                                 .square_mm = 40,
                                                 .marker = 0.7 },
                                      .width = cfg->width,
                                      .height = cfg->height,
                                      .frames = cfg->frames,
                                      .rig = cfg->rig };
    m->all.frame_name = made_array((size_t)cfg->frames, sizeof(*m->all.frame_name));
    m->all.camera_name = made_array(views, sizeof(*m->all.camera_name));
    m->all.detection = made_array(most, sizeof(*m->all.detection));
    assert(!sst_calib_init(&s->calib, cfg->rows, cfg->cols));
    s->calib.width = cfg->width, s->calib.height = cfg->height, s->calib.range_mm = 1500;
    s->calib.created_wall_ns = 1700000000000000000;
    snprintf(s->calib.source, sizeof(s->calib.source), "boards/");
    snprintf(s->calib.board, sizeof(s->calib.board), "charuco:16x11:40mm:0.7");
    s->calib.noise_px = cfg->noise_px;
    s->view = made_array(most, sizeof(*s->view));
    s->frame = made_array((size_t)cfg->frames, sizeof(*s->frame));
    s->lens_sigma = made_array(views, sizeof(*s->lens_sigma));
    s->transfer_sigma = made_array(views, sizeof(*s->transfer_sigma));
    made_cameras(m);
    for (int frame = 0; frame < cfg->frames; frame++) {
        const double size = cfg->width / (cfg->across * (1.2 + 2.2 * sst_random(&m->state)));
        const double place[5] = { cfg->width * (0.1 + sst_random(&m->state)),
                                  cfg->height * (0.1 + sst_random(&m->state)), size, 0.5 * test_normal(&m->state),
                                  0.7 + 0.3 * sst_random(&m->state) };

        snprintf(m->all.frame_name[frame], 64, "frame%04d", frame);
        for (int k = 0; k < (int)views; k++) {
            if (s->calib.camera[k].known && sst_random(&m->state) < 0.9)
                made_detection(m, k, frame, place);
        }
    }
    made_solution(m);
}

static inline void made_close(struct made *m)
{
    for (int i = 0; i < m->all.count; i++) {
        free(m->all.detection[i].corner);
        free(m->solution.view[i].residual);
        free(m->solution.view[i].outlier);
    }
    free(m->all.detection);
    free(m->all.frame_name);
    free(m->all.camera_name);
    sst_calib_fini(&m->solution.calib);
    free(m->solution.view);
    free(m->solution.frame);
    free(m->solution.link);
    free(m->solution.lens_sigma);
    free(m->solution.transfer_sigma);
    free(m->solution.drive_residual_mm);
}

/* Everything that can be unknown is. */
static inline void made_forget(struct made *m)
{
    struct sst_solution *s = &m->solution;

    s->rms_px = s->predicted_rms_px = s->rcond = s->seconds = NAN;
    s->noise_px = s->calib.noise_px = s->calib.range_mm = 0;
    s->cv_px = s->cv_expected_px = NAN;
    s->warp_mm[0] = s->warp_mm[1] = NAN;
    s->weakest = -1;
    s->links = s->corners = s->outliers = 0;
    s->calib.created_wall_ns = 0;
    s->calib.source[0] = s->calib.board[0] = '\0';
    for (int k = 0; k < m->cfg.rows * m->cfg.cols; k++)
        s->calib.camera[k].rms_px = s->calib.camera[k].sigma_px = 0;
    for (int i = 0; i < m->all.frames; i++)
        s->frame[i].rms_px = NAN;
    for (int i = 0; i < m->all.count; i++) {
        s->view[i].rms_px = NAN;
        for (int j = 0; j < m->all.detection[i].corners; j++)
            s->view[i].residual[j][0] = s->view[i].residual[j][1] = NAN;
    }
}

#endif
