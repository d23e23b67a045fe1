/* pipeline/network/plan.h - a graph made ready for one input size: primitives, weights in their layout, memory. */
#ifndef SST_PIPELINE_NETWORK_PLAN_H
#define SST_PIPELINE_NETWORK_PLAN_H

#include "pipeline/network/graph.h"

SST_EXTERN_C_BEGIN

struct sst_plan; /* one thread at a time */

/* Memory for activations and scratch beyond which a network is refused: no sane one comes near it. */
#define SST_PLAN_MAX_BYTES(pixels) (((size_t)64 << 20) + ((size_t)16 << 10) * (size_t)(pixels))

/**
 * @param graph, shapes  borrowed during the call and, the graph, until destroy; shapes of sst_graph_shapes()
 * @param name  of the model, for messages; borrowed
 * @return 0, -ENOMEM, -EINVAL (more than SST_PLAN_MAX_BYTES of the input's pixels), -ENOTSUP (oneDNN has no code for a layer on this machine); logged.
 */
SST_MUST_CHECK int sst_plan_create(struct sst_plan **out, const struct sst_graph *graph, const struct sst_shape *shapes,
                                   int threads, const char *name);
void sst_plan_destroy(struct sst_plan *plan);

/** Run once; allocates nothing. @param in [c][h][w] @param out [c][h][w] of the graph's output. */
SST_MUST_CHECK int sst_plan_run(struct sst_plan *plan, const float *in, float *out);

SST_EXTERN_C_END

#endif
