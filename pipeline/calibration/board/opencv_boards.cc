/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/calibration/board/opencv_boards.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <mutex>
#include <new>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
/* OpenCV moved markers from the contributed modules to a class of a main module. */
#define MARKERS_ARE_MAIN (CV_VERSION_MAJOR > 4 || (CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR >= 7))
#if MARKERS_ARE_MAIN
#include <opencv2/objdetect/aruco_detector.hpp>
#else
#include <opencv2/aruco.hpp>
#endif

/* Suppresses OpenCV's printing of the exceptions that it throws. */
static int silent(int, const char *, const char *, const char *, int, void *)
{
    return 0;
}

template <typename Fn> static int guarded(Fn fn)
{
    static std::once_flag once;

    try {
        std::call_once(once, [] { cv::redirectError(silent); });
        return fn();
    } catch (const std::bad_alloc &) {
        return -ENOMEM;
    } catch (...) {
        return -EINVAL;
    }
}

static cv::Mat mat_of(const struct sst_map_u8 *luma)
{
    return cv::Mat(luma->height, luma->width, CV_8U, luma->data, luma->stride); /* only read */
}

int cv_chessboard(float (*corner)[2], const struct sst_map_u8 *luma, int cols, int rows, int thorough)
{
    return guarded([&] {
        const int flags = cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK;
        const cv::Size size(cols, rows);
        std::vector<cv::Point2f> found;

        if (!(thorough ? cv::findChessboardCornersSB(mat_of(luma), size, found)
                       : cv::findChessboardCorners(mat_of(luma), size, found, flags)) ||
            found.size() != (size_t)cols * (size_t)rows)
            return 0;
        for (size_t i = 0; i < found.size(); i++) {
            corner[i][0] = found[i].x;
            corner[i][1] = found[i].y;
        }
        return 1;
    });
}

int cv_any_chessboard(const struct sst_map_u8 *luma, int *cols, int *rows)
{
    return guarded([&] {
        std::vector<cv::Point2f> found;
        cv::Mat meta;

        if (!cv::findChessboardCornersSB(mat_of(luma), cv::Size(3, 3), found,
                                         cv::CALIB_CB_LARGER | cv::CALIB_CB_EXHAUSTIVE, meta))
            return 0;
        *cols = meta.cols;
        *rows = meta.rows;
        return 1;
    });
}

/* --- markers ----------------------------------------------------------------------------------------------------- */

using quad = std::vector<cv::Point2f>;

static cv::aruco::Dictionary dictionary_of(int number)
{
#if MARKERS_ARE_MAIN
    return cv::aruco::getPredefinedDictionary(number);
#else
    return *cv::aruco::getPredefinedDictionary(number);
#endif
}

struct markers {
    std::vector<quad> found, rejected;
    std::vector<int> ids; /* of `found` */
};

static markers find_markers(const cv::Mat &luma, const cv::aruco::Dictionary &dict, int border)
{
    markers m;
#if MARKERS_ARE_MAIN
    cv::aruco::DetectorParameters how;

    how.markerBorderBits = border;
    cv::aruco::ArucoDetector(dict, how).detectMarkers(luma, m.found, m.ids, m.rejected);
#else
    const auto how = cv::aruco::DetectorParameters::create();

    how->markerBorderBits = border;
    cv::aruco::detectMarkers(luma, cv::makePtr<cv::aruco::Dictionary>(dict), m.found, m.ids, how, m.rejected);
#endif
    return m;
}

/* A quad with each side moved outwards by px. */
static quad grown(const quad &q, float px)
{
    quad out(4);

    for (int k = 0; k < 4; k++) {
        const cv::Point2f in = q[k] - q[(k + 3) % 4], on = q[(k + 1) % 4] - q[k];
        const float li = std::sqrt(in.dot(in)), lo = std::sqrt(on.dot(on)), turn = (float)in.cross(on) / (li * lo);

        out[k] = turn > 0.1f ? q[k] + px / turn * (in / li - on / lo) : q[k];
    }
    return out;
}

static float sample(const cv::Mat &luma, cv::Point2f p)
{
    const float x = std::min(std::max(p.x, 0.0f), (float)luma.cols - 1.001f);
    const float y = std::min(std::max(p.y, 0.0f), (float)luma.rows - 1.001f);
    const int i = (int)x, j = (int)y;
    const float u = x - (float)i, v = y - (float)j;
    const uint8_t *top = luma.ptr<uint8_t>(j) + i, *low = luma.ptr<uint8_t>(j + 1) + i;

    return (1 - v) * ((1 - u) * (float)top[0] + u * (float)top[1]) + v * ((1 - u) * (float)low[0] + u * (float)low[1]);
}

/* Modules of a tag, border included, sampled at their centres. */
static std::vector<float> modules(const cv::Mat &luma, const quad &q, int side)
{
    const std::vector<cv::Point2f> unit = { { 0, 0 }, { 1, 0 }, { 1, 1 }, { 0, 1 } };
    std::vector<cv::Point2f> at, to;
    std::vector<float> out;

    for (int i = 0; i < side * side; i++)
        at.emplace_back(((float)(i % side) + 0.5f) / (float)side, ((float)(i / side) + 0.5f) / (float)side);
    cv::perspectiveTransform(at, to, cv::getPerspectiveTransform(unit, q));
    for (const auto &p : to)
        out.push_back(sample(luma, p));
    return out;
}

/* Read a quad as a tag: at most a tenth of the border's modules are not black, and the bits are in the dictionary. */
static bool read_tag(const cv::Mat &luma, quad q, const cv::aruco::Dictionary &dict, int border, cv_marker *out)
{
    const int inner = dict.markerSize, side = inner + 2 * border;
    const std::vector<float> grey = modules(luma, q, side);
    cv::Mat bits(inner, inner, CV_8U);
    std::vector<float> edge, middle;
    int id, turn, wrong = 0;

    for (int i = 0; i < side * side; i++) {
        const int x = i % side - border, y = i / side - border;

        (x >= 0 && y >= 0 && x < inner && y < inner ? middle : edge).push_back(grey[i]);
    }
    std::vector<float> sorted = edge, bright = middle;
    std::sort(sorted.begin(), sorted.end());
    std::sort(bright.begin(), bright.end());
    const float black = sorted[sorted.size() / 2], white = bright[bright.size() * 9 / 10], limit = (black + white) / 2;

    if (white - black < 16)
        return false;
    for (const float g : edge)
        wrong += g > limit;
    for (size_t i = 0; i < middle.size(); i++)
        bits.at<uint8_t>((int)i / inner, (int)i % inner) = middle[i] > limit;
    if (wrong * 10 > (int)edge.size() || !dict.identify(bits, id, turn, 0.6))
        return false;
    out->id = id;
    for (int k = 0; k < 4; k++) {
        out->corner[k][0] = q[(k + 4 - turn) % 4].x;
        out->corner[k][1] = q[(k + 4 - turn) % 4].y;
    }
    return true;
}

int cv_markers(struct cv_marker *out, int max, const struct sst_map_u8 *luma, int dictionary, int border)
{
    return guarded([&] {
        const markers m = find_markers(mat_of(luma), dictionary_of(dictionary), border);
        int n = 0;

        for (size_t i = 0; i < m.ids.size() && n < max; i++, n++) {
            out[n].id = m.ids[i];
            for (int k = 0; k < 4; k++) {
                out[n].corner[k][0] = m.found[i][k].x;
                out[n].corner[k][1] = m.found[i][k].y;
            }
        }
        return n;
    });
}

int cv_touching_tags(struct cv_marker *out, int max, const struct sst_map_u8 *luma, int dictionary, int border)
{
    return guarded([&] {
        const auto dict = dictionary_of(dictionary);
        const cv::Mat grey = mat_of(luma);
        cv::Mat parted;
        int n = 0;

        if (grey.cols < 3 || grey.rows < 3)
            return 0;
        /* Dilating white separates tags that touch at corners; the quads are then one pixel too small on each side.
         * Too few bits survive the dilation, so they are read from the picture itself. */
        cv::dilate(grey, parted, cv::Mat::ones(3, 3, CV_8U));
        markers m = find_markers(parted, dict, border);
        m.found.insert(m.found.end(), m.rejected.begin(), m.rejected.end());
        for (size_t i = 0; i < m.found.size() && n < max; i++)
            n += read_tag(grey, grown(m.found[i], 1), dict, border, &out[n]);
        return n;
    });
}

int cv_dictionary(int dictionary, int *modules)
{
    return guarded([&] {
        const auto dict = dictionary_of(dictionary);

        *modules = dict.markerSize;
        return dict.bytesList.rows;
    });
}

int cv_marker_bits(uint8_t *bits, int dictionary, int id)
{
    return guarded([&] {
        const auto dict = dictionary_of(dictionary);
        const cv::Mat m =
            cv::aruco::Dictionary::getBitsFromByteList(dict.bytesList.rowRange(id, id + 1), dict.markerSize);

        for (int y = 0; y < m.rows; y++) {
            for (int x = 0; x < m.cols; x++)
                bits[y * m.cols + x] = m.at<uint8_t>(y, x);
        }
        return 0;
    });
}
