/* pipeline/gpu/sweep.h - the shaders of the sweep of the second pass of matching: points in space that a view finds,
 * and the disparities at which points gather, seen from another view.
 *
 * All numbers are integers, and equal those of sst_sweep_view() and sst_sweep_candidates() on every device.
 */
#ifndef SST_PIPELINE_GPU_SWEEP_H
#define SST_PIPELINE_GPU_SWEEP_H

#include "pipeline/gpu/hypotheses.h"
#include "pipeline/gpu/surfaces.h"

/* Structures have the layout of the shaders (std430). */

#define SST_GPU_SWEEP_LEVELS 256        /* at most */
#define SST_GPU_CELL_PEAKS   6          /* of a cell */
#define SST_GPU_SWEEP_ABSENT (1U << 16) /* of a peak: the map hardly has it around there */

/** `sweep_points`: a group per sparse pixel, from half a stride on: sst_gpu_sweep_samples() along x and y. */
struct sst_gpu_sweep {
    struct sst_gpu_hypothesis_cost test; /* a disparity of the pixel's own that costs less than `settled` explains it;
                                            `change` and `cheap` are not used */
    int32_t stride;                      /* pixels */
    int32_t level, levels;               /* disparities that are tested: multiples of `level`, 1/64 px */
    int32_t apart;                       /* levels: nearer ones are the same surface */
    int32_t distinct, weight_most;       /* least and largest distance to the next surface that counts */
};

/** Sparse pixels along an axis. */
static inline int sst_gpu_sweep_samples(int size, int stride)
{
    return (size - stride / 2 + stride - 1) / stride;
}

/** `sweep_gather`: a point per invocation: groups as of `hypothesis_choice`. */
struct sst_gpu_sweep_gather {
    uint32_t points;
    int32_t levels, cell, cols, rows; /* pixels of a cell's side; cells of the view */
};

struct sst_gpu_sweep_point {
    uint32_t at;    /* x | y << 16 */
    uint32_t found; /* level | weight << 8 | number of the sweep << 16 */
};

/** `sweep_peaks`: a group per cell, along x and y. */
struct sst_gpu_sweep_peaks {
    int32_t width, height;
    int32_t stride;               /* between the pixels of its map that are counted, from half of it on */
    int32_t cell, cols, rows;     /* cell: a multiple of stride */
    int32_t levels, level, apart; /* apart: levels next to a peak that are no other one */
    uint32_t gathered;            /* weight that makes a peak */
    uint32_t mapped;              /* sparse pixels of the map that do not make a surface, each counted twice */
};

#endif
