/* pipeline/live/live.h - a light field that follows the cameras: what changes is computed anew, what does not is kept.
 *
 * Three parts: frames.h brings the views up to date, scene.h their disparities and labels, and pictures (here) what
 * viewers see. One thread calls; the work inside runs on several. The same input gives the same bytes for any number of
 * threads, except what the background of scene.h has finished meanwhile. */
#ifndef SST_PIPELINE_LIVE_LIVE_H
#define SST_PIPELINE_LIVE_LIVE_H

#include "pipeline/lightfield/calibrated.h"
#include "pipeline/method/network/network.h"
#include "pipeline/method/render/render.h"

#define SST_LIVE_TILE  32 /* px: side of the tiles that change is told in */
#define SST_LIVE_ZONES 16

struct sst_live_config {
    int rows, cols;
    bool present[SST_MAX_VIEWS]; /* places of the grid that have a camera */
    uint32_t fourcc;
    int width, height;                             /* of raw frames */
    const struct sst_use_calibration *calibration; /* NULL: frames are views already; must stay */
    const char *model;                             /* segmentation network; NULL: no labels */
    enum sst_precision precision;
    double range_min_px, range_max_px; /* disparities; equal: estimated from the first set, renewed in the background */
    int threads;                       /* 0: all processors */
    bool skip_change;                  /* S1 of DESIGN 5.5; without: every set is computed whole (exact mode) */
    bool skip_labels;                  /* S4 */
    bool background;                   /* maps of a scene that stands still are made better meanwhile */
    int zones;                         /* in shares 0..1 of the reference view */
    struct {
        double x0, y0, x1, y1;
    } zone[SST_LIVE_ZONES];
};

/** One set; bytes are borrowed during sst_live_update(). */
struct sst_live_input {
    uint64_t set;
    int64_t t_ns;
    struct {
        const uint8_t *data; /* NULL: missing; the view stays as it was */
        size_t bytes, stride;
    } frame[SST_MAX_VIEWS];
};

/** Parts of the work, in order. */
enum sst_live_stage {
    SST_LIVE_CHANGE = 0, /* finding what changed */
    SST_LIVE_DECODE = 1,
    SST_LIVE_RECTIFY = 2,
    SST_LIVE_DISPARITY = 3,
    SST_LIVE_LABELS = 4,
    SST_LIVE_REFINE = 5, /* and carrying maps over to the other views */
    SST_LIVE_STAGES = 6,
};

/** What an update did. */
struct sst_live_report {
    int64_t stage_ns[SST_LIVE_STAGES];      /* wall */
    int64_t cpu_ns;                         /* of the whole process meanwhile */
    int views;                              /* with a frame in this set */
    int64_t tiles, tiles_changed;           /* of all views; changed: computed anew */
    int64_t decodes, decodes_skipped;       /* frames */
    int64_t label_runs, label_runs_skipped; /* network runs against one per view */
    double error_change, error_labels; /* mean |difference| (0..255) resp. share of labels (0..1) that a skipped part
                                          was found off by when last sampled; NaN: not sampled in this update */
    double sure; /* share of the key views' disparities that two of them agree on; NaN: not known */
    bool whole;  /* everything was computed */
    bool ready;  /* there are disparities (and labels, with a model) to render from */
    bool alone;  /* no two neighbouring cameras give pictures: there will be no disparities */
    struct {
        double changed;         /* share of its tiles that changed in the reference view */
        float label[256];       /* share of its pixels that bear the label, 0 = unlabeled */
    } zone[SST_LIVE_ZONES + 1]; /* the last: the whole view */
};

struct sst_live; /* opaque; one thread at a time */

/** @return 0, -EINVAL (cfg, calibration), -ENOENT/-EBADMSG (model), -ENOMEM; logged. */
SST_MUST_CHECK int sst_live_open(struct sst_live **out, const struct sst_live_config *cfg);
void sst_live_close(struct sst_live *live); /* NULL is fine; within 0.5 s, also from the background */

/** Threads that a close has left behind, and that still compute: while there are any, the process must end by _exit(),
 *  for exit() takes from them what libraries hold. They end by themselves. Thread: any */
int sst_live_left_behind(void);

/** Make any work inside return early (-ECANCELED) from now on.  Thread: any. */
void sst_live_cancel(struct sst_live *live);

/**
 * Take a set in. Frames that do not decode are logged once per camera and change of state, and count as missing; a view
 * without frames for 2 s is absent until it has one again, and rendering goes on with the others.
 *
 * @return 0, -ECANCELED, -ENOMEM; logged. After an error the next update computes everything.
 */
SST_MUST_CHECK int sst_live_update(struct sst_live *live, const struct sst_live_input *in,
                                   struct sst_live_report *report);

/** Has the background better maps to take over (by the next sst_live_settle())?  Thread: any. */
bool sst_live_unsettled(struct sst_live *live);
/** Take over what the background finished, between sets. @return true: pictures may look different now */
bool sst_live_settle(struct sst_live *live);

/** The light field as it is now: sizes, classes, maps. Valid until the next update. */
const struct sst_lightfield *sst_live_lightfield(const struct sst_live *live);

/** --- pictures ------------------------------------------------------------------------------------------------------
 */

struct sst_live_picture; /* what one viewer sees; keeps what it can from one rendering to the next */

SST_MUST_CHECK int sst_live_picture_create(struct sst_live_picture **out, struct sst_live *live); /* -ENOMEM */
void sst_live_picture_destroy(struct sst_live_picture *p);

/** Where to focus when nothing is known: behind what is in front. px per spacing; NaN before anything was computed. */
double sst_live_default_focus(const struct sst_live *live);

/** Where a label is, for views that follow it: the median of its disparities in the reference view.
 *  @return 0, -ENODATA (not seen, or on too few pixels to tell: fewer than one in 2000) */
SST_MUST_CHECK int sst_live_label_disparity(const struct sst_live *live, int label, double *disp_px);

/** Disparities that are there, robust, for sliders. @return false: not known yet */
bool sst_live_range(const struct sst_live *live, double *min_px, double *max_px);

/**
 * Render by these settings, only what has changed since the last time. Rays are verified (`verify`) only while key
 * views disagree on more than 5 % of their disparities, as they do in dense leaves, and until it is less than 3.5 %:
 * maps that are good decide alone. Focus is clamped into what can be rendered; NaN is the default focus. Views that are
 * absent, or have no picture yet, are left out. `threads` is that of the light field.
 *
 * @param image  out, borrowed until the next call
 * @param anew   out, pixels that were rendered; 0: the picture is the same as before
 * @return 0, -ENODATA (not ready; plain refocusing works from the first set on), -EINVAL (logged), -ERANGE (no view in
 * the aperture; logged), -ECANCELED, -ENOMEM
 */
SST_MUST_CHECK int sst_live_picture_render(struct sst_live_picture *p, const struct sst_render_config *cfg,
                                           const struct sst_image **image, int64_t *anew);

/** What is under a point of the last picture: the surface that the picture shows there. By the maps that is the one
 * which makes up most of the pixel; where rays are verified it is the one behind the focus' front that rays of all
 * views agree on, unless the maps name one that they agree on as well. */
struct sst_live_pick {
    double disp_px;  /* NaN: unknown */
    int label;       /* of the same surface; 0: none, or not known */
    double front_px; /* nearest surface that rays there meet (one in 16 at least: fewer are errors); NaN: unknown */
    int front_label;
};

/** Some 10 us, or half a millisecond where rays are verified. @return 0, -ERANGE (outside), -ENODATA */
SST_MUST_CHECK int sst_live_picture_pick(struct sst_live_picture *p, int x, int y, struct sst_live_pick *out);

enum sst_live_overlay {
    SST_LIVE_LABELS_PICTURE = 0,
    SST_LIVE_DISPARITY_PICTURE = 1,
};

/** The reference view's labels (colours of the classes over a darkened view) or disparities (colour scale over the
 *  range; unknown is black). @param out  initialised by the caller to the light field's size @return 0, -ENODATA */
SST_MUST_CHECK int sst_live_overlay(struct sst_live *live, enum sst_live_overlay kind, struct sst_image *out);

#endif
