/* pipeline/live/frames/frames.h - views updated from camera frames; only changed tiles are decoded and rectified. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIVE_FRAMES_FRAMES_H
#define SST_PIPELINE_LIVE_FRAMES_FRAMES_H

#include "pipeline/live/live.h"

/** Tiles of SST_LIVE_TILE px, row by row; the last ones of a row or column may be smaller. */
struct sst_liveframes_changes {
    int cols, rows;
    uint8_t *map[SST_MAX_VIEWS]; /* [rows * cols] 1: changed; NULL: absent view */
    int64_t changed;             /* tiles of all views */
    bool whole;                  /* everything changed */
    bool stretched;              /* ... but the cameras' frames: levels of 16 bits are shown otherwise */
};

/** All zero, with a map for each view that is present or has a picture. @return 0, -ENOMEM */
SST_MUST_CHECK int sst_liveframes_changes_init(struct sst_liveframes_changes *c, const struct sst_lightfield *lf);
void sst_liveframes_changes_fini(struct sst_liveframes_changes *c);

struct sst_liveframes; /* opaque; one thread */

/**
 * @param cfg  must outlive the object; fourcc is MJPG, JPEG, or a format of pipeline/image/raw.h
 * @param lf   must outlive the object; with geometry (with cfg->calibration by sst_lightfield_calibrate()) and without
 *             images; views with a camera are present. This object owns views[].image, .valid and .present.
 * @return 0, -EINVAL (format, sizes; logged), -ENOMEM (logged)
 */
SST_MUST_CHECK int sst_liveframes_open(struct sst_liveframes **out, const struct sst_live_config *cfg,
                                       struct sst_lightfield *lf);
void sst_liveframes_close(struct sst_liveframes *f);

/**
 * Update the views and report which tiles changed.
 *
 * Changes are detected in the means of blocks of 8x8 px, with thresholds that adapt to each camera's noise and
 * compensate changes of light (frames_internal.h has the error budget). With more than 12 views, some are scanned in
 * every set and the others in turn, so that any change is detected within 4 sets; when one view changes, all others are
 * scanned too. Differences below the threshold accumulate until they exceed it.
 *
 * A view is present from its first picture on, until 2 s have passed without a good frame. When it disappears and when
 * it returns, all its tiles are changed.
 *
 * @param changes  out; of sst_liveframes_changes_init() with the views that were present when this was opened
 * @param report   out, CHANGE, DECODE, RECTIFY and their counters, whole, views, error_change
 * @return 0, -ECANCELED, -ENOMEM; then the next update computes everything
 */
SST_MUST_CHECK int sst_liveframes_update(struct sst_liveframes *f, const struct sst_live_input *in,
                                         struct sst_liveframes_changes *changes, struct sst_live_report *report);

/**
 * Find the changes of one view's frame against the one watched before, at the cost of reading its block means: for the
 * time in which no pictures are needed. The reference of updates is untouched, so the next update finds all changes
 * since the last one.
 *
 * @param changes  out, of this view; without a usable frame, or if none was watched in the last 2 s: nothing
 * @return 0, -ENOTSUP (a kind of JPEG that must be decoded for that), -ENOMEM
 */
SST_MUST_CHECK int sst_liveframes_watch(struct sst_liveframes *f, const struct sst_live_input *in, int view,
                                        struct sst_liveframes_changes *changes);

/** Make updates return -ECANCELED from now on, within the time of one frame.  Thread: any. */
void sst_liveframes_cancel(struct sst_liveframes *f);

#endif
