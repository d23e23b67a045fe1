/* Features of views that are cut into bands, against one run of the network over the whole view. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/mem.h"
#include "pipeline/method/disparity/stage.h"
#include "pipeline/method/network/network.h"
#include "simulators/scene/noise.h"
#include "tests/onnx_writer.h"
#include "tests/test.h"

#define SHIPPED "models/mccnn-fast.onnx"

static void band_is(int rows, int radius, int i, int start, int first, int end)
{
    const struct sst_disparity_feature_bands bands = sst_disparity_feature_bands(rows, radius);
    const struct sst_disparity_feature_band b = sst_disparity_feature_band(&bands, rows, radius, i);

    assert_int_equal(b.start, start);
    assert_int_equal(b.first, first);
    assert_int_equal(b.end, end);
}

static void bands_of_known_heights(void **state SST_UNUSED)
{
    /* 750 rows: three bands, a step of (750 - 8) / 3 = 247.3, in tiles of 4 248; 248 + 8 rows, and 2 to be 750 mod 4.
     */
    struct sst_disparity_feature_bands b = sst_disparity_feature_bands(750, 4);

    assert_int_equal(b.count, 3);
    assert_int_equal(b.step, 248);
    assert_int_equal(b.height, 258);
    band_is(750, 4, 0, 0, 0, 252);
    band_is(750, 4, 1, 248, 252, 500);
    band_is(750, 4, 2, 492, 500, 750); /* 750 - 258 */

    /* A radius of 5 takes 8 rows above, to stay on a tile: (521 - 13) / 3 = 169.3, 172, and 172 + 13 = 521 mod 4. */
    b = sst_disparity_feature_bands(521, 5);
    assert_int_equal(b.count, 3);
    assert_int_equal(b.step, 172);
    assert_int_equal(b.height, 185);
    band_is(521, 5, 1, 172, 180, 352);
    band_is(521, 5, 2, 336, 352, 521);

    assert_int_equal(sst_disparity_feature_bands(750, -1).count, 1); /* not known */
    band_is(750, -1, 0, 0, 0, 750);
    band_is(256, 4, 0, 0, 0, 256);
    band_is(1, 4, 0, 0, 0, 1);
    band_is(750, 1024, 0, 0, 0, 750); /* the view is smaller than the surroundings of a row */
}

static void bands_reach_far_enough(void **state SST_UNUSED)
{
    static const int radii[] = { 0, 1, 3, 4, 9, 64, 1024 };

    for (size_t r = 0; r < ARRAY_LEN(radii); r++) {
        for (int rows = 1; rows < 2500; rows++) {
            const struct sst_disparity_feature_bands bands = sst_disparity_feature_bands(rows, radii[r]);
            int next = 0;

            for (int i = 0; i < bands.count; i++) {
                const struct sst_disparity_feature_band b = sst_disparity_feature_band(&bands, rows, radii[r], i);
                const int stop = b.start + bands.height;

                if (b.start < 0 || b.start % SST_FEATURE_TILE || stop > rows ||
                    (i + 1 == bands.count && stop != rows) || b.first != next || b.end <= b.first ||
                    b.start > sst_max_int(b.first - radii[r], 0) || stop < sst_min_int(b.end + radii[r], rows))
                    fail_msg("%d rows, radius %d, band %d: %d..%d of %d", rows, radii[r], i, b.first, b.end, b.start);
                next = b.end;
            }
            assert_int_equal(next, rows);
        }
    }
}

/* --- networks ------------------------------------------------------------------------------------- */

/* One 3x3 layer of 64 channels and unit length, of radius 1; its metadata says `radius`, or nothing. */
static struct sst_network *one_layer(const char *radius)
{
    char path[] = "/tmp/sst-features-XXXXXX";
    struct sst_network *net;

    ow_feature_network(path, radius);
    assert_int_equal(sst_network_open(&net, path, SST_PRECISION_F32, 1), 0);
    unlink(path);
    return net;
}

static struct sst_image texture(int width, int height)
{
    struct sst_image img;
    uint64_t seed = 1;

    assert_int_equal(sst_image_init(&img, width, height), 0);
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < height; y++) {
            for (int x = 0; x < width; x++) /* brighter below */
                sst_image_row(&img, c, y)[x] = (uint8_t)(sst_random_u64(&seed) % 128 + (uint64_t)(y * 128 / height));
        }
    }
    return img;
}

/* The network over the whole view at once, its luma standardised here. */
static int8_t *whole_view(struct sst_network *net, const struct sst_map_u8 *luma)
{
    const size_t n = (size_t)luma->width * (size_t)luma->height;
    float *in = calloc(n, sizeof(*in));
    int8_t *out = malloc(64 * n);
    double sum = 0, squares = 0;

    assert_true(in && out);
    for (size_t i = 0; i < n; i++) {
        const double v = sst_map_u8_row(luma, (int)(i / (size_t)luma->width))[i % (size_t)luma->width];

        sum += v;
        squares += v * v;
    }
    for (size_t i = 0; i < n; i++) {
        const double v = sst_map_u8_row(luma, (int)(i / (size_t)luma->width))[i % (size_t)luma->width];

        in[i] = (float)((v - sum / (double)n) / (sqrt((double)n * squares - sum * sum) / (double)n));
    }
    assert_int_equal(sst_network_run_s8(
                         net, &(struct sst_network_bytes){ in, luma->width, luma->height, SST_FEATURE_ONE, out, NULL }),
                     0);
    free(in);
    return out;
}

static int component(const struct sst_descriptor *d, int x, int y, int c)
{
    return d->features[((size_t)y * 16 + (size_t)c / 4) * d->feature_stride + 4 * (size_t)x + (size_t)c % 4];
}

struct difference {
    int64_t components;
    int largest;
};

/* Features as matching gets them, against those of one run. */
static struct difference compare(struct sst_network *net, int width, int height)
{
    struct sst_image img = texture(width, height);
    struct difference diff = { 0 };
    struct sst_descriptor desc;
    int8_t *want;

    assert_int_equal(sst_descriptor_init(&desc, &img, 1, SST_COST_MCCNN, net), 0);
    want = whole_view(net, &desc.luma);
    for (int i = 0; i < 64 * width * height; i++) {
        const int e = abs(component(&desc, i / 64 % width, i / 64 / width, i % 64) - SST_FEATURE_ZERO - want[i]);

        diff.components += e > 0;
        diff.largest = sst_max_int(diff.largest, e);
    }
    free(want);
    sst_descriptor_fini(&desc);
    sst_image_fini(&img);
    return diff;
}

static void one_layer_in_bands(void **state SST_UNUSED)
{
    static const char *const radii[] = { "1", "4", NULL };
    struct sst_network *net;

    for (size_t i = 0; i < ARRAY_LEN(radii); i++) {
        net = one_layer(radii[i]);
        assert_int_equal(compare(net, 21, 391).components, 0);
        sst_network_close(net);
    }
    /* A radius that is too small must show: two bands of 256 rows meet without seeing each other. */
    net = one_layer("0");
    assert_true(compare(net, 21, 512).largest > 1);
    sst_network_close(net);
}

static void wrong_radii_are_refused(void **state SST_UNUSED)
{
    static const char *const radii[] = { "", "four", "4x", "-1", "1025", "99999999999999999999" };
    struct sst_image img = texture(9, 9);
    struct sst_descriptor desc;

    for (size_t i = 0; i < ARRAY_LEN(radii); i++) {
        struct sst_network *net = one_layer(radii[i]);

        assert_int_equal(sst_descriptor_init(&desc, &img, 1, SST_COST_MCCNN, net), -EBADMSG);
        sst_network_close(net);
    }
    sst_image_fini(&img);
}

static void shipped_network_in_bands(void **state SST_UNUSED)
{
    static const enum sst_precision precisions[] = { SST_PRECISION_INT8, SST_PRECISION_F32 };
    static const int heights[] = { 269, 391, 520 }; /* rows modulo the tile: 1, 3, 0 */

    for (size_t p = 0; p < ARRAY_LEN(precisions); p++) {
        for (size_t i = 0; i < ARRAY_LEN(heights); i++) {
            struct difference diff[2];

            for (int threads = 1; threads <= 2; threads++) {
                struct sst_network *net;

                assert_int_equal(sst_network_open(&net, SHIPPED, precisions[p], threads), 0);
                diff[threads - 1] = compare(net, 45, heights[i]);
                sst_network_close(net);
            }
            assert_int_equal(diff[0].components, diff[1].components);
            assert_true(diff[0].largest <= (precisions[p] == SST_PRECISION_F32));
            /* Roundings near a half: about one component in a million. */
            assert_true(diff[0].components <= 64 * 45 * heights[i] / 10000);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bands_of_known_heights),   cmocka_unit_test(bands_reach_far_enough),
        cmocka_unit_test(one_layer_in_bands),       cmocka_unit_test(wrong_radii_are_refused),
        cmocka_unit_test(shipped_network_in_bands),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
