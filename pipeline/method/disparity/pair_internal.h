/* pipeline/method/disparity/pair_internal.h - dense disparities of one pair of images: its matching, filling, edges and
 * holes.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_DISPARITY_PAIR_INTERNAL_H
#define SST_PIPELINE_METHOD_DISPARITY_PAIR_INTERNAL_H

#include "pipeline/method/disparity/stage.h"

/**
 * sst_disparity_stereo() for a dense result by one cost volume; the configuration has been checked.
 * @param out  out, initialised here
 */
SST_MUST_CHECK int pair_disparities(struct sst_map_f32 *out, const struct sst_image *left,
                                    const struct sst_image *right, const struct sst_disparity_config *cfg);

/**
 * Confirmed pixels of surfaces smaller than `least` pixels become occlusions. Neighbours (4) are of one surface if
 * their disparities differ by a pixel at most.
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int pair_drop_specks(struct sst_map_u8 *status, const struct sst_map_u16 *disp_q6, int least,
                                    int threads);

/**
 * The margins of a pair's left map, which the right image does not show, continue the plane of the confirmed pixels
 * beside them (constant where they are no plane), and count as confirmed.
 * @param range  disparities disp_min .. disp_min + range, px: the bound of a margin's width
 * @return as sst_parallel_for()
 */
SST_MUST_CHECK int pair_extend_margins(struct sst_map_u16 *disp_q6, struct sst_map_u8 *status, int disp_min, int range,
                                       int threads);

/**
 * Rows of a filled map with edges where the image has them: a pixel whose disparity has less than half of the weight
 * around it (11x11, see sst_median_votes_row_fn) gets the weighted median, if this differs by more than a pixel.
 * @param out      these rows are written; not `in`
 * @param in       1/64 px; SST_DISP_NONE stays
 * @param img      of the same size
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int pair_guided_median(struct sst_map_u16 *out, const struct sst_map_u16 *in,
                                      const struct sst_image *img, struct sst_rows rows, struct sst_mem_kept *scratch);

/**
 * Holes between surfaces of different depth, in rows of a map that was filled row by row: a hidden pixel gets the weighted
 * median of the confirmed disparities around it that are not nearer than its own.
 * Only unconfirmed pixels are written and only confirmed ones read, so parts of a map may be filled at once.
 * @param disp_q6  filled, 1/64 px; SST_DISP_NONE stays
 * @param status   enum sst_disparity_check, of before the filling
 * @return 0, -ENOMEM
 */
SST_MUST_CHECK int pair_fill_alike(struct sst_map_u16 *disp_q6, const struct sst_map_u8 *status,
                                   const struct sst_image *img, struct sst_rows rows, struct sst_mem_kept *scratch);

#endif
