/* pipeline/gpu/limits.h - the shader `limits`: what a device reaches at most, which the stages are measured against.
 *
 * Without rounds it copies; with rounds each of 16 sums of an invocation is multiplied and increased once a round.
 */
#ifndef SST_PIPELINE_GPU_LIMITS_H
#define SST_PIPELINE_GPU_LIMITS_H

#include "pipeline/gpu/gpu.h"

/* The structure has the layout of pipeline/kernels/limits.comp (std430). */

/** Buffers, by binding. */
enum sst_gpu_limits_buffer {
    SST_GPU_LIMITS_FROM = 0, /* float [count][4] */
    SST_GPU_LIMITS_TO = 1,   /* out, float [count][4] */
    SST_GPU_LIMITS_BUFFERS
};

struct sst_gpu_limits {
    uint32_t count, rounds;
};

#define SST_GPU_LIMITS_GROUP    256
#define SST_GPU_LIMITS_PRODUCTS 16 /* of one round and four floats */

#endif
