/* pipeline/live/scene/scene_internal.h - what the files of this folder share; code outside of it includes the public
 * headers. */
#ifndef SST_PIPELINE_LIVE_SCENE_SCENE_INTERNAL_H
#define SST_PIPELINE_LIVE_SCENE_SCENE_INTERNAL_H

#include <errno.h>
#include <math.h>

#include "pipeline/live/scene/scene.h"
#include "pipeline/method/disparity/stage.h"
#include "pipeline/method/labels/labels.h"

/* --- scene_parts ---
 * the pieces of the live scene; code outside pipeline/live uses scene.h.
 *
 * Quick maps are made at half size ("cells" of 2x2 pixels), in key views alone: matched against the views around them
 * (keys.c), labelled (cells.c, scene_labels.c), then carried over to every view (warp.c). Disparities are always stored
 * in 1/64 px of full size above lf->disp_min_px. A tile of SST_LIVE_TILE pixels is CELLS cells wide. */

#define SST_SCENE_CELLS      (SST_LIVE_TILE / 2)
#define SST_SCENE_KEYS       64 /* at most */
#define SST_SCENE_NEIGHBOURS 4
#define SST_SCENE_RECTS      16 /* parts that the changed tiles of a view are gathered in, at most */

/** Maps of a view at half size. */
struct scene_maps {
    struct sst_map_u16 disp;
    struct sst_map_u8 label;
    struct sst_map_u8 sure; /* 1: another key view sees the same surface */
};

/** By how many cells a cell of a disparity (1/64 px of full size, from 0 px) moves between views b spacings apart (in
 *  1/65536): it is at x - shift there. */
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

struct scene_key {
    int view;
    int neighbours, neighbour[SST_SCENE_NEIGHBOURS]; /* views that it is matched against, the nearest first */
    struct scene_maps maps;
};

/** Cells x0 .. x1-1, y0 .. y1-1. */
struct scene_rect {
    int x0, y0, x1, y1;
};

/**
 * Key views of a grid: one for every 3x3 views, in their middle or the nearest view there that is present and has a
 * neighbour, and the reference view, which is the first.
 *
 * @param views  out, [SST_SCENE_KEYS]
 * @return how many; 0: no view has a neighbour
 */
int scene_choose_keys(const struct sst_lightfield *lf, int views[SST_SCENE_KEYS]);

/** The views that a key is matched against: one step away, along rows and columns first, SST_SCENE_NEIGHBOURS at most.
 *  @return how many */
int scene_neighbours(const struct sst_lightfield *lf, int view, int out[SST_SCENE_NEIGHBOURS]);

/**
 * Rectangles that hold all changed tiles with a margin of one tile, in cells; no two share a tile.
 *
 * @param dirty  [rows * cols] tiles; 1: changed. Others that are to be matched again lie in the margin.
 */
int scene_gather(struct scene_rect rects[SST_SCENE_RECTS], const uint8_t *dirty, int cols, int rows, int width,
                 int height);

/** What matching a rectangle takes; one a thread. */
struct scene_matcher {
    struct sst_volume volume;
    struct sst_map_u16 disp;
    struct sst_map_u8 confidence;
};

/** @param min_px, max_px  of the light field, full size @param width, height  half size */
SST_MUST_CHECK int scene_matcher_init(struct scene_matcher *m, double min_px, double max_px, int width, int height);
void scene_matcher_fini(struct scene_matcher *m);

/** The disparity of stored value 0 that these matchers give. */
double scene_disp_min(double min_px);

/**
 * Disparities of a key in the changed tiles of a rectangle.
 *
 * @param desc   [views] at half size, with the phases that the volume asks for
 * @param dirty  [tiles] of the key
 */
SST_MUST_CHECK int scene_match(struct scene_matcher *m, const struct sst_lightfield *lf,
                               const struct sst_descriptor *desc, struct scene_key *key, const struct scene_rect *rect,
                               const uint8_t *dirty, int tile_cols);

/* --- cells.c: what the key views know of each other; labels of cells that the network left out -------------------- */

/** Say of the changed cells of key k which of them other keys see, too: within a cell's disparity of theirs. */
void scene_check(struct scene_key *keys, int count, int k, const struct sst_lightfield *lf, const uint8_t *dirty,
                 int tile_cols);

/** The changed cells of a key take the label of the reference's cell of the same surface, where that is to be seen. */
void scene_transfer_labels(struct scene_key *key, const struct scene_key *ref, const struct sst_lightfield *lf,
                       const uint8_t *dirty, int tile_cols);

/** Columns of disparity, a quarter px each, in which labels are candidates. */
#define SST_SCENE_COLUMNS      4096
#define SST_SCENE_COLUMN_SHIFT 4

struct scene_candidates {
    uint64_t mask[SST_SCENE_COLUMNS]; /* bit i: label i + 1 is found at these disparities */
    uint8_t best[SST_SCENE_COLUMNS];  /* the likeliest one; 0: none */
};

/** By the distributions of the labels' disparities in a key (DESIGN 5.3). @param hist  scratch, [65536] */
void scene_fit_labels(struct scene_candidates *c, const struct scene_maps *maps, int classes, double disp_min_px,
                      int64_t *hist);

/** Give labels to changed cells that have none: of a neighbour of the same disparity, else the likeliest candidate. */
void scene_fill_labels(struct scene_maps *maps, const struct scene_candidates *c, const uint8_t *dirty, int tile_cols);

/* --- things.c: labels of what moves, and of what it uncovers ------------------------------------------------------ */

/** The background of a key, cell by cell, and the things before it: connected cells that are nearer. What a thing is
 *  taken for is voted for by all of its cells, and by those of the sets before; a cell of the background keeps the
 * label that the network gave it most often. What stands still for long is background. */
struct scene_foreground; /* opaque; one thread */

/** @param width, height  half size @param cols, rows  tiles @return 0, -ENOMEM */
SST_MUST_CHECK int scene_foreground_open(struct scene_foreground **out, int width, int height, int cols, int rows);
void scene_foreground_close(struct scene_foreground *t); /* NULL is fine */

/** Nothing is known: all of the scene is another. */
void scene_foreground_reset(struct scene_foreground *t);

/** Tiles that did not change in a set, so that what stands still becomes background. */
void scene_foreground_still(struct scene_foreground *t, const struct scene_key *key, const uint8_t *dirty);

/** A tile's maps are now as good as they get: they are the background. */
void scene_foreground_settle(struct scene_foreground *t, const struct scene_key *key, int tile);

/**
 * Labels of the changed cells.
 *
 * @param key       disparities of this set; label: what the network is sure of, 0 elsewhere (or what was there before).
 * Another view than the last time: nothing is known.
 * @param c         out: labels of things are candidates at their disparities
 * @param labelled  the network ran: labels are votes
 */
void scene_foreground_label(struct scene_foreground *t, struct scene_key *key, struct scene_candidates *c, const uint8_t *dirty,
                        bool labelled);

/* --- warp.c: from key views to all views -------------------------------------------------------------------------- */

/** What composing a view takes; one a thread. */
struct scene_composer {
    int width, height;      /* half size */
    uint32_t *z;            /* [height][width] the best cell that landed: sure, disparity + 1, label; 0: none */
    struct scene_maps maps; /* without sure */
    uint16_t *strips;       /* rows at work, see warp.c */
};

SST_MUST_CHECK int scene_composer_init(struct scene_composer *c, int width, int height);
void scene_composer_fini(struct scene_composer *c);

/**
 * Disparity and label of a view's changed tiles, from the cells of all keys that land there: sure ones first, of these
 * the nearest surface; what no key sees takes the farther one of the surfaces to its left and right. Brought to full
 * size along the outlines of the picture.
 *
 * @param labels  false: only disparities
 */
void scene_compose(struct scene_composer *c, struct sst_lightfield *lf, int view, const struct scene_key *keys,
                   int count, const uint8_t *dirty, int tile_cols, int tile_rows, bool labels);

/* --- background.c ------------------------------------------------------------------------------------------------- */

struct scene_background; /* opaque; one thread, besides its own */

/** @param lf  sizes and offsets; must stay @return 0, -ENOMEM */
SST_MUST_CHECK int scene_background_open(struct scene_background **out, const struct sst_live_config *cfg,
                                         const struct sst_lightfield *lf);
/** Within 0.3 s: work that does not end by then does so later, by itself. */
void scene_background_close(struct scene_background *b);

/** Start on a copy of the light field as it is, in a range of disparities; an estimate of it may widen that.
 *  @return 0, -EBUSY (at work, or its result was not taken), -ENOMEM */
SST_MUST_CHECK int scene_background_start(struct scene_background *b, double min_px, double max_px);

bool scene_background_idle(struct scene_background *b);
bool scene_background_done(struct scene_background *b);   /* any thread */
void scene_background_cancel(struct scene_background *b); /* any thread; for good */

/** What it made: views[].disp, label, confidence, and the range that was searched. Stays until release.
 *  @return NULL: not done, or failed (which is logged; then released already) */
const struct sst_lightfield *scene_background_result(struct scene_background *b);
void scene_background_release(struct scene_background *b);

/* --- scene_state: what a live scene keeps, and the steps of an update; for the files scene*.c. --- */

/* A tile that did not change, beside one that did, and changed in the set before: the maps that it got then were partly
 * of what was in that other tile. */
#define SST_SCENE_AGAIN 2

/** A piece of matching, or the network. */
struct scene_job {
    int key; /* -1: the network */
    struct scene_rect rect;
};

struct sst_live_scene {
    /* fixed after open */
    const struct sst_live_config *cfg;
    struct sst_lightfield *lf;
    int threads, views, width, height; /* half size */
    int cols, rows, tiles;             /* of a view */
    uint8_t *all;                      /* [tiles] of 1 */
    struct scene_composer *composers;  /* [threads] */
    struct sst_segmenter **segmenters; /* [threads], the first one from the start; NULL: no model */
    struct scene_background *background;
    int64_t *hist; /* [SST_DISP_BINS] */
    struct scene_candidates *candidates;
    struct scene_foreground *things; /* of the first key; NULL: no model */
    /* as long as the same views are present */
    bool planned[SST_MAX_VIEWS]; /* present then */
    int keys;
    struct scene_key key[SST_SCENE_KEYS];
    bool key_whole[SST_SCENE_KEYS]; /* newly a key: all of it is to be matched */
    struct sst_descriptor *desc;    /* [views]; empty where no key needs it */
    bool described[SST_MAX_VIEWS];
    /* as long as the range stays */
    struct scene_matcher *matchers; /* [threads] */
    bool ranged;
    int64_t next_range_ns;
    bool logged_alone, logged_range;
    int scan_in, scan_every, rested; /* sets: until the range is estimated again, the pause, without a change */
    double nearer_px;                /* near end by the last estimate */
    double unconfirmed_share;             /* of what changed in the reference in the last set; 0: too little did */
    /* from set to set */
    bool ready, whole_next;
    int runs;                       /* of the network since the labels were fitted */
    uint8_t *dirty[SST_MAX_VIEWS];  /* [tiles] to be computed in this set: 1, or SST_SCENE_AGAIN */
    uint8_t *before[SST_MAX_VIEWS]; /* [tiles] 1: changed in the last set that changed any; none after a whole one */
    int64_t *changed_ns[SST_MAX_VIEWS]; /* [tiles] when its picture last did */
    bool *settled[SST_MAX_VIEWS];       /* [tiles] maps are the background's */
    int64_t copied_ns, next_start_ns;    /* of the background */
    double error_labels;
    double sure; /* of the report */
    /* of this set */
    struct scene_job *jobs; /* [1 + SST_SCENE_KEYS * SST_SCENE_RECTS] */
    bool whole;
    struct sst_map_u8 labels; /* the network's, of the reference key; empty: it did not run */
    int64_t label_ns;
    SST_ATOMIC(int) label_runs;
    /* atomic */
    SST_ATOMIC(bool) cancel;
};

static inline int scene_cancelled(const struct sst_live_scene *s)
{
    return s->cancel ? -ECANCELED : 0;
}

/* --- scene_plan.c ------------------------------------------------------------------------------------------------- */

/** Follow the views that come and go: keys, and maps of new views. Marks tiles of new views dirty. @return 0, -ENOMEM
 */
SST_MUST_CHECK int scene_plan(struct sst_live_scene *s);

/** Find the range of disparities unless it is known; s->ranged tells whether it is. @return 0, -ENOMEM */
SST_MUST_CHECK int scene_find_range(struct sst_live_scene *s);

/**
 * In a set that changed something, or is still: has something come nearer than the range that was estimated?
 * @return 0, -ENOMEM; what was known stays
 */
SST_MUST_CHECK int scene_follow_range(struct sst_live_scene *s, bool still);

/** After matching: how much of what changed no other key sees. */
void scene_note_unconfirmed(struct sst_live_scene *s);

/** Search this range from now on: matchers, and the light field's range and zero. @return 0, -ENOMEM */
SST_MUST_CHECK int scene_set_range(struct sst_live_scene *s, double min_px, double max_px);
void scene_free_matchers(struct sst_live_scene *s);

/* --- scene_work.c ------------------------------------------------------------------------------------------------- */

/** Disparities and labels of all dirty tiles. @return 0, -ECANCELED, -ENOMEM, -EBADMSG (network) */
SST_MUST_CHECK int scene_compute(struct sst_live_scene *s, struct sst_live_report *report);

/** The segmenter of a worker. */
SST_MUST_CHECK int scene_open_segmenter(struct sst_live_scene *s, int worker);

/* --- scene_settle.c ----------------------------------------------------------------------------------------------- */

/** Start the background where that is worth it. */
void scene_start_background(struct sst_live_scene *s);

#endif
