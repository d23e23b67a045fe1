/* pipeline/calibration/board/detect.h - detection of a board's points in pictures, and the list of detections. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CALIBRATION_BOARD_DETECT_H
#define SST_PIPELINE_CALIBRATION_BOARD_DETECT_H

#include "pipeline/calibration/board/board.h"
#include "pipeline/camera/calib.h"
#include "pipeline/image/image.h"

struct sst_corner {
    int id;        /* point of the board */
    double x, y;   /* px, pixel centres on integers */
    double weight; /* 1 / expected noise relative to the best corners: 0..1 */
};

/** The board in one picture. */
struct sst_detection {
    int view, frame;
    int corners;
    struct sst_corner *corner; /* in ascending order of id */
    double blur_px;            /* width (sigma) of the edges between squares, px; 0: unknown */
    double blur_aspect;        /* widest over narrowest direction: well above 1 is motion */
};

/** Result of the search in one picture. */
enum sst_detect_outcome {
    SST_DETECT_FOUND = 0,
    SST_DETECT_NONE = 1,    /* no board */
    SST_DETECT_FEW = 2,     /* too few points for a pose (below 6, or all on a line) */
    SST_DETECT_BLURRED = 3, /* edges wider than a limit */
    SST_DETECT_MOVING = 4,  /* edges wider in one direction than in the other, or the frame differs between cameras */
    SST_DETECT_OTHER_BOARD = 5, /* foreign markers or another number of squares */
};

/** All detections of a capture. In one frame the board has one position for all cameras. */
struct sst_detections {
    struct sst_board board;
    int rows, cols, width, height;
    int frames, frame_capacity;
    char (*frame_name)[64];  /* [frames]; for messages */
    char (*camera_name)[64]; /* [rows * cols]; "" for holes of the grid */
    int count, capacity;
    struct sst_detection *detection; /* in ascending order of frame, then view */
    int outcome[6];                  /* pictures by sst_detect_outcome */
    bool rig;                        /* the views are poses of one camera: one lens for all */
    double (*drive_mm)[3];           /* [rows * cols] positions that the rig's drives reported, or NULL */
};

struct sst_detect_config {
    double max_blur_px; /* 0: 3 */
    bool quick;         /* for live pictures: faster, may miss a board that is small or blurred */
};

/**
 * Find the board. Points are refined to the saddle of the grey values around them; points without a saddle are left
 * out. Partial boards are accepted, except chessboards, which must be visible as a whole.
 *
 * @param out  release with sst_detection_fini(); view and frame are set to 0
 * @return 0 with *outcome set (out is empty unless SST_DETECT_FOUND, BLURRED or MOVING), -ENOTSUP (no OpenCV in this
 *         build; logged once), -ENOMEM. Thread: any.
 */
SST_MUST_CHECK int sst_board_detect(const struct sst_board *board, const struct sst_image *image,
                                    const struct sst_detect_config *cfg, struct sst_detection *out,
                                    enum sst_detect_outcome *outcome);
void sst_detection_fini(struct sst_detection *detection);

/** Rotational symmetry of a chessboard of cols x rows inner corners: 1, 2 (half a turn) or 4. */
int sst_chessboard_ways(int cols, int rows);

/**
 * Guess which board a picture shows when the expected one was not found, as one clause for an error message ("it shows
 * a chessboard of 10x7 squares"). Slow: for messages only. @return false: no known board
 */
bool sst_board_guess(const struct sst_board *board, const struct sst_image *image, char out[160]);

/** Begin an empty list. @param form  its board, rows, cols, width and height @return 0, -EINVAL (sizes), -ENOMEM */
SST_MUST_CHECK int sst_detections_init(struct sst_detections *all, const struct sst_detections *form);
void sst_detections_fini(struct sst_detections *all);
/** Add a frame. @return its index or -ENOMEM */
SST_MUST_CHECK int sst_detections_frame(struct sst_detections *all, const char *name);
/**
 * Add a detection (its view and frame set) and take ownership of its corners; the list stays sorted. A chessboard with
 * rotational symmetry is numbered so that the views of a frame agree, which may renumber earlier detections. The result
 * does not depend on the order of the calls.
 *
 * @return 0, -EINVAL (no such view or frame, a duplicate, or ids not ascending), -ENOMEM; on failure the detection
 *         stays the caller's.
 */
SST_MUST_CHECK int sst_detections_add(struct sst_detections *all, struct sst_detection *detection);

/** Write or read all corners as JSON (docs/integrate/formats.md): to solve again, or to use another detector. Errors
 * are logged. */
SST_MUST_CHECK int sst_detections_write(const struct sst_detections *all, const char *path);
SST_MUST_CHECK int sst_detections_read(struct sst_detections *all, const char *path);

#endif
