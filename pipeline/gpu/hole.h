/* pipeline/gpu/hole.h - the shaders `hole_pull` and `hole_push`: the holes of clear pictures (design.md, 5.6).
 *
 * A pyramid of weighted means, each level half the size of the finer one, up to a single pixel: hole_pull makes a level
 * from the finer one or from the picture, hole_push fills a level or the picture from the coarser one. Both give the
 * bits of pipeline/kernels/pyramid_ref.h.
 */
#ifndef SST_PIPELINE_GPU_HOLE_H
#define SST_PIPELINE_GPU_HOLE_H

#include "pipeline/gpu/gpu.h"

/** Constants of both (std430, pipeline/kernels/hole.glsl). */
struct sst_gpu_hole {
    int32_t width, height; /* of the finer level, or of the picture; the coarser one has half of it, rounded up */
    uint32_t finer;        /* where the levels begin in their buffer; not read with from_picture */
    uint32_t coarser;
    uint32_t from_picture; /* not 0: the finer level is the picture */
};

/** Buffers, by binding. A group has GROUP_WIDTH x GROUP_HEIGHT pixels: of the coarser level for hole_pull, of the finer
 * one for hole_push. */
enum sst_gpu_hole_buffer {
    SST_GPU_HOLE_LEVELS = 0,  /* in and out, float[4] a pixel, levels one after the other: R, G, B times weight, the
                                 weight 0..1; once filled R, G, B */
    SST_GPU_HOLE_PICTURE = 1, /* in, of hole_push also out: uint32_t[height * width]: R, G, B, weight 0..255 */
};

#define SST_GPU_HOLE_GROUP_WIDTH  32
#define SST_GPU_HOLE_GROUP_HEIGHT 4
#define SST_GPU_HOLE_LEVELS_MOST  17 /* levels of sides up to 2^16 */

#endif
