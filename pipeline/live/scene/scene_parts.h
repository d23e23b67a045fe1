/* pipeline/live/scene/scene_parts.h - the pieces of the live scene; code outside pipeline/live uses scene.h.
 *
 * Quick maps are made at half size ("cells" of 2x2 pixels), in key views alone: matched against the views around them
 * (keys.c), labelled (cells.c, scene_labels.c), then carried over to every view (warp.c). Disparities are always stored
 * in 1/64 px of full size above lf->disp_min_px. A tile of SST_LIVE_TILE pixels is CELLS cells wide. */
#ifndef SST_PIPELINE_LIVE_SCENE_SCENE_PARTS_H
#define SST_PIPELINE_LIVE_SCENE_SCENE_PARTS_H

#include <math.h>

#include "pipeline/method/disparity/stage.h"
#include "pipeline/method/labels/labels.h"
#include "pipeline/live/scene/scene.h"

#define SST_SCENE_CELLS      (SST_LIVE_TILE / 2)
#define SST_SCENE_KEYS       64 /* at most */
#define SST_SCENE_NEIGHBOURS 4
#define SST_SCENE_RECTS      16 /* parts that the changed tiles of a view are gathered in, at most */

/** Maps of a view at half size. */
struct sst_scene_maps {
    struct sst_map_u16 disp;
    struct sst_map_u8 label;
    struct sst_map_u8 sure; /* 1: another key view sees the same surface */
};

/** By how many cells a cell of a disparity (1/64 px of full size, from 0 px) moves between views b spacings apart (in
 *  1/65536): it is at x - shift there. */
static inline int sst_scene_shift(int64_t disp_q6, int64_t b_q16)
{
    return (int)((disp_q6 * b_q16 + (1 << 22)) >> 23);
}

/** How cells move from one view to another. */
struct sst_scene_way {
    int64_t zero_q6; /* disparity of stored value 0 */
    int64_t bx_q16, by_q16;
};

static inline struct sst_scene_way sst_scene_way(const struct sst_lightfield *lf, int from, int to)
{
    const struct sst_view *a = &lf->views[from], *b = &lf->views[to];

    return (struct sst_scene_way){ llround(lf->disp_min_px * SST_DISP_SCALE), llround((b->bx - a->bx) * 65536),
                                   llround((b->by - a->by) * 65536) };
}

/* --- keys.c: key views and their disparities ---------------------------------------------------------------------- */

struct sst_scene_key {
    int view;
    int neighbours, neighbour[SST_SCENE_NEIGHBOURS]; /* views that it is matched against, the nearest first */
    struct sst_scene_maps maps;
};

/** Cells x0 .. x1-1, y0 .. y1-1. */
struct sst_scene_rect {
    int x0, y0, x1, y1;
};

/**
 * Key views of a grid: one for every 3x3 views, in their middle or the nearest view there that is present and has a
 * neighbour, and the reference view, which is the first.
 *
 * @param views  out, [SST_SCENE_KEYS]
 * @return how many; 0: no view has a neighbour
 */
int sst_scene_choose_keys(const struct sst_lightfield *lf, int views[SST_SCENE_KEYS]);

/** The views that a key is matched against: one step away, along rows and columns first, SST_SCENE_NEIGHBOURS at most.
 *  @return how many */
int sst_scene_neighbours(const struct sst_lightfield *lf, int view, int out[SST_SCENE_NEIGHBOURS]);

/**
 * Rectangles that hold all changed tiles with a margin of one tile, in cells; no two share a tile.
 *
 * @param dirty  [rows * cols] tiles; 1: changed. Others that are to be matched again lie in the margin.
 */
int sst_scene_gather(struct sst_scene_rect rects[SST_SCENE_RECTS], const uint8_t *dirty, int cols, int rows, int width,
                     int height);

/** What matching a rectangle takes; one a thread. */
struct sst_scene_matcher {
    struct sst_volume volume;
    struct sst_map_u16 disp;
    struct sst_map_u8 confidence;
};

/** @param min_px, max_px  of the light field, full size @param width, height  half size */
SST_MUST_CHECK int sst_scene_matcher_init(struct sst_scene_matcher *m, double min_px, double max_px, int width,
                                          int height);
void sst_scene_matcher_fini(struct sst_scene_matcher *m);

/** The disparity of stored value 0 that these matchers give. */
double sst_scene_disp_min(double min_px);

/**
 * Disparities of a key in the changed tiles of a rectangle.
 *
 * @param desc   [views] at half size, with the phases that the volume asks for
 * @param dirty  [tiles] of the key
 */
SST_MUST_CHECK int sst_scene_match(struct sst_scene_matcher *m, const struct sst_lightfield *lf,
                                   const struct sst_descriptor *desc, struct sst_scene_key *key,
                                   const struct sst_scene_rect *rect, const uint8_t *dirty, int tile_cols);

/* --- cells.c: what the key views know of each other; labels of cells that the network left out -------------------- */

/** Say of the changed cells of key k which of them other keys see, too: within a cell's disparity of theirs. */
void sst_scene_check(struct sst_scene_key *keys, int count, int k, const struct sst_lightfield *lf,
                     const uint8_t *dirty, int tile_cols);

/** The changed cells of a key take the label of the reference's cell of the same surface, where that is to be seen. */
void sst_scene_take_labels(struct sst_scene_key *key, const struct sst_scene_key *ref, const struct sst_lightfield *lf,
                           const uint8_t *dirty, int tile_cols);

/** Columns of disparity, a quarter px each, in which labels are candidates. */
#define SST_SCENE_COLUMNS      4096
#define SST_SCENE_COLUMN_SHIFT 4

struct sst_scene_candidates {
    uint64_t mask[SST_SCENE_COLUMNS]; /* bit i: label i + 1 is found at these disparities */
    uint8_t best[SST_SCENE_COLUMNS];  /* the likeliest one; 0: none */
};

/** By the distributions of the labels' disparities in a key (DESIGN 5.3). @param hist  scratch, [65536] */
void sst_scene_fit_labels(struct sst_scene_candidates *c, const struct sst_scene_maps *maps, int classes,
                          double disp_min_px, int64_t *hist);

/** Give labels to changed cells that have none: of a neighbour of the same disparity, else the likeliest candidate. */
void sst_scene_fill_labels(struct sst_scene_maps *maps, const struct sst_scene_candidates *c, const uint8_t *dirty,
                           int tile_cols);

/* --- things.c: labels of what moves, and of what it uncovers ------------------------------------------------------ */

/** The background of a key, cell by cell, and the things before it: connected cells that are nearer. What a thing is
 *  taken for is voted for by all of its cells, and by those of the sets before; a cell of the background keeps the
 * label that the network gave it most often. What stands still for long is background. */
struct sst_scene_things; /* opaque; one thread */

/** @param width, height  half size @param cols, rows  tiles @return 0, -ENOMEM */
SST_MUST_CHECK int sst_scene_things_open(struct sst_scene_things **out, int width, int height, int cols, int rows);
void sst_scene_things_close(struct sst_scene_things *t); /* NULL is fine */

/** Nothing is known: all of the scene is another. */
void sst_scene_things_forget(struct sst_scene_things *t);

/** Tiles that did not change in a set, so that what stands still becomes background. */
void sst_scene_things_rest(struct sst_scene_things *t, const struct sst_scene_key *key, const uint8_t *dirty);

/** A tile's maps are now as good as they get: they are the background. */
void sst_scene_things_settle(struct sst_scene_things *t, const struct sst_scene_key *key, int tile);

/**
 * Labels of the changed cells.
 *
 * @param key       disparities of this set; label: what the network is sure of, 0 elsewhere (or what was there before).
 * Another view than the last time: nothing is known.
 * @param c         out: labels of things are candidates at their disparities
 * @param labelled  the network ran: labels are votes
 */
void sst_scene_things_label(struct sst_scene_things *t, struct sst_scene_key *key, struct sst_scene_candidates *c,
                            const uint8_t *dirty, bool labelled);

/* --- warp.c: from key views to all views -------------------------------------------------------------------------- */

/** What composing a view takes; one a thread. */
struct sst_scene_composer {
    int width, height;          /* half size */
    uint32_t *z;                /* [height][width] the best cell that landed: sure, disparity + 1, label; 0: none */
    struct sst_scene_maps maps; /* without sure */
    uint16_t *strips;           /* rows at work, see warp.c */
};

SST_MUST_CHECK int sst_scene_composer_init(struct sst_scene_composer *c, int width, int height);
void sst_scene_composer_fini(struct sst_scene_composer *c);

/**
 * Disparity and label of a view's changed tiles, from the cells of all keys that land there: sure ones first, of these
 * the nearest surface; what no key sees takes the farther one of the surfaces to its left and right. Brought to full
 * size along the outlines of the picture.
 *
 * @param labels  false: only disparities
 */
void sst_scene_compose(struct sst_scene_composer *c, struct sst_lightfield *lf, int view,
                       const struct sst_scene_key *keys, int count, const uint8_t *dirty, int tile_cols, int tile_rows,
                       bool labels);

/* --- scene_labels.c: the network ---------------------------------------------------------------------------------- */

/** Labels of high confidence of a picture at its size, 0 where there are none. @param label  out, initialised here */
SST_MUST_CHECK int sst_scene_segment(struct sst_segmenter *seg, const struct sst_image *img, struct sst_map_u8 *label);

/* --- background.c ------------------------------------------------------------------------------------------------- */

struct sst_scene_background; /* opaque; one thread, besides its own */

/** @param lf  sizes and offsets; must stay @return 0, -ENOMEM */
SST_MUST_CHECK int sst_scene_background_open(struct sst_scene_background **out, const struct sst_live_config *cfg,
                                             const struct sst_lightfield *lf);
/** Within 0.3 s: work that does not end by then does so later, by itself. */
void sst_scene_background_close(struct sst_scene_background *b);

/** Start on a copy of the light field as it is, in a range of disparities; an estimate of it may widen that.
 *  @return 0, -EBUSY (at work, or its result was not taken), -ENOMEM */
SST_MUST_CHECK int sst_scene_background_start(struct sst_scene_background *b, double min_px, double max_px);

bool sst_scene_background_idle(struct sst_scene_background *b);
bool sst_scene_background_done(struct sst_scene_background *b);   /* any thread */
void sst_scene_background_cancel(struct sst_scene_background *b); /* any thread; for good */

/** What it made: views[].disp, label, confidence, and the range that was searched. Stays until release.
 *  @return NULL: not done, or failed (which is logged; then released already) */
const struct sst_lightfield *sst_scene_background_result(struct sst_scene_background *b);
void sst_scene_background_release(struct sst_scene_background *b);

#endif
