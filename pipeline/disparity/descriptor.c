#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "pipeline/disparity/stage.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/network/network.h"

#define CENSUS_MARGIN 8 /* columns repeated on each side; the census window reaches 4 */

int sst_luma(struct sst_map_u8 *luma, const struct sst_image *img)
{
    const int err = sst_map_u8_init(luma, img->width, img->height);

    if (err)
        return err;
    for (int y = 0; y < img->height; y++) {
        const uint8_t *r = sst_image_row(img, 0, y), *g = sst_image_row(img, 1, y), *b = sst_image_row(img, 2, y);
        uint8_t *out = sst_map_u8_row(luma, y);

        for (int x = 0; x < img->width; x++)
            out[x] = (uint8_t)((77 * r[x] + 150 * g[x] + 29 * b[x] + 128) >> 8);
    }
    return 0;
}

/* Row y of the luma sampled at (x, y) + (px, py) / 4, with CENSUS_MARGIN columns repeated on both sides. */
static void phase_row(uint8_t *out, const struct sst_map_u8 *luma, int y, int px, int py)
{
    const int w = luma->width, h = luma->height;
    const uint8_t *a = sst_map_u8_row(luma, sst_clamp_int(y, 0, h - 1));
    const uint8_t *b = sst_map_u8_row(luma, sst_clamp_int(y + 1, 0, h - 1));
    uint8_t *o = out + CENSUS_MARGIN;

    for (int x = 0; x + 1 < w; x++)
        o[x] = (uint8_t)(((4 - py) * ((4 - px) * a[x] + px * a[x + 1]) + py * ((4 - px) * b[x] + px * b[x + 1]) + 8) >> 4);
    o[w - 1] = (uint8_t)(((4 - py) * a[w - 1] + py * b[w - 1] + 2) >> 2);
    memset(out, o[0], CENSUS_MARGIN);
    memset(o + w, o[w - 1], CENSUS_MARGIN);
}

static int make_census(struct sst_descriptor *desc, int phase)
{
    const size_t w = (size_t)desc->width, padded = sst_mem_stride(w + 2 * CENSUS_MARGIN, 1);
    const struct sst_kernels *k = sst_kernels_get();
    uint8_t *ring = sst_mem_alloc(7, padded);
    uint64_t *census;

    desc->census_stride = sst_mem_stride(w, sizeof(uint64_t)) / sizeof(uint64_t);
    census = sst_mem_alloc_raw((size_t)desc->height * desc->census_stride, sizeof(uint64_t));
    desc->census[phase] = census;
    if (!ring || !census) {
        sst_mem_free(ring);
        return -ENOMEM;
    }
    for (int y = 0, next = -3; y < desc->height; y++) {
        const uint8_t *rows[7];

        /* Row j of the image, borders repeated, lives in ring slot (j + 7) % 7. */
        for (; next <= y + 3; next++)
            phase_row(ring + (size_t)((next + 7) % 7) * padded, &desc->luma, next, phase % 4, phase / 4);
        for (int j = 0; j < 7; j++)
            rows[j] = ring + (size_t)((y + j - 3 + 7) % 7) * padded + CENSUS_MARGIN;
        k->census_row(census + (size_t)y * desc->census_stride, rows, w);
    }
    sst_mem_free(ring);
    return 0;
}

int sst_descriptor_add_phases(struct sst_descriptor *desc, unsigned phases)
{
    int err = 0;

    for (int p = 1; !err && desc->census[0] && p < SST_PHASES; p++) {
        if (phases & 1u << p && !desc->census[p])
            err = make_census(desc, p);
    }
    return err;
}

/* Luma with mean 0 and deviation 1 over the view: what the network was trained on. Constant views become 0. */
static void normalise(float *out, const struct sst_map_u8 *luma)
{
    const int64_t n = (int64_t)luma->width * luma->height;
    int64_t s1 = 0, s2 = 0;
    double mean, deviation;

    for (int y = 0; y < luma->height; y++) {
        const uint8_t *row = sst_map_u8_row(luma, y);

        for (int x = 0; x < luma->width; x++) {
            s1 += row[x];
            s2 += row[x] * row[x];
        }
    }
    mean = (double)s1 / (double)n;
    /* In double: n * s2 passes 2^63 from 12 million bright pixels on. Equal pixels still give exactly 0. */
    deviation = sqrt(fmax((double)n * (double)s2 - (double)s1 * (double)s1, 0)) / (double)n;
    for (int y = 0; y < luma->height; y++) {
        const uint8_t *row = sst_map_u8_row(luma, y);

        for (int x = 0; x < luma->width; x++)
            *out++ = deviation > 0 ? (float)((row[x] - mean) / deviation) : 0.0f;
    }
}

int sst_descriptor_check_network(struct sst_network *net, const char *name, int width, int height)
{
    int channels, out_w, out_h, err;

    if (sst_network_in_channels(net) != 1) {
        sst_log_error("%s is no matching network: it takes %d channels, not the luma alone; give --mccnn-model "
                      "another one", name, sst_network_in_channels(net));
        return -EBADMSG;
    }
    err = sst_network_out_shape(net, width, height, &channels, &out_w, &out_h);
    if (!err && (channels != SST_FEATURE_CHANNELS || out_w != width || out_h != height)) {
        sst_log_error("%s is no matching network: it makes %d channels of %dx%d from a view of %dx%d, not %d of "
                      "the same size; give --mccnn-model another one", name, channels, out_w, out_h, width, height,
                      SST_FEATURE_CHANNELS);
        err = -EBADMSG;
    }
    return err;
}

/* Bytes between groups of channels: every 64 pixels begun, and an odd number of cache lines, so that the groups of a pixel
 * lie in different sets of the cache. */
static size_t feature_stride(int width)
{
    const size_t stride = 4 * (((size_t)width + 63) / 64 * 64);

    return stride + SST_ALIGN * (stride / SST_ALIGN % 2 == 0);
}

/* Four components of each pixel, from where they lie SST_FEATURE_CHANNELS apart to side by side. */
static void gather(uint8_t *to, const int8_t *from, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        for (size_t c = 0; c < 4; c++)
            to[4 * x + c] = (uint8_t)(SST_FEATURE_ZERO + from[SST_FEATURE_CHANNELS * x + c]);
    }
}

static int make_features(struct sst_descriptor *desc, struct sst_network *net)
{
    enum { GROUPS = SST_FEATURE_CHANNELS / 4 };
    const size_t w = (size_t)desc->width, h = (size_t)desc->height;
    float *in = sst_mem_alloc_raw(w * h, sizeof(float));
    int8_t *out = NULL;
    int err = -ENOMEM;

    if (!in)
        goto done;
    out = sst_mem_alloc_raw(SST_FEATURE_CHANNELS * w * h, 1);
    desc->feature_stride = feature_stride(desc->width);
    desc->feature_memory = sst_mem_alloc(GROUPS * h + 2, desc->feature_stride);
    if (!out || !desc->feature_memory)
        goto done;
    desc->features = (uint8_t *)desc->feature_memory + desc->feature_stride;
    normalise(in, &desc->luma);
    err = sst_network_run_s8(net, in, desc->width, desc->height, SST_FEATURE_ONE, out);
    if (err)
        goto done;
    for (size_t y = 0; y < h; y++) {
        for (size_t g = 0; g < GROUPS; g++)
            gather(desc->features + (y * GROUPS + g) * desc->feature_stride,
                   out + SST_FEATURE_CHANNELS * w * y + 4 * g, w);
    }
done:
    sst_mem_free(in);
    sst_mem_free(out);
    return err;
}

int sst_descriptor_init(struct sst_descriptor *desc, const struct sst_image *img, int scale, enum sst_cost cost,
                        struct sst_network *net)
{
    struct sst_descriptor made = { .image = *img };
    int err = 0;

    if (scale == 2) {
        err = sst_image_halve(&made.image, img);
        if (err)
            return err;
        made.image_owned = true;
    }
    made.width = made.image.width;
    made.height = made.image.height;
    err = sst_luma(&made.luma, &made.image);
    if (!err && cost & SST_COST_CENSUS)
        err = make_census(&made, 0);
    if (!err && cost & SST_COST_MCCNN)
        err = make_features(&made, net);
    if (err) {
        sst_descriptor_fini(&made);
        return err;
    }
    *desc = made;
    return 0;
}

void sst_descriptor_fini(struct sst_descriptor *desc)
{
    if (desc->image_owned)
        sst_image_fini(&desc->image);
    sst_map_u8_fini(&desc->luma);
    for (int p = 0; p < SST_PHASES; p++)
        sst_mem_free(desc->census[p]);
    sst_mem_free(desc->feature_memory);
    *desc = (struct sst_descriptor){ 0 };
}
