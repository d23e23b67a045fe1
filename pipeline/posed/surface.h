/* pipeline/posed/surface.h - surfaces that posed views are focused on: planes and terrain, and rays that meet them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_SURFACE_H
#define SST_PIPELINE_POSED_SURFACE_H

#include "pipeline/image/heights.h"

enum sst_surface_kind { SST_SURFACE_PLANE = 0, SST_SURFACE_TERRAIN = 1 };

/**
 * A plane, the points X with normal . X = offset_mm, or terrain: heights along `up`, bilinear between samples, each
 * offset_mm higher. The normal and `up` are the direction in which sst_surface_moved() moves: towards the cameras.
 */
struct sst_surface {
    enum sst_surface_kind kind;
    double normal[3]; /* unit vector, world axes; terrain: up */
    double offset_mm;
    double along[2][3];                /* terrain: the grid's x and y, unit vectors */
    const struct sst_heights *heights; /* terrain. Borrowed. */
    double low_mm, high_mm;            /* terrain: of the heights, without the offset */
};

/** Plane through a point. @param normal  of any length but 0; towards the cameras */
struct sst_surface sst_surface_plane(const double normal[3], const double point_mm[3]);

/** Plane through three points, its normal on the side of `eye_mm`. @return false: the points are on a line */
SST_MUST_CHECK bool sst_surface_plane_of(struct sst_surface *out, const double point_mm[3][3], const double eye_mm[3]);

/**
 * Terrain. Where `up` is the world's z axis or unknown, the grid's axes are the world's x and y; otherwise the axes
 * level and nearest to them; then turned by the heights' angle.
 *
 * @return 0, -EINVAL (a side below 2, or no height is known); not logged
 */
SST_MUST_CHECK int sst_surface_terrain(struct sst_surface *out, const struct sst_heights *heights, const double up[3]);

/** The whole surface, moved along its normal or upwards. */
struct sst_surface sst_surface_moved(const struct sst_surface *surface, double mm);

/**
 * The first place of a ray on a surface: t above 0 of origin + t direction.
 *
 * Terrain is met from above; between steps of one sample of the grid it may be missed where the ray touches it twice.
 *
 * @return INFINITY: none
 */
double sst_surface_meet(const struct sst_surface *surface, const double origin_mm[3], const double direction[3]);

#endif
