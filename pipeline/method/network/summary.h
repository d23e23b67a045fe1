/* pipeline/method/network/summary.h - operators and parameters of an ONNX file, counted. */
#ifndef SST_PIPELINE_METHOD_NETWORK_SUMMARY_H
#define SST_PIPELINE_METHOD_NETWORK_SUMMARY_H

#include "pipeline/method/network/onnx.h"

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

void sst_onnx_summary(struct sst_summary *out, const struct sst_onnx *model);

#endif
