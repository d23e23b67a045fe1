/* pipeline/gpu/clear_sample.h - the shaders `clear_surface` and `clear_sample`: clear pictures whose rays are sampled
 * from raw frames.
 *
 * After clear_land, clear_surface finds the surface of each pixel. Then clear_sample goes through the views one by one,
 * the nearest to the viewpoint first, as each reads a frame of its own: it replaces the view's landed rays with the
 * colours of the rays that see the surface. At last clear_blend, with `sampled`, makes the picture of them. The
 * surfaces equal the CPU's. A ray is interpolated once, at its place in the frame (pipeline/kernels/place_patch.h),
 * which may differ from the CPU's by 1/256 px; near the fold of a lens by more, or be missing.
 */
#ifndef SST_PIPELINE_GPU_CLEAR_SAMPLE_H
#define SST_PIPELINE_GPU_CLEAR_SAMPLE_H

#include "pipeline/gpu/clear.h"
#include "pipeline/gpu/rectify.h"

/** What is known of a pixel's surface while its rays are sampled. */
struct sst_gpu_clear_state {
    float level;     /* of the surface, as clear_surface of kernels.h has it; 0: there is none */
    float px;        /* its disparity */
    uint32_t wanted; /* rays of full weight that are missing */
};

/** A flag beside SST_GPU_RECTIFY_LIT: the view has no frame, and its rays are left to clear_blend. */
#define SST_GPU_SAMPLE_PLAIN 8U

struct sst_gpu_clear_sample {
    struct sst_gpu_rectify frame; /* `first`, `top`, part_x and part_y are not read; with SST_GPU_SAMPLE_PLAIN nor are
                                     buffers and members for frames */
    float bx, by;                 /* of the view, as of struct sst_gpu_clear_view */
    int32_t top, rows;            /* of the picture */
    int32_t cell_rows;            /* pieces of a column */
    uint32_t view;                /* whose landed rays these are */
};

enum sst_gpu_clear_ray {
    SST_GPU_RAY_NONE = 0,
    SST_GPU_RAY_RIM = 1, /* it counts little */
    SST_GPU_RAY_FULL = 2,
    SST_GPU_RAY_PLAIN = 4, /* with one of these: its colour is that between the view's own pixels */
};

#endif
