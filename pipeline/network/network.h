/* pipeline/network/network.h - run a convolutional network from an ONNX file on oneDNN. */
#ifndef SST_PIPELINE_NETWORK_NETWORK_H
#define SST_PIPELINE_NETWORK_NETWORK_H

#include <stdbool.h>

#include "base/base.h"

SST_EXTERN_C_BEGIN

struct sst_network; /* one thread at a time */

/**
 * Load and check a network: at most 64 MiB, 4096 nodes, tensors of 2^28 numbers; data in other files is refused.
 *
 * Run on oneDNN (f32): Conv, Relu, BatchNormalization after Conv, Add, Concat of channels, MaxPool, AveragePool,
 * GlobalAveragePool, Resize (bilinear, fixed scales or sizes), Softmax and LpNormalization over channels (also x / |x|
 * as exporters write it in single steps), Pad with zeros before Conv, Identity, Dropout, Constant; and of the domain
 * "sst" AdaptiveAveragePool (output_size) and ResizeLike (x, like; align_corners). Sizes of images are free: H and W
 * that the file gives are told by sst_network_in_size(). Of several outputs the first one counts. A network whose folder
 * has a manifest.json that lists it must be the file that is listed there. The result is the same for any number of threads (tested); it may differ in the last
 * digits between machines, as oneDNN takes other code on other processors. Other operators make the network fall back
 * to OpenCV's DNN, which is said in a warning.
 *
 * @param threads  used by runs; at least 1
 * @return 0, -ENOENT, -EBADMSG (truncated, inconsistent, absurd sizes, NaN weights, not
 * the file of the manifest), -ENOTSUP (neither runner can),
 * -ENOMEM; logged in one sentence.
 */
SST_MUST_CHECK int sst_network_open(struct sst_network **out, const char *path, int threads);
void sst_network_close(struct sst_network *net);

/** "onednn" or "opencv". */
const char *sst_network_runner(const struct sst_network *net);

/** Value of a metadata_props entry of the ONNX file, or NULL. Owner: the network. */
const char *sst_network_metadata(const struct sst_network *net, const char *key);

/**
 * Channels of input and output, and the factor by which the output is smaller (1 for per-pixel output).
 * Input and output are NCHW with N = 1.
 */
int sst_network_in_channels(const struct sst_network *net);

/** Size that the file fixes for its input; 0 and 0 where it leaves one of the two free. */
void sst_network_in_size(const struct sst_network *net, int *width, int *height);

/**
 * False where the layers rule out this input size, as fixed windows do that must fit each other. Nothing is logged.
 * True means nothing for a network that OpenCV runs.
 */
bool sst_network_accepts(const struct sst_network *net, int width, int height);

/** Shape of the output for an input of width x height; plans memory and primitives for that size on first use. */
SST_MUST_CHECK int sst_network_out_shape(struct sst_network *net, int width, int height, int *out_channels,
                                         int *out_width, int *out_height);

/**
 * Run once.
 *
 * @param in   [in_channels][height][width]
 * @param out  [out_channels][out_height][out_width] of sst_network_out_shape()
 */
SST_MUST_CHECK int sst_network_run(struct sst_network *net, const float *in, int width, int height, float *out);

SST_EXTERN_C_END

#endif
