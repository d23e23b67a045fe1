/*
 * tests/calib_truth.h - a synthetic array, boards in front of it, and the corners that its cameras see: exact truth
 * for calibration. Everything follows from the settings and the seed.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_CALIB_TRUTH_H
#define SST_TESTS_CALIB_TRUTH_H

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/calibration/board/detect.h"
#include "tests/camera_project.h"
#include "tests/random.h"

struct truth_config {
    int rows, cols, width, height, frames;
    struct sst_board board;
    uint64_t seed;
    double focal_px, focal_spread, centre_spread_px; /* spread: one sigma, of the focal length relative */
    int lens;                                        /* 0, 5 or 8 */
    double k[SST_LENS_MAX], k_spread;                /* of k1; the other radial ones' is a third and a tenth of it */
    double spacing_mm, place_sigma_mm, turn_sigma_deg;
    double near_mm, far_mm, tilt_deg; /* of boards; tilt: largest */
    double aside;                     /* board centres reach this far towards the edge of the picture: 0..1 */
    double warp_mm[2];                /* as struct sst_solution has it */
    double noise_px;                  /* one axis, one sigma */
    double outliers, outlier_px;      /* share of corners moved, and how far at most along each axis */
    double corners, detections;       /* shares that are kept, at random; corners: of those in the picture */
    bool rig;
    double drive_scale, drive_sigma_mm; /* rig: what the drives report over where the camera is, and its noise */
};

struct truth_frame {
    double rotation[9], position_mm[3];
};

struct truth {
    struct truth_config cfg;
    struct sst_calib calib;
    struct truth_frame *frame; /* [frames] */
    struct sst_detections all;
    bool **outlier; /* [all.count][corners]: moved on purpose */
    int made;       /* detections that there were at first */
    uint64_t state;
};

/* 6x6 cameras of 2000x1500 px, 100 frames of a board with 150 points. */
static inline struct truth_config truth_defaults(void)
{
    return (struct truth_config){
        .rows = 6,
        .cols = 6,
        .width = 2000,
        .height = 1500,
        .frames = 100,
        .board = { .kind = SST_BOARD_CHARUCO, .cols = 16, .rows = 11, .square_mm = 40, .marker = 0.7 },
        .seed = 1,
        .focal_px = 2250,
        .focal_spread = 0.01,
        .centre_spread_px = 15,
        .lens = 5,
        .k = { -0.12, 0.05, 0.0004, -0.0003, 0.01 },
        .k_spread = 0.01,
        .spacing_mm = 60,
        .place_sigma_mm = 1,
        .turn_sigma_deg = 0.5,
        .near_mm = 900,
        .far_mm = 2200,
        .tilt_deg = 40,
        .aside = 0.9,
        .noise_px = 0.1,
        .outlier_px = 20,
        .corners = 1,
        .detections = 1,
        .drive_scale = 1,
    };
}

/* The same, small: 2x2 cameras of 640x480 px, 24 frames of a board with 48 points. */
static inline struct truth_config truth_small(void)
{
    struct truth_config cfg = truth_defaults();

    cfg.rows = cfg.cols = 2;
    cfg.width = 640, cfg.height = 480, cfg.frames = 24;
    cfg.board = (struct sst_board){ .kind = SST_BOARD_CHARUCO, .cols = 9, .rows = 7, .square_mm = 60, .marker = 0.7 };
    cfg.focal_px = 720, cfg.centre_spread_px = 5;
    return cfg;
}

static inline void truth_cameras(struct truth *t)
{
    const struct truth_config *c = &t->cfg;

    t->calib.width = c->width;
    t->calib.height = c->height;
    t->calib.rig = c->rig;
    for (int view = 0; view < c->rows * c->cols; view++) {
        const bool first = view == t->calib.reference;
        struct sst_calib_camera *cam = &t->calib.camera[view];
        const double step[3] = { view % c->cols - t->calib.reference % c->cols,
                                 view / c->cols - t->calib.reference / c->cols, 0 };
        double turn[3];

        cam->known = true;
        snprintf(cam->name, sizeof(cam->name), "%02d_%02d", view / c->cols, view % c->cols);
        cam->lens = c->lens;
        cam->fx = c->focal_px * (1 + c->focal_spread * test_normal(&t->state));
        cam->fy = cam->fx * (1 + 0.001 * test_normal(&t->state));
        cam->cx = (c->width - 1) / 2.0 + c->centre_spread_px * test_normal(&t->state);
        cam->cy = (c->height - 1) / 2.0 + c->centre_spread_px * test_normal(&t->state);
        memcpy(cam->k, c->k, sizeof(cam->k));
        cam->k[0] += c->k_spread * test_normal(&t->state);
        cam->k[1] += c->k_spread / 3 * test_normal(&t->state);
        cam->k[4] += c->k_spread / 10 * test_normal(&t->state);
        for (int i = 0; i < 3; i++) {
            turn[i] = first ? 0 : c->turn_sigma_deg * M_PI / 180 * test_normal(&t->state);
            cam->position_mm[i] = first ? 0 : c->spacing_mm * step[i] + c->place_sigma_mm * test_normal(&t->state);
        }
        sst_rotation_from_vector(turn, cam->rotation);
        if (c->rig) {
            const struct sst_calib_camera *lens = &t->calib.camera[0];

            cam->fx = lens->fx, cam->fy = lens->fy, cam->cx = lens->cx, cam->cy = lens->cy;
            memcpy(cam->k, lens->k, sizeof(cam->k));
        }
    }
}

/* Board's middle on a ray of the reference camera, tilted about an axis in its plane and turned in it. */
static inline void truth_boards(struct truth *t)
{
    const struct truth_config *c = &t->cfg;
    const int last = sst_board_points(&c->board) - 1;
    double middle[2], far_end[2];

    sst_board_point(&c->board, 0, middle);
    sst_board_point(&c->board, last, far_end);
    for (int i = 0; i < 2; i++)
        middle[i] = (middle[i] + far_end[i]) / 2;
    for (int f = 0; f < c->frames; f++) {
        struct truth_frame *to = &t->frame[f];
        const double z = c->near_mm * pow(c->far_mm / c->near_mm, sst_random(&t->state));
        /* Fields of a 5x5 raster in turn, so that a few frames already reach everywhere. */
        const double u = ((f * 7 % 25) % 5 - 2 + sst_random(&t->state) - 0.5) / 2.5;
        const double v = ((f * 7 % 25) / 5 - 2 + sst_random(&t->state) - 0.5) / 2.5;
        const double tilt = c->tilt_deg * M_PI / 180 * sqrt(sst_random(&t->state));
        const double towards = 2 * M_PI * sst_random(&t->state), roll = 0.3 * test_normal(&t->state);
        const double lean[3] = { tilt * cos(towards), tilt * sin(towards), 0 }, spin[3] = { 0, 0, roll };
        double a[9], b[9];
        const double at[3] = { z * u * c->aside * c->width / 2 / c->focal_px,
                               z * v * c->aside * c->height / 2 / c->focal_px, z };

        sst_rotation_from_vector(lean, a);
        sst_rotation_from_vector(spin, b);
        for (int i = 0; i < 9; i++)
            to->rotation[i] =
                a[i / 3 * 3] * b[i % 3] + a[i / 3 * 3 + 1] * b[3 + i % 3] + a[i / 3 * 3 + 2] * b[6 + i % 3];
        for (int i = 0; i < 3; i++)
            to->position_mm[i] = at[i] - to->rotation[3 * i] * middle[0] - to->rotation[3 * i + 1] * middle[1];
    }
}

/* Board point in the frame, rig axes. */
static inline void truth_point(const struct truth *t, int frame, int id, double X[3])
{
    const struct truth_frame *f = &t->frame[frame];
    double p[3], first[2], last[2];
    double bulge[2];

    sst_board_point(&t->cfg.board, id, p);
    sst_board_point(&t->cfg.board, 0, first);
    sst_board_point(&t->cfg.board, sst_board_points(&t->cfg.board) - 1, last);
    for (int i = 0; i < 2; i++) {
        const double u = 2 * (p[i] - first[i]) / (last[i] - first[i]) - 1;

        bulge[i] = 1 - u * u;
    }
    p[2] = t->cfg.warp_mm[0] * bulge[0] + t->cfg.warp_mm[1] * bulge[1];
    for (int i = 0; i < 3; i++)
        X[i] = f->rotation[3 * i] * p[0] + f->rotation[3 * i + 1] * p[1] + f->rotation[3 * i + 2] * p[2] +
               f->position_mm[i];
}

/* The detection of a view in a frame, appended unless it is less than 6 points. */
static inline void truth_see(struct truth *t, int view, int frame)
{
    const struct truth_config *c = &t->cfg;
    const int points = sst_board_points(&c->board);
    struct sst_detection d = { .view = view, .frame = frame, .blur_px = 0.7, .blur_aspect = 1 };
    bool *moved = calloc((size_t)points, sizeof(*moved));

    d.corner = calloc((size_t)points, sizeof(*d.corner));
    assert(d.corner && moved);
    for (int id = 0; id < points; id++) {
        const double off[2] = { test_normal(&t->state), test_normal(&t->state) };
        const double far_off[2] = { sst_random(&t->state), sst_random(&t->state) };
        const bool kept = sst_random(&t->state) < c->corners, out = sst_random(&t->state) < c->outliers;
        double X[3], x, y;

        truth_point(t, frame, id, X);
        if (!kept || !camera_project(&t->calib.camera[view], X, &x, &y) || x < 4 || y < 4 || x > c->width - 5 ||
            y > c->height - 5)
            continue;
        x += c->noise_px * off[0] + (out ? c->outlier_px * (2 * far_off[0] - 1) : 0);
        y += c->noise_px * off[1] + (out ? c->outlier_px * (2 * far_off[1] - 1) : 0);
        moved[d.corners] = out;
        d.corner[d.corners++] = (struct sst_corner){ .id = id, .x = x, .y = y, .weight = 1 };
    }
    if (d.corners < 6 || sst_random(&t->state) >= c->detections) {
        free(d.corner);
        free(moved);
        return;
    }
    t->outlier = realloc(t->outlier, (size_t)(t->all.count + 1) * sizeof(*t->outlier));
    assert(t->outlier);
    t->outlier[t->all.count] = moved;
    t->made++;
    if (sst_detections_add(&t->all, &d))
        abort();
}

static inline void truth_drives(struct truth *t)
{
    const int views = t->cfg.rows * t->cfg.cols;

    t->all.rig = true;
    t->all.drive_mm = calloc((size_t)views, sizeof(*t->all.drive_mm));
    assert(t->all.drive_mm);
    for (int view = 0; view < views; view++) {
        for (int i = 0; i < 3; i++)
            t->all.drive_mm[view][i] = t->cfg.drive_scale * t->calib.camera[view].position_mm[i] +
                                       t->cfg.drive_sigma_mm * test_normal(&t->state);
    }
}

static inline void truth_make(struct truth *t, const struct truth_config *cfg)
{
    *t = (struct truth){ .cfg = *cfg, .state = cfg->seed };
    if (sst_calib_init(&t->calib, cfg->rows, cfg->cols) ||
        sst_detections_init(&t->all, &(struct sst_detections){ .board = cfg->board,
                                                               .rows = cfg->rows,
                                                               .cols = cfg->cols,
                                                               .width = cfg->width,
                                                               .height = cfg->height }))
        abort();
    t->frame = calloc((size_t)cfg->frames, sizeof(*t->frame));
    assert(t->frame);
    truth_cameras(t);
    truth_boards(t);
    for (int view = 0; view < cfg->rows * cfg->cols; view++)
        memcpy(t->all.camera_name[view], t->calib.camera[view].name, sizeof(t->all.camera_name[view]));
    for (int f = 0; f < cfg->frames; f++) {
        char name[32];

        snprintf(name, sizeof(name), "frame%03d", f);
        if (sst_detections_frame(&t->all, name) != f)
            abort();
        for (int view = 0; view < cfg->rows * cfg->cols; view++)
            truth_see(t, view, f);
    }
    if (cfg->rig)
        truth_drives(t);
}

static inline void truth_free(struct truth *t)
{
    for (int i = 0; i < t->made; i++)
        free(t->outlier[i]);
    free(t->outlier);
    free(t->frame);
    sst_detections_fini(&t->all);
    sst_calib_fini(&t->calib);
}

#endif
