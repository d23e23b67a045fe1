/* pipeline/gpu/refine.h - the shaders of label refinement (pipeline/method/refine) and their references.
 *
 * All results equal those of the CPU on every device: whole numbers, and floats of operations that are rounded alike
 * everywhere (pipeline/kernels/surface_ref.h). Where nothing else is said, shaders have groups of 32 x 8 pixels, a
 * thread each.
 */
#ifndef SST_PIPELINE_GPU_REFINE_H
#define SST_PIPELINE_GPU_REFINE_H

#include "pipeline/gpu/gpu.h"
#include "pipeline/kernels/surface_ref.h"

#define SST_GPU_REFINE_WIDTH        32 /* of a group */
#define SST_GPU_REFINE_HEIGHT       8
#define SST_GPU_REFINE_COUNT_HEIGHT 64 /* of a group of refine_count and refine_ground_misses, as wide as others */
#define SST_GPU_REFINE_COLUMN_GROUP 8 /* columns of a group of refine_columns */
#define SST_GPU_REFINE_LABELS       64
#define SST_GPU_REFINE_FAR          (1U << 20) /* larger than any distance */

/* Structures have the layout of the shaders (std430). A view is uint32_t[height][width]: disparity | label << 16. A
 * whole number of 64 bits is uint32_t[2], the lower half first. */

static inline uint64_t sst_gpu_whole(const uint32_t v[2])
{
    return v[0] | (uint64_t)v[1] << 32;
}

static inline void sst_gpu_split(uint32_t v[2], uint64_t whole)
{
    v[0] = (uint32_t)whole;
    v[1] = (uint32_t)(whole >> 32);
}

/** `refine_count`: pixels by label and disparity, over all views. */
struct sst_gpu_refine_count {
    int32_t width, height;
    uint32_t labels; /* that are counted: 1 .. labels */
    uint32_t bins;   /* of a label: disparities below it are counted; at most 65535 */
};

enum sst_gpu_refine_count_buffer {
    SST_GPU_REFINE_COUNT_VIEW = 0,
    SST_GPU_REFINE_COUNT_COUNTS = 1, /* in and out, uint32_t[labels][bins] */
    SST_GPU_REFINE_COUNT_BUFFERS
};

/** `refine_ground_sums`, `refine_ground_misses`, `refine_ground_limit`: what planes of grounds are fitted to. */
struct sst_gpu_refine_fit {
    int32_t width, height;
    uint32_t labels[2]; /* bit i: label i + 1 is fitted */
    uint32_t least[2];  /* limit, 2^-24 */
    uint32_t spread;    /* limit by median residual, 2^-24 */
    uint32_t bins;      /* of residuals, rounded: a multiple of 256 up to 65536 */
};

struct sst_gpu_refine_ground {
    uint32_t a[2], b[2], d0[2], limit[2]; /* struct sst_ground, 2^-24 */
};

/** Over pixels with the label and a disparity whose residual is within the limit; sides are at most 2^15 pixels. */
struct sst_gpu_refine_ground_sums {
    uint32_t n[2], x[2], y[2], d[2], xx[2], xy[2], yy[2], xd[2], yd[2];
};

enum sst_gpu_refine_ground_sums_buffer {
    SST_GPU_REFINE_GROUND_SUMS_VIEW = 0,
    SST_GPU_REFINE_GROUND_SUMS_GROUNDS = 1, /* [SST_GPU_REFINE_LABELS] */
    SST_GPU_REFINE_GROUND_SUMS_OUT = 2,     /* in and out, [SST_GPU_REFINE_LABELS] */
    SST_GPU_REFINE_GROUND_SUMS_BUFFERS
};

/** Of all pixels with the label and a disparity; larger residuals are in the last bin. */
enum sst_gpu_refine_ground_misses_buffer {
    SST_GPU_REFINE_GROUND_MISSES_VIEW = 0,
    SST_GPU_REFINE_GROUND_MISSES_GROUNDS = 1,
    SST_GPU_REFINE_GROUND_MISSES_OUT = 2, /* in and out, uint32_t[labels that are fitted][bins] */
    SST_GPU_REFINE_GROUND_MISSES_BUFFERS
};

/** Limits from these histograms, of less than 2^31 pixels each; as many groups as labels that are fitted. */
enum sst_gpu_refine_ground_limit_buffer {
    SST_GPU_REFINE_GROUND_LIMIT_MISSES = 0,  /* in; then 0 */
    SST_GPU_REFINE_GROUND_LIMIT_GROUNDS = 1, /* in and out: limits */
    SST_GPU_REFINE_GROUND_LIMIT_BUFFERS
};

/** `refine_extents`: outermost pixels of the labels in each row; a group per row. */
struct sst_gpu_refine_extents {
    int32_t width, height;
    uint32_t labels; /* 1 .. labels, at most SST_GPU_REFINE_LABELS */
};

enum sst_gpu_refine_extents_buffer {
    SST_GPU_REFINE_EXTENTS_VIEW = 0,
    SST_GPU_REFINE_EXTENTS_OUT = 1, /* out, uint32_t[labels][height]: first | last << 16; 0xFFFF: none */
    SST_GPU_REFINE_EXTENTS_BUFFERS
};

/* The shaders below work on bands of a view: rows top .. top + rows - 1 of it. Where [rows] is said, buffers have these
 * alone. */

/** `refine_mask`: candidates of every pixel without a label; label i + 1 is bit i. */
struct sst_gpu_refine_mask {
    int32_t width, height;
    uint32_t planar[2], ground[2];
    int32_t top, rows;
};

enum sst_gpu_refine_mask_buffer {
    SST_GPU_REFINE_MASK_VIEW = 0,
    SST_GPU_REFINE_MASK_TABLE = 1,   /* uint32_t[65535][2], by disparity */
    SST_GPU_REFINE_MASK_GROUNDS = 2, /* [SST_GPU_REFINE_LABELS] */
    SST_GPU_REFINE_MASK_SEEN = 3,    /* in and out, uint32_t[4]: labels that compete, and those of conflicts between
                                        objects and grounds */
    SST_GPU_REFINE_MASK_CHOICE = 4,  /* out, [rows][width]: none, for pixels with a conflict */
    SST_GPU_REFINE_MASK_MASK = 5,    /* out, uint32_t[rows][width][2] */
    SST_GPU_REFINE_MASK_BUFFERS
};

/** Nearest candidates so far of a pixel, among objects [0] and grounds [1]. */
struct sst_gpu_refine_choice {
    uint32_t nearest2[2], farthest2[2];
    uint32_t label[2]; /* 0: none yet */
};

/** `refine_columns`: vertical distances to the nearest pixel with a label. */
struct sst_gpu_refine_columns {
    int32_t width, height;
    uint32_t label;
    int32_t top, rows;
};

enum sst_gpu_refine_columns_buffer {
    SST_GPU_REFINE_COLUMNS_VIEW = 0,
    SST_GPU_REFINE_COLUMNS_OUT = 1, /* out, uint32_t[rows][width]; SST_GPU_REFINE_FAR: none in this column */
    SST_GPU_REFINE_COLUMNS_BUFFERS
};

/** `refine_compete`: one label among the candidates of pixels with a conflict. */
struct sst_gpu_refine_compete {
    int32_t width, height;
    uint32_t label;
    uint32_t kind;    /* 0: an object, 1: a ground */
    uint32_t corners; /* of the hull; 0: the label is absent from the view */
    uint32_t weigh;   /* 0: all distances count as 0 */
    int32_t top, rows;
};

enum sst_gpu_refine_compete_buffer {
    SST_GPU_REFINE_COMPETE_MASK = 0,
    SST_GPU_REFINE_COMPETE_COLUMNS = 1,
    SST_GPU_REFINE_COMPETE_HULL = 2,   /* int32_t[corners][2]: x, y */
    SST_GPU_REFINE_COMPETE_CHOICE = 3, /* in and out */
    SST_GPU_REFINE_COMPETE_BUFFERS
};

/** `refine_sums`: sums of the disparities in the window's rows of each column, y from the pixel. */
struct sst_gpu_refine_window {
    int32_t width, height, radius; /* radius up to 63 */
    int32_t top, rows;
};

struct sst_gpu_refine_sums {
    int32_t n, y, yy;
    uint32_t d;
    int32_t yd;
    uint32_t dd[2];
};

enum sst_gpu_refine_sums_buffer {
    SST_GPU_REFINE_SUMS_VIEW = 0,
    SST_GPU_REFINE_SUMS_OUT = 1, /* out, struct sst_gpu_refine_sums[rows][width] */
    SST_GPU_REFINE_SUMS_BUFFERS
};

/** `refine_planes`, with struct sst_gpu_refine_window: planes of the windows. */
enum sst_gpu_refine_planes_buffer {
    SST_GPU_REFINE_PLANES_SUMS = 0,
    SST_GPU_REFINE_PLANES_OUT = 1, /* out, struct sst_surface_plane[rows][width] */
    SST_GPU_REFINE_PLANES_BUFFERS
};

/** `refine_normals`: of pixels that an object and a ground compete for, and of the pixels of such labels, which are
 * summed up. */
struct sst_gpu_refine_normals {
    int32_t width, height, radius;
    uint32_t mixed[2], ground[2];
    struct sst_surface_frame frame;
    int32_t top, rows;
    int32_t first; /* row of the view where the planes begin; they are there up to `radius` rows around the band */
};

struct sst_gpu_refine_region {
    uint32_t sum_q20[3][2], normals[2], pixels[2];
};

enum sst_gpu_refine_normals_buffer {
    SST_GPU_REFINE_NORMALS_VIEW = 0,
    SST_GPU_REFINE_NORMALS_MASK = 1,
    SST_GPU_REFINE_NORMALS_PLANES = 2,
    SST_GPU_REFINE_NORMALS_REGIONS = 3, /* in and out, [SST_GPU_REFINE_LABELS] */
    SST_GPU_REFINE_NORMALS_OUT = 4,     /* out, float[rows][width][4] where needed: the normal, and 1 if there is one */
    SST_GPU_REFINE_NORMALS_BUFFERS
};

/** `refine_assign`: the label of every pixel; groups of 32 x 8 words. */
struct sst_gpu_refine_assign {
    int32_t width, height;
    uint32_t normals; /* 0: normals do not count */
    float p_distance, p_normal, tau;
    int32_t top, rows;
};

struct sst_gpu_refine_mean {
    float mean[3];
    uint32_t known; /* the region has normals */
};

enum sst_gpu_refine_assign_buffer {
    SST_GPU_REFINE_ASSIGN_VIEW = 0,
    SST_GPU_REFINE_ASSIGN_MASK = 1,
    SST_GPU_REFINE_ASSIGN_CHOICE = 2,
    SST_GPU_REFINE_ASSIGN_NORMALS = 3,
    SST_GPU_REFINE_ASSIGN_MEANS = 4, /* struct sst_gpu_refine_mean[SST_GPU_REFINE_LABELS] */
    SST_GPU_REFINE_ASSIGN_OUT = 5,   /* out, uint8_t[rows][width rounded up to 4] */
    SST_GPU_REFINE_ASSIGN_BUFFERS
};

#endif
