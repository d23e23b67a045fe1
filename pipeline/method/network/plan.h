/* pipeline/method/network/plan.h - a graph made ready for one input size: primitives, weights in their layout, memory. */
#ifndef SST_PIPELINE_METHOD_NETWORK_PLAN_H
#define SST_PIPELINE_METHOD_NETWORK_PLAN_H

#include "pipeline/method/network/graph.h"
#include "pipeline/method/network/network.h"

struct sst_plan; /* one thread at a time */

/* Memory for activations and scratch beyond which a network is refused: no sane one comes near it. */
#define SST_PLAN_MAX_BYTES(pixels) (((size_t)64 << 20) + ((size_t)16 << 10) * (size_t)(pixels))

/**
 * @param graph, shapes  borrowed during the call and, the graph, until destroy; shapes of sst_graph_shapes()
 * @param precision  not SST_PRECISION_AUTO
 * @param name  of the model, for messages; borrowed
 * @return 0, -ENOMEM, -EINVAL (more than SST_PLAN_MAX_BYTES of the input's pixels), -ENOTSUP (oneDNN has no code for a
 * layer on this machine); logged.
 */
SST_MUST_CHECK int sst_plan_create(struct sst_plan **out, const struct sst_graph *graph, const struct sst_shape *shapes,
                                   int threads, enum sst_precision precision, const char *name);
void sst_plan_destroy(struct sst_plan *plan);

/** True where this processor multiplies and adds bytes in one instruction (VNNI), as far as oneDNN may use it. */
bool sst_plan_fast_int8(void);

/** Run once; allocates nothing. @param in [c][h][w] @param out [c][h][w] of the graph's output. */
SST_MUST_CHECK int sst_plan_run(struct sst_plan *plan, const float *in, float *out);

/** True where sst_plan_run_s8() can be used: the network ends with a normalisation. */
bool sst_plan_has_s8(const struct sst_plan *plan);

/** Run once, with the result times factor in bytes, see sst_op_normalize_s8(). @param out [h][w][c] of the output. */
SST_MUST_CHECK int sst_plan_run_s8(struct sst_plan *plan, const float *in, float factor, int8_t *out);

#endif
