/* pipeline/method/network/opencv_net.h - OpenCV's DNN as plain C: no exceptions, no OpenCV types. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_NETWORK_OPENCV_NET_H
#define SST_PIPELINE_METHOD_NETWORK_OPENCV_NET_H

#include "base/base.h"

SST_EXTERN_C_BEGIN

/* All return 0, -ENOTSUP (libsst-opencv.so cannot be loaded), -ENOMEM or -EINVAL (OpenCV refused); the reason, cut to
 * one line, is in why[256]. Not logged. */

struct cv_net; /* a network in OpenCV's DNN module; one thread at a time */

/** @param data  an ONNX file in memory; not needed afterwards */
SST_MUST_CHECK int cv_net_open(struct cv_net **out, const uint8_t *data, size_t size, char why[256]);
void cv_net_close(struct cv_net *net);

struct cv_net_input {
    const float *data;
    int shape[3]; /* channels, height, width of data */
    int threads;
};

/**
 * Run on an input; the result stays inside net until the next run.
 *
 * @param result  out, [shape[0]][shape[1]][shape[2]]; owner: net
 * @param shape   out: channels, height, width
 */
SST_MUST_CHECK int cv_net_run(struct cv_net *net, const struct cv_net_input *in, const float **result, int shape[3],
                              char why[256]);

SST_EXTERN_C_END

#endif
