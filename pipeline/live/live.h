/* pipeline/live/live.h - incremental light-field pipeline: only tiles that changed are recomputed.
 *
 * Three stages: frames.h updates the views, scene.h their disparities and labels, and the pictures declared here are
 * rendered for clients. One thread calls; the work inside runs on several. The same input gives the same bytes for any
 * number of threads, except for results of the background thread of scene.h. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIVE_LIVE_H
#define SST_PIPELINE_LIVE_LIVE_H

#include "base/log.h"
#include "pipeline/lightfield/calibrated.h"
#include "pipeline/method/network/device.h"
#include "pipeline/method/network/network.h"
#include "pipeline/method/render/device.h"
#include "pipeline/posed/posed.h"

#define SST_LIVE_TILE        32 /* px: side of the tiles in which changes are reported */
#define SST_LIVE_ZONES       16
#define SST_LIVE_ZONE_POINTS 16

/** A part of the reference view: a polygon, and a range of disparities. */
struct sst_live_zone {
    int points;                                              /* 3 or more; 0: nothing is in it */
    double x[SST_LIVE_ZONE_POINTS], y[SST_LIVE_ZONE_POINTS]; /* fractions 0..1 of width and height */
    double near_px, far_px;                                  /* limits of its depth; INFINITY, -INFINITY: none */
    bool mask; /* its content counts in no zone; only where it has no limit of depth */
};

/** Cameras that stand anywhere: nothing is rectified, there are neither disparities nor labels nor tracks, and pictures
 *  are rendered on a surface (posed/posed.h). */
struct sst_live_posed {
    const struct sst_posed *poses; /* [rows * cols] views of the frames' size, by position; copied. NULL: a lattice */
    double plane_mm;               /* surface: a plane at this distance along the middle view's axis; 0: the ground */
    double near_mm, far_mm;        /* between which the ground is sought; 0: by the poses' points of the scene */
    double every_s;                /* the ground is fitted again after this; 0: at the start, and by sst_live_refit() */
    int compare_px;                /* struct sst_posed_render_config */
};

struct sst_live_config {
    int rows, cols;
    bool present[SST_MAX_VIEWS]; /* positions of the grid that have a camera */
    uint32_t fourcc;
    int width, height;                             /* of raw frames */
    const struct sst_use_calibration *calibration; /* NULL: frames are already views; must outlive the object */
    struct sst_live_posed posed;                   /* without a calibration */
    const char *model;                             /* segmentation network; NULL: no labels */
    enum sst_precision precision;
    struct sst_samples levels;         /* of 16-bit frames, that become black and white; white 0: found and followed */
    double range_min_px, range_max_px; /* disparities; equal: estimated from the first set, refined in the background */
    int threads;                       /* 0: all processors */
    bool skip_change;                  /* S1 of design.md, 5.5; false: every set is fully computed (exact mode) */
    bool skip_labels;                  /* S4 */
    const char *device;           /* pictures are rendered and networks run on it, as sst_gpu_open() names it; NULL or
                                     "cpu": on none */
    uint64_t device_memory_bytes; /* that pictures may use; 0: SST_GPU_PICTURES_PERCENT of the device's */
    uint64_t device_label_bytes;  /* that networks may use; 0: SST_GPU_LABELS_PERCENT */
    bool background;              /* improve the maps of a static scene on a background thread */
    double alarms_per_hour;       /* false ones accepted of things behind leaves; 0: they are not searched */
    int zones;
    struct sst_live_zone zone[SST_LIVE_ZONES];
};

/** One frameset; bytes are borrowed during sst_live_update(). */
struct sst_live_input {
    uint64_t set;
    int64_t t_ns;
    bool unseen;        /* no pictures are needed for now: the background thread does not start */
    bool crowded;       /* sets came that were left out: there is no processor time to spare */
    bool picture_first; /* work that its picture does not need is left to sst_live_follow() */
    bool moving;        /* in the clear picture of a set before: maps of moving leaves are not to wait for long */
    struct {
        const uint8_t *data; /* NULL: missing; the view is not updated */
        size_t bytes, stride;
    } frame[SST_MAX_VIEWS];
};

/** Stages of an update, in order. */
enum sst_live_stage {
    SST_LIVE_CHANGE = 0, /* change detection */
    SST_LIVE_DECODE = 1,
    SST_LIVE_RECTIFY = 2,
    SST_LIVE_DISPARITY = 3,
    SST_LIVE_LABELS = 4,
    SST_LIVE_REFINE = 5, /* and warping maps to the other views */
    SST_LIVE_STAGES = 6,
};

/** Is a point, in fractions of the view, in the polygon, and its disparity within the limits? */
bool sst_live_zone_has(const struct sst_live_zone *zone, double x, double y, double disp_px);

/** Statistics of one update. */
struct sst_live_report {
    int64_t stage_ns[SST_LIVE_STAGES];      /* wall */
    int64_t cpu_ns;                         /* of the whole process during the update */
    int views;                              /* with a frame in this set */
    int relit;                              /* views with a change of light or exposure, and so of all their tiles */
    int64_t tiles, tiles_changed;           /* of all views; changed: recomputed */
    int64_t decodes, decodes_skipped;       /* frames */
    int64_t label_runs, label_runs_skipped; /* network runs; skipped: compared with one per view */
    double error_change, error_labels;      /* error of skipped parts when last sampled: mean |difference| (0..255) and
                                               fraction of wrong labels (0..1); NaN: not sampled in this update */
    double confirmed;          /* fraction of the key views' disparities that another key view confirms; NaN: unknown */
    struct sst_samples levels; /* of 16-bit frames, that become black and white; white 0: all, or frames of 8 bits */
    bool whole;                /* everything was recomputed */
    bool late;                 /* disparities are from an earlier set: dense leaves move */
    bool ready;                /* disparities (and labels, with a model) are available */
    bool alone;                /* no two neighbouring cameras deliver pictures, so disparities cannot be computed */
    struct {
        double changed;         /* fraction of its tiles that changed in the reference view */
        float label[256];       /* fraction of its pixels with the label, 0 = unlabeled */
    } zone[SST_LIVE_ZONES + 1]; /* the last: the whole view, without masks */
};

#define SST_LIVE_TRACKS 32

enum sst_live_track_state {
    SST_LIVE_TRACK_SEEN = 0,
    SST_LIVE_TRACK_COVERED = 1, /* not seen in this set, or hidden by something nearer: its place is the last one */
    SST_LIVE_TRACK_STILL = 2,   /* it stands where it was */
};

/** Something that moves, or has moved and stands now, in front of the background. */
struct sst_live_track {
    uint32_t id; /* from 1 on, in the order of their first report; never used again */
    enum sst_live_track_state state;
    bool hidden;           /* behind leaves: found by hidden/ */
    int label;             /* 0: none */
    double x0, y0, x1, y1; /* in the reference view, px; may lie beyond its edges; a mean over time */
    double at[4];          /* x0, y0, x1, y1 as measured in the set in which it was last seen */
    double vx_px_s, vy_px_s;
    double disp_px;
    int64_t first_ns, seen_ns; /* times of the first set with it, and of the last one in which it was seen */
};

struct sst_live; /* opaque; one thread at a time */

/** @return 0, -EINVAL (cfg, calibration), -ENOENT/-EBADMSG (model), -ENOMEM; logged. */
SST_MUST_CHECK int sst_live_open(struct sst_live **out, const struct sst_live_config *cfg);
void sst_live_close(struct sst_live *live); /* NULL is fine; takes at most 0.5 s (while a ground is fitted, until its
                                               present plane is compared), also while the background thread
                                               works; longer, until it is open, while a device is opened again */

/** Other zones from the next update on. @return 0, -EINVAL (logged; the old ones stay) */
SST_MUST_CHECK int sst_live_set_zones(struct sst_live *live, const struct sst_live_zone *zone, int zones);

/** Number of threads that a close has abandoned and that still compute. While it is not 0, the process must end by
 *  _exit(), since exit() destroys library state that they use. They end by themselves. Thread: any */
int sst_livescene_left_behind(void);

/** Make any work inside return early (-ECANCELED) from now on.  Thread: any. */
void sst_live_cancel(struct sst_live *live);

/**
 * Process one frameset. Frames that cannot be decoded count as missing and are logged once per camera and change of
 * state. A view without frames for 2 s is absent until it has one again; rendering continues with the others.
 *
 * @return 0, -ECANCELED, -ENOMEM; logged. After an error the next update computes everything.
 */
SST_MUST_CHECK int sst_live_update(struct sst_live *live, const struct sst_live_input *in,
                                   struct sst_live_report *report);

/**
 * After the picture of a set with `picture_first`: search behind leaves, tracks, and labels for the maps of a later
 * set. Until then tracks and the cut's exception for them are as of the set before. Nothing is left in a set with a
 * track in the open that its cut would remove. The next update does it where it has not been done.
 *
 * @param report  zeroed, or of the update: network runs and cpu_ns are added
 * @return 0, -ECANCELED, -ENOMEM; logged. After an error the next update computes everything.
 */
SST_MUST_CHECK int sst_live_follow(struct sst_live *live, struct sst_live_report *report);

/**
 * Find the changes in the view that zones refer to, without updating anything: for sets of which no pictures are
 * needed. The next update finds all changes since the last one.
 *
 * @param report  out, zones: changes since the set watched before; labels as of the last update. All else as of an
 *                update that had nothing to do.
 * @return 0, -ECANCELED, -ENOTSUP (changes of these frames show only when decoded: update), -ENOMEM
 */
SST_MUST_CHECK int sst_live_watch(struct sst_live *live, const struct sst_live_input *in,
                                  struct sst_live_report *report);

/** Moving objects as of the last update, and sst_live_follow(): an object keeps its id while it is seen, in the open or
 * behind leaves, while something nearer occludes it for a few seconds, and while it stands for ten minutes at most.
 * Needs a model, except for occluded objects. @return number */
int sst_live_tracks(const struct sst_live *live, struct sst_live_track out[SST_LIVE_TRACKS]);

/** Label of a movable object, by the network, in a picture of the reference view's size, on a good part of a box (left,
 *  top, right, bottom in px). Takes one run of the network. @return label, 0: none */
int sst_live_recognise(struct sst_live *live, const struct sst_image *image, const double box[4]);

/** True if the background thread has improved maps for the next sst_live_settle().  Thread: any. */
bool sst_live_unsettled(struct sst_live *live);
/** Apply the maps of the background thread, between framesets. @return true: pictures may have changed */
bool sst_live_settle(struct sst_live *live);

/** The surface of an array without a lattice. */
struct sst_live_surface {
    bool known, fitting;
    bool fitted;           /* by the program; false: the plane is given */
    double distance_mm;    /* along the middle view's axis; NaN: not known */
    double tilt_deg;       /* of a fitted plane against the direction in which it was sought */
    int views;             /* that were compared */
    int64_t fitted_ns;     /* time of the last fit; 0: none */
    char why[SST_LOG_MAX]; /* it is not known, or the last fit failed; "" */
};

/** @return false: the array is a lattice */
bool sst_live_surface(const struct sst_live *live, struct sst_live_surface *out);

/** Fit the ground with the next update. @return 0, -ENOTSUP (a lattice, or the plane is given) */
SST_MUST_CHECK int sst_live_refit(struct sst_live *live);

/** The current light field: sizes, classes, maps. Valid until the next update. */
const struct sst_lightfield *sst_live_lightfield(const struct sst_live *live);

/** Report of the device. Pictures that it cannot render, or fails at, fall back to the CPU within the same set.
 *  @return false: there is no device */
bool sst_live_device(const struct sst_live *live, struct sst_render_device_report *out);

/** Report of the device on the network's live runs; the background thread computes on the CPU.
 *  @return false: there is no device, or no model */
bool sst_live_label_device(const struct sst_live *live, struct sst_network_device_report *out);

/** Names of the steps of a live picture, by the place of computation, the last one NULL. Steps of the first list fall
 * back to the CPU without a device, and where it fails. */
extern const char *const sst_live_device_steps[], *const sst_live_cpu_steps[];

/* --- pictures ----------------------------------------------------------------------------------------------------- */

struct sst_livepicture; /* rendered view of one client; reuses the unchanged part of its last rendering */

SST_MUST_CHECK int sst_livepicture_create(struct sst_livepicture **out, struct sst_live *live); /* -ENOMEM */
void sst_livepicture_destroy(struct sst_livepicture *p);

/** Default focus: behind the foreground. px per spacing; NaN before the first disparities. */
double sst_live_default_focus(const struct sst_live *live);

/** Median disparity of a label in the reference view, for views that follow a label.
 *  @return 0, -ENODATA (not visible, or on fewer than one pixel in 2000) */
SST_MUST_CHECK int sst_livepicture_label_disparity(const struct sst_live *live, int label, double *disp_px);

/** The cut of clear pictures, just behind the foreground: at the near end of the gap of sst_render_find_gap(), as long
 * as that foreground is there, and in front of all tracks behind the foreground; px per spacing; NaN: none known. */
double sst_live_cut(const struct sst_live *live);

/** A cut just in front of a thing, px per spacing. @param hidden  behind leaves, where depths are less exact */
double sst_live_before(double disp_px, bool hidden);

#define SST_LIVE_HISTOGRAM 64

/** Shares of the lead view's disparities over the range of sst_live_range(); they sum to 1. @return false: not known */
bool sst_live_histogram(const struct sst_live *live, double *min_px, double *max_px, float share[SST_LIVE_HISTOGRAM]);

/** Robust range of the disparities in the scene, for sliders. @return false: not known yet */
bool sst_live_range(const struct sst_live *live, double *min_px, double *max_px);

/**
 * Render with these settings; only tiles that changed since the last call are rendered. Rays are verified (`verify`)
 * only while the maps are of low confidence: from more than 5 % of disparities that no other key view confirms, as in
 * dense leaves, until less than 3.5 %. Focus is clamped to the range that can be rendered; NaN is the default focus.
 * Absent views and views without a picture are left out. `threads` is a property of the light field.
 *
 * @param image        out, borrowed until the next call
 * @param rendered_px  out, number of pixels rendered; 0: the picture has not changed
 * @return 0, -ENODATA (not ready; plain refocusing works from the first set on), -EINVAL (logged), -ERANGE (no view in
 * the aperture; logged), -ECANCELED, -ENOMEM
 */
SST_MUST_CHECK int sst_livepicture_render(struct sst_livepicture *p, const struct sst_render_config *cfg,
                                          const struct sst_image **image, int64_t *rendered_px);

/* Clear pictures (SST_RENDER_CLEAR): all in focus, without the foreground; surfaces seen a moment ago stay where
 * nothing can be seen now. In the settings a cut_px of NaN is the automatic one, which removes nothing while it is not
 * known; `remove` and `merge` are not for the caller. */

#define SST_LIVEPICTURE_OBJECTS 8

enum sst_livepicture_outline {
    SST_OUTLINE_NONE = 0,
    SST_OUTLINE_ALL = 1,    /* of all that is removed */
    SST_OUTLINE_MOVING = 2, /* of removed tracks */
};

/** Give clear pictures the memory of another picture of the same scene. @return 0, -ENOMEM (logged) */
SST_MUST_CHECK int sst_livepicture_remember(struct sst_livepicture *p, const struct sst_livepicture *from);

/**
 * The last picture with outlines, and a tint over pixels that were last seen more than a second ago. Pictures that are
 * not clear have neither.
 *
 * @param image  out, borrowed until the next call
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int sst_livepicture_decorate(struct sst_livepicture *p, enum sst_livepicture_outline outline, bool tint,
                                            const struct sst_image **image);

#define SST_LIVEPICTURE_ARRIVALS 4

/** A surface that has come in front of the surfaces of a clear picture: an object, or chance. */
struct sst_livepicture_arrival {
    double box[4]; /* x0, y0, x1, y1 of the visible part in the reference view, px */
    double disp_px;
};

/** About the last picture; all NaN or 0 for other methods. */
struct sst_livepicture_clear {
    double cut_px;                   /* NaN: nothing is removed by depth */
    double seen, remembered, filled; /* fractions of the picture */
    double oldest_s;                 /* of the pixel that was last seen longest ago */
    int objects;                     /* removed */
    bool moving;                     /* something moves behind moving leaves */
    int arrivals;
    struct sst_livepicture_arrival arrival[SST_LIVEPICTURE_ARRIVALS];
};

void sst_livepicture_clear(const struct sst_livepicture *p, struct sst_livepicture_clear *out);

/**
 * Remove the thing at a pixel of the reference view from clear pictures, or bring it back: a pixel of something removed
 * so brings that back. It is followed while it moves slowly, and forgotten when it is lost for two seconds.
 *
 * @return 0, -ERANGE (outside), -ENOTSUP (no lattice), -ENODATA (no disparity there, or not ready), -EOVERFLOW
 * (SST_LIVEPICTURE_OBJECTS are removed), -EINVAL (most of the picture), -ENOMEM; not logged.
 */
SST_MUST_CHECK int sst_livepicture_toggle(struct sst_livepicture *p, int x, int y, bool *removed);
/** Bring all back. */
void sst_livepicture_restore(struct sst_livepicture *p);

/** The surface that the last picture shows at a point. By the maps it is the one with the largest weight in the pixel;
 * with verified rays it is the surface behind the front on which the rays of all views agree, unless they agree as well
 * on the one of the maps. */
struct sst_livepicture_pick {
    double disp_px;  /* NaN: unknown */
    int label;       /* of the same surface; 0: none or unknown */
    double front_px; /* nearest surface that at least one ray in 16 meets there (fewer are errors); NaN: unknown */
    int front_label;
};

/** Takes about 10 us, or half a millisecond with verified rays. @return 0, -ERANGE (outside), -ENODATA */
SST_MUST_CHECK int sst_livepicture_pick(struct sst_livepicture *p, int x, int y, struct sst_livepicture_pick *out);

enum sst_livepicture_overlay {
    SST_LIVE_LABELS_PICTURE = 0,
    SST_LIVE_DISPARITY_PICTURE = 1,
};

/** The reference view's labels (colours of the classes over a darkened view) or disparities (colour scale over the
 *  range; unknown is black). @param out  initialised by the caller to the light field's size @return 0, -ENODATA */
SST_MUST_CHECK int sst_livepicture_overlay(struct sst_live *live, enum sst_livepicture_overlay kind,
                                           struct sst_image *out);

#endif
