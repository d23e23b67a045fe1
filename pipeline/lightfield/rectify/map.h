/* pipeline/lightfield/rectify/map.h - what resampling needs to know of a map. Inside pipeline/lightfield/rectify only. */
#ifndef SST_PIPELINE_LIGHTFIELD_RECTIFY_MAP_H
#define SST_PIPELINE_LIGHTFIELD_RECTIFY_MAP_H

#include "pipeline/lightfield/rectify/rectify.h"

/** The exact chain of one view: rectified pixel to ray, to the camera's axes, through the lens. */
struct sst_chain {
    struct sst_calib_camera cam;
    double turn[9];          /* camera axes from rectified axes */
    double focal_px, cx, cy; /* of the rectified view, its scale included */
    int raw_width, raw_height;
};

struct sst_light_map;

struct sst_rectify_map {
    struct sst_chain chain;
    int width, height; /* of the rectified view */
    int shift;         /* cells of (1 << shift) pixels */
    int cells_x, cells_y;
    double (*node)[2];           /* [cells_y + 3][cells_x + 3] places at the corners of cells, one more cell around */
    uint8_t *cell;               /* [cells_y][cells_x] enum cell of map.c */
    struct sst_light_map *light; /* NULL: nothing to correct */
};

#endif
