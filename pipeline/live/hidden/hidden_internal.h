/* pipeline/live/hidden/hidden_internal.h - private declarations of this folder. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIVE_HIDDEN_HIDDEN_INTERNAL_H
#define SST_PIPELINE_LIVE_HIDDEN_HIDDEN_INTERNAL_H

#include <math.h>

#include "pipeline/kernels/kernels.h"
#include "pipeline/live/hidden/hidden.h"

/* Everything is counted in cells: pixels of a picture at most HIDDEN_WIDTH wide. Integrated scores are kept in blocks
 * of 4x4 cells. */
#define HIDDEN_WIDTH  320
#define HIDDEN_BLOCK  4
#define HIDDEN_TILE   32 /* px, of the maps of changes */
#define HIDDEN_SLOTS  SST_SCORE_SLOTS
#define HIDDEN_PLANES 24
#define HIDDEN_BOXES  4

/* --- model.c: background model of a view, and the differences from it ----------------------------------------------
 */

/** Background model of a view. A cell has HIDDEN_SLOTS colours: some of the last seconds, some minutes old. */
struct hidden_model {
    struct sst_image now; /* cells of the last picture, brought to the brightness of the slots */
    struct sst_image slot[HIDDEN_SLOTS];
    struct sst_map_u16 usual;   /* background noise level of the cell, 1/256 level */
    struct sst_map_u8 score;    /* difference above the noise level, 0..SST_SCORE_CAP */
    uint8_t *hot;               /* [tiles] the tile has scores: compared again without changes */
    int tiles_x, tiles_y, tile; /* tile: cells */
    bool filled;
    double gain;                 /* brightness of the view against the slots */
    int64_t learnt_ns, usual_ns; /* when its colours and its usual differences last followed */
    uint32_t rounds;             /* since it was filled */
};

SST_MUST_CHECK int hidden_model_init(struct hidden_model *m, int width, int height, int step);
void hidden_model_fini(struct hidden_model *m);

#define HIDDEN_LEFT 32

/** Places in cells of a view. */
struct hidden_rects {
    struct sst_rect keep[SST_HIDDEN_THINGS]; /* occupied boxes: excluded from background learning */
    struct sst_rect wake[HIDDEN_LEFT];       /* vacated boxes: relearnt immediately */
    int keeps, wakes;
};

/** A picture, and its changed tiles; NULL: all. */
struct hidden_picture {
    const struct sst_image *image;
    const uint8_t *changed;
    int step; /* px per cell, a power of 2 */
};

/** Does a rectangle meet one of these? */
bool hidden_overlaps(const struct sst_rect *r, const struct sst_rect *keep, int keeps);

/** Follow a picture. */
void hidden_model_update(struct hidden_model *m, const struct hidden_picture *picture, int64_t t_ns,
                         const struct hidden_rects *rects);

/* --- planes.c: scores integrated on planes -------------------------------------------------------------------------
 */

struct hidden_planes {
    int width, height; /* cells */
    int cols, rows;    /* blocks */
    int count;
    double far_px, near_px, step_px;
    double disp_px[HIDDEN_PLANES];
    float *usually; /* [plane][rows][cols] the part of a block that is nearer, mean of the last sets */
    bool covered;   /* usually is known */
    float *nearer;  /* [plane][rows + 1][cols + 1] sums of the parts of blocks that are nearer, above and to the left */
    float *mean;    /* [plane][rows][cols] of the scores' sums over the views */
    int shift[HIDDEN_PLANES][SST_MAX_VIEWS][2]; /* x, y: by which the views' cells move, in the set that is summed */
};

SST_MUST_CHECK int hidden_planes_init(struct hidden_planes *p, int width, int height);
void hidden_planes_fini(struct hidden_planes *p);

/** Find the occluders of each plane in the reference view. @param step  px per cell */
SST_MUST_CHECK int hidden_planes_cover(struct hidden_planes *p, const struct sst_hidden_input *in, int step,
                                       int threads);

/** Is enough of a box (blocks) nearer than a plane? */
bool hidden_planes_is_behind(const struct hidden_planes *p, int plane, const struct sst_rect *r);

/** Choose the planes; the outermost view moves by `reach` cells per px of disparity. @return they are others than
 * before */
bool hidden_planes_choose(struct hidden_planes *p, const struct sst_hidden_input *in, double reach);

/** Models of all views. */
struct hidden_views {
    const struct hidden_model *const *model; /* [views], NULL: not used */
    int views;
    const double *dx, *dy; /* cells per px of disparity */
};

/** Integrate scores. */
SST_MUST_CHECK int hidden_planes_sum(struct hidden_planes *p, const struct hidden_views *v, int threads);

/* --- usual.c: background level of integrated scores, and candidates above it ---------------------------------------
 */

struct hidden_candidate {
    struct sst_rect at; /* blocks */
    int box, plane;     /* plane: where it is sharpest */
    double z;
};

struct hidden_usual {
    int cols, rows;
    float *level;           /* [plane][rows][cols] */
    float *spread, *excess; /* [box][plane][rows][cols]; spread: squared */
    float *best;            /* [rows][cols] */
    float *over, *sums;     /* scratch: [plane][rows][cols], and its sums [plane][rows + 1][cols + 1] */
    uint8_t *best_box, *best_plane;
    double age_s;
    int64_t t_ns;
    int sets; /* since the reset, counted up to a few */
};

SST_MUST_CHECK int hidden_usual_init(struct hidden_usual *u, int cols, int rows);
void hidden_usual_fini(struct hidden_usual *u);
void hidden_usual_reset(struct hidden_usual *u);

/** Follow a set in which nothing changed. */
void hidden_usual_wait(struct hidden_usual *u, int64_t t_ns);

/** Time of a set, and its blocks that are excluded from background learning. */
struct hidden_kept {
    int64_t t_ns;
    const struct sst_rect *keep; /* [keeps] */
    int keeps;
};

/** Follow a set.
 *  @return number of candidates, the best first */
int hidden_usual_follow(struct hidden_usual *u, const struct hidden_planes *p, const struct hidden_kept *kept,
                        int threads, struct hidden_candidate out[SST_HIDDEN_THINGS]);

/* --- follow.c: candidates from set to set ----------------------------------------------------------------------------
 */

struct hidden_track {
    struct sst_hidden_thing thing; /* key, times, reported, evidence */
    double x, y, w, h, vx, vy;     /* middle, size; blocks, blocks/s */
    double from_x, from_y;         /* where it was first */
    double rest_x, rest_y;         /* place from which it has not moved by its size ... */
    int64_t rest_ns;               /* ... since then */
    bool behind_one;               /* it began where a reported one had just been */
    bool beside;                   /* it was near a reported one: no chance */
    double peak;                   /* largest evidence */
    double z;                      /* of its candidates lately */
    int64_t reported_ns;           /* where it is reported */
    int sets;
    bool seen; /* in this set */
    bool gone; /* it ends with this set */
};

/** Where a reported track has been. */
struct hidden_left {
    double x, y, w, h, disp_px;
    int64_t t_ns;
};

struct hidden_tracks {
    struct hidden_track track[SST_HIDDEN_THINGS];
    struct hidden_left left[HIDDEN_LEFT];
    int lefts; /* ever; the newest HIDDEN_LEFT are remembered */
    int count;
    uint32_t next_key;
    double step_px; /* between planes */
    int64_t t_ns;
    bool early; /* the level of the leaves is not known yet */
    double alarms_per_hour;
    /* Statistics of chance: number of false tracks, their evidence above PEAK_MIN, and the hours observed; old ones
     * count less. */
    double chances, chance_sum, chance_h;
};

void hidden_tracks_init(struct hidden_tracks *t, double alarms_per_hour);

/** Drop tracks without a report: the level that their evidence was above is not known any more. */
void hidden_tracks_doubt(struct hidden_tracks *t);

/** Follow a set in which nothing changed: objects stay, for a while. */
void hidden_tracks_wait(struct hidden_tracks *t, int64_t t_ns);

/** Is this a place from which a reported one has gone lately? */
bool hidden_tracks_left(const struct hidden_tracks *t, const struct hidden_left *l);

/** Has it gone away from where it began? */
bool hidden_track_moved(const struct hidden_track *a);

/** Has a track that moved stayed in one place for 8 s? */
bool hidden_track_rests(const struct hidden_track *a, int64_t t_ns);

/** Evidence at which chance makes as many reports as are accepted. */
double hidden_tracks_threshold(const struct hidden_tracks *t);

/** Follow a set. */
void hidden_tracks_follow(struct hidden_tracks *t, const struct hidden_candidate *c, int count,
                          const struct hidden_planes *p, int64_t t_ns);

#endif
