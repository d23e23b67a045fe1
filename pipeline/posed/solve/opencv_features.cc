/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/solve/opencv_features.h"

#include <algorithm>
#include <cerrno>
#include <cfenv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

static constexpr double SPREAD_PX = 24;  /* of the local mean and spread */
static constexpr int SPREAD_STEP = 4;    /* which are computed on a smaller picture */
static constexpr double CONTRAST = 0.02; /* of SIFT: half of its default, for dark forest */
static constexpr double RICH_PX = 250; /* a feature: in larger pictures there are enough features ... */
static constexpr double RICH_CONTRAST = 0.06; /* ... of this contrast ... */
static constexpr double RICH_SCALE = 0.75;    /* ... at this size, which takes less than half of the time */
static constexpr double EPIPOLAR_PX = 1.5;
static constexpr float ONE = 512; /* length of a descriptor */

/* OpenCV's fits divide by zero where points are degenerate, and drop the result: that is no fault to trap. */
struct no_traps {
    fenv_t before;
    no_traps()
    {
        std::feholdexcept(&before);
    }
    ~no_traps()
    {
        std::fesetenv(&before);
    }
};

/* Run fn; an exception becomes an errno and one line of text, which OpenCV does not print besides. */
template <typename Fn> static int guarded(char why[256], Fn fn)
{
    const no_traps held;

    cv::redirectError([](int, const char *, const char *, const char *, int, void *) { return 0; });
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

/* Differences from the local mean in local spreads, 50 levels each, about 128. */
static cv::Mat normalised(const struct cv_grey *grey)
{
    const cv::Mat level(grey->height, grey->width, CV_32F, const_cast<float *>(grey->level)); /* only read */
    const cv::Size small((grey->width + SPREAD_STEP - 1) / SPREAD_STEP, (grey->height + SPREAD_STEP - 1) / SPREAD_STEP);
    cv::Mat few, mean, d, spread, out;

    cv::resize(level, few, small, 0, 0, cv::INTER_AREA);
    cv::GaussianBlur(few, few, cv::Size(), SPREAD_PX / SPREAD_STEP);
    cv::resize(few, mean, level.size(), 0, 0, cv::INTER_LINEAR);
    d = level - mean;
    cv::resize(d.mul(d), few, small, 0, 0, cv::INTER_AREA);
    cv::GaussianBlur(few, few, cv::Size(), SPREAD_PX / SPREAD_STEP);
    cv::sqrt(cv::max(few, 0), few);
    few += 2;
    cv::resize(few, spread, level.size(), 0, 0, cv::INTER_LINEAR);
    cv::divide(d, spread, d, 50);
    d += 128;
    d.convertTo(out, CV_8U);
    return out;
}

/* The strongest features; weak ones, which take longer, only where strong ones are too few. @return scale of their places */
static float detect(std::vector<cv::KeyPoint> &keys, cv::Mat &descriptors, const cv::Mat &picture, int most)
{
    if (static_cast<double>(picture.total()) >= RICH_PX * most) {
        cv::Mat smaller;

        cv::resize(picture, smaller, cv::Size(), RICH_SCALE, RICH_SCALE, cv::INTER_AREA);
        cv::SIFT::create(most, 3, RICH_CONTRAST)->detectAndCompute(smaller, cv::noArray(), keys, descriptors);
        if (keys.size() >= static_cast<size_t>(most))
            return RICH_SCALE;
    }
    cv::SIFT::create(most, 3, CONTRAST)->detectAndCompute(picture, cv::noArray(), keys, descriptors);
    return 1;
}

int cv_features_find(struct cv_features *out, const struct cv_grey *grey, int most, char why[256])
{
    return guarded(why, [&] {
        std::vector<cv::KeyPoint> keys;
        cv::Mat descriptors;
        size_t count;
        float scale;

        cv::setNumThreads(1); /* pictures are found in parallel */
        scale = detect(keys, descriptors, normalised(grey), most);
        count = std::min(keys.size(), static_cast<size_t>(most));
        out->at = static_cast<float(*)[2]>(std::calloc(count + 1, sizeof(*out->at)));
        out->descriptor = static_cast<int16_t *>(std::calloc(count + 1, CV_DESCRIPTOR * sizeof(*out->descriptor)));
        if (!out->at || !out->descriptor) {
            std::free(out->at);
            std::free(out->descriptor);
            out->at = nullptr;
            out->descriptor = nullptr;
            return -ENOMEM;
        }
        for (size_t i = 0; i < count; i++) {
            const float *in = descriptors.ptr<float>(static_cast<int>(i));
            int16_t *to = out->descriptor + i * CV_DESCRIPTOR;
            float sum = 1e-6f;

            /* SIFT enlarges the picture twice with pixel corners kept, and halves positions with centres kept. */
            out->at[i][0] = (keys[i].pt.x + 0.25f) / scale - 0.5f;
            out->at[i][1] = (keys[i].pt.y + 0.25f) / scale - 0.5f;
            for (int c = 0; c < CV_DESCRIPTOR; c++)
                sum += in[c];
            for (int c = 0; c < CV_DESCRIPTOR; c++)
                to[c] = static_cast<int16_t>(std::nearbyint(ONE * std::sqrt(in[c] / sum)));
        }
        out->count = static_cast<int>(count);
        return 0;
    });
}

/* A matrix on the caller's points, which are only read. */
static cv::Mat points_of(const float (*at)[2], int count)
{
    return cv::Mat(count, 1, CV_32FC2, const_cast<float(*)[2]>(at));
}

int cv_points_epipolar(const struct cv_points *points, uint8_t *inlier, char why[256])
{
    return guarded(why, [&] {
        const cv::Mat a = points_of(points->a, points->count), b = points_of(points->b, points->count);
        cv::Mat mask;

        std::memset(inlier, 0, static_cast<size_t>(points->count));
        /* Of a plane, or from one place, there is no single fundamental matrix: none is found. */
        if (cv::findFundamentalMat(a, b, cv::USAC_MAGSAC, EPIPOLAR_PX, 0.9999, 5000, mask).empty() &&
            cv::findHomography(a, b, cv::USAC_MAGSAC, EPIPOLAR_PX, mask).empty())
            return 0;
        for (int i = 0; i < points->count && i < static_cast<int>(mask.total()); i++)
            inlier[i] = mask.data[i] != 0;
        return 0;
    });
}

int cv_points_similarity(const struct cv_points *points, double within_px, double out[4], double *share, char why[256])
{
    return guarded(why, [&] {
        cv::Mat mask;
        const cv::Mat m =
            cv::estimateAffinePartial2D(points_of(points->a, points->count), points_of(points->b, points->count), mask,
                                        cv::RANSAC, within_px, 3000);

        *share = 0;
        if (m.empty())
            return 0;
        *share = static_cast<double>(cv::countNonZero(mask)) / points->count;
        out[0] = m.at<double>(0, 0);
        out[1] = m.at<double>(1, 0);
        out[2] = m.at<double>(0, 2);
        out[3] = m.at<double>(1, 2);
        return 0;
    });
}
