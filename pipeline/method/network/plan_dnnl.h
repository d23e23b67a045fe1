/* pipeline/method/network/plan_dnnl.h - shared by plan.c and plan_dnnl.c: the inside of a plan. */
#ifndef SST_PIPELINE_METHOD_NETWORK_PLAN_DNNL_H
#define SST_PIPELINE_METHOD_NETWORK_PLAN_DNNL_H

#include <dnnl.h>

#include "pipeline/method/network/network_internal.h"

#define SST_PLAN_MAX_ARGS (SST_ONNX_MAX_INS + 4)

/** How a value is held when it is held in 8 bits: round(x / scale). */
struct plan_value {
    bool bits8; /* some layer wants it so */
    bool never_negative;
    dnnl_data_type_t type; /* u8 or s8 */
    float scale;
};

/** A value in one layout. A convolution that adds to a residual writes over that tensor. */
struct plan_tensor {
    int value;    /* of the graph; -1: overwritten */
    int place_of; /* tensor in whose memory it lies, or -1 */
    float scale;  /* the value is scale times what is stored */
    dnnl_memory_desc_t md;
    dnnl_memory_t memory;
    struct net_tensor view; /* block 0: a layout that only oneDNN understands */
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
    float *bias_data;
    struct sst_tap *taps_y, *taps_x;
};

struct sst_plan {
    const struct sst_graph *graph;
    const struct sst_shape *shapes;
    const char *name;
    int threads;
    enum sst_precision precision;
    struct plan_value *values; /* [n_values] */
    dnnl_engine_t engine;
    dnnl_stream_t stream;
    struct plan_tensor *tensors;
    struct plan_step *steps;
    int n_tensors, n_steps, tensors_room, steps_room;
    int *current;         /* [n_values] tensor that holds a value now, or -1 */
    int *last_use;        /* [n_values] last operation that reads it */
    int winograd_threads; /* that these are planned for; at least 2 */
    uint8_t *winograd;    /* [n_ops] tile side of the convolutions that run as Winograd's, else 0 */
    int input, output;
    void *arena, *scratch;
    size_t arena_bytes, scratch_bytes;
};

/* omp.h is not there for every compiler; these are OpenMP's C interface. The number is the calling thread's own. */
extern void omp_set_num_threads(int n);
extern int omp_get_max_threads(void);
extern void omp_set_max_active_levels(int n);
extern int omp_get_max_active_levels(void);

/* --- plan.c --- */

/** New tensor of a value; its number or a negative errno. */
int plan_add_tensor(struct sst_plan *p, int value, const dnnl_memory_desc_t *md, float scale);

/** New step, to fill; NULL without memory. */
struct plan_step *plan_add_step(struct sst_plan *p, const struct sst_op *op);

/* --- plan_dnnl.c --- */

/** Plan operation i of the graph. */
SST_MUST_CHECK int plan_add_op(struct sst_plan *p, int i);

/** Layout of a shape; tags as dnnl_nchw, which is [c][h][w]. */
SST_MUST_CHECK int plan_desc(dnnl_memory_desc_t *md, struct sst_shape shape, dnnl_data_type_t type,
                             dnnl_format_tag_t tag);

/** Number of a tensor that holds a value in a layout and unit; a reorder is planned where there is none. */
int plan_in_layout(struct sst_plan *p, int value, const dnnl_memory_desc_t *md, float scale);

/** Number of a tensor that holds a value in 8 bits, whatever the unit. */
int plan_in_8_bits(struct sst_plan *p, int value);

/** New tensor for the result that a value is from now on; its number or a negative errno. */
int plan_result(struct sst_plan *p, int value, const dnnl_memory_desc_t *md, float scale);

SST_MUST_CHECK int plan_reorder(struct sst_plan *p, int from, int to);

void plan_add_arg(struct plan_step *s, int arg, int tensor, dnnl_memory_t memory);

/** Attributes that all primitives share: scratch memory is ours. */
SST_MUST_CHECK int plan_attr(dnnl_primitive_attr_t *attr);

/** Make the primitive of a step and the place of its scratch memory; takes the description. */
SST_MUST_CHECK int plan_primitive(struct sst_plan *p, struct plan_step *s, dnnl_primitive_desc_t pd);

int plan_errno(dnnl_status_t status);

/* --- plan_conv.c --- */

SST_MUST_CHECK int plan_add_conv(struct sst_plan *p, const struct sst_op *op);

/** Tile side with which oneDNN runs an operation as a Winograd convolution on as many threads as are set; 0: it cannot.
 */
uint8_t plan_winograd_tile(struct sst_plan *p, const struct sst_op *op);

/* --- plan_bits.c --- */

/** Fill p->values. */
void plan_choose_bits(struct sst_plan *p);

bool plan_conv_on_8_bits(const struct sst_plan *p, const struct sst_op *op);

#endif
