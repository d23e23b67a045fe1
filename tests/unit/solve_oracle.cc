/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/unit/solve_oracle.h"

#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

using corners = std::vector<std::vector<cv::Point2f>>;

static const cv::TermCriteria patient(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 500, 1e-15);

static std::vector<std::vector<cv::Point3f>> board(int pictures, int cols, int rows, double square)
{
    std::vector<cv::Point3f> one;

    for (int i = 0; i < cols * rows; i++)
        one.emplace_back(static_cast<float>(i % cols * square), static_cast<float>(i / cols * square), 0.0f);
    return std::vector<std::vector<cv::Point3f>>(static_cast<size_t>(pictures), one);
}

static corners split(const float *xy, int pictures, int points)
{
    corners out(static_cast<size_t>(pictures));

    for (int i = 0; i < pictures * points; i++)
        out[static_cast<size_t>(i / points)].emplace_back(xy[2 * i], xy[2 * i + 1]);
    return out;
}

int oracle_corners(const uint8_t *grey, int width, int height, int cols, int rows, float *xy)
{
    try {
        const cv::Mat image(height, width, CV_8U, const_cast<uint8_t *>(grey));
        std::vector<cv::Point2f> found;

        if (!cv::findChessboardCorners(image, cv::Size(cols, rows), found))
            return 0;
        cv::cornerSubPix(image, found, cv::Size(5, 5), cv::Size(-1, -1),
                         cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 100, 1e-4));
        for (size_t i = 0; i < found.size(); i++) {
            xy[2 * i] = found[i].x;
            xy[2 * i + 1] = found[i].y;
        }
        return 1;
    } catch (...) {
        return -1;
    }
}

double oracle_calibrate(const float *xy, int pictures, int cols, int rows, double square, int width, int height,
                        double k[9])
{
    try {
        cv::Mat m, d;
        std::vector<cv::Mat> r, t;
        const double rms = cv::calibrateCamera(board(pictures, cols, rows, square), split(xy, pictures, cols * rows),
                                               cv::Size(width, height), m, d, r, t, 0, patient);

        k[0] = m.at<double>(0, 0);
        k[1] = m.at<double>(1, 1);
        k[2] = m.at<double>(0, 2);
        k[3] = m.at<double>(1, 2);
        for (int i = 0; i < 5; i++)
            k[4 + i] = d.at<double>(i);
        return rms;
    } catch (...) {
        return -1;
    }
}

double oracle_stereo(const float *left, const float *right, int pictures, int cols, int rows, double square, int width,
                     int height, double *distance)
{
    try {
        const auto points = board(pictures, cols, rows, square);
        const corners a = split(left, pictures, cols * rows), b = split(right, pictures, cols * rows);
        const cv::Size size(width, height);
        cv::Mat ma, da, mb, db, r, t, e, f;
        std::vector<cv::Mat> rs, ts;

        cv::calibrateCamera(points, a, size, ma, da, rs, ts, 0, patient);
        cv::calibrateCamera(points, b, size, mb, db, rs, ts, 0, patient);
        const double rms =
            cv::stereoCalibrate(points, a, b, ma, da, mb, db, size, r, t, e, f, cv::CALIB_USE_INTRINSIC_GUESS, patient);

        *distance = cv::norm(t);
        return rms;
    } catch (...) {
        return -1;
    }
}
