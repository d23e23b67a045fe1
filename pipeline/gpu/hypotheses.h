/* pipeline/gpu/hypotheses.h - the shaders of the second pass of matching: costs of a view's hypotheses, their
 * optimisation, the choice.
 *
 * All numbers are integers, and equal those of hypothesis_cost_row and hypothesis_path_row of
 * pipeline/kernels/kernels.h on every device. Each pixel has SST_HYPOTHESES entries.
 */
#ifndef SST_PIPELINE_GPU_HYPOTHESES_H
#define SST_PIPELINE_GPU_HYPOTHESES_H

#include "pipeline/gpu/match.h"

/* Structures have the layout of the shaders (std430). */

/** A view to test against, as struct sst_hypothesis_test has it. */
struct sst_gpu_hypothesis_view {
    int32_t x, y, dx, dy;
    uint32_t first; /* its pixel (0, 0) in the buffer of pixels */
};

/* Pixels are uint32_t[height][width] by view: R, G, B and a depth code from the lowest byte up. */

/** `hypothesis_cost`: groups of 32 x 8 pixels. */
struct sst_gpu_hypothesis_cost {
    int32_t width, height, views;
    uint32_t own;               /* the view's pixel (0, 0) */
    int32_t tolerance, similar; /* struct sst_hypothesis_test */
    uint32_t most;    /* largest disparity with a depth code of its own: code[d] = 1 + min(d, most) * 253 / most */
    uint32_t settled; /* struct sst_hypothesis_test; such pixels then have one hypothesis */
    uint32_t change;  /* added to the costs of all hypotheses but the first */
    uint32_t cheap;   /* first costs between `change` and this are marked */
};

/** `hypothesis_path`: all paths of directions way .. way + ways - 1 of sst_gpu_way(), which are straight: four a group
 * along y, a layer of groups along x a direction. */
struct sst_gpu_hypothesis_path {
    int32_t width, height;
    uint32_t own;
    int32_t near; /* struct sst_hypothesis_penalty */
    int32_t way, ways;
    int32_t first; /* not 0: set the sums instead of adding to them; one direction */
};

#define SST_GPU_HYPOTHESIS_PATHS 4 /* of a group */

/** `hypothesis_choice`: groups of 64 pixels, 1024 of them along x. */
struct sst_gpu_hypothesis_choice {
    uint32_t pixels;
};

#define SST_GPU_HYPOTHESIS_PIXELS 64   /* of a group */
#define SST_GPU_HYPOTHESIS_ACROSS 1024 /* groups */

#endif
