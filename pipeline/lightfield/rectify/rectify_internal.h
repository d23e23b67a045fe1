/* pipeline/lightfield/rectify/rectify_internal.h - private declarations of this folder; code outside of it includes
 * the public headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIGHTFIELD_RECTIFY_RECTIFY_INTERNAL_H
#define SST_PIPELINE_LIGHTFIELD_RECTIFY_RECTIFY_INTERNAL_H

#include "pipeline/lightfield/rectify/rectify.h"

/* --- gain_map: gain map of one view: factors to the light of the array's mean camera. --- */

/*
 * The factor at a rectified pixel is 1 / (gain falloff) at its position in the raw picture, in linear light. The common
 * target is the mean camera of the array at its principal point: light that this camera shows unclipped stays unclipped
 * in all views, and a view clips only light that the mean camera would clip. Samples near white stay near white where
 * the factor is below 1 (see sst_light_row_fn), so that clipped samples of a sensitive camera do not become a tinted
 * grey. Factors are limited to 1/8 .. 8.
 *
 * Use: resample a row to values in 1/128, get the row's factors, and combine both to bytes with the kernel light_row,
 * colour by colour.
 */
struct gain_map; /* of one view; any number of threads may use it */

/**
 * @param out  NULL if there is nothing to correct (gain 1 and no fall-off): samples are only rounded
 * @return 0, -ENOMEM (not logged)
 */
SST_MUST_CHECK int gain_map_create(struct gain_map **out, const struct sst_rectified *to, const struct sst_calib *calib,
                                   int view);
/** NULL is fine. */
void gain_map_destroy(struct gain_map *map);

/** Factors of a row: of the fall-off and their 2.4th roots, and the same for each colour's gain. */
struct gain_factors {
    const float *falloff, *falloff_root; /* [n], in the given scratch */
    float gain[3], gain_root[3];
};

/**
 * Factors of a row's pixels: the factor of colour c is gain[c] falloff[i]. Between nodes less than 1/48 of the picture
 * apart they are bilinear: within 5e-4 of the exact ones (measured: 2.4e-4 where a corner loses a third of the light).
 *
 * @param scratch  [2 n]
 */
void gain_map_row(const struct gain_map *map, const struct sst_rectified_row *row, float *scratch,
                  struct gain_factors *out);

/** Set the members for light. */
void gain_map_tables(const struct gain_map *map, struct sst_rectify_tables *out);

/* --- resample --- */

/** Weights of a filter, [SST_RESAMPLE_PHASES][taps]. */
const int16_t *filter_weights(enum sst_filter filter, int *taps);

/* --- map: layout of the map for resampling. --- */

/** The exact chain of one view: rectified pixel to ray, to the camera's axes, through the lens. */
struct rectify_chain {
    struct sst_calib_camera cam;
    double turn[9];          /* camera axes from rectified axes */
    double focal_px, cx, cy; /* of the rectified view, its scale included */
    int raw_width, raw_height;
};

struct gain_map;

struct sst_rectify_map {
    struct rectify_chain chain;
    int width, height; /* of the rectified view */
    int shift;         /* cells of (1 << shift) pixels */
    int cells_x, cells_y;
    double (*node)[2];      /* [cells_y + 3][cells_x + 3] positions at the corners of cells, one more cell around */
    uint8_t *cell;          /* [cells_y][cells_x] enum cell of map.c */
    struct gain_map *light; /* NULL: nothing to correct */
};

#endif
