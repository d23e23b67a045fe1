/* pipeline/lightfield/rectify/rectify.h - rectification to a common rotation and K: geometry, maps, resampling. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIGHTFIELD_RECTIFY_RECTIFY_H
#define SST_PIPELINE_LIGHTFIELD_RECTIFY_RECTIFY_H

#include "pipeline/camera/calib.h"
#include "pipeline/image/image.h"

enum sst_filter {
    SST_FILTER_BILINEAR = 0,
    SST_FILTER_BICUBIC = 1, /* Keys 1981, a = -1/2 */
    SST_FILTER_LANCZOS = 2, /* 6 taps: a = 3 */
};

/** Common geometry of the rectified views. */
struct sst_rectified {
    int rows, cols, width, height;
    int reference;
    double focal_px, cx, cy; /* of all views */
    double rotation[9];      /* rectified axes from the rig's: z normal to the plane of the centres, x along its rows */
    double spacing_mm;       /* nominal: mean of the two lattice steps */
    double plane_mm;         /* depth at which views off the plane of the centres are exact; 0: infinity */
    double out_rms_mm, out_max_mm;         /* distance of the centres from their plane */
    double lattice_rms_mm, lattice_max_mm; /* in it, from the best regular lattice */
    double step_mm[2], skew_deg;           /* lattice: column and row step, angle between them less 90 degrees */
    struct {
        bool known;
        double bx, by; /* measured offset from the reference in spacings, as stored in the light field */
        double dz_mm;  /* distance in front of the reference's plane */
        double scale;  /* of the picture about (cx, cy); compensates dz at plane_mm */
    } view[SST_MAX_VIEWS];
};

struct sst_rectify_config {
    int width, height; /* 0: as the cameras' */
    double focal_px;   /* 0: the cameras' mean; smaller keeps more of the edges */
    double plane_mm;   /* negative: the calibration's range_mm; 0: infinity */
};

/**
 * Fit plane and lattice to the centres and choose the common rotation and K, so that most of every view stays in the
 * picture. Grids of one row or column use the mean of the cameras' axes for the missing direction. Derived in
 * geometry.c.
 *
 * @return 0, -EINVAL (cfg: sizes, a plane nearer than twice a camera's dz), -EBADMSG (fewer than 2 known cameras,
 * centres that form no lattice or contradict the grid's order: the message names the camera, its distance or the
 * swapped pair; cameras that point away from the plane's normal); logged
 */
SST_MUST_CHECK int sst_rectify_plan(struct sst_rectified *out, const struct sst_calib *calib,
                                    const struct sst_rectify_config *cfg);

/** Fill in view[] from rotation, spacing_mm, plane_mm and reference, which a stored geometry omits. @return 0, -EINVAL
 *  (plane_mm is too near to a camera; logged) */
SST_MUST_CHECK int sst_rectified_place(struct sst_rectified *to, const struct sst_calib *calib);

/** Position of a rectified pixel in the raw picture; the exact chain, in double. @return false: more than 1/512 px
 *  outside the raw picture's outermost pixel centres, behind the camera, or beyond the fold of the lens */
SST_MUST_CHECK bool sst_rectify_point(const struct sst_rectified *to, const struct sst_calib *calib, int view,
                                      const double at[2], double raw[2]);

struct sst_places;      /* pipeline/kernels/kernels.h */
struct sst_place_patch; /* pipeline/kernels/place_patch.h */
struct sst_rectify_map; /* of one view: homography, lens and light fused; any number of threads may use it */

/** @return 0, -EINVAL, -ENOMEM */
SST_MUST_CHECK int sst_rectify_map_create(struct sst_rectify_map **out, const struct sst_rectified *to,
                                          const struct sst_calib *calib, int view);
void sst_rectify_map_destroy(struct sst_rectify_map *map);

/**
 * Positions in the raw picture of the rectified positions (x0 + i, y), i = 0 .. n-1.
 *
 * @param x0, y  inside the rectified picture, with x0 + n - 1 too; may be fractional
 * @param xy_q8  out, [2 n] x, y in 1/256 px, within 1/256 of the exact chain; both INT32_MIN if there is none
 */
void sst_rectify_map_row(const struct sst_rectify_map *map, double x0, double y, int n, int32_t *xy_q8);

/** Rectified picture of a view; caller's memory of the rectified size. */
struct sst_rectified_view {
    struct sst_image *image;  /* out; black without a position in the raw picture */
    struct sst_map_u8 *valid; /* out, 255 where there is one (filter taps beyond the border repeat it); or NULL */
};

/**
 * Resample one view: one pass from raw to rectified, light corrected.
 *
 * @return 0, -EINVAL (sizes), -ENOMEM; not logged
 */
SST_MUST_CHECK int sst_rectify_view(const struct sst_rectified_view *out, const struct sst_rectify_map *map,
                                    enum sst_filter filter, const struct sst_image *raw);

/** Tables that resampling of a view reads, for a device; pointers are borrowed from the map. */
struct sst_rectify_tables {
    int width, height, raw_width, raw_height; /* of the view and of its raw frame */
    int cell_shift, cells, cell_rows; /* pieces of a row, and of a column, of 1 << cell_shift columns or rows each */
    int taps;
    const int16_t *weight; /* [SST_RESAMPLE_PHASES][taps], as of struct sst_resample */
    /* Light: the factor of colour c is gain[c] times the fall-off's, which is bilinear between nodes 1 << light_shift
     * pixels apart. falloff is NULL if there is nothing to correct. */
    int light_shift, light_cols, light_rows;
    const float *falloff, *falloff_root; /* [light_rows][light_cols], and its 2.4th roots */
    float gain[3], gain_root[3];
};
void sst_rectify_map_tables(struct sst_rectify_tables *out, const struct sst_rectify_map *map, enum sst_filter filter);

/** Places that are no cubics. Zeroed at first; xy is to be freed with free(). */
struct sst_rectify_list {
    int32_t *xy; /* pairs, as of sst_rectify_map_row(), or as of struct sst_place_patch */
    size_t count, room;
};

/**
 * The places of a row as cubics of the column within a piece, with its column k at x0 + k.
 *
 * @param x0, y   as for sst_rectify_map_row(); x0 is 0..1
 * @param cells   out, of sst_rectify_map_tables(); enum sst_places_kind where a piece is none
 * @param list    in and out: places of SST_PLACES_LISTED are appended
 * @return 0 or -ENOMEM; not logged
 */
SST_MUST_CHECK int sst_rectify_map_cells(const struct sst_rectify_map *map, double x0, double y,
                                         struct sst_places *cells, struct sst_rectify_list *list);

/**
 * The places of all positions of a view as bicubics of row and column within a piece, which has 1 << cell_shift of
 * both.
 *
 * @param patches  out, [cell_rows][cells] of sst_rectify_map_tables()
 * @param list     in and out: the corners of SST_PLACES_LISTED are appended
 * @return 0 or -ENOMEM; not logged
 */
SST_MUST_CHECK int sst_rectify_map_patches(const struct sst_rectify_map *map, struct sst_place_patch *patches,
                                           struct sst_rectify_list *list);

/** A raw frame prepared for sampling at any rectified position. Any number of threads may sample it. */
struct sst_sampler;

/**
 * @param map  borrowed; raw is copied
 * @return 0, -EINVAL (sizes), -ENOMEM; not logged
 */
SST_MUST_CHECK int sst_sampler_create(struct sst_sampler **out, const struct sst_rectify_map *map,
                                      enum sst_filter filter, const struct sst_image *raw);
void sst_sampler_destroy(struct sst_sampler *sampler);

/** A black raw frame, to be filled part by part. @return 0, -EINVAL, -ENOMEM; not logged */
SST_MUST_CHECK int sst_sampler_create_empty(struct sst_sampler **out, const struct sst_rectify_map *map,
                                            enum sst_filter filter);

/**
 * Store a part of the raw frame, which is inside it. Must not run while another thread samples; parts that do not touch
 * may be stored by several threads.
 *
 * @param rgbx    the part's first pixel: R, G, B and an unused byte each
 * @param stride  bytes
 */
void sst_sampler_put(struct sst_sampler *sampler, const struct sst_rect *part, const uint8_t *rgbx, size_t stride);

/** The raw frame's pixel (0, 0): R, G, B and an unused byte each. @param stride  out, bytes */
const uint8_t *sst_sampler_pixels(const struct sst_sampler *sampler, size_t *stride);

/**
 * Bounding box of the raw pixels that rectified ones depend on: samples in the part depend only on the raw columns
 * box[0] .. box[2]-1 of rows box[1] .. box[3]-1.
 *
 * @param part   inside the rectified picture
 * @param valid  out, of the rectified picture: in the part 255 where a pixel has a position in the raw frame, else 0;
 * or NULL
 * @return false: no pixel has one; box is 0
 */
bool sst_rectify_map_box(const struct sst_rectify_map *map, enum sst_filter filter, const struct sst_rect *part,
                         int box[4], struct sst_map_u8 *valid);

#define SST_SAMPLE_MAX 2048

/** The rectified positions (x0 + i, y), i = 0 .. n-1, as for sst_rectify_map_row(): rays that are sampled from raw
 * frames lie between pixels. */
struct sst_rectified_row {
    double x0, y;
    int n; /* at most SST_SAMPLE_MAX */
};

/**
 * Colours at the positions of a row, sampled from the raw frame with light corrected; at whole positions the same bytes
 * as sst_rectify_view().
 *
 * @param out   three rows of n; black without a position in the raw frame
 * @param seen  [n] 255 where there is one, else 0; or NULL
 */
void sst_sampler_row(const struct sst_sampler *sampler, const struct sst_rectified_row *row, uint8_t *const out[3],
                     uint8_t *seen);

/** "bilinear", "bicubic", "lanczos". */
const char *sst_filter_name(enum sst_filter filter);
/** @return false: no such filter */
SST_MUST_CHECK bool sst_filter_find(enum sst_filter *out, const char *name);

#endif
