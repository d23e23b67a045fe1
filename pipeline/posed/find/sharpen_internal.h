/* pipeline/posed/find/sharpen_internal.h - views in registration: sharpen.c turns them, warm.c finds the lens of a
 * flight. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_FIND_SHARPEN_INTERNAL_H
#define SST_PIPELINE_POSED_FIND_SHARPEN_INTERNAL_H

#include <math.h>

#include "pipeline/posed/find/find_internal.h"
#include "pipeline/posed/find/sharpen.h"
#include "pipeline/posed/surface_internal.h"

#define SHARP_RAD (M_PI / 180)

/** Views, their scores and the plane in work. */
struct sharp {
    const struct sst_sharpen_config *cfg;
    struct greys greys;
    int n, threads;
    int *view;                     /* [n] of the light field */
    struct sst_deep *score;        /* [n] */
    struct sst_deep *square;       /* [n] */
    double (*given)[9];            /* [n] rotations */
    double (*turned)[3];           /* [n] rad about the view's axes */
    double focal, k1;              /* before the views' own lenses, as sst_camera_adjust() */
    struct sst_calib_camera *bare; /* [n] with the given lenses */
    struct sst_virtual camera;
    struct sst_integral *sum, *squares, *one;
    double normal[3], across[2][3];
    double at[3];             /* distance, two slopes of the plane */
    double zero_mm;           /* distance of the ground as the source has it; 0: unknown */
    struct sst_map_f32 *seen; /* [n] scores on the plane */
    struct sst_map_f32 total; /* sums of the scores */
    struct sst_map_u16 count;
    double turn_sigma; /* rad, of the given rotations */
    double sigma_px;
    int reach, least;
};

struct sst_surface sharp_plane(const struct sharp *s, const double at[3]);

/** Views as they are assumed: given rotations, each turned about the view's own axes, and the lens. */
void sharp_rotate(struct sharp *s);

/** Mean product of the scores of two views that see a place, over places that a quarter of the most views see.
 * @return 0, or an error */
int sharp_measure(double *out, struct sharp *s, const double at[3]);

/** Scores of all views on the plane, and their sums. @return 0, or an error */
int sharp_see(struct sharp *s);

/** Smooth a square of values by a Gaussian. @param work  [side * side] @param sigma  px */
void sharp_smooth_square(double *v, double *work, int side, double sigma);

/** Place of a parabola's top through three values, from the middle one. */
double sharp_top(double l, double c, double r);

/** Register all views on the plane, from far to near. @param first  round: later ones reach less far @return 0, or an
 * error */
int sharp_register(struct sharp *s, int first);

/** One lens for all views, if warm places show it; else turns about all three axes, if they are sharper.
 * @param known  the source knows the plane @param sharp  out: sharpness reached @return 0, or an error */
int sharp_refine_lens(struct sharp *s, bool known, double *sharp, struct sst_sharpened *out);

#endif
