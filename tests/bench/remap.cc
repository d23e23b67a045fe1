/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/bench/remap.h"

#include <opencv2/imgproc.hpp>

struct bench_remap {
    cv::Mat img, places, parts, out;
    int interpolation;
};

struct bench_remap *bench_remap_create(const struct sst_image *img, const struct sst_map_f32 *x,
                                       const struct sst_map_f32 *y, enum sst_filter filter)
{
    struct bench_remap *r = new bench_remap;
    cv::Mat planes[3];

    cv::setNumThreads(1);
    r->interpolation = filter == SST_FILTER_BILINEAR ? cv::INTER_LINEAR
                       : filter == SST_FILTER_BICUBIC ? cv::INTER_CUBIC
                                                      : cv::INTER_LANCZOS4;
    for (int c = 0; c < 3; c++)
        planes[c] = cv::Mat(img->height, img->width, CV_8U, img->plane[c], img->stride);
    cv::merge(planes, 3, r->img);
    cv::convertMaps(cv::Mat(x->height, x->width, CV_32F, x->data, x->stride),
                    cv::Mat(y->height, y->width, CV_32F, y->data, y->stride), r->places, r->parts, CV_16SC2);
    return r;
}

void bench_remap_destroy(struct bench_remap *r)
{
    delete r;
}

void bench_remap_run(struct bench_remap *r)
{
    cv::remap(r->img, r->out, r->places, r->parts, r->interpolation);
}

void bench_remap_copy(const struct bench_remap *r, struct sst_image *out)
{
    cv::Mat planes[3];

    for (int c = 0; c < 3; c++)
        planes[c] = cv::Mat(out->height, out->width, CV_8U, out->plane[c], out->stride);
    cv::split(r->out, planes);
}
