/* capture/calibration/gather.h - input of a calibration, board corners and samples of light, gathered from folders
 * of pictures, recordings, captures of a rig or live cameras. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_CALIBRATION_GATHER_H
#define SST_CAPTURE_CALIBRATION_GATHER_H

#include "config/array.h"
#include "pipeline/calibration/board/detect.h"
#include "pipeline/calibration/photometric/photometric.h"

struct sst_recording;
struct sst_frameset;

/* --- source: stored pictures -------------------------------------------------------------------------------------- */

/** Pictures by view and frame; a frame is a moment (or, on a rig, a placement of the board). */
struct sst_gather_source {
    const char *path;
    int rows, cols, frames;
    char (*camera_name)[64];         /* [rows * cols]; "" where there is no camera */
    char (*frame_name)[64];          /* [frames] */
    double spacing_mm;               /* of the array, from the recording; 0: unknown */
    bool rig;                        /* the views are poses of one camera ... */
    double (*drive_mm)[3];           /* ... at these positions, by its drives; NULL: unknown */
    char **file;                     /* [frames][rows * cols] paths; NULL: no picture */
    struct sst_recording *recording; /* or the pictures are in its framesets: */
    int *frameset;                   /* [frames] */
};

/** The pictures to use. */
struct sst_gather_selection {
    int grid[2];      /* rows, columns; 0: from names */
    bool plain_names; /* names such as 04_12 are no places */
    bool rig;         /* views are poses of one camera, even if the source does not say so */
    int every, max;   /* of a recording's framesets each n-th, and at most this many; 0: all */
};

/**
 * Find the pictures in a folder:
 *   a recording; a light field, or a folder of light fields (a frame each); a folder with one folder of pictures per
 * camera,
 *   files of the same name being one moment; a folder of pictures named CAMERA + number (left01.jpg, right01.jpg).
 * Cameras named rr_cc have their position in the grid by that, unless names are plain; others fill it in the order of
 * their names.
 *
 * @param path  must outlive the source
 * @return 0, -ENOENT, -EBADMSG (no pictures, names that do not fit the grid), -ENOMEM ...; logged.
 */
SST_MUST_CHECK int sst_gather_source_open(struct sst_gather_source *out, const char *path,
                                          const struct sst_gather_selection *selection);
void sst_gather_source_close(struct sst_gather_source *source);

/** @return 0, -ENODATA (no such picture; not logged), -EILSEQ (a recording's frame is damaged; not logged), or a
 *  reader's error; logged. Thread: any. */
SST_MUST_CHECK int sst_gather_source_read(const struct sst_gather_source *source, int view, int frame,
                                          struct sst_image *out);

/* --- gather ------------------------------------------------------------------------------------------------------- */

struct sst_gathered {
    struct sst_detections all;
    struct sst_photometric_samples light;
};
void sst_gathered_fini(struct sst_gathered *gathered);

struct sst_gather_config {
    struct sst_board board;
    struct sst_detect_config detect;
    bool light; /* also collect samples of light */
    int threads;
    void (*progress)(void *arg, double done); /* 0..1, of the pictures of a source, from one thread; or NULL */
    void *arg;
};

/**
 * Find the board in every picture of a source; pictures left out are logged with the reason.
 * @return 0, -EBADMSG (no board anywhere, pictures of different sizes), -ENOTSUP, -ENOMEM, a reader's error; logged.
 */
SST_MUST_CHECK int sst_gather(struct sst_gathered *out, const struct sst_gather_source *source,
                              const struct sst_gather_config *cfg);

/* --- live cameras ------------------------------------------------------------------------------------------------- */

struct sst_gather_live; /* opaque; open, run and close on one thread */

/** The current state of a run. */
struct sst_gather_status {
    int framesets, accepted;          /* captured; of these, accepted because they add coverage */
    double coverage;                  /* lowest coverage of any camera, 0..1 of a calibration's need */
    int row, col;                     /* of the camera with the lowest */
    const char *camera, *missing;     /* its name, and the part that it lacks; "": none */
    const struct sst_detections *all; /* so far */
};

struct sst_gather_live_config {
    struct sst_array_config *array; /* must outlive the run; open fills in the bound cameras */
    int accepted;   /* end after this many accepted framesets; 0: when nothing is missing, or when the poses repeat */
    double seconds; /* 0: no limit */
    /* On the writer's thread; each may be NULL. An error ends the run. */
    int (*frameset)(void *arg, const struct sst_frameset *set);       /* each one captured, to record it */
    int (*status)(void *arg, const struct sst_gather_status *status); /* about every two seconds */
    void *arg;
};

/** Open the array's cameras and trigger. @param cfg, live  copied @return 0, -ENOMEM, or as sst_capture_open(); logged
 */
SST_MUST_CHECK int sst_gather_live_open(struct sst_gather_live **out, const struct sst_gather_config *cfg,
                                        const struct sst_gather_live_config *live);

/**
 * Gather framesets until the coverage is complete, a limit is reached or stop is called. A frameset in which the board
 * is where it was in the last accepted one is not accepted, nor one that repeats an earlier pose to the pixel. When as
 * many poses in a row were repeats as are accepted (a board that a machine moves), the run ends with a warning that
 * names the missing poses.
 *
 * @param frameset  out, to free: for each frame of out->all the number of its frameset, from 0 in the order of capture
 * @return 0, -EBADMSG (no camera saw the board), or the result of capture or a callback; logged
 */
SST_MUST_CHECK int sst_gather_live_run(struct sst_gather_live *live, struct sst_gathered *out, int **frameset);

/** Make run return; async-signal-safe. */
void sst_gather_live_stop(struct sst_gather_live *live);

/** NULL is fine. */
void sst_gather_live_close(struct sst_gather_live *live);

/** Write the picture of the coverage of all cameras (PNG). @return 0 or the error of the output; logged */
SST_MUST_CHECK int sst_gather_write_coverage(const struct sst_detections *all, const char *path);

#endif
