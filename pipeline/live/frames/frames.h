/* pipeline/live/frames/frames.h - views kept up to date from camera frames: only what changed is decoded and rectified.
 */
#ifndef SST_PIPELINE_LIVE_FRAMES_FRAMES_H
#define SST_PIPELINE_LIVE_FRAMES_FRAMES_H

#include "pipeline/live/live.h"

/** Tiles of SST_LIVE_TILE px, row by row; the last ones of a row or column may be smaller. */
struct sst_live_changes {
    int cols, rows;
    uint8_t *map[SST_MAX_VIEWS]; /* [rows * cols] 1: changed; NULL: absent view */
    int64_t changed;             /* tiles of all views */
    bool whole;                  /* everything changed */
};

/** All zero, with a map for each view that is present or has a picture. @return 0, -ENOMEM */
SST_MUST_CHECK int sst_live_changes_init(struct sst_live_changes *c, const struct sst_lightfield *lf);
void sst_live_changes_fini(struct sst_live_changes *c);

struct sst_live_frames; /* opaque; one thread */

/**
 * @param cfg  must stay; fourcc is MJPG, JPEG, or what pipeline/image/raw.h reads
 * @param lf   geometry set (with cfg->calibration by sst_lightfield_calibrate()), views that will come present, without
 *             images; must stay. views[].image, .valid and .present are made and kept here.
 * @return 0, -EINVAL (format, sizes; logged), -ENOMEM (logged)
 */
SST_MUST_CHECK int sst_live_frames_open(struct sst_live_frames **out, const struct sst_live_config *cfg,
                                        struct sst_lightfield *lf);
void sst_live_frames_close(struct sst_live_frames *f);

/**
 * Bring the views up to date and tell what changed.
 *
 * Change is looked for in small pictures of the means of blocks of 8x8 px, with thresholds that follow each camera's
 * own noise and take out the light (change.h has the budget). Of more than 12 views only some are looked at in every
 * set, the others in turn, so that any change is seen within 4 sets; where one view changes, all others are looked at,
 * too. Small changes add up until they are taken over.
 *
 * A view is present from its first picture on, and no more after 2 s without a good frame; when it goes and when it
 * comes back, all its tiles are changed.
 *
 * @param changes  out; of sst_live_changes_init() with the views that were present when this was opened
 * @param report   out, CHANGE, DECODE, RECTIFY and their counters, whole, views, error_change
 * @return 0, -ECANCELED, -ENOMEM; then the next update computes everything
 */
SST_MUST_CHECK int sst_live_frames_update(struct sst_live_frames *f, const struct sst_live_input *in,
                                          struct sst_live_changes *changes, struct sst_live_report *report);

/** Make updates return -ECANCELED from now on, within a frame's time.  Thread: any. */
void sst_live_frames_cancel(struct sst_live_frames *f);

#endif
