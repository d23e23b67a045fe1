/* pipeline/method/sweep/sweep_internal.h - a sweep in work: sweep.c finds the consensus of the planes, maps.c the maps
 * of views. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_SWEEP_SWEEP_INTERNAL_H
#define SST_PIPELINE_METHOD_SWEEP_SWEEP_INTERNAL_H

#include "pipeline/kernels/kernels.h"
#include "pipeline/method/sweep/sweep.h"

#define SWEEP_PLANES   250                 /* at most: numbers of planes and of their neighbours are bytes */
#define SWEEP_PAD      SST_CONSENSUS_BLOCK /* columns on both sides of rows of a view */
#define SWEEP_TILE     64                  /* rows of a view, of which maps are computed together */
#define SWEEP_LOOK     8                   /* rows below a tile in which paths from below begin */
#define SWEEP_GROUP    8                   /* rows of a view that have one list of planes */
#define SWEEP_SURE     26                  /* largest median cost of maps that others start from */
#define SWEEP_TOGETHER 6                   /* views at most whose costs a thread computes together */

/** A plane of the scene: consensus of reference pixels (x, y), which view k has at (x, y) - shift[k]. */
struct sweep_plane {
    int (*shift)[2]; /* [views] */
    int x0, y0;      /* first column and row of all views together */
    int from, to;    /* rows that are computed next */
    int rows;        /* that are kept: row y is at (y - y0) % rows */
    size_t stride;
    int blocks;                   /* of a row */
    uint8_t *consensus, *claimed; /* [rows][4][stride]; of the second round, [rows][blocks]: parts
                                     that views claim */
};

/** A view with rows of `stride` bytes; a row begins SWEEP_PAD bytes before its first pixel. */
struct sweep_view {
    uint8_t *colour[3], *seen, *plane; /* seen: NULL: all pixels are; plane: of the map of the round before */
    uint8_t *path[2][2], *least[2][2]; /* of the row before and this one, by diagonal: [planes][stride], [stride] */
    int row;                           /* of path and least: which one is the row before */
    int top, bottom;                   /* rows of the tile in work: none where top is not below bottom */
    int64_t costs[256];                /* pixels of the first round's map by cost */
};

/** Planes of a view in work, by SWEEP_GROUP rows and blocks of columns. */
struct sweep_lists {
    int first;              /* group of rows of the view that the lists begin with */
    uint8_t *on;            /* [groups][planes][blocks], 1: the block has the plane */
    uint8_t *plane, *count; /* [groups][blocks][planes], [groups][blocks] of struct sst_consensus_listed */
    uint8_t *own;           /* [planes][blocks] of a group: not 0: the view's map has the plane in the block */
};

/** Costs of a view in work: of three rows, [planes][stride], where planes that a block does not have cost most, and
 * their means, packed, of the rows of a tile and SWEEP_LOOK more. */
struct sweep_costs {
    uint8_t *raw[3], *mean;
    struct sweep_lists lists;
};

/** Scratch of a thread. */
struct sweep_scratch {
    struct sweep_costs costs[SWEEP_TOGETHER];
    uint8_t *path[2][2], *least[2][2]; /* as in a view */
    uint8_t *down, *up;                /* means of paths, packed: of the rows of a tile, of one row */
    uint8_t *step[8], *choice[5];
};

struct sweep {
    const struct sst_planesweep *in;
    int width, height, planes, step;        /* step: 1/64 px between planes */
    int blocks;                             /* of a row of a view */
    size_t stride, layer, packed;           /* bytes of a row of a view, of all planes of it, of a packed row */
    struct sweep_view *view;                /* [in->views] */
    struct sweep_plane *plane;              /* [planes] */
    const struct sst_map_u16 *start;        /* [in->views] of half size that the second round starts from; NULL: none */
    int voter[SST_CONSENSUS_VIEWS], voters; /* views that make the consensus, well spread ones first */
    uint8_t *all;                           /* a row of seen pixels */
    bool again;                             /* a round after the first one */
    bool own;                               /* of planes near the views' own maps */
    uint16_t noise;                         /* of the views, 1/256 level */
    uint8_t near, most, p2, claims;         /* of rounds after the first one */
    int together, groups;                   /* views of a group; groups of all views */
    int workers;                            /* threads that maps take */
    int turns, *first_turn;                 /* of all tiles; [groups]: of a group's first tile */
    struct sweep_scratch *scratch;          /* [workers] */
};

/**
 * Maps of all views, of planes `step` / 64 px apart.
 *
 * @param start   [in->views] maps of half size, that take the place of the first round; NULL: none
 * @param whole   maps of the caller's size: the second round is repeated if the first one was at this size. Else there
 * is no second round where the median is above SWEEP_SURE, and the maps are of any content
 * @param median  cost of the first round: out, or in where there is none
 * @return as sst_planesweep()
 */
SST_MUST_CHECK int sweep_run(const struct sst_planesweep *in, int step, const struct sst_map_u16 *start, bool whole,
                             int *median);

/** @return 0, -ENOMEM; sweep_lists_fini() frees all */
SST_MUST_CHECK int sweep_lists_init(const struct sweep *s, struct sweep_lists *l);
void sweep_lists_fini(struct sweep_lists *l);

/** List the planes of view k in the tile's rows, in the row above them and down to row `bottom`: in the first round
 * all, later the planes that are claimed at their pixels or at pixels beside them; with `own` fewer, near the planes of
 * the view's own map in the block. */
void sweep_lists_make(const struct sweep *s, struct sweep_lists *l, int k, int bottom);

/** The planes of row y: [planes][blocks], and as lists. */
const uint8_t *sweep_lists_on(const struct sweep *s, const struct sweep_lists *l, int y);
struct sst_consensus_listed sweep_lists_at(const struct sweep *s, const struct sweep_lists *l, int y);

/** Set a layer of row rows[0] to `value` at its planes that row rows[1] lacks. */
void sweep_lists_clear(const struct sweep *s, const struct sweep_lists *l, uint8_t *layer, uint8_t value,
                       const int rows[2]);

/** Scratch of all threads, paths of all views. @return 0, -ENOMEM; sweep_maps_fini() frees all */
SST_MUST_CHECK int sweep_maps_init(struct sweep *s);
void sweep_maps_fini(struct sweep *s);

/** Maps of the views of a group in the tile's rows. Job of sst_parallel_for(). */
sst_work_fn sweep_maps;

#endif
