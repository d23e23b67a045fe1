/* pipeline/lightfield/rectify/rectify_internal.h - what the files of this folder share; code outside of it includes the
 * public headers. */
#ifndef SST_PIPELINE_LIGHTFIELD_RECTIFY_RECTIFY_INTERNAL_H
#define SST_PIPELINE_LIGHTFIELD_RECTIFY_RECTIFY_INTERNAL_H

#include "pipeline/lightfield/rectify/rectify.h"

/* --- light_map: factors that make the light of one view that of the array's mean camera. --- */

/*
 * The factor at a rectified pixel is 1 / (gain falloff) at the place in the raw picture where it comes from, in linear
 * light. The common target is the mean camera of the array at its principal point: what it shows without clipping stays
 * unclipped everywhere, and a view clips only what a mean camera would have clipped. Samples near white stay near white
 * where the factor is below 1 (see sst_light_row_fn): what a sensitive camera has clipped does not become a tinted
 * grey. Factors are limited to 1/8 .. 8.
 *
 * Use: resample a row to values in 1/128, fetch the row's factors, let the kernel light_row make bytes of both, colour
 * by colour.
 */
struct light_map; /* of one view; any number of threads may use it */

/**
 * @param out  NULL where there is nothing to correct: gain 1 and no fall-off; then samples are rounded as they are
 * @return 0, -ENOMEM (not logged)
 */
SST_MUST_CHECK int light_map_create(struct light_map **out, const struct sst_rectified *to,
                                    const struct sst_calib *calib, int view);
/** NULL is fine. */
void light_map_destroy(struct light_map *map);

/** What a row needs: factors of the fall-off alone, their 2.4th roots, and the same of each colour's gain. */
struct light_factors {
    const float *falloff, *falloff_root; /* [n], the scratch given */
    float gain[3], gain_root[3];
};

/**
 * Factors of the rectified pixels (x0 + i, y), i = 0 .. n-1: the factor of colour c is gain[c] falloff[i]. Between
 * nodes less than 1/48 of the picture apart they are bilinear: within 5e-4 of the exact ones (measured: 2.4e-4 where a
 * corner loses a third of the light).
 *
 * @param x0, y    need not be whole: positions between pixels are those of rays that are sampled from raw frames
 * @param scratch  [2 n]
 */
void light_map_row(const struct light_map *map, double x0, double y, int n, float *scratch, struct light_factors *out);

/* --- map: what resampling needs to know of a map. Inside pipeline/lightfield/rectify only. --- */

/** The exact chain of one view: rectified pixel to ray, to the camera's axes, through the lens. */
struct rectify_chain {
    struct sst_calib_camera cam;
    double turn[9];          /* camera axes from rectified axes */
    double focal_px, cx, cy; /* of the rectified view, its scale included */
    int raw_width, raw_height;
};

struct light_map;

struct sst_rectify_map {
    struct rectify_chain chain;
    int width, height; /* of the rectified view */
    int shift;         /* cells of (1 << shift) pixels */
    int cells_x, cells_y;
    double (*node)[2];       /* [cells_y + 3][cells_x + 3] places at the corners of cells, one more cell around */
    uint8_t *cell;           /* [cells_y][cells_x] enum cell of map.c */
    struct light_map *light; /* NULL: nothing to correct */
};

#endif
