/* pipeline/method/disparity/stage.h - the steps of the disparity stage, for disparity.c, the live pipeline and the
 * tests. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_DISPARITY_STAGE_H
#define SST_PIPELINE_METHOD_DISPARITY_STAGE_H

#include "base/mem.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/method/disparity/disparity.h"

/*
 * Neighbours at fractional offsets, and steps of less than a pixel, fall between pixels. The census is therefore
 * computed from the view shifted by quarter pixels, bilinearly: phase 4 * py + px stands for (px / 4, py / 4). Only the
 * phases that some disparity needs are computed; phase 0 always is.
 */
#define SST_PHASES 16

/** Matching data of one view. Owner: the caller of sst_descriptor_init(). */
struct sst_descriptor {
    int width, height;
    struct sst_image image; /* borrowed, or half size and owned */
    bool image_owned;
    struct sst_map_u8 luma; /* BT.601 */
    struct sst_map_u8 seen; /* 0 where pixels must not be matched (outside the raw frame); empty: all may be */
    uint64_t
        *census[SST_PHASES];  /* [height][census_stride] of the view sampled at (x, y) + phase, or NULL; see below */
    size_t census_stride;     /* elements */
    bool census_lent;         /* the census is in memory of the caller */
    uint8_t *features;        /* [height][16][feature_stride / 4][4] (see sst_feature_cost_rows_fn), or NULL;
                               * feature_stride bytes before and after it are readable */
    size_t feature_stride;    /* bytes between groups of four channels of one row */
    void *feature_memory;     /* allocation that holds them */
    struct sst_mem_kept rows; /* scratch for the census */
};

struct sst_network;

/**
 * Check that a network can compute features of views of this size: one channel in, 64 of the same size out.
 * @param name  of its file, for messages
 * @return 0, -EBADMSG (logged), errors of sst_network_out_shape()
 */
SST_MUST_CHECK int sst_descriptor_check_network(struct sst_network *net, const char *name, int width, int height);

/**
 * Luma, and census or MC-CNN features or both.
 * @param net    for features: passed sst_descriptor_check_network(); normalised luma in, 64 unit-length channels out
 * @param scale  1: img is borrowed and must outlive desc; 2: matched at half size
 * @param cost   0: luma alone
 */
SST_MUST_CHECK int sst_descriptor_init(struct sst_descriptor *desc, const struct sst_image *img, int scale,
                                       enum sst_cost cost, struct sst_network *net);
/** A mask at 1 / factor of the size, rounded up: 255 where all covered pixels are. @param out  out, initialised here */
SST_MUST_CHECK int sst_disparity_mask_reduce(struct sst_map_u8 *out, const struct sst_map_u8 *mask, int factor);
void sst_descriptor_fini(struct sst_descriptor *desc);

/** Compute the census of more phases (bit p of `phases`); no-op for a descriptor without census. */
SST_MUST_CHECK int sst_descriptor_add_phases(struct sst_descriptor *desc, unsigned phases);

/** Compute the census of one phase of a descriptor that was initialised without costs, in the caller's memory: as many
 * words as the view has pixels, in rows of a multiple of SST_ALIGN bytes. It must outlive its use. */
SST_MUST_CHECK int sst_descriptor_lend_census(struct sst_descriptor *desc, int phase, uint64_t *memory);

/** Compute the census of a descriptor that was initialised without costs, if it has none yet. */
SST_MUST_CHECK int sst_descriptor_add_census(struct sst_descriptor *desc);

/** Free the census of all phases but 0. */
void sst_descriptor_drop_phases(struct sst_descriptor *desc);

/**
 * Update the descriptor of a view that changed in a part; equal to initialising it from the new image.
 *
 * @param desc  of scale 2 and census alone
 * @param img   the view, of unchanged size
 * @param part  pixels of the descriptor that contain all changes
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int sst_descriptor_update(struct sst_descriptor *desc, const struct sst_image *img,
                                         struct sst_rect part);

#define SST_FEATURE_TILE 4

/**
 * The bands of rows in which the matching network is run over a view: a function of the view's size alone, so that the
 * features never depend on threads. Bands are of one height. Each starts `step` rows below the one before, but the last
 * one, which ends with the view; all starts are multiples of SST_FEATURE_TILE, so Winograd's tiles are those of the
 * whole view.
 */
struct sst_disparity_feature_bands {
    int count, step, height;
};

/** The run over the rows from start on yields rows first .. end - 1. */
struct sst_disparity_feature_band {
    int start, first, end;
};

/**
 * @param rows    of the view, at least 1
 * @param radius  of the network: rows above and below that a result depends on; negative: unknown, one band with all
 * rows
 */
struct sst_disparity_feature_bands sst_disparity_feature_bands(int rows, int radius);
struct sst_disparity_feature_band sst_disparity_feature_band(const struct sst_disparity_feature_bands *bands, int rows,
                                                             int radius, int i);

/** Where a runner runs the network of features, and they stay with it: called for each band of rows, the first one first,
 * as `keep` of struct sst_network_keeper, with this structure. */
struct sst_feature_keeper {
    /** Store the features. Sets `kept` if the host needs no copy of them. */
    bool (*keep)(void *keeper, const struct sst_run_result *result);
    void *arg;
    int view;
    /* set for it: */
    int width, height; /* of the view */
    struct sst_disparity_feature_band band;
    bool kept;
};

/** Memory for features, undefined, if there is none. @return 0, -ENOMEM */
SST_MUST_CHECK int sst_descriptor_need_features(struct sst_descriptor *desc);

/** Rows of features, there is memory for them, from a network's result [][width][channels] from row band->start on. */
void sst_descriptor_gather(struct sst_descriptor *desc, const int8_t *result,
                           const struct sst_disparity_feature_band *band);

/**
 * Compute the features of a descriptor that has its luma: standardised over the whole view, the network run band by
 * band if its metadata has sst.radius. The values are those of a run over the whole view, except for the last digits of
 * Winograd's floats, which depend on up to five rows beyond the radius: at most one step of a component, rarely.
 *
 * @param keeper  or NULL. If it keeps all bands, the descriptor gets no features
 * @return 0, -EBADMSG (not a matching network: one channel in, SST_FEATURE_CHANNELS of the same size out; an invalid
 * radius; logged), -ENOMEM and what sst_network_run_s8() returns
 */
SST_MUST_CHECK int sst_descriptor_add_features(struct sst_descriptor *desc, struct sst_network *net,
                                               struct sst_feature_keeper *keeper);

/** A view to match with: a point at x in the reference is at x - d * b there. */
struct sst_neighbour {
    const struct sst_descriptor *desc;
    double bx, by;
};

#define SST_MAX_NEIGHBOURS 12

/** Cost volume of a view: [height][width_padded][steps_padded] uint8, entry i of a pixel is disparity
 *  disp_min + i / divisor. */
struct sst_volume {
    int width, height;
    size_t width_padded; /* multiple of 64 */
    int x0, y0;          /* the view's pixel at the volume's origin: 0, 0 except for windows */
    size_t pixels;       /* capacity: width_padded * height at most */
    int disp_min, steps;
    int divisor;         /* steps per pixel: 1 (set by init), 2 or 4 */
    int phase_step;      /* quarter pixels that shifts are rounded to: 4 (whole pixels, set by init), 2 or 1 */
    size_t steps_padded; /* multiple of 32; the padding costs SST_COST_MAX */
    uint8_t *cost;
    uint16_t *sum;             /* the same shape: summed path costs; allocated by sst_disparity_sgm() */
    bool borrowed;             /* cost and sum are another volume's */
    void *scratch;             /* of sst_volume_fill(), see volume.c */
    struct sst_mem_kept lines; /* scratch of the other steps */
};

SST_MUST_CHECK int sst_volume_init(struct sst_volume *v, int width, int height, int disp_min, int steps);
void sst_volume_fini(struct sst_volume *v);

/** A volume with the memory of another one, which must outlive it, and scratch of its own. @return 0, -ENOMEM */
SST_MUST_CHECK int sst_volume_share(struct sst_volume *out, const struct sst_volume *of);

/**
 * Restrict the volume to a window of a view: only that is matched, against whole neighbours.
 *
 * @param width, height  at most those of sst_volume_init()
 */
void sst_volume_window(struct sst_volume *v, int x0, int y0, int width, int height);

/** Bytes of a volume of this size. */
size_t sst_volume_bytes(int width, int height, int steps);

/**
 * Fill the costs of `ref` against 1..SST_MAX_NEIGHBOURS neighbours. Of several, occluded ones are expected to be the
 * expensive ones: with two the cheaper one has three times the weight of the other, with more the result is the mean of
 * the two cheapest. A pixel that a single neighbour sees gets its cost; one that none sees, or that is invalid, a
 * constant.
 */
void sst_volume_fill(struct sst_volume *v, const struct sst_descriptor *ref, const struct sst_neighbour *neighbours,
                     int count);

/**
 * The same bytes in a quarter of the time where a neighbour without masks, the only one, is matched by census alone,
 * and its steps go pixel by pixel to the left and stay within its rows.
 *
 * @param cost  out: [height][row][steps_padded]; row is the volume's width at least, the columns beside it cost
 *              SST_COST_MAX
 * @return false: it is not of that kind, nothing was written
 */
bool sst_volume_fill_left(const struct sst_volume *v, const struct sst_descriptor *ref, const struct sst_neighbour *n,
                          uint8_t *cost, size_t row);

struct sst_pixel {
    int x, y;
};

/** Largest difference of a colour channel between n pixels from `a` on along a row and those from `b` on. */
void sst_disparity_colour_step(uint8_t *out, const struct sst_image *img, struct sst_pixel a, struct sst_pixel b,
                               int n);

/** Arms of the cross-based support regions (Zhang et al. 2009), in colour: each [height][width], and the region's pixel
 *  count. */
struct sst_support {
    struct sst_map_u8 left, right, up, down;
    struct sst_map_u16 count;
};

SST_MUST_CHECK int sst_disparity_support_init(struct sst_support *s, const struct sst_image *img, int arm, int tau,
                                              int threads);
void sst_disparity_support_fini(struct sst_support *s);

/** Replace every cost by its mean over the pixel's support region; `rounds` times. */
SST_MUST_CHECK int sst_disparity_support_aggregate(struct sst_volume *v, const struct sst_support *s, int rounds);

/**
 * One round of that in a band of a view's rows.
 *
 * @param v             of this band: its y0 is the band's first row
 * @param above, below  costs of the SST_SUPPORT_MAX_ARM rows beside it before they were replaced, each as wide as the
 * volume's; NULL: the view ends there
 */
SST_MUST_CHECK int sst_disparity_support_band(struct sst_volume *v, const struct sst_support *s, const uint8_t *above,
                                              const uint8_t *below);

/**
 * Semi-global optimisation of v->cost into v->sum along 4 or 8 paths (paper: energy E(D); Hirschmueller 2008, with the
 * minimum subtracted, so that L <= 255 + p2).
 */
SST_MUST_CHECK int sst_disparity_sgm(struct sst_volume *v, const struct sst_image *img,
                                     const struct sst_disparity_config *cfg);

/** Penalties by colour step into a pixel. */
struct sst_disparity_sgm_penalties {
    uint16_t p1[256], p2[256];
};

void sst_disparity_sgm_penalties_init(struct sst_disparity_sgm_penalties *p, const struct sst_disparity_config *cfg);

/**
 * The parts of the optimisation along 4 paths, in this order: the paths along all rows of a volume, the first sums;
 * then those down and up some of its columns, added. Several threads may compute bands of rows, then columns,
 * at once.
 *
 * @param top      row of the image that the volume begins with
 * @param scratch  of the thread
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int sst_disparity_sgm_along(struct sst_volume *v, const struct sst_image *img, int top,
                                           const struct sst_disparity_sgm_penalties *penalties);
SST_MUST_CHECK int sst_disparity_sgm_down(const struct sst_volume *v, const struct sst_image *img,
                                          struct sst_rect columns, const struct sst_disparity_sgm_penalties *penalties,
                                          struct sst_mem_kept *scratch);

/* Pixels of a tile: with the longest support regions around them, 64x48. */
#define SST_TILE_WIDTH  54
#define SST_TILE_HEIGHT 38
/* Pixels around it that are matched as well: the support regions of all rounds reach into them. */
#define SST_TILE_HALO(rounds) ((rounds)*SST_SUPPORT_MAX_ARM)

/** A part of a view: disparities first .. first + (steps - 1) / divisor px above the smallest. */
struct sst_tile {
    int x0, y0, width, height;
    int first, steps;
    size_t steps_padded; /* multiple of 32 */
    size_t cells;        /* of the tiles before it */
};

/** Costs of a view and their sums over paths, tile by tile: [height][width][steps_padded] each. */
struct sst_tiles {
    int columns, rows;
    int disp_min, steps, divisor; /* as of struct sst_volume */
    struct sst_tile *tile;        /* [rows][columns] */
    uint8_t *cost;
    uint16_t *sum;
    struct sst_mem_kept memory[2]; /* that holds them */
};

/** Disparities of the view at 1 / factor of its size; a tile around which all are SST_DISP_NONE has the whole range. */
struct sst_coarse {
    const struct sst_map_u16 *disp_q6;
    int disp_min, factor;
};

/**
 * Lay out tiles over rows top .. top + height - 1 of a view: their windows hold the disparities that the coarse map has
 * around them, and a margin.
 * @param all     in and out: zeroed, or laid out before: its memory is used again
 * @param shape   smallest disparity, steps, divisor
 * @param coarse  NULL: every tile has the whole range
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int sst_tiles_init(struct sst_tiles *all, int width, int top, int height, const struct sst_volume *shape,
                                  const struct sst_coarse *coarse);
void sst_tiles_fini(struct sst_tiles *all);

#define SST_COARSER 4 /* the coarse map's part of the size */

/** Does a coarse map save more than it takes? Not where the range fills few registers, or the map is too small. */
static inline bool sst_coarse_pays(const struct sst_volume *shape)
{
    return shape->steps > 32 && sst_min_int(shape->width, shape->height) >= SST_COARSER * 48;
}

/** Part of all disparities that the windows hold, 0..1. */
double sst_tiles_share(const struct sst_tiles *all);

/**
 * Costs of a tile (see sst_volume_fill()), aggregated `rounds` times over support regions.
 * @param v  in which it is matched: of the tiles' width and height and twice the halo, and of their steps
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int sst_tiles_fill(struct sst_tiles *all, const struct sst_tile *t, struct sst_volume *v,
                                  const struct sst_descriptor *ref, const struct sst_neighbour *neighbours, int count,
                                  const struct sst_support *support, int rounds);

/** sst_volume_winner() of a tile into the whole view's maps; disparities above the tiles' smallest one. */
SST_MUST_CHECK int sst_tiles_winner(const struct sst_tiles *all, const struct sst_tile *t, struct sst_map_u16 *disp_q6,
                                    struct sst_map_u8 *confidence, struct sst_mem_kept *scratch);

/** Where row y of the view begins in a tile's cells. */
static inline size_t sst_tile_cells(const struct sst_tile *t, int y)
{
    return t->cells + (size_t)(y - t->y0) * (size_t)t->width * t->steps_padded;
}

/**
 * The parts of the optimisation, in this order: of all rows of tiles the paths along rows, the first sums; of all
 * columns those up and down, added. Several threads may compute rows, then columns, at once.
 *
 * @param scratch  of the thread
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int sst_tiles_paths_along(struct sst_tiles *all, const struct sst_image *img,
                                         const struct sst_disparity_sgm_penalties *p, int row,
                                         struct sst_mem_kept *scratch);
SST_MUST_CHECK int sst_tiles_paths_down(struct sst_tiles *all, const struct sst_image *img,
                                        const struct sst_disparity_sgm_penalties *p, int column,
                                        struct sst_mem_kept *scratch);

/** Elements of one row of paths. */
static inline size_t sst_sgm_line(const struct sst_volume *v)
{
    return ((size_t)v->width + 2) * (v->steps_padded + 2 * SST_SGM_PAD);
}

/** The phases that matching against a neighbour at offset b needs of it. */
unsigned sst_volume_phases(const struct sst_volume *v, double bx, double by);

/** Mapping of a pixel into a neighbour by one disparity step. */
struct sst_volume_step {
    int x, y;           /* whole pixels, rounded down ... */
    int phase;          /* ... and the quarters left over */
    int near_x, near_y; /* nearest whole pixels: features exist only for those; both must lie inside */
    int place;          /* index among the different nearest pixels */
};

/** Mappings into a neighbour at offset b. @param steps  out [v->steps] */
void sst_volume_steps(struct sst_volume_step *steps, const struct sst_volume *v, double bx, double by);

/** Store v->sum, minus each pixel's minimum and clamped to 255, in v->cost for another aggregation. */
void sst_volume_requantise(struct sst_volume *v);

/**
 * Winner takes all with the parabola through three costs (flat or border minimum: the integer).
 *
 * @param disp_q6     out, 1/64 px above v->disp_min
 * @param confidence  out, 0..255: distance to the second minimum; or NULL
 * @param from_cost   read v->cost instead of v->sum
 */
SST_MUST_CHECK int sst_volume_winner(struct sst_volume *v, bool from_cost, struct sst_map_u16 *disp_q6,
                                     struct sst_map_u8 *confidence);

/** How several threads match a view in one volume. */
struct sst_volume_search {
    const struct sst_disparity_config *cfg; /* 4 paths; penalties, bilateral filter, cancel */
    const struct sst_descriptor *ref;
    const struct sst_neighbour *neighbours;
    int count;
    const struct sst_support *support;
    int rounds; /* of aggregation */
    int threads;
    struct sst_map_u16 *disp;      /* out, filtered */
    struct sst_map_u8 *confidence; /* out */
};

/**
 * Fill a volume, aggregate, optimise, pick and filter the winners, with the bytes of one thread.
 *
 * @param v     of the whole view
 * @param part  [in->threads] from sst_volume_share() of v
 * @return 0, -ENOMEM, -ECANCELED
 */
SST_MUST_CHECK int sst_volume_search(struct sst_volume *v, struct sst_volume *part, const struct sst_volume_search *in);

/** 5x5 median, borders repeated. In place. @param lines  scratch */
SST_MUST_CHECK int sst_disparity_median5(struct sst_map_u16 *map, struct sst_mem_kept *lines);

/**
 * Bilateral filter of the paper with g the standard normal density (radius 3):
 * D(p) = sum D(q) g(|p-q|) 1(|I(p)-I(q)| < tau) / sum, over q with a known disparity within SST_BILATERAL_STEP_Q6 of
 * D(p): averaging across a depth edge would create points in empty space.
 */
SST_MUST_CHECK int sst_disparity_bilateral(struct sst_map_u16 *map, const struct sst_map_u8 *luma, int tau);

/** Rows y0 .. y1-1. */
struct sst_rows {
    int y0, y1;
};

struct sst_smoothing {
    const struct sst_map_u16 *raw;
    const struct sst_map_u8 *luma;
    bool median; /* false: the bilateral filter alone */
    int tau;     /* 0: the median alone */
};

/**
 * Both filters of some rows, on their own; the rows around them are read.
 *
 * @param out          these rows are written; not `raw`
 * @param copy, lines  scratch
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int sst_disparity_smooth_rows(struct sst_map_u16 *out, const struct sst_smoothing *in,
                                             struct sst_rows rows, struct sst_mem_kept *copy,
                                             struct sst_mem_kept *lines);

/** Its weight g at a distance, 4096 at none. */
int sst_disparity_bilateral_weight(int dx, int dy);

/** Fuse two maps of a view by confidence: agreement within 1 px averages, else the more confident one wins, ties to the
 * first.
 */
void sst_fuse(struct sst_map_u16 *disp, struct sst_map_u8 *confidence, const struct sst_map_u16 *other_disp,
              const struct sst_map_u8 *other_confidence);

/** Outcome of the multi-view check. */
enum sst_disparity_check {
    SST_DISPARITY_CORRECT = 0,
    SST_DISPARITY_MISMATCH = 1,
    SST_DISPARITY_OCCLUSION = 2,
};

/** Rows y0 .. y0 + rows - 1 of a map, borrowed. */
static inline struct sst_map_u8 sst_map_u8_rows(const struct sst_map_u8 *map, int y0, int rows)
{
    return (struct sst_map_u8){ map->width, rows, map->stride, (uint8_t *)map->data + (size_t)y0 * map->stride };
}

static inline struct sst_map_u16 sst_map_u16_rows(const struct sst_map_u16 *map, int y0, int rows)
{
    struct sst_map_u16 part = *map;

    part.height = rows;
    part.data += (size_t)y0 * (map->stride / sizeof(*part.data));
    return part;
}

/** Steps per pixel for a range of whole pixels. */
int sst_disparity_divisor(int range);

/** Quarter pixels that shifts are rounded to (see struct sst_volume). */
int sst_disparity_phase_step(const struct sst_disparity_config *cfg, int width, int height);

#endif
