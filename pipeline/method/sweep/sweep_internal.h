/* pipeline/method/sweep/sweep_internal.h - a sweep in work: sweep.c finds the consensus of the planes, maps.c the maps
 * of views. */
#ifndef SST_PIPELINE_METHOD_SWEEP_SWEEP_INTERNAL_H
#define SST_PIPELINE_METHOD_SWEEP_SWEEP_INTERNAL_H

#include "pipeline/kernels/kernels.h"
#include "pipeline/method/sweep/sweep.h"

#define SWEEP_PAD  SST_CONSENSUS_BLOCK /* columns on both sides of rows of a view */
#define SWEEP_TILE 96                  /* rows of a view, of which maps are computed together */
#define SWEEP_LOOK 16                  /* rows below a tile in which paths from below begin */
#define SWEEP_TOGETHER 3               /* views at most whose costs a thread computes together */

/** A plane of the scene: consensus of reference pixels (x, y), which view k has at (x, y) - shift[k]. */
struct sweep_plane {
    int (*shift)[2]; /* [views] */
    int x0, y0, y1;  /* first column, rows y0 .. y1 - 1 of all views together */
    int low, high;   /* least and largest shift along y */
    int from, to;    /* rows that are computed next */
    int rows;        /* that are kept: row y is at (y - y0) % rows */
    size_t stride;
    uint8_t *consensus; /* [rows][4][stride] */
};

/** A view with rows of `stride` bytes; a row begins SWEEP_PAD bytes before its first pixel. */
struct sweep_view {
    uint8_t *colour[3], *seen, *plane; /* seen: NULL: all pixels are; plane: of the first round's map */
    uint8_t *path[2][2], *least[2][2]; /* of the row before and this one, by diagonal: [planes][stride], [stride] */
    int row;                           /* of path and least: which one is the row before */
    int64_t costs[256];                /* pixels of the first round's map by cost */
};

/** Costs of a view in work, and their means: of the rows of a tile and SWEEP_LOOK more. */
struct sweep_costs {
    uint8_t *raw[3], *mean;
};

/** Scratch of a thread; rows of costs are [planes][stride]. */
struct sweep_scratch {
    struct sweep_costs costs[SWEEP_TOGETHER];
    uint8_t *sum; /* of all rows of a tile */
    uint8_t *path[2][2], *least[2][2], *up;
    uint8_t *step[8], *choice[5];
};

struct sweep {
    const struct sst_planesweep *in;
    int width, height, planes, step;        /* step: 1/64 px between planes */
    size_t stride, layer;                   /* bytes of a row of a view, and of its costs */
    struct sweep_view *view;                /* [in->views] */
    struct sweep_plane *plane;              /* [planes] */
    int voter[SST_CONSENSUS_VIEWS], voters; /* views that make the consensus, well spread ones first */
    uint8_t *all;                           /* a row of seen pixels */
    bool again;                             /* second round */
    uint8_t near, most, p2;                 /* of the second round */
    int together, groups;                   /* views of a group; groups of all views */
    int workers;                            /* threads that maps take */
    int top, bottom;                        /* rows of the tile */
    struct sweep_scratch *scratch;          /* [workers] */
};

/** Scratch of all threads, paths of all views. @return 0, -ENOMEM; sweep_maps_fini() frees all */
SST_MUST_CHECK int sweep_maps_init(struct sweep *s);
void sweep_maps_fini(struct sweep *s);

/** Maps of the views of a group in the tile's rows. Job of sst_parallel_for(). */
sst_work_fn sweep_maps;

#endif
