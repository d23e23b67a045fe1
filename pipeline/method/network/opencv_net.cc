/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/network/opencv_net.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <new>

#include <opencv2/core.hpp>
#include <opencv2/dnn.hpp>

struct cv_net {
    cv::dnn::Net net;
    cv::Mat result;
};

/* Run fn; an exception becomes an errno and one line of text. */
template <typename Fn> static int guarded(char why[256], Fn fn)
{
    try {
        return fn();
    } catch (const std::bad_alloc &) {
        return -ENOMEM;
    } catch (const cv::Exception &e) {
        std::snprintf(why, 256, "%s", e.err.c_str());
    } catch (const std::exception &e) {
        std::snprintf(why, 256, "%s", e.what());
    } catch (...) {
        std::snprintf(why, 256, "an unknown exception");
    }
    why[std::strcspn(why, "\r\n")] = 0;
    return -EINVAL;
}

/* OpenCV also prints each exception that it throws; the caller says what happened, once. */
static int silent(int, const char *, const char *, const char *, int, void *)
{
    return 0;
}

int cv_net_open(struct cv_net **out, const uint8_t *data, size_t size, char why[256])
{
    return guarded(why, [&] {
        auto made = std::unique_ptr<cv_net>(new cv_net);

        cv::redirectError(silent);
        made->net = cv::dnn::readNetFromONNX(reinterpret_cast<const char *>(data), size);
        if (made->net.empty()) {
            std::snprintf(why, 256, "the network is empty");
            return -EINVAL;
        }
        made->net.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
        made->net.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
        *out = made.release();
        return 0;
    });
}

void cv_net_close(struct cv_net *net)
{
    delete net;
}

int cv_net_run(struct cv_net *net, const struct cv_net_input *in, const float **result, int shape[3], char why[256])
{
    return guarded(why, [&] {
        const int dims[4] = { 1, in->shape[0], in->shape[1], in->shape[2] };
        const cv::Mat blob(4, dims, CV_32F, const_cast<float *>(in->data)); /* only read */

        cv::setNumThreads(in->threads);
        net->net.setInput(blob);
        net->result = net->net.forward();
        if (net->result.dims != 4 || net->result.size[0] != 1 || net->result.type() != CV_32F ||
            !net->result.isContinuous()) {
            std::snprintf(why, 256, "the result is not 1 x C x height x width");
            return -EINVAL;
        }
        for (int i = 0; i < 3; i++)
            shape[i] = net->result.size[i + 1];
        *result = net->result.ptr<float>();
        return 0;
    });
}
