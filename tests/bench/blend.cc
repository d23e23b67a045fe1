/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/bench/blend.h"

#include <cmath>
#include <vector>

#include <opencv2/imgproc.hpp>

#define BAND_ROWS 64
#define WHOLE_PX 1e-6 /* as in the renderer: shifts this close to a whole number are whole */

struct bench_blend {
    int width, height;
    std::vector<cv::Mat> colour;       /* 8-bit, three channels */
    std::vector<cv::Mat> weight;       /* float; empty: all rays weigh 1 */
    std::vector<cv::Point2d> shift_px; /* of the view against the picture */
    cv::Mat out;
};

static cv::Mat interleave(const struct sst_image *img)
{
    cv::Mat planes[3], merged;

    for (int c = 0; c < 3; c++)
        planes[c] = cv::Mat(img->height, img->width, CV_8U, img->plane[c], img->stride);
    cv::merge(planes, 3, merged);
    return merged;
}

static int weigh(struct bench_blend *b, struct sst_renderer *renderer, const struct sst_render_config *cfg, int view)
{
    struct sst_map_f32 depth = {}, label = {};
    int err = sst_map_f32_init(&depth, b->width, b->height);

    err = err ? err : sst_map_f32_init(&label, b->width, b->height);
    err = err ? err : sst_render_weights(renderer, cfg, view, &depth, &label);
    if (!err) {
        cv::Mat d(b->height, b->width, CV_32F, depth.data, depth.stride);
        cv::Mat l(b->height, b->width, CV_32F, label.data, label.stride);
        b->weight.push_back(d.mul(l));
    }
    sst_map_f32_fini(&depth);
    sst_map_f32_fini(&label);
    return err;
}

struct bench_blend *bench_blend_create(const struct sst_lightfield *lf, struct sst_renderer *renderer,
                                       const struct sst_render_config *cfg)
{
    struct bench_blend *b = new bench_blend{ lf->width, lf->height, {}, {}, {}, {} };

    cv::setNumThreads(cfg->threads);
    for (int view = 0; view < lf->rows * lf->cols; view++) {
        const struct sst_view *v = &lf->views[view];

        b->colour.push_back(interleave(&v->image));
        b->shift_px.emplace_back(-cfg->focus_px * v->bx, -cfg->focus_px * v->by);
        if (cfg->method == SST_RENDER_SST && weigh(b, renderer, cfg, view)) {
            bench_blend_destroy(b);
            return nullptr;
        }
    }
    b->out.create(b->height, b->width, CV_8UC3);
    return b;
}

void bench_blend_destroy(struct bench_blend *b)
{
    delete b;
}

/* Output positions from..to along one axis whose two taps lie inside the view, for a shift of whole + part. */
static void inside(double shift, int size, int *from, int *to, int *nearest)
{
    const int whole = static_cast<int>(std::floor(shift + WHOLE_PX));
    const double part = shift - whole;

    *from = std::max(0, -whole);
    *to = std::min(size, size - whole - (part > WHOLE_PX));
    *nearest = whole + (part >= 0.5);
}

/* Add the rays of one view to the sums of the rows y0..y1. */
static void add_view(const struct bench_blend *b, size_t view, int y0, int y1, cv::Mat &sum, cv::Mat &wsum)
{
    const cv::Point2d shift = b->shift_px[view];
    int left, right, top, bottom, nx, ny;
    cv::Mat piece, wide, weights;

    inside(shift.x, b->width, &left, &right, &nx);
    inside(shift.y, b->height, &top, &bottom, &ny);
    top = std::max(top, y0);
    bottom = std::min(bottom, y1);
    if (left >= right || top >= bottom)
        return;
    const cv::Rect at(left, top - y0, right - left, bottom - top);
    const cv::Matx23d place(1, 0, left + shift.x, 0, 1, top + shift.y);
    cv::Mat total = sum(at), weight_total = wsum(at);

    cv::warpAffine(b->colour[view], piece, place, at.size(), cv::INTER_LINEAR | cv::WARP_INVERSE_MAP);
    if (b->weight.empty()) {
        cv::accumulate(piece, total);
        cv::add(weight_total, 1, weight_total);
        return;
    }
    const cv::Mat weight = b->weight[view](cv::Rect(left + nx, top + ny, at.width, at.height));
    const cv::Mat three[3] = { weight, weight, weight };

    piece.convertTo(wide, CV_32F);
    cv::merge(three, 3, weights);
    cv::accumulateProduct(wide, weights, total);
    cv::accumulate(weight, weight_total);
}

void bench_blend_render(struct bench_blend *b)
{
    cv::parallel_for_(cv::Range(0, (b->height + BAND_ROWS - 1) / BAND_ROWS), [b](const cv::Range &bands) {
        for (int band = bands.start; band < bands.end; band++) {
            const int y0 = band * BAND_ROWS, y1 = std::min(y0 + BAND_ROWS, b->height);
            cv::Mat sum = cv::Mat::zeros(y1 - y0, b->width, CV_32FC3), wsum = cv::Mat::zeros(y1 - y0, b->width, CV_32F);
            cv::Mat divisor, quotient;

            for (size_t view = 0; view < b->colour.size(); view++)
                add_view(b, view, y0, y1, sum, wsum);
            wsum = cv::max(wsum, 1e-30f); /* no ray: black */
            cv::merge(std::vector<cv::Mat>{ wsum, wsum, wsum }, divisor);
            cv::divide(sum, divisor, quotient);
            quotient.convertTo(b->out.rowRange(y0, y1), CV_8U);
        }
    });
}

void bench_blend_copy(const struct bench_blend *b, struct sst_image *out)
{
    cv::Mat planes[3];

    for (int c = 0; c < 3; c++)
        planes[c] = cv::Mat(b->height, b->width, CV_8U, out->plane[c], out->stride);
    cv::split(b->out, planes);
}
