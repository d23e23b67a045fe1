/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/bench/sgbm.h"

#include <algorithm>
#include <limits>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

static cv::Mat interleaved(const struct sst_image *img, int pad)
{
    cv::Mat planes[3], merged, padded;

    for (int c = 0; c < 3; c++)
        planes[c] = cv::Mat(img->height, img->width, CV_8U, img->plane[2 - c], img->stride);
    cv::merge(planes, 3, merged);
    cv::copyMakeBorder(merged, padded, 0, 0, pad, 0, cv::BORDER_REPLICATE);
    return padded;
}

static void match(cv::Mat &disp, const cv::Mat &left, const cv::Mat &right, int range, enum bench_sgbm mode)
{
    cv::Mat grey[2];

    if (mode != BENCH_BM) {
        cv::StereoSGBM::create(0, range, 3, 200, 800, 1, 0, 10, 0, 0,
                               mode == BENCH_SGBM_HH ? cv::StereoSGBM::MODE_HH : cv::StereoSGBM::MODE_SGBM_3WAY)
            ->compute(left, right, disp);
        return;
    }
    cv::cvtColor(left, grey[0], cv::COLOR_BGR2GRAY);
    cv::cvtColor(right, grey[1], cv::COLOR_BGR2GRAY);
    cv::StereoBM::create(range, 15)->compute(grey[0], grey[1], disp);
}

static void fill_row(float *d, int width)
{
    const float none = std::numeric_limits<float>::infinity();

    for (int x = 0; x < width;) {
        if (d[x] < none) {
            x++;
            continue;
        }
        int end = x;
        while (end < width && !(d[end] < none))
            end++;
        const float left = x > 0 ? d[x - 1] : none, right = end < width ? d[end] : none;
        const float value = std::min(left, right);
        for (; x < end; x++)
            d[x] = value < none ? value : 0.0f;
    }
}

int bench_sgbm(struct sst_map_f32 *out, const struct sst_image *left, const struct sst_image *right, int disparities,
               enum bench_sgbm mode, int threads)
{
    const int range = (disparities + 15) / 16 * 16;
    cv::Mat disp, smooth(out->height, out->width, CV_32F, out->data, out->stride);

    cv::setNumThreads(threads);
    match(disp, interleaved(left, range), interleaved(right, range), range, mode);
    for (int y = 0; y < out->height; y++) {
        float *row = sst_map_f32_row(out, y);

        for (int x = 0; x < out->width; x++) {
            const short d = disp.at<short>(y, x + range);
            row[x] = d < 0 ? std::numeric_limits<float>::infinity() : d / 16.0f;
        }
        fill_row(row, out->width);
    }
    cv::Mat median;
    cv::medianBlur(smooth, median, 5);
    median.copyTo(smooth);
    return 0;
}
