/* pipeline/gpu/tiles.h - the shader `tiles`: copies rectangles of pixels between buffers, or labels to pixels. Parts of
 * pictures that change are gathered with it, and put where they belong. */
#ifndef SST_PIPELINE_GPU_TILES_H
#define SST_PIPELINE_GPU_TILES_H

#include "pipeline/gpu/gpu.h"

/* Structures have the layout of pipeline/kernels/tiles.comp (std430). */

/** A rectangle: its first pixel in both buffers. Those of a dispatch must not overlap where they are written. */
struct sst_gpu_rectangle {
    uint32_t from, to;
    uint32_t width, height;
};

/** Buffers, by binding. */
enum sst_gpu_tiles_buffer {
    SST_GPU_TILES_LIST = 0, /* struct sst_gpu_rectangle[] */
    SST_GPU_TILES_FROM = 1, /* uint32_t[]; with SST_GPU_TILES_LABELS uint8_t[] */
    SST_GPU_TILES_TO = 2,   /* in and out, uint32_t[] */
    SST_GPU_TILES_BUFFERS
};

/** A group copies the rectangle first + its number. */
struct sst_gpu_tiles {
    int32_t from_pitch, to_pitch; /* pixels of a row */
    uint32_t first;
    uint32_t flags; /* enum sst_gpu_tiles_flag */
};

enum sst_gpu_tiles_flag {
    SST_GPU_TILES_LABELS = 1, /* bytes, which replace the highest byte of the pixels; else pixels are replaced */
};

#endif
