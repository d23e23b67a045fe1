/* pipeline/posed/integral.h - the integral: the mean of posed views on a surface, as a virtual camera sees it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_INTEGRAL_H
#define SST_PIPELINE_POSED_INTEGRAL_H

#include "pipeline/image/deep.h"
#include "pipeline/posed/virtual.h"

/** Sums of views in progress. Sums are of whole numbers: no order of views and no number of threads changes a byte. */
struct sst_integral;

/**
 * Begin without views.
 *
 * Memory: 19 bytes a pixel of the virtual picture, 11 of one channel, and the surface's heights, which are borrowed.
 *
 * @param channels  1 or 3
 * @param threads   as for sst_thread_count()
 * @return 0, -EINVAL (channels, or a size that pictures cannot have), -ENOMEM; not logged
 */
SST_MUST_CHECK int sst_integral_create(struct sst_integral **out, const struct sst_virtual *camera,
                                       const struct sst_surface *surface, int channels, int threads);
void sst_integral_destroy(struct sst_integral *integral);

/** Forget the views and change the surface. @param surface  NULL: the same one */
void sst_integral_restart(struct sst_integral *integral, const struct sst_surface *surface);

/**
 * Add `n` pictures, resampled along rows: places on the surface are within SST_INTEGRAL_ERROR_PX of the exact ones
 * where the surface is smooth over 8 px of the virtual picture, and levels within half a step of 1/256 px.
 *
 * @param camera   [n] of the pictures
 * @param picture  [n] of the same number of channels, sides of 2 to 32767
 * @return 0, -EINVAL (channels, sides, or more than 1024 views), -ENOMEM; not logged. One thread at a time
 */
#define SST_INTEGRAL_ERROR_PX 0.05
SST_MUST_CHECK int sst_integral_add(struct sst_integral *integral, const struct sst_calib_camera *const camera[],
                                    const struct sst_deep *const picture[], int n);

/** Places of a virtual camera's pixels on a surface in the views of an array that stays as it is, for pictures that it
 *  takes again and again. Memory: 1.5 bytes a pixel and view. Read by any number of threads. */
struct sst_integral_places;

/** @param posed  views that are not placed have no places @return 0, -EINVAL (sides as above), -ENOMEM; not logged */
SST_MUST_CHECK int sst_integral_places_create(struct sst_integral_places **out, const struct sst_virtual *camera,
                                              const struct sst_surface *surface, const struct sst_posed *posed,
                                              int threads);
void sst_integral_places_destroy(struct sst_integral_places *places);

/** sst_integral_add() of the same bytes with known places. @param view  [n] of the places' views */
SST_MUST_CHECK int sst_integral_add_at(struct sst_integral *integral, const struct sst_integral_places *places,
                                       const int view[], const struct sst_deep *const picture[], int n);

/** Means, rounded to levels; 0 where no view sees the surface. @param out  out, initialised here with the pictures'
 * white
 *  @return as sst_deep_init() */
SST_MUST_CHECK int sst_integral_levels(struct sst_deep *out, const struct sst_integral *integral);

/** Means of a channel in levels, not rounded; NAN where no view sees the surface. @return as sst_map_f32_init() */
SST_MUST_CHECK int sst_integral_means(struct sst_map_f32 *out, const struct sst_integral *integral, int channel);

/** Number of views of every pixel. @return as sst_map_u16_init() */
SST_MUST_CHECK int sst_integral_views(struct sst_map_u16 *out, const struct sst_integral *integral);

/**
 * Add all placed views of a folder, read by `threads` threads as many at once.
 *
 * @return as sst_posed_picture(), -ENODATA (no view is placed), or -EBADMSG (sides as above); logged
 */
SST_MUST_CHECK int sst_integral_add_all(struct sst_integral *integral, const struct sst_posed *posed, const char *dir);

#endif
