/* libFuzzer target: the reader of ONNX files, the graph and the shapes, as sst_network_open() and its first run use them.
 *
 *   make && mkdir -p build/corpus
 *   clang -g -O1 -D_DEFAULT_SOURCE -fsanitize=fuzzer,address,undefined \
 *         -fno-sanitize-recover=all -I. tests/fuzz/onnx.c pipeline/network/onnx.c \
 *         pipeline/network/graph*.c base/log.c -lm -o build/fuzz-onnx
 *   build/fuzz-onnx -close_fd_mask=2 -max_len=65536 build/corpus [models]
 */
#include <stdlib.h>

#include "pipeline/network/graph.h"
#include "pipeline/network/onnx.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void build(const struct sst_onnx *model)
{
    struct sst_shape *shapes;
    struct sst_graph graph;
    char why[256];

    if (sst_graph_build(&graph, model, "fuzz", why))
        return;
    shapes = calloc((size_t)graph.n_values, sizeof(*shapes));
    if (shapes && !sst_graph_shapes(&graph, 96, 72, shapes, "fuzz") && shapes[graph.output].c != graph.out_channels)
        abort();
    free(shapes);
    sst_graph_fini(&graph);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sst_onnx model;

    if (!sst_onnx_parse(&model, data, size, "fuzz")) {
        build(&model);
        sst_onnx_fini(&model);
    }
    return 0;
}
