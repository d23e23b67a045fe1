/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/bench/warp.h"

#include <opencv2/imgproc.hpp>

void bench_warp_add(int32_t *sum, int width, int height, const struct sst_map_u16 *picture, const double homography[9],
                    int threads)
{
    static cv::Mat warped;
    cv::Mat total(height, width, CV_32S, sum);
    const cv::Mat from(picture->height, picture->width, CV_16U, picture->data, picture->stride);
    const cv::Mat h(3, 3, CV_64F, const_cast<double *>(homography));

    cv::setNumThreads(threads);
    cv::warpPerspective(from, warped, h, cv::Size(width, height), cv::INTER_LINEAR | cv::WARP_INVERSE_MAP);
    cv::add(total, warped, total, cv::noArray(), CV_32S);
}
