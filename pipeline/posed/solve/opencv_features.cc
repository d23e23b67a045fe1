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
static constexpr double RATIO = 0.85;    /* of the best two distances */
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

int cv_features_find(struct cv_features *out, const struct cv_grey *grey, int most, char why[256])
{
    return guarded(why, [&] {
        std::vector<cv::KeyPoint> keys;
        cv::Mat descriptors;
        size_t count;

        cv::setNumThreads(1); /* pictures are found in parallel */
        cv::SIFT::create(most, 3, CONTRAST)->detectAndCompute(normalised(grey), cv::noArray(), keys, descriptors);
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
            out->at[i][0] = keys[i].pt.x - 0.25f;
            out->at[i][1] = keys[i].pt.y - 0.25f;
            for (int c = 0; c < CV_DESCRIPTOR; c++)
                sum += in[c];
            for (int c = 0; c < CV_DESCRIPTOR; c++)
                to[c] = static_cast<int16_t>(std::nearbyint(ONE * std::sqrt(in[c] / sum)));
        }
        out->count = static_cast<int>(count);
        return 0;
    });
}

/* Products of all descriptors, whole numbers up to ONE * ONE. A loop of fixed length becomes the processor's products of 16 bits, and does not
 * depend on the machine's library of linear algebra: Debian's default one takes ten times as long. Sanitizers would take
 * most of a test's time for it; what they could see, sizes and rows, is seen where the product is read. */
__attribute__((no_sanitize("address", "undefined", "thread"))) static void multiply(cv::Mat &product, const struct cv_features *a, const struct cv_features *b)
{
    constexpr int some = 64; /* descriptors that stay in the first cache */

    product.create(a->count, b->count, CV_32F);
    for (int from = 0; from < b->count; from += some) {
        const int to = std::min(from + some, b->count);

        for (int i = 0; i < a->count; i++) {
            const int16_t *left = a->descriptor + static_cast<size_t>(i) * CV_DESCRIPTOR;
            float *row = product.ptr<float>(i);

            for (int j = from; j < to; j++) {
                const int16_t *right = b->descriptor + static_cast<size_t>(j) * CV_DESCRIPTOR;
                int32_t sum = 0;

                for (int c = 0; c < CV_DESCRIPTOR; c++)
                    sum += left[c] * right[c];
                row[j] = static_cast<float>(sum);
            }
        }
    }
}

int cv_features_match(const struct cv_features *a, const struct cv_features *b, int (*match)[2], int *count,
                      char why[256])
{
    return guarded(why, [&] {
        cv::Mat product;
        std::vector<float> back;
        std::vector<int> back_at;

        *count = 0;
        if (a->count < 2 || b->count < 2)
            return 0;
        multiply(product, a, b);
        back.assign(static_cast<size_t>(b->count), -1);
        back_at.assign(static_cast<size_t>(b->count), -1);
        for (int i = 0; i < a->count; i++) {
            const float *row = product.ptr<float>(i);

            for (int j = 0; j < b->count; j++) {
                if (row[j] > back[j]) {
                    back[j] = row[j];
                    back_at[j] = i;
                }
            }
        }
        for (int i = 0; i < a->count; i++) {
            const float *row = product.ptr<float>(i);
            float first = -1, second = -1;
            int at = 0;

            for (int j = 0; j < b->count; j++) {
                if (row[j] > first) {
                    second = first;
                    first = row[j];
                    at = j;
                } else if (row[j] > second) {
                    second = row[j];
                }
            }
            if (back_at[at] == i && ONE * ONE - first < RATIO * RATIO * (ONE * ONE - second)) {
                match[*count][0] = i;
                match[*count][1] = at;
                ++*count;
            }
        }
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
