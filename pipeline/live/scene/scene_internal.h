/* pipeline/live/scene/scene_internal.h - private declarations of this folder; code outside of it includes the public
 * headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIVE_SCENE_SCENE_INTERNAL_H
#define SST_PIPELINE_LIVE_SCENE_SCENE_INTERNAL_H

#include <errno.h>
#include <math.h>

#include "pipeline/live/scene/scene.h"
#include "pipeline/method/disparity/stage.h"
#include "pipeline/method/labels/labels.h"
#include "pipeline/method/network/device.h"

/* Quick maps are computed at half size ("cells" of 2x2 pixels), in key views only: matched against neighbouring views
 * (keys.c), confirmed and labelled (key_maps.c, foreground.c), then warped to every view (warp.c). Disparities are
 * always stored in 1/64 px of full size above lf->disp_min_px. A tile of SST_LIVE_TILE pixels is SST_SCENE_CELLS cells
 * wide. */

#define SST_SCENE_CELLS      (SST_LIVE_TILE / 2)
#define SST_SCENE_KEYS       64 /* at most */
#define SST_SCENE_NEIGHBOURS 4
#define SST_SCENE_RECTS      16 /* at most this number of rectangles covers the changed tiles of a view */

/** Maps of a view at half size. */
struct scene_maps {
    struct sst_map_u16 disp;
    struct sst_map_u8 label;
    struct sst_map_u8 confirmed; /* 1: confirmed, another key view sees the same surface */
};

/** Number of cells by which a cell with a disparity (1/64 px of full size, from 0 px) moves between views that are b
 *  spacings apart (in 1/65536): it is at x - shift in the other view. */
static inline int scene_shift(int64_t disp_q6, int64_t b_q16)
{
    return (int)((disp_q6 * b_q16 + (1 << 22)) >> 23);
}

/** How cells move from one view to another. */
struct scene_warp {
    int64_t zero_q6; /* disparity of stored value 0 */
    int64_t bx_q16, by_q16;
};

static inline struct scene_warp scene_warp(const struct sst_lightfield *lf, int from, int to)
{
    const struct sst_view *a = &lf->views[from], *b = &lf->views[to];

    return (struct scene_warp){ llround(lf->disp_min_px * SST_DISP_SCALE), llround((b->bx - a->bx) * 65536),
                                llround((b->by - a->by) * 65536) };
}

/* --- keys.c: key views and their disparities ---------------------------------------------------------------------- */

/** Disparities that occur: the farthest is larger than the nearest where there are none. */
struct scene_span {
    uint16_t far_q6, near_q6;
};

struct scene_key {
    int view;
    int neighbours, neighbour[SST_SCENE_NEIGHBOURS]; /* views that it is matched against, nearest first */
    struct scene_maps maps;
    /* by scene_measure_tiles() */
    struct scene_span *tile; /* of each tile */
    uint32_t *packed;        /* [height][width] cells to warp, see warp.c */
};

/**
 * Choose the key views of a grid: the reference view first, then one for every 3x3 views, the present view with a
 * neighbour that is nearest to their middle.
 *
 * @param views  out, [SST_SCENE_KEYS]
 * @return number of key views; 0: no view has a neighbour
 */
int scene_choose_keys(const struct sst_lightfield *lf, int views[SST_SCENE_KEYS]);

/** The views that a key is matched against: one step away, along rows and columns first, at most SST_SCENE_NEIGHBOURS.
 *  @return their number */
int scene_neighbours(const struct sst_lightfield *lf, int view, int out[SST_SCENE_NEIGHBOURS]);

/** Tiles of a view that changed: 1, and others to match again: 2. */
struct scene_dirty {
    const uint8_t *tiles; /* [rows][cols] */
    int cols;
};

/**
 * Disjoint rectangles (in cells, made of whole tiles) that cover all changed tiles with a margin of one tile, in which
 * other tiles to match again lie.
 */
int scene_gather(struct sst_rect rects[SST_SCENE_RECTS], struct scene_dirty dirty, int rows, int width, int height);

/** Working memory to match a rectangle; one per thread. */
struct scene_matcher {
    struct sst_volume volume;
    struct sst_map_u16 disp;
};

/** @param min_px, max_px  of the light field, full size @param width, height  half size */
SST_MUST_CHECK int scene_matcher_init(struct scene_matcher *m, double min_px, double max_px, int width, int height);
void scene_matcher_fini(struct scene_matcher *m);

/** The disparity of stored value 0 of these matchers. */
double scene_disp_min(double min_px);

/** Views, and their descriptors at half size with the phases that the volume needs. */
struct scene_pictures {
    const struct sst_lightfield *lf;
    const struct sst_descriptor *desc; /* [views] */
};

/**
 * Compute disparities of a key in the changed tiles of a rectangle.
 *
 * @param dirty  of the key
 */
SST_MUST_CHECK int scene_match(struct scene_matcher *m, const struct scene_pictures *pictures, struct scene_key *key,
                               const struct sst_rect *rect, struct scene_dirty dirty);

/* --- key_maps.c: confirmation between key views; labels of cells without a confident network label ---------------- */

/** Confirm the changed cells of key k that other keys see at the same disparity, within three quarters of a cell. */
void scene_check(struct scene_key *keys, int count, int k, const struct sst_lightfield *lf, struct scene_dirty dirty);

/** Copy labels to the changed cells of a key from the reference key, where it sees the same surface. */
void scene_transfer_labels(struct scene_key *key, const struct scene_key *ref, const struct sst_lightfield *lf,
                           struct scene_dirty dirty);

/** Columns of disparity, a quarter px each, in which labels are candidates. */
#define SST_SCENE_COLUMNS      4096
#define SST_SCENE_COLUMN_SHIFT 4

struct scene_candidates {
    uint64_t mask[SST_SCENE_COLUMNS]; /* bit i: label i + 1 occurs at these disparities */
    uint8_t best[SST_SCENE_COLUMNS];  /* the most likely label; 0: none */
};

/** Compute the candidates from the disparity distribution of each label in a key (design.md, 5.3). @param hist scratch,
 * [65536] */
void scene_fit_labels(struct scene_candidates *c, const struct scene_maps *maps, int classes, double disp_min_px,
                      int64_t *hist);

/** Label changed cells without a label: like a neighbour of the same disparity, else the most likely candidate. */
void scene_fill_labels(struct scene_maps *maps, const struct scene_candidates *c, struct scene_dirty dirty);

/* --- foreground.c: labels of moving objects and of the background that they uncover ------------------------------- */

/** Background model of a key, cell by cell, and the foreground objects: connected cells that are nearer. The label of
 * an object is voted by all of its cells, also in earlier sets; a background cell keeps its most frequent
 * network label. An object that does not move for long becomes background. */
struct scene_foreground; /* opaque; one thread */

/** @param width, height  half size @param cols, rows  tiles @return 0, -ENOMEM */
SST_MUST_CHECK int scene_foreground_open(struct scene_foreground **out, int width, int height, int cols, int rows);
void scene_foreground_close(struct scene_foreground *t); /* NULL is fine */

/** Reset the model: the whole scene changed. */
void scene_foreground_reset(struct scene_foreground *t);

/** Count tiles that did not change in a set, so that static content becomes background. */
void scene_foreground_still(struct scene_foreground *t, const struct scene_key *key, const uint8_t *dirty);

/** Store the maps of a tile as background: they have their final quality. */
void scene_foreground_settle(struct scene_foreground *t, const struct scene_key *key, int tile);

/**
 * Label the changed cells.
 *
 * @param key       disparities of this set; label: confident network labels, 0 elsewhere (or the labels before). A view
 *                  other than the last one resets the model.
 * @param c         out: labels of objects become candidates at their disparities
 * @param labelled  the network ran: labels are votes
 * @return an object appeared or grew that the network should see in the next set
 */
bool scene_foreground_label(struct scene_foreground *t, struct scene_key *key, struct scene_candidates *c,
                            const uint8_t *dirty, bool labelled);

#define SCENE_PIECES 32

/** A connected part of the foreground. */
struct scene_piece {
    struct sst_rect at; /* cells */
    int disp_q6;        /* mean */
    int64_t cells;
    uint8_t label;      /* 0: none, or not known yet */
    float colour[2][3]; /* means of the upper and of the lower half */
};

/** The pieces of the last scene_foreground_label(). @param image  of the key @return their number */
int scene_foreground_pieces(const struct scene_foreground *t, const struct scene_maps *maps,
                            const struct sst_image *image, struct scene_piece piece[SCENE_PIECES]);

/* --- tracks.c: identities of moving objects ----------------------------------------------------------------------- */

#define SCENE_TRACKS SST_LIVE_TRACKS

/** Mobility of an object by its label. */
enum scene_motion {
    SCENE_MOBILE = 0,
    SCENE_ROOTED = 1, /* label of a static class (buildings, leaves): ignored for motion */
};

struct scene_track {
    uint32_t id;   /* once reported */
    bool reported; /* moved far enough to be reported */
    enum sst_live_track_state state;
    double x, y, w, h, vx, vy; /* centre, size; cells, cells/s */
    double at[4];              /* left, top, right, bottom of its pieces when it was last seen */
    double disp_q6, fill;      /* fill: usual fraction of the box that its cells take */
    float colour[2][3];
    uint16_t votes[SST_MAX_CLASSES + 1];  /* label votes along the track, in sets */
    int sets;                             /* with a piece, along the track */
    double from_x, from_y, from_q6;       /* origin of its motion: first piece, or first one after a pause */
    int64_t way_ns;                       /* time at the origin */
    double before_x, before_y, before_q6; /* in the last set */
    double gone, gone_q6;                 /* length of its path in the picture; in depth */
    int64_t first_ns, seen_ns, moved_ns;  /* moved: not only standing */
    int piece;                            /* of this set; -1: none */
};

struct scene_tracks {
    struct scene_track track[SCENE_TRACKS];
    int count;
    uint32_t next_id;
    int64_t t_ns;
    uint8_t motion[SST_MAX_CLASSES + 1]; /* enum scene_motion by label */
};

void scene_tracks_init(struct scene_tracks *t, const struct sst_classes *classes);

/** The label of most sets, if a moving object can have it; 0: none. */
int scene_track_label(const struct scene_tracks *t, const struct scene_track *a);

/** Follow the tracks to this set. @param disp  of the reference key */
void scene_tracks_update(struct scene_tracks *t, const struct scene_piece *piece, int pieces,
                         const struct sst_map_u16 *disp, int64_t t_ns);

/** Reported tracks, in px. @param disp_min_px  of stored value 0 @return number */
int scene_tracks_list(const struct scene_tracks *t, double disp_min_px, struct sst_live_track out[SST_LIVE_TRACKS]);

/** The disparity of stored value 0 has changed: stored values grow by `by`. */
void scene_tracks_shift(struct scene_tracks *t, int by);

/* --- warp.c: maps of all views from the maps of the key views ----------------------------------------------------- */

/** Working memory to compose a view; one per thread. */
struct scene_composer {
    int width, height, cols, rows; /* half size; tiles */
    uint32_t *z;            /* [height][width] the best cell warped here: confirmed, disparity + 1, label; 0: none */
    struct scene_maps maps; /* without `confirmed` */
    uint16_t *strips;       /* rows in work, see warp.c */
    uint8_t *changed;       /* [rows][cols] 0 or 1 */
    uint16_t *sums;         /* [rows + 1][cols + 1] of the changed tiles above and to the left */
};

SST_MUST_CHECK int scene_composer_init(struct scene_composer *c, int width, int height);
void scene_composer_fini(struct scene_composer *c);

/** Prepare a key's maps for scene_compose(): the disparities of each tile, and the warped value of each cell. */
void scene_measure_tiles(struct scene_key *key);

/** Keys, measured by scene_measure_tiles(). */
struct scene_keys {
    const struct scene_key *key;
    int count;
    bool labels; /* false: only disparities */
};

/**
 * Disparity and label of a view's changed tiles, from the cells of all keys that are warped there: confirmed cells
 * first, of these the nearest surface. Cells that no key sees get the farther of the surfaces to their left and right.
 * Maps are upsampled to full size along the edges of the picture.
 *
 * @param dirty   [tiles] other than 0: changed
 */
void scene_compose(struct scene_composer *c, struct sst_lightfield *lf, int view, const struct scene_keys *keys,
                   const uint8_t *dirty);

/* --- background.c ------------------------------------------------------------------------------------------------- */

struct scene_background; /* opaque; one thread, besides its own */

/** @param lf  sizes and offsets; must outlive the object @return 0, -ENOMEM */
SST_MUST_CHECK int scene_background_open(struct scene_background **out, const struct sst_live_config *cfg,
                                         const struct sst_lightfield *lf);
/** Takes at most 0.3 s: a thread that works longer is abandoned and ends by itself. */
void scene_background_close(struct scene_background *b);

/** Start on a copy of the current light field, in a range of disparities that an estimate may widen.
 *  @return 0, -EBUSY (working, or its result was not released), -ENOMEM */
SST_MUST_CHECK int scene_background_start(struct scene_background *b, double min_px, double max_px);

bool scene_background_idle(struct scene_background *b);
bool scene_background_done(struct scene_background *b);   /* any thread */
void scene_background_cancel(struct scene_background *b); /* any thread; permanent */

/** The result: views[].disp, label, confidence, and the searched range. Valid until release.
 *  @return NULL: not done, or failed (logged and already released) */
const struct sst_lightfield *scene_background_result(struct scene_background *b);
void scene_background_release(struct scene_background *b);

/* --- state of a live scene and the steps of an update, for the files scene*.c --- */

/* An unchanged tile next to a changed one that changed in the set before: its maps then depended on the old content of
 * the other tile, so it is computed again. */
#define SST_SCENE_AGAIN 2

/** One unit of parallel work: matching a rectangle, or running the network. */
struct scene_job {
    int key; /* -1: the network */
    struct sst_rect rect;
};

struct sst_livescene {
    /* fixed after open */
    const struct sst_live_config *cfg;
    struct sst_lightfield *lf;
    int threads, views, width, height; /* half size */
    int cols, rows, tiles;             /* of a view */
    uint8_t *all;                      /* [tiles] of 1 */
    struct scene_composer *composers;  /* [threads] */
    struct sst_segmenter **segmenters; /* [threads], the first one from the start; NULL: no model */
    struct sst_runner_user *networks;  /* that they run on; NULL: on the CPU */
    struct scene_background *background;
    int64_t *hist; /* [SST_DISP_BINS] */
    struct scene_candidates *candidates;
    struct scene_foreground *foreground; /* of the first key; NULL: no model */
    struct scene_tracks tracks;          /* of its foreground objects */
    /* valid while the same views are present */
    bool planned[SST_MAX_VIEWS]; /* present when the keys were chosen */
    int keys;
    struct scene_key key[SST_SCENE_KEYS];
    bool key_whole[SST_SCENE_KEYS]; /* new key: match all of it */
    struct sst_descriptor *desc;    /* [views]; empty where no key needs it */
    bool described[SST_MAX_VIEWS];
    /* valid while the range stays */
    struct scene_matcher *matchers; /* [threads] */
    bool ranged;
    int64_t next_range_ns;
    bool logged_alone, logged_range;
    int scan_in, scan_every, rested; /* sets until the range is estimated again; interval; sets without a change */
    double nearer_px;                /* near end of the last estimated range */
    double unconfirmed_share; /* fraction of the cells that changed in one key in the last set, the largest of all keys;
                                 0: too few changed */
    int unconfirmed_view;     /* of that key */
    /* from set to set */
    bool ready, whole_next;
    int runs;                           /* runs of the network since the labels were fitted */
    int label_wait;                     /* sets until it may run again; 0: at once */
    int64_t t_ns, label_t_ns;           /* of the set; of the set in which the network ran last */
    bool left;                          /* sst_livescene_follow() has something to do */
    int64_t maps_t_ns, late_t_ns;       /* of the set that the maps are of; of the last one without own maps, 0: none */
    bool seldom;                        /* sets come slowly, and there is processor time for maps of each */
    int64_t moving_t_ns;                /* of the last set before which something moved behind leaves, 0: none */
    struct sst_map_u16 labelled;        /* disparities of the reference key when its cells were labelled */
    uint8_t *dirty[SST_MAX_VIEWS];      /* [tiles] to compute in this set: 1, or SST_SCENE_AGAIN */
    uint8_t *before[SST_MAX_VIEWS];     /* [tiles] 1: changed in the last set with changes; all 0 after a whole one */
    int64_t *changed_ns[SST_MAX_VIEWS]; /* [tiles] last change of the picture */
    bool *settled[SST_MAX_VIEWS];       /* [tiles] maps come from the background */
    int64_t copied_ns, next_start_ns;   /* of the background */
    int64_t rested_ns, took_ns;         /* end of its last run, or opening; its duration, 0: none */
    int64_t crowded_ns;                 /* when sets were last left out; 0: never */
    double error_labels;
    double confirmed; /* of the report */
    /* of this set */
    struct scene_job *jobs; /* [1 + SST_SCENE_KEYS * SST_SCENE_RECTS] */
    bool whole;
    struct sst_map_u8 labels; /* network labels of the reference key; empty: it did not run */
    int64_t label_ns;
    SST_ATOMIC(int) label_runs;
    /* atomic */
    SST_ATOMIC(bool) cancel;
};

static inline int scene_cancelled(const struct sst_livescene *s)
{
    return s->cancel ? -ECANCELED : 0;
}

/* --- scene_plan.c ------------------------------------------------------------------------------------------------- */

/** Update keys and maps when views appear or disappear. Marks tiles of new views dirty. @return 0, -ENOMEM */
SST_MUST_CHECK int scene_plan(struct sst_livescene *s);

/** Estimate the range of disparities unless it is known; sets s->ranged on success. @return 0, -ENOMEM */
SST_MUST_CHECK int scene_find_range(struct sst_livescene *s);

/**
 * After matching: extend the estimated range if something came nearer.
 * @param wider  out: match the changed tiles again
 * @return 0, -ENOMEM; the range stays
 */
SST_MUST_CHECK int scene_follow_range(struct sst_livescene *s, bool *wider);
/** Follow the range in a set without a change. */
void scene_rest_range(struct sst_livescene *s);

/** Set the searched range: matchers, and range and zero of the light field. @return 0, -ENOMEM */
SST_MUST_CHECK int scene_set_range(struct sst_livescene *s, double min_px, double max_px);
void scene_free_matchers(struct sst_livescene *s);

/* --- scene_work.c ------------------------------------------------------------------------------------------------- */

/** Disparities and labels of all dirty tiles. @return 0, -ECANCELED, -ENOMEM, -EBADMSG (network) */
SST_MUST_CHECK int scene_compute(struct sst_livescene *s, struct sst_live_report *report);

/** In a set that gets no maps: run the network if it is due, for the next maps. @return as scene_compute() */
SST_MUST_CHECK int scene_label_ahead(struct sst_livescene *s, struct sst_live_report *report);

/** Open the segmenter of a worker, which runs on the device, if there is one. */
SST_MUST_CHECK int scene_open_segmenter(struct sst_livescene *s, int worker);

/* --- scene_settle.c ----------------------------------------------------------------------------------------------- */

/** Start the background if the scene is static enough, and it has rested. @param crowded  of the input */
void scene_start_background(struct sst_livescene *s, bool crowded);

#endif
