/* pipeline/method/network/graph_build.h - shared by graph*.c: ONNX nodes with their names resolved, on the way to operations.
 */
#ifndef SST_PIPELINE_METHOD_NETWORK_GRAPH_BUILD_H
#define SST_PIPELINE_METHOD_NETWORK_GRAPH_BUILD_H

#include "pipeline/method/network/graph.h"

struct sst_raw_value {
    struct sst_onnx_str name;
    int next;     /* chain of the name table, or -1 */
    int node;     /* that makes it, or -1 */
    int users;    /* needed nodes that read it */
    int alias;    /* value that it is the same as, or -1 */
    int op;       /* operation that makes it, or -1 */
    int channels; /* 0: not known, a constant */
    int unpadded; /* value that it is with `pad` zeros around (top, left, bottom, right), or -1 */
    int pad[4];
    const struct sst_onnx_tensor *constant;
};

struct sst_norm {
    bool found;
    int x;
    double in_add, in_min, add, min;
};

struct sst_raw_node {
    const struct sst_onnx_node *onnx;
    int in[SST_ONNX_MAX_INS], out[SST_ONNX_MAX_OUTS]; /* values, -1 where left out */
    bool needed;
    struct sst_norm norm; /* this node ends a normalisation */
};

#define SST_NAME_BUCKETS 4096

struct sst_builder {
    const struct sst_onnx *model;
    const char *name;
    char *why;
    struct sst_raw_value *values;
    int n_values, room;
    int bucket[SST_NAME_BUCKETS];
    struct sst_raw_node *nodes;
    struct sst_onnx_tensor *constants; /* of Constant nodes; [n_nodes] */
    int64_t weights; /* numbers copied into operations */
    struct sst_graph graph;
};

/** Say in builder->why what is not supported and return -ENOTSUP. */
int sst_graph_unsupported(struct sst_builder *b, const struct sst_onnx_node *node, const char *what);
/** Log what is wrong with a node and return -EBADMSG. */
int sst_graph_wrong(struct sst_builder *b, const struct sst_onnx_node *node, const char *what);
/** Constant input of a node, or NULL. */
const struct sst_onnx_tensor *sst_graph_constant(const struct sst_builder *b, const struct sst_raw_node *node, int in);
/** True where the node is op of the standard domain. */
bool sst_graph_is(const struct sst_onnx_node *node, const char *op);

/** If the node is the last of a normalisation over channels, as exporters write it in single steps, say of which value.
 */
struct sst_norm sst_graph_find_norm(const struct sst_builder *b, const struct sst_raw_node *node);

struct sst_resize_target {
    int64_t size[2]; /* height and width, where like is -1 */
    int like;        /* value whose height and width it takes, or -1 */
};

/** Where the sizes of a Resize lead; exporters wrap them into arithmetic on shapes. False where they cannot be told. */
bool sst_graph_resize_target(const struct sst_builder *b, const struct sst_raw_node *node,
                             struct sst_resize_target *out);

/** Turn one node into an operation, fuse it into an earlier one, or make its output an alias. */
SST_MUST_CHECK int sst_graph_translate(struct sst_builder *b, const struct sst_raw_node *node);

#endif
