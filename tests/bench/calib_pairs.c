/*
 * Real chessboards of a pair of cameras, found and solved as plain least squares, so that another program can do the
 * same with the same corners: make build/bench/calib_pairs && build/bench/calib_pairs FOLDER BOARD FOLDER has
 * leftNN.jpg and rightNN.jpg. One JSON object: the solution's figures, and all corners, [view, frame, [x, y, x, y ...]]
 * by ascending id. scripts/bench_calib.py runs it for docs/measured/bench-calibration.md.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "base/file.h"
#include "pipeline/calibration/solve/solve.h"
#include "pipeline/image/codec.h"

#define FRAMES_MAX 100

static const char *const sides[2] = { "left", "right" };

/* Add the detection of a picture. @return 0, or a negative errno; no board is no error */
static int look(struct sst_detections *all, const char *path, int view, int frame)
{
    const struct sst_detect_config cfg = { 0 };
    struct sst_image image = { 0 };
    struct sst_detection found = { 0 };
    enum sst_detect_outcome outcome;
    int err = sst_image_read(&image, path);

    if (!err)
        err = sst_board_detect(&all->board, &image, &cfg, &found, &outcome);
    if (!err && outcome == SST_DETECT_FOUND) {
        found.view = view;
        found.frame = frame;
        err = sst_detections_add(all, &found);
    } else {
        sst_detection_fini(&found);
    }
    sst_image_fini(&image);
    return err;
}

/* Pictures of one moment, as far as they are there. */
static int look_at_pair(struct sst_detections *all, const char *folder, int number)
{
    int frame = -1, err = 0;

    for (int view = 0; view < 2 && !err; view++) {
        char name[32], path[SST_PATH_MAX];

        snprintf(name, sizeof(name), "%s%02d.jpg", sides[view], number);
        err = sst_path_join(path, folder, name);
        if (err || !sst_path_exists(path))
            continue;
        snprintf(name, sizeof(name), "%02d", number);
        frame = frame < 0 ? sst_detections_frame(all, name) : frame;
        err = frame < 0 ? frame : look(all, path, view, frame);
    }
    return err;
}

static int begin(struct sst_detections *all, const char *folder, const struct sst_board *board)
{
    struct sst_image image = { 0 };
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, folder, "left01.jpg");

    if (!err)
        err = sst_image_read(&image, path);
    if (!err)
        err = sst_detections_init(
            all, &(struct sst_detections){
                     .board = *board, .rows = 1, .cols = 2, .width = image.width, .height = image.height });
    sst_image_fini(&image);
    for (int view = 0; view < 2 && !err; view++)
        snprintf(all->camera_name[view], sizeof(all->camera_name[view]), "%s", sides[view]);
    return err;
}

static json_t *corners_of(const struct sst_detections *all)
{
    json_t *out = json_array();

    for (int i = 0; i < all->count; i++) {
        const struct sst_detection *d = &all->detection[i];
        json_t *at = json_array();

        for (int k = 0; k < d->corners; k++) {
            json_array_append_new(at, json_real(d->corner[k].x));
            json_array_append_new(at, json_real(d->corner[k].y));
        }
        json_array_append_new(out, json_pack("[i, i, o]", d->view, d->frame, at));
    }
    return out;
}

static int solve(const struct sst_detections *all)
{
    const struct sst_solve_config cfg = { .lens = 5, .plain = true, .flat = true, .force = true, .threads = 1 };
    struct sst_solution s;
    const int err = sst_solve(&s, all, &cfg);
    json_t *out;

    if (err)
        return err;
    out = json_pack("{s:i, s:i, s:f, s:f, s:f, s:f, s:f, s:f, s:i, s:i, s:o}", "detections", all->count, "corners",
                    s.corners, "rms_px", s.rms_px, "left_px", s.calib.camera[0].rms_px, "right_px",
                    s.calib.camera[1].rms_px, "focal_px", s.calib.camera[0].fx, "baseline_mm",
                    hypot(hypot(s.calib.camera[1].position_mm[0] - s.calib.camera[0].position_mm[0],
                                s.calib.camera[1].position_mm[1] - s.calib.camera[0].position_mm[1]),
                          s.calib.camera[1].position_mm[2] - s.calib.camera[0].position_mm[2]),
                    "seconds", s.seconds, "width", all->width, "height", all->height, "found", corners_of(all));
    json_dumpf(out, stdout, JSON_COMPACT);
    printf("\n");
    json_decref(out);
    sst_solution_fini(&s);
    return 0;
}

int main(int argc, char **argv)
{
    struct sst_detections all = { 0 };
    struct sst_board board;
    int err;

    if (argc != 3) {
        fprintf(stderr, "usage: calib_pairs FOLDER BOARD\n");
        return 2;
    }
    err = sst_board_parse(&board, argv[2]);
    if (!err)
        err = begin(&all, argv[1], &board);
    for (int number = 1; number < FRAMES_MAX && !err; number++)
        err = look_at_pair(&all, argv[1], number);
    if (!err)
        err = solve(&all);
    sst_detections_fini(&all);
    return err ? EXIT_FAILURE : EXIT_SUCCESS;
}
