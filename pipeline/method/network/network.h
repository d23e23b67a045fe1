/* pipeline/method/network/network.h - runs a convolutional network from an ONNX file, on oneDNN or else on OpenCV. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_NETWORK_NETWORK_H
#define SST_PIPELINE_METHOD_NETWORK_NETWORK_H

#include <stdbool.h>

#include "base/base.h"

struct sst_network; /* one thread at a time */

struct sst_shape {
    int c, h, w; /* channels, height, width */
};

/** Numbers that a network computes with. */
enum sst_precision {
    SST_PRECISION_AUTO = 0, /* 8 bits where the file has ranges for them and they are faster, else floats */
    SST_PRECISION_F32 = 1,
    SST_PRECISION_INT8 = 2,
};

/**
 * Load and check a network: at most 64 MiB, 4096 nodes, tensors of 2^28 numbers; data in other files is refused.
 *
 * Run on oneDNN: Conv, Relu, BatchNormalization after Conv, Add, Concat of channels, MaxPool, AveragePool,
 * GlobalAveragePool, Resize (bilinear; to fixed scales or sizes, or to the size of another image), Softmax and
 * LpNormalization over channels (also x / |x| as exporters write it in single steps), Pad with zeros before Conv,
 * Identity, Dropout, Constant; and of the domain "sst" AdaptiveAveragePool (output_size) and ResizeLike (x, like;
 * align_corners). Image sizes are free: sst_network_in_size() returns H and W if the file fixes them. Of several
 * outputs the first one is used. The result is the same for any number of threads (tested); it may differ in the last
 * digits between machines, as oneDNN uses other code on other processors. Networks with other operators run on OpenCV's
 * DNN, with a warning.
 *
 * A network listed in the manifest.json beside it must match its entry
 * (pipeline/method/network/manifest.h).
 *
 * With SST_PRECISION_INT8 convolutions after the first one, and the layers between them, are computed on 8 bits in the
 * ranges of the file's metadata sst.ranges (see docs/design/method.md); sums are exact. Processors without VNNI,
 * and shaders beside them, use 7 bits for values that are never negative and for the weights of others.
 *
 * @param threads  used by runs; at least 1
 * @return 0, -ENOENT, -EBADMSG (truncated, inconsistent, absurd sizes, NaN weights, ranges that do not fit, not the
 * file of the manifest), -ENOTSUP (no runner supports it, or SST_PRECISION_INT8 without ranges), -ENOMEM; logged in one
 * sentence.
 */
SST_MUST_CHECK int sst_network_open(struct sst_network **out, const char *path, enum sst_precision precision,
                                    int threads);
void sst_network_close(struct sst_network *net);

/** "onednn" or "opencv". */
const char *sst_network_runner(const struct sst_network *net);

/** The precision in use: never SST_PRECISION_AUTO. */
enum sst_precision sst_network_precision(const struct sst_network *net);

/** Value of a metadata_props entry of the ONNX file, or NULL. Owner: the network. */
const char *sst_network_metadata(const struct sst_network *net, const char *key);

/**
 * The operator that ends the network in probabilities of classes (Softmax over the channels, Sigmoid) or, *logarithm
 * then, in their logarithms (LogSoftmax), by whichever runner; NULL: another. Owner: the network.
 */
const char *sst_network_ends_in_probabilities(const struct sst_network *net, bool *logarithm);

/** The operator that combines probabilities with a constant at the end of the network, as in 255 p or 1 - p; NULL: none
 * does */
const char *sst_network_ends_scaled(const struct sst_network *net);

/**
 * Channels of input and output, and the factor by which the output is smaller (1 for per-pixel output).
 * Input and output are NCHW with N = 1.
 */
int sst_network_in_channels(const struct sst_network *net);

/** Input size fixed by the file; 0 and 0 if one of the two is free. */
void sst_network_in_size(const struct sst_network *net, int *width, int *height);

/**
 * False if the layers cannot process this input size, as with fixed windows that must match. Not logged. Always true
 * for a network that OpenCV runs.
 */
bool sst_network_accepts(const struct sst_network *net, int width, int height);

/** Shape of the output for an input of width x height; plans memory and primitives for that size on first use. */
SST_MUST_CHECK int sst_network_out_shape(struct sst_network *net, int width, int height, struct sst_shape *out);

/**
 * Run once.
 *
 * @param in   [in_channels][height][width]
 * @param out  [out_channels][out_height][out_width] of sst_network_out_shape()
 */
SST_MUST_CHECK int sst_network_run(struct sst_network *net, const float *in, int width, int height, float *out);

struct sst_run_result;

/** How the result of a network stays where the runner runs it, for other steps. */
struct sst_network_keeper {
    /** Dispatch work that reads the result, with the runner locked. @return false: `out` gets a copy */
    bool (*keep)(void *arg, const struct sst_run_result *result);
    void *arg;
};

/** A run with a result in bytes. */
struct sst_network_bytes {
    const float *in; /* [in_channels][height][width] */
    int width, height;
    float factor;
    int8_t *out;                             /* [out_height][out_width][out_channels] */
    const struct sst_network_keeper *keeper; /* or NULL */
};

/**
 * Run once, with the result times factor as bytes: rounded to nearest, halves away from 0, clamped to -127..127; NaN
 * gives 0. Faster and smaller than floats if the network ends with a normalisation.
 */
SST_MUST_CHECK int sst_network_run_s8(struct sst_network *net, const struct sst_network_bytes *run);

struct sst_runner_user; /* pipeline/step/runner.h */

/**
 * Let a runner place the runs from now on; those on the CPU are counted in its report and, for failures, logged.
 *
 * @param user  opened for networks, borrowed until the network is closed; NULL: on the CPU
 */
void sst_network_use_runner(struct sst_network *net, struct sst_runner_user *user);

#endif
