/* mrcal's .cameramodel: a Python dictionary. rt_fromref is a rotation vector and a translation in metres that take
 * points from the reference into the camera; pixel centres on integers; lenses as OpenCV's. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/camera/format_parts.h"

#define METRE_MM 1000.0

static void put_model(FILE *f, const struct sst_calib *calib, int view)
{
    const struct sst_calib_camera *c = &calib->camera[view];
    double rt[6];

    sst_rotation_to_vector(c->rotation, rt);
    sst_camera_translation(c, METRE_MM, rt + 3);
    if (c->lens)
        fprintf(f, "{\n    'lensmodel': 'LENSMODEL_OPENCV%d',\n", c->lens);
    else
        fputs("{\n    'lensmodel': 'LENSMODEL_PINHOLE',\n", f);
    fputs("    # fx, fy, cx, cy, then k1, k2, p1, p2, k3, k4, k5, k6\n    'intrinsics': [ ", f);
    sst_put_numbers(f, (const double[]){ c->fx, c->fy, c->cx, c->cy }, 4);
    if (c->lens)
        fputs(", ", f);
    sst_put_numbers(f, c->k, c->lens);
    fputs(" ],\n    # rt_fromref, metres\n    'extrinsics': [ ", f);
    sst_put_numbers(f, rt, 6);
    fprintf(f, " ],\n    'imagersize': [ %d, %d ],\n}\n", calib->width, calib->height);
}

int sst_mrcal_write(const struct sst_calib *calib, const char *path, const struct sst_calib_format_config *cfg)
{
    return sst_calib_write_each(calib, path, ".cameramodel", cfg, put_model);
}
