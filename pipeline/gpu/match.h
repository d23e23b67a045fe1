/* pipeline/gpu/match.h - the shaders of matching: census, costs, their aggregation, semi-global optimisation, winner
 * and filters of one view.
 *
 * A view's volume of costs lies on the device in tiles, each with its own window of disparities and as many pixels
 * around it as the aggregation reaches; a view that is searched in the whole range is a single tile. All numbers are
 * integers, and equal those of the kernels in pipeline/kernels/kernels.h on every device.
 *
 * Steps are disparities in units of 1 / divisor px above the smallest one of the view.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_GPU_MATCH_H
#define SST_PIPELINE_GPU_MATCH_H

#include "pipeline/gpu/gpu.h"

/* Structures have the layout of the shaders (std430). */

#define SST_GPU_MATCH_PASSES  49152 /* of the loops of sgm_path: docs/design/gpu.md, Rules */
#define SST_GPU_MATCH_STEPS   576   /* of a view at most, with the padding of its last tile */
#define SST_GPU_FEATURE_WORDS 16    /* of a pixel: four components of its features each */

/** A part of a view's volume: costs [rows][pitch][nd] of pixels (left, top) .. (left + pitch - 1, top + rows - 1). */
struct sst_gpu_tile {
    int32_t x0, y0, width, height; /* pixels whose disparities are searched, inside of those */
    int32_t left, top, pitch, rows;
    int32_t first; /* step of disparity 0 */
    int32_t steps; /* disparities that count, at least 1 */
    int32_t nd;    /* with padding: a multiple of 4 */
    uint32_t quad; /* index of its first four costs */
};

/** Where a step lies in a neighbour: x, y whole pixels of a layer of its census. */
struct sst_gpu_step {
    int32_t x, y, layer;
    int32_t near_x, near_y; /* nearest whole pixel: must lie inside as well */
};

/* Pixels are uint32_t[height][width]: R, G, B, seen (0: must not be matched) from the lowest byte up. Volumes are
 * uint8_t (costs) and uint16_t (sums, the same cells). */

/** `census`: groups of SST_GPU_PLANE_WIDTH x SST_GPU_PLANE_HEIGHT pixels, a layer of groups per phase. */
struct sst_gpu_census {
    int32_t width, height;
    uint32_t phase[2]; /* 4 * py + px quarter pixels by layer, four bits each from the lowest ones up */
};

/** `match_cost`: groups of 32 pixels by 8 quads of a row, a row each, a layer of groups per tile. One dispatch per
 * neighbour. */
struct sst_gpu_match {
    int32_t width, height;
    uint32_t flags; /* enum sst_gpu_match_flag */
};

enum sst_gpu_match_flag {
    SST_GPU_MATCH_FIRST = 1,     /* the first neighbour */
    SST_GPU_MATCH_LAST = 2,      /* the last one: costs are written */
    SST_GPU_MATCH_TWO = 4,       /* there are two neighbours */
    SST_GPU_MATCH_MASKS = 8,     /* pixels that are not seen must not be matched */
    SST_GPU_MATCH_FEATURES = 16, /* the cost is the mean of the census' and of what the costs hold, of feature_cost */
    SST_GPU_MATCH_ALONE = 32,    /* with that: it is the latter; the census is not read */
};

/** `feature_cost`: groups as of `match_cost`, which reads the result. Features are uint8_t[height][16][width][4], as
 * struct sst_descriptor has them: SST_FEATURE_ZERO more than the components of vectors of length SST_FEATURE_ONE. */
struct sst_gpu_features {
    int32_t width, height;
};

/** `support_arms`: groups of SST_GPU_PLANE_WIDTH x SST_GPU_PLANE_HEIGHT pixels. */
struct sst_gpu_arms {
    int32_t width, height;
    int32_t arm, tau; /* longest arm; least step of a colour that ends one */
};

/** `support_sum` and `support_mean`: groups of 64 quads of a row, a row each, a layer of groups per tile. */
struct sst_gpu_support {
    int32_t width, height;
    int32_t across, down; /* pixels to the sides, above and below of a tile's that are computed as well */
};

#define SST_GPU_WAYS 8 /* directions of paths */

/** In direction `way` pixel (x, y) comes after (x - dx, y - dy). The first four are those of 4 paths. */
static inline void sst_gpu_way(int way, int *dx, int *dy)
{
    static const int8_t ways[SST_GPU_WAYS][2] = { { 1, 0 }, { -1, 0 }, { 0, 1 },  { 0, -1 },
                                                  { 1, 1 }, { -1, 1 }, { 1, -1 }, { -1, -1 } };

    *dx = ways[way][0];
    *dy = ways[way][1];
}

/** `sgm_path`: all paths of directions way .. way + ways - 1, a group each, a row of groups a
 * direction. */
struct sst_gpu_sgm {
    int32_t width, top, bottom; /* of the view; rows that have costs: top .. bottom - 1 */
    int32_t tile_width, tile_height, columns;
    int32_t way, ways;
    int32_t first; /* not 0: set the sums instead of adding to them; one direction */
    /* Of one direction with dy: where paths go on from the rows before these, and where they are left for those after
     * them: indices of the entries of column 0. -1: they begin here, they are not needed. The two must not overlap. */
    int32_t load, store;
    uint32_t all; /* steps that any tile has: an entry has three more words */
};

enum sst_gpu_sgm_buffer {
    SST_GPU_SGM_TILES = 0,
    SST_GPU_SGM_PIXELS = 1,
    SST_GPU_SGM_TABLE = 2, /* uint32_t[256]: p1 | p2 << 16 by colour step into a pixel */
    SST_GPU_SGM_COST = 3,
    SST_GPU_SGM_SUM = 4,   /* in and out */
    SST_GPU_SGM_STATE = 5, /* in and out, uint32_t[][all + 3]: L by step, the first step and the last one + 1
                              of those, the least of them */
    SST_GPU_SGM_BUFFERS
};

#define SST_GPU_SGM_SUBGROUP_STEPS 256 /* disparities of a tile of sgm_path_subgroup at most */

/** Paths of a direction. */
static inline int sst_gpu_sgm_paths(const struct sst_gpu_sgm *s, int way)
{
    const int rows = s->bottom - s->top;
    int dx, dy;

    sst_gpu_way(way, &dx, &dy);
    return !dy ? rows : !dx ? s->width : s->width + rows - 1;
}

/** Groups of sgm_path along x: the most paths of its directions. */
static inline uint32_t sst_gpu_sgm_groups(const struct sst_gpu_sgm *s)
{
    int most = 0;

    for (int i = s->way; i < s->way + s->ways; i++)
        most = sst_max_int(most, sst_gpu_sgm_paths(s, i));
    return (uint32_t)most;
}

/** `winner`: groups by row of a tile, 8 pixels of it and tile. */
struct sst_gpu_winner {
    int32_t width, top; /* of the view; row of the first result */
    int32_t divisor;
    int32_t from_cost; /* not 0: of the costs instead of the sums */
};

#define SST_GPU_WINNER_PIXELS 8

/** `median`: groups of SST_GPU_PLANE_WIDTH x SST_GPU_PLANE_HEIGHT pixels. Maps are those of `winner`. */
struct sst_gpu_median {
    int32_t width, height;
    int32_t masks; /* not 0: pixels that are not seen get no disparity */
};

/** `bilateral`: likewise. */
struct sst_gpu_bilateral {
    int32_t width, height, tau, masks;
    int32_t weight[16]; /* by distance: 4 * |y| + |x| */
};

#define SST_GPU_PLANE_WIDTH  32
#define SST_GPU_PLANE_HEIGHT 8
#define SST_GPU_MATCH_QUADS  64 /* of a group of support_sum and support_mean */

/** Groups of match_cost and feature_cost that cover a row of `pitch` pixels with nd disparities. */
static inline uint32_t sst_gpu_match_blocks(int pitch, int nd)
{
    return (uint32_t)((pitch + 31) / 32 * ((nd + 31) / 32));
}

#endif
