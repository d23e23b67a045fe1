/* pipeline/kernels/consensus.h - kernels of the plane sweep in scene space (pipeline/method/sweep/): the colour that
 * most views agree on at a plane, costs of views against it, their means over like pixels, paths over planes, winners.
 * Included by kernels.h. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_KERNELS_CONSENSUS_H
#define SST_PIPELINE_KERNELS_CONSENSUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Differences of colours are sums over R, G and B. All results are whole numbers and the same bytes on every level. */

#define SST_CONSENSUS_BLOCK                                                                                            \
    64 /* pixels; rows that kernels write are multiples of it, and rows that they read reach as far */
#define SST_CONSENSUS_PART  16 /* pixels of a block that are claimed together */
#define SST_CONSENSUS_HALF  32 /* pixels of a block of which none is computed where no part is claimed */
#define SST_CONSENSUS_VIEWS 36 /* at most: SST_CONSENSUS_REACH for each four stay below a byte */
#define SST_CONSENSUS_SEEDS 12 /* first views whose colours are tried */
#define SST_CONSENSUS_NEAR  28 /* largest difference of two colours of the first round that agree */
#define SST_CONSENSUS_REACH 25 /* difference from which on a colour adds nothing to the density around another */
#define SST_CONSENSUS_LEAST 4  /* views that must agree with one, so that a plane is believed */
#define SST_CONSENSUS_ALONE 51 /* cost of each that is missing of these and the one */
#define SST_CONSENSUS_SPARE 24 /* cost of a plane that no other view supports in the first round */

/** Pixels of a view at a plane, from the first reference pixel of the block on. */
struct sst_consensus_view {
    const uint8_t *colour[3];
    const uint8_t *seen;  /* 255, or 0: outside the view or masked */
    const uint8_t *plane; /* of the view's map; of the second round alone */
};

/**
 * The first consensus of a block at a plane: of the colours of the first SST_CONSENSUS_SEEDS views the one around which
 * all are densest (SST_CONSENSUS_REACH - difference: of the seeds a quarter of the sum, which saturates at 255, of the
 * others means of four views each, added), replaced by the mean of the views that agree with it.
 *
 * @param out  R, G, B, and a cost of 0..SST_CONSENSUS_SPARE that falls with the density; 255: fewer than two views see
 * it
 * @param views  0..SST_CONSENSUS_VIEWS; well spread ones first
 */
typedef void sst_consensus_first_fn(uint8_t *const out[4], const struct sst_consensus_view *view, int views);

struct sst_consensus_test {
    uint8_t first, last; /* planes that count as this one; a view whose map is nearer than `last` does not see it */
    uint8_t near;        /* difference up to which colours agree */
    uint8_t most;        /* largest difference of a view */
    uint8_t claims;      /* least number of views that claim the plane at some pixel */
};

/**
 * The consensus of the second round: the mean colour of the views whose maps claim the plane, replaced once by the mean
 * of the visible ones that agree with it. The cost is the mean difference of the visible views, with
 * SST_CONSENSUS_ALONE for each view that is missing of SST_CONSENSUS_LEAST + 1 that agree, visible or not, over
 * SST_CONSENSUS_LEAST more views.
 * @param out  as above; the cost is 255 where no view claims the plane
 * @return a bit for each SST_CONSENSUS_PART pixels, first ones lowest: do enough views claim the plane at one of them?
 * If at none of SST_CONSENSUS_HALF pixels, their costs are 255 and their colours any.
 */
typedef uint8_t sst_consensus_again_fn(uint8_t *const out[4], const struct sst_consensus_view *view, int views,
                                       const struct sst_consensus_test *test);

/** Costs of n pixels of a view: the difference to the consensus and its cost, at most `most`, which is up to
 * SST_CONSENSUS_MOST. */
typedef void sst_consensus_cost_row_fn(uint8_t *cost, const uint8_t *const own[3], const uint8_t *const consensus[4],
                                       uint8_t most, size_t n);

#define SST_CONSENSUS_MOST 85 /* cost of a pixel at most: three make a byte */

/** Planes of blocks of SST_CONSENSUS_BLOCK pixels of a row. Kernels read and write no other planes, but for neighbours
 * where a member says so. A packed row has the planes block by block: [blocks][planes][SST_CONSENSUS_BLOCK], by place in the
 * list. */
struct sst_consensus_listed {
    const uint8_t *plane; /* [blocks][planes], ascending */
    const uint8_t *count; /* [blocks], at least 1 */
};

/** Costs of a row, up to SST_CONSENSUS_MOST. */
struct sst_consensus_rows {
    const uint8_t *above, *own, *below; /* [planes][stride]; readable a pixel to both sides, at the planes of the pixel
                                           in the middle */
    const uint8_t *step[8];             /* colour steps to the pixels around, row by row; 255: not there */
    uint8_t alike;                      /* pixels up to this step count, at most 254 */
    uint8_t flat;                       /* largest step to the pixels around in flat surfaces, at most `alike` ... */
    uint16_t dearer;                    /* ... where a plane costs 1/256 of this more than the one before it */
    uint16_t farther;                   /* elsewhere 1/256 of what a plane costs more than the one after it */
    struct sst_consensus_listed listed;
    int planes;
    size_t stride;
};

/** Mean costs over the pixels of 3x3 that look like the middle. @param mean  out, packed */
typedef void sst_consensus_mean_row_fn(uint8_t *mean, const struct sst_consensus_rows *rows, size_t n);

/** Plane of the least mean plus price, the first of equal ones, and its mean without it. Nearer planes have a price in
 * flat surfaces, farther ones elsewhere. @param out  plane, mean; [n] */
typedef void sst_consensus_least_row_fn(uint8_t *const out[2], const struct sst_consensus_rows *rows, size_t n);

/** Two paths along the diagonals from the row before to this one: from the left, from the right. */
struct sst_consensus_paths {
    const uint8_t *cost;                    /* packed */
    const uint8_t *from[2], *from_least[2]; /* of the row before, [planes][stride] and [stride]; readable a pixel
                                               beside, and at neighbours of the block's planes */
    uint8_t *to[2], *least[2];              /* out, of this row; not the memory of the row before */
    const uint8_t *step[2];                 /* colour steps from the pixels of the row before, [stride] */
    uint8_t p1, p2;                         /* penalties of a step of one plane, of larger ones ... */
    uint8_t edge, p2_edge;                  /* ... of larger ones at colour steps above `edge` */
    uint8_t *mean;                          /* out, of both paths, rounded up, packed */
    struct sst_consensus_listed listed;
    int planes;
    size_t stride;
};

/** Semi-global optimisation in bytes, which saturate: L = C + min(L', L'(one plane) + P1, least L' + P2) - least L'. */
typedef void sst_consensus_path_row_fn(const struct sst_consensus_paths *paths, size_t n);

/** The cheapest plane of each pixel, the first of equal ones. */
struct sst_consensus_choice {
    const uint8_t *sum[2]; /* packed; added, at most 255 */
    const uint8_t *cost;   /* packed */
    struct sst_consensus_listed listed;
    int planes;                     /* 1..255 */
    uint8_t *plane;                 /* out */
    uint8_t *before, *sums, *after; /* out: sums of the plane before it, its own, of the plane after it; 255: none */
    uint8_t *costs;                 /* out: its cost */
};
typedef void sst_consensus_choose_row_fn(const struct sst_consensus_choice *choice, size_t n);

/** Price of a plane, in flat surfaces or elsewhere. */
static inline uint8_t sst_consensus_price(const struct sst_consensus_rows *rows, int plane, bool flat)
{
    const int price = (flat ? plane * rows->dearer : (rows->planes - 1 - plane) * rows->farther) >> 8;

    return (uint8_t)(price < 255 ? price : 255);
}

/** 65536 / n, rounded; n up to 63. */
static inline uint16_t sst_consensus_reciprocal(unsigned n)
{
    return (uint16_t)(n < 2 ? 65535 : (65536 + n / 2) / n);
}

#endif
