/* pipeline/live/frames/change.h - where a camera's small pictures differ from those of what is kept, beyond its own noise and
 * the light. Inside pipeline/live only. */
#ifndef SST_PIPELINE_LIVE_FRAMES_CHANGE_H
#define SST_PIPELINE_LIVE_FRAMES_CHANGE_H

#include "pipeline/live/frames/decoder.h"

/*
 * Each tile is judged by three numbers of the differences e of its cells, in each plane: |mean e| (something faint that
 * fills the tile), mean |e| (something that moves in it), max |e| (something small). A threshold is what is always let
 * pass, plus a multiple of the median over all tiles of the same number for two pictures in a row of this camera: the
 * noise, whatever its distribution. The light is followed by the median over the tiles of the ratio of brightness, and
 * taken out of the differences: a lamp that flickers changes no tile. What it adds up to is told apart.
 */
#define SST_WATCH_STATS 3

/** In levels (0..255). What is kept differs from what is seen by less, up to the camera's noise: */
#define SST_WATCH_MEAN   0.75 /* in a tile's mean ... */
#define SST_WATCH_ABS    0.75 /* ... in its cells of 8x8 px, on average over the tile ... */
#define SST_WATCH_PEAK   5.0  /* ... and in any of them; */
#define SST_WATCH_LIGHT  2.5  /* and with all tiles of a view in common, at half of white */
#define SST_WATCH_BUDGET 4.0  /* in a tile's mean, light and all */

struct sst_watch {
    int width, height, cols, rows;    /* px; tiles. Fixed after init */
    struct sst_cells now;             /* to be read into before judging */
    struct sst_cells before, kept;    /* the picture judged last, and of each tile that which was taken over */
    double *gain_kept;                /* [tiles] light when it was taken over */
    uint8_t *unsettled;               /* [tiles] judgements for which thresholds stay lower after a change */
    double gain;                      /* light now, against an arbitrary one */
    double noise[3][SST_WATCH_STATS]; /* 1/8 levels */
    int noise_phase;                  /* which of the tiles tell it next */
    int judged;                       /* pictures since everything was taken over, at most 2 */
    float *scratch;                   /* [3 SST_WATCH_STATS tiles] */
};

/** @return 0, -ENOMEM */
SST_MUST_CHECK int sst_watch_init(struct sst_watch *w, int width, int height);
void sst_watch_fini(struct sst_watch *w);

struct sst_verdict {
    int changed;  /* tiles */
    bool whole;   /* they are all: nothing was kept, or the light is another */
    double light; /* levels that a half-bright tile has changed by since it was taken over */
};

/** Compare `now` with what is kept. @param changed  out, [tiles] 0 or 1 */
struct sst_verdict sst_watch_judge(struct sst_watch *w, uint8_t *changed);

/** The marked tiles are taken over as `now` has them. */
void sst_watch_take(struct sst_watch *w, const uint8_t *changed);

/** Forget what is kept: the next judgement is `whole`. */
void sst_watch_forget(struct sst_watch *w);

#endif
