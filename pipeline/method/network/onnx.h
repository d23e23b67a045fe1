/* pipeline/method/network/onnx.h - bounded reader of ONNX files: validates everything and never opens files that a
 * model names. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_NETWORK_ONNX_H
#define SST_PIPELINE_METHOD_NETWORK_ONNX_H

#include <stdbool.h>

#include "base/base.h"

#define SST_ONNX_MAX_BYTES    ((size_t)64 << 20)
#define SST_ONNX_MAX_NODES    4096
#define SST_ONNX_MAX_TENSORS  8192
#define SST_ONNX_MAX_METADATA 256
#define SST_ONNX_MAX_ELEMENTS ((int64_t)1 << 28)
#define SST_ONNX_MAX_DIMS     8
#define SST_ONNX_MAX_INS      32
#define SST_ONNX_MAX_OUTS     8
#define SST_ONNX_MAX_ATTRS    64   /* of a node */
#define SST_ONNX_MAX_FIELDS   4096 /* of an attribute */

/** Bytes inside the file, without a NUL. */
struct sst_onnx_str {
    const char *p;
    size_t n;
};

bool sst_onnx_str_is(struct sst_onnx_str s, const char *text);
bool sst_onnx_str_same(struct sst_onnx_str a, struct sst_onnx_str b);

/** For "%.*s" in messages: at most 80 characters of s. */
#define SST_ONNX_STR(s) (int)((s).n < 80 ? (s).n : 80), (s).n ? (s).p : ""

/** A constant. Exactly one of f and i is set for the types float and int64 (count > 0), neither for other types. */
struct sst_onnx_tensor {
    struct sst_onnx_str name;
    int n_dims;
    int64_t dims[SST_ONNX_MAX_DIMS], count;
    float *f; /* all finite */
    int64_t *i;
};

struct sst_onnx_node {
    struct sst_onnx_str op, domain, name;
    struct sst_onnx_str in[SST_ONNX_MAX_INS], out[SST_ONNX_MAX_OUTS]; /* an empty name: left out */
    int n_in, n_out;
    struct sst_onnx_str body; /* for sst_onnx_attr_find() */
};

/* Numeric types (TensorProto.DataType) that inputs and outputs may have. */
#define SST_ONNX_FLOAT 1
#define SST_ONNX_INT64 7
#define SST_ONNX_HALF  10

/** Input or output of the graph. */
struct sst_onnx_value {
    struct sst_onnx_str name;
    int type; /* of its numbers; 0: unspecified */
    int n_dims;
    int64_t dims[SST_ONNX_MAX_DIMS]; /* 0: not fixed */
};

struct sst_onnx_metadata {
    struct sst_onnx_str key, value;
};

struct sst_onnx {
    int64_t opset; /* of the standard domain */
    int n_nodes, n_tensors, n_ins, n_outs, n_metadata;
    struct sst_onnx_node *nodes;
    struct sst_onnx_tensor *tensors;
    struct sst_onnx_value *ins, *outs; /* ins may list initialisers too */
    struct sst_onnx_metadata *metadata;
};

/**
 * Read a model. Its strings point into data, which must outlive it.
 *
 * @param name  of the file, for messages
 * @return 0, -EBADMSG (truncated, over a limit above, inconsistent sizes, data in other files, values
 * that are not finite), -ENOTSUP (nodes with graphs inside), -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_onnx_parse(struct sst_onnx *out, const uint8_t *data, size_t size, const char *name);
void sst_onnx_fini(struct sst_onnx *model);

/** An attribute of a node; fields that its type lacks are 0. */
struct sst_onnx_attr {
    float f;
    int64_t i;
    struct sst_onnx_str s, tensor;
    int n_ints; /* may exceed what ints holds */
    int64_t ints[SST_ONNX_MAX_DIMS];
};

/** Find an attribute; false when the node lacks it. */
bool sst_onnx_attr_find(const struct sst_onnx_node *node, const char *name, struct sst_onnx_attr *out);

/** The integer attribute, or the default. */
int64_t sst_onnx_attr_int(const struct sst_onnx_node *node, const char *name, int64_t missing);

/** Decode the tensor of an attribute; free with sst_onnx_tensor_fini(). Errors as of sst_onnx_parse(). */
SST_MUST_CHECK int sst_onnx_tensor_read(struct sst_onnx_tensor *out, struct sst_onnx_str bytes, const char *name);
void sst_onnx_tensor_fini(struct sst_onnx_tensor *tensor);

/* --- operators and parameters of a file, counted --- */

#define SST_SUMMARY_MAX_OPS 48

struct sst_op_count {
    char name[48]; /* with its domain, if that is not the standard one */
    int count;
};

struct sst_summary {
    int64_t opset, parameters; /* numbers in constants of floats */
    int n_nodes, n_ops;
    struct sst_op_count ops[SST_SUMMARY_MAX_OPS]; /* most frequent first, then by name; the rarest are dropped */
};

/** Is a listed input a constant of the file? (Old files list those as well.) */
bool sst_onnx_is_constant(const struct sst_onnx *model, const struct sst_onnx_value *in);

void sst_onnx_summary(struct sst_summary *out, const struct sst_onnx *model);

/* --- what ends a network --- */

enum sst_network_values {
    SST_NETWORK_VALUES = 0,        /* any */
    SST_NETWORK_PROBABILITIES = 1, /* a softmax over the channels, or a sigmoid */
    SST_NETWORK_LOGARITHMS = 2,    /* their logarithms, which are logits */
    SST_NETWORK_OTHER_AXIS = 3,    /* a softmax, but not over the channels */
    SST_NETWORK_CLASSES = 4,       /* numbers of classes, as of an ArgMax */
    SST_NETWORK_SCALED = 5,        /* a softmax or sigmoid, and arithmetic with constants */
};

/**
 * What the first output holds, by the node that makes it: those behind it that only move, cut or enlarge values do not
 * count.
 *
 * @param op  out: that node's operator, unless SST_NETWORK_VALUES is returned
 */
enum sst_network_values sst_onnx_ending(const struct sst_onnx *model, struct sst_onnx_str *op);

#endif
