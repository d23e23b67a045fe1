/* pipeline/posed/virtual.h - virtual cameras: viewpoints without a lens from which posed views are rendered. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_VIRTUAL_H
#define SST_PIPELINE_POSED_VIRTUAL_H

#include "pipeline/posed/posed.h"
#include "pipeline/posed/surface.h"

/** A point X is at P = rotation (X - centre_mm) and projects to fx P.x / P.z + cx, fy P.y / P.z + cy. */
struct sst_virtual {
    int width, height; /* px */
    double fx, fy, cx, cy;
    double rotation[9];
    double centre_mm[3];
};

/** The camera of a placed view, its distortion left out. */
struct sst_virtual sst_virtual_of_view(const struct sst_posed *posed, int view);

/**
 * A camera high above the middle of a flight that looks down and covers, on the surface, what the placed views' picture
 * centres see and half a picture around each; its rays are parallel within 3 degrees. Its pixels have the views' median
 * size on the surface, larger ones where the picture would have more than `most_pixels`. The picture's top is north
 * where places are geographic, else the middle view's.
 *
 * @return 0, -EINVAL (`up` is unknown, no view is placed, or none meets the surface), -ENOMEM; logged
 */
SST_MUST_CHECK int sst_virtual_nadir(struct sst_virtual *out, const struct sst_posed *posed,
                                     const struct sst_surface *surface, double most_pixels);

/** The same view in a picture of another size, pixels `factor` times as large. */
struct sst_virtual sst_virtual_scaled(const struct sst_virtual *camera, double factor);

/** Direction of the ray of a pixel, world axes; of such a length that t is the depth along the axis. */
void sst_virtual_ray(const struct sst_virtual *camera, double x, double y, double direction[3]);

#endif
