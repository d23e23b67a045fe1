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

enum sst_gpu_sweep_points_buffer {
    SST_GPU_SWEEP_POINTS_VIEWS = 0,  /* struct sst_gpu_hypothesis_view[] */
    SST_GPU_SWEEP_POINTS_PIXELS = 1, /* as of `hypothesis_cost` */
    SST_GPU_SWEEP_POINTS_MAP = 2,    /* of the view */
    SST_GPU_SWEEP_POINTS_OUT = 3,    /* out, uint32_t[rows][columns]: level | weight << 16; weight 0: no point */
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

enum sst_gpu_sweep_gather_buffer {
    SST_GPU_SWEEP_GATHER_POINTS = 0,  /* struct sst_gpu_sweep_point[] */
    SST_GPU_SWEEP_GATHER_SHIFTS = 1,  /* int32_t[sweeps][levels][2]: x and y that a point's place is reduced by */
    SST_GPU_SWEEP_GATHER_WEIGHTS = 2, /* in and out, uint32_t[rows][cols][levels] */
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

enum sst_gpu_sweep_peaks_buffer {
    SST_GPU_SWEEP_PEAKS_MAP = 0, /* of the view */
    SST_GPU_SWEEP_PEAKS_WEIGHTS = 1,
    SST_GPU_SWEEP_PEAKS_OUT = 2, /* out, uint32_t[rows][cols][SST_GPU_CELL_PEAKS]: disparity, SST_DISP_NONE: no more;
                                    SST_GPU_SWEEP_ABSENT */
};

#endif
