/* tests/sim_test.h - simulated worlds for tests: a temporary folder, world files in it, decoded frames. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_SIM_TEST_H
#define SST_TESTS_SIM_TEST_H

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <linux/videodev2.h>
#include <turbojpeg.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/image.h"
#include "simulators/scene/world/sim_world.h"
#include "simulators/scene/world/world_internal.h"
#include "tests/folder.h"
#include "tests/test.h"

#define SIM_CAPACITY ((size_t)4 << 20)

static uint8_t sim_out[SIM_CAPACITY];

/** Open the world of this text; the cache is the test's folder. */
static inline struct sst_sim_world *sim_open(const char *text)
{
    struct sst_sim_world *w = NULL;

    assert_int_equal(sst_file_write(test_path("w.yaml"), text, strlen(text)), 0);
    assert_int_equal(sst_sim_world_open(&w, test_path("w.yaml"), test_folder), 0);
    return w;
}

/** A frame's bytes in sim_out. */
static inline size_t sim_frame(struct sst_sim_world *w, const struct sst_sim_exposure *e, uint32_t fourcc, int width,
                               int height)
{
    size_t bytes = 0;

    assert_int_equal(sst_sim_world_frame(w, e, (struct sst_sim_format){ fourcc, width, height },
                                         (struct sst_sim_room){ sim_out, SIM_CAPACITY }, &bytes),
                     0);
    return bytes;
}

/** Luma of a JPEG, decoded without a single warning. @return [height][width] to free */
static inline uint8_t *sim_decode(const uint8_t *data, size_t bytes, int width, int height)
{
    tjhandle tj = tjInitDecompress();
    uint8_t *luma = (uint8_t *)malloc((size_t)width * (size_t)height);
    int w, h, subsampling, colours;

    assert_non_null(tj);
    assert_non_null(luma);
    assert_int_equal(tjDecompressHeader3(tj, data, bytes, &w, &h, &subsampling, &colours), 0);
    assert_int_equal(w, width);
    assert_int_equal(h, height);
    assert_int_equal(subsampling, TJSAMP_422);
    if (tjDecompress2(tj, data, bytes, luma, width, 0, height, TJPF_GRAY, TJFLAG_STOPONWARNING))
        fail_msg("%s", tjGetErrorStr2(tj));
    tjDestroy(tj);
    return luma;
}

/** Luma of the native MJPEG frame of a camera. */
static inline uint8_t *sim_luma(struct sst_sim_world *w, const struct sst_sim_exposure *e)
{
    const struct sst_sim_settings *s = sst_sim_world_settings(w);
    const size_t bytes = sim_frame(w, e, V4L2_PIX_FMT_MJPEG, s->width, s->height);

    return sim_decode(sim_out, bytes, s->width, s->height);
}

/** Mean of the squared differences of rows y0 .. y1-1 as PSNR, dB. @param image  RGB of the same size */
static inline double sim_psnr(const uint8_t *luma, const struct sst_image *image, int y0, int y1)
{
    double sum = 0;

    for (int y = y0; y < y1; y++) {
        for (int x = 0; x < image->width; x++) {
            const double want = 0.299 * sst_image_row(image, 0, y)[x] + 0.587 * sst_image_row(image, 1, y)[x] +
                                0.114 * sst_image_row(image, 2, y)[x];
            const double diff = luma[(size_t)y * (size_t)image->width + (size_t)x] - want;

            sum += diff * diff;
        }
    }
    sum /= (double)(y1 - y0) * image->width;
    return 10 * log10(255 * 255 / fmax(sum, 1e-9));
}

#endif
