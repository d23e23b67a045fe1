/* pipeline/posed/surface_internal.h - private to surfaces and their renderers: vectors, places of virtual pixels in
 * views. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_SURFACE_INTERNAL_H
#define SST_PIPELINE_POSED_SURFACE_INTERNAL_H

#include <math.h>

#include "pipeline/image/deep.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/posed/render.h"

static inline double vector_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline double vector_length(const double a[3])
{
    return sqrt(vector_dot(a, a));
}

static inline void vector_cross(double out[3], const double a[3], const double b[3])
{
    const double c[3] = { a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0] };

    out[0] = c[0];
    out[1] = c[1];
    out[2] = c[2];
}

/* To length 1; of length 0 it stays. */
static inline void vector_unit(double a[3])
{
    const double length = vector_length(a);

    for (int i = 0; i < 3 && length > 0; i++)
        a[i] /= length;
}

/* --- warp: places of a virtual camera's pixels, on a surface, in a view ---------------------------------------------
 */

#define WARP_CELL     16 /* px: rows of a band, and the largest cell between whose corners places are interpolated */
#define WARP_ERROR_PX 0.05

/* Depths along the virtual camera's rays at the corners of cells, found when they are first used. */
struct warp {
    struct sst_virtual camera;
    struct sst_surface surface;
    int across;   /* columns of cells */
    int bands;    /* rows of cells */
    float *depth; /* [bands][WARP_CELL + 1][across * WARP_CELL + 1]; below 0: not yet computed, INFINITY: none */
    float *base;  /* depths of the surface itself, of warp_keep(); NULL: they are not kept */
    double rise_mm;
    bool coarse;
};

/* Segments of the rows of one band in one view. One thread. */
struct warp_rows {
    struct sst_warped_segment *segment[WARP_CELL]; /* [segments[r]], room for one a pixel */
    int segments[WARP_CELL];
};

/* Part of a cell: its rows by bits, and columns from .. to - 1; rows 0: none. */
struct warp_part {
    uint16_t rows;
    uint8_t from, to;
};

/* @return 0, -ENOMEM; not logged */
SST_MUST_CHECK int warp_init(struct warp *warp, const struct sst_virtual *camera, const struct sst_surface *surface);
/* Forget the depths, for another surface. */
void warp_restart(struct warp *warp, const struct sst_surface *surface);
/* Keep depths for warp_raise(). @return 0, -ENOMEM; not logged */
SST_MUST_CHECK int warp_keep(struct warp *warp);
/* Move each ray's place on the surface back along the ray, `mm` along the normal: a plane becomes the parallel one, terrain
 * is met once for all heights. @param coarse  inverse depths of the surface itself are bilinear inside of cells */
void warp_raise(struct warp *warp, double mm, bool coarse);
void warp_fini(struct warp *warp);
SST_MUST_CHECK int warp_rows_init(struct warp_rows *rows, const struct warp *warp);
void warp_rows_fini(struct warp_rows *rows);

/*
 * A view as pixels are projected into it: P = turn (a, b, 1) depth + move with (a, b) of the virtual camera's rays, its
 * lens up to where that folds over, and its picture's size.
 */
struct warp_view {
    const struct sst_calib_camera *camera;
    double turn[9], move_mm[3];
    double most_r2;
    int width, height; /* at most 32767 */
};
struct warp_view warp_view_of(const struct sst_virtual *from, const struct sst_calib_camera *camera, int width,
                              int height);

/* A picture as the kernel reads it; may it, of this size? */
struct sst_warped_source warp_source(const struct sst_deep *picture);
bool warp_source_fits(int width, int height);
/* @return 0, -EBADMSG: the kernel may not read the pictures of a light field; logged */
SST_MUST_CHECK int warp_check_size(const struct sst_posed *posed, const char *dir);

/* Segments of one band; different bands may be computed at once. */
void warp_band(struct warp_rows *rows, struct warp *warp, const struct warp_view *view, int band);
/* ... of parts of its cells. @param part  [warp.across]; NULL: all */
void warp_cells(struct warp_rows *rows, struct warp *warp, const struct warp_view *view, int band,
                const struct warp_part *part);

/* --- greys: small grey pictures of a few views -----------------------------------------------------------------------
 */

#define GREY_SPREAD 4096 /* levels: the standard deviation of every picture */

struct greys {
    int count, step;                 /* step: of greys_step(). Set before greys_read() */
    int width, height;               /* of the pictures: as greys_cameras() */
    struct sst_deep *picture;        /* [count] */
    struct sst_calib_camera *camera; /* [count] */
    const bool *needed;              /* [count] others stay empty; NULL: all are needed */
};

/* Pixels of a view that one of its grey picture is wide: as many as asked for, fewer where a side is short. */
int greys_step(const struct sst_posed *posed, int step);

/* Cameras of the pictures, before these are read; greys_read() has it done. @return 0, -ENOMEM; logged */
SST_MUST_CHECK int greys_cameras(struct greys *out, const struct sst_posed *posed, const int view[]);
/* @return as sst_posed_picture(), -EBADMSG (as warp_check_size()), -ENOMEM; logged; then nothing is to be freed */
SST_MUST_CHECK int greys_read(struct greys *out, const struct sst_posed *posed, const char *dir, const int view[],
                              int threads);
void greys_fini(struct greys *greys);

/* Placed views whose centres are near the virtual camera's: those within about a third of a picture on a surface at a
 * distance, evenly, else the nearest ones. @return how many, -ENOMEM */
int greys_choose(int view[], int most, const struct sst_posed *posed, const struct sst_virtual *camera,
                 double distance_mm);

/* --- agree: agreement of grey views on a surface
 * ---------------------------------------------------------------------- */

/* Pixels of a surface: that four views see, and where the windows of at least four (of three views: all) and six views
 * agree with one view's; spread: roots of the agreement in tiles of 32x32 px, summed, so that no few patches outweigh a surface. */
struct agree_tally {
    int64_t seen, four, six;
    double spread;
    int64_t pairs, agreeing; /* windows with texture of compared pairs; agreeing windows */
};

struct agree_rows;

struct agree {
    struct warp warp;
    struct warp_rows *rows; /* [threads] */
    const struct greys *greys;
    int threads;
    int16_t *level;            /* [views][height][width] as of kernels/windows.h; 0 where not seen */
    uint8_t *seen;             /* [views][height][width] */
    int *pixels;               /* [views][warp.bands] that are seen */
    struct agree_rows *worker; /* [threads] */
    struct agree_tally *tally; /* of bands */
    double least_apart_mm;     /* of the views of a compared pair; 0: all pairs */
};

/* @param greys  at least two; borrowed @return 0, -ENOMEM; not logged */
SST_MUST_CHECK int agree_init(struct agree *agree, const struct sst_virtual *camera, const struct sst_surface *surface,
                              const struct greys *greys, int threads);
void agree_fini(struct agree *agree);
SST_MUST_CHECK int agree_on(struct agree_tally *out, struct agree *agree, const struct sst_surface *surface);

/* --- layers: weights of rays by the surface that their view sees -----------------------------------------------------
 */

#define LAYER_OTHERS 4 /* views that each view is compared with, at most */
#define LAYER_WINDOW 7 /* px of the compared pictures */

/* Cells of WARP_CELL px of a view's grey picture without distortion. */
struct layer_cells {
    int across, bands;
    uint8_t *cell; /* [bands][across] 1: the virtual camera sees it; NULL: none */
};

/* Cells of views inside a virtual camera's picture of a surface. `out` is [greys.count], zeroed; greys_cameras() before.
 * @return 0, -ENOMEM; not logged */
SST_MUST_CHECK int layer_cells_find(struct layer_cells out[], const struct greys *greys, const struct sst_virtual *camera,
                                    const struct sst_surface *surface, int threads);

struct layers {
    const struct greys *greys;
    struct sst_surface surface;
    double distance_mm;         /* of the surface from the views, about */
    double step;                /* 1 / mm: between surfaces, of the inverse distance */
    int steps;                  /* surfaces in front of the given one */
    int (*other)[LAYER_OTHERS]; /* [views] by distance to the best baseline; -1: none */
    struct layer_cells *seen;   /* [views] where weights are needed */
};

/* Height of a step's surface above the given one, mm; steps below 0 are under it. */
double layers_height(const struct layers *layers, int step);

/* Weights of a view's rays, 0 to 255, on its grey picture's pixels without distortion. @param out  initialised here
 * @return 0, -ENOMEM; not logged. Thread: any */
SST_MUST_CHECK int layers_weigh(struct sst_map_u8 *out, const struct layers *layers, int view);

/* Is any pixel of any view? */
bool posed_any(const struct sst_map_u16 *views);

/* Stretch of the pixels that a view sees: unseen ones repeat the one before. @return 0, -ENOMEM; not logged */
SST_MUST_CHECK int posed_stretch(struct sst_samples *out, const struct sst_deep *levels,
                                 const struct sst_map_u16 *views);

/* --- weighted: sums of weighted rays ---------------------------------------------------------------------------------
 */

#define WEIGHT_ONE (1 << (SST_WEIGHTED_SHIFT - SST_WARPED_SHIFT)) /* of maps of weights of 0 to 255 */

struct weighted_row;

/* Sums of all views at the virtual camera's pixels; levels in 1/64. */
struct weighted {
    struct warp warp;
    struct weighted_row *row; /* [threads] */
    int channels, threads;
    uint32_t *sum[3], *weight; /* [height][width] of levels; of weights */
    float *weighted[3];        /* of their products */
    uint16_t *count;           /* of views */
};

/* A view to add: its places are `places`' of `view`, or computed by `warp`. */
struct weighted_view {
    const struct sst_deep *picture;
    const struct sst_map_u16 *weight; /* of weights_in_picture() */
    struct warp_view warp;
    const struct sst_integral_places *places;
    int view;
};

/* @return 0, -ENOMEM; not logged */
SST_MUST_CHECK int weighted_init(struct weighted *out, const struct sst_virtual *camera,
                                 const struct sst_surface *surface, int channels, int threads);
void weighted_fini(struct weighted *w);

/* Weights of a picture's rays, from undistorted ones, with a border; at least `least`. @param cam  of the grey
 * picture. @return 0, -ENOMEM; not logged */
SST_MUST_CHECK int weights_in_picture(struct sst_map_u16 *out, const struct sst_map_u8 *weight,
                                      const struct sst_calib_camera *cam, int least);

/* @param step  of the grey pictures. @return 0 */
SST_MUST_CHECK int weighted_add(struct weighted *w, const struct weighted_view view[], int n, int step);

/* A band's places that are kept. @param segments  [WARP_CELL] of each row, one row after another */
const struct sst_warped_segment *integral_kept(const int **segments, const struct sst_integral_places *places, int view,
                                               int band);

/* --- clear: pictures with weighted rays ------------------------------------------------------------------------------
 */

/*
 * Render with rays weighed by the surface that their view sees.
 *
 * Every view is compared with up to four others about a ground's parallax of 25 px away, on surfaces from the given one
 * up to the highest points of the scene: windows of 7x7 pixels, the mean correlation of the two best views. A ray's
 * weight is high where the view agrees with others on the surface better than on any in front of it.
 *
 * See-through: rays weigh 0.05 at least. Clear: rays that something in front blocks do not count; pixels with less than
 * 1.2 rays in sum are unknown: `views` is 0 there, the mean NAN, and the levels show the integral, dimmed. Between
 * known and unknown pixels the levels change gradually.
 *
 * @return as sst_posed_render(); -ENODATA: fewer than three views are placed
 */
SST_MUST_CHECK int render_weighted(struct sst_posed_rendered *out, const struct sst_posed *posed, const char *dir,
                                   const struct sst_posed_render_config *cfg);

/* --- specks -------------------------------------------------------------------------------------------------------- */

/* Remove what windows of `window_px` cannot show, regions of half of a window's area at most: regions of
 * more than limits[0] rays get none, enclosed ones of limits[1] rays at most get limits[1]. Saturated ones, which have no
 * texture to correlate, may be four times as large. @param levels  mean of all views @return 0, -ENOMEM */
SST_MUST_CHECK int specks_remove(struct sst_map_f32 *rays, const struct sst_deep *levels, const float limits[2], int window_px);

#endif
