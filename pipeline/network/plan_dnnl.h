/* pipeline/network/plan_dnnl.h - shared by plan.c and plan_dnnl.c: the inside of a plan. */
#ifndef SST_PIPELINE_NETWORK_PLAN_DNNL_H
#define SST_PIPELINE_NETWORK_PLAN_DNNL_H

#include <dnnl.h>

#include "pipeline/network/ops.h"
#include "pipeline/network/plan.h"

SST_EXTERN_C_BEGIN

#define SST_PLAN_MAX_ARGS (SST_ONNX_MAX_INS + 4)

/** A value in one layout. A convolution that adds to a residual writes over that tensor. */
struct plan_tensor {
    dnnl_memory_desc_t md;
    dnnl_memory_t memory;
    struct sst_tensor view; /* block 0: a layout that only oneDNN understands */
    dnnl_format_tag_t tag;  /* of the layout, if block > 0 */
    size_t bytes, offset;   /* place in the arena */
    int first, last;        /* steps that touch it */
    bool external;          /* the caller's memory: input or output */
};

struct plan_step {
    const struct sst_op *op;
    dnnl_primitive_t primitive; /* NULL: one of ops.h from tensor[0] to tensor[1] */
    int n_args;
    dnnl_exec_arg_t args[SST_PLAN_MAX_ARGS];
    int tensor[SST_PLAN_MAX_ARGS]; /* of args, -1 for weights, bias and scratch */
    dnnl_memory_t weights, bias, scratch;
    void *weights_data;
    struct sst_tap *taps_y, *taps_x;
};

struct sst_plan {
    const struct sst_graph *graph;
    const struct sst_shape *shapes;
    const char *name;
    int threads;
    dnnl_engine_t engine;
    dnnl_stream_t stream;
    struct plan_tensor *tensors;
    struct plan_step *steps;
    int n_tensors, n_steps, tensors_room, steps_room;
    int *current;   /* [n_values] tensor that holds a value now, or -1 */
    int *last_use;  /* [n_values] last operation that reads it */
    uint8_t *winograd; /* [n_ops] tile side of the convolutions that run as Winograd's, else 0 */
    int input, output;
    void *arena, *scratch;
    size_t arena_bytes, scratch_bytes;
};

/** Layout [c][h][w] of a shape. */
int plan_plain(dnnl_memory_desc_t *md, struct sst_shape shape);

/** New tensor; its number or a negative errno. */
int plan_add_tensor(struct sst_plan *p, const dnnl_memory_desc_t *md, struct sst_shape shape);

/** New step, to fill; NULL without memory. */
struct plan_step *plan_add_step(struct sst_plan *p, const struct sst_op *op);

/** Number of a tensor that holds a value in a layout; a reorder is planned where it is in another one. */
int plan_in_layout(struct sst_plan *p, int value, const dnnl_memory_desc_t *md);

/** Tile side with which oneDNN runs an operation as a Winograd convolution on as many threads as are set; 0: it cannot. */
uint8_t plan_winograd_tile(struct sst_plan *p, const struct sst_op *op);

/** Plan operation i of the graph. */
SST_MUST_CHECK int plan_add_op(struct sst_plan *p, int i);

int plan_errno(dnnl_status_t status);

SST_EXTERN_C_END

#endif
